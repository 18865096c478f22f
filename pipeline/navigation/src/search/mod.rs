//! Shortest-path searches.
//!
//! Searches run on a [`Network`]: all cells of a map ([`grid::GridNetwork`]), the vertices of a [`crate::roadmap::Roadmap`], or a plain
//! [`graph::Graph`]. Ties are broken by the same rule everywhere, first the vertex with the larger cost so far, then the one with the smaller number,
//! so that a path depends only on the network.

pub mod anytime;
pub mod astar;
pub mod components;
pub mod dijkstra;
pub mod dstar_lite;
pub mod graph;
pub mod grid;
pub mod landmarks;
mod queue;
#[cfg(test)]
pub(crate) mod tests;
pub mod theta_star;

pub(crate) use queue::{Open, Queue};

/// No vertex.
pub(crate) const NONE: u32 = u32::MAX;

/// A directed graph with costs above 0.
pub trait Network: Sync {
    /// Number of vertices, numbered from 0.
    fn len(&self) -> usize;

    /// True if there are no vertices.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Calls `visit` with the target and the cost of every edge from a vertex, in a fixed order.
    fn edges(&self, vertex: u32, visit: impl FnMut(u32, f64));

    /// A lower bound on the cost of any path between two vertices; along an edge it decreases by at most the cost of the edge.
    fn bound(&self, from: u32, to: u32) -> f64;
}

/// A network whose edges can be followed backwards.
pub trait Reversible: Network {
    /// Calls `visit` with the source and the cost of every edge to a vertex, in a fixed order.
    fn edges_into(&self, vertex: u32, visit: impl FnMut(u32, f64));
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Vertices from start to goal.
    pub path: Vec<u32>,
    /// Sum of the costs of its edges.
    pub cost: f64,
    /// Number of vertices expanded.
    pub expansions: u64,
}

/// The path to a vertex, from the parents; the start has no parent.
pub(crate) fn path_to(goal: u32, parents: &[u32]) -> Vec<u32> {
    let parent = |vertex: &u32| Some(parents[*vertex as usize]).filter(|parent| *parent != NONE);
    let mut path: Vec<u32> = std::iter::successors(Some(goal), parent).collect();
    path.reverse();
    path
}

/// Cost of a path, by the cheapest edge from each vertex to the next; infinite if an edge is missing.
pub(crate) fn cost_along(network: &impl Network, path: &[u32]) -> f64 {
    let edge = |from: u32, to: u32| {
        let mut cheapest = f64::INFINITY;
        network.edges(from, |target, cost| cheapest = if target == to { cost.min(cheapest) } else { cheapest });
        cheapest
    };
    path.windows(2).fold(0.0, |sum, pair| sum + edge(pair[0], pair[1]))
}
