//! The fit file: figures, diagnostics and warnings.

use super::Mode;
use super::case::Case;
use super::estimator::{Estimate, Estimator, difference, on_surface};
use super::profile::LIKELIHOOD_RISE;
use super::resampling::sill_over_range;
use super::verdicts::{Isotropy, ScaleExplicit, Stationarity, is_range_told};
use crate::covariance::form::Role;
use crate::covariance::{Covariance, Form, Structure};
use sastrugi_schemas::fit::{
    Candidate, Carried, Diagnostics, DirectionBin, FitFile, GsTools, Intervals, OtherWindow, Profile, Trim,
};
use std::f64::consts::FRAC_PI_2;

/// Naive range over window above which the true range cannot be told (its ceiling for a pure exponential is 0.135).
const NAIVE_RANGE_MAX: f64 = 0.12;
/// Misfit over variance above which the model is called wrong whatever the p-value.
const MISFIT_MAX: f64 = 0.05;
/// Share of measured cells taken for objects that is worth a warning.
const OBJECT_SHARE_MAX: f64 = 0.1;
/// Spread of sigma^2 / b between windows that is worth a word.
const SPREAD_WORTH_A_WARNING: f64 = 1.25;
/// How far a texture's RMS, and its increments in any octave, may be from the residual's.
const CARRIED_TOLERANCES: [f64; 2] = [0.05, 0.15];
/// Level of every warning that comes from a test.
const TEST_LEVEL: f64 = 0.01;
/// Least elongation that is worth a warning, as a ratio of ranges.
const RATIO_WORTH_A_WARNING: f64 = 0.9;
/// Least spread of block sigmas that is worth a warning.
const SIGMAS_WORTH_A_WARNING: f64 = 1.2;

/// What was found beside the estimate.
#[derive(Default)]
pub struct Findings {
    pub intervals: Option<Intervals>,
    pub block_intervals: Option<Intervals>,
    pub candidates: Vec<Candidate>,
    pub profile: Option<Profile>,
    /// Largest disagreement of fits at other windows, in standard errors.
    pub disagreement: Option<f64>,
    pub others: Vec<OtherWindow>,
    /// Where they disagree.
    pub scale_explicit: Option<ScaleExplicit>,
    pub isotropy: Option<Isotropy>,
    pub stationarity: Option<Stationarity>,
    pub misfit_p: Option<f64>,
    pub normality_p: Option<f64>,
    /// Largest over smallest sigma^2 / b of all windows.
    pub sill_over_range_spread: Option<f64>,
    /// Replicates that p-values rest on; 0 for theory's nulls.
    pub replicates: usize,
    /// What of the residual a texture from the fit has.
    pub carried: Option<Carried>,
    pub directions: Vec<DirectionBin>,
}

/// The fit file; `binned` is the model in the rings as the estimator sees it, m2.
pub fn fit_file(case: &Case, naive: &Estimate, estimate: &Estimate, binned: Vec<f64>, findings: &Findings) -> FitFile {
    let figures = Figures::of(case, naive, estimate, &binned);
    let (verdict, warnings) = figures.words(case, naive, estimate, findings);
    FitFile {
        mode: case.settings.mode().name().to_owned(),
        model: estimate.form.name().to_owned(),
        parameters: estimate.covariance.parameters(&estimate.form),
        window_m: Some(case.window.size_m(case.geometry.cell)),
        trim: Some(Trim {
            level: case.settings.trim(),
            threshold_m: case.survey.trim.threshold_m,
            masked_share: 1.0 - figures.share(case.survey.kept),
        }),
        cell_m: Some(case.geometry.cell),
        lags_m: case.bins.lag_m.clone(),
        covariance_m2: case.bins.covariance_m2.clone(),
        pairs: case.bins.pairs.clone(),
        model_m2: binned,
        surface_model_m2: on_surface(case, &estimate.covariance),
        diagnostics: figures.diagnostics(case, naive, estimate, findings),
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
        // A plain struct of numbers and words always has a JSON form.
        settings: serde_json::to_value(case.settings.parameters()).unwrap_or_default(),
        source: None,
        height_quantiles_m: Vec::new(),
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

/// The model in the words of GSTools; `None` for sums and self-affine surfaces, which it has no class for.
pub fn gstools(form: &Form, covariance: &Covariance) -> Option<GsTools> {
    let [term] = covariance.structures.as_slice() else { return None };
    let (model, len_scale, more) = match form.terms()[0].kind().kind {
        "exponential" => ("Exponential", term.range_m, vec![("rescale", 1.0)]),
        "gaussian" => ("Gaussian", term.range_m, vec![("rescale", 1.0)]),
        "spherical" => ("Spherical", term.range_m, vec![("rescale", 1.0)]),
        // GSTools' argument is sqrt(nu) h / len_scale.
        // GSTools takes a smoothness of 0.2 and above.
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

/// Figures that diagnostics and warnings share.
struct Figures {
    /// Cells of the DEM.
    cells: usize,
    /// Measured cells that entered the moving average.
    trusted: usize,
    misfit_m2: f64,
    naive_range_windows: f64,
    /// Generalised sum of squares per degree of freedom.
    misfit_ratio: Option<f64>,
}

impl Figures {
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
        let self_affine = findings.scale_explicit.as_ref().and_then(ScaleExplicit::structure);
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
            range_at_search_bound: !is_range_told(case, estimate),
            sigma2_over_range_m: sill_over_range(&estimate.covariance),
            sigma2_over_range_spread: findings.sill_over_range_spread,
            stationarity_p: stationarity.map(|s| s.p),
            trimmed_share: Some(self.share(survey.detrended - survey.kept)),
            window_cells: Some([case.window.cells()[1], case.window.cells()[0]]),
            window_disagreement_z: findings.disagreement,
            window_lacks_data_share: Some(self.share(self.trusted - survey.detrended)),
        }
    }

    /// How much the sum of squares rises at three times the range, over what misfit there is.
    fn rise_at_3b(&self, findings: &Findings) -> Option<f64> {
        let profile = findings.profile.as_ref()?;
        let own = profile.range_m.iter().zip(&profile.chi2_rise).min_by(|a, b| a.1.total_cmp(b.1))?.0;
        // Nearer where the search ends before.
        let at = profile.range_m.iter().position(|r| *r > 2.9 * own).unwrap_or(profile.range_m.len() - 1);
        Some(profile.chi2_rise[at] / self.misfit_ratio.unwrap_or(1.0).max(1.0))
    }

    /// What is said of the fit: one verdict, then warnings in the order of their consequence.
    fn words(&self, case: &Case, naive: &Estimate, estimate: &Estimate, findings: &Findings) -> (String, Vec<String>) {
        if case.settings.mode() == Mode::Paper {
            let verdict = "published procedure: sigma and b are those of the detrended, trimmed residual, not of the surface; use \
                           them to compare with other results in paper mode only";
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

    /// b is not told: the search ended at its bound, the likelihood is flat, or the uncorrected range lies where every exponential ends up.
    fn range_warning(&self, case: &Case, naive: &Estimate, estimate: &Estimate, findings: &Findings) -> Option<String> {
        let b = estimate.covariance.structures[0].range_m;
        estimate.coordinate(Role::Range(0))?;
        let moves = findings
            .sill_over_range_spread
            .filter(|spread| *spread > SPREAD_WORTH_A_WARNING)
            .map_or_else(String::new, |spread| {
                format!("; sigma^2 / b moves by a factor of {spread:.2} between windows")
            });
        if !is_range_told(case, estimate) {
            return Some(format!("b is not identified: the search ended at its bound of {} m{moves}", figure(b)));
        }
        if self.rise_at_3b(findings).is_some_and(|rise| rise < LIKELIHOOD_RISE) {
            return Some(format!(
                "b is not identified: b = {} m fits as well as {} m{moves}",
                figure(b),
                figure(3.0 * b)
            ));
        }
        (self.naive_range_windows > NAIVE_RANGE_MAX && sill_over_range(&estimate.covariance).is_some()).then(|| {
            format!(
                "b is not identified: the uncorrected range of {} m is {:.2} windows, near the ceiling of 0.135 for any exponential{moves}",
                figure(naive.covariance.range_m()),
                self.naive_range_windows,
            )
        })
    }

    fn misfit_warning(&self, case: &Case, estimate: &Estimate, findings: &Findings) -> Option<String> {
        let misfit = self.misfit_m2 / case.bins.covariance_m2[0];
        let rejected = findings.misfit_p.is_some_and(|p| p <= TEST_LEVEL);
        let how = findings.misfit_p.map_or_else(String::new, |p| format!(", {}", p_value(p, findings.replicates)));
        (misfit > MISFIT_MAX || rejected).then(|| {
            format!(
                "the {} model misfits the covariance (RMS misfit {:.1} % of the variance{how}); its parametric intervals are too narrow",
                estimate.form.name(),
                100.0 * misfit
            )
        })
    }

    fn object_warning(&self, case: &Case) -> Option<String> {
        let objects = (case.survey.measured - self.trusted) as f64 / case.survey.measured as f64;
        (objects > OBJECT_SHARE_MAX).then(|| {
            format!(
                "{:.1} % of the cells were taken for objects; on a bare site set find_objects = false",
                100.0 * objects
            )
        })
    }
}

/// What speaks against a fit, as warnings.
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

    /// What describes the surface at this scale, what may be published, and what a texture from the fit is good for: the figures that a
    /// reader needs first. Details are in warnings and diagnostics.
    fn verdict(&self, case: &Case, estimate: &Estimate, findings: &Findings) -> String {
        let window_m = figure(case.window_m());
        let rms_m = figure(case.survey.trim.rms_m);
        let model = estimate.form.name();
        let described = if self.noise.is_some() {
            format!("Mostly noise below {window_m} m: publish no texture parameters")
        } else if self.scale.is_some() {
            let growth = findings
                .scale_explicit
                .as_ref()
                .and_then(ScaleExplicit::structure)
                .map(|s| format!(" and the structure function ({} m at 1 m, H {})", figure(s.sigma_m), hurst(&s)));
            let growth = growth.unwrap_or_default();
            format!("No single scale below {window_m} m: publish band RMS {rms_m} m{growth}, not sigma and b")
        } else if self.misfit.is_some() {
            format!(
                "The {model} model does not fit the covariance below {window_m} m: publish band RMS {rms_m} m, or try --model auto"
            )
        } else if self.range.is_some() {
            let slope = sill_over_range(&estimate.covariance);
            let slope = slope.map_or_else(String::new, |slope| format!("sigma^2 / b = {} m and ", figure(slope)));
            format!("b is not identified below {window_m} m: publish {slope}band RMS {rms_m} m")
        } else {
            let interval =
                if findings.intervals.is_some() { "with their intervals" } else { "once --bootstrap gives intervals" };
            format!(
                "The {model} model describes the surface below {window_m} m{}: publish its parameters {interval}",
                self.caveat()
            )
        };
        let carried = findings.carried.as_ref().map(|c| carried_words(c, case)).unwrap_or_default();
        format!("{described}.{carried}")
    }

    /// What holds on average only.
    fn caveat(&self) -> &'static str {
        match (&self.site, &self.direction) {
            (None, None) => "",
            (Some(_), None) => " (averaged over a site that is not stationary)",
            (None, Some(_)) => " (averaged over directions that differ)",
            (Some(_), Some(_)) => " (averaged over a site that is not stationary and over directions that differ)",
        }
    }
}

/// What a texture has, for the end of a verdict.
fn carried_words(carried: &Carried, case: &Case) -> String {
    let [of_rms, of_increments] = CARRIED_TOLERANCES;
    let off = |share: f64, tolerance: f64| (share - 1.0).abs() > tolerance;
    let worst = carried.increments.iter().max_by(|a, b| (a.share - 1.0).abs().total_cmp(&(b.share - 1.0).abs()));
    let worst = worst.filter(|o| off(o.share, of_increments));
    let octave = worst.map_or_else(String::new, |o| {
        format!(", {:.0} % of its squared increments at {}-{} m", 100.0 * o.share, short(o.from_m), short(o.to_m))
    });
    let is_off = off(carried.rms_share, of_rms) || worst.is_some();
    let can_be_better = !case.settings.empirical && !case.heights.are_profiles();
    let better = if is_off && can_be_better { "; --model empirical reproduces both" } else { "" };
    format!(" A texture reproduces {:.0} % of the residual's RMS{octave}{better}.", 100.0 * carried.rms_share)
}

/// Hurst exponent of a self-affine term; its search ends just below 1.
fn hurst(structure: &Structure) -> String {
    let at_bound = structure.model.shape().is_some_and(|shape| structure.shape > 0.999 * shape.bounds.1);
    format!("{} {:.2}", if at_bound { ">=" } else { "=" }, structure.shape)
}

/// A positive figure to two digits.
fn short(value: f64) -> String {
    let decimals = 1.0 - libm::floor(libm::log10(value));
    format!("{value:.*}", decimals.clamp(0.0, 12.0) as usize)
}

/// `p = 0.003`, or `p < 0.001`; with what so many replicates can tell at least.
fn p_value(p: f64, replicates: usize) -> String {
    let least = 1.0 / (replicates + 1) as f64;
    match p {
        p if replicates > 0 && p <= least => {
            format!("p <= {least:.3}, the smallest that {replicates} replicates can give")
        }
        p if p < 1e-3 => "p < 0.001".to_owned(),
        p => format!("p = {p:.3}"),
    }
}

/// A positive figure to four digits.
fn figure(value: f64) -> String {
    let decimals = 3.0 - libm::floor(libm::log10(value));
    format!("{value:.*}", decimals.clamp(0.0, 12.0) as usize)
}

impl ScaleExplicit {
    /// The self-affine term: increments over 1 m, m, and Hurst exponent.
    fn structure(&self) -> Option<Structure> {
        self.self_affine.as_ref()?.covariance.structures.first().copied()
    }

    /// Root mean square heights below each window, on the same cells.
    fn bands_words(&self) -> String {
        let band = |[below_m, rms_m]: &[f64; 2]| format!("{} m below {} m", figure(*rms_m), short(*below_m));
        self.bands.iter().filter(|b| b[1].is_finite()).map(band).collect::<Vec<_>>().join(", ")
    }
}

/// A model without a likelihood is not chosen.
fn comparison_warning(findings: &Findings) -> Option<String> {
    let without: Vec<&str> =
        findings.candidates.iter().filter(|c| c.aicc_above_best.is_none()).map(|c| c.model.as_str()).collect();
    let all = findings.candidates.len();
    (all > 1 && !without.is_empty())
        .then(|| format!("{} of {all} models could not be compared: {}", without.len(), without.join(", ")))
}

/// Fits at other windows are other fits.
fn separation_warning(findings: &Findings) -> Option<String> {
    let (z, explicit) = (findings.disagreement?, findings.scale_explicit.as_ref()?);
    Some(format!(
        "no scale separation: fits at half and twice the outer scale disagree by {z:.1} standard errors; band RMS on the same cells: {}",
        explicit.bands_words()
    ))
}

/// Shortest lag from which on the texture's increments (along its long axis) exceed those of the noise (stated, or fitted as a
/// nugget), m; no shorter than the cell and the full width of the point spread at half its height. `None` where the noise is larger up
/// to the largest lag of the fit.
fn resolution_m(case: &Case, covariance: &Covariance) -> Option<f64> {
    /// Full width at half maximum over standard deviation of a Gaussian.
    const FULL_WIDTH: f64 = 2.354_820_045_030_949;
    /// Lags that are looked at before the search between two of them.
    const STEPS: usize = 100;
    let measurement = case.settings.measurement();
    let [x, y] = case.geometry.cell;
    let least_m = x.max(y).max(FULL_WIDTH * measurement.inner_scale_m);
    let noise = measurement.noise.covariance();
    let increment = |of: &Covariance, lag_m: f64| of.at_distance(0.0) - of.at_distance(lag_m);
    // A nugget is in the increments of the model, and counts as noise.
    let told = |lag_m: f64| {
        increment(covariance, lag_m) - covariance.nugget_m2 >= increment(&noise, lag_m) + covariance.nugget_m2
    };
    if least_m >= case.max_lag_m {
        return Some(least_m);
    }
    // Over a short lag correlated noise may differ less than over a longer one.
    let lag_m = |k: usize| least_m + (case.max_lag_m - least_m) * k as f64 / STEPS as f64;
    let Some(last) = (0..=STEPS).rev().find(|k| !told(lag_m(*k))) else { return Some(least_m) };
    if last == STEPS {
        return None;
    }
    let (mut low, mut high) = (lag_m(last), lag_m(last + 1));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if told(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

fn resolution_warning(case: &Case, estimate: &Estimate) -> Option<String> {
    resolution_m(case, &estimate.covariance).is_none().then(|| {
        format!("noise exceeds the texture's increments at all lags of the fit, to {} m", figure(case.max_lag_m))
    })
}

fn isotropy_warning(estimate: &Estimate, findings: &Findings) -> Option<String> {
    let found = findings.isotropy.as_ref().filter(|_| !estimate.form.is_anisotropic())?;
    (found.p <= TEST_LEVEL && found.ratio < RATIO_WORTH_A_WARNING).then(|| {
        format!(
            "not isotropic ({}): ranges {:.2} times as long along azimuth {:.0} degrees; try --model anisotropic:{}",
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
        "heights are not normal (p = {p:.3}; {:.3} is the smallest that {} replicates can give): the correction for trimming assumes they are",
        2.0 / (findings.replicates + 1) as f64,
        findings.replicates
    ))
}
