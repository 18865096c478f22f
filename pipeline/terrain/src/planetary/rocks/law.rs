//! Size-frequency distribution of rocks.
//!
//! Rocks wider than D (m) cover the share `F(D) = f e^(-q D)` of the ground, `q = 1.79 + 0.152 / f` per metre, with `f` the coverage
//! by all rocks (Golombek and Rapp, 1997, doi:10.1029/96JE03319; the constant is misprinted as 0.132 in the scan of the paper).
//! As disks of area `pi D^2 / 4` they have the density
//! $$ n(D) = \frac{4 q f e^{-q D}}{\pi D^2} \; \text{m}^{-3}, \qquad
//!    N(>D) = \frac{4 q f}{\pi} \left( \frac{e^{-q D}}{D} - q E_1(q D) \right) \; \text{m}^{-2} $$
//!
//! Rocks placed independently overlap, so together they cover `1 - e^{-F}` instead of F. The default law compensates for this:
//! with the density `n / (1 - F)`, the total area of the rocks wider than D is `-ln(1 - F(D))` per unit of ground, and their union covers
//! exactly F(D).

use std::f64::consts::PI;

/// Constants of `q`: Golombek and Rapp (1997), models of the Viking sites.
const Q_BASE_PER_M: f64 = 1.79;
const Q_COVERAGE_PER_M: f64 = 0.152;
/// Euler's constant.
#[cfg(test)]
const EULER: f64 = 0.577_215_664_901_532_9;

/// Rocks of a given coverage.
///
/// ```
/// use sastrugi_terrain::planetary::Law;
///
/// let law = Law { coverage: 0.176, exact_union: true };
/// assert_eq!(law.cover_above(0.0), 0.176);
/// assert!((law.decay_per_m() - (1.79 + 0.152 / 0.176)).abs() < 1e-12);
/// // Rocks that overlap must be more numerous to cover the same share.
/// assert!(law.density(0.1) > law.published_density(0.1));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Share of the ground covered by all rocks, above 0.
    pub coverage: f64,
    /// Whether to compensate for the overlap of independently placed rocks.
    pub exact_union: bool,
}

impl Law {
    /// `q`, 1/m.
    pub fn decay_per_m(&self) -> f64 {
        Q_BASE_PER_M + Q_COVERAGE_PER_M / self.coverage
    }

    /// `F(D)`: share of the ground covered by rocks wider than `diameter_m`.
    pub fn cover_above(&self, diameter_m: f64) -> f64 {
        self.coverage * libm::exp(-self.decay_per_m() * diameter_m)
    }

    /// `n(D)` as published, for disks that do not overlap, 1/m3.
    pub fn published_density(&self, diameter_m: f64) -> f64 {
        4.0 * self.decay_per_m() * self.cover_above(diameter_m) / (PI * diameter_m * diameter_m)
    }

    /// Density of the placed rocks, 1/m3.
    pub fn density(&self, diameter_m: f64) -> f64 {
        let share = if self.exact_union { 1.0 - self.cover_above(diameter_m) } else { 1.0 };
        self.published_density(diameter_m) / share
    }

    /// `N(>D)` as published, rocks per square metre.
    #[cfg(test)]
    pub fn published_count_above(&self, diameter_m: f64) -> f64 {
        let q = self.decay_per_m();
        let x = q * diameter_m;
        4.0 * q * self.coverage / PI * (libm::exp(-x) / diameter_m - q * exponential_integral(x))
    }
}

/// `E1(x) = int_x^inf e^-t / t dt`, x > 0: power series up to 1, continued fraction above (Abramowitz and Stegun, 5.1.11 and
/// 5.1.22); relative error about 1e-15.
#[cfg(test)]
fn exponential_integral(x: f64) -> f64 {
    if x <= 1.0 { by_series(x) } else { by_continued_fraction(x) }
}

#[cfg(test)]
fn by_series(x: f64) -> f64 {
    let (mut power, mut sum) = (1.0, 0.0);
    for k in 1..=20 {
        let k = f64::from(k);
        power *= -x / k;
        sum -= power / k;
    }
    sum - EULER - libm::log(x)
}

/// `e^-x / (x + 1 - 1 / (x + 3 - 4 / (x + 5 - ...)))`, evaluated backwards.
#[cfg(test)]
fn by_continued_fraction(x: f64) -> f64 {
    let tail = (1..=100).rev().fold(0.0, |tail, k| {
        let k = f64::from(k);
        k * k / (x + 2.0 * k + 1.0 - tail)
    });
    libm::exp(-x) / (x + 1.0 - tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(coverage: f64) -> Law {
        Law { coverage, exact_union: true }
    }

    /// `q` and N(>D) per square metre for the four coverages of the paper.
    #[test]
    fn val_rocks_per_square_metre() {
        let table = [
            (0.069, 3.993, [4.03, 1.368, 0.353, 0.0265, 0.00113]),
            (0.088, 3.517, [4.77, 1.676, 0.460, 0.0406, 0.00224]),
            (0.118, 3.078, [5.88, 2.137, 0.622, 0.0641, 0.00447]),
            (0.176, 2.654, [7.94, 2.985, 0.922, 0.1105, 0.00971]),
        ];
        for (coverage, q, counts) in table {
            assert!((law(coverage).decay_per_m() - q).abs() < 5e-4);
            for (diameter, count) in [0.05, 0.1, 0.2, 0.5, 1.0].into_iter().zip(counts) {
                let ours = law(coverage).published_count_above(diameter);
                assert!((ours / count - 1.0).abs() < 5e-3, "{coverage} {diameter}: {ours}");
            }
        }
        assert!((law(0.176).decay_per_m() - 2.6536).abs() < 5e-5);
    }

    /// The closed form against Simpson's rule in log D, and E1 against tables (Abramowitz and Stegun, 5.1).
    #[test]
    fn val_closed_forms() {
        for (x, value) in
            [(0.5, 0.559_773_594_776), (1.0, 0.219_383_934_396), (2.0, 0.048_900_510_708), (10.0, 4.156_968_930e-6)]
        {
            assert!((exponential_integral(x) / value - 1.0).abs() < 1e-9, "{x}");
        }
        let above_one = 1.0 + 1e-12;
        assert!((exponential_integral(1.0) / exponential_integral(above_one) - 1.0).abs() < 1e-11);
        for coverage in [0.02, 0.069, 0.176, 0.6] {
            for low in [0.03, 0.2, 1.0] {
                let n = 20_000;
                let step = libm::log(60.0 / low) / f64::from(n);
                let at = |k: i32| {
                    let d = low * libm::exp(step * f64::from(k));
                    law(coverage).published_density(d) * d
                };
                let weight = |k: i32| if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
                let sum: f64 = (0..=n).map(|k| weight(k) * at(k)).sum::<f64>() * step / 3.0;
                let closed = law(coverage).published_count_above(low);
                assert!((sum / closed - 1.0).abs() < 1e-8, "{coverage} {low}: {sum} {closed}");
            }
        }
    }
}
