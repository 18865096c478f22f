//! Kind `pothole`: round holes in level ground.
//!
//! At the distance r from its centre a hole of radius R and depth d has the height `d / 2 (cos(pi (r / R - 1)) - 1)`: -d in the
//! middle, and 0 with a level edge at R. Radii are drawn from 0.45 to 0.55 of the diameter, depths from 0.9 to 1.1 of the
//! depth; where holes meet they add up.

use super::frame::Frame;
use super::{DEFAULT_CELL_M, DEFAULT_SIZE_PX, POTHOLE};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use crate::size::Size;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::PI;

/// Radius over the diameter that is asked for, least and largest (listing).
const RADIUS_SHARE: [f64; 2] = [0.45, 0.55];
/// Depth over the depth that is asked for, least and largest (listing).
const DEPTH_SHARE: [f64; 2] = [0.9, 1.1];
/// Most holes.
const HOLES_MAX: usize = 100_000;

/// Round holes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPothole {
    /// Size east and north, m; in place of `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 2]>,
    /// Cells east and north; 666 x 666 when no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m.
    pub cell_m: f64,
    /// South-west corner in the world, m, whole cells.
    pub origin_m: [f64; 2],
    /// Mean diameter, m.
    pub diameter_m: f64,
    /// Mean depth, m.
    pub depth_m: f64,
    /// Centres in the world, m, in place of `holes`.
    pub places_m: Vec<[f64; 2]>,
    /// Holes at places drawn evenly over the surface.
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
            let message = format!("is {} m; it must be at least three cells of {} m", raw.diameter_m, raw.cell_m);
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
                Err(ParameterError::new("places_m", format!("has [{x}, {y}], which is not on the surface")))
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
    /// Height at a place, m.
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
