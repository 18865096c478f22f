//! Standard errors of shift, raise and tilt.
//!
//! # What
//! Residuals of neighbouring cells are correlated: by the instrument, by matching windows, by snow. The sums of the fit are
//! taken over some 25 large blocks, which are nearly independent where the correlation reaches no further than a small part of a
//! block's side, and the fit is repeated without each of them, by one step t from where it ended (a jackknife):
//! covariance `(G - 1) / G / k^2 * sum (t_g - mean t)(t_g - mean t)'` over the G blocks with data, Student's t with G - 1
//! degrees of freedom for intervals. k, 0.83 for normal residuals, is by how much weights that fall with the residual slacken the
//! fit. The variances of the shift hold the square of the fit's resolution as well, 0.005 cells: what the last round may leave,
//! and about what reading B between its cells makes.
//!
//! # Sources
//! Delete-one-cluster jackknife: MacKinnon, Nielsen and Webb (2023), Journal of Applied Econometrics 38, 671-694 (CV3J). k:
//! Huber, Robust Statistics (1981), section 7.6. Few large blocks of a plane with t of G - 1 degrees: Bester, Conley and
//! Hansen (2011), Journal of Econometrics 165, 137-151.
//!
//! # When not to use it
//! Errors that reach across the whole DEM (a bent strip, a datum surface) are in no block's difference from the others.

use super::StandardErrors;
use super::equations::{Equations, UNKNOWNS};
use sastrugi_numeric::sums;

/// Fewest blocks.
const BLOCKS_MIN: usize = 9;

/// Covariance of the unknowns.
pub struct Uncertainty {
    /// First of the unknowns: 0, or 2 without a shift.
    first: usize,
    /// Row-major, of all unknowns; NaN for those that are none. Offsets and raise in m, tilts in m/m.
    covariance: [[f64; UNKNOWNS]; UNKNOWNS],
    blocks: usize,
}

impl Uncertainty {
    /// From the equations of each block, of the unknowns from `first` on; `units` brings their steps to m and m/m, and
    /// shifts are no better than `resolution_m`. `None` for too few blocks, or when the others leave the unknowns open without one of them.
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

    /// Probability of a shift this far out, m, or further, where none is needed: Hotelling's T2 of two means with `blocks - 1`
    /// degrees of freedom, whose distribution (F with 2 and `blocks - 2`) has a closed form. `None` without a shift, or
    /// when residuals are so equal that it has no spread.
    pub fn probability_beyond(&self, [east, north]: [f64; 2]) -> Option<f64> {
        let [[ee, en, ..], [_, nn, ..], ..] = self.covariance;
        let t2 = (nn * east * east - 2.0 * en * east * north + ee * north * north) / (ee * nn - en * en);
        let freedom = (self.blocks - 1) as f64;
        let p = libm::pow(1.0 + t2 / freedom, -0.5 * (freedom - 1.0));
        (t2 >= 0.0 && p.is_finite()).then_some(p)
    }

    /// As they are recorded.
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
