//! Parts of the model one by one, against numbers computed by hand.

use super::actuation::{self, Command, Limits};
use super::controller::{Controller, PlanPose, wrapped};
use super::lanes::LANES;
use super::*;
use pulp::{Simd, WithSimd, cast};
use sastrugi_numeric::simd::Vectors;
use std::f64::consts::{FRAC_PI_4, PI};

fn of(name: &str) -> Vehicle {
    prepared(|p| p.vehicle = name.to_owned()).0
}

/// Springs, dampers and stops of the 4x4: preload 1360 kg / 4, 30 kN/m, 2 kN s/m; beyond 0.15 m the stop adds 300 kN/m.
#[test]
fn val_a_spring_pushes_down_and_its_stops_push_back() {
    let vehicle = of("ugv_4x4");
    let joints = linkage::Joints { position: vec![0.0, 0.1, 0.2, -0.2], rate: vec![0.0, -0.3, 0.1, 0.0] };
    let mut forces = vec![0.0; 4];
    vehicle.linkage.push(&joints, &mut forces);
    let preload_n = 1360.0 * 9.80665 / 4.0;
    let expected = [
        -preload_n,
        -preload_n - 3000.0 + 600.0,
        -preload_n - 6000.0 - 200.0 - 300_000.0 * 0.05,
        -preload_n + 6000.0 + 300_000.0 * 0.05,
    ];
    assert!(forces.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{forces:?} {expected:?}");
}

/// Joints of the rover: 20 N m s/rad of friction, and stops of 2 kN m/rad at 30 deg (differential) and 45 deg (bogies).
#[test]
fn val_a_rocker_stops_before_a_bogie() {
    let vehicle = of("rocker_bogie_rover");
    let joints = linkage::Joints { position: vec![0.6, 0.6, -0.9], rate: vec![-0.5, 0.2, 0.0] };
    let mut forces = vec![0.0; 3];
    vehicle.linkage.push(&joints, &mut forces);
    let expected = [10.0 - 2000.0 * (0.6 - PI / 6.0), -4.0, 2000.0 * (0.9 - PI / 4.0)];
    assert!(forces.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{forces:?} {expected:?}");
}

/// The differential raises the front wheel of one side and lowers that of the other; a bogie raises its rear wheel as it lowers its
/// middle wheel. Positive angles turn nose down.
#[test]
fn val_rockers_turn_in_opposite_directions() {
    let vehicle = of("rocker_bogie_rover");
    let rise = |position: Vec<f64>| -> Vec<f64> {
        let joints = linkage::Joints { position, rate: vec![0.0; 3] };
        let carriers = vehicle.linkage.carriers(&vehicle.hubs, &joints);
        carriers.iter().zip(&vehicle.hubs).map(|(carrier, hub)| carrier.hub[2] - hub[2]).collect()
    };
    // Front wheels lie 0.7 m ahead of the rocker's pivot and 0.275 m below it: the height changes by -+0.7 sin q + 0.275 (1 - cos q).
    let rocked = rise(vec![0.1, 0.0, 0.0]);
    let (sin, cos) = libm::sincos(0.1);
    assert!((rocked[0] - (-0.7 * sin + 0.275 * (1.0 - cos))).abs() < 1e-12, "{rocked:?}");
    assert!((rocked[1] - (0.7 * sin + 0.275 * (1.0 - cos))).abs() < 1e-12, "{rocked:?}");
    // Only the left bogie turns: its wheels lie 0.35 m ahead of its pivot and behind it, 0.075 m below.
    let tilted = rise(vec![0.0, 0.1, 0.0]);
    assert!((tilted[2] - (-0.35 * sin + 0.075 * (1.0 - cos))).abs() < 1e-12, "{tilted:?}");
    assert!((tilted[4] - (0.35 * sin + 0.075 * (1.0 - cos))).abs() < 1e-12, "{tilted:?}");
    assert!([0, 1, 3, 5].into_iter().all(|wheel: usize| tilted[wheel].abs() < 1e-12), "{tilted:?}");
}

/// The ceiling of a bilinear cell is the highest cell centre within reach of it, widened by a cell, as a search over all of them
/// finds it; next to the edge or to a hole it is infinite.
#[test]
fn val_the_ceiling_is_the_highest_cell_within_reach() {
    let vehicle = of("husky_a200");
    let dem = terrain([6.0, 5.0], |x, y| 0.3 * libm::sin(5.0 * x + 2.0 * y) + 0.1 * libm::cos(17.0 * y - 3.0 * x));
    let ground = Ground::new(&dem, &vehicle).unwrap();
    let reach = (vehicle.reach_m() / 0.05).ceil() as usize;
    assert!((2..8).contains(&reach), "{reach}");
    let mut stream = Streams::for_seed(4, "test").stream("ceiling");
    for _ in 0..300 {
        let (x, y) = (stream.uniform_in(1.0, 5.0), stream.uniform_in(1.0, 4.0));
        // South-west corner of the bilinear cell, rows counted from the south.
        let (col, row) = (((x - 0.025) / 0.05) as usize, ((y - 0.025) / 0.05) as usize);
        let mut highest = f32::NEG_INFINITY;
        for j in row - reach - 1..=row + reach + 2 {
            for i in col - reach - 1..=col + reach + 2 {
                highest = highest.max(dem.at(dem.rows() - 1 - j, i) as f32);
            }
        }
        assert_eq!(ground.ceiling(x, y), f64::from(highest), "{x} {y}");
    }
    assert_eq!(ground.ceiling(0.1, 2.5), f64::INFINITY);
    let mut holed = dem;
    holed.values[50 * 120 + 60] = f64::NAN;
    let ground = Ground::new(&holed, &vehicle).unwrap();
    assert_eq!(ground.ceiling(3.1, 2.5), f64::INFINITY);
    assert!(ground.ceiling(4.5, 2.5).is_finite());
}

/// Heights and gradients of four points.
struct FourPoints<'a> {
    ground: &'a Ground,
    x: [f64; LANES],
    y: [f64; LANES],
}

impl WithSimd for FourPoints<'_> {
    type Output = [[f64; LANES]; 3];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let cells = self.ground.cells(simd, cast(self.x), cast(self.y));
        let [dx, dy] = cells.gradients();
        [cast(cells.heights()), cast(dx), cast(dy)]
    }
}

/// Four points side by side have the bits of one at a time, with the vectors of this CPU and with those of every CPU: on the terrain,
/// next to a hole, in the rim, beyond it, and at no finite place.
#[test]
fn prop_four_points_have_the_bits_of_one() {
    let vehicle = of("husky_a200");
    let mut dem = terrain([6.0, 5.0], |x, y| 0.3 * libm::sin(5.0 * x + 2.0 * y) + 0.1 * libm::cos(17.0 * y - 3.0 * x));
    dem.values[50 * 120 + 60] = f64::NAN;
    let ground = Ground::new(&dem, &vehicle).unwrap();
    let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
    let mut stream = Streams::for_seed(5, "test").stream("four-points");
    let mut defined = 0;
    for round in 0..2000 {
        let mut x: [f64; LANES] = std::array::from_fn(|_| stream.uniform_in(-2.0, 8.0));
        let y: [f64; LANES] = std::array::from_fn(|_| stream.uniform_in(-2.0, 7.0));
        if round % 8 == 0 {
            x[round / 8 % LANES] = [f64::NAN, f64::INFINITY, -1e300, 1e12, 3.0e9][round / 8 % 5];
        }
        for vectors in [Vectors::best(), Vectors::Baseline] {
            let [heights, dx, dy] = vectors.run(FourPoints { ground: &ground, x, y });
            for lane in 0..LANES {
                let (z, (gx, gy)) = (ground.height(x[lane], y[lane]), ground.gradient(x[lane], y[lane]));
                let at = (x[lane], y[lane]);
                assert!(same(heights[lane], z), "{at:?}: {} {z}", heights[lane]);
                assert!(same(dx[lane], gx) && same(dy[lane], gy), "{at:?}: {} {gx} {} {gy}", dx[lane], dy[lane]);
                defined += usize::from(z.is_finite());
            }
        }
    }
    assert!((3000..15_000).contains(&defined), "{defined}");
}

/// On a plane of gradient (0.3, -0.4) a point loses at most `sqrt(1 + 0.25)` of its height per metre; heights are rounded to single
/// precision. Ground with a hole has no bound.
#[test]
fn val_steepness_is_that_of_the_steepest_cells() {
    let vehicle = of("husky_a200");
    let mut dem = terrain([3.0, 2.0], |x, y| 0.3 * x - 0.4 * y);
    let steepness = Ground::new(&dem, &vehicle).unwrap().steepness();
    assert!((steepness - 1.25f64.sqrt()).abs() < 1e-4, "{steepness}");
    dem.values[7] = f64::NAN;
    assert_eq!(Ground::new(&dem, &vehicle).unwrap().steepness(), f64::INFINITY);
}

/// Tip-over beyond 75 deg of roll or pitch, to either side, and upside down; not at 74 deg, nor with both at 50 deg.
#[test]
fn val_a_vehicle_tips_beyond_its_limit() {
    let limit = libm::sincos(75f64.to_radians());
    let tipped = |roll_deg: f64, pitch_deg: f64| {
        let ((sr, cr), (sp, cp)) =
            (libm::sincos(0.5 * roll_deg.to_radians()), libm::sincos(0.5 * pitch_deg.to_radians()));
        // Pitch, then roll in the pitched frame.
        let orientation = [sr * cp, cr * sp, -sr * sp, cr * cp];
        let body = body::Body { position: [0.0; 3], velocity: [0.0; 3], orientation, rate: [0.0; 3] };
        body.axes().are_tipped(limit)
    };
    for sign in [1.0, -1.0] {
        assert!(!tipped(sign * 74.0, 0.0) && tipped(sign * 76.0, 0.0) && tipped(sign * 120.0, 0.0), "{sign}");
        assert!(!tipped(0.0, sign * 74.0) && tipped(0.0, sign * 76.0), "{sign}");
        assert!(!tipped(sign * 50.0, 50.0), "{sign}");
    }
    assert!(tipped(180.0, 0.0) && !tipped(0.0, 0.0));
}

/// base_link lies below the centre of mass, whatever the attitude, and moves with the rotation about it.
#[test]
fn val_base_link_moves_with_the_body() {
    let vehicle = of("husky_a200");
    let height_m = vehicle.centre_of_mass_m[2];
    let (sin, cos) = libm::sincos(FRAC_PI_4);
    // Rolled onto its right side by 90 deg: the body's up points south, so base_link lies north of the centre of mass.
    let body = body::Body {
        position: [1.0, 2.0, 3.0],
        velocity: [0.5, 0.0, 0.0],
        orientation: [sin, 0.0, 0.0, cos],
        rate: [2.0, 0.0, 0.0],
    };
    let (position, velocity) = body.base(&vehicle);
    assert!(vector::norm(vector::sub(position, [1.0, 2.0 + height_m, 3.0])) < 1e-12, "{position:?}");
    // The roll rate of 2 rad/s about east lifts what lies in the north.
    assert!(vector::norm(vector::sub(velocity, [0.5, 0.0, 2.0 * height_m])) < 1e-12, "{velocity:?}");
}

/// A rover that turns on the spot to the left sets its corner wheels along the circle about its centre; wheels of the left side
/// run backwards. Hubs 0.7 m ahead and 0.53 m to the side, wheels of 0.125 m.
#[test]
fn val_a_turn_on_the_spot_goes_round_the_centre() {
    let vehicle = of("rocker_bogie_rover");
    let command = Command { yaw_rate_rad_s: 0.5, ..Command::default() };
    let mut angles = vec![0.0; 6];
    actuation::steering_angles(&vehicle, &command, &mut angles);
    let along = libm::atan2(0.7, 0.53);
    for (angle, expected) in angles.iter().zip([-along, along, 0.0, 0.0, along, -along]) {
        assert!((angle - expected).abs() < 1e-12, "{angles:?}");
    }
    let mut servos = Vec::new();
    actuation::servos(&vehicle, &command, &angles, &mut servos);
    let corner = 0.5 * (0.7f64 * 0.7 + 0.53 * 0.53).sqrt() / 0.125;
    let middle = 0.5 * 0.53 / 0.125;
    for (servo, expected) in servos.iter().zip([-corner, corner, -middle, middle, -corner, corner]) {
        assert!((servo.target - expected).abs() < 1e-12, "{servo:?} {expected}");
        assert_eq!((servo.gain, servo.limit), (60.0, 25.0));
    }
    // A vehicle that stands still keeps its steering; a wheel is never steered beyond its limit of 60 deg.
    actuation::steering_angles(&vehicle, &Command::default(), &mut angles);
    assert!((angles[1] - along).abs() < 1e-12);
    let tight = Command { speed_m_s: 0.27, yaw_rate_rad_s: 0.5, ..Command::default() };
    actuation::steering_angles(&vehicle, &tight, &mut angles);
    assert_eq!(angles[0], 60f64.to_radians());
}

/// Skid steering: sides run at `(v -+ w b / 2) / r`, the track widened by 1.875; a left turn speeds up the right side.
#[test]
fn val_skid_steering_drives_its_sides_apart() {
    let vehicle = of("husky_a200");
    let mut servos = Vec::new();
    let command = Command { speed_m_s: 0.8, yaw_rate_rad_s: 0.4, ..Command::default() };
    actuation::servos(&vehicle, &command, &[0.0; 4], &mut servos);
    let outward = 0.4 * 0.5 * 0.5708 * 1.875;
    assert_eq!(servos.len(), 2);
    assert!((servos[0].target - (0.8 - outward) / 0.1651).abs() < 1e-12, "{servos:?}");
    assert!((servos[1].target - (0.8 + outward) / 0.1651).abs() < 1e-12, "{servos:?}");
}

/// The smallest circle of the 4x4 is the one on which its inner front wheel is at 30 deg: 2.7 m / tan 30 deg + 0.8 m. Vehicles that
/// turn on the spot have none.
#[test]
fn val_the_smallest_circle_is_that_of_the_inner_wheel() {
    let radius_m = |name: &str| Limits::of(&of(name)).turn_radius_m;
    assert!((radius_m("ugv_4x4") - (2.7 * 3f64.sqrt() + 0.8)).abs() < 1e-9, "{}", radius_m("ugv_4x4"));
    assert_eq!((radius_m("husky_a200"), radius_m("rocker_bogie_rover")), (0.0, 0.0));
}

/// Commands after the controller has looked 200 times from the same pose at the line from (0, 0) to (10, 0).
fn commanded(controller: &mut Controller, pose: PlanPose) -> Command {
    let (vehicle, settings) = prepared(|_| ());
    let limits = Limits::of(&vehicle);
    (0..200).for_each(|_| controller.update(pose, &settings, &limits, 0.02));
    controller.command
}

/// From 0.5 m beside the line, the arc through a point 1.536 m ahead on it has the curvature `-1 / d^2`, `d^2 = 1.536^2 + 0.5^2`,
/// towards the line; the error is positive to the left.
#[test]
fn val_pursuit_turns_towards_the_line() {
    for side in [1.0, -1.0] {
        let mut controller = Controller::new(&Mission::between(0, [0.0, 0.0], [10.0, 0.0]));
        let command = commanded(&mut controller, PlanPose { x: 2.0, y: side * 0.5, yaw: 0.0 });
        assert!((command.speed_m_s - 1.0).abs() < 1e-12, "{command:?}");
        let expected = -side / (1.536 * 1.536 + 0.25);
        assert!((command.yaw_rate_rad_s - expected).abs() < 1e-9, "{command:?} {expected}");
        assert!((command.cross_track_m - side * 0.5).abs() < 1e-12, "{command:?}");
        assert!((command.heading_error_rad + side * libm::atan2(0.5, 1.536)).abs() < 1e-12, "{command:?}");
        assert!((command.distance_to_goal_m - 64.25f64.sqrt()).abs() < 1e-12, "{command:?}");
    }
}

/// A vehicle that faces away turns on the spot towards the nearer side at 1 rad/s, and resumes only once it faces its point within
/// 30 deg; one that faces it within 90 deg drives.
#[test]
fn val_a_turn_on_the_spot_has_two_thresholds() {
    let pose = |yaw: f64| PlanPose { x: 5.0, y: 0.0, yaw };
    let new = || Controller::new(&Mission::between(0, [0.0, 0.0], [10.0, 0.0]));
    let mut controller = new();
    for yaw in [PI - 0.1, 1.0, 0.6] {
        let command = commanded(&mut controller, pose(yaw));
        assert_eq!((command.speed_m_s, command.yaw_rate_rad_s), (0.0, -1.0), "{yaw}");
    }
    assert!((commanded(&mut controller, pose(0.5)).speed_m_s - 1.0).abs() < 1e-12);
    assert!((commanded(&mut new(), pose(1.0)).speed_m_s - 1.0).abs() < 1e-12);
    assert_eq!(commanded(&mut new(), pose(0.1 - PI)).yaw_rate_rad_s, 1.0);
}

/// Commands change by at most 3 m/s2 and 6 rad/s2, and stay within 2 rad/s.
#[test]
fn val_commands_change_within_the_limits() {
    let (vehicle, settings) = prepared(|_| ());
    let limits = Limits::of(&vehicle);
    let mut controller = Controller::new(&Mission::between(0, [0.0, 0.0], [10.0, 0.0]));
    // Next to the goal, where the arc is as tight as a tenth of a metre allows.
    let pose = PlanPose { x: 9.98, y: 0.01, yaw: 0.0 };
    controller.update(pose, &settings, &limits, 0.02);
    let first = controller.command;
    assert!((first.speed_m_s - 0.06).abs() < 1e-12 && (first.yaw_rate_rad_s + 0.12).abs() < 1e-12, "{first:?}");
    let last = commanded(&mut controller, pose);
    assert!((last.yaw_rate_rad_s + 2.0).abs() < 1e-12, "{last:?}");
}

#[test]
fn val_angles_are_wrapped_to_half_a_turn() {
    for (angle, expected) in [(0.3, 0.3), (PI + 0.1, 0.1 - PI), (-PI - 0.1, PI - 0.1), (7.0 * PI + 0.2, 0.2 - PI)] {
        assert!((wrapped(angle) - expected).abs() < 1e-12, "{angle}");
    }
}

/// Without friction the wheels spin and the vehicle stays where it is: it is stuck at the moment at which the rule says so.
#[test]
fn val_a_vehicle_without_grip_is_stuck_on_time() {
    let dem = terrain([10.0, 6.0], |_, _| 0.0);
    let recording = run(&dem, &Mission::between(0, [3.0, 3.0], [7.0, 3.0]), |p| {
        (p.surface.wheel_friction, p.stuck_time_s) = (Some(0.0), 2.0);
    });
    assert_eq!((outcome(&recording).kind, outcome(&recording).time_s), (EventKind::Stuck, 2.0));
    assert!(outcome(&recording).text.starts_with("less than 0.2 m of motion in 2 s at (3.00, 3.00) m"));
    // The motors turn the wheels at the commanded 1 m/s.
    let wheel = recording.wheels.last().unwrap().wheels[0];
    assert!((wheel.spin_rad_s * 0.1651 - 1.0).abs() < 0.1 && wheel.slip_ratio > 0.9, "{wheel:?}");
    assert_eq!((wheel.longitudinal_force_n, wheel.lateral_force_n), (0.0, 0.0));
}

/// Momentum of all masses, their angular momentum about the origin, and the moment of the weight about it.
fn momenta(vehicle: &Vehicle, body: &body::Body, joints: &linkage::Joints) -> [vector::Vec3; 3] {
    use super::linkage::Carrier;
    use super::vector::{add, cross, scale};
    let (axes, wheel_kg) = (body.axes(), vehicle.parameters().wheels.mass_kg);
    let wheels = vehicle.linkage.carriers(&vehicle.hubs, joints).into_iter().map(|carrier| (wheel_kg, carrier));
    let chassis = (vehicle.chassis_mass_kg(), Carrier::fixed(vehicle.chassis_centre_m));
    let spins: vector::Vec3 = std::array::from_fn(|i| vehicle.own_inertia_kg_m2[i] * body.rate[i]);
    let rate = axes.to_map(body.rate);
    let (mut linear, mut angular, mut weight) = ([0.0; 3], axes.to_map(spins), [0.0; 3]);
    for (mass_kg, carrier) in wheels.chain([chassis]) {
        let arm = axes.to_map(carrier.hub);
        let relative = axes.to_map(carrier.velocity(carrier.hub, &joints.rate));
        let momentum = scale(add(add(body.velocity, cross(rate, arm)), relative), mass_kg);
        let place = add(body.position, arm);
        linear = add(linear, momentum);
        angular = add(angular, cross(place, momentum));
        weight = add(weight, cross(place, [0.0, 0.0, -mass_kg * model::GRAVITY_M_S2]));
    }
    [linear, angular, weight]
}

/// A tumbling vehicle in the air, its joints moving and pushed: whatever the forces of the joints, its momentum changes by its weight and
/// its angular momentum by the moment of its weight, to 1e-5 of the weight (the error of a step of 1 us is below 1e-6 of it).
#[test]
fn val_joints_change_no_momentum() {
    for name in OTHERS {
        let vehicle = of(name);
        let mut joints = vehicle.linkage.joints(vehicle.wheels.len());
        let count = joints.rate.len();
        joints.position = (0..count).map(|j| 0.1 - 0.05 * j as f64).collect();
        joints.rate = (0..count).map(|j| 2.0 - 1.2 * j as f64).collect();
        let forces: Vec<f64> = (0..count).map(|j| 30.0 - 25.0 * j as f64).collect();
        let mut body = body::Body {
            position: [0.2, -0.1, 0.5],
            velocity: [0.3, -0.2, 0.9],
            orientation: vector::normalised([0.1, -0.3, 0.2, 0.9]),
            rate: [1.1, -2.3, 0.7],
        };
        let [linear, angular, moment] = momenta(&vehicle, &body, &joints);
        let (axes, carriers) = (body.axes(), vehicle.linkage.carriers(&vehicle.hubs, &joints));
        let loads = articulated::Loads { force: [0.0; 3], moment: [0.0; 3], joints: &forces };
        articulated::step(&mut body, &mut joints, &vehicle, &carriers, &axes, &loads, 1e-6);
        let [linear_after, angular_after, _] = momenta(&vehicle, &body, &joints);
        let weight_n = vehicle.mass_kg * model::GRAVITY_M_S2;
        let force = vector::scale(vector::sub(linear_after, linear), 1e6);
        let torque = vector::scale(vector::sub(angular_after, angular), 1e6);
        let lost = vector::norm(vector::sub(force, [0.0, 0.0, -weight_n]));
        assert!(lost < 1e-5 * weight_n, "{name}: {force:?}, not {weight_n} N down");
        let turned = vector::norm(vector::sub(torque, moment));
        assert!(turned < 1e-5 * weight_n, "{name}: {torque:?}, not {moment:?}");
    }
}

/// What a recording says at one instant fits together: the specific forces, turned into the map and without gravity, integrate to the
/// velocity, and the errors of the controller are those of the recorded pose. Velocities are recorded in steps of 2^-16 m/s, poses of
/// 2^-20 m.
#[test]
fn val_samples_of_an_instant_agree() {
    let mission = crossing(1);
    let recording = run(&ROUGH, &mission, |p| p.timeout_s = 5.0);
    let (start, goal) = (mission.start_m, mission.goal_m);
    let along = [0, 1].map(|axis| (goal[axis] - start[axis]) / 24.0);
    let first = recording.states[0].velocity_m_s;
    let mut velocity = [0.0; 3];
    assert!(recording.states.len() > 50, "{:?}", outcome(&recording));
    for (k, (state, command)) in recording.states.iter().zip(&recording.commands).enumerate() {
        // Five inertial measurements since the last state.
        for sample in &recording.imu[(5 * k).saturating_sub(4)..=5 * k] {
            let force = vector::Axes::of(sample.orientation).to_map(sample.specific_force_m_s2);
            let acceleration = vector::sub(force, [0.0, 0.0, model::GRAVITY_M_S2]);
            velocity = vector::add_scaled(velocity, acceleration, 0.01);
        }
        let gained = vector::sub(state.velocity_m_s, first);
        assert!(vector::norm(vector::sub(gained, velocity)) < 5e-5, "{k}: {gained:?} {velocity:?}");
        let [x, y] = [0, 1].map(|axis| state.position_m[axis] - start[axis]);
        let beside = along[0] * y - along[1] * x;
        assert!((command.cross_track_m - beside).abs() < 1e-5, "{k}: {} {beside}", command.cross_track_m);
        let left = [0, 1].map(|axis| goal[axis] - state.position_m[axis]);
        let left_m = (left[0] * left[0] + left[1] * left[1]).sqrt();
        assert!((command.distance_to_goal_m - left_m).abs() < 1e-5, "{k}: {} {left_m}", command.distance_to_goal_m);
    }
}
