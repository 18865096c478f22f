//! Costs from one vertex to all others (Dijkstra, 1959).

use super::{Network, Open, Queue, Reversible};

/// Costs from one vertex to every vertex; infinite if there is no path.
pub fn costs_from(network: &impl Network, start: u32) -> Vec<f64> {
    settle(network.len(), start, |vertex, visit| network.edges(vertex, visit))
}

/// Costs from every vertex to one vertex; infinite if there is no path.
pub fn costs_to(network: &impl Reversible, goal: u32) -> Vec<f64> {
    settle(network.len(), goal, |vertex, visit| network.edges_into(vertex, visit))
}

fn settle(count: usize, root: u32, edges: impl Fn(u32, &mut dyn FnMut(u32, f64))) -> Vec<f64> {
    let mut costs = vec![f64::INFINITY; count];
    let mut open = Queue::default();
    open.push(Open::new(0.0, 0.0, root));
    costs[root as usize] = 0.0;
    while let Some(next) = open.pop() {
        if next.so_far() > costs[next.vertex() as usize] {
            continue;
        }
        edges(next.vertex(), &mut |beside, cost| {
            let through = next.so_far() + cost;
            if through < costs[beside as usize] {
                costs[beside as usize] = through;
                open.push(Open::new(through, through, beside));
            }
        });
    }
    costs
}
