//! One rover from a start to a goal: look, decide, move, until it stops or a limit is reached.

use super::contacts::Contacts;
use super::draws::CycleDraws;
use super::motion::{Moved, NoiseParameters, Poses};
use super::policies::{Policy, Situation, Stop};
use super::pose::{Body, Chassis, Pose};
use super::sensing::{Sensor, View};
use super::starts::Start;
use sastrugi_numeric::{Counter, Ground, NoGround};

/// What all rovers of a trial share.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// What they stand on.
    pub chassis: Chassis,
    /// What they see with.
    pub sensor: Sensor,
    /// Their noise.
    pub noise: NoiseParameters,
    /// Distance from the goal at which one has arrived, m.
    pub goal_tolerance_m: f64,
    /// Rocks higher than this are contacts, m.
    pub clearance_m: f64,
    /// Farthest drive, m.
    pub distance_limit_m: f64,
    /// Most cycles.
    pub cycle_limit: u32,
    /// Speed of a drive, m/s.
    pub speed_m_s: f64,
    /// Speed of a turn, rad/s.
    pub turn_rate_rad_s: f64,
}

/// How a rover ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// At the goal.
    Reached,
    /// It believed to be at the goal, and was not.
    Lost,
    /// It knew of no way on.
    NoWay,
    /// It drove as far as it may.
    DistanceLimit,
    /// It took as many cycles as it may.
    CycleLimit,
    /// It looked or went beyond the ground that is known.
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

/// One cycle, as it was when the rover had looked and decided.
#[derive(Clone, Copy, Debug)]
pub struct Cycle<'a> {
    /// Number, from 0.
    pub number: u32,
    /// Time at its beginning, s.
    pub time_s: f64,
    /// Driven before, m.
    pub distance_m: f64,
    /// Where the rover is and believes to be.
    pub poses: Poses,
    /// How it stands.
    pub body: Body,
    /// What it sees.
    pub view: &'a View,
    /// What it is at.
    pub state: &'static str,
    /// The way that it plans to take, m; empty for policies without plans.
    pub plan: &'a [[f64; 2]],
    /// What it does; nothing at the end.
    pub moved: Moved,
    /// Contacts so far.
    pub contacts: Contacts,
}

/// What a rover did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// How it ended.
    pub ending: Ending,
    /// Distance from start to goal, m.
    pub straight_m: f64,
    /// Distance driven, back included, m.
    pub distance_m: f64,
    /// Distance to the goal at the end, m.
    pub residual_m: f64,
    /// Distance to the goal when half of the distance limit was driven, m; that at the end for shorter drives.
    pub residual_half_m: f64,
    /// Time, s.
    pub time_s: f64,
    /// Cycles.
    pub cycles: u32,
    /// Cycles with a turn.
    pub turns: u32,
    /// Sum of all turns, rad.
    pub turned_rad: f64,
    /// Drives back.
    pub reversals: u32,
    /// Cycles with a hazard in view.
    pub hazards: u32,
    /// Rocks met.
    pub contacts: Contacts,
    /// Largest tilt, rad.
    pub tilt_max_rad: f64,
    /// Where it ended.
    pub last: Pose,
}

/// Drives a rover. `rover` is the key of its draws, `each` is shown every cycle.
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
            Err(nowhere) => break Ending::OffGround(nowhere),
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

    /// Efficiency in means over rovers: 0 for one that ended off the ground. It has shown none, and must not lift a mean, as the 1 of a rover
    /// that looked off the ground at its start would.
    pub fn counted_efficiency(&self) -> f64 {
        if matches!(self.ending, Ending::OffGround(_)) { 0.0 } else { self.efficiency() }
    }

    /// The same had the distance limit been half of `distance_limit_m`.
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
    /// Distance to the goal when half of the distance limit had been driven, m.
    halfway: Option<f64>,
}

impl<G: Ground> Run<'_, G> {
    fn limit(&self) -> Option<Ending> {
        if self.drive.distance_m >= self.task.distance_limit_m {
            return Some(Ending::DistanceLimit);
        }
        (self.drive.cycles >= self.task.cycle_limit).then_some(Ending::CycleLimit)
    }

    /// One cycle; how it ended when it is the last.
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
