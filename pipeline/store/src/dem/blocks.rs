//! Rows of a raster at a time, for rasters larger than memory.
//!
//! A GeoTIFF (strips or tiles, of every type and compression that [`super::read`] reads) is decoded as its rows are asked
//! for: memory holds the cells asked for, 8 bytes each and once as they are stored, and two rows of strips or tiles (at most
//! 256 MiB), which are kept for the next call: whoever reads downwards, overlapping or not, has each decoded once. Other
//! formats are read whole when they are opened.
//!
//! Infinite values are no data, as in [`super::read`], which counts them; a raster without any data is found out by its reader.

use super::checks::check_place;
use super::geotiff::Raster;
use super::raster::{DemError, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal};
use super::{SNIFFED_BYTES, format_of, read_with};
use sastrugi_numeric::{Geometry, Grid};
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Rows of strips or tiles that are kept: a part may end in one and the next begin there.
const ROWS_OF_BLOCKS: usize = 2;

/// A raster of which rows can be read.
pub struct BlockReader {
    path: PathBuf,
    rows: Rows,
}

enum Rows {
    File(Raster<BufReader<File>>),
    Held(Grid, DemInfo),
}

/// Opens a raster for reading rows.
///
/// # Errors
/// As [`super::read`]; what is wrong with the cells themselves is found when they are read.
pub fn open(path: &Path, options: &ReadOptions) -> Result<BlockReader, DemError> {
    let reading = |e| DemError::reading(path, e);
    let mut first = Vec::new();
    File::open(path).map_err(reading)?.take(SNIFFED_BYTES).read_to_end(&mut first).map_err(reading)?;
    let rows = match format_of(path, &first) {
        Some(Format::GeoTiff) => {
            let raster = Raster::open(path, options, ROWS_OF_BLOCKS)?;
            check_place(&raster.geometry).map_err(|refusal| refusal.about(path))?;
            Rows::File(raster)
        }
        _ => {
            let dem = read_with(path, options)?;
            Rows::Held(dem.grid, dem.info)
        }
    };
    Ok(BlockReader { path: path.to_owned(), rows })
}

impl BlockReader {
    /// Shape and place of the whole raster.
    pub fn geometry(&self) -> Geometry {
        match &self.rows {
            Rows::File(raster) => raster.geometry,
            Rows::Held(grid, _) => grid.geometry,
        }
    }

    /// What the file says about its heights.
    pub fn info(&self) -> &DemInfo {
        match &self.rows {
            Rows::File(raster) => &raster.info,
            Rows::Held(_, info) => info,
        }
    }

    /// Rows that are decoded together. (Of a raster whose first row is the southern one, they are counted from the south.)
    pub fn block_rows(&self) -> usize {
        match &self.rows {
            Rows::File(raster) => raster.block_rows,
            Rows::Held(..) => 1,
        }
    }

    /// Heights of some rows, counted from the north, m; `NaN` without data.
    ///
    /// # Errors
    /// As [`Self::read_part`].
    pub fn read_rows(&mut self, rows: Range<usize>) -> Result<Grid, DemError> {
        let cols = 0..self.geometry().cols;
        self.read_part(rows, cols)
    }

    /// Heights of some rows, counted from the north, and columns, m; `NaN` without data.
    ///
    /// # Errors
    /// Rows or columns that the raster does not have or that are too many at once, and strips or tiles that cannot be decoded.
    pub fn read_part(&mut self, rows: Range<usize>, cols: Range<usize>) -> Result<Grid, DemError> {
        let g = self.geometry();
        let cells = (rows.len() as u64).saturating_mul(cols.len() as u64);
        if cells == 0 || rows.end > g.rows || cols.end > g.cols || cells > MAX_CELLS {
            let reason =
                format!("rows {rows:?} and columns {cols:?} of {} x {} cannot be read at once", g.rows, g.cols);
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
