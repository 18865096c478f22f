//! Suspension kinematics: joints, the wheel positions that follow from them, and the forces of springs, dampers and stops.
//!
//! Everything is in the body frame, relative to the chassis' reference point (the centre of mass of the complete vehicle with
//! all joints at zero). A wheel is carried by at most two joints, each of which either lets it slide along z or turns it about
//! the transverse axis y:
//!
//! * *rigid*: no joints;
//! * *independent*: one sliding joint per wheel, up positive;
//! * *rocker-bogie* (three axles): joint 0 is the differential, `+q` on the left and `-q` on the right rocker; joints 1 and
//!   2 turn the left and right bogie relative to its rocker. The rockers carry the front wheels, the bogies the others.
//!
//! The links are massless; their mass is included in the chassis or the wheels.

use super::params::{IndependentParameters, RockerBogieParameters, SuspensionParameters, VehicleParameters};
use super::vector::{Vec3, add, add_scaled, norm, sub};

/// Positions (m or rad) and rates of all joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Joints {
    pub position: Vec<f64>,
    pub rate: Vec<f64>,
}

/// How a joint moves what it carries.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lever {
    /// Along z.
    Slide,
    /// About the transverse axis through `pivot`, in the sense of `sign`.
    Turn { pivot: Vec3, sign: f64 },
}

impl Lever {
    /// Velocity of a carried point per unit rate of the joint.
    #[inline(always)]
    pub(crate) fn velocity(&self, point: Vec3) -> Vec3 {
        match self {
            Self::Slide => [0.0, 0.0, 1.0],
            Self::Turn { pivot, sign } => [sign * (point[2] - pivot[2]), 0.0, sign * (pivot[0] - point[0])],
        }
    }

    /// Angular rate about y per unit rate of the joint.
    #[inline(always)]
    pub(crate) fn turning(&self) -> f64 {
        match self {
            Self::Slide => 0.0,
            Self::Turn { sign, .. } => *sign,
        }
    }
}

/// Mount of one wheel.
#[derive(Clone, Debug)]
pub(crate) struct Carrier {
    pub hub: Vec3,
    /// The joints that move it.
    pub levers: Vec<(usize, Lever)>,
    /// Acceleration of the hub relative to the chassis at constant joint rates.
    pub drift: Vec3,
}

impl Carrier {
    /// A carrier that no joint moves.
    pub(crate) fn fixed(hub: Vec3) -> Self {
        Self { hub, levers: Vec::new(), drift: [0.0; 3] }
    }

    fn set<const N: usize>(&mut self, levers: [(usize, Lever); N]) {
        self.levers.clear();
        self.levers.extend(levers);
    }

    /// Velocity of a point of the carrier relative to the chassis.
    #[inline(always)]
    pub(crate) fn velocity(&self, point: Vec3, rates: &[f64]) -> Vec3 {
        let moved = |v: Vec3, (joint, lever): &(usize, Lever)| add_scaled(v, lever.velocity(point), rates[*joint]);
        self.levers.iter().fold([0.0; 3], moved)
    }

    /// Angular rate about y relative to the chassis, rad/s.
    #[inline(always)]
    pub(crate) fn turning(&self, rates: &[f64]) -> f64 {
        self.levers.iter().map(|(joint, lever)| lever.turning() * rates[*joint]).sum()
    }
}

/// The joints of a vehicle.
#[derive(Clone, Debug)]
pub(crate) enum Linkage {
    Rigid,
    Independent {
        springs: IndependentParameters,
        /// Force of every spring at zero travel, N.
        preload_n: f64,
    },
    RockerBogie {
        limits_rad: [f64; 2],
        joints: RockerBogieParameters,
        /// Pivots relative to the reference point, `[x, z]`, m.
        rocker: [f64; 2],
        bogie: [f64; 2],
    },
}

impl Linkage {
    /// `sprung_weight_n`: weight of the chassis without wheels; `reference`: the reference point in base_link.
    pub(crate) fn new(parameters: &VehicleParameters, sprung_weight_n: f64, reference: Vec3) -> Self {
        let from_reference = |[x, z]: [f64; 2]| [x - reference[0], z - reference[2]];
        match &parameters.suspension {
            SuspensionParameters::Rigid => Self::Rigid,
            SuspensionParameters::Independent(springs) => {
                let wheels = 2.0 * parameters.wheels.axles_m.len() as f64;
                Self::Independent { springs: springs.clone(), preload_n: sprung_weight_n / wheels }
            }
            SuspensionParameters::RockerBogie(joints) => Self::RockerBogie {
                limits_rad: [joints.rocker_limit_deg.to_radians(), joints.bogie_limit_deg.to_radians()],
                joints: joints.clone(),
                rocker: from_reference(joints.rocker_pivot_m),
                bogie: from_reference(joints.bogie_pivot_m),
            },
        }
    }

    /// All joints at zero and at rest, for `wheels` wheels.
    pub(crate) fn joints(&self, wheels: usize) -> Joints {
        let count = match self {
            Self::Rigid => 0,
            Self::Independent { .. } => wheels,
            Self::RockerBogie { .. } => 3,
        };
        Joints { position: vec![0.0; count], rate: vec![0.0; count] }
    }

    /// Largest possible distance of a hub from its position at rest, m.
    pub(crate) fn travel_m(&self, hubs: &[Vec3]) -> f64 {
        match self {
            Self::Rigid => 0.0,
            // Stops are at least as stiff as the springs: twice the travel would need more than the vehicle's weight.
            Self::Independent { springs, .. } => 2.0 * springs.bump_m.max(springs.droop_m),
            // Anywhere on a circle about the bogie's pivot, which lies anywhere on a circle about the rocker's pivot.
            Self::RockerBogie { rocker, bogie, .. } => {
                let from = |[x, z]: [f64; 2], hub: &Vec3| norm([hub[0] - x, 0.0, hub[2] - z]);
                hubs.iter().map(|hub| 2.0 * from(*rocker, hub) + 4.0 * from(*bogie, hub)).fold(0.0, f64::max)
            }
        }
    }

    /// Carriers of wheels with hubs at `hubs` (relative to the reference point, joints at zero; axle by axle from the front,
    /// left before right).
    pub(crate) fn carriers(&self, hubs: &[Vec3], joints: &Joints) -> Vec<Carrier> {
        let mut carriers: Vec<Carrier> = hubs.iter().map(|&hub| Carrier::fixed(hub)).collect();
        self.place(hubs, joints, &mut carriers);
        carriers
    }

    /// Updates the carriers for the current joint positions.
    pub(crate) fn place(&self, hubs: &[Vec3], joints: &Joints, carriers: &mut [Carrier]) {
        match self {
            Self::Rigid => (),
            Self::Independent { .. } => {
                for (wheel, (carrier, &hub)) in carriers.iter_mut().zip(hubs).enumerate() {
                    carrier.hub = add(hub, [0.0, 0.0, joints.position[wheel]]);
                    carrier.set([(wheel, Lever::Slide)]);
                }
            }
            Self::RockerBogie { rocker, bogie, .. } => {
                for (wheel, (carrier, &hub)) in carriers.iter_mut().zip(hubs).enumerate() {
                    swing(carrier, hub, wheel, [*rocker, *bogie], joints);
                }
            }
        }
    }

    /// Forces of springs, dampers and stops along the joints, N or N m.
    pub(crate) fn push(&self, joints: &Joints, forces: &mut [f64]) {
        let moving = joints.position.iter().zip(&joints.rate).zip(forces);
        match self {
            Self::Rigid => (),
            Self::Independent { springs, preload_n } => {
                for ((&q, &rate), force) in moving {
                    let beyond = q - q.clamp(-springs.droop_m, springs.bump_m);
                    *force = -(preload_n + springs.stiffness_n_m * q + springs.damping_n_s_m * rate)
                        - springs.stop_stiffness_n_m * beyond;
                }
            }
            Self::RockerBogie { limits_rad, joints, .. } => {
                for (joint, ((&q, &rate), force)) in moving.enumerate() {
                    let limit = limits_rad[usize::from(joint > 0)];
                    *force = -joints.damping_n_m_s * rate - joints.stop_stiffness_n_m * (q - q.clamp(-limit, limit));
                }
            }
        }
    }

    /// Energy of springs and stops, J.
    #[cfg(test)]
    pub(crate) fn stored_j(&self, joints: &Joints) -> f64 {
        let square = |k: f64, x: f64| 0.5 * k * x * x;
        let stored = |(joint, &q): (usize, &f64)| match self {
            Self::Rigid => 0.0,
            Self::Independent { springs, preload_n } => {
                let beyond = q - q.clamp(-springs.droop_m, springs.bump_m);
                preload_n * q + square(springs.stiffness_n_m, q) + square(springs.stop_stiffness_n_m, beyond)
            }
            Self::RockerBogie { limits_rad, joints, .. } => {
                let limit = limits_rad[usize::from(joint > 0)];
                square(joints.stop_stiffness_n_m, q - q.clamp(-limit, limit))
            }
        };
        joints.position.iter().enumerate().map(stored).sum()
    }
}

/// Places a wheel of a rocker-bogie: rotated with its rocker about the rocker's pivot, and with its bogie about the bogie's.
fn swing(carrier: &mut Carrier, hub: Vec3, wheel: usize, [rocker, bogie]: [[f64; 2]; 2], joints: &Joints) {
    let side = wheel % 2;
    let sign = [1.0, -1.0][side];
    let (angle, rate) = (sign * joints.position[0], sign * joints.rate[0]);
    let pivot = [rocker[0], hub[1], rocker[1]];
    let on_rocker = Lever::Turn { pivot, sign };
    if wheel < 2 {
        let arm = turned_about_y(sub(hub, pivot), angle);
        carrier.hub = add(pivot, arm);
        carrier.set([(0, on_rocker)]);
        carrier.drift = [-rate * rate * arm[0], 0.0, -rate * rate * arm[2]];
        return;
    }
    let (bogie_angle, bogie_rate) = (angle + joints.position[1 + side], rate + joints.rate[1 + side]);
    let bogie_at_rest = [bogie[0], hub[1], bogie[1]];
    let link = turned_about_y(sub(bogie_at_rest, pivot), angle);
    let bogie_pivot = add(pivot, link);
    let arm = turned_about_y(sub(hub, bogie_at_rest), bogie_angle);
    carrier.hub = add(bogie_pivot, arm);
    carrier.set([(0, on_rocker), (1 + side, Lever::Turn { pivot: bogie_pivot, sign: 1.0 })]);
    let inward = |i: usize| -rate * rate * link[i] - bogie_rate * bogie_rate * arm[i];
    carrier.drift = [inward(0), 0.0, inward(2)];
}

/// A vector rotated about y (nose down positive).
fn turned_about_y([x, y, z]: Vec3, angle: f64) -> Vec3 {
    let (sin, cos) = libm::sincos(angle);
    [cos * x + sin * z, y, cos * z - sin * x]
}
