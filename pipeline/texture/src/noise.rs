//! White noise of a DEM, from a part of it that is smooth in reality (a road, a roof, still water under ice).
//!
//! Second differences of neighbouring cells, along rows and along columns, take away height and slope and leave
//! `sqrt(6)` times the noise of a cell; their robust standard deviation (1.4826 times the median size: Hampel, 1974)
//! does not mind the edges of a kerb. What the reference itself bends over two cells is counted as noise, and noise that
//! neighbouring cells share (a smoothed DEM) is not seen.

use crate::sizes::{NORMAL_CONSISTENCY, Sizes};
use sastrugi_numeric::Grid;

/// Fewest differences: their robust deviation is then good to about a sixth.
const DIFFERENCES_MIN: usize = 100;

/// White noise per cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation, m.
    pub sigma_m: f64,
    /// Second differences it was found from.
    pub differences: usize,
}

/// Why a reference tells no noise.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoiseError {
    /// Too small, or full of holes.
    #[error(
        "the noise reference holds {found} runs of three neighbouring cells with data within the DEM (and its window); at least \
         {DIFFERENCES_MIN} are needed: a larger part"
    )]
    TooSmall {
        /// Runs that are there.
        found: usize,
    },
    /// More than half of it is exactly plane.
    #[error("the noise reference is exactly plane: it was filled or rounded, and tells no noise")]
    Plane,
}

/// Noise of the cells with data in `reference` (m; NaN outside it).
///
/// # Errors
/// A reference that is too small, or exactly plane.
pub fn of_reference(reference: &Grid) -> Result<Noise, NoiseError> {
    let (rows, cols) = (reference.rows(), reference.cols());
    let bend = |[a, b, c]: [f64; 3]| a - 2.0 * b + c;
    let along = (0..rows).flat_map(|r| (2..cols).map(move |c| [c - 2, c - 1, c].map(|c| reference.at(r, c))));
    let across = (2..rows).flat_map(|r| (0..cols).map(move |c| [r - 2, r - 1, r].map(|r| reference.at(r, c))));
    let bends: Vec<f64> = along.chain(across).map(bend).filter(|b| b.is_finite()).collect();
    if bends.len() < DIFFERENCES_MIN {
        return Err(NoiseError::TooSmall { found: bends.len() });
    }
    let largest_m = reference.range().map_or(0.0, |(low, high)| low.abs().max(high.abs()));
    // Rounding of heights is far below this.
    let still = bends.iter().filter(|b| b.abs() <= 1e-11 * largest_m).count();
    if 2 * still >= bends.len() {
        return Err(NoiseError::Plane);
    }
    let sigma_m = NORMAL_CONSISTENCY * Sizes::of(&bends).exceeded_by(0.5) / 6f64.sqrt();
    Ok(Noise { sigma_m, differences: bends.len() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    /// White noise of 7 mm on a slope with a step (a kerb). Null: 2 * 200 * 198 differences, of which neighbours share cells;
    /// the robust deviation of so many is good to about 0.6 %; limit 4 %, the kerb's share of the cells included.
    #[test]
    fn stat_noise_on_a_slope_is_found() {
        let mut s = Streams::for_seed(3, "noise-test").stream("cells");
        let geometry = Geometry::square(200, 200, 0.1);
        let height = |k: usize| 100.0 + 0.02 * (k % 200) as f64 - 0.01 * (k / 200) as f64;
        let kerb = |k: usize| if k % 200 > 120 { 0.15 } else { 0.0 };
        let grid = Grid::new(geometry, (0..40_000).map(|k| height(k) + kerb(k) + 0.007 * s.normal()).collect());
        let noise = of_reference(&grid).unwrap();
        assert_eq!(noise.differences, 2 * 200 * 198);
        assert!((noise.sigma_m / 0.007 - 1.0).abs() < 0.04, "{noise:?}");
    }

    #[test]
    fn val_references_that_tell_nothing() {
        let plane = Grid::new(Geometry::square(20, 20, 1.0), (0..400).map(|k| 5.0 + 0.25 * (k % 20) as f64).collect());
        assert_eq!(of_reference(&plane), Err(NoiseError::Plane));
        assert_eq!(of_reference(&plane.map(|_| 0.0)), Err(NoiseError::Plane));
        let small = Grid::new(Geometry::square(5, 5, 1.0), (0..25).map(|k| (k * k % 7) as f64).collect());
        assert_eq!(of_reference(&small), Err(NoiseError::TooSmall { found: 30 }));
        let none = small.map(|_| f64::NAN);
        assert_eq!(of_reference(&none), Err(NoiseError::TooSmall { found: 0 }));
    }
}
