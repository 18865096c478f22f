//! What a release says of itself, held against its bytes and against what its study gives here and now.

use crate::error::Error;
use crate::jobs::{ItemRef, Rows, traverse};
use crate::runner::assemble::release_error;
use crate::runner::cache::{Cache, Record};
use crate::runner::execute::{Limits, execute};
use crate::runner::progress::Progress;
use crate::splits;
use crate::studies::{Loaded, RunRequest, load, run};
use sastrugi_schemas::Record as Row;
use sastrugi_schemas::tables::SampleRow;
use sastrugi_store::release::{self, Problem, ProblemKind, Release, VerifyReport};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Which items to compute again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recompute {
    /// Every one, and the tables and the report.
    All,
    /// This many, chosen by their keys.
    Some(usize),
}

/// One difference that verification found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// File in the release.
    pub path: String,
    /// What is wrong.
    pub problem: String,
}

/// What verification found.
#[derive(Debug, Serialize)]
pub struct Verification {
    /// Files checked.
    pub files: u64,
    /// Bytes checked.
    pub bytes: u64,
    /// Items computed again.
    pub recomputed: Vec<String>,
    /// Differences; none in a good release.
    pub differences: Vec<Difference>,
    /// Why bytes cannot be compared, where they cannot.
    pub not_comparable: Option<String>,
}

/// Checks a release; with `recompute`, also against what its own study gives here and now.
///
/// # Errors
/// A folder that is no release, or work that cannot be done.
pub fn verify(
    folder: &Path,
    recompute: Option<Recompute>,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Verification, Error> {
    progress.phase("checking files");
    let report = release::verify(folder).map_err(release_error)?;
    let mut verification = Verification {
        files: report.files,
        bytes: report.bytes,
        recomputed: Vec::new(),
        differences: differences(&report),
        not_comparable: None,
    };
    let Some(recompute) = recompute.filter(|_| verification.differences.is_empty()) else { return Ok(verification) };
    let release = Release::open(folder).map_err(release_error)?;
    let ours = env!("CARGO_PKG_VERSION");
    if release.manifest().version != ours {
        let theirs = &release.manifest().version;
        verification.not_comparable =
            Some(format!("made by version {theirs}, this is {ours}: not comparable byte by byte"));
        return Ok(verification);
    }
    let loaded = load(&folder.join("study.toml"))?;
    let holder = Scratch::new()?;
    let scratch = holder.0.clone();
    match recompute {
        Recompute::All => recompute_all(&release, &loaded, &scratch, limits, progress, &mut verification)?,
        Recompute::Some(count) => {
            recompute_some(&release, &loaded, &scratch, count, limits, progress, &mut verification)?
        }
    }
    Ok(verification)
}

/// What is wrong with a release's files.
pub fn differences(report: &VerifyReport) -> Vec<Difference> {
    let difference = |p: &Problem| Difference { path: p.path.clone(), problem: problem_text(p.kind, &p.message) };
    report.problems.iter().map(difference).collect()
}

fn problem_text(kind: ProblemKind, message: &str) -> String {
    let kind = format!("{kind:?}").to_lowercase();
    if message.is_empty() { kind } else { format!("{kind}: {message}") }
}

/// A folder of this process alone, gone with its holder.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Self, Error> {
        let path = std::env::temp_dir().join(format!("sastrugi-verify-{}", std::process::id()));
        // Left by a killed process that had the same number.
        let _ = fs::remove_dir_all(&path);
        fs::create_dir(&path).map_err(|e| Error::failed(format!("{}: {e}", path.display())))?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed lies in the folder for temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn recompute_all(
    release: &Release,
    loaded: &Loaded,
    scratch: &Path,
    limits: Limits,
    progress: &dyn Progress,
    verification: &mut Verification,
) -> Result<(), Error> {
    let output = scratch.join("release");
    let work = scratch.join("work");
    run(loaded, &RunRequest { output: &output, work: Some(&work), part: None, purpose: None, limits }, progress)?;
    let again = Release::open(&output).map_err(release_error)?;
    verification.recomputed = loaded.graph.nodes().iter().map(|n| n.item.to_string()).collect();
    let sums = |r: &Release| -> BTreeMap<String, String> {
        r.manifest().artifacts.iter().map(|a| (a.path.clone(), a.sha256.clone())).collect()
    };
    verification.differences.extend(compare_sums(&sums(release), &sums(&again)));
    Ok(())
}

fn compare_sums(there: &BTreeMap<String, String>, here: &BTreeMap<String, String>) -> Vec<Difference> {
    let paths: BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    let problem = |path: &&String| match (there.get(*path), here.get(*path)) {
        (Some(a), Some(b)) if a == b => None,
        (Some(_), Some(_)) => Some("computed again, its bytes differ"),
        (Some(_), None) => Some("computed again, it does not appear"),
        _ => Some("computed again, it appears, and is not in the release"),
    };
    paths.iter().filter_map(|p| Some(Difference { path: (*p).clone(), problem: problem(p)?.to_owned() })).collect()
}

fn recompute_some(
    release: &Release,
    loaded: &Loaded,
    scratch: &Path,
    count: usize,
    limits: Limits,
    progress: &dyn Progress,
    verification: &mut Verification,
) -> Result<(), Error> {
    let graph = &loaded.graph;
    let mut by_key: Vec<usize> = (0..graph.len()).collect();
    by_key.sort_by_key(|&p| graph.key(p).to_owned());
    let chosen: Vec<usize> = by_key.into_iter().take(count).collect();
    let cache = Cache::open(scratch)?;
    let execution = execute(graph, &cache, &graph.closure(chosen.iter().copied()), limits, progress);
    let failed_there: Vec<ItemRef> =
        release.manifest().failed.iter().map(|f| ItemRef::new(&f.stage, &f.item)).collect();
    let unexpected = execution.failures.iter().filter(|f| !failed_there.contains(&f.item));
    verification.differences.extend(
        unexpected.map(|f| Difference {
            path: f.item.to_string(),
            problem: format!("cannot be computed again: {}", f.message),
        }),
    );
    let there: BTreeMap<&str, &str> =
        release.manifest().artifacts.iter().map(|a| (a.path.as_str(), a.sha256.as_str())).collect();
    for position in chosen {
        let item = &graph.node(position).item;
        let Some(mut record) = cache.load(item, graph.key(position)) else { continue };
        splits::fill(&mut record.rows, &loaded.splits);
        verification.recomputed.push(item.to_string());
        verification.differences.extend(compare_files(&there, &record));
        let samples = cache.result_folder(item, &record.key).join(traverse::SAMPLES);
        verification.differences.extend(compare_tables(release, record.rows, &samples)?);
    }
    Ok(())
}

fn compare_files(there: &BTreeMap<&str, &str>, record: &Record) -> Vec<Difference> {
    let released = record.files.iter().filter_map(|f| Some((f.product.release_path.clone()?, f.sha256.as_str())));
    let differing = released.filter(|(path, sha256)| there.get(path.as_str()) != Some(sha256));
    differing.map(|(path, _)| Difference { path, problem: "computed again, its bytes differ".to_owned() }).collect()
}

/// Compares an item's rows with the tables; `samples` is the file of its samples, where it has one.
fn compare_tables(release: &Release, rows: Rows, samples: &Path) -> Result<Vec<Difference>, Error> {
    let samples: Vec<SampleRow> = match samples.is_file() {
        true => sastrugi_store::parquet::read_table(samples).map_err(Error::failed)?,
        false => Vec::new(),
    };
    let differences = [
        compare_rows(release, &rows.terrains)?,
        compare_rows(release, &rows.fits)?,
        compare_rows(release, &rows.covariance)?,
        compare_rows(release, &rows.candidates)?,
        compare_rows(release, &rows.candidate_curves)?,
        compare_rows(release, &rows.likelihood_profile)?,
        compare_rows(release, &rows.surfaces)?,
        compare_rows(release, &rows.structure)?,
        compare_rows(release, &rows.profile_psd)?,
        compare_rows(release, &rows.psd)?,
        compare_rows(release, &rows.height_distribution)?,
        compare_rows(release, &rows.scoreboard)?,
        compare_rows(release, &rows.scoreboard_covariance)?,
        compare_rows(release, &rows.missions)?,
        compare_rows(release, &samples)?,
    ];
    Ok(differences.into_iter().flatten().collect())
}

/// A difference when the release's table does not hold exactly these rows.
fn compare_rows<R: Row>(release: &Release, rows: &[R]) -> Result<Option<Difference>, Error> {
    let text = |row: &R| format!("{:?}", row.cells());
    let mut missing: BTreeSet<String> = rows.iter().map(text).collect();
    if missing.is_empty() {
        return Ok(None);
    }
    let found = |row: R| {
        missing.remove(&text(&row));
    };
    release.for_each_row(found).map_err(release_error)?;
    let problem = format!("computed again, {} of {} rows differ", missing.len(), rows.len());
    Ok((!missing.is_empty()).then(|| Difference { path: format!("tables/{}", R::TABLE.name), problem }))
}
