//! Shape of one fresh crater.
//!
//! With `rho` the distance from the centre in radii, `d` the depth from rim to floor (m) and `h` the height of the rim (m):
//! $$ \Delta z = \begin{cases} h - d + d\,\rho^m & \rho \le 1 \\ h\,\rho^{-3}\,w(\rho) & 1 < \rho \le 5 \end{cases} $$
//! where `w` is 1 up to 3 radii and falls smoothly to 0 at 5 (the feathered fringe).
//!
//! * Depth: `d = c / (1 + (c / 6000 m)^4)^(1/4)` with `c` a share of the diameter (20 %): never more than 6 km. The paper
//!   gives both limits; the transition between them is our choice.
//! * Floor: `m = 2 c / d`, a paraboloid for small craters, flatter for large ones.
//! * Rim: the excavated volume lies in the ejecta, `h = d m / ((m + 2)(1 + 2 K))`, `K = int_1^5 w rho^-2 d rho`. For simple craters
//!   h = 0.0401 diameters; fresh lunar craters have about 0.036 (Pike, 1977).

/// `K = int_1^5 w rho^-2 d rho`: `2/3` up to the fringe, `-17/3 + 45/4 ln(5/3)` within it.
const EJECTA_INTEGRAL: f64 = 0.746_788_267_367_395_2;
/// Reach of the ejecta, radii.
pub const EJECTA_RADII: f64 = 5.0;
/// Inner edge of the ejecta's fringe, radii.
const FRINGE_RADII: f64 = 3.0;
/// Craters shallower than this are simple, m: the formula for larger ones differs from a paraboloid by less than 1e-9.
const SIMPLE_MAX_M: f64 = 30.0;
/// Maximum depth of a crater, m.
pub const DEPTH_MAX_M: f64 = 6000.0;

/// Height of a crater above the surface that it struck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Depth from rim to floor, m.
    pub depth_m: f64,
    /// Height of the rim above the surface, m.
    pub rim_m: f64,
    /// `m`.
    exponent: f64,
}

impl Profile {
    /// A crater of a diameter (m) with a depth of `depth_ratio` diameters as long as it is small, measured from rim to floor or, if
    /// `below_datum`, from the surface to the floor.
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

/// 1 up to the inner edge of the fringe, 0 beyond its outer edge.
pub fn fringe(rho: f64) -> f64 {
    fall(rho, FRINGE_RADII, EJECTA_RADII)
}

/// 1 up to `from`, 0 beyond `to`, a cubic with continuous slope between.
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

    /// The ejecta have the excavated volume, whatever the size and the datum.
    #[test]
    fn val_ejecta_have_the_volume_of_the_bowl() {
        for (diameter, ratio, below) in [(10.0, 0.2, false), (10.0, 0.1, true), (4e4, 0.2, false), (4e5, 0.2, true)] {
            let (net, gross) = volumes(&Profile::new(diameter, ratio, below));
            assert!(net.abs() < 1e-6 * gross, "{diameter} {net} {gross}");
        }
    }

    #[test]
    fn val_depths_and_rims() {
        let small = Profile::new(10.0, 0.2, false);
        assert!((small.depth_m - 2.0).abs() < 1e-9);
        // Fresh lunar craters have about 0.036 D (Pike, 1977).
        assert!((small.rim_m / 10.0 - 0.0401).abs() < 5e-5, "{}", small.rim_m);
        assert!((Profile::new(10.0, 0.2, true).height_m(0.0) + 2.0).abs() < 1e-9);
        for diameter in [1e4, 3e4, 1e5, 4e5] {
            let profile = Profile::new(diameter, 0.2, false);
            assert!(profile.depth_m < DEPTH_MAX_M && profile.depth_m < 0.2 * diameter);
            assert!((profile.height_m(1.0) - profile.rim_m).abs() < 1e-9 * profile.rim_m);
        }
        assert_eq!(small.height_m(EJECTA_RADII), 0.0);
        // A paraboloid inside, the inverse cube outside, and half of it in the middle of the fringe.
        for (rho, wanted_m) in [(0.0, 0.0), (0.5, 0.5), (1.0, 2.0)] {
            assert!((small.height_m(rho) - (small.rim_m - 2.0 + wanted_m)).abs() < 1e-12, "{rho}");
        }
        for (rho, share) in [(2.0, 1.0 / 8.0), (3.0, 1.0 / 27.0), (4.0, 0.5 / 64.0)] {
            assert!((small.height_m(rho) / small.rim_m - share).abs() < 1e-12, "{rho}");
        }
        // At 30 km, c is 6 km: d = 6 km / 2^(1/4), m = 2^(5/4), and h follows from the volume.
        let wide = Profile::new(3e4, 0.2, false);
        assert!((wide.depth_m / 5_045.378_491_522_288 - 1.0).abs() < 1e-12, "{}", wide.depth_m);
        assert!((wide.rim_m / 1_099.111_360_988_896 - 1.0).abs() < 1e-12, "{}", wide.rim_m);
        let bowl_m = wide.depth_m * libm::pow(0.5, 2.378_414_230_005_442);
        assert!((wide.height_m(0.5) - (wide.rim_m - wide.depth_m + bowl_m)).abs() < 1e-9);
        assert!((EJECTA_INTEGRAL - (11.25 * libm::log(5.0 / 3.0) - 5.0)).abs() < 1e-14);
    }
}
