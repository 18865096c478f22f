//! Isaac Sim, and other programs that read OpenUSD: a mesh in metres, z up, that collides by its own triangles. Scene coordinates
//! are unchanged; cells without data are holes.

use super::parts::{Parts, SAME};
use super::posts::Posts;
use crate::dem::mesh::{self, Decimation};
use crate::dem::raster::Refusal;
use serde_json::json;

const SCENE: &str = "terrain.usda";

pub(super) fn parts(posts: &Posts, decimation: Option<&Decimation>) -> Result<Parts, Refusal> {
    Ok(Parts {
        title: "Isaac Sim",
        files: vec![(SCENE.to_owned(), mesh::usda(&posts.heights, decimation)?)],
        scene_to_target: SAME,
        axes: "x east, y north, z up, m",
        settings: json!({
            "stage": SCENE,
            "prim": "/Terrain",
            "mesh": "/Terrain/Mesh",
            "meters_per_unit": 1,
            "up_axis": "Z",
            "collision": "triangles of the mesh (physics:approximation = none)",
        }),
        steps: vec![
            format!("File, Open `{SCENE}`, or Add Reference in a stage in metres with z up: the prim is /Terrain."),
            "The mesh collides by its own triangles; add a physics scene and a material in the stage.".to_owned(),
        ],
    })
}
