//! From results to a sealed release: artifacts, tables, documents, report, checksums, one rename.
//!
//! Records are read one at a time, in order of their ids, and tables are written in row groups: of what an item made, only
//! the manifest's lines on its files stay in memory.

use super::cache::{Record, StoredFile, load_record};
use super::documents::{self, Described};
use super::execute::Failure;
use super::lock;
use super::progress::Progress;
use super::sources::Sources;
use crate::error::Error;
use crate::jobs::{ItemRef, Rows, fit, roughness, scoreboard, texture, traverse};
use crate::splits::{self, Splits};
use crate::study::Study;
use sastrugi_schemas::Record as Row;
use sastrugi_schemas::manifest::{Artifact, FailedItem, ItemNote, Origin};
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::tables::{
    HeightDistributionRow, MissionRow, ParameterRow, ProfilePsdRow, PsdRow, ReplicateRow, SampleRow, StructureRow,
    SurfaceRow,
};
use sastrugi_store::mcap::VIEWER_LAYOUT;
use sastrugi_store::release::{self, Head, Incoming, Release, ReleaseBuilder, ReleaseError};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

/// What goes into a release.
pub struct Contents<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its text as it is released.
    pub text: &'a str,
    /// Which terrains are for training, validation and test.
    pub splits: &'a Splits,
    /// Every item, parents before children, with the folder of its result.
    pub items: Vec<(ItemRef, Option<PathBuf>)>,
    /// Items without a result.
    pub failures: &'a [Failure],
    /// Whether a release of the same study may be replaced by this one where it has fewer failed items.
    pub replace: bool,
}

/// Assembles and seals a release.
///
/// # Errors
/// A destination that is not ours or holds more of the study, results that cannot be read, or a file system that refuses.
pub fn assemble(mut contents: Contents<'_>, dest: &Path, progress: &dyn Progress) -> Result<Release, Error> {
    let sources = Sources::of(&contents)?;
    contents.items.sort();
    let _lock = DestinationLock::take(dest)?;
    contents.check_replaced(dest)?;
    let mut builder = ReleaseBuilder::beside(dest, contents.head()).map_err(release_error)?;
    progress.phase("assembling artifacts");
    add_artifacts(&mut builder, &contents, &sources)?;
    builder.name_sources(sources.list.clone());
    for note in &sources.notes {
        progress.phase(&format!("{}/{}: {}", note.stage, note.item, note.note));
        builder.note(note.clone());
    }
    let license = &contents.study.head.license;
    if !documents::license::is_listed(license) {
        progress.phase(&format!(
            "[study] license \"{license}\" is not in the SPDX list; write its identifier, as CC-BY-4.0, if it has one"
        ));
    }
    progress.phase("writing tables");
    add_tables(&mut builder, &contents)?;
    add_documents(&mut builder, &contents, &sources)?;
    progress.phase("writing the report");
    add_report(&mut builder, progress)?;
    progress.phase("writing checksums");
    builder.seal(dest).map_err(release_error)
}

/// One writer per destination: a lock file beside it, removed when the writer ends. The operating system frees the lock of
/// a killed one.
pub struct DestinationLock {
    path: PathBuf,
    _file: File,
}

impl DestinationLock {
    /// Takes the lock of a destination.
    ///
    /// # Errors
    /// [`Error::Retry`] while another process writes there.
    pub fn take(dest: &Path) -> Result<Self, Error> {
        let path = release::beside(dest, "lock");
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| Error::at(folder, e))?;
        }
        match lock::take(&path).map_err(|e| Error::at(&path, e))? {
            Some(file) => Ok(Self { path, _file: file }),
            None => Err(Error::Retry(format!("another run is writing {}; wait for it", dest.display()))),
        }
    }
}

impl Drop for DestinationLock {
    fn drop(&mut self) {
        // A lock file that stays is harmless: what counts is the lock.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A store error as the caller should see it.
pub fn release_error(error: ReleaseError) -> Error {
    match error {
        ReleaseError::Occupied { .. } => Error::Usage(error.to_string()),
        _ if error.unusable_input() => Error::Input(error.to_string()),
        _ => Error::io(error),
    }
}

impl Contents<'_> {
    /// What the release says of itself.
    pub fn head(&self) -> Head {
        let study = &self.study.head;
        Head {
            name: study.name.clone(),
            study_sha256: sastrugi_store::digest::of_text(self.text),
            seed: study.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            license: study.license.clone(),
        }
    }

    /// Refuses to replace a release of the same study by one with more failed items.
    fn check_replaced(&self, dest: &Path) -> Result<(), Error> {
        let Ok(there) = Release::open(dest) else { return Ok(()) };
        let (before, now) = (there.manifest().failed.len(), self.failures.len());
        let same = there.manifest().study_sha256 == sastrugi_store::digest::of_text(self.text);
        match same && before < now && !self.replace {
            true => Err(fewer_items(dest, before, now)),
            false => Ok(()),
        }
    }

    /// Results of these stages, in order of their ids.
    fn results(&self, stages: &[&str]) -> Vec<(&ItemRef, &PathBuf)> {
        let of_stages = |(item, _): &&(ItemRef, Option<PathBuf>)| stages.contains(&item.stage.as_str());
        let found = self.items.iter().filter(of_stages).filter_map(|(item, folder)| Some((item, folder.as_ref()?)));
        let mut results: Vec<_> = found.collect();
        results.sort_by(|a, b| a.0.id.cmp(&b.0.id));
        results
    }
}

/// The error for a run that would replace one of the same study with fewer failed items.
pub fn fewer_items(dest: &Path, before: usize, now: usize) -> Error {
    Error::Failed(format!(
        "{}: is left as it is: {before} items of the study failed in it, {now} in this run; `--replace` replaces it",
        dest.display()
    ))
}

/// The record of a result.
pub(super) fn record(folder: &Path) -> Result<Record, Error> {
    load_record(folder)
        .ok_or_else(|| Error::Failed(format!("{}: the result was changed while it was used", folder.display())))
}

/// The rows of a result as they are released.
fn rows_of(contents: &Contents<'_>, folder: &Path) -> Result<Rows, Error> {
    let mut rows = record(folder)?.rows;
    splits::fill(&mut rows, contents.splits);
    Ok(rows)
}

/// What the manifest says of the files that an item brings into the release.
pub fn artifacts(record: &Record, sources: &Sources) -> Vec<Artifact> {
    let artifact = |file: &StoredFile| {
        let origin = Origin {
            stage: record.item.stage.clone(),
            item: record.item.id.clone(),
            content_sha256: file.product.content.clone(),
            records: file.product.records,
            parents: record.ingredients.parents.keys().cloned().collect(),
            stream: record.ingredients.stream.clone(),
            sources: sources.behind(&record.item),
        };
        let path = file.product.release_path.clone()?;
        Some(Artifact { path, bytes: file.bytes, sha256: file.sha256.clone(), origin })
    };
    record.files.iter().filter_map(artifact).collect()
}

/// What a reader must know of an item.
pub fn notes(record: &Record) -> Vec<ItemNote> {
    let ItemRef { stage, id } = &record.item;
    let note = |note: &String| ItemNote { stage: stage.clone(), item: id.clone(), note: note.clone() };
    record.notes.iter().map(note).collect()
}

fn add_artifacts(builder: &mut ReleaseBuilder, contents: &Contents<'_>, sources: &Sources) -> Result<(), Error> {
    for (_, folder) in contents.items.iter() {
        let Some(folder) = folder else { continue };
        let record = record(folder)?;
        let released = record.files.iter().filter(|file| file.product.release_path.is_some());
        let files: Vec<(&StoredFile, Artifact)> = released.zip(artifacts(&record, sources)).collect();
        let incoming = files.iter().map(|(file, artifact)| Incoming {
            path: artifact.path.clone(),
            source: folder.join(&file.product.file),
            origin: artifact.origin.clone(),
        });
        let copied = builder.add_files(incoming.collect()).map_err(release_error)?;
        if let Some(((file, _), _)) = files.iter().zip(&copied).find(|((file, _), sha256)| file.sha256 != **sha256) {
            return Err(damaged(folder, &record.item, &file.product.file));
        }
        notes(&record).into_iter().for_each(|note| builder.note(note));
    }
    for failure in contents.failures {
        builder.failed(FailedItem {
            stage: failure.item.stage.clone(),
            item: failure.item.id.clone(),
            error: failure.message.clone(),
            parameters: failure.parameters.clone(),
        });
    }
    Ok(())
}

/// A result that is not what it was when it was made is dropped, so that the next run makes it again.
fn damaged(folder: &Path, item: &ItemRef, file: &str) -> Error {
    let dropped = std::fs::remove_dir_all(folder).is_ok();
    let advice = if dropped { "it was dropped; run again" } else { "remove it and run again" };
    Error::Failed(format!("{item}: {file} was changed in the work area {}; {advice}", folder.display()))
}

fn add_tables(builder: &mut ReleaseBuilder, contents: &Contents<'_>) -> Result<(), Error> {
    add_table(builder, contents, made_by(roughness::STAGE), |rows| rows.terrains)?;
    add_table(builder, contents, made_by(fit::STAGE), |rows| rows.fits)?;
    add_table(builder, contents, made_by(fit::STAGE), |rows| rows.covariance)?;
    add_table(builder, contents, made_by(fit::STAGE), |rows| rows.candidates)?;
    add_table(builder, contents, made_by(fit::STAGE), |rows| rows.candidate_curves)?;
    add_table(builder, contents, made_by(fit::STAGE), |rows| rows.likelihood_profile)?;
    add_described(builder, contents)?;
    add_scoreboard(builder, contents)?;
    add_missions(builder, contents)?;
    add_parameters(builder, contents)
}

/// The tables of the scoreboard. Its stage leaves no other file that could say what the items were made from.
fn add_scoreboard(builder: &mut ReleaseBuilder, contents: &Contents<'_>) -> Result<(), Error> {
    let mut parents = BTreeSet::new();
    for (_, folder) in contents.results(&[scoreboard::STAGE]) {
        parents.extend(record(folder)?.ingredients.parents.into_keys());
    }
    let origin = Origin { parents: parents.into_iter().collect(), ..made_by(scoreboard::STAGE) };
    add_table(builder, contents, origin.clone(), |rows| rows.scoreboard)?;
    add_table(builder, contents, origin, |rows| rows.scoreboard_covariance)
}

/// One table, its rows taken item by item of the origin's stage; the ids of items are the rows' first key.
fn add_table<R: Row>(
    builder: &mut ReleaseBuilder,
    contents: &Contents<'_>,
    origin: Origin,
    take: impl Fn(Rows) -> Vec<R>,
) -> Result<(), Error> {
    let results = contents.results(&[origin.stage.as_str()]);
    let parts = results.into_iter().map(|(_, folder)| Ok(take(rows_of(contents, folder)?)));
    write_parts(builder, parts, origin)
}

/// One table, written as its parts are read; the first part that cannot be read is the error.
fn write_parts<R: Row>(
    builder: &mut ReleaseBuilder,
    mut parts: impl Iterator<Item = Result<Vec<R>, Error>>,
    origin: Origin,
) -> Result<(), Error> {
    let mut trouble = None;
    let rows = std::iter::from_fn(|| parts.next()?.map_err(|error| trouble = Some(error)).ok());
    let written = builder.write_table("0000", rows.flatten(), origin);
    match trouble {
        Some(error) => Err(error),
        None => written.map_err(release_error),
    }
}

/// The tables that describe surfaces, all at once, surface by surface. An item may describe surfaces under ids of their own
/// (`<texture>.residual`), which are looked up first.
fn add_described(builder: &mut ReleaseBuilder, contents: &Contents<'_>) -> Result<(), Error> {
    let stages = [roughness::STAGE, fit::STAGE, texture::STAGE];
    let mut described: BTreeMap<String, Vec<&PathBuf>> = BTreeMap::new();
    for (_, folder) in contents.results(&stages) {
        for surface in record(folder)?.rows.surfaces {
            described.entry(surface.surface_id).or_default().push(folder);
        }
    }
    let (mut psd, mut heights) = (builder.table::<PsdRow>("0000"), builder.table::<HeightDistributionRow>("0000"));
    let (mut surfaces, mut structure) = (builder.table::<SurfaceRow>("0000"), builder.table::<StructureRow>("0000"));
    let mut profiles = builder.table::<ProfilePsdRow>("0000");
    for (id, folders) in &described {
        for folder in folders {
            let rows = record(folder)?.rows;
            psd.extend(rows.psd.into_iter().filter(|row| row.terrain_id == *id)).map_err(release_error)?;
            let of_surface = rows.height_distribution.into_iter().filter(|row| row.terrain_id == *id);
            heights.extend(of_surface).map_err(release_error)?;
            surfaces.extend(rows.surfaces.into_iter().filter(|r| r.surface_id == *id)).map_err(release_error)?;
            structure.extend(rows.structure.into_iter().filter(|r| r.surface_id == *id)).map_err(release_error)?;
            profiles.extend(rows.profile_psd.into_iter().filter(|r| r.surface_id == *id)).map_err(release_error)?;
        }
    }
    let made_by = || made_by(&stages.join("+"));
    builder.close(psd, made_by()).map_err(release_error)?;
    builder.close(heights, made_by()).map_err(release_error)?;
    builder.close(surfaces, made_by()).map_err(release_error)?;
    builder.close(structure, made_by()).map_err(release_error)?;
    builder.close(profiles, made_by()).map_err(release_error)
}

fn made_by(stage: &str) -> Origin {
    Origin { stage: stage.to_owned(), ..Origin::default() }
}

/// `missions`, `replicates` and `samples`: all runs on one terrain together, sorted by key. Only as many terrains' rows
/// are held as there are threads.
fn add_missions(builder: &mut ReleaseBuilder, contents: &Contents<'_>) -> Result<(), Error> {
    let mut terrains: BTreeMap<&str, Vec<&PathBuf>> = BTreeMap::new();
    for (item, folder) in contents.results(&[traverse::STAGE]) {
        terrains.entry(traverse::terrain_of(&item.id)).or_default().push(folder);
    }
    let samples = |terrain: &str| -> Result<Vec<SampleRow>, Failed> {
        let mut samples: Vec<SampleRow> = Vec::new();
        for folder in terrains.get(terrain).into_iter().flatten() {
            let path = folder.join(traverse::SAMPLES);
            let read = sastrugi_store::parquet::read_table::<SampleRow>(&path);
            samples.extend(read.map_err(|e| Failed(Error::failed(e)))?);
        }
        samples.sort_by(|a, b| (&a.mission_id, a.sample).cmp(&(&b.mission_id, b.sample)));
        Ok(samples)
    };
    let parts: Vec<&str> = terrains.keys().copied().collect();
    builder.write_parts(&parts, samples, &made_by(traverse::STAGE)).map_err(|Failed(error)| error)?;
    let (mut missions, mut replicates) = (builder.table::<MissionRow>("0000"), builder.table::<ReplicateRow>("0000"));
    for folders in terrains.values() {
        let mut rows = Rows::default();
        for folder in folders {
            let of_run = rows_of(contents, folder)?;
            rows.missions.extend(of_run.missions);
            rows.replicates.extend(of_run.replicates);
        }
        rows.missions.sort_by(|a, b| a.mission_id.cmp(&b.mission_id));
        rows.replicates.sort_by(|a, b| (&a.mission_id, a.replicate).cmp(&(&b.mission_id, b.replicate)));
        missions.extend(rows.missions).map_err(release_error)?;
        replicates.extend(rows.replicates).map_err(release_error)?;
    }
    builder.close(missions, made_by(traverse::STAGE)).map_err(release_error)?;
    builder.close(replicates, made_by(traverse::STAGE)).map_err(release_error)
}

/// `parameters`: every run once, whatever the number of its terrains.
fn add_parameters(builder: &mut ReleaseBuilder, contents: &Contents<'_>) -> Result<(), Error> {
    let mut runs: BTreeMap<&str, &PathBuf> = BTreeMap::new();
    for (item, folder) in contents.results(&[traverse::STAGE]) {
        runs.entry(traverse::run_of(&item.id)).or_insert(folder);
    }
    let sorted = |folder: &PathBuf| -> Result<Vec<ParameterRow>, Error> {
        let mut rows = record(folder)?.rows.parameters;
        rows.sort_by(|a, b| a.parameter.cmp(&b.parameter));
        Ok(rows)
    };
    write_parts(builder, runs.into_values().map(sorted), made_by(traverse::STAGE))
}

/// An error of a part of a table.
struct Failed(Error);

impl From<ReleaseError> for Failed {
    fn from(error: ReleaseError) -> Self {
        Self(release_error(error))
    }
}

fn add_documents(builder: &mut ReleaseBuilder, contents: &Contents<'_>, sources: &Sources) -> Result<(), Error> {
    let (head, failures) = (&contents.study.head, contents.failures);
    let described = Described { head, sources: &sources.list, artifacts: builder.artifacts(), failures };
    let documents = [
        ("study.toml", contents.text.to_owned()),
        ("README.md", documents::readme(&described)),
        ("CITATION.cff", documents::citation(&described)),
        ("LICENSE", documents::license(&described)),
        ("croissant.json", json_text(&documents::croissant(&described))?),
        ("ro-crate-metadata.json", json_text(&documents::ro_crate(&described))?),
    ];
    let viewer = head.mcap == McapFlavour::Viewer && described.artifacts.iter().any(|a| a.path.ends_with(".mcap"));
    let layout = viewer.then(|| ("mcap/foxglove-layout.json", VIEWER_LAYOUT.to_owned()));
    for (path, text) in documents.into_iter().chain(layout) {
        builder.write_text(path, &text, Origin::default()).map_err(release_error)?;
    }
    Ok(())
}

fn json_text(value: &Value) -> Result<String, Error> {
    serde_json::to_string_pretty(value).map(|text| text + "\n").map_err(Error::failed)
}

fn add_report(builder: &mut ReleaseBuilder, progress: &dyn Progress) -> Result<(), Error> {
    builder.write_draft().map_err(release_error)?;
    let staging = builder.staging().to_owned();
    sastrugi_report::render(&staging, &staging.join("report"), &|phase| progress.phase(phase))
        .map_err(Error::failed)?;
    for path in files_below(&staging, Path::new("report"))? {
        builder.adopt(&path, Origin { stage: "report".to_owned(), ..Origin::default() }).map_err(release_error)?;
    }
    Ok(())
}

/// Paths of all files below a folder of `root`, sorted, relative to it.
fn files_below(root: &Path, folder: &Path) -> Result<Vec<String>, Error> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(root.join(folder)).map_err(Error::failed)? {
        let entry = entry.map_err(Error::failed)?;
        let path = folder.join(entry.file_name());
        if entry.path().is_dir() {
            paths.extend(files_below(root, &path)?);
        } else {
            paths.push(path.to_string_lossy().into_owned());
        }
    }
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_one_writer_per_destination() {
        let folder = tempfile::tempdir().unwrap();
        let dest = folder.path().join("release");
        let first = DestinationLock::take(&dest).unwrap();
        let second = DestinationLock::take(&dest).err().unwrap();
        assert!(matches!(second, Error::Retry(_)) && second.to_string().contains("another run"));
        drop(first);
        drop(DestinationLock::take(&dest).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
