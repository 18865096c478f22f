//! Images of a surface under the sun.
//!
//! # Model
//! Every pixel is the mean over `samples` x `samples` rays. A ray ends at its first intersection with the surface ([`relief`]). The
//! brightness of a point of albedo `alpha` is given by [`crate::Photometry`] for the normal there, the direction to the sun and the
//! direction back along the ray; it is 0 if the surface blocks the sun. The pixel of the image is
//!
//! $$ e \, \overline{I} + h + \sqrt{\sigma_a^2 + (\sigma_r (e \overline{I} + h))^2}\; N(0, 1) $$
//!
//! | symbol | meaning | unit, range |
//! |---|---|---|
//! | `I` | brightness, mean over the rays of the pixel that see ground | I/F, 0 or above |
//! | `e` | exposure | above 0 |
//! | `h` | haze | I/F |
//! | `sigma_a`, `sigma_r` | absolute and relative noise | I/F; 1 |
//!
//! Normals are those of the bilinear patches; on lines between patches the slopes of both sides are averaged, so a single ray through a
//! cell centre sees the central difference. Albedo is bilinear between cells; where its map has no data, the default applies.
//!
//! # Limitations
//! The sun is a point, so shadows have no penumbra. There is no light from the sky or from other ground, so shadows are black. Ground
//! beyond the grid and holes cast no shadows.
//!
//! # Cost
//! One ray to the camera and one to the sun per sample; rows of the image in parallel, each pixel by one task.

pub mod parameters;
pub mod relief;

#[cfg(test)]
mod tests;

pub use parameters::RenderParameters;
pub use relief::{Hit, Relief};

use crate::camera::{Camera, Ray};
use crate::direction::{Vector, dot};
use crate::photometry::Photometry;
use crate::pose::CameraPose;
use rayon::prelude::*;
use sastrugi_numeric::{Counter, Grid, Streams};
use sastrugi_schemas::ParameterError;

/// Purpose of the random stream of the noise.
pub const NOISE: &str = "image-noise";

/// Why an image could not be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The surface has no bilinear patch.
    #[error("a surface needs at least 2 x 2 cells with heights; this one has {rows} x {cols} cells")]
    NoSurface {
        /// Rows of the surface.
        rows: usize,
        /// Columns of the surface.
        cols: usize,
    },
    /// The albedo map and the heights differ in shape.
    #[error("the albedo map has {albedo_rows} x {albedo_cols} cells, the surface {rows} x {cols}; they must be equal")]
    AlbedoShape {
        /// Rows of the albedo map.
        albedo_rows: usize,
        /// Columns of the albedo map.
        albedo_cols: usize,
        /// Rows of the surface.
        rows: usize,
        /// Columns of the surface.
        cols: usize,
    },
    /// An albedo below 0 or above 1.
    #[error("the albedo map holds {value}; albedo must lie between 0 and 1")]
    AlbedoValue {
        /// The first such value.
        value: f64,
    },
    /// No ray of the camera hits the surface.
    #[error("the camera sees no ground: all its rays miss the surface or fall into holes")]
    NothingSeen,
    /// A parameter is out of range, or the camera does not fit the surface.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

/// A surface with its albedo.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Heights, m; NaN without data.
    pub heights: &'a Grid,
    /// Albedo of the same cells, 0 to 1; NaN without data.
    pub albedo: Option<&'a Grid>,
}

/// A rendered pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// Brightness, I/F, including exposure, haze and noise; NaN if no ray sees ground.
    pub brightness: f64,
    /// Share of the rays that see ground, 0 to 1.
    pub ground: f32,
    /// Share of those rays whose ground is in cast shadow or faces away from the sun, 0 to 1.
    pub shadow: f32,
    /// Mean distance of that ground from the pinhole, or from the image plane through the centre of a parallel image, m; NaN without
    /// ground.
    pub range_m: f64,
    /// Mean point of that ground, m.
    pub point_m: Vector,
}

/// An image of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Pose of the camera.
    pub pose: CameraPose,
    /// Pixels, row by row from the top.
    pub pixels: Vec<Pixel>,
}

impl Rendering {
    /// Brightness, I/F; in the coordinates of the surface if the image is a map, else in pixels.
    pub fn image(&self) -> Grid {
        Grid::new(self.pose.geometry(), self.pixels.iter().map(|p| p.brightness).collect())
    }

    /// Mean brightness of the pixels that see ground.
    pub fn mean_brightness(&self) -> f64 {
        mean(self.pixels.iter().map(|p| p.brightness).filter(|b| b.is_finite()))
    }

    /// Share of the ground seen that lies in shadow, 0 to 1.
    pub fn share_in_shadow(&self) -> f64 {
        let ground: f64 = self.pixels.iter().map(|p| f64::from(p.ground)).sum();
        self.pixels.iter().map(|p| f64::from(p.ground) * f64::from(p.shadow)).sum::<f64>() / ground
    }

    /// Share of the image that sees no ground, 0 to 1.
    pub fn share_without_ground(&self) -> f64 {
        1.0 - mean(self.pixels.iter().map(|p| f64::from(p.ground)))
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u64), |(sum, count), v| (sum + v, count + 1));
    sum / count as f64
}

/// Renders an image; noise comes from the stream [`NOISE`] of `streams`.
///
/// # Errors
/// See [`RenderError`].
///
/// ```
/// use sastrugi_imaging::{RenderParameters, Scene, Sun, render};
/// use sastrugi_numeric::{Geometry, Grid, Streams};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // Level ground of albedo 0.25 under a sun at the zenith, seen from there.
/// let heights = Grid::filled(Geometry::square(8, 10, 1.0), 3.0);
/// let sun = Sun { azimuth_deg: 0.0, elevation_deg: 90.0 };
/// let parameters = RenderParameters { sun, albedo: 0.25, ..RenderParameters::default() };
/// let made = render(&Scene { heights: &heights, albedo: None }, &parameters, &Streams::for_seed(1, "image"))?;
/// assert_eq!(made.image().geometry, heights.geometry);
/// assert!(made.pixels.iter().all(|pixel| (pixel.brightness - 0.25).abs() < 1e-12));
/// assert_eq!(made.share_in_shadow(), 0.0);
/// # Ok(())
/// # }
/// ```
pub fn render(scene: &Scene<'_>, parameters: &RenderParameters, streams: &Streams) -> Result<Rendering, RenderError> {
    parameters.check()?;
    let (rows, cols) = (scene.heights.rows(), scene.heights.cols());
    let relief = Relief::new(scene.heights).ok_or(RenderError::NoSurface { rows, cols })?;
    check_albedo(scene)?;
    let pose = parameters.camera.pose(scene.heights).map_err(|e| e.within("camera"))?;
    let view = View::new(&relief, scene.albedo, parameters, &pose);
    let noise = Counter::new(&mut streams.stream(NOISE));
    let [image_rows, image_cols] = view.camera.shape();
    let pixel = |k: usize| {
        let (row, col) = (k / image_cols, k % image_cols);
        view.exposed(view.pixel(row, col), noise.at(row as i64).at(col as i64))
    };
    // One range, so that every pixel is written in its place: lists of rows would have to be joined, and are in memory twice.
    let pixels: Vec<Pixel> = (0..image_rows * image_cols).into_par_iter().with_min_len(image_cols).map(pixel).collect();
    if pixels.iter().all(|p| p.ground == 0.0) {
        return Err(RenderError::NothingSeen);
    }
    Ok(Rendering { pose, pixels })
}

fn check_albedo(scene: &Scene<'_>) -> Result<(), RenderError> {
    let Some(albedo) = scene.albedo else { return Ok(()) };
    let (rows, cols) = (scene.heights.rows(), scene.heights.cols());
    if (albedo.rows(), albedo.cols()) != (rows, cols) {
        let (albedo_rows, albedo_cols) = (albedo.rows(), albedo.cols());
        return Err(RenderError::AlbedoShape { albedo_rows, albedo_cols, rows, cols });
    }
    match albedo.values.iter().find(|v| **v < 0.0 || **v > 1.0) {
        Some(&value) => Err(RenderError::AlbedoValue { value }),
        None => Ok(()),
    }
}

/// Everything needed to render a pixel.
struct View<'a> {
    relief: &'a Relief<'a>,
    albedo: Option<&'a Grid>,
    parameters: &'a RenderParameters,
    camera: Camera,
    sun: Vector,
    /// Smallest distance from a ray's origin at which it can hit ground, m.
    nearest_m: f64,
}

/// A point that a ray sees.
struct Seen {
    hit: Hit,
    /// Brightness; 0 in shadow.
    brightness: f64,
    shadow: bool,
}

impl<'a> View<'a> {
    fn new(
        relief: &'a Relief<'a>,
        albedo: Option<&'a Grid>,
        parameters: &'a RenderParameters,
        pose: &CameraPose,
    ) -> Self {
        let camera = pose.camera();
        let nearest_m = match camera {
            Camera::Parallel(_) => f64::NEG_INFINITY,
            Camera::Pinhole(_) => 0.0,
        };
        Self { relief, albedo, parameters, camera, sun: parameters.sun.direction(), nearest_m }
    }

    /// Mean over the rays of a pixel.
    fn pixel(&self, row: usize, col: usize) -> Pixel {
        let side = self.parameters.samples;
        let place = |k: u32| (f64::from(k) + 0.5) / f64::from(side);
        let (mut seen, mut dark, mut sum) = (0u32, 0u32, [0.0; 5]);
        for (down, right) in (0..side).flat_map(|down| (0..side).map(move |right| (down, right))) {
            let ray = self.camera.ray([col as f64 + place(right), row as f64 + place(down)]);
            let Some(point) = self.see(&ray) else { continue };
            seen += 1;
            dark += u32::from(point.shadow);
            let [x, y, z] = point.hit.point_m;
            let values = [point.brightness, point.hit.distance_m, x, y, z];
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        let [brightness, range_m, x, y, z] = sum.map(|sum| sum / f64::from(seen));
        let shadow = if seen == 0 { 0.0 } else { f64::from(dark) / f64::from(seen) };
        let ground = f64::from(seen) / f64::from(side * side);
        Pixel { brightness, ground: ground as f32, shadow: shadow as f32, range_m, point_m: [x, y, z] }
    }

    fn see(&self, ray: &Ray) -> Option<Seen> {
        let hit = self.relief.first_hit(ray.origin_m, ray.direction, self.nearest_m)?;
        let view = ray.direction.map(|v| -v);
        let photometry: &Photometry = &self.parameters.photometry;
        let slopes = self.relief.slopes(&hit.place);
        let lit = dot([-slopes[0], -slopes[1], 1.0], self.sun) > 0.0;
        let cast = || self.parameters.shadows && self.relief.is_shadowed(&hit.place, hit.point_m[2], self.sun);
        if !lit || cast() {
            return Some(Seen { hit, brightness: 0.0, shadow: true });
        }
        let albedo = self.albedo.map(|map| self.relief.value(map, &hit.place)).filter(|a| a.is_finite());
        let albedo = albedo.unwrap_or(self.parameters.albedo);
        Some(Seen { hit, brightness: albedo * photometry.of_slopes(slopes, self.sun, view), shadow: false })
    }

    /// Applies exposure, haze and noise.
    fn exposed(&self, pixel: Pixel, noise: Counter) -> Pixel {
        let p = self.parameters;
        let exact = p.exposure * pixel.brightness + p.haze;
        let error = if p.noise.is_none() { 0.0 } else { p.noise.deviation(exact) * noise.normal() };
        Pixel { brightness: exact + error, ..pixel }
    }
}
