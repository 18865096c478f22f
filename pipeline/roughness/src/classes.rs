//! Roughness classes by gradient.
//!
//! `low <= t1 < semi <= t2 < high` on the Moore-neighbourhood gradient. The published thresholds, 50 and 140 levels per
//! cm at 0.75 / 128 cm per level (Majhor and Bos, section 2.3), are converted to 0.293 and 0.820 m/m (16.3 and 39.4
//! degrees), so that they apply to any DEM.

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

/// Gradient thresholds between the classes, m/m.
///
/// # Examples
/// ```
/// use sastrugi_roughness::{ClassThresholds, HIGH, LOW, NO_CLASS, SEMI};
///
/// let thresholds = ClassThresholds::new(0.25, 0.75)?;
/// assert_eq!([0.25, 0.5, 0.76, f64::NAN].map(|gradient| thresholds.class(gradient)), [LOW, SEMI, HIGH, NO_CLASS]);
/// assert!(ClassThresholds::new(0.75, 0.25).is_err());
/// # Ok::<(), sastrugi_roughness::ThresholdError>(())
/// ```
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

/// Thresholds that do not separate three classes.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("thresholds must be finite, positive and increasing, got {low_max} and {semi_max} m/m")]
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

/// Shares of the classes among the cells with a class; NaN if there are none.
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

    /// Thresholds are checked when they are read.
    #[test]
    fn val_thresholds_of_a_file_are_checked() {
        use serde::de::value::{Error, MapDeserializer};
        let read = |pairs: [(&'static str, f64); 2]| -> Result<ClassThresholds, Error> {
            ClassThresholds::deserialize(MapDeserializer::new(pairs.into_iter()))
        };
        assert_eq!(read([("low_max", 0.25), ("semi_max", 0.75)]), Ok(ClassThresholds::new(0.25, 0.75).unwrap()));
        let swapped = read([("low_max", 0.75), ("semi_max", 0.25)]).unwrap_err();
        assert_eq!(swapped.to_string(), "thresholds must be finite, positive and increasing, got 0.75 and 0.25 m/m");
        assert!(read([("low_max", 0.25), ("high_max", 0.75)]).unwrap_err().to_string().contains("high_max"));
    }

    /// Cells of 0.5 x 2 m within a border of 1 m: the two outer columns on either side are out; the centres of the outer rows are 1 m from
    /// the edge, which is just enough.
    #[test]
    fn val_borders_of_oblong_cells() {
        let g = Geometry { rows: 4, cols: 12, cell: [0.5, 2.0], origin: [0.0; 2] };
        let class = |k: usize| match (k / 12, k % 12) {
            (_, 0 | 1 | 10 | 11) => HIGH,
            (0, _) => SEMI,
            _ => LOW,
        };
        let classes = Grid::new(g, (0..48).map(class).collect());
        assert_eq!(shares(&classes, 1.0), Shares { low: 0.75, semi: 0.25, high: 0.0 });
        // 8 columns of rows 1 and 2.
        assert_eq!(shares(&classes, 1.0 + 1e-9), Shares { low: 1.0, semi: 0.0, high: 0.0 });
    }

    #[test]
    fn val_shares_exclude_the_border() {
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
        assert_eq!(shares(&classes, 0.0), Shares { low: 19.0 / 79.0, semi: 4.0 / 79.0, high: 56.0 / 79.0 });
    }
}
