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
    pub(crate) fn axes(&self) -> Axes {
        Axes::of(self.orientation)
    }

    /// Position and velocity of the base_link origin.
    pub(crate) fn base(&self, vehicle: &Vehicle) -> (Vec3, Vec3) {
        let axes = self.axes();
        let arm = axes.to_map(scale(vehicle.centre_of_mass_m, -1.0));
        (add(self.position, arm), add(self.velocity, cross(axes.to_map(self.rate), arm)))
    }

    /// True when pitch or roll exceeds the angle with that sine and cosine (below 90 deg), or the vehicle is upside down.
    pub(crate) fn is_tipped(&self, (sin_limit, cos_limit): (f64, f64)) -> bool {
        let axes = self.axes();
        let (pitch_sin, roll_sin, roll_cos) = (axes.x[2].abs(), axes.y[2].abs(), axes.z[2]);
        pitch_sin > sin_limit || roll_sin * cos_limit > roll_cos * sin_limit
    }
}
