//! Parameters of a trail.

use super::Trail;
use super::bed::{Bed, Ruts};
use sastrugi_numeric::Geometry;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Extra cost of a metre on the least favoured ground, which costs 1 plus this (our choice).
const DEFAULT_ATTRACTION: f64 = 20.0;
/// Semi-axes of a loop over the sides of the surface (MAVS `surface.cpp`: 0.4).
const DEFAULT_LOOP_SHARE: f64 = 0.4;
/// How far a loop wanders in or out, over its semi-axes (our choice).
const DEFAULT_LOOP_WANDER_SHARE: f64 = 0.1;
/// Turning radius over wheelbase: a steering angle of 27 deg (our choice).
const TURNING_RADIUS_WHEELBASES: f64 = 2.0;
/// Border over the diagonal, and its minimum, m (MAVS `surface.cpp`).
const BORDER_SHARE: f64 = 0.02;
const BORDER_MIN_M: f64 = 3.0;
/// Width of a berm over that of a tyre (our choice).
const BERM_TYRES: f64 = 2.0;
/// Maximum number of points of a centre line.
const POINTS_MAX: f64 = 1e5;

/// What a trail follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Follows {
    /// High ground, from the south-western to the north-eastern corner.
    #[default]
    Ridges,
    /// Low ground, between the same corners.
    Valleys,
    /// A closed curve about the centre, over gentle slopes.
    Loop,
}

/// A vehicle trail: a bed at smoothed height with two ruts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, expecting = "a trail, given as a table")]
pub struct RawTrail {
    /// What the trail follows (MAVS: ridges).
    pub follows: Follows,
    /// Width within which heights change, m, at least two cells.
    #[schemars(transform = limits::positive)]
    pub width_m: f64,
    /// Width on either side, within `width_m`, over which the bed blends into the ground, m.
    #[schemars(transform = limits::positive)]
    pub shoulder_m: f64,
    /// Standard deviation of the Gaussian that smooths the bed's height along the trail, m; 0 keeps the ground's own height.
    #[schemars(transform = limits::not_negative)]
    pub smoothing_m: f64,
    /// Distance between the centres of the two ruts, m.
    #[schemars(transform = limits::positive)]
    pub track_m: f64,
    /// Width of the ruts' level bottom, m.
    #[schemars(transform = limits::positive)]
    pub tyre_width_m: f64,
    /// Depth of the ruts below the bed after one pass, m.
    #[schemars(transform = limits::not_negative)]
    pub rut_depth_m: f64,
    /// Number of vehicle passes; 0 leaves the bed without ruts.
    pub passes: u32,
    /// The depth grows as `passes^(1 / multipass_coefficient)`; 1 or above, larger for denser soil (our choice: 3).
    #[schemars(transform = limits::half_open(1.0, f64::INFINITY))]
    pub multipass_coefficient: f64,
    /// Width of the berm on either side of a rut, m; by default twice the tyre width.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub berm_width_m: Option<f64>,
    /// Share of the ruts' volume that the berms hold, 0 to 1; the rest is compacted.
    #[schemars(transform = limits::within(0.0, 1.0))]
    pub berm_share: f64,
    /// Wheelbase of the vehicle that made the trail, m.
    #[schemars(transform = limits::positive)]
    pub wheelbase_m: f64,
    /// Smallest radius of the centre line, m; by default two wheelbases.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub turning_radius_m: Option<f64>,
    /// Minimum distance of the centre line from the edges, m; by default the largest of 3 m, 2 % of the diagonal, and half the
    /// width plus one cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub border_m: Option<f64>,
    /// For `ridges` and `valleys`: extra cost of a metre on the least favoured ground, where the most favoured costs 1; 20 by
    /// default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::not_negative)]
    pub attraction: Option<f64>,
    /// For `loop`: semi-axes over the sides of the surface; 0.4 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::between(0.0, 0.5))]
    pub loop_share: Option<f64>,
    /// For `loop`: how far it wanders in or out, over its semi-axes; 0.1 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::half_open(0.0, 1.0))]
    pub loop_wander_share: Option<f64>,
}

impl Default for RawTrail {
    fn default() -> Self {
        Self {
            follows: Follows::Ridges,
            width_m: 4.0,
            shoulder_m: 0.75,
            smoothing_m: 3.0,
            track_m: 1.6,
            tyre_width_m: 0.25,
            rut_depth_m: 0.05,
            passes: 1,
            multipass_coefficient: 3.0,
            berm_width_m: None,
            berm_share: 1.0,
            wheelbase_m: 2.7,
            turning_radius_m: None,
            border_m: None,
            attraction: None,
            loop_share: None,
            loop_wander_share: None,
        }
    }
}

/// How the centre line is found.
#[derive(Clone, Copy)]
pub(super) enum Course {
    Path { favours_high: bool, attraction: f64 },
    Loop { share: f64, wander_share: f64 },
}

impl Trail {
    /// Checks a trail for a surface.
    ///
    /// # Errors
    /// A [`ParameterError`] for a number out of range, or a trail that does not fit the surface.
    pub(in super::super) fn new(raw: &RawTrail, geometry: &Geometry) -> Result<Self, ParameterError> {
        let mut raw = raw.clone();
        refuse_foreign_keys(&raw)?;
        let cell_m = geometry.cell[0];
        if !(raw.width_m.is_finite() && raw.width_m >= 2.0 * cell_m) {
            let message = format!("is {}; it must be at least two cells, {cell_m} m each", raw.width_m);
            return Err(ParameterError::new("width_m", message));
        }
        let bed = bed(&mut raw)?;
        let turning_radius_m = turning_radius_m(&mut raw, geometry)?;
        let border_m = border_m(&mut raw, geometry)?;
        let course = course(&mut raw, geometry, turning_radius_m, border_m)?;
        Ok(Self { course, bed, turning_radius_m, border_m, width_m: raw.width_m, parameters: raw })
    }
}

/// Refuses keys of other courses, which would have no effect.
fn refuse_foreign_keys(raw: &RawTrail) -> Result<(), ParameterError> {
    let closed = raw.follows == Follows::Loop;
    let given = [
        ("attraction", raw.attraction.is_some(), !closed),
        ("loop_share", raw.loop_share.is_some(), closed),
        ("loop_wander_share", raw.loop_wander_share.is_some(), closed),
    ];
    match given.into_iter().find(|(_, given, taken)| *given && !*taken) {
        Some((key, ..)) if closed => {
            Err(ParameterError::new(key, "is not used by a trail with `follows = \"loop\"`; remove it"))
        }
        Some((key, ..)) => {
            Err(ParameterError::new(key, "is only used by a trail with `follows = \"loop\"`; remove it"))
        }
        None => Ok(()),
    }
}

fn bed(raw: &mut RawTrail) -> Result<Bed, ParameterError> {
    let half_width_m = 0.5 * raw.width_m;
    let shoulder_m = ParameterError::positive("shoulder_m", raw.shoulder_m)?;
    if shoulder_m > half_width_m {
        let message = format!("is {shoulder_m}; it must be at most half the width, {half_width_m} m");
        return Err(ParameterError::new("shoulder_m", message));
    }
    let smoothing_m = ParameterError::not_negative("smoothing_m", raw.smoothing_m)?;
    Ok(Bed { half_width_m, shoulder_m, smoothing_m, ruts: ruts(raw)? })
}

fn ruts(raw: &mut RawTrail) -> Result<Ruts, ParameterError> {
    let track_m = ParameterError::positive("track_m", raw.track_m)?;
    let tyre_width_m = ParameterError::positive("tyre_width_m", raw.tyre_width_m)?;
    let once_m = ParameterError::not_negative("rut_depth_m", raw.rut_depth_m)?;
    let berm_width_m = *raw.berm_width_m.get_or_insert(BERM_TYRES * tyre_width_m);
    ParameterError::positive("berm_width_m", berm_width_m)?;
    if !(0.0..=1.0).contains(&raw.berm_share) {
        return Err(ParameterError::new("berm_share", format!("is {}; it must lie in 0 to 1", raw.berm_share)));
    }
    if !(raw.multipass_coefficient.is_finite() && raw.multipass_coefficient >= 1.0) {
        let message = format!("is {}; it must be 1 or above", raw.multipass_coefficient);
        return Err(ParameterError::new("multipass_coefficient", message));
    }
    let passes = libm::pow(f64::from(raw.passes), 1.0 / raw.multipass_coefficient);
    let ruts = Ruts { track_m, tyre_width_m, depth_m: once_m * passes, berm_width_m, berm_share: raw.berm_share };
    let (reach_m, apart_m) = (0.5 * track_m + ruts.reach_m(), track_m - ruts.wall_m() - ruts.reach_m());
    if apart_m < 0.0 {
        let least_m = ruts.wall_m() + ruts.reach_m();
        let message = format!("is {track_m}; with their berms, the ruts need a track of at least {least_m} m");
        return Err(ParameterError::new("track_m", message));
    }
    if reach_m > 0.5 * raw.width_m {
        let message = format!("is {}; ruts and berms need at least {} m", raw.width_m, 2.0 * reach_m);
        return Err(ParameterError::new("width_m", message));
    }
    Ok(ruts)
}

fn turning_radius_m(raw: &mut RawTrail, geometry: &Geometry) -> Result<f64, ParameterError> {
    let wheelbase_m = ParameterError::positive("wheelbase_m", raw.wheelbase_m)?;
    let radius_m = *raw.turning_radius_m.get_or_insert(TURNING_RADIUS_WHEELBASES * wheelbase_m);
    let [width_m, height_m] = geometry.size();
    let least_m = (0.5 * raw.width_m).max(2.0 * (width_m + height_m) * super::curve::POINTS_PER_RADIUS / POINTS_MAX);
    if radius_m.is_finite() && radius_m >= least_m {
        return Ok(radius_m);
    }
    let message =
        format!("is {radius_m}; it must be at least {least_m} m for a trail of this width on a surface of this size");
    Err(ParameterError::new("turning_radius_m", message))
}

fn border_m(raw: &mut RawTrail, geometry: &Geometry) -> Result<f64, ParameterError> {
    let [width_m, height_m] = geometry.size();
    let least_m = 0.5 * raw.width_m + geometry.cell[0];
    let usual_m = BORDER_MIN_M.max(BORDER_SHARE * (width_m * width_m + height_m * height_m).sqrt()).max(least_m);
    let border_m = *raw.border_m.get_or_insert(usual_m);
    let most_m = 0.5 * (width_m.min(height_m) - raw.width_m);
    if border_m >= least_m && border_m <= most_m {
        return Ok(border_m);
    }
    let message = format!(
        "is {border_m}; it must be {least_m} to {most_m} m to keep the trail inside the surface; a larger surface or \
         a narrower trail leaves more room"
    );
    Err(ParameterError::new("border_m", message))
}

fn course(
    raw: &mut RawTrail,
    geometry: &Geometry,
    turning_radius_m: f64,
    border_m: f64,
) -> Result<Course, ParameterError> {
    if raw.follows != Follows::Loop {
        let attraction = *raw.attraction.get_or_insert(DEFAULT_ATTRACTION);
        ParameterError::not_negative("attraction", attraction)?;
        return Ok(Course::Path { favours_high: raw.follows == Follows::Ridges, attraction });
    }
    let share = *raw.loop_share.get_or_insert(DEFAULT_LOOP_SHARE);
    let wander_share = *raw.loop_wander_share.get_or_insert(DEFAULT_LOOP_WANDER_SHARE);
    ParameterError::between("loop_share", share, 0.0, 0.5)?;
    if !(0.0..1.0).contains(&wander_share) {
        let message = format!("is {wander_share}; it must be at least 0 and below 1");
        return Err(ParameterError::new("loop_wander_share", message));
    }
    let size = geometry.size();
    let (short_m, long_m) = (size[0].min(size[1]), size[0].max(size[1]));
    // An ellipse is tightest at the ends of its major axis, with radius b^2 / a.
    let tightest_m = (1.0 - wander_share) * share * short_m * short_m / long_m;
    let room = (0.5 * short_m - border_m) / (share * short_m);
    if tightest_m < turning_radius_m || room < 1.0 {
        let message = format!(
            "is {share}: the loop's smallest radius is {tightest_m:.2} m and its distance from the edge {:.2} m; they must be at least \
             the turning radius, {turning_radius_m} m, and the border, {border_m} m",
            (0.5 - share) * short_m
        );
        return Err(ParameterError::new("loop_share", message));
    }
    Ok(Course::Loop { share, wander_share })
}
