//! Power-law fit to the PSD of profiles, and the ISO 8608 road class.
//!
//! $$ P(f) = c f^{-n} , \qquad \sigma^2 = \int_{1/\lambda_{max}}^{1/\lambda_{min}} P\,df
//!    = \frac{c}{n - 1} \left( \lambda_{max}^{n-1} - \lambda_{min}^{n-1} \right) $$
//! with the one-sided density P in m3 (twice that of [`crate::profile_spectra`]), f in cycles/m, and therefore c in m^(3 - n).
//! For n = 2 (Van Deusen 1967, natural ground) c is a length and `sigma^2 = c (lambda_max - lambda_min)`; a c in feet is
//! converted at 0.3048 m per foot.
//!
//! Fit: least squares of ln P on ln f over bands of an eighth of an octave, equally weighted, along x and along y together.
//!
//! Class: ISO 8608:2016, Annex C, by P at 0.1 cycles/m. The standard fits from 0.011 to 2.83 cycles/m. A vehicle's band starts
//! at its longest wavelength (0.185 cycles/m for 5.4 m); the law is then extrapolated to 0.1 cycles/m for the class.

use crate::profiles::ProfileBin;
use crate::spectrum::RINGS_PER_OCTAVE;
use crate::structure::Direction;
use sastrugi_numeric::sums;
use serde::Serialize;

/// Fewest bands of a fit.
const BINS_MIN: usize = 4;
/// Spatial frequency at which ISO 8608 classifies roads, cycles/m.
const ISO_FREQUENCY_CYCLES_M: f64 = 0.1;
/// Upper bound of ISO class A at 0.1 cycles/m, m3; each further class has four times the bound of the one before.
const ISO_CLASS_A_MAX_M3: f64 = 32e-6;

/// Fitted power law `P(f) = c f^-n`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PowerLaw {
    /// Density at 1 cycle/m, one-sided, m^(3 - n).
    pub c: f64,
    /// Exponent.
    pub n: f64,
    /// Share of the variance of ln P explained by the line.
    pub r2: f64,
    /// Standard error of `n` from the scatter of the bands about the line.
    pub n_standard_error: f64,
    /// Lowest and highest frequency of the bands in the fit, cycles/m.
    pub frequencies_cycles_m: [f64; 2],
}

impl PowerLaw {
    /// Fits the densities of `direction` between two frequencies; `None` with fewer than 4 bands of non-zero power there.
    pub fn fit(bins: &[ProfileBin], direction: Direction, [low, high]: [f64; 2]) -> Option<Self> {
        let inside = |b: &&ProfileBin| {
            let taken = direction == Direction::All || b.direction == direction;
            taken && b.frequency_cycles_m >= low && b.frequency_cycles_m <= high && b.psd_m3 > 0.0
        };
        let inside: Vec<&ProfileBin> = bins.iter().filter(inside).collect();
        let x: Vec<f64> = inside.iter().map(|b| libm::log(b.frequency_cycles_m)).collect();
        let y: Vec<f64> = inside.iter().map(|b| libm::log(2.0 * b.psd_m3)).collect();
        if x.len() < BINS_MIN {
            return None;
        }
        let (mean_x, mean_y) = (sums::mean(&x), sums::mean(&y));
        let moment = |a: &[f64], mean_a: f64, b: &[f64], mean_b: f64| {
            sums::sum(&a.iter().zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).collect::<Vec<_>>())
        };
        let (xx, xy, yy) =
            (moment(&x, mean_x, &x, mean_x), moment(&x, mean_x, &y, mean_y), moment(&y, mean_y, &y, mean_y));
        let slope = xy / xx;
        let left = (yy - slope * xy).max(0.0);
        let ends = x.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
        let law = Self {
            c: libm::exp(mean_y - slope * mean_x),
            n: -slope,
            r2: if yy > 0.0 { 1.0 - left / yy } else { 1.0 },
            n_standard_error: (left / (x.len() - 2) as f64 / xx).sqrt(),
            frequencies_cycles_m: ends.map(libm::exp),
        };
        (xx > 0.0 && law.c.is_finite()).then_some(law)
    }

    /// One-sided density at a frequency in cycles/m, m3.
    pub fn psd_m3(&self, frequency_cycles_m: f64) -> f64 {
        self.c * libm::pow(frequency_cycles_m, -self.n)
    }

    /// Density at 0.1 cycles/m, by which roads are classified, m3. An extrapolation if [`Self::reaches_iso_8608`] is false.
    pub fn iso_8608_psd_m3(&self) -> f64 {
        self.psd_m3(ISO_FREQUENCY_CYCLES_M)
    }

    /// Whether 0.1 cycles/m lies within the fitted frequencies, or at most one band outside them.
    pub fn reaches_iso_8608(&self) -> bool {
        let [low, high] = self.frequencies_cycles_m;
        let band = libm::exp2(1.0 / RINGS_PER_OCTAVE);
        low <= ISO_FREQUENCY_CYCLES_M * band && high >= ISO_FREQUENCY_CYCLES_M / band
    }

    /// Variance of a profile in a band of wavelengths from `min_m` to `max_m`, m2.
    pub fn variance_m2(&self, [min_m, max_m]: [f64; 2]) -> f64 {
        let power = self.n - 1.0;
        let ratio = libm::log(max_m / min_m);
        // The difference of two powers, without cancellation when they are nearly equal.
        let grown = if power == 0.0 { ratio } else { libm::expm1(power * ratio) / power };
        self.c * libm::pow(min_m, power) * grown
    }
}

/// Class of a road by its density at 0.1 cycles/m (m3), from A, the smoothest, to H; `None` unless the density is positive and
/// finite.
///
/// # Examples
/// ```
/// use sastrugi_roughness::iso_8608_class;
///
/// // The geometric means of the classes are 16e-6, 64e-6 ... m3.
/// assert_eq!([16e-6, 64e-6, 256e-6, 1.0].map(iso_8608_class), [Some('A'), Some('B'), Some('C'), Some('H')]);
/// assert_eq!(iso_8608_class(0.0), None);
/// ```
pub fn iso_8608_class(psd_m3: f64) -> Option<char> {
    let bounds = std::iter::successors(Some(ISO_CLASS_A_MAX_M3), |bound| Some(4.0 * bound));
    let known = psd_m3 > 0.0 && psd_m3.is_finite();
    known.then(|| "ABCDEFG".chars().zip(bounds).find(|(_, bound)| psd_m3 < *bound).map_or('H', |(class, _)| class))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(psd: impl Fn(f64) -> f64) -> Vec<ProfileBin> {
        let bin = |k: u32, direction| {
            let frequency_cycles_m = 0.05 * libm::exp2(f64::from(k) / 8.0);
            ProfileBin { direction, frequency_cycles_m, psd_m3: 0.5 * psd(frequency_cycles_m), modes: 5 }
        };
        (0..40).flat_map(|k| [bin(k, Direction::X), bin(k, Direction::Y)]).collect()
    }

    #[test]
    fn val_a_known_law_is_recovered() {
        let law = PowerLaw::fit(&bins(|f| 3e-4 * libm::pow(f, -2.3)), Direction::All, [0.1, 1.0]).unwrap();
        assert!((law.n - 2.3).abs() < 1e-12 && (law.c / 3e-4 - 1.0).abs() < 1e-12, "{law:?}");
        assert!(law.r2 > 1.0 - 1e-12 && law.n_standard_error < 1e-6);
        assert!(law.frequencies_cycles_m[0] >= 0.1 && law.frequencies_cycles_m[1] <= 1.0 + 1e-12);
        assert!(law.reaches_iso_8608());
        let above = PowerLaw::fit(&bins(|f| 3e-4 / f), Direction::All, [0.185, 1.0]).unwrap();
        assert!(!above.reaches_iso_8608());
        assert!(PowerLaw::fit(&bins(|_| 0.0), Direction::All, [0.1, 1.0]).is_none());
        assert!(PowerLaw::fit(&bins(|f| f), Direction::X, [0.1, 0.11]).is_none());
    }

    /// Four bands, at ln f = 0, 1, 2 and 3, scattered about `f^-2` by e = 0.1 in ln P, alternately so that the line stays as it is: the
    /// residual sum of squares is 4 e^2, that of ln f is 5, that of ln P is 20 + 4 e^2.
    #[test]
    fn val_scatter_about_the_line() {
        let bin = |(k, scatter): (usize, f64)| ProfileBin {
            direction: Direction::X,
            frequency_cycles_m: libm::exp(k as f64),
            psd_m3: 0.5 * libm::exp(-2.0 * k as f64 + scatter),
            modes: 5,
        };
        let mut bins: Vec<ProfileBin> = [0.1, -0.1, -0.1, 0.1].into_iter().enumerate().map(bin).collect();
        // Bands along y, without scatter and up to higher frequencies, take part only where they are asked for.
        bins.extend((0..4).map(|k| ProfileBin { direction: Direction::Y, ..bin((2 * k, 0.0)) }));
        let law = PowerLaw::fit(&bins, Direction::X, [0.5, 50.0]).unwrap();
        assert!((law.n - 2.0).abs() < 1e-12 && (law.c - 1.0).abs() < 1e-12, "{law:?}");
        assert!((law.n_standard_error - 0.004f64.sqrt()).abs() < 1e-12, "{law:?}");
        assert!((law.r2 - 20.0 / 20.04).abs() < 1e-12, "{law:?}");
        assert!((law.frequencies_cycles_m[1] - libm::exp(3.0)).abs() < 1e-12, "{law:?}");
        let along_y = PowerLaw::fit(&bins, Direction::Y, [0.5, 500.0]).unwrap();
        assert!((along_y.n - 2.0).abs() < 1e-12 && along_y.n_standard_error < 1e-6, "{along_y:?}");
        assert!((along_y.frequencies_cycles_m[1] / libm::exp(6.0) - 1.0).abs() < 1e-12, "{along_y:?}");
    }

    /// Against a fine trapezoid rule in ln f, and against `c (lambda_max - lambda_min)` for n = 2.
    #[test]
    fn val_variance_is_the_integral_of_the_density() {
        for n in [0.6, 1.0, 1.0 + 1e-14, 2.0, 3.0] {
            let law = PowerLaw { c: 2e-4, n, r2: 1.0, n_standard_error: 0.0, frequencies_cycles_m: [0.1, 3.0] };
            let [low, high] = [1.0 / 5.4, 1.0 / 0.33];
            let step = libm::log(high / low) / 20_000.0;
            let at = |k: usize| low * libm::exp(step * k as f64);
            let term = |k: usize| 0.5 * step * (law.psd_m3(at(k)) * at(k) + law.psd_m3(at(k + 1)) * at(k + 1));
            let integral: f64 = (0..20_000).map(term).sum();
            assert!((law.variance_m2([0.33, 5.4]) / integral - 1.0).abs() < 1e-7, "{n}");
        }
        let law = PowerLaw { c: 2e-4, n: 2.0, r2: 1.0, n_standard_error: 0.0, frequencies_cycles_m: [0.1, 3.0] };
        assert!((law.variance_m2([0.33, 5.4]) - 2e-4 * (5.4 - 0.33)).abs() < 1e-18);
    }

    /// ISO 8608, Annex C: class geometric means 16, 64, 256 ... 262 144, in 1e-6 m3, and the bounds between them.
    #[test]
    fn val_iso_classes() {
        let mut mean = 16e-6;
        for class in "ABCDEFGH".chars() {
            assert_eq!(iso_8608_class(mean), Some(class));
            assert_eq!(iso_8608_class(1.99 * mean), Some(class));
            mean *= 4.0;
        }
        // A bound belongs to the rougher class.
        assert_eq!([31.9e-6, 32e-6, 128e-6].map(iso_8608_class), [Some('A'), Some('B'), Some('C')]);
        assert_eq!([0.0, -1.0, f64::NAN, f64::INFINITY].map(iso_8608_class), [None; 4]);
    }
}
