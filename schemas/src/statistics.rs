//! The section `statistics` of a fit file: what a method needs to reproduce more of a measured residual than its covariance.
//!
//! It holds statistics and extremes (the highest and lowest of heights and differences), no positions: no method is known to recover the DEM from
//! them. The numbers that it states ([`Statistics::numbers`]) are fewer than a quarter of the cells with data. Its size does not depend on that
//! of the DEM: at most [`LAGS_MAX`] lags along each axis, 129 probabilities and 32 bands, below 1 MB as JSON.

use crate::{ParameterError, counted};
use serde::{Deserialize, Serialize};

/// Version of the section.
pub const VERSION: u32 = 1;
/// Most lags of a covariance along one axis.
pub const LAGS_MAX: usize = 96;
/// Largest lag of a covariance, cells.
pub const LAG_MAX: u32 = 256;

/// Statistics of a residual: heights minus their moving average, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Version of this section, [`VERSION`].
    pub version: u32,
    /// Cells of the residual, east-west and north-south, m; textures from these statistics have the same cells.
    pub cell_m: [f64; 2],
    /// Cells with data.
    pub cells: u64,
    /// Probabilities of all quantiles below, ascending from 0 to 1.
    pub probabilities: Vec<f64>,
    /// Quantiles of the residual, m.
    pub heights_m: Vec<f64>,
    /// Covariance by lag.
    pub covariance: LagCovariances,
    /// The same of the Laplacian (five points, with the shorter side of a cell as the unit of length), m2: the power of waves that are too
    /// short and weak for the covariance of the heights to hold.
    pub laplacian: LagCovariances,
    /// Patchiness, for the method `modulated`.
    pub modulation: Modulation,
    /// Increments and wavelets, for the method `wavelet_statistics`.
    pub wavelets: Wavelets,
}

/// A covariance about zero by lag, without trimming.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LagCovariances {
    /// Lags southwards, cells: 0, 1, 2 ..., in steps of one cell first and wider apart further out.
    pub rows: Vec<u32>,
    /// Lags eastwards (and westwards), cells, likewise.
    pub cols: Vec<u32>,
    /// Covariance for each lag southwards (outer) and for lags from the farthest west through 0 to the farthest east (inner): m2, or 1 for
    /// logarithms.
    pub values: Vec<f64>,
}

/// Parameters of the amplitude field of a residual that is rough in patches.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Modulation {
    /// Variance of the logarithm of the amplitude that textures have: the measured one, or the part of it with which their covariance can be kept.
    pub log_variance: f64,
    /// Measured variance; 0 for a residual that is equally rough everywhere.
    pub measured_log_variance: f64,
    /// Its standard error.
    pub log_variance_error: f64,
    /// Distance over which the correlation of the logarithm falls to 1/e, m.
    pub range_m: f64,
    /// Number of independent patches that the site holds; 0 if the residual has no differences to measure them by.
    pub patches: f64,
    /// Lags of the flatness, cells.
    pub lags: Vec<u32>,
    /// Measured flatness `<d^4> / <d^2>^2` of the increments d over each lag, both axes together; 3 for a normal residual.
    pub flatness: Vec<f64>,
}

/// Distributions of differences between cells, and joint statistics of the magnitudes of wavelets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wavelets {
    /// Differences between cells, with their quantiles.
    pub differences: Vec<Difference>,
    /// Octaves of wavelets, from the finest; each has four orientations.
    pub octaves: u32,
    /// Added to magnitudes before their logarithm is taken, m.
    pub floor_m: f64,
    /// Mean logarithm of the magnitude of each band, octave by octave; in an octave by direction of the wave vector, 0, 45, 90 and 135
    /// degrees from east towards south.
    pub mean_log: Vec<f64>,
    /// Covariance of these logarithms between bands, row by row.
    pub covariance_log: Vec<f64>,
    /// Covariance by lag of the mean of all bands' logarithms about their means: how rough and smooth places lie; absent without bands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patches: Option<LagCovariances>,
}

/// A weighted difference between neighbouring cells and its distribution.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// `[rows south, columns east, weight]` of each cell.
    pub stencil: Vec<(i32, i32, f64)>,
    /// Quantiles at the section's probabilities, m.
    pub quantiles_m: Vec<f64>,
}

impl Statistics {
    /// Most quantiles, bands, differences and cells of a stencil that are read.
    const COUNTS_MAX: [(&'static str, usize); 4] = [
        ("probabilities", 1025),
        ("wavelets.mean_log", 64),
        ("wavelets.differences", 64),
        ("wavelets.differences.stencil", 64),
    ];

    /// Checks a section read from a file.
    ///
    /// # Errors
    /// Another version; tables of the wrong size, out of order, or with values that are not finite.
    pub fn check(&self) -> Result<(), ParameterError> {
        let refuse = |key: &str, message: String| Err(ParameterError::new(format!("statistics.{key}"), message));
        if self.version != VERSION {
            return refuse(
                "version",
                format!("is {}; this program reads version {VERSION}: fit the DEM again", self.version),
            );
        }
        for side in self.cell_m {
            ParameterError::positive("cell_m", side).map_err(|e| e.within("statistics"))?;
        }
        self.check_counts()?;
        let n = self.probabilities.len();
        if n < 2 || self.probabilities[0] != 0.0 || self.probabilities[n - 1] != 1.0 || !ascends(&self.probabilities) {
            return refuse("probabilities", "must ascend from 0 to 1".to_owned());
        }
        if self.probabilities.windows(2).any(|pair| pair[0] == pair[1]) {
            return refuse("probabilities", "must not repeat a value".to_owned());
        }
        self.check_quantiles("heights_m", &self.heights_m)?;
        self.covariance.check().map_err(|e| e.within("statistics.covariance"))?;
        self.laplacian.check().map_err(|e| e.within("statistics.laplacian"))?;
        self.modulation.check().map_err(|e| e.within("statistics.modulation"))?;
        for difference in &self.wavelets.differences {
            self.check_quantiles("wavelets.differences.quantiles_m", &difference.quantiles_m)?;
            let weights: f64 = difference.stencil.iter().map(|(_, _, weight)| weight * weight).sum();
            if !(weights.is_finite() && weights > 0.0) {
                return refuse(
                    "wavelets.differences.stencil",
                    "must have finite weights, at least one of them not 0".to_owned(),
                );
            }
        }
        self.wavelets.check().map_err(|e| e.within("statistics.wavelets"))
    }

    /// Numbers that were measured: quantiles, covariances, and moments of wavelets.
    pub fn numbers(&self) -> usize {
        let Wavelets { differences, mean_log, patches, .. } = &self.wavelets;
        let (quantiles, bands) = (self.probabilities.len(), mean_log.len());
        let tables = [Some(&self.covariance), Some(&self.laplacian), patches.as_ref()];
        let lags: usize = tables.into_iter().flatten().map(|table| table.values.len()).sum();
        // A covariance between bands is symmetric.
        (1 + differences.len()) * quantiles + lags + bands + bands * (bands + 1) / 2
    }

    fn check_counts(&self) -> Result<(), ParameterError> {
        let wavelets = &self.wavelets;
        let cells = wavelets.differences.iter().map(|d| d.stencil.len()).max().unwrap_or(0);
        let counts = [self.probabilities.len(), wavelets.mean_log.len(), wavelets.differences.len(), cells];
        for ((key, most), count) in Self::COUNTS_MAX.into_iter().zip(counts) {
            if count > most {
                let message = format!("has {count} entries; the limit is {most}");
                return Err(ParameterError::new(format!("statistics.{key}"), message));
            }
        }
        Ok(())
    }

    fn check_quantiles(&self, key: &str, quantiles_m: &[f64]) -> Result<(), ParameterError> {
        if quantiles_m.len() == self.probabilities.len() && ascends(quantiles_m) {
            return Ok(());
        }
        let message = format!("must be {} finite heights in ascending order", self.probabilities.len());
        Err(ParameterError::new(format!("statistics.{key}"), message))
    }
}

/// Whether values are finite and never decrease.
fn ascends(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite()) && values.windows(2).all(|pair| pair[0] <= pair[1])
}

impl LagCovariances {
    /// Checks a table read from a file.
    ///
    /// # Errors
    /// Lags that do not start at 0 or do not ascend; too few, too many or non-finite values; a variance that is not positive.
    pub fn check(&self) -> Result<(), ParameterError> {
        for (key, lags) in [("rows", &self.rows), ("cols", &self.cols)] {
            let ascend = lags.windows(2).all(|pair| pair[0] < pair[1]);
            let fit = lags.len() <= LAGS_MAX && lags.last().is_some_and(|lag| *lag <= LAG_MAX);
            if lags.first() != Some(&0) || !ascend || !fit {
                let message = format!("must hold at most {LAGS_MAX} lags, ascending from 0 to at most {LAG_MAX} cells");
                return Err(ParameterError::new(key, message));
            }
        }
        let needed = self.rows.len() * self.inner();
        if self.values.len() != needed || self.values.iter().any(|c| !c.is_finite()) {
            return Err(ParameterError::new("values", format!("must be {}", counted(needed, "finite value"))));
        }
        ParameterError::positive("values", self.variance()).map(drop)
    }

    /// Values of a lag southwards.
    pub fn inner(&self) -> usize {
        2 * self.cols.len() - 1
    }

    /// Covariance at lag 0.
    pub fn variance(&self) -> f64 {
        self.values[self.cols.len() - 1]
    }
}

impl Modulation {
    /// Checks parameters read from a file.
    ///
    /// # Errors
    /// A negative variance, error or number; a range that is not positive.
    pub fn check(&self) -> Result<(), ParameterError> {
        let Self { log_variance, measured_log_variance, log_variance_error, patches, .. } = *self;
        for (key, value) in [
            ("log_variance", log_variance),
            ("measured_log_variance", measured_log_variance),
            ("log_variance_error", log_variance_error),
            ("patches", patches),
        ] {
            ParameterError::not_negative(key, value)?;
        }
        ParameterError::positive("range_m", self.range_m).map(drop)
    }
}

impl Wavelets {
    /// Orientations of an octave.
    pub const ORIENTATIONS: usize = 4;

    /// Checks a table read from a file.
    ///
    /// # Errors
    /// Tables of the wrong size, values that are not finite, a variance that is not positive.
    pub fn check(&self) -> Result<(), ParameterError> {
        let bands = Self::ORIENTATIONS * self.octaves as usize;
        if self.mean_log.len() != bands || self.mean_log.iter().any(|v| !v.is_finite()) {
            return Err(ParameterError::new(
                "mean_log",
                format!("must be {bands} finite values, four for each octave"),
            ));
        }
        let needed = bands * bands;
        if self.covariance_log.len() != needed || self.covariance_log.iter().any(|v| !v.is_finite()) {
            return Err(ParameterError::new("covariance_log", format!("must be {needed} finite values")));
        }
        for band in 0..bands {
            ParameterError::positive("covariance_log", self.covariance_log[band * bands + band])?;
        }
        if let Some(patches) = &self.patches {
            patches.check().map_err(|e| e.within("patches"))?;
        }
        ParameterError::positive("floor_m", self.floor_m).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Statistics {
        Statistics {
            version: VERSION,
            cell_m: [0.5, 0.25],
            cells: 12,
            probabilities: vec![0.0, 0.5, 1.0],
            heights_m: vec![-1.0, 0.0, 2.0],
            covariance: LagCovariances {
                rows: vec![0, 1],
                cols: vec![0, 1],
                values: vec![0.5, 1.0, 0.5, 0.1, 0.4, 0.1],
            },
            laplacian: LagCovariances { rows: vec![0], cols: vec![0], values: vec![0.2] },
            modulation: Modulation { log_variance: 0.3, range_m: 2.0, ..Modulation::default() },
            wavelets: Wavelets {
                differences: vec![Difference {
                    stencil: vec![(0, 0, -1.0), (0, 1, 1.0)],
                    quantiles_m: vec![-1.0, 0.0, 1.0],
                }],
                octaves: 1,
                floor_m: 1e-6,
                mean_log: vec![0.0; 4],
                covariance_log: (0..16).map(|k| if k % 5 == 0 { 1.0 } else { 0.0 }).collect(),
                patches: Some(LagCovariances { rows: vec![0], cols: vec![0], values: vec![0.3] }),
            },
        }
    }

    #[test]
    fn prop_sections_read_back() {
        let text = serde_json::to_string(&small()).unwrap();
        let again: Statistics = serde_json::from_str(&text).unwrap();
        assert_eq!(again, small());
        assert!(again.check().is_ok());
        assert_eq!((again.covariance.variance(), again.covariance.inner()), (1.0, 3));
    }

    /// By hand: two times three quantiles; 6, 1 and 1 covariances; 4 means, and 10 covariances of them.
    #[test]
    fn val_numbers_by_hand() {
        assert_eq!(small().numbers(), 6 + 8 + 14);
    }

    /// Each kind of damage is refused with the key of the damaged table.
    #[test]
    fn val_damaged_sections_are_refused() {
        /// A damaged table, and what damages it.
        type Damage = (&'static str, fn(&mut Statistics));
        let damages: [Damage; 18] = [
            ("statistics.version", |s| s.version = 2),
            ("statistics.cell_m", |s| s.cell_m[1] = 0.0),
            ("statistics.probabilities", |s| s.probabilities[0] = 0.1),
            ("statistics.probabilities", |s| s.probabilities[1] = 1.0),
            ("statistics.probabilities", |s| s.probabilities = vec![0.0; 2000]),
            ("statistics.heights_m", |s| s.heights_m[0] = 1.0),
            ("statistics.covariance.rows", |s| s.covariance.rows = vec![0, 0]),
            ("statistics.covariance.cols", |s| s.covariance.cols = Vec::new()),
            ("statistics.covariance.cols", |s| s.covariance.cols = vec![0, 257]),
            ("statistics.covariance.values", |s| s.covariance.values[1] = -1.0),
            ("statistics.laplacian.values", |s| s.laplacian.values.clear()),
            ("statistics.modulation.range_m", |s| s.modulation.range_m = 0.0),
            ("statistics.modulation.log_variance_error", |s| s.modulation.log_variance_error = -0.1),
            ("statistics.wavelets.differences.quantiles_m", |s| s.wavelets.differences[0].quantiles_m[2] = f64::NAN),
            ("statistics.wavelets.differences.stencil", |s| s.wavelets.differences[0].stencil.clear()),
            ("statistics.wavelets.mean_log", |s| s.wavelets.octaves = 2),
            ("statistics.wavelets.patches.rows", |s| s.wavelets.patches = Some(LagCovariances::default())),
            ("statistics.wavelets.covariance_log", |s| s.wavelets.covariance_log[5] = 0.0),
        ];
        for (key, damage) in damages {
            let mut damaged = small();
            damage(&mut damaged);
            assert_eq!(damaged.check().err().map(|e| e.key).as_deref(), Some(key));
        }
    }
}
