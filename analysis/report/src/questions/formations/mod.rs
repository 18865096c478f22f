//! How well teams keep formation: errors, separation and outcome by formation and group, errors over time, tracks.

use super::team::{IN_RANGE, Scene, TOLERABLE, errors, runs, tracks};
use super::{Question, sql};
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, slug, text};
use crate::data::{Data, Natural, natural};
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::FormationRow;
use std::collections::BTreeMap;

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "formations", name: "Formations", title: "Do the teams keep formation?", answer };

/// Largest number of sets of runs drawn.
const DRAWN_MAX: usize = 12;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    if data.formations.is_empty() {
        return Ok(Vec::new());
    }
    let mut blocks = Vec::new();
    blocks.extend(verdict(data).map(Block::Result));
    blocks.extend(unfinished(data).map(Block::Warning));
    blocks.push(Block::Text(format!(
        "The error of a follower is its offset from its slot, along (depth) and across (width) its predecessor's direction of travel. \
         Values are mean absolute errors over followers and time. A team is in range if both errors are at most {} of the spacing, and \
         in tolerance if they are at most {} (Bayrak, 2008, section 5.3). Group values are means over runs; the least separation is the \
         smallest over all runs.",
        set::percent(IN_RANGE, 0),
        set::percent(TOLERABLE, 0)
    )));
    blocks.push(Block::Table(table(data)));
    let sets = sets(data);
    let mut curves = Vec::new();
    let mut maps = Vec::new();
    for set in sets.iter().take(DRAWN_MAX) {
        curves.extend(curve(data, set)?);
        maps.extend(map(data, set)?);
    }
    section(&mut blocks, "Errors over time", CURVES, curves);
    section(&mut blocks, "Tracks", TRACKS, maps);
    blocks.push(Block::FoldedTable(all(data)));
    Ok(blocks)
}

const CURVES: &str = "Means over followers, then over runs, in sixty equal time intervals; bands hold 5 to 95 % of the runs. Runs that have \
ended drop out, so late times represent only the long runs.";
const TRACKS: &str = "One run of each formation: the one with the median depth error (the lower middle of an even number) among those that \
arrived, or among all if none did. The window is fourteen spacings wide and centred on the leader halfway through the run.";

fn section(blocks: &mut Vec<Block>, heading: &str, words: &str, figures: Vec<Figure>) {
    if !figures.is_empty() {
        blocks.extend([Block::Heading(heading.into()), Block::Text(words.into()), Block::Figures(figures)]);
    }
}

/// Runs that did not arrive, in a sentence.
fn unfinished(data: &Data) -> Option<String> {
    let of = |outcome: &str| data.formations.iter().filter(|f| f.outcome == outcome).count();
    let words = [
        ("stuck", "stuck"),
        ("timeout", "timed out"),
        ("team_lost", "with all members lost"),
        ("no_path", "without a path"),
    ];
    let ends: Vec<String> = words
        .iter()
        .map(|(o, w)| (of(o), w))
        .filter(|e| e.0 > 0)
        .map(|(n, w)| format!("{} {w}", set::count(n)))
        .collect();
    (!ends.is_empty()).then(|| {
        format!(
            "{} of {} did not arrive: {}. The errors of such a run count until it ended.",
            set::count(data.formations.iter().filter(|f| f.outcome != "arrived").count()),
            set::counted(data.formations.len(), "run"),
            ends.join(", ")
        )
    })
}

/// How much of the time errors are tolerable, in a sentence; `None` where no run has followers.
fn verdict(data: &Data) -> Option<String> {
    let known: Vec<&FormationRow> = data.formations.iter().filter(|f| f.tolerable.is_finite()).collect();
    let share = |of: fn(&FormationRow) -> f64| sums::mean(&known.iter().map(|f| of(f)).collect::<Vec<_>>());
    (!known.is_empty()).then(|| {
        format!(
            "Teams stay in tolerance {} of the time and in range {} of the time, averaged over the {} with followers.",
            set::percent(share(|f| f.tolerable), 0),
            set::percent(share(|f| f.in_range), 0),
            set::counted(known.len(), "run")
        )
    })
}

/// Runs of one stage and variant in one formation.
struct Set<'a> {
    name: String,
    runs: Vec<&'a FormationRow>,
}

fn sets(data: &Data) -> Vec<Set<'_>> {
    let mut sets: BTreeMap<(Natural, Option<Natural>, &str), Vec<&FormationRow>> = BTreeMap::new();
    for run in &data.formations {
        let key = (natural(&run.stage_id), run.variant.as_deref().map(natural), run.formation.as_str());
        sets.entry(key).or_default().push(run);
    }
    let formations: Vec<&str> = sets.keys().map(|(.., formation)| *formation).collect();
    let is_single = |formation: &str| formations.iter().filter(|other| **other == formation).count() == 1;
    let name = |stage: Natural, variant: Option<Natural>, formation: &str| {
        if is_single(formation) {
            return formation.to_owned();
        }
        let variant = variant.map_or_else(String::new, |v| format!(", {}", v.1));
        let stage = if stage.1 == formation { String::new() } else { format!(", {}", stage.1) };
        format!("{formation}{stage}{variant}")
    };
    sets.into_iter().map(|((s, v, f), runs)| Set { name: name(s, v, f), runs }).collect()
}

fn table(data: &Data) -> TableBlock {
    let columns = [
        ("formation", ""),
        ("group", ""),
        ("runs", "1"),
        ("arrived", "1"),
        ("depth error", "m"),
        ("width error", "m"),
        ("worst depth error", "m"),
        ("worst width error", "m"),
        ("in range", "%"),
        ("in tolerance", "%"),
        ("least separation", "m"),
        ("waits", "1"),
        ("dodges", "1"),
        ("squeezed", "1"),
        ("time", "s"),
    ];
    let query = "select formation, \"group\", stage_id, variant, outcome, depth_error_m, width_error_m, worst_depth_error_m, worst_width_error_m, \
                 in_range, tolerable, least_separation_m, waits, dodges, squeezed, time_s from 'tables/formations/*.parquet'";
    let mut numbers = Numbers::computed(query, &columns);
    for Set { name, runs } in sets(data) {
        let mut groups: BTreeMap<Natural, Vec<&FormationRow>> = BTreeMap::new();
        runs.iter().for_each(|r| groups.entry(natural(r.group.as_deref().unwrap_or("all"))).or_default().push(r));
        for (group, runs) in groups {
            let mean = |of: fn(&FormationRow) -> f64| {
                number(sums::mean(&sums::finite(&runs.iter().map(|r| of(r)).collect::<Vec<_>>())))
            };
            let least = runs.iter().map(|r| r.least_separation_m).fold(f64::INFINITY, f64::min);
            numbers.row([
                text(&name),
                text(group.1),
                count(runs.len()),
                count(runs.iter().filter(|r| r.outcome == "arrived").count()),
                mean(|r| r.depth_error_m),
                mean(|r| r.width_error_m),
                mean(|r| r.worst_depth_error_m),
                mean(|r| r.worst_width_error_m),
                mean(|r| 100.0 * r.in_range),
                mean(|r| 100.0 * r.tolerable),
                number(least),
                mean(|r| r.waits as f64),
                mean(|r| r.dodges as f64),
                mean(|r| r.squeezed as f64),
                mean(|r| r.time_s),
            ]);
        }
    }
    TableBlock { id: "formation-errors".into(), caption: "Formations by group, means over runs".into(), numbers }
}

fn curve(data: &Data, set: &Set) -> Result<Option<Figure>, ReportError> {
    let runs = runs(data, &set.runs)?;
    let series: Vec<_> = runs.into_iter().map(|r| r.instants).filter(|i| !i.is_empty()).collect();
    let words = [format!("Errors of {}.", set.name), format!("{}.", set::counted(series.len(), "run"))];
    Ok(errors(slug(&format!("formation-errors-{}", set.name)), words, &series, "time, s", samples_of(set)))
}

/// Query for the samples of a set of runs.
fn samples_of(set: &Set) -> String {
    let ids: Vec<String> = set
        .runs
        .iter()
        .map(|r| sql::quoted(&r.run_id))
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .collect();
    format!(
        "select terrain_id, run_id, member, time_s, depth_error_m, width_error_m from 'tables/formation_samples/*.parquet' where run_id in ({}) and \
         state != 'lost'",
        ids.join(", ")
    )
}

fn map(data: &Data, set: &Set) -> Result<Option<Figure>, ReportError> {
    let arrived: Vec<&FormationRow> = set.runs.iter().copied().filter(|r| r.outcome == "arrived").collect();
    let mut ranked = if arrived.is_empty() { set.runs.clone() } else { arrived };
    ranked.sort_by(|a, b| a.depth_error_m.total_cmp(&b.depth_error_m));
    let Some(run) = ranked.get(ranked.len().saturating_sub(1) / 2) else { return Ok(None) };
    let scene = Scene {
        id: slug(&format!("formation-tracks-{}", set.name)),
        title: format!("Tracks of {}.", set.name),
        run,
        time_s: 0.5 * run.time_s,
        member: 1,
        marks: "halfway",
    };
    tracks(data, scene)
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "terrain_id",
        "run_id",
        "group",
        "variant",
        "formation",
        "members",
        "lost",
        "outcome",
        "stuck_member",
        "time_s",
        "depth_error_m",
        "width_error_m",
        "in_range",
        "tolerable",
        "least_separation_m",
        "replans",
        "path",
    ];
    let numbers = Numbers::select("", &data.formations, &names);
    TableBlock { id: "formations".into(), caption: "All runs of teams".into(), numbers }
}
