//! Gazebo: a model and a world in SDFormat 1.9, with a heightmap as the visual and a mesh of the same posts for collisions. Scene
//! coordinates are unchanged.
//!
//! The image must be square, of 2^n + 1 posts; its first row is the northern one. Level 0 is the model's height, level 65535 that
//! plus `size` z. The lowest and highest post take these levels, because loaders scale by the brightest pixel. The renderer
//! (gz-rendering, `Ogre2Heightmap`) spreads 2^n spacings over `size` x and y, and drops the last row and column.
//!
//! Mesh heights are relative to the lowest post, so that single precision resolves small relief at high elevation.
//!
//! Physics uses a mesh because a heightmap collision divides `size` by 2^n + 1 (gz-physics, `CustomHeightmapShape` of dartsim), and
//! assumes a relief of 1 m if the loader finds no brightest pixel, as gz-common 4 does for 16-bit images (`Image::MaxColor`).

use super::levels::Levels;
use super::parts::{Parts, SAME};
use super::posts::Posts;
use crate::dem::mesh::Decimation;
use crate::dem::raster::Refusal;
use crate::dem::{mesh, png};
use serde_json::json;

const COLLISION: &str = "collision.obj";
/// Posts per side.
pub(super) const SIZES: [usize; 6] = [129, 257, 513, 1025, 2049, 4097];

pub(super) fn parts(posts: &Posts, decimation: Option<&Decimation>) -> Result<Parts, Refusal> {
    let levels = Levels { offset_m: posts.low_m, step_m: posts.relief_m() / 65535.0 };
    let model = model(posts);
    Ok(Parts {
        title: "Gazebo",
        files: vec![
            ("heightmap.png".to_owned(), png::levels(&levels.of(posts))?),
            (COLLISION.to_owned(), mesh::obj_above(&posts.heights, posts.low_m, decimation)?),
            ("model.config".to_owned(), CONFIG.as_bytes().to_vec()),
            ("model.sdf".to_owned(), document(&model).into_bytes()),
            ("world.sdf".to_owned(), document(&world(&model)).into_bytes()),
        ],
        scene_to_target: SAME,
        axes: "x east, y north, z up, m",
        settings: json!({
            "heightmap": "heightmap.png",
            "pose_m": pose(posts),
            "size_m": size(posts),
            "collision": COLLISION,
            "height_of_level": levels.describe(),
        }),
        steps: vec![
            "`gz sim world.sdf` in this folder shows the terrain.".to_owned(),
            "For your own world, put this folder in `GZ_SIM_RESOURCE_PATH` and include `model.sdf`; its pose positions the ground."
                .to_owned(),
            "The visual is the height map; the collision is a mesh of the same posts, whose heights are not rescaled by loaders."
                .to_owned(),
        ],
    })
}

/// The middle of the ground, at its lowest height.
fn pose(posts: &Posts) -> [f64; 3] {
    let [x, y] = posts.centre_m();
    [x, y, posts.low_m]
}

fn size(posts: &Posts) -> [f64; 3] {
    let [east, north] = posts.ground_m();
    [east, north, posts.relief_m()]
}

const CONFIG: &str = "<?xml version=\"1.0\"?>\n<model>\n  <name>terrain</name>\n  <version>1.0</version>\n  \
                      <sdf version=\"1.9\">model.sdf</sdf>\n  <description>Terrain</description>\n</model>\n";

fn document(inside: &str) -> String {
    format!("<?xml version=\"1.0\"?>\n<sdf version=\"1.9\">\n{inside}</sdf>\n")
}

fn world(model: &str) -> String {
    format!(
        "<world name=\"terrain\">\n<light name=\"sun\" type=\"directional\">\n  <direction>-0.5 -0.5 -0.7</direction>\n  \
         <cast_shadows>true</cast_shadows>\n</light>\n{model}</world>\n"
    )
}

fn model(posts: &Posts) -> String {
    let numbers = |[x, y, z]: [f64; 3]| format!("{x} {y} {z}");
    // The mesh is in scene coordinates horizontally, whatever the model's position, and relative to the model's height vertically.
    let [x, y] = posts.centre_m();
    let back = [0.0 - x, 0.0 - y, 0.0];
    format!(
        "<model name=\"terrain\">\n  <static>true</static>\n  <pose>{} 0 0 0</pose>\n  <link name=\"ground\">\n    \
         <collision name=\"collision\">\n      <pose>{} 0 0 0</pose>\n      <geometry>\n        <mesh>\n          \
         <uri>{COLLISION}</uri>\n        </mesh>\n      </geometry>\n    </collision>\n    <visual name=\"visual\">\n      \
         <geometry>\n        <heightmap>\n          <uri>heightmap.png</uri>\n          <size>{}</size>\n          \
         <pos>0 0 0</pos>\n          <sampling>1</sampling>\n        </heightmap>\n      </geometry>\n    </visual>\n  </link>\n\
         </model>\n",
        numbers(pose(posts)),
        numbers(back),
        numbers(size(posts)),
    )
}
