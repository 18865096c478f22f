//! Parameters of a rover and of its trial, as written in a study.

use super::motion::NoiseParameters;
use super::policies::{Policy, SchoppersLike, SchoppersRules, SojournerLike, SojournerRules};
use super::pose::Chassis;
use super::sensing::{RaySensor, RectangleSensor, Sensor};
use super::starts::{self, Disk, Facing, Start};
use super::trial::Task;
use sastrugi_numeric::Streams;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of rovers of a trial: their ids have four digits.
const ROVERS_MAX: u32 = 9999;
/// Largest length of a body, its sensor or a step, m.
const LENGTH_MAX_M: f64 = 20.0;
/// Largest scale.
const SCALE_MAX: f64 = 10.0;
/// Maximum number of rays or rectangles along a side of a sensor.
const PARTS_MAX: usize = 64;

/// The Sojourner-like navigator: senses along rays, turns away from hazards and back to the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SojournerParameters {
    /// Scale factor of all lengths of body, sensor and drives. It does not apply to the hazard heights, the clearance, the
    /// goal tolerance and the distance limit.
    #[schemars(transform = limits::between(0.0, SCALE_MAX))]
    pub scale: f64,
    /// Distance of the axles from the centre, m (our choice, approximately that of the flight rover).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub axle_m: f64,
    /// Distance of the wheels from the centre line, m (our choice).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub track_m: f64,
    /// Distance of the nose ahead of the centre, m (our choice).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub nose_m: f64,
    /// Height of the sensor above the plane of the wheel contacts, m (our choice).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub sensor_height_m: f64,
    /// Lateral offsets of the ray columns from the centre line, left positive, from left to right, m (the paper: 20 rays; their
    /// positions are our choice).
    #[schemars(length(min = 1, max = PARTS_MAX))]
    pub columns_m: Vec<f64>,
    /// Distances beyond the nose at which the rays of a column are aimed, m (our choice).
    #[schemars(length(min = 1, max = PARTS_MAX), transform = limits::positive)]
    pub rows_m: Vec<f64>,
    /// Hazard height, m (our choice: the wheel radius).
    #[schemars(transform = limits::positive)]
    pub hazard_step_m: f64,
    /// Largest height difference in a view without a hazard, m (our choice: the wheel diameter).
    #[schemars(transform = limits::positive)]
    pub hazard_span_m: f64,
    /// Largest tilt, deg (our choice).
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub tilt_max_deg: f64,
    /// Turn per cycle, deg (our choice).
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub turn_deg: f64,
    /// Standard deviation of a turn away from a hazard, rad (our choice).
    #[schemars(transform = limits::not_negative)]
    pub turn_noise_rad: f64,
    /// Distance driven straight on after a hazard, m (our choice).
    #[schemars(transform = limits::not_negative)]
    pub pass_m: f64,
    /// Distance driven per cycle, m (the paper: at most the wheel radius, 65 mm).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub step_m: f64,
    /// Bearing error to the goal that is not corrected, rad (our choice).
    #[schemars(transform = limits::not_negative)]
    pub bearing_tolerance_rad: f64,
    /// Distance from the goal within which a rover has arrived, whatever its `scale`, m (our choice).
    #[schemars(transform = limits::positive)]
    pub goal_tolerance_m: f64,
    /// Height above the sand over which a rock under the rover counts as a contact, m (our choice: the wheel diameter).
    #[schemars(transform = limits::positive)]
    pub clearance_m: f64,
    /// Largest distance driven, m (our choice; the longest in the paper: 902.5).
    #[schemars(transform = limits::positive)]
    pub distance_limit_m: f64,
    /// Maximum number of cycles (our choice).
    #[schemars(range(min = 1))]
    pub cycle_limit: u32,
}

impl Default for SojournerParameters {
    fn default() -> Self {
        Self {
            scale: 1.0,
            axle_m: 0.25,
            track_m: 0.20,
            nose_m: 0.32,
            sensor_height_m: 0.25,
            columns_m: vec![0.30, 0.15, 0.0, -0.15, -0.30],
            rows_m: vec![0.10, 0.20, 0.30, 0.45],
            hazard_step_m: 0.065,
            hazard_span_m: 0.13,
            tilt_max_deg: 30.0,
            turn_deg: 15.0,
            turn_noise_rad: 0.03,
            pass_m: 0.5,
            step_m: 0.065,
            bearing_tolerance_rad: 0.12,
            goal_tolerance_m: 0.5,
            clearance_m: 0.13,
            distance_limit_m: 1500.0,
            cycle_limit: 60_000,
        }
    }
}

/// The Schoppers-like navigator: perfect sensing classifies four rectangles as safe or unsafe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SchoppersParameters {
    /// Scale factor of all lengths of body, sensor and drives, including `progress_m`. It does not apply to the clearance, the
    /// goal tolerance and the distance limit.
    #[schemars(transform = limits::between(0.0, SCALE_MAX))]
    pub scale: f64,
    /// Distance of the axles from the centre, m (our choice).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub axle_m: f64,
    /// Distance of the wheels from the centre line, m (our choice).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub track_m: f64,
    /// Distance of the near edge of the sensor ahead of the centre, m (our choice).
    #[schemars(transform = limits::not_negative)]
    pub sensor_near_m: f64,
    /// Length of the sensed area, m (the paper: 1).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub sensor_length_m: f64,
    /// Total width of the sensed area, m (the paper: 2).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub sensor_width_m: f64,
    /// Rectangles of the sensor, side by side, at least 2 (the paper: 4).
    #[schemars(range(min = 2, max = PARTS_MAX))]
    pub rectangles: u32,
    /// Height above the sand over which a rock makes a rectangle unsafe, and counts as a contact under the rover, m (our choice:
    /// the wheel diameter).
    #[schemars(transform = limits::positive)]
    pub clearance_m: f64,
    /// Steepest safe sand, deg (our choice).
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub slope_max_deg: f64,
    /// Largest tilt of the rover itself, deg (our choice).
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub tilt_max_deg: f64,
    /// Turn per cycle, deg (our choice).
    #[schemars(transform = limits::between(0.0, 90.0))]
    pub turn_deg: f64,
    /// Distance driven per cycle, m (our choice).
    #[schemars(transform = limits::between(0.0, LENGTH_MAX_M))]
    pub step_m: f64,
    /// Bearing error below which it turns to the goal even if the outer rectangle on that side is unsafe, rad (our choice).
    #[schemars(transform = limits::not_negative)]
    pub bearing_tolerance_rad: f64,
    /// Commitment: distance driven after turning away before it turns to the goal again, m (our choice).
    #[schemars(transform = limits::positive)]
    pub commit_m: f64,
    /// Growth factor of the commitment after a full turn without finding a way (our choice).
    #[schemars(transform = limits::half_open(1.0, f64::INFINITY))]
    pub commit_growth: f64,
    /// Largest commitment, m (our choice).
    #[schemars(transform = limits::positive)]
    pub commit_max_m: f64,
    /// Progress towards the goal after which the commitment is reset to `commit_m`, m (our choice).
    #[schemars(transform = limits::positive)]
    pub progress_m: f64,
    /// Distance from the goal within which a rover has arrived, whatever its `scale`, m (our choice).
    #[schemars(transform = limits::positive)]
    pub goal_tolerance_m: f64,
    /// Largest distance driven, m (our choice).
    #[schemars(transform = limits::positive)]
    pub distance_limit_m: f64,
    /// Maximum number of cycles (our choice).
    #[schemars(range(min = 1))]
    pub cycle_limit: u32,
}

impl Default for SchoppersParameters {
    fn default() -> Self {
        Self {
            scale: 1.0,
            axle_m: 0.25,
            track_m: 0.20,
            sensor_near_m: 0.3,
            sensor_length_m: 1.0,
            sensor_width_m: 2.0,
            rectangles: 4,
            clearance_m: 0.13,
            slope_max_deg: 25.0,
            tilt_max_deg: 30.0,
            turn_deg: 10.0,
            step_m: 0.1,
            bearing_tolerance_rad: 0.05,
            commit_m: 0.6,
            commit_growth: 1.5,
            commit_max_m: 8.0,
            progress_m: 1.0,
            goal_tolerance_m: 0.5,
            distance_limit_m: 1000.0,
            cycle_limit: 20_000,
        }
    }
}

/// The planner for comparison: it searches a path over the ground seen so far by its sensor, and knows nothing else.
#[derive(Clone, Debug, Serialize)]
pub struct PlannerParameters {
    /// The navigator whose body and sensor it uses; that navigator's rules do not apply.
    #[serde(flatten)]
    pub eyes: PlannerEyes,
    /// The map on which it plans.
    #[serde(flatten)]
    pub map: PlannerMap,
    /// Its search, implemented outside this module.
    #[serde(skip)]
    pub mind: fn(&PlannerParameters) -> Box<dyn Policy>,
}

/// Body and sensor of a planner.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PlannerEyes {
    /// Rays of the Sojourner-like navigator.
    Rays(SojournerParameters),
    /// Rectangles of the Schoppers-like navigator.
    Rectangles(SchoppersParameters),
}

/// Sensor of a planner, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlannerSensor {
    /// Rays of the Sojourner-like navigator.
    #[default]
    Rays,
    /// Rectangles of the Schoppers-like navigator.
    Rectangles,
}

/// The planner's map of the ground seen so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlannerMap {
    /// Sensor: that of the Sojourner-like or of the Schoppers-like navigator, with the body and limits of that navigator.
    #[serde(skip_serializing)]
    pub sensor: PlannerSensor,
    /// Cell size of its map, m (our choice: that of the oracle's map).
    #[schemars(transform = limits::positive)]
    pub map_cell_m: f64,
    /// Initial margin of its map around start and goal, m; the map grows if a path needs more (our choice).
    #[schemars(transform = limits::positive)]
    pub map_beyond_m: f64,
}

impl Default for PlannerMap {
    fn default() -> Self {
        Self { sensor: PlannerSensor::Rays, map_cell_m: 0.1, map_beyond_m: 10.0 }
    }
}

/// A navigator with its parameters.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Navigator {
    /// Rays.
    Sojourner(SojournerParameters),
    /// Rectangles.
    Schoppers(SchoppersParameters),
    /// A search over the ground seen so far.
    Planner(PlannerParameters),
}

/// Where rovers start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Starts {
    /// At equal angles on a circle about the common goal.
    #[default]
    Circle,
    /// At random points in a disk, with goals `distance_m` away in random directions; drawn again off the known ground.
    Drawn,
}

/// A trial: the parameters that do not depend on the navigator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RoverParameters {
    /// Rovers on each world, 1 to 9999 (the paper: 100).
    #[schemars(range(min = 1, max = ROVERS_MAX))]
    pub rovers: u32,
    /// Where they start.
    pub starts: Starts,
    /// Centre of the circle or disk, m; on a circle it is the goal.
    pub centre_m: [f64; 2],
    /// Radius of the circle or disk, m (the paper: 25).
    #[schemars(transform = limits::positive)]
    pub radius_m: f64,
    /// Distance from drawn starts to their goals, m.
    #[schemars(transform = limits::positive)]
    pub distance_m: f64,
    /// Which way rovers face at the start (our choice; rovers that face the goal do better).
    pub facing: Facing,
    /// Radius around starts and goals that is kept free of rocks, m (our choice); on planetary worlds only.
    #[schemars(transform = limits::not_negative)]
    pub clear_m: f64,
    /// Sample spacing of the ground, m (the paper: 0.02); on planetary worlds only, other terrains use their own cells.
    #[schemars(transform = limits::positive)]
    pub cell_m: f64,
    /// Driving speed, m/s (our choice).
    #[schemars(transform = limits::between(1e-5, 1e3))]
    pub speed_m_s: f64,
    /// Turn rate, deg/s (our choice).
    #[schemars(transform = limits::between(1e-3, 1e5))]
    pub turn_rate_deg_s: f64,
    /// Noise of sensing and motion.
    pub noise: NoiseParameters,
}

impl Default for RoverParameters {
    fn default() -> Self {
        Self {
            rovers: 100,
            starts: Starts::Circle,
            centre_m: [0.0; 2],
            radius_m: 25.0,
            distance_m: 40.0,
            facing: Facing::Drawn,
            clear_m: 0.6,
            cell_m: 0.02,
            speed_m_s: 0.01,
            turn_rate_deg_s: 7.0,
            noise: NoiseParameters::default(),
        }
    }
}

impl RoverParameters {
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        if !(1..=ROVERS_MAX).contains(&self.rovers) {
            return Err(ParameterError::new("rovers", format!("is {}; it must be 1 to {ROVERS_MAX}", self.rovers)));
        }
        if let Some(at) = self.centre_m.iter().find(|at| !at.is_finite()) {
            return Err(ParameterError::new("centre_m", format!("holds {at}; it must hold finite numbers")));
        }
        ParameterError::positive("radius_m", self.radius_m)?;
        ParameterError::positive("distance_m", self.distance_m)?;
        ParameterError::not_negative("clear_m", self.clear_m)?;
        ParameterError::positive("cell_m", self.cell_m)?;
        // Poses are sampled once a second.
        ParameterError::between("speed_m_s", self.speed_m_s, 1e-5, 1e3)?;
        ParameterError::between("turn_rate_deg_s", self.turn_rate_deg_s, 1e-3, 1e5)?;
        self.noise.check().map_err(|e| e.within("noise"))
    }

    /// Starts and goals, drawn from the streams. Drawn starts and goals lie on known ground if any such place is found.
    pub fn starts(&self, streams: &Streams, on_ground: impl Fn([f64; 2]) -> bool) -> Vec<Start> {
        let Self { rovers, centre_m, radius_m, distance_m, facing, .. } = *self;
        match self.starts {
            Starts::Circle => starts::on_circle(rovers, centre_m, radius_m, facing, streams),
            Starts::Drawn => {
                starts::drawn(rovers, &Disk { centre_m, radius_m, distance_m }, facing, streams, on_ground)
            }
        }
    }

    /// Starts and goals must be farther apart than the goal tolerance.
    ///
    /// # Errors
    /// A radius or distance within the goal tolerance.
    pub fn check_apart(&self, goal_tolerance_m: f64) -> Result<(), ParameterError> {
        let straight_m = self.straight_m();
        if straight_m > goal_tolerance_m {
            return Ok(());
        }
        let key = match self.starts {
            Starts::Circle => "radius_m",
            Starts::Drawn => "distance_m",
        };
        let message = format!(
            "is {straight_m} m; it must exceed `goal_tolerance_m`, {goal_tolerance_m} m, within which a rover has arrived"
        );
        Err(ParameterError::new(key, message))
    }

    /// Distance from starts to goals, m.
    pub fn straight_m(&self) -> f64 {
        match self.starts {
            Starts::Circle => self.radius_m,
            Starts::Drawn => self.distance_m,
        }
    }
}

fn all_positive(values: &[(&str, f64)]) -> Result<(), ParameterError> {
    values.iter().try_for_each(|(key, value)| ParameterError::positive(key, *value).map(|_| ()))
}

/// Checks lengths of a body, its sensor and its steps: they are limited by what samples and recordings can hold.
fn lengths(values: &[(&str, f64)]) -> Result<(), ParameterError> {
    values.iter().try_for_each(|(key, value)| ParameterError::between(key, *value, 0.0, LENGTH_MAX_M).map(|_| ()))
}

fn angle(key: &str, value_deg: f64) -> Result<(), ParameterError> {
    ParameterError::between(key, value_deg, 0.0, 90.0).map(|_| ())
}

/// Checks a list of 1 to 64 strictly monotone lengths.
fn monotone(key: &str, values: &[f64], rising: bool) -> Result<(), ParameterError> {
    let in_order = |w: &[f64]| if rising { w[0] < w[1] } else { w[0] > w[1] };
    let ordered = values.iter().all(|v| v.is_finite()) && values.windows(2).all(in_order);
    if ordered && (1..=PARTS_MAX).contains(&values.len()) {
        return Ok(());
    }
    let order = if rising { "increasing" } else { "decreasing" };
    Err(ParameterError::new(key, format!("must hold 1 to {PARTS_MAX} finite numbers in {order} order")))
}

fn cycles(limit: u32) -> Result<(), ParameterError> {
    if limit > 0 { Ok(()) } else { Err(ParameterError::new("cycle_limit", "is 0; it must be at least 1")) }
}

impl SojournerParameters {
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::between("scale", self.scale, 0.0, SCALE_MAX)?;
        lengths(&[
            ("axle_m", self.axle_m),
            ("track_m", self.track_m),
            ("nose_m", self.nose_m),
            ("sensor_height_m", self.sensor_height_m),
            ("step_m", self.step_m),
        ])?;
        all_positive(&[
            ("hazard_step_m", self.hazard_step_m),
            ("hazard_span_m", self.hazard_span_m),
            ("goal_tolerance_m", self.goal_tolerance_m),
            ("clearance_m", self.clearance_m),
            ("distance_limit_m", self.distance_limit_m),
        ])?;
        monotone("columns_m", &self.columns_m, false)?;
        monotone("rows_m", &self.rows_m, true)?;
        ParameterError::positive("rows_m.0", self.rows_m[0])?;
        let reach_m = self.columns_m.iter().chain(&self.rows_m).fold(0.0, |far: f64, at| far.max(at.abs()));
        if reach_m >= LENGTH_MAX_M {
            return Err(ParameterError::new(
                "rows_m",
                format!("and `columns_m` reach {reach_m} m; they must stay below {LENGTH_MAX_M} m"),
            ));
        }
        angle("tilt_max_deg", self.tilt_max_deg)?;
        angle("turn_deg", self.turn_deg)?;
        ParameterError::not_negative("turn_noise_rad", self.turn_noise_rad)?;
        ParameterError::not_negative("pass_m", self.pass_m)?;
        ParameterError::not_negative("bearing_tolerance_rad", self.bearing_tolerance_rad)?;
        cycles(self.cycle_limit)
    }

    fn sensor(&self) -> RaySensor {
        let scaled = |values: &[f64]| values.iter().map(|v| v * self.scale).collect();
        RaySensor {
            nose_m: self.nose_m * self.scale,
            behind_nose_m: 0.02 * self.scale,
            height_m: self.sensor_height_m * self.scale,
            columns_m: scaled(&self.columns_m),
            rows_m: scaled(&self.rows_m),
            step_m: self.hazard_step_m,
            span_m: self.hazard_span_m,
            tilt_max_rad: self.tilt_max_deg.to_radians(),
        }
    }

    fn rules(&self) -> SojournerRules {
        SojournerRules {
            goal_tolerance_m: self.goal_tolerance_m,
            turn_rad: self.turn_deg.to_radians(),
            turn_noise_rad: self.turn_noise_rad,
            pass_m: self.pass_m * self.scale,
            step_m: self.step_m * self.scale,
            bearing_tolerance_rad: self.bearing_tolerance_rad,
        }
    }
}

impl SchoppersParameters {
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        ParameterError::between("scale", self.scale, 0.0, SCALE_MAX)?;
        lengths(&[
            ("axle_m", self.axle_m),
            ("track_m", self.track_m),
            ("sensor_length_m", self.sensor_length_m),
            ("sensor_width_m", self.sensor_width_m),
            ("step_m", self.step_m),
        ])?;
        all_positive(&[
            ("clearance_m", self.clearance_m),
            ("commit_m", self.commit_m),
            ("commit_max_m", self.commit_max_m),
            ("progress_m", self.progress_m),
            ("goal_tolerance_m", self.goal_tolerance_m),
            ("distance_limit_m", self.distance_limit_m),
        ])?;
        ParameterError::not_negative("sensor_near_m", self.sensor_near_m)?;
        if !(2..=PARTS_MAX as u32).contains(&self.rectangles) {
            let message = format!("is {}; it must be 2 to {PARTS_MAX}", self.rectangles);
            return Err(ParameterError::new("rectangles", message));
        }
        angle("slope_max_deg", self.slope_max_deg)?;
        angle("tilt_max_deg", self.tilt_max_deg)?;
        angle("turn_deg", self.turn_deg)?;
        ParameterError::not_negative("bearing_tolerance_rad", self.bearing_tolerance_rad)?;
        if !(self.commit_growth >= 1.0 && self.commit_growth.is_finite()) {
            let message = format!("is {}; it must be a finite number of at least 1", self.commit_growth);
            return Err(ParameterError::new("commit_growth", message));
        }
        cycles(self.cycle_limit)
    }

    fn sensor(&self) -> RectangleSensor {
        RectangleSensor {
            near_m: self.sensor_near_m * self.scale,
            length_m: self.sensor_length_m * self.scale,
            width_m: self.sensor_width_m * self.scale,
            count: self.rectangles as usize,
            clearance_m: self.clearance_m,
            slope_max: libm::tan(self.slope_max_deg.to_radians()),
            tilt_max_rad: self.tilt_max_deg.to_radians(),
        }
    }

    fn rules(&self) -> SchoppersRules {
        SchoppersRules {
            goal_tolerance_m: self.goal_tolerance_m,
            turn_rad: self.turn_deg.to_radians(),
            step_m: self.step_m * self.scale,
            bearing_tolerance_rad: self.bearing_tolerance_rad,
            commit_m: self.commit_m * self.scale,
            commit_growth: self.commit_growth,
            commit_max_m: self.commit_max_m * self.scale,
            progress_m: self.progress_m * self.scale,
        }
    }
}

impl Navigator {
    /// Name of the Sojourner-like navigator in studies and tables.
    pub const SOJOURNER: &str = "sojourner_like";
    /// Name of the Schoppers-like navigator.
    pub const SCHOPPERS: &str = "schoppers_like";
    /// Name of the planner.
    pub const PLANNER: &str = "planner";

    /// Name in studies and tables.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Sojourner(_) => Self::SOJOURNER,
            Self::Schoppers(_) => Self::SCHOPPERS,
            Self::Planner(_) => Self::PLANNER,
        }
    }

    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        match self {
            Self::Sojourner(p) => p.check(),
            Self::Schoppers(p) => p.check(),
            Self::Planner(p) => p.check(),
        }
    }

    /// A policy in its initial state.
    pub fn policy(&self) -> Box<dyn Policy> {
        match self {
            Self::Sojourner(p) => Box::new(SojournerLike::new(p.rules())),
            Self::Schoppers(p) => Box::new(SchoppersLike::new(p.rules())),
            Self::Planner(p) => (p.mind)(p),
        }
    }

    /// The task of a rover in a trial.
    pub fn task(&self, trial: &RoverParameters) -> Task {
        match self {
            Self::Sojourner(p) => p.task(trial),
            Self::Schoppers(p) => p.task(trial),
            Self::Planner(p) => p.task(trial),
        }
    }
}

impl PlannerParameters {
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        match &self.eyes {
            PlannerEyes::Rays(p) => p.check(),
            PlannerEyes::Rectangles(p) => p.check(),
        }?;
        all_positive(&[("map_cell_m", self.map.map_cell_m), ("map_beyond_m", self.map.map_beyond_m)])
    }

    /// The task of a rover in a trial.
    pub fn task(&self, trial: &RoverParameters) -> Task {
        match &self.eyes {
            PlannerEyes::Rays(p) => p.task(trial),
            PlannerEyes::Rectangles(p) => p.task(trial),
        }
    }

    /// Turn per cycle, rad.
    pub fn turn_rad(&self) -> f64 {
        match &self.eyes {
            PlannerEyes::Rays(p) => p.turn_deg.to_radians(),
            PlannerEyes::Rectangles(p) => p.turn_deg.to_radians(),
        }
    }

    /// Distance driven per cycle, m.
    pub fn step_m(&self) -> f64 {
        match &self.eyes {
            PlannerEyes::Rays(p) => p.step_m * p.scale,
            PlannerEyes::Rectangles(p) => p.step_m * p.scale,
        }
    }
}

impl SojournerParameters {
    fn task(&self, trial: &RoverParameters) -> Task {
        Task {
            chassis: Chassis { axle_m: self.axle_m * self.scale, track_m: self.track_m * self.scale },
            sensor: Sensor::Rays(self.sensor()),
            noise: trial.noise,
            goal_tolerance_m: self.goal_tolerance_m,
            clearance_m: self.clearance_m,
            distance_limit_m: self.distance_limit_m,
            cycle_limit: self.cycle_limit,
            speed_m_s: trial.speed_m_s,
            turn_rate_rad_s: trial.turn_rate_deg_s.to_radians(),
        }
    }
}

impl SchoppersParameters {
    fn task(&self, trial: &RoverParameters) -> Task {
        Task {
            chassis: Chassis { axle_m: self.axle_m * self.scale, track_m: self.track_m * self.scale },
            sensor: Sensor::Rectangles(self.sensor()),
            noise: trial.noise,
            goal_tolerance_m: self.goal_tolerance_m,
            clearance_m: self.clearance_m,
            distance_limit_m: self.distance_limit_m,
            cycle_limit: self.cycle_limit,
            speed_m_s: trial.speed_m_s,
            turn_rate_rad_s: trial.turn_rate_deg_s.to_radians(),
        }
    }
}
