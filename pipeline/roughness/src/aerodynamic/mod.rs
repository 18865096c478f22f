//! Aerodynamic roughness length z0 by wind direction, from surface geometry alone.
//!
//! # What
//! z0 is the height at which the logarithmic wind profile `u = (u* / kappa) ln((z - d) / z0)` reaches zero. It is estimated
//! here from obstacle height, frontal area and obstacle spacing of a detrended surface, for wind from any azimuth, by
//! three published formulas: [`lettau_z0_m`], [`munro_z0_m`] and [`macdonald_z0_m`].
//!
//! # Formulas
//! z' is the height above the least-squares plane, minus its centred moving average over the outer scale if one is given,
//! minus its mean. At borders and holes, where a window is incomplete, the local plane replaces the mean
//! ([`crate::background`]): the centroid of such a window is off its centre, and on the flanks of a hill or hollow slope times
//! offset would count as roughness. The wind blows from azimuth theta, in degrees clockwise from grid north (+y); the unit
//! vector towards its origin is `w = (sin theta, cos theta)`.
//!
//! | symbol | meaning |
//! |---|---|
//! | lambda_f | frontal-area index: windward faces projected onto the plane normal to the wind, per ground area (1): `mean of max(0, -(g_x sin theta + g_y cos theta))` |
//! | g | gradient of the bilinear surface at the centre of the patch between four cell centres, m/m: `g_x = (z_ne + z_se - z_nw - z_sw) / (2 dx)`, `g_y = (z_nw + z_ne - z_sw - z_se) / (2 dy)` |
//! | sigma_d | standard deviation of z', m |
//! | h* | effective obstacle height, m: [`ObstacleHeight`] |
//! | f / X | upcrossings of the mean level per metre of profile along the wind, 1/m |
//! | lambda_p | plan-area index of Macdonald et al. (1) |
//!
//! A patch with a hole counts neither as face nor as ground; a profile ends at a hole and restarts after it.
//!
//! * Lettau: `z0 = 0.5 h* s / S = 0.5 h* lambda_f`, with s the silhouette area of an obstacle and S its ground area.
//! * Munro: obstacles of height `h* = 2 sigma_d` and width `X / (2 f)`, each on ground `(X / f)^2`; so `s = h* X / (2 f)` and
//!   `z0 = 0.5 h* s / S = f h*^2 / (4 X) = f sigma_d^2 / X`.
//! * Macdonald et al.: `z_d / h = 1 + A^-lambda_p (lambda_p - 1)` and
//!   `z0 / h = (1 - z_d / h) exp(-(0.5 beta (C_D / kappa^2) (1 - z_d / h) lambda_f)^-0.5)`, with A = 4.43 and beta = 1 (staggered
//!   arrays), C_D = 1.2, kappa = 0.4.
//!
//! # Sources
//! * H. Lettau (1969), J. Appl. Meteorol. 8, 828-832.
//! * D. S. Munro (1989), J. Glaciol. 35, 328-331.
//! * R. W. Macdonald, R. F. Griffiths and D. J. Hall (1998), Atmos. Environ. 32, 1857-1864,
//!   doi:10.1016/S1352-2310(97)00403-2, Eq. 23 (z_d) and 26 (z0).
//!
//! # Where we depart
//! * Faces of the entire surface are counted, as in raster versions of Lettau's formula (after Smith et al. 2016, J. Geophys.
//!   Res. Earth Surf. 121, 748-766), including those below the mean level and sheltered ones.
//! * sigma_d and the zero level are those of the surface, not of each profile, so that short pieces of profile between holes
//!   are weighted by their length. Upcrossings and downcrossings are averaged: opposite winds get the same f.
//! * Profiles run along the wind, so that a row describes what the wind meets. Field profiles are often taken across the wind:
//!   their value is in the row 90 degrees on.
//! * A continuous surface has no plan area of obstacles. lambda_p is set to lambda_f, as it is for cubes, and h to h*; drag
//!   models of ice use one density for both (after van Tiggelen et al. 2021, The Cryosphere 15, 2601,
//!   doi:10.5194/tc-15-2601-2021). The share of ground above the mean level, about one half whatever the slope, would put z_d
//!   at 0.76 h and lower z0 by a factor of 15 at lambda_f = 0.1. C_D is that of cubes; rounded forms have less drag.
//!
//! # Uncertainty
//! Standard errors come from the delete-one jackknife over 4 x 4 blocks of the raster. They cover only sampling of the plot, and
//! are valid only if a block is wider than the range of the surface's covariance; the spread between formulas is usually larger.
//!
//! # Limits
//! * Roughness finer than a cell is not resolved, and lambda_f and f rise as cells shrink: compare z0 only at equal cells.
//! * h* rises with the outer scale, or with the plot size if none is given.
//! * Above lambda_f of about 0.2 to 0.3 obstacles shelter one another: Lettau's formula, which has no sheltering, is too high.
//! * Height noise counts as roughness.
//! * lambda_f of opposite winds differs by the mean slope between them, which is zero on a complete plot. Where it does differ,
//!   holes hide one side of the obstacles (scanner shadows), or a wave longer than the plot remains.
//!
//! Cost: one pass over the cells for lambda_f and one for f, times the number of directions; two copies of the grid.

mod block;
mod crossings;
mod formulas;
mod partition;
#[cfg(test)]
mod tests;

pub use formulas::{lettau_z0_m, macdonald_displacement, macdonald_z0_m, munro_z0_m};

use crate::background::{AtPartial, BoxWindow, background_of};
use crate::band::FILLED_SHARE_MIN;
use crate::plane::level;
use block::Sums;
use rayon::prelude::*;
use sastrugi_numeric::{Grid, ops, sums};
use serde::{Deserialize, Serialize};

/// Frontal-area index above which obstacles shelter one another: the middle of the 0.2 to 0.3 of Macdonald et al. (1998).
const SHELTERING_INDEX: f64 = 0.25;
/// Fewest cells across the window of the moving average.
const OUTER_CELLS_MIN: usize = 3;

/// Effective obstacle height of a continuous surface in the formulas of Lettau and Macdonald et al. (Munro's always uses
/// [`ObstacleHeight::TwoSigma`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObstacleHeight {
    /// Twice the standard deviation of the detrended heights (Munro 1989).
    #[default]
    TwoSigma,
    /// Mean of the detrended heights above zero (after Smith et al. 2016).
    MeanAbove,
}

/// Wind directions, detrending and obstacle height.
#[derive(Clone, Debug, PartialEq)]
pub struct WindSettings {
    /// Azimuths that the wind blows from, degrees clockwise from grid north.
    pub azimuths_deg: Vec<f64>,
    /// Width of the moving average subtracted after the plane, m; `None` subtracts only the plane.
    pub outer_scale_m: Option<f64>,
    /// Definition of the obstacle height.
    pub obstacle_height: ObstacleHeight,
}

impl WindSettings {
    /// Wind from `count` directions, equally spaced from north.
    pub fn sectors(count: u16) -> Self {
        let step_deg = 360.0 / f64::from(count.max(1));
        let azimuths_deg = (0..count).map(|k| f64::from(k) * step_deg).collect();
        Self { azimuths_deg, outer_scale_m: None, obstacle_height: ObstacleHeight::default() }
    }
}

/// Invalid settings for aerodynamic roughness.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WindError {
    /// No azimuth was given.
    #[error("at least one wind direction is required")]
    NoDirection,
    /// An azimuth is not finite.
    #[error("wind direction must be a finite number of degrees, got {azimuth_deg}")]
    Azimuth {
        /// Offending value, degrees.
        azimuth_deg: f64,
    },
    /// The outer scale is not a positive, finite length.
    #[error("outer scale must be a positive length, got {outer_scale_m} m")]
    OuterScale {
        /// Offending value, m.
        outer_scale_m: f64,
    },
    /// The outer scale does not span enough cells.
    #[error("an outer scale of {outer_scale_m} m is too narrow: it must span at least 3 cells ({needed_m} m)")]
    Narrow {
        /// Offending value, m.
        outer_scale_m: f64,
        /// Width of three cells, m.
        needed_m: f64,
    },
    /// The moving average is undefined everywhere.
    #[error(
        "an outer scale of {outer_scale_m} m is too wide for a surface of {x_m} x {y_m} m: no window is more than half full"
    )]
    Wide {
        /// Offending value, m.
        outer_scale_m: f64,
        /// Extent east-west, m.
        x_m: f64,
        /// Extent north-south, m.
        y_m: f64,
    },
}

/// Measures for one wind direction, or their means over several. NaN where undefined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WindMeasures {
    /// Frontal-area index lambda_f.
    pub frontal_area_index: f64,
    /// Upcrossings of the mean level per metre along the wind, 1/m.
    pub upcrossings_per_m: f64,
    /// z0 after Lettau (1969), m.
    pub z0_lettau_m: f64,
    /// z0 after Munro (1989), m.
    pub z0_munro_m: f64,
    /// z0 after Macdonald et al. (1998), m.
    pub z0_macdonald_m: f64,
}

impl WindMeasures {
    fn from_array(values: [f64; 5]) -> Self {
        let [frontal_area_index, upcrossings_per_m, z0_lettau_m, z0_munro_m, z0_macdonald_m] = values;
        Self { frontal_area_index, upcrossings_per_m, z0_lettau_m, z0_munro_m, z0_macdonald_m }
    }

    fn to_array(self) -> [f64; 5] {
        [self.frontal_area_index, self.upcrossings_per_m, self.z0_lettau_m, self.z0_munro_m, self.z0_macdonald_m]
    }
}

/// Measures with their standard errors over blocks of the raster.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WindEstimate {
    /// The measures.
    #[serde(flatten)]
    pub measures: WindMeasures,
    /// Standard errors; NaN with fewer than two blocks of data.
    pub standard_errors: WindMeasures,
}

/// Measures for one wind direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WindDirection {
    /// Azimuth that the wind blows from, degrees clockwise from grid north, in [0, 360).
    pub azimuth_deg: f64,
    /// Measures for this direction, with standard errors.
    #[serde(flatten)]
    pub estimate: WindEstimate,
}

/// Aerodynamic roughness of a surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AerodynamicRoughness {
    /// Cell size, east-west and north-south, m.
    pub cell_m: [f64; 2],
    /// Actual width of the moving average, east-west and north-south, m; `None` if only the plane was subtracted.
    pub outer_scale_m: Option<[f64; 2]>,
    /// Standard deviation of the detrended heights, m.
    pub sigma_m: f64,
    /// Definition of the obstacle height.
    pub obstacle_height: ObstacleHeight,
    /// Obstacle height h*, m.
    pub obstacle_height_m: f64,
    /// Number of raster blocks with data, over which standard errors are computed.
    pub blocks: usize,
    /// One entry for each direction, in the order given.
    pub directions: Vec<WindDirection>,
    /// Arithmetic means over these directions.
    pub mean: WindEstimate,
    /// Caveats.
    pub notes: Vec<String>,
}

/// Aerodynamic roughness of a DEM by wind direction.
///
/// # Errors
/// No direction; a direction that is not finite; an outer scale that is not positive and finite, spans fewer than 3 cells, or
/// is too wide for the surface.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::{WindSettings, aerodynamic_roughness};
///
/// // Ridges 2 m apart that run from north to south, 2 cm high: wind from the east meets faces of 2 cm every 2 m, wind from the north none.
/// let zigzag = |k: usize| if k % 40 < 20 { k % 40 } else { 40 - k % 40 };
/// let dem = Grid::new(Geometry::square(41, 81, 0.05), (0..41 * 81).map(|k| 0.001 * zigzag(k % 81) as f64).collect());
/// let settings = WindSettings { azimuths_deg: vec![90.0, 0.0], ..WindSettings::sectors(1) };
/// let found = aerodynamic_roughness(&dem, &settings)?;
/// let [east, north] = [0, 1].map(|k| found.directions[k].estimate.measures);
/// assert!((east.frontal_area_index - 0.01).abs() < 1e-9 && north.frontal_area_index < 1e-9);
/// assert!((east.z0_lettau_m - 0.5 * found.obstacle_height_m * 0.01).abs() < 1e-9);
/// # Ok::<(), sastrugi_roughness::WindError>(())
/// ```
pub fn aerodynamic_roughness(dem: &Grid, settings: &WindSettings) -> Result<AerodynamicRoughness, WindError> {
    let winds = winds(&settings.azimuths_deg)?;
    let (surface, outer_scale_m) = detrended(dem, settings.outer_scale_m)?;
    let blocks = block::sums_of(&surface, &winds);
    let blocks: Vec<Sums> = blocks.into_iter().filter(Sums::has_data).collect();
    let total = Sums::without(&blocks, None, winds.len());
    let measures_of = |sums: &Sums| measures(sums, settings.obstacle_height);
    let all = measures_of(&total);
    let others: Vec<_> = (0..blocks.len())
        .into_par_iter()
        .map(|left_out| measures_of(&Sums::without(&blocks, Some(left_out), winds.len())))
        .collect();
    let estimate = |k: usize| WindEstimate {
        measures: all[k],
        standard_errors: jackknife(&others.iter().map(|measures| measures[k]).collect::<Vec<_>>()),
    };
    let directions: Vec<WindDirection> = winds
        .iter()
        .enumerate()
        .map(|(k, wind)| WindDirection { azimuth_deg: wind.azimuth_deg, estimate: estimate(k) })
        .collect();
    let mut roughness = AerodynamicRoughness {
        cell_m: dem.geometry.cell,
        outer_scale_m,
        sigma_m: total.sigma_m(),
        obstacle_height: settings.obstacle_height,
        obstacle_height_m: total.obstacle_height_m(settings.obstacle_height),
        blocks: blocks.len(),
        directions,
        mean: estimate(winds.len()),
        notes: Vec::new(),
    };
    roughness.notes = notes(&roughness);
    Ok(roughness)
}

/// A wind direction.
#[derive(Clone, Copy, Debug)]
struct Wind {
    azimuth_deg: f64,
    sin: f64,
    cos: f64,
}

fn winds(azimuths_deg: &[f64]) -> Result<Vec<Wind>, WindError> {
    if azimuths_deg.is_empty() {
        return Err(WindError::NoDirection);
    }
    let wind = |&given: &f64| {
        if !given.is_finite() {
            return Err(WindError::Azimuth { azimuth_deg: given });
        }
        // `rem_euclid` turns a tiny negative azimuth into 360, which is north.
        let azimuth_deg = Some(given.rem_euclid(360.0)).filter(|&a| a < 360.0).unwrap_or(0.0);
        let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
        Ok(Wind { azimuth_deg, sin, cos })
    };
    azimuths_deg.iter().map(wind).collect()
}

/// Heights above the plane, and above the moving average if one is given, with mean 0; and the actual width of that average.
fn detrended(dem: &Grid, outer_scale_m: Option<f64>) -> Result<(Grid, Option<[f64; 2]>), WindError> {
    let levelled = level(dem);
    let Some(outer_scale_m) = outer_scale_m else { return Ok((centred(&levelled), None)) };
    if !(outer_scale_m > 0.0 && outer_scale_m.is_finite()) {
        return Err(WindError::OuterScale { outer_scale_m });
    }
    let cell = dem.geometry.cell;
    let window = BoxWindow::nearest(outer_scale_m, cell);
    if window.cells().iter().any(|&cells| cells < OUTER_CELLS_MIN) {
        let needed_m = OUTER_CELLS_MIN as f64 * cell[0].max(cell[1]);
        return Err(WindError::Narrow { outer_scale_m, needed_m });
    }
    let average = background_of(&levelled, window, AtPartial::Plane, FILLED_SHARE_MIN);
    let left = ops::combine(&levelled, &average, |z, mean| z - mean);
    if left.finite_count() == 0 && levelled.finite_count() > 0 {
        let [x_m, y_m] = dem.geometry.size();
        return Err(WindError::Wide { outer_scale_m, x_m, y_m });
    }
    Ok((centred(&left), Some(window.size_m(cell))))
}

fn centred(surface: &Grid) -> Grid {
    let mean = sums::mean(&sums::finite(&surface.values));
    surface.map(|z| z - mean)
}

/// Measures for each direction, followed by their means.
fn measures(sums: &Sums, obstacle_height: ObstacleHeight) -> Vec<WindMeasures> {
    let (height_m, two_sigma_m) = (sums.obstacle_height_m(obstacle_height), 2.0 * sums.sigma_m());
    let of_direction = |k: usize| {
        let (frontal_area_index, upcrossings_per_m) = (sums.frontal_area_index(k), sums.upcrossings_per_m(k));
        WindMeasures {
            frontal_area_index,
            upcrossings_per_m,
            z0_lettau_m: lettau_z0_m(height_m, frontal_area_index),
            z0_munro_m: munro_z0_m(two_sigma_m, upcrossings_per_m),
            z0_macdonald_m: macdonald_z0_m(height_m, frontal_area_index, frontal_area_index),
        }
    };
    let mut rows: Vec<WindMeasures> = (0..sums.directions.len()).map(of_direction).collect();
    rows.push(each(&rows, sums::mean));
    rows
}

/// Applies a statistic to each measure.
fn each(rows: &[WindMeasures], statistic: impl Fn(&[f64]) -> f64) -> WindMeasures {
    let column = |k: usize| rows.iter().map(|row| row.to_array()[k]).collect::<Vec<f64>>();
    WindMeasures::from_array(std::array::from_fn(|k| statistic(&column(k))))
}

/// Standard errors from the measures with each block left out in turn: `sqrt((n - 1) / n sum (t_i - mean t)^2)`.
fn jackknife(others: &[WindMeasures]) -> WindMeasures {
    let factor = if others.len() < 2 { f64::NAN } else { others.len() as f64 - 1.0 };
    each(others, |values| (factor * sums::variance(values)).sqrt())
}

fn notes(roughness: &AerodynamicRoughness) -> Vec<String> {
    let [x_m, y_m] = roughness.cell_m;
    let reference = match roughness.outer_scale_m {
        Some([x_m, y_m]) => format!("a moving average over {x_m:.4} x {y_m:.4} m"),
        None => "the least-squares plane alone".to_owned(),
    };
    let mut notes = vec![format!(
        "z0 holds for cells of {x_m:.4} x {y_m:.4} m and heights above {reference}: finer cells raise lambda_f, a wider outer scale raises h*"
    )];
    let indices = roughness.directions.iter().map(|direction| direction.estimate.measures.frontal_area_index);
    let largest = indices.fold(f64::NAN, f64::max);
    if largest > SHELTERING_INDEX {
        notes.push(format!(
            "lambda_f reaches {largest:.2}: above about {SHELTERING_INDEX}, obstacles shelter one another and Lettau's z0 is too high"
        ));
    }
    if roughness.sigma_m.is_nan() {
        notes.push("z0 is undefined: no cells with data are left after detrending".to_owned());
    } else if largest.is_nan() {
        notes.push("lambda_f is undefined: it requires a 2 x 2 group of cells with data".to_owned());
    } else if roughness.blocks < 2 {
        notes.push("no standard errors: only one block of the raster has data".to_owned());
    }
    notes
}
