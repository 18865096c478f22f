//! Runs a generator, checks its result, and writes its heights and maps.

use crate::job::JobError;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_store::atomic::Target;
use sastrugi_store::dem::{self, Values};
use sastrugi_terrain::{Generator, Input, Map, MapKind, Terrain, TerrainError};

/// Unit and description with which a map is written.
pub fn values_of(map: &Map) -> Values {
    match map.kind() {
        MapKind { unit: "", description, .. } => Values::Codes { description: description.into() },
        MapKind { unit, description, .. } => Values::Quantity { unit: unit.into(), description: description.into() },
    }
}

/// Generates a terrain and checks it.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_stages::operations::terrains::generate;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let params = serde_json::json!({ "size_px": [32, 24], "cell_m": 0.05 });
/// let generator = sastrugi_terrain::prepare("weierstrass_mandelbrot", &params)?;
/// let streams = Streams::for_seed(1, "terrain");
/// let terrain = generate(generator.as_ref(), &streams, &[])?;
/// // Columns come first in `size_px`, and every cell has a height.
/// assert_eq!((terrain.heights.rows(), terrain.heights.cols()), (24, 32));
/// assert_eq!(terrain.heights.finite_count(), 24 * 32);
/// // The same seed gives the same heights.
/// assert_eq!(generate(generator.as_ref(), &streams, &[])?.heights, terrain.heights);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// When the generator fails, or returns heights that are not finite or the same everywhere.
pub fn generate(generator: &dyn Generator, streams: &Streams, inputs: &[Input]) -> Result<Terrain, JobError> {
    generator.generate_checked(streams, inputs).map_err(|e| {
        let message = format!("failed to {e}");
        // The input surface cannot be used; another part of it, or another file, may work.
        if matches!(e, TerrainError::Input { .. }) { JobError::input(message) } else { JobError::new(message) }
    })
}

/// Writes heights as 16-bit levels: the generator's own if it has them, otherwise scaled from lowest to highest. Returns a note on how to
/// convert levels to heights.
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
