//! Which design parameters matter: elementary effects of the perturbed parameters, as a stage computed them.

use crate::content::{Block, Figure, Numbers, TableBlock, slug};
use crate::data::Data;
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set_number;
use crate::render::svg::{Paint, Stroke};
use sastrugi_schemas::tables::RoverEffectRow;

/// Parameters in a figure; all are in the table.
const DRAWN_MAX: usize = 14;
/// Perturbed trials drawn.
const TRIALS_MAX: usize = 4;
/// Measures, titles of their axes, and the factor on their effects.
const MEASURES: [(&str, &str, f64); 3] = [
    ("efficiency", "change of efficiency", 1.0),
    ("arrival", "change of arrival, points", 100.0),
    ("distance_m", "change of distance, m", 1.0),
];

/// Text, figures and table; empty where nothing was perturbed.
pub fn blocks(data: &Data) -> Vec<Block> {
    let rows = &data.rover_effects;
    let Some(first) = rows.first() else { return Vec::new() };
    let figures = trials(rows).into_iter().take(TRIALS_MAX).flat_map(figures_of).collect();
    let mut blocks = vec![Block::Heading("Which design parameters matter?".into())];
    blocks.extend(verdict(rows).map(Block::Text));
    blocks.push(Block::Text(format!(
        "Parameters are changed one at a time along random trajectories, by up to {} of their value in either direction (Morris, 1991). A bar is the mean absolute effect of changing a \
         parameter by {} of its value; its line is the 95 % interval over worlds and trajectories. The tick is the effect that a mere reshuffling of the rovers' paths would show; a bar \
         that does not clearly exceed it is not evidence of an effect. Colours show the direction: a larger parameter raises the measure, lowers it, or has an unclear sign (the interval \
         of the mean effect includes 0).",
        set_number::percent(first.share, 0),
        set_number::percent(first.share, 0)
    )));
    blocks.push(Block::Figures(figures));
    blocks.push(Block::FoldedTable(table(rows)));
    blocks
}

/// Rows of one stage on the worlds of one group and variant.
fn trials(rows: &[RoverEffectRow]) -> Vec<&[RoverEffectRow]> {
    rows.chunk_by(|a, b| (&a.stage_id, &a.group, &a.variant) == (&b.stage_id, &b.group, &b.variant)).collect()
}

/// The most influential parameter for each measure of every trial.
fn verdict(rows: &[RoverEffectRow]) -> Option<String> {
    let sentence = |trial: &[RoverEffectRow]| {
        let first = trial.first()?;
        let part = |(measure, ..): &(&str, &str, f64)| {
            let strongest = trial.iter().filter(|r| r.measure == *measure && r.mu_star > 0.0).min_by_key(|r| r.rank)?;
            let words = measure.trim_end_matches("_m");
            Some(format!("{} for {words}", strongest.parameter))
        };
        let parts: Vec<String> = MEASURES.iter().filter_map(part).collect();
        let strongest = || format!("the most influential parameter is {}", parts.join(", "));
        (!parts.is_empty()).then(|| format!("{}, {}: {}.", first.stage_id, first.group, strongest()))
    };
    let words: Vec<String> = trials(rows).into_iter().take(TRIALS_MAX).filter_map(sentence).collect();
    (!words.is_empty()).then(|| words.join(" "))
}

fn figures_of(trial: &[RoverEffectRow]) -> Vec<Figure> {
    MEASURES.iter().filter_map(|m| figure(trial, *m)).collect()
}

fn figure(trial: &[RoverEffectRow], (measure, title, factor): (&str, &str, f64)) -> Option<Figure> {
    let mut rows: Vec<&RoverEffectRow> =
        trial.iter().filter(|r| r.measure == measure && r.mu_star > 0.0 && r.mu_star.is_finite()).collect();
    rows.sort_by(|a, b| a.rank.cmp(&b.rank).then_with(|| a.parameter.cmp(&b.parameter)));
    let first = *rows.first()?;
    rows.truncate(DRAWN_MAX);
    let scaled = |r: &RoverEffectRow, v: f64| factor * r.share * v;
    let ends = rows.iter().flat_map(|r| [r.mu_star, r.mu_star_high, r.mu_star_noise].map(|v| scaled(r, v)));
    let most = ends.filter(|v| v.is_finite()).fold(0.0, f64::max);
    let labels: Vec<RowLabel> = rows.iter().map(|r| label(r)).collect();
    let mut legend: Vec<Entry> = Vec::new();
    for (paint, words) in [(RAISES, "raises"), (LOWERS, "lowers"), (UNKNOWN, "sign unclear")] {
        if rows.iter().any(|r| paint_of(r) == paint) {
            legend.push((Mark::Fill(paint), words.into()));
        }
    }
    let axis = Axis::linear(0.0, if most > 0.0 { 1.05 * most } else { 1.0 });
    let mut frame = Rows::new(&labels, 32.0, (axis, title), &legend);
    for (k, row) in rows.iter().enumerate() {
        let y = frame.centre(k);
        let at = |v: f64| frame.x.clamped(scaled(row, v)).filter(|_| v.is_finite());
        let (from, bar) = (at(0.0), at(row.mu_star));
        let (low, high, noise) = (at(row.mu_star_low), at(row.mu_star_high), at(row.mu_star_noise));
        if let (Some(from), Some(to)) = (from, bar) {
            frame.svg.rect((from, y - 7.0), (to - from, 14.0), paint_of(row), 0.85);
        }
        if let (Some(low), Some(high)) = (low, high) {
            frame.svg.segment((low, y), (high, y), Stroke::new(Paint::Ink, 1.8));
        }
        if let Some(noise) = noise {
            frame.svg.segment((noise, y - 11.0), (noise, y + 11.0), Stroke::new(Paint::Muted, 1.6).dashed("2 2"));
        }
    }
    let id = slug(&format!("rover-effects-{}-{}-{}-{measure}", first.stage_id, first.group, first.variant));
    let condition = format!(
        "stage_id = {} and \"group\" = {} and variant = {} and measure = {}",
        quoted(&first.stage_id),
        quoted(&first.group),
        quoted(&first.variant),
        quoted(measure)
    );
    let variant = if first.variant.is_empty() { String::new() } else { format!(", {}", first.variant) };
    let columns = [
        "parameter",
        "rank",
        "base",
        "unit",
        "mu",
        "mu_low",
        "mu_high",
        "mu_star",
        "mu_star_low",
        "mu_star_high",
        "sigma",
        "mu_star_noise",
        "share",
    ];
    let all = trial.iter().filter(|r| r.measure == measure);
    let none = match all.clone().filter(|r| r.mu_star == 0.0).count() {
        0 => String::new(),
        n => format!(" ({} without any effect)", set_number::count(n)),
    };
    Some(Figure {
        id,
        title: format!("{}, {}{variant}.", first.stage_id, first.group),
        caption: format!(
            "{} of {}{none}, {} on {}.",
            set_number::count(rows.len()),
            set_number::counted(all.clone().count(), "parameter"),
            if first.trajectories == 1 {
                "1 trajectory".to_owned()
            } else {
                format!("{} trajectories", first.trajectories)
            },
            set_number::counted(usize::try_from(first.worlds).unwrap_or(0), "world")
        ),
        description: describe(&rows, title, factor),
        svg: frame.svg,
        numbers: Numbers::select(&condition, all, &columns),
    })
}

const RAISES: Paint = Paint::Series(0);
const LOWERS: Paint = Paint::Series(1);
const UNKNOWN: Paint = Paint::Muted;

fn paint_of(row: &RoverEffectRow) -> Paint {
    match row {
        r if r.mu_low > 0.0 => RAISES,
        r if r.mu_high < 0.0 => LOWERS,
        _ => UNKNOWN,
    }
}

/// The parameter and its value in the study.
fn label(row: &RoverEffectRow) -> RowLabel {
    let unit = if row.unit == "1" { "" } else { row.unit.as_str() };
    let detail =
        if row.base.is_finite() { format!("{} {unit}", set_number::plain(row.base, 4)) } else { String::new() };
    let name = row.parameter.rsplit('.').next().unwrap_or_default();
    let name = name.strip_suffix(&format!("_{}", row.unit)).unwrap_or(name);
    RowLabel { name: name.replace('_', " "), detail: detail.trim_end().to_owned() }
}

fn describe(rows: &[&RoverEffectRow], title: &str, factor: f64) -> String {
    let part =
        |r: &&RoverEffectRow| format!("{} {}", r.parameter, set_number::significant(factor * r.share * r.mu_star, 2));
    format!("Mean absolute {title}: {}.", rows.iter().take(6).map(part).collect::<Vec<_>>().join(", "))
}

fn table(rows: &[RoverEffectRow]) -> TableBlock {
    let columns = [
        "stage_id",
        "group",
        "variant",
        "measure",
        "rank",
        "parameter",
        "base",
        "unit",
        "measure_mean",
        "mu",
        "mu_low",
        "mu_high",
        "mu_star",
        "mu_star_low",
        "mu_star_high",
        "sigma",
        "mu_star_noise",
        "measure_unit",
        "share",
        "trajectories",
        "worlds",
        "rovers",
    ];
    let numbers = Numbers::select("", rows, &columns).with_mixed_units();
    TableBlock { id: "rover-effects".into(), caption: "Elementary effects of all parameters".into(), numbers }
}
