//! A checked vehicle and the quantities derived once from its parameters.

use super::belly::Belly;
use super::contact::Tyre;
use super::linkage::Linkage;
use super::params::{DriveParameters, VehicleParameters};
use super::vector::{Vec3, add, norm, sub};
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
    /// Hub relative to the centre of mass with all joints at zero, m.
    pub hub: Vec3,
    /// Motor channel that turns it.
    pub channel: usize,
    pub steered: bool,
    /// Hub in plan relative to the point of the chassis about which a turn is commanded: forward and left, m.
    pub turning_arm_m: [f64; 2],
}

/// A vehicle with checked parameters.
#[derive(Clone, Debug)]
pub struct Vehicle {
    name: String,
    parameters: VehicleParameters,
    pub(crate) mass_kg: f64,
    /// Moments of inertia of the complete vehicle about its centre of mass, joints at zero, without the spin of the wheels,
    /// kg m2.
    pub(crate) inertia_kg_m2: Vec3,
    /// Moments of inertia of chassis and wheels about their own centres, without the spin of the wheels, kg m2.
    pub(crate) own_inertia_kg_m2: Vec3,
    /// Centre of mass of the complete vehicle in base_link, joints at zero, m.
    pub(crate) centre_of_mass_m: Vec3,
    /// Centre of mass of the chassis relative to that of the complete vehicle, m.
    pub(crate) chassis_centre_m: Vec3,
    pub(crate) wheels: Vec<Wheel>,
    /// Hubs of all wheels, in the order of `wheels`.
    pub(crate) hubs: Vec<Vec3>,
    /// Total moment of inertia about the axle of the wheels of each motor channel, kg m2.
    pub(crate) spin_inertia: Vec<f64>,
    pub(crate) linkage: Linkage,
    pub(crate) tyre: Tyre,
    pub(crate) belly: Belly,
}

impl Vehicle {
    /// Checks the parameters and derives mass, inertia and contact points.
    ///
    /// The products of inertia are taken as 0: the body axes are principal axes.
    ///
    /// # Errors
    /// A [`ParameterError`] for a number out of range, overlapping wheels, a centre of mass that is not between the wheels,
    /// or a fan of rays too coarse for the tyre's sag.
    pub fn new(name: &str, parameters: VehicleParameters) -> Result<Self, ParameterError> {
        parameters.check()?;
        let hubs = hubs(&parameters);
        let mass_kg = parameters.chassis.mass_kg + parameters.wheels.mass_kg * hubs.len() as f64;
        let centre_of_mass_m = centre_of_mass(&parameters, &hubs, mass_kg);
        let inertia_kg_m2 = inertia(&parameters, &hubs, centre_of_mass_m);
        let static_load_n = mass_kg * GRAVITY_M_S2 / hubs.len() as f64;
        let tyre = Tyre::new(&parameters, static_load_n)?;
        let belly = Belly::new(&parameters, centre_of_mass_m, tyre.reach_m);
        let sprung_weight_n = parameters.chassis.mass_kg * GRAVITY_M_S2;
        let linkage = Linkage::new(&parameters, sprung_weight_n, centre_of_mass_m);
        let wheels = wheels(&parameters, &hubs, centre_of_mass_m);
        check_spot_turn(&parameters.drive, &wheels)?;
        Ok(Self {
            name: name.to_owned(),
            mass_kg,
            inertia_kg_m2,
            own_inertia_kg_m2: own_inertia(&parameters),
            centre_of_mass_m,
            chassis_centre_m: sub(parameters.chassis.centre_of_mass_m, centre_of_mass_m),
            hubs: wheels.iter().map(|w| w.hub).collect(),
            spin_inertia: spin_inertia(&wheels, parameters.wheels.spin_inertia_kg_m2),
            wheels,
            linkage,
            tyre,
            belly,
            parameters,
        })
    }

    /// Name, such as `husky_a200`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The parameters of the vehicle.
    pub fn parameters(&self) -> &VehicleParameters {
        &self.parameters
    }

    /// Distance between the outer axles, m.
    pub fn wheelbase_m(&self) -> f64 {
        let axles = &self.parameters.wheels.axles_m;
        axles[0] - axles[axles.len() - 1]
    }

    /// Half the diagonal of the rectangle around chassis and wheels in plan, m: the radius that the vehicle sweeps when it
    /// turns on the spot.
    ///
    /// ```
    /// use sastrugi_mobility::registry::vehicle;
    /// use serde_json::Map;
    ///
    /// let husky = vehicle("husky_a200", &Map::new()).unwrap();
    /// assert_eq!(husky.name(), "husky_a200");
    /// // It is longer than its wheelbase of 0.512 m, and sweeps less than a metre.
    /// assert!(husky.half_diagonal_m() > 0.256 && husky.half_diagonal_m() < 1.0);
    /// ```
    pub fn half_diagonal_m(&self) -> f64 {
        let (wheels, size) = (&self.parameters.wheels, self.parameters.chassis.size_m);
        let length = size[0].max(self.wheelbase_m() + 2.0 * wheels.radius_m);
        let width = size[1].max(wheels.track_m + wheels.width_m);
        0.5 * (length * length + width * width).sqrt()
    }

    /// Outline of the vehicle for drawing.
    pub fn outline(&self) -> VehicleOutline {
        let (chassis, wheels) = (&self.parameters.chassis, &self.parameters.wheels);
        let wheel = |w: &Wheel| WheelOutline {
            name: w.name.clone(),
            hub_m: add(w.hub, self.centre_of_mass_m),
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

    pub(crate) fn chassis_mass_kg(&self) -> f64 {
        self.parameters.chassis.mass_kg
    }

    /// Number of motor channels.
    pub(crate) fn channels(&self) -> usize {
        self.spin_inertia.len()
    }

    /// Largest distance of a contact point from the centre of its wheel or tile, m.
    pub(crate) fn reach_m(&self) -> f64 {
        self.tyre.reach_m.max(self.belly.reach_m)
    }

    /// Largest distance of a contact point from the centre of mass, m.
    pub(crate) fn extent_m(&self) -> f64 {
        let wheels = self.wheels.iter().map(|w| norm(w.hub) + self.tyre.reach_m);
        wheels.fold(self.belly.extent_m, f64::max) + self.linkage.travel_m(&self.hubs)
    }
}

/// Hubs in base_link, axle by axle from the front, left before right.
pub(super) fn hubs(parameters: &VehicleParameters) -> Vec<Vec3> {
    let wheels = &parameters.wheels;
    let axle = |&x: &f64| [0.5, -0.5].map(|side| [x, side * wheels.track_m, wheels.axle_z_m]);
    wheels.axles_m.iter().flat_map(axle).collect()
}

/// Wheels in the order of the hubs.
fn wheels(parameters: &VehicleParameters, hubs: &[Vec3], centre_of_mass: Vec3) -> Vec<Wheel> {
    let axles = &parameters.wheels.axles_m;
    let steered = |axle: usize| match &parameters.drive {
        DriveParameters::SkidSteer(_) => false,
        DriveParameters::Ackermann(drive) => drive.steered_axles.contains(&(axle as u32)),
    };
    let fixed: Vec<f64> = (0..axles.len()).filter(|&axle| !steered(axle)).map(|axle| axles[axle]).collect();
    let turning_x = if fixed.is_empty() { 0.0 } else { fixed.iter().sum::<f64>() / fixed.len() as f64 };
    let wheel = |(i, &hub): (usize, &Vec3)| Wheel {
        name: format!("{}_{}_wheel", axle_name(i / 2, axles.len()), SIDES[i % 2]),
        hub: sub(hub, centre_of_mass),
        channel: match &parameters.drive {
            DriveParameters::SkidSteer(_) => i % 2,
            DriveParameters::Ackermann(_) => i,
        },
        steered: steered(i / 2),
        turning_arm_m: [hub[0] - turning_x, hub[1]],
    };
    hubs.iter().enumerate().map(wheel).collect()
}

/// A vehicle that turns on the spot must be able to point its steered wheels along the circle about its centre.
fn check_spot_turn(drive: &DriveParameters, wheels: &[Wheel]) -> Result<(), ParameterError> {
    let DriveParameters::Ackermann(drive) = drive else { return Ok(()) };
    let angle = |w: &Wheel| libm::atan2(w.turning_arm_m[0].abs(), w.turning_arm_m[1].abs()).to_degrees();
    let needed = wheels.iter().filter(|w| w.steered).map(angle).fold(0.0, f64::max);
    if !drive.spot_turn || needed <= drive.steering_limit_deg {
        return Ok(());
    }
    let message = format!(
        "is true, but a turn on the spot needs {needed:.1} deg of steering; the limit is {} deg",
        drive.steering_limit_deg
    );
    Err(ParameterError::new("drive.spot_turn", message))
}

fn spin_inertia(wheels: &[Wheel], of_wheel: f64) -> Vec<f64> {
    let channels = wheels.iter().map(|w| w.channel + 1).max().unwrap_or(0);
    (0..channels).map(|channel| of_wheel * wheels.iter().filter(|w| w.channel == channel).count() as f64).collect()
}

fn centre_of_mass(parameters: &VehicleParameters, hubs: &[Vec3], mass_kg: f64) -> Vec3 {
    let (chassis, wheel_kg) = (&parameters.chassis, parameters.wheels.mass_kg);
    std::array::from_fn(|axis| {
        let wheels: f64 = hubs.iter().map(|hub| wheel_kg * hub[axis]).sum();
        (chassis.mass_kg * chassis.centre_of_mass_m[axis] + wheels) / mass_kg
    })
}

/// Parallel-axis theorem over chassis and wheels; the spin of the wheels about the axle is a separate degree of freedom.
fn inertia(parameters: &VehicleParameters, hubs: &[Vec3], centre: Vec3) -> Vec3 {
    let (chassis, wheels) = (&parameters.chassis, &parameters.wheels);
    let own = own_inertia(parameters);
    std::array::from_fn(|axis| {
        let steiner = |mass: f64, at: Vec3| {
            let d = sub(at, centre);
            mass * (d[(axis + 1) % 3] * d[(axis + 1) % 3] + d[(axis + 2) % 3] * d[(axis + 2) % 3])
        };
        let of_wheels: f64 = hubs.iter().map(|&hub| steiner(wheels.mass_kg, hub)).sum();
        own[axis] + steiner(chassis.mass_kg, chassis.centre_of_mass_m) + of_wheels
    })
}

/// Chassis and wheels about their own centres.
fn own_inertia(parameters: &VehicleParameters) -> Vec3 {
    let (chassis, wheels) = (&parameters.chassis, &parameters.wheels);
    let transverse = wheels.transverse_inertia_kg_m2 * 2.0 * wheels.axles_m.len() as f64;
    let [x, y, z] = chassis.inertia_kg_m2;
    [x + transverse, y, z + transverse]
}

fn axle_name(index: usize, axles: usize) -> String {
    match index {
        0 => "front".to_owned(),
        i if i + 1 == axles => "rear".to_owned(),
        1 if axles == 3 => "middle".to_owned(),
        i => format!("middle_{i}"),
    }
}
