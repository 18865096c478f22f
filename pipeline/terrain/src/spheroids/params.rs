//! Parameters of the spheroids.

use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Shape of the medium-sized published maps (Bayrak, 2008, section 5.1).
const DEFAULT_SIZE_PX: [u32; 2] = [1000, 1000];
/// Maximum number of hills.
const SPHEROIDS_MAX: u32 = 1_000_000;
/// Maximum number of cells covered by all hills together, each at its widest: a few minutes on one core.
const COVERED_MAX: f64 = 1e11;
/// Longest semi-axis, cells.
const AXIS_MAX_PX: u32 = 1_000_000;

/// Hilliness of the three published types of map. Numbers of hills are per million nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// 34 low hills: vertex share 0.07 to 0.15 %.
    Plain,
    /// 42 hills up to 6 cells high: vertex share 0.7 to 1.1 %.
    Rough,
    /// 145 hills up to 6 cells high: vertex share 2.4 to 4.0 %.
    VeryRough,
}

impl Preset {
    /// Hills per million nodes, longest horizontal and vertical semi-axis, cells.
    fn numbers(self) -> (f64, u32, u32) {
        match self {
            Self::Plain => (34.0, 100, 3),
            Self::Rough => (42.0, 100, 6),
            Self::VeryRough => (145.0, 100, 6),
        }
    }
}

/// Hills as upper halves of random spheroids. Parameters left out take the preset's values.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSpheroids {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 1000 x 1000 if no size is given (Bayrak, 2008, section 5.1).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m: one map unit of the thesis.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// Hilliness: plain, rough or very_rough.
    pub preset: Preset,
    /// Number of hills; at least 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = SPHEROIDS_MAX))]
    pub spheroids: Option<u32>,
    /// Longest horizontal semi-axis, cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = AXIS_MAX_PX))]
    pub major_max_px: Option<u32>,
    /// Longest vertical semi-axis, cells; a hill's vertical semi-axis never exceeds its horizontal one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = AXIS_MAX_PX))]
    pub minor_max_px: Option<u32>,
    /// Treat the drawn lengths as full axes, twice the semi-axes (the other reading of the thesis).
    pub full_axis: bool,
}

impl Default for RawSpheroids {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: 1.0,
            preset: Preset::Rough,
            spheroids: None,
            major_max_px: None,
            minor_max_px: None,
            full_axis: false,
        }
    }
}

/// Checked parameters of the spheroids.
#[derive(Clone, Debug)]
pub struct Spheroids {
    pub(super) raw: RawSpheroids,
    pub(super) size: Size,
    pub(super) spheroids: u32,
    pub(super) major_max_px: u32,
    pub(super) minor_max_px: u32,
    /// Cells covered by all hills together, each at its widest.
    pub(super) covered: f64,
}

impl TryFrom<RawSpheroids> for Spheroids {
    type Error = ParameterError;

    fn try_from(raw: RawSpheroids) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let (per_million, major, minor) = raw.preset.numbers();
        // Even the smallest map gets one hill from a preset.
        let of_preset = (per_million * size.cells() as f64 / 1e6).round().clamp(1.0, f64::from(SPHEROIDS_MAX)) as u32;
        let spheroids = count("spheroids", raw.spheroids.unwrap_or(of_preset), SPHEROIDS_MAX)?;
        let major_max_px = count("major_max_px", raw.major_max_px.unwrap_or(major), AXIS_MAX_PX)?;
        let minor_max_px = count("minor_max_px", raw.minor_max_px.unwrap_or(minor), AXIS_MAX_PX)?;
        let covered = check_work(&size, spheroids, major_max_px)?;
        let raw = RawSpheroids {
            size_m: None,
            size_px: Some(size.px),
            spheroids: Some(spheroids),
            major_max_px: Some(major_max_px),
            minor_max_px: Some(minor_max_px),
            ..raw
        };
        Ok(Self { raw, size, spheroids, major_max_px, minor_max_px, covered })
    }
}

/// Cells covered by all hills together, each at its widest; refused where they would take a machine days.
fn check_work(size: &Size, spheroids: u32, major_max_px: u32) -> Result<f64, ParameterError> {
    let across = |cells: u32| f64::from(cells).min(2.0 * f64::from(major_max_px));
    let covered = f64::from(spheroids) * size.px.map(across).iter().product::<f64>();
    if covered <= COVERED_MAX {
        return Ok(covered);
    }
    let message = format!(
        "is {spheroids}; at their widest, these hills cover {covered:.1e} cells in total, above the limit of {COVERED_MAX:e}; \
         choose fewer or narrower hills"
    );
    Err(ParameterError::new("spheroids", message))
}

fn count(key: &str, value: u32, most: u32) -> Result<u32, ParameterError> {
    if (1..=most).contains(&value) {
        Ok(value)
    } else {
        Err(ParameterError::new(key, format!("is {value}; it must lie between 1 and {most}")))
    }
}
