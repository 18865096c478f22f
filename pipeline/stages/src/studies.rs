//! Commands on studies: run, plan, merge. For commands on releases see [`crate::verification`].

use crate::error::Error;
use crate::jobs::{fit, original};
use crate::loaded::{Loaded, load_text};
use crate::registry;
use crate::remote::{check_local, work_area};
use crate::runner::assemble::{Contents, assemble, check_other_study};
use crate::runner::cache::Cache;
use crate::runner::damage::Changed;
use crate::runner::division::{Division, common_ancestors, divide};
use crate::runner::execute::{Execution, Failure, Limits, execute};
use crate::runner::plan::{PlanSummary, plan};
use crate::runner::progress::Progress;
use crate::runner::shard::{self, Part};
use crate::runner::shared::{Sharing, Tally};
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
    /// Release folder, or folder of a shard.
    pub output: &'a Path,
    /// Work area; default: `<output>.work`.
    pub work: Option<&'a Path>,
    /// Shard of the study to run.
    pub part: Option<Part>,
    /// The stage whose results are wanted; without any of them no release is written.
    pub purpose: Option<&'static str>,
    /// Whether to replace a release or shard of another study, another shard, or the same with fewer failed items.
    pub replace: bool,
    /// Limits.
    pub limits: Limits,
}

/// Summary of a run.
#[derive(Debug, Serialize)]
pub struct RunSummary {
    /// Release or shard folder.
    pub output: PathBuf,
    /// Items that were needed.
    pub items: usize,
    /// Items computed in this run.
    pub computed: usize,
    /// Items without a result.
    pub failures: Vec<Failure>,
    /// Notes on the items of a release, as in its manifest; empty for a shard.
    pub notes: Vec<ItemNote>,
    /// Of a merge: the shard of each item without a result.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub failed_in: BTreeMap<String, u32>,
    /// What was done with the shared cache, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cache: Option<Tally>,
}

impl RunSummary {
    /// The verdict on each fit, which is the first of its notes.
    pub fn verdicts(&self) -> Vec<&ItemNote> {
        let of_fits = self.notes.iter().filter(|note| note.stage == fit::STAGE);
        let mut verdicts: Vec<&ItemNote> = of_fits.collect();
        verdicts.dedup_by(|later, first| later.item == first.item);
        verdicts
    }
}

/// The work area that belongs to a release folder; for a link to a folder, to that folder.
///
/// ```
/// use sastrugi_stages::studies::default_work;
/// use std::path::Path;
///
/// assert_eq!(default_work(Path::new("out/snow")), Path::new("out/snow.work"));
/// ```
pub fn default_work(output: &Path) -> PathBuf {
    let output = release::behind_link(output);
    let name = output.file_name().map_or_else(|| "release".into(), |n| n.to_string_lossy().into_owned());
    output.with_file_name(format!("{name}.work"))
}

/// Runs a study and writes a release, or runs a shard of it and writes a shard folder.
///
/// # Errors
/// A destination that is not a sastrugi folder, a busy work area, or no item with a result. As long as some items have a
/// result, failed items are not an error but are listed.
pub fn run(loaded: &Loaded, request: &RunRequest<'_>, progress: &dyn Progress) -> Result<RunSummary, Error> {
    run_sharing(loaded, request, None, progress)
}

/// The same with a shared cache: items that it has are copied, all others are published to it.
///
/// # Errors
/// As [`run`]. A cache that fails is not an error; see [`RunSummary::cache`].
pub fn run_sharing(
    loaded: &Loaded,
    request: &RunRequest<'_>,
    sharing: Option<Sharing>,
    progress: &dyn Progress,
) -> Result<RunSummary, Error> {
    check_destination(&loaded.study, request)?;
    let work = request.work.map_or_else(|| default_work(request.output), Path::to_owned);
    let cache = Cache::open(&work)?.sharing(sharing);
    let graph = &loaded.graph;
    let needed = needed(loaded, request.part);
    check_memory(loaded, &cache, &needed, request.limits)?;
    let execution = execute(graph, &cache, &needed, request.limits, progress)?;
    write_timings(&cache, &execution)?;
    let made = execution.done.iter().any(|&p| is_worth_a_release(&graph.node(p).item.stage, request.purpose));
    // A shard is written even so: other shards may have results.
    if !made && !execution.failures.is_empty() && request.part.is_none() {
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
                on_changed: Changed::remove,
                failures: &execution.failures,
                replace: request.replace,
            };
            assemble(&contents, request.output, progress)?
        }
    };
    cache.drop_orphans(graph)?;
    Ok(RunSummary { notes, ..summary(request.output, needed.len(), execution, &cache) })
}

/// Computes the items that more than one of `count` shards needs, and publishes them to a shared cache. Nothing but the work area is
/// written otherwise.
///
/// # Errors
/// A busy work area; a cache that is read-only, or to which an item could not be published: the shards would compute it again.
/// Failed items are listed, even if all of them failed: other items of the study may have results.
pub fn run_ancestors(
    loaded: &Loaded,
    count: u32,
    request: &RunRequest<'_>,
    sharing: Sharing,
    progress: &dyn Progress,
) -> Result<RunSummary, Error> {
    if sharing.tally().read_only {
        return Err(Error::Usage(
            "the cache cannot be written to, so the shards would not find the ancestors".to_owned(),
        ));
    }
    let work = request.work.map_or_else(|| default_work(request.output), Path::to_owned);
    check_local(&work)?;
    let cache = Cache::open(&work)?.sharing(Some(sharing));
    let needed = common_ancestors(&loaded.graph, count);
    check_memory(loaded, &cache, &needed, request.limits)?;
    let execution = execute(&loaded.graph, &cache, &needed, request.limits, progress)?;
    write_timings(&cache, &execution)?;
    let summary = summary(&work, needed.len(), execution, &cache);
    if let Some(problem) = cache.shared().and_then(Sharing::lasting_problem) {
        let message = format!("some ancestors may be missing from the cache: {problem}; fix the problem and run again");
        return Err(Error::Failed(message));
    }
    match summary.cache.as_ref().and_then(|tally| tally.problems.first().cloned()) {
        Some(problem) => {
            Err(Error::Retry(format!("some ancestors may be missing from the cache: {problem}; run again")))
        }
        None => Ok(summary),
    }
}

/// Summary of an execution.
fn summary(output: &Path, items: usize, execution: Execution, cache: &Cache) -> RunSummary {
    let failed = execution.failures.iter().filter(|f| f.skipped_for.is_none()).count();
    RunSummary {
        output: output.to_owned(),
        items,
        computed: execution.seconds.len() - failed,
        failures: execution.failures,
        notes: Vec::new(),
        failed_in: BTreeMap::new(),
        cache: cache.shared().map(Sharing::tally),
    }
}

/// Items of a shard and their ancestors; all items without a shard.
fn needed(loaded: &Loaded, part: Option<Part>) -> Vec<usize> {
    let graph = &loaded.graph;
    graph.closure((0..graph.len()).filter(|&p| part.is_none_or(|part| part.owns(graph.key(p)))))
}

/// Refuses, before anything is computed, a run with an item that needs more memory than the limit.
fn check_memory(loaded: &Loaded, cache: &Cache, needed: &[usize], limits: Limits) -> Result<(), Error> {
    let graph = &loaded.graph;
    let missing =
        needed.iter().map(|&p| graph.node(p)).zip(needed).filter(|(n, p)| !cache.holds(&n.item, graph.key(**p)));
    let largest = missing.map(|(node, _)| (node.job.memory_bytes(), &node.item)).max_by_key(|(bytes, _)| *bytes);
    match largest {
        Some((bytes, item)) if bytes > limits.memory_bytes && !limits.beyond => {
            let gib = |bytes: u64| bytes as f64 / f64::from(1u32 << 30);
            Err(Error::Usage(format!(
                "`--memory {:.3}`: {item} alone needs about {:.2} GiB; raise the limit, or make the item smaller",
                gib(limits.memory_bytes),
                gib(bytes)
            )))
        }
        _ => Ok(()),
    }
}

/// Input files are only copied; with nothing else there is nothing to release.
fn is_worth_a_release(stage: &str, purpose: Option<&str>) -> bool {
    purpose.map_or(!original::only_copies(stage), |purpose| purpose == stage)
}

/// Refuses a foreign destination before any work is done.
fn check_destination(study: &Study, request: &RunRequest<'_>) -> Result<(), Error> {
    check_local(request.output)?;
    request.work.map_or(Ok(()), check_local)?;
    let ours = if request.part.is_some() { release::SHARD } else { release::MANIFEST };
    match fs::read_dir(request.output).map(|mut entries| entries.next().is_some()) {
        Ok(true) if !request.output.join(ours).is_file() => {
            let what = if request.part.is_some() { "shard" } else { "release" };
            let path = request.output.display();
            Err(Error::Usage(format!("{path} is not empty and not a sastrugi {what}; choose another folder with -o")))
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotADirectory => {
            Err(Error::Usage(format!("{} is a file; -o must be a folder", request.output.display())))
        }
        _ => Ok(()),
    }?;
    match request.part {
        Some(part) => shard::check_destination(study, request.output, part, request.replace)?,
        None => check_other_study(study, request.output, request.replace)?,
    }
    let inside = request.work.is_some_and(|work| resolved(work).starts_with(resolved(request.output)));
    if inside {
        return Err(Error::Usage(
            "the work area lies inside the output folder, which is replaced; choose another --work".to_owned(),
        ));
    }
    if resolved(request.output) == resolved(Path::new(".")) {
        return Err(Error::Usage("the output is the current folder; choose a new folder with -o".to_owned()));
    }
    Ok(())
}

/// The `[study]` table of a release.
///
/// # Errors
/// A study that is missing or invalid.
pub fn head_of(release: &Path) -> Result<StudyHead, Error> {
    let path = release.join(release::STUDY);
    let refuse = |why: &dyn std::fmt::Display| Error::Input(format!("{}: {why}", path.display()));
    let text = sastrugi_store::file::read_text(&path).map_err(|e| refuse(&e))?;
    let study = Study::parse(&text, release, &registry::section_names()).map_err(|e| refuse(&e))?;
    Ok(study.head)
}

/// Refuses an output inside a release, which is sealed. A folder that is not a release is refused as such.
///
/// # Errors
/// Such an output, with the message `refusal`; a release that cannot be read.
pub fn check_outside(release: &Path, output: &Path, refusal: &str) -> Result<(), Error> {
    if !resolved(output).starts_with(resolved(release)) {
        return Ok(());
    }
    release::for_each_artifact(release, drop)?;
    Err(Error::Usage(refusal.to_owned()))
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
        n => format!("every item failed, {n} of them on their own; the first: {first}"),
    };
    if causes.iter().all(|f| f.unusable_input) { Error::Input(message) } else { Error::Failed(message) }
}

/// Records the wall time of every item that ran, for information; no result depends on it.
fn write_timings(cache: &Cache, execution: &Execution) -> Result<(), Error> {
    let path = cache.folder().join("timings.json");
    let earlier = sastrugi_store::file::read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut seconds: BTreeMap<String, f64> = earlier.unwrap_or_default();
    seconds.extend(execution.seconds.clone());
    let text = serde_json::to_vec_pretty(&seconds).map_err(Error::failed)?;
    sastrugi_store::atomic::write(&path, &text).map_err(|e| Error::at(&path, e))
}

/// Plans a run: the items that it would compute, with cost and reason, and the doubts about the study.
///
/// # Errors
/// If the work area cannot be read.
///
/// # Examples
/// ```
/// use sastrugi_stages::loaded::load_text;
/// use sastrugi_stages::starting::STARTING;
/// use sastrugi_stages::studies::plan_of;
/// use std::path::Path;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let nowhere = tempfile::tempdir()?;
/// let terrain = STARTING.iter().find(|starting| starting.name == "terrain").ok_or("no such study")?;
/// let loaded = load_text(terrain.text, "study.toml", Path::new(""))?;
/// let plan = plan_of(&loaded, &nowhere.path().join("release"), None, None)?;
/// // Nothing is there yet, and nothing in the study is doubtful.
/// assert!(plan.items > 0 && plan.ready == 0 && plan.stale.len() == plan.items);
/// assert!(plan.stale.iter().all(|stale| stale.reason == "new"));
/// assert!(plan.doubts.is_empty());
/// # Ok(())
/// # }
/// ```
pub fn plan_of(loaded: &Loaded, output: &Path, work: Option<&Path>, part: Option<Part>) -> Result<PlanSummary, Error> {
    let plan = plan(&loaded.graph, &needed(loaded, part), &Cache::look(&work_area(output, work)));
    let assembly_seconds = if part.is_some() { 0.0 } else { plan.assembly_seconds };
    Ok(PlanSummary { doubts: loaded.doubts.clone(), assembly_seconds, ..plan })
}

/// Divides a study into `count` shards: what each costs, and what they have in common.
pub fn plan_shards(loaded: &Loaded, count: u32) -> Division {
    divide(&loaded.graph, count)
}

/// Merges shards into a release.
///
/// # Errors
/// Shards that do not form one complete study, or a destination that is not a sastrugi folder.
pub fn merge(shards: &[PathBuf], output: &Path, replace: bool, progress: &dyn Progress) -> Result<RunSummary, Error> {
    check_local(output)?;
    let joined = shard::join(shards)?;
    if joined.results.is_empty() && !joined.failures.is_empty() {
        return Err(all_failed(&joined.failures));
    }
    let study = Study::parse(&joined.study, Path::new(""), &registry::section_names()).map_err(Error::failed)?;
    let items = joined.results.len() + joined.failures.len();
    let contents = Contents {
        study: &study,
        text: &joined.study,
        splits: &joined.splits,
        results: joined.results,
        on_changed: shard::refuse_changed,
        failures: &joined.failures,
        replace,
    };
    let notes = assemble(&contents, output, progress)?;
    let (failures, failed_in) = (joined.failures, joined.failed_in);
    Ok(RunSummary { output: output.to_owned(), items, computed: 0, failures, notes, failed_in, cache: None })
}

/// Runs a study composed by a verb and writes its release.
///
/// # Errors
/// As [`run`]; a destination with a release over another DEM.
pub fn run_text(
    text: &str,
    folder: &Path,
    request: &RunRequest<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, Error> {
    // Before the study, whose input may be refused.
    check_local(request.output)?;
    let loaded = load_text(text, "this command", folder)?;
    check_other_dem(&loaded, request.output, request.replace)?;
    run(&loaded, request, progress)
}

/// Refuses a destination with a release over another DEM, unless it may be replaced: all studies that a verb composes have its name, so the
/// name does not tell them apart.
fn check_other_dem(loaded: &Loaded, dest: &Path, replace: bool) -> Result<(), Error> {
    let is_given = |sha256: &str| {
        let mut originals = loaded.graph.nodes().iter().filter(|node| node.item.stage == original::STAGE);
        originals.any(|node| node.inputs.first().is_some_and(|dem| dem.sha256 == sha256))
    };
    let mut is_there = false;
    let manifest = release::for_each_artifact(dest, |artifact| {
        is_there |= artifact.origin.stage == original::STAGE && is_given(&artifact.sha256);
    });
    match manifest {
        // A release of another name is refused as one of another study.
        Ok(there) if there.name == loaded.study.head.name && !is_there && !replace => Err(Error::Usage(format!(
            "{} is a release over another DEM; choose another folder with -o, or use --replace to replace it",
            dest.display()
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::{roughness, terrain, traverse};
    use crate::registry::Form;
    use crate::runner::assemble::head;
    use crate::study::keys::properties;
    use crate::study::{Refusals, StudyError};
    use proptest::collection::{btree_map, vec};
    use proptest::option::weighted;
    use proptest::prelude::*;
    use proptest::sample::select;
    use sastrugi_schemas::kind::schema_of;
    use sastrugi_schemas::manifest::Origin;
    use sastrugi_store::release::ReleaseBuilder;
    use serde_json::json;

    const STUDY: &str = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
        count = 2\nsize_px = [64, 64]\nhigh.fractal_dimension = 2.5\nsweep.cell_m = [0.05, 0.1]\n\n[[missions]]\nid = \"m\"\nterrains = [\"t\"]\n\
        length_m = 2.0\nborder_m = 0.5\n\n[[traverse]]\nid = \"h\"\nmissions = \"m\"\ncontroller.lookahead_m = 1.0\n";

    #[test]
    fn val_a_study_becomes_its_items() {
        let loaded = load_text(STUDY, "study", Path::new("")).unwrap();
        // Four terrains, each with its description, missions and traverse.
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

    /// The text that goes into a key is that of the recipe with all its keys, once each, however a job keeps it, also beside groups,
    /// variants and odd characters.
    #[test]
    fn prop_recipes_and_their_texts_agree() {
        let odd = STUDY.replace("id = \"t\"\n", "id = \"t\"\ngroup = \"\\\"a é\"\n");
        // Jobs that keep their recipe as text.
        let keys: [(&str, &[&str]); 3] = [
            (terrain::STAGE, &["kind", "params"]),
            (roughness::STAGE, &["section", "group", "variant", "kind", "params", "path"]),
            (
                traverse::STAGE,
                &["traverse", "vehicle", "starts", "rasters", "terrain", "group", "variant", "missions", "study"],
            ),
        ];
        for (text, group) in [(STUDY, None), (odd.as_str(), Some("\"a é"))] {
            let loaded = load_text(text, "study", Path::new("")).unwrap();
            let mut found = 0;
            for (position, node) in loaded.graph.nodes().iter().enumerate() {
                let recipe = node.job.recipe();
                assert_eq!(node.job.recipe_text(), recipe.to_string(), "{}", node.item);
                assert!(recipe.is_object() && loaded.graph.key(position).len() == 32);
                let Some((stage, expected)) = keys.iter().find(|(stage, _)| *stage == node.item.stage) else {
                    continue;
                };
                assert!(recipe.as_object().unwrap().keys().eq(expected.iter()), "{}: {recipe}", node.item);
                let is_named = *stage == terrain::STAGE || group.is_none_or(|group| recipe["group"] == group);
                assert!(is_named, "{}: {recipe}", node.item);
                found += 1;
            }
            // Four terrains in three stages.
            assert_eq!(found, 12);
        }
    }

    #[test]
    fn val_the_released_study_points_into_the_release() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("my dem.TIF"), b"x").unwrap();
        let text = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"d\"\nfile = \"my dem.TIF\" # mine\n";
        let loaded = load_text(text, "study", folder.path()).unwrap();
        assert_eq!(loaded.released, text.replace("my dem.TIF", "dem/d.tif"));
        // A byte order mark, CRLF line ends, and inline tables.
        let windows = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        let loaded = load_text(&windows, "study", folder.path()).unwrap();
        assert_eq!(loaded.released, windows.replace("my dem.TIF", "dem/d.tif"));
        let inline =
            "dem = [{ id = \"d\", file = 'my dem.TIF' }]\n[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n";
        let loaded = load_text(inline, "study", folder.path()).unwrap();
        assert_eq!(loaded.released, inline.replace("'my dem.TIF'", "\"dem/d.tif\""));
    }

    /// Folders of others, files, and work areas that would be replaced are refused before any work; a shard is not written over a release.
    #[test]
    fn val_destinations() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["empty", "foreign", "release", "shard"] {
            fs::create_dir(path(name)).unwrap();
        }
        for name in ["file", "foreign/thesis.txt"] {
            fs::write(path(name), "precious").unwrap();
        }
        let description = r#"{ "part": { "index": 1, "count": 2 }, "program": "sastrugi", "study_sha256": "", "study_items": { "number": 0, "sha256": "" }, "items": [], "failures": [] }"#;
        fs::write(path("shard").join(release::SHARD), description).unwrap();
        let limits = Limits { workers: 1, memory_bytes: 1 << 20, beyond: true };
        let text =
            "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"a\"\nkind = \"mavs\"\n";
        fs::write(path("shard/study.toml"), text).unwrap();
        let study = Study::parse(text, Path::new(""), &registry::section_names()).unwrap();
        let builder = ReleaseBuilder::beside(&path("release"), head(&study, text)).unwrap();
        builder.seal(&path("release")).unwrap();
        let check = |output: &str, work: Option<&str>, part: Option<&str>| {
            let (output, work) = (path(output), work.map(path));
            let part = part.map(|text| Part::parse(text).unwrap());
            let request =
                RunRequest { output: &output, work: work.as_deref(), part, purpose: None, replace: false, limits };
            check_destination(&study, &request).err().map(|e| e.to_string()).unwrap_or_default()
        };
        for name in ["empty", "new", "release"] {
            assert_eq!(check(name, None, None), "", "{name}");
        }
        assert_eq!(check("shard", None, Some("1/2")), "");
        for other in ["2/2", "1/3"] {
            assert!(
                check("shard", None, Some(other)).contains("is shard 1 of 2; choose another folder with -o"),
                "{other}"
            );
        }
        fs::write(path("shard/study.toml"), text.replace("\"x\"", "\"y\"")).unwrap();
        assert!(check("shard", None, Some("1/2")).contains("is a shard of the study `y`; choose another folder"));
        fs::write(path("shard/study.toml"), "[study\n").unwrap();
        assert_eq!(check("shard", None, Some("1/2")), "", "damaged");
        fs::remove_file(path("shard/study.toml")).unwrap();
        assert_eq!(check("shard", None, Some("1/2")), "", "incomplete");
        fs::write(path("shard").join(release::SHARD), "{}").unwrap();
        assert!(check("shard", None, Some("1/2")).contains("is neither empty nor a sastrugi shard"));
        assert!(check("release", None, Some("1/2")).contains("is not empty and not a sastrugi shard"));
        assert!(check("shard", None, None).contains("is not empty and not a sastrugi release"));
        assert!(check("foreign", None, None).contains("is not empty"));
        assert!(check("file", None, None).contains("is a file; -o must be a folder"));
        assert_eq!(check("new", Some("new.work"), None), "");
        assert!(check("new", Some("empty/../new/work"), None).contains("the work area lies inside the output folder"));
    }

    /// A release over the given DEM may be replaced, whatever else changed; one over another DEM only on request.
    #[test]
    fn val_a_release_over_another_dem_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let dest = folder.path().join("release");
        let study = |name: &str, heights: &str| {
            fs::write(folder.path().join("site.asc"), heights).unwrap();
            let head = format!("[study]\nname = \"{name}\"\nseed = 1\ndate = \"2026-01-01\"\n");
            let text = format!("{head}[[dem]]\nid = \"dem\"\nfile = \"site.asc\"\n");
            load_text(&text, "study", folder.path()).unwrap()
        };
        let said = |loaded: &Loaded, replace| {
            check_other_dem(loaded, &dest, replace).err().map(|e| e.to_string()).unwrap_or_default()
        };
        let one = study("traverse", "heights");
        assert_eq!(said(&one, false), "");
        let mut builder = ReleaseBuilder::beside(&dest, head(&one.study, &one.released)).unwrap();
        let origin = Origin { stage: original::STAGE.to_owned(), item: "dem".to_owned(), ..Origin::default() };
        builder.write_text("dem/dem.asc", "heights", origin).unwrap();
        builder.seal(&dest).unwrap();
        assert_eq!(said(&one, false), "");
        let other = study("traverse", "other heights");
        let refused = said(&other, false);
        assert!(refused.contains("release is a release over another DEM; choose another folder with -o"), "{refused}");
        assert_eq!(said(&other, true), "");
        assert_eq!(said(&study("navigate", "other heights"), false), "", "the name is refused later");
    }

    /// Beside other errors a missing file is one refusal more, at the table that names it; alone it is missing input.
    #[test]
    fn val_a_missing_file_has_its_place() {
        let head = STUDY.split_once("[[terrain]]").unwrap().0;
        let text = format!("{head}[[dem]]\nid = \"d\"\nfile = \"none.tif\"\n");
        let alone = load_text(&text, "study", Path::new("")).err().unwrap();
        assert!(matches!(&alone, Error::Input(message) if message == "none.tif: no such file"), "{alone}");
        let text = format!("{text}[[terrain]]\nid = \"t\"\nkind = \"nothing\"\n");
        let Err(Error::Study { refusals: Refusals(errors), .. }) = load_text(&text, "study", Path::new("")) else {
            panic!("the study is not refused")
        };
        let messages: Vec<&str> = errors.iter().map(|error| error.message.as_str()).collect();
        assert!(errors.len() == 2 && messages[1].starts_with("terrain \"t\": "), "{messages:?}");
        assert_eq!(messages[0], "dem \"d\": none.tif: no such file");
        assert_eq!(errors[0].span.clone().map(|span| &text[span]), Some("[[dem]]"));
    }

    /// A table that misses an id like its own, itself, or another table that misses it, is refused and not passed over.
    #[test]
    fn val_references_to_nothing_are_refused() {
        let fit = |id: &str, dem: &str| format!("[[fit]]\nid = \"{id}\"\ndem = \"{dem}\"\n");
        let texture = |id: &str, onto: &str| {
            format!(
                "[[texture]]\nid = \"{id}\"\nfit = {{ model = \"exponential\", sigma_m = 0.03, range_m = 0.3 }}\n\
                 onto = \"{onto}\"\nsize_m = [3.2, 3.2]\ncell_m = 0.05\n"
            )
        };
        for (tables, missing) in [
            (fit("snow", "snow-site"), "`dem` names \"snow-site\""),
            (fit("snow", "snow"), "`dem` names \"snow\""),
            (texture("a", "b") + &texture("b", "a"), "`onto` names \"b\""),
        ] {
            let refused = load_text(&format!("{STUDY}\n{tables}"), "study", Path::new("")).err().unwrap().to_string();
            assert!(refused.contains(missing), "{refused}");
        }
        // Surfaces of one section refer to those above them.
        let head = STUDY.split_once("[[terrain]]").unwrap().0;
        let text = format!(
            "{head}[[terrain]]\nid = \"c\"\nkind = \"compose\"\nsize_px = [64, 64]\nprocesses = [{{ of = \"g\" }}]\n\
             [[terrain]]\nid = \"g\"\nkind = \"gap\"\nsize_px = [64, 64]\n"
        );
        let Err(Error::Study { refusals: Refusals(errors), .. }) = load_text(&text, "study", Path::new("")) else {
            panic!("the study is not refused")
        };
        assert_eq!(
            errors[0].help.as_deref(),
            Some("[[terrain]] \"g\" comes after this table; move it above"),
            "{errors:?}"
        );
        // What follows from another error is not told.
        let wrong = fit("snow", "site") + "[[dem]]\nid = \"site\"\npath = \"site.tif\"\n";
        let refused = load_text(&format!("{STUDY}\n{wrong}"), "study", Path::new("")).err().unwrap().to_string();
        assert!(refused.contains("unknown key `path`") && !refused.contains("names \"site\""), "{refused}");
        let wrong = "[[terrain]]\nid = \"hole\"\nkind = \"gap\"\nsize_m = -1\nsize_px = [64, 64]\n\
                     [[missions]]\nid = \"across\"\nterrains = [\"hole\"]\n";
        let refused = load_text(&format!("{STUDY}\n{wrong}"), "study", Path::new("")).err().unwrap().to_string();
        assert!(refused.contains("size_m") && !refused.contains("across"), "{refused}");
    }

    /// The id of a table with several surfaces is told apart from an unknown one, by every key that names one surface.
    #[test]
    fn val_a_table_with_replicates_is_not_one_surface() {
        let head = STUDY.split_once("[[terrain]]").unwrap().0;
        let hills = "[[terrain]]\nid = \"hills\"\nkind = \"multifractal\"\nsize_px = [64, 64]\ncount = 4\n\
                     [[terrain]]\nid = \"steep\"\nkind = \"multifractal\"\nsize_px = [64, 64]\nsweep.cell_m = [0.05, 0.1]\n";
        let texture = |more: &str| {
            format!(
                "[[texture]]\nid = \"t\"\nfit = {{ model = \"exponential\", sigma_m = 0.03, range_m = 0.3 }}\n{more}\n"
            )
        };
        let set_count = "or set `count = 4`: each replicate is then added to its own";
        for (table, named, first, help) in [
            (
                texture("onto = \"hills\"\ncount = 3"),
                "`onto` names \"hills\", which has 4 replicates",
                "hills-0001",
                Some(set_count),
            ),
            (
                texture("onto = \"hills\""),
                "`onto` names \"hills\", which has 4 replicates",
                "hills-0001",
                Some(set_count),
            ),
            (texture("fill = \"hills\""), "`fill` names \"hills\", which has 4 replicates", "hills-0001", None),
            (texture("onto = \"steep\""), "`onto` names \"steep\", which has 2 surfaces", "steep-0.05", None),
            (
                "[[fit]]\nid = \"f\"\ndem = \"hills\"\n".to_owned(),
                "`dem` names \"hills\", which has 4 replicates",
                "hills-0001",
                None,
            ),
        ] {
            let loaded = load_text(&format!("{head}{hills}{table}"), "study", Path::new(""));
            let Err(Error::Study { refusals: Refusals(errors), .. }) = loaded else { panic!("{table} is not refused") };
            let [error] = &errors[..] else { panic!("{errors:?}") };
            let said = format!("{named}; name one, such as \"{first}\"");
            assert!(error.message.ends_with(&said), "{} {said}", error.message);
            assert_eq!(error.help.as_deref(), help, "{table}");
        }
    }

    /// Cells and size of a texture that are not stated follow its base where the defaults do not suit it, and stay the defaults elsewhere. What
    /// does not cover its base is refused before the run; what repeats over it, or is cut to it, is a doubt.
    #[test]
    fn val_textures_follow_their_bases() {
        let head = STUDY.split_once("[[terrain]]").unwrap().0;
        let loaded = |cell_m: f64, more: &str| {
            let text = format!(
                "{head}[[terrain]]\nid = \"hills\"\nkind = \"multifractal\"\nsize_px = [300, 64]\ncell_m = {cell_m}\n[[texture]]\nid = \"t\"\n\
                 fit = {{ model = \"exponential\", sigma_m = 0.03, range_m = 0.3 }}\nonto = \"hills\"\n{more}\n"
            );
            load_text(&text, "study", Path::new(""))
        };
        for (cell_m, more, key, value) in [
            (0.05, "", "size_px", json!([300, 64])),
            (0.05, "", "cell_m", json!(0.05)),
            (0.05, "size_m = [15.0, 3.2]", "cell_m", json!(0.05)),
            (0.1, "", "size_m", json!([20.0, 20.0])),
            (0.1, "", "cell_m", json!(0.1)),
            (0.1, "periodic = false", "size_px", json!([300, 64])),
        ] {
            let loaded = loaded(cell_m, more).unwrap_or_else(|error| panic!("{cell_m} {more}: {error}"));
            assert_eq!(loaded.heightfields["t"].parameters[key], value, "{cell_m} {more}");
            assert!(loaded.doubts.is_empty(), "{:?}", loaded.doubts);
        }
        for (more, words) in [
            ("size_m = [5.0, 5.0]", "texture \"t\": 5 m x 5 m repeats over its base of 30 m x 6.4 m"),
            ("size_px = [300, 80]", "texture \"t\": 30 m x 8 m is cut to its base of 30 m x 6.4 m"),
        ] {
            let doubts = loaded(0.1, more).unwrap_or_else(|error| panic!("{more}: {error}")).doubts;
            assert!(doubts.len() == 1 && doubts[0].starts_with(words), "{doubts:?}");
        }
        for (more, words) in [
            ("size_m = [20.0, 20.0]\nperiodic = false", "`size_m` is too small: the base of 64 x 300 cells is larger"),
            ("cell_m = 0.2", "`cell_m` does not match `onto`"),
        ] {
            let refused = loaded(0.1, more).err().unwrap().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }

    /// What a release says of licences is told before the run, each once: of the study's that is not an SPDX identifier, of data without one, and of
    /// data whose licence may not permit the release, unless its text is supplied.
    #[test]
    fn val_doubts_about_licences_are_told_before_the_run() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("terms.txt"), "As you like.").unwrap();
        fs::write(folder.path().join("site.asc"), "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n")
            .unwrap();
        let doubts = |license: &str, of_dem: &str| {
            let head = format!("[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\nlicense = \"{license}\"\n");
            let text = format!("{head}[[dem]]\nid = \"site\"\nfile = \"site.asc\"\n{of_dem}\n");
            load_text(&text, "study", folder.path()).map_err(|e| e.to_string()).unwrap().doubts
        };
        let gpl = "license = \"GPL-3.0-only\"";
        let unknown =
            "dem \"site\": it is unknown whether data under \"GPL-3.0-only\" may be released under \"CC-BY-4.0\"";
        for (license, of_dem, words) in [
            ("CC BY 4", "license = \"CC-BY-4.0\"", "[study] license \"CC BY 4\" is not in the SPDX list"),
            ("CC-BY-4.0", "", "dem \"site\": no `license` is stated"),
            ("CC-BY-4.0", gpl, unknown),
        ] {
            let found = doubts(license, of_dem);
            assert!(found.len() == 1 && found[0].starts_with(words), "{found:?}");
        }
        assert_eq!(doubts("CC-BY-4.0", "license = \"CC-BY-4.0\""), [""; 0]);
        assert_eq!(doubts("CC-BY-4.0", &format!("{gpl}\nlicense_file = \"terms.txt\"")), [""; 0]);
    }

    /// A study with a square terrain of 40 m, `hills`, one of 150 m, `plain`, and more tables.
    fn on_hills(tables: &str) -> Result<Loaded, Error> {
        let head = STUDY.split_once("[[terrain]]").unwrap().0;
        let terrain = |id: &str, side: u32| {
            format!("[[terrain]]\nid = \"{id}\"\nkind = \"multifractal\"\nsize_px = [{side}, {side}]\ncell_m = 0.5\n")
        };
        load_text(&format!("{head}{}{}{tables}", terrain("hills", 80), terrain("plain", 300)), "study", Path::new(""))
    }

    /// The key and the message of the only refusal.
    fn only_refusal(loaded: Result<Loaded, Error>) -> (String, String) {
        match loaded {
            Err(Error::Study { refusals: Refusals(errors), .. }) if errors.len() == 1 => {
                (errors[0].key.last().cloned().unwrap_or_default(), errors[0].message.clone())
            }
            Err(other) => panic!("{other}"),
            Ok(_) => panic!("the study is not refused"),
        }
    }

    /// Routes for which no terrain has room are refused before the run, at the key that asks for too much; if some terrains have room, it is a doubt.
    #[test]
    fn val_routes_need_room_on_their_terrains() {
        let route = |terrains: &str, more: &str| {
            on_hills(&format!("[[route]]\nid = \"way\"\nterrains = [{terrains}]\n{more}\n"))
        };
        for (more, key, words) in [
            (
                "border_m = 25.0",
                "border_m",
                "leaves no cells of the terrain, which is 40.00 x 40.00 m; `border_m` may be at most 19.5 m",
            ),
            (
                "border_m = 2.0\ndistance_min_m = 60.0",
                "distance_min_m",
                "at most 50.20 m apart, but `distance_min_m` is 60.00 m",
            ),
            ("sweep.distance_min_m = [20.0, 60.0]", "distance_min_m", "but `distance_min_m` is 60.00 m"),
            ("plan_cell_m = 30.0", "plan_cell_m", "`plan_cell_m` of 30 m leaves fewer than two planning cells"),
            ("start = [1.0, 1.0]\ngoal = [41.0, 1.0]", "", "the goal (41, 1) lies outside the terrain"),
            (
                "vehicle = \"husky_a200\"\ncost = \"band_rms\"",
                "cost",
                "`cost` is \"band_rms\", but cells of 0.5 m are too coarse",
            ),
        ] {
            let (of, said) = only_refusal(route("\"hills\"", more));
            assert!(
                of == key && said.starts_with("route \"way\": on \"hills\": ") && said.contains(words),
                "{of}: {said}"
            );
        }
        let doubts =
            |terrains: &str, more: &str| route(terrains, more).unwrap_or_else(|error| panic!("{more}: {error}")).doubts;
        assert_eq!(doubts("\"hills\"", "border_m = 19.5\ndistance_min_m = 0.5"), [""; 0]);
        let some = doubts("\"hills\", \"plain\"", "sweep.border_m = [25.0, 30.0]");
        let words = "route \"way\" on \"hills\": cannot draw starts and goals: a border of ";
        assert!(some.len() == 2 && some.iter().all(|doubt| doubt.starts_with(words)), "{some:?}");
        let (_, said) = only_refusal(route("\"hills\", \"plain\"", "border_m = 80.0"));
        assert!(said.starts_with("route \"way\": on \"hills\" and on 1 more: "), "{said}");
    }

    /// Missions that are too long for all their terrains are refused before the run; if some terrains can hold them, it is a doubt. Routed missions
    /// need cells to plan on.
    #[test]
    fn val_missions_need_room_on_their_terrains() {
        let missions = |terrains: &str, more: &str| {
            on_hills(&format!("[[missions]]\nid = \"m\"\nterrains = [{terrains}]\n{more}\n"))
        };
        let words =
            "on \"hills\": cannot place missions of 45 m: the terrain is 40.00 x 40.00 m, including a border of 5 m";
        let (key, said) = only_refusal(missions("\"hills\"", "length_m = 45.0"));
        assert!(key == "length_m" && said.starts_with(&format!("missions \"m\": {words}")), "{key}: {said}");
        let doubts = |terrains: &str, more: &str| {
            missions(terrains, more).unwrap_or_else(|error| panic!("{more}: {error}")).doubts
        };
        let some = doubts("\"hills\", \"plain\"", "length_m = 45.0");
        assert!(some.len() == 1 && some[0].starts_with(&format!("missions \"m\" {words}")), "{some:?}");
        assert_eq!(doubts("\"hills\"", "length_m = 40.0"), [""; 0]);
        let planned = "[[missions]]\nid = \"planned\"\nkind = \"routed\"\nof = \"m\"\nroute = { plan_cell_m = 30.0 }";
        let (key, said) = only_refusal(missions("\"hills\"", planned));
        assert!(
            key == "plan_cell_m" && said.contains("`route.plan_cell_m` of 30 m leaves fewer than two"),
            "{key}: {said}"
        );
    }

    /// Missions along a trail that no process of the terrain lays are refused before the run.
    #[test]
    fn val_trails_must_be_laid() {
        let forest = "[[terrain]]\nid = \"forest\"\nkind = \"compose\"\nsize_px = [150, 150]\ncell_m = 0.2\nprocesses = [{ kind = \"multifractal\" }, \
                      { operation = \"trail\", trail = { follows = \"valleys\" } }]\n";
        let missions = |terrain: &str, more: &str| {
            let table = format!("[[missions]]\nid = \"m\"\nkind = \"trail\"\nterrains = [\"{terrain}\"]\n{more}\n");
            on_hills(&format!("{forest}{table}"))
        };
        let (_, said) = only_refusal(missions("hills", ""));
        assert_eq!(
            said,
            "missions \"m\": on \"hills\": there is no trail; name a terrain of kind `compose` with a trail"
        );
        for name in ["trail-2", "trail-1", "trail-01", "trail-+2", "path"] {
            let (key, said) = only_refusal(missions("forest", &format!("trail = \"{name}\"")));
            let words = format!("missions \"m\": on \"forest\": there is no \"{name}\", only 1 trail");
            assert_eq!((key.as_str(), said), ("trail", words));
        }
        assert!(missions("forest", "backwards = true").is_ok());
    }

    /// A stated speed that the vehicle does not reach is told with its limit, once for each value of a sweep; the default is not.
    #[test]
    fn val_speeds_out_of_reach_are_told_before_the_run() {
        let doubts = |more: &str| {
            let loaded = load_text(&format!("{STUDY}{more}\n"), "study", Path::new(""));
            loaded.unwrap_or_else(|error| panic!("{more}: {error}")).doubts
        };
        let told = |speed: &str, limit: &str| {
            format!(
                "traverse \"h\": speed_m_s is {speed} m/s, but the vehicle reaches at most {limit} m/s (drive.speed_limit_m_s), so the \
                 results are those of {limit} m/s"
            )
        };
        let rover = "vehicle = \"rocker_bogie_rover\"";
        assert_eq!(doubts("speed_m_s = 3.0"), [told("3", "1")]);
        assert_eq!(doubts("sweep.speed_m_s = [0.5, 1.0, 3.0, 4.0]"), [told("3", "1"), told("4", "1")]);
        assert_eq!(doubts(&format!("{rover}\nspeed_m_s = 0.6")), [told("0.6", "0.5")]);
        for more in ["speed_m_s = 1.0", "vehicle_changes.drive.speed_limit_m_s = 3.0\nspeed_m_s = 3.0", rover] {
            assert_eq!(doubts(more), [""; 0], "{more}");
        }
    }

    /// A formation larger than its terrain is a doubt, as the team runs all the same: a column of four is three times its spacing long, a line of four as
    /// wide (the same doubt, told once), and the last two of a wedge of four are 2 and 1 spacings behind it and 3 apart sideways. The terrain's diagonal is 56.6 m.
    #[test]
    fn val_formations_larger_than_their_terrain_are_told() {
        let doubts = |more: &str| {
            let route = "[[route]]\nid = \"way\"\nterrains = [\"hills\"]\n";
            let loaded = on_hills(&format!("{route}[[navigate]]\nid = \"team\"\nroute = \"way\"\n{more}\n"));
            loaded.unwrap_or_else(|error| panic!("{more}: {error}")).doubts
        };
        for (more, sizes_m) in [
            ("spacing_m = 60.0", &["180.0"][..]),
            ("spacing_m = 20.0\nsweep.formation = [\"column\", \"line\", \"wedge\"]", &["60.0", "63.2"]),
            (
                "formation = \"custom\"\nslots = [{ id = 1 }, { id = 2, predecessor = 1, depth_m = 50.0, width_m = 30.0 }]",
                &["58.3"],
            ),
            ("spacing_m = 18.0", &[]),
        ] {
            let found = doubts(more);
            assert_eq!(found.len(), sizes_m.len(), "{found:?}");
            for (doubt, size_m) in found.iter().zip(sizes_m) {
                let words = format!(
                    "navigate \"team\" on \"hills\": two members of the formation are {size_m} m apart, but the diagonal of"
                );
                assert!(doubt.starts_with(&words), "{doubt}");
            }
        }
    }

    /// Rovers whose starts and goals have no ground are refused before the run: all places on a circle must lie on it, and drawn ones within its reach.
    /// The ground is 0.25 to 39.75 m along x and y.
    #[test]
    fn val_rovers_need_ground_at_starts_and_goals() {
        let rover = |more: &str| {
            on_hills(&format!(
                "[[rover]]\nid = \"r\"\nkind = \"sojourner_like\"\nterrains = [\"hills\"]\nrovers = 4\n{more}\n"
            ))
        };
        let drawn = "starts = \"drawn\"\nradius_m = 10.0\n";
        for (more, key, words) in [
            (
                "radius_m = 5.0".to_owned(),
                "centre_m",
                "a goal lies off the terrain: there is no ground at x = 0.000, y = 0.000 m",
            ),
            (
                "centre_m = [20.0, 20.0]\nradius_m = 20.0".to_owned(),
                "radius_m",
                "a start lies off the terrain: there is no ground at x = 40.000",
            ),
            (
                format!("{drawn}centre_m = [50.0, 20.0]"),
                "centre_m",
                "the disk in which starts are drawn lies off the terrain (it extends from x = 0",
            ),
            (
                format!("{drawn}centre_m = [20.0, 20.0]\ndistance_m = 56.0"),
                "distance_m",
                "`distance_m` is 56 m; from start to goal there are at most 55.86 m",
            ),
        ] {
            let (of, said) = only_refusal(rover(&more));
            assert!(
                of == key && said.starts_with("rover \"r\": on \"hills\": ") && said.contains(words),
                "{of}: {said}"
            );
        }
        for more in [
            "centre_m = [20.0, 20.0]\nradius_m = 19.75".to_owned(),
            format!("{drawn}centre_m = [49.0, 20.0]\ndistance_m = 30.0"),
        ] {
            let loaded = rover(&more).unwrap_or_else(|error| panic!("{more}: {error}"));
            assert_eq!(loaded.doubts, [""; 0], "{more}");
        }
    }

    /// Numbers, of which most parameters accept some.
    const NUMBERS: &[&str] =
        &["-1", "0", "1", "2", "3", "64", "300", "0.0", "0.05", "0.5", "2.5", "-2.5", "1e300", "1e-300"];
    const FLAGS: &[&str] = &["true", "false"];
    const WORDS: &[&str] =
        &["\"t\"", "\"f\"", "\"m\"", "\"straight\"", "\"exponential\"", "\"\"", "\"A b\"", "\"€\"", "\"10 %\""];
    /// Values that no parameter accepts, nor any other after them is looked at.
    const NEVER: &[&str] = &["nan", "-inf", "2026-01-01", "07:32:00", "1979-05-27T07:32:00Z"];

    /// A key and its value.
    type Pair = (String, String);

    /// A key, and values for it.
    type Line = (&'static str, &'static [&'static str]);

    /// Tables without an error, by section: keys and values.
    const RIGHT: &[(&str, &[Line])] = &[
        ("study", &[("name", &["\"x\""]), ("seed", &["1"]), ("date", &["\"2026-01-01\""])]),
        ("dem", &[("id", &["\"s\""]), ("file", &["\"none.tif\""])]),
        (
            "terrain",
            &[
                ("id", &["\"t\"", "\"u\"", "\"v\""]),
                ("kind", &["\"gap\"", "\"multifractal\"", "\"weierstrass_mandelbrot\"", "\"spheroids\""]),
                ("size_px", &["[64, 64]"]),
            ],
        ),
        ("fit", &[("id", &["\"f\"", "\"g\""]), ("dem", &["\"t\""])]),
        (
            "texture",
            &[
                ("id", &["\"x\"", "\"y\""]),
                ("fit", &["{ model = \"exponential\", sigma_m = 0.03, range_m = 0.28 }", "\"f\""]),
                ("size_m", &["[4.0, 4.0]"]),
                ("cell_m", &["0.1"]),
            ],
        ),
        ("image", &[("id", &["\"i\"", "\"j\""]), ("surface", &["\"t\""])]),
        ("photoclinometry", &[("id", &["\"p\""]), ("images", &["[\"i\"]"])]),
        (
            "missions",
            &[("id", &["\"m\"", "\"n\""]), ("terrains", &["[\"t\"]"]), ("length_m", &["2.0"]), ("border_m", &["0.5"])],
        ),
        ("traverse", &[("id", &["\"d\"", "\"e\""]), ("missions", &["\"m\""])]),
        ("route", &[("id", &["\"r\""]), ("terrains", &["[\"t\"]"])]),
        ("navigate", &[("id", &["\"o\""]), ("route", &["\"r\""])]),
        (
            "rover",
            &[
                ("id", &["\"q\""]),
                ("kind", &["\"sojourner_like\""]),
                ("terrains", &["[\"t\"]"]),
                ("centre_m", &["[1.6, 1.6]"]),
                ("radius_m", &["1.0"]),
            ],
        ),
        (
            "hypothesis",
            &[
                ("id", &["\"h\""]),
                ("statistic", &["\"success\""]),
                ("groups", &["[\"a\", \"b\"]"]),
                ("test", &["\"difference\""]),
            ],
        ),
    ];

    fn scalar() -> BoxedStrategy<String> {
        prop_oneof![24 => select(NUMBERS), 6 => select(FLAGS), 24 => select(WORDS), 1 => select(NEVER)]
            .prop_map(str::to_owned)
            .boxed()
    }

    /// A value of any type that TOML has, as text.
    fn value(keys: &[String]) -> BoxedStrategy<String> {
        let list = vec(scalar(), 0..4).prop_map(|all| format!("[{}]", all.join(", "))).boxed();
        let table = btree_map(select(keys.to_vec()), prop_oneof![scalar(), list.clone()], 0..3).prop_map(|all| {
            let pairs: Vec<String> = all.iter().map(|(key, value)| format!("{key} = {value}")).collect();
            format!("{{ {} }}", pairs.join(", "))
        });
        prop_oneof![6 => scalar(), 3 => list, 1 => table].boxed()
    }

    /// The lines of a table: right ones, of which some are missing or have another value, and up to two with any of the keys.
    fn table(section: &str, keys: &[String]) -> BoxedStrategy<String> {
        let right = RIGHT.iter().find(|(name, _)| *name == section).map_or(&[] as &[_], |entry| entry.1);
        let line = |&(key, values): &(&'static str, &'static [&'static str])| {
            prop_oneof![
                18 => select(values).prop_map(move |value| Some((key.to_owned(), value.to_owned()))),
                1 => value(keys).prop_map(move |value| Some((key.to_owned(), value))),
                1 => Just(None::<Pair>),
            ]
            .boxed()
        };
        let right: Vec<BoxedStrategy<Option<Pair>>> = right.iter().map(line).collect();
        let more = vec((select(keys.to_vec()), value(keys)), 0..3);
        let text = |(right, more): (Vec<Option<Pair>>, Vec<Pair>)| {
            let lines: BTreeMap<String, String> = more.into_iter().chain(right.into_iter().flatten()).collect();
            lines.iter().map(|(key, value)| format!("{key} = {value}\n")).collect::<String>()
        };
        (right, more).prop_map(text).boxed()
    }

    /// One or two tables of a section, seldom in the wrong form.
    fn section(name: &str, keys: &[String], form: Form) -> BoxedStrategy<String> {
        let name = name.to_owned();
        (vec(table(&name, keys), 1..3), prop::bool::weighted(0.97))
            .prop_map(move |(tables, is_right)| match (form == Form::Array) == is_right {
                true => tables.iter().map(|lines| format!("[[{name}]]\n{lines}")).collect::<String>(),
                false => format!("[{name}]\n{}", tables[0]),
            })
            .boxed()
    }

    /// Studies in valid TOML with some of the sections; most have errors, seldom one that hides the others.
    fn studies() -> impl Strategy<Value = String> {
        let of = |section_of: &registry::Section| {
            let mut keys = properties(&(section_of.envelope)());
            keys.extend((section_of.kinds)().iter().flat_map(|kind| properties(&kind.parameters)));
            keys.push("colour".to_owned());
            weighted(0.4, section(section_of.name, &keys, section_of.form))
        };
        let head = properties(&schema_of::<StudyHead>());
        let mut sections = vec![weighted(0.97, section("study", &head, Form::Table))];
        sections.extend(registry::SECTIONS.iter().map(of));
        sections.push(weighted(0.05, section("terain", &["id".to_owned()], Form::Array)));
        sections.prop_map(|sections| format!("# A study.\n{}", sections.into_iter().flatten().collect::<String>()))
    }

    /// What a refusal of one of these studies fails to say, if anything: its line, or the section, item or key that is wrong, which must be that of
    /// the line.
    fn unsaid(text: &str, error: &StudyError) -> Option<&'static str> {
        let message = error.message.as_str();
        let Some(span) = error.span.clone() else {
            return (!message.starts_with("missing section [study]")).then_some("its line");
        };
        let place = text.get(span.clone()).unwrap_or_default();
        if place.is_empty() {
            return Some("a place in the text");
        }
        if message.starts_with("the number is not finite") || message.starts_with("dates must be written as text") {
            return (!NEVER.contains(&place)).then_some("the value");
        }
        // Only headings start a line with a bracket.
        let Some(start) = text[..span.end].rfind("\n[") else { return Some("its table") };
        let table = &text[start + 1..];
        let table = table.find("\n[").map_or(table, |end| &table[..end]);
        let section = table.lines().next().unwrap_or_default().trim_matches(['[', ']']);
        let is_of_item = || {
            let id = message.strip_prefix(&format!("{section} \""))?.split_once("\": ")?.0;
            table.lines().any(|line| line == format!("id = \"{id}\"")).then_some(())
        };
        let says = message.starts_with(&format!("[{section}] "))
            || message.starts_with(&format!("{section} number "))
            || (message.starts_with("unknown key `") && message.ends_with(&format!("` in {section}")))
            || message.contains(&format!("`{section}`"))
            || (section == "study" && message.contains("`split`"))
            || is_of_item().is_some();
        (!says).then_some("the section or key of its line")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]

        /// Whatever its tables hold, a study is loaded, or every refusal names what is wrong and where.
        #[test]
        fn prop_refusals_name_a_section_or_key_and_its_line(text in studies()) {
            match load_text(&text, "study", Path::new("")) {
                Ok(loaded) => {
                    // No table is passed over.
                    let ids = text.lines().filter_map(|line| line.strip_prefix("id = \"")?.strip_suffix('"'));
                    for id in ids {
                        let of_table = |claimed: &String| claimed == id || claimed.starts_with(&format!("{id}-"));
                        prop_assert!(loaded.origins.keys().any(of_table), "\"{id}\" is not in the plan\n{text}");
                    }
                }
                Err(Error::Study { refusals: Refusals(errors), .. }) => {
                    prop_assert!(!errors.is_empty());
                    for error in &errors {
                        prop_assert!(!error.message.starts_with("not valid TOML"), "{}\n{text}", error.message);
                        let unsaid = unsaid(&text, error);
                        prop_assert!(unsaid.is_none(), "{error:?} does not say {unsaid:?}\n{text}");
                    }
                }
                // Nothing but files is missing.
                Err(Error::Input(message)) => prop_assert!(message.contains("no such file"), "{message}\n{text}"),
                Err(Error::Usage(message)) => prop_assert!(message.contains("the study has no items"), "{message}\n{text}"),
                Err(other) => prop_assert!(false, "{other}\n{text}"),
            }
        }
    }

    proptest! {
        /// A study with a few characters changed is loaded or refused, never a panic, and refusals lie within it.
        #[test]
        fn prop_a_damaged_study_is_read_or_refused(at in 0usize..STUDY.len(), cut in 0usize..6, put in "[\\[\\]{}=\"'.,#0-9a-z\\-\n]{0,4}") {
            let end = (at + cut).min(STUDY.len());
            let text = format!("{}{put}{}", &STUDY[..at], &STUDY[end..]);
            if let Err(Error::Study { refusals: Refusals(errors), .. }) = load_text(&text, "study", Path::new("")) {
                prop_assert!(!errors.is_empty());
                let places = || errors.iter().filter_map(|error| error.span.as_ref());
                prop_assert!(places().all(|span| span.start <= span.end && span.start <= text.len()), "{errors:?}\n{text}");
            }
        }
    }
}
