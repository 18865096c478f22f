//! Transforms a normal field to a given height distribution.
//!
//! `y = Q(Phi(z / s))`, z normal with standard deviation s, Phi the normal distribution function, Q the quantile function,
//! linear between heights at equally spaced probabilities. The heights then follow Q, but their covariance changes:
//! in normalised Hermite polynomials `h_k`, with `c_k = E[Q(Phi(X)) h_k(X)]`, it is
//!
//! `C_y(rho) = sum over k >= 1 of c_k^2 rho^k`, rho the correlation of z
//!
//! (Mehler 1866). `C_y(1)` is the variance of Q, and `c_1^2 <= C_y(1)`: the correlation of distant cells decreases for any Q.
//!
//! Cost: one distribution function per cell; once, 200 coefficients from 8000 points.

use sastrugi_numeric::sums;
use sastrugi_schemas::ParameterError;
use sastrugi_statistics::normal;

/// Number of coefficients without that of the mean; the variance they miss matters only for correlations near 1.
const TERMS: usize = 200;
/// Points of the quadrature over +-`BOUND` standard deviations.
const POINTS: usize = 8000;
const BOUND: f64 = 8.0;

/// Number of quantiles stored for a measured surface.
const QUANTILES: usize = 101;

/// Heights at 101 equally spaced probabilities from 0 to 1, m, without NaN; empty if there are no heights.
pub fn quantiles_m(heights_m: &[f64]) -> Vec<f64> {
    let mut heights = sums::finite(heights_m);
    heights.sort_by(f64::total_cmp);
    let at = |k: usize| sums::quantile_sorted(&heights, k as f64 / (QUANTILES - 1) as f64);
    if heights.is_empty() { Vec::new() } else { (0..QUANTILES).map(at).collect() }
}

/// A height distribution.
pub struct Marginal {
    quantiles_m: Vec<f64>,
    mean_m: f64,
    /// `c_k^2` for k from 1.
    squares: Vec<f64>,
    /// Variance, m2.
    pub variance_m2: f64,
}

impl Marginal {
    /// The distribution with these heights at equally spaced probabilities from 0 to 1.
    ///
    /// # Errors
    /// Fewer than two heights; heights that are not finite, not ascending, or all equal.
    pub fn new(quantiles_m: &[f64]) -> Result<Self, ParameterError> {
        let refuse = |message: &str| Err(ParameterError::new("marginal_m", message));
        if quantiles_m.len() < 2 || quantiles_m.iter().any(|q| !q.is_finite()) {
            return refuse("must have at least two heights, all of them finite");
        }
        if quantiles_m.windows(2).any(|pair| pair[0] > pair[1]) {
            return refuse("must be in ascending order");
        }
        if quantiles_m[0] == quantiles_m[quantiles_m.len() - 1] {
            return refuse("has only one distinct height; the texture would be flat");
        }
        let (mean_m, squares, variance_m2) = coefficients(quantiles_m);
        Ok(Self { quantiles_m: quantiles_m.to_vec(), mean_m, squares, variance_m2 })
    }

    /// The distribution of the same shape with mean 0 and the given variance.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_shape(quantiles_m: &[f64], variance_m2: f64) -> Result<Self, ParameterError> {
        let own = Self::new(quantiles_m)?;
        let scale = (variance_m2 / own.variance_m2).sqrt();
        Self::new(&quantiles_m.iter().map(|q| (q - own.mean_m) * scale).collect::<Vec<_>>())
    }

    /// The height that corresponds to `score` standard deviations of the normal field.
    pub fn height_m(&self, score: f64) -> f64 {
        sums::quantile_sorted(&self.quantiles_m, normal::cdf(score))
    }

    /// Covariance of the heights for a correlation `rho` of the normal field, m2.
    pub fn covariance_m2(&self, rho: f64) -> f64 {
        if rho >= 1.0 {
            return self.variance_m2;
        }
        self.squares.iter().rev().fold(0.0, |sum, square| (sum + square) * rho)
    }
}

/// The mean, `c_k^2` and the variance by the midpoint rule.
fn coefficients(quantiles_m: &[f64]) -> (f64, Vec<f64>, f64) {
    let step = 2.0 * BOUND / POINTS as f64;
    let mut sums = vec![0.0; TERMS + 1];
    let mut second = 0.0;
    for k in 0..POINTS {
        let x = -BOUND + (k as f64 + 0.5) * step;
        let weight = normal::pdf(x) * step;
        let height = sums::quantile_sorted(quantiles_m, normal::cdf(x));
        second += weight * height * height;
        let (mut before, mut now) = (0.0, weight * height);
        for (degree, sum) in sums.iter_mut().enumerate() {
            *sum += now;
            let n = degree as f64;
            (before, now) = (now, (x * now - n.sqrt() * before) / (n + 1.0).sqrt());
        }
    }
    (sums[0], sums[1..].iter().map(|c| c * c).collect(), second - sums[0] * sums[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform() -> Marginal {
        Marginal::new(&[-1.0, 1.0]).unwrap()
    }

    /// Uniform heights: the correlation is `6 / pi * asin(rho / 2)` (Pearson 1907), the variance 1/3.
    #[test]
    fn val_uniform_heights() {
        let m = uniform();
        assert!((m.variance_m2 - 1.0 / 3.0).abs() < 1e-7);
        for rho in [-0.5, 0.0, 0.1, 0.5, 0.9, 0.99] {
            let expected = 2.0 / std::f64::consts::PI * libm::asin(0.5 * rho);
            assert!((m.covariance_m2(rho) - expected).abs() < 1e-6, "{rho}: {} {expected}", m.covariance_m2(rho));
        }
        assert!((m.height_m(0.0)).abs() < 1e-15 && (m.height_m(9.0) - 1.0).abs() < 1e-12);
    }

    /// A fine table of the normal distribution itself changes almost nothing.
    #[test]
    fn val_a_normal_table_changes_nothing() {
        let n = 20_001;
        let inner = |k: i32| normal::quantile((f64::from(k) + 0.5) / f64::from(n));
        let m = Marginal::new(&(0..n).map(inner).collect::<Vec<_>>()).unwrap();
        for rho in [0.0, 0.3, 0.8, 1.0] {
            assert!((m.covariance_m2(rho) - rho).abs() < 2e-3, "{rho}: {}", m.covariance_m2(rho));
        }
    }

    #[test]
    fn val_a_measured_shape() {
        let quantiles = quantiles_m(&[3.0, f64::NAN, 1.0, 2.0, 5.0]);
        assert_eq!((quantiles.len(), quantiles[0], quantiles[50], quantiles[100]), (101, 1.0, 2.5, 5.0));
        let m = Marginal::of_shape(&quantiles, 0.01).unwrap();
        assert!((m.variance_m2 - 0.01).abs() < 1e-12 && m.mean_m.abs() < 1e-12);
    }

    #[test]
    fn val_bad_tables_are_refused() {
        for table in [&[][..], &[1.0], &[0.0, f64::NAN], &[1.0, 0.0], &[2.0, 2.0]] {
            assert_eq!(Marginal::new(table).err().map(|e| e.key), Some("marginal_m".to_owned()));
        }
    }
}
