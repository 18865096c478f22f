//! Straight lines over a map: whether they are passable, and what they cost.
//!
//! A line between two nodes is divided into pieces of at most a quarter of a cell; heights between nodes are bilinear. The line is passable if every
//! piece is within the slope limits and no cell that it touches, even at a corner, is blocked (supercover). All returned paths are scored by this one
//! integral, whichever search found them, so that paths of different searches are comparable.

use crate::clearance::Clearance;
use crate::cost::CostModel;
use crate::map::{Direction, Node, Point, TravelMap};

#[cfg(test)]
mod tests;

/// Pieces per cell.
const PIECES: f64 = 4.0;
/// Relative rounding of a piece's slope: a step exactly at the limit stays within it when divided into pieces.
const ROUNDING: f64 = 1e-9;
/// A point within this distance of the side between two cells, in cells, counts for both, so that mirrored lines cost the same.
const SIDE: f64 = 1e-9;

/// Cost, length and steepness of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travelled {
    /// Cost, metres of level ground.
    pub cost: f64,
    /// Length on the ground, m.
    pub length_m: f64,
    /// Horizontal length, m.
    pub horizontal_m: f64,
    /// Steepest slopes uphill and downhill, rise over run, 0 or above.
    pub steepest: [f64; 2],
}

impl Travelled {
    /// A line of length 0.
    pub const NONE: Self = Self { cost: 0.0, length_m: 0.0, horizontal_m: 0.0, steepest: [0.0; 2] };

    /// Appends another line.
    ///
    /// ```
    /// use sastrugi_navigation::Travelled;
    ///
    /// let climb = Travelled { cost: 7.0, length_m: 5.0, horizontal_m: 4.0, steepest: [0.75, 0.0] };
    /// let descent = Travelled { cost: 4.0, length_m: 13.0, horizontal_m: 12.0, steepest: [0.0, 5.0 / 12.0] };
    /// let both = Travelled::NONE.then(climb).then(descent);
    /// assert_eq!((both.cost, both.length_m, both.steepest), (11.0, 18.0, [0.75, 5.0 / 12.0]));
    /// ```
    pub fn then(self, next: Self) -> Self {
        let steepest = [0, 1].map(|k| self.steepest[k].max(next.steepest[k]));
        Self {
            cost: self.cost + next.cost,
            length_m: self.length_m + next.length_m,
            horizontal_m: self.horizontal_m + next.horizontal_m,
            steepest,
        }
    }
}

/// A map with costs of travel.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The map.
    pub map: &'a TravelMap,
    /// Costs of travel.
    pub costs: &'a CostModel,
    /// Clearance, for a team of a given width.
    pub clearance: Option<&'a Clearance>,
}

impl Ground<'_> {
    /// The straight line between two nodes; `None` if it is not passable.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::{CostModel, Ground, SlopeCost, SlopeLimits, TravelMap};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let heights = Grid::filled(Geometry::square(3, 5, 1.0), 0.0);
    /// let mut map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
    /// map.block(map.node(1, 2));
    /// let costs = CostModel::new(SlopeCost::THESIS, None, &map)?;
    /// let ground = Ground { map: &map, costs: &costs, clearance: None };
    /// assert_eq!(ground.line(map.node(0, 0), map.node(0, 4)).map(|line| line.cost), Some(4.0));
    /// // Through the blocked cell.
    /// assert_eq!(ground.line(map.node(1, 0), map.node(1, 4)), None);
    /// # Ok(())
    /// # }
    /// ```
    pub fn line(&self, from: Node, to: Node) -> Option<Travelled> {
        self.segment(self.map.point(from), self.map.point(to))
    }

    /// The straight line between two points, `[row, column]`; `None` if it is not passable or leaves the map.
    pub fn segment(&self, start: Point, end: Point) -> Option<Travelled> {
        let along = direction_of([end[0] - start[0], end[1] - start[1]]);
        let mut travelled = Travelled::NONE;
        for_each_piece(self.map, start, end, |run_m, rise_m, middle| {
            let slope = rise_m / run_m;
            travelled = travelled.then(Travelled {
                cost: self.costs.piece(run_m, rise_m) * self.factor(middle, along),
                length_m: (run_m * run_m + rise_m * rise_m).sqrt(),
                horizontal_m: run_m,
                steepest: [slope.max(0.0), (-slope).max(0.0)],
            });
        })?;
        Some(travelled)
    }

    /// Cost factor at a point: that of its cell, or the mean over the free cells that share the side or corner that it lies on.
    fn factor(&self, point: Point, along: Direction) -> f64 {
        if self.clearance.is_none() && !self.costs.has_factors() {
            return 1.0;
        }
        let [rows, cols] = point.map(|at| [-SIDE, SIDE].map(|side| libm::floor(at + 0.5 + side) as usize));
        let cells = rows.into_iter().flat_map(|row| cols.map(|col| self.map.node(row, col)));
        let (count, sum) = cells.filter(|node| !self.map.is_blocked(*node)).fold((0.0, 0.0), |(count, sum), node| {
            let room = self.clearance.map_or(1.0, |clearance| clearance.multiplier(node, along));
            (count + 1.0, sum + self.costs.factor(node) * room)
        });
        sum / count
    }

    /// Straight lines from node to node; `None` if one is not passable.
    pub fn path(&self, nodes: &[Node]) -> Option<Travelled> {
        nodes.windows(2).try_fold(Travelled::NONE, |sum, pair| Some(sum.then(self.line(pair[0], pair[1])?)))
    }
}

/// Whether the straight line between two points, `[row, column]`, is passable; false if it leaves the map.
pub fn is_passable(map: &TravelMap, start: Point, end: Point) -> bool {
    for_each_piece(map, start, end, |_, _, _| ()).is_some()
}

/// Calls `visit` with run (m), rise (m) and midpoint of each piece of a line, up to the first that is too steep; `None` if the line is not passable.
fn for_each_piece(map: &TravelMap, start: Point, end: Point, mut visit: impl FnMut(f64, f64, Point)) -> Option<()> {
    if !map.is_free_along(start, end) {
        return None;
    }
    let span = [end[0] - start[0], end[1] - start[1]];
    let [dx, dy] = map.cell_m();
    let count = libm::ceil(PIECES * span[0].abs().max(span[1].abs()));
    let run_m = ((span[1] * dx) * (span[1] * dx) + (span[0] * dy) * (span[0] * dy)).sqrt() / count;
    let point = |k: f64| [0, 1].map(|axis| start[axis] + span[axis] * (k / count));
    let mut before_m = map.height_at_m(start)?;
    for k in 0..count as usize {
        let after_m = map.height_at_m(point((k + 1) as f64))?;
        let rise_m = after_m - before_m;
        let slope = rise_m / run_m;
        let rounding = ROUNDING * slope.abs() + 8.0 * f64::EPSILON * before_m.abs().max(after_m.abs()) / run_m;
        if !map.limits().allow((slope.abs() - rounding).max(0.0).copysign(slope)) {
            return None;
        }
        visit(run_m, rise_m, point(k as f64 + 0.5));
        before_m = after_m;
    }
    Some(())
}

/// The nearest of the eight directions to a line, `[rows, columns]`.
fn direction_of([down, across]: [f64; 2]) -> Direction {
    // Half the angle between directions: tan(22.5 degrees).
    const HALF: f64 = 0.414_213_562_373_095_05;
    let sign = |value: f64, other: f64| match value.abs() > HALF * other.abs() {
        true if value > 0.0 => 1,
        true => -1,
        false => 0,
    };
    Direction { rows: sign(down, across), cols: sign(across, down) }
}
