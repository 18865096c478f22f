//! A graph in arrays, with the edges of each vertex contiguous (CSR).

use super::Network;

/// Directed graph with costs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    /// Index of the first edge of each vertex, and the total number of edges.
    offsets: Vec<u32>,
    targets: Vec<u32>,
    costs: Vec<f64>,
}

impl Graph {
    /// Builds a graph from the targets and costs of the edges of each vertex in turn.
    pub fn new(count: u32, mut edges: impl FnMut(u32, &mut dyn FnMut(u32, f64))) -> Self {
        let mut graph = Self { offsets: vec![0], ..Self::default() };
        for vertex in 0..count {
            edges(vertex, &mut |target, cost| {
                graph.targets.push(target);
                graph.costs.push(cost);
            });
            graph.offsets.push(graph.targets.len() as u32);
        }
        graph
    }

    /// Number of directed edges.
    pub fn edge_count(&self) -> usize {
        self.targets.len()
    }

    /// The graph with every edge reversed; the edges of a vertex are in the order of their sources.
    pub fn reversed(&self) -> Self {
        let mut offsets = vec![0; self.offsets.len()];
        self.targets.iter().for_each(|target| offsets[*target as usize + 1] += 1);
        for vertex in 1..offsets.len() {
            offsets[vertex] += offsets[vertex - 1];
        }
        let mut next = offsets.clone();
        let (mut targets, mut costs) = (vec![0; self.targets.len()], vec![0.0; self.costs.len()]);
        for vertex in 0..self.len() as u32 {
            self.edges(vertex, |target, cost| {
                let place = &mut next[target as usize];
                (targets[*place as usize], costs[*place as usize]) = (vertex, cost);
                *place += 1;
            });
        }
        Self { offsets, targets, costs }
    }
}

impl Network for Graph {
    fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    fn edges(&self, vertex: u32, mut visit: impl FnMut(u32, f64)) {
        let range = self.offsets[vertex as usize] as usize..self.offsets[vertex as usize + 1] as usize;
        self.targets[range.clone()].iter().zip(&self.costs[range]).for_each(|(target, cost)| visit(*target, *cost));
    }

    fn bound(&self, _from: u32, _to: u32) -> f64 {
        0.0
    }
}
