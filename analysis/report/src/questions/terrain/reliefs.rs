//! Shaded relief of the smoothest, the median and the roughest terrain of each group, with the same light and colour range for
//! rasters of the same size with similar heights.

use super::{GROUPS_MAX, GROUPS_WITH_THREE, by_slope, median, shape, shapes};
use crate::ReportError;
use crate::content::{Block, Figure, slug};
use crate::data::{Data, Group};
use crate::questions::covariance;
use crate::questions::relief::{Style, Words, exaggeration_words, middle_range, relief};
use crate::render::number as set;
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_schemas::tables::TerrainRow;

/// A terrain to draw, its group, and why it was chosen.
type Choice<'a> = (&'a TerrainRow, String, &'static str);

/// One figure per terrain drawn.
pub fn figures(data: &Data, families: &[Vec<Group<TerrainRow>>]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    for family in families {
        let choices: Vec<Choice> = family.iter().flat_map(|g| choices(g, family.len())).collect();
        // A group may have rasters of several scales: each has its own light and colours.
        for shape_of in shapes(&choices.iter().map(|c| c.0).collect::<Vec<_>>()) {
            let alike: Vec<&Choice> = choices.iter().filter(|c| shape(c.0) == shape_of).collect();
            figures.extend(in_one_style(data, &alike)?);
        }
    }
    Ok(figures)
}

/// The measured DEMs that the section on fits does not draw, each in its own light and colours, and how many there are if not all are drawn.
pub fn of_dems(data: &Data) -> Result<Vec<Block>, ReportError> {
    let beside_fits = covariance::drawn(data);
    let dems: Vec<&TerrainRow> =
        data.of_stage("dem").filter(|t| !beside_fits.contains(t.terrain_id.as_str())).collect();
    let mut figures = Vec::new();
    for dem in dems.iter().copied().take(GROUPS_MAX) {
        let choice = (dem, dem.terrain_id.clone(), "measured");
        let Some(style) = style(data, &[&choice])? else { continue };
        let words = Words { title: format!("Measured DEM {}.", dem.terrain_id), ..words(&choice, style) };
        figures.extend(relief(data, &dem.path, Some(style), words)?);
    }
    let left_out = (dems.len() > GROUPS_MAX).then(|| {
        let others = if beside_fits.is_empty() { "" } else { "other " };
        format!(
            "The first {GROUPS_MAX} of {} {others}measured DEMs are drawn; the table has all.",
            set::count(dems.len())
        )
    });
    Ok(left_out.map(Block::Text).into_iter().chain([Block::Figures(figures)]).collect())
}

fn in_one_style(data: &Data, choices: &[&Choice]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    let Some(style) = style(data, choices)? else { return Ok(figures) };
    for choice in choices {
        figures.extend(relief(data, &choice.0.path, Some(style), words(choice, style))?);
    }
    Ok(figures)
}

fn choices<'a>(group: &Group<'a, TerrainRow>, groups: usize) -> Vec<Choice<'a>> {
    let rows = by_slope(group);
    let Some(last) = rows.len().checked_sub(1) else { return Vec::new() };
    let places: &[(usize, &str)] = match rows.len() {
        1 => &[(0, "the only terrain")],
        _ if groups > GROUPS_WITH_THREE => &[(last / 2, "median RMS slope")],
        2 => &[(0, "smoother"), (1, "rougher")],
        _ => &[(0, "smoothest"), (last / 2, "median RMS slope"), (last, "roughest")],
    };
    places.iter().map(|&(i, why)| (rows[i], group.name.clone(), why)).collect()
}

/// One style for all; `None` when no terrain has its heightfield in the release.
fn style(data: &Data, choices: &[&Choice]) -> Result<Option<Style>, ReportError> {
    let rows: Vec<&TerrainRow> = choices.iter().map(|c| c.0).collect();
    let paths: Vec<&str> = rows.iter().map(|t| t.path.as_str()).collect();
    let exaggeration = exaggeration(median(&rows, |t| t.rms_slope));
    let pixels = if rows.len() > 4 { 340 } else { 440 };
    Ok(middle_range(data, &paths)?.map(|range_m| Style { range_m, exaggeration, pixels }))
}

fn words((terrain, group, why): &Choice, style: Style) -> Words {
    let caption = format!(
        "{}, {why}: RMS slope {}, relief {}.{}",
        terrain.terrain_id,
        set::significant(terrain.rms_slope, 3),
        set::with_unit(terrain.relief_m, 3, "m"),
        exaggeration_words(style.exaggeration)
    );
    let id = slug(&format!("relief-{}", terrain.terrain_id));
    Words { id, title: format!("Group {group}."), caption }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;
    use sastrugi_schemas::tables::FitRow;

    /// The section on fits draws four DEMs; a fifth one, and others without a fit, are drawn here, twelve at most.
    #[test]
    fn val_dems_that_fits_do_not_draw_are_drawn() {
        let mut data = made_up::full(1, 24);
        let drawn = |data: &Data| match of_dems(data).unwrap().pop() {
            Some(Block::Figures(figures)) => figures.len(),
            _ => 0,
        };
        assert_eq!(drawn(&data), 0);
        let fit = data.fits[0].clone();
        data.fits.extend(["a", "b", "c", "d"].map(|dem| FitRow { dem_id: dem.into(), ..fit.clone() }));
        assert_eq!((drawn(&data), of_dems(&data).unwrap().len()), (1, 1));
        let dem = data.of_stage("dem").next().unwrap().clone();
        data.terrains.extend((0..12).map(|k| TerrainRow { terrain_id: format!("other-{k}"), ..dem.clone() }));
        let words = "The first 12 of 13 other measured DEMs are drawn; the table has all.";
        assert!(matches!(&of_dems(&data).unwrap()[0], Block::Text(text) if text == words));
        assert_eq!(drawn(&data), 12);
    }
}
