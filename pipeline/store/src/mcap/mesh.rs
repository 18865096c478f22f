//! The terrain as triangles: every cell along the path, coarser elsewhere, without gaps.
//!
//! A quadtree over the cells is split down to tiles of [`TILE`] cells wherever the vehicle comes near. A tile near the
//! path is drawn cell by cell. Any other leaf is drawn as a fan from its centre to every vertex that it or a neighbour
//! has on its edge, so that surfaces of different resolution meet without gap or overlap.
//!
//! Tiles of one shape share their list of indices and their plan coordinates, so that they compress to little more
//! than their heights.

use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::RoughnessClass;
use std::collections::BTreeMap;

/// Cells along the side of a tile drawn in full.
const TILE: usize = 8;
/// Most leaves along a side before any is split.
const COARSE_LEAVES: usize = 32;
/// Heights are stored in steps of 2^-10 m.
const HEIGHT_STEPS_PER_M: f64 = 1024.0;

/// A part of the terrain's surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Patch {
    /// Where its points count from, in the map frame, m.
    pub origin: [f64; 3],
    /// Points, m.
    pub points: Vec<[f64; 3]>,
    /// Class code of each point.
    pub codes: Vec<u8>,
    /// Triangles as triples of points, counterclockwise from above.
    pub triangles: Vec<[u32; 3]>,
}

/// A square of the plane, by its centre and half its side, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Square {
    pub centre: [f64; 2],
    pub half_side: f64,
}

/// The surface, in full wherever one of the squares lies.
pub(super) fn terrain(dem: &Grid, classes: Option<&Grid<u8>>, near: &[Square]) -> Vec<Patch> {
    let g = &dem.geometry;
    if g.rows < 2 || g.cols < 2 {
        return vec![];
    }
    let leaves = leaves(g, &marked_tiles(g, near));
    let drawing = Drawing { dem, classes, base: base_height(dem) };
    let (fine, coarse): (Vec<_>, Vec<_>) = leaves.into_iter().partition(|leaf| leaf.fine);
    let mut patches: Vec<Patch> = fine.iter().map(|leaf| drawing.tile(leaf)).collect();
    patches.push(drawing.fans(&coarse, &vertices(g, &fine, &coarse)));
    patches.retain(|patch| !patch.triangles.is_empty());
    patches
}

/// Where heights count from: the lowest one, so that single precision in a viewer suffices.
fn base_height(dem: &Grid) -> f64 {
    dem.range().map_or(0.0, |(low, _)| low.floor())
}

/// Nodes `row..=row_end` and `col..=col_end` (a node is a cell centre).
#[derive(Clone, Copy, Debug)]
struct Leaf {
    row: usize,
    col: usize,
    row_end: usize,
    col_end: usize,
    fine: bool,
}

impl Leaf {
    /// A leaf cut at the grid's edge; one without a node inside has no centre for a fan and is drawn in full.
    fn new(g: &Geometry, row: usize, col: usize, side: usize, near: bool) -> Self {
        let (row_end, col_end) = ((row + side).min(g.rows - 1), (col + side).min(g.cols - 1));
        Self { row, col, row_end, col_end, fine: near || row_end - row < 2 || col_end - col < 2 }
    }

    /// Nodes around it that are vertices, counterclockwise from above from the north-west corner.
    fn outline(&self, vertices: &[bool], cols: usize) -> Vec<(usize, usize)> {
        let &Self { row, col, row_end, col_end, .. } = self;
        let west = (row..row_end).map(|r| (r, col));
        let south = (col..col_end).map(|c| (row_end, c));
        let east = (row + 1..=row_end).rev().map(|r| (r, col_end));
        let north = (col + 1..=col_end).rev().map(|c| (row, c));
        west.chain(south).chain(east).chain(north).filter(|&(r, c)| vertices[r * cols + c]).collect()
    }
}

/// Tiles that a square touches, row by row.
struct Tiles {
    cols: usize,
    marked: Vec<bool>,
}

fn marked_tiles(g: &Geometry, near: &[Square]) -> Tiles {
    let (rows, cols) = ((g.rows - 1).div_ceil(TILE), (g.cols - 1).div_ceil(TILE));
    let mut tiles = Tiles { cols, marked: vec![false; rows * cols] };
    // Position in tiles from the north-western node; a value beyond the grid is held at its edge.
    let tile = |cells: f64, n: usize| ((cells - 0.5) / TILE as f64).clamp(0.0, (n - 1) as f64) as usize;
    for Square { centre: [x, y], half_side } in near.iter().filter(|s| s.centre.iter().all(|v| v.is_finite())) {
        let col = |x: f64| tile((x - g.origin[0]) / g.cell[0], cols);
        let row = |y: f64| tile(g.rows as f64 - (y - g.origin[1]) / g.cell[1], rows);
        for r in row(y + half_side)..=row(y - half_side) {
            tiles.marked[r * cols + col(x - half_side)..=r * cols + col(x + half_side)].fill(true);
        }
    }
    tiles
}

impl Tiles {
    /// True when a tile of the square block with its north-western node at `(row, col)` is marked.
    fn any_in(&self, row: usize, col: usize, side: usize) -> bool {
        let (first, count) = (col / TILE, side / TILE);
        let rows = self.marked.chunks(self.cols).skip(row / TILE).take(count);
        rows.flat_map(|tiles| tiles.iter().skip(first).take(count)).any(|&marked| marked)
    }
}

fn leaves(g: &Geometry, tiles: &Tiles) -> Vec<Leaf> {
    let mut side = TILE;
    while side * COARSE_LEAVES < g.rows.max(g.cols) - 1 {
        side *= 2;
    }
    let mut leaves = vec![];
    for row in (0..g.rows - 1).step_by(side) {
        for col in (0..g.cols - 1).step_by(side) {
            split(g, tiles, row, col, side, &mut leaves);
        }
    }
    leaves
}

fn split(g: &Geometry, tiles: &Tiles, row: usize, col: usize, side: usize, leaves: &mut Vec<Leaf>) {
    if row + 1 >= g.rows || col + 1 >= g.cols {
        return;
    }
    let near = tiles.any_in(row, col, side);
    if !near || side == TILE {
        leaves.push(Leaf::new(g, row, col, side, near));
        return;
    }
    let half = side / 2;
    for (r, c) in [(row, col), (row, col + half), (row + half, col), (row + half, col + half)] {
        split(g, tiles, r, c, half, leaves);
    }
}

/// Marks every node that is a vertex of some leaf: the corners of coarse ones, the outline of fine ones.
fn vertices(g: &Geometry, fine: &[Leaf], coarse: &[Leaf]) -> Vec<bool> {
    let mut vertices = vec![false; g.len()];
    for leaf in coarse {
        for (row, col) in [(leaf.row, leaf.col), (leaf.row, leaf.col_end)] {
            vertices[row * g.cols + col] = true;
        }
        for col in [leaf.col, leaf.col_end] {
            vertices[leaf.row_end * g.cols + col] = true;
        }
    }
    for leaf in fine {
        for row in [leaf.row, leaf.row_end] {
            vertices[row * g.cols + leaf.col..=row * g.cols + leaf.col_end].fill(true);
        }
        for row in leaf.row..=leaf.row_end {
            vertices[row * g.cols + leaf.col] = true;
            vertices[row * g.cols + leaf.col_end] = true;
        }
    }
    vertices
}

struct Drawing<'a> {
    dem: &'a Grid,
    classes: Option<&'a Grid<u8>>,
    base: f64,
}

impl Drawing<'_> {
    fn code(&self, row: usize, col: usize) -> u8 {
        self.classes.map_or(RoughnessClass::NO_DATA, |classes| classes.at(row, col))
    }

    /// Height over the base in steps of 2^-10 m.
    fn height(&self, row: usize, col: usize) -> f64 {
        ((self.dem.at(row, col) - self.base) * HEIGHT_STEPS_PER_M).round() / HEIGHT_STEPS_PER_M
    }

    /// A leaf cell by cell.
    fn tile(&self, leaf: &Leaf) -> Patch {
        let g = &self.dem.geometry;
        let mut patch = Patch { origin: [g.x(leaf.col), g.y(leaf.row_end), self.base], ..Patch::default() };
        for row in leaf.row..=leaf.row_end {
            for col in leaf.col..=leaf.col_end {
                let [dx, dy] = [(col - leaf.col) as f64 * g.cell[0], (leaf.row_end - row) as f64 * g.cell[1]];
                let z = self.height(row, col);
                patch.points.push([dx, dy, if z.is_finite() { z } else { f64::NAN }]);
                patch.codes.push(self.code(row, col));
            }
        }
        let width = (leaf.col_end - leaf.col + 1) as u32;
        for row in 0..(leaf.row_end - leaf.row) as u32 {
            for col in 0..width - 1 {
                let nw = row * width + col;
                let (ne, sw, se) = (nw + 1, nw + width, nw + width + 1);
                patch.triangles.extend([[nw, sw, se], [nw, se, ne]]);
            }
        }
        without_holes(patch)
    }

    /// All other leaves as fans, in one patch that shares its points.
    fn fans(&self, leaves: &[Leaf], vertices: &[bool]) -> Patch {
        let g = &self.dem.geometry;
        let mut patch = Patch { origin: [g.x(0), g.y(g.rows - 1), self.base], ..Patch::default() };
        let mut known = BTreeMap::new();
        let mut point = |row: usize, col: usize, patch: &mut Patch| {
            *known.entry((row, col)).or_insert_with(|| {
                let [dx, dy] = [col as f64 * g.cell[0], (g.rows - 1 - row) as f64 * g.cell[1]];
                patch.points.push([dx, dy, self.height(row, col)]);
                patch.codes.push(self.code(row, col));
                (patch.points.len() - 1) as u32
            })
        };
        for leaf in leaves {
            let centre = point(leaf.row.midpoint(leaf.row_end), leaf.col.midpoint(leaf.col_end), &mut patch);
            let outline = leaf.outline(vertices, g.cols);
            let around: Vec<u32> = outline.into_iter().map(|(r, c)| point(r, c, &mut patch)).collect();
            let next = around.iter().cycle().skip(1);
            let fan = around.iter().zip(next).map(|(&a, &b)| [centre, a, b]);
            patch.triangles.extend(fan.filter(|[c, a, b]| c != a && c != b && a != b));
        }
        without_holes(patch)
    }
}

/// Drops triangles with a corner without data, and puts such corners at the base.
fn without_holes(mut patch: Patch) -> Patch {
    if patch.points.iter().all(|p| p[2].is_finite()) {
        return patch;
    }
    let Patch { points, triangles, .. } = &mut patch;
    triangles.retain(|t| t.iter().all(|&i| points[i as usize][2].is_finite()));
    points.iter_mut().filter(|p| !p[2].is_finite()).for_each(|p| p[2] = 0.0);
    patch
}
