//! What every request can see.

use super::answer::Answers;
use super::jobs::Jobs;
use super::metrics::Metrics;
use super::room::{Rooms, Sending};
use super::{Problem, Query};
use crate::collections::raster::Pyramid;
use crate::collections::world::{Maker, Piece, Selection};
use crate::collections::{Collection, Collections, Ground, Raster};
use crate::library::{Library, Priority};
use crate::samples::Samples;
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::Semaphore;

/// Most bytes of the body of a request.
pub const BODY_BYTES: usize = 1 << 16;

/// What a request may ask for, and how much may be under way.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Most samples of a patch; of an image a quarter.
    pub samples: u64,
    /// Most processor time that a request may be expected to take, s.
    pub work_s: f64,
    /// Most tiles of a job.
    pub job_tiles: u64,
    /// Most requests of one client under way.
    pub per_client: usize,
    /// Most connections.
    pub connections: usize,
    /// Longest time of a request.
    pub request: Duration,
    /// Longest address, bytes.
    pub address: usize,
    /// Most bytes of answers on their way to clients.
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

/// The service.
pub struct Service {
    /// Where it listens.
    pub address: SocketAddr,
    /// What is served.
    pub collections: Collections,
    /// Tiles that were made.
    pub library: Arc<Library>,
    /// Answers that were given.
    pub answers: Answers,
    /// Limits.
    pub limits: Limits,
    /// What clients must show.
    pub token: Option<String>,
    /// Names of this computer beside those of its loopback, as clients call it.
    pub hosts: Vec<String>,
    /// Work ahead.
    pub jobs: Jobs,
    /// Counters.
    pub metrics: Metrics,
    /// Requests under way by client.
    pub under_way: Mutex<HashMap<IpAddr, usize>>,
    /// Bytes of answers on their way to clients.
    pub sending: Sending,
    /// Room for patches that are being put together.
    pub rooms: Rooms,
    /// Processors for work that is not that of the library.
    pub processors: Arc<Semaphore>,
}

impl Service {
    /// The collection of an id.
    ///
    /// # Errors
    /// There is none.
    pub fn collection(&self, id: &str) -> Result<&Arc<Collection>, Problem> {
        self.collections.get(id).ok_or_else(|| {
            let shown: String = id.chars().take(80).collect();
            Problem::not_found(format!("\"{shown}\": no such collection; /v1/collections lists them"))
        })
    }

    /// Makes tiles for somebody who waits.
    pub fn maker(&self) -> Maker {
        Maker { library: Arc::clone(&self.library), priority: Priority::Answer, seconds_max: self.limits.work_s }
    }

    /// Samples `step_m` apart, the south-west one at `origin_m`; bilinear between those that there are.
    ///
    /// # Errors
    /// Places beyond the end of a world; files that cannot be read; no room for the request.
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

    /// The levels of a raster. Requests that wait for another that reads them keep no processor.
    ///
    /// # Errors
    /// Files that cannot be read, or are not those that were sealed.
    pub async fn levels(&self, raster: &Arc<Raster>) -> Result<Arc<Pyramid>, Problem> {
        let reader = Arc::clone(raster);
        raster.levels(self.blocking(move || reader.read())).await
    }

    /// Work that takes a processor for a while, or reads files: not on the threads of the runtime, and no more of it at once than there are
    /// processors. Who leaves while it waits takes it away; once begun it ends.
    ///
    /// # Errors
    /// Those of the work.
    pub async fn blocking<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let ended = |e: &dyn std::fmt::Display| Problem::internal(format!("the work ended early: {e}"));
        let seat = Arc::clone(&self.processors).acquire_owned().await.map_err(|e| ended(&e))?;
        let done = tokio::task::spawn_blocking(move || {
            let done = work();
            drop(seat);
            done
        });
        done.await.map_err(|e| ended(&e))?
    }
}

/// What a request selects of a ground.
///
/// # Errors
/// A process that a world does not have; any for a raster, whose ground is as it is.
pub fn selection(collection: &Collection, query: &Query) -> Result<Selection, Problem> {
    let numbers = query.numbers("phenomena")?;
    let feature_min_m = query.number("feature_min_m", [0.0, 1e9])?.unwrap_or(0.0);
    match &collection.ground {
        Ground::World(world) => Ok(Selection { phenomena: world.choose(numbers)?, feature_min_m }),
        Ground::Raster(_) if numbers.is_some() || feature_min_m > 0.0 => {
            Err(Problem::bad_request("`phenomena` and `feature_min_m` are for worlds; a raster does not support them"))
        }
        Ground::Raster(_) => Ok(Selection::default()),
    }
}

/// The parameters of [`selection`].
pub const SELECTION: [&str; 2] = ["phenomena", "feature_min_m"];
