//! Verbs that work on single files with the kernels of a study, and on pairs of releases.

pub mod analyze;
pub mod compare;
pub mod coregister;
pub mod fit;
pub mod fits;
pub mod hillshade;
pub mod lerobot;
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
use crate::remote::check_file;
use sastrugi_numeric::Grid;
use sastrugi_store::dem::{DemError, Format, WRITTEN_ENDINGS};
use serde_json::{Value, json};
use std::path::Path;

/// Refuses an output of unknown format, or that cannot be a file on this machine, before any work is done.
fn check_output(path: &Path) -> Result<(), Error> {
    check_file(path)?;
    if Format::of_name(path).is_some() {
        return Ok(());
    }
    let message = format!("{}: unknown extension; DEMs are written as {WRITTEN_ENDINGS}", path.display());
    Err(Error::Usage(message))
}

/// Refuses outputs that have the same name as another output or an input; links and `..` are followed.
fn check_distinct(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Error> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    for (k, output) in outputs.iter().enumerate() {
        let mut others = inputs.iter().chain(&outputs[..k]);
        if others.any(|other| real(other) == real(output)) {
            return Err(Error::Usage(format!(
                "{} is also an input or another output; every output needs its own name",
                output.display()
            )));
        }
    }
    Ok(())
}

/// A grid that does not fit the format is bad usage; anything else is a failure of the machine.
fn write_error(error: DemError) -> Error {
    match error {
        DemError::Unfit { .. } => Error::Usage(error.to_string()),
        other => Error::failed(other),
    }
}

/// Shape and height range, for output.
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
///
/// ```
/// use sastrugi_stages::verbs::numbers;
///
/// assert_eq!(numbers::<2>("--size", "20x12.5").ok(), Some([20.0, 12.5]));
/// assert!(numbers::<2>("--size", "20").is_err());
/// ```
pub fn numbers<const N: usize>(option: &str, text: &str) -> Result<[f64; N], Error> {
    let numbers: Option<Vec<f64>> = text.split([',', 'x']).map(|w| w.trim().parse().ok()).collect();
    let numbers = numbers.filter(|v| v.iter().all(|x: &f64| x.is_finite()));
    numbers
        .and_then(|v| <[f64; N]>::try_from(v).ok())
        .ok_or_else(|| Error::Usage(format!("`{option} {text}`: expected {N} numbers separated by a comma or `x`")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    #[test]
    fn val_numbers_of_options() {
        assert_eq!(numbers::<2>("--start", " 12, -3.5").ok(), Some([12.0, -3.5]));
        assert_eq!(numbers::<2>("--size", "3x2").ok(), Some([3.0, 2.0]));
        for text in ["", "12", "1,2,3", "1,nan", "1,inf", "a,b", "1,,2"] {
            let error = numbers::<2>("--start", text).unwrap_err();
            assert!(
                matches!(&error, Error::Usage(m) if *m == format!("`--start {text}`: expected 2 numbers separated by a comma or `x`")),
                "{error}"
            );
        }
    }

    /// An output that is an input under another name would destroy it.
    #[test]
    fn val_outputs_are_not_inputs() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.tif"), "").unwrap();
        std::fs::create_dir(path("sub")).unwrap();
        let (a, roundabout, b) = (path("a.tif"), path("sub/../a.tif"), path("b.tif"));
        assert!(check_distinct(&[&b], &[&a]).is_ok());
        for (outputs, inputs) in
            [(vec![a.as_path()], vec![roundabout.as_path()]), (vec![b.as_path(), b.as_path()], vec![])]
        {
            let error = check_distinct(&outputs, &inputs).unwrap_err();
            assert!(matches!(&error, Error::Usage(m) if m.contains("is also an input or another output")), "{error}");
        }
    }

    #[test]
    fn val_a_grid_is_described() {
        let geometry = Geometry { rows: 2, cols: 3, cell: [0.5, 2.0], origin: [10.0, 20.0] };
        let described = describe_grid(&Grid::new(geometry, vec![1.0, f64::NAN, 3.0, -4.0, 0.0, 2.0]));
        let expected = json!({
            "rows": 2, "cols": 3, "cell": [0.5, 2.0], "origin": [10.0, 20.0], "size": [1.5, 4.0], "valid": 5,
            "height_min_m": -4.0, "height_max_m": 3.0,
        });
        assert_eq!(described, expected);
        let void = describe_grid(&Grid::new(geometry, vec![f64::NAN; 6]));
        assert!(void["valid"] == 0 && void["height_min_m"].is_null() && void["height_max_m"].is_null(), "{void}");
    }
}
