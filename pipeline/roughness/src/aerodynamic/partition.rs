//! Partition of a raster into blocks.

/// Blocks along each side.
pub(super) const SIDE: usize = 4;

/// Row-major index of the block that holds a cell.
pub(super) fn block_of(row: usize, col: usize, rows: usize, cols: usize) -> usize {
    (row * SIDE / rows) * SIDE + col * SIDE / cols
}
