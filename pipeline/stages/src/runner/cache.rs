//! The work area: finished items by key, each in a folder that appears whole or not at all.
//!
//! `items/<stage>/<id>/<key>/` holds an item's files and `record.json`. A job writes into a folder with a name that no
//! reader takes for a result; every file is flushed as it is written, the record comes last, then the folder, and one
//! rename makes it a result.

use super::graph::{Graph, Ingredients};
use super::lock;
use crate::job::{ItemRef, Outcome, Product};
use sastrugi_store::atomic::{self, Draft};
use sastrugi_store::digest;
use sastrugi_store::release::check_path;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

const RECORD: &str = "record.json";
const FAILURE: &str = "failure.json";
/// File that marks a work area.
const MARK: &str = "CACHEDIR.TAG";
/// Its text: backups leave such folders out (Cache Directory Tagging Specification).
const MARK_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Work area of sastrugi: finished items of a study. It can be removed; \
    a run then makes them again.\n";
/// Hexadecimal digits of a key.
const KEY_DIGITS: usize = 32;
/// Start of the name of a folder that a job writes into.
const UNFINISHED: &str = "unfinished-";

/// A finished item.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// Its name.
    pub item: ItemRef,
    /// Its key.
    pub key: String,
    /// What the key is made of.
    pub ingredients: Ingredients,
    /// Its files.
    pub files: Vec<StoredFile>,
    /// Sentences that a reader must know.
    pub notes: Vec<String>,
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
    /// What it is.
    #[serde(flatten)]
    pub product: Product,
    /// Length, bytes.
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
    /// The folder holds something else.
    #[error("{0}: not a sastrugi work area, and not empty; choose another folder with --work")]
    NotOurs(PathBuf),
    /// A symbolic link where the work area has folders of its own.
    #[error("{0} is a symbolic link, which a work area cannot contain; remove it or choose another folder with --work")]
    Link(PathBuf),
    /// The file system refused.
    #[error("{action} {path}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// Why not.
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
    _lock: Option<File>,
}

impl Cache {
    /// Opens or makes a work area, takes its lock, and clears what killed runs left unfinished.
    ///
    /// # Errors
    /// When the folder holds anything but a work area, another run holds it, or the file system refuses.
    pub fn open(folder: &Path) -> Result<Self, CacheError> {
        mark(folder)?;
        let path = folder.join("lock");
        let lock = lock::take(&path).map_err(io_error("cannot lock", &path))?;
        let lock = lock.ok_or_else(|| CacheError::Busy(folder.to_owned()))?;
        let cache = Self { folder: folder.to_owned(), _lock: Some(lock) };
        cache.for_each_result(
            |path, name| if name.starts_with(UNFINISHED) { fs::remove_dir_all(path) } else { Ok(()) },
        )?;
        Ok(cache)
    }

    /// A work area to look at, whoever is writing to it; nothing in it changes.
    pub fn look(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), _lock: None }
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

    /// The record of a result, if it is there and its files have their lengths.
    pub fn load(&self, item: &ItemRef, key: &str) -> Option<Record> {
        load_record(&self.result_folder(item, key))
    }

    /// True when [`Self::load`] finds a result.
    pub fn holds(&self, item: &ItemRef, key: &str) -> bool {
        self.load(item, key).is_some()
    }

    /// True when the item was tried before, with whatever key.
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

    /// Why an item failed when it was last tried with this key.
    pub fn failure(&self, item: &ItemRef, key: &str) -> Option<String> {
        let failed: Failed = read_json(&self.item_folder(item).join(FAILURE))?;
        (failed.key == key).then_some(failed.message)
    }

    /// Keeps the reason of a failure for the next plan.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn keep_failure(&self, item: &ItemRef, key: &str, message: &str) -> Result<(), CacheError> {
        let path = self.item_folder(item).join(FAILURE);
        let failed = Failed { key: key.to_owned(), message: message.to_owned() };
        let text = serde_json::to_vec(&failed).map_err(|e| io_error("cannot encode", &path)(e.into()))?;
        atomic::write(&path, &text).map_err(io_error("cannot write", &path))
    }

    /// A fresh folder for a job to write into.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn begin(&self, item: &ItemRef, key: &str) -> Result<PathBuf, CacheError> {
        let folder = self.item_folder(item).join(format!("{UNFINISHED}{key}"));
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(io_error("cannot clear", &folder))?;
        }
        fs::create_dir_all(&folder).map_err(io_error("cannot make", &folder))?;
        Ok(folder)
    }

    /// Makes a job's folder a result.
    ///
    /// # Errors
    /// When a product is missing, or the file system refuses.
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
        let target = self.result_folder(&record.item, &record.key);
        if target.exists() {
            fs::remove_dir_all(&target).map_err(io_error("cannot clear", &target))?;
        }
        let parent = self.item_folder(&record.item);
        atomic::sync_folder(folder).map_err(io_error("cannot flush", folder))?;
        fs::rename(folder, &target).map_err(io_error("cannot rename to", &target))?;
        atomic::sync_folder(&parent).map_err(io_error("cannot flush", &parent))?;
        Ok(record)
    }

    /// Drops every result that no item of the graph has.
    ///
    /// # Errors
    /// When the file system refuses.
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

/// Makes a folder a work area. Only in such folders anything is ever removed.
fn mark(folder: &Path) -> Result<(), CacheError> {
    fs::create_dir_all(folder).map_err(io_error("cannot make the work area", folder))?;
    let path = folder.join(MARK);
    match fs::read(&path) {
        Ok(text) if text == MARK_TEXT.as_bytes() => return Ok(()),
        Ok(_) => return Err(CacheError::NotOurs(folder.to_owned())),
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(io_error("cannot read", &path)(e)),
    }
    let entries = fs::read_dir(folder).map_err(io_error("cannot list", folder))?;
    // Another run may be marking it.
    if entries.flatten().any(|entry| !atomic::is_temporary(&entry.file_name())) && !path.exists() {
        return Err(CacheError::NotOurs(folder.to_owned()));
    }
    atomic::write(&path, MARK_TEXT.as_bytes()).map_err(io_error("cannot write", &path))
}

/// True for the name of a result's folder, or of one that a job writes into.
fn is_result(name: &str) -> bool {
    let key = name.strip_prefix(UNFINISHED).unwrap_or(name);
    key.len() == KEY_DIGITS && key.bytes().all(|b| b.is_ascii_hexdigit())
}

/// Folders below a folder, sorted; none when it is not there. Links are not followed: what they lead to is not ours.
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

/// The record in a result's folder, if it is whole and the files have their lengths.
pub fn load_record(folder: &Path) -> Option<Record> {
    let record: Record = read_json(&folder.join(RECORD))?;
    are_whole(folder, &record.files).then_some(record)
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// True when all files are there, in the folder itself, with their lengths.
fn are_whole(folder: &Path, files: &[StoredFile]) -> bool {
    let whole = |f: &StoredFile| {
        let found = || fs::symlink_metadata(folder.join(&f.product.file));
        check_path(&f.product.file).is_ok() && found().is_ok_and(|m| m.is_file() && m.len() == f.bytes)
    };
    files.iter().all(whole)
}

fn stored(folder: &Path, product: Product) -> Result<StoredFile, CacheError> {
    let path = folder.join(&product.file);
    let (bytes, sha256) = digest::of_file(&path).map_err(io_error("cannot read back", &path))?;
    Ok(StoredFile { product, bytes, sha256 })
}
