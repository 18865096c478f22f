//! Heights and gradients at arbitrary points of a grid.

use crate::grid::Grid;

/// A surface z(x, y) defined on part of the plane.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Surface};
///
/// // Rows run from north to south: this plane rises by 1 m per metre to the east and by 2 m per metre to the north.
/// let plane = Grid::new(Geometry::square(2, 2, 1.0), vec![2.0, 3.0, 0.0, 1.0]);
/// assert_eq!(plane.height_and_gradient(1.0, 1.0), Some((1.5, 1.0, 2.0)));
/// // Beyond the outer cell centres, the surface is undefined.
/// assert_eq!(plane.height(0.25, 1.0), None);
/// ```
pub trait Surface {
    /// Height in m at the point, or `None` where undefined (outside, or next to a cell without data).
    fn height(&self, x: f64, y: f64) -> Option<f64>;

    /// Height and its derivatives `(z, dz/dx, dz/dy)` at the point, or `None` where undefined.
    fn height_and_gradient(&self, x: f64, y: f64) -> Option<(f64, f64, f64)>;
}

/// Bilinear between cell centres; undefined beyond the outer centres.
impl<T: Copy + Into<f64>> Surface for Grid<T> {
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        self.height_and_gradient(x, y).map(|(z, _, _)| z)
    }

    fn height_and_gradient(&self, x: f64, y: f64) -> Option<(f64, f64, f64)> {
        let g = &self.geometry;
        if g.rows < 2 || g.cols < 2 {
            return None;
        }
        // Position in cells from the south-west cell centre.
        let u = (x - g.origin[0]) / g.cell[0] - 0.5;
        let v = (y - g.origin[1]) / g.cell[1] - 0.5;
        let (last_u, last_v) = ((g.cols - 1) as f64, (g.rows - 1) as f64);
        if !(u >= 0.0 && v >= 0.0 && u <= last_u && v <= last_v) {
            return None;
        }
        let i = (u as usize).min(g.cols - 2);
        let j = (v as usize).min(g.rows - 2);
        let (fx, fy) = (u - i as f64, v - j as f64);
        let south = (g.rows - 1 - j) * g.cols + i;
        let north = south - g.cols;
        let [sw, se, nw, ne]: [f64; 4] = [south, south + 1, north, north + 1].map(|k| self.values[k].into());
        let (low, high) = (sw + (se - sw) * fx, nw + (ne - nw) * fx);
        let z = low + (high - low) * fy;
        let dx = ((se - sw) * (1.0 - fy) + (ne - nw) * fy) / g.cell[0];
        let dy = (high - low) / g.cell[1];
        z.is_finite().then_some((z, dx, dy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Geometry;

    #[test]
    fn val_bilinear_is_exact_on_a_saddle() {
        let g = Geometry { rows: 7, cols: 5, cell: [0.5, 0.25], origin: [3.0, -2.0] };
        let f = |x: f64, y: f64| 1.0 + 2.0 * x - 3.0 * y + 0.5 * x * y;
        let values = (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| f(g.x(c), g.y(r)))).collect();
        let grid = Grid::new(g, values);
        let (x, y) = (4.1, -1.1);
        let (z, dx, dy) = grid.height_and_gradient(x, y).unwrap();
        assert!((z - f(x, y)).abs() < 1e-12);
        assert!((dx - (2.0 + 0.5 * y)).abs() < 1e-12);
        assert!((dy - (-3.0 + 0.5 * x)).abs() < 1e-12);
    }

    #[test]
    fn val_undefined_beyond_outer_centres_and_next_to_no_data() {
        let mut grid = Grid::filled(Geometry::square(4, 4, 1.0), 1.0);
        assert_eq!(grid.height(0.49, 2.0), None);
        assert_eq!(grid.height(3.5, 3.5), Some(1.0));
        grid.values[0] = f64::NAN;
        assert_eq!(grid.height(0.6, 3.4), None);
        assert_eq!(grid.height(1.6, 3.4), Some(1.0));
        assert_eq!(grid.height(f64::NAN, 1.0), None);
    }

    /// A saddle looks the same from every cell, so it does not tell which four centres are used; these heights do. Computed by hand.
    #[test]
    fn val_interpolates_between_the_four_nearest_centres() {
        let g = Geometry { rows: 3, cols: 3, cell: [2.0, 1.0], origin: [10.0, 100.0] };
        let grid = Grid::new(g, vec![0.0, 1.0, 4.0, 9.0, 16.0, 25.0, 36.0, 49.0, 64.0]);
        assert_eq!(grid.height_and_gradient(12.0, 102.25), Some((3.5, 1.25, -12.0)));
        assert_eq!(grid.height_and_gradient(14.0, 100.75), Some((47.5, 6.75, -36.0)));
        let corners = [(11.0, 102.5, 0.0), (15.0, 102.5, 4.0), (11.0, 100.5, 36.0), (15.0, 100.5, 64.0)];
        corners.iter().for_each(|(x, y, z)| assert_eq!(grid.height(*x, *y), Some(*z)));
        for (x, y) in [(10.99, 101.5), (15.01, 101.5), (13.0, 102.51), (13.0, 100.49)] {
            assert_eq!(grid.height(x, y), None, "{x} {y}");
        }
        let row = Grid::filled(Geometry::square(1, 3, 1.0), 1.0);
        let column = Grid::filled(Geometry::square(3, 1, 1.0), 1.0);
        assert_eq!((row.height(1.5, 0.5), column.height(0.5, 1.5)), (None, None));
    }
}
