//! `hillshade`: a picture of a DEM.

use super::Read;
use crate::error::Error;
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_report::render::picture;
use sastrugi_roughness::rms_slope;
use sastrugi_schemas::ParameterError;
use sastrugi_store::atomic;
use serde_json::{Value, json};
use std::path::Path;

/// Maximum number of pixels along a side of a picture.
const PIXELS_MAX: u32 = 16384;

/// Draws a DEM in metres, at most `pixels` along a side; slopes are exaggerated by `factor`, or by default enough to be visible. Returns
/// a description of the picture.
///
/// # Errors
/// Numbers out of range, or a file that cannot be written.
pub fn hillshade(read: &Read, output: &Path, pixels: u32, factor: Option<f64>) -> Result<Value, Error> {
    if !output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        return Err(Error::Usage(format!("{}: the picture must be a .png", output.display())));
    }
    if !(1..=PIXELS_MAX).contains(&pixels) {
        return Err(Error::Usage(format!("`--pixels` must be between 1 and {PIXELS_MAX}, got {pixels}")));
    }
    let grid = &read.dem.grid;
    let factor = match factor {
        Some(factor) => ParameterError::positive("--exaggeration", factor)?,
        None => exaggeration(rms_slope(grid)),
    };
    let (png, [cols, rows]) = picture::relief_png(grid, factor, pixels as usize).map_err(Error::failed)?;
    atomic::write(output, &png).map_err(|e| Error::at(output, e))?;
    Ok(json!({
        "file": output.display().to_string(),
        "pixels": [cols, rows],
        "exaggeration": factor,
        "grid": super::describe_grid(grid),
        "notes": read.notes,
    }))
}
