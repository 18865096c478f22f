//! Moving obstacles: discs that follow polylines and give way to nobody.

use super::plane::{Vector, add, distance, scale, sub};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// A disc that follows a polyline once, at constant speed, and then stays at its last point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MovingObstacle {
    /// Polyline `[[x, y], ...]` in the terrain's coordinates, m; the obstacle stays at the first point until it starts.
    #[schemars(length(min = 1))]
    pub points_m: Vec<Vector>,
    /// Speed, above 0, m/s.
    #[schemars(transform = limits::positive)]
    pub speed_m_s: f64,
    /// Radius, above 0, m.
    #[schemars(transform = limits::positive)]
    pub radius_m: f64,
    /// Start time, at least 0, s.
    #[serde(default)]
    #[schemars(transform = limits::not_negative)]
    pub start_s: f64,
}

impl MovingObstacle {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::positive("speed_m_s", self.speed_m_s)?;
        ParameterError::positive("radius_m", self.radius_m)?;
        ParameterError::not_negative("start_s", self.start_s)?;
        let finite = self.points_m.iter().flatten().all(|value| value.is_finite());
        match !self.points_m.is_empty() && finite {
            true => Ok(()),
            false => {
                Err(ParameterError::new("points_m", "must have at least one point; all coordinates must be finite"))
            }
        }
    }

    /// Position of its centre at a time, m.
    pub fn position_m(&self, time_s: f64) -> Vector {
        let mut left_m = (time_s - self.start_s).max(0.0) * self.speed_m_s;
        for pair in self.points_m.windows(2) {
            let leg_m = distance(pair[0], pair[1]);
            if left_m < leg_m {
                return add(pair[0], scale(sub(pair[1], pair[0]), left_m / leg_m));
            }
            left_m -= leg_m;
        }
        self.points_m.last().copied().unwrap_or_default()
    }

    /// Time after which it stays at its last point, s.
    pub fn end_s(&self) -> f64 {
        let length_m: f64 = self.points_m.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        self.start_s + length_m / self.speed_m_s
    }
}
