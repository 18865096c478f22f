//! Decimation for display: fewer cells of a raster, fewer points of a line.

use sastrugi_numeric::{Geometry, Grid};

/// Cells per side of a block, so that neither side of the grid has more than `most` blocks.
pub fn step(rows: usize, cols: usize, most: usize) -> usize {
    rows.max(cols).div_ceil(most.max(1)).max(1)
}

/// Mean of the cells with data in each block of `step` x `step` cells.
pub fn block_mean(grid: &Grid, step: usize) -> Grid {
    blocks(grid, step, |cells| {
        let finite: Vec<f64> = cells.iter().copied().filter(|v| v.is_finite()).collect();
        finite.iter().sum::<f64>() / finite.len() as f64
    })
}

/// The most common code in each block; of equally common codes, the higher one.
pub fn block_majority(grid: &Grid<u8>, step: usize) -> Grid<u8> {
    blocks(grid, step, |cells| {
        let mut sorted = cells.to_vec();
        sorted.sort_unstable();
        let runs = sorted.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0]));
        runs.max().map_or(u8::MAX, |(_, code)| code)
    })
}

fn blocks<T: Copy>(grid: &Grid<T>, step: usize, reduce: impl Fn(&[T]) -> T) -> Grid<T> {
    let g = grid.geometry;
    let (rows, cols) = (g.rows.div_ceil(step), g.cols.div_ceil(step));
    let cell = [g.cell[0] * step as f64, g.cell[1] * step as f64];
    let mut values = Vec::with_capacity(rows * cols);
    let mut block = Vec::with_capacity(step * step);
    for (row, col) in (0..rows).flat_map(|r| (0..cols).map(move |c| (r * step, c * step))) {
        block.clear();
        for r in row..(row + step).min(g.rows) {
            block.extend_from_slice(&grid.row(r)[col..(col + step).min(g.cols)]);
        }
        values.push(reduce(&block));
    }
    Grid { geometry: Geometry { rows, cols, cell, origin: g.origin }, values }
}

/// The central part of a grid, at most `size_m` east-west and north-south.
pub fn centre(grid: &Grid, size_m: [f64; 2]) -> Grid {
    let g = grid.geometry;
    let cells = |size: f64, cell: f64, n: usize| ((size / cell + 1e-6) as usize).clamp(1, n);
    let (rows, cols) = (cells(size_m[1], g.cell[1], g.rows), cells(size_m[0], g.cell[0], g.cols));
    grid.window((g.rows - rows) / 2, (g.cols - cols) / 2, rows, cols)
}

/// The grid repeated `times` in both directions, thinned so that neither side has many more than `most` cells. The block size
/// divides the grid if possible, so that no block straddles a seam.
pub fn tiled(grid: &Grid, times: usize, most: usize) -> Grid {
    let g = grid.geometry;
    let needed = step(times * g.rows, times * g.cols, most);
    let divides = |s: &usize| g.rows.is_multiple_of(*s) && g.cols.is_multiple_of(*s);
    let tile = block_mean(grid, (needed..=2 * needed).find(divides).unwrap_or(needed));
    let (rows, cols) = (tile.rows() * times, tile.cols() * times);
    let values =
        (0..rows).flat_map(|r| (0..times).flat_map(move |_| [r])).flat_map(|r| tile.row(r % tile.rows()).to_vec());
    Grid::new(Geometry { rows, cols, ..tile.geometry }, values.collect())
}

/// Points of a line, given in order of x on the page, reduced to one point per `width` of the page: the mean of each run.
pub fn line(points: &[(f64, f64)], width: f64) -> Vec<(f64, f64)> {
    let column = |p: &(f64, f64)| (p.0 / width).floor();
    let mean = |run: &[(f64, f64)]| {
        let n = run.len() as f64;
        (run.iter().map(|p| p.0).sum::<f64>() / n, run.iter().map(|p| p.1).sum::<f64>() / n)
    };
    points.chunk_by(|a, b| column(a) == column(b)).map(mean).collect()
}

/// Every n-th item, so that at most `most` remain, always including the last.
pub fn every<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let step = items.len().div_ceil(most.max(2) - 1).max(1);
    let mut kept: Vec<T> = items.iter().step_by(step).cloned().collect();
    if let Some(last) = items.last().filter(|_| !(items.len() - 1).is_multiple_of(step)) {
        kept.push(last.clone());
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_blocks() {
        let g = Geometry::square(3, 5, 1.0);
        let mut grid = Grid::new(g, (0..15).map(f64::from).collect());
        grid.values[0] = f64::NAN;
        let thin = block_mean(&grid, 2);
        assert_eq!((thin.rows(), thin.cols(), thin.geometry.cell), (2, 3, [2.0; 2]));
        assert_eq!(thin.values, [4.0, 5.0, 6.5, 10.5, 12.5, 14.0]);
        let codes = Grid::new(Geometry::square(2, 2, 1.0), vec![0, 2, 2, 1]);
        assert_eq!(block_majority(&codes, 2).values, [2]);
        // Of two equally common codes, the higher one; a block without data stays without.
        let ties = Grid::new(Geometry::square(2, 4, 1.0), vec![1, 3, 0, 0, 3, 1, 0, 2]);
        assert_eq!(block_majority(&ties, 2).values, [3, 0]);
        assert!(block_mean(&Grid::filled(Geometry::square(2, 2, 1.0), f64::NAN), 2).values[0].is_nan());
        assert_eq!(step(1009, 700, 512), 2);
        assert_eq!(step(100, 100, 512), 1);
        assert_eq!([step(512, 1, 512), step(1, 513, 512), step(1024, 1, 512), step(1025, 1, 512)], [1, 2, 2, 3]);
    }

    #[test]
    fn val_tiles_repeat() {
        let grid = Grid::new(Geometry::square(2, 4, 0.5), (0..8).map(f64::from).collect());
        let whole = tiled(&grid, 3, 100);
        assert_eq!((whole.rows(), whole.cols(), whole.geometry.cell), (6, 12, [0.5; 2]));
        assert!((0..72).all(|k| whole.values[k] == grid.at(k / 12 % 2, k % 12 % 4)));
        let thin = tiled(&grid, 3, 6);
        assert_eq!((thin.rows(), thin.cols(), thin.at(1, 4)), (3, 6, 2.5));
    }

    #[test]
    fn val_lines_and_lists() {
        assert_eq!(line(&[(0.1, 1.0), (0.3, 3.0), (1.2, 5.0)], 1.0), [(0.2, 2.0), (1.2, 5.0)]);
        assert_eq!(every(&[0, 1, 2, 3, 4, 5, 6], 4), [0, 3, 6]);
        assert_eq!(every(&[0, 1, 2, 3, 4, 5, 6, 7], 4), [0, 3, 6, 7]);
        assert!(every::<u8>(&[], 4).is_empty());
    }

    #[test]
    fn val_centre() {
        let grid = Grid::new(Geometry::square(4, 4, 0.5), (0..16).map(f64::from).collect());
        assert_eq!(centre(&grid, [1.0, 1.0]).values, [5.0, 6.0, 9.0, 10.0]);
        assert_eq!(centre(&grid, [9.0, 0.0]).rows(), 1);
    }
}
