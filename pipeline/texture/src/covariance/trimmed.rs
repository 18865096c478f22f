//! Covariance of a normal pair after trimming to +-t.
//!
//! For a unit bivariate normal with correlation rho, `T(rho) = N(rho) / P(rho)`,
//! `N = E[X Y; |X| < t, |Y| < t]`, `P = Pr(|X| < t, |Y| < t)`: the expected mean product of the pairs that survive trimming.
//! Trimming changes the shape of a covariance and not only its scale: at t = 1.96, T(1) = 0.759, but T'(0) = 0.576.
//!
//! * `|rho| <= 0.95`: Mehler's series (1866), `N = sum of a_n^2 rho^n` over odd n and `P = sum of p_n^2 rho^n` over even
//!   n, where `a_n` and `p_n` are the coefficients of `x 1(|x| < t)` and `1(|x| < t)` in normalised Hermite polynomials
//!   `h_n`: `p_0 = Pr(|X| < t)`, `p_n = -2 phi(t) h_(n-1)(t) / sqrt(n)`, `a_1 = p_0 - 2 t phi(t)`,
//!   `a_n = -2 phi(t) [h_n(t) + sqrt(n / (n-1)) h_(n-2)(t)]`.
//! * Above: the derivatives of N and P with respect to rho (Price, 1958) integrated from rho = 1 down along
//!   `rho = cos theta`, where every integrand is smooth:
//!   `P(1) - P(rho) = integral of 2 (E+ - E-)`,
//!   `N(1) - N(rho) = integral of P sin theta - 4 t phi(t) Pr(|X| < t | Y = t) sin theta + 2 t^2 (E+ + E-)`,
//!   `E+- = exp(-t^2 / (1 +- cos theta)) / (2 pi)`.
//!
//! Error below 1e-10 for 0.6 <= t <= 6 (tests; trimming half of the values is t = 0.67). Cost: some 700 operations to prepare, about 5 / (1 - |rho|) per value.

use sastrugi_statistics::normal;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Correlation above which the integral replaces the series.
const SERIES_MAX: f64 = 0.95;
/// Terms of the series: 0.95^630 is 1e-14.
const TERMS: usize = 630;
/// Threshold beyond which nothing is trimmed: in double precision no value of a unit normal lies beyond 30, while the Hermite polynomials
/// of the series overflow from some 50 on.
const NOTHING_TRIMMED: f64 = 30.0;
/// Correlations whose series are summed side by side.
const LANES: usize = 8;
/// Terms after which their end is checked; divides [`TERMS`], and is even.
const TERMS_AT_ONCE: usize = 10;
/// Power of the correlation below which a series ends.
const POWER_MIN: f64 = 1e-14;
/// Exponent beyond which `exp(-x)` is below a quarter of the last bit of 1, and threshold beyond which so is the tail of a unit normal.
const NEGLIGIBLE: [f64; 2] = [40.0, 9.5];
/// Nodes of the integral over at most acos(0.95) = 0.32 rad.
const NODES: usize = 20;

/// Trimming of a unit normal at +-t.
#[derive(Clone, Debug)]
pub struct TrimmedNormal {
    t: f64,
    density: f64,
    mass: f64,
    second_moment: f64,
    /// Squared coefficient of degree n: of the indicator for even n, of the trimmed variable for odd n.
    squares: Vec<f64>,
}

/// Nodes and weights of the integral.
static QUADRATURE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(NODES));
/// For each degree n below [`TERMS`], `sqrt(n)` and `sqrt(n / (n - 1))`.
static ROOTS: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| (0..TERMS).map(roots).collect());

impl TrimmedNormal {
    /// Trimming at `t` standard deviations, `t > 0`, be it infinite.
    pub fn new(t: f64) -> Self {
        // `f64::min` would hide a NaN.
        let t = if t > NOTHING_TRIMMED { NOTHING_TRIMMED } else { t };
        let (density, mass) = (normal::pdf(t), normal::central(t));
        let second_moment = mass - 2.0 * t * density;
        Self { t, density, mass, second_moment, squares: squares(t, density, mass) }
    }

    /// T: mean product of the surviving pairs; `rho` in [-1, 1] (values beyond are clamped).
    pub fn covariance(&self, rho: f64) -> f64 {
        let (product, pairs) = self.moments(rho);
        product / pairs
    }

    /// N and P.
    pub fn moments(&self, rho: f64) -> (f64, f64) {
        let size = rho.abs().min(1.0);
        let (product, pairs) = if size <= SERIES_MAX { self.series(size) } else { self.integral(size) };
        (product.copysign(rho), pairs)
    }

    /// N and P of each of many correlations. Side by side, because every power of a correlation has to wait for the one before.
    pub fn moments_of_each(&self, rhos: &[f64]) -> Vec<(f64, f64)> {
        let mut all = Vec::with_capacity(rhos.len());
        for some in rhos.chunks(LANES) {
            let mut small = [0.0; LANES];
            for (lane, rho) in small.iter_mut().zip(some) {
                let size = rho.abs().min(1.0);
                // The others have no series.
                *lane = if size <= SERIES_MAX { size } else { 0.0 };
            }
            let [pairs, products] = self.series_of_each(small);
            for ((rho, product), pairs) in some.iter().zip(products).zip(pairs) {
                let size = rho.abs().min(1.0);
                let found = if size <= SERIES_MAX { (product, pairs) } else { self.integral(size) };
                all.push((found.0.copysign(*rho), found.1));
            }
        }
        all
    }

    /// P and N of correlations of up to [`SERIES_MAX`], each with the bits of [`Self::series`].
    fn series_of_each(&self, rhos: [f64; LANES]) -> [[f64; LANES]; 2] {
        let mut sums = [[0.0; LANES]; 2];
        let mut powers = [1.0; LANES];
        for squares in self.squares.as_chunks::<TERMS_AT_ONCE>().0 {
            for (n, square) in squares.iter().enumerate() {
                for lane in 0..LANES {
                    sums[n % 2][lane] += square * powers[lane];
                    let power = powers[lane] * rhos[lane];
                    // A series that has ended adds zeros to its sums, which are positive.
                    powers[lane] = if power < POWER_MIN { 0.0 } else { power };
                }
            }
            if powers == [0.0; LANES] {
                break;
            }
        }
        sums
    }

    /// `a_1^2`: slope of N at rho = 0.
    pub fn linear_share(&self) -> f64 {
        self.second_moment * self.second_moment
    }

    pub(super) fn series(&self, rho: f64) -> (f64, f64) {
        let mut sums = [0.0; 2];
        let mut power = 1.0;
        for (n, square) in self.squares.iter().enumerate() {
            sums[n % 2] += square * power;
            power *= rho;
            if power < POWER_MIN {
                break;
            }
        }
        (sums[1], sums[0])
    }

    pub(super) fn integral(&self, rho: f64) -> (f64, f64) {
        self.integral_without(NEGLIGIBLE, rho)
    }

    /// The integral without exponentials and tails that are too small to change the last bit of what they are added to.
    fn integral_without(&self, [exponent, threshold]: [f64; 2], rho: f64) -> (f64, f64) {
        let end = libm::acos(rho);
        if end == 0.0 {
            return (self.second_moment, self.mass);
        }
        let (t, t2) = (self.t, self.t * self.t);
        let (mut pairs_lost, mut product_lost) = (0.0, 0.0);
        for &(node, weight) in QUADRATURE.iter() {
            let (theta, step) = (0.5 * end * (1.0 + node), 0.5 * end * weight);
            let (sin, cos) = libm::sincos(theta);
            let tan_half = sin / (1.0 + cos);
            let (near, far) = (t2 / (1.0 + cos), t2 / (1.0 - cos));
            let same = libm::exp(-near) / (2.0 * PI);
            let opposite = if far - near > exponent { 0.0 } else { libm::exp(-far) / (2.0 * PI) };
            // Pr(|X| < t | Y = t): (1 -+ rho) / sqrt(1 - rho^2) are half-angle functions.
            let other_end = t / tan_half;
            let below = if other_end > threshold { 0.0 } else { normal::cdf(-other_end) };
            let inside = normal::cdf(t * tan_half) - below;
            pairs_lost += step * 2.0 * (same - opposite);
            product_lost += step
                * (2.0 * t2 * (same + opposite)
                    - 4.0 * t * self.density * inside * sin
                    - 2.0 * cos * (same - opposite));
        }
        let pairs = self.mass - pairs_lost;
        // The integral of P over rho by parts: P(1) - rho P(rho) minus that of rho P'(rho), which is in product_lost.
        let product = self.second_moment - (self.mass - rho * pairs) - product_lost;
        (product, pairs)
    }
}

/// Squared Hermite coefficients by degree.
fn squares(t: f64, density: f64, mass: f64) -> Vec<f64> {
    let mut squares = vec![mass * mass, (mass - 2.0 * t * density) * (mass - 2.0 * t * density)];
    // Normalised Hermite polynomials of degrees n - 2 and n - 1 at t.
    let (mut before, mut last) = (1.0, t);
    let of_degree: &[[f64; 2]] = &ROOTS;
    for n in 2..TERMS {
        let ([smaller, _], [root, ratio]) = (of_degree[n - 1], of_degree[n]);
        let next = (t * last - smaller * before) / root;
        let coefficient = if n % 2 == 0 { last / root } else { next + ratio * before };
        let scaled = 2.0 * density * coefficient;
        squares.push(scaled * scaled);
        (before, last) = (last, next);
    }
    squares
}

/// `sqrt(n)` and `sqrt(n / (n - 1))`.
fn roots(n: usize) -> [f64; 2] {
    let degree = n as f64;
    [degree.sqrt(), (degree / (degree - 1.0)).sqrt()]
}

/// Nodes and weights of Gauss-Legendre quadrature on [-1, 1], by Newton's method on the recurrence.
fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    (0..count)
        .map(|k| {
            let mut x = libm::cos(PI * (k as f64 + 0.75) / (n + 0.5));
            let mut slope = 1.0;
            for _ in 0..8 {
                let (value, derivative) = legendre(count, x);
                slope = derivative;
                x -= value / derivative;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Legendre polynomial of degree `n` and its derivative at `x`.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut last) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (before, last) = (last, ((2.0 * k - 1.0) * x * last - (k - 1.0) * before) / k);
    }
    (last, n as f64 * (x * last - before) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral has the bits that it has with every exponential and every tail.
    #[test]
    fn prop_what_is_negligible_changes_no_bit() {
        for t in [1e-9, 0.01, 0.3, 0.67, 0.9, 1.3, 1.96, 2.3, 3.0, 4.5, 6.0, 12.0, 30.0] {
            let trimmed = TrimmedNormal::new(t);
            let near_one = (0..60).map(|k| 1.0 - libm::exp(-0.5 * f64::from(k) - 3.0));
            for rho in near_one.chain([1.0, SERIES_MAX, 1.0 - f64::EPSILON]) {
                let bits = |(product, pairs): (f64, f64)| [product.to_bits(), pairs.to_bits()];
                let all = trimmed.integral_without([f64::INFINITY; 2], rho);
                assert_eq!(bits(trimmed.integral(rho)), bits(all), "t {t}, rho {rho}");
            }
        }
    }

    /// Side by side, whatever their number and whichever are neighbours, correlations have the bits of each alone.
    #[test]
    fn prop_neighbours_change_no_bit() {
        let mut rhos = vec![0.0, -0.0, 1.0, -1.0, 1.5, 0.95, -0.95, 0.9500001, 1e-15, -1e-9, 1e-200, f64::NAN];
        rhos.extend((0..200u32).map(|k| f64::from(k.wrapping_mul(2_654_435_761)) / 2e9 - 1.07));
        for t in [0.0, 0.7, 1.96, 6.0, f64::INFINITY] {
            let trimmed = TrimmedNormal::new(t);
            let bits = |(product, pairs): (f64, f64)| [product.to_bits(), pairs.to_bits()];
            for n in [0, 1, 7, 8, 9, 40, rhos.len()] {
                let alone: Vec<_> = rhos[..n].iter().map(|rho| bits(trimmed.moments(*rho))).collect();
                let found: Vec<_> = trimmed.moments_of_each(&rhos[..n]).into_iter().map(bits).collect();
                assert_eq!(found, alone, "t {t}, {n}");
            }
        }
    }
}
