//! Roughness in a band: what a background over a window leaves.
//!
//! The background of a cell is the mean of a centred window of odd width and height in cells, and at borders and holes, where
//! the window is partial, the least-squares plane through its cells ([`crate::background`]): the mean of a partial window is
//! off by slope times offset, which is no roughness. It is defined for cells with data whose window is more than half full
//! (cells beyond the edge count as empty). The cost is independent of the window: a few additions a cell.

use crate::background::{AtPartial, BoxWindow, background_of};
use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};

/// Share of the window that must hold data (exclusive).
pub(crate) const FILLED_SHARE_MIN: f64 = 0.5;

/// The row-major `(rows, cols)` values with rows and columns exchanged.
pub(crate) fn transposed<T: Copy + Send + Sync>(values: &[T], rows: usize, cols: usize) -> Vec<T> {
    (0..cols).into_par_iter().flat_map_iter(|c| (0..rows).map(move |r| values[r * cols + c])).collect()
}

/// Standard deviation of the heights after their background is removed, and the true width of its window east and north, both
/// in m: the odd numbers of cells nearest to `window_m`. The deviation is NaN when the background is defined nowhere.
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

    /// White noise of variance 1 less its average over w x w cells keeps `1 - 1 / w^2`. n = 300^2; the threshold of 6
    /// standard errors of a variance (0.0047 each, more for correlated residuals) has a false alarm rate below 1e-6 and
    /// catches 3 %.
    #[test]
    fn stat_band_of_white_noise() {
        let (rms, window) = band_rms(&noise(300, 300, 0.0), 0.5);
        assert!((window[0] - 0.5).abs() < 1e-12);
        assert!((rms * rms / (1.0 - 1.0 / 25.0) - 1.0).abs() < 0.03, "{rms}");
    }

    /// The band RMS of a slope of 100 % in any direction, with scattered holes and a block of them, is that of level ground to
    /// 1e-9. A mean of partial windows, 3 cells off their centre at a border, makes it several times as large.
    #[test]
    fn val_slopes_leave_the_band_as_it_is() {
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

    #[test]
    fn val_hollow_grids_have_no_band() {
        for window_m in [3.0, f64::INFINITY] {
            assert!(band_rms(&Grid::filled(Geometry::square(3, 3, 1.0), f64::NAN), window_m).0.is_nan());
        }
        assert!(band_rms(&noise(20, 20, 0.0), f64::INFINITY).0.is_nan());
    }
}
