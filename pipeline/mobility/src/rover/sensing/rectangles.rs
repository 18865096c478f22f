//! Rectangles ahead, safe or unsafe, by perfect knowledge of the ground in them.
//!
//! A rectangle is unsafe if a rock pixel in it is higher above the sand than the clearance, or if the sand is too steep. The sand is
//! the least-squares plane through the sand pixels of the rectangle; if these are too few, through those of all rectangles; and if
//! these are too few as well, the plane of the body. The paper gives the size, the four rectangles, and that they are derived from
//! the DEM and the map of rock and sand; the rule is our choice.

use super::{Area, View};
use crate::rover::draws::{CycleDraws, Purpose};
use crate::rover::pose::{Axes, Body, Pose};
use crate::rover::sand::{PlaneSums, SandPlane};
use sastrugi_numeric::{Ground, GroundClass, NoGround};

/// Geometry and limits of a sensor of rectangles.
#[derive(Clone, Debug, PartialEq)]
pub struct RectangleSensor {
    /// Distance of the near edge ahead of the centre, m.
    pub near_m: f64,
    /// Length, m.
    pub length_m: f64,
    /// Total width, m.
    pub width_m: f64,
    /// Number of rectangles side by side.
    pub count: usize,
    /// Largest height of a rock above the sand that the rover can pass over, m.
    pub clearance_m: f64,
    /// Steepest sand, m per m.
    pub slope_max: f64,
    /// Largest tilt of the rover itself, rad.
    pub tilt_max_rad: f64,
}

/// A pixel in the rover's own axes.
struct Pixel {
    at: [f64; 2],
    height_m: f64,
    is_rock: bool,
}

impl RectangleSensor {
    pub(super) fn look(
        &self,
        ground: &impl Ground,
        pose: &Pose,
        body: &Body,
        noise_m: f64,
        draws: &CycleDraws,
    ) -> Result<View, NoGround> {
        let axes = pose.axes();
        let mut pixels = Vec::with_capacity(self.count);
        for number in 0..self.count {
            pixels.push(self.pixels(ground, &axes, number, noise_m, draws)?);
        }
        let sand = |pixels: &Vec<Pixel>| {
            let mut sums = PlaneSums::default();
            // Heights relative to the body, so that squares lose no digits.
            let of_sand = pixels.iter().filter(|p| !p.is_rock);
            of_sand.for_each(|p| sums.add(p.at, p.height_m - body.height_m));
            sums
        };
        let sums: Vec<PlaneSums> = pixels.iter().map(sand).collect();
        let everywhere = sums.iter().fold(PlaneSums::default(), PlaneSums::plus).plane();
        let standing = SandPlane { level_m: 0.0, slopes: body.slopes };
        let area = |number: usize| {
            let plane = sums[number].plane().or(everywhere).unwrap_or(standing);
            let steep =
                plane.slopes[0] * plane.slopes[0] + plane.slopes[1] * plane.slopes[1] > self.slope_max * self.slope_max;
            let above = |p: &Pixel| p.height_m - body.height_m - plane.height_m(p.at);
            let rock = pixels[number].iter().any(|p| p.is_rock && above(p) > self.clearance_m);
            Area::between([self.near_m, self.near_m + self.length_m], self.sides(number), steep || rock)
        };
        let areas = (0..self.count).map(area).collect();
        Ok(View { areas, rays: Vec::new(), tilted: body.tilt_rad() > self.tilt_max_rad })
    }

    /// Right and left edge of a rectangle; rectangles are numbered from the left.
    fn sides(&self, number: usize) -> [f64; 2] {
        let each = self.width_m / self.count as f64;
        let left = 0.5 * self.width_m - number as f64 * each;
        [left - each, left]
    }

    fn pixels(
        &self,
        ground: &impl Ground,
        axes: &Axes,
        number: usize,
        noise_m: f64,
        draws: &CycleDraws,
    ) -> Result<Vec<Pixel>, NoGround> {
        let [right, left] = self.sides(number);
        let count = |extent: f64| libm::round(extent / ground.cell_m()).max(1.0) as usize;
        let (along, across) = (count(self.length_m), count(left - right));
        let mut pixels = Vec::with_capacity(along * across);
        for i in 0..along {
            for j in 0..across {
                let at = [
                    self.near_m + (i as f64 + 0.5) / along as f64 * self.length_m,
                    right + (j as f64 + 0.5) / across as f64 * (left - right),
                ];
                let [x, y] = axes.to_ground(at);
                let point = ground.at(x, y)?;
                let error_m = if noise_m > 0.0 {
                    noise_m * draws.normal_of(Purpose::Height, (number * along + i) * across + j)
                } else {
                    0.0
                };
                let is_rock = point.class == GroundClass::Rock;
                pixels.push(Pixel { at, height_m: point.height_m + error_m, is_rock });
            }
        }
        Ok(pixels)
    }
}
