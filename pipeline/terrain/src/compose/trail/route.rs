//! The path of least cost over a lattice (Dijkstra, 1959).

use super::{Ground, TerrainError};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Maximum number of lattice steps along a side.
const STEPS_MAX: f64 = 2000.0;

/// Nodes of a lattice, west to east in rows from south to north.
pub(super) struct Lattice {
    pub(super) cols: usize,
    pub(super) rows: usize,
    /// Distance between neighbours east and north, m.
    pub(super) step_m: [f64; 2],
    /// Cost per metre at every node, 0 or above.
    pub(super) costs: Vec<f64>,
}

/// The path from the south-western to the north-eastern corner, points in m.
///
/// # Errors
/// [`TerrainError::Trail`] if the ground has no height somewhere.
pub(super) fn least_cost(
    ground: &Ground<'_>,
    [from_m, to_m]: [[f64; 2]; 2],
    favours_high: bool,
    attraction: f64,
) -> Result<Vec<[f64; 2]>, TerrainError> {
    let span_m = [0, 1].map(|axis| to_m[axis] - from_m[axis]);
    let spacing_m = ground.size_m.max(span_m[0].max(span_m[1]) / STEPS_MAX);
    let steps = span_m.map(|span| (span / spacing_m).ceil().max(1.0));
    let step_m = [0, 1].map(|axis| span_m[axis] / steps[axis]);
    let [cols, rows] = steps.map(|count| count as usize + 1);
    let point = |node: usize| {
        let at = [node % cols, node / cols];
        [0, 1].map(|axis| from_m[axis] + at[axis] as f64 * step_m[axis])
    };
    let heights = (0..cols * rows).map(|node| ground.height(point(node))).collect::<Result<Vec<_>, _>>()?;
    let lattice = Lattice { cols, rows, step_m, costs: costs(&heights, favours_high, attraction) };
    Ok(lattice.path().into_iter().map(point).collect())
}

/// Cost per metre by height: 1 on the most favoured ground, `1 + attraction` at the other end of the range.
fn costs(heights: &[f64], favours_high: bool, attraction: f64) -> Vec<f64> {
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(*z), h.max(*z)));
    let cost = |z: &f64| {
        let t = if favours_high { high - z } else { z - low } / (high - low);
        // Level ground has no preference.
        if t.is_finite() { 1.0 + attraction * t * t } else { 1.0 }
    };
    heights.iter().map(cost).collect()
}

/// A node and the cost of reaching it.
struct Reached {
    cost: f64,
    node: usize,
}

impl Ord for Reached {
    /// The cheapest leaves a heap first, ties by the lowest node.
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Reached {}

impl Lattice {
    /// Nodes of the cheapest path from the first to the last.
    pub(super) fn path(&self) -> Vec<usize> {
        let last = self.costs.len() - 1;
        let mut best = vec![f64::INFINITY; self.costs.len()];
        let mut before = vec![usize::MAX; self.costs.len()];
        let mut heap = BinaryHeap::from([Reached { cost: 0.0, node: 0 }]);
        best[0] = 0.0;
        while let Some(Reached { cost, node }) = heap.pop() {
            if node == last {
                break;
            }
            if cost > best[node] {
                continue;
            }
            for (next, length_m) in self.neighbours(node) {
                let cost = cost + 0.5 * length_m * (self.costs[node] + self.costs[next]);
                if cost < best[next] {
                    (best[next], before[next]) = (cost, node);
                    heap.push(Reached { cost, node: next });
                }
            }
        }
        let back = |node: &usize| (before[*node] != usize::MAX).then_some(before[*node]);
        let mut path: Vec<usize> = std::iter::successors(Some(last), back).collect();
        path.reverse();
        path
    }

    /// The eight neighbours of a node (fewer at the border) and their distances, m.
    pub(super) fn neighbours(&self, node: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (i, j) = (node % self.cols, node / self.cols);
        let [dx, dy] = self.step_m;
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        near(j, self.rows).flat_map(move |row| near(i, self.cols).map(move |col| (row, col))).filter_map(
            move |(row, col)| {
                let (x, y) = (row.abs_diff(j) as f64 * dy, col.abs_diff(i) as f64 * dx);
                let next = row * self.cols + col;
                (next != node).then(|| (next, (x * x + y * y).sqrt()))
            },
        )
    }
}
