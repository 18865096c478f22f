//! Hillshade: how bright a surface is under one distant light.
//!
//! Brightness is `max(0, n . l)` with the surface normal `n = (-p, -q, 1) / sqrt(1 + p^2 + q^2)` and the unit vector `l`
//! towards the light. `p` (east) and `q` (north) are the 3 x 3 gradients of B. Horn, Hill shading and the reflectance
//! map, Proc. IEEE 69 (1981), times the exaggeration. The outermost cells take the gradient of their inner neighbours; a
//! neighbour without data counts as level with the centre.

use sastrugi_numeric::Grid;

/// Unit vector to the light: azimuth 315 degrees (north-west), altitude 45 degrees.
pub const LIGHT: [f64; 3] = [-0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2];

/// Root mean square slope at which relief is not exaggerated any further.
const STEEP_ENOUGH: f64 = 0.5;

/// The round factor that makes slopes of that root mean square well visible.
pub fn exaggeration(rms_slope: f64) -> f64 {
    let factors = [50.0, 20.0, 10.0, 5.0, 2.0];
    factors.into_iter().find(|f| f * rms_slope <= STEEP_ENOUGH).unwrap_or(1.0)
}

/// Brightness in 0..1 of every cell; NaN where there is no data.
pub fn hillshade(grid: &Grid, exaggeration: f64) -> Grid {
    let cells = (0..grid.rows()).flat_map(|r| (0..grid.cols()).map(move |c| (r, c)));
    let values = cells.map(|(r, c)| brightness(grid, r, c, exaggeration)).collect();
    Grid { geometry: grid.geometry, values }
}

fn brightness(grid: &Grid, row: usize, col: usize, exaggeration: f64) -> f64 {
    if !grid.at(row, col).is_finite() {
        return f64::NAN;
    }
    let [p, q] = gradient(grid, row, col).map(|v| v * exaggeration);
    let length = (1.0 + p * p + q * q).sqrt();
    ((LIGHT[2] - p * LIGHT[0] - q * LIGHT[1]) / length).max(0.0)
}

/// Gradient east and north.
fn gradient(grid: &Grid, row: usize, col: usize) -> [f64; 2] {
    let (rows, cols) = (grid.rows(), grid.cols());
    if rows < 3 || cols < 3 {
        return [0.0; 2];
    }
    let (r, c) = (row.clamp(1, rows - 2), col.clamp(1, cols - 2));
    let centre = [grid.at(r, c), grid.at(row, col)].into_iter().find(|v| v.is_finite()).unwrap_or(0.0);
    let z = |dr: usize, dc: usize| {
        let v = grid.at(r + dr - 1, c + dc - 1);
        if v.is_finite() { v } else { centre }
    };
    let east = z(0, 2) + 2.0 * z(1, 2) + z(2, 2) - z(0, 0) - 2.0 * z(1, 0) - z(2, 0);
    let north = z(0, 0) + 2.0 * z(0, 1) + z(0, 2) - z(2, 0) - 2.0 * z(2, 1) - z(2, 2);
    [east / (8.0 * grid.geometry.cell[0]), north / (8.0 * grid.geometry.cell[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    fn plane(p: f64, q: f64) -> Grid {
        let g = Geometry { rows: 7, cols: 9, cell: [0.5, 2.0], origin: [0.0; 2] };
        let values = (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| p * g.x(c) + q * g.y(r))).collect();
        Grid::new(g, values)
    }

    /// Closed form on a plane, edges included; tolerance 1e-12.
    #[test]
    fn val_a_plane_has_one_brightness() {
        for (p, q) in [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (-0.7, 1.1), (3.0, -3.0)] {
            let expected = f64::max(
                (std::f64::consts::FRAC_1_SQRT_2 + 0.5 * 2.0 * p - 0.5 * 2.0 * q)
                    / (1.0 + 4.0 * (p * p + q * q)).sqrt(),
                0.0,
            );
            let shade = hillshade(&plane(p, q), 2.0);
            assert!(shade.values.iter().all(|v| (v - expected).abs() < 1e-12), "{p} {q}");
        }
    }

    #[test]
    fn val_the_side_that_faces_the_light_is_brighter() {
        let north_west_up = plane(0.3, -0.3);
        assert!(hillshade(&north_west_up, 1.0).values[0] > hillshade(&plane(-0.3, 0.3), 1.0).values[0]);
    }

    #[test]
    fn prop_no_data_stays_and_small_grids_are_flat() {
        let mut grid = plane(0.2, 0.1);
        grid.values[20] = f64::NAN;
        let shade = hillshade(&grid, 1.0);
        assert_eq!(shade.finite_count(), grid.finite_count());
        let line = Grid::filled(Geometry::square(1, 5, 1.0), 3.0);
        assert!(hillshade(&line, 1.0).values.iter().all(|v| (v - LIGHT[2]).abs() < 1e-15));
    }

    #[test]
    fn val_exaggeration_is_round() {
        assert_eq!(exaggeration(0.4), 1.0);
        assert_eq!(exaggeration(0.2), 2.0);
        assert_eq!(exaggeration(0.01), 50.0);
        assert_eq!(exaggeration(f64::NAN), 1.0);
    }
}
