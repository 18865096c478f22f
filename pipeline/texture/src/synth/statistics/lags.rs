//! Covariance of a residual by lag, as stored in a fit file, and on a torus.
//!
//! Measured about zero from every pair of cells with data, up to a largest lag. Stored at lags of 0 to 32 cells one by one, to 64 in steps of
//! 2, to 128 in steps of 4 and so on, in both directions: a covariance is smooth at long lags, and the table stays small; for small sites one by
//! one only to 16 or 8 ([`thinned`]). Between stored lags it is bilinear.

use crate::covariance::masked_covariance;
use rayon::prelude::*;
use sastrugi_numeric::Grid;
use sastrugi_schemas::statistics::{self, LagCovariances};

/// Lags stored one by one; each later octave has half as many.
pub const DENSE: usize = 32;
/// Largest lag, cells, that a table may hold.
pub const LAG_MAX: usize = statistics::LAG_MAX as usize;

/// The covariance of a residual at lags of up to `lag_max` cells, rows and columns.
pub fn measure(residual: &Grid, lag_max: [usize; 2]) -> LagCovariances {
    let found = masked_covariance(&residual.values, residual.cols(), lag_max.map(|lag| lag.min(LAG_MAX)));
    let [rows, cols] = found.max_lag.map(|lag| nodes(lag.min(LAG_MAX), DENSE));
    let across: Vec<isize> = mirrored(&cols);
    // Far lags without any pair carry no covariance.
    let at = |row: u32, col: isize| found.covariance(row as isize, col).unwrap_or(0.0);
    let values = rows.iter().flat_map(|&row| across.iter().map(move |&col| at(row, col))).collect();
    LagCovariances { rows, cols, values }
}

/// A table at some of its lags: one by one to `dense`, each octave beyond half as dense as the one before, and the last.
pub fn thinned(table: &LagCovariances, dense: usize) -> LagCovariances {
    let kept = |lags: &[u32]| -> Vec<usize> {
        let last = lags.last().map_or(0, |&lag| lag as usize);
        let nodes = nodes(last, dense);
        (0..lags.len()).filter(|&k| k + 1 == lags.len() || nodes.contains(&lags[k])).collect()
    };
    let (rows, cols) = (kept(&table.rows), kept(&table.cols));
    let middle = table.cols.len() - 1;
    let west = cols[1..].iter().rev().map(|&k| middle - k);
    let across: Vec<usize> = west.chain(cols.iter().map(|&k| middle + k)).collect();
    let line = |row: usize| &table.values[row * table.inner()..(row + 1) * table.inner()];
    LagCovariances {
        values: rows.iter().flat_map(|&row| across.iter().map(move |&k| line(row)[k])).collect(),
        rows: rows.iter().map(|&k| table.rows[k]).collect(),
        cols: cols.iter().map(|&k| table.cols[k]).collect(),
    }
}

/// Lags from 0 to `last`: one by one to `dense`, each octave beyond half as dense as the one before.
fn nodes(last: usize, dense: usize) -> Vec<u32> {
    let mut nodes = Vec::new();
    let (mut lag, mut step) = (0, 1);
    while lag <= last {
        nodes.push(lag as u32);
        if lag == dense * step {
            step *= 2;
        }
        lag += step;
    }
    nodes
}

/// Lags from the farthest west to the farthest east.
fn mirrored(lags: &[u32]) -> Vec<isize> {
    let west = lags[1..].iter().rev().map(|&lag| -(lag as isize));
    west.chain(lags.iter().map(|&lag| lag as isize)).collect()
}

/// Largest lags of a table, rows and columns, cells.
pub fn reach(table: &LagCovariances) -> [usize; 2] {
    [&table.rows, &table.cols].map(|lags| lags.last().map_or(0, |&lag| lag as usize))
}

/// The table at every lag of `-reach..=reach` columns for lags of `0..=reach` rows, row-major, m2.
fn dense(table: &LagCovariances) -> Vec<Vec<f64>> {
    let [last_row, last_col] = reach(table);
    let (rows, cols) = (table.rows.iter().map(|&lag| lag as isize).collect::<Vec<_>>(), mirrored(&table.cols));
    let place = |lags: &[isize], lag: isize| {
        let low = lags.partition_point(|l| *l <= lag).clamp(1, lags.len().max(2) - 1) - 1;
        let Some(&above) = lags.get(low + 1) else { return (low, low, 0.0) };
        (low, low + 1, (lag - lags[low]) as f64 / (above - lags[low]) as f64)
    };
    let columns: Vec<(usize, usize, f64)> =
        (-(last_col as isize)..=last_col as isize).map(|lag| place(&cols, lag)).collect();
    (0..=last_row as isize)
        .map(|lag| {
            let (r0, r1, down) = place(&rows, lag);
            let line = |r: usize| &table.values[r * cols.len()..(r + 1) * cols.len()];
            let (above, below) = (line(r0), line(r1));
            let mix = |a: f64, b: f64, share: f64| a + (b - a) * share;
            columns
                .iter()
                .map(|&(c0, c1, east)| mix(mix(above[c0], above[c1], east), mix(below[c0], below[c1], east), down))
                .collect()
        })
        .collect()
}

/// The covariance at lags of 0 to `most` cells along rows, or as far as the table reaches, m2.
pub fn along_rows(table: &LagCovariances, most: usize) -> Vec<f64> {
    let eastwards = dense(table).into_iter().next().unwrap_or_default();
    eastwards.into_iter().skip(reach(table)[1]).take(most + 1).collect()
}

/// Weight of a lag, from its rows and columns as shares of the largest lag.
pub type Taper = fn([f64; 2]) -> f64;

/// Full weight to two thirds of the reach, then a cosine to 0: for spectra of fields.
pub fn flat([down, across]: [f64; 2]) -> f64 {
    let distance = (down * down + across * across).sqrt();
    match distance {
        d if d <= 2.0 / 3.0 => 1.0,
        d if d >= 1.0 => 0.0,
        d => 0.5 + 0.5 * libm::cos(std::f64::consts::PI * (3.0 * d - 2.0)),
    }
}

/// Bartlett's window, whose transform is nowhere negative: for comparing spectra.
pub fn bartlett([down, across]: [f64; 2]) -> f64 {
    (1.0 - down).max(0.0) * (1.0 - across).max(0.0)
}

/// The tapered table on a torus of `[rows, cols]`, row-major from lag 0, m2. Lags beyond half the torus are added where they wrap to, as the
/// covariance of a periodic field demands.
pub fn on_torus(table: &LagCovariances, [rows, cols]: [usize; 2], taper: Taper) -> Vec<f64> {
    let [last_row, last_col] = reach(table);
    let values = dense(table);
    let mut torus = vec![0.0; rows * cols];
    let mut add = |row: isize, col: isize, value: f64| {
        torus[row.rem_euclid(rows as isize) as usize * cols + col.rem_euclid(cols as isize) as usize] += value;
    };
    for (row, line) in values.iter().enumerate() {
        for (k, value) in line.iter().enumerate() {
            let (down, east) = (row as isize, k as isize - last_col as isize);
            let share = [row as f64 / (last_row + 1) as f64, east.unsigned_abs() as f64 / (last_col + 1) as f64];
            let weighted = value * taper(share);
            add(down, east, weighted);
            // The stored half holds row 0 completely.
            if down > 0 {
                add(-down, -east, weighted);
            }
        }
    }
    torus
}

/// Multiplies a covariance on a torus by a taper over lags of up to `reach`.
pub fn taper_torus(values: &mut [f64], [rows, cols]: [usize; 2], reach: [usize; 2], taper: Taper) {
    let shorter = |k: usize, n: usize| k.min(n - k) as f64;
    let across: Vec<f64> = (0..cols).map(|c| shorter(c, cols) / (reach[1] + 1) as f64).collect();
    values.par_chunks_mut(cols).enumerate().for_each(|(r, line)| {
        let down = shorter(r, rows) / (reach[0] + 1) as f64;
        line.iter_mut().zip(&across).for_each(|(v, &east)| *v *= taper([down, east]));
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    #[test]
    fn val_nodes_thin_out_by_octaves() {
        assert_eq!(nodes(0, DENSE), [0]);
        assert_eq!(nodes(32, DENSE).len(), 33);
        assert_eq!(nodes(40, 8), [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40]);
        assert_eq!(nodes(65, DENSE)[31..], [31, 32, 34, 36, 38, 40, 42, 44, 46, 48, 50, 52, 54, 56, 58, 60, 62, 64]);
        assert_eq!(nodes(LAG_MAX, DENSE).len(), 33 + 3 * 16);
        assert_eq!(nodes(LAG_MAX, DENSE).last(), Some(&256));
    }

    /// A table with fewer lags has the same values there, and the same reach.
    #[test]
    fn prop_thinned_tables_keep_their_values() {
        let mut stream = Streams::for_seed(5, "lags-test").stream("heights");
        let residual = Grid::new(Geometry::square(60, 70, 0.5), (0..4200).map(|_| stream.normal()).collect());
        let table = measure(&residual, [13, 21]);
        let few = thinned(&table, 8);
        assert_eq!((few.rows.len(), reach(&few)), (9 + 2 + 1, [13, 21]));
        assert_eq!(few.cols[8..], [8, 10, 12, 14, 16, 20, 21]);
        assert!(few.check().is_ok() && few.variance() == table.variance());
        let [all, some] = [&table, &few].map(|table| on_torus(table, [40, 60], |_| 1.0));
        for (row, col) in [(0_isize, 21_isize), (13, -20), (12, 14), (7, -16), (10, 3)] {
            let at = row as usize * 60 + col.rem_euclid(60) as usize;
            assert_eq!(all[at], some[at], "{row} {col}");
        }
        assert_eq!(thinned(&table, DENSE), table);
    }

    /// The double sum over pairs, with holes; and back on a torus.
    #[test]
    fn val_the_table_is_the_mean_product_of_pairs() {
        let mut stream = Streams::for_seed(4, "lags-test").stream("heights");
        let mut residual = Grid::new(Geometry::square(9, 11, 0.5), (0..99).map(|_| stream.normal()).collect());
        [3, 40, 41, 77].into_iter().for_each(|k| residual.values[k] = f64::NAN);
        let table = measure(&residual, [2, 3]);
        assert!(table.check().is_ok());
        let torus = on_torus(&table, [16, 20], |_| 1.0);
        for (row, col) in [(0_isize, 0_isize), (0, 3), (1, -2), (2, 3), (-2, -3), (-1, 2)] {
            let mut products = Vec::new();
            for r in 0..9_isize {
                for c in 0..11_isize {
                    let (s, t) = (r + row, c + col);
                    if (0..9).contains(&s) && (0..11).contains(&t) {
                        let product = residual.at(r as usize, c as usize) * residual.at(s as usize, t as usize);
                        products.extend(Some(product).filter(|p| p.is_finite()));
                    }
                }
            }
            let mean = products.iter().sum::<f64>() / products.len() as f64;
            let found = torus[row.rem_euclid(16) as usize * 20 + col.rem_euclid(20) as usize];
            assert!((found - mean).abs() < 1e-12, "{row} {col}: {found} {mean}");
        }
    }

    /// Bilinear between stored lags: a covariance that is linear in its lags is met everywhere.
    #[test]
    fn val_lags_between_nodes_are_bilinear() {
        let lags = vec![0, 1, 2, 4, 8];
        let f = |row: isize, col: isize| 10.0 - 0.5 * row as f64 - 0.25 * (col - 1).abs() as f64;
        let across = mirrored(&lags);
        let values = lags.iter().flat_map(|&r| across.iter().map(move |&c| f(r as isize, c))).collect();
        let table = LagCovariances { rows: lags.clone(), cols: lags, values };
        let torus = on_torus(&table, [40, 40], |_| 1.0);
        for (row, col) in [(3_isize, 6_isize), (5, -7), (7, 3), (1, -3), (8, 8), (6, 1)] {
            let found = torus[row as usize * 40 + col.rem_euclid(40) as usize];
            assert!((found - f(row, col)).abs() < 1e-12, "{row} {col}: {found}");
        }
    }

    /// On a torus narrower than the table, lags that coincide are added.
    #[test]
    fn val_narrow_tori_wrap() {
        let table = LagCovariances { rows: vec![0], cols: vec![0, 1, 2], values: vec![0.1, 0.5, 1.0, 0.5, 0.1] };
        let torus = on_torus(&table, [1, 3], |_| 1.0);
        assert!((0..3).all(|k| (torus[k] - [1.0, 0.6, 0.6][k]).abs() < 1e-15), "{torus:?}");
    }

    #[test]
    fn val_tapers() {
        assert_eq!(
            (flat([0.0, 0.5]), flat([0.6, 0.8]), bartlett([0.0, 0.0]), bartlett([0.5, 0.25])),
            (1.0, 0.0, 1.0, 0.375)
        );
        assert!((flat([0.0, 5.0 / 6.0]) - 0.5).abs() < 1e-12);
        let mut values = vec![1.0; 6 * 8];
        taper_torus(&mut values, [6, 8], [1, 3], bartlett);
        assert_eq!((values[0], values[8], values[5 * 8 + 7], values[2 * 8]), (1.0, 0.5, 0.375, 0.0));
    }
}
