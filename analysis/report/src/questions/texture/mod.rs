//! Whether a synthetic texture looks like the surface it was fitted to: residual and texture side by side at the same scale and
//! colours, their spectra, height distributions and structure functions in one frame, their surface parameters in one table.
//!
//! A residual lacks what the moving average removed; a texture does not. The two are comparable if the texture went through the
//! same detrending and trimming (`<texture>.residual`).

mod figures;
mod verdict;

use super::Question;
use super::curves::{self, Curve};
use super::relief::{Style, Words, deviations, exaggeration_words, limit_m, middle_range, relief, relief_of};
use super::sql::quoted;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, slug};
use crate::data::{self, Data, TEXTURES_DRAWN};
use crate::render::chart::Plot;
use crate::render::svg::{Paint, Stroke};
use crate::render::{number as set, thin};
use crate::sample::{ROWS_MAX, sample};
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::TerrainRow;
use verdict::Answer;

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "texture",
    name: "Texture",
    title: "Does the synthetic texture look like the measured one?",
    answer,
};

/// Tiles along each side of the picture of a repeated texture.
const TILES: usize = 3;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let textures = data::textures(&data.terrains);
    let mut blocks = Vec::new();
    for texture in textures.iter().take(TEXTURES_DRAWN) {
        let rows = figures(data, texture)?;
        if rows.iter().any(|row| !row.is_empty()) {
            blocks.push(Block::Heading(heading(texture)));
            let fit = alone(texture);
            let answer = fit.as_ref().and_then(|fit| verdict::of_texture(data, texture, fit));
            if let Some((_, sentence)) = answer {
                blocks.extend([sentence, verdict::method()].map(Block::Text));
            }
            blocks.extend(rows.into_iter().map(Block::Figures));
            blocks.extend(fit.map(|fit| Block::Table(figures::table(data, texture, &fit))));
        }
    }
    if textures.len() > TEXTURES_DRAWN {
        let all = textures.len();
        let words = format!("The first {TEXTURES_DRAWN} of {all} textures are drawn; the table lists all.");
        blocks.push(Block::Text(words));
    }
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

/// The fit of a texture that is not placed onto a base.
fn alone(texture: &TerrainRow) -> Option<String> {
    data::parameter(texture, "fit").filter(|_| data::parameter(texture, "onto").is_none())
}

/// The factor on the heights in the file of a texture; `None` if it is 1. The residual of the texture is taken before, so that it can be
/// compared with that of the fit.
fn amplitude(texture: &TerrainRow) -> Option<f64> {
    let params: serde_json::Value = serde_json::from_str(&texture.params).ok()?;
    params.get("amplitude")?.as_f64().filter(|factor| *factor != 1.0)
}

/// To which heights a comparison of residuals applies, after a sentence about them; empty at amplitude 1.
fn at_amplitude(texture: &TerrainRow) -> String {
    let words =
        |factor: f64| format!(" This is at amplitude 1; the file has {} times these heights.", set::plain(factor, 4));
    amplitude(texture).map_or_else(String::new, words)
}

/// Name of the surface in the file of a texture.
fn synthesised(texture: &TerrainRow) -> String {
    let words = |factor: f64| format!("as synthesised, times {}", set::plain(factor, 4));
    amplitude(texture).map_or_else(|| "as synthesised".to_owned(), words)
}

/// Textures that are not placed onto a base, each with its fit.
fn standing_alone(data: &Data) -> impl Iterator<Item = (&TerrainRow, String)> {
    data.of_stage("texture").filter_map(|texture| Some((texture, alone(texture)?)))
}

/// Whether the textures match the measured surfaces: their numbers, and the sentence on the first that does not match, or else on the first
/// one. `None` if none can be compared.
pub(super) fn in_words(data: &Data) -> Option<String> {
    let answers: Vec<(&TerrainRow, Answer, String)> = standing_alone(data)
        .filter_map(|(texture, fit)| {
            verdict::of_texture(data, texture, &fit).map(|(answer, sentence)| (texture, answer, sentence))
        })
        .collect();
    let worst = answers.iter().find(|a| a.1 == Answer::No).or(answers.first())?;
    let quoted = format!("Does texture {} match the surface it was fitted to? {}", worst.0.terrain_id, worst.2);
    let kinds = [
        (Answer::Yes, "1 matches", "match"),
        (Answer::No, "1 does not match", "do not match"),
        (Answer::CannotTell, "1 is undecided", "are undecided"),
    ];
    let part = |(answer, one, many): (Answer, &str, &str)| match answers.iter().filter(|a| a.1 == answer).count() {
        0 => None,
        1 => Some(one.to_owned()),
        n => Some(format!("{} {many}", set::count(n))),
    };
    let parts: Vec<String> = kinds.into_iter().filter_map(part).collect();
    Some(match answers.len() {
        1 => quoted,
        n => format!(
            "Of {} textures compared with their measured surfaces, {}. {quoted}",
            set::count(n),
            parts.join(", ")
        ),
    })
}

/// The first texture without a base, next to the residual of its fit; empty if the release has none.
pub(super) fn side_by_side(data: &Data) -> Result<Vec<Figure>, ReportError> {
    standing_alone(data).next().map_or(Ok(Vec::new()), |(texture, fit)| patches(data, texture, &fit))
}

fn heading(texture: &TerrainRow) -> String {
    match data::parameter(texture, "onto") {
        Some(base) => format!("Texture {} on {base}", texture.terrain_id),
        None => format!("Texture {}", texture.terrain_id),
    }
}

/// Figures by row. A texture on a base is shown as relief; one without a base next to the residual of its fit.
fn figures(data: &Data, texture: &TerrainRow) -> Result<Vec<Vec<Figure>>, ReportError> {
    let fit = data::parameter(texture, "fit").unwrap_or_default();
    if let Some(base) = data::parameter(texture, "onto") {
        return Ok(vec![on_base(data, texture, &base, &fit)?]);
    }
    let charts = [
        spectra(data, texture, &fit),
        structures(data, texture, &fit),
        distributions(data, texture, &fit),
        profiles(data, texture, &fit),
    ];
    let mut pictures = patches(data, texture, &fit)?;
    pictures.extend(tiling(data, texture)?);
    Ok(vec![pictures, charts.into_iter().flatten().collect()])
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
    figures.extend(relief(data, base_path, style, words("base", "Base.", format!("{base}, as generated.")))?);
    let covariance = if fit.is_empty() { "of its stated covariance".into() } else { format!("of fit {fit}") };
    let caption = format!("{}: {base} with a texture {covariance}; same colours and light.", texture.terrain_id);
    figures.extend(relief(data, &texture.path, style, words("textured", "Base with texture.", caption))?);
    Ok(figures)
}

/// Measured residual and synthetic texture: the centre of each, with the same size in metres and the same colour range.
fn patches(data: &Data, texture: &TerrainRow, fit: &str) -> Result<Vec<Figure>, ReportError> {
    let Some(synthetic) = data.files.grid(&texture.path)? else { return Ok(Vec::new()) };
    let residual_path = format!("fit/{fit}.residual.tif");
    let measured = data.files.grid(&residual_path)?;
    let size = common_size(&synthetic, measured.as_ref());
    let (synthetic, measured) = (thin::centre(&synthetic, size), measured.map(|m| thin::centre(&m, size)));
    let limit = measured.iter().chain([&synthetic]).map(limit_m).filter(|v| *v > 0.0).fold(0.0, f64::max);
    let ground = format!("{} × {} m at the centre", set::significant(size[0], 3), set::significant(size[1], 3));
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
    let scaled =
        amplitude(texture).map_or_else(String::new, |factor| format!(", heights times {}", set::plain(factor, 4)));
    let caption = format!(
        "{}, {ground}{scaled}; same scale and colours. It is not detrended, so it still has its long waves.",
        texture.terrain_id
    );
    figures.extend(deviations(&synthetic, &texture.path, limit, "no data", words("synthetic", "Synthetic.", caption))?);
    Ok(figures)
}

/// The largest square that fits into both grids, m.
fn common_size(a: &Grid, b: Option<&Grid>) -> [f64; 2] {
    let sides = [Some(a), b].into_iter().flatten().flat_map(|g| g.geometry.size());
    [sides.fold(f64::INFINITY, f64::min); 2]
}

const MEASURED: Stroke = Stroke { paint: Paint::Ink, width: 2.4, dash: "", opacity: 0.75 };
const RESIDUAL: Stroke = Stroke { paint: Paint::Series(1), width: 1.9, dash: "6 3", opacity: 1.0 };
const SYNTHESISED: Stroke = Stroke { paint: Paint::Series(0), width: 1.4, dash: "2 3", opacity: 1.0 };

/// Surfaces drawn in one frame: name, id, line.
fn sides(fit: &str, texture: &TerrainRow) -> [(String, String, Stroke); 3] {
    [
        ("measured residual".into(), fit.to_owned(), MEASURED),
        ("synthetic, residual".into(), figures::residual_id(texture), RESIDUAL),
        (synthesised(texture), texture.terrain_id.clone(), SYNTHESISED),
    ]
}

/// Curves of the residual (stored under the id of its fit) and of the texture.
fn together(fit: &str, texture: &TerrainRow, points: impl Fn(&str) -> Vec<(f64, f64)>) -> Vec<Curve> {
    let curve = |(name, id, stroke): (String, String, Stroke)| Curve { name: Some(name), stroke, points: points(&id) };
    sides(fit, texture).into_iter().map(curve).filter(|c| c.points.len() > 1).collect()
}

/// The ids of a frame, as a list for a query.
fn ids(fit: &str, texture: &TerrainRow) -> String {
    sides(fit, texture).map(|(_, id, _)| quoted(&id)).join(", ")
}

/// The chart of one kind of curve.
struct Chart<'a> {
    what: &'a str,
    title: &'a str,
    caption: &'a str,
    measured: &'a str,
}

impl Chart<'_> {
    fn figure(&self, texture: &TerrainRow, curves: &[Curve], plot: Plot, numbers: Numbers) -> Figure {
        Figure {
            id: slug(&format!("{}-{}", self.what, texture.terrain_id)),
            title: self.title.into(),
            caption: format!("{}{}", with_measured(self.caption, self.measured, curves), residual_note(texture)),
            description: format!("{} {}.", self.caption, names_of(curves)),
            svg: plot.svg,
            numbers,
        }
    }
}

fn spectra(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    let curves = together(fit, texture, |id| curves::spectrum(&data.spectrum(id)));
    let id = slug(&format!("psd-{}", texture.terrain_id));
    let plot = (!curves.is_empty()).then(|| curves::spectra(&id, &curves, curves::ranges(&curves), None))?;
    let rows = sides(fit, texture).into_iter().flat_map(|(_, id, _)| data.spectrum(&id));
    let names = ["surface_id", "bin", "frequency_cycles_m", "psd_m4", "modes"];
    let query = format!("surface_id in ({}) and frequency_cycles_m > 0 and psd_m4 > 0", ids(fit, texture));
    let chart = Chart {
        what: "psd",
        title: "Spectra.",
        caption: "Radially averaged two-dimensional power spectral density.",
        measured: "The moving average has removed the lowest frequencies from both residuals, that of the DEM and that of the \
                   texture.",
    };
    Some(chart.figure(texture, &curves, plot, Numbers::select(&query, rows, &names)))
}

fn distributions(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    let curves = together(fit, texture, |id| curves::histogram(&data.histogram(id)));
    let id = slug(&format!("heights-{}", texture.terrain_id));
    let plot = (!curves.is_empty()).then(|| curves::distributions(&id, &curves, curves::ranges(&curves)))?;
    let rows = sides(fit, texture).into_iter().flat_map(|(_, id, _)| data.histogram(&id));
    let names = ["surface_id", "bin", "low_m", "high_m", "cells", "density_per_m"];
    let query = format!("surface_id in ({}) and isfinite(density_per_m)", ids(fit, texture));
    let chart = Chart {
        what: "heights",
        title: "Heights.",
        caption: "Height distributions.",
        measured: "The measured distribution ends at the trimming threshold.",
    };
    Some(chart.figure(texture, &curves, plot, Numbers::select(&query, rows, &names)))
}

fn structures(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    let points = |id: &str| data.structure_of(id, "all").iter().map(|r| (r.lag_m, r.value_m2)).collect();
    let curves = together(fit, texture, points);
    let id = slug(&format!("structure-{}", texture.terrain_id));
    let plot = (!curves.is_empty()).then(|| curves::log_log(&id, &curves, "lag, m", "mean squared increment, m²"))?;
    let rows = sides(fit, texture).into_iter().flat_map(|(_, id, _)| data.structure_of(&id, "all"));
    let names = ["surface_id", "direction", "bin", "lag_m", "value_m2", "pairs"];
    let query = format!("direction = 'all' and lag_m > 0 and value_m2 > 0 and surface_id in ({})", ids(fit, texture));
    let chart = Chart {
        what: "structure",
        title: "Structure functions.",
        caption: "Mean squared height difference against lag, over all directions.",
        measured: "Those of the residuals level off at the window of the moving average.",
    };
    Some(chart.figure(texture, &curves, plot, Numbers::select(&query, rows, &names)))
}

/// Profile spectra along both axes, of the two residuals.
fn profiles(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    let residual = figures::residual_id(texture);
    let surfaces = [("measured", fit, MEASURED.paint), ("synthetic", residual.as_str(), RESIDUAL.paint)];
    let axes = [("x", "east-west", ""), ("y", "north-south", "5 3")];
    let curve = |(name, id, paint): (&str, &str, Paint), (axis, words, dash): (&str, &str, &'static str)| Curve {
        name: Some(format!("{name}, {words}")),
        stroke: Stroke::new(paint, 1.8).dashed(dash).faint(0.85),
        points: data.profile_spectrum(id, axis).iter().map(|r| (r.frequency_cycles_m, r.psd_m3)).collect(),
    };
    let curves: Vec<Curve> = surfaces
        .into_iter()
        .flat_map(|surface| axes.map(|axis| curve(surface, axis)))
        .filter(|c| c.points.len() > 1)
        .collect();
    let id = slug(&format!("profiles-{}", texture.terrain_id));
    let titles = ("spatial frequency, cycles/m", "power spectral density, m³");
    let plot = (!curves.is_empty()).then(|| curves::log_log(&id, &curves, titles.0, titles.1))?;
    let rows = surfaces.into_iter().flat_map(|(_, id, _)| axes.map(|(axis, _, _)| data.profile_spectrum(id, axis)));
    let names = ["surface_id", "direction", "bin", "frequency_cycles_m", "psd_m3", "modes"];
    let query =
        format!("surface_id in ({}, {}) and frequency_cycles_m > 0 and psd_m3 > 0", quoted(fit), quoted(&residual));
    let chart = Chart {
        what: "profiles",
        title: "Spectra of profiles.",
        caption: "One-dimensional power spectral density, averaged over all rows and over all columns.",
        measured: "",
    };
    Some(chart.figure(texture, &curves, plot, Numbers::select(&query, rows.flatten(), &names)))
}

/// The texture tiled three by three, if it is periodic.
fn tiling(data: &Data, texture: &TerrainRow) -> Result<Option<Figure>, ReportError> {
    let repeats = serde_json::from_str::<serde_json::Value>(&texture.params)
        .is_ok_and(|p| p.get("periodic").and_then(serde_json::Value::as_bool).unwrap_or(true));
    let Some(grid) = data.files.grid(&texture.path)?.filter(|_| repeats) else { return Ok(None) };
    let tiled = thin::tiled(&grid, TILES, 450);
    let limit = limit_m(&grid);
    let style = Style { range_m: (-limit, limit), exaggeration: exaggeration(texture.rms_slope), pixels: 450 };
    let shading = exaggeration_words(style.exaggeration);
    let words = Words {
        id: slug(&format!("tiles-{}", texture.terrain_id)),
        title: "Tiled three by three.".into(),
        caption: format!(
            "{} repeated in both directions, as shaded relief; a seam would show as a line at a third of the side.{shading}",
            texture.terrain_id
        ),
    };
    relief_of(&tiled, &texture.path, Some(style).filter(|s| s.range_m.0 < s.range_m.1), words)
}

/// What a caption says about curves of the residual of a texture whose heights were scaled.
fn residual_note(texture: &TerrainRow) -> &'static str {
    if amplitude(texture).is_some() { " The residual of the texture is that at amplitude 1." } else { "" }
}

/// The caption, with the note on the measured curve if there is one.
fn with_measured(words: &str, measured: &str, curves: &[Curve]) -> String {
    if curves.len() > 1 && !measured.is_empty() { format!("{words} {measured}") } else { words.to_owned() }
}

fn names_of(curves: &[Curve]) -> String {
    curves.iter().filter_map(|c| c.name.clone()).collect::<Vec<_>>().join("; ")
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
    let all: Vec<&TerrainRow> = data.of_stage("texture").collect();
    let count = all.len();
    let listed = sample(all, ROWS_MAX, &mut data.stream("textures", "listed"));
    let numbers = Numbers::select("stage = 'texture'", listed, &names).of_all(count);
    TableBlock { id: "textures".into(), caption: "All textures".into(), numbers }
}
