//! Clearance: whether a team of a given width fits through a gap, and the extra cost if it does not (the thesis, Algorithm 4, CanFit).
//!
//! From each node, steps are taken to the left and to the right across the direction of travel, while they are allowed and up to the width; the gap
//! is the distance between the last points reached. (The listing takes the first unreachable point instead, and mixes cells and units.) If the gap is
//! narrower than the width, the cost is multiplied by `min(most, 1 + weight (width / gap - 1))`: "the smaller the gap, the higher the cost".

use crate::map::{Direction, Node, TravelMap};
use sastrugi_schemas::ParameterError;

#[cfg(test)]
mod tests;

/// Largest number of steps to one side.
const STEPS_MAX: u16 = u16::MAX / 2;
/// Relative rounding of integer numbers of cells: three cells of 0.1 m are 0.3 m.
const ROUNDING: f64 = 1e-9;

/// Gaps across the four axes through each node.
#[derive(Clone, Debug)]
pub struct Clearance {
    width_m: f64,
    weight: f64,
    most: f64,
    /// Steps across a path along each of [`AXES`], per node.
    gaps: Vec<[u16; 4]>,
    /// Length of these steps, m.
    steps_m: [f64; 4],
    /// Shorter side of a cell, m.
    cell_m: f64,
}

/// Axes of travel: east, north-east, north, north-west; each includes the opposite direction.
const AXES: [Direction; 4] = [
    Direction { rows: 0, cols: 1 },
    Direction { rows: -1, cols: 1 },
    Direction { rows: -1, cols: 0 },
    Direction { rows: -1, cols: -1 },
];

impl Clearance {
    /// Clearance for a width in m.
    ///
    /// # Errors
    /// A width, weight or factor out of range.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::clearance::Clearance;
    /// use sastrugi_navigation::{Direction, SlopeLimits, TravelMap};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// // A corridor of three free rows: 2 m from the centre of the first to that of the last.
    /// let heights = Grid::filled(Geometry::square(5, 5, 1.0), 0.0);
    /// let mut map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
    /// for col in 0..5 {
    ///     map.block(map.node(0, col));
    ///     map.block(map.node(4, col));
    /// }
    /// let clearance = Clearance::new(&map, 4.0, 1.0, 10.0)?;
    /// let (middle, east) = (map.node(2, 2), Direction { rows: 0, cols: 1 });
    /// assert_eq!((clearance.gap_m(middle, east), clearance.multiplier(middle, east)), (2.0, 2.0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(map: &TravelMap, width_m: f64, weight: f64, most: f64) -> Result<Self, ParameterError> {
        ParameterError::positive("width_m", width_m)?;
        ParameterError::not_negative("clearance_weight", weight)?;
        if !(most >= 1.0 && most.is_finite()) {
            return Err(ParameterError::new("clearance_max", format!("is {most}; it must be finite and at least 1")));
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

    /// Cost factor of a path through a node.
    pub fn multiplier(&self, node: Node, along: Direction) -> f64 {
        let gap_m = self.gap_m(node, along);
        if gap_m >= self.width_m * (1.0 - ROUNDING) {
            return 1.0;
        }
        (1.0 + self.weight * (self.width_m / gap_m.max(self.cell_m) - 1.0)).min(self.most)
    }
}

/// Number of steps allowed from each node in a direction, at most `limit`.
fn runs(map: &TravelMap, direction: Direction, limit: u16) -> Vec<u16> {
    let mut runs = vec![0u16; map.len()];
    let count = map.len() as Node;
    // A run is one longer than that of the next node, which is visited first.
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
