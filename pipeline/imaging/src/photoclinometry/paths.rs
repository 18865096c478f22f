//! Heights from slopes along paths, as published: outward from the centre, averaged over many paths.
//!
//! One set of paths visits the cells in rings around the centre (all cells `|dr| + |dc|` steps away). Each cell takes its height from one of its
//! at most two neighbours in the previous ring, plus the mean slope of the two cells; the neighbour is drawn with the probability that makes
//! every staircase from the centre equally likely. The paper states the number of paths (up to 450) and that they wind outward; the draw is
//! our choice. Slope errors accumulate along a path as a random walk, and paths share cells: averaging reduces the errors, but less than least
//! squares over all cells does ([`super::integration`]).

use rayon::prelude::*;
use sastrugi_numeric::{Counter, Geometry, Streams, sums};

/// Number of path sets computed in parallel.
const GROUP: usize = 8;

/// Heights with mean 0 over the cells reached by some path, NaN elsewhere; `good` marks the cells with slopes.
pub fn integrate_along_paths(
    g: &Geometry,
    slopes: &[[f64; 2]],
    good: &[bool],
    paths: usize,
    streams: &Streams,
) -> Vec<f64> {
    let Some(centre) = centre(g, good) else { return vec![f64::NAN; g.len()] };
    let rings = rings(g, centre);
    let root = Counter::new(&mut streams.stream("paths"));
    let mut total = vec![0.0; g.len()];
    let mut count = vec![0u32; g.len()];
    for first in (0..paths).step_by(GROUP) {
        let group: Vec<Vec<f64>> = (first..(first + GROUP).min(paths))
            .into_par_iter()
            .map(|path| walk(g, slopes, good, centre, &rings, root.at(path as i64)))
            .collect();
        for heights in group {
            for (k, z) in heights.into_iter().enumerate().filter(|(_, z)| z.is_finite()) {
                total[k] += z;
                count[k] += 1;
            }
        }
    }
    let mut heights: Vec<f64> =
        total.iter().zip(&count).map(|(t, &n)| if n > 0 { t / f64::from(n) } else { f64::NAN }).collect();
    let mean = sums::mean(&sums::finite(&heights));
    heights.iter_mut().for_each(|z| *z -= mean);
    heights
}

/// The good cell nearest to the middle of the map.
fn centre(g: &Geometry, good: &[bool]) -> Option<(usize, usize)> {
    let (row, col) = (g.rows / 2, g.cols / 2);
    let steps = |k: &usize| (k / g.cols).abs_diff(row) + (k % g.cols).abs_diff(col);
    (0..g.len()).filter(|&k| good[k]).min_by_key(steps).map(|k| (k / g.cols, k % g.cols))
}

/// Cells in order of their number of steps from the centre.
fn rings(g: &Geometry, (row, col): (usize, usize)) -> Vec<usize> {
    let mut cells: Vec<usize> = (0..g.len()).collect();
    cells.sort_by_key(|k| (k / g.cols).abs_diff(row) + (k % g.cols).abs_diff(col));
    cells
}

fn walk(
    g: &Geometry,
    slopes: &[[f64; 2]],
    good: &[bool],
    (row, col): (usize, usize),
    rings: &[usize],
    draws: Counter,
) -> Vec<f64> {
    let mut heights = vec![f64::NAN; g.len()];
    heights[row * g.cols + col] = 0.0;
    for &k in rings.iter().skip(1).filter(|&&k| good[k]) {
        let (r, c) = (k / g.cols, k % g.cols);
        let (down, across) = (r.abs_diff(row), c.abs_diff(col));
        let inner_row = (down > 0).then(|| if r > row { k - g.cols } else { k + g.cols });
        let inner_col = (across > 0).then(|| if c > col { k - 1 } else { k + 1 });
        let by_row = || inner_row.map(|from| heights[from] + rise(g, slopes, from, k, 1)).filter(|z| z.is_finite());
        let by_col = || inner_col.map(|from| heights[from] + rise(g, slopes, from, k, 0)).filter(|z| z.is_finite());
        let row_first = draws.at(k as i64).uniform() * ((down + across) as f64) < down as f64;
        let z = if row_first { by_row().or_else(by_col) } else { by_col().or_else(by_row) };
        heights[k] = z.unwrap_or(f64::NAN);
    }
    heights
}

/// Rise from one cell to its neighbour along an axis.
fn rise(g: &Geometry, slopes: &[[f64; 2]], from: usize, to: usize, axis: usize) -> f64 {
    let step = match axis {
        0 if to > from => g.cell[0],
        0 => -g.cell[0],
        // Rows run south.
        _ if to > from => -g.cell[1],
        _ => g.cell[1],
    };
    0.5 * (slopes[from][axis] + slopes[to][axis]) * step
}
