//! The roadmap: vertices linked along rows and columns, and along diagonals if steps may be diagonal.
//!
//! Two marked nodes on a line with no other between them have an edge if every step from one to the other is allowed. Edges are directed, because
//! slope limits are. (The thesis uses the slope from end to end, which can hide a cliff.) An edge costs the sum of its steps, multiplied by the
//! factors of [`crate::clearance`] at both ends. Vertices depend on heights only, so costs other than slope are better planned on the grid.

use crate::cost::Spot;
use crate::line::Ground;
use crate::map::{Direction, Neighbourhood, Node, TravelMap};
use crate::search::components::components;
use crate::search::graph::Graph;
use crate::search::{NONE, Network};

#[cfg(test)]
mod tests;

/// Neighbouring vertices along the lines of a map.
pub struct Lines<'a> {
    map: &'a TravelMap,
    nodes: Vec<Node>,
    /// Vertex of each marked node.
    vertices: Vec<u32>,
    directions: &'static [Direction],
}

impl<'a> Lines<'a> {
    /// Lines between marked nodes.
    pub fn new(map: &'a TravelMap, marks: &[bool], neighbourhood: Neighbourhood) -> Self {
        let nodes: Vec<Node> = (0..map.len() as Node).filter(|node| marks[*node as usize]).collect();
        let mut vertices = vec![NONE; map.len()];
        nodes.iter().zip(0..).for_each(|(node, vertex)| vertices[*node as usize] = vertex);
        Self { map, nodes, vertices, directions: neighbourhood.directions() }
    }

    /// Nodes of the vertices, ascending.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Roadmap component of each vertex.
    pub fn components(&self) -> Vec<u32> {
        let target = |vertex: u32, k: u32| self.follow(vertex, self.directions[k as usize], |_, _| ());
        components(self.nodes.len() as u32, |_| self.directions.len() as u32, target)
    }

    /// The next vertex in a direction, if every step to it is allowed; `step` is called with both nodes of each step.
    fn follow(&self, vertex: u32, direction: Direction, mut step: impl FnMut(Node, Node)) -> Option<u32> {
        let mut node = self.nodes[vertex as usize];
        loop {
            let next = self.map.accessible(node, direction)?;
            step(node, next);
            match self.vertices[next as usize] {
                NONE => node = next,
                found => return Some(found),
            }
        }
    }
}

/// Vertices, edges and their costs.
#[derive(Clone, Debug)]
pub struct Roadmap<'a> {
    ground: Ground<'a>,
    neighbourhood: Neighbourhood,
    nodes: Vec<Node>,
    /// Positions of the vertices, kept together because lookups in the map are scattered.
    spots: Vec<Spot>,
    graph: Graph,
}

impl<'a> Roadmap<'a> {
    /// The roadmap of marked nodes.
    pub fn new(ground: Ground<'a>, marks: &[bool], neighbourhood: Neighbourhood) -> Self {
        let lines = Lines::new(ground.map, marks, neighbourhood);
        let graph = Graph::new(lines.nodes.len() as u32, |vertex, visit| {
            for &direction in lines.directions {
                let mut cost = 0.0;
                let sum = |node, next| cost += ground.costs.step(ground.map, node, next, direction);
                if let Some(target) = lines.follow(vertex, direction, sum) {
                    let [from, to] = [vertex, target].map(|vertex| lines.nodes[vertex as usize]);
                    visit(target, cost * room(&ground, from, to, direction));
                }
            }
        });
        let spots = lines.nodes.iter().map(|node| Spot::of(ground.map, *node)).collect();
        Self { ground, neighbourhood, nodes: lines.nodes, spots, graph }
    }

    /// Nodes of the vertices, ascending.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The edges and their costs.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The vertex at a node.
    pub fn vertex(&self, node: Node) -> Option<u32> {
        self.nodes.binary_search(&node).ok().map(|vertex| vertex as u32)
    }

    /// A lower bound on the cost from a vertex to a spot.
    pub(crate) fn bound_to(&self, vertex: u32, goal: Spot) -> f64 {
        self.ground.costs.bound_between(self.ground.map, self.spots[vertex as usize], goal, self.neighbourhood)
    }

    /// Position of a node.
    pub(crate) fn spot(&self, node: Node) -> Spot {
        Spot::of(self.ground.map, node)
    }

    /// Edges between a node and the first vertex, or `other`, in each direction: from the node, or to it with [`Way::To`].
    pub fn links(&self, node: Node, way: Way, other: Option<Node>) -> Vec<(Node, f64)> {
        let link = |direction: &Direction| self.link(node, *direction, way, other);
        self.neighbourhood.directions().iter().filter_map(link).collect()
    }

    fn link(&self, node: Node, direction: Direction, way: Way, other: Option<Node>) -> Option<(Node, f64)> {
        let map = self.ground.map;
        let (mut at, mut cost) = (node, 0.0);
        loop {
            let next = map.neighbour(at, direction)?;
            let (from, to, along) = match way {
                Way::From => (at, next, direction),
                Way::To => (next, at, direction.back()),
            };
            map.accessible(from, along)?;
            cost += self.ground.costs.step(map, from, to, along);
            if other == Some(next) || self.vertex(next).is_some() {
                return Some((next, cost * room(&self.ground, node, next, along)));
            }
            at = next;
        }
    }
}

/// Direction of links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// From the node.
    From,
    /// To the node.
    To,
}

/// Factor of an edge for the clearance at both ends.
fn room(ground: &Ground<'_>, from: Node, to: Node, along: Direction) -> f64 {
    ground.clearance.map_or(1.0, |clearance| clearance.multiplier(from, along) * clearance.multiplier(to, along))
}

impl Network for Roadmap<'_> {
    fn len(&self) -> usize {
        self.nodes.len()
    }

    fn edges(&self, vertex: u32, visit: impl FnMut(u32, f64)) {
        self.graph.edges(vertex, visit);
    }

    fn bound(&self, from: u32, to: u32) -> f64 {
        self.bound_to(from, self.spots[to as usize])
    }
}
