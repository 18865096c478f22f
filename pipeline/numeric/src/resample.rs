//! From degrees to metres, crops, thinning and other numbers of cells.

use crate::grid::{Geometry, Grid};
use rayon::prelude::*;
use std::ops::Range;

/// Semi-major axis of WGS 84, m.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// First eccentricity squared of WGS 84.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// Metres per degree of longitude and of latitude at a latitude on the WGS 84 ellipsoid: radii of curvature in the
/// prime vertical and in the meridian (Torge, Geodesy, 2001, section 4.1).
pub fn metres_per_degree(latitude_deg: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(latitude_deg.to_radians());
    let w2 = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
    let prime_vertical = SEMI_MAJOR_M / w2.sqrt();
    let meridian = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_SQUARED) / (w2 * w2.sqrt());
    [(prime_vertical * cos).to_radians(), meridian.to_radians()]
}

/// The grid with its cells in metres instead of degrees ([`in_metres`]). No height is resampled.
pub fn geographic_to_metres(grid: &Grid) -> Grid {
    Grid { geometry: in_metres(&grid.geometry), values: grid.values.clone() }
}

/// A geographic geometry with its cells in metres instead of degrees, scaled at the latitude of its centre; its south-west
/// corner becomes the origin. The scale error towards the northern and southern edges is `tan(latitude) * half height`:
/// about 0.9 % for a 1 degree tile at 45 degrees.
pub fn in_metres(g: &Geometry) -> Geometry {
    let centre = g.origin[1] + 0.5 * g.size()[1];
    let [east, north] = metres_per_degree(centre);
    Geometry { cell: [g.cell[0] * east, g.cell[1] * north], origin: [0.0; 2], ..*g }
}

/// The cells whose centres lie in the closed rectangle `[x0, y0, x1, y1]`, or `None` when there is none.
pub fn crop(grid: &Grid, rectangle: [f64; 4]) -> Option<Grid> {
    let [rows, cols] = inside(&grid.geometry, rectangle)?;
    Some(grid.window(rows.start, cols.start, rows.len(), cols.len()))
}

/// Shape and place of what [`crop`] leaves.
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

/// Every `step`-th cell of every `step`-th row, from the centre of the first block on; for drawing, not for statistics.
pub fn thin(grid: &Grid, step: usize) -> Grid {
    let step = step.max(1);
    let g = grid.geometry;
    let pick = |n: usize| (step / 2..n).step_by(step);
    let values: Vec<f64> = pick(g.rows).flat_map(|r| pick(g.cols).map(move |c| grid.at(r, c))).collect();
    let (rows, cols) = (pick(g.rows).count(), pick(g.cols).count());
    let cell = [g.cell[0] * step as f64, g.cell[1] * step as f64];
    Grid::new(Geometry { rows, cols, cell, origin: g.origin }, values)
}

/// Means of whole blocks of `step` x `step` cells from the north-west corner on; cells that fill no block are left out. NaN where less
/// than half of a block is known.
pub fn block_means(grid: &Grid, step: usize) -> Grid {
    let (g, step) = (grid.geometry, step.max(1));
    let (rows, cols) = (g.rows / step, g.cols / step);
    let mean = |row: usize, col: usize| {
        let cells = (0..step).flat_map(|r| &grid.row(row * step + r)[col * step..][..step]);
        let known = cells.filter(|z| !z.is_nan());
        let (sum, count) = known.fold((0.0, 0usize), |(sum, count), z| (sum + z, count + 1));
        if 2 * count >= step * step { sum / count as f64 } else { f64::NAN }
    };
    let values = (0..rows).into_par_iter().flat_map_iter(|r| (0..cols).map(move |c| mean(r, c))).collect();
    let cell = g.cell.map(|cell| cell * step as f64);
    let origin = [g.origin[0], g.origin[1] + (g.rows - rows * step) as f64 * g.cell[1]];
    Grid::new(Geometry { rows, cols, cell, origin }, values)
}

/// The heights at `rows` x `cols` points that lie evenly between the grid's outer cell centres, the outer ones on them:
/// bilinear, and the grid's own height, bit for bit, where a point is a cell centre. No data spreads to what lies beside it.
///
/// # Panics
/// If either grid has fewer than two rows or columns (a bug of the caller).
pub fn stretch(grid: &Grid, rows: usize, cols: usize) -> Grid {
    let g = &grid.geometry;
    let (from_rows, from_cols) = (places(g.rows, rows), places(g.cols, cols));
    let values = from_rows.par_iter().flat_map_iter(|&(north, south_share)| {
        let (upper, lower) = (grid.row(north), grid.row(north + 1));
        from_cols.iter().map(move |&(west, east_share)| {
            let across = |row: &[f64]| between(row[west], row[west + 1], east_share);
            between(across(upper), across(lower), south_share)
        })
    });
    let cell = |axis: usize, from: usize, to: usize| g.cell[axis] * (from - 1) as f64 / (to - 1) as f64;
    let cell = [cell(0, g.cols, cols), cell(1, g.rows, rows)];
    let origin = [g.x(0) - 0.5 * cell[0], g.y(g.rows - 1) - 0.5 * cell[1]];
    Grid::new(Geometry { rows, cols, cell, origin }, values.collect())
}

/// For each of `to` points along `from` others, the one before it, and how far it lies on the way to the next.
fn places(from: usize, to: usize) -> Vec<(usize, f64)> {
    assert!(from >= 2 && to >= 2, "points lie between two outer ones");
    let place = |k: usize| {
        let (steps, parts) = (k * (from - 1), to - 1);
        let before = (steps / parts).min(from - 2);
        (before, (steps - before * parts) as f64 / parts as f64)
    };
    (0..to).map(place).collect()
}

/// At an end, what is there, whatever the other end holds; a plane stays one.
fn between(a: f64, b: f64, share: f64) -> f64 {
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
        let largest = wide.values.iter().zip(of(*w).values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(largest < 1e-12, "{largest}");
        let plane = stretch(&Grid::filled(Geometry::square(129, 129, 0.5), -3.3), 253, 253);
        assert!(plane.values.iter().all(|z| *z == -3.3));
    }

    /// Means of blocks of a plane are the plane at their centres, and a block keeps its mean while half of it is known.
    #[test]
    fn val_block_means_of_a_plane() {
        let g = Geometry { rows: 8, cols: 11, cell: [0.5, 0.25], origin: [3.0, -2.0] };
        let plane = |x: f64, y: f64| 2.0 * x - 3.0 * y;
        let values = (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| plane(g.x(c), g.y(r)))).collect();
        let mut grid = Grid::new(g, values);
        let means = block_means(&grid, 3);
        let m = means.geometry;
        assert_eq!((m.rows, m.cols, m.cell), (2, 3, [1.5, 0.75]));
        for (row, col) in [(0, 0), (1, 2)] {
            assert!((means.at(row, col) - plane(m.x(col), m.y(row))).abs() < 1e-12);
        }
        assert_eq!(block_means(&grid, 1), grid);
        (0..4).for_each(|k| grid.values[k % 3 + g.cols * (k / 3)] = f64::NAN);
        assert!(block_means(&grid, 3).at(0, 0).is_finite());
        grid.values[g.cols + 1] = f64::NAN;
        assert!(block_means(&grid, 3).at(0, 0).is_nan());
    }

    #[test]
    fn val_no_data_spreads_to_what_lies_beside_it() {
        let mut grid = Grid::filled(Geometry::square(3, 3, 1.0), 2.0);
        grid.values[0] = f64::NAN;
        let wide = stretch(&grid, 5, 5);
        assert_eq!(wide.values.iter().filter(|v| v.is_nan()).count(), 4);
        assert_eq!((wide.at(0, 2), wide.at(2, 0)), (2.0, 2.0));
    }

    proptest! {
        /// Where new points fall on cell centres the heights are those, whatever the numbers of rows and columns; elsewhere they
        /// are the surface's.
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

    /// Values of the WGS 84 ellipsoid (NGA.STND.0036, 2014): 111 319.49 m per degree of longitude and 110 574.3 m per
    /// degree of latitude at the equator; 111 132.95 m per degree of latitude at 45 degrees.
    #[test]
    fn val_metres_per_degree() {
        let [east, north] = metres_per_degree(0.0);
        assert!((east - 111_319.49).abs() < 0.01 && (north - 110_574.3).abs() < 0.1);
        assert!((metres_per_degree(45.0)[1] - 111_131.7).abs() < 1.5);
    }

    #[test]
    fn val_crop_keeps_centres_inside() {
        let grid = Grid::new(Geometry::square(4, 5, 1.0), (0..20).map(f64::from).collect());
        let part = crop(&grid, [1.0, 1.0, 3.0, 3.0]).unwrap();
        assert_eq!((part.rows(), part.cols()), (2, 2));
        assert_eq!(part.values, vec![6.0, 7.0, 11.0, 12.0]);
        assert!(crop(&grid, [9.0, 9.0, 10.0, 10.0]).is_none());
    }
}
