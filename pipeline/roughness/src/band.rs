//! Roughness in a band: what a centred moving average leaves.
//!
//! The average of a cell runs over a window of odd width and height in cells, centred on it, over the cells with data;
//! it is defined for cells with data whose window is more than half full (cells beyond the edge count as empty). Running
//! sums along rows and then along columns make the cost independent of the window: a few additions a cell.

use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};

/// Share of the window that must hold data (exclusive).
const FILLED_SHARE_MIN: f64 = 0.5;

/// Odd number of cells nearest to `window_m / cell_m`, at least 1; beyond the whole numbers that a float can count, that
/// many.
pub fn odd_cells(window_m: f64, cell_m: f64) -> usize {
    let half = ((window_m / cell_m - 1.0) / 2.0).round().clamp(0.0, 1e9);
    2 * half as usize + 1
}

/// Centred moving average over `window` = (columns, rows) cells, both odd; NaN where undefined.
pub fn moving_average(dem: &Grid, window: [usize; 2]) -> Grid {
    average(dem, window, FILLED_SHARE_MIN)
}

/// As [`moving_average`], where more than `filled_share_min` of the window holds data.
pub(crate) fn average(dem: &Grid, window: [usize; 2], filled_share_min: f64) -> Grid {
    let (rows, cols) = (dem.rows(), dem.cols());
    let [half_cols, half_rows] = window.map(|w| w / 2);
    // Heights about their mean: running sums of a few metres lose less than those of a few thousand.
    let mean = sums::mean(&sums::finite(&dem.values));
    let mut totals = vec![(0.0, 0u32); rows * cols];
    totals.par_chunks_mut(cols).zip(dem.values.par_chunks(cols)).for_each(|(out, row)| {
        let values: Vec<(f64, u32)> =
            row.iter().map(|z| if z.is_finite() { (z - mean, 1) } else { (0.0, 0) }).collect();
        running_sums(&values, half_cols, out);
    });
    let by_col = transposed(&totals, rows, cols);
    totals.par_chunks_mut(rows).zip(by_col.par_chunks(rows)).for_each(|(out, col)| running_sums(col, half_rows, out));
    let totals = transposed(&totals, cols, rows);
    let filled_min = filled_share_min * (window[0] as f64 * window[1] as f64);
    let average = |(&(sum, count), z): (&(f64, u32), &f64)| {
        let defined = z.is_finite() && f64::from(count) > filled_min;
        if defined { mean + sum / f64::from(count) } else { f64::NAN }
    };
    Grid { geometry: dem.geometry, values: totals.iter().zip(&dem.values).map(average).collect() }
}

/// Sums over the values within `half` places, by differences of cumulative sums.
fn running_sums(values: &[(f64, u32)], half: usize, out: &mut [(f64, u32)]) {
    let mut cumulative = Vec::with_capacity(values.len() + 1);
    let mut so_far = (0.0, 0);
    cumulative.push(so_far);
    for (value, count) in values {
        so_far = (so_far.0 + value, so_far.1 + count);
        cumulative.push(so_far);
    }
    for (k, o) in out.iter_mut().enumerate() {
        let (low, high) = (cumulative[k.saturating_sub(half)], cumulative[(k + half + 1).min(values.len())]);
        *o = (high.0 - low.0, high.1 - low.1);
    }
}

/// The row-major `(rows, cols)` values with rows and columns exchanged.
pub(crate) fn transposed<T: Copy + Send + Sync>(values: &[T], rows: usize, cols: usize) -> Vec<T> {
    (0..cols).into_par_iter().flat_map_iter(|c| (0..rows).map(move |r| values[r * cols + c])).collect()
}

/// Standard deviation of the heights after a centred moving average is removed, and the true width of its window east
/// and north, both in m: the odd numbers of cells nearest to `window_m`. The deviation is NaN when the average is
/// defined nowhere.
pub fn band_rms(dem: &Grid, window_m: f64) -> (f64, [f64; 2]) {
    let cell = dem.geometry.cell;
    let window = cell.map(|c| odd_cells(window_m, c));
    let average = moving_average(dem, window);
    let residuals: Vec<f64> = dem.values.iter().zip(&average.values).map(|(z, a)| z - a).collect();
    let rms = sums::variance(&sums::finite(&residuals)).sqrt();
    (rms, [window[0] as f64 * cell[0], window[1] as f64 * cell[1]])
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

    fn direct(dem: &Grid, window: [usize; 2], row: usize, col: usize) -> f64 {
        let near = |k: usize, centre: usize, w: usize| k.abs_diff(centre) <= w / 2;
        let inside: Vec<f64> = (0..dem.values.len())
            .filter(|k| near(k / dem.cols(), row, window[1]) && near(k % dem.cols(), col, window[0]))
            .map(|k| dem.values[k])
            .collect();
        let data = sums::finite(&inside);
        let full = 2 * data.len() > window[0] * window[1] && dem.at(row, col).is_finite();
        if full { sums::mean(&data) } else { f64::NAN }
    }

    #[test]
    fn val_equals_brute_force_with_holes_and_edges() {
        for window in [[1, 1], [5, 3], [9, 9], [41, 3]] {
            let dem = noise(17, 23, 0.2);
            let average = moving_average(&dem, window);
            for r in 0..17 {
                for c in 0..23 {
                    let (fast, slow) = (average.at(r, c), direct(&dem, window, r, c));
                    let agree = (fast - slow).abs() < 1e-11 || fast.is_nan() && slow.is_nan();
                    assert!(agree, "{fast} {slow}");
                }
            }
        }
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

    #[test]
    fn val_odd_windows() {
        assert_eq!(
            [0.0, 0.1, 0.29, 0.3, 0.41, 0.5, -1.0, f64::NAN].map(|w| odd_cells(w, 0.1)),
            [1, 1, 3, 3, 5, 5, 1, 1]
        );
        assert!(odd_cells(f64::INFINITY, 0.1) > 1);
        assert!(band_rms(&Grid::filled(Geometry::square(3, 3, 1.0), f64::NAN), 3.0).0.is_nan());
    }
}
