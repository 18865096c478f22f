//! Row-wise reading, for rasters larger than memory.
//!
//! A GeoTIFF (strips or tiles, of every type and compression that [`super::read`] supports) is decoded on demand. Memory holds
//! the requested cells, at 8 bytes each and once as stored, and two rows of strips or tiles (at most 256 MiB), which are kept
//! for the next call: reading downwards, with or without overlap, decodes each once. Other formats are read completely when
//! they are opened.
//!
//! Infinite values are treated as no data, as in [`super::read`], but are not counted; a raster without any data is not refused
//! here.

use super::checks::check_place;
use super::geotiff::Raster;
use super::raster::{Dem, DemError, DemInfo, MAX_CELLS, ReadOptions, Refusal};
use sastrugi_numeric::{Geometry, Grid};
use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Rows of strips or tiles kept: one part may end, and the next begin, within the same row.
const ROWS_OF_BLOCKS: usize = 2;

/// A raster that can be read by rows.
pub struct BlockReader {
    path: PathBuf,
    rows: Rows,
}

enum Rows {
    File(Raster<BufReader<File>>),
    Held(Grid, DemInfo),
}

impl BlockReader {
    /// Reader of a GeoTIFF, decoded on demand.
    pub(super) fn of_geotiff(path: &Path, options: &ReadOptions) -> Result<Self, DemError> {
        let raster = Raster::open(path, options, ROWS_OF_BLOCKS)?;
        check_place(&raster.geometry).map_err(|refusal| refusal.about(path))?;
        Ok(Self { path: path.to_owned(), rows: Rows::File(raster) })
    }

    /// Reader of a raster that is already in memory.
    pub(super) fn of_dem(path: &Path, dem: Dem) -> Self {
        Self { path: path.to_owned(), rows: Rows::Held(dem.grid, dem.info) }
    }

    /// Shape and position of the whole raster.
    pub fn geometry(&self) -> Geometry {
        match &self.rows {
            Rows::File(raster) => raster.geometry,
            Rows::Held(grid, _) => grid.geometry,
        }
    }

    /// Metadata of the file.
    pub fn info(&self) -> &DemInfo {
        match &self.rows {
            Rows::File(raster) => &raster.info,
            Rows::Held(_, info) => info,
        }
    }

    /// Rows that are decoded together, counted from the south if the first row is the southern one.
    pub fn block_rows(&self) -> usize {
        match &self.rows {
            Rows::File(raster) => raster.block_rows,
            Rows::Held(..) => 1,
        }
    }

    /// Heights of some rows, counted from the north, m; `NaN` means no data.
    ///
    /// # Errors
    /// As [`Self::read_part`].
    pub fn read_rows(&mut self, rows: Range<usize>) -> Result<Grid, DemError> {
        let cols = 0..self.geometry().cols;
        self.read_part(rows, cols)
    }

    /// Heights of some rows, counted from the north, and columns, m; `NaN` means no data.
    ///
    /// # Errors
    /// Rows or columns out of range, or too many at once; strips or tiles that cannot be decoded.
    pub fn read_part(&mut self, rows: Range<usize>, cols: Range<usize>) -> Result<Grid, DemError> {
        let g = self.geometry();
        let cells = (rows.len() as u64).saturating_mul(cols.len() as u64);
        if cells == 0 || rows.end > g.rows || cols.end > g.cols || cells > MAX_CELLS {
            let reason =
                format!("cannot read rows {rows:?} and columns {cols:?} of {} x {} cells at once", g.rows, g.cols);
            return Err(DemError::Unfit { path: self.path.clone(), reason });
        }
        match &mut self.rows {
            Rows::Held(grid, _) => Ok(grid.window(rows.start, cols.start, rows.len(), cols.len())),
            Rows::File(raster) => {
                let place = g.window(rows.start, cols.start, rows.len(), cols.len());
                let mut values = raster.window(rows, cols).map_err(|refusal: Refusal| refusal.about(&self.path))?;
                values.iter_mut().filter(|z| z.is_infinite()).for_each(|z| *z = f64::NAN);
                Ok(Grid::new(place, values))
            }
        }
    }
}
