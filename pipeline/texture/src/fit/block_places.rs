//! Blocks of a DEM, for tests of stationarity and the block bootstrap.

use sastrugi_numeric::Geometry;
use sastrugi_roughness::background::BoxWindow;
use std::ops::Range;

/// Most blocks along one side.
pub const BLOCKS_ALONG: usize = 8;
/// Most cells used along one side of a block.
const BLOCK_SIDE_MAX: usize = 1024;

/// Rows and columns of the blocks of a DEM, each at least two windows wide. Of larger blocks only the middle is used, to
/// represent the rest.
pub fn block_places(geometry: &Geometry, window: BoxWindow, profiles: bool) -> Vec<[Range<usize>; 2]> {
    let shape = [geometry.rows, geometry.cols];
    let width = window.cells();
    let along = match profiles {
        true => [shape[0], (BLOCKS_ALONG * BLOCKS_ALONG / shape[0]).clamp(1, (shape[1] / (2 * width[1])).max(1))],
        false => [0, 1].map(|k| (shape[k] / (2 * width[k])).clamp(1, BLOCKS_ALONG)),
    };
    let span = |axis: usize, index: usize| {
        let [from, to] = [index, index + 1].map(|k| k * shape[axis] / along[axis]);
        let cut = (to - from).saturating_sub(BLOCK_SIDE_MAX.max(2 * width[axis])) / 2;
        from + cut..to - cut
    };
    (0..along[0]).flat_map(|r| (0..along[1]).map(move |c| [span(0, r), span(1, c)])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks are at least two windows wide, at most eight along a side, and cover the raster; of blocks beyond 1024 cells the middle is used.
    #[test]
    fn val_blocks_by_hand() {
        let places = |rows: usize, cols: usize, half: [usize; 2], profiles: bool| {
            block_places(&Geometry::square(rows, cols, 1.0), BoxWindow { half }, profiles)
        };
        // Windows of 5 rows and 3 columns: 3 blocks of at least 10 rows, 4 of at least 6 columns.
        let blocks = places(31, 25, [2, 1], false);
        assert_eq!(blocks.len(), 12);
        assert_eq!((&blocks[0], &blocks[11]), (&[0..10, 0..6], &[20..31, 18..25]));
        assert!(blocks.iter().all(|[rows, cols]| rows.len() >= 10 && cols.len() >= 6));
        assert_eq!(blocks.iter().map(|[rows, cols]| rows.len() * cols.len()).sum::<usize>(), 31 * 25);
        assert_eq!(places(1000, 1000, [2, 2], false).len(), 64);
        // A raster of less than two windows is one block.
        assert_eq!(places(9, 9, [2, 2], false), [[0..9, 0..9]]);
        // Blocks of 1250 cells: 113 are left out on either side.
        assert_eq!(places(9, 10_000, [2, 2], false)[1], [0..9, 1363..2387]);
        // Transects are blocks of their own, cut along their length where there are fewer than 64 in all.
        assert_eq!(places(4, 400, [0, 2], true).len(), 64);
        assert_eq!(places(4, 400, [0, 2], true)[1], [0..1, 25..50]);
    }
}
