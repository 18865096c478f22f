//! Measurement noise of a surface: white plus correlated.
//!
//! White noise is independent from cell to cell. Dense image matching compares patches of several pixels, so that neighbouring cells
//! share part of their error: this adds correlated noise with a Gaussian covariance, `sigma^2 exp(-(lag / range)^2)`, the
//! short-range form for stereo DEMs of Hugonnet et al. (2022).

mod reference;

use crate::covariance::{Covariance, Structure, models};
use sastrugi_schemas::ParameterError;

pub use reference::{NoiseError, ReferenceNoise, of_reference};

/// Noise of a measured surface; the default is zero.
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
    /// Noise with checked parameters.
    ///
    /// # Errors
    /// A value that is negative or not finite; correlated noise without a range, or a range without correlated noise.
    pub fn new(white_sigma_m: f64, correlated_sigma_m: f64, correlated_range_m: f64) -> Result<Self, ParameterError> {
        ParameterError::not_negative("noise_sigma_m", white_sigma_m)?;
        ParameterError::not_negative("correlated_noise_sigma_m", correlated_sigma_m)?;
        ParameterError::not_negative("correlated_noise_range_m", correlated_range_m)?;
        if (correlated_sigma_m > 0.0) != (correlated_range_m > 0.0) {
            let message = format!(
                "is {correlated_range_m} m with correlated noise of {correlated_sigma_m} m; give both, or neither"
            );
            return Err(ParameterError::new("correlated_noise_range_m", message));
        }
        Ok(Self { white_sigma_m, correlated_sigma_m, correlated_range_m })
    }

    /// True if there is no noise.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Its covariance, with the white part as the nugget.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Both variances add up at lag zero; at the range the correlated part has fallen to 1/e, and white noise is gone at once.
    #[test]
    fn val_covariance_of_noise() {
        let covariance = Noise::new(0.03, 0.02, 0.5).unwrap().covariance();
        assert!((covariance.at([0.0, 0.0]) - 0.0013).abs() < 1e-15);
        assert!((covariance.at([0.3, -0.4]) - 0.0004 * libm::exp(-1.0)).abs() < 1e-15);
        let white = Noise::new(0.03, 0.0, 0.0).unwrap();
        assert_eq!((white.covariance().at([0.0, 0.0]), white.covariance().at([1e-9, 0.0])), (0.03 * 0.03, 0.0));
        assert!(!white.is_none() && Noise::new(0.0, 0.0, 0.0).unwrap().is_none());
    }

    /// Correlated noise needs a range, and a range needs correlated noise.
    #[test]
    fn val_incomplete_noise_is_refused() {
        let key = |white: f64, correlated: f64, range: f64| Noise::new(white, correlated, range).err().map(|e| e.key);
        assert_eq!(key(0.0, 0.1, 0.0).as_deref(), Some("correlated_noise_range_m"));
        assert_eq!(key(0.0, 0.0, 0.1).as_deref(), Some("correlated_noise_range_m"));
        assert_eq!(key(-0.1, 0.0, 0.0).as_deref(), Some("noise_sigma_m"));
        assert_eq!(key(0.0, f64::INFINITY, 0.1).as_deref(), Some("correlated_noise_sigma_m"));
    }
}
