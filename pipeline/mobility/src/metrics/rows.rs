//! A recorded mission as rows of the tables `missions` and `samples`.

use super::tracking::{cross_track, window_m};
use super::{Differentiator, EulerAngles, Metrics};
use crate::missions::{Difficulty, Mission, class_at};
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::{MissionRow, ReplicateRow, SampleRow};
use sastrugi_schemas::topics::{CommandSample, EventKind, Recording, StateSample, WheelSample, WheelState};

/// Quantisation of wheel and controller columns, in steps per unit, as in the topics `/wheels` and `/command`: finer than any
/// sensor's noise, and compressible. This one is for rates and lengths.
const FINE: f64 = 1024.0;
/// Slip ratios.
const SLIP: f64 = 4096.0;
/// Torques.
const TORQUE: f64 = 64.0;
/// Angles in degrees: half the step of the topics.
const DEGREES: f64 = 32.0;
/// Forces.
const COARSE: f64 = 4.0;

/// Labels of a mission in the tables.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissionLabels {
    /// Id of the terrain.
    pub terrain_id: String,
    /// Label of the terrain.
    pub group: Option<String>,
    /// The parameter that differs from the study's plain run.
    pub variant: Option<String>,
    /// Id of the random draws, shared by missions that can be compared in pairs.
    pub pair_id: String,
    /// Id of the traverse stage.
    pub traverse_id: String,
    /// MCAP recording in the release.
    pub path: String,
}

/// The row of a mission.
pub fn mission_row(
    labels: &MissionLabels,
    mission: &Mission,
    difficulty: &Difficulty,
    recording: &Recording,
    differentiator: Differentiator,
) -> MissionRow {
    let metrics = Metrics::of(&recording.states, recording.sample_rate_hz, differentiator);
    let outcome = recording.events.last();
    let success = outcome.is_some_and(|event| event.kind == EventKind::Success);
    let tracked = cross_track(mission, recording);
    MissionRow {
        terrain_id: labels.terrain_id.clone(),
        mission_id: mission.id(),
        group: labels.group.clone(),
        variant: labels.variant.clone(),
        split: None,
        pair_id: labels.pair_id.clone(),
        traverse_id: labels.traverse_id.clone(),
        vehicle: recording.vehicle.name.clone(),
        start_x_m: mission.start_m[0],
        start_y_m: mission.start_m[1],
        goal_x_m: mission.goal_m[0],
        goal_y_m: mission.goal_m[1],
        heading_deg: mission.heading_rad.to_degrees(),
        draws: i64::from(mission.draws),
        outcome: outcome_of(recording).to_owned(),
        time_s: outcome.map_or(f64::NAN, |event| event.time_s),
        path_length_m: metrics.path_length_m,
        progress_m: progress_m(mission, recording),
        efficiency: if success { metrics.efficiency } else { f64::NAN },
        rms_vertical_acceleration_m_s2: metrics.rms_vertical_acceleration_m_s2,
        rms_pitch_rate_deg_s: metrics.rms_pitch_rate_rad_s.to_degrees(),
        rms_roll_rate_deg_s: metrics.rms_roll_rate_rad_s.to_degrees(),
        rms_body_pitch_rate_deg_s: metrics.rms_body_pitch_rate_rad_s.to_degrees(),
        rms_body_roll_rate_deg_s: metrics.rms_body_roll_rate_rad_s.to_degrees(),
        max_pitch_deg: metrics.max_pitch_rad.to_degrees(),
        max_roll_deg: metrics.max_roll_rad.to_degrees(),
        line_length_m: mission.course_length_m(),
        rms_cross_track_m: tracked.rms_m,
        max_cross_track_m: tracked.max_m,
        line_share_low: difficulty.shares[0],
        line_share_semi: difficulty.shares[1],
        line_share_high: difficulty.shares[2],
        line_max_slope: difficulty.max_slope,
        line_band_rms_m: difficulty.band_rms_m,
        replicates: 1,
        success_probability: f64::from(u8::from(success)),
        samples: recording.states.len() as i64,
        sample_rate_hz: recording.sample_rate_hz,
        path: labels.path.clone(),
    }
}

/// The row of one of a mission's starts; `replicate` counts from 1.
pub fn replicate_row(
    labels: &MissionLabels,
    start: &Mission,
    replicate: i64,
    recording: &Recording,
    differentiator: Differentiator,
) -> ReplicateRow {
    let metrics = Metrics::of(&recording.states, recording.sample_rate_hz, differentiator);
    let outcome = recording.events.last();
    ReplicateRow {
        terrain_id: labels.terrain_id.clone(),
        mission_id: start.id(),
        replicate,
        group: labels.group.clone(),
        variant: labels.variant.clone(),
        start_x_m: start.start_m[0],
        start_y_m: start.start_m[1],
        start_heading_deg: start.heading_rad.to_degrees(),
        outcome: outcome_of(recording).to_owned(),
        time_s: outcome.map_or(f64::NAN, |event| event.time_s),
        progress_m: progress_m(start, recording),
        rms_vertical_acceleration_m_s2: metrics.rms_vertical_acceleration_m_s2,
        rms_pitch_rate_deg_s: metrics.rms_pitch_rate_rad_s.to_degrees(),
        rms_roll_rate_deg_s: metrics.rms_roll_rate_rad_s.to_degrees(),
    }
}

/// Largest distance that the vehicle reached along the mission's line or polyline, at most its length, m.
pub fn progress_m(mission: &Mission, recording: &Recording) -> f64 {
    if let Some(line) = &mission.line {
        let feet = line.feet(&recording.states, window_m(recording));
        return feet.last().map_or(0.0, |foot| foot.along_m);
    }
    let along = recording.states.iter().map(|s| mission.along_m([s.position_m[0], s.position_m[1]]));
    along.fold(0.0, f64::max).min(mission.length_m())
}

/// The rows of a mission's samples; `classes` (codes of [`RoughnessClass`](sastrugi_schemas::RoughnessClass)) gives the class
/// under base_link.
pub fn sample_rows(terrain_id: &str, mission: &Mission, recording: &Recording, classes: &Grid<u8>) -> Vec<SampleRow> {
    let mission_id = mission.id();
    let labels = SampleLabels { terrain_id, mission_id: &mission_id, outcome: outcome_of(recording) };
    let row = |(sample, state): (usize, &StateSample)| {
        let class = class_at(classes, state.position_m[0], state.position_m[1]).map(|class| class as i64);
        let instant = Instant { state, command: recording.commands.get(sample), wheels: recording.wheels.get(sample) };
        sample_row(labels, sample as i64, instant, class)
    };
    recording.states.iter().enumerate().map(row).collect()
}

/// The outcome of a recorded mission; empty if it has no final event.
fn outcome_of(recording: &Recording) -> &'static str {
    recording.events.last().map_or("", |event| event.kind.name())
}

/// Labels shared by all samples of a mission.
#[derive(Clone, Copy)]
struct SampleLabels<'a> {
    terrain_id: &'a str,
    mission_id: &'a str,
    outcome: &'a str,
}

/// All messages of a recording at one instant.
struct Instant<'a> {
    state: &'a StateSample,
    command: Option<&'a CommandSample>,
    wheels: Option<&'a WheelSample>,
}

impl Instant<'_> {
    /// A quantised value of the controller; NaN if not recorded.
    fn controller(&self, steps: f64, value: fn(&CommandSample) -> f64) -> f64 {
        self.command.map_or(f64::NAN, |c| in_steps(value(c), steps))
    }

    fn of_wheels<T>(&self, value: impl Fn(&WheelState) -> T) -> Vec<T> {
        self.wheels.map_or_else(Vec::new, |sample| sample.wheels.iter().map(value).collect())
    }

    /// A quantised value of every wheel.
    fn wheels(&self, steps: f64, value: fn(&WheelState) -> f64) -> Vec<f32> {
        self.of_wheels(|w| in_steps(value(w), steps) as f32)
    }

    /// A coordinate of every wheel's contact point; NaN without contact.
    fn contacts(&self, axis: usize) -> Vec<f64> {
        self.of_wheels(|w| if w.normal_force_n == 0.0 { f64::NAN } else { in_steps(w.contact_m[axis], FINE) })
    }
}

/// Rounds to the nearest step; zero is positive.
fn in_steps(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps + 0.0
}

fn sample_row(labels: SampleLabels<'_>, sample: i64, instant: Instant<'_>, class: Option<i64>) -> SampleRow {
    let Instant { state, command, wheels } = instant;
    let angles = EulerAngles::of(state.orientation);
    let [qx, qy, qz, qw] = state.orientation;
    let [x_m, y_m, z_m] = state.position_m;
    let [vx_m_s, vy_m_s, vz_m_s] = state.velocity_m_s;
    let [roll_rate, pitch_rate, yaw_rate] = state.angular_velocity_rad_s;
    SampleRow {
        terrain_id: labels.terrain_id.to_owned(),
        mission_id: labels.mission_id.to_owned(),
        sample,
        time_s: state.time_s,
        x_m,
        y_m,
        z_m,
        qx,
        qy,
        qz,
        qw,
        vx_m_s,
        vy_m_s,
        vz_m_s,
        roll_deg: angles.roll.to_degrees(),
        pitch_deg: angles.pitch.to_degrees(),
        yaw_deg: angles.yaw.to_degrees(),
        roll_rate_deg_s: roll_rate.to_degrees(),
        pitch_rate_deg_s: pitch_rate.to_degrees(),
        yaw_rate_deg_s: yaw_rate.to_degrees(),
        command_speed_m_s: command.map_or(f64::NAN, |c| c.speed_m_s),
        command_yaw_rate_deg_s: command.map_or(f64::NAN, |c| c.yaw_rate_rad_s.to_degrees()),
        class,
        cross_track_m: instant.controller(FINE, |c| c.cross_track_m),
        heading_error_deg: instant.controller(DEGREES, |c| c.heading_error_rad.to_degrees()),
        distance_to_goal_m: instant.controller(FINE, |c| c.distance_to_goal_m),
        chassis_force_n: wheels.map_or(f64::NAN, |w| in_steps(w.chassis_force_n, COARSE)),
        wheel_normal_force_n: instant.wheels(COARSE, |w| w.normal_force_n),
        wheel_longitudinal_force_n: instant.wheels(COARSE, |w| w.longitudinal_force_n),
        wheel_lateral_force_n: instant.wheels(COARSE, |w| w.lateral_force_n),
        wheel_slip_ratio: instant.wheels(SLIP, |w| w.slip_ratio),
        wheel_spin_rad_s: instant.wheels(FINE, |w| w.spin_rad_s),
        wheel_torque_n_m: instant.wheels(TORQUE, |w| w.torque_n_m),
        wheel_steering_deg: instant.wheels(DEGREES, |w| w.steering_rad.to_degrees()),
        wheel_contact_x_m: instant.contacts(0),
        wheel_contact_y_m: instant.contacts(1),
        wheel_contact_z_m: instant.contacts(2),
        outcome: labels.outcome.to_owned(),
        // Filled in when the release is assembled.
        split: None,
    }
}
