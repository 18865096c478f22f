//! Contact between wheel and ground: a fan of rays on several discs, after the multi-disc tyre models of Project Chrono
//! (Tasora et al., 2016).
//!
//! Every disc `d` of a wheel carries rays at angles `t` on both sides of the body's down direction. The tip of a ray,
//!
//! ```text
//! P = hub + d y + r (sin t x - cos t z)
//! ```
//!
//! meets the local bilinear plane of height `h` and gradient `(hx, hy)`. With unit normal `n = (-hx, -hy, 1) / sqrt(1 +
//! hx^2 + hy^2)` its depth is `(h - P_z) n_z`, and it pushes with `k depth` along `n`. The forces of the rays add up to one
//! normal force `N0` in the direction `n`. Each of them passes through the axle of a round wheel, and so does their sum: it
//! acts on the rim point where `n` leaves the wheel, on the load-weighted mean disc. A damper along `n` completes the
//! normal force, `N = max(0, N0 - c v_n)`. On a plane of any slope the direction is exact; with a bump under the fan it
//! is that of the planes around the touching tips.
//!
//! Stiffness of a ray: on level ground, the static load `W` must make the wheel sag by `W / stiffness`, so `k` is `W` divided
//! by the summed depths of all tips at that sag, whatever their number.
//!
//! Symbols: `x`, `y`, `z` body axes; `r` wheel radius, m. Cost: one height lookup per four neighbouring rays, unless all of them end
//! above the ceiling of the ground around the wheel. Rays that touch are summed in their order, without a branch for each: those that
//! do not touch add zeros, which change no bit of a sum that starts at `+0`.

use super::ground::Ground;
use super::lanes::{Four, LANES, Quad, all_clear, any_unknown, apart};
use super::params::VehicleParameters;
use super::vector::{Axes, Number, Vec3, add, add_scaled, cross, norm, scale, sub};
use pulp::{Simd, WithSimd, cast};
use sastrugi_schemas::ParameterError;

/// The contact geometry of one wheel.
#[derive(Clone, Debug)]
pub(crate) struct Tyre {
    pub radius_m: f64,
    /// The rays of a disc, from behind to ahead.
    rays: Vec<Rays>,
    /// Number of rays of a disc.
    rays_per_disc: usize,
    /// Lateral offsets of the discs, left positive, m.
    discs: Vec<f64>,
    ray_stiffness_n_m: f64,
    /// Distance of the farthest ray tip from the hub, m.
    pub reach_m: f64,
}

impl Tyre {
    /// # Errors
    /// If no ray touches level ground at the sag that follows from stiffness and load.
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
            let message = format!(
                "is {}: all rays miss the ground at a sag of {sag_m:.2e} m; use more, or an odd number",
                tyre.rays
            );
            return Err(ParameterError::new("tyre.rays", message));
        }
        let ray_stiffness_n_m = static_load_n / (depths * discs.len() as f64);
        let half_width = discs.iter().fold(0.0, |widest: f64, d| widest.max(d.abs()));
        let reach_m = (radius_m * radius_m + half_width * half_width).sqrt();
        let (rays_per_disc, rays) = (rays.len(), Rays::of(&rays).collect());
        Ok(Self { radius_m, rays, rays_per_disc, discs, ray_stiffness_n_m, reach_m })
    }

    /// Stiffness of a wheel with all rays in the ground, N/m: the largest for which the time step must be stable.
    pub(crate) fn stiffness_max_n_m(&self) -> f64 {
        self.ray_stiffness_n_m * (self.rays_per_disc * self.discs.len()) as f64
    }

    /// Ray tips from the hub in the middle plane of a wheel, in the map frame.
    #[inline(always)]
    pub(crate) fn rim(&self, axes: &Axes, rim: &mut Vec<Tips>) {
        rim.clear();
        // Unlike `extend`, a loop is compiled into the step.
        for rays in &self.rays {
            rim.push(rays.tips(axes));
        }
    }

    /// All ray tips of a wheel with its hub at `hub`.
    pub(crate) fn tips<'a>(&'a self, hub: Vec3, left: Vec3, rim: &'a [Tips]) -> impl Iterator<Item = Vec3> + 'a {
        self.discs.iter().flat_map(move |&offset| {
            let centre = add_scaled(hub, left, offset);
            rim.iter().flat_map(|tips| tips.points.points()).map(move |ray| add(centre, ray))
        })
    }
}

/// Up to four neighbouring rays: sine and cosine of their angles times the radius, m. Vacant lanes repeat the last ray.
#[derive(Clone, Copy, Debug)]
struct Rays {
    forward: [f64; LANES],
    down: [f64; LANES],
    len: usize,
}

impl Rays {
    fn of(rays: &[[f64; 2]]) -> impl Iterator<Item = Self> + '_ {
        rays.chunks(LANES).map(|rays| {
            let part = |part: usize| std::array::from_fn(|lane| rays[lane.min(rays.len() - 1)][part]);
            Self { forward: part(0), down: part(1), len: rays.len() }
        })
    }

    /// Their tips relative to the hub.
    #[inline(always)]
    fn tips(&self, axes: &Axes) -> Tips {
        // For each ray `add_scaled(scale(axes.x, forward), axes.z, -down)`.
        let mut points = Quad { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES], len: self.len };
        for lane in 0..LANES {
            let (forward, down) = (self.forward[lane], self.down[lane]);
            points.x[lane] = axes.x[0] * forward + axes.z[0] * -down;
            points.y[lane] = axes.x[1] * forward + axes.z[1] * -down;
            let height = axes.x[2] * forward + axes.z[2] * -down;
            points.z[lane] = if lane < self.len { height } else { f64::INFINITY };
        }
        // NaN, which no comparison excludes, counts as the lowest.
        let lower = |low: f64, z: f64| if z < low || z.is_nan() { z } else { low };
        Tips { points, low_m: points.z.into_iter().fold(f64::INFINITY, lower) }
    }
}

/// Tips of up to four neighbouring rays in the middle plane of a wheel, relative to its hub, in the map frame. Vacant lanes lie infinitely
/// high, where they never touch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tips {
    points: Quad,
    /// Height of the lowest, m.
    low_m: f64,
}

/// The rays of one wheel on the ground, which give its normal force.
pub(crate) struct Press<'a> {
    pub tyre: &'a Tyre,
    pub ground: &'a Ground,
    pub hub: Vec3,
    /// Direction of the axle.
    pub left: Vec3,
    /// [`Tyre::rim`] of the axes of the wheel.
    pub rim: &'a [Tips],
}

impl WithSimd for Press<'_> {
    type Output = Pressing;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Pressing {
        let Self { tyre, ground, hub, left, rim } = self;
        let ceiling = ground.ceiling(hub[0], hub[1]);
        if hub[2] - tyre.reach_m - CULLING_MARGIN_M > ceiling {
            return Pressing::default();
        }
        let zero = simd.splat_f64s(0.0);
        let (mut total, mut undefined) = (zero, false);
        for &offset in &tyre.discs {
            let centre = add_scaled(hub, left, offset);
            for tips in rim {
                // Rounding is monotonic: if the lowest tip lies above the ceiling, so do all.
                if centre[2] + tips.low_m > ceiling {
                    continue;
                }
                let x = simd.add_f64s(simd.splat_f64s(centre[0]), cast(tips.points.x));
                let y = simd.add_f64s(simd.splat_f64s(centre[1]), cast(tips.points.y));
                let z = simd.add_f64s(simd.splat_f64s(centre[2]), cast(tips.points.z));
                let cells = ground.cells(simd, x, y);
                let overlap = simd.sub_f64s(cells.heights(), z);
                let overlaps: [f64; LANES] = cast(overlap);
                if all_clear(&overlaps) {
                    continue;
                }
                undefined |= any_unknown(&overlaps);
                let below = simd.less_than_or_equal_f64s(z, simd.splat_f64s(ceiling));
                let overlap = simd.select_f64s(below, overlap, zero);
                let [a, b, c, d] = pushes(simd, tyre.ray_stiffness_n_m, overlap, cells.gradients(), offset);
                total = simd.add_f64s(simd.add_f64s(simd.add_f64s(simd.add_f64s(total, a), b), c), d);
            }
        }
        let [x, y, z, offset_moment]: [f64; LANES] = cast(total);
        Pressing { force: [x, y, z], offset_moment, undefined }
    }
}

/// What four rays of a disc add to a [`Pressing`], ray by ray: `k (h - z)` projected on the plane's normal, `k (h - z) n_z n`, and disc
/// offset times vertical force. Zeros for a ray that does not touch.
#[inline(always)]
fn pushes<S: Simd>(simd: S, stiffness: f64, overlap: S::f64s, [hx, hy]: [S::f64s; 2], offset: f64) -> [S::f64s; LANES] {
    let (zero, one) = (simd.splat_f64s(0.0), simd.splat_f64s(1.0));
    let touching = simd.greater_than_f64s(overlap, zero);
    let squared = simd.add_f64s(simd.add_f64s(one, simd.mul_f64s(hx, hx)), simd.mul_f64s(hy, hy));
    let vertical = simd.div_f64s(simd.mul_f64s(simd.splat_f64s(stiffness), overlap), squared);
    let vertical = simd.select_f64s(touching, vertical, zero);
    let down = simd.mul_f64s(simd.splat_f64s(-1.0), vertical);
    // Gradients next to ground without data are NaN.
    let x = simd.select_f64s(touching, simd.mul_f64s(down, hx), zero);
    let y = simd.select_f64s(touching, simd.mul_f64s(down, hy), zero);
    let moment = simd.mul_f64s(vertical, simd.splat_f64s(offset));
    // Of four vectors, this is the transposition.
    simd.deinterleave_shfl_f64s([x, y, vertical, moment])
}

#[cfg(test)]
impl Tyre {
    /// Elastic energy of a wheel's rays, J.
    pub(crate) fn stored_j(&self, ground: &Ground, hub: Vec3, left: Vec3, rim: &[Tips]) -> f64 {
        let stored = |tip: Vec3| {
            let (hx, hy) = ground.gradient(tip[0], tip[1]);
            let overlap = (ground.height(tip[0], tip[1]) - tip[2]).max(0.0);
            0.5 * self.ray_stiffness_n_m * overlap * overlap / (1.0 + hx * hx + hy * hy)
        };
        self.tips(hub, left, rim).map(stored).sum()
    }
}

/// A group of points counts as clear of the ground only by more than this, so that rounding errors do not matter, m.
pub(crate) const CULLING_MARGIN_M: f64 = 1e-6;

/// Sum of the normal forces of a wheel's rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pressing {
    /// Elastic force, N.
    pub force: Vec3,
    /// Sum of disc offset times vertical force, N m.
    pub offset_moment: f64,
    /// A ray met ground without data.
    pub undefined: bool,
}

/// Sine of the smallest angle between contact normal and axle at which a wheel still rolls.
const IN_PLANE_MIN: f64 = 0.05;

/// The resultant contact of a wheel, or of wheels side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch<T = f64> {
    /// Elastic part of the normal force, N.
    pub elastic_n: T,
    /// Contact normal, out of the ground.
    pub normal: Vec3<T>,
    /// Rolling direction in the contact plane.
    pub forward: Vec3<T>,
    /// Left of the rolling direction in the contact plane.
    pub left: Vec3<T>,
    /// Point of action in the map frame, m.
    pub point: Vec3<T>,
    /// Sine of the angle between contact normal and axle.
    in_plane: T,
}

impl<T: Number> Touch<T> {
    /// The resultant of the [`Pressing`] of a wheel with its hub at `hub` and its axle along `axle`.
    #[inline(always)]
    pub(crate) fn of(force: Vec3<T>, offset_moment: T, hub: Vec3<T>, axle: Vec3<T>, radius_m: T) -> Self {
        let elastic_n = norm(force);
        let normal = scale(force, elastic_n.recip());
        let along = cross(axle, normal);
        let in_plane = norm(along);
        let forward = scale(along, in_plane.recip());
        let outward = cross(forward, axle);
        let middle = add_scaled(hub, axle, offset_moment / force[2]);
        let point = sub(middle, scale(outward, radius_m));
        Self { elastic_n, normal, forward, left: cross(normal, forward), point, in_plane }
    }
}

impl Touch {
    /// True for a wheel off the ground, or on its side; the contact is meaningless then.
    #[inline(always)]
    pub(crate) fn is_missing(&self) -> bool {
        self.elastic_n <= 0.0 || self.in_plane < IN_PLANE_MIN
    }
}

impl<S: Simd> Touch<Four<S>> {
    /// The contacts one by one.
    #[inline(always)]
    pub(crate) fn apart(self) -> [Touch; LANES] {
        let (elastic_n, in_plane) = (self.elastic_n.apart(), self.in_plane.apart());
        let (normal, forward) = (apart(self.normal), apart(self.forward));
        let (left, point) = (apart(self.left), apart(self.point));
        std::array::from_fn(|lane| Touch {
            elastic_n: elastic_n[lane],
            normal: normal[lane],
            forward: forward[lane],
            left: left[lane],
            point: point[lane],
            in_plane: in_plane[lane],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::TraverseParameters;
    use super::super::lanes::beside;
    use super::super::vector::normalised;
    use super::*;
    use sastrugi_numeric::simd::Vectors;
    use sastrugi_numeric::{Geometry, Grid, Streams};

    /// The Husky and a plane of gradient `(p, q)`, 6 m square.
    fn plane(p: f64, q: f64) -> (super::super::Vehicle, Ground) {
        let (vehicle, _) = TraverseParameters::default().prepare().unwrap();
        let g = Geometry::square(120, 120, 0.05);
        let heights = (0..g.len()).map(|k| p * g.x(k % g.cols) + q * g.y(k / g.cols)).collect();
        let ground = Ground::new(&Grid::new(g, heights), &vehicle).unwrap();
        (vehicle, ground)
    }

    const LEVEL: Axes = Axes { x: [1.0, 0.0, 0.0], y: [0.0, 1.0, 0.0], z: [0.0, 0.0, 1.0] };

    fn pressed(tyre: &Tyre, ground: &Ground, hub: Vec3) -> Pressing {
        let mut rim = Vec::new();
        tyre.rim(&LEVEL, &mut rim);
        ground.vectors().run(Press { tyre, ground, hub, left: LEVEL.y, rim: &rim })
    }

    impl Pressing {
        /// The contact of a wheel of the Husky on level axes.
        fn touch(&self, hub: Vec3) -> Touch {
            Touch::of(self.force, self.offset_moment, hub, LEVEL.y, 0.1651)
        }

        /// Adds a ray: `k (h - z)` projected on the plane's normal, `k (h - z) n_z n`.
        fn add(&mut self, stiff_overlap: f64, (hx, hy): (f64, f64), offset: f64) {
            let vertical = stiff_overlap / (1.0 + hx * hx + hy * hy);
            self.force[0] -= vertical * hx;
            self.force[1] -= vertical * hy;
            self.force[2] += vertical;
            self.offset_moment += vertical * offset;
        }
    }

    /// The force on a wheel, one ray after the other.
    fn pressed_one_by_one(tyre: &Tyre, ground: &Ground, hub: Vec3, axes: &Axes) -> Pressing {
        let mut total = Pressing::default();
        let ceiling = ground.ceiling(hub[0], hub[1]);
        let of_group = |rays: &Rays| -> Vec<Vec3> {
            let ray = |lane: usize| add_scaled(scale(axes.x, rays.forward[lane]), axes.z, -rays.down[lane]);
            (0..rays.len).map(ray).collect()
        };
        let rays: Vec<Vec3> = tyre.rays.iter().flat_map(of_group).collect();
        for &offset in &tyre.discs {
            for &ray in &rays {
                let tip = add(add_scaled(hub, axes.y, offset), ray);
                let overlap = ground.height(tip[0], tip[1]) - tip[2];
                if tip[2] > ceiling {
                    assert!(overlap <= 0.0, "{tip:?}: {overlap}");
                } else if overlap > 0.0 {
                    total.add(tyre.ray_stiffness_n_m * overlap, ground.gradient(tip[0], tip[1]), offset);
                } else if overlap.is_nan() {
                    total.undefined = true;
                }
            }
        }
        total
    }

    /// Rays in groups of four give the bits of one ray after the other, for any number of them: wheels tilted at random on rough ground with a
    /// hole, from clear of it to 8 cm deep.
    #[test]
    fn prop_groups_of_rays_change_no_bit() {
        let g = Geometry::square(120, 120, 0.05);
        let height = |x: f64, y: f64| 0.05 * libm::sin(9.0 * x + 4.0 * y) + 0.03 * libm::cos(23.0 * y - 7.0 * x);
        let mut dem = Grid::new(g, (0..g.len()).map(|k| height(g.x(k % g.cols), g.y(k / g.cols))).collect());
        (0..64).for_each(|k| dem.values[(56 + k / 8) * 120 + 36 + k % 8] = f64::NAN);
        let mut stream = Streams::for_seed(6, "test").stream("wheels");
        for (discs, rays) in [(3, 13), (1, 3), (2, 8), (5, 25)] {
            let tyre = serde_json::json!({"tyre": {"discs": discs, "rays": rays, "stiffness_n_m": 5e3}});
            let changes = tyre.as_object().unwrap().clone();
            let parameters = TraverseParameters { vehicle_changes: changes, ..TraverseParameters::default() };
            let (vehicle, _) = parameters.prepare().unwrap();
            let ground = Ground::new(&dem, &vehicle).unwrap();
            let grounds = [Vectors::best(), Vectors::Baseline].map(|vectors| ground.clone().with_vectors(vectors));
            let (mut touching, mut undefined) = (0, 0);
            for _ in 0..500 {
                let axes = Axes::of(normalised([0.0, 1.0, 2.0, 3.0].map(|w| w + stream.uniform_in(-1.0, 1.0))));
                let [x, y] = [0, 1].map(|_| stream.uniform_in(1.5, 4.5));
                let hub = [x, y, height(x, y) + 0.1651 - stream.uniform_in(-0.04, 0.08)];
                let mut rim = Vec::new();
                vehicle.tyre.rim(&axes, &mut rim);
                let reference = pressed_one_by_one(&vehicle.tyre, &ground, hub, &axes);
                let bits = |p: &Pressing| (p.force.map(f64::to_bits), p.offset_moment.to_bits(), p.undefined);
                for ground in &grounds {
                    let press = Press { tyre: &vehicle.tyre, ground, hub, left: axes.y, rim: &rim };
                    let found = ground.vectors().run(press);
                    assert_eq!(bits(&found), bits(&reference), "{discs} {rays} {hub:?} {axes:?}");
                }
                touching += usize::from(reference.force[2] > 0.0);
                undefined += usize::from(reference.undefined);
            }
            assert!(touching > 50 && undefined > 0, "{discs} {rays}: {touching} {undefined}");
        }
    }

    /// Force and moment, hub and axle of four wheels.
    struct FourTouches<'a>(&'a [(Pressing, Vec3, Vec3); LANES]);

    impl WithSimd for FourTouches<'_> {
        type Output = [Touch; LANES];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> [Touch; LANES] {
            let wheels = *self.0;
            let force = beside(simd, wheels.map(|(pressing, _, _)| pressing.force));
            let offset_moment = Four::new(simd, wheels.map(|(pressing, _, _)| pressing.offset_moment));
            let (hub, axle) = (beside(simd, wheels.map(|wheel| wheel.1)), beside(simd, wheels.map(|wheel| wheel.2)));
            Touch::of(force, offset_moment, hub, axle, Four::repeated(simd, 0.1651)).apart()
        }
    }

    /// The contacts of four wheels have the bits of one at a time, with the vectors of this CPU and with those of every CPU: on the ground, off
    /// it, and on their side.
    #[test]
    fn prop_four_contacts_have_the_bits_of_one() {
        let mut stream = Streams::for_seed(7, "test").stream("contacts");
        let bits = |touch: &Touch| -> Vec<u64> {
            let parts = [[touch.elastic_n, touch.in_plane, 0.0], touch.normal, touch.forward, touch.left, touch.point];
            parts.concat().into_iter().map(f64::to_bits).collect()
        };
        let (mut touching, mut missing) = (0, 0);
        for round in 0..500 {
            let wheels: [(Pressing, Vec3, Vec3); LANES] = std::array::from_fn(|lane| {
                let mut random = |low: f64, high: f64| stream.uniform_in(low, high);
                let share = if (round + lane) % 5 == 0 { 0.0 } else { 1.0 };
                let force = [-90.0, -90.0, 10.0].map(|low| share * random(low, 400.0));
                let axes = Axes::of(normalised([0.0, 1.0, 2.0, 3.0].map(|w| w + random(-1.0, 1.0))));
                let axle = if (round + lane) % 7 == 3 { scale(force, 1.0 / norm(force)) } else { axes.y };
                let pressing = Pressing { force, offset_moment: random(-9.0, 9.0), undefined: false };
                (pressing, [0, 1, 2].map(|_| random(-50.0, 50.0)), axle)
            });
            for vectors in [Vectors::best(), Vectors::Baseline] {
                let found = vectors.run(FourTouches(&wheels));
                for (found, &(pressing, hub, axle)) in found.iter().zip(&wheels) {
                    let one = Touch::of(pressing.force, pressing.offset_moment, hub, axle, 0.1651);
                    assert_eq!(found.is_missing(), one.is_missing(), "{one:?}");
                    if one.is_missing() {
                        missing += 1;
                    } else {
                        assert_eq!(bits(found), bits(&one), "{one:?}");
                        touching += 1;
                    }
                }
            }
        }
        assert!(touching > 2000 && missing > 1000, "{touching} {missing}");
    }

    /// At the static sag of 3.468 mm on level ground a wheel carries a quarter of the vehicle, straight up, on the point below its hub.
    /// Rays 13.3 deg to either side end 4.5 mm higher, so the middle ray of each disc carries all of it, and half at half the sag;
    /// above the ground there is no force.
    #[test]
    fn val_a_wheel_carries_its_load_at_its_sag() {
        let (vehicle, ground) = plane(0.0, 0.0);
        let load_n = 56.582 * 9.80665 / 4.0;
        let sag_m = load_n / 40_000.0;
        let at = |sag_m: f64| pressed(&vehicle.tyre, &ground, [3.01, 3.02, 0.1651 - sag_m]);
        let touch = at(sag_m).touch([3.01, 3.02, 0.1651 - sag_m]);
        assert!((touch.elastic_n / load_n - 1.0).abs() < 1e-9, "{touch:?}");
        for (found, expected) in [(touch.normal, LEVEL.z), (touch.forward, LEVEL.x), (touch.left, LEVEL.y)] {
            assert!(norm(add_scaled(found, expected, -1.0)) < 1e-12, "{touch:?}");
        }
        assert!(norm(add_scaled(touch.point, [3.01, 3.02, -sag_m], -1.0)) < 1e-12, "{touch:?}");
        let half_n = norm(at(0.5 * sag_m).force);
        assert!((half_n / load_n - 0.5).abs() < 1e-9, "{half_n}");
        assert!(at(-1e-4).touch([3.01, 3.02, 0.1652]).is_missing() && !touch.is_missing());
    }

    /// On a plane of 3 in 4 ahead, or to the left, the force is along the normal of the plane and the wheel rolls along it.
    #[test]
    fn val_a_wheel_is_pushed_along_the_normal() {
        let (vehicle, ground) = plane(0.75, 0.0);
        let hub = [3.0, 3.0, 2.25 + 0.1651];
        let touch = pressed(&vehicle.tyre, &ground, hub).touch(hub);
        assert!(norm(add_scaled(touch.normal, [-0.6, 0.0, 0.8], -1.0)) < 1e-4, "{touch:?}");
        assert!(norm(add_scaled(touch.forward, [0.8, 0.0, 0.6], -1.0)) < 1e-4, "{touch:?}");
        // The rim point where the normal leaves the wheel.
        assert!(norm(add_scaled(touch.point, add_scaled(hub, touch.normal, -0.1651), -1.0)) < 1e-4, "{touch:?}");
        let (vehicle, ground) = plane(0.0, 0.75);
        let hub = [3.0, 3.0, 2.25 + 0.15];
        let touch = pressed(&vehicle.tyre, &ground, hub).touch(hub);
        assert!(norm(add_scaled(touch.normal, [0.0, -0.6, 0.8], -1.0)) < 1e-4, "{touch:?}");
        assert!(norm(add_scaled(touch.left, [0.0, 0.8, 0.6], -1.0)) < 1e-4, "{touch:?}");
        // The uphill disc, on the left, carries more.
        assert!(touch.point[1] > 3.0 + 1e-3, "{touch:?}");
    }
}
