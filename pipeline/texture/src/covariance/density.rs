//! Spectrum of a stationary covariance on a torus, even if its range is not small against the torus.
//!
//! A covariance truncated to a torus has negative eigenvalues if it has not decayed half way around. Spectra of exponential and
//! Matern covariances are then computed from their spectral density, which needs no truncation ([`matern::eigenvalues`]).

use super::filtered::torus_covariance;
use super::models::matern;
use super::{Covariance, Structure};
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2};
use std::f64::consts::PI;

/// Width of a torus, in ranges, that is enough for a covariance with a kink at lag zero.
pub const TORUS_RANGES: f64 = 16.0;

/// Modes of a column whose eigenvalues are computed side by side.
const LANES: usize = 8;

/// Eigenvalues of a stationary covariance on a torus, m2, in the order of a half spectrum.
pub fn spectrum(covariance: &Covariance, torus: [usize; 2], cell_m: [f64; 2]) -> HalfSpectrum {
    let [rows, cols] = torus;
    match smoothnesses(covariance) {
        Some(nu) if reaches_across(covariance, torus, cell_m) => {
            let values = from_density(covariance, &nu, torus, cell_m, |_, _| true);
            HalfSpectrum { rows, cols, values: values.into_iter().map(|v| Complex64::new(v, 0.0)).collect() }
        }
        _ => RealFft2::new(rows, cols).forward(&torus_covariance(torus, cell_m, covariance)),
    }
}

/// The same at the modes that `is_wanted` names by column and row frequency, with the same bits; others may be 0 instead.
pub fn eigenvalues(
    covariance: &Covariance,
    torus: [usize; 2],
    cell_m: [f64; 2],
    is_wanted: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<f64> {
    match smoothnesses(covariance) {
        Some(nu) if reaches_across(covariance, torus, cell_m) => {
            from_density(covariance, &nu, torus, cell_m, is_wanted)
        }
        _ => spectrum(covariance, torus, cell_m).values.iter().map(|v| v.re).collect(),
    }
}

/// True if a covariance has not decayed half way around the torus.
fn reaches_across(covariance: &Covariance, [rows, cols]: [usize; 2], cell_m: [f64; 2]) -> bool {
    let side_m = (rows as f64 * cell_m[1]).min(cols as f64 * cell_m[0]);
    TORUS_RANGES * covariance.range_m() > side_m
}

/// Smoothness of each term as a Matern covariance; `None` if any term is not one.
fn smoothnesses(covariance: &Covariance) -> Option<Vec<f64>> {
    let of = |term: &Structure| match term.model.kind().kind {
        "exponential" => Some(0.5),
        "matern" => Some(term.shape),
        _ => None,
    };
    covariance.structures.iter().map(of).collect()
}

/// Eigenvalues of a sum of Matern covariances of any range, in the order of a half spectrum, at least where they are wanted.
fn from_density(
    covariance: &Covariance,
    smoothness: &[f64],
    [rows, cols]: [usize; 2],
    cell_m: [f64; 2],
    is_wanted: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<f64> {
    let wave = |k: usize, n: usize, cell: f64| {
        let k = if 2 * k > n { k as f64 - n as f64 } else { k as f64 };
        2.0 * PI * k / (n as f64 * cell)
    };
    let (sin, cos) = libm::sincos(covariance.azimuth_deg.to_radians());
    let lanes = |kx: usize, ky: usize| -> [f64; LANES] {
        let east = wave(kx, cols, cell_m[0]);
        // Rows run southwards. The last ones fill the lanes of a column's end.
        let north: [f64; LANES] = std::array::from_fn(|lane| -wave((ky + lane).min(rows - 1), rows, cell_m[1]));
        let mut sums = [0.0; LANES];
        for (term, &nu) in covariance.structures.iter().zip(smoothness) {
            let of_term = matern::eigenvalues(east, north, term.range_m, nu, cell_m, [sin, cos], covariance.ratio);
            sums.iter_mut().zip(of_term).for_each(|(sum, value)| *sum += term.sigma_m * term.sigma_m * value);
        }
        sums.map(|sum| sum + covariance.nugget_m2)
    };
    let mut values = vec![0.0; rows * (cols / 2 + 1)];
    values.par_chunks_mut(rows).enumerate().for_each(|(kx, column)| {
        for (run, ky) in column.chunks_mut(LANES).zip((0..rows).step_by(LANES)) {
            if (ky..ky + run.len()).any(|ky| is_wanted(kx, ky)) {
                run.copy_from_slice(&lanes(kx, ky)[..run.len()]);
            }
        }
    });
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::Form;

    /// The two ways to compute a spectrum agree where both are accurate: a torus of 40 ranges, oblong cells, an oblique axis. The
    /// tolerance is the error from folding far wavenumbers: 0.3 % of the variance at a ratio of 0.4.
    #[test]
    fn val_the_density_gives_the_covariance() {
        for model in ["exponential", "anisotropic:exponential", "anisotropic:matern+nugget"] {
            let form = Form::parse(model).unwrap();
            let all = [("sigma_m", 0.5), ("range_m", 0.3), ("smoothness", 0.8), ("nugget_m2", 0.01)];
            let axis = [("ratio", 0.4), ("azimuth_deg", 30.0)];
            let values = form.parameters().into_iter().map(|p| {
                let value = all.iter().chain(&axis).find(|(name, _)| *name == p.name).unwrap().1;
                (p.name, value)
            });
            let covariance = form.covariance(&values.collect()).unwrap();
            let (torus, cell_m) = ([240, 200], [0.06, 0.05]);
            let fft = RealFft2::new(torus[0], torus[1]);
            let nu = smoothnesses(&covariance).unwrap();
            let values = from_density(&covariance, &nu, torus, cell_m, |_, _| true);
            let values = values.into_iter().map(|v| Complex64::new(v, 0.0)).collect();
            let field = fft.inverse(HalfSpectrum { rows: torus[0], cols: torus[1], values });
            let wanted = torus_covariance(torus, cell_m, &covariance);
            let worst = field.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).max_by(f64::total_cmp).unwrap();
            assert!(worst < 3e-3 * wanted[0], "{model}: {worst:e} of {}", wanted[0]);
        }
    }

    /// What is not wanted changes no bit of the rest: on a torus that a covariance reaches across, and on one on which its transform is taken;
    /// columns that fill no whole number of lanes.
    #[test]
    fn prop_modes_left_out_change_no_bit() {
        let (torus, cell_m) = ([37, 30], [0.1, 0.12]);
        for (model, range_m) in [("exponential", 3.0), ("matern+nugget", 3.0), ("exponential", 0.02), ("gaussian", 0.5)]
        {
            let all = [("sigma_m", 0.5), ("range_m", range_m), ("smoothness", 0.8), ("nugget_m2", 0.01)];
            let form = Form::parse(model).unwrap();
            let named = |name: &str| all.iter().find(|(of, _)| *of == name).unwrap().1;
            let values = form.parameters().into_iter().map(|p| (p.name.clone(), named(&p.name)));
            let covariance = form.covariance(&values.collect()).unwrap();
            let is_wanted = |kx: usize, ky: usize| kx < 3 && !(9..30).contains(&ky);
            let some = eigenvalues(&covariance, torus, cell_m, is_wanted);
            let whole = spectrum(&covariance, torus, cell_m);
            assert_eq!(some.len(), whole.values.len());
            for (k, (some, whole)) in some.iter().zip(&whole.values).enumerate() {
                if is_wanted(k / 37, k % 37) {
                    assert_eq!(some.to_bits(), whole.re.to_bits(), "{model}, {range_m} m: {k}");
                }
            }
            // Most of what is not wanted is not computed, where it need not be.
            let left_out = some.iter().filter(|v| **v == 0.0).count();
            assert_eq!(left_out > some.len() / 2, range_m == 3.0, "{model}, {range_m} m: {left_out}");
        }
    }
}
