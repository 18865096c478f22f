//! Cache of generated tiles, in memory and on disk; concurrent requests for a tile share one generation.
//!
//! A request is answered from memory, from a record on disk (`disk`), or by generating the tile on a worker thread (`pool`). Separate threads read
//! records, so that reads do not queue behind slow tiles. Concurrent requests for a tile share one flight. No request owns the flight: if one is
//! dropped, the others are still served, and when the last is dropped the generation is cancelled.

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

/// Tiles with fewer samples are not worth a record.
const RECORD_MIN: usize = 64;
/// Threads that read records.
const READERS: usize = 4;
/// Number of requested tiles to remember, in addition to those in the cache.
const ASKED: usize = 1 << 16;
/// Longest queue of records to read.
const READS: usize = 4096;

/// Identity of a tile: a text that names everything its samples depend on, and the hash of that text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileKey {
    text: String,
    digest: [u8; 32],
}

impl TileKey {
    /// The key for a canonical text.
    pub fn new(text: String) -> Self {
        let digest = *blake3::hash(text.as_bytes()).as_bytes();
        Self { text, digest }
    }
}

/// Where tiles are stored, and how many.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Folder of the records; without it, tiles are kept in memory only.
    pub folder: Option<PathBuf>,
    /// Limit of the records on disk, bytes.
    pub disk_bytes: u64,
    /// Limit of the tiles in memory, bytes.
    pub memory_bytes: u64,
    /// Threads that generate tiles.
    pub workers: usize,
    /// Longest queue of tiles to generate.
    pub queue: usize,
}

/// Why a tile is unavailable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unavailable {
    /// The queue is full.
    #[error("too many tiles are queued")]
    Busy,
    /// Generation failed.
    #[error("the tile could not be generated: {0}")]
    Failed(String),
}

/// Why a library could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// The folder holds other files.
    #[error("{}: the folder is not empty and not a tile library; choose another folder with --library", .0.display())]
    Occupied(PathBuf),
    /// The folder was created by another version of the program.
    #[error("{}: this tile library is from another version of sastrugi; choose another folder with --library, or delete this one", .0.display())]
    Version(PathBuf),
    /// The path exists and is not a folder.
    #[error("{}: not a folder; --library requires a folder", .0.display())]
    NoFolder(PathBuf),
    /// A file operation failed.
    #[error("{}: cannot use the tile library: {source}; choose another folder with --library", path.display())]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// The error.
        source: std::io::Error,
    },
}

/// Counters since the library was opened, and its present size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Tiles answered from memory.
    pub memory_hits: u64,
    /// Tiles read from disk.
    pub disk_hits: u64,
    /// Tiles generated.
    pub made: u64,
    /// Generations cancelled because no request was waiting.
    pub cancelled: u64,
    /// Generations that failed.
    pub failed: u64,
    /// Damaged records, which were regenerated.
    pub damaged: u64,
    /// Records removed to make room.
    pub evicted: u64,
    /// Records that could not be written.
    pub unwritten: u64,
    /// Bytes of records on disk, as far as this process knows.
    pub disk_bytes: u64,
    /// Bytes of tiles in memory.
    pub memory_bytes: u64,
    /// Tiles waiting for a worker.
    pub queued: u64,
    /// Busy workers and readers.
    pub running: u64,
}

/// One value of the [`Statistics`].
#[derive(Clone, Copy, Debug)]
pub struct Statistic {
    /// Its name.
    pub name: &'static str,
    /// Description.
    pub help: &'static str,
    /// Whether it is a counter, which never decreases.
    pub is_counter: bool,
    /// Its value.
    pub value: u64,
}

impl Statistics {
    /// All values with their names.
    pub fn list(&self) -> [Statistic; 12] {
        let statistic = |(name, help, is_counter, value)| Statistic { name, help, is_counter, value };
        [
            ("memory_hits", "Tiles answered from memory", true, self.memory_hits),
            ("disk_hits", "Tiles read from disk", true, self.disk_hits),
            ("made", "Tiles generated", true, self.made),
            ("cancelled", "Tiles cancelled because no client was waiting", true, self.cancelled),
            ("failed", "Tiles that could not be generated", true, self.failed),
            ("damaged", "Damaged records, regenerated", true, self.damaged),
            ("evicted", "Records removed to make room", true, self.evicted),
            ("unwritten", "Records that could not be written", true, self.unwritten),
            ("disk_bytes", "Bytes of records on disk", false, self.disk_bytes),
            ("memory_bytes", "Bytes of tiles in memory", false, self.memory_bytes),
            ("queued", "Tiles queued", false, self.queued),
            ("running", "Tiles being generated or read", false, self.running),
        ]
        .map(statistic)
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

/// A tile that is being generated or read.
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

/// A cache with a single shard, so that one value may use all of its capacity. The default has a number of shards that grows with the number of
/// processors, and rejects any value larger than a shard.
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
        // All required options are set.
        Err(_) => Cache::with_weighter(items, bytes, weighter),
    }
}

/// Cache of generated tiles.
pub struct Library {
    memory: Cache<[u8; 32], Arc<Samples>, Bytes>,
    disk: Option<Disk>,
    /// Tiles of which a request used a part; see [`Library::remember`].
    asked: Cache<[u8; 32], ()>,
    flights: Mutex<HashMap<[u8; 32], Flight>>,
    flown: AtomicU64,
    workers: Pool,
    readers: Pool,
    counts: Counts,
}

impl Library {
    /// Opens a library; creates its folder if it is missing.
    ///
    /// # Errors
    /// The folder holds other files, or cannot be used.
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

    /// The tile of a key, from the cache or generated by `make` on a worker. `make` must poll its flag and return `None` once it is set.
    ///
    /// # Errors
    /// See [`Unavailable`].
    ///
    /// # Examples
    /// ```
    /// use sastrugi_server::LibrarySettings;
    /// use sastrugi_server::library::{Library, Priority, TileKey};
    /// use sastrugi_server::samples::Samples;
    /// use std::sync::atomic::AtomicBool;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let settings = LibrarySettings { folder: None, disk_bytes: 0, memory_bytes: 1 << 20, workers: 1, queue: 16 };
    /// let library = Library::open(&settings)?;
    /// let runtime = tokio::runtime::Runtime::new()?;
    /// let key = || TileKey::new("level ground 1.5 m high".to_owned());
    /// let make = |_: &AtomicBool| Some(Samples { heights: vec![1.5; 64], ..Samples::empty(8, 8) });
    /// let tile = runtime.block_on(library.tile(key(), Priority::Answer, make))?;
    /// assert_eq!(tile.heights, [1.5; 64]);
    /// // The second request is answered from memory.
    /// let again = runtime.block_on(library.tile(key(), Priority::Answer, |_| None))?;
    /// assert_eq!((again.heights.len(), library.statistics().memory_hits), (64, 1));
    /// # Ok(())
    /// # }
    /// ```
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

    /// Whether a tile is cached or being generated.
    pub fn has(&self, key: &TileKey) -> bool {
        self.memory.peek(&key.digest).is_some()
            || self.flights().contains_key(&key.digest)
            || self.disk.as_ref().is_some_and(|disk| disk.has(key))
    }

    /// Whether any of these tiles is cached, being generated, or remembered.
    pub fn knows_any(&self, keys: &[TileKey]) -> bool {
        keys.iter().any(|key| self.asked.peek(&key.digest).is_some()) || keys.iter().any(|key| self.has(key))
    }

    /// Remembers that a request used a part of these tiles.
    pub fn remember(&self, keys: &[TileKey]) {
        keys.iter().for_each(|key| self.asked.insert(key.digest, ()));
    }

    /// Joins the flight of a key, or starts one.
    fn board(
        self: &Arc<Self>,
        key: TileKey,
        priority: Priority,
        make: impl FnOnce(&AtomicBool) -> Option<Samples> + Send + 'static,
    ) -> Result<Boarded, Unavailable> {
        let digest = key.digest;
        let mut flights = self.flights();
        // A flight may have landed since the lookup in memory.
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

    /// Ends a flight: stores its tile in memory and passes it to all who wait.
    fn land(&self, waiting: &watch::Sender<Option<Made>>, digest: [u8; 32], made: Made) {
        if let Ok(tile) = &made {
            // Store the tile before the flight ends, so that a request that arrives in between finds it.
            self.memory.insert(digest, Arc::clone(tile));
        }
        // There may be no receivers left.
        let _ = waiting.send(Some(made));
    }

    /// Removes a flight that has ended.
    fn forget(&self, digest: [u8; 32], number: u64) {
        let mut flights = self.flights();
        if flights.get(&digest).is_some_and(|flight| flight.number == number) {
            flights.remove(&digest);
        }
    }

    fn flights(&self) -> MutexGuard<'_, HashMap<[u8; 32], Flight>> {
        self.flights.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Present values of the counters.
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

    /// Cancels all generations.
    pub fn stop(&self) {
        self.flights().values().for_each(|flight| flight.cancel.store(true, Ordering::Relaxed));
    }
}

/// Everything a thread needs to deliver a tile.
struct Trip {
    library: Weak<Library>,
    key: TileKey,
    number: u64,
    cancel: Arc<AtomicBool>,
    land: watch::Sender<Option<Made>>,
}

impl Trip {
    /// Reads a tile from its record, on a reader thread; if the record is damaged, passes the tile to a worker.
    fn read(self, make: impl FnOnce(&AtomicBool) -> Option<Samples> + Send + 'static) {
        let Some(library) = self.library.upgrade() else { return };
        if let Some(tile) = library.disk.as_ref().and_then(|disk| disk.read(&self.key)) {
            count(&library.counts.disk_hits);
            library.land(&self.land, self.key.digest, Ok(Arc::new(tile)));
            return library.forget(self.key.digest, self.number);
        }
        let (digest, number, land) = (self.key.digest, self.number, self.land.clone());
        let pushed = {
            // Under the lock, so that a request that joins now finds the work in one queue or the other.
            let flights = library.flights();
            let Some(flight) = flights.get(&digest).filter(|flight| flight.number == number) else { return };
            library.workers.push(flight.priority, Arc::clone(&self.cancel), Box::new(move || self.make(make)))
        };
        if pushed.is_err() {
            let _ = land.send(Some(Err(Unavailable::Busy)));
            library.forget(digest, number);
        }
    }

    /// Generates the tile, on a worker thread.
    fn make(self, make: impl FnOnce(&AtomicBool) -> Option<Samples>) {
        let Some(library) = self.library.upgrade() else { return };
        let made = match catch_unwind(AssertUnwindSafe(|| make(&self.cancel))) {
            // The result of a cancelled generation is not a tile, whatever it returned.
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
        // Last, so that requests that arrived while the record was being written joined this flight.
        library.forget(self.key.digest, self.number);
    }
}

/// Outcome of a request that the first lookup in memory missed.
enum Boarded {
    /// The tile is in memory after all.
    Kept(Arc<Samples>),
    /// The request waits.
    Waiting(Waiter, watch::Receiver<Option<Made>>),
}

/// A request waiting for a flight; dropped when the request ends.
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
            // A later request starts a new flight.
            flights.remove(&self.digest);
        }
    }
}
