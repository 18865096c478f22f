//! How far groups of contact points may still move before they can touch.
//!
//! The height of the ground below a point changes by at most `L` times the point's way in plan, so a point `c` above the
//! ground cannot touch before it has moved by `c / sqrt(1 + L^2)` ([`Ground::steepness`]). A [`Clearance`] adds up the longest
//! way that any point of a rigid body can have moved; a group of points that was found clear is not looked at again before
//! that way is used up, which changes no bit of the result. Where the ground may be undefined every group is looked at.
//!
//! The belly's tiles use it. Wheel rays do not: most of them are near the ground, and a branch for each costs as much as its
//! height.

use super::contact::CULLING_MARGIN_M;
use super::ground::Ground;
use super::vector::{Axes, Vec3, dot, norm, sub};

/// The clearances of groups of points on a rigid body.
#[derive(Clone, Debug)]
pub(crate) struct Clearance {
    /// Farthest point from the place that the body turns about, m.
    reach_m: f64,
    /// Where the body was last.
    place: Option<(Vec3, Axes)>,
    /// Bound of what the moves so far have taken from any clearance, m.
    spent_m: f64,
    /// For each group: what must be spent before it can touch, m.
    budget_m: Vec<f64>,
}

impl Clearance {
    /// Of `groups` groups of points within `reach_m` of a common place.
    pub(crate) fn new(groups: usize, reach_m: f64) -> Self {
        Self { reach_m, place: None, spent_m: 0.0, budget_m: vec![f64::NEG_INFINITY; groups] }
    }

    /// The body has moved to a place.
    #[inline(always)]
    pub(crate) fn moved(&mut self, ground: &Ground, place: Vec3, axes: &Axes) {
        if let Some((before, frame)) = self.place.replace((place, *axes)) {
            let turned = [sub(axes.x, frame.x), sub(axes.y, frame.y), sub(axes.z, frame.z)].map(|d| dot(d, d));
            let turned = (turned[0] + turned[1] + turned[2]).sqrt();
            // Infinite or NaN over ground with holes: then every group is looked at.
            self.spent_m += ground.steepness() * (norm(sub(place, before)) + self.reach_m * turned);
        }
    }

    /// True for a group that cannot touch.
    #[inline(always)]
    pub(crate) fn is_clear(&self, group: usize) -> bool {
        self.spent_m < self.budget_m[group]
    }

    /// No point of a group is nearer to the ground than `least_m`; minus infinity where one touches or the ground is not
    /// known.
    #[inline(always)]
    pub(crate) fn found(&mut self, group: usize, least_m: f64) {
        self.budget_m[group] = self.spent_m + least_m - CULLING_MARGIN_M;
    }
}
