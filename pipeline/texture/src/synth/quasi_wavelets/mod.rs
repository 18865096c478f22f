//! Quasi-wavelets: Gaussian bumps of self-similar size classes, matched to a given covariance, with intermittency.
//!
//! Classes k have the half axis `a_k = a_1 q^(k - 1)` down to 0.7 cells, q the ratio of sizes; smaller-scale variation is
//! white. Each class is a sum of bumps ([`super::bumps`]), so that on average
//!
//! `C(h) = sum over k of w_k exp(-h^2 / (2 a_k^2)) + w_0 [h = 0]`
//!
//! (wrapped around the tile). The variances `w_k >= 0` are the least-squares fit to the target covariance at lags
//! along rows, columns and diagonals, then scaled to its variance. A covariance that is a mixture of Gaussians
//! (exponential, Matern) is reproduced within 1 % of its variance; the remaining difference is reported.
//!
//! Intermittency: class k has `packing (a_k / a_1)^intermittency` bumps per area of their half axes. At 0 all classes fill
//! space equally; above, small bumps are fewer and higher (the beta model of Frisch, Sulem and Nelkin 1978, J. Fluid Mech. 87),
//! which does not change the covariance but makes the tails of small increments heavier: excess kurtosis of a class
//! `1 / (pi packing (a_k / a_1)^intermittency)`.
//!
//! Source: Goedecke, Ostashev, Wilson and Auvermann 2004, Boundary-Layer Meteorology 112, 33 (size classes in constant ratio,
//! constant packing); Vecherin et al. 2022, section 3.1. Departures: variances by non-negative least squares rather than from
//! the inertial range, so that any covariance can be a target; scalar field, h = +-1; periodic; ellipses at any azimuth,
//! which the paper calls hard.
//!
//! Cost: 81 `packing` multiplications per class and cell (exponentials, where the long axis is not a grid axis); memory 72
//! bytes per cell at a packing of 1.

use super::bumps::{Class, Torus};
use super::tile::{self, Tile};
use super::{Cost, Kernel, Made, MethodParameters, SynthesisError, Wanted, fft_ma, reach};
use crate::covariance::Covariance;
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::{Kind, ParameterError, counted, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Half axis of the smallest bumps, cells.
const SMALLEST_CELLS: f64 = 0.7;
/// Half axis of the largest bumps over the distance at which the covariance has fallen to a thousandth.
const LARGEST_SHARE: f64 = 0.5;
/// Most classes.
const CLASSES_MAX: usize = 64;
/// Number of sizes assumed if the covariance is unknown.
const SIZES: f64 = 10.0;
/// Most bumps of a class.
const COUNT_MAX: f64 = 1e8;
/// Lags fitted along each direction.
const LAGS: usize = 48;
/// Weight of lag 0 relative to the other lags.
const VARIANCE_WEIGHT: f64 = 30.0;
/// Rounds of the descent; the variances have converged by then.
const ROUNDS: usize = 20_000;

/// Smallest packing.
const PACKING_MIN: f64 = 0.01;

/// Raw parameters of quasi-wavelets, without those of their tile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct QuasiWaveletsParameters {
    /// Ratio q of the sizes of neighbouring classes, in [0.3, 0.9]. Default 0.6.
    #[schemars(transform = limits::within(0.3, 0.9))]
    pub size_ratio: f64,
    /// Bumps per area of their half axes in the largest class. Default 1.
    #[schemars(transform = limits::half_open(PACKING_MIN, f64::INFINITY))]
    pub packing: f64,
    /// Exponent with which the packing decreases with size, in [0, 2]. Default 0 (no intermittency).
    #[schemars(transform = limits::within(0.0, 2.0))]
    pub intermittency: f64,
}

impl Default for QuasiWaveletsParameters {
    fn default() -> Self {
        Self { size_ratio: 0.6, packing: 1.0, intermittency: 0.0 }
    }
}

/// Quasi-wavelets with checked parameters.
pub struct QuasiWavelets {
    covariance: Covariance,
    tile: Geometry,
    torus: Torus,
    classes: Vec<Class>,
    white_m2: f64,
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: QuasiWaveletsParameters::NAME,
        summary: "bumps of self-similar sizes matched to the covariance, with intermittency; periodic",
        source: "Goedecke et al. 2004; Vecherin et al. 2022, section 3.1",
        parameters: tile::schema::<QuasiWaveletsParameters>(),
    }
}

impl MethodParameters for QuasiWaveletsParameters {
    const NAME: &'static str = "quasi_wavelets";
    type Kernel = QuasiWavelets;

    fn is_periodic(&self) -> bool {
        true
    }

    fn check(&self, tile: &Tile) -> Result<(), ParameterError> {
        let &Self { size_ratio, packing, intermittency } = self;
        if !(0.3..=0.9).contains(&size_ratio) {
            return Err(ParameterError::new("size_ratio", format!("is {size_ratio}; it must lie in [0.3, 0.9]")));
        }
        ParameterError::positive("packing", packing)?;
        if packing < PACKING_MIN {
            let message = format!(
                "is {packing}; it must be at least {PACKING_MIN}, below which there are only a few isolated bumps"
            );
            return Err(ParameterError::new("packing", message));
        }
        if !(0.0..=2.0).contains(&intermittency) {
            return Err(ParameterError::new("intermittency", format!("is {intermittency}; it must lie in [0, 2]")));
        }
        let least = self.least_count(tile);
        if least > COUNT_MAX {
            let message = format!("is {packing}, which needs at least {least:.1e} bumps; the limit is {COUNT_MAX:.0e}");
            return Err(ParameterError::new("packing", message));
        }
        Ok(())
    }

    fn cost(&self, tile: &Tile) -> Cost {
        // The covariance is not known yet: assume a fixed number of sizes, each with as many bumps as the smallest.
        let [dx, dy] = tile.geometry.cell;
        let along_m = SMALLEST_CELLS * dx.min(dy);
        let across_m = along_m * tile.stated_ratio().unwrap_or(1.0);
        let count = bumps(self.packing, &tile.geometry, along_m, across_m).min(COUNT_MAX) as u64;
        let class = Class { along_m, across_m, count, variance_m2: 1.0 };
        let Cost { memory_bytes, operations } =
            cost(&Torus::new(tile.geometry, 0.0), std::slice::from_ref(&class), &tile.geometry);
        Cost { memory_bytes, operations: SIZES * operations }
    }

    fn kernel(&self, tile: &Tile, wanted: &Covariance, _: &Wanted) -> Result<QuasiWavelets, ParameterError> {
        let torus = Torus::new(tile.geometry, wanted.azimuth_deg);
        let mut classes = classes(self, &tile.geometry, reach::reach_m(wanted, 1e-3), wanted.ratio)?;
        let white_m2 = match_variances(&torus, &mut classes, &lags(&tile.geometry), wanted);
        classes.retain(|c| c.variance_m2 > 0.0);
        Ok(QuasiWavelets { covariance: wanted.clone(), tile: tile.geometry, torus, classes, white_m2 })
    }
}

impl QuasiWaveletsParameters {
    /// Fewest bumps of the smallest size that any covariance needs, unless the sizes end at the largest number of classes.
    fn least_count(&self, tile: &Tile) -> f64 {
        let ([width_m, height_m], [dx, dy]) = (tile.geometry.size(), tile.geometry.cell);
        let smallest_m = SMALLEST_CELLS * dx.min(dy);
        let largest_m = LARGEST_SHARE * width_m.max(height_m);
        let sizes = libm::log(largest_m / smallest_m) / -libm::log(self.size_ratio);
        if self.intermittency > 0.0 || sizes + 1.0 >= CLASSES_MAX as f64 {
            return 0.0;
        }
        let along_m = smallest_m / self.size_ratio;
        bumps(self.packing, &tile.geometry, along_m, along_m * tile.stated_ratio().unwrap_or(1.0))
    }
}

/// Number of bumps that cover a tile at the given packing.
fn bumps(packing: f64, tile: &Geometry, along_m: f64, across_m: f64) -> f64 {
    let [width_m, height_m] = tile.size();
    (packing * width_m * height_m / (along_m * across_m)).ceil()
}

fn cost(torus: &Torus, classes: &[Class], tile: &Geometry) -> Cost {
    Cost {
        memory_bytes: classes.iter().map(Torus::memory_bytes).max().unwrap_or(0) + 8 * tile.len() as u64,
        operations: classes.iter().map(|c| torus.operations(c)).sum(),
    }
}

/// Sizes and numbers of the bumps for a covariance with the given reach and ratio of ranges.
fn classes(
    parameters: &QuasiWaveletsParameters,
    tile: &Geometry,
    reach_m: f64,
    ratio: f64,
) -> Result<Vec<Class>, ParameterError> {
    let ([width_m, height_m], [dx, dy]) = (tile.size(), tile.cell);
    let largest_m = LARGEST_SHARE * reach_m.min(width_m.max(height_m));
    let smallest_m = SMALLEST_CELLS * dx.min(dy);
    let mut classes = Vec::new();
    let mut share = 1.0;
    while classes.is_empty() || (largest_m * share >= smallest_m && classes.len() < CLASSES_MAX) {
        let along_m = (largest_m * share).max(smallest_m);
        let across_m = along_m * ratio;
        let packing = parameters.packing * libm::exp(parameters.intermittency * libm::log(share));
        let count = bumps(packing, tile, along_m, across_m);
        if count > COUNT_MAX {
            let message = format!(
                "is {}, which needs {count:.1e} bumps of {along_m:.3} m; the limit is {COUNT_MAX:.0e}",
                parameters.packing
            );
            return Err(ParameterError::new("packing", message));
        }
        classes.push(Class { along_m, across_m, count: count as u64, variance_m2: 0.0 });
        share *= parameters.size_ratio;
    }
    Ok(classes)
}

/// Lags to fit: whole cells along rows, columns and diagonals up to half the tile, denser near 0.
fn lags(tile: &Geometry) -> Vec<[f64; 2]> {
    let [dx, dy] = tile.cell;
    let mut lags = vec![[0.0; 2]];
    for ([x, y], last) in [
        ([1.0, 0.0], tile.cols / 2),
        ([0.0, 1.0], tile.rows / 2),
        ([1.0, 1.0], tile.cols.min(tile.rows) / 2),
        ([-1.0, 1.0], tile.cols.min(tile.rows) / 2),
    ] {
        let growth = libm::log(last.max(1) as f64) / LAGS as f64;
        let mut steps: Vec<usize> = (0..=LAGS).map(|k| libm::exp(growth * k as f64).round() as usize).collect();
        steps.dedup();
        lags.extend(steps.into_iter().filter(|k| *k <= last).map(|k| [x * k as f64 * dx, y * k as f64 * dy]));
    }
    lags
}

/// Sets the variances of the classes; returns the white variance.
fn match_variances(torus: &Torus, classes: &mut [Class], lags: &[[f64; 2]], wanted: &Covariance) -> f64 {
    let weight = |k: usize| if k == 0 { VARIANCE_WEIGHT } else { 1.0 };
    let mut columns: Vec<Vec<f64>> =
        classes.iter().map(|c| lags.iter().map(|lag| torus.correlation(c, *lag)).collect()).collect();
    columns.push((0..lags.len()).map(|k| if k == 0 { 1.0 } else { 0.0 }).collect());
    let target: Vec<f64> = lags.iter().map(|lag| wanted.at(*lag)).collect();
    let product = |a: &[f64], b: &[f64]| (0..lags.len()).map(|k| weight(k) * a[k] * b[k]).sum::<f64>();
    let gram: Vec<Vec<f64>> = columns.iter().map(|a| columns.iter().map(|b| product(a, b)).collect()).collect();
    let right: Vec<f64> = columns.iter().map(|a| product(a, &target)).collect();
    let mut variances = non_negative_least_squares(&gram, &right);
    let sum: f64 = variances.iter().sum();
    variances.iter_mut().for_each(|v| *v *= wanted.at_distance(0.0) / sum);
    classes.iter_mut().zip(&variances).for_each(|(class, v)| class.variance_m2 = *v);
    variances[classes.len()]
}

/// The `x >= 0` that minimises `x' G x / 2 - r' x`, by coordinate descent.
fn non_negative_least_squares(gram: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; right.len()];
    for _ in 0..ROUNDS {
        for (k, (row, wanted)) in gram.iter().zip(right).enumerate() {
            let slope = row.iter().zip(&x).map(|(g, v)| g * v).sum::<f64>() - wanted;
            x[k] = f64::max(0.0, x[k] - slope / row[k]);
        }
    }
    x
}

impl Kernel for QuasiWavelets {
    fn cost(&self) -> Cost {
        cost(&self.torus, &self.classes, &self.tile)
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = fft_ma::size_notes(&self.covariance, &self.tile, true);
        let (largest, smallest) = (self.classes.first(), self.classes.last());
        let size = |class: Option<&Class>| class.map_or(0.0, |c| c.along_m);
        notes.push(format!(
            "{} of bumps, half axes {:.3} m to {:.3} m; {:.1} % of the variance is white",
            counted(self.classes.len(), "class"),
            size(largest),
            size(smallest),
            100.0 * self.white_m2 / self.covariance.at_distance(0.0)
        ));
        notes
    }

    fn achieved(&self) -> Box<dyn Fn([f64; 2]) -> f64 + '_> {
        let [width_m, height_m] = self.tile.size();
        let near = self.tile.cell.map(|c| 0.5 * c);
        Box::new(move |lag_m| {
            let off = [
                lag_m[0] - (lag_m[0] / width_m).round() * width_m,
                lag_m[1] - (lag_m[1] / height_m).round() * height_m,
            ];
            let white_m2 = if off[0].abs() < near[0] && off[1].abs() < near[1] { self.white_m2 } else { 0.0 };
            let bumps: f64 = self.classes.iter().map(|c| c.variance_m2 * self.torus.correlation(c, lag_m)).sum();
            bumps + white_m2
        })
    }

    fn make(&self, streams: &Streams) -> Result<Made, SynthesisError> {
        let mut stream = streams.stream("white");
        let sigma_m = self.white_m2.sqrt();
        let mut heights_m: Vec<f64> = match self.white_m2 > 0.0 {
            true => (0..self.tile.len()).map(|_| sigma_m * stream.normal()).collect(),
            false => vec![0.0; self.tile.len()],
        };
        for (k, class) in self.classes.iter().enumerate() {
            self.torus.add(class, &mut heights_m, streams, &format!("bumps-{k}"));
        }
        Ok(Made { heights_m, covariance_error_max_m2: None, clip_share: 0.0 })
    }
}

#[cfg(test)]
mod tests;
