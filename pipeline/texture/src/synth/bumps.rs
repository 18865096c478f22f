//! Sums of Gaussian bumps at random places on a torus, shared by [`super::gaussians`] and [`super::quasi_wavelets`].
//!
//! `z(r) = sum over i of A h_i exp(-|r - e_i|^2 / a^2)`, `h_i = +-1`, the centres `e_i` uniform on the torus (Vecherin et al.
//! 2022, Eq. 1). Across the long axis distances are stretched, so that a bump is an ellipse with half axes `a` along and
//! `a_across` across it. With n bumps per area the field has mean 0 and the covariance
//!
//! `C(h) = n A^2 (pi / 2) a a_across * sum over the torus' periods p of exp(-|h + p|^2 / (2 a^2))`
//!
//! (Campbell 1909). A follows from the target variance, and C is exact on average. The field is nearly normal: excess kurtosis
//! `1 / (pi n a a_across)`.
//!
//! Cost: every bump adds to the cells within 4.5 half axes. Rows are summed in bands, each over all bumps in order,
//! so that the result does not depend on the number of threads. Memory: 32 bytes per bump of one class.

use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Streams};
use std::f64::consts::PI;

/// Radius of a bump in half axes, where it has fallen to 2e-9.
const CUT: f64 = 4.5;
/// Periods further away than this many half axes do not contribute to the covariance.
const COVARIANCE_CUT: f64 = 8.0;
/// Rows that are summed together.
const BAND: usize = 32;

/// Bumps of one size.
#[derive(Clone, Copy, Debug)]
pub struct Class {
    /// Half axis a along the long axis, m.
    pub along_m: f64,
    /// Half axis across it, m.
    pub across_m: f64,
    /// Number of bumps on the torus.
    pub count: u64,
    /// Variance of their sum, m2.
    pub variance_m2: f64,
}

/// A torus, with the direction of the long axis of all bumps on it.
#[derive(Clone, Copy)]
pub struct Torus {
    geometry: Geometry,
    sin: f64,
    cos: f64,
}

/// A bump: column and row of its centre in cells, and its height.
struct Bump {
    col: f64,
    row: f64,
    height_m: f64,
}

impl Torus {
    /// The torus of a tile.
    pub fn new(geometry: Geometry, azimuth_deg: f64) -> Self {
        let (sin, cos) = match azimuth_deg {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            azimuth => libm::sincos(azimuth.to_radians()),
        };
        Self { geometry, sin, cos }
    }

    /// Squared length of `[x, y]` in half axes of a class.
    fn square(&self, class: &Class, [x, y]: [f64; 2]) -> f64 {
        let (along, across) = (x * self.sin + y * self.cos, x * self.cos - y * self.sin);
        let (s, t) = (along / class.along_m, across / class.across_m);
        s * s + t * t
    }

    /// Half width and half height of the bounding box of a bump's ellipse, m.
    fn extent_m(&self, class: &Class) -> [f64; 2] {
        let long =
            |a: f64, b: f64| (a * a * class.along_m * class.along_m + b * b * class.across_m * class.across_m).sqrt();
        [long(self.sin, self.cos), long(self.cos, self.sin)]
    }

    /// Whether a bump is the product of a function of x and one of y.
    fn is_separable(&self, class: &Class) -> bool {
        class.along_m == class.across_m || self.sin * self.cos == 0.0
    }

    /// Correlation of the sum of a class's bumps at a lag east and north.
    pub fn correlation(&self, class: &Class, lag_m: [f64; 2]) -> f64 {
        self.periodic(class, lag_m) / self.periodic(class, [0.0; 2])
    }

    /// `sum over the periods p of exp(-|h + p|^2 / 2)`, lengths in half axes.
    fn periodic(&self, class: &Class, [x, y]: [f64; 2]) -> f64 {
        let size = self.geometry.size();
        let short = |lag: f64, period: f64| lag - (lag / period).round() * period;
        let (x, y) = (short(x, size[0]), short(y, size[1]));
        let extent = self.extent_m(class);
        let [i, j] = [0, 1].map(|k| (COVARIANCE_CUT * extent[k] / size[k]).ceil() as i64);
        let term = |i: i64, j: i64| {
            let at = [x + i as f64 * size[0], y + j as f64 * size[1]];
            libm::exp(-0.5 * self.square(class, at))
        };
        (-i..=i).flat_map(|i| (-j..=j).map(move |j| (i, j))).map(|(i, j)| term(i, j)).sum()
    }

    /// Height A of the bumps of a class.
    fn height_m(&self, class: &Class) -> f64 {
        let [width_m, height_m] = self.geometry.size();
        let density = class.count as f64 / (width_m * height_m);
        let overlap = density * 0.5 * PI * class.along_m * class.across_m * self.periodic(class, [0.0; 2]);
        (class.variance_m2 / overlap).sqrt()
    }

    /// Operations to sum the bumps of a class.
    pub fn operations(&self, class: &Class) -> f64 {
        /// Operations of a multiplication and an addition, and of an exponential.
        const PRODUCT: f64 = 2.0;
        const EXPONENTIAL: f64 = 30.0;
        let [x, y] = self.extent_m(class);
        let [dx, dy] = self.geometry.cell;
        let cells = 4.0 * CUT * CUT * (x / dx).max(0.25) * (y / dy).max(0.25);
        class.count as f64 * cells * if self.is_separable(class) { PRODUCT } else { EXPONENTIAL }
    }

    /// Memory for the bumps of a class, bytes.
    pub fn memory_bytes(class: &Class) -> u64 {
        32 * class.count
    }

    /// Adds the bumps of a class to a row-major field.
    pub fn add(&self, class: &Class, field: &mut [f64], streams: &Streams, purpose: &str) {
        let (rows, cols) = (self.geometry.rows, self.geometry.cols);
        let amplitude = self.height_m(class);
        let mut stream = streams.stream(purpose);
        let mut draw = || Bump {
            col: stream.uniform() * cols as f64 - 0.5,
            row: stream.uniform() * rows as f64 - 0.5,
            height_m: if stream.bits() >> 63 == 0 { amplitude } else { -amplitude },
        };
        let bumps: Vec<Bump> = (0..class.count).map(|_| draw()).collect();
        field.par_chunks_mut(BAND * cols).enumerate().for_each(|(band, lines)| {
            for bump in &bumps {
                self.add_to_band(class, bump, band * BAND, lines);
            }
        });
    }

    /// Adds one bump to the rows starting at `first`.
    fn add_to_band(&self, class: &Class, bump: &Bump, first: usize, lines: &mut [f64]) {
        let Geometry { rows, cols, cell: [dx, dy], .. } = self.geometry;
        let extent = self.extent_m(class);
        let range = |centre: f64, half: f64| ((centre - half).ceil() as i64, (centre + half).floor() as i64);
        let (top, bottom) = range(bump.row, CUT * extent[1] / dy);
        let (west, east) = range(bump.col, CUT * extent[0] / dx);
        let count = lines.len() / cols;
        let inside = |row: i64| (row.rem_euclid(rows as i64) as usize).checked_sub(first).filter(|k| *k < count);
        let mut touched = (top..=bottom).filter_map(|row| inside(row).map(|k| (row, k))).peekable();
        if touched.peek().is_none() {
            return;
        }
        let x = |col: i64| (col as f64 - bump.col) * dx;
        let separable = self.is_separable(class);
        let profile: Vec<f64> = match separable {
            true => (west..=east).map(|col| libm::exp(-self.square(class, [x(col), 0.0]))).collect(),
            false => Vec::new(),
        };
        for (row, k) in touched {
            let line = &mut lines[k * cols..(k + 1) * cols];
            let y = (bump.row - row as f64) * dy;
            let mut col = west.rem_euclid(cols as i64) as usize;
            let along = bump.height_m * libm::exp(-self.square(class, [0.0, y]));
            for (step, place) in (west..=east).enumerate() {
                line[col] += match profile.get(step) {
                    Some(across) => along * across,
                    None => bump.height_m * libm::exp(-self.square(class, [x(place), y])),
                };
                col = if col + 1 == cols { 0 } else { col + 1 };
            }
        }
    }
}
