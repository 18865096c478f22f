//! `plan`: what a run would compute, item by item or stage by stage, or how a study divides into shards.

use super::study::print_warnings;
use crate::Verdict;
use crate::args::{Common, Place, Plan};
use crate::failure::{Code, Failure};
use crate::output::{bytes, columns, print, print_long, seconds};
use sastrugi_schemas::counted;
use sastrugi_stages::loaded;
use sastrugi_stages::remote::work_area;
use sastrugi_stages::runner::division::{Cost, Division, ShardCost};
use sastrugi_stages::runner::plan::{PlanSummary, Stale};
use sastrugi_stages::runner::shard::Part;
use sastrugi_stages::studies;
use std::path::{Component, Path};

/// Maximum number of lines of a printed plan: with more items it has a line for each stage.
const PLAN_LINES: usize = 40;

/// `plan`.
pub fn plan(args: &Plan, common: &Common) -> Verdict {
    let loaded = loaded::load(&args.study)?;
    if let Some(count) = args.shards {
        print_warnings(&loaded.doubts, common);
        let division = studies::plan_shards(&loaded, count);
        print(common.json, &serde_json::to_value(&division).map_err(Failure::failed)?, &divided(&division))?;
        return Ok(Code::Done);
    }
    let part = args.shard.as_deref().map(Part::parse).transpose()?;
    let plan = studies::plan_of(&loaded, &args.place.output, args.place.work.as_deref(), part)?;
    print_warnings(&loaded.doubts, common);
    print_long(common.json, &plan, &planned(&plan, &args.place))?;
    Ok(Code::Done)
}

/// A plan as text.
fn planned(plan: &PlanSummary, place: &Place) -> String {
    let total_seconds = plan.stale.iter().fold(0.0, |sum, s| sum + s.seconds);
    let total_bytes = plan.stale.iter().fold(0.0, |sum, s| sum + s.bytes);
    let mut text = format!(
        "{}, {} ready, {} to compute: about {} on one core{}, about {} of artifacts",
        counted(plan.items, "item"),
        plan.ready,
        plan.stale.len(),
        seconds(total_seconds),
        assembly(plan.assembly_seconds),
        bytes(total_bytes)
    );
    if let Some(largest) = plan.stale.iter().max_by_key(|s| s.memory_bytes) {
        text.push_str(&format!(", at most {} of memory (for {})", bytes(largest.memory_bytes as f64), largest.item));
    }
    text.push_str(&format!("; {}\n", compared_with(plan.is_first, place)));
    if plan.stale.len() > PLAN_LINES {
        text.push_str(&columns(&by_stage(&plan.stale)));
        text.push_str("\n  (--json lists all items)");
    } else {
        text.push_str(&columns(&by_item(&plan.stale)));
    }
    text
}

/// The time of what follows on the items; a shard is not assembled.
fn assembly(time_s: f64) -> String {
    if time_s > 0.0 { format!(" and {} of assembly and report", seconds(time_s)) } else { String::new() }
}

fn by_item(stale: &[Stale]) -> Vec<Vec<String>> {
    stale.iter().map(|s| vec![format!("  {}", s.item), seconds(s.seconds), s.reason.to_string()]).collect()
}

/// One row for each stage, in the order of the plan.
fn by_stage(stale: &[Stale]) -> Vec<Vec<String>> {
    let mut stages: Vec<(&str, Vec<&Stale>)> = Vec::new();
    for one in stale {
        let name = one.item.split('/').next().unwrap_or_default();
        match stages.iter_mut().find(|(stage, _)| *stage == name) {
            Some((_, items)) => items.push(one),
            None => stages.push((name, vec![one])),
        }
    }
    stages.iter().map(|(stage, items)| stage_row(stage, items)).collect()
}

fn stage_row(stage: &str, items: &[&Stale]) -> Vec<String> {
    let time = items.iter().fold(0.0, |sum, s| sum + s.seconds);
    let size = items.iter().fold(0.0, |sum, s| sum + s.bytes);
    let memory = items.iter().map(|s| s.memory_bytes).max().unwrap_or(0);
    vec![
        format!("  {stage}"),
        counted(items.len(), "item"),
        seconds(time),
        bytes(size),
        format!("at most {} of memory", bytes(memory as f64)),
        reasons(items),
    ]
}

/// The reason that all items share, or else how many items have a reason of each kind.
fn reasons(items: &[&Stale]) -> String {
    let Some(first) = items.first() else { return String::new() };
    if items.iter().all(|s| s.reason == first.reason) {
        return first.reason.to_string();
    }
    let mut kinds: Vec<(&str, usize)> = Vec::new();
    for one in items {
        match kinds.iter_mut().find(|(kind, _)| *kind == one.kind) {
            Some((_, count)) => *count += 1,
            None => kinds.push((one.kind, 1)),
        }
    }
    let told: Vec<String> = kinds.iter().map(|(kind, count)| format!("{kind} ({count})")).collect();
    told.join(", ")
}

/// The work area that a plan compares the study with, if it has results.
fn compared_with(is_first: bool, place: &Place) -> String {
    let work = work_area(&place.output, place.work.as_deref());
    match is_first {
        true => format!("no results in {} yet: all items are new", shown(&work)),
        false => format!("compared with the results in {}", shown(&work)),
    }
}

/// A path; a bare name does not look like a folder.
fn shown(path: &Path) -> String {
    let is_bare = path.components().eq([Component::Normal(path.as_os_str())]);
    let start = if is_bare { "./" } else { "" };
    format!("{start}{}", path.display())
}

/// A table of shards, and what to know about them.
fn divided(division: &Division) -> String {
    let head = ["", "own items", "with ancestors", "time", "memory", "artifacts", "time with --cache"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let cells = |name: String, own: String, needed: &Cost, left: Option<f64>| {
        let Cost { items, seconds: time, bytes: size, memory_bytes } = needed;
        let left = left.map_or_else(String::new, seconds);
        vec![name, own, items.to_string(), seconds(*time), bytes(*memory_bytes as f64), bytes(*size), left]
    };
    let shard = |s: &ShardCost| cells(format!("shard {}", s.shard), s.own.to_string(), &s.needed, Some(s.left.seconds));
    let common = &division.common_ancestors;
    rows.push(cells("study".to_owned(), division.study.items.to_string(), &division.study, None));
    rows.push(cells("common ancestors".to_owned(), String::new(), common, Some(common.seconds)));
    rows.extend(division.shards.iter().take(PLAN_LINES).map(shard));
    let mut text = columns(&rows);
    if division.shards.len() > PLAN_LINES {
        text.push_str(&format!("\nand {} more (--json lists all)", division.shards.len() - PLAN_LINES));
    }
    text.push_str(&format!(
        "\nall shards together, on one core: {} without a shared cache, {} with one",
        seconds(division.seconds_without_cache),
        seconds(division.seconds_with_cache)
    ));
    division.advice.iter().for_each(|line| text.push_str(&format!("\n{line}")));
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn stale(item: &str, reason: &'static str, kind: &'static str) -> Stale {
        let item = item.to_owned();
        Stale { item, reason: reason.into(), kind, seconds: 0.5, bytes: 1500.0, memory_bytes: 2_000_000 }
    }

    fn place(output: &str, work: Option<&str>) -> Place {
        Place { output: PathBuf::from(output), work: work.map(PathBuf::from) }
    }

    /// The work area is named, whether it has results or not; a bare name looks like a folder.
    #[test]
    fn val_a_plan_names_what_it_compares_with() {
        for (output, work, expected) in [
            ("release", None, "./release.work"),
            ("./release", None, "./release.work"),
            ("out/snow", None, "out/snow.work"),
            ("/data/snow", None, "/data/snow.work"),
            ("release", Some("scratch"), "./scratch"),
        ] {
            let place = place(output, work);
            assert_eq!(compared_with(false, &place), format!("compared with the results in {expected}"));
            assert_eq!(compared_with(true, &place), format!("no results in {expected} yet: all items are new"));
        }
    }

    /// As many items as fit are listed; of more, every stage has a line, also the last.
    #[test]
    fn val_a_long_plan_has_a_line_for_each_stage() {
        let mut items: Vec<Stale> =
            (1..PLAN_LINES).map(|k| stale(&format!("terrain/t-{k}"), "changed: n 1 -> 2", "changed")).collect();
        items.push(stale("traverse/a", "new", "new"));
        let plan = |stale: &[Stale]| PlanSummary { items: 50, stale: stale.to_vec(), ..PlanSummary::default() };
        let text = planned(&plan(&items), &place("release", None));
        assert!(text.contains(": about 20.0 s on one core, about 60.0 kB of artifacts"), "{text}");
        let assembled = planned(&PlanSummary { assembly_seconds: 1.5, ..plan(&items) }, &place("release", None));
        assert!(
            assembled.contains(": about 20.0 s on one core and 1.5 s of assembly and report, about"),
            "{assembled}"
        );
        assert_eq!(text.lines().count(), 1 + PLAN_LINES);
        assert!(text.ends_with("\n  traverse/a    0.5 s  new"), "{text}");
        items.push(stale("traverse/b", "failed before: no route", "failed before"));
        items.push(stale("traverse/c", "failed before: no goal", "failed before"));
        let text = planned(&plan(&items), &place("release", None));
        let rows: Vec<&str> = text.lines().skip(1).collect();
        let expected = [
            "  terrain   39 items  19.5 s  58.5 kB  at most 2.0 MB of memory  changed: n 1 -> 2",
            "  traverse  3 items   1.5 s   4.5 kB   at most 2.0 MB of memory  new (1), failed before (2)",
            "  (--json lists all items)",
        ];
        assert_eq!(rows, expected);
    }
}
