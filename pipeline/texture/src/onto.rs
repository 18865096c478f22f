//! Adds a periodic texture to a base terrain, its amplitude optionally modulated by the base's slope or by a raster.

use sastrugi_numeric::{Grid, Surface};
use sastrugi_schemas::{ParameterError, counted};

/// Relative difference below which two cell sizes count as equal.
const CELL_TOLERANCE: f64 = 1e-6;

/// Why a texture cannot be added to its base.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OntoError {
    /// Sampling a texture between its cells would smooth it and change its covariance.
    #[error(
        "cell sizes differ: texture {texture_m:?} m, base {base_m:?} m; generate the texture at the base's cell size"
    )]
    Cells {
        /// Cell size of the texture, m.
        texture_m: [f64; 2],
        /// Cell size of the base, m.
        base_m: [f64; 2],
    },
    /// A raster of factors needs a value at every cell of the base.
    #[error(
        "the amplitude raster has no value or a negative one at x = {x} m, y = {y} m; it must cover the base with values of 0 or above"
    )]
    Amplitude {
        /// East, m.
        x: f64,
        /// North, m.
        y: f64,
    },
}

/// Texture amplitude as a function of the base's slope: linear between the given slopes, constant beyond the outermost.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_texture::{SlopeFactors, modulated_onto};
///
/// // Texture on level ground only: none from 40 degrees on. The base rises eastwards at 45 degrees.
/// let factors = SlopeFactors { slope_deg: vec![0.0, 40.0], factor: vec![1.0, 0.0] };
/// factors.check().unwrap();
/// let base = Grid::new(Geometry::square(1, 4, 1.0), vec![0.0, 1.0, 2.0, 3.0]);
/// let tile = Grid::filled(Geometry::square(1, 1, 1.0), 9.0);
/// let sum = modulated_onto(&base, &tile, Some(&factors.over(&base))).unwrap();
/// assert_eq!(sum.values, base.values);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SlopeFactors {
    /// Slopes, degrees, ascending.
    pub slope_deg: Vec<f64>,
    /// Factor at each slope, 0 or above.
    pub factor: Vec<f64>,
}

impl SlopeFactors {
    /// Checks the table.
    ///
    /// # Errors
    /// Empty lists or lists of different lengths; slopes that do not ascend; a factor below 0.
    pub fn check(&self) -> Result<(), ParameterError> {
        let (slopes, factors) = (&self.slope_deg, &self.factor);
        if slopes.is_empty() || slopes.len() != factors.len() {
            let [slopes, factors] =
                [(slopes, "slope"), (factors, "factor")].map(|(list, noun)| counted(list.len(), noun));
            let message = format!("has {slopes} and {factors}; give one factor per slope");
            return Err(ParameterError::new("modulate", message));
        }
        if !slopes.iter().all(|s| s.is_finite()) || slopes.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(ParameterError::new("modulate.slope_deg", "must be finite slopes in ascending order"));
        }
        if !factors.iter().all(|f| f.is_finite() && *f >= 0.0) {
            return Err(ParameterError::new("modulate.factor", "must be finite factors, 0 or above"));
        }
        Ok(())
    }

    fn at(&self, slope_deg: f64) -> f64 {
        let after = self.slope_deg.partition_point(|s| *s <= slope_deg);
        match (after.checked_sub(1), self.slope_deg.get(after)) {
            (None, _) => self.factor[0],
            (Some(last), None) => self.factor[last],
            (Some(low), Some(high_deg)) => {
                let share = (slope_deg - self.slope_deg[low]) / (high_deg - self.slope_deg[low]);
                self.factor[low] + share * (self.factor[after] - self.factor[low])
            }
        }
    }

    /// Factor at every cell of a base, from its slope: central differences, one-sided at edges and next to no-data cells.
    pub fn over(&self, base: &Grid) -> Grid {
        let [dx, dy] = base.geometry.cell;
        let (rows, cols) = (base.rows(), base.cols());
        let difference = |here: f64, before: Option<f64>, after: Option<f64>, cell: f64| {
            let known = |z: Option<f64>| z.filter(|z| z.is_finite());
            match (known(before), known(after)) {
                (Some(a), Some(b)) => (b - a) / (2.0 * cell),
                (Some(a), None) => (here - a) / cell,
                (None, Some(b)) => (b - here) / cell,
                (None, None) => 0.0,
            }
        };
        let at = |r: Option<usize>, c: Option<usize>| Some(base.at(r.filter(|r| *r < rows)?, c.filter(|c| *c < cols)?));
        let factor = |r: usize, c: usize| {
            let here = base.at(r, c);
            let x = difference(here, at(Some(r), c.checked_sub(1)), at(Some(r), Some(c + 1)), dx);
            let y = difference(here, at(r.checked_sub(1), Some(c)), at(Some(r + 1), Some(c)), dy);
            self.at(libm::atan((x * x + y * y).sqrt()).to_degrees())
        };
        let values = (0..rows).flat_map(|r| (0..cols).map(move |c| (r, c))).map(|(r, c)| factor(r, c)).collect();
        Grid::new(base.geometry, values)
    }
}

/// Resamples a raster of factors to the cells of a base: bilinear, nearest value at the raster's rim.
///
/// # Errors
/// A cell of the base that has data but no factor of 0 or above.
pub fn amplitude(base: &Grid, raster: &Grid) -> Result<Grid, OntoError> {
    let g = base.geometry;
    let factor = |k: usize| {
        let (x, y) = (g.x(k % g.cols), g.y(k / g.cols));
        let nearest = || raster.geometry.cell_at(x, y).map(|(r, c)| raster.at(r, c));
        match raster.height(x, y).or_else(nearest).filter(|f| *f >= 0.0) {
            Some(factor) => Ok(factor),
            None if base.values[k].is_nan() => Ok(f64::NAN),
            None => Err(OntoError::Amplitude { x, y }),
        }
    };
    Ok(Grid::new(g, (0..g.len()).map(factor).collect::<Result<_, _>>()?))
}

/// Checks that texture and base have the same cell size (east-west and north-south, m).
///
/// # Errors
/// Cell sizes that differ.
pub fn check_cells(base_m: [f64; 2], texture_m: [f64; 2]) -> Result<(), OntoError> {
    if (0..2).any(|k| (base_m[k] - texture_m[k]).abs() > CELL_TOLERANCE * base_m[k]) {
        return Err(OntoError::Cells { texture_m, base_m });
    }
    Ok(())
}

/// Base plus texture, cell by cell on the base's grid. The texture is tiled from the south-west corner until it covers the
/// base, which is seamless if the texture is periodic. No-data cells of the base stay no data.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
///
/// // A tile of one row and two columns on a base of two rows and three columns.
/// let tile = Grid::new(Geometry::square(1, 2, 0.5), vec![0.25, -0.25]);
/// let base = Grid::filled(Geometry::square(2, 3, 0.5), 10.0);
/// let sum = sastrugi_texture::onto(&base, &tile).unwrap();
/// assert_eq!(sum.row(0), [10.25, 9.75, 10.25]);
/// // Texture of other cells would have to be interpolated, which would smooth it.
/// assert!(sastrugi_texture::onto(&Grid::filled(Geometry::square(2, 3, 1.0), 10.0), &tile).is_err());
/// ```
///
/// # Errors
/// Cell sizes that differ.
pub fn onto(base: &Grid, texture: &Grid) -> Result<Grid, OntoError> {
    modulated_onto(base, texture, None)
}

/// As [`onto()`], with the texture multiplied by a factor at each cell of the base.
///
/// # Errors
/// Cell sizes that differ.
pub fn modulated_onto(base: &Grid, texture: &Grid, factors: Option<&Grid>) -> Result<Grid, OntoError> {
    check_cells(base.geometry.cell, texture.geometry.cell)?;
    let (rows, tile_rows, tile_cols) = (base.rows(), texture.rows(), texture.cols());
    let mut sum = base.clone();
    for (r, line) in sum.values.chunks_exact_mut(base.cols()).enumerate() {
        let south = (rows - 1 - r) % tile_rows;
        let tile = texture.row(tile_rows - 1 - south);
        match factors {
            None => line.iter_mut().enumerate().for_each(|(c, z)| *z += tile[c % tile_cols]),
            Some(factors) => {
                let factors = factors.row(r).iter().enumerate();
                line.iter_mut().zip(factors).for_each(|(z, (c, factor))| *z += factor * tile[c % tile_cols]);
            }
        }
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

    /// A 45-degree plane next to level ground: factors by slope, and a raster of factors at half the resolution.
    #[test]
    fn val_amplitudes() {
        let g = Geometry::square(4, 8, 1.0);
        let base = Grid::new(g, (0..32).map(|k| f64::max(0.0, (k % 8) as f64 - 4.0)).collect());
        let factors = SlopeFactors { slope_deg: vec![0.0, 60.0], factor: vec![1.0, 0.2] };
        factors.check().unwrap();
        let by_slope = factors.over(&base);
        assert!((by_slope.at(1, 1) - 1.0).abs() < 1e-12 && (by_slope.at(2, 6) - 0.4).abs() < 1e-12);
        assert!((by_slope.at(0, 7) - 0.4).abs() < 1e-12, "{}", by_slope.at(0, 7));
        let texture = Grid::filled(Geometry::square(2, 2, 1.0), 10.0);
        let sum = modulated_onto(&base, &texture, Some(&by_slope)).unwrap();
        assert!((sum.at(2, 6) - (2.0 + 4.0)).abs() < 1e-12);
        let raster = Grid::filled(Geometry::square(2, 4, 2.0), 0.5);
        assert!(amplitude(&base, &raster).unwrap().values.iter().all(|f| *f == 0.5));
        let small = Grid::filled(Geometry::square(2, 2, 2.0), 0.5);
        assert!(amplitude(&base, &small).unwrap_err().to_string().contains("x = 4.5 m"));
        let wrong = |slope_deg: &[f64], factor: &[f64]| {
            SlopeFactors { slope_deg: slope_deg.to_vec(), factor: factor.to_vec() }.check().is_err()
        };
        assert!(
            wrong(&[], &[]) && wrong(&[1.0, 0.0], &[1.0, 1.0]) && wrong(&[0.0], &[-1.0]) && wrong(&[0.0], &[1.0, 2.0])
        );
    }

    /// A raster of factors `x + 10 y` on cells of 2 m and a base on cells of 1 m: bilinear interpolation reproduces it between the raster's
    /// outer centres (1 to 7 m); beyond them the value of the cell is used. Swapped axes would give `y + 10 x`.
    #[test]
    fn val_amplitudes_are_resampled() {
        let coarse = Geometry { rows: 4, cols: 5, cell: [2.0; 2], origin: [0.0; 2] };
        let raster = Grid::new(coarse, (0..20).map(|k| coarse.x(k % 5) + 10.0 * coarse.y(k / 5)).collect());
        let mut base = Grid::filled(Geometry { rows: 8, cols: 10, cell: [1.0; 2], origin: [0.0; 2] }, 0.0);
        let factors = amplitude(&base, &raster).unwrap();
        for (row, col) in (1..7).flat_map(|r| (1..9).map(move |c| (r, c))) {
            let expected = base.geometry.x(col) + 10.0 * base.geometry.y(row);
            assert!((factors.at(row, col) - expected).abs() < 1e-12, "{row} {col}: {}", factors.at(row, col));
        }
        // South-western and north-eastern corners: cells at (1, 1) and (9, 7) m.
        assert_eq!((factors.at(7, 0), factors.at(0, 9)), (11.0, 79.0));
        // A negative factor is refused, except where the base has no data.
        let mut negative = raster.clone();
        negative.values[0] = -1.0;
        assert!(matches!(amplitude(&base, &negative), Err(OntoError::Amplitude { x: 0.5, y: 7.5 })));
        for (row, col) in (0..2).flat_map(|r| (0..3).map(move |c| (r, c))) {
            base.values[row * 10 + col] = f64::NAN;
        }
        let gaps = amplitude(&base, &negative).unwrap();
        assert!(gaps.at(0, 0).is_nan() && gaps.at(0, 3) > 0.0);
    }

    /// Planes of slope 1 eastwards and 1 northwards on cells of 1 m by 2 m: both are 45 degrees, and the factor is constant beyond the table.
    #[test]
    fn val_factors_follow_the_slope_in_both_directions() {
        let g = Geometry { rows: 4, cols: 5, cell: [1.0, 2.0], origin: [0.0; 2] };
        let plane =
            |east: f64, north: f64| Grid::new(g, (0..20).map(|k| east * g.x(k % 5) + north * g.y(k / 5)).collect());
        let factors = SlopeFactors { slope_deg: vec![30.0, 60.0], factor: vec![1.0, 3.0] };
        for (east, north, expected) in
            [(1.0, 0.0, 2.0), (0.0, 1.0, 2.0), (0.0, -1.0, 2.0), (0.1, 0.0, 1.0), (3.0, 3.0, 3.0)]
        {
            let over = factors.over(&plane(east, north));
            assert!(over.values.iter().all(|f| (f - expected).abs() < 1e-12), "{east} {north}: {:?}", over.values);
        }
        // A cell without neighbours with data is level.
        let mut alone = plane(3.0, 3.0).map(|_| f64::NAN);
        alone.values[7] = 5.0;
        assert_eq!(factors.over(&alone).values[7], 1.0);
    }

    #[test]
    fn val_different_cell_sizes_are_refused() {
        let tile = Grid::filled(Geometry::square(2, 2, 0.1), 0.0);
        let base = Grid::filled(Geometry::square(4, 4, 0.2), 0.0);
        let message = onto(&base, &tile).unwrap_err().to_string();
        assert!(message.contains("[0.1, 0.1]") && message.contains("[0.2, 0.2]"), "{message}");
    }
}
