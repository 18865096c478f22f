//! How errors grow with a swept setting: slope error with its ceiling, height error minus the mean and minus the plane.

use super::surfaces::Surface;
use crate::content::{Block, Figure, Numbers, number, slug, text};
use crate::questions::curves::HEIGHT;
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH};
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke, Symbol};

/// Sweeps drawn; the table of errors lists all.
const DRAWN_MAX: usize = 8;
const WORDS: &str = "One setting is swept and all others are fixed. A wrong exposure or sun position tilts the surface, which affects heights but \
hardly the shading. A misplaced image does the reverse.";

/// A curve: its name, line, mark and value of a surface.
type Curve = (&'static str, Stroke, Symbol, fn(&Surface) -> f64);

const SLOPES: [Curve; 2] = [
    ("recovered", Stroke { paint: Paint::Series(0), width: 2.0, dash: "", opacity: 1.0 }, Symbol::Square, |s| {
        s.row.slope_error_rms
    }),
    ("ceiling", Stroke { paint: Paint::Ink, width: 1.6, dash: "6 4", opacity: 1.0 }, Symbol::Disc, |s| {
        s.row.slope_error_rms_ceiling
    }),
];
const HEIGHTS: [Curve; 2] = [
    ("minus the mean", Stroke { paint: Paint::Series(1), width: 2.0, dash: "", opacity: 1.0 }, Symbol::Square, |s| {
        s.row.height_error_rms_m
    }),
    (
        "minus the plane",
        Stroke { paint: Paint::Series(2), width: 2.0, dash: "7 3", opacity: 1.0 },
        Symbol::Triangle,
        |s| s.row.height_error_rms_detrended_m,
    ),
];

/// A swept setting with its values, in order.
struct Sweep<'a, 'b> {
    item: &'a str,
    surface: &'a str,
    setting: &'a str,
    places: Vec<(f64, &'b Surface<'a>)>,
}

/// Name and value of a variant that sweeps one number; `None` for words or several settings.
fn parse(variant: &str) -> Option<(&str, f64)> {
    let (name, value) = variant.split_once(" = ")?;
    Some((name.trim(), value.trim().parse().ok().filter(|v: &f64| v.is_finite())?))
}

fn sweeps<'a, 'b>(surfaces: &'b [Surface<'a>]) -> Vec<Sweep<'a, 'b>> {
    let mut sweeps: Vec<Sweep> = Vec::new();
    for surface in surfaces.iter().filter(|s| s.compared()) {
        let Some((setting, value)) = surface.row.variant.as_deref().and_then(parse) else { continue };
        let (item, of) = (surface.row.item_id.as_str(), surface.row.surface_id.as_str());
        match sweeps.iter_mut().find(|s| (s.item, s.surface, s.setting) == (item, of, setting)) {
            Some(sweep) => sweep.places.push((value, surface)),
            None => sweeps.push(Sweep { item, surface: of, setting, places: vec![(value, surface)] }),
        }
    }
    sweeps.iter_mut().for_each(|s| s.places.sort_by(|a, b| a.0.total_cmp(&b.0)));
    sweeps.retain(|s| s.places.len() > 1);
    sweeps
}

/// Text and figures; empty where no number is swept.
pub fn blocks(surfaces: &[Surface]) -> Vec<Block> {
    let sweeps = sweeps(surfaces);
    let figures: Vec<Figure> = sweeps
        .iter()
        .take(DRAWN_MAX)
        .flat_map(|s| {
            [figure(s, "slopes", "RMS slope error", &SLOPES), figure(s, "heights", "RMS height error, m", &HEIGHTS)]
        })
        .collect();
    if figures.is_empty() {
        return Vec::new();
    }
    let mut blocks = vec![Block::Heading("How errors grow".into()), Block::Text(WORDS.into())];
    if sweeps.len() > DRAWN_MAX {
        blocks.push(Block::Text(format!(
            "The first {DRAWN_MAX} of {} sweeps are drawn; the table of errors lists all.",
            set::count(sweeps.len())
        )));
    }
    blocks.push(Block::Figures(figures));
    blocks
}

fn figure(sweep: &Sweep, what: &str, axis: &str, curves: &[Curve; 2]) -> Figure {
    let id = slug(&format!("photoclinometry-sweep-{what}-{}-{}", sweep.item, sweep.surface));
    let value = |of: &Curve| sweep.places.iter().map(|(x, s)| (*x, of.3(s))).collect::<Vec<(f64, f64)>>();
    let (first, last) = (sweep.places[0].0, sweep.places[sweep.places.len() - 1].0);
    let margin = 0.03 * (last - first);
    let high = curves.iter().flat_map(value).map(|p| p.1).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let legend: Vec<Entry> = curves.iter().map(|c| (Mark::Track(c.1, c.2), c.0.to_owned())).collect();
    let x = (Axis::linear(first - margin, last + margin), sweep.setting);
    let mut plot = Plot::new((WIDTH, HEIGHT), x, (Axis::linear(0.0, 1.06 * high), axis), &legend);
    plot.clip(&format!("{id}-clip"));
    for curve in curves {
        plot.line(value(curve), curve.1);
        for at in plot.place(value(curve)) {
            plot.svg.symbol(curve.2, at, 3.6, curve.1.paint);
        }
    }
    plot.svg.close();
    let ends = |c: &Curve| {
        let of = |k: usize| set::significant(c.3(sweep.places[k].1), 3);
        format!("{} from {} to {}", c.0, of(0), of(sweep.places.len() - 1))
    };
    let mut numbers = Numbers::computed(
        format!("select * from 'tables/photoclinometry/*.parquet' where item_id = {}", quoted(sweep.item)),
        &[("photoclinometry_id", ""), (sweep.setting, ""), (curves[0].0, ""), (curves[1].0, "")],
    );
    for (x, s) in &sweep.places {
        numbers.row([text(s.id()), number(*x), number(curves[0].3(s)), number(curves[1].3(s))]);
    }
    Figure {
        id,
        title: format!("{}, {}.", sweep.item, if what == "slopes" { "slopes" } else { "heights" }),
        caption: format!("Images of {}.", sweep.surface),
        description: format!(
            "{axis} against {} from {} to {}: {}.",
            sweep.setting,
            set::plain(first, 3),
            set::plain(last, 3),
            curves.iter().map(ends).collect::<Vec<_>>().join("; ")
        ),
        svg: plot.svg,
        numbers,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_variants_of_one_number() {
        assert_eq!(parse("first_image_errors.exposure = 0.05"), Some(("first_image_errors.exposure", 0.05)));
        assert_eq!(parse("integration = paths"), None);
        assert_eq!(parse("a = 1, b = 2"), None);
        assert_eq!(parse("a = nan"), None);
    }
}
