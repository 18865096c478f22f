//! Noise of a measured surface: what the measurement adds to its heights.
//!
//! White noise differs from cell to cell. Dense image matching compares patches of several pixels, so that neighbouring cells share
//! part of their error: beside the white noise stands a correlated one, taken as Gaussian, `sigma^2 exp(-(lag / range)^2)`, the
//! short-range form for stereo DEMs of Hugonnet et al. (2022).

mod reference;

use crate::covariance::{Covariance, Structure, models};
use sastrugi_schemas::ParameterError;

pub use reference::{NoiseError, ReferenceNoise, of_reference};

/// Noise of a measured surface; the default is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white noise of a cell, m.
    pub white_sigma_m: f64,
    /// Standard deviation of the correlated noise, m.
    pub correlated_sigma_m: f64,
    /// Lag at which the correlation of that noise is 1/e, m; 0 without such noise.
    pub correlated_range_m: f64,
}

impl Noise {
    /// Noise with checked figures.
    ///
    /// # Errors
    /// A figure that is negative or not finite; correlated noise without a range, or a range without noise.
    pub fn new(white_sigma_m: f64, correlated_sigma_m: f64, correlated_range_m: f64) -> Result<Self, ParameterError> {
        ParameterError::not_negative("noise_sigma_m", white_sigma_m)?;
        ParameterError::not_negative("correlated_noise_sigma_m", correlated_sigma_m)?;
        ParameterError::not_negative("correlated_noise_range_m", correlated_range_m)?;
        if (correlated_sigma_m > 0.0) != (correlated_range_m > 0.0) {
            let message = format!(
                "is {correlated_range_m} m, with correlated noise of {correlated_sigma_m} m; correlated noise needs both, or neither"
            );
            return Err(ParameterError::new("correlated_noise_range_m", message));
        }
        Ok(Self { white_sigma_m, correlated_sigma_m, correlated_range_m })
    }

    /// True where there is none.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Its covariance: the white part is the nugget.
    pub fn covariance(&self) -> Covariance {
        let correlated = Structure {
            model: &models::gaussian::Gaussian,
            sigma_m: self.correlated_sigma_m,
            range_m: self.correlated_range_m,
            shape: 0.0,
        };
        let structures = if self.correlated_sigma_m > 0.0 { vec![correlated] } else { Vec::new() };
        Covariance { structures, nugget_m2: self.white_sigma_m * self.white_sigma_m, ratio: 1.0, azimuth_deg: 0.0 }
    }
}
