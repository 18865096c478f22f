//! Ground for rovers, and notes on their drives. Shared by studies and verbs.

use crate::builder::Heightfield;
use crate::job::JobError;
use crate::operations::dem::input_error;
use crate::operations::inputs::read_kept;
use crate::operations::room::Lack;
use rayon::prelude::*;
use sastrugi_mobility::rover::obstacles;
use sastrugi_mobility::rover::parameters::Starts;
use sastrugi_mobility::rover::quantised::{HEIGHT_STEP_MAX_M, height_step_m};
use sastrugi_mobility::rover::{Drive, Ending, RoverParameters, Start, Surroundings, Task};
use sastrugi_navigation::map::{Neighbourhood, Node};
use sastrugi_navigation::{CostModel, Method, RouteError, RouteSettings, SlopeCost, SlopeLimits, TravelMap, line};
use sastrugi_numeric::{Geometry, Grid, Ground, GroundClass, GroundGrid, NoGround, Streams};
use sastrugi_schemas::{ParameterError, RoughnessClass, counted};
use sastrugi_store::dem;
use sastrugi_store::mcap::{ROCK, SAND};
use sastrugi_terrain::planetary::{self, Clearing, GROUND_BYTES_PER_TILE, Planetary, RawPlanetary, WorldGround};
use std::path::Path;

/// Number of tiles of a world kept in memory: 400 squares of 5 m sampled at 2 cm take 0.24 GB.
const TILES: usize = 400;
/// Margin of the map of an oracle beyond all starts and goals, m.
const BEYOND_M: f64 = 10.0;
/// Memory of a cell of this map, bytes: height, steps and block, and its number in the list of blocked cells.
const BYTES_PER_MAP_CELL: f64 = 24.0;
/// Memory of a cell in one search on it, bytes: cost, parent and state, and the queue.
const BYTES_PER_SEARCHED_CELL: f64 = 32.0;
/// Rounding error of places, m.
const ROUNDING_M: f64 = 1e-6;
/// Slope limit of a flat map on which steep cells are blocked already, deg.
const LEVEL_DEG: f64 = 45.0;
/// Maps of a terrain next to its heights.
const CLASS: &str = "class.tif";
const ALBEDO: &str = "albedo.tif";

/// Ground to drive on.
pub enum Grounds {
    /// An unbounded world, generated around the rovers.
    World(Box<WorldGround>),
    /// The cells of a heightfield.
    Grid(GroundGrid),
}

impl Grounds {
    /// Checks that rovers can drive on this heightfield.
    ///
    /// # Errors
    /// A sample spacing that the world does not support.
    pub fn check(field: &Heightfield, parameters: &RoverParameters) -> Result<(), ParameterError> {
        match planetary(field)? {
            Some(world) => world.check_samples(parameters.cell_m),
            None => Ok(()),
        }
    }

    /// Refuses starts and goals that lie off the ground.
    ///
    /// # Errors
    /// The first of them.
    fn check_places(&self, starts: &[Start]) -> Result<(), JobError> {
        match self {
            Self::World(world) => check_ground(&world.view(), starts, ""),
            Self::Grid(grid) => check_ground(grid, starts, &extent(&grid.heights.geometry)),
        }
    }

    /// The ground of a terrain, and the starts of a trial on it; `heights` is the path of its heights, next to which its maps are.
    ///
    /// # Errors
    /// Files that cannot be read, or starts or goals off the ground.
    pub fn new(
        field: &Heightfield,
        heights: &Path,
        parameters: &RoverParameters,
        streams: &Streams,
    ) -> Result<(Self, Vec<Start>), JobError> {
        let starts = unchecked_starts(parameters, streams);
        let grounds = Self::around(field, heights, parameters, &starts)?;
        let starts = match &grounds {
            Self::World(_) => starts,
            Self::Grid(grid) => parameters.starts(streams, |[x, y]| grid.at(x, y).is_ok()),
        };
        grounds.check_places(&starts)?;
        Ok((grounds, starts))
    }

    fn around(
        field: &Heightfield,
        heights: &Path,
        parameters: &RoverParameters,
        starts: &[Start],
    ) -> Result<Self, JobError> {
        if let (Some(world), Some(streams)) = (planetary(field).map_err(JobError::new)?, &field.streams) {
            let clearing = |centre_m: [f64; 2]| Clearing { centre_m, radius_m: parameters.clear_m };
            let places = starts.iter().map(|s| s.start_m).chain(starts.iter().map(|s| s.goal_m));
            let mut clearings: Vec<Clearing> = places.map(clearing).collect();
            // Rovers that start on a circle share one goal.
            clearings.dedup();
            let world = world.with_inputs(&read_kept(heights, &world)?).map_err(JobError::new)?;
            let ground = world.ground(streams, parameters.cell_m, &clearings, TILES).map_err(JobError::new)?;
            return Ok(Self::World(Box::new(ground)));
        }
        let heights_m = dem::read(heights).map_err(input_error)?.grid.to_f32();
        if let Some(step_m) = height_step_m(&heights_m.values).filter(|step_m| *step_m > HEIGHT_STEP_MAX_M) {
            return Err(JobError::input(format!(
                "heights come in steps of {:.1} mm, which rovers would mistake for rocks; steps must be at most {:.0} mm: use \
                 floating-point heights or less relief per file (intended terraces must have fewer than 8 levels)",
                1e3 * step_m,
                1e3 * HEIGHT_STEP_MAX_M
            )));
        }
        let map = |name: &str| -> Result<Option<Grid>, JobError> {
            let path = heights.with_file_name(name);
            path.is_file().then(|| dem::read(&path).map(|read| read.grid).map_err(input_error)).transpose()
        };
        let class = map(CLASS)?.map(|grid| grid.values.iter().map(|code| u8::from(*code >= 0.5)).collect());
        let albedo = map(ALBEDO)?.map(|grid| grid.to_f32().values);
        Ok(Self::Grid(GroundGrid { heights: heights_m, class, albedo }))
    }

    /// Peak memory, bytes.
    pub fn memory_bytes(field: &Heightfield) -> u64 {
        if field.kind == planetary::KIND { TILES as u64 * GROUND_BYTES_PER_TILE } else { 40 * field.cells }
    }
}

/// The path of a rover that knows the complete map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oracle {
    /// Its length, m.
    Found(f64),
    /// The map around all starts and goals has no such path.
    None,
}

impl Oracle {
    /// Name in tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Found(_) => "found",
            Self::None => "none",
        }
    }

    /// Length, m; NaN if there is no path.
    pub fn length_m(&self) -> f64 {
        match self {
            Self::Found(length_m) => *length_m,
            Self::None => f64::NAN,
        }
    }
}

/// For each start, the shortest path around rocks higher than the clearance and around steep sand ([`Task::obstacle_limits`]): lines at any
/// angle on a map of 0.1 m cells that extends beyond all starts and goals.
///
/// # Errors
/// A map on which no path can be planned.
pub fn oracles(grounds: &Grounds, task: &Task, starts: &[Start]) -> Result<Vec<Oracle>, JobError> {
    let geometry = map_around(starts);
    let limits = task.obstacle_limits();
    let row = |n: usize| match grounds {
        Grounds::World(world) => obstacles::blocked(&world.view(), &geometry, n, &limits),
        Grounds::Grid(grid) => obstacles::blocked(grid, &geometry, n, &limits),
    };
    let blocked: Vec<usize> = (0..obstacles::block_rows(&geometry)).into_par_iter().flat_map_iter(row).collect();
    let free = SlopeLimits::new(LEVEL_DEG, LEVEL_DEG).map_err(JobError::new)?;
    let mut map = TravelMap::new(Grid::filled(geometry, 0.0), free).map_err(JobError::new)?;
    blocked.into_iter().for_each(|cell| map.block(cell as Node));
    let costs = CostModel::new(SlopeCost::Linear { up: 0.0, down: 0.0 }, None, &map).map_err(JobError::new)?;
    let ground = line::Ground { map: &map, costs: &costs, clearance: None };
    let settings =
        RouteSettings { method: Method::ThetaStar, neighbourhood: Neighbourhood::Eight, ..Default::default() };
    let one = |start: &Start| -> Result<Oracle, JobError> {
        let cell = |[x, y]: [f64; 2]| geometry.cell_at(x, y).map(|(row, col)| [row, col]);
        let (Some(from), Some(to)) = (cell(start.start_m), cell(start.goal_m)) else { return Ok(Oracle::None) };
        match sastrugi_navigation::plan(&ground, &settings, from, to) {
            Ok(route) => Ok(Oracle::Found(route.smoothed_score.length_m)),
            Err(RouteError::NoPath { .. } | RouteError::Blocked { .. }) => Ok(Oracle::None),
            Err(other) => Err(JobError::new(other)),
        }
    };
    starts.par_iter().map(one).collect()
}

/// The map that extends beyond all starts and goals.
fn map_around(starts: &[Start]) -> Geometry {
    let places = || starts.iter().flat_map(|s| [s.start_m, s.goal_m]);
    let end = |axis: usize, sign: f64| places().map(|at| sign * at[axis]).fold(f64::NEG_INFINITY, f64::max) + BEYOND_M;
    obstacles::map_geometry([-end(0, -1.0), -end(1, -1.0), end(0, 1.0), end(1, 1.0)])
}

/// Peak memory of [`oracles`] for all starts of a trial, bytes: the map around them, and a search on it in every thread.
pub fn oracle_bytes(parameters: &RoverParameters) -> u64 {
    let reach_m = match parameters.starts {
        Starts::Circle => parameters.radius_m,
        Starts::Drawn => parameters.radius_m + parameters.distance_m,
    };
    // The map is extended to whole blocks of cells.
    let side = 2.0 * (reach_m + BEYOND_M) / obstacles::CELL_M + 10.0;
    let searches = rayon::current_num_threads().min(parameters.rovers as usize) as f64;
    (side * side * (BYTES_PER_MAP_CELL + searches * BYTES_PER_SEARCHED_CELL)) as u64
}

/// The world of a planetary terrain; `None` for other terrains.
fn planetary(field: &Heightfield) -> Result<Option<Planetary>, ParameterError> {
    if field.kind != planetary::KIND {
        return Ok(None);
    }
    let raw: RawPlanetary = sastrugi_schemas::kind::read_parameters(&field.parameters)?;
    Planetary::try_from(raw).map(Some)
}

/// Rock and sand as the class codes of recordings.
pub fn ground_codes(around: &Surroundings) -> Grid<u8> {
    let code = |class: &Option<GroundClass>| match class {
        Some(GroundClass::Sand) => SAND,
        Some(GroundClass::Rock) => ROCK,
        None => RoughnessClass::NO_DATA,
    };
    Grid { geometry: around.classes.geometry, values: around.classes.values.iter().map(code).collect() }
}

/// Starts drawn without checking for ground.
fn unchecked_starts(parameters: &RoverParameters, streams: &Streams) -> Vec<Start> {
    parameters.starts(streams, |_| true)
}

/// A note on starts that were redrawn because they or their goals had no ground.
pub fn redrawn(parameters: &RoverParameters, streams: &Streams, starts: &[Start]) -> Option<String> {
    let count = unchecked_starts(parameters, streams).iter().zip(starts).filter(|(first, kept)| first != kept).count();
    let all = counted(starts.len(), "start");
    (count > 0).then(|| format!("redrew {count} of {all}: no ground there or at the goal"))
}

/// Text on the extent of a terrain.
fn extent(g: &Geometry) -> String {
    let [[west, south], [width, height]] = [g.origin, g.size()];
    let (east, north) = (west + width, south + height);
    format!(" (it extends from x = {west:.3} to {east:.3} m and from y = {south:.3} to {north:.3} m)")
}

/// Refuses starts and goals without ground.
fn check_ground(ground: &impl Ground, starts: &[Start], extent: &str) -> Result<(), JobError> {
    for (what, [x, y]) in starts.iter().flat_map(|s| [("start", s.start_m), ("goal", s.goal_m)]) {
        ground.at(x, y).map_err(|nowhere| JobError::input(off_ground(what, &nowhere, extent)))?;
    }
    Ok(())
}

/// The message on a start or goal without ground.
fn off_ground(what: &str, nowhere: &NoGround, extent: &str) -> String {
    let advice = "choose another centre or a smaller `radius_m` or `distance_m`";
    format!("a {what} lies off the terrain: {nowhere}{extent}; {advice}")
}

/// A check of terrains by their size: whether there is ground at all starts and goals on a circle or, if they are drawn, within reach. A world is
/// unbounded.
pub fn room_for(parameters: &RoverParameters) -> impl Fn(&Heightfield, &Geometry) -> Result<(), Lack> {
    // Nothing about places on a circle is drawn.
    let on_circle = match parameters.starts {
        Starts::Circle => unchecked_starts(parameters, &Streams::for_seed(0, "")),
        Starts::Drawn => Vec::new(),
    };
    move |field: &Heightfield, terrain: &Geometry| match on_circle.is_empty() {
        _ if field.kind == planetary::KIND => Ok(()),
        true => room_to_draw(terrain, parameters),
        false => room_on_circle(terrain, parameters.centre_m, &on_circle),
    }
}

/// Checks that the goal and the starts of a circle lie on a terrain.
fn room_on_circle(terrain: &Geometry, goal_m: [f64; 2], starts: &[Start]) -> Result<(), Lack> {
    let goal = [("centre_m", "goal", goal_m)].into_iter();
    let mut places = goal.chain(starts.iter().map(|start| ("radius_m", "start", start.start_m)));
    let Some((key, what, [x_m, y_m])) = places.find(|&(_, _, place)| off_m(terrain, place) > ROUNDING_M) else {
        return Ok(());
    };
    Err(Lack::new(key, off_ground(what, &NoGround { x_m, y_m }, &extent(terrain))))
}

/// Checks that some start drawn in the disk, and some goal for it, can lie on a terrain.
fn room_to_draw(terrain: &Geometry, parameters: &RoverParameters) -> Result<(), Lack> {
    let &RoverParameters { centre_m, radius_m, distance_m, .. } = parameters;
    if off_m(terrain, centre_m) > radius_m + ROUNDING_M {
        let why = format!("the disk in which starts are drawn lies off the terrain{}", extent(terrain));
        return Err(Lack::new("centre_m", format!("{why}; choose another centre or a larger `radius_m`")));
    }
    let (x_m, y_m) = (terrain.x(terrain.cols - 1) - terrain.x(0), terrain.y(0) - terrain.y(terrain.rows - 1));
    let diagonal_m = (x_m * x_m + y_m * y_m).sqrt();
    if distance_m > diagonal_m + ROUNDING_M {
        let why = format!(
            "`distance_m` is {distance_m} m; from start to goal there are at most {diagonal_m:.2} m on the terrain; choose a smaller one"
        );
        return Err(Lack::new("distance_m", why));
    }
    Ok(())
}

/// Distance of a place from the ground of a terrain, which ends at the outer cell centres, m; 0 on it.
fn off_m(terrain: &Geometry, [x, y]: [f64; 2]) -> f64 {
    let beyond = |at: f64, low: f64, high: f64| (low - at).max(at - high).max(0.0);
    let x_m = beyond(x, terrain.x(0), terrain.x(terrain.cols - 1));
    let y_m = beyond(y, terrain.y(terrain.rows - 1), terrain.y(0));
    (x_m * x_m + y_m * y_m).sqrt()
}

/// A note on why a rover did not reach its goal.
pub fn note(drive: &Drive, task: &Task) -> Option<String> {
    let Drive { residual_m, .. } = drive;
    match drive.ending {
        Ending::Reached => None,
        Ending::Lost => Some(format!("stopped where it believed the goal to be, {residual_m:.2} m from it")),
        Ending::NoWay => Some("found no path to the goal".to_owned()),
        Ending::DistanceLimit => {
            Some(format!("reached the distance limit of {} m, {residual_m:.2} m from the goal", task.distance_limit_m))
        }
        Ending::CycleLimit => {
            let limit = counted(task.cycle_limit, "cycle");
            Some(format!("reached the limit of {limit}, {residual_m:.2} m from the goal"))
        }
        Ending::OffGround(nowhere) => Some(nowhere.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The map for which memory is stated is as large as that around any starts and goals, and that of a circle hardly larger.
    #[test]
    fn val_the_map_around_starts_and_goals_is_counted() {
        for (starts, slack) in [(Starts::Circle, 1.1), (Starts::Drawn, 3.0)] {
            for (radius_m, centre_m) in [(25.0, [0.0; 2]), (3.7, [0.26, -1000.13])] {
                let parameters = RoverParameters { starts, radius_m, centre_m, ..RoverParameters::default() };
                let cells = map_around(&unchecked_starts(&parameters, &Streams::for_seed(1, "rover"))).len() as f64;
                let searches = rayon::current_num_threads().min(100) as f64;
                let bytes = cells * (BYTES_PER_MAP_CELL + searches * BYTES_PER_SEARCHED_CELL);
                let stated = oracle_bytes(&parameters) as f64;
                assert!(
                    stated >= bytes && stated <= slack * bytes,
                    "{starts:?} {radius_m} m: {stated} of {bytes} bytes"
                );
            }
        }
        let huge = RoverParameters { radius_m: 1e300, ..RoverParameters::default() };
        assert_eq!(oracle_bytes(&huge), u64::MAX);
    }
}
