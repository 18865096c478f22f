//! Tiles that were made once, in memory and on disk; each is made once however many ask for it.
//!
//! A request is answered from memory, from a record on disk (`disk`), or by generating the tile on a worker thread (`pool`). Records are read
//! by threads of their own, so that they do not queue behind tiles that take long. All that ask for one tile while it is on its way share one
//! flight. The flight belongs to none of them: whoever leaves, the others are served, and when the last has left the making is told to stop.

mod disk;
mod pool;
mod record;
#[cfg(test)]
mod tests;

pub use pool::Priority;

use crate::samples::Samples;
use disk::Disk;
use pool::Pool;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use tokio::sync::watch;

/// Fewer samples than these are not worth a record.
const RECORD_MIN: usize = 64;
/// Threads that read records.
const READERS: usize = 4;
/// Tiles that are known to have been asked for, beside those that are kept.
const ASKED: usize = 1 << 16;
/// Most records that wait for a reader.
const READS: usize = 4096;

/// What a tile is, as text that names all that its samples depend on. Its name is the hash of that text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileKey {
    text: String,
    digest: [u8; 32],
}

impl TileKey {
    /// The key of a canonical text.
    pub fn new(text: String) -> Self {
        let digest = *blake3::hash(text.as_bytes()).as_bytes();
        Self { text, digest }
    }
}

/// Where tiles are kept, and how many.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Folder of the records; tiles are kept in memory only without one.
    pub folder: Option<PathBuf>,
    /// Most bytes of records.
    pub disk_bytes: u64,
    /// Most bytes in memory.
    pub memory_bytes: u64,
    /// Threads that make tiles.
    pub workers: usize,
    /// Most tiles that wait for a worker.
    pub queue: usize,
}

/// Why there is no tile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unavailable {
    /// As many wait as may wait.
    #[error("too many tiles are queued")]
    Busy,
    /// Making it failed.
    #[error("the tile could not be generated: {0}")]
    Failed(String),
}

/// Why a library was not opened.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// The folder holds other things.
    #[error("{}: not empty, and not a tile library; choose another folder with --library", .0.display())]
    Occupied(PathBuf),
    /// The folder is of another version of the program.
    #[error("{}: a tile library from another version of sastrugi; choose another folder with --library, or delete this one", .0.display())]
    Version(PathBuf),
    /// There is a file of that name.
    #[error("{}: not a folder; --library takes one", .0.display())]
    NoFolder(PathBuf),
    /// The file system failed.
    #[error("{}: cannot use the tile library: {source}; choose another folder with --library", path.display())]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// What failed.
        source: std::io::Error,
    },
}

/// What a library has done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Tiles answered from memory.
    pub memory_hits: u64,
    /// Tiles read from disk.
    pub disk_hits: u64,
    /// Tiles made.
    pub made: u64,
    /// Makings that nobody waited for any longer.
    pub cancelled: u64,
    /// Makings that failed.
    pub failed: u64,
    /// Records that were damaged, and made again.
    pub damaged: u64,
    /// Records that made room for others.
    pub evicted: u64,
    /// Records that could not be written.
    pub unwritten: u64,
    /// Bytes of records on disk, as far as this process knows.
    pub disk_bytes: u64,
    /// Bytes of tiles in memory.
    pub memory_bytes: u64,
    /// Tiles that wait for a worker.
    pub queued: u64,
    /// Workers that are at it.
    pub running: u64,
}

/// One number of the [`Statistics`].
#[derive(Clone, Copy, Debug)]
pub struct Figure {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub help: &'static str,
    /// Whether it only ever rises.
    pub counts: bool,
    /// Its value.
    pub value: u64,
}

impl Statistics {
    /// All of them by name.
    pub fn figures(&self) -> [Figure; 12] {
        let figure = |(name, help, counts, value)| Figure { name, help, counts, value };
        [
            ("memory_hits", "Tiles answered from memory", true, self.memory_hits),
            ("disk_hits", "Tiles read from disk", true, self.disk_hits),
            ("made", "Tiles generated", true, self.made),
            ("cancelled", "Tiles cancelled, with no client waiting", true, self.cancelled),
            ("failed", "Tiles that could not be generated", true, self.failed),
            ("damaged", "Damaged records", true, self.damaged),
            ("evicted", "Records removed to make room", true, self.evicted),
            ("unwritten", "Records that could not be written", true, self.unwritten),
            ("disk_bytes", "Bytes of records", false, self.disk_bytes),
            ("memory_bytes", "Bytes of tiles in memory", false, self.memory_bytes),
            ("queued", "Tiles queued", false, self.queued),
            ("running", "Tiles being generated or read", false, self.running),
        ]
        .map(figure)
    }
}

#[derive(Default)]
struct Counts {
    memory_hits: AtomicU64,
    disk_hits: AtomicU64,
    made: AtomicU64,
    cancelled: AtomicU64,
    failed: AtomicU64,
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

type Made = Result<Arc<Samples>, Unavailable>;

/// A tile on its way.
struct Flight {
    number: u64,
    waiters: usize,
    priority: Priority,
    cancel: Arc<AtomicBool>,
    landed: watch::Receiver<Option<Made>>,
}

#[derive(Clone)]
struct Bytes;

impl Weighter<[u8; 32], Arc<Samples>> for Bytes {
    fn weight(&self, _: &[u8; 32], tile: &Arc<Samples>) -> u64 {
        tile.bytes()
    }
}

/// A cache of one part, so that a value may take all of its room. Divided ones, the default, keep none that is larger than a part, of which
/// there are more the more processors there are.
pub fn undivided<K, V, W>(items: usize, bytes: u64, weighter: W) -> Cache<K, V, W>
where
    K: Eq + std::hash::Hash,
    V: Clone,
    W: Weighter<K, V> + Clone,
{
    let mut options = OptionsBuilder::new();
    options.shards(1).estimated_items_capacity(items).weight_capacity(bytes);
    match options.build() {
        Ok(options) => {
            Cache::with_options(options, weighter, DefaultHashBuilder::default(), DefaultLifecycle::default())
        }
        // All that it asks for is given.
        Err(_) => Cache::with_weighter(items, bytes, weighter),
    }
}

/// Tiles that were made once.
pub struct Library {
    memory: Cache<[u8; 32], Arc<Samples>, Bytes>,
    disk: Option<Disk>,
    /// Tiles that somebody asked for a part of, see [`Library::remember`].
    asked: Cache<[u8; 32], ()>,
    flights: Mutex<HashMap<[u8; 32], Flight>>,
    flown: AtomicU64,
    workers: Pool,
    readers: Pool,
    counts: Counts,
}

impl Library {
    /// Opens a library, and makes its folder where there is none.
    ///
    /// # Errors
    /// A folder that holds other things, or cannot be used.
    pub fn open(settings: &Settings) -> Result<Arc<Self>, LibraryError> {
        let folder = settings.folder.as_deref().filter(|_| settings.disk_bytes > 0);
        let disk = folder.map(|folder| Disk::open(folder, settings.disk_bytes)).transpose()?;
        let typical = (settings.memory_bytes / (1 << 19)).max(16) as usize;
        Ok(Arc::new(Self {
            memory: Cache::with_weighter(typical, settings.memory_bytes, Bytes),
            disk,
            asked: Cache::new(ASKED),
            flights: Mutex::default(),
            flown: AtomicU64::new(0),
            workers: Pool::new("tiles", settings.workers, settings.queue),
            readers: Pool::new("records", READERS, READS),
            counts: Counts::default(),
        }))
    }

    /// The tile of a key: kept, or made by `make` on a worker. `make` looks at its flag and ends early, with nothing, once it is set.
    ///
    /// # Errors
    /// See [`Unavailable`].
    pub async fn tile(
        self: &Arc<Self>,
        key: TileKey,
        priority: Priority,
        make: impl FnOnce(&AtomicBool) -> Option<Samples> + Send + 'static,
    ) -> Made {
        if let Some(tile) = self.memory.get(&key.digest) {
            count(&self.counts.memory_hits);
            return Ok(tile);
        }
        let (waiter, mut landed) = match self.board(key, priority, make)? {
            Boarded::Kept(tile) => return Ok(tile),
            Boarded::Waiting(waiter, landed) => (waiter, landed),
        };
        let made = landed.wait_for(Option::is_some).await.map(|made| made.clone());
        drop(waiter);
        match made {
            Ok(Some(made)) => made,
            _ => Err(Unavailable::Failed("its worker thread ended".to_owned())),
        }
    }

    /// Whether a tile is kept or on its way.
    pub fn has(&self, key: &TileKey) -> bool {
        self.memory.peek(&key.digest).is_some()
            || self.flights().contains_key(&key.digest)
            || self.disk.as_ref().is_some_and(|disk| disk.has(key))
    }

    /// Whether one of these tiles is kept, on its way, or remembered.
    pub fn knows_any(&self, keys: &[TileKey]) -> bool {
        keys.iter().any(|key| self.asked.peek(&key.digest).is_some()) || keys.iter().any(|key| self.has(key))
    }

    /// Remembers that somebody asked for a part of these tiles.
    pub fn remember(&self, keys: &[TileKey]) {
        keys.iter().for_each(|key| self.asked.insert(key.digest, ()));
    }

    /// Joins the flight of a key, or starts it.
    fn board(
        self: &Arc<Self>,
        key: TileKey,
        priority: Priority,
        make: impl FnOnce(&AtomicBool) -> Option<Samples> + Send + 'static,
    ) -> Result<Boarded, Unavailable> {
        let digest = key.digest;
        let mut flights = self.flights();
        // A flight may have landed since memory was asked.
        if let Some(tile) = self.memory.get(&digest) {
            count(&self.counts.memory_hits);
            return Ok(Boarded::Kept(tile));
        }
        if let Some(flight) = flights.get_mut(&digest) {
            flight.waiters += 1;
            if priority == Priority::Answer {
                flight.priority = priority;
                self.workers.promote(&flight.cancel);
                self.readers.promote(&flight.cancel);
            }
            let waiter = Waiter { library: Arc::clone(self), digest, number: flight.number };
            return Ok(Boarded::Waiting(waiter, flight.landed.clone()));
        }
        let number = self.flown.fetch_add(1, Ordering::Relaxed);
        let cancel = Arc::new(AtomicBool::new(false));
        let (land, landed) = watch::channel(None);
        let is_kept = self.disk.as_ref().is_some_and(|disk| disk.has(&key));
        let trip = Trip { library: Arc::downgrade(self), key, number, cancel: Arc::clone(&cancel), land };
        let queued = if is_kept {
            self.readers.push(priority, Arc::clone(&cancel), Box::new(move || trip.read(make)))
        } else {
            self.workers.push(priority, Arc::clone(&cancel), Box::new(move || trip.make(make)))
        };
        queued.map_err(|_| Unavailable::Busy)?;
        flights.insert(digest, Flight { number, waiters: 1, priority, cancel, landed: landed.clone() });
        Ok(Boarded::Waiting(Waiter { library: Arc::clone(self), digest, number }, landed))
    }

    /// Ends a flight: its tile goes to memory and to those that wait.
    fn land(&self, waiting: &watch::Sender<Option<Made>>, digest: [u8; 32], made: Made) {
        if let Ok(tile) = &made {
            // Known in memory before the flight is over: who comes in between finds it.
            self.memory.insert(digest, Arc::clone(tile));
        }
        // Nobody may be left to hear it.
        let _ = waiting.send(Some(made));
    }

    /// Forgets a flight that has ended.
    fn forget(&self, digest: [u8; 32], number: u64) {
        let mut flights = self.flights();
        if flights.get(&digest).is_some_and(|flight| flight.number == number) {
            flights.remove(&digest);
        }
    }

    fn flights(&self) -> MutexGuard<'_, HashMap<[u8; 32], Flight>> {
        self.flights.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What it has done so far.
    pub fn statistics(&self) -> Statistics {
        let get = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let [damaged, evicted, unwritten, disk_bytes] = self.disk.as_ref().map_or([0; 4], Disk::counts);
        Statistics {
            memory_hits: get(&self.counts.memory_hits),
            disk_hits: get(&self.counts.disk_hits),
            made: get(&self.counts.made),
            cancelled: get(&self.counts.cancelled) + self.workers.dropped() + self.readers.dropped(),
            failed: get(&self.counts.failed),
            damaged,
            evicted,
            unwritten,
            disk_bytes,
            memory_bytes: self.memory.weight(),
            queued: (self.workers.queued() + self.readers.queued()) as u64,
            running: self.workers.running() + self.readers.running(),
        }
    }

    /// Tells all makings to stop.
    pub fn stop(&self) {
        self.flights().values().for_each(|flight| flight.cancel.store(true, Ordering::Relaxed));
    }
}

/// The way of a tile to those that wait for it.
struct Trip {
    library: Weak<Library>,
    key: TileKey,
    number: u64,
    cancel: Arc<AtomicBool>,
    land: watch::Sender<Option<Made>>,
}

impl Trip {
    /// Brings the tile of a record, on a reader. Where the record is damaged, a worker makes the tile.
    fn read(self, make: impl FnOnce(&AtomicBool) -> Option<Samples> + Send + 'static) {
        let Some(library) = self.library.upgrade() else { return };
        if let Some(tile) = library.disk.as_ref().and_then(|disk| disk.read(&self.key)) {
            count(&library.counts.disk_hits);
            library.land(&self.land, self.key.digest, Ok(Arc::new(tile)));
            return library.forget(self.key.digest, self.number);
        }
        let (digest, number, land) = (self.key.digest, self.number, self.land.clone());
        let pushed = {
            // Who joins meanwhile finds it in one line or the other.
            let flights = library.flights();
            let Some(flight) = flights.get(&digest).filter(|flight| flight.number == number) else { return };
            library.workers.push(flight.priority, Arc::clone(&self.cancel), Box::new(move || self.make(make)))
        };
        if pushed.is_err() {
            let _ = land.send(Some(Err(Unavailable::Busy)));
            library.forget(digest, number);
        }
    }

    /// Makes the tile, on a worker.
    fn make(self, make: impl FnOnce(&AtomicBool) -> Option<Samples>) {
        let Some(library) = self.library.upgrade() else { return };
        let made = match catch_unwind(AssertUnwindSafe(|| make(&self.cancel))) {
            // What a stopped making gives is not a tile, whatever it is.
            Ok(_) if self.cancel.load(Ordering::Relaxed) => {
                count(&library.counts.cancelled);
                Err(Unavailable::Failed("no client was waiting".to_owned()))
            }
            Ok(Some(tile)) => Ok(Arc::new(tile)),
            _ => {
                count(&library.counts.failed);
                Err(Unavailable::Failed("its generator failed".to_owned()))
            }
        };
        let tile = made.as_ref().ok().cloned();
        library.land(&self.land, self.key.digest, made);
        if let Some(tile) = tile {
            count(&library.counts.made);
            if let Some(disk) = library.disk.as_ref().filter(|_| tile.heights.len() >= RECORD_MIN) {
                disk.write(&self.key, &tile);
            }
        }
        // Only now, so that whoever came while the record was written was served too.
        library.forget(self.key.digest, self.number);
    }
}

/// What becomes of a request that memory did not answer at once.
enum Boarded {
    /// It is answered after all.
    Kept(Arc<Samples>),
    /// It waits.
    Waiting(Waiter, watch::Receiver<Option<Made>>),
}

/// One that waits for a flight; dropped when it leaves.
struct Waiter {
    library: Arc<Library>,
    digest: [u8; 32],
    number: u64,
}

impl Drop for Waiter {
    fn drop(&mut self) {
        let mut flights = self.library.flights();
        let Some(flight) = flights.get_mut(&self.digest).filter(|flight| flight.number == self.number) else { return };
        flight.waiters -= 1;
        if flight.waiters == 0 {
            flight.cancel.store(true, Ordering::Relaxed);
            // Who comes now starts another flight.
            flights.remove(&self.digest);
        }
    }
}
