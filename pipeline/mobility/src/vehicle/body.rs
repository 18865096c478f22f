//! The rigid body: its state, and a semi-implicit Euler step.

use super::model::Vehicle;
use super::vector::{Axes, Quaternion, Vec3, add, add_scaled, cross, scale, sub, turned};

/// State of the chassis, in the map frame unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    /// Reference point, m: the centre of mass of the vehicle with all joints at zero.
    pub position: Vec3,
    /// Velocity of the reference point, m/s.
    pub velocity: Vec3,
    /// Rotation from the body to the map frame.
    pub orientation: Quaternion,
    /// Angular velocity in the body frame, rad/s.
    pub rate: Vec3,
}

impl Body {
    /// Advances by one step under a force and a moment about the centre of mass (both without gravity). The gyroscopic term
    /// is explicit; velocities are updated first.
    #[inline(always)]
    pub(crate) fn step(&mut self, vehicle: &Vehicle, axes: &Axes, force: Vec3, moment: Vec3, step_s: f64) {
        let acceleration = sub(scale(force, 1.0 / vehicle.mass_kg), [0.0, 0.0, super::model::GRAVITY_M_S2]);
        self.velocity = add_scaled(self.velocity, acceleration, step_s);
        let inertia = vehicle.inertia_kg_m2;
        let momentum: Vec3 = std::array::from_fn(|i| inertia[i] * self.rate[i]);
        let torque = sub(axes.to_body(moment), cross(self.rate, momentum));
        self.rate = std::array::from_fn(|i| self.rate[i] + step_s * torque[i] / inertia[i]);
        self.advance(step_s);
    }

    /// Advances position and orientation by one step with the current velocities.
    #[inline(always)]
    pub(crate) fn advance(&mut self, step_s: f64) {
        self.position = add_scaled(self.position, self.velocity, step_s);
        self.orientation = turned(self.orientation, scale(self.rate, step_s));
    }

    /// False once a number has overflowed.
    pub(crate) fn is_finite(&self) -> bool {
        let vectors = self.position.iter().chain(&self.velocity).chain(&self.rate);
        vectors.chain(&self.orientation).all(|v| v.is_finite())
    }

    /// Axes of the body.
    #[inline(always)]
    pub(crate) fn axes(&self) -> Axes {
        Axes::of(self.orientation)
    }

    /// Position and velocity of the base_link origin.
    pub(crate) fn base(&self, vehicle: &Vehicle) -> (Vec3, Vec3) {
        let axes = self.axes();
        let arm = base_arm(vehicle, &axes);
        (add(self.position, arm), add(self.velocity, cross(axes.to_map(self.rate), arm)))
    }

    /// Position of the base_link origin of a body with these axes.
    #[inline(always)]
    pub(crate) fn base_position(&self, vehicle: &Vehicle, axes: &Axes) -> Vec3 {
        add(self.position, base_arm(vehicle, axes))
    }
}

/// The base_link origin from the centre of mass, in the map frame.
#[inline(always)]
fn base_arm(vehicle: &Vehicle, axes: &Axes) -> Vec3 {
    axes.to_map(scale(vehicle.centre_of_mass_m, -1.0))
}
