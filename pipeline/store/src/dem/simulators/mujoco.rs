//! MuJoCo: an MJCF file with a height field in MuJoCo's own binary format (XML reference, `asset/hfield`): rows and columns as
//! int32, then float32 from the south-western post, rows northwards. Scene coordinates are unchanged.
//!
//! The compiler scales the numbers to the range 0 to 1; `size` converts them to metres above the geom.

use super::parts::{Parts, SAME};
use super::posts::Posts;
use serde_json::json;

/// Thickness below the lowest post, m.
const BASE_M: f64 = 1.0;
const HEIGHTS: &str = "heights.hfield";

pub(super) fn parts(posts: &Posts) -> Parts {
    let g = posts.geometry();
    let mut field: Vec<u8> = [g.rows, g.cols].iter().flat_map(|&n| (n as i32).to_le_bytes()).collect();
    // Above the lowest post, so that single precision resolves the relief rather than the elevation above sea level.
    let above = |z: &f64| ((z - posts.low_m) as f32).to_le_bytes();
    field.extend(Posts::rows_from_south(&posts.heights).flatten().flat_map(above));
    let ([east, north], [x, y]) = (posts.ground_m(), posts.centre_m());
    let size = [0.5 * east, 0.5 * north, posts.relief_m(), BASE_M];
    let position = [x, y, posts.low_m];
    let numbers = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let scene = format!(
        "<mujoco model=\"terrain\">\n  <asset>\n    <hfield name=\"terrain\" content_type=\"image/vnd.mujoco.hfield\" \
         file=\"{HEIGHTS}\" size=\"{}\"/>\n  </asset>\n  <worldbody>\n    <light directional=\"true\" dir=\"-0.5 -0.5 -0.7\"/>\n    \
         <geom name=\"terrain\" type=\"hfield\" hfield=\"terrain\" pos=\"{}\"/>\n  </worldbody>\n</mujoco>\n",
        numbers(&size),
        numbers(&position),
    );
    Parts {
        title: "MuJoCo",
        files: vec![(HEIGHTS.to_owned(), field), ("terrain.xml".to_owned(), scene.into_bytes())],
        scene_to_target: SAME,
        axes: "x east, y north, z up, m",
        settings: json!({ "hfield": HEIGHTS, "size_m": size, "position_m": position }),
        steps: vec![
            "`mujoco.MjModel.from_xml_path(\"terrain.xml\")`, or open `terrain.xml` in `simulate`.".to_owned(),
            "For your own model, copy the elements `hfield` and `geom`, or attach `terrain.xml`.".to_owned(),
            "MuJoCo places two triangles between four posts; their common side runs from south-west to north-east."
                .to_owned(),
        ],
    }
}
