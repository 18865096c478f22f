//! `[[hypothesis]]`: claims that are part of the study, and so of its hash, before anything runs. No item comes of them and no key
//! holds them; the report tests them.

use crate::builder::{BuildError, Builder};
use crate::jobs::traverse;
use crate::study::keys::nearest;
use crate::study::{Entry, StudyError};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::study::{HypothesisItem, TraverseItem};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Name of the section.
pub const SECTION: &str = "hypothesis";

/// Checks the hypotheses of a study against the groups that are driven in it.
///
/// # Errors
/// The first one that no test can be made of.
pub fn check(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    let mut families = BTreeMap::new();
    for entry in builder.study.entries(SECTION)? {
        let (item, rest): (HypothesisItem, Value) = entry.read()?;
        entry.check_keys::<HypothesisItem>(&rest, &json!({}))?;
        builder.claim(&entry, SECTION, &item.id)?;
        item.check().map_err(|e| entry.refuse(e))?;
        let known = groups(builder);
        let unknown = item.groups.iter().enumerate().find(|(_, group)| !known.contains(group.as_str()));
        if let Some((k, group)) = unknown {
            let error = entry.error(&format!("groups.{k}"), format!("no missions are driven in a group \"{group}\""));
            return Err(suggesting(error, group, &known).into());
        }
        check_run(builder, &entry, &item)?;
        check_level(&mut families, &entry, &item)?;
    }
    Ok(())
}

fn suggesting(error: StudyError, group: &str, known: &BTreeSet<&str>) -> StudyError {
    let list = || match known.len() {
        0 => "no missions are driven in this study".to_owned(),
        _ => format!("there are {}", known.iter().copied().collect::<Vec<_>>().join(", ")),
    };
    let help = nearest(group, known.iter().copied()).map_or_else(list, |n| format!("did you mean \"{n}\"?"));
    error.with_help(Some(help))
}

/// Groups of the missions that are driven, as the report knows them: the label of the heightfield, its kind where it has none.
fn groups<'b>(builder: &'b Builder<'_>) -> BTreeSet<&'b str> {
    driven(builder).map(|(_, group)| group).collect()
}

/// Run and group of everything that is driven.
fn driven<'b>(builder: &'b Builder<'_>) -> impl Iterator<Item = (&'b str, &'b str)> {
    let items = builder.graph.nodes().iter().map(|node| &node.item).filter(|item| item.stage == traverse::STAGE);
    items.filter_map(|item| {
        let field = builder.heightfields.get(traverse::terrain_of(&item.id))?;
        Some((traverse::run_of(&item.id), field.group.as_deref().unwrap_or(&field.kind)))
    })
}

/// Refuses a run that does not drive every group, and the lack of one where several drive them: their missions are no repetitions of
/// each other. Values of a sweep are variants, which no hypothesis is about.
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
        _ if of_all.is_empty() => "has no answer: no run without a sweep drives all of these groups".to_owned(),
        None if any.len() > 1 => format!("is missing; several drive these groups, all of them: {list}"),
        Some(run) if !of_all.contains(&run) => {
            format!("is \"{run}\", which does not drive all of these groups, or is swept; there are: {list}")
        }
        _ => return Ok(()),
    };
    Err(entry.refuse(ParameterError::new("traverse", message)).into())
}

/// Refuses another level than that of the family: it is shared.
fn check_level(
    families: &mut BTreeMap<String, f64>,
    entry: &Entry<'_>,
    item: &HypothesisItem,
) -> Result<(), BuildError> {
    let alpha = *families.entry(item.family.clone()).or_insert(item.alpha);
    if alpha == item.alpha {
        return Ok(());
    }
    let message = format!("is {}; the family shares one level, and others of it have {alpha}", item.alpha);
    Err(entry.refuse(ParameterError::new("alpha", message)).into())
}
