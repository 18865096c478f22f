//! The published recursion, as printed.

use sastrugi_numeric::{Geometry, Grid, Streams};

/// Correlation of neighbours in the listing: `exp(-dx acl)` with `dx = 2 acl`.
pub fn ratio(length_m: f64) -> f64 {
    libm::exp(-2.0 * length_m * length_m)
}

/// The field: columns from the west, each from the south; only the southernmost cells are correlated from column to column.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Every cell of a small field from the printed recursion: the southernmost row starts at 0 and is correlated along itself, every column
    /// starts from it; the correlation is `exp(-2 a^2)`.
    #[test]
    fn val_the_field_is_the_printed_recursion() {
        let r = libm::exp(-0.72);
        let grid = field(&Streams::for_seed(3, "listing"), Geometry::square(4, 3, 0.25), 0.3, 0.6);
        let mut stream = Streams::for_seed(3, "listing").stream("field");
        let mut fresh = || 0.3 * (1.0 - r * r).sqrt() * stream.normal();
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-13, "{found} {wanted}");
        assert_eq!(grid.at(3, 0), 0.0);
        for col in 0..3 {
            if col > 0 {
                near(grid.at(3, col), r * grid.at(3, col - 1) + fresh());
            }
            for row in [2, 1, 0] {
                near(grid.at(row, col), r * grid.at(row + 1, col) + fresh());
            }
        }
    }
}
