//! What the textures are like, and whether they match the surface they were fitted to: residual and texture side by side at the same scale
//! and colours, their spectra, height distributions and structure functions in one frame, their surface parameters in one table.
//!
//! A residual lacks what the moving average removed; a texture does not. The two are comparable if the texture went through the
//! same detrending and trimming (`<texture>.residual`). A texture on a base or in the holes of a DEM is not compared: it is drawn before and
//! after.

mod figures;
mod order;
mod pictures;
mod verdict;

use super::Question;
use super::curves::{self, Curve};
use super::sql::quoted;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, Section, TableBlock, slug};
use crate::data::{self, Data};
use crate::render::chart::Plot;
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke};
use crate::sample::{ROWS_MAX, sample};
use order::{Judged, TEXTURES_DRAWN, in_order};
use sastrugi_schemas::tables::TerrainRow;
use verdict::Answer;

pub(crate) use order::undrawn;

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "texture", name: "Texture", title: "What are the textures like?", answer };

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let textures = in_order(data);
    let first = &textures[..textures.len().min(TEXTURES_DRAWN)];
    // The result begins the section, so the first texture needs no answer of its own.
    let of_place = |(place, one)| of_texture(data, one, place > 0);
    let drawn = first.iter().enumerate().map(of_place).collect::<Result<Vec<_>, _>>()?;
    let count = drawn.iter().filter(|blocks| !blocks.is_empty()).count();
    let mut blocks: Vec<Block> = in_words(&textures).map(Block::Result).into_iter().collect();
    blocks.extend(drawn.into_iter().flatten());
    blocks.extend(left_out(count, textures.len()).map(Block::Text));
    let judged: Vec<&TerrainRow> = first.iter().filter(|one| one.verdict.is_some()).map(|one| one.texture).collect();
    if !judged.is_empty() {
        blocks.push(Block::Heading("How the answers are reached".into()));
        blocks.extend(verdict::method(&judged).map(Block::Text));
    }
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

/// How many of the textures are drawn; `None` if all or none are.
fn left_out(drawn: usize, all: usize) -> Option<String> {
    let order = if all > TEXTURES_DRAWN {
        ": one of each group before a second one, and first those that do not match the measured surface"
    } else {
        ""
    };
    (0 < drawn && drawn < all).then(|| {
        format!(
            "{} of {} {} drawn{order}. The table lists all.",
            set::count(drawn),
            set::counted(all, "texture"),
            if drawn == 1 { "is" } else { "are" }
        )
    })
}

/// The answer on a texture, its figures and its table; nothing where the release has no figure of it.
fn of_texture(data: &Data, one: &Judged<'_>, with_answer: bool) -> Result<Vec<Block>, ReportError> {
    let rows = figures(data, one.texture)?;
    if rows.iter().all(Vec::is_empty) {
        return Ok(Vec::new());
    }
    let mut blocks = vec![Block::Heading(heading(one.texture))];
    let question = "Does it match the measured surface?";
    blocks.extend(
        one.verdict.iter().filter(|_| with_answer).map(|(_, sentence)| Block::Text(format!("{question} {sentence}"))),
    );
    blocks.extend(rows.into_iter().map(Block::Figures));
    blocks.extend(alone(one.texture).map(|fit| Block::Table(figures::table(data, one.texture, &fit))));
    Ok(blocks)
}

/// The surface that a texture was added to: a base, or the DEM whose holes it fills.
fn base(texture: &TerrainRow) -> Option<String> {
    data::parameter(texture, "onto").or_else(|| data::parameter(texture, "fill"))
}

/// The fit onto whose background a texture was laid.
fn background(texture: &TerrainRow) -> Option<String> {
    let params: serde_json::Value = serde_json::from_str(&texture.params).ok()?;
    params.get("onto")?.get("background")?.as_str().map(str::to_owned)
}

/// The fit of a texture that was not added to a surface.
fn alone(texture: &TerrainRow) -> Option<String> {
    data::parameter(texture, "fit").filter(|_| base(texture).is_none())
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
    let name = if background(texture).is_some() { "on the background" } else { "as synthesised" };
    let words = |factor: f64| format!("{name}, times {}", set::plain(factor, 4));
    amplitude(texture).map_or_else(|| name.to_owned(), words)
}

/// Whether the textures match the measured surfaces: their numbers, and the sentence on the first that is drawn, which does not match if any
/// does not. `None` if none can be compared.
fn in_words(textures: &[Judged<'_>]) -> Option<String> {
    let judged = |one: &Judged<'_>| one.verdict.as_ref().map(|(answer, _)| *answer);
    let answers: Vec<Answer> = textures.iter().filter_map(judged).collect();
    let (id, sentence) = textures.iter().find_map(|one| Some((&one.texture.terrain_id, &one.verdict.as_ref()?.1)))?;
    let quoted = format!("Does texture {id} match the surface it was fitted to? {sentence}");
    let kinds = [
        (Answer::Yes, "1 matches", "match"),
        (Answer::No, "1 does not match", "do not match"),
        (Answer::CannotTell, "1 is undecided", "are undecided"),
    ];
    let part = |(answer, one, many): (Answer, &str, &str)| match answers.iter().filter(|a| **a == answer).count() {
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

/// The first drawn texture that was not added to a surface, next to the residual of its fit if it has one; empty without one.
pub(super) fn side_by_side(section: &Section) -> Vec<Figure> {
    let patches = |block: &Block| match block {
        Block::Figures(figures) => figures.iter().filter(|f| pictures::is_patch(f)).cloned().collect(),
        _ => Vec::new(),
    };
    section.blocks.iter().map(patches).find(|patches: &Vec<Figure>| !patches.is_empty()).unwrap_or_default()
}

fn heading(texture: &TerrainRow) -> String {
    let id = &texture.terrain_id;
    match (data::parameter(texture, "onto"), data::parameter(texture, "fill"), background(texture)) {
        (Some(base), ..) => format!("Texture {id} on {base}"),
        (_, Some(dem), _) => format!("Texture {id} in the holes of {dem}"),
        (.., Some(fit)) => format!("Texture {id} on the background of {fit}"),
        _ => format!("Texture {id}"),
    }
}

/// Figures by row. A texture on a base, or in the holes of a DEM, is shown as relief; any other next to the residual of its fit.
fn figures(data: &Data, texture: &TerrainRow) -> Result<Vec<Vec<Figure>>, ReportError> {
    let fit = data::parameter(texture, "fit").unwrap_or_default();
    if let Some(base) = data::parameter(texture, "onto") {
        return Ok(vec![pictures::on_base(data, texture, &base, &fit)?]);
    }
    if let Some(dem) = data::parameter(texture, "fill") {
        return Ok(vec![pictures::in_holes(data, texture, &dem)?]);
    }
    let charts = [
        spectra(data, texture, &fit),
        structures(data, texture, &fit),
        distributions(data, texture, &fit),
        profiles(data, texture, &fit),
    ];
    let mut row = pictures::patches(data, texture, &fit)?;
    row.extend(pictures::tiling(data, texture)?);
    Ok(vec![row, charts.into_iter().flatten().collect()])
}

const MEASURED: Stroke = Stroke { paint: Paint::Ink, width: 2.4, dash: "", opacity: 0.75 };
const RESIDUAL: Stroke = Stroke { paint: Paint::Series(1), width: 1.9, dash: "6 3", opacity: 1.0 };
const SYNTHESISED: Stroke = Stroke { paint: Paint::Series(0), width: 1.4, dash: "2 3", opacity: 1.0 };

/// Names of the curves of residuals.
const RESIDUALS: [&str; 2] = ["measured residual", "synthetic, residual"];
/// Start of the names of curves of the residual of the texture.
const SYNTHETIC: &str = "synthetic";

/// Surfaces drawn in one frame: name, id, line. The file of a texture on a background is left out: its curve would be that of the background.
fn sides(fit: &str, texture: &TerrainRow) -> Vec<(String, String, Stroke)> {
    let [measured, residual] = RESIDUALS.map(str::to_owned);
    let mut sides = Vec::new();
    if !fit.is_empty() {
        sides.push((measured, fit.to_owned(), MEASURED));
        sides.push((residual, figures::residual_id(texture), RESIDUAL));
    }
    if background(texture).is_none() {
        sides.push((synthesised(texture), texture.terrain_id.clone(), SYNTHESISED));
    }
    sides
}

/// Curves of the residual (stored under the id of its fit) and of the texture; none if there is no curve of the texture.
fn together(fit: &str, texture: &TerrainRow, points: impl Fn(&str) -> Vec<(f64, f64)>) -> Vec<Curve> {
    let curve = |(name, id, stroke): (String, String, Stroke)| Curve { name: Some(name), stroke, points: points(&id) };
    let curves: Vec<Curve> = sides(fit, texture).into_iter().map(curve).filter(|c| c.points.len() > 1).collect();
    let is_texture = |c: &Curve| c.name.as_deref() != Some(RESIDUALS[0]);
    if curves.iter().any(is_texture) { curves } else { Vec::new() }
}

/// The ids of a frame, as a list for a query.
fn ids(fit: &str, texture: &TerrainRow) -> String {
    sides(fit, texture).into_iter().map(|(_, id, _)| quoted(&id)).collect::<Vec<_>>().join(", ")
}

/// The chart of one kind of curve.
struct Chart<'a> {
    what: &'a str,
    title: &'a str,
    caption: &'a str,
    /// Holds where both residuals are drawn.
    of_residuals: &'a str,
}

impl Chart<'_> {
    fn figure(&self, texture: &TerrainRow, curves: &[Curve], plot: Plot, numbers: Numbers) -> Figure {
        Figure {
            id: slug(&format!("{}-{}", self.what, texture.terrain_id)),
            title: self.title.into(),
            caption: self.caption(texture, curves),
            description: format!("{} {}.", self.caption, names_of(curves)),
            svg: plot.svg,
            numbers,
        }
    }

    /// The caption, with what it has to say about residuals that are drawn.
    fn caption(&self, texture: &TerrainRow, curves: &[Curve]) -> String {
        let has = |name: &str| curves.iter().any(|c| c.name.as_deref().is_some_and(|drawn| drawn.starts_with(name)));
        let has_both = RESIDUALS.into_iter().all(has) && !self.of_residuals.is_empty();
        let note = if has_both { format!(" {}", self.of_residuals) } else { String::new() };
        let scaled = if has(SYNTHETIC) { residual_note(texture) } else { "" };
        format!("{}{note}{scaled}", self.caption)
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
        of_residuals: "The moving average has removed the lowest frequencies from both residuals, that of the DEM and that of the texture.",
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
        of_residuals: "The measured distribution ends at the trimming threshold.",
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
        of_residuals: "Those of the residuals level off at the window of the moving average.",
    };
    Some(chart.figure(texture, &curves, plot, Numbers::select(&query, rows, &names)))
}

/// Profile spectra along both axes, of the two residuals; `None` without that of the texture.
fn profiles(data: &Data, texture: &TerrainRow, fit: &str) -> Option<Figure> {
    // A texture with a stated covariance has no residual.
    if fit.is_empty() {
        return None;
    }
    let residual = figures::residual_id(texture);
    let surfaces = [("measured", fit, MEASURED.paint), (SYNTHETIC, residual.as_str(), RESIDUAL.paint)];
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
    let is_texture = |c: &Curve| c.name.as_deref().is_some_and(|name| name.starts_with(SYNTHETIC));
    let plot = curves.iter().any(is_texture).then(|| curves::log_log(&id, &curves, titles.0, titles.1))?;
    let rows = surfaces.into_iter().flat_map(|(_, id, _)| axes.map(|(axis, _, _)| data.profile_spectrum(id, axis)));
    let names = ["surface_id", "direction", "bin", "frequency_cycles_m", "psd_m3", "modes"];
    let query =
        format!("surface_id in ({}, {}) and frequency_cycles_m > 0 and psd_m3 > 0", quoted(fit), quoted(&residual));
    let chart = Chart {
        what: "profiles",
        title: "Spectra of profiles.",
        caption: "One-dimensional power spectral density, averaged over all rows and over all columns.",
        of_residuals: "",
    };
    Some(chart.figure(texture, &curves, plot, Numbers::select(&query, rows.flatten(), &names)))
}

/// What a caption says about curves of the residual of a texture whose heights were scaled.
fn residual_note(texture: &TerrainRow) -> &'static str {
    if amplitude(texture).is_some() { " The residual of the texture is that at amplitude 1." } else { "" }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;
    use sastrugi_schemas::tables::SurfaceRow;

    /// The blocks on a release whose texture has these parameters and is changed by `change`.
    fn blocks(params: &str, change: fn(&mut Data)) -> Vec<Block> {
        let mut data = made_up::full(1, 24);
        data.terrains.iter_mut().filter(|t| t.stage == "texture").for_each(|t| t.params = params.into());
        change(&mut data);
        answer(&data).unwrap()
    }

    fn figures_of(blocks: &[Block]) -> Vec<&Figure> {
        blocks
            .iter()
            .filter_map(|b| if let Block::Figures(figures) = b { Some(figures) } else { None })
            .flatten()
            .collect()
    }

    fn texts_of(blocks: &[Block]) -> String {
        let text = |block: &Block| match block {
            Block::Heading(text) | Block::Text(text) | Block::Result(text) => Some(text.clone()),
            _ => None,
        };
        blocks.iter().filter_map(text).collect::<Vec<_>>().join("\n")
    }

    /// Of a texture with a stated covariance there is neither a measured surface nor a residual, and no caption names one.
    #[test]
    fn val_a_texture_without_a_site_is_not_compared_with_one() {
        let blocks = blocks(r#"{"fit":{"model":"exponential"},"method":"fft_ma"}"#, |_| ());
        let figures = figures_of(&blocks);
        let ids: Vec<&str> = figures.iter().map(|f| f.id.as_str()).collect();
        assert_eq!(ids, ["synthetic-texture", "tiles-texture", "psd-texture", "structure-texture", "heights-texture"]);
        for figure in figures {
            let words = format!("{} {} {}", figure.caption, figure.description, figure.numbers.query);
            assert!(["easured", "esidual", "''"].iter().all(|word| !words.contains(word)), "{words}");
        }
        assert!(!texts_of(&blocks).contains("match"), "{}", texts_of(&blocks));
    }

    /// Without the residual of the texture, nothing is said of it.
    #[test]
    fn val_captions_and_columns_name_only_what_there_is() {
        let with = blocks(r#"{"fit":"jacksboro-corrected"}"#, |_| ());
        let without = blocks(r#"{"fit":"jacksboro-corrected"}"#, |data| {
            data.surfaces.retain(|row| row.surface_id != "texture.residual");
            data.structure.retain(|row| row.surface_id != "texture.residual");
            data.profile_psd.retain(|row| row.surface_id != "texture.residual");
            data.psd.retain(|row| row.surface_id != "texture.residual");
            data.heights.retain(|row| row.surface_id != "texture.residual");
        });
        let words = |blocks: &[Block]| {
            let tables =
                blocks.iter().filter_map(|b| if let Block::Table(t) = b { Some(t.caption.as_str()) } else { None });
            figures_of(blocks).iter().map(|f| f.caption.as_str()).chain(tables).collect::<Vec<_>>().join(" ")
        };
        let said = [
            "both residuals",
            "over all rows",
            "; texture after the same detrending and trimming; texture as synthesised",
        ];
        assert!(said.iter().all(|part| words(&with).contains(part)), "{}", words(&with));
        assert!(said.iter().all(|part| !words(&without).contains(part)), "{}", words(&without));
        assert!(words(&without).contains("Surface parameters: residual of the fit; texture as synthesised"));
    }

    /// A DEM whose holes were filled keeps its measured cells: it is drawn before and after, not compared with a residual.
    #[test]
    fn val_a_filled_dem_is_not_compared() {
        let blocks = blocks(r#"{"fit":"jacksboro-corrected","fill":"jacksboro"}"#, |_| ());
        let ids: Vec<&str> = figures_of(&blocks).iter().map(|f| f.id.as_str()).collect();
        assert_eq!(ids, ["holes-texture", "filled-texture"]);
        assert!(!blocks.iter().any(|block| matches!(block, Block::Table(_))));
        assert!(texts_of(&blocks).starts_with("Texture texture in the holes of jacksboro"), "{}", texts_of(&blocks));
    }

    /// Textures are counted as drawn if the release has figures of them.
    #[test]
    fn val_textures_without_figures_are_not_counted_as_drawn() {
        let blocks = blocks(r#"{"fit":{"model":"exponential"}}"#, |data| {
            let texture = data.of_stage("texture").next().unwrap().clone();
            data.terrains.push(TerrainRow { terrain_id: "u".into(), path: "texture/u.tif".into(), ..texture });
        });
        let texts = texts_of(&blocks);
        assert!(texts.contains("1 of 2 textures is drawn. The table lists all."), "{texts}");
        assert_eq!([left_out(2, 2), left_out(0, 2)], [None, None]);
        let four = left_out(TEXTURES_DRAWN, 12).unwrap();
        assert!(four.starts_with("4 of 12 textures are drawn: one of each group before a second one"), "{four}");
    }

    /// A texture on the background of a fit is compared; the curves are those of the residuals alone.
    #[test]
    fn val_a_texture_on_a_background_is_compared_without_it() {
        let params = r#"{"fit":"jacksboro-corrected","onto":{"background":"jacksboro-corrected"}}"#;
        let blocks = blocks(params, |_| ());
        let texts = texts_of(&blocks);
        assert!(
            texts.contains("on the background of jacksboro-corrected") && texts.contains("Does texture texture match"),
            "{texts}"
        );
        let figures = figures_of(&blocks);
        let heights = figures.iter().find(|f| f.id == "heights-texture").unwrap();
        assert_eq!(heights.description, "Height distributions. measured residual; synthetic, residual.");
        assert!(figures.iter().all(|f| !f.id.starts_with("tiles-")));
    }

    /// Every texture has its answer, the first at the beginning of the section, but how answers are reached is said once, at the end.
    #[test]
    fn val_the_method_is_stated_once() {
        let blocks = blocks(r#"{"fit":"jacksboro-corrected"}"#, |data| {
            let row = data.surface("texture.residual").unwrap().clone();
            let texture = data.of_stage("texture").next().unwrap().clone();
            for id in ["u", "v"] {
                data.terrains.push(TerrainRow {
                    terrain_id: id.into(),
                    kind: "wavelet_statistics".into(),
                    ..texture.clone()
                });
                let surface_id = format!("{id}.residual");
                data.surfaces.push(SurfaceRow { surface_id, ..row.clone() });
            }
        });
        let texts = texts_of(&blocks);
        assert_eq!(texts.matches(" match the surface it was fitted to?").count(), 1, "{texts}");
        assert_eq!(texts.matches("Does it match the measured surface?").count(), 2, "{texts}");
        assert_eq!(texts.matches("The probability of a wrong yes").count(), 1, "{texts}");
        let order =
            ["Texture v", "How the answers are reached", "Textures of fft_ma are", "Textures of wavelet_statistics"];
        let places: Vec<usize> = order.iter().map(|words| texts.find(words).unwrap()).collect();
        assert!(places.is_sorted(), "{places:?}");
    }
}
