//! Roughness classes by gradient.
//!
//! `low <= t1 < semi <= t2 < high` on the Moore-neighbourhood gradient. The published thresholds, 50 and 140 levels per
//! cm at 0.75 / 128 cm a level, are 0.293 and 0.820 m/m (16.3 and 39.4 degrees), so that they apply to any DEM (Majhor
//! and Bos, section 2.3).

use sastrugi_numeric::Grid;
use serde::{Deserialize, Serialize};

/// Code of low roughness.
pub const LOW: u8 = 0;
/// Code of semi roughness.
pub const SEMI: u8 = 1;
/// Code of high roughness.
pub const HIGH: u8 = 2;
/// Code of a cell without a gradient.
pub const NO_CLASS: u8 = 255;

/// Height of a published 16-bit level, cm.
const LEVEL_CM: f64 = 0.75 / 128.0;

/// Gradients that part the classes, m/m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RawThresholds")]
pub struct ClassThresholds {
    low_max: f64,
    semi_max: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawThresholds {
    low_max: f64,
    semi_max: f64,
}

/// Thresholds that do not part three classes.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("thresholds are {low_max} and {semi_max} m/m; they must be finite and increasing from above 0")]
pub struct ThresholdError {
    low_max: f64,
    semi_max: f64,
}

impl ClassThresholds {
    /// Thresholds between low and semi, and between semi and high roughness, m/m.
    ///
    /// # Errors
    /// [`ThresholdError`] unless `0 < low_max < semi_max` and both are finite.
    pub fn new(low_max: f64, semi_max: f64) -> Result<Self, ThresholdError> {
        if 0.0 < low_max && low_max < semi_max && semi_max.is_finite() {
            Ok(Self { low_max, semi_max })
        } else {
            Err(ThresholdError { low_max, semi_max })
        }
    }

    /// Largest gradient of low roughness, m/m.
    pub fn low_max(&self) -> f64 {
        self.low_max
    }

    /// Largest gradient of semi roughness, m/m.
    pub fn semi_max(&self) -> f64 {
        self.semi_max
    }

    /// Code of a gradient.
    pub fn class(&self, gradient: f64) -> u8 {
        if gradient.is_nan() {
            NO_CLASS
        } else if gradient <= self.low_max {
            LOW
        } else if gradient <= self.semi_max {
            SEMI
        } else {
            HIGH
        }
    }
}

impl Default for ClassThresholds {
    /// The published thresholds.
    fn default() -> Self {
        Self { low_max: 50.0 * LEVEL_CM, semi_max: 140.0 * LEVEL_CM }
    }
}

impl TryFrom<RawThresholds> for ClassThresholds {
    type Error = ThresholdError;

    fn try_from(raw: RawThresholds) -> Result<Self, ThresholdError> {
        Self::new(raw.low_max, raw.semi_max)
    }
}

/// Class codes of a gradient map.
pub fn classify(gradient: &Grid, thresholds: &ClassThresholds) -> Grid<u8> {
    gradient.map(|g| thresholds.class(g))
}

/// Shares of the classes among the cells with a class; NaN when there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shares {
    /// Share of low roughness.
    pub low: f64,
    /// Share of semi roughness.
    pub semi: f64,
    /// Share of high roughness.
    pub high: f64,
}

/// Shares over the cells whose centres are at least `border_m` from the grid's edge.
pub fn shares(classes: &Grid<u8>, border_m: f64) -> Shares {
    let g = &classes.geometry;
    let [cell_x, cell_y] = g.cell;
    let inside = |k: usize, n: usize, cell: f64| (k.min(n - 1 - k) as f64 + 0.5) * cell >= border_m;
    let mut counts = [0u64; 3];
    for r in (0..g.rows).filter(|&r| inside(r, g.rows, cell_y)) {
        for (_, &class) in classes.row(r).iter().enumerate().filter(|(c, _)| inside(*c, g.cols, cell_x)) {
            if let Some(count) = counts.get_mut(usize::from(class)) {
                *count += 1;
            }
        }
    }
    let all = counts.iter().sum::<u64>() as f64;
    let [low, semi, high] = counts.map(|n| n as f64 / all);
    Shares { low, semi, high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    #[test]
    fn val_published_thresholds() {
        let t = ClassThresholds::default();
        assert!((t.low_max() - 0.293).abs() < 5e-4 && (t.semi_max() - 0.820).abs() < 5e-4);
        let edges = [0.0, t.low_max(), t.low_max() + 1e-9, t.semi_max(), t.semi_max() + 1e-9, f64::NAN];
        assert_eq!(edges.map(|g| t.class(g)), [LOW, LOW, SEMI, SEMI, HIGH, NO_CLASS]);
    }

    #[test]
    fn val_thresholds_that_do_not_increase_are_refused() {
        for (low, semi) in [(0.5, 0.5), (0.6, 0.5), (0.0, 1.0), (-1.0, 1.0), (f64::NAN, 1.0), (0.1, f64::INFINITY)] {
            assert!(ClassThresholds::new(low, semi).is_err(), "{low} {semi}");
        }
    }

    #[test]
    fn val_shares_leave_the_border_out() {
        let mut classes = Grid::filled(Geometry::square(8, 10, 0.5), HIGH);
        for r in 2..6 {
            for c in 2..8 {
                classes.values[r * 10 + c] = if c == 2 { SEMI } else { LOW };
            }
        }
        classes.values[2 * 10 + 7] = NO_CLASS;
        let inner = shares(&classes, 1.0);
        assert_eq!(inner, Shares { low: 19.0 / 23.0, semi: 4.0 / 23.0, high: 0.0 });
        assert!(shares(&classes, 3.0).low.is_nan());
        assert!(shares(&classes, 0.0).high > 0.0);
    }
}
