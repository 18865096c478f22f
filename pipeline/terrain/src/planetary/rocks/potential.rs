//! Rock potential from a raster: the spatially varying share of the ground that rocks may cover.
//!
//! Bilinear between the centres of the raster's cells. Where the raster has no data, or beyond its outer centres, the `coverage` of the
//! process is used. Shares must lie in 0 to 0.6; others are refused, not clamped, because they suggest another unit (per cent) or
//! another quantity. A map in single precision may exceed 0.6 by rounding.
//!
//! The value depends on position alone, so that zooms, windows and tiles have the same rocks.

use super::COVERAGE_MAX;
use sastrugi_numeric::{Grid, Surface};
use std::sync::Arc;

/// How far shares may exceed their bounds by rounding to single precision.
const ROUNDING: f64 = 1e-6;

/// A raster of shares of the ground.
#[derive(Clone, Debug)]
pub struct Potential {
    raster: Arc<Grid>,
    /// Basic spacing of the lattice, m.
    spacing_m: f64,
    /// Position of lattice point 0 in the coordinates of the raster, m.
    offset_m: [f64; 2],
}

impl Potential {
    /// A raster for a lattice with points `spacing_m` apart whose point 0 lies at `offset_m` in the raster's coordinates.
    ///
    /// # Errors
    /// Why the raster cannot be used: fewer than 2 x 2 cells, no data at all, or shares out of range.
    pub fn new(raster: &Grid, spacing_m: f64, offset_m: [f64; 2]) -> Result<Self, String> {
        let g = &raster.geometry;
        if g.rows < 2 || g.cols < 2 {
            return Err(format!("has {} x {} cells; at least 2 x 2 are needed", g.rows, g.cols));
        }
        let possible = -ROUNDING..=COVERAGE_MAX + ROUNDING;
        if let Some(k) = raster.values.iter().position(|f| !f.is_nan() && !possible.contains(f)) {
            let (x, y, share) = (g.x(k % g.cols), g.y(k / g.cols), raster.values[k]);
            return Err(format!(
                "holds a share of {share} at x = {x}, y = {y} m; rocks may cover 0 to {COVERAGE_MAX} of the ground"
            ));
        }
        if raster.values.iter().all(|f| f.is_nan()) {
            return Err("has no cell with data".to_owned());
        }
        Ok(Self { raster: Arc::new(raster.map(|f| f.clamp(0.0, COVERAGE_MAX))), spacing_m, offset_m })
    }

    /// The share at a position (lattice units), `None` where the raster has no data.
    pub fn at(&self, point: [f64; 2]) -> Option<f64> {
        let [x, y] = [0, 1].map(|axis| point[axis] * self.spacing_m + self.offset_m[axis]);
        self.raster.height(x, y).map(|share| share.clamp(0.0, COVERAGE_MAX))
    }
}
