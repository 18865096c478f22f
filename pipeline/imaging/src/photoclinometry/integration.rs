//! Heights from slopes by weighted least squares (Poisson's equation).
//!
//! Minimises, over the heights at the cell centres,
//!
//! $$ \sum_{cells} \frac14 \sum_{quadrants} (g - t)^T W (g - t) + \sum_j \left( \frac{a_j \cdot z - h_j}{\sigma_j} \right)^2 $$
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `g` | height differences of the quadrant, over one edge along x and one along y, per length | 1 |
//! | `t` | the cell's slopes, interpolated to these edges | 1 |
//! | `W` | information of the cell's slopes: inverse of the sum of their covariance and the variance of slopes within the cell | 1 |
//! | `a_j`, `h_j`, `sigma_j` | soft constraints: weighted means of heights (stereo points, given points, cells of a coarse DEM) | m |
//!
//! Slopes belong to cells, differences to the edges between their centres; each of the four edges around a cell enters separately. The heights
//! of a checkerboard differ over every edge, so they contribute to the sum; with central differences they would not. With independent slopes
//! the matrix has the five-point stencil; their covariance adds the corners. At borders the missing edge of a quadrant is marginalised.
//!
//! Interpolating slopes to an edge adds `-1/24` of their second differences on both sides along it, or `-1/12` of the only one at borders and
//! holes: the mean slope over the edge is then accurate to fourth (third) order, for slopes of heights that are area means.
//!
//! # Solution
//! Conjugate gradients. The preconditioner is the equation with constant weights, solved by cosine transforms and scaled by the square root of
//! the ratio of the diagonals. Sums run in a fixed order. Memory: about 200 bytes per cell. Without constraints the mean height is 0.
//!
//! Source: B. K. P. Horn, M. J. Brooks, The variational approach to shape from shading, 1986, doi:10.1016/0734-189X(86)90114-3, for the least
//! squares; Y. Quéau, J.-D. Durou, J.-F. Aujol, Normal integration: a survey, 2018, doi:10.1007/s10851-017-0773-x.

use super::cosine::CosinePoisson;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Surface, sums};

/// Number of values processed by one task.
const BLOCK: usize = 4096;
/// Weight of cells without slopes, and smallest weight of any cell, as a share of the median.
pub const WEIGHT_FLOOR: f64 = 1e-3;

/// A soft constraint on heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// Cells and their weights, which usually sum to 1.
    pub cells: Vec<(usize, f64)>,
    /// Required weighted mean of their heights, m.
    pub height_m: f64,
    /// Standard deviation of this mean, m.
    pub sigma_m: f64,
}

/// A known height at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightPoint {
    /// Easting, m.
    pub x_m: f64,
    /// Northing, m.
    pub y_m: f64,
    /// Height, m.
    pub height_m: f64,
    /// Standard deviation of the height, m.
    pub sigma_m: f64,
}

impl Constraint {
    /// Constraint of a point, bilinear between the cell centres around it; `None` beyond the outer centres.
    ///
    /// ```
    /// use sastrugi_imaging::photoclinometry::{Constraint, HeightPoint};
    /// use sastrugi_numeric::Geometry;
    ///
    /// let g = Geometry::square(4, 4, 1.0);
    /// let at = |x_m: f64, y_m: f64| Constraint::point(&g, &HeightPoint { x_m, y_m, height_m: 7.0, sigma_m: 0.1 });
    /// // In the middle of four cells each has a quarter of the weight.
    /// assert!(at(2.0, 2.0).unwrap().cells.iter().all(|(_, weight)| *weight == 0.25));
    /// assert_eq!(at(0.2, 2.0), None);
    /// ```
    pub fn point(g: &Geometry, point: &HeightPoint) -> Option<Self> {
        let u = (point.x_m - g.origin[0]) / g.cell[0] - 0.5;
        let v = g.rows as f64 - (point.y_m - g.origin[1]) / g.cell[1] - 0.5;
        let inside = u >= 0.0 && v >= 0.0 && u <= (g.cols - 1) as f64 && v <= (g.rows - 1) as f64;
        if !inside || !point.height_m.is_finite() {
            return None;
        }
        let (col, row) = ((u as usize).min(g.cols - 2), (v as usize).min(g.rows - 2));
        let (east, south) = (u - col as f64, v - row as f64);
        let first = row * g.cols + col;
        let cells = vec![
            (first, (1.0 - east) * (1.0 - south)),
            (first + 1, east * (1.0 - south)),
            (first + g.cols, (1.0 - east) * south),
            (first + g.cols + 1, east * south),
        ];
        Some(Self { cells, height_m: point.height_m, sigma_m: point.sigma_m })
    }

    /// Constraints of a coarse DEM: for each of its cells, the mean of the map's cells in it. A DEM finer than the map gives one constraint per
    /// cell of the map.
    pub fn coarse(g: &Geometry, dem: &Grid, sigma_m: f64) -> Vec<Self> {
        if dem.geometry.cell[0] < g.cell[0] || dem.geometry.cell[1] < g.cell[1] {
            let at = |k: usize| dem.height(g.x(k % g.cols), g.y(k / g.cols)).map(|height| (k, height));
            let one = |(k, height_m)| Self { cells: vec![(k, 1.0)], height_m, sigma_m };
            return (0..g.len()).filter_map(at).map(one).collect();
        }
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); dem.geometry.len()];
        for k in 0..g.len() {
            if let Some((row, col)) = dem.geometry.cell_at(g.x(k % g.cols), g.y(k / g.cols)) {
                members[row * dem.geometry.cols + col].push(k);
            }
        }
        let full = dem.geometry.cell[0] * dem.geometry.cell[1] / (g.cell[0] * g.cell[1]);
        let known = members.into_iter().zip(&dem.values).filter(|(m, z)| z.is_finite() && 2.0 * m.len() as f64 > full);
        known
            .map(|(m, &height_m)| {
                let weight = 1.0 / m.len() as f64;
                Self { cells: m.into_iter().map(|k| (k, weight)).collect(), height_m, sigma_m }
            })
            .collect()
    }

    fn of(&self, z: &[f64]) -> f64 {
        self.cells.iter().map(|&(k, weight)| weight * z[k]).sum()
    }

    /// Adds `value` times the transposed row, divided by the variance.
    fn spread(&self, value: f64, out: &mut [f64]) {
        let share = value / (self.sigma_m * self.sigma_m);
        self.cells.iter().for_each(|&(k, weight)| out[k] += weight * share);
    }
}

/// Heights and statistics of the solver.
#[derive(Clone, Debug, PartialEq)]
pub struct Integrated {
    /// Height of every cell, m.
    pub heights_m: Vec<f64>,
    /// Number of conjugate-gradient iterations.
    pub iterations: usize,
    /// Residual relative to that of a level plane, in the norm of the preconditioner.
    pub residual: f64,
}

/// Stopping criterion of the conjugate gradients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Residual relative to that of a level plane.
    pub residual: f64,
    /// Maximum number of iterations.
    pub iterations: usize,
}

impl Stop {
    /// For results.
    pub const FINE: Self = Self { residual: 1e-10, iterations: 2000 };
    /// For heights that the next round replaces, and for perturbed solutions.
    pub const COARSE: Self = Self { residual: 1e-5, iterations: 500 };
}

/// The equations of one map: weights and constraints, without the slopes.
pub struct System {
    geometry: Geometry,
    information: Vec<[f64; 3]>,
    /// Whether a cell's slopes may enter a correction along an edge.
    good: Vec<bool>,
    constraints: Vec<Constraint>,
    constant: CosinePoisson,
    scale: Vec<f64>,
}

impl System {
    /// `information` has `[W_pp, W_pq, W_qq]` of every cell, `None` where a cell has no slopes.
    pub fn new(geometry: Geometry, information: &[Option<[f64; 3]>], constraints: Vec<Constraint>) -> Self {
        let good: Vec<bool> = information.iter().map(Option::is_some).collect();
        let traces: Vec<f64> = information.iter().flatten().map(|w| 0.5 * (w[0] + w[2])).collect();
        let median = sums::median(&traces);
        let floor = WEIGHT_FLOOR * if median > 0.0 { median } else { 1.0 };
        let information: Vec<[f64; 3]> = information.iter().map(|w| floored(w.unwrap_or_default(), floor)).collect();
        let mean = |k: usize| sums::mean(&information.iter().map(|w| w[k]).collect::<Vec<_>>());
        let [cell_x, cell_y] = geometry.cell;
        let weights = [mean(0) / (cell_x * cell_x), mean(2) / (cell_y * cell_y)];
        let constraint = |c: &Constraint| {
            let total: f64 = c.cells.iter().map(|(_, w)| w).sum();
            total * total / (c.sigma_m * c.sigma_m)
        };
        let pull = constraints.iter().map(constraint).sum::<f64>() / geometry.len() as f64;
        // Without constraints the preconditioner must keep the constant mode, with an eigenvalue below every other mode.
        let least = |n: usize, weight: f64| {
            let sin = libm::sin(0.5 * std::f64::consts::PI / n as f64);
            4.0 * weight * sin * sin
        };
        let gap = 0.5 * least(geometry.cols, weights[0]).min(least(geometry.rows, weights[1]));
        let shift = if constraints.is_empty() { gap } else { pull };
        let constant = CosinePoisson::new(geometry.rows, geometry.cols, weights, shift);
        let scale = scales(&geometry, &information, weights);
        Self { geometry, information, good, constraints, constant, scale }
    }

    /// Right-hand side for given slopes and constraint heights.
    pub fn right_side(&self, slopes: &[[f64; 2]], heights_m: &[f64]) -> Vec<f64> {
        let g = &self.geometry;
        let mut out = self.divergence(|r, c| {
            let [p, q] = slopes[r * g.cols + c];
            let along_x = |west: Option<usize>| {
                p + west.map_or(0.0, |w| self.correction(slopes, 0, r * g.cols + w, w, g.cols, 1))
            };
            // Rows run south, y north: the correction is symmetric.
            let along_y = |north: Option<usize>| {
                q + north.map_or(0.0, |n| self.correction(slopes, 1, n * g.cols + c, n, g.rows, g.cols))
            };
            [along_x(c.checked_sub(1)), along_x(Some(c)), along_y(Some(r)), along_y(r.checked_sub(1))]
        });
        self.constraints.iter().zip(heights_m).for_each(|(c, h)| c.spread(*h, &mut out));
        out
    }

    /// The same with the uncorrected slope of the cell at its edges (second order).
    #[cfg(test)]
    pub(super) fn uncorrected(&self, slopes: &[[f64; 2]], heights_m: &[f64]) -> Vec<f64> {
        let mut out = self.divergence(|r, c| {
            let [p, q] = slopes[r * self.geometry.cols + c];
            [p, p, q, q]
        });
        self.constraints.iter().zip(heights_m).for_each(|(c, h)| c.spread(*h, &mut out));
        out
    }

    /// Information of every cell with its floor.
    #[cfg(test)]
    pub(super) fn weights(&self) -> &[[f64; 3]] {
        &self.information
    }

    /// Heights of the constraints, m.
    pub fn constraint_heights(&self) -> Vec<f64> {
        self.constraints.iter().map(|c| c.height_m).collect()
    }

    /// Standard deviations of the constraints, m.
    pub fn constraint_sigmas(&self) -> Vec<f64> {
        self.constraints.iter().map(|c| c.sigma_m).collect()
    }

    /// True if there are constraints on the heights.
    pub fn tied(&self) -> bool {
        !self.constraints.is_empty()
    }

    /// Residual of each constraint relative to given heights, as a point `[x, y, height, weight]` at the weighted centre of its cells.
    pub fn residuals(&self, heights_m: &[f64]) -> Vec<[f64; 4]> {
        let g = &self.geometry;
        let one = |c: &Constraint| {
            let total: f64 = c.cells.iter().map(|(_, weight)| weight).sum();
            let mean = |f: &dyn Fn(usize) -> f64| c.cells.iter().map(|&(k, weight)| weight * f(k)).sum::<f64>() / total;
            let (x, y) = (mean(&|k| g.x(k % g.cols)), mean(&|k| g.y(k / g.cols)));
            [x, y, c.height_m - c.of(heights_m), 1.0 / (c.sigma_m * c.sigma_m)]
        };
        self.constraints.iter().map(one).collect()
    }

    /// Solves for a right-hand side, starting from given heights or from 0.
    pub fn solve(&self, right: &[f64], start: Option<&[f64]>, stop: Stop) -> Integrated {
        let mut z = start.map_or_else(|| vec![0.0; right.len()], <[f64]>::to_vec);
        let mut residual = match start {
            Some(_) => right.iter().zip(self.apply(&z)).map(|(b, a)| b - a).collect(),
            None => right.to_vec(),
        };
        let whole = ordered_dot(right, &self.precondition(right));
        let mut preconditioned = self.precondition(&residual);
        let mut product = ordered_dot(&residual, &preconditioned);
        let mut direction = preconditioned.clone();
        let mut iterations = 0;
        while iterations < stop.iterations && product > stop.residual * stop.residual * whole {
            let applied = self.apply(&direction);
            let curvature = ordered_dot(&direction, &applied);
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = product / curvature;
            add_scaled(&mut z, step, &direction);
            add_scaled(&mut residual, -step, &applied);
            preconditioned = self.precondition(&residual);
            let next = ordered_dot(&residual, &preconditioned);
            let turn = next / product;
            direction.par_iter_mut().zip(&preconditioned).with_min_len(BLOCK).for_each(|(d, p)| *d = p + turn * *d);
            product = next;
            iterations += 1;
        }
        if self.constraints.is_empty() {
            let mean = sums::mean(&z);
            z.iter_mut().for_each(|v| *v -= mean);
        }
        let residual = if whole > 0.0 { (product / whole).sqrt() } else { 0.0 };
        Integrated { heights_m: z, iterations, residual }
    }

    /// The product of the matrix and heights.
    pub fn apply(&self, z: &[f64]) -> Vec<f64> {
        let g = &self.geometry;
        let [per_x, per_y] = g.cell.map(|cell| 1.0 / cell);
        let mut out = self.divergence(|r, c| {
            let k = r * g.cols + c;
            [
                if c > 0 { (z[k] - z[k - 1]) * per_x } else { 0.0 },
                if c + 1 < g.cols { (z[k + 1] - z[k]) * per_x } else { 0.0 },
                if r + 1 < g.rows { (z[k] - z[k + g.cols]) * per_y } else { 0.0 },
                if r > 0 { (z[k - g.cols] - z[k]) * per_y } else { 0.0 },
            ]
        });
        self.constraints.iter().for_each(|c| c.spread(c.of(z), &mut out));
        out
    }

    /// Applies the preconditioner: solves the constant-weight equation, scaled on both sides.
    fn precondition(&self, residual: &[f64]) -> Vec<f64> {
        let scaled: Vec<f64> = residual.iter().zip(&self.scale).map(|(r, s)| r / s).collect();
        let mut solved = self.constant.solve(&scaled);
        solved.iter_mut().zip(&self.scale).for_each(|(v, s)| *v /= s);
        solved
    }

    /// Half the gradient of the sum over cells, with `edges` giving the differences west, east, south and north of a cell.
    fn divergence(&self, edges: impl Fn(usize, usize) -> [f64; 4] + Sync) -> Vec<f64> {
        let g = &self.geometry;
        let mut flux = vec![[0.0; 4]; g.len()];
        flux.par_chunks_mut(g.cols).enumerate().for_each(|(r, line)| {
            for (c, out) in line.iter_mut().enumerate() {
                let there = [c > 0, c + 1 < g.cols, r + 1 < g.rows, r > 0];
                *out = cell_flux(self.information[r * g.cols + c], edges(r, c), there);
            }
        });
        let [per_x, per_y] = g.cell.map(|cell| 1.0 / cell);
        let mut out = vec![0.0; g.len()];
        out.par_chunks_mut(g.cols).enumerate().for_each(|(r, line)| {
            for (c, out) in line.iter_mut().enumerate() {
                let k = r * g.cols + c;
                let [west, east, south, north] = flux[k];
                let mut along_x = west - east;
                let mut along_y = south - north;
                if c > 0 {
                    along_x += flux[k - 1][1];
                }
                if c + 1 < g.cols {
                    along_x -= flux[k + 1][0];
                }
                if r > 0 {
                    along_y -= flux[k - g.cols][2];
                }
                if r + 1 < g.rows {
                    along_y += flux[k + g.cols][3];
                }
                *out = along_x * per_x + along_y * per_y;
            }
        });
        out
    }

    /// Correction added to the mean of two slopes to obtain the mean slope over the edge between them. The cell at index `first` is number `at`
    /// of `len` along the axis; its neighbours are `pitch` apart.
    fn correction(&self, slopes: &[[f64; 2]], axis: usize, first: usize, at: usize, len: usize, pitch: usize) -> f64 {
        if at + 1 >= len || !self.good[first] || !self.good[first + pitch] {
            return 0.0;
        }
        let slope = |k: usize| slopes[k][axis];
        let (b, c) = (slope(first), slope(first + pitch));
        let before = (at >= 1 && self.good[first - pitch]).then(|| slope(first - pitch));
        let after = (at + 2 < len && self.good[first + 2 * pitch]).then(|| slope(first + 2 * pitch));
        match (before, after) {
            (Some(a), Some(d)) => -(a - b - c + d) / 24.0,
            (Some(a), None) => -(a - 2.0 * b + c) / 12.0,
            (None, Some(d)) => -(b - 2.0 * c + d) / 12.0,
            (None, None) => 0.0,
        }
    }
}

/// Forces on the four edges of a cell: `1/4 W (dx, dy)` of every quadrant; the missing edge of a quadrant at a border is marginalised.
#[inline]
fn cell_flux([a, b, c]: [f64; 3], [west, east, south, north]: [f64; 4], there: [bool; 4]) -> [f64; 4] {
    if there == [true; 4] {
        let (across, up) = (0.25 * b * (south + north), 0.25 * b * (west + east));
        return [0.5 * a * west + across, 0.5 * a * east + across, 0.5 * c * south + up, 0.5 * c * north + up];
    }
    let mut flux = [0.0; 4];
    for (i, dx) in [(0, west), (1, east)] {
        for (j, dy) in [(2, south), (3, north)] {
            match (there[i], there[j]) {
                (true, true) => {
                    flux[i] += 0.25 * (a * dx + b * dy);
                    flux[j] += 0.25 * (b * dx + c * dy);
                }
                (true, false) => flux[i] += 0.25 * (a - b * b / c) * dx,
                (false, true) => flux[j] += 0.25 * (c - b * b / a) * dy,
                (false, false) => {}
            }
        }
    }
    flux
}

/// Information with a floor under its diagonal.
fn floored([a, b, c]: [f64; 3], floor: f64) -> [f64; 3] {
    [a + floor, b, c + floor]
}

/// Square root of the diagonal relative to that of the equation with constant weights (ignoring the covariance of slopes).
fn scales(g: &Geometry, information: &[[f64; 3]], [weight_x, weight_y]: [f64; 2]) -> Vec<f64> {
    let per = g.cell.map(|cell| 1.0 / (cell * cell));
    let one = |k: usize| {
        let (r, c) = (k / g.cols, k % g.cols);
        let (mut own, mut constant) = (0.0, 0.0);
        let mut edge = |there: bool, other: usize, axis: usize| {
            if there {
                let part = 2 * axis;
                own += 0.5 * (information[k][part] + information[other][part]) * per[axis];
                constant += [weight_x, weight_y][axis];
            }
        };
        edge(c > 0, k.wrapping_sub(1), 0);
        edge(c + 1 < g.cols, k + 1, 0);
        edge(r > 0, k.wrapping_sub(g.cols), 1);
        edge(r + 1 < g.rows, k + g.cols, 1);
        (own / constant).sqrt()
    };
    (0..g.len()).into_par_iter().map(one).collect()
}

/// Scalar product in fixed blocks, independent of the number of threads.
pub(super) fn ordered_dot(a: &[f64], b: &[f64]) -> f64 {
    let parts: Vec<f64> =
        a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK)).map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y).sum()).collect();
    sums::sum(&parts)
}

fn add_scaled(a: &mut [f64], factor: f64, b: &[f64]) {
    a.par_iter_mut().zip(b).with_min_len(BLOCK).for_each(|(x, y)| *x += factor * y);
}
