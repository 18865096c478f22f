//! Tread friction and wheel speed, solved together.
//!
//! *Friction* of a wheel: a bristle with deflection `s` (forward, left) in the contact plane, carried out of the contact
//! by rolling (relaxation length `L`, as the single-contact-point transient tyre of Pacejka, 2012, section 7.2) and clipped
//! to the friction circle. With sliding velocity `u = (v_x - r W, v_y)` and the time step `h`,
//!
//! ```text
//! s' = (s + h u) / (1 + h |r W| / L)
//! F  = -k s' - c u,   |F| <= mu N;   where clipped, s' = -F / k
//! ```
//!
//! At rest nothing is forgotten, so that a parked or hung vehicle does not creep (true stiction).
//!
//! *Spin* of a motor channel (the wheels of a side, or one wheel): `W'` solves the implicit Euler step
//!
//! ```text
//! J (W' - W) / h = torque(W') - r sum F_x(W') - rolling(W')
//! torque = clamp(gain (target - W' + w_y), limit)        rolling = mu_r r sum N clamp(W' / W0, 1)
//! ```
//!
//! All terms on the right fall with `W'`, so there is one root; Newton's method inside a bracket finds it, normally in two
//! or three steps. `w_y` is the body's rate about the axle: motor and encoder turn with the chassis.

use super::surface::Friction;

/// Below this spin rolling resistance fades to 0, rad/s.
const ROLLING_SPIN_RAD_S: f64 = 0.05;
/// Newton steps after which the root is known to rounding even by bisection.
const STEPS_MAX: usize = 64;
/// The spin is solved to this, rad/s.
const SPIN_TOLERANCE_RAD_S: f64 = 1e-11;

/// What all wheels of a drive share over a time step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tread {
    pub radius_m: f64,
    /// N/m.
    pub stiffness: f64,
    /// N s/m.
    pub damping: f64,
    pub relaxation_length_m: f64,
    pub step_s: f64,
}

/// Friction of one wheel over a time step, as a function of its spin at the end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grip {
    /// Force without clipping at zero spin, forward and left, N.
    free_n: [f64; 2],
    /// Increase of the forward force with spin, N s/rad.
    slope: f64,
    /// Radius of the friction circle, N.
    limit_n: f64,
    /// Largest couple of rolling resistance, N m.
    rolling_limit_n_m: f64,
    /// Normal force, N.
    pub normal_n: f64,
    /// Velocity of the contact point of the wheel without spin, forward and left, m/s.
    pub velocity: [f64; 2],
}

impl Grip {
    /// From the bristle's `deflection` and the wheel's `spin` at the start of the step, on ground with that friction.
    pub(crate) fn new(
        tread: &Tread,
        ground: Friction,
        normal_n: f64,
        deflection: [f64; 2],
        velocity: [f64; 2],
        spin: f64,
    ) -> Self {
        let kept = 1.0 / (1.0 + tread.step_s * (tread.radius_m * spin).abs() / tread.relaxation_length_m);
        let elastic = tread.stiffness * kept;
        let viscous = elastic * tread.step_s + tread.damping;
        Self {
            free_n: [0, 1].map(|i| -elastic * deflection[i] - viscous * velocity[i]),
            slope: viscous * tread.radius_m,
            limit_n: ground.wheel * normal_n,
            rolling_limit_n_m: ground.rolling * tread.radius_m * normal_n,
            normal_n,
            velocity,
        }
    }

    /// Couple that rolling resistance puts on the wheel, N m.
    #[inline(always)]
    pub(crate) fn rolling_n_m(&self, spin: f64) -> f64 {
        -self.rolling_limit_n_m * (spin / ROLLING_SPIN_RAD_S).clamp(-1.0, 1.0)
    }

    /// Forward and left force at a spin, and the derivative of the forward force, N and N s/rad.
    #[inline(always)]
    fn forces(&self, spin: f64) -> ([f64; 2], f64) {
        let free = [self.free_n[0] + self.slope * spin, self.free_n[1]];
        let squared = free[0] * free[0] + free[1] * free[1];
        if squared <= self.limit_n * self.limit_n {
            return (free, self.slope);
        }
        let share = self.limit_n / squared.sqrt();
        (free.map(|f| f * share), self.slope * share * (free[1] * free[1] / squared))
    }

    /// Forward and left force, N, and the deflection of the bristle at the end of the step.
    pub(crate) fn settle(&self, tread: &Tread, spin: f64) -> ([f64; 2], [f64; 2]) {
        let (force, _) = self.forces(spin);
        let clipped = force[0] != self.free_n[0] + self.slope * spin || force[1] != self.free_n[1];
        // A clipped bristle carries the force alone; elsewhere it carries what the damper does not.
        let damping = if clipped { 0.0 } else { tread.damping };
        let sliding = [self.velocity[0] - tread.radius_m * spin, self.velocity[1]];
        (force, [0, 1].map(|i| -(force[i] + damping * sliding[i]) / tread.stiffness))
    }
}

/// What turns the wheels of a side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Servo {
    /// Commanded spin relative to the chassis, rad/s.
    pub target: f64,
    /// N m s/rad.
    pub gain: f64,
    /// N m.
    pub limit: f64,
}

impl Servo {
    /// Wheels locked to the chassis.
    pub(crate) const BRAKE: Self = Self { target: 0.0, gain: 1e6, limit: f64::INFINITY };
    /// Wheels turning freely.
    #[cfg(test)]
    pub(crate) const OFF: Self = Self { target: 0.0, gain: 0.0, limit: 0.0 };

    #[inline(always)]
    pub(crate) fn torque(&self, relative_spin: f64) -> f64 {
        (self.gain * (self.target - relative_spin)).clamp(-self.limit, self.limit)
    }
}

/// The wheels of one motor channel over a time step.
pub(crate) struct Channel<'a> {
    pub tread: &'a Tread,
    pub servo: Servo,
    /// Moment of inertia of all wheels of the channel over the time step, kg m2/s.
    pub inertia_over_step: f64,
    /// Rate of the motor's mount about the axle, rad/s.
    pub mount_spin: f64,
}

impl Channel<'_> {
    /// Spin at the end of the step, rad/s, given the wheels of the channel that touch the ground.
    pub(crate) fn solve<'g>(&self, start: f64, grips: impl Iterator<Item = &'g Grip> + Clone) -> f64 {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut spin = start;
        for _ in 0..STEPS_MAX {
            let (residual, slope) = self.residual(spin, start, grips.clone());
            if residual > 0.0 {
                high = spin
            } else {
                low = spin
            }
            let newton = spin - residual / slope;
            let next = if newton > low && newton < high || newton == spin { newton } else { 0.5 * (low + high) };
            let moved = (next - spin).abs();
            spin = next;
            if moved <= SPIN_TOLERANCE_RAD_S {
                break;
            }
        }
        spin
    }

    /// Momentum balance of the channel, N m, and its derivative by the spin.
    #[inline(always)]
    fn residual<'g>(&self, spin: f64, start: f64, grips: impl Iterator<Item = &'g Grip>) -> (f64, f64) {
        let torque = self.servo.torque(spin - self.mount_spin);
        let servo_slope = if torque.abs() < self.servo.limit { self.servo.gain } else { 0.0 };
        let mut residual = self.inertia_over_step * (spin - start) - torque;
        let mut slope = self.inertia_over_step + servo_slope;
        let rolls = spin.abs() >= ROLLING_SPIN_RAD_S;
        for grip in grips {
            let (force, force_slope) = grip.forces(spin);
            residual += self.tread.radius_m * force[0] - grip.rolling_n_m(spin);
            slope += self.tread.radius_m * force_slope;
            if !rolls {
                slope += grip.rolling_limit_n_m / ROLLING_SPIN_RAD_S;
            }
        }
        (residual, slope)
    }
}
