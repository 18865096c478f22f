//! Tread friction and wheel speed, solved together.
//!
//! *Friction* of a wheel: a bristle with deflection `s` (forward, left) in the contact plane, carried out of the contact
//! by rolling (relaxation length `L`, as in the single-contact-point transient tyre model of Pacejka, 2012, section 7.2) and
//! clipped to the friction circle. With sliding velocity `u = (v_x - r W, v_y)` and time step `h`,
//!
//! ```text
//! s' = (s + h u) / (1 + h |r W| / L)
//! F  = -k s' - c u,   |F| <= mu N;   where clipped, s' = -F / k
//! ```
//!
//! At rest the deflection does not relax, so a parked or hung-up vehicle does not creep (true stiction).
//!
//! *Spin* of a motor channel (the wheels of a side, or one wheel): `W'` solves the implicit Euler step
//!
//! ```text
//! J (W' - W) / h = torque(W') - r sum F_x(W') - rolling(W')
//! torque = clamp(gain (target - W' + w_y), limit)        rolling = mu_r r sum N clamp(W' / W0, 1)
//! ```
//!
//! All terms on the right decrease with `W'`, so there is exactly one root. Bracketed Newton iteration finds it, normally in
//! two or three steps. `w_y` is the body's rate about the axle: motor and encoder rotate with the chassis.

use super::surface::Friction;

/// Below this spin rolling resistance fades to 0, rad/s.
const ROLLING_SPIN_RAD_S: f64 = 0.05;
/// Iterations after which even bisection has found the root to rounding error.
const STEPS_MAX: usize = 64;
/// Tolerance of the spin, rad/s.
const SPIN_TOLERANCE_RAD_S: f64 = 1e-11;

/// Parameters shared by all wheels over a time step.
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
    /// Unclipped force at zero spin, forward and left, N.
    free_n: [f64; 2],
    /// Increase of the forward force with spin, N s/rad.
    slope: f64,
    /// Radius of the friction circle, N.
    limit_n: f64,
    /// Largest couple of rolling resistance, N m.
    rolling_limit_n_m: f64,
    /// Normal force, N.
    pub normal_n: f64,
    /// Velocity that the contact point would have without spin, forward and left, m/s.
    pub velocity: [f64; 2],
}

impl Grip {
    /// Friction from the bristle's `deflection` and the wheel's `spin` at the start of the step, on ground with friction
    /// `ground`.
    #[inline(always)]
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

    /// Couple exerted by rolling resistance on the wheel, N m.
    #[inline(always)]
    pub(crate) fn rolling_n_m(&self, spin: f64) -> f64 {
        -self.rolling_limit_n_m * (spin / ROLLING_SPIN_RAD_S).clamp(-1.0, 1.0)
    }

    /// Forward and left force at a spin, N, and the derivative of the forward force, N s/rad.
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
    #[inline(always)]
    pub(crate) fn settle(&self, tread: &Tread, spin: f64) -> ([f64; 2], [f64; 2]) {
        let (force, _) = self.forces(spin);
        let clipped = force[0] != self.free_n[0] + self.slope * spin || force[1] != self.free_n[1];
        // A clipped bristle carries the complete force; otherwise it carries the force less that of the damper.
        let damping = if clipped { 0.0 } else { tread.damping };
        let sliding = [self.velocity[0] - tread.radius_m * spin, self.velocity[1]];
        (force, [0, 1].map(|i| -(force[i] + damping * sliding[i]) / tread.stiffness))
    }
}

/// Speed controller of a motor channel.
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
    /// Locks the wheels to the chassis.
    pub(crate) const BRAKE: Self = Self { target: 0.0, gain: 1e6, limit: f64::INFINITY };
    /// Leaves the wheels free to turn.
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
    /// Moment of inertia of all wheels of the channel divided by the time step, kg m2/s.
    pub inertia_over_step: f64,
    /// Rate of the motor's mount about the axle, rad/s.
    pub mount_spin: f64,
}

impl Channel<'_> {
    /// Spin at the end of the step, rad/s, given the wheels of the channel that touch the ground.
    #[inline(always)]
    pub(crate) fn solve(&self, start: f64, grips: &[Grip]) -> f64 {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut spin = start;
        for _ in 0..STEPS_MAX {
            let (residual, slope) = self.residual(spin, start, grips);
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

    /// Residual of the channel's momentum balance, N m, and its derivative with respect to the spin.
    #[inline(always)]
    fn residual(&self, spin: f64, start: f64, grips: &[Grip]) -> (f64, f64) {
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

#[cfg(test)]
mod tests {
    use super::*;

    const TREAD: Tread =
        Tread { radius_m: 0.2, stiffness: 1000.0, damping: 10.0, relaxation_length_m: 0.5, step_s: 0.01 };
    const GROUND: Friction = Friction { wheel: 0.8, belly: 0.5, rolling: 0.05 };
    const DEFLECTION: [f64; 2] = [0.001, 0.002];
    const VELOCITY: [f64; 2] = [0.3, 0.1];

    fn grip(normal_n: f64) -> Grip {
        Grip::new(&TREAD, GROUND, normal_n, DEFLECTION, VELOCITY, 1.0)
    }

    fn size([forward, left]: [f64; 2]) -> f64 {
        (forward * forward + left * left).sqrt()
    }

    /// The equations of the header, written out for a wheel that grips: `s' = (s + h u) / (1 + h |r W| / L)`, `F = -k s' - c u`.
    #[test]
    fn val_a_gripping_tread_is_a_relaxing_spring_with_a_damper() {
        for spin in [-2.0, 0.0, 1.0, 1.4] {
            let sliding = [0.3 - 0.2 * spin, 0.1];
            let kept = 1.0 / (1.0 + 0.01 * 0.2 / 0.5);
            let expected = [0, 1].map(|i| kept * (DEFLECTION[i] + 0.01 * sliding[i]));
            let (force, deflection) = grip(1e4).settle(&TREAD, spin);
            let push = [0, 1].map(|i| -1000.0 * expected[i] - 10.0 * sliding[i]);
            assert!((0..2).all(|i| (force[i] - push[i]).abs() < 1e-11), "{spin}: {force:?} {push:?}");
            assert!((0..2).all(|i| (deflection[i] - expected[i]).abs() < 1e-14), "{spin}: {deflection:?} {expected:?}");
        }
    }

    /// A wheel that slides is held by `mu N = 8 N` in the direction of the unclipped force, and its bristle carries all of it.
    #[test]
    fn val_a_sliding_tread_has_the_force_of_the_friction_circle() {
        let (free, _) = grip(1e4).settle(&TREAD, 20.0);
        assert!(size(free) > 30.0, "the wheel must slide: {free:?}");
        let (force, deflection) = grip(10.0).settle(&TREAD, 20.0);
        assert!((size(force) - 8.0).abs() < 1e-12, "{force:?}");
        let across = force[0] * free[1] - force[1] * free[0];
        assert!(across.abs() < 1e-10 && force[0] * free[0] > 0.0, "{force:?} {free:?}");
        assert!((0..2).all(|i| (deflection[i] + force[i] / 1000.0).abs() < 1e-15), "{deflection:?}");
        // A wheel that spins faster than it rolls is pushed forwards; a wheel that drifts left is pushed right.
        assert!(force[0] > 0.0 && force[1] < 0.0, "{force:?}");
    }

    /// The derivative that Newton's method uses is that of the force, on both sides of the friction circle: central differences
    /// over 1e-5 rad/s.
    #[test]
    fn val_the_slope_of_the_force_is_its_derivative() {
        for (normal_n, spin) in [(1e4, 1.0), (10.0, 3.0), (10.0, 20.0), (10.0, -4.0), (3.0, 1.6)] {
            let grip = grip(normal_n);
            let forward = |spin: f64| grip.forces(spin).0[0];
            let difference = (forward(spin + 1e-5) - forward(spin - 1e-5)) / 2e-5;
            let (_, slope) = grip.forces(spin);
            assert!((slope - difference).abs() < 1e-5, "{normal_n} N, {spin} rad/s: {slope} {difference}");
        }
    }

    /// Rolling resistance opposes the spin with `mu_r r N = 1 N m`, and fades to 0 within 0.05 rad/s of rest.
    #[test]
    fn val_rolling_resistance_opposes_the_spin() {
        let grip = grip(100.0);
        for (spin, couple) in [(3.0, -1.0), (0.05, -1.0), (0.025, -0.5), (0.0, 0.0), (-0.0125, 0.25), (-7.0, 1.0)] {
            assert!((grip.rolling_n_m(spin) - couple).abs() < 1e-12, "{spin}");
        }
    }

    #[test]
    fn val_a_servo_is_proportional_within_its_limit() {
        let servo = Servo { target: 5.0, gain: 3.0, limit: 6.0 };
        assert_eq!([4.0, 5.0, 6.5, 0.0, 99.0].map(|spin| servo.torque(spin)), [3.0, 0.0, -4.5, 6.0, -6.0]);
        assert_eq!(Servo::OFF.torque(7.0), 0.0);
    }

    /// The spin at the end of a step satisfies the channel's momentum balance of the header to 1e-8 N m: gripping and sliding wheels,
    /// motors within and at their limits, a rotating mount, wheels in the air.
    #[test]
    fn val_the_spin_balances_the_momentum() {
        let servos = [
            Servo { target: 6.0, gain: 5.0, limit: 1e3 },
            Servo { target: 6.0, gain: 5.0, limit: 2.0 },
            Servo { target: -40.0, gain: 5.0, limit: 30.0 },
            Servo::BRAKE,
            Servo::OFF,
        ];
        let loads: [&[f64]; 4] = [&[], &[1e4], &[10.0, 3.0], &[100.0, 2.0, 1e4]];
        for servo in servos {
            for load in loads {
                for (start, mount_spin) in [(1.0, 0.0), (0.0, 0.3), (-3.0, -0.2)] {
                    let grips: Vec<Grip> = load
                        .iter()
                        .map(|&normal_n| Grip::new(&TREAD, GROUND, normal_n, DEFLECTION, VELOCITY, start))
                        .collect();
                    let channel = Channel { tread: &TREAD, servo, inertia_over_step: 4.0, mount_spin };
                    let spin = channel.solve(start, &grips);
                    let of_ground = |grip: &Grip| 0.2 * grip.settle(&TREAD, spin).0[0] - grip.rolling_n_m(spin);
                    let taken: f64 = grips.iter().map(of_ground).sum();
                    let motor = (servo.gain * (servo.target - (spin - mount_spin))).clamp(-servo.limit, servo.limit);
                    let error = 4.0 * (spin - start) - motor + taken;
                    // The brake's gain multiplies the tolerance of the spin.
                    let tolerance = 1e-8 + 1e-10 * servo.gain;
                    assert!(error.abs() < tolerance, "{servo:?} {load:?} {start} {mount_spin}: {error}");
                }
            }
        }
    }
}
