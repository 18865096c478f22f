//! Converts a fit to a file and to table rows.

use super::coregistration;
use crate::job::JobError;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::{Candidate, DirectionBin, FitFile, Intervals, NoiseReference, Source};
use sastrugi_schemas::kind::read_parameters;
use sastrugi_schemas::tables::{CandidateCurveRow, CandidateRow, CovarianceRow, FitRow, LikelihoodProfileRow};
use sastrugi_texture::noise::ReferenceNoise;
use serde_json::json;

/// The fit of a DEM with its source, and a warning if co-registration failed.
pub fn with_source(fit: FitFile, source: Source) -> FitFile {
    let warning = source.minus.as_ref().and_then(|m| coregistration::warning(&m.coregistration));
    let warnings = warning.into_iter().chain(fit.warnings).collect();
    FitFile { source: Some(source), warnings, ..fit }
}

/// The entry of a noise reference in the fit file.
pub fn noise_reference(file: &str, sha256: &str, found: &ReferenceNoise) -> NoiseReference {
    NoiseReference {
        file: file.to_owned(),
        sha256: sha256.to_owned(),
        sigma_m: found.noise.white_sigma_m,
        correlated_sigma_m: found.noise.correlated_sigma_m,
        correlated_range_m: found.noise.correlated_range_m,
        unresolved_to_m: found.unresolved_to_m,
        differences: found.differences,
    }
}

/// A noise reference cannot be combined with `minus`: it contains the noise of one DEM, not that of a difference.
///
/// # Errors
/// When both are given.
pub fn check_noise_reference(reference: bool, minus: bool) -> Result<(), ParameterError> {
    let message =
        "cannot be combined with `minus`: a difference does not have the noise of one DEM; give noise_sigma_m instead";
    if reference && minus { Err(ParameterError::new("noise_reference", message)) } else { Ok(()) }
}

/// The text of a fit file.
///
/// # Errors
/// When a number cannot be written as JSON (a bug).
pub fn to_json(fit: &FitFile) -> Result<String, JobError> {
    serde_json::to_string_pretty(fit).map(|text| text + "\n").map_err(JobError::new)
}

/// Reads the text of a fit file. Only `model` and `parameters` are required.
///
/// # Errors
/// What is wrong with it, in one sentence.
///
/// ```
/// use sastrugi_stages::operations::fits::of_json;
///
/// let fit = of_json(br#"{ "model": "exponential", "parameters": { "sigma_m": 0.03, "range_m": 0.28 } }"#).unwrap();
/// assert_eq!(fit.parameters["range_m"], 0.28);
/// let wrong = of_json(br#"{ "model": "exponential", "parameters": { "sigma_m": "3 cm" } }"#);
/// assert_eq!(wrong.unwrap_err(), "`parameters.sigma_m` must be a number, got \"3 cm\"");
/// ```
pub fn of_json(text: &[u8]) -> Result<FitFile, String> {
    let value = serde_json::from_slice(text).map_err(|e| format!("it is not valid JSON: {e}"))?;
    let fit: FitFile = read_parameters(&value).map_err(|e| e.to_string())?;
    if fit.model.is_empty() || fit.parameters.is_empty() {
        return Err("`model` and `parameters` are required".to_owned());
    }
    Ok(fit)
}

/// A fit as a row of the table `fits`.
///
/// ```
/// use sastrugi_schemas::fit::FitFile;
/// use sastrugi_stages::operations::fits::fit_row;
///
/// let parameters = [("sigma_m".to_owned(), 2.0), ("range_m".to_owned(), 8.0)].into();
/// let fit = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
/// let row = fit_row("snow", "site", &fit);
/// assert_eq!((row.sigma_m, row.range_m, row.sigma2_over_range_m), (2.0, 8.0, 0.5));
/// // What the fit does not have is NaN, except for defaults: no nugget, no anisotropy.
/// assert!(row.hurst.is_nan());
/// assert_eq!((row.nugget_m2, row.ratio), (0.0, 1.0));
/// ```
pub fn fit_row(id: &str, dem_id: &str, fit: &FitFile) -> FitRow {
    let parameter = |name: &str| fit.parameters.get(name).copied().unwrap_or(f64::NAN);
    let window = fit.window_m.unwrap_or([f64::NAN; 2]);
    // A sum of terms has no single sigma and b.
    let single = !fit.parameters.contains_key("sigma_2_m");
    let of_one = |name: &str| if single { parameter(name) } else { f64::NAN };
    let (sigma, range) = (of_one("sigma_m"), of_one("range_m"));
    let or = |name: &str, otherwise: f64| fit.parameters.get(name).copied().unwrap_or(otherwise);
    let found = &fit.diagnostics;
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let setting = |name: &str| fit.settings[name].as_f64().unwrap_or(f64::NAN);
    let ends = |intervals: &Option<Intervals>, name: &str| {
        let [low, high] = intervals.as_ref().and_then(|i| i.values.get(name).copied())?;
        // All these parameters are positive.
        Some([low.unwrap_or(0.0), high.unwrap_or(f64::INFINITY)])
    };
    let own = |name: &str| ends(&fit.intervals, name).unwrap_or([f64::NAN; 2]);
    let block = |name: &str| ends(&fit.block_intervals, name).unwrap_or([f64::NAN; 2]);
    let replicates = |intervals: &Option<Intervals>| intervals.as_ref().map_or(0, |i| i64::from(i.replicates));
    FitRow {
        fit_id: id.to_owned(),
        dem_id: dem_id.to_owned(),
        mode: fit.mode.clone(),
        model: fit.model.clone(),
        sigma_m: sigma,
        range_m: range,
        nugget_m2: or("nugget_m2", 0.0),
        sigma2_over_range_m: sigma * sigma / range,
        window_x_m: window[0],
        window_y_m: window[1],
        trim_level: fit.trim.map_or(0.0, |t| t.level),
        trim_threshold_m: fit.trim.map_or(f64::NAN, |t| t.threshold_m),
        used_share: fit.trim.map_or(f64::NAN, |t| 1.0 - t.masked_share),
        misfit_m2: misfit(fit),
        ratio: or("ratio", 1.0),
        azimuth_deg: or("azimuth_deg", f64::NAN),
        interval_level: fit.intervals.as_ref().map_or(f64::NAN, |i| i.level),
        replicates: replicates(&fit.intervals),
        sigma_low_m: own("sigma_m")[0],
        sigma_high_m: own("sigma_m")[1],
        range_low_m: own("range_m")[0],
        range_high_m: own("range_m")[1],
        sigma2_over_range_low_m: own("sigma2_over_range_m")[0],
        sigma2_over_range_high_m: own("sigma2_over_range_m")[1],
        block_replicates: replicates(&fit.block_intervals),
        block_sigma_low_m: block("sigma_m")[0],
        block_sigma_high_m: block("sigma_m")[1],
        block_range_low_m: block("range_m")[0],
        block_range_high_m: block("range_m")[1],
        block_sigma2_over_range_low_m: block("sigma2_over_range_m")[0],
        block_sigma2_over_range_high_m: block("sigma2_over_range_m")[1],
        misfit_chi2_per_freedom: known(found.misfit_chi2_per_freedom),
        misfit_p: known(found.misfit_p),
        isotropy_p: known(found.isotropy_p),
        isotropy_ratio: known(found.isotropy_ratio),
        isotropy_azimuth_deg: known(found.isotropy_azimuth_deg),
        stationarity_p: known(found.stationarity_p),
        block_sigma_max_over_min: known(found.block_sigma_max_over_min),
        normality_p: known(found.normality_p),
        window_disagreement_z: known(found.window_disagreement_z),
        naive_sigma_m: known(found.naive_sigma_m),
        naive_range_m: known(found.naive_range_m),
        band_rms_m: known(found.band_rms_m),
        increment_1m_m: known(found.increment_1m_m),
        hurst: known(found.hurst),
        noise_sigma_m: setting("noise_sigma_m"),
        correlated_noise_sigma_m: setting("correlated_noise_sigma_m"),
        correlated_noise_range_m: setting("correlated_noise_range_m"),
        effective_resolution_m: known(found.effective_resolution_m),
        warnings: fit.warnings.join("; "),
    }
}

/// Root mean square difference between bins and model.
fn misfit(fit: &FitFile) -> f64 {
    let squares: Vec<f64> =
        fit.covariance_m2.iter().zip(&fit.model_m2).map(|(c, m)| (c - m) * (c - m)).filter(|s| s.is_finite()).collect();
    sastrugi_numeric::sums::mean(&squares).sqrt()
}

/// Rows of the rings, then of the sectors.
pub fn covariance_rows(id: &str, fit: &FitFile, band: &[[f64; 2]]) -> Vec<CovarianceRow> {
    let at = |values: &[f64], bin: usize| values.get(bin).copied().unwrap_or(f64::NAN);
    let rings = fit.lags_m.len();
    let ring = |bin: usize| {
        let [low, high] = band.get(bin).copied().unwrap_or([f64::NAN; 2]);
        CovarianceRow {
            fit_id: id.to_owned(),
            bin: bin as i64,
            lag_m: at(&fit.lags_m, bin),
            azimuth_deg: None,
            covariance_m2: at(&fit.covariance_m2, bin),
            pairs: fit.pairs.get(bin).map_or(0, |&n| n as i64),
            model_m2: at(&fit.model_m2, bin),
            surface_model_m2: at(&fit.surface_model_m2, bin),
            covariance_low_m2: low,
            covariance_high_m2: high,
        }
    };
    let sector = |(k, bin): (usize, &DirectionBin)| CovarianceRow {
        fit_id: id.to_owned(),
        bin: (rings + k) as i64,
        lag_m: bin.lag_m,
        azimuth_deg: Some(bin.azimuth_deg),
        covariance_m2: bin.covariance_m2,
        pairs: bin.pairs as i64,
        model_m2: bin.model_m2,
        surface_model_m2: f64::NAN,
        covariance_low_m2: f64::NAN,
        covariance_high_m2: f64::NAN,
    };
    (0..rings).map(ring).chain(fit.directions.iter().enumerate().map(sector)).collect()
}

/// Rows of the candidate models, best first.
pub fn candidate_rows(id: &str, fit: &FitFile) -> Vec<CandidateRow> {
    let row = |(rank, c): (i64, &Candidate)| CandidateRow {
        fit_id: id.to_owned(),
        rank,
        model: c.model.clone(),
        parameters: json!(c.parameters).to_string(),
        free: i64::from(c.free),
        chi2: c.chi2,
        aicc_above_best: c.aicc_above_best,
    };
    (1..).zip(&fit.candidates).map(row).collect()
}

/// Rows of the candidates' covariance curves.
pub fn curve_rows(id: &str, fit: &FitFile) -> Vec<CandidateCurveRow> {
    let of_curve = |(rank, candidate): (i64, &Candidate)| {
        let row = |(bin, (&lag_m, &model_m2)): (i64, (&f64, &f64))| CandidateCurveRow {
            fit_id: id.to_owned(),
            rank,
            bin,
            lag_m,
            model_m2,
        };
        (0..).zip(fit.lags_m.iter().zip(&candidate.model_m2)).map(row).collect::<Vec<_>>()
    };
    (1..).zip(&fit.candidates).flat_map(of_curve).collect()
}

/// Rows of the likelihood profile along the range.
pub fn profile_rows(id: &str, fit: &FitFile) -> Vec<LikelihoodProfileRow> {
    let row = |(point, (&range_m, &chi2_rise)): (i64, (&f64, &f64))| LikelihoodProfileRow {
        fit_id: id.to_owned(),
        point,
        range_m,
        chi2_rise,
    };
    fit.profile.iter().flat_map(|p| (0..).zip(p.range_m.iter().zip(&p.chi2_rise)).map(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::fit::{Profile, Trim};
    use std::collections::BTreeMap;

    fn parameters(all: &[(&str, f64)]) -> BTreeMap<String, f64> {
        all.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
    }

    fn fit() -> FitFile {
        let values = [("sigma_m".to_owned(), [None, Some(2.5)]), ("range_m".to_owned(), [Some(3.0), None])].into();
        let intervals = Intervals { level: 0.95, replicates: 99, from_profile: false, values };
        FitFile {
            model: "exponential".to_owned(),
            parameters: parameters(&[("sigma_m", 2.0), ("range_m", 4.0), ("nugget_m2", 0.1)]),
            window_m: Some([10.0, 12.0]),
            trim: Some(Trim { level: 0.01, threshold_m: 6.0, masked_share: 0.25 }),
            lags_m: vec![0.0, 1.0, 2.0],
            covariance_m2: vec![4.0, 3.0, f64::NAN],
            pairs: vec![100, 90, 0],
            model_m2: vec![4.5, 1.0, 1.0],
            surface_model_m2: vec![5.0],
            intervals: Some(intervals),
            settings: json!({ "noise_sigma_m": 0.02 }),
            warnings: vec!["first".to_owned(), "second".to_owned()],
            ..FitFile::default()
        }
    }

    /// An open end of an interval is 0 or infinity; without an interval, both are NaN.
    #[test]
    fn val_a_row_of_fits() {
        let row = fit_row("f", "d", &fit());
        assert_eq!((row.fit_id.as_str(), row.dem_id.as_str(), row.model.as_str()), ("f", "d", "exponential"));
        assert_eq!((row.sigma_m, row.range_m, row.sigma2_over_range_m, row.nugget_m2), (2.0, 4.0, 1.0, 0.1));
        assert_eq!((row.window_x_m, row.window_y_m), (10.0, 12.0));
        assert_eq!((row.trim_level, row.trim_threshold_m, row.used_share), (0.01, 6.0, 0.75));
        assert_eq!((row.interval_level, row.replicates), (0.95, 99));
        assert_eq!((row.sigma_low_m, row.sigma_high_m), (0.0, 2.5));
        assert_eq!((row.range_low_m, row.range_high_m), (3.0, f64::INFINITY));
        assert!(row.sigma2_over_range_low_m.is_nan() && row.block_range_low_m.is_nan());
        assert_eq!((row.block_replicates, row.noise_sigma_m, row.warnings.as_str()), (0, 0.02, "first; second"));
        // Differences of 0.5 and 2 m2 in the two bins with a covariance: the root of 4.25 / 2.
        assert!((row.misfit_m2 - 2.125_f64.sqrt()).abs() < 1e-15, "{}", row.misfit_m2);
    }

    /// A sum of terms has no single sigma and range.
    #[test]
    fn val_a_sum_of_terms_has_no_single_sigma() {
        let terms = parameters(&[("sigma_m", 2.0), ("range_m", 4.0), ("sigma_2_m", 1.0), ("range_2_m", 40.0)]);
        let row = fit_row("f", "d", &FitFile { parameters: terms, ..FitFile::default() });
        assert!(row.sigma_m.is_nan() && row.range_m.is_nan() && row.sigma2_over_range_m.is_nan());
        assert!(row.trim_level == 0.0 && row.used_share.is_nan() && row.misfit_m2.is_nan());
    }

    /// Rings come first; sectors continue their numbers.
    #[test]
    fn val_rows_of_rings_and_sectors() {
        let sector = DirectionBin { lag_m: 1.5, azimuth_deg: 45.0, covariance_m2: 2.0, pairs: 7, model_m2: 1.9 };
        let fit = FitFile { directions: vec![sector, DirectionBin { azimuth_deg: 90.0, ..sector }], ..fit() };
        let rows = covariance_rows("f", &fit, &[[3.0, 5.0]]);
        assert_eq!(rows.iter().map(|row| row.bin).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_eq!(rows.iter().map(|row| row.lag_m).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 1.5, 1.5]);
        let azimuths: Vec<Option<f64>> = rows.iter().map(|row| row.azimuth_deg).collect();
        assert_eq!(azimuths, [None, None, None, Some(45.0), Some(90.0)]);
        assert_eq!(rows.iter().map(|row| row.pairs).collect::<Vec<_>>(), [100, 90, 0, 7, 7]);
        let first = &rows[0];
        assert_eq!((first.covariance_low_m2, first.covariance_high_m2, first.surface_model_m2), (3.0, 5.0, 5.0));
        assert!(rows[1].covariance_low_m2.is_nan() && rows[1].surface_model_m2.is_nan());
    }

    /// Candidates are ranked from 1, their bins and the points of a profile from 0.
    #[test]
    fn val_rows_of_candidates_and_profile() {
        let candidate = |model: &str, model_m2: Vec<f64>| Candidate {
            model: model.to_owned(),
            parameters: parameters(&[("sigma_m", 1.0)]),
            free: 2,
            chi2: Some(3.0),
            aicc_above_best: None,
            model_m2,
        };
        let candidates = vec![candidate("exponential", vec![4.0, 2.0, 1.0]), candidate("gaussian", Vec::new())];
        let profile = Some(Profile { range_m: vec![1.0, 2.0], chi2_rise: vec![0.5, 0.0] });
        let fit = FitFile { candidates, profile, ..fit() };
        let ranks: Vec<(i64, String, String)> =
            candidate_rows("f", &fit).into_iter().map(|row| (row.rank, row.model, row.parameters)).collect();
        let parameters = "{\"sigma_m\":1.0}".to_owned();
        let expected = [(1, "exponential".to_owned(), parameters.clone()), (2, "gaussian".to_owned(), parameters)];
        assert_eq!(ranks, expected);
        let curve: Vec<(i64, i64, f64, f64)> =
            curve_rows("f", &fit).iter().map(|row| (row.rank, row.bin, row.lag_m, row.model_m2)).collect();
        assert_eq!(curve, [(1, 0, 0.0, 4.0), (1, 1, 1.0, 2.0), (1, 2, 2.0, 1.0)]);
        let points: Vec<(i64, f64, f64)> =
            profile_rows("f", &fit).iter().map(|row| (row.point, row.range_m, row.chi2_rise)).collect();
        assert_eq!(points, [(0, 1.0, 0.5), (1, 2.0, 0.0)]);
    }

    #[test]
    fn val_a_noise_reference_excludes_a_difference() {
        for (reference, minus) in [(true, false), (false, true), (false, false)] {
            assert_eq!(check_noise_reference(reference, minus), Ok(()));
        }
        let error = check_noise_reference(true, true).unwrap_err().to_string();
        assert!(error.contains("cannot be combined with `minus`"), "{error}");
    }
}
