//! Room beside a path: whether a team of some width fits, and what it costs where it does not (the thesis, Algorithm 4, CanFit).
//!
//! On the line across the direction of travel the ground is walked to the left and to the right, step by step while each may be
//! taken, as far as the width; the gap is the distance between the last points reached. (The listing keeps the first point that
//! cannot be reached, and mixes cells and units.) Where the gap is narrower than the width the cost is multiplied by
//! `min(most, 1 + weight (width / gap - 1))`: "the smaller the gap, the higher the cost".

use crate::map::{Direction, Node, TravelMap};
use sastrugi_schemas::ParameterError;

#[cfg(test)]
mod tests;

/// Most steps to one side.
const STEPS_MAX: u16 = u16::MAX / 2;
/// Rounding of whole numbers of cells, as a share: three cells of 0.1 m are 0.3 m.
const ROUNDING: f64 = 1e-9;

/// Gaps across the four lines through each node.
#[derive(Clone, Debug)]
pub struct Clearance {
    width_m: f64,
    weight: f64,
    most: f64,
    /// Steps across a path along the directions 0 to 3 of [`AXES`], node by node.
    gaps: Vec<[u16; 4]>,
    /// Length of these steps, m.
    steps_m: [f64; 4],
    /// Shorter side of a cell, m.
    cell_m: f64,
}

/// A line of travel: east, north-east, north, north-west, and the same backwards.
const AXES: [Direction; 4] = [
    Direction { rows: 0, cols: 1 },
    Direction { rows: -1, cols: 1 },
    Direction { rows: -1, cols: 0 },
    Direction { rows: -1, cols: -1 },
];

impl Clearance {
    /// The room beside paths for a width in m.
    ///
    /// # Errors
    /// A width, weight or factor out of range.
    pub fn new(map: &TravelMap, width_m: f64, weight: f64, most: f64) -> Result<Self, ParameterError> {
        ParameterError::positive("width_m", width_m)?;
        ParameterError::not_negative("clearance_weight", weight)?;
        if !(most >= 1.0 && most.is_finite()) {
            return Err(ParameterError::new("clearance_max", format!("is {most}; it must be 1 or above")));
        }
        let lefts = AXES.map(|along| Direction { rows: -along.cols, cols: along.rows });
        let steps_m = lefts.map(|left| map.step_m(left));
        let mut gaps = vec![[0; 4]; map.len()];
        for (axis, left) in lefts.into_iter().enumerate() {
            let limit = libm::ceil(width_m / steps_m[axis] * (1.0 - ROUNDING));
            if limit > f64::from(STEPS_MAX) {
                let message = format!(
                    "is {width_m}, which is {limit} cells of {} m; it must be at most {STEPS_MAX} cells",
                    steps_m[axis]
                );
                return Err(ParameterError::new("width_m", message));
            }
            for side in [left, left.back()] {
                let runs = runs(map, side, limit as u16);
                gaps.iter_mut().zip(runs).for_each(|(gaps, run)| gaps[axis] += run);
            }
        }
        let [dx, dy] = map.cell_m();
        Ok(Self { width_m, weight, most, gaps, steps_m, cell_m: dx.min(dy) })
    }

    /// Gap across a path through a node, m.
    pub fn gap_m(&self, node: Node, along: Direction) -> f64 {
        let axis = AXES.iter().position(|axis| *axis == along || axis.back() == along).unwrap_or(0);
        f64::from(self.gaps[node as usize][axis]) * self.steps_m[axis]
    }

    /// Factor of the cost of a path through a node.
    pub fn multiplier(&self, node: Node, along: Direction) -> f64 {
        let gap_m = self.gap_m(node, along);
        if gap_m >= self.width_m * (1.0 - ROUNDING) {
            return 1.0;
        }
        (1.0 + self.weight * (self.width_m / gap_m.max(self.cell_m) - 1.0)).min(self.most)
    }
}

/// How many steps may be taken from each node in a direction, at most `limit`.
fn runs(map: &TravelMap, direction: Direction, limit: u16) -> Vec<u16> {
    let mut runs = vec![0u16; map.len()];
    let count = map.len() as Node;
    // A run is one longer than that of the next node, which is looked at before.
    let forward = (i32::from(direction.rows), i32::from(direction.cols)) > (0, 0);
    let mut visit = |node: Node| {
        if let Some(next) = map.accessible(node, direction) {
            runs[node as usize] = (runs[next as usize] + 1).min(limit);
        }
    };
    match forward {
        true => (0..count).rev().for_each(&mut visit),
        false => (0..count).for_each(&mut visit),
    }
    runs
}
