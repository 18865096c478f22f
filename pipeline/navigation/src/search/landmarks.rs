//! Landmarks: tighter bounds for many searches on one network (ALT; Goldberg and Harrelson, 2005).
//!
//! The costs to and from a few distant vertices give a bound between any two vertices by the triangle inequality. Costs are directional, so both
//! tables are needed. A lowered cost invalidates them; rebuild them after an edit.

use super::graph::Graph;
use super::{Network, dijkstra};

/// Costs from and to the landmarks.
#[derive(Clone, Debug)]
pub struct Landmarks {
    count: usize,
    /// For each vertex in turn, the costs from and to each landmark.
    costs: Vec<[f64; 2]>,
}

/// Landmark costs of the goal of one search.
#[derive(Clone, Debug)]
pub struct Target {
    /// For each landmark, the least cost from it to the goal, and the greatest cost to it from a last vertex, less the last edge.
    costs: Vec<[f64; 2]>,
}

impl Landmarks {
    /// Selects `count` landmarks: the first far from vertex 0, each other one as far as possible, there and back, from the nearest selected before.
    pub fn new(graph: &Graph, count: usize) -> Self {
        let reversed = graph.reversed();
        let mut costs = vec![[f64::INFINITY; 2]; graph.len() * count];
        let tables = |vertex: u32| [dijkstra::costs_from(graph, vertex), dijkstra::costs_from(&reversed, vertex)];
        let nearer = |distances: &mut [f64], [from, to]: &[Vec<f64>; 2]| {
            let both = from.iter().zip(to).map(|(from, to)| from + to);
            distances.iter_mut().zip(both).for_each(|(distance, both)| *distance = distance.min(both));
        };
        let mut distances = vec![f64::INFINITY; graph.len()];
        if !graph.is_empty() {
            nearer(&mut distances, &tables(0));
        }
        for k in 0..count {
            let Some(landmark) = farthest(&distances) else { break };
            let tables = tables(landmark);
            if k == 0 {
                distances.fill(f64::INFINITY);
            }
            nearer(&mut distances, &tables);
            for (vertex, (from, to)) in tables[0].iter().zip(&tables[1]).enumerate() {
                costs[vertex * count + k] = [*from, *to];
            }
        }
        Self { count, costs }
    }

    fn of(&self, vertex: u32) -> &[[f64; 2]] {
        let first = vertex as usize * self.count;
        &self.costs[first..first + self.count]
    }

    /// A goal that is reached over last edges, given by their source vertices and costs.
    pub fn target(&self, last_edges: &[(u32, f64)]) -> Target {
        let mut costs = vec![[f64::INFINITY, f64::NEG_INFINITY]; self.count];
        for &(vertex, cost) in last_edges {
            for (target, of_vertex) in costs.iter_mut().zip(self.of(vertex)) {
                *target = [target[0].min(of_vertex[0] + cost), target[1].max(of_vertex[1] - cost)];
            }
        }
        Target { costs }
    }

    /// A lower bound on the cost from a vertex to a goal, 0 or above.
    pub fn bound(&self, vertex: u32, target: &Target) -> f64 {
        // A landmark that cannot reach the vertex, or that the goal cannot reach, gives no bound: `max` drops NaN and -inf.
        let bounds = self.of(vertex).iter().zip(&target.costs);
        bounds.fold(0.0, |least, (here, there)| least.max(there[0] - here[0]).max(here[1] - there[1]))
    }
}

/// The first vertex with the greatest finite distance.
fn farthest(distances: &[f64]) -> Option<u32> {
    let finite = (0u32..).zip(distances).filter(|(_, distance)| distance.is_finite());
    finite
        .fold(None, |best: Option<(u32, f64)>, (vertex, &distance)| match best {
            Some((_, most)) if distance <= most => best,
            _ => Some((vertex, distance)),
        })
        .map(|(vertex, _)| vertex)
}
