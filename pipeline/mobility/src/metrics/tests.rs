use super::*;
use crate::missions::{Mission, Polyline};
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::topics::{CommandSample, Event, EventKind, Recording, VehicleOutline, WheelSample, WheelState};
use std::f64::consts::{SQRT_2, TAU};

const RATE_HZ: f64 = 20.0;

/// Poses of a vehicle that drives east at 1 m/s for 40 s, with the given height, roll and pitch over time.
fn states(height: impl Fn(f64) -> f64, roll: impl Fn(f64) -> f64, pitch: impl Fn(f64) -> f64) -> Vec<StateSample> {
    let state = |k: u32| {
        let time_s = f64::from(k) / RATE_HZ;
        let ((sr, cr), (sp, cp)) = (libm::sincos(0.5 * roll(time_s)), libm::sincos(0.5 * pitch(time_s)));
        StateSample {
            time_s,
            position_m: [time_s, 0.0, height(time_s)],
            // Pitch, then roll in the pitched frame.
            orientation: [sr * cp, cr * sp, -sr * sp, cr * cp],
            velocity_m_s: [1.0, 0.0, 0.0],
            angular_velocity_rad_s: [0.1, -0.2, 0.0],
        }
    };
    (0..=800).map(state).collect()
}

fn sinc(x: f64) -> f64 {
    libm::sin(x) / x
}

/// A sinusoidal heave of amplitude A has RMS acceleration `A w^2 / sqrt 2`, attenuated by the sampling. The series covers
/// whole periods, so the tolerance of 1 % covers the end effects.
#[test]
fn val_sine_heave() {
    for frequency_hz in [0.5, 1.0, 2.0, 5.0] {
        let (amplitude, w) = (0.02, TAU * frequency_hz);
        let states = states(|t| amplitude * libm::sin(w * t + 0.3), |_| 0.0, |_| 0.0);
        let exact = amplitude * w * w / SQRT_2;
        for (differentiator, attenuation) in
            [(Differentiator::SecondDifference, sinc(0.5 * w / RATE_HZ)), (Differentiator::Gradient, sinc(w / RATE_HZ))]
        {
            let found = Metrics::of(&states, RATE_HZ, differentiator).rms_vertical_acceleration_m_s2;
            let expected = exact * attenuation * attenuation;
            assert!((found / expected - 1.0).abs() < 0.01, "{frequency_hz} {differentiator:?}: {found} {expected}");
        }
    }
}

/// Sinusoidal pitch and roll: RMS rate `A w / sqrt 2`, attenuated; largest angles; body rates as recorded.
#[test]
fn val_sine_pitch_and_roll() {
    let w = TAU;
    let states = states(|_| 0.0, |t| 0.2 * libm::sin(w * t), |t| 0.1 * libm::cos(w * t));
    for (differentiator, attenuation) in
        [(Differentiator::SecondDifference, sinc(0.5 * w / RATE_HZ)), (Differentiator::Gradient, sinc(w / RATE_HZ))]
    {
        let m = Metrics::of(&states, RATE_HZ, differentiator);
        assert!((m.rms_roll_rate_rad_s / (0.2 * w / SQRT_2 * attenuation) - 1.0).abs() < 0.01);
        assert!((m.rms_pitch_rate_rad_s / (0.1 * w / SQRT_2 * attenuation) - 1.0).abs() < 0.01);
        assert!((m.max_roll_rad - 0.2).abs() < 1e-12 && (m.max_pitch_rad - 0.1).abs() < 1e-12);
        assert!((m.rms_body_roll_rate_rad_s - 0.1).abs() < 1e-12 && (m.rms_body_pitch_rate_rad_s - 0.2).abs() < 1e-12);
    }
}

#[test]
fn val_path_and_efficiency() {
    let straight = states(|_| 0.0, |_| 0.0, |_| 0.0);
    let m = Metrics::of(&straight, RATE_HZ, Differentiator::default());
    assert!((m.path_length_m - 40.0).abs() < 1e-12 && (m.efficiency - 1.0).abs() < 1e-12);
    let mut there_and_back = straight.clone();
    there_and_back.extend(straight.iter().rev().take(401).copied());
    let m = Metrics::of(&there_and_back, RATE_HZ, Differentiator::default());
    assert!((m.path_length_m - 60.0).abs() < 1e-9 && (m.efficiency - 20.0 / 60.0).abs() < 1e-9);
}

/// A roll through 180 deg is not a jump.
#[test]
fn val_angles_are_unwrapped() {
    let states = states(|_| 0.0, |t| 0.5 * t, |_| 0.0);
    let m = Metrics::of(&states, RATE_HZ, Differentiator::default());
    assert!((m.rms_roll_rate_rad_s - 0.5).abs() < 1e-9);
    assert!((m.max_roll_rad - std::f64::consts::PI).abs() < 0.03);
}

#[test]
fn val_short_recordings_have_no_metrics() {
    for length in 0..3 {
        for differentiator in [Differentiator::SecondDifference, Differentiator::Gradient] {
            let states = &states(|_| 0.0, |_| 0.0, |_| 0.0)[..length];
            let m = Metrics::of(states, RATE_HZ, differentiator);
            assert!(length == 2 || m.rms_pitch_rate_rad_s.is_nan());
            assert!(length > 0 || m.max_roll_rad.is_nan());
            assert_eq!(m.path_length_m > 0.0, length == 2);
        }
    }
}

/// Values of wheels and controller are quantised in the row of their instant; values missing from the recording are absent.
#[test]
fn val_samples_hold_wheels_and_controller() {
    let command = CommandSample {
        time_s: 0.0,
        speed_m_s: 1.0,
        yaw_rate_rad_s: 0.0,
        cross_track_m: -1.3 / 1024.0,
        heading_error_rad: 0.1,
        distance_to_goal_m: 40.0,
    };
    let wheel = WheelState {
        angle_rad: 0.0,
        spin_rad_s: 6.0,
        torque_n_m: 1.0 / 70.0,
        normal_force_n: 139.99,
        longitudinal_force_n: 0.01,
        lateral_force_n: -0.01,
        slip_ratio: 0.25,
        contact_m: [1e6 + 1.0 / 3.0, 2.0, 3.0],
        steering_rad: 0.1,
        hub_m: [0.0; 3],
    };
    let lifted = WheelState { normal_force_n: 0.0, ..wheel };
    let recording = Recording {
        vehicle: VehicleOutline {
            name: String::new(),
            chassis_size_m: [1.0; 3],
            chassis_centre_m: [0.0; 3],
            wheels: vec![],
        },
        sample_rate_hz: RATE_HZ,
        imu_rate_hz: RATE_HZ,
        states: states(|_| 0.0, |_| 0.0, |_| 0.0)[..2].to_vec(),
        imu: vec![],
        wheels: vec![WheelSample { time_s: 0.0, wheels: vec![wheel, lifted], chassis_force_n: 0.2 }],
        commands: vec![command],
        events: vec![Event { time_s: 0.05, kind: EventKind::Tipped, text: String::new() }],
    };
    let classes = Grid::new(Geometry::square(1, 1, 1.0), vec![0]);
    let rows = sample_rows("a", &Mission::between(0, [0.0; 2], [40.0, 0.0]), &recording, &classes);
    let [first, last] = &rows[..] else { panic!("{} rows", rows.len()) };
    assert_eq!(first.cross_track_m, -1.0 / 1024.0);
    assert_eq!(first.heading_error_deg, 183.0 / 32.0);
    assert_eq!((first.distance_to_goal_m, first.chassis_force_n), (40.0, 1.0 / 4.0));
    assert_eq!(first.wheel_normal_force_n, [140.0, 0.0]);
    assert_eq!(first.wheel_longitudinal_force_n, [0.0; 2]);
    assert!(first.wheel_lateral_force_n.iter().all(|v| v.to_bits() == 0));
    assert_eq!((&first.wheel_slip_ratio[..], &first.wheel_spin_rad_s[..]), (&[0.25; 2][..], &[6.0; 2][..]));
    assert_eq!(first.wheel_torque_n_m, [1.0 / 64.0; 2]);
    assert_eq!(first.wheel_steering_deg, [183.0 / 32.0; 2]);
    assert!((first.wheel_contact_x_m[0] - wheel.contact_m[0]).abs() <= 0.5 / 1024.0);
    assert!(first.wheel_contact_x_m[1].is_nan());
    assert_eq!((first.wheel_contact_y_m[0], first.wheel_contact_z_m[0]), (2.0, 3.0));
    assert!(last.cross_track_m.is_nan() && last.chassis_force_n.is_nan());
    assert!(last.wheel_normal_force_n.is_empty() && last.wheel_contact_z_m.is_empty());
    assert!(rows.iter().all(|row| row.outcome == "tipped" && row.split.is_none()));
}

/// A vehicle that weaves sinusoidally about its line, and one that drives parallel to it; beyond the ends, the error is the
/// distance to them.
#[test]
fn val_cross_track_error_of_a_sine() {
    let at = |y: &dyn Fn(f64) -> f64| -> Vec<StateSample> {
        let plain = states(|_| 0.0, |_| 0.0, |_| 0.0);
        let moved = |s: StateSample| StateSample { position_m: [s.position_m[0], y(s.position_m[0]), 0.0], ..s };
        plain.into_iter().map(moved).collect()
    };
    let line = Polyline::new(&[[0.0, 0.0], [11.0, 0.0], [40.0, 0.0]]).unwrap();
    let weaving = CrossTrack::of(&at(&|x| 0.1 * libm::sin(TAU * x / 8.0)), &line, 1.5);
    assert!((weaving.rms_m - 0.1 / SQRT_2).abs() < 1e-4 && (weaving.max_m - 0.1).abs() < 1e-9, "{weaving:?}");
    let beside = CrossTrack::of(&at(&|_| -0.3), &line, 1.5);
    assert!((beside.rms_m - 0.3).abs() < 1e-12 && (beside.max_m - 0.3).abs() < 1e-12, "{beside:?}");
    let short = Polyline::new(&[[0.0, 0.0], [38.0, 0.0]]).unwrap();
    assert!((CrossTrack::of(&at(&|_| 0.0), &short, 1.5).max_m - 2.0).abs() < 1e-9);
    assert!(CrossTrack::of(&[], &line, 1.5).rms_m.is_nan());
}

/// A recording of poses with an end, of a vehicle whose hubs lie 0.25 m ahead of and behind base_link.
fn recorded(states: Vec<StateSample>, kind: EventKind) -> Recording {
    let wheel = |x: f64| sastrugi_schemas::topics::WheelOutline {
        name: String::new(),
        hub_m: [x, 0.3, 0.0],
        radius_m: 0.15,
        width_m: 0.1,
    };
    Recording {
        vehicle: VehicleOutline {
            name: "cart".to_owned(),
            chassis_size_m: [1.0; 3],
            chassis_centre_m: [0.0; 3],
            wheels: vec![wheel(0.25), wheel(-0.25)],
        },
        sample_rate_hz: RATE_HZ,
        imu_rate_hz: RATE_HZ,
        states,
        imu: vec![],
        wheels: vec![],
        commands: vec![],
        events: vec![
            Event { time_s: 0.0, kind: EventKind::Start, text: String::new() },
            Event { time_s: 40.25, kind, text: String::new() },
        ],
    }
}

/// The row of a mission holds its labels, ends and units: degrees for radians, the time of the outcome, and an efficiency only after
/// success. The vehicle drives 40 m east with a sinusoidal roll and pitch, parallel to a line of 50 m at 0.3 m.
#[test]
fn val_a_mission_row_holds_the_metrics_in_its_units() {
    let rolling = states(|_| 0.0, |t| 0.2 * libm::sin(TAU * t), |t| 0.1 * libm::cos(TAU * t));
    let labels = MissionLabels {
        terrain_id: "t".to_owned(),
        group: Some("g".to_owned()),
        pair_id: "p".to_owned(),
        path: "m.mcap".to_owned(),
        ..MissionLabels::default()
    };
    let difficulty = crate::missions::Difficulty { shares: [0.5, 0.3, 0.2], max_slope: 0.7, band_rms_m: 0.02 };
    let mission = Mission { draws: 3, ..Mission::between(6, [0.0, -0.3], [50.0, -0.3]) };
    let row = |kind: EventKind| {
        let recording = recorded(rolling.clone(), kind);
        mission_row(&labels, &mission, &difficulty, &recording, Differentiator::SecondDifference)
    };
    let (stuck, arrived) = (row(EventKind::Stuck), row(EventKind::Success));
    assert_eq!((stuck.mission_id.as_str(), stuck.outcome.as_str()), ("mission-0007", "stuck"));
    assert_eq!((stuck.vehicle.as_str(), stuck.group.as_deref(), stuck.path.as_str()), ("cart", Some("g"), "m.mcap"));
    assert_eq!((stuck.draws, stuck.samples, stuck.time_s, stuck.heading_deg), (3, 801, 40.25, 0.0));
    assert_eq!([stuck.start_x_m, stuck.start_y_m, stuck.goal_x_m, stuck.goal_y_m], [0.0, -0.3, 50.0, -0.3]);
    assert_eq!([stuck.line_share_low, stuck.line_share_semi, stuck.line_share_high], [0.5, 0.3, 0.2]);
    assert_eq!([stuck.line_max_slope, stuck.line_band_rms_m, stuck.line_length_m], [0.7, 0.02, 50.0]);
    assert!((stuck.progress_m - 40.0).abs() < 1e-9 && (stuck.path_length_m - 40.0).abs() < 1e-9);
    assert!((stuck.rms_cross_track_m - 0.3).abs() < 1e-9 && (stuck.max_cross_track_m - 0.3).abs() < 1e-9);
    assert!((stuck.max_roll_deg - 0.2f64.to_degrees()).abs() < 1e-9);
    assert!((stuck.max_pitch_deg - 0.1f64.to_degrees()).abs() < 1e-9);
    assert!((stuck.rms_body_roll_rate_deg_s - 0.1f64.to_degrees()).abs() < 1e-9);
    assert!((stuck.rms_body_pitch_rate_deg_s - 0.2f64.to_degrees()).abs() < 1e-9);
    // A sine of 1 Hz at 20 Hz, attenuated by sinc(pi / 20).
    let rate_deg_s = (0.2 * TAU / SQRT_2 * sinc(0.05 * std::f64::consts::PI)).to_degrees();
    assert!((stuck.rms_roll_rate_deg_s / rate_deg_s - 1.0).abs() < 0.01, "{} {rate_deg_s}", stuck.rms_roll_rate_deg_s);
    assert!((stuck.rms_pitch_rate_deg_s / rate_deg_s - 0.5).abs() < 0.01, "{}", stuck.rms_pitch_rate_deg_s);
    assert!(stuck.efficiency.is_nan() && stuck.success_probability == 0.0);
    assert!((arrived.efficiency - 1.0).abs() < 1e-9 && arrived.success_probability == 1.0);
    let tipped = recorded(rolling, EventKind::Tipped);
    let again = replicate_row(&labels, &mission, 4, &tipped, Differentiator::SecondDifference);
    assert_eq!((again.mission_id.as_str(), again.replicate, again.outcome.as_str()), ("mission-0007", 4, "tipped"));
    assert_eq!([again.start_x_m, again.start_y_m, again.start_heading_deg, again.time_s], [0.0, -0.3, 0.0, 40.25]);
    assert_eq!(again.rms_roll_rate_deg_s, stuck.rms_roll_rate_deg_s);
}

/// Progress is the farthest distance along the line: a vehicle that returns keeps it, one that goes past the goal has the line's
/// length, one that only backs away has none.
#[test]
fn val_progress_is_the_farthest_distance_along_the_line() {
    let at = |places: &[[f64; 2]]| {
        let first = states(|_| 0.0, |_| 0.0, |_| 0.0)[0];
        let states = places.iter().map(|[x, y]| StateSample { position_m: [*x, *y, 0.0], ..first }).collect();
        recorded(states, EventKind::Timeout)
    };
    // 3 east for 4 north: the point (3, 4) lies 5 m along.
    let mission = Mission::between(0, [0.0, 0.0], [6.0, 8.0]);
    assert!((progress_m(&mission, &at(&[[0.0, 0.0], [3.0, 4.0], [1.0, 1.0]])) - 5.0).abs() < 1e-12);
    assert!((progress_m(&mission, &at(&[[0.0, 0.0], [5.0, 0.0]])) - 3.0).abs() < 1e-12);
    assert_eq!(progress_m(&mission, &at(&[[0.0, 0.0], [60.0, 80.0]])), 10.0);
    assert_eq!(progress_m(&mission, &at(&[[0.0, 0.0], [-3.0, -4.0]])), 0.0);
}

/// Turns about each axis: roll with the right side down, pitch with the nose down and yaw counterclockwise are positive.
#[test]
fn val_euler_angles_follow_the_right_hand_rule() {
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
    let near = |q: [f64; 4], [roll, pitch, yaw]: [f64; 3]| {
        let found = EulerAngles::of(q);
        (found.pitch - pitch).abs() < 1e-12 && (found.roll - roll).abs() < 1e-12 && (found.yaw - yaw).abs() < 1e-12
    };
    assert!(near([FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2], [FRAC_PI_2, 0.0, 0.0]));
    assert!(near([0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2], [0.0, 0.0, FRAC_PI_2]));
    assert!(near([0.0, -0.5, 0.0, 0.75f64.sqrt()], [0.0, -FRAC_PI_2 * 2.0 / 3.0, 0.0]));
    // Yaw by 90 deg, then pitch by 60 deg: the product of the two quaternions.
    let (half, root) = (0.5, 0.75f64.sqrt());
    let yaw_pitch = [-half * FRAC_1_SQRT_2, half * FRAC_1_SQRT_2, root * FRAC_1_SQRT_2, root * FRAC_1_SQRT_2];
    assert!(near(yaw_pitch, [0.0, FRAC_PI_2 * 2.0 / 3.0, FRAC_PI_2]));
}
