//! Centre lines with a minimum radius.

use super::{Ground, TerrainError};
use std::f64::consts::TAU;

/// Points of a centre line per turning radius of length.
pub(super) const POINTS_PER_RADIUS: f64 = 16.0;
/// Relaxations between two checks of the radius, and their maximum number in total.
const CHECK_EVERY: usize = 8;
const RELAXATIONS_MAX: usize = 100_000;
/// Distances from the centre among which a loop chooses.
const REACHES: usize = 21;

/// A centre line.
pub(super) struct Curve {
    /// Its points, m; the last of a closed curve is the first.
    pub(super) points_m: Vec<[f64; 2]>,
    pub(super) closed: bool,
}

impl Curve {
    /// Distance of each point along the curve, m.
    pub(super) fn along_m(&self) -> Vec<f64> {
        along_m(&self.points_m)
    }

    /// Smallest radius of a circle through three successive points, m; infinite for a straight line.
    pub(super) fn tightest_m(&self) -> f64 {
        let inner = self.points_m.windows(3).map(|w| circumradius_m(w[0], w[1], w[2]));
        let seam = match (&self.points_m[..], self.closed) {
            ([first, second, .., before, _], true) => circumradius_m(*before, *first, *second),
            _ => f64::INFINITY,
        };
        inner.fold(seam, f64::min)
    }
}

/// Distance of each point along a polyline, m.
fn along_m(points_m: &[[f64; 2]]) -> Vec<f64> {
    let mut along_m = vec![0.0];
    for pair in points_m.windows(2) {
        along_m.push(along_m[along_m.len() - 1] + distance(pair[0], pair[1]));
    }
    along_m
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    (dx * dx + dy * dy).sqrt()
}

/// Radius of the circle through three points, `abc / (4 area)`, m.
fn circumradius_m(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let twice_area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
    distance(a, b) * distance(b, c) * distance(c, a) / (2.0 * twice_area)
}

/// Points along a polyline, `spacing_m` or slightly less apart.
fn resampled(points_m: &[[f64; 2]], spacing_m: f64) -> Vec<[f64; 2]> {
    let along_m = along_m(points_m);
    let length_m = along_m[along_m.len() - 1];
    let count = (length_m / spacing_m).ceil().max(2.0) as usize;
    let at = |k: usize| {
        let s = length_m * k as f64 / count as f64;
        let segment = along_m[1..along_m.len() - 1].partition_point(|&end_m| end_m <= s);
        let share = (s - along_m[segment]) / (along_m[segment + 1] - along_m[segment]);
        let (a, b) = (points_m[segment], points_m[segment + 1]);
        [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]))
    };
    (0..=count).map(at).collect()
}

/// The path with its ends fixed, relaxed until it keeps the radius; `None` if it never does.
pub(super) fn relaxed_path(path_m: Vec<[f64; 2]>, turning_radius_m: f64) -> Option<Curve> {
    let points_m = resampled(&path_m, turning_radius_m / POINTS_PER_RADIUS);
    let smooth = |points_m: &mut Vec<[f64; 2]>| {
        let mut before = points_m[0];
        for k in 1..points_m.len() - 1 {
            let (here, after) = (points_m[k], points_m[k + 1]);
            points_m[k] = [0, 1].map(|axis| 0.25 * before[axis] + 0.5 * here[axis] + 0.25 * after[axis]);
            before = here;
        }
    };
    until_gentle(points_m, turning_radius_m, smooth, |points_m| Curve { points_m: points_m.clone(), closed: false })
}

/// Relaxes a form until its curve keeps the radius.
fn until_gentle<Form>(
    mut form: Form,
    turning_radius_m: f64,
    smooth: impl Fn(&mut Form),
    curve: impl Fn(&Form) -> Curve,
) -> Option<Curve> {
    for _ in 0..RELAXATIONS_MAX / CHECK_EVERY {
        let curve = curve(&form);
        if curve.tightest_m() >= turning_radius_m {
            return Some(curve);
        }
        (0..CHECK_EVERY).for_each(|_| smooth(&mut form));
    }
    None
}

/// An ellipse with axes along x and y, and how far a loop may leave it.
pub(super) struct Ellipse {
    pub(super) middle_m: [f64; 2],
    pub(super) half_axes_m: [f64; 2],
    /// Smallest and largest distance from the centre, over that of the ellipse.
    pub(super) reach: [f64; 2],
}

impl Ellipse {
    /// A point `reach` times as far out as that of the ellipse.
    fn point(&self, turn: f64, reach: f64) -> [f64; 2] {
        let (sin, cos) = libm::sincos(TAU * turn);
        let [x, y] = self.middle_m;
        [x + reach * self.half_axes_m[0] * cos, y + reach * self.half_axes_m[1] * sin]
    }

    fn count(&self, turning_radius_m: f64) -> usize {
        let around_m = TAU * self.reach[1] * self.half_axes_m[0].max(self.half_axes_m[1]);
        (around_m / turning_radius_m * POINTS_PER_RADIUS).ceil() as usize
    }

    /// The reach of every point of the loop over the gentlest slopes.
    ///
    /// # Errors
    /// [`TerrainError::Trail`] if the ground has no height somewhere.
    pub(super) fn fitted(&self, ground: &Ground<'_>, turning_radius_m: f64) -> Result<Vec<f64>, TerrainError> {
        let count = self.count(turning_radius_m);
        let [least, most] = self.reach;
        // As many levels inside the ellipse as outside, and the ellipse itself.
        let reach = |level: usize| match 2.0 * level as f64 / (REACHES - 1) as f64 - 1.0 {
            out if out < 0.0 => 1.0 + out * (1.0 - least),
            out => 1.0 + out * (most - 1.0),
        };
        let point = |k: usize, level: usize| self.point(k as f64 / count as f64, reach(level));
        let mut table = Vec::with_capacity(count);
        for k in 0..count {
            let mut column = [([0.0; 2], 0.0); REACHES];
            for (level, node) in column.iter_mut().enumerate() {
                let at = point(k, level);
                *node = (at, ground.height(at)?);
            }
            table.push(column);
        }
        Ok(gentlest_round(&table, nearest_first(&reach)).into_iter().map(reach).collect())
    }

    /// The loop with these reaches, relaxed until it keeps the radius; `None` if it never does.
    pub(super) fn relaxed(&self, reaches: Vec<f64>, turning_radius_m: f64) -> Option<Curve> {
        let smooth = |reaches: &mut Vec<f64>| {
            let (first, last) = (reaches[0], reaches.len() - 1);
            let mut before = reaches[last];
            for k in 0..=last {
                let (here, after) = (reaches[k], if k == last { first } else { reaches[k + 1] });
                reaches[k] = 0.25 * before + 0.5 * here + 0.25 * after;
                before = here;
            }
        };
        let curve = |reaches: &Vec<f64>| {
            let count = reaches.len();
            let at = |k: usize| self.point((k % count) as f64 / count as f64, reaches[k % count]);
            Curve { points_m: (0..=count).map(at).collect(), closed: true }
        };
        until_gentle(reaches, turning_radius_m, smooth, curve)
    }
}

/// Levels sorted by their distance from the ellipse, so that level ground gives the ellipse itself.
fn nearest_first(reach: &impl Fn(usize) -> f64) -> Vec<usize> {
    let mut levels: Vec<usize> = (0..REACHES).collect();
    levels.sort_by(|&a, &b| (reach(a) - 1.0).abs().total_cmp(&(reach(b) - 1.0).abs()));
    levels
}

/// A point of the plane and its height, m.
type Node = ([f64; 2], f64);

/// `dz^2 / ds` between two nodes, m.
fn climb((a, za): Node, (b, zb): Node) -> f64 {
    let dz = zb - za;
    dz * dz / distance(a, b)
}

/// The closed sequence of levels with the smallest sum of [`climb`], each level equal or adjacent to the one before; ties go to the
/// sequence that changes least, from the first of `starts`.
fn gentlest_round(table: &[[Node; REACHES]], starts: Vec<usize>) -> Vec<usize> {
    let mut best: (f64, Vec<usize>) = (f64::INFINITY, vec![starts[0]; table.len()]);
    for start in starts {
        let round = gentlest_from(table, start);
        if round.0 < best.0 {
            best = round;
        }
    }
    best.1
}

/// The best sequence starting at one level, and its sum, m.
fn gentlest_from(table: &[[Node; REACHES]], start: usize) -> (f64, Vec<usize>) {
    let mut sums = [f64::INFINITY; REACHES];
    sums[start] = 0.0;
    let mut before: Vec<[usize; REACHES]> = Vec::with_capacity(table.len());
    for (k, column) in table.iter().enumerate() {
        let next = &table[(k + 1) % table.len()];
        let mut reached = [f64::INFINITY; REACHES];
        let mut from = [start; REACHES];
        for level in 0..REACHES {
            for last in
                [Some(level), level.checked_sub(1), Some(level + 1).filter(|&l| l < REACHES)].into_iter().flatten()
            {
                let sum = sums[last] + climb(column[last], next[level]);
                if sum < reached[level] {
                    (reached[level], from[level]) = (sum, last);
                }
            }
        }
        sums = reached;
        before.push(from);
    }
    let mut level = start;
    let mut levels: Vec<usize> = Vec::with_capacity(table.len());
    for from in before.iter().rev() {
        level = from[level];
        levels.push(level);
    }
    levels.reverse();
    (sums[start], levels)
}
