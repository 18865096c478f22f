//! Parameters of the monofractal.

use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Shape of the published heightfields (Majhor and Bos, section 2.2).
pub const DEFAULT_SIZE_PX: [u32; 2] = [1009, 1009];
/// Cell of the published heightfields (section 2.2), m.
pub const DEFAULT_CELL_M: f64 = 0.05;
/// `n_max` of Table 1.
pub const DEFAULT_FREQUENCIES: u32 = 1009;
/// `gamma` of Table 1.
pub const DEFAULT_FREQUENCY_RATIO: f64 = 1.5;
/// `L` of Table 1, m.
pub const DEFAULT_SAMPLING_LENGTH_M: f64 = 100.9;
/// Maximum number of plane waves of one surface.
const MAX_WAVES: u64 = 1 << 22;
/// Largest permitted error of the double-precision phases of the highest wave in `paper` mode, rad.
const PHASE_ERROR_MAX_RAD: f64 = 1e-3;
/// Relative error of a phase: the power, the product with the direction and the product with the position each round once,
/// by half a unit in the last place.
const PHASE_RELATIVE_ERROR: f64 = 1.5 * f64::EPSILON;

/// Which waves the sum contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The waves that the grid resolves: wavelengths of at least `2 cell_m`.
    BandLimited,
    /// Shorter waves too, aliased by the grid as in the published heightfields, as long as double-precision phases
    /// are accurate to 1e-3 rad.
    Paper,
}

/// Weierstrass-Mandelbrot surface.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawWeierstrassMandelbrot {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 1009 x 1009 if no size is given (Majhor and Bos, section 2.2).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m (section 2.2).
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// Number of ridge directions M (Table 1, high-frequency layer).
    #[schemars(range(min = 1))]
    pub ridges: u32,
    /// Highest frequency index n_max (Table 1); the mode may end the sum earlier.
    #[schemars(range(min = 1))]
    pub frequencies: u32,
    /// Ratio gamma of successive frequencies, above 1 (Table 1).
    #[schemars(transform = limits::between(1.0, f64::INFINITY))]
    pub frequency_ratio: f64,
    /// Fractal dimension D, between 2 and 3 (Table 1, high-frequency layer).
    #[schemars(transform = limits::between(2.0, 3.0))]
    pub fractal_dimension: f64,
    /// Sampling length L, m (Table 1).
    #[schemars(transform = limits::positive)]
    pub sampling_length_m: f64,
    /// Elevation scaling G, m (Table 1, high-frequency layer).
    #[schemars(transform = limits::positive)]
    pub elevation_scale_m: f64,
    /// Upper bound of the phases, which are uniform from 0, rad. The paper prints pi, which adds the same spike in one corner to
    /// every surface; 2 pi does not.
    #[schemars(transform = limits::positive)]
    pub phase_max_rad: f64,
    /// Which waves the sum contains.
    pub mode: Mode,
}

impl Default for RawWeierstrassMandelbrot {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            ridges: 64,
            frequencies: DEFAULT_FREQUENCIES,
            frequency_ratio: DEFAULT_FREQUENCY_RATIO,
            fractal_dimension: 2.45,
            sampling_length_m: DEFAULT_SAMPLING_LENGTH_M,
            elevation_scale_m: 1e-8,
            phase_max_rad: TAU,
            mode: Mode::BandLimited,
        }
    }
}

/// Checked parameters of the monofractal.
#[derive(Clone, Debug)]
pub struct WeierstrassMandelbrot {
    pub(super) raw: RawWeierstrassMandelbrot,
    pub(super) size: Size,
    /// Highest frequency index in the sum, which starts at 1.
    pub(super) frequencies: u32,
}

impl TryFrom<RawWeierstrassMandelbrot> for WeierstrassMandelbrot {
    type Error = ParameterError;

    fn try_from(raw: RawWeierstrassMandelbrot) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        at_least_one("ridges", raw.ridges)?;
        at_least_one("frequencies", raw.frequencies)?;
        ParameterError::between("frequency_ratio", raw.frequency_ratio, 1.0, f64::INFINITY)?;
        ParameterError::between("fractal_dimension", raw.fractal_dimension, 2.0, 3.0)?;
        ParameterError::positive("sampling_length_m", raw.sampling_length_m)?;
        ParameterError::positive("elevation_scale_m", raw.elevation_scale_m)?;
        ParameterError::positive("phase_max_rad", raw.phase_max_rad)?;
        let frequencies = kept_frequencies(&raw, &size);
        let raw = RawWeierstrassMandelbrot { size_m: None, size_px: Some(size.px), ..raw };
        Self { raw, size, frequencies }.with_usable_waves()
    }
}

impl WeierstrassMandelbrot {
    /// Size of the surface.
    pub fn size(&self) -> Size {
        self.size
    }

    fn with_usable_waves(self) -> Result<Self, ParameterError> {
        let raw = &self.raw;
        if self.frequencies == 0 {
            let message = format!(
                "is {} m, which makes the first wave, {:e} m, too short for cells of {} m; choose a longer one",
                raw.sampling_length_m,
                raw.sampling_length_m / raw.frequency_ratio,
                raw.cell_m
            );
            return Err(ParameterError::new("sampling_length_m", message));
        }
        let waves = u64::from(raw.ridges) * u64::from(self.frequencies);
        if waves > MAX_WAVES {
            let message =
                format!("gives {waves} waves with {} frequencies; at most {MAX_WAVES} are allowed", self.frequencies);
            return Err(ParameterError::new("ridges", message));
        }
        let amplitude = self.amplitude_sum_m();
        if !(2.0 * amplitude).is_normal() {
            let message = format!("gives waves whose amplitudes sum to {amplitude:e} m; choose another scale");
            return Err(ParameterError::new("elevation_scale_m", message));
        }
        Ok(self)
    }
}

fn at_least_one(key: &str, value: u32) -> Result<(), ParameterError> {
    if value == 0 { Err(ParameterError::new(key, "is 0; it must be at least 1")) } else { Ok(()) }
}

/// The highest frequency index in the sum: `gamma^n` up to a bound that depends on the mode.
fn kept_frequencies(raw: &RawWeierstrassMandelbrot, size: &Size) -> u32 {
    let bound = match raw.mode {
        Mode::BandLimited => raw.sampling_length_m / (2.0 * raw.cell_m),
        Mode::Paper => {
            let [x, y] = size.geometry().size();
            let turns = (x * x + y * y).sqrt() / raw.sampling_length_m;
            PHASE_ERROR_MAX_RAD / (TAU * turns * PHASE_RELATIVE_ERROR)
        }
    };
    let fitting = libm::floor(libm::log(bound) / libm::log(raw.frequency_ratio) * (1.0 + 1e-12));
    (fitting.max(0.0) as u32).min(raw.frequencies)
}
