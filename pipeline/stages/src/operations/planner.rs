//! The planner that serves as a baseline for rovers: [`Explorer`] of the room `navigation` as a [`Policy`] of the room `mobility`.
//!
//! Each cycle, in this order:
//! 1. Within the goal tolerance, the planner stops.
//! 2. It marks what it sees on its map, relative to its believed pose: for a ray that shows a hazard, the cell at that point; for rectangles,
//!    all their cells.
//! 3. It plans a path.
//! 4. It turns in place towards the next waypoint, by at most the turn of one cycle, and looks again. Once it faces the waypoint, it drives one
//!    step, or less if the waypoint is nearer.
//! 5. If there is no path, it clears its map, which may be wrong, keeps only what it sees now, and backs up by one step. After clearing three
//!    times, it stops instead.
//! 6. If the rover itself tilts too much, it backs up by one step.
//!
//! The map is its only memory. Cells within half the body width of a possible hazard are blocked. [`sastrugi_navigation::explorer`] describes
//! how contradictory observations are combined.
//!
//! Termination: between two clearings, of which there are at most three, the knowledge of a cell can rise at most three times, and the number of
//! cells is limited. Once nothing new is seen, the plan no longer changes, each cycle turns or drives along it, and it leads to the goal. Ground
//! on which the rover tilts too much is not on the map. On such ground, and with errors in the believed pose, the distance and cycle limits end
//! the drive.

use sastrugi_mobility::rover::{Command, PlannerParameters, Policy, RoverParameters, Situation, Stop, View};
use sastrugi_navigation::explorer::{CELLS_MAX, Explorer, ExplorerSettings, Sight};
use sastrugi_schemas::ParameterError;

/// Memory of a cell of its map, bytes.
const BYTES_PER_CELL: u64 = 50;
/// Largest bearing error to a waypoint that is corrected while driving, rad; it moves the rover sideways by at most a hundredth of a step.
const FACING_RAD: f64 = 0.01;
/// Number of times the planner may clear its map.
const FORGETS: u32 = 3;

/// Memory of the map of one rover, bytes.
pub fn memory_bytes() -> u64 {
    CELLS_MAX as u64 * BYTES_PER_CELL
}

/// A new planner.
pub fn policy(parameters: &PlannerParameters) -> Box<dyn Policy> {
    Box::new(Planner::new(parameters))
}

/// Checks that the map of a trial does not need too many cells.
///
/// # Errors
/// A map with too many cells.
pub fn check(parameters: &PlannerParameters, trial: &RoverParameters) -> Result<(), ParameterError> {
    // The direction from start to goal is arbitrary; the map is largest along a diagonal.
    let (along_m, settings) = (std::f64::consts::FRAC_1_SQRT_2 * trial.straight_m(), settings(parameters));
    let largest = settings.geometry([0.0; 2], [along_m; 2], settings.beyond_m);
    largest.map(drop).map_err(|e| ParameterError::new("map_cell_m", e.message))
}

/// The settings of the map and of the body that affect a plan.
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

/// The planner and its memory.
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
        // Rays locate hazards. A strip does not: it is a hazard wherever in it the rock is, and safe even if its rays miss most of it.
        for area in areas.iter().filter(|_| rays.is_empty()) {
            let sight = if area.hazard { Sight::Hazard } else { Sight::Safe };
            explorer.see(&area.corners_m.map(|corner| situation.pose.to_ground(corner)), sight);
        }
    }

    fn back_up(&mut self, state: &'static str) -> Command {
        self.state = state;
        Command::drive(-self.step_m)
    }

    /// Clears the map except for what the rover sees now, or stops.
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

    /// Turns to the next waypoint, or drives towards it.
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

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_mobility::rover::draws::CycleDraws;
    use sastrugi_mobility::rover::{Area, PlannerEyes, PlannerMap, Pose, SchoppersParameters};
    use sastrugi_numeric::{Counter, Streams};

    /// Turns of 10 degrees, steps of 0.1 m, a goal tolerance of 0.5 m.
    fn planner() -> Planner {
        let eyes = PlannerEyes::Rectangles(SchoppersParameters::default());
        Planner::new(&PlannerParameters { eyes, map: PlannerMap::default(), mind: policy })
    }

    fn open() -> View {
        View { areas: Vec::new(), rays: Vec::new(), tilted: false }
    }

    /// What the planner decides at the origin.
    fn decide(planner: &mut Planner, heading_rad: f64, goal_m: [f64; 2], view: &View) -> Command {
        let draws = CycleDraws::new(Counter::new(&mut Streams::for_seed(1, "planner-test").stream("noise")), 0);
        planner.decide(&Situation { pose: Pose { position_m: [0.0; 2], heading_rad }, goal_m, view, draws })
    }

    /// Left is positive; one cycle turns by at most 10 degrees.
    #[test]
    fn val_it_turns_to_the_goal() {
        let turn_rad = 10.0_f64.to_radians();
        let mut left = planner();
        assert_eq!(decide(&mut left, 0.0, [0.0, 10.0], &open()), Command::turn(turn_rad));
        assert_eq!(left.state(), "turn");
        let mut right = planner();
        assert_eq!(decide(&mut right, 0.0, [0.0, -10.0], &open()), Command::turn(-turn_rad));
    }

    /// Once it faces the next waypoint, it drives one step.
    #[test]
    fn val_it_drives_towards_what_it_faces() {
        let mut planner = planner();
        decide(&mut planner, 0.0, [6.0, 8.0], &open());
        let [x, y] = planner.plan()[1];
        let command = decide(&mut planner, libm::atan2(y, x), [6.0, 8.0], &open());
        assert!((command.drive_m - 0.1).abs() < 1e-12 && command.turn_rad.abs() < 1e-9, "{command:?}");
        assert_eq!((planner.state(), planner.plan().last()), ("drive", Some(&[6.0, 8.0])));
    }

    /// Within the goal tolerance it stops, even if it tilts; elsewhere it backs up from where it tilts.
    #[test]
    fn val_it_stops_at_the_goal_and_backs_up_from_tilt() {
        let tilted = View { tilted: true, ..open() };
        let mut planner = planner();
        assert_eq!(decide(&mut planner, 0.0, [10.0, 0.0], &tilted), Command::drive(-0.1));
        assert_eq!(planner.state(), "back up");
        assert_eq!(decide(&mut planner, 0.0, [0.3, 0.3], &tilted), Command::stop(Stop::AtGoal));
        assert!(planner.plan().is_empty());
    }

    /// Enclosed by hazards, it clears its map three times and backs up each time; then it stops.
    #[test]
    fn val_it_gives_up_when_enclosed() {
        let area = |[near, far]: [f64; 2], [right, left]: [f64; 2]| Area {
            corners_m: [[near, right], [near, left], [far, left], [far, right]],
            hazard: true,
        };
        let areas = vec![
            area([1.0, 2.0], [-2.0, 2.0]),
            area([-2.0, -1.0], [-2.0, 2.0]),
            area([-2.0, 2.0], [1.0, 2.0]),
            area([-2.0, 2.0], [-2.0, -1.0]),
        ];
        let (mut planner, enclosed) = (planner(), View { areas, ..open() });
        for _ in 0..3 {
            assert_eq!(decide(&mut planner, 0.0, [10.0, 0.0], &enclosed), Command::drive(-0.1));
            assert_eq!(planner.state(), "forget");
        }
        assert_eq!(decide(&mut planner, 0.0, [10.0, 0.0], &enclosed), Command::stop(Stop::NoWay));
    }
}
