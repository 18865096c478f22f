//! Missions along polylines.

use super::actuation::Limits;
use super::controller::{Controller, PlanPose};
use super::*;
use crate::metrics::{cross_track, progress_m};
use crate::missions::Polyline;

fn line(points_m: &[[f64; 2]]) -> Polyline {
    Polyline::new(points_m).unwrap()
}

/// An arc about a centre, of `through_deg` from `from_deg`, in segments of about 1 deg.
fn arc([x, y]: [f64; 2], radius_m: f64, from_deg: f64, through_deg: f64) -> Vec<[f64; 2]> {
    let count = through_deg.abs().ceil();
    let at = |k: f64| {
        let (sin, cos) = libm::sincos((from_deg + through_deg * k / count).to_radians());
        [x + radius_m * cos, y + radius_m * sin]
    };
    (0..=count as usize).map(|k| at(k as f64)).collect()
}

/// A left and a right circle side by side; start, crossing and goal are the same point.
fn figure_eight([x, y]: [f64; 2], radius_m: f64) -> Polyline {
    let left = arc([x - radius_m, y], radius_m, 0.0, 360.0);
    let right = arc([x + radius_m, y], radius_m, 180.0, -360.0);
    line(&[left, right].concat())
}

fn flat(size_m: f64) -> Grid {
    terrain([size_m; 2], |_, _| 0.0)
}

fn followed(dem: &Grid, vehicle: &str, along: &Polyline) -> (Mission, Recording) {
    let mission = Mission::along(0, along.clone());
    let recording = run(dem, &mission, |p| p.vehicle = vehicle.to_owned());
    (mission, recording)
}

/// Steady circle of a vehicle that pursues a circle of radius R at look-ahead L along it, by bisection of `turn(rho)`: the
/// commanded curvature minus the curvature that keeps it on the circle of radius `rho`.
fn steady_radius_m(radius_m: f64, turn: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.7 * radius_m, 1.5 * radius_m);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        // Farther out, pursuit turns more tightly than the circle requires.
        if turn(middle) > 0.0 { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

/// Bearing left of the tangent, and distance, of the look-ahead point for a vehicle on a concentric circle of radius `rho`.
fn sight(rho: f64, radius_m: f64, lookahead_m: f64) -> (f64, f64) {
    let (sin, cos) = libm::sincos(lookahead_m / radius_m);
    let (left, ahead) = (rho - radius_m * cos, radius_m * sin);
    (libm::atan2(left, ahead), (left * left + ahead * ahead).sqrt())
}

/// A point vehicle that follows its commands exactly, on three laps of a circle, with steering gains g. It is steady on the circle
/// of radius rho where `2 g sin a / d = 1 / rho`, or `(2 g - 1) rho^2 + 2 (1 - g) R cos(L / R) rho - R^2 = 0`; the plain arc
/// (g = 1) has no error. Tolerance 2 mm: sagitta of the segments 0.2 mm, travel within a control period 20 mm.
#[test]
fn val_pursuit_of_a_circle_has_the_closed_form_error() {
    const RADIUS_M: f64 = 6.0;
    let circle = line(&arc([0.0, 0.0], RADIUS_M, 0.0, 3.0 * 360.0));
    for gain in [0.75, 1.0, 1.5] {
        let (vehicle, settings) = prepared(|p| p.controller.steering_gain = gain);
        let limits = Limits::of(&vehicle);
        let mut controller = Controller::new(&Mission::along(0, circle.clone()));
        let mut pose = PlanPose { x: RADIUS_M, y: 0.0, yaw: 0.25 * TAU };
        for _ in 0..50 * 100 {
            controller.update(pose, &settings, &limits, 0.02);
            let (speed, rate) = (controller.command.speed_m_s, controller.command.yaw_rate_rad_s);
            let (sin, cos) = libm::sincos(pose.yaw + 0.5 * rate * 0.02);
            pose = PlanPose {
                x: pose.x + 0.02 * speed * cos,
                y: pose.y + 0.02 * speed * sin,
                yaw: pose.yaw + 0.02 * rate,
            };
        }
        let (a, b) = (2.0 * gain - 1.0, (1.0 - gain) * RADIUS_M * libm::cos(settings.lookahead_m(1.0) / RADIUS_M));
        let expected = ((b * b + a * RADIUS_M * RADIUS_M).sqrt() - b) / a;
        let by_balance = steady_radius_m(RADIUS_M, |rho| {
            let (bearing, distance) = sight(rho, RADIUS_M, settings.lookahead_m(1.0));
            2.0 * gain * libm::sin(bearing) / distance - 1.0 / rho
        });
        let found = (pose.x * pose.x + pose.y * pose.y).sqrt();
        assert!((expected - by_balance).abs() < 1e-9, "{gain}: {expected} {by_balance}");
        assert!((found - expected).abs() < 2e-3, "{gain}: {found} {expected}");
        assert!((controller.command.cross_track_m - (RADIUS_M - expected)).abs() < 3e-3, "{gain}");
    }
}

/// The car on two laps: its centre, which is steered along the circle, lies b = 1.35 m ahead of the axle about which it turns, so
/// it points `asin(b / rho)` outwards, and the balance is `2 sin(a + asin(b / rho)) / d = 1 / sqrt(rho^2 - b^2)`. Tolerance
/// 2 cm of an error of 84 cm to the inside.
#[test]
fn val_a_car_on_a_circle_has_the_closed_form_error() {
    const RADIUS_M: f64 = 12.0;
    let (dem, circle) = (flat(40.0), line(&arc([20.0, 20.0], RADIUS_M, 0.0, 720.0)));
    let (_, recording) = followed(&dem, "ugv_4x4", &circle);
    assert_eq!(outcome(&recording).kind, EventKind::Success, "{:?}", outcome(&recording));
    let expected = steady_radius_m(RADIUS_M, |rho| {
        let (bearing, distance) = sight(rho, RADIUS_M, 8.1);
        let out = libm::asin(1.35 / rho);
        2.0 * libm::sin(bearing + out) / distance - 1.0 / (rho * rho - 1.35 * 1.35).sqrt()
    });
    let steady = &recording.commands[recording.commands.len() / 2..recording.commands.len() * 9 / 10];
    let found = RADIUS_M - sums::mean(&steady.iter().map(|c| c.cross_track_m).collect::<Vec<_>>());
    assert!((found - expected).abs() < 0.02, "{found} {expected}");
}

/// A polyline of two points, and one with a vertex in the middle, give the same drive as the straight mission: same time to a
/// sample, same position to 1 mm.
#[test]
fn val_a_straight_polyline_is_the_straight_mission() {
    let dem = terrain([25.0, 10.0], |x, y| 0.03 * libm::sin(2.0 * x + y));
    let (start_m, goal_m) = ([4.0, 3.0], [20.0, 6.0]);
    let straight = run(&dem, &Mission::between(0, start_m, goal_m), |_| ());
    for middle in [&[][..], &[[12.0, 4.5]]] {
        let along = line(&[&[start_m], middle, &[goal_m]].concat());
        let (mission, recording) = followed(&dem, "husky_a200", &along);
        assert_eq!(outcome(&recording).kind, EventKind::Success);
        assert!((outcome(&recording).time_s - outcome(&straight).time_s).abs() < 0.05);
        for (a, b) in recording.states.iter().zip(&straight.states) {
            assert!((0..3).all(|i| (a.position_m[i] - b.position_m[i]).abs() < 1e-3), "{a:?} {b:?}");
        }
        let progress = [&mission, &Mission::between(0, start_m, goal_m)].map(|m| progress_m(m, &recording));
        assert!((progress[0] - progress[1]).abs() < 1e-6, "{progress:?}");
    }
}

/// Straight missions are written without a polyline key and read back; missions along polylines round-trip too.
#[test]
fn gold_missions_in_files() {
    let straight = Mission::between(0, [1.0, 2.0], [3.0, 2.0]);
    let text = serde_json::to_string(&straight).unwrap();
    assert_eq!(text, r#"{"index":0,"start_m":[1.0,2.0],"goal_m":[3.0,2.0],"heading_rad":0.0,"draws":1}"#);
    let loops = Mission::along(1, figure_eight([10.0, 10.0], 4.0));
    for mission in [straight, loops] {
        let text = serde_json::to_string(&mission).unwrap();
        assert_eq!(serde_json::from_str::<Mission>(&text).unwrap(), mission);
    }
}

/// Every vehicle drives a figure eight whose start, crossing and goal coincide: it arrives after both loops, not before. Path and
/// time are those of the complete line within 10 %; the error stays below a quarter of the radius.
#[test]
fn val_every_vehicle_drives_a_figure_eight() {
    let dem = flat(50.0);
    for (vehicle, radius_m) in [("husky_a200", 4.0), ("ugv_4x4", 10.0), ("rocker_bogie_rover", 4.0)] {
        let eight = figure_eight([25.0, 25.0], radius_m);
        let (mission, recording) = followed(&dem, vehicle, &eight);
        assert_eq!(outcome(&recording).kind, EventKind::Success, "{vehicle} {:?}", outcome(&recording));
        let metrics = Metrics::of(&recording.states, 20.0, Differentiator::default());
        let (error, progress) = (cross_track(&mission, &recording), progress_m(&mission, &recording));
        assert!((metrics.path_length_m / eight.length_m() - 1.0).abs() < 0.1, "{vehicle} {}", metrics.path_length_m);
        assert!(progress > eight.length_m() - 0.6, "{vehicle} {progress}");
        assert!(error.max_m < 0.25 * radius_m && error.rms_m < error.max_m, "{vehicle} {error:?}");
    }
}

/// A closed square, corners of 120 deg, and a dead end: vehicles that turn on the spot follow the complete line, within the
/// look-ahead distance.
#[test]
fn val_sharp_corners_are_driven() {
    let dem = flat(50.0);
    let square = line(&[[20.0, 20.0], [30.0, 20.0], [30.0, 30.0], [20.0, 30.0], [20.0, 20.0]]);
    let zigzag = line(&[[10.0, 20.0], [20.0, 20.0], [15.0, 28.66], [25.0, 28.66]]);
    let dead_end = line(&[[15.0, 25.0], [30.0, 25.0], [18.0, 25.0]]);
    for (vehicle, lookahead_m) in [("husky_a200", 1.536), ("rocker_bogie_rover", 3.0)] {
        for along in [&square, &zigzag, &dead_end] {
            let (mission, recording) = followed(&dem, vehicle, along);
            assert_eq!(outcome(&recording).kind, EventKind::Success, "{vehicle} {:?}", outcome(&recording));
            let metrics = Metrics::of(&recording.states, 20.0, Differentiator::default());
            let error = cross_track(&mission, &recording);
            assert!(error.max_m < lookahead_m, "{vehicle} {error:?}");
            assert!(metrics.path_length_m > along.length_m() - 0.5 - 4.0 * lookahead_m, "{vehicle}");
        }
    }
}

/// The car swings wide at corners too sharp for it, and still reaches the goal.
#[test]
fn val_a_car_swings_wide_at_sharp_corners() {
    let dem = flat(60.0);
    let square = line(&[[15.0, 15.0], [45.0, 15.0], [45.0, 45.0], [15.0, 45.0], [15.0, 15.0]]);
    let zigzag = line(&[[10.0, 20.0], [45.0, 20.0], [25.0, 45.0]]);
    for along in [square, zigzag] {
        let (mission, recording) = followed(&dem, "ugv_4x4", &along);
        assert_eq!(outcome(&recording).kind, EventKind::Success, "{:?}", outcome(&recording));
        assert!(progress_m(&mission, &recording) > along.length_m() - 0.6);
    }
}

#[test]
fn prop_repeated_points_change_no_bit() {
    let corner = [[4.0, 4.0], [9.0, 4.0], [9.0, 8.0]];
    let repeated: Vec<[f64; 2]> = corner.iter().flat_map(|&p| [p; 3]).collect();
    let [a, b] = [line(&corner), line(&repeated)].map(|along| followed(&flat(14.0), "husky_a200", &along).1);
    assert_eq!(a, b);
    assert_eq!(outcome(&a).kind, EventKind::Success);
}

/// A polyline that the vehicle cannot finish ends like any mission; the event gives the remaining length of the line.
#[test]
fn val_remaining_distance_is_measured_along_the_line() {
    let square = line(&[[4.0, 4.0], [10.0, 4.0], [10.0, 10.0], [4.0, 10.0], [4.0, 4.0]]);
    let recording = run(&flat(14.0), &Mission::along(0, square), |p| p.timeout_s = 3.0);
    let event = outcome(&recording);
    let left_m: f64 = event.text.split(' ').next().unwrap().parse().unwrap();
    assert_eq!((event.kind, event.time_s), (EventKind::Timeout, 3.0));
    assert!((20.5..22.0).contains(&left_m), "{}", event.text);
    assert!(recording.events[0].text.ends_with("course of 24.00 m"));
}

#[test]
fn val_lookahead_grows_with_the_commanded_speed() {
    let (_, settings) = prepared(|p| p.controller.lookahead_time_s = Some(2.0));
    assert_eq!([0.0, 0.5, 1.0].map(|speed| settings.lookahead_m(speed)), [1.536, 1.536, 2.0]);
    let (_, settings) = prepared(|_| ());
    assert_eq!(settings.lookahead_m(100.0), 1.536);
    let mut parameters = TraverseParameters::default();
    parameters.controller.lookahead_time_s = Some(-1.0);
    assert_eq!(parameters.prepare().unwrap_err().key, "controller.lookahead_time_s");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// On any polyline, the steering does not panic and the mission ends with an outcome.
    #[test]
    fn prop_any_polyline_has_an_outcome(
        points in prop::collection::vec(prop::array::uniform2(prop_oneof![
            8 => 1.0..5.0f64,
            1 => prop::sample::select(vec![-1e9, 3.0, 1e150]),
        ]), 2..9),
    ) {
        let Ok(along) = Polyline::new(&points) else { return Ok(()) };
        let mission = Mission::along(0, along);
        let recording = run(&flat(6.0), &mission, |p| (p.timeout_s, p.settle_s) = (2.0, 0.1));
        prop_assert!(outcome(&recording).kind != EventKind::Start);
        prop_assert!(recording.commands.iter().all(|c| c.yaw_rate_rad_s.is_finite() && c.cross_track_m.is_finite()));
        let progress = progress_m(&mission, &recording);
        prop_assert!(progress >= 0.0 && progress <= mission.course_length_m());
    }
}
