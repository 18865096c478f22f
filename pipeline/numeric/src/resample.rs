//! Conversion from degrees to metres, cropping, thinning, block means and stretching to other numbers of cells.

use crate::grid::{Geometry, Grid};
use rayon::prelude::*;
use std::ops::Range;

/// Semi-major axis of WGS 84, m.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// First eccentricity squared of WGS 84.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// Metres per degree of longitude and of latitude at a latitude on the WGS 84 ellipsoid: radii of curvature in the
/// prime vertical and in the meridian (Torge, Geodesy, 2001, section 4.1).
///
/// ```
/// let [east, north] = sastrugi_numeric::resample::metres_per_degree(60.0);
/// // A degree of longitude is half as long as one of latitude here, to within half a per cent.
/// assert!((east / north - 0.5).abs() < 0.005);
/// assert!((north - 111_412.29).abs() < 0.01);
/// ```
pub fn metres_per_degree(latitude_deg: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(latitude_deg.to_radians());
    let w2 = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
    let prime_vertical = SEMI_MAJOR_M / w2.sqrt();
    let meridian = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_SQUARED) / (w2 * w2.sqrt());
    [(prime_vertical * cos).to_radians(), meridian.to_radians()]
}

/// Converts a grid from degrees to metres ([`in_metres`]). Heights are not resampled.
pub fn geographic_to_metres(grid: &Grid) -> Grid {
    Grid { geometry: in_metres(&grid.geometry), values: grid.values.clone() }
}

/// Converts a geographic geometry from degrees to metres, with the scale at the latitude of its centre; its south-west corner
/// becomes the origin. The scale error towards the northern and southern edges is `tan(latitude) * half height`: about 0.9 % for
/// a 1 degree tile at 45 degrees.
pub fn in_metres(g: &Geometry) -> Geometry {
    let centre = g.origin[1] + 0.5 * g.size()[1];
    let [east, north] = metres_per_degree(centre);
    Geometry { cell: [g.cell[0] * east, g.cell[1] * north], origin: [0.0; 2], ..*g }
}

/// The cells whose centres lie in the closed rectangle `[x0, y0, x1, y1]`, or `None` if there are none.
///
/// ```
/// use sastrugi_numeric::resample::crop;
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let grid = Grid::new(Geometry::square(2, 3, 1.0), vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
/// let part = crop(&grid, [0.5, 0.0, 2.0, 1.0]);
/// // The southern row has its centres at y = 0.5; those at x = 0.5 and 1.5 lie in the rectangle.
/// assert_eq!(part.map(|part| part.values), Some(vec![4.0, 5.0]));
/// assert_eq!(crop(&grid, [7.0, 7.0, 8.0, 8.0]), None);
/// ```
pub fn crop(grid: &Grid, rectangle: [f64; 4]) -> Option<Grid> {
    let [rows, cols] = inside(&grid.geometry, rectangle)?;
    Some(grid.window(rows.start, cols.start, rows.len(), cols.len()))
}

/// Shape and position of the result of [`crop`].
pub fn cropped(g: &Geometry, rectangle: [f64; 4]) -> Option<Geometry> {
    let [rows, cols] = inside(g, rectangle)?;
    Some(g.window(rows.start, cols.start, rows.len(), cols.len()))
}

/// Rows and columns whose centres lie in the closed rectangle `[x0, y0, x1, y1]`; neither is empty.
fn inside(g: &Geometry, [x0, y0, x1, y1]: [f64; 4]) -> Option<[Range<usize>; 2]> {
    let run = |count: usize, is_in: &dyn Fn(usize) -> bool| {
        let first = (0..count).find(|&k| is_in(k))?;
        let last = (first..count).rev().find(|&k| is_in(k))?;
        Some(first..last + 1)
    };
    let rows = run(g.rows, &|r| g.y(r) >= y0 && g.y(r) <= y1)?;
    let cols = run(g.cols, &|c| g.x(c) >= x0 && g.x(c) <= x1)?;
    Some([rows, cols])
}

/// Every `step`-th cell of every `step`-th row, starting at the centre of the first block in the north-west. For drawing, not for
/// statistics. For odd steps, the centres of the cells stay in place; for even ones, they move by half a cell.
pub fn thin(grid: &Grid, step: usize) -> Grid {
    let step = step.max(1);
    let g = grid.geometry;
    let pick = |n: usize| (step / 2..n).step_by(step);
    let values: Vec<f64> = pick(g.rows).flat_map(|r| pick(g.cols).map(move |c| grid.at(r, c))).collect();
    let (rows, cols) = (pick(g.rows).count(), pick(g.cols).count());
    let cell = [g.cell[0] * step as f64, g.cell[1] * step as f64];
    // Blocks are counted from the north, so the last may reach beyond the southern edge, or end before it.
    let beyond = (rows * step) as f64 - g.rows as f64;
    let origin = [g.origin[0], g.origin[1] - beyond * g.cell[1]];
    Grid::new(Geometry { rows, cols, cell, origin }, values)
}

/// Means of complete blocks of `step` x `step` cells, starting at the north-west corner; cells outside complete blocks are left out. NaN for
/// blocks with data in less than half of their cells.
///
/// ```
/// use sastrugi_numeric::resample::block_means;
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let grid = Grid::new(Geometry::square(2, 4, 0.5), vec![1.0, 3.0, f64::NAN, 2.0, 5.0, 7.0, f64::NAN, 4.0]);
/// let coarse = block_means(&grid, 2);
/// // The eastern block has data in half of its cells.
/// assert_eq!(coarse.values, [4.0, 3.0]);
/// assert_eq!(coarse.geometry, Geometry::square(1, 2, 1.0));
/// ```
pub fn block_means(grid: &Grid, step: usize) -> Grid {
    let step = step.max(1);
    let coarse = block_geometry(&grid.geometry, step);
    let (rows, cols) = (coarse.rows, coarse.cols);
    let mean = |row: usize, col: usize| {
        let cells = (0..step).flat_map(|r| &grid.row(row * step + r)[col * step..][..step]);
        let known = cells.filter(|z| !z.is_nan());
        let (sum, count) = known.fold((0.0, 0usize), |(sum, count), z| (sum + z, count + 1));
        if 2 * count >= step * step { sum / count as f64 } else { f64::NAN }
    };
    let values = (0..rows).into_par_iter().flat_map_iter(|r| (0..cols).map(move |c| mean(r, c))).collect();
    Grid::new(coarse, values)
}

/// Shape and position of the result of [`block_means`].
pub fn block_geometry(g: &Geometry, step: usize) -> Geometry {
    let step = step.max(1);
    let (rows, cols) = (g.rows / step, g.cols / step);
    let cell = g.cell.map(|cell| cell * step as f64);
    let origin = [g.origin[0], g.origin[1] + (g.rows - rows * step) as f64 * g.cell[1]];
    Geometry { rows, cols, cell, origin }
}

/// Heights at `rows` x `cols` evenly spaced points whose outer ones coincide with the outer cell centres of the grid. Interpolation
/// is bilinear; at cell centres, the heights are those of the grid, bit for bit. Points between a cell without data and its neighbours are NaN.
///
/// ```
/// use sastrugi_numeric::resample::stretch;
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let posts = Grid::new(Geometry::square(2, 2, 1.0), vec![2.0, 4.0, 0.0, 2.0]);
/// let fine = stretch(&posts, 3, 3);
/// assert_eq!(fine.values, [2.0, 3.0, 4.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0]);
/// // The outer centres stay where they are.
/// assert_eq!((fine.geometry.x(0), fine.geometry.x(2)), (0.5, 1.5));
/// ```
///
/// # Panics
/// If either grid has fewer than two rows or columns (a bug of the caller).
pub fn stretch(grid: &Grid, rows: usize, cols: usize) -> Grid {
    let g = &grid.geometry;
    let (from_rows, from_cols) = (support_points(g.rows, rows), support_points(g.cols, cols));
    let values = from_rows.par_iter().flat_map_iter(|&(north, south_share)| {
        let (upper, lower) = (grid.row(north), grid.row(north + 1));
        from_cols.iter().map(move |&(west, east_share)| {
            let across = |row: &[f64]| interpolated(row[west], row[west + 1], east_share);
            interpolated(across(upper), across(lower), south_share)
        })
    });
    let cell = |axis: usize, from: usize, to: usize| g.cell[axis] * (from - 1) as f64 / (to - 1) as f64;
    let cell = [cell(0, g.cols, cols), cell(1, g.rows, rows)];
    let origin = [g.x(0) - 0.5 * cell[0], g.y(g.rows - 1) - 0.5 * cell[1]];
    Grid::new(Geometry { rows, cols, cell, origin }, values.collect())
}

/// For each of `to` points spread evenly over `from` others: the index of the one before it, and the fraction of the distance to the next.
fn support_points(from: usize, to: usize) -> Vec<(usize, f64)> {
    assert!(from >= 2 && to >= 2, "at least two points are needed on each axis");
    let place = |k: usize| {
        let (steps, parts) = (k * (from - 1), to - 1);
        let before = (steps / parts).min(from - 2);
        (before, (steps - before * parts) as f64 / parts as f64)
    };
    (0..to).map(place).collect()
}

/// Linear interpolation. At either end, the value there, whatever the other value is; equal values are preserved.
fn interpolated(a: f64, b: f64, share: f64) -> f64 {
    match share {
        0.0 => a,
        1.0 => b,
        _ => a + (b - a) * share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use proptest::prelude::*;

    #[test]
    fn val_stretched_grids_are_bilinear_and_keep_their_outer_centres() {
        let g = Geometry { rows: 4, cols: 6, cell: [0.5, 0.25], origin: [3.0, -2.0] };
        let saddle = |x: f64, y: f64| 1.0 + 2.0 * x - 3.0 * y + 0.5 * x * y;
        let of = |g: Geometry| {
            let values = (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| saddle(g.x(c), g.y(r)))).collect();
            Grid::new(g, values)
        };
        let wide = stretch(&of(g), 9, 21);
        let w = &wide.geometry;
        assert_eq!((w.cell, w.rows, w.cols), ([0.125, 0.09375], 9, 21));
        assert_eq!([w.x(0), w.x(20), w.y(0), w.y(8)], [g.x(0), g.x(5), g.y(0), g.y(3)]);
        let largest = wide.values.iter().zip(of(*w).values).map(|(a, b)| (a - b).abs()).max_by(f64::total_cmp).unwrap();
        assert!(largest < 1e-12, "{largest}");
        let plane = stretch(&Grid::filled(Geometry::square(129, 129, 0.5), -3.3), 253, 253);
        assert!(plane.values.iter().all(|z| *z == -3.3));
    }

    /// Block means of a plane equal the plane at the block centres, and a block has a mean as long as half of its cells have data.
    #[test]
    fn val_block_means_of_a_plane() {
        let g = Geometry { rows: 8, cols: 11, cell: [0.5, 0.25], origin: [3.0, -2.0] };
        let plane = |x: f64, y: f64| 2.0 * x - 3.0 * y;
        let values = (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| plane(g.x(c), g.y(r)))).collect();
        let mut grid = Grid::new(g, values);
        let means = block_means(&grid, 3);
        let m = means.geometry;
        assert_eq!((m.rows, m.cols, m.cell), (2, 3, [1.5, 0.75]));
        for (row, col) in (0..2).flat_map(|row| (0..3).map(move |col| (row, col))) {
            assert!((means.at(row, col) - plane(m.x(col), m.y(row))).abs() < 1e-12, "{row} {col}");
        }
        assert_eq!(block_means(&grid, 1), grid);
        (0..4).for_each(|k| grid.values[k % 3 + g.cols * (k / 3)] = f64::NAN);
        let left: f64 = [(1, 1), (1, 2), (2, 0), (2, 1), (2, 2)].iter().map(|&(row, col)| grid.at(row, col)).sum();
        assert!((block_means(&grid, 3).at(0, 0) - left / 5.0).abs() < 1e-12);
        grid.values[g.cols + 1] = f64::NAN;
        assert!(block_means(&grid, 3).at(0, 0).is_nan());
        // Exactly half of the cells are enough.
        let none = f64::NAN;
        let pairs = Grid::new(Geometry::square(2, 4, 1.0), vec![none, 3.0, 1.0, none, 5.0, none, none, none]);
        let means = block_means(&pairs, 2);
        assert!(means.at(0, 0) == 4.0 && means.at(0, 1).is_nan());
    }

    /// The cells are the middle ones of their blocks, and stay where they are, also if blocks reach beyond the grid or rows are left over.
    #[test]
    fn val_thinned_cells_stay_in_place() {
        let whole = Grid::new(
            Geometry { rows: 6, cols: 7, cell: [0.5, 0.25], origin: [3.0, -2.0] },
            (0..42).map(f64::from).collect(),
        );
        let (one_row, two_rows) = (vec![8.0, 11.0], vec![8.0, 11.0, 29.0, 32.0]);
        for (rows, expected) in [(4, &one_row), (5, &two_rows), (6, &two_rows)] {
            let part = whole.window(0, 0, rows, 7);
            let few = thin(&part, 3);
            assert_eq!((&few.values, few.geometry.cell), (expected, [1.5, 0.75]), "{rows}");
            for (row, col) in (0..few.rows()).flat_map(|row| (0..2).map(move |col| (row, col))) {
                let (x, y) = (few.geometry.x(col), few.geometry.y(row));
                assert_eq!(part.geometry.cell_at(x, y), Some((3 * row + 1, 3 * col + 1)), "{rows}: {row} {col}");
                assert_eq!((x, y), (part.geometry.x(3 * col + 1), part.geometry.y(3 * row + 1)));
            }
        }
        assert_eq!((thin(&whole, 1), thin(&whole, 0)), (whole.clone(), whole));
    }

    #[test]
    #[should_panic(expected = "at least two points are needed on each axis")]
    fn val_one_row_cannot_be_stretched() {
        stretch(&Grid::filled(Geometry::square(1, 3, 1.0), 0.0), 2, 2);
    }

    #[test]
    fn val_points_next_to_a_cell_without_data_are_nan() {
        let mut grid = Grid::filled(Geometry::square(3, 3, 1.0), 2.0);
        grid.values[0] = f64::NAN;
        let wide = stretch(&grid, 5, 5);
        assert_eq!(wide.values.iter().filter(|v| v.is_nan()).count(), 4);
        assert_eq!((wide.at(0, 2), wide.at(2, 0)), (2.0, 2.0));
    }

    proptest! {
        /// At cell centres, the heights are those of the grid for any numbers of rows and columns; elsewhere, they are those of
        /// the bilinear surface.
        #[test]
        fn prop_stretched_grids_lie_on_the_surface(
            rows in 2usize..9, cols in 2usize..9, times in 1usize..5, more in 2usize..30,
            heights in prop::collection::vec(-1e3f64..1e3, 64),
        ) {
            let grid = Grid::new(Geometry::square(rows, cols, 0.3), heights[..rows * cols].to_vec());
            let (fine_rows, fine_cols) = (times * (rows - 1) + 1, times * (cols - 1) + 1);
            let fine = stretch(&grid, fine_rows, fine_cols);
            for row in 0..rows {
                for col in 0..cols {
                    prop_assert_eq!(fine.at(times * row, times * col).to_bits(), grid.at(row, col).to_bits());
                }
            }
            let other = stretch(&grid, more, more);
            for row in 1..more - 1 {
                for col in 1..more - 1 {
                    let (x, y) = (other.geometry.x(col), other.geometry.y(row));
                    let there = grid.height(x, y).unwrap();
                    prop_assert!((other.at(row, col) - there).abs() < 1e-9);
                }
            }
        }
    }

    /// The WGS 84 ellipsoid (NGA.STND.0036, 2014): metres per degree of longitude and of latitude at the equator, at 45 degrees on both
    /// sides of it, at 60 degrees, and at the pole. The closed forms were evaluated separately, in Python.
    #[test]
    fn val_metres_per_degree() {
        let known = [
            (0.0, [111_319.49, 110_574.28]),
            (45.0, [78_846.84, 111_131.78]),
            (-45.0, [78_846.84, 111_131.78]),
            (60.0, [55_800.00, 111_412.29]),
            (90.0, [0.0, 111_693.98]),
        ];
        for (latitude_deg, expected) in known {
            let found = metres_per_degree(latitude_deg);
            assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 0.01), "{latitude_deg}: {found:?}");
        }
    }

    /// The scale is that of the latitude of the centre, here 45 degrees; the shape stays, and the corner becomes the origin.
    #[test]
    fn val_degrees_become_metres_at_the_centre() {
        let degrees = Geometry { rows: 4, cols: 2, cell: [0.25, 0.5], origin: [7.0, 44.0] };
        let grid = Grid::new(degrees, (0..8).map(f64::from).collect());
        let metres = geographic_to_metres(&grid);
        let g = metres.geometry;
        assert_eq!((g, metres.values), (in_metres(&degrees), grid.values));
        assert_eq!((g.rows, g.cols, g.origin), (4, 2, [0.0; 2]));
        assert!((g.cell[0] - 19_711.71).abs() < 0.01 && (g.cell[1] - 55_565.89).abs() < 0.01, "{:?}", g.cell);
    }

    #[test]
    fn val_crop_keeps_centres_inside() {
        let grid = Grid::new(Geometry::square(4, 5, 1.0), (0..20).map(f64::from).collect());
        let part = crop(&grid, [1.0, 1.0, 3.0, 3.0]).unwrap();
        assert_eq!((part.rows(), part.cols()), (2, 2));
        assert_eq!(part.values, vec![6.0, 7.0, 11.0, 12.0]);
        assert_eq!(part.geometry, Geometry { origin: [1.0; 2], ..Geometry::square(2, 2, 1.0) });
        // The rectangle includes its edges.
        assert_eq!(crop(&grid, [1.5, 1.5, 2.5, 2.5]).as_ref(), Some(&part));
        assert_eq!(cropped(&grid.geometry, [1.5, 1.5, 2.5, 2.5]), Some(part.geometry));
        let corner = crop(&grid, [2.5, -9.0, 9.0, 0.5]).unwrap();
        assert_eq!((corner.values, corner.geometry.origin), (vec![17.0, 18.0, 19.0], [2.0, 0.0]));
        assert!(crop(&grid, [9.0, 9.0, 10.0, 10.0]).is_none());
    }
}
