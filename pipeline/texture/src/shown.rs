//! Diagnostics of a fit for display: which cells were used, how much the covariance scatters over the site, and the residual
//! of a texture detrended and trimmed like the measured surface. None of this affects a fitted parameter.

use crate::covariance::masked_covariance;
use crate::fit::residual::residual;
use crate::fit::survey::Trim;
use crate::fit::{FitOutcome, FitParameters, FitSettings};
use crate::sizes::Sizes;
use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::fit::FitFile;
use sastrugi_statistics::normal;

/// Code of a cell that entered the covariance.
pub const USED: u8 = 0;
/// Code of a trimmed cell or an object.
pub const TRIMMED: u8 = 1;
/// Code of a cell whose window has too little data.
pub const BESIDE: u8 = 2;
/// Code of a cell without data.
pub const NO_DATA: u8 = 255;

/// Fewest tiles for a jackknife.
const TILES_MIN: usize = 9;
/// Most tiles along one side.
const TILES_ALONG: usize = 8;
/// Confidence level of the band.
const LEVEL: f64 = 0.95;

/// How each cell of the fitted DEM was used, as one of the codes above; `residual` is that of [`FitOutcome::rasters`].
pub fn uses(dem: &Grid, residual: &Grid, outcome: &FitOutcome) -> Grid<u8> {
    let trusted = outcome.survey.trusted(0..dem.rows(), 0..dem.cols());
    let code = |k: usize| match (dem.values[k].is_finite(), residual.values[k].is_finite()) {
        (false, _) => NO_DATA,
        (true, true) => USED,
        (true, false) if trusted[k] && !outcome.survey.is_used(k) => BESIDE,
        (true, false) => TRIMMED,
    };
    Grid::new(dem.geometry, (0..dem.values.len()).map(code).collect())
}

/// A 95 % band around the empirical covariance of each bin, m2. Standard errors come from a delete-one jackknife (Efron and
/// Stein, 1981) over tiles of the residual, each at least twice the largest lag wide; no model is needed. Empty with fewer
/// than 9 tiles.
pub fn covariance_band(residual: &Grid, outcome: &FitOutcome) -> Vec<[f64; 2]> {
    let max_lag = outcome.survey.covariance.max_lag;
    let shape = [residual.rows(), residual.cols()];
    let along = [0, 1].map(|k| (shape[k] / (2 * max_lag[k]).max(1)).min(TILES_ALONG));
    let places: Vec<[usize; 2]> = (0..along[0]).flat_map(|r| (0..along[1]).map(move |c| [r, c])).collect();
    let of_tile = |place: &[usize; 2]| -> Vec<(f64, f64)> {
        let [from, to] = [0, 1].map(|end| [0, 1].map(|k| (place[k] + end) * shape[k] / along[k]));
        let tile = residual.window(from[0], from[1], to[0] - from[0], to[1] - from[1]);
        let estimate = masked_covariance(&tile.values, tile.cols(), max_lag);
        outcome.bins.bin_sums(&estimate).into_iter().map(|(sum, pairs)| (sum, pairs as f64)).collect()
    };
    let tiles: Vec<Vec<(f64, f64)>> = places.par_iter().map(of_tile).filter(|t| t[0].1 > 0.0).collect();
    if tiles.len() < TILES_MIN {
        return Vec::new();
    }
    let reach = normal::quantile(0.5 + 0.5 * LEVEL);
    let band = |(bin, value): (usize, &f64)| {
        let error = jackknife_error(&tiles.iter().map(|t| t[bin]).collect::<Vec<_>>());
        [value - reach * error, value + reach * error]
    };
    outcome.bins.covariance_m2.iter().enumerate().map(band).collect()
}

/// Standard error of `sum of s / sum of n` over parts `(s, n)`.
fn jackknife_error(parts: &[(f64, f64)]) -> f64 {
    let total = |f: fn(&(f64, f64)) -> f64| sums::sum(&parts.iter().map(f).collect::<Vec<_>>());
    let (s, n) = (total(|p| p.0), total(|p| p.1));
    let without: Vec<f64> = parts.iter().map(|p| (s - p.0) / (n - p.1)).collect();
    ((parts.len() - 1) as f64 * sums::variance(&without)).sqrt()
}

/// The residual of a texture, as the fit would compute it: the moving average over the fit's window is subtracted and the
/// same share of cells is trimmed. `None` if the fit states no window or the texture is less than two windows wide.
pub fn texture_residual(texture: &Grid, fit: &FitFile) -> Option<Grid> {
    let [window_x, window_y] = fit.window_m?;
    let [size_x, size_y] = texture.geometry.size();
    if size_x < 2.0 * window_x || size_y < 2.0 * window_y {
        return None;
    }
    let window = BoxWindow::nearest(0.5 * (window_x + window_y), texture.geometry.cell);
    let settings = settings_of(fit)?;
    let mut residual = residual(&texture.values, texture.cols(), &settings, window);
    Trim::of(&Sizes::of(&residual), &settings).apply(&mut residual);
    Some(Grid::new(texture.geometry, residual))
}

/// The settings of a fit; for a file without settings, the defaults with the file's trimming level.
fn settings_of(fit: &FitFile) -> Option<FitSettings> {
    let stated: Option<FitParameters> = serde_json::from_value(fit.settings.clone()).ok();
    let trim = fit.trim.map_or(FitParameters::default().trim, |t| t.level);
    let parameters = stated.unwrap_or_else(|| FitParameters { trim, ..FitParameters::default() });
    FitSettings::try_from(parameters).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fit;
    use sastrugi_numeric::Streams;
    use serde_json::json;
    use std::sync::LazyLock;

    /// A texture of known covariance with holes, and its fit with two candidate models.
    static FITTED: LazyLock<(Grid, Grid, FitOutcome)> = LazyLock::new(|| {
        let truth = FitFile {
            model: "exponential".into(),
            parameters: [("sigma_m".to_owned(), 0.02), ("range_m".to_owned(), 0.28)].into(),
            ..FitFile::default()
        };
        let size = json!({ "size_m": [16.0, 16.0], "cell_m": 0.1 });
        let synthesis = crate::prepare("fft_ma", &size, &truth).unwrap();
        let mut dem = synthesis.generate(&Streams::for_seed(1, "shown-test")).unwrap().grid;
        (0..dem.values.len()).step_by(31).for_each(|k| dem.values[k] = f64::NAN);
        let parameters: FitParameters =
            serde_json::from_value(json!({ "outer_scale_m": 1.5, "bootstrap": 0, "model": "exponential,gaussian" }))
                .unwrap();
        let settings = FitSettings::try_from(parameters).unwrap();
        let outcome = fit(&dem, &settings, &Streams::for_seed(1, "fit")).unwrap();
        let [_, residual] = outcome.rasters(&dem).unwrap();
        (dem, residual, outcome)
    });

    #[test]
    fn prop_diagnostics_agree_with_the_fit() {
        let (dem, residual, outcome) = &*FITTED;
        let fit = &outcome.fit;
        let codes = uses(dem, residual, outcome);
        let count = |code: u8| codes.values.iter().filter(|c| **c == code).count();
        assert_eq!(count(USED), residual.finite_count());
        assert_eq!(count(NO_DATA), dem.values.len() - dem.finite_count());
        assert_eq!(count(USED) + count(TRIMMED) + count(BESIDE), dem.finite_count());
        assert_eq!(
            count(TRIMMED),
            outcome.survey.measured - outcome.survey.trusted_count + outcome.survey.detrended - outcome.survey.kept
        );

        // The first candidate is the chosen model.
        assert_eq!(fit.candidates.len(), 2);
        assert_eq!(fit.candidates[0].model_m2, fit.model_m2);
        let others = fit.candidates[1].model_m2.iter().zip(&fit.model_m2);
        assert!(others.into_iter().any(|(a, b)| (a - b).abs() > 1e-3 * fit.model_m2[0]));

        let band = covariance_band(residual, outcome);
        assert_eq!(band.len(), fit.lags_m.len());
        for (k, [low, high]) in band.iter().enumerate() {
            let value = fit.covariance_m2[k];
            assert!(low < &value && &value < high && high - low < 0.3 * fit.covariance_m2[0], "{k}: {low} {high}");
        }
    }

    /// With one value per part, the jackknife gives the usual standard error of the mean.
    #[test]
    fn val_jackknife_of_a_mean() {
        let parts = [1.0, 2.0, 4.0, 9.0].map(|v| (v, 1.0));
        let deviations: f64 = parts.iter().map(|p| (p.0 - 4.0) * (p.0 - 4.0)).sum();
        assert!((jackknife_error(&parts) - (deviations / 3.0 / 4.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn val_a_texture_is_treated_as_the_residual_was() {
        let (dem, residual, FitOutcome { fit, .. }) = &*FITTED;
        let texture = dem.map(|z| if z.is_nan() { 0.0 } else { z });
        let residual_of_texture = texture_residual(&texture, fit).unwrap();
        let used = residual_of_texture.finite_count() as f64 / residual_of_texture.values.len() as f64;
        assert!((used - 0.95).abs() < 0.02, "{used}");
        let rms = |g: &Grid| sums::variance(&sums::finite(&g.values)).sqrt();
        assert!((rms(&residual_of_texture) / rms(residual) - 1.0).abs() < 0.05);
        assert!(super::texture_residual(&texture.window(0, 0, 29, 29), fit).is_none());
        assert!(super::texture_residual(&texture, &FitFile::default()).is_none());
    }
}
