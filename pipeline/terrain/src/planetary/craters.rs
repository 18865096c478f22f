//! Craters: where they strike, how they change the ground, and in which order.
//!
//! A crater annihilates the ground that it strikes. With `rho` the distance in radii, the old heights are removed inside `rho = 1` and
//! kept beyond `rho = 2`, with a smooth transition between. They are replaced by a reference plane with its own texture
//! (by default half as rough as the surface; 0 at the retained points). Then the crater's shape is added.
//!
//! The plane is the least-squares plane through the retained points: lattice points of the coarsest spacing of half a radius or
//! less with `1 <= rho <= 2`, at their heights just before the impact.
//!
//! # Where we depart
//! By the time of the impact, those points have been changed by every earlier crater, whose planes depend on still earlier ones.
//! Followed down to the smallest craters, this chain would require the complete world. The plane of a crater therefore takes only wider
//! craters into account. A crater of half the diameter fills at most a twelfth of the ring, so ignoring it shifts the plane by about 3 % of
//! the depth of the larger crater; the effect of smaller ones scales with their area. The worst case is an older crater of nearly the same
//! diameter: ignoring one of 0.99 diameters shifts the plane by up to 7 % of the depth at the centre and 15 % at the rim.
//!
//! Craters of processes that are adjacent in the list strike in a common order of time.

pub mod index;
pub mod population;
pub mod shape;

use super::levels::{Window, floor_log2};
use super::texture::{Amplitudes, interpolate};
use population::{Crater, Population};
use shape::{EJECTA_RADII, fall};

/// Beyond this distance the old ground is kept, radii.
const ANNIHILATION_RADII: f64 = 2.0;
/// Within this distance the ground is completely new, radii.
const NEW_GROUND_RADII: f64 = 1.0;

/// Craters that strike in a common order of time.
pub struct Bombardment {
    /// Sets of craters.
    pub populations: Vec<Box<dyn Population>>,
    /// Texture of their floors: that of the surface before them.
    pub floor: Option<Floor>,
}

/// Texture of the surface, from which the texture of new floors is scaled.
#[derive(Clone)]
pub struct Floor {
    /// `s_1`, m.
    pub roughness_m: f64,
    /// `d^H`.
    pub amplitudes: Amplitudes,
    /// Binary logarithm of the coarsest spacing with a texture.
    pub anchor: u32,
}

/// The reference plane of a crater: height at its centre (m) and slopes (m per lattice unit).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    level_m: f64,
    slopes: [f64; 2],
}

/// Binary logarithm of the spacing of a crater's retained points.
pub fn retained_zoom(crater: &Crater) -> u32 {
    floor_log2(0.5 * crater.radius)
}

/// The window that contains a crater's retained points; it also includes points that are too near or too far.
pub fn retained_window(crater: &Crater) -> Window {
    Window::about(retained_zoom(crater), crater.centre, ANNIHILATION_RADII * crater.radius)
}

impl Plane {
    /// The least-squares plane through a crater's retained points, from the heights of [`retained_window`].
    pub fn fit(crater: &Crater, window: &Window, heights: &[f64]) -> Self {
        let mut points = Vec::with_capacity(heights.len());
        for row in 0..window.rows {
            for col in 0..window.cols {
                let [dx, dy] = [window.x(col) - crater.centre[0], window.y(row) - crater.centre[1]];
                let rho = (dx * dx + dy * dy).sqrt() / crater.radius;
                if (NEW_GROUND_RADII..=ANNIHILATION_RADII).contains(&rho) {
                    points.push([dx, dy, heights[row * window.cols + col]]);
                }
            }
        }
        Self::through(&points)
    }

    fn through(points: &[[f64; 3]]) -> Self {
        let count = points.len().max(1) as f64;
        let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / count;
        let [x, y, z] = [mean(0), mean(1), mean(2)];
        let product = |a: usize, b: usize| {
            let centre = [x, y, z];
            points.iter().map(|p| (p[a] - centre[a]) * (p[b] - centre[b])).sum::<f64>()
        };
        let (xx, xy, yy, xz, yz) = (product(0, 0), product(0, 1), product(1, 1), product(0, 2), product(1, 2));
        let determinant = xx * yy - xy * xy;
        let slopes = if determinant > 0.0 {
            [(yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant]
        } else {
            [0.0; 2]
        };
        Self { level_m: z - slopes[0] * x - slopes[1] * y, slopes }
    }

    fn height_m(&self, dx: f64, dy: f64) -> f64 {
        self.level_m + (self.slopes[0] * dx + self.slopes[1] * dy)
    }
}

impl Bombardment {
    /// Applies one crater to the heights of a window; `plane` is called only if old ground is removed.
    pub fn strike(&self, window: &Window, heights: &mut [f64], crater: &Crater, plane: impl FnOnce() -> Plane) {
        let Some(part) = window.part(crater.centre, EJECTA_RADII * crater.radius) else { return };
        if let Some(inner) = window.part(crater.centre, ANNIHILATION_RADII * crater.radius) {
            let new_ground = window.of_part(&inner);
            let plane = plane();
            let texture = self.floor_texture(&new_ground, crater);
            for (k, texture) in texture.into_iter().enumerate() {
                let (row, col) = (inner.rows.start + k / new_ground.cols, inner.cols.start + k % new_ground.cols);
                let [dx, dy] = [window.x(col) - crater.centre[0], window.y(row) - crater.centre[1]];
                let rho = (dx * dx + dy * dy).sqrt() / crater.radius;
                let new = fall(rho, NEW_GROUND_RADII, ANNIHILATION_RADII);
                if new > 0.0 {
                    let height = &mut heights[row * window.cols + col];
                    *height = (1.0 - new) * *height + new * (plane.height_m(dx, dy) + texture);
                }
            }
        }
        let profile = crater.profile();
        for row in part.rows {
            let dy = window.y(row) - crater.centre[1];
            for col in part.cols.clone() {
                let dx = window.x(col) - crater.centre[0];
                let rho = (dx * dx + dy * dy).sqrt() / crater.radius;
                if rho < EJECTA_RADII {
                    heights[row * window.cols + col] += profile.height_m(rho);
                }
            }
        }
    }

    fn floor_texture(&self, window: &Window, crater: &Crater) -> Vec<f64> {
        match &self.floor {
            Some(floor) => {
                let scale_m = floor.roughness_m * crater.style.floor_roughness;
                let anchor = retained_zoom(crater).min(floor.anchor);
                interpolate(window, anchor, crater.texture, scale_m, &floor.amplitudes)
            }
            None => vec![0.0; window.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand; points in a row leave the slope across them open, and no points leave everything open: level planes.
    #[test]
    fn val_planes_are_least_squares() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let plane = Plane::through(&corners);
        assert_eq!(plane, Plane { level_m: 0.25, slopes: [0.5, -0.5] });
        assert_eq!(plane.height_m(1.0, 0.0), 0.75);
        assert_eq!(Plane::through(&[[0.0, 0.0, 1.0], [1.0, 0.0, 3.0]]), Plane { level_m: 2.0, slopes: [0.0; 2] });
        assert_eq!(Plane::through(&[]), Plane { level_m: 0.0, slopes: [0.0; 2] });
    }
}
