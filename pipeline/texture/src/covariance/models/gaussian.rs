//! Gaussian covariance `B(rho) = sigma^2 exp(-(rho / b)^2)`.
//!
//! A surface with this covariance is infinitely differentiable: rounded mounds of one size. `b` is the distance at which the
//! correlation falls to 1/e; the integral scale is `b sqrt(pi) / 2`.

use super::Model;
use super::exponential::ExponentialParameters;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;

/// The Gaussian model.
pub struct Gaussian;

impl Model for Gaussian {
    fn kind(&self) -> Kind {
        Kind {
            family: "covariance",
            kind: "gaussian",
            summary: "sigma^2 exp(-(lag / b)^2): smooth mounds of one size",
            source: "Chiles and Delfiner 2012, section 2.5.1",
            parameters: schema_of::<ExponentialParameters>(),
        }
    }

    fn correlation(&self, ratio: f64, _shape: f64) -> f64 {
        libm::exp(-ratio * ratio)
    }
}
