//! Shape of one fresh crater.
//!
//! With `rho` the distance from the centre in radii, `d` the depth from rim to floor and `h` the height of the rim (m):
//! $$ \Delta z = \begin{cases} h - d + d\,\rho^m & \rho \le 1 \\ h\,\rho^{-3}\,w(\rho) & 1 < \rho \le 5 \end{cases} $$
//! where `w` is 1 up to 3 radii and falls smoothly to 0 at 5 (the feathered fringe).
//!
//! * Depth: a share of the diameter (20 %), `d = c / (1 + (c / 6000 m)^4)^(1/4)` with `c` that share: never above 6 km. The paper
//!   gives both bounds; how one passes to the other is our choice.
//! * Floor: `m = 2 c / d`, a paraboloid for small craters, flatter for large ones.
//! * Rim: what is dug out lies in the ejecta, `h = d m / ((m + 2)(1 + 2 K))`, `K = int_1^5 w rho^-2 d rho`. For simple craters
//!   h = 0.0401 diameters; fresh lunar craters have about 0.036 (Pike, 1977).

/// `K = int_1^5 w rho^-2 d rho`: `2/3` up to the fringe, `-17/3 + 45/4 ln(5/3)` in it.
const EJECTA_INTEGRAL: f64 = 0.746_788_267_367_395_2;
/// Reach of the ejecta, radii.
pub const EJECTA_RADII: f64 = 5.0;
/// Where the fringe of the ejecta begins, radii.
const FRINGE_RADII: f64 = 3.0;
/// Craters less deep than this are simple: the formula for larger ones differs from a paraboloid by less than 1e-9, m.
const SIMPLE_MAX_M: f64 = 30.0;
/// No crater is deeper, m.
pub const DEPTH_MAX_M: f64 = 6000.0;

/// Height of a crater above the surface that it struck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Rim to floor, m.
    pub depth_m: f64,
    /// Rim above the surface, m.
    pub rim_m: f64,
    /// `m`.
    exponent: f64,
}

impl Profile {
    /// A crater of a diameter (m) with a depth of `depth_ratio` diameters while it is small, from rim to floor or, `below_datum`,
    /// from the surface to the floor.
    pub fn new(diameter_m: f64, depth_ratio: f64, below_datum: bool) -> Self {
        let simple_m = depth_ratio * diameter_m;
        let over = simple_m / DEPTH_MAX_M;
        let capped_m = if simple_m < SIMPLE_MAX_M {
            simple_m
        } else {
            simple_m / libm::pow(1.0 + over * over * over * over, 0.25)
        };
        let exponent = 2.0 * simple_m / capped_m;
        let rim_share = exponent / ((exponent + 2.0) * (1.0 + 2.0 * EJECTA_INTEGRAL));
        let depth_m = if below_datum { capped_m / (1.0 - rim_share) } else { capped_m };
        Self { depth_m, rim_m: depth_m * rim_share, exponent }
    }

    /// Height at `rho` radii, m.
    pub fn height_m(&self, rho: f64) -> f64 {
        if rho <= 1.0 {
            let bowl = if self.exponent == 2.0 { rho * rho } else { libm::pow(rho, self.exponent) };
            self.rim_m - self.depth_m + self.depth_m * bowl
        } else {
            self.rim_m * fringe(rho) / (rho * rho * rho)
        }
    }
}

/// 1 up to where the fringe begins, 0 from where it ends.
pub fn fringe(rho: f64) -> f64 {
    fall(rho, FRINGE_RADII, EJECTA_RADII)
}

/// 1 up to `from`, 0 from `to` on, a cubic without steps or bends between.
pub fn fall(at: f64, from: f64, to: f64) -> f64 {
    let t = ((at - from) / (to - from)).clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoint rule over the disk.
    fn volumes(profile: &Profile) -> (f64, f64) {
        let n = 200_000;
        let step = EJECTA_RADII / f64::from(n);
        (0..n).fold((0.0, 0.0), |(net, gross), k| {
            let rho = (f64::from(k) + 0.5) * step;
            let ring = profile.height_m(rho) * rho * step;
            (net + ring, gross + ring.abs())
        })
    }

    /// What is dug out is thrown out, whatever the size and the datum.
    #[test]
    fn val_ejecta_hold_what_the_bowl_lost() {
        for (diameter, ratio, below) in [(10.0, 0.2, false), (10.0, 0.1, true), (4e4, 0.2, false), (4e5, 0.2, true)] {
            let (net, gross) = volumes(&Profile::new(diameter, ratio, below));
            assert!(net.abs() < 1e-6 * gross, "{diameter} {net} {gross}");
        }
    }

    #[test]
    fn val_depths_and_rims() {
        let small = Profile::new(10.0, 0.2, false);
        assert!((small.depth_m - 2.0).abs() < 1e-9);
        // Beside about 0.036 D of fresh lunar craters (Pike, 1977).
        assert!((small.rim_m / 10.0 - 0.0401).abs() < 5e-5, "{}", small.rim_m);
        assert!((Profile::new(10.0, 0.2, true).height_m(0.0) + 2.0).abs() < 1e-9);
        for diameter in [1e4, 3e4, 1e5, 4e5] {
            let profile = Profile::new(diameter, 0.2, false);
            assert!(profile.depth_m < DEPTH_MAX_M && profile.depth_m < 0.2 * diameter);
            assert!((profile.height_m(1.0) - profile.rim_m).abs() < 1e-9 * profile.rim_m);
        }
        assert_eq!(small.height_m(EJECTA_RADII), 0.0);
        assert!((EJECTA_INTEGRAL - (11.25 * libm::log(5.0 / 3.0) - 5.0)).abs() < 1e-14);
    }
}
