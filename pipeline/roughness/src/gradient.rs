//! Gradients between neighbouring cells.
//!
//! The Moore-neighbourhood gradient of a cell is `max |z_P - z_Q| / dist(P, Q)` over its eight neighbours Q, in m/m
//! (Majhor and Bos, Eq. 3 and 4, who give it in 16-bit levels per cm). It is the steepness between two cells, and on rough
//! ground exceeds the slope of a fitted plane. Cost: eight differences per cell.

use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};

/// Largest absolute gradient to the eight neighbours, m/m. Neighbours without data or beyond the edge are skipped; a cell
/// without data, or with no valid neighbour, is NaN.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let row = Grid::new(Geometry::square(1, 4, 0.5), vec![0.0, 1.0, 1.0, f64::NAN]);
/// let gradient = sastrugi_roughness::moore_gradient(&row);
/// assert_eq!(gradient.values[..3], [2.0, 2.0, 0.0]);
/// assert!(gradient.values[3].is_nan());
/// ```
pub fn moore_gradient(dem: &Grid) -> Grid {
    let (rows, cols) = (dem.rows(), dem.cols());
    let [east, north] = dem.geometry.cell;
    let per_metre = [1.0 / east, 1.0 / north, 1.0 / (east * east + north * north).sqrt()];
    let mut values = vec![f64::NAN; dem.values.len()];
    values.par_chunks_mut(cols).enumerate().for_each(|(r, out)| {
        let row = dem.row(r);
        steepen(out, &row[1..], row, per_metre[0]);
        steepen(&mut out[1..], row, &row[1..], per_metre[0]);
        for other in [r.checked_sub(1), Some(r + 1).filter(|&next| next < rows)].into_iter().flatten() {
            let other = dem.row(other);
            steepen(out, other, row, per_metre[1]);
            steepen(out, &other[1..], row, per_metre[2]);
            steepen(&mut out[1..], other, &row[1..], per_metre[2]);
        }
    });
    Grid { geometry: dem.geometry, values }
}

/// Raises each value of `steepest` to the gradient between `a` and `b`, up to the length of the shortest slice.
/// `f64::max` ignores a NaN operand, which skips cells without data.
fn steepen(steepest: &mut [f64], a: &[f64], b: &[f64], per_metre: f64) {
    for ((s, a), b) in steepest.iter_mut().zip(a).zip(b) {
        *s = s.max((a - b).abs() * per_metre);
    }
}

/// Root mean square gradient magnitude by central differences, m/m, over the cells whose four neighbours have data; NaN if
/// there are none.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let geometry = Geometry::square(5, 6, 0.5);
/// let plane = Grid::new(geometry, (0..30).map(|k| 3.0 * geometry.x(k % 6) + 4.0 * geometry.y(k / 6)).collect());
/// assert!((sastrugi_roughness::rms_slope(&plane) - 5.0).abs() < 1e-12);
/// ```
pub fn rms_slope(dem: &Grid) -> f64 {
    let (rows, cols) = (dem.rows(), dem.cols());
    if rows < 3 || cols < 3 {
        return f64::NAN;
    }
    let [east, north] = dem.geometry.cell.map(|cell| 0.5 / cell);
    let squares: Vec<f64> = (1..rows - 1)
        .into_par_iter()
        .flat_map_iter(|r| {
            let (above, row, below) = (dem.row(r - 1), dem.row(r), dem.row(r + 1));
            (1..cols - 1).map(move |c| {
                let (dx, dy) = ((row[c + 1] - row[c - 1]) * east, (above[c] - below[c]) * north);
                dx * dx + dy * dy
            })
        })
        .collect();
    sums::mean(&sums::finite(&squares)).sqrt()
}

/// Root mean square of the central differences along x and along y, m/m, over the same cells as [`rms_slope`].
pub fn rms_slopes(dem: &Grid) -> [f64; 2] {
    let (rows, cols) = (dem.rows(), dem.cols());
    if rows < 3 || cols < 3 {
        return [f64::NAN; 2];
    }
    let [east, north] = dem.geometry.cell.map(|cell| 0.5 / cell);
    let of_row = |r: usize| {
        let (above, row, below) = (dem.row(r - 1), dem.row(r), dem.row(r + 1));
        (1..cols - 1).fold([0.0; 3], |[x, y, n], c| {
            let (dx, dy) = ((row[c + 1] - row[c - 1]) * east, (above[c] - below[c]) * north);
            if (dx + dy).is_finite() { [x + dx * dx, y + dy * dy, n + 1.0] } else { [x, y, n] }
        })
    };
    let by_row: Vec<[f64; 3]> = (1..rows - 1).into_par_iter().map(of_row).collect();
    let total = |k: usize| sums::sum(&by_row.iter().map(|row| row[k]).collect::<Vec<_>>());
    [0, 1].map(|k| (total(k) / total(2)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn noise_with_holes(rows: usize, cols: usize) -> Grid {
        let geometry = Geometry { rows, cols, cell: [0.5, 0.8], origin: [0.0; 2] };
        let mut s = Streams::for_seed(1, "roughness-test").stream("noise");
        let value = |s: &mut sastrugi_numeric::Stream| if s.uniform() < 0.2 { f64::NAN } else { s.normal() };
        Grid::new(geometry, (0..rows * cols).map(|_| value(&mut s)).collect())
    }

    /// Reference: loop over cells and neighbours.
    fn direct(dem: &Grid, row: usize, col: usize) -> f64 {
        let mut steepest = f64::NAN;
        for r in row.saturating_sub(1)..=(row + 1).min(dem.rows() - 1) {
            for c in col.saturating_sub(1)..=(col + 1).min(dem.cols() - 1) {
                let g = &dem.geometry;
                if (r, c) == (row, col) {
                    continue;
                }
                let (dx, dy) = (g.x(c) - g.x(col), g.y(r) - g.y(row));
                let gradient = (dem.at(r, c) - dem.at(row, col)).abs() / (dx * dx + dy * dy).sqrt();
                if gradient.is_finite() && (steepest.is_nan() || steepest < gradient) {
                    steepest = gradient;
                }
            }
        }
        steepest
    }

    #[test]
    fn val_equals_the_neighbour_loop_with_holes_and_edges() {
        for (rows, cols) in [(13, 17), (1, 5), (5, 1), (1, 1), (2, 2)] {
            let dem = noise_with_holes(rows, cols);
            let gradient = moore_gradient(&dem);
            for r in 0..rows {
                for c in 0..cols {
                    let (fast, slow) = (gradient.at(r, c), direct(&dem, r, c));
                    let agree = (fast - slow).abs() < 1e-12 || fast.is_nan() && slow.is_nan();
                    assert!(agree, "{fast} {slow}");
                }
            }
        }
    }

    #[test]
    fn val_slopes_by_axis_add_up_to_the_slope() {
        let dem = noise_with_holes(30, 40);
        let [x, y] = rms_slopes(&dem);
        assert!(((x * x + y * y).sqrt() / rms_slope(&dem) - 1.0).abs() < 1e-12);
        assert!(rms_slopes(&dem.window(0, 0, 2, 9))[0].is_nan());
    }

    /// `z = x^2 / 2` on cells of 1 m, whose central difference is x. The four neighbours of a hole are left out; the hole itself counts,
    /// because its own four neighbours have data.
    #[test]
    fn val_slopes_beside_a_hole() {
        let g = Geometry::square(5, 6, 1.0);
        let mut dem = Grid::new(g, (0..30).map(|k| 0.5 * g.x(k % 6) * g.x(k % 6)).collect());
        dem.values[2 * 6 + 2] = f64::NAN;
        // Rows 1, 2 and 3, columns 1 to 4.
        let slopes: [f64; 8] = [1.5, 3.5, 4.5, 2.5, 4.5, 1.5, 3.5, 4.5];
        let expected = (slopes.iter().map(|s| s * s).sum::<f64>() / 8.0).sqrt();
        assert!((rms_slope(&dem) - expected).abs() < 1e-12, "{}", rms_slope(&dem));
        let [x, y] = rms_slopes(&dem);
        assert!((x - expected).abs() < 1e-12 && y == 0.0, "{x} {y}");
    }

    #[test]
    fn val_slope_of_a_plane() {
        let geometry = Geometry { rows: 6, cols: 9, cell: [0.5, 0.25], origin: [0.0; 2] };
        let plane = |k: usize| 0.3 * geometry.x(k % 9) - 0.4 * geometry.y(k / 9);
        let dem = Grid::new(geometry, (0..54).map(plane).collect());
        assert!((rms_slope(&dem) - 0.5).abs() < 1e-12);
        let [x, y] = rms_slopes(&dem);
        assert!((x - 0.3).abs() < 1e-12 && (y - 0.4).abs() < 1e-12);
        // The steepest gradient is the diagonal one: (0.3 * 0.5 + 0.4 * 0.25) / hypot(0.5, 0.25).
        let steepest = 0.25 / (0.5f64 * 0.5 + 0.25 * 0.25).sqrt();
        assert!((moore_gradient(&dem).at(3, 4) - steepest).abs() < 1e-12);
        assert!(rms_slope(&dem.window(0, 0, 2, 2)).is_nan());
    }
}
