//! Hillshade: brightness of a surface under one distant light.
//!
//! Brightness is `max(0, n . l)` with the surface normal `n = (-p, -q, 1) / sqrt(1 + p^2 + q^2)` and the unit vector `l`
//! towards the light. `p` (east) and `q` (north) are the 3 x 3 gradients of B. Horn, Hill shading and the reflectance
//! map, Proc. IEEE 69 (1981), times the exaggeration. The outermost cells take the gradient of their inner neighbours. A
//! neighbour without data is assigned the height of the centre.

use sastrugi_numeric::Grid;

/// Unit vector to the light: azimuth 315 degrees (north-west), altitude 45 degrees.
pub const LIGHT: [f64; 3] = [-0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2];

/// Largest root mean square slope after exaggeration.
const STEEP_ENOUGH: f64 = 0.5;

/// The round factor of exaggeration that makes relief with this root mean square slope clearly visible.
pub fn exaggeration(rms_slope: f64) -> f64 {
    let factors = [50.0, 20.0, 10.0, 5.0, 2.0];
    factors.into_iter().find(|f| f * rms_slope <= STEEP_ENOUGH).unwrap_or(1.0)
}

/// Brightness of every cell, 0 to 1; NaN without data.
///
/// ```
/// use sastrugi_imaging::hillshade::hillshade;
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let g = Geometry::square(5, 5, 1.0);
/// let level = Grid::filled(g, 7.0);
/// assert!((hillshade(&level, 1.0).at(2, 2) - 0.5f64.sqrt()).abs() < 1e-12);
/// // Ground that rises to the east faces the light in the north-west.
/// let rising = Grid::new(g, (0..25).map(|k| 0.3 * g.x(k % 5)).collect());
/// assert!(hillshade(&rising, 1.0).at(2, 2) > hillshade(&level, 1.0).at(2, 2));
/// ```
pub fn hillshade(grid: &Grid, exaggeration: f64) -> Grid {
    let cells = (0..grid.rows()).flat_map(|r| (0..grid.cols()).map(move |c| (r, c)));
    let values = cells.map(|(r, c)| brightness(grid, r, c, exaggeration)).collect();
    Grid { geometry: grid.geometry, values }
}

fn brightness(grid: &Grid, row: usize, col: usize, exaggeration: f64) -> f64 {
    if !grid.at(row, col).is_finite() {
        return f64::NAN;
    }
    lit(gradient(grid, row, col).map(|v| v * exaggeration), LIGHT)
}

/// Brightness of a facet with a gradient east and north.
fn lit([p, q]: [f64; 2], light: [f64; 3]) -> f64 {
    let length = (1.0 + p * p + q * q).sqrt();
    ((light[2] - p * light[0] - q * light[1]) / length).max(0.0)
}

/// Gradient east and north of 3 x 3 heights, times eight cell sizes; row 0 in the north (Horn, 1981).
fn differences(z: impl Fn(usize, usize) -> f64) -> [f64; 2] {
    let east = z(0, 2) + 2.0 * z(1, 2) + z(2, 2) - z(0, 0) - 2.0 * z(1, 0) - z(2, 0);
    let north = z(0, 0) + 2.0 * z(0, 1) + z(0, 2) - z(2, 0) - 2.0 * z(2, 1) - z(2, 2);
    [east, north]
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
    let [east, north] = differences(z);
    [east / (8.0 * grid.geometry.cell[0]), north / (8.0 * grid.geometry.cell[1])]
}

/// Brightness, 0 to 1, of all but the outermost cells of a raster of square cells, under a light of any direction; NaN without data.
/// `shape` is `(rows, cols)`, row 0 in the north. Rasters that overlap their neighbours by these outermost cells join without a seam.
pub fn shade_inner(
    heights: &[f32],
    [rows, cols]: [usize; 2],
    cell_m: f64,
    light: [f64; 3],
    exaggeration: f64,
) -> Vec<f32> {
    let per_difference = exaggeration / (8.0 * cell_m);
    let mut shades = Vec::with_capacity(rows.saturating_sub(2) * cols.saturating_sub(2));
    for row in 1..rows.saturating_sub(1) {
        let lines = [row - 1, row, row + 1].map(|r| &heights[r * cols..(r + 1) * cols]);
        for col in 1..cols.saturating_sub(1) {
            let centre = lines[1][col];
            if centre.is_nan() {
                shades.push(f32::NAN);
                continue;
            }
            // Differences from the centre preserve the digits of low relief on high ground.
            let z = |r: usize, c: usize| {
                let difference = f64::from(lines[r][col + c - 1]) - f64::from(centre);
                if difference.is_nan() { 0.0 } else { difference }
            };
            shades.push(lit(differences(z).map(|d| d * per_difference), light) as f32);
        }
    }
    shades
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

    /// Heights 0, 1, 2 to the east, without the one east of the centre, which takes the height of the centre: 6 eighths of a gradient of
    /// 1. Both shadings use this rule.
    #[test]
    fn val_a_missing_neighbour_is_as_high_as_the_centre() {
        let mut grid = Grid::new(Geometry::square(3, 3, 1.0), (0..9).map(|k| f64::from(k % 3)).collect());
        grid.values[5] = f64::NAN;
        let expected = (std::f64::consts::FRAC_1_SQRT_2 + 0.5 * 0.75) / 1.25;
        assert!((hillshade(&grid, 1.0).at(1, 1) - expected).abs() < 1e-12);
        let single: Vec<f32> = grid.values.iter().map(|z| *z as f32).collect();
        let inner = shade_inner(&single, [3, 3], 1.0, LIGHT, 1.0);
        assert!(inner.len() == 1 && (f64::from(inner[0]) - expected).abs() < 1e-6, "{inner:?}");
    }

    /// The inner cells of a tile that overlaps its neighbours equal those of the complete raster, bit for bit: no seam.
    #[test]
    fn prop_tiles_have_no_seam() {
        let (rows, cols) = (20, 26);
        let heights: Vec<f32> = (0..rows * cols).map(|k| (k * k % 97) as f32 * 0.01).collect();
        let light = crate::direction(200.0, 30.0);
        let whole = shade_inner(&heights, [rows, cols], 0.1, light, 2.0);
        for (row, col, height, width) in [(0, 0, 12, 14), (10, 12, 10, 14), (3, 5, 3, 3)] {
            let part: Vec<f32> =
                (0..height * width).map(|k| heights[(row + k / width) * cols + col + k % width]).collect();
            for (k, shade) in shade_inner(&part, [height, width], 0.1, light, 2.0).iter().enumerate() {
                let (r, c) = (row + k / (width - 2), col + k % (width - 2));
                assert_eq!(shade.to_bits(), whole[r * (cols - 2) + c].to_bits());
            }
        }
        assert!(shade_inner(&heights[..4], [2, 2], 0.1, light, 1.0).is_empty());
    }

    /// Slopes of 0 to 80 degrees are recovered to 0.1 degrees from the brightness under a light straight above, at heights of 4 km; the
    /// result agrees with [`hillshade`].
    #[test]
    fn val_slopes_are_right_at_any_zoom() {
        for cell_m in [0.01, 1.0, 600.0] {
            for slope_deg in [0.0, 5.0, 30.0, 60.0, 80.0_f64] {
                let p = libm::tan(slope_deg.to_radians());
                // High ground: single precision keeps a quarter of a millimetre there.
                let high = if cell_m < 0.1 { 10.0 } else { 4000.0 };
                let heights: Vec<f32> = (0..9).map(|k| (high + (k % 3) as f64 * cell_m * p) as f32).collect();
                let up = shade_inner(&heights, [3, 3], cell_m, [0.0, 0.0, 1.0], 1.0)[0];
                assert!((libm::acos(f64::from(up)).to_degrees() - slope_deg).abs() < 0.1, "{cell_m} {slope_deg} {up}");
            }
        }
        let grid = plane(0.3, -0.2);
        let square = Grid { geometry: Geometry { cell: [0.5; 2], ..grid.geometry }, values: grid.values };
        let single: Vec<f32> = square.values.iter().map(|z| *z as f32).collect();
        let inner = shade_inner(&single, [7, 9], 0.5, LIGHT, 1.0);
        assert!((f64::from(inner[10]) - hillshade(&square, 1.0).at(2, 4)).abs() < 1e-5);
    }

    #[test]
    fn val_exaggeration_is_round() {
        assert_eq!(exaggeration(0.4), 1.0);
        assert_eq!(exaggeration(0.2), 2.0);
        assert_eq!(exaggeration(0.01), 50.0);
        assert_eq!(exaggeration(f64::NAN), 1.0);
    }
}
