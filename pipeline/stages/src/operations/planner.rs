//! The planner to compare rovers with: [`Explorer`] of the room `navigation` as a [`Policy`] of the room `mobility`.
//!
//! Each cycle, in this order:
//! 1. Within the tolerance of the goal it stops.
//! 2. It marks what it sees on its map, at the place where it believes to be: where a ray shows a hazard the cell there, of rectangles all their
//!    cells.
//! 3. It plans.
//! 4. It turns in place towards the next way point, by at most the turn of a cycle, and looks again; facing it, it drives by a step, at most
//!    as far as the way point.
//! 5. Without a way it forgets its map, which may be wrong, but for what it sees now, and backs up by a step; after the third time it stops.
//! 6. Where the rover itself leans too much it backs up by a step.
//!
//! The map is all that it remembers. Its cells are blocked within half of the body's width of what may be a hazard; how looks that disagree are
//! joined stands in [`sastrugi_navigation::explorer`].
//!
//! What it sees brings it to an end: between two of the three times that it forgets, knowledge of a cell rises three times at most, and cells are
//! limited. Once nothing is new the plan stays, each cycle turns or drives along it, and it leads to the goal. Ground on which it leans too much
//! is on no map: there, and with errors of its place, the limits of distance and cycles end it.

use sastrugi_mobility::rover::{Command, PlannerParameters, Policy, RoverParameters, Situation, Stop, View};
use sastrugi_navigation::explorer::{CELLS_MAX, Explorer, ExplorerSettings, Sight};
use sastrugi_schemas::ParameterError;

/// Memory of a cell of its map, bytes.
const BYTES_PER_CELL: u64 = 50;
/// Error of the bearing to a way point that is corrected with a drive, rad: at most a hundredth of a step to the side.
const FACING_RAD: f64 = 0.01;
/// How often it forgets its map.
const FORGETS: u32 = 3;

/// Memory of the map of one rover, bytes.
pub fn memory_bytes() -> u64 {
    CELLS_MAX as u64 * BYTES_PER_CELL
}

/// A planner at the start.
pub fn policy(parameters: &PlannerParameters) -> Box<dyn Policy> {
    Box::new(Planner::new(parameters))
}

/// Refuses a map that a trial would need too many cells for.
///
/// # Errors
/// That one.
pub fn check(parameters: &PlannerParameters, trial: &RoverParameters) -> Result<(), ParameterError> {
    // A start and its goal may lie in any direction: along a diagonal the map is largest.
    let (along_m, settings) = (std::f64::consts::FRAC_1_SQRT_2 * trial.straight_m(), settings(parameters));
    let largest = settings.geometry([0.0; 2], [along_m; 2], settings.beyond_m);
    largest.map(drop).map_err(|e| ParameterError::new("map_cell_m", e.message))
}

/// Numbers of the body that a plan depends on.
fn settings(parameters: &PlannerParameters) -> ExplorerSettings {
    let task = parameters.task(&RoverParameters::default());
    let cell_m = parameters.map.map_cell_m;
    ExplorerSettings {
        cell_m,
        margin_m: task.chassis.track_m,
        arrive_m: task.goal_tolerance_m,
        beyond_m: parameters.map.map_beyond_m,
    }
}

/// The planner, and what it remembers.
struct Planner {
    settings: ExplorerSettings,
    turn_rad: f64,
    step_m: f64,
    explorer: Option<Explorer>,
    forgotten: u32,
    plan_m: Vec<[f64; 2]>,
    state: &'static str,
}

impl Planner {
    fn new(parameters: &PlannerParameters) -> Self {
        Self {
            settings: settings(parameters),
            turn_rad: parameters.turn_rad(),
            step_m: parameters.step_m(),
            explorer: None,
            forgotten: 0,
            plan_m: Vec::new(),
            state: "start",
        }
    }

    fn stop(&mut self, stop: Stop) -> Command {
        self.state = match stop {
            Stop::AtGoal => "at goal",
            Stop::NoWay => "no way",
        };
        self.plan_m.clear();
        Command::stop(stop)
    }

    /// Marks what the rover sees.
    fn see(&mut self, situation: &Situation<'_>) {
        let Some(explorer) = &mut self.explorer else { return };
        let View { areas, rays, .. } = situation.view;
        let places_m = rays.iter().filter(|ray| ray.hazard).map(|ray| situation.pose.to_ground(ray.place_m));
        places_m.for_each(|at_m| explorer.see_hazard_at(at_m));
        // Rays tell of places: a strip is a hazard as a whole, wherever in it the rock stands, and safe though rays pass beside most of it.
        for area in areas.iter().filter(|_| rays.is_empty()) {
            let sight = if area.hazard { Sight::Hazard } else { Sight::Safe };
            explorer.see(&area.corners_m.map(|corner| situation.pose.to_ground(corner)), sight);
        }
    }

    fn back_up(&mut self, state: &'static str) -> Command {
        self.state = state;
        Command::drive(-self.step_m)
    }

    /// Starts afresh with what it sees, or stops.
    fn begin_again(&mut self, situation: &Situation<'_>) -> Command {
        if self.forgotten >= FORGETS {
            return self.stop(Stop::NoWay);
        }
        self.forgotten += 1;
        self.explorer.iter_mut().for_each(Explorer::forget);
        self.see(situation);
        self.plan_m.clear();
        self.back_up("forget")
    }

    /// Turns to the next way point, or drives towards it.
    fn follow(&mut self, situation: &Situation<'_>, next_m: [f64; 2]) -> Command {
        let error_rad = situation.pose.bearing_error_rad(next_m);
        if error_rad.abs() > FACING_RAD {
            self.state = "turn";
            return Command::turn(error_rad.clamp(-self.turn_rad, self.turn_rad));
        }
        self.state = "drive";
        let drive_m = self.step_m.min(situation.pose.distance_m(next_m));
        Command { turn_rad: error_rad, drive_m, stop: None }
    }
}

impl Policy for Planner {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let at_m = situation.pose.position_m;
        if situation.goal_distance_m() <= self.settings.arrive_m {
            return self.stop(Stop::AtGoal);
        }
        if self.explorer.is_none() {
            self.explorer = Explorer::new(self.settings, at_m, situation.goal_m).ok();
        }
        if situation.view.tilted {
            return self.back_up("back up");
        }
        self.see(situation);
        self.plan_m = self.explorer.as_mut().and_then(|explorer| explorer.plan(at_m)).unwrap_or_default();
        match self.plan_m.get(1) {
            Some(next_m) => self.follow(situation, *next_m),
            None => self.begin_again(situation),
        }
    }

    fn state(&self) -> &'static str {
        self.state
    }

    fn plan(&self) -> &[[f64; 2]] {
        &self.plan_m
    }
}
