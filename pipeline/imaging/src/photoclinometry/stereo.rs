//! Stereo points: heights from the correlation of predicted and observed image windows.
//!
//! Around every point of a lattice, a window of map cells is shaded as predicted for each image. The same cells are read from the image at all
//! whole-pixel offsets up to `search`. The offset with the largest normalised correlation, refined by a paraboloid, is the displacement of the
//! window in the image relative to its position predicted by the current surface. The offsets of all images determine the window's centre in
//! space by least squares over the cameras.
//!
//! With a correlation `rho` at the peak, the matrix of its second derivatives `-K` (per square pixel) and `n` cells, an offset has the covariance
//! `(1 - rho^2) / (n rho) K^-1`: that of the least-squares offset between a signal and a copy with white noise of the residual's strength. A
//! window with edges in one direction thus counts only across them. A standard deviation of 0.05 pixels is added, by which resampling alone
//! shifts peaks.

use super::integration::HeightPoint;
use super::normal::Symmetric3;
use super::observation::{Image, Relief};
use super::params::Stereo;
use crate::direction::Vector;
use rayon::prelude::*;

/// Standard deviation of an offset without noise, pixels.
const OFFSET_SIGMA_MIN: f64 = 0.05;
/// Steps of the successive paraboloids, pixels.
const PARABOLOIDS: [f64; 2] = [1.0, 0.5];
/// Share of a window that must be lit and seen.
const SHARE_MIN: f64 = 0.8;
/// Largest ratio of the axes of a point's error ellipsoid: views that are too similar give no height.
const CONDITION_MAX: f64 = 40.0;
/// Largest rms distance of offsets from those of the common point, pixels.
const DISAGREEMENT_MAX: f64 = 1.0;
/// Rounds of the triangulation.
const ROUNDS: usize = 3;

/// An offset of a window in one image, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Along columns and rows.
    pub pixels: [f64; 2],
    /// Variance along columns, covariance, variance along rows, square pixels.
    pub covariance: [f64; 3],
    /// Normalised correlation at the peak.
    pub correlation: f64,
}

/// Points on a lattice over the map. `shade(image, cell)` is the predicted brightness, `None` where the surface is not known well enough.
pub fn points(
    images: &[Image],
    relief: Relief,
    shade: &(impl Fn(usize, usize) -> Option<f64> + Sync),
    settings: &Stereo,
) -> Vec<HeightPoint> {
    let g = relief.geometry;
    let lattice = |n: usize| (settings.reach..n.saturating_sub(settings.reach)).step_by(settings.spacing);
    let centres: Vec<[usize; 2]> = lattice(g.rows).flat_map(|r| lattice(g.cols).map(move |c| [r, c])).collect();
    centres.into_par_iter().filter_map(|centre| point(images, relief, shade, settings, centre)).collect()
}

fn point(
    images: &[Image],
    relief: Relief,
    shade: &impl Fn(usize, usize) -> Option<f64>,
    settings: &Stereo,
    [row, col]: [usize; 2],
) -> Option<HeightPoint> {
    let g = relief.geometry;
    let (reach, side) = (settings.reach, 2 * settings.reach + 1);
    let window: Vec<usize> =
        (0..side * side).map(|k| (row + k / side - reach) * g.cols + col + k % side - reach).collect();
    let centre = relief.point(row * g.cols + col);
    let seen: Vec<(&Image, Offset)> = images
        .iter()
        .enumerate()
        .filter_map(|(k, image)| {
            let cells: Vec<([f64; 2], f64)> = window
                .iter()
                .filter_map(|&cell| Some((image.camera.project(relief.point(cell))?, shade(k, cell)?)))
                .collect();
            let enough = cells.len() as f64 >= SHARE_MIN * window.len() as f64;
            let offset = if enough { correlate(image, &cells, settings.search) } else { None }?;
            (offset.correlation >= settings.quality).then_some((image, offset))
        })
        .collect();
    let (place, sigma_m) = triangulate(&seen, centre, g.mean_cell())?;
    let strayed = (place[0] - centre[0]).abs().max((place[1] - centre[1]).abs()) > reach as f64 * g.mean_cell();
    (!strayed).then_some(HeightPoint { x_m: place[0], y_m: place[1], height_m: place[2], sigma_m })
}

/// The offset of an image relative to predicted positions and brightness; `None` if the largest correlation lies at the limit of the search.
pub fn correlate(image: &Image, cells: &[([f64; 2], f64)], search: usize) -> Option<Offset> {
    let (reach, side) = (search as f64, 2 * search + 1);
    let curve: Vec<f64> = (0..side * side)
        .map(|k| correlation(image, cells, [(k % side) as f64 - reach, (k / side) as f64 - reach]))
        .collect();
    let best = (0..curve.len()).filter(|&k| curve[k].is_finite()).max_by(|&a, &b| curve[a].total_cmp(&curve[b]))?;
    let (row, col) = (best / side, best % side);
    if row == 0 || col == 0 || row + 1 == side || col + 1 == side {
        return None;
    }
    let mut pixels = [col as f64 - reach, row as f64 - reach];
    let mut bend = [f64::NAN; 3];
    for step in PARABOLOIDS {
        let (shift, found) =
            paraboloid(|u, v| correlation(image, cells, [pixels[0] + u * step, pixels[1] + v * step]))?;
        (0..2).for_each(|k| pixels[k] += step * shift[k]);
        bend = found.map(|b| b / (step * step));
    }
    let correlation = correlation(image, cells, pixels);
    let peak = correlation.min(1.0 - 1e-9);
    let factor = (1.0 - peak * peak) / (cells.len() as f64 * peak * (bend[0] * bend[2] - bend[1] * bend[1]));
    let least = OFFSET_SIGMA_MIN * OFFSET_SIGMA_MIN;
    let covariance = [bend[2] * factor + least, -bend[1] * factor, bend[0] * factor + least];
    (peak > 0.0).then_some(Offset { pixels, covariance, correlation })
}

/// Maximum of the paraboloid through values at the nine positions `u`, `v` of -1, 0 and 1 (cross term from the corners), and its curvature: minus
/// the second derivatives by `uu`, `uv`, `vv`. `None` if it has no maximum within 1 of the centre.
fn paraboloid(value: impl Fn(f64, f64) -> f64) -> Option<([f64; 2], [f64; 3])> {
    let at = value(0.0, 0.0);
    let [west, east, north, south] = [value(-1.0, 0.0), value(1.0, 0.0), value(0.0, -1.0), value(0.0, 1.0)];
    let corners = value(1.0, 1.0) - value(1.0, -1.0) - value(-1.0, 1.0) + value(-1.0, -1.0);
    let bend = [2.0 * at - west - east, -0.25 * corners, 2.0 * at - north - south];
    let slope = [0.5 * (east - west), 0.5 * (south - north)];
    let determinant = bend[0] * bend[2] - bend[1] * bend[1];
    let top = [
        (bend[2] * slope[0] - bend[1] * slope[1]) / determinant,
        (bend[0] * slope[1] - bend[1] * slope[0]) / determinant,
    ];
    let convex = bend[0] > 0.0 && determinant > 0.0;
    (convex && top.iter().all(|t| t.abs() <= 1.0)).then_some((top, bend))
}

/// Normalised correlation of the predicted brightness and the image at an offset; NaN if pixels are missing.
fn correlation(image: &Image, cells: &[([f64; 2], f64)], [du, dv]: [f64; 2]) -> f64 {
    let pairs: Vec<[f64; 2]> = cells.iter().map(|([u, v], p)| [*p, image.at([u + du, v + dv])]).collect();
    correlation_of(&pairs)
}

/// Pearson's correlation of pairs.
pub(super) fn correlation_of(pairs: &[[f64; 2]]) -> f64 {
    let n = pairs.len() as f64;
    let mean = [0, 1].map(|k| pairs.iter().map(|p| p[k]).sum::<f64>() / n);
    let mut sums = [0.0; 3];
    for [a, b] in pairs {
        let (a, b) = (a - mean[0], b - mean[1]);
        sums.iter_mut().zip([a * a, a * b, b * b]).for_each(|(s, v)| *s += v);
    }
    sums[1] / (sums[0] * sums[2]).sqrt()
}

/// The point that all images show at their offsets from `centre`, and the standard deviation of its height, m; `None` for fewer than two
/// images, views that are too similar, or offsets that do not fit a common point.
pub fn triangulate(seen: &[(&Image, Offset)], centre: Vector, step_m: f64) -> Option<(Vector, f64)> {
    if seen.len() < 2 {
        return None;
    }
    let mut place = centre;
    let mut sigma_m = f64::NAN;
    for _ in 0..ROUNDS {
        let (mut normal, mut right) = (Symmetric3::default(), [0.0; 3]);
        for (image, offset) in seen {
            let (first, here) = (image.camera.project(centre)?, image.camera.project(place)?);
            let mut rows = [[0.0; 3]; 2];
            for k in 0..3 {
                let mut beside = place;
                beside[k] += step_m;
                let there = image.camera.project(beside)?;
                (0..2).for_each(|axis| rows[axis][k] = (there[axis] - here[axis]) / step_m);
            }
            let residual = [0, 1].map(|axis| first[axis] + offset.pixels[axis] - here[axis]);
            for ([a, b], weight) in whitening(offset.covariance) {
                let row: Vector = std::array::from_fn(|k| a * rows[0][k] + b * rows[1][k]);
                normal.add(row, weight);
                let misses = weight * (a * residual[0] + b * residual[1]);
                (0..3).for_each(|k| right[k] += row[k] * misses);
            }
        }
        if normal.condition() > CONDITION_MAX {
            return None;
        }
        let covariance = normal.inverse()?;
        let move_by = covariance.times(right);
        (0..3).for_each(|k| place[k] += move_by[k]);
        sigma_m = covariance.0[5].sqrt();
    }
    let misses = seen.iter().map(|(image, offset)| {
        let (first, here) = (image.camera.project(centre), image.camera.project(place));
        let miss = |axis: usize| Some(first?[axis] + offset.pixels[axis] - here?[axis]);
        Some(miss(0)? * miss(0)? + miss(1)? * miss(1)?)
    });
    let squares: f64 = misses.sum::<Option<f64>>()?;
    let agrees = (squares / seen.len() as f64).sqrt() <= DISAGREEMENT_MAX;
    (agrees && place.iter().all(|v| v.is_finite())).then_some((place, sigma_m))
}

/// Two uncorrelated combinations of columns and rows with their weights, from the factorisation of the covariance.
fn whitening([uu, uv, vv]: [f64; 3]) -> [([f64; 2], f64); 2] {
    let across = uv / uu;
    [([1.0, 0.0], 1.0 / uu), ([-across, 1.0], 1.0 / (vv - across * uv))]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The top and the curvature of a paraboloid are exact; a saddle, or a top beyond the neighbours, does not count.
    #[test]
    fn val_a_paraboloid_is_found_exactly() {
        let of = |[u0, v0]: [f64; 2], [a, b, c]: [f64; 3]| {
            paraboloid(move |u, v| {
                let (du, dv) = (u - u0, v - v0);
                0.9 - a * du * du - b * du * dv - c * dv * dv
            })
        };
        for top in [[0.0, 0.0], [0.3, -0.8], [-0.9, 0.1]] {
            let (found, bend) = of(top, [0.2, 0.1, 0.4]).unwrap();
            assert!((0..2).all(|k| (found[k] - top[k]).abs() < 1e-12), "{found:?} {top:?}");
            assert!(bend.iter().zip([0.4, 0.1, 0.8]).all(|(a, b)| (a - b).abs() < 1e-12), "{bend:?}");
        }
        assert_eq!(of([0.0, 0.0], [0.2, 0.0, -0.4]), None);
        assert_eq!(of([0.0, 0.0], [-0.2, 0.0, -0.4]), None);
        assert_eq!(of([1.5, 0.0], [0.2, 0.0, 0.4]), None);
    }

    /// The weighted sum of the products of both combinations is the inverse of the covariance.
    #[test]
    fn val_whitening_inverts_the_covariance() {
        let mut sum = [0.0; 3];
        for ([a, b], weight) in whitening([0.04, 0.01, 0.09]) {
            sum.iter_mut().zip([a * a, a * b, b * b]).for_each(|(s, product)| *s += weight * product);
        }
        let inverse = [0.09 / 0.0035, -0.01 / 0.0035, 0.04 / 0.0035];
        assert!(sum.iter().zip(inverse).all(|(a, b)| (a - b).abs() < 1e-9), "{sum:?} {inverse:?}");
    }

    #[test]
    fn val_correlations_of_lines() {
        assert!((correlation_of(&[[1.0, 2.0], [2.0, 4.0], [4.0, 8.0]]) - 1.0).abs() < 1e-12);
        assert!((correlation_of(&[[1.0, 5.0], [2.0, 4.0], [4.0, 2.0]]) + 1.0).abs() < 1e-12);
        assert_eq!(correlation_of(&[[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]), 0.0);
    }
}
