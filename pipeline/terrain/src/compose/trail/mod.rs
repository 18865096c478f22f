//! A vehicle trail on the ground so far: its centre line, a levelled bed, and two ruts.
//!
//! # Centre line
//! `ridges` and `valleys`: the path of least cost from the south-western to the north-eastern corner of the border, over heights averaged
//! over squares of half the trail's width. A metre costs `1 + attraction t^2`, with t = 0 on the highest ground and 1 on the lowest
//! (`valleys`: the reverse). `loop`: an ellipse about the centre with semi-axes of `loop_share` times the sides, each point moved in or
//! out by up to `loop_wander_share` to minimise the sum of `dz^2 / ds` around the loop. Both are resampled every sixteenth of the
//! turning radius and relaxed (`1/4, 1/2, 1/4`; the loop in its distance from the centre) until no three successive points lie on a
//! circle smaller than the turning radius.
//!
//! # Bed
//! Let u be the distance from the centre line, H the ground's height along it, smoothed by a Gaussian of standard deviation `smoothing_m`, and
//! `w = 3 t^2 - 2 t^3` with `t = (width_m / 2 - u) / shoulder_m` limited to 0 to 1. Heights become `(1 - w) z + w H`; beyond
//! `width_m / 2` they do not change.
//!
//! # Ruts
//! Two tyres of width b at `track_m / 2` from the centre line press to the depth `D = rut_depth_m passes^(1 / multipass_coefficient)`. The
//! bottom is level over b, with walls of width b / 4 (half a cosine). Next to each wall is a berm of width B,
//! `h (1 - cos(2 pi v / B)) / 2` at the distance v from the wall, with `h = berm_share D (b + b / 4) / B`. The berms thus hold the share
//! `berm_share` of the ruts' volume; the rest is compacted soil. This holds along curves too: the cross-section is even in u, and the
//! area of a strip, `1 - u / radius`, is odd apart from its 1. At open ends, ruts and berms fade into the bed over one trail width.
//!
//! # Source
//! The three kinds of trail and their widths are those of MAVS (`random_scene.cpp`, `surface.cpp`, `trail.cpp`). Its `track_width`
//! is the width of one rut, here `tyre_width_m`, and its `wheelbase` the distance between the ruts, here `track_m`. In MAVS a ridge trail climbs
//! the gradient on its way from corner to corner, the loop is the plain ellipse, and the trail keeps plants out of the ruts and low next to
//! them; it changes no heights. Bed, ruts and the power law of passes are our own construction, not based on measured ruts.
//!
//! # Cost
//! One search over a lattice with half the trail's width as spacing, and a few passes over the cells under the trail; two grids. No random
//! draws.

mod bed;
mod curve;
mod params;
mod route;
#[cfg(test)]
mod tests;

pub use params::{Follows, RawTrail};

use crate::generator::TerrainError;
use bed::Bed;
use curve::Curve;
use params::Course;
use sastrugi_numeric::{Geometry, Grid, Surface};

/// A checked trail on cells of one size.
pub(super) struct Trail {
    course: Course,
    bed: Bed,
    /// Smallest radius of the centre line, m.
    turning_radius_m: f64,
    /// The centre line keeps this far from the edges, m.
    border_m: f64,
    width_m: f64,
    /// Its parameters, with all defaults filled in.
    pub(super) parameters: RawTrail,
}

impl Trail {
    /// Presses the trail into heights (m) and returns the points of its centre line, m; a loop ends with its first point.
    ///
    /// # Errors
    /// [`TerrainError::Trail`] if the ground has no height somewhere, or no line keeps the turning radius.
    pub(super) fn lay(&self, z: &mut Grid) -> Result<Vec<[f64; 2]>, TerrainError> {
        let curve = self.centre_line(z)?;
        self.bed.press(z, &curve)?;
        Ok(curve.points_m)
    }

    /// A note if cells of this size, m, are too large to represent the ruts.
    pub(super) fn note(&self, cell_m: f64) -> Option<String> {
        let RawTrail { tyre_width_m, rut_depth_m, passes, .. } = self.parameters;
        let ruts = rut_depth_m > 0.0 && passes > 0;
        (ruts && cell_m > 0.5 * tyre_width_m).then(|| {
            let most_m = 0.5 * tyre_width_m;
            format!("ruts of {tyre_width_m} m are too narrow for cells of {cell_m} m to show their full depth; use cells of at most {most_m} m")
        })
    }

    fn centre_line(&self, z: &Grid) -> Result<Curve, TerrainError> {
        let ground = Ground { z, size_m: 0.5 * self.width_m };
        let curve = match self.course {
            Course::Path { favours_high, attraction } => {
                let corners = self.corners(&z.geometry);
                let path = route::least_cost(&ground, corners, favours_high, attraction)?;
                curve::relaxed_path(path, self.turning_radius_m)
            }
            Course::Loop { share, wander_share } => {
                let ellipse = self.ellipse(&z.geometry, share, wander_share);
                let reaches = ellipse.fitted(&ground, self.turning_radius_m)?;
                ellipse.relaxed(reaches, self.turning_radius_m)
            }
        };
        curve.ok_or_else(|| {
            let radius_m = self.turning_radius_m;
            trail_error(format!("no centre line keeps the turning radius of {radius_m} m; choose a smaller one"))
        })
    }

    /// South-western and north-eastern corner of the border.
    fn corners(&self, geometry: &Geometry) -> [[f64; 2]; 2] {
        let (origin, size) = (geometry.origin, geometry.size());
        [origin.map(|o| o + self.border_m), [0, 1].map(|axis| origin[axis] + size[axis] - self.border_m)]
    }

    fn ellipse(&self, geometry: &Geometry, share: f64, wander_share: f64) -> curve::Ellipse {
        let (origin, size) = (geometry.origin, geometry.size());
        let half_axes_m = size.map(|side| share * side);
        let room = [0, 1].map(|axis| (0.5 * size[axis] - self.border_m) / half_axes_m[axis]);
        curve::Ellipse {
            middle_m: [0, 1].map(|axis| origin[axis] + 0.5 * size[axis]),
            half_axes_m,
            reach: [1.0 - wander_share, (1.0 + wander_share).min(room[0]).min(room[1])],
        }
    }
}

fn trail_error(reason: String) -> TerrainError {
    TerrainError::Trail { reason }
}

/// Heights averaged over squares.
struct Ground<'a> {
    z: &'a Grid,
    /// Side of a square, m.
    size_m: f64,
}

impl Ground<'_> {
    /// Mean of 5 x 5 heights over the square about a point, m.
    ///
    /// # Errors
    /// [`TerrainError::Trail`] where the ground has no height.
    fn height(&self, [x, y]: [f64; 2]) -> Result<f64, TerrainError> {
        let mut sum = 0.0;
        for k in 0..25 {
            let [dx, dy] = [k % 5, k / 5].map(|i| (f64::from(i) - 2.0) / 5.0 * self.size_m);
            sum += height(self.z, [x + dx, y + dy])?;
        }
        Ok(sum / 25.0)
    }
}

fn height(z: &Grid, [x, y]: [f64; 2]) -> Result<f64, TerrainError> {
    z.height(x, y).ok_or_else(|| {
        trail_error(format!("the ground has no height at x = {x:.2} m, y = {y:.2} m; earlier processes must cover it"))
    })
}
