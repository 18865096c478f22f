//! Targets of the team's members at a waypoint (the thesis, Algorithm 6, PlaceAgents).
//!
//! From waypoint P the ground is checked to the left, to the right and backwards, in steps of one cell while it is passable, up to the width and
//! depth of the formation. If there is less room, the formation's box is compressed, across and along separately. A target that cannot be reached
//! straight from its foot on the line through P, or where no member can stand, moves to that foot. Where the thesis is silent: at the last waypoint
//! the heading is that of the last leg; the box stays as close to P as the walls permit (the thesis centres it between the points reached, even if
//! there is room on both sides, which shifts the team at every isolated rock); a target too close to an earlier one moves back along the route until
//! it is clear, and if that fails, the waypoint is squeezed.

use super::footing::Footing;
use super::plane::{Vector, add, direction, distance, scale, sub, to_the_right};
use super::shape::Formation;

#[cfg(test)]
mod tests;

/// Relative rounding of distances.
const ROUNDING: f64 = 1e-9;

/// A stationary disc: a lost member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Centre, m.
    pub position_m: Vector,
    /// Radius, m.
    pub radius_m: f64,
}

/// Targets of the members at a waypoint.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Target of each slot, in the order of the slots, m.
    pub targets_m: Vec<Vector>,
    /// Corners of the compressed box: front left, front right, rear right, rear left, m.
    pub corners_m: [Vector; 4],
    /// Compression across and along, above 0 and at most 1; 1 in open ground.
    pub scale: [f64; 2],
    /// True if targets are closer to each other than the members' discs permit.
    pub squeezed: bool,
}

/// Inputs of a placement.
#[derive(Clone, Copy, Debug)]
pub struct Placer<'a> {
    /// Ground.
    pub footing: &'a Footing<'a>,
    /// Formation.
    pub formation: &'a Formation,
    /// Waypoints without successive duplicates, m.
    pub route_m: &'a [Vector],
    /// Radius of a member, m.
    pub radius_m: f64,
    /// Clearance between the discs of two members at their targets, m.
    pub margin_m: f64,
    /// Discs that targets keep clear of.
    pub discs: &'a [Disc],
}

/// A waypoint and the axes of its formation.
#[derive(Clone, Copy)]
struct Frame {
    at_m: Vector,
    forward: Vector,
    right: Vector,
}

impl Frame {
    /// The point at a depth behind the waypoint and a width to the right of it.
    fn point(&self, depth_m: f64, width_m: f64) -> Vector {
        add(self.at_m, sub(scale(self.right, width_m), scale(self.forward, depth_m)))
    }
}

impl Placer<'_> {
    /// Placements at all waypoints.
    pub fn all(&self) -> Vec<Placement> {
        (0..self.route_m.len()).map(|k| self.at(k)).collect()
    }

    /// Placement at waypoint `k`, which must exist.
    pub fn at(&self, k: usize) -> Placement {
        let at_m = self.route_m[k];
        let forward = heading(self.route_m, k);
        let frame = Frame { at_m, forward, right: to_the_right(forward) };
        let [leftmost_m, rightmost_m, depth_m] = self.formation.extent_m();
        let width_m = rightmost_m - leftmost_m;
        let [left_m, right_m] = [-1.0, 1.0].map(|side| self.reach_m(at_m, scale(frame.right, side), width_m));
        let back_m = self.reach_m(at_m, scale(forward, -1.0), depth_m);
        let share = |room_m: f64, needed_m: f64| if needed_m > 0.0 { (room_m / needed_m).min(1.0) } else { 1.0 };
        let (across, along) = (share(left_m + right_m, width_m), share(back_m, depth_m));
        let half_m = 0.5 * width_m * across;
        let centre_m = 0.0_f64.min(right_m - half_m).max(half_m - left_m);
        let middle_m = 0.5 * (leftmost_m + rightmost_m);
        let place = |[depth_m, width_m]: Vector| [depth_m * along, centre_m + (width_m - middle_m) * across];
        let mut placed = Placed { placer: self, k, frame, targets_m: Vec::new(), pushed_m: 0.0, squeezed: false };
        self.formation.slots().iter().for_each(|slot| placed.add(place(slot.from_leader_m)));
        let edges = [centre_m - half_m, centre_m + half_m];
        let corner = |depth_m: f64, edge: usize| frame.point(depth_m * along, edges[edge]);
        let corners_m = [corner(0.0, 0), corner(0.0, 1), corner(depth_m, 1), corner(depth_m, 0)];
        Placement { targets_m: placed.targets_m, corners_m, scale: [across, along], squeezed: placed.squeezed }
    }

    /// Distance that can be travelled straight from a point, at most `limit_m`, in steps of one cell.
    fn reach_m(&self, from_m: Vector, direction: Vector, limit_m: f64) -> f64 {
        let [dx, dy] = self.footing.ground().map.cell_m();
        let step_m = dx.min(dy);
        let count = libm::ceil(limit_m / step_m * (1.0 - ROUNDING)) as usize;
        let (mut reached_m, mut last_m) = (0.0, from_m);
        for k in 1..=count {
            let next_m = (k as f64 * step_m).min(limit_m);
            let point_m = add(from_m, scale(direction, next_m));
            if !self.footing.is_passable(last_m, point_m) {
                break;
            }
            (reached_m, last_m) = (next_m, point_m);
        }
        reached_m
    }

    /// The point of the route at a distance before waypoint `k`. Before the first waypoint it lies straight behind, if the ground is passable.
    fn behind(&self, k: usize, back_m: f64) -> Option<Vector> {
        let mut left_m = back_m;
        for pair in self.route_m[..=k].windows(2).rev() {
            let leg_m = distance(pair[0], pair[1]);
            if left_m <= leg_m {
                return Some(add(pair[1], scale(sub(pair[0], pair[1]), left_m / leg_m)));
            }
            left_m -= leg_m;
        }
        let start_m = self.route_m[0];
        let point_m = sub(start_m, scale(heading(self.route_m, 0), left_m));
        self.footing.is_passable(start_m, point_m).then_some(point_m)
    }
}

/// Targets of a waypoint placed so far.
struct Placed<'a> {
    placer: &'a Placer<'a>,
    k: usize,
    frame: Frame,
    targets_m: Vec<Vector>,
    /// Distance behind the waypoint up to which pushed-back targets occupy the route; depths grow with ids.
    pushed_m: f64,
    squeezed: bool,
}

impl Placed<'_> {
    /// Adds the target of the next slot: at its position, else at its foot, else on the route behind it.
    fn add(&mut self, [depth_m, width_m]: Vector) {
        let (foot_m, target_m) = (self.frame.point(depth_m, 0.0), self.frame.point(depth_m, width_m));
        let in_place = self.is_within_reach(foot_m, target_m).then_some(target_m);
        let wanted = in_place.into_iter().chain([foot_m]).find(|point_m| self.is_clear(*point_m));
        let target_m = wanted.or_else(|| self.pushed_back(depth_m)).unwrap_or_else(|| {
            self.squeezed = true;
            in_place.unwrap_or(foot_m)
        });
        self.targets_m.push(target_m);
    }

    fn is_within_reach(&self, foot_m: Vector, target_m: Vector) -> bool {
        let footing = self.placer.footing;
        footing.is_passable(foot_m, target_m) && footing.holds(target_m)
    }

    /// The first clear point of the route from a depth backwards.
    fn pushed_back(&mut self, depth_m: f64) -> Option<Vector> {
        let step_m = 0.25 * self.separation_m();
        // Each target occupies at most twice the separation along the route.
        let count = 8 * (self.targets_m.len() + self.placer.discs.len() + 1);
        let from_m = Some(depth_m.max(self.pushed_m)).filter(|from_m| from_m.is_finite())?;
        self.pushed_m = f64::INFINITY;
        for back_m in (0..=count).map(|n| from_m + n as f64 * step_m) {
            let point_m = self.placer.behind(self.k, back_m)?;
            if self.is_clear(point_m) {
                self.pushed_m = back_m;
                return Some(point_m);
            }
        }
        None
    }

    fn separation_m(&self) -> f64 {
        2.0 * self.placer.radius_m + self.placer.margin_m
    }

    fn is_clear(&self, point_m: Vector) -> bool {
        let apart = |other_m: Vector, least_m: f64| distance(point_m, other_m) >= least_m * (1.0 - ROUNDING);
        let Placer { radius_m, margin_m, discs, .. } = *self.placer;
        self.targets_m.iter().all(|other| apart(*other, self.separation_m()))
            && discs.iter().all(|disc| apart(disc.position_m, radius_m + disc.radius_m + margin_m))
    }
}

/// Heading at waypoint `k`: towards the next one; at the last one, from the previous one; east for a route of one waypoint.
pub fn heading(route_m: &[Vector], k: usize) -> Vector {
    let leg = |k: usize| Some(sub(*route_m.get(k + 1)?, *route_m.get(k)?)).and_then(direction);
    leg(k).or_else(|| leg(k.checked_sub(1)?)).unwrap_or([1.0, 0.0])
}
