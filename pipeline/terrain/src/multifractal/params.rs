//! Parameters of the multifractal.

use crate::size::{MIN_SIDE_PX, Size};
use crate::weierstrass_mandelbrot::{
    DEFAULT_CELL_M, DEFAULT_FREQUENCIES, DEFAULT_FREQUENCY_RATIO, DEFAULT_SAMPLING_LENGTH_M, Mode,
    RawWeierstrassMandelbrot, WeierstrassMandelbrot,
};
use sastrugi_schemas::{ParameterError, limits};
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How the product of the layers is scaled to 16-bit levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// `32768 + 32767 p / max|p|`: height 0 stays at the middle level.
    Symmetric,
    /// `32768 + 32767 (p - min p) / (max p - min p)`: the lowest height is 0, and only half of the levels are used.
    MinMax,
}

/// One layer of the product. Parameters left out keep that layer's defaults.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = without_required)]
pub struct RawLayer {
    /// Number of ridge directions M (Table 1: 16, 32, 64).
    #[schemars(range(min = 1))]
    pub ridges: u32,
    /// Fractal dimension D, between 2 and 3 (Table 1: 2.2, 2.45, and 2.3, 2.45 or 2.6). A larger D has more of its height in short waves.
    /// All layers are scaled to the same range: for steeper ground, raise `z_scale_percent`.
    #[schemars(transform = limits::between(2.0, 3.0))]
    pub fractal_dimension: f64,
    /// Elevation scaling G, m (Table 1: 1e-6, 8e-8, 1e-8). Has no effect on the product, because all layers are scaled to the
    /// same range; kept because the paper lists it.
    #[schemars(transform = limits::positive)]
    pub elevation_scale_m: f64,
    /// Standard deviation of the Gaussian low-pass filter, cells, so that the ground changes with `cell_m` (not published; 8, 8 and 1 are our
    /// reading).
    #[schemars(transform = limits::not_negative)]
    pub sigma_px: f64,
}

/// Multifractal surface: the product of three filtered Weierstrass-Mandelbrot layers.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawMultifractal {
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
    /// Highest frequency index n_max (Table 1); the mode may end the sum earlier.
    #[schemars(range(min = 1))]
    pub frequencies: u32,
    /// Ratio gamma of successive frequencies, above 1 (Table 1).
    #[schemars(transform = limits::between(1.0, f64::INFINITY))]
    pub frequency_ratio: f64,
    /// Sampling length L, m (Table 1).
    #[schemars(transform = limits::positive)]
    pub sampling_length_m: f64,
    /// Upper bound of the phases, which are uniform from 0, rad. The paper prints pi, which adds the same spike in one corner to
    /// every layer; 2 pi does not.
    #[schemars(transform = limits::positive)]
    pub phase_max_rad: f64,
    /// Which waves the layers contain.
    pub mode: Mode,
    /// Low-frequency layer.
    pub low: RawLayer,
    /// Mid-frequency layer.
    pub mid: RawLayer,
    /// High-frequency layer; the paper varies its fractal dimension (2.3, 2.45, 2.6).
    pub high: RawLayer,
    /// How the product is scaled to levels (not published; symmetric is our reading).
    pub scaling: Scaling,
    /// Vertical scale of the 16-bit levels, per cent: one level is this / 128 cm (section 2.2: 0.75 %, or 3.84 m over all levels).
    #[schemars(transform = limits::positive)]
    pub z_scale_percent: f64,
}

impl Default for RawMultifractal {
    fn default() -> Self {
        let layer = |ridges, fractal_dimension, elevation_scale_m, sigma_px| RawLayer {
            ridges,
            fractal_dimension,
            elevation_scale_m,
            sigma_px,
        };
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            frequencies: DEFAULT_FREQUENCIES,
            frequency_ratio: DEFAULT_FREQUENCY_RATIO,
            sampling_length_m: DEFAULT_SAMPLING_LENGTH_M,
            phase_max_rad: TAU,
            mode: Mode::BandLimited,
            low: layer(16, 2.2, 1e-6, 8.0),
            mid: layer(32, 2.45, 8e-8, 8.0),
            high: layer(64, 2.45, 1e-8, 1.0),
            scaling: Scaling::Symmetric,
            z_scale_percent: 0.75,
        }
    }
}

/// One checked layer.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    pub(super) name: &'static str,
    pub(super) surface: WeierstrassMandelbrot,
    pub(super) sigma_px: f64,
}

/// Checked parameters of the multifractal.
#[derive(Clone, Debug)]
pub struct Multifractal {
    pub(super) raw: RawMultifractal,
    pub(super) size: Size,
    pub(super) layers: [Layer; 3],
}

impl TryFrom<RawMultifractal> for Multifractal {
    type Error = ParameterError;

    fn try_from(raw: RawMultifractal) -> Result<Self, ParameterError> {
        ParameterError::positive("z_scale_percent", raw.z_scale_percent)?;
        let layers = [
            Layer::check("low", &raw, &raw.low)?,
            Layer::check("mid", &raw, &raw.mid)?,
            Layer::check("high", &raw, &raw.high)?,
        ];
        let size = layers[0].surface.size();
        let raw = RawMultifractal { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, size, layers })
    }
}

impl Layer {
    fn check(name: &'static str, common: &RawMultifractal, layer: &RawLayer) -> Result<Self, ParameterError> {
        let surface =
            WeierstrassMandelbrot::try_from(layer.as_monofractal(common)).map_err(|e| within_layer(e, name))?;
        let side = surface.size().px[0].min(surface.size().px[1]);
        let sigma_px = layer.sigma_px;
        if (0.0..=f64::from(side)).contains(&sigma_px) {
            Ok(Self { name, surface, sigma_px })
        } else {
            let message = format!("is {sigma_px}; it must lie between 0 and the shorter side of {side} cells");
            Err(ParameterError::new("sigma_px", message).within(name))
        }
    }
}

impl RawLayer {
    fn as_monofractal(&self, common: &RawMultifractal) -> RawWeierstrassMandelbrot {
        RawWeierstrassMandelbrot {
            size_m: common.size_m,
            size_px: common.size_px,
            cell_m: common.cell_m,
            ridges: self.ridges,
            frequencies: common.frequencies,
            frequency_ratio: common.frequency_ratio,
            fractal_dimension: self.fractal_dimension,
            sampling_length_m: common.sampling_length_m,
            elevation_scale_m: self.elevation_scale_m,
            phase_max_rad: common.phase_max_rad,
            mode: common.mode,
        }
    }
}

/// Prefixes the key of a layer's own parameter with the layer; keys of common parameters stay.
fn within_layer(error: ParameterError, layer: &str) -> ParameterError {
    match error.key.as_str() {
        "ridges" | "fractal_dimension" | "elevation_scale_m" => error.within(layer),
        _ => error,
    }
}

/// A layer may be given in part: no parameter is required.
fn without_required(schema: &mut Schema) {
    schema.remove("required");
}
