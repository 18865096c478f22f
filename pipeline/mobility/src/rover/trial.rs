//! Drives one rover from a start to a goal: sense, decide, move, until it stops or reaches a limit.

use super::contacts::Contacts;
use super::draws::CycleDraws;
use super::motion::{Moved, NoiseParameters, Poses};
use super::policies::{Policy, Situation, Stop};
use super::pose::{Body, Chassis, Pose};
use super::sensing::{Sensor, View};
use super::starts::Start;
use sastrugi_numeric::{Counter, Ground, NoGround};

/// Body, sensor and limits shared by all rovers of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Wheel geometry.
    pub chassis: Chassis,
    /// Sensor.
    pub sensor: Sensor,
    /// Noise of sensing and motion.
    pub noise: NoiseParameters,
    /// Distance from the goal within which a rover has arrived, m.
    pub goal_tolerance_m: f64,
    /// Rocks higher than this count as contacts, m.
    pub clearance_m: f64,
    /// Largest distance driven, m.
    pub distance_limit_m: f64,
    /// Maximum number of cycles.
    pub cycle_limit: u32,
    /// Driving speed, m/s.
    pub speed_m_s: f64,
    /// Turn rate, rad/s.
    pub turn_rate_rad_s: f64,
}

/// How a rover's drive ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// It reached the goal.
    Reached,
    /// It stopped where it wrongly believed the goal to be.
    Lost,
    /// It found no way to continue.
    NoWay,
    /// It reached the distance limit.
    DistanceLimit,
    /// It reached the cycle limit.
    CycleLimit,
    /// It looked or drove beyond the known ground.
    OffGround(NoGround),
}

impl Ending {
    /// Name of the ending off the ground in tables.
    pub const OFF_GROUND: &str = "off_ground";

    /// Name in tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Reached => "reached",
            Self::Lost => "lost",
            Self::NoWay => "no_way",
            Self::DistanceLimit => "distance_limit",
            Self::CycleLimit => "cycle_limit",
            Self::OffGround(_) => Self::OFF_GROUND,
        }
    }
}

/// One cycle, after sensing and the decision.
#[derive(Clone, Copy, Debug)]
pub struct Cycle<'a> {
    /// Number, from 0.
    pub number: u32,
    /// Time at the beginning of the cycle, s.
    pub time_s: f64,
    /// Distance driven before the cycle, m.
    pub distance_m: f64,
    /// True and believed pose.
    pub poses: Poses,
    /// Height and tilt of the body.
    pub body: Body,
    /// Sensor view.
    pub view: &'a View,
    /// State of the policy.
    pub state: &'static str,
    /// The planned path, m; empty for policies that do not plan.
    pub plan: &'a [[f64; 2]],
    /// The motion of the cycle; zero in the last one.
    pub moved: Moved,
    /// Contacts so far.
    pub contacts: Contacts,
}

/// Summary of a rover's drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// How it ended.
    pub ending: Ending,
    /// Straight distance from start to goal, m.
    pub straight_m: f64,
    /// Distance driven, including reversals, m.
    pub distance_m: f64,
    /// Distance to the goal at the end, m.
    pub residual_m: f64,
    /// Distance to the goal once half of the distance limit was driven, m; for shorter drives, the distance at the end.
    pub residual_half_m: f64,
    /// Time, s.
    pub time_s: f64,
    /// Number of cycles.
    pub cycles: u32,
    /// Number of cycles with a turn.
    pub turns: u32,
    /// Sum of the absolute turns, rad.
    pub turned_rad: f64,
    /// Number of reversals.
    pub reversals: u32,
    /// Number of cycles with a hazard in view.
    pub hazards: u32,
    /// Rock contacts.
    pub contacts: Contacts,
    /// Largest tilt, rad.
    pub tilt_max_rad: f64,
    /// Final pose.
    pub last: Pose,
}

/// Drives a rover. `rover` is the key of its random numbers; `each` is called with every cycle.
///
/// ```
/// use sastrugi_mobility::rover::{Navigator, RoverParameters, SojournerParameters, Start, drive};
/// use sastrugi_numeric::{Counter, Geometry, Grid, GroundGrid, Streams};
///
/// // Level sand, 4 x 8 m, and a rover that faces its goal 4 m ahead.
/// let ground = GroundGrid::of_heights(Grid::filled(Geometry::square(80, 160, 0.05), 0.0_f32));
/// let navigator = Navigator::Sojourner(SojournerParameters::default());
/// let task = navigator.task(&RoverParameters::default());
/// let start = Start::facing([1.0, 2.0], [5.0, 2.0]);
/// let key = Counter::new(&mut Streams::for_seed(1, "rover").stream("noise"));
///
/// let mut cycles = 0;
/// let drive = drive(&ground, &task, navigator.policy().as_mut(), &start, key, |_| cycles += 1);
/// assert!(drive.reached());
/// // Straight on to within the tolerance of 0.5 m, in steps of 65 mm.
/// assert!(drive.distance_m >= 3.5 - 1e-9 && drive.distance_m < 3.6);
/// assert_eq!(cycles, drive.cycles + 1, "the last cycle stops");
/// ```
pub fn drive(
    ground: &impl Ground,
    task: &Task,
    policy: &mut dyn Policy,
    start: &Start,
    rover: Counter,
    mut each: impl FnMut(&Cycle<'_>),
) -> Drive {
    let pose = start.pose();
    let mut run = Run {
        ground,
        task,
        goal_m: start.goal_m,
        poses: Poses { real: pose, believed: pose },
        drive: Drive::beginning(start),
        halfway: None,
    };
    let ending = loop {
        if let Some(ending) = run.limit() {
            break ending;
        }
        match run.cycle(policy, rover, &mut each) {
            Ok(None) => {}
            Ok(Some(ending)) => break ending,
            Err(no_ground) => break Ending::OffGround(no_ground),
        }
    };
    run.finish(ending)
}

impl Drive {
    fn beginning(start: &Start) -> Self {
        let pose = start.pose();
        let straight_m = pose.distance_m(start.goal_m);
        Self {
            ending: Ending::CycleLimit,
            straight_m,
            distance_m: 0.0,
            residual_m: straight_m,
            residual_half_m: straight_m,
            time_s: 0.0,
            cycles: 0,
            turns: 0,
            turned_rad: 0.0,
            reversals: 0,
            hazards: 0,
            contacts: Contacts::default(),
            tilt_max_rad: 0.0,
            last: pose,
        }
    }

    /// Whether it arrived.
    pub fn reached(&self) -> bool {
        self.ending == Ending::Reached
    }

    /// Efficiency (see [`super::efficiency()`]).
    pub fn efficiency(&self) -> f64 {
        super::efficiency(self.straight_m, self.distance_m, self.residual_m)
    }

    /// Efficiency for means over rovers: 0 for a rover that ended off the ground. Otherwise a rover that looked off the ground at
    /// its start would raise the mean with an efficiency of 1.
    pub fn counted_efficiency(&self) -> f64 {
        if matches!(self.ending, Ending::OffGround(_)) { 0.0 } else { self.efficiency() }
    }

    /// The efficiency if the distance limit had been half of `distance_limit_m`.
    pub fn efficiency_at_half(&self, distance_limit_m: f64) -> f64 {
        super::efficiency(self.straight_m, self.distance_m.min(0.5 * distance_limit_m), self.residual_half_m)
    }
}

struct Run<'a, G> {
    ground: &'a G,
    task: &'a Task,
    goal_m: [f64; 2],
    poses: Poses,
    drive: Drive,
    /// Distance to the goal once half of the distance limit was driven, m.
    halfway: Option<f64>,
}

impl<G: Ground> Run<'_, G> {
    fn limit(&self) -> Option<Ending> {
        if self.drive.distance_m >= self.task.distance_limit_m {
            return Some(Ending::DistanceLimit);
        }
        (self.drive.cycles >= self.task.cycle_limit).then_some(Ending::CycleLimit)
    }

    /// One cycle; returns the ending if it is the last.
    fn cycle(
        &mut self,
        policy: &mut dyn Policy,
        rover: Counter,
        each: &mut impl FnMut(&Cycle<'_>),
    ) -> Result<Option<Ending>, NoGround> {
        let task = self.task;
        let draws = CycleDraws::new(rover, self.drive.cycles);
        let before = self.poses;
        let body = Body::standing(self.ground, &before.real, &task.chassis)?;
        let view = task.sensor.look(self.ground, &before.real, &body, task.noise.height_m, &draws)?;
        let command = policy.decide(&Situation { pose: before.believed, goal_m: self.goal_m, view: &view, draws });
        let mut cycle = Cycle {
            number: self.drive.cycles,
            time_s: self.drive.time_s,
            distance_m: self.drive.distance_m,
            poses: before,
            body,
            view: &view,
            state: policy.state(),
            plan: policy.plan(),
            moved: Moved { turn_rad: 0.0, drive_m: 0.0 },
            contacts: self.drive.contacts,
        };
        self.drive.tilt_max_rad = self.drive.tilt_max_rad.max(body.tilt_rad());
        if let Some(stop) = command.stop {
            each(&cycle);
            let near = before.real.distance_m(self.goal_m) <= task.goal_tolerance_m;
            return Ok(Some(match stop {
                Stop::AtGoal if near => Ending::Reached,
                Stop::AtGoal => Ending::Lost,
                Stop::NoWay => Ending::NoWay,
            }));
        }
        cycle.moved = self.poses.carry_out(&command, &task.noise, &draws);
        each(&cycle);
        self.count(&cycle);
        self.drive.contacts.look(self.ground, &self.poses.real, &task.chassis, task.clearance_m)?;
        Ok(None)
    }

    fn count(&mut self, cycle: &Cycle<'_>) {
        let Moved { turn_rad, drive_m } = cycle.moved;
        let d = &mut self.drive;
        d.cycles += 1;
        d.turns += u32::from(turn_rad != 0.0);
        d.turned_rad += turn_rad.abs();
        d.reversals += u32::from(drive_m < 0.0);
        d.hazards += u32::from(cycle.view.has_hazard());
        d.distance_m += drive_m.abs();
        d.time_s += turn_rad.abs() / self.task.turn_rate_rad_s + drive_m.abs() / self.task.speed_m_s;
        if self.halfway.is_none() && d.distance_m >= 0.5 * self.task.distance_limit_m {
            self.halfway = Some(self.poses.real.distance_m(self.goal_m));
        }
    }

    fn finish(self, ending: Ending) -> Drive {
        let residual_m = self.poses.real.distance_m(self.goal_m);
        let residual_half_m = self.halfway.unwrap_or(residual_m);
        Drive { ending, residual_m, residual_half_m, last: self.poses.real, ..self.drive }
    }
}
