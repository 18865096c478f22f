//! Perturbed starts: how much of a mission's outcome is chance.
//!
//! A vehicle on rough ground behaves chaotically: nearly identical starts can end differently. Replicate `k` of a mission starts
//! uniformly within a disk around the drawn start, with a heading uniform within an interval around the drawn heading; the goal
//! is unchanged. The first replicate is the drawn mission itself. Each replicate draws from its own stream (`mission-0001`,
//! `replicate-0002`, ...), so a larger number of replicates leaves the earlier ones unchanged.
//!
//! A point uniform in a disk of radius `r` lies `r sqrt(u)` from the centre at the angle `2 pi v`, with `u`, `v` uniform in
//! [0, 1). Cost: three draws per start.

use super::{Mission, normalized};
use sastrugi_numeric::Streams;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Starts per mission (chosen here: only the drawn one).
pub const DEFAULT_REPLICATES: u32 = 1;
/// Largest distance of perturbed starts from the drawn one (chosen here: the accuracy of placing a vehicle by hand), m.
pub const DEFAULT_START_TOLERANCE_M: f64 = 0.05;
/// Largest deviation of their heading from the drawn one (chosen here for the same reason), deg.
pub const DEFAULT_START_TOLERANCE_DEG: f64 = 2.0;
/// Maximum number of starts per mission.
const REPLICATES_MAX: u32 = 1000;

/// Several starts for each mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReplicateParameters {
    /// Starts driven for each mission, 1 to 1000: the drawn one, which is recorded, and perturbed ones.
    #[schemars(range(min = 1, max = REPLICATES_MAX))]
    pub replicates: u32,
    /// Perturbed starts lie within this distance of the drawn one, m; below the missions' length.
    #[schemars(transform = limits::not_negative)]
    pub start_tolerance_m: f64,
    /// Perturbed starts face within this angle of the drawn heading, deg, 0 to 180.
    #[schemars(transform = limits::within(0.0, 180.0))]
    pub start_tolerance_deg: f64,
}

impl Default for ReplicateParameters {
    fn default() -> Self {
        Self {
            replicates: DEFAULT_REPLICATES,
            start_tolerance_m: DEFAULT_START_TOLERANCE_M,
            start_tolerance_deg: DEFAULT_START_TOLERANCE_DEG,
        }
    }
}

/// Checked [`ReplicateParameters`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct ReplicateSettings(ReplicateParameters);

impl ReplicateSettings {
    /// Checks the parameters for missions of one length.
    ///
    /// # Errors
    /// A [`ParameterError`] for a number out of range, or a tolerance so large that a start might lie on the goal.
    pub fn new(raw: ReplicateParameters, length_m: f64) -> Result<Self, ParameterError> {
        if !(1..=REPLICATES_MAX).contains(&raw.replicates) {
            let message = format!("is {}; it must be 1 to {REPLICATES_MAX}", raw.replicates);
            return Err(ParameterError::new("replicates", message));
        }
        if !(0.0..length_m).contains(&raw.start_tolerance_m) {
            let message = format!(
                "is {}; it must be at least 0 and less than the mission length of {length_m} m",
                raw.start_tolerance_m
            );
            return Err(ParameterError::new("start_tolerance_m", message));
        }
        if !(0.0..=180.0).contains(&raw.start_tolerance_deg) {
            let message = format!("is {}; it must be 0 to 180", raw.start_tolerance_deg);
            return Err(ParameterError::new("start_tolerance_deg", message));
        }
        Ok(Self(raw))
    }

    /// Starts driven for each mission, including the drawn one.
    pub fn count(&self) -> usize {
        self.0.replicates as usize
    }

    /// Replicate `replicate` (from 0) of a mission; the first is the mission itself.
    pub fn start(&self, mission: &Mission, replicate: usize, streams: &Streams) -> Mission {
        if replicate == 0 {
            return mission.clone();
        }
        let name = format!("replicate-{:04}", replicate + 1);
        let mut stream = streams.child(&mission.id()).child(&name).stream("start");
        let radius_m = self.0.start_tolerance_m * stream.uniform().sqrt();
        let (sin, cos) = libm::sincos(TAU * stream.uniform());
        let tolerance_rad = self.0.start_tolerance_deg.to_radians();
        let turn_rad = stream.uniform_in(-tolerance_rad, tolerance_rad);
        Mission {
            start_m: [mission.start_m[0] + radius_m * cos, mission.start_m[1] + radius_m * sin],
            heading_rad: normalized(mission.heading_rad + turn_rad),
            ..mission.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(replicates: u32) -> ReplicateSettings {
        let raw = ReplicateParameters { replicates, start_tolerance_m: 0.3, start_tolerance_deg: 10.0 };
        ReplicateSettings::new(raw, 35.0).unwrap()
    }

    fn mission() -> Mission {
        Mission { draws: 3, ..Mission::between(4, [20.0, 30.0], [55.0, 30.0]) }
    }

    /// East and north of the drawn start, m, and left of the drawn heading, rad in (-pi, pi).
    fn offset(start: &Mission) -> [f64; 3] {
        let turn = start.heading_rad - mission().heading_rad;
        let turn = if turn > 0.5 * TAU { turn - TAU } else { turn };
        [start.start_m[0] - mission().start_m[0], start.start_m[1] - mission().start_m[1], turn]
    }

    #[test]
    fn val_the_first_start_is_the_drawn_one() {
        let streams = Streams::for_seed(1, "traverse");
        assert_eq!(settings(8).start(&mission(), 0, &streams), mission());
        let exact = ReplicateParameters { replicates: 2, start_tolerance_m: 0.0, start_tolerance_deg: 0.0 };
        assert_eq!(ReplicateSettings::new(exact, 35.0).unwrap().start(&mission(), 1, &streams), mission());
    }

    #[test]
    fn prop_starts_depend_only_on_mission_and_replicate() {
        let streams = Streams::for_seed(1, "traverse");
        let start = |settings: &ReplicateSettings, k| settings.start(&mission(), k, &streams);
        for k in 1..8 {
            let (a, b) = (start(&settings(8), k), start(&settings(1000), k));
            assert_eq!(a, b, "starts do not depend on the number of replicates");
            assert_eq!((a.index, a.goal_m, a.draws), (4, [55.0, 30.0], 3));
            assert!((1..k).all(|other| start(&settings(8), other) != a));
        }
        let other = Mission { index: 5, ..mission() };
        assert_ne!(settings(8).start(&other, 1, &streams).start_m, start(&settings(8), 1).start_m);
    }

    /// Null: starts are uniform in the disk of radius r, headings uniform within the tolerance t. n = 20 000 (missions x
    /// replicates); mean offsets, mean squared distance (r^2 / 2, variance r^4 / 12) and mean turn (variance t^2 / 3) within 5
    /// standard errors (false alarm 6e-7 each). A distance uniform in [0, r) would give r^2 / 3, 80 standard errors off.
    #[test]
    fn stat_starts_are_uniform_in_the_disk() {
        let (settings, streams) = (settings(1000), Streams::for_seed(1, "traverse"));
        let starts = (0..20).flat_map(|index| {
            let (settings, streams) = (&settings, &streams);
            (1..1000).map(move |k| settings.start(&Mission { index, ..mission() }, k, streams))
        });
        let offsets: Vec<[f64; 3]> = starts.map(|start| offset(&start)).collect();
        let n = offsets.len() as f64;
        let (r, t) = (0.3, 10.0_f64.to_radians());
        let mean = |f: &dyn Fn(&[f64; 3]) -> f64| offsets.iter().map(f).sum::<f64>() / n;
        let five_se = |variance: f64| 5.0 * (variance / n).sqrt();
        let squared = |o: &[f64; 3]| o[0] * o[0] + o[1] * o[1];
        assert!(offsets.iter().all(|o| squared(o) <= r * r * (1.0 + 1e-12) && o[2].abs() <= t * (1.0 + 1e-12)));
        assert!(mean(&|o| o[0]).abs() < five_se(r * r / 4.0));
        assert!(mean(&|o| o[1]).abs() < five_se(r * r / 4.0));
        assert!((mean(&squared) - 0.5 * r * r).abs() < five_se(r * r * r * r / 12.0));
        assert!(mean(&|o| o[2]).abs() < five_se(t * t / 3.0));
    }

    #[test]
    fn val_bad_parameters_are_refused() {
        let refused = |change: &dyn Fn(&mut ReplicateParameters)| {
            let mut raw = ReplicateParameters::default();
            change(&mut raw);
            ReplicateSettings::new(raw, 5.0).unwrap_err().key
        };
        assert_eq!(refused(&|p| p.replicates = 0), "replicates");
        assert_eq!(refused(&|p| p.replicates = 1001), "replicates");
        assert_eq!(refused(&|p| p.start_tolerance_m = -0.1), "start_tolerance_m");
        assert_eq!(refused(&|p| p.start_tolerance_m = 5.0), "start_tolerance_m");
        assert_eq!(refused(&|p| p.start_tolerance_m = f64::NAN), "start_tolerance_m");
        assert_eq!(refused(&|p| p.start_tolerance_deg = 181.0), "start_tolerance_deg");
    }
}
