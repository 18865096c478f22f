//! Prepares ground for route planning. Shared by studies, verbs and missions.

use crate::job::JobError;
use sastrugi_mobility::vehicle::{SlopeAbility, SurfaceParameters, Vehicle};
use sastrugi_navigation::clearance::Clearance;
use sastrugi_navigation::line::Ground;
use sastrugi_navigation::obstacles::{self, Polygon};
use sastrugi_navigation::pairs::Pair;
use sastrugi_navigation::parameters::{Cost, RouteParameters};
use sastrugi_navigation::{CostModel, Node, Planner, Route, RouteError, RouteSettings, TravelMap};
use sastrugi_numeric::{Geometry, Grid, Surface, resample};
use sastrugi_roughness::{BandError, ClassThresholds, Detrended, Detrender, WaveBand, classify, moore_gradient};
use sastrugi_schemas::ParameterError;
use std::fmt::Display;

/// The ends of a route, as messages name them.
const ENDS: [&str; 2] = ["start", "goal"];

/// Inputs of route planning besides the heights.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Vehicle that sets slope limits, energy and the wavelength band.
    pub vehicle: Option<Vehicle>,
    /// Obstacles as polygons, in the coordinates of the heights, m.
    pub polygons: Vec<Polygon>,
    /// Obstacles as cells of the heights.
    pub blocked: Option<Grid<bool>>,
    /// Cost factors, in the coordinates of the heights.
    pub factors: Option<Grid>,
    /// Thresholds of the roughness classes.
    pub thresholds: ClassThresholds,
}

impl Given {
    /// Blocks more cells.
    pub fn add_blocked(&mut self, cells: Option<Grid<bool>>) {
        match (&mut self.blocked, cells) {
            (Some(all), Some(cells)) => {
                all.values.iter_mut().zip(cells.values).for_each(|(one, other)| *one |= other);
            }
            (blocked, cells) => *blocked = blocked.take().or(cells),
        }
    }
}

/// Ground prepared for route planning.
#[derive(Debug)]
pub struct Site {
    map: TravelMap,
    costs: CostModel,
    clearance: Option<Clearance>,
    settings: RouteSettings,
    rings: Vec<Vec<[f64; 2]>>,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// A route.
    Found(Route),
    /// No path connects start and goal.
    NoPath,
    /// An anytime search used up its expansions before it found a path.
    Budget,
}

impl Outcome {
    /// Name in tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Found(_) => "found",
            Self::NoPath => "no_path",
            Self::Budget => "budget",
        }
    }

    /// The route, if one was found.
    pub fn route(&self) -> Option<&Route> {
        match self {
            Self::Found(route) => Some(route),
            Self::NoPath | Self::Budget => None,
        }
    }
}

impl Site {
    /// Prepares heights in m.
    ///
    /// # Errors
    /// Heights on which no route can be planned, or inputs that do not match them.
    pub fn new(heights: &Grid, parameters: &RouteParameters, given: &Given) -> Result<Self, JobError> {
        let step = coarsening(&heights.geometry, parameters).map_err(refused)?;
        let coarse = |grid: &Grid| if step > 1 { resample::block_means(grid, step) } else { grid.clone() };
        let ability = given.vehicle.as_ref().map(|v| SlopeAbility::of(v, &SurfaceParameters::default()));
        let limits_deg = ability.map_or(RouteParameters::WITHOUT_VEHICLE_DEG, |a| [a.up_deg, a.down_deg]);
        let limits = parameters.limits(limits_deg).map_err(refused)?;
        // Rounded to the precision with which the ground is stored for teams.
        let planned_on = coarse(heights).map(|z| f64::from(z as f32));
        let mut map = TravelMap::new(planned_on, limits).map_err(failed)?;
        for polygon in &given.polygons {
            obstacles::block(&mut map, polygon, parameters.obstacle_margin_m).map_err(refused)?;
        }
        if let Some(blocked) = &given.blocked {
            let share = coarse(&blocked.map(|b| f64::from(u8::from(b))));
            let touched: Vec<bool> = share.values.iter().map(|share| *share > 0.0).collect();
            obstacles::block_cells(&mut map, &touched, parameters.obstacle_margin_m).map_err(refused)?;
        }
        let factors = factors(heights, parameters, given)?.map(|grid| coarse(&grid));
        let factors = factors.map(|grid| block_unknown(&mut map, grid));
        let rolling = ability.map_or(f64::NAN, |a| a.rolling_resistance);
        let slope = parameters.slope_cost(rolling).map_err(refused)?;
        let costs = CostModel::new(slope, factors, &map).map_err(refused)?;
        let clearance = |width_m| Clearance::new(&map, width_m, parameters.clearance_weight, parameters.clearance_max);
        let clearance = parameters.width_m.map(clearance).transpose().map_err(refused)?;
        let [dx, dy] = map.cell_m();
        let settings = parameters.settings(dx.max(dy)).map_err(refused)?;
        let rings = given.polygons.iter().filter_map(|polygon| polygon.rings().first().cloned()).collect();
        Ok(Self { map, costs, clearance, settings, rings })
    }

    /// Map, costs and clearance for a team.
    pub fn ground(&self) -> Ground<'_> {
        Ground { map: &self.map, costs: &self.costs, clearance: self.clearance.as_ref() }
    }

    /// The map.
    pub fn map(&self) -> &TravelMap {
        &self.map
    }

    /// Outer rings of the obstacles that are polygons, in the coordinates of the heights, m.
    pub fn rings(&self) -> &[Vec<[f64; 2]>] {
        &self.rings
    }

    /// Plans a route for each pair of start and goal. A single pair is added to the vertices of its roadmap.
    ///
    /// # Errors
    /// Starts and goals that are blocked or identical.
    pub fn plan(&self, pairs: &[Pair]) -> Result<Vec<Outcome>, JobError> {
        let cell = |node: Node| self.map.place(node);
        if let [pair] = pairs {
            let found = sastrugi_navigation::plan(&self.ground(), &self.settings, cell(pair.start), cell(pair.goal));
            return Ok(vec![outcome(found)?]);
        }
        let planner = Planner::new(self.ground(), self.settings).map_err(failed)?;
        pairs.iter().map(|pair| outcome(planner.route(cell(pair.start), cell(pair.goal)))).collect()
    }

    /// The pair of nodes nearest to two points in the coordinates of the heights, m.
    ///
    /// # Errors
    /// A point that is not on the map or cannot be entered, or both points in the same cell.
    pub fn pair(&self, ends_m: [[f64; 2]; 2]) -> Result<Pair, JobError> {
        let cells = cells_of_ends(&self.map.heights().geometry, ends_m).map_err(JobError::input)?;
        let node = |end: usize| self.entered(ENDS[end], ends_m[end], cells[end]);
        Ok(Pair { start: node(0)?, goal: node(1)?, draws: 1 })
    }

    /// The node of a cell, which must not be blocked.
    fn entered(&self, name: &str, [x, y]: [f64; 2], (row, col): (usize, usize)) -> Result<Node, JobError> {
        let node = self.map.node(row, col);
        if !self.map.is_blocked(node) {
            return Ok(node);
        }
        let there = if self.map.height_m(node).is_finite() { "an obstacle covers" } else { "there is no height in" };
        Err(JobError::input(format!("the {name} ({x}, {y}) cannot be entered: {there} its cell; choose another point")))
    }

    /// Nodes as points in the coordinates of the heights, with their heights, m.
    pub fn points(&self, nodes: &[Node]) -> Vec<[f64; 3]> {
        let point = |node: &Node| {
            let [x, y] = self.map.position_m(*node);
            [x, y, self.map.height_m(*node)]
        };
        nodes.iter().map(point).collect()
    }

    /// The heights, with no data in cells that cannot be entered.
    pub fn open_ground(&self) -> Grid {
        let mut heights = self.map.heights().clone();
        let blocked = heights.values.iter_mut().zip(0..).filter(|(_, node)| self.map.is_blocked(*node));
        blocked.for_each(|(height, _)| *height = f64::NAN);
        heights
    }

    /// 1 in cells that have a height but cannot be entered, 0 in others; `None` if there are no such cells. The geometry is that of the
    /// planning ground.
    pub fn blocked_cells(&self) -> Option<Grid<u8>> {
        let heights = self.map.heights();
        let nodes = heights.values.iter().zip(0..);
        let values: Vec<u8> = nodes.map(|(z, node)| u8::from(z.is_finite() && self.map.is_blocked(node))).collect();
        values.contains(&1).then_some(Grid { geometry: heights.geometry, values })
    }

    /// Number of cells that can be entered.
    pub fn free_cells(&self) -> usize {
        (0..self.map.len() as Node).filter(|node| !self.map.is_blocked(*node)).count()
    }
}

fn outcome(found: Result<Route, RouteError>) -> Result<Outcome, JobError> {
    match found {
        Ok(route) => Ok(Outcome::Found(route)),
        Err(RouteError::NoPath { .. }) => Ok(Outcome::NoPath),
        Err(RouteError::Budget { .. }) => Ok(Outcome::Budget),
        Err(other) => Err(failed(other)),
    }
}

/// Horizontal distance along the line from the first point to each point, m.
///
/// ```
/// use sastrugi_stages::operations::routes::distances_m;
///
/// // Heights do not count.
/// let line = [[0.0, 0.0, 7.0], [3.0, 4.0, 9.0], [3.0, 16.0, 0.0]];
/// assert_eq!(distances_m(&line), [0.0, 5.0, 17.0]);
/// ```
pub fn distances_m(points: &[[f64; 3]]) -> Vec<f64> {
    let mut distance_m = 0.0;
    let mut last = points.first();
    let mut all = Vec::with_capacity(points.len());
    for point in points {
        if let Some([x, y, _]) = last {
            distance_m += ((point[0] - x) * (point[0] - x) + (point[1] - y) * (point[1] - y)).sqrt();
        }
        all.push(distance_m);
        last = Some(point);
    }
    all
}

/// Checks the cells of a terrain against the settings of a search, and returns those on which routes are planned.
///
/// # Errors
/// Planning cells that are too large for the terrain, or a terrain on which the vehicle's band of wavelengths cannot be measured.
pub fn planning_cells(
    terrain: &Geometry,
    parameters: &RouteParameters,
    vehicle: Option<&Vehicle>,
) -> Result<Geometry, ParameterError> {
    let step = coarsening(terrain, parameters)?;
    if let (Cost::BandRms, Some(vehicle)) = (parameters.cost, vehicle) {
        let refused = |e: BandError| ParameterError::new("cost", format!("is \"band_rms\", but {e}"));
        band_of(vehicle, terrain).map_err(refused)?;
    }
    Ok(resample::block_geometry(terrain, step))
}

/// Rows and columns of a start and a goal in the coordinates of the heights, m.
///
/// # Errors
/// The message on a point outside the terrain, or on both points in the same cell.
pub fn cells_of_ends(terrain: &Geometry, ends_m: [[f64; 2]; 2]) -> Result<[(usize, usize); 2], String> {
    let cell = |end: usize| {
        let [x, y] = ends_m[end];
        terrain.cell_at(x, y).ok_or_else(|| {
            let ([x0, y0], [width, height]) = (terrain.origin, terrain.size());
            let (x1, y1) = (x0 + width, y0 + height);
            format!(
                "the {} ({x}, {y}) lies outside the terrain, which covers x from {x0} to {x1} and y from {y0} to {y1} m",
                ENDS[end]
            )
        })
    };
    let cells = [cell(0)?, cell(1)?];
    if cells[0] != cells[1] {
        return Ok(cells);
    }
    let ([[x, y], [goal_x, goal_y]], [dx, dy]) = (ends_m, terrain.cell);
    Err(format!(
        "the start ({x}, {y}) and the goal ({goal_x}, {goal_y}) lie in the same cell of {dx} x {dy} m; choose points farther apart"
    ))
}

/// Width of a planning cell in cells of the heights.
fn coarsening(terrain: &Geometry, parameters: &RouteParameters) -> Result<usize, ParameterError> {
    let Some(plan_cell_m) = parameters.plan_cell_m else { return Ok(1) };
    let Geometry { rows, cols, cell: [dx, dy], .. } = *terrain;
    let step = (plan_cell_m / dx.max(dy)).round().max(1.0);
    if step * 2.0 > rows.min(cols) as f64 {
        let message = format!(
            "of {plan_cell_m} m leaves fewer than two planning cells along a side of the terrain, which has {rows} x {cols} cells of {dx} x {dy} m"
        );
        return Err(ParameterError::new("plan_cell_m", message));
    }
    Ok(step as usize)
}

/// Cost factor of each cell of the heights; `None` if the cost has none.
fn factors(heights: &Grid, parameters: &RouteParameters, given: &Given) -> Result<Option<Grid>, JobError> {
    Ok(match parameters.cost {
        Cost::Slope | Cost::Energy => None,
        Cost::Class => {
            let classes = classify(&moore_gradient(heights), &given.thresholds);
            Some(classes.map(|code| parameters.class_factor(code)))
        }
        Cost::BandRms => {
            let rms = band_rms(heights, given)?;
            Some(rms.map(|rms_m| parameters.band_rms_factor(rms_m)))
        }
        Cost::Raster => {
            let raster =
                given.factors.as_ref().ok_or_else(|| JobError::new("`cost = \"raster\"` needs `cost_raster`"))?;
            Some(on_cells_of(heights, raster)?)
        }
    })
}

/// RMS height around each cell in the band of wavelengths that excites the vehicle, m.
fn band_rms(heights: &Grid, given: &Given) -> Result<Grid, JobError> {
    let vehicle = given.vehicle.as_ref().ok_or_else(|| JobError::new("`cost = \"band_rms\"` needs a `vehicle`"))?;
    let band = band_of(vehicle, &heights.geometry).map_err(JobError::input)?;
    Ok(Detrended::of(heights, &band, Detrender::Band).rms_map())
}

/// The band of wavelengths that excites a vehicle.
///
/// # Errors
/// A terrain whose cells are too large, or which is too short, to measure it.
fn band_of(vehicle: &Vehicle, terrain: &Geometry) -> Result<WaveBand, BandError> {
    let band = WaveBand::of_vehicle(vehicle.wheelbase_m(), vehicle.parameters().wheels.radius_m)?;
    let ([dx, dy], [x, y]) = (terrain.cell, terrain.size());
    band.fits_cells(dx.max(dy))?;
    band.fits_length(x.max(y))?;
    Ok(band)
}

/// A raster resampled to the cells of the heights; NaN where it has no data.
fn on_cells_of(heights: &Grid, raster: &Grid) -> Result<Grid, JobError> {
    let g = heights.geometry;
    if !g.overlaps(&raster.geometry) {
        return Err(JobError::input(
            "`cost_raster` does not overlap the terrain; convert it to the coordinates of the terrain",
        ));
    }
    let value = |row: usize, col: usize| raster.height(g.x(col), g.y(row)).unwrap_or(f64::NAN);
    Ok(Grid::new(g, (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| (r, c))).map(|(r, c)| value(r, c)).collect()))
}

/// Blocks the cells without a cost factor.
fn block_unknown(map: &mut TravelMap, factors: Grid) -> Vec<f64> {
    let unknown = factors.values.iter().zip(0..).filter(|(factor, _)| factor.is_nan());
    unknown.for_each(|(_, node)| map.block(node));
    factors.values
}

fn refused(error: ParameterError) -> JobError {
    JobError::input(error)
}

fn failed(error: impl Display) -> JobError {
    JobError::input(format!("failed to {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heights() -> Grid {
        Grid::filled(Geometry { rows: 10, cols: 20, cell: [0.5, 0.25], origin: [100.0, 50.0] }, 0.0)
    }

    /// Distances grow along the line, back and forth; a line without points has none.
    #[test]
    fn val_distances_along_a_line() {
        let line = [[1.0, 1.0, 0.0], [4.0, 5.0, 9.0], [4.0, 5.0, 0.0], [1.0, 1.0, 5.0]];
        assert_eq!(distances_m(&line), [0.0, 5.0, 5.0, 10.0]);
        assert!(distances_m(&[]).is_empty());
    }

    /// The wider side of a cell, here 0.5 m, is compared with the planning cell, and two planning cells must fit along the shorter side.
    #[test]
    fn val_planning_cells_are_whole_numbers_of_cells() {
        let of = |plan_cell_m: Option<f64>| {
            let parameters = RouteParameters { plan_cell_m, ..RouteParameters::default() };
            coarsening(&heights().geometry, &parameters).map_err(|e| e.to_string())
        };
        let steps = [None, Some(0.1), Some(0.6), Some(1.3), Some(2.5)].map(|cell| of(cell).unwrap());
        assert_eq!(steps, [1, 1, 1, 3, 5]);
        let error = of(Some(3.0)).unwrap_err();
        assert!(error.starts_with("`plan_cell_m` of 3 m leaves fewer than two planning cells"), "{error}");
    }

    /// Both ends must lie on the terrain, in different cells.
    #[test]
    fn val_ends_lie_in_two_cells_of_the_terrain() {
        // It covers x from 100 to 110 and y from 50 to 52.5.
        let cells = |ends_m: [[f64; 2]; 2]| cells_of_ends(&heights().geometry, ends_m);
        assert_eq!(cells([[100.1, 50.1], [109.9, 52.4]]), Ok([(9, 0), (0, 19)]));
        for (ends_m, words) in [
            (
                [[99.0, 50.1], [109.9, 52.4]],
                "the start (99, 50.1) lies outside the terrain, which covers x from 100 to 110",
            ),
            ([[100.1, 50.1], [109.9, 53.0]], "the goal (109.9, 53) lies outside"),
            ([[100.1, 50.1], [100.4, 50.2]], "lie in the same cell of 0.5 x 0.25 m"),
        ] {
            let why = cells(ends_m).unwrap_err();
            assert!(why.contains(words), "{why}");
        }
    }

    /// The band of a Husky begins below 1 m: cells of 1 m cannot hold it, whatever is planned on; other costs do not need it.
    #[test]
    fn val_a_band_needs_fine_cells() {
        let husky = sastrugi_mobility::registry::vehicle("husky_a200", &Default::default()).unwrap();
        let of = |cell_m: f64, cost: Cost| {
            let parameters = RouteParameters { cost, plan_cell_m: Some(2.0), ..RouteParameters::default() };
            planning_cells(&Geometry::square(400, 400, cell_m), &parameters, Some(&husky)).map_err(|e| e.to_string())
        };
        assert_eq!(of(1.0, Cost::Slope), Ok(Geometry::square(200, 200, 2.0)));
        assert_eq!(of(0.05, Cost::BandRms), Ok(Geometry::square(10, 10, 2.0)));
        let refused = of(1.0, Cost::BandRms).unwrap_err();
        assert!(refused.starts_with("`cost` is \"band_rms\", but cells of 1 m are too coarse"), "{refused}");
    }

    /// A plane stays a plane on other cells; beyond the raster, there are no factors.
    #[test]
    fn val_rasters_are_resampled_to_the_heights() {
        let plane = |x: f64, y: f64| 2.0 * x - 3.0 * y;
        // It covers the western half of the heights.
        let g = Geometry { rows: 6, cols: 6, cell: [1.0, 1.0], origin: [99.0, 48.0] };
        let raster = Grid::new(g, (0..36).map(|k| plane(g.x(k % 6), g.y(k / 6))).collect());
        let found = on_cells_of(&heights(), &raster).unwrap();
        let h = found.geometry;
        assert_eq!(h, heights().geometry);
        for (row, col) in (0..h.rows).flat_map(|row| (0..h.cols).map(move |col| (row, col))) {
            let (x, y) = (h.x(col), h.y(row));
            let (value, inside) = (found.at(row, col), x <= 104.5);
            assert_eq!(value.is_finite(), inside, "{row} {col}");
            assert!(!inside || (value - plane(x, y)).abs() < 1e-9, "{row} {col}: {value}");
        }
        let elsewhere = Grid::filled(Geometry::square(3, 3, 1.0), 1.0);
        assert!(on_cells_of(&heights(), &elsewhere).unwrap_err().message.contains("does not overlap the terrain"));
    }

    /// Obstacles add up; no more cells change nothing.
    #[test]
    fn val_blocked_cells_add_up() {
        let cells = |marked: [bool; 4]| Some(Grid::new(Geometry::square(2, 2, 1.0), marked.to_vec()));
        let mut given = Given::default();
        given.add_blocked(None);
        assert_eq!(given.blocked, None);
        given.add_blocked(cells([true, false, false, false]));
        given.add_blocked(cells([false, false, true, false]));
        given.add_blocked(None);
        assert_eq!(given.blocked, cells([true, false, true, false]));
    }
}
