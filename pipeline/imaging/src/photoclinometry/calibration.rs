//! Estimates exposure and haze of every image between the rounds.
//!
//! The predicted brightness `m` of the integrated surface and the observed brightness `I` are related by `I = E m + H`, a weighted regression
//! over lit cells. Slopes of separate cells would fit any exposure; the slopes of one surface do not, because most errors of the slopes are not
//! a gradient field. Undetermined quantities are held: the common factor of all exposures, which is that of the albedo, and the mean plane of
//! the surface, whose tilt has the same effect as different exposures of differently lit images. Constraints on heights determine that plane:
//! the plane through their residuals relative to the surface from the slopes alone is added to the mean plane of that surface.

use super::observation::{Calibration, Relief, Stack};
use crate::photometry::Photometry;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, sums};

/// Points nearer to one line than this determine no plane: product of the variances along their principal axes over the square of their sum.
const COLLINEAR: f64 = 1e-4;

/// Slopes of the least-squares plane through the known heights of a map; 0 if they do not determine a plane.
pub fn plane(g: &Geometry, heights_m: &[f64]) -> [f64; 2] {
    let known = heights_m.iter().enumerate().filter(|(_, z)| z.is_finite());
    let points: Vec<[f64; 4]> = known.map(|(k, z)| [g.x(k % g.cols), g.y(k / g.cols), *z, 1.0]).collect();
    plane_through(&points).unwrap_or_default()
}

/// Slopes of the least-squares plane through points `[x, y, z, weight]`; `None` for fewer than three points, or nearly collinear ones.
pub fn plane_through(points: &[[f64; 4]]) -> Option<[f64; 2]> {
    let total = |f: &dyn Fn(&[f64; 4]) -> f64| sums::sum(&points.iter().map(f).collect::<Vec<_>>());
    let weight = total(&|p| p[3]);
    let middle = [0, 1, 2].map(|axis| total(&|p| p[3] * p[axis]) / weight);
    let product = |a: usize, b: usize| total(&|p| p[3] * (p[a] - middle[a]) * (p[b] - middle[b]));
    let (xx, xy, yy, xz, yz) = (product(0, 0), product(0, 1), product(1, 1), product(0, 2), product(1, 2));
    let determinant = xx * yy - xy * xy;
    let spread = determinant > COLLINEAR * (xx + yy) * (xx + yy);
    (points.len() >= 3 && spread).then(|| [(yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant])
}

/// Predicted brightness of a cell in an image with exposure 1 and no haze.
fn predicted(stack: &Stack, image: usize, photometry: &Photometry, relief: Relief, k: usize, tilt: [f64; 2]) -> f64 {
    let source = &stack.images[image];
    let [p, q] = relief.slopes(k);
    photometry.of_slopes([p + tilt[0], q + tilt[1]], source.light, source.camera.view_from(relief.point(k)))
}

/// Rms difference between the observed brightness and that of a surface, divided by the mean brightness, over the lit cells of all images.
pub fn brightness_rms(stack: &Stack, photometry: &Photometry, relief: Relief, albedo: &[f64]) -> f64 {
    let of_image = |image: usize| -> Vec<[f64; 2]> {
        let one = |k: usize| {
            let sample = stack.sample(image, k, relief)?;
            let residual = sample.brightness - albedo[k] * predicted(stack, image, photometry, relief, k, [0.0; 2]);
            residual.is_finite().then_some([residual * residual, sample.brightness])
        };
        (0..albedo.len()).into_par_iter().with_min_len(1024).filter_map(one).collect()
    };
    let all: Vec<[f64; 2]> = (0..stack.images.len()).flat_map(of_image).collect();
    let mean = |k: usize| sums::mean(&all.iter().map(|v| v[k]).collect::<Vec<_>>());
    mean(0).sqrt() / mean(1)
}

/// Exposures and hazes that fit the surface best. With `to_plane`, the surface is first tilted to that mean plane. `free`: exposure, haze.
pub fn update(
    stack: &Stack,
    photometry: &Photometry,
    relief: Relief,
    albedo: &[f64],
    to_plane: Option<[f64; 2]>,
    free: [bool; 2],
) -> Vec<Calibration> {
    let tilt = to_plane.map_or([0.0; 2], |wanted| {
        let found = plane(relief.geometry, relief.heights_m);
        [wanted[0] - found[0], wanted[1] - found[1]]
    });
    let mut next: Vec<Calibration> = (0..stack.images.len())
        .map(|image| {
            let now = stack.calibrations[image];
            let one = |k: usize| {
                let sample = stack.sample(image, k, relief)?;
                let raw = sample.brightness * now.exposure + now.haze;
                let expected = albedo[k] * predicted(stack, image, photometry, relief, k, tilt);
                let weight = 1.0 / (sample.sigma * sample.sigma);
                (expected.is_finite() && expected > 0.0).then_some([weight, expected, raw])
            };
            let rows: Vec<[f64; 3]> = (0..albedo.len()).into_par_iter().with_min_len(1024).filter_map(one).collect();
            regression(&rows, now, free)
        })
        .collect();
    if free[0] {
        // The common factor is unchanged.
        let logs = |all: &[Calibration]| sums::mean(&all.iter().map(|c| libm::log(c.exposure)).collect::<Vec<_>>());
        let factor = libm::exp(logs(stack.calibrations) - logs(&next));
        next.iter_mut().for_each(|c| c.exposure *= factor);
    }
    next
}

/// Fits `raw = E expected + H` with the free parameters; rows are weight, expected, raw.
fn regression(rows: &[[f64; 3]], now: Calibration, free: [bool; 2]) -> Calibration {
    let total = |f: &dyn Fn(&[f64; 3]) -> f64| sums::sum(&rows.iter().map(f).collect::<Vec<_>>());
    let weight = total(&|r| r[0]);
    let (x, y) = (total(&|r| r[0] * r[1]) / weight, total(&|r| r[0] * r[2]) / weight);
    let next = match free {
        [true, true] => {
            let exposure = total(&|r| r[0] * (r[1] - x) * (r[2] - y)) / total(&|r| r[0] * (r[1] - x) * (r[1] - x));
            Calibration { exposure, haze: y - exposure * x }
        }
        [true, false] => {
            let exposure = total(&|r| r[0] * r[1] * (r[2] - now.haze)) / total(&|r| r[0] * r[1] * r[1]);
            Calibration { exposure, ..now }
        }
        [false, true] => Calibration { haze: y - now.exposure * x, ..now },
        [false, false] => now,
    };
    if next.exposure.is_finite() && next.exposure > 0.0 && next.haze.is_finite() { next } else { now }
}

/// Largest relative change of an exposure, or change of a haze divided by its exposure.
pub fn drift(before: &[Calibration], after: &[Calibration]) -> f64 {
    let of = |(a, b): (&Calibration, &Calibration)| {
        (b.exposure / a.exposure - 1.0).abs().max((b.haze - a.haze).abs() / a.exposure)
    };
    before.iter().zip(after).map(of).fold(0.0, f64::max)
}
