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

fn analysed(poses: Vec<TimedPose>) -> Result<Analysis, LogError> {
    analyse(&log_of(poses), &LogSettings::default())
}

fn heave(time_s: f64) -> f64 {
    0.02 * libm::sin(TAU * 2.0 * time_s)
}

/// 2 Hz sampled at 20 Hz: the second difference is attenuated by `sinc^2(0.1 pi)`.
const KEPT: f64 = 0.967_531;

#[test]
fn val_an_even_log_has_the_metrics_of_a_mission() {
    let poses: Vec<TimedPose> = (0..800).map(|k| pose(f64::from(k) / 20.0, heave(f64::from(k) / 20.0), 0.1)).collect();
    let found = analysed(poses.clone()).unwrap();
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

/// 100 Hz with times that jitter by up to a third of the interval; tolerance 1 % (chords of a 2 Hz wave at 100 Hz lose 0.2 %).
#[test]
fn val_uneven_times_are_resampled() {
    let mut s = Streams::for_seed(1, "log-test").stream("jitter");
    let poses = (0..4000).map(|k| {
        let time_s = 0.01 * (f64::from(k) + 0.3 * s.uniform());
        pose(time_s, heave(time_s), 0.3 * heave(time_s))
    });
    let found = analysed(poses.collect()).unwrap();
    assert!(found.resampled && found.sample_rate_hz == 20.0 && (found.pose_rate_hz - 100.0).abs() < 3.0);
    let exact = 0.02 * (TAU * 2.0) * (TAU * 2.0) / SQRT_2 * KEPT;
    assert!((found.metrics.rms_vertical_acceleration_m_s2 / exact - 1.0).abs() < 0.01, "{:?}", found.metrics);
    // The pitch amplitude is 0.3 x 0.02 rad: its first difference is attenuated by sinc(0.1 pi), its rate about y, by central
    // differences, by sinc(0.2 pi).
    let rate = 0.3 * 0.02 * TAU * 2.0 / SQRT_2;
    assert!((found.metrics.rms_pitch_rate_rad_s / (rate * 0.983_632) - 1.0).abs() < 0.01);
    assert!((found.metrics.rms_body_pitch_rate_rad_s / (rate * 0.935_489) - 1.0).abs() < 0.01);
    assert!(found.metrics.rms_body_roll_rate_rad_s < 1e-12);
}

#[test]
fn val_slow_logs_keep_their_rate() {
    let poses = (0..200).map(|k| pose(0.2 * f64::from(k), 0.0, 0.0)).collect();
    let found = analysed(poses).unwrap();
    assert!((found.sample_rate_hz - 5.0).abs() < 1e-9 && !found.resampled);
    assert!(found.notes.iter().any(|n| n.contains("5.000 Hz, below the 20 Hz")), "{:?}", found.notes);
}

#[test]
fn val_gaps_are_reported_and_not_bridged() {
    // A step of 1 m in height while nothing was logged.
    let low = (0..200).map(|k| pose(0.05 * f64::from(k), 0.0, 0.0));
    let high = (0..200).map(|k| pose(15.0 + 0.05 * f64::from(k), 1.0, 0.0));
    let found = analysed(low.chain(high).collect()).unwrap();
    assert_eq!(found.gaps_s.len(), 1);
    assert!((found.gaps_s[0][0] - 9.95).abs() < 1e-9 && (found.gaps_s[0][1] - 15.0).abs() < 1e-9);
    assert!(found.metrics.rms_vertical_acceleration_m_s2 < 1e-9, "{:?}", found.metrics);
    assert!((found.metrics.path_length_m - 2.0 * 9.95).abs() < 1e-9 && found.metrics.efficiency.is_nan());
}

#[test]
fn val_bad_poses_are_reported() {
    let good: Vec<TimedPose> = (0..50).map(|k| pose(0.05 * f64::from(k), 0.0, 0.0)).collect();
    let with = |k: usize, change: fn(&mut TimedPose)| {
        let mut poses = good.clone();
        change(&mut poses[k]);
        analysed(poses)
    };
    let nan = with(7, |p| p.position_m[2] = f64::NAN).unwrap();
    assert!(nan.poses == 49 && nan.notes[0] == "dropped 1 pose with numbers that are not finite", "{:?}", nan.notes);
    let back = with(7, |p| p.time_ns -= 500_000_000).unwrap_err();
    assert_eq!(back, LogError::Backwards { topic: "/odom".into(), message: 8, back_s: 0.45 });
    let zero = with(3, |p| p.orientation = [0.0; 4]).unwrap_err();
    assert_eq!(zero, LogError::Orientation { topic: "/odom".into(), message: 4, length: 0.0 });
    assert!(matches!(analysed(good[..2].to_vec()).unwrap_err(), LogError::TooFew { poses: 2, .. }));
    assert!(matches!(analysed(Vec::new()).unwrap_err(), LogError::TooFew { poses: 0, .. }));
    assert!(matches!(analyse(&Log::default(), &LogSettings::default()), Err(LogError::NoPoses { .. })));
    let elsewhere = LogSettings { topic: Some("/pose".into()), ..LogSettings::default() };
    let missing = analyse(&log_of(good), &elsewhere).unwrap_err().to_string();
    assert_eq!(missing, "no poses on the topic `/pose`; topics with poses: /odom");
}

/// map -> odom (rotated by 90 degrees, moving slowly) -> base_link (at 20 Hz) compose to the path in the map frame.
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

/// A unit mounted upside down, as given by a transform, measures -g - a; its band RMS equals that of the heights, within 2 %.
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
    assert!(parallel.notes[0].contains("no transform from `imu` to `base_link`"), "{:?}", parallel.notes);
}

/// 1 mm of white noise on the heights at 20 Hz gives 0.98 m/s2, which is not significant; a heave of 1.6 m/s2 in
/// 0.1 mm of noise is. The floor is accurate within 25 % (its top eighth holds 12 bins of 7 half-overlapping segments: standard
/// error of the density 14 %, of the root 7 %; 3.5 times that: false alarm 5e-4).
#[test]
fn stat_noise_is_distinguished_from_motion() {
    let mut s = Streams::for_seed(1, "log-test").stream("noise");
    let mut noisy = |sigma: f64, heave: fn(f64) -> f64| {
        let poses = (0..800).map(|k| {
            let time_s = 0.05 * f64::from(k);
            pose(time_s, heave(time_s) + sigma * s.normal(), 0.0)
        });
        analysed(poses.collect()).unwrap()
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

/// Central differences span two samples, so the same noise gives a quarter of the acceleration and half of the rate, and so does the
/// floor. Bounds as above: false alarm 5e-4 for each floor.
#[test]
fn stat_the_floor_is_that_of_the_differentiator() {
    let mut s = Streams::for_seed(6, "log-test").stream("noise");
    let poses = (0..800).map(|k| pose(0.05 * f64::from(k), 0.001 * s.normal(), 0.001 * s.normal()));
    let settings = LogSettings { differentiator: Differentiator::Gradient, ..LogSettings::default() };
    let found = analyse(&log_of(poses.collect()), &settings).unwrap();
    let [acceleration, rate] = [0.001 * 6.0f64.sqrt() / 4.0 * 400.0, 0.001 * SQRT_2 / 2.0 * 20.0];
    assert!((found.acceleration.rms / acceleration - 1.0).abs() < 0.15, "{:?}", found.acceleration);
    assert!((found.acceleration.floor / acceleration - 1.0).abs() < 0.25, "{:?}", found.acceleration);
    assert!((found.pitch_rate.floor / rate - 1.0).abs() < 0.25, "{:?}", found.pitch_rate);
}

/// At rest for 3 s with 0.1 mm of noise, then a motion that fills the spectrum up to its top: the floor comes from the rest.
#[test]
fn val_the_floor_comes_from_the_rest() {
    let mut s = Streams::for_seed(2, "log-test").stream("noise");
    let poses = (0..800).map(|k| {
        let moving = f64::from(u8::from(k > 60));
        let mut pose = pose(0.05 * f64::from(k), (0.0001 + 0.01 * moving) * s.normal(), 0.0);
        pose.position_m[0] *= moving;
        pose
    });
    let found = analysed(poses.collect()).unwrap();
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
    let found = on_ground(&analysed(poses.collect()).unwrap(), [0.0; 3], &dem, &classes);
    assert!(found.clearance_m.iter().all(|c| (c - 0.3).abs() < 1e-9), "{found:?}");
    assert!((found.shares[0] - 0.5).abs() < 0.01 && (found.shares[2] - 0.5).abs() < 0.01);
    assert!((found.known_share - 0.95).abs() < 0.01);
}

/// Between two orientations the shorter arc is taken, whatever the signs of their quaternions: halfway from 0 to a yaw of 60 deg, given
/// with either sign, is 30 deg; positions and rates are interpolated linearly.
#[test]
fn val_interpolation_takes_the_shorter_arc() {
    let (sin, cos) = libm::sincos(TAU / 12.0);
    let rate = |yaw: f64| Some([0.0, 0.0, yaw]);
    let first = TimedPose { angular_velocity_rad_s: rate(1.0), ..pose(0.0, 2.0, 0.0) };
    for sign in [1.0, -1.0] {
        let orientation = [0.0, 0.0, sign * sin, sign * cos];
        let last = TimedPose { orientation, angular_velocity_rad_s: rate(3.0), ..pose(1.0, 4.0, 0.0) };
        let middle = series::between(&first, &last, at(0.5));
        let yaw = EulerAngles::of(middle.orientation).yaw;
        assert!((yaw - TAU / 12.0).abs() < 1e-9, "{sign}: {yaw}");
        assert!((0..3).all(|i| (middle.position_m[i] - [0.5, 0.0, 3.0][i]).abs() < 1e-6), "{middle:?}");
        assert!((middle.angular_velocity_rad_s.unwrap()[2] - 2.0).abs() < 1e-6, "{middle:?}");
    }
}

/// Angular velocities come from the log where it has them, otherwise from neighbouring orientations, in the body's frame: a vehicle
/// on its side that turns about its own z axis does not yaw.
#[test]
fn val_rates_are_those_of_the_body() {
    // A turn about the body's z at 0.2 rad/s of a body rolled by 90 deg: q = roll x turn.
    let poses = (0..200).map(|k| {
        let time_s = 0.05 * f64::from(k);
        let (half, (sin, cos)) = (std::f64::consts::FRAC_1_SQRT_2, libm::sincos(0.1 * time_s));
        TimedPose { orientation: [half * cos, -half * sin, half * sin, half * cos], ..pose(time_s, 0.0, 0.0) }
    });
    let found = analysed(poses.collect()).unwrap();
    for state in &found.pieces[0] {
        let [x, y, z] = state.angular_velocity_rad_s;
        assert!(x.abs() < 1e-9 && y.abs() < 1e-9 && (z - 0.2).abs() < 1e-4, "{state:?}");
    }
    let stated = (0..200)
        .map(|k| TimedPose { angular_velocity_rad_s: Some([0.3, 0.4, 0.5]), ..pose(0.05 * f64::from(k), 0.0, 0.0) });
    let found = analysed(stated.collect()).unwrap();
    assert!((found.metrics.rms_body_roll_rate_rad_s - 0.3).abs() < 1e-12);
    assert!((found.metrics.rms_body_pitch_rate_rad_s - 0.4).abs() < 1e-12);
}

/// Mean squares are weighted by the samples of the pieces: 200 samples at 0.1 rad/s and 600 at 0.3 rad/s; the largest pitch is that of
/// either piece, and each piece adds its own path.
#[test]
fn val_pieces_are_pooled_by_their_samples() {
    let piece = |from_s: f64, count: u32, rate: f64, pitch: f64| {
        (0..count).map(move |k| TimedPose {
            angular_velocity_rad_s: Some([0.0, rate, 0.0]),
            ..pose(from_s + 0.05 * f64::from(k), 0.0, pitch)
        })
    };
    let found = analysed(piece(0.0, 200, 0.1, 0.25).chain(piece(60.0, 600, 0.3, 0.05)).collect()).unwrap();
    assert_eq!((found.pieces.len(), found.poses), (2, 800));
    let expected = ((200.0 * 0.01 + 600.0 * 0.09) / 800.0f64).sqrt();
    assert!((found.metrics.rms_body_pitch_rate_rad_s - expected).abs() < 1e-12, "{:?}", found.metrics);
    assert!((found.metrics.max_pitch_rad - 0.25).abs() < 1e-12);
    assert!((found.metrics.path_length_m - (9.95 + 29.95)).abs() < 1e-6);
    assert!((found.duration_s - 89.95).abs() < 1e-9 && found.start_ns == EPOCH_NS);
}

/// Poses sent twice count once; a pause of five intervals is not yet a gap, a longer one is.
#[test]
fn val_repeated_poses_and_short_pauses() {
    let mut poses: Vec<TimedPose> = (0..100).map(|k| pose(0.1 * f64::from(k), 0.0, 0.0)).collect();
    poses.insert(30, poses[30]);
    let found = analysed(poses).unwrap();
    assert_eq!((found.poses, found.gaps_s.len()), (100, 0));
    assert_eq!(found.notes[0], "dropped 1 pose with the same time as the previous one");
    let paused = |pause_s: f64| {
        let before = (0..50).map(|k| pose(0.1 * f64::from(k), 0.0, 0.0));
        let after = (0..50).map(move |k| pose(4.9 + pause_s + 0.1 * f64::from(k), 0.0, 0.0));
        analysed(before.chain(after).collect()).unwrap().gaps_s.len()
    };
    assert_eq!((paused(0.49), paused(0.51)), (0, 1));
}

/// A steady climb is not a vibration: its trend is removed before the spectrum is taken.
#[test]
fn val_a_climb_has_no_acceleration_in_the_band() {
    let poses = (0..800).map(|k| pose(0.05 * f64::from(k), 0.3 * 0.05 * f64::from(k), 0.0)).collect();
    let band = analysed(poses).unwrap().band_acceleration.unwrap();
    assert!(band.rms < 1e-9, "{band:?}");
    // Outside the band of 0.2 to 8 Hz nothing counts: a heave at 9 Hz.
    let fast = |k: u32| pose(0.05 * f64::from(k), 0.02 * libm::sin(TAU * 9.0 * 0.05 * f64::from(k)), 0.0);
    let outside = analysed((0..800).map(fast).collect()).unwrap().band_acceleration.unwrap();
    let exact = 0.02 * (TAU * 9.0) * (TAU * 9.0) / SQRT_2;
    assert!(outside.rms < 0.01 * exact, "{outside:?} of {exact}");
}

/// 1 mrad of white noise on the pitch at 20 Hz gives a rate of `sqrt(2)` x 20 mrad/s, and so says the floor: first differences have
/// twice the variance, second ones six times. Bounds are 5 standard errors, 3 % of the rate and 7 % of the floor (see above): false
/// alarm 6e-7 each.
#[test]
fn stat_noise_of_angles_has_its_own_gain() {
    let mut s = Streams::for_seed(4, "log-test").stream("noise");
    let poses = (0..800).map(|k| pose(0.05 * f64::from(k), 0.0, 0.001 * s.normal()));
    let found = analysed(poses.collect()).unwrap();
    let expected = 0.001 * SQRT_2 * 20.0;
    assert!((found.pitch_rate.rms / expected - 1.0).abs() < 0.15, "{:?} {expected}", found.pitch_rate);
    assert!((found.pitch_rate.floor / expected - 1.0).abs() < 0.35, "{:?} {expected}", found.pitch_rate);
    assert!(!found.pitch_rate.tells() && found.roll_rate.rms < 1e-12, "{:?}", found.roll_rate);
}
