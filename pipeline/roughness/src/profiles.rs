//! Power spectral density of profiles.
//!
//! The two-sided one-dimensional density, in m3 over spatial frequency in cycles/m, averaged over all rows (along x) or all
//! columns (along y), is
//! $$ S(f) = \frac{\Delta \sum_p \left| \sum_j w_{pj} z_{pj}\, e^{-2\pi i f x_j} \right|^2}{\sum_p \sum_j w_{pj}^2} , $$
//! with p the profile and w a Hann window along it, 0 in cells without data. White noise of variance s^2 and cell `D` has
//! `S = s^2 D`; the integral over all frequencies, negative ones included, is the variance. This is C^1D of Jacobs, Junge and
//! Pastewka, Surf. Topogr. 5 (2017) 013001 (`f^(-1 - 2H)` for a self-affine surface, one power above that of the
//! two-dimensional density); window and normalisation as in [`crate::spectrum`].
//!
//! Profiles are padded to lengths 2^a 3^b 5^c and transformed two at a time, one as the real and one as the imaginary part:
//! the mean over opposite frequencies gives the sum of both powers. Densities are averaged over eighths of an octave, from one
//! cycle per profile to the Nyquist frequency. Heights must be centred on zero: the caller removes mean and plane first
//! ([`crate::level`]).
//!
//! Cost: one transform of the grid's rows and one of its columns; a copy of the grid.

use crate::spectrum::{RINGS_PER_OCTAVE, hann};
use crate::structure::Direction;
use rayon::prelude::*;
use sastrugi_numeric::Grid;
use sastrugi_numeric::fft::{Complex64, Transform, smooth_length};
use serde::Serialize;

/// Pairs of profiles summed by one task.
const PAIRS_AT_ONCE: usize = 32;

/// One frequency band of a profile spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProfileBin {
    /// Direction of the profiles.
    pub direction: Direction,
    /// Mean spatial frequency, cycles/m.
    pub frequency_cycles_m: f64,
    /// Mean power spectral density, m3.
    pub psd_m3: f64,
    /// Number of frequencies of the padded transform in the band.
    pub modes: u64,
}

/// Densities along x, then along y, by increasing frequency. None for an axis of fewer than 4 cells, or a grid without data.
pub fn profile_spectra(dem: &Grid) -> Vec<ProfileBin> {
    let (rows, cols) = (dem.rows(), dem.cols());
    let [cell_x, cell_y] = dem.geometry.cell;
    let by_col: Vec<f64> = (0..cols).into_par_iter().flat_map_iter(|c| (0..rows).map(move |r| dem.at(r, c))).collect();
    let mut bins = spectrum(&dem.values, cols, cell_x, Direction::X);
    bins.extend(spectrum(&by_col, rows, cell_y, Direction::Y));
    bins
}

/// Density of consecutive profiles of `n` cells.
fn spectrum(profiles: &[f64], n: usize, cell_m: f64, direction: Direction) -> Vec<ProfileBin> {
    if n < 4 {
        return Vec::new();
    }
    let transform = Transform::new(smooth_length(n));
    let window = hann(n);
    let parts: Vec<(Vec<f64>, f64)> =
        profiles.par_chunks(2 * PAIRS_AT_ONCE * n).map(|part| powers(part, &window, &transform)).collect();
    let mut total = vec![0.0; transform.len() / 2 + 1];
    let mut weight = 0.0;
    for (powers, own) in &parts {
        total.iter_mut().zip(powers).for_each(|(t, p)| *t += p);
        weight += own;
    }
    if weight == 0.0 {
        return Vec::new();
    }
    let step = 1.0 / (transform.len() as f64 * cell_m);
    bands(&total, step, 1.0 / (n as f64 * cell_m), cell_m / weight, direction)
}

/// Sum over the profiles of the squared modulus at each frequency, and sum of the squared windows.
fn powers(profiles: &[f64], window: &[f64], transform: &Transform) -> (Vec<f64>, f64) {
    let (n, len) = (window.len(), transform.len());
    let mut scratch = transform.scratch();
    let mut work = vec![Complex64::default(); len];
    let mut total = vec![0.0; len / 2 + 1];
    let mut weight = 0.0;
    for two in profiles.chunks(2 * n) {
        work.fill(Complex64::default());
        for (k, profile) in two.chunks_exact(n).enumerate() {
            for ((out, z), w) in work.iter_mut().zip(profile).zip(window).filter(|((_, z), _)| z.is_finite()) {
                if k == 0 {
                    out.re = w * z
                } else {
                    out.im = w * z
                };
                weight += w * w;
            }
        }
        transform.forward(&mut work, &mut scratch);
        for (k, t) in total.iter_mut().enumerate() {
            *t += 0.5 * (work[k].norm_sqr() + work[(len - k) % len].norm_sqr());
        }
    }
    (total, weight)
}

fn bands(powers: &[f64], step: f64, lowest: f64, density: f64, direction: Direction) -> Vec<ProfileBin> {
    let mut totals: Vec<(f64, f64, u64)> = Vec::new();
    for (k, power) in powers.iter().enumerate() {
        let frequency = k as f64 * step;
        if frequency >= lowest * (1.0 - 1e-9) {
            let band = (libm::log2(frequency / lowest) * RINGS_PER_OCTAVE).max(0.0) as usize;
            if totals.len() <= band {
                totals.resize(band + 1, (0.0, 0.0, 0));
            }
            let total = &mut totals[band];
            *total = (total.0 + frequency, total.1 + power, total.2 + 1);
        }
    }
    let bin = |(frequencies, powers, modes): (f64, f64, u64)| ProfileBin {
        direction,
        frequency_cycles_m: frequencies / modes as f64,
        psd_m3: density * powers / modes as f64,
        modes,
    };
    totals.into_iter().filter(|t| t.2 > 0).map(bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};
    use std::f64::consts::TAU;

    fn noise(g: Geometry, hole_share: f64) -> Grid {
        let mut s = Streams::for_seed(1, "profiles-test").stream("noise");
        let mut value = || if s.uniform() < hole_share { f64::NAN } else { 2.0 * s.normal() };
        Grid::new(g, (0..g.len()).map(|_| value()).collect())
    }

    /// Powers by the definition, profile by profile: with holes, an odd number of profiles, and padding.
    #[test]
    fn val_equals_the_definition() {
        let g = Geometry { rows: 7, cols: 11, cell: [0.5, 0.8], origin: [0.0; 2] };
        let dem = noise(g, 0.2);
        let window = hann(11);
        let (fast, weight) = powers(&dem.values, &window, &Transform::new(12));
        let mut slow_weight = 0.0;
        let mut slow = [0.0; 7];
        for r in 0..7 {
            let data = || dem.row(r).iter().zip(&window).enumerate().filter(|(_, (z, _))| z.is_finite());
            slow_weight += data().map(|(_, (_, w))| w * w).sum::<f64>();
            for (k, s) in slow.iter_mut().enumerate() {
                let total: Complex64 = data()
                    .map(|(j, (z, w))| {
                        let (sin, cos) = libm::sincos(-TAU * (j * k) as f64 / 12.0);
                        Complex64::new(cos, sin) * (w * z)
                    })
                    .sum();
                *s += total.norm_sqr();
            }
        }
        assert!((weight - slow_weight).abs() < 1e-12);
        assert_eq!(fast.len(), slow.len());
        assert!(fast.iter().zip(slow).all(|(a, b)| (a - b).abs() < 1e-11), "{fast:?} {slow:?}");
    }

    /// White noise of variance 4 on cells of 0.5 x 0.25 m: 2 m3 along x, 1 m3 along y, in every band, also with a third of
    /// the cells missing. A band of n modes of p profiles has a relative standard error of sqrt(3 / (n p)); threshold 8
    /// standard errors: false-alarm rate below 1e-9 in 100 bands.
    #[test]
    fn stat_white_noise_is_flat() {
        let g = Geometry { rows: 300, cols: 243, cell: [0.5, 0.25], origin: [0.0; 2] };
        for hole_share in [0.0, 0.33] {
            let bins = profile_spectra(&noise(g, hole_share));
            assert!(bins.len() > 60);
            for b in bins {
                let (expected, profiles) = if b.direction == Direction::X { (2.0, 300.0) } else { (1.0, 243.0) };
                let allowed = 8.0 * (3.0 / (b.modes as f64 * profiles)).sqrt();
                assert!((b.psd_m3 / expected - 1.0).abs() < allowed, "{b:?}");
            }
        }
    }

    #[test]
    fn val_a_wave_peaks_at_its_frequency_along_its_own_axis() {
        let g = Geometry::square(150, 200, 0.1);
        let dem = Grid::new(g, (0..g.len()).map(|k| libm::sin(TAU * 1.5 * g.x(k % 200))).collect());
        let bins = profile_spectra(&dem);
        let peak = bins.iter().max_by(|a, b| a.psd_m3.total_cmp(&b.psd_m3)).unwrap();
        assert!(peak.direction == Direction::X && (peak.frequency_cycles_m / 1.5 - 1.0).abs() < 0.09, "{peak:?}");
        assert!(profile_spectra(&Grid::filled(g, f64::NAN)).is_empty());
        assert!(profile_spectra(&Grid::filled(Geometry::square(2, 3, 1.0), 1.0)).is_empty());
    }
}
