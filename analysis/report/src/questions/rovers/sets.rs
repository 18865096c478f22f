//! Sets of comparable rovers: one group of worlds, one navigator, one variant.

use crate::data::{Data, Natural, label, natural};
use crate::questions::sql::quoted;
use crate::render::chart::RowLabel;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::RoverRow;
use sastrugi_statistics::{Interval, ratio};
use std::collections::{BTreeMap, BTreeSet};

/// Rovers of one group, stage and variant.
#[derive(Clone, Debug)]
pub struct Set<'a> {
    /// Group, with navigator and variant where there are several.
    pub name: String,
    /// Label of the group.
    pub group: String,
    /// Navigator or stage where there are several; otherwise empty.
    pub trial: String,
    /// Number of the group among all: its colour.
    pub index: usize,
    /// Stage that drove them.
    pub stage: &'a str,
    /// Difference from the plain trial.
    pub variant: Option<&'a str>,
    /// Rovers of each world, worlds in the order of their ids.
    pub worlds: Vec<World<'a>>,
}

/// The rovers of one world.
#[derive(Clone, Debug)]
pub struct World<'a> {
    /// Id of the terrain.
    pub terrain_id: &'a str,
    /// In the order of the table.
    pub rovers: Vec<&'a RoverRow>,
}

/// Name of a navigator on the page.
pub fn navigator(name: &str) -> String {
    match name {
        "sojourner_like" => "Sojourner-like".into(),
        "schoppers_like" => "Schoppers-like".into(),
        other => other.replace('_', " "),
    }
}

/// True for a rover that reached its goal.
pub fn reached(rover: &RoverRow) -> bool {
    rover.outcome == "reached"
}

/// True for a rover that ended off the known ground.
pub fn off_ground(rover: &RoverRow) -> bool {
    rover.outcome == "off_ground"
}

/// Efficiency of a rover in means: 0 for one that ended off the ground, as `sastrugi rover` counts it. Its efficiency was not observed, and the 1 of
/// a rover that never drove must not raise a mean.
pub fn efficiency(rover: &RoverRow) -> f64 {
    if off_ground(rover) { 0.0 } else { rover.efficiency }
}

/// Efficiency of a rover that stayed on the ground; NaN for others.
pub fn shown(rover: &RoverRow) -> f64 {
    if off_ground(rover) { f64::NAN } else { rover.efficiency }
}

/// Sets of the plain trials; of all rovers if every one belongs to a variant.
pub fn plain(data: &Data) -> Vec<Set<'_>> {
    let any = data.rovers.iter().any(|r| r.variant.is_none());
    sets(data, data.rovers.iter().filter(|r| !any || r.variant.is_none()).collect())
}

/// Sets of the rovers that belong to a variant.
pub fn variants(data: &Data) -> Vec<Set<'_>> {
    sets(data, data.rovers.iter().filter(|r| r.variant.is_some()).collect())
}

/// Sets in natural order: by stage, then group, then variant.
fn sets<'a>(data: &Data, rovers: Vec<&'a RoverRow>) -> Vec<Set<'a>> {
    let kinds: BTreeMap<&str, &str> = data.terrains.iter().map(|t| (t.terrain_id.as_str(), label(t))).collect();
    let group = |r: &RoverRow| {
        let of_terrain = || kinds.get(r.terrain_id.as_str()).copied();
        natural(r.group.as_deref().or_else(of_terrain).unwrap_or("all"))
    };
    let groups: BTreeSet<Natural> = data.rovers.iter().map(group).collect();
    let stages: BTreeSet<(&str, &str)> = rovers.iter().map(|r| (r.navigator.as_str(), r.stage_id.as_str())).collect();
    let navigators: BTreeSet<&str> = stages.iter().map(|s| s.0).collect();
    let trial = |r: &RoverRow| match (stages.len(), navigators.len()) {
        (1, _) => String::new(),
        (stages, kinds) if stages == kinds => navigator(&r.navigator),
        _ => r.stage_id.clone(),
    };
    type Key<'a> = (Natural, Natural, Option<Natural>);
    let mut sets: BTreeMap<Key, Vec<&'a RoverRow>> = BTreeMap::new();
    for rover in &rovers {
        let key = (natural(&rover.stage_id), group(rover), rover.variant.as_deref().map(natural));
        sets.entry(key).or_default().push(rover);
    }
    let set = |((_, group, variant), rows): (Key, Vec<&'a RoverRow>)| {
        let trial = trial(rows[0]);
        let parts = [Some(group.1.clone()), Some(trial.clone()), variant.map(|v| v.1)];
        let name: Vec<String> = parts.into_iter().flatten().filter(|p| !p.is_empty()).collect();
        Set {
            name: name.join(", "),
            index: groups.iter().position(|g| *g == group).unwrap_or(0),
            group: group.1,
            trial,
            stage: &rows[0].stage_id,
            variant: rows[0].variant.as_deref(),
            worlds: worlds(rows),
        }
    };
    sets.into_iter().map(set).collect()
}

fn worlds<'a>(rovers: Vec<&'a RoverRow>) -> Vec<World<'a>> {
    let mut worlds: BTreeMap<&str, Vec<&RoverRow>> = BTreeMap::new();
    rovers.into_iter().for_each(|r| worlds.entry(&r.terrain_id).or_default().push(r));
    worlds.into_iter().map(|(terrain_id, rovers)| World { terrain_id, rovers }).collect()
}

impl<'a> World<'a> {
    /// Sum of the known values over the rovers, and their number.
    pub fn total(&self, of: impl Fn(&RoverRow) -> f64) -> (f64, f64) {
        let known = self.values(of);
        (sums::sum(&known), known.len() as f64)
    }

    /// Known values of the rovers.
    pub fn values(&self, of: impl Fn(&RoverRow) -> f64) -> Vec<f64> {
        sums::finite(&self.rovers.iter().map(|r| of(r)).collect::<Vec<_>>())
    }
}

impl<'a> Set<'a> {
    /// All rovers, world by world.
    pub fn rovers(&self) -> impl Iterator<Item = &'a RoverRow> {
        self.worlds.iter().flat_map(|w| w.rovers.iter().copied())
    }

    /// Number of rovers.
    pub fn count(&self) -> usize {
        self.worlds.iter().map(|w| w.rovers.len()).sum()
    }

    /// Label of a row of a figure: the group, then trial or variant and the number of rovers.
    pub fn label(&self) -> RowLabel {
        let rovers = self.count().to_string();
        let parts = [self.trial.as_str(), self.variant.unwrap_or_default(), rovers.as_str()];
        let detail: Vec<&str> = parts.into_iter().filter(|p| !p.is_empty()).collect();
        RowLabel { name: self.group.clone(), detail: detail.join(", ") }
    }

    /// Name of the navigator.
    pub fn navigator(&self) -> String {
        self.rovers().next().map_or_else(String::new, |r| navigator(&r.navigator))
    }

    /// Mean over the rovers with its interval over worlds.
    pub fn mean(&self, of: impl Fn(&RoverRow) -> f64, level: f64) -> Estimate {
        self.ratio(|w| w.total(&of), level)
    }

    /// Ratio of two totals of each world, with its interval over worlds.
    pub fn ratio(&self, of: impl Fn(&World<'a>) -> (f64, f64), level: f64) -> Estimate {
        let totals: Vec<(f64, f64)> = self.worlds.iter().map(of).filter(|t| t.1 > 0.0).collect();
        Estimate { value: ratio::of_totals(&totals), interval: ratio::interval(&totals, level) }
    }

    /// SQL condition for the rows of the set in the table `rovers`.
    pub fn condition(&self) -> String {
        let variant = self.variant.map_or_else(|| "variant is null".into(), |v| format!("variant = {}", quoted(v)));
        let group = self.rovers().next().and_then(|r| r.group.as_deref());
        let group = group.map_or_else(|| "\"group\" is null".into(), |g| format!("\"group\" = {}", quoted(g)));
        format!("stage_id = {} and {group} and {variant}", quoted(self.stage))
    }
}

/// A number with its interval over worlds, where there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// NaN if unknown.
    pub value: f64,
    /// `None` for one world, or if every value is 0.
    pub interval: Option<Interval>,
}

impl Estimate {
    /// The ends; NaN where there are none.
    pub fn ends(&self) -> [f64; 2] {
        self.interval.map_or([f64::NAN; 2], |i| [i.low, i.high])
    }
}
