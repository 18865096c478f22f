//! Writes the fit file: parameters, diagnostics, verdict and warnings.

use super::Mode;
use super::case::Case;
use super::estimator::{Estimate, Estimator, difference, on_surface};
use super::profile::LIKELIHOOD_RISE;
use super::resampling::sill_over_range;
use super::verdicts::{Isotropy, REPLICATES_MIN, ScaleExplicit, Stationarity, is_range_identified};
use crate::covariance::form::Role;
use crate::covariance::{Covariance, Form, Structure};
use sastrugi_schemas::fit::{
    Candidate, Carried, Diagnostics, DirectionBin, FitFile, GsTools, Intervals, OtherWindow, Profile, Trim,
};
use std::f64::consts::FRAC_PI_2;

/// Naive range over window above which the true range is not identified (its ceiling for a pure exponential is 0.135).
const NAIVE_RANGE_MAX: f64 = 0.12;
/// Misfit over variance above which the model is rejected whatever the p-value.
const MISFIT_MAX: f64 = 0.05;
/// Share of measured cells flagged as objects that is worth a warning.
const OBJECT_SHARE_MAX: f64 = 0.1;
/// Spread of sigma^2 / b between windows that is worth mentioning.
const SPREAD_WORTH_A_WARNING: f64 = 1.25;
/// Tolerated relative differences of a texture's RMS, and of its increments in any octave, from the residual's.
const CARRIED_TOLERANCES: [f64; 2] = [0.05, 0.15];
/// Significance level of every warning that is based on a test.
const TEST_LEVEL: f64 = 0.01;
/// Ratio of ranges (short over long) below which anisotropy is worth a warning.
const RATIO_WORTH_A_WARNING: f64 = 0.9;
/// Largest over smallest block sigma above which it is worth a warning.
const SIGMAS_WORTH_A_WARNING: f64 = 1.2;

/// Results of the tests and bootstraps that accompany the estimate.
#[derive(Default)]
pub struct Findings {
    pub intervals: Option<Intervals>,
    pub block_intervals: Option<Intervals>,
    pub candidates: Vec<Candidate>,
    /// Models that are not among them, because their covariance is not finite where the search ended.
    pub without_values: Vec<String>,
    pub profile: Option<Profile>,
    /// Largest disagreement of fits at other windows, in standard errors.
    pub disagreement: Option<f64>,
    pub others: Vec<OtherWindow>,
    /// Scale-dependent numbers, if those fits disagree.
    pub scale_explicit: Option<ScaleExplicit>,
    pub isotropy: Option<Isotropy>,
    pub stationarity: Option<Stationarity>,
    pub misfit_p: Option<f64>,
    pub normality_p: Option<f64>,
    /// Largest over smallest sigma^2 / b of all windows.
    pub sill_over_range_spread: Option<f64>,
    /// Parametric replicates. From [`REPLICATES_MIN`] on, p-values are those of the replicates, otherwise of theory.
    pub replicates: usize,
    /// How much of the residual a texture from the fit reproduces.
    pub carried: Option<Carried>,
    pub directions: Vec<DirectionBin>,
}

impl Findings {
    /// Scale-dependent numbers, if no other model has one scale at all windows.
    fn without_scale(&self) -> Option<&ScaleExplicit> {
        self.scale_explicit.as_ref().filter(|explicit| explicit.single_scale.is_none())
    }
}

/// The fit file; `binned` is the model in the rings as the estimator sees it, m2.
pub fn fit_file(case: &Case, naive: &Estimate, estimate: &Estimate, binned: Vec<f64>, findings: &Findings) -> FitFile {
    let summary = Summary::of(case, naive, estimate, &binned);
    let (verdict, warnings) = summary.verdict_and_warnings(case, naive, estimate, findings);
    FitFile {
        mode: case.settings.mode().name().to_owned(),
        model: estimate.form.name().to_owned(),
        parameters: estimate.covariance.parameters(&estimate.form),
        window_m: Some(case.window.size_m(case.geometry.cell)),
        trim: Some(Trim {
            level: case.settings.trim(),
            threshold_m: case.survey.trim.threshold_m,
            masked_share: 1.0 - summary.share(case.survey.kept),
        }),
        cell_m: Some(case.geometry.cell),
        lags_m: case.bins.lag_m.clone(),
        covariance_m2: case.bins.covariance_m2.clone(),
        pairs: case.bins.pairs.clone(),
        model_m2: binned,
        surface_model_m2: on_surface(case, &estimate.covariance),
        diagnostics: summary.diagnostics(case, naive, estimate, findings),
        intervals: findings.intervals.clone(),
        block_intervals: findings.block_intervals.clone(),
        map: None,
        carried: findings.carried.clone(),
        candidates: findings.candidates.clone(),
        profile: findings.profile.clone(),
        directions: findings.directions.clone(),
        gstools: gstools(&estimate.form, &estimate.covariance),
        verdict,
        warnings,
        // A plain struct of numbers and strings always serialises.
        settings: serde_json::to_value(case.settings.parameters()).unwrap_or_default(),
        source: None,
        height_quantiles_m: Vec::new(),
        statistics: None,
    }
}

/// The covariance by direction, and the model as an estimator on bins by direction sees it there.
pub fn directions(estimator: &Estimator, estimate: &Estimate) -> Vec<DirectionBin> {
    let bins = estimator.bins;
    let model = estimator.mean(&estimate.covariance);
    let bin = |k: usize| {
        Some(DirectionBin {
            lag_m: bins.lag_m[k],
            azimuth_deg: bins.azimuth_deg[k]?,
            covariance_m2: bins.covariance_m2[k],
            pairs: bins.pairs[k],
            model_m2: model[k],
        })
    };
    (0..bins.len()).filter_map(bin).collect()
}

/// The model as GSTools parameters; `None` for sums and self-affine surfaces, for which GSTools has no class.
pub fn gstools(form: &Form, covariance: &Covariance) -> Option<GsTools> {
    let [term] = covariance.structures.as_slice() else { return None };
    let (model, len_scale, more) = match form.terms()[0].kind().kind {
        "exponential" => ("Exponential", term.range_m, vec![("rescale", 1.0)]),
        "gaussian" => ("Gaussian", term.range_m, vec![("rescale", 1.0)]),
        "spherical" => ("Spherical", term.range_m, vec![("rescale", 1.0)]),
        // GSTools' argument is sqrt(nu) h / len_scale, and it requires a smoothness of at least 0.2.
        "matern" if term.shape >= 0.2 => {
            ("Matern", term.range_m * term.shape.sqrt(), vec![("rescale", 1.0), ("nu", term.shape)])
        }
        _ => return None,
    };
    Some(GsTools {
        model: model.to_owned(),
        var: covariance.variance_m2(),
        len_scale,
        nugget: covariance.nugget_m2,
        anis: covariance.ratio,
        angles: FRAC_PI_2 - covariance.azimuth_deg.to_radians(),
        more: more.into_iter().map(|(k, v)| (k.to_owned(), v)).collect(),
    })
}

/// Numbers shared by diagnostics and warnings.
struct Summary {
    /// Cells of the DEM.
    cells: usize,
    /// Measured cells that entered the moving average.
    trusted: usize,
    misfit_m2: f64,
    naive_range_windows: f64,
    /// Generalised sum of squares per degree of freedom.
    misfit_ratio: Option<f64>,
}

impl Summary {
    fn of(case: &Case, naive: &Estimate, estimate: &Estimate, binned: &[f64]) -> Self {
        let misfit = difference(&case.bins.covariance_m2, binned);
        Self {
            cells: case.geometry.len(),
            trusted: case.survey.trusted_count,
            misfit_m2: (misfit.iter().map(|d| d * d).sum::<f64>() / misfit.len() as f64).sqrt(),
            naive_range_windows: naive.covariance.range_m() / case.window_m(),
            misfit_ratio: estimate.misfit_ratio(),
        }
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.cells as f64
    }

    fn diagnostics(&self, case: &Case, naive: &Estimate, estimate: &Estimate, findings: &Findings) -> Diagnostics {
        let survey = &case.survey;
        let self_affine = findings.without_scale().and_then(ScaleExplicit::structure);
        let (isotropy, stationarity) = (findings.isotropy.as_ref(), findings.stationarity.as_ref());
        Diagnostics {
            band_rms_m: Some(survey.trim.rms_m),
            block_sigma_max_over_min: stationarity.map(|s| s.sigma_max_over_min),
            chi2_rise_at_3b: self.rise_at_3b(findings),
            effective_resolution_m: resolution_m(case, &estimate.covariance),
            hurst: self_affine.map(|s| s.shape),
            increment_1m_m: self_affine.map(|s| s.sigma_m),
            isotropy_azimuth_deg: isotropy.map(|i| i.azimuth_deg),
            isotropy_p: isotropy.map(|i| i.p),
            isotropy_ratio: isotropy.map(|i| i.ratio),
            iterations: Some(estimate.steps as u64),
            lag_max_m: Some(case.max_lag_m),
            min_valid_share: Some(case.settings.min_valid_share),
            misfit_chi2_per_freedom: self.misfit_ratio,
            misfit_m2: Some(self.misfit_m2),
            misfit_p: findings.misfit_p,
            naive_range_m: Some(naive.covariance.range_m()),
            naive_range_windows: Some(self.naive_range_windows),
            naive_sigma_m: Some(naive.covariance.sigma_m()),
            no_data_share: Some(1.0 - self.share(survey.measured)),
            normality_p: findings.normality_p,
            object_share: Some(self.share(survey.measured - self.trusted)),
            other_windows: findings.others.clone(),
            range_at_search_bound: !is_range_identified(case, estimate),
            sigma2_over_range_m: sill_over_range(&estimate.covariance),
            sigma2_over_range_spread: findings.sill_over_range_spread,
            stationarity_p: stationarity.map(|s| s.p),
            trimmed_share: Some(self.share(survey.detrended - survey.kept)),
            window_cells: Some([case.window.cells()[1], case.window.cells()[0]]),
            window_disagreement_z: findings.disagreement,
            window_lacks_data_share: Some(self.share(self.trusted - survey.detrended)),
        }
    }

    /// Rise of the sum of squares at three times the fitted range, over the misfit per degree of freedom where that exceeds 1.
    fn rise_at_3b(&self, findings: &Findings) -> Option<f64> {
        let profile = findings.profile.as_ref()?;
        let own = profile.range_m.iter().zip(&profile.chi2_rise).min_by(|a, b| a.1.total_cmp(b.1))?.0;
        // Closer than that if the search ends earlier.
        let at = profile.range_m.iter().position(|r| *r > 2.9 * own).unwrap_or(profile.range_m.len() - 1);
        Some(profile.chi2_rise[at] / self.misfit_ratio.unwrap_or(1.0).max(1.0))
    }

    /// One verdict, then warnings, the most consequential first.
    fn verdict_and_warnings(
        &self,
        case: &Case,
        naive: &Estimate,
        estimate: &Estimate,
        findings: &Findings,
    ) -> (String, Vec<String>) {
        if case.settings.mode() == Mode::Paper {
            let verdict = "Published procedure: sigma and b describe the detrended, trimmed residual, not the surface; compare \
                           them only with other results in paper mode.";
            let warning = "paper mode: not corrected for detrending and trimming, which make sigma and b too small (19 % and 42 % for \
                           an exponential of b = 0.14 windows, 43 % and 76 % at half a window)";
            return (verdict.to_owned(), vec![warning.to_owned()]);
        }
        let doubts = Doubts {
            noise: resolution_warning(case, estimate),
            misfit: self.misfit_warning(case, estimate, findings),
            models: comparison_warning(findings),
            scale: separation_warning(findings),
            range: self.range_warning(case, naive, estimate, findings),
            site: stationarity_warning(findings),
            direction: isotropy_warning(estimate, findings),
            heights: normality_warning(findings),
            objects: self.object_warning(case),
        };
        let verdict = doubts.verdict(case, estimate, findings);
        (verdict, doubts.list())
    }

    /// Warns that b is not identified: the search ended at its bound, the likelihood is flat, or the uncorrected range is near the
    /// ceiling that it has for every exponential.
    fn range_warning(&self, case: &Case, naive: &Estimate, estimate: &Estimate, findings: &Findings) -> Option<String> {
        let b = estimate.covariance.structures[0].range_m;
        estimate.coordinate(Role::Range(0))?;
        let moves = findings
            .sill_over_range_spread
            .filter(|spread| *spread > SPREAD_WORTH_A_WARNING)
            .map_or_else(String::new, |spread| {
                format!("; sigma^2 / b varies by a factor of {spread:.2} between windows")
            });
        if !is_range_identified(case, estimate) {
            return Some(format!("b is not identified: the search ended at its bound of {} m{moves}", digits4(b)));
        }
        if self.rise_at_3b(findings).is_some_and(|rise| rise < LIKELIHOOD_RISE) {
            return Some(format!(
                "b is not identified: b = {} m fits as well as {} m{moves}",
                digits4(b),
                digits4(3.0 * b)
            ));
        }
        (self.naive_range_windows > NAIVE_RANGE_MAX && sill_over_range(&estimate.covariance).is_some()).then(|| {
            format!(
                "b is not identified: the uncorrected range of {} m is {:.2} windows, near the ceiling of 0.135 for any exponential{moves}",
                digits4(naive.covariance.range_m()),
                self.naive_range_windows,
            )
        })
    }

    fn misfit_warning(&self, case: &Case, estimate: &Estimate, findings: &Findings) -> Option<String> {
        let misfit = self.misfit_m2 / case.bins.covariance_m2[0];
        let test = findings.misfit_p.map(|p| (p <= TEST_LEVEL, p_value(p, findings.replicates)));
        let (how, intervals) = misfit_words(misfit, test)?;
        let model = estimate.form.name();
        Some(format!("the {model} model does not fit the covariance ({how}); its parametric intervals {intervals}"))
    }

    fn object_warning(&self, case: &Case) -> Option<String> {
        let objects = (case.survey.measured - self.trusted) as f64 / case.survey.measured as f64;
        (objects > OBJECT_SHARE_MAX).then(|| {
            format!(
                "{:.1} % of the cells were left out as objects; on a bare site set find_objects = false \
                 (--set find_objects=false)",
                100.0 * objects
            )
        })
    }
}

/// Which of the two criteria speaks against a model, the RMS misfit over the variance or the test (whether it rejects the model, and its p-value
/// in words), and what that means for parametric intervals; `None` if neither does.
fn misfit_words(misfit: f64, test: Option<(bool, String)>) -> Option<(String, &'static str)> {
    let share = format!("RMS misfit {:.1} % of the variance", 100.0 * misfit);
    let too_narrow = "are too narrow";
    match (misfit > MISFIT_MAX, test) {
        (true, Some((true, p))) => Some((format!("{share}, {p}"), too_narrow)),
        (true, None) => Some((share, too_narrow)),
        (true, Some((false, p))) => {
            let limit = format!("more than {:.0} %", 100.0 * MISFIT_MAX);
            Some((format!("{share}, {limit}; the test does not reject it, {p}"), "may be too narrow"))
        }
        (false, Some((true, p))) => Some((format!("the test rejects it, {p}; {share}"), too_narrow)),
        (false, _) => None,
    }
}

/// Reasons to doubt a fit, as warnings.
struct Doubts {
    noise: Option<String>,
    misfit: Option<String>,
    models: Option<String>,
    scale: Option<String>,
    range: Option<String>,
    site: Option<String>,
    direction: Option<String>,
    heights: Option<String>,
    objects: Option<String>,
}

impl Doubts {
    /// The most consequential first.
    fn list(self) -> Vec<String> {
        let Self { noise, misfit, models, scale, range, site, direction, heights, objects } = self;
        [noise, misfit, models, scale, range, site, direction, heights, objects].into_iter().flatten().collect()
    }

    /// What a reader needs first: what describes the surface at this scale, what can be published, and how much of it a texture
    /// from the fit reproduces. Details are in the warnings and diagnostics.
    fn verdict(&self, case: &Case, estimate: &Estimate, findings: &Findings) -> String {
        let window_m = digits4(case.window_m());
        let rms_m = digits4(case.survey.trim.rms_m);
        let model = estimate.form.name();
        let described = if self.noise.is_some() {
            format!("Mostly noise below {window_m} m: do not publish texture parameters")
        } else if let Some(other) = findings.scale_explicit.as_ref().and_then(|explicit| explicit.single_scale) {
            format!(
                "The {model} model does not fit the covariance below {window_m} m, but another with one scale may: publish band RMS {rms_m} m, \
                 or try model = \"{other}\" (--model {other})"
            )
        } else if self.scale.is_some() {
            let growth = findings
                .without_scale()
                .and_then(ScaleExplicit::structure)
                .map(|s| format!(" and the structure function ({} m at 1 m, H {})", digits4(s.sigma_m), hurst(&s)));
            let growth = growth.unwrap_or_default();
            format!(
                "No single scale below {window_m} m: publish band RMS {rms_m} m{growth}, with the outer scale, not sigma and b (range_m), which \
                 change with it"
            )
        } else if self.misfit.is_some() {
            format!(
                "The {model} model does not fit the covariance below {window_m} m: publish band RMS {rms_m} m, or try model = \"auto\" (--model auto)"
            )
        } else if self.range.is_some() {
            let slope = sill_over_range(&estimate.covariance);
            let slope = slope.map_or_else(String::new, |slope| format!("sigma^2 / b = {} m and ", digits4(slope)));
            format!("b (range_m) is not identified below {window_m} m: publish {slope}band RMS {rms_m} m")
        } else {
            let interval =
                if findings.intervals.is_some() { "with their intervals" } else { "once `bootstrap` gives intervals" };
            format!(
                "The {model} model describes the surface below {window_m} m{}: publish its parameters {interval}",
                self.caveat()
            )
        };
        let carried =
            findings.carried.as_ref().map(|c| carried_sentence(c, can_be_empirical(case))).unwrap_or_default();
        format!("{described}.{carried}")
    }

    /// Notes what holds only on average.
    fn caveat(&self) -> &'static str {
        match (&self.site, &self.direction) {
            (None, None) => "",
            (Some(_), None) => " (averaged over a site that is not stationary)",
            (None, Some(_)) => " (averaged over directions that differ)",
            (Some(_), Some(_)) => " (averaged over a site that is not stationary and over directions that differ)",
        }
    }
}

/// Whether another fit of the same heights could take the measured covariance itself as its model.
fn can_be_empirical(case: &Case) -> bool {
    !case.settings.empirical && !case.heights.are_profiles()
}

/// How much a texture reproduces, as the last sentence of a verdict, with advice where `can_be_empirical`.
fn carried_sentence(carried: &Carried, can_be_empirical: bool) -> String {
    let [of_rms, of_increments] = CARRIED_TOLERANCES;
    let off = |share: f64, tolerance: f64| (share - 1.0).abs() > tolerance;
    let worst = carried.increments.iter().max_by(|a, b| (a.share - 1.0).abs().total_cmp(&(b.share - 1.0).abs()));
    let worst = worst.filter(|o| off(o.share, of_increments));
    let octave = worst.map_or_else(String::new, |o| {
        format!(", {:.0} % of its squared increments at {}-{} m", 100.0 * o.share, digits2(o.from_m), digits2(o.to_m))
    });
    let better = match (worst.is_some(), off(carried.rms_share, of_rms)) {
        (true, _) if can_be_empirical => "; model = \"empirical\" (--model empirical) reproduces both",
        (false, true) if can_be_empirical => "; model = \"empirical\" (--model empirical) reproduces it",
        _ => "",
    };
    format!(" A texture reproduces {:.0} % of the residual's RMS{octave}{better}.", 100.0 * carried.rms_share)
}

/// Hurst exponent of a self-affine term; its search ends just below 1.
fn hurst(structure: &Structure) -> String {
    let at_bound = structure.model.shape().is_some_and(|shape| structure.shape > 0.999 * shape.bounds.1);
    format!("{} {:.2}", if at_bound { ">=" } else { "=" }, structure.shape)
}

/// A positive number to two significant digits.
fn digits2(value: f64) -> String {
    let decimals = 1.0 - libm::floor(libm::log10(value));
    format!("{value:.*}", decimals.clamp(0.0, 12.0) as usize)
}

/// `p = 0.003`, or `p < 0.001`; at the smallest p-value that the replicates allow, this is stated. Fewer than [`REPLICATES_MIN`] limit no
/// p-value, because it then comes from theory.
fn p_value(p: f64, replicates: usize) -> String {
    let least = 1.0 / (replicates + 1) as f64;
    match p {
        p if replicates >= REPLICATES_MIN && p <= least => {
            format!("p <= {least:.3}, the smallest possible with {replicates} replicates")
        }
        p if p < 1e-3 => "p < 0.001".to_owned(),
        p => format!("p = {p:.3}"),
    }
}

/// A positive number to four significant digits.
fn digits4(value: f64) -> String {
    let decimals = 3.0 - libm::floor(libm::log10(value));
    format!("{value:.*}", decimals.clamp(0.0, 12.0) as usize)
}

impl ScaleExplicit {
    /// The self-affine term: increments over 1 m, m, and Hurst exponent.
    fn structure(&self) -> Option<Structure> {
        self.self_affine.as_ref()?.covariance.structures.first().copied()
    }

    /// Band RMS below each window, on the same cells.
    fn bands_text(&self) -> String {
        let band = |[below_m, rms_m]: &[f64; 2]| format!("{} m below {} m", digits4(*rms_m), digits2(*below_m));
        self.bands.iter().filter(|b| b[1].is_finite()).map(band).collect::<Vec<_>>().join(", ")
    }
}

/// Warns of models without a likelihood or without finite values, which cannot be chosen.
fn comparison_warning(findings: &Findings) -> Option<String> {
    let Findings { candidates, without_values, .. } = findings;
    let unlikely = candidates.iter().filter(|c| c.aicc_above_best.is_none()).map(|c| &c.model);
    let without: Vec<&str> = unlikely.chain(without_values).map(String::as_str).collect();
    let all = candidates.len() + without_values.len();
    (all > 1 && !without.is_empty())
        .then(|| format!("{} of {all} models could not be compared: {}", without.len(), without.join(", ")))
}

/// Warns that fits at other windows disagree.
fn separation_warning(findings: &Findings) -> Option<String> {
    let (z, explicit) = (findings.disagreement?, findings.scale_explicit.as_ref()?);
    let bands = explicit.bands_text();
    let disagree = format!("fits at half and twice the outer scale disagree by {z:.1} standard errors");
    Some(match explicit.single_scale {
        Some(other) => {
            format!("wrong model: {disagree}, those of a {other} model do not; band RMS on the same cells: {bands}")
        }
        None => format!("no scale separation: {disagree}; band RMS on the same cells: {bands}"),
    })
}

/// Effective resolution, m: the shortest lag beyond which the texture's increments (along its long axis) exceed those of the noise
/// (stated, or fitted as a nugget); at least one cell and the full width at half maximum of the point spread function. `None` if the
/// noise is larger up to the largest lag of the fit.
fn resolution_m(case: &Case, covariance: &Covariance) -> Option<f64> {
    /// Full width at half maximum over standard deviation of a Gaussian.
    const FULL_WIDTH: f64 = 2.354_820_045_030_949;
    /// Lags scanned before the bisection between two of them.
    const STEPS: usize = 100;
    let measurement = case.settings.measurement();
    let [x, y] = case.geometry.cell;
    let least_m = x.max(y).max(FULL_WIDTH * measurement.inner_scale_m);
    let noise = measurement.noise.covariance();
    let increment = |of: &Covariance, lag_m: f64| of.at_distance(0.0) - of.at_distance(lag_m);
    // A nugget is part of the model's increments, but counts as noise.
    let is_resolved = |lag_m: f64| {
        increment(covariance, lag_m) - covariance.nugget_m2 >= increment(&noise, lag_m) + covariance.nugget_m2
    };
    if least_m >= case.max_lag_m {
        return Some(least_m);
    }
    // Scanned from the largest lag: correlated noise may have smaller increments at short lags than at longer ones.
    let lag_m = |k: usize| least_m + (case.max_lag_m - least_m) * k as f64 / STEPS as f64;
    let Some(last) = (0..=STEPS).rev().find(|k| !is_resolved(lag_m(*k))) else { return Some(least_m) };
    if last == STEPS {
        return None;
    }
    let (mut low, mut high) = (lag_m(last), lag_m(last + 1));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if is_resolved(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

fn resolution_warning(case: &Case, estimate: &Estimate) -> Option<String> {
    resolution_m(case, &estimate.covariance).is_none().then(|| {
        format!("noise exceeds the texture's increments at all lags of the fit, to {} m", digits4(case.max_lag_m))
    })
}

fn isotropy_warning(estimate: &Estimate, findings: &Findings) -> Option<String> {
    let found = findings.isotropy.as_ref().filter(|_| !estimate.form.is_anisotropic())?;
    (found.p <= TEST_LEVEL && found.ratio < RATIO_WORTH_A_WARNING).then(|| {
        format!(
            "not isotropic ({}): ranges {:.2} times as long along azimuth {:.0} degrees; try model = \"anisotropic:{}\"",
            p_value(found.p, 0),
            1.0 / found.ratio,
            found.azimuth_deg,
            estimate.form.name()
        )
    })
}

fn stationarity_warning(findings: &Findings) -> Option<String> {
    let found = findings.stationarity.as_ref()?;
    (found.p <= TEST_LEVEL && found.sigma_max_over_min > SIGMAS_WORTH_A_WARNING).then(|| {
        format!(
            "not stationary ({}): sigma differs by a factor of {:.2} between blocks; parametric intervals are too narrow",
            p_value(found.p, 0),
            found.sigma_max_over_min
        )
    })
}

fn normality_warning(findings: &Findings) -> Option<String> {
    let p = findings.normality_p.filter(|p| *p <= 2.0 * TEST_LEVEL)?;
    Some(format!(
        "heights are not normal (p = {p:.3}; {:.3} is the smallest possible with {} replicates), although the correction for trimming assumes it",
        2.0 / (findings.replicates + 1) as f64,
        findings.replicates
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::fit::CarriedOctave;

    /// Below 99 replicates p comes from chi-squared, so that their number does not limit it.
    #[test]
    fn val_only_replicates_that_give_p_limit_it() {
        assert_eq!([0, 50, 98].map(|replicates| p_value(1e-12, replicates)), ["p < 0.001"; 3]);
        assert_eq!(p_value(0.0042, 50), "p = 0.004");
        assert_eq!(p_value(0.01, 99), "p <= 0.010, the smallest possible with 99 replicates");
        assert_eq!(p_value(0.02, 99), "p = 0.020");
    }

    /// The advice refers to what the sentence names: the RMS alone, or the RMS and the increments of an octave.
    #[test]
    fn val_the_empirical_model_reproduces_what_the_sentence_names() {
        let told = |rms_share: f64, share: f64, can_be_empirical: bool| {
            let octave = CarriedOctave { from_m: 0.5, to_m: 1.0, share };
            let (variance_share, increments) = (rms_share * rms_share, vec![octave]);
            let carried = Carried { rms_share, variance_share, untrimmed_rms_share: rms_share, increments };
            carried_sentence(&carried, can_be_empirical)
        };
        let advice = "; model = \"empirical\" (--model empirical) reproduces";
        let (of_rms, octave) = (" A texture reproduces", ", 70 % of its squared increments at 0.50-1.0 m");
        assert_eq!(told(0.87, 1.0, true), format!("{of_rms} 87 % of the residual's RMS{advice} it."));
        assert_eq!(told(0.87, 0.7, true), format!("{of_rms} 87 % of the residual's RMS{octave}{advice} both."));
        assert_eq!(told(1.0, 0.7, true), format!("{of_rms} 100 % of the residual's RMS{octave}{advice} both."));
        assert_eq!(told(1.0, 1.0, true), format!("{of_rms} 100 % of the residual's RMS."));
        assert_eq!(told(0.87, 0.7, false), format!("{of_rms} 87 % of the residual's RMS{octave}."));
    }

    /// The warning says which criterion speaks: a misfit of more than 5 % of the variance, the test, or both.
    #[test]
    fn val_a_misfit_says_why() {
        let words = |misfit: f64, p: Option<f64>| misfit_words(misfit, p.map(|p| (p <= TEST_LEVEL, p_value(p, 0))));
        let of = |misfit, p| words(misfit, p).map(|(how, intervals)| format!("{how}: {intervals}"));
        let both = "RMS misfit 9.1 % of the variance, p < 0.001: are too narrow";
        assert_eq!(of(0.091, Some(0.0)).as_deref(), Some(both));
        let large = "RMS misfit 9.1 % of the variance, more than 5 %; the test does not reject it, p = 0.400: may be too narrow";
        assert_eq!(of(0.091, Some(0.4)).as_deref(), Some(large));
        let small = "the test rejects it, p = 0.002; RMS misfit 1.2 % of the variance: are too narrow";
        assert_eq!(of(0.012, Some(0.002)).as_deref(), Some(small));
        assert_eq!(of(0.091, None).as_deref(), Some("RMS misfit 9.1 % of the variance: are too narrow"));
        assert_eq!([of(0.012, Some(0.4)), of(0.012, None)], [None, None]);
    }
}
