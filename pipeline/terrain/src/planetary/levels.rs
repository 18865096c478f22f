//! The lattice: the points of a patch, and what lies near them.
//!
//! Lattice points are pairs of integers `(i, j)`, i east and j north, `spacing_m` apart. Let `2^k` be the largest power of 2 that divides
//! both. If exactly one of `i / 2^k`, `j / 2^k` is odd, the point has level `2 k + 1`; if both are, it has level `2 k + 2`. Points of
//! level `2 k + 1` and above form a grid of spacing `2^k`. The parents of a point of level `2 k + 1` are its four neighbours
//! `2^k` away along the axes, those of a point of level `2 k + 2` its four neighbours along the diagonals; all have a higher level.
//!
//! The points of level `2 k + 1` are also the centres of a tiling of the plane by diamonds `|dx| + |dy| <= 2^k`, of area `2^(2 k + 1)`: the
//! paper's "diagonally oriented squares". Diamonds about the both-odd points would cover only half of the plane.

use std::ops::Range;

/// A rectangle of lattice points, `2^zoom` apart: columns starting at `west` and rows starting at `south`, counted in that spacing. A centred
/// window has the points midway between these and their neighbours to the north-east, as map tiles need.
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

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One point, `(i, j)` in units of `2^zoom`.
    pub(super) fn point(zoom: u32, i: i64, j: i64) -> Self {
        Self { zoom, west: i, south: j, cols: 1, rows: 1, centred: false }
    }

    /// The points of spacing `2^zoom` in the square with half side `reach` about a centre, lattice units.
    pub(super) fn about(zoom: u32, [x, y]: [f64; 2], reach: f64) -> Self {
        let unit = spacing(zoom);
        let first = |at: f64| ((at - reach) / unit).ceil() as i64;
        let count = |at: f64| (((at + reach) / unit).floor() as i64 - first(at) + 1).max(0) as usize;
        Self { zoom, west: first(x), south: first(y), cols: count(x), rows: count(y), centred: false }
    }

    /// Easting of a column, lattice units.
    pub fn x(&self, col: usize) -> f64 {
        self.lattice(self.west + col as i64) as f64
    }

    /// Northing of a row, lattice units.
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

    /// Offset of the points from those of the grid, in its spacing.
    fn shift(&self) -> f64 {
        if self.centred { 0.5 } else { 0.0 }
    }

    /// The points of twice the spacing from which this window's points, and the points that these depend on, descend; for a centred window, the
    /// grid points around its points.
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

    /// The south-west and the north-east points, lattice units.
    pub(super) fn corners(&self) -> [[f64; 2]; 2] {
        [[self.x(0), self.y(0)], [self.x(self.cols - 1), self.y(self.rows - 1)]]
    }

    /// Whether a position is so far outside that no point lies within `reach` of it along both axes; lattice units.
    pub(super) fn misses(&self, at: [f64; 2], reach: f64) -> bool {
        let [first, last] = self.corners();
        (0..2).any(|axis| at[axis] + reach < first[axis] || at[axis] - reach > last[axis])
    }

    /// The points within `reach` of a position along both axes, `None` if there are none; lattice units.
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

    /// The part as a window.
    pub(super) fn of_part(&self, part: &Part) -> Self {
        let (west, south) = (self.west + part.cols.start as i64, self.south + part.rows.start as i64);
        Self { west, south, cols: part.cols.len(), rows: part.rows.len(), ..*self }
    }

    /// The index in [`Self`]'s row-major values (south first) of the point `(i, j)` of spacing `2^zoom`, if it is one of them.
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

    /// Rectangles `[west, east, south, north]` in lattice units that cover everything within `reach` of a point of the window along both
    /// axes, without overlap: one square per point if these do not overlap, else a single rectangle.
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

    /// Approximate number of diamonds that [`Self::visit_diamonds`] visits.
    pub(super) fn diamonds(&self, zoom: u32, reach: f64) -> f64 {
        self.spread(zoom, reach, 1.0)
    }

    /// The ground within `reach` (lattice units) of a point of the window along both axes, in diamonds of a grid.
    pub(super) fn ground(&self, zoom: u32, reach: f64) -> f64 {
        self.spread(zoom, reach, 0.0)
    }

    /// Diamonds in squares about the window's points that are `more` grid spacings wider than the reach.
    fn spread(&self, zoom: u32, reach: f64, more: f64) -> f64 {
        let unit = spacing(zoom);
        let count = |low: f64, high: f64| (high - low) / unit + more;
        let apart = spacing(self.zoom) > 2.0 * reach + 1.0;
        let squares = if apart { self.len() as f64 } else { 1.0 };
        let first = self.surroundings(reach).next();
        first.map_or(0.0, |[west, east, south, north]| 0.5 * squares * count(west, east) * count(south, north))
    }

    /// Calls `f(i, j)` once for every lattice point of level `2 zoom + 1` within `reach` (lattice units) of a point of the window along
    /// both axes.
    pub(super) fn visit_diamonds(&self, zoom: u32, reach: f64, mut f: impl FnMut(i64, i64)) {
        let unit = spacing(zoom);
        for [west, east, south, north] in self.surroundings(reach) {
            let first = (west / unit).ceil() as i64;
            let last = (east / unit).floor() as i64;
            for b in (south / unit).ceil() as i64..=(north / unit).floor() as i64 {
                // Exactly one of the two is odd.
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

/// Largest radius of objects that strike the diamonds of a grid, in its spacing: with ejecta reaching 5 radii, a crater stays within the
/// adjacent diamonds, `5 / 4 <= sqrt(2)`.
pub(super) const RADIUS_SHARE: f64 = 0.25;

/// Objects in one range of diameters, a factor of 2 at most, that strike the diamonds of one grid.
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

/// Level of a lattice point; `None` for the origin, which has every level.
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

    /// The window of twice the spacing holds what a window and the ring around it descend from, and nothing more: its own points, and the four
    /// points around each one with two odd coordinates.
    #[test]
    fn prop_windows_of_parents_are_the_smallest() {
        let mut s = Streams::for_seed(1, "levels").stream("windows");
        for _ in 0..1000 {
            let [west, south] = [(); 2].map(|()| s.below(1 << 40) as i64 - (1 << 39));
            let [cols, rows] = [(); 2].map(|()| 1 + s.below(9) as usize);
            let parents = Window { zoom: 3, west, south, cols, rows, centred: false }.parents();
            let mut ends = [[i64::MAX, i64::MIN]; 2];
            let (across, up) = (west - 1..=west + cols as i64, south - 1..=south + rows as i64);
            for point in across.flat_map(|i| up.clone().map(move |j| [i, j])) {
                let around = match point.map(|at| at.rem_euclid(2)) {
                    [0, 0] => 0,
                    [1, 1] => 1,
                    // Points with one odd coordinate descend from these.
                    _ => continue,
                };
                for (axis, at) in point.into_iter().enumerate() {
                    ends[axis][0] = ends[axis][0].min((at - around) / 2);
                    ends[axis][1] = ends[axis][1].max((at + around) / 2);
                }
            }
            let found = [(parents.west, parents.cols), (parents.south, parents.rows)];
            assert_eq!(found.map(|(first, count)| [first, first + count as i64 - 1]), ends, "{west} {south}");
            assert_eq!((parents.zoom, parents.centred), (4, false));
        }
    }

    /// Points within reach of a position, and grid points in a square, as a search through all of them finds them.
    #[test]
    fn prop_parts_and_squares_hold_the_points_within_reach() {
        let mut s = Streams::for_seed(3, "levels").stream("parts");
        let (mut some, mut none) = (0, 0);
        for (zoom, centred) in [(0, false), (1, false), (3, false), (1, true), (3, true)] {
            let window = Window { zoom, west: -7, south: 3, cols: 9, rows: 6, centred };
            let unit = spacing(zoom);
            for _ in 0..300 {
                let at = [unit * s.uniform_in(-10.0, 5.0), unit * s.uniform_in(0.0, 12.0)];
                let reach = unit * s.uniform_in(0.0, 4.0);
                let cols: Vec<usize> = (0..9).filter(|col| (window.x(*col) - at[0]).abs() <= reach).collect();
                let rows: Vec<usize> = (0..6).filter(|row| (window.y(*row) - at[1]).abs() <= reach).collect();
                match window.part(at, reach) {
                    Some(part) => {
                        assert_eq!((part.cols.collect::<Vec<_>>(), part.rows.collect::<Vec<_>>()), (cols, rows));
                        some += 1;
                    }
                    None => {
                        assert!(cols.is_empty() || rows.is_empty(), "{zoom} {centred} {at:?} {reach}");
                        none += 1;
                    }
                }
                let square = Window::about(zoom, at, reach);
                let near = |axis: usize| -> Vec<f64> {
                    (-40..40).map(|k| unit * f64::from(k)).filter(move |p| (p - at[axis]).abs() <= reach).collect()
                };
                assert_eq!((0..square.cols).map(|col| square.x(col)).collect::<Vec<_>>(), near(0));
                assert_eq!((0..square.rows).map(|row| square.y(row)).collect::<Vec<_>>(), near(1));
            }
        }
        assert!(some > 100 && none > 100, "{some} {none}");
    }

    /// Points are found by their coordinates in their own spacing or a coarser one.
    #[test]
    fn val_points_are_found() {
        let window = Window { zoom: 2, west: -3, south: 5, cols: 4, rows: 3, centred: false };
        assert_eq!((window.find(2, -3, 5), window.find(2, 0, 7)), (Some(0), Some(11)));
        // (-1, 3) in steps of 8 is (-2, 6) in steps of 4: column 1 of row 1.
        assert_eq!(window.find(3, -1, 3), Some(5));
        for (i, j) in [(1, 5), (-4, 5), (-3, 4), (-3, 8)] {
            assert_eq!(window.find(2, i, j), None, "{i} {j}");
        }
        // In steps of 2, the columns of the centred window are -5, -3, -1 and 1, its rows 11, 13 and 15.
        let centred = Window { centred: true, ..window };
        assert_eq!((centred.find(1, -5, 11), centred.find(1, 1, 15)), (Some(0), Some(11)));
        assert_eq!((centred.find(1, -4, 11), centred.find(1, 3, 11), centred.find(2, -3, 5)), (None, None, None));
    }

    /// Ranges start at a quarter of a spacing, double, and cover the diameters without gaps.
    #[test]
    fn val_size_ranges_cover_the_diameters() {
        assert_eq!([0.5, 1.0, 2.0, 3.9, 4.0, 1e300].map(floor_log2), [0, 0, 1, 1, 2, 61]);
        let ranges: Vec<SizeRange> = size_ranges([1.0, 200.0], 0.01).collect();
        // 2^8 points of 1 cm are 2.56 m apart, a quarter of which is 0.64 m.
        assert_eq!((ranges.len(), ranges[0].zoom, ranges[8].zoom), (9, 8, 16));
        assert_eq!((ranges[0].diameters_m, ranges[8].diameters_m), ([1.0, 1.28], [163.84, 200.0]));
        assert!(ranges.windows(2).all(|pair| pair[0].diameters_m[1] == pair[1].diameters_m[0]));
        assert!((ranges[0].diamond_m2 - 2.0 * 2.56 * 2.56).abs() < 1e-12);
    }

    /// The estimate of the diamonds to visit, around points together and one by one; the ground counts in diamonds too.
    #[test]
    fn val_estimates_of_diamonds() {
        for (zoom, reach) in [(3, 20.3), (6, 10.0)] {
            let window = Window { zoom, west: -20, south: 5, cols: 40, rows: 30, centred: false };
            let mut visited = 0.0;
            window.visit_diamonds(1, reach, |_, _| visited += 1.0);
            assert!((window.diamonds(1, reach) / visited - 1.0).abs() < 0.03, "{zoom}: {visited}");
        }
        // 39 and 29 steps of 8, and 20.3 on either side, in diamonds of area 8.
        let window = Window { zoom: 3, west: -20, south: 5, cols: 40, rows: 30, centred: false };
        assert!((window.ground(1, 20.3) / (352.6 * 272.6 / 8.0) - 1.0).abs() < 1e-12);
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

    /// Whether points are handled one by one or together, each diamond is visited once.
    #[test]
    fn prop_diamonds_are_visited_once() {
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
