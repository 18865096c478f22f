//! Evaluation of a recovered surface against the truth.
//!
//! The rms error of heights does not distinguish good from failed inversions, because the longest wavelengths dominate it. Therefore there are
//! also the normalised correlation of the shaded truth and the shaded result, the slope error, and a comparison by wavelength. All are compared
//! with a ceiling: the score of the truth itself once it is averaged over the map's cells.
//!
//! Shaded means: albedo 1, with the mean brightness of the four facets between a cell's edges ([`shaded`]). A checkerboard of heights changes
//! it, whereas the brightness from central differences would not change.

use super::observation::Relief;
use super::stereo::correlation_of;
use crate::direction::Vector;
use crate::photometry::Photometry;
use rayon::prelude::*;
use sastrugi_numeric::fft::RealFft2;
use sastrugi_numeric::resample::block_means;
use sastrugi_numeric::{Geometry, Grid, Surface, sums};

/// Maximum number of cells of the truth along a cell of the map.
const FINER_MAX: usize = 8;

/// Comparison of a recovered surface with the truth over the cells where both are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Cells compared.
    pub cells: usize,
    /// Normalised correlation of the shaded truth and the shaded result.
    pub shaded_correlation: f64,
    /// The same for the truth averaged over the cells.
    pub shaded_correlation_ceiling: f64,
    /// Rms error of slopes (length of the difference of both gradients), 1.
    pub slope_error_rms: f64,
    /// The same for the truth averaged over the cells.
    pub slope_error_rms_ceiling: f64,
    /// Rms slope of the truth, 1.
    pub slope_rms: f64,
    /// Rms error of heights after removing its mean, m.
    pub height_error_rms_m: f64,
    /// Rms error of heights after removing its least-squares plane, m.
    pub height_error_rms_detrended_m: f64,
    /// Rms height of the truth about its mean, m.
    pub height_rms_m: f64,
}

/// Truth and result in a band of wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Number of the octave, from 0.
    pub octave: usize,
    /// Shortest wavelength, m.
    pub wavelength_min_m: f64,
    /// Longest wavelength, m.
    pub wavelength_max_m: f64,
    /// Number of Fourier modes in the band (a mode and its conjugate count once).
    pub modes: usize,
    /// Rms height of the truth, m.
    pub truth_rms_m: f64,
    /// Rms height of the result, m.
    pub recovered_rms_m: f64,
    /// Rms slope of the truth (length of the gradient), 1.
    pub truth_slope_rms: f64,
    /// Rms slope of the result, 1.
    pub recovered_slope_rms: f64,
    /// Covariance of truth and result, m2.
    pub covariance_m2: f64,
    /// Squared coherence: covariance squared over the product of the variances.
    pub coherence: f64,
}

/// Brightness of a surface of albedo 1: the mean of the four facets between the edges of each cell. NaN next to missing heights.
pub fn shaded(heights: &Grid, photometry: &Photometry, light: Vector, view: Vector) -> Grid {
    let relief = Relief { geometry: &heights.geometry, heights_m: &heights.values };
    let one = |k: usize| {
        let [west, east, south, north] = relief.edges(k);
        let pairs =
            [west, east].into_iter().flatten().flat_map(|p| [south, north].into_iter().flatten().map(move |q| [p, q]));
        let (sum, count) = pairs.fold((0.0, 0), |(sum, count), slopes: [f64; 2]| {
            let known = slopes[0].is_finite() && slopes[1].is_finite();
            (sum + if known { photometry.of_slopes(slopes, light, view) } else { f64::NAN }, count + 1)
        });
        sum / f64::from(count)
    };
    let values = (0..heights.values.len()).into_par_iter().with_min_len(1024).map(one).collect();
    Grid::new(heights.geometry, values)
}

/// The truth resampled to cells that divide those of the map: as fine as the truth itself, at most 8 along a cell. NaN outside the truth.
pub fn aligned(truth: &Grid, map: &Geometry) -> (Grid, usize) {
    let ratio = (0..2).map(|axis| map.cell[axis] / truth.geometry.cell[axis]).fold(1.0, f64::max);
    let finer = ((ratio - 1e-9).ceil() as usize).clamp(1, FINER_MAX);
    let g = Geometry {
        rows: map.rows * finer,
        cols: map.cols * finer,
        cell: map.cell.map(|cell| cell / finer as f64),
        origin: map.origin,
    };
    let at = |k: usize| {
        let nudge = |v: f64, low: f64, high: f64| {
            if (v - v.clamp(low, high)).abs() < 1e-9 * (high - low) { v.clamp(low, high) } else { v }
        };
        let t = &truth.geometry;
        let x = nudge(g.x(k % g.cols), t.x(0), t.x(t.cols - 1));
        let y = nudge(g.y(k / g.cols), t.y(t.rows - 1), t.y(0));
        truth.height(x, y).unwrap_or(f64::NAN)
    };
    let values = (0..g.len()).into_par_iter().with_min_len(1024).map(at).collect();
    (Grid::new(g, values), finer)
}

/// Compares heights recovered on a map with a truth of any cell size, shaded under one light and view. `None` if they share too few cells.
///
/// ```
/// use sastrugi_imaging::photoclinometry::evaluation::evaluate;
/// use sastrugi_imaging::{Photometry, direction};
/// use sastrugi_numeric::{Geometry, Grid};
///
/// let g = Geometry::square(12, 12, 1.0);
/// let truth = Grid::new(g, (0..g.len()).map(|k| 0.02 * ((k % 12) * (k / 12)) as f64).collect());
/// // The same relief, 5 m too high.
/// let high = truth.map(|z| z + 5.0);
/// let of = |found: &Grid| evaluate(&truth, found, &Photometry::default(), direction(40.0, 45.0), [0.0, 0.0, 1.0]).unwrap();
/// assert!((of(&high).shaded_correlation - 1.0).abs() < 1e-9);
/// assert!(of(&high).height_error_rms_m < 1e-9, "heights are compared without their mean");
/// ```
pub fn evaluate(
    truth: &Grid,
    recovered: &Grid,
    photometry: &Photometry,
    light: Vector,
    view: Vector,
) -> Option<Evaluation> {
    let (fine, finer) = aligned(truth, &recovered.geometry);
    let coarse = block_means(&fine, finer);
    let reference = block_means(&shaded(&fine, photometry, light, view), finer);
    let [shaded_result, shaded_ceiling] = [recovered, &coarse].map(|heights| shaded(heights, photometry, light, view));
    let fine_slopes = slopes(&fine);
    let true_slopes = fine_slopes.map(|values| block_means(&Grid::new(fine.geometry, values), finer).values);
    let [result_slopes, ceiling_slopes] = [recovered, &coarse].map(slopes);
    let cells: Vec<usize> = (0..recovered.values.len())
        .filter(|&k| {
            shaded_result.values[k].is_finite()
                && reference.values[k].is_finite()
                && shaded_ceiling.values[k].is_finite()
        })
        .filter(|&k| (0..2).all(|a| true_slopes[a][k].is_finite()))
        .collect();
    if cells.len() < 16 {
        return None;
    }
    let correlation = |a: &Grid| {
        let pairs: Vec<[f64; 2]> = cells.iter().map(|&k| [reference.values[k], a.values[k]]).collect();
        correlation_of(&pairs)
    };
    let rms = |f: &dyn Fn(usize) -> f64| sums::mean(&cells.iter().map(|&k| f(k)).collect::<Vec<_>>()).sqrt();
    let slope_error =
        |of: &[Vec<f64>; 2]| rms(&|k| (0..2).map(|a| of[a][k] - true_slopes[a][k]).map(|e| e * e).sum::<f64>());
    let errors: Vec<f64> = cells.iter().map(|&k| recovered.values[k] - coarse.values[k]).collect();
    let truths: Vec<f64> = cells.iter().map(|&k| coarse.values[k]).collect();
    Some(Evaluation {
        cells: cells.len(),
        shaded_correlation: correlation(&shaded_result),
        shaded_correlation_ceiling: correlation(&shaded_ceiling),
        slope_error_rms: slope_error(&result_slopes),
        slope_error_rms_ceiling: slope_error(&ceiling_slopes),
        slope_rms: rms(&|k| (0..2).map(|a| true_slopes[a][k] * true_slopes[a][k]).sum::<f64>()),
        height_error_rms_m: sums::variance(&errors).sqrt(),
        height_error_rms_detrended_m: sums::variance(&detrended(&recovered.geometry, &cells, &errors)).sqrt(),
        height_rms_m: sums::variance(&truths).sqrt(),
    })
}

/// Slopes of every cell from the neighbouring heights; NaN next to missing heights.
fn slopes(heights: &Grid) -> [Vec<f64>; 2] {
    let relief = Relief { geometry: &heights.geometry, heights_m: &heights.values };
    let known = |k: usize| relief.edges(k).iter().flatten().all(|slope| slope.is_finite());
    let of = |k: usize| if known(k) { relief.slopes(k) } else { [f64::NAN; 2] };
    let all: Vec<[f64; 2]> = (0..heights.values.len()).map(of).collect();
    [0, 1].map(|axis| all.iter().map(|s| s[axis]).collect())
}

/// Values of selected cells minus the least-squares plane through them.
fn detrended(g: &Geometry, cells: &[usize], values: &[f64]) -> Vec<f64> {
    use super::normal::Symmetric3;
    let place = |k: usize| {
        let (r, c) = (k / g.cols, k % g.cols);
        [1.0, c as f64 / g.cols as f64 - 0.5, r as f64 / g.rows as f64 - 0.5]
    };
    let (mut normal, mut right) = (Symmetric3::default(), [0.0; 3]);
    for (&k, v) in cells.iter().zip(values) {
        let row = place(k);
        normal.add(row, 1.0);
        (0..3).for_each(|a| right[a] += row[a] * v);
    }
    let plane = normal.inverse().map_or([0.0; 3], |inverse| inverse.times(right));
    let of = |k: usize| place(k).iter().zip(plane).map(|(a, b)| a * b).sum::<f64>();
    cells.iter().zip(values).map(|(&k, v)| v - of(k)).collect()
}

/// Compares both surfaces by octave of wavelength, from two cells upwards: heights minus the plane of their common cells, missing cells set to 0,
/// under a Hann window (with its mean square divided out). The squared slope of a mode of frequency `f` (cycles/m) is its squared height times
/// `(2 pi f)^2`, the squared length of the gradient. The window spreads every mode over its neighbours, which adds `4 pi^2 / 3` per squared side
/// of the map to that factor.
pub fn bands(truth: &Grid, recovered: &Grid) -> Vec<Band> {
    let g = &recovered.geometry;
    let (fine, finer) = aligned(truth, g);
    let coarse = block_means(&fine, finer);
    let cells: Vec<usize> =
        (0..g.len()).filter(|&k| coarse.values[k].is_finite() && recovered.values[k].is_finite()).collect();
    if cells.len() < 16 {
        return Vec::new();
    }
    let fft = RealFft2::new(g.rows, g.cols);
    let [a, b] = [&coarse, recovered].map(|heights| {
        let values: Vec<f64> = cells.iter().map(|&k| heights.values[k]).collect();
        let mut field = vec![0.0; g.len()];
        let level = detrended(g, &cells, &values);
        cells.iter().zip(level).for_each(|(&k, z)| field[k] = z * hann(k / g.cols, g.rows) * hann(k % g.cols, g.cols));
        fft.forward(&field)
    });
    // Mean square of the window: 3/8 along each axis.
    let norm = 1.0 / ((g.len() as f64) * (g.len() as f64) * (3.0 / 8.0) * (3.0 / 8.0));
    let longest = g.size()[0].max(g.size()[1]);
    let shortest = 2.0 * g.cell[0].max(g.cell[1]);
    let octaves = (libm::log2(longest / shortest).ceil() as usize).max(1);
    let mut totals = vec![([0.0; 5], 0usize); octaves];
    for kx in 0..a.half_cols() {
        for ky in 0..g.rows {
            let fx = kx as f64 / g.size()[0];
            let fy = ky.min(g.rows - ky) as f64 / g.size()[1];
            let frequency = (fx * fx + fy * fy).sqrt();
            let ratio = 1.0 / (frequency * shortest);
            if frequency == 0.0 || ratio < 1.0 - 1e-12 {
                continue;
            }
            let (u, v) = (a.values[kx * g.rows + ky], b.values[kx * g.rows + ky]);
            let times = norm * a.multiplicity(kx);
            let (sums, modes) = &mut totals[(libm::log2(ratio.max(1.0)) as usize).min(octaves - 1)];
            let wavenumber = 2.0 * std::f64::consts::PI * frequency;
            let (truth, result) = (u.norm_sqr(), v.norm_sqr());
            let steep = wavenumber * wavenumber;
            let products = [truth, result, (u * v.conj()).re, steep * truth, steep * result];
            sums.iter_mut().zip(products).for_each(|(s, p)| *s += times * p);
            *modes += 1;
        }
    }
    let band =
        |(octave, ([truth, result, product, truth_steep, result_steep], modes)): (usize, ([f64; 5], usize))| Band {
            octave,
            wavelength_min_m: shortest * (1u64 << octave) as f64,
            wavelength_max_m: shortest * (2u64 << octave) as f64,
            modes,
            truth_rms_m: truth.sqrt(),
            recovered_rms_m: result.sqrt(),
            truth_slope_rms: truth_steep.sqrt(),
            recovered_slope_rms: result_steep.sqrt(),
            covariance_m2: product,
            coherence: if truth * result > 0.0 { product * product / (truth * result) } else { 0.0 },
        };
    totals.into_iter().enumerate().filter(|(_, (_, modes))| *modes > 0).map(band).collect()
}

fn hann(k: usize, n: usize) -> f64 {
    let sin = libm::sin(std::f64::consts::PI * (k as f64 + 0.5) / n as f64);
    sin * sin
}
