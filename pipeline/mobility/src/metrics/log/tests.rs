use super::*;
use crate::metrics::Metrics;
use sastrugi_numeric::Grid;
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::log::{ImuStream, TimedForce, TransformStream};
use std::f64::consts::{SQRT_2, TAU};

const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

fn at(time_s: f64) -> i64 {
    EPOCH_NS + (time_s * 1e9).round() as i64
}

/// A vehicle that drives east at 1 m/s with that height, and pitch about y.
fn pose(time_s: f64, height: f64, pitch: f64) -> TimedPose {
    let (sin, cos) = libm::sincos(0.5 * pitch);
    TimedPose {
        time_ns: at(time_s),
        position_m: [time_s, 0.0, height],
        orientation: [0.0, sin, 0.0, cos],
        angular_velocity_rad_s: None,
    }
}

fn log_of(poses: Vec<TimedPose>) -> Log {
    let (topic, schema) = ("/odom".to_owned(), "nav_msgs/msg/Odometry".to_owned());
    let stream = PoseStream { topic, schema, frame: "odom".into(), body: "base_link".into(), poses };
    Log { poses: vec![stream], ..Log::default() }
}

fn judged(poses: Vec<TimedPose>) -> Result<Analysis, LogError> {
    analyse(&log_of(poses), &LogSettings::default())
}

fn heave(time_s: f64) -> f64 {
    0.02 * libm::sin(TAU * 2.0 * time_s)
}

/// 2 Hz at 20 Hz: the second difference keeps `sinc^2(0.1 pi)`.
const KEPT: f64 = 0.967_531;

#[test]
fn val_an_even_log_is_judged_as_a_mission() {
    let poses: Vec<TimedPose> = (0..800).map(|k| pose(f64::from(k) / 20.0, heave(f64::from(k) / 20.0), 0.1)).collect();
    let found = judged(poses.clone()).unwrap();
    assert!(!found.resampled && found.gaps_s.is_empty() && found.poses == 800);
    let state = |p: &TimedPose| StateSample {
        time_s: (p.time_ns - EPOCH_NS) as f64 * 1e-9,
        position_m: p.position_m,
        orientation: p.orientation,
        velocity_m_s: [0.0; 3],
        angular_velocity_rad_s: [0.0; 3],
    };
    let states: Vec<StateSample> = poses.iter().map(state).collect();
    let mission = Metrics::of(&states, 20.0, Differentiator::default());
    assert_eq!(found.metrics.rms_vertical_acceleration_m_s2, mission.rms_vertical_acceleration_m_s2);
    assert_eq!(found.metrics.path_length_m, mission.path_length_m);
    assert_eq!(found.metrics.max_pitch_rad, mission.max_pitch_rad);
    let exact = 0.02 * (TAU * 2.0) * (TAU * 2.0) / SQRT_2;
    assert!((mission.rms_vertical_acceleration_m_s2 / (exact * KEPT) - 1.0).abs() < 0.01);
    let band = found.band_acceleration.unwrap();
    assert!((band.rms / exact - 1.0).abs() < 0.01 && band.tells(), "{band:?} of {exact}");
}

/// 100 Hz with times that jitter by up to a third of the interval: 1 % (chords of a 2 Hz wave at 100 Hz lose 0.2 %).
#[test]
fn val_uneven_times_are_resampled() {
    let mut s = Streams::for_seed(1, "log-test").stream("jitter");
    let poses = (0..4000).map(|k| {
        let time_s = 0.01 * (f64::from(k) + 0.3 * s.uniform());
        pose(time_s, heave(time_s), 0.3 * heave(time_s))
    });
    let found = judged(poses.collect()).unwrap();
    assert!(found.resampled && found.sample_rate_hz == 20.0 && (found.pose_rate_hz - 100.0).abs() < 3.0);
    let exact = 0.02 * (TAU * 2.0) * (TAU * 2.0) / SQRT_2 * KEPT;
    assert!((found.metrics.rms_vertical_acceleration_m_s2 / exact - 1.0).abs() < 0.01, "{:?}", found.metrics);
    // The pitch angle moves by 0.3 x 0.02 rad: its first difference keeps sinc(0.1 pi), its rate about y by central
    // differences sinc(0.2 pi).
    let rate = 0.3 * 0.02 * TAU * 2.0 / SQRT_2;
    assert!((found.metrics.rms_pitch_rate_rad_s / (rate * 0.983_632) - 1.0).abs() < 0.01);
    assert!((found.metrics.rms_body_pitch_rate_rad_s / (rate * 0.935_489) - 1.0).abs() < 0.01);
    assert!(found.metrics.rms_body_roll_rate_rad_s < 1e-12);
}

#[test]
fn val_slow_logs_keep_their_rate() {
    let poses = (0..200).map(|k| pose(0.2 * f64::from(k), 0.0, 0.0)).collect();
    let found = judged(poses).unwrap();
    assert!((found.sample_rate_hz - 5.0).abs() < 1e-9 && !found.resampled);
    assert!(found.notes.iter().any(|n| n.contains("5.000 Hz, below the 20 Hz")), "{:?}", found.notes);
}

#[test]
fn val_gaps_are_named_and_not_crossed() {
    // A step of 1 m in height while nothing was logged.
    let low = (0..200).map(|k| pose(0.05 * f64::from(k), 0.0, 0.0));
    let high = (0..200).map(|k| pose(15.0 + 0.05 * f64::from(k), 1.0, 0.0));
    let found = judged(low.chain(high).collect()).unwrap();
    assert_eq!(found.gaps_s.len(), 1);
    assert!((found.gaps_s[0][0] - 9.95).abs() < 1e-9 && (found.gaps_s[0][1] - 15.0).abs() < 1e-9);
    assert!(found.metrics.rms_vertical_acceleration_m_s2 < 1e-9, "{:?}", found.metrics);
    assert!((found.metrics.path_length_m - 2.0 * 9.95).abs() < 1e-9 && found.metrics.efficiency.is_nan());
}

#[test]
fn val_bad_poses_are_named() {
    let good: Vec<TimedPose> = (0..50).map(|k| pose(0.05 * f64::from(k), 0.0, 0.0)).collect();
    let with = |k: usize, change: fn(&mut TimedPose)| {
        let mut poses = good.clone();
        change(&mut poses[k]);
        judged(poses)
    };
    let nan = with(7, |p| p.position_m[2] = f64::NAN).unwrap();
    assert!(nan.poses == 49 && nan.notes[0].starts_with("1 poses hold numbers that are not finite"), "{:?}", nan.notes);
    let back = with(7, |p| p.time_ns -= 500_000_000).unwrap_err();
    assert_eq!(back, LogError::Backwards { topic: "/odom".into(), message: 8, back_s: 0.45 });
    let zero = with(3, |p| p.orientation = [0.0; 4]).unwrap_err();
    assert_eq!(zero, LogError::Orientation { topic: "/odom".into(), message: 4, length: 0.0 });
    assert!(matches!(judged(good[..2].to_vec()).unwrap_err(), LogError::TooFew { poses: 2, .. }));
    assert!(matches!(judged(Vec::new()).unwrap_err(), LogError::TooFew { poses: 0, .. }));
    assert!(matches!(analyse(&Log::default(), &LogSettings::default()), Err(LogError::NoPoses { .. })));
    let elsewhere = LogSettings { topic: Some("/pose".into()), ..LogSettings::default() };
    let missing = analyse(&log_of(good), &elsewhere).unwrap_err().to_string();
    assert_eq!(missing, "no poses on the topic `/pose`; there are some on /odom");
}

/// map -> odom (turned by 90 degrees, moving slowly) -> base_link (at 20 Hz) is the path of the whole.
#[test]
fn val_transforms_are_chained() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let link = |parent: &str, child: &str, poses: Vec<TimedPose>| TransformStream {
        topic: "/tf".into(),
        parent: parent.into(),
        child: child.into(),
        poses,
    };
    let outer = (0..=10).map(|k| TimedPose {
        time_ns: at(f64::from(k)),
        position_m: [100.0 + f64::from(k), 0.0, 5.0],
        orientation: [0.0, 0.0, half, half],
        angular_velocity_rad_s: None,
    });
    let inner: Vec<TimedPose> = (0..=200).map(|k| pose(0.05 * f64::from(k), 0.0, 0.0)).collect();
    let mount = TimedPose { position_m: [0.2, 0.0, 0.4], ..pose(0.0, 0.0, 0.0) };
    let transforms = vec![
        link("base_link", "imu", vec![mount]),
        link("odom", "base_link", inner),
        link("map", "odom", outer.collect()),
    ];
    let log = Log { transforms, ..Log::default() };
    let found = analyse(&log, &LogSettings::default()).unwrap();
    assert_eq!((found.frame.as_str(), found.poses), ("map", 201));
    let last = found.pieces[0].last().unwrap().position_m;
    // 10 m along odom's x is 10 m along map's y.
    assert!(
        (last[0] - 110.0).abs() < 1e-9 && (last[1] - 10.0).abs() < 1e-9 && (last[2] - 5.0).abs() < 1e-9,
        "{last:?}"
    );
    let in_odom = LogSettings { fixed_frame: Some("odom".into()), body_frame: "imu".into(), ..LogSettings::default() };
    let imu = analyse(&log, &in_odom).unwrap();
    assert!((imu.pieces[0][0].position_m[0] - 0.2).abs() < 1e-9);
    let unknown = LogSettings { body_frame: "base_footprint".into(), ..LogSettings::default() };
    let refusal = analyse(&log, &unknown).unwrap_err().to_string();
    assert_eq!(refusal, "no transforms lead to the frame `base_footprint`; they lead to base_link, imu, odom");
    let cycle = vec![link("a", "base_link", vec![mount]), link("base_link", "a", vec![mount])];
    assert!(analyse(&Log { transforms: cycle, ..Log::default() }, &LogSettings::default()).is_err());
}

/// A unit mounted upside down and named by a transform feels -g - a; its band is that of the heights, 2 %.
#[test]
fn val_an_imu_is_turned_upright() {
    let mut log = log_of((0..800).map(|k| pose(0.05 * f64::from(k), heave(0.05 * f64::from(k)), 0.05)).collect());
    let flipped = TimedPose { orientation: [1.0, 0.0, 0.0, 0.0], ..pose(0.0, 0.0, 0.0) };
    log.transforms.push(TransformStream {
        topic: "/tf_static".into(),
        parent: "base_link".into(),
        child: "imu".into(),
        poses: vec![flipped],
    });
    let sample = |k: u32| {
        let time_s = 0.01 * f64::from(k);
        let up = GRAVITY_M_S2 - (TAU * 2.0) * (TAU * 2.0) * heave(time_s);
        // Into the body (pitched by 0.05), then into the unit (half a turn about x).
        let [sin, cos] = [libm::sin(0.05), libm::cos(0.05)];
        TimedForce {
            time_ns: at(time_s),
            angular_velocity_rad_s: [0.0; 3],
            specific_force_m_s2: [-sin * up, 0.0, -cos * up],
        }
    };
    let (topic, schema) = ("/imu".to_owned(), "sensor_msgs/msg/Imu".to_owned());
    log.imus.push(ImuStream { topic, schema, frame: "imu".into(), samples: (0..3990).map(sample).collect() });
    let found = analyse(&log, &LogSettings::default()).unwrap();
    let (imu, topic) = found.imu_acceleration.unwrap();
    let heights = found.band_acceleration.unwrap();
    let exact = 0.02 * (TAU * 2.0) * (TAU * 2.0) / SQRT_2;
    assert_eq!(topic, "/imu");
    assert!((imu.rms / exact - 1.0).abs() < 0.02 && (heights.rms / exact - 1.0).abs() < 0.02, "{imu:?} {heights:?}");
    assert!(found.notes.is_empty(), "{:?}", found.notes);
    log.transforms.clear();
    let parallel = analyse(&log, &LogSettings::default()).unwrap();
    assert!(parallel.notes[0].contains("no transform tells how `imu` lies in `base_link`"), "{:?}", parallel.notes);
}

/// 1 mm of white noise on the heights at 20 Hz: 0.98 m/s2, nothing told; a heave of 1.6 m/s2 within
/// 0.1 mm of noise is. The floor is within 25 % (its top eighth holds 12 bins of 7 half-overlapping segments: standard error
/// of the density 14 %, of the root 7 %; 3.5 times that: false alarm 5e-4).
#[test]
fn stat_noise_is_told_from_motion() {
    let mut s = Streams::for_seed(1, "log-test").stream("noise");
    let mut noisy = |sigma: f64, heave: fn(f64) -> f64| {
        let poses = (0..800).map(|k| {
            let time_s = 0.05 * f64::from(k);
            pose(time_s, heave(time_s) + sigma * s.normal(), 0.0)
        });
        judged(poses.collect()).unwrap()
    };
    let still = noisy(0.001, |_| 0.0);
    assert!((still.acceleration.rms / 0.98 - 1.0).abs() < 0.1, "{:?}", still.acceleration);
    assert!((still.acceleration.floor / 0.98 - 1.0).abs() < 0.25, "{:?}", still.acceleration);
    assert!(!still.acceleration.tells() && !still.band_acceleration.unwrap().tells());
    let mut simulated = log_of(still.pieces[0].iter().map(|s| pose(s.time_s, s.position_m[2], 0.0)).collect());
    simulated.poses[0].schema = SIMULATED.to_owned();
    let simulated = analyse(&simulated, &LogSettings::default()).unwrap();
    assert!(simulated.acceleration.floor == 0.0 && simulated.acceleration.tells());
    let moving = noisy(0.0001, heave);
    assert!(moving.acceleration.tells() && moving.acceleration.floor < 0.2, "{:?}", moving.acceleration);
}

/// At rest for 3 s with 0.1 mm of noise, then a motion that fills the spectrum up to its top: the floor is that of the rest.
#[test]
fn val_rest_tells_the_floor() {
    let mut s = Streams::for_seed(2, "log-test").stream("noise");
    let poses = (0..800).map(|k| {
        let moving = f64::from(u8::from(k > 60));
        let mut pose = pose(0.05 * f64::from(k), (0.0001 + 0.01 * moving) * s.normal(), 0.0);
        pose.position_m[0] *= moving;
        pose
    });
    let found = judged(poses.collect()).unwrap();
    assert!(found.acceleration.floor < 0.15 && found.acceleration.tells(), "{:?}", found.acceleration);
}

#[test]
fn val_ground_under_a_log() {
    let g = Geometry::square(20, 20, 1.0);
    let dem = Grid::new(g, (0..400).map(|k| 0.1 * g.x(k % 20)).collect());
    let mut classes = Grid::filled(g, 0u8);
    (0..400).filter(|k| k % 20 >= 10).for_each(|k| classes.values[k] = 2);
    let poses = (0..400).map(|k| {
        let time_s = 0.05 * f64::from(k);
        let mut pose = pose(time_s, 0.1 * time_s + 0.3, 0.0);
        pose.position_m[1] = 5.0;
        pose
    });
    let found = on_ground(&judged(poses.collect()).unwrap(), [0.0; 3], &dem, &classes);
    assert!(found.clearance_m.iter().all(|c| (c - 0.3).abs() < 1e-9), "{found:?}");
    assert!((found.shares[0] - 0.5).abs() < 0.01 && (found.shares[2] - 0.5).abs() < 0.01);
    assert!((found.known_share - 0.95).abs() < 0.01);
}
