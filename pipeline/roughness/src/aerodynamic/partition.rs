//! Partition of a raster into blocks.

/// Blocks along either side.
pub(super) const SIDE: usize = 4;

/// Block of a cell, row by row.
pub(super) fn block_of(row: usize, col: usize, rows: usize, cols: usize) -> usize {
    (row * SIDE / rows) * SIDE + col * SIDE / cols
}
