//! Tile records on disk: one file per tile, `ab/<hash>.tile`.
//!
//! A record is written under a temporary name and renamed when it is complete and on disk. It is used only if its checksum and its key match; a
//! damaged record is removed and regenerated. The folder is its own index. Several processes may share a folder: each may add and remove records at
//! any time, one at a time evicts, and a record that has been removed is regenerated. The least recently used records are evicted first, by file
//! modification time.

use super::record;
use super::{LibraryError, TileKey};
use crate::samples::Samples;
use sastrugi_store::{atomic, file};
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime};

/// Identifies the folder as a tile library.
const MARKER: &str = "sastrugi-library.json";
const MARKER_TEXT: &str = "{\"program\":\"sastrugi\",\"library\":1}\n";
/// Tells backup programs that everything in the folder can be regenerated.
const CACHE_TAG: &str = "CACHEDIR.TAG";
const CACHE_TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n";
/// How long a process waits for another that is evicting.
const PATIENCE: Duration = Duration::from_secs(1);
/// Block size of the file system, bytes.
const BLOCK: u64 = 4096;
/// Held by the process that is evicting.
const LOCK: &str = "lock";
const ENDING: &str = "tile";
/// The modification time of a record is updated at most this often.
const TOUCH: Duration = Duration::from_secs(60);

/// The records of a folder.
pub struct Disk {
    folder: PathBuf,
    limit: u64,
    /// Size of all records, as far as this process knows.
    bytes: AtomicU64,
    /// Size of the records written by this process since it last scanned the folder.
    own: AtomicU64,
    pub(super) damaged: AtomicU64,
    evicted: AtomicU64,
    unwritten: AtomicU64,
    warned: Once,
}

struct Record {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

impl Disk {
    /// Opens a folder; creates it if it is missing.
    pub fn open(folder: &Path, limit: u64) -> Result<Self, LibraryError> {
        let at = |path: &Path| {
            let path = path.to_owned();
            move |source| LibraryError::Io { path, source }
        };
        // A dangling link is refused too.
        if folder.symlink_metadata().is_ok() && !folder.is_dir() {
            return Err(LibraryError::NoFolder(folder.to_owned()));
        }
        fs::create_dir_all(folder).map_err(at(folder))?;
        let marker = folder.join(MARKER);
        if !marker.is_file() {
            let mut entries = fs::read_dir(folder).map_err(at(folder))?;
            let foreign = |entry: &io::Result<fs::DirEntry>| {
                // Another process may be writing the marker.
                entry.as_ref().is_ok_and(|e| {
                    !atomic::is_temporary(&e.file_name()) && e.file_name() != MARKER && e.file_name() != CACHE_TAG
                })
            };
            if entries.any(|entry| foreign(&entry)) {
                return Err(LibraryError::Occupied(folder.to_owned()));
            }
            atomic::write(&folder.join(CACHE_TAG), CACHE_TAG_TEXT.as_bytes()).map_err(at(folder))?;
            atomic::write(&marker, MARKER_TEXT.as_bytes()).map_err(at(&marker))?;
        }
        if file::read(&marker).map_err(at(&marker))? != MARKER_TEXT.as_bytes() {
            return Err(LibraryError::Version(folder.to_owned()));
        }
        atomic::clear_leftovers(&marker);
        for shelf in shelves(folder) {
            atomic::clear_leftovers(&shelf.join("any"));
        }
        let bytes = records(folder).iter().map(|r| r.bytes).sum();
        let zero = || AtomicU64::new(0);
        let disk = Self {
            folder: folder.to_owned(),
            limit,
            bytes: AtomicU64::new(bytes),
            own: zero(),
            damaged: zero(),
            evicted: zero(),
            unwritten: zero(),
            warned: Once::new(),
        };
        disk.make_room();
        Ok(disk)
    }

    pub(super) fn path(&self, key: &TileKey) -> PathBuf {
        let name = blake3::Hash::from(key.digest).to_hex();
        self.folder.join(&name[..2]).join(format!("{name}.{ENDING}"))
    }

    /// Whether a key has a record, intact or not.
    pub fn has(&self, key: &TileKey) -> bool {
        self.path(key).is_file()
    }

    /// The tile of a key, if it has an intact record.
    pub fn read(&self, key: &TileKey) -> Option<Samples> {
        let path = self.path(key);
        let bytes = file::read(&path).ok()?;
        let tile = record::decode(&key.text, &bytes);
        if tile.is_none() {
            self.damaged.fetch_add(1, Ordering::Relaxed);
            tracing::warn!(record = %path.display(), "damaged tile record; it will be regenerated");
            if fs::remove_file(&path).is_ok() {
                self.forget(on_disk(bytes.len() as u64));
            }
            return None;
        }
        touch(&path);
        tile
    }

    /// Writes a record. Failure is not an error: the tile is regenerated when it is next requested.
    pub fn write(&self, key: &TileKey, tile: &Samples) {
        let bytes = record::encode(&key.text, tile);
        if on_disk(bytes.len() as u64) > self.limit {
            return;
        }
        match atomic::write(&self.path(key), &bytes) {
            Ok(()) => {
                let written = on_disk(bytes.len() as u64);
                self.bytes.fetch_add(written, Ordering::Relaxed);
                self.own.fetch_add(written, Ordering::Relaxed);
                self.make_room();
            }
            Err(error) => {
                self.unwritten.fetch_add(1, Ordering::Relaxed);
                let folder = self.folder.display();
                self.warned.call_once(
                    || tracing::warn!(%folder, %error, "tiles cannot be written to the library; serving continues without it"),
                );
            }
        }
    }

    fn forget(&self, bytes: u64) {
        // Another process may have counted it differently.
        let less = |known: u64| Some(known.saturating_sub(bytes));
        let _ = self.bytes.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }

    /// Whether the limit is exceeded, or this process has written a sixteenth of it since its last scan; other processes may have written too.
    fn is_due(&self) -> bool {
        self.bytes.load(Ordering::Relaxed) > self.limit || self.own.load(Ordering::Relaxed) > self.limit / 16
    }

    /// Evicts the least recently used records down to nine tenths of the limit once they exceed it. One process evicts at a time; the others wait,
    /// because records written meanwhile would not be counted.
    fn make_room(&self) {
        if !self.is_due() {
            return;
        }
        let Ok(lock) = File::options().create(true).truncate(false).write(true).open(self.folder.join(LOCK)) else {
            return;
        };
        // Another thread may have evicted meanwhile.
        if !is_locked(&lock) || !self.is_due() {
            return;
        }
        self.own.store(0, Ordering::Relaxed);
        let mut all = records(&self.folder);
        all.sort_by(|a, b| a.used.cmp(&b.used).then_with(|| a.path.cmp(&b.path)));
        let mut bytes: u64 = all.iter().map(|r| r.bytes).sum();
        if bytes > self.limit {
            for record in &all {
                if bytes <= self.limit / 10 * 9 {
                    break;
                }
                if fs::remove_file(&record.path).is_ok() {
                    self.evicted.fetch_add(1, Ordering::Relaxed);
                }
                bytes -= record.bytes;
            }
        }
        self.bytes.store(bytes, Ordering::Relaxed);
    }

    /// Numbers of damaged, evicted and unwritten records, and bytes on disk.
    pub fn counts(&self) -> [u64; 4] {
        [&self.damaged, &self.evicted, &self.unwritten, &self.bytes].map(|n| n.load(Ordering::Relaxed))
    }
}

/// Locks a file that is normally held only briefly; false if it stays locked, for example by a suspended process.
fn is_locked(file: &File) -> bool {
    let start = Instant::now();
    loop {
        match file.try_lock() {
            // On a file system without locks, two processes may evict at once and remove more than necessary.
            Ok(()) | Err(TryLockError::Error(_)) => return true,
            Err(TryLockError::WouldBlock) if start.elapsed() > PATIENCE => return false,
            Err(TryLockError::WouldBlock) => std::thread::sleep(PATIENCE / 500),
        }
    }
}

/// Bytes that a file occupies on disk, in blocks.
fn on_disk(length: u64) -> u64 {
    length.next_multiple_of(BLOCK)
}

/// Updates the modification time of a record.
fn touch(path: &Path) {
    let now = SystemTime::now();
    let stale = |used: SystemTime| now.duration_since(used).is_ok_and(|age| age > TOUCH);
    if fs::metadata(path).and_then(|m| m.modified()).is_ok_and(stale) {
        // If this fails, the record is only evicted sooner.
        let _ = File::options().write(true).open(path).and_then(|file| file.set_modified(now));
    }
}

/// The subfolders that hold records.
fn shelves(folder: &Path) -> Vec<PathBuf> {
    let is_shelf = |name: &str| name.len() == 2 && name.bytes().all(|b| b.is_ascii_hexdigit());
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|e| e.file_name().to_str().is_some_and(is_shelf)).map(|e| e.path()).collect()
}

fn records(folder: &Path) -> Vec<Record> {
    let entries = shelves(folder).into_iter().flat_map(|shelf| fs::read_dir(shelf).into_iter().flatten().flatten());
    let record = |entry: fs::DirEntry| {
        let path = entry.path();
        let is_record = path.extension().is_some_and(|e| e == ENDING);
        let meta = entry.metadata().ok().filter(|m| is_record && m.is_file())?;
        Some(Record { path, bytes: on_disk(meta.len()), used: meta.modified().ok()? })
    };
    entries.filter_map(record).collect()
}
