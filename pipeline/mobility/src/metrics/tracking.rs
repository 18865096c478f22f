//! Cross-track error: how closely a vehicle followed its course.
//!
//! The foot of a sample on a polyline ([`Polyline::foot`]) is searched from the previous sample's foot to three wheelbases
//! beyond it, the default look-ahead distance, so a nearer part of another pass is not mistaken for the current one. A straight
//! line is a polyline of two points.

use super::{max_abs, rms};
use crate::missions::{Mission, Polyline};
use crate::vehicle::LOOKAHEAD_WHEELBASES;
use sastrugi_schemas::topics::{Recording, StateSample};

/// Distance between a vehicle and its line, m; NaN without samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossTrack {
    /// Root mean square over the samples, m.
    pub rms_m: f64,
    /// Largest, m, at least 0.
    pub max_m: f64,
}

impl CrossTrack {
    /// Cross-track error of poses along a polyline; feet are searched within `window_m` (m, at least the distance driven
    /// between two samples).
    pub fn of(states: &[StateSample], line: &Polyline, window_m: f64) -> Self {
        let errors: Vec<f64> = line.feet(states, window_m).iter().map(|foot| foot.cross_track_m).collect();
        Self { rms_m: rms(&errors), max_m: max_abs(&errors) }
    }
}

/// Cross-track error of a recorded mission with respect to its polyline, or to the straight line from start to goal.
pub fn cross_track(mission: &Mission, recording: &Recording) -> CrossTrack {
    let straight = || Polyline::new(&[mission.start_m, mission.goal_m]).ok();
    match mission.line.clone().or_else(straight) {
        Some(line) => CrossTrack::of(&recording.states, &line, window_m(recording)),
        None => CrossTrack { rms_m: f64::NAN, max_m: f64::NAN },
    }
}

/// Three wheelbases of the recorded vehicle, m.
pub(super) fn window_m(recording: &Recording) -> f64 {
    let hubs = recording.vehicle.wheels.iter().map(|wheel| wheel.hub_m[0]);
    let [rear, front] = hubs.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
    LOOKAHEAD_WHEELBASES * (front - rear).max(0.0)
}
