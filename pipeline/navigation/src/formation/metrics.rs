//! How well a team keeps its formation.
//!
//! The errors of a follower are its distances behind its predecessor and to the right of it, minus the depth and the width of its slot. Directions
//! are those of the leg of the route that the predecessor is on (the thesis: "the movement direction of the group"). Errors count from the start
//! until the follower arrives or is lost.

use super::plane::{Vector, dot, sub, to_the_right};

#[cfg(test)]
mod tests;

/// Share of the spacing up to which errors count as in range (the thesis, section 5.3).
pub const IN_RANGE: f64 = 0.2;
/// Share of the spacing up to which errors count as tolerable.
pub const TOLERABLE: f64 = 0.4;

/// Depth and width error of a follower, m; positive if it is too far behind or to the right.
pub fn errors_m(predecessor_m: Vector, forward: Vector, follower_m: Vector, offset_m: [f64; 2]) -> [f64; 2] {
    let back_m = sub(predecessor_m, follower_m);
    [dot(back_m, forward) - offset_m[0], -dot(back_m, to_the_right(forward)) - offset_m[1]]
}

/// Error sums over the steps of one follower.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowerErrors {
    /// Number of steps.
    pub steps: u64,
    /// Sums of the absolute depth and width errors, m.
    pub sums_m: [f64; 2],
    /// Largest absolute errors, m.
    pub largest_m: [f64; 2],
    /// Steps with both errors in range.
    pub in_range: u64,
    /// Steps with both errors tolerable.
    pub tolerable: u64,
}

impl FollowerErrors {
    /// Adds the errors of one step.
    pub fn add(&mut self, errors_m: [f64; 2], spacing_m: f64) {
        let size_m = errors_m.map(f64::abs);
        self.steps += 1;
        for (axis, size_m) in size_m.into_iter().enumerate() {
            self.sums_m[axis] += size_m;
            self.largest_m[axis] = self.largest_m[axis].max(size_m);
        }
        let within = |share: f64| u64::from(size_m.iter().all(|size_m| *size_m <= share * spacing_m));
        self.in_range += within(IN_RANGE);
        self.tolerable += within(TOLERABLE);
    }

    /// Mean absolute depth and width error, m; NaN without steps.
    pub fn mean_m(&self) -> [f64; 2] {
        self.sums_m.map(|sum_m| sum_m / self.steps as f64)
    }
}

/// Metrics of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metrics {
    /// Errors of each member while it followed another.
    pub followers: Vec<FollowerErrors>,
    /// Horizontal distance driven by each member, m.
    pub driven_m: Vec<f64>,
    /// Least distance between the centres of two members, m; infinite for a single member.
    pub least_separation_m: f64,
    /// Number of steps that members waited.
    pub waits: u64,
    /// Number of steps that members moved in a direction other than towards their targets.
    pub dodges: u64,
    /// Number of waypoints with too little room even for the compressed formation.
    pub squeezed: u64,
    /// Number of steps in which a moving obstacle touched a member, summed over members.
    pub contacts: u64,
    /// Number of route changes.
    pub replans: u64,
}

impl Metrics {
    /// Metrics of a team at its start.
    pub fn of(members: usize) -> Self {
        Self {
            followers: vec![FollowerErrors::default(); members],
            driven_m: vec![0.0; members],
            least_separation_m: f64::INFINITY,
            ..Self::default()
        }
    }

    /// Mean absolute depth and width error over followers and time, m; NaN without followers.
    pub fn mean_errors_m(&self) -> [f64; 2] {
        let steps: u64 = self.followers.iter().map(|follower| follower.steps).sum();
        [0, 1].map(|axis| self.followers.iter().map(|follower| follower.sums_m[axis]).sum::<f64>() / steps as f64)
    }

    /// Largest mean depth and width error of a follower, m; NaN without followers.
    pub fn worst_errors_m(&self) -> [f64; 2] {
        let means = self.followers.iter().filter(|follower| follower.steps > 0).map(FollowerErrors::mean_m);
        means.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]).unwrap_or([f64::NAN; 2])
    }

    /// Shares of time and followers with both errors in range and tolerable; NaN without followers.
    pub fn shares(&self) -> [f64; 2] {
        let sum = |count: fn(&FollowerErrors) -> u64| self.followers.iter().map(count).sum::<u64>() as f64;
        [sum(|f| f.in_range), sum(|f| f.tolerable)].map(|count| count / sum(|f| f.steps))
    }
}
