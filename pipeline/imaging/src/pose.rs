//! Camera poses: as specified in a study, and in the coordinates of a surface.
//!
//! [`CameraParameters`] come from a study or a command line and may omit what follows from the surface. A [`CameraPose`] is fully
//! specified: it is stored in the file that accompanies an image, and [`CameraPose::camera`] reconstructs the same camera from it.

use crate::camera::{Camera, ParallelCamera, PinholeCamera};
use crate::direction::{Vector, cross, direction, dot, minus};
use crate::sun::{AZIMUTHS_DEG, check_direction};
use sastrugi_numeric::{Geometry, Grid, Surface};
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of pixels of an image.
pub const PIXELS_MAX: usize = 1 << 26;
/// Widest field of view, deg: beyond it, the pixels at the border see almost nothing.
const FIELD_OF_VIEW_MAX_DEG: f64 = 170.0;
/// A last pixel that would cover less than this share of a pixel of the surface is dropped.
const PIXEL_TOLERANCE: f64 = 1e-6;

/// A camera as specified in a study.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraParameters {
    /// Straight down with parallel rays: the image is a map of the complete surface.
    Nadir {
        /// Pixel size, m; the surface's cell size when absent.
        #[serde(default)]
        #[schemars(transform = limits::positive)]
        pixel_m: Option<f64>,
    },
    /// Parallel rays from a direction, as from orbit.
    Parallel {
        /// Azimuth of the camera as seen from the ground, clockwise from north, deg.
        #[schemars(transform = limits::within(AZIMUTHS_DEG[0], AZIMUTHS_DEG[1]))]
        azimuth_deg: f64,
        /// Elevation of the camera above the horizon, above 0 to 90 deg.
        #[schemars(transform = limits::above(0.0, 90.0))]
        elevation_deg: f64,
        /// Pixel size perpendicular to the rays, m; the surface's cell size when absent.
        #[serde(default)]
        #[schemars(transform = limits::positive)]
        pixel_m: Option<f64>,
        /// Columns and rows; the complete surface when absent.
        #[serde(default)]
        #[schemars(inner(range(min = 1)))]
        size_px: Option<[usize; 2]>,
        /// Ground point `[x, y]` at the centre of the image, m; the centre of the surface when absent.
        #[serde(default)]
        target_m: Option<[f64; 2]>,
    },
    /// A camera in the scene.
    Pinhole {
        /// Position `[x, y, z]`, m.
        position_m: Vector,
        /// Point shown at the centre of the image, `[x, y, z]`, m.
        target_m: Vector,
        /// True if both z are relative to the ground at their x and y; false if they are heights in the surface's datum.
        #[serde(default = "above_ground")]
        above_ground: bool,
        /// Horizontal field of view, deg.
        #[serde(default = "field_of_view_deg")]
        #[schemars(transform = limits::above(0.0, FIELD_OF_VIEW_MAX_DEG))]
        field_of_view_deg: f64,
        /// Columns and rows.
        #[serde(default = "size_px")]
        #[schemars(inner(range(min = 1)))]
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

/// A fully specified camera in the coordinates of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraPose {
    /// Parallel rays (see [`ParallelCamera::new`]); straight down at an elevation of 90 deg.
    Parallel {
        /// Azimuth of the camera as seen from the ground, clockwise from north, deg.
        azimuth_deg: f64,
        /// Elevation of the camera above the horizon, above 0 to 90 deg.
        elevation_deg: f64,
        /// Point shown at the centre of the image, `[x, y, z]`, m.
        centre_m: Vector,
        /// Pixel size perpendicular to the rays, m.
        pixel_m: f64,
        /// Rows of the image.
        rows: usize,
        /// Columns of the image.
        cols: usize,
    },
    /// Rays through one point (see [`PinholeCamera::new`]).
    Pinhole {
        /// Position `[x, y, z]`, m.
        position_m: Vector,
        /// Point shown at the centre of the image, `[x, y, z]`, m.
        target_m: Vector,
        /// Horizontal field of view, deg.
        field_of_view_deg: f64,
        /// Rows of the image.
        rows: usize,
        /// Columns of the image.
        cols: usize,
    },
}

impl CameraParameters {
    /// Checks everything that does not depend on the surface.
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

    /// Approximate number of pixels of its image of a surface of `size_m` with cells of `cell_m`.
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

    /// Name of the kind of camera.
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
    /// As [`Self::check`]; also a camera below the ground, points off the ground, and images with too many pixels.
    ///
    /// ```
    /// use sastrugi_imaging::CameraParameters;
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// let heights = Grid::filled(Geometry::square(30, 40, 0.5), 0.0);
    /// // By default straight down, a pixel for every cell.
    /// let pose = CameraParameters::default().pose(&heights).unwrap();
    /// assert!(pose.is_nadir());
    /// assert_eq!(pose.camera().shape(), [30, 40]);
    ///
    /// let coarse = CameraParameters::Nadir { pixel_m: Some(100.0) };
    /// assert_eq!(coarse.pose(&heights).unwrap_err().key, "pixel_m");
    /// ```
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

    /// Geometry of the image: in the coordinates of the surface if it is a map, else in pixels from its lower left corner.
    pub fn geometry(&self) -> Geometry {
        match *self {
            Self::Parallel { centre_m, pixel_m, rows, cols, .. } if self.is_nadir() => {
                let low = |axis: usize, count: usize| centre_m[axis] - 0.5 * count as f64 * pixel_m;
                Geometry { rows, cols, cell: [pixel_m; 2], origin: [low(0, cols), low(1, rows)] }
            }
            Self::Parallel { rows, cols, .. } | Self::Pinhole { rows, cols, .. } => Geometry::square(rows, cols, 1.0),
        }
    }

    /// Pixel size of a parallel camera, m; `None` for a pinhole.
    pub fn pixel_m(&self) -> Option<f64> {
        match self {
            Self::Parallel { pixel_m, .. } => Some(*pixel_m),
            Self::Pinhole { .. } => None,
        }
    }
}

/// A camera straight above the complete surface, with whole pixels starting at its south-west corner.
fn nadir(heights: &Grid, pixel_m: f64) -> CameraPose {
    let g = &heights.geometry;
    let [cols, rows] = g.size().map(|size| whole_pixels(size / pixel_m));
    let middle = |axis: usize, count: usize| g.origin[axis] + 0.5 * count as f64 * pixel_m;
    let centre_m = [middle(0, cols), middle(1, rows), middle_height(heights)];
    CameraPose::Parallel { azimuth_deg: 0.0, elevation_deg: 90.0, centre_m, pixel_m, rows, cols }
}

/// A parallel camera that covers the bounding box of the surface, or part of it.
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

/// Right and top axes of a parallel image, as in [`ParallelCamera`].
fn image_axes(azimuth_deg: f64, elevation_deg: f64) -> [Vector; 2] {
    let shape = [2, 2];
    let camera = Camera::Parallel(ParallelCamera::new([azimuth_deg, elevation_deg], [0.0; 3], 1.0, shape));
    let right = minus(camera.ray([2.0, 1.0]).origin_m, camera.ray([1.0, 1.0]).origin_m);
    [right, cross(direction(azimuth_deg, elevation_deg), right)]
}

fn middle_height(heights: &Grid) -> f64 {
    heights.range().map_or(0.0, |(low, high)| 0.5 * (low + high))
}

/// Number of pixels that cover a length; at least one, and a number that [`check_shape`] rejects if it would overflow.
fn whole_pixels(length: f64) -> usize {
    (length - PIXEL_TOLERANCE).ceil().clamp(1.0, 1e9) as usize
}

/// Converts a point with z above the ground to heights of the surface.
fn on_ground(heights: &Grid, key: &str, [x, y, above]: Vector) -> Result<Vector, ParameterError> {
    let ground = heights.height(x, y);
    let none =
        || ParameterError::new(key, format!("is at x = {}, y = {}, where the surface has no data", shown(x), shown(y)));
    ground.map(|ground| [x, y, ground + above]).ok_or_else(none)
}

fn check_above(heights: &Grid, [x, y, z]: Vector) -> Result<(), ParameterError> {
    match heights.height(x, y) {
        Some(ground) if z <= ground => {
            let message =
                format!("is at z = {} m; it must be above the ground, which is at {ground:.3} m there", shown(z));
            Err(ParameterError::new("position_m", message))
        }
        _ => Ok(()),
    }
}

/// Rejects pixels larger than the surface.
fn check_fits(heights: &Grid, pixel_m: f64) -> Result<(), ParameterError> {
    let [east, north] = heights.geometry.size();
    if pixel_m <= east.min(north) * (1.0 + PIXEL_TOLERANCE) {
        return Ok(());
    }
    let message =
        format!("is {} m; the surface of {} x {} m does not fill a pixel", shown(pixel_m), shown(east), shown(north));
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
            format!("gives an image of {cols} x {rows} pixels; it must have 1 to {PIXELS_MAX}"),
        )),
    }
}

fn check_pinhole(position_m: Vector, target_m: Vector, field_of_view_deg: f64) -> Result<(), ParameterError> {
    check_point("position_m", &position_m)?;
    check_point("target_m", &target_m)?;
    let offset = minus(position_m, target_m);
    if dot(offset, offset) == 0.0 {
        return Err(ParameterError::new("target_m", "is the position of the camera; it must be another point"));
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

    /// Straight down, each pixel is a cell and looks at its centre.
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

    /// If pixels do not divide the surface, the image extends beyond it in the north and east.
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

    /// A parallel camera with a target and a size shows that ground at its centre; sizes are columns, then rows.
    #[test]
    fn val_parallel_cameras_look_at_their_target() {
        let heights = hill();
        let camera = json!({ "kind": "parallel", "azimuth_deg": 40.0, "elevation_deg": 60.0, "pixel_m": 0.25,
            "size_px": [50, 20], "target_m": [107.0, -41.0] });
        let pose = parameters(camera).pose(&heights).unwrap();
        assert_eq!((pose.camera().shape(), pose.pixel_m(), pose.is_nadir()), ([20, 50], Some(0.25), false));
        let target_m = [107.0, -41.0, heights.height(107.0, -41.0).unwrap()];
        let [col, row] = pose.camera().project(target_m).unwrap();
        assert!((col - 25.0).abs() < 1e-9 && (row - 10.0).abs() < 1e-9, "{col} {row}");
        // An oblique image is counted in pixels, a map lies on the ground.
        assert_eq!(pose.geometry(), Geometry::square(20, 50, 1.0));
        assert_eq!(CameraParameters::default().pose(&heights).unwrap().geometry(), heights.geometry);
    }

    /// Pixels are counted as if an image of the complete surface were seen from above.
    #[test]
    fn val_pixels_are_estimated_from_the_surface() {
        let count = |camera: serde_json::Value| parameters(camera).pixels([20.0, 15.0], 0.5);
        assert_eq!(count(json!({ "kind": "nadir" })), 1200.0);
        assert_eq!(count(json!({ "kind": "nadir", "pixel_m": 0.25 })), 4800.0);
        let oblique = json!({ "kind": "parallel", "azimuth_deg": 0.0, "elevation_deg": 45.0, "size_px": [50, 20] });
        assert_eq!(count(oblique), 1000.0);
        let pinhole = json!({ "kind": "pinhole", "position_m": [0.0, 0.0, 1.5], "target_m": [1.0, 0.0, 0.0] });
        assert_eq!((count(pinhole.clone()), parameters(pinhole).kind()), (307_200.0, "pinhole"));
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
        /// The image of a parallel camera covers every point of the surface, and is hardly larger than necessary.
        #[test]
        fn prop_parallel_images_cover_the_surface(azimuth in 0.0..360.0f64, elevation in 5.0..90.0f64, pixel in 0.1..3.0f64) {
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

        /// A pose written to the JSON file of an image and read back gives the same camera.
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
