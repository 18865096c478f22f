//! Trace moments: the scaling of a multiplicative cascade, from a positive field averaged over boxes of increasing size.
//!
//! For a conserved cascade the moments of the field averaged over boxes of side l,
//! $$ \langle \varepsilon_l^q \rangle / \langle \varepsilon \rangle^q \propto l^{-K(q)} , $$
//! define the moment scaling function K(q); for a log-normal cascade `K(q) = C1 (q^2 - q)`, with C1 the codimension of the mean
//! (Schertzer and Lovejoy, J. Geophys. Res. 92, 1987, 9693). A field without intermittency has K = 0.
//!
//! A single field constrains K poorly: the standard error comes from an ensemble, by leaving out one field at a time.

use crate::multifractality::line_slope;
use sastrugi_numeric::{Grid, sums};
use serde::Serialize;

/// Smallest box, cells: in smaller ones the cutoff of a generated field bends the moments.
const BOX_MIN: usize = 4;
/// Boxes along the shorter side at the largest box size.
const BOXES_MIN: usize = 4;

/// Moments of the field averaged over boxes of one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoxMoments {
    /// Side of the boxes, cells.
    pub box_px: usize,
    /// Mean of the q-th power of the box averages, for each requested order.
    pub moments: Vec<f64>,
}

/// K(q) of an ensemble.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MomentExponent {
    /// Order q.
    pub order: f64,
    /// K(q).
    pub exponent: f64,
    /// Its standard error (delete-one jackknife over the fields).
    pub standard_error: f64,
}

/// Moments over boxes of 4, 8, 16 ... cells, up to a quarter of the shorter side; empty if that side is below 32 cells. Only
/// complete boxes count, laid out side by side from the north-west corner.
///
/// `flux`: finite values of at least 0.
pub fn trace_moments(flux: &Grid, orders: &[f64]) -> Vec<BoxMoments> {
    let side = flux.rows().min(flux.cols());
    let sizes = std::iter::successors(Some(BOX_MIN), |b| Some(2 * b)).take_while(|b| b * BOXES_MIN <= side);
    let sizes: Vec<usize> = sizes.collect();
    if sizes.len() < 2 { Vec::new() } else { sizes.into_iter().map(|b| moments_of(flux, b, orders)).collect() }
}

fn moments_of(flux: &Grid, box_px: usize, orders: &[f64]) -> BoxMoments {
    let (rows, cols) = (flux.rows() / box_px, flux.cols() / box_px);
    let average = |k: usize| {
        let (top, left) = (k / cols * box_px, k % cols * box_px);
        let lines: Vec<f64> =
            (top..top + box_px).map(|r| flux.row(r)[left..left + box_px].iter().sum::<f64>()).collect();
        sums::sum(&lines) / (box_px * box_px) as f64
    };
    let averages: Vec<f64> = (0..rows * cols).map(average).collect();
    let moment = |q: &f64| sums::mean(&averages.iter().map(|a| libm::pow(*a, *q)).collect::<Vec<_>>());
    BoxMoments { box_px, moments: orders.iter().map(moment).collect() }
}

/// K(q) of fields of equal shape, from the [`trace_moments`] of each for the same orders. `None` for fewer than two fields, or for
/// fields that are too small.
pub fn moment_exponents(fields: &[Vec<BoxMoments>], orders: &[f64]) -> Option<Vec<MomentExponent>> {
    if fields.len() < 2 || fields.iter().any(|f| f.len() < 2 || f.len() != fields[0].len()) {
        return None;
    }
    let exponent = |q: usize, left_out: usize| {
        let kept = || fields.iter().enumerate().filter(|(k, _)| *k != left_out).map(|(_, f)| f);
        let point = |size: usize| {
            let moments: Vec<f64> = kept().map(|f| f[size].moments[q]).collect();
            [libm::log(fields[0][size].box_px as f64), libm::log(sums::mean(&moments))]
        };
        -line_slope(&(0..fields[0].len()).map(point).collect::<Vec<_>>())
    };
    let n = fields.len();
    let of_order = |(q, order): (usize, &f64)| {
        let partial: Vec<f64> = (0..n).map(|k| exponent(q, k)).collect();
        let standard_error = ((n - 1) as f64 * sums::variance(&partial)).sqrt();
        MomentExponent { order: *order, exponent: exponent(q, n), standard_error }
    };
    Some(orders.iter().enumerate().map(of_order).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    /// A cascade that splits each square into four, of which the two on the diagonal survive with weight 2: after n halvings a
    /// share `2^-n` of the boxes holds `2^n`, so `<e^q> = 2^(n (q - 1))` and `K(q) = q - 1` exactly.
    #[test]
    fn val_moments_of_a_balanced_cascade_are_exact() {
        let side = 64;
        let keeps = |r: usize, c: usize| (0..6).all(|bit| (r >> bit & 1) == (c >> bit & 1));
        let value = |k: usize| if keeps(k / side, k % side) { 64.0 } else { 0.0 };
        let flux = Grid::new(Geometry::square(side, side, 1.0), (0..side * side).map(value).collect());
        let orders = [1.0, 2.0, 3.0];
        let moments = trace_moments(&flux, &orders);
        assert_eq!(moments.iter().map(|m| m.box_px).collect::<Vec<_>>(), [4, 8, 16]);
        for m in &moments {
            let scale = (side / m.box_px) as f64;
            assert_eq!(m.moments.len(), 3);
            assert!(
                m.moments.iter().zip([1.0, scale, scale * scale]).all(|(a, b)| (a / b - 1.0).abs() < 1e-12),
                "{m:?}"
            );
        }
        let found = moment_exponents(&[moments.clone(), moments], &orders).unwrap();
        assert_eq!(found.len(), 3);
        for (e, k) in found.iter().zip([0.0, 1.0, 2.0]) {
            assert!((e.exponent - k).abs() < 1e-12 && e.standard_error < 1e-12, "{e:?}");
        }
    }

    /// Three fields, one of them with four times the moment at 4 cells: the mean moments are 2 and 1, so K = 1. Without the odd one K is 0,
    /// without either of the others log2 (5 / 2) = a; the jackknife gives `sqrt((n - 1) var) = sqrt(2 * 2 a^2 / 9) = 2 a / 3`.
    #[test]
    fn val_the_jackknife_of_three_fields() {
        let field = |moment: f64| {
            [(4, moment), (8, 1.0)].map(|(box_px, moment)| BoxMoments { box_px, moments: vec![moment] }).to_vec()
        };
        let found = moment_exponents(&[field(1.0), field(4.0), field(1.0)], &[2.0]).unwrap()[0];
        let a = libm::log2(2.5);
        assert!(
            (found.exponent - 1.0).abs() < 1e-12 && (found.standard_error - 2.0 * a / 3.0).abs() < 1e-12,
            "{found:?}"
        );
        assert_eq!(found.order, 2.0);
    }

    /// Independent exponential values do not scale: over boxes of b cells `<a^2> = 1 + 1 / b^2`, whose slope between boxes of 4 and 64
    /// cells is 0.0195. The mean of all values is the same for all box sizes, which leaves only the scatter of `<a^2>` about the
    /// squared mean: 2 / b^2 over the root of the number of boxes, 0.0006 at 4 cells (12 288 boxes) and less for larger boxes.
    /// Threshold: 0.01, over 10 standard errors of the slope.
    #[test]
    fn stat_noise_has_the_moments_of_its_averages() {
        let mut s = Streams::for_seed(1, "trace-moments-test").stream("noise");
        let mut field = || {
            let values = (0..256 * 256).map(|_| -libm::log(1.0 - s.uniform())).collect();
            trace_moments(&Grid::new(Geometry::square(256, 256, 1.0), values), &[2.0])
        };
        let found = moment_exponents(&[field(), field(), field()], &[2.0]).unwrap()[0];
        let exact = [4.0, 8.0, 16.0, 32.0, 64.0].map(|b: f64| [libm::log(b), libm::log(1.0 + 1.0 / (b * b))]);
        assert!((found.exponent + line_slope(&exact)).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn val_too_few_or_too_small() {
        let small = trace_moments(&Grid::filled(Geometry::square(31, 31, 1.0), 1.0), &[2.0]);
        assert!(small.is_empty() && moment_exponents(&[small.clone(), small], &[2.0]).is_none());
        let one = trace_moments(&Grid::filled(Geometry::square(64, 64, 1.0), 1.0), &[2.0]);
        assert!(moment_exponents(&[one], &[2.0]).is_none());
    }
}
