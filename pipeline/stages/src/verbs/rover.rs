//! `rover`: runs the rover trials of a study, perturbed on request, and summarises them.
//!
//! The study that is run and released is the given one, reduced to what rovers need and with the key `perturb` set. `run` on it gives
//! the same release.

use crate::error::Error;
use crate::job::ItemRef;
use crate::jobs::{rover, rover_designs, rover_effects};
use crate::loaded::{Loaded, load_text, read};
use sastrugi_mobility::rover::Ending;
use sastrugi_numeric::{Stream, Streams, sums};
use sastrugi_schemas::Record;
use sastrugi_schemas::study::Perturb;
use sastrugi_schemas::tables::{RoverEffectRow, RoverRow};
use sastrugi_statistics::{Interval, cluster_interval, proportion};
use sastrugi_store::release::{Release, for_each_artifact};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;
use toml_edit::{DocumentMut, InlineTable, Item, TableLike};

/// Stage whose results are reported.
pub const PURPOSE: &str = rover::STAGE;
/// Stages whose items are run, with their parents.
const STAGES: [&str; 3] = [rover::STAGE, rover_designs::STAGE, rover_effects::STAGE];
/// Sections of which only the tables that rovers need are kept.
const SECTIONS: [&str; 4] = ["dem", "terrain", "fit", "texture"];
/// Sections kept unchanged.
const KEPT: [&str; 3] = ["study", "roughness", "rover"];
/// Coverage of the intervals.
const LEVEL: f64 = 0.95;
/// Bootstrap replicates of an interval.
const REDRAWS: usize = 2000;

/// A request for perturbations.
#[derive(Clone, Copy, Debug, Default)]
pub struct Request {
    /// Largest relative change of the parameters of every navigator; if absent, no perturbation is added.
    pub share: Option<f64>,
    /// Trajectories of each perturbation.
    pub trajectories: Option<u32>,
}

/// The share of `--perturb`: `10%` or `0.1`.
///
/// # Errors
/// Anything else, or a share that is not above 0 and below 1.
pub fn share(text: &str) -> Result<f64, Error> {
    let number = |t: &str| t.trim().parse::<f64>().ok();
    let share = match text.trim().strip_suffix('%') {
        Some(percent) => number(percent).map(|p| p / 100.0),
        None => number(text),
    };
    match share {
        Some(share) if Perturb { share, ..Perturb::default() }.check().is_ok() => Ok(share),
        _ => {
            Err(Error::Usage(format!("`--perturb {text}`: must be a share above 0 and below 100%, such as 10% or 0.1")))
        }
    }
}

/// The rover trials of a study.
pub struct Trials {
    /// The study, reduced to them.
    pub loaded: Loaded,
    /// Items of the complete study that it lacks.
    left_out: HashSet<ItemRef>,
}

impl Trials {
    /// Refuses a destination with a release of the complete study, which the release of the trials would replace by a part, unless it may be
    /// replaced.
    ///
    /// # Errors
    /// Such a destination.
    pub fn check_destination(&self, dest: &Path, replace: bool) -> Result<(), Error> {
        let mut lost = None;
        let manifest = for_each_artifact(dest, |artifact| {
            let item = ItemRef { stage: artifact.origin.stage, id: artifact.origin.item };
            if lost.is_none() && self.left_out.contains(&item) {
                lost = Some(item);
            }
        });
        match (manifest, lost) {
            // A release of another name is refused as one of another study.
            (Ok(there), Some(item)) if there.name == self.loaded.study.head.name && !replace => {
                Err(Error::Usage(format!(
                    "{} is a release with more than the rovers of this study, such as {item}; choose another folder with -o, or use --replace to replace it",
                    dest.display()
                )))
            }
            _ => Ok(()),
        }
    }
}

/// Loads the rover trials of a study.
///
/// # Errors
/// A study that is invalid or has no rovers; trajectories without a perturbation.
pub fn load(study: &Path, request: &Request) -> Result<Trials, Error> {
    let (text, name, folder) = (read(study)?, study.display().to_string(), study.parent().unwrap_or(Path::new("")));
    let whole = load_text(&text, &name, folder)?;
    let wanted = (0..whole.graph.len()).filter(|&p| STAGES.contains(&whole.graph.node(p).item.stage.as_str()));
    let needed = whole.graph.closure(wanted);
    if needed.is_empty() {
        return Err(Error::Usage(format!(
            "{name}: the study has no rovers; add a [[rover]] table (see `sastrugi kinds`)"
        )));
    }
    let origins = needed.iter().filter_map(|&p| whole.origins.get(&whole.graph.node(p).item.id));
    let edited = edit(&text, &origins.copied().collect(), request).map_err(|e| Error::Usage(format!("{name}: {e}")))?;
    let loaded = load_text(&edited, &name, folder)?;
    // In ascending order. A table is kept with all its items, also those that no rover needs.
    let is_needed = |p: usize| needed.binary_search(&p).is_ok();
    let items = whole.graph.nodes().iter().enumerate().filter(|(p, _)| !is_needed(*p)).map(|(_, node)| &node.item);
    let left_out = items.filter(|item| loaded.graph.find(item).is_none()).cloned().collect();
    Ok(Trials { loaded, left_out })
}

/// The study's text, reduced to what rovers need and perturbed as requested.
fn edit(text: &str, needed: &BTreeSet<(&str, usize)>, request: &Request) -> Result<String, String> {
    let mut document: DocumentMut =
        text.trim_start_matches('\u{feff}').parse().map_err(|e| format!("not valid TOML: {e}"))?;
    let sections: Vec<String> = document.iter().map(|(name, _)| name.to_owned()).collect();
    for section in sections.iter().map(String::as_str).filter(|section| !KEPT.contains(section)) {
        let left = match document.get_mut(section) {
            Some(item) if SECTIONS.contains(&section) => keep(item, |k| needed.contains(&(section, k))),
            _ => 0,
        };
        if left == 0 {
            document.remove(section);
        }
    }
    let mut perturbed = false;
    for table in document.get_mut(rover::STAGE).map_or_else(Vec::new, tables) {
        perturb(table, request);
        perturbed |= table.contains_key("perturb");
    }
    if request.trajectories.is_some() && !perturbed {
        return Err("`--trajectories` needs --perturb or a [[rover]] with the key `perturb`".to_owned());
    }
    Ok(document.to_string())
}

/// Removes tables by position; returns how many are left.
fn keep(item: &mut Item, wanted: impl Fn(usize) -> bool) -> usize {
    match item {
        Item::ArrayOfTables(tables) => {
            (0..tables.len()).rev().filter(|&k| !wanted(k)).for_each(|k| drop(tables.remove(k)));
            tables.len()
        }
        Item::Value(toml_edit::Value::Array(tables)) => {
            (0..tables.len()).rev().filter(|&k| !wanted(k)).for_each(|k| drop(tables.remove(k)));
            tables.len()
        }
        _ => 0,
    }
}

/// The tables of a section.
fn tables(item: &mut Item) -> Vec<&mut dyn TableLike> {
    match item {
        Item::ArrayOfTables(tables) => tables.iter_mut().map(|t| t as &mut dyn TableLike).collect(),
        Item::Value(toml_edit::Value::Array(tables)) => {
            tables.iter_mut().filter_map(|t| t.as_inline_table_mut().map(|t| t as &mut dyn TableLike)).collect()
        }
        _ => Vec::new(),
    }
}

/// Sets the requested keys; other settings of a perturbation stay.
fn perturb(rover: &mut dyn TableLike, request: &Request) {
    if request.share.is_some() && !rover.contains_key("perturb") {
        rover.insert("perturb", toml_edit::value(InlineTable::new()));
    }
    let Some(settings) = rover.get_mut("perturb").and_then(Item::as_table_like_mut) else { return };
    if let Some(share) = request.share {
        settings.insert("share", toml_edit::value(share));
    }
    if let Some(trajectories) = request.trajectories {
        settings.insert("trajectories", toml_edit::value(i64::from(trajectories)));
    }
}

/// An estimate with the ends of its interval; NaN without one.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Estimated {
    /// Estimate.
    pub estimate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimated {
    fn new(estimate: f64, interval: Option<Interval>) -> Self {
        let (low, high) = interval.map_or((f64::NAN, f64::NAN), |i| (i.low, i.high));
        Self { estimate, low, high }
    }
}

/// Rovers of one stage on the terrains of one group.
#[derive(Clone, Debug, Serialize)]
pub struct TrialSummary {
    /// Rover stage.
    pub stage_id: String,
    /// Label of the terrains.
    pub group: Option<String>,
    /// Swept parameters of terrain and rover.
    pub variant: Option<String>,
    /// Navigator.
    pub navigator: String,
    /// Rovers.
    pub rovers: usize,
    /// Worlds.
    pub worlds: usize,
    /// Rovers that reached the goal.
    pub arrived: usize,
    /// Their share, with an interval over worlds, not rovers (Clopper and Pearson, of the shares of worlds).
    pub arrival: Estimated,
    /// Mean efficiency, with a bootstrap interval over worlds; none for a single world.
    pub efficiency: Estimated,
    /// Distance from start to goal over mean distance driven.
    pub straight_over_mean_distance: f64,
    /// Mean distance driven, m; rovers that stopped before the goal count with the distance they drove.
    pub mean_distance_m: f64,
    /// Mean efficiency of those that arrived; NaN if none did.
    pub efficiency_of_arrivals: f64,
    /// Rovers that left the ground; their efficiency counts as 0.
    pub off_ground: usize,
    /// Rovers that stopped at their distance or cycle limit: their distances are censored.
    pub at_limit: usize,
}

/// Results of the rovers of a release.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Trials, by stage, group and variant.
    pub trials: Vec<TrialSummary>,
    /// Rows of the table `rover_effects`.
    pub effects: Vec<Value>,
    /// The same as rows.
    #[serde(skip)]
    pub ranking: Vec<RoverEffectRow>,
}

/// Reads the results of the rovers of a release.
///
/// # Errors
/// A release that cannot be read.
pub fn summary(release: &Path) -> Result<Summary, Error> {
    let release = Release::open(release).map_err(Error::from)?;
    let streams = Streams::for_item(release.manifest().seed, rover::STAGE, "summary");
    let mut trials: BTreeMap<_, Vec<RoverRow>> = BTreeMap::new();
    for row in release.rows::<RoverRow>().map_err(Error::from)? {
        trials.entry((row.stage_id.clone(), row.group.clone(), row.variant.clone())).or_default().push(row);
    }
    let one = |((stage_id, group, variant), rows): ((String, Option<String>, Option<String>), Vec<RoverRow>)| {
        let words = [&stage_id, group.as_ref().unwrap_or(&stage_id), variant.as_ref().unwrap_or(&stage_id)];
        let mut stream = streams.stream(&words.map(String::as_str).join(" "));
        TrialSummary { stage_id, group, variant, ..of_trial(&rows, &mut stream) }
    };
    let mut ranking: Vec<RoverEffectRow> = release.rows().map_err(Error::from)?;
    ranking.sort_by(|a, b| {
        let key =
            |r: &RoverEffectRow| (r.stage_id.clone(), r.group.clone(), r.variant.clone(), r.measure.clone(), r.rank);
        key(a).cmp(&key(b))
    });
    let effects = ranking.iter().map(Record::to_json).collect();
    Ok(Summary { trials: trials.into_iter().map(one).collect(), effects, ranking })
}

fn of_trial(rows: &[RoverRow], stream: &mut Stream) -> TrialSummary {
    let mut worlds: BTreeMap<&str, Vec<&RoverRow>> = BTreeMap::new();
    rows.iter().for_each(|row| worlds.entry(&row.terrain_id).or_default().push(row));
    let mean_of =
        |rows: &[&RoverRow], of: fn(&RoverRow) -> f64| sums::mean(&rows.iter().map(|row| of(row)).collect::<Vec<_>>());
    let by_world = |of: fn(&RoverRow) -> f64| worlds.values().map(|rows| mean_of(rows, of)).collect::<Vec<f64>>();
    let reached = |row: &RoverRow| if row.outcome == "reached" { 1.0 } else { 0.0 };
    let is_off = |row: &RoverRow| row.outcome == Ending::OFF_GROUND;
    // As `Drive::counted_efficiency`.
    let efficiencies = by_world(|row| if row.outcome == Ending::OFF_GROUND { 0.0 } else { row.efficiency });
    let arrivals: Vec<f64> = rows.iter().filter(|row| reached(row) > 0.0).map(|row| row.efficiency).collect();
    // All worlds have the same number of rovers, so the mean of their means is the overall mean.
    let of_worlds = |drawn: &[Vec<usize>]| sums::mean(&drawn[0].iter().map(|&w| efficiencies[w]).collect::<Vec<_>>());
    let arrival = by_world(reached);
    let stayed: Vec<&RoverRow> = rows.iter().filter(|row| !is_off(row)).collect();
    let mean_distance_m = mean_of(&stayed, |row| row.distance_m);
    TrialSummary {
        stage_id: String::new(),
        group: None,
        variant: None,
        navigator: rows.first().map_or_else(String::new, |row| row.navigator.clone()),
        rovers: rows.len(),
        worlds: worlds.len(),
        arrived: rows.iter().filter(|row| reached(row) > 0.0).count(),
        arrival: Estimated::new(sums::mean(&arrival), proportion::of_shares(&arrival, LEVEL)),
        efficiency: Estimated::new(
            sums::mean(&efficiencies),
            cluster_interval(&[efficiencies.len()], REDRAWS, LEVEL, stream, of_worlds),
        ),
        straight_over_mean_distance: mean_of(&stayed, |row| row.straight_m) / mean_distance_m,
        mean_distance_m,
        efficiency_of_arrivals: if arrivals.is_empty() { f64::NAN } else { sums::mean(&arrivals) },
        off_ground: rows.iter().filter(|row| is_off(row)).count(),
        at_limit: rows.iter().filter(|row| ["distance_limit", "cycle_limit"].contains(&row.outcome.as_str())).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runner::assemble::head;
    use sastrugi_schemas::manifest::Origin;
    use sastrugi_store::release::ReleaseBuilder;

    const STUDY: &str = "# A study.\n[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"a\"\nkind = \"multifractal\"\n\
        count = 2\nsize_px = [64, 64]\n\n# Not for rovers.\n[[terrain]]\nid = \"b\"\nkind = \"multifractal\"\nsize_px = [64, 64]\n\n\
        [[missions]]\nid = \"m\"\nterrains = [\"a\", \"b\"]\nlength_m = 2.0\nborder_m = 0.5\n\n\
        [[rover]]\nid = \"r\"\nkind = \"sojourner_like\"\nterrains = [\"a-0002\"]\n\
        rovers = 3\ncentre_m = [1.6, 1.6]\nradius_m = 1.0\nnoise = { turn = 0.1 }\n\n\
        [[rover]]\nid = \"q\"\nkind = \"schoppers_like\"\nterrains = [\"a\"]\nrovers = 3\ncentre_m = [1.6, 1.6]\nradius_m = 1.0\n\
        perturb.parameters = [\"commit_m\"]\n";

    fn loaded(text: &str, request: Request) -> Result<Loaded, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.toml");
        std::fs::write(&path, text).unwrap();
        load(&path, &request).map(|trials| trials.loaded).map_err(|e| e.to_string())
    }

    /// A release with what the trials leave out is the whole study's. Items that the trials share with it, or that were perturbed otherwise, are
    /// no reason to keep it.
    #[test]
    fn val_a_release_of_the_whole_study_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let [path, dest] = ["study.toml", "release"].map(|name| folder.path().join(name));
        std::fs::write(&path, STUDY).unwrap();
        let trials = load(&path, &Request { trajectories: Some(2), ..Request::default() }).unwrap();
        let said = |replace| trials.check_destination(&dest, replace).err().map(|e| e.to_string()).unwrap_or_default();
        assert_eq!(said(false), "");
        let whole = load_text(STUDY, "study", folder.path()).unwrap();
        let release_of = |is_kept: &dyn Fn(&ItemRef) -> bool| {
            let mut builder = ReleaseBuilder::beside(&dest, head(&whole.study, &whole.released)).unwrap();
            for item in whole.graph.nodes().iter().map(|node| &node.item).filter(|item| is_kept(item)) {
                let origin = Origin { stage: item.stage.clone(), item: item.id.clone(), ..Origin::default() };
                builder.write_text(&format!("{item}.txt"), "made", origin).unwrap();
            }
            builder.seal(&dest).unwrap();
        };
        release_of(&|item| item.id != "b" && !item.id.starts_with("m"));
        assert_eq!(said(false), "");
        release_of(&|item| item.id == "b");
        let refused = said(false);
        assert!(refused.contains("release is a release with more than the rovers of this study, such as"), "{refused}");
        assert!(refused.contains("/b; choose another folder with -o, or use --replace"), "{refused}");
        assert_eq!(said(true), "");
    }

    #[test]
    fn val_only_what_rovers_need_is_left() {
        let plain = loaded(STUDY, Request::default()).unwrap();
        assert!(plain.released.starts_with("# A study.\n[study]"));
        assert!(!plain.released.contains("missions") && !plain.released.contains("\"b\""), "{}", plain.released);
        // Two terrains with their descriptions; rovers on one and on two; ten trajectories on two, and their effects.
        assert_eq!(plain.graph.len(), 2 + 2 + 1 + 2 + 20 + 1);
        // The items have the same keys as in the complete study, so nothing is computed twice.
        let whole = load_text(STUDY, "study", Path::new("")).unwrap();
        for (position, node) in plain.graph.nodes().iter().enumerate() {
            let there = whole.graph.find(&node.item).unwrap();
            assert_eq!(whole.graph.key(there), plain.graph.key(position), "{}", node.item);
        }
    }

    #[test]
    fn val_every_rover_is_perturbed() {
        let request = Request { share: Some(0.2), trajectories: Some(2) };
        let perturbed = loaded(STUDY, request).unwrap();
        assert_eq!(perturbed.released.matches("share = 0.2").count(), 2, "{}", perturbed.released);
        assert!(perturbed.released.contains("perturb.parameters = [\"commit_m\"]"), "{}", perturbed.released);
        assert_eq!(perturbed.graph.len(), 2 + 2 + 1 + 2 + 2 + 1 + 4 + 1);
        let rover =
            "{ id = \"r\", kind = \"sojourner_like\", terrains = [\"a\"], centre_m = [1.6, 1.6], radius_m = 1.0 }";
        let inline = STUDY.split("[[rover]]").next().unwrap().replace("# A study.\n", &format!("rover = [{rover}]\n"));
        let perturbed = loaded(&inline, request).unwrap();
        assert!(perturbed.released.contains("perturb = { share = 0.2, trajectories = 2 }"), "{}", perturbed.released);
    }

    #[test]
    fn val_refusals() {
        let refused = |text: &str, request, words: &str| {
            let error = loaded(text, request).err().unwrap();
            assert!(error.contains(words), "{error}");
        };
        refused(STUDY.split("[[rover]]").next().unwrap(), Request::default(), "the study has no rovers");
        let trajectories = Request { trajectories: Some(3), ..Request::default() };
        refused(STUDY.split("[[rover]]\nid = \"q\"").next().unwrap(), trajectories, "`--trajectories` needs --perturb");
        refused(STUDY, Request { trajectories: Some(0), ..trajectories }, "`perturb.trajectories` is 0");
        for (text, expected) in [("10%", 0.1), ("0.1", 0.1), (" 2.5 % ", 0.025)] {
            assert!((share(text).unwrap() - expected).abs() < 1e-12);
        }
        for text in ["10", "0", "0%", "100%", "-5%", "ten", "nan", "1e9%", ""] {
            assert!(share(text).is_err(), "{text}");
        }
    }
}
