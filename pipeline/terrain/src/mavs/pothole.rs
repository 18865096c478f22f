//! Kind `pothole`: round holes in level ground.
//!
//! At the distance r from its centre, a hole of radius R and depth d has the height `d / 2 (cos(pi (r / R - 1)) - 1)`: -d in the
//! middle, and 0 with zero slope at R. Radii are drawn from 0.45 to 0.55 of the diameter, depths from 0.9 to 1.1 of the
//! depth; overlapping holes add up.

use super::frame::Frame;
use super::{DEFAULT_CELL_M, DEFAULT_SIZE_PX, POTHOLE};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use crate::size::{MIN_SIDE_PX, Size};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::PI;

/// Smallest and largest radius over the requested diameter (listing).
const RADIUS_SHARE: [f64; 2] = [0.45, 0.55];
/// Smallest and largest depth over the requested depth (listing).
const DEPTH_SHARE: [f64; 2] = [0.9, 1.1];
/// Maximum number of holes.
const HOLES_MAX: usize = 100_000;

/// Round holes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPothole {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 666 x 666 if no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// South-west corner in the world, m; whole multiples of the cell.
    pub origin_m: [f64; 2],
    /// Mean diameter, m.
    #[schemars(transform = limits::positive)]
    pub diameter_m: f64,
    /// Mean depth, m.
    #[schemars(transform = limits::positive)]
    pub depth_m: f64,
    /// Centres of the holes in the world, m; alternative to `holes`.
    #[schemars(length(max = HOLES_MAX))]
    pub places_m: Vec<[f64; 2]>,
    /// Number of holes, at positions drawn uniformly over the surface.
    #[schemars(range(max = HOLES_MAX))]
    pub holes: u32,
}

impl Default for RawPothole {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            origin_m: [0.0; 2],
            diameter_m: 1.0,
            depth_m: 0.1,
            places_m: Vec::new(),
            holes: 1,
        }
    }
}

/// Checked parameters of round holes.
#[derive(Clone, Debug)]
pub struct Pothole {
    raw: RawPothole,
    frame: Frame,
}

impl TryFrom<RawPothole> for Pothole {
    type Error = ParameterError;

    fn try_from(raw: RawPothole) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let frame = Frame::check(size, raw.origin_m)?;
        ParameterError::positive("depth_m", raw.depth_m)?;
        ParameterError::positive("diameter_m", raw.diameter_m)?;
        if raw.diameter_m < 3.0 * raw.cell_m {
            let message = format!("is {} m; it must be at least three {} m cells", raw.diameter_m, raw.cell_m);
            return Err(ParameterError::new("diameter_m", message));
        }
        if raw.places_m.is_empty() && raw.holes == 0 {
            return Err(ParameterError::new("holes", "is 0; the surface would be flat"));
        }
        if raw.places_m.len().max(raw.holes as usize) > HOLES_MAX {
            return Err(ParameterError::new("holes", format!("gives more than {HOLES_MAX} holes")));
        }
        let geometry = frame.geometry();
        match raw.places_m.iter().find(|[x, y]| geometry.cell_at(*x, *y).is_none()) {
            Some([x, y]) => {
                Err(ParameterError::new("places_m", format!("contains [{x}, {y}], which is not on the surface")))
            }
            None => {
                let raw = RawPothole { size_m: None, size_px: Some(size.px), ..raw };
                Ok(Self { raw, frame })
            }
        }
    }
}

/// One hole.
struct Hole {
    centre_m: [f64; 2],
    radius_m: f64,
    depth_m: f64,
}

impl Hole {
    /// Height at a point, m.
    fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let [dx, dy] = [x_m - self.centre_m[0], y_m - self.centre_m[1]];
        let share = (dx * dx + dy * dy).sqrt() / self.radius_m;
        if share < 1.0 { 0.5 * self.depth_m * (libm::cos(PI * (share - 1.0)) - 1.0) } else { 0.0 }
    }
}

impl Pothole {
    fn holes(&self, streams: &Streams) -> Vec<Hole> {
        let (p, mut stream) = (&self.raw, streams.stream("holes"));
        let [[west, south], [length, width]] = [self.frame.origin_m(), self.frame.geometry().size()];
        let count = if p.places_m.is_empty() { p.holes as usize } else { p.places_m.len() };
        let hole = |k: usize| {
            let radius_m = p.diameter_m * stream.uniform_in(RADIUS_SHARE[0], RADIUS_SHARE[1]);
            let depth_m = p.depth_m * stream.uniform_in(DEPTH_SHARE[0], DEPTH_SHARE[1]);
            let drawn = [stream.uniform_in(west, west + length), stream.uniform_in(south, south + width)];
            Hole { centre_m: p.places_m.get(k).copied().unwrap_or(drawn), radius_m, depth_m }
        };
        (0..count).map(hole).collect()
    }
}

impl Generator for Pothole {
    fn kind(&self) -> &'static str {
        POTHOLE
    }

    fn geometry(&self) -> Geometry {
        self.frame.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        8 * self.frame.size.cells()
    }

    fn notes(&self) -> Vec<String> {
        self.frame.size.note().into_iter().collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let (geometry, holes) = (self.frame.geometry(), self.holes(streams));
        let columns: Vec<f64> = (0..geometry.cols).map(|col| self.frame.x_m(col)).collect();
        let mut values = vec![0.0; geometry.len()];
        values.par_chunks_mut(geometry.cols).enumerate().for_each(|(row, out)| {
            let y = self.frame.y_m(row);
            for hole in holes.iter().filter(|h| (y - h.centre_m[1]).abs() < h.radius_m) {
                let reach = |x: &f64| *x <= hole.centre_m[0] - hole.radius_m;
                let first = columns.partition_point(reach);
                let last = columns.partition_point(|x| *x < hole.centre_m[0] + hole.radius_m);
                for (z, x) in out[first..last].iter_mut().zip(&columns[first..last]) {
                    *z += hole.height_m(*x, y);
                }
            }
        });
        Ok(Terrain::from(Grid { geometry, values }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::sums;
    use serde_json::json;

    fn pothole(params: Value) -> Pothole {
        Pothole::try_from(crate::registry::read::<RawPothole>(&params).unwrap()).unwrap()
    }

    /// `-d / 2 (1 + cos(pi r / R))`, by hand at shares of the radius.
    #[test]
    fn val_a_hole_is_a_cosine() {
        let hole = Hole { centre_m: [3.0, -1.0], radius_m: 2.0, depth_m: 0.4 };
        for ([dx, dy], wanted) in [
            ([0.0, 0.0], -0.4),
            ([0.5, 0.0], -0.341_421_356_237_309_5),
            ([-1.0, 0.0], -0.2),
            ([0.6, 0.8], -0.2),
            ([0.0, 1.5], -0.058_578_643_762_690_5),
            ([2.0, 0.0], 0.0),
            ([0.0, -3.0], 0.0),
        ] {
            assert!((hole.height_m(3.0 + dx, -1.0 + dy) - wanted).abs() < 1e-12, "{dx} {dy}");
        }
    }

    /// Rows and columns out of reach of a hole are skipped; the result is the sum over all holes in every cell.
    #[test]
    fn val_heights_are_the_sum_over_all_holes() {
        let params = json!({
            "size_px": [50, 37], "cell_m": 0.2, "origin_m": [-4.0, 6.0], "diameter_m": 1.3, "holes": 30
        });
        let (all, streams) = (pothole(params), Streams::for_seed(2, "terrain"));
        let (heights, holes) = (all.generate(&streams, &[]).unwrap().heights, all.holes(&streams));
        assert_eq!(holes.len(), 30);
        for (k, z) in heights.values.iter().enumerate() {
            let (x_m, y_m) = (heights.geometry.x(k % 50), heights.geometry.y(k / 50));
            let sum = holes.iter().map(|hole| hole.height_m(x_m, y_m)).sum::<f64>();
            assert!((z - sum).abs() < 1e-12, "{k}: {z} {sum}");
        }
        assert!(heights.range().unwrap().0 < -0.07);
    }

    /// Null: radii, depths and centres are uniform over their ranges. Means of 2000 draws, threshold at 6 standard errors (2e-9 each); detects
    /// a range that is off by a tenth of its width.
    #[test]
    fn stat_holes_are_uniform() {
        let params = json!({"size_px": [100, 50], "cell_m": 1.0, "diameter_m": 10.0, "depth_m": 0.2, "holes": 2000});
        let holes = pothole(params).holes(&Streams::for_seed(5, "terrain"));
        let check = |of: fn(&Hole) -> f64, low: f64, high: f64| {
            let values: Vec<f64> = holes.iter().map(of).collect();
            assert!(values.iter().all(|v| (low..high).contains(v)), "{low} to {high}");
            let error = (high - low) / (12.0 * values.len() as f64).sqrt();
            assert!((sums::mean(&values) - 0.5 * (low + high)).abs() < 6.0 * error, "{low} to {high}");
        };
        check(|hole| hole.radius_m, 4.5 - 1e-12, 5.5 + 1e-12);
        check(|hole| hole.depth_m, 0.18 - 1e-12, 0.22 + 1e-12);
        check(|hole| hole.centre_m[0], 0.0, 100.0);
        check(|hole| hole.centre_m[1], 0.0, 50.0);
    }
}
