//! Whether a synthetic texture looks like what it was fitted to: residual and texture side by side at one scale and in one
//! colour range, their spectra and height distributions in one frame.

use super::Question;
use super::curves::{self, Curve};
use super::relief::{Style, Words, deviations, exaggeration, limit_m, middle_range, relief};
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, Size, TableBlock, slug};
use crate::data::{self, Data};
use crate::render::svg::{Paint, Stroke};
use crate::render::{number as set, thin};
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::{HeightDistributionRow, PsdRow, TerrainRow};

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "texture",
    name: "Texture",
    title: "Does the synthetic texture look like the measured one?",
    answer,
};

/// Textures that are drawn; all are in the table.
const TEXTURES_MAX: usize = 4;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let on_base = |t: &&TerrainRow| data::parameter(t, "onto").is_some();
    let (based, mut textures): (Vec<&TerrainRow>, Vec<_>) = data.of_stage("texture").partition(on_base);
    textures.extend(based);
    let mut blocks = Vec::new();
    for texture in textures.iter().take(TEXTURES_MAX) {
        let rows = figures(data, texture)?;
        if rows.iter().any(|row| !row.is_empty()) {
            blocks.push(Block::Heading(heading(texture)));
            blocks.extend(rows.into_iter().map(Block::Figures));
        }
    }
    if textures.len() > TEXTURES_MAX {
        blocks.push(Block::Text(format!("The first {TEXTURES_MAX} of {} textures are drawn.", textures.len())));
    }
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

fn heading(texture: &TerrainRow) -> String {
    match data::parameter(texture, "onto") {
        Some(base) => format!("Texture {} on {base}", texture.terrain_id),
        None => format!("Texture {}", texture.terrain_id),
    }
}

/// Figures by row. A texture on a base is shown as relief; one that stands alone beside the residual of its fit.
fn figures(data: &Data, texture: &TerrainRow) -> Result<Vec<Vec<Figure>>, ReportError> {
    let fit = data::parameter(texture, "fit").unwrap_or_default();
    if let Some(base) = data::parameter(texture, "onto") {
        return Ok(vec![on_base(data, texture, &base, &fit)?]);
    }
    let curves = [spectra(data, texture, &fit), distributions(data, texture, &fit)];
    Ok(vec![patches(data, texture, &fit)?, curves.into_iter().flatten().collect()])
}

/// The base and the base with its texture, in one range of heights.
fn on_base(data: &Data, texture: &TerrainRow, base: &str, fit: &str) -> Result<Vec<Figure>, ReportError> {
    let base_path = data.terrain(base).map_or("", |t| t.path.as_str());
    let Some(range_m) = middle_range(data, &[base_path, &texture.path])? else { return Ok(Vec::new()) };
    let style = Some(Style { range_m, exaggeration: exaggeration(texture.rms_slope), pixels: 400 });
    let words = |what: &str, title: &str, caption: String| Words {
        id: slug(&format!("{what}-{}", texture.terrain_id)),
        title: title.into(),
        caption,
    };
    let mut figures = Vec::new();
    figures.extend(relief(data, base_path, style, words("base", "Base.", format!("{base}, as it was generated.")))?);
    let caption = format!("{}: {base} with the texture of fit {fit}; same colours and light.", texture.terrain_id);
    figures.extend(relief(data, &texture.path, style, words("textured", "Base with texture.", caption))?);
    Ok(figures)
}

/// Measured residual and synthetic texture: the middle of each, of one size in metres, in one colour range.
fn patches(data: &Data, texture: &TerrainRow, fit: &str) -> Result<Vec<Figure>, ReportError> {
    let Some(synthetic) = data.files.grid(&texture.path)? else { return Ok(Vec::new()) };
    let residual_path = format!("fit/{fit}.residual.tif");
    let measured = data.files.grid(&residual_path)?;
    let size = common_size(&synthetic, measured.as_ref());
    let (synthetic, measured) = (thin::centre(&synthetic, size), measured.map(|m| thin::centre(&m, size)));
    let limit = measured.iter().chain([&synthetic]).map(limit_m).filter(|v| *v > 0.0).fold(0.0, f64::max);
    let ground = format!("{} × {} m from the middle", set::significant(size[0], 3), set::significant(size[1], 3));
    let words = |what: &str, title: &str, caption: String| Words {
        id: slug(&format!("{what}-{}", texture.terrain_id)),
        title: title.into(),
        caption,
    };
    let mut figures = Vec::new();
    if let Some(measured) = measured {
        let caption = format!("Residual of fit {fit}, {ground}; grey cells did not enter the fit.");
        figures.extend(deviations(
            &measured,
            &residual_path,
            limit,
            "not used",
            words("measured", "Measured.", caption),
        )?);
    }
    let caption = format!("{}, {ground}; same scale, same colours.", texture.terrain_id);
    figures.extend(deviations(&synthetic, &texture.path, limit, "no data", words("synthetic", "Synthetic.", caption))?);
    Ok(figures)
}

/// The largest square that both grids hold, m.
fn common_size(a: &Grid, b: Option<&Grid>) -> [f64; 2] {
    let sides = [Some(a), b].into_iter().flatten().flat_map(|g| g.geometry.size());
    [sides.fold(f64::INFINITY, f64::min); 2]
}

const MEASURED: Stroke = Stroke { paint: Paint::Ink, width: 2.2, dash: "", opacity: 0.75 };
const SYNTHETIC: Stroke = Stroke { paint: Paint::Series(1), width: 1.8, dash: "6 3", opacity: 1.0 };

/// Curves of the residual (stored under the id of its fit) and of the texture.
fn pair(fit: &str, texture: &TerrainRow, points: impl Fn(&str) -> Vec<(f64, f64)>) -> Vec<Curve> {
    let curve = |name: &str, id: &str, stroke| Curve { name: Some(name.into()), stroke, points: points(id) };
    let curves = [curve("measured residual", fit, MEASURED), curve("synthetic", &texture.terrain_id, SYNTHETIC)];
    curves.into_iter().filter(|c| c.points.len() > 1).collect()
}

fn spectra(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    let curves = pair(fit, texture, |id| curves::spectrum(&data.spectrum(id)));
    let id = slug(&format!("psd-{}", texture.terrain_id));
    let plot = (!curves.is_empty()).then(|| curves::spectra(&id, &curves, curves::ranges(&curves), None))?;
    let rows: Vec<&PsdRow> = [fit, &texture.terrain_id].into_iter().flat_map(|id| data.spectrum(id)).collect();
    let names = ["terrain_id", "bin", "frequency_cycles_m", "psd_m4", "modes"];
    let query = format!("tables/psd where terrain_id in ('{fit}', '{}')", texture.terrain_id);
    Some(Figure {
        id,
        title: "Spectra.".into(),
        caption: with_measured(
            "Radially averaged two-dimensional power spectral density.",
            "The moving average has taken the lowest frequencies out of the measured residual, not out of the texture.",
            &curves,
        ),
        description: format!("Log-log spectra of {}.", names_of(&curves)),
        svg: plot.svg,
        size: Size::Column,
        numbers: Numbers::select(query, rows, &names),
    })
}

fn distributions(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    let curves = pair(fit, texture, |id| curves::histogram(&data.histogram(id)));
    let id = slug(&format!("heights-{}", texture.terrain_id));
    let plot = (!curves.is_empty()).then(|| curves::distributions(&id, &curves, curves::ranges(&curves)))?;
    let rows: Vec<&HeightDistributionRow> =
        [fit, &texture.terrain_id].into_iter().flat_map(|id| data.histogram(id)).collect();
    let names = ["terrain_id", "bin", "low_m", "high_m", "cells", "density_per_m"];
    let query = format!("tables/height_distribution where terrain_id in ('{fit}', '{}')", texture.terrain_id);
    Some(Figure {
        id,
        title: "Heights.".into(),
        caption: with_measured("Height distributions.", "Trimmed outliers are missing from the measured one.", &curves),
        description: format!("Height distributions of {}.", names_of(&curves)),
        svg: plot.svg,
        size: Size::Column,
        numbers: Numbers::select(query, rows, &names),
    })
}

/// The words, and what to mind about the measured curve where there is one.
fn with_measured(words: &str, measured: &str, curves: &[Curve]) -> String {
    if curves.len() > 1 { format!("{words} {measured}") } else { words.to_owned() }
}

fn names_of(curves: &[Curve]) -> String {
    curves.iter().filter_map(|c| c.name.clone()).collect::<Vec<_>>().join(" and ")
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "terrain_id",
        "group",
        "kind",
        "rows",
        "cols",
        "cell_x_m",
        "cell_y_m",
        "rms_height_m",
        "rms_slope",
        "skewness",
        "kurtosis",
        "path",
    ];
    let numbers = Numbers::select("tables/terrains where stage = 'texture'", data.of_stage("texture"), &names);
    TableBlock { id: "textures".into(), caption: "All textures".into(), numbers }
}
