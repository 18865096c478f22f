//! Range measurements along rays: columns of rays ahead, each column covering a strip of ground.
//!
//! A ray leaves the front of the rover and aims at a point ahead on the plane of the body; it is traced to twice that range. Its hit
//! has the height v above that plane. A column is a hazard if one of its rays is, and a ray is a hazard if
//!
//! * it hits nothing (a drop-off),
//! * |v| exceeds the hazard height,
//! * v exceeds that of a neighbouring ray, in front, behind or to the side, by more than the hazard height,
//! * v is the largest of all, and exceeds the smallest by more than the span.
//!
//! The paper specifies 20 ranges and a tilt; the flight rover avoided rocks, slopes and drop-offs (Mishkin et al., 1998). Geometry
//! and rules are our choice. Distances are horizontal.

use super::{Area, Ray, View};
use crate::rover::draws::{CycleDraws, Purpose};
use crate::rover::pose::{Axes, Body, Pose};
use sastrugi_numeric::{Ground, NoGround};

/// Rays are traced to this many nominal ranges.
const REACH: f64 = 2.0;
/// Lateral offset of a ray's origin, as a share of its column's offset from the centre line.
const SPREAD: f64 = 0.3;
/// Steps along a ray, in cells of the ground.
const STEP_CELLS: f64 = 0.5;

/// Geometry and limits of a sensor of rays.
#[derive(Clone, Debug, PartialEq)]
pub struct RaySensor {
    /// Distance of the nose ahead of the centre, m.
    pub nose_m: f64,
    /// Distance of the ray origins behind the nose, m.
    pub behind_nose_m: f64,
    /// Height of the ray origins above the plane of the body, m.
    pub height_m: f64,
    /// Lateral offsets of the columns, left positive, from left to right, m.
    pub columns_m: Vec<f64>,
    /// Distances beyond the nose at which the rays of a column are aimed, near ones first, m.
    pub rows_m: Vec<f64>,
    /// Hazard height, m.
    pub step_m: f64,
    /// Largest height difference in a view without a hazard, m.
    pub span_m: f64,
    /// Largest tilt, rad.
    pub tilt_max_rad: f64,
}

impl RaySensor {
    pub(super) fn look(
        &self,
        ground: &impl Ground,
        pose: &Pose,
        body: &Body,
        noise_m: f64,
        draws: &CycleDraws,
    ) -> Result<View, NoGround> {
        let axes = pose.axes();
        let mut rays = Vec::with_capacity(self.columns_m.len() * self.rows_m.len());
        for left in &self.columns_m {
            for ahead in &self.rows_m {
                let mut ray = self.follow(ground, &axes, body, [*ahead, *left])?;
                if noise_m > 0.0 {
                    let error_m = noise_m * draws.normal_of(Purpose::Height, rays.len());
                    ray.height_m = ray.height_m.map(|v| v + error_m);
                }
                rays.push(ray);
            }
        }
        let heights: Vec<Option<f64>> = rays.iter().map(|ray| ray.height_m).collect();
        rays.iter_mut().zip(self.hazards(&heights)).for_each(|(ray, hazard)| ray.hazard = hazard);
        let columns = rays.chunks_exact(self.rows_m.len()).enumerate();
        let areas = columns.map(|(k, rays)| self.strip(k, rays.iter().any(|ray| ray.hazard))).collect();
        Ok(View { areas, rays, tilted: body.tilt_rad() > self.tilt_max_rad })
    }

    /// The strip of ground of a column, halfway to its neighbours.
    fn strip(&self, column: usize, hazard: bool) -> Area {
        let at = |k: usize| self.columns_m[k];
        let last = self.columns_m.len() - 1;
        let half_gap = |a: usize, b: usize| 0.5 * (at(a) - at(b)).abs();
        let (gap_left, gap_right) = match (column > 0, column < last) {
            (true, true) => (half_gap(column, column - 1), half_gap(column, column + 1)),
            (true, false) => (half_gap(column, column - 1), half_gap(column, column - 1)),
            (false, true) => (half_gap(column, column + 1), half_gap(column, column + 1)),
            (false, false) => (self.nose_m, self.nose_m),
        };
        let far = self.nose_m + self.rows_m.iter().fold(0.0, |far: f64, row| far.max(*row));
        Area::between([self.nose_m, far], [at(column) - gap_right, at(column) + gap_left], hazard)
    }

    /// The ray of a row and a column.
    fn follow(&self, ground: &impl Ground, axes: &Axes, body: &Body, [row, column]: [f64; 2]) -> Result<Ray, NoGround> {
        let from = [self.nose_m - self.behind_nose_m, SPREAD * column];
        let aim = [self.nose_m + row - from[0], column - from[1]];
        let range_m = (aim[0] * aim[0] + aim[1] * aim[1]).sqrt();
        let steps = libm::ceil(REACH * range_m / (STEP_CELLS * ground.cell_m())).max(1.0) as u32;
        let point = |t: f64| [from[0] + t * aim[0], from[1] + t * aim[1]];
        let above = |t: f64| self.height_m * (1.0 - t);
        let space = |t: f64, z: f64| {
            let [x, y] = axes.to_ground(point(t));
            [x, y, z]
        };
        let from_m = space(0.0, body.height_at_m(from) + self.height_m);
        let mut last = f64::INFINITY;
        for n in 0..=steps {
            let t = REACH * f64::from(n) / f64::from(steps);
            let [x, y] = axes.to_ground(point(t));
            let gap = above(t) - (ground.at(x, y)?.height_m - body.height_at_m(point(t)));
            if gap <= 0.0 {
                // Interpolate between the last step and this one; at the origin there is no last step.
                let back = if last.is_finite() { gap / (gap - last) } else { 0.0 };
                let hit = t - back * REACH / f64::from(steps);
                let to_m = space(hit, body.height_at_m(point(hit)) + above(hit));
                return Ok(Ray { from_m, to_m, height_m: Some(above(hit)), place_m: point(hit), hazard: false });
            }
            last = gap;
        }
        let to_m = space(REACH, body.height_at_m(point(REACH)) + above(REACH));
        Ok(Ray { from_m, to_m, height_m: None, place_m: point(1.0), hazard: false })
    }

    /// Hazard flag of each ray, from the heights column by column.
    pub(crate) fn hazards(&self, heights: &[Option<f64>]) -> Vec<bool> {
        let rows = self.rows_m.len();
        let too_high = |v: &Option<f64>| v.is_none_or(|v| v.abs() > self.step_m);
        let mut hazards: Vec<bool> = heights.iter().map(too_high).collect();
        for k in 0..heights.len() {
            let behind = (k % rows + 1 < rows).then_some(k + 1);
            let beside = Some(k + rows).filter(|next| *next < heights.len());
            for next in behind.into_iter().chain(beside) {
                let Some((one, other)) = heights[k].zip(heights[next]) else { continue };
                hazards[k] |= one - other > self.step_m;
                hazards[next] |= other - one > self.step_m;
            }
        }
        let hits = heights.iter().enumerate().filter_map(|(k, v)| v.map(|v| (k, v)));
        let lowest = hits.clone().map(|(_, v)| v).fold(f64::INFINITY, f64::min);
        if let Some((highest, v)) = hits.max_by(|a, b| a.1.total_cmp(&b.1))
            && v - lowest > self.span_m
        {
            hazards[highest] = true;
        }
        hazards
    }
}
