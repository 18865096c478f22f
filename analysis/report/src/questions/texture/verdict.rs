//! Whether a texture is like the measured surface: yes, no, or cannot tell.
//!
//! The residual of the DEM is compared with that of the texture, which went through the same detrending and trimming. Each figure has a
//! margin within which two surfaces count as alike. The scatter of a figure over ground of that size comes from the covariance of the
//! residual, as for a normal field: var(ln Sq) = I2 / 2 A, var(Ssk) = 6 I3 / A, var(Sku) = 24 I4 / A, where A is the area and Ik the
//! integral of the k-th power of the correlation over all lags (Lomnicki, 1961). Slopes and increments are correlated over less ground
//! than heights are, so that they scatter less than the scatter taken here, that of Sq.
//!
//! * Yes: every difference lies within its margin with its interval of 90 % (two one-sided tests at 5 %; a wrong yes has a probability
//!   of at most 5 %, since all must pass; Berger, 1982).
//! * No: a difference lies beyond its margin with an interval that leaves 5 % over all figures together (Bonferroni).
//! * Cannot tell: neither.
//!
//! Sigma and range were given to the texture; heights, slopes and increments below the scale of the fit were not, or not exactly. What
//! was fitted is judged on ground that was not by `sastrugi compare DEM --split-half`.

use super::figures::residual_id;
use crate::data::Data;
use crate::render::number as set;
use sastrugi_schemas::tables::{CovarianceRow, SurfaceRow, TerrainRow};
use sastrugi_statistics::normal;
use std::f64::consts::PI;

/// Largest ratio, as its logarithm, of figures of length that are alike: about 10 %.
const RATIO_MARGIN: f64 = 0.1;
/// Largest difference of skewnesses that are alike.
const SKEWNESS_MARGIN: f64 = 0.25;
/// Largest difference of kurtoses that are alike.
const KURTOSIS_MARGIN: f64 = 0.5;
/// Level of a yes, and of a no over all figures.
const ALPHA: f64 = 0.05;
/// Longest lag of the increments that are compared, over the window of the fit.
const LAG_MAX: f64 = 0.5;

/// A figure of both surfaces.
struct Compared {
    name: &'static str,
    /// In words: of the measured surface, then of the texture.
    values: [String; 2],
    /// Texture less measured.
    difference: f64,
    /// Its standard deviation.
    scatter: f64,
    margin: f64,
}

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Alike in every figure.
    Yes,
    /// Unlike in one at least.
    No,
    /// The ground is too small to tell.
    CannotTell,
}

/// Answer and sentence for a texture of a fit; `None` where the release does not describe both surfaces.
pub fn of_texture(data: &Data, texture: &TerrainRow, fit: &str) -> Option<(Answer, String)> {
    let compared = compared(data, texture, fit)?;
    let (yes, no) = (normal::quantile(1.0 - ALPHA), normal::quantile(1.0 - 0.5 * ALPHA / compared.len() as f64));
    let beyond: Vec<&Compared> = compared.iter().filter(|c| c.difference.abs() - no * c.scatter > c.margin).collect();
    let open: Vec<&Compared> = compared.iter().filter(|c| c.difference.abs() + yes * c.scatter > c.margin).collect();
    let values = |c: &&Compared| format!("{} {} measured, {} of the texture", c.name, c.values[0], c.values[1]);
    let list = |all: &[&Compared]| all.iter().map(values).collect::<Vec<_>>().join("; ");
    Some(if !beyond.is_empty() {
        (Answer::No, format!("No: {}.", list(&beyond)))
    } else if open.is_empty() {
        let names: Vec<&str> = compared.iter().map(|c| c.name).collect();
        (Answer::Yes, format!("Yes, within the margins: {}.", names.join(", ")))
    } else {
        (Answer::CannotTell, format!("Cannot tell, on so little ground: {}.", list(&open)))
    })
}

/// What the sentence rests on.
pub fn method() -> String {
    format!(
        "Compared are the residual of the DEM and that of the texture after the same detrending and trimming: RMS height, RMS slope and \
         increments are alike within {}, skewness within {}, kurtosis within {}. The scatter of each over ground of this size follows from the \
         covariance, as for a normal field (Lomnicki, 1961). A yes is wrong with a probability of at most {}, and so is a no, over all figures \
         together. The texture was given sigma and range: `sastrugi compare DEM --split-half` judges it by ground that was not fitted.",
        set::percent(libm::exp(RATIO_MARGIN) - 1.0, 0),
        set::plain(SKEWNESS_MARGIN, 2),
        set::plain(KURTOSIS_MARGIN, 2),
        set::percent(ALPHA, 0)
    )
}

fn compared(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Vec<Compared>> {
    let residual = residual_id(texture);
    let surfaces = [data.surface(fit)?, data.surface(&residual)?];
    let rings: Vec<&CovarianceRow> =
        data.covariance.iter().filter(|r| r.fit_id == fit && r.azimuth_deg.is_none()).collect();
    let per_area: f64 = surfaces.iter().map(|s| 1.0 / area_m2(s)).sum();
    let scatter = |factor: f64, power: i32| (factor * correlated_m2(&rings, power) * per_area).sqrt();
    let (of_ratios, of_skewness, of_kurtosis) = (scatter(0.5, 2), scatter(6.0, 3), scatter(24.0, 4));
    let ratio = |name: &'static str, values: [f64; 2], unit: &str| Compared {
        name,
        values: values.map(|v| set::with_unit(v, 3, unit)),
        difference: libm::log(values[1] / values[0]),
        scatter: of_ratios,
        margin: RATIO_MARGIN,
    };
    let shape = |name: &'static str, values: [f64; 2], scatter: f64, margin: f64| Compared {
        name,
        values: values.map(|v| set::fixed(v, 2)),
        difference: values[1] - values[0],
        scatter,
        margin,
    };
    let window_m = data.fits.iter().find(|f| f.fit_id == fit).map(|f| f.window_x_m.min(f.window_y_m))?;
    let mut all = vec![
        ratio("RMS height", surfaces.map(|s| s.sq_m), "m"),
        ratio("RMS slope", surfaces.map(|s| s.sdq), ""),
        shape("skewness", surfaces.map(|s| s.ssk), of_skewness, SKEWNESS_MARGIN),
        shape("kurtosis", surfaces.map(|s| s.sku), of_kurtosis, KURTOSIS_MARGIN),
    ];
    all.extend(increments(data, [fit, &residual], LAG_MAX * window_m).map(|v| ratio("RMS increment", v, "m")));
    all.iter().all(|c| c.difference.is_finite() && c.scatter.is_finite()).then_some(all)
}

/// Ground with data, m².
fn area_m2(surface: &SurfaceRow) -> f64 {
    surface.cells as f64 * surface.valid_share * surface.cell_x_m * surface.cell_y_m
}

/// Integral of a power of the correlation over the plane, m², by trapezoids over rings; what lies beyond the last bin is uncorrelated.
fn correlated_m2(rings: &[&CovarianceRow], power: i32) -> f64 {
    let Some(variance_m2) = rings.first().map(|r| r.covariance_m2).filter(|v| *v > 0.0) else { return f64::NAN };
    let value = |r: &CovarianceRow| 2.0 * PI * r.lag_m * (r.covariance_m2 / variance_m2).powi(power);
    rings.windows(2).map(|w| 0.5 * (value(w[0]) + value(w[1])) * (w[1].lag_m - w[0].lag_m)).sum::<f64>().abs()
}

/// Root mean square increments at the shared lag where they differ most, up to a lag, m.
fn increments(data: &Data, surfaces: [&str; 2], lag_max_m: f64) -> Option<[f64; 2]> {
    let [measured, texture] = surfaces.map(|id| data.structure_of(id, "all"));
    let near = |lag_m: f64| {
        texture.iter().min_by(|a, b| (a.lag_m - lag_m).abs().total_cmp(&(b.lag_m - lag_m).abs())).filter(|r| {
            let apart = (r.lag_m - lag_m).abs();
            apart <= 1e-6 * lag_m
        })
    };
    let pairs = measured.iter().filter(|r| r.lag_m <= lag_max_m).filter_map(|r| Some([r.value_m2, near(r.lag_m)?.value_m2]));
    let far = |pair: &[f64; 2]| libm::log(pair[1] / pair[0]).abs();
    pairs.max_by(|a, b| far(a).total_cmp(&far(b))).map(|pair| pair.map(f64::sqrt))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(bin: i64, lag_m: f64, covariance_m2: f64) -> CovarianceRow {
        CovarianceRow {
            fit_id: "f".into(),
            bin,
            lag_m,
            azimuth_deg: None,
            covariance_m2,
            pairs: 1,
            model_m2: covariance_m2,
            surface_model_m2: covariance_m2,
            covariance_low_m2: f64::NAN,
            covariance_high_m2: f64::NAN,
        }
    }

    /// Of exp(-h / b), the integral of the k-th power is 2 pi (b / k)².
    #[test]
    fn val_integrals_of_an_exponential_correlation() {
        let rows: Vec<CovarianceRow> = (0..2000).map(|k| ring(k, 0.01 * k as f64, 4.0 * (-0.01 * k as f64).exp())).collect();
        let rings: Vec<&CovarianceRow> = rows.iter().collect();
        for power in [2, 3, 4] {
            let exact = 2.0 * PI / f64::from(power * power);
            let found = correlated_m2(&rings, power);
            assert!((found / exact - 1.0).abs() < 1e-3, "{power}: {found} for {exact}");
        }
    }
}
