//! Triangle meshes: Wavefront `.obj`, binary glTF 2.0 `.glb` (Khronos Group, "glTF 2.0 Specification", 2021) and OpenUSD `.usda`.
//!
//! One vertex per cell with data, at its centre; two triangles between four neighbours, counter-clockwise from above, whose common
//! side runs from north-west to south-east. A triangle with a corner without data is left out. A mesh may be decimated to fewer
//! triangles over a subset of the cells ([`sastrugi_numeric::triangulation`]); the file then states the error.

use super::checks::check_single_precision;
use super::crs::Crs;
use super::raster::Refusal;
use sastrugi_numeric::triangulation::{self, Limits};
use sastrugi_numeric::{Grid, Triangulation, triangulate};
use sastrugi_schemas::counted;
use serde_json::{Value, json};
use std::fmt::Write;

/// Most cells of a `.glb` or `.usda`: 4096 per side. Programs that read them need several times the file size in memory.
pub(super) const MAX_CELLS: usize = 1 << 24;
/// glTF component types and buffer targets.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Vertex number of a cell without a vertex.
const NO_VERTEX: u32 = u32::MAX;

/// Limits of decimation; at least one must be set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshLimits {
    /// Largest vertical distance of a cell centre from the mesh, m; 0 if only the triangles are limited.
    pub error_max_m: Option<f64>,
    /// Most triangles.
    pub triangles_max: Option<usize>,
}

/// A decimated mesh of one grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Decimation {
    limits: MeshLimits,
    triangulation: Triangulation,
    /// Triangles of the undecimated mesh.
    full: usize,
}

impl Decimation {
    /// Decimates the mesh of a grid in metres until one of the limits is met.
    pub(super) fn new(grid: &Grid, limits: &MeshLimits) -> Result<Self, Refusal> {
        let error_max = limits.error_max_m.unwrap_or(0.0);
        if !(error_max.is_finite() && error_max >= 0.0) {
            return Err(Refusal::new(format!("the mesh error limit must be 0 m or more, got {error_max} m")));
        }
        if grid.geometry.len() > triangulation::MAX_CELLS {
            return Err(too_many(grid, triangulation::MAX_CELLS));
        }
        let full = Mesh::of(grid, [0.0; 3], None)?.triangles().count();
        let requested = Limits { error_max, triangles_max: limits.triangles_max };
        let triangulation = triangulate(grid, &requested).ok_or_else(no_mesh)?;
        let count = triangulation.triangles.len();
        if limits.triangles_max.is_some_and(|most| count > most) {
            let triangles = counted(count, "triangle");
            let reason = format!("the outline and the rims of holes alone take {triangles}; allow at least that many");
            return Err(Refusal::new(reason));
        }
        Ok(Self { limits: *limits, triangulation, full })
    }

    /// Result and error as a sentence.
    pub fn sentence(&self) -> String {
        let found = &self.triangulation;
        let mut text = format!(
            "decimated to {} of {}; largest error at a cell centre {} m, RMS {} m",
            found.triangles.len(),
            counted(self.full, "triangle"),
            stated(found.error_max),
            stated(found.error_rms)
        );
        if let Some(limit) = self.limits.error_max_m.filter(|limit| found.error_max > *limit) {
            text.push_str(&format!("; an error of {limit} m would take more triangles"));
        }
        text
    }

    /// Result and error as JSON.
    pub fn to_json(&self) -> Value {
        let found = &self.triangulation;
        json!({
            "vertices": found.cells.len(),
            "triangles": found.triangles.len(),
            "triangles_of_dem": self.full,
            "error_max_m": found.error_max,
            "error_rms_m": found.error_rms,
        })
    }
}

/// An error with four digits, rounded up.
fn stated(error_m: f64) -> f64 {
    let nearest: f64 = format!("{error_m:.3e}").parse().unwrap_or(error_m);
    match nearest >= error_m {
        true => nearest,
        // One unit in the last digit higher.
        false => format!("{:.3e}", nearest + 1e-3 * libm::pow(10.0, libm::floor(libm::log10(error_m))))
            .parse()
            .unwrap_or(error_m),
    }
}

fn no_mesh() -> Refusal {
    Refusal::new("no three neighbouring cells hold data, so there is no triangle")
}

fn too_many(grid: &Grid, most: usize) -> Refusal {
    let g = &grid.geometry;
    let advice = "choose a smaller size, or cut a window";
    Refusal::new(format!("{} x {} cells are too many for a mesh of at most {most}; {advice}", g.cols, g.rows))
}

/// Vertices (x east, y north, z up, m) and triangles of a grid, generated lazily.
struct Mesh<'a> {
    grid: &'a Grid,
    /// Origin of the coordinates.
    zero: [f64; 3],
    /// Vertex number of each cell.
    numbers: Vec<u32>,
    decimation: Option<&'a Decimation>,
}

impl<'a> Mesh<'a> {
    /// The grid with coordinates relative to `zero`.
    ///
    /// # Errors
    /// No triangle, or a height beyond single precision.
    fn of(grid: &'a Grid, zero: [f64; 3], decimation: Option<&'a Decimation>) -> Result<Self, Refusal> {
        check_single_precision(grid.values.iter().map(|z| z - zero[2]))?;
        let mut numbers = vec![NO_VERTEX; grid.values.len()];
        match decimation {
            Some(decimation) => number_vertices(&mut numbers, decimation.triangulation.cells.iter().copied()),
            None => {
                let cells = grid.values.iter().enumerate().filter(|(_, z)| z.is_finite());
                number_vertices(&mut numbers, cells.map(|(cell, _)| cell));
            }
        }
        let mesh = Self { grid, zero, numbers, decimation };
        if mesh.triangles().next().is_none() {
            return Err(no_mesh());
        }
        Ok(mesh)
    }

    /// The grid relative to its south-west corner, for single-precision formats.
    fn local(grid: &'a Grid, decimation: Option<&'a Decimation>) -> Result<Self, Refusal> {
        let [x, y] = grid.geometry.origin;
        let mesh = Self::of(grid, [x, y, 0.0], decimation)?;
        let vertices = decimation.map_or(grid.geometry.len(), |d| d.triangulation.cells.len());
        if vertices > MAX_CELLS { Err(too_many(grid, MAX_CELLS)) } else { Ok(mesh) }
    }

    fn vertex_count(&self) -> usize {
        self.numbers.iter().filter(|number| **number != NO_VERTEX).count()
    }

    fn vertices(&self) -> impl Iterator<Item = [f64; 3]> {
        let (g, [x, y, z]) = (&self.grid.geometry, self.zero);
        let cells = self.numbers.iter().zip(&self.grid.values).enumerate();
        let cells = cells.filter(|(_, (number, _))| **number != NO_VERTEX);
        cells.map(move |(at, (_, height))| [g.x(at % g.cols) - x, g.y(at / g.cols) - y, height - z])
    }

    /// Corners of the triangles, counter-clockwise from above: those of the decimation if given, or all.
    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let few = self.decimation.map(|decimation| decimation.triangulation.triangles.iter().copied());
        let all = self.decimation.is_none().then(|| self.all_triangles());
        few.into_iter().flatten().chain(all.into_iter().flatten())
    }

    fn all_triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let g = &self.grid.geometry;
        let squares = (1..g.rows).flat_map(move |south| (1..g.cols).map(move |east| south * g.cols + east));
        let corners = squares.flat_map(move |se| {
            let [nw, ne, sw, se] = [se - g.cols - 1, se - g.cols, se - 1, se].map(|at| self.numbers[at]);
            [[nw, sw, se], [nw, se, ne]]
        });
        corners.filter(|triangle| !triangle.contains(&NO_VERTEX))
    }
}

/// Numbers the vertices of these cells in order.
fn number_vertices(numbers: &mut [u32], cells: impl Iterator<Item = usize>) {
    for (number, cell) in (0..).zip(cells) {
        numbers[cell] = number;
    }
}

/// Wavefront, in the DEM's own coordinates.
pub(super) fn obj(grid: &Grid, decimation: Option<&Decimation>) -> Result<Vec<u8>, Refusal> {
    obj_above(grid, 0.0, decimation)
}

/// Wavefront, in the DEM's own coordinates, with heights above `zero_m`, so that single precision resolves the relief rather than the
/// elevation above sea level.
pub(super) fn obj_above(grid: &Grid, zero_m: f64, decimation: Option<&Decimation>) -> Result<Vec<u8>, Refusal> {
    let mesh = Mesh::of(grid, [0.0, 0.0, zero_m], decimation)?;
    let mut text = String::from("# terrain mesh; x east, y north, z up, metres\n");
    // Writing to a string cannot fail.
    if let Some(decimation) = decimation {
        let _ = writeln!(text, "# {}", decimation.sentence());
    }
    for [x, y, z] in mesh.vertices() {
        let _ = writeln!(text, "v {x} {y} {}", z as f32);
    }
    for [a, b, c] in mesh.triangles() {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    Ok(text.into_bytes())
}

/// Binary glTF, whose y points up: x east, y up, z south.
pub(super) fn glb(grid: &Grid, decimation: Option<&Decimation>) -> Result<Vec<u8>, Refusal> {
    let mesh = Mesh::local(grid, decimation)?;
    let vertices = || mesh.vertices().map(|[x, y, z]| [x as f32, z as f32, -y as f32]);
    let (low, high) = bounds(vertices());
    let (vertex_count, triangle_count) = (mesh.vertex_count(), mesh.triangles().count());
    let (vertex_bytes, index_bytes) = (12 * vertex_count, 12 * triangle_count);
    let mut scene = json!({
        "asset": { "version": "2.0", "generator": crate::PROGRAM },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "terrain", "mesh": 0 }],
        "meshes": [{ "name": "terrain", "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": FLOAT, "count": vertex_count, "type": "VEC3", "min": low, "max": high },
            { "bufferView": 1, "componentType": UNSIGNED_INT, "count": 3 * triangle_count, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": vertex_bytes, "target": ARRAY_BUFFER },
            { "buffer": 0, "byteOffset": vertex_bytes, "byteLength": index_bytes, "target": ELEMENT_ARRAY_BUFFER },
        ],
        "buffers": [{ "byteLength": vertex_bytes + index_bytes }],
    });
    if let Some(decimation) = decimation {
        scene["meshes"][0]["extras"] = decimation.to_json();
    }
    let mut text = scene.to_string();
    // Chunks are padded to multiples of 4 bytes; the binary chunk always is one.
    text.push_str(&" ".repeat(text.len().next_multiple_of(4) - text.len()));
    let total = 12 + 8 + text.len() + 8 + vertex_bytes + index_bytes;
    let mut bytes = Vec::with_capacity(total);
    bytes.extend(b"glTF");
    bytes.extend([2, total as u32, text.len() as u32].iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend(b"JSON");
    bytes.extend(text.as_bytes());
    bytes.extend(((vertex_bytes + index_bytes) as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(vertices().flatten().flat_map(f32::to_le_bytes));
    bytes.extend(mesh.triangles().flatten().flat_map(u32::to_le_bytes));
    Ok(bytes)
}

/// OpenUSD: metres, z up, colliding by its own triangles (not a convex hull).
pub(super) fn usda(grid: &Grid, decimation: Option<&Decimation>) -> Result<Vec<u8>, Refusal> {
    let mesh = Mesh::local(grid, decimation)?;
    let points = || mesh.vertices().map(|point| point.map(|v| v as f32));
    let (low, high) = bounds(points());
    let point = |[x, y, z]: [f32; 3]| format!("({x}, {y}, {z})");
    let what = decimation.map_or_else(String::new, |decimation| format!("; {}", decimation.sentence()));
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"Terrain\"\n    doc = \"Terrain; x east, y north, z up{what}\"\n    \
         kilogramsPerUnit = 1\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\n\
         def Xform \"Terrain\" (\n    kind = \"component\"\n)\n{{\n    def Mesh \"Mesh\" (\n        \
         prepend apiSchemas = [\"PhysicsCollisionAPI\", \"PhysicsMeshCollisionAPI\"]\n    )\n    {{\n",
    );
    let _ = writeln!(text, "        float3[] extent = [{}, {}]", point(low), point(high));
    text.push_str("        int[] faceVertexCounts = [");
    listed(&mut text, mesh.triangles().map(|_| 3));
    text.push_str("]\n        int[] faceVertexIndices = [");
    listed(&mut text, mesh.triangles().flatten());
    text.push_str("]\n        uniform token orientation = \"rightHanded\"\n        point3f[] points = [");
    listed(&mut text, points().map(point));
    text.push_str(
        "]\n        uniform token physics:approximation = \"none\"\n        bool physics:collisionEnabled = 1\n        \
         uniform token subdivisionScheme = \"none\"\n    }\n}\n",
    );
    Ok(text.into_bytes())
}

/// Appends a note on the decimation, if any.
pub(super) fn with_decimation(mut notes: Vec<String>, decimation: Option<&Decimation>) -> Vec<String> {
    notes.extend(decimation.map(Decimation::sentence));
    notes
}

/// Notes on what single-precision formats lose, whose coordinates must stay small.
pub(super) fn local_notes(grid: &Grid, crs: &Crs) -> Vec<String> {
    let [x, y] = grid.geometry.origin;
    let shift = format!("x and y of the mesh are relative to the DEM's south-west corner, ({x}, {y})");
    crs.loss_notes().into_iter().chain(([x, y] != [0.0; 2]).then_some(shift)).collect()
}

/// Appends values separated by commas.
fn listed<T: std::fmt::Display>(text: &mut String, values: impl Iterator<Item = T>) {
    for (k, value) in values.enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}{value}", if k == 0 { "" } else { ", " });
    }
}

/// Lowest and highest of each coordinate.
fn bounds(points: impl Iterator<Item = [f32; 3]>) -> ([f32; 3], [f32; 3]) {
    points.fold(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]), |(low, high), point| {
        (std::array::from_fn(|k| low[k].min(point[k])), std::array::from_fn(|k| high[k].max(point[k])))
    })
}
