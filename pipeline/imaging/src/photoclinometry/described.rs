//! Images from their descriptions, and the map common to them.

use super::observation::Image;
use super::params::Settings;
use crate::camera::Camera;
use crate::description::ImageDescription;
use crate::pose::CameraPose;
use crate::sun::Sun;
use sastrugi_numeric::Geometry;
use sastrugi_schemas::{ParameterError, limits, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of rows or columns of a map.
const SIDE_MAX: usize = 1 << 15;
/// Share of a cell by which a map may fall short of a whole cell.
const ROUNDING: f64 = 1e-6;

/// Errors applied to the metadata of the first image, to study their effect on the surface; all 0 by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FirstImageErrors {
    /// Added to the azimuth of its sun, deg.
    pub sun_azimuth_deg: f64,
    /// Added to the elevation of its sun, deg.
    pub sun_elevation_deg: f64,
    /// Relative error of its exposure; positive if too high.
    #[schemars(transform = limits::between(-1.0, f64::INFINITY))]
    pub exposure: f64,
    /// Added to its haze, I/F.
    pub haze: f64,
    /// Shift of its camera to the east, m: a misregistration.
    pub shift_east_m: f64,
    /// Shift of its camera to the north, m.
    pub shift_north_m: f64,
}

impl FirstImageErrors {
    /// The sun of the first image with its errors.
    pub fn sun(&self, sun: Sun) -> Sun {
        Sun {
            azimuth_deg: sun.azimuth_deg + self.sun_azimuth_deg,
            elevation_deg: sun.elevation_deg + self.sun_elevation_deg,
        }
    }

    /// # Errors
    /// A number that is not finite, or an exposure of 0 or less.
    pub fn check(&self) -> Result<(), ParameterError> {
        let numbers = [
            ("sun_azimuth_deg", self.sun_azimuth_deg),
            ("sun_elevation_deg", self.sun_elevation_deg),
            ("haze", self.haze),
            ("shift_east_m", self.shift_east_m),
            ("shift_north_m", self.shift_north_m),
        ];
        if let Some((key, value)) = numbers.into_iter().find(|(_, v)| !v.is_finite()) {
            return Err(ParameterError::new(key, format!("is {}; it must be finite", shown(value))));
        }
        if self.exposure.is_finite() && self.exposure > -1.0 {
            return Ok(());
        }
        Err(ParameterError::new(
            "exposure",
            format!("is {}; it must be a finite number above -1", shown(self.exposure)),
        ))
    }
}

/// Images from their descriptions and pixels, top row first; the errors apply to the first one.
pub fn images(described: Vec<(ImageDescription, Vec<f64>)>, errors: &FirstImageErrors) -> Vec<Image> {
    let of = |(k, (description, brightness)): (usize, (ImageDescription, Vec<f64>))| {
        let (mut sun, mut pose) = (description.sun, description.camera);
        let (mut exposure, mut haze) = (description.exposure, description.haze);
        if k == 0 {
            sun = errors.sun(sun);
            exposure *= 1.0 + errors.exposure;
            haze += errors.haze;
            pose = shifted(pose, [errors.shift_east_m, errors.shift_north_m]);
        }
        Image { camera: pose.camera(), light: sun.direction(), exposure, haze, brightness }
    };
    described.into_iter().enumerate().map(of).collect()
}

fn shifted(pose: CameraPose, [east, north]: [f64; 2]) -> CameraPose {
    let moved = |[x, y, z]: [f64; 3]| [x + east, y + north, z];
    match pose {
        CameraPose::Parallel { azimuth_deg, elevation_deg, centre_m, pixel_m, rows, cols } => {
            CameraPose::Parallel { azimuth_deg, elevation_deg, centre_m: moved(centre_m), pixel_m, rows, cols }
        }
        CameraPose::Pinhole { position_m, target_m, field_of_view_deg, rows, cols } => CameraPose::Pinhole {
            position_m: moved(position_m),
            target_m: moved(target_m),
            field_of_view_deg,
            rows,
            cols,
        },
    }
}

/// Height of the point at the centre of an image, m.
pub fn level_m(pose: &CameraPose) -> f64 {
    match pose {
        CameraPose::Parallel { centre_m, .. } => centre_m[2],
        CameraPose::Pinhole { target_m, .. } => target_m[2],
    }
}

/// The map of a set of images: a window, or the rectangle of level ground at `level_m` that all of them show.
///
/// # Errors
/// Cameras without a pixel size and no `cell_m`; a window or common ground smaller than 4 x 4 cells; images without common ground; maps too large.
pub fn map(poses: &[CameraPose], level_m: f64, settings: &Settings) -> Result<Geometry, ParameterError> {
    let finest = poses.iter().filter_map(CameraPose::pixel_m).reduce(f64::min);
    let Some(cell) = settings.cell_m.or(finest) else {
        return Err(ParameterError::new(
            "cell_m",
            "is missing; it is required because pinhole cameras have no pixel size",
        ));
    };
    ParameterError::positive("cell_m", cell)?;
    let shown_by = |pose: &CameraPose| footprint(&pose.camera(), level_m);
    let common = || poses.iter().map(shown_by).reduce(common).unwrap_or([f64::NAN; 4]);
    let [x0, y0, x1, y1] = settings.window_m.unwrap_or_else(common);
    let count = |low: f64, high: f64| ((high - low) / cell + ROUNDING).floor();
    let (cols, rows) = (count(x0, x1), count(y0, y1));
    if !(cols >= 4.0 && rows >= 4.0) {
        return Err(too_small([x0, y0, x1, y1], cell, settings.window_m.is_some()));
    }
    if cols > SIDE_MAX as f64 || rows > SIDE_MAX as f64 {
        let message = format!("is {cell}; the map would have {cols} x {rows} cells, more than {SIDE_MAX} along a side");
        return Err(ParameterError::new("cell_m", message));
    }
    Ok(Geometry { rows: rows as usize, cols: cols as usize, cell: [cell; 2], origin: [x0, y0] })
}

/// Error for a map of fewer than 4 x 4 cells, given by a window or common to all images.
fn too_small([x0, y0, x1, y1]: [f64; 4], cell: f64, given: bool) -> ParameterError {
    let size = format!("{} x {} m", shown(x1 - x0), shown(y1 - y0));
    let least = format!("a map needs at least 4 x 4 cells of {} m", shown(cell));
    let overlap = x1 > x0 && y1 > y0;
    match (given, overlap) {
        (true, _) => ParameterError::new("window_m", format!("spans {size}; {least}")),
        (false, true) => ParameterError::new(
            "cell_m",
            format!("is too large: the ground that all images show spans {size}; {least}"),
        ),
        (false, false) => {
            ParameterError::new("images", "have no ground in common: no point lies in the footprints of all of them")
        }
    }
}

/// Bounding rectangle of the level ground shown by an image; unbounded if a corner looks above the horizon.
fn footprint(camera: &Camera, level_m: f64) -> [f64; 4] {
    let [rows, cols] = camera.shape().map(|n| n as f64);
    let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for corner in [[0.0, 0.0], [cols, 0.0], [0.0, rows], [cols, rows]] {
        let ray = camera.ray(corner);
        if ray.direction[2] >= 0.0 {
            return [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY];
        }
        let t = (level_m - ray.origin_m[2]) / ray.direction[2];
        for axis in 0..2 {
            let at = ray.origin_m[axis] + t * ray.direction[axis];
            bounds[axis] = bounds[axis].min(at);
            bounds[axis + 2] = bounds[axis + 2].max(at);
        }
    }
    bounds
}

fn common(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parallel(elevation_deg: f64, x: f64) -> CameraPose {
        let centre_m = [x, 20.0, 3.0];
        CameraPose::Parallel { azimuth_deg: 90.0, elevation_deg, centre_m, pixel_m: 0.5, rows: 40, cols: 60 }
    }

    /// From above, the map is the image; an oblique image covers more ground along its tilt; the map of two images is their overlap.
    #[test]
    fn val_the_map_is_the_common_ground() {
        let above = CameraPose::Parallel {
            azimuth_deg: 0.0,
            elevation_deg: 90.0,
            centre_m: [50.0, 20.0, 3.0],
            pixel_m: 0.5,
            rows: 40,
            cols: 60,
        };
        let g = map(&[above], 3.0, &Settings::default()).unwrap();
        assert_eq!((g.rows, g.cols, g.cell), (40, 60, [0.5; 2]));
        assert!((g.origin[0] - 35.0).abs() < 1e-9 && (g.origin[1] - 10.0).abs() < 1e-9, "{:?}", g.origin);
        // 30 m across and 20 m high, seen from the east at 30 deg elevation: 60 m of ground east-west, 20 m north-south.
        let wide = footprint(&parallel(30.0, 50.0).camera(), 3.0);
        assert!(wide.iter().zip([20.0, 10.0, 80.0, 30.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{wide:?}");
        // Ground 1 m lower lies farther along the rays, which lead west.
        let lower = footprint(&parallel(30.0, 50.0).camera(), 2.0);
        assert!((lower[0] - (20.0 - 3f64.sqrt())).abs() < 1e-9 && (lower[1] - 10.0).abs() < 1e-9, "{lower:?}");
        let moved = shifted(above, [10.0, -4.0]);
        let g = map(&[above, moved], 3.0, &Settings { cell_m: Some(1.0), ..Settings::default() }).unwrap();
        assert_eq!((g.rows, g.cols), (16, 20));
    }

    /// Errors apply to the first image alone: sun and haze by addition, exposure by a factor, the camera by a shift.
    #[test]
    fn val_errors_apply_to_the_first_image() {
        let described = ImageDescription {
            image: "a.tif".to_owned(),
            sun: Sun { azimuth_deg: 100.0, elevation_deg: 40.0 },
            camera: parallel(90.0, 50.0),
            photometry: crate::Photometry::default(),
            exposure: 2.0,
            haze: 0.01,
            noise: crate::Noise::default(),
            rendered: None,
        };
        let errors = FirstImageErrors {
            sun_azimuth_deg: 5.0,
            sun_elevation_deg: -2.0,
            exposure: 0.1,
            haze: 0.02,
            shift_east_m: 3.0,
            shift_north_m: -1.0,
        };
        let both = vec![(described.clone(), vec![0.1]), (described.clone(), vec![0.2])];
        let made = images(both, &errors);
        assert_eq!(made.len(), 2);
        let (first, second) = (&made[0], &made[1]);
        assert_eq!((second.exposure, second.haze, second.light), (2.0, 0.01, described.sun.direction()));
        assert_eq!((second.camera, &second.brightness[..]), (described.camera.camera(), &[0.2][..]));
        assert!((first.exposure - 2.2).abs() < 1e-12 && (first.haze - 0.03).abs() < 1e-12);
        assert_eq!(first.light, crate::direction(105.0, 38.0));
        // The camera looks 3 m farther east and 1 m farther south.
        let middle = first.camera.ray([30.0, 20.0]).origin_m;
        assert!((middle[0] - 53.0).abs() < 1e-12 && (middle[1] - 19.0).abs() < 1e-12, "{middle:?}");
    }

    #[test]
    fn val_maps_without_cells_or_ground_are_refused() {
        let pinhole = CameraPose::Pinhole {
            position_m: [0.0, 0.0, 2.0],
            target_m: [10.0, 0.0, 2.0],
            field_of_view_deg: 60.0,
            rows: 10,
            cols: 10,
        };
        assert_eq!(map(&[pinhole], 0.0, &Settings::default()).unwrap_err().key, "cell_m");
        let apart = [parallel(90.0, 0.0), parallel(90.0, 500.0)];
        let of = |settings: &Settings| map(&apart, 3.0, settings).unwrap_err().to_string();
        assert_eq!(
            of(&Settings::default()),
            "`images` have no ground in common: no point lies in the footprints of all of them"
        );
        let window_m = Some([0.0, 0.0, 1.5, 20.0]);
        assert_eq!(
            of(&Settings { window_m, ..Settings::default() }),
            "`window_m` spans 1.5 x 20 m; a map needs at least 4 x 4 cells of 0.5 m"
        );
        let words =
            map(&apart[..1], 3.0, &Settings { cell_m: Some(9.0), ..Settings::default() }).unwrap_err().to_string();
        assert_eq!(
            words,
            "`cell_m` is too large: the ground that all images show spans 30 x 20 m; a map needs at least 4 x 4 cells of 9 m"
        );
        let huge = Settings { cell_m: Some(1e-6), ..Settings::default() };
        assert_eq!(map(&apart[..1], 3.0, &huge).unwrap_err().key, "cell_m");
    }
}
