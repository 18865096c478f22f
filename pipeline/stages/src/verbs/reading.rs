//! Reading of DEMs by the verbs.

use crate::error::Error;
use crate::operations::dem::{input_error, to_metres, window_of};
use crate::operations::masks;
use crate::operations::place::Place;
use sastrugi_store::dem::points::GridSettings;
use sastrugi_store::dem::{self, Dem, DemError, ReadOptions};
use sastrugi_store::transect::{self, TransectOptions, Transects};
use sastrugi_texture::noise::ReferenceNoise;
use std::path::{Path, PathBuf};

/// Which part of a DEM is read, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// Part of the DEM in its own coordinates.
    pub window: Option<[f64; 4]>,
    /// Cell size for files that state none, m.
    pub cell_m: Option<[f64; 2]>,
    /// How a point cloud is gridded.
    pub gridding: GridSettings,
    /// Mask files; `true` for those that exclude cells.
    pub masks: Vec<(PathBuf, bool)>,
    /// File that marks a smooth reference area, for the noise.
    pub noise_reference: Option<PathBuf>,
}

/// A DEM that was read.
pub struct Read {
    /// Heights in metres, cropped to the window and masked.
    pub dem: Dem,
    /// Notes on how it was read.
    pub notes: Vec<String>,
    /// Share of the window's cells with data that masks removed, if there are masks.
    pub masked_share: Option<f64>,
    /// Noise estimated in the reference area, if there is one.
    pub noise: Option<ReferenceNoise>,
}

/// Reads a DEM for the kernels: cropped, masked, in metres.
///
/// # Errors
/// A DEM or a mask that cannot be read, settings that do not apply to it, a window or masks that leave no data.
pub fn read(path: &Path, reading: &Reading) -> Result<Read, Error> {
    let read = read_as_it_is(path, reading)?;
    let (dem, converted) = to_metres(read.dem);
    Ok(Read { dem, notes: read.notes.into_iter().chain(converted).collect(), ..read })
}

/// As [`read`], but in the DEM's own coordinates: a geographic raster stays in degrees.
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

/// Reads transects, if the file contains any (see [`transect::looks_like`]).
///
/// # Errors
/// A file that cannot be read, or settings that do not apply to transects.
pub fn transects(path: &Path, reading: &Reading) -> Result<Option<Transects>, Error> {
    if !transect::looks_like(path) {
        return Ok(None);
    }
    let plain = Reading { cell_m: reading.cell_m, ..Reading::default() };
    let spacing_m = match reading.cell_m {
        Some([x, y]) if x != y => {
            return Err(Error::Usage(format!(
                "{}: transects have a single spacing; give one cell size",
                path.display()
            )));
        }
        cell => cell.map(|[x, _]| x),
    };
    if *reading != plain {
        let message = "window, masks, noise reference and point-cloud options do not apply to transects";
        return Err(Error::Usage(format!("{}: {message}", path.display())));
    }
    let options = TransectOptions { spacing_m, ..TransectOptions::default() };
    transect::read(path, &options).map(Some).map_err(refused)
}

/// Settings that do not apply to the file are bad usage.
fn refused(error: DemError) -> Error {
    match error {
        DemError::Unfit { .. } => Error::Usage(error.to_string()),
        other => input_error(other).into(),
    }
}
