//! Time stepping of one vehicle on the ground.
//!
//! A step runs as a whole with the vectors of the ground ([`Ground::vectors`]): entering them once for every wheel and for the
//! chassis costs more than what is gained there on one number at a time.

use super::articulated;
use super::belly::{self, Bristles, Load, Motion};
use super::body::Body;
use super::contact::{self, Pressing, Tips, Touch};
use super::drive::{Channel, Grip, Servo, Tread};
use super::ground::Ground;
use super::lanes::{Four, LANES, apart, beside, repeated};
use super::linkage::{Carrier, Joints};
use super::model::Vehicle;
use super::params::DriveParameters;
use super::settings::TraverseSettings;
use super::surface::Friction;
use super::vector::{Axes, Vec3, add, add_scaled, cross, dot, norm, scale, sub};
use pulp::{Simd, WithSimd};
use sastrugi_schemas::topics::WheelState;

/// State of a simulation.
#[derive(Clone, Debug)]
pub(crate) struct Simulation<'a> {
    ground: &'a Ground,
    vehicle: &'a Vehicle,
    /// Coefficients where the ground has no surface map.
    friction: Friction,
    tread: Tread,
    /// Largest change of a steering angle over a step, rad.
    steering_step_rad: f64,
    pub body: Body,
    pub joints: Joints,
    carriers: Vec<Carrier>,
    /// Spin of the wheels of every channel about their axles, in the map frame, rad/s.
    pub spin: Vec<f64>,
    /// The same at the end of the step.
    spun: Vec<f64>,
    /// Steering angle of each wheel and its commanded value, rad.
    pub steering: Vec<f64>,
    pub steering_target: Vec<f64>,
    /// Angle turned by each wheel relative to its mount, rad.
    angle: Vec<f64>,
    /// Tread deflection of each wheel, forward and left, m.
    deflections: Vec<[f64; 2]>,
    bristles: Bristles,
    /// Motion and load of each wheel in the last step.
    rolls: Vec<Roll>,
    /// The wheels of one channel that touch the ground.
    grips: Vec<Grip>,
    rim: Vec<Tips>,
    steered_rim: Vec<Tips>,
    joint_forces: Vec<f64>,
    /// Force of the ground on the chassis in the last step, N.
    chassis_force: Vec3,
    /// A contact point met ground without data.
    pub undefined: bool,
}

/// Motion and load of a wheel over a step.
#[derive(Clone, Copy, Debug, Default)]
struct Roll {
    /// Axle direction in the map frame.
    axle: Vec3,
    /// Angular velocity of the wheel's mount in the map frame, rad/s.
    mount_rate: Vec3,
    /// Its component about the axle, rad/s.
    mount_spin: f64,
    touch: Option<(Touch, Grip)>,
    /// Friction force, forward and left, N.
    friction: [f64; 2],
    /// Drive torque, N m.
    torque: f64,
    /// Speed of the contact point along the rolling direction if it were fixed to the mount, m/s.
    ground_speed: f64,
}

/// The ground on a wheel.
#[derive(Clone, Copy, Debug, Default)]
struct Pressed {
    pressing: Pressing,
    hub: Vec3,
    /// Direction of the axle.
    axle: Vec3,
}

/// A time step of a simulation.
struct Step<'s, 'a> {
    simulation: &'s mut Simulation<'a>,
    /// One per channel.
    servos: &'s [Servo],
}

impl WithSimd for Step<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.simulation.step_with(simd, self.servos);
    }
}

impl<'a> Simulation<'a> {
    pub(crate) fn new(ground: &'a Ground, vehicle: &'a Vehicle, settings: &'a TraverseSettings, body: Body) -> Self {
        let tyre = &vehicle.parameters().tyre;
        let tread = Tread {
            radius_m: vehicle.tyre.radius_m,
            stiffness: tyre.tangential_stiffness_n_m,
            damping: tyre.tangential_damping_n_s_m,
            relaxation_length_m: tyre.relaxation_length_m,
            step_s: settings.step_s(),
        };
        let (wheels, channels) = (vehicle.wheels.len(), vehicle.channels());
        let joints = vehicle.linkage.joints(wheels);
        let steering_rate_deg_s = match &vehicle.parameters().drive {
            DriveParameters::SkidSteer(_) => 0.0,
            DriveParameters::Ackermann(drive) => drive.steering_rate_deg_s,
        };
        Self {
            ground,
            vehicle,
            friction: settings.parameters().surface.friction(),
            tread,
            steering_step_rad: steering_rate_deg_s.to_radians() * settings.step_s(),
            body,
            carriers: vehicle.linkage.carriers(&vehicle.hubs, &joints),
            joint_forces: vec![0.0; joints.rate.len()],
            joints,
            spin: vec![0.0; channels],
            spun: vec![0.0; channels],
            steering: vec![0.0; wheels],
            steering_target: vec![0.0; wheels],
            angle: vec![0.0; wheels],
            deflections: vec![[0.0; 2]; wheels],
            bristles: vehicle.belly.at_rest(),
            rolls: vec![Roll::default(); wheels],
            grips: Vec::with_capacity(wheels),
            rim: Vec::new(),
            steered_rim: Vec::new(),
            chassis_force: [0.0; 3],
            undefined: false,
        }
    }

    /// Advances by one time step, with one servo per channel.
    pub(crate) fn step(&mut self, servos: &[Servo]) {
        self.ground.vectors().run(Step { simulation: self, servos });
    }

    #[inline(always)]
    fn step_with<S: Simd>(&mut self, simd: S, servos: &[Servo]) {
        let axes = self.body.axes();
        let motion = Motion {
            position: self.body.position,
            velocity: self.body.velocity,
            rate: axes.to_map(self.body.rate),
            axes,
        };
        self.steer();
        self.find_touches(simd, &motion);
        self.turn_wheels(servos);
        self.vehicle.linkage.push(&self.joints, &mut self.joint_forces);
        let belly = self.press_belly(simd, &motion);
        let (force, moment) = self.roll(&motion);
        let (force, moment) = (add(force, belly.force), add(moment, belly.moment));
        std::mem::swap(&mut self.spin, &mut self.spun);
        for ((angle, roll), wheel) in self.angle.iter_mut().zip(&self.rolls).zip(&self.vehicle.wheels) {
            *angle += (self.spin[wheel.channel] - roll.mount_spin) * self.tread.step_s;
        }
        self.advance(&axes, force, moment);
    }

    /// Advances body and joints under a force and a moment about the reference point, both without gravity.
    #[inline(always)]
    fn advance(&mut self, axes: &Axes, force: Vec3, moment: Vec3) {
        if self.joints.rate.is_empty() {
            self.body.step(self.vehicle, axes, force, moment, self.tread.step_s);
            return;
        }
        let (force, moment) = (axes.to_body(force), axes.to_body(moment));
        let loads = articulated::Loads { force, moment, joints: &self.joint_forces };
        let (body, joints) = (&mut self.body, &mut self.joints);
        articulated::step(body, joints, self.vehicle, &self.carriers, axes, &loads, self.tread.step_s);
        self.vehicle.linkage.place(&self.vehicle.hubs, &self.joints, &mut self.carriers);
    }

    /// Resets the wheel angles, at the start of the mission.
    pub(crate) fn zero_angles(&mut self) {
        self.angle.fill(0.0);
    }

    /// True if no suspension joint moves faster than 1 mm/s or 1 mrad/s.
    pub(crate) fn joints_are_still(&self) -> bool {
        self.joints.rate.iter().all(|rate| rate.abs() < STILL)
    }

    /// Moves the steering angles towards their targets.
    #[inline(always)]
    fn steer(&mut self) {
        for (angle, target) in self.steering.iter_mut().zip(&self.steering_target) {
            *angle += (target - *angle).clamp(-self.steering_step_rad, self.steering_step_rad);
        }
    }

    /// Normal forces and friction data of all wheels, four wheels side by side.
    #[inline(always)]
    fn find_touches<S: Simd>(&mut self, simd: S, motion: &Motion) {
        self.vehicle.tyre.rim(&motion.axes, &mut self.rim);
        let count = self.rolls.len();
        for first in (0..count).step_by(LANES) {
            let wheels = first..count.min(first + LANES);
            // Vacant lanes are off the ground.
            let mut pressed = [Pressed::default(); LANES];
            for (index, pressed) in wheels.clone().zip(&mut pressed) {
                *pressed = self.press_wheel(simd, motion, index);
            }
            let (touches, velocities) = self.contacts(simd, motion, first, &pressed);
            for ((index, touch), &velocity) in wheels.zip(&touches).zip(&velocities) {
                self.grip(index, touch, velocity);
            }
        }
    }

    /// Presses a wheel on the ground; notes the motion of its mount.
    #[inline(always)]
    fn press_wheel<S: Simd>(&mut self, simd: S, motion: &Motion, index: usize) -> Pressed {
        let (vehicle, axes) = (self.vehicle, &motion.axes);
        let (tyre, carrier) = (&vehicle.tyre, &self.carriers[index]);
        let (frame, rim) = if vehicle.wheels[index].steered {
            let frame = turned_about_z(axes, self.steering[index]);
            tyre.rim(&frame, &mut self.steered_rim);
            (frame, &self.steered_rim)
        } else {
            (*axes, &self.rim)
        };
        let hub = add(motion.position, axes.to_map(carrier.hub));
        let pressing = contact::Press { tyre, ground: self.ground, hub, left: frame.y, rim }.with_simd(simd);
        self.undefined |= pressing.undefined;
        let mount_rate = add_scaled(motion.rate, axes.y, carrier.turning(&self.joints.rate));
        let mount_spin = dot(mount_rate, frame.y);
        self.rolls[index] = Roll { axle: frame.y, mount_rate, mount_spin, ..Roll::default() };
        Pressed { pressing, hub, axle: frame.y }
    }

    /// Contacts of the four wheels from `first`, and the velocity of each contact point if it were fixed to the mount: along normal, rolling
    /// direction and left, m/s.
    #[inline(always)]
    fn contacts<S: Simd>(
        &self,
        simd: S,
        motion: &Motion,
        first: usize,
        [a, b, c, d]: &[Pressed; LANES],
    ) -> ([Touch; LANES], [Vec3; LANES]) {
        let force = beside(simd, [a.pressing.force, b.pressing.force, c.pressing.force, d.pressing.force]);
        let offset_moment = Four::new(simd, [a, b, c, d].map(|wheel| wheel.pressing.offset_moment));
        let hub = beside(simd, [a.hub, b.hub, c.hub, d.hub]);
        let axle = beside(simd, [a.axle, b.axle, c.axle, d.axle]);
        let radius_m = Four::repeated(simd, self.vehicle.tyre.radius_m);
        let touch = Touch::of(force, offset_moment, hub, axle, radius_m);
        let arm = sub(touch.point, repeated(simd, motion.position));
        let mut velocity = add(repeated(simd, motion.velocity), cross(repeated(simd, motion.rate), arm));
        if !self.joints.rate.is_empty() {
            velocity = add(velocity, beside(simd, self.moved(&motion.axes, first, apart(arm))));
        }
        let velocity = [dot(velocity, touch.normal), dot(velocity, touch.forward), dot(velocity, touch.left)];
        (touch.apart(), apart(velocity))
    }

    /// Velocities that the joints give to one point of each wheel from `first`, in the map frame, m/s.
    fn moved(&self, axes: &Axes, first: usize, arms: [Vec3; LANES]) -> [Vec3; LANES] {
        let mut velocities = [[0.0; 3]; LANES];
        for ((velocity, arm), carrier) in velocities.iter_mut().zip(arms).zip(&self.carriers[first..]) {
            *velocity = axes.to_map(carrier.velocity(axes.to_body(arm), &self.joints.rate));
        }
        velocities
    }

    /// Friction data of a wheel with this contact.
    #[inline(always)]
    fn grip(&mut self, index: usize, touch: &Touch, [rising, forward, left]: Vec3) {
        if touch.is_missing() {
            self.deflections[index] = [0.0; 2];
            return;
        }
        let (tyre, roll) = (&self.vehicle.parameters().tyre, &mut self.rolls[index]);
        let normal_n = (touch.elastic_n - tyre.damping_n_s_m * rising).max(0.0);
        let without_spin = [forward + self.tread.radius_m * roll.mount_spin, left];
        let friction = self.ground.friction(touch.point[0], touch.point[1]).unwrap_or(self.friction);
        let spin = self.spin[self.vehicle.wheels[index].channel];
        let grip = Grip::new(&self.tread, friction, normal_n, self.deflections[index], without_spin, spin);
        roll.touch = Some((*touch, grip));
        roll.ground_speed = forward;
    }

    /// Solves for the spin of every channel at the end of the step.
    #[inline(always)]
    fn turn_wheels(&mut self, servos: &[Servo]) {
        for (channel, (spun, servo)) in self.spun.iter_mut().zip(servos).enumerate() {
            let of_channel = self.vehicle.wheels.iter().zip(&self.rolls).filter(|(wheel, _)| wheel.channel == channel);
            let mounts = of_channel.clone().map(|(_, roll)| roll.mount_spin);
            let step = Channel {
                tread: &self.tread,
                servo: *servo,
                inertia_over_step: self.vehicle.spin_inertia[channel] / self.tread.step_s,
                mount_spin: mounts.clone().sum::<f64>() / mounts.count() as f64,
            };
            // Every iteration of the solver reads all of them.
            self.grips.clear();
            self.grips.extend(of_channel.filter_map(|(_, roll)| roll.touch.map(|(_, grip)| grip)));
            *spun = step.solve(self.spin[channel], &self.grips);
        }
    }

    /// Force and moment of all wheels and their generalised forces on the joints; updates the tread deflections.
    #[inline(always)]
    fn roll(&mut self, motion: &Motion) -> (Vec3, Vec3) {
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        let wheel_inertia = self.vehicle.parameters().wheels.spin_inertia_kg_m2;
        for (index, (wheel, roll)) in self.vehicle.wheels.iter().zip(&mut self.rolls).enumerate() {
            let spin = self.spun[wheel.channel];
            let gained = wheel_inertia * (spin - self.spin[wheel.channel]) / self.tread.step_s;
            roll.torque = gained;
            let mut couple = scale(cross(roll.mount_rate, roll.axle), -wheel_inertia * spin);
            couple = add_scaled(couple, roll.axle, -gained);
            let (mut push, mut arm) = ([0.0; 3], [0.0; 3]);
            if let Some((touch, grip)) = &roll.touch {
                let ([forward, left], deflected) = grip.settle(&self.tread, spin);
                self.deflections[index] = deflected;
                roll.friction = [forward, left];
                let rolling = grip.rolling_n_m(spin);
                roll.torque += self.tread.radius_m * forward - rolling;
                let tangential = add_scaled(scale(touch.forward, forward), touch.left, left);
                push = add_scaled(tangential, touch.normal, grip.normal_n);
                arm = sub(touch.point, motion.position);
                couple = add_scaled(couple, roll.axle, rolling);
            }
            force = add(force, push);
            moment = add(add(moment, cross(arm, push)), couple);
            for (joint, lever) in &self.carriers[index].levers {
                let along = lever.velocity(motion.axes.to_body(arm));
                self.joint_forces[*joint] +=
                    dot(along, motion.axes.to_body(push)) + lever.turning() * dot(motion.axes.y, couple);
            }
        }
        (force, moment)
    }

    #[inline(always)]
    fn press_belly<S: Simd>(&mut self, simd: S, motion: &Motion) -> Load {
        let here = self.ground.friction(motion.position[0], motion.position[1]).unwrap_or(self.friction);
        let press = belly::Press {
            belly: &self.vehicle.belly,
            ground: self.ground,
            motion,
            parameters: &self.vehicle.parameters().belly,
            friction: here.belly,
            step_s: self.tread.step_s,
            bristles: &mut self.bristles,
        };
        let load = press.with_simd(simd);
        self.undefined |= load.undefined;
        self.chassis_force = load.force;
        load
    }

    /// Vertical depth of the deepest contact point below the ground, m; negative above it, NaN where the ground is undefined.
    pub(crate) fn deepest_overlap_m(&self) -> f64 {
        let axes = self.body.axes();
        let mut rim = Vec::new();
        self.vehicle.tyre.rim(&axes, &mut rim);
        let tips =
            self.carriers.iter().flat_map(|carrier| self.vehicle.tyre.tips(axes.to_map(carrier.hub), axes.y, &rim));
        let points = self.vehicle.belly.points().iter().map(|&p| axes.to_map(p));
        let overlap = |arm: Vec3| {
            let at = add(self.body.position, arm);
            self.ground.height(at[0], at[1]) - at[2]
        };
        tips.chain(points)
            .map(overlap)
            .fold(f64::NEG_INFINITY, |deepest, o| if o > deepest || o.is_nan() { o } else { deepest })
    }

    /// Magnitude of the force of the ground on the chassis in the last step, N.
    pub(crate) fn chassis_force_n(&self) -> f64 {
        norm(self.chassis_force)
    }

    /// The recorded state of every wheel after the last step.
    pub(crate) fn wheel_states(&self) -> Vec<WheelState> {
        (0..self.rolls.len()).map(|index| self.wheel_state(index)).collect()
    }

    fn wheel_state(&self, index: usize) -> WheelState {
        let roll = &self.rolls[index];
        let spin_rad_s = self.spin[self.vehicle.wheels[index].channel] - roll.mount_spin;
        let normal_force_n = roll.touch.map_or(0.0, |(_, grip)| grip.normal_n);
        WheelState {
            angle_rad: self.angle[index],
            spin_rad_s,
            torque_n_m: roll.torque,
            normal_force_n,
            longitudinal_force_n: roll.friction[0],
            lateral_force_n: roll.friction[1],
            slip_ratio: roll.touch.map_or(0.0, |_| slip_ratio(self.tread.radius_m * spin_rad_s, roll.ground_speed)),
            contact_m: roll.touch.map_or([0.0; 3], |(touch, _)| touch.point),
            steering_rad: self.steering[index],
            hub_m: add(self.carriers[index].hub, self.vehicle.centre_of_mass_m),
        }
    }
}

/// Axes rotated about their z axis.
#[inline(always)]
fn turned_about_z(axes: &Axes, angle: f64) -> Axes {
    let (sin, cos) = libm::sincos(angle);
    Axes { x: add_scaled(scale(axes.x, cos), axes.y, sin), y: add_scaled(scale(axes.y, cos), axes.x, -sin), z: axes.z }
}

#[cfg(test)]
impl Simulation<'_> {
    /// Mechanical energy, J: kinetic, potential, and the energy stored in tyres, treads, springs and stops. Steering must be
    /// at rest.
    pub(crate) fn energy_j(&self) -> f64 {
        let (vehicle, body, axes) = (self.vehicle, &self.body, self.body.axes());
        let velocity = axes.to_body(body.velocity);
        let of_mass = |mass_kg: f64, carrier: &Carrier| {
            let v = add(add(velocity, cross(body.rate, carrier.hub)), carrier.velocity(carrier.hub, &self.joints.rate));
            let z = body.position[2] + axes.to_map(carrier.hub)[2];
            0.5 * mass_kg * dot(v, v) + mass_kg * super::model::GRAVITY_M_S2 * z
        };
        let wheel = &vehicle.parameters().wheels;
        let chassis = of_mass(vehicle.chassis_mass_kg(), &Carrier::fixed(vehicle.chassis_centre_m));
        let wheels: f64 = self.carriers.iter().map(|carrier| of_mass(wheel.mass_kg, carrier)).sum();
        let turning: f64 = (0..3).map(|i| vehicle.own_inertia_kg_m2[i] * body.rate[i] * body.rate[i]).sum();
        let spins = vehicle.wheels.iter().map(|w| self.spin[w.channel]);
        let spinning: f64 = spins.map(|spin| wheel.spin_inertia_kg_m2 * spin * spin).sum();
        let mut rim = Vec::new();
        vehicle.tyre.rim(&axes, &mut rim);
        let hubs = self.carriers.iter().map(|carrier| add(body.position, axes.to_map(carrier.hub)));
        let tyres: f64 = hubs.map(|hub| vehicle.tyre.stored_j(self.ground, hub, axes.y, &rim)).sum();
        let treads: f64 = self.deflections.iter().map(|s| self.tread.stiffness * (s[0] * s[0] + s[1] * s[1])).sum();
        let springs = vehicle.linkage.stored_j(&self.joints);
        chassis + wheels + 0.5 * (turning + spinning + treads) + tyres + springs
    }
}

/// Rim speed minus ground speed, divided by the larger of the two; 0 for a wheel at rest.
fn slip_ratio(rim_m_s: f64, ground_m_s: f64) -> f64 {
    let larger = rim_m_s.abs().max(ground_m_s.abs());
    if larger > REST_M_S { (rim_m_s - ground_m_s) / larger } else { 0.0 }
}

/// A wheel counts as at rest below this speed of rim and ground, m/s.
const REST_M_S: f64 = 1e-3;
/// A joint counts as at rest below this rate, m/s or rad/s.
const STILL: f64 = 1e-3;
