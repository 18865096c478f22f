//! Kinds `mavs_variable` and `van_deusen`: octaves of Perlin noise, modulated by a slowly varying scale (Algorithm 3).
//!
//! # What
//! $$ z = s(x, y) \sum_{k=0}^{N-1} A_k P\!\left(\frac{(x, y)}{\lambda_k}\right) , \quad
//!    \lambda_k = 2\,\mathrm{cell}\; l^k \le \lambda_{max} , \quad
//!    s = \tfrac12 \left[ 1 + P\!\left(\frac{(x, y)}{100\,\mathrm{m}}\right) \right] $$
//! with the lacunarity l, `lambda_max` of 100 m or a quarter of the shorter side, whichever is less, and s in 0 to 1 with mean
//! 1/2 (`modulation = false`: 1).
//!
//! # Amplitudes
//! An octave has the variance `A_k^2` in a bandwidth of `1 / lambda_k`. With `A_k = A_0 l^(k (n - 1) / 2)`, profiles therefore have the
//! PSD `c f^-n`:
//! $$ c = \frac{A_0^2 \lambda_0^{1-n}}{\ln l} \int_0^\infty u^{n-1} S(u)\,du \; \overline{s^2} , $$
//! where S is the PSD of the noise ([`super::perlin`]). For n = 2, l = 2 and s = 1 this is `c = 0.0351 A_0^2 / lambda_0`. The published
//! `A_k = A_0 2^k` (`mavs_variable`) gives n = 3, not the claimed 2.
//!
//! The sum of discrete octaves ripples about the power law (by a third for l = 2; much less for sqrt 2). Because no octave is shorter than
//! two cells, the PSD falls below the law for waves shorter than about 6 cells: to 0.7 of it at 4 cells, 0.5 (l = 2) or 0.25 (sqrt 2) at 2.2
//! (`stat_the_density_is_that_of_the_octaves`). It also falls below the law for waves longer than 1.5 times the longest octave
//! (`val_the_law_ends_where_the_notes_say`).
//!
//! # Source
//! Van Deusen, B. D. (1967), A statistical technique for the dynamic analysis of vehicles traversing rough yielding and
//! non-yielding surfaces, NASA CR-659, for `c f^-2`.
//!
//! # When not to use it
//! The shortest waves repeat after 256 wavelengths (77 m for cells of 0.15 m): correlations over such distances are artefacts of the noise.

use super::frame::Frame;
use super::measure::{Made, RawRoughness, Roughness, finish, memory_bytes};
use super::perlin::{self, Layer, Perlin};
use super::{DEFAULT_CELL_M, DEFAULT_HI_MAG_M, DEFAULT_SIZE_PX, MAVS_VARIABLE, VAN_DEUSEN};
use crate::generator::{Generator, Input, Terrain, TerrainError};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_roughness::WaveBand;
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Longest wave of the octaves, and wavelength of the scale, m.
const WAVELENGTH_MAX_M: f64 = 100.0;
/// Longest wave over the shorter side.
const WAVELENGTH_SHARE: f64 = 0.25;
/// Minimum number of cells along the shorter side: four waves of two cells.
const CELLS_MIN: f64 = 8.0;
/// Shortest wave that follows the power law, cells: shorter waves lack the contribution of octaves below two cells.
const CELLS_OF_LAW: f64 = 6.0;
/// Longest wave that follows the power law, over the longest octave: longer waves lack the contribution of longer octaves.
const OCTAVES_OF_LAW: f64 = 1.5;
/// Maximum number of octaves: a finer lacunarity would gain nothing.
const OCTAVES_MAX: usize = 200;
/// Exponent of the PSD of profiles with the published amplitudes.
const PUBLISHED_EXPONENT: f64 = 3.0;

/// Octaves of Perlin noise as published: profiles with PSD f^-3.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawVariable {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 666 x 666 if no size is given (100 m in the examples).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m (examples); half of the shortest wave.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// South-west corner in the world, m; whole multiples of the cell.
    pub origin_m: [f64; 2],
    /// Amplitude of the shortest waves, m (listings: 0.2 in one place, 0.1 in another; recommended: below 0.15).
    #[schemars(transform = limits::positive)]
    pub hi_mag_m: f64,
    /// Longest wave, m; by default 100 m or a quarter of the shorter side, whichever is less. Tiles of one world need the same
    /// value.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub wavelength_max_m: Option<f64>,
    /// Vary the roughness by a field of scales with a wavelength of 100 m.
    pub modulation: bool,
    /// True: the listing with its defects (the same noise for all octaves and the scale; its lattice starts in the corner of
    /// every surface).
    pub compat: bool,
    /// Band in which roughness is measured, and the RMS to which it is scaled.
    pub roughness: RawRoughness,
}

impl Default for RawVariable {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            origin_m: [0.0; 2],
            hi_mag_m: DEFAULT_HI_MAG_M,
            wavelength_max_m: None,
            modulation: true,
            compat: false,
            roughness: RawRoughness::default(),
        }
    }
}

/// Octaves of Perlin noise whose profiles have the PSD c f^-n.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawVanDeusen {
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Number of cells east and north; 666 x 666 if no size is given (100 m in the examples).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Side of a cell, m (examples); half of the shortest wave.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// South-west corner in the world, m; whole multiples of the cell.
    pub origin_m: [f64; 2],
    /// Exponent n of the PSD c f^-n, between 1 and 3 (Van Deusen: 2).
    #[schemars(transform = limits::between(1.0, 3.0))]
    pub exponent: f64,
    /// Amplitude of the shortest waves, m; alternative to `psd_constant`, 0.05 if neither is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub hi_mag_m: Option<f64>,
    /// Constant c of the mean one-sided PSD c f^-n (f in cycles/m), m^(3 - n); alternative to `hi_mag_m`. A c of 1 ft (n = 2)
    /// is 0.3048 m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub psd_constant: Option<f64>,
    /// Ratio of successive wavelengths, above 1, at most 4. Published: 2; the square root of 2 gives less ripple about the
    /// power law.
    #[schemars(transform = limits::above(1.0, 4.0))]
    pub lacunarity: f64,
    /// Longest wave, m; by default 100 m or a quarter of the shorter side, whichever is less. Tiles of one world need the same
    /// value.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub wavelength_max_m: Option<f64>,
    /// Vary the roughness by a field of scales with a wavelength of 100 m.
    pub modulation: bool,
    /// Band in which roughness is measured, and the RMS to which it is scaled.
    pub roughness: RawRoughness,
}

impl Default for RawVanDeusen {
    fn default() -> Self {
        Self {
            size_m: None,
            size_px: None,
            cell_m: DEFAULT_CELL_M,
            origin_m: [0.0; 2],
            exponent: 2.0,
            hi_mag_m: None,
            psd_constant: None,
            lacunarity: 2.0,
            wavelength_max_m: None,
            modulation: true,
            roughness: RawRoughness::default(),
        }
    }
}

/// A sum of octaves.
#[derive(Clone, Debug)]
struct Octaves {
    frame: Frame,
    /// Wavelengths, m, and amplitudes, m.
    octaves: Vec<[f64; 2]>,
    modulation: bool,
    /// All octaves and the scale share one noise.
    shared: bool,
    roughness: Option<Roughness>,
}

/// The wavelengths of the octaves, m.
fn wavelengths(frame: &Frame, lacunarity: f64, max_m: Option<f64>) -> Result<Vec<f64>, ParameterError> {
    let (cell, side) = (frame.size.cell_m, frame.sides_m()[0]);
    let shortest = 2.0 * cell;
    if side < CELLS_MIN * cell * (1.0 - 1e-12) {
        let message = format!("is {cell} m; the shorter side, {side} m, must have at least {CELLS_MIN} cells");
        return Err(ParameterError::new("cell_m", message));
    }
    let longest = match max_m {
        Some(max) => ParameterError::positive("wavelength_max_m", max)?,
        None => WAVELENGTH_MAX_M.min(WAVELENGTH_SHARE * side),
    };
    let inside = |w: &f64| *w <= longest * (1.0 + 1e-12);
    let waves = (0..=OCTAVES_MAX).map(|k| shortest * libm::pow(lacunarity, k as f64)).take_while(inside);
    let waves: Vec<f64> = waves.collect();
    match (waves.len(), max_m) {
        (0, None) => {
            let message =
                format!("is {cell} m; the shortest wave, two cells, must be at most {WAVELENGTH_MAX_M} m long");
            Err(ParameterError::new("cell_m", message))
        }
        (0, Some(max)) => {
            let message = format!("is {max} m; it must be at least two cells of {cell} m, the shortest wave");
            Err(ParameterError::new("wavelength_max_m", message))
        }
        (n, _) if n > OCTAVES_MAX => {
            let message = format!(
                "is {lacunarity}; waves from {shortest} to {} m would need more than {OCTAVES_MAX} octaves",
                shown(longest)
            );
            Err(ParameterError::new("lacunarity", message))
        }
        _ => Ok(waves),
    }
}

impl Octaves {
    /// Octaves with amplitudes proportional to `wavelength^((exponent - 1) / 2)`, starting at `first_m`.
    fn with_amplitudes(waves: &[f64], exponent: f64, first_m: f64) -> Vec<[f64; 2]> {
        waves.iter().map(|w| [*w, first_m * libm::pow(w / waves[0], 0.5 * (exponent - 1.0))]).collect()
    }

    /// Mean square of the scale.
    fn mean_square_of_scale(modulation: bool) -> f64 {
        if modulation { 0.25 * (1.0 + perlin::MEAN_SQUARE) } else { 1.0 }
    }

    fn expected_m2(&self, band: &WaveBand) -> f64 {
        let variance = |[wavelength, amplitude]: &[f64; 2]| {
            amplitude * amplitude * perlin::variance_between(band.frequencies().map(|f| f * wavelength))
        };
        let plain: f64 = self.octaves.iter().map(variance).sum();
        Self::mean_square_of_scale(self.modulation) * plain
    }

    /// The octaves, then the scale less its mean.
    fn layers(&self, streams: &Streams) -> Vec<Layer> {
        let scale = [WAVELENGTH_MAX_M, 0.5];
        let all = self.octaves.iter().chain([&scale]);
        if self.shared {
            let noise = Perlin::draw(&mut streams.stream("lattice"));
            return all.map(|[wavelength, amplitude]| Layer::of(&noise, *wavelength, *amplitude)).collect();
        }
        let names = (0..self.octaves.len()).map(|k| format!("octave-{k}")).chain(["scale".to_owned()]);
        names
            .zip(all)
            .map(|(name, [wavelength, amplitude])| Layer::draw(streams, &name, *wavelength, *amplitude))
            .collect()
    }

    fn generate(&self, streams: &Streams) -> Result<Terrain, TerrainError> {
        let layers = self.layers(streams);
        let (octaves, scale) = layers.split_at(self.octaves.len());
        let frame = if self.shared { self.frame.at_origin() } else { self.frame };
        let geometry = self.frame.geometry();
        let placed = |grid: Grid| Grid { geometry, ..grid };
        let plain = placed(perlin::sum(octaves, &frame));
        let scale = self.modulation.then(|| placed(perlin::sum(scale, &frame).map(|s| 0.5 + s)));
        finish(Made { plain, scale, expected_m2: |band: &WaveBand| self.expected_m2(band) }, self.roughness.as_ref())
    }

    fn notes(&self) -> Vec<String> {
        let shortest = self.octaves[0][0];
        let period = 256.0 * shortest;
        let repeats = (period < self.frame.sides_m()[1]).then(|| {
            format!("waves of {shortest} m repeat every {period} m: Perlin noise has a period of 256 lattice cells")
        });
        self.frame.size.note().into_iter().chain(repeats).collect()
    }
}

/// Checked parameters of the published octaves.
#[derive(Clone, Debug)]
pub struct Variable {
    raw: RawVariable,
    octaves: Octaves,
}

impl TryFrom<RawVariable> for Variable {
    type Error = ParameterError;

    fn try_from(raw: RawVariable) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let frame = Frame::check(size, raw.origin_m)?;
        let first = ParameterError::positive("hi_mag_m", raw.hi_mag_m)?;
        let waves = wavelengths(&frame, 2.0, raw.wavelength_max_m)?;
        let octaves = Octaves {
            frame,
            octaves: Octaves::with_amplitudes(&waves, PUBLISHED_EXPONENT, first),
            modulation: raw.modulation,
            shared: raw.compat,
            roughness: Roughness::check(&raw.roughness, &frame)?,
        };
        let raw = RawVariable { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, octaves })
    }
}

impl Generator for Variable {
    fn kind(&self) -> &'static str {
        MAVS_VARIABLE
    }

    fn geometry(&self) -> Geometry {
        self.octaves.frame.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        memory_bytes(&self.octaves.frame, self.octaves.roughness.as_ref())
    }

    fn notes(&self) -> Vec<String> {
        let slope = "as published, amplitudes double with the wavelength: profiles have the PSD f^-3, not the f^-2 of \
                     natural ground (use `van_deusen` for that)";
        let compat = "published listing with its defects: all octaves and the scale share the same noise, so they are \
                      copies of one another and all vanish in the corner of the surface";
        let mut notes = self.octaves.notes();
        notes.push(slope.to_owned());
        notes.extend(self.raw.compat.then(|| compat.to_owned()));
        notes
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        self.octaves.generate(streams)
    }
}

/// Checked parameters of octaves that follow a power law.
#[derive(Clone, Debug)]
pub struct VanDeusen {
    raw: RawVanDeusen,
    octaves: Octaves,
    /// Mean PSD at 1 cycle/m before any scaling, m^(3 - n).
    constant: f64,
}

impl TryFrom<RawVanDeusen> for VanDeusen {
    type Error = ParameterError;

    fn try_from(raw: RawVanDeusen) -> Result<Self, ParameterError> {
        let size = Size::check(raw.size_m, raw.size_px, raw.cell_m, DEFAULT_SIZE_PX)?;
        let frame = Frame::check(size, raw.origin_m)?;
        ParameterError::between("exponent", raw.exponent, 1.0, 3.0)?;
        if !(raw.lacunarity > 1.0 && raw.lacunarity <= 4.0) {
            let message = format!("is {}; it must be above 1 and at most 4", raw.lacunarity);
            return Err(ParameterError::new("lacunarity", message));
        }
        let waves = wavelengths(&frame, raw.lacunarity, raw.wavelength_max_m)?;
        let unit = constant_of_unit(&raw, waves[0]);
        let first = match (raw.hi_mag_m, raw.psd_constant) {
            (Some(_), Some(_)) => {
                return Err(ParameterError::new("psd_constant", "conflicts with `hi_mag_m`; give only one of them"));
            }
            (None, Some(c)) => (ParameterError::positive("psd_constant", c)? / unit).sqrt(),
            (first, None) => ParameterError::positive("hi_mag_m", first.unwrap_or(DEFAULT_HI_MAG_M))?,
        };
        let octaves = Octaves {
            frame,
            octaves: Octaves::with_amplitudes(&waves, raw.exponent, first),
            modulation: raw.modulation,
            shared: false,
            roughness: Roughness::check(&raw.roughness, &frame)?,
        };
        let raw = RawVanDeusen { size_m: None, size_px: Some(size.px), ..raw };
        Ok(Self { raw, octaves, constant: unit * first * first })
    }
}

/// A length rounded to three digits, for messages.
fn short(length_m: f64) -> String {
    shown(format!("{length_m:.2e}").parse().unwrap_or(length_m))
}

impl VanDeusen {
    /// Shortest and longest wave that follow the power law, m.
    pub(super) fn law_m(&self) -> [f64; 2] {
        let longest = self.octaves.octaves.last().map_or(0.0, |[wavelength, _]| *wavelength);
        [CELLS_OF_LAW * self.octaves.frame.size.cell_m, OCTAVES_OF_LAW * longest]
    }
}

/// Constant of the mean PSD if the shortest waves, of length `shortest_m`, have an amplitude of 1 m.
fn constant_of_unit(raw: &RawVanDeusen, shortest_m: f64) -> f64 {
    let power = raw.exponent - 1.0;
    let noise = perlin::moment(power) / libm::log(raw.lacunarity);
    libm::pow(shortest_m, -power) * noise * Octaves::mean_square_of_scale(raw.modulation)
}

impl Generator for VanDeusen {
    fn kind(&self) -> &'static str {
        VAN_DEUSEN
    }

    fn geometry(&self) -> Geometry {
        self.octaves.frame.geometry()
    }

    fn parameters(&self) -> Value {
        serde_json::to_value(&self.raw).unwrap_or_default()
    }

    fn memory_bytes(&self) -> u64 {
        memory_bytes(&self.octaves.frame, self.octaves.roughness.as_ref())
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.octaves.notes();
        let asked = self.octaves.roughness.as_ref().and_then(Roughness::rms_m);
        notes.extend(asked.is_none().then(|| {
            let [low, high] = self.law_m();
            let waves = match low < high {
                true => format!("at wavelengths of {} to {} m, lower elsewhere", short(low), short(high)),
                false => "for an unlimited range of octaves; with these few, lower at all wavelengths".to_owned(),
            };
            format!("mean PSD of profiles: {:.4e} f^-{} m3 (f in cycles/m) {waves}", self.constant, self.raw.exponent)
        }));
        notes
    }

    fn generate(&self, streams: &Streams, _inputs: &[Input]) -> Result<Terrain, TerrainError> {
        self.octaves.generate(streams)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitudes grow as the wavelength to the power `(n - 1) / 2`: they double for n = 3, as published.
    #[test]
    fn val_amplitudes_follow_the_exponent() {
        for (exponent, ratio) in [(3.0, 2.0), (2.0, 2f64.sqrt()), (1.0, 1.0)] {
            let octaves = Octaves::with_amplitudes(&[0.3, 0.6, 1.2], exponent, 0.05);
            for (k, [wave_m, amplitude_m]) in octaves.iter().enumerate() {
                assert_eq!(*wave_m, [0.3, 0.6, 1.2][k]);
                assert!((amplitude_m / (0.05 * [1.0, ratio, ratio * ratio][k]) - 1.0).abs() < 1e-12, "{exponent} {k}");
            }
        }
    }

    /// For n = 2 and l = 2 the PSD's constant is `0.0351 A^2 / lambda` (to 0.2 %), times the mean square of the scale, 0.26563, with modulation;
    /// a requested constant is met exactly.
    #[test]
    fn val_constants_of_the_density() {
        let constant = |raw: RawVanDeusen| VanDeusen::try_from(raw).unwrap().constant;
        let plain = RawVanDeusen { hi_mag_m: Some(0.1), modulation: false, ..RawVanDeusen::default() };
        let own = constant(plain.clone());
        assert!((own / (0.0351 * 0.01 / 0.3) - 1.0).abs() < 2e-3, "{own}");
        let modulated = constant(RawVanDeusen { modulation: true, ..plain.clone() });
        assert!((modulated / own / 0.265_631_558 - 1.0).abs() < 1e-8, "{modulated}");
        for modulation in [false, true] {
            let asked = RawVanDeusen { hi_mag_m: None, psd_constant: Some(2e-4), modulation, ..plain.clone() };
            assert!((constant(asked) / 2e-4 - 1.0).abs() < 1e-12);
        }
    }

    /// Octaves of 100 m at 0.15 m, of 250 m at 0.3 m, and with finer ratios.
    #[test]
    fn val_octave_counts() {
        let octaves = |size: f64, cell: f64, lacunarity: f64| {
            let size = Size::check(Some([size, size]), None, cell, DEFAULT_SIZE_PX).unwrap();
            wavelengths(&Frame::check(size, [0.0; 2]).unwrap(), lacunarity, None)
        };
        let ends = |waves: Vec<f64>| (waves.len(), waves[0], waves[waves.len() - 1]);
        let near = |found: (usize, f64, f64), wanted: (usize, f64, f64)| {
            found.0 == wanted.0 && (found.1 - wanted.1).abs() < 1e-9 && (found.2 - wanted.2).abs() < 1e-9
        };
        assert!(near(ends(octaves(100.0, 0.15, 2.0).unwrap()), (7, 0.3, 19.2)));
        assert!(near(ends(octaves(250.0, 0.3, 2.0).unwrap()), (7, 0.6, 38.4)));
        assert!(near(ends(octaves(100.0, 0.15, 2f64.sqrt()).unwrap()), (13, 0.3, 19.2)));
        assert_eq!(octaves(2.0, 0.3, 2.0).unwrap_err().key, "cell_m");
    }
}
