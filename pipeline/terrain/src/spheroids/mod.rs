//! Hills as upper halves of random spheroids.
//!
//! # What
//! Each of `n` spheroids has a centre node, drawn uniformly; a horizontal semi-axis r of 1 to `major_max_px` cells; and a vertical
//! semi-axis h of 1 to `min(minor_max_px, r)` cells, both uniform integers. At every node closer to the centre than r, at the
//! distance d,
//! $$ z \mathrel{+}= h \sqrt{1 - (d / r)^2} . $$
//! Heights add up where hills overlap. The rim of a hill is vertical in the formula, so hills end in rings of steep cells.
//!
//! # Source
//! Bayrak (2008), Algorithm 10. Lengths are in cells, as there; `cell_m` converts them to metres.
//!
//! # Readings
//! "Axis of length r" may mean the full axis: `full_axis = true` halves both. The number of spheroids and the longest axes of the
//! published maps are not given. The presets are ours, chosen so that the share of nodes marked by the thesis's vertex extraction
//! (without height-difference threshold) on 1000 x 1000 nodes lies in the published band: `docs/papers/bayrak.md`.
//!
//! # Cost
//! One square root per node and covering hill; one grid.

mod params;
#[cfg(test)]
mod tests;

pub use params::{Preset, RawSpheroids, Spheroids};

use crate::generator::{Generator, Input, Terrain, TerrainError};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Streams};
use serde_json::Value;

/// Name in the registry.
pub const KIND: &str = "spheroids";

/// Rough time per cell covered by a hill at its widest, s.
const SECONDS_PER_COVERED: f64 = 1e-9;

/// Rows per task.
const BAND_ROWS: usize = 32;

/// One hill; lengths in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hill {
    /// Column and row of the centre.
    centre: [f64; 2],
    radius: f64,
    height: f64,
}

impl Hill {
    /// Height at a node, `None` outside the hill.
    fn at(&self, col: usize, row: usize) -> Option<f64> {
        let [dx, dy] = [col as f64 - self.centre[0], row as f64 - self.centre[1]];
        let share = (dx * dx + dy * dy) / (self.radius * self.radius);
        (share < 1.0).then(|| self.height * (1.0 - share).sqrt())
    }

    /// Columns or rows, out of `count`, that the hill may reach.
    fn reach(&self, axis: usize, count: usize) -> std::ops::Range<usize> {
        let low = (self.centre[axis] - self.radius).max(0.0) as usize;
        let high = (self.centre[axis] + self.radius) as usize + 1;
        low..high.min(count)
    }
}

impl Spheroids {
    /// The hills in the order in which they are drawn.
    fn hills(&self, streams: &Streams) -> Vec<Hill> {
        let mut stream = streams.stream("spheroids");
        let half = if self.raw.full_axis { 0.5 } else { 1.0 };
        let [cols, rows] = self.size.px.map(u64::from);
        let hill = |_| {
            let centre = [stream.below(cols) as f64, stream.below(rows) as f64];
            let radius = 1 + stream.below(u64::from(self.major_max_px));
            let height = 1 + stream.below(radius.min(u64::from(self.minor_max_px)));
            Hill { centre, radius: half * radius as f64, height: half * height as f64 }
        };
        (0..self.spheroids).map(hill).collect()
    }

    /// Adds the hills to a band of rows starting at `first`; always in the same order, so that sums do not depend on the bands.
    fn fill(&self, hills: &[Hill], first: usize, band: &mut [f64]) {
        let cols = self.size.cols();
        let end = first + band.len() / cols;
        for hill in hills {
            let rows = hill.reach(1, end);
            for row in rows.start.max(first)..rows.end {
                for col in hill.reach(0, cols) {
                    if let Some(z) = hill.at(col, row) {
                        band[(row - first) * cols + col] += z * self.size.cell_m;
                    }
                }
            }
        }
    }
}

impl Generator for Spheroids {
    fn kind(&self) -> &'static str {
        KIND
    }

    fn geometry(&self) -> Geometry {
        self.size.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        8 * self.size.cells() + 32 * u64::from(self.spheroids)
    }

    fn seconds(&self) -> f64 {
        SECONDS_PER_COVERED * self.covered + 1e-8 * self.size.cells() as f64
    }

    fn notes(&self) -> Vec<String> {
        self.size.note().into_iter().collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let hills = self.hills(streams);
        let mut heights = Grid::filled(self.geometry(), 0.0);
        heights
            .values
            .par_chunks_mut(BAND_ROWS * self.size.cols())
            .enumerate()
            .for_each(|(k, band)| self.fill(&hills, k * BAND_ROWS, band));
        Ok(heights.into())
    }
}
