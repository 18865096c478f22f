//! The fit file (JSON): what `fit` writes and `texture` reads.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// A covariance fit. `texture` needs only `model` and `parameters`; everything else may be absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FitFile {
    /// `corrected` or `paper`; empty for a hand-written file.
    pub mode: String,
    /// Covariance model, as `exponential`.
    pub model: String,
    /// Model parameters by name and unit: `sigma_m`, `range_m`, `nugget_m2` ...
    pub parameters: BTreeMap<String, f64>,
    /// True window of the moving average, east-west and north-south, m.
    pub window_m: Option<[f64; 2]>,
    /// What was trimmed.
    pub trim: Option<Trim>,
    /// Cell size east-west and north-south, m.
    pub cell_m: Option<[f64; 2]>,
    /// Mean lag of each bin, m.
    pub lags_m: Vec<f64>,
    /// Empirical covariance of each bin, m2.
    pub covariance_m2: Vec<f64>,
    /// Pairs in each bin.
    pub pairs: Vec<u64>,
    /// Fitted model in each bin as the estimator sees it, m2.
    pub model_m2: Vec<f64>,
    /// Fitted model in each bin before detrending and trimming, m2.
    pub surface_model_m2: Vec<f64>,
    /// Named figures about the fit.
    pub diagnostics: BTreeMap<String, Value>,
    /// Sentences a reader must know.
    pub warnings: Vec<String>,
    /// Where the DEM came from.
    pub source: Option<Source>,
}

/// Trimming of residuals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trim {
    /// Two-sided significance level in (0, 0.5); 0 when nothing was trimmed.
    pub level: f64,
    /// Residuals beyond this absolute value were dropped, m.
    pub threshold_m: f64,
    /// Share of the DEM's cells that did not enter the covariance (no data, border, outliers, trimmed).
    pub masked_share: f64,
}

/// The DEM a fit was made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Window of the DEM `[x0, y0, x1, y1]` in its own coordinates, when one was asked for.
    pub window: Option<[f64; 4]>,
}
