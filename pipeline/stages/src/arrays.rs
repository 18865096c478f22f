//! Functions from arrays to arrays, for callers that hold surfaces in memory (the Python module); the verbs of the same names do this
//! with files.
//!
//! Parameters have the form that they have in a study. The same heights, parameters and seed give the same result as the verb: the file that
//! the verb writes and a file written from the result have the same bytes.
//!
//! ```
//! use sastrugi_stages::arrays::{Raster, fit, terrain, texture};
//! use sastrugi_schemas::fit::FitFile;
//! use sastrugi_store::dem::Crs;
//! use serde_json::json;
//! use std::collections::BTreeMap;
//!
//! # fn main() -> Result<(), sastrugi_stages::Error> {
//! let rough = terrain("weierstrass_mandelbrot", &json!({ "size_px": [64, 48], "cell_m": 0.05 }), 7, &BTreeMap::new())?;
//! assert_eq!((rough.heights.grid.rows(), rough.heights.grid.cols()), (48, 64));
//!
//! // A surface with a stated covariance, and the fit that finds it again.
//! let parameters = [("sigma_m", 0.05), ("range_m", 0.2)].map(|(name, value)| (name.to_owned(), value)).into();
//! let truth = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
//! let size = json!({ "size_m": [16.0, 16.0], "cell_m": 0.1, "phase": "gaussian", "periodic": false });
//! let site = texture(&truth, None, "fft_ma", &size, 1)?.heights;
//! let found = fit(&site, &json!({ "outer_scale_m": 1.0, "bootstrap": 0 }), 0)?;
//! assert!((found.parameters["sigma_m"] / 0.05 - 1.0).abs() < 0.2);
//!
//! let mut flat = rough.heights.grid.clone();
//! flat.values[0] = f64::INFINITY;
//! assert!(Raster::new(flat, Crs::default()).is_err());
//! # Ok(())
//! # }
//! ```

use crate::error::Error;
use crate::jobs::{fit as fits, texture as textures};
use crate::memory;
use crate::operations::coregistration::{IN_DEGREES, check_systems, verdict};
use crate::operations::inputs::Loaded;
use crate::operations::textures::{check_memory, on_site_cells};
use crate::verbs::fit::settings;
use crate::verbs::parameters;
use crate::verbs::roughness::{Described, RideRequest, Wanted};
use crate::verbs::terrain::{Given, Prepared};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::coregistration::Coregistration;
use sastrugi_schemas::fit::FitFile;
use sastrugi_store::dem::Crs;
use sastrugi_terrain::Terrain;
use sastrugi_texture::Measured;
use sastrugi_texture::coregister::{self as registration, Coregistered};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is wrong with heights in degrees.
const DEGREES: &str = "the DEM is in degrees; convert it to metres";

/// Heights and their coordinate system.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Heights, m; NaN for no data.
    pub grid: Grid,
    /// Coordinate system.
    pub crs: Crs,
}

impl Raster {
    /// Checks heights.
    ///
    /// # Errors
    /// No cells, cells that are not positive, an origin that is not finite, infinite heights.
    pub fn new(grid: Grid, crs: Crs) -> Result<Self, Error> {
        let Geometry { rows, cols, cell, origin } = grid.geometry;
        if grid.geometry.is_empty() {
            return Err(Error::Usage(format!("the heights have {rows} x {cols} cells; at least one is needed")));
        }
        if !cell.iter().all(|side| side.is_finite() && *side > 0.0) {
            return Err(Error::Usage(format!("`cell` is {cell:?}; cell sizes must be finite and above 0")));
        }
        if !origin.iter().all(|at| at.is_finite()) {
            return Err(Error::Usage(format!("`origin` is {origin:?}; it must be finite")));
        }
        if let Some(place) = grid.values.iter().position(|z| z.is_infinite()) {
            let (row, col) = (place / cols, place % cols);
            return Err(Error::Input(format!(
                "the height in row {row}, column {col} is infinite; mark holes with NaN"
            )));
        }
        Ok(Self { grid, crs })
    }

    /// As a file of a release would be read: rounded to single precision.
    pub(crate) fn loaded(&self) -> Loaded {
        Loaded { input: self.grid.as_stored().into(), crs: Some(self.crs.clone()) }
    }

    /// The grid, if it is in metres; `otherwise` says what is wrong with degrees.
    fn metric(&self, otherwise: &str) -> Result<&Grid, Error> {
        if self.crs.geographic { Err(Error::Input(otherwise.to_owned())) } else { Ok(&self.grid) }
    }
}

/// A generated terrain.
pub struct Generated {
    /// Heights.
    pub heights: Raster,
    /// Maps on the same cells, by name.
    pub maps: BTreeMap<&'static str, Grid>,
    /// All parameters, with defaults.
    pub parameters: Value,
    /// Notes on size and result.
    pub notes: Vec<String>,
}

/// Generates a terrain. A name of an input in the parameters stands for a raster of `inputs`, or else for a file.
///
/// # Errors
/// Unknown kinds and parameters, parameters out of range, inputs that cannot be used, too little memory.
pub fn terrain(
    kind: &str,
    parameters: &Value,
    seed: u64,
    inputs: &BTreeMap<String, Raster>,
) -> Result<Generated, Error> {
    let given: Given<'_> = inputs.iter().map(|(name, raster)| (name.as_str(), raster)).collect();
    let prepared = Prepared::new(kind.to_owned(), parameters, seed)?;
    let (Terrain { heights, maps, notes, .. }, crs) = prepared.make_from(&given)?;
    Ok(Generated {
        heights: Raster { grid: heights, crs },
        maps: maps.into_iter().map(|map| (map.name, map.values)).collect(),
        parameters: prepared.parameters(),
        notes: prepared.notes().into_iter().chain(notes).collect(),
    })
}

/// Fits the covariance of heights.
///
/// # Errors
/// Unknown parameters; heights in degrees, or that cannot be fitted; too little memory.
pub fn fit(heights: &Raster, parameters: &Value, seed: u64) -> Result<FitFile, Error> {
    let settings = settings(parameters)?;
    let streams = Streams::for_seed(seed, fits::STAGE);
    let heights = heights.metric(DEGREES)?;
    let [east, north] = heights.geometry.cell;
    let (cells, threads) = (heights.values.len() as u64, rayon::current_num_threads() as u64);
    memory::check("the fit", settings.memory_bytes(cells, Some(east.min(north)), threads))?;
    Ok(sastrugi_texture::fit(heights, &settings, &streams)?.fit)
}

/// A synthesised texture.
pub struct Textured {
    /// Heights.
    pub heights: Raster,
    /// All parameters, with defaults.
    pub parameters: Value,
    /// Notes on fit and texture.
    pub notes: Vec<String>,
}

/// Synthesises a texture that matches a fit; `exemplar` are the fitted heights, for methods that copy from their residual.
///
/// # Errors
/// Unknown methods and parameters, a fit or an exemplar that cannot be used, too little memory.
pub fn texture(
    fit: &FitFile,
    exemplar: Option<&Raster>,
    method: &str,
    parameters: &Value,
    seed: u64,
) -> Result<Textured, Error> {
    sastrugi_texture::check_keys(method, parameters)?;
    if let Some(known) = textures::kinds().iter().find(|k| k.kind == method) {
        parameters::check(parameters, known)?;
    }
    let measured = match exemplar {
        None => None,
        Some(heights) => Some(Arc::new(Measured::of_fit(heights.metric(DEGREES)?, fit)?)),
    };
    let mut parameters = parameters.clone();
    on_site_cells(method, &mut parameters, fit.cell_m);
    check_memory(method, &parameters, fit)?;
    let synthesis = sastrugi_texture::prepare_from(method, &parameters, fit, measured.as_ref())?;
    memory::check("the texture", synthesis.cost().memory_bytes)?;
    let streams = Streams::for_seed(seed, textures::STAGE);
    let outcome = synthesis.generate(&streams).map_err(|e| Error::Usage(e.to_string()))?;
    let notes = sastrugi_texture::fit_notes(fit).into_iter().chain(synthesis.notes()).chain(outcome.notes).collect();
    let heights = Raster { grid: outcome.grid, crs: Crs::default() };
    Ok(Textured { heights, parameters: synthesis.parameters(), notes })
}

/// Roughness of heights, with that in a band if requested; `parameters` are those of `[roughness]`.
///
/// # Errors
/// Unknown settings; heights in degrees, or that do not contain the band.
pub fn roughness(heights: &Raster, parameters: &Value, ride: Option<&RideRequest<'_>>) -> Result<Described, Error> {
    Wanted::new(parameters, ride, None)?.of(heights.metric(DEGREES)?)
}

/// How B was moved onto A.
pub struct Registered {
    /// A minus B as moved, on A's cells.
    pub difference: Raster,
    /// How B was moved.
    pub coregistration: Coregistration,
    /// The verdict, in one sentence.
    pub verdict: String,
}

/// Co-registers B to A.
///
/// # Errors
/// DEMs in degrees or in different systems, or that cannot be co-registered.
pub fn coregister(a: &Raster, b: &Raster) -> Result<Registered, Error> {
    let (one, two) = (a.metric(&format!("A {IN_DEGREES}"))?, b.metric(&format!("B {IN_DEGREES}"))?);
    check_systems(&a.crs, &b.crs)?;
    let Coregistered { difference, coregistration } =
        registration::coregister(one, two).map_err(|e| Error::Input(e.to_string()))?;
    let verdict = verdict(&coregistration);
    Ok(Registered { difference: Raster { grid: difference, crs: a.crs.clone() }, coregistration, verdict })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn raster(values: Vec<f64>) -> Raster {
        Raster { grid: Grid::new(Geometry::square(2, 2, 1.0), values), crs: Crs::default() }
    }

    #[test]
    fn val_heights_are_checked() {
        let of = |cell: [f64; 2], origin: [f64; 2], height: f64| {
            let geometry = Geometry { rows: 2, cols: 2, cell, origin };
            let grid = Grid::new(geometry, vec![f64::NAN, 0.0, height, 1.0]);
            Raster::new(grid, Crs::default()).map(drop).map_err(|e| e.to_string())
        };
        assert_eq!(of([1.0, 2.0], [0.0; 2], 3.0), Ok(()));
        assert_eq!(
            of([0.0, 1.0], [0.0; 2], 3.0).unwrap_err(),
            "`cell` is [0.0, 1.0]; cell sizes must be finite and above 0"
        );
        assert_eq!(of([1.0; 2], [f64::NAN, 0.0], 3.0).unwrap_err(), "`origin` is [NaN, 0.0]; it must be finite");
        let infinite = "the height in row 1, column 0 is infinite; mark holes with NaN";
        assert_eq!(of([1.0; 2], [0.0; 2], f64::INFINITY).unwrap_err(), infinite);
    }

    /// A raster given by name takes the place of a file, and is rounded as a file is.
    #[test]
    fn val_inputs_are_given_by_name() {
        let heights: Vec<f64> = (0..48).map(|k| 0.1 * f64::from(k)).collect();
        let base = Raster { grid: Grid::new(Geometry::square(6, 8, 0.5), heights), crs: Crs::default() };
        let stored = base.grid.as_stored();
        assert_ne!(base.grid, stored);
        let parameters = json!({ "size_px": [8, 6], "cell_m": 0.5, "processes": [{ "of": "base" }] });
        let unused = [("base".to_owned(), base.clone()), ("bas".to_owned(), base.clone())].into();
        let refused = terrain("compose", &parameters, 1, &unused).err().unwrap();
        assert!(
            matches!(&refused, Error::Usage(m) if m == "no parameter names the input `bas`; they name base"),
            "{refused}"
        );
        let made = terrain("compose", &parameters, 1, &[("base".to_owned(), base)].into()).unwrap();
        assert_eq!(made.heights.grid.values, stored.values);
        let missing = terrain("compose", &parameters, 1, &BTreeMap::new()).err().unwrap();
        assert!(matches!(&missing, Error::Input(m) if m.contains("base: no such file")), "{missing}");
    }

    #[test]
    fn val_degrees_are_refused() {
        let degrees = Raster { crs: Crs::wgs84(), ..raster(vec![0.0; 4]) };
        for error in [
            fit(&degrees, &json!({ "outer_scale_m": 1.0 }), 0).map(drop).unwrap_err(),
            roughness(&degrees, &json!({}), None).map(drop).unwrap_err(),
            coregister(&degrees, &degrees).map(drop).unwrap_err(),
        ] {
            assert!(matches!(&error, Error::Input(m) if m.contains("is in degrees")), "{error}");
        }
    }
}
