//! Distribution of the heights.

use sastrugi_numeric::{Grid, sums};
use serde::Serialize;

/// Moments and range of the heights of the cells with data; NaN if there are none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HeightStatistics {
    /// Lowest height, m.
    pub min_m: f64,
    /// Highest height, m.
    pub max_m: f64,
    /// Highest minus lowest height, m.
    pub relief_m: f64,
    /// Standard deviation about the mean (divided by n), m.
    pub rms_m: f64,
    /// Third central moment over the cubed standard deviation; NaN on a flat surface.
    pub skewness: f64,
    /// Fourth central moment over the fourth power of the standard deviation (3 for a normal distribution); NaN on a flat
    /// surface.
    pub kurtosis: f64,
}

/// Statistics of the heights.
pub fn height_statistics(dem: &Grid) -> HeightStatistics {
    let heights = sums::finite(&dem.values);
    let (min_m, max_m) = dem.range().unwrap_or((f64::NAN, f64::NAN));
    let mean = sums::mean(&heights);
    let moment = |power: fn(f64) -> f64| sums::mean(&heights.iter().map(|z| power(z - mean)).collect::<Vec<_>>());
    let variance = moment(|d| d * d);
    HeightStatistics {
        min_m,
        max_m,
        relief_m: max_m - min_m,
        rms_m: variance.sqrt(),
        skewness: moment(|d| d * d * d) / (variance * variance.sqrt()),
        kurtosis: moment(|d| d * d * d * d) / (variance * variance),
    }
}

/// One bin of a histogram of heights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HistogramBin {
    /// Lower edge, m.
    pub low_m: f64,
    /// Upper edge, m.
    pub high_m: f64,
    /// Cells in the bin.
    pub cells: u64,
    /// Share of the cells with data per metre of height, 1/m.
    pub density_per_m: f64,
}

/// Histogram with `bins` bins of equal width from the lowest to the highest height (which belongs to the last bin). Empty
/// if no cell has data or all heights are equal.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::histogram;
///
/// let dem = Grid::new(Geometry::square(1, 5, 1.0), vec![0.0, 1.0, 1.0, 4.0, f64::NAN]);
/// let bins = histogram(&dem, 2);
/// assert_eq!((bins[0].low_m, bins[0].high_m, bins[0].cells, bins[1].cells), (0.0, 2.0, 3, 1));
/// // Three of the four cells with data, on 2 m of height.
/// assert_eq!(bins[0].density_per_m, 0.375);
/// ```
pub fn histogram(dem: &Grid, bins: usize) -> Vec<HistogramBin> {
    let Some((low, high)) = dem.range().filter(|(low, high)| high > low) else { return Vec::new() };
    let edge = |k: usize| low + (high - low) * (k as f64 / bins as f64);
    let mut counts = vec![0u64; bins];
    for z in dem.values.iter().filter(|z| z.is_finite()) {
        let bin = ((z - low) / (high - low) * bins as f64) as usize;
        if let Some(count) = counts.get_mut(bin.min(bins.saturating_sub(1))) {
            *count += 1;
        }
    }
    let all = counts.iter().sum::<u64>() as f64;
    let bin = |(k, &cells): (usize, &u64)| {
        let (low_m, high_m) = (edge(k), edge(k + 1));
        HistogramBin { low_m, high_m, cells, density_per_m: cells as f64 / (all * (high_m - low_m)) }
    };
    counts.iter().enumerate().map(bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    #[test]
    fn val_moments_of_known_heights() {
        let dem = Grid::new(Geometry::square(1, 5, 1.0), vec![0.0, 0.0, 0.0, 4.0, f64::NAN]);
        let s = height_statistics(&dem);
        assert_eq!((s.min_m, s.max_m, s.relief_m), (0.0, 4.0, 4.0));
        // Mean 1, deviations -1, -1, -1, 3: moments 3, 6, 21.
        assert!((s.rms_m - 3.0f64.sqrt()).abs() < 1e-15);
        assert!((s.skewness - 6.0 / 27.0f64.sqrt()).abs() < 1e-14 && (s.kurtosis - 21.0 / 9.0).abs() < 1e-14);
    }

    #[test]
    fn val_no_data_and_flat() {
        let empty = Grid::filled(Geometry::square(3, 3, 1.0), f64::NAN);
        let s = height_statistics(&empty);
        assert!(s.min_m.is_nan() && s.rms_m.is_nan() && histogram(&empty, 8).is_empty());
        let flat = height_statistics(&Grid::filled(empty.geometry, 2.0));
        assert!(flat.rms_m == 0.0 && flat.kurtosis.is_nan());
    }

    #[test]
    fn prop_a_histogram_counts_every_cell_once() {
        let mut s = Streams::for_seed(1, "heights-test").stream("noise");
        let dem = Grid::new(Geometry::square(40, 30, 1.0), (0..1200).map(|_| s.normal()).collect());
        let bins = histogram(&dem, 16);
        assert_eq!(bins.iter().map(|b| b.cells).sum::<u64>(), 1200);
        let area: f64 = bins.iter().map(|b| b.density_per_m * (b.high_m - b.low_m)).sum();
        assert!((area - 1.0).abs() < 1e-12);
        let counted = |b: &HistogramBin| dem.values.iter().filter(|&&z| z >= b.low_m && z < b.high_m).count() as u64;
        assert!(bins[..15].iter().all(|b| b.cells.abs_diff(counted(b)) <= 1));
        assert!(histogram(&dem, 0).is_empty());
    }
}
