//! Terrain mesh for viewers: every cell along the path, coarser elsewhere, without gaps.
//!
//! A quadtree over the cells is split down to tiles of [`TILE`] cells near the path of the vehicle. A tile near the path is drawn
//! cell by cell. Any other leaf is drawn as a fan from its centre to every vertex that it or a neighbour has on its edge, so
//! that surfaces of different resolution meet without gap or overlap.
//!
//! Patches of equal shape share their indices and plan coordinates, so that they compress to little more than their heights: tiles,
//! fans, and the largest leaves, which are combined row by row into one patch.

use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::RoughnessClass;
use std::collections::BTreeMap;

/// Cells along the side of a tile drawn at full resolution.
const TILE: usize = 8;
/// Most leaves along a side before any is split.
const COARSE_LEAVES: usize = 32;
/// Heights are stored in steps of 2^-7 m, which gives an error of at most 4 mm.
const HEIGHT_STEPS_PER_M: f64 = 128.0;
/// Smallest depth of the reference level for heights: a whole byte of a double then holds the fraction of a metre.
const DEPTH_M: f64 = 16.0;

/// A part of the terrain's surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Patch {
    /// Origin of its points, in the map frame, m.
    pub origin: [f64; 3],
    /// Points relative to the origin, m.
    pub points: Vec<[f64; 3]>,
    /// Class code of each point.
    pub codes: Vec<u8>,
    /// Triangles as triples of point indices, counter-clockwise from above.
    pub triangles: Vec<[u32; 3]>,
}

/// A square in plan view, by its centre and half its side, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Square {
    pub centre: [f64; 2],
    pub half_side: f64,
}

/// The surface, at full resolution wherever one of the squares lies. Heights are relative to `base_m`, see [`base`].
pub(super) fn terrain(dem: &Grid, classes: Option<&Grid<u8>>, base_m: f64, near: &[Square]) -> Vec<Patch> {
    let g = &dem.geometry;
    if g.rows < 2 || g.cols < 2 {
        return vec![];
    }
    let side = coarse_side(g);
    let (fine, coarse): (Vec<_>, Vec<_>) =
        leaves(g, &marked_tiles(g, near), side).into_iter().partition(|leaf| leaf.fine);
    let vertices = vertices(g, &fine, &coarse);
    let fans = coarse.iter().map(|leaf| (leaf, leaf.outline(&vertices, g.cols)));
    let (plain, ragged): (Vec<_>, Vec<_>) = fans.partition(|(leaf, outline)| leaf.is_plain(g, side, outline));
    let mut rows: BTreeMap<usize, Vec<&Leaf>> = BTreeMap::new();
    plain.into_iter().for_each(|(leaf, _)| rows.entry(leaf.row).or_default().push(leaf));
    let drawing = Drawing { dem, classes, base: base_m };
    let tiles = fine.iter().map(|leaf| drawing.tile(leaf));
    let fans = ragged.iter().map(|(leaf, outline)| drawing.fan(leaf, outline));
    let strips = rows.values().filter_map(|leaves| drawing.strip(leaves, side));
    tiles.chain(fans).chain(strips).filter(|patch| !patch.triangles.is_empty()).collect()
}

/// Row and column of every vertex of that surface, row by row.
pub(super) fn nodes(g: &Geometry, near: &[Square]) -> Vec<(usize, usize)> {
    if g.rows < 2 || g.cols < 2 {
        return vec![];
    }
    let (fine, coarse): (Vec<_>, Vec<_>) =
        leaves(g, &marked_tiles(g, near), coarse_side(g)).into_iter().partition(|leaf| leaf.fine);
    let mut taken = vertices(g, &fine, &coarse);
    for leaf in &fine {
        for row in leaf.row..=leaf.row_end {
            taken[row * g.cols + leaf.col..=row * g.cols + leaf.col_end].fill(true);
        }
    }
    for (row, col) in coarse.iter().map(Leaf::centre) {
        taken[row * g.cols + col] = true;
    }
    (0..g.len()).filter(|&at| taken[at]).map(|at| (at / g.cols, at % g.cols)).collect()
}

/// Reference level for heights from `low_m` to `high_m`: a whole number of metres, far enough below that all heights lie within one
/// power of two. As floating-point numbers they then share their exponent and differ in a byte or two.
pub(super) fn base(low_m: f64, high_m: f64) -> f64 {
    let low_m = low_m.floor();
    let mut depth_m = DEPTH_M;
    while depth_m <= high_m - low_m && depth_m.is_finite() {
        depth_m *= 2.0;
    }
    low_m - depth_m
}

/// Cells along the side of the largest leaves.
fn coarse_side(g: &Geometry) -> usize {
    let mut side = TILE;
    while side * COARSE_LEAVES < g.rows.max(g.cols) - 1 {
        side *= 2;
    }
    side
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
    /// A leaf, clipped at the edge of the grid; without an interior node it has no centre for a fan and is drawn cell by cell.
    fn new(g: &Geometry, row: usize, col: usize, side: usize, near: bool) -> Self {
        let (row_end, col_end) = ((row + side).min(g.rows - 1), (col + side).min(g.cols - 1));
        Self { row, col, row_end, col_end, fine: near || row_end - row < 2 || col_end - col < 2 }
    }

    /// The node at its centre.
    fn centre(&self) -> (usize, usize) {
        (self.row.midpoint(self.row_end), self.col.midpoint(self.col_end))
    }

    /// True for one of the largest leaves (clipped at the edge of the grid or not) with no vertices except its corners.
    fn is_plain(&self, g: &Geometry, side: usize, outline: &[(usize, usize)]) -> bool {
        let full = |start: usize, end: usize, n: usize| start.is_multiple_of(side) && end == (start + side).min(n - 1);
        outline.len() == 4 && full(self.row, self.row_end, g.rows) && full(self.col, self.col_end, g.cols)
    }

    /// Nodes on its border that are vertices, counter-clockwise from above, starting at the north-west corner.
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
    // Position in tiles from the north-western node; a value beyond the grid is clamped to its edge.
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
    /// True if any tile of the square block with its north-western node at `(row, col)` is marked.
    fn any_in(&self, row: usize, col: usize, side: usize) -> bool {
        let (first, count) = (col / TILE, side / TILE);
        let rows = self.marked.chunks(self.cols).skip(row / TILE).take(count);
        rows.flat_map(|tiles| tiles.iter().skip(first).take(count)).any(|&marked| marked)
    }
}

fn leaves(g: &Geometry, tiles: &Tiles, side: usize) -> Vec<Leaf> {
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

/// Marks every node that is a vertex of some leaf: the corners of coarse leaves and the outline of fine ones.
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

    /// Height above the base, rounded to whole steps.
    fn height(&self, row: usize, col: usize) -> f64 {
        ((self.dem.at(row, col) - self.base) * HEIGHT_STEPS_PER_M).round() / HEIGHT_STEPS_PER_M
    }

    /// A patch of the given nodes, none of which lies west of `west` or south of `south`.
    fn patch(
        &self,
        (south, west): (usize, usize),
        nodes: impl Iterator<Item = (usize, usize)>,
        triangles: Vec<[u32; 3]>,
    ) -> Patch {
        let g = &self.dem.geometry;
        let count = nodes.size_hint().0;
        let (mut points, mut codes) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (row, col) in nodes {
            let [dx, dy] = [(col - west) as f64 * g.cell[0], (south - row) as f64 * g.cell[1]];
            points.push([dx, dy, self.height(row, col)]);
            codes.push(self.code(row, col));
        }
        without_holes(Patch { origin: [g.x(west), g.y(south), self.base], points, codes, triangles })
    }

    /// A leaf drawn cell by cell.
    fn tile(&self, leaf: &Leaf) -> Patch {
        let [rows, cols] = [leaf.row_end - leaf.row, leaf.col_end - leaf.col];
        let width = cols + 1;
        let nodes = (0..(rows + 1) * width).map(|k| (leaf.row + k / width, leaf.col + k % width));
        // A recording has hundreds of tiles: nested iterators, which do not know their length, would grow each several times.
        let mut triangles = Vec::with_capacity(2 * rows * cols);
        for cell in 0..rows * cols {
            let (nw, width) = ((cell / cols * width + cell % cols) as u32, width as u32);
            triangles.push([nw, nw + width, nw + width + 1]);
            triangles.push([nw, nw + width + 1, nw + 1]);
        }
        self.patch((leaf.row_end, leaf.col), nodes, triangles)
    }

    /// A leaf drawn as a fan from its centre to its outline.
    fn fan(&self, leaf: &Leaf, outline: &[(usize, usize)]) -> Patch {
        let nodes = std::iter::once(leaf.centre()).chain(outline.iter().copied());
        let n = outline.len() as u32;
        let triangles = (0..n).map(|k| [0, k + 1, (k + 1) % n + 1]).collect();
        self.patch((leaf.row_end, leaf.col), nodes, triangles)
    }

    /// Plain leaves of one row. The points are the corners and centres of all possible leaves in the row, so that all strips of a
    /// terrain share them.
    fn strip(&self, leaves: &[&Leaf], side: usize) -> Option<Patch> {
        let g = &self.dem.geometry;
        let &&Leaf { row, row_end, .. } = leaves.first()?;
        let edges: Vec<usize> = (0..g.cols - 1).step_by(side).chain([g.cols - 1]).collect();
        let corners = |row: usize| edges.iter().map(move |&col| (row, col));
        let centres = edges.windows(2).map(|pair| (row.midpoint(row_end), pair[0].midpoint(pair[1])));
        let n = edges.len() as u32;
        let triangles = leaves.iter().flat_map(|leaf| {
            let nw = (leaf.col / side) as u32;
            let (ne, centre, sw, se) = (nw + 1, nw + n, nw + 2 * n - 1, nw + 2 * n);
            [[centre, nw, sw], [centre, sw, se], [centre, se, ne], [centre, ne, nw]]
        });
        Some(self.patch((row_end, 0), corners(row).chain(centres).chain(corners(row_end)), triangles.collect()))
    }
}

/// Drops triangles with a corner without data, and moves such corners to the base.
fn without_holes(mut patch: Patch) -> Patch {
    if patch.points.iter().all(|p| p[2].is_finite()) {
        return patch;
    }
    let Patch { points, triangles, .. } = &mut patch;
    triangles.retain(|t| t.iter().all(|&i| points[i as usize][2].is_finite()));
    points.iter_mut().filter(|p| !p[2].is_finite()).for_each(|p| p[2] = 0.0);
    patch
}
