//! Decimates a grid of heights to a triangle mesh: greedy insertion into a Delaunay triangulation.
//!
//! Source: Garland and Heckbert (1995), "Fast Polygonal Approximation of Terrains and Height Fields", CMU-CS-95-181, algorithm III
//! (greedy insertion, data-independent triangulation, a priority queue, and re-evaluation of changed triangles only).
//! Initially, two triangles cover the rectangle of the outer cell centres. The cell centre (post) `(x, y, z)` with the largest
//! vertical distance from its triangle,
//!
//! ```text
//! e = |z - (z_a + g_x (x - x_a) + g_y (y - y_a))|
//! ```
//!
//! with corner `a` of the triangle and the slope `g` of the plane through its corners, becomes a vertex. This is repeated until no post
//! exceeds the error limit or the allowed number of triangles is reached. Of posts with equal errors in one triangle, the southernmost
//! counts, and of those the westernmost; of equal errors in several triangles, the post that comes first row by row from the north-west.
//!
//! Departures from the paper:
//!
//! * *Holes.* The approximated surface consists of the triangles between neighbouring posts with data; see [`triangulate`]. All posts around
//!   cells without data are vertices from the start. The sides of a square of neighbouring vertices are then Delaunay edges, so that no
//!   triangle lies partly in a hole, and the rim of every hole is preserved.
//! * *Exactness.* The triangulation is Delaunay in columns and rows, whatever the shape of the cells, and uses integer arithmetic.
//! * *Final errors.* The errors are recomputed over all posts when the triangulation is finished.
//!
//! Cost: about `n log n` for `n` posts of typical terrain, at worst `n` times the number of vertices; up to 400 bytes per post
//! if all posts become vertices.
//! Do not use it where small-scale roughness matters, for example under wheels: decimation removes it.

mod delaunay;

#[cfg(test)]
mod tests;

use crate::grid::Grid;
use delaunay::{Delaunay, Point, doubled_area};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Maximum number of cells of a grid to triangulate.
pub const MAX_CELLS: usize = 1 << 28;

/// Limits of a triangulation, which stops as soon as one of them is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest vertical distance of a post from the triangles, in the unit of the heights; at least 0.
    pub error_max: f64,
    /// Maximum number of triangles. The rims of holes, and the two initial triangles if there are no holes, may exceed it.
    pub triangles_max: Option<usize>,
}

/// A grid approximated by triangles between some of its posts.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangulation {
    /// Cells whose centres are vertices, ascending.
    pub cells: Vec<usize>,
    /// Corners of the triangles as indices into `cells`, counter-clockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
    /// Largest vertical distance of a post from the triangles.
    pub error_max: f64,
    /// Root mean square of the vertical distances of all posts from the triangles.
    pub error_rms: f64,
}

/// Approximates a grid by triangles. The approximated surface has two triangles between every four neighbouring cell centres, with their
/// common side from north-west to south-east, except for triangles with a corner without data.
///
/// ```
/// use sastrugi_numeric::triangulation::Limits;
/// use sastrugi_numeric::{Geometry, Grid, triangulate};
///
/// let mut heights = Grid::filled(Geometry::square(9, 9, 1.0), 0.0);
/// let limits = Limits { error_max: 0.1, triangles_max: None };
/// let flat = triangulate(&heights, &limits).map(|found| found.triangles.len());
/// assert_eq!(flat, Some(2));
/// // A rock becomes a vertex.
/// heights.values[2 * 9 + 6] = 1.0;
/// let rocky = triangulate(&heights, &limits).ok_or("no surface")?;
/// assert!(rocky.cells.contains(&(2 * 9 + 6)) && rocky.error_max <= 0.1);
/// # Ok::<(), &str>(())
/// ```
///
/// `None` if that surface has no triangles, or if the grid has more than [`MAX_CELLS`] cells.
pub fn triangulate(grid: &Grid, limits: &Limits) -> Option<Triangulation> {
    let g = &grid.geometry;
    if g.rows < 2 || g.cols < 2 || g.len() > MAX_CELLS {
        return None;
    }
    let mut greedy = Greedy::new(grid);
    greedy.add_rims();
    greedy.refine(limits);
    greedy.finish()
}

/// The post of a triangle with the largest error.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    error: f64,
    cell: usize,
    triangle: u32,
    /// Version of the triangle for which it was computed.
    version: u32,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let earlier = (other.cell, other.triangle, other.version).cmp(&(self.cell, self.triangle, self.version));
        self.error.total_cmp(&other.error).then(earlier)
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

struct Greedy<'a> {
    grid: &'a Grid,
    /// Whether every cell has data.
    complete: bool,
    mesh: Delaunay,
    /// For each cell, whether it is a vertex.
    used: Vec<bool>,
    /// For each triangle, the number of its changes.
    versions: Vec<u32>,
    worst: BinaryHeap<Candidate>,
}

impl<'a> Greedy<'a> {
    fn new(grid: &'a Grid) -> Self {
        let g = &grid.geometry;
        let mut used = vec![false; g.len()];
        for corner in [0, g.cols - 1, g.len() - g.cols, g.len() - 1] {
            used[corner] = true;
        }
        Self {
            grid,
            complete: grid.values.iter().all(|z| z.is_finite()),
            mesh: Delaunay::new([g.cols as i64 - 1, g.rows as i64 - 1]),
            used,
            versions: Vec::new(),
            worst: BinaryHeap::new(),
        }
    }

    /// Inserts all posts around cells without data as vertices.
    fn add_rims(&mut self) {
        if self.complete {
            return;
        }
        let mut near = 0;
        for cell in self.rims() {
            if std::mem::replace(&mut self.used[cell], true) {
                continue;
            }
            let point = self.point_of(cell);
            let triangle = self.mesh.locate(point, near);
            self.mesh.insert(point, triangle);
            near = triangle;
        }
        self.mesh.turn_square_diagonals();
    }

    /// Cells with data that share a square of four cells with one without data, ascending.
    fn rims(&self) -> Vec<usize> {
        let (cols, values) = (self.grid.cols(), &self.grid.values);
        let mut marked = vec![false; values.len()];
        for row in 1..self.grid.rows() {
            for south_east in row * cols + 1..(row + 1) * cols {
                let square = [south_east - cols - 1, south_east - cols, south_east - 1, south_east];
                if square.iter().any(|&cell| !values[cell].is_finite()) {
                    square.iter().for_each(|&cell| marked[cell] = values[cell].is_finite());
                }
            }
        }
        marked.iter().enumerate().filter(|(_, is_marked)| **is_marked).map(|(cell, _)| cell).collect()
    }

    fn refine(&mut self, limits: &Limits) {
        let mut kept = 0;
        self.versions = vec![0; self.mesh.len()];
        for triangle in 0..self.mesh.len() as u32 {
            kept += usize::from(self.is_kept(triangle));
            self.queue_worst(triangle);
        }
        while let Some(worst) = self.worst.pop() {
            if worst.version != self.versions[worst.triangle as usize] {
                continue;
            }
            let is_full = limits.triangles_max.is_some_and(|most| kept + 2 > most);
            if worst.error <= limits.error_max || is_full {
                return;
            }
            let before = self.mesh.len();
            self.used[worst.cell] = true;
            let point = self.point_of(worst.cell);
            self.mesh.insert(point, worst.triangle);
            kept += self.mesh.len() - before;
            self.versions.resize(self.mesh.len(), 0);
            for triangle in self.mesh.take_touched() {
                self.versions[triangle as usize] += 1;
                self.queue_worst(triangle);
            }
        }
    }

    /// Queues the post of a triangle with the largest error.
    fn queue_worst(&mut self, triangle: u32) {
        if !self.is_kept(triangle) {
            return;
        }
        let version = self.versions[triangle as usize];
        let mut worst = Candidate { error: 0.0, cell: usize::MAX, triangle, version };
        self.each_post(triangle, |cell, error| {
            if error > worst.error && !self.used[cell] {
                worst = Candidate { error, cell, ..worst };
            }
        });
        if worst.error > 0.0 {
            self.worst.push(worst);
        }
    }

    /// True for a triangle of the surface, false for one in a hole. Once the rims are vertices, every triangle lies completely in one of them.
    fn is_kept(&self, triangle: u32) -> bool {
        if self.complete {
            return true;
        }
        let corners = self.mesh.triangle(triangle);
        let has_data = |point: Point| self.grid.values[self.cell_of(point)].is_finite();
        if !corners.iter().all(|&corner| has_data(corner)) {
            return false;
        }
        // `[x, y]` is three times the centroid of the triangle, which lies in the square at `[west, south]`.
        let [x, y] = [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<i64>());
        let [west, south] = [x.div_euclid(3), y.div_euclid(3)];
        if !has_data([west, south + 1]) || !has_data([west + 1, south]) {
            return false;
        }
        let is_south_west = x - 3 * west + y - 3 * south < 3;
        has_data(if is_south_west { [west, south] } else { [west + 1, south + 1] })
    }

    /// Visits every post inside a triangle or on its edges, with its vertical distance from the triangle.
    fn each_post(&self, triangle: u32, mut visit: impl FnMut(usize, f64)) {
        let corners = self.mesh.triangle(triangle);
        let [z, along_x, along_y] = self.plane(&corners);
        let [x0, y0] = corners[0];
        let [[_, a], [_, b], [_, c]] = corners;
        for y in a.min(b).min(c)..=a.max(b).max(c) {
            let (first, last) = span(&corners, y);
            let row = self.cell_of([0, y]);
            let start = z + along_y * (y - y0) as f64;
            for x in first..=last {
                let cell = row + x as usize;
                visit(cell, (self.grid.values[cell] - (start + along_x * (x - x0) as f64)).abs());
            }
        }
    }

    /// Height of the first corner, and the slopes of the plane through all three, per column and per row.
    fn plane(&self, corners: &[Point; 3]) -> [f64; 3] {
        let [a, b, c] = corners;
        let [za, zb, zc] = corners.map(|corner| self.grid.values[self.cell_of(corner)]);
        let area = doubled_area(*corners) as f64;
        let [bx, by, cx, cy] = [b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]].map(|n| n as f64);
        [za, ((zb - za) * cy - (zc - za) * by) / area, ((zc - za) * bx - (zb - za) * cx) / area]
    }

    fn cell_of(&self, [x, y]: Point) -> usize {
        (self.grid.rows() - 1 - y as usize) * self.grid.cols() + x as usize
    }

    fn point_of(&self, cell: usize) -> Point {
        let (row, col) = (cell / self.grid.cols(), cell % self.grid.cols());
        [col as i64, (self.grid.rows() - 1 - row) as i64]
    }

    /// The triangles outside holes, with their errors.
    fn finish(mut self) -> Option<Triangulation> {
        self.mesh.turn_square_diagonals();
        let kept: Vec<u32> = (0..self.mesh.len() as u32).filter(|&triangle| self.is_kept(triangle)).collect();
        if kept.is_empty() {
            return None;
        }
        let corners = kept.iter().map(|&triangle| self.mesh.triangle(triangle).map(|point| self.cell_of(point)));
        let corners: Vec<[usize; 3]> = corners.collect();
        let mut numbers = vec![u32::MAX; self.used.len()];
        corners.iter().flatten().for_each(|&cell| numbers[cell] = 0);
        let cells: Vec<usize> = (0..numbers.len()).filter(|&cell| numbers[cell] == 0).collect();
        for (number, &cell) in (0..).zip(&cells) {
            numbers[cell] = number;
        }
        let (error_max, error_rms) = self.errors(&kept);
        let triangles = corners.iter().map(|cells| cells.map(|cell| numbers[cell])).collect();
        Some(Triangulation { cells, triangles, error_max, error_rms })
    }

    /// Largest and root mean square vertical distance of all posts of these triangles, each counted once.
    fn errors(&self, triangles: &[u32]) -> (f64, f64) {
        let mut counted = vec![false; self.used.len()];
        let (mut largest, mut squares, mut count) = (0.0_f64, 0.0, 0_u64);
        for &triangle in triangles {
            self.each_post(triangle, |cell, error| {
                largest = largest.max(error);
                if !std::mem::replace(&mut counted[cell], true) {
                    squares += error * error;
                    count += 1;
                }
            });
        }
        (largest, (squares / count.max(1) as f64).sqrt())
    }
}

/// First and last column of a counter-clockwise triangle in a row that it crosses; the last may be less than the first.
fn span(corners: &[Point; 3], y: i64) -> (i64, i64) {
    let (mut first, mut last) = (i64::MIN, i64::MAX);
    for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (corners[from], corners[to])) {
        let (along, rise) = ((b[0] - a[0]) * (y - a[1]), b[1] - a[1]);
        match rise.cmp(&0) {
            Ordering::Greater => last = last.min(a[0] + along.div_euclid(rise)),
            Ordering::Less => first = first.max(a[0] - along.div_euclid(-rise)),
            Ordering::Equal => (),
        }
    }
    (first, last)
}
