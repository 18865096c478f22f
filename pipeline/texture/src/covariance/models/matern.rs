//! Matern (von Karman) covariance `B(rho) = sigma^2 2^(1-nu) / Gamma(nu) x^nu K_nu(x)`, `x = rho / b`.
//!
//! nu is the smoothness: increments grow as distance to the power min(nu, 1), so nu < 1 is a Hurst exponent, and the
//! spectrum falls as wavenumber to -(2 nu + 2). nu = 1/2 is the exponential with the same b; nu = 1/3 is von Karman's
//! turbulence. Many authors write `x = 2 sqrt(nu) rho / b'`: b' = 2 sqrt(nu) b.

use super::{Model, Shape};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// Parameters of the Matern model in a fit file.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaternParameters {
    /// Standard deviation sigma, m.
    pub sigma_m: f64,
    /// Range b, m.
    pub range_m: f64,
    /// Smoothness nu, 0.05 to 4.
    pub smoothness: f64,
}

/// The Matern model.
pub struct Matern;

impl Model for Matern {
    fn kind(&self) -> Kind {
        Kind {
            family: "covariance",
            kind: "matern",
            summary: "Matern or von Karman: sigma^2 2^(1 - nu) / Gamma(nu) (lag / b)^nu K_nu(lag / b), smoothness nu (1/2: exponential)",
            source: "von Karman 1948; Matern 1960; Stein 1999, section 2.7",
            parameters: schema_of::<MaternParameters>(),
        }
    }

    fn correlation(&self, ratio: f64, shape: f64) -> f64 {
        Order::new(shape).correlation(ratio)
    }

    fn of_shape(&'static self, shape: f64) -> Box<dyn Fn(f64) -> f64 + Send + Sync> {
        let order = Order::new(shape);
        Box::new(move |ratio| order.correlation(ratio))
    }

    fn shape(&self) -> Option<Shape> {
        Some(Shape { name: "smoothness", bounds: (0.05, 4.0), start: 0.6 })
    }
}

/// Aliases summed one by one on each side of each wavenumber.
const ALIASES: i32 = 4;

/// Eigenvalues of a covariance of unit variance on cells of `cell_m`, at angular wavenumbers `[east, north]` in rad per
/// m, for a covariance whose long axis has `[sin, cos]` of the azimuth and whose range across is `ratio` times the range
/// along: the spectral density `nu b^2 / pi (1 + b^2 k^2)^(-nu - 1)`, with wavenumbers above half a wave per cell folded back (the
/// far ones as an integral). Always positive, unlike the transform of a covariance truncated to a torus.
///
/// Each has the bits that it has alone: every sum of aliases takes its terms in the same sequence, side by side with the others, so that roots and
/// quotients of several take one instruction.
pub fn eigenvalues<const N: usize>(
    east: f64,
    north: [f64; N],
    range_m: f64,
    nu: f64,
    cell_m: [f64; 2],
    [sin, cos]: [f64; 2],
    ratio: f64,
) -> [f64; N] {
    use std::f64::consts::PI;
    let b2 = range_m * range_m;
    let turn = cell_m.map(|c| 2.0 * PI / c);
    let mut near = [0.0; N];
    for i in -ALIASES..=ALIASES {
        let x = east + f64::from(i) * turn[0];
        for j in -ALIASES..=ALIASES {
            let shift = f64::from(j) * turn[1];
            let q = north.map(|north| {
                let y = north + shift;
                // Across the long axis distances are stretched by 1 / ratio, and wavenumbers shrunk.
                let (along, across) = (x * sin + y * cos, (x * cos - y * sin) * ratio);
                1.0 + b2 * (along * along + across * across)
            });
            // The exponential needs no power function.
            let densities = match nu == 0.5 {
                true => q.map(|q| 1.0 / (q * q.sqrt())),
                false => q.map(|q| libm::exp(-(nu + 1.0) * libm::log(q))),
            };
            near.iter_mut().zip(densities).for_each(|(sum, density)| *sum += density);
        }
    }
    // Beyond the summed aliases, replaced by a circle of equal area and this squared radius.
    let radius2 = (2.0 * f64::from(ALIASES) + 1.0) * (2.0 * f64::from(ALIASES) + 1.0) * turn[0] * turn[1] / PI;
    let far = libm::exp(-nu * libm::log1p(b2 * radius2 * ratio));
    near.map(|near| near * ratio * nu * b2 / PI * turn[0] * turn[1] + far)
}

/// Ratio below which the correlation is taken as 1.
const RATIO_MIN: f64 = 1e-140;
/// Ratio above which the correlation is taken as 0.
const RATIO_MAX: f64 = 700.0;

/// The model of one smoothness. What depends on it alone is computed once, and only if it is needed.
struct Order {
    /// Smoothness nu.
    nu: f64,
    /// Gamma(nu).
    gamma: OnceLock<f64>,
    /// Steps of the recurrence up to nu.
    steps: usize,
    /// Order in [-1/2, 1/2] at which it starts.
    mu: f64,
    /// Temme's series at that order.
    temme: OnceLock<Temme>,
}

impl Order {
    fn new(nu: f64) -> Self {
        let steps = (nu + 0.5) as usize;
        Self { nu, gamma: OnceLock::new(), steps, mu: nu - steps as f64, temme: OnceLock::new() }
    }

    fn correlation(&self, x: f64) -> f64 {
        if x < RATIO_MIN {
            return 1.0;
        }
        if x > RATIO_MAX {
            return 0.0;
        }
        let gamma = self.gamma.get_or_init(|| libm::tgamma(self.nu));
        let scale = libm::exp((1.0 - self.nu) * std::f64::consts::LN_2 + self.nu * libm::log(x)) / gamma;
        // Rounding must not lift a correlation above 1.
        (scale * self.bessel_k(x)).min(1.0)
    }

    /// [`bessel_k`] of this order.
    fn bessel_k(&self, x: f64) -> f64 {
        let (mut now, mut next) = match x < 2.0 {
            true => self.temme.get_or_init(|| Temme::new(self.mu)).at(x),
            false => steed(self.mu, x),
        };
        for k in 1..=self.steps {
            (now, next) = (next, now + 2.0 * (self.mu + k as f64) / x * next);
        }
        now
    }
}

/// Largest number of terms of the series and of the continued fraction.
const TERMS: usize = 10_000;
/// Relative size of the last term.
const ROUNDING: f64 = 1e-16;

/// Modified Bessel function of the second kind `K_nu(x)`, nu >= 0, x > 0: Temme's series (1975) for `x < 2`, Steed's
/// continued fraction (Thompson and Barnett, 1987) otherwise, at an order in [-1/2, 1/2], then forward recurrence. Relative
/// error about 1e-14.
pub fn bessel_k(nu: f64, x: f64) -> f64 {
    Order::new(nu).bessel_k(x)
}

/// Temme's series: `K_mu` and `K_(mu+1)` for `|mu| <= 1/2`, `x < 2`.
struct Temme {
    mu: f64,
    /// `1 / Gamma(1 + mu)` and `1 / Gamma(1 - mu)`, half their sum, and half their difference over mu.
    plus: f64,
    minus: f64,
    half_sum: f64,
    half_difference: f64,
    /// `pi mu / sin(pi mu)`.
    ratio: f64,
}

impl Temme {
    fn new(mu: f64) -> Self {
        let (plus, minus) = (1.0 / libm::tgamma(1.0 + mu), 1.0 / libm::tgamma(1.0 - mu));
        let half_sum = 0.5 * (minus + plus);
        let half_difference = if mu.abs() < 1e-5 { -EULER_GAMMA } else { (minus - plus) / (2.0 * mu) };
        let angle = std::f64::consts::PI * mu;
        let ratio = if angle.abs() < 1e-9 { 1.0 } else { angle / libm::sin(angle) };
        Self { mu, plus, minus, half_sum, half_difference, ratio }
    }

    fn at(&self, x: f64) -> (f64, f64) {
        let Self { mu, plus, minus, half_sum, half_difference, ratio } = *self;
        let log = -libm::log(0.5 * x);
        let e = mu * log;
        let sinhc = if e.abs() < 1e-9 { 1.0 } else { libm::sinh(e) / e };
        let mut f = ratio * (half_difference * libm::cosh(e) + half_sum * sinhc * log);
        let power = libm::exp(e);
        let mut p = 0.5 * power / plus;
        let mut q = 0.5 / (power * minus);
        let quarter = 0.25 * x * x;
        let mut c = 1.0;
        let (mut sum, mut sum_next) = (f, p);
        for k in 1..TERMS {
            let k = k as f64;
            f = (k * f + p + q) / (k * k - mu * mu);
            c *= quarter / k;
            p /= k - mu;
            q /= k + mu;
            sum += c * f;
            sum_next += c * (p - k * f);
            if (c * f).abs() < ROUNDING * sum.abs() {
                break;
            }
        }
        (sum, sum_next * 2.0 / x)
    }
}

/// `K_mu` and `K_(mu+1)` for `|mu| <= 1/2`, `x >= 2`.
fn steed(mu: f64, x: f64) -> (f64, f64) {
    let mut b = 2.0 * (1.0 + x);
    let mut d = 1.0 / b;
    let (mut h, mut delta) = (d, d);
    let (mut q1, mut q2) = (0.0, 1.0);
    let a1 = 0.25 - mu * mu;
    let mut q = a1;
    let mut c = a1;
    let mut a = -a1;
    let mut s = 1.0 + q * delta;
    for k in 2..TERMS {
        a -= 2.0 * (k as f64 - 1.0);
        c = -a * c / k as f64;
        let q_new = (q1 - b * q2) / a;
        (q1, q2) = (q2, q_new);
        q += c * q_new;
        b += 2.0;
        d = 1.0 / (b + a * d);
        delta *= b * d - 1.0;
        h += delta;
        let term = q * delta;
        s += term;
        if (term / s).abs() < ROUNDING {
            break;
        }
    }
    let h = a1 * h;
    let k = (std::f64::consts::PI / (2.0 * x)).sqrt() * libm::exp(-x) / s;
    (k, k * (mu + x + 0.5 - h) / x)
}

/// Euler's constant.
const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;

#[cfg(test)]
mod tests {
    use super::*;

    fn correlation(x: f64, nu: f64) -> f64 {
        Matern.correlation(x, nu)
    }

    /// One order for many ratios, in any sequence, gives the bits of a new one for each.
    #[test]
    fn prop_an_order_serves_any_ratio() {
        for nu in [0.05, 0.3, 0.5, 0.999_999_9, 1.0, 1.3, 2.5, 4.0] {
            let of_ratio = super::super::model("matern").unwrap().of_shape(nu);
            for x in [0.0, 1e-150, 3.0, 0.7, 1e-6, 1.999, 2.0, 0.7, 600.0, 800.0] {
                assert_eq!(of_ratio(x).to_bits(), correlation(x, nu).to_bits(), "nu {nu}, x {x}");
            }
        }
    }

    /// `K_nu(x)`, computed with mpmath at 30 digits.
    #[rustfmt::skip]
    const BESSEL: [(f64, f64, f64); 12] = [
        (0.05, 1e-06, 15.115528569478292),
        (0.05, 0.5, 0.925_833_241_623_740_6),
        (0.3, 0.01, 6.8901026382927695),
        (0.3333, 1.99, 0.11799669057392562),
        (0.5, 3.0, 0.036025985131764593),
        (0.7, 2.0, 0.12601327130661064),
        (0.9, 0.001, 499.71226556252132),
        (1.0, 0.7, 1.050283535312918),
        (1.5, 8.0, 0.00016722900749831943),
        (2.2, 0.0001, 1597128074.2307434),
        (3.7, 0.3, 2_312.202_682_397_523),
        (4.0, 40.0, 1.0224553256539414e-18),
    ];

    #[test]
    fn gold_bessel_k() {
        for (nu, x, expected) in BESSEL {
            let found = bessel_k(nu, x);
            assert!((found / expected - 1.0).abs() < 1e-12, "K_{nu}({x}) = {found}, expected {expected}");
        }
    }

    /// Side by side, eigenvalues have the bits of the sum over aliases one after the other.
    #[test]
    fn prop_eigenvalues_side_by_side_change_no_bit() {
        use std::f64::consts::PI;
        let one = |k: [f64; 2], b: f64, nu: f64, cell_m: [f64; 2], [sin, cos]: [f64; 2], ratio: f64| {
            let turn = cell_m.map(|c| 2.0 * PI / c);
            let mut near = 0.0;
            for i in -ALIASES..=ALIASES {
                for j in -ALIASES..=ALIASES {
                    let [x, y] = [k[0] + f64::from(i) * turn[0], k[1] + f64::from(j) * turn[1]];
                    let (along, across) = (x * sin + y * cos, (x * cos - y * sin) * ratio);
                    let q = 1.0 + b * b * (along * along + across * across);
                    near += if nu == 0.5 { 1.0 / (q * q.sqrt()) } else { libm::exp(-(nu + 1.0) * libm::log(q)) };
                }
            }
            let radius2 = (2.0 * f64::from(ALIASES) + 1.0) * (2.0 * f64::from(ALIASES) + 1.0) * turn[0] * turn[1] / PI;
            let far = libm::exp(-nu * libm::log1p(b * b * radius2 * ratio));
            near * ratio * nu * (b * b) / PI * turn[0] * turn[1] + far
        };
        let (sin, cos) = libm::sincos(0.6);
        for nu in [0.3, 0.5, 1.7] {
            for (cell_m, axis, ratio) in [([0.02; 2], [0.0, 1.0], 1.0), ([0.05, 0.07], [sin, cos], 0.4)] {
                let north: [f64; 8] = std::array::from_fn(|l| 1.3 * l as f64 - 5.0);
                let found = eigenvalues(2.7, north, 1.9, nu, cell_m, axis, ratio);
                for (found, north) in found.into_iter().zip(north) {
                    let expected = one([2.7, north], 1.9, nu, cell_m, axis, ratio);
                    assert_eq!(found.to_bits(), expected.to_bits(), "nu {nu}, {cell_m:?}, {north}: {found} {expected}");
                    let [alone] = eigenvalues(2.7, [north], 1.9, nu, cell_m, axis, ratio);
                    assert_eq!(alone.to_bits(), expected.to_bits(), "nu {nu}, {cell_m:?}, {north}: {alone} {expected}");
                }
            }
        }
    }

    /// Against the transform of the covariance itself on a torus of 40 ranges, where truncation is negligible.
    #[test]
    fn val_eigenvalues_are_the_transform() {
        let (n, cell) = (200, 0.2);
        let fft = sastrugi_numeric::fft::RealFft2::new(n, n);
        for nu in [0.3, 0.5, 0.9] {
            let short = |k: usize| k.min(n - k) as f64 * cell;
            let field: Vec<f64> = (0..n * n)
                .map(|k| correlation((short(k / n) * short(k / n) + short(k % n) * short(k % n)).sqrt(), nu))
                .collect();
            let spectrum = fft.forward(&field);
            for (kx, ky) in [(0usize, 0usize), (1, 0), (3, 7), (40, 20), (100, 100), (100, 3)] {
                let wave = |k: usize| 2.0 * std::f64::consts::PI * k as f64 / (n as f64 * cell);
                let expected = spectrum.values[kx * n + ky].re;
                let [found] = eigenvalues(wave(kx), [wave(ky)], 1.0, nu, [cell; 2], [0.0, 1.0], 1.0);
                assert!((found / expected - 1.0).abs() < 5e-3, "nu {nu}, ({kx}, {ky}): {found} {expected}");
            }
        }
    }

    /// Half-integer smoothness has closed forms.
    #[test]
    fn val_half_integers() {
        for k in 1..400 {
            let x = 0.05 * f64::from(k);
            let e = libm::exp(-x);
            for (nu, expected) in [(0.5, e), (1.5, (1.0 + x) * e), (2.5, (1.0 + x + x * x / 3.0) * e)] {
                assert!((correlation(x, nu) - expected).abs() < 1e-13, "nu {nu}, x {x}");
            }
        }
        assert_eq!((correlation(0.0, 0.3), correlation(1e4, 0.3)), (1.0, 0.0));
    }

    /// The integral representation `K_nu(x) = integral of exp(-x cosh t) cosh(nu t)` by the trapezoidal rule.
    #[test]
    fn prop_agrees_with_its_integral() {
        let slow = |nu: f64, x: f64| {
            let step = 1.0 / 64.0;
            let value = |k: i32| {
                let t = step * f64::from(k);
                libm::exp(-x * libm::cosh(t)) * libm::cosh(nu * t)
            };
            step * (0.5 * value(0) + (1..1200).map(value).sum::<f64>())
        };
        for nu in [0.05, 0.2, 0.33, 0.5, 0.77, 1.0, 1.9, 3.3, 4.0] {
            for x in [1e-3, 0.1, 0.7, 1.9999, 2.0, 3.3, 11.0, 60.0] {
                let (fast, slow) = (bessel_k(nu, x), slow(nu, x));
                assert!((fast / slow - 1.0).abs() < 1e-11, "nu {nu}, x {x}: {fast} {slow}");
            }
        }
    }
}
