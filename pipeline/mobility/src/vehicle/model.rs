//! A checked vehicle and what follows from its parameters once and for all.

use super::belly::Belly;
use super::contact::Tyre;
use super::params::{DriveParameters, SkidSteerParameters, VehicleParameters};
use super::vector::{Vec3, norm, sub};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::topics::{VehicleOutline, WheelOutline};

/// Standard gravity, m/s2.
pub(crate) const GRAVITY_M_S2: f64 = 9.80665;

/// Left and right.
pub(crate) const SIDES: [&str; 2] = ["left", "right"];

/// One wheel of a vehicle.
#[derive(Clone, Debug)]
pub(crate) struct Wheel {
    pub name: String,
    /// Hub from the centre of mass, m.
    pub hub: Vec3,
    /// 0 left, 1 right.
    pub side: usize,
}

/// A vehicle that was checked and can drive.
#[derive(Clone, Debug)]
pub struct Vehicle {
    name: String,
    parameters: VehicleParameters,
    pub(crate) mass_kg: f64,
    /// Moments of inertia of the whole vehicle about its centre of mass, without the spin of the wheels, kg m2.
    pub(crate) inertia_kg_m2: Vec3,
    /// Centre of mass of the whole vehicle in base_link, m.
    pub(crate) centre_of_mass_m: Vec3,
    pub(crate) wheels: Vec<Wheel>,
    pub(crate) tyre: Tyre,
    pub(crate) belly: Belly,
}

impl Vehicle {
    /// Checks the parameters and derives mass, inertia and contact points.
    ///
    /// The products of inertia are taken as 0: the body axes are principal axes.
    ///
    /// # Errors
    /// A [`ParameterError`] for a number out of range, wheels inside each other, a centre of mass that is not between
    /// the wheels, or a fan of rays too coarse for the tyre's sag.
    pub fn new(name: &str, parameters: VehicleParameters) -> Result<Self, ParameterError> {
        parameters.check()?;
        let hubs = hubs(&parameters);
        let mass_kg = parameters.chassis.mass_kg + parameters.wheels.mass_kg * hubs.len() as f64;
        let centre_of_mass_m = centre_of_mass(&parameters, &hubs, mass_kg);
        let inertia_kg_m2 = inertia(&parameters, &hubs, centre_of_mass_m);
        let static_load_n = mass_kg * GRAVITY_M_S2 / hubs.len() as f64;
        let tyre = Tyre::new(&parameters, static_load_n)?;
        let belly = Belly::new(&parameters, centre_of_mass_m, tyre.reach_m);
        let axles = parameters.wheels.axles_m.len();
        let wheel = |(i, &hub): (usize, &Vec3)| Wheel {
            name: format!("{}_{}_wheel", axle_name(i / 2, axles), SIDES[i % 2]),
            hub: sub(hub, centre_of_mass_m),
            side: i % 2,
        };
        let wheels = hubs.iter().enumerate().map(wheel).collect();
        let name = name.to_owned();
        Ok(Self { name, parameters, mass_kg, inertia_kg_m2, centre_of_mass_m, wheels, tyre, belly })
    }

    /// Name, as `husky_a200`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The parameters it was made from.
    pub fn parameters(&self) -> &VehicleParameters {
        &self.parameters
    }

    /// Distance between the outer axles, m.
    pub fn wheelbase_m(&self) -> f64 {
        let axles = &self.parameters.wheels.axles_m;
        axles[0] - axles[axles.len() - 1]
    }

    /// Half the diagonal of the rectangle around chassis and wheels in plan, m: the radius that a turning vehicle sweeps.
    pub fn half_diagonal_m(&self) -> f64 {
        let (wheels, size) = (&self.parameters.wheels, self.parameters.chassis.size_m);
        let length = size[0].max(self.wheelbase_m() + 2.0 * wheels.radius_m);
        let width = size[1].max(wheels.track_m + wheels.width_m);
        0.5 * (length * length + width * width).sqrt()
    }

    /// The vehicle as drawn.
    pub fn outline(&self) -> VehicleOutline {
        let (chassis, wheels) = (&self.parameters.chassis, &self.parameters.wheels);
        let wheel = |w: &Wheel| WheelOutline {
            name: w.name.clone(),
            hub_m: super::vector::add(w.hub, self.centre_of_mass_m),
            radius_m: wheels.radius_m,
            width_m: wheels.width_m,
        };
        VehicleOutline {
            name: self.name.clone(),
            chassis_size_m: chassis.size_m,
            chassis_centre_m: [0.0, 0.0, chassis.bottom_z_m + 0.5 * chassis.size_m[2]],
            wheels: self.wheels.iter().map(wheel).collect(),
        }
    }

    pub(crate) fn skid_steer(&self) -> &SkidSteerParameters {
        let DriveParameters::SkidSteer(drive) = &self.parameters.drive;
        drive
    }

    /// Moment of inertia of the wheels of one side about the axle, kg m2.
    pub(crate) fn side_spin_inertia(&self) -> f64 {
        self.parameters.wheels.spin_inertia_kg_m2 * self.parameters.wheels.axles_m.len() as f64
    }

    /// No contact point lies farther from the centre of its wheel or group, m.
    pub(crate) fn reach_m(&self) -> f64 {
        self.tyre.reach_m.max(self.belly.reach_m)
    }

    /// No contact point lies farther from the centre of mass, m.
    pub(crate) fn extent_m(&self) -> f64 {
        let wheels = self.wheels.iter().map(|w| norm(w.hub) + self.tyre.reach_m);
        wheels.fold(self.belly.extent_m, f64::max)
    }
}

/// Hubs in base_link, axle by axle from the front, left before right.
fn hubs(parameters: &VehicleParameters) -> Vec<Vec3> {
    let wheels = &parameters.wheels;
    let axle = |&x: &f64| [0.5, -0.5].map(|side| [x, side * wheels.track_m, wheels.axle_z_m]);
    wheels.axles_m.iter().flat_map(axle).collect()
}

fn centre_of_mass(parameters: &VehicleParameters, hubs: &[Vec3], mass_kg: f64) -> Vec3 {
    let (chassis, wheel_kg) = (&parameters.chassis, parameters.wheels.mass_kg);
    std::array::from_fn(|axis| {
        let wheels: f64 = hubs.iter().map(|hub| wheel_kg * hub[axis]).sum();
        (chassis.mass_kg * chassis.centre_of_mass_m[axis] + wheels) / mass_kg
    })
}

/// Steiner's theorem over chassis and wheels; the spin of the wheels about the axle is a degree of freedom of its own.
fn inertia(parameters: &VehicleParameters, hubs: &[Vec3], centre: Vec3) -> Vec3 {
    let (chassis, wheels) = (&parameters.chassis, &parameters.wheels);
    let own = [wheels.transverse_inertia_kg_m2, 0.0, wheels.transverse_inertia_kg_m2];
    std::array::from_fn(|axis| {
        let steiner = |mass: f64, at: Vec3| {
            let d = sub(at, centre);
            mass * (d[(axis + 1) % 3] * d[(axis + 1) % 3] + d[(axis + 2) % 3] * d[(axis + 2) % 3])
        };
        let of_wheels: f64 = hubs.iter().map(|&hub| own[axis] + steiner(wheels.mass_kg, hub)).sum();
        chassis.inertia_kg_m2[axis] + steiner(chassis.mass_kg, chassis.centre_of_mass_m) + of_wheels
    })
}

fn axle_name(index: usize, axles: usize) -> String {
    match index {
        0 => "front".to_owned(),
        i if i + 1 == axles => "rear".to_owned(),
        1 if axles == 3 => "middle".to_owned(),
        i => format!("middle_{i}"),
    }
}
