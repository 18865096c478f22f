//! The shared cache: finished items by key, for any number of runs on any number of machines at the same time.
//!
//! An entry holds what the folder of a result in a work area holds: the files of an item and `record.json`. It is named by the item's key,
//! appears complete or not at all, and never changes. Two runs that publish the same item made the same bytes, so it does not matter who is
//! first. Nothing relies on locks, because network file systems and object stores do not offer them.
//!
//! An entry is used only if every file has the SHA-256 that the record states. A damaged entry counts as missing; the run that finds it
//! removes it, computes the item and publishes it again. The hashes find damage, not malice: whoever may write to a cache decides what its
//! readers get.
//!
//! A cache saves work and never changes results: a run computes what it cannot read, and notes what it cannot publish.

mod eviction;
mod folder;
mod objects;

pub use eviction::{DRAFT_AGE_MAX, Keep, Pruned, prune};
pub use folder::Folder;
pub use objects::Objects;

use super::cache::{RECORD, Record, is_key};
use crate::error::Error;
use crate::job::ItemRef;
use crate::remote::check_place;
use sastrugi_store::atomic::{AtomicFile, Draft};
use sastrugi_store::digest::Hashed;
use sastrugi_store::objects::Bucket;
use sastrugi_store::release::check_path;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::SystemTime;

/// Maximum number of problems that a run keeps.
const PROBLEMS_MAX: usize = 10;
/// Folder of the entries in a cache.
const ENTRIES: &str = "entries";

/// A place for entries. Names of entries are relative paths, `entries/<first two digits of the key>/<key>`.
pub trait Shared: Debug + Send + Sync {
    /// Copies a file of an entry; false if the file does not exist.
    ///
    /// # Errors
    /// The place cannot be read.
    fn read(&self, name: &str, file: &str, to: &mut dyn Write) -> Result<bool, Error>;

    /// Publishes the files in a folder as an entry; false if the entry exists already.
    ///
    /// # Errors
    /// The place cannot be written to; a result that changed after it was written, which is removed.
    fn publish(&self, name: &str, record: &Record, folder: &Path) -> Result<bool, Error>;

    /// Notes that an entry was used, where that is cheap and the place is not only read.
    fn mark_used(&self, name: &str) {
        let _ = name;
    }

    /// Removes an entry or a draft; success if it does not exist.
    ///
    /// # Errors
    /// The place cannot be written to.
    fn remove(&self, name: &str) -> Result<(), Error>;

    /// Everything in the place, in any order.
    ///
    /// # Errors
    /// The place cannot be read.
    fn list(&self) -> Result<Vec<Entry>, Error>;

    /// True if nothing is written to the place.
    fn is_read_only(&self) -> bool;
}

/// An entry, or something incomplete.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name.
    pub name: String,
    /// Size of its files, bytes.
    pub bytes: u64,
    /// Time of its last use; of its last change if it is a draft.
    pub used: SystemTime,
    /// False for an entry under construction, and for what a killed run left of one.
    pub is_complete: bool,
}

/// Opens the shared cache at a place: a bucket, `s3://bucket/prefix`, or a folder, which is created if it does not exist.
///
/// # Errors
/// A folder with other files, a bucket with a release there, or a place that cannot be used.
pub fn open(place: &str, read_only: bool) -> Result<Box<dyn Shared>, Error> {
    check_place(Path::new(place))?;
    if Bucket::is_address(place) {
        return Ok(Box::new(Objects::open(Bucket::open(place)?, read_only)?));
    }
    Ok(Box::new(Folder::open(Path::new(place), read_only)?))
}

/// Name of the entry of a key.
fn name_of(key: &str) -> String {
    let digits = key.get(..2).unwrap_or_default();
    format!("{ENTRIES}/{digits}/{key}")
}

/// True for the name of an entry, which ends in a key.
fn is_entry(name: &str) -> bool {
    name.rsplit('/').next().is_some_and(|key| is_key(key) && name_of(key) == name)
}

/// What a run did with its shared cache.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Items copied from it.
    pub fetched: usize,
    /// Items published to it.
    pub published: usize,
    /// Items whose entries were damaged; they were computed.
    pub damaged: BTreeSet<String>,
    /// Items whose results in the work area had changed after they were written; they were computed again.
    pub changed: BTreeSet<String>,
    /// Whether it was only read.
    pub read_only: bool,
    /// Why it could not be read or written: the first reasons, each once.
    pub problems: BTreeSet<String>,
}

/// A shared cache in use by a run.
#[derive(Debug)]
pub struct Sharing {
    place: Box<dyn Shared>,
    tally: Mutex<Tally>,
    /// The first problem that a retry cannot solve.
    lasting: OnceLock<String>,
}

/// What was found under a key.
enum Found {
    Intact(Box<Record>),
    Damaged,
    Nothing,
}

/// Why an entry could not be copied.
enum CopyError {
    /// The place could not be read.
    Place(Error),
    /// The work area could not be written to. The run meets that error again when it computes the item, and reports it then.
    WorkArea,
}

impl Sharing {
    /// Starts to use a cache.
    pub fn new(place: Box<dyn Shared>) -> Self {
        let tally = Tally { read_only: place.is_read_only(), ..Tally::default() };
        Self { place, tally: Mutex::new(tally), lasting: OnceLock::new() }
    }

    /// What has been done so far.
    pub fn tally(&self) -> Tally {
        self.lock().clone()
    }

    /// The first problem so far that a retry cannot solve, such as a missing permission.
    pub fn lasting_problem(&self) -> Option<&str> {
        self.lasting.get().map(String::as_str)
    }

    fn lock(&self) -> MutexGuard<'_, Tally> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Copies an intact entry into an empty folder. Without one, the folder may hold parts of an entry afterwards.
    pub fn fetch(&self, item: &ItemRef, key: &str, folder: Draft<'_>) -> Option<Record> {
        let name = name_of(key);
        let attempt = || copy(&*self.place, &name, item, key, folder);
        // An entry that is evicted while it is read, and perhaps published again, looks damaged once but not twice.
        let found = match attempt() {
            Ok(Found::Damaged) => attempt(),
            found => found,
        };
        match found {
            Ok(Found::Intact(record)) => {
                self.place.mark_used(&name);
                self.lock().fetched += 1;
                Some(*record)
            }
            Ok(Found::Damaged) => {
                self.lock().damaged.insert(item.to_string());
                if !self.place.is_read_only() {
                    self.note(self.place.remove(&name));
                }
                None
            }
            Ok(Found::Nothing) | Err(CopyError::WorkArea) => None,
            Err(CopyError::Place(error)) => {
                self.note::<()>(Err(error));
                None
            }
        }
    }

    /// Offers a result that was just computed to the cache.
    pub fn publish(&self, record: &Record, folder: &Path) {
        if !self.place.is_read_only() {
            self.count(self.place.publish(&name_of(&record.key), record, folder));
        }
    }

    /// Offers a result of an earlier run to the cache. One that changed since is removed instead, and then this run computes it again.
    pub fn publish_earlier(&self, record: &Record, folder: &Path) {
        if self.place.is_read_only() {
            return;
        }
        match self.place.publish(&name_of(&record.key), record, folder) {
            Err(_) if !folder.exists() => {
                self.lock().changed.insert(record.item.to_string());
            }
            published => self.count(published),
        }
    }

    /// Counts a result that was published, or keeps the reason why it was not.
    fn count(&self, published: Result<bool, Error>) {
        if self.note(published) == Some(true) {
            self.lock().published += 1;
        }
    }

    /// Keeps the message of an error.
    fn note<T>(&self, result: Result<T, Error>) -> Option<T> {
        let keep = |error: Error| {
            if !matches!(error, Error::Retry(_)) {
                // Only the first is kept.
                let _ = self.lasting.set(error.to_string());
            }
            let mut tally = self.lock();
            tally.problems.len() < PROBLEMS_MAX && tally.problems.insert(error.to_string())
        };
        result.map_err(keep).ok()
    }
}

/// Copies an entry into a folder, checking every file on the way.
fn copy(place: &dyn Shared, name: &str, item: &ItemRef, key: &str, folder: Draft<'_>) -> Result<Found, CopyError> {
    let mut text = Vec::new();
    if !place.read(name, RECORD, &mut text).map_err(CopyError::Place)? {
        return Ok(Found::Nothing);
    }
    let Some(record) = record_of(&text, item, key) else { return Ok(Found::Damaged) };
    for stored in &record.files {
        let file = &stored.product.file;
        if copy_file(place, name, file, folder)? != Some((stored.bytes, stored.sha256.clone())) {
            return Ok(Found::Damaged);
        }
    }
    sastrugi_store::atomic::write(&folder.file(RECORD), &text).map_err(|_| CopyError::WorkArea)?;
    Ok(Found::Intact(Box::new(record)))
}

/// The record of an item, if the text is one and names only files in its own folder.
fn record_of(text: &[u8], item: &ItemRef, key: &str) -> Option<Record> {
    let record: Record = serde_json::from_slice(text).ok()?;
    let stays = |file: &str| check_path(file).is_ok() && !file.contains('/') && file != RECORD;
    let is_own = record.item == *item && record.key == key && record.files.iter().all(|f| stays(&f.product.file));
    is_own.then_some(record)
}

/// Size and SHA-256 of a copied file; `None` if it does not exist.
fn copy_file(
    place: &dyn Shared,
    name: &str,
    file: &str,
    folder: Draft<'_>,
) -> Result<Option<(u64, String)>, CopyError> {
    let target = AtomicFile::create(&folder.file(file)).map_err(|_| CopyError::WorkArea)?;
    let refused = target.refused();
    let mut copied = Hashed::new(target);
    let is_there = place.read(name, file, &mut copied).map_err(|error| match refused.error() {
        Some(_) => CopyError::WorkArea,
        None => CopyError::Place(error),
    })?;
    if !is_there {
        return Ok(None);
    }
    let (target, bytes, sha256) = copied.finish();
    target.commit().map_err(|_| CopyError::WorkArea)?;
    Ok(Some((bytes, sha256)))
}
