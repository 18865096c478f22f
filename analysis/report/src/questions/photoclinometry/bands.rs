//! True and recovered surface by wavelength: RMS height, RMS slope, squared coherence. Surfaces recovered on one map of one true surface
//! share a frame.

use super::surfaces::Surface;
use crate::content::{Figure, Numbers, slug};
use crate::questions::curves::HEIGHT;
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_schemas::tables::PhotoclinometryBandRow;

/// Recovered surfaces in one frame.
const CURVES_MAX: usize = 6;
const DASHES: [&str; CURVES_MAX] = ["", "7 3", "2 3", "9 3 2 3", "5 2 1 2 1 2", "1 4"];
const TRUTH: Stroke = Stroke { paint: Paint::Ink, width: 2.6, dash: "", opacity: 1.0 };

/// A quantity of an octave.
type Value = fn(&PhotoclinometryBandRow) -> f64;

/// What a frame shows: the recovered quantity, and the true one where it exists.
struct Quantity {
    id: &'static str,
    title: &'static str,
    axis: &'static str,
    truth: Option<Value>,
    recovered: Value,
    columns: &'static [&'static str],
}

const QUANTITIES: [Quantity; 3] = [
    Quantity {
        id: "photoclinometry-heights-by-wavelength",
        title: "RMS height by wavelength",
        axis: "RMS height of the octave, m",
        truth: Some(|b| b.truth_rms_m),
        recovered: |b| b.recovered_rms_m,
        columns: &["truth_rms_m", "recovered_rms_m"],
    },
    Quantity {
        id: "photoclinometry-slopes-by-wavelength",
        title: "RMS slope by wavelength",
        axis: "RMS slope of the octave",
        truth: Some(|b| b.truth_slope_rms),
        recovered: |b| b.recovered_slope_rms,
        columns: &["truth_slope_rms", "recovered_slope_rms"],
    },
    Quantity {
        id: "photoclinometry-coherence",
        title: "Squared coherence of true and recovered heights",
        axis: "squared coherence",
        truth: None,
        recovered: |b| b.coherence,
        columns: &["coherence"],
    },
];

/// The frames; empty where no true surface is known.
pub fn figures(surfaces: &[Surface], drawn: &[&Surface]) -> Vec<Figure> {
    let frames = frames(surfaces, drawn);
    frames
        .iter()
        .enumerate()
        .flat_map(|(k, frame)| QUANTITIES.iter().filter_map(move |q| figure(k, frame, q)))
        .collect()
}

/// Surfaces with octaves, by true surface and map: all of them if they fit into a frame, otherwise those that are drawn.
fn frames<'a, 'b>(surfaces: &'b [Surface<'a>], drawn: &[&'b Surface<'a>]) -> Vec<Vec<&'b Surface<'a>>> {
    let key = |s: &Surface| (s.row.surface_id.clone(), s.row.rows, s.row.cols, s.row.cell_m.to_bits());
    let mut frames: Vec<Vec<&Surface>> = Vec::new();
    for surface in surfaces.iter().filter(|s| !s.bands.is_empty()) {
        match frames.iter_mut().find(|f| key(f[0]) == key(surface)) {
            Some(frame) => frame.push(surface),
            None => frames.push(vec![surface]),
        }
    }
    for frame in frames.iter_mut().filter(|f| f.len() > CURVES_MAX) {
        frame.retain(|s| drawn.iter().any(|d| d.id() == s.id()));
        frame.truncate(CURVES_MAX);
    }
    frames.retain(|f| !f.is_empty());
    frames
}

fn middle(band: &PhotoclinometryBandRow) -> f64 {
    (band.wavelength_min_m * band.wavelength_max_m).sqrt()
}

fn points(surface: &Surface, value: Value) -> Vec<(f64, f64)> {
    surface.bands.iter().map(|b| (middle(b), value(b))).filter(|p| p.1.is_finite()).collect()
}

fn stroke(number: usize) -> Stroke {
    Stroke::new(Paint::Series(number), 2.0).dashed(DASHES[number % DASHES.len()])
}

fn figure(number: usize, frame: &[&Surface], quantity: &Quantity) -> Option<Figure> {
    let truth = quantity.truth.map(|value| points(frame[0], value));
    let curves: Vec<Vec<(f64, f64)>> = frame.iter().map(|s| points(s, quantity.recovered)).collect();
    let all = || curves.iter().chain(&truth).flatten().copied();
    let ends = |of: fn((f64, f64)) -> f64| {
        all().map(of).filter(|v| *v > 0.0).fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(v), b.max(v)))
    };
    let (x, y) = (ends(|p| p.0), ends(|p| p.1));
    if x.1 <= 0.0 || y.1 <= 0.0 {
        return None;
    }
    let id = slug(&format!("{}-{}", quantity.id, number + 1));
    let entry = |(k, s): (usize, &&Surface)| (Mark::Line(stroke(k)), s.id().to_owned());
    let name = truth.is_some().then(|| (Mark::Line(TRUTH), format!("truth ({})", frame[0].row.surface_id)));
    let legend: Vec<Entry> = name.into_iter().chain(frame.iter().enumerate().map(entry)).collect();
    let y = if truth.is_some() { Axis::log(y.0 / 1.5, 1.5 * y.1) } else { Axis::linear(0.0, 1.04) };
    let x = (Axis::log(x.0 / 1.4, 1.4 * x.1), "wavelength, m");
    let mut plot = Plot::new((WIDTH, HEIGHT), x, (y, quantity.axis), &legend);
    plot.clip(&format!("{id}-clip"));
    if let Some(points) = &truth {
        draw(&mut plot, points, TRUTH, Symbol::Disc);
    }
    curves.iter().enumerate().for_each(|(k, points)| draw(&mut plot, points, stroke(k), Symbol::Square));
    plot.svg.close();
    Some(Figure {
        title: format!("{}.", quantity.title),
        caption: format!("Cells of {}.", set::with_unit(frame[0].row.cell_m, 3, "m")),
        description: describe(frame, quantity),
        svg: plot.svg,
        numbers: numbers(frame, quantity),
        id,
    })
}

fn draw(plot: &mut Plot, points: &[(f64, f64)], stroke: Stroke, symbol: Symbol) {
    plot.line(points.iter().copied(), stroke);
    for at in plot.place(points.iter().copied()) {
        plot.svg.symbol(symbol, at, 3.2, stroke.paint);
    }
}

fn describe(frame: &[&Surface], quantity: &Quantity) -> String {
    let three = |v: f64| set::significant(v, 3);
    let octave = |b: &PhotoclinometryBandRow| {
        let recovered = three((quantity.recovered)(b));
        let words = quantity.truth.map_or_else(|| recovered.clone(), |t| format!("{recovered} of {}", three(t(b))));
        format!("{} m: {words}", three(middle(b)))
    };
    let of = |s: &&Surface| format!("{}: {}", s.id(), s.bands.iter().map(octave).collect::<Vec<_>>().join("; "));
    format!("{}. {}.", quantity.title, frame.iter().map(of).collect::<Vec<_>>().join(". "))
}

fn numbers(frame: &[&Surface], quantity: &Quantity) -> Numbers {
    let ids: Vec<String> = frame.iter().map(|s| quoted(s.id())).collect();
    let names: Vec<&str> = ["photoclinometry_id", "wavelength_min_m", "wavelength_max_m"]
        .iter()
        .chain(quantity.columns)
        .copied()
        .collect();
    let rows = frame.iter().flat_map(|s| s.bands);
    Numbers::select(&format!("photoclinometry_id in ({})", ids.join(", ")), rows, &names)
}
