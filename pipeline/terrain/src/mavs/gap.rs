//! Kind `gap`: a trench across level ground, the obstacle of gap-crossing trials.
//!
//! The profile along x, from the western edge, is the same for every y: down a wall of width `x1 = depth tan(theta)`, where theta is
//! the wall's angle from the vertical, across the floor of width `width`, and up a wall of width x1. `hi_mag_m P` adds roughness
//! everywhere (the listing has no factor 4 here, so the RMS is 0.249 `hi_mag_m`).

use super::frame::Frame;
use super::perlin::{self, Layer};
use super::{DEFAULT_CELL_M, DEFAULT_HI_LEN_M, DEFAULT_SIZE_PX, GAP};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::PI;

/// A trench.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawGap {
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
    /// Depth, m.
    #[schemars(transform = limits::positive)]
    pub depth_m: f64,
    /// Width of the floor, m.
    #[schemars(transform = limits::positive)]
    pub width_m: f64,
    /// Angle of the walls from the vertical, degrees, from 0 to below 90.
    #[schemars(transform = limits::half_open(0.0, 90.0))]
    pub wall_angle_deg: f64,
    /// Easting of the western edge in the world, m; by default the trench is centred.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edge_m: Option<f64>,
    /// Peak height of the roughness, m.
    #[schemars(transform = limits::not_negative)]
    pub hi_mag_m: f64,
    /// Length scale of the roughness, m (listing); its noise lattice is 3.93 times as long.
    #[schemars(transform = limits::positive)]
    pub hi_len_m: f64,
}

impl Default for RawGap {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            origin_m: [0.0; 2],
            depth_m: 0.3,
            width_m: 0.6,
            wall_angle_deg: 30.0,
            edge_m: None,
            hi_mag_m: 0.0,
            hi_len_m: DEFAULT_HI_LEN_M,
        }
    }
}

/// Checked parameters of a trench.
#[derive(Clone, Debug)]
pub struct Gap {
    raw: RawGap,
    frame: Frame,
    /// Width of a wall, m.
    wall_m: f64,
    edge_m: f64,
}

impl TryFrom<RawGap> for Gap {
    type Error = ParameterError;

    fn try_from(raw: RawGap) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let frame = Frame::check(size, raw.origin_m)?;
        ParameterError::positive("depth_m", raw.depth_m)?;
        ParameterError::positive("width_m", raw.width_m)?;
        ParameterError::not_negative("hi_mag_m", raw.hi_mag_m)?;
        ParameterError::positive("hi_len_m", raw.hi_len_m)?;
        frame.resolves("hi_len_m", 1.25 * PI * raw.hi_len_m)?;
        if !(0.0..90.0).contains(&raw.wall_angle_deg) {
            let message = format!("is {}; it must be at least 0 and below 90", raw.wall_angle_deg);
            return Err(ParameterError::new("wall_angle_deg", message));
        }
        if raw.width_m < raw.cell_m {
            let message = format!("is {} m; it must be at least one cell, {} m", raw.width_m, raw.cell_m);
            return Err(ParameterError::new("width_m", message));
        }
        let wall_m = raw.depth_m * libm::tan(raw.wall_angle_deg.to_radians());
        let (whole, [length, _]) = (raw.width_m + 2.0 * wall_m, frame.geometry().size());
        let west = frame.origin_m()[0];
        let edge_m = raw.edge_m.unwrap_or(west + 0.5 * (length - whole));
        if !(edge_m < west + length && edge_m + whole > west && whole.is_finite()) {
            let message = format!("is {edge_m} m; a trench {whole} m wide from there misses the surface");
            return Err(ParameterError::new("edge_m", message));
        }
        if raw.edge_m.is_none() && whole > length {
            let message =
                format!("gives a trench {whole} m wide, walls included; the surface is only {length} m long in x");
            return Err(ParameterError::new("width_m", message));
        }
        let raw = RawGap { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, frame, wall_m, edge_m })
    }
}

impl Gap {
    /// Depth below level ground at an easting, as a height, m.
    fn height_m(&self, x_m: f64) -> f64 {
        let p = &self.raw;
        let east = self.edge_m + 2.0 * self.wall_m + p.width_m;
        let inside = (x_m - self.edge_m).min(east - x_m);
        if inside <= 0.0 {
            0.0
        } else if inside >= self.wall_m {
            -p.depth_m
        } else {
            -p.depth_m * inside / self.wall_m
        }
    }
}

impl Generator for Gap {
    fn kind(&self) -> &'static str {
        GAP
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
        let rough = Layer::draw(streams, "high", 1.25 * PI * self.raw.hi_len_m, self.raw.hi_mag_m);
        let mut heights = perlin::sum(&[rough], &self.frame);
        let profile: Vec<f64> = (0..self.frame.cols()).map(|col| self.height_m(self.frame.x_m(col))).collect();
        for row in heights.values.chunks_exact_mut(profile.len()) {
            row.iter_mut().zip(&profile).for_each(|(z, gap)| *z += gap);
        }
        Ok(Terrain::from(heights))
    }
}
