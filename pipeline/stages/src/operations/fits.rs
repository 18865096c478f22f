//! A fit as a file and as rows.

use super::coregistration;
use crate::job::JobError;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::{Candidate, DirectionBin, FitFile, Intervals, NoiseReference, Source};
use sastrugi_schemas::tables::{CandidateCurveRow, CandidateRow, CovarianceRow, FitRow, LikelihoodProfileRow};
use sastrugi_texture::noise::ReferenceNoise;
use serde_json::json;

/// The fit of a DEM with its source, and a warning where co-registration failed.
pub fn with_source(fit: FitFile, source: Source) -> FitFile {
    let warning = source.minus.as_ref().and_then(|m| coregistration::warning(&m.coregistration));
    let warnings = warning.into_iter().chain(fit.warnings).collect();
    FitFile { source: Some(source), warnings, ..fit }
}

/// A noise reference as the fit file names it.
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

/// A noise reference cannot be combined with `minus`: it holds the noise of one DEM, not that of a difference.
///
/// # Errors
/// When both are given.
pub fn check_noise_reference(reference: bool, minus: bool) -> Result<(), ParameterError> {
    let message = "is given with `minus`: the noise of a difference is not that of one DEM; state noise_sigma_m";
    if reference && minus { Err(ParameterError::new("noise_reference", message)) } else { Ok(()) }
}

/// A fit file's text.
///
/// # Errors
/// When a figure has no JSON form (a bug).
pub fn to_json(fit: &FitFile) -> Result<String, JobError> {
    serde_json::to_string_pretty(fit).map(|text| text + "\n").map_err(JobError::new)
}

/// A fit as a row of the table `fits`.
pub fn fit_row(id: &str, dem_id: &str, fit: &FitFile) -> FitRow {
    let parameter = |name: &str| fit.parameters.get(name).copied().unwrap_or(f64::NAN);
    let window = fit.window_m.unwrap_or([f64::NAN; 2]);
    // A sum of terms has no one sigma and b.
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

/// Rings, then sectors.
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

/// The models tried, the best first.
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

/// Their curves.
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

/// The likelihood along the range.
pub fn profile_rows(id: &str, fit: &FitFile) -> Vec<LikelihoodProfileRow> {
    let row = |(point, (&range_m, &chi2_rise)): (i64, (&f64, &f64))| LikelihoodProfileRow {
        fit_id: id.to_owned(),
        point,
        range_m,
        chi2_rise,
    };
    fit.profile.iter().flat_map(|p| (0..).zip(p.range_m.iter().zip(&p.chi2_rise)).map(row)).collect()
}
