//! Heights around a vehicle, in its own frame: what a learner sees of the ground.
//!
//! A patch is a rectangle of points centred on the vehicle and turned with its heading. It is laid out as a grid whose north is
//! ahead: row 0 lies farthest ahead, column 0 farthest to the left. Point `(row, col)` of `m x n` points lies
//! `a = ((m - 1) / 2 - row) cell` ahead and `l = ((n - 1) / 2 - col) cell` to the left of the vehicle, at
//! `x + a cos h - l sin h`, `y + a sin h + l cos h`, where `(x, y)` is the position (m) and `h` the heading (rad, counterclockwise
//! from east). Cost: one bilinear height for each point.

use crate::surface::Surface;

/// Shape of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchShape {
    rows: usize,
    cols: usize,
    cell_m: f64,
}

impl PatchShape {
    /// Most points a side.
    pub const POINTS_MAX: usize = 4096;

    /// A patch that reaches `size_m` along and across the heading, with points `cell_m` apart, each in the middle of its cell. `None` unless
    /// both are finite and above 0, and each side is a whole number of cells (within 1e-6) from 1 to [`PatchShape::POINTS_MAX`].
    ///
    /// ```
    /// use sastrugi_numeric::PatchShape;
    ///
    /// let shape = PatchShape::new([3.2, 1.6], 0.1).unwrap();
    /// assert_eq!((shape.rows(), shape.cols()), (32, 16));
    /// assert_eq!(PatchShape::new([3.25, 1.6], 0.1), None);
    /// ```
    pub fn new(size_m: [f64; 2], cell_m: f64) -> Option<Self> {
        let [rows, cols] = size_m.map(|side_m| points(side_m, cell_m));
        Some(Self { rows: rows?, cols: cols?, cell_m })
    }

    /// Points along the heading.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Points across the heading.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Distance between neighbouring points, m.
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }
}

/// Points of a side, if it is a whole number of cells.
fn points(side_m: f64, cell_m: f64) -> Option<usize> {
    let cells = side_m / cell_m;
    let points = cells.round();
    let is_whole = cell_m > 0.0 && (cells - points).abs() <= 1e-6;
    (is_whole && (1.0..=PatchShape::POINTS_MAX as f64).contains(&points)).then_some(points as usize)
}

/// Heights (m) of a surface around a position (m), turned to a heading (rad, counterclockwise from east): `rows * cols` values, row by row from
/// the row farthest ahead, each from left to right; `NaN` where the surface is undefined.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, PatchShape, height_patch};
///
/// // A plane that rises by 1 m per metre to the east, seen by a vehicle that heads east.
/// let values = (0..5).flat_map(|_| [0.5, 1.5, 2.5, 3.5, 4.5]).collect();
/// let plane = Grid::new(Geometry::square(5, 5, 1.0), values);
/// let shape = PatchShape::new([2.0, 2.0], 1.0).unwrap();
/// // Ahead it is higher than behind, and left as high as right.
/// assert_eq!(height_patch(&plane, [2.5, 2.5], 0.0, &shape), [3.0, 3.0, 2.0, 2.0]);
/// ```
pub fn height_patch(surface: &impl Surface, position_m: [f64; 2], heading_rad: f64, shape: &PatchShape) -> Vec<f64> {
    let (sin, cos) = libm::sincos(heading_rad);
    // From the middle of `count` points towards the first.
    let offset_m = |k: usize, count: usize| (0.5 * (count - 1) as f64 - k as f64) * shape.cell_m;
    let height = |row: usize, col: usize| {
        let (ahead, left) = (offset_m(row, shape.rows), offset_m(col, shape.cols));
        let [x, y] = [position_m[0] + ahead * cos - left * sin, position_m[1] + ahead * sin + left * cos];
        surface.height(x, y).unwrap_or(f64::NAN)
    };
    let places = (0..shape.rows).flat_map(|row| (0..shape.cols).map(move |col| (row, col)));
    places.map(|(row, col)| height(row, col)).collect()
}

/// As [`height_patch`], relative to the height of the surface at the position: all `NaN` if it has none there.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, PatchShape, relative_height_patch};
///
/// let values = (0..5).flat_map(|_| [0.5, 1.5, 2.5, 3.5, 4.5]).collect();
/// let plane = Grid::new(Geometry::square(5, 5, 1.0), values);
/// let shape = PatchShape::new([2.0, 2.0], 1.0).unwrap();
/// assert_eq!(relative_height_patch(&plane, [2.5, 2.5], 0.0, &shape), [0.5, 0.5, -0.5, -0.5]);
/// assert!(relative_height_patch(&plane, [9.0, 9.0], 0.0, &shape).iter().all(|height| height.is_nan()));
/// ```
pub fn relative_height_patch(
    surface: &impl Surface,
    position_m: [f64; 2],
    heading_rad: f64,
    shape: &PatchShape,
) -> Vec<f64> {
    let under_m = surface.height(position_m[0], position_m[1]).unwrap_or(f64::NAN);
    let mut heights = height_patch(surface, position_m, heading_rad, shape);
    heights.iter_mut().for_each(|height| *height -= under_m);
    heights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Geometry, Grid};
    use std::f64::consts::{FRAC_PI_2, PI};

    /// 20 x 30 cells of 0.5 m whose heights no symmetry repeats, with its south-west corner at (100, 200).
    fn ground() -> Grid {
        let geometry = Geometry { rows: 20, cols: 30, cell: [0.5; 2], origin: [100.0, 200.0] };
        let height = |k: usize| libm::sin(0.7 * k as f64) + 0.01 * k as f64;
        Grid::new(geometry, (0..geometry.len()).map(height).collect())
    }

    /// Bilinear heights are exact on a plane: in the vehicle's frame its slope is the gradient turned by the heading.
    #[test]
    fn val_a_plane_is_a_plane_in_the_frame_of_the_vehicle() {
        let geometry = Geometry { rows: 20, cols: 30, cell: [0.5; 2], origin: [100.0, 200.0] };
        let plane = |x: f64, y: f64| 3.0 + 0.2 * (x - 107.0) - 0.5 * (y - 204.0);
        let values = (0..20).flat_map(|r| (0..30).map(move |c| plane(geometry.x(c), geometry.y(r)))).collect();
        let grid = Grid::new(geometry, values);
        let shape = PatchShape::new([2.0, 2.0], 0.25).unwrap();
        let heading = 0.4;
        let (sin, cos) = libm::sincos(heading);
        let (ahead_slope, left_slope) = (0.2 * cos - 0.5 * sin, -0.2 * sin - 0.5 * cos);
        let patch = height_patch(&grid, [107.0, 204.0], heading, &shape);
        assert_eq!(patch.len(), 64);
        for (k, z) in patch.iter().enumerate() {
            let [ahead, left] = [k / 8, k % 8].map(|n| 0.25 * (3.5 - n as f64));
            let expected = 3.0 + ahead_slope * ahead + left_slope * left;
            assert!((z - expected).abs() < 1e-12, "{k}: {z} {expected}");
        }
    }

    /// A vehicle that heads north sees the map as it is printed: north above, west on the left.
    #[test]
    fn val_heading_north_is_the_map_itself() {
        let grid = ground();
        let shape = PatchShape::new([2.0, 2.0], 0.5).unwrap();
        let patch = height_patch(&grid, [107.0, 205.0], FRAC_PI_2, &shape);
        let window = grid.window(8, 12, 4, 4);
        assert_eq!(patch.len(), 16);
        patch.iter().zip(&window.values).for_each(|(a, b)| assert!((a - b).abs() < 1e-12, "{a} {b}"));
    }

    /// A quarter turn of the vehicle to the left turns the patch a quarter to the right, half a turn reverses it.
    #[test]
    fn prop_turning_the_vehicle_turns_the_patch() {
        let (grid, at) = (ground(), [107.3, 204.9]);
        let shape = PatchShape::new([3.0, 3.0], 0.2).unwrap();
        let n = shape.rows();
        let of = |heading: f64| height_patch(&grid, at, heading, &shape);
        let (plain, quarter, half) = (of(0.3), of(0.3 + FRAC_PI_2), of(0.3 + PI));
        for (row, col) in (0..n).flat_map(|row| (0..n).map(move |col| (row, col))) {
            // What lay to the left (column 0) now lies ahead (row 0).
            let turned = plain[(n - 1 - col) * n + row];
            assert!((quarter[row * n + col] - turned).abs() < 1e-12, "{row} {col}");
            assert!((half[row * n + col] - plain[(n - 1 - row) * n + n - 1 - col]).abs() < 1e-12, "{row} {col}");
        }
    }

    /// Undefined beyond the outer cell centres and next to holes, and nowhere else.
    #[test]
    fn val_points_beyond_the_surface_are_nan() {
        let mut grid = Grid::filled(Geometry::square(8, 8, 1.0), 1.0);
        let shape = PatchShape::new([4.0, 4.0], 1.0).unwrap();
        // Columns at x = -0.25, 0.75, 1.75, 2.75 while heading north: the first lies beyond the outer centres at 0.5.
        let patch = height_patch(&grid, [1.25, 4.0], FRAC_PI_2, &shape);
        for (k, z) in patch.iter().enumerate() {
            assert_eq!(z.is_nan(), k % 4 == 0, "{k}: {z}");
        }
        let whole = height_patch(&grid, [4.2, 4.2], 1.0, &shape);
        assert!(whole.iter().all(|z| *z == 1.0));
        grid.values[3 * 8 + 4] = f64::NAN;
        let holed = height_patch(&grid, [4.2, 4.2], 1.0, &shape);
        assert!(holed.iter().any(|z| z.is_nan()) && holed.contains(&1.0));
    }

    /// Rows reach along the heading, columns across it.
    #[test]
    fn val_a_patch_may_be_longer_than_wide() {
        let (grid, at) = (ground(), [107.3, 204.9]);
        let [long, square] = [[3.0, 0.6], [3.0, 3.0]].map(|size_m| {
            let shape = PatchShape::new(size_m, 0.2).unwrap();
            height_patch(&grid, at, 0.3, &shape)
        });
        for (row, col) in (0..15).flat_map(|row| (0..3).map(move |col| (row, col))) {
            assert_eq!(long[row * 3 + col], square[row * 15 + col + 6], "{row} {col}");
        }
    }

    #[test]
    fn val_relative_patches_are_zero_under_the_vehicle() {
        let (grid, at) = (ground(), [107.3, 204.9]);
        let shape = PatchShape::new([0.6, 0.6], 0.2).unwrap();
        let relative = relative_height_patch(&grid, at, 0.3, &shape);
        let under = grid.height(at[0], at[1]).unwrap();
        let heights = height_patch(&grid, at, 0.3, &shape);
        assert!(relative[4] == 0.0 && relative.iter().zip(&heights).all(|(r, h)| *r == h - under));
        assert!(relative_height_patch(&grid, [0.0, 0.0], 0.3, &shape).iter().all(|height| height.is_nan()));
    }

    #[test]
    fn val_a_side_is_a_whole_number_of_cells() {
        let shape =
            |size: f64, cell: f64| PatchShape::new([size, cell], cell).map(|shape| [shape.rows(), shape.cols()]);
        assert_eq!([shape(3.2, 0.1), shape(0.3, 0.1)], [Some([32, 1]), Some([3, 1])]);
        let refused =
            [(3.25, 0.1), (0.0, 0.1), (-3.2, -0.1), (1.0, 0.0), (f64::NAN, 0.1), (1.0, f64::NAN), (409.7, 0.1)];
        refused.iter().for_each(|(size, cell)| assert_eq!(shape(*size, *cell), None, "{size} {cell}"));
        assert_eq!(shape(409.6, 0.1), Some([4096, 1]));
        assert_eq!(shape(f64::INFINITY, 0.1), None);
        assert_eq!(PatchShape::new([1.0, 0.05], 0.1), None);
    }
}
