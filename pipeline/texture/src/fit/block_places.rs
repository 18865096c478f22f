//! Blocks of a DEM, for tests of stationarity and block bootstraps.

use sastrugi_numeric::Geometry;
use sastrugi_roughness::background::BoxWindow;
use std::ops::Range;

/// Most blocks along a side.
pub const BLOCKS_ALONG: usize = 8;
/// Most cells along a side of a block that are looked at.
const BLOCK_SIDE_MAX: usize = 1024;

/// Rows and columns of the blocks of a DEM, of at least two windows each. Blocks of more cells than are looked at stand for
/// their surroundings.
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
