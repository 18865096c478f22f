//! A world of known heights and albedo, and an independent renderer: facets between the corners of cells at least four times finer than the map's,
//! with explicit brightness formula, averaged over pixels. The inversion, in contrast, has slopes over edges between cell centres.

use crate::camera::{Camera, ParallelCamera};
use crate::direction::{Vector, direction};
use crate::photoclinometry::Image;
use sastrugi_numeric::{Geometry, Grid, Streams, sums};
use std::f64::consts::PI;

/// Number of facets along a cell of the map.
pub const FINER: usize = 4;

pub struct Scene {
    pub map: Geometry,
    pub height: Box<dyn Fn(f64, f64) -> f64 + Sync>,
    pub albedo: Box<dyn Fn(f64, f64) -> f64 + Sync>,
}

/// Truth averaged over the map's cells.
pub struct Truth {
    pub heights: Grid,
    pub slopes: Vec<[f64; 2]>,
    pub albedo: Vec<f64>,
}

/// Facet of a fine cell: height of its centre, slopes.
fn facet(scene: &Scene, x: f64, y: f64, step: f64) -> (f64, [f64; 2]) {
    let h = 0.5 * step;
    let [sw, se, nw, ne] = [[-h, -h], [h, -h], [-h, h], [h, h]].map(|[u, v]| (scene.height)(x + u, y + v));
    (0.25 * (sw + se + nw + ne), [(se + ne - sw - nw) / (2.0 * step), (nw + ne - sw - se) / (2.0 * step)])
}

/// 35 % Lambert, 65 % Lommel-Seeliger, written out.
pub fn brightness([p, q]: [f64; 2], light: Vector, view: Vector) -> f64 {
    let length = (1.0 + p * p + q * q).sqrt();
    let to_light = (light[2] - p * light[0] - q * light[1]) / length;
    let to_view = (view[2] - p * view[0] - q * view[1]) / length;
    if to_light <= 0.0 || to_view <= 0.0 { 0.0 } else { 0.35 * to_light + 1.3 * to_light / (to_light + to_view) }
}

impl Scene {
    /// Hills of 13 to 40 cells, with an rms slope of about 0.15, and an independent wavy albedo of 0.2 +- 0.05; square cells of `cell_m`.
    pub fn hills(side: usize, cell_m: f64) -> Self {
        let wave = move |x: f64, y: f64, cells: f64, azimuth: f64, phase: f64| {
            let k = 2.0 * PI / (cells * cell_m);
            libm::sin(k * (x * libm::sin(azimuth) + y * libm::cos(azimuth)) + phase)
        };
        let amplitude = move |cells: f64, slope: f64| slope * cells * cell_m / (2.0 * PI);
        let waves = [(40.0, 0.3, 0.1, 0.13), (27.0, 1.9, 2.0, 0.12), (19.0, 2.6, 4.0, 0.09), (13.0, 1.1, 1.0, 0.07)];
        Self {
            map: Geometry::square(side, side, cell_m),
            height: Box::new(move |x, y| {
                waves
                    .iter()
                    .map(|&(cells, azimuth, phase, slope)| amplitude(cells, slope) * wave(x, y, cells, azimuth, phase))
                    .sum()
            }),
            albedo: Box::new(move |x, y| 0.2 + 0.03 * wave(x, y, 31.0, 0.7, 0.4) + 0.02 * wave(x, y, 17.0, 2.2, 2.0)),
        }
    }

    pub fn truth(&self) -> Truth {
        let g = &self.map;
        let step = g.cell[0] / FINER as f64;
        let cells: Vec<[f64; 4]> = (0..g.len())
            .map(|k| {
                let mut sums = [0.0; 4];
                for j in 0..FINER * FINER {
                    let x = g.x(k % g.cols) + ((j % FINER) as f64 - 0.5 * (FINER - 1) as f64) * step;
                    let y = g.y(k / g.cols) + ((j / FINER) as f64 - 0.5 * (FINER - 1) as f64) * step;
                    let (z, [p, q]) = facet(self, x, y, step);
                    sums.iter_mut().zip([z, p, q, (self.albedo)(x, y)]).for_each(|(s, v)| *s += v);
                }
                sums.map(|s| s / (FINER * FINER) as f64)
            })
            .collect();
        Truth {
            heights: Grid::new(*g, cells.iter().map(|c| c[0]).collect()),
            slopes: cells.iter().map(|c| [c[1], c[2]]).collect(),
            albedo: cells.iter().map(|c| c[3]).collect(),
        }
    }

    /// A camera straight above whose pixels are the map's cells.
    pub fn nadir(&self) -> Camera {
        self.camera([0.0, 90.0])
    }

    /// A parallel camera of the same pixel size that looks at the middle of the map.
    pub fn camera(&self, at_deg: [f64; 2]) -> Camera {
        let [x, y] = self.map.size().map(|s| 0.5 * s);
        Camera::Parallel(ParallelCamera::new(at_deg, [x, y, 0.0], self.map.cell[0], [self.map.rows, self.map.cols]))
    }

    /// Image of a camera under a sun at azimuth and elevation: the mean of `FINER` squared rays per pixel, with the facet where each hits the surface.
    /// There are no cast shadows: the suns of the tests are higher than the steepest slopes.
    pub fn image(&self, camera: Camera, sun_deg: [f64; 2]) -> Image {
        let light = direction(sun_deg[0], sun_deg[1]);
        let [rows, cols] = camera.shape();
        let step = self.map.cell[0] / FINER as f64;
        let pixel = |k: usize| {
            let rays = (0..FINER * FINER).map(|j| {
                let [u, v] = [j % FINER, j / FINER].map(|n| (n as f64 + 0.5) / FINER as f64);
                let ray = camera.ray([(k % cols) as f64 + u, (k / cols) as f64 + v]);
                let back = ray.direction.map(|d| -d);
                let [mut x, mut y] = [ray.origin_m[0], ray.origin_m[1]];
                for _ in 0..60 {
                    let t = ((self.height)(x, y) - ray.origin_m[2]) / back[2];
                    [x, y] = [ray.origin_m[0] + t * back[0], ray.origin_m[1] + t * back[1]];
                }
                let (_, slopes) = facet(self, x, y, step);
                (self.albedo)(x, y) * brightness(slopes, light, camera.view_from([x, y, (self.height)(x, y)]))
            });
            rays.sum::<f64>() / (FINER * FINER) as f64
        };
        let brightness = (0..rows * cols).map(pixel).collect();
        Image { camera, light, exposure: 1.0, haze: 0.0, brightness }
    }

    /// Nadir images under suns at one elevation.
    pub fn nadir_images(&self, azimuths_deg: &[f64], elevation_deg: f64) -> Vec<Image> {
        azimuths_deg.iter().map(|&azimuth| self.image(self.nadir(), [azimuth, elevation_deg])).collect()
    }
}

/// The images with noise proportional to their brightness.
pub fn noisy(images: &[Image], share: f64, seed: u64) -> Vec<Image> {
    let mut stream = Streams::for_seed(seed, "photoclinometry-test").stream("noise");
    let mut one = |image: &Image| {
        let brightness = image.brightness.iter().map(|v| v * (1.0 + share * stream.normal())).collect();
        Image { brightness, ..image.clone() }
    };
    images.iter().map(&mut one).collect()
}

/// Root mean square.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    sums::mean(&values.map(|v| v * v).collect::<Vec<_>>()).sqrt()
}

/// Rms length of the difference of gradients.
pub fn slope_rms(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let length =
        |(a, b): (&[f64; 2], &[f64; 2])| ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])).sqrt();
    rms(a.iter().zip(b).map(length).filter(|v| v.is_finite()))
}

/// Rms difference of heights after removing the mean difference.
pub fn height_rms(a: &[f64], b: &[f64]) -> f64 {
    let errors: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).filter(|v| v.is_finite()).collect();
    sums::variance(&errors).sqrt()
}
