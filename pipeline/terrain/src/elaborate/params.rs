//! Parameters of the elaboration.

use super::bounds::{Bound, DIAMETER_PIXELS};
use crate::planetary::{
    Lattice, RawProcess, WHOLE_TOLERANCE, Window, Work, check_processes, check_texture, window_in_reach,
};
use crate::size::{MIN_SIDE_PX, Size};
use sastrugi_schemas::{ParameterError, counted, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Samples if no size is given.
const DEFAULT_SIZE_PX: [u32; 2] = [1000, 1000];
/// Lattice offsets are whole multiples of this, so that windows of one lattice get the same offset, m.
const OFFSET_STEP_M: f64 = 1e-9;
/// Largest sample column or row number.
const COLUMNS_MAX: f64 = (1u64 << 40) as f64;

/// Finer detail for a measured DEM.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawElaborate {
    /// The DEM: an id in a study, a file on the command line.
    pub dem: String,
    /// Size east and north, m; alternative to `size_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub size_m: Option<[f64; 2]>,
    /// Samples east and north; 1000 x 1000 if no size is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = MIN_SIDE_PX)))]
    pub size_px: Option<[u32; 2]>,
    /// Distance between samples, m; finer than the DEM.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// Spacing of the lattice on which detail is generated, m: `cell_m` divided by a power of 2, by default the smallest that gives at
    /// most 0.0125 m. Part of the surface: another spacing gives different detail.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub basic_spacing_m: Option<f64>,
    /// Position of the south-west sample in the DEM's own coordinates, m.
    pub origin_m: [f64; 2],
    /// Whether to add roughness; without it (and without processes) the surface is the smooth background.
    pub texture: bool,
    /// Hurst exponent of the texture, above 0 to 1; fitted to the DEM by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::above(0.0, 1.0))]
    pub hurst: Option<f64>,
    /// Standard deviation of a point about the mean of its parents 1 m away, m; fitted to the DEM by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::not_negative)]
    pub roughness_m: Option<f64>,
    /// Craters, rocks, albedo and dust, in order, as for kind `planetary`: tables with a `kind` of `primary_craters`,
    /// `secondary_craters`, `rocks`, `albedo`, `dust`. Features wider than two posts are not added, because the DEM would show them.
    pub processes: Vec<RawProcess>,
    /// Ground size of a pixel of existing images of the site, m: craters and rocks that the images would show are not added. No
    /// images by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub image_resolution_m: Option<f64>,
    /// Width in pixels of the widest crater or rock that images do not show, 1 or above (2: the sampling theorem; our choice).
    #[schemars(transform = limits::half_open(1.0, f64::INFINITY))]
    pub image_pixels: f64,
    /// Measured points that the surface passes through: a CSV file with columns `x`, `y`, `z` and optionally `sigma`, m, in the DEM's own
    /// coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub altimetry: Option<String>,
    /// Measured points as a list, alone or in addition to the file: `[x, y, z]` or `[x, y, z, sigma]`, m. The surface passes only within
    /// sigma of a point with a standard error sigma.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(inner(length(min = 3, max = 4)))]
    pub altimetry_points_m: Vec<Vec<f64>>,
    /// Measured albedo, 0 to 1: an id in a study (`<id>.albedo` for the map of a terrain) or a raster file that covers the window. The
    /// resulting map keeps it at its cell centres; the process `albedo` adds detail between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
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
    /// Position of lattice point 0 in the DEM's coordinates, m.
    pub(super) offset_m: [f64; 2],
    pub(super) work: Work,
    /// The bound set by images of the site, if there are any.
    pub(super) images: Option<Bound>,
}

impl TryFrom<RawElaborate> for Elaborate {
    type Error = ParameterError;

    fn try_from(raw: RawElaborate) -> Result<Self, ParameterError> {
        if raw.dem.is_empty() {
            return Err(ParameterError::new("dem", "is missing; name the DEM to refine"));
        }
        let Lattice { spacing_m, zoom, cell_m } = Lattice::check(raw.basic_spacing_m, raw.cell_m)?;
        let size = Size::check(raw.size_m, raw.size_px, cell_m, DEFAULT_SIZE_PX)?;
        check_texture(raw.roughness_m.unwrap_or(0.0), raw.hurst.unwrap_or(1.0))?;
        for (n, process) in raw.processes.iter().enumerate() {
            if matches!(process, RawProcess::BaseSlope(_) | RawProcess::Texture(_)) {
                let message = format!("is `{}`; `elaborate` takes slope and texture from the DEM", process.kind());
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
    /// The bound set by images of the site, if there are any.
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
                    "is {diameter_m} m; images with {resolution_m} m pixels would show features wider than {} m",
                    bound.most_m()
                );
                Err(ParameterError::new(format!("processes.{n}.diameter_min_m"), message))
            }
        }
    }

    /// Checks that names are not empty and that points have three or four numbers.
    fn check_inputs(&self) -> Result<(), ParameterError> {
        for (key, name) in [("altimetry", &self.altimetry), ("albedo", &self.albedo)] {
            if name.as_ref().is_some_and(String::is_empty) {
                return Err(ParameterError::new(key, "is empty; it must name a file"));
            }
        }
        match self.altimetry_points_m.iter().position(|p| !(3..=4).contains(&p.len())) {
            Some(n) => {
                let found = counted(self.altimetry_points_m[n].len(), "number");
                let message = format!("has {found}; a point must be [x, y, z] or [x, y, z, sigma]");
                Err(ParameterError::new(format!("altimetry_points_m.{n}"), message))
            }
            None => Ok(()),
        }
    }
}

/// The column or row of samples nearest to a coordinate. Halves are rounded up, even if the quotient falls just short of a half, so that
/// coordinates whole cells apart give columns equally far apart.
fn column(at_m: f64, cell_m: f64) -> Result<i64, ParameterError> {
    let column = (at_m / cell_m + 0.5 + WHOLE_TOLERANCE).floor();
    if column.abs() <= COLUMNS_MAX {
        Ok(column as i64)
    } else {
        Err(ParameterError::new(
            "origin_m",
            format!("contains {at_m} m; both coordinates must lie within 2^40 cells of 0"),
        ))
    }
}
