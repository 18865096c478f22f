//! One vehicle on the ground, step by step.

use super::belly::{Bristles, Load, Motion};
use super::body::Body;
use super::contact::Touch;
use super::drive::{Grip, Servo, Side, Tread};
use super::ground::Ground;
use super::model::Vehicle;
use super::settings::TraverseSettings;
use super::vector::{Vec3, add, add_scaled, cross, dot, scale, sub};
use sastrugi_schemas::topics::WheelState;

/// State of a simulation.
#[derive(Clone, Debug)]
pub(crate) struct Simulation<'a> {
    ground: &'a Ground,
    vehicle: &'a Vehicle,
    belly_friction: f64,
    tread: Tread,
    pub body: Body,
    /// Spin of the wheels of either side in the map frame, about the axle, rad/s.
    pub spin: [f64; 2],
    /// Angle turned by either side relative to the chassis, rad.
    angle: [f64; 2],
    /// Tread deflection of each wheel, forward and left, m.
    deflections: Vec<[f64; 2]>,
    bristles: Bristles,
    /// The last step of each wheel.
    rolls: Vec<Roll>,
    rim: Vec<Vec3>,
    /// A contact point met ground without data.
    pub undefined: bool,
}

/// Motion and load of a wheel over a step.
#[derive(Clone, Copy, Debug, Default)]
struct Roll {
    touch: Option<(Touch, Grip)>,
    /// Forward and left, N.
    friction: [f64; 2],
    /// Drive torque, N m.
    torque: f64,
    /// Speed of the contact point along the rolling direction as part of the chassis, m/s.
    ground_speed: f64,
}

impl<'a> Simulation<'a> {
    pub(crate) fn new(ground: &'a Ground, vehicle: &'a Vehicle, settings: &'a TraverseSettings, body: Body) -> Self {
        let (tyre, surface) = (&vehicle.parameters().tyre, &settings.parameters().surface);
        let tread = Tread {
            radius_m: vehicle.tyre.radius_m,
            stiffness: tyre.tangential_stiffness_n_m,
            damping: tyre.tangential_damping_n_s_m,
            relaxation_length_m: tyre.relaxation_length_m,
            friction: surface.wheel_friction,
            rolling_resistance: surface.rolling_resistance,
            step_s: settings.step_s(),
        };
        let wheels = vehicle.wheels.len();
        Self {
            ground,
            vehicle,
            belly_friction: surface.belly_friction,
            tread,
            body,
            spin: [0.0; 2],
            angle: [0.0; 2],
            deflections: vec![[0.0; 2]; wheels],
            bristles: vehicle.belly.at_rest(),
            rolls: vec![Roll::default(); wheels],
            rim: Vec::new(),
            undefined: false,
        }
    }

    /// Advances by one time step.
    pub(crate) fn step(&mut self, servos: [Servo; 2]) {
        let axes = self.body.axes();
        let motion = Motion {
            position: self.body.position,
            velocity: self.body.velocity,
            rate: axes.to_map(self.body.rate),
            axes,
        };
        self.find_touches(&motion);
        let spun = self.spun(servos);
        let belly = self.press_belly(&motion);
        let (mut force, mut moment) = self.roll(&motion, spun);
        force = add(force, belly.force);
        moment = add(moment, belly.moment);
        let inertia = self.vehicle.side_spin_inertia();
        let gained = inertia * (spun[0] - self.spin[0] + spun[1] - self.spin[1]) / self.tread.step_s;
        let momentum = scale(axes.y, inertia * (spun[0] + spun[1]));
        moment = sub(add_scaled(moment, axes.y, -gained), cross(motion.rate, momentum));
        self.spin = spun;
        self.angle = [0, 1].map(|side| self.angle[side] + (spun[side] - self.body.rate[1]) * self.tread.step_s);
        self.body.step(self.vehicle, &axes, force, moment, self.tread.step_s);
    }

    /// Starts the clock: wheel angles count from here.
    pub(crate) fn zero_angles(&mut self) {
        self.angle = [0.0; 2];
    }

    /// Normal forces and friction data of all wheels.
    fn find_touches(&mut self, motion: &Motion) {
        let (tyre, axes) = (&self.vehicle.tyre, &motion.axes);
        tyre.rim(axes, &mut self.rim);
        for ((wheel, roll), deflection) in self.vehicle.wheels.iter().zip(&mut self.rolls).zip(&mut self.deflections) {
            let hub = add(motion.position, axes.to_map(wheel.hub));
            let pressing = tyre.press(self.ground, hub, axes, &self.rim);
            self.undefined |= pressing.undefined;
            *roll = Roll::default();
            let Some(touch) = pressing.touch(hub, axes, tyre.radius_m) else {
                *deflection = [0.0; 2];
                continue;
            };
            let velocity = add(motion.velocity, cross(motion.rate, sub(touch.point, motion.position)));
            let damping = self.vehicle.parameters().tyre.damping_n_s_m;
            let normal_n = (touch.elastic_n - damping * dot(velocity, touch.normal)).max(0.0);
            let [forward, left] = [dot(velocity, touch.forward), dot(velocity, touch.left)];
            let without_spin = [forward + tyre.radius_m * self.body.rate[1], left];
            let grip = Grip::new(&self.tread, normal_n, *deflection, without_spin, self.spin[wheel.side]);
            *roll = Roll { touch: Some((touch, grip)), ground_speed: forward, ..Roll::default() };
        }
    }

    /// Spin of both sides at the end of the step.
    fn spun(&self, servos: [Servo; 2]) -> [f64; 2] {
        [0, 1].map(|side| {
            let grips = self.vehicle.wheels.iter().zip(&self.rolls).filter(|(wheel, _)| wheel.side == side);
            let grips = grips.filter_map(|(_, roll)| roll.touch.as_ref().map(|(_, grip)| grip));
            let side_of_step = Side {
                tread: &self.tread,
                servo: servos[side],
                inertia_over_step: self.vehicle.side_spin_inertia() / self.tread.step_s,
                chassis_spin: self.body.rate[1],
            };
            side_of_step.solve(self.spin[side], grips)
        })
    }

    /// Force and moment of all wheels; moves their treads on.
    fn roll(&mut self, motion: &Motion, spun: [f64; 2]) -> (Vec3, Vec3) {
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        let wheel_inertia = self.vehicle.parameters().wheels.spin_inertia_kg_m2;
        for ((wheel, roll), deflection) in self.vehicle.wheels.iter().zip(&mut self.rolls).zip(&mut self.deflections) {
            let spin = spun[wheel.side];
            roll.torque = wheel_inertia * (spin - self.spin[wheel.side]) / self.tread.step_s;
            let Some((touch, grip)) = &roll.touch else { continue };
            let ([forward, left], deflected) = grip.settle(&self.tread, spin);
            *deflection = deflected;
            roll.friction = [forward, left];
            let rolling = self.tread.rolling_n_m(grip.normal_n, spin);
            roll.torque += self.tread.radius_m * forward - rolling;
            let tangential = add_scaled(scale(touch.forward, forward), touch.left, left);
            let push = add_scaled(tangential, touch.normal, grip.normal_n);
            force = add(force, push);
            moment = add(moment, cross(sub(touch.point, motion.position), push));
            moment = add_scaled(moment, motion.axes.y, rolling);
        }
        (force, moment)
    }

    fn press_belly(&mut self, motion: &Motion) -> Load {
        let (belly, parameters) = (&self.vehicle.belly, &self.vehicle.parameters().belly);
        let (friction, step_s) = (self.belly_friction, self.tread.step_s);
        let load = belly.press(self.ground, motion, parameters, friction, step_s, &mut self.bristles);
        self.undefined |= load.undefined;
        load
    }

    /// How deep the deepest contact point lies below the ground, measured upwards, m; negative above it, NaN where the
    /// ground is undefined.
    pub(crate) fn deepest_overlap_m(&self) -> f64 {
        let axes = self.body.axes();
        let mut rim = Vec::new();
        self.vehicle.tyre.rim(&axes, &mut rim);
        let tips =
            self.vehicle.wheels.iter().flat_map(|wheel| self.vehicle.tyre.tips(axes.to_map(wheel.hub), axes.y, &rim));
        let points = self.vehicle.belly.points().iter().map(|&p| axes.to_map(p));
        let overlap = |arm: Vec3| {
            let at = add(self.body.position, arm);
            self.ground.height(at[0], at[1]) - at[2]
        };
        tips.chain(points)
            .map(overlap)
            .fold(f64::NEG_INFINITY, |deepest, o| if o > deepest || o.is_nan() { o } else { deepest })
    }

    /// Every wheel as recorded, from the last step.
    pub(crate) fn wheel_states(&self) -> Vec<WheelState> {
        self.vehicle.wheels.iter().zip(&self.rolls).map(|(wheel, roll)| self.wheel_state(wheel.side, roll)).collect()
    }

    fn wheel_state(&self, side: usize, roll: &Roll) -> WheelState {
        let spin_rad_s = self.spin[side] - self.body.rate[1];
        let normal_force_n = roll.touch.map_or(0.0, |(_, grip)| grip.normal_n);
        WheelState {
            angle_rad: self.angle[side],
            spin_rad_s,
            torque_n_m: roll.torque,
            normal_force_n,
            longitudinal_force_n: roll.friction[0],
            lateral_force_n: roll.friction[1],
            slip_ratio: roll.touch.map_or(0.0, |_| slip_ratio(self.tread.radius_m * spin_rad_s, roll.ground_speed)),
            contact_m: roll.touch.map_or([0.0; 3], |(touch, _)| touch.point),
        }
    }
}

#[cfg(test)]
impl Simulation<'_> {
    /// Mechanical energy: motion, height, and what tyres, treads and belly have stored, J.
    pub(crate) fn energy_j(&self) -> f64 {
        let (vehicle, body, axes) = (self.vehicle, &self.body, self.body.axes());
        let turning: f64 = (0..3).map(|i| vehicle.inertia_kg_m2[i] * body.rate[i] * body.rate[i]).sum();
        let spinning: f64 = self.spin.iter().map(|w| vehicle.side_spin_inertia() * w * w).sum();
        let moving = vehicle.mass_kg * dot(body.velocity, body.velocity);
        let height = vehicle.mass_kg * super::model::GRAVITY_M_S2 * body.position[2];
        let mut rim = Vec::new();
        vehicle.tyre.rim(&axes, &mut rim);
        let hubs = vehicle.wheels.iter().map(|w| add(body.position, axes.to_map(w.hub)));
        let tyres: f64 = hubs.map(|hub| vehicle.tyre.stored_j(self.ground, hub, axes.y, &rim)).sum();
        let treads: f64 = self.deflections.iter().map(|s| self.tread.stiffness * (s[0] * s[0] + s[1] * s[1])).sum();
        0.5 * (moving + turning + spinning + treads) + height + tyres
    }
}

/// Rim speed less ground speed over the larger of the two; 0 for a wheel at rest.
fn slip_ratio(rim_m_s: f64, ground_m_s: f64) -> f64 {
    let larger = rim_m_s.abs().max(ground_m_s.abs());
    if larger > REST_M_S { (rim_m_s - ground_m_s) / larger } else { 0.0 }
}

/// Below this speed of rim and ground a wheel counts as at rest, m/s.
const REST_M_S: f64 = 1e-3;
