//! Statistics of a box plot.

use sastrugi_numeric::sums::quantile_sorted;

/// Whiskers extend to the last value within this many interquartile ranges of the box (Tukey, 1977).
pub const WHISKER_REACH: f64 = 1.5;

/// A box plot: quartiles by linear interpolation between order statistics (type 7 of Hyndman and Fan, 1996), whiskers
/// at the extreme values within 1.5 interquartile ranges of the box; every value beyond them is an outlier.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxPlot {
    /// Number of values.
    pub count: usize,
    /// Lowest value that is not an outlier.
    pub whisker_low: f64,
    /// First quartile.
    pub quartile_low: f64,
    /// Median.
    pub median: f64,
    /// Third quartile.
    pub quartile_high: f64,
    /// Highest value that is not an outlier.
    pub whisker_high: f64,
    /// Values beyond the whiskers, ascending.
    pub outliers: Vec<f64>,
}

impl BoxPlot {
    /// The box plot of values in any order; values that are not finite are left out. `None` if none is left.
    ///
    /// ```
    /// use sastrugi_statistics::BoxPlot;
    ///
    /// let plot = BoxPlot::of(&[5.0, 1.0, 4.0, 2.0, 3.0, 90.0, f64::NAN]).unwrap();
    /// assert_eq!((plot.count, plot.median), (6, 3.5));
    /// assert_eq!((plot.whisker_low, plot.whisker_high, plot.outliers), (1.0, 5.0, vec![90.0]));
    /// ```
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

    /// By hand: quartiles of 1..9 are 3, 5, 7; the whiskers extend up to 6 beyond the box, so 13 would be inside and 14 not.
    #[test]
    fn val_box_plot_by_hand() {
        let b = BoxPlot::of(&[9.0, 1.0, 8.0, 2.0, 7.0, 3.0, 6.0, 4.0, 5.0]).unwrap();
        assert_eq!((b.quartile_low, b.median, b.quartile_high), (3.0, 5.0, 7.0));
        assert_eq!((b.whisker_low, b.whisker_high, b.outliers.len()), (1.0, 9.0, 0));
        let b = BoxPlot::of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 30.0, f64::NAN]).unwrap();
        assert_eq!((b.count, b.whisker_high, b.outliers), (9, 8.0, vec![30.0]));
    }

    /// By hand: quartiles 3 and 7, so the fences are -3 and 13. A value on a fence belongs to the whisker, a value beyond it is an outlier.
    #[test]
    fn val_fences_belong_to_the_whiskers() {
        let of = |low: f64, high: f64| BoxPlot::of(&[low, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, high]).unwrap();
        let on = of(-3.0, 13.0);
        assert_eq!((on.whisker_low, on.whisker_high, on.outliers.len()), (-3.0, 13.0, 0));
        let beyond = of(-3.5, 13.5);
        assert_eq!((beyond.whisker_low, beyond.whisker_high, beyond.outliers), (2.0, 8.0, vec![-3.5, 13.5]));
    }

    /// Against numpy 2, numpy.quantile with method "linear", and Tukey's fences (`tests/statistical/nested_tests.py`).
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
