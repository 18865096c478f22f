//! Anytime weighted A* (Hansen and Zhou, 2007).
//!
//! Vertices come in the order of cost so far plus `weight` times the bound: a path is found soon, and the search goes on to better ones
//! until its budget of expansions is spent or none can be better. The cost over the smallest sum of cost so far and plain bound among the
//! vertices left is a proven bound on cost over optimum. Budgets count expansions, never time: the same call finds the same path.

use super::{Found, NONE, Network, Open, Queue, cost_along, path_to};

/// How the search ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The best path found, and a bound on its cost over the optimum, at least 1.
    Found(Found, f64),
    /// There is no path.
    NoPath,
    /// The budget was spent before a path was found.
    Spent,
}

/// The best path that `budget` expansions find, with a weight of 1 or above.
pub fn search(network: &impl Network, start: u32, goal: u32, weight: f64, budget: u64) -> Outcome {
    let mut costs = vec![f64::INFINITY; network.len()];
    let mut parents = vec![NONE; network.len()];
    let mut open = Queue::default();
    open.push(Open::new(0.0, 0.0, start));
    let mut expansions = 0;
    costs[start as usize] = 0.0;
    let hope = |next: &Open, costs: &[f64]| {
        let sum = next.so_far() + network.bound(next.vertex(), goal);
        Some(sum).filter(|sum| next.so_far() <= costs[next.vertex() as usize] && *sum < costs[goal as usize])
    };
    while expansions < budget
        && let Some(next) = open.pop()
    {
        if hope(&next, &costs).is_none() {
            continue;
        }
        expansions += 1;
        network.edges(next.vertex(), |target, cost| {
            let through = next.so_far() + cost;
            if through < costs[target as usize] {
                costs[target as usize] = through;
                parents[target as usize] = next.vertex();
                open.push(Open::new(through + weight * network.bound(target, goal), through, target));
            }
        });
    }
    let left = open.iter().filter_map(|next| hope(next, &costs)).reduce(f64::min);
    match left {
        _ if costs[goal as usize].is_finite() => {
            let path = path_to(goal, &parents);
            // Below the cost of the goal where a vertex on the path has become cheaper since.
            let cost = cost_along(network, &path);
            Outcome::Found(Found { path, cost, expansions }, left.map_or(1.0, |sum| (cost / sum).max(1.0)))
        }
        Some(_) => Outcome::Spent,
        None => Outcome::NoPath,
    }
}
