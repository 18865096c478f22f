//! How the verbs read a DEM.

use crate::error::Error;
use crate::operations::dem::{input_error, to_metres, window_of};
use crate::operations::masks;
use crate::operations::place::Place;
use sastrugi_store::dem::points::GridSettings;
use sastrugi_store::dem::{self, Dem, DemError, ReadOptions};
use sastrugi_store::transect::{self, TransectOptions, Transects};
use sastrugi_texture::noise::ReferenceNoise;
use std::path::{Path, PathBuf};

/// What of a DEM is taken, and how it is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// Part of the DEM in its own coordinates.
    pub window: Option<[f64; 4]>,
    /// Cell size for files that carry none, m.
    pub cell_m: Option<[f64; 2]>,
    /// How a point cloud becomes cells.
    pub gridding: GridSettings,
    /// Files of the cells that take part, and those (`true`) of cells that do not.
    pub masks: Vec<(PathBuf, bool)>,
    /// File that marks a part which is smooth in reality, for the noise.
    pub noise_reference: Option<PathBuf>,
}

/// A DEM that was read.
pub struct Read {
    /// Window cut, masks applied, metres.
    pub dem: Dem,
    /// Sentences on how it was read.
    pub notes: Vec<String>,
    /// Share of the window's cells with data that masks dropped, where there are masks.
    pub masked_share: Option<f64>,
    /// Noise found in the reference, where there is one.
    pub noise: Option<ReferenceNoise>,
}

/// A DEM as the kernels want it: window cut, masks applied, metres.
///
/// # Errors
/// A DEM or a mask that cannot be read, settings that it does not take, a window or masks that leave no data.
pub fn read(path: &Path, reading: &Reading) -> Result<Read, Error> {
    let read = read_as_it_is(path, reading)?;
    let (dem, converted) = to_metres(read.dem);
    Ok(Read { dem, notes: read.notes.into_iter().chain(converted).collect(), ..read })
}

/// As [`read`], in the DEM's own coordinates: a geographic raster stays in degrees.
///
/// # Errors
/// As [`read`].
pub fn read_as_it_is(path: &Path, reading: &Reading) -> Result<Read, Error> {
    let options = ReadOptions { cell_m: reading.cell_m };
    let Dem { grid, info } = dem::read_gridded(path, &options, &reading.gridding).map_err(refused)?;
    let whole = grid.geometry;
    let mut grid = match reading.window {
        Some(window) => window_of(&grid, window)?,
        None => grid,
    };
    let place = Place::of(&whole, &grid.geometry);
    let noise = reading.noise_reference.as_ref().map(|path| masks::noise_of_file(&grid, &place, path)).transpose()?;
    let masked_share = masks::of_files(&mut grid, &place, &reading.masks)?;
    let said = [noise.as_ref().map(masks::noise_note), masked_share.map(masks::share_note)];
    let notes = info.notes.iter().cloned().chain(said.into_iter().flatten()).collect();
    Ok(Read { dem: Dem { grid, info }, notes, masked_share, noise })
}

/// Transects, where the file holds some (see [`transect::looks_like`]).
///
/// # Errors
/// A file that cannot be read, or settings that transects do not take.
pub fn transects(path: &Path, reading: &Reading) -> Result<Option<Transects>, Error> {
    if !transect::looks_like(path) {
        return Ok(None);
    }
    let plain = Reading { cell_m: reading.cell_m, ..Reading::default() };
    let spacing_m = match reading.cell_m {
        Some([x, y]) if x != y => {
            return Err(Error::Usage(format!("{}: transects have one cell size", path.display())));
        }
        cell => cell.map(|[x, _]| x),
    };
    if *reading != plain {
        let message = "is a table of transects, which take no window, mask, noise reference or setting of point clouds";
        return Err(Error::Usage(format!("{}: {message}", path.display())));
    }
    let options = TransectOptions { spacing_m, ..TransectOptions::default() };
    transect::read(path, &options).map(Some).map_err(refused)
}

/// Settings that the file does not take are the caller's.
fn refused(error: DemError) -> Error {
    match error {
        DemError::Unfit { .. } => Error::Usage(error.to_string()),
        other => input_error(other).into(),
    }
}
