//! Isotropic lag bins.
//!
//! Bin k holds the lags whose length rounds to k bin widths; bin 0 is lag zero alone. A bin's covariance is the sum of
//! all products over the number of all pairs, and a model is brought to the bins in the same way, so that the width of a
//! bin biases nothing.

use super::masked::MaskedCovariance;

/// Most bins beside lag zero; more only slow the fit down.
pub const BINS_MAX: usize = 32;

/// Bins of an estimate.
#[derive(Clone, Debug, Default)]
pub struct LagBins {
    /// Mean lag of the pairs in each bin, m.
    pub lag_m: Vec<f64>,
    /// Covariance of each bin, m2.
    pub covariance_m2: Vec<f64>,
    /// Pairs in each bin.
    pub pairs: Vec<u64>,
    /// The lags of all bins, by bin.
    pub members: Vec<Member>,
}

/// One lag in a bin.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// Lag in cells, rows and columns.
    pub lag: [isize; 2],
    /// Number of its bin.
    pub bin: usize,
    /// Its share of the bin's pairs.
    pub weight: f64,
}

impl LagBins {
    /// Bins of `estimate` up to `max_lag_m`, for cells of `cell_m = [east-west, north-south]`. The bin width is the
    /// larger cell size, or the maximum lag over [`BINS_MAX`] where that is more. Bins without pairs are left out.
    pub fn of(estimate: &MaskedCovariance, cell_m: [f64; 2], max_lag_m: f64) -> Self {
        let width = cell_m[0].max(cell_m[1]).max(max_lag_m / BINS_MAX as f64);
        let mut lags: Vec<Lag> = estimate
            .lags()
            .filter_map(|(drow, dcol)| Lag::of(estimate, cell_m, [drow, dcol]))
            .filter(|l| l.length <= max_lag_m * (1.0 + 1e-9))
            .collect();
        let bin = |l: &Lag| (l.length / width).round() as usize;
        lags.sort_by_key(bin);
        lags.chunk_by(|a, b| bin(a) == bin(b)).fold(Self::default(), Self::with_bin)
    }

    fn with_bin(mut self, lags: &[Lag]) -> Self {
        let pairs: u64 = lags.iter().map(|l| l.pairs).sum();
        let share = |l: &Lag| l.pairs as f64 / pairs as f64;
        let bin = self.lag_m.len();
        self.lag_m.push(lags.iter().map(|l| l.length * share(l)).sum());
        self.covariance_m2.push(lags.iter().map(|l| l.sum).sum::<f64>() / pairs as f64);
        self.pairs.push(pairs);
        self.members.extend(lags.iter().map(|l| Member { lag: l.lag, bin, weight: share(l) }));
        self
    }

    /// Number of bins.
    pub fn len(&self) -> usize {
        self.lag_m.len()
    }

    /// True when no pair was found.
    pub fn is_empty(&self) -> bool {
        self.lag_m.is_empty()
    }

    /// A function of the lag in cells, brought to the bins as the data was.
    pub fn average(&self, f: impl Fn([isize; 2]) -> f64) -> Vec<f64> {
        let mut binned = vec![0.0; self.len()];
        self.members.iter().for_each(|m| binned[m.bin] += m.weight * f(m.lag));
        binned
    }
}

struct Lag {
    lag: [isize; 2],
    length: f64,
    pairs: u64,
    sum: f64,
}

impl Lag {
    /// The lag with its pairs, or `None` when it has none.
    fn of(estimate: &MaskedCovariance, cell_m: [f64; 2], lag: [isize; 2]) -> Option<Self> {
        let (pairs, sum) = estimate.at(lag[0], lag[1])?;
        (pairs > 0).then(|| Self { lag, length: length_m(lag, cell_m), pairs, sum })
    }
}

/// Length in m of a lag in cells.
pub fn length_m(lag: [isize; 2], cell_m: [f64; 2]) -> f64 {
    let (y, x) = (lag[0] as f64 * cell_m[1], lag[1] as f64 * cell_m[0]);
    (x * x + y * y).sqrt()
}
