//! Parameters of the Gaussian fields.

use super::{Rolling, embedding};
use crate::mavs::frame::Frame;
use crate::mavs::measure::{RawRoughness, Roughness, Scaling};
use crate::mavs::{DEFAULT_CELL_M, DEFAULT_HI_LEN_M, DEFAULT_HI_MAG_M, DEFAULT_LO_LEN_M, DEFAULT_SIZE_PX};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a field is generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Covariance `s^2 exp(-(|dx| + |dy|) / a)`, by recursions.
    Separable,
    /// A covariance that depends only on distance, by circulant embedding.
    Isotropic,
}

/// Covariance of a field at the distance d, relative to its variance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Covariance {
    /// `exp(-d / a)`.
    Exponential,
    /// `exp(-d^2 / a^2)`; isotropic only.
    Gaussian,
}

/// Gaussian field over Perlin noise, Algorithm 2.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawGaussian {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 666 x 666 if no size is given (100 m in the examples).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m (examples).
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// South-west corner in the world, m; whole multiples of the cell. It positions the rolling ground, not the field.
    pub origin_m: [f64; 2],
    /// RMS of the field, m (listings: 0.2 in one place, 0.1 in another; recommended: below 0.15).
    #[schemars(transform = limits::positive)]
    pub hi_mag_m: f64,
    /// Correlation length of the field, m (listing).
    #[schemars(transform = limits::positive)]
    pub hi_len_m: f64,
    /// Peak of the rolling ground, m (listings: 0 in one place, 10 in another).
    #[schemars(transform = limits::not_negative)]
    pub lo_mag_m: f64,
    /// Wavelength of the rolling ground, m (listing).
    #[schemars(transform = limits::positive)]
    pub lo_len_m: f64,
    /// True: the listing with its defects (a wrong correlation, and none from column to column). False: the separable field
    /// that was intended.
    pub compat: bool,
    /// Band in which roughness is measured, and the RMS to which it is scaled.
    pub roughness: RawRoughness,
}

impl Default for RawGaussian {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            origin_m: [0.0; 2],
            hi_mag_m: DEFAULT_HI_MAG_M,
            hi_len_m: DEFAULT_HI_LEN_M,
            lo_mag_m: 0.0,
            lo_len_m: DEFAULT_LO_LEN_M,
            compat: false,
            roughness: RawRoughness::default(),
        }
    }
}

/// Ornstein-Uhlenbeck field with a chosen covariance, over Perlin noise.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawOrnsteinUhlenbeck {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 666 x 666 if no size is given (100 m in the examples).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m (examples).
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// South-west corner in the world, m; whole multiples of the cell. It positions the rolling ground, not the field.
    pub origin_m: [f64; 2],
    /// How the field is generated.
    pub mode: Mode,
    /// Covariance of the field.
    pub covariance: Covariance,
    /// RMS of the field, m.
    #[schemars(transform = limits::positive)]
    pub rms_m: f64,
    /// Correlation length a, m (listing), at least one cell.
    #[schemars(transform = limits::positive)]
    pub correlation_length_m: f64,
    /// Peak of the rolling ground, m.
    #[schemars(transform = limits::not_negative)]
    pub lo_mag_m: f64,
    /// Wavelength of the rolling ground, m (listing).
    #[schemars(transform = limits::positive)]
    pub lo_len_m: f64,
    /// Band in which roughness is measured, and the RMS to which it is scaled.
    pub roughness: RawRoughness,
}

impl Default for RawOrnsteinUhlenbeck {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            origin_m: [0.0; 2],
            mode: Mode::Separable,
            covariance: Covariance::Exponential,
            rms_m: DEFAULT_HI_MAG_M,
            correlation_length_m: DEFAULT_HI_LEN_M,
            lo_mag_m: 0.0,
            lo_len_m: DEFAULT_LO_LEN_M,
            roughness: RawRoughness::default(),
        }
    }
}

/// Largest correlation length, cells: the torus holds eight such lengths.
const LENGTH_MAX_CELLS: f64 = 500.0;

/// Maximum number of cells of the torus.
const TORUS_CELLS_MAX: u64 = 1 << 29;

/// Checked parameters of a field with a chosen covariance.
#[derive(Clone, Debug)]
pub struct OrnsteinUhlenbeck {
    pub(super) raw: RawOrnsteinUhlenbeck,
    pub(super) frame: Frame,
    pub(super) roughness: Option<Roughness>,
}

impl TryFrom<RawOrnsteinUhlenbeck> for OrnsteinUhlenbeck {
    type Error = ParameterError;

    fn try_from(raw: RawOrnsteinUhlenbeck) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let frame = Frame::check(size, raw.origin_m)?;
        ParameterError::positive("rms_m", raw.rms_m)?;
        frame.resolves("correlation_length_m", raw.correlation_length_m)?;
        if raw.mode == Mode::Isotropic && raw.correlation_length_m > LENGTH_MAX_CELLS * raw.cell_m {
            let message = format!("is {} m; it must be at most 500 cells", raw.correlation_length_m);
            return Err(ParameterError::new("correlation_length_m", message));
        }
        if raw.mode == Mode::Isotropic && embedding::torus_cells(&size, raw.correlation_length_m) > TORUS_CELLS_MAX {
            let message = "is \"isotropic\", which here needs a torus of more than 2^29 cells (twice the surface, and at least eight \
                           correlation lengths larger); choose a smaller surface, or `mode = \"separable\"`";
            return Err(ParameterError::new("mode", message));
        }
        if raw.mode == Mode::Separable && raw.covariance == Covariance::Gaussian {
            let message = "is \"gaussian\", which `mode = \"separable\"` cannot generate; use `mode = \"isotropic\"`";
            return Err(ParameterError::new("covariance", message));
        }
        check_rolling(&frame, raw.lo_mag_m, raw.lo_len_m)?;
        let roughness = Roughness::check(&raw.roughness, &frame)?;
        let raw = RawOrnsteinUhlenbeck { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, frame, roughness })
    }
}

impl OrnsteinUhlenbeck {
    pub(super) fn rolling(&self) -> Rolling {
        Rolling { wavelength_m: self.raw.lo_len_m, amplitude_m: self.raw.lo_mag_m }
    }
}

/// Checked parameters of Algorithm 2.
#[derive(Clone, Debug)]
pub struct Gaussian {
    pub(super) raw: RawGaussian,
    pub(super) frame: Frame,
    pub(super) roughness: Option<Roughness>,
    /// The requested cell, if the listing replaces it by a smaller one.
    pub(super) replaced_cell_m: Option<f64>,
}

impl TryFrom<RawGaussian> for Gaussian {
    type Error = ParameterError;

    fn try_from(raw: RawGaussian) -> Result<Self, ParameterError> {
        ParameterError::positive("hi_mag_m", raw.hi_mag_m)?;
        ParameterError::positive("hi_len_m", raw.hi_len_m)?;
        let mut size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let mut replaced_cell_m = None;
        if !raw.compat {
            Frame::check(size, raw.origin_m)?.resolves("hi_len_m", raw.hi_len_m)?;
        } else if raw.cell_m > 2.0 * raw.hi_len_m {
            let message = format!("is {} m; it must be at most twice `hi_len_m`, {} m", raw.cell_m, 2.0 * raw.hi_len_m);
            return Err(ParameterError::new("cell_m", message));
        } else if let Some(cell_m) = smaller_cell_m(&size, raw.hi_len_m) {
            replaced_cell_m = Some(raw.cell_m);
            size = Size::check(Some(size.geometry().size()), None, cell_m, DEFAULT_SIZE_PX)?;
        }
        let frame = Frame::check(size, raw.origin_m)?;
        check_rolling(&frame, raw.lo_mag_m, raw.lo_len_m)?;
        let roughness = Roughness::check(&raw.roughness, &frame)?;
        if raw.compat && raw.roughness.scaling == Scaling::Expected {
            let message = "is \"expected\", but the published listing does not have the expected RMS; use \"measured\"";
            return Err(ParameterError::new("scaling", message).within("roughness"));
        }
        let raw = RawGaussian { size_m: None, size_px: Some(size.px), cell_m: size.cell_m, ..raw };
        Ok(Self { raw, frame, roughness, replaced_cell_m })
    }
}

impl Gaussian {
    pub(super) fn rolling(&self) -> Rolling {
        Rolling { wavelength_m: self.raw.lo_len_m, amplitude_m: self.raw.lo_mag_m }
    }
}

/// The cell that the listing substitutes for a larger one: the shorter side after dividing the surface into parts of about twice
/// the correlation length.
fn smaller_cell_m(size: &Size, length_m: f64) -> Option<f64> {
    let part = |side: f64| side / ((0.5 * side / length_m).floor() + 1.0);
    let [x, y] = size.geometry().size().map(part);
    let limit = x.min(y);
    (limit < size.cell_m).then_some(limit)
}

fn check_rolling(frame: &Frame, amplitude_m: f64, wavelength_m: f64) -> Result<(), ParameterError> {
    ParameterError::not_negative("lo_mag_m", amplitude_m)?;
    frame.resolves("lo_len_m", wavelength_m)
}
