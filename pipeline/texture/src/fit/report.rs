//! The fit file: figures, diagnostics and warnings.

use super::{Case, Estimate, Mode};
use crate::covariance::bins::length_m;
use sastrugi_schemas::fit::{FitFile, Trim};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Naive range over window above which the true range cannot be told (its ceiling for a pure exponential is 0.135).
const NAIVE_RANGE_MAX: f64 = 0.12;
/// Rise of twice the log-likelihood that rules a parameter out at 95 % (chi-squared, one degree of freedom).
const LIKELIHOOD_RISE: f64 = 3.84;
/// Misfit over variance above which the model is called wrong.
const MISFIT_MAX: f64 = 0.05;
/// Share of measured cells taken for outliers above which the site is called cluttered.
const OUTLIER_SHARE_MAX: f64 = 0.1;

pub(super) fn fit_file(case: &Case, naive: &Estimate, estimate: &Estimate) -> FitFile {
    let figures = Figures::of(case, naive, estimate);
    let model = estimate.model;
    FitFile {
        mode: case.settings.mode().name().to_owned(),
        model: case.settings.model.kind().kind.to_owned(),
        parameters: [("sigma_m", model.sigma_m), ("range_m", model.range_m)].map(|(k, v)| (k.to_owned(), v)).into(),
        window_m: Some(case.window.size_m(case.cell_m)),
        trim: Some(Trim {
            level: case.settings.trim(),
            threshold_m: case.trimmed.threshold_m,
            masked_share: 1.0 - figures.share(case.trimmed.kept),
        }),
        cell_m: Some(case.cell_m),
        lags_m: case.bins.lag_m.clone(),
        covariance_m2: case.bins.covariance_m2.clone(),
        pairs: case.bins.pairs.clone(),
        model_m2: estimate.binned.clone(),
        surface_model_m2: case.bins.average(|lag| model.at(length_m(lag, case.cell_m))),
        diagnostics: figures.diagnostics(case, naive, estimate),
        warnings: figures.warnings(case, naive, estimate),
        source: None,
    }
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
    fn of(case: &Case, naive: &Estimate, estimate: &Estimate) -> Self {
        let misfit = super::difference(&case.bins.covariance_m2, &estimate.binned);
        let freedom = (misfit.len() - 2) as f64;
        Self {
            cells: case.detrended.trusted.len(),
            trusted: case.detrended.trusted.iter().filter(|z| !z.is_nan()).count(),
            misfit_m2: (misfit.iter().map(|d| d * d).sum::<f64>() / misfit.len() as f64).sqrt(),
            naive_range_windows: naive.model.range_m / case.window_m(),
            misfit_ratio: estimate.objective.map(|o| o.value / freedom),
        }
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.cells as f64
    }

    fn diagnostics(&self, case: &Case, naive: &Estimate, estimate: &Estimate) -> BTreeMap<String, Value> {
        let (model, detrended, trimmed) = (estimate.model, &case.detrended, &case.trimmed);
        let mut entries = vec![
            ("sigma2_over_range_m", json!(model.sigma_m * model.sigma_m / model.range_m)),
            ("naive_sigma_m", json!(naive.model.sigma_m)),
            ("naive_range_m", json!(naive.model.range_m)),
            ("naive_range_windows", json!(self.naive_range_windows)),
            ("iterations", json!(estimate.iterations)),
            ("misfit_m2", json!(self.misfit_m2)),
            ("lag_max_m", json!(case.max_lag_m)),
            ("window_cells", json!([case.window.cells()[1], case.window.cells()[0]])),
            ("min_valid_share", json!(case.settings.min_valid_share)),
            ("no_data_share", json!(1.0 - self.share(detrended.measured))),
            ("outlier_share", json!(self.share(detrended.measured - self.trusted))),
            ("window_lacks_data_share", json!(self.share(self.trusted - trimmed.detrended))),
            ("trimmed_share", json!(self.share(trimmed.detrended - trimmed.kept))),
        ];
        if let Some(objective) = estimate.objective {
            entries.push(("misfit_chi2_per_freedom", json!(self.misfit_ratio)));
            entries.push(("chi2_rise_at_3b", json!(objective.rise_at_3b)));
        }
        entries.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }

    fn warnings(&self, case: &Case, naive: &Estimate, estimate: &Estimate) -> Vec<String> {
        let (sigma, b) = (estimate.model.sigma_m, estimate.model.range_m);
        let mut warnings = Vec::new();
        if case.settings.mode() == Mode::Paper {
            warnings.push(
                "paper mode: the fit does not correct for the moving average and the trimming, which make sigma and b too \
                 small (19 % and 42 % for an exponential of b = 0.14 windows, 43 % and 76 % at half a window)"
                    .to_owned(),
            );
        }
        if self.naive_range_windows > NAIVE_RANGE_MAX {
            warnings.push(format!(
                "b is not identifiable from this window: the uncorrected fit gives {:.3} m, {:.2} of the window of {:.3} m, \
                 where every exponential ends up near 0.135 or below; sigma^2 / b = {:.4e} m is what the data tells",
                naive.model.range_m,
                self.naive_range_windows,
                case.window_m(),
                sigma * sigma / b
            ));
        }
        if let Some(rise) = estimate.objective.map(|o| o.rise_at_3b / self.misfit_ratio.unwrap_or(1.0).max(1.0))
            && rise < LIKELIHOOD_RISE
        {
            warnings.push(format!("the likelihood is flat: b = {b:.3} m cannot be told from {:.3} m", 3.0 * b));
        }
        let misfit = self.misfit_m2 / case.bins.covariance_m2[0];
        if misfit > MISFIT_MAX {
            warnings.push(format!(
                "the {} model does not describe the residual: its root mean square misfit is {:.1} % of the variance",
                case.settings.model.kind().kind,
                100.0 * misfit
            ));
        }
        let outliers = (case.detrended.measured - self.trusted) as f64 / case.detrended.measured as f64;
        if outliers > OUTLIER_SHARE_MAX {
            warnings.push(format!(
                "{:.1} % of the measured cells were taken for outliers; a site with that many objects is better masked by hand",
                100.0 * outliers
            ));
        }
        warnings
    }
}
