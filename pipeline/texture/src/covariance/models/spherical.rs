//! Spherical covariance `B(rho) = sigma^2 (1 - 3/2 rho / b + 1/2 (rho / b)^3)` for `rho < b`, 0 beyond.
//!
//! Cells further apart than b are uncorrelated; near zero it falls linearly, like the exponential.

use super::Model;
use super::exponential::ExponentialParameters;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;

/// The spherical model.
pub struct Spherical;

impl Model for Spherical {
    fn kind(&self) -> Kind {
        Kind {
            family: "covariance",
            kind: "spherical",
            summary: "sigma^2 (1 - 1.5 lag / b + 0.5 (lag / b)^3) up to b, 0 beyond",
            source: "Matheron 1965; Chiles and Delfiner 2012, section 2.5.1",
            parameters: schema_of::<ExponentialParameters>(),
        }
    }

    fn is_linear_at_origin(&self) -> bool {
        true
    }

    fn correlation(&self, ratio: f64, _shape: f64) -> f64 {
        if ratio < 1.0 { 1.0 - ratio * (1.5 - 0.5 * ratio * ratio) } else { 0.0 }
    }
}
