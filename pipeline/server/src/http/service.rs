//! What every request can see.

use super::answer::Answers;
use super::jobs::Jobs;
use super::metrics::Metrics;
use super::{Pairs, Problem, Query};
use crate::collections::world::{Maker, Version};
use crate::collections::{Collection, Collections, Ground};
use crate::library::{Library, Priority};
use crate::samples::Samples;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What a request may ask for, and how much may be under way.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Most samples of a patch.
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
    /// Most bytes of the body of a request.
    pub body: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            samples: 1 << 22,
            work_s: 40.0,
            job_tiles: 1 << 20,
            per_client: 256,
            connections: 2048,
            request: Duration::from_secs(60),
            address: 8192,
            body: 1 << 16,
        }
    }
}

/// The service.
pub struct Service {
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
    /// Work ahead.
    pub jobs: Jobs,
    /// Counters.
    pub metrics: Metrics,
    /// Requests under way by client.
    pub under_way: Mutex<HashMap<IpAddr, usize>>,
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
        version: &Version,
    ) -> Result<Samples, Problem> {
        match &collection.ground {
            Ground::World(world) => world.samples(&self.maker(), origin_m, step_m, shape, version).await,
            Ground::Raster(raster) => {
                let raster = Arc::clone(raster);
                let north = origin_m[1] + (shape[0] - 1) as f64 * step_m;
                blocking(move || raster.samples([origin_m[0], north], step_m, shape)).await
            }
        }
    }
}

/// Which version of its ground a request asks for.
///
/// # Errors
/// A process that a world does not have; any for a raster, whose ground is as it is.
pub fn version(collection: &Collection, query: &Query) -> Result<Version, Problem> {
    let numbers = query.numbers("phenomena")?;
    let feature_min_m = query.number("feature_min_m", [0.0, 1e9])?.unwrap_or(0.0);
    match &collection.ground {
        Ground::World(world) => Ok(Version { phenomena: world.choose(numbers)?, feature_min_m }),
        Ground::Raster(_) if numbers.is_some() || feature_min_m > 0.0 => Err(Problem::bad_request(
            "`phenomena` and `feature_min_m` are for worlds; a raster has the ground that its file holds",
        )),
        Ground::Raster(_) => Ok(Version::default()),
    }
}

/// The parameters of [`version`].
pub const VERSION: [&str; 2] = ["phenomena", "feature_min_m"];

/// The checked parameters of a request.
///
/// # Errors
/// A parameter that the path does not take.
pub fn checked(pairs: Pairs, known: &[&[&str]]) -> Result<Query, Problem> {
    Query::new(pairs.0, &known.concat())
}

/// Work that takes a processor for a while, or reads files: not on the threads of the runtime.
///
/// # Errors
/// Those of the work.
pub async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done,
        Err(error) => Err(Problem::internal(format!("the work ended early: {error}"))),
    }
}
