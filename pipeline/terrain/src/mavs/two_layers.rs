//! Kind `mavs_perlin`: a rough layer on rolling ground, each of Perlin noise (Algorithm 1).
//!
//! $$ z = 4 m_h P\!\left(\frac{(x, y)}{\lambda_h}\right) + m_l P\!\left(\frac{(x, y)}{\lambda_l}\right) , \quad
//!    \lambda_h = 1.25 \pi\, l_h $$
//! As 4 times the RMS of the noise is 0.996, `m_h` is the RMS of the high layer, while `m_l` is the peak of the low one (RMS
//! 0.249 m_l). `l_h` is not a wavelength: the lattice of the high layer is 3.93 times as long, and its autocorrelation falls to
//! 1/e at 1.77 l_h. `true_wavelength` sets the lattice to l_h itself.

use super::frame::Frame;
use super::measure::{Made, RawRoughness, Roughness, finish, memory_bytes};
use super::perlin::{self, Layer, Perlin};
use super::{DEFAULT_CELL_M, DEFAULT_HI_LEN_M, DEFAULT_HI_MAG_M, DEFAULT_LO_LEN_M, DEFAULT_SIZE_PX, MAVS_PERLIN};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_roughness::WaveBand;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::PI;

/// Two layers of Perlin noise.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTwoLayers {
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
    /// South-west corner in the world, m; whole multiples of the cell.
    pub origin_m: [f64; 2],
    /// RMS of the high layer, m (listings: 0.2 in one place, 0.1 in another; recommended: below 0.15).
    #[schemars(transform = limits::not_negative)]
    pub hi_mag_m: f64,
    /// Length scale of the high layer, m (listing).
    #[schemars(transform = limits::positive)]
    pub hi_len_m: f64,
    /// Peak of the low layer, m (listings: 0 in one place, 10 in another).
    #[schemars(transform = limits::not_negative)]
    pub lo_mag_m: f64,
    /// Wavelength of the low layer, m (listing).
    #[schemars(transform = limits::positive)]
    pub lo_len_m: f64,
    /// True: the lattice cell of the high layer is `hi_len_m` itself, not 3.93 times that.
    pub true_wavelength: bool,
    /// True: the listing with its defects (the same noise for both layers; its lattice starts in the corner of every surface).
    pub compat: bool,
    /// Band in which roughness is measured, and the RMS to which it is scaled.
    pub roughness: RawRoughness,
}

impl Default for RawTwoLayers {
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
            true_wavelength: false,
            compat: false,
            roughness: RawRoughness::default(),
        }
    }
}

impl RawTwoLayers {
    /// Lattice cell of the high layer, m.
    fn high_lattice_m(&self) -> f64 {
        if self.true_wavelength { self.hi_len_m } else { 1.25 * PI * self.hi_len_m }
    }
}

/// Checked parameters of the two layers.
#[derive(Clone, Debug)]
pub struct TwoLayers {
    raw: RawTwoLayers,
    frame: Frame,
    roughness: Option<Roughness>,
}

impl TryFrom<RawTwoLayers> for TwoLayers {
    type Error = ParameterError;

    fn try_from(raw: RawTwoLayers) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let frame = Frame::check(size, raw.origin_m)?;
        ParameterError::not_negative("hi_mag_m", raw.hi_mag_m)?;
        ParameterError::positive("hi_len_m", raw.hi_len_m)?;
        ParameterError::not_negative("lo_mag_m", raw.lo_mag_m)?;
        frame.resolves("lo_len_m", raw.lo_len_m)?;
        frame.resolves("hi_len_m", raw.high_lattice_m())?;
        if raw.hi_mag_m + raw.lo_mag_m == 0.0 {
            return Err(ParameterError::new("hi_mag_m", "is 0, and so is `lo_mag_m`; the surface would be flat"));
        }
        let roughness = Roughness::check(&raw.roughness, &frame)?;
        let raw = RawTwoLayers { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, frame, roughness })
    }
}

impl TwoLayers {
    /// Name, lattice cell and factor of the high layer, then of the low one.
    fn layers(&self) -> [(&'static str, f64, f64); 2] {
        let p = &self.raw;
        [("high", p.high_lattice_m(), 4.0 * p.hi_mag_m), ("low", p.lo_len_m, p.lo_mag_m)]
    }

    fn heights(&self, streams: &Streams) -> Grid {
        if self.raw.compat {
            let noise = Perlin::draw(&mut streams.stream("lattice"));
            let layers = self.layers().map(|(_, length, amplitude)| Layer::of(&noise, length, amplitude));
            Grid { geometry: self.geometry(), ..perlin::sum(&layers, &self.frame.at_origin()) }
        } else {
            let layers = self.layers().map(|(name, length, amplitude)| Layer::draw(streams, name, length, amplitude));
            perlin::sum(&layers, &self.frame)
        }
    }

    fn expected_m2(&self, band: &WaveBand) -> f64 {
        let variance = |(_, length, amplitude): (_, f64, f64)| {
            amplitude * amplitude * perlin::variance_between(band.frequencies().map(|f| f * length))
        };
        self.layers().into_iter().map(variance).sum()
    }
}

impl Generator for TwoLayers {
    fn kind(&self) -> &'static str {
        MAVS_PERLIN
    }

    fn geometry(&self) -> Geometry {
        self.frame.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        memory_bytes(&self.frame, self.roughness.as_ref())
    }

    fn notes(&self) -> Vec<String> {
        let compat = self.raw.compat.then(|| {
            "published listing with its defects: both layers share the same noise, whose lattice starts in the corner of \
             every surface, where both layers are 0"
                .to_owned()
        });
        self.frame.size.note().into_iter().chain(compat).collect()
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        let plain = self.heights(streams);
        let expected_m2 = |band: &WaveBand| self.expected_m2(band);
        let mut made = finish(Made { plain, scale: None, expected_m2 }, self.roughness.as_ref())?;
        if let Some(roughness) = &self.roughness {
            let total: f64 = self.layers().iter().map(|(_, _, a)| a * a * perlin::MEAN_SQUARE).sum();
            let share = 100.0 * self.expected_m2(&roughness.band()) / total;
            made.notes.push(format!(
                "the band contains {share:.2} % of the expected variance of surfaces with these parameters"
            ));
        }
        Ok(made)
    }
}
