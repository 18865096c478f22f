//! Contact of the chassis with the ground: points under the bottom plate and on the bumpers.
//!
//! A point at `P` with velocity `v` has the depth `d = (h - P_z) n_z` below the local bilinear plane. It feels
//!
//! ```text
//! N = k d (1 - a v.n)      (at least 0; Hunt and Crossley, 1975)
//! F = -k s - c v_t,        |F| <= mu N; where clipped, s = -F / k
//! ```
//!
//! along and across the normal `n`, with a bristle of deflection `s` in the tangent plane of its own (`ds/dt = v_t`), so
//! that a hung vehicle stays where it hangs. Points lie in rectangular tiles no wider than a wheel; a tile above the
//! ceiling of the ground is left out as a whole, and so is one that cannot have come down since it was last looked at.

use super::clearance::Clearance;
use super::contact::CULLING_MARGIN_M;
use super::ground::Ground;
use super::params::{BellyParameters, VehicleParameters};
use super::vector::{Axes, Vec3, add, add_scaled, cross, dot, norm, scale, sub};
use std::ops::Range;

/// Points on each bumper.
const BUMPER_POINTS: u32 = 3;

/// Contact points of a chassis.
#[derive(Clone, Debug)]
pub(crate) struct Belly {
    /// Points from the centre of mass, m, tile by tile.
    points: Vec<Vec3>,
    tiles: Vec<Tile>,
    /// Farthest point from the centre of its tile, m.
    pub reach_m: f64,
    /// Farthest point from the centre of mass, m.
    pub extent_m: f64,
}

/// A box of neighbouring points.
#[derive(Clone, Debug)]
struct Tile {
    points: Range<usize>,
    centre: Vec3,
    half_size: Vec3,
}

impl Belly {
    pub(crate) fn new(parameters: &VehicleParameters, centre_of_mass: Vec3, tile_reach_m: f64) -> Self {
        let mut belly = Self { points: Vec::new(), tiles: Vec::new(), reach_m: 0.0, extent_m: 0.0 };
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
        self.tiles.push(Tile { points: range, centre, half_size });
    }

    /// Points from the centre of mass.
    pub(crate) fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// No deflection at any point.
    pub(crate) fn at_rest(&self) -> Bristles {
        Bristles {
            deflections: vec![[0.0; 3]; self.points.len()],
            bent: vec![false; self.tiles.len()],
            clearance: Clearance::new(self.tiles.len(), self.extent_m),
        }
    }
}

/// Splits `count` points over a length into runs whose half length times the square root of 2 is within `reach_m`.
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

/// What the ground does to the chassis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Load {
    /// N.
    pub force: Vec3,
    /// About the centre of mass, N m.
    pub moment: Vec3,
    /// A point met ground without data.
    pub undefined: bool,
}

impl Belly {
    /// Forces of all points over a time step; moves the bristles on.
    pub(crate) fn press(
        &self,
        ground: &Ground,
        motion: &Motion,
        parameters: &BellyParameters,
        friction: f64,
        step_s: f64,
        bristles: &mut Bristles,
    ) -> Load {
        let mut load = Load::default();
        let Bristles { deflections, bent, clearance } = bristles;
        clearance.moved(ground, motion.position, &motion.axes);
        for (index, (tile, bent)) in self.tiles.iter().zip(bent).enumerate() {
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
            // Next to the edge of the ground a small move may leave it.
            let mut least_m = if above_m == f64::NEG_INFINITY { above_m } else { f64::INFINITY };
            for (&point, deflection) in self.points[tile.points.clone()].iter().zip(deflections) {
                let arm = motion.axes.to_map(point);
                let at = add(motion.position, arm);
                let overlap = ground.height(at[0], at[1]) - at[2];
                if overlap > 0.0 {
                    let spot = Spot::new(overlap, ground.gradient(at[0], at[1]));
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
            clearance.found(index, least_m);
        }
        load
    }
}

impl Tile {
    /// How far all points of the tile are above the highest ground near them at least, m; minus infinity where that is not
    /// known.
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

    /// Force on the point; moves its bristle on.
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
