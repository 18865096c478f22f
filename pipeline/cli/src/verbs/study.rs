//! Verbs on studies and releases.

use crate::Verdict;
use crate::args::{Common, Merge, Pack, Place, Report, Run, Traverse, Verify};
use crate::failure::{Code, Failure};
use crate::output::{bytes, print, seconds, warn};
use crate::progress::Reporter;
use sastrugi_report::{Companions, ReportError};
use sastrugi_schemas::counted;
use sastrugi_schemas::manifest::ItemNote;
use sastrugi_stages::loaded;
use sastrugi_stages::packing;
use sastrugi_stages::remote;
use sastrugi_stages::runner::execute::{Failure as Failed, Limits};
use sastrugi_stages::runner::progress::Progress;
use sastrugi_stages::runner::shard::Part;
use sastrugi_stages::runner::shared::{self, Sharing, Tally};
use sastrugi_stages::studies::{self, RunRequest, RunSummary};
use sastrugi_stages::verbs::{parameters, traverse as drive};
use sastrugi_stages::verification::{self, Difference, Recompute};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Default limit on the working memory of concurrent items, GiB.
const MEMORY_GIB: f64 = 4.0;
/// Maximum number of verdicts on fits printed at the end of a run.
const VERDICTS_MAX: usize = 5;
/// Maximum number of other notes that differ printed there.
const NOTES_MAX: usize = 3;
/// Maximum number of skipped items named there.
const SKIPPED_MAX: usize = 5;
/// The first page of the report, in a release.
const PAGE: &str = "report/index.html";

/// Limits of a run; without `memory_gib`, memory limits only which items run concurrently.
pub(super) fn limits(memory_gib: Option<f64>) -> Result<Limits, Failure> {
    let beyond = memory_gib.is_none();
    let memory_gib = memory_gib.unwrap_or(MEMORY_GIB);
    if !(memory_gib.is_finite() && memory_gib > 0.0) {
        return Err(Failure::usage(format!("`--memory {memory_gib}`: must be above 0")));
    }
    let memory_bytes = (memory_gib * 1024.0 * 1024.0 * 1024.0) as u64;
    Ok(Limits { workers: rayon::current_num_threads(), memory_bytes, beyond })
}

/// `run`.
pub fn run(args: &Run, common: &Common) -> Verdict {
    let part = args.shard.as_deref().map(Part::parse).transpose()?;
    let limits = limits(args.memory)?;
    let loaded = loaded::load(&args.study)?;
    print_warnings(&loaded.doubts, common);
    let Place { output, work } = &args.place;
    if part.is_some() && remote::address(output).is_some() {
        return Err(Failure::usage(
            "a shard is a folder; merge writes the release to an object store: choose a folder with -o",
        ));
    }
    let sharing = sharing(args)?;
    let request = RunRequest { output, work: work.as_deref(), part, purpose: None, replace: args.replace, limits };
    finish_run(common, |reporter| match (args.ancestors, sharing) {
        (Some(count), Some(sharing)) => Ok(studies::run_ancestors(&loaded, count, &request, sharing, reporter)?),
        (_, sharing) => {
            Ok(remote::releasing(output, work.as_deref(), args.replace, reporter, |output, work, replace| {
                studies::run_sharing(&loaded, &RunRequest { output, work, replace, ..request }, sharing, reporter)
            })?)
        }
    })
}

/// The shared cache of a run.
fn sharing(args: &Run) -> Result<Option<Sharing>, Failure> {
    let Some(place) = &args.cache else { return Ok(None) };
    if studies::resolved(Path::new(place)).starts_with(studies::resolved(&args.place.output)) {
        let message = "the shared cache lies inside the output folder, which is replaced; choose another --cache";
        return Err(Failure::usage(message));
    }
    Ok(Some(Sharing::new(shared::open(place, args.cache_read_only)?)))
}

/// Prints warnings that a user should see before a long run.
pub(super) fn print_warnings(doubts: &[String], common: &Common) {
    if !common.quiet {
        doubts.iter().for_each(|doubt| warn(&format!("sastrugi: warning: {doubt}")));
    }
}

/// `merge`.
pub fn merge(args: &Merge, common: &Common) -> Verdict {
    finish_run(common, |reporter| {
        Ok(remote::releasing(&args.output, None, args.replace, reporter, |output, _, replace| {
            studies::merge(&args.shards, output, replace, reporter)
        })?)
    })
}

/// `traverse`.
pub fn traverse(args: &Traverse, common: &Common) -> Verdict {
    let mut missions = json!({ "count": args.missions });
    parameters::assign(&mut missions, &args.set_missions)?;
    let mut parameters = json!({});
    parameters::assign_vehicle(&mut parameters, &args.vehicle)?;
    if let Some(replicates) = args.replicates {
        parameters["replicates"] = json!(replicates);
    }
    parameters::assign(&mut parameters, &args.set)?;
    let mut roughness = json!({});
    parameters::assign(&mut roughness, &args.set_roughness)?;
    print_warnings(&parameters::vehicle_doubts(&parameters), common);
    let request = drive::Request { dem: &args.dem, seed: args.seed, roughness, missions, parameters, date: &args.date };
    let Place { output, work } = &args.place;
    let place = drive::Place { output, work: work.as_deref(), replace: args.replace, limits: limits(None)? };
    finish_run(common, |reporter| Ok(drive::traverse(&request, &place, reporter)?))
}

/// Runs, prints the summary, and returns the exit code.
pub(super) fn finish_run(common: &Common, run: impl FnOnce(&Reporter) -> Result<RunSummary, Failure>) -> Verdict {
    let (summary, text) = watch(common, run)?;
    print(common.json, &serde_json::to_value(&summary).map_err(Failure::failed)?, &text)?;
    Ok(code(&summary))
}

/// The exit code of a run.
pub(super) fn code(summary: &RunSummary) -> Code {
    if summary.failures.is_empty() { Code::Done } else { Code::Partial }
}

/// Runs with progress reports, and returns the summary with its text.
pub(super) fn watch(
    common: &Common,
    run: impl FnOnce(&Reporter) -> Result<RunSummary, Failure>,
) -> Result<(RunSummary, String), Failure> {
    let reporter = Reporter::new(common.quiet);
    let start = Instant::now();
    let summary = run(&reporter);
    reporter.close();
    let summary = summary?;
    let text = told(&summary, &seconds(start.elapsed().as_secs_f64()));
    Ok((summary, text))
}

/// What a run did, what failed, what is to be noted, and where to read more.
fn told(summary: &RunSummary, took: &str) -> String {
    let RunSummary { output, items, computed, failures, .. } = summary;
    let mut text = format!(
        "{}: {}, {computed} computed, {} failed, {took}",
        output.display(),
        counted(items, "item"),
        failures.len()
    );
    if let Some(tally) = &summary.cache {
        text.push_str(&used(tally));
    }
    text.push_str(&failed(summary));
    let notes = notes(summary);
    if !notes.is_empty() {
        text.push_str(&format!("\nnotes:{notes}"));
    }
    let page = output.join(PAGE);
    if page.is_file() {
        text.push_str(&format!("\nreport: {}", page.display()));
    }
    text
}

/// The items that failed, after a merge with their shards, and below them those that needed their results.
fn failed(summary: &RunSummary) -> String {
    let (own, skipped): (Vec<&Failed>, Vec<&Failed>) =
        summary.failures.iter().partition(|failure| failure.skipped_for.is_none());
    if summary.failures.is_empty() {
        return String::new();
    }
    let mut text = "\nfailed items (parameters in manifest.json):".to_owned();
    for failure in own {
        let shard = summary.failed_in.get(&failure.item.to_string());
        let shard = shard.map_or_else(String::new, |shard| format!("shard {shard}, "));
        text.push_str(&format!("\n  {shard}{}: {}", failure.item, failure.message));
    }
    if !skipped.is_empty() {
        let named: Vec<String> = skipped.iter().take(SKIPPED_MAX).map(|f| f.item.to_string()).collect();
        let their = if skipped.len() == 1 { "its" } else { "their" };
        let count = counted(skipped.len(), "item");
        text.push_str(&format!("\n  {count} not run because {their} input failed: {}", named.join(", ")));
        if skipped.len() > SKIPPED_MAX {
            text.push_str(&format!(" and {} more", skipped.len() - SKIPPED_MAX));
        }
    }
    text
}

/// What a run did with its shared cache.
fn used(tally: &Tally) -> String {
    let Tally { fetched, published, damaged, changed, read_only, problems } = tally;
    let published = if *read_only { "read-only".to_owned() } else { format!("{published} published to it") };
    let mut text = format!("\n  shared cache: {} copied from it, {published}", counted(fetched, "item"));
    if !damaged.is_empty() {
        let outcome = if *read_only { "computed" } else { "replaced" };
        text.push_str(&format!(", damaged and {outcome}: {}", damaged.len()));
    }
    if !changed.is_empty() {
        text.push_str(&format!(", changed in the work area and computed again: {}", changed.len()));
    }
    problems.iter().take(NOTES_MAX).for_each(|problem| text.push_str(&format!("\n  shared cache: {problem}")));
    text
}

/// Notes on items: first verdicts on fits, then the other notes if they are few; one that several items have counts once.
fn notes(summary: &RunSummary) -> String {
    let verdicts = summary.verdicts();
    let line = |note: &ItemNote| format!("\n  {}/{}: {}", note.stage, note.item, note.note);
    let mut text: String = verdicts.iter().take(VERDICTS_MAX).map(|note| line(note)).collect();
    let others: Vec<&ItemNote> =
        summary.notes.iter().filter(|note| !verdicts.iter().take(VERDICTS_MAX).any(|v| v == note)).collect();
    let different = different(&others);
    if different.len() > NOTES_MAX {
        text.push_str(&format!("\n  {} notes on items: see `notes` in manifest.json", others.len()));
        return text;
    }
    for (note, count) in different {
        match count {
            1 => text.push_str(&line(note)),
            _ => text.push_str(&format!("\n  {}, {}: {}", note.stage, counted(count, "item"), note.note)),
        }
    }
    text
}

/// Notes of a stage that are equal once, with their number; as soon as too many differ, the rest does not matter.
fn different<'a>(notes: &[&'a ItemNote]) -> Vec<(&'a ItemNote, usize)> {
    let mut different: Vec<(&'a ItemNote, usize)> = Vec::new();
    for &note in notes {
        if different.len() > NOTES_MAX {
            break;
        }
        match different.iter_mut().find(|(first, _)| first.stage == note.stage && first.note == note.note) {
            Some((_, count)) => *count += 1,
            None => different.push((note, 1)),
        }
    }
    different
}

/// `verify`.
pub fn verify(args: &Verify, common: &Common) -> Verdict {
    let recompute = args.recompute.as_deref().map(parse_recompute).transpose()?;
    let reporter = Reporter::new(common.quiet);
    let limits = limits(None)?;
    let found = remote::with_folder(&args.release, &reporter, |folder| {
        verification::verify(folder, recompute, limits, &reporter)
    });
    reporter.close();
    let verification = found?;
    let mut text = format!("{}, {} checked", counted(verification.files, "file"), bytes(verification.bytes as f64));
    if !verification.recomputed.is_empty() {
        text.push_str(&format!(", {} recomputed", counted(verification.recomputed.len(), "item")));
    }
    match verification.differences.len() {
        0 => text.push_str(": no differences"),
        n => text.push_str(&format!(": {}", counted(n, "difference"))),
    }
    text.push_str(&listed(&verification.differences));
    if let Some(why) = &verification.not_comparable {
        text.push_str(&format!("\n{why}; `sastrugi compare` tests whether the numbers agree"));
    }
    print(common.json, &serde_json::to_value(&verification).map_err(Failure::failed)?, &text)?;
    Ok(if verification.differences.is_empty() { Code::Done } else { Code::Difference })
}

/// Differences, one per line.
fn listed(differences: &[Difference]) -> String {
    differences.iter().map(|d| format!("\n  {}: {}", d.path, d.problem)).collect()
}

/// `pack`.
pub fn pack(args: &Pack, common: &Common) -> Verdict {
    let reporter = Reporter::new(common.quiet);
    let packed = packing::pack(&args.release, &args.output, &reporter);
    reporter.close();
    let packing = packed?;
    let (output, json) = (packing.output.display(), serde_json::to_value(&packing).map_err(Failure::failed)?);
    let Some(sha256) = &packing.sha256 else {
        let count = counted(packing.differences.len(), "difference");
        let text = format!("{output} not written: the release has {count}{}", listed(&packing.differences));
        print(common.json, &json, &text)?;
        return Ok(Code::Difference);
    };
    let text =
        format!("{output}: {}, {}\n{sha256}  {output}", counted(packing.files, "file"), bytes(packing.bytes as f64));
    print(common.json, &json, &text)?;
    Ok(Code::Done)
}

fn parse_recompute(text: &str) -> Result<Recompute, Failure> {
    match (text, text.parse::<usize>()) {
        ("all", _) => Ok(Recompute::All),
        (_, Ok(count)) if count > 0 => Ok(Recompute::Some(count)),
        _ => Err(Failure::usage(format!("`--recompute {text}`: expected `all` or a number of items above 0"))),
    }
}

/// `report`.
pub fn report(args: &Report, common: &Common) -> Verdict {
    let output = args.output.clone().unwrap_or_else(|| default_report(&args.release));
    remote::check_local(&output)?;
    let refusal = "the report cannot be written into the release, which is sealed; choose a folder outside it with -o";
    let mut releases = [&args.release].into_iter().chain(&args.against);
    releases.try_for_each(|release| studies::check_outside(release, &output, refusal))?;
    let companions = Companions { against: args.against.clone(), logs: args.logs.clone() };
    let reporter = Reporter::new(common.quiet);
    let summary = sastrugi_report::render_with(&args.release, &companions, &output, &|step| reporter.step(step));
    let summary = summary.map_err(|e| match e {
        ReportError::Occupied { .. } => Failure::usage(e.to_string()),
        e if e.unusable_input() => Failure::input(e),
        e => Failure::failed(e),
    })?;
    let page = output.join("index.html");
    let text = format!("{}: {}", page.display(), counted(summary.files.len(), "file"));
    print(common.json, &json!({ "page": page, "files": summary.files }), &text)?;
    Ok(Code::Done)
}

fn default_report(release: &Path) -> PathBuf {
    let absolute = std::path::absolute(release).unwrap_or_else(|_| release.to_owned());
    let name = absolute.file_name().map_or_else(|| "release".into(), |n| n.to_string_lossy().into_owned());
    PathBuf::from(format!("{name}-report"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_stages::job::ItemRef;

    fn failure(item: &str, skipped_for: Option<&str>) -> Failed {
        Failed {
            item: ItemRef::new("fit", item),
            message: "the surface is flat".to_owned(),
            unusable_input: false,
            skipped_for: skipped_for.map(|cause| ItemRef::new("fit", cause)),
            parameters: None,
        }
    }

    /// Each failed item once, and notes under a heading of their own.
    #[test]
    fn val_the_end_of_a_run() {
        let note = ItemNote { stage: "fit".to_owned(), item: "snow".to_owned(), note: "short range".to_owned() };
        let mut summary = RunSummary {
            output: PathBuf::from("no-such-release"),
            items: 1,
            computed: 1,
            failures: Vec::new(),
            notes: Vec::new(),
            failed_in: Default::default(),
            cache: None,
        };
        assert_eq!(told(&summary, "2 s"), "no-such-release: 1 item, 1 computed, 0 failed, 2 s");
        let skipped = ["a", "b", "c", "d", "e", "f", "g"].map(|item| failure(item, Some("plane")));
        summary.failures = [failure("plane", None)].into_iter().chain(skipped).collect();
        summary.notes = vec![note];
        summary.failed_in = [("fit/plane".to_owned(), 3)].into();
        let lines = [
            "no-such-release: 1 item, 1 computed, 8 failed, 2 s",
            "failed items (parameters in manifest.json):",
            "  shard 3, fit/plane: the surface is flat",
            "  7 items not run because their input failed: fit/a, fit/b, fit/c, fit/d, fit/e and 2 more",
            "notes:",
            "  fit/snow: short range",
        ];
        assert_eq!(told(&summary, "2 s"), lines.join("\n"));
        summary.failures.truncate(2);
        assert!(told(&summary, "2 s").contains("\n  1 item not run because its input failed: fit/a\n"));
        summary.cache = Some(Tally { published: 2, changed: ["fit/b".to_owned()].into(), ..Tally::default() });
        let shared = "\n  shared cache: 0 items copied from it, 2 published to it, changed in the work area and computed again: 1\n";
        assert!(told(&summary, "2 s").contains(shared));
    }

    /// Of each fit the verdict, which is its first note, before the other notes; one that many items have is
    /// told once. Of many fits the first five, and the rest is counted.
    #[test]
    fn val_a_run_ends_with_the_verdicts_on_its_fits() {
        let note = |stage: &str, item: &str, note: &str| ItemNote {
            stage: stage.to_owned(),
            item: item.to_owned(),
            note: note.to_owned(),
        };
        let of_fits = [
            note("fit", "bar", "roughness of short range"),
            note("fit", "bar", "0.2 of the cells are masked"),
            note("fit", "snow", "the fit cannot tell"),
        ];
        let summary = |notes: Vec<ItemNote>| RunSummary {
            output: PathBuf::from("no-such-release"),
            items: 9,
            computed: 9,
            failures: Vec::new(),
            notes,
            failed_in: Default::default(),
            cache: None,
        };
        let of_dem = note("dem", "d", "rows were flipped");
        let few = summary([of_dem].into_iter().chain(of_fits).collect());
        let lines = [
            "no-such-release: 9 items, 9 computed, 0 failed, 2 s",
            "notes:",
            "  fit/bar: roughness of short range",
            "  fit/snow: the fit cannot tell",
            "  dem/d: rows were flipped",
            "  fit/bar: 0.2 of the cells are masked",
        ];
        assert_eq!(told(&few, "2 s"), lines.join("\n"));
        let coarse = |vehicle: &'static str| {
            (1..=10).map(move |k| note("traverse", &format!("{vehicle}@t{k}"), &format!("coarse for {vehicle}")))
        };
        let twenty = told(&summary(coarse("husky").chain(coarse("car")).collect()), "2 s");
        let lines = "\nnotes:\n  traverse, 10 items: coarse for husky\n  traverse, 10 items: coarse for car";
        assert!(twenty.ends_with(lines), "{twenty}");
        let many = summary((0..9).map(|k| note("fit", &format!("f{k}"), &format!("verdict {k}"))).collect());
        let shown: String = (0..VERDICTS_MAX).map(|k| format!("\n  fit/f{k}: verdict {k}")).collect();
        let left = 9 - VERDICTS_MAX;
        let text = format!("notes:{shown}\n  {left} notes on items: see `notes` in manifest.json");
        assert!(told(&many, "2 s").ends_with(&text), "{}", told(&many, "2 s"));
    }
}
