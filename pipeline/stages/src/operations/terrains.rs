//! A generator run and checked, and its heights and maps as files.

use crate::job::JobError;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_store::atomic::Target;
use sastrugi_store::dem::{self, Values};
use sastrugi_terrain::{Generator, Input, Map, MapKind, Terrain, TerrainError};

/// How a map is written.
pub fn values_of(map: &Map) -> Values {
    match map.kind() {
        MapKind { unit: "", description, .. } => Values::Codes { description: description.into() },
        MapKind { unit, description, .. } => Values::Figures { unit: unit.into(), description: description.into() },
    }
}

/// What a generator makes, checked.
///
/// # Errors
/// When the generator has no result, or heights that are not finite or the same everywhere.
pub fn generate(generator: &dyn Generator, streams: &Streams, inputs: &[Input]) -> Result<Terrain, JobError> {
    generator.generate_checked(streams, inputs).map_err(|e| {
        let message = format!("failed to {e}");
        // The input surface is not usable: another part of it, or another file, would.
        if matches!(e, TerrainError::Input { .. }) { JobError::input(message) } else { JobError::new(message) }
    })
}

/// Writes heights as 16-bit levels: the generator's own where it has them, else from lowest to highest. Returns how to read
/// them.
///
/// # Errors
/// When the file cannot be written.
pub fn write_png16<'a>(
    generator: &dyn Generator,
    heights: &Grid,
    target: impl Into<Target<'a>>,
) -> Result<String, JobError> {
    let Some(levels) = generator.levels(heights) else {
        let written = dem::write_png_heights(target.into(), heights).map_err(JobError::io)?;
        return Ok(written.sentence(&dem::Values::Heights));
    };
    dem::write_png16(target.into(), &levels.grid).map_err(JobError::io)?;
    Ok(format!(
        "16-bit PNG: height_m = (level - {}) * {:e}; {} x {} posts",
        levels.zero_level,
        levels.metres_per_level,
        levels.grid.rows(),
        levels.grid.cols()
    ))
}
