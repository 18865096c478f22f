//! Quantiles of absolute values from a histogram, for rasters that never fit into memory at once.
//!
//! Values are binned by the leading bits of their absolute value: the exponent and 12 bits of the mantissa, so that a class
//! is at most 1/4096 of its lower end wide. Values are assumed uniform within a class; a quantile of many values then has a
//! relative error of a few 1e-6. Values below 2^-40 share the first class, values above 2^40 the last.

use sastrugi_numeric::sums;

/// Number of mantissa bits kept.
const MANTISSA_BITS: u32 = 12;
const SHIFT: u32 = 52 - MANTISSA_BITS;
/// Classes span 2^-40 to 2^40.
const EXPONENT_MAX: i32 = 40;
const FIRST: u64 = ((1023 - EXPONENT_MAX) as u64) << MANTISSA_BITS;
const CLASSES: usize = (2 * EXPONENT_MAX as usize) << MANTISSA_BITS;

/// Standard deviation of a normal variable over its median absolute value (Hampel, 1974).
pub(crate) const NORMAL_CONSISTENCY: f64 = 1.482_602_218_505_602;

/// Histogram of absolute values.
pub(crate) struct Sizes {
    counts: Vec<u64>,
    total: u64,
    /// First class with values and the one after the last, usually a quarter of all; no value: [`CLASSES`] and 0.
    first: usize,
    end: usize,
}

impl Sizes {
    /// An empty histogram.
    pub fn new() -> Self {
        Self { counts: vec![0; CLASSES], total: 0, first: CLASSES, end: 0 }
    }

    /// Histogram of the values that are not NaN.
    pub fn of(values: &[f64]) -> Self {
        let mut sizes = Self::new();
        sizes.add(values);
        sizes
    }

    /// Adds the values that are not NaN.
    pub fn add(&mut self, values: &[f64]) {
        let (mut first, mut end) = (self.first, self.end);
        for value in values.iter().filter(|v| !v.is_nan()) {
            let class = (value.abs().to_bits() >> SHIFT).saturating_sub(FIRST) as usize;
            let class = class.min(CLASSES - 1);
            self.counts[class] += 1;
            self.total += 1;
            (first, end) = (first.min(class), end.max(class + 1));
        }
        (self.first, self.end) = (first, end);
    }

    /// The classes with values, and how many they hold.
    fn counted(&self) -> impl Iterator<Item = (usize, u64)> {
        let occupied = self.counts.get(self.first..self.end).unwrap_or_default();
        (self.first..).zip(occupied.iter().copied()).filter(|(_, count)| *count > 0)
    }

    /// Number of values counted.
    pub fn count(&self) -> u64 {
        self.total
    }

    /// The sum of two histograms.
    pub fn with(mut self, others: &Self) -> Self {
        self.counts.iter_mut().zip(&others.counts).for_each(|(own, other)| *own += other);
        self.total += others.total;
        (self.first, self.end) = (self.first.min(others.first), self.end.max(others.end));
        self
    }

    /// Root mean square of the values; NaN without any. Relative error below 1e-4.
    pub fn root_mean_square(&self) -> f64 {
        let squares: Vec<f64> = self
            .counted()
            .map(|(class, count)| {
                let [low, high] = ends(class);
                count as f64 * (low * low + low * high + high * high) / 3.0
            })
            .collect();
        (sums::sum(&squares) / self.total as f64).sqrt()
    }

    /// The absolute value that a share `level` of the values exceeds; NaN without values.
    pub fn exceeded_by(&self, level: f64) -> f64 {
        let rank = (1.0 - level) * self.total as f64;
        let mut below = 0.0;
        for (class, count) in self.counted() {
            let here = count as f64;
            if below + here >= rank {
                let [low, high] = ends(class);
                return low + (high - low) * ((rank - below) / here);
            }
            below += here;
        }
        f64::NAN
    }
}

/// Lower and upper end of a class.
fn ends(class: usize) -> [f64; 2] {
    let end = |class: usize| f64::from_bits((FIRST + class as u64) << SHIFT);
    [if class == 0 { 0.0 } else { end(class) }, end(class + 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    /// Against sorting, with 1e5 normal values: a class 1/4096 wide holds about 20 of them, so quantiles are good to 1/4096.
    #[test]
    fn val_quantiles_are_those_of_sorted_values() {
        let mut s = Streams::for_seed(1, "sizes-test").stream("values");
        let values: Vec<f64> = (0..100_000).map(|k| if k % 9 == 0 { f64::NAN } else { 0.03 * s.normal() }).collect();
        let sizes = Sizes::of(&values);
        let mut sorted: Vec<f64> = values.iter().filter(|v| !v.is_nan()).map(|v| v.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        for level in [0.01, 0.05, 0.5, 0.9] {
            let expected = sorted[((1.0 - level) * sorted.len() as f64) as usize];
            assert!((sizes.exceeded_by(level) / expected - 1.0).abs() < 3e-4, "{level}");
        }
        let squares = sums::mean(&sorted.iter().map(|v| v * v).collect::<Vec<_>>());
        assert!((sizes.root_mean_square() / squares.sqrt() - 1.0).abs() < 1e-4);
        assert!(Sizes::new().root_mean_square().is_nan());
        assert!(Sizes::new().exceeded_by(0.5).is_nan());
        assert!(Sizes::of(&[0.0; 5]).exceeded_by(0.5) < 1e-12);
        // All of these are in the last class, which ends at 2^40.
        let largest = Sizes::of(&[1e300, -1e300, f64::INFINITY]).exceeded_by(0.1);
        assert!((largest / libm::exp2(40.0) - 1.0).abs() < 3e-4, "{largest:e}");
    }

    /// The sum of two histograms is that of all values together, and signs do not count.
    #[test]
    fn prop_histograms_add() {
        let values = [0.5, -0.25, 3.0, f64::NAN, -7.0, 0.125];
        let both = Sizes::of(&values[..3]).with(&Sizes::of(&values[3..]));
        let all = Sizes::of(&values.map(|v| -v));
        assert_eq!((both.count(), both.counts == all.counts), (5, true));
        assert_eq!(both.exceeded_by(0.3), all.exceeded_by(0.3));
        // A value at the lower end of its class: 2 of 5 values exceed 0.5, up to the width of a class.
        assert!((both.exceeded_by(0.4) / 0.5 - 1.0).abs() < 3e-4, "{}", both.exceeded_by(0.4));
    }
    /// Every value lies in the classes that quantiles look at, whatever the parts in which values came.
    #[test]
    fn prop_no_class_is_left_out() {
        let values = [0.5, -0.25, 3.0, f64::NAN, -7.0, 0.0, 1e300, 0.125];
        for n in 0..=values.len() {
            let mut parts = Sizes::of(&values[..n]);
            parts.add(&values[n..]);
            for sizes in [parts, Sizes::of(&values[..n]).with(&Sizes::of(&values[n..]))] {
                let all: Vec<(usize, u64)> = (0..).zip(sizes.counts.iter().copied()).filter(|(_, n)| *n > 0).collect();
                assert_eq!((sizes.counted().collect::<Vec<_>>(), all.len()), (all, 7));
            }
        }
        assert_eq!(Sizes::new().counted().count(), 0);
    }
}
