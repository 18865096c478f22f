//! A* (Hart, Nilsson and Raphael, 1968).
//!
//! The bound is consistent ([`Network::bound`]), so no vertex is expanded twice. The thesis calls the Manhattan distance admissible; it is so only
//! with four neighbours and costs of at least 1 per metre.

use super::{Found, NONE, Network, Open, Queue, path_to};

/// The cheapest path; `None` if there is no path.
///
/// # Examples
/// ```
/// use sastrugi_navigation::search::astar;
/// use sastrugi_navigation::search::graph::Graph;
///
/// // The edge from 0 to 2 costs more than the way via 1; no edge leads back.
/// let graph = Graph::new(3, |vertex, visit| match vertex {
///     0 => {
///         visit(1, 1.0);
///         visit(2, 3.0);
///     }
///     1 => visit(2, 1.0),
///     _ => {}
/// });
/// assert_eq!(astar::search(&graph, 0, 2).map(|found| (found.path, found.cost)), Some((vec![0, 1, 2], 2.0)));
/// assert_eq!(astar::search(&graph, 2, 0), None);
/// ```
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
