//! Standard errors of shift, raise and tilt.
//!
//! # Method
//! Residuals of neighbouring cells are correlated: by the instrument, by matching windows, by snow. The sums of the fit are
//! computed over some 25 large blocks, which are nearly independent if the correlation length is a small part of a
//! block's side. The fit is repeated without each block in turn, by one step t from where it ended (a jackknife):
//! covariance `(G - 1) / G / k^2 * sum (t_g - mean t)(t_g - mean t)'` over the G blocks with data, Student's t with G - 1
//! degrees of freedom for intervals. k, 0.83 for normal residuals, is the factor by which weights that decrease with the residual
//! reduce the sensitivity of the fit. The variances of the shift also include the square of the fit's resolution, 0.005 cells: what
//! the last round may leave, and about the effect of interpolating B between its cells.
//!
//! # Sources
//! Delete-one-cluster jackknife: MacKinnon, Nielsen and Webb (2023), Journal of Applied Econometrics 38, 671-694 (CV3J). k:
//! Huber, Robust Statistics (1981), section 7.6. Few large blocks of a plane with t of G - 1 degrees: Bester, Conley and
//! Hansen (2011), Journal of Econometrics 165, 137-151.
//!
//! # When not to use it
//! Errors that extend over the complete DEM (a bent strip, a datum surface) do not show in the differences between blocks.

use super::StandardErrors;
use super::equations::{Equations, UNKNOWNS};
use sastrugi_numeric::sums;

/// Fewest blocks.
const BLOCKS_MIN: usize = 9;

/// Covariance of the unknowns.
pub struct Uncertainty {
    /// Index of the first unknown: 0, or 2 without a shift.
    first: usize,
    /// Row-major, for all unknowns; NaN for those not fitted. Offsets and raise in m, tilts in m/m.
    covariance: [[f64; UNKNOWNS]; UNKNOWNS],
    blocks: usize,
}

impl Uncertainty {
    /// From the equations of each block, for the unknowns from `first` on; `units` converts their steps to m and m/m, and
    /// shifts are no more accurate than `resolution_m`. `None` with too few blocks, or if the unknowns are not identifiable without one
    /// of them.
    pub fn of_blocks(blocks: &[Equations], first: usize, units: [f64; UNKNOWNS], resolution_m: f64) -> Option<Self> {
        if blocks.len() < BLOCKS_MIN {
            return None;
        }
        let all = Equations::sum(blocks);
        let without: Option<Vec<Vec<f64>>> = blocks.iter().map(|block| all.without(block).straight(first)).collect();
        let without = without?;
        let deviations: Vec<Vec<f64>> = (first..UNKNOWNS)
            .map(|k| {
                let of_unknown: Vec<f64> = without.iter().map(|step| step[k - first] * units[k]).collect();
                let mean = sums::mean(&of_unknown);
                of_unknown.iter().map(|v| v - mean).collect()
            })
            .collect();
        let slackening = all.slackening();
        if slackening.is_nan() || slackening <= 0.0 {
            return None;
        }
        let factor = (blocks.len() - 1) as f64 / blocks.len() as f64 / (slackening * slackening);
        let mut covariance = [[f64::NAN; UNKNOWNS]; UNKNOWNS];
        for (i, u) in deviations.iter().enumerate() {
            for (j, v) in deviations.iter().enumerate() {
                let products: Vec<f64> = u.iter().zip(v).map(|(u, v)| u * v).collect();
                covariance[first + i][first + j] = factor * sums::sum(&products);
            }
        }
        (0..2).for_each(|k| covariance[k][k] += resolution_m * resolution_m);
        Some(Self { first, covariance, blocks: blocks.len() })
    }

    /// p-value of a shift, m, under the null hypothesis that none is needed: Hotelling's T2 of two means with `blocks - 1`
    /// degrees of freedom, whose distribution (F with 2 and `blocks - 2`) has a closed form. `None` without a shift, or
    /// if its covariance is singular because the blocks hardly differ.
    pub fn probability_beyond(&self, [east, north]: [f64; 2]) -> Option<f64> {
        let [[ee, en, ..], [_, nn, ..], ..] = self.covariance;
        let t2 = (nn * east * east - 2.0 * en * east * north + ee * north * north) / (ee * nn - en * en);
        let freedom = (self.blocks - 1) as f64;
        let p = libm::pow(1.0 + t2 / freedom, -0.5 * (freedom - 1.0));
        (t2 >= 0.0 && p.is_finite()).then_some(p)
    }

    /// The standard errors as recorded in the metadata.
    pub fn standard_errors(self) -> StandardErrors {
        let [east, north, raise, tilt_east, tilt_north] = [0, 1, 2, 3, 4].map(|k| self.covariance[k][k].sqrt());
        StandardErrors {
            shift_m: (self.first == 0).then_some([east, north]),
            raise_m: raise,
            tilt: [tilt_east, tilt_north],
            blocks: self.blocks as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_shift(east2: f64, north2: f64, both: f64) -> Uncertainty {
        let mut covariance = [[f64::NAN; UNKNOWNS]; UNKNOWNS];
        (covariance[0][0], covariance[1][1]) = (east2, north2);
        (covariance[0][1], covariance[1][0]) = (both, both);
        Uncertainty { first: 0, covariance, blocks: 25 }
    }

    /// By hand: T2 = 3 with 25 blocks gives (1 + 3 / 24)^(-23 / 2). The same shift in correlated coordinates has the same T2: of (1, 1) with
    /// variances 1 and correlation 1/2 it is 4/3.
    #[test]
    fn val_probability_of_a_shift() {
        let p = |t2: f64| libm::pow(1.0 + t2 / 24.0, -11.5);
        let found = of_shift(0.01, 0.02, 0.0).probability_beyond([0.1, 0.2]).unwrap();
        assert!((found / p(3.0) - 1.0).abs() < 1e-12, "{found}");
        let correlated = of_shift(1.0, 1.0, 0.5);
        assert!((correlated.probability_beyond([1.0, 1.0]).unwrap() / p(4.0 / 3.0) - 1.0).abs() < 1e-12);
        assert!((correlated.probability_beyond([1.0, -1.0]).unwrap() / p(4.0) - 1.0).abs() < 1e-12);
        assert_eq!(correlated.probability_beyond([0.0, 0.0]), Some(1.0));
        // Without a shift, or along the direction in which a singular covariance does not scatter, there is no p-value.
        assert_eq!(of_shift(f64::NAN, f64::NAN, f64::NAN).probability_beyond([1.0, 1.0]), None);
        assert_eq!(of_shift(1.0, 1.0, 1.0).probability_beyond([1.0, 1.0]), None);
    }
}
