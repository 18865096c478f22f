//! Least-squares plane of a surface: the form removed before roughness is computed.
//!
//! `z = a + s_x (c - c_0) + s_y (r - r_0)` over the cells with data, centred on their mean row and column, solved from the
//! 2 x 2 normal equations. The plane is level if the cells lie on one line. Cost: two passes.

use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};

/// Residuals below this share of the largest height are rounding errors: the surface is a plane.
const ROUNDING: f64 = 1e-12;

/// `height + east (col - col_0) + north (row - row_0)`.
pub(crate) struct Plane {
    centre: [f64; 2],
    height: f64,
    slopes: [f64; 2],
}

impl Plane {
    /// Least-squares plane of the cells with data; level if they lie on one line.
    pub fn of(dem: &Grid) -> Self {
        let [n, col, row, height] = totals(dem, |col, row, z| [1.0, col, row, z]);
        let (centre, height) = ([col / n, row / n], height / n);
        let [uu, uv, vv, uz, vz] = totals(dem, |col, row, z| {
            let (u, v, z) = (col - centre[0], row - centre[1], z - height);
            [u * u, u * v, v * v, u * z, v * z]
        });
        let determinant = uu * vv - uv * uv;
        let solvable = determinant > 1e-12 * uu * vv;
        let slopes =
            if solvable { [(uz * vv - vz * uv) / determinant, (vz * uu - uz * uv) / determinant] } else { [0.0; 2] };
        Self { centre, height, slopes }
    }

    /// Height at a cell.
    pub fn at(&self, row: usize, col: usize) -> f64 {
        let [u, v] = [col as f64 - self.centre[0], row as f64 - self.centre[1]];
        self.height + self.slopes[0] * u + self.slopes[1] * v
    }
}

/// Sums of `terms(col, row, z)` over the cells with data: along each row, then over the rows.
fn totals<const N: usize>(dem: &Grid, terms: impl Fn(f64, f64, f64) -> [f64; N] + Sync) -> [f64; N] {
    let of_row = |r: usize| {
        let mut total = [0.0; N];
        for (c, &z) in dem.row(r).iter().enumerate().filter(|(_, z)| z.is_finite()) {
            let own = terms(c as f64, r as f64, z);
            total.iter_mut().zip(own).for_each(|(t, v)| *t += v);
        }
        total
    };
    let rows: Vec<[f64; N]> = (0..dem.rows()).into_par_iter().map(of_row).collect();
    std::array::from_fn(|k| sums::sum(&rows.iter().map(|row| row[k]).collect::<Vec<_>>()))
}

/// Heights above the least-squares plane; cells without data are NaN. A planar surface gives exact zeros.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::level;
///
/// let geometry = Geometry::square(4, 6, 0.5);
/// let slope = Grid::new(geometry, (0..24).map(|k| 7.0 + 0.1 * geometry.x(k % 6) - 0.3 * geometry.y(k / 6)).collect());
/// assert!(level(&slope).values.iter().all(|z| *z == 0.0));
/// ```
pub fn level(dem: &Grid) -> Grid {
    let plane = Plane::of(dem);
    let cols = dem.cols();
    let mut values = vec![f64::NAN; dem.values.len()];
    values.par_chunks_mut(cols).enumerate().for_each(|(r, out)| {
        for (c, (o, z)) in out.iter_mut().zip(dem.row(r)).enumerate().filter(|(_, (_, z))| z.is_finite()) {
            *o = z - plane.at(r, c);
        }
    });
    let largest = |values: &[f64]| values.iter().filter(|v| v.is_finite()).fold(0.0, |m: f64, v| m.max(v.abs()));
    if largest(&values) <= ROUNDING * largest(&dem.values) {
        values.iter_mut().filter(|v| v.is_finite()).for_each(|v| *v = 0.0);
    }
    Grid { geometry: dem.geometry, values }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    #[test]
    fn val_a_plane_with_holes_is_level() {
        let g = Geometry { rows: 30, cols: 20, cell: [0.5, 0.25], origin: [0.0; 2] };
        let mut dem = Grid::new(g, (0..600).map(|k| 1000.0 + 0.3 * g.x(k % 20) - 2.0 * g.y(k / 20)).collect());
        (0..600).step_by(7).for_each(|k| dem.values[k] = f64::NAN);
        let flat = level(&dem);
        assert_eq!(flat.finite_count(), dem.finite_count());
        assert!(flat.values.iter().all(|v| v.is_nan() || *v == 0.0));
    }

    /// The residual has zero mean and zero first moment along either axis.
    #[test]
    fn prop_residuals_are_orthogonal_to_planes() {
        let g = Geometry::square(40, 30, 1.0);
        let mut s = sastrugi_numeric::Streams::for_seed(1, "plane-test").stream("noise");
        let dem = Grid::new(g, (0..1200).map(|k| if k % 5 == 0 { f64::NAN } else { s.normal() + k as f64 }).collect());
        let left = level(&dem);
        let moment = |f: fn(usize) -> f64| -> f64 {
            let cells = left.values.iter().enumerate().filter(|(_, v)| v.is_finite());
            cells.map(|(k, v)| v * f(k)).sum()
        };
        for value in [moment(|_| 1.0), moment(|k| (k % 30) as f64), moment(|k| (k / 30) as f64)] {
            assert!(value.abs() < 1e-8, "{value}");
        }
        assert!(level(&Grid::filled(g, f64::NAN)).finite_count() == 0);
    }
}
