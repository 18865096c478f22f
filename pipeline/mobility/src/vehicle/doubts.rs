//! Plausibility checks of a vehicle's parameters: combinations that make no sense although each value is in range. They warn
//! before hours are spent on driving.

use super::model::GRAVITY_M_S2;
use super::params::VehicleParameters;
use std::fmt::Write;

/// Largest plausible tyre sag under the vehicle's weight, as a share of the wheel radius.
const SAG_SHARE_MAX: f64 = 0.2;
/// Plausible range of a chassis' moments of inertia, relative to a solid box of the same mass and size. A shell of that size
/// reaches 3.
const OVER_BOX: [f64; 2] = [0.2, 4.0];

/// Relative change of a mass above which its moments of inertia must change too.
const MASS_CHANGE_MAX: f64 = 0.1;
/// Relative rounding error of moments of inertia.
const ROUNDING: f64 = 1e-9;

/// Warnings about a vehicle, one sentence each; `base` is the vehicle whose parameters were changed.
pub(crate) fn doubts(vehicle: &VehicleParameters, base: Option<&VehicleParameters>) -> Vec<String> {
    let mut doubts = Vec::new();
    doubts.extend(clearance(vehicle));
    doubts.extend(sag(vehicle));
    doubts.extend(inertia(vehicle));
    doubts.extend(base.map(|base| not_rescaled(vehicle, base)).unwrap_or_default());
    doubts
}

/// Wheels that do not reach below the chassis once the tyres sag.
fn clearance(vehicle: &VehicleParameters) -> Option<String> {
    let (chassis, wheels) = (&vehicle.chassis, &vehicle.wheels);
    let clearance_m = chassis.bottom_z_m - (wheels.axle_z_m - wheels.radius_m);
    let side = if clearance_m < 0.0 { "below" } else { "above" };
    (clearance_m <= sag_m(vehicle)).then(|| {
        format!(
            "the bottom plate is {:.3} m {side} the lowest point of the wheels and the tyres sag by {:.3} m, so the vehicle will \
             rest on its belly in every mission: chassis.bottom_z_m = {}, wheels.axle_z_m = {}, wheels.radius_m = {}",
            clearance_m.abs(), sag_m(vehicle), chassis.bottom_z_m, wheels.axle_z_m, wheels.radius_m
        )
    })
}

/// Sag of the tyres on level ground, m.
fn sag_m(vehicle: &VehicleParameters) -> f64 {
    let wheels = 2.0 * vehicle.wheels.axles_m.len() as f64;
    let mass_kg = vehicle.chassis.mass_kg + wheels * vehicle.wheels.mass_kg;
    mass_kg * GRAVITY_M_S2 / (wheels * vehicle.tyre.stiffness_n_m)
}

fn sag(vehicle: &VehicleParameters) -> Option<String> {
    let (sag_m, radius_m) = (sag_m(vehicle), vehicle.wheels.radius_m);
    (sag_m > SAG_SHARE_MAX * radius_m).then(|| {
        format!(
            "the tyres sag by {sag_m:.3} m under the vehicle's weight, {:.0} % of their radius; check tyre.stiffness_n_m = {}",
            100.0 * sag_m / radius_m,
            vehicle.tyre.stiffness_n_m
        )
    })
}

/// Moments of inertia that are unphysical, or implausible for that mass and size.
fn inertia(vehicle: &VehicleParameters) -> Option<String> {
    let chassis = &vehicle.chassis;
    let [x, y, z] = chassis.inertia_kg_m2;
    let sum = x + y + z;
    if [x, y, z].into_iter().any(|moment| moment > (0.5 + ROUNDING) * sum) {
        return Some(format!(
            "chassis.inertia_kg_m2 = [{x}, {y}, {z}] is not physical: each moment must be at most the sum of the other two"
        ));
    }
    let [length, width, height] = chassis.size_m.map(|side| side * side);
    let box_kg_m2 = [width + height, length + height, length + width].map(|squares| chassis.mass_kg / 12.0 * squares);
    let axis = (0..3).find(|&axis| {
        let ratio = chassis.inertia_kg_m2[axis] / box_kg_m2[axis];
        !(OVER_BOX[0]..=OVER_BOX[1]).contains(&ratio)
    })?;
    Some(format!(
        "chassis.inertia_kg_m2 is {} kg m2 about {}; a solid box of that mass and size would have {:.4}",
        chassis.inertia_kg_m2[axis],
        ["x", "y", "z"][axis],
        box_kg_m2[axis]
    ))
}

/// Parameters that should have been rescaled with a changed one.
fn not_rescaled(vehicle: &VehicleParameters, base: &VehicleParameters) -> Vec<String> {
    let (chassis, wheels, old, old_wheels) = (&vehicle.chassis, &vehicle.wheels, &base.chassis, &base.wheels);
    let scaled = |factor: f64, values: &[f64]| {
        values.iter().fold(String::new(), |mut text, value| {
            let comma = if text.is_empty() { "" } else { ", " };
            // Writing to a string cannot fail.
            let _ = write!(text, "{comma}{:.4}", factor * value);
            text
        })
    };
    let mut doubts = Vec::new();
    if chassis.inertia_kg_m2 == old.inertia_kg_m2 {
        if (chassis.mass_kg / old.mass_kg - 1.0).abs() > MASS_CHANGE_MAX {
            doubts.push(format!(
                "chassis.mass_kg was changed to {}, but inertia_kg_m2 still belongs to a mass of {} kg; scaled in proportion it \
                 would be [{}]",
                chassis.mass_kg,
                old.mass_kg,
                scaled(chassis.mass_kg / old.mass_kg, &old.inertia_kg_m2)
            ));
        } else if chassis.size_m != old.size_m {
            doubts.push(format!(
                "chassis.size_m was changed to {:?}, but inertia_kg_m2 still belongs to a size of {:?} m",
                chassis.size_m, old.size_m
            ));
        }
    }
    let moments = |wheels: &super::WheelParameters| [wheels.spin_inertia_kg_m2, wheels.transverse_inertia_kg_m2];
    let body = |wheels: &super::WheelParameters| [wheels.mass_kg, wheels.radius_m, wheels.width_m];
    if body(wheels) != body(old_wheels) && moments(wheels) == moments(old_wheels) {
        let [mass, radius, width] = body(wheels);
        doubts.push(format!(
            "mass, radius or width of the wheels was changed, but not their moments of inertia; solid cylinders would have \
             spin_inertia_kg_m2 = {:.4} and transverse_inertia_kg_m2 = {:.4}",
            0.5 * mass * radius * radius,
            mass / 12.0 * (3.0 * radius * radius + width * width)
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use crate::registry::{CUSTOM, doubts, kinds};
    use serde_json::{Map, Value, json};

    fn of(changes: Value) -> Vec<String> {
        let Value::Object(changes) = changes else { panic!() };
        doubts("husky_a200", &changes)
    }

    /// Shipped vehicles raise no warnings, neither by name nor as custom vehicles.
    #[test]
    fn val_shipped_vehicles_raise_no_warnings() {
        for kind in kinds().iter().filter(|kind| kind.family == "vehicle") {
            assert_eq!(doubts(kind.kind, &Map::new()), Vec::<String>::new(), "{}", kind.kind);
            let all = kind.values().and_then(Value::as_object).unwrap();
            assert_eq!(doubts(CUSTOM, all), Vec::<String>::new(), "{}", kind.kind);
        }
    }

    #[test]
    fn val_each_inconsistency_is_reported() {
        let one = |changes: Value, words: &str| {
            let doubts = of(changes);
            assert!(doubts.len() == 1 && doubts[0].contains(words), "{words}: {doubts:?}");
        };
        one(
            json!({ "chassis": { "mass_kg": 60.0 } }),
            "still belongs to a mass of 46.034 kg; scaled in proportion it would be [0.7849, 2.2661, 2.6453]",
        );
        one(json!({ "chassis": { "size_m": [1.1, 0.6, 0.25] } }), "size_m was changed");
        one(json!({ "wheels": { "radius_m": 0.15 } }), "spin_inertia_kg_m2 = 0.0297");
        one(
            json!({ "wheels": { "axle_z_m": 0.165 } }),
            "the bottom plate is 0.000 m above the lowest point of the wheels",
        );
        one(
            json!({ "wheels": { "axle_z_m": 0.3 } }),
            "the bottom plate is 0.135 m below the lowest point of the wheels",
        );
        one(json!({ "tyre": { "stiffness_n_m": 3000.0 } }), "the tyres sag by 0.046 m");
        one(json!({ "chassis": { "inertia_kg_m2": [0.6, 0.6, 2.0] } }), "is not physical");
        one(json!({ "chassis": { "inertia_kg_m2": [60.0, 170.0, 200.0] } }), "a solid box of that mass and size");
        assert_eq!(of(json!({ "drive": { "torque_limit_n_m": 30.0 } })), Vec::<String>::new());
        assert_eq!(of(json!({ "chassis": { "mass_kg": 48.0 } })), Vec::<String>::new(), "a little heavier");
        assert_eq!(of(json!({ "chassis": { "inertia_kg_m2": [0.7, 1.3, 2.0] } })), Vec::<String>::new(), "a plate");
        let consistent = json!({ "chassis": { "mass_kg": 60.0, "inertia_kg_m2": [0.785, 2.266, 2.645] } });
        assert_eq!(of(consistent), Vec::<String>::new());
    }
}
