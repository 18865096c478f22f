//! The plan of a run: the items that it would compute, and why.

use super::cache::Cache;
use super::graph::{Graph, Ingredients};
use serde::Serialize;
use serde_json::Value;
use std::borrow::Cow;

/// The reason of items that were never tried.
const NEW: Reason = Reason { text: Cow::Borrowed("new"), kind: "new" };

/// Processor time of assembly and report, s: of any release, of an item, and of a byte of artifacts as estimated, which is copied and hashed.
/// Measured 0.1 to 7.3 s on releases of 8 to 1200 items with 3 MB to 0.6 GB; above 0.5 s within a factor of two.
const ASSEMBLY_S: [f64; 3] = [0.5, 4e-3, 4e-9];

/// Why an item is stale.
#[derive(Clone, Debug, PartialEq)]
struct Reason {
    text: Cow<'static, str>,
    kind: &'static str,
}

/// One item that a run would compute.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stale {
    /// Stage and id.
    pub item: String,
    /// Why it is stale.
    pub reason: Cow<'static, str>,
    /// The reason without names and values, by which the items of a stage can be counted; the first of several.
    #[serde(skip)]
    pub kind: &'static str,
    /// Estimated time on one core, s.
    pub seconds: f64,
    /// Estimated size of its files, bytes.
    pub bytes: f64,
    /// Peak working memory, bytes; rarely underestimated.
    pub memory_bytes: u64,
}

/// The plan of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlanSummary {
    /// Items of the study, or the selected items with their ancestors.
    pub items: usize,
    /// Items with a result.
    pub ready: usize,
    /// Items to compute.
    pub stale: Vec<Stale>,
    /// Estimated time of assembly and report, which follow on the items, s; 0 for a shard.
    pub assembly_seconds: f64,
    /// Whether the work area has no results at all, also none of another study.
    #[serde(skip)]
    pub is_first: bool,
    /// Settings of the study that are allowed but make no sense, one sentence each.
    pub doubts: Vec<String>,
}

/// Compares the items of a graph with a work area; if that is empty, all items are new.
pub fn plan(graph: &Graph, needed: &[usize], cache: &Cache) -> PlanSummary {
    let (mut stale, mut all_bytes) = (Vec::new(), 0.0);
    let is_empty = cache.is_empty();
    for &position in needed {
        let node = graph.node(position);
        let estimate = node.job.estimate();
        all_bytes += estimate.bytes;
        let reason = match !is_empty && cache.knows(&node.item) {
            true if cache.holds(&node.item, graph.key(position)) => continue,
            true => reason(graph, cache, position),
            false => NEW,
        };
        let (item, memory_bytes) = (node.item.to_string(), node.job.memory_bytes());
        let Reason { text, kind } = reason;
        stale.push(Stale { item, reason: text, kind, seconds: estimate.seconds, bytes: estimate.bytes, memory_bytes });
    }
    let (items, ready) = (needed.len(), needed.len() - stale.len());
    let assembly_seconds = assembly_seconds(items, all_bytes);
    PlanSummary { items, ready, stale, assembly_seconds, is_first: is_empty, doubts: Vec::new() }
}

/// Estimated time of assembly and report of so many items with artifacts of so many bytes, s.
fn assembly_seconds(items: usize, bytes: f64) -> f64 {
    let [any, of_item, of_byte] = ASSEMBLY_S;
    any + of_item * items as f64 + of_byte * bytes
}

/// The reason why an item that was tried before has no current result.
fn reason(graph: &Graph, cache: &Cache, position: usize) -> Reason {
    let item = &graph.node(position).item;
    if let Some(message) = cache.failure(item, graph.key(position)) {
        return Reason { text: format!("failed before: {message}").into(), kind: "failed before" };
    }
    match cache.earlier(item) {
        Some(earlier) => difference(&earlier, &graph.ingredients(position)),
        None => NEW,
    }
}

/// Describes the differences between two sets of ingredients.
fn difference(old: &Ingredients, new: &Ingredients) -> Reason {
    let mut reasons = Vec::new();
    if old.recipe != new.recipe {
        let mut changes = Vec::new();
        changed_values("", &old.recipe, &new.recipe, &mut changes);
        reasons.push(("changed", format!("changed: {}", changes.join(", "))));
    }
    if old.packing != new.packing {
        reasons.push(("repacked", "repacked: compression or accompanying files changed".to_owned()));
    }
    if old.stream != new.stream {
        reasons.push(("seed or id changed", "the seed or the id changed".to_owned()));
    }
    if old.inputs != new.inputs {
        reasons.push(("input file changed", "an input file changed".to_owned()));
    }
    let parents = new.parents.iter().filter(|(name, key)| old.parents.get(*name) != Some(key));
    let parents: Vec<&str> = parents.map(|(name, _)| name.as_str()).collect();
    if !parents.is_empty() {
        reasons.push(("depends on changed items", format!("depends on {}, which changed", parents.join(", "))));
    }
    if old.revision != new.revision {
        reasons.push(("code changed", "the code of this stage changed".to_owned()));
    }
    let (kinds, texts): (Vec<&str>, Vec<String>) = reasons.into_iter().unzip();
    match kinds.first() {
        Some(&kind) => Reason { text: texts.join("; ").into(), kind },
        None => Reason { text: "the result is incomplete".into(), kind: "incomplete" },
    }
}

/// Paths whose values differ, `path old -> new`.
fn changed_values(path: &str, old: &Value, new: &Value, changes: &mut Vec<String>) {
    if old == new {
        return;
    }
    match (old.as_object(), new.as_object()) {
        (Some(a), Some(b)) => {
            let names: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for name in names {
                let below = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                changed_values(
                    &below,
                    a.get(name).unwrap_or(&Value::Null),
                    b.get(name).unwrap_or(&Value::Null),
                    changes,
                );
            }
        }
        _ => changes.push(format!("{path} {old} -> {new}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn ingredients(recipe: Value) -> Ingredients {
        Ingredients {
            recipe,
            packing: Value::Null,
            stream: None,
            inputs: Vec::new(),
            parents: [("dem/a".to_owned(), "k1".to_owned())].into(),
            revision: "r".to_owned(),
        }
    }

    #[test]
    fn val_reasons() {
        let old = ingredients(json!({"params": {"d": 2.3, "m": 16}}));
        let mut new = ingredients(json!({"params": {"d": 2.4, "m": 16}}));
        assert_eq!(difference(&old, &new).text, "changed: params.d 2.3 -> 2.4");
        new.recipe = old.recipe.clone();
        new.parents.insert("dem/a".to_owned(), "k2".to_owned());
        new.revision = "s".to_owned();
        assert_eq!(difference(&old, &new).text, "depends on dem/a, which changed; the code of this stage changed");
        let whole = Ingredients {
            packing: json!("cog"),
            stream: Some("seed/1".to_owned()),
            inputs: vec!["ab".to_owned()],
            ..old.clone()
        };
        let expected =
            "repacked: compression or accompanying files changed; the seed or the id changed; an input file changed";
        assert_eq!(difference(&old, &whole).text, expected);
        assert_eq!(difference(&old, &old).text, "the result is incomplete");
        // Items are counted by the first reason, without its values.
        let changed = ingredients(json!({"params": {"d": 2.4, "m": 16}}));
        let kinds = [&changed, &new, &whole, &old].map(|other| difference(&old, other).kind);
        assert_eq!(kinds, ["changed", "depends on changed items", "repacked", "incomplete"]);
    }

    /// Keys that came or went are named like those that changed.
    #[test]
    fn val_changed_values() {
        let old = ingredients(json!({"kind": "waves", "params": {"d": 2.3, "gone": true}}));
        let new = ingredients(json!({"kind": "waves", "params": {"d": 2.3, "list": [1, 2]}}));
        assert_eq!(difference(&old, &new).text, "changed: params.gone true -> null, params.list null -> [1,2]");
    }
}
