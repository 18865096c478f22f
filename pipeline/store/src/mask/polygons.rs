//! Cells inside polygons.
//!
//! A point is inside a polygon if a ray from it to the west crosses the polygon's rings an odd number of times (even-odd
//! rule; holes are further rings), and inside a mask if it is inside any of its polygons. An edge from (x1, y1) to (x2, y2) is
//! crossed at y if y1 <= y < y2 or y2 <= y < y1, at
//!
//! $$ x_c = x_1 + (y - y_1) \frac{x_2 - x_1}{y_2 - y_1}, $$
//!
//! and lies to the west of a point at x if x_c <= x. Polygons that share an edge therefore neither overlap nor leave a gap.
//!
//! Cells are found row by row: each crossing flips the state of the first cell centre to its east and of all that follow.
//! Cost: O(crossings of edges and rows + cells of each polygon's bounding box).

use crate::geojson::polygons::Polygon;
use sastrugi_numeric::Geometry;

/// Marks the cells whose centre is inside one of the polygons.
pub(super) fn inside(polygons: &[Polygon], geometry: &Geometry) -> Vec<bool> {
    let mut cells = vec![false; geometry.len()];
    polygons.iter().for_each(|polygon| mark(polygon, geometry, &mut cells));
    cells
}

/// The edges of a polygon; the last position of a ring is joined to the first.
fn edges(polygon: &Polygon) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    polygon.iter().flat_map(|ring| ring.iter().copied().zip(ring.iter().copied().cycle().skip(1)))
}

/// Easting at which an edge is crossed at `y`. Computed from the lower end, so that an edge and the same edge of a neighbour,
/// which runs the other way, are crossed at bit-identical eastings.
fn crossing(a: [f64; 2], b: [f64; 2], y: f64) -> f64 {
    let (a, b) = if a[1] <= b[1] { (a, b) } else { (b, a) };
    a[0] + (y - a[1]) * ((b[0] - a[0]) / (b[1] - a[1]))
}

fn mark(polygon: &Polygon, g: &Geometry, cells: &mut [bool]) {
    let bounds = |axis: usize| {
        let all = || polygon.iter().flatten().map(|position| position[axis]);
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    };
    let ((west, east), (south, north)) = (bounds(0), bounds(1));
    // No edge crosses a centre on the northern bound; extra columns or rows do no harm.
    let (first, last) = (row_at_or_below(g, north), row_at_or_below(g, south).saturating_add(1).min(g.rows));
    let (left, right) = (column_from(g, west), column_from(g, east).saturating_add(1).min(g.cols));
    if first >= last || left >= right {
        return;
    }
    let wide = right - left;
    let mut turns = vec![false; (last - first) * wide];
    for (a, b) in edges(polygon) {
        let (low, high) = (f64::min(a[1], b[1]), f64::max(a[1], b[1]));
        for row in row_at_or_below(g, high).max(first)..last {
            let y = g.y(row);
            if y < low {
                break;
            }
            if (a[1] <= y) != (b[1] <= y) {
                let col = column_from(g, crossing(a, b, y)).max(left);
                if col < right {
                    turns[(row - first) * wide + col - left] ^= true;
                }
            }
        }
    }
    for (turns, row) in turns.chunks_exact(wide).zip(first..last) {
        let mut within = false;
        for (cell, turn) in cells[row * g.cols + left..row * g.cols + right].iter_mut().zip(turns) {
            within ^= turn;
            *cell |= within;
        }
    }
}

/// The first column whose centre is at `x` or east of it; `cols` if there is none.
fn column_from(g: &Geometry, x: f64) -> usize {
    let guess = ((x - g.origin[0]) / g.cell[0] - 0.5).ceil();
    first_that(g.cols, guess, |col| g.x(col) >= x)
}

/// The first row whose centre is at `y` or south of it; `rows` if there is none.
fn row_at_or_below(g: &Geometry, y: f64) -> usize {
    let guess = (g.rows as f64 - (y - g.origin[1]) / g.cell[1] - 0.5).ceil();
    first_that(g.rows, guess, |row| g.y(row) <= y)
}

/// The first of `0..n` for which `holds` is true, from a guess that rounding may have shifted; `holds` must be monotonic.
fn first_that(n: usize, guess: f64, holds: impl Fn(usize) -> bool) -> usize {
    // Casting saturates, and turns NaN into 0.
    let mut at = (guess as usize).min(n);
    while at > 0 && holds(at - 1) {
        at -= 1;
    }
    while at < n && !holds(at) {
        at += 1;
    }
    at
}

#[cfg(test)]
pub(super) mod oracle {
    use super::*;

    /// The definition, point by point.
    pub fn contains(polygon: &Polygon, x: f64, y: f64) -> bool {
        let crossed = |(a, b): &([f64; 2], [f64; 2])| (a[1] <= y) != (b[1] <= y) && crossing(*a, *b, y) <= x;
        edges(polygon).filter(crossed).count() % 2 == 1
    }
}
