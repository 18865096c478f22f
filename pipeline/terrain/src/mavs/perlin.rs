//! Perlin noise in two dimensions, as in FastNoise (the predecessor of FastNoiseLite, used by MAVS).
//!
//! # What
//! Every point of the integer lattice has one of twelve gradients, selected by a permutation of 0 to 255. Within a cell, the
//! linear functions of the four corners are blended by `q(t) = 6 t^5 - 15 t^4 + 10 t^3` along x and along y:
//! $$ P(x, y) = \sum_{i,j} \left[ g_x a(x - i) b(y - j) + g_y b(x - i) a(y - j) \right] , \quad
//!    b(t) = 1 - q(|t|) , \quad a(t) = t\,b(t) , \quad |t| < 1 . $$
//! The gradients are those of three dimensions without their z: four diagonals, and each axis direction twice. Values lie
//! in -1 to 1 and are 0 at lattice points. The lattice has a period of 256 points.
//!
//! # Spectrum
//! Averaged over all permutations, gradients have mean 0 and are uncorrelated. As 256 is not a multiple of 12, diagonals are slightly
//! more frequent: 88 and 84 of 256 gradients have an x component of magnitude 1, so its variance is 43/64. A profile along x has
//! the one-sided PSD
//! $$ S(u) = \tfrac{43}{32} \left( |A(u)|^2 \textstyle\int b^2 + |B(u)|^2 \int a^2 \right) $$
//! (u in cycles per lattice cell; A, B the transforms of a, b), and the variance is `43/32 int a^2 int b^2` = 0.2500^2.
//! Van Deusen's constant and the expected roughness follow from it.
//!
//! The statistics of a single permutation scatter about these values: every line of the lattice has the same 256 gradients in the same
//! order, from a different start, so the correlation of neighbours along x is that of 256 pairs, however large the surface.
//!
//! # Source
//! K. Perlin, Improving noise, ACM Trans. Graph. 21 (2002) 681, for q; J. Peck, FastNoise 0.4.1, for gradients and hashing.
//! The permutation is drawn from a named stream instead of a Mersenne Twister.
//!
//! # Cost
//! About 2 ns per cell: for a row of cells, each lattice column contributes just two numbers.

use super::frame::Frame;
use rayon::prelude::*;
use sastrugi_numeric::{Grid, Stream, Streams};
use std::f64::consts::TAU;

/// Lattice points after which the noise repeats.
const PERIOD: usize = 256;
/// Gradients along x and y, indexed by the permutation's value modulo 12.
const GRADIENTS: [[f64; 2]; 12] = [
    [1.0, 1.0],
    [-1.0, 1.0],
    [1.0, -1.0],
    [-1.0, -1.0],
    [1.0, 0.0],
    [-1.0, 0.0],
    [1.0, 0.0],
    [-1.0, 0.0],
    [0.0, 1.0],
    [0.0, -1.0],
    [0.0, 1.0],
    [0.0, -1.0],
];
/// Mean square of the noise.
pub const MEAN_SQUARE: f64 = TWICE_GRADIENT * SQUARED_A * SQUARED_B;
/// Twice the variance of a gradient along an axis.
const TWICE_GRADIENT: f64 = 43.0 / 32.0;
/// Integral of `b(t)^2` over -1 to 1.
const SQUARED_B: f64 = 181.0 / 231.0;
/// Integral of `a(t)^2` over -1 to 1.
const SQUARED_A: f64 = 535.0 / 9009.0;

/// One realisation of the noise.
#[derive(Clone)]
pub struct Perlin {
    permutation: [u8; PERIOD],
}

impl Perlin {
    /// A random noise: each entry of the permutation, from the first on, is swapped with itself or a random later one.
    pub fn draw(stream: &mut Stream) -> Self {
        let mut permutation = std::array::from_fn(|k| k as u8);
        for k in 0..PERIOD {
            permutation.swap(k, k + stream.below((PERIOD - k) as u64) as usize);
        }
        Self { permutation }
    }

    fn gradient(&self, column: i64, hash_of_line: u8) -> [f64; 2] {
        let place = column.wrapping_add(i64::from(hash_of_line)).rem_euclid(PERIOD as i64) as usize;
        GRADIENTS[usize::from(self.permutation[place] % 12)]
    }

    /// Contribution of a lattice column to points on `line`: `start + slope d` at the distance d east of the column.
    fn node(&self, column: i64, line: &Line) -> Node {
        let [[south_x, south_y], [north_x, north_y]] = line.hashes.map(|hash| self.gradient(column, hash));
        let (south, north) = (south_y * line.ahead, north_y * (line.ahead - 1.0));
        Node { start: south + line.blend * (north - south), slope: south_x + line.blend * (north_x - south_x) }
    }

    /// The lattice lines on either side of `y`.
    fn line(&self, y: f64) -> Line {
        let Place { lattice, ahead, blend } = Place::of(y);
        let hash = |line: i64| self.permutation[line.rem_euclid(PERIOD as i64) as usize];
        Line { hashes: [hash(lattice), hash(lattice.wrapping_add(1))], ahead, blend }
    }
}

/// Position of a coordinate in the lattice.
struct Place {
    /// Lattice point at or before it.
    lattice: i64,
    /// Distance from that point.
    ahead: f64,
    /// Weight of the next lattice point.
    blend: f64,
}

impl Place {
    fn of(coordinate: f64) -> Self {
        let towards_zero = coordinate as i64;
        let lattice = towards_zero - i64::from((towards_zero as f64) > coordinate);
        let ahead = coordinate - lattice as f64;
        Self { lattice, ahead, blend: quintic(ahead) }
    }
}

fn quintic(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

struct Line {
    /// Permutation at the lines south and north.
    hashes: [u8; 2],
    ahead: f64,
    blend: f64,
}

#[derive(Clone, Copy)]
struct Node {
    start: f64,
    slope: f64,
}

fn blended(west: Node, east: Node, ahead: f64, blend: f64) -> f64 {
    let (from_west, from_east) = (west.start + west.slope * ahead, east.start + east.slope * (ahead - 1.0));
    from_west + blend * (from_east - from_west)
}

/// One layer of noise over the world: `amplitude P((x, y) / wavelength + offset)`.
#[derive(Clone)]
pub struct Layer {
    noise: Perlin,
    offset: [f64; 2],
    wavelength_m: f64,
    amplitude: f64,
}

impl Layer {
    /// The layer `name` of a surface, with permutation and offset from its own stream.
    pub fn draw(streams: &Streams, name: &str, wavelength_m: f64, amplitude: f64) -> Self {
        let mut stream = streams.child(name).stream("lattice");
        let noise = Perlin::draw(&mut stream);
        let offset = [(); 2].map(|()| stream.uniform_in(0.0, PERIOD as f64));
        Self { noise, offset, wavelength_m, amplitude }
    }

    /// A layer of a noise shared with other layers; its lattice starts at the origin of the world.
    pub fn of(noise: &Perlin, wavelength_m: f64, amplitude: f64) -> Self {
        Self { noise: noise.clone(), offset: [0.0; 2], wavelength_m, amplitude }
    }

    /// A world coordinate in lattice cells.
    fn cells(&self, metres: f64, axis: usize) -> f64 {
        metres / self.wavelength_m + self.offset[axis]
    }

    fn columns(&self, frame: &Frame) -> Columns {
        let places: Vec<Place> = (0..frame.cols()).map(|col| Place::of(self.cells(frame.x_m(col), 0))).collect();
        let first = places.first().map_or(0, |p| p.lattice);
        let last = places.last().map_or(0, |p| p.lattice);
        let posts = places.iter().map(|p| Post { node: (p.lattice - first) as usize, ahead: p.ahead, blend: p.blend });
        Columns { first, nodes: (last - first) as usize + 2, posts: posts.collect() }
    }
}

/// The columns of a grid in a layer's lattice.
struct Columns {
    /// First lattice column.
    first: i64,
    /// Lattice columns in reach.
    nodes: usize,
    posts: Vec<Post>,
}

struct Post {
    node: usize,
    ahead: f64,
    blend: f64,
}

/// Sum of the layers, in order.
pub fn sum(layers: &[Layer], frame: &Frame) -> Grid {
    let geometry = frame.geometry();
    let columns: Vec<Columns> = layers.iter().map(|layer| layer.columns(frame)).collect();
    let mut values = vec![0.0; geometry.len()];
    values.par_chunks_mut(geometry.cols).enumerate().for_each_init(Vec::new, |nodes: &mut Vec<Node>, (row, out)| {
        for (layer, columns) in layers.iter().zip(&columns) {
            let line = layer.noise.line(layer.cells(frame.y_m(row), 1));
            nodes.clear();
            nodes.extend((0..columns.nodes).map(|k| layer.noise.node(columns.first + k as i64, &line)));
            for (v, post) in out.iter_mut().zip(&columns.posts) {
                *v += layer.amplitude * blended(nodes[post.node], nodes[post.node + 1], post.ahead, post.blend);
            }
        }
    });
    Grid { geometry, values }
}

/// Intervals of the quadratures, even.
const INTERVALS: usize = 128;
/// Frequency beyond which the noise has negligible power (1e-7 of the total), cycles per lattice cell.
const FREQUENCY_MAX: f64 = 8.0;

/// Simpson's rule.
fn integral(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let step = (to - from) / INTERVALS as f64;
    let weight = |k: usize| match k {
        0 | INTERVALS => 1.0,
        _ if k % 2 == 1 => 4.0,
        _ => 2.0,
    };
    (0..=INTERVALS).map(|k| weight(k) * f(from + k as f64 * step)).sum::<f64>() * step / 3.0
}

/// One-sided PSD of profiles of the noise at `u` cycles per lattice cell, lattice cells.
fn density(u: f64) -> f64 {
    let b = |t: f64| 1.0 - quintic(t);
    let odd = 2.0 * integral(0.0, 1.0, |t| t * b(t) * libm::sin(TAU * u * t));
    let even = 2.0 * integral(0.0, 1.0, |t| b(t) * libm::cos(TAU * u * t));
    TWICE_GRADIENT * (odd * odd * SQUARED_B + even * even * SQUARED_A)
}

/// Variance of profiles of the noise between two frequencies in cycles per lattice cell.
pub fn variance_between([low, high]: [f64; 2]) -> f64 {
    let (low, high) = (low.min(FREQUENCY_MAX), high.min(FREQUENCY_MAX));
    // In parts of at most one cycle per cell, which the quadrature resolves.
    let parts = (high - low).ceil().max(1.0);
    let edge = |k: f64| low + (high - low) * k / parts;
    (0..parts as usize).map(|k| integral(edge(k as f64), edge(k as f64 + 1.0), density)).sum()
}

/// `int u^power S(u) du`.
pub fn moment(power: f64) -> f64 {
    (0..FREQUENCY_MAX as usize).map(|k| integral(k as f64, k as f64 + 1.0, |u| libm::pow(u, power) * density(u))).sum()
}

#[cfg(test)]
mod tests;
