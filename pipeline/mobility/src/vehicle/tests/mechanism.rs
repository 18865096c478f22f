//! The vehicle as bodies on joints.

use super::*;
use crate::vehicle::vector::{Vec3, add, sub};
use sastrugi_schemas::mechanism::{Link, Mechanism, Motion};

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

/// Mass, centre of mass and moments of inertia of all links together are the vehicle's; about y the wheels spin, and rockers and
/// bogies add a hundredth of a wheel's transverse moment each.
#[test]
fn val_links_are_the_whole_vehicle() {
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

/// At rest on level ground base_link stands at the stated height less the sag of the tyres, to 1 mm.
#[test]
fn val_stands_as_high_as_stated() {
    for name in VEHICLES {
        let (_, mechanism) = of(name);
        let stated_m = mechanism.standing_height_m - mechanism.tyre_sag_m;
        let height_m = parked(
            |_, _| 0.0,
            |p| p.vehicle = name.to_owned(),
            |mut simulation, vehicle| {
                // A suspension swings on for a while.
                let brakes = vec![HOLD; vehicle.channels()];
                (0..5000).for_each(|_| simulation.step(&brakes));
                simulation.body.base(vehicle).0[2]
            },
        );
        assert!((height_m - stated_m).abs() < 1e-3, "{name}: {height_m} {stated_m}");
    }
}

/// The friction of a surface, by its preset or with numbers of the run's own.
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
