//! Everything the tables say about one heightfield.

use crate::areal::{ArealFigures, areal_figures};
use crate::band::band_rms;
use crate::classes::{ClassThresholds, Shares, classify, shares};
use crate::gradient::{moore_gradient, rms_slope};
use crate::heights::{HeightStatistics, HistogramBin, height_statistics, histogram};
use crate::spectrum::{SpectralMap, SpectrumBin, default_slope_band, psd_slope};
use sastrugi_numeric::Grid;
use serde::{Deserialize, Serialize};

/// Window of the band roughness in cells, when no length is given.
const BAND_CELLS: f64 = 41.0;

/// How a heightfield is described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DescribeSettings {
    /// Gradients that part the roughness classes.
    pub thresholds: ClassThresholds,
    /// Border left out of the class shares, m (Majhor and Bos, section 2.3: 5 m).
    pub border_m: f64,
    /// Window of the moving average below which the band roughness is taken, m; 41 cells when not given.
    pub band_window_m: Option<f64>,
    /// Frequencies between which the slope of the spectrum is fitted, cycles/m; from 4 cycles per shorter side to half
    /// the Nyquist frequency when not given.
    pub slope_band_cycles_m: Option<[f64; 2]>,
    /// Lags between which the Hurst exponent is fitted, m; from 1 cell to an eighth of the shorter side when not given.
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

/// Description of a heightfield. NaN stands for a figure that the heightfield does not have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Share of cells with data.
    pub valid_share: f64,
    /// Range and moments of the heights.
    pub heights: HeightStatistics,
    /// Root mean square of the gradient's magnitude (central differences), m/m.
    pub rms_slope: f64,
    /// Standard deviation of the heights after the moving average is removed, m.
    pub band_rms_m: f64,
    /// True window of that average (mean of east-west and north-south), m.
    pub band_window_m: f64,
    /// Shares of the roughness classes without the border, from the map that is not closed.
    pub shares: Shares,
    /// That border, m.
    pub share_border_m: f64,
    /// Areal figures above the least-squares plane.
    pub areal: ArealFigures,
    /// Radially averaged power spectral density.
    pub spectrum: Vec<SpectrumBin>,
    /// Slope of the spectrum in log-log axes.
    pub psd_slope: f64,
    /// Frequencies between which it was fitted, cycles/m.
    pub slope_band_cycles_m: [f64; 2],
    /// Distribution of the heights.
    pub histogram: Vec<HistogramBin>,
}

/// Describes a heightfield.
pub fn describe(dem: &Grid, settings: &DescribeSettings) -> Summary {
    let classes = classify(&moore_gradient(dem), &settings.thresholds);
    let window_m = settings.band_window_m.unwrap_or(BAND_CELLS * dem.geometry.mean_cell());
    let (band_rms_m, window) = band_rms(dem, window_m);
    let (map, size) = (SpectralMap::of(dem), dem.geometry.size());
    let spectrum = map.as_ref().map_or_else(Vec::new, SpectralMap::rings);
    let slope_band_cycles_m = settings.slope_band_cycles_m.unwrap_or_else(|| default_slope_band(&dem.geometry));
    let areal = areal_figures(dem, map.as_ref(), slope_band_cycles_m, settings.hurst_lags_m);
    Summary {
        valid_share: dem.finite_count() as f64 / dem.geometry.len() as f64,
        heights: height_statistics(dem),
        rms_slope: rms_slope(dem),
        band_rms_m,
        band_window_m: 0.5 * (window[0] + window[1]),
        shares: shares(&classes, settings.border_m),
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
    fn val_a_heightfield_is_described_in_full() {
        let mut s = Streams::for_seed(1, "summary-test").stream("noise");
        let g = Geometry::square(240, 220, 0.05);
        let dem = Grid::new(g, (0..g.len()).map(|_| 0.01 * s.normal()).collect());
        let summary = describe(&dem, &DescribeSettings::default());
        assert_eq!(summary.valid_share, 1.0);
        let all = summary.shares.low + summary.shares.semi + summary.shares.high;
        assert!((all - 1.0).abs() < 1e-12);
        assert!((summary.band_window_m - 2.05).abs() < 1e-9);
        assert!((summary.heights.rms_m - 0.01).abs() < 1e-3 && (summary.band_rms_m - 0.01).abs() < 1e-3);
        assert!(summary.psd_slope.abs() < 0.3 && summary.rms_slope > 0.1);
        assert_eq!(summary.histogram.len(), 64);
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
