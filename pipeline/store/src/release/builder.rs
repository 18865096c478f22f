//! Assembly of a release in a folder of its own, and its sealing.

use super::{MANIFEST, Release, ReleaseError, SUMS, TABLES, check_path};
use crate::atomic::sync_folder;
use crate::digest::{self, Hashed};
use crate::parquet::{TableMetadata, TableWriter};
use rayon::prelude::*;
use sastrugi_schemas::Record;
use sastrugi_schemas::manifest::{Artifact, FORMAT, FailedItem, ItemNote, Manifest, Origin, PROGRAM, Source};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// What a release says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Head {
    /// Name of the study.
    pub name: String,
    /// SHA-256 of the study as it was run.
    pub study_sha256: String,
    /// Seed of the study.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// Licence of the release, SPDX.
    pub license: String,
}

impl Head {
    /// The same in the metadata of tables.
    pub fn table_metadata(&self) -> TableMetadata {
        TableMetadata {
            study_sha256: self.study_sha256.clone(),
            seed: self.seed,
            version: self.version.clone(),
            license: self.license.clone(),
        }
    }
}

/// A release under construction. What grows with it in memory is the manifest, whose list of files has one line for each.
#[derive(Debug)]
pub struct ReleaseBuilder {
    staging: PathBuf,
    metadata: TableMetadata,
    manifest: Manifest,
    paths: BTreeSet<String>,
}

/// A file of a table under construction, to be written row by row beside others. It appears with its first row.
pub struct GrowingTable<R: Record> {
    path: String,
    target: PathBuf,
    metadata: TableMetadata,
    writer: Option<TableWriter<R>>,
}

impl<R: Record> GrowingTable<R> {
    /// Appends rows, each after the one before it in the order of the keys.
    ///
    /// # Errors
    /// The rows are not sorted, or the file cannot be written.
    pub fn extend(&mut self, rows: impl IntoIterator<Item = R>) -> Result<(), ReleaseError> {
        for row in rows {
            if self.writer.is_none() {
                self.writer = Some(TableWriter::create(&self.target, &self.metadata)?);
            }
            self.writer.as_mut().map_or(Ok(()), |writer| writer.push(&row))?;
        }
        Ok(())
    }
}

/// A file to be copied into a release.
#[derive(Clone, Debug)]
pub struct Incoming {
    /// Path in the release.
    pub path: String,
    /// File to copy.
    pub source: PathBuf,
    /// Where it comes from.
    pub origin: Origin,
}

fn copy(source: &Path, target: &Path) -> Result<(u64, String), ReleaseError> {
    let mut from = File::open(source).map_err(ReleaseError::io(source))?;
    let mut to = File::create(target).map_err(ReleaseError::io(target))?;
    digest::copy(&mut from, &mut to).map_err(ReleaseError::io(target))
}

impl ReleaseBuilder {
    /// Starts a release beside its place: in `.sastrugi-assembling-<dest>`, which is emptied when a killed run left it.
    ///
    /// # Errors
    /// [`ReleaseError::Occupied`] when `dest` holds something that is no release; the folder cannot be made.
    pub fn beside(dest: &Path, head: Head) -> Result<Self, ReleaseError> {
        check_dest(dest)?;
        Self::create(&beside(dest, "assembling"), head)
    }

    /// Starts a release in a folder, which is emptied.
    pub(super) fn create(staging: &Path, head: Head) -> Result<Self, ReleaseError> {
        remove_folder(staging)?;
        fs::create_dir_all(staging).map_err(ReleaseError::io(staging))?;
        let metadata = head.table_metadata();
        let Head { name, study_sha256, seed, version, license } = head;
        let manifest = Manifest {
            program: PROGRAM.to_owned(),
            version,
            format: FORMAT,
            name,
            study_sha256,
            seed,
            license,
            artifacts: vec![],
            sources: vec![],
            failed: vec![],
            notes: vec![],
        };
        Ok(Self { staging: staging.to_owned(), metadata, manifest, paths: BTreeSet::new() })
    }

    /// The folder under construction.
    pub fn staging(&self) -> &Path {
        &self.staging
    }

    /// The files listed so far, by path.
    pub fn artifacts(&mut self) -> &[Artifact] {
        self.manifest.artifacts.sort_by(|a, b| a.path.cmp(&b.path));
        &self.manifest.artifacts
    }

    /// Copies files into the release, several at a time; returns their SHA-256 in the same order.
    ///
    /// # Errors
    /// A path is not usable, or a file cannot be read or written.
    pub fn add_files(&mut self, files: Vec<Incoming>) -> Result<Vec<String>, ReleaseError> {
        let targets = files.iter().map(|file| self.claim(&file.path)).collect::<Result<Vec<PathBuf>, _>>()?;
        let copied: Result<Vec<(u64, String)>, ReleaseError> =
            files.par_iter().zip(&targets).map(|(file, target)| copy(&file.source, target)).collect();
        let list = |(file, (bytes, sha256)): (Incoming, (u64, String))| {
            self.manifest.artifacts.push(Artifact {
                path: file.path,
                bytes,
                sha256: sha256.clone(),
                origin: file.origin,
            });
            sha256
        };
        Ok(files.into_iter().zip(copied?).map(list).collect())
    }

    /// Writes a text file into the release.
    ///
    /// # Errors
    /// As [`ReleaseBuilder::add_files`].
    pub fn write_text(&mut self, path: &str, text: &str, origin: Origin) -> Result<(), ReleaseError> {
        let target = self.target(path)?;
        fs::write(&target, text).map_err(ReleaseError::io(&target))?;
        let (bytes, sha256) = (text.len() as u64, digest::of_text(text));
        self.list(Artifact { path: path.to_owned(), bytes, sha256, origin });
        Ok(())
    }

    /// Lists a file that was written into [`ReleaseBuilder::staging`] by someone else (the report).
    ///
    /// # Errors
    /// As [`ReleaseBuilder::add_files`].
    pub fn adopt(&mut self, path: &str, origin: Origin) -> Result<(), ReleaseError> {
        let target = self.target(path)?;
        let (bytes, sha256) = digest::of_file(&target).map_err(ReleaseError::io(&target))?;
        self.list(Artifact { path: path.to_owned(), bytes, sha256, origin });
        Ok(())
    }

    /// Writes one file `part-<part>.parquet` of a table from rows sorted by key; nothing when there is no row.
    ///
    /// # Errors
    /// The rows are not sorted, or the file cannot be written.
    pub fn write_table<R: Record>(
        &mut self,
        part: &str,
        rows: impl IntoIterator<Item = R>,
        origin: Origin,
    ) -> Result<(), ReleaseError> {
        let mut table = self.table(part);
        table.extend(rows)?;
        self.close(table, origin)
    }

    /// A file `part-<part>.parquet` of a table, to be written bit by bit; [`Self::close`] lists it.
    pub fn table<R: Record>(&self, part: &str) -> GrowingTable<R> {
        let path = part_path::<R>(part);
        GrowingTable { target: self.staging.join(&path), path, metadata: self.metadata.clone(), writer: None }
    }

    /// Completes and lists a table's file, if it has a row.
    ///
    /// # Errors
    /// The file cannot be written, or its path is taken.
    pub fn close<R: Record>(&mut self, table: GrowingTable<R>, origin: Origin) -> Result<(), ReleaseError> {
        let Some(writer) = table.writer else { return Ok(()) };
        let summary = writer.finish()?;
        let content_sha256 = Some(summary.content_sha256);
        self.adopt(&table.path, Origin { content_sha256, records: Some(summary.rows), ..origin })
    }

    /// Writes one file `part-<part>.parquet` of a table for each part, several at a time; `rows` makes the rows of a part,
    /// sorted by key. A part without rows has no file.
    ///
    /// # Errors
    /// Those of `rows`; the rows are not sorted, or a file cannot be written.
    pub fn write_parts<R: Record, E: From<ReleaseError> + Send>(
        &mut self,
        parts: &[&str],
        rows: impl Fn(&str) -> Result<Vec<R>, E> + Sync,
        origin: &Origin,
    ) -> Result<(), E> {
        let targets =
            parts.iter().map(|part| self.claim(&part_path::<R>(part))).collect::<Result<Vec<PathBuf>, _>>()?;
        let metadata = &self.metadata;
        let write = |(part, target): (&&str, &PathBuf)| {
            let rows = rows(part)?;
            if rows.is_empty() {
                return Ok(None);
            }
            let mut writer = TableWriter::<R>::create(target, metadata).map_err(ReleaseError::from)?;
            rows.iter().try_for_each(|row| writer.push(row)).map_err(ReleaseError::from)?;
            let summary = writer.finish().map_err(ReleaseError::from)?;
            let (bytes, sha256) = digest::of_file(target).map_err(ReleaseError::io(target))?;
            let content_sha256 = Some(summary.content_sha256);
            let origin = Origin { content_sha256, records: Some(summary.rows), ..origin.clone() };
            Ok(Some(Artifact { path: part_path::<R>(part), bytes, sha256, origin }))
        };
        let written: Result<Vec<Option<Artifact>>, E> = parts.par_iter().zip(&targets).map(write).collect();
        self.manifest.artifacts.extend(written?.into_iter().flatten());
        Ok(())
    }

    /// Lists an item that failed.
    pub fn failed(&mut self, item: FailedItem) {
        self.manifest.failed.push(item);
    }

    /// Names the measured data that files come from.
    pub fn name_sources(&mut self, sources: Vec<Source>) {
        self.manifest.sources = sources;
    }

    /// Lists a sentence that readers of an item's files must know.
    pub fn note(&mut self, note: ItemNote) {
        self.manifest.notes.push(note);
    }

    fn list(&mut self, artifact: Artifact) {
        self.paths.insert(artifact.path.clone());
        self.manifest.artifacts.push(artifact);
    }

    /// Where a file goes that is listed later.
    fn claim(&mut self, path: &str) -> Result<PathBuf, ReleaseError> {
        let target = self.target(path)?;
        self.paths.insert(path.to_owned());
        Ok(target)
    }

    /// Writes the manifest as far as it goes, for readers of the folder under construction (the report); sealing writes it
    /// again.
    ///
    /// # Errors
    /// The file system failed.
    pub fn write_draft(&mut self) -> Result<(), ReleaseError> {
        self.write_manifest().map(drop)
    }

    /// Writes the manifest in order, and gives its SHA-256.
    fn write_manifest(&mut self) -> Result<String, ReleaseError> {
        self.manifest.artifacts.sort_by(|a, b| a.path.cmp(&b.path));
        self.manifest.failed.sort_by(|a, b| (&a.stage, &a.item).cmp(&(&b.stage, &b.item)));
        let path = self.staging.join(MANIFEST);
        let file = File::create(&path).map_err(ReleaseError::io(&path))?;
        let mut writer = BufWriter::new(Hashed::new(file));
        serde_json::to_writer_pretty(&mut writer, &self.manifest)?;
        writeln!(writer).map_err(ReleaseError::io(&path))?;
        let written = writer.into_inner().map_err(|e| ReleaseError::io(&path)(e.into_error()))?;
        Ok(written.finish().2)
    }

    /// Where a file of the release goes; its folder is made.
    fn target(&self, path: &str) -> Result<PathBuf, ReleaseError> {
        check_path(path)?;
        if self.paths.contains(path) {
            return Err(ReleaseError::Path { path: path.to_owned(), reason: "it is there twice" });
        }
        let target = self.staging.join(path);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder).map_err(ReleaseError::io(folder))?;
        }
        Ok(target)
    }

    /// Writes manifest and checksums, brings everything to disk and gives the release its name. A release that is
    /// there already is replaced.
    ///
    /// # Errors
    /// [`ReleaseError::Occupied`] when `dest` holds something that is no release; the file system failed.
    pub fn seal(mut self, dest: &Path) -> Result<Release, ReleaseError> {
        check_dest(dest)?;
        let sha256 = self.write_manifest()?;
        let path = self.staging.join(SUMS);
        fs::write(&path, sums(&self.manifest, &sha256)).map_err(ReleaseError::io(&path))?;
        sync_tree(&self.staging)?;
        put_in_place(&self.staging, dest)?;
        Ok(Release { folder: dest.to_owned(), manifest: self.manifest })
    }
}

/// Path of a part of a table in a release.
fn part_path<R: Record>(part: &str) -> String {
    format!("{TABLES}/{}/part-{part}.parquet", R::TABLE.name)
}

/// The text of `SHA256SUMS`: every file of the manifest and the manifest itself, by path.
pub(super) fn sums(manifest: &Manifest, manifest_sha256: &str) -> String {
    let mut lines: Vec<(&str, &str)> =
        manifest.artifacts.iter().map(|a| (a.path.as_str(), a.sha256.as_str())).collect();
    lines.push((MANIFEST, manifest_sha256));
    lines.sort_unstable();
    lines.iter().fold(String::new(), |mut text, (path, sha256)| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{sha256}  {path}");
        text
    })
}

/// Refuses a place that holds something that is no release.
fn check_dest(dest: &Path) -> Result<(), ReleaseError> {
    let occupied = || ReleaseError::Occupied { path: dest.to_owned() };
    match fs::read_dir(dest).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => Release::open(dest).map(drop).map_err(|_| occupied()),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(e) if e.kind() == std::io::ErrorKind::NotADirectory => Err(occupied()),
        Err(e) => Err(ReleaseError::io(dest)(e)),
    }
}

/// `.sastrugi-<role>-<name of dest>` in the same folder: a name that nobody's own folder has.
pub fn beside(dest: &Path, role: &str) -> PathBuf {
    let mut name = OsString::from(format!(".sastrugi-{role}-"));
    name.push(dest.file_name().unwrap_or_else(|| "release".as_ref()));
    dest.with_file_name(name)
}

fn remove_folder(folder: &Path) -> Result<(), ReleaseError> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(ReleaseError::io(folder)(e)),
        _ => Ok(()),
    }
}

/// Gives a finished folder its name; what has the name is replaced, and is there until then.
///
/// # Errors
/// The file system refused.
pub fn put_in_place(staging: &Path, dest: &Path) -> Result<(), ReleaseError> {
    let aside = beside(dest, "replaced");
    remove_folder(&aside)?;
    if dest.exists() {
        fs::rename(dest, &aside).map_err(ReleaseError::io(dest))?;
    }
    fs::rename(staging, dest).map_err(ReleaseError::io(dest))?;
    let parent = match dest.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    sync_folder(parent).map_err(ReleaseError::io(parent))?;
    remove_folder(&aside)
}

/// Brings every file and folder of a tree to disk.
fn sync_tree(folder: &Path) -> Result<(), ReleaseError> {
    let entries =
        fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>).map_err(ReleaseError::io(folder))?;
    entries.par_iter().map(std::fs::DirEntry::path).try_for_each(|path| {
        if path.is_dir() {
            return sync_tree(&path);
        }
        File::open(&path).and_then(|f| f.sync_all()).map_err(ReleaseError::io(&path))
    })?;
    sync_folder(folder).map_err(ReleaseError::io(folder))
}
