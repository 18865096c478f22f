//! A separable field by first-order recursions.
//!
//! With r = exp(-cell / a), `e[i, j] = r e[i - 1, j] + sqrt(1 - r^2) n[i, j]` along each row and
//! `h[i, j] = r h[i, j - 1] + sqrt(1 - r^2) e[i, j]` from row to row, each started with a draw of its stationary variance. This is
//! the field `r h[i - 1, j] + r h[i, j - 1] - r^2 h[i - 1, j - 1] + (1 - r^2) n[i, j]`, with covariance `s^2 r^(|di| + |dj|)`
//! exactly, and the same variance in every cell.

use sastrugi_numeric::{Geometry, Grid, Streams};

/// The field, drawn row by row from the south-west.
pub fn field(streams: &Streams, geometry: Geometry, rms_m: f64, length_m: f64) -> Grid {
    let mut stream = streams.stream("field");
    let ratio = libm::exp(-geometry.cell[0] / length_m);
    let fresh = (1.0 - ratio * ratio).sqrt();
    let cols = geometry.cols;
    let mut values = vec![0.0; geometry.len()];
    let mut south: Option<&[f64]> = None;
    for row in values.chunks_exact_mut(cols).rev() {
        let mut west = stream.normal() * rms_m;
        row[0] = west;
        for h in &mut row[1..] {
            west = ratio * west + fresh * rms_m * stream.normal();
            *h = west;
        }
        if let Some(south) = south {
            row.iter_mut().zip(south).for_each(|(h, s)| *h = ratio * s + fresh * *h);
        }
        south = Some(row);
    }
    Grid { geometry, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every cell follows the recursion of the header, with the draws in rows from the south-west.
    #[test]
    fn val_cells_follow_the_recursion() {
        let (rms_m, ratio) = (0.3, libm::exp(-0.5 / 2.0));
        let grid = field(&Streams::for_seed(3, "chains"), Geometry::square(6, 9, 0.5), rms_m, 2.0);
        let mut stream = Streams::for_seed(3, "chains").stream("field");
        let noise: Vec<f64> = (0..54).map(|_| rms_m * stream.normal()).collect();
        // Cell i east and j north.
        let at = |i: usize, j: usize| grid.at(5 - j, i);
        let fresh = (1.0 - ratio * ratio).sqrt();
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-13, "{found} {wanted}");
        near(at(0, 0), noise[0]);
        (1..9).for_each(|i| near(at(i, 0), ratio * at(i - 1, 0) + fresh * noise[i]));
        (1..6).for_each(|j| near(at(0, j), ratio * at(0, j - 1) + fresh * noise[9 * j]));
        for (i, j) in (1..6).flat_map(|j| (1..9).map(move |i| (i, j))) {
            let kept = ratio * (at(i - 1, j) + at(i, j - 1)) - ratio * ratio * at(i - 1, j - 1);
            near(at(i, j), kept + fresh * fresh * noise[9 * j + i]);
        }
    }
}
