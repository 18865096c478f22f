//! Multifractal terrain after Majhor and Bos.
//!
//! # What
//! Three Weierstrass-Mandelbrot layers (low, mid and high frequency). Each is 1. low-pass filtered by a Gaussian, 2. reduced
//! by its mean, 3. scaled to a largest absolute value of 1. Their cell-by-cell product (4) is scaled to 16-bit levels (5)
//! and converted to heights (6): `(level - 32768) z_scale / 128` cm.
//!
//! # Source
//! Majhor and Bos, section 2.1, Table 1, and section 2.2 for the vertical scale.
//!
//! # Readings
//! The paper does not specify the filter widths, what "near the same range" means, the phase interval or the sampling
//! interval; the defaults are our reading, justified in `docs/papers/majhor.md`. Any positive scaling of the layers gives the
//! same product up to a factor that step 5 removes, so neither the range chosen in step 3 nor `G` matters.
//!
//! The product is an amplitude-modulated surface; whether it is multifractal in the strict sense depends on its
//! scaling exponents (`sastrugi_roughness::multifractality`).
//!
//! # Cost
//! Three non-uniform transforms and three Gaussian filters; see `benches/benches/multifractal.rs`.

mod params;
#[cfg(test)]
mod tests;

pub use params::{Multifractal, RawLayer, RawMultifractal, Scaling};

use crate::generator::{Generator, Input, Levels, Terrain, TerrainError};
use params::Layer;
use sastrugi_numeric::filters::gaussian_low_pass;
use sastrugi_numeric::{Geometry, Grid, Streams, ops};
use serde_json::Value;

/// Name in the registry.
pub const KIND: &str = "multifractal";
/// Rough time per cell, s.
const SECONDS_PER_CELL: f64 = 3.3e-7;

/// Level of height 0.
const ZERO_LEVEL: u16 = 32768;
/// Levels above height 0.
const LEVELS_ABOVE_ZERO: f64 = 32767.0;

impl Layer {
    /// The filtered layer, with mean removed and largest absolute value 1.
    fn generate(&self, streams: &Streams) -> Result<Grid, TerrainError> {
        let surface = self.surface.surface(&streams.child(self.name))?;
        let level = ops::without_mean(&gaussian_low_pass(&surface, self.sigma_px));
        unit_range(level, self.name)
    }
}

/// The grid divided by its largest absolute value.
fn unit_range(grid: Grid, part: &'static str) -> Result<Grid, TerrainError> {
    let largest = ops::max_abs(&grid);
    if largest > 0.0 { Ok(grid.map(|v| v / largest)) } else { Err(TerrainError::Flat { part }) }
}

impl Multifractal {
    fn metres_per_level(&self) -> f64 {
        self.raw.z_scale_percent / 12_800.0
    }

    /// The product of the layers, largest absolute value 1.
    fn product(&self, streams: &Streams) -> Result<Grid, TerrainError> {
        let [low, mid, high] = &self.layers;
        let product = ops::multiply(&low.generate(streams)?, &mid.generate(streams)?);
        unit_range(ops::multiply(&product, &high.generate(streams)?), "the product of the layers")
    }

    /// The surface, m.
    fn surface(&self, streams: &Streams) -> Result<Grid, TerrainError> {
        let metres_per_level = self.metres_per_level();
        Ok(self.scaled(&self.product(streams)?).map(|level| level.round() * metres_per_level))
    }

    /// The product in levels above [`ZERO_LEVEL`], not yet rounded.
    fn scaled(&self, product: &Grid) -> Grid {
        match (self.raw.scaling, product.range()) {
            (Scaling::MinMax, Some((low, high))) => product.map(|p| LEVELS_ABOVE_ZERO * (p - low) / (high - low)),
            _ => product.map(|p| LEVELS_ABOVE_ZERO * p),
        }
    }
}

impl Generator for Multifractal {
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
        // The product so far, plus the layer being computed; a filter needs two more grids.
        let layer = self.layers.iter().map(|l| l.surface.memory_bytes()).max().unwrap_or(0);
        layer.max(3 * 8 * self.size.cells()) + 8 * self.size.cells()
    }

    fn seconds(&self) -> f64 {
        SECONDS_PER_CELL * self.size.cells() as f64
    }

    fn notes(&self) -> Vec<String> {
        self.layers[2].surface.notes()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        self.surface(streams).map(Terrain::from)
    }

    fn levels(&self, heights: &Grid) -> Option<Levels> {
        let metres_per_level = self.metres_per_level();
        let level = |z: f64| ((z / metres_per_level).round() + f64::from(ZERO_LEVEL)) as u16;
        Some(Levels { grid: heights.map(level), metres_per_level, zero_level: ZERO_LEVEL })
    }
}
