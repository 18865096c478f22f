//! Detour of a member that makes no progress in the directions of Algorithm 7: the cheapest path over the cells, clear of stationary discs,
//! straightened. The thesis has no detours: its member tries the same directions forever.

use super::footing::Footing;
use super::placement::Disc;
use super::plane::{Vector, closest_approach, distance, sub};
use crate::map::{Neighbourhood, Node};
use crate::search::grid::GridNetwork;
use crate::search::{Network, astar};

#[cfg(test)]
mod tests;

/// Distance in cells around a point within which a node is searched that connects to it; steep cells may be open along their contours only.
const REACH: i32 = 3;

/// Points to visit in turn, the last one `to_m`; `None` if no path leads there.
pub fn detour(footing: &Footing<'_>, from_m: Vector, to_m: Vector, discs: &[Disc]) -> Option<Vec<Vector>> {
    let ground = footing.ground();
    let grid = GridNetwork { ground, neighbourhood: Neighbourhood::Eight };
    let around = Around { footing, grid, discs };
    if around.is_open(from_m, to_m) {
        return Some(vec![to_m]);
    }
    let start = footing.node_near(from_m, REACH, |node_m| around.is_open(from_m, node_m))?;
    let goal = footing.node_near(to_m, REACH, |node_m| around.is_open(node_m, to_m))?;
    let found = astar::search(&around, start, goal)?;
    let corners = [from_m].into_iter().chain(found.path.iter().map(|node| ground.map.position_m(*node))).chain([to_m]);
    Some(around.straightened(&corners.collect::<Vec<_>>()))
}

/// Steps between cells that keep clear of discs, whose radii are sums of both radii.
struct Around<'a> {
    footing: &'a Footing<'a>,
    grid: GridNetwork<'a>,
    discs: &'a [Disc],
}

impl Around<'_> {
    fn is_clear(&self, from_m: Vector, to_m: Vector) -> bool {
        self.discs.iter().all(|disc| {
            let offset_m = sub(from_m, disc.position_m);
            // A path that starts within a disc may leave it.
            let least_m = disc.radius_m.min(distance(from_m, disc.position_m));
            closest_approach(offset_m, sub(to_m, from_m)) >= least_m
        })
    }

    fn is_open(&self, from_m: Vector, to_m: Vector) -> bool {
        self.is_clear(from_m, to_m) && self.footing.is_passable(from_m, to_m)
    }

    /// The corners that remain when straight open lines replace the path, without the first.
    fn straightened(&self, corners: &[Vector]) -> Vec<Vector> {
        let mut kept = Vec::new();
        let mut start = 0;
        while start + 1 < corners.len() {
            let mut end = start + 1;
            while end + 1 < corners.len() && self.is_open(corners[start], corners[end + 1]) {
                end += 1;
            }
            kept.push(corners[end]);
            start = end;
        }
        kept
    }
}

impl Network for Around<'_> {
    fn len(&self) -> usize {
        self.grid.len()
    }

    fn edges(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        let map = self.grid.ground.map;
        self.grid.edges(node, |target, cost| {
            if self.is_clear(map.position_m(node), map.position_m(target)) {
                visit(target, cost);
            }
        });
    }

    fn bound(&self, from: Node, to: Node) -> f64 {
        self.grid.bound(from, to)
    }
}
