//! Lag bins: rings, and rings divided into sectors.
//!
//! Ring k contains the lags whose length rounds to k ring widths; bin 0 is lag zero alone. A bin's covariance is the sum of
//! all products over the number of all pairs. Models are binned in the same way, so that the width of a bin causes no bias.

use super::lag::length_m;
use super::masked::MaskedCovariance;

/// How lags are binned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Most rings in addition to lag zero; more only slow a fit down.
    pub rings_max: usize,
    /// Sectors of each ring over half a turn; the first is centred north-south.
    pub sectors: usize,
}

impl Layout {
    /// Rings.
    pub const ISOTROPIC: Self = Self { rings_max: 32, sectors: 1 };
    /// Rings in sectors of 30 degrees.
    pub const DIRECTIONAL: Self = Self { rings_max: 8, sectors: 6 };
}

/// Bins of an estimate.
#[derive(Clone, Debug, Default)]
pub struct LagBins {
    /// Mean lag of the pairs in each bin, m.
    pub lag_m: Vec<f64>,
    /// Direction of the centre of each bin's sector, degrees clockwise from north; `None` for complete rings.
    pub azimuth_deg: Vec<Option<f64>>,
    /// Covariance of each bin, m2.
    pub covariance_m2: Vec<f64>,
    /// Pairs in each bin.
    pub pairs: Vec<u64>,
    /// The lags of all bins, ordered by bin.
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
    /// Bins of `estimate` up to `max_lag_m`, for cells of `cell_m = [east-west, north-south]`. The ring width is the larger
    /// cell size, or `max_lag_m` over the largest number of rings if that is more. Bins without pairs are left out.
    pub fn of(estimate: &MaskedCovariance, cell_m: [f64; 2], max_lag_m: f64, layout: Layout) -> Self {
        let width = cell_m[0].max(cell_m[1]).max(max_lag_m / layout.rings_max as f64);
        let mut lags: Vec<Lag> = estimate
            .lags()
            .filter_map(|(drow, dcol)| Lag::of(estimate, cell_m, [drow, dcol]))
            .filter(|l| l.length <= max_lag_m * (1.0 + 1e-9))
            .collect();
        let place = |l: &Lag| {
            let ring = (l.length / width).round() as usize;
            (ring, if ring == 0 { 0 } else { sector(l.lag, cell_m, layout.sectors) })
        };
        lags.sort_by_key(place);
        lags.chunk_by(|a, b| place(a) == place(b)).fold(Self::default(), |bins, lags| {
            let (ring, sector) = place(&lags[0]);
            let azimuth = 180.0 * sector as f64 / layout.sectors as f64;
            bins.with_bin(lags, (layout.sectors > 1 && ring > 0).then_some(azimuth))
        })
    }

    fn with_bin(mut self, lags: &[Lag], azimuth_deg: Option<f64>) -> Self {
        let pairs: u64 = lags.iter().map(|l| l.pairs).sum();
        let share = |l: &Lag| l.pairs as f64 / pairs as f64;
        let bin = self.lag_m.len();
        self.lag_m.push(lags.iter().map(|l| l.length * share(l)).sum());
        self.azimuth_deg.push(azimuth_deg);
        self.covariance_m2.push(lags.iter().map(|l| l.sum).sum::<f64>() / pairs as f64);
        self.pairs.push(pairs);
        self.members.extend(lags.iter().map(|l| Member { lag: l.lag, bin, weight: share(l) }));
        self
    }

    /// Sum of products and number of pairs of another estimate of the same surface in these bins.
    pub fn bin_sums(&self, estimate: &MaskedCovariance) -> Vec<(f64, u64)> {
        let mut sums = vec![(0.0, 0); self.len()];
        for m in &self.members {
            let (pairs, sum) = estimate.at(m.lag[0], m.lag[1]).unwrap_or_default();
            sums[m.bin].0 += sum;
            sums[m.bin].1 += pairs;
        }
        sums
    }

    /// Covariance of another estimate of the same surface in these bins, m2; 0 in a bin without pairs.
    pub fn means(&self, estimate: &MaskedCovariance) -> Vec<f64> {
        means(&self.bin_sums(estimate))
    }

    /// Number of bins.
    pub fn len(&self) -> usize {
        self.lag_m.len()
    }

    /// True if no pair was found.
    pub fn is_empty(&self) -> bool {
        self.lag_m.is_empty()
    }

    /// Averages a function of the lag in cells over each bin, weighted like the data.
    pub fn average(&self, f: impl Fn([isize; 2]) -> f64) -> Vec<f64> {
        let mut binned = vec![0.0; self.len()];
        self.members.iter().for_each(|m| binned[m.bin] += m.weight * f(m.lag));
        binned
    }
}

/// Sums of products over their numbers of pairs.
pub fn means(sums: &[(f64, u64)]) -> Vec<f64> {
    sums.iter().map(|(sum, pairs)| sum / (*pairs).max(1) as f64).collect()
}

struct Lag {
    lag: [isize; 2],
    length: f64,
    pairs: u64,
    sum: f64,
}

impl Lag {
    /// The lag with its pairs, or `None` if it has none.
    fn of(estimate: &MaskedCovariance, cell_m: [f64; 2], lag: [isize; 2]) -> Option<Self> {
        let (pairs, sum) = estimate.at(lag[0], lag[1])?;
        (pairs > 0).then(|| Self { lag, length: length_m(lag, cell_m), pairs, sum })
    }
}

/// Sector of a lag's direction, of `sectors` over half a turn.
fn sector([row, col]: [isize; 2], cell_m: [f64; 2], sectors: usize) -> usize {
    let turn = libm::atan2(col as f64 * cell_m[0], -(row as f64) * cell_m[1]) / std::f64::consts::PI;
    // Opposite directions are equivalent; a lag on the edge between two sectors goes to the second, as does its opposite.
    let place = (turn - turn.floor()) * sectors as f64 + 0.5;
    place as usize % sectors
}
