//! The picture of one fit: measured covariance and structure function with the fitted model, and the covariance by
//! direction.
//!
//! * Covariance by lag, in rings. `model, detrended` is the model after the same detrending and trimming as the data, with
//!   which the bins are compared; `model of the surface` is the model before them.
//! * Structure function (mean squared increment) `D(h) = 2 [C(0) - C(h)]`, m², of the same three, on logarithmic axes: a
//!   self-affine surface is a straight line of slope 2 H.
//! * Covariance by direction, in sectors of azimuth clockwise from north, if the fit has them.
//!
//! Everything is read from the fit file; only the differences above are computed.

use crate::ReportError;
use crate::content::slug;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot};
use crate::render::number as set;
use crate::render::raster;
use crate::render::svg::{Anchor, Paint, Stroke, Svg, Symbol, TEXT, fitted};
use sastrugi_schemas::fit::{DirectionBin, FitFile, Quoted};

/// Size of a panel, px.
const PANEL: (f64, f64) = (470.0, 340.0);
/// Free space around and between the panels, px.
const GAP: f64 = 14.0;
/// Size of the title, px.
const TITLE: f64 = 15.0;
/// Room of title and parameters above the panels, px.
const HEAD: f64 = 52.0;
/// Room of the explanation below the panels, px.
const FOOT: f64 = 24.0;
/// Largest model of the surface, over the largest measured value, that still sets the height of the frame: with a long range it
/// can lie far above.
pub(crate) const SURFACE_MAX: f64 = 2.0;
/// Smallest measured increment that is drawn, over the largest.
const INCREMENT_MIN: f64 = 1e-6;
/// Marks that distinguish directions without colour.
const SYMBOLS: [Symbol; 6] =
    [Symbol::Disc, Symbol::Square, Symbol::Triangle, Symbol::Diamond, Symbol::Ring, Symbol::Frame];

/// A fit as an SVG picture; `name` is the surface, as in the title.
///
/// ```
/// use sastrugi_schemas::fit::FitFile;
///
/// let fit = FitFile {
///     model: "exponential".into(),
///     parameters: [("sigma_m".to_owned(), 0.05), ("range_m".to_owned(), 0.28)].into(),
///     lags_m: vec![0.0, 0.28, 0.56],
///     covariance_m2: vec![25.0e-4, 9.2e-4, 3.4e-4],
///     ..FitFile::default()
/// };
/// let svg = sastrugi_report::fit_svg(&fit, "snow.tif");
/// assert!(svg.starts_with("<svg") && svg.contains("snow.tif: exponential model"));
/// assert!(svg.contains("σ = 0.0500 m,  b = 0.280 m"));
/// ```
pub fn fit_svg(fit: &FitFile, name: &str) -> String {
    let id = slug(&format!("fit-{name}"));
    let mut panels = vec![covariance(fit, &format!("{id}-covariance")), structure(fit, &format!("{id}-structure"))];
    panels.extend(directions(fit, &format!("{id}-directions")));
    let width = GAP + panels.len() as f64 * (PANEL.0 + GAP);
    let mut svg = Svg::new(width, HEAD + PANEL.1 + FOOT + GAP);
    let (_, height) = svg.size();
    svg.rect((0.0, 0.0), (width, height), Paint::Paper, 1.0);
    let room = width - 2.0 * GAP;
    let title = format!("{name}: {}", model_words(fit));
    svg.text_sized((GAP, 22.0), Anchor::Start, Paint::Ink, TITLE, &fitted(&title, room, TITLE));
    svg.text((GAP, 42.0), Anchor::Start, Paint::Muted, &fitted(&parameters(fit), room, TEXT));
    for (k, panel) in panels.iter().enumerate() {
        svg.inset((GAP + k as f64 * (PANEL.0 + GAP), HEAD), &panel.svg);
    }
    let foot = (GAP, HEAD + PANEL.1 + 16.0);
    svg.text(foot, Anchor::Start, Paint::Muted, &fitted(&explanation(fit), room, TEXT));
    let description = format!("Covariance in {} rings with the fitted model. {}", fit.lags_m.len(), parameters(fit));
    svg.finish(&id, &title, &description)
}

/// The same as a PNG file.
///
/// # Errors
/// When it cannot be drawn, for lack of memory.
///
/// ```
/// use sastrugi_schemas::fit::FitFile;
///
/// let fit = FitFile {
///     model: "exponential".into(),
///     parameters: [("sigma_m".to_owned(), 0.05), ("range_m".to_owned(), 0.28)].into(),
///     lags_m: vec![0.0, 0.28, 0.56],
///     covariance_m2: vec![25.0e-4, 9.2e-4, 3.4e-4],
///     ..FitFile::default()
/// };
/// let png = sastrugi_report::fit_png(&fit, "snow.tif")?;
/// assert!(png.starts_with(b"\x89PNG"));
/// // Two panels of 470 px with 14 px around each, at two pixels of the file per pixel of the figure.
/// assert_eq!(png[16..20], (2 * (14 + 2 * (470 + 14)) as u32).to_be_bytes());
/// # Ok::<(), sastrugi_report::ReportError>(())
/// ```
pub fn fit_png(fit: &FitFile, name: &str) -> Result<Vec<u8>, ReportError> {
    raster::png(&fit_svg(fit, name))
}

fn model_words(fit: &FitFile) -> String {
    match fit.mode.as_str() {
        "" => format!("{} model", fit.model),
        mode => format!("{} model, {mode} fit", fit.model),
    }
}

/// Every parameter with its unit and the interval to quote; only a lower limit if the search for the range ended at its bound.
fn parameters(fit: &FitFile) -> String {
    let level = fit.quoted_intervals().map_or_else(String::new, |(i, _)| set::plain(100.0 * i.level, 3));
    let end = |end: Option<f64>| end.map_or_else(|| "open".to_owned(), |v| set::significant(v, 3));
    let one = |(name, value): (&String, &f64)| {
        let (symbol, unit) = symbol(name);
        match fit.quoted(name) {
            Some(Quoted::Estimate { value, interval: Some([low, high]) }) => {
                format!("{symbol} = {} ({level} %: {} to {})", set::with_unit(value, 3, unit), end(low), end(high))
            }
            Some(Quoted::AtLeast(low)) => format!("{symbol} at least {} ({level} %)", set::with_unit(low, 3, unit)),
            Some(Quoted::NotIdentified { .. }) => format!("{symbol} not identified"),
            Some(Quoted::Estimate { interval: None, .. }) | None => {
                format!("{symbol} = {}", set::with_unit(*value, 3, unit))
            }
        }
    };
    // Sigma and b come first.
    let place = |name: &str| ["sigma", "range"].iter().position(|start| name.starts_with(start)).unwrap_or(2);
    let mut all: Vec<(&String, &f64)> = fit.parameters.iter().collect();
    all.sort_by_key(|(name, _)| place(name));
    all.into_iter().map(one).collect::<Vec<_>>().join(",  ")
}

/// Symbol and unit of a parameter, as set in text.
fn symbol(name: &str) -> (String, &'static str) {
    let units = [("_m2", "m²"), ("_m", "m"), ("_deg", "°")];
    let (stem, unit) =
        units.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit))).unwrap_or((name, ""));
    let symbol = match stem {
        "sigma" => "σ".to_owned(),
        "range" => "b".to_owned(),
        "sigma_2" => "σ₂".to_owned(),
        "range_2" => "b₂".to_owned(),
        other => other.replace('_', " "),
    };
    (symbol, unit)
}

fn explanation(fit: &FitFile) -> String {
    let window =
        fit.window_m.map_or_else(String::new, |[x, y]| format!(" over {} × {} m", set::plain(x, 3), set::plain(y, 3)));
    let trim = fit.trim.filter(|t| t.level > 0.0);
    let trim = trim.map_or_else(String::new, |t| format!(", {} of the residuals trimmed", set::percent(t.level, 1)));
    let model = match fit.mode.as_str() {
        "paper" => "The published method fits the model without detrending it.",
        _ => "\"Model, detrended\" has the same detrending and trimming as the data.",
    };
    format!("Measured: heights minus a moving average{window}{trim}. {model}")
}

fn seen() -> Stroke {
    Stroke::new(Paint::Series(1), 2.0)
}

fn surface() -> Stroke {
    Stroke::new(Paint::Series(0), 1.8).dashed("7 4")
}

fn legend(fit: &FitFile) -> Vec<Entry> {
    let seen_words = if fit.mode == "paper" { "model" } else { "model, detrended" };
    vec![
        (Mark::Symbol(Symbol::Disc, Paint::Ink), "measured".to_owned()),
        (Mark::Line(seen()), seen_words.to_owned()),
        (Mark::Line(surface()), "model of the surface".to_owned()),
    ]
}

/// Lags with their finite values.
fn curve(lags_m: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    lags_m.iter().copied().zip(values.iter().copied()).filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
}

/// Smallest and largest of the values and zero.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(low, high), v| (f64::min(low, v), f64::max(high, v)))
}

/// A linear axis with some room beyond both ends.
fn roomy((low, high): (f64, f64)) -> Axis {
    Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low))
}

fn covariance(fit: &FitFile, id: &str) -> Plot {
    let measured = curve(&fit.lags_m, &fit.covariance_m2);
    let model = curve(&fit.lags_m, &fit.model_m2);
    let of_surface = curve(&fit.lags_m, &fit.surface_model_m2);
    let (low, high) = ends(measured.iter().chain(&model).map(|p| p.1));
    let (_, surface_high) = ends(of_surface.iter().map(|p| p.1));
    let beyond = surface_high > SURFACE_MAX * high;
    let y = roomy((low, if beyond { high } else { high.max(surface_high) }));
    let x = Axis::linear(0.0, 1.03 * fit.lags_m.iter().copied().fold(0.0, f64::max));
    let mut plot = Plot::new(PANEL, (x, "lag, m"), (y, "covariance, m²"), &legend(fit));
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    plot.line(of_surface, surface());
    plot.line(model, seen());
    discs(&mut plot, measured);
    plot.svg.close();
    if beyond {
        plot.note(0, &format!("model of the surface: {}, above the frame", set::with_unit(surface_high, 3, "m²")));
    }
    plot
}

/// Mean squared increments `2 [C(0) - C(h)]` at lags above zero; empty without a lag of zero.
fn increments(lags_m: &[f64], covariance_m2: &[f64]) -> Vec<(f64, f64)> {
    let Some((&0.0, &variance_m2)) = lags_m.first().zip(covariance_m2.first()) else { return Vec::new() };
    let of = |(lag, covariance): (f64, f64)| (lag, 2.0 * (variance_m2 - covariance));
    curve(lags_m, covariance_m2).into_iter().map(of).filter(|(lag, d)| *lag > 0.0 && *d > 0.0).collect()
}

fn structure(fit: &FitFile, id: &str) -> Plot {
    let [measured, model, of_surface] =
        [&fit.covariance_m2, &fit.model_m2, &fit.surface_model_m2].map(|values| increments(&fit.lags_m, values));
    let all = || measured.iter().chain(&model).chain(&of_surface);
    let none = (f64::INFINITY, 0.0);
    let range = |of: fn(&(f64, f64)) -> f64| all().map(of).fold(none, |(l, h), v| (f64::min(l, v), f64::max(h, v)));
    let (x, y) = (range(|p| p.0), range(|p| p.1));
    let x = Axis::log(x.0 / 1.15, x.1 * 1.15);
    let y = Axis::log(y.0.max(INCREMENT_MIN * y.1) / 1.3, y.1 * 1.3);
    let mut plot = Plot::new(PANEL, (x, "lag, m"), (y, "structure function, m²"), &legend(fit));
    plot.clip(&format!("{id}-clip"));
    plot.line(of_surface, surface());
    plot.line(model, seen());
    discs(&mut plot, measured);
    plot.svg.close();
    plot
}

fn discs(plot: &mut Plot, points: Vec<(f64, f64)>) {
    for at in plot.place(points) {
        plot.svg.disc(at, 3.0, Paint::Ink, 0.85);
    }
}

/// Bins of each direction, by azimuth.
fn by_azimuth(fit: &FitFile) -> Vec<(f64, Vec<&DirectionBin>)> {
    let mut bins: Vec<&DirectionBin> = fit.directions.iter().collect();
    bins.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg).then(a.lag_m.total_cmp(&b.lag_m)));
    bins.chunk_by(|a, b| a.azimuth_deg == b.azimuth_deg).map(|group| (group[0].azimuth_deg, group.to_vec())).collect()
}

fn directions(fit: &FitFile, id: &str) -> Option<Plot> {
    let groups = by_azimuth(fit);
    if groups.is_empty() {
        return None;
    }
    let symbol = |k: usize| SYMBOLS[k % SYMBOLS.len()];
    let line = |k: usize| Stroke::new(Paint::Series(k), 1.3);
    let entry = |(k, (azimuth_deg, _)): (usize, &(f64, Vec<&DirectionBin>))| {
        (Mark::Track(line(k), symbol(k)), format!("{}°", set::plain(*azimuth_deg, 3)))
    };
    let legend: Vec<Entry> = groups.iter().enumerate().map(entry).collect();
    let y = roomy(ends(fit.directions.iter().flat_map(|b| [b.covariance_m2, b.model_m2])));
    let x = Axis::linear(0.0, 1.03 * fit.directions.iter().map(|b| b.lag_m).fold(0.0, f64::max));
    let title = "covariance by azimuth, m²";
    let mut plot = Plot::new(PANEL, (x, "lag, m (marks: measured, lines: model, detrended)"), (y, title), &legend);
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    for (k, (_, bins)) in groups.iter().enumerate() {
        plot.line(bins.iter().map(|b| (b.lag_m, b.model_m2)), line(k));
    }
    for (k, (_, bins)) in groups.iter().enumerate() {
        for at in plot.place(bins.iter().map(|b| (b.lag_m, b.covariance_m2))) {
            plot.svg.symbol(symbol(k), at, 3.4, Paint::Series(k));
        }
    }
    plot.svg.close();
    Some(plot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::xml::assert_well_formed;
    use sastrugi_schemas::fit::{Diagnostics, Intervals};

    fn fit() -> FitFile {
        let direction = |azimuth_deg: f64, lag_m: f64| DirectionBin {
            lag_m,
            azimuth_deg,
            covariance_m2: 0.5,
            pairs: 10,
            model_m2: 0.4,
        };
        FitFile {
            mode: "corrected".into(),
            model: "exponential".into(),
            parameters: [("sigma_m".to_owned(), 1.0), ("range_m".to_owned(), 2.0)].into(),
            lags_m: vec![0.0, 1.0, 2.0],
            covariance_m2: vec![1.0, 0.6, 0.3],
            model_m2: vec![1.0, 0.55, 0.35],
            surface_model_m2: vec![9.0, 8.0, 7.5],
            directions: vec![direction(90.0, 1.0), direction(0.0, 2.0), direction(0.0, 1.0)],
            ..FitFile::default()
        }
    }

    #[test]
    fn val_increments_are_twice_the_loss_of_covariance() {
        assert_eq!(increments(&[0.0, 1.0, 2.0], &[1.0, 0.75, 0.5]), [(1.0, 0.5), (2.0, 1.0)]);
        // No increments without a variance, nor for covariances above it.
        assert!(increments(&[1.0, 2.0], &[1.0, 0.5]).is_empty());
        assert!(increments(&[0.0, 1.0], &[1.0, 1.5]).is_empty());
    }

    #[test]
    fn val_directions_are_sorted_into_azimuths() {
        let fit = fit();
        let groups = by_azimuth(&fit);
        assert_eq!(groups.iter().map(|g| (g.0, g.1.len())).collect::<Vec<_>>(), [(0.0, 2), (90.0, 1)]);
        assert_eq!(groups[0].1.iter().map(|b| b.lag_m).collect::<Vec<_>>(), [1.0, 2.0]);
    }

    #[test]
    fn val_a_picture_names_what_it_shows() {
        let svg = fit_svg(&fit(), "snow & ice.tif");
        assert_well_formed(&svg);
        let words = ["snow &amp; ice.tif", "lag, m", "covariance, m²", "structure function, m²", "90°", "σ = 1.00 m"];
        words.into_iter().for_each(|word| assert!(svg.contains(word), "{word}"));
        assert!(svg.contains("9.00 m², above the frame"), "a surface model beyond the frame is noted");
    }

    /// A range at the bound of the search is a lower limit if the quoted interval has one, otherwise not identified.
    #[test]
    fn val_a_range_at_the_bound_is_not_drawn_as_an_estimate() {
        let ends = |low| [("range_m".to_owned(), [low, None])].into();
        let intervals = |low| Some(Intervals { level: 0.95, replicates: 99, from_profile: true, values: ends(low) });
        let diagnostics = Diagnostics { range_at_search_bound: true, ..Diagnostics::default() };
        let bounded = FitFile { diagnostics, intervals: intervals(Some(4.553)), ..fit() };
        assert_eq!(parameters(&bounded), "σ not identified,  b at least 4.55 m (95 %)");
        let open = FitFile { intervals: intervals(None), ..bounded };
        assert_eq!(parameters(&open), "σ not identified,  b not identified");
        let found = FitFile { intervals: intervals(Some(1.5)), ..fit() };
        assert_eq!(parameters(&found), "σ = 1.00 m,  b = 2.00 m (95 %: 1.50 to open)");
    }

    #[test]
    fn prop_pictures_of_anything_are_well_formed() {
        let bad = FitFile { covariance_m2: vec![f64::NAN, f64::INFINITY, -1.0], ..fit() };
        let bare = FitFile { model: "x".into(), ..FitFile::default() };
        for fit in [bad, bare] {
            let svg = fit_svg(&fit, "<script>");
            assert_well_formed(&svg);
            assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("<script"), "{svg}");
        }
    }
}
