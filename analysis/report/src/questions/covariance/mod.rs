//! How well each fit describes its measured DEM: a verdict, the covariance with its models, the parameters of all fits side by
//! side, and maps of the DEM, its background and its residual.

mod map;
mod mask;
mod models;
mod verdict;

use super::Question;
use super::curves::HEIGHT;
use super::relief::{Style, Words, deviations, exaggeration_words, limit_m, relief};
use super::sql::quoted;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, number, slug, text};
use crate::data::Data;
use crate::fit_figure::SURFACE_MAX;
use crate::render::axis::Axis;
use crate::render::chart::{Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_schemas::capital;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::tables::{CovarianceRow, FitRow};
use std::collections::BTreeSet;

/// Query for the fits of a DEM.
fn of_dem(dem: &str) -> String {
    format!("select * from 'tables/fits/*.parquet' where dem_id = {}", quoted(dem))
}

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "covariance", name: "Fits", title: "How well do the fits describe the measured surface?", answer };

/// Measured DEMs that are drawn; the table has the fits of all.
const DEMS_MAX: usize = 4;

/// Ids of the measured DEMs with a fit.
fn fitted(data: &Data) -> BTreeSet<&str> {
    data.fits.iter().map(|f| f.dem_id.as_str()).collect()
}

/// Those that are drawn.
pub(super) fn drawn(data: &Data) -> BTreeSet<&str> {
    fitted(data).into_iter().take(DEMS_MAX).collect()
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let mut blocks = Vec::new();
    for dem in drawn(data) {
        let fits: Vec<&FitRow> = data.fits.iter().filter(|f| f.dem_id == dem).collect();
        blocks.push(Block::Heading(format!("DEM {dem}")));
        for fit in &fits {
            let file = file(data, fit)?;
            blocks.push(Block::Text(verdict::paragraph(data, fit, file.as_ref())));
        }
        let sentences = warnings(data, &fits)?;
        let summary = format!("{} about {}", set::counted(sentences.len(), "warning"), set::counted(fits.len(), "fit"));
        blocks.push(Block::Warnings { summary, sentences });
        blocks.push(Block::Figures(covariances(data, &fits)?));
        blocks.push(Block::Table(verdict::intervals(dem, &fits)));
        blocks.push(Block::Figures(fits.iter().flat_map(|fit| models::figures(data, fit)).collect()));
        blocks.push(Block::Table(models::table(data, dem, &fits)));
        blocks.push(Block::FoldedTable(parameters(dem, &fits)));
        blocks.push(Block::Figures(maps(data, dem, &fits)?));
    }
    let dems = fitted(data);
    if dems.len() > DEMS_MAX {
        blocks.push(Block::Text(format!(
            "The first {DEMS_MAX} of {} DEMs are shown above; the table lists the fits of all.",
            dems.len()
        )));
    }
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

/// The fit file; `None` where the release does not have it.
fn file(data: &Data, fit: &FitRow) -> Result<Option<FitFile>, ReportError> {
    data.files.fit(&format!("fit/{}.json", fit.fit_id))
}

/// Name of the model of a fit whose textures have the measured covariance.
const EMPIRICAL: &str = "empirical";

/// The model that an empirical fit has beside the measured covariance, which extends it to longer waves: σ, b, the lines in the figures and the
/// tests are those of this model. `None` for other fits.
fn beside_measured<'a>(data: &'a Data, fit: &FitRow) -> Option<&'a str> {
    let first = || data.candidates_of(&fit.fit_id).iter().find(|c| c.rank == 1);
    (fit.model == EMPIRICAL).then(|| first().map_or("fitted", |c| c.model.as_str()))
}

/// Warnings as full sentences, each once, with the fits that it concerns.
fn warnings(data: &Data, fits: &[&FitRow]) -> Result<Vec<String>, ReportError> {
    let mut sentences: Vec<(String, Vec<&str>)> = Vec::new();
    for fit in fits {
        let of_table = || fit.warnings.split("; ").map(str::to_owned).collect();
        let list: Vec<String> = file(data, fit)?.map_or_else(of_table, |f| f.warnings);
        for sentence in list.iter().filter(|w| !w.trim().is_empty()).map(|w| sentence(w)) {
            match sentences.iter_mut().find(|known| known.0 == sentence) {
                Some((_, of)) => of.push(&fit.fit_id),
                None => sentences.push((sentence, vec![&fit.fit_id])),
            }
        }
    }
    Ok(sentences.into_iter().map(|(sentence, of)| format!("{}: {sentence}", of.join(", "))).collect())
}

/// Symbols at the start of a sentence, which keep their case.
const SYMBOLS: [&str; 3] = ["b ", "sigma ", "sigma^2"];

/// The words with a capital and a full stop; a symbol at the start keeps its case.
fn sentence(words: &str) -> String {
    let words = words.trim();
    let symbol = SYMBOLS.iter().any(|symbol| words.starts_with(symbol));
    let stop = if words.ends_with(['.', '!', '?']) { "" } else { "." };
    if symbol { format!("{words}{stop}") } else { capital(words) + stop }
}

/// Isotropic bins of a fit.
fn rings<'a>(data: &'a Data, fit: &FitRow) -> Vec<&'a CovarianceRow> {
    let isotropic =
        |r: &&CovarianceRow| r.fit_id == fit.fit_id && r.azimuth_deg.is_none() && r.covariance_m2.is_finite();
    data.covariance.iter().filter(isotropic).collect()
}

fn covariances(data: &Data, fits: &[&FitRow]) -> Result<Vec<Figure>, ReportError> {
    let drawn: Vec<(&FitRow, Vec<&CovarianceRow>)> =
        fits.iter().map(|f| (*f, rings(data, f))).filter(|(_, b)| !b.is_empty()).collect();
    // Common axes, so that the fits can be compared by eye.
    let all = || drawn.iter().flat_map(|(_, bins)| bins.iter());
    let finite = |values: Vec<f64>| values.into_iter().filter(|v| v.is_finite());
    let values = || {
        let of_bin = |r: &&CovarianceRow| vec![r.covariance_m2, r.model_m2, r.covariance_low_m2, r.covariance_high_m2];
        all().flat_map(move |r| finite(of_bin(r)))
    };
    let x = Axis::linear(0.0, 1.03 * all().map(|r| r.lag_m).fold(0.0, f64::max));
    let measured = values().fold(0.0, f64::max);
    let fits_in = |high: &f64| *high <= SURFACE_MAX * measured;
    let high = drawn.iter().map(|(_, bins)| surface_high(bins)).filter(fits_in).fold(measured, f64::max);
    let low = values().fold(0.0, f64::min);
    let y = Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low));
    drawn.iter().map(|(fit, bins)| covariance(data, fit, bins, (x, y))).collect()
}

/// Largest value of the model of the surface, m².
fn surface_high(bins: &[&CovarianceRow]) -> f64 {
    bins.iter().map(|b| b.surface_model_m2).filter(|v| v.is_finite()).fold(0.0, f64::max)
}

fn covariance(data: &Data, fit: &FitRow, bins: &[&CovarianceRow], (x, y): (Axis, Axis)) -> Result<Figure, ReportError> {
    let beside = beside_measured(data, fit);
    let id = slug(&format!("covariance-{}", fit.fit_id));
    let seen = Stroke::new(Paint::Series(1), 2.0);
    let surface = Stroke::new(Paint::Series(0), 2.0).dashed("7 4");
    // Closer than the width of a line.
    let close = 0.01 * bins.iter().map(|b| b.model_m2.abs()).fold(0.0, f64::max);
    let same = bins.iter().all(|b| (b.model_m2 - b.surface_model_m2).abs() <= close);
    let mut legend = vec![(Mark::Symbol(Symbol::Disc, Paint::Ink), "measured (area: pairs)".to_owned())];
    if has_band(bins) {
        legend.push((Mark::Line(BAND), "95 % (jackknife)".into()));
    }
    let name = beside.unwrap_or("model");
    match (same, beside) {
        (true, None) => legend.push((Mark::Line(seen), "fitted model".into())),
        (true, Some(name)) => legend.push((Mark::Line(seen), format!("{name} model"))),
        (false, _) => legend.extend([
            (Mark::Line(seen), format!("{name}, detrended")),
            (Mark::Line(surface), format!("{name} of the surface")),
        ]),
    }
    let mut plot = Plot::new((WIDTH, HEIGHT + 20.0), (x, "lag, m"), (y, "covariance, m²"), &legend);
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    for b in bins {
        plot.line([(b.lag_m, b.covariance_low_m2), (b.lag_m, b.covariance_high_m2)], BAND);
    }
    if !same {
        plot.line(bins.iter().map(|b| (b.lag_m, b.surface_model_m2)), surface);
    }
    plot.line(bins.iter().map(|b| (b.lag_m, b.model_m2)), seen);
    draw_bins(&mut plot, bins);
    plot.svg.close();
    let file = file(data, fit)?;
    let of = beside.map_or_else(String::new, |name| format!("{name}: "));
    let value = |name: &str, value: f64| {
        let limit = verdict::at_bound(file.as_ref(), name);
        limit.unwrap_or_else(|| format!("{name} = {}", set::with_unit(value, 3, "m")))
    };
    let parameters = [value("σ", fit.sigma_m), value("b", fit.range_m)];
    plot.note(0, &format!("{of}{}", parameters[0]));
    plot.note(1, &parameters[1]);
    let above = surface_high(bins);
    if above > plot.y.range().1 {
        plot.note(2, &format!("surface: {}, above the frame", set::with_unit(above, 3, "m²")));
    }
    Ok(figure(id, fit, bins, plot, beside, &parameters))
}

fn has_band(bins: &[&CovarianceRow]) -> bool {
    bins.iter().any(|b| b.covariance_low_m2.is_finite())
}

/// Bars at the bins.
const BAND: Stroke = Stroke { paint: Paint::Ink, width: 4.0, dash: "", opacity: 0.22 };

/// Discs whose area increases with the number of pairs.
fn draw_bins(plot: &mut Plot, bins: &[&CovarianceRow]) {
    let most = bins.iter().map(|b| b.pairs).max().unwrap_or(1).max(1) as f64;
    for bin in bins {
        let radius = 1.3 + 2.7 * (bin.pairs.max(0) as f64 / most).sqrt();
        for at in plot.place([(bin.lag_m, bin.covariance_m2)]) {
            plot.svg.disc(at, radius, Paint::Ink, 0.8);
        }
    }
}

/// The figure; `parameters` are σ and b of the model in words.
fn figure(
    id: String,
    fit: &FitRow,
    bins: &[&CovarianceRow],
    plot: Plot,
    beside: Option<&str>,
    parameters: &[String],
) -> Figure {
    let pairs = bins.iter().map(|b| b.pairs);
    let (fewest, most) = (pairs.clone().min().unwrap_or(0), pairs.max().unwrap_or(0));
    let band = if has_band(bins) { " Bars are 95 % intervals from a jackknife over tiles of the site." } else { "" };
    let model = match beside {
        None => format!(", {} model", fit.model),
        Some(name) => format!("; textures have this covariance, extended to longer waves by the {name} model"),
    };
    let caption = format!(
        "Covariance of the residual after a moving average of {} × {} m{model}; {} to {} pairs of cells in a bin.{band}",
        set::significant(fit.window_x_m, 3),
        set::significant(fit.window_y_m, 3),
        set::count(fewest),
        set::count(most)
    );
    let description = format!(
        "Covariance against lag in {} bins with the fitted {} model: {}.",
        bins.len(),
        beside.unwrap_or(&fit.model),
        parameters.join(", ")
    );
    let names = [
        "bin",
        "lag_m",
        "covariance_m2",
        "covariance_low_m2",
        "covariance_high_m2",
        "pairs",
        "model_m2",
        "surface_model_m2",
    ];
    let query = format!("fit_id = {} and azimuth_deg is null", quoted(&fit.fit_id));
    let numbers = Numbers::select(&query, bins.iter().copied(), &names);
    let title = format!("{}, {} mode.", fit.fit_id, fit.mode);
    Figure { id, title, caption, description, svg: plot.svg, numbers }
}

/// A parameter of every fit: name, unit, value.
type Parameter = (&'static str, &'static str, fn(&FitRow) -> f64);

const PARAMETERS: [Parameter; 16] = [
    ("standard deviation σ", "m", |f| f.sigma_m),
    ("range b", "m", |f| f.range_m),
    ("nugget", "m2", |f| f.nugget_m2),
    ("σ²/b", "m", |f| f.sigma2_over_range_m),
    ("range b over window", "1", |f| f.range_m / f.window_x_m),
    ("window, east-west", "m", |f| f.window_x_m),
    ("window, north-south", "m", |f| f.window_y_m),
    ("trim level", "1", |f| f.trim_level),
    ("trim threshold", "m", |f| f.trim_threshold_m),
    ("share of cells used", "1", |f| f.used_share),
    ("RMS misfit of the bins", "m2", |f| f.misfit_m2),
    ("band RMS below the window", "m", |f| f.band_rms_m),
    ("white noise per cell", "m", |f| f.noise_sigma_m),
    ("correlated noise", "m", |f| f.correlated_noise_sigma_m),
    ("range of correlated noise", "m", |f| f.correlated_noise_range_m),
    ("effective resolution", "m", |f| f.effective_resolution_m),
];

fn parameters(dem: &str, fits: &[&FitRow]) -> TableBlock {
    let headings: Vec<String> = fits.iter().map(|f| format!("{} ({})", f.fit_id, f.mode)).collect();
    let columns: Vec<(&str, &str)> =
        [("parameter", ""), ("unit", "")].into_iter().chain(headings.iter().map(|h| (h.as_str(), ""))).collect();
    let mut numbers = Numbers::computed(of_dem(dem), &columns);
    for (name, unit, figure) in PARAMETERS {
        let values = fits.iter().map(|f| number(figure(f)));
        numbers.row([text(name), text(set::unit(unit))].into_iter().chain(values));
    }
    let caption = format!("Fits of {dem} side by side");
    TableBlock { id: slug(&format!("fits-of-{dem}")), caption, numbers }
}

/// The DEM, then background and residual of every fit.
fn maps(data: &Data, dem: &str, fits: &[&FitRow]) -> Result<Vec<Figure>, ReportError> {
    let row = data.terrain(dem);
    let slope = row.map_or(f64::NAN, |t| t.rms_slope);
    let path = row.map_or_else(|| format!("dem/{dem}.metric.tif"), |t| t.path.clone());
    let range_m = row.map_or((f64::NAN, f64::NAN), |t| (t.height_min_m, t.height_max_m));
    let style = Style { range_m, exaggeration: exaggeration(slope), pixels: 400 };
    let style = Some(style).filter(|s| s.range_m.0 < s.range_m.1);
    let shading = style.map_or_else(String::new, |s| exaggeration_words(s.exaggeration));
    let mut figures = Vec::new();
    let words =
        |what: &str, title: String, caption: String| Words { id: slug(&format!("{what}-{dem}")), title, caption };
    let caption = format!("{dem} as imported, in metres.{shading}");
    figures.extend(relief(data, &path, style, words("dem", "Measured DEM.".into(), caption))?);
    for fit in fits {
        figures.extend(background(data, fit, style)?);
        figures.extend(residual(data, fit)?);
        figures.extend(mask::figure(data, fit)?);
        figures.extend(map::figure(data, fit)?);
    }
    Ok(figures)
}

fn background(data: &Data, fit: &FitRow, style: Option<Style>) -> Result<Option<Figure>, ReportError> {
    let id = slug(&format!("background-{}", fit.fit_id));
    let caption = "Centred moving average, which is subtracted before the covariance is computed.".to_owned();
    let words = Words { id, title: format!("Background, {}.", fit.fit_id), caption };
    relief(data, &format!("fit/{}.background.tif", fit.fit_id), style, words)
}

fn residual(data: &Data, fit: &FitRow) -> Result<Option<Figure>, ReportError> {
    let path = format!("fit/{}.residual.tif", fit.fit_id);
    let Some(grid) = data.files.grid(&path)? else { return Ok(None) };
    let caption = format!(
        "DEM minus background. {} of the cells entered the covariance; grey cells did not (no data, border, objects, trimmed).",
        set::percent(fit.used_share, 1)
    );
    let id = slug(&format!("residual-{}", fit.fit_id));
    let words = Words { id, title: format!("Residual, {}.", fit.fit_id), caption };
    deviations(&grid, &path, limit_m(&grid), "not used", words)
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "fit_id",
        "dem_id",
        "mode",
        "model",
        "sigma_m",
        "range_m",
        "nugget_m2",
        "sigma2_over_range_m",
        "window_x_m",
        "window_y_m",
        "trim_level",
        "trim_threshold_m",
        "used_share",
        "misfit_m2",
    ];
    let numbers = Numbers::select("", &data.fits, &names);
    TableBlock { id: "fits".into(), caption: "All fits".into(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;

    #[test]
    fn val_sentences() {
        assert_eq!(sentence(" b is not identified "), "b is not identified.");
        assert_eq!(sentence("not stationary"), "Not stationary.");
        assert_eq!(sentence("Done."), "Done.");
        assert_eq!(sentence(""), ".");
    }

    /// The line of an empirical fit, and its σ and b, are those of the model that extends the measured covariance; it is named. At the bound of
    /// the search they are not identified.
    #[test]
    fn val_the_model_that_is_drawn_is_named() {
        let (mut data, mut shelf) = made_up::parts(1, 24);
        let drawn = |data: &Data| {
            let figure = covariances(data, &[&data.fits[0]]).unwrap().remove(0);
            (figure.svg.finish("x", "t", "d"), figure.caption, figure.description)
        };
        let (svg, caption, description) = drawn(&data);
        assert!(
            svg.contains("model, detrended")
                && svg.contains(">σ = 21.0 m<")
                && caption.contains(" m, exponential model; ")
                && description.ends_with("with the fitted exponential model: σ = 21.0 m, b = 640 m.")
        );
        data.fits[0].model = EMPIRICAL.into();
        let (svg, caption, _) = drawn(&data);
        for part in ["exponential, detrended", "exponential of the surface", ">exponential: σ = 21.0 m<", ">b = 640 m<"]
        {
            assert!(svg.contains(part), "{part}");
        }
        let words = " m; textures have this covariance, extended to longer waves by the exponential model; ";
        assert!(caption.contains(words), "{caption}");
        let file = shelf.fits.get_mut("fit/jacksboro-corrected.json").unwrap();
        file.diagnostics.range_at_search_bound = true;
        file.parameters = [("sigma_m".to_owned(), 21.0), ("range_m".to_owned(), 640.0)].into();
        data.files = Box::new(shelf);
        let (svg, _, description) = drawn(&data);
        assert!(svg.contains(">exponential: σ not identified<") && svg.contains(">b not identified<"));
        assert!(description.ends_with("exponential model: σ not identified, b not identified."), "{description}");
    }
}
