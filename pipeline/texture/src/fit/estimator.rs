//! Least-squares fits of covariance models: ordinary, and generalised with the model after detrending and trimming.

use super::case::Case;
use super::expectation::Expectation;
use super::least_squares::{self, Cholesky, Chord, Minimum, curvature, minimise, slopes};
use crate::covariance::filtered::DetrendFilter;
use crate::covariance::form::Role;
use crate::covariance::lag::{lag_m, length_m};
use crate::covariance::models::exponential::Exponential;
use crate::covariance::partial::{PAIRS_FINE, PAIRS_ROUGH, PartialWindows};
use crate::covariance::{Covariance, Form, LagBins};
use rayon::prelude::*;

/// Most rounds of reweighting by the covariance of the bins.
const WEIGHTING_ROUNDS: usize = 4;
/// Shares by which the variances of the bins are raised; the first that makes their covariance positive definite is used.
const RIDGES: [f64; 5] = [0.0, 1e-6, 1e-5, 1e-4, 1e-3];
/// Reweighting ends when no coordinate moves by more than this.
const CONVERGED: f64 = 1e-6;
/// Reweighting has settled if the weights of its result give a sum of squares that differs at most by this factor from the one under the
/// weights that led to it.
const SETTLED: f64 = 2.0;

/// Fitted parameters and their likelihood.
#[derive(Clone)]
pub struct Estimate {
    pub form: Form,
    pub covariance: Covariance,
    /// Search coordinates.
    pub at: Vec<f64>,
    pub steps: usize,
    /// Likelihood of a generalised least-squares fit; absent for an ordinary one.
    pub likelihood: Option<Likelihood>,
}

/// The Gaussian likelihood of the bins at an estimate.
#[derive(Clone)]
pub struct Likelihood {
    /// Factor of the covariance of the bins.
    pub weights: Cholesky,
    /// Generalised sum of squares.
    pub chi2: f64,
    /// Number of bins.
    pub bins: usize,
    /// Covariance of the coordinates, row-major; absent if they are not identifiable.
    pub scatter: Option<Vec<f64>>,
}

impl Estimate {
    /// Akaike's criterion with Hurvich and Tsai's (1989) correction: -2 ln L + 2 k + 2 k (k + 1) / (n - k - 1), up to a constant
    /// common to all models. `None` without a finite likelihood, or with too many parameters.
    pub fn aicc(&self) -> Option<f64> {
        let likelihood = self.likelihood.as_ref()?;
        let (n, k) = (likelihood.bins as f64, self.at.len() as f64);
        let correction = 2.0 * k * (k + 1.0) / (n - k - 1.0);
        let aicc = likelihood.chi2 + likelihood.weights.log_determinant() + 2.0 * k + correction;
        (n > k + 1.0 && aicc.is_finite()).then_some(aicc)
    }

    /// Generalised sum of squares per degree of freedom.
    pub fn misfit_ratio(&self) -> Option<f64> {
        let likelihood = self.likelihood.as_ref()?;
        Some(likelihood.chi2 / (likelihood.bins.saturating_sub(self.at.len())).max(1) as f64)
    }

    /// Variance of a weighted sum of coordinates, from the curvature of the likelihood.
    pub fn variance_of(&self, weights: &[(usize, f64)]) -> Option<f64> {
        let scatter = self.likelihood.as_ref()?.scatter.as_ref()?;
        let of = |(k, w): &(usize, f64), (l, v): &(usize, f64)| w * v * scatter[k * self.at.len() + l];
        Some(weights.iter().flat_map(|a| weights.iter().map(move |b| of(a, b))).sum())
    }

    /// Position of the coordinate with a role.
    pub fn coordinate(&self, role: Role) -> Option<usize> {
        self.form.parameters().iter().position(|p| p.role == role)
    }
}

/// A fit with one coordinate held.
pub struct Held {
    /// Rise of the sum of squares above that of the estimate.
    pub rise: f64,
    /// Search coordinates.
    pub at: Vec<f64>,
}

/// The estimator on one set of bins.
pub struct Estimator<'a> {
    pub case: &'a Case<'a>,
    pub bins: &'a LagBins,
    pub expectation: Expectation<'a>,
}

impl<'a> Estimator<'a> {
    /// The estimator for the reported parameters.
    pub fn new(case: &'a Case<'a>, bins: &'a LagBins) -> Self {
        Self::with_pairs(case, bins, PAIRS_FINE)
    }

    /// A faster, less accurate estimator for verdicts and diagnostics.
    pub fn rough(case: &'a Case<'a>, bins: &'a LagBins) -> Self {
        Self::with_pairs(case, bins, PAIRS_ROUGH)
    }

    fn with_pairs(case: &'a Case<'a>, bins: &'a LagBins, pairs: f64) -> Self {
        #[cfg(not(test))]
        let partial = PartialWindows::new;
        // Studies of the estimator fit thousands of rasters, most of them with the same cells.
        #[cfg(test)]
        let partial = super::tests::kept::partial_windows;
        Self::with_partial(case, bins, partial(&case.survey.cells(), case.window, bins, pairs))
    }

    /// The estimator with these partial windows of the case's cells.
    pub fn with_partial(case: &'a Case<'a>, bins: &'a LagBins, partial: PartialWindows) -> Self {
        let measurement = case.settings.measurement();
        let expectation = Expectation {
            filter: DetrendFilter::new(case.window, case.geometry.cell, case.max_lag, measurement),
            wide: DetrendFilter::wide(case.window, case.geometry.cell, case.max_lag, measurement),
            partial_by_distance: partial.by_distance(case.geometry.cell),
            partial,
            bins,
            cells: case.survey.detrended,
        };
        Self { case, bins, expectation }
    }

    /// The model in each bin after detrending and trimming, m2.
    pub fn mean(&self, covariance: &Covariance) -> Vec<f64> {
        self.expectation.mean(covariance, self.case.survey.trim.threshold_m)
    }

    /// True if the model has a value in each bin, m2.
    pub fn is_finite(&self, estimate: &Estimate) -> bool {
        self.mean(&estimate.covariance).iter().all(|m| m.is_finite())
    }

    /// Fits every form, starting from the uncorrected exponential fitted to the same data.
    pub fn candidates(&self, naive: &Estimate) -> Vec<Estimate> {
        let (sigma_m, range_m) = (1.2 * naive.covariance.sigma_m(), 1.5 * naive.covariance.range_m());
        self.case.settings.forms.par_iter().map(|form| self.fit(form, sigma_m, range_m)).collect()
    }

    /// Generalised least-squares fit of a form, starting from an exponential of the given sigma and b.
    pub fn fit(&self, form: &Form, sigma_m: f64, range_m: f64) -> Estimate {
        // Enter the thread pool once: otherwise each of thousands of small transforms would be handed over to it.
        rayon::scope(|_| self.fit_here(form, sigma_m, range_m))
    }

    fn fit_here(&self, form: &Form, sigma_m: f64, range_m: f64) -> Estimate {
        let coordinates = self.case.coordinates(form);
        let ends = coordinates.starts(sigma_m, range_m).into_iter().map(|start| self.search(form, &start, None));
        let ordinary = least(ends);
        let own = self.weights(&coordinates.decode(&ordinary.at));
        let settled = own.clone().and_then(|weights| self.reweighted(form, &ordinary, weights));
        // The bins of a smooth surface hardly scatter among themselves. Weights of a smooth fit that misses the data lead away from it;
        // those of the exponential at the start may lead to a rougher one.
        let settled = settled.or_else(|| self.reweighted(form, &ordinary, self.exponential_weights(sigma_m, range_m)?));
        let (end, weights) = match settled {
            Some((end, weights)) => (end, Some(weights)),
            None => (self.judged(form, ordinary, own.as_ref()), own),
        };
        let steps = end.steps;
        let likelihood = weights.map(|weights| self.likelihood(form, &end, weights));
        Estimate { form: form.clone(), covariance: coordinates.decode(&end.at), at: end.at, steps, likelihood }
    }

    /// Searches again and again with the weights of the last result, beginning with `weights`; returns the result and its weights. `None`
    /// if that does not settle: what a model far from the data says about the scatter of the bins can drive its range towards zero, or its
    /// variance up and down.
    fn reweighted(&self, form: &Form, from: &Minimum, mut weights: Cholesky) -> Option<(Minimum, Cholesky)> {
        let coordinates = self.case.coordinates(form);
        let mut end = from.clone();
        for round in 1..=WEIGHTING_ROUNDS {
            let next = self.search(form, &end.at, Some(&weights));
            if self.is_white(&coordinates.decode(&next.at)) && !self.is_white(&coordinates.decode(&end.at)) {
                return None;
            }
            let moved = difference(&next.at, &end.at).iter().fold(0.0, |m, d| f64::max(m, d.abs()));
            end = Minimum { steps: end.steps + next.steps, ..next };
            if moved < CONVERGED {
                break;
            }
            let own = self.weights(&coordinates.decode(&end.at))?;
            if round == WEIGHTING_ROUNDS {
                let after = self.judged(form, end.clone(), Some(&own)).value;
                return self.have_settled(end.value, after).then_some((end, weights));
            }
            weights = own;
        }
        Some((end, weights))
    }

    /// True if two sums of squares of one fit, under the weights that led to it and under its own, are alike.
    fn have_settled(&self, before: f64, after: f64) -> bool {
        // Below the number of bins a sum of squares is a good one, whatever its factor. A comparison with NaN is false.
        let least = self.bins.len() as f64;
        let is_alike = |a: f64, b: f64| a <= SETTLED * b.max(least);
        is_alike(before, after) && is_alike(after, before)
    }

    /// A search result with its sum of squares under other weights.
    fn judged(&self, form: &Form, end: Minimum, weights: Option<&Cholesky>) -> Minimum {
        let misfit = self.misfit(form, &end.at, weights, &self.bins.covariance_m2);
        Minimum { value: misfit.iter().map(|r| r * r).sum(), ..end }
    }

    /// The weights of an exponential.
    fn exponential_weights(&self, sigma_m: f64, range_m: f64) -> Option<Cholesky> {
        self.weights(&Covariance::new(&Exponential, sigma_m, range_m).ok()?)
    }

    /// True if the model's range is at most one cell although neighbouring cells of the data are correlated.
    fn is_white(&self, covariance: &Covariance) -> bool {
        let [x, y] = self.case.geometry.cell;
        covariance.is_stationary() && covariance.range_m() <= x.max(y) && !self.case.is_white()
    }

    fn likelihood(&self, form: &Form, end: &Minimum, weights: Cholesky) -> Likelihood {
        let n = end.at.len();
        let curvature = curvature(&end.at, |p| self.misfit(form, p, Some(&weights), &self.bins.covariance_m2));
        let scatter = Cholesky::new(&curvature, n).map(|factor| factor.inverse());
        Likelihood { weights, chi2: end.value, bins: self.bins.len(), scatter }
    }

    /// Cholesky factor of the covariance of the bins for a surface. For a smooth surface whose range exceeds the window that covariance is
    /// approximate and may be indefinite: its diagonal is then raised until it is definite.
    pub fn weights(&self, covariance: &Covariance) -> Option<Cholesky> {
        let matrix = self.expectation.covariance(covariance, self.case.survey.trim.threshold_m);
        let n = self.bins.len();
        RIDGES.into_iter().find_map(|ridge| {
            let mut raised = matrix.clone();
            (0..n).for_each(|k| raised[k * n + k] *= 1.0 + ridge);
            Cholesky::new(&raised, n)
        })
    }

    fn search(&self, form: &Form, start: &[f64], weights: Option<&Cholesky>) -> Minimum {
        let bounds = self.case.coordinates(form).bounds();
        minimise(start, &bounds, |p| self.misfit(form, p, weights, &self.bins.covariance_m2))
    }

    /// Model minus data in the bins, whitened, or in units of the variance.
    fn misfit(&self, form: &Form, at: &[f64], weights: Option<&Cholesky>, data: &[f64]) -> Vec<f64> {
        self.whitened(&self.mean(&self.case.coordinates(form).decode(at)), weights, data)
    }

    fn whitened(&self, model: &[f64], weights: Option<&Cholesky>, data: &[f64]) -> Vec<f64> {
        let misfit = difference(model, data);
        let scale = self.bins.covariance_m2[0];
        match weights {
            Some(w) => w.whiten(&misfit),
            None => misfit.iter().map(|d| d / scale).collect(),
        }
    }

    /// Fits to other data in the same bins, starting from an estimate and with its weights; for resampling.
    pub fn refits<'e>(&'e self, estimate: &'e Estimate) -> Refits<'e> {
        let weights = estimate.likelihood.as_ref().map(|l| &l.weights);
        let start = self.mean(&self.case.coordinates(&estimate.form).decode(&estimate.at));
        let data = &self.bins.covariance_m2;
        let here = self.whitened(&start, weights, data);
        let slopes = slopes(&estimate.at, &here, |p| self.misfit(&estimate.form, p, weights, data));
        Refits { estimator: self, estimate, start, chord: Chord::new(slopes) }
    }

    /// One of [`Self::refits`].
    pub fn refit(&self, estimate: &Estimate, data: &[f64], threshold_m: f64) -> Minimum {
        self.refits(estimate).to(data, threshold_m)
    }

    /// The fit with one coordinate held at `value` and the others refitted; `None` without a likelihood.
    pub fn held(&self, estimate: &Estimate, coordinate: usize, value: f64) -> Option<Held> {
        let likelihood = estimate.likelihood.as_ref()?;
        let bounds = self.case.coordinates(&estimate.form).bounds();
        let (low, high) = bounds[coordinate];
        let held = value.clamp(low, high);
        let whole = |others: &[f64]| {
            let mut all = others.to_vec();
            all.insert(coordinate, held);
            all
        };
        let mut open = bounds.clone();
        open.remove(coordinate);
        let mut start = estimate.at.clone();
        start.remove(coordinate);
        if [estimate.coordinate(Role::Range(0)), estimate.coordinate(Role::Sigma(0))] == [Some(coordinate), Some(0)] {
            // Start along constant sigma^2 / b, which the data identifies best.
            start[0] += 0.5 * (held - estimate.at[coordinate]);
        }
        let misfit = |others: &[f64]| {
            self.misfit(&estimate.form, &whole(others), Some(&likelihood.weights), &self.bins.covariance_m2)
        };
        let end = rayon::scope(|_| least_squares::minimise_coarsely(&start, &open, misfit));
        Some(Held { rise: (end.value - likelihood.chi2).max(0.0), at: whole(&end.at) })
    }
}

/// Fits to resampled data: a few steps with the slopes at the estimate, and a full search if these do not converge.
pub struct Refits<'e> {
    estimator: &'e Estimator<'e>,
    estimate: &'e Estimate,
    /// The estimate in each bin, trimmed like the data of the case, m2: where every search begins, and the same for all resampled blocks.
    start: Vec<f64>,
    chord: Option<Chord>,
}

impl Refits<'_> {
    /// The fit to these bins, trimmed at `threshold_m`.
    pub fn to(&self, data: &[f64], threshold_m: f64) -> Minimum {
        let Self { estimator, estimate, start, chord } = self;
        let coordinates = estimator.case.coordinates(&estimate.form);
        let weights = estimate.likelihood.as_ref().map(|l| &l.weights);
        let is_trimmed_alike = threshold_m == estimator.case.survey.trim.threshold_m;
        let residuals = |p: &[f64]| match is_trimmed_alike && p == estimate.at {
            true => estimator.whitened(start, weights, data),
            false => {
                estimator.whitened(&estimator.expectation.mean(&coordinates.decode(p), threshold_m), weights, data)
            }
        };
        let bounds = coordinates.bounds();
        let near = chord.as_ref().and_then(|chord| chord.minimise(&estimate.at, &bounds, residuals));
        near.unwrap_or_else(|| minimise(&estimate.at, &bounds, residuals))
    }
}

/// The candidate with the lowest AICc; the first one if none has a likelihood.
pub fn best(estimates: &[Estimate]) -> Option<&Estimate> {
    let criterion = |e: &Estimate| e.aicc().unwrap_or(f64::INFINITY);
    estimates.iter().min_by(|a, b| criterion(a).total_cmp(&criterion(b)))
}

/// Ordinary least-squares fit of the model itself at the mean lags.
pub fn ordinary(case: &Case, form: &Form) -> Estimate {
    let coordinates = case.coordinates(form);
    let scale = case.bins.covariance_m2[0];
    let bounds = coordinates.bounds();
    let ends = coordinates.starts(scale.sqrt(), 0.25 * case.max_lag_m).into_iter().map(|start| {
        minimise(&start, &bounds, |p| {
            let model = at_lags(case, &coordinates.decode(p));
            difference(&model, &case.bins.covariance_m2).iter().map(|d| d / scale).collect()
        })
    });
    // In the thread pool, as [`Estimator::fit`].
    let end = rayon::scope(|_| least(ends));
    let covariance = coordinates.decode(&end.at);
    Estimate { form: form.clone(), covariance, at: end.at, steps: end.steps, likelihood: None }
}

/// A model at the mean lags of the rings.
pub fn at_lags(case: &Case, covariance: &Covariance) -> Vec<f64> {
    case.bins.lag_m.iter().map(|&lag| covariance.at_distance(lag)).collect()
}

/// A model in the rings, before detrending and trimming, m2.
pub fn on_surface(case: &Case, covariance: &Covariance) -> Vec<f64> {
    match covariance.is_isotropic() {
        true => case.bins.average(|lag| covariance.at_distance(length_m(lag, case.geometry.cell))),
        false => case.bins.average(|lag| covariance.at(lag_m(lag, case.geometry.cell))),
    }
}

/// The search result with the smallest sum of squares.
fn least(ends: impl Iterator<Item = Minimum>) -> Minimum {
    let none = Minimum { at: Vec::new(), value: f64::INFINITY, steps: 0 };
    ends.fold(none, |best, end| if end.value < best.value || best.at.is_empty() { end } else { best })
}

/// `a - b`.
pub fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}
