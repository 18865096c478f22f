//! Contact culling: how far groups of contact points can still move before they may touch the ground.
//!
//! The height of the ground below a point changes by at most `L` times the horizontal distance the point moves, so a point
//! `c` above the ground cannot touch before it has moved by `c / sqrt(1 + L^2)` ([`Ground::steepness`]). A [`Clearance`]
//! accumulates an upper bound on the distance that any point of a rigid body has moved. A group of points that was found clear
//! is not checked again until this distance exceeds its clearance; the result is bit for bit the same. Where the ground may be
//! undefined, every group is checked.
//!
//! The belly's tiles use it. Wheel rays do not: most of them are near the ground, and a branch per ray costs as much as
//! looking up its height.

use super::contact::CULLING_MARGIN_M;
use super::ground::Ground;
use super::vector::{Axes, Vec3, dot, norm, sub};

/// The clearances of groups of points on a rigid body.
#[derive(Clone, Debug)]
pub(crate) struct Clearance {
    /// Distance of the farthest point from the reference point of the body, m.
    reach_m: f64,
    /// Previous position and orientation of the body.
    place: Option<(Vec3, Axes)>,
    /// Upper bound on the clearance used up by the motion so far, m.
    spent_m: f64,
    /// For each group: value of `spent_m` at which it may touch, m.
    budget_m: Vec<f64>,
}

impl Clearance {
    /// Clearances of `groups` groups of points within `reach_m` of a common reference point.
    pub(crate) fn new(groups: usize, reach_m: f64) -> Self {
        Self { reach_m, place: None, spent_m: 0.0, budget_m: vec![f64::NEG_INFINITY; groups] }
    }

    /// Records that the body has moved to a new place.
    #[inline(always)]
    pub(crate) fn moved(&mut self, ground: &Ground, place: Vec3, axes: &Axes) {
        if let Some((before, frame)) = self.place.replace((place, *axes)) {
            let turned = [sub(axes.x, frame.x), sub(axes.y, frame.y), sub(axes.z, frame.z)].map(|d| dot(d, d));
            let turned = (turned[0] + turned[1] + turned[2]).sqrt();
            // Infinite or NaN over ground with holes: then every group is checked.
            self.spent_m += ground.steepness() * (norm(sub(place, before)) + self.reach_m * turned);
        }
    }

    /// True for a group that cannot touch.
    #[inline(always)]
    pub(crate) fn is_clear(&self, group: usize) -> bool {
        self.spent_m < self.budget_m[group]
    }

    /// Records that no point of a group is nearer to the ground than `least_m`; minus infinity if one touches or the ground is
    /// unknown.
    #[inline(always)]
    pub(crate) fn found(&mut self, group: usize, least_m: f64) {
        self.budget_m[group] = self.spent_m + least_m - CULLING_MARGIN_M;
    }
}
