//! Verification of a release against its manifest and, on request, against a recomputation of its study.

use crate::documents::sources::Sources;
use crate::error::Error;
use crate::job::ItemRef;
use crate::loaded::{Loaded, load};
use crate::runner::assemble::{artifacts, head, notes_of};
use crate::runner::cache::{Cache, Record};
use crate::runner::execute::{Limits, execute};
use crate::runner::progress::Progress;
use crate::runner::tables::table_of;
use crate::splits::{self, Splits};
use crate::studies::{RunRequest, resolved, run};
use sastrugi_schemas::manifest::{Artifact, ItemNote, Manifest};
use sastrugi_schemas::{Table, counted};
use sastrugi_store::parquet::TableReader;
use sastrugi_store::release::{self, Head, MANIFEST, Problem, ProblemKind, Release, ReleaseError, STUDY, VerifyReport};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Key of a manifest's list of files.
const ARTIFACTS: &str = "artifacts";

/// Which items to recompute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recompute {
    /// All items, the tables and the report.
    All,
    /// This number of items, chosen by their keys.
    Some(usize),
}

/// One difference that verification found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// File in the release.
    pub path: String,
    /// The problem.
    pub problem: String,
}

/// Result of a verification.
#[derive(Debug, Serialize)]
pub struct Verification {
    /// Files checked.
    pub files: u64,
    /// Bytes checked.
    pub bytes: u64,
    /// Items recomputed.
    pub recomputed: Vec<String>,
    /// Differences; empty for a good release.
    pub differences: Vec<Difference>,
    /// Why bytes cannot be compared, if so.
    pub not_comparable: Option<String>,
}

/// Checks a release; with `recompute`, also against a recomputation of its study.
///
/// # Errors
/// A folder that is not a release; to be recomputed, one whose study names files outside it; failures of the machine.
pub fn verify(
    folder: &Path,
    recompute: Option<Recompute>,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Verification, Error> {
    let report = checked(folder, progress)?;
    let mut verification = Verification {
        files: report.files,
        bytes: report.bytes,
        recomputed: Vec::new(),
        differences: differences(&report),
        not_comparable: None,
    };
    let Some(recompute) = recompute.filter(|_| verification.differences.is_empty()) else { return Ok(verification) };
    let release = Release::open(folder)?;
    let ours = env!("CARGO_PKG_VERSION");
    if release.manifest().version != ours {
        let theirs = &release.manifest().version;
        verification.not_comparable =
            Some(format!("made by version {theirs}, this is {ours}; bytes cannot be compared"));
        return Ok(verification);
    }
    let loaded = load(&folder.join(STUDY))?;
    check_inputs(folder, &loaded)?;
    let holder = Scratch::new("verify")?;
    let scratch = holder.path().to_owned();
    match recompute {
        Recompute::All => recompute_all(&release, &loaded, &scratch, limits, progress, &mut verification)?,
        Recompute::Some(count) => {
            recompute_some(&release, &loaded, &scratch, count, limits, progress, &mut verification)?
        }
    }
    Ok(verification)
}

/// Checks the files of a release. A folder that is not one is refused before any progress is shown.
///
/// # Errors
/// Such a folder; failures of the machine.
pub(crate) fn checked(folder: &Path, progress: &dyn Progress) -> Result<VerifyReport, Error> {
    release::check_lists(folder)?;
    progress.phase("checking files");
    Ok(release::verify(folder)?)
}

/// Refuses to recompute a release whose study names files outside it: they are not part of what was released and checked.
fn check_inputs(folder: &Path, loaded: &Loaded) -> Result<(), Error> {
    let release = resolved(folder);
    let mut inputs = loaded.graph.nodes().iter().flat_map(|node| &node.inputs);
    match inputs.find(|input| !resolved(&input.path).starts_with(&release)) {
        None => Ok(()),
        Some(input) => Err(Error::Input(format!(
            "{} names {}, which is outside the release; a release is recomputed from its own files only",
            folder.join(STUDY).display(),
            input.path.display()
        ))),
    }
}

/// Problems with a release's files.
pub fn differences(report: &VerifyReport) -> Vec<Difference> {
    let difference = |p: &Problem| Difference { path: p.path.clone(), problem: problem_text(p.kind, &p.message) };
    report.problems.iter().map(difference).collect()
}

fn problem_text(kind: ProblemKind, message: &str) -> String {
    let kind = format!("{kind:?}").to_lowercase();
    if message.is_empty() { kind } else { format!("{kind}: {message}") }
}

/// A private temporary folder, removed on drop.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    /// A new folder, named by its purpose.
    pub(crate) fn new(purpose: &str) -> Result<Self, Error> {
        let path = std::env::temp_dir().join(format!("sastrugi-{purpose}-{}", std::process::id()));
        // Left by a killed process with the same id.
        let _ = fs::remove_dir_all(&path);
        fs::create_dir(&path).map_err(|e| Error::at(&path, e))?;
        Ok(Self(path))
    }

    /// Its path.
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // If it cannot be removed, it stays in the folder for temporary files.
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
    run(
        loaded,
        &RunRequest { output: &output, work: Some(&work), part: None, purpose: None, replace: false, limits },
        progress,
    )?;
    let (there, here) = (manifest_in(release.folder())?, manifest_in(&output)?);
    let failed = |item: &ItemRef| {
        let mut list = here["failed"].as_array().into_iter().flatten();
        list.any(|f| f["stage"] == item.stage.as_str() && f["item"] == item.id.as_str())
    };
    let items = loaded.graph.nodes().iter().map(|node| &node.item);
    verification.recomputed = items.filter(|item| !failed(item)).map(ToString::to_string).collect();
    verification.differences.extend(compare_manifests(&there, &here));
    Ok(())
}

/// The manifest in a folder as JSON, including keys unknown to this program.
fn manifest_in(folder: &Path) -> Result<Value, Error> {
    let path = folder.join(MANIFEST);
    let text = sastrugi_store::file::read(&path).map_err(|e| Error::at(&path, e))?;
    serde_json::from_slice(&text).map_err(|e| Error::Input(format!("{}: {e}", path.display())))
}

/// All files and keys of a manifest that differ from the recomputed manifest.
fn compare_manifests(there: &Value, here: &Value) -> Vec<Difference> {
    let (files_there, files_here) = (files_of(there), files_of(here));
    let paths: BTreeSet<&str> = files_there.keys().chain(files_here.keys()).copied().collect();
    let of_files = paths.into_iter().flat_map(|p| compare_files(p, files_there.get(p), files_here.get(p)));
    let of_head = differing_keys(there, here).into_iter().filter(|key| key != ARTIFACTS);
    let mut differences: Vec<Difference> = of_files.chain(of_head.map(|key| stated(MANIFEST, &key))).collect();
    if differences.is_empty() && there != here {
        differences.push(stated(MANIFEST, ARTIFACTS));
    }
    differences
}

/// The files in a manifest, by path.
fn files_of(manifest: &Value) -> BTreeMap<&str, &Value> {
    let artifacts = manifest[ARTIFACTS].as_array().into_iter().flatten();
    artifacts.filter_map(|artifact| Some((artifact["path"].as_str()?, artifact))).collect()
}

fn compare_files(path: &str, there: Option<&&Value>, here: Option<&&Value>) -> Vec<Difference> {
    let difference = |problem: &str| vec![Difference { path: path.to_owned(), problem: problem.to_owned() }];
    match (there, here) {
        (Some(a), Some(b)) if a["sha256"] != b["sha256"] => difference("its bytes differ when recomputed"),
        (Some(a), Some(b)) => differing_keys(a, b).iter().map(|key| stated(path, key)).collect(),
        (Some(_), None) => difference("missing when recomputed"),
        _ => difference("appears when recomputed but is not in the release"),
    }
}

/// A difference in a key of the manifest.
fn stated(path: &str, key: &str) -> Difference {
    let problem = format!("when recomputed, `{key}` differs from {MANIFEST}");
    Difference { path: path.to_owned(), problem }
}

fn differing_keys(there: &Value, here: &Value) -> BTreeSet<String> {
    let keys = [there, here].into_iter().filter_map(Value::as_object).flat_map(|object| object.keys());
    keys.filter(|key| there.get(key.as_str()) != here.get(key.as_str())).cloned().collect()
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
    let execution = execute(graph, &cache, &graph.closure(chosen.iter().copied()), limits, progress)?;
    let failed_there: Vec<ItemRef> =
        release.manifest().failed.iter().map(|f| ItemRef::new(&f.stage, &f.item)).collect();
    let unexpected = execution.failures.iter().filter(|f| !failed_there.contains(&f.item));
    verification.differences.extend(
        unexpected
            .map(|f| Difference { path: f.item.to_string(), problem: format!("cannot be recomputed: {}", f.message) }),
    );
    let Loaded { study, released, splits, .. } = loaded;
    let mut again = Again { sources: Sources::of(study)?, ..Again::default() };
    for (position, node) in graph.nodes().iter().enumerate() {
        let Some(record) = cache.load(&node.item, graph.key(position)) else { continue };
        again.sources.trace(&record);
        if chosen.contains(&position) {
            again.add(&record);
            verification.recomputed.push(node.item.to_string());
            let folder = cache.result_folder(&node.item, &record.key);
            verification.differences.extend(compare_fragments(release, &record, &folder, splits)?);
        }
    }
    verification.differences.extend(again.compare(release.manifest(), head(study, released))?);
    Ok(())
}

/// The manifest's entries for recomputed items.
#[derive(Default)]
struct Again {
    sources: Sources,
    items: BTreeSet<ItemRef>,
    artifacts: Vec<Artifact>,
    notes: Vec<ItemNote>,
}

impl Again {
    fn add(&mut self, record: &Record) {
        self.items.insert(record.item.clone());
        self.artifacts.extend(artifacts(record, &self.sources));
        self.notes.extend(notes_of(record));
    }

    /// Compares the release's manifest with a copy in which the entries of these items are replaced.
    fn compare(self, there: &Manifest, head: Head) -> Result<Vec<Difference>, Error> {
        let Self { sources, items, artifacts, mut notes } = self;
        let others = |stage: &str, item: &str| !items.contains(&ItemRef::new(stage, item));
        notes.extend(sources.notes.into_iter().filter(|n| !others(&n.stage, &n.item)));
        let Head { name, study_sha256, seed, version, license } = head;
        let mut here = Manifest { name, study_sha256, seed, version, license, sources: sources.list, ..there.clone() };
        here.artifacts.retain(|a| others(&a.origin.stage, &a.origin.item));
        here.artifacts.extend(artifacts);
        here.notes.retain(|n| others(&n.stage, &n.item));
        here.notes.extend(notes);
        here.failed.retain(|f| others(&f.stage, &f.item));
        let value = |mut manifest: Manifest| {
            manifest.artifacts.sort_by(|a, b| a.path.cmp(&b.path));
            manifest.notes.sort();
            serde_json::to_value(manifest).map_err(Error::failed)
        };
        Ok(compare_manifests(&value(there.clone())?, &value(here)?))
    }
}

/// Compares an item's rows with those of the release.
fn compare_fragments(
    release: &Release,
    record: &Record,
    folder: &Path,
    splits: &Splits,
) -> Result<Vec<Difference>, Error> {
    let mut differences = Vec::new();
    for file in &record.files {
        let Some(rows) = &file.product.fragment else { continue };
        let table = table_of(&record.item, rows)?;
        let mut missing = BTreeSet::new();
        for row in TableReader::open(&folder.join(&file.product.file), table).map_err(Error::io)? {
            let mut cells = row.map_err(Error::io)?;
            splits::fill(table, &mut cells, splits);
            missing.insert(format!("{cells:?}"));
        }
        differences.extend(compare_rows(release, table, missing)?);
    }
    Ok(differences)
}

/// A difference if the release's table lacks any of these rows.
fn compare_rows(release: &Release, table: &Table, mut missing: BTreeSet<String>) -> Result<Option<Difference>, Error> {
    let count = missing.len();
    for file in release.sealed_parts(table.name) {
        for row in TableReader::open(&file?, table).map_err(ReleaseError::from)? {
            missing.remove(&format!("{:?}", row.map_err(ReleaseError::from)?));
        }
    }
    let problem = format!("{} of {} differed when recomputed", missing.len(), counted(count, "row"));
    Ok((!missing.is_empty()).then(|| Difference { path: format!("tables/{}", table.name), problem }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn manifest() -> Value {
        json!({
            "name": "x",
            "artifacts": [
                { "path": "a.tif", "sha256": "1", "stage": "terrain" },
                { "path": "b.tif", "sha256": "2", "stage": "terrain" },
            ],
        })
    }

    /// A change of a manifest.
    type Change = fn(&mut Value);

    /// Each kind of difference alone, as path and problem.
    #[test]
    fn val_every_difference_of_manifests_is_found() {
        assert_eq!(compare_manifests(&manifest(), &manifest()), []);
        let found = |change: Change| {
            let mut here = manifest();
            change(&mut here);
            let differences = compare_manifests(&manifest(), &here);
            let [Difference { path, problem }] = differences.as_slice() else { panic!("{differences:?}") };
            format!("{path}: {problem}")
        };
        let cases: [(Change, &str); 6] = [
            (|m| m["artifacts"][1]["sha256"] = "3".into(), "b.tif: its bytes differ when recomputed"),
            (
                |m| m["artifacts"][0]["stage"] = "texture".into(),
                "a.tif: when recomputed, `stage` differs from manifest.json",
            ),
            (|m| drop(m["artifacts"].as_array_mut().unwrap().remove(0)), "a.tif: missing when recomputed"),
            (
                |m| m["artifacts"].as_array_mut().unwrap().push(json!({ "path": "c.tif", "sha256": "4" })),
                "c.tif: appears when recomputed but is not in the release",
            ),
            (|m| m["seed"] = 7.into(), "manifest.json: when recomputed, `seed` differs from manifest.json"),
            // The same files in another order.
            (
                |m| m["artifacts"].as_array_mut().unwrap().reverse(),
                "manifest.json: when recomputed, `artifacts` differs from manifest.json",
            ),
        ];
        for (change, expected) in cases {
            assert_eq!(found(change), expected);
        }
    }

    #[test]
    fn val_problems_of_files_in_words() {
        assert_eq!(problem_text(ProblemKind::Missing, ""), "missing");
        assert_eq!(problem_text(ProblemKind::Missing, "no such file"), "missing: no such file");
    }
}
