mod following;
mod kernels;
mod mechanism;

use super::drive::Servo;
use super::simulation::Simulation;
use super::traverse::settled;
use super::*;
use crate::metrics::{Differentiator, EulerAngles, Metrics};
use crate::missions::Mission;
use proptest::prelude::*;
use sastrugi_numeric::simd::Vectors;
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use sastrugi_schemas::topics::{Event, EventKind, Recording};
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// A terrain from a height function, 5 cm cells.
fn terrain(size_m: [f64; 2], height: impl Fn(f64, f64) -> f64) -> Grid {
    let cells = size_m.map(|s| (s / 0.05).round() as usize);
    let g = Geometry::square(cells[1], cells[0], 0.05);
    let values = (0..g.len()).map(|k| height(g.x(k % g.cols), g.y(k / g.cols))).collect();
    Grid::new(g, values)
}

fn slope(deg: f64) -> f64 {
    libm::tan(deg.to_radians())
}

/// 42 m square of rough ground: 160 plane waves of random direction and phase, wavelengths evenly spaced in logarithm from
/// 0.35 to 20 m, amplitudes proportional to the wavelength to the power 0.8.
static ROUGH: LazyLock<Grid> = LazyLock::new(|| rough(0.015, 1));

fn rough(amplitude_m: f64, seed: u64) -> Grid {
    let mut stream = Streams::for_seed(seed, "test").stream("waves");
    let wave = |i: u32| {
        let wavelength = 0.35 * libm::pow(20.0 / 0.35, f64::from(i) / 159.0);
        let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
        (libm::pow(wavelength, 0.8), TAU * cos / wavelength, TAU * sin / wavelength, stream.uniform_in(0.0, TAU))
    };
    let waves: Vec<_> = (0..160).map(wave).collect();
    terrain([42.0, 42.0], |x, y| waves.iter().map(|w| amplitude_m * w.0 * libm::cos(w.1 * x + w.2 * y + w.3)).sum())
}

/// A mission across [`ROUGH`], away from its edges.
fn crossing(index: usize) -> Mission {
    let mut stream = Streams::for_seed(2, "test").child(&index.to_string()).stream("crossing");
    let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
    Mission::between(index, [21.0 - 12.0 * cos, 21.0 - 12.0 * sin], [21.0 + 12.0 * cos, 21.0 + 12.0 * sin])
}

fn prepared(change: impl FnOnce(&mut TraverseParameters)) -> (Vehicle, TraverseSettings) {
    let mut parameters = TraverseParameters::default();
    change(&mut parameters);
    parameters.prepare().unwrap()
}

fn changes(value: Value) -> serde_json::Map<String, Value> {
    value.as_object().unwrap().clone()
}

fn run(dem: &Grid, mission: &Mission, change: impl FnOnce(&mut TraverseParameters)) -> Recording {
    let (vehicle, settings) = prepared(change);
    let ground = Ground::new(dem, &vehicle).unwrap();
    drive(&ground, &vehicle, &settings, mission).unwrap()
}

fn outcome(recording: &Recording) -> &Event {
    recording.events.last().unwrap()
}

/// Runs `act` on a vehicle at rest in the middle of a terrain of 20 x 20 m, facing east.
fn parked<T>(
    height: impl Fn(f64, f64) -> f64,
    change: impl FnOnce(&mut TraverseParameters),
    act: impl FnOnce(Simulation, &Vehicle) -> T,
) -> T {
    let dem = terrain([20.0, 20.0], height);
    let (vehicle, settings) = prepared(change);
    let ground = Ground::new(&dem, &vehicle).unwrap();
    let mission = Mission::between(0, [10.0, 10.0], [15.0, 10.0]);
    act(settled(&ground, &vehicle, &settings, &mission).unwrap(), &vehicle)
}

fn steps(simulation: &mut Simulation, seconds: f64, servo: Servo) {
    for _ in 0..(seconds * 500.0) as usize {
        simulation.step(&[servo; 2]);
    }
}

const HOLD: Servo = Servo { target: 0.0, gain: 55.0, limit: 40.0 };

/// Mass, centre of mass and inertia of the Husky, computed by hand from the parts in its data file.
#[test]
fn val_whole_vehicle_is_the_sum_of_its_parts() {
    let (vehicle, _) = prepared(|_| ());
    assert!((vehicle.mass_kg - 56.582).abs() < 1e-9);
    assert!((vehicle.centre_of_mass_m[2] - 0.05656).abs() < 1e-5);
    for (computed, by_hand) in vehicle.inertia_kg_m2.into_iter().zip([1.552, 2.437, 3.663]) {
        assert!((computed - by_hand).abs() < 1e-3, "{computed} {by_hand}");
    }
}

/// Static to 1e-6 m for 60 s, sag = load / stiffness, wheels carry the weight.
#[test]
fn val_rests_on_a_plane() {
    parked(
        |_, _| 0.7,
        |_| (),
        |mut simulation, vehicle| {
            let (start, _) = simulation.body.base(vehicle);
            let load = 56.582 * model::GRAVITY_M_S2 / 4.0;
            assert!((start[2] - (0.7 + 0.1651 - load / 40_000.0 - 0.03282)).abs() < 1e-6);
            steps(&mut simulation, 60.0, HOLD);
            let (end, _) = simulation.body.base(vehicle);
            assert!((0..3).all(|i| (end[i] - start[i]).abs() < 1e-6), "{start:?} {end:?}");
            for wheel in simulation.wheel_states() {
                assert!((wheel.normal_force_n - load).abs() < 1e-6 * load);
            }
        },
    );
}

/// Sag as specified for any number of rays and discs; tolerance 1e-6 m.
#[test]
fn val_sag_does_not_depend_on_the_ray_count() {
    for (discs, rays) in [(1, 13), (3, 13), (5, 25), (3, 24), (2, 91)] {
        let tyre = json!({"tyre": {"discs": discs, "rays": rays}});
        parked(
            |_, _| 0.0,
            |p| p.vehicle_changes = changes(tyre),
            |simulation, vehicle| {
                let (base, _) = simulation.body.base(vehicle);
                let sag = 0.1651 - (base[2] + 0.03282);
                assert!((sag - 56.582 * model::GRAVITY_M_S2 / 160_000.0).abs() < 1e-6, "{discs} {rays} {sag}");
            },
        );
    }
}

/// With the motors off, a vehicle thrown at a plane only loses energy. Tolerance: 2e-3 of its initial energy per step, the
/// ripple of a semi-implicit step on a stiff spring.
#[test]
fn val_energy_never_grows_with_the_motor_off() {
    parked(
        |_, _| 0.0,
        |_| (),
        |mut simulation, _| {
            let rest = simulation.energy_j();
            simulation.body.position[2] += 0.05;
            simulation.body.velocity = [0.7, 0.4, 0.0];
            simulation.body.rate = [0.5, -0.6, 0.8];
            let thrown = simulation.energy_j() - rest;
            let mut lowest = thrown;
            for _ in 0..2500 {
                simulation.step(&[Servo::OFF; 2]);
                let energy = simulation.energy_j() - rest;
                assert!(energy < lowest + 2e-3 * thrown, "{energy} after {lowest} of {thrown}");
                lowest = lowest.min(energy);
            }
            assert!(lowest < 0.35 * thrown);
        },
    );
}

/// The other vehicles.
const OTHERS: [&str; 2] = ["ugv_4x4", "rocker_bogie_rover"];

/// Without joints, the equations of jointed vehicles reduce to the rigid body: one step of a tumbling Husky under a load, by
/// both.
#[test]
fn val_a_vehicle_without_joints_moves_as_a_rigid_body() {
    let (vehicle, _) = prepared(|_| ());
    let tumbling = body::Body {
        position: [1.0, 2.0, 3.0],
        velocity: [0.3, -0.2, 0.9],
        orientation: vector::normalised([0.1, -0.3, 0.2, 0.9]),
        rate: [1.1, -2.3, 0.7],
    };
    let axes = tumbling.axes();
    let (force, moment) = ([30.0, -500.0, 900.0], [12.0, -7.0, 33.0]);
    let (mut rigid, mut jointed) = (tumbling, tumbling);
    rigid.step(&vehicle, &axes, force, moment, 0.002);
    let mut joints = vehicle.linkage.joints(4);
    let carriers = vehicle.linkage.carriers(&vehicle.hubs, &joints);
    let loads = articulated::Loads { force: axes.to_body(force), moment: axes.to_body(moment), joints: &[] };
    articulated::step(&mut jointed, &mut joints, &vehicle, &carriers, &axes, &loads, 0.002);
    for i in 0..3 {
        assert!((rigid.velocity[i] - jointed.velocity[i]).abs() < 1e-12, "{rigid:?} {jointed:?}");
        assert!((rigid.rate[i] - jointed.rate[i]).abs() < 1e-12, "{rigid:?} {jointed:?}");
    }
}

/// Levers and drift of every linkage are the derivatives of the hub positions. Central differences over 1e-4.
#[test]
fn val_levers_are_derivatives_of_the_hubs() {
    for name in OTHERS {
        let (vehicle, _) = prepared(|p| p.vehicle = name.to_owned());
        let mut joints = vehicle.linkage.joints(vehicle.wheels.len());
        let count = joints.rate.len();
        joints.position = (0..count).map(|j| 0.1 * (1.0 + j as f64)).collect();
        joints.rate = (0..count).map(|j| 0.7 - 0.4 * j as f64).collect();
        let carriers = vehicle.linkage.carriers(&vehicle.hubs, &joints);
        let after = |time: f64| {
            let position = joints.position.iter().zip(&joints.rate).map(|(q, rate)| q + time * rate).collect();
            vehicle.linkage.carriers(&vehicle.hubs, &linkage::Joints { position, ..joints.clone() })
        };
        let (before, after) = (after(-1e-4), after(1e-4));
        for ((carrier, a), b) in carriers.iter().zip(&before).zip(&after) {
            let moved = carrier.velocity(carrier.hub, &joints.rate);
            let first = vector::scale(vector::sub(b.hub, a.hub), 1.0 / 2e-4);
            let bend = vector::sub(vector::add(a.hub, b.hub), vector::scale(carrier.hub, 2.0));
            let second = vector::scale(bend, 1e8);
            assert!(vector::norm(vector::sub(moved, first)) < 1e-6, "{name} {moved:?} {first:?}");
            assert!(vector::norm(vector::sub(carrier.drift, second)) < 1e-4, "{name} {:?} {second:?}", carrier.drift);
        }
    }
}

/// On a plane the other vehicles stand still to 1e-6 m for 20 s and their wheels carry the weight, to 1e-4 of it; the
/// rover's wheels carry equal shares, for which its pivots were chosen (2 %).
#[test]
fn val_other_vehicles_rest_on_a_plane() {
    for name in OTHERS {
        parked(
            |_, _| 0.7,
            |p| (p.vehicle, p.settle_s) = (name.to_owned(), 3.0),
            |mut simulation, vehicle| {
                let brakes = vec![Servo::BRAKE; vehicle.channels()];
                (0..2500).for_each(|_| simulation.step(&brakes));
                let (start, _) = simulation.body.base(vehicle);
                (0..10_000).for_each(|_| simulation.step(&brakes));
                let (end, _) = simulation.body.base(vehicle);
                assert!((0..3).all(|i| (end[i] - start[i]).abs() < 1e-6), "{name} {start:?} {end:?}");
                let loads: Vec<f64> = simulation.wheel_states().iter().map(|w| w.normal_force_n).collect();
                let weight = vehicle.mass_kg * model::GRAVITY_M_S2;
                assert!((loads.iter().sum::<f64>() / weight - 1.0).abs() < 1e-4, "{name} {loads:?}");
                let share = weight / loads.len() as f64;
                assert!(loads.iter().all(|load| (load / share - 1.0).abs() < 0.02), "{name} {loads:?}");
            },
        );
    }
}

/// The other vehicles, dropped and thrown with free wheels, only lose energy (ripple of a step 2e-3).
#[test]
fn val_energy_of_other_vehicles_never_grows() {
    for name in OTHERS {
        parked(
            |_, _| 0.0,
            |p| (p.vehicle, p.settle_s) = (name.to_owned(), 3.0),
            |mut simulation, vehicle| {
                let free = vec![Servo::OFF; vehicle.channels()];
                let rest = simulation.energy_j();
                simulation.body.position[2] += 0.1;
                simulation.body.velocity = [0.7, 0.4, 0.0];
                simulation.body.rate = [0.5, -0.6, 0.4];
                let thrown = simulation.energy_j() - rest;
                let mut lowest = thrown;
                for _ in 0..2500 {
                    simulation.step(&free);
                    let energy = simulation.energy_j() - rest;
                    assert!(energy < lowest + 2e-3 * thrown, "{name}: {energy} after {lowest} of {thrown}");
                    lowest = lowest.min(energy);
                }
                assert!(lowest < 0.5 * thrown, "{name}: {lowest} of {thrown}");
            },
        );
    }
}

/// The other vehicles climb 20 deg at the commanded speed minus the servo's droop under `W (sin + f cos)` and the tread's slip
/// (see [`val_climbs_planes`]), within 2 %.
#[test]
fn val_other_vehicles_climb() {
    for (name, gain) in [("ugv_4x4", 2000.0), ("rocker_bogie_rover", 60.0)] {
        let (sin, cos) = libm::sincos(f64::to_radians(20.0));
        let dem = terrain([30.0, 16.0], |x, _| x * slope(20.0));
        let mission = Mission::between(0, [5.0, 8.0], [5.0 + 14.0 * cos, 8.0]);
        let (vehicle, settings) = prepared(|p| (p.vehicle, p.speed_m_s) = (name.to_owned(), 0.5));
        let ground = Ground::new(&dem, &vehicle).unwrap();
        let recording = drive(&ground, &vehicle, &settings, &mission).unwrap();
        assert_eq!(outcome(&recording).kind, EventKind::Success, "{name} {:?}", outcome(&recording));
        let [early, late] = [160, 400].map(|k| recording.states[k].position_m[0]);
        let radius = vehicle.tyre.radius_m;
        let force = vehicle.mass_kg * model::GRAVITY_M_S2 * (sin + 0.03 * cos) / vehicle.wheels.len() as f64;
        let tyre = &vehicle.parameters().tyre;
        let slip = force / (tyre.tangential_stiffness_n_m * tyre.relaxation_length_m);
        let expected = (0.5 - force * radius * radius / gain) * (1.0 - slip);
        let speed = (late - early) / 12.0 / cos;
        assert!((speed / expected - 1.0).abs() < 0.02, "{name}: {speed} {expected}");
    }
}

/// Ackermann steering on level ground: a circle of the radius given by speed and yaw rate, within 5 %; the front wheels, `ahead` of
/// the unsteered axle, point along their own circles.
#[test]
fn val_steered_vehicles_turn_as_commanded() {
    for (name, speed_m_s, yaw_rate_rad_s, [ahead_m, half_track_m]) in
        [("ugv_4x4", 1.0, 0.15, [2.7, 0.8]), ("rocker_bogie_rover", 0.4, 0.2, [0.7, 0.53])]
    {
        parked(
            |_, _| 0.0,
            |p| p.vehicle = name.to_owned(),
            |mut simulation, vehicle| {
                let command = actuation::Command { speed_m_s, yaw_rate_rad_s, ..actuation::Command::default() };
                let mut servos = Vec::new();
                let mut turn = |simulation: &mut Simulation, steps: usize| {
                    for _ in 0..steps {
                        actuation::steering_angles(vehicle, &command, &mut simulation.steering_target);
                        actuation::servos(vehicle, &command, &simulation.steering, &mut servos);
                        simulation.step(&servos);
                    }
                };
                turn(&mut simulation, 2000);
                let yaw = |s: &Simulation| EulerAngles::of(s.body.orientation).yaw;
                let from = yaw(&simulation);
                turn(&mut simulation, 1000);
                let rate = (yaw(&simulation) - from) / 2.0;
                assert!((rate / yaw_rate_rad_s - 1.0).abs() < 0.05, "{name}: {rate}");
                for (side, half_m) in [half_track_m, -half_track_m].into_iter().enumerate() {
                    let along_m_s = speed_m_s - yaw_rate_rad_s * half_m;
                    let expected = libm::atan2(yaw_rate_rad_s * ahead_m, along_m_s);
                    let angle = simulation.steering[side];
                    assert!((angle - expected).abs() < 1e-12, "{name}: {angle} {expected}");
                }
            },
        );
    }
}

/// The rover turns on the spot towards a goal behind it; the car, which cannot, returns on its smallest circle.
#[test]
fn val_other_vehicles_turn_round() {
    let dem = terrain([50.0, 50.0], |_, _| 0.0);
    let backwards = Mission { heading_rad: 0.0, ..Mission::between(0, [25.0, 25.0], [8.0, 25.0]) };
    for (name, wide) in [("ugv_4x4", true), ("rocker_bogie_rover", false)] {
        let recording = run(&dem, &backwards, |p| p.vehicle = name.to_owned());
        assert_eq!(outcome(&recording).kind, EventKind::Success, "{name} {:?}", outcome(&recording));
        let east = recording.states.iter().map(|s| s.position_m[0]).fold(0.0, f64::max);
        assert_eq!(east > 28.0, wide, "{name}: {east}");
    }
}

/// A rover drives over a step of one wheel radius under its left wheels only: the rockers turn in opposite directions, and the
/// chassis rolls by less than a rigid vehicle, for which the roll is the step over the track.
#[test]
fn val_rocker_bogie_adapts_to_a_step() {
    let dem = terrain([20.0, 10.0], |x, y| if x > 8.0 && x < 8.3 && y > 5.0 { 0.12 } else { 0.0 });
    let mission = Mission::between(0, [4.0, 5.0], [14.0, 5.0]);
    let recording = run(&dem, &mission, |p| p.vehicle = "rocker_bogie_rover".to_owned());
    assert_eq!(outcome(&recording).kind, EventKind::Success, "{:?}", outcome(&recording));
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let swing = largest(&mut recording.wheels.iter().map(|w| w.wheels[0].hub_m[2] - w.wheels[1].hub_m[2]));
    let roll = largest(&mut recording.states.iter().map(|s| EulerAngles::of(s.orientation).roll));
    assert!(swing > 0.05, "{swing}");
    assert!(roll < 0.75 * 0.12 / 1.06, "{roll}");
}

/// Surfaces: the same climb on rock, snow and ice, and a belt of ice across dry ground, by class and by raster.
#[test]
fn val_surfaces_limit_climbing() {
    let dem = terrain([16.0, 8.0], |x, _| x * slope(8.0));
    let mission = Mission::between(0, [3.0, 4.0], [12.0, 4.0]);
    let kind = |preset: SurfacePreset| {
        outcome(&run(&dem, &mission, |p| (p.surface.preset, p.timeout_s) = (preset, 60.0))).kind
    };
    assert_eq!(kind(SurfacePreset::Rock), EventKind::Success);
    assert_eq!(kind(SurfacePreset::CompactedSnow), EventKind::Success);
    assert_ne!(kind(SurfacePreset::Ice), EventKind::Success);
    let icy = ClassSurfaceParameters { preset: Some(SurfacePreset::Ice), ..ClassSurfaceParameters::default() };
    let (vehicle, settings) = prepared(|p| (p.surface.high, p.timeout_s) = (Some(icy), 60.0));
    let ground = Ground::new(&dem, &vehicle).unwrap();
    assert_eq!(drive(&ground, &vehicle, &settings, &mission).unwrap_err(), TraverseError::NoSurface);
    let belt = |x: f64| u8::from(x > 7.0) * 2;
    let g = dem.geometry;
    let classes = Grid { geometry: g, values: (0..g.len()).map(|k| belt(g.x(k % g.cols))).collect() };
    let layers = SurfaceLayers { classes: Some(classes.clone()), ..SurfaceLayers::default() };
    let icy_ground = ground.clone().with_surface(SurfaceMap::new(&settings.parameters().surface, layers).unwrap());
    let recording = drive(&icy_ground, &vehicle, &settings, &mission).unwrap();
    let farthest = recording.states.iter().map(|s| s.position_m[0]).fold(0.0, f64::max);
    assert_ne!(outcome(&recording).kind, EventKind::Success);
    assert!((6.5..8.5).contains(&farthest), "{farthest}");
    let raster = classes.map(|class| if class == 2 { 0.1 } else { f64::NAN });
    let (vehicle, settings) = prepared(|p| p.timeout_s = 60.0);
    let layers = SurfaceLayers { wheel_friction: Some(raster), ..SurfaceLayers::default() };
    let icy_ground = ground.with_surface(SurfaceMap::new(&settings.parameters().surface, layers).unwrap());
    assert_ne!(outcome(&drive(&icy_ground, &vehicle, &settings, &mission).unwrap()).kind, EventKind::Success);
}

/// Planes of 20 and 30 deg are climbed at the commanded 1 m/s minus the closed-form losses: the droop of the servo under the
/// torque of a side, and the tread's slip under the force `F` of a wheel, `F / (k L)`. Tolerance 0.5 %.
#[test]
fn val_climbs_planes() {
    for deg in [20.0, 30.0] {
        let (sin, cos) = libm::sincos(f64::to_radians(deg));
        let dem = terrain([16.0, 8.0], |x, _| x * slope(deg));
        let mission = Mission::between(0, [3.0, 4.0], [3.0 + 9.0 * cos, 4.0]);
        let recording = run(&dem, &mission, |_| ());
        assert_eq!(outcome(&recording).kind, EventKind::Success);
        let [early, late] = [60, 120].map(|k| recording.states[k].position_m[0]);
        let side_torque = 0.5 * 56.582 * model::GRAVITY_M_S2 * 0.1651 * (sin + 0.03 * cos);
        let slip = 0.25 * 56.582 * model::GRAVITY_M_S2 * sin / (40_000.0 * 0.05);
        let expected = (1.0 - side_torque * 0.1651 / 55.0) * (1.0 - slip);
        let speed = (late - early) / 3.0 / cos;
        assert!((speed - expected).abs() < 0.005 * expected, "{speed} {expected} at {deg} deg");
        let angles = EulerAngles::of(recording.states[100].orientation);
        assert!((angles.pitch.to_degrees() + deg).abs() < 1.0, "nose up is negative pitch: {angles:?}");
    }
}

/// Locked wheels hold where tan < mu, without creeping (1 mm in 20 s), and slide with the acceleration `g (sin - mu cos)`
/// where tan > mu (tolerance 2 %).
#[test]
fn val_slides_where_the_slope_exceeds_friction() {
    let slid = |friction: f64, seconds: f64| {
        parked(
            |x, _| x * slope(20.0),
            |p| p.surface.wheel_friction = Some(friction),
            |mut simulation, _| {
                let (from, speed) = (simulation.body.position[0], simulation.body.velocity[0]);
                steps(&mut simulation, seconds, Servo::BRAKE);
                (simulation.body.position[0] - from, simulation.body.velocity[0] - speed)
            },
        )
    };
    assert!(slid(0.40, 20.0).0.abs() < 1e-3);
    let (sin, cos) = libm::sincos(f64::to_radians(20.0));
    let expected = -model::GRAVITY_M_S2 * (sin - 0.3 * cos) * cos;
    let (_, gained) = slid(0.3, 0.5);
    assert!((gained / 0.5 - expected).abs() < 0.02 * expected.abs(), "{gained} {expected}");
}

/// 35 m on level ground within 0.05 m of the line, in (35 - 0.5) m over the steady speed plus the time
/// lost to the acceleration of 3 m/s2; the steady speed is 1 m/s minus the servo's droop. Tolerance 0.1 s.
#[test]
fn val_drives_straight() {
    let dem = terrain([45.0, 10.0], |_, _| 0.0);
    let recording = run(&dem, &Mission::between(0, [5.0, 5.0], [40.0, 5.0]), |_| ());
    assert_eq!(outcome(&recording).kind, EventKind::Success);
    assert!(recording.states.iter().all(|s| (s.position_m[1] - 5.0).abs() < 0.05));
    let droop = 0.5 * 56.582 * model::GRAVITY_M_S2 * 0.03 * 0.1651 * 0.1651 / 55.0;
    let expected = 34.5 / (1.0 - droop) + 0.5 / 3.0;
    assert!((outcome(&recording).time_s - expected).abs() < 0.1, "{} {expected}", outcome(&recording).time_s);
}

/// Commanded 0.5 rad/s, the vehicle turns at 0.34 +- 0.04 rad/s, standing or driving.
#[test]
fn val_yaw_response_of_the_skid_steer() {
    for speed in [0.0, 1.0] {
        let rate = parked(
            |_, _| 0.0,
            |_| (),
            |mut simulation, _| {
                let half_track = 0.5 * 0.5708 * 1.875;
                let servos =
                    [-1.0, 1.0].map(|side| Servo { target: (speed + side * 0.5 * half_track) / 0.1651, ..HOLD });
                let turn = |simulation: &mut Simulation| simulation.step(&servos);
                (0..1000).for_each(|_| turn(&mut simulation));
                let yaw = |s: &Simulation| EulerAngles::of(s.body.orientation).yaw;
                let from = yaw(&simulation);
                (0..1000).for_each(|_| turn(&mut simulation));
                (yaw(&simulation) - from) / 2.0
            },
        );
        assert!((rate - 0.34).abs() < 0.04, "{rate} at {speed} m/s");
    }
}

/// On a side slope the vehicle rolls over its outer wheel edges beyond `atan(half width / height of the
/// centre of mass)` = 61.1 deg, +-2 deg. The closed form holds for rigid wheels set down gently, so the tyres are stiff and
/// damped here (found: 60.1 deg; a vehicle with the standard tyres, dropped on the slope, rolls over at 56.4 deg because they
/// yield). Friction 5 keeps the vehicle from sliding.
#[test]
fn val_rolls_over_beyond_the_static_angle() {
    let static_deg = libm::atan((0.5 * (0.5708 + 0.1143)) / (0.05656 + 0.1651 - 0.03282)).to_degrees();
    let rigid = json!({"tyre": {
        "stiffness_n_m": 1e6, "damping_n_s_m": 4000.0,
        "tangential_stiffness_n_m": 1e6, "tangential_damping_n_s_m": 4000.0,
    }});
    let rolls = |deg: f64| {
        let change = |p: &mut TraverseParameters| {
            (p.surface.wheel_friction, p.step_rate_hz, p.vehicle_changes) = (Some(5.0), 5000, changes(rigid.clone()));
        };
        parked(
            |_, y| (y - 10.0) * slope(deg),
            change,
            |mut simulation, _| {
                // At this step rate, 500 steps are a tenth of a second.
                steps(&mut simulation, 20.0, Servo::BRAKE);
                EulerAngles::of(simulation.body.orientation).roll.to_degrees().abs() > deg + 15.0
            },
        )
    };
    assert!(!rolls(static_deg - 2.0));
    assert!(rolls(static_deg + 2.0));
}

/// Across a bump at 0.1 m/s the front hub follows the envelope of a rigid wheel, minus the sag, within 5 mm. The envelope is
/// the hub height of a rigid circle resting on the bilinear profile at each place.
#[test]
fn val_wheel_envelops_a_bump() {
    let profile = |x: f64| if (x - 6.0).abs() < 0.2 { 0.03 * (1.0 + libm::cos((x - 6.0) * TAU / 0.4)) } else { 0.0 };
    let dem = terrain([10.0, 6.0], |x, _| profile(x));
    let recording = run(&dem, &Mission::between(0, [4.5, 3.0], [8.5, 3.0]), |p| p.speed_m_s = 0.1);
    assert_eq!(outcome(&recording).kind, EventKind::Success);
    let (vehicle, _) = prepared(|_| ());
    let ground = Ground::new(&dem, &vehicle).unwrap();
    let radius = 0.1651;
    let envelope = |x: f64| {
        let rise = |i: i32| {
            let ahead = radius * f64::from(i) / 1000.0;
            ground.height(x + ahead, 3.0) + (radius * radius - ahead * ahead).sqrt()
        };
        (-999..1000).map(rise).fold(f64::NEG_INFINITY, f64::max)
    };
    let sag = 56.582 * model::GRAVITY_M_S2 / 160_000.0;
    for state in &recording.states {
        let axes = vector::Axes::of(state.orientation);
        let hub = vector::add(state.position_m, axes.to_map([0.256, 0.0, 0.03282]));
        let error = hub[2] - (envelope(hub[0]) - sag);
        assert!(error.abs() < 0.005, "{error} at {}", hub[0]);
    }
}

/// Culling contacts by ceiling and clearance leaves the result bit for bit the same, here with wheels and belly on rough ground.
#[test]
fn prop_culling_changes_no_bit() {
    for (name, missions) in [("husky_a200", 6), (OTHERS[0], 2), (OTHERS[1], 2)] {
        let (vehicle, settings) = prepared(|p| (p.vehicle, p.timeout_s) = (name.to_owned(), 12.0));
        let ground = Ground::new(&ROUGH, &vehicle).unwrap();
        let plain = ground.clone().without_culling();
        for index in 0..missions {
            let [with, without] = [&ground, &plain].map(|g| drive(g, &vehicle, &settings, &crossing(index)).unwrap());
            assert_eq!(with, without);
        }
    }
}

/// Contacts computed with vectors that every CPU has are, bit for bit, those of this CPU's widest.
#[test]
fn prop_vectors_change_no_bit() {
    for (name, missions) in [("husky_a200", 4), (OTHERS[0], 1), (OTHERS[1], 1)] {
        let (vehicle, settings) = prepared(|p| (p.vehicle, p.timeout_s) = (name.to_owned(), 8.0));
        let ground = Ground::new(&ROUGH, &vehicle).unwrap();
        let baseline = ground.clone().with_vectors(Vectors::Baseline);
        for index in 0..missions {
            let [wide, narrow] = [&ground, &baseline].map(|g| drive(g, &vehicle, &settings, &crossing(index)).unwrap());
            assert_eq!(wide, narrow, "{name} {index}");
        }
    }
}

/// The same where missions leave the terrain: ground without data is met in the same step.
#[test]
fn prop_culling_meets_the_edge_in_the_same_step() {
    let dem = rough(0.004, 1);
    for name in ["husky_a200", OTHERS[0], OTHERS[1]] {
        let (vehicle, settings) = prepared(|p| p.vehicle = name.to_owned());
        let ground = Ground::new(&dem, &vehicle).unwrap();
        let plain = ground.clone().without_culling();
        for index in 0..8 {
            let (sin, cos) = libm::sincos(index as f64 * 0.77 + 0.1);
            let [start_m, goal_m] = [15.0, 40.0].map(|radius_m| [21.0 + radius_m * cos, 21.0 + radius_m * sin]);
            let mission = Mission::between(index, start_m, goal_m);
            let [with, without] = [&ground, &plain].map(|g| drive(g, &vehicle, &settings, &mission).unwrap());
            assert_eq!(outcome(&with).kind, EventKind::OutOfBounds, "{name} {index}");
            assert_eq!(with, without, "{name} {index}");
        }
    }
}

/// A ridge under the belly lifts the wheels: the vehicle is stuck and does not creep.
#[test]
fn val_high_centred_vehicle_is_stuck() {
    let ridge = |x: f64, y: f64| if (y - 5.0).abs() < 0.1 { ((x - 7.0) * 0.08).clamp(0.0, 0.3) } else { 0.0 };
    let dem = terrain([20.0, 10.0], ridge);
    let recording = run(&dem, &Mission::between(0, [5.0, 5.0], [17.0, 5.0]), |_| ());
    let end = outcome(&recording);
    assert_eq!(end.kind, EventKind::Stuck, "{end:?}");
    let [late, last] =
        [recording.states.len() - 500, recording.states.len() - 1].map(|k| recording.states[k].position_m);
    assert!((last[0] - late[0]).abs() < 0.05, "{late:?} {last:?}");
}

/// A drop tips the vehicle over; the recording ends there.
#[test]
fn val_falling_off_a_step_tips() {
    let dem = terrain([20.0, 10.0], |x, y| if x > 8.0 && y > 5.0 { -1.2 } else { 0.0 });
    let recording = run(&dem, &Mission::between(0, [4.0, 5.1], [16.0, 5.1]), |_| ());
    assert_eq!(outcome(&recording).kind, EventKind::Tipped, "{:?}", outcome(&recording));
    assert!(outcome(&recording).time_s < 20.0);
}

#[test]
fn val_missing_ground_is_out_of_bounds() {
    let mission = Mission::between(0, [4.0, 5.0], [16.0, 5.0]);
    let hole = terrain([20.0, 10.0], |x, _| if x > 9.0 && x < 10.0 { f64::NAN } else { 0.0 });
    let recording = run(&hole, &mission, |_| ());
    assert_eq!(outcome(&recording).kind, EventKind::OutOfBounds);
    let x = recording.states.last().unwrap().position_m[0];
    assert!((x + 0.4937 - 9.0).abs() < 0.15, "front bumper at the hole: {x}");
    let short = terrain([10.0, 10.0], |_, _| 0.0);
    assert_eq!(outcome(&run(&short, &mission, |_| ())).kind, EventKind::OutOfBounds);
    for start in [[9.5, 5.0], [-50.0, 5.0], [1e9, 5.0]] {
        let recording = run(&hole, &Mission::between(0, start, [16.0, 5.0]), |_| ());
        assert_eq!((outcome(&recording).kind, outcome(&recording).time_s), (EventKind::OutOfBounds, 0.0));
        assert_eq!(recording.states.len(), 1);
    }
}

/// With a goal behind it, the vehicle turns on the spot and arrives.
#[test]
fn val_turns_round_to_a_goal_behind() {
    let dem = terrain([20.0, 20.0], |_, _| 0.0);
    let backwards = Mission { heading_rad: 0.0, ..Mission::between(0, [10.0, 10.0], [4.0, 10.0]) };
    let recording = run(&dem, &backwards, |_| ());
    assert_eq!(outcome(&recording).kind, EventKind::Success, "{:?}", outcome(&recording));
}

/// Invariants of a recording: rates, lengths, order, unit quaternions, specific force of a vehicle at rest.
#[test]
fn val_recording_is_complete() {
    let dem = terrain([20.0, 10.0], |x, _| 0.1 * x);
    let recording = run(&dem, &Mission::between(0, [4.0, 5.0], [9.0, 5.0]), |_| ());
    let time_s = outcome(&recording).time_s;
    assert_eq!(recording.events.iter().map(|e| e.kind).collect::<Vec<_>>(), [EventKind::Start, EventKind::Success]);
    assert_eq!(recording.states.len(), (time_s * 20.0 + 1e-6).floor() as usize + 1);
    assert_eq!(recording.imu.len(), (time_s * 100.0 + 1e-6).floor() as usize + 1);
    assert_eq!((recording.wheels.len(), recording.commands.len()), (recording.states.len(), recording.states.len()));
    for (k, state) in recording.states.iter().enumerate() {
        assert!((state.time_s - k as f64 / 20.0).abs() < 1e-12);
    }
    let norm = |q: [f64; 4]| q.iter().map(|c| c * c).sum::<f64>();
    assert!(recording.imu.iter().all(|sample| (norm(sample.orientation) - 1.0).abs() < 1e-14));
    // Every fifth measurement falls on a state, which agrees with it to half a step of 2^-20.
    for (state, sample) in recording.states.iter().zip(recording.imu.iter().step_by(5)) {
        assert!((0..4).all(|k| (state.orientation[k] - sample.orientation[k]).abs() <= 0.5 / 1_048_576.0));
    }
    let names: Vec<&str> = recording.vehicle.wheels.iter().map(|w| w.name.as_str()).collect();
    assert_eq!(names, ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]);
    let force = recording.imu[0].specific_force_m_s2;
    assert!((vector::norm(force) - model::GRAVITY_M_S2).abs() < 1e-3);
    assert!((force[0] / force[2] - 0.1).abs() < 0.01, "nose up, gravity pulls back: {force:?}");
    let turned = recording.wheels.last().unwrap().wheels[0].angle_rad * 0.1651;
    assert!((turned - 4.5 * (1.0f64 + 0.01).sqrt()).abs() < 0.05, "{turned}");
}

#[test]
fn prop_same_input_same_bits() {
    let [a, b] = [1, 2].map(|_| run(&ROUGH, &crossing(3), |p| p.timeout_s = 8.0));
    assert_eq!(a, b);
}

/// Poses of one mission hashed to 64 bits (FNV-1a over their bits): the dynamics are frozen. A deliberate change of the dynamics
/// updates the constant from the message of this test, and its commit states what changed and by how much.
#[test]
fn gold_one_mission() {
    let recording = run(&ROUGH, &crossing(0), |p| p.timeout_s = 10.0);
    let words = recording.states.iter().flat_map(|s| s.position_m.into_iter().chain(s.orientation)).map(f64::to_bits);
    let hash = words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3));
    assert_eq!(hash, GOLD_POSES, "found {hash:#x}");
}
const GOLD_POSES: u64 = 0x77ca_0a0f_6b89_05c7;

/// Every rejected vehicle, and the key named by the error.
#[test]
fn val_bad_vehicles_are_refused() {
    let refused = |value: Value| {
        let parameters = TraverseParameters { vehicle_changes: changes(value), ..TraverseParameters::default() };
        let error = parameters.prepare().unwrap_err();
        (error.key, error.message)
    };
    let key = |value: Value| refused(value).0;
    assert_eq!(key(json!({"chassis": {"mass_kg": 0}})), "vehicle_changes.chassis.mass_kg");
    assert_eq!(key(json!({"wheels": {"radius_m": -0.1}})), "vehicle_changes.wheels.radius_m");
    assert_eq!(key(json!({"wheels": {"axles_m": [0.1, -0.1]}})), "vehicle_changes.wheels.axles_m");
    assert_eq!(key(json!({"wheels": {"axles_m": [-0.25, 0.25]}})), "vehicle_changes.wheels.axles_m");
    assert_eq!(key(json!({"wheels": {"axles_m": []}})), "vehicle_changes.wheels.axles_m");
    let axles = |axles_m: Value| refused(json!({"wheels": {"axles_m": axles_m}})).1;
    assert!(axles(json!([0.0])).starts_with("lists 1 axle;"), "{}", axles(json!([0.0])));
    assert!(axles(json!([])).starts_with("lists 0 axles;"), "{}", axles(json!([])));
    assert_eq!(key(json!({"wheels": {"track_m": 0.1}})), "vehicle_changes.wheels.track_m");
    assert_eq!(
        key(json!({"chassis": {"centre_of_mass_m": [0.3, 0, 0.06]}})),
        "vehicle_changes.chassis.centre_of_mass_m"
    );
    assert_eq!(key(json!({"tyre": {"rays": 4}})), "vehicle_changes.tyre.rays");
    assert_eq!(key(json!({"drive": {"torque_limit_n_m": null}})), "vehicle_changes.drive");
    assert!(refused(json!({"drive": {"horsepower": 3}})).1.contains("horsepower"));
    assert_eq!(key(json!({"suspension": {"kind": "rocker_bogie"}})), "vehicle_changes.suspension");
    assert_eq!(key(json!({"drive": {"kind": "tracks"}})), "vehicle_changes.drive.kind");
    let of = |vehicle: &str, value: Value| {
        let vehicle_changes = changes(value);
        let parameters = TraverseParameters { vehicle: vehicle.to_owned(), vehicle_changes, ..Default::default() };
        parameters.prepare().unwrap_err().key.replace("vehicle_changes.", "")
    };
    assert_eq!(of("ugv_4x4", json!({"drive": {"steered_axles": []}})), "drive.steered_axles");
    assert_eq!(of("ugv_4x4", json!({"drive": {"steered_axles": [2]}})), "drive.steered_axles");
    assert_eq!(of("ugv_4x4", json!({"drive": {"steering_limit_deg": 90}})), "drive.steering_limit_deg");
    assert_eq!(of("ugv_4x4", json!({"drive": {"spot_turn": true}})), "drive.spot_turn");
    assert_eq!(of("ugv_4x4", json!({"suspension": {"bump_m": 0}})), "suspension.bump_m");
    assert_eq!(of("rocker_bogie_rover", json!({"wheels": {"axles_m": [0.5, -0.5]}})), "suspension.kind");
    assert_eq!(of("ugv_4x4", json!({"suspension": {"stop_stiffness_n_m": 10.0}})), "suspension.stop_stiffness_n_m");
    let (bogie, rocker) = (json!({"bogie_pivot_m": [0.1, 0.0]}), json!({"rocker_pivot_m": [-0.5, 0.1]}));
    assert_eq!(of("rocker_bogie_rover", json!({"suspension": bogie})), "suspension.bogie_pivot_m");
    assert_eq!(of("rocker_bogie_rover", json!({"suspension": rocker})), "suspension.rocker_pivot_m");
    assert_eq!(of("husky_a200", json!({"tyre": {"tangential_stiffness_n_m": 1e307}})), "step_rate_hz");
    assert_eq!(of("husky_a200", json!({"tyre": {"damping_n_s_m": 1e160}})), "step_rate_hz");
    assert_eq!(of("rocker_bogie_rover", json!({"suspension": {"bogie_limit_deg": 90}})), "suspension.bogie_limit_deg");
    assert_eq!(of("rocker_bogie_rover", json!({"suspension": {"stop_stiffness_n_m": 1e7}})), "step_rate_hz");
    let (key, message) = refused(json!({"tyre": {"stiffness_n_m": 4e6}}));
    assert_eq!(key, "step_rate_hz");
    assert!(message.contains("the limit is"), "{message}");
}

#[test]
fn val_bad_settings_are_refused() {
    let refused = |change: &dyn Fn(&mut TraverseParameters)| {
        let mut parameters = TraverseParameters::default();
        change(&mut parameters);
        parameters.prepare().unwrap_err().key
    };
    assert_eq!(refused(&|p| p.vehicle = "husky".to_owned()), "vehicle");
    assert_eq!(refused(&|p| p.tip_deg = 90.0), "tip_deg");
    assert_eq!(refused(&|p| p.timeout_s = f64::INFINITY), "timeout_s");
    assert_eq!(refused(&|p| p.settle_s = -1.0), "settle_s");
    assert_eq!(refused(&|p| p.step_rate_hz = 0), "step_rate_hz");
    assert_eq!(refused(&|p| p.step_rate_hz = 200), "step_rate_hz");
    assert_eq!(refused(&|p| p.sample_rate_hz = 30), "sample_rate_hz");
    assert_eq!(refused(&|p| p.surface.wheel_friction = Some(f64::NAN)), "surface.wheel_friction");
    assert_eq!(refused(&|p| p.controller.turn_stop_deg = 100.0), "controller.turn_stop_deg");
}

#[test]
fn val_coarse_ground_is_warned_of_or_refused() {
    let (vehicle, settings) = prepared(|_| ());
    let flat = |cell_m: f64| Grid::filled(Geometry::square(40, 40, cell_m), 0.0);
    assert!(Ground::new(&flat(0.05), &vehicle).unwrap().warnings().is_empty());
    assert!(Ground::new(&flat(0.2), &vehicle).unwrap().warnings()[0].contains("wheel radius"));
    let error = Ground::new(&flat(1.0), &vehicle).unwrap_err();
    assert!(error.to_string().contains("elaborate"), "{error}");
    assert!(matches!(Ground::new(&flat(1e-5), &vehicle), Err(GroundError::CellTooSmall { .. })));
    let longer = TraverseParameters {
        vehicle_changes: changes(json!({"chassis": {"size_m": [1.05, 0.57, 0.25]}})),
        ..TraverseParameters::default()
    };
    let ground = Ground::new(&flat(0.05), &vehicle).unwrap();
    let (longer, _) = longer.prepare().unwrap();
    let mission = Mission::between(0, [0.5, 0.5], [1.5, 0.5]);
    assert!(matches!(drive(&ground, &longer, &settings, &mission), Err(TraverseError::OtherVehicle { .. })));
    let line = Grid::filled(Geometry::square(1, 40, 0.05), 0.0);
    assert_eq!(Ground::new(&line, &vehicle).unwrap_err(), GroundError::TooSmall { rows: 1, cols: 40 });
    let ground = Ground::new(&flat(0.2), &vehicle).unwrap();
    let nowhere = Mission::between(0, [4.0, 4.0], [4.0, 4.0]);
    assert!(matches!(drive(&ground, &vehicle, &settings, &nowhere), Err(TraverseError::NoLine { .. })));
}

/// Heights and gradients agree with the bilinear surface of the numeric crate.
#[test]
fn val_ground_is_the_stored_bilinear_surface() {
    use sastrugi_numeric::Surface;
    let (vehicle, _) = prepared(|_| ());
    let mut dem = terrain([6.0, 4.0], |x, y| 0.3 * libm::sin(2.0 * x) + 0.1 * x * y);
    dem.geometry.origin = [100.0, -20.0];
    let stored = dem.as_stored();
    let ground = Ground::new(&dem, &vehicle).unwrap();
    let mut stream = Streams::for_seed(3, "test").stream("points");
    for _ in 0..1000 {
        let (x, y) = (stream.uniform_in(100.03, 105.97), stream.uniform_in(-19.97, -16.03));
        let (z, dx, dy) = stored.height_and_gradient(x, y).unwrap();
        let (gx, gy) = ground.gradient(x, y);
        assert!((ground.height(x, y) - z).abs() < 1e-9);
        assert!((gx - dx).abs() < 1e-6 && (gy - dy).abs() < 1e-6);
    }
    assert!(ground.height(99.9, -18.0).is_nan());
    assert!(!ground.contains(100.0, -18.0) && ground.contains(100.03, -18.0));
}

/// Outcomes at 500 and 1000 Hz agree on at least 90 % of 400 missions, and the medians of the metrics over missions that
/// succeed at either rate agree within 3 %. The amplitudes give success rates from those of the study's terrains down to
/// lower ones (100 to 41 %). Found: 390 of 400. With a true agreement of 94 % the count falls below 90 % once in 1000 draws
/// of missions; seeds are fixed.
#[test]
#[ignore = "slow: ./test --full"]
fn conv_outcomes_do_not_depend_on_the_step() {
    let [coarse, fine] = [500, 1000].map(|rate| prepared(|p| p.step_rate_hz = rate));
    let driven = |amplitude_m: f64, seed: u64| -> Vec<[Recording; 2]> {
        let dem = rough(amplitude_m, seed);
        let ground = Ground::new(&dem, &coarse.0).unwrap();
        let both = |index| [&coarse, &fine].map(|(v, s)| drive(&ground, v, s, &crossing(index)).unwrap());
        (0..100).map(both).collect()
    };
    // Side by side: this test is alone in its program.
    let pairs: Vec<[Recording; 2]> = std::thread::scope(|scope| {
        let driven = &driven;
        let grounds = [(0.009, 10), (0.010, 11), (0.011, 12), (0.012, 13)];
        let threads = grounds.map(|(amplitude_m, seed)| scope.spawn(move || driven(amplitude_m, seed)));
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    let same = pairs.iter().filter(|[a, b]| outcome(a).kind == outcome(b).kind).count();
    let medians = [0, 1].map(|rate| {
        let succeeded = pairs.iter().map(|pair| &pair[rate]).filter(|r| outcome(r).kind == EventKind::Success);
        let all: Vec<Metrics> = succeeded.map(|r| Metrics::of(&r.states, 20.0, Differentiator::default())).collect();
        let median = |metric: fn(&Metrics) -> f64| sums::median(&all.iter().map(metric).collect::<Vec<_>>());
        [
            median(|m| m.rms_vertical_acceleration_m_s2),
            median(|m| m.rms_pitch_rate_rad_s),
            median(|m| m.rms_roll_rate_rad_s),
        ]
    });
    println!("same outcome in {same} of 400; medians {medians:?}");
    assert!(same >= 360, "{same}");
    for (a, b) in medians[0].into_iter().zip(medians[1]) {
        assert!((a / b - 1.0).abs() < 0.03, "{medians:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// No terrain makes the model panic: few cells, cliffs, holes, absurd heights.
    #[test]
    fn prop_any_ground_has_an_outcome(
        (rows, cols) in (1usize..24, 1usize..24),
        cell in 1e-3..0.5f64,
        heights in prop::collection::vec(prop_oneof![
            8 => -0.2..0.2f64,
            2 => -20.0..20.0f64,
            1 => prop::sample::select(vec![f64::NAN, f64::INFINITY, 1e30, -1e300]),
        ], 24 * 24),
        ends in prop::array::uniform4(-0.1..1.1f64),
        holes in prop::bool::weighted(0.5),
    ) {
        let geometry = Geometry { rows, cols, cell: [cell, 0.7 * cell], origin: [5e5, -3e6] };
        // A hole under the vehicle ends the mission before it begins: half of the grounds have none.
        let kept = |z: &f64| if holes || z.abs() <= 20.0 { *z } else { 0.0 };
        let dem = Grid::new(geometry, heights[..rows * cols].iter().map(kept).collect());
        let (vehicle, settings) = prepared(|p| (p.timeout_s, p.stuck_time_s, p.settle_s) = (1.0, 0.5, 0.2));
        let Ok(ground) = Ground::new(&dem, &vehicle) else { return Ok(()) };
        let size = geometry.size();
        let at = |x: f64, y: f64| [geometry.origin[0] + x * size[0], geometry.origin[1] + y * size[1]];
        let mission = Mission::between(0, at(ends[0], ends[1]), at(ends[2], ends[3]));
        let recording = drive(&ground, &vehicle, &settings, &mission).unwrap();
        prop_assert!(outcome(&recording).kind != EventKind::Start);
        prop_assert!(recording.states.iter().all(|s| s.position_m.iter().all(|c| c.is_finite())));
    }
}

/// On uneven ground without holes the mission begins, so the property above reaches the dynamics and not only the checks of the
/// start: 40 grounds of 24 x 24 cells of 25 cm with heights of +-20 cm, 3 m from the start to the nearest edge.
#[test]
fn prop_uneven_ground_is_driven() {
    let (vehicle, settings) = prepared(|p| (p.timeout_s, p.stuck_time_s, p.settle_s) = (1.0, 0.5, 0.2));
    let mut stream = Streams::for_seed(11, "test").stream("uneven");
    for number in 0..40 {
        let g = Geometry::square(24, 24, 0.25);
        let dem = Grid::new(g, (0..g.len()).map(|_| stream.uniform_in(-0.2, 0.2)).collect());
        let ground = Ground::new(&dem, &vehicle).unwrap();
        let recording = drive(&ground, &vehicle, &settings, &Mission::between(0, [3.0, 3.0], [5.0, 3.5])).unwrap();
        assert_eq!(recording.events[0].kind, EventKind::Start, "{number}");
        assert!(recording.states.len() > 2, "{number}: {:?}", outcome(&recording));
        assert!(recording.states.iter().all(|s| s.position_m.iter().all(|c| c.is_finite())), "{number}");
    }
}

/// Paths of all numbers in a JSON value.
fn numbers(value: &Value, path: &str) -> Vec<String> {
    match value {
        Value::Object(map) => map.iter().flat_map(|(k, v)| numbers(v, &format!("{path}/{k}"))).collect(),
        Value::Array(list) => list.iter().enumerate().flat_map(|(i, v)| numbers(v, &format!("{path}/{i}"))).collect(),
        Value::Number(_) => vec![path.to_owned()],
        _ => Vec::new(),
    }
}

/// Every number of a vehicle, replaced by extreme values, is refused or driven without a panic.
#[test]
fn prop_extreme_vehicle_numbers_are_refused_or_driven() {
    let dem = terrain([6.0, 4.0], |x, _| 0.1 * libm::sin(3.0 * x));
    let of = |name: &str| {
        let (vehicle, _) = prepared(|p| p.vehicle = name.to_owned());
        let all = serde_json::to_value(vehicle.parameters()).unwrap();
        numbers(&all, "").into_iter().map(|path| (name.to_owned(), all.clone(), path)).collect::<Vec<_>>()
    };
    let mut driven = 0;
    for (vehicle, all, path) in ["husky_a200", OTHERS[0], OTHERS[1]].into_iter().flat_map(of) {
        for odd in [0.0, -1.0, 1e-300, 1e-9, 0.5, 2.0, 101.0, 1e9, 1e300] {
            let mut changed = all.clone();
            *changed.pointer_mut(&path).unwrap() = json!(odd);
            if odd == f64::trunc(odd) && odd.abs() < 1e4 {
                *changed.pointer_mut(&path).unwrap() = json!(odd as i64);
            }
            let parameters = TraverseParameters {
                vehicle: vehicle.clone(),
                vehicle_changes: changes(changed),
                timeout_s: 0.2,
                settle_s: 0.1,
                ..TraverseParameters::default()
            };
            let Ok((vehicle, settings)) = parameters.prepare() else { continue };
            let Ok(ground) = Ground::new(&dem, &vehicle) else { continue };
            drive(&ground, &vehicle, &settings, &Mission::between(0, [2.0, 2.0], [4.0, 2.0])).unwrap();
            driven += 1;
        }
    }
    assert!(driven > 50, "{driven}");
}
