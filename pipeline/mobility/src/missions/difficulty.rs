//! Difficulty of the ground under a mission's line or polyline, computed before the mission is driven.
//!
//! The line is sampled at the midpoints of equal intervals of at most half a cell. Class shares count these points; the slope
//! is that of the bilinear surface; the band RMS is the standard deviation of the heights minus their centred moving average
//! over a window (by default the wheelbase), at points where the complete window lies on the line. Cost: one height per point.

use super::Mission;
use sastrugi_numeric::{Grid, Surface, sums};
use sastrugi_schemas::RoughnessClass;

/// The ground under a mission's line; NaN where no point of the line has data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difficulty {
    /// Shares of the line over low, semi and high roughness; they sum to 1.
    pub shares: [f64; 3],
    /// Largest magnitude of the gradient.
    pub max_slope: f64,
    /// Standard deviation of the heights minus their moving average, m.
    pub band_rms_m: f64,
}

impl Difficulty {
    /// The ground of `dem` (heights, m) and `classes` (codes of [`RoughnessClass`], same geometry) under a mission; moving
    /// average over `window_m`.
    ///
    /// ```
    /// use sastrugi_mobility::missions::{Difficulty, Mission};
    /// use sastrugi_numeric::{Geometry, Grid};
    /// use sastrugi_schemas::RoughnessClass;
    ///
    /// // A slope of 1 : 4 to the east, of low roughness in the west and high roughness in the east.
    /// let geometry = Geometry::square(20, 40, 0.5);
    /// let dem = Grid::new(geometry, (0..geometry.len()).map(|k| 0.25 * geometry.x(k % 40)).collect());
    /// let code = |k: usize| if k % 40 < 20 { RoughnessClass::Low as u8 } else { RoughnessClass::High as u8 };
    /// let classes = Grid { geometry, values: (0..geometry.len()).map(code).collect() };
    /// let ground = Difficulty::along(&dem, &classes, &Mission::between(0, [5.0, 5.0], [15.0, 5.0]), 0.5);
    /// assert_eq!(ground.shares, [0.5, 0.0, 0.5]);
    /// assert!((ground.max_slope - 0.25).abs() < 1e-9 && ground.band_rms_m < 1e-9);
    /// ```
    pub fn along(dem: &Grid, classes: &Grid<u8>, mission: &Mission, window_m: f64) -> Self {
        let cell_m = dem.geometry.cell[0].min(dem.geometry.cell[1]);
        let intervals = (2.0 * mission.course_length_m() / cell_m).ceil().max(1.0);
        let points: Vec<[f64; 2]> =
            (0..intervals as usize).map(|k| mission.course_at((k as f64 + 0.5) / intervals)).collect();
        let surface: Vec<Option<(f64, f64, f64)>> =
            points.iter().map(|&[x, y]| dem.height_and_gradient(x, y)).collect();
        let slopes = surface.iter().flatten().map(|&(_, dx, dy)| (dx * dx + dy * dy).sqrt());
        let heights: Vec<f64> = surface.iter().map(|s| s.map_or(f64::NAN, |(z, ..)| z)).collect();
        let half = (0.5 * window_m * intervals / mission.course_length_m()).round() as usize;
        Self {
            shares: shares(classes, &points),
            max_slope: slopes.fold(f64::NAN, f64::max),
            band_rms_m: band_rms(&heights, half),
        }
    }
}

fn shares(classes: &Grid<u8>, points: &[[f64; 2]]) -> [f64; 3] {
    let mut counts = [0.0; 3];
    for class in points.iter().filter_map(|&[x, y]| class_at(classes, x, y)) {
        counts[class as usize] += 1.0;
    }
    let all: f64 = counts.iter().sum();
    counts.map(|count| count / all)
}

/// The class of the cell that contains a point; `None` off the map or without data.
pub(crate) fn class_at(classes: &Grid<u8>, x: f64, y: f64) -> Option<RoughnessClass> {
    let (row, col) = classes.geometry.cell_at(x, y)?;
    RoughnessClass::from_code(classes.at(row, col))
}

/// Standard deviation of the heights minus their mean over `2 half + 1` neighbours, where all of these are known.
fn band_rms(heights: &[f64], half: usize) -> f64 {
    let less_mean = |window: &[f64]| window[half] - sums::mean(window);
    let residuals: Vec<f64> = sums::finite(&heights.windows(2 * half + 1).map(less_mean).collect::<Vec<_>>());
    let mean = sums::mean(&residuals);
    sums::mean(&residuals.iter().map(|r| (r - mean) * (r - mean)).collect::<Vec<_>>()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;
    use std::f64::consts::{FRAC_1_SQRT_2, TAU};

    fn grid(height: impl Fn(f64, f64) -> f64) -> Grid {
        let geometry = Geometry::square(200, 400, 0.05);
        let value = |k: usize| height(geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
        Grid { geometry, values: (0..geometry.len()).map(value).collect() }
    }

    fn classes(of: impl Fn(f64) -> u8) -> Grid<u8> {
        let geometry = Geometry::square(200, 400, 0.05);
        Grid { geometry, values: (0..geometry.len()).map(|k| of(geometry.x(k % geometry.cols))).collect() }
    }

    #[test]
    fn val_shares_and_slope_of_a_plane() {
        let mission = Mission::between(0, [2.0, 5.0], [18.0, 5.0]);
        let map = classes(|x| if x < 6.0 { 0 } else { u8::from(x > 10.0) + 1 });
        let d = Difficulty::along(&grid(|x, y| 0.3 * x + 0.4 * y), &map, &mission, 0.5);
        for (found, expected) in d.shares.into_iter().zip([0.25, 0.25, 0.5]) {
            assert!((found - expected).abs() < 0.005, "{:?}", d.shares);
        }
        assert!((d.max_slope - 0.5).abs() < 1e-9 && d.band_rms_m < 1e-9);
        assert!((d.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    /// A wave with an integer number of periods in the window averages to zero, so its own standard deviation remains; the window
    /// of 33 half cells is 1/32 longer than the period, which adds 1.5 %. A window of 5 half cells takes almost all of it:
    /// `1 - sin(5 a) / (5 sin a)` = 3.8 % with a = pi / 32, less 1.4 % of that between the cells.
    #[test]
    fn val_band_of_a_wave() {
        let wave = grid(|x, _| 0.1 * libm::sin(TAU * x / 0.8));
        let mission = Mission::between(0, [2.0, 5.0], [18.0, 5.0]);
        let d = Difficulty::along(&wave, &classes(|_| 0), &mission, 0.8);
        assert!((d.band_rms_m / (0.1 * FRAC_1_SQRT_2) - 1.0155).abs() < 0.005, "{}", d.band_rms_m);
        let short = Difficulty::along(&wave, &classes(|_| 0), &mission, 0.1).band_rms_m;
        assert!((short / 0.002_666 - 1.0).abs() < 0.02, "{short}");
    }

    /// A polyline is sampled along its length: east in the plane's steepest direction, then north along its contour.
    #[test]
    fn val_difficulty_along_a_polyline() {
        let line = crate::missions::Polyline::new(&[[2.0, 2.0], [10.0, 2.0], [10.0, 8.0]]).unwrap();
        let map = classes(|x| if x < 6.0 { 0 } else { 2 });
        let d = Difficulty::along(&grid(|x, _| 0.3 * x), &map, &Mission::along(0, line), 0.5);
        for (found, expected) in d.shares.into_iter().zip([4.0 / 14.0, 0.0, 10.0 / 14.0]) {
            assert!((found - expected).abs() < 0.005, "{:?}", d.shares);
        }
        assert!((d.max_slope - 0.3).abs() < 1e-9);
    }

    #[test]
    fn val_difficulty_off_the_terrain_is_nan() {
        let mission = Mission::between(0, [100.0, 5.0], [110.0, 5.0]);
        let d = Difficulty::along(&grid(|_, _| 0.0), &classes(|_| 0), &mission, 0.5);
        assert!(d.shares[0].is_nan() && d.max_slope.is_nan() && d.band_rms_m.is_nan());
    }
}
