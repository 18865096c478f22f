//! The fit file (JSON), written by `fit` and read by `texture`.

use crate::coregistration::Minus;
use crate::statistics::Statistics;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// A covariance fit. `texture` requires only `model` and `parameters`; everything else may be absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FitFile {
    /// `corrected` or `paper`; empty for a hand-written file.
    pub mode: String,
    /// Covariance model, such as `exponential`.
    pub model: String,
    /// Model parameters by name and unit: `sigma_m`, `range_m`, `nugget_m2` ...
    pub parameters: BTreeMap<String, f64>,
    /// True window of the moving average, east-west and north-south, m.
    pub window_m: Option<[f64; 2]>,
    /// Trimming.
    pub trim: Option<Trim>,
    /// Cell size east-west and north-south, m.
    pub cell_m: Option<[f64; 2]>,
    /// Mean lag of each bin, m.
    pub lags_m: Vec<f64>,
    /// Empirical covariance of each bin, m2.
    pub covariance_m2: Vec<f64>,
    /// Pairs in each bin.
    pub pairs: Vec<u64>,
    /// Fitted model in each bin including the bias of detrending and trimming, comparable with the empirical covariance, m2.
    pub model_m2: Vec<f64>,
    /// Fitted model in each bin before detrending and trimming, m2.
    pub surface_model_m2: Vec<f64>,
    /// Diagnostics.
    pub diagnostics: Diagnostics,
    /// 95 % intervals by parametric bootstrap; absent if not requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals: Option<Intervals>,
    /// The same by block bootstrap, if the DEM has enough blocks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub block_intervals: Option<Intervals>,
    /// The measured covariance by lag, if `model` is `empirical`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<CovarianceMap>,
    /// Shares of the residual that a texture from this fit reproduces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub carried: Option<Carried>,
    /// All candidate models, the best first.
    pub candidates: Vec<Candidate>,
    /// Profile likelihood along the range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile: Option<Profile>,
    /// Covariance by direction.
    pub directions: Vec<DirectionBin>,
    /// Quantiles of the residual at equally spaced probabilities from 0 to 1, m.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub height_quantiles_m: Vec<f64>,
    /// Statistics of the residual beyond its covariance, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistics: Option<Box<Statistics>>,
    /// The model as arguments of GSTools' classes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gstools: Option<GsTools>,
    /// The verdict, in one or two sentences: what describes the surface at this scale, what may be published, what a texture from the fit can be used for.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub verdict: String,
    /// Warnings about the fit, the most important first.
    pub warnings: Vec<String>,
    /// All parameters of the fit, as in a study; absent in a hand-written file.
    #[serde(skip_serializing_if = "Value::is_null")]
    pub settings: Value,
    /// Origin of the DEM.
    pub source: Option<Source>,
}

impl FitFile {
    /// Level of the tests below which parametric intervals are not trusted.
    const TEST_LEVEL: f64 = 0.01;
    /// RMS misfit of the bins over the variance, above which the model is rejected regardless of the test.
    const MISFIT_MAX: f64 = 0.05;

    /// The intervals to quote, and their kind: those by block bootstrap, if available and the model misfits or the site is not stationary.
    pub fn quoted_intervals(&self) -> Option<(&Intervals, &'static str)> {
        let blocks = self.block_intervals.as_ref();
        match (&self.intervals, blocks) {
            (Some(_), Some(blocks)) if self.misfits() => Some((blocks, "block bootstrap, because the model misfits")),
            (Some(_), Some(blocks)) if Self::rejects(self.diagnostics.stationarity_p) => {
                Some((blocks, "block bootstrap, because the site is not stationary"))
            }
            (Some(own), _) if own.from_profile => Some((own, "profile likelihood")),
            (Some(own), _) => Some((own, "parametric bootstrap")),
            (None, Some(blocks)) => Some((blocks, "block bootstrap")),
            (None, None) => None,
        }
    }

    /// Whether the model misfits the data.
    fn misfits(&self) -> bool {
        let variance_m2 = self.covariance_m2.first().copied().unwrap_or(f64::NAN);
        let misfit_m2 = self.diagnostics.misfit_m2.unwrap_or(f64::NAN);
        Self::rejects(self.diagnostics.misfit_p) || misfit_m2 > Self::MISFIT_MAX * variance_m2
    }

    fn rejects(p: Option<f64>) -> bool {
        p.is_some_and(|p| p <= Self::TEST_LEVEL)
    }

    /// A parameter, or `sigma2_over_range_m` (sigma^2 / b, m) for models that have it; `None` if the fit lacks it.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        match name {
            SILL_OVER_RANGE => self.diagnostics.sigma2_over_range_m,
            _ => self.parameters.get(name).copied(),
        }
    }

    /// A parameter as it should be quoted, with the interval of [`Self::quoted_intervals`]; `None` if the fit lacks it.
    ///
    /// ```
    /// use sastrugi_schemas::fit::{FitFile, Quoted};
    ///
    /// let text = r#"{"model": "exponential", "parameters": {"sigma_m": 0.03, "range_m": 0.28},
    ///     "intervals": {"level": 0.95, "replicates": 99, "range_m": [0.25, 0.33]}}"#;
    /// let fit: FitFile = serde_json::from_str(text).unwrap();
    /// let interval = Some([Some(0.25), Some(0.33)]);
    /// assert_eq!(fit.quoted("range_m"), Some(Quoted::Estimate { value: 0.28, interval }));
    /// assert_eq!(fit.quoted("nugget_m2"), None);
    /// ```
    pub fn quoted(&self, name: &str) -> Option<Quoted> {
        let value = self.parameter(name)?;
        let interval = self.quoted_intervals().and_then(|(intervals, _)| intervals.values.get(name).copied());
        let bounded = self.range_at_bound() && ["sigma_m", "range_m"].contains(&name);
        Some(match (bounded, interval) {
            (false, interval) => Quoted::Estimate { value, interval },
            (true, Some([Some(low), _])) => Quoted::AtLeast(low),
            (true, _) => Quoted::NotIdentified { ended: value },
        })
    }

    /// Whether the search for the range ended at its bound: range and sigma are then not estimates, only their lower limits are known.
    pub fn range_at_bound(&self) -> bool {
        self.diagnostics.range_at_search_bound
    }
}

/// Diagnostics of a fit. A value is absent if it was not computed or is undefined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Diagnostics {
    /// Root mean square height of the residual that was used, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band_rms_m: Option<f64>,
    /// Largest over smallest sigma of the blocks of the DEM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub block_sigma_max_over_min: Option<f64>,
    /// Rise of the sum of squares at three times the range, over the misfit of the fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chi2_rise_at_3b: Option<f64>,
    /// Shortest lag at which the texture can be distinguished from the noise, m; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effective_resolution_m: Option<f64>,
    /// Hurst exponent of the self-affine model, if fits at other windows disagree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hurst: Option<f64>,
    /// Its root mean square increment over 1 m, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub increment_1m_m: Option<f64>,
    /// Direction of the longest range, degrees clockwise from north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isotropy_azimuth_deg: Option<f64>,
    /// P-value of the test of isotropy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isotropy_p: Option<f64>,
    /// Shortest range over the longest one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isotropy_ratio: Option<f64>,
    /// Steps of the search.
    #[serde(deserialize_with = "whole", skip_serializing_if = "Option::is_none")]
    pub iterations: Option<u64>,
    /// Longest lag of the bins, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag_max_m: Option<f64>,
    /// Minimum share of cells with data in a window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_valid_share: Option<f64>,
    /// Generalised sum of squares per degree of freedom.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misfit_chi2_per_freedom: Option<f64>,
    /// Root mean square difference between bins and model, m2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misfit_m2: Option<f64>,
    /// P-value of the test of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misfit_p: Option<f64>,
    /// Range of the fit without correction for detrending and trimming, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub naive_range_m: Option<f64>,
    /// Naive range over the window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub naive_range_windows: Option<f64>,
    /// Standard deviation of the fit without correction, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub naive_sigma_m: Option<f64>,
    /// Share of cells without data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_data_share: Option<f64>,
    /// P-value of the test of normally distributed heights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normality_p: Option<f64>,
    /// Share of cells rejected as objects.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object_share: Option<f64>,
    /// Fits at half and twice the outer scale.
    #[serde(deserialize_with = "or_default", skip_serializing_if = "Vec::is_empty")]
    pub other_windows: Vec<OtherWindow>,
    /// Whether the search for the range ended at its bound.
    #[serde(deserialize_with = "or_default")]
    pub range_at_search_bound: bool,
    /// sigma^2 / b, m, of models that are linear in the lag near zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma2_over_range_m: Option<f64>,
    /// Largest over smallest sigma^2 / b of all windows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma2_over_range_spread: Option<f64>,
    /// P-value of the test of a stationary site.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stationarity_p: Option<f64>,
    /// Share of cells that were trimmed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trimmed_share: Option<f64>,
    /// Window of the background in cells, east-west and north-south.
    #[serde(deserialize_with = "two_whole", skip_serializing_if = "Option::is_none")]
    pub window_cells: Option<[usize; 2]>,
    /// Largest disagreement of fits at other windows, standard errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_disagreement_z: Option<f64>,
    /// Share of cells whose window contains too few data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_lacks_data_share: Option<f64>,
}

/// Reads `null` as the default: files may be written by hand, or by programs that cannot omit a key.
fn or_default<'de, T: Default + Deserialize<'de>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Ok(Option::deserialize(value)?.unwrap_or_default())
}

/// A count, also if written as a float.
fn whole<'de, D: Deserializer<'de>>(value: D) -> Result<Option<u64>, D::Error> {
    Ok(Option::<f64>::deserialize(value)?.map(|count| count as u64))
}

fn two_whole<'de, D: Deserializer<'de>>(value: D) -> Result<Option<[usize; 2]>, D::Error> {
    Ok(Option::<[f64; 2]>::deserialize(value)?.map(|counts| counts.map(|count| count as usize)))
}

/// A fit of the same DEM at another window.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OtherWindow {
    /// Longest wavelength left in the residual, m.
    pub outer_scale_m: Option<f64>,
    /// Fitted parameters.
    pub parameters: BTreeMap<String, Option<f64>>,
    /// Generalised sum of squares per degree of freedom.
    pub misfit_chi2_per_freedom: Option<f64>,
    /// Root mean square height of the residual on the cells common to all windows, m.
    pub band_rms_m: Option<f64>,
}

/// Name of sigma^2 / b in intervals.
pub const SILL_OVER_RANGE: &str = "sigma2_over_range_m";

/// A quoted parameter of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quoted {
    /// An estimate with its interval, if any; an end is `None` if the interval is open there.
    Estimate {
        /// The estimate.
        value: f64,
        /// Lower and upper end.
        interval: Option<[Option<f64>; 2]>,
    },
    /// The search for the range ended at its bound: only the lower end of the interval is known.
    AtLeast(f64),
    /// The search ended at its bound, and the interval has no lower end.
    NotIdentified {
        /// Value where the search ended.
        ended: f64,
    },
}

/// Measured covariance by lag, for a fit with `model` `empirical`; lags are in cells of `cell_m`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CovarianceMap {
    /// What it describes: `residual` (heights minus their background over `window_m`, before trimming) or `surface`.
    pub base: String,
    /// Covariance model, with the file's `parameters`, that extends it to wavelengths removed with the background.
    pub model: String,
    /// Largest lag north-south and east-west, cells.
    pub max_lag: [usize; 2],
    /// Covariance in m2 at lags of 0 to `max_lag[0]` rows southwards (outer) and -`max_lag[1]` to `max_lag[1]` columns eastwards (inner).
    pub covariance_m2: Vec<f64>,
}

/// Expected shares of the measured residual in a texture that is detrended and trimmed like the DEM.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Carried {
    /// RMS of the texture over that of the residual, both trimmed.
    pub rms_share: f64,
    /// The square of that.
    pub variance_share: f64,
    /// As `rms_share`, but before trimming, so including the tails.
    pub untrimmed_rms_share: f64,
    /// Mean square increments over those of the residual, by octave of lag.
    pub increments: Vec<CarriedOctave>,
}

/// An octave of lags.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CarriedOctave {
    /// Shortest lag, m.
    pub from_m: f64,
    /// Longest lag, m.
    pub to_m: f64,
    /// Mean square increment of the texture over that of the residual.
    pub share: f64,
}

/// Trimming of residuals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trim {
    /// Two-sided significance level in (0, 0.5); 0 if nothing was trimmed.
    pub level: f64,
    /// Residuals beyond this absolute value were dropped, m.
    pub threshold_m: f64,
    /// Share of the DEM's cells excluded from the covariance (no data, border, objects, trimmed).
    pub masked_share: f64,
}

/// The DEM of a fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Window of the DEM `[x0, y0, x1, y1]` in its own coordinates, if given.
    pub window: Option<[f64; 4]>,
    /// Mask files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub masks: Vec<MaskSource>,
    /// Share of the window's cells with data that the masks excluded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub masked_share: Option<f64>,
    /// The smooth part of the DEM from which its noise was estimated, if given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_reference: Option<NoiseReference>,
    /// The subtracted DEM, if any, and its co-registration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minus: Option<Minus>,
}

/// A mask of a fit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MaskSource {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// True if the marked cells were excluded, false if only they were used.
    pub excludes: bool,
}

/// A smooth part of a DEM, and the noise estimated there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseReference {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Standard deviation of the white noise of a cell, m.
    pub sigma_m: f64,
    /// Standard deviation of spatially correlated noise, m; 0 if none was found.
    #[serde(default)]
    pub correlated_sigma_m: f64,
    /// Lag at which the correlation of that noise falls to 1/e, m; 0 if none was found.
    #[serde(default)]
    pub correlated_range_m: f64,
    /// Longest separation examined, m, if the reference has relief, or noise correlated over more than its width, so that only white
    /// noise was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unresolved_to_m: Option<f64>,
    /// Number of second differences used.
    pub differences: u64,
}

/// Intervals of a fit's parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    /// Level, such as 0.95.
    pub level: f64,
    /// Number of replicates.
    pub replicates: u32,
    /// True if `sigma_m` and `range_m` are by profile likelihood, because it is open at an end, or replicates cannot distinguish the
    /// range from the bound of the search.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub from_profile: bool,
    /// Lower and upper end by the parameter's name; `null` for an open end.
    #[serde(flatten)]
    pub values: BTreeMap<String, [Option<f64>; 2]>,
}

/// A candidate model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Covariance model.
    pub model: String,
    /// Its fitted parameters.
    pub parameters: BTreeMap<String, f64>,
    /// Number of free parameters.
    pub free: u32,
    /// Generalised sum of squares; absent if its weights could not be computed.
    pub chi2: Option<f64>,
    /// Akaike's corrected criterion (AICc) minus the smallest of all candidates.
    pub aicc_above_best: Option<f64>,
    /// The model in each bin, like `model_m2` of the fit, m2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub model_m2: Vec<f64>,
}

/// The generalised sum of squares along the range, with all other parameters refitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Fixed range, m.
    pub range_m: Vec<f64>,
    /// Rise above the minimum; 3.84 is the limit of a 95 % interval.
    pub chi2_rise: Vec<f64>,
}

/// Covariance at one distance in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionBin {
    /// Mean lag, m.
    pub lag_m: f64,
    /// Direction, degrees clockwise from north, in [0, 180).
    pub azimuth_deg: f64,
    /// Empirical covariance, m2.
    pub covariance_m2: f64,
    /// Number of pairs.
    pub pairs: u64,
    /// Fitted model including the bias of detrending and trimming, m2.
    pub model_m2: f64,
}

/// A covariance model as arguments of GSTools: `getattr(gstools, model)(dim=2, var=var, ...)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GsTools {
    /// Class.
    pub model: String,
    /// Variance without nugget, m2.
    pub var: f64,
    /// Length scale along the main axis, m.
    pub len_scale: f64,
    /// Nugget, m2.
    pub nugget: f64,
    /// Length across over length along.
    pub anis: f64,
    /// Main axis, rad counter-clockwise from east.
    pub angles: f64,
    /// Other arguments: `rescale`, `nu`.
    #[serde(flatten)]
    pub more: BTreeMap<String, f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files with absent keys, nulls, counts as floats, and unknown keys can be read.
    #[test]
    fn val_diagnostics_of_other_programs_are_read() {
        let text = r#"{ "model": "exponential", "parameters": { "sigma_m": 1.0 }, "diagnostics": { "iterations": 12.0, "misfit_p": null,
            "window_cells": [9.0, 11.0], "range_at_search_bound": null, "hurst": 0.5, "no such": [1],
            "other_windows": [{ "outer_scale_m": 1.0, "band_rms_m": null, "parameters": { "range_m": null } }, {}] } }"#;
        let found = serde_json::from_str::<FitFile>(text).unwrap().diagnostics;
        assert_eq!((found.iterations, found.window_cells, found.hurst), (Some(12), Some([9, 11]), Some(0.5)));
        assert_eq!((found.misfit_p, found.range_at_search_bound, found.other_windows.len()), (None, false, 2));
        let again: Diagnostics = serde_json::from_str(&serde_json::to_string(&found).unwrap()).unwrap();
        assert_eq!(again, found);
    }

    /// Which intervals are quoted: those by blocks where the model or the site is rejected, at the level and beyond.
    #[test]
    fn val_intervals_to_quote() {
        let open = [None, None];
        let kind = |fit: &FitFile| fit.quoted_intervals().map(|(_, kind)| kind.split(',').next().unwrap_or_default());
        let fit = FitFile { intervals: intervals(open, false), ..FitFile::default() };
        assert_eq!(kind(&FitFile::default()), None);
        assert_eq!(kind(&fit), Some("parametric bootstrap"));
        assert_eq!(
            kind(&FitFile { intervals: intervals(open, true), ..FitFile::default() }),
            Some("profile likelihood")
        );
        let blocks = FitFile { block_intervals: intervals(open, false), ..FitFile::default() };
        assert_eq!(kind(&blocks), Some("block bootstrap"));
        let both = FitFile { block_intervals: intervals(open, false), covariance_m2: vec![2.0, 1.0], ..fit.clone() };
        let with = |diagnostics: Diagnostics| FitFile { diagnostics, ..both.clone() };
        let plain = Diagnostics::default;
        // The level of the tests is 0.01; a misfit counts from 5 % of the variance.
        for (diagnostics, by_blocks) in [
            (plain(), false),
            (Diagnostics { misfit_p: Some(0.01), ..plain() }, true),
            (Diagnostics { misfit_p: Some(0.011), ..plain() }, false),
            (Diagnostics { stationarity_p: Some(0.01), ..plain() }, true),
            (Diagnostics { stationarity_p: Some(0.011), ..plain() }, false),
            (Diagnostics { misfit_m2: Some(0.11), ..plain() }, true),
            (Diagnostics { misfit_m2: Some(0.09), ..plain() }, false),
        ] {
            let expected = if by_blocks { "block bootstrap" } else { "parametric bootstrap" };
            assert_eq!(kind(&with(diagnostics.clone())), Some(expected), "{diagnostics:?}");
            // Without blocks there is no choice.
            let alone = FitFile { block_intervals: None, ..with(diagnostics) };
            assert_eq!(kind(&alone), Some("parametric bootstrap"));
        }
    }

    /// A hand-written file needs a model and its parameters; what is absent stays absent when it is written.
    #[test]
    fn val_a_hand_written_fit() {
        let text = r#"{"model": "exponential", "parameters": {"sigma_m": 0.03, "range_m": 0.28}}"#;
        let fit: FitFile = serde_json::from_str(text).unwrap();
        assert_eq!(["sigma_m", "nugget_m2", SILL_OVER_RANGE].map(|name| fit.parameter(name)), [Some(0.03), None, None]);
        assert_eq!(fit.quoted("range_m"), Some(Quoted::Estimate { value: 0.28, interval: None }));
        let written = serde_json::to_value(&fit).unwrap();
        for absent in ["intervals", "block_intervals", "map", "carried", "statistics", "profile", "verdict", "settings"]
        {
            assert!(written.get(absent).is_none(), "{absent}");
        }
        assert_eq!(serde_json::from_value::<FitFile>(written).unwrap(), fit);
    }

    fn intervals(range: [Option<f64>; 2], from_profile: bool) -> Option<Intervals> {
        let values = [("range_m".to_owned(), range), (SILL_OVER_RANGE.to_owned(), [Some(0.001), Some(0.002)])].into();
        Some(Intervals { level: 0.95, replicates: 99, from_profile, values })
    }

    /// At the bound of the search only the lower end of the interval is quoted: that of the profile, unless the model misfits and
    /// there are blocks.
    #[test]
    fn val_a_range_at_the_bound_is_quoted_as_a_limit() {
        let fit = FitFile {
            parameters: [("sigma_m".to_owned(), 1.0), ("range_m".to_owned(), 420.0)].into(),
            intervals: intervals([Some(4.4), None], true),
            block_intervals: intervals([None, None], false),
            diagnostics: Diagnostics {
                range_at_search_bound: true,
                sigma2_over_range_m: Some(1.0 / 420.0),
                ..Diagnostics::default()
            },
            ..FitFile::default()
        };
        assert_eq!(fit.quoted("range_m"), Some(Quoted::AtLeast(4.4)));
        assert_eq!(fit.quoted("sigma_m"), Some(Quoted::NotIdentified { ended: 1.0 }));
        let sill = Quoted::Estimate { value: 1.0 / 420.0, interval: Some([Some(0.001), Some(0.002)]) };
        assert_eq!(fit.quoted(SILL_OVER_RANGE), Some(sill));
        assert_eq!(fit.quoted("nugget_m2"), None);
        let mut misfit = fit.clone();
        misfit.diagnostics.misfit_p = Some(0.001);
        assert_eq!(misfit.quoted("range_m"), Some(Quoted::NotIdentified { ended: 420.0 }));
        let found = FitFile { diagnostics: Diagnostics::default(), ..fit };
        let estimate = Quoted::Estimate { value: 420.0, interval: Some([Some(4.4), None]) };
        assert_eq!(found.quoted("range_m"), Some(estimate));
    }
}
