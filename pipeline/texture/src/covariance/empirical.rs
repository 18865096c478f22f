//! The measured covariance of a residual by lag, and spectra made from it.
//!
//! From the data: the mean product of trimmed residuals at each lag (both of two opposite ones), through the inverse of what trimming
//! does to it ([`super::trimmed`]; no one factor undoes it), at lags up to [`REACH_WINDOWS`] windows.
//!
//! To a torus: every lag where it belongs, tapered by a cosine from one window on, transformed; what is negative is set to 0, each ring of
//! wavenumbers keeping its power, and all is scaled to the variance. With S the spectrum of the surface and D the response of the moving average this estimates
//! `S (1 - D)^2`. Two spectra are made of it:
//! * `residual`, what a measured background lacks: `S (1 - D^2) = P (1 + D) / (1 - D)`, so that background and texture together have S;
//! * `surface`: `S = P / (1 - D)^2`.
//!
//! Where `(1 - D)^2` is below [`FLOOR`] the background has taken nearly all, and what is left tells little: there the spectrum has the shape
//! of the fitted model's, at the level of the measured waves next to it.

use super::filtered::LagField;
use super::masked::MaskedCovariance;
use super::trimmed::TrimmedNormal;
use super::{Covariance, density};
use sastrugi_numeric::fft::{HalfSpectrum, RealFft2, smooth_length};
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::CovarianceMap;
use std::f64::consts::PI;

/// Largest lag of a measured covariance, windows.
pub const REACH_WINDOWS: f64 = 1.5;
/// Share of the largest lag from which on it is tapered: one window.
const TAPER_FROM: f64 = 1.0 / REACH_WINDOWS;
/// Share of a power spectrum that the background must leave for the measured one to be used.
const FLOOR: f64 = 0.1;
/// The same up to which measured waves set the level of what continues them.
const NEXT: f64 = 0.5;
/// Correlations at which the trimming map is computed.
const NODES: usize = 2048;

/// What a spectrum is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The surface.
    Surface,
    /// What a background over the window lacks of it.
    Residual,
}

/// A spectrum in the order of a half spectrum, m2, and what it is made of.
pub struct Composition {
    /// Eigenvalues, none below 0.
    pub values: Vec<f64>,
    /// Share of the measured spectrum that was negative and set to 0.
    pub clip_share: f64,
    /// Share of the variance that is the model's.
    pub continued_share: f64,
}

/// The covariance map of trimmed residuals; `normal` trims a unit normal as they were trimmed, `noise` is the covariance that the
/// measurement's noise has in the residual: it is no texture.
pub fn covariance_map(sums: &MaskedCovariance, normal: &TrimmedNormal, noise: &LagField, model: &str) -> CovarianceMap {
    let [rows, cols] = sums.max_lag.map(|l| l as isize);
    let untrimmed = Untrimmed::new(normal, sums.covariance(0, 0).unwrap_or(0.0));
    let value = |(r, c)| untrimmed.of(sums.covariance(r, c).unwrap_or(0.0)) - noise.at([r, c]);
    let lags = (0..=rows).flat_map(|r| (-cols..=cols).map(move |c| (r, c)));
    let (base, model) = ("residual".to_owned(), model.to_owned());
    CovarianceMap { base, model, max_lag: sums.max_lag, covariance_m2: lags.map(value).collect() }
}

/// The covariance of a residual as textures have it: that of the map without what was negative in its spectrum.
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

/// The inverse of what trimming does to a covariance.
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

/// Checks a map that was read.
///
/// # Errors
/// A base that is not known; values that are too few, too many or not finite; a variance that is not positive.
pub fn check(map: &CovarianceMap) -> Result<(), ParameterError> {
    let [rows, cols] = map.max_lag;
    let needed = (rows.saturating_add(1)).saturating_mul(cols.saturating_mul(2).saturating_add(1));
    if map.base != "residual" && map.base != "surface" {
        let message = format!("is `{}`; it is `residual` or `surface`", map.base);
        return Err(ParameterError::new("map.base", message));
    }
    if map.covariance_m2.len() != needed {
        let message =
            format!("holds {} values; lags up to {rows} x {cols} cells need {needed}", map.covariance_m2.len());
        return Err(ParameterError::new("map.covariance_m2", message));
    }
    if map.covariance_m2.iter().any(|c| !c.is_finite()) || map.covariance_m2[cols] <= 0.0 {
        return Err(ParameterError::new("map.covariance_m2", "must hold finite values and a variance above 0"));
    }
    Ok(())
}

/// The spectrum of a map on a torus of cells of the map.
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
    // The model gives the shape of what is continued, the measured waves next to it the level.
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

/// The spectrum of what a background over a window lacks of a model, on a torus.
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

/// 1 up to a window, from there a cosine to 0 just beyond the largest lag.
fn taper(lag: isize, max_lag: isize) -> f64 {
    let (lag, end) = (lag.unsigned_abs() as f64, max_lag as f64 + 1.0);
    let from = TAPER_FROM * end;
    if lag <= from { 1.0 } else { 0.5 + 0.5 * libm::cos(PI * (lag - from) / (end - from)) }
}

/// Sets negative eigenvalues to 0. Each ring of wavenumbers keeps its power: what scatter made negative here it made too large beside it, and
/// setting it to 0 alone would add short waves. All are scaled to a variance. The share that was negative.
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

/// How many modes of the whole spectrum one of the half stands for.
fn times([rows, cols]: [usize; 2], k: usize) -> f64 {
    let kx = k / rows;
    if kx == 0 || 2 * kx == cols { 1.0 } else { 2.0 }
}

/// Response of a window's mean at one mode of a half spectrum.
fn response(window: BoxWindow, [rows, cols]: [usize; 2], k: usize) -> f64 {
    let [down, across] = window.cells();
    mean_of_cosine(down, k % rows, rows) * mean_of_cosine(across, k / rows, cols)
}

/// Mean of a cosine of k waves over n cells in `width` cells about its crest.
fn mean_of_cosine(width: usize, k: usize, n: usize) -> f64 {
    if k == 0 {
        return 1.0;
    }
    let half_step = PI * k as f64 / n as f64;
    libm::sin(width as f64 * half_step) / (width as f64 * libm::sin(half_step))
}
