//! Assembles results into a sealed release: artifacts, tables, documents, report, checksums, and a final rename.
//!
//! Records are read one at a time, parents first, and tables are written in row groups. Of each item, only the manifest entries of its
//! files and the keys of its rows stay in memory.

use super::cache::{Record, StoredFile, load_record};
use super::damage::Changed;
use super::execute::Failure;
use super::lock;
use super::progress::Progress;
use super::tables::Fragments;
use crate::documents::sources::Sources;
use crate::documents::{self, Described};
use crate::error::Error;
use crate::job::ItemRef;
use crate::splits::Splits;
use crate::study::Study;
use sastrugi_schemas::counted;
use sastrugi_schemas::manifest::{Artifact, FailedItem, ItemNote, Origin};
use sastrugi_store::release::{self, Head, Incoming, MANIFEST, ReleaseBuilder, ReleaseError, STUDY, for_each_artifact};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Contents of a release.
pub struct Contents<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its text in the release.
    pub text: &'a str,
    /// Assignment of terrains to train, validation and test.
    pub splits: &'a Splits,
    /// Folders of the results, parents before children.
    pub results: Vec<PathBuf>,
    /// What is done about results that changed; an error if there are any.
    pub on_changed: fn(Changed) -> Result<(), Error>,
    /// Items without a result.
    pub failures: &'a [Failure],
    /// Whether a release of another study, or one of the same study with fewer failed items, may be replaced.
    pub replace: bool,
}

/// Assembles and seals a release, and returns its notes.
///
/// # Errors
/// A destination that is not a sastrugi release, is one of another study, or has fewer failed items of the same study; results that cannot
/// be read, or that changed ([`Contents::on_changed`]); an I/O error.
pub fn assemble(contents: &Contents<'_>, dest: &Path, progress: &dyn Progress) -> Result<Vec<ItemNote>, Error> {
    let mut sources = Sources::of(contents.study)?;
    let _lock = DestinationLock::take(dest)?;
    contents.check_replaced(dest)?;
    let mut builder = ReleaseBuilder::beside(dest, head(contents.study, contents.text))?;
    progress.phase("assembling artifacts");
    let changed = Changed::default();
    let fragments = add_results(&mut builder, contents, &mut sources, &changed)?;
    builder.name_sources(sources.list.clone());
    for note in &sources.notes {
        builder.note(note.clone());
    }
    progress.phase("writing tables");
    let written = fragments.write(&mut builder, contents.splits, &changed);
    (contents.on_changed)(changed)?;
    written?;
    add_documents(&mut builder, contents, &sources)?;
    progress.phase("writing the report");
    add_report(&mut builder, progress)?;
    progress.phase("writing checksums");
    Ok(builder.seal(dest)?.notes)
}

/// Ensures that only one process writes to a destination. The lock file next to it is removed when the writer ends; the operating system
/// releases the lock of a killed one.
pub struct DestinationLock {
    path: PathBuf,
    _file: File,
}

impl DestinationLock {
    /// Takes the lock of a destination.
    ///
    /// # Errors
    /// [`Error::Retry`] while another process writes to it.
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
        // Removed while the lock is held, so that processes that have opened the file find it gone. A leftover file is harmless.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Contents<'_> {
    /// Refuses to replace a release of another study, or one of the same study by one with more failed items.
    fn check_replaced(&self, dest: &Path) -> Result<(), Error> {
        check_other_study(self.study, dest, self.replace)?;
        let Ok(there) = for_each_artifact(dest, drop) else { return Ok(()) };
        let (before, now) = (there.failed.len(), self.failures.len());
        let same = there.study_sha256 == sastrugi_store::digest::of_text(self.text);
        match same && before < now && !self.replace {
            true => Err(fewer_items(dest, before, now)),
            false => Ok(()),
        }
    }
}

/// Refuses a destination with a release of another study, by name, or with one that cannot be read, as it is damaged or of a later version,
/// unless it may be replaced.
///
/// # Errors
/// Such a destination; a folder with another `manifest.json`, in any case.
pub fn check_other_study(study: &Study, dest: &Path, replace: bool) -> Result<(), Error> {
    let advice = "choose another folder with -o, or use --replace to replace it";
    match for_each_artifact(dest, drop) {
        Ok(there) if there.name != study.head.name && !replace => {
            Err(Error::Usage(format!("{} is a release of the study `{}`; {advice}", dest.display(), there.name)))
        }
        Ok(_) => Ok(()),
        Err(why @ ReleaseError::NotARelease { .. }) => match release::may_be_one(dest) {
            true if replace => Ok(()),
            true => Err(Error::Usage(format!("{why}; {advice}"))),
            // Many programs have a manifest.json; nothing says that this one is ours.
            false if dest.join(MANIFEST).is_file() => Err(ReleaseError::Occupied { path: dest.to_owned() }.into()),
            false => Ok(()),
        },
        Err(other) => Err(other.into()),
    }
}

/// The head of a release; `text` is the study in its released form.
pub fn head(study: &Study, text: &str) -> Head {
    Head {
        name: study.head.name.clone(),
        study_sha256: sastrugi_store::digest::of_text(text),
        seed: study.head.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        license: study.head.license.clone(),
    }
}

/// The error for a run that would replace one of the same study with fewer failed items.
pub fn fewer_items(dest: &Path, before: usize, now: usize) -> Error {
    let before = counted(before, "failed item");
    Error::Failed(format!(
        "{}: not replaced, because it has {before} and this run of the same study has {now}; use --replace to replace it anyway",
        dest.display()
    ))
}

/// The record of a result.
pub(super) fn record(folder: &Path) -> Result<Record, Error> {
    load_record(folder)
        .ok_or_else(|| Error::Failed(format!("{}: the result changed while it was in use", folder.display())))
}

/// The manifest entries of the files that an item adds to the release.
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

/// The notes of an item, for the manifest.
pub fn notes_of(record: &Record) -> Vec<ItemNote> {
    let ItemRef { stage, id } = &record.item;
    let note = |note: &String| ItemNote { stage: stage.clone(), item: id.clone(), note: note.clone() };
    record.notes.iter().map(note).collect()
}

/// Adds the files of all results, reading each record once, and notes the results that changed. Returns the fragments of the tables.
fn add_results(
    builder: &mut ReleaseBuilder,
    contents: &Contents<'_>,
    sources: &mut Sources,
    changed: &Changed,
) -> Result<Fragments, Error> {
    let mut fragments = Fragments::default();
    let mut notes = Vec::new();
    for folder in &contents.results {
        let record = record(folder)?;
        sources.trace(&record);
        add_artifacts(builder, &record, folder, sources, changed)?;
        fragments.add(&record, folder)?;
        notes.extend(notes_of(&record));
    }
    notes.sort_by(|a, b| (&a.stage, &a.item).cmp(&(&b.stage, &b.item)));
    notes.into_iter().for_each(|note| builder.note(note));
    for failure in contents.failures {
        builder.failed(FailedItem {
            stage: failure.item.stage.clone(),
            item: failure.item.id.clone(),
            error: failure.message.clone(),
            parameters: failure.parameters.clone(),
        });
    }
    Ok(fragments)
}

fn add_artifacts(
    builder: &mut ReleaseBuilder,
    record: &Record,
    folder: &Path,
    sources: &Sources,
    changed: &Changed,
) -> Result<(), Error> {
    let released = record.files.iter().filter(|file| file.product.release_path.is_some());
    let files: Vec<(&StoredFile, Artifact)> = released.zip(artifacts(record, sources)).collect();
    let incoming = files.iter().map(|(file, artifact)| Incoming {
        path: artifact.path.clone(),
        source: folder.join(&file.product.file),
        origin: artifact.origin.clone(),
    });
    let added = builder.add_files(incoming.collect())?;
    let differing = files.iter().zip(&added).filter(|((file, _), sha256)| file.sha256 != **sha256);
    differing.for_each(|((file, _), _)| changed.note(folder, &record.item, &file.product.file));
    Ok(())
}

fn add_documents(builder: &mut ReleaseBuilder, contents: &Contents<'_>, sources: &Sources) -> Result<(), Error> {
    let (head, failures) = (&contents.study.head, contents.failures);
    let (splits, files) = (contents.splits, builder.files());
    let described = Described { head, sources: &sources.list, files, splits, failures };
    let study = (STUDY, contents.text.to_owned());
    for (path, text) in [study].into_iter().chain(documents::all(&described)) {
        builder.write_text(path, &text, Origin::default())?;
    }
    Ok(())
}

fn add_report(builder: &mut ReleaseBuilder, progress: &dyn Progress) -> Result<(), Error> {
    builder.write_draft()?;
    let staging = builder.staging().to_owned();
    sastrugi_report::render(&staging, &staging.join("report"), &|step| progress.step(step)).map_err(Error::io)?;
    for path in files_below(&staging, Path::new("report"))? {
        builder.adopt(&path, Origin { stage: "report".to_owned(), ..Origin::default() })?;
    }
    Ok(())
}

/// Paths of all files below a folder of `root`, sorted, relative to it.
fn files_below(root: &Path, folder: &Path) -> Result<Vec<String>, Error> {
    let mut paths = Vec::new();
    let whole = root.join(folder);
    for entry in std::fs::read_dir(&whole).map_err(|e| Error::at(&whole, e))? {
        let entry = entry.map_err(|e| Error::at(&whole, e))?;
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
    use crate::registry;
    use std::sync::atomic::{AtomicUsize, Ordering};

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

    #[test]
    fn val_one_failed_item_is_one() {
        let said = |before| fewer_items(Path::new("release"), before, 3).to_string();
        assert!(said(1).contains("because it has 1 failed item and this run of the same study has 3;"), "{}", said(1));
        assert!(said(2).contains("because it has 2 failed items and this run of the same study has 3;"), "{}", said(2));
    }

    /// One process writes at a time, in any order of events, also while one removes its lock file.
    #[test]
    fn val_writers_take_turns() {
        let folder = tempfile::tempdir().unwrap();
        let dest = folder.path().join("release");
        let writing = AtomicUsize::new(0);
        let write = || {
            let mut turns = 0;
            while turns < 200 {
                let lock = match DestinationLock::take(&dest) {
                    Ok(lock) => lock,
                    Err(Error::Retry(_)) => continue,
                    Err(other) => panic!("{other}"),
                };
                assert_eq!(writing.fetch_add(1, Ordering::SeqCst), 0);
                std::thread::yield_now();
                writing.fetch_sub(1, Ordering::SeqCst);
                drop(lock);
                turns += 1;
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(write))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// A release that is damaged or of a later version is replaced only on request, and a folder that another program made never.
    #[test]
    fn val_a_release_that_cannot_be_read_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let dest = folder.path().join("release");
        let text = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n";
        let study = Study::parse(text, Path::new(""), &registry::section_names()).unwrap();
        let seal = || ReleaseBuilder::beside(&dest, head(&study, text)).and_then(|builder| builder.seal(&dest));
        let said = |replace| check_other_study(&study, &dest, replace).err().map(|e| e.to_string()).unwrap_or_default();
        seal().unwrap();
        assert_eq!(said(false), "");
        let manifest = std::fs::read_to_string(dest.join(MANIFEST)).unwrap();
        let newer = manifest.replace("\"format\": 1", "\"format\": 2");
        for (text, why) in
            [("{", "cannot be parsed"), (newer.as_str(), "is of sastrugi format 2, expected sastrugi format 1")]
        {
            std::fs::write(dest.join(MANIFEST), text).unwrap();
            let refused = said(false);
            assert!(refused.contains(why) && refused.ends_with("or use --replace to replace it"), "{refused}");
            assert_eq!(said(true), "");
            seal().unwrap();
            assert_eq!(said(false), "");
        }
        std::fs::write(dest.join(MANIFEST), "{}").unwrap();
        std::fs::remove_file(dest.join(release::SUMS)).unwrap();
        for replace in [false, true] {
            assert!(
                said(replace).ends_with("not a sastrugi release; choose another folder with -o"),
                "{}",
                said(replace)
            );
        }
        assert!(matches!(seal(), Err(ReleaseError::Occupied { .. })));
        assert_eq!(std::fs::read_to_string(dest.join(MANIFEST)).unwrap(), "{}");
    }

    #[test]
    fn val_files_of_all_folders_are_listed_in_order() {
        let root = tempfile::tempdir().unwrap();
        for path in ["report/b.html", "report/a/d.svg", "report/a/c.svg", "tables/x.parquet"] {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"x").unwrap();
        }
        let found = files_below(root.path(), Path::new("report")).unwrap();
        assert_eq!(found, ["report/a/c.svg", "report/a/d.svg", "report/b.html"]);
    }
}
