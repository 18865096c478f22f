//! Where members of a team can stand.
//!
//! Lines between points, unlike steps between nodes, can lead along a contour of a steep slope to a point with no open direction, or onto a plateau
//! that no path leaves. A member therefore stands only where it can reach an adjacent node that belongs to the same ground as the route: to a strong
//! component of the grid that contains a waypoint.

use super::plane::{Vector, distance};
use crate::line::{Ground, is_passable};
use crate::map::{Direction, Node};
use crate::search::components::components;

#[cfg(test)]
mod tests;

/// Ground with its strong components: nodes that can all reach one another by steps to their eight neighbours. Time and memory are proportional to
/// the number of cells (16 B each during construction, 4 B each afterwards).
#[derive(Clone, Debug)]
pub struct TeamGround<'a> {
    ground: Ground<'a>,
    components: Vec<u32>,
}

impl<'a> TeamGround<'a> {
    /// Finds the components.
    pub fn new(ground: Ground<'a>) -> Self {
        let map = ground.map;
        let step =
            |node: Node, k: u32| map.may_step(node, k as usize).then(|| map.beside(node, Direction::ALL[k as usize]));
        Self { ground, components: components(map.len() as u32, |_| Direction::ALL.len() as u32, step) }
    }

    /// Map, costs and clearance.
    pub fn ground(&self) -> Ground<'a> {
        self.ground
    }
}

/// The part of the ground that belongs to a route.
#[derive(Clone, Debug)]
pub struct Footing<'a> {
    on: &'a TeamGround<'a>,
    /// Components that contain waypoints, ascending.
    home: Vec<u32>,
}

impl<'a> Footing<'a> {
    /// The components around some points, m.
    pub fn new(on: &'a TeamGround<'a>, points_m: &[Vector]) -> Self {
        let mut footing = Self { on, home: Vec::new() };
        let around = |point_m: &Vector| {
            let nodes = footing.nodes_around(*point_m, 0).collect::<Vec<_>>();
            let open = |node: &Node| footing.is_passable(*point_m, on.ground.map.position_m(*node));
            nodes.into_iter().filter(open).map(|node| on.components[node as usize]).collect::<Vec<_>>()
        };
        let mut home: Vec<u32> = points_m.iter().flat_map(around).collect();
        home.sort_unstable();
        home.dedup();
        footing.home = home;
        footing
    }

    /// Map, costs and clearance.
    pub fn ground(&self) -> Ground<'a> {
        self.on.ground
    }

    /// Whether the straight line between two points is passable.
    pub fn is_passable(&self, from_m: Vector, to_m: Vector) -> bool {
        let map = self.on.ground.map;
        is_passable(map, map.point_at(from_m), map.point_at(to_m))
    }

    /// Whether a member can stand at a point: it can reach an adjacent node of the route's ground.
    pub fn holds(&self, point_m: Vector) -> bool {
        let map = self.on.ground.map;
        self.nodes_around(point_m, 0).any(|node| self.is_passable(point_m, map.position_m(node)))
    }

    /// The nearest open node of the route's ground within `cells` of a point.
    pub fn node_near(&self, point_m: Vector, cells: i32, open: impl Fn(Vector) -> bool) -> Option<Node> {
        let map = self.on.ground.map;
        let away_m = |node: &Node| distance(map.position_m(*node), point_m);
        let mut nodes: Vec<Node> = self.nodes_around(point_m, cells).collect();
        nodes.sort_by(|a, b| away_m(a).total_cmp(&away_m(b)));
        nodes.into_iter().find(|node| open(map.position_m(*node)))
    }

    /// Free nodes of the route's ground: the corners of the square that contains the point, and `cells` more on each side.
    fn nodes_around(&self, point_m: Vector, cells: i32) -> impl Iterator<Item = Node> {
        let map = self.on.ground.map;
        let corner = map.point_at(point_m).map(libm::floor);
        let offsets = move || (-cells..=cells + 1).map(f64::from);
        let points =
            offsets().flat_map(move |down| offsets().map(move |across| [corner[0] + down, corner[1] + across]));
        let nodes = points.filter(|point| map.holds(*point)).map(|point| map.nearest(point));
        nodes.filter(|node| !map.is_blocked(*node) && self.is_home(*node))
    }

    fn is_home(&self, node: Node) -> bool {
        self.home.is_empty() || self.home.binary_search(&self.on.components[node as usize]).is_ok()
    }
}
