//! Where a camera stands: as a study says it, and in the coordinates of a surface.
//!
//! [`CameraParameters`] are what a study or a command line holds; they may leave out what follows from the surface. A [`CameraPose`] holds
//! everything in numbers: it is what stands in the file beside an image, and what [`CameraPose::camera`] makes the same camera from again.

use crate::camera::{Camera, ParallelCamera, PinholeCamera};
use crate::direction::{Vector, cross, direction, dot, minus};
use crate::sun::check_direction;
use sastrugi_numeric::{Geometry, Grid, Surface};
use sastrugi_schemas::{ParameterError, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most pixels of an image.
pub const PIXELS_MAX: usize = 1 << 26;
/// Widest field of view, deg: beyond, the pixels at the border see almost nothing.
const FIELD_OF_VIEW_MAX_DEG: f64 = 170.0;
/// Pixels that lie beyond the surface by less than this share of one are left out.
const PIXEL_TOLERANCE: f64 = 1e-6;

/// A camera as a study says it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraParameters {
    /// Straight down with parallel rays: the image is a map of the whole surface.
    Nadir {
        /// Pixel size, m; the surface's cell size when absent.
        #[serde(default)]
        pixel_m: Option<f64>,
    },
    /// Parallel rays from a direction, as from an orbit.
    Parallel {
        /// Azimuth of the camera as seen from the ground, clockwise from north, deg.
        azimuth_deg: f64,
        /// Its elevation above the horizon, above 0 to 90 deg.
        elevation_deg: f64,
        /// Pixel size across the rays, m; the surface's cell size when absent.
        #[serde(default)]
        pixel_m: Option<f64>,
        /// Columns and rows; the whole surface when absent.
        #[serde(default)]
        size_px: Option<[usize; 2]>,
        /// Ground point `[x, y]` at the centre of the image, m; the middle of the surface when absent.
        #[serde(default)]
        target_m: Option<[f64; 2]>,
    },
    /// A camera in the scene.
    Pinhole {
        /// Place `[x, y, z]`, m.
        position_m: Vector,
        /// Point that the middle of the image shows, `[x, y, z]`, m.
        target_m: Vector,
        /// True: both z are above the ground at their x and y; false: they are heights as the surface has them.
        #[serde(default = "above_ground")]
        above_ground: bool,
        /// Angle that the width of the image spans, deg.
        #[serde(default = "field_of_view_deg")]
        field_of_view_deg: f64,
        /// Columns and rows.
        #[serde(default = "size_px")]
        size_px: [usize; 2],
    },
}

fn above_ground() -> bool {
    true
}

fn field_of_view_deg() -> f64 {
    60.0
}

fn size_px() -> [usize; 2] {
    [640, 480]
}

impl Default for CameraParameters {
    fn default() -> Self {
        Self::Nadir { pixel_m: None }
    }
}

/// A camera in the coordinates of a surface, with everything in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraPose {
    /// Parallel rays (see [`ParallelCamera::new`]); straight down at an elevation of 90 deg.
    Parallel {
        /// Azimuth of the camera as seen from the ground, clockwise from north, deg.
        azimuth_deg: f64,
        /// Its elevation above the horizon, above 0 to 90 deg.
        elevation_deg: f64,
        /// Point that the middle of the image shows, `[x, y, z]`, m.
        centre_m: Vector,
        /// Pixel size across the rays, m.
        pixel_m: f64,
        /// Rows of the image.
        rows: usize,
        /// Columns of the image.
        cols: usize,
    },
    /// Rays through one point (see [`PinholeCamera::new`]).
    Pinhole {
        /// Place, `[x, y, z]`, m.
        position_m: Vector,
        /// Point that the middle of the image shows, `[x, y, z]`, m.
        target_m: Vector,
        /// Angle that the width of the image spans, deg.
        field_of_view_deg: f64,
        /// Rows of the image.
        rows: usize,
        /// Columns of the image.
        cols: usize,
    },
}

impl CameraParameters {
    /// Refuses what no surface makes right.
    ///
    /// # Errors
    /// The first parameter that is out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        match *self {
            Self::Nadir { pixel_m } => check_pixel(pixel_m),
            Self::Parallel { azimuth_deg, elevation_deg, pixel_m, size_px, target_m } => {
                check_direction(azimuth_deg, elevation_deg)?;
                check_pixel(pixel_m)?;
                size_px.map_or(Ok(()), |[cols, rows]| check_shape("size_px", rows, cols))?;
                target_m.map_or(Ok(()), |target| check_point("target_m", &target))
            }
            Self::Pinhole { position_m, target_m, field_of_view_deg, size_px: [cols, rows], above_ground } => {
                check_pinhole(position_m, target_m, field_of_view_deg)?;
                if above_ground {
                    ParameterError::positive("position_m.2", position_m[2])?;
                }
                check_shape("size_px", rows, cols)
            }
        }
    }

    /// About how many pixels its image of a surface of `size_m`, with cells of `cell_m`, has.
    pub fn pixels(&self, size_m: [f64; 2], cell_m: f64) -> f64 {
        let of = |pixel_m: Option<f64>| {
            let pixel_m = pixel_m.unwrap_or(cell_m);
            size_m[0] * size_m[1] / (pixel_m * pixel_m)
        };
        match *self {
            Self::Nadir { pixel_m } => of(pixel_m),
            Self::Parallel { pixel_m, size_px: None, .. } => of(pixel_m),
            Self::Parallel { size_px: Some([cols, rows]), .. } | Self::Pinhole { size_px: [cols, rows], .. } => {
                cols as f64 * rows as f64
            }
        }
    }

    /// Name of its kind.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Nadir { .. } => "nadir",
            Self::Parallel { .. } => "parallel",
            Self::Pinhole { .. } => "pinhole",
        }
    }

    /// The camera over a surface.
    ///
    /// # Errors
    /// As [`Self::check`]; also a camera below the ground, places without ground, and images of too many pixels.
    pub fn pose(&self, heights: &Grid) -> Result<CameraPose, ParameterError> {
        self.check()?;
        let pose = match *self {
            Self::Nadir { pixel_m } => {
                let pixel_m = pixel_m.unwrap_or(heights.geometry.mean_cell());
                check_fits(heights, pixel_m)?;
                nadir(heights, pixel_m)
            }
            Self::Parallel { azimuth_deg, elevation_deg, pixel_m, size_px, target_m } => {
                let pixel_m = pixel_m.unwrap_or(heights.geometry.mean_cell());
                let target_m = target_m.map(|at| on_ground(heights, "target_m", [at[0], at[1], 0.0])).transpose()?;
                parallel(heights, [azimuth_deg, elevation_deg], pixel_m, size_px, target_m)
            }
            Self::Pinhole { position_m, target_m, above_ground, field_of_view_deg, size_px: [cols, rows] } => {
                let place = |key, at| if above_ground { on_ground(heights, key, at) } else { Ok(at) };
                let (position_m, target_m) = (place("position_m", position_m)?, place("target_m", target_m)?);
                check_above(heights, position_m)?;
                CameraPose::Pinhole { position_m, target_m, field_of_view_deg, rows, cols }
            }
        };
        pose.check()?;
        Ok(pose)
    }
}

impl CameraPose {
    /// # Errors
    /// The first number that is out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        match *self {
            Self::Parallel { azimuth_deg, elevation_deg, centre_m, pixel_m, rows, cols } => {
                check_direction(azimuth_deg, elevation_deg)?;
                check_point("centre_m", &centre_m)?;
                check_pixel(Some(pixel_m))?;
                check_shape("pixel_m", rows, cols)
            }
            Self::Pinhole { position_m, target_m, field_of_view_deg, rows, cols } => {
                check_pinhole(position_m, target_m, field_of_view_deg)?;
                check_shape("size_px", rows, cols)
            }
        }
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        match *self {
            Self::Parallel { azimuth_deg, elevation_deg, centre_m, pixel_m, rows, cols } => {
                Camera::Parallel(ParallelCamera::new([azimuth_deg, elevation_deg], centre_m, pixel_m, [rows, cols]))
            }
            Self::Pinhole { position_m, target_m, field_of_view_deg, rows, cols } => {
                Camera::Pinhole(PinholeCamera::new(position_m, target_m, field_of_view_deg, [rows, cols]))
            }
        }
    }

    /// True for parallel rays straight down: the image is a map.
    pub fn is_nadir(&self) -> bool {
        matches!(self, Self::Parallel { elevation_deg, azimuth_deg, .. } if *elevation_deg == 90.0 && *azimuth_deg == 0.0)
    }

    /// Shape and place of the image: in the coordinates of the surface where it is a map, else in pixels from its lower left corner.
    pub fn geometry(&self) -> Geometry {
        match *self {
            Self::Parallel { centre_m, pixel_m, rows, cols, .. } if self.is_nadir() => {
                let low = |axis: usize, count: usize| centre_m[axis] - 0.5 * count as f64 * pixel_m;
                Geometry { rows, cols, cell: [pixel_m; 2], origin: [low(0, cols), low(1, rows)] }
            }
            Self::Parallel { rows, cols, .. } | Self::Pinhole { rows, cols, .. } => Geometry::square(rows, cols, 1.0),
        }
    }

    /// Pixel size of parallel rays, m; a pinhole's pixels have none.
    pub fn pixel_m(&self) -> Option<f64> {
        match self {
            Self::Parallel { pixel_m, .. } => Some(*pixel_m),
            Self::Pinhole { .. } => None,
        }
    }
}

/// Straight down on the whole surface, from its south-west corner on in whole pixels.
fn nadir(heights: &Grid, pixel_m: f64) -> CameraPose {
    let g = &heights.geometry;
    let [cols, rows] = g.size().map(|size| whole_pixels(size / pixel_m));
    let middle = |axis: usize, count: usize| g.origin[axis] + 0.5 * count as f64 * pixel_m;
    let centre_m = [middle(0, cols), middle(1, rows), middle_height(heights)];
    CameraPose::Parallel { azimuth_deg: 0.0, elevation_deg: 90.0, centre_m, pixel_m, rows, cols }
}

/// Parallel rays from a direction on the box around the surface, or on part of it.
fn parallel(
    heights: &Grid,
    [azimuth_deg, elevation_deg]: [f64; 2],
    pixel_m: f64,
    size_px: Option<[usize; 2]>,
    target_m: Option<Vector>,
) -> CameraPose {
    let g = &heights.geometry;
    let size = g.size();
    let middle = [g.origin[0] + 0.5 * size[0], g.origin[1] + 0.5 * size[1], middle_height(heights)];
    let relief = heights.range().map_or(0.0, |(low, high)| high - low);
    let [cols, rows] = size_px.unwrap_or_else(|| {
        let axes = image_axes(azimuth_deg, elevation_deg);
        let half = [0.5 * size[0], 0.5 * size[1], 0.5 * relief];
        let across = |axis: Vector| (0..3).map(|k| 2.0 * axis[k].abs() * half[k]).sum::<f64>();
        axes.map(|axis| whole_pixels(across(axis) / pixel_m))
    });
    let centre_m = target_m.unwrap_or(middle);
    CameraPose::Parallel { azimuth_deg, elevation_deg, centre_m, pixel_m, rows, cols }
}

/// Right and top of a parallel image, as [`ParallelCamera`] has them.
fn image_axes(azimuth_deg: f64, elevation_deg: f64) -> [Vector; 2] {
    let shape = [2, 2];
    let camera = Camera::Parallel(ParallelCamera::new([azimuth_deg, elevation_deg], [0.0; 3], 1.0, shape));
    let right = minus(camera.ray([2.0, 1.0]).origin_m, camera.ray([1.0, 1.0]).origin_m);
    [right, cross(direction(azimuth_deg, elevation_deg), right)]
}

fn middle_height(heights: &Grid) -> f64 {
    heights.range().map_or(0.0, |(low, high)| 0.5 * (low + high))
}

/// Pixels that cover a length; at least one, and too many for any image where there is no such number.
fn whole_pixels(length: f64) -> usize {
    (length - PIXEL_TOLERANCE).ceil().clamp(1.0, 1e9) as usize
}

/// A point whose z is above the ground, in the heights of the surface.
fn on_ground(heights: &Grid, key: &str, [x, y, above]: Vector) -> Result<Vector, ParameterError> {
    let ground = heights.height(x, y);
    let none = || {
        ParameterError::new(key, format!("is at x = {}, y = {}, where the surface has no ground", shown(x), shown(y)))
    };
    ground.map(|ground| [x, y, ground + above]).ok_or_else(none)
}

fn check_above(heights: &Grid, [x, y, z]: Vector) -> Result<(), ParameterError> {
    match heights.height(x, y) {
        Some(ground) if z <= ground => {
            let message = format!("is at z = {} m; the ground there is at {ground:.3} m", shown(z));
            Err(ParameterError::new("position_m", message))
        }
        _ => Ok(()),
    }
}

/// Refuses pixels that a surface does not fill.
fn check_fits(heights: &Grid, pixel_m: f64) -> Result<(), ParameterError> {
    let [east, north] = heights.geometry.size();
    if pixel_m <= east.min(north) * (1.0 + PIXEL_TOLERANCE) {
        return Ok(());
    }
    let message =
        format!("is {} m; the surface, {} x {} m, does not fill a pixel", shown(pixel_m), shown(east), shown(north));
    Err(ParameterError::new("pixel_m", message))
}

fn check_pixel(pixel_m: Option<f64>) -> Result<(), ParameterError> {
    pixel_m.map_or(Ok(()), |pixel| ParameterError::positive("pixel_m", pixel).map(|_| ()))
}

fn check_point(key: &str, at: &[f64]) -> Result<(), ParameterError> {
    match at.iter().position(|v| !v.is_finite()) {
        Some(k) => Err(ParameterError::new(format!("{key}.{k}"), format!("is {}; it must be finite", at[k]))),
        None => Ok(()),
    }
}

fn check_shape(key: &str, rows: usize, cols: usize) -> Result<(), ParameterError> {
    match rows.checked_mul(cols) {
        Some(pixels) if (1..=PIXELS_MAX).contains(&pixels) => Ok(()),
        _ => Err(ParameterError::new(
            key,
            format!("makes an image of {cols} x {rows} pixels; it must have 1 to {PIXELS_MAX}"),
        )),
    }
}

fn check_pinhole(position_m: Vector, target_m: Vector, field_of_view_deg: f64) -> Result<(), ParameterError> {
    check_point("position_m", &position_m)?;
    check_point("target_m", &target_m)?;
    let offset = minus(position_m, target_m);
    if dot(offset, offset) == 0.0 {
        return Err(ParameterError::new("target_m", "is where the camera is; it must be another point"));
    }
    let angle = field_of_view_deg;
    if !(angle > 0.0 && angle <= FIELD_OF_VIEW_MAX_DEG) {
        let message = format!("is {}; it must be above 0 and at most {FIELD_OF_VIEW_MAX_DEG} deg", shown(angle));
        return Err(ParameterError::new("field_of_view_deg", message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn hill() -> Grid {
        let g = Geometry { rows: 30, cols: 40, cell: [0.5; 2], origin: [100.0, -50.0] };
        let values = (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| libm::sin(r as f64 * 0.1) + 0.05 * c as f64));
        Grid::new(g, values.collect())
    }

    fn parameters(value: serde_json::Value) -> CameraParameters {
        serde_json::from_value(value).unwrap()
    }

    /// Straight down a pixel is a cell, and each looks at its middle.
    #[test]
    fn val_a_nadir_image_is_a_map() {
        let heights = hill();
        let pose = CameraParameters::default().pose(&heights).unwrap();
        assert!(pose.is_nadir());
        let camera = pose.camera();
        assert_eq!(camera.shape(), [30, 40]);
        for (row, col) in [(0, 0), (29, 39), (7, 31)] {
            let origin = camera.ray([col as f64 + 0.5, row as f64 + 0.5]).origin_m;
            assert!((origin[0] - heights.geometry.x(col)).abs() < 1e-12, "{origin:?}");
            assert!((origin[1] - heights.geometry.y(row)).abs() < 1e-12, "{origin:?}");
        }
    }

    /// Pixels that do not divide the surface reach beyond it in the north and east.
    #[test]
    fn val_a_nadir_image_covers_the_surface() {
        let CameraPose::Parallel { rows, cols, centre_m, .. } =
            parameters(json!({ "kind": "nadir", "pixel_m": 0.7 })).pose(&hill()).unwrap()
        else {
            panic!("a nadir camera has parallel rays");
        };
        assert_eq!((rows, cols), (22, 29));
        assert!(
            (centre_m[0] - (100.0 + 14.5 * 0.7)).abs() < 1e-12 && (centre_m[1] - (-50.0 + 11.0 * 0.7)).abs() < 1e-12
        );
    }

    #[test]
    fn val_pinholes_stand_on_the_ground() {
        let heights = hill();
        let camera = json!({ "kind": "pinhole", "position_m": [105.0, -45.0, 1.5], "target_m": [110.0, -40.0, 0.0] });
        let CameraPose::Pinhole { position_m, target_m, .. } = parameters(camera).pose(&heights).unwrap() else {
            panic!("a pinhole stays one");
        };
        assert!((position_m[2] - 1.5 - heights.height(105.0, -45.0).unwrap()).abs() < 1e-12);
        assert!((target_m[2] - heights.height(110.0, -40.0).unwrap()).abs() < 1e-12);
    }

    #[test]
    fn val_cameras_that_see_nothing_are_refused() {
        let refusal =
            |camera: serde_json::Value| parameters(camera).pose(&hill()).err().map(|e| e.key).unwrap_or_default();
        let pinhole = |changes: serde_json::Value| {
            let mut camera =
                json!({ "kind": "pinhole", "position_m": [105.0, -45.0, 1.5], "target_m": [110.0, -40.0, 0.0] });
            changes.as_object().unwrap().iter().for_each(|(key, value)| camera[key] = value.clone());
            refusal(camera)
        };
        assert_eq!(pinhole(json!({})), "");
        assert_eq!(pinhole(json!({ "position_m": [105.0, -45.0, 0.0] })), "position_m.2");
        assert_eq!(pinhole(json!({ "position_m": [5.0, -45.0, 1.0] })), "position_m");
        assert_eq!(pinhole(json!({ "position_m": [105.0, -45.0, -9.0], "above_ground": false })), "position_m");
        assert_eq!(pinhole(json!({ "target_m": [0.0, 0.0, 0.0] })), "target_m");
        assert_eq!(pinhole(json!({ "target_m": [105.0, -45.0, 1.5] })), "target_m");
        assert_eq!(pinhole(json!({ "field_of_view_deg": 171.0 })), "field_of_view_deg");
        assert_eq!(pinhole(json!({ "field_of_view_deg": 0.0 })), "field_of_view_deg");
        assert_eq!(pinhole(json!({ "size_px": [0, 5] })), "size_px");
        assert_eq!(pinhole(json!({ "size_px": [1u64 << 40, 1u64 << 40] })), "size_px");
        assert_eq!(refusal(json!({ "kind": "nadir", "pixel_m": 0.0 })), "pixel_m");
        assert_eq!(refusal(json!({ "kind": "nadir", "pixel_m": 1e-9 })), "pixel_m");
        assert_eq!(refusal(json!({ "kind": "parallel", "azimuth_deg": 0.0, "elevation_deg": -1.0 })), "elevation_deg");
    }

    proptest! {
        /// The image of a parallel camera holds every point of the surface, and little more than it needs.
        #[test]
        fn prop_parallel_images_hold_the_surface(azimuth in 0.0..360.0f64, elevation in 5.0..90.0f64, pixel in 0.1..3.0f64) {
            let heights = hill();
            let camera = json!({ "kind": "parallel", "azimuth_deg": azimuth, "elevation_deg": elevation, "pixel_m": pixel });
            let camera = parameters(camera).pose(&heights).unwrap().camera();
            let [rows, cols] = camera.shape();
            let g = heights.geometry;
            for (r, c) in [(0, 0), (0, 39), (29, 0), (29, 39), (11, 17)] {
                let at = camera.project([g.x(c), g.y(r), heights.at(r, c)]).unwrap();
                prop_assert!(at[0] >= 0.0 && at[0] <= cols as f64 && at[1] >= 0.0 && at[1] <= rows as f64, "{at:?}");
            }
            prop_assert!(cols as f64 * pixel < 26.0 + pixel && rows as f64 * pixel < 30.0 + pixel);
        }

        /// What stands in the file beside an image makes the same camera.
        #[test]
        fn prop_poses_survive_json(azimuth in 0.0..360.0f64, elevation in 5.0..90.0f64) {
            let camera = CameraParameters::Parallel {
                azimuth_deg: azimuth, elevation_deg: elevation, pixel_m: None, size_px: None, target_m: None,
            };
            let pose = camera.pose(&hill()).unwrap();
            let back: CameraPose = serde_json::from_str(&serde_json::to_string(&pose).unwrap()).unwrap();
            prop_assert_eq!(back.camera(), pose.camera());
        }
    }
}
