//! Work ahead: the tiles of an area, made while nobody waits.

use super::service::{Service, checked};
use super::{Pairs, Problem};
use crate::collections::Ground;
use crate::collections::world::{Maker, Phenomena, Version, World};
use crate::library::Priority;
use axum::Json;
use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Most jobs that are remembered.
const JOBS_MAX: usize = 1000;
/// Tiles of a job that are under way at once.
const AT_ONCE: usize = 4;
/// How long a job waits where the library has no room for it.
const WAIT: Duration = Duration::from_millis(200);

/// What is asked for.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    collection: String,
    /// West, south, east and north, m.
    bounds_m: [f64; 4],
    #[serde(default)]
    resolution_m: Option<f64>,
    #[serde(default)]
    phenomena: Option<Vec<usize>>,
    #[serde(default)]
    feature_min_m: f64,
}

/// How far a job is.
#[derive(Clone, Debug, PartialEq)]
enum Progress {
    Running,
    Done,
    Cancelled,
    Failed(String),
}

struct Job {
    id: u64,
    order: Order,
    tiles: u64,
    made: AtomicU64,
    cancel: AtomicBool,
    state: Mutex<Progress>,
}

/// Jobs by number.
#[derive(Default)]
pub struct Jobs {
    all: Mutex<BTreeMap<u64, Arc<Job>>>,
    last: AtomicU64,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Job {
    fn describe(&self) -> Value {
        let (state, detail) = match &*locked(&self.state) {
            Progress::Running if self.made.load(Ordering::Relaxed) == 0 => ("queued", None),
            Progress::Running => ("running", None),
            Progress::Done => ("done", None),
            Progress::Cancelled => ("cancelled", None),
            Progress::Failed(why) => ("failed", Some(why.clone())),
        };
        json!({
            "id": self.id, "collection": self.order.collection, "bounds_m": self.order.bounds_m,
            "resolution_m": self.order.resolution_m, "state": state, "tiles": self.tiles,
            "tiles_made": self.made.load(Ordering::Relaxed), "detail": detail,
        })
    }

    fn ended(&self) -> bool {
        *locked(&self.state) != Progress::Running
    }
}

impl Jobs {
    fn get(&self, id: &str) -> Result<Arc<Job>, Problem> {
        let found = id.parse().ok().and_then(|id: u64| locked(&self.all).get(&id).cloned());
        found.ok_or_else(|| Problem::not_found("no such job; /v1/jobs lists them"))
    }

    fn add(&self, order: Order, tiles: u64) -> Result<Arc<Job>, Problem> {
        let mut all = locked(&self.all);
        if all.len() >= JOBS_MAX {
            let old = all.iter().find(|(_, job)| job.ended()).map(|(id, _)| *id);
            old.and_then(|id| all.remove(&id)).ok_or_else(|| {
                Problem::unavailable("as many jobs are under way as may be; cancel one, or try again later")
            })?;
        }
        let id = 1 + self.last.fetch_add(1, Ordering::Relaxed);
        let (made, cancel, state) = (AtomicU64::new(0), AtomicBool::new(false), Mutex::new(Progress::Running));
        let job = Arc::new(Job { id, order, tiles, made, cancel, state });
        all.insert(id, Arc::clone(&job));
        Ok(job)
    }

    /// Tells all jobs to end.
    pub fn stop(&self) {
        locked(&self.all).values().for_each(|job| job.cancel.store(true, Ordering::Relaxed));
    }
}

/// The tiles of the lattice that a job makes.
struct Area {
    world: Arc<World>,
    zoom: u32,
    /// First column and row, and how many there are.
    first: [i64; 2],
    count: [u64; 2],
    version: Version,
}

impl Area {
    fn of(service: &Service, order: &Order) -> Result<Self, Problem> {
        let collection = service.collection(&order.collection)?;
        let Ground::World(world) = &collection.ground else {
            return Err(Problem::bad_request("a raster is read, not made: there is nothing to make ahead"));
        };
        let [west, south, east, north] = order.bounds_m;
        let finite = order.bounds_m.iter().all(|v| v.is_finite() && v.abs() <= 1e12);
        if !(finite && west < east && south < north) {
            return Err(Problem::bad_request(
                "`bounds_m` must be west, south, east, north in metres, west below east and south below north",
            ));
        }
        let step_m = order.resolution_m.unwrap_or(world.cell_m());
        let zoom = (0..41).find(|k| (world.step_m(*k) / step_m - 1.0).abs() < 1e-6);
        let zoom = zoom.ok_or_else(|| {
            Problem::bad_request(format!(
                "`resolution_m`: {step_m}; tiles have 1, 2, 4, 8 ... times {} m",
                world.spacing_m()
            ))
        })?;
        if !(0.0..=1e9).contains(&order.feature_min_m) {
            return Err(Problem::bad_request("`feature_min_m` must lie between 0 and 1e9"));
        }
        let side = world.step_m(zoom) * crate::grid::TILE as f64;
        let tile = |at: f64| (at / side).floor() as i64;
        let first = [tile(west), tile(south)];
        let count = [tile(east) - first[0] + 1, tile(north) - first[1] + 1].map(|n| n.max(1) as u64);
        let tiles = count[0].saturating_mul(count[1]);
        let most = service.limits.job_tiles;
        if tiles > most {
            return Err(Problem::too_large(
                format!("the area has {tiles} tiles; a job makes at most {most}"),
                "tiles_max",
                most,
            ));
        }
        let phenomena: Phenomena = world.choose(order.phenomena.clone())?;
        let version = Version { phenomena, feature_min_m: order.feature_min_m };
        world.check_work(zoom, tiles, &version, f64::INFINITY)?;
        Ok(Self { world: Arc::clone(world), zoom, first, count, version })
    }

    fn places(&self) -> impl Iterator<Item = [i64; 2]> + use<> {
        let ([col, row], [cols, rows]) = (self.first, self.count.map(|n| n as i64));
        (row..row + rows).flat_map(move |row| (col..col + cols).map(move |col| [col, row]))
    }
}

/// `POST /v1/jobs`
pub async fn order(State(service): State<Arc<Service>>, pairs: Pairs, body: Bytes) -> Result<Response, Problem> {
    checked(pairs, &[])?;
    let order: Order = serde_json::from_slice(&body).map_err(|e| {
        Problem::bad_request(format!("the body is not an order: {e}; it must be JSON as {{\"collection\": \"planet\", \"bounds_m\": [0, 0, 50, 50], \"resolution_m\": 0.02}}"))
    })?;
    let area = Area::of(&service, &order)?;
    let job = service.jobs.add(order, area.count[0] * area.count[1])?;
    let described = job.describe();
    let place = format!("/v1/jobs/{}", job.id);
    tokio::spawn(work(service, job, area));
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, place)], Json(described)).into_response())
}

/// Makes the tiles of a job, a few at a time.
async fn work(service: Arc<Service>, job: Arc<Job>, area: Area) {
    let maker = Maker { priority: Priority::Background, seconds_max: f64::INFINITY, ..service.maker() };
    let area = Arc::new(area);
    let mut under_way = tokio::task::JoinSet::new();
    let mut places = area.places();
    let mut end = Progress::Done;
    loop {
        while under_way.len() < AT_ONCE {
            let Some(place) = places.next() else { break };
            let (area, maker, job) = (Arc::clone(&area), maker.clone(), Arc::clone(&job));
            under_way.spawn(async move {
                loop {
                    let made = area.world.lattice_tile(&maker, area.zoom, place, &area.version).await;
                    match made {
                        Err(problem)
                            if problem.status() == StatusCode::SERVICE_UNAVAILABLE
                                && !job.cancel.load(Ordering::Relaxed) =>
                        {
                            tokio::time::sleep(WAIT).await;
                        }
                        other => return other.map(|_| ()),
                    }
                }
            });
        }
        let Some(ended) = under_way.join_next().await else { break };
        match ended {
            _ if job.cancel.load(Ordering::Relaxed) => end = Progress::Cancelled,
            Ok(Ok(())) => {
                job.made.fetch_add(1, Ordering::Relaxed);
            }
            Ok(Err(problem)) => end = Progress::Failed(problem.detail().to_owned()),
            Err(error) => end = Progress::Failed(error.to_string()),
        }
        if end != Progress::Done {
            break;
        }
    }
    // Dropping the rest tells their makers to stop.
    drop(under_way);
    *locked(&job.state) = end;
}

/// `GET /v1/jobs`
pub async fn list(State(service): State<Arc<Service>>, pairs: Pairs) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let jobs: Vec<Value> = locked(&service.jobs.all).values().map(|job| job.describe()).collect();
    Ok(Json(json!({ "jobs": jobs })))
}

/// `GET /v1/jobs/{id}`
pub async fn one(
    State(service): State<Arc<Service>>,
    Path(id): Path<String>,
    pairs: Pairs,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    Ok(Json(service.jobs.get(&id)?.describe()))
}

/// `DELETE /v1/jobs/{id}`
pub async fn cancel(
    State(service): State<Arc<Service>>,
    Path(id): Path<String>,
    pairs: Pairs,
) -> Result<Json<Value>, Problem> {
    checked(pairs, &[])?;
    let job = service.jobs.get(&id)?;
    if job.ended() {
        return Err(Problem::conflict("the job has ended; only one under way can be cancelled"));
    }
    job.cancel.store(true, Ordering::Relaxed);
    Ok(Json(job.describe()))
}
