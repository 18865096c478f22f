//! Exponential covariance `B(rho) = sigma^2 exp(-rho / b)` (Vecherin et al., 2022, Eq. 9).
//!
//! A surface with this covariance is continuous, but its slope is undefined: increments grow with the square root of distance
//! (Hurst exponent 1/2). `b` is the distance at which the correlation falls to 1/e. The integral scale equals b; the
//! "effective range" of geostatistics (5 % correlation) is 3 b.

use super::Model;
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the exponential model in a fit file.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExponentialParameters {
    /// Standard deviation sigma, m.
    pub sigma_m: f64,
    /// Range b of exp(-lag / b), m.
    pub range_m: f64,
}

/// The exponential model.
pub struct Exponential;

impl Model for Exponential {
    fn kind(&self) -> Kind {
        Kind {
            family: "covariance",
            kind: "exponential",
            summary: "sigma^2 exp(-lag / b)",
            source: "Vecherin et al. 2022, Eq. 9",
            parameters: schema_of::<ExponentialParameters>(),
        }
    }

    fn is_linear_at_origin(&self) -> bool {
        true
    }

    fn correlation(&self, ratio: f64, _shape: f64) -> f64 {
        libm::exp(-ratio)
    }
}
