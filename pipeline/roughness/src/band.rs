//! Band RMS: root mean square of the heights after a background over a window is subtracted.
//!
//! The background of a cell is the mean of a centred window, an odd number of cells wide and high. At borders and holes, where
//! the window is partial, it is the least-squares plane through the window's cells ([`crate::background`]): the mean of a
//! partial window is off by slope times offset, which would count as roughness. It is defined for cells with data whose window
//! is more than half full (cells beyond the edge count as empty). Cost: a few additions per cell, whatever the window.

use crate::background::{AtPartial, BoxWindow, background_of};
use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};

/// Share of the window that must hold data (exclusive).
pub(crate) const FILLED_SHARE_MIN: f64 = 0.5;

/// Transpose of row-major `(rows, cols)` values.
pub(crate) fn transposed<T: Copy + Send + Sync>(values: &[T], rows: usize, cols: usize) -> Vec<T> {
    (0..cols).into_par_iter().flat_map_iter(|c| (0..rows).map(move |r| values[r * cols + c])).collect()
}

/// Standard deviation of the heights after their background is removed, and the actual width of its window east and north, both
/// in m. The window is the odd number of cells nearest to `window_m` each way. The deviation is NaN if the background is
/// undefined everywhere.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::band_rms;
///
/// // A slope has no roughness; a ripple far shorter than the window keeps its own, the amplitude over the root of 2.
/// let geometry = Geometry::square(60, 60, 0.25);
/// let surface = |ripple_m: f64| {
///     let height = |k: usize| 0.5 * geometry.x(k % 60) + ripple_m * [0.0, 1.0, 0.0, -1.0][k % 60 % 4];
///     Grid::new(geometry, (0..3600).map(height).collect())
/// };
/// let (slope, window_m) = band_rms(&surface(0.0), 5.3);
/// assert!(slope < 1e-12);
/// assert_eq!(window_m, [5.25, 5.25]);
/// let (rippled, _) = band_rms(&surface(0.02), 5.3);
/// assert!((rippled / (0.02 / 2f64.sqrt()) - 1.0).abs() < 0.1);
/// ```
pub fn band_rms(dem: &Grid, window_m: f64) -> (f64, [f64; 2]) {
    let cell = dem.geometry.cell;
    let window = BoxWindow::nearest(window_m, cell);
    let background = background_of(dem, window, AtPartial::Plane, FILLED_SHARE_MIN);
    let residuals: Vec<f64> = dem.values.iter().zip(&background.values).map(|(z, m)| z - m).collect();
    (sums::variance(&sums::finite(&residuals)).sqrt(), window.size_m(cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn noise(rows: usize, cols: usize, hole_share: f64) -> Grid {
        let mut s = Streams::for_seed(1, "band-test").stream("noise");
        let mut value = || if s.uniform() < hole_share { f64::NAN } else { 1000.0 + s.normal() };
        Grid::new(Geometry::square(rows, cols, 0.1), (0..rows * cols).map(|_| value()).collect())
    }

    /// White noise of variance 1 minus its average over w x w cells has variance `1 - 1 / w^2`. n = 300^2; the threshold of 6
    /// standard errors of a variance (0.0047 each, more for correlated residuals) has a false-alarm rate below 1e-6 and
    /// catches 3 %.
    #[test]
    fn stat_band_of_white_noise() {
        let (rms, window) = band_rms(&noise(300, 300, 0.0), 0.5);
        assert!((window[0] - 0.5).abs() < 1e-12);
        assert!((rms * rms / (1.0 - 1.0 / 25.0) - 1.0).abs() < 0.03, "{rms}");
    }

    /// The band RMS on a slope of 100 % in any direction, with scattered holes and a block of them, equals that on level ground
    /// to 1e-9. The mean of partial windows, 3 cells off their centre at a border, makes it several times as large.
    #[test]
    fn val_a_slope_does_not_change_the_band_rms() {
        let mut level = noise(120, 150, 0.15);
        level.values.iter_mut().for_each(|z| *z = 1000.0 + 0.02 * (*z - 1000.0));
        (40..60).for_each(|r| level.values[r * 150 + 70..r * 150 + 110].fill(f64::NAN));
        let expected = band_rms(&level, 1.3).0;
        for azimuth_deg in [0.0f64, 45.0, 160.0, 270.0] {
            let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
            let g = level.geometry;
            let rise = |k: usize| sin * g.x(k % g.cols) + cos * g.y(k / g.cols);
            let steep = Grid::new(g, level.values.iter().enumerate().map(|(k, z)| z + rise(k)).collect());
            let found = band_rms(&steep, 1.3).0;
            assert!((found / expected - 1.0).abs() < 1e-9, "{azimuth_deg}: {found} {expected}");
            let mean = background_of(&steep, BoxWindow::nearest(1.3, g.cell), AtPartial::Mean, FILLED_SHARE_MIN);
            let left: Vec<f64> = steep.values.iter().zip(&mean.values).map(|(z, m)| z - m).collect();
            assert!(sums::variance(&sums::finite(&left)).sqrt() > 2.0 * expected, "{azimuth_deg}");
        }
    }

    /// A chessboard of +1 and -1 under a window of 3 x 3 cells. Inside, the mean is a ninth of the cell, so 8/9 are left; at a border the
    /// plane through 2 x 3 cells is the mean of the border's own three, minus a third of the cell, so 4/3 are left; a corner's window is
    /// 4/9 full, so corners are out.
    #[test]
    fn val_the_band_rms_of_a_chessboard() {
        let sign = |k: usize| if (k / 10 + k % 10).is_multiple_of(2) { 1.0 } else { -1.0 };
        let dem = Grid::new(Geometry::square(8, 10, 1.0), (0..80).map(sign).collect());
        let expected = ((48.0 * 64.0 / 81.0 + 28.0 * 16.0 / 9.0) / 76.0f64).sqrt();
        let (found, window) = band_rms(&dem, 3.0);
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        assert_eq!(window, [3.0, 3.0]);
    }

    /// A window of 1.2 m on cells of 0.5 x 0.25 m is 3 cells wide and 5 cells high.
    #[test]
    fn val_the_window_of_oblong_cells() {
        let g = Geometry { rows: 9, cols: 9, cell: [0.5, 0.25], origin: [0.0; 2] };
        let (rms, window) = band_rms(&Grid::filled(g, 1.0), 1.2);
        assert!(rms < 1e-12 && window == [1.5, 1.25], "{rms} {window:?}");
    }

    #[test]
    fn val_band_rms_without_data_or_with_an_infinite_window_is_nan() {
        for window_m in [3.0, f64::INFINITY] {
            assert!(band_rms(&Grid::filled(Geometry::square(3, 3, 1.0), f64::NAN), window_m).0.is_nan());
        }
        assert!(band_rms(&noise(20, 20, 0.0), f64::INFINITY).0.is_nan());
    }
}
