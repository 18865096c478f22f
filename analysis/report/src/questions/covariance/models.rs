//! The candidate models of a fit, its profile likelihood over the range, and the covariance by direction.

use super::super::curves::HEIGHT;
use super::of_dem;
use super::verdict;
use crate::content::{Figure, Numbers, TableBlock, slug, text};
use crate::data::Data;
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_schemas::Cell;
use sastrugi_schemas::tables::{CovarianceRow, FitRow};
use std::collections::{BTreeMap, BTreeSet};

/// Candidates drawn; all are in the table.
const CANDIDATES_MAX: usize = 6;
/// Rise of the sum of squares at the end of a 95 % interval (chi-squared, one degree of freedom).
const EDGE: f64 = 3.84;
/// Largest rise that is drawn, as a multiple of the rise at the end of the interval.
const RISE_MAX: f64 = 4.0;
/// Dashes that distinguish lines without colour.
const DASHES: [&str; 6] = ["", "7 4", "2 3", "9 3 2 3", "4 2", "12 4"];

/// Candidates, profile and directions of a fit, where it has them.
pub fn figures(data: &Data, fit: &FitRow) -> Vec<Figure> {
    [candidates(data, fit), profile(data, fit), directions(data, fit)].into_iter().flatten().collect()
}

fn line(i: usize) -> Stroke {
    Stroke::new(Paint::Series(i), 1.8).dashed(DASHES[i % DASHES.len()])
}

/// Every candidate over the measured covariance; `None` where only one was tried.
fn candidates(data: &Data, fit: &FitRow) -> Option<Figure> {
    let all = data.candidates_of(&fit.fit_id);
    let drawn: Vec<_> = all
        .iter()
        .map(|c| (c, data.candidate_curve(&fit.fit_id, c.rank)))
        .filter(|(_, curve)| curve.len() > 1)
        .take(CANDIDATES_MAX)
        .collect();
    if drawn.len() < 2 {
        return None;
    }
    let bins = super::rings(data, fit);
    let id = slug(&format!("candidates-{}", fit.fit_id));
    let mut legend: Vec<Entry> = vec![(Mark::Symbol(Symbol::Disc, Paint::Ink), "measured".to_owned())];
    legend.extend(drawn.iter().enumerate().map(|(i, (c, _))| (Mark::Line(line(i)), c.model.clone())));
    let values = || {
        let curves = drawn.iter().flat_map(|(_, curve)| curve.iter().map(|r| r.model_m2));
        curves.chain(bins.iter().map(|b| b.covariance_m2))
    };
    let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
    let lag = drawn.iter().flat_map(|(_, c)| c.iter().map(|r| r.lag_m)).fold(0.0, f64::max);
    let y = Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low));
    let x = Axis::linear(0.0, 1.03 * lag);
    let mut plot = Plot::new((WIDTH, HEIGHT + 20.0), (x, "lag, m"), (y, "covariance, m²"), &legend);
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    super::draw_bins(&mut plot, &bins);
    // The best is drawn last, over the others.
    for (i, (_, curve)) in drawn.iter().enumerate().rev() {
        plot.line(curve.iter().map(|r| (r.lag_m, r.model_m2)), line(i));
    }
    plot.svg.close();
    let names = ["rank", "bin", "lag_m", "model_m2"];
    let query = format!("fit_id = {} and isfinite(model_m2)", quoted(&fit.fit_id));
    let rows = drawn.iter().flat_map(|(_, curve)| curve.iter().copied());
    Some(Figure {
        id,
        title: format!("Candidate models of {}.", fit.fit_id),
        caption: "Each candidate after the same detrending and trimming as the data; the best by AICc comes first."
            .into(),
        description: format!("Covariance against lag with {} candidate models.", drawn.len()),
        svg: plot.svg,
        numbers: Numbers::select(&query, rows, &names),
    })
}

/// Rise of the sum of squares when the range is fixed at other values.
fn profile(data: &Data, fit: &FitRow) -> Option<Figure> {
    let points = data.profile_of(&fit.fit_id);
    if points.len() < 3 {
        return None;
    }
    let id = slug(&format!("profile-{}", fit.fit_id));
    let ends = points.iter().fold((f64::INFINITY, 0.0f64), |(l, h), p| (l.min(p.range_m), h.max(p.range_m)));
    let highest = points.iter().map(|p| p.chi2_rise).fold(0.0, f64::max);
    let (at_edge, threshold) = threshold(fit);
    let top = highest.clamp(2.0 * at_edge, RISE_MAX * at_edge);
    let curve = Stroke::new(Paint::Series(0), 2.0);
    let edge = Stroke::new(Paint::Muted, 1.4).dashed("6 4");
    let interval = Stroke::new(Paint::Series(1), 1.4).dashed("2 3");
    let frame = (ends.0 / 1.05, ends.1 * 1.05);
    let known = [("begins", fit.range_low_m), ("ends", fit.range_high_m)];
    let known = known.into_iter().filter(|(_, end)| *end > 0.0 && end.is_finite());
    let (inside, outside): (Vec<(&str, f64)>, Vec<_>) = known.partition(|(_, end)| *end >= frame.0 && *end <= frame.1);
    let mut legend =
        vec![(Mark::Line(curve), "rise of χ²".to_owned()), (Mark::Line(edge), "95 % threshold".to_owned())];
    if !inside.is_empty() {
        legend.push((Mark::Line(interval), "ends of the interval".into()));
    }
    let x = (Axis::log(frame.0, frame.1), "fixed range b, m");
    let y = (Axis::linear(0.0, 1.05 * top), "rise of χ²");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, y, &legend);
    plot.clip(&format!("{id}-clip"));
    plot.line([(ends.0, at_edge), (ends.1, at_edge)], edge);
    for (_, end) in inside {
        plot.line([(end, 0.0), (end, 1.05 * top)], interval);
    }
    plot.line(points.iter().map(|p| (p.range_m, p.chi2_rise)), curve);
    let marks = plot.place(points.iter().map(|p| (p.range_m, p.chi2_rise)));
    marks.into_iter().for_each(|at| plot.svg.disc(at, 2.6, Paint::Series(0), 1.0));
    plot.svg.close();
    let beyond = |(what, end): &(&str, f64)| {
        format!(" The interval of b {what} at {}, outside the frame.", set::with_unit(*end, 3, "m"))
    };
    let beyond: String = outside.iter().map(beyond).collect();
    let of = super::beside_measured(data, fit).map_or_else(String::new, |name| format!(" of the {name} model"));
    let cut = if highest > top { format!(" The axis ends at {}.", set::significant(top, 2)) } else { String::new() };
    let query = format!("fit_id = {} and range_m > 0 and isfinite(chi2_rise)", quoted(&fit.fit_id));
    Some(Figure {
        id,
        title: format!("How well {} constrains b{of}.", fit.fit_id),
        caption: format!(
            "Rise of the generalised sum of squares when b is fixed and all other parameters are refitted. A 95 % interval ends \
             at a rise of {threshold}.{beyond} A flat curve means that b is not identified.{cut}"
        ),
        description: format!("Profile likelihood over ranges from {}.", span(ends)),
        svg: plot.svg,
        numbers: Numbers::select(&query, points, &["point", "range_m", "chi2_rise"]),
    })
}

/// The rise of the sum of squares at the ends of a 95 % interval, and how it follows from the misfit, in words.
fn threshold(fit: &FitRow) -> (f64, String) {
    // If the model does not fit, its sum of squares overstates how well the parameters are known.
    let misfit = fit.misfit_chi2_per_freedom;
    if misfit > 1.0 {
        let at_edge = EDGE * misfit;
        let [rise, times] = [at_edge, misfit].map(|value| set::significant(value, 3));
        return (at_edge, format!("{rise}, which is {EDGE} times the misfit per degree of freedom ({times})"));
    }
    (EDGE, EDGE.to_string())
}

fn span((low, high): (f64, f64)) -> String {
    format!("{} to {}", set::significant(low, 3), set::with_unit(high, 3, "m"))
}

/// Covariance by sector.
fn directions(data: &Data, fit: &FitRow) -> Option<Figure> {
    let of_fit = |r: &&CovarianceRow| r.fit_id == fit.fit_id && r.covariance_m2.is_finite();
    let mut sectors: BTreeMap<i64, Vec<&CovarianceRow>> = BTreeMap::new();
    for row in data.covariance.iter().filter(of_fit) {
        if let Some(azimuth) = row.azimuth_deg.filter(|a| a.is_finite()) {
            sectors.entry(azimuth.round() as i64).or_default().push(row);
        }
    }
    sectors.retain(|_, rows| rows.len() > 1);
    if sectors.len() < 2 {
        return None;
    }
    let id = slug(&format!("directions-{}", fit.fit_id));
    let model = Stroke::new(Paint::Ink, 1.4).dashed("2 3");
    let mut legend: Vec<Entry> =
        sectors.keys().enumerate().map(|(i, azimuth)| (Mark::Line(line(i)), format!("{azimuth}°"))).collect();
    legend.push((Mark::Line(model), super::beside_measured(data, fit).unwrap_or("model").into()));
    let all = || sectors.values().flatten();
    let values = || all().flat_map(|r| [r.covariance_m2, r.model_m2]).filter(|v| v.is_finite());
    let (low, high) = (values().fold(0.0, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let x = Axis::linear(0.0, 1.03 * all().map(|r| r.lag_m).fold(0.0, f64::max));
    let y = Axis::linear(low - 0.04 * (high - low), high + 0.06 * (high - low));
    let mut plot = Plot::new((WIDTH, HEIGHT + 20.0), (x, "lag, m"), (y, "covariance, m²"), &legend);
    plot.line([(0.0, 0.0), (x.range().1, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.clip(&format!("{id}-clip"));
    for (i, rows) in sectors.values().enumerate() {
        plot.line(rows.iter().map(|r| (r.lag_m, r.model_m2)), model.faint(0.6));
        plot.line(rows.iter().map(|r| (r.lag_m, r.covariance_m2)), line(i));
    }
    plot.svg.close();
    let verdict = verdict::direction(data, fit).unwrap_or_default();
    let names = ["azimuth_deg", "lag_m", "covariance_m2", "pairs", "model_m2"];
    let query = format!("fit_id = {} and azimuth_deg is not null", quoted(&fit.fit_id));
    let rows: Vec<&CovarianceRow> = all().copied().collect();
    Some(Figure {
        id,
        title: format!("Covariance by direction, {}.", fit.fit_id),
        caption: format!("Sectors centred on azimuths clockwise from north; opposite directions are pooled. {verdict}"),
        description: format!("Covariance against lag in {} directions. {verdict}", sectors.len()),
        svg: plot.svg,
        numbers: Numbers::select(&query, rows, &names),
    })
}

/// Every parameter of a fit's model with its unit; empty where the release does not state them.
pub fn of_fit(data: &Data, fit: &FitRow) -> Vec<(String, &'static str, f64)> {
    let first = data.candidates_of(&fit.fit_id).iter().find(|c| c.rank == 1);
    let all = first.map(|c| parameters(&c.parameters)).unwrap_or_default();
    all.into_iter().map(|(name, value)| (name.clone(), unit_of(&name), value)).collect()
}

fn parameters(json: &str) -> BTreeMap<String, f64> {
    serde_json::from_str(json).unwrap_or_default()
}

/// The candidates of all fits of a DEM, one column per parameter; without rows where every fit had a single candidate.
pub fn table(data: &Data, dem: &str, fits: &[&FitRow]) -> TableBlock {
    let of_fit = |f: &&FitRow| data.candidates_of(&f.fit_id);
    let rows: Vec<_> = fits.iter().map(of_fit).filter(|all| all.len() > 1).flatten().collect();
    let names: BTreeSet<String> = rows.iter().flat_map(|c| parameters(&c.parameters).into_keys()).collect();
    let mut columns =
        vec![("fit", ""), ("rank", ""), ("model", ""), ("AICc above best", "1"), ("χ²", "1"), ("free parameters", "")];
    let units: Vec<(String, &str)> = names.iter().map(|n| (n.clone(), unit_of(n))).collect();
    columns.extend(units.iter().map(|(n, u)| (n.as_str(), *u)));
    let mut numbers = Numbers::computed(
        format!("select * from 'tables/candidates/*.parquet' where fit_id in (select fit_id from ({}))", of_dem(dem)),
        &columns,
    );
    for c in &rows {
        let own = parameters(&c.parameters);
        let optional = |v: Option<f64>| v.map_or(Cell::Null, crate::content::number);
        let first = [text(&c.fit_id), Cell::I64(c.rank), text(&c.model), optional(c.aicc_above_best), optional(c.chi2)];
        let values = names.iter().map(|n| optional(own.get(n).copied()));
        numbers.row(first.into_iter().chain([Cell::I64(c.free)]).chain(values));
    }
    let caption = format!("Candidate models for {dem}");
    TableBlock { id: slug(&format!("candidates-of-{dem}")), caption, numbers }
}

/// Unit at the end of a parameter's name.
fn unit_of(name: &str) -> &'static str {
    match name.rsplit('_').next() {
        Some("m") => "m",
        Some("m2") => "m2",
        Some("deg") => "deg",
        _ => "1",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;

    /// The caption states the threshold that is drawn; the legend names the ends of the interval only where they are drawn.
    #[test]
    fn val_the_profile_states_its_threshold_and_the_ends_of_the_interval() {
        let mut data = made_up::full(1, 24);
        let drawn = |data: &Data| {
            let figure = profile(data, &data.fits[0]).unwrap();
            (figure.svg.finish("x", "t", "d"), figure.caption)
        };
        let (svg, caption) = drawn(&data);
        // 3.84 times 3.1.
        assert!(
            caption.contains("at a rise of 11.9, which is 3.84 times the misfit per degree of freedom (3.10)."),
            "{caption}"
        );
        assert!(svg.contains("ends of the interval") && !caption.contains("outside the frame"));
        // The profile begins at 160 m.
        data.fits[0].range_low_m = 20.0;
        data.fits[0].range_high_m = f64::INFINITY;
        let (svg, caption) = drawn(&data);
        assert!(!svg.contains("ends of the interval"));
        assert!(caption.contains("The interval of b begins at 20.0 m, outside the frame."), "{caption}");
        data.fits[0].misfit_chi2_per_freedom = 0.9;
        assert!(drawn(&data).1.contains("ends at a rise of 3.84."));
    }
}
