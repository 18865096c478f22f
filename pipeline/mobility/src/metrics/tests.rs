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

/// A sine heave of amplitude A has RMS acceleration `A w^2 / sqrt 2` less the attenuation of the sampling.
/// Whole periods, so the tolerance of 1 % covers the end effects.
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

/// A sine pitch and roll: RMS rate `A w / sqrt 2` less the attenuation; largest angles; body rates as recorded.
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

/// A roll through 180 deg is no jump.
#[test]
fn val_angles_are_unwrapped() {
    let states = states(|_| 0.0, |t| 0.5 * t, |_| 0.0);
    let m = Metrics::of(&states, RATE_HZ, Differentiator::default());
    assert!((m.rms_roll_rate_rad_s - 0.5).abs() < 1e-9);
    assert!((m.max_roll_rad - std::f64::consts::PI).abs() < 0.03);
}

#[test]
fn val_short_recordings_have_no_figures() {
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

/// Values of wheels and controller stand in the row of their instant, in steps; what a recording lacks is absent.
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

/// A vehicle that weaves about its line as a sine, and one beside it; beyond the ends the error is the distance to them.
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
