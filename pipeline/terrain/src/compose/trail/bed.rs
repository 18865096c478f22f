//! The bed of a trail and its ruts.

use super::curve::Curve;
use super::{TerrainError, height};
use sastrugi_numeric::{Geometry, Grid};
use std::f64::consts::{PI, TAU};

/// Width of a rut's wall over that of the tyre.
const WALL_TYRES: f64 = 0.25;
/// Standard deviations at which the Gaussian is truncated.
const GAUSSIAN_REACH: f64 = 4.0;

/// The cross-section of a trail.
pub(super) struct Bed {
    pub(super) half_width_m: f64,
    pub(super) shoulder_m: f64,
    /// Standard deviation of the Gaussian along the trail, m.
    pub(super) smoothing_m: f64,
    pub(super) ruts: Ruts,
}

/// Two ruts.
pub(super) struct Ruts {
    /// Distance between their centres, m.
    pub(super) track_m: f64,
    pub(super) tyre_width_m: f64,
    /// Depth after all passes, m.
    pub(super) depth_m: f64,
    pub(super) berm_width_m: f64,
    /// Volume of the berms over that of the ruts.
    pub(super) berm_share: f64,
}

impl Ruts {
    /// From the centre of a rut to the top of its wall, m.
    pub(super) fn wall_m(&self) -> f64 {
        (0.5 + WALL_TYRES) * self.tyre_width_m
    }

    /// From the centre of a rut to the end of its berm, m.
    pub(super) fn reach_m(&self) -> f64 {
        self.wall_m() + self.berm_width_m
    }

    /// Change of height at a distance from the centre line, m.
    pub(super) fn height_m(&self, u: f64) -> f64 {
        self.of_one_m((u - 0.5 * self.track_m).abs()) + self.of_one_m(u + 0.5 * self.track_m)
    }

    /// Change of height at a distance from the centre of one rut, m.
    fn of_one_m(&self, v: f64) -> f64 {
        let (bottom_m, wall_m) = (0.5 * self.tyre_width_m, self.wall_m());
        if v <= bottom_m {
            -self.depth_m
        } else if v < wall_m {
            -self.depth_m * 0.5 * (1.0 + libm::cos(PI * (v - bottom_m) / (wall_m - bottom_m)))
        } else if v < self.reach_m() {
            self.berm_height_m() * 0.5 * (1.0 - libm::cos(TAU * (v - wall_m) / self.berm_width_m))
        } else {
            0.0
        }
    }

    fn berm_height_m(&self) -> f64 {
        self.berm_share * self.depth_m * (1.0 + WALL_TYRES) * self.tyre_width_m / self.berm_width_m
    }
}

/// Nearest point of the centre line: its distance, and its position along the line, m.
#[derive(Clone, Copy)]
struct Foot {
    distance_m: f64,
    along_m: f64,
}

impl Bed {
    /// Presses the trail into heights, m.
    ///
    /// # Errors
    /// [`TerrainError::Trail`] if the ground has no height somewhere.
    pub(super) fn press(&self, z: &mut Grid, curve: &Curve) -> Result<(), TerrainError> {
        let along_m = curve.along_m();
        let bed_m = self.bed_m(z, curve, &along_m)?;
        let length_m = along_m[along_m.len() - 1];
        let feet = self.feet(&z.geometry, curve, &along_m);
        for (z, foot) in z.values.iter_mut().zip(&feet).filter(|(_, foot)| foot.distance_m < self.half_width_m) {
            let weight = smooth((self.half_width_m - foot.distance_m) / self.shoulder_m);
            let to_end_m = if curve.closed { f64::INFINITY } else { foot.along_m.min(length_m - foot.along_m) };
            let rut_m = smooth(to_end_m / (2.0 * self.half_width_m)) * self.ruts.height_m(foot.distance_m);
            *z = (1.0 - weight) * *z + weight * between(&along_m, &bed_m, foot.along_m) + rut_m;
        }
        Ok(())
    }

    /// The foot of each cell on the centre line; at infinite distance beyond half the width.
    fn feet(&self, geometry: &Geometry, curve: &Curve, along_m: &[f64]) -> Vec<Foot> {
        let mut feet = vec![Foot { distance_m: f64::INFINITY, along_m: 0.0 }; geometry.len()];
        for (k, ends) in curve.points_m.windows(2).enumerate() {
            for cell in self.cells_near(geometry, [ends[0], ends[1]]) {
                let at = [geometry.x(cell % geometry.cols), geometry.y(cell / geometry.cols)];
                let foot = foot_on([ends[0], ends[1]], [along_m[k], along_m[k + 1]], at);
                if foot.distance_m < self.half_width_m && foot.distance_m < feet[cell].distance_m {
                    feet[cell] = foot;
                }
            }
        }
        feet
    }

    /// Cells of the rectangle that encloses all points within half the width of a segment.
    fn cells_near(&self, geometry: &Geometry, [a, b]: [[f64; 2]; 2]) -> impl Iterator<Item = usize> + use<> {
        let cols = geometry.cols;
        let span = |axis: usize, count: usize| {
            let in_cells = |at: f64| (at - geometry.origin[axis]) / geometry.cell[axis] - 0.5;
            let low = in_cells(a[axis].min(b[axis]) - self.half_width_m).floor().max(0.0) as usize;
            let high = in_cells(a[axis].max(b[axis]) + self.half_width_m).ceil().max(0.0) as usize;
            low.min(count)..(high + 1).min(count)
        };
        let (columns, from_south) = (span(0, cols), span(1, geometry.rows));
        let rows = geometry.rows - from_south.end..geometry.rows - from_south.start;
        rows.flat_map(move |row| columns.clone().map(move |col| row * cols + col))
    }

    /// Height of the bed at every point of the centre line, m.
    fn bed_m(&self, z: &Grid, curve: &Curve, along_m: &[f64]) -> Result<Vec<f64>, TerrainError> {
        let ground_m = curve.points_m.iter().map(|&at| height(z, at)).collect::<Result<Vec<_>, _>>()?;
        if self.smoothing_m == 0.0 {
            return Ok(ground_m);
        }
        let profile = continued(along_m, &ground_m, curve.closed);
        Ok(along_m.iter().map(|&s| gaussian_mean(&profile, s, self.smoothing_m)).collect())
    }
}

/// `3 t^2 - 2 t^3`, with t limited to 0 to 1.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn foot_on([a, b]: [[f64; 2]; 2], [from_m, to_m]: [f64; 2], at: [f64; 2]) -> Foot {
    let [dx, dy] = [0, 1].map(|axis| b[axis] - a[axis]);
    let t = (((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    let (x, y) = (at[0] - a[0] - t * dx, at[1] - a[1] - t * dy);
    Foot { distance_m: (x * x + y * y).sqrt(), along_m: from_m + t * (to_m - from_m) }
}

/// Linear interpolation between values at increasing positions.
fn between(along_m: &[f64], values: &[f64], s: f64) -> f64 {
    let k = along_m[1..along_m.len() - 1].partition_point(|&end_m| end_m <= s);
    let share = (s - along_m[k]) / (along_m[k + 1] - along_m[k]);
    values[k] + share * (values[k + 1] - values[k])
}

/// Positions and heights, extended by one length before and after: a closed profile continues, an open one is reflected through its end
/// points, so that smoothing leaves its ends in place.
fn continued(along_m: &[f64], heights: &[f64], closed: bool) -> Vec<(f64, f64)> {
    let last = along_m.len() - 1;
    let (length_m, first_z, last_z) = (along_m[last], heights[0], heights[last]);
    let own = || along_m.iter().copied().zip(heights.iter().copied());
    if closed {
        let copy = |by: f64| own().take(last).map(move |(s, z)| (s + by * length_m, z));
        return copy(-1.0).chain(copy(0.0)).chain(copy(1.0)).collect();
    }
    let before = own().skip(1).rev().map(|(s, z)| (-s, 2.0 * first_z - z));
    let after = own().rev().skip(1).map(|(s, z)| (2.0 * length_m - s, 2.0 * last_z - z));
    before.chain(own()).chain(after).collect()
}

/// Gaussian-weighted mean of a profile about a position.
fn gaussian_mean(profile: &[(f64, f64)], s: f64, deviation_m: f64) -> f64 {
    let reach_m = GAUSSIAN_REACH * deviation_m;
    let first = profile.partition_point(|(at, _)| *at < s - reach_m);
    let near = profile[first..].iter().take_while(|(at, _)| *at <= s + reach_m);
    let (sum, weights) = near.fold((0.0, 0.0), |(sum, weights), (at, z)| {
        let t = (at - s) / deviation_m;
        let weight = libm::exp(-0.5 * t * t);
        (sum + weight * z, weights + weight)
    });
    sum / weights
}
