//! Wavefront mesh: one vertex per cell with data, two triangles between four neighbours.

use sastrugi_numeric::Grid;
use std::fmt::Write;

/// The grid as a mesh (x east, y north, z up, m).
pub(super) fn render(grid: &Grid) -> Vec<u8> {
    let g = &grid.geometry;
    let mut text = String::from("# terrain mesh; x east, y north, z up, metres\n");
    let mut index = vec![0usize; g.len()];
    let mut vertices = 0;
    for row in 0..g.rows {
        for (col, &z) in grid.row(row).iter().enumerate().filter(|(_, z)| z.is_finite()) {
            vertices += 1;
            index[row * g.cols + col] = vertices;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "v {} {} {}", g.x(col), g.y(row), z as f32);
        }
    }
    let mut face = |corners: [usize; 3]| {
        if corners.iter().all(|&v| v > 0) {
            let _ = writeln!(text, "f {} {} {}", corners[0], corners[1], corners[2]);
        }
    };
    for north in 0..g.rows.saturating_sub(1) {
        for west in 0..g.cols.saturating_sub(1) {
            let at = |row: usize, col: usize| index[row * g.cols + col];
            let (nw, ne) = (at(north, west), at(north, west + 1));
            let (sw, se) = (at(north + 1, west), at(north + 1, west + 1));
            face([nw, sw, se]);
            face([nw, se, ne]);
        }
    }
    text.into_bytes()
}
