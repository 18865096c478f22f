//! All cells of a map as a network.

use super::{Network, Reversible};
use crate::line::Ground;
use crate::map::{Direction, Neighbourhood, Node};

/// Steps between neighbouring cells; vertices are nodes.
#[derive(Clone, Copy, Debug)]
pub struct GridNetwork<'a> {
    /// Ground and costs.
    pub ground: Ground<'a>,
    /// Allowed steps.
    pub neighbourhood: Neighbourhood,
}

impl GridNetwork<'_> {
    #[inline]
    fn cost(&self, node: Node, target: Node, direction: Direction) -> f64 {
        let Ground { map, costs, clearance } = self.ground;
        let room = |node| clearance.map_or(1.0, |clearance| clearance.multiplier(node, direction));
        costs.step(map, node, target, direction) * (room(node) * room(target))
    }

    /// Number of allowed directed steps.
    pub fn edge_count(&self) -> usize {
        let map = self.ground.map;
        let steps = |node| (0..self.neighbourhood.directions().len()).filter(|k| map.may_step(node, *k)).count();
        (0..map.len() as Node).map(steps).sum()
    }
}

impl Network for GridNetwork<'_> {
    fn len(&self) -> usize {
        self.ground.map.len()
    }

    fn edges(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        let map = self.ground.map;
        for (k, &direction) in self.neighbourhood.directions().iter().enumerate() {
            if map.may_step(node, k) {
                let target = map.beside(node, direction);
                visit(target, self.cost(node, target, direction));
            }
        }
    }

    fn bound(&self, from: Node, to: Node) -> f64 {
        self.ground.costs.bound(self.ground.map, from, to, self.neighbourhood)
    }
}

impl Reversible for GridNetwork<'_> {
    fn edges_into(&self, node: Node, mut visit: impl FnMut(Node, f64)) {
        let map = self.ground.map;
        for &direction in self.neighbourhood.directions() {
            let Some(source) = map.neighbour(node, direction.back()) else { continue };
            if map.accessible(source, direction).is_some() {
                visit(source, self.cost(source, node, direction));
            }
        }
    }
}
