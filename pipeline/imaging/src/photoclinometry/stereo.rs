//! Stereo points: where windows of predicted and observed images correlate, and the heights that this means.
//!
//! Around every point of a lattice a window of map cells is shaded as each image should show it. The same cells are read from the image with all
//! offsets of whole pixels up to `search`; the offset of the greatest normalised correlation, refined by a parabola along each axis, is how far the
//! image shows the window from where the surface so far puts it. The offsets of all images together place the window's centre in space by
//! least squares over the cameras.
//!
//! With a correlation `rho` at the peak, curvature `kappa` (per square pixel) and `n` cells, an offset has the variance
//! `(1 - rho^2) / (n rho kappa)`: that of the least-squares offset between a signal and a copy with white noise of the residual's strength.
//! It is not put below 0.05 pixels, since resampling alone moves peaks by that much.

use super::integration::HeightPoint;
use super::normal::Symmetric3;
use super::observation::{Image, Relief};
use super::params::Stereo;
use crate::direction::Vector;
use rayon::prelude::*;

/// Least standard deviation of an offset, pixels.
const OFFSET_SIGMA_MIN: f64 = 0.05;
/// Share of a window that has to be lit and seen.
const SHARE_MIN: f64 = 0.8;
/// Greatest ratio of the axes of a point's error ellipsoid: views nearer to each other give no height.
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
    /// Standard deviations.
    pub sigma: [f64; 2],
    /// Normalised correlation at the peak.
    pub correlation: f64,
}

/// Points on a lattice over the map. `shade(image, cell)` is the brightness predicted, `None` where the surface is not known well enough.
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

/// The offset of an image from places and brightness predicted; `None` where the greatest correlation lies at the end of the search.
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
    let [across, down] = [1, side].map(|pitch| parabola([curve[best - pitch], curve[best], curve[best + pitch]]));
    let ((x, bend_x), (y, bend_y)) = (across?, down?);
    let peak = curve[best].min(1.0 - 1e-9);
    let sigma = |bend: f64| ((1.0 - peak * peak) / (cells.len() as f64 * peak * bend)).sqrt().max(OFFSET_SIGMA_MIN);
    let pixels = [col as f64 - reach + x, row as f64 - reach + y];
    (peak > 0.0).then(|| Offset { pixels, sigma: [sigma(bend_x), sigma(bend_y)], correlation: curve[best] })
}

/// Top of the parabola through three values at -1, 0 and 1, and its curvature.
fn parabola([before, at, after]: [f64; 3]) -> Option<(f64, f64)> {
    let bend = 2.0 * at - before - after;
    (bend > 0.0).then(|| (0.5 * (after - before) / bend, bend))
}

/// Normalised correlation of predicted brightness and the image at an offset; NaN where pixels are missing.
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

/// The point that all images show at their offsets from `centre`, and the standard deviation of its height, m; `None` with fewer than two
/// images, views too much alike, or offsets that no point explains.
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
            for axis in 0..2 {
                let mut row = [0.0; 3];
                for (k, slope) in row.iter_mut().enumerate() {
                    let mut beside = place;
                    beside[k] += step_m;
                    *slope = (image.camera.project(beside)?[axis] - here[axis]) / step_m;
                }
                let residual = first[axis] + offset.pixels[axis] - here[axis];
                let weight = 1.0 / (offset.sigma[axis] * offset.sigma[axis]);
                normal.add(row, weight);
                (0..3).for_each(|k| right[k] += weight * row[k] * residual);
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
