//! What a command does with a whole study: run, plan, merge. What it does with a release is in [`crate::verification`].

use crate::error::Error;
use crate::jobs::{fit, original};
use crate::loaded::{Loaded, load_text};
use crate::registry;
use crate::runner::assemble::{Contents, assemble};
use crate::runner::cache::Cache;
use crate::runner::execute::{Execution, Failure, Limits, execute};
use crate::runner::plan::{PlanSummary, plan};
use crate::runner::progress::Progress;
use crate::runner::shard::{self, Part};
use crate::study::Study;
use sastrugi_schemas::manifest::ItemNote;
use sastrugi_schemas::study::StudyHead;
use sastrugi_store::release;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// A run.
#[derive(Clone, Copy)]
pub struct RunRequest<'a> {
    /// Release folder, or folder of the shard.
    pub output: &'a Path,
    /// Work area; `<output>.work` when absent.
    pub work: Option<&'a Path>,
    /// Part of the study to run.
    pub part: Option<Part>,
    /// The stage whose results are asked for: without any of them there is nothing to release.
    pub purpose: Option<&'static str>,
    /// Whether a release of the same study with fewer failed items is replaced.
    pub replace: bool,
    /// Limits.
    pub limits: Limits,
}

/// What a run came to.
#[derive(Debug, Serialize)]
pub struct RunSummary {
    /// Release or shard folder.
    pub output: PathBuf,
    /// Items that were needed.
    pub items: usize,
    /// Items that were computed now.
    pub computed: usize,
    /// Items without a result.
    pub failures: Vec<Failure>,
    /// Sentences about the items of a release, as its manifest has them; none of a shard.
    pub notes: Vec<ItemNote>,
}

impl RunSummary {
    /// What each fit came to: the first of its notes.
    pub fn verdicts(&self) -> Vec<&ItemNote> {
        let of_fits = self.notes.iter().filter(|note| note.stage == fit::STAGE);
        let mut verdicts: Vec<&ItemNote> = of_fits.collect();
        verdicts.dedup_by(|later, first| later.item == first.item);
        verdicts
    }
}

/// The work area that belongs to a release folder.
pub fn default_work(output: &Path) -> PathBuf {
    let name = output.file_name().map_or_else(|| "release".into(), |n| n.to_string_lossy().into_owned());
    output.with_file_name(format!("{name}.work"))
}

/// Runs a study to a release, or a shard of it to a partial folder.
///
/// # Errors
/// A destination that is not ours, a busy work area, or no item with a result. Failed items are no error as long as some
/// have a result: they are listed.
pub fn run(loaded: &Loaded, request: &RunRequest<'_>, progress: &dyn Progress) -> Result<RunSummary, Error> {
    check_destination(request)?;
    let work = request.work.map_or_else(|| default_work(request.output), Path::to_owned);
    let cache = Cache::open(&work)?;
    let graph = &loaded.graph;
    let needed = needed(loaded, request.part);
    check_memory(loaded, &cache, &needed, request.limits)?;
    let execution = execute(graph, &cache, &needed, request.limits, progress)?;
    write_timings(&cache, &execution)?;
    let made = execution.done.iter().any(|&p| is_worth_a_release(&graph.node(p).item.stage, request.purpose));
    if !made && !execution.failures.is_empty() {
        return Err(all_failed(&execution.failures));
    }
    let notes = match request.part {
        Some(part) => {
            shard::write(request.output, loaded, &cache, part, &execution.failures, request.replace)?;
            Vec::new()
        }
        None => {
            let results =
                execution.done.iter().map(|&p| cache.result_folder(&graph.node(p).item, graph.key(p))).collect();
            let contents = Contents {
                study: &loaded.study,
                text: &loaded.released,
                splits: &loaded.splits,
                results,
                failures: &execution.failures,
                replace: request.replace,
            };
            assemble(&contents, request.output, progress)?.manifest().notes.clone()
        }
    };
    cache.drop_orphans(graph)?;
    let computed = execution.seconds.len() - execution.failures.iter().filter(|f| f.skipped_for.is_none()).count();
    let (output, items, failures) = (request.output.to_owned(), needed.len(), execution.failures);
    Ok(RunSummary { output, items, computed, failures, notes })
}

/// Items of a part of a study with those that they need; all of them without a part.
fn needed(loaded: &Loaded, part: Option<Part>) -> Vec<usize> {
    let graph = &loaded.graph;
    graph.closure((0..graph.len()).filter(|&p| part.is_none_or(|part| part.owns(graph.key(p)))))
}

/// Refuses a run with an item that needs more memory by itself than there may be, before anything is computed.
fn check_memory(loaded: &Loaded, cache: &Cache, needed: &[usize], limits: Limits) -> Result<(), Error> {
    let graph = &loaded.graph;
    let missing =
        needed.iter().map(|&p| graph.node(p)).zip(needed).filter(|(n, p)| !cache.holds(&n.item, graph.key(**p)));
    let largest = missing.map(|(node, _)| (node.job.memory_bytes(), &node.item)).max_by_key(|(bytes, _)| *bytes);
    match largest {
        Some((bytes, item)) if bytes > limits.memory_bytes && !limits.beyond => {
            let gib = |bytes: u64| bytes as f64 / f64::from(1u32 << 30);
            Err(Error::Usage(format!(
                "`--memory {:.3}`: {item} needs about {:.2} GiB by itself; give at least that much, or make the item smaller",
                gib(limits.memory_bytes),
                gib(bytes)
            )))
        }
        _ => Ok(()),
    }
}

/// Files are only copied: with nothing else there is no release to make.
fn is_worth_a_release(stage: &str, purpose: Option<&str>) -> bool {
    purpose.map_or(!original::only_copies(stage), |purpose| purpose == stage)
}

/// A folder that is not ours is refused before any work is done.
fn check_destination(request: &RunRequest<'_>) -> Result<(), Error> {
    let ours = if request.part.is_some() { release::SHARD } else { release::MANIFEST };
    match fs::read_dir(request.output).map(|mut entries| entries.next().is_some()) {
        Ok(true) if !request.output.join(ours).is_file() => {
            let what = if request.part.is_some() { "shard" } else { "release" };
            let path = request.output.display();
            Err(Error::Usage(format!("{path}: not a sastrugi {what}, and not empty; choose another folder with -o")))
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotADirectory => {
            Err(Error::Usage(format!("{}: is a file; -o names a folder", request.output.display())))
        }
        _ => Ok(()),
    }?;
    let inside = request.work.is_some_and(|work| resolved(work).starts_with(resolved(request.output)));
    if inside {
        return Err(Error::Usage(
            "the work area lies inside of the output, which is replaced as a whole; name another --work".to_owned(),
        ));
    }
    if resolved(request.output) == resolved(Path::new(".")) {
        return Err(Error::Usage("the output is the current folder; name a folder to make with -o".to_owned()));
    }
    Ok(())
}

/// What the study of a release says of it as a whole.
///
/// # Errors
/// A study that is missing or wrong.
pub fn head_of(release: &Path) -> Result<StudyHead, Error> {
    let path = release.join("study.toml");
    let refuse = |why: &dyn std::fmt::Display| Error::Input(format!("{}: {why}", path.display()));
    let text = sastrugi_store::file::read_text(&path).map_err(|e| refuse(&e))?;
    let study = Study::parse(&text, release, &registry::section_names()).map_err(|e| refuse(&e))?;
    Ok(study.head)
}

/// A path with links and dots resolved as far as it exists.
pub fn resolved(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    absolute.components().fold(PathBuf::new(), |mut at, component| {
        match component {
            Component::ParentDir => drop(at.pop()),
            Component::CurDir => {}
            other => at.push(other),
        }
        at.canonicalize().unwrap_or(at)
    })
}

fn all_failed(failures: &[Failure]) -> Error {
    let causes: Vec<&Failure> = failures.iter().filter(|f| f.skipped_for.is_none()).collect();
    let first = causes.first().map_or_else(String::new, |f| format!("{}: {}", f.item, f.message));
    let message = match causes.len() {
        0 | 1 => first,
        n => format!("every item failed, {n} of them by themselves; the first: {first}"),
    };
    if causes.iter().all(|f| f.unusable_input) { Error::Input(message) } else { Error::Failed(message) }
}

/// Keeps the wall time of every item that ran, for people; no result depends on it.
fn write_timings(cache: &Cache, execution: &Execution) -> Result<(), Error> {
    let path = cache.folder().join("timings.json");
    let earlier = fs::read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut seconds: BTreeMap<String, f64> = earlier.unwrap_or_default();
    seconds.extend(execution.seconds.clone());
    let text = serde_json::to_vec_pretty(&seconds).map_err(Error::failed)?;
    sastrugi_store::atomic::write(&path, &text).map_err(|e| Error::at(&path, e))
}

/// What a run would do, without doing it.
///
/// # Errors
/// When the work area cannot be read.
pub fn plan_of(loaded: &Loaded, output: &Path, work: Option<&Path>, part: Option<Part>) -> Result<PlanSummary, Error> {
    let work = work.map_or_else(|| default_work(output), Path::to_owned);
    let plan = plan(&loaded.graph, &needed(loaded, part), &Cache::look(&work));
    Ok(PlanSummary { doubts: loaded.doubts.clone(), ..plan })
}

/// Joins shards to a release.
///
/// # Errors
/// Shards that do not make one study, or a destination that is not ours.
pub fn merge(shards: &[PathBuf], output: &Path, replace: bool, progress: &dyn Progress) -> Result<RunSummary, Error> {
    let joined = shard::join(shards)?;
    let study = Study::parse(&joined.study, Path::new(""), &registry::section_names()).map_err(Error::failed)?;
    let items = joined.results.len() + joined.failures.len();
    let contents = Contents {
        study: &study,
        text: &joined.study,
        splits: &joined.splits,
        results: joined.results,
        failures: &joined.failures,
        replace,
    };
    let notes = assemble(&contents, output, progress)?.manifest().notes.clone();
    Ok(RunSummary { output: output.to_owned(), items, computed: 0, failures: joined.failures, notes })
}

/// Runs a study that a verb made up, to a release of its own.
///
/// # Errors
/// As [`run`].
pub fn run_text(
    text: &str,
    folder: &Path,
    request: &RunRequest<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, Error> {
    let loaded = load_text(text, "this command", folder)?;
    run(&loaded, request, progress)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STUDY: &str = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
        count = 2\nsize_px = [64, 64]\nhigh.fractal_dimension = 2.5\nsweep.cell_m = [0.05, 0.1]\n\n[[missions]]\nid = \"m\"\nterrains = [\"t\"]\n\n\
        [[traverse]]\nid = \"h\"\nmissions = \"m\"\ncontroller.lookahead_m = 1.0\n";

    #[test]
    fn val_a_study_becomes_its_items() {
        let loaded = load_text(STUDY, "study", Path::new("")).unwrap();
        // Four terrains, each described, with missions drawn and driven.
        assert_eq!(loaded.graph.len(), 16);
        assert_eq!(loaded.released, STUDY);
    }

    #[test]
    fn val_a_hundred_thousand_missions_are_planned() {
        let text = STUDY.replace("count = 2\n", "count = 2500\n").replace("id = \"m\"\n", "id = \"m\"\ncount = 20\n");
        let loaded = load_text(&text, "study", Path::new("")).unwrap();
        let nowhere = tempfile::tempdir().unwrap();
        let summary = plan_of(&loaded, &nowhere.path().join("release"), None, None).unwrap();
        // 2500 terrains of each of two cell sizes, in four stages; 20 missions on each.
        assert_eq!((summary.items, summary.ready, summary.stale.len()), (20_000, 0, 20_000));
        assert!(summary.stale.iter().all(|item| item.reason == "new"));
    }

    #[test]
    fn val_the_released_study_points_into_the_release() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("my dem.TIF"), b"x").unwrap();
        let text = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"d\"\nfile = \"my dem.TIF\" # mine\n";
        let loaded = load_text(text, "study", folder.path()).unwrap();
        assert_eq!(loaded.released, text.replace("my dem.TIF", "dem/d.tif"));
        // Bytes that editors leave: a byte order mark, line ends of two bytes; tables in line.
        let windows = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        let loaded = load_text(&windows, "study", folder.path()).unwrap();
        assert_eq!(loaded.released, windows.replace("my dem.TIF", "dem/d.tif"));
        let inline =
            "dem = [{ id = \"d\", file = 'my dem.TIF' }]\n[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n";
        let loaded = load_text(inline, "study", folder.path()).unwrap();
        assert_eq!(loaded.released, inline.replace("'my dem.TIF'", "\"dem/d.tif\""));
    }

    proptest! {
        /// Whatever bytes a study file holds, reading it ends in a study or an error, never in a panic.
        #[test]
        fn prop_any_text_is_read_or_refused(text in "\\PC*") {
            let _ = load_text(&text, "study", Path::new(""));
        }

        #[test]
        fn prop_a_damaged_study_is_read_or_refused(at in 0usize..STUDY.len(), cut in 0usize..6, put in "[\\[\\]{}=\"'.,#0-9a-z\\-\n]{0,4}") {
            let end = (at + cut).min(STUDY.len());
            let text = format!("{}{put}{}", &STUDY[..at], &STUDY[end..]);
            let _ = load_text(&text, "study", Path::new(""));
        }
    }
}
