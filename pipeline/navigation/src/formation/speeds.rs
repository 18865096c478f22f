//! Speeds that keep the members' distances (the thesis, Algorithm 8, TuneSpeeds).
//!
//! Each follower compares its distance behind its predecessor, along the predecessor's heading, with the depth of its slot, and requests speeds: a
//! lower one of itself if it is too close, a higher one if it lags, and a lower one of its predecessor if it lags by twice as much. Of several
//! requests to a member, slower has precedence over faster, and faster over the mean speed. The listing slows down a member that lags, although the
//! text ranks requests to speed up, which the listing never makes; `literal` follows the listing. With a depth of 0 the bands of the listing are
//! empty; here the bands are then shares of the spacing.

use super::plane::{Vector, dot, sub};
use super::shape::Formation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// Speed and acceleration limits of a member.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpeedLimits {
    /// Mean speed, m/s.
    pub mean_m_s: f64,
    /// Lowest speed of a moving member, m/s.
    pub min_m_s: f64,
    /// Highest speed, m/s.
    pub max_m_s: f64,
    /// Acceleration, m/s^2.
    pub accelerate_m_s2: f64,
    /// Deceleration, m/s^2.
    pub slow_m_s2: f64,
}

/// Speed request to a member; greater values take precedence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Request {
    /// No request.
    #[default]
    None,
    /// The mean speed.
    Mean,
    /// A higher speed.
    Faster,
    /// A lower speed.
    Slower,
}

/// Bands of the distance behind the predecessor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bands {
    /// Width of a band as a share of the slot's depth, or of the spacing if that is larger; above 0 and below 0.5.
    pub tolerance: f64,
    /// Distance between adjacent slots, m.
    pub spacing_m: f64,
    /// Whether to follow the listing.
    pub literal: bool,
}

impl SpeedLimits {
    /// Speed after `step_s` seconds with this request.
    pub fn tuned(&self, speed_m_s: f64, request: Request, step_s: f64) -> f64 {
        let (slower, faster) = (speed_m_s - self.slow_m_s2 * step_s, speed_m_s + self.accelerate_m_s2 * step_s);
        let tuned_m_s = match request {
            Request::None => speed_m_s,
            Request::Mean => self.mean_m_s.clamp(slower, faster),
            Request::Faster => faster,
            Request::Slower => slower,
        };
        tuned_m_s.clamp(self.min_m_s, self.max_m_s)
    }
}

impl Bands {
    /// Requests to the members, per slot. `position` and `heading` are those of the member in a slot.
    pub fn requests(
        &self,
        formation: &Formation,
        position: impl Fn(usize) -> Vector,
        heading: impl Fn(usize) -> Vector,
    ) -> Vec<Request> {
        let mut requests = vec![Request::None; formation.slots().len()];
        for (k, slot) in formation.slots().iter().enumerate() {
            let Some(predecessor) = slot.predecessor else { continue };
            let distance_m = dot(sub(position(predecessor), position(k)), heading(predecessor));
            let [own, other] = self.of_follower(distance_m, slot.offset_m[0]);
            requests[k] = requests[k].max(own);
            requests[predecessor] = requests[predecessor].max(other);
        }
        requests
    }

    /// Requests of a follower at this distance behind its predecessor: to itself, and to the predecessor.
    pub fn of_follower(&self, distance_m: f64, depth_m: f64) -> [Request; 2] {
        let band_m = self.tolerance * depth_m.abs().max(self.spacing_m);
        let lag_m = distance_m - depth_m;
        match self.literal {
            _ if lag_m < -band_m => [Request::Slower, Request::None],
            false if lag_m > 2.0 * band_m => [Request::Faster, Request::Slower],
            false if lag_m > band_m => [Request::Faster, Request::None],
            true if lag_m > 2.0 * band_m => [Request::None, Request::Slower],
            true if lag_m > band_m => [Request::Slower, Request::None],
            _ => [Request::Mean; 2],
        }
    }
}
