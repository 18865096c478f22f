//! Parameters of random straight missions.

use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Missions per terrain (Majhor and Bos, section 2.3).
pub const DEFAULT_COUNT: u32 = 20;
/// Distance from start to goal (section 2.3), m.
pub const DEFAULT_LENGTH_M: f64 = 35.0;
/// Width of the border without starts and goals (section 2.3), m.
pub const DEFAULT_BORDER_M: f64 = 5.0;
/// Maximum number of draws per mission (chosen here: the published terrains need fewer than 100).
pub const DEFAULT_MAX_DRAWS: u32 = 100_000;
/// Maximum number of missions per terrain: their ids have four digits.
const COUNT_MAX: u32 = 9999;

/// Random straight missions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MissionParameters {
    /// Missions per terrain, 1 to 9999 (Majhor and Bos, section 2.3: 20).
    #[schemars(range(min = 1, max = COUNT_MAX))]
    pub count: u32,
    /// Straight distance from start to goal, m (section 2.3: 35).
    #[schemars(transform = limits::positive)]
    pub length_m: f64,
    /// Starts and goals lie farther than this from the edge of the terrain, m (section 2.3: 5).
    #[schemars(transform = limits::not_negative)]
    pub border_m: f64,
    /// Maximum number of draws of start and heading per mission; beyond it the terrain is rejected.
    #[schemars(range(min = 1))]
    pub max_draws: u32,
}

impl Default for MissionParameters {
    fn default() -> Self {
        Self {
            count: DEFAULT_COUNT,
            length_m: DEFAULT_LENGTH_M,
            border_m: DEFAULT_BORDER_M,
            max_draws: DEFAULT_MAX_DRAWS,
        }
    }
}

/// Checked [`MissionParameters`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct MissionSettings(MissionParameters);

impl MissionSettings {
    /// Missions per terrain.
    pub fn count(&self) -> usize {
        self.0.count as usize
    }

    /// Distance from start to goal, m.
    pub fn length_m(&self) -> f64 {
        self.0.length_m
    }

    /// Width of the border, m.
    pub fn border_m(&self) -> f64 {
        self.0.border_m
    }

    /// Maximum number of draws per mission.
    pub fn max_draws(&self) -> u32 {
        self.0.max_draws
    }
}

impl TryFrom<MissionParameters> for MissionSettings {
    type Error = ParameterError;

    fn try_from(raw: MissionParameters) -> Result<Self, ParameterError> {
        if !(1..=COUNT_MAX).contains(&raw.count) {
            return Err(ParameterError::new("count", format!("is {}; it must be 1 to {COUNT_MAX}", raw.count)));
        }
        if raw.max_draws == 0 {
            return Err(ParameterError::new("max_draws", "is 0; it must be 1 or above"));
        }
        ParameterError::positive("length_m", raw.length_m)?;
        ParameterError::not_negative("border_m", raw.border_m)?;
        Ok(Self(raw))
    }
}
