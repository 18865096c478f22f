//! Missions: random straight ones (Majhor and Bos, section 2.3), and missions along a polyline.
//!
//! The start is a cell centre drawn uniformly from the low-roughness cells of the closed class map that lie more than a
//! border from the edge. The heading is uniform over the circle. The goal lies one mission length away along the heading;
//! it must lie inside the border, in a cell of low or semi roughness. Otherwise start and heading are drawn again.
//!
//! Every mission draws from its own stream (`mission-0001`, `mission-0002`, ...), so a larger number of missions leaves the
//! earlier ones unchanged. The paper does not say what happens on a terrain that allows no mission; here the number of draws
//! is limited, and exceeding it is an error.
//!
//! Terrains whose missions are compared in pairs share their draws ([`StartCells::All`]): each terrain accepts or rejects a
//! draw by its own map, so its missions do not depend on the other terrains, and two terrains that accept the same draw share
//! the mission. [`ReplicateSettings`] perturbs the start of a drawn mission.
//!
//! [`Mission::along`] creates a mission that follows a [`Polyline`] instead.
//!
//! Cost: one pass over the map and a few draws per mission; memory: sixteen bytes per cell
//! inside the border.

mod difficulty;
mod params;
mod perturb;
mod polyline;
#[cfg(test)]
mod tests;

pub use difficulty::Difficulty;
pub(crate) use difficulty::class_at;
pub use params::{MissionParameters, MissionSettings};
pub use perturb::{ReplicateParameters, ReplicateSettings};
pub use polyline::{Foot, Polyline, PolylineError};

use sastrugi_numeric::{Geometry, Grid, Stream, Streams};
use sastrugi_schemas::{RoughnessClass, counted};

/// A mission: straight from start to goal, or along a polyline.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Mission {
    /// Number of the mission on its terrain, from 0.
    pub index: usize,
    /// Start point `[x, y]`, m.
    pub start_m: [f64; 2],
    /// Goal point `[x, y]`, m.
    pub goal_m: [f64; 2],
    /// Direction the vehicle faces at the start, counterclockwise from east, rad, in [0, 2 pi); for a drawn mission the
    /// direction from start to goal.
    pub heading_rad: f64,
    /// Number of draws of start and heading until one was accepted, at least 1.
    pub draws: u32,
    /// The polyline that the vehicle follows to the goal; the straight line when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<Polyline>,
}

impl Mission {
    /// Id in tables and file names: `mission-0001` for index 0.
    pub fn id(&self) -> String {
        mission_id(self.index)
    }

    /// The straight mission between two points, facing the goal.
    ///
    /// ```
    /// use sastrugi_mobility::missions::Mission;
    ///
    /// let mission = Mission::between(0, [1.0, 2.0], [4.0, 6.0]);
    /// assert_eq!((mission.id().as_str(), mission.length_m()), ("mission-0001", 5.0));
    /// // The foot of a point on the line, measured from the start.
    /// assert!((mission.along_m([4.0, 2.0]) - 1.8).abs() < 1e-12);
    /// ```
    pub fn between(index: usize, start_m: [f64; 2], goal_m: [f64; 2]) -> Self {
        let bearing = libm::atan2(goal_m[1] - start_m[1], goal_m[0] - start_m[0]);
        Self { index, start_m, goal_m, heading_rad: normalized(bearing), draws: 1, line: None }
    }

    /// The mission along a polyline from its first point to its last, facing along it.
    ///
    /// ```
    /// use sastrugi_mobility::missions::{Mission, Polyline};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let corner = Polyline::new(&[[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])?;
    /// let mission = Mission::along(0, corner);
    /// assert_eq!((mission.length_m(), mission.course_length_m()), (5.0, 7.0));
    /// assert_eq!((mission.goal_m, mission.heading_rad), ([3.0, 4.0], 0.0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn along(index: usize, line: Polyline) -> Self {
        let (start_m, goal_m) = (line.point_at(0.0), line.point_at(line.length_m()));
        Self { index, start_m, goal_m, heading_rad: normalized(line.bearing_rad()), draws: 1, line: Some(line) }
    }

    /// Distance from start to goal, m.
    pub fn length_m(&self) -> f64 {
        distance(self.start_m, self.goal_m)
    }

    /// Length of the course, m: that of the polyline, or the distance from start to goal.
    pub fn course_length_m(&self) -> f64 {
        self.line.as_ref().map_or_else(|| self.length_m(), Polyline::length_m)
    }

    /// The point at a fraction (0 to 1) of the course, m.
    pub fn course_at(&self, share: f64) -> [f64; 2] {
        match &self.line {
            Some(line) => line.point_at(share * line.length_m()),
            None => [0, 1].map(|axis| self.start_m[axis] + share * (self.goal_m[axis] - self.start_m[axis])),
        }
    }

    /// Distance of a point along the straight line from the start, m; negative behind it.
    pub fn along_m(&self, [x, y]: [f64; 2]) -> f64 {
        let [dx, dy] = [0, 1].map(|axis| self.goal_m[axis] - self.start_m[axis]);
        ((x - self.start_m[0]) * dx + (y - self.start_m[1]) * dy) / self.length_m()
    }
}

/// Id of the mission with that index (from 0).
pub fn mission_id(index: usize) -> String {
    format!("mission-{:04}", index + 1)
}

/// Why no missions could be drawn on a terrain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MissionError {
    /// The terrain cannot hold the mission at any heading.
    #[error(
        "place missions of {length_m} m: the terrain is {:.2} x {:.2} m, including a border of {border_m} m on every side where no mission \
         starts or ends; use a larger terrain, a shorter `length_m` or a narrower `border_m`",
        inside_x_m + 2.0 * border_m,
        inside_y_m + 2.0 * border_m
    )]
    LongerThanTerrain {
        /// Mission length, m.
        length_m: f64,
        /// Border, m.
        border_m: f64,
        /// Extent inside the border east-west, m (negative when the border covers everything).
        inside_x_m: f64,
        /// Extent inside the border north-south, m.
        inside_y_m: f64,
    },
    /// No low-roughness cell lies inside the border.
    #[error(
        "find a start: there is no low roughness in the {} farther than {border_m} m from the edge",
        counted(.cells, "cell")
    )]
    NoEligibleStart {
        /// Cells inside the border.
        cells: usize,
        /// Border, m.
        border_m: f64,
    },
    /// No draw satisfied the goal rule.
    #[error(
        "find a goal for {mission_id}: {} from {} gave no goal of low or semi roughness {length_m} m away; raise `max_draws` or \
         shorten `length_m`",
        counted(.draws, "draw"), counted(.starts, "low-roughness cell")
    )]
    DrawsExhausted {
        /// Id of the mission.
        mission_id: String,
        /// Draws made.
        draws: u32,
        /// Eligible start cells.
        starts: usize,
        /// Mission length, m.
        length_m: f64,
    },
}

impl MissionError {
    /// The parameter that asks for too much.
    pub fn key(&self) -> &'static str {
        match self {
            Self::LongerThanTerrain { inside_x_m, inside_y_m, .. } if inside_x_m.min(*inside_y_m) <= 0.0 => "border_m",
            Self::LongerThanTerrain { .. } => "length_m",
            Self::NoEligibleStart { .. } => "border_m",
            Self::DrawsExhausted { .. } => "max_draws",
        }
    }
}

/// Which cells starts are drawn from. Either way, starts are uniform over the low-roughness cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StartCells {
    /// The cells of low roughness.
    Low,
    /// All cells inside the border, drawn again until one has low roughness. Draw k of a mission is then the same start and
    /// heading on every map with these cells, so maps that accept the same draw share the mission.
    All,
}

/// Draws the missions of one terrain from its closed class map (codes of [`RoughnessClass`]).
///
/// # Errors
/// [`MissionError`] when the terrain is too small, too rough, or the draws run out.
///
/// ```
/// use sastrugi_mobility::missions::{MissionParameters, MissionSettings, StartCells, draw_missions};
/// use sastrugi_numeric::{Geometry, Grid, Streams};
/// use sastrugi_schemas::RoughnessClass;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // 60 m square of low roughness.
/// let classes = Grid::filled(Geometry::square(120, 120, 0.5), RoughnessClass::Low as u8);
/// let settings = MissionSettings::try_from(MissionParameters { count: 3, ..Default::default() })?;
/// let missions = draw_missions(&classes, &settings, StartCells::Low, &Streams::for_seed(1, "missions"))?;
/// assert_eq!(missions.len(), 3);
/// for mission in &missions {
///     assert!((mission.length_m() - 35.0).abs() < 1e-9);
///     // Starts and goals keep a border of 5 m.
///     let mut ends = mission.start_m.into_iter().chain(mission.goal_m);
///     assert!(ends.all(|at| at > 5.0 && at < 55.0));
/// }
/// # Ok(())
/// # }
/// ```
pub fn draw_missions(
    classes: &Grid<u8>,
    settings: &MissionSettings,
    cells: StartCells,
    streams: &Streams,
) -> Result<Vec<Mission>, MissionError> {
    let field = Field::new(classes, settings, cells)?;
    (0..settings.count()).map(|index| field.draw(index, streams)).collect()
}

/// Checks that a terrain can hold the missions at some heading.
///
/// # Errors
/// [`MissionError::LongerThanTerrain`] otherwise.
pub fn check_size(terrain: &Geometry, settings: &MissionSettings) -> Result<(), MissionError> {
    let (length_m, border_m) = (settings.length_m(), settings.border_m());
    let [inside_x_m, inside_y_m] = terrain.size().map(|extent| extent - 2.0 * border_m);
    let diagonal_m = (inside_x_m * inside_x_m + inside_y_m * inside_y_m).sqrt();
    if inside_x_m > 0.0 && inside_y_m > 0.0 && diagonal_m > length_m {
        return Ok(());
    }
    Err(MissionError::LongerThanTerrain { length_m, border_m, inside_x_m, inside_y_m })
}

/// The part of a class map on which missions may lie.
struct Field<'a> {
    classes: &'a Grid<u8>,
    settings: &'a MissionSettings,
    /// Row-major indices of the cells from which starts are drawn.
    cells: Vec<usize>,
    /// Number of low-roughness cells among them.
    starts: usize,
}

impl<'a> Field<'a> {
    fn new(classes: &'a Grid<u8>, settings: &'a MissionSettings, cells: StartCells) -> Result<Self, MissionError> {
        check_size(&classes.geometry, settings)?;
        let border_m = settings.border_m();
        let inside: Vec<usize> =
            (0..classes.values.len()).filter(|&k| is_inside(&classes.geometry, border_m, centre(classes, k))).collect();
        let low: Vec<usize> = inside.iter().copied().filter(|&k| is_low(classes, k)).collect();
        if low.is_empty() {
            return Err(MissionError::NoEligibleStart { cells: inside.len(), border_m });
        }
        let starts = low.len();
        let cells = match cells {
            StartCells::Low => low,
            StartCells::All => inside,
        };
        Ok(Self { classes, settings, cells, starts })
    }

    /// The mission with that index, from its own stream.
    fn draw(&self, index: usize, streams: &Streams) -> Result<Mission, MissionError> {
        let mut stream = streams.child(&mission_id(index)).stream("start and heading");
        for draws in 1..=self.settings.max_draws() {
            let (start, heading_rad) = self.candidate(&mut stream);
            let start_m = centre(self.classes, start);
            let (sin, cos) = libm::sincos(heading_rad);
            let length_m = self.settings.length_m();
            let goal_m = [start_m[0] + length_m * cos, start_m[1] + length_m * sin];
            if is_low(self.classes, start) && self.is_goal(goal_m) {
                return Ok(Mission { index, start_m, goal_m, heading_rad, draws, line: None });
            }
        }
        Err(MissionError::DrawsExhausted {
            mission_id: mission_id(index),
            draws: self.settings.max_draws(),
            starts: self.starts,
            length_m: self.settings.length_m(),
        })
    }

    fn candidate(&self, stream: &mut Stream) -> (usize, f64) {
        let start = self.cells[stream.below(self.cells.len() as u64) as usize];
        (start, stream.uniform_in(0.0, std::f64::consts::TAU))
    }

    fn is_goal(&self, point_m: [f64; 2]) -> bool {
        let geometry = &self.classes.geometry;
        let Some((row, col)) = geometry.cell_at(point_m[0], point_m[1]) else { return false };
        is_inside(geometry, self.settings.border_m(), point_m)
            && matches!(
                RoughnessClass::from_code(self.classes.at(row, col)),
                Some(RoughnessClass::Low | RoughnessClass::Semi)
            )
    }
}

fn is_low(classes: &Grid<u8>, index: usize) -> bool {
    classes.values[index] == RoughnessClass::Low as u8
}

/// True for points farther than `border_m` from every edge of the grid.
fn is_inside(geometry: &Geometry, border_m: f64, point_m: [f64; 2]) -> bool {
    let size = geometry.size();
    (0..2).all(|axis| {
        let from_low_edge = point_m[axis] - geometry.origin[axis];
        from_low_edge > border_m && size[axis] - from_low_edge > border_m
    })
}

/// Centre of the cell with that row-major index.
fn centre(classes: &Grid<u8>, index: usize) -> [f64; 2] {
    [classes.geometry.x(index % classes.cols()), classes.geometry.y(index / classes.cols())]
}

/// Wraps an angle within one turn of [0, 2 pi) into that range, rad.
fn normalized(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    match angle_rad {
        a if a < 0.0 => a + turn,
        a if a >= turn => a - turn,
        a => a,
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    (dx * dx + dy * dy).sqrt()
}
