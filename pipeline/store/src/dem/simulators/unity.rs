//! Unity: raw heightmap of a terrain. Left-handed: x east, y up, z north, in metres; the first row of the file is the southern
//! one, at the smallest z (no vertical flip).
//!
//! The editor's import divides levels by 65536 and multiplies them by the terrain's height (class ImportRawHeightmap of Unity's
//! C# reference source); the engine stores them in steps of 1/32766 of that height (`TerrainData`).

use super::levels::{Levels, rounded_up, to_millimetres};
use super::parts::Parts;
use super::posts::Posts;
use super::readable;
use serde_json::json;

/// Posts per side.
pub(super) const SIZES: [usize; 8] = [33, 65, 129, 257, 513, 1025, 2049, 4097];
const LEVELS: f64 = 65536.0;

pub(super) fn parts(posts: &Posts) -> Parts {
    // Rounded so as not to exceed the lowest height.
    let base_m = to_millimetres(posts.low_m - 0.0005);
    let height_m = rounded_up(LEVELS / 65535.0 * (posts.low_m - base_m + posts.relief_m()));
    let levels = Levels { offset_m: base_m, step_m: height_m / LEVELS };
    let grid = levels.of(posts);
    let raw = Posts::rows_from_south(&grid).flatten().flat_map(|level| level.to_le_bytes()).collect();
    let ([east, north], [x, z]) = (posts.ground_m(), posts.south_west_m());
    let size = posts.geometry().cols;
    let ([width, length], [left, front]) = ([east, north].map(readable), [x, z].map(readable));
    Parts {
        title: "Unity",
        files: vec![("heightmap.raw".to_owned(), raw)],
        scene_to_target: [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
        axes: "x east, y up, z north, m, left-handed",
        settings: json!({
            "raw": "heightmap.raw",
            "depth": "16 bit",
            "resolution": size,
            "byte_order": "Windows",
            "flip_vertically": false,
            "terrain_size_m": [east, height_m, north],
            "position_m": [x, base_m, z],
            "height_of_level": levels.describe(),
        }),
        steps: vec![
            format!(
                "GameObject, 3D Object, Terrain; in its settings, Mesh Resolution: Terrain Width {width}, Terrain Length {length}, \
                 Terrain Height {height_m}."
            ),
            format!(
                "Texture Resolutions, Heightmap: Import Raw, `heightmap.raw`, Depth 16 bit, Resolution {size}, Byte Order Windows, \
                 Flip Vertically off, Terrain Size {width}, {height_m}, {length}."
            ),
            format!("Transform, Position: {left}, {base_m}, {front}: the south-west post, at the height of level 0."),
            format!(
                "Unity stores heights in steps of 1/32766 of the terrain's height: {:.3e} m here.",
                height_m / 32766.0
            ),
        ],
    }
}
