//! Assembly of a release in a temporary folder, and sealing.

use super::listed::{Listed, Listing};
use super::{MANIFEST, ReleaseError, SUMS, TABLES, check_path, for_each_artifact};
use crate::atomic::{self, AtomicFile, DraftFile, sync_folder};
use crate::digest::{self, Hashed};
use crate::parquet::{TableMetadata, TableWriter};
use rayon::prelude::*;
use sastrugi_schemas::manifest::{FORMAT, FailedItem, ItemNote, Manifest, Origin, PROGRAM, Source};
use sastrugi_schemas::{Cell, Table};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Identity of a release.
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
    /// The same information for the metadata of tables.
    pub fn table_metadata(&self) -> TableMetadata {
        TableMetadata {
            study_sha256: self.study_sha256.clone(),
            seed: self.seed,
            version: self.version.clone(),
            license: self.license.clone(),
        }
    }
}

/// A release under construction. Only the manifest, with one line per file, is held in memory.
#[derive(Debug)]
pub struct ReleaseBuilder {
    staging: Staging,
    metadata: TableMetadata,
    /// The manifest without its files.
    manifest: Manifest,
    files: Vec<Listed>,
    /// Paths of the files, listed or to be listed.
    paths: BTreeSet<Arc<str>>,
}

/// A path that is reserved for a file of the release, and its location in the folder under construction.
struct Claimed {
    path: Arc<str>,
    target: PathBuf,
}

/// A file of a table, as it was written.
struct Written {
    bytes: u64,
    sha256: String,
    content_sha256: String,
    rows: u64,
}

/// One file of a table.
#[derive(Clone, Debug)]
pub struct TablePart {
    /// The table.
    pub table: &'static Table,
    /// Name of the part; the file is `part-<name>.parquet`.
    pub name: String,
    /// Origin, shared by the parts of a table because it may list very many parents.
    pub origin: Arc<Origin>,
}

impl TablePart {
    /// Name of the part of a table that is a single file.
    pub const WHOLE: &str = "0000";

    fn path(&self) -> String {
        format!("{TABLES}/{}/part-{}.parquet", self.table.name, self.name)
    }
}

/// Writes the rows of a part. The file is created with the first row.
pub struct PartWriter<'a> {
    table: &'static Table,
    target: &'a Path,
    metadata: &'a TableMetadata,
    writer: Option<TableWriter>,
}

impl PartWriter<'_> {
    /// Appends a row; its key must be greater than that of the row before.
    ///
    /// # Errors
    /// The rows are not sorted, or the file cannot be written.
    pub fn push(&mut self, cells: Vec<Cell>) -> Result<(), ReleaseError> {
        if self.writer.is_none() {
            let file = DraftFile::at(self.target);
            self.writer = Some(TableWriter::create(&file, self.table, Some(self.metadata))?);
        }
        self.writer.as_mut().map_or(Ok(()), |writer| writer.push(cells))?;
        Ok(())
    }
}

/// A file to be added to a release.
#[derive(Clone, Debug)]
pub struct Incoming {
    /// Path in the release.
    pub path: String,
    /// The file, complete and on disk.
    pub source: PathBuf,
    /// Origin.
    pub origin: Origin,
}

/// Size and SHA-256 of a file that has got its place in the release.
fn place(source: &Path, target: &Path) -> Result<(u64, String), ReleaseError> {
    let at_fault = || if File::open(source).is_ok() { target } else { source };
    atomic::link_or_copy(source, target).map_err(|e| ReleaseError::io(at_fault())(e))?;
    digest::of_file(target).map_err(ReleaseError::io(target))
}

impl ReleaseBuilder {
    /// Starts a release next to its destination, in `.sastrugi-assembling-<dest>`, which is emptied if a killed run left it.
    ///
    /// # Errors
    /// [`ReleaseError::Occupied`] if `dest` holds files that are not a release; the folder cannot be created.
    pub fn beside(dest: &Path, head: Head) -> Result<Self, ReleaseError> {
        check_dest(dest)?;
        let staging = Staging::beside(dest)?;
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
        Ok(Self { staging, metadata, manifest, files: Vec::new(), paths: BTreeSet::new() })
    }

    /// The folder under construction.
    pub fn staging(&self) -> &Path {
        self.staging.path()
    }

    /// The files listed so far, by path.
    pub fn files(&mut self) -> &[Listed] {
        self.sort_files();
        &self.files
    }

    fn sort_files(&mut self) {
        self.files.sort_by(|a, b| a.path().cmp(b.path()));
    }

    /// Adds files to the release, several at a time; returns their SHA-256 in the same order. On the file system of the release they get a
    /// hard link, and must not be changed in place any more; from elsewhere they are copied.
    ///
    /// # Errors
    /// A path is not allowed, or a file cannot be read or written.
    pub fn add_files(&mut self, files: Vec<Incoming>) -> Result<Vec<String>, ReleaseError> {
        let claimed = files.iter().map(|file| self.claim(&file.path)).collect::<Result<Vec<Claimed>, _>>()?;
        let placed: Result<Vec<(u64, String)>, ReleaseError> =
            files.par_iter().zip(&claimed).map(|(file, claimed)| place(&file.source, &claimed.target)).collect();
        let mut sums = Vec::new();
        for ((file, claimed), (bytes, sha256)) in files.into_iter().zip(claimed).zip(placed?) {
            self.list(claimed, bytes, &sha256, file.origin);
            sums.push(sha256);
        }
        Ok(sums)
    }

    /// Writes a text file into the release.
    ///
    /// # Errors
    /// As [`ReleaseBuilder::add_files`].
    pub fn write_text(&mut self, path: &str, text: &str, origin: Origin) -> Result<(), ReleaseError> {
        let claimed = self.claim(path)?;
        write(&claimed.target, text)?;
        self.list(claimed, text.len() as u64, &digest::of_text(text), origin);
        Ok(())
    }

    /// Lists a file that other code (the report) wrote into [`ReleaseBuilder::staging`].
    ///
    /// # Errors
    /// As [`ReleaseBuilder::add_files`].
    pub fn adopt(&mut self, path: &str, origin: Origin) -> Result<(), ReleaseError> {
        let claimed = self.claim(path)?;
        let target = &claimed.target;
        let (bytes, sha256) = digest::of_file(target).map_err(ReleaseError::io(target))?;
        File::open(target).and_then(|file| file.sync_all()).map_err(ReleaseError::io(target))?;
        self.list(claimed, bytes, &sha256, origin);
        Ok(())
    }

    /// Writes the files of tables, several at a time; `fill` pushes the rows of a part, sorted by key. A part without rows has no
    /// file.
    ///
    /// # Errors
    /// Those of `fill`; a file cannot be written, or its path is already listed.
    pub fn write_tables<E: From<ReleaseError> + Send>(
        &mut self,
        parts: Vec<TablePart>,
        fill: impl Fn(&TablePart, &mut PartWriter<'_>) -> Result<(), E> + Sync,
    ) -> Result<(), E> {
        let claimed = parts.iter().map(|part| self.claim(&part.path())).collect::<Result<Vec<Claimed>, _>>()?;
        let metadata = &self.metadata;
        let write = |(part, Claimed { target, .. }): (&TablePart, &Claimed)| {
            let mut rows = PartWriter { table: part.table, target, metadata, writer: None };
            fill(part, &mut rows)?;
            let Some(writer) = rows.writer else { return Ok(None) };
            let summary = writer.finish().map_err(ReleaseError::from)?;
            let (bytes, sha256) = digest::of_file(target).map_err(ReleaseError::io(target))?;
            Ok(Some(Written { bytes, sha256, content_sha256: summary.content_sha256, rows: summary.rows }))
        };
        let written: Result<Vec<Option<Written>>, E> = parts.par_iter().zip(&claimed).map(write).collect();
        for ((part, claimed), written) in parts.iter().zip(claimed).zip(written?) {
            if let Some(Written { bytes, sha256, content_sha256, rows }) = written {
                let (content_sha256, records) = (Some(content_sha256), Some(rows));
                let origin = Origin { content_sha256, records, ..Origin::clone(&part.origin) };
                self.list(claimed, bytes, &sha256, origin);
            }
        }
        Ok(())
    }

    /// Lists an item that failed.
    pub fn failed(&mut self, item: FailedItem) {
        self.manifest.failed.push(item);
    }

    /// Sets the measured data that files derive from.
    pub fn name_sources(&mut self, sources: Vec<Source>) {
        self.manifest.sources = sources;
    }

    /// Lists a note for readers of an item's files.
    pub fn note(&mut self, note: ItemNote) {
        self.manifest.notes.push(note);
    }

    fn list(&mut self, claimed: Claimed, bytes: u64, sha256: &str, origin: Origin) {
        let listed = Listed::new(claimed.path, bytes, sha256, origin, self.files.last());
        self.files.push(listed);
    }

    /// Reserves the path of a file that is listed later; creates its folder.
    fn claim(&mut self, path: &str) -> Result<Claimed, ReleaseError> {
        check_path(path)?;
        let path: Arc<str> = path.into();
        if !self.paths.insert(Arc::clone(&path)) {
            return Err(ReleaseError::Path { path: path.to_string(), reason: "it is already listed" });
        }
        let target = self.staging().join(&*path);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder).map_err(ReleaseError::io(folder))?;
        }
        Ok(Claimed { path, target })
    }

    /// Writes the manifest so far, for readers of the folder under construction (the report); sealing rewrites it.
    ///
    /// # Errors
    /// The file system failed.
    pub fn write_draft(&mut self) -> Result<(), ReleaseError> {
        self.write_manifest().map(drop)
    }

    /// Sorts and writes the manifest, and returns its SHA-256.
    fn write_manifest(&mut self) -> Result<String, ReleaseError> {
        self.sort_files();
        self.manifest.failed.sort_by(|a, b| (&a.stage, &a.item).cmp(&(&b.stage, &b.item)));
        let path = self.staging().join(MANIFEST);
        let file = File::create(&path).map_err(ReleaseError::io(&path))?;
        let mut writer = BufWriter::new(Hashed::new(file));
        serde_json::to_writer_pretty(&mut writer, &Listing { manifest: &self.manifest, files: &self.files })?;
        writeln!(writer).map_err(ReleaseError::io(&path))?;
        let written = writer.into_inner().map_err(|e| ReleaseError::io(&path)(e.into_error()))?;
        let (file, _, sha256) = written.finish();
        file.sync_all().map_err(ReleaseError::io(&path))?;
        Ok(sha256)
    }

    /// Writes manifest and checksums, syncs the folders to disk (each file was synced when it was added) and gives the release its name. An
    /// existing release is replaced. Returns the manifest without its list of files.
    ///
    /// # Errors
    /// [`ReleaseError::Occupied`] if `dest` holds files that are not a release; the file system failed.
    pub fn seal(mut self, dest: &Path) -> Result<Manifest, ReleaseError> {
        check_dest(dest)?;
        remove_empty_folders(self.staging())?;
        let sha256 = self.write_manifest()?;
        self.write_sums(&sha256)?;
        sync_folders(self.staging())?;
        self.staging.put_in_place(dest)?;
        Ok(self.manifest)
    }

    /// Writes the checksums of the files, which are sorted, and of the manifest.
    fn write_sums(&self, manifest_sha256: &str) -> Result<(), ReleaseError> {
        let path = self.staging().join(SUMS);
        let files = self.files.iter().map(|file| (file.path(), file.sha256()));
        let written = AtomicFile::create(&DraftFile::at(&path)).and_then(|mut out| {
            write_sums(&mut out, files, manifest_sha256)?;
            out.commit()
        });
        written.map_err(ReleaseError::io(&path))
    }
}

/// Writes the lines of `SHA256SUMS`: every file, which come sorted by path, and the manifest in its place among them.
pub(super) fn write_sums<'a>(
    out: &mut impl Write,
    files: impl Iterator<Item = (&'a str, &'a str)>,
    manifest_sha256: &str,
) -> io::Result<()> {
    let mut manifest = Some((MANIFEST, manifest_sha256));
    for (path, sha256) in files {
        if let Some((name, own)) = manifest.take_if(|(name, _)| *name < path) {
            writeln!(out, "{own}  {name}")?;
        }
        writeln!(out, "{sha256}  {path}")?;
    }
    manifest.into_iter().try_for_each(|(name, own)| writeln!(out, "{own}  {name}"))
}

/// True for a folder with manifest and checksums, which a release has even if it is damaged or of a later version.
pub fn may_be_one(folder: &Path) -> bool {
    [MANIFEST, SUMS].iter().all(|name| folder.join(name).is_file())
}

/// Refuses a destination that holds files that are not a release.
fn check_dest(dest: &Path) -> Result<(), ReleaseError> {
    let occupied = || ReleaseError::Occupied { path: dest.to_owned() };
    match fs::read_dir(dest).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) if may_be_one(dest) => Ok(()),
        Ok(false) => for_each_artifact(dest, drop).map(drop).map_err(|_| occupied()),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
        Err(e) if e.kind() == ErrorKind::NotADirectory => Err(occupied()),
        Err(e) => Err(ReleaseError::io(dest)(e)),
    }
}

/// `.sastrugi-<role>-<name of dest>` in the same folder, for a link to a folder beside that folder: a name that no user's folder should have.
pub fn beside(dest: &Path, role: &str) -> PathBuf {
    let dest = behind_link(dest);
    let mut name = OsString::from(format!(".sastrugi-{role}-"));
    name.push(dest.file_name().unwrap_or_else(|| "release".as_ref()));
    dest.with_file_name(name)
}

/// The destination itself, or the folder that it links to: the link stays, and that folder is replaced.
pub fn behind_link(dest: &Path) -> PathBuf {
    // Without a final `/`, behind which the system sees the folder, not the link.
    let dest: PathBuf = dest.components().collect();
    if dest.is_symlink() { dest.canonicalize().unwrap_or(dest) } else { dest }
}

fn remove_folder(folder: &Path) -> Result<(), ReleaseError> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(ReleaseError::io(folder)(e)),
        _ => Ok(()),
    }
}

/// Removes empty subfolders, such as those of tables without rows.
fn remove_empty_folders(folder: &Path) -> Result<(), ReleaseError> {
    for entry in fs::read_dir(folder).map_err(ReleaseError::io(folder))? {
        let entry = entry.map_err(ReleaseError::io(folder))?;
        if entry.file_type().map_err(ReleaseError::io(folder))?.is_dir() {
            let path = entry.path();
            remove_empty_folders(&path)?;
            match fs::remove_dir(&path) {
                Err(e) if e.kind() != ErrorKind::DirectoryNotEmpty => return Err(ReleaseError::io(&path)(e)),
                _ => {}
            }
        }
    }
    Ok(())
}

/// A folder under construction, `.sastrugi-assembling-<dest>`: removed on drop unless it has been put in place.
#[derive(Debug)]
pub struct Staging(PathBuf);

impl Staging {
    /// Creates an empty folder next to the destination; remains of a killed run are removed.
    ///
    /// # Errors
    /// The file system failed.
    pub fn beside(dest: &Path) -> Result<Self, ReleaseError> {
        let staging = Self(beside(dest, "assembling"));
        remove_folder(staging.path())?;
        fs::create_dir_all(staging.path()).map_err(ReleaseError::io(staging.path()))?;
        Ok(staging)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Renames the finished folder to its final name, replacing a previous one, which stays until then. Of a link to a folder, that folder is
    /// replaced.
    ///
    /// # Errors
    /// The file system failed.
    pub fn put_in_place(&self, dest: &Path) -> Result<(), ReleaseError> {
        let dest = &behind_link(dest);
        let aside = beside(dest, "replaced");
        remove_folder(&aside)?;
        if dest.exists() {
            fs::rename(dest, &aside).map_err(ReleaseError::io(dest))?;
        }
        fs::rename(self.path(), dest).map_err(|e| {
            // If this fails as well, the previous release keeps its temporary name.
            let _ = fs::rename(&aside, dest);
            ReleaseError::io(dest)(e)
        })?;
        let parent = match dest.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        sync_folder(parent).map_err(ReleaseError::io(parent))?;
        remove_folder(&aside)
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // If this fails, the next run removes the folder.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Writes a file of the folder under construction and syncs it to disk.
fn write(path: &Path, text: &str) -> Result<(), ReleaseError> {
    atomic::write(&DraftFile::at(path), text.as_bytes()).map_err(ReleaseError::io(path))
}

/// Syncs every folder of a tree to disk.
fn sync_folders(folder: &Path) -> Result<(), ReleaseError> {
    let entries =
        fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>).map_err(ReleaseError::io(folder))?;
    entries.par_iter().try_for_each(|entry| {
        let path = entry.path();
        let kind = entry.file_type().map_err(ReleaseError::io(&path))?;
        if kind.is_dir() { sync_folders(&path) } else { Ok(()) }
    })?;
    sync_folder(folder).map_err(ReleaseError::io(folder))
}

/// Syncs every file and folder of a tree to disk.
pub(crate) fn sync_tree(folder: &Path) -> Result<(), ReleaseError> {
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
