//! The lattice: which of its points a patch holds, and what lies near to them.
//!
//! Lattice points are pairs of integers `(i, j)`, i east and j north, `spacing_m` apart. With `k` the number of times that 2 divides
//! both: where one of `i / 2^k`, `j / 2^k` is odd the point has level `2 k + 1`, where both are it has level `2 k + 2`. Points of
//! level `2 k + 1` and above form a grid of spacing `2^k`. The parents of a point of level `2 k + 1` are its four neighbours
//! `2^k` away along the axes, those of a point of level `2 k + 2` its four neighbours along the diagonals: all of higher level.
//!
//! The points of level `2 k + 1` also carry a tiling of the plane by diamonds `|dx| + |dy| <= 2^k`, of area `2^(2 k + 1)`: the
//! paper's "diagonally oriented squares". The both-odd points would cover only half of it.

use std::ops::Range;

/// A rectangle of lattice points, `2^zoom` apart: columns from `west` and rows from `south` on, counted in that spacing. A centred one has the
/// points in the middle of these and their neighbours to the north and east, as map tiles ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Binary logarithm of the spacing in lattice units, at most 61.
    pub zoom: u32,
    /// Westernmost column.
    pub west: i64,
    /// Southernmost row.
    pub south: i64,
    /// Number of columns.
    pub cols: usize,
    /// Number of rows.
    pub rows: usize,
    /// Whether the points lie half a spacing north-east of those of the grid; `zoom` is then at least 1.
    pub centred: bool,
}

/// Columns and rows of a window, counted from its south-west point.
pub(super) struct Part {
    pub cols: Range<usize>,
    pub rows: Range<usize>,
}

impl Window {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.cols * self.rows
    }

    /// True when there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One point, `(i, j)` in units of `2^zoom`.
    pub(super) fn point(zoom: u32, i: i64, j: i64) -> Self {
        Self { zoom, west: i, south: j, cols: 1, rows: 1, centred: false }
    }

    /// The points of spacing `2^zoom` in the square of half side `reach` about a centre, lattice units.
    pub(super) fn about(zoom: u32, [x, y]: [f64; 2], reach: f64) -> Self {
        let unit = spacing(zoom);
        let first = |at: f64| ((at - reach) / unit).ceil() as i64;
        let count = |at: f64| (((at + reach) / unit).floor() as i64 - first(at) + 1).max(0) as usize;
        Self { zoom, west: first(x), south: first(y), cols: count(x), rows: count(y), centred: false }
    }

    /// East of a column, lattice units.
    pub fn x(&self, col: usize) -> f64 {
        self.lattice(self.west + col as i64) as f64
    }

    /// North of a row, lattice units.
    pub fn y(&self, row: usize) -> f64 {
        self.lattice(self.south + row as i64) as f64
    }

    /// The lattice point in a column and row.
    pub(super) fn place(&self, col: usize, row: usize) -> [i64; 2] {
        [self.west + col as i64, self.south + row as i64].map(|at| self.lattice(at))
    }

    fn lattice(&self, at: i64) -> i64 {
        if self.centred { (2 * at + 1) << (self.zoom - 1) } else { at << self.zoom }
    }

    /// Where the points lie between those of the grid, in its spacing.
    fn shift(&self) -> f64 {
        if self.centred { 0.5 } else { 0.0 }
    }

    /// The points of twice the spacing from which all of this window's points and what they are made from descend; of a centred window, those
    /// around its points.
    pub(super) fn parents(&self) -> Self {
        if self.centred {
            return Self { cols: self.cols + 1, rows: self.rows + 1, centred: false, ..*self };
        }
        let span = |first: i64, count: usize| {
            let low = (first - 1).div_euclid(2);
            (low, ((first + count as i64 + 1).div_euclid(2) - low + 1) as usize)
        };
        let ((west, cols), (south, rows)) = (span(self.west, self.cols), span(self.south, self.rows));
        Self { zoom: self.zoom + 1, west, south, cols, rows, centred: false }
    }

    /// The south-west and the north-east point, lattice units.
    pub(super) fn corners(&self) -> [[f64; 2]; 2] {
        [[self.x(0), self.y(0)], [self.x(self.cols - 1), self.y(self.rows - 1)]]
    }

    /// Whether a place is so far outside that no point lies within `reach` of it along either axis; lattice units.
    pub(super) fn misses(&self, at: [f64; 2], reach: f64) -> bool {
        let [first, last] = self.corners();
        (0..2).any(|axis| at[axis] + reach < first[axis] || at[axis] - reach > last[axis])
    }

    /// The points within `reach` of a place along either axis, `None` when there is none; lattice units.
    pub(super) fn part(&self, [x, y]: [f64; 2], reach: f64) -> Option<Part> {
        if self.misses([x, y], reach) {
            return None;
        }
        let (unit, shift) = (spacing(self.zoom), self.shift());
        let range = |at: f64, first: i64, count: usize| {
            let low = ((at - reach) / unit - shift).ceil() - first as f64;
            let high = ((at + reach) / unit - shift).floor() - first as f64;
            (low.max(0.0) as usize)..((high + 1.0).max(0.0) as usize).min(count)
        };
        let (cols, rows) = (range(x, self.west, self.cols), range(y, self.south, self.rows));
        (!cols.is_empty() && !rows.is_empty()).then_some(Part { cols, rows })
    }

    /// The part as a window of its own.
    pub(super) fn of_part(&self, part: &Part) -> Self {
        let (west, south) = (self.west + part.cols.start as i64, self.south + part.rows.start as i64);
        Self { west, south, cols: part.cols.len(), rows: part.rows.len(), ..*self }
    }

    /// The place in [`Self`]'s row-major values (south first) of the point `(i, j)` of spacing `2^zoom`, if it is among them.
    pub(super) fn find(&self, zoom: u32, i: i64, j: i64) -> Option<usize> {
        let (col, row) = if self.centred {
            // Both coordinates of its points are odd, in units of half the spacing.
            let odd = zoom + 1 == self.zoom && i & j & 1 == 1;
            odd.then_some((i.div_euclid(2) - self.west, j.div_euclid(2) - self.south))?
        } else {
            let shift = zoom.checked_sub(self.zoom)?;
            ((i << shift) - self.west, (j << shift) - self.south)
        };
        let inside = (0..self.cols as i64).contains(&col) && (0..self.rows as i64).contains(&row);
        inside.then(|| row as usize * self.cols + col as usize)
    }

    /// The squares, as `[west, east, south, north]` in lattice units, that hold everything within `reach` of a point of the window
    /// along either axis, no ground twice: one square for each point where these stay apart, else one rectangle.
    fn surroundings(&self, reach: f64) -> impl Iterator<Item = [f64; 4]> {
        let apart = spacing(self.zoom) > 2.0 * reach + 1.0;
        let (across, up) = if apart { (self.cols, self.rows) } else { (1, 1) };
        let (last_col, last_row) = if apart { (0, 0) } else { (self.cols - 1, self.rows - 1) };
        let window = *self;
        (0..up * across).map(move |k| {
            let (row, col) = (k / across, k % across);
            let [x, y] = [window.x(col), window.y(row)];
            [x - reach, window.x(col + last_col) + reach, y - reach, window.y(row + last_row) + reach]
        })
    }

    /// How many diamonds [`Self::visit_diamonds`] goes through, roughly.
    pub(super) fn diamonds(&self, zoom: u32, reach: f64) -> f64 {
        self.spread(zoom, reach, 1.0)
    }

    /// The ground within `reach` (lattice units) of a point of the window along either axis, in diamonds of a grid.
    pub(super) fn ground(&self, zoom: u32, reach: f64) -> f64 {
        self.spread(zoom, reach, 0.0)
    }

    /// Diamonds in squares about the window's points, that are `more` grid spacings wider than the reach.
    fn spread(&self, zoom: u32, reach: f64, more: f64) -> f64 {
        let unit = spacing(zoom);
        let count = |low: f64, high: f64| (high - low) / unit + more;
        let apart = spacing(self.zoom) > 2.0 * reach + 1.0;
        let squares = if apart { self.len() as f64 } else { 1.0 };
        let first = self.surroundings(reach).next();
        first.map_or(0.0, |[west, east, south, north]| 0.5 * squares * count(west, east) * count(south, north))
    }

    /// Calls `f(i, j)` for every lattice point of level `2 zoom + 1` within `reach` (lattice units) of a point of the window along
    /// either axis, once each.
    pub(super) fn visit_diamonds(&self, zoom: u32, reach: f64, mut f: impl FnMut(i64, i64)) {
        let unit = spacing(zoom);
        for [west, east, south, north] in self.surroundings(reach) {
            let first = (west / unit).ceil() as i64;
            let last = (east / unit).floor() as i64;
            for b in (south / unit).ceil() as i64..=(north / unit).floor() as i64 {
                // One of the two is odd, not both.
                let start = first + i64::from((first + b).rem_euclid(2) == 0);
                (start..=last).step_by(2).for_each(|a| f(a << zoom, b << zoom));
            }
        }
    }
}

/// `2^zoom`.
pub(super) fn spacing(zoom: u32) -> f64 {
    (1u64 << zoom) as f64
}

/// Largest radius of what strikes the diamonds of a grid, in its spacing: with ejecta of 5 radii a crater stays within the adjoining
/// diamonds, `5 / 4 <= sqrt(2)`.
pub(super) const RADIUS_SHARE: f64 = 0.25;

/// Objects of one range of diameters, a factor of 2 or less, that strike the diamonds of one grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizeRange {
    /// Binary logarithm of the grid's spacing.
    pub zoom: u32,
    /// Smallest and largest diameter, m.
    pub diameters_m: [f64; 2],
    /// Area of a diamond, m2.
    pub diamond_m2: f64,
}

/// The ranges between two diameters (m) on a lattice with points `spacing_m` apart.
pub(super) fn size_ranges([low, high]: [f64; 2], spacing_m: f64) -> impl Iterator<Item = SizeRange> {
    let first = floor_log2(low / (RADIUS_SHARE * spacing_m));
    let range = move |zoom: u32| {
        let side = spacing(zoom) * spacing_m;
        let width = RADIUS_SHARE * side;
        SizeRange { zoom, diameters_m: [width.max(low), (2.0 * width).min(high)], diamond_m2: 2.0 * side * side }
    };
    (first..62).map(range).take_while(move |r| r.diameters_m[0] < high)
}

/// The largest `k` with `2^k <= value`, 0 for smaller ones.
pub(super) fn floor_log2(value: f64) -> u32 {
    (1..62).take_while(|k| spacing(*k) <= value).last().unwrap_or(0)
}

/// Level of a lattice point; `None` for the origin, which is of every level.
#[cfg(test)]
pub(super) fn level(i: i64, j: i64) -> Option<u32> {
    let k = (i | j).trailing_zeros();
    let both_odd = (i >> k.min(63)) & (j >> k.min(63)) & 1 == 1;
    (i | j != 0).then_some(2 * k + if both_odd { 2 } else { 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    fn parents(i: i64, j: i64) -> [[i64; 2]; 4] {
        let step = 1 << (i | j).trailing_zeros();
        let diagonal = (i / step) & (j / step) & 1 != 0;
        let offsets = if diagonal { [[-1, -1], [1, -1], [-1, 1], [1, 1]] } else { [[-1, 0], [1, 0], [0, -1], [0, 1]] };
        offsets.map(|[a, b]| [i + a * step, j + b * step])
    }

    /// Parents have higher levels.
    #[test]
    fn prop_parents_have_higher_levels() {
        let mut s = Streams::for_seed(1, "levels").stream("points");
        for _ in 0..10_000 {
            let (i, j) = ((s.bits() as i32 as i64) << s.below(20), (s.bits() as i32 as i64) << s.below(20));
            for [a, b] in parents(i, j).into_iter().filter(|_| i | j != 0) {
                assert!(a | b == 0 || level(a, b) > level(i, j), "({i}, {j}) ({a}, {b})");
            }
        }
    }

    /// Each point of the plane lies in exactly one diamond.
    #[test]
    fn prop_diamonds_tile_the_plane() {
        let mut s = Streams::for_seed(2, "levels").stream("points");
        for _ in 0..2000 {
            let zoom = s.below(12) as u32;
            let [x, y] = [(); 2].map(|()| s.uniform_in(-9000.0, 9000.0));
            let mut inside = 0;
            let near = Window::point(0, x.round() as i64, y.round() as i64);
            near.visit_diamonds(zoom, spacing(zoom) + 2.0, |i, j| {
                assert_eq!(level(i, j), Some(2 * zoom + 1));
                inside += usize::from((x - i as f64).abs() + (y - j as f64).abs() < spacing(zoom));
            });
            assert_eq!(inside, 1);
        }
    }

    /// Whether the surroundings of points are gone through one by one or together, the same diamonds come once each.
    #[test]
    fn prop_diamonds_come_once() {
        for (zoom, reach) in [(3, 3.0), (3, 3.4), (3, 3.6), (3, 20.0), (6, 30.0)] {
            let window = Window { zoom, west: -3, south: 5, cols: 4, rows: 3, centred: false };
            let mut found = Vec::new();
            window.visit_diamonds(1, reach, |i, j| found.push([i, j]));
            let near = |i: i64, j: i64| {
                let within = |at: f64, i: i64| (at - i as f64).abs() <= reach;
                (0..12).any(|k| within(window.x(k % 4), i) && within(window.y(k / 4), j))
            };
            let all = (-600..600).flat_map(|i| (0..1200).map(move |j| [i, j]));
            let mut expected: Vec<_> = all.filter(|&[i, j]| level(i, j) == Some(3) && near(i, j)).collect();
            found.sort_unstable();
            expected.sort_unstable();
            let duplicates = found.windows(2).filter(|w| w[0] == w[1]).count();
            assert_eq!(duplicates, 0);
            assert!(expected.iter().all(|e| found.contains(e)), "{zoom} {reach}");
        }
    }
}
