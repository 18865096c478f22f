//! Unreal Engine: heightmap of a landscape. Left-handed: X east, Y south, Z up, in centimetres; the first row of the image is the
//! northern one, at the smallest Y.
//!
//! Landscapes consist of whole components; the sizes are those of the table "Recommended Landscape Sizes" in Epic Games, "Landscape
//! Technical Guide" (Unreal Engine 5). Level 32768 is height 0, and one level is 1/128 of the scale in centimetres (ibid.: at scale
//! 100, levels range from -256 to 256 m).

use super::levels::{Levels, rounded_up, to_millimetres};
use super::parts::Parts;
use super::posts::Posts;
use super::readable;
use crate::dem::png;
use crate::dem::raster::Refusal;
use serde_json::json;

/// Posts per side.
pub(super) const SIZES: [usize; 7] = [127, 253, 505, 1009, 2017, 4033, 8129];
const ZERO_LEVEL: f64 = 32768.0;
/// Levels per metre at a Z scale of 1: 128 per centimetre.
const LEVELS_PER_SCALE: f64 = 12800.0;

pub(super) fn parts(posts: &Posts) -> Result<Parts, Refusal> {
    let middle_m = to_millimetres(0.5 * (posts.low_m + posts.high_m));
    let reach_m = (posts.high_m - middle_m).max(middle_m - posts.low_m);
    // Levels 1 to 65535; a level surface works with any scale.
    let scale_z = if reach_m > 0.0 { rounded_up(reach_m / 32767.0 * LEVELS_PER_SCALE) } else { 1.0 };
    let step_m = scale_z / LEVELS_PER_SCALE;
    let levels = Levels { offset_m: middle_m - ZERO_LEVEL * step_m, step_m };
    let g = posts.geometry();
    let north_west = [100.0 * g.x(0), -100.0 * g.y(0), 100.0 * middle_m];
    let scale = [100.0 * g.cell[0], 100.0 * g.cell[1], scale_z];
    let (section, per_component) = if g.cols == 8129 { (127, 254) } else { (63, 126) };
    let components = (g.cols - 1) / per_component;
    let [scale_x, scale_y] = [scale[0], scale[1]].map(readable);
    let [x, y, z] = north_west.map(readable);
    Ok(Parts {
        title: "Unreal Engine",
        files: vec![("heightmap.png".to_owned(), png::levels(&levels.of(posts))?)],
        scene_to_target: [[100.0, 0.0, 0.0, 0.0], [0.0, -100.0, 0.0, 0.0], [0.0, 0.0, 100.0, 0.0]],
        axes: "X east, Y south, Z up, cm, left-handed",
        settings: json!({
            "heightmap": "heightmap.png",
            "section_quads": section,
            "sections_per_component": [2, 2],
            "components": [components, components],
            "scale": scale,
            "location_cm": north_west,
            "height_of_level": levels.describe(),
        }),
        steps: vec![
            "Landscape mode, Manage, New, Import from File: choose `heightmap.png`.".to_owned(),
            format!(
                "Section Size {section} x {section} quads, 2 x 2 sections per component, {components} x {components} components \
                 (Fit to Data sets them); Overall Resolution must read {0} x {0}.",
                g.cols
            ),
            format!("Scale X = {scale_x}, Y = {scale_y}, Z = {scale_z}. Import."),
            format!(
                "In the Details of the Landscape actor set Location X = {x}, Y = {y}, Z = {z}: the north-west post, at the height of \
                 level 32768."
            ),
            "A yaw in the scene (counter-clockwise from east) has the opposite sign in Unreal.".to_owned(),
        ],
    })
}
