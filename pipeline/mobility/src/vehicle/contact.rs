//! Contact of a wheel with the ground: a fan of rays on several discs, after the multi-disc tyre models of Project Chrono
//! (Tasora et al., 2016).
//!
//! Every disc `d` of a wheel carries rays at angles `t` to either side of the body's down direction. The tip of a ray,
//!
//! ```text
//! P = hub + d y + r (sin t x - cos t z)
//! ```
//!
//! meets the local bilinear plane of height `h` and gradient `(hx, hy)`. With unit normal `n = (-hx, -hy, 1) / sqrt(1 +
//! hx^2 + hy^2)` its depth is `(h - P_z) n_z`, and it pushes with `k depth` along `n`. The rays' forces add up to one
//! normal force `N0` in the direction `n`. As each of them passes through the axle of a round wheel, so does their sum: it
//! acts on the rim point where `n` leaves the wheel, on the load-weighted mean disc. A damper along `n` completes the
//! normal force, `N = max(0, N0 - c v_n)`. On a plane of any slope the direction is exact; with one bump under the fan it
//! is that of the planes around the touching tips.
//!
//! Stiffness of a ray: on level ground the static load `W` must sag the wheel by `W / stiffness`, so `k` is `W` over the
//! summed depths of all tips at that sag, whatever their number.
//!
//! Symbols: `x`, `y`, `z` body axes; `r` wheel radius, m. Cost: one height per ray that reaches below the ceiling of the
//! ground around the wheel.

use super::ground::Ground;
use super::params::VehicleParameters;
use super::vector::{Axes, Vec3, add, add_scaled, cross, norm, scale};
use sastrugi_schemas::ParameterError;

/// The contact geometry of one wheel.
#[derive(Clone, Debug)]
pub(crate) struct Tyre {
    pub radius_m: f64,
    /// Sine and cosine of the rays' angles times the radius, m.
    rays: Vec<[f64; 2]>,
    /// Discs across the wheel, left positive, m.
    discs: Vec<f64>,
    ray_stiffness_n_m: f64,
    /// Farthest ray tip from the hub, m.
    pub reach_m: f64,
}

impl Tyre {
    /// # Errors
    /// When no ray touches level ground at the sag that stiffness and load ask for.
    pub(crate) fn new(parameters: &VehicleParameters, static_load_n: f64) -> Result<Self, ParameterError> {
        let (tyre, wheels) = (&parameters.tyre, &parameters.wheels);
        let radius_m = wheels.radius_m;
        let spread = |i: u32, n: u32| if n == 1 { 0.0 } else { 2.0 * f64::from(i) / f64::from(n - 1) - 1.0 };
        let ray = |i: u32| {
            let (sin, cos) = libm::sincos(spread(i, tyre.rays) * tyre.fan_deg.to_radians());
            [radius_m * sin, radius_m * cos]
        };
        let rays: Vec<[f64; 2]> = (0..tyre.rays).map(ray).collect();
        let discs: Vec<f64> = (0..tyre.discs).map(|i| 0.5 * wheels.width_m * spread(i, tyre.discs)).collect();
        let sag_m = static_load_n / tyre.stiffness_n_m;
        let depths: f64 = rays.iter().map(|[_, down]| (sag_m - (radius_m - down)).max(0.0)).sum();
        if depths <= 0.0 {
            let message =
                format!("{} rays miss the ground at a sag of {sag_m:.2e} m; take more, or an odd number", tyre.rays);
            return Err(ParameterError::new("tyre.rays", message));
        }
        let ray_stiffness_n_m = static_load_n / (depths * discs.len() as f64);
        let half_width = discs.iter().fold(0.0, |widest: f64, d| widest.max(d.abs()));
        let reach_m = (radius_m * radius_m + half_width * half_width).sqrt();
        Ok(Self { radius_m, rays, discs, ray_stiffness_n_m, reach_m })
    }

    /// Stiffness of a wheel with all rays in the ground, N/m: the largest that the time step has to stand.
    pub(crate) fn stiffness_max_n_m(&self) -> f64 {
        self.ray_stiffness_n_m * (self.rays.len() * self.discs.len()) as f64
    }

    /// Ray tips from the hub in the middle plane of a wheel, in the map frame.
    pub(crate) fn rim(&self, axes: &Axes, rim: &mut Vec<Vec3>) {
        rim.clear();
        rim.extend(self.rays.iter().map(|&[forward, down]| add_scaled(scale(axes.x, forward), axes.z, -down)));
    }

    /// All ray tips of a wheel with that hub.
    pub(crate) fn tips<'a>(&'a self, hub: Vec3, left: Vec3, rim: &'a [Vec3]) -> impl Iterator<Item = Vec3> + 'a {
        self.discs.iter().flat_map(move |&offset| rim.iter().map(move |&ray| add(add_scaled(hub, left, offset), ray)))
    }

    /// What the ground does to a wheel with that hub; `rim` as made by [`Self::rim`] for these axes.
    pub(crate) fn press(&self, ground: &Ground, hub: Vec3, axes: &Axes, rim: &[Vec3]) -> Pressing {
        let ceiling = ground.ceiling(hub[0], hub[1]);
        let mut total = Pressing::default();
        if hub[2] - self.reach_m - CULLING_MARGIN_M > ceiling {
            return total;
        }
        for &offset in &self.discs {
            let centre = add_scaled(hub, axes.y, offset);
            for &ray in rim {
                let tip = add(centre, ray);
                if tip[2] > ceiling {
                    continue;
                }
                let overlap = ground.height(tip[0], tip[1]) - tip[2];
                if overlap > 0.0 {
                    total.add(self.ray_stiffness_n_m * overlap, ground.gradient(tip[0], tip[1]), offset);
                } else if overlap.is_nan() {
                    total.undefined = true;
                }
            }
        }
        total
    }
}

#[cfg(test)]
impl Tyre {
    /// Elastic energy of a wheel's rays, J.
    pub(crate) fn stored_j(&self, ground: &Ground, hub: Vec3, left: Vec3, rim: &[Vec3]) -> f64 {
        let stored = |tip: Vec3| {
            let (hx, hy) = ground.gradient(tip[0], tip[1]);
            let overlap = (ground.height(tip[0], tip[1]) - tip[2]).max(0.0);
            0.5 * self.ray_stiffness_n_m * overlap * overlap / (1.0 + hx * hx + hy * hy)
        };
        self.tips(hub, left, rim).map(stored).sum()
    }
}

/// A group of points counts as clear of the ground only by more than this, so that rounding decides nothing, m.
pub(crate) const CULLING_MARGIN_M: f64 = 1e-6;

/// Sum of the normal forces of a wheel's rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pressing {
    /// Elastic force, N.
    pub force: Vec3,
    /// Sum of disc offset times vertical force, N m.
    offset_moment: f64,
    /// A ray met ground without data.
    pub undefined: bool,
}

impl Pressing {
    /// Adds a ray: `k (h - z)` shared out over the plane's normal, `k (h - z) n_z n`.
    #[inline(always)]
    fn add(&mut self, stiff_overlap: f64, (hx, hy): (f64, f64), offset: f64) {
        let vertical = stiff_overlap / (1.0 + hx * hx + hy * hy);
        self.force[0] -= vertical * hx;
        self.force[1] -= vertical * hy;
        self.force[2] += vertical;
        self.offset_moment += vertical * offset;
    }

    /// Where and how the ground touches the wheel; `None` off the ground, or when the wheel lies on its side.
    pub(crate) fn touch(&self, hub: Vec3, axes: &Axes, radius_m: f64) -> Option<Touch> {
        let elastic_n = norm(self.force);
        if elastic_n <= 0.0 {
            return None;
        }
        let normal = scale(self.force, 1.0 / elastic_n);
        let along = cross(axes.y, normal);
        let in_plane = norm(along);
        if in_plane < IN_PLANE_MIN {
            return None;
        }
        let forward = scale(along, 1.0 / in_plane);
        let outward = cross(forward, axes.y);
        let middle = add_scaled(hub, axes.y, self.offset_moment / self.force[2]);
        let point = add_scaled(middle, outward, -radius_m);
        Some(Touch { elastic_n, normal, forward, left: cross(normal, forward), point })
    }
}

/// Sine of the smallest angle between contact normal and axle at which a wheel still rolls.
const IN_PLANE_MIN: f64 = 0.05;

/// The one contact of a wheel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// Elastic part of the normal force, N.
    pub elastic_n: f64,
    /// Contact normal, out of the ground.
    pub normal: Vec3,
    /// Rolling direction in the contact plane.
    pub forward: Vec3,
    /// Left of the rolling direction in the contact plane.
    pub left: Vec3,
    /// Point of action in the map frame, m.
    pub point: Vec3,
}
