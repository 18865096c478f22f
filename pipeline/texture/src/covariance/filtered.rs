//! Effect of the moving average on a covariance.
//!
//! The residual of cell i is `z(i) - sum of D_i(j) z(j)` over the offsets j of its window, with `D_i(j) = m(i + j) / n(i)`
//! ([`sastrugi_roughness::background`]). For a stationary field with covariance C the residuals of the cells i and i + h have
//!
//! `C(h) - sum of D_i(j) C(h - j) - sum of D_(i+h)(k) C(h + k) + sum of D_i(j) D_(i+h)(k) C(h + k - j)`.
//!
//! * Complete windows: D is the same everywhere, and the covariance is `IDFT[ DFT(C) (1 - D)^2 ]`, exact at every lag
//!   on a torus so large that no lag wraps around.
//! * Partial windows (border, holes): the difference of the expression above from its value with complete windows,
//!   averaged over the pairs of each lag bin. It depends on the lag and cannot be computed from the average window: with a window
//!   of two ranges that would leave an error of 0.2 % of the variance at the larger lags, and of 7 % in b. The average is
//!   taken over pairs and offsets of a fixed low-discrepancy sequence (Kronecker with powers of the generalised golden
//!   ratio: Roberts, 2018) and stored as weights of C by lag, so that it is computed once and applied to any model.

use super::Covariance;
use super::lag::lag_m;
use crate::noise::Noise;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, smooth_length};
use sastrugi_roughness::background::BoxWindow;
use std::f64::consts::PI;

/// Largest lag at which a residual's covariance matters, windows.
const REACH_WINDOWS: f64 = 1.5;

/// How a surface was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Standard deviation of the Gaussian point spread function that blurs the surface, m; 0 for none.
    pub inner_scale_m: f64,
    /// Noise that the measurement adds.
    pub noise: Noise,
}

/// Passes covariances through measurement and detrending, on a torus.
pub struct DetrendFilter {
    shape: [usize; 2],
    cell_m: [f64; 2],
    /// Largest lags, cells.
    reach: [usize; 2],
    measurement: Measurement,
    /// Covariance of the measurement noise.
    noise: LagField,
    fft: RealFft2,
    /// `(1 - D)^2` of complete windows, in the order of a half spectrum.
    response: Vec<f64>,
}

/// A covariance (or any even function of the lag) on a torus.
pub struct LagField {
    shape: [usize; 2],
    /// All rows of the torus, or the first ones.
    values: Vec<f64>,
}

impl LagField {
    /// Value at a lag in cells, whose row must be there.
    pub fn at(&self, lag: [isize; 2]) -> f64 {
        let [row, col] = [0, 1].map(|k| wrapped(lag[k], self.shape[k]));
        self.values[row * self.shape[1] + col]
    }

    /// The field with `f` applied to every value.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        self.map_all(|values| values.iter().map(|v| f(*v)).collect())
    }

    /// The field with `f` applied to all values at once.
    pub fn map_all(&self, f: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        Self { shape: self.shape, values: f(&self.values) }
    }
}

/// The place of a lag on a torus of `cells`.
fn wrapped(lag: isize, cells: usize) -> usize {
    let place = if lag < 0 { lag + cells as isize } else { lag };
    // Nearly all lags are shorter than the torus, and a remainder takes longer than all the rest of a look-up.
    if (0..cells as isize).contains(&place) { place as usize } else { lag.rem_euclid(cells as isize) as usize }
}

impl DetrendFilter {
    /// The filter for lags up to `max_lag` cells.
    pub fn new(window: BoxWindow, cell_m: [f64; 2], max_lag: [usize; 2], measurement: Measurement) -> Self {
        let width = window.cells();
        // Profiles have one row, and lags along it only.
        let side = |k: usize| smooth_length(2 * (max_lag[k] + width[k].max(max_lag[k])));
        let shape = [0, 1].map(|k| if width[k] == 1 && max_lag[k] == 0 { 1 } else { side(k) });
        let fft = RealFft2::new(shape[0], shape[1]);
        let response = fft.forward(&complete_window(window, shape)).values.iter().map(|s| s.norm_sqr()).collect();
        let noise = LagField { shape, values: torus_covariance(shape, cell_m, &measurement.noise.covariance()) };
        Self { shape, cell_m, reach: max_lag, measurement, noise, fft, response }
    }

    /// The filter for lags up to `max_lag` cells, but at least for all lags at which residuals are correlated: beyond one and a half
    /// windows they hardly are, whatever the surface.
    pub fn wide(window: BoxWindow, cell_m: [f64; 2], max_lag: [usize; 2], measurement: Measurement) -> Self {
        let width = window.cells();
        // Profiles have one row.
        let reach = |k: usize| if width[k] == 1 { 0 } else { (REACH_WINDOWS * width[k] as f64) as usize };
        let reach = [0, 1].map(|k| max_lag[k].max(reach(k)));
        Self { reach, ..Self::new(window, cell_m, reach, measurement) }
    }

    /// How the surface was measured.
    pub fn measurement(&self) -> Measurement {
        self.measurement
    }

    /// Covariance of the measured surface.
    pub fn measured_covariance(&self, model: &Covariance) -> LagField {
        let mut values = torus_covariance(self.shape, self.cell_m, model);
        if self.measurement.inner_scale_m > 0.0 {
            let mut spectrum = self.fft.forward(&values);
            blur(&mut spectrum, self.cell_m, self.measurement.inner_scale_m);
            values = self.fft.inverse(spectrum);
        }
        values.iter_mut().zip(&self.noise.values).for_each(|(own, noise)| *own += noise);
        LagField { shape: self.shape, values }
    }

    /// Covariance of the residual, set to 0 beyond the filter's largest lags, where different lags coincide on the torus.
    pub fn residual_within_reach(&self, measured: &LagField) -> LagField {
        let mut residual = self.residual_covariance(measured);
        let beyond = |k: usize, place: usize| place.min(self.shape[k] - place) > self.reach[k];
        for (k, value) in residual.values.iter_mut().enumerate() {
            if beyond(0, k / self.shape[1]) || beyond(1, k % self.shape[1]) {
                *value = 0.0;
            }
        }
        residual
    }

    /// Covariance of the measurement noise in the residual, for complete windows.
    pub fn residual_noise(&self) -> LagField {
        self.residual_covariance(&self.noise)
    }

    /// Covariance of the residual of a field with the covariance `measured`, for complete windows.
    pub fn residual_covariance(&self, measured: &LagField) -> LagField {
        self.residual_rows(measured, self.shape[0])
    }

    /// The same for lags of 0 to `rows - 1` cells southwards only.
    pub fn residual_rows(&self, measured: &LagField, rows: usize) -> LagField {
        let mut spectrum = self.fft.forward(&measured.values);
        spectrum.values.iter_mut().zip(&self.response).for_each(|(s, a)| *s = Complex64::new(s.re * a, 0.0));
        LagField { shape: self.shape, values: self.fft.inverse_rows(spectrum, rows) }
    }

    /// `IDFT[DFT(field)^2]`: sum over u of `field(u) field(u + h)`.
    pub fn autocorrelation(&self, field: &LagField) -> LagField {
        let mut spectrum = self.fft.forward(&field.values);
        spectrum.values.iter_mut().for_each(|s| *s = Complex64::new(s.norm_sqr(), 0.0));
        LagField { shape: self.shape, values: self.fft.inverse(spectrum) }
    }
}

/// Multiplies a power spectrum by the effect of a Gaussian point spread function of standard deviation `s`: `exp(-(2 pi f s)^2)`, f in
/// cycles per m. The spectrum is that of a grid, so that a spread below half a cell blurs slightly less than this.
pub(crate) fn blur(spectrum: &mut HalfSpectrum, cell_m: [f64; 2], spread_m: f64) {
    let (rows, cols) = (spectrum.rows, spectrum.cols);
    let angle = |k: usize, n: usize, cell: f64| 2.0 * PI * k.min(n - k) as f64 / (n as f64 * cell) * spread_m;
    for (k, value) in spectrum.values.iter_mut().enumerate() {
        let (x, y) = (angle(k / rows, cols, cell_m[0]), angle(k % rows, rows, cell_m[1]));
        *value *= libm::exp(-(x * x + y * y));
    }
}

/// A covariance on a torus of `shape` cells, each lag taken the shorter way around.
pub(crate) fn torus_covariance(shape: [usize; 2], cell_m: [f64; 2], model: &Covariance) -> Vec<f64> {
    let [rows, cols] = shape;
    let by_lag = model.by_lag();
    let is_symmetric = cell_m[0] == cell_m[1] && model.is_isotropic();
    let mut field = vec![0.0; rows * cols];
    for row in 0..=rows / 2 {
        let at = |col: isize| by_lag(lag_m([row as isize, col], cell_m));
        // A lag whose row and column are swapped is as long, to the last bit, and was stored with its row.
        let stored = if is_symmetric && 2 * row < cols { row } else { 0 };
        let swapped = (0..stored).map(|col| field[col * cols + row]);
        let east: Vec<f64> = swapped.chain((stored as isize..=cols as isize / 2).map(at)).collect();
        let west: Vec<f64> = match model.is_isotropic() {
            true => east.clone(),
            false => (0..=cols as isize / 2).map(|c| at(-c)).collect(),
        };
        let line: Vec<f64> = (0..cols)
            .map(|c| match (2 * c).cmp(&cols) {
                std::cmp::Ordering::Less => east[c],
                // Half way around, east and west coincide.
                std::cmp::Ordering::Equal => 0.5 * (east[c] + west[c]),
                std::cmp::Ordering::Greater => west[cols - c],
            })
            .collect();
        // The row at the same distance north has the opposite lags; half way around, both coincide.
        let opposite = (rows - row) % rows;
        for c in 0..cols {
            let mirrored = line[(cols - c) % cols];
            let value = if opposite == row { 0.5 * (line[c] + mirrored) } else { line[c] };
            field[row * cols + c] = value;
            field[opposite * cols + c] = if opposite == row { value } else { mirrored };
        }
    }
    field
}

/// The first `wanted` rows of the field of a real, even spectrum in the order of a half spectrum.
pub(super) fn inverse_real(fft: &RealFft2, [rows, cols]: [usize; 2], spectrum: &[f64], wanted: usize) -> Vec<f64> {
    let values = spectrum.iter().map(|&s| Complex64::new(s, 0.0)).collect();
    fft.inverse_rows(HalfSpectrum { rows, cols, values }, wanted)
}

/// The kernel `1 - D` of a complete window on the torus.
fn complete_window(window: BoxWindow, shape: [usize; 2]) -> Vec<f64> {
    let mut kernel = vec![0.0; shape[0] * shape[1]];
    let [hr, hc] = window.half.map(|h| h as isize);
    for offset in (-hr..=hr).flat_map(|r| (-hc..=hc).map(move |c| [r, c])) {
        let [row, col] = [0, 1].map(|k| offset[k].rem_euclid(shape[k] as isize) as usize);
        kernel[row * shape[1] + col] = -1.0 / window.area() as f64;
    }
    kernel[0] += 1.0;
    kernel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::Form;

    /// Every cell of an isotropic covariance has the bits of the model at its lag, on tori and cells of any shape.
    #[test]
    fn prop_a_torus_holds_the_model_itself() {
        for name in ["exponential", "matern+nugget", "exponential+gaussian", "self_affine"] {
            let model = Form::parse(name).unwrap().unit();
            for (shape, cell_m) in
                [([12, 12], [0.3; 2]), ([9, 16], [0.7; 2]), ([16, 9], [0.7; 2]), ([8, 10], [0.3, 0.7])]
            {
                for (k, value) in torus_covariance(shape, cell_m, &model).into_iter().enumerate() {
                    let lag = [k / shape[1], k % shape[1]];
                    let shorter = [0, 1].map(|axis| lag[axis].min(shape[axis] - lag[axis]) as isize);
                    let expected = model.at(lag_m(shorter, cell_m));
                    assert_eq!(value.to_bits(), expected.to_bits(), "{name}, {shape:?}, {lag:?}");
                }
            }
        }
    }

    /// Against the remainder itself, several times around.
    #[test]
    fn prop_lags_wrap_around() {
        for cells in 1..=9 {
            (-40..=40)
                .for_each(|lag| assert_eq!(wrapped(lag, cells), lag.rem_euclid(cells as isize) as usize, "{lag}"));
        }
    }
}
