//! `[[hypothesis]]`: claims that are part of the study, and so of its hash, before anything runs. No item comes of them and no key
//! holds them; the report tests them.

use crate::jobs::traverse;
use crate::registry::{BuildError, Builder};
use crate::study::StudyError;
use crate::study::keys::nearest;
use sastrugi_schemas::study::HypothesisItem;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Name of the section.
pub const SECTION: &str = "hypothesis";

/// Checks the hypotheses of a study against the groups that are driven in it.
///
/// # Errors
/// The first one that no test can be made of.
pub fn check(builder: &mut Builder<'_>) -> Result<(), BuildError> {
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
    let driven = builder.nodes().iter().filter(|node| node.item.stage == traverse::STAGE);
    let fields = driven.filter_map(|node| builder.heightfields.get(traverse::terrain_of(&node.item.id)));
    fields.map(|field| field.group.as_deref().unwrap_or(&field.kind)).collect()
}
