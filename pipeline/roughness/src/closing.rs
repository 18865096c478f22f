//! Grey-scale morphological closing of a class map.
//!
//! Closing is a dilation (largest class within a disk) followed by an erosion (smallest class of the result within the
//! same disk): gaps between rough places that are too narrow for the disk become rough (Serra, Image Analysis and
//! Mathematical Morphology, 1982, chapter II). The disk holds the cells whose centres are within the radius.
//!
//! Cells without a class, and everything beyond the edge, are ignored: maxima and minima run over the cells with a class,
//! and a cell without a class keeps none. On that set the operation is a closing in the strict sense: it never lowers a
//! class, and it is idempotent.
//!
//! The map is closed as sets, one threshold at a time. A cell belongs to the dilated set if, in some row of its disk, a
//! member of the set is no farther along that row than the half width of the disk there. Cost: two distances and
//! `2 radius / cell` integer comparisons per cell, for each of two thresholds and two steps. Distances are stored as bytes if the radius is below
//! 255 cells, so that one vector instruction compares many.

use crate::classes::{HIGH, NO_CLASS, SEMI};
use rayon::prelude::*;
use sastrugi_numeric::Grid;

/// Tolerance on the squared radius, so that a radius of a whole number of cells includes the cells at that distance.
const RADIUS_SLACK: f64 = 1e-9;

/// The class map closed with a disk of `radius_m`; unchanged unless the radius is above 0.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::{HIGH, LOW, close_disk};
///
/// // A gap of one cell between rough cells is closed; open ground beside them stays as it is.
/// let classes = Grid::new(Geometry::square(1, 6, 1.0), vec![HIGH, LOW, HIGH, LOW, LOW, LOW]);
/// assert_eq!(close_disk(&classes, 1.0).values, [HIGH, HIGH, HIGH, LOW, LOW, LOW]);
/// ```
pub fn close_disk(classes: &Grid<u8>, radius_m: f64) -> Grid<u8> {
    let half_widths = disk(classes, radius_m);
    let narrow: Option<Vec<u8>> =
        half_widths.iter().map(|&width| u8::try_from(width).ok().filter(|&w| w < u8::FAR)).collect();
    let closed = [SEMI, HIGH].map(|threshold| match &narrow {
        Some(half_widths) => close_set(classes, threshold, half_widths),
        None => close_set(classes, threshold, &half_widths),
    });
    let values = classes.values.iter().enumerate().map(|(k, &class)| match class {
        NO_CLASS => NO_CLASS,
        _ => u8::from(closed[0][k]) + u8::from(closed[1][k]),
    });
    Grid { geometry: classes.geometry, values: values.collect() }
}

/// Half width of the disk in columns, in each row from its centre outwards.
fn disk(classes: &Grid<u8>, radius_m: f64) -> Vec<u32> {
    let [cell_x, cell_y] = classes.geometry.cell;
    let squared = if radius_m > 0.0 { radius_m * radius_m * (1.0 + RADIUS_SLACK) } else { 0.0 };
    let rest = |row: usize| squared - (row as f64 * cell_y) * (row as f64 * cell_y);
    // Capped at the width of the grid, which keeps it below the distance `u32::MAX` that marks an empty row.
    let half_width = |rest: f64| ((rest.sqrt() / cell_x) as u32).min(classes.cols() as u32);
    (0..classes.rows()).map(rest).take_while(|&rest| rest >= 0.0).map(half_width).collect()
}

/// Distance in columns to the nearest member of a set.
trait Distance: Copy + Ord + Send + Sync {
    /// At a member.
    const ZERO: Self;
    /// In a row without one, and beyond the widest disk.
    const FAR: Self;

    /// One column further, at most [`Self::FAR`].
    fn further(self) -> Self;
}

impl Distance for u8 {
    const ZERO: Self = 0;
    const FAR: Self = Self::MAX;

    fn further(self) -> Self {
        self.saturating_add(1)
    }
}

impl Distance for u32 {
    const ZERO: Self = 0;
    const FAR: Self = Self::MAX;

    fn further(self) -> Self {
        self.saturating_add(1)
    }
}

/// The cells that the closing raises to `threshold` or above.
fn close_set<D: Distance>(classes: &Grid<u8>, threshold: u8, half_widths: &[D]) -> Vec<bool> {
    let set: Vec<bool> = classes.values.iter().map(|&c| c >= threshold && c != NO_CLASS).collect();
    let dilated = dilate(&set, classes.cols(), half_widths);
    let outside = |(&d, &c): (&bool, &u8)| !d && c != NO_CLASS;
    let complement: Vec<bool> = dilated.iter().zip(&classes.values).map(outside).collect();
    dilate(&complement, classes.cols(), half_widths).into_iter().map(|eroded_away| !eroded_away).collect()
}

/// The cells with a member of `set` within the disk.
fn dilate<D: Distance>(set: &[bool], cols: usize, half_widths: &[D]) -> Vec<bool> {
    let mut distances = vec![D::FAR; set.len()];
    distances.par_chunks_mut(cols).zip(set.par_chunks(cols)).for_each(|(out, row)| distances_along(row, out));
    let rows = set.len() / cols;
    let mut dilated = vec![false; set.len()];
    dilated.par_chunks_mut(cols).enumerate().for_each(|(r, out)| {
        for (step, &half_width) in half_widths.iter().enumerate() {
            for other in [r.checked_sub(step), Some(r + step).filter(|&below| below < rows)].into_iter().flatten() {
                let line = &distances[other * cols..(other + 1) * cols];
                out.iter_mut().zip(line).for_each(|(d, &distance)| *d |= distance <= half_width);
            }
        }
    });
    dilated
}

/// Distance in columns of each cell to the nearest member of the row.
fn distances_along<D: Distance>(row: &[bool], out: &mut [D]) {
    let mut distance = D::FAR;
    for (o, &member) in out.iter_mut().zip(row) {
        distance = if member { D::ZERO } else { distance.further() };
        *o = distance;
    }
    distance = D::FAR;
    for (o, &member) in out.iter_mut().zip(row).rev() {
        distance = if member { D::ZERO } else { distance.further() };
        *o = distance.min(*o);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classes::LOW;
    use proptest::prelude::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn random_map(rows: usize, cols: usize, cell: [f64; 2], seed: u64) -> Grid<u8> {
        let mut s = Streams::for_seed(seed, "closing-test").stream("classes");
        let class = |u: f64| if u < 0.7 { LOW } else { [SEMI, HIGH, NO_CLASS][s_index(u)] };
        let geometry = Geometry { rows, cols, cell, origin: [0.0; 2] };
        Grid::new(geometry, (0..rows * cols).map(|_| class(s.uniform())).collect())
    }

    fn s_index(u: f64) -> usize {
        ((u - 0.7) * 10.0) as usize % 3
    }

    /// Reference: largest (`pick` = max) or smallest class within the disk, cell by cell.
    fn over_disk(map: &Grid<u8>, radius: f64, pick: fn(u8, u8) -> u8) -> Grid<u8> {
        let g = map.geometry;
        let near = |a: usize, b: usize| {
            let (dx, dy) = (g.x(a % g.cols) - g.x(b % g.cols), g.y(a / g.cols) - g.y(b / g.cols));
            dx * dx + dy * dy <= radius * radius * (1.0 + 1e-8)
        };
        let value = |k: usize| match map.values[k] {
            NO_CLASS => NO_CLASS,
            own => (0..g.len())
                .filter(|&q| near(k, q) && map.values[q] != NO_CLASS)
                .fold(own, |v, q| pick(v, map.values[q])),
        };
        Grid::new(g, (0..g.len()).map(value).collect())
    }

    fn brute_force(map: &Grid<u8>, radius: f64) -> Grid<u8> {
        over_disk(&over_disk(map, radius, u8::max), radius, u8::min)
    }

    #[test]
    fn val_equals_brute_force() {
        for (seed, cell) in [(1, [0.05, 0.05]), (2, [0.05, 0.08]), (3, [0.1, 0.03])] {
            let map = random_map(23, 31, cell, seed);
            for radius in [0.0, 0.05, 0.11, 0.2, 0.5, 9.0, f64::INFINITY] {
                assert_eq!(close_disk(&map, radius), brute_force(&map, radius), "cell {cell:?}, radius {radius}");
            }
        }
    }

    /// Distances as bytes and as 32-bit numbers give the same map; a disk of 255 cells or more uses the latter.
    #[test]
    fn val_narrow_and_wide_distances_agree() {
        let mut s = Streams::for_seed(4, "closing-test").stream("sparse");
        let class = |u: f64| if u < 0.004 { HIGH } else { LOW };
        let map = Grid::new(Geometry::square(3, 900, 1.0), (0..2700).map(|_| class(s.uniform())).collect());
        for radius in [3.0, 120.0, 254.0, 255.0, 300.0] {
            let half_widths = disk(&map, radius);
            let wide = close_set(&map, HIGH, &half_widths);
            let raised: Vec<bool> = close_disk(&map, radius).values.iter().map(|&class| class == HIGH).collect();
            assert_eq!(raised, wide, "{radius}");
            assert!(radius > 3.0 || wide.iter().any(|&high| !high), "{radius}");
        }
    }

    #[test]
    fn val_a_gap_narrower_than_the_disk_closes() {
        let mut map = Grid::filled(Geometry::square(9, 20, 0.1), LOW);
        for r in 0..9 {
            for c in [6, 10] {
                map.values[r * 20 + c] = HIGH;
            }
        }
        let closed = close_disk(&map, 0.2);
        assert_eq!((closed.at(4, 8), closed.at(4, 5), closed.at(4, 11)), (HIGH, LOW, LOW));
        assert_eq!(close_disk(&map, 0.1).at(4, 8), LOW);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn prop_closing_never_lowers_and_is_idempotent(seed in 0u64..1000, radius in 0.0f64..0.4) {
            let map = random_map(15, 12, [0.05, 0.07], seed);
            let closed = close_disk(&map, radius);
            prop_assert!(map.values.iter().zip(&closed.values).all(|(a, b)| a <= b));
            prop_assert!(map.values.iter().zip(&closed.values).all(|(a, b)| (*a == NO_CLASS) == (*b == NO_CLASS)));
            prop_assert_eq!(&close_disk(&closed, radius), &closed);
        }
    }
}
