//! The measured covariance of a residual by lag, and spectra derived from it.
//!
//! From the data: the mean product of trimmed residuals at each lag (pooled over the two opposite lags), corrected by the inverse of the
//! effect of trimming ([`super::trimmed`]; a single factor does not undo it), at lags up to [`REACH_WINDOWS`] windows.
//!
//! Spectrum P: every lag is placed on a torus, tapered by a cosine beyond one window, and transformed. Negative values are set to 0 while
//! each ring of wavenumbers keeps its power, and the total is scaled to the variance. With S the spectrum of the surface and D the response
//! of the moving average, P estimates `S (1 - D)^2`. Two spectra are derived from it:
//! * `residual`, what a measured background lacks: `S (1 - D^2) = P (1 + D) / (1 - D)`, so that background and texture together have S;
//! * `surface`: `S = P / (1 - D)^2`.
//!
//! Where `(1 - D)^2` is below [`FLOOR`], the background has removed nearly everything and the remainder carries little information: there
//! the spectrum has the shape of the fitted model's, at the level of the adjacent measured waves.

use super::filtered::LagField;
use super::masked::MaskedCovariance;
use super::trimmed::TrimmedNormal;
use super::{Covariance, density};
use sastrugi_numeric::fft::{HalfSpectrum, RealFft2, smooth_length};
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::fit::CovarianceMap;
use sastrugi_schemas::{ParameterError, counted};
use std::f64::consts::PI;

/// Largest lag of a measured covariance, windows.
pub const REACH_WINDOWS: f64 = 1.5;
/// Share of the largest lag beyond which the covariance is tapered: one window.
const TAPER_FROM: f64 = 1.0 / REACH_WINDOWS;
/// Smallest share of power that the background must leave for the measured spectrum to be used.
const FLOOR: f64 = 0.1;
/// The share up to which measured waves set the level of the model that continues them.
const NEXT: f64 = 0.5;
/// Correlations at which the trimming map is computed.
const NODES: usize = 2048;

/// What a spectrum describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The surface.
    Surface,
    /// The part of the surface that a background over the window lacks.
    Residual,
}

/// A spectrum in the order of a half spectrum, m2, and its composition.
pub struct Composition {
    /// Eigenvalues, all 0 or above.
    pub values: Vec<f64>,
    /// Share of the measured spectrum that was negative and set to 0.
    pub clip_share: f64,
    /// Share of the variance that comes from the model.
    pub continued_share: f64,
}

/// The covariance map of trimmed residuals. `normal` is a unit normal trimmed at the same level; `noise` is the covariance of the
/// measurement noise in the residual, which is not texture and is subtracted.
pub fn covariance_map(sums: &MaskedCovariance, normal: &TrimmedNormal, noise: &LagField, model: &str) -> CovarianceMap {
    let [rows, cols] = sums.max_lag.map(|l| l as isize);
    let untrimmed = Untrimmed::new(normal, sums.covariance(0, 0).unwrap_or(0.0));
    let value = |(r, c)| untrimmed.of(sums.covariance(r, c).unwrap_or(0.0)) - noise.at([r, c]);
    let lags = (0..=rows).flat_map(|r| (-cols..=cols).map(move |c| (r, c)));
    let (base, model) = ("residual".to_owned(), model.to_owned());
    CovarianceMap { base, model, max_lag: sums.max_lag, covariance_m2: lags.map(value).collect() }
}

/// The covariance of a residual as textures have it: that of the map after negative eigenvalues are removed.
pub struct Residual {
    torus: [usize; 2],
    covariance_m2: Vec<f64>,
}

impl Residual {
    /// On a torus twice as wide as the map.
    pub fn of(map: &CovarianceMap, cell_m: [f64; 2]) -> Self {
        let torus = map.max_lag.map(|lag| smooth_length(4 * (lag + 1)));
        let fft = RealFft2::new(torus[0], torus[1]);
        let mut spectrum = fft.forward(&on_torus(map, torus));
        clip(&mut spectrum, map.covariance_m2[map.max_lag[1]], cell_m);
        spectrum.values.iter_mut().for_each(|v| v.im = 0.0);
        Self { torus, covariance_m2: fft.inverse(spectrum) }
    }

    /// Covariance at a lag in cells, m2.
    pub fn at(&self, lag: [isize; 2]) -> f64 {
        let [row, col] = [0, 1].map(|k| lag[k].rem_euclid(self.torus[k] as isize) as usize);
        self.covariance_m2[row * self.torus[1] + col]
    }
}

/// The inverse of the effect of trimming on a covariance.
struct Untrimmed {
    variance_m2: f64,
    /// Trimmed covariance of a unit normal at equally spaced correlations from -1 to 1.
    trimmed: Vec<f64>,
}

impl Untrimmed {
    fn new(normal: &TrimmedNormal, trimmed_variance_m2: f64) -> Self {
        let at = |k: usize| normal.covariance(2.0 * k as f64 / NODES as f64 - 1.0);
        let trimmed: Vec<f64> = (0..=NODES).map(at).collect();
        Self { variance_m2: trimmed_variance_m2 / trimmed[NODES], trimmed }
    }

    fn of(&self, trimmed_m2: f64) -> f64 {
        let value = trimmed_m2 / self.variance_m2;
        let above = self.trimmed.partition_point(|t| *t < value).clamp(1, NODES);
        let [low, high] = [self.trimmed[above - 1], self.trimmed[above]];
        let place = (above - 1) as f64 + ((value - low) / (high - low)).clamp(0.0, 1.0);
        self.variance_m2 * (2.0 * place / NODES as f64 - 1.0)
    }
}

/// Checks a map read from a file.
///
/// # Errors
/// An unknown base; too few, too many or non-finite values; a variance that is not positive.
pub fn check(map: &CovarianceMap) -> Result<(), ParameterError> {
    let [rows, cols] = map.max_lag;
    let needed = (rows.saturating_add(1)).saturating_mul(cols.saturating_mul(2).saturating_add(1));
    if map.base != "residual" && map.base != "surface" {
        let message = format!("is `{}`; it must be `residual` or `surface`", map.base);
        return Err(ParameterError::new("map.base", message));
    }
    if map.covariance_m2.len() != needed {
        let found = counted(map.covariance_m2.len(), "value");
        let message = format!("has {found}; lags up to {rows} x {cols} cells need {needed}");
        return Err(ParameterError::new("map.covariance_m2", message));
    }
    if map.covariance_m2.iter().any(|c| !c.is_finite()) || map.covariance_m2[cols] <= 0.0 {
        return Err(ParameterError::new("map.covariance_m2", "must have finite values and a variance above 0"));
    }
    Ok(())
}

/// The spectrum of a map on a torus with the map's cells.
pub fn spectrum(
    map: &CovarianceMap,
    model: &Covariance,
    window: BoxWindow,
    purpose: Purpose,
    torus: [usize; 2],
    cell_m: [f64; 2],
) -> Composition {
    let mut measured = RealFft2::new(torus[0], torus[1]).forward(&on_torus(map, torus));
    let clip_share = clip(&mut measured, map.covariance_m2[map.max_lag[1]], cell_m);
    if map.base == "surface" {
        let factor = |k: usize| match purpose {
            Purpose::Surface => 1.0,
            Purpose::Residual => lacking(response(window, torus, k)),
        };
        let values = measured.values.iter().enumerate().map(|(k, v)| v.re * factor(k)).collect();
        return Composition { values, clip_share, continued_share: 0.0 };
    }
    let continuation = density::spectrum(model, torus, cell_m);
    let responses: Vec<f64> = (0..measured.values.len()).map(|k| response(window, torus, k)).collect();
    let left = |d: f64| (1.0 - d) * (1.0 - d);
    // The model gives the shape of the continuation, the adjacent measured waves its level.
    let [mut own, mut models] = [0.0; 2];
    for (k, d) in responses.iter().enumerate().filter(|(_, d)| (FLOOR..NEXT).contains(&left(**d))) {
        own += times(torus, k) * measured.values[k].re / left(*d);
        models += times(torus, k) * continuation.values[k].re.max(0.0);
    }
    let level = if own > 0.0 && models > 0.0 { own / models } else { 1.0 };
    let (mut values, mut shares) = (Vec::with_capacity(responses.len()), [0.0; 2]);
    for (k, d) in responses.into_iter().enumerate() {
        let is_measured = left(d) >= FLOOR;
        let surface = match is_measured {
            true => measured.values[k].re / left(d),
            false => continuation.values[k].re.max(0.0) * level,
        };
        let value = surface * if purpose == Purpose::Residual { lacking(d) } else { 1.0 };
        shares[usize::from(!is_measured)] += times(torus, k) * value;
        values.push(value);
    }
    let continued_share = if shares[1] > 0.0 { shares[1] / (shares[0] + shares[1]) } else { 0.0 };
    Composition { values, clip_share, continued_share }
}

/// The spectrum of the part of a model that a background over a window lacks, on a torus.
pub fn residual_spectrum(model: &Covariance, window: BoxWindow, torus: [usize; 2], cell_m: [f64; 2]) -> Vec<f64> {
    let surface = density::spectrum(model, torus, cell_m);
    surface.values.iter().enumerate().map(|(k, v)| v.re * lacking(response(window, torus, k))).collect()
}

/// `1 - D^2`.
fn lacking(response: f64) -> f64 {
    1.0 - response * response
}

/// The map's lags on a torus, tapered; those that do not fit are left out.
fn on_torus(map: &CovarianceMap, [rows, cols]: [usize; 2]) -> Vec<f64> {
    let [max_row, max_col] = map.max_lag.map(|l| l as isize);
    let mut field = vec![0.0; rows * cols];
    for r in -max_row..=max_row {
        for c in -max_col..=max_col {
            if 2 * r.unsigned_abs() >= rows || 2 * c.unsigned_abs() >= cols {
                continue;
            }
            let stored = if r < 0 { [-r, -c] } else { [r, c] };
            let value = map.covariance_m2[(stored[0] * (2 * max_col + 1) + stored[1] + max_col) as usize];
            let at = r.rem_euclid(rows as isize) as usize * cols + c.rem_euclid(cols as isize) as usize;
            field[at] = value * taper(r, max_row) * taper(c, max_col);
        }
    }
    field
}

/// 1 up to one window, then a cosine to 0 just beyond the largest lag.
fn taper(lag: isize, max_lag: isize) -> f64 {
    let (lag, end) = (lag.unsigned_abs() as f64, max_lag as f64 + 1.0);
    let from = TAPER_FROM * end;
    if lag <= from { 1.0 } else { 0.5 + 0.5 * libm::cos(PI * (lag - from) / (end - from)) }
}

/// Sets negative eigenvalues to 0 and returns the share that was negative. Each ring of wavenumbers keeps its power: where scatter makes
/// some values negative it makes their neighbours too large, and clipping alone would add short waves. The total is scaled to a variance.
fn clip(spectrum: &mut HalfSpectrum, variance_m2: f64, cell_m: [f64; 2]) -> f64 {
    let torus = [spectrum.rows, spectrum.cols];
    let rings: Vec<usize> = (0..spectrum.values.len()).map(|k| ring(torus, cell_m, k)).collect();
    let count = rings.iter().max().map_or(0, |last| last + 1);
    let (mut positive, mut negative) = (vec![0.0; count], vec![0.0; count]);
    for (k, (v, &ring)) in spectrum.values.iter().zip(&rings).enumerate() {
        let side = if v.re > 0.0 { &mut positive } else { &mut negative };
        side[ring] += times(torus, k) * v.re.abs();
    }
    let kept = |ring: usize| if positive[ring] > 0.0 { (1.0 - negative[ring] / positive[ring]).max(0.0) } else { 0.0 };
    let power: f64 = (0..count).map(|ring| kept(ring) * positive[ring]).sum();
    let scale = if power > 0.0 { variance_m2 * (torus[0] * torus[1]) as f64 / power } else { 0.0 };
    for (v, &ring) in spectrum.values.iter_mut().zip(&rings) {
        v.re = v.re.max(0.0) * kept(ring) * scale;
    }
    let [positive, negative] = [positive, negative].map(|all| all.iter().sum::<f64>());
    if negative > 0.0 { negative / (positive + negative) } else { 0.0 }
}

/// Ring of a mode: its wavenumber in waves across the torus' shorter side.
fn ring([rows, cols]: [usize; 2], [dx, dy]: [f64; 2], k: usize) -> usize {
    let (kx, ky) = (k / rows, k % rows);
    let [width_m, height_m] = [cols as f64 * dx, rows as f64 * dy];
    let (x, y) = (kx as f64 / width_m, ky.min(rows - ky) as f64 / height_m);
    ((x * x + y * y).sqrt() * width_m.min(height_m)) as usize
}

/// How many modes of the full spectrum a mode of the half spectrum represents.
fn times([rows, cols]: [usize; 2], k: usize) -> f64 {
    let kx = k / rows;
    if kx == 0 || 2 * kx == cols { 1.0 } else { 2.0 }
}

/// Response of the window mean at one mode of a half spectrum.
fn response(window: BoxWindow, [rows, cols]: [usize; 2], k: usize) -> f64 {
    let [down, across] = window.cells();
    mean_of_cosine(down, k % rows, rows) * mean_of_cosine(across, k / rows, cols)
}

/// Mean of a cosine of k waves over n cells, in `width` cells around its crest: the response of a moving average along one axis.
pub fn mean_of_cosine(width: usize, k: usize, n: usize) -> f64 {
    if k == 0 {
        return 1.0;
    }
    let half_step = PI * k as f64 / n as f64;
    libm::sin(width as f64 * half_step) / (width as f64 * libm::sin(half_step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::model;
    use sastrugi_numeric::fft::Complex64;

    /// The inverse of the effect of trimming: values T(rho) of a variance give back rho times that variance. 2048 nodes and linear
    /// interpolation: 1e-6 of the variance; near 1, where T falls like a square root, half the distance of two nodes.
    #[test]
    fn val_trimming_is_undone() {
        let normal = TrimmedNormal::new(1.96);
        let untrimmed = Untrimmed::new(&normal, 4.0 * normal.covariance(1.0));
        assert!((untrimmed.variance_m2 - 4.0).abs() < 1e-12);
        let near = 1e-6;
        for (rho, tolerance) in
            [(-0.5, near), (0.0, near), (0.137, near), (0.5, near), (0.9, near), (0.9995, 5e-4), (1.0, 1e-9)]
        {
            let found = untrimmed.of(4.0 * normal.covariance(rho)) / 4.0;
            assert!((found - rho).abs() < tolerance, "{rho}: {found}");
        }
    }

    /// Full weight up to one window (two thirds of the way), half way down at five sixths, and 0 one lag beyond the largest.
    #[test]
    fn val_taper() {
        assert_eq!([0, 1, -10, 20].map(|lag| taper(lag, 29)), [1.0; 4]);
        assert!((taper(25, 29) - 0.5).abs() < 1e-12 && (taper(-25, 29) - 0.5).abs() < 1e-12);
        assert!(taper(29, 29) > 0.02 && taper(29, 29) < 0.03, "{}", taper(29, 29));
    }

    /// The response of a window of 5 rows and 3 columns at every mode is its transform on the torus.
    #[test]
    fn val_response_is_the_transform_of_the_window() {
        let (window, torus) = (BoxWindow { half: [2, 1] }, [12, 10]);
        let mut box_mean = vec![0.0; 120];
        for (r, c) in (-2..=2isize).flat_map(|r| (-1..=1isize).map(move |c| (r, c))) {
            box_mean[r.rem_euclid(12) as usize * 10 + c.rem_euclid(10) as usize] = 1.0 / 15.0;
        }
        let spectrum = RealFft2::new(12, 10).forward(&box_mean);
        assert_eq!(spectrum.values.len(), 12 * 6);
        for (k, value) in spectrum.values.iter().enumerate() {
            assert!((response(window, torus, k) - value.re).abs() < 1e-13, "{k}: {value}");
        }
    }

    /// Clipping: no value stays negative, every ring keeps its power, and the total is the stated variance. By hand on a torus of 4 x 4: the mode
    /// (1, 1) and its mirror images are alone in ring 1 with those on the axes.
    #[test]
    fn val_clipping_keeps_the_power_of_rings() {
        let value = |k: i32| Complex64::new(if k == 5 { -0.5 } else { 1.0 + 0.1 * f64::from(k) }, 0.0);
        let values = (0..12).map(value).collect();
        let mut spectrum = HalfSpectrum { rows: 4, cols: 4, values };
        let before = spectrum.clone();
        let share = clip(&mut spectrum, 3.0, [1.0; 2]);
        let sum = |s: &HalfSpectrum, of: &dyn Fn(usize) -> bool| -> f64 {
            (0..12).filter(|k| of(*k)).map(|k| times([4, 4], k) * s.values[k].re).sum()
        };
        assert!(spectrum.values.iter().all(|v| v.re >= 0.0) && spectrum.values[5].re == 0.0);
        assert!((sum(&spectrum, &|_| true) / 16.0 - 3.0).abs() < 1e-12);
        // The mode is one of two equal ones: its share of all sizes.
        let sizes: f64 = (0..12).map(|k| times([4, 4], k) * before.values[k].re.abs()).sum();
        assert!((share - 2.0 * 0.5 / sizes).abs() < 1e-15, "{share}");
        let scale = 3.0 * 16.0 / sum(&before, &|_| true);
        for ring_of in 0..=2 {
            let own = |k: usize| ring([4, 4], [1.0; 2], k) == ring_of;
            let (was, is) = (sum(&before, &own), sum(&spectrum, &own));
            assert!((is - scale * was).abs() < 1e-12, "ring {ring_of}: {was} {is}");
        }
    }

    /// Background and texture of the residual together have the spectrum of the surface: `D^2 S + (1 - D^2) S`.
    #[test]
    fn prop_background_and_residual_add_up() {
        let surface = Covariance::new(model("exponential").unwrap(), 0.2, 0.3).unwrap();
        let (window, torus, cell_m) = (BoxWindow { half: [4, 3] }, [60, 48], [0.1, 0.12]);
        let all = density::spectrum(&surface, torus, cell_m);
        let residual = residual_spectrum(&surface, window, torus, cell_m);
        assert_eq!(residual.len(), all.values.len());
        for (k, (lacking, whole)) in residual.iter().zip(&all.values).enumerate() {
            let d = response(window, torus, k);
            assert!((lacking + d * d * whole.re - whole.re).abs() <= 1e-12 * whole.re.abs(), "{k}");
        }
        // The mean of the surface is all background.
        assert!(residual[0].abs() < 1e-15 * all.values[0].re);
    }
}
