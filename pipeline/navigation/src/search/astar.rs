//! A* (Hart, Nilsson and Raphael, 1968).
//!
//! The bound is consistent ([`Network::bound`]), so that no vertex is expanded twice. The thesis calls the Manhattan distance admissible;
//! it is so only with four neighbours and costs of at least 1 per metre.

use super::{Found, NONE, Network, Open, Queue, path_to};

/// The cheapest path; `None` where there is no path.
pub fn search(network: &impl Network, start: u32, goal: u32) -> Option<Found> {
    let mut costs = vec![f64::INFINITY; network.len()];
    let mut parents = vec![NONE; network.len()];
    let mut closed = vec![false; network.len()];
    let mut open = Queue::default();
    let mut expansions = 0;
    costs[start as usize] = 0.0;
    open.push(Open::new(network.bound(start, goal), 0.0, start));
    while let Some(next) = open.pop() {
        let vertex = next.vertex();
        if std::mem::replace(&mut closed[vertex as usize], true) {
            continue;
        }
        if vertex == goal {
            return Some(Found { path: path_to(goal, &parents), cost: next.so_far(), expansions });
        }
        expansions += 1;
        network.edges(vertex, |target, cost| {
            let through = next.so_far() + cost;
            if !closed[target as usize] && through < costs[target as usize] {
                costs[target as usize] = through;
                parents[target as usize] = vertex;
                open.push(Open::new(through + network.bound(target, goal), through, target));
            }
        });
    }
    None
}
