//! Cameras: the pixel of a point, and the ray of a pixel.
//!
//! A parallel camera is so far away that all its rays are parallel, as from orbit over a small scene; a pinhole camera stands in the
//! scene, like a rover's. Neither has lens distortion.

use crate::direction::{Vector, along, cross, direction, dot, minus, unit};

/// Cosine between the view and the default up axis above which the other axis is used as up.
const NEAR_AXIS: f64 = 0.999;

/// A camera of one of the two kinds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Camera {
    /// Parallel rays.
    Parallel(ParallelCamera),
    /// Rays through one point.
    Pinhole(PinholeCamera),
}

/// The ray of a pixel: from `origin_m` in the unit direction `direction`, away from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// A point on the ray, m: the pinhole, or a point of the image plane of a parallel camera.
    pub origin_m: Vector,
    /// Unit vector away from the camera.
    pub direction: Vector,
}

/// Axes of an image: to its right, to its top, and towards the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axes {
    right: Vector,
    top: Vector,
    back: Vector,
}

impl Axes {
    /// Axes of a view opposite to `back`; `up` points to the top of the image.
    fn new(back: Vector, up: Vector) -> Self {
        let right = unit(cross(up, back));
        Self { right, top: cross(back, right), back }
    }
}

/// Parallel rays; north is up in the image unless the camera stands in the north on the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelCamera {
    axes: Axes,
    centre_m: Vector,
    pixel_m: f64,
    rows: usize,
    cols: usize,
}

impl ParallelCamera {
    /// A camera in the direction `azimuth_deg` (clockwise from north) and `elevation_deg` (90: straight above) as seen from the ground. The
    /// centre of its image shows `centre_m`; a pixel measures `pixel_m` perpendicular to the rays.
    ///
    /// ```
    /// use sastrugi_imaging::{Camera, ParallelCamera};
    ///
    /// // From straight above, with pixels of half a metre: a map with north up.
    /// let camera = Camera::Parallel(ParallelCamera::new([0.0, 90.0], [10.0, 20.0, 0.0], 0.5, [30, 40]));
    /// let [col, row] = camera.project([12.0, 21.0, 5.0]).unwrap();
    /// assert!((col - 24.0).abs() < 1e-12 && (row - 13.0).abs() < 1e-12);
    /// ```
    pub fn new(
        [azimuth_deg, elevation_deg]: [f64; 2],
        centre_m: Vector,
        pixel_m: f64,
        [rows, cols]: [usize; 2],
    ) -> Self {
        let back = direction(azimuth_deg, elevation_deg);
        let north = [0.0, 1.0, 0.0];
        let up = if dot(back, north).abs() > NEAR_AXIS { [0.0, 0.0, 1.0] } else { north };
        Self { axes: Axes::new(back, up), centre_m, pixel_m, rows, cols }
    }
}

/// Rays through one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PinholeCamera {
    axes: Axes,
    position_m: Vector,
    /// Focal length, pixels.
    focal_px: f64,
    rows: usize,
    cols: usize,
}

impl PinholeCamera {
    /// A camera at `position_m` that looks at `target_m`; the width of its image spans `field_of_view_deg`. The top of the image is up, or
    /// north if it looks straight down.
    ///
    /// ```
    /// use sastrugi_imaging::{Camera, PinholeCamera};
    ///
    /// // 10 m above the ground, looking down; 90 deg over 40 columns are 20 m of ground.
    /// let camera = Camera::Pinhole(PinholeCamera::new([0.0, 0.0, 10.0], [0.0; 3], 90.0, [40, 40]));
    /// let [col, row] = camera.project([5.0, 0.0, 0.0]).unwrap();
    /// assert!((col - 30.0).abs() < 1e-9 && (row - 20.0).abs() < 1e-9);
    /// ```
    pub fn new(position_m: Vector, target_m: Vector, field_of_view_deg: f64, [rows, cols]: [usize; 2]) -> Self {
        let back = unit(minus(position_m, target_m));
        let vertical = [0.0, 0.0, 1.0];
        let up = if dot(back, vertical).abs() > NEAR_AXIS { [0.0, 1.0, 0.0] } else { vertical };
        let focal_px = 0.5 * cols as f64 / libm::tan(0.5 * field_of_view_deg.to_radians());
        Self { axes: Axes::new(back, up), position_m, focal_px, rows, cols }
    }
}

impl Camera {
    /// Rows and columns of the image.
    pub fn shape(&self) -> [usize; 2] {
        match self {
            Self::Parallel(c) => [c.rows, c.cols],
            Self::Pinhole(c) => [c.rows, c.cols],
        }
    }

    /// Column and row of a point, in pixels from the upper left corner, also outside the image. `None` behind a pinhole.
    ///
    /// ```
    /// use sastrugi_imaging::{Camera, PinholeCamera};
    ///
    /// // Looking north with 90 deg over 40 columns: what lies as far to the right as ahead is at the right edge.
    /// let camera = Camera::Pinhole(PinholeCamera::new([0.0; 3], [0.0, 1.0, 0.0], 90.0, [30, 40]));
    /// let [col, row] = camera.project([2.0, 2.0, 0.0]).unwrap();
    /// assert!((col - 40.0).abs() < 1e-12 && (row - 15.0).abs() < 1e-12);
    /// assert_eq!(camera.project([0.0, -1.0, 0.0]), None);
    /// ```
    pub fn project(&self, point_m: Vector) -> Option<[f64; 2]> {
        let [rows, cols] = self.shape();
        let place = |offset: Vector, axes: &Axes, scale: f64| {
            [0.5 * cols as f64 + dot(offset, axes.right) * scale, 0.5 * rows as f64 - dot(offset, axes.top) * scale]
        };
        match self {
            Self::Parallel(c) => Some(place(minus(point_m, c.centre_m), &c.axes, 1.0 / c.pixel_m)),
            Self::Pinhole(c) => {
                let offset = minus(point_m, c.position_m);
                let depth = -dot(offset, c.axes.back);
                (depth > 0.0).then(|| place(offset, &c.axes, c.focal_px / depth))
            }
        }
    }

    /// The ray of a position in the image, column and row in pixels from the upper left corner.
    ///
    /// ```
    /// use sastrugi_imaging::{Camera, PinholeCamera};
    ///
    /// let camera = Camera::Pinhole(PinholeCamera::new([0.0, 0.0, 10.0], [0.0; 3], 90.0, [40, 40]));
    /// let ray = camera.ray([30.0, 20.0]);
    /// // It meets the ground after 10 m of descent.
    /// let ground = [0, 1, 2].map(|k| ray.origin_m[k] - 10.0 / ray.direction[2] * ray.direction[k]);
    /// assert!((ground[0] - 5.0).abs() < 1e-9 && ground[1].abs() < 1e-9 && ground[2].abs() < 1e-9);
    /// ```
    pub fn ray(&self, [col, row]: [f64; 2]) -> Ray {
        let [rows, cols] = self.shape();
        let (right, top) = (col - 0.5 * cols as f64, 0.5 * rows as f64 - row);
        match self {
            Self::Parallel(c) => {
                let origin_m = along(along(c.centre_m, right * c.pixel_m, c.axes.right), top * c.pixel_m, c.axes.top);
                Ray { origin_m, direction: c.axes.back.map(|v| -v) }
            }
            Self::Pinhole(c) => {
                let ahead = c.axes.back.map(|v| -v * c.focal_px);
                let through = along(along(ahead, right, c.axes.right), top, c.axes.top);
                Ray { origin_m: c.position_m, direction: unit(through) }
            }
        }
    }

    /// Unit vector from a point to the camera.
    pub fn view_from(&self, point_m: Vector) -> Vector {
        match self {
            Self::Parallel(c) => c.axes.back,
            Self::Pinhole(c) => unit(minus(c.position_m, point_m)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras() -> [Camera; 4] {
        [
            Camera::Parallel(ParallelCamera::new([0.0, 90.0], [10.0, 20.0, 1.0], 0.5, [30, 40])),
            Camera::Parallel(ParallelCamera::new([120.0, 50.0], [10.0, 20.0, 1.0], 0.5, [30, 40])),
            Camera::Pinhole(PinholeCamera::new([0.0, 0.0, 1.5], [10.0, 20.0, 0.0], 60.0, [30, 40])),
            Camera::Pinhole(PinholeCamera::new([10.0, 20.0, 50.0], [10.0, 20.0, 0.0], 60.0, [30, 40])),
        ]
    }

    /// A point on the ray of a pixel projects to that pixel.
    #[test]
    fn prop_rays_and_projection_agree() {
        for camera in cameras() {
            for at in [[0.0, 0.0], [20.0, 15.0], [39.5, 3.25], [7.0, 29.0]] {
                let ray = camera.ray(at);
                let point = along(ray.origin_m, 3.75, ray.direction);
                let back = camera.project(point).unwrap();
                assert!((0..2).all(|k| (back[k] - at[k]).abs() < 1e-10), "{camera:?} {at:?} {back:?}");
                let view = camera.view_from(point);
                assert!((dot(view, ray.direction) + 1.0).abs() < 1e-14);
            }
        }
    }

    /// From above, north is up, east is right, and a pixel is a cell.
    #[test]
    fn val_from_above_the_image_is_a_map() {
        let [camera, ..] = cameras();
        let [col, row] = camera.project([12.0, 21.0, 7.0]).unwrap();
        assert!((col - 24.0).abs() < 1e-12 && (row - 13.0).abs() < 1e-12);
    }

    /// From the east at 30 deg, a metre east spans half a metre across the rays, a metre north a full one, and what stands a metre
    /// higher appears 0.87 m farther west, away from the camera. From the south at 45 deg, height shifts a point to the north.
    #[test]
    fn val_oblique_images_lean_away_from_the_camera() {
        let from = |azimuth_deg: f64, elevation_deg: f64| {
            Camera::Parallel(ParallelCamera::new([azimuth_deg, elevation_deg], [10.0, 20.0, 1.0], 0.5, [30, 40]))
        };
        let near = |camera: Camera, point: Vector, [col, row]: [f64; 2]| {
            let at = camera.project(point).unwrap();
            assert!((at[0] - col).abs() < 1e-12 && (at[1] - row).abs() < 1e-12, "{point:?} at {at:?}, not {col} {row}");
        };
        let east = from(90.0, 30.0);
        near(east, [10.0, 20.0, 1.0], [20.0, 15.0]);
        near(east, [11.0, 20.0, 1.0], [21.0, 15.0]);
        near(east, [10.0, 21.0, 1.0], [20.0, 13.0]);
        near(east, [10.0, 20.0, 2.0], [20.0 - 3f64.sqrt(), 15.0]);
        let south = from(180.0, 45.0);
        near(south, [11.0, 20.0, 1.0], [22.0, 15.0]);
        near(south, [10.0, 21.0, 1.0], [20.0, 15.0 - 2f64.sqrt()]);
        near(south, [10.0, 20.0, 2.0], [20.0, 15.0 - 2f64.sqrt()]);
    }

    /// Straight down from 50 m with 60 deg over 40 columns, a pixel measures 50 m x tan 30 deg / 20, and north is up.
    #[test]
    fn val_a_pinhole_above_sees_a_map() {
        let [.., camera] = cameras();
        let pixel_m = 50.0 / 3f64.sqrt() / 20.0;
        let [col, row] = camera.project([11.0, 22.0, 0.0]).unwrap();
        let expected = [20.0 + 1.0 / pixel_m, 15.0 - 2.0 / pixel_m];
        assert!((col - expected[0]).abs() < 1e-12 && (row - expected[1]).abs() < 1e-12, "{col} {row}");
    }

    /// A pinhole: points behind it project to no pixel, the image of a horizontal camera has up at the top, and its width spans the field
    /// of view.
    #[test]
    fn val_pinholes_look_ahead() {
        let camera = Camera::Pinhole(PinholeCamera::new([0.0; 3], [0.0, 1.0, 0.0], 90.0, [30, 40]));
        assert_eq!(camera.project([0.0, -1.0, 0.0]), None);
        let [col, row] = camera.project([2.0, 2.0, 0.5]).unwrap();
        assert!((col - 40.0).abs() < 1e-12 && (row - 10.0).abs() < 1e-12, "{col} {row}");
    }
}
