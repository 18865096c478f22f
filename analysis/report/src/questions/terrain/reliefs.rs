//! Shaded relief: the middle, the smoothest and the roughest terrain of each group, in one light and one colour range.

use super::{GROUPS_WITH_THREE, by_slope, median};
use crate::ReportError;
use crate::content::{Figure, slug};
use crate::data::{Data, Group};
use crate::questions::relief::{Style, Words, exaggeration, exaggeration_words, relief};
use crate::render::number as set;
use sastrugi_schemas::tables::TerrainRow;

/// A terrain to draw and why.
type Choice<'a> = (&'a TerrainRow, String, &'static str);

/// One figure per terrain drawn.
pub fn figures(data: &Data, groups: &[Group<TerrainRow>]) -> Result<Vec<Figure>, ReportError> {
    let choices: Vec<Choice> = groups.iter().flat_map(|g| choices(g, groups.len())).collect();
    let style = style(&choices);
    let drawn = choices.iter().map(|choice| relief(data, &choice.0.path, Some(style), words(choice, style)));
    drawn.filter_map(Result::transpose).collect()
}

fn choices<'a>(group: &Group<'a, TerrainRow>, groups: usize) -> Vec<Choice<'a>> {
    let rows = by_slope(group);
    let Some(last) = rows.len().checked_sub(1) else { return Vec::new() };
    let places: &[(usize, &str)] = match rows.len() {
        1 => &[(0, "the only one")],
        _ if groups > GROUPS_WITH_THREE => &[(last / 2, "middle rms slope")],
        2 => &[(0, "smoother"), (1, "rougher")],
        _ => &[(0, "smoothest"), (last / 2, "middle rms slope"), (last, "roughest")],
    };
    places.iter().map(|&(i, why)| (rows[i], group.name.clone(), why)).collect()
}

fn style(choices: &[Choice]) -> Style {
    let rows: Vec<&TerrainRow> = choices.iter().map(|c| c.0).collect();
    let low = rows.iter().map(|t| t.height_min_m).fold(f64::INFINITY, f64::min);
    let high = rows.iter().map(|t| t.height_max_m).fold(f64::NEG_INFINITY, f64::max);
    let pixels = if rows.len() > 4 { 300 } else { 420 };
    Style { range_m: (low, high), exaggeration: exaggeration(median(&rows, |t| t.rms_slope)), pixels }
}

fn words((terrain, group, why): &Choice, style: Style) -> Words {
    let caption = format!(
        "{}, {why}: rms slope {}, relief {}. Light from the north-west.{}",
        terrain.terrain_id,
        set::significant(terrain.rms_slope, 3),
        set::with_unit(terrain.relief_m, 3, "m"),
        exaggeration_words(style.exaggeration)
    );
    Words { id: slug(&format!("relief-{}", terrain.terrain_id)), title: format!("Group {group}."), caption }
}
