//! Intersection of rays with a surface, and cast shadows.
//!
//! Heights are bilinear between four neighbouring cell centres. Over such a *patch* the height of a straight ray above the surface is a
//! parabola in the distance along the ray,
//!
//! $$ F(s) = F_0 + F_1 s + F_2 s^2, \qquad F_2 = -d\,\dot u\,\dot v, $$
//!
//! with the patch `z = a + b u + c v + d u v` and the ray's speeds `du/ds`, `dv/ds` in cells per metre. Its first root is the point that a
//! camera sees; if it falls below 0 on the way to the sun, the start of the ray lies in shadow. Both are exact up to rounding: there is no
//! step size.
//!
//! A ray proceeds from patch to patch, and skips blocks of 2, 4, 8 ... patches while it stays above their highest point (Tevs, Ihrke and
//! Seidel, Maximum mipmaps for fast, accurate, and scalable dynamic height field rendering, I3D 2008). Cost of a ray: of the order of the
//! logarithm of the grid's side. Memory: a third of that of the heights.
//!
//! A patch with a corner without data is a hole: rays pass through it. A ray that approaches the ground from below, through a hole or
//! through the side of the grid, sees no ground.

use crate::direction::Vector;
use sastrugi_numeric::{Geometry, Grid};
use std::ops::ControlFlow::{self, Break, Continue};

/// Distance that counts as touching, in cells.
const TOUCH_CELLS: f64 = 1e-9;

/// A surface prepared for ray tracing.
pub struct Relief<'a> {
    heights: &'a Grid,
    /// Highest points of blocks of patches, with 2, 4, 8 ... patches along a side.
    levels: Vec<Level>,
    /// Lowest and highest height, m.
    range_m: [f64; 2],
    /// Heights that differ by less count as equal, m.
    tolerance_m: f64,
}

/// Highest points of square blocks of patches.
struct Level {
    cols: usize,
    highest: Vec<f64>,
}

/// A point where a ray hits the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, m.
    pub distance_m: f64,
    /// The point, m.
    pub point_m: Vector,
    /// Its position in the grid.
    pub place: Place,
}

/// A place on the surface: a patch and the position within it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// South-west corner of the patch: column, and row counted from the south.
    patch: [usize; 2],
    /// Position relative to that corner, 0 to 1 east and north.
    within: [f64; 2],
}

/// A ray in cells east and north of the south-west cell centre, and metres up.
#[derive(Clone, Copy)]
struct Line {
    at: Vector,
    /// Per metre along the ray.
    by: Vector,
}

impl Line {
    fn point(&self, s: f64) -> Vector {
        [0, 1, 2].map(|k| self.at[k] + s * self.by[k])
    }

    /// The stretch of `[from, to]` on which a coordinate lies in a range.
    fn clip(&self, axis: usize, [low, high]: [f64; 2], [from, to]: [f64; 2]) -> [f64; 2] {
        if self.by[axis] == 0.0 {
            let inside = self.at[axis] >= low && self.at[axis] <= high;
            return if inside { [from, to] } else { [f64::INFINITY, f64::NEG_INFINITY] };
        }
        let ends = [low, high].map(|bound| (bound - self.at[axis]) / self.by[axis]);
        [from.max(ends[0].min(ends[1])), to.min(ends[0].max(ends[1]))]
    }
}

/// Height of a ray above a patch along a stretch of it.
#[derive(Clone, Copy)]
struct Parabola {
    /// Constant, linear and quadratic coefficient.
    terms: [f64; 3],
    /// Length of the stretch, m.
    length: f64,
}

impl Parabola {
    fn at(&self, s: f64) -> f64 {
        let [f0, f1, f2] = self.terms;
        f0 + s * (f1 + s * f2)
    }

    /// Position of the minimum, if it is not at an end.
    fn lowest_inside(&self) -> Option<f64> {
        let [_, f1, f2] = self.terms;
        let s = -0.5 * f1 / f2;
        (f2 > 0.0 && s > 0.0 && s < self.length).then_some(s)
    }

    /// True if it falls below a value.
    fn falls_below(&self, value: f64) -> bool {
        let below = |s: f64| self.at(s) < value;
        below(0.0) || below(self.length) || self.lowest_inside().is_some_and(below)
    }

    /// First root of a parabola that starts above 0.
    fn first_root(&self) -> Option<f64> {
        if !self.falls_below(0.0) && self.at(self.length) > 0.0 {
            return None;
        }
        let [f0, f1, f2] = self.terms;
        let root = (f1 * f1 - 4.0 * f2 * f0).max(0.0).sqrt();
        // Sums of numbers with the same sign lose no digits.
        let s = if f1 < 0.0 { 2.0 * f0 / (root - f1) } else { -0.5 * (f1 + root) / f2 };
        Some(s.clamp(0.0, self.length))
    }
}

impl<'a> Relief<'a> {
    /// Prepares heights; `None` for a grid without patches (fewer than 2 x 2 cells) or without any data.
    pub fn new(heights: &'a Grid) -> Option<Self> {
        let g = &heights.geometry;
        if g.rows < 2 || g.cols < 2 {
            return None;
        }
        let (low, high) = heights.range()?;
        let rounding = 8.0 * f64::EPSILON * low.abs().max(high.abs());
        let tolerance_m = TOUCH_CELLS * g.cell[0].min(g.cell[1]) + rounding;
        Some(Self { heights, levels: levels(heights), range_m: [low, high], tolerance_m })
    }

    /// Geometry of the heights.
    pub fn geometry(&self) -> &Geometry {
        &self.heights.geometry
    }

    /// First hit of a ray from `origin_m` in the unit direction `direction`, at a distance of at least `nearest_m` (minus infinity for rays
    /// of a parallel camera).
    pub fn first_hit(&self, origin_m: Vector, direction: Vector, nearest_m: f64) -> Option<Hit> {
        let line = self.line(origin_m, direction);
        let [from, to] = self.stretch(&line, nearest_m)?;
        let [u, v, z] = line.point(from);
        let [last_u, last_v] = self.patches().map(|n| n as f64);
        let start = Line { at: [u.clamp(0.0, last_u), v.clamp(0.0, last_v), z], by: line.by };
        let found = self.walk(&start, self.patch_at(start.at), to - from, |patch, s, parabola| {
            let f0 = parabola.terms[0];
            match parabola.first_root() {
                _ if f0.is_nan() => Continue(()),
                _ if f0 < -self.tolerance_m => Break(None),
                _ if f0 <= 0.0 => Break(Some((patch, s))),
                Some(farther) => Break(Some((patch, s + farther))),
                None => Continue(()),
            }
        });
        found.flatten().map(|(patch, s)| self.hit(&start, patch, s, from))
    }

    /// True if the surface blocks the sun, in the unit direction `sun`, at a place.
    pub fn is_shadowed(&self, place: &Place, height_m: f64, sun: Vector) -> bool {
        let [i, j] = place.patch.map(|n| n as f64);
        let start = Line { at: [i + place.within[0], j + place.within[1], height_m], by: self.line([0.0; 3], sun).by };
        let to = (self.range_m[1] - height_m) / sun[2];
        let met = self.walk(&start, place.patch, to, |_, _, parabola| {
            if parabola.falls_below(-self.tolerance_m) { Break(()) } else { Continue(()) }
        });
        met.is_some()
    }

    /// Slopes `dz/dx`, `dz/dy` of the patch at a place. On a line between patches it is the mean of both sides; at a cell centre this is
    /// the central difference.
    pub fn slopes(&self, place: &Place) -> [f64; 2] {
        let corners = self.corners(place.patch);
        let [u, v] = place.within;
        let g = self.geometry();
        let own = [
            mix(corners[1] - corners[0], corners[3] - corners[2], v),
            mix(corners[2] - corners[0], corners[3] - corners[1], u),
        ];
        [0, 1].map(|axis| {
            let beyond = self.slope_beyond(place, axis).unwrap_or(own[axis]);
            0.5 * (own[axis] + beyond) / g.cell[axis]
        })
    }

    /// Bilinear value of another grid of the same geometry at a place; NaN next to a cell without data.
    pub fn value(&self, grid: &Grid, place: &Place) -> f64 {
        let [i, j] = place.patch;
        let south = (grid.rows() - 1 - j) * grid.cols() + i;
        let north = south - grid.cols();
        let [u, v] = place.within;
        let of = |k: usize| mix(grid.values[k], grid.values[k + 1], u);
        mix(of(south), of(north), v)
    }

    /// Number of patches east-west and north-south.
    fn patches(&self) -> [usize; 2] {
        let g = self.geometry();
        [g.cols - 1, g.rows - 1]
    }

    /// The patch at a position; on a line between patches, one with data if there is any.
    fn patch_at(&self, at: Vector) -> [usize; 2] {
        let count = self.patches();
        let patch = [0, 1].map(|axis| (at[axis] as usize).min(count[axis] - 1));
        if self.is_there(patch) {
            return patch;
        }
        let near = [0, 1].map(|axis| neighbour(at[axis], patch[axis], count[axis]));
        let others = [[near[0], patch[1]], [patch[0], near[1]], near];
        others.into_iter().find(|other| self.is_there(*other)).unwrap_or(patch)
    }

    fn is_there(&self, patch: [usize; 2]) -> bool {
        self.corners(patch).iter().all(|z| z.is_finite())
    }

    /// Heights of a patch's corners: south-west, south-east, north-west, north-east.
    #[inline]
    fn corners(&self, [i, j]: [usize; 2]) -> [f64; 4] {
        let (rows, cols) = (self.heights.rows(), self.heights.cols());
        let south = (rows - 1 - j) * cols + i;
        let north = south - cols;
        let z = &self.heights.values;
        [z[south], z[south + 1], z[north], z[north + 1]]
    }

    /// Height difference per cell along an axis, in the patch on the other side of the line on which a place lies; `None` if it is not on a
    /// line, or that patch has no data.
    fn slope_beyond(&self, place: &Place, axis: usize) -> Option<f64> {
        let position = place.within[axis];
        let on_low = position <= TOUCH_CELLS;
        if !on_low && position < 1.0 - TOUCH_CELLS {
            return None;
        }
        let mut patch = place.patch;
        patch[axis] = if on_low { patch[axis].checked_sub(1)? } else { patch[axis] + 1 };
        if patch[axis] >= self.patches()[axis] {
            return None;
        }
        let z = self.corners(patch);
        let across = place.within[1 - axis];
        let slope = match axis {
            0 => mix(z[1] - z[0], z[3] - z[2], across),
            _ => mix(z[2] - z[0], z[3] - z[1], across),
        };
        slope.is_finite().then_some(slope)
    }

    /// A ray in cells.
    fn line(&self, origin_m: Vector, direction: Vector) -> Line {
        let g = self.geometry();
        let cells = |axis: usize| (origin_m[axis] - g.origin[axis]) / g.cell[axis] - 0.5;
        let at = [cells(0), cells(1), origin_m[2]];
        Line { at, by: [direction[0] / g.cell[0], direction[1] / g.cell[1], direction[2]] }
    }

    /// The stretch of a ray on which it can hit ground.
    fn stretch(&self, line: &Line, nearest_m: f64) -> Option<[f64; 2]> {
        let [last_u, last_v] = self.patches().map(|n| n as f64);
        let [low, high] = self.range_m;
        let all = [nearest_m, f64::INFINITY];
        let all = line.clip(0, [-TOUCH_CELLS, last_u + TOUCH_CELLS], all);
        let all = line.clip(1, [-TOUCH_CELLS, last_v + TOUCH_CELLS], all);
        let [from, to] = line.clip(2, [low - 2.0 * self.tolerance_m, high], all);
        (from <= to && from.is_finite() && to.is_finite()).then_some([from, to])
    }

    fn hit(&self, start: &Line, patch: [usize; 2], s: f64, from: f64) -> Hit {
        let [u, v, _] = start.point(s);
        let within = [(u - patch[0] as f64).clamp(0.0, 1.0), (v - patch[1] as f64).clamp(0.0, 1.0)];
        let place = Place { patch, within };
        let g = self.geometry();
        let metres = |axis: usize| g.origin[axis] + (patch[axis] as f64 + within[axis] + 0.5) * g.cell[axis];
        let point_m = [metres(0), metres(1), self.value(self.heights, &place)];
        Hit { distance_m: from + s, point_m, place }
    }

    /// Walks along a ray from its start in `patch` to the distance `to`. `visit` is called for the patches that the ray may hit, with the
    /// patch, the distance at entry and the height of the ray above it.
    fn walk<T>(
        &self,
        line: &Line,
        mut patch: [usize; 2],
        to: f64,
        mut visit: impl FnMut([usize; 2], f64, &Parabola) -> ControlFlow<T>,
    ) -> Option<T> {
        let count = self.patches();
        let pace = [1.0 / line.by[0], 1.0 / line.by[1]];
        let (mut s, mut level) = (0.0, 0);
        loop {
            let block = patch.map(|n| n >> level);
            let exits = [0, 1].map(|k| exit(line.at[k], line.by[k], pace[k], block[k], level));
            let end = exits[0].min(exits[1]).min(to).max(s);
            if level > 0 {
                let lowest = (line.at[2] + s * line.by[2]).min(line.at[2] + end * line.by[2]);
                let above = &self.levels[level - 1];
                if lowest <= above.highest[block[1] * above.cols + block[0]] {
                    level -= 1;
                    continue;
                }
            } else if let Break(found) = visit(patch, s, &self.parabola(line, patch, [s, end])) {
                return Some(found);
            }
            if end >= to {
                return None;
            }
            let across = usize::from(exits[1] < exits[0]);
            patch[across] = step(block[across], level, line.by[across] > 0.0, count[across])?;
            let along = 1 - across;
            let side = 1usize << level;
            let (first, last) = (block[along] * side, (block[along] * side + side).min(count[along]) - 1);
            patch[along] = ((line.at[along] + end * line.by[along]) as usize).clamp(first, last);
            s = end;
            level = (level + 1).min(self.levels.len());
        }
    }

    /// Height of a ray above a patch between two distances.
    #[inline]
    fn parabola(&self, line: &Line, patch: [usize; 2], [from, to]: [f64; 2]) -> Parabola {
        let [sw, se, nw, ne] = self.corners(patch);
        let (b, c, d) = (se - sw, nw - sw, ne - nw - (se - sw));
        let [u, v, z] = line.point(from);
        let (u, v) = (u - patch[0] as f64, v - patch[1] as f64);
        let [du, dv, dz] = line.by;
        let f0 = z - (sw + b * u + c * v + d * u * v);
        let f1 = dz - (b * du + c * dv + d * (u * dv + v * du));
        Parabola { terms: [f0, f1, -d * du * dv], length: to - from }
    }
}

/// The patch on the other side of the line on which a position lies, along one axis; the same patch if it is not on a line.
fn neighbour(at: f64, patch: usize, count: usize) -> usize {
    match at - patch as f64 {
        within if within <= TOUCH_CELLS => patch.saturating_sub(1),
        within if within >= 1.0 - TOUCH_CELLS => (patch + 1).min(count - 1),
        _ => patch,
    }
}

#[inline]
fn mix(low: f64, high: f64, at: f64) -> f64 {
    low + (high - low) * at
}

/// Distance at which a ray leaves a block along one axis.
#[inline]
fn exit(at: f64, by: f64, pace: f64, block: usize, level: usize) -> f64 {
    let bound = if by > 0.0 { block + 1 } else { block } << level;
    if by == 0.0 { f64::INFINITY } else { (bound as f64 - at) * pace }
}

/// The patch beyond a block along one axis, `None` beyond the grid.
#[inline]
fn step(block: usize, level: usize, upwards: bool, count: usize) -> Option<usize> {
    if upwards { Some((block + 1) << level).filter(|n| *n < count) } else { (block << level).checked_sub(1) }
}

/// Highest points of blocks of increasing size, up to one block of all patches.
fn levels(heights: &Grid) -> Vec<Level> {
    let mut all = vec![patch_level(heights)];
    while all.last().is_some_and(|level| level.highest.len() > 1) {
        let next = all.last().map(coarser);
        all.extend(next);
    }
    all.remove(0);
    all
}

/// Highest point of every patch, row by row from the south; minus infinity for patches without data.
fn patch_level(heights: &Grid) -> Level {
    let (rows, cols) = (heights.rows() - 1, heights.cols() - 1);
    let highest = (0..rows).flat_map(|j| {
        let (south, north) = (heights.row(rows - j), heights.row(rows - 1 - j));
        (0..cols).map(move |i| {
            let z = [south[i], south[i + 1], north[i], north[i + 1]];
            if z.iter().all(|v| v.is_finite()) { z.into_iter().fold(f64::MIN, f64::max) } else { f64::NEG_INFINITY }
        })
    });
    Level { cols, highest: highest.collect() }
}

/// The same for blocks of twice the side.
fn coarser(level: &Level) -> Level {
    let rows = level.highest.len() / level.cols;
    let cols = level.cols.div_ceil(2);
    let of = |r: usize, c: usize| {
        let finer = (2 * r..(2 * r + 2).min(rows)).map(|r| &level.highest[r * level.cols..(r + 1) * level.cols]);
        finer.flat_map(|row| row[2 * c..(2 * c + 2).min(level.cols)].iter()).copied().fold(f64::NEG_INFINITY, f64::max)
    };
    let highest = (0..rows.div_ceil(2)).flat_map(|r| (0..cols).map(move |c| (r, c))).map(|(r, c)| of(r, c)).collect();
    Level { cols, highest }
}
