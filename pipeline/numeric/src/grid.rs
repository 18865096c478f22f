//! Regular grids of cells, and their positions.

use rayon::prelude::*;

/// Shape and position of a regular grid (conventions: see the crate header).
///
/// ```
/// use sastrugi_numeric::Geometry;
///
/// let g = Geometry { rows: 3, cols: 4, cell: [2.0, 1.0], origin: [10.0, 100.0] };
/// // Centre of the north-west cell.
/// assert_eq!((g.x(0), g.y(0)), (11.0, 102.5));
/// assert_eq!(g.cell_at(17.5, 100.2), Some((2, 3)));
/// assert_eq!(g.cell_at(18.5, 100.2), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Number of rows (north to south), at least 1.
    pub rows: usize,
    /// Number of columns (west to east), at least 1.
    pub cols: usize,
    /// Cell size east-west and north-south, m (or degrees while a raster is still geographic), both positive.
    pub cell: [f64; 2],
    /// South-west corner of the south-west cell, in the units of `cell`.
    pub origin: [f64; 2],
}

impl Geometry {
    /// A grid with square cells of `cell_m` metres and its south-west corner at the origin.
    pub fn square(rows: usize, cols: usize, cell_m: f64) -> Self {
        Self { rows, cols, cell: [cell_m; 2], origin: [0.0; 2] }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.rows * self.cols
    }

    /// True if the grid has no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Easting of the centre of column `col`.
    pub fn x(&self, col: usize) -> f64 {
        self.origin[0] + (col as f64 + 0.5) * self.cell[0]
    }

    /// Northing of the centre of row `row`.
    pub fn y(&self, row: usize) -> f64 {
        self.origin[1] + (self.rows as f64 - row as f64 - 0.5) * self.cell[1]
    }

    /// Extent east-west and north-south, edge to edge.
    pub fn size(&self) -> [f64; 2] {
        [self.cols as f64 * self.cell[0], self.rows as f64 * self.cell[1]]
    }

    /// True if the two grids overlap.
    pub fn overlaps(&self, other: &Self) -> bool {
        let (size, others) = (self.size(), other.size());
        (0..2).all(|axis| {
            self.origin[axis] < other.origin[axis] + others[axis] && other.origin[axis] < self.origin[axis] + size[axis]
        })
    }

    /// The cell that contains the point; `None` outside the grid, or if the point is not finite.
    pub fn cell_at(&self, x: f64, y: f64) -> Option<(usize, usize)> {
        let col = (x - self.origin[0]) / self.cell[0];
        let row = self.rows as f64 - (y - self.origin[1]) / self.cell[1];
        let inside = col >= 0.0 && row >= 0.0 && col < self.cols as f64 && row < self.rows as f64;
        inside.then_some((row as usize, col as usize))
    }

    /// Mean of the two cell sizes; for square cells, their size.
    pub fn mean_cell(&self) -> f64 {
        0.5 * (self.cell[0] + self.cell[1])
    }

    /// The geometry of the sub-grid that starts at `(row, col)`.
    pub fn window(&self, row: usize, col: usize, rows: usize, cols: usize) -> Self {
        let south = self.rows - row - rows;
        let origin = [self.origin[0] + col as f64 * self.cell[0], self.origin[1] + south as f64 * self.cell[1]];
        Self { rows, cols, cell: self.cell, origin }
    }
}

/// Values on a [`Geometry`], row-major from the north-west cell.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let grid = Grid::new(Geometry::square(2, 3, 0.5), vec![1.0, 2.0, f64::NAN, 4.0, 5.0, 6.0]);
/// assert_eq!(grid.at(1, 0), 4.0);
/// assert_eq!((grid.finite_count(), grid.range()), (5, Some((1.0, 6.0))));
/// // A window keeps its position: its south-west corner is one cell further east.
/// let part = grid.window(1, 1, 1, 2);
/// assert_eq!((part.row(0), part.geometry.origin), (&[5.0, 6.0][..], [0.5, 0.0]));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T = f64> {
    /// Shape and position.
    pub geometry: Geometry,
    /// `rows * cols` values, row 0 (north) first.
    pub values: Vec<T>,
}

impl<T> Grid<T> {
    /// Creates a grid from its values.
    ///
    /// # Panics
    /// If the number of values is not `rows * cols` (a bug of the caller).
    pub fn new(geometry: Geometry, values: Vec<T>) -> Self {
        assert_eq!(values.len(), geometry.len(), "a grid needs rows * cols values");
        Self { geometry, values }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.geometry.rows
    }

    /// Number of columns.
    pub fn cols(&self) -> usize {
        self.geometry.cols
    }

    /// Row `row`, west to east.
    pub fn row(&self, row: usize) -> &[T] {
        &self.values[row * self.cols()..(row + 1) * self.cols()]
    }
}

impl<T: Copy> Grid<T> {
    /// A grid with the same value everywhere.
    pub fn filled(geometry: Geometry, value: T) -> Self {
        Self { geometry, values: vec![value; geometry.len()] }
    }

    /// The value at `(row, col)`.
    pub fn at(&self, row: usize, col: usize) -> T {
        self.values[row * self.cols() + col]
    }

    /// The part of the grid that starts at `(row, col)`.
    ///
    /// # Panics
    /// If the part extends beyond the grid (a bug of the caller).
    pub fn window(&self, row: usize, col: usize, rows: usize, cols: usize) -> Self {
        assert!(row + rows <= self.rows() && col + cols <= self.cols(), "window extends beyond the grid");
        let values = (row..row + rows).flat_map(|r| self.row(r)[col..col + cols].iter().copied()).collect();
        Self { geometry: self.geometry.window(row, col, rows, cols), values }
    }
}

impl<T: Copy + Sync> Grid<T> {
    /// A grid of the same geometry with `f` applied to every value.
    pub fn map<U: Send>(&self, f: impl Fn(T) -> U + Sync + Send) -> Grid<U> {
        let values = self.values.par_iter().with_min_len(1 << 14).map(|&v| f(v)).collect();
        Grid { geometry: self.geometry, values }
    }
}

impl Grid<f64> {
    /// Number of cells with data.
    pub fn finite_count(&self) -> usize {
        self.values.iter().filter(|v| v.is_finite()).count()
    }

    /// Lowest and highest value, or `None` if no cell has data.
    pub fn range(&self) -> Option<(f64, f64)> {
        let finite = self.values.iter().copied().filter(|v| v.is_finite());
        finite.fold(None, |range, v| match range {
            None => Some((v, v)),
            Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
        })
    }

    /// The grid as stored in a release: single precision.
    pub fn to_f32(&self) -> Grid<f32> {
        self.map(|v| v as f32)
    }

    /// The grid rounded through single precision, as a reader of a release sees it.
    pub fn as_stored(&self) -> Self {
        self.map(|v| f64::from(v as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_overlap_of_grids() {
        let a = Geometry::square(10, 20, 0.5);
        let at = |origin: [f64; 2]| Geometry { origin, ..Geometry::square(4, 4, 1.0) };
        assert!(a.overlaps(&at([9.5, 4.5])) && at([-3.5, -3.5]).overlaps(&a) && a.overlaps(&a));
        assert!(!a.overlaps(&at([10.0, 0.0])) && !a.overlaps(&at([0.0, -4.0])));
    }

    #[test]
    fn val_cell_centres_follow_the_convention() {
        let g = Geometry { rows: 3, cols: 4, cell: [2.0, 1.0], origin: [10.0, 100.0] };
        assert_eq!((g.x(0), g.y(0)), (11.0, 102.5));
        assert_eq!((g.x(3), g.y(2)), (17.0, 100.5));
        assert_eq!(g.cell_at(11.0, 102.5), Some((0, 0)));
        assert_eq!(g.cell_at(18.0, 100.5), None);
        assert_eq!(g.cell_at(f64::NAN, 100.5), None);
        assert_eq!((g.size(), g.len(), g.mean_cell()), ([8.0, 3.0], 12, 1.5));
    }

    /// A cell holds its northern and western edges.
    #[test]
    fn val_cells_hold_their_northern_and_western_edges() {
        let g = Geometry { rows: 3, cols: 4, cell: [2.0, 1.0], origin: [10.0, 100.0] };
        let inside = [(10.0, 103.0, (0, 0)), (12.0, 102.0, (1, 1)), (17.9, 100.1, (2, 3)), (15.0, 102.5, (0, 2))];
        for (x, y, cell) in inside {
            assert_eq!(g.cell_at(x, y), Some(cell), "{x} {y}");
        }
        for (x, y) in [(9.99, 101.5), (18.0, 101.5), (11.0, 100.0), (11.0, 103.01)] {
            assert_eq!(g.cell_at(x, y), None, "{x} {y}");
        }
    }

    /// Cells without data have no part in the range; a release rounds to single precision.
    #[test]
    fn val_range_and_single_precision() {
        let grid = Grid::new(Geometry::square(1, 5, 1.0), vec![f64::NAN, 2.0, -3.0, f64::INFINITY, 0.1]);
        assert_eq!((grid.range(), grid.finite_count()), (Some((-3.0, 2.0)), 3));
        assert_eq!(Grid::filled(Geometry::square(2, 2, 1.0), f64::NAN).range(), None);
        assert_eq!((grid.to_f32().at(0, 4), grid.as_stored().at(0, 4)), (0.1_f32, f64::from(0.1_f32)));
        assert!(grid.as_stored().at(0, 0).is_nan());
    }

    #[test]
    #[should_panic(expected = "a grid needs rows * cols values")]
    fn val_a_missing_value_is_refused() {
        Grid::new(Geometry::square(2, 2, 1.0), vec![0.0; 3]);
    }

    #[test]
    #[should_panic(expected = "window extends beyond the grid")]
    fn val_a_window_beyond_the_grid_is_refused() {
        Grid::filled(Geometry::square(3, 3, 1.0), 0.0).window(1, 1, 2, 3);
    }

    #[test]
    fn val_a_window_keeps_its_position() {
        let g = Geometry { rows: 3, cols: 4, cell: [2.0, 1.0], origin: [10.0, 100.0] };
        let grid = Grid::new(g, (0..12).map(f64::from).collect());
        let part = grid.window(1, 2, 2, 2);
        assert_eq!(part.values, vec![6.0, 7.0, 10.0, 11.0]);
        assert_eq!(part.geometry.x(0), g.x(2));
        assert_eq!(part.geometry.y(0), g.y(1));
    }
}
