//! The map to plan on: heights, blocked cells and slope limits.

use sastrugi_numeric::Grid;
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

#[cfg(test)]
mod tests;

/// A cell: row times the number of columns, plus column.
pub type Node = u32;

/// A position between nodes, as row and column; nodes are at integers.
pub type Point = [f64; 2];

/// Largest number of cells of a map.
const NODES_MAX: usize = 1 << 30;

/// Why a map was refused. Messages read after "failed to".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    /// Too few or too many cells; a path needs cells in both directions.
    #[error("plan on {rows} x {cols} cells: a map needs at least 2 x 2 and at most {NODES_MAX} in all")]
    Size {
        /// Rows.
        rows: usize,
        /// Columns.
        cols: usize,
    },
    /// The number of values differs from the number of cells.
    #[error("plan on {values} heights for {rows} x {cols} cells: there must be one for each cell")]
    Length {
        /// Number of values.
        values: usize,
        /// Rows.
        rows: usize,
        /// Columns.
        cols: usize,
    },
    /// The cell size is not positive.
    #[error("plan on cells of {} m by {} m: both sides must be finite and above 0", cell_m[0], cell_m[1])]
    Cell {
        /// Cell size east-west and north-south, m.
        cell_m: [f64; 2],
    },
    /// A height is infinite.
    #[error(
        "plan on a height of {height_m} m (row {row}, column {col}): heights must be finite; cells without data are NaN"
    )]
    Height {
        /// Row.
        row: usize,
        /// Column.
        col: usize,
        /// The height, m.
        height_m: f64,
    },
}

/// Steepest slopes that are allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeLimits {
    up_deg: f64,
    down_deg: f64,
    /// Rise over run.
    up: f64,
    down: f64,
}

impl SlopeLimits {
    /// Limits uphill and downhill, degrees, above 0 and below 90.
    ///
    /// # Errors
    /// A limit out of range.
    ///
    /// ```
    /// use sastrugi_navigation::SlopeLimits;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let limits = SlopeLimits::new(20.0, 30.0)?;
    /// // Rise over run in the direction of travel: 26.6 degrees is too steep to climb, but not to descend.
    /// assert!(!limits.allow(0.5) && limits.allow(-0.5));
    /// assert!(SlopeLimits::new(20.0, 90.0).is_err());
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(up_deg: f64, down_deg: f64) -> Result<Self, ParameterError> {
        for (key, value) in [("max_up_deg", up_deg), ("max_down_deg", down_deg)] {
            if !(value > 0.0 && value < 90.0) {
                return Err(ParameterError::new(key, format!("is {value}; it must lie above 0 and below 90 degrees")));
            }
        }
        let [up, down] = [up_deg, down_deg].map(|deg| libm::tan(deg.to_radians()));
        Ok(Self { up_deg, down_deg, up, down })
    }

    /// Uphill and downhill, degrees.
    pub fn degrees(&self) -> [f64; 2] {
        [self.up_deg, self.down_deg]
    }

    /// Whether a slope (rise over run in the direction of travel) is within the limits.
    #[inline]
    pub fn allow(&self, slope: f64) -> bool {
        slope <= self.up && slope >= -self.down
    }
}

/// The neighbours that a step may lead to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Neighbourhood {
    /// East, north, west, south (the thesis).
    #[default]
    Four,
    /// The diagonals too, without cutting the corner of a blocked cell.
    Eight,
}

impl Neighbourhood {
    /// The number of neighbours in words: `four` or `eight`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Four => "four",
            Self::Eight => "eight",
        }
    }

    /// Its directions, in the order used by every loop.
    pub fn directions(self) -> &'static [Direction] {
        match self {
            Self::Four => &Direction::ALL[..4],
            Self::Eight => &Direction::ALL,
        }
    }
}

/// A step to a neighbouring cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Direction {
    /// Rows, southward.
    pub rows: i8,
    /// Columns, eastward.
    pub cols: i8,
}

impl Direction {
    /// East, north, west, south, then the diagonals between them.
    pub const ALL: [Self; 8] = [
        Self { rows: 0, cols: 1 },
        Self { rows: -1, cols: 0 },
        Self { rows: 0, cols: -1 },
        Self { rows: 1, cols: 0 },
        Self { rows: -1, cols: 1 },
        Self { rows: -1, cols: -1 },
        Self { rows: 1, cols: -1 },
        Self { rows: 1, cols: 1 },
    ];

    /// Index in [`Self::ALL`]; 8 for any other direction.
    fn index(self) -> usize {
        const INDICES: [[usize; 3]; 3] = [[5, 1, 4], [2, 8, 0], [6, 3, 7]];
        let at = |k: i8| usize::try_from(i16::from(k) + 1).unwrap_or(3);
        INDICES.get(at(self.rows)).and_then(|row| row.get(at(self.cols))).copied().unwrap_or(8)
    }

    /// The opposite direction.
    pub fn back(self) -> Self {
        Self { rows: -self.rows, cols: -self.cols }
    }

    /// True for diagonal directions.
    pub fn is_diagonal(self) -> bool {
        self.rows != 0 && self.cols != 0
    }
}

/// Heights with blocked cells and slope limits.
#[derive(Clone, Debug)]
pub struct TravelMap {
    heights: Grid,
    blocked: Vec<bool>,
    limits: SlopeLimits,
    /// Bit k: the k-th step of [`Direction::ALL`] is allowed.
    steps: Vec<u8>,
}

/// Indices of east, north, north-east and north-west; with their opposites, two indices later, these are all eight directions.
const HALF: [usize; 4] = [0, 1, 4, 5];

impl TravelMap {
    /// Builds a map from heights in m; cells without data (NaN) are blocked.
    ///
    /// # Errors
    /// Fewer than two rows or columns, too many cells, a number of values other than that of cells, a cell size that is not positive, or an infinite
    /// height.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::{Direction, SlopeLimits, TravelMap};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// // Cells of 2 m. The ground rises by 1 m from the first column to the second; one cell has no data.
    /// let heights = Grid::new(Geometry::square(2, 3, 2.0), vec![0.0, 1.0, 1.0, 0.0, 1.0, f64::NAN]);
    /// let map = TravelMap::new(heights, SlopeLimits::new(20.0, 30.0)?)?;
    /// let east = Direction { rows: 0, cols: 1 };
    /// // 26.6 degrees: too steep to climb, gentle enough to descend.
    /// assert_eq!(map.accessible(map.node(0, 0), east), None);
    /// assert_eq!(map.accessible(map.node(0, 1), east.back()), Some(map.node(0, 0)));
    /// assert!(map.is_blocked(map.node(1, 2)));
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(heights: Grid, limits: SlopeLimits) -> Result<Self, MapError> {
        let (rows, cols, cell_m) = (heights.rows(), heights.cols(), heights.geometry.cell);
        if rows < 2 || cols < 2 || rows.checked_mul(cols).is_none_or(|count| count > NODES_MAX) {
            return Err(MapError::Size { rows, cols });
        }
        if heights.values.len() != rows * cols {
            return Err(MapError::Length { values: heights.values.len(), rows, cols });
        }
        if !cell_m.iter().all(|side| *side > 0.0 && side.is_finite()) {
            return Err(MapError::Cell { cell_m });
        }
        if let Some(k) = heights.values.iter().position(|z| z.is_infinite()) {
            return Err(MapError::Height { row: k / cols, col: k % cols, height_m: heights.values[k] });
        }
        let blocked = heights.values.iter().map(|z| z.is_nan()).collect();
        let mut map = Self { steps: vec![0; rows * cols], heights, blocked, limits };
        map.update_steps(0..rows, 0..cols);
        Ok(map)
    }

    /// The heights.
    pub fn heights(&self) -> &Grid {
        &self.heights
    }

    /// The slope limits.
    pub fn limits(&self) -> SlopeLimits {
        self.limits
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.blocked.len()
    }

    /// True without nodes; a checked map always has some.
    pub fn is_empty(&self) -> bool {
        self.blocked.is_empty()
    }

    /// Rows and columns.
    #[inline]
    pub fn shape(&self) -> [usize; 2] {
        [self.heights.rows(), self.heights.cols()]
    }

    /// Cell size east-west and north-south, m.
    #[inline]
    pub fn cell_m(&self) -> [f64; 2] {
        self.heights.geometry.cell
    }

    /// The node at a row and a column.
    #[inline]
    pub fn node(&self, row: usize, col: usize) -> Node {
        (row * self.heights.cols() + col) as Node
    }

    /// Row and column of a node.
    #[inline]
    pub fn place(&self, node: Node) -> [usize; 2] {
        let cols = self.heights.cols();
        [node as usize / cols, node as usize % cols]
    }

    /// Easting and northing of a node in the raster's coordinates, m.
    pub fn position_m(&self, node: Node) -> [f64; 2] {
        let [row, col] = self.place(node);
        [self.heights.geometry.x(col), self.heights.geometry.y(row)]
    }

    /// Height of a node, m; NaN without data.
    #[inline]
    pub fn height_m(&self, node: Node) -> f64 {
        self.heights.values[node as usize]
    }

    /// Whether a node cannot be entered.
    #[inline]
    pub fn is_blocked(&self, node: Node) -> bool {
        self.blocked[node as usize]
    }

    /// Blocks a node.
    pub fn block(&mut self, node: Node) {
        self.blocked[node as usize] = true;
        self.update_around(node);
    }

    /// Unblocks a node; a node without a height stays blocked.
    pub fn unblock(&mut self, node: Node) {
        self.blocked[node as usize] = self.height_m(node).is_nan();
        self.update_around(node);
    }

    /// Sets the height of a node, m; NaN removes it and blocks the node.
    ///
    /// # Errors
    /// An infinite height.
    pub fn set_height_m(&mut self, node: Node, height_m: f64) -> Result<(), MapError> {
        if height_m.is_infinite() {
            let [row, col] = self.place(node);
            return Err(MapError::Height { row, col, height_m });
        }
        self.heights.values[node as usize] = height_m;
        self.blocked[node as usize] |= height_m.is_nan();
        self.update_around(node);
        Ok(())
    }

    /// The node and its neighbours, which are all nodes whose steps depend on it.
    pub fn around(&self, node: Node) -> impl Iterator<Item = Node> {
        let ([row, col], [rows, cols]) = (self.place(node), self.shape());
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        near(row, rows).flat_map(move |r| near(col, cols).map(move |c| (r * cols + c) as Node))
    }

    fn update_around(&mut self, node: Node) {
        let ([row, col], [rows, cols]) = (self.place(node), self.shape());
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        self.update_steps(near(row, rows), near(col, cols));
    }

    /// Recomputes the steps from these nodes, and the steps back.
    fn update_steps(&mut self, rows: Range<usize>, cols: Range<usize>) {
        for row in rows {
            for col in cols.clone() {
                HALF.iter().for_each(|&k| self.update_step(row, col, k));
            }
        }
    }

    /// Recomputes the k-th step from a node, and the step back.
    fn update_step(&mut self, row: usize, col: usize, k: usize) {
        let direction = Direction::ALL[k];
        let Some([target_row, target_col]) = self.place_beside([row, col], direction) else { return };
        let [node, target] = [self.node(row, col) as usize, self.node(target_row, target_col) as usize];
        let beside = [self.node(row, target_col) as usize, self.node(target_row, col) as usize];
        // Along an axis, the adjacent cells are the two nodes themselves.
        let free = ![node, target, beside[0], beside[1]].iter().any(|n| self.blocked[*n]);
        let z = |n: usize| self.heights.values[n];
        let run_m = self.step_m(direction);
        let slopes = match direction.is_diagonal() {
            true => diagonal_slopes(z(node), z(beside[0]) + z(beside[1]), z(target), run_m),
            false => [(z(target) - z(node)) / run_m; 2],
        };
        let gentle = |sign: f64| free && slopes.iter().all(|slope| self.limits.allow(sign * slope));
        let [there, back] = [gentle(1.0), gentle(-1.0)].map(u8::from);
        self.steps[node] = self.steps[node] & !(1 << k) | there << k;
        self.steps[target] = self.steps[target] & !(4 << k) | back << (k + 2);
    }

    /// The neighbour of a node; `None` off the map.
    pub fn neighbour(&self, node: Node, direction: Direction) -> Option<Node> {
        self.place_beside(self.place(node), direction).map(|[row, col]| self.node(row, col))
    }

    fn place_beside(&self, [row, col]: [usize; 2], direction: Direction) -> Option<[usize; 2]> {
        let [rows, cols] = self.shape();
        let row = row.checked_add_signed(direction.rows.into()).filter(|row| *row < rows)?;
        let col = col.checked_add_signed(direction.cols.into()).filter(|col| *col < cols)?;
        Some([row, col])
    }

    /// Horizontal length of a step, m.
    #[inline]
    pub fn step_m(&self, direction: Direction) -> f64 {
        let [dx, dy] = self.cell_m();
        match direction {
            Direction { rows: 0, .. } => dx,
            Direction { cols: 0, .. } => dy,
            _ => (dx * dx + dy * dy).sqrt(),
        }
    }

    /// The node that a step from `node` leads to, if the step is allowed: the target is on the map and free, the slope is within the limits, and for
    /// a diagonal both adjacent cells are free. Bilinear ground is curved along a diagonal, so its slope is checked over quarters of the step.
    #[inline]
    pub fn accessible(&self, node: Node, direction: Direction) -> Option<Node> {
        self.may_step(node, direction.index()).then(|| self.beside(node, direction))
    }

    /// Whether the k-th step of [`Direction::ALL`] is allowed.
    #[inline]
    pub(crate) fn may_step(&self, node: Node, k: usize) -> bool {
        u16::from(self.steps[node as usize]) >> k & 1 == 1
    }

    /// The adjacent node in a direction; it must be on the map.
    #[inline]
    pub(crate) fn beside(&self, node: Node, direction: Direction) -> Node {
        let offset = i64::from(direction.rows) * self.heights.cols() as i64 + i64::from(direction.cols);
        (i64::from(node) + offset) as Node
    }

    /// A node as a point.
    pub fn point(&self, node: Node) -> Point {
        self.place(node).map(|k| k as f64)
    }

    /// The node nearest to a point.
    pub fn nearest(&self, point: Point) -> Node {
        let [rows, cols] = self.shape();
        let [row, col] = point.map(|k| libm::floor(k + 0.5) as usize);
        self.node(row.min(rows - 1), col.min(cols - 1))
    }

    /// The point at an easting and a northing in the raster's coordinates, m.
    #[inline]
    pub fn point_at(&self, [x_m, y_m]: [f64; 2]) -> Point {
        let geometry = &self.heights.geometry;
        let [dx, dy] = geometry.cell;
        [(geometry.y(0) - y_m) / dy, (x_m - geometry.x(0)) / dx]
    }

    /// Whether a point lies within the outer nodes, where heights are defined.
    pub fn holds(&self, [row, col]: Point) -> bool {
        let [rows, cols] = self.shape();
        row >= 0.0 && row <= (rows - 1) as f64 && col >= 0.0 && col <= (cols - 1) as f64
    }

    /// Bilinear height, m; `None` outside the outer nodes and where a height is missing.
    pub fn height_at_m(&self, point: Point) -> Option<f64> {
        if !self.holds(point) {
            return None;
        }
        let [row, col] = point;
        let (r, c) = (row as usize, col as usize);
        let [v, u] = [row - r as f64, col - c as f64];
        let at = |r: usize, c: usize| self.height_m(self.node(r, c));
        // A neighbour of weight 0 may lack a height.
        let across = |r: usize| if u > 0.0 { at(r, c) + (at(r, c + 1) - at(r, c)) * u } else { at(r, c) };
        let height_m = if v > 0.0 { across(r) + (across(r + 1) - across(r)) * v } else { across(r) };
        height_m.is_finite().then_some(height_m)
    }

    /// Whether all cells that the line between two points touches, even at a corner (supercover), are on the map and free.
    pub fn is_free_along(&self, start: Point, end: Point) -> bool {
        if !(self.holds(start) && self.holds(end)) {
            return false;
        }
        let cell = |point: Point| point.map(|k| libm::floor(k + 0.5) as i64);
        let ([mut row, mut col], [last_row, last_col]) = (cell(start), cell(end));
        let (row_step, col_step) = ((last_row - row).signum(), (last_col - col).signum());
        let [down, across] = [0, 1].map(|axis| (end[axis] - start[axis]).abs());
        // Distance from the start to the first side through which the line can leave its cell, in cells.
        let first = |at: f64, cell: i64, step: i64| 0.5 + step as f64 * (cell as f64 - at);
        let (mut to_side, mut to_end) = (first(start[1], col, col_step), first(start[0], row, row_step));
        let free = |row: i64, col: i64| !self.is_blocked(self.node(row as usize, col as usize));
        while free(row, col) {
            if (row, col) == (last_row, last_col) {
                return true;
            }
            // Compares to_side / across with to_end / down; exact between nodes.
            let (side, end) = (to_side * down, to_end * across);
            let sideways = row == last_row || col != last_col && side <= end;
            let lengthways = col == last_col || row != last_row && end <= side;
            if sideways && lengthways && !(free(row + row_step, col) && free(row, col + col_step)) {
                return false;
            }
            if sideways {
                (col, to_side) = (col + col_step, to_side + 1.0);
            }
            if lengthways {
                (row, to_end) = (row + row_step, to_end + 1.0);
            }
        }
        false
    }
}

/// Slopes over the first and the last quarter of a diagonal step. Those of the middle quarters lie between them, because the height along the step is
/// quadratic. `beside_m` is the sum of the heights of the two adjacent cells.
fn diagonal_slopes(start_m: f64, beside_m: f64, end_m: f64, run_m: f64) -> [f64; 2] {
    let height_m = |t: f64| start_m * (1.0 - t) * (1.0 - t) + beside_m * t * (1.0 - t) + end_m * t * t;
    [(height_m(0.25) - start_m) / (0.25 * run_m), (end_m - height_m(0.75)) / (0.25 * run_m)]
}
