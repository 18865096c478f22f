//! Anytime repairing A* (ARA*; Likhachev, Gordon and Thrun, 2003).
//!
//! Vertices are ordered by cost so far plus `weight` times the bound, so that a path is found early. Then the excess of the weight over 1 is halved
//! repeatedly, and only vertices that could improve the path found are searched again, until the budget of expansions is spent or no path can be
//! cheaper. A vertex is expanded once per weight; if it becomes cheaper after that, it is deferred to the next weight, because under a large weight
//! the same vertices could otherwise be expanded endlessly. The cost divided by the smallest sum of cost so far and plain bound among the remaining
//! vertices is a proven bound on cost over optimum. Budgets count expansions, never time, so the same call finds the same path.

use super::{Found, NONE, Network, Open, Queue, cost_along, path_to};

/// Excess of the weight over 1 below which the weight becomes 1.
const EXCESS_MIN: f64 = 0.01;

/// Result of the search.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The best path found, and a proven bound on its cost over the optimum, at least 1.
    Found(Found, f64),
    /// There is no path.
    NoPath,
    /// The budget was spent before a path was found.
    Spent,
}

/// Finds the best path within `budget` expansions, with a first weight of at least 1.
pub fn search(network: &impl Network, start: u32, goal: u32, weight: f64, budget: u64) -> Outcome {
    let mut search = Search::new(network, start, goal);
    let mut weight = weight;
    while search.spend(weight, budget) && search.least_left().is_some() {
        weight = if weight - 1.0 > 2.0 * EXCESS_MIN { 0.5 * (1.0 + weight) } else { 1.0 };
        search.begin_round(weight);
    }
    search.outcome()
}

struct Search<'a, N> {
    network: &'a N,
    goal: u32,
    costs: Vec<f64>,
    parents: Vec<u32>,
    /// Round in which each vertex was last expanded.
    rounds: Vec<u32>,
    round: u32,
    open: Queue,
    /// Vertices that became cheaper after their expansion in this round.
    deferred: Vec<u32>,
    expansions: u64,
}

impl<'a, N: Network> Search<'a, N> {
    fn new(network: &'a N, start: u32, goal: u32) -> Self {
        let mut search = Self {
            network,
            goal,
            costs: vec![f64::INFINITY; network.len()],
            parents: vec![NONE; network.len()],
            rounds: vec![0; network.len()],
            round: 1,
            open: Queue::default(),
            deferred: Vec::new(),
            expansions: 0,
        };
        search.costs[start as usize] = 0.0;
        search.open.push(Open::new(0.0, 0.0, start));
        search
    }

    /// Expands until no remaining vertex promises a path within `weight` of the one found; false if the budget is spent first.
    fn spend(&mut self, weight: f64, budget: u64) -> bool {
        while let Some(next) = self.open.pop() {
            if next.sum() >= self.costs[self.goal as usize] {
                self.open.push(next);
                return true;
            }
            let is_old = next.so_far() > self.costs[next.vertex() as usize];
            if is_old || self.rounds[next.vertex() as usize] == self.round {
                continue;
            }
            if self.expansions == budget {
                self.open.push(next);
                return false;
            }
            self.expand(&next, weight);
        }
        true
    }

    fn expand(&mut self, next: &Open, weight: f64) {
        self.expansions += 1;
        self.rounds[next.vertex() as usize] = self.round;
        self.network.edges(next.vertex(), |target, cost| {
            let through = next.so_far() + cost;
            if through >= self.costs[target as usize] {
                return;
            }
            self.costs[target as usize] = through;
            self.parents[target as usize] = next.vertex();
            match self.rounds[target as usize] == self.round {
                true => self.deferred.push(target),
                false => {
                    self.open.push(Open::new(
                        through + weight * self.network.bound(target, self.goal),
                        through,
                        target,
                    ));
                }
            }
        });
    }

    /// Cost so far plus plain bound of a vertex, if it may lead to a cheaper path than the one found.
    fn promise(&self, vertex: u32) -> Option<f64> {
        let sum = self.costs[vertex as usize] + self.network.bound(vertex, self.goal);
        Some(sum).filter(|sum| *sum < self.costs[self.goal as usize])
    }

    /// Remaining vertices that may lead to a cheaper path.
    fn left(&self) -> impl Iterator<Item = u32> {
        let is_new = |open: &&Open| open.so_far() <= self.costs[open.vertex() as usize];
        let open = self.open.iter().filter(is_new).map(Open::vertex);
        let open = open.filter(|vertex| self.rounds[*vertex as usize] != self.round);
        open.chain(self.deferred.iter().copied()).filter(|vertex| self.promise(*vertex).is_some())
    }

    fn least_left(&self) -> Option<f64> {
        self.left().filter_map(|vertex| self.promise(vertex)).reduce(f64::min)
    }

    /// Reorders the remaining vertices by another weight.
    fn begin_round(&mut self, weight: f64) {
        let left: Vec<u32> = self.left().collect();
        self.open = Queue::default();
        for vertex in left {
            let so_far = self.costs[vertex as usize];
            self.open.push(Open::new(so_far + weight * self.network.bound(vertex, self.goal), so_far, vertex));
        }
        self.deferred.clear();
        self.round += 1;
    }

    fn outcome(&self) -> Outcome {
        let left = self.least_left();
        if self.costs[self.goal as usize].is_infinite() {
            return left.map_or(Outcome::NoPath, |_| Outcome::Spent);
        }
        let path = path_to(self.goal, &self.parents);
        // Less than the recorded cost of the goal if a vertex on the path has become cheaper since.
        let cost = cost_along(self.network, &path);
        let ratio = left.map_or(1.0, |sum| (cost / sum).max(1.0));
        Outcome::Found(Found { path, cost, expansions: self.expansions }, ratio)
    }
}
