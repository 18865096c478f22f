//! A separable field by recursions.
//!
//! With r = exp(-cell / a), `e[i, j] = r e[i - 1, j] + sqrt(1 - r^2) n[i, j]` along each row and
//! `h[i, j] = r h[i, j - 1] + sqrt(1 - r^2) e[i, j]` from row to row, both begun with a draw of their stationary variance: the
//! field `r h[i - 1, j] + r h[i, j - 1] - r^2 h[i - 1, j - 1] + (1 - r^2) n[i, j]` with covariance `s^2 r^(|di| + |dj|)`
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
