//! A world, whose patches are generated on demand in tiles of 256 x 256 samples that the library keeps.
//!
//! Samples of patches lie on lattice points, those of map tiles half-way between them. A map tile with sample spacing `s` leaves out craters and
//! rocks narrower than `2 s`: they would be indistinguishable from noise, the heights of a crater average to 0 over its area, and the cost of a tile
//! becomes independent of the zoom. Rocks that are left out still count in the share of rock.

use crate::grid::{TILE, TileGrid, TileIndex};
use crate::http::Problem;
use crate::layers::ELEVATION_SPAN_M;
use crate::library::{Library, Priority, TileKey, Unavailable};
use crate::samples::Samples;
use quick_cache::sync::Cache;
use sastrugi_numeric::Geometry;
use sastrugi_stages::Error;
use sastrugi_stages::verbs::served::ServedWorld;
use sastrugi_terrain::planetary::{self, Patch, Request, Window};
use sastrugi_terrain::{Input, Windows};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::sync::Arc;
use tokio::task::JoinSet;

/// Levels of the map, from 256 pixels over the complete square to the finest.
const LEVELS: u32 = 17;
/// Finest pixel size in basic spacings; 2, so that pixel centres are lattice points.
const FINEST_SPACINGS: f64 = 2.0;
/// Map tiles leave out features narrower than this many pixels.
pub const FEATURE_PIXELS: f64 = 2.0;
/// Largest lattice index.
const LATTICE_MAX: f64 = (1u64 << 52) as f64;
/// Coarsest spacing, in doublings of the basic spacing.
const ZOOM_MAX: u32 = 40;
/// Number of subsets of processes whose grounds are cached.
const GROUNDS: usize = 32;
/// A window of at most this many samples is always generated on its own.
const FEW: usize = 16;
/// Tiles of one request that are fetched from the library at once.
const AT_ONCE: usize = 16;
/// Windows up to this size may be generated on their own; larger ones are generated in tiles, concurrently.
const ALONE_MAX: usize = TILE + 2;
/// A window is generated on its own if its tiles are expected to take this many times as long.
const ALONE_GAIN: f64 = 2.0;
/// Samples along each side when sampling the complete map for its range of heights.
const LOOK: usize = 64;
/// `elevation` is centred on the range of a world (5 to 95 % of its heights) if that range is at most this share of the span of `elevation`.
const RANGE_SHARE: f64 = 0.75;
/// Relative tolerance within which a sample spacing equals that of a lattice.
const SAME: f64 = 1e-9;
/// Tolerance within which a position is a lattice point, in spacings.
const WHOLE: f64 = 1e-6;
/// Largest expected processor time of a tile, s; the craters and rocks of such a tile take up to 3 GB.
const TILE_SECONDS: f64 = 10.0;

/// Processes and features that a request selects.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Selection {
    /// Processes to apply, as ascending indices from 0; all if absent.
    pub phenomena: Option<Vec<usize>>,
    /// Craters and rocks up to this width are left out, m.
    pub feature_min_m: f64,
}

/// How the samples of a window are generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// In tiles that the library keeps, which serve the surroundings too.
    Tiles,
    /// On its own if that is cheaper and no request has used its tiles before, else in tiles.
    Either,
    /// On its own; suitable for a few samples.
    Alone,
}

impl Piece {
    /// On its own for a few samples; else whichever is cheaper.
    pub fn of([rows, cols]: [usize; 2]) -> Self {
        if rows * cols <= FEW { Self::Alone } else { Self::Either }
    }
}

/// A world.
pub struct World {
    served: ServedWorld,
    /// Its tile grid.
    pub grid: TileGrid,
    /// Hash of everything samples depend on: parameters, streams, and the revision of the generator.
    pub digest: String,
    range_m: [f64; 2],
    middle_m: f64,
    /// Position of lattice point 0, m.
    offset_m: [f64; 2],
    /// Largest number of doublings of the basic spacing.
    zoom_max: u32,
    /// The ground with all processes applied.
    complete: Arc<dyn Windows>,
    /// Grounds with a subset of the processes applied, by indices of the processes.
    parts: Cache<Vec<usize>, Arc<dyn Windows>>,
}

impl World {
    /// Opens a world, and samples it for its range of heights.
    ///
    /// # Errors
    /// A missing input.
    pub fn open(served: ServedWorld) -> Result<Self, Error> {
        let (spacing_m, offset_m) = (served.spacing_m(), served.offset_m());
        let (grid, zoom_max) = match served.dem() {
            None => (square(spacing_m), ZOOM_MAX),
            Some(dem) => bounded(spacing_m, offset_m, &dem.geometry),
        };
        // The window of the file does not affect the ground.
        let mut parameters = served.parameters.clone();
        if let Value::Object(map) = &mut parameters {
            for key in ["size_m", "size_px", "origin_m", "cell_m"] {
                map.remove(key);
            }
        }
        let inputs: Vec<String> = served.inputs.iter().map(content).collect();
        let what = format!("{} {} {parameters} {offset_m:?} {inputs:?}", crate::revision(), served.streams.label());
        let digest = super::digest(&what);
        let (complete, range_m) = (served.ground(|_| true)?, [0.0; 2]);
        let parts = Cache::new(GROUNDS);
        let mut world = Self { served, grid, digest, range_m, middle_m: 0.0, offset_m, zoom_max, complete, parts };
        world.range_m = world.look();
        world.middle_m = world.middle();
        Ok(world)
    }

    /// The 5 % and 95 % quantiles of the map's heights, from the posts of its DEM or from samples.
    fn look(&self) -> [f64; 2] {
        let mut heights = self.served.dem().map_or_else(|| self.sampled(), |dem| dem.values.clone());
        heights.retain(|z| z.is_finite());
        let mut part = |share: f64| {
            let place = (share * heights.len() as f64) as usize;
            if heights.is_empty() { 0.0 } else { *heights.select_nth_unstable_by(place, f64::total_cmp).1 }
        };
        [part(0.05), part(0.95)]
    }

    /// Height that `elevation` is centred on: the middle of the range of heights if that fits; else the height at the centre of the file's window, if
    /// there is ground.
    fn middle(&self) -> f64 {
        let [low, high] = self.range_m;
        if high - low <= RANGE_SHARE * ELEVATION_SPAN_M {
            return 0.5 * (low + high);
        }
        let [west, south, east, north] = self.home_m();
        let zoom = self.zoom_below(self.cell_m());
        let at = self.to_lattice([0.5 * (west + east), 0.5 * (south + north)]);
        let [west, south] = at.map(|m| (m / self.step_m(zoom)).round() as i64);
        let window = Window { zoom, west, south, cols: 1, rows: 1, centred: false };
        let request = Request { window, feature_min_m: 0.0, cancel: None };
        let height = self.complete.patch_for(&request).map_or(f64::NAN, |patch| patch.heights[0]);
        if height.is_finite() { height } else { 0.5 * (low + high) }
    }

    /// Samples of the heights of an unbounded world.
    fn sampled(&self) -> Vec<f64> {
        let [west, south, east, north] = self.grid.bounds_m();
        let zoom = self.zoom_below((east - west).max(north - south) / LOOK as f64);
        let step = self.step_m(zoom);
        let [west, south] = self.to_lattice([west, south]).map(|m| (m / step).round() as i64);
        let window = Window { zoom, west, south, cols: LOOK, rows: LOOK, centred: false };
        let request = Request { window, feature_min_m: FEATURE_PIXELS * step, cancel: None };
        self.complete.patch_for(&request).map_or_else(Vec::new, |patch| patch.heights)
    }

    /// The ground with a subset of the processes applied; it shares its large data with the ground of all.
    fn ground(&self, phenomena: &Option<Vec<usize>>) -> Result<Arc<dyn Windows>, Problem> {
        let Some(places) = phenomena else { return Ok(Arc::clone(&self.complete)) };
        let make = || self.served.ground(|place| places.contains(&place));
        self.parts.get_or_insert_with(places, make).map_err(|e| Problem::internal(e.to_string()))
    }

    /// A position relative to lattice point 0, m.
    pub fn to_lattice(&self, place_m: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| place_m[axis] - self.offset_m[axis])
    }

    /// Id in URLs.
    pub fn id(&self) -> &str {
        &self.served.id
    }

    /// Licence of the study that it belongs to.
    pub fn license(&self) -> Option<&str> {
        self.served.license.as_deref()
    }

    /// Basic spacing, m.
    pub fn spacing_m(&self) -> f64 {
        self.served.spacing_m()
    }

    /// Sample spacing that its file specifies, m.
    pub fn cell_m(&self) -> f64 {
        self.served.window().1
    }

    /// Window of its file: west, south, east and north, m.
    pub fn home_m(&self) -> [f64; 4] {
        let ([west, south], cell_m, size_px) = self.served.window();
        let [cols, rows] = size_px.unwrap_or([512; 2]);
        [west, south, west + f64::from(cols) * cell_m, south + f64::from(rows) * cell_m]
    }

    /// The 5 % and 95 % quantiles of the map's heights, m.
    pub fn height_range_m(&self) -> [f64; 2] {
        self.range_m
    }

    /// Height that tiles of the layer `elevation` are centred on, m.
    pub fn middle_height_m(&self) -> f64 {
        self.middle_m
    }

    fn kinds(&self) -> impl Iterator<Item = &'static str> {
        self.served.processes().iter().map(planetary::RawProcess::kind)
    }

    /// Whether it has albedo, and whether it has rocks.
    pub fn has(&self) -> [bool; 2] {
        [self.complete.has_albedo(), self.complete.has_rocks()]
    }

    /// Its processes.
    pub fn phenomena(&self) -> Value {
        let process = |(n, process): (usize, &planetary::RawProcess)| json!({ "number": n + 1, "kind": process.kind(), "summary": process.summary() });
        self.served.processes().iter().enumerate().map(process).collect()
    }

    /// Indices of the processes with these numbers, which count from 1; `None` if these are all.
    ///
    /// # Errors
    /// A number that is not in the list.
    pub fn choose(&self, numbers: Option<Vec<usize>>) -> Result<Option<Vec<usize>>, Problem> {
        let Some(mut numbers) = numbers else { return Ok(None) };
        let count = self.served.processes().len();
        if let Some(n) = numbers.iter().find(|n| !(1..=count).contains(*n)) {
            return Err(Problem::bad_request(format!(
                "`phenomena`: no process {n}; {}",
                match count {
                    0 => "this world has none, so omit the parameter or leave it empty".to_owned(),
                    _ => format!(
                        "this world has processes 1 to {count}: {}",
                        self.kinds().collect::<Vec<_>>().join(", ")
                    ),
                }
            )));
        }
        numbers.sort_unstable();
        numbers.dedup();
        let places: Vec<usize> = numbers.into_iter().map(|n| n - 1).collect();
        Ok((places.len() < count).then_some(places))
    }

    /// A study section that reproduces the patch.
    ///
    /// # Errors
    /// A window that `planetary` cannot generate, with samples between lattice points.
    pub fn snippet(&self, origin_m: [f64; 2], size_px: [usize; 2], cell_m: f64) -> Result<String, Problem> {
        let failed = |e: Error| Problem::internal(e.to_string());
        let mut parameters = self.served.parameters.clone();
        let Value::Object(map) = &mut parameters else {
            return Err(Problem::internal("the parameters are not a table"));
        };
        map.remove("size_m");
        map.insert("size_px".to_owned(), json!(size_px));
        map.insert("cell_m".to_owned(), json!(cell_m));
        map.insert("origin_m".to_owned(), json!(origin_m));
        let kind = self.served.kind();
        if kind != planetary::KIND {
            return Err(Problem::bad_request(format!(
                "study sections are for worlds of kind `{}`; copy the parameters of this file into a [[terrain]] instead",
                planetary::KIND
            )));
        }
        sastrugi_terrain::prepare(kind, &parameters)
            .map_err(|e| Problem::bad_request(format!("a study cannot generate this patch: {e}")))?;
        let (head, seed) = seed_lines(&self.served.streams.label(), self.id());
        sastrugi_stages::verbs::served::section(&head, seed, kind, &parameters).map_err(failed)
    }

    /// Sample spacing after `zoom` doublings, m.
    pub fn step_m(&self, zoom: u32) -> f64 {
        self.spacing_m() * (1u64 << zoom) as f64
    }

    /// Spacing of the lattice whose points samples `step_m` apart are taken from, m.
    pub fn lattice_m(&self, step_m: f64) -> f64 {
        self.step_m(self.zoom_below(step_m))
    }

    /// Largest number of doublings with a spacing of at most `step_m`.
    fn zoom_below(&self, step_m: f64) -> u32 {
        (0..=self.zoom_max).take_while(|k| self.step_m(*k) <= step_m * (1.0 + SAME)).last().unwrap_or(0)
    }

    /// Number of doublings with exactly this spacing, if there is one.
    pub fn zoom_of(&self, step_m: f64) -> Option<u32> {
        (0..=self.zoom_max).find(|zoom| (self.step_m(*zoom) / step_m - 1.0).abs() <= SAME)
    }

    /// Refuses columns or rows of a lattice beyond the end of the world.
    ///
    /// # Errors
    /// The index is beyond the end of the world.
    pub fn check_reach(&self, zoom: u32, index: f64) -> Result<(), Problem> {
        if (index.abs() + TILE as f64) * (1u64 << zoom) as f64 <= LATTICE_MAX {
            return Ok(());
        }
        let end_m = LATTICE_MAX * self.spacing_m();
        Err(Problem::unprocessable(format!(
            "the world ends {end_m:.3e} m from its origin; choose a position within that distance"
        )))
    }

    /// Column or row of the lattice at a position; `None` if the position is not on the lattice.
    fn on_lattice(at_m: f64, step_m: f64) -> Option<i64> {
        let quotient = at_m / step_m;
        let is_on = (quotient - quotient.round()).abs() <= WHOLE + 4.0 * f64::EPSILON * quotient.abs();
        is_on.then(|| quotient.round() as i64)
    }
}

/// Window of a lattice tile, from the tile's column and row.
fn tile_window(zoom: u32, [col, row]: [i64; 2]) -> Window {
    let (west, south) = (TILE as i64 * col, TILE as i64 * row);
    Window { zoom, west, south, cols: TILE, rows: TILE, centred: false }
}

/// The square around the origin that the map of an unbounded world covers.
fn square(spacing_m: f64) -> TileGrid {
    let finest_m = FINEST_SPACINGS * spacing_m;
    let side = finest_m * TILE as f64 * f64::from(1u32 << (LEVELS - 1));
    TileGrid { origin_m: [-0.5 * side, 0.5 * side], size_m: [side; 2], finest_m, levels: LEVELS }
}

/// Tile grid of a ground within the outer posts of a DEM, with pixels from two basic spacings to half the post spacing, and the largest number of
/// doublings of the basic spacing.
fn bounded(spacing_m: f64, offset_m: [f64; 2], posts: &Geometry) -> (TileGrid, u32) {
    let coarsest_m = 0.5 * posts.cell[0].min(posts.cell[1]);
    let zoom_max = (1..ZOOM_MAX).take_while(|k| spacing_m * (1u64 << k) as f64 <= coarsest_m).last().unwrap_or(1);
    let step_m = spacing_m * (1u64 << zoom_max) as f64;
    let [west, south] = [posts.x(0), posts.y(posts.rows - 1)];
    let [east, north] = [posts.x(posts.cols - 1), posts.y(0)];
    let edge = |at: f64, axis: usize, to: fn(f64) -> f64| to((at - offset_m[axis]) / step_m) * step_m + offset_m[axis];
    let (west, north) = (edge(west, 0, f64::floor), edge(north, 1, f64::ceil));
    let size_m = [edge(east, 0, f64::ceil) - west, north - edge(south, 1, f64::floor)];
    (TileGrid { origin_m: [west, north], size_m, finest_m: FINEST_SPACINGS * spacing_m, levels: zoom_max }, zoom_max)
}

/// Hash of the content of an input.
fn content(input: &Input) -> String {
    let mut hash = blake3::Hasher::new();
    let mut add = |value: &f64| {
        hash.update(&value.to_le_bytes());
    };
    match input {
        Input::Grid(grid) => {
            let Geometry { rows, cols, cell, origin } = grid.geometry;
            [rows as f64, cols as f64].iter().chain(&cell).chain(&origin).chain(&grid.values).for_each(&mut add);
        }
        Input::Points(points) => points.iter().flatten().for_each(&mut add),
    }
    hash.finalize().to_hex()[..32].to_owned()
}

/// A comment on how to reproduce the random draws, and the seed that the section states.
fn seed_lines(label: &str, id: &str) -> (String, Option<u64>) {
    let words: Vec<&str> = label.split('/').collect();
    match words.as_slice() {
        ["seed", seed, ..] => (format!("id = \"{id}\"\n"), seed.parse().ok()),
        ["item", seed, _, item, ..] => (
            format!("# To get the same ground, set `seed = {seed}` in [study] and keep this id.\nid = \"{item}\"\n"),
            None,
        ),
        _ => (format!("id = \"{id}\"\n"), None),
    }
}

/// How a window of samples is generated.
#[derive(Clone)]
pub struct Maker {
    /// Cache of tiles.
    pub library: Arc<Library>,
    /// Whether a client is waiting.
    pub priority: Priority,
    /// Largest expected processor time of all tiles of one request, s.
    pub seconds_max: f64,
}

impl World {
    /// Samples of a map tile with a margin of one on every side.
    ///
    /// # Errors
    /// The library is busy.
    pub async fn map_tile(
        &self,
        maker: &Maker,
        tile: TileIndex,
        phenomena: Option<&[usize]>,
    ) -> Result<Arc<Samples>, Problem> {
        // The finest pixels are two basic spacings wide.
        let zoom = self.grid.levels - tile.level;
        let corner = self.to_lattice(self.grid.origin_m).map(|m| (m / self.step_m(zoom)).round() as i64);
        let side = TILE as i64;
        let (west, north) = (corner[0] + side * i64::from(tile.col), corner[1] - side * i64::from(tile.row));
        let (west, south, cols) = (west - 1, north - side - 1, TILE + 2);
        let window = Window { zoom, west, south, cols, rows: cols, centred: true };
        let selection = Selection {
            phenomena: phenomena.map(<[usize]>::to_vec),
            feature_min_m: FEATURE_PIXELS * self.grid.resolution_m(tile.level),
        };
        self.window(maker, window, &selection).await
    }

    fn key(&self, window: &Window, selection: &Selection) -> TileKey {
        let Window { zoom, west, south, cols, rows, centred } = window;
        TileKey::new(format!(
            "{} {:?} {:?} {zoom} {west} {south} {cols} {rows} {centred}",
            self.digest, selection.phenomena, selection.feature_min_m
        ))
    }

    /// Samples of one window, cached by the library.
    async fn window(&self, maker: &Maker, window: Window, selection: &Selection) -> Result<Arc<Samples>, Problem> {
        let key = self.key(&window, selection);
        let ground = self.ground(&selection.phenomena)?;
        self.check_seconds(&*ground, &window, selection.feature_min_m, [1.0, TILE_SECONDS])?;
        let feature_min_m = selection.feature_min_m;
        let make = move |cancel: &std::sync::atomic::AtomicBool| {
            let request = Request { window, feature_min_m, cancel: Some(cancel) };
            Some(from_south(&*ground, &ground.patch_for(&request)?, feature_min_m))
        };
        maker.library.tile(key, maker.priority, make).await.map_err(|e| match e {
            Unavailable::Busy => Problem::unavailable("the tile queue is full; try again in 2 s"),
            Unavailable::Failed(_) => Problem::internal(e.to_string()),
        })
    }

    /// Refuses lattice tiles whose expected processor time is too long, either together or for one of them.
    ///
    /// # Errors
    /// The message names a `feature_min_m` that would be accepted.
    pub fn check_work(&self, zoom: u32, tiles: u64, selection: &Selection, seconds_max: f64) -> Result<(), Problem> {
        let ground = self.ground(&selection.phenomena)?;
        let window = tile_window(zoom, [0, 0]);
        self.check_seconds(&*ground, &window, selection.feature_min_m, [1.0, TILE_SECONDS])?;
        self.check_seconds(&*ground, &window, selection.feature_min_m, [tiles as f64, seconds_max])
    }

    /// Refuses `tiles` windows like this one if their expected processor time on one core exceeds the limit.
    fn check_seconds(
        &self,
        ground: &dyn Windows,
        window: &Window,
        feature_min_m: f64,
        [tiles, limit_s]: [f64; 2],
    ) -> Result<(), Problem> {
        let expected_s = |feature_min_m: f64| {
            tiles * ground.expected_seconds(&Request { window: *window, feature_min_m, cancel: None })
        };
        let wanted_s = expected_s(feature_min_m);
        if wanted_s <= limit_s {
            return Ok(());
        }
        let mut wider = (0..64).map(|k| self.step_m(window.zoom) * (1u64 << k) as f64).filter(|m| *m > feature_min_m);
        let advice = wider.find(|m| expected_s(*m) <= limit_s);
        let advice = advice.map(|m| format!("`feature_min_m={m}` to leave out craters and rocks up to that width"));
        let detail = if tiles > 1.0 {
            format!(
                "this request takes about {wanted_s:.0} s of processor time; the limit is {limit_s:.0} s. Request a smaller area{}",
                advice.map_or_else(String::new, |advice| format!(", or set {advice}"))
            )
        } else {
            format!(
                "at this spacing a tile covers so many craters and rocks that it takes about {wanted_s:.0} s of processor time; the limit is \
                 {limit_s:.0} s. {}",
                advice.map_or_else(|| "Request a finer resolution".to_owned(), |advice| format!("Set {advice}"))
            )
        };
        Err(Problem::too_large(detail, "processor_seconds_max", limit_s as u64))
    }

    /// Refuses samples at some positions whose expected total processor time is too long, each generated on its own or from its tile.
    ///
    /// # Errors
    /// As [`Self::check_work`].
    pub fn check_places(
        &self,
        places: &[[f64; 2]],
        step_m: f64,
        selection: &Selection,
        piece: Piece,
        seconds_max: f64,
    ) -> Result<(), Problem> {
        let zoom = self.zoom_below(step_m);
        if piece == Piece::Alone {
            let window = Window { zoom, west: 0, south: 0, cols: 2, rows: 2, centred: false };
            let (ground, count) = (self.ground(&selection.phenomena)?, places.len() as f64);
            return self.check_seconds(&*ground, &window, selection.feature_min_m, [count, seconds_max]);
        }
        let side_m = self.step_m(zoom) * TILE as f64;
        let tile = |place: &[f64; 2]| self.to_lattice(*place).map(|at| (at / side_m).floor() as i64);
        let tiles: HashSet<[i64; 2]> = places.iter().map(tile).collect();
        self.check_work(zoom, tiles.len() as u64, selection, seconds_max)
    }

    /// The lattice tiles that a window overlaps, as `(column, row)`.
    pub fn tiles_of(first: [i64; 2], [rows, cols]: [usize; 2]) -> Vec<[i64; 2]> {
        let side = TILE as i64;
        let span = |first: i64, count: usize| first.div_euclid(side)..=(first + count as i64 - 1).div_euclid(side);
        span(first[1], rows).flat_map(|row| span(first[0], cols).map(move |col| [col, row])).collect()
    }

    /// Samples of one lattice tile.
    ///
    /// # Errors
    /// The library is busy.
    pub async fn lattice_tile(
        &self,
        maker: &Maker,
        zoom: u32,
        [col, row]: [i64; 2],
        selection: &Selection,
    ) -> Result<Arc<Samples>, Problem> {
        self.window(maker, tile_window(zoom, [col, row]), selection).await
    }

    /// The keys of a window's tiles if the window is better generated on its own: that is cheaper, and no other request has used one of these tiles.
    /// Clients that sample scattered places then get their samples soon, and those that move on to adjacent windows find tiles.
    fn alone(
        &self,
        library: &Library,
        window: &Window,
        tiles: &[[i64; 2]],
        selection: &Selection,
    ) -> Result<Option<Vec<TileKey>>, Problem> {
        if window.cols.max(window.rows) > ALONE_MAX {
            return Ok(None);
        }
        let ground = self.ground(&selection.phenomena)?;
        let expected_s = |window: Window| {
            ground.expected_seconds(&Request { window, feature_min_m: selection.feature_min_m, cancel: None })
        };
        let own_s = expected_s(*window);
        let tiles_s: f64 = tiles.iter().map(|tile| expected_s(tile_window(window.zoom, *tile))).sum();
        if own_s > TILE_SECONDS || ALONE_GAIN * own_s > tiles_s {
            return Ok(None);
        }
        let keys: Vec<TileKey> =
            tiles.iter().map(|tile| self.key(&tile_window(window.zoom, *tile), selection)).collect();
        let alone = library.has(&self.key(window, selection)) || !library.knows_any(&keys);
        Ok(alone.then_some(keys))
    }

    /// Samples `step_m` apart with the south-west one at `origin_m`: exact where they fall on lattice points, else bilinear between the points of the
    /// next finer lattice.
    ///
    /// # Errors
    /// Positions beyond the end of the world; a busy library.
    pub async fn samples(
        self: &Arc<Self>,
        maker: &Maker,
        origin_m: [f64; 2],
        step_m: f64,
        shape: [usize; 2],
        selection: &Selection,
        piece: Piece,
    ) -> Result<Samples, Problem> {
        let zoom = self.zoom_below(step_m);
        let own_m = self.step_m(zoom);
        if step_m > 2.0 * own_m {
            let more = if self.served.dem().is_some() { "; for coarser samples use the DEM itself" } else { "" };
            return Err(Problem::bad_request(format!(
                "`resolution_m` must be at most {} m, got {step_m} m{more}",
                2.0 * own_m
            )));
        }
        let from_m = self.to_lattice(origin_m);
        let same = (step_m / own_m - 1.0).abs() <= SAME;
        let [rows, cols] = shape;
        if let (true, Some(west), Some(south)) =
            (same, Self::on_lattice(from_m[0], own_m), Self::on_lattice(from_m[1], own_m))
        {
            return self.lattice(maker, zoom, [west, south], shape, selection, piece).await;
        }
        let first = from_m.map(|at| (at / own_m).floor() as i64);
        let last = |at: f64, count: usize, first: i64| {
            let end = ((at + (count - 1) as f64 * step_m) / own_m).floor() as i64;
            (end - first + 2) as usize
        };
        let (own_cols, own_rows) = (last(from_m[0], cols, first[0]), last(from_m[1], rows, first[1]));
        let fine = self.lattice(maker, zoom, first, [own_rows, own_cols], selection, piece).await?;
        let across = |c: usize| (from_m[0] + c as f64 * step_m) / own_m - first[0] as f64;
        let up = |r: usize| (from_m[1] + (rows - 1 - r) as f64 * step_m) / own_m - first[1] as f64;
        let down: Vec<f64> = (0..rows).map(|r| (own_rows - 1) as f64 - up(r)).collect();
        let right: Vec<f64> = (0..cols).map(across).collect();
        Ok(fine.between(&down, &right))
    }

    /// The position nearest to `at_m` on the lattice with spacing `step_m`.
    pub fn snapped(&self, at_m: [f64; 2], step_m: f64) -> [f64; 2] {
        let on = self.to_lattice(at_m).map(|m| (m / step_m).round() * step_m);
        [0, 1].map(|axis| on[axis] + self.offset_m[axis])
    }

    /// Samples at lattice points, from their tiles or generated on their own.
    async fn lattice(
        self: &Arc<Self>,
        maker: &Maker,
        zoom: u32,
        first: [i64; 2],
        shape: [usize; 2],
        selection: &Selection,
        piece: Piece,
    ) -> Result<Samples, Problem> {
        for (first, count) in first.into_iter().zip([shape[1], shape[0]]) {
            self.check_reach(zoom, first as f64)?;
            self.check_reach(zoom, first as f64 + count as f64)?;
        }
        let [rows, cols] = shape;
        let window = Window { zoom, west: first[0], south: first[1], cols, rows, centred: false };
        if piece == Piece::Alone {
            return self.window(maker, window, selection).await.map(|samples| Samples::clone(&samples));
        }
        let places = Self::tiles_of(first, shape);
        // A request must be refused or not regardless of how its samples are generated.
        self.check_work(zoom, places.len() as u64, selection, maker.seconds_max)?;
        if piece == Piece::Either
            && let Some(tiles) = self.alone(&maker.library, &window, &places, selection)?
        {
            let samples = self.window(maker, window, selection).await?;
            maker.library.remember(&tiles);
            return Ok(Samples::clone(&samples));
        }
        let mut places = places.into_iter();
        let (mut tiles, mut made) = (JoinSet::new(), None::<Samples>);
        loop {
            for place in places.by_ref().take(AT_ONCE - tiles.len()) {
                let (world, maker, selection) = (Arc::clone(self), maker.clone(), selection.clone());
                tiles.spawn(async move { (place, world.lattice_tile(&maker, zoom, place, &selection).await) });
            }
            let Some(joined) = tiles.join_next().await else { break };
            let (place, tile) = joined.map_err(|e| Problem::internal(e.to_string()))?;
            let tile = tile?;
            made.get_or_insert_with(|| tile.void_like(shape)).paste(&tile, first, place);
        }
        made.ok_or_else(|| Problem::bad_request("`size` must be at least 1,1"))
    }
}

impl Samples {
    /// Samples without data, with the same fields as `self`.
    fn void_like(&self, [rows, cols]: [usize; 2]) -> Self {
        let void = || vec![f32::NAN; rows * cols];
        let like = |field: &Option<Vec<f32>>| field.as_ref().map(|_| void());
        Self {
            rows,
            cols,
            heights: void(),
            albedo: like(&self.albedo),
            rock: like(&self.rock),
            rock_potential: like(&self.rock_potential),
        }
    }

    /// Copies the part of a tile (at a column and row of tiles) that lies in the window starting at `first`; rows of tiles count from the south.
    fn paste(&mut self, tile: &Self, first: [i64; 2], [col, row]: [i64; 2]) {
        let side = TILE as i64;
        let span = |tile: i64, first: i64, count: usize| {
            let (from, to) = ((side * tile).max(first), (side * (tile + 1)).min(first + count as i64));
            ((from - first) as usize, (from - side * tile) as usize, (to - from).max(0) as usize)
        };
        let (to_col, from_col, width) = span(col, first[0], self.cols);
        let (to_row, from_row, height) = span(row, first[1], self.rows);
        let (rows, cols) = (self.rows, self.cols);
        let copy = |to: &mut [f32], from: &[f32]| {
            for k in 0..height {
                let to_line = (rows - 1 - (to_row + k)) * cols + to_col;
                let from_line = (tile.rows - 1 - (from_row + k)) * tile.cols + from_col;
                to[to_line..to_line + width].copy_from_slice(&from[from_line..from_line + width]);
            }
        };
        copy(&mut self.heights, &tile.heights);
        for (to, from) in [
            (&mut self.albedo, &tile.albedo),
            (&mut self.rock, &tile.rock),
            (&mut self.rock_potential, &tile.rock_potential),
        ] {
            if let (Some(to), Some(from)) = (to, from) {
                copy(to, from);
            }
        }
    }
}

/// Converts a patch to row 0 in the north and to single precision, as in files; rocks that were left out count with their share.
fn from_south(ground: &dyn Windows, patch: &Patch, feature_min_m: f64) -> Samples {
    let Window { rows, cols, .. } = patch.window;
    let turned =
        |values: &[f64]| -> Vec<f32> { values.chunks_exact(cols).rev().flatten().map(|v| *v as f32).collect() };
    let rock = ground.has_rocks().then(|| {
        let share = |k: usize| match patch.class[k] {
            planetary::ROCK => 1.0,
            _ => ground.rock_cover_below(patch.rock_potential[k], feature_min_m),
        };
        turned(&(0..rows * cols).map(share).collect::<Vec<f64>>())
    });
    Samples {
        rows,
        cols,
        heights: turned(&patch.heights),
        albedo: ground.has_albedo().then(|| turned(&patch.albedo)),
        rock,
        rock_potential: ground.has_rocks().then(|| turned(&patch.rock_potential)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_windows_overlap_their_tiles() {
        assert_eq!(World::tiles_of([0, 0], [256, 256]), [[0, 0]]);
        assert_eq!(World::tiles_of([-1, 0], [1, 2]), [[-1, 0], [0, 0]]);
        assert_eq!(World::tiles_of([0, -1], [257, 1]), [[0, -1], [0, 0]]);
        assert_eq!(World::tiles_of([255, 255], [2, 2]), [[0, 0], [1, 0], [0, 1], [1, 1]]);
    }

    /// A window over four tiles, whose samples tell their column and row.
    #[test]
    fn val_windows_are_put_together_from_tiles() {
        let value = |col: i64, row: i64| (col + 1000 * row) as f32;
        let side = TILE as i64;
        let tile = |[col, row]: [i64; 2]| {
            // Row 0 of samples is the northernmost.
            let heights: Vec<f32> =
                (0..side * side).map(|k| value(side * col + k % side, side * row + side - 1 - k / side)).collect();
            let rock = Some(heights.iter().map(|z| -z).collect());
            Samples { rock, heights, ..Samples::empty(TILE, TILE) }
        };
        let (first, [rows, cols]) = ([250, -3], [10, 12]);
        let mut made = tile([0, 0]).void_like([rows, cols]);
        assert!(made.is_void() && made.rock.is_some() && made.albedo.is_none());
        let tiles = World::tiles_of(first, [rows, cols]);
        assert_eq!(tiles.len(), 4);
        tiles.into_iter().for_each(|place| made.paste(&tile(place), first, place));
        for k in 0..rows * cols {
            let expected = value(first[0] + (k % cols) as i64, first[1] + (rows - 1 - k / cols) as i64);
            assert_eq!((made.heights[k], made.rock.as_ref().map(|rock| rock[k])), (expected, Some(-expected)), "{k}");
        }
    }

    #[test]
    fn val_positions_on_the_lattice() {
        let on = [0.3, -0.2, 0.35, 1e9, 0.1 + 1e-9].map(|at_m| World::on_lattice(at_m, 0.1));
        assert_eq!(on, [Some(3), Some(-2), None, Some(10_000_000_000), Some(1)]);
    }

    /// Posts 2 m apart, their centres from 1 to 17 m and from 1 to 9 m, with details down to 0.25 m: pixels of 0.5 and 1 m.
    #[test]
    fn val_the_map_of_a_dem_covers_its_posts() {
        let posts = Geometry { rows: 5, cols: 9, cell: [2.0; 2], origin: [0.0; 2] };
        let expected = TileGrid { origin_m: [1.0, 9.0], size_m: [16.0, 8.0], finest_m: 0.5, levels: 2 };
        assert_eq!(bounded(0.25, [0.0; 2], &posts), (expected, 2));
        // A lattice that starts half a metre off reaches beyond the posts.
        let expected = TileGrid { origin_m: [0.5, 9.5], size_m: [17.0, 9.0], ..expected };
        assert_eq!(bounded(0.25, [0.5; 2], &posts), (expected, 2));
    }

    #[test]
    fn val_a_few_samples_are_generated_on_their_own() {
        let pieces = [[4, 4], [16, 1], [17, 1], [4, 5]].map(Piece::of);
        assert_eq!(pieces, [Piece::Alone, Piece::Alone, Piece::Either, Piece::Either]);
    }

    #[test]
    fn val_sections_state_where_their_draws_come_from() {
        assert_eq!(seed_lines("seed/7/terrain", "ramp"), ("id = \"ramp\"\n".to_owned(), Some(7)));
        let (head, seed) = seed_lines("item/7/terrain/hills", "ramp");
        assert!(head.contains("`seed = 7`") && head.ends_with("id = \"hills\"\n"), "{head}");
        assert_eq!(seed, None);
    }
}
