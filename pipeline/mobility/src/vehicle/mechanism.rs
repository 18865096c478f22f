//! Export of a vehicle as rigid bodies on joints, for other simulators.
//!
//! Bodies and joints are those of the model, with the same masses, moments of inertia, springs, dampers, stops and motors. The
//! differences required by other engines are:
//!
//! * wheels are rigid cylinders: the sag of the tyres is stated, not modelled;
//! * engines reject massless links, so a rocker takes [`LINK_SHARE`] of the front wheel's mass, at its hub, and a bogie the same
//!   share of both of its wheels, at their hubs. Total mass and centre of mass are unchanged for any joint positions; the
//!   moments of inertia grow by `LINK_SHARE` of a wheel's transverse moment for each link;
//! * steering has no inertia in the model; here a critically damped servo follows the command, stiff enough to hold a wheel
//!   that scrubs on the spot within [`STEERING_ERROR_DEG`].

use super::model::{GRAVITY_M_S2, SIDES, Vehicle, Wheel, hubs};
use super::params::{DriveParameters, IndependentParameters, RockerBogieParameters, SuspensionParameters};
use super::surface::{MATERIALS, SurfaceParameters};
use super::vector::{Vec3, add, scale, sub};
use sastrugi_schemas::mechanism::{
    Coupling, GroundFriction, Joint, Link, Mechanism, Motion, Motor, Servo, Shape, Spring,
};

/// Share of a wheel's mass that is assigned to the link that carries it.
const LINK_SHARE: f64 = 0.01;
/// Steering error under the torque of a wheel that scrubs on the spot, deg.
const STEERING_ERROR_DEG: f64 = 1.0;
/// Index of the chassis among the links.
const CHASSIS: usize = 0;

impl Vehicle {
    /// The vehicle as rigid bodies on joints, with the friction of `surface` as its default.
    pub fn mechanism(&self, surface: &SurfaceParameters) -> Mechanism {
        let wheels = &self.parameters().wheels;
        let friction = friction(surface);
        Mechanism {
            name: self.name().to_owned(),
            links: self.links(),
            couplings: self.couplings(),
            motors: self.motors(friction.wheel),
            friction,
            standing_height_m: wheels.radius_m - wheels.axle_z_m,
            tyre_sag_m: self.static_load_n() / self.parameters().tyre.stiffness_n_m,
        }
    }

    /// Load per wheel if all wheels carry equal shares of the weight, N.
    fn static_load_n(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2 / self.wheels.len() as f64
    }

    fn links(&self) -> Vec<Link> {
        let mut links = vec![self.chassis_link()];
        let hubs = hubs(self.parameters());
        match &self.parameters().suspension {
            SuspensionParameters::RockerBogie(joints) => {
                (0..SIDES.len()).for_each(|side| self.add_side(&mut links, joints, &hubs, side));
            }
            SuspensionParameters::Rigid | SuspensionParameters::Independent(_) => {
                let wheels = self.wheels.iter().zip(&hubs);
                links.extend(wheels.map(|(wheel, &hub)| self.wheel_link(wheel, CHASSIS, hub)));
            }
        }
        links
    }

    fn chassis_link(&self) -> Link {
        let chassis = &self.parameters().chassis;
        Link {
            name: "base_link".to_owned(),
            parent: None,
            origin_m: [0.0; 3],
            mass_kg: chassis.mass_kg,
            centre_of_mass_m: chassis.centre_of_mass_m,
            inertia_kg_m2: chassis.inertia_kg_m2,
            shape: Some(Shape::Box {
                size_m: chassis.size_m,
                centre_m: [0.0, 0.0, chassis.bottom_z_m + 0.5 * chassis.size_m[2]],
            }),
            joints: Vec::new(),
        }
    }

    /// A wheel on the link `parent`, with its hub relative to that link.
    fn wheel_link(&self, wheel: &Wheel, parent: usize, hub: Vec3) -> Link {
        let wheels = &self.parameters().wheels;
        let across = wheels.transverse_inertia_kg_m2;
        let carried = if parent == CHASSIS { 0.0 } else { LINK_SHARE };
        let sliding = match &self.parameters().suspension {
            SuspensionParameters::Independent(springs) => Some(self.suspension_joint(wheel, springs)),
            SuspensionParameters::Rigid | SuspensionParameters::RockerBogie(_) => None,
        };
        let spin = Joint { name: spin(wheel), motion: Motion::TurnY, range: None, damping: 0.0, spring: None };
        Link {
            name: wheel.name.clone(),
            parent: Some(parent),
            origin_m: hub,
            mass_kg: (1.0 - carried) * wheels.mass_kg,
            centre_of_mass_m: [0.0; 3],
            inertia_kg_m2: [across, wheels.spin_inertia_kg_m2, across],
            shape: Some(Shape::Wheel { radius_m: wheels.radius_m, width_m: wheels.width_m }),
            joints: sliding.into_iter().chain(self.steering_joint(wheel)).chain([spin]).collect(),
        }
    }

    fn suspension_joint(&self, wheel: &Wheel, springs: &IndependentParameters) -> Joint {
        let preload_n = self.chassis_mass_kg() * GRAVITY_M_S2 / self.wheels.len() as f64;
        Joint {
            name: format!("{}_suspension", wheel.name),
            motion: Motion::SlideZ,
            range: Some([-springs.droop_m, springs.bump_m]),
            damping: springs.damping_n_s_m,
            spring: Some(Spring {
                stiffness_n_m: springs.stiffness_n_m,
                unloaded_m: -preload_n / springs.stiffness_n_m,
                force_max_n: preload_n + springs.stiffness_n_m * springs.bump_m,
            }),
        }
    }

    fn steering_joint(&self, wheel: &Wheel) -> Option<Joint> {
        let DriveParameters::Ackermann(drive) = &self.parameters().drive else { return None };
        let limit = drive.steering_limit_deg.to_radians();
        wheel.steered.then(|| Joint {
            name: steering(wheel),
            motion: Motion::TurnZ,
            range: Some([-limit, limit]),
            damping: 0.0,
            spring: None,
        })
    }

    /// Rocker and bogie of a side, with their wheels.
    fn add_side(&self, links: &mut Vec<Link>, joints: &RockerBogieParameters, hubs: &[Vec3], side: usize) {
        let [front, middle, rear] = [side, 2 + side, 4 + side];
        let (Some(&[_, y, _]), [rocker_x, rocker_z], [bogie_x, bogie_z]) =
            (hubs.get(front), joints.rocker_pivot_m, joints.bogie_pivot_m)
        else {
            return;
        };
        let (rocker_at, bogie_at) = ([rocker_x, y, rocker_z], [bogie_x, y, bogie_z]);
        let rocker = links.len();
        links.push(self.carrier_link(
            &format!("{}_rocker", SIDES[side]),
            CHASSIS,
            rocker_at,
            rocker_at,
            &hubs[front..=front],
            joints,
        ));
        self.add_wheel(links, front, rocker, hubs, rocker_at);
        let bogie = links.len();
        let bogie_hubs = [hubs[middle], hubs[rear]];
        let from_rocker = sub(bogie_at, rocker_at);
        links.push(self.carrier_link(
            &format!("{}_bogie", SIDES[side]),
            rocker,
            from_rocker,
            bogie_at,
            &bogie_hubs,
            joints,
        ));
        self.add_wheel(links, middle, bogie, hubs, bogie_at);
        self.add_wheel(links, rear, bogie, hubs, bogie_at);
    }

    /// Adds a wheel, by its index, to the link `parent`, whose frame lies at `pivot` in base_link.
    fn add_wheel(&self, links: &mut Vec<Link>, wheel: usize, parent: usize, hubs: &[Vec3], pivot: Vec3) {
        links.push(self.wheel_link(&self.wheels[wheel], parent, sub(hubs[wheel], pivot)));
    }

    /// A rocker or bogie with its pivot at `pivot` in base_link and its share of the mass of the wheels at `hubs`.
    fn carrier_link(
        &self,
        name: &str,
        parent: usize,
        origin_m: Vec3,
        pivot: Vec3,
        hubs: &[Vec3],
        joints: &RockerBogieParameters,
    ) -> Link {
        let wheels = &self.parameters().wheels;
        let each_kg = LINK_SHARE * wheels.mass_kg;
        let middle = scale(hubs.iter().fold([0.0; 3], |sum, &hub| add(sum, hub)), 1.0 / hubs.len() as f64);
        let own = LINK_SHARE * wheels.transverse_inertia_kg_m2;
        // All hubs of a link lie on one line along x.
        let along: f64 = hubs.iter().map(|hub| each_kg * (hub[0] - middle[0]) * (hub[0] - middle[0])).sum();
        // The model has one damper in the differential, which turns with both rockers: each gets half of it.
        let (limit_deg, damping) = match parent {
            CHASSIS => (joints.rocker_limit_deg, 0.5 * joints.damping_n_m_s),
            _ => (joints.bogie_limit_deg, joints.damping_n_m_s),
        };
        let limit = limit_deg.to_radians();
        Link {
            name: name.to_owned(),
            parent: Some(parent),
            origin_m,
            mass_kg: each_kg * hubs.len() as f64,
            centre_of_mass_m: sub(middle, pivot),
            inertia_kg_m2: [own, own + along, own + along],
            shape: None,
            joints: vec![Joint {
                name: pivot_joint(name),
                motion: Motion::TurnY,
                range: Some([-limit, limit]),
                damping,
                spring: None,
            }],
        }
    }

    /// The differential between the rockers.
    fn couplings(&self) -> Vec<Coupling> {
        let SuspensionParameters::RockerBogie(_) = &self.parameters().suspension else { return Vec::new() };
        let [leader, follower] = SIDES.map(|side| pivot_joint(&format!("{side}_rocker")));
        vec![Coupling { leader, follower, ratio: -1.0 }]
    }

    fn motors(&self, wheel_friction: f64) -> Vec<Motor> {
        match &self.parameters().drive {
            DriveParameters::SkidSteer(drive) => {
                let motor = |(channel, side): (usize, &str)| {
                    let turned = self.wheels.iter().filter(|wheel| wheel.channel == channel);
                    let outward_m = 0.5 * drive.track_multiplier * self.parameters().wheels.track_m;
                    Motor {
                        name: format!("{side}_motor"),
                        joints: turned.map(spin).collect(),
                        servo: Servo::Speed {
                            gain_n_m_s: drive.servo_gain_n_m_s,
                            torque_limit_n_m: drive.torque_limit_n_m,
                            speed_limit_rad_s: self
                                .wheel_speed(drive.speed_limit_m_s + outward_m * drive.yaw_rate_limit_rad_s),
                        },
                    }
                };
                SIDES.into_iter().enumerate().map(motor).collect()
            }
            DriveParameters::Ackermann(drive) => {
                let motor = |wheel: &Wheel| {
                    let [ahead, left] = wheel.turning_arm_m;
                    let arm_m = (ahead * ahead + left * left).sqrt();
                    Motor {
                        name: format!("{}_motor", wheel.name),
                        joints: vec![spin(wheel)],
                        servo: Servo::Speed {
                            gain_n_m_s: drive.servo_gain_n_m_s,
                            torque_limit_n_m: drive.torque_limit_n_m,
                            speed_limit_rad_s: self
                                .wheel_speed(drive.speed_limit_m_s + arm_m * drive.yaw_rate_limit_rad_s),
                        },
                    }
                };
                let servo = self.steering_servo(wheel_friction, drive.steering_rate_deg_s.to_radians());
                let steered = self.wheels.iter().filter(|wheel| wheel.steered);
                let steering =
                    steered.map(|wheel| Motor { name: steering(wheel), joints: vec![steering(wheel)], servo });
                self.wheels.iter().map(motor).chain(steering).collect()
            }
        }
    }

    /// Spin of a wheel whose hub moves at that speed, rad/s.
    fn wheel_speed(&self, speed_m_s: f64) -> f64 {
        speed_m_s / self.parameters().wheels.radius_m
    }

    fn steering_servo(&self, wheel_friction: f64, rate_limit_rad_s: f64) -> Servo {
        let wheels = &self.parameters().wheels;
        // Even on ice, turning a wheel requires some torque.
        let scrub_n_m = wheel_friction.max(0.1) * self.static_load_n() * 0.5 * wheels.width_m;
        let stiffness_n_m = scrub_n_m / STEERING_ERROR_DEG.to_radians();
        Servo::Angle {
            stiffness_n_m,
            damping_n_m_s: 2.0 * (stiffness_n_m * wheels.transverse_inertia_kg_m2).sqrt(),
            rate_limit_rad_s,
        }
    }
}

fn spin(wheel: &Wheel) -> String {
    format!("{}_spin", wheel.name)
}

fn steering(wheel: &Wheel) -> String {
    format!("{}_steering", wheel.name)
}

fn pivot_joint(link: &str) -> String {
    format!("{link}_pivot")
}

fn friction(surface: &SurfaceParameters) -> GroundFriction {
    let name = MATERIALS.iter().find(|material| material.preset == surface.preset).map_or("", |material| material.name);
    let friction = surface.friction();
    GroundFriction { surface: name.to_owned(), wheel: friction.wheel, belly: friction.belly, rolling: friction.rolling }
}
