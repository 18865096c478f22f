//! Parameters of the elaboration.

use super::bounds::{Bound, DIAMETER_PIXELS};
use crate::planetary::{
    Lattice, RawProcess, WHOLE_TOLERANCE, Window, Work, check_processes, check_texture, window_in_reach,
};
use crate::size::Size;
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Samples when no size is given.
const DEFAULT_SIZE_PX: [u32; 2] = [1000, 1000];
/// Offsets of the lattice are whole multiples of this, so that windows of one lattice find the same, m.
const OFFSET_STEP_M: f64 = 1e-9;
/// Sample columns and rows are counted up to here.
const COLUMNS_MAX: f64 = (1u64 << 40) as f64;

/// Finer detail for a measured DEM.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawElaborate {
    /// The DEM: an id in a study, a file on the command line.
    pub dem: String,
    /// Size east and north, m; in place of `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 2]>,
    /// Samples east and north; 1000 x 1000 when no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_px: Option<[u32; 2]>,
    /// Distance of the samples, m; finer than the DEM.
    pub cell_m: f64,
    /// Distance of the lattice points that detail is made on, m: `cell_m` over a power of 2. When absent, over the one that makes it at
    /// most 0.0125 m. Part of the surface: other spacings give other detail.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub basic_spacing_m: Option<f64>,
    /// Place of the south-west sample in the DEM's own coordinates, m.
    pub origin_m: [f64; 2],
    /// Whether roughness is added; without it (and without processes) the surface is the smooth background.
    pub texture: bool,
    /// Hurst exponent of the texture, above 0 to 1; fitted to the DEM when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hurst: Option<f64>,
    /// Standard deviation of a point about the mean of its parents 1 m away, m; fitted to the DEM when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness_m: Option<f64>,
    /// Craters, rocks, albedo and dust, in order, as of kind `planetary`: tables with a `kind` of `primary_craters`,
    /// `secondary_craters`, `rocks`, `albedo`, `dust`. Nothing wider than two posts of the DEM is added: it would show.
    pub processes: Vec<RawProcess>,
    /// Size on the ground of a pixel of images that are known of the site, m: craters and rocks that they would have shown are not added. No
    /// images when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_resolution_m: Option<f64>,
    /// Pixels across the widest crater or rock that images do not show, 1 or above (2: the sampling theorem; our choice).
    pub image_pixels: f64,
    /// Measured points that the surface passes through: a CSV file with columns `x`, `y`, `z` and, where known, `sigma`, m, in the DEM's own
    /// coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub altimetry: Option<String>,
    /// The same as a list, beside the file's or alone: `[x, y, z]` or `[x, y, z, sigma]`, m. A point with a standard error sigma is soft.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub altimetry_points_m: Vec<Vec<f64>>,
    /// Measured albedo, 0 to 1: an id in a study (`<id>.albedo` for the map of a terrain) or a raster file that covers the window. The map of the
    /// result keeps it at its cells' centres; process `albedo` adds detail between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub albedo: Option<String>,
}

impl Default for RawElaborate {
    fn default() -> Self {
        Self {
            dem: String::new(),
            size_m: None,
            size_px: None,
            cell_m: 0.05,
            basic_spacing_m: None,
            origin_m: [0.0; 2],
            texture: true,
            hurst: None,
            roughness_m: None,
            processes: Vec::new(),
            image_resolution_m: None,
            image_pixels: DIAMETER_PIXELS,
            altimetry: None,
            altimetry_points_m: Vec::new(),
            albedo: None,
        }
    }
}

/// Checked parameters of the elaboration.
#[derive(Clone, Debug)]
pub struct Elaborate {
    pub(super) raw: RawElaborate,
    pub(super) size: Size,
    pub(super) spacing_m: f64,
    pub(super) window: Window,
    /// Where lattice point 0 lies in the DEM's coordinates, m.
    pub(super) offset_m: [f64; 2],
    pub(super) work: Work,
    /// What the images of the site show, where there are images.
    pub(super) images: Option<Bound>,
}

impl TryFrom<RawElaborate> for Elaborate {
    type Error = ParameterError;

    fn try_from(raw: RawElaborate) -> Result<Self, ParameterError> {
        if raw.dem.is_empty() {
            return Err(ParameterError::new("dem", "is missing; it names the DEM to refine"));
        }
        let Lattice { spacing_m, zoom, cell_m } = Lattice::check(raw.basic_spacing_m, raw.cell_m)?;
        let size = Size::check(raw.size_m, raw.size_px, cell_m, DEFAULT_SIZE_PX)?;
        check_texture(raw.roughness_m.unwrap_or(0.0), raw.hurst.unwrap_or(1.0))?;
        for (n, process) in raw.processes.iter().enumerate() {
            if matches!(process, RawProcess::BaseSlope(_) | RawProcess::Texture(_)) {
                let message = format!("is `{}`; slope and texture of this kind are those of the DEM", process.kind());
                return Err(ParameterError::new(format!("processes.{n}.kind"), message));
            }
        }
        check_processes(&raw.processes, spacing_m)?;
        let images = raw.check_images()?;
        raw.check_inputs()?;
        let [west, south] = raw.origin_m.map(|at| column(at, cell_m));
        let window = Window { zoom, west: west?, south: south?, cols: size.cols(), rows: size.rows(), centred: false };
        let work = window_in_reach(&raw.processes, spacing_m, &window)?;
        let offset_m = [(raw.origin_m[0], window.west), (raw.origin_m[1], window.south)].map(|(at_m, column)| {
            let beyond_m = at_m - column as f64 * cell_m;
            (beyond_m / OFFSET_STEP_M).round() * OFFSET_STEP_M
        });
        let (size_px, basic_spacing_m) = (Some(size.px), Some(spacing_m));
        let raw = RawElaborate { size_m: None, size_px, cell_m, basic_spacing_m, ..raw };
        Ok(Self { raw, size, spacing_m, window, offset_m, work, images })
    }
}

impl RawElaborate {
    /// What the images of the site show, where there are images.
    fn check_images(&self) -> Result<Option<Bound>, ParameterError> {
        if !(self.image_pixels >= 1.0 && self.image_pixels.is_finite()) {
            let message = format!("is {}; it must be 1 or above", self.image_pixels);
            return Err(ParameterError::new("image_pixels", message));
        }
        let Some(resolution_m) = self.image_resolution_m else { return Ok(None) };
        ParameterError::positive("image_resolution_m", resolution_m)?;
        let bound = Bound::Pixels(resolution_m, self.image_pixels);
        match bound.apply(&self.processes) {
            Ok(_) => Ok(Some(bound)),
            Err((n, diameter_m)) => {
                let message = format!(
                    "is {diameter_m} m; images of {resolution_m} m a pixel would show what is wider than {} m",
                    bound.most_m()
                );
                Err(ParameterError::new(format!("processes.{n}.diameter_min_m"), message))
            }
        }
    }

    /// Names that are not empty, and points of three or four numbers.
    fn check_inputs(&self) -> Result<(), ParameterError> {
        for (key, name) in [("altimetry", &self.altimetry), ("albedo", &self.albedo)] {
            if name.as_ref().is_some_and(String::is_empty) {
                return Err(ParameterError::new(key, "is empty; it names a file"));
            }
        }
        match self.altimetry_points_m.iter().position(|p| !(3..=4).contains(&p.len())) {
            Some(n) => {
                let message = format!(
                    "has {} numbers; a point is [x, y, z] or [x, y, z, sigma]",
                    self.altimetry_points_m[n].len()
                );
                Err(ParameterError::new(format!("altimetry_points_m.{n}"), message))
            }
            None => Ok(()),
        }
    }
}

/// The column or row of samples that a place is taken for: the nearest. Halves go up, also those that a quotient just misses, so that
/// places whole cells apart are taken for columns as far apart.
fn column(at_m: f64, cell_m: f64) -> Result<i64, ParameterError> {
    let column = (at_m / cell_m + 0.5 + WHOLE_TOLERANCE).floor();
    if column.abs() <= COLUMNS_MAX {
        Ok(column as i64)
    } else {
        Err(ParameterError::new("origin_m", format!("holds {at_m} m; it must lie within 2^40 cells of 0")))
    }
}
