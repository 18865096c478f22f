//! Roughness in a vehicle's band of wavelengths: requested, measured, and mapped.

use super::frame::Frame;
use crate::generator::{Map, Terrain, TerrainError};
use sastrugi_numeric::{Grid, ops, sums};
use sastrugi_roughness::{BandError, Detrended, Detrender, WaveBand};
use sastrugi_schemas::{ParameterError, limits};
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

/// Which RMS the scaling of a surface starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// The measured RMS of this surface: the result is exact.
    Measured,
    /// The expected RMS of surfaces with these parameters: the same factor for every surface, so that adjacent tiles match.
    Expected,
}

/// Band of wavelengths in which roughness is measured, and the RMS to which it is scaled. A band adds the maps `rms-measured`
/// (RMS in windows of three times its longest wavelength) and, where the roughness follows a rule, `rms-predicted`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(transform = without_required)]
pub struct RawRoughness {
    /// Shortest and longest wavelength, m; alternative to `wheelbase_m` and `tyre_radius_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub band_m: Option<[f64; 2]>,
    /// Wheelbase of a vehicle, m (2.7 in the example of the MAVS documentation): the band ends at twice this wavelength.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub wheelbase_m: Option<f64>,
    /// Tyre radius of that vehicle, m (0.33): the band starts at this wavelength, and cells may be at most half of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub tyre_radius_m: Option<f64>,
    /// True: cells too large for the shortest wave cause a note instead of an error.
    pub allow_coarse: bool,
    /// RMS of the heights in the band to which the surface is scaled, m; usual values are 0.005 to 0.127.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub rms_m: Option<f64>,
    /// Which RMS the scaling starts from.
    pub scaling: Scaling,
}

impl Default for RawRoughness {
    fn default() -> Self {
        Self {
            band_m: None,
            wheelbase_m: None,
            tyre_radius_m: None,
            allow_coarse: false,
            rms_m: None,
            scaling: Scaling::Measured,
        }
    }
}

/// The table may be given in part: no parameter is required.
fn without_required(schema: &mut Schema) {
    schema.remove("required");
}

/// A checked band and the RMS requested in it.
#[derive(Clone, Debug)]
pub struct Roughness {
    band: WaveBand,
    rms_m: Option<f64>,
    scaling: Scaling,
    /// Set if the cells are too large for its shortest wave.
    coarse: Option<BandError>,
}

impl Roughness {
    /// The band.
    pub fn band(&self) -> WaveBand {
        self.band
    }

    /// The requested RMS, m.
    pub fn rms_m(&self) -> Option<f64> {
        self.rms_m
    }

    /// The checked roughness of a surface; `None` without a band.
    ///
    /// # Errors
    /// Under its key within `roughness`: an invalid band, both a vehicle and a band, a vehicle with only one of its two lengths,
    /// cells too large, a surface shorter than four of the longest waves, an RMS without a band or not above 0.
    pub fn check(raw: &RawRoughness, frame: &Frame) -> Result<Option<Self>, ParameterError> {
        Self::of(raw, frame).map_err(|e| e.within("roughness"))
    }

    fn of(raw: &RawRoughness, frame: &Frame) -> Result<Option<Self>, ParameterError> {
        for (key, value) in
            [("rms_m", raw.rms_m), ("wheelbase_m", raw.wheelbase_m), ("tyre_radius_m", raw.tyre_radius_m)]
        {
            value.map(|value| ParameterError::positive(key, value)).transpose()?;
        }
        let (key, band) = match (raw.band_m, raw.wheelbase_m, raw.tyre_radius_m) {
            (None, None, None) if raw.rms_m.is_none() => return Ok(None),
            (None, None, None) => {
                return Err(ParameterError::new(
                    "rms_m",
                    "needs a band; give `band_m`, or `wheelbase_m` and `tyre_radius_m`",
                ));
            }
            (Some([min, max]), None, None) => ("band_m", WaveBand::new(min, max)),
            (None, Some(wheelbase), Some(radius)) => ("wheelbase_m", WaveBand::of_vehicle(wheelbase, radius)),
            (Some(_), ..) => {
                return Err(ParameterError::new(
                    "band_m",
                    "conflicts with `wheelbase_m` and `tyre_radius_m`; give either the band or the vehicle",
                ));
            }
            (None, Some(_), None) => {
                return Err(ParameterError::new("tyre_radius_m", "is missing; `wheelbase_m` needs it"));
            }
            (None, None, Some(_)) => {
                return Err(ParameterError::new("wheelbase_m", "is missing; `tyre_radius_m` needs it"));
            }
        };
        let refuse = |e: BandError| ParameterError::new(key, format!("cannot be used: {e}"));
        let band = band.map_err(refuse)?;
        band.fits_length(frame.sides_m()[1]).map_err(refuse)?;
        let coarse = band.fits_cells(frame.size.cell_m).err();
        match coarse {
            Some(e) if !raw.allow_coarse => {
                Err(ParameterError::new(key, format!("cannot be used: {e}; `allow_coarse = true` accepts it")))
            }
            coarse => Ok(Some(Self { band, rms_m: raw.rms_m, scaling: raw.scaling, coarse })),
        }
    }
}

/// Roughness in the band below this share of the RMS of all heights is leakage of the filter; no surface is scaled by it.
const ROUGHNESS_SHARE_MIN: f64 = 1e-3;

/// A surface before its roughness is measured.
pub struct Made<F> {
    /// Heights before modulation.
    pub plain: Grid,
    /// Field of scales that multiplies them, cell by cell.
    pub scale: Option<Grid>,
    /// Expected variance of profiles in a band, field of scales included, m2.
    pub expected_m2: F,
}

/// The finished terrain, scaled to the requested RMS, with its maps.
///
/// # Errors
/// When the surface has no roughness in the band to scale.
pub fn finish<F: Fn(&WaveBand) -> f64>(made: Made<F>, asked: Option<&Roughness>) -> Result<Terrain, TerrainError> {
    let Made { plain, scale, expected_m2 } = made;
    let (heights, modulated) = match scale {
        Some(scale) => (ops::multiply(&plain, &scale), Some((plain, scale))),
        None => (plain, None),
    };
    let Some(asked) = asked else { return Ok(Terrain::from(heights)) };
    let band = &asked.band;
    let measure = |grid: &Grid| Detrended::of(grid, band, Detrender::Band);
    let measured = measure(&heights);
    let own_m = match asked.scaling {
        Scaling::Measured => measured.rms_m(),
        Scaling::Expected => expected_m2(band).sqrt(),
    };
    let all_m = sums::variance(&heights.values).sqrt();
    let usable = own_m > ROUGHNESS_SHARE_MIN * all_m && own_m.is_finite();
    if asked.rms_m.is_some() && !usable {
        return Err(TerrainError::NoRoughness { min_m: band.min_m(), max_m: band.max_m() });
    }
    let factor = asked.rms_m.map_or(1.0, |rms| rms / own_m);
    let mut notes: Vec<String> =
        asked.coarse.iter().map(|e| format!("the cells do not resolve the complete band: {e}")).collect();
    notes.push(format!(
        "RMS height of profiles at wavelengths of {} to {} m: {:.6} m (detrender `band`)",
        band.min_m(),
        band.max_m(),
        factor * measured.rms_m()
    ));
    let map = |name, values: Grid| Map { name, values: values.map(|v| factor * v) };
    let predicted = modulated.map(|(plain, scale)| {
        let plain_rms_m = measure(&plain).rms_m();
        map("rms-predicted", scale.map(|s| s * plain_rms_m))
    });
    let maps = predicted.into_iter().chain([map("rms-measured", measured.rms_map())]).collect();
    Ok(Terrain { heights: heights.map(|z| factor * z), maps, lines: Vec::new(), notes })
}

/// Working memory of [`finish`] and of the layers before it, bytes.
pub fn memory_bytes(frame: &Frame, asked: Option<&Roughness>) -> u64 {
    // Heights, scales and their product; with a band, also residuals in both directions, their transposes, and running sums.
    (if asked.is_some() { 120 } else { 32 }) * frame.size.cells()
}
