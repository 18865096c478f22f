//! Summary of one surface, as the tables record it.

use crate::areal::{ArealParameters, areal_parameters};
use crate::band::band_rms;
use crate::classes::{ClassThresholds, Shares, classify, shares};
use crate::gradient::{moore_gradient, rms_slope};
use crate::heights::{HeightStatistics, HistogramBin, height_statistics, histogram};
use crate::spectrum::{SpectralMap, SpectrumBin, default_slope_band, psd_slope};
use sastrugi_numeric::Grid;
use serde::{Deserialize, Serialize};

/// Default window of the band RMS, cells.
const BAND_CELLS: f64 = 41.0;

/// Settings of [`describe`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DescribeSettings {
    /// Gradient thresholds between the roughness classes.
    pub thresholds: ClassThresholds,
    /// Border excluded from the class shares, m (Majhor and Bos, section 2.3: 5 m).
    pub border_m: f64,
    /// Window of the moving average subtracted for the band RMS, m; default 41 cells.
    pub band_window_m: Option<f64>,
    /// Frequencies between which the slope of the spectrum is fitted, cycles/m; default: from 4 cycles per shorter side to
    /// half the Nyquist frequency.
    pub slope_band_cycles_m: Option<[f64; 2]>,
    /// Lags between which the Hurst exponent is fitted, m; default: from 1 cell to an eighth of the shorter side.
    pub hurst_lags_m: Option<[f64; 2]>,
    /// Bins of the height distribution.
    pub histogram_bins: usize,
}

impl Default for DescribeSettings {
    fn default() -> Self {
        Self {
            thresholds: ClassThresholds::default(),
            border_m: 5.0,
            band_window_m: None,
            slope_band_cycles_m: None,
            hurst_lags_m: None,
            histogram_bins: 64,
        }
    }
}

/// Description of a surface. A statistic that is undefined for the surface is NaN.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Share of cells with data.
    pub valid_share: f64,
    /// Range and moments of the heights.
    pub heights: HeightStatistics,
    /// Root mean square gradient magnitude (central differences), m/m.
    pub rms_slope: f64,
    /// Standard deviation of the heights after the moving average is removed, m.
    pub band_rms_m: f64,
    /// Actual window of that average (mean of east-west and north-south), m.
    pub band_window_m: f64,
    /// Shares of the roughness classes without the border, before closing.
    pub shares: Shares,
    /// Width of that border, m.
    pub share_border_m: f64,
    /// Areal parameters, with heights above the least-squares plane.
    pub areal: ArealParameters,
    /// Radially averaged power spectral density.
    pub spectrum: Vec<SpectrumBin>,
    /// Slope of the spectrum in log-log axes.
    pub psd_slope: f64,
    /// Frequencies between which the slope was fitted, cycles/m.
    pub slope_band_cycles_m: [f64; 2],
    /// Distribution of the heights.
    pub histogram: Vec<HistogramBin>,
}

/// Describes a surface.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::{DescribeSettings, describe};
///
/// let geometry = Geometry::square(40, 50, 1.0);
/// let mut dem = Grid::new(geometry, (0..2000).map(|k| 0.1 * geometry.x(k % 50)).collect());
/// dem.values[..500].fill(f64::NAN);
/// let summary = describe(&dem, &DescribeSettings { histogram_bins: 10, ..DescribeSettings::default() });
/// assert_eq!((summary.valid_share, summary.shares.low, summary.histogram.len()), (0.75, 1.0, 10));
/// assert!((summary.rms_slope - 0.1).abs() < 1e-12);
/// assert!((summary.heights.relief_m - 4.9).abs() < 1e-12);
/// ```
pub fn describe(dem: &Grid, settings: &DescribeSettings) -> Summary {
    describe_classified(dem, &classify(&moore_gradient(dem), &settings.thresholds), settings)
}

/// As [`describe`], from a class map of the surface, before closing, which was made with these thresholds.
pub fn describe_classified(dem: &Grid, classes: &Grid<u8>, settings: &DescribeSettings) -> Summary {
    let window_m = settings.band_window_m.unwrap_or(BAND_CELLS * dem.geometry.mean_cell());
    let (band_rms_m, window) = band_rms(dem, window_m);
    let (map, size) = (SpectralMap::of(dem), dem.geometry.size());
    let spectrum = map.as_ref().map_or_else(Vec::new, SpectralMap::rings);
    let slope_band_cycles_m = settings.slope_band_cycles_m.unwrap_or_else(|| default_slope_band(&dem.geometry));
    let areal = areal_parameters(dem, map.as_ref(), slope_band_cycles_m, settings.hurst_lags_m);
    Summary {
        valid_share: dem.finite_count() as f64 / dem.geometry.len() as f64,
        heights: height_statistics(dem),
        rms_slope: rms_slope(dem),
        band_rms_m,
        band_window_m: 0.5 * (window[0] + window[1]),
        shares: shares(classes, settings.border_m),
        share_border_m: settings.border_m,
        areal,
        psd_slope: psd_slope(&spectrum, slope_band_cycles_m, size[0].min(size[1])),
        spectrum,
        slope_band_cycles_m,
        histogram: histogram(dem, settings.histogram_bins),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    #[test]
    fn val_summary_of_noise() {
        let mut s = Streams::for_seed(1, "summary-test").stream("noise");
        let g = Geometry::square(240, 220, 0.05);
        let dem = Grid::new(g, (0..g.len()).map(|_| 0.01 * s.normal()).collect());
        let summary = describe(&dem, &DescribeSettings::default());
        assert_eq!(summary.valid_share, 1.0);
        let all = summary.shares.low + summary.shares.semi + summary.shares.high;
        assert!((all - 1.0).abs() < 1e-12);
        assert!((summary.band_window_m - 2.05).abs() < 1e-9);
        // 52 800 cells: 7 standard errors of a standard deviation are 2.2 %, and fewer than 3 % of a slope, whose cells share heights. Slopes
        // have a variance of `2 sigma^2 / (2 cell)^2` along each axis.
        assert!((summary.heights.rms_m / 0.01 - 1.0).abs() < 0.022, "{summary:?}");
        assert!((summary.band_rms_m / 0.01 - 1.0).abs() < 0.022, "{}", summary.band_rms_m);
        assert!((summary.rms_slope / 0.2 - 1.0).abs() < 0.03, "{}", summary.rms_slope);
        assert!(summary.psd_slope.abs() < 0.3, "{}", summary.psd_slope);
        assert_eq!(summary.histogram.len(), 64);
    }

    /// Every setting reaches its statistic.
    #[test]
    fn val_settings_are_used() {
        let mut s = Streams::for_seed(2, "summary-test").stream("noise");
        let g = Geometry::square(80, 90, 0.5);
        let mut dem = Grid::new(g, (0..g.len()).map(|_| 1e-3 * s.normal()).collect());
        // Steps of 10 m within the outer two cells.
        for (k, z) in dem.values.iter_mut().enumerate() {
            let (r, c) = (k / 90, k % 90);
            if r.min(79 - r).min(c).min(89 - c) < 2 && (r + c) % 2 == 0 {
                *z += 10.0;
            }
        }
        let settings = DescribeSettings {
            thresholds: ClassThresholds::new(0.1, 0.2).unwrap(),
            border_m: 2.0,
            band_window_m: Some(2.6),
            slope_band_cycles_m: Some([0.1, 0.4]),
            hurst_lags_m: Some([1.0, 5.0]),
            histogram_bins: 8,
        };
        let found = describe(&dem, &settings);
        assert_eq!((found.shares, found.share_border_m), (Shares { low: 1.0, semi: 0.0, high: 0.0 }, 2.0));
        assert_eq!((found.band_window_m, found.slope_band_cycles_m, found.histogram.len()), (2.5, [0.1, 0.4], 8));
        // Half an octave apart: 2, 3, 4, 6 and 8 cells; 11 are above 5 m.
        assert_eq!(found.areal.hurst.unwrap().lags_m, [1.0, 4.0]);
        let whole = describe(&dem, &DescribeSettings { border_m: 0.0, ..settings.clone() });
        assert!(whole.shares.low < 1.0 && whole.shares.high > 0.0, "{:?}", whole.shares);
        let all_high = DescribeSettings { thresholds: ClassThresholds::new(1e-12, 2e-12).unwrap(), ..settings };
        assert_eq!(describe(&dem, &all_high).shares.high, 1.0);
    }

    /// Shares are those of the given classes; nothing else depends on them.
    #[test]
    fn val_given_classes_are_used() {
        let mut s = Streams::for_seed(3, "summary-test").stream("noise");
        let g = Geometry::square(60, 70, 0.5);
        let dem = Grid::new(g, (0..g.len()).map(|_| 0.2 * s.normal()).collect());
        let settings = DescribeSettings { border_m: 1.0, ..DescribeSettings::default() };
        let own = classify(&moore_gradient(&dem), &settings.thresholds);
        let described = describe(&dem, &settings);
        assert!(described.shares.low < 1.0, "{:?}", described.shares);
        assert_eq!(format!("{:?}", describe_classified(&dem, &own, &settings)), format!("{described:?}"));
        let low = describe_classified(&dem, &Grid::filled(g, 0), &settings);
        assert_eq!(low.shares, Shares { low: 1.0, semi: 0.0, high: 0.0 });
        assert_eq!(format!("{:?}", Summary { shares: described.shares, ..low }), format!("{described:?}"));
    }

    #[test]
    fn prop_nothing_panics_on_degenerate_grids() {
        for (rows, cols) in [(1, 1), (1, 7), (2, 2), (3, 3), (5, 1)] {
            for value in [f64::NAN, 0.0, 1e300] {
                let dem = Grid::filled(Geometry::square(rows, cols, 0.5), value);
                let summary = describe(&dem, &DescribeSettings::default());
                assert!(summary.psd_slope.is_nan() && summary.shares.low.is_nan());
            }
        }
    }
}
