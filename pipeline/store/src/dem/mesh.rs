//! Triangle meshes: Wavefront `.obj`, binary glTF 2.0 `.glb` (Khronos Group, "glTF 2.0 Specification", 2021) and OpenUSD `.usda`.
//!
//! One vertex per cell with data, at its centre; two triangles between four neighbours, counter-clockwise from above, whose common
//! side runs from north-west to south-east. A triangle with a corner without data is left out.

use super::Refusal;
use sastrugi_numeric::Grid;
use serde_json::json;
use std::fmt::Write;

/// Most cells of a `.glb` or `.usda`: 4096 a side. Programs that read them hold several times their bytes in memory.
pub(super) const MAX_CELLS: usize = 1 << 24;
/// glTF: component types and targets of buffers.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Vertices (x east, y north, z up, m) and triangles.
struct Mesh {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The grid with x and y counted from `zero`.
    fn of(grid: &Grid, zero: [f64; 2]) -> Self {
        let g = &grid.geometry;
        let mut vertices = Vec::with_capacity(g.len());
        let mut index = vec![None; g.len()];
        for row in 0..g.rows {
            for (col, &z) in grid.row(row).iter().enumerate().filter(|(_, z)| z.is_finite()) {
                index[row * g.cols + col] = Some(vertices.len() as u32);
                vertices.push([g.x(col) - zero[0], g.y(row) - zero[1], z]);
            }
        }
        let mut triangles = Vec::new();
        let mut add = |corners: [Option<u32>; 3]| {
            if let [Some(a), Some(b), Some(c)] = corners {
                triangles.push([a, b, c]);
            }
        };
        for north in 0..g.rows.saturating_sub(1) {
            for west in 0..g.cols.saturating_sub(1) {
                let at = |row: usize, col: usize| index[row * g.cols + col];
                let (nw, ne) = (at(north, west), at(north, west + 1));
                let (sw, se) = (at(north + 1, west), at(north + 1, west + 1));
                add([nw, sw, se]);
                add([nw, se, ne]);
            }
        }
        Self { vertices, triangles }
    }

    /// The grid from its south-west corner, for formats of single precision.
    fn local(grid: &Grid) -> Result<Self, Refusal> {
        let g = &grid.geometry;
        if g.len() > MAX_CELLS {
            let size = format!("{} x {} cells", g.cols, g.rows);
            return Err(Refusal::new(format!("{size} are too many for a mesh, which takes {MAX_CELLS}; cut a window")));
        }
        let mesh = Self::of(grid, g.origin);
        if mesh.triangles.is_empty() {
            return Err(Refusal::new("no three neighbouring cells hold data, so that there is no mesh"));
        }
        Ok(mesh)
    }
}

/// Wavefront, in the DEM's own coordinates.
pub(super) fn obj(grid: &Grid) -> Vec<u8> {
    let Mesh { vertices, triangles } = Mesh::of(grid, [0.0; 2]);
    let mut text = String::from("# terrain mesh; x east, y north, z up, metres\n");
    // Writing to a string cannot fail.
    for [x, y, z] in vertices {
        let _ = writeln!(text, "v {x} {y} {}", z as f32);
    }
    for [a, b, c] in triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text.into_bytes()
}

/// Binary glTF, whose y points up: x east, y up, z south.
pub(super) fn glb(grid: &Grid) -> Result<Vec<u8>, Refusal> {
    let Mesh { vertices, triangles } = Mesh::local(grid)?;
    let vertices: Vec<[f32; 3]> = vertices.into_iter().map(|[x, y, z]| [x as f32, z as f32, -y as f32]).collect();
    let (low, high) = bounds(&vertices);
    let (vertex_bytes, index_bytes) = (12 * vertices.len(), 12 * triangles.len());
    let scene = json!({
        "asset": { "version": "2.0", "generator": crate::PROGRAM },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "terrain", "mesh": 0 }],
        "meshes": [{ "name": "terrain", "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": FLOAT, "count": vertices.len(), "type": "VEC3", "min": low, "max": high },
            { "bufferView": 1, "componentType": UNSIGNED_INT, "count": 3 * triangles.len(), "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": vertex_bytes, "target": ARRAY_BUFFER },
            { "buffer": 0, "byteOffset": vertex_bytes, "byteLength": index_bytes, "target": ELEMENT_ARRAY_BUFFER },
        ],
        "buffers": [{ "byteLength": vertex_bytes + index_bytes }],
    });
    let mut text = scene.to_string();
    // Chunks fill multiples of 4 bytes; that of the numbers does by itself.
    text.push_str(&" ".repeat(text.len().next_multiple_of(4) - text.len()));
    let total = 12 + 8 + text.len() + 8 + vertex_bytes + index_bytes;
    let mut bytes = Vec::with_capacity(total);
    bytes.extend(b"glTF");
    bytes.extend([2, total as u32, text.len() as u32].iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend(b"JSON");
    bytes.extend(text.as_bytes());
    bytes.extend(((vertex_bytes + index_bytes) as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(vertices.iter().flatten().flat_map(|v| v.to_le_bytes()));
    bytes.extend(triangles.iter().flatten().flat_map(|v| v.to_le_bytes()));
    Ok(bytes)
}

/// OpenUSD: metres, z up, a collision mesh of its own triangles (no convex hull).
pub(super) fn usda(grid: &Grid) -> Result<Vec<u8>, Refusal> {
    let Mesh { vertices, triangles } = Mesh::local(grid)?;
    let points: Vec<[f32; 3]> = vertices.into_iter().map(|point| point.map(|v| v as f32)).collect();
    let (low, high) = bounds(&points);
    let point = |[x, y, z]: [f32; 3]| format!("({x}, {y}, {z})");
    let mut text = String::from(
        "#usda 1.0\n(\n    defaultPrim = \"Terrain\"\n    doc = \"Terrain; x east, y north, z up\"\n    \
         kilogramsPerUnit = 1\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\n\
         def Xform \"Terrain\" (\n    kind = \"component\"\n)\n{\n    def Mesh \"Mesh\" (\n        \
         prepend apiSchemas = [\"PhysicsCollisionAPI\", \"PhysicsMeshCollisionAPI\"]\n    )\n    {\n",
    );
    let _ = writeln!(text, "        float3[] extent = [{}, {}]", point(low), point(high));
    text.push_str("        int[] faceVertexCounts = [");
    listed(&mut text, triangles.iter().map(|_| 3));
    text.push_str("]\n        int[] faceVertexIndices = [");
    listed(&mut text, triangles.iter().flatten());
    text.push_str("]\n        uniform token orientation = \"rightHanded\"\n        point3f[] points = [");
    listed(&mut text, points.iter().map(|&p| point(p)));
    text.push_str(
        "]\n        uniform token physics:approximation = \"none\"\n        bool physics:collisionEnabled = 1\n        \
         uniform token subdivisionScheme = \"none\"\n    }\n}\n",
    );
    Ok(text.into_bytes())
}

/// Values with commas between them.
fn listed<T: std::fmt::Display>(text: &mut String, values: impl Iterator<Item = T>) {
    for (k, value) in values.enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}{value}", if k == 0 { "" } else { ", " });
    }
}

/// Lowest and highest of each coordinate.
fn bounds(points: &[[f32; 3]]) -> ([f32; 3], [f32; 3]) {
    points.iter().fold(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]), |(low, high), point| {
        (std::array::from_fn(|k| low[k].min(point[k])), std::array::from_fn(|k| high[k].max(point[k])))
    })
}
