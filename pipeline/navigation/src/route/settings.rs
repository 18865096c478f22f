//! Settings of a route.

use crate::map::Neighbourhood;
use crate::vertices::VertexSettings;
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most landmarks: a table of 1 kB for each vertex.
const LANDMARKS_MAX: u32 = 64;

/// How a path is searched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Method {
    /// A* over every cell.
    GridAstar,
    /// A* over the roadmap between the vertices of the ground.
    Roadmap(VertexSettings),
    /// Lazy Theta* over every cell: legs at any angle.
    ThetaStar,
    /// Anytime weighted A* over every cell.
    Anytime {
        /// Weight of the bound, 1 or above.
        weight: f64,
        /// Expansions that may be spent, at least 1.
        budget: u64,
    },
}

/// Settings of a route.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RouteSettings {
    /// How the path is searched.
    pub method: Method,
    /// Steps that may be taken.
    pub neighbourhood: Neighbourhood,
    /// Landmarks of a prepared roadmap, at most 64; none by default. A single route makes none.
    pub landmarks: u32,
    /// Cost that smoothing may add for each waypoint it removes, metres of level ground; 0 or above.
    pub smoothing_tolerance: f64,
}

impl Default for RouteSettings {
    /// The thesis' roadmap without height-difference threshold.
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
    /// The first one.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::not_negative("smoothing_tolerance", self.smoothing_tolerance)?;
        if self.landmarks > LANDMARKS_MAX {
            let message = format!("is {}; it must be at most {LANDMARKS_MAX}", self.landmarks);
            return Err(ParameterError::new("landmarks", message));
        }
        match self.method {
            Method::Roadmap(vertices) => vertices.check().map_err(|error| error.within("method")),
            Method::Anytime { weight, .. } if !(weight >= 1.0 && weight.is_finite()) => {
                let message = format!("is {weight}; it must be a finite number, 1 or above");
                Err(ParameterError::new("method.weight", message))
            }
            Method::Anytime { budget: 0, .. } => {
                Err(ParameterError::new("method.budget", "is 0; it must be at least 1 expansion"))
            }
            _ => Ok(()),
        }
    }
}
