//! Contact between chassis and ground: points under the bottom plate and on the bumpers.
//!
//! A point at `P` with velocity `v` has the depth `d = (h - P_z) n_z` below the local bilinear plane. The forces on it are
//!
//! ```text
//! N = k d (1 - a v.n)      (at least 0; Hunt and Crossley, 1975)
//! F = -k s - c v_t,        |F| <= mu N; where clipped, s = -F / k
//! ```
//!
//! along and perpendicular to the normal `n`. Each point has its own bristle with deflection `s` in the tangent plane
//! (`ds/dt = v_t`), so a hung-up vehicle does not slide. Points are grouped in rectangular tiles no wider than a wheel; a tile
//! above the ceiling of the ground is skipped, and so is one that cannot have reached the ground since it was last checked. Heights
//! below the points of a tile are computed four at a time; the forces of those that touch are summed in the order of the points.

use super::clearance::Clearance;
use super::contact::CULLING_MARGIN_M;
use super::ground::Ground;
use super::lanes::{LANES, Quad, all_clear};
use super::params::{BellyParameters, VehicleParameters};
use super::vector::{Axes, Vec3, add, add_scaled, cross, dot, norm, scale, sub};
use pulp::{Simd, WithSimd, cast};
use std::ops::Range;

/// Points on each bumper.
const BUMPER_POINTS: u32 = 3;

/// Contact points of a chassis.
#[derive(Clone, Debug)]
pub(crate) struct Belly {
    /// Points relative to the centre of mass, m, tile by tile.
    points: Vec<Vec3>,
    /// The same points, four by four within each tile.
    quads: Vec<Quad>,
    tiles: Vec<Tile>,
    /// Largest distance of a point from the centre of its tile, m.
    pub reach_m: f64,
    /// Largest distance of a point from the centre of mass, m.
    pub extent_m: f64,
}

/// A box of neighbouring points.
#[derive(Clone, Debug)]
struct Tile {
    points: Range<usize>,
    quads: Range<usize>,
    centre: Vec3,
    half_size: Vec3,
}

impl Belly {
    pub(crate) fn new(parameters: &VehicleParameters, centre_of_mass: Vec3, tile_reach_m: f64) -> Self {
        let (points, quads, tiles) = (Vec::new(), Vec::new(), Vec::new());
        let mut belly = Self { points, quads, tiles, reach_m: 0.0, extent_m: 0.0 };
        let (chassis, grid) = (&parameters.chassis, &parameters.belly);
        let at = |axis: usize, i: u32, n: u32| chassis.size_m[axis] * (f64::from(i) / f64::from(n - 1) - 0.5);
        let from_centre = |x: f64, y: f64, z: f64| sub([x, y, z], centre_of_mass);
        let chunks = [0, 1].map(|axis| chunks(grid.points[axis], chassis.size_m[axis], tile_reach_m));
        for rows in &chunks[0] {
            for cols in &chunks[1] {
                let row = |i: u32| cols.clone().map(move |j| (i, j));
                let point =
                    |(i, j)| from_centre(at(0, i, grid.points[0]), at(1, j, grid.points[1]), chassis.bottom_z_m);
                belly.push(rows.clone().flat_map(row).map(point));
            }
        }
        for x in [0.5, -0.5] {
            let point = |j| from_centre(x * chassis.size_m[0], at(1, j, BUMPER_POINTS), grid.bumper_z_m);
            belly.push((0..BUMPER_POINTS).map(point));
        }
        belly
    }

    /// Appends a tile.
    fn push(&mut self, points: impl Iterator<Item = Vec3>) {
        let first = self.points.len();
        self.points.extend(points);
        let range = first..self.points.len();
        let extreme = |axis: usize, pick: fn(f64, f64) -> f64| {
            self.points[range.clone()].iter().map(|p| p[axis]).reduce(pick).unwrap_or(0.0)
        };
        let low: Vec3 = std::array::from_fn(|axis| extreme(axis, f64::min));
        let high: Vec3 = std::array::from_fn(|axis| extreme(axis, f64::max));
        let (centre, half_size) = (scale(add(low, high), 0.5), scale(sub(high, low), 0.5));
        self.reach_m = self.reach_m.max(norm(half_size));
        self.extent_m = self.points[range.clone()].iter().map(|&p| norm(p)).fold(self.extent_m, f64::max);
        let first = self.quads.len();
        self.quads.extend(Quad::of(&self.points[range.clone()]));
        self.tiles.push(Tile { points: range, quads: first..self.quads.len(), centre, half_size });
    }

    /// Points relative to the centre of mass, m.
    pub(crate) fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// Bristles without deflection.
    pub(crate) fn at_rest(&self) -> Bristles {
        Bristles {
            deflections: vec![[0.0; 3]; self.points.len()],
            bent: vec![false; self.tiles.len()],
            clearance: Clearance::new(self.tiles.len(), self.extent_m),
        }
    }
}

/// Splits `count` points over a length into runs whose half length times the square root of 2 is at most `reach_m`.
fn chunks(count: u32, length_m: f64, reach_m: f64) -> Vec<Range<u32>> {
    let spacing_m = length_m / f64::from(count - 1);
    let per_chunk = ((std::f64::consts::SQRT_2 * reach_m / spacing_m) as u32).saturating_add(1).min(count);
    let number = count.div_ceil(per_chunk);
    (0..number).map(|i| i * count / number..(i + 1) * count / number).collect()
}

/// Tangential deflections of all points.
#[derive(Clone, Debug)]
pub(crate) struct Bristles {
    deflections: Vec<Vec3>,
    /// Whether any point of a tile may be deflected.
    bent: Vec<bool>,
    clearance: Clearance,
}

/// Motion of the body that carries the points.
pub(crate) struct Motion {
    /// Centre of mass in the map frame.
    pub position: Vec3,
    pub velocity: Vec3,
    /// Angular velocity in the map frame.
    pub rate: Vec3,
    pub axes: Axes,
}

/// Load of the ground on the chassis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Load {
    /// N.
    pub force: Vec3,
    /// About the centre of mass, N m.
    pub moment: Vec3,
    /// A point met ground without data.
    pub undefined: bool,
}

/// The points of the chassis on the ground, over a time step, which give their forces and update the bristles.
pub(crate) struct Press<'a> {
    pub belly: &'a Belly,
    pub ground: &'a Ground,
    pub motion: &'a Motion,
    pub parameters: &'a BellyParameters,
    pub friction: f64,
    pub step_s: f64,
    pub bristles: &'a mut Bristles,
}

impl WithSimd for Press<'_> {
    type Output = Load;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Load {
        let Self { belly, ground, motion, parameters, friction, step_s, bristles } = self;
        bristles.clearance.moved(ground, motion.position, &motion.axes);
        let mut load = Load::default();
        let Bristles { deflections, bent, clearance } = bristles;
        for (index, (tile, bent)) in belly.tiles.iter().zip(bent).enumerate() {
            if clearance.is_clear(index) {
                continue;
            }
            let deflections = &mut deflections[tile.points.clone()];
            let above_m = tile.above_ceiling_m(ground, motion);
            if above_m > CULLING_MARGIN_M {
                if *bent {
                    deflections.fill([0.0; 3]);
                    *bent = false;
                }
                clearance.found(index, above_m);
                continue;
            }
            // Near the edge of the ground, a small move may leave it.
            let mut least_m = if above_m == f64::NEG_INFINITY { above_m } else { f64::INFINITY };
            // Overlap of the point nearest to the ground, lane by lane, of those clear of it.
            let mut nearest = simd.splat_f64s(f64::NEG_INFINITY);
            for (quad, deflections) in belly.quads[tile.quads.clone()].iter().zip(deflections.chunks_mut(LANES)) {
                let [arm_x, arm_y, arm_z] = to_map(simd, &motion.axes, quad);
                let x = simd.add_f64s(simd.splat_f64s(motion.position[0]), arm_x);
                let y = simd.add_f64s(simd.splat_f64s(motion.position[1]), arm_y);
                let z = simd.add_f64s(simd.splat_f64s(motion.position[2]), arm_z);
                let cells = ground.cells(simd, x, y);
                let overlap = simd.sub_f64s(cells.heights(), z);
                let overlaps: [f64; LANES] = cast(overlap);
                if all_clear(&overlaps) {
                    nearest = simd.max_f64s(nearest, overlap);
                    if *bent {
                        deflections.fill([0.0; 3]);
                    }
                    continue;
                }
                let [arm_x, arm_y, arm_z]: [[f64; LANES]; 3] = [cast(arm_x), cast(arm_y), cast(arm_z)];
                let [hx, hy] = cells.gradients();
                let [hx, hy]: [[f64; LANES]; 2] = [cast(hx), cast(hy)];
                for (lane, deflection) in deflections.iter_mut().enumerate() {
                    let overlap = overlaps[lane];
                    if overlap > 0.0 {
                        let arm = [arm_x[lane], arm_y[lane], arm_z[lane]];
                        let spot = Spot::new(overlap, (hx[lane], hy[lane]));
                        let velocity = add(motion.velocity, cross(motion.rate, arm));
                        let force = spot.push(velocity, parameters, friction, step_s, deflection);
                        load.force = add(load.force, force);
                        load.moment = add(load.moment, cross(arm, force));
                        *bent = true;
                        least_m = f64::NEG_INFINITY;
                    } else {
                        *deflection = [0.0; 3];
                        load.undefined |= overlap.is_nan();
                        least_m = least_m.min(-overlap);
                    }
                }
            }
            let nearest: [f64; LANES] = cast(nearest);
            least_m = nearest.into_iter().fold(least_m, |least, overlap| least.min(-overlap));
            clearance.found(index, least_m);
        }
        load
    }
}

/// Points of the body in the map frame, as [`Axes::to_map`] turns each of them.
#[inline(always)]
fn to_map<S: Simd>(simd: S, axes: &Axes, points: &Quad) -> [S::f64s; 3] {
    [turned(simd, axes, points, 0), turned(simd, axes, points, 1), turned(simd, axes, points, 2)]
}

/// One coordinate of points of the body in the map frame.
#[inline(always)]
fn turned<S: Simd>(simd: S, axes: &Axes, points: &Quad, axis: usize) -> S::f64s {
    let forward = simd.mul_f64s(simd.splat_f64s(axes.x[axis]), cast(points.x));
    let left = simd.mul_f64s(simd.splat_f64s(axes.y[axis]), cast(points.y));
    let up = simd.mul_f64s(simd.splat_f64s(axes.z[axis]), cast(points.z));
    simd.add_f64s(simd.add_f64s(forward, left), up)
}

impl Tile {
    /// Lower bound on the height of the tile's points above the highest ground near them, m; minus infinity where the ground
    /// is unknown.
    #[inline(always)]
    fn above_ceiling_m(&self, ground: &Ground, motion: &Motion) -> f64 {
        let centre = add(motion.position, motion.axes.to_map(self.centre));
        let Axes { x, y, z } = motion.axes;
        let drop = x[2].abs() * self.half_size[0] + y[2].abs() * self.half_size[1] + z[2].abs() * self.half_size[2];
        centre[2] - drop - ground.ceiling(centre[0], centre[1])
    }
}

/// One touching point.
struct Spot {
    normal: Vec3,
    depth_m: f64,
}

impl Spot {
    #[inline(always)]
    fn new(overlap: f64, (hx, hy): (f64, f64)) -> Self {
        let up = 1.0 / (1.0 + hx * hx + hy * hy).sqrt();
        Self { normal: [-hx * up, -hy * up, up], depth_m: overlap * up }
    }

    /// Force on the point; updates its bristle.
    #[inline(always)]
    fn push(
        &self,
        velocity: Vec3,
        parameters: &BellyParameters,
        friction: f64,
        step_s: f64,
        deflection: &mut Vec3,
    ) -> Vec3 {
        let rising = dot(velocity, self.normal);
        let stiffness = parameters.stiffness_n_m;
        let normal_n = (stiffness * self.depth_m * (1.0 - parameters.dissipation_s_m * rising)).max(0.0);
        let sliding = add_scaled(velocity, self.normal, -rising);
        let carried = add_scaled(*deflection, self.normal, -dot(*deflection, self.normal));
        let bristle = add_scaled(carried, sliding, step_s);
        let free = add_scaled(scale(bristle, -stiffness), sliding, -parameters.tangential_damping_n_s_m);
        let (limit_n, size_n) = (friction * normal_n, norm(free));
        let tangential = if size_n <= limit_n {
            *deflection = bristle;
            free
        } else {
            let clipped = scale(free, limit_n / size_n);
            *deflection = scale(clipped, -1.0 / stiffness);
            clipped
        };
        add_scaled(tangential, self.normal, normal_n)
    }
}

#[cfg(test)]
mod tests {
    use super::super::TraverseParameters;
    use super::super::vector::normalised;
    use super::*;
    use sastrugi_numeric::simd::Vectors;
    use sastrugi_numeric::{Geometry, Grid};

    /// Contact of the equations below: k = 20 kN/m, a = 3 s/m, c = 40 N s/m.
    const CONTACT: BellyParameters = BellyParameters {
        points: [2, 2],
        bumper_z_m: 0.1,
        stiffness_n_m: 20_000.0,
        dissipation_s_m: 3.0,
        tangential_damping_n_s_m: 40.0,
    };

    fn near(a: Vec3, b: Vec3, tolerance: f64) -> bool {
        norm(sub(a, b)) < tolerance
    }

    /// A point 1 mm deep in level ground that sinks at 0.1 m/s: `N = k d (1 + 0.1 a)` = 26 N. At 0.01 m/s its bristle bends by
    /// 20 um in 2 ms and pushes back with 0.4 N, the damper with another 0.4 N.
    #[test]
    fn val_a_point_pushes_as_the_header_says() {
        let spot = Spot::new(1e-3, (0.0, 0.0));
        let mut bent = [0.0; 3];
        let force = spot.push([0.01, 0.0, -0.1], &CONTACT, 0.5, 0.002, &mut bent);
        assert!(near(force, [-0.8, 0.0, 26.0], 1e-12), "{force:?}");
        assert!(near(bent, [2e-5, 0.0, 0.0], 1e-18), "{bent:?}");
        // The next step adds to the bristle.
        let force = spot.push([0.0, 0.02, 0.0], &CONTACT, 0.5, 0.002, &mut bent);
        assert!(near(force, [-0.4, -1.6, 20.0], 1e-12), "{force:?}");
        assert!(near(bent, [2e-5, 4e-5, 0.0], 1e-18), "{bent:?}");
    }

    /// At 1 m/s the friction of `mu N` = 13 N is all there is, and the bristle keeps what it can carry: `13 N / k`.
    #[test]
    fn val_a_sliding_point_has_the_friction_of_its_load() {
        let mut bent = [0.0; 3];
        let force = Spot::new(1e-3, (0.0, 0.0)).push([0.6, -0.8, -0.1], &CONTACT, 0.5, 0.002, &mut bent);
        assert!(near(force, [-7.8, 10.4, 26.0], 1e-12), "{force:?}");
        assert!(near(bent, [3.9e-4, -5.2e-4, 0.0], 1e-15), "{bent:?}");
    }

    /// A point that leaves the ground faster than `1 / a` is not held by it.
    #[test]
    fn val_a_rising_point_is_not_held() {
        let mut bent = [1e-4, 0.0, 0.0];
        let force = Spot::new(1e-3, (0.0, 0.0)).push([0.1, 0.0, 0.5], &CONTACT, 0.5, 0.002, &mut bent);
        assert!(near(force, [0.0; 3], 1e-12) && near(bent, [0.0; 3], 1e-15), "{force:?} {bent:?}");
    }

    /// On a slope of 3 in 4 the depth is 0.8 of the vertical overlap, along the normal (-0.6, 0, 0.8); motion along the normal does
    /// not bend the bristle.
    #[test]
    fn val_depth_is_measured_along_the_normal() {
        let mut bent = [0.0; 3];
        let force = Spot::new(1e-3, (0.75, 0.0)).push([0.06, 0.0, -0.08], &CONTACT, 0.5, 0.002, &mut bent);
        // 20 kN/m x 0.8 mm x (1 + 3 s/m x 0.1 m/s).
        assert!(near(force, [-12.48, 0.0, 16.64], 1e-12), "{force:?}");
        assert!(near(bent, [0.0; 3], 1e-18), "{bent:?}");
    }

    /// Forces and bristles of all points, one after the other and without culling.
    fn pressed_one_by_one(belly: &Belly, ground: &Ground, motion: &Motion, deflections: &mut [Vec3]) -> Load {
        let mut load = Load::default();
        for (&point, deflection) in belly.points.iter().zip(deflections) {
            let arm = motion.axes.to_map(point);
            let at = add(motion.position, arm);
            let overlap = ground.height(at[0], at[1]) - at[2];
            if overlap > 0.0 {
                let spot = Spot::new(overlap, ground.gradient(at[0], at[1]));
                let velocity = add(motion.velocity, cross(motion.rate, arm));
                let force = spot.push(velocity, &CONTACT, 0.5, 0.002, deflection);
                load.force = add(load.force, force);
                load.moment = add(load.moment, cross(arm, force));
            } else {
                *deflection = [0.0; 3];
                load.undefined |= overlap.is_nan();
            }
        }
        load
    }

    /// Points in groups of four, with culling, give the bits of one point after the other: forces, moments and bristles of a chassis that
    /// heaves and rolls over rough ground, with and without a hole in it.
    #[test]
    fn prop_groups_of_points_change_no_bit() {
        let (vehicle, _) = TraverseParameters::default().prepare().unwrap();
        let g = Geometry::square(120, 120, 0.05);
        let height = |x: f64, y: f64| 0.04 * libm::sin(9.0 * x + 4.0 * y) + 0.02 * libm::cos(23.0 * y - 7.0 * x);
        let whole = Grid::new(g, (0..g.len()).map(|k| height(g.x(k % g.cols), g.y(k / g.cols))).collect());
        let mut holed = whole.clone();
        (0..64).for_each(|k| holed.values[(56 + k / 8) * 120 + 56 + k % 8] = f64::NAN);
        for (dem, has_hole) in [(whole, false), (holed, true)] {
            let ground = Ground::new(&dem, &vehicle).unwrap();
            let grounds = [Vectors::best(), Vectors::Baseline].map(|vectors| ground.clone().with_vectors(vectors));
            let mut bristles = [vehicle.belly.at_rest(), vehicle.belly.at_rest()];
            let mut reference = vec![[0.0; 3]; vehicle.belly.points.len()];
            let (mut touching, mut clear, mut undefined) = (0, 0, 0);
            for step in 0..1000 {
                let t = 0.002 * f64::from(step);
                let (sin, cos) = libm::sincos(7.0 * t);
                let axes = Axes::of(normalised([0.1 * sin, 0.08 * cos, 0.3 * t, 1.0]));
                let motion = Motion {
                    position: [2.0 + t, 2.5 + 0.4 * t, 0.16 + 0.14 * libm::sin(5.0 * t)],
                    velocity: [1.0, 0.4, 0.7 * libm::cos(5.0 * t)],
                    rate: [1.4 * cos, -1.1 * sin, 0.6],
                    axes,
                };
                let load = pressed_one_by_one(&vehicle.belly, &ground, &motion, &mut reference);
                let bits = |load: &Load| [load.force, load.moment].map(|v| v.map(f64::to_bits));
                for (ground, bristles) in grounds.iter().zip(&mut bristles) {
                    let found = ground.vectors().run(Press {
                        belly: &vehicle.belly,
                        ground,
                        motion: &motion,
                        parameters: &CONTACT,
                        friction: 0.5,
                        step_s: 0.002,
                        bristles,
                    });
                    assert_eq!((bits(&found), found.undefined), (bits(&load), load.undefined), "step {step}");
                    assert_eq!(bristles.deflections, reference, "step {step}");
                }
                touching += usize::from(load.force[2] > 0.0);
                clear += usize::from(load.force[2] == 0.0);
                undefined += usize::from(load.undefined);
            }
            assert!(touching > 100 && clear > 100, "{touching} {clear}");
            assert_eq!(undefined > 0, has_hole, "{undefined}");
        }
    }

    /// Every point belongs to exactly one run, in order, and no run is longer than stated.
    #[test]
    fn prop_runs_of_points_cover_all_of_them() {
        for (count, length_m, reach_m) in [(21, 0.9874, 0.175), (13, 0.5709, 0.175), (2, 4.0, 0.1), (101, 1.0, 9.0)] {
            let runs = chunks(count, length_m, reach_m);
            let points: Vec<u32> = runs.iter().cloned().flatten().collect();
            assert_eq!(points, (0..count).collect::<Vec<_>>());
            let spacing_m = length_m / f64::from(count - 1);
            let longest = runs.iter().map(|run| f64::from(run.end - run.start - 1) * spacing_m).fold(0.0, f64::max);
            assert!(longest <= std::f64::consts::SQRT_2 * reach_m + 1e-12, "{count}: {longest}");
        }
        assert_eq!(chunks(101, 1.0, 9.0).len(), 1);
    }
}
