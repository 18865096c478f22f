//! Figures of a box plot.

use sastrugi_numeric::sums::quantile_sorted;

/// Whiskers reach to the last value within this many interquartile ranges of the box (Tukey, 1977).
pub const WHISKER_REACH: f64 = 1.5;

/// A box plot: quartiles by linear interpolation between order statistics (type 7 of Hyndman and Fan, 1996), whiskers
/// at the extreme values within 1.5 interquartile ranges of the box, every value beyond them an outlier.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxPlot {
    /// Number of values.
    pub count: usize,
    /// Lowest value that is no outlier.
    pub whisker_low: f64,
    /// First quartile.
    pub quartile_low: f64,
    /// Median.
    pub median: f64,
    /// Third quartile.
    pub quartile_high: f64,
    /// Highest value that is no outlier.
    pub whisker_high: f64,
    /// Values beyond the whiskers, ascending.
    pub outliers: Vec<f64>,
}

impl BoxPlot {
    /// The box plot of the values in any order; values that are not finite are left out. `None` when none is left.
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = sastrugi_numeric::sums::finite(values);
        sorted.sort_by(f64::total_cmp);
        let [quartile_low, median, quartile_high] = [0.25, 0.5, 0.75].map(|q| quantile_sorted(&sorted, q));
        let reach = WHISKER_REACH * (quartile_high - quartile_low);
        let inside = |v: &f64| *v >= quartile_low - reach && *v <= quartile_high + reach;
        Some(Self {
            count: sorted.len(),
            whisker_low: sorted.iter().copied().find(inside)?,
            quartile_low,
            median,
            quartile_high,
            whisker_high: sorted.iter().copied().rfind(inside)?,
            outliers: sorted.iter().copied().filter(|v| !inside(v)).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: quartiles of 1..9 are 3, 5, 7; the reach is 6, so 13 is inside and 14 is not.
    #[test]
    fn val_box_plot_by_hand() {
        let b = BoxPlot::of(&[9.0, 1.0, 8.0, 2.0, 7.0, 3.0, 6.0, 4.0, 5.0]).unwrap();
        assert_eq!((b.quartile_low, b.median, b.quartile_high), (3.0, 5.0, 7.0));
        assert_eq!((b.whisker_low, b.whisker_high, b.outliers.len()), (1.0, 9.0, 0));
        let b = BoxPlot::of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 30.0, f64::NAN]).unwrap();
        assert_eq!((b.count, b.whisker_high, b.outliers), (9, 8.0, vec![30.0]));
    }

    /// numpy 2, numpy.quantile with method "linear", and Tukey's fences (`tests/statistical/nested_tests.py`).
    #[test]
    fn val_of_numpy() {
        let b = BoxPlot::of(&[1.5, -0.5, 3.0, 0.0, 2.5, 0.5, -1.0, 4.0, 12.0, -9.0]).unwrap();
        assert_eq!((b.quartile_low, b.median, b.quartile_high), (-0.375, 1.0, 2.875));
        assert_eq!((b.whisker_low, b.whisker_high, b.outliers), (-1.0, 4.0, vec![-9.0, 12.0]));
    }

    #[test]
    fn val_degenerate_samples() {
        assert_eq!(BoxPlot::of(&[]), None);
        assert_eq!(BoxPlot::of(&[f64::NAN, f64::INFINITY]), None);
        let one = BoxPlot::of(&[2.5]).unwrap();
        assert_eq!((one.whisker_low, one.median, one.whisker_high), (2.5, 2.5, 2.5));
    }
}
