//! Export of the vehicle as bodies on joints.

use super::*;
use crate::vehicle::vector::{Vec3, add, sub};
use sastrugi_schemas::mechanism::{self, Joint, Link, Mechanism, Motion};

const VEHICLES: [&str; 3] = ["husky_a200", "ugv_4x4", "rocker_bogie_rover"];

fn of(name: &str) -> (Vehicle, Mechanism) {
    let (vehicle, settings) = prepared(|p| p.vehicle = name.to_owned());
    let mechanism = vehicle.mechanism(&settings.parameters().surface);
    (vehicle, mechanism)
}

/// Frames of all links in base_link, all joints at zero.
fn places(links: &[Link]) -> Vec<Vec3> {
    let mut places: Vec<Vec3> = Vec::new();
    for link in links {
        let below = link.parent.map_or([0.0; 3], |parent| places[parent]);
        places.push(add(below, link.origin_m));
    }
    places
}

/// Total mass, centre of mass and moments of inertia of the links equal the vehicle's; about y the wheels spin, and rockers and
/// bogies each add a hundredth of a wheel's transverse moment.
#[test]
fn val_links_add_up_to_the_vehicle() {
    for name in VEHICLES {
        let (vehicle, mechanism) = of(name);
        let links = &mechanism.links;
        let centres = places(links).into_iter().zip(links).map(|(at, link)| add(at, link.centre_of_mass_m));
        let centres: Vec<Vec3> = centres.collect();
        let mass_kg: f64 = links.iter().map(|link| link.mass_kg).sum();
        assert!((mass_kg - vehicle.mass_kg).abs() < 1e-9 * mass_kg, "{name}: {mass_kg}");
        for axis in 0..3 {
            let moment: f64 = links.iter().zip(&centres).map(|(link, at)| link.mass_kg * at[axis]).sum();
            assert!((moment / mass_kg - vehicle.centre_of_mass_m[axis]).abs() < 1e-12, "{name}");
            let about = |(link, at): (&Link, &Vec3)| {
                let d = sub(*at, vehicle.centre_of_mass_m);
                let [one, other] = [d[(axis + 1) % 3], d[(axis + 2) % 3]];
                link.inertia_kg_m2[axis] + link.mass_kg * (one * one + other * other)
            };
            let whole: f64 = links.iter().zip(&centres).map(about).sum();
            let spins: f64 = if axis == 1 { vehicle.spin_inertia.iter().sum() } else { 0.0 };
            let error = whole - spins - vehicle.inertia_kg_m2[axis];
            assert!(error.abs() < 1e-3 * vehicle.inertia_kg_m2[axis], "{name}: {axis} {error}");
        }
    }
}

#[test]
fn val_joints_and_motors() {
    for (name, joints, motors) in [("husky_a200", 4, 2), ("ugv_4x4", 10, 6), ("rocker_bogie_rover", 14, 10)] {
        let (vehicle, mechanism) = of(name);
        assert_eq!(mechanism.links.iter().map(|link| link.joints.len()).sum::<usize>(), joints, "{name}");
        assert_eq!(mechanism.motors.len(), motors, "{name}");
        let places = places(&mechanism.links);
        for (wheel, hub) in vehicle.wheels.iter().zip(model::hubs(vehicle.parameters())) {
            let number = mechanism.links.iter().position(|link| link.name == wheel.name).unwrap();
            assert!((0..3).all(|axis| (places[number][axis] - hub[axis]).abs() < 1e-12), "{name}: {}", wheel.name);
            let last = mechanism.links[number].joints.last().unwrap();
            assert_eq!((last.motion, last.range), (Motion::TurnY, None));
        }
        let known = |joint: &String| mechanism.links.iter().flat_map(|link| &link.joints).any(|one| one.name == *joint);
        assert!(mechanism.motors.iter().flat_map(|motor| &motor.joints).all(known), "{name}");
        assert!(mechanism.couplings.iter().all(|c| known(&c.leader) && known(&c.follower)), "{name}");
    }
    assert_eq!(of("rocker_bogie_rover").1.couplings.len(), 1);
}

/// At rest on level ground, base_link is at the stated height minus the sag of the tyres, to 1 mm.
#[test]
fn val_stands_as_high_as_stated() {
    for name in VEHICLES {
        let (_, mechanism) = of(name);
        let stated_m = mechanism.standing_height_m - mechanism.tyre_sag_m;
        let height_m = parked(
            |_, _| 0.0,
            |p| p.vehicle = name.to_owned(),
            |mut simulation, vehicle| {
                // The suspension keeps oscillating for a while.
                let brakes = vec![HOLD; vehicle.channels()];
                (0..5000).for_each(|_| simulation.step(&brakes));
                simulation.body.base(vehicle).0[2]
            },
        );
        assert!((height_m - stated_m).abs() < 1e-3, "{name}: {height_m} {stated_m}");
    }
}

/// The friction is that of the surface preset, or as changed by the run.
#[test]
fn val_friction_is_that_of_the_surface() {
    let (vehicle, settings) = prepared(|p| {
        p.surface = SurfaceParameters {
            preset: SurfacePreset::Sand,
            belly_friction: Some(0.3),
            ..SurfaceParameters::default()
        };
    });
    let friction = vehicle.mechanism(&settings.parameters().surface).friction;
    assert_eq!((friction.surface.as_str(), friction.wheel, friction.belly), ("sand", 0.53, 0.3));
}

/// Springs, dampers, stops and motors have the numbers of the data files: loads from the weight, commands from the limits of speed and
/// yaw rate at the wheel's distance from the centre of turning.
#[test]
fn val_joints_and_motors_have_the_numbers_of_the_model() {
    let joint = |of: &Mechanism, name: &str| -> Joint {
        of.links.iter().flat_map(|link| &link.joints).find(|joint| joint.name == name).unwrap().clone()
    };
    let servo = |of: &Mechanism, name: &str| of.motors.iter().find(|motor| motor.name == name).unwrap().servo;
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1.0);
    let speed = |of: &Mechanism, name: &str| match servo(of, name) {
        mechanism::Servo::Speed { gain_n_m_s, torque_limit_n_m, speed_limit_rad_s } => {
            [gain_n_m_s, torque_limit_n_m, speed_limit_rad_s]
        }
        mechanism::Servo::Angle { .. } => panic!("{name} turns a wheel"),
    };
    let (_, husky) = of("husky_a200");
    let [gain, torque, limit] = speed(&husky, "left_motor");
    assert_eq!((gain, torque), (55.0, 40.0));
    assert!(near(limit, (1.0 + 2.0 * 0.5 * 0.5708 * 1.875) / 0.1651), "{limit}");
    assert_eq!(husky.motors[0].joints, ["front_left_wheel_spin", "rear_left_wheel_spin"]);
    let (_, car) = of("ugv_4x4");
    let preload_n = 1360.0 * 9.80665 / 4.0;
    let suspension = joint(&car, "rear_right_wheel_suspension");
    let spring = suspension.spring.unwrap();
    assert_eq!((suspension.motion, suspension.range), (Motion::SlideZ, Some([-0.15, 0.15])));
    assert_eq!((suspension.damping, spring.stiffness_n_m), (2000.0, 30_000.0));
    assert!(near(spring.unloaded_m, -preload_n / 30_000.0), "{spring:?}");
    assert!(near(spring.force_max_n, preload_n + 4500.0), "{spring:?}");
    let [_, torque, limit] = speed(&car, "front_left_wheel_motor");
    assert!(torque == 1200.0 && near(limit, (10.0 + (2.7f64 * 2.7 + 0.64).sqrt()) / 0.4), "{limit}");
    let steering = servo(&car, "front_left_wheel_steering");
    let mechanism::Servo::Angle { stiffness_n_m, damping_n_m_s, rate_limit_rad_s } = steering else {
        panic!("a steering motor holds an angle")
    };
    // Scrubbing on the spot, half a width of 0.27 m from its middle, turns a wheel of a quarter of 1500 kg by 1 deg.
    let stiffness = 1500.0 * 9.80665 / 4.0 * 0.135 / 1f64.to_radians();
    assert!(near(stiffness_n_m, stiffness) && near(damping_n_m_s, 2.0 * (stiffness * 1.6).sqrt()), "{stiffness_n_m}");
    assert!(near(rate_limit_rad_s, 40f64.to_radians()));
    let (_, rover) = of("rocker_bogie_rover");
    let (rocker, bogie) = (joint(&rover, "left_rocker_pivot"), joint(&rover, "right_bogie_pivot"));
    assert_eq!((rocker.damping, bogie.damping), (10.0, 20.0));
    let range = |joint: &Joint| joint.range.unwrap().map(f64::to_degrees);
    assert!(near(range(&rocker)[1], 30.0) && near(range(&bogie)[0], -45.0));
    let coupling = &rover.couplings[0];
    assert_eq!((coupling.leader.as_str(), coupling.follower.as_str()), ("left_rocker_pivot", "right_rocker_pivot"));
    assert_eq!(coupling.ratio, -1.0);
}
