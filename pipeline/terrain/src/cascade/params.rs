//! Parameters of the cascade.

use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::fft::smooth_length;
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cells if no size is given.
const DEFAULT_SIZE_PX: [u32; 2] = [512, 512];
/// Maximum number of cells of the periodic surface.
const REPEATED_CELLS_MAX: u64 = 1 << 29;
/// Smallest outer scale, cells.
const OUTER_MIN_PX: f64 = 3.0;
/// Relative rounding error of a length in cells: three cells of 0.7 m are 2.9999999999999996 of them.
const ROUNDING: f64 = 1e-9;

/// True multifractal: fractionally integrated log-normal cascade.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawCascade {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 512 x 512 if no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// Codimension C1 of the mean flux, above 0 and below 1: how patchy the roughness is (Gagnon et al., 2006: 0.12 for topography);
    /// 0 would be a constant flux, which has no relief.
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub codimension: f64,
    /// Exponent H of the mean increment, 0 to 1 (Gagnon et al., 2006: 0.66).
    #[schemars(transform = limits::between(0.0, 1.0))]
    pub hurst_exponent: f64,
    /// Outer scale L at which the cascade starts, m; by default the shorter side.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub outer_scale_m: Option<f64>,
    /// Standard deviation of the heights, m.
    #[schemars(transform = limits::positive)]
    pub rms_height_m: f64,
}

impl Default for RawCascade {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: 0.05,
            codimension: 0.12,
            hurst_exponent: 0.66,
            outer_scale_m: None,
            rms_height_m: 0.2,
        }
    }
}

/// Checked parameters of the cascade.
#[derive(Clone, Debug)]
pub struct Cascade {
    pub(super) raw: RawCascade,
    pub(super) size: Size,
    pub(super) outer_scale_m: f64,
    /// Rows and columns of the periodic surface.
    pub(super) shape: [usize; 2],
}

impl TryFrom<RawCascade> for Cascade {
    type Error = ParameterError;

    fn try_from(raw: RawCascade) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        ParameterError::between("codimension", raw.codimension, 0.0, 1.0)?;
        ParameterError::between("hurst_exponent", raw.hurst_exponent, 0.0, 1.0)?;
        ParameterError::positive("rms_height_m", raw.rms_height_m)?;
        let [width, height] = size.geometry().size();
        let outer_scale_m = match raw.outer_scale_m {
            Some(scale) => ParameterError::positive("outer_scale_m", scale)?,
            None => width.min(height),
        };
        let outer_px = outer_scale_m / size.cell_m;
        if outer_px < OUTER_MIN_PX * (1.0 - ROUNDING) {
            let message = format!("is {outer_scale_m}; it must be at least three cells of {} m", size.cell_m);
            return Err(ParameterError::new("outer_scale_m", message));
        }
        let shape = repeated_shape(&size, outer_px).ok_or_else(|| {
            let message = format!(
                "is {}, which adds {} cells to each side of {} x {}; more than 2^29 cells in all do not fit in memory; choose a \
                 smaller scale or larger cells",
                shown(outer_scale_m),
                shown(outer_px.ceil()),
                size.cols(),
                size.rows()
            );
            ParameterError::new("outer_scale_m", message)
        })?;
        let raw = RawCascade { size_m: None, size_px: Some(size.px), outer_scale_m: Some(outer_scale_m), ..raw };
        Ok(Self { raw, size, outer_scale_m, shape })
    }
}

/// Wider than the surface by one outer scale, so that opposite edges of the surface are independent.
fn repeated_shape(size: &Size, outer_px: f64) -> Option<[usize; 2]> {
    let sides = [size.rows(), size.cols()].map(|side| side as f64 + outer_px.ceil());
    let possible = sides[0] * sides[1] <= REPEATED_CELLS_MAX as f64;
    possible.then(|| sides.map(|side| smooth_length(side as usize)))
}
