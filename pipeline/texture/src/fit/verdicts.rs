//! Tests of a fit against the data: scale separation, misfit, isotropy, stationarity, normality.

use super::case::Case;
use super::estimator::{Estimate, Estimator};
use super::heights::Heights;
use super::resampling::{Block, Replicates, sill_over_range, two_sided_p, upper_p};
use super::{FitError, FitSettings};
use crate::covariance::Form;
use crate::covariance::bins::Layout;
use crate::covariance::form::Role;
use sastrugi_numeric::sums;
use sastrugi_schemas::fit::Candidate;
use sastrugi_schemas::fit::OtherWindow;
use sastrugi_statistics::normal;

/// Fewest replicates that allow a p-value of 1 %.
pub const REPLICATES_MIN: usize = 99;
/// Standard errors by which two windows may differ. Both use the same surface, so that their difference scatters less than
/// this test assumes.
const WINDOWS_Z: f64 = 2.58;
/// AICc by which one model must be better than another for the other to have hardly any support (Burnham and Anderson 2002).
const AICC_WORTH: f64 = 10.0;

/// The form for surfaces without a characteristic scale.
const SELF_AFFINE: &str = "self_affine";
/// The form for surfaces with one, however smooth: it includes the exponential, and nearly the Gaussian.
const SINGLE_SCALE: &str = "matern";

/// The fit at another outer scale.
pub struct AtWindow {
    pub outer_scale_m: f64,
    pub estimate: Estimate,
    /// Whether the search for b ended within its bounds.
    is_range_identified: bool,
    /// Band RMS below that scale, on the cells that all windows use, m.
    pub rms_m: f64,
}

/// One area at several outer scales: the fit's own, and half and twice that where the DEM allows it.
pub struct Area<'a> {
    whole: &'a Case<'a>,
    /// Whether the area is the complete DEM, whose estimates then serve at its own scale.
    is_whole: bool,
    /// The area at each scale, its own first.
    cases: Vec<Option<Case<'a>>>,
    /// Band RMS below each scale, m.
    rms_m: Vec<f64>,
}

impl<'a> Area<'a> {
    /// Outer scales at which an area is fitted, over the fit's own.
    const FACTORS: [f64; 3] = [1.0, 0.5, 2.0];

    /// The settings of a case at these outer scales.
    pub fn settings(case: &Case) -> [FitSettings; 3] {
        Self::FACTORS.map(|factor| case.settings.at_outer_scale(factor * case.settings.outer_scale_m()))
    }

    /// Detrends a part of a case's DEM at each of its [`Area::settings`].
    ///
    /// # Errors
    /// Heights that cannot be read.
    pub fn new(part: &'a dyn Heights, whole: &'a Case<'a>, settings: &'a [FitSettings]) -> Result<Self, FitError> {
        let cases: Vec<Option<Case>> = settings.iter().map(|s| Case::new(part, s).ok()).collect();
        let residuals =
            cases.iter().map(|case| case.as_ref().map(Case::residual).transpose()).collect::<Result<Vec<_>, _>>()?;
        // Roughness varies over a site, so windows are compared on the same cells.
        let rms_m = common_rms_m(&residuals);
        Ok(Self { whole, is_whole: part.geometry().len() == whole.geometry.len(), cases, rms_m })
    }

    /// Fits the form of an estimate of the complete DEM at each scale.
    pub fn windows(&self, estimate: &Estimate) -> Windows {
        let whole = |rms_m| AtWindow::of(self.whole, estimate.clone(), rms_m);
        let mut at = self.cases.iter().zip(&self.rms_m);
        let own = match at.next() {
            Some((Some(_), rms_m)) if self.is_whole => whole(*rms_m),
            Some((Some(own), rms_m)) => at_window(own, estimate, *rms_m),
            _ => whole(self.whole.survey.trim.rms_m),
        };
        let others = at.filter_map(|(case, rms_m)| Some(at_window(case.as_ref()?, estimate, *rms_m))).collect();
        Windows { own, others }
    }
}

/// Fits of one form to one area at several outer scales.
pub struct Windows {
    own: AtWindow,
    pub others: Vec<AtWindow>,
}

impl Windows {
    /// Largest over smallest `sigma^2 / b` of all windows.
    pub fn sill_over_range_spread(&self) -> Option<f64> {
        let all = self.others.iter().chain([&self.own]).map(|w| sill_over_range(&w.estimate.covariance));
        let all = all.collect::<Option<Vec<f64>>>()?;
        let (low, high) = all.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        (all.len() > 1).then_some(high / low)
    }
}

/// Root mean square of each residual on the cells common to all, m; NaN for a missing residual.
fn common_rms_m(residuals: &[Option<Vec<f64>>]) -> Vec<f64> {
    let all: Vec<&Vec<f64>> = residuals.iter().flatten().collect();
    let cells = all.first().map_or(0, |first| first.len());
    let common: Vec<usize> = (0..cells).filter(|&k| all.iter().all(|residual| !residual[k].is_nan())).collect();
    let of = |residual: Option<&Vec<f64>>| match residual {
        Some(r) => sums::mean(&common.iter().map(|&k| r[k] * r[k]).collect::<Vec<_>>()).sqrt(),
        None => f64::NAN,
    };
    residuals.iter().map(|residual| of(residual.as_ref())).collect()
}

fn at_window(case: &Case, estimate: &Estimate, rms_m: f64) -> AtWindow {
    let layout = if estimate.form.is_anisotropic() { Layout::DIRECTIONAL } else { Layout::ISOTROPIC };
    let bins = case.bins_of(layout);
    let (sigma_m, range_m) = (estimate.covariance.sigma_m(), estimate.covariance.range_m());
    AtWindow::of(case, Estimator::rough(case, &bins).fit(&estimate.form, sigma_m, range_m), rms_m)
}

impl AtWindow {
    fn of(case: &Case, estimate: Estimate, rms_m: f64) -> Self {
        let is_range_identified = is_range_identified(case, &estimate);
        Self { outer_scale_m: case.settings.outer_scale_m(), estimate, is_range_identified, rms_m }
    }
}

/// Numbers that hold at a stated scale, for a surface without a characteristic scale.
pub struct ScaleExplicit {
    /// Outer scales, m, ascending, and the band RMS below each, m.
    pub bands: Vec<[f64; 2]>,
    /// The self-affine surface with the same covariance: structure function and Hurst exponent.
    pub self_affine: Option<Estimate>,
    /// A model with one scale whose fits at all windows agree, if there is one.
    pub single_scale: Option<&'static str>,
}

/// Describes a surface whose fits at several windows disagree; `estimates` are the fits at this window.
pub fn scale_explicit(estimator: &Estimator, estimates: &[Estimate], windows: &Windows, area: &Area) -> ScaleExplicit {
    let all = windows.others.iter().chain([&windows.own]);
    let mut bands: Vec<[f64; 2]> = all.map(|w| [w.outer_scale_m, w.rms_m]).collect();
    bands.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let known = estimates.iter().find(|e| e.form.name() == SELF_AFFINE).cloned();
    let self_affine = known.or_else(|| fitted(SELF_AFFINE, estimator, estimates));
    let single_scale = self_affine.as_ref().and_then(|affine| single_scale(estimator, estimates, affine, area));
    ScaleExplicit { bands, self_affine, single_scale }
}

fn fitted(form: &str, estimator: &Estimator, estimates: &[Estimate]) -> Option<Estimate> {
    let form = Form::parse(form).ok()?;
    let from = &estimates.first()?.covariance;
    Some(estimator.fit(&form, from.sigma_m(), from.range_m()))
}

/// A model with one scale that describes the surface better than a self-affine one, and the same at every window, where only plain models
/// of other shapes were tried. If it was a candidate, it has already been judged, and it has no axis or nugget that a candidate needed.
fn single_scale(estimator: &Estimator, estimates: &[Estimate], affine: &Estimate, area: &Area) -> Option<&'static str> {
    let is_plain = |form: &Form| form.terms().len() == 1 && !form.has_nugget() && !form.is_anisotropic();
    if estimates.iter().any(|e| e.form.name() == SINGLE_SCALE || !is_plain(&e.form)) {
        return None;
    }
    let single = fitted(SINGLE_SCALE, estimator, estimates)?;
    // Bins by direction and rings have different likelihoods.
    let are_comparable = single.likelihood.as_ref()?.bins == affine.likelihood.as_ref()?.bins;
    let is_better = are_comparable && single.aicc()? < affine.aicc()? - AICC_WORTH;
    let has_scale = is_better && is_range_identified(area.whole, &single);
    // Where no window could be compared, agreement is not known.
    let agree = || window_disagreement(&area.windows(&single)).is_some_and(|z| z <= WINDOWS_Z);
    (has_scale && agree()).then_some(SINGLE_SCALE)
}

/// Largest disagreement between fits at neighbouring windows, in standard errors: over sigma, b (or the shape) and sigma^2 / b.
/// sigma^2 / b is identified even where sigma and b are not (those two are skipped if a search for b ended at its upper bound).
/// The standard errors assume that the model is right: the parameters of a wrong model move with the window, which is what
/// this test detects.
pub fn window_disagreement(windows: &Windows) -> Option<f64> {
    let Windows { own, others } = windows;
    let pairs = others.iter().flat_map(|other| {
        let b_identified = own.is_range_identified && other.is_range_identified;
        compared(&own.estimate, b_identified).into_iter().map(|weights| (&other.estimate, weights))
    });
    let z = |(other, weights): (&Estimate, Vec<(usize, f64)>)| {
        let apart: f64 = weights.iter().map(|(k, w)| w * (own.estimate.at[*k] - other.at[*k])).sum();
        let variance = own.estimate.variance_of(&weights)? + other.variance_of(&weights)?;
        Some(apart.abs() / variance.sqrt()).filter(|z| z.is_finite())
    };
    pairs.filter_map(z).fold(None, |largest, v| Some(largest.map_or(v, |l: f64| l.max(v))))
}

/// The weighted sums of coordinates (logarithms of the parameters) to compare.
fn compared(estimate: &Estimate, b_identified: bool) -> Vec<Vec<(usize, f64)>> {
    let [sigma, range, shape] = [Role::Sigma(0), Role::Range(0), Role::Shape(0)].map(|role| estimate.coordinate(role));
    let identified = range.is_none() || b_identified;
    let alone = [sigma.filter(|_| identified), range.filter(|_| identified), shape];
    let mut all: Vec<Vec<(usize, f64)>> = alone.into_iter().flatten().map(|k| vec![(k, 1.0)]).collect();
    if estimate.covariance.structures.len() == 1 {
        all.extend(sigma.zip(range).map(|(sigma, range)| vec![(sigma, 2.0), (range, -1.0)]));
    }
    all
}

/// False when the search for b ended at its upper bound.
pub fn is_range_identified(case: &Case, estimate: &Estimate) -> bool {
    let Some(k) = estimate.coordinate(Role::Range(0)) else { return true };
    let (_, end) = case.coordinates(&estimate.form).bounds()[k];
    estimate.at[k] <= end - 1e-3
}

/// True if windows disagree by more than scatter explains.
pub fn no_scale_separation(disagreement: Option<f64>) -> bool {
    disagreement.is_some_and(|z| z > WINDOWS_Z)
}

/// Test of isotropy: the rise of the likelihood from an isotropic to an anisotropic fit, on bins by direction, over the misfit
/// per degree of freedom; chi-squared with two degrees of freedom for an isotropic surface.
pub struct Isotropy {
    pub p: f64,
    pub ratio: f64,
    pub azimuth_deg: f64,
}

/// Tests isotropy with an estimator on bins by direction.
pub fn isotropy(estimator: &Estimator, estimate: &Estimate) -> Option<Isotropy> {
    let (case, bins) = (estimator.case, estimator.bins);
    let (sigma_m, range_m) = (estimate.covariance.sigma_m(), estimate.covariance.range_m());
    let round = estimator.fit(&estimate.form.isotropic(), sigma_m, range_m);
    let form = estimate.form.with_axis();
    let start = case.coordinates(&form).encode(&round.covariance);
    let likelihood = round.likelihood.clone()?;
    let from = Estimate { form: form.clone(), at: start, likelihood: Some(likelihood.clone()), ..round.clone() };
    let long = estimator.refit(&from, &bins.covariance_m2, case.survey.trim.threshold_m);
    let freedom = bins.len().saturating_sub(long.at.len()).max(1) as f64;
    let rise = (likelihood.chi2 - long.value).max(0.0) / (long.value / freedom).max(1.0);
    let covariance = case.coordinates(&form).decode(&long.at);
    Some(Isotropy { p: libm::exp(-0.5 * rise), ratio: covariance.ratio, azimuth_deg: covariance.azimuth_deg })
}

/// Test of stationarity: largest over smallest block sigma, and the p-value of the scatter of the block variances about their
/// mean, against the scatter expected under the fitted model (chi-squared).
pub struct Stationarity {
    pub p: f64,
    pub sigma_max_over_min: f64,
}

pub fn stationarity(estimator: &Estimator, estimate: &Estimate, blocks: &[Block]) -> Option<Stationarity> {
    if blocks.len() < 2 {
        return None;
    }
    let threshold_m = estimator.case.survey.trim.threshold_m;
    let variance_of_one = estimator.expectation.covariance(&estimate.covariance, threshold_m).first().copied()?
        * estimator.case.survey.kept as f64;
    let variances: Vec<f64> = blocks.iter().map(Block::variance_m2).collect();
    let cells: Vec<f64> = blocks.iter().map(|b| b.cells() as f64).collect();
    let total: f64 = sums::sum(&cells);
    let mean = variances.iter().zip(&cells).map(|(v, n)| v * n).sum::<f64>() / total;
    let chi2: f64 = variances.iter().zip(&cells).map(|(v, n)| (v - mean) * (v - mean) * n / variance_of_one).sum();
    let (low, high) = variances.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
    let p = chi_squared_upper(chi2, (blocks.len() - 1) as f64);
    Some(Stationarity { p, sigma_max_over_min: (high / low).sqrt() })
}

/// Upper tail of chi-squared by Wilson and Hilferty (1931): error below 0.003 for 5 degrees of freedom or more.
pub fn chi_squared_upper(chi2: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    1.0 - normal::cdf((libm::cbrt(chi2 / freedom) - (1.0 - spread)) / spread.sqrt())
}

/// p-value of the misfit: against the replicates if there are enough, otherwise against chi-squared.
pub fn misfit_p(estimate: &Estimate, replicates: Option<&Replicates>) -> Option<f64> {
    let ratio = estimate.misfit_ratio()?;
    let freedom = (estimate.likelihood.as_ref()?.bins.saturating_sub(estimate.at.len())) as f64;
    Some(match replicates.filter(|r| r.misfit_ratio.len() >= REPLICATES_MIN) {
        Some(r) => upper_p(ratio, &r.misfit_ratio),
        None => chi_squared_upper(ratio * freedom, freedom),
    })
}

/// p-value of the residual's distribution: its median absolute value over the trimming threshold, against that of normal
/// surfaces. `None` with too few replicates.
pub fn normality_p(case: &Case, replicates: &Replicates) -> Option<f64> {
    let enough = replicates.median_over_threshold.len() >= REPLICATES_MIN;
    enough.then(|| {
        two_sided_p(case.survey.trim.median_size_m / case.survey.trim.threshold_m, &replicates.median_over_threshold)
    })
}

/// Every model tried, the best first, with its expected covariance in the rings.
pub fn candidates(estimates: &[Estimate], rings: &Estimator) -> Vec<Candidate> {
    let least = estimates.iter().filter_map(Estimate::aicc).fold(f64::INFINITY, f64::min);
    let mut all: Vec<Candidate> = estimates
        .iter()
        .map(|e| Candidate {
            model: e.form.name().to_owned(),
            parameters: e.covariance.parameters(&e.form),
            free: e.at.len() as u32,
            chi2: e.likelihood.as_ref().map(|l| l.chi2),
            aicc_above_best: e.aicc().map(|a| a - least),
            model_m2: rings.mean(&e.covariance),
        })
        .collect();
    let order = |c: &Candidate| c.aicc_above_best.unwrap_or(f64::INFINITY);
    all.sort_by(|a, b| order(a).total_cmp(&order(b)));
    all
}

/// A fit at another window, as a diagnostic.
pub fn other_window(at: &AtWindow) -> OtherWindow {
    let parameters = at.estimate.covariance.parameters(&at.estimate.form);
    OtherWindow {
        band_rms_m: Some(at.rms_m),
        misfit_chi2_per_freedom: at.estimate.misfit_ratio(),
        outer_scale_m: Some(at.outer_scale_m),
        parameters: parameters.into_iter().map(|(name, value)| (name, Some(value))).collect(),
    }
}
