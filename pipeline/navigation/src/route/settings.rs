//! Settings of a route.

use crate::map::Neighbourhood;
use crate::vertices::VertexSettings;
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest number of landmarks: 64 take 1 kB per vertex.
const LANDMARKS_MAX: u32 = 64;

/// Search method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Method {
    /// A* over all cells.
    GridAstar,
    /// A* over the roadmap between vertices.
    Roadmap(VertexSettings),
    /// Lazy Theta* over all cells, with legs at any angle.
    ThetaStar,
    /// Anytime weighted A* over all cells.
    Anytime {
        /// First weight of the bound, at least 1.
        weight: f64,
        /// Number of expansions, at least 1.
        budget: u64,
    },
}

/// Settings of a route.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RouteSettings {
    /// Search method.
    pub method: Method,
    /// Steps that are allowed.
    pub neighbourhood: Neighbourhood,
    /// Landmarks of a prepared roadmap, at most 64; none by default. Planning a single route uses none.
    pub landmarks: u32,
    /// Cost that smoothing may add for each waypoint that it removes, metres of level ground, at least 0.
    pub smoothing_tolerance: f64,
}

impl Default for RouteSettings {
    /// The thesis' roadmap without the height-difference threshold.
    fn default() -> Self {
        Self {
            method: Method::Roadmap(VertexSettings::default()),
            neighbourhood: Neighbourhood::Four,
            landmarks: 0,
            smoothing_tolerance: 0.0,
        }
    }
}

impl RouteSettings {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("smoothing_tolerance", self.smoothing_tolerance)?;
        if self.landmarks > LANDMARKS_MAX {
            let message = format!("is {}; it must be at most {LANDMARKS_MAX}", self.landmarks);
            return Err(ParameterError::new("landmarks", message));
        }
        match self.method {
            Method::Roadmap(vertices) => vertices.check().map_err(|error| error.within("method")),
            Method::Anytime { weight, .. } if !(weight >= 1.0 && weight.is_finite()) => {
                let message = format!("is {weight}; it must be finite and at least 1");
                Err(ParameterError::new("method.weight", message))
            }
            Method::Anytime { budget: 0, .. } => {
                Err(ParameterError::new("method.budget", "is 0; it must be at least 1 expansion"))
            }
            _ => Ok(()),
        }
    }
}
