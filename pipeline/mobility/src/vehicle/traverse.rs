//! Drives a mission from the settled start to its outcome.

use super::actuation::{self, Limits};
use super::body::Body;
use super::controller::{Controller, PlanPose};
use super::drive::Servo;
use super::ground::Ground;
use super::model::{GRAVITY_M_S2, Vehicle};
use super::settings::{TraverseParameters, TraverseSettings};
use super::simulation::Simulation;
use super::vector::{Axes, Vec3, add_scaled, cross, norm, scale, sub};
use crate::missions::Mission;
use sastrugi_schemas::topics::{CommandSample, Event, EventKind, ImuSample, Recording, StateSample, WheelSample};

/// Why a mission could not be driven.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TraverseError {
    /// The ground was prepared for a smaller vehicle.
    #[error("drive `{vehicle}`: the ground was prepared for a smaller vehicle; prepare it for `{vehicle}`")]
    OtherVehicle {
        /// Name of the vehicle.
        vehicle: String,
    },
    /// The surface differs by roughness class, and the ground was prepared without classes.
    #[error("drive on a surface that differs by roughness class: the ground was prepared without a class map")]
    NoSurface,
    /// Start or goal is not finite, or they coincide.
    #[error("drive from {start_m:?} to {goal_m:?}: start and goal must be finite and must differ")]
    NoLine {
        /// Start, m.
        start_m: [f64; 2],
        /// Goal, m.
        goal_m: [f64; 2],
    },
}

/// Drives one mission. At time 0 the vehicle stands at rest on the start point, facing along its heading.
///
/// # Errors
/// [`TraverseError`]; a vehicle that tips, sticks, leaves the terrain or runs out of time is an outcome, not an error.
///
/// ```
/// use sastrugi_mobility::missions::Mission;
/// use sastrugi_mobility::vehicle::{Ground, TraverseParameters, drive};
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_schemas::topics::EventKind;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (vehicle, settings) = TraverseParameters { timeout_s: 2.0, ..Default::default() }.prepare()?;
/// let terrain = Grid::filled(Geometry::square(120, 320, 0.05), 0.0);
/// let ground = Ground::new(&terrain, &vehicle)?;
/// // Ten metres at 1 m/s are not driven in 2 s.
/// let recording = drive(&ground, &vehicle, &settings, &Mission::between(0, [3.0, 3.0], [13.0, 3.0]))?;
/// let end = recording.events.last().unwrap();
/// assert_eq!((end.kind, end.time_s), (EventKind::Timeout, 2.0));
/// // Poses at 20 Hz, from time 0 to the end.
/// assert_eq!(recording.states.len(), 41);
/// # Ok(())
/// # }
/// ```
pub fn drive(
    ground: &Ground,
    vehicle: &Vehicle,
    settings: &TraverseSettings,
    mission: &Mission,
) -> Result<Recording, TraverseError> {
    if !ground.carries(vehicle) {
        return Err(TraverseError::OtherVehicle { vehicle: vehicle.name().to_owned() });
    }
    if settings.parameters().surface.differs_by_class() && !ground.has_surface() {
        return Err(TraverseError::NoSurface);
    }
    let (start_m, goal_m) = (mission.start_m, mission.goal_m);
    let length_m = mission.course_length_m();
    let finite = start_m.iter().chain(&goal_m).chain([&mission.heading_rad]).all(|v| v.is_finite());
    if !(finite && length_m.is_finite() && length_m > 0.0) {
        return Err(TraverseError::NoLine { start_m, goal_m });
    }
    Ok(match settled(ground, vehicle, settings, mission) {
        Some(simulation) => Run::new(simulation, ground, vehicle, settings, mission).finish(),
        None => invalid_start(vehicle, settings.parameters(), mission),
    })
}

/// The vehicle at rest on the start, wheels locked; `None` where the ground is undefined.
pub(crate) fn settled<'a>(
    ground: &'a Ground,
    vehicle: &'a Vehicle,
    settings: &'a TraverseSettings,
    mission: &Mission,
) -> Option<Simulation<'a>> {
    let body = fitted(ground, vehicle, mission)?;
    let mut simulation = Simulation::new(ground, vehicle, settings, body);
    let overlap = simulation.deepest_overlap_m();
    if !overlap.is_finite() {
        return None;
    }
    simulation.body.position[2] += overlap;
    let brakes = vec![Servo::BRAKE; vehicle.channels()];
    let least = (settings.parameters().settle_s / settings.step_s()).ceil() as u64;
    for step in 0..least.saturating_mul(SETTLE_FACTOR) {
        if step >= least && simulation.joints_are_still() {
            break;
        }
        simulation.step(&brakes);
    }
    simulation.zero_angles();
    (!simulation.undefined).then_some(simulation)
}

/// A vehicle whose suspension still moves gets up to this many times `settle_s` to come to rest.
const SETTLE_FACTOR: u64 = 10;

/// Pose with the base_link origin above the start, tilted like the least-squares plane through the ground under the hubs,
/// with the wheels approximately on that plane.
fn fitted(ground: &Ground, vehicle: &Vehicle, mission: &Mission) -> Option<Body> {
    let [x0, y0] = mission.start_m;
    if !ground.contains(x0, y0) {
        return None;
    }
    let (sin, cos) = libm::sincos(mission.heading_rad);
    let hubs: Vec<Vec3> = vehicle.outline().wheels.iter().map(|w| w.hub_m).collect();
    let height = |hub: &Vec3| ground.height(x0 + cos * hub[0] - sin * hub[1], y0 + sin * hub[0] + cos * hub[1]);
    let heights: Vec<f64> = hubs.iter().map(height).collect();
    let count = hubs.len() as f64;
    let (mean_x, mean_z) = (hubs.iter().map(|h| h[0]).sum::<f64>() / count, heights.iter().sum::<f64>() / count);
    // Hubs come in pairs left and right of x, so the two slopes of the least-squares plane are independent.
    let slope = |axis: usize, mean: f64| {
        let product: f64 = hubs.iter().zip(&heights).map(|(h, z)| (h[axis] - mean) * z).sum();
        let square: f64 = hubs.iter().map(|h| (h[axis] - mean) * (h[axis] - mean)).sum();
        product / square
    };
    let (ahead, left) = (slope(0, mean_x), slope(1, 0.0));
    let axes = tilted([cos, sin], ahead, left);
    let base_z = mean_z - ahead * mean_x + vehicle.tyre.radius_m - hubs[0][2];
    let position = add_scaled([x0, y0, base_z], axes.to_map(vehicle.centre_of_mass_m), 1.0);
    let body = Body { position, velocity: [0.0; 3], orientation: axes.quaternion(), rate: [0.0; 3] };
    base_z.is_finite().then_some(body)
}

/// Axes with x over the heading, on a plane with these slopes ahead and to the left.
fn tilted([cos, sin]: [f64; 2], ahead: f64, left: f64) -> Axes {
    let along = [cos, sin, ahead];
    let across = [-sin, cos, left];
    let normal = cross(along, across);
    let (x, z) = (scale(along, 1.0 / norm(along)), scale(normal, 1.0 / norm(normal)));
    Axes { x, y: cross(z, x), z }
}

/// The recording of a vehicle whose start has no valid ground.
fn invalid_start(vehicle: &Vehicle, parameters: &TraverseParameters, mission: &Mission) -> Recording {
    let (sin, cos) = libm::sincos(0.5 * mission.heading_rad);
    let state = StateSample {
        time_s: 0.0,
        position_m: [mission.start_m[0], mission.start_m[1], 0.0],
        orientation: [0.0, 0.0, sin, cos],
        velocity_m_s: [0.0; 3],
        angular_velocity_rad_s: [0.0; 3],
    };
    let text = format!(
        "the start ({:.2}, {:.2}) m lies off the terrain, next to cells without data, or on extreme relief",
        mission.start_m[0], mission.start_m[1]
    );
    let event = Event { time_s: 0.0, kind: EventKind::OutOfBounds, text };
    Recording { states: vec![state], events: vec![event], ..empty(vehicle, parameters) }
}

fn empty(vehicle: &Vehicle, parameters: &TraverseParameters) -> Recording {
    Recording {
        vehicle: vehicle.outline(),
        sample_rate_hz: f64::from(parameters.sample_rate_hz),
        imu_rate_hz: f64::from(parameters.imu_rate_hz),
        states: Vec::new(),
        imu: Vec::new(),
        wheels: Vec::new(),
        commands: Vec::new(),
        events: Vec::new(),
    }
}

/// Quantisation of recorded poses, steps per metre and per unit of a quaternion: 1 micrometre. Finer digits carry no
/// information and do not compress; they made up a tenth of every recording. Differentiated twice at 20 Hz, the rounding
/// amounts to 0.3 mm/s2.
const POSE_STEPS: f64 = 1_048_576.0;
/// Quantisation of recorded velocities, steps per m/s and rad/s.
const MOTION_STEPS: f64 = 65_536.0;

fn in_steps(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}

/// A mission under way.
struct Run<'a> {
    simulation: Simulation<'a>,
    ground: &'a Ground,
    vehicle: &'a Vehicle,
    settings: &'a TraverseSettings,
    controller: Controller,
    limits: Limits,
    servos: Vec<Servo>,
    recording: Recording,
    /// Steps since the start.
    steps: u64,
    /// Velocity of base_link at the last inertial measurement.
    imu_velocity: Vec3,
    /// Position and time at which the vehicle last completed a move of `stuck_distance_m`.
    moved: ([f64; 2], f64),
}

impl<'a> Run<'a> {
    fn new(
        simulation: Simulation<'a>,
        ground: &'a Ground,
        vehicle: &'a Vehicle,
        settings: &'a TraverseSettings,
        mission: &Mission,
    ) -> Self {
        let (position, imu_velocity) = simulation.body.base(vehicle);
        let way = match &mission.line {
            None => format!("goal {:.2} m away", mission.length_m()),
            Some(line) => format!("course of {:.2} m", line.length_m()),
        };
        let text = format!("at ({:.2}, {:.2}, {:.2}) m, {way}", position[0], position[1], position[2]);
        let mut recording = empty(vehicle, settings.parameters());
        recording.events.push(Event { time_s: 0.0, kind: EventKind::Start, text });
        Self {
            simulation,
            ground,
            vehicle,
            settings,
            controller: Controller::new(mission),
            limits: Limits::of(vehicle),
            servos: Vec::new(),
            recording,
            steps: 0,
            imu_velocity,
            moved: ([position[0], position[1]], 0.0),
        }
    }

    /// Steps until the outcome.
    fn finish(mut self) -> Recording {
        loop {
            if !self.simulation.body.is_finite() {
                return self.diverged();
            }
            self.on_clock();
            if let Some((kind, text)) = self.outcome() {
                self.recording.events.push(Event { time_s: self.time_s(), kind, text });
                return self.recording;
            }
            let (command, steering) = (&self.controller.command, &self.simulation.steering);
            actuation::servos(self.vehicle, command, steering, &mut self.servos);
            self.simulation.step(&self.servos);
            self.steps += 1;
        }
    }

    /// The recording up to the step at which the motion overflowed.
    fn diverged(mut self) -> Recording {
        let text = "the simulation diverged: the relief or a vehicle parameter is extreme".to_owned();
        self.recording.events.push(Event { time_s: self.time_s(), kind: EventKind::OutOfBounds, text });
        self.recording
    }

    fn parameters(&self) -> &'a TraverseParameters {
        self.settings.parameters()
    }

    fn time_s(&self) -> f64 {
        self.steps as f64 / f64::from(self.parameters().step_rate_hz)
    }

    /// True when an event at this rate falls on the current step.
    fn is_due(&self, rate_hz: u32) -> bool {
        self.steps.is_multiple_of(u64::from(self.parameters().step_rate_hz / rate_hz))
    }

    /// Control and recording at their rates. At the same instant, commands come before samples.
    fn on_clock(&mut self) {
        let parameters = self.parameters();
        if self.is_due(parameters.control_rate_hz) {
            let period_s = 1.0 / f64::from(parameters.control_rate_hz);
            self.controller.update(self.pose(), self.settings, &self.limits, period_s);
            let targets = &mut self.simulation.steering_target;
            actuation::steering_angles(self.vehicle, &self.controller.command, targets);
        }
        if self.is_due(parameters.imu_rate_hz) {
            self.record_imu();
        }
        if self.is_due(parameters.sample_rate_hz) {
            self.record_samples();
        }
    }

    fn pose(&self) -> PlanPose {
        let ([x, y, _], _) = self.simulation.body.base(self.vehicle);
        let forward = self.simulation.body.axes().x;
        PlanPose { x, y, yaw: libm::atan2(forward[1], forward[0]) }
    }

    fn record_samples(&mut self) {
        let time_s = self.time_s();
        self.controller.observe(self.pose(), self.settings);
        let (body, command) = (&self.simulation.body, &self.controller.command);
        let (position_m, velocity_m_s) = body.base(self.vehicle);
        self.recording.states.push(StateSample {
            time_s,
            position_m: position_m.map(|v| in_steps(v, POSE_STEPS)),
            orientation: body.orientation.map(|v| in_steps(v, POSE_STEPS)),
            velocity_m_s: velocity_m_s.map(|v| in_steps(v, MOTION_STEPS)),
            angular_velocity_rad_s: body.rate.map(|v| in_steps(v, MOTION_STEPS)),
        });
        self.recording.wheels.push(WheelSample {
            time_s,
            wheels: self.simulation.wheel_states(),
            chassis_force_n: self.simulation.chassis_force_n(),
        });
        self.recording.commands.push(CommandSample {
            time_s,
            speed_m_s: command.speed_m_s,
            yaw_rate_rad_s: command.yaw_rate_rad_s,
            cross_track_m: command.cross_track_m,
            heading_error_rad: command.heading_error_rad,
            distance_to_goal_m: command.distance_to_goal_m,
        });
    }

    /// Mean specific force since the last measurement, in the body frame at the end of the interval; at time 0 that of a
    /// vehicle at rest.
    fn record_imu(&mut self) {
        let body = &self.simulation.body;
        let (_, velocity) = body.base(self.vehicle);
        let acceleration = scale(sub(velocity, self.imu_velocity), f64::from(self.parameters().imu_rate_hz));
        self.imu_velocity = velocity;
        self.recording.imu.push(ImuSample {
            time_s: self.time_s(),
            orientation: body.orientation,
            angular_velocity_rad_s: body.rate,
            specific_force_m_s2: body.axes().to_body(add_scaled(acceleration, [0.0, 0.0, 1.0], GRAVITY_M_S2)),
        });
    }

    /// The outcome of the mission if it ends at this instant.
    fn outcome(&mut self) -> Option<(EventKind, String)> {
        let rules = self.parameters();
        let body = &self.simulation.body;
        let axes = body.axes();
        let [x, y, _] = body.base_position(self.vehicle, &axes);
        if self.simulation.undefined || !self.ground.contains(body.position[0], body.position[1]) {
            let text = format!("at ({x:.2}, {y:.2}) m the ground ends or has no data");
            return Some((EventKind::OutOfBounds, text));
        }
        if axes.are_tipped(self.settings.tip_sin_cos()) {
            let text = format!("pitch or roll beyond {} deg at ({x:.2}, {y:.2}) m", rules.tip_deg);
            return Some((EventKind::Tipped, text));
        }
        let left_m = self.controller.left_m([x, y], self.settings);
        if left_m <= rules.goal_tolerance_m {
            return Some((EventKind::Success, format!("within {left_m:.3} m of the goal")));
        }
        if self.stands_still([x, y]) {
            let (distance_m, time_s) = (rules.stuck_distance_m, rules.stuck_time_s);
            let text = format!("less than {distance_m} m of motion in {time_s} s at ({x:.2}, {y:.2}) m");
            return Some((EventKind::Stuck, text));
        }
        (self.time_s() >= rules.timeout_s).then(|| (EventKind::Timeout, format!("{left_m:.2} m short of the goal")))
    }

    fn stands_still(&mut self, at: [f64; 2]) -> bool {
        let rules = self.parameters();
        let (anchor, since_s) = self.moved;
        let (dx, dy) = (at[0] - anchor[0], at[1] - anchor[1]);
        if dx * dx + dy * dy >= rules.stuck_distance_m * rules.stuck_distance_m {
            self.moved = (at, self.time_s());
            return false;
        }
        self.time_s() - since_s >= rules.stuck_time_s
    }
}
