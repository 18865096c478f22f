//! D* Lite (Koenig and Likhachev, 2002): after an edit of the ground, only what the edit affects is searched again.
//!
//! The search runs from the goal back to the start. The look-ahead value of a vertex is always the minimum over its edges, recomputed and never
//! patched by comparing `cost + old value`: floating-point comparisons of that kind are known to loop between two vertices or to miss a path. Values
//! therefore have the same bits as those of a fresh search. So has the path, which follows from the values by one rule: the edge with the smallest
//! sum, then with the smallest target. Bounds are shortened by slightly more than rounding, so that every vertex on a cheapest path comes before the
//! start.

use super::{Found, Reversible};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Share by which bounds are shortened; the rounding of sums along a path is far smaller.
const SHORTENED: f64 = 1e-7;

/// Bits of value plus bound, and of the value itself.
type Key = [u64; 2];

/// Key of a vertex that is not in the queue.
const OUTSIDE: Key = [u64::MAX; 2];

/// State of a search that follows edits of a network. The network is passed to every call, because it changes between calls.
#[derive(Clone, Debug)]
pub struct DStarLite {
    start: u32,
    goal: u32,
    /// Sum of the bounds between successive starts, by which keys have grown.
    grown: f64,
    /// Known cost to the goal.
    values: Vec<f64>,
    /// The same, computed one edge ahead.
    ahead: Vec<f64>,
    keys: Vec<Key>,
    queue: BinaryHeap<Reverse<(Key, u32)>>,
    expansions: u64,
}

impl DStarLite {
    /// A search from `start` to `goal`, with nothing expanded yet.
    pub fn new(network: &impl Reversible, start: u32, goal: u32) -> Self {
        let unknown = || vec![f64::INFINITY; network.len()];
        let mut search = Self {
            start,
            goal,
            grown: 0.0,
            values: unknown(),
            ahead: unknown(),
            keys: vec![OUTSIDE; network.len()],
            queue: BinaryHeap::new(),
            expansions: 0,
        };
        search.ahead[goal as usize] = 0.0;
        search.place(network, goal);
        search
    }

    /// Vertices expanded so far.
    pub fn expansions(&self) -> u64 {
        self.expansions
    }

    /// Known cost from a vertex to the goal; final for vertices on the path found.
    pub fn value(&self, vertex: u32) -> f64 {
        self.values[vertex as usize]
    }

    /// Moves the start.
    pub fn move_to(&mut self, network: &impl Reversible, start: u32) {
        self.grown += network.bound(self.start, start) * (1.0 - SHORTENED);
        self.start = start;
    }

    /// Registers vertices whose outgoing edges have changed; on a map these are all nodes around each edited one ([`crate::map::TravelMap::around`]).
    pub fn changed(&mut self, network: &impl Reversible, vertices: impl IntoIterator<Item = u32>) {
        vertices.into_iter().for_each(|vertex| self.look_ahead(network, vertex));
    }

    /// Searches as far as necessary; returns the cheapest path, or `None` if there is none. Expansions are those of this call.
    pub fn search(&mut self, network: &impl Reversible) -> Option<Found> {
        let before = self.expansions;
        while let Some((key, vertex)) = self.first() {
            let start = self.start as usize;
            if key >= self.key(network, self.start) && self.ahead[start] == self.values[start] {
                break;
            }
            self.expand(network, vertex, key);
        }
        let cost = self.values[self.start as usize];
        let path = cost.is_finite().then(|| self.path(network))?;
        Some(Found { path, cost, expansions: self.expansions - before })
    }

    fn expand(&mut self, network: &impl Reversible, vertex: u32, key: Key) {
        let v = vertex as usize;
        if key < self.key(network, vertex) {
            return self.place(network, vertex);
        }
        self.expansions += 1;
        let falls = self.values[v] > self.ahead[v];
        self.values[v] = if falls { self.ahead[v] } else { f64::INFINITY };
        self.place(network, vertex);
        if !falls {
            self.look_ahead(network, vertex);
        }
        let value = self.values[v];
        network.edges_into(vertex, |source, cost| match falls {
            true if source != self.goal && cost + value < self.ahead[source as usize] => {
                self.ahead[source as usize] = cost + value;
                self.place(network, source);
            }
            true => {}
            false => self.look_ahead(network, source),
        });
    }

    /// Recomputes the minimum over the edges of a vertex.
    fn look_ahead(&mut self, network: &impl Reversible, vertex: u32) {
        if vertex != self.goal {
            let mut least = f64::INFINITY;
            network.edges(vertex, |target, cost| least = least.min(cost + self.values[target as usize]));
            self.ahead[vertex as usize] = least;
        }
        self.place(network, vertex);
    }

    fn key(&self, network: &impl Reversible, vertex: u32) -> Key {
        let value = self.values[vertex as usize].min(self.ahead[vertex as usize]);
        let bound = network.bound(self.start, vertex) * (1.0 - SHORTENED);
        [value + bound + self.grown, value].map(f64::to_bits)
    }

    /// Inserts or updates a vertex in the queue, or removes it if both values agree.
    fn place(&mut self, network: &impl Reversible, vertex: u32) {
        let v = vertex as usize;
        let key = if self.values[v] == self.ahead[v] { OUTSIDE } else { self.key(network, vertex) };
        if key != self.keys[v] && key != OUTSIDE {
            self.queue.push(Reverse((key, vertex)));
        }
        self.keys[v] = key;
    }

    /// First of the queue, after dropping outdated entries.
    fn first(&mut self) -> Option<(Key, u32)> {
        while let Some(&Reverse((key, vertex))) = self.queue.peek() {
            if self.keys[vertex as usize] == key {
                return Some((key, vertex));
            }
            self.queue.pop();
        }
        None
    }

    fn path(&self, network: &impl Reversible) -> Vec<u32> {
        let mut path = vec![self.start];
        let mut at = self.start;
        while at != self.goal {
            let mut next = (f64::INFINITY, u32::MAX);
            network.edges(at, |target, cost| {
                let sum = cost + self.values[target as usize];
                if sum < next.0 || sum == next.0 && target < next.1 {
                    next = (sum, target);
                }
            });
            at = next.1;
            path.push(at);
        }
        path
    }
}
