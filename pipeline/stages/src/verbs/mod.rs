//! Verbs that work on single files: the same kernels as in a study, without a study; and on two releases side by side.

pub mod analyze;
pub mod compare;
pub mod coregister;
pub mod fit;
pub mod fits;
pub mod hillshade;
pub mod local;
pub mod navigate;
pub mod parameters;
pub mod photoclinometry;
mod reading;
pub mod releases;
pub mod render;
pub mod roughness;
pub mod rover;
pub mod served;
pub mod terrain;
pub mod texture;
pub mod traverse;
pub mod vehicle;

pub use reading::{Read, Reading, read, read_as_it_is, transects};
pub use sastrugi_mobility::metrics::log::LogSettings;

use crate::error::Error;
use sastrugi_numeric::Grid;
use sastrugi_store::dem::{DemError, Format, WRITTEN_ENDINGS};
use serde_json::{Value, json};
use std::path::Path;

/// Refuses an output name that no format has, before any work is done.
fn check_output(path: &Path) -> Result<(), Error> {
    if Format::of_name(path).is_some() {
        return Ok(());
    }
    let message = format!("{}: the ending names no DEM format; {WRITTEN_ENDINGS} do", path.display());
    Err(Error::Usage(message))
}

/// Refuses outputs of one name, or of an input's, so that no file replaces another; links and `..` are followed.
fn check_distinct(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Error> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    for (k, output) in outputs.iter().enumerate() {
        let mut others = inputs.iter().chain(&outputs[..k]);
        if others.any(|other| real(other) == real(output)) {
            return Err(Error::Usage(format!(
                "{}: is another file of this call as well; every output needs its own name",
                output.display()
            )));
        }
    }
    Ok(())
}

/// A grid that does not fit the format is the caller's choice; anything else is this machine's.
fn write_error(error: DemError) -> Error {
    match error {
        DemError::Unfit { .. } => Error::Usage(error.to_string()),
        other => Error::failed(other),
    }
}

/// Shape and height range for people.
pub fn describe_grid(grid: &Grid) -> Value {
    let g = &grid.geometry;
    let (low, high) = grid.range().map_or((None, None), |(low, high)| (Some(low), Some(high)));
    json!({
        "rows": g.rows,
        "cols": g.cols,
        "cell": g.cell,
        "origin": g.origin,
        "size": g.size(),
        "valid": grid.finite_count(),
        "height_min_m": low,
        "height_max_m": high,
    })
}

/// Numbers separated by commas (or `x`).
///
/// # Errors
/// Anything that is not `n` finite numbers.
pub fn numbers<const N: usize>(option: &str, text: &str) -> Result<[f64; N], Error> {
    let numbers: Option<Vec<f64>> = text.split([',', 'x']).map(|w| w.trim().parse().ok()).collect();
    let numbers = numbers.filter(|v| v.iter().all(|x: &f64| x.is_finite()));
    numbers
        .and_then(|v| <[f64; N]>::try_from(v).ok())
        .ok_or_else(|| Error::Usage(format!("`{option} {text}`: it takes {N} numbers")))
}
