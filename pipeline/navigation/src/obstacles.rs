//! Polygonal obstacles that are blocked on a map.
//!
//! This blocks the cells that the polygon's edge touches (supercover) or whose centre lies inside (even-odd rule), and all cells within a margin of
//! those. (The thesis marks the cells of the edge as vertices, which would then lie inside the obstacle.)

use crate::map::{Node, TravelMap};
use sastrugi_schemas::{ParameterError, counted};

#[cfg(test)]
mod tests;

/// Why a polygon was refused. Messages read after "failed to".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObstacleError {
    /// Fewer than three distinct points.
    #[error("block a polygon of {}: it needs at least 3 distinct points", counted(.0, "point"))]
    Points(usize),
    /// A coordinate is not finite.
    #[error("block a polygon with the point ({x}, {y}): coordinates must be finite")]
    Coordinate {
        /// Easting, m.
        x: f64,
        /// Northing, m.
        y: f64,
    },
    /// The polygon has no area.
    #[error("block a polygon without area")]
    Flat,
    /// Edges cross.
    #[error("block a polygon whose edges {first} and {second} cross (counted from 0); split it into two polygons")]
    Crossing {
        /// Number of an edge.
        first: usize,
        /// Number of the other edge.
        second: usize,
    },
}

/// A validated polygon with its holes, in the raster's coordinates, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    rings: Vec<Vec<[f64; 2]>>,
}

impl Polygon {
    /// A polygon from the points of its outline in order, and those of each hole. Points that repeat the previous one are dropped, and a last point
    /// that repeats the first.
    ///
    /// # Errors
    /// A ring of fewer than three points, coordinates that are not finite, no area, or crossing edges of a ring.
    pub fn new(rings: Vec<Vec<[f64; 2]>>) -> Result<Self, ObstacleError> {
        if rings.is_empty() {
            return Err(ObstacleError::Points(0));
        }
        rings.into_iter().map(checked).collect::<Result<_, _>>().map(|rings| Self { rings })
    }

    /// Its rings: the outline, then the holes.
    pub fn rings(&self) -> &[Vec<[f64; 2]>] {
        &self.rings
    }

    fn edges(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        self.rings.iter().flat_map(|ring| edges(ring))
    }

    fn points(&self) -> impl Iterator<Item = [f64; 2]> {
        self.rings.iter().flatten().copied()
    }

    fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let crosses =
            |[a, b]: &[[f64; 2]; 2]| (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
        self.edges().filter(crosses).count() % 2 == 1
    }

    /// Distance from the polygon's edges to a rectangle, m; 0 if they touch.
    fn distance_m(&self, low: [f64; 2], high: [f64; 2]) -> f64 {
        self.edges().map(|edge| distance_to_rectangle(edge, low, high)).fold(f64::INFINITY, f64::min)
    }
}

fn edges(ring: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    (0..ring.len()).map(|k| [ring[k], ring[(k + 1) % ring.len()]])
}

/// Validates a ring and removes repeated points.
fn checked(mut ring: Vec<[f64; 2]>) -> Result<Vec<[f64; 2]>, ObstacleError> {
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    if let Some([x, y]) = ring.iter().find(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(ObstacleError::Coordinate { x: *x, y: *y });
    }
    if ring.len() < 3 {
        return Err(ObstacleError::Points(ring.len()));
    }
    let edges: Vec<[[f64; 2]; 2]> = edges(&ring).collect();
    // Relative to the first point, because far from the origin the area would be lost in rounding.
    if edges.iter().map(|[a, b]| turn(ring[0], *a, *b)).sum::<f64>() == 0.0 {
        return Err(ObstacleError::Flat);
    }
    for first in 0..edges.len() {
        for second in first + 1..edges.len() {
            let meets = match second - first {
                1 => folds_back(edges[first], edges[second]),
                apart if apart == edges.len() - 1 => folds_back(edges[second], edges[first]),
                _ => cross(edges[first], edges[second]),
            };
            if meets {
                return Err(ObstacleError::Crossing { first, second });
            }
        }
    }
    Ok(ring)
}

/// Blocks the cells of a polygon, and those whose rectangle lies within `margin_m` of it.
///
/// # Errors
/// A margin below 0 or not finite.
///
/// # Examples
/// ```
/// use sastrugi_navigation::obstacles::{Polygon, block};
/// use sastrugi_navigation::{SlopeLimits, TravelMap};
/// use sastrugi_numeric::{Geometry, Grid};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // The south-west corner of the map is at (0, 0). The square touches 3 x 3 cells of 1 m.
/// let heights = Grid::filled(Geometry::square(6, 6, 1.0), 0.0);
/// let mut map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
/// let square = Polygon::new(vec![vec![[1.5, 1.5], [3.5, 1.5], [3.5, 3.5], [1.5, 3.5]]])?;
/// block(&mut map, &square, 0.0)?;
/// assert_eq!((0..36).filter(|node| map.is_blocked(*node)).count(), 9);
/// # Ok(())
/// # }
/// ```
pub fn block(map: &mut TravelMap, polygon: &Polygon, margin_m: f64) -> Result<(), ParameterError> {
    ParameterError::not_negative("margin_m", margin_m)?;
    let geometry = map.heights().geometry;
    let [dx, dy] = geometry.cell;
    let bound = |axis: usize, end: fn(f64, f64) -> f64, from: f64| polygon.points().map(|p| p[axis]).fold(from, end);
    let [low, high] = [0, 1].map(|axis| {
        [bound(axis, f64::min, f64::INFINITY) - margin_m, bound(axis, f64::max, f64::NEG_INFINITY) + margin_m]
    });
    for node in 0..map.len() as Node {
        let [x, y] = map.position_m(node);
        let near = |value: f64, [from, to]: [f64; 2], half: f64| value + half >= from && value - half <= to;
        if !near(x, low, 0.5 * dx) || !near(y, high, 0.5 * dy) {
            continue;
        }
        let cell = [[x - 0.5 * dx, y - 0.5 * dy], [x + 0.5 * dx, y + 0.5 * dy]];
        if polygon.holds([x, y]) || polygon.distance_m(cell[0], cell[1]) <= margin_m {
            map.block(node);
        }
    }
    Ok(())
}

/// Blocks marked cells (`rows * cols` from the north-west), and those whose rectangle lies within `margin_m` of a marked cell's.
///
/// # Errors
/// A margin below 0 or not finite.
pub fn block_cells(map: &mut TravelMap, marked: &[bool], margin_m: f64) -> Result<(), ParameterError> {
    ParameterError::not_negative("margin_m", margin_m)?;
    let ([rows, cols], [dx, dy]) = (map.shape(), map.cell_m());
    let reach = |cell_m: f64, count: usize| libm::floor(margin_m / cell_m + 1.0).min(count as f64) as usize;
    let (down, across) = (reach(dy, rows), reach(dx, cols));
    let gap_m = |cells: usize, cell_m: f64| cells.saturating_sub(1) as f64 * cell_m;
    let near = |rows: usize, cols: usize| {
        let [y, x] = [gap_m(rows, dy), gap_m(cols, dx)];
        (rows, cols) == (0, 0) || margin_m > 0.0 && x * x + y * y <= margin_m * margin_m
    };
    for node in marked.iter().zip(0..).filter(|(marked, _)| **marked).map(|(_, node)| node) {
        let [row, col] = map.place(node);
        for r in row.saturating_sub(down)..(row + down + 1).min(rows) {
            for c in col.saturating_sub(across)..(col + across + 1).min(cols) {
                if near(row.abs_diff(r), col.abs_diff(c)) {
                    map.block(map.node(r, c));
                }
            }
        }
    }
    Ok(())
}

/// Twice the signed area of a triangle.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether an edge reverses over the previous one.
fn folds_back([a, b]: [[f64; 2]; 2], [_, c]: [[f64; 2]; 2]) -> bool {
    let ahead = (0..2).map(|k| (b[k] - a[k]) * (c[k] - b[k])).sum::<f64>();
    turn(a, b, c) == 0.0 && ahead < 0.0
}

/// Whether two edges have a point in common.
fn cross([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> bool {
    let [d1, d2, d3, d4] = [turn(c, d, a), turn(c, d, b), turn(a, b, c), turn(a, b, d)];
    if (d1 > 0.0) != (d2 > 0.0) && (d3 > 0.0) != (d4 > 0.0) && d1 * d2 != 0.0 && d3 * d4 != 0.0 {
        return true;
    }
    let between = |p: [f64; 2], [q, r]: [[f64; 2]; 2]| (0..2).all(|k| p[k] >= q[k].min(r[k]) && p[k] <= q[k].max(r[k]));
    d1 == 0.0 && between(a, [c, d])
        || d2 == 0.0 && between(b, [c, d])
        || d3 == 0.0 && between(c, [a, b])
        || d4 == 0.0 && between(d, [a, b])
}

fn distance_to_rectangle([a, b]: [[f64; 2]; 2], low: [f64; 2], high: [f64; 2]) -> f64 {
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let inside = |p: [f64; 2]| (0..2).all(|k| p[k] >= low[k] && p[k] <= high[k]);
    let sides = (0..4).map(|k| [corners[k], corners[(k + 1) % 4]]);
    if inside(a) || inside(b) || sides.clone().any(|side| cross([a, b], side)) {
        return 0.0;
    }
    let to_corners = corners.iter().map(|&corner| distance_to_segment(corner, [a, b]));
    let to_ends = sides.flat_map(|side| [a, b].map(|end| distance_to_segment(end, side)));
    to_corners.chain(to_ends).fold(f64::INFINITY, f64::min)
}

fn distance_to_segment(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let [ux, uy] = [b[0] - a[0], b[1] - a[1]];
    let squared = ux * ux + uy * uy;
    let t = if squared > 0.0 { (((p[0] - a[0]) * ux + (p[1] - a[1]) * uy) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let [vx, vy] = [a[0] + t * ux - p[0], a[1] + t * uy - p[1]];
    (vx * vx + vy * vy).sqrt()
}
