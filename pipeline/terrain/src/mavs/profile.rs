//! Kind `mavs_profile`: a ride course with one Gaussian profile along x, the same for every y.
//!
//! White noise of standard deviation s is filtered with `exp(-x^2 / (2 a^2))`, scaled so that the squares of the weights
//! sum to 1: the profile has standard deviation s and covariance `s^2 exp(-d^2 / (4 a^2))`, which falls to 1/e at 2 a.
//! (With the published gain `2 dx / (sqrt(pi) a)` the variance depends on the spacing: 4 dx / (sqrt(pi) a) s^2.) The period of the
//! noise is at least 200 a and at least the surface; the profile is the beginning of a period.

use super::{DEFAULT_CELL_M, DEFAULT_HI_LEN_M, DEFAULT_HI_MAG_M, DEFAULT_SIZE_PX, MAVS_PROFILE};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::fft::{Complex64, Transform, smooth_length};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Minimum period over the correlation length (listing).
const PERIOD_LENGTHS: f64 = 200.0;
/// Longest correlation length, cells.
const LENGTH_MAX_CELLS: f64 = 10_000.0;

/// A ridged surface from one profile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawProfile {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 666 x 666 if no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// RMS of the heights, m.
    #[schemars(transform = limits::positive)]
    pub rms_m: f64,
    /// Length a of the filter, m, at least one cell (listing: two).
    #[schemars(transform = limits::positive)]
    pub correlation_length_m: f64,
}

impl Default for RawProfile {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            rms_m: DEFAULT_HI_MAG_M,
            correlation_length_m: DEFAULT_HI_LEN_M,
        }
    }
}

/// Checked parameters of a ridged surface.
#[derive(Clone, Debug)]
pub struct Profile {
    raw: RawProfile,
    size: Size,
}

impl TryFrom<RawProfile> for Profile {
    type Error = ParameterError;

    fn try_from(raw: RawProfile) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        ParameterError::positive("rms_m", raw.rms_m)?;
        let cells = ParameterError::positive("correlation_length_m", raw.correlation_length_m)? / raw.cell_m;
        if !(1.0..=LENGTH_MAX_CELLS).contains(&cells) {
            let message = format!("is {cells} cells; it must be 1 to {LENGTH_MAX_CELLS} cells");
            return Err(ParameterError::new("correlation_length_m", message));
        }
        let raw = RawProfile { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, size })
    }
}

impl Profile {
    /// Heights along x, m.
    fn heights(&self, streams: &Streams) -> Vec<f64> {
        let (p, mut stream) = (&self.raw, streams.stream("profile"));
        let length = p.correlation_length_m / p.cell_m;
        let period = smooth_length(self.size.cols().max((PERIOD_LENGTHS * length).ceil() as usize));
        let transform = Transform::new(period);
        let mut scratch = transform.scratch();
        let mut forward = |values: Vec<f64>| {
            let mut spectrum: Vec<Complex64> = values.into_iter().map(|v| Complex64::new(v, 0.0)).collect();
            transform.forward(&mut spectrum, &mut scratch);
            spectrum
        };
        let weight = |k: usize| {
            let d = k.min(period - k) as f64 / length;
            libm::exp(-0.5 * d * d)
        };
        let weights: Vec<f64> = (0..period).map(weight).collect();
        let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        let noise = forward((0..period).map(|_| stream.normal()).collect());
        let filter = forward(weights);
        let mut product: Vec<Complex64> = noise.iter().zip(&filter).map(|(n, f)| n * f.re).collect();
        transform.inverse_unscaled(&mut product, &mut scratch);
        let scale = p.rms_m / (norm * period as f64);
        product[..self.size.cols()].iter().map(|v| v.re * scale).collect()
    }
}

impl Generator for Profile {
    fn kind(&self) -> &'static str {
        MAVS_PROFILE
    }

    fn geometry(&self) -> Geometry {
        self.size.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        let period = PERIOD_LENGTHS * self.raw.correlation_length_m / self.raw.cell_m;
        8 * self.size.cells() + 64 * (period as u64 + u64::from(self.size.px[0]))
    }

    fn notes(&self) -> Vec<String> {
        self.size.note().into_iter().collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let profile = self.heights(streams);
        let geometry = self.size.geometry();
        Ok(Terrain::from(Grid { geometry, values: profile.repeat(geometry.rows) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile is the circular convolution of white noise with the normalised filter, summed directly.
    #[test]
    fn val_the_profile_is_the_convolution() {
        let raw = RawProfile {
            size_px: Some([300, 3]),
            cell_m: 0.5,
            rms_m: 0.04,
            correlation_length_m: 1.0,
            ..RawProfile::default()
        };
        let streams = Streams::for_seed(6, "terrain");
        let found = Profile::try_from(raw).unwrap().heights(&streams);
        // 200 filter lengths of two cells.
        let period = 400;
        let mut stream = streams.stream("profile");
        let noise: Vec<f64> = (0..period).map(|_| stream.normal()).collect();
        let weights: Vec<f64> = (0..period)
            .map(|k: usize| {
                let x_m = 0.5 * k.min(period - k) as f64;
                libm::exp(-0.5 * x_m * x_m)
            })
            .collect();
        let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        assert_eq!(found.len(), 300);
        for (i, z) in found.iter().enumerate() {
            let sum: f64 = (0..period).map(|k| weights[k] * noise[(i + period - k) % period]).sum();
            assert!((z - 0.04 * sum / norm).abs() < 1e-12, "{i}: {z}");
        }
    }
}
