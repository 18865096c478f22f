//! Position of the sun.

use crate::direction::{Vector, direction};
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Range of azimuths accepted for a light, deg.
pub(crate) const AZIMUTHS_DEG: [f64; 2] = [-360.0, 720.0];

/// A distant sun with parallel rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sun {
    /// Azimuth from which the light comes, clockwise from north, deg.
    #[schemars(transform = limits::within(AZIMUTHS_DEG[0], AZIMUTHS_DEG[1]))]
    pub azimuth_deg: f64,
    /// Elevation above the horizon, above 0 to 90 deg.
    #[schemars(transform = limits::above(0.0, 90.0))]
    pub elevation_deg: f64,
}

impl Default for Sun {
    /// In the north-west, the convention for relief on maps.
    fn default() -> Self {
        Self { azimuth_deg: 315.0, elevation_deg: 45.0 }
    }
}

impl Sun {
    /// # Errors
    /// An azimuth out of range, or a sun that is not above the horizon.
    pub fn check(&self) -> Result<(), ParameterError> {
        check_direction(self.azimuth_deg, self.elevation_deg)
    }

    /// Unit vector towards the sun.
    ///
    /// ```
    /// use sastrugi_imaging::Sun;
    ///
    /// let sun = Sun { azimuth_deg: 90.0, elevation_deg: 30.0 };
    /// let [east, north, up] = sun.direction();
    /// assert!((east - 0.75_f64.sqrt()).abs() < 1e-12 && north.abs() < 1e-12 && (up - 0.5).abs() < 1e-12);
    /// assert!(Sun { elevation_deg: -5.0, ..sun }.check().is_err());
    /// ```
    pub fn direction(&self) -> Vector {
        direction(self.azimuth_deg, self.elevation_deg)
    }
}

/// Rejects directions that are not above the horizon.
pub(crate) fn check_direction(azimuth_deg: f64, elevation_deg: f64) -> Result<(), ParameterError> {
    let [low, high] = AZIMUTHS_DEG;
    if !(low..=high).contains(&azimuth_deg) {
        let message = format!("is {}; it must lie between {low} and {high} deg", shown(azimuth_deg));
        return Err(ParameterError::new("azimuth_deg", message));
    }
    if !(elevation_deg > 0.0 && elevation_deg <= 90.0) {
        let message = format!("is {}; it must be above 0 and at most 90 deg", shown(elevation_deg));
        return Err(ParameterError::new("elevation_deg", message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_a_sun_that_is_not_above_the_horizon_is_refused() {
        let key = |azimuth_deg, elevation_deg| Sun { azimuth_deg, elevation_deg }.check().err().map(|e| e.key);
        assert_eq!(Sun::default().check(), Ok(()));
        assert_eq!((key(0.0, 90.0), key(-90.0, 0.1)), (None, None));
        for elevation_deg in [0.0, -5.0, 90.1, f64::NAN] {
            assert_eq!(key(0.0, elevation_deg).as_deref(), Some("elevation_deg"));
        }
        for azimuth_deg in [f64::NAN, f64::INFINITY, 1e3] {
            assert_eq!(key(azimuth_deg, 10.0).as_deref(), Some("azimuth_deg"));
        }
    }
}
