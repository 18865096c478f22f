//! The work area: finished items by key, each in a folder that appears complete or not at all.
//!
//! `items/<stage>/<id>/<key>/` holds the files of an item and `record.json`. A job writes into a folder whose name marks it as
//! unfinished. Every file is flushed as it is written, the record last, then the folder; a single rename then turns the folder
//! into a result.

use super::damage::Changed;
use super::graph::{Graph, Ingredients};
use super::lock;
use super::shared::Sharing;
use crate::error::Error;
use crate::job::{ItemRef, Outcome, Product};
use sastrugi_store::atomic::{self, Draft};
use sastrugi_store::release::check_path;
use sastrugi_store::{digest, file};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// The record in the folder of a result.
pub const RECORD: &str = "record.json";
const FAILURE: &str = "failure.json";
/// File that marks a work area.
const MARK: &str = "CACHEDIR.TAG";
/// Its text; backup programs skip folders marked like this (Cache Directory Tagging Specification). Work areas are recognised by the exact
/// text, so it must not change.
const MARK_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Work area of sastrugi: finished items of a study. It can be removed; \
    a run then makes them again.\n";
/// Hexadecimal digits of a key.
pub(super) const KEY_DIGITS: usize = 32;
/// Prefix of the name of a folder that a job writes into.
const UNFINISHED: &str = "unfinished-";

/// A finished item.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// Its name.
    pub item: ItemRef,
    /// Its key.
    pub key: String,
    /// The inputs of its key.
    pub ingredients: Ingredients,
    /// Its files.
    pub files: Vec<StoredFile>,
    /// Its notes.
    pub notes: Vec<String>,
}

impl Record {
    /// Names of the files of its folder, the record last.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|f| f.product.file.as_str()).chain([RECORD])
    }
}

/// The last failure of an item.
#[derive(Debug, Serialize, Deserialize)]
struct Failed {
    key: String,
    message: String,
}

/// A file of a finished item.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredFile {
    /// The product stored in it.
    #[serde(flatten)]
    pub product: Product,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 of the bytes.
    pub sha256: String,
}

/// Why the work area cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CacheError {
    /// Another run holds it.
    #[error("another run is using {0}; wait for it or choose another folder with --work")]
    Busy(PathBuf),
    /// The folder contains other files.
    #[error("{0} is neither empty nor a sastrugi work area; choose another folder with --work")]
    NotOurs(PathBuf),
    /// A symbolic link in place of a folder of the work area.
    #[error("{0} is a symbolic link, which a work area cannot contain; remove it or choose another folder with --work")]
    Link(PathBuf),
    /// An I/O error.
    #[error("{action} {path}: {source}")]
    Io {
        /// The action that failed.
        action: &'static str,
        /// The path.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

fn io_error<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> CacheError + 'a {
    move |source| CacheError::Io { action, path: path.to_owned(), source }
}

/// An open work area; one process at a time may write to it.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    sharing: Option<Sharing>,
    _lock: Option<File>,
}

impl Cache {
    /// Opens or creates a work area, takes its lock, and removes unfinished results of killed runs.
    ///
    /// # Errors
    /// When the folder contains anything other than a work area, another run holds its lock, or an I/O error occurs.
    pub fn open(folder: &Path) -> Result<Self, CacheError> {
        mark(folder)?;
        let path = folder.join("lock");
        let lock = lock::take(&path).map_err(io_error("cannot lock", &path))?;
        let lock = lock.ok_or_else(|| CacheError::Busy(folder.to_owned()))?;
        let cache = Self { folder: folder.to_owned(), sharing: None, _lock: Some(lock) };
        cache.for_each_result(
            |path, name| if name.starts_with(UNFINISHED) { fs::remove_dir_all(path) } else { Ok(()) },
        )?;
        Ok(cache)
    }

    /// Opens a work area read-only, without taking its lock.
    pub fn look(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), sharing: None, _lock: None }
    }

    /// The same work area with a shared cache behind it.
    pub fn sharing(self, sharing: Option<Sharing>) -> Self {
        Self { sharing, ..self }
    }

    /// The shared cache behind it.
    pub fn shared(&self) -> Option<&Sharing> {
        self.sharing.as_ref()
    }

    /// Copies a result from the shared cache, if it has an intact one.
    pub fn fetch(&self, item: &ItemRef, key: &str) -> Option<Record> {
        let sharing = self.sharing.as_ref()?;
        // Errors of the work area return when the item is computed.
        let folder = self.begin(item, key).ok()?;
        let record = sharing.fetch(item, key, Draft(&folder))?;
        self.put_in_place(&folder, &record).ok()?;
        Some(record)
    }

    /// Offers a result that was just computed to the shared cache.
    pub fn publish(&self, record: &Record) {
        if let Some(sharing) = &self.sharing {
            sharing.publish(record, &self.result_folder(&record.item, &record.key));
        }
    }

    /// Offers a result of an earlier run to the shared cache. One that changed since is removed instead.
    pub fn publish_earlier(&self, record: &Record) {
        if let Some(sharing) = &self.sharing {
            sharing.publish_earlier(record, &self.result_folder(&record.item, &record.key));
        }
    }

    /// The work area's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn item_folder(&self, item: &ItemRef) -> PathBuf {
        self.folder.join("items").join(&item.stage).join(&item.id)
    }

    /// Folder of a result.
    pub fn result_folder(&self, item: &ItemRef, key: &str) -> PathBuf {
        self.item_folder(item).join(key)
    }

    /// The record of a result, if it exists and its files have the recorded sizes.
    pub fn load(&self, item: &ItemRef, key: &str) -> Option<Record> {
        load_record(&self.result_folder(item, key))
    }

    /// True if [`Self::load`] finds a result.
    pub fn holds(&self, item: &ItemRef, key: &str) -> bool {
        self.load(item, key).is_some()
    }

    /// True if no item was tried yet.
    pub fn is_empty(&self) -> bool {
        !self.folder.join("items").exists()
    }

    /// True if the item was tried before, with any key.
    pub fn knows(&self, item: &ItemRef) -> bool {
        self.item_folder(item).exists()
    }

    /// The ingredients of any earlier result of this item.
    pub fn earlier(&self, item: &ItemRef) -> Option<Ingredients> {
        let mut folders: Vec<PathBuf> =
            fs::read_dir(self.item_folder(item)).ok()?.flatten().map(|e| e.path()).collect();
        folders.sort();
        folders.iter().find_map(|folder| load_record(folder)).map(|record| record.ingredients)
    }

    /// The message with which an item last failed, if it was tried with this key.
    pub fn failure(&self, item: &ItemRef, key: &str) -> Option<String> {
        let failed: Failed = read_json(&self.item_folder(item).join(FAILURE))?;
        (failed.key == key).then_some(failed.message)
    }

    /// Stores the message of a failure for the next plan.
    ///
    /// # Errors
    /// I/O errors.
    pub fn keep_failure(&self, item: &ItemRef, key: &str, message: &str) -> Result<(), CacheError> {
        let path = self.item_folder(item).join(FAILURE);
        let failed = Failed { key: key.to_owned(), message: message.to_owned() };
        let text = serde_json::to_vec(&failed).map_err(|e| io_error("cannot encode", &path)(e.into()))?;
        atomic::write(&path, &text).map_err(io_error("cannot write", &path))
    }

    /// Creates an empty folder for a job to write into.
    ///
    /// # Errors
    /// I/O errors.
    pub fn begin(&self, item: &ItemRef, key: &str) -> Result<PathBuf, CacheError> {
        let folder = self.item_folder(item).join(format!("{UNFINISHED}{key}"));
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(io_error("cannot clear", &folder))?;
        }
        fs::create_dir_all(&folder).map_err(io_error("cannot create", &folder))?;
        Ok(folder)
    }

    /// Turns the folder of a job into a result.
    ///
    /// # Errors
    /// When a product is missing, or an I/O error occurs.
    pub fn finish(
        &self,
        graph: &Graph,
        position: usize,
        folder: &Path,
        outcome: Outcome,
    ) -> Result<Record, CacheError> {
        let item = graph.node(position).item.clone();
        let key = graph.key(position).to_owned();
        let files = outcome.products.into_iter().map(|p| stored(folder, p)).collect::<Result<Vec<_>, _>>()?;
        let ingredients = graph.ingredients(position);
        let record = Record { item, key, ingredients, files, notes: outcome.notes };
        let path = folder.join(RECORD);
        let text = serde_json::to_vec(&record).map_err(|e| io_error("cannot encode", &path)(e.into()))?;
        atomic::write(&Draft(folder).file(RECORD), &text).map_err(io_error("cannot write", &path))?;
        self.put_in_place(folder, &record)?;
        Ok(record)
    }

    /// Gives a complete folder the name of its result.
    fn put_in_place(&self, folder: &Path, record: &Record) -> Result<(), CacheError> {
        let target = self.result_folder(&record.item, &record.key);
        if target.exists() {
            fs::remove_dir_all(&target).map_err(io_error("cannot clear", &target))?;
        }
        let parent = self.item_folder(&record.item);
        atomic::sync_folder(folder).map_err(io_error("cannot flush", folder))?;
        fs::rename(folder, &target).map_err(io_error("cannot rename to", &target))?;
        atomic::sync_folder(&parent).map_err(io_error("cannot flush", &parent))
    }

    /// Removes every result that does not belong to an item of the graph. Returns their number.
    ///
    /// # Errors
    /// I/O errors.
    pub fn drop_orphans(&self, graph: &Graph) -> Result<usize, CacheError> {
        let keys: std::collections::BTreeSet<PathBuf> =
            (0..graph.len()).map(|p| self.result_folder(&graph.node(p).item, graph.key(p))).collect();
        let mut dropped = 0;
        self.for_each_result(|path, _| {
            if keys.contains(path) {
                return Ok(());
            }
            dropped += 1;
            fs::remove_dir_all(path)
        })?;
        Ok(dropped)
    }

    fn for_each_result(&self, mut f: impl FnMut(&Path, &str) -> io::Result<()>) -> Result<(), CacheError> {
        for stage in children(&self.folder.join("items"))? {
            for item in children(&stage)? {
                for result in children(&item)? {
                    let name = result.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    if !is_result(&name) {
                        continue;
                    }
                    f(&result, &name).map_err(io_error("cannot remove", &result))?;
                }
            }
        }
        Ok(())
    }
}

/// Marks a folder as a work area. Files are only ever removed from marked folders.
fn mark(folder: &Path) -> Result<(), CacheError> {
    fs::create_dir_all(folder).map_err(io_error("cannot create the work area", folder))?;
    let path = folder.join(MARK);
    match file::read(&path) {
        Ok(text) if text == MARK_TEXT.as_bytes() => return Ok(()),
        Ok(_) => return Err(CacheError::NotOurs(folder.to_owned())),
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(io_error("cannot read", &path)(e)),
    }
    let entries = fs::read_dir(folder).map_err(io_error("cannot list", folder))?;
    // Another run may be marking the folder at the same time.
    if entries.flatten().any(|entry| !atomic::is_temporary(&entry.file_name())) && !path.exists() {
        return Err(CacheError::NotOurs(folder.to_owned()));
    }
    atomic::write(&path, MARK_TEXT.as_bytes()).map_err(io_error("cannot write", &path))
}

/// True for the name of a folder with a result, finished or unfinished.
fn is_result(name: &str) -> bool {
    is_key(name.strip_prefix(UNFINISHED).unwrap_or(name))
}

/// True for the form of a key.
pub fn is_key(key: &str) -> bool {
    key.len() == KEY_DIGITS && key.bytes().all(|b| b.is_ascii_hexdigit())
}

/// Subfolders of a folder, sorted; empty if the folder does not exist. Links are refused, because their targets are not part of the work area.
fn children(folder: &Path) -> Result<Vec<PathBuf>, CacheError> {
    if fs::symlink_metadata(folder).is_ok_and(|there| there.is_symlink()) {
        return Err(CacheError::Link(folder.to_owned()));
    }
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(io_error("cannot list", folder)(e)),
    };
    let mut paths = Vec::new();
    for entry in entries {
        let entry = entry.map_err(io_error("cannot list", folder))?;
        let kind = entry.file_type().map_err(io_error("cannot list", folder))?;
        match () {
            () if kind.is_symlink() => return Err(CacheError::Link(entry.path())),
            () if kind.is_dir() => paths.push(entry.path()),
            () => {}
        }
    }
    paths.sort();
    Ok(paths)
}

/// The record in the folder of a result, if it is complete and the files have the recorded sizes.
pub fn load_record(folder: &Path) -> Option<Record> {
    let record: Record = read_json(&folder.join(RECORD))?;
    are_complete(folder, &record.files).then_some(record)
}

/// True if every file of a result has its recorded hash; the result is noted otherwise.
///
/// # Errors
/// I/O errors.
pub fn is_unchanged(record: &Record, folder: &Path, changed: &Changed) -> Result<bool, Error> {
    for file in &record.files {
        let path = folder.join(&file.product.file);
        let (_, sha256) = digest::of_file(&path).map_err(|e| Error::at(&path, e))?;
        if sha256 != file.sha256 {
            changed.note(folder, &record.item, &file.product.file);
            return Ok(false);
        }
    }
    Ok(true)
}

/// Copies the files of a result and then its record into an existing folder, each flushed to disk. Shards and shared caches are copies,
/// because they are carried elsewhere or changed by others. A result that changed after it was written is noted instead.
///
/// # Errors
/// I/O errors.
pub fn copy_result(record: &Record, from: &Path, to: &Path, changed: &Changed) -> Result<(), Error> {
    if !is_unchanged(record, from, changed)? {
        return Ok(());
    }
    for name in record.names() {
        let target = to.join(name);
        fs::copy(from.join(name), &target)
            .and_then(|_| File::open(&target)?.sync_all())
            .map_err(|e| Error::at(&target, e))?;
    }
    Ok(())
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&file::read(path).ok()?).ok()
}

/// True if all files are in the folder itself and have the recorded sizes.
fn are_complete(folder: &Path, files: &[StoredFile]) -> bool {
    let complete = |f: &StoredFile| {
        let found = || fs::symlink_metadata(folder.join(&f.product.file));
        check_path(&f.product.file).is_ok() && found().is_ok_and(|m| m.is_file() && m.len() == f.bytes)
    };
    files.iter().all(complete)
}

fn stored(folder: &Path, product: Product) -> Result<StoredFile, CacheError> {
    let path = folder.join(&product.file);
    let (bytes, sha256) = digest::of_file(&path).map_err(io_error("cannot read back", &path))?;
    Ok(StoredFile { product, bytes, sha256 })
}
