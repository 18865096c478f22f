//! State shared by all requests.

use super::answer::Answers;
use super::jobs::Jobs;
use super::metrics::Metrics;
use super::problem::shortened;
use super::room::{Rooms, Sending};
use super::{Problem, Query};
use crate::collections::raster::Pyramid;
use crate::collections::world::{Maker, Piece, Selection};
use crate::collections::{Collection, Collections, Ground, Raster};
use crate::library::{Library, Priority};
use crate::samples::Samples;
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::Semaphore;

/// Largest body of a request, bytes.
pub const BODY_BYTES: usize = 1 << 16;

/// Limits of a request, and of what is in progress.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Samples of a patch; a quarter of it for an image.
    pub samples: u64,
    /// Expected processor time of a request, s.
    pub work_s: f64,
    /// Tiles of a job.
    pub job_tiles: u64,
    /// Concurrent requests per client.
    pub per_client: usize,
    /// Concurrent connections.
    pub connections: usize,
    /// Time limit of a request.
    pub request: Duration,
    /// Length of a URL, bytes.
    pub address: usize,
    /// Bytes of responses being sent.
    pub sending: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            samples: 1 << 22,
            work_s: 60.0,
            job_tiles: 1 << 20,
            per_client: 256,
            connections: 2048,
            request: Duration::from_secs(60),
            address: 8192,
            sending: 1 << 29,
        }
    }
}

/// State shared by all requests.
pub struct Service {
    /// Address that the server listens on.
    pub address: SocketAddr,
    /// The collections.
    pub collections: Collections,
    /// Cache of tiles.
    pub library: Arc<Library>,
    /// Cache of responses.
    pub answers: Answers,
    /// Limits.
    pub limits: Limits,
    /// Bearer token that clients must send.
    pub token: Option<String>,
    /// Names of this machine, other than those of loopback, that clients may use.
    pub hosts: Vec<String>,
    /// Jobs.
    pub jobs: Jobs,
    /// Request metrics.
    pub metrics: Metrics,
    /// Requests in progress per client.
    pub under_way: Mutex<HashMap<IpAddr, usize>>,
    /// Bytes of responses being sent.
    pub sending: Sending,
    /// Memory budget of patches being assembled.
    pub rooms: Rooms,
    /// Processors for work outside the library.
    pub processors: Arc<Semaphore>,
    /// The seat of the request that reads tables of releases.
    pub tables: Arc<Semaphore>,
}

impl Service {
    /// The collection with this id.
    ///
    /// # Errors
    /// There is no such collection.
    pub fn collection(&self, id: &str) -> Result<&Arc<Collection>, Problem> {
        self.collections.get(id).ok_or_else(|| {
            Problem::not_found(format!("no such collection: \"{}\"; /v1/collections lists them", shortened(id)))
        })
    }

    /// Generates tiles for a waiting client.
    pub fn maker(&self) -> Maker {
        Maker { library: Arc::clone(&self.library), priority: Priority::Answer, seconds_max: self.limits.work_s }
    }

    /// Samples `step_m` apart with the south-west one at `origin_m`; bilinear between the existing samples.
    ///
    /// # Errors
    /// Positions beyond the end of a world; unreadable files; a busy library.
    pub async fn samples(
        &self,
        collection: &Collection,
        origin_m: [f64; 2],
        step_m: f64,
        shape: [usize; 2],
        selection: &Selection,
        piece: Piece,
    ) -> Result<Samples, Problem> {
        match &collection.ground {
            Ground::World(world) => world.samples(&self.maker(), origin_m, step_m, shape, selection, piece).await,
            Ground::Raster(raster) => {
                let (raster, levels) = (Arc::clone(raster), self.levels(raster).await?);
                let north = origin_m[1] + (shape[0] - 1) as f64 * step_m;
                self.blocking(move || Ok(raster.samples(&levels, [origin_m[0], north], step_m, shape))).await
            }
        }
    }

    /// The levels of a raster. Requests that wait for another request to read them hold no processor.
    ///
    /// # Errors
    /// Files that are unreadable, or changed since the release was sealed.
    pub async fn levels(&self, raster: &Arc<Raster>) -> Result<Arc<Pyramid>, Problem> {
        let reader = Arc::clone(raster);
        raster.levels(self.blocking(move || reader.read())).await
    }

    /// Runs CPU-bound or file-reading work on a blocking thread, at most one at a time per processor. A request dropped while it waits withdraws its
    /// work; work that has started runs to its end.
    ///
    /// # Errors
    /// Those of the work.
    pub async fn blocking<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        seated(&self.processors, work).await
    }

    /// Runs work that reads tables on a blocking thread, one at a time, so that long tables do not hold up ground. The flag is set when the request is
    /// dropped; the work must poll it.
    ///
    /// # Errors
    /// Those of the work.
    pub async fn reading<T: Send + 'static>(
        &self,
        work: impl FnOnce(&AtomicBool) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let waiting = Waiting::default();
        let stop = Arc::clone(&waiting.stop);
        seated(&self.tables, move || work(&stop)).await
    }
}

/// A request that waits for its work, which it stops when it is dropped.
#[derive(Default)]
struct Waiting {
    stop: Arc<AtomicBool>,
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Runs work on a blocking thread once one of the seats is free.
async fn seated<T: Send + 'static>(
    seats: &Arc<Semaphore>,
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let ended = |e: &dyn std::fmt::Display| Problem::internal(format!("a task of the server ended early: {e}"));
    let seat = Arc::clone(seats).acquire_owned().await.map_err(|e| ended(&e))?;
    let done = tokio::task::spawn_blocking(move || {
        let done = work();
        drop(seat);
        done
    });
    done.await.map_err(|e| ended(&e))?
}

/// The part of a collection that a request selects.
///
/// # Errors
/// A process that the world does not have; any selection for a raster, whose ground is fixed.
pub fn selection(collection: &Collection, query: &Query) -> Result<Selection, Problem> {
    let numbers = query.numbers("phenomena")?;
    let feature_min_m = query.number("feature_min_m", [0.0, 1e9])?.unwrap_or(0.0);
    match &collection.ground {
        Ground::World(world) => Ok(Selection { phenomena: world.choose(numbers)?, feature_min_m }),
        Ground::Raster(_) if numbers.is_some() || feature_min_m > 0.0 => {
            Err(Problem::bad_request("`phenomena` and `feature_min_m` are for worlds; omit them for a raster"))
        }
        Ground::Raster(_) => Ok(Selection::default()),
    }
}

/// Parameters of [`selection`].
pub const SELECTION: [&str; 2] = ["phenomena", "feature_min_m"];
