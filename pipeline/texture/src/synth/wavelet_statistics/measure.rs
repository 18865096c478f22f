//! Wavelet statistics of a masked residual.
//!
//! Cells without data are 0 for the transforms, with an empty margin around the raster; a magnitude counts only where the cells within `2^j`
//! of it (octave j) all have data, so that the edges of holes do not count as texture. A covariance between octaves is the
//! correlation on the cells of the coarser one, with the standard deviations of each.

use super::bands::{Bands, ORIENTATIONS};
use super::differences;
use super::symmetric::Symmetric;
use crate::synth::statistics::lags;
use rayon::prelude::*;
use sastrugi_numeric::fft::smooth_length;
use sastrugi_numeric::{Grid, sums};
use sastrugi_schemas::statistics::{LagCovariances, Wavelets};

/// Most octaves.
pub const OCTAVES_MAX: usize = 5;
/// Fewest cells of an octave far enough from any hole, in units of the area of its wavelets.
const WAVELETS_MIN: usize = 64;
/// Largest lag of the covariance of the patches, cells.
const PATCH_LAG_MAX: usize = 128;
/// The floor of magnitudes, relative to the root mean square height.
const FLOOR: f64 = 1e-6;
/// Smallest eigenvalue of the covariance of the logarithms over the largest.
const EIGENVALUE_MIN: f64 = 1e-6;

/// The wavelet statistics of a residual with relief, with lags and wavelengths up to some `lag_max` cells.
pub fn measure(residual: &Grid, probabilities: &[f64], lag_max: usize) -> Wavelets {
    let differences = differences::measure(residual, probabilities, lag_max);
    let masks = masks(residual, lag_max);
    let floor_m = FLOOR * sums::variance(&sums::finite(&residual.values)).sqrt();
    let logarithms = logarithms(residual, masks.len(), floor_m);
    let count = logarithms.len();
    let data = |band: usize, mask: &[bool]| -> Vec<f64> {
        logarithms[band].iter().zip(mask).filter(|(_, here)| **here).map(|(l, _)| *l).collect()
    };
    let own: Vec<[f64; 2]> = (0..count)
        .map(|band| {
            let values = data(band, &masks[band / ORIENTATIONS]);
            [sums::mean(&values), sums::variance(&values).sqrt()]
        })
        .collect();
    let covariance = |a: usize, b: usize| {
        let mask = &masks[a.max(b) / ORIENTATIONS];
        correlation(&data(a, mask), &data(b, mask)) * own[a][1] * own[b][1]
    };
    let upper: Vec<f64> = (0..count * count)
        .into_par_iter()
        .map(|at| if at / count <= at % count { covariance(at / count, at % count) } else { 0.0 })
        .collect();
    let values =
        (0..count * count).map(|at| upper[(at / count).min(at % count) * count + (at / count).max(at % count)]);
    let mean_log: Vec<f64> = own.iter().map(|[mean, _]| *mean).collect();
    let patches = masks.last().map(|mask| patches(residual, &logarithms, &mean_log, mask));
    Wavelets {
        differences,
        octaves: masks.len() as u32,
        floor_m,
        mean_log,
        covariance_log: positive(Symmetric { size: count, values: values.collect() }),
        patches,
    }
}

/// Covariance by lag of the mean of all bands' logarithms about their means, on the cells of a mask.
fn patches(residual: &Grid, logarithms: &[Vec<f64>], mean_log: &[f64], mask: &[bool]) -> LagCovariances {
    let at = |k: usize| match mask[k] {
        true => logarithms.iter().zip(mean_log).map(|(l, mean)| l[k] - mean).sum::<f64>() / mean_log.len() as f64,
        false => f64::NAN,
    };
    let common = Grid::new(residual.geometry, (0..mask.len()).into_par_iter().map(at).collect());
    let centre = sums::mean(&sums::finite(&common.values));
    let lag_max = [residual.rows(), residual.cols()].map(|n| (n / 3).min(PATCH_LAG_MAX));
    lags::measure(&common.map(|v| v - centre), lag_max)
}

/// For each octave that has enough of them, the cells whose wavelets touch no hole.
fn masks(residual: &Grid, lag_max: usize) -> Vec<Vec<bool>> {
    let enough = |(octave, mask): &(usize, Vec<bool>)| {
        let area = 1_usize << (2 * *octave);
        mask.iter().filter(|here| **here).count() >= WAVELETS_MIN * area
    };
    let all = (0..OCTAVES_MAX).filter(|octave| (2_usize << *octave) <= lag_max);
    all.map(|octave| (octave, clear(residual, 1_usize << octave))).take_while(enough).map(|(_, mask)| mask).collect()
}

/// Cells whose neighbours up to `distance` rows and columns away all have data; there is none beyond the raster.
fn clear(z: &Grid, distance: usize) -> Vec<bool> {
    let (rows, cols) = (z.rows(), z.cols());
    // Holes north-west of each corner.
    let mut holes = vec![0u32; (rows + 1) * (cols + 1)];
    for r in 0..rows {
        let mut line = 0;
        for c in 0..cols {
            line += u32::from(!z.at(r, c).is_finite());
            holes[(r + 1) * (cols + 1) + c + 1] = holes[r * (cols + 1) + c + 1] + line;
        }
    }
    let is_clear = |r: usize, c: usize| {
        let inside = r >= distance && c >= distance && r + distance < rows && c + distance < cols;
        inside && {
            let corner = |r: usize, c: usize| holes[r * (cols + 1) + c];
            let (top, left, bottom, right) = (r - distance, c - distance, r + distance + 1, c + distance + 1);
            corner(bottom, right) + corner(top, left) == corner(top, right) + corner(bottom, left)
        }
    };
    (0..rows * cols).map(|k| is_clear(k / cols, k % cols)).collect()
}

/// Logarithms of the magnitudes of each band at the cells of the raster.
fn logarithms(residual: &Grid, octaves: usize, floor_m: f64) -> Vec<Vec<f64>> {
    let (rows, cols) = (residual.rows(), residual.cols());
    let [height, width] = [rows, cols].map(|n| smooth_length(n + (1 << octaves)));
    let mut field = vec![0.0; height * width];
    for (r, line) in field.chunks_exact_mut(width).take(rows).enumerate() {
        line.iter_mut().zip(residual.row(r)).for_each(|(out, z)| *out = if z.is_finite() { *z } else { 0.0 });
    }
    let bands = Bands::new([height, width], octaves);
    let spectrum = bands.fft().forward(&field);
    (0..bands.count())
        .map(|band| {
            let found = bands.band(&spectrum, band);
            let at = |k: usize| {
                let at = k / cols * width + k % cols;
                super::logarithm(found.real[at], found.imaginary[at], floor_m)
            };
            (0..rows * cols).into_par_iter().map(at).collect()
        })
        .collect()
}

/// Pearson's correlation; 0 if one side does not vary.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (sums::mean(a), sums::mean(b));
    let product: Vec<f64> = a.iter().zip(b).map(|(x, y)| (x - mean_a) * (y - mean_b)).collect();
    let size = (sums::variance(a) * sums::variance(b)).sqrt();
    if size > 0.0 { (sums::mean(&product) / size).clamp(-1.0, 1.0) } else { 0.0 }
}

/// The nearest covariance without negative eigenvalues; those of different masks may leave some.
fn positive(covariance: Symmetric) -> Vec<f64> {
    if covariance.size == 0 {
        return Vec::new();
    }
    let trace: f64 = (0..covariance.size).map(|k| covariance.values[k * covariance.size + k]).sum();
    let least = (EIGENVALUE_MIN * trace).max(f64::MIN_POSITIVE);
    covariance.with_eigenvalues(|e| e.max(least)).values
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn noise(rows: usize, cols: usize) -> Grid {
        let mut stream = Streams::for_seed(1, "wavelet-measure-test").stream("noise");
        Grid::new(Geometry::square(rows, cols, 1.0), (0..rows * cols).map(|_| stream.normal()).collect())
    }

    /// The count of holes around each cell, by hand.
    #[test]
    fn val_clear_cells_are_far_from_holes() {
        let mut z = noise(23, 31);
        [40, 111, 112, 500, 700].into_iter().for_each(|k| z.values[k] = f64::NAN);
        for distance in [1, 2, 4] {
            let d = distance as isize;
            for (k, found) in clear(&z, distance).into_iter().enumerate() {
                let (r, c) = ((k / 31) as isize, (k % 31) as isize);
                let has_data = |r: isize, c: isize| {
                    (0..23).contains(&r) && (0..31).contains(&c) && z.at(r as usize, c as usize).is_finite()
                };
                let expected = (r - d..=r + d).all(|r| (c - d..=c + d).all(|c| has_data(r, c)));
                assert_eq!(found, expected, "{distance}, {r}, {c}");
            }
        }
    }

    /// Holes in stationary noise do not change its statistics beyond sampling. Null: equal; some 24 000 and 15 000 correlated magnitudes a band,
    /// at least 400 independent ones in the coarsest octave, whose logarithm has a standard deviation of 0.64: 0.2 is six standard errors
    /// (2e-9 for each of 12 bands).
    #[test]
    fn stat_holes_do_not_count_as_texture() {
        let whole = noise(160, 160);
        let mut holed = whole.clone();
        for r in 0..160 {
            for c in 0..160 {
                if r / 40 + c / 40 == 3 {
                    holed.values[r * 160 + c] = f64::NAN;
                }
            }
        }
        let probabilities = crate::synth::statistics::tails::probabilities();
        let [a, b] = [&whole, &holed].map(|z| measure(z, &probabilities, 8));
        assert_eq!((a.octaves, b.octaves), (3, 3));
        assert!(
            a.mean_log.iter().zip(&b.mean_log).all(|(x, y)| (x - y).abs() < 0.2),
            "{:?} {:?}",
            a.mean_log,
            b.mean_log
        );
        assert!(a.check().is_ok() && b.check().is_ok());
    }

    /// Too few cells away from holes leave no octave, and the section is still valid.
    #[test]
    fn val_small_pieces_have_no_octaves() {
        let mut z = noise(64, 64);
        (0..64 * 64).filter(|k| k % 64 % 3 == 0).for_each(|k| z.values[k] = f64::NAN);
        let found = measure(&z, &crate::synth::statistics::tails::probabilities(), 16);
        assert_eq!(found.octaves, 0);
        assert!(found.check().is_ok() && !found.differences.is_empty());
    }
}
