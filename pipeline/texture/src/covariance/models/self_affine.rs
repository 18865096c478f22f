//! Self-affine (power-law) surface: increments over a distance rho have the variance `D(rho) = s^2 (rho / 1 m)^(2 H)`.
//!
//! It has no finite variance and no covariance: its heights drift without limit. The generalised covariance is `-D / 2`
//! (Matheron, 1973). Any weights that sum to zero, such as those of the moving average's residual, turn it into a
//! true covariance. H in (0, 1) is the Hurst exponent; the fractal dimension is 3 - H.

use super::{Model, Shape};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the self-affine model in a fit file.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SelfAffineParameters {
    /// Standard deviation s of increments over 1 m, m.
    pub increment_1m_m: f64,
    /// Hurst exponent H in (0, 1).
    pub hurst: f64,
}

/// The self-affine model.
pub struct SelfAffine;

impl Model for SelfAffine {
    fn kind(&self) -> Kind {
        Kind {
            family: "covariance",
            kind: "self_affine",
            summary: "increments of variance s^2 (lag / 1 m)^(2 H); no range, no variance",
            source: "Matheron 1973; Mandelbrot and Van Ness 1968",
            parameters: schema_of::<SelfAffineParameters>(),
        }
    }

    fn correlation(&self, ratio: f64, shape: f64) -> f64 {
        if ratio > 0.0 { -0.5 * libm::exp(2.0 * shape * libm::log(ratio)) } else { 0.0 }
    }

    fn shape(&self) -> Option<Shape> {
        Some(Shape { name: "hurst", bounds: (0.02, 0.98), start: 0.5 })
    }

    fn scale_names(&self) -> (&'static str, Option<&'static str>) {
        ("increment_1m_m", None)
    }
}
