//! Dynamics of a chassis with wheels on joints: rigid masses on a moving body.
//!
//! The unknowns are the acceleration `a` of the chassis' reference point, its angular acceleration `A` and the joint
//! accelerations `q''`, all in the body frame. A mass `m` at `r`, which the joints move by the levers `L` (columns `dr/dq`),
//! accelerates by `J u + b` with `u = (a, A, q'')`, `J = [1, -r x, L]` and
//!
//! ```text
//! b = w x (w x r) + 2 w x (L q') + drift
//! ```
//!
//! d'Alembert's principle applied to the chassis and all wheels (points with the moments of inertia of a disc about x and z)
//! gives `M u = f`, with `M = sum m J^T J + I` symmetric and positive definite, solved by Cholesky factorisation. Without
//! joints it reduces to the rigid body of `body.rs`; a test checks this.
//!
//! Cost: about 2000 operations for six wheels and three joints.

use super::body::Body;
use super::linkage::{Carrier, Joints};
use super::model::{GRAVITY_M_S2, Vehicle};
use super::params::AXLES_MAX;
use super::vector::{Axes, Vec3, add, add_scaled, cross, dot, scale, sub};

/// Maximum number of joints of a vehicle.
const JOINTS_MAX: usize = 2 * AXLES_MAX;
/// Maximum number of unknowns.
const UNKNOWNS_MAX: usize = 6 + JOINTS_MAX;

/// The equations of motion of one time step.
struct Equations {
    size: usize,
    /// Lower triangle.
    matrix: [[f64; UNKNOWNS_MAX]; UNKNOWNS_MAX],
    right: [f64; UNKNOWNS_MAX],
}

/// Loads on the vehicle other than gravity, in the body frame.
pub(crate) struct Loads<'a> {
    /// N.
    pub force: Vec3,
    /// About the reference point, N m.
    pub moment: Vec3,
    /// Along the joints, N or N m.
    pub joints: &'a [f64],
}

/// Advances body and joints by one step: velocities first, then positions.
pub(crate) fn step(
    body: &mut Body,
    joints: &mut Joints,
    vehicle: &Vehicle,
    carriers: &[Carrier],
    axes: &Axes,
    loads: &Loads<'_>,
    step_s: f64,
) {
    let mut equations = Equations::new(joints.rate.len(), loads);
    let gravity = axes.to_body([0.0, 0.0, -GRAVITY_M_S2]);
    equations.add_mass(
        vehicle.chassis_mass_kg(),
        &Carrier::fixed(vehicle.chassis_centre_m),
        joints,
        body.rate,
        gravity,
    );
    let wheel_kg = vehicle.parameters().wheels.mass_kg;
    carriers.iter().for_each(|carrier| equations.add_mass(wheel_kg, carrier, joints, body.rate, gravity));
    equations.add_inertia(vehicle.own_inertia_kg_m2, body.rate);
    let u = equations.solve();
    let [a, turning] = [[u[0], u[1], u[2]], [u[3], u[4], u[5]]];
    body.velocity = add_scaled(body.velocity, axes.to_map(a), step_s);
    body.rate = add_scaled(body.rate, turning, step_s);
    for ((position, rate), acceleration) in joints.position.iter_mut().zip(&mut joints.rate).zip(&u[6..]) {
        *rate += step_s * acceleration;
        *position += step_s * *rate;
    }
    body.advance(step_s);
}

impl Equations {
    fn new(joints: usize, loads: &Loads<'_>) -> Self {
        let mut right = [0.0; UNKNOWNS_MAX];
        right[..3].copy_from_slice(&loads.force);
        right[3..6].copy_from_slice(&loads.moment);
        right[6..6 + joints].copy_from_slice(loads.joints);
        Self { size: 6 + joints, matrix: [[0.0; UNKNOWNS_MAX]; UNKNOWNS_MAX], right }
    }

    fn add_mass(&mut self, mass_kg: f64, carrier: &Carrier, joints: &Joints, rate: Vec3, gravity: Vec3) {
        let r = carrier.hub;
        let moved = carrier.velocity(r, &joints.rate);
        let bias = add(add(cross(rate, cross(rate, r)), scale(cross(rate, moved), 2.0)), carrier.drift);
        let pull = scale(sub(gravity, bias), mass_kg);
        // Columns of J, sparse: three for translation, three for rotation, and one per joint that carries the mass.
        let mut columns: [(usize, Vec3); 8] = [
            (0, [1.0, 0.0, 0.0]),
            (1, [0.0, 1.0, 0.0]),
            (2, [0.0, 0.0, 1.0]),
            (3, [0.0, -r[2], r[1]]),
            (4, [r[2], 0.0, -r[0]]),
            (5, [-r[1], r[0], 0.0]),
            (0, [0.0; 3]),
            (0, [0.0; 3]),
        ];
        for (column, (joint, lever)) in columns[6..].iter_mut().zip(&carrier.levers) {
            *column = (6 + joint, lever.velocity(r));
        }
        let columns = &columns[..6 + carrier.levers.len()];
        for (k, &(row, across)) in columns.iter().enumerate() {
            self.right[row] += dot(across, pull);
            for &(col, along) in &columns[..=k] {
                // Joints that carry one mass come in ascending order, so this fills the lower triangle.
                self.matrix[row][col] += mass_kg * dot(across, along);
            }
        }
    }

    /// Moments of inertia that move with the chassis.
    fn add_inertia(&mut self, inertia: Vec3, rate: Vec3) {
        let momentum: Vec3 = std::array::from_fn(|i| inertia[i] * rate[i]);
        let gyroscopic = cross(rate, momentum);
        for i in 0..3 {
            self.matrix[3 + i][3 + i] += inertia[i];
            self.right[3 + i] -= gyroscopic[i];
        }
    }

    /// Solves for the unknowns, overwriting matrix and right-hand side.
    fn solve(mut self) -> [f64; UNKNOWNS_MAX] {
        for j in 0..self.size {
            for i in j..self.size {
                let known: f64 = (0..j).map(|k| self.matrix[i][k] * self.matrix[j][k]).sum();
                let left = self.matrix[i][j] - known;
                self.matrix[i][j] = if i == j { left.sqrt() } else { left / self.matrix[j][j] };
            }
        }
        let mut u = self.right;
        for i in 0..self.size {
            let known: f64 = (0..i).map(|k| self.matrix[i][k] * u[k]).sum();
            u[i] = (u[i] - known) / self.matrix[i][i];
        }
        for i in (0..self.size).rev() {
            let known: f64 = (i + 1..self.size).map(|k| self.matrix[k][i] * u[k]).sum();
            u[i] = (u[i] - known) / self.matrix[i][i];
        }
        u
    }
}
