//! A periodic texture laid onto a base terrain.

use sastrugi_numeric::Grid;

/// Relative difference of cell sizes that counts as none.
const CELL_TOLERANCE: f64 = 1e-6;

/// A texture that does not fit its base.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OntoError {
    /// Sampling a texture between its cells would smooth it and change its covariance.
    #[error(
        "the texture's cells of {texture_m:?} m are not the base's of {base_m:?} m; make the texture at the base's cell size"
    )]
    Cells {
        /// Cell size of the texture, m.
        texture_m: [f64; 2],
        /// Cell size of the base, m.
        base_m: [f64; 2],
    },
}

/// Base plus texture, cell by cell on the base's own cells. The texture is repeated as often as the base needs from the
/// south-west corner on, which is seamless for a periodic one. Cells of the base without data stay without.
///
/// # Errors
/// Cell sizes that differ.
pub fn onto(base: &Grid, texture: &Grid) -> Result<Grid, OntoError> {
    let (base_m, texture_m) = (base.geometry.cell, texture.geometry.cell);
    if (0..2).any(|k| (base_m[k] - texture_m[k]).abs() > CELL_TOLERANCE * base_m[k]) {
        return Err(OntoError::Cells { texture_m, base_m });
    }
    let (rows, tile_rows, tile_cols) = (base.rows(), texture.rows(), texture.cols());
    let mut sum = base.clone();
    for (r, line) in sum.values.chunks_exact_mut(base.cols()).enumerate() {
        let south = (rows - 1 - r) % tile_rows;
        let tile = texture.row(tile_rows - 1 - south);
        line.iter_mut().enumerate().for_each(|(c, z)| *z += tile[c % tile_cols]);
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A 2 x 3 tile on a 5 x 4 base: rows counted from the south, columns from the west.
    #[test]
    fn val_tiles_start_in_the_south_west() {
        let tile = Grid::new(Geometry::square(2, 3, 0.5), vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let mut base = Grid::filled(Geometry::square(5, 4, 0.5), 10.0);
        base.values[0] = f64::NAN;
        let sum = onto(&base, &tile).unwrap();
        assert_eq!(sum.row(4), [14.0, 15.0, 16.0, 14.0]);
        assert_eq!(sum.row(3), [11.0, 12.0, 13.0, 11.0]);
        assert!(sum.at(0, 0).is_nan());
        assert_eq!(sum.at(0, 1), 15.0);
    }

    #[test]
    fn val_other_cells_are_refused() {
        let tile = Grid::filled(Geometry::square(2, 2, 0.1), 0.0);
        let base = Grid::filled(Geometry::square(4, 4, 0.2), 0.0);
        let message = onto(&base, &tile).unwrap_err().to_string();
        assert!(message.contains("[0.1, 0.1]") && message.contains("[0.2, 0.2]"), "{message}");
    }
}
