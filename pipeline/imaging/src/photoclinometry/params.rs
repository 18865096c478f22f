//! Settings of an inversion, as written in a study, with their checks.

use super::described::FirstImageErrors;
use crate::description::Noise;
use crate::photometry::Photometry;
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Default noise of images without a stated noise.
pub const NOISE: Noise = Noise { relative: 0.01, absolute: 1e-4 };
/// Maximum number of re-projection rounds.
pub const ROUNDS_MAX: usize = 20;
/// Maximum number of paths of the published integration.
pub const PATHS_MAX: usize = 450;
/// Maximum number of perturbed solutions for the uncertainty of heights.
pub const SAMPLES_MAX: usize = 512;

/// Method of integrating slopes to heights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Integration {
    /// Weighted least squares over the complete map.
    #[default]
    Poisson,
    /// Outward from the centre, averaged over random paths, as published; constraints on heights are ignored, and cells that no path reaches
    /// have no height.
    Paths,
}

/// Stereo points by correlation of predicted and observed windows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Stereo {
    /// Spacing of the points, cells.
    #[schemars(range(min = 1, max = 4096))]
    pub spacing: usize,
    /// Cells from the centre of a window to its edge: a window has `2 reach + 1` cells along a side.
    #[schemars(range(min = 2, max = 64))]
    pub reach: usize,
    /// Largest offset searched, pixels.
    #[schemars(range(min = 1, max = 64))]
    pub search: usize,
    /// Smallest normalised correlation of an accepted point.
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub quality: f64,
}

impl Default for Stereo {
    fn default() -> Self {
        Self { spacing: 16, reach: 7, search: 4, quality: 0.7 }
    }
}

/// Settings of one inversion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Cell size of the map, m; the finest pixel of parallel cameras when absent.
    #[schemars(transform = limits::positive)]
    pub cell_m: Option<f64>,
    /// Window of the map, `[x0, y0, x1, y1]`, m; the ground common to all images when absent.
    pub window_m: Option<[f64; 4]>,
    /// Photometric function; that of the first image when absent.
    pub photometry: Option<Photometry>,
    /// Noise of a pixel, for weights and uncertainties; that of the first image when absent, else 1 % and 1e-4 I/F.
    pub noise: Option<Noise>,
    /// Errors applied to the metadata of the first image, to study their effect.
    pub first_image_errors: FirstImageErrors,
    /// Scale `noise` to the residuals of cells lit in four or more images.
    pub estimate_noise: bool,
    /// A pixel darker than this share of its image's median (minus haze) counts as shadow and is not used.
    #[schemars(transform = limits::not_negative)]
    pub shadow: f64,
    /// Maximum number of re-projection rounds, up to 20.
    #[schemars(range(min = 1, max = ROUNDS_MAX))]
    pub rounds: usize,
    /// Rounds end when heights change by less than this (rms, cells).
    #[schemars(transform = limits::positive)]
    pub tolerance: f64,
    /// Albedo of the complete surface, if it is known; otherwise it is estimated in every cell.
    #[schemars(transform = limits::positive)]
    pub albedo: Option<f64>,
    /// Estimate the exposure of every image, up to a common factor.
    pub free_exposure: bool,
    /// Estimate the haze of every image.
    pub free_haze: bool,
    /// Method of integrating slopes to heights.
    pub integration: Integration,
    /// Number of paths of the published integration, up to 450.
    #[schemars(range(min = 1, max = PATHS_MAX))]
    pub paths: usize,
    /// Correlate windows for stereo points.
    pub stereo: Option<Stereo>,
    /// Cells whose slopes and albedo have a condition number above this get the prior of poorly lit cells.
    #[schemars(transform = limits::positive)]
    pub condition_max: f64,
    /// Largest share of the cells that may take their albedo from their neighbours, 0 to 1; an inversion with a larger share is refused. Ignored
    /// if `albedo` is given.
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub leaning_max: f64,
    /// Standard deviation of the slopes of poorly lit cells about those of the current surface.
    #[schemars(transform = limits::positive)]
    pub slope_prior: f64,
    /// Number of perturbed solutions for the uncertainty of heights; 0 to omit it.
    #[schemars(range(max = SAMPLES_MAX))]
    pub samples: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            cell_m: None,
            window_m: None,
            photometry: None,
            noise: None,
            first_image_errors: FirstImageErrors::default(),
            estimate_noise: false,
            shadow: 0.1,
            rounds: 10,
            tolerance: 1e-3,
            albedo: None,
            free_exposure: false,
            free_haze: false,
            integration: Integration::Poisson,
            paths: 64,
            stereo: None,
            condition_max: 300.0,
            leaning_max: 0.5,
            slope_prior: 0.3,
            samples: 32,
        }
    }
}

impl Settings {
    /// # Errors
    /// The first setting out of bounds.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.cell_m.map_or(Ok(0.0), |cell| ParameterError::positive("cell_m", cell))?;
        self.photometry.map_or(Ok(()), |p| p.check().map_err(|e| e.within("photometry")))?;
        if let Some(noise) = self.noise {
            noise.check().map_err(|e| e.within("noise"))?;
            ParameterError::positive("noise", noise.absolute + noise.relative)?;
        }
        self.first_image_errors.check().map_err(|e| e.within("first_image_errors"))?;
        ParameterError::not_negative("shadow", self.shadow)?;
        within("rounds", self.rounds, 1, ROUNDS_MAX)?;
        ParameterError::positive("tolerance", self.tolerance)?;
        if let Some(albedo) = self.albedo {
            ParameterError::positive("albedo", albedo)?;
        }
        within("paths", self.paths, 1, PATHS_MAX)?;
        ParameterError::positive("condition_max", self.condition_max)?;
        if !(0.0..=1.0).contains(&self.leaning_max) {
            let message = format!("is {}; it must lie between 0 and 1", shown(self.leaning_max));
            return Err(ParameterError::new("leaning_max", message));
        }
        ParameterError::positive("slope_prior", self.slope_prior)?;
        within("samples", self.samples, 0, SAMPLES_MAX)?;
        self.stereo.map_or(Ok(()), |s| s.check().map_err(|e| e.within("stereo")))
    }
}

impl Stereo {
    fn check(&self) -> Result<(), ParameterError> {
        within("spacing", self.spacing, 1, 4096)?;
        within("reach", self.reach, 2, 64)?;
        within("search", self.search, 1, 64)?;
        ParameterError::between("quality", self.quality, 0.0, 1.0).map(|_| ())
    }
}

fn within(key: &str, value: usize, low: usize, high: usize) -> Result<(), ParameterError> {
    match (low..=high).contains(&value) {
        true => Ok(()),
        false => Err(ParameterError::new(key, format!("is {value}; it must be {low} to {high}"))),
    }
}
