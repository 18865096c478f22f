//! Maps of roughness over a site: band RMS, sigma and sigma^2 / b, block by block.
//!
//! The DEM is tiled from its north-western corner by blocks of at least two windows. In each block:
//!
//! * band RMS: `sqrt(mean r^2)` of the residual r before trimming, m. It needs no model.
//! * amplitude `a^2`: the binned covariance c of the block, trimmed at the fit's level, is compared with the fitted model m
//!   (detrended, trimmed and binned as by the estimator) by generalised least squares with one free factor,
//!   `a^2 = m' W c / (m' W m)`, W the inverse of the covariance of the bins under the model. A block whose covariance has the
//!   site's shape has `c = a^2 m` on average.
//! * sigma: `a` times the fit's sigma; sigma^2 / b: `a^2` times the fit's.
//!
//! Range and shape are held at the site's fit. A block of a few windows cannot separate sigma from b: the likelihood is
//! a valley along constant sigma^2 / b, and fitting both would map the noise along it. The amplitude is the one parameter that a
//! block identifies. If the site's b is itself not identified, the map of sigma^2 / b still holds, whereas the map of sigma is only
//! as good as the site's sigma. W gives most weight to differences between short lags, so that the amplitude follows the short-wave
//! roughness, whereas band RMS covers all of it: where their maps differ, the shape changes over the site.
//!
//! Each block is trimmed at its own threshold, which removes the same share of its cells as the site's does of the site, so that
//! rough blocks do not lose more than smooth ones. White noise and nugget do not scale with the texture: if there is either, lag
//! zero is left out.
//!
//! Standard error of a^2 under the model: `(m' W m)^-1/2` for a block with that many residuals; the relative standard error of
//! sigma is half the relative one of a^2.
//!
//! Cost: one more pass over the heights, and real transforms of each block. Memory: one row of blocks.
//!
//! Limits: blocks with residuals in less than half of their cells, and those whose amplitude is not positive, have
//! no data. For a block that is cut by the eastern or southern edge, the share is taken of its full area. Not for transects, nor
//! for `paper` fits, which have no estimator.

use super::case::Case;
use super::estimator::Estimator;
use super::heights::Heights;
use super::least_squares::Cholesky;
use super::resampling::sill_over_range;
use super::{FitError, FitOutcome, Mode};
use crate::covariance::{Covariance, LagBins, masked_covariance};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, sums};
use sastrugi_schemas::{ParameterError, shown};
use std::ops::Range;

/// Default width of a block, windows.
const BLOCK_WINDOWS: f64 = 4.0;
/// Least width of a block, windows.
const BLOCK_WINDOWS_MIN: f64 = 2.0;
/// Least share of a block's cells with a residual.
const USED_SHARE_MIN: f64 = 0.5;

/// Maps of roughness, one cell for each block; NaN: no data.
#[derive(Clone, Debug)]
pub struct LocalMaps {
    /// Root mean square of the residual before trimming, m.
    pub band_rms_m: Grid,
    /// Standard deviation of the texture, m, at the site's range; `None` for a model without a variance.
    pub sigma_m: Option<Grid>,
    /// sigma^2 / b, m; `None` unless the model is a single term with a range.
    pub sigma2_over_range_m: Option<Grid>,
    /// Relative standard error of sigma under the fitted model, in a block whose cells all have a residual.
    pub sigma_error: f64,
}

/// The fitted model that blocks are compared with.
struct Reference {
    /// The bins to compare.
    bins: Range<usize>,
    /// Contribution of correlated noise to them, m2.
    noise_m2: Vec<f64>,
    /// The fitted model in these bins without that noise, whitened.
    model: Vec<f64>,
    /// Cholesky factor of the bins' covariance for all residuals of the DEM.
    weights: Cholesky,
}

/// Results of a block.
#[derive(Clone, Copy)]
struct Found {
    band_rms_m: f64,
    /// Variance over the site's fitted variance.
    amplitude2: f64,
}

const NO_DATA: Found = Found { band_rms_m: f64::NAN, amplitude2: f64::NAN };

impl FitOutcome {
    /// Maps of the fitted heights in blocks of about `block_m` (four windows if `None`).
    ///
    /// # Errors
    /// Blocks narrower than two windows or wider than the DEM; transects and `paper` fits; heights that cannot be read.
    pub fn local_maps(&self, heights: &dyn Heights, block_m: Option<f64>) -> Result<LocalMaps, FitError> {
        let case = self.case(heights)?;
        let covariance = Covariance::of_fit(&self.fit)?;
        let block = block_cells(&case, block_m)?;
        let estimator = Estimator::rough(&case, &case.bins);
        let reference = Reference::of(&estimator, &covariance)?;
        let along = [0, 1].map(|k| [case.geometry.rows, case.geometry.cols][k].div_ceil(block[k]));
        let mut found = Vec::with_capacity(along[0] * along[1]);
        for row in 0..along[0] {
            let rows = row * block[0]..((row + 1) * block[0]).min(case.geometry.rows);
            found.extend(row_of_blocks(&case, &reference, rows, block)?);
        }
        let geometry = block_geometry(&case.geometry, along, block);
        let map = |of: &dyn Fn(&Found) -> f64| Grid::new(geometry, found.iter().map(of).collect());
        let sigma_m = covariance.sigma_m();
        let sill_over_range_m = sill_over_range(&covariance);
        Ok(LocalMaps {
            band_rms_m: map(&|f| f.band_rms_m),
            // If the range ended at the bound of its search, sigma is not an estimate either.
            sigma_m: (covariance.is_stationary() && !self.fit.range_at_bound())
                .then(|| map(&|f| sigma_m * f.amplitude2.sqrt())),
            sigma2_over_range_m: sill_over_range_m.map(|own| map(&|f| own * f.amplitude2)),
            sigma_error: 0.5 * reference.amplitude2_error(case.survey.detrended, block[0] * block[1]),
        })
    }

    /// The fitted case, rebuilt without reading the heights.
    fn case<'a>(&'a self, heights: &'a dyn Heights) -> Result<Case<'a>, FitError> {
        let refused = |message: &str| Err(ParameterError::new("local", message).into());
        if self.settings.mode() == Mode::Paper {
            return refused("needs a `corrected` fit, but the mode is `paper`");
        }
        if heights.are_profiles() {
            return refused("needs a raster, but the heights are transects");
        }
        let geometry = heights.geometry();
        let max_lag_m = self.settings.max_lag_m(&geometry, false)?;
        Ok(Case {
            heights,
            settings: &self.settings,
            geometry,
            window: self.settings.window(&geometry, false)?,
            max_lag: [1, 0].map(|axis: usize| (max_lag_m / geometry.cell[axis] * (1.0 + 1e-9)) as usize),
            max_lag_m,
            survey: self.survey.clone(),
            bins: self.bins.clone(),
        })
    }
}

/// Rows and columns of a block.
fn block_cells(case: &Case, block_m: Option<f64>) -> Result<[usize; 2], FitError> {
    let window_m = case.window_m();
    let block_m = block_m.unwrap_or(BLOCK_WINDOWS * window_m);
    let [width_m, height_m] = case.geometry.size();
    let (least_m, most_m) = (BLOCK_WINDOWS_MIN * window_m, width_m.max(height_m));
    if !(block_m >= least_m * (1.0 - 1e-9) && block_m <= most_m) {
        let [least, most] = [least_m, most_m].map(|m| shown((1e6 * m).round() / 1e6));
        let message = format!(
            "is {} m; blocks must be at least two windows ({least} m) and at most the DEM ({most} m) wide",
            shown(block_m)
        );
        return Err(ParameterError::new("local_block", message).into());
    }
    Ok([1, 0].map(|axis: usize| ((block_m / case.geometry.cell[axis]).round() as usize).max(1)))
}

/// The raster of blocks; it shares the DEM's north-western corner.
fn block_geometry(dem: &Geometry, [rows, cols]: [usize; 2], block: [usize; 2]) -> Geometry {
    let cell = [block[1] as f64 * dem.cell[0], block[0] as f64 * dem.cell[1]];
    let top = dem.origin[1] + dem.rows as f64 * dem.cell[1];
    Geometry { rows, cols, cell, origin: [dem.origin[0], top - rows as f64 * cell[1]] }
}

/// Results of one row of blocks, from west to east.
fn row_of_blocks(
    case: &Case,
    reference: &Reference,
    rows: Range<usize>,
    block: [usize; 2],
) -> Result<Vec<Found>, FitError> {
    let cols = case.geometry.cols;
    let residual = case.survey.residual(case.heights, case.settings, rows, 0..cols)?;
    let starts: Vec<usize> = (0..cols).step_by(block[1]).collect();
    let found = starts.par_iter().map(|&from| {
        let to = (from + block[1]).min(cols);
        let part: Vec<f64> = residual.chunks_exact(cols).flat_map(|line| line[from..to].iter().copied()).collect();
        let used = part.iter().filter(|r| !r.is_nan()).count();
        let enough = used as f64 >= USED_SHARE_MIN * (block[0] * block[1]) as f64;
        if enough { reference.found(case, part, to - from) } else { NO_DATA }
    });
    Ok(found.collect())
}

impl Reference {
    fn of(estimator: &Estimator, covariance: &Covariance) -> Result<Self, FitError> {
        let case = estimator.case;
        let noise = case.settings.measurement().noise;
        let noisy = covariance.nugget_m2 > 0.0 || noise.white_sigma_m > 0.0;
        let n = estimator.bins.len();
        let bins = usize::from(noisy)..n;
        let model = estimator.mean(covariance);
        let left = estimator.expectation.filter.residual_noise();
        // Trimming removes about the same share of texture and noise.
        let kept = model[0] / estimator.expectation.variance_m2(covariance);
        let noise_m2: Vec<f64> = estimator.bins.average(|lag| kept * left.at(lag))[bins.clone()].to_vec();
        let texture: Vec<f64> = model[bins.clone()].iter().zip(&noise_m2).map(|(all, noise)| all - noise).collect();
        let matrix = estimator.expectation.covariance(covariance, case.survey.trim.threshold_m);
        let part: Vec<f64> =
            bins.clone().flat_map(|i| bins.clone().map(move |j| i * n + j)).map(|k| matrix[k]).collect();
        let no_fit = || FitError::NoFit { model: "local".to_owned() };
        let weights = Cholesky::new(&part, bins.len()).ok_or_else(no_fit)?;
        Ok(Self { model: weights.whiten(&texture), noise_m2, bins, weights })
    }

    /// `m' W m`, for all residuals of the DEM.
    fn information(&self) -> f64 {
        self.model.iter().map(|m| m * m).sum()
    }

    /// Standard error of a^2 in a block of `block` residuals, given `all` residuals of the DEM.
    fn amplitude2_error(&self, all: usize, block: usize) -> f64 {
        (all as f64 / block as f64 / self.information()).sqrt()
    }

    /// Results from a block's residuals, in rows of `cols`.
    fn found(&self, case: &Case, mut residual: Vec<f64>, cols: usize) -> Found {
        let band_rms_m = sums::mean(&squares(&residual)).sqrt();
        trim(&mut residual, case.settings.trim());
        let binned = binned(case, &residual, cols);
        let Some(measured) = binned.filter(|c| c.len() >= self.bins.end) else {
            return Found { band_rms_m, ..NO_DATA };
        };
        let texture: Vec<f64> =
            measured[self.bins.clone()].iter().zip(&self.noise_m2).map(|(all, noise)| all - noise).collect();
        let measured = self.weights.whiten(&texture);
        let product: f64 = self.model.iter().zip(&measured).map(|(m, c)| m * c).sum();
        let amplitude2 = product / self.information();
        Found { band_rms_m, amplitude2: if amplitude2 > 0.0 { amplitude2 } else { f64::NAN } }
    }
}

fn squares(values: &[f64]) -> Vec<f64> {
    values.iter().filter(|v| !v.is_nan()).map(|v| v * v).collect()
}

/// Sets the largest residuals, a share `level` of them, to NaN.
fn trim(residual: &mut [f64], level: f64) {
    let mut sizes: Vec<f64> = residual.iter().filter(|r| !r.is_nan()).map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let threshold_m = sums::quantile_sorted(&sizes, 1.0 - level);
    residual.iter_mut().filter(|r| r.abs() > threshold_m).for_each(|r| *r = f64::NAN);
}

/// Covariance in the rings, m2; `None` if a ring has no pairs.
fn binned(case: &Case, residual: &[f64], cols: usize) -> Option<Vec<f64>> {
    let rows = residual.len() / cols.max(1);
    let max_lag = [case.max_lag[0].min(rows - 1), case.max_lag[1].min(cols - 1)];
    let sums = LagBins::bin_sums(&case.bins, &masked_covariance(residual, cols, max_lag));
    sums.into_iter().map(|(sum, pairs)| (pairs > 0).then(|| sum / pairs as f64)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{FitParameters, fit};
    use crate::synth::Synthesis;
    use crate::synth::fft_ma::{self, FftMaParameters, Phase};
    use crate::synth::tile::{Cell, TileParameters};
    use sastrugi_numeric::Streams;

    const CELL_M: f64 = 0.1;

    /// A normal field with an exponential covariance of sigma 1 m and b 0.3 m.
    fn field(cells: u32, seed: u64) -> Grid {
        let covariance = Covariance::new(crate::covariance::model("exponential").unwrap(), 1.0, 0.3).unwrap();
        let tile = TileParameters { size_px: Some([cells; 2]), cell_m: Cell::Square(CELL_M), ..Default::default() };
        let parameters = FftMaParameters { phase: Phase::Gaussian, periodic: false, ..FftMaParameters::default() };
        let synthesis = fft_ma::texture(tile, &parameters, covariance).unwrap();
        synthesis.generate(&Streams::for_seed(seed, "local-test")).unwrap().grid
    }

    fn fitted(dem: &Grid, parameters: FitParameters) -> FitOutcome {
        let settings = FitParameters { bootstrap: 0, ..parameters }.try_into().unwrap();
        fit(dem, &settings, &Streams::for_seed(0, "fit")).unwrap()
    }

    fn maps(dem: &Grid, block_m: Option<f64>) -> LocalMaps {
        fitted(dem, FitParameters::default()).local_maps(dem, block_m).unwrap()
    }

    /// Mean over the columns of a map.
    fn mean_of(map: &Grid, cols: Range<usize>) -> f64 {
        let values: Vec<f64> = (0..map.rows()).flat_map(|r| map.row(r)[cols.clone()].to_vec()).collect();
        sums::mean(&values)
    }

    /// A site of 48 m whose eastern half is twice as rough, in 6 x 6 blocks of 8 m. The columns of blocks next to the step
    /// are left out. Sigma of a block has a standard error below 5 % (asserted), the ratio of the means of 12 blocks each
    /// has one of 5 % sqrt(2 / 12) = 2 %, and sigma^2 / b twice that: 8 % and 16 % are four such errors.
    #[test]
    fn val_a_half_twice_as_rough_shows_in_the_maps() {
        let mut dem = field(480, 1);
        let cols = dem.cols();
        dem.values.iter_mut().enumerate().filter(|(k, _)| k % cols >= cols / 2).for_each(|(_, z)| *z *= 2.0);
        let LocalMaps { band_rms_m, sigma_m, sigma2_over_range_m, sigma_error } = maps(&dem, Some(8.0));
        assert_eq!((band_rms_m.rows(), band_rms_m.cols()), (6, 6));
        assert!((0.005..0.05).contains(&sigma_error), "{sigma_error}");
        for (name, map, expected, limit) in [
            ("band RMS", &band_rms_m, 2.0, 0.08),
            ("sigma", &sigma_m.unwrap(), 2.0, 0.08),
            ("sigma2/b", &sigma2_over_range_m.unwrap(), 4.0, 0.16),
        ] {
            let ratio = mean_of(map, 4..6) / mean_of(map, 0..2);
            println!("{name}: {ratio}");
            assert!((ratio / expected - 1.0).abs() < limit, "{name}: {ratio}");
        }
    }

    /// Blocks of a homogeneous site have the site's sigma on average, and scatter as the standard error states: a standard
    /// deviation from 36 blocks is good to 12 %, so that a factor of 1.5 is four such errors.
    #[test]
    fn stat_blocks_of_one_site_scatter_as_stated() {
        let dem = field(480, 2);
        let outcome = fitted(&dem, FitParameters::default());
        let maps = outcome.local_maps(&dem, Some(8.0)).unwrap();
        let sigmas = maps.sigma_m.unwrap().values;
        let own = outcome.fit.parameters["sigma_m"];
        let scatter = sums::variance(&sigmas).sqrt() / own;
        println!("mean {} scatter {scatter} stated {}", sums::mean(&sigmas) / own, maps.sigma_error);
        assert!((sums::mean(&sigmas) / own - 1.0).abs() < 0.03, "{}", sums::mean(&sigmas) / own);
        assert!((scatter / maps.sigma_error).max(maps.sigma_error / scatter) < 1.5, "{scatter} {}", maps.sigma_error);
    }

    /// Doubling the heights doubles the maps, exactly, since factors of two cause no rounding.
    #[test]
    fn prop_maps_scale_with_heights() {
        let mut dem = field(160, 3);
        let outcome = fitted(&dem, FitParameters::default());
        let before = outcome.local_maps(&dem, None).unwrap();
        dem.values.iter_mut().for_each(|z| *z *= 2.0);
        let after = outcome.local_maps(&dem, None).unwrap();
        let pairs = |a: &Grid, b: &Grid, factor: f64| {
            a.values.iter().zip(&b.values).for_each(|(a, b)| assert!((b / a / factor - 1.0).abs() < 1e-9, "{a} {b}"));
        };
        pairs(&before.band_rms_m, &after.band_rms_m, 2.0);
        pairs(&before.sigma_m.unwrap(), &after.sigma_m.unwrap(), 2.0);
        pairs(&before.sigma2_over_range_m.unwrap(), &after.sigma2_over_range_m.unwrap(), 4.0);
    }

    /// Blocks start at the north-western corner and the last ones extend beyond the DEM; without enough data there is no value.
    #[test]
    fn val_blocks_lie_where_they_should() {
        let mut dem = field(190, 4);
        dem.geometry.origin = [100.0, 50.0];
        // North-western block: three quarters without data.
        let cols = dem.cols();
        dem.values
            .iter_mut()
            .enumerate()
            .filter(|(k, _)| k / cols < 30 && k % cols < 40)
            .for_each(|(_, z)| *z = f64::NAN);
        let map = maps(&dem, Some(5.0)).band_rms_m;
        assert_eq!((map.rows(), map.cols(), map.geometry.cell), (4, 4, [5.0, 5.0]));
        assert_eq!(map.geometry.origin, [100.0, 49.0], "19 m of heights below y = 69 m");
        assert!(map.at(0, 0).is_nan() && map.at(0, 1).is_finite() && map.at(3, 3).is_finite());
    }

    #[test]
    fn val_what_cannot_be_mapped_is_refused() {
        let dem = field(160, 5);
        let outcome = fitted(&dem, FitParameters::default());
        for block_m in [0.0, 3.9, 17.0, f64::NAN] {
            let error = outcome.local_maps(&dem, Some(block_m)).unwrap_err().to_string();
            assert!(error.contains("at least two windows"), "{error}");
        }
        let paper = fitted(&dem, FitParameters { mode: Mode::Paper, ..FitParameters::default() });
        assert!(paper.local_maps(&dem, None).unwrap_err().to_string().contains("corrected"));
    }
}
