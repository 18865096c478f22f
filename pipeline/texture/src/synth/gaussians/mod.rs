//! Sum of Gaussian bumps of one size.
//!
//! `z(r) = A * sum over i of h_i exp(-|r - e_i|^2 / a^2)`, i up to G, `h_i = +-1`, centres uniform on the tile; see
//! [`super::bumps`] for the covariance and the choice of A.
//!
//! Source: Vecherin et al. 2022, Eq. 1. Departures: the bumps wrap around the tile's edges, so that it repeats without seams
//! (the paper's do not); the half axes are a along the long axis and `ratio` a across it, at any azimuth (the paper has x and
//! y).
//!
//! Its correlation is a Gaussian, `exp(-h^2 / (2 a^2))`, whatever the fit's: the difference is reported. If a is not
//! given, it is chosen so that both correlations are 1/2 at the same distance. The variance is the fit's on average.
//!
//! Cost: 81 multiplications per bump and a^2 of cells; memory 32 bytes per bump. Do not use it if small scales matter.

use super::bumps::{Class, Torus};
use super::tile::{self, Tile};
use super::{Cost, Kernel, Made, MethodParameters, SynthesisError, Wanted, fft_ma, reach};
use crate::covariance::Covariance;
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::{Kind, ParameterError, counted, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Default number of bumps per area of their half axes: an excess kurtosis of 0.03.
const DENSITY: f64 = 10.0;
/// Most bumps: 3.2 GB.
const COUNT_MAX: u64 = 100_000_000;

/// Raw parameters of a sum of Gaussians, without those of its tile.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaussiansParameters {
    /// Half axis a of a bump along the long axis, m. Default: the correlation is 1/2 where the fit's is.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub scale_m: Option<f64>,
    /// Number G of bumps. Default 10 per area of their half axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = COUNT_MAX))]
    pub bumps: Option<u64>,
}

/// A sum of Gaussians with checked parameters.
pub struct Gaussians {
    covariance: Covariance,
    tile: Geometry,
    torus: Torus,
    class: Class,
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: GaussiansParameters::NAME,
        summary: "sum of Gaussian bumps of one size; periodic; the variance of the fit, a Gaussian correlation",
        source: "Vecherin et al. 2022, Eq. 1",
        parameters: tile::schema::<GaussiansParameters>(),
    }
}

impl MethodParameters for GaussiansParameters {
    const NAME: &'static str = "gaussians";
    type Kernel = Gaussians;

    fn is_periodic(&self) -> bool {
        true
    }

    fn check(&self, tile: &Tile) -> Result<(), ParameterError> {
        self.scale_m.map(|scale_m| ParameterError::positive("scale_m", scale_m)).transpose()?;
        match (self.bumps, self.scale_m) {
            (Some(count), _) => check_count(count),
            (None, Some(along_m)) => {
                check_count(usual_count(tile, along_m, along_m * tile.stated_ratio().unwrap_or(1.0)))
            }
            (None, None) => Ok(()),
        }
    }

    fn cost(&self, tile: &Tile) -> Cost {
        // Without a scale, assume the smallest bumps that the cells resolve.
        let least_m = 2.0 * tile.geometry.cell[0].min(tile.geometry.cell[1]);
        let along_m = self.scale_m.unwrap_or(least_m);
        let across_m = along_m * tile.stated_ratio().unwrap_or(1.0);
        let count = self.bumps.unwrap_or_else(|| usual_count(tile, along_m, across_m)).min(COUNT_MAX);
        let class = Class { along_m, across_m, count, variance_m2: 1.0 };
        cost(&Torus::new(tile.geometry, 0.0), &class, &tile.geometry)
    }

    fn kernel(&self, tile: &Tile, wanted: &Covariance, _: &Wanted) -> Result<Gaussians, ParameterError> {
        // exp(-h^2 / (2 a^2)) = 1/2.
        let fitted_m = || reach::half_distance_m(wanted) / (2.0 * std::f64::consts::LN_2).sqrt();
        let along_m = self.scale_m.unwrap_or_else(fitted_m);
        let across_m = along_m * wanted.ratio;
        let count = self.bumps.unwrap_or_else(|| usual_count(tile, along_m, across_m));
        check_count(count)?;
        let class = Class { along_m, across_m, count, variance_m2: wanted.at_distance(0.0) };
        let torus = Torus::new(tile.geometry, wanted.azimuth_deg);
        Ok(Gaussians { covariance: wanted.clone(), tile: tile.geometry, torus, class })
    }
}

fn usual_count(tile: &Tile, along_m: f64, across_m: f64) -> u64 {
    let [width_m, height_m] = tile.geometry.size();
    (DENSITY * width_m * height_m / (along_m * across_m)).ceil() as u64
}

fn check_count(count: u64) -> Result<(), ParameterError> {
    if (1..=COUNT_MAX).contains(&count) {
        return Ok(());
    }
    Err(ParameterError::new("bumps", format!("is {count}; it must lie in 1 to {COUNT_MAX}")))
}

fn cost(torus: &Torus, class: &Class, tile: &Geometry) -> Cost {
    Cost { memory_bytes: Torus::memory_bytes(class) + 8 * tile.len() as u64, operations: torus.operations(class) }
}

impl Kernel for Gaussians {
    fn cost(&self) -> Cost {
        cost(&self.torus, &self.class, &self.tile)
    }

    fn notes(&self) -> Vec<String> {
        let Class { along_m, across_m, count, .. } = self.class;
        let mut notes = fft_ma::size_notes(&self.covariance, &self.tile, true);
        notes.push(format!(
            "{} with half axes {along_m:.4} m x {across_m:.4} m: the correlation is Gaussian, not the fit's",
            counted(count, "Gaussian")
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
