//! Rows of a raster at a time, for rasters larger than memory.
//!
//! A GeoTIFF (strips or tiles, of every type and compression that [`super::read`] reads) is decoded as its rows are asked
//! for: memory holds the rows asked for, 8 bytes a cell, and the strips or the row of tiles around them, at most 64 MiB of
//! which are kept for the next call. Each call decodes whole strips and tiles, so that rows in multiples of
//! [`BlockReader::block_rows`] are decoded once. Other formats are read whole when they are opened.
//!
//! Infinite values are no data, as in [`super::read`], which counts them; a raster without any data is found out by its reader.

use super::geotiff::Raster;
use super::{DemError, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal, SNIFFED_BYTES, check_place, read_with};
use sastrugi_numeric::{Geometry, Grid};
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

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
    let rows = match Format::of_file(path, &first) {
        Some(Format::GeoTiff) => {
            let raster = Raster::open(path, options)?;
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
    /// Rows that the raster does not have or that are too many at once, and strips or tiles that cannot be decoded.
    pub fn read_rows(&mut self, rows: Range<usize>) -> Result<Grid, DemError> {
        let g = self.geometry();
        let count = rows.len();
        let fits = count > 0 && rows.end <= g.rows && (count as u64).saturating_mul(g.cols as u64) <= MAX_CELLS;
        if !fits {
            let reason = format!("rows {rows:?} of {} cannot be read at once", g.rows);
            return Err(DemError::Unfit { path: self.path.clone(), reason });
        }
        match &mut self.rows {
            Rows::Held(grid, _) => Ok(grid.window(rows.start, 0, count, g.cols)),
            Rows::File(raster) => {
                let mut values =
                    raster.rows(rows.start, count).map_err(|refusal: Refusal| refusal.about(&self.path))?;
                values.iter_mut().filter(|z| z.is_infinite()).for_each(|z| *z = f64::NAN);
                Ok(Grid::new(g.window(rows.start, 0, count, g.cols), values))
            }
        }
    }
}
