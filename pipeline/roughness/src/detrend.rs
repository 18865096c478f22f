//! Detrending: RMS height in the band of wavelengths that excite a vehicle.
//!
//! # What
//! In Army practice, roughness is the RMS deviation of the heights from their local mean. The detrender defines "local",
//! and results of different detrenders are not comparable:
//! * [`Detrender::Band`]: keeps wavelengths `lambda_min` to `lambda_max` of every profile along x and along y, by Fourier
//!   transform. The reference: a sharp band with no leakage from longer or shorter waves.
//! * [`Detrender::MovingAverage`]: heights minus their mean over `lambda_max` x `lambda_max` (the nearest odd number of
//!   cells), where more than half of that window holds data. This is the plain mean, as published, also at borders and holes:
//!   on a slope it is off by slope times the offset of a partial window's centroid. [`crate::band_rms`] fits a plane there.
//! * [`Detrender::Exponential`]: profiles minus their mean with weights `exp(-|d| / lambda_max)`.
//!
//! The latter two keep part of the longer waves. For a profile with density `c f^-2`, the residual of the moving average has
//! `pi^2 / 6` times the variance of all wavelengths below its window.
//!
//! # Why profiles, not the two-dimensional spectrum
//! A band of the two-dimensional spectrum is a different band: on an isotropic surface with profile density `c f^-2`, waves
//! of length `lambda_min` to `lambda_max` in their own direction have `pi / 2` times the variance that profiles have in that
//! band. Wheels roll along profiles, and the formulas for profile densities (`sigma^2 = c (lambda_max - lambda_min)`, ISO
//! 8608) hold for profiles, so the band applies to profiles here.
//!
//! # Edges
//! For `Band`, a parabola with the profile's end slopes (least squares over a quarter of `lambda_max`) is subtracted, and the
//! profile is continued at either end by its mirror image; the two continuations are cross-faded over at least 8 `lambda_max`,
//! to a length that transforms efficiently. `Band` and `Exponential` discard `lambda_max` at each end. Gaps split a profile;
//! pieces shorter than 3 `lambda_max` are left out.
//!
//! # Source
//! Vehicle band and local mean: *Terrain Roughness in MAVS* (documentation, Mississippi State University), which cites Durst et
//! al. (2011), J. Terramechanics, PII S0022489810000522.

use crate::background::{AtPartial, BoxWindow, background_of, odd_cells};
use crate::band::{FILLED_SHARE_MIN, transposed};
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, Transform, smooth_length};
use sastrugi_numeric::{Grid, sums};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Wavelengths from `min_m` to `max_m`, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WaveBand {
    min_m: f64,
    max_m: f64,
}

/// Invalid wavelength band, or a band that the surface cannot resolve.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BandError {
    /// Limits that are not positive, finite and increasing.
    #[error("limits of a wavelength band must be positive, finite and increasing, got {min_m} to {max_m} m")]
    Order {
        /// Shortest wavelength, m.
        min_m: f64,
        /// Longest wavelength, m.
        max_m: f64,
    },
    /// A vehicle dimension that is not positive and finite.
    #[error("{name} must be positive and finite, got {value_m} m")]
    Vehicle {
        /// `wheelbase` or `tyre radius`.
        name: &'static str,
        /// Offending value, m.
        value_m: f64,
    },
    /// Cells too large to resolve the shortest wavelength.
    #[error("cells of {cell_m} m are too coarse for wavelengths of {min_m} m, which need at most {limit_m} m")]
    Coarse {
        /// Shortest wavelength, m.
        min_m: f64,
        /// Largest cell, half the shortest wavelength, m.
        limit_m: f64,
        /// Larger side of a cell, m.
        cell_m: f64,
    },
    /// Surface too short for the longest wavelength.
    #[error(
        "a surface {side_m} m long is too short for wavelengths of up to {max_m} m, which need at least {needed_m} m along x or y"
    )]
    Short {
        /// Longest wavelength, m.
        max_m: f64,
        /// Required length, 4 times the longest wavelength, m.
        needed_m: f64,
        /// Longer side of the surface, m.
        side_m: f64,
    },
}

/// Smallest length of a surface over the longest wavelength.
const LENGTHS_MIN: f64 = 4.0;

impl WaveBand {
    /// Wavelengths from `min_m` to `max_m`.
    ///
    /// # Errors
    /// [`BandError::Order`].
    pub fn new(min_m: f64, max_m: f64) -> Result<Self, BandError> {
        let rises = min_m > 0.0 && max_m > min_m && max_m.is_finite();
        if rises { Ok(Self { min_m, max_m }) } else { Err(BandError::Order { min_m, max_m }) }
    }

    /// Wavelengths that excite a vehicle: from its tyre radius to twice its wheelbase, m.
    ///
    /// # Errors
    /// Lengths that are not positive and finite, or a tyre radius of at least twice the wheelbase.
    ///
    /// ```
    /// use sastrugi_roughness::WaveBand;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let band = WaveBand::of_vehicle(0.5, 0.2)?;
    /// assert_eq!((band.min_m(), band.max_m()), (0.2, 1.0));
    /// assert!(WaveBand::of_vehicle(0.5, 1.1).is_err());
    /// # Ok(())
    /// # }
    /// ```
    pub fn of_vehicle(wheelbase_m: f64, tyre_radius_m: f64) -> Result<Self, BandError> {
        for (name, value_m) in [("wheelbase", wheelbase_m), ("tyre radius", tyre_radius_m)] {
            if !(value_m > 0.0 && value_m.is_finite()) {
                return Err(BandError::Vehicle { name, value_m });
            }
        }
        Self::new(tyre_radius_m, 2.0 * wheelbase_m)
    }

    /// Shortest wavelength, m.
    pub fn min_m(&self) -> f64 {
        self.min_m
    }

    /// Longest wavelength, m.
    pub fn max_m(&self) -> f64 {
        self.max_m
    }

    /// The band as spatial frequencies, cycles/m.
    pub fn frequencies(&self) -> [f64; 2] {
        [1.0 / self.max_m, 1.0 / self.min_m]
    }

    /// Checks that cells of `cell_m` resolve the shortest wavelength.
    ///
    /// # Errors
    /// [`BandError::Coarse`] if they are larger than half of it.
    pub fn fits_cells(&self, cell_m: f64) -> Result<(), BandError> {
        let limit_m = 0.5 * self.min_m;
        // Tolerance for rounding: a cell of 0.165 m is half of 0.33 m.
        let fits = cell_m <= limit_m * (1.0 + 1e-9);
        if fits { Ok(()) } else { Err(BandError::Coarse { min_m: self.min_m, limit_m, cell_m }) }
    }

    /// Checks that a surface whose longer side is `side_m` is long enough for the longest wavelength.
    ///
    /// # Errors
    /// [`BandError::Short`] if it is shorter than 4 times that wavelength.
    pub fn fits_length(&self, side_m: f64) -> Result<(), BandError> {
        let needed_m = LENGTHS_MIN * self.max_m;
        let fits = side_m >= needed_m * (1.0 - 1e-9);
        if fits { Ok(()) } else { Err(BandError::Short { max_m: self.max_m, needed_m, side_m }) }
    }
}

/// How the local mean is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Detrender {
    /// Keep only the band of wavelengths, profile by profile.
    Band,
    /// Subtract the plain mean over a square of the longest wavelength; by definition also at borders and holes.
    MovingAverage,
    /// Subtract an exponentially weighted mean of the profile.
    Exponential,
}

impl Detrender {
    /// Name in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Band => "band",
            Self::MovingAverage => "moving_average",
            Self::Exponential => "exponential",
        }
    }
}

/// Squared heights about the local mean, m2: one grid for profiles along x and one along y, or a single grid for the surface
/// ([`Detrender::MovingAverage`]). NaN where undefined.
#[derive(Clone, Debug)]
pub struct Detrended {
    squares: Vec<Grid>,
    max_m: f64,
}

impl Detrended {
    /// Removes the local mean.
    pub fn of(dem: &Grid, band: &WaveBand, detrender: Detrender) -> Self {
        let squares = match detrender {
            Detrender::MovingAverage => vec![above_average(dem, band.max_m)],
            Detrender::Band | Detrender::Exponential => along_both(dem, band, detrender),
        };
        Self { squares: squares.into_iter().map(|left| left.map(|v| v * v)).collect(), max_m: band.max_m }
    }

    /// RMS along x and along y, m; NaN if no profile is long enough; one value for both with the moving average.
    pub fn rms_along_m(&self) -> Vec<f64> {
        self.squares.iter().map(|s| sums::mean(&sums::finite(&s.values)).sqrt()).collect()
    }

    /// RMS over the profiles of both directions, or of the only one defined, m; NaN if neither is.
    pub fn rms_m(&self) -> f64 {
        let squares: Vec<f64> = self.rms_along_m().into_iter().filter(|r| r.is_finite()).map(|r| r * r).collect();
        sums::mean(&squares).sqrt()
    }

    /// RMS in a window about each cell, m; the window is three times the longest wavelength wide, or as wide as the surface. NaN where
    /// the squares themselves are undefined, and where less than a quarter of the window is defined.
    pub fn rms_map(&self) -> Grid {
        let mean = match &self.squares[..] {
            [x, y] => sastrugi_numeric::ops::combine(x, y, mean_of_defined),
            squares => squares[0].clone(),
        };
        let g = &mean.geometry;
        let half = [(g.cell[1], g.rows), (g.cell[0], g.cols)]
            .map(|(cell, count)| odd_cells(WINDOW_LENGTHS * self.max_m, cell).min(largest_odd(count)) / 2);
        // The plain mean, because a plane through squares may go below zero at a border.
        // Rounding in the running sums may still give a value just below zero.
        background_of(&mean, BoxWindow { half }, AtPartial::Mean, WINDOW_SHARE_MIN)
            .map(|square| if square < 0.0 { 0.0 } else { square.sqrt() })
    }
}

/// Side of the window of an RMS map over the longest wavelength.
const WINDOW_LENGTHS: f64 = 3.0;
/// Share of the window that must be defined: a quarter, as in a corner, less a margin for rounding.
const WINDOW_SHARE_MIN: f64 = 0.24;

/// Largest odd number not above `count`: a window no wider than the surface.
fn largest_odd(count: usize) -> usize {
    count - usize::from(count.is_multiple_of(2) && count > 0)
}

fn mean_of_defined(a: f64, b: f64) -> f64 {
    match (a.is_finite(), b.is_finite()) {
        (true, true) => 0.5 * (a + b),
        (true, false) => a,
        _ => b,
    }
}

fn above_average(dem: &Grid, window_m: f64) -> Grid {
    let window = BoxWindow::nearest(window_m, dem.geometry.cell);
    // The published measure is defined by the plain mean, also where a window is incomplete; `band_rms` uses the plane.
    let average = background_of(dem, window, AtPartial::Mean, FILLED_SHARE_MIN);
    sastrugi_numeric::ops::combine(dem, &average, |z, mean| z - mean)
}

/// Detrended profiles, all along x and all along y.
fn along_both(dem: &Grid, band: &WaveBand, detrender: Detrender) -> Vec<Grid> {
    let (rows, cols) = (dem.rows(), dem.cols());
    let [dx, dy] = dem.geometry.cell;
    let along_x = detrended(&dem.values, cols, dx, band, detrender);
    let by_col = detrended(&transposed(&dem.values, rows, cols), rows, dy, band, detrender);
    let along_y = transposed(&by_col, cols, rows);
    [along_x, along_y].map(|values| Grid { geometry: dem.geometry, values }).into()
}

/// Detrends consecutive profiles of `n` cells.
fn detrended(profiles: &[f64], n: usize, cell_m: f64, band: &WaveBand, detrender: Detrender) -> Vec<f64> {
    let filter = Filter { cell_m, band: *band, detrender, trim: (band.max_m / cell_m).ceil() as usize };
    let transforms = filter.transforms(profiles, n);
    let mut left = vec![f64::NAN; profiles.len()];
    left.par_chunks_mut(n).zip(profiles.par_chunks(n)).for_each(|(out, profile)| {
        for [from, to] in runs(profile, filter.shortest()) {
            let transform = transforms.get(&filter.continued_length(to - from));
            filter.run(&profile[from..to], transform, &mut out[from..to]);
        }
    });
    left
}

/// Runs of at least `shortest` cells with data, each as its first cell and the one after its last.
pub(crate) fn runs(profile: &[f64], shortest: usize) -> Vec<[usize; 2]> {
    let mut runs = Vec::new();
    let mut start = 0;
    for (end, z) in profile.iter().chain([&f64::NAN]).enumerate() {
        if !z.is_finite() {
            if end - start >= shortest {
                runs.push([start, end]);
            }
            start = end + 1;
        }
    }
    runs
}

/// Detrending of profiles with a given cell size.
struct Filter {
    cell_m: f64,
    band: WaveBand,
    detrender: Detrender,
    /// Cells discarded at each end.
    trim: usize,
}

impl Filter {
    /// Fewest cells in a run.
    fn shortest(&self) -> usize {
        3 * self.trim
    }

    /// Length of a run including its continuation.
    fn continued_length(&self, run: usize) -> usize {
        smooth_length(run + FADE_LENGTHS * self.trim)
    }

    /// Transforms of the continued runs, by length.
    fn transforms(&self, profiles: &[f64], n: usize) -> BTreeMap<usize, Transform> {
        if self.detrender != Detrender::Band {
            return BTreeMap::new();
        }
        let lengths = profiles
            .par_chunks(n)
            .flat_map_iter(|p| runs(p, self.shortest()).into_iter().map(|[from, to]| self.continued_length(to - from)));
        let mut lengths: Vec<usize> = lengths.collect();
        lengths.sort_unstable();
        lengths.dedup();
        lengths.into_par_iter().map(|len| (len, Transform::new(len))).collect()
    }

    /// Writes one detrended run to `out`, except for its trimmed ends.
    fn run(&self, run: &[f64], transform: Option<&Transform>, out: &mut [f64]) {
        let left = match transform {
            Some(transform) => {
                let reach = (SLOPE_LENGTHS * self.band.max_m / self.cell_m).ceil() as usize;
                self.in_band(&without_parabola(run, reach), transform)
            }
            None => above_exponential_mean(run, libm::exp(-self.cell_m / self.band.max_m)),
        };
        let inner = self.trim..run.len() - self.trim;
        out[inner.clone()].copy_from_slice(&left[inner]);
    }

    /// Band-pass of the continued run.
    fn in_band(&self, run: &[f64], transform: &Transform) -> Vec<f64> {
        let (n, len) = (run.len(), transform.len());
        let mut scratch = transform.scratch();
        let beyond = (0..len - n).map(|k| continued(run, k, len - n));
        let mut work: Vec<Complex64> = run.iter().copied().chain(beyond).map(|v| Complex64::new(v, 0.0)).collect();
        transform.forward(&mut work, &mut scratch);
        let [low, high] = self.band.frequencies().map(|f| f * len as f64 * self.cell_m);
        for (k, v) in work.iter_mut().enumerate() {
            let cycles = k.min(len - k) as f64;
            if cycles < low || cycles > high {
                *v = Complex64::default();
            }
        }
        transform.inverse_unscaled(&mut work, &mut scratch);
        work[..n].iter().map(|v| v.re / len as f64).collect()
    }
}

/// Length over which the slope at an end is fitted, in longest wavelengths.
const SLOPE_LENGTHS: f64 = 0.25;
/// Length over which the continuations of both ends are cross-faded, in longest wavelengths.
const FADE_LENGTHS: usize = 8;

/// Cell `k` of the `gap` cells between the end of a run and the start of its next period.
fn continued(run: &[f64], k: usize, gap: usize) -> f64 {
    let n = run.len();
    let mirrored = |index: usize| {
        let index = index % (2 * n);
        run[index.min(2 * n - 1 - index)]
    };
    let (after, before) = (mirrored(n + k), mirrored(gap - 1 - k));
    let t = (k as f64 + 0.5) / gap as f64;
    let weight = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    after + weight * (before - after)
}

/// The profile minus the parabola whose end slopes are those of the least-squares lines through its first and last `reach`
/// cells, centred on zero.
fn without_parabola(profile: &[f64], reach: usize) -> Vec<f64> {
    let n = profile.len();
    let reach = reach.clamp(2, n);
    let (first, last) = (slope(&profile[..reach]), slope(&profile[n - reach..]));
    let bend = 0.5 * (last - first) / (n - 1) as f64;
    let level = |(k, z): (usize, &f64)| z - k as f64 * (first + bend * k as f64);
    let level: Vec<f64> = profile.iter().enumerate().map(level).collect();
    let mean = sums::mean(&level);
    level.into_iter().map(|z| z - mean).collect()
}

/// Slope of the least-squares line, per cell.
fn slope(profile: &[f64]) -> f64 {
    let middle = 0.5 * (profile.len() - 1) as f64;
    let mean = sums::mean(profile);
    let (mut along, mut squares) = (0.0, 0.0);
    for (k, z) in profile.iter().enumerate() {
        let d = k as f64 - middle;
        along += d * (z - mean);
        squares += d * d;
    }
    along / squares
}

/// Profile minus its mean with weights `ratio^|d|` over the cells of the profile.
fn above_exponential_mean(profile: &[f64], ratio: f64) -> Vec<f64> {
    let forward = decayed(profile.iter(), ratio);
    let mut backward = decayed(profile.iter().rev(), ratio);
    backward.reverse();
    let mean = |((z, a), b): ((&f64, &[f64; 2]), &[f64; 2])| z - (a[0] + b[0] - z) / (a[1] + b[1] - 1.0);
    profile.iter().zip(&forward).zip(&backward).map(mean).collect()
}

/// Recursive sums `s_k = z_k + ratio s_(k-1)` of the values and of ones.
fn decayed<'a>(values: impl Iterator<Item = &'a f64>, ratio: f64) -> Vec<[f64; 2]> {
    let step = |so_far: &mut [f64; 2], z: &f64| {
        *so_far = [z + ratio * so_far[0], 1.0 + ratio * so_far[1]];
        Some(*so_far)
    };
    values.scan([0.0; 2], step).collect()
}

#[cfg(test)]
mod tests;
