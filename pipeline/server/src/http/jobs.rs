//! Jobs: tiles of an area, generated in advance.

use super::extract::Body;
use super::problem::shortened;
use super::service::Service;
use super::{Plain, Problem, Segments};
use crate::collections::Ground;
use crate::collections::world::{Maker, Selection, World};
use crate::grid::TILE;
use crate::library::Priority;
use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::task::JoinSet;

/// Largest number of jobs kept in the list.
const JOBS_MAX: usize = 1000;
/// Tiles of a job that are generated at once.
const AT_ONCE: usize = 4;
/// Largest coordinate of an area, m.
const FARTHEST_M: f64 = 1e12;
/// How long a job waits before it retries while the library is busy.
const WAIT: Duration = Duration::from_millis(200);

/// Body of a job request.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    collection: String,
    /// West, south, east and north, m.
    bounds_m: [f64; 4],
    resolution_m: Option<f64>,
    phenomena: Option<Vec<usize>>,
    feature_min_m: f64,
}

impl TryFrom<Map<String, Value>> for Order {
    type Error = Problem;

    /// Members that are null count as absent.
    fn try_from(mut body: Map<String, Value>) -> Result<Self, Problem> {
        let mut member = |name: &str| body.remove(name).filter(|value| !value.is_null());
        let [collection, bounds, resolution, phenomena, feature_min] = MEMBERS.map(&mut member);
        if let Some(name) = body.keys().next() {
            let (shown, known) = (shortened(name), MEMBERS.join(", "));
            return Err(Problem::bad_request(format!("unknown member `{shown}`; a job has {known}")));
        }
        let number = |value: &Value| value.as_f64();
        let collection = collection.as_ref().and_then(Value::as_str).map(str::to_owned);
        let bounds =
            bounds.as_ref().and_then(|value| all(value, number)).and_then(|edges| <[f64; 4]>::try_from(edges).ok());
        Ok(Self {
            collection: collection.ok_or_else(|| must_be("collection", "the id of a world"))?,
            bounds_m: bounds.ok_or_else(|| must_be("bounds_m", "four numbers: west, south, east and north, m"))?,
            resolution_m: given(resolution, number).map_err(|()| must_be("resolution_m", "a number"))?,
            phenomena: given(phenomena, |value| all(value, |one| usize::try_from(one.as_u64()?).ok()))
                .map_err(|()| must_be("phenomena", "a list of numbers of processes, such as [1, 3]"))?,
            feature_min_m: given(feature_min, number)
                .map_err(|()| must_be("feature_min_m", "a number"))?
                .unwrap_or(0.0),
        })
    }
}

/// Members of the body of a job request.
const MEMBERS: [&str; 5] = ["collection", "bounds_m", "resolution_m", "phenomena", "feature_min_m"];

fn must_be(name: &str, right: &str) -> Problem {
    Problem::bad_request(format!("`{name}` must be {right}"))
}

/// The elements of a list if all are right.
fn all<T>(list: &Value, right: impl Fn(&Value) -> Option<T>) -> Option<Vec<T>> {
    list.as_array()?.iter().map(right).collect()
}

/// A member that may be absent.
fn given<T>(value: Option<Value>, right: impl Fn(&Value) -> Option<T>) -> Result<Option<T>, ()> {
    value.map(|value| right(&value).ok_or(())).transpose()
}

/// State of a job.
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
    cancel: Notify,
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
            Progress::Running => ("running", None),
            Progress::Done => ("done", None),
            Progress::Cancelled => ("cancelled", None),
            Progress::Failed(why) => ("failed", Some(why.clone())),
        };
        json!({
            "id": self.id, "collection": self.order.collection, "bounds_m": self.order.bounds_m,
            "resolution_m": self.order.resolution_m, "phenomena": self.order.phenomena, "feature_min_m": self.order.feature_min_m,
            "state": state, "tiles": self.tiles, "tiles_made": self.made.load(Ordering::Relaxed), "detail": detail,
        })
    }

    fn ended(&self) -> bool {
        *locked(&self.state) != Progress::Running
    }

    /// Ends the job; false if it has already ended.
    fn end(&self, how: Progress) -> bool {
        let mut state = locked(&self.state);
        let runs = *state == Progress::Running;
        if runs {
            *state = how;
            self.cancel.notify_one();
        }
        runs
    }
}

impl Jobs {
    fn get(&self, id: &str) -> Result<Arc<Job>, Problem> {
        // `+1` and `01` are not numbers of jobs.
        let number = id.parse().ok().filter(|number: &u64| number.to_string() == id);
        let found = number.and_then(|number| locked(&self.all).get(&number).cloned());
        found.ok_or_else(|| Problem::not_found("no such job; /v1/jobs lists them"))
    }

    fn add(&self, order: Order, tiles: u64) -> Result<Arc<Job>, Problem> {
        let mut all = locked(&self.all);
        if all.len() >= JOBS_MAX {
            let old = all.iter().find(|(_, job)| job.ended()).map(|(id, _)| *id);
            old.and_then(|id| all.remove(&id))
                .ok_or_else(|| Problem::unavailable("too many jobs are running; cancel one, or try again later"))?;
        }
        let id = 1 + self.last.fetch_add(1, Ordering::Relaxed);
        let (made, cancel, state) = (AtomicU64::new(0), Notify::new(), Mutex::new(Progress::Running));
        let job = Arc::new(Job { id, order, tiles, made, cancel, state });
        all.insert(id, Arc::clone(&job));
        Ok(job)
    }

    /// Cancels all jobs.
    pub fn stop(&self) {
        for job in locked(&self.all).values() {
            job.end(Progress::Cancelled);
        }
    }
}

/// The lattice tiles that a job generates.
struct Area {
    world: Arc<World>,
    zoom: u32,
    /// First column and row, and their numbers.
    first: [i64; 2],
    count: [u64; 2],
    selection: Selection,
}

impl Area {
    fn of(service: &Service, order: &Order) -> Result<Self, Problem> {
        let collection = service.collection(&order.collection)?;
        let Ground::World(world) = &collection.ground else {
            return Err(Problem::bad_request("jobs are for worlds; a raster has nothing to generate in advance"));
        };
        let [west, south, east, north] = order.bounds_m;
        if !order.bounds_m.iter().all(|v| v.abs() <= FARTHEST_M) {
            return Err(Problem::bad_request(format!(
                "`bounds_m` must be four numbers from -{FARTHEST_M:e} to {FARTHEST_M:e}"
            )));
        }
        if !(west < east && south < north) {
            return Err(Problem::bad_request(
                "`bounds_m` must be west, south, east, north in metres, with west < east and south < north",
            ));
        }
        let step_m = order.resolution_m.unwrap_or(world.cell_m());
        let zoom = world.zoom_of(step_m).ok_or_else(|| {
            Problem::bad_request(format!(
                "`resolution_m` must be {} m times a power of 2, got {step_m} m",
                world.spacing_m()
            ))
        })?;
        if !(0.0..=1e9).contains(&order.feature_min_m) {
            return Err(Problem::bad_request("`feature_min_m` must lie between 0 and 1e9"));
        }
        let side = world.step_m(zoom) * TILE as f64;
        let tile = |corner: [f64; 2]| world.to_lattice(corner).map(|at| (at / side).floor() as i64);
        let (first, last) = (tile([west, south]), tile([east, north]));
        let count = [0, 1].map(|a| (last[a] - first[a] + 1).max(1) as u64);
        let tiles = count[0].saturating_mul(count[1]);
        let most = service.limits.job_tiles;
        if tiles > most {
            return Err(Problem::too_large(
                format!("the area has {tiles} tiles; the limit for a job is {most}"),
                "tiles_max",
                most,
            ));
        }
        let phenomena = world.choose(order.phenomena.clone())?;
        let selection = Selection { phenomena, feature_min_m: order.feature_min_m };
        world.check_work(zoom, tiles, &selection, f64::INFINITY)?;
        let ends = |axis: usize| [first[axis], first[axis].saturating_add(count[axis] as i64)];
        [0, 1].into_iter().flat_map(ends).try_for_each(|tile| world.check_reach(zoom, tile as f64 * TILE as f64))?;
        Ok(Self { world: Arc::clone(world), zoom, first, count, selection })
    }

    fn places(&self) -> impl Iterator<Item = [i64; 2]> + use<> {
        let ([col, row], [cols, rows]) = (self.first, self.count.map(|n| n as i64));
        (row..row + rows).flat_map(move |row| (col..col + cols).map(move |col| [col, row]))
    }
}

/// `POST /v1/jobs`
pub async fn order(State(service): State<Arc<Service>>, _: Plain, Body(body): Body) -> Result<Response, Problem> {
    let mut order = Order::try_from(body)?;
    let area = Area::of(&service, &order)?;
    // The spacing that is used, also if none was requested.
    order.resolution_m = Some(area.world.step_m(area.zoom));
    let job = service.jobs.add(order, area.count[0] * area.count[1])?;
    let described = job.describe();
    let place = format!("/v1/jobs/{}", job.id);
    tokio::spawn(work(service, job, area));
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, place)], Json(described)).into_response())
}

/// Generates the tiles of a job until it is cancelled.
async fn work(service: Arc<Service>, job: Arc<Job>, area: Area) {
    tokio::select! {
        end = make(&service, &job, area) => { job.end(end); }
        // Dropping the future cancels the generation in progress.
        () = job.cancel.notified() => {}
    }
}

/// Generates the tiles of a job, a few at a time.
async fn make(service: &Service, job: &Job, area: Area) -> Progress {
    let maker = Maker { priority: Priority::Background, seconds_max: f64::INFINITY, ..service.maker() };
    let area = Arc::new(area);
    let (mut under_way, mut places) = (JoinSet::new(), area.places());
    loop {
        for place in places.by_ref().take(AT_ONCE - under_way.len()) {
            under_way.spawn(make_when_free(Arc::clone(&area), maker.clone(), place));
        }
        match under_way.join_next().await {
            None => return Progress::Done,
            Some(Ok(Ok(()))) => drop(job.made.fetch_add(1, Ordering::Relaxed)),
            Some(Ok(Err(problem))) => return Progress::Failed(problem.detail().to_owned()),
            Some(Err(error)) => return Progress::Failed(error.to_string()),
        }
    }
}

/// Generates a tile; retries while the library is busy.
async fn make_when_free(area: Arc<Area>, maker: Maker, place: [i64; 2]) -> Result<(), Problem> {
    loop {
        match area.world.lattice_tile(&maker, area.zoom, place, &area.selection).await {
            Err(problem) if problem.status() == StatusCode::SERVICE_UNAVAILABLE => tokio::time::sleep(WAIT).await,
            other => return other.map(drop),
        }
    }
}

/// `GET /v1/jobs`
pub async fn list(State(service): State<Arc<Service>>, _: Plain) -> Json<Value> {
    let jobs: Vec<Value> = locked(&service.jobs.all).values().map(|job| job.describe()).collect();
    Json(json!({ "jobs": jobs }))
}

/// `GET /v1/jobs/{id}`
pub async fn one(
    State(service): State<Arc<Service>>,
    Segments(id): Segments<String>,
    _: Plain,
) -> Result<Json<Value>, Problem> {
    Ok(Json(service.jobs.get(&id)?.describe()))
}

/// `DELETE /v1/jobs/{id}`
pub async fn cancel(
    State(service): State<Arc<Service>>,
    Segments(id): Segments<String>,
    _: Plain,
) -> Result<Json<Value>, Problem> {
    let job = service.jobs.get(&id)?;
    if job.end(Progress::Cancelled) {
        Ok(Json(job.describe()))
    } else {
        Err(Problem::conflict("the job has ended; only running jobs can be cancelled"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All listed jobs may be running; one that has ended makes room for a new one.
    #[test]
    fn val_running_jobs_are_bounded() {
        let jobs = Jobs::default();
        let add = || {
            let order = Order {
                collection: "world".to_owned(),
                bounds_m: [0.0, 0.0, 1.0, 1.0],
                resolution_m: None,
                phenomena: None,
                feature_min_m: 0.0,
            };
            jobs.add(order, 1)
        };
        let all: Vec<Arc<Job>> = (0..JOBS_MAX).map(|_| add().unwrap()).collect();
        assert!(add().is_err_and(|problem| problem.status() == StatusCode::SERVICE_UNAVAILABLE));
        assert!(all[7].end(Progress::Done) && !all[7].end(Progress::Cancelled));
        assert_eq!(add().unwrap().id, JOBS_MAX as u64 + 1);
        assert!(jobs.get("8").is_err() && jobs.get("9").is_ok() && add().is_err());
        assert!(["+9", "09", " 9", "9.0", "-9", ""].iter().all(|id| jobs.get(id).is_err()));
    }

    /// What is wrong is said in the words of the API; null stands for an absent member.
    #[test]
    fn val_bodies_of_jobs_are_read() {
        let order = |members: Value| match members {
            Value::Object(body) => Order::try_from(body).map_err(|problem| problem.detail().to_owned()),
            other => panic!("{other}"),
        };
        let bounds = json!([0, -1, 2.5, 1]);
        let least = order(json!({ "collection": "world", "bounds_m": bounds })).unwrap();
        assert_eq!((least.bounds_m, least.feature_min_m), ([0.0, -1.0, 2.5, 1.0], 0.0));
        let with = |name: &str, value: Value| order(json!({ "collection": "world", "bounds_m": bounds, name: value }));
        for name in ["resolution_m", "phenomena", "feature_min_m"] {
            assert_eq!(with(name, Value::Null), Ok(least.clone()), "{name}");
        }
        assert_eq!(with("phenomena", json!([3, 1])).unwrap().phenomena, Some(vec![3, 1]));
        for (name, value, said) in [
            ("phenomena", json!([-1]), "`phenomena` must be a list of numbers of processes, such as [1, 3]"),
            ("phenomena", json!("1"), "`phenomena` must be a list of numbers of processes, such as [1, 3]"),
            ("bounds_m", json!([0, 0, 1, null]), "`bounds_m` must be four numbers: west, south, east and north, m"),
            ("bounds_m", json!([0, 0, 1]), "`bounds_m` must be four numbers: west, south, east and north, m"),
            ("bounds_m", Value::Null, "`bounds_m` must be four numbers: west, south, east and north, m"),
            ("collection", json!(7), "`collection` must be the id of a world"),
            ("resolution_m", json!("fine"), "`resolution_m` must be a number"),
            ("feature_min_m", json!(true), "`feature_min_m` must be a number"),
            (
                "zoom",
                json!(1),
                "unknown member `zoom`; a job has collection, bounds_m, resolution_m, phenomena, feature_min_m",
            ),
        ] {
            assert_eq!(with(name, value.clone()), Err(said.to_owned()), "{name} {value}");
        }
    }
}
