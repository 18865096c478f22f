//! Sum of Gaussian bumps of one size.
//!
//! `z(r) = A * sum over i of h_i exp(-|r - e_i|^2 / a^2)`, i up to G, `h_i = +-1`, centres uniform on the tile; see
//! [`super::bumps`] for the covariance and the choice of A.
//!
//! Source: Vecherin et al. 2022, Eq. 1. Departures: the bumps go round the tile's edges, so that it repeats without seams
//! (the paper's do not); the half axes are a along the long axis and `ratio` a across it, at any azimuth (the paper has x and
//! y).
//!
//! Its correlation is a Gaussian, `exp(-h^2 / (2 a^2))`, whatever the fit's is: the difference is reported. Where a is not
//! given it is chosen so that both have fallen to one half at the same distance. The variance is the fit's on average.
//!
//! Cost: 81 multiplications per bump and a^2 of cells; memory 32 bytes per bump. Not for a fit whose small scales matter.

use super::bumps::{Class, Torus};
use super::tile::{self, Tile};
use super::{Kernel, Made, Synthesis, SynthesisError, Wanted, fft_ma, reach};
use crate::covariance::Covariance;
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::{Kind, ParameterError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Bumps per area of their half axes where none is given: an excess kurtosis of 0.03.
const DENSITY: f64 = 10.0;
/// Most bumps: 3.2 GB.
const COUNT_MAX: u64 = 100_000_000;

/// Raw parameters of a sum of Gaussians, beside those of its tile.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaussiansParameters {
    /// Half axis a of a bump along the long axis, m. Default: the correlation is 1/2 where the fit's is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_m: Option<f64>,
    /// Number G of bumps. Default 10 per area of their half axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bumps: Option<u64>,
}

/// A sum of Gaussians with checked parameters.
pub struct Gaussians {
    parameters: GaussiansParameters,
    covariance: Covariance,
    tile: Geometry,
    torus: Torus,
    class: Class,
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: "gaussians",
        summary: "sum of Gaussian bumps of one size; periodic; the variance of the fit, a Gaussian correlation",
        source: "Vecherin et al. 2022, Eq. 1",
        parameters: tile::schema::<GaussiansParameters>(),
    }
}

/// The texture with raw parameters, matching `wanted`.
///
/// # Errors
/// Parameters out of range.
pub fn prepare(parameters: &Value, wanted: Wanted) -> Result<Box<dyn Synthesis>, ParameterError> {
    super::prepare(parameters, wanted, |_| true, Gaussians::new)
}

impl Gaussians {
    fn new(parameters: GaussiansParameters, tile: &Tile, wanted: &Covariance) -> Result<Self, ParameterError> {
        let along_m = match parameters.scale_m {
            Some(scale_m) => ParameterError::positive("scale_m", scale_m)?,
            // exp(-h^2 / (2 a^2)) = 1/2.
            None => reach::half_distance_m(wanted) / (2.0 * std::f64::consts::LN_2).sqrt(),
        };
        let across_m = along_m * wanted.ratio;
        let [width_m, height_m] = tile.geometry.size();
        let usual = (DENSITY * width_m * height_m / (along_m * across_m)).ceil();
        let count = parameters.bumps.unwrap_or(usual as u64);
        if !(1..=COUNT_MAX).contains(&count) {
            return Err(ParameterError::new("bumps", format!("is {count}; it must lie in 1 to {COUNT_MAX}")));
        }
        let class = Class { along_m, across_m, count, variance_m2: wanted.at_distance(0.0) };
        let torus = Torus::new(tile.geometry, wanted.azimuth_deg);
        Ok(Self { parameters, covariance: wanted.clone(), tile: tile.geometry, torus, class })
    }
}

impl Kernel for Gaussians {
    fn parameters(&self) -> Value {
        serde_json::to_value(&self.parameters).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        Torus::memory_bytes(&self.class) + 8 * self.tile.len() as u64
    }

    fn operations(&self) -> f64 {
        self.torus.operations(&self.class)
    }

    fn notes(&self) -> Vec<String> {
        let Class { along_m, across_m, count, .. } = self.class;
        let mut notes = fft_ma::size_notes(&self.covariance, &self.tile, true);
        notes.push(format!(
            "{count} Gaussians of half axes {along_m:.4} m x {across_m:.4} m: the correlation is a Gaussian, not the fit's"
        ));
        notes
    }

    fn achieved(&self) -> Box<dyn Fn([f64; 2]) -> f64 + '_> {
        Box::new(|lag_m| self.class.variance_m2 * self.torus.correlation(&self.class, lag_m))
    }

    fn make(&self, streams: &Streams) -> Result<Made, SynthesisError> {
        let mut heights_m = vec![0.0; self.tile.len()];
        self.torus.add(&self.class, &mut heights_m, streams, "bumps");
        Ok(Made { heights_m, covariance_error_max_m2: None, clip_share: 0.0 })
    }
}

#[cfg(test)]
mod tests;
