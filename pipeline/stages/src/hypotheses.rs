//! `[[hypothesis]]`: claims stated in the study, and so in its hash, before the run. They create no items and are not part of any
//! item's key; the report tests them.

use crate::builder::{BuildError, Builder, Heightfield};
use crate::jobs::traverse;
use crate::registry;
use crate::study::keys::nearest;
use crate::study::{Entry, StudyError};
use sastrugi_schemas::study::{HypothesisItem, HypothesisTest, TraverseItem};
use sastrugi_schemas::{ParameterError, counted};
use sastrugi_statistics::{holm, least_p_apart, least_p_in_blocks};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Number of terrains per group that is sufficient for any claim.
const UNITS_ENOUGH: usize = 100;
/// Name of the section.
pub const SECTION: &str = "hypothesis";

/// Checks the hypotheses of a study against the groups with missions.
///
/// # Errors
/// A section that is not an array of tables.
pub fn check(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    // In a study with errors, missions and traverses may be missing because of a refused table.
    let is_complete = !builder.has_refused();
    let mut families = BTreeMap::new();
    builder.each(SECTION, |builder, entry| check_table(builder, entry, &mut families, is_complete))
}

fn check_table(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    families: &mut BTreeMap<String, f64>,
    is_complete: bool,
) -> Result<(), BuildError> {
    let (item, rest): (HypothesisItem, Value) = entry.read()?;
    entry.check_keys::<HypothesisItem>(&rest, &json!({}))?;
    builder.claim(entry, SECTION, &item.id)?;
    item.check().map_err(|e| entry.refuse(e))?;
    check_level(families, entry, &item)?;
    let known = if is_complete { groups(builder) } else { labels(builder) };
    let is_unknown = |group: &str| !known.contains(group) && (is_complete || !may_be_driven(builder, group));
    if let Some((k, group)) = item.groups.iter().enumerate().find(|(_, group)| is_unknown(group.as_str())) {
        let error = entry.error(&format!("groups.{k}"), format!("no missions are driven in group \"{group}\""));
        return Err(suggesting(error, group, &known, is_complete).into());
    }
    if is_complete { check_run(builder, entry, &item) } else { Ok(()) }
}

fn suggesting(error: StudyError, group: &str, known: &BTreeSet<&str>, is_complete: bool) -> StudyError {
    let list = || match known.len() {
        0 => is_complete.then(|| "no missions are driven in this study".to_owned()),
        _ => Some(format!("known: {}", known.iter().copied().collect::<Vec<_>>().join(", "))),
    };
    let near = nearest(group, known.iter().copied()).map(|n| format!("did you mean \"{n}\"?"));
    error.with_help(near.or_else(list))
}

/// True if missions may be driven in a group that no surface has so far, once the study's errors are mended: a refused table has the id or
/// sweeps, the group is a kind, which may be what a misspelt one means, or any table has the word.
fn may_be_driven(builder: &Builder<'_>, group: &str) -> bool {
    let is_stated = |entry: Entry<'_>| {
        let is_swept = entry.table().contains_key("sweep") && entry.id().is_some_and(|id| builder.may_be_refused(id));
        is_swept || entry.table().values().any(|value| has_word(value, group))
    };
    builder.may_be_refused(group)
        || registry::kinds().iter().any(|kind| kind.kind == group)
        || tables(builder).any(is_stated)
}

fn has_word(value: &Value, word: &str) -> bool {
    match value {
        Value::String(text) => text == word,
        Value::Array(list) => list.iter().any(|value| has_word(value, word)),
        Value::Object(table) => table.values().any(|value| has_word(value, word)),
        Value::Null | Value::Bool(_) | Value::Number(_) => false,
    }
}

/// The tables of all other sections.
fn tables<'s>(builder: &Builder<'s>) -> impl Iterator<Item = Entry<'s>> {
    let study = builder.study;
    let others = registry::section_names().into_iter().filter(|section| *section != SECTION);
    others.flat_map(move |section| study.entries(section).unwrap_or_default())
}

/// Labels of all surfaces, also of those in refused tables that state one.
fn labels<'b>(builder: &'b Builder<'_>) -> BTreeSet<&'b str> {
    let stated = tables(builder).filter_map(|entry| entry.table().get("group").and_then(Value::as_str));
    builder.heightfields.values().map(label).chain(stated).collect()
}

/// Group of a surface, as in the report: its label or, without one, its kind.
fn label(field: &Heightfield) -> &str {
    field.group.as_deref().unwrap_or(&field.kind)
}

/// Groups of the missions.
fn groups<'b>(builder: &'b Builder<'_>) -> BTreeSet<&'b str> {
    driven(builder).map(|(_, group)| group).collect()
}

/// Traverse and group of all missions.
fn driven<'b>(builder: &'b Builder<'_>) -> impl Iterator<Item = (&'b str, &'b str)> {
    let items = builder.graph.nodes().iter().map(|node| &node.item).filter(|item| item.stage == traverse::STAGE);
    items.filter_map(|item| {
        let field = builder.heightfields.get(traverse::terrain_of(&item.id))?;
        Some((traverse::run_of(&item.id), label(field)))
    })
}

/// Refuses a traverse that does not drive every group, and a missing `traverse` if several drive them, since their missions are not
/// repetitions of each other. Values of a sweep are variants, which hypotheses do not cover.
fn check_run(builder: &Builder<'_>, entry: &Entry<'_>, item: &HypothesisItem) -> Result<(), BuildError> {
    let mut plain = BTreeSet::new();
    for entry in builder.study.entries(traverse::STAGE)? {
        let (run, _): (TraverseItem, Value) = entry.read()?;
        if run.sweep.is_empty() {
            plain.insert(run.id);
        }
    }
    let of_group = |group: &String| -> BTreeSet<&str> {
        driven(builder).filter(|(run, of)| of == group && plain.contains(*run)).map(|(run, _)| run).collect()
    };
    let runs: Vec<BTreeSet<&str>> = item.groups.iter().map(of_group).collect();
    let any: BTreeSet<&str> = runs.iter().flatten().copied().collect();
    let of_all: Vec<&str> = any.iter().copied().filter(|run| runs.iter().all(|of| of.contains(run))).collect();
    let list = of_all.join(", ");
    let message = match item.traverse.as_deref() {
        _ if of_all.is_empty() => {
            "cannot be determined: no traverse without a sweep drives all of these groups".to_owned()
        }
        None if any.len() > 1 => {
            format!("is missing; several traverses drive these groups; choose one that drives all of them: {list}")
        }
        Some(run) if !of_all.contains(&run) => {
            format!("is \"{run}\", which is swept or does not drive all of these groups; choose one of: {list}")
        }
        _ => return Ok(()),
    };
    Err(entry.refuse(ParameterError::new("traverse", message)).into())
}

/// Claims that no data from this number of terrains could support, after Holm's adjustment over their family, as tested in the report.
pub fn doubts(builder: &Builder<'_>) -> Vec<String> {
    // Each was checked when added.
    let entries = builder.study.entries(SECTION).unwrap_or_default();
    let claims: Vec<HypothesisItem> =
        entries.iter().filter_map(|entry| entry.read::<HypothesisItem>().ok()).map(|(item, _)| item).collect();
    let units: Vec<Option<Units>> = claims.iter().map(|claim| Units::of(builder, claim)).collect();
    let least: Vec<f64> = claims.iter().zip(&units).map(|(claim, units)| least_p(claim, units.as_ref())).collect();
    let adjusted = |least: &[f64], k: usize| {
        let family: Vec<usize> = (0..claims.len()).filter(|&other| claims[other].family == claims[k].family).collect();
        let all = holm(&family.iter().map(|&other| least[other]).collect::<Vec<_>>());
        family.iter().zip(all).find(|(other, _)| **other == k).map_or(f64::NAN, |(_, p)| p)
    };
    let doubt = |(k, claim): (usize, &HypothesisItem)| {
        let (units, p) = (units[k].as_ref()?, adjusted(&least, k));
        if p.is_nan() || p <= claim.alpha {
            return None;
        }
        let enough = (2..UNITS_ENOUGH).find(|&n| {
            let mut more = least.clone();
            more[k] = units.with(n).least_p(claim.test);
            adjusted(&more, k) <= claim.alpha
        });
        let over_family = if p > least[k] { " over its family" } else { "" };
        let advice = enough.map(|n| format!("; use at least {n} {} per group", units.name())).unwrap_or_default();
        Some(format!(
            "hypothesis \"{}\" cannot be supported at level {}: with {} the smallest possible p is {p:.2}{over_family}{advice}",
            claim.id, claim.alpha, units
        ))
    };
    claims.iter().enumerate().filter_map(doubt).collect()
}

/// Independent units in the test of a claim.
#[derive(Clone)]
enum Units {
    /// Number of terrains of each group.
    Apart(Vec<usize>),
    /// Number of groups, and of blocks of terrains that share their draws.
    Blocks(usize, usize),
}

impl Units {
    /// The units of a claim, from traverses without a sweep; values of swept terrains are variants. `None` if a group has no missions.
    fn of(builder: &Builder<'_>, claim: &HypothesisItem) -> Option<Self> {
        let runs = builder.study.entries(traverse::STAGE).ok()?;
        let runs = runs.iter().filter_map(|entry| entry.read::<TraverseItem>().ok()).map(|(run, _)| run);
        let named = |run: &TraverseItem| claim.traverse.as_ref().is_none_or(|name| *name == run.id);
        let runs: Vec<TraverseItem> = runs.filter(|run| run.sweep.is_empty() && named(run)).collect();
        let lines = || runs.iter().filter_map(|run| builder.missions.get(&run.missions)).flat_map(|drawn| &drawn.lines);
        let of_group = |group: &String| -> BTreeMap<&str, Option<u64>> {
            let of = |field: &Heightfield| field.variant.is_none() && label(field) == group;
            let fields = &builder.heightfields;
            let chosen = lines().filter(|one| fields.get(&one.heightfield).is_some_and(of));
            chosen.map(|one| (one.heightfield.as_str(), one.shared)).collect()
        };
        let groups: Vec<BTreeMap<&str, Option<u64>>> = claim.groups.iter().map(of_group).collect();
        if groups.iter().any(BTreeMap::is_empty) {
            return None;
        }
        let shared = |group: &BTreeMap<&str, Option<u64>>| group.values().copied().collect::<Option<BTreeSet<u64>>>();
        let blocks = groups
            .iter()
            .map(shared)
            .collect::<Option<Vec<_>>>()
            .and_then(|all| all.into_iter().reduce(|common, other| common.intersection(&other).copied().collect()));
        match blocks {
            Some(blocks) if !blocks.is_empty() => Some(Self::Blocks(groups.len(), blocks.len())),
            _ => Some(Self::Apart(groups.iter().map(BTreeMap::len).collect())),
        }
    }

    /// The smallest possible p of a test of them. The t tests of equivalence can have any p, but need two values to estimate the scatter.
    fn least_p(&self, test: HypothesisTest) -> f64 {
        match (test, self) {
            (HypothesisTest::Equivalence, units) if units.fewest() < 2 => 1.0,
            (HypothesisTest::Equivalence, _) => 0.0,
            (_, Self::Apart(sizes)) => least_p_apart(sizes),
            (_, Self::Blocks(groups, blocks)) => least_p_in_blocks(*groups, *blocks),
        }
    }

    /// Number of units in the smallest group.
    fn fewest(&self) -> usize {
        match self {
            Self::Apart(sizes) => sizes.iter().copied().min().unwrap_or(0),
            Self::Blocks(_, blocks) => *blocks,
        }
    }

    /// The same with this number per group.
    fn with(&self, count: usize) -> Self {
        match self {
            Self::Apart(sizes) => Self::Apart(vec![count; sizes.len()]),
            Self::Blocks(groups, _) => Self::Blocks(*groups, count),
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Apart(_) => "terrains",
            Self::Blocks(..) => "paired terrains",
        }
    }
}

impl std::fmt::Display for Units {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Apart(sizes) => {
                let sizes: Vec<String> = sizes.iter().map(ToString::to_string).collect();
                let (last, first) = sizes.split_last().map_or(("", &[][..]), |(last, first)| (last.as_str(), first));
                write!(f, "{} and {last} terrains", first.join(", "))
            }
            Self::Blocks(_, blocks) => f.write_str(&counted(blocks, "paired terrain")),
        }
    }
}

/// The smallest possible p of a claim; 0 for groups without missions.
fn least_p(claim: &HypothesisItem, units: Option<&Units>) -> f64 {
    units.map_or(0.0, |units| units.least_p(claim.test))
}

/// Refuses a level that differs from that of the family, which shares one level.
fn check_level(
    families: &mut BTreeMap<String, f64>,
    entry: &Entry<'_>,
    item: &HypothesisItem,
) -> Result<(), BuildError> {
    let alpha = *families.entry(item.family.clone()).or_insert(item.alpha);
    if alpha == item.alpha {
        return Ok(());
    }
    let message = format!("is {}; a family shares one level, and others of this family have {alpha}", item.alpha);
    Err(entry.refuse(ParameterError::new("alpha", message)).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::loaded::load_text;
    use std::path::Path;

    /// A study whose second terrain has an error, with a hypothesis on these groups.
    fn study(terrain: &str, groups: [&str; 2]) -> String {
        let head = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n";
        let rough = "[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\ngroup = \"rough\"\nsize_px = [64, 64]\n";
        let drives = "[[missions]]\nid = \"m\"\nterrains = [\"t\", \"u\"]\nlength_m = 2.0\nborder_m = 0.5\n\
            [[traverse]]\nid = \"d\"\nmissions = \"m\"\n";
        let claim = "[[hypothesis]]\nid = \"h\"\nstatistic = \"success\"\ntest = \"difference\"\n";
        format!("{head}{rough}[[terrain]]\n{terrain}{drives}{claim}groups = {groups:?}\n")
    }

    fn refusals(text: &str) -> Vec<StudyError> {
        match load_text(text, "study.toml", Path::new("")) {
            Err(Error::Study { refusals, .. }) => refusals.0,
            Err(other) => panic!("{other}\n{text}"),
            Ok(_) => panic!("not refused:\n{text}"),
        }
    }

    const WRONG: &str = "id = \"u\"\nkind = \"gap\"\ngroup = \"smooth\"\ncell_m = -1.0\n";

    /// An unknown group is told with the other errors of the study.
    #[test]
    fn val_unknown_groups_are_told_with_other_errors() {
        for (group, help) in [("smoth", "did you mean \"smooth\"?"), ("level", "known: rough, smooth")] {
            let found = refusals(&study(WRONG, ["rough", group]));
            let [cell, unknown] = found.as_slice() else { panic!("{group}: {found:?}") };
            assert!(cell.message.starts_with("terrain \"u\": `cell_m`"), "{cell:?}");
            assert_eq!(unknown.message, format!("hypothesis \"h\": no missions are driven in group \"{group}\""));
            assert_eq!(unknown.help.as_deref(), Some(help));
        }
    }

    /// A group that a refused table has, or may have once its errors are mended, is not called unknown.
    #[test]
    fn val_groups_of_refused_tables_are_not_called_unknown() {
        for (terrain, group) in [
            (WRONG, "smooth"),
            // Its id, and that of a replicate.
            ("id = \"u\"\nkind = \"gap\"\ncell_m = -1.0\n", "u"),
            ("id = \"u\"\nkind = \"gap\"\ncell_m = -1.0\ncount = 2\n", "u-0002"),
            // Its kind, also if that is missing or misspelt.
            ("id = \"u\"\nkind = \"gap\"\ncell_m = -1.0\n", "gap"),
            ("id = \"u\"\n", "gap"),
            ("id = \"u\"\nkind = \"gapp\"\n", "gap"),
            // A key that may have been meant to be `group`, the values of a sweep, and anything if the table has no id.
            ("id = \"u\"\nkind = \"gap\"\ngruop = \"smooth\"\n", "smooth"),
            ("id = \"u\"\nkind = \"gap\"\nsweep.cell_m = [-1.0, 0.1]\n", "smooth"),
            ("kind = \"gap\"\ncell_m = -1.0\n", "smooth"),
        ] {
            let found = refusals(&study(terrain, ["rough", group]));
            let is_of_groups = |error: &StudyError| error.message.contains("no missions are driven");
            assert!(!found.is_empty() && !found.iter().any(is_of_groups), "{terrain}{group}: {found:?}");
        }
    }
}
