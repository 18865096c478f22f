//! The published recursion, as it is printed.

use sastrugi_numeric::{Geometry, Grid, Streams};

/// Correlation of neighbours in the listing: `exp(-dx acl)` with `dx = 2 acl`.
pub fn ratio(length_m: f64) -> f64 {
    libm::exp(-2.0 * length_m * length_m)
}

/// The field: columns from the west, each from the south; only the southernmost cells are chained from column to column.
pub fn field(streams: &Streams, geometry: Geometry, rms_m: f64, length_m: f64) -> Grid {
    let mut stream = streams.stream("field");
    let ratio = ratio(length_m);
    let fresh = rms_m * (1.0 - ratio * ratio).sqrt();
    let Geometry { rows, cols, .. } = geometry;
    let mut values = vec![0.0; geometry.len()];
    let mut southernmost = 0.0;
    for col in 0..cols {
        if col > 0 {
            southernmost = ratio * southernmost + fresh * stream.normal();
        }
        let mut height = southernmost;
        values[(rows - 1) * cols + col] = height;
        for row in (0..rows - 1).rev() {
            height = ratio * height + fresh * stream.normal();
            values[row * cols + col] = height;
        }
    }
    Grid { geometry, values }
}
