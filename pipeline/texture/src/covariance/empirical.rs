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
    let responses = Responses::new(window, torus);
    if map.base == "surface" {
        let factor = |d: f64| match purpose {
            Purpose::Surface => 1.0,
            Purpose::Residual => lacking(d),
        };
        let values = measured.values.iter().zip(responses.iter()).map(|(v, d)| v.re * factor(d)).collect();
        return Composition { values, clip_share, continued_share: 0.0 };
    }
    // Waves much shorter than the window, which nearly all are, take nothing from the model.
    let needs_model = |kx: usize, ky: usize| left(responses.at(kx, ky)) < NEXT;
    let continuation = density::eigenvalues(model, torus, cell_m, needs_model);
    // The model gives the shape of the continuation, the adjacent measured waves its level.
    let [mut own, mut models] = [0.0; 2];
    for (k, d) in responses.iter().enumerate().filter(|(_, d)| (FLOOR..NEXT).contains(&left(*d))) {
        own += times(torus, k) * measured.values[k].re / left(d);
        models += times(torus, k) * continuation[k].max(0.0);
    }
    let level = if own > 0.0 && models > 0.0 { own / models } else { 1.0 };
    let (mut values, mut shares) = (Vec::with_capacity(continuation.len()), [0.0; 2]);
    for (k, d) in responses.iter().enumerate() {
        let is_measured = left(d) >= FLOOR;
        let surface = match is_measured {
            true => measured.values[k].re / left(d),
            false => continuation[k].max(0.0) * level,
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
    let mut values = density::eigenvalues(model, torus, cell_m, |_, _| true);
    values.iter_mut().zip(Responses::new(window, torus).iter()).for_each(|(v, d)| *v *= lacking(d));
    values
}

/// `(1 - D)^2`, the share of power that the background leaves in the residual.
fn left(response: f64) -> f64 {
    (1.0 - response) * (1.0 - response)
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

/// Responses of the window mean at the modes of a half spectrum: a factor for the row frequency, and one for the column frequency.
struct Responses {
    down: Vec<f64>,
    across: Vec<f64>,
}

impl Responses {
    fn new(window: BoxWindow, [rows, cols]: [usize; 2]) -> Self {
        let [down, across] = window.cells();
        Self {
            down: (0..rows).map(|k| mean_of_cosine(down, k, rows)).collect(),
            across: (0..=cols / 2).map(|k| mean_of_cosine(across, k, cols)).collect(),
        }
    }

    /// At one mode.
    fn at(&self, kx: usize, ky: usize) -> f64 {
        self.down[ky] * self.across[kx]
    }

    /// At every mode, in the order of a half spectrum.
    fn iter(&self) -> impl Iterator<Item = f64> {
        self.across.iter().flat_map(move |across| self.down.iter().map(move |down| down * across))
    }
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
    use crate::covariance::filtered::inverse_real;
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
        let responses = Responses::new(window, torus);
        assert_eq!(responses.iter().count(), 12 * 6);
        for (k, (value, found)) in spectrum.values.iter().zip(responses.iter()).enumerate() {
            assert!((found - value.re).abs() < 1e-13, "{k}: {found} {value}");
            assert_eq!(found, responses.at(k / 12, k % 12), "{k}");
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
        let responses = Responses::new(window, torus);
        for (k, ((lacking, whole), d)) in residual.iter().zip(&all.values).zip(responses.iter()).enumerate() {
            assert!((lacking + d * d * whole.re - whole.re).abs() <= 1e-12 * whole.re.abs(), "{k}");
        }
        // The mean of the surface is all background.
        assert!(residual[0].abs() < 1e-15 * all.values[0].re);
    }

    /// The covariance of a residual at lags of up to 13 x 10 cells of 0.1 m: 1.5 windows of 9 x 7 cells.
    fn measured() -> CovarianceMap {
        let at = |(r, c): (isize, isize)| {
            let distance_m = 0.1 * ((r * r + c * c) as f64).sqrt();
            0.04 * (libm::exp(-distance_m / 0.25) - 0.03)
        };
        let lags = (0..=13).flat_map(|r| (-10..=10).map(move |c| (r, c)));
        let (base, model) = ("residual".to_owned(), "exponential".to_owned());
        CovarianceMap { base, model, max_lag: [13, 10], covariance_m2: lags.map(at).collect() }
    }

    /// The spectrum with the model's eigenvalue at every mode, mode by mode.
    fn of_every_mode(model: &Covariance, window: BoxWindow, purpose: Purpose, torus: [usize; 2]) -> Vec<f64> {
        let map = measured();
        let mut own = RealFft2::new(torus[0], torus[1]).forward(&on_torus(&map, torus));
        clip(&mut own, map.covariance_m2[map.max_lag[1]], [0.1; 2]);
        let model = density::spectrum(model, torus, [0.1; 2]);
        let [down, across] = window.cells();
        let response =
            |k: usize| mean_of_cosine(down, k % torus[0], torus[0]) * mean_of_cosine(across, k / torus[0], torus[1]);
        let mut sums = [0.0; 2];
        for k in 0..own.values.len() {
            let left = (1.0 - response(k)) * (1.0 - response(k));
            if (FLOOR..NEXT).contains(&left) {
                sums[0] += times(torus, k) * own.values[k].re / left;
                sums[1] += times(torus, k) * model.values[k].re.max(0.0);
            }
        }
        let level = sums[0] / sums[1];
        let value = |k: usize| {
            let d = response(k);
            let left = (1.0 - d) * (1.0 - d);
            let surface = if left >= FLOOR { own.values[k].re / left } else { model.values[k].re.max(0.0) * level };
            surface * if purpose == Purpose::Residual { 1.0 - d * d } else { 1.0 }
        };
        (0..own.values.len()).map(value).collect()
    }

    /// A model is used at few modes, and computed only there: no bit changes, be its range short or long against the torus.
    #[test]
    fn prop_a_model_where_it_is_used_changes_no_bit() {
        let window = BoxWindow { half: [4, 3] };
        for (name, range_m) in [("exponential", 0.2), ("exponential", 30.0), ("gaussian", 0.4)] {
            let model = Covariance::new(model(name).unwrap(), 0.3, range_m).unwrap();
            for (purpose, torus) in [(Purpose::Surface, [60, 48]), (Purpose::Residual, [61, 45])] {
                let found = spectrum(&measured(), &model, window, purpose, torus, [0.1; 2]);
                let expected = of_every_mode(&model, window, purpose, torus);
                assert_eq!(found.values.len(), expected.len());
                assert!(found.continued_share > 0.0 && found.continued_share < 1.0, "{}", found.continued_share);
                for (k, (found, expected)) in found.values.iter().zip(&expected).enumerate() {
                    assert_eq!(found.to_bits(), expected.to_bits(), "{name}, {range_m} m, {purpose:?}: {k}");
                }
            }
        }
    }

    /// What a background lacks of an exponential of two and of twenty windows (of nine cells) is correlated far beyond the window: at four windows -0.62 and 2.7 %
    /// of its variance, in closed form (the covariance less its mean over the differences of two places in the window). On a torus of 16 windows lags of
    /// up to half of it, those of a texture that is cropped from it, err by 0.13 and 2.5 % of the variance; lags of a crop that left only 1.5 windows, the
    /// reach of a measured covariance, would err by 2.1 and 7.3 %. The errors are from numpy, to three digits.
    #[test]
    fn val_what_a_background_lacks_reaches_beyond_the_window() {
        let (cell_m, n, reach) = (0.1, 144, 13);
        for (range_m, at_four_windows, to_half, beyond) in
            [(1.8, -0.00616, 0.001319, 0.02133), (18.0, 0.0266, 0.02549, 0.07308)]
        {
            let surface = Covariance::new(model("exponential").unwrap(), 1.0, range_m).unwrap();
            let weight = |j: isize| (9 - j.abs()) as f64 / 81.0;
            let lacked = |lag: isize| {
                let offsets = (-8..=8).flat_map(|r| (-8..=8).map(move |c| (r, c)));
                let kept = offsets
                    .map(|(r, c)| weight(r) * weight(c) * surface.at([cell_m * (lag + c) as f64, cell_m * r as f64]));
                surface.at([cell_m * lag as f64, 0.0]) - kept.sum::<f64>()
            };
            let variance_m2 = lacked(0);
            let tail = lacked(36) / variance_m2;
            assert!((tail / at_four_windows - 1.0).abs() < 0.01, "{range_m} m: {tail}");
            let values = residual_spectrum(&surface, BoxWindow { half: [4, 4] }, [n, n], [cell_m; 2]);
            let along = inverse_real(&RealFft2::new(n, n), [n, n], &values, 1);
            let error = |last: usize| {
                let errors = (0..=last).map(|k| (along[k] - lacked(k as isize)).abs() / variance_m2);
                errors.fold(0.0, f64::max)
            };
            let found = [error(n / 2), error(n - reach)];
            for (found, expected) in found.into_iter().zip([to_half, beyond]) {
                assert!((found / expected - 1.0).abs() < 0.01, "{range_m} m: {found} {expected}");
            }
        }
    }
}
