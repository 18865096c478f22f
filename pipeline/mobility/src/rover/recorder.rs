//! Recording of a rover's drive: every cycle with its view, plans and events.

use super::pose::{Body, Pose};
use super::sensing::{Area, Ray, View};
use super::trial::{Cycle, Drive, Ending, Task};
use sastrugi_schemas::topics::{
    RoverCycle, RoverEvent, RoverEventKind, RoverPlan, RoverRecording, SeenArea, SeenRay, StateSample,
};

/// A recording in progress.
pub struct Recorder<'a> {
    task: &'a Task,
    recording: RoverRecording,
    /// Whether the previous cycle saw a hazard, and whether it turned.
    before: [bool; 2],
}

impl<'a> Recorder<'a> {
    /// An empty recording.
    pub fn new(task: &'a Task) -> Self {
        let (axle_m, track_m) = (task.chassis.axle_m, task.chassis.track_m);
        Self { task, recording: RoverRecording { axle_m, track_m, ..RoverRecording::default() }, before: [false; 2] }
    }

    /// Adds a cycle of a rover on its way to a goal, m.
    pub fn add(&mut self, cycle: &Cycle<'_>, goal_m: [f64; 2]) {
        self.add_events(cycle, goal_m);
        let height_m = cycle.body.height_m;
        let points_m: Vec<[f64; 3]> = cycle.plan.iter().map(|[x, y]| [*x, *y, height_m]).collect();
        if self.recording.plans.last().is_none_or(|plan| ends(&plan.points_m) != ends(&points_m))
            && !points_m.is_empty()
        {
            self.recording.plans.push(RoverPlan { time_s: cycle.time_s, points_m });
        }
        self.recording.cycles.push(self.cycle(cycle, goal_m));
    }

    fn cycle(&self, cycle: &Cycle<'_>, goal_m: [f64; 2]) -> RoverCycle {
        let (real, believed) = (&cycle.poses.real, &cycle.poses.believed);
        let [x, y] = real.position_m;
        RoverCycle {
            time_s: cycle.time_s,
            number: cycle.number,
            position_m: [x, y, cycle.body.height_m],
            heading_rad: real.heading_rad,
            believed_m: believed.position_m,
            believed_heading_rad: believed.heading_rad,
            roll_pitch_rad: cycle.body.roll_pitch_rad(),
            state: cycle.state.to_owned(),
            moved: [cycle.moved.turn_rad, cycle.moved.drive_m],
            durations_s: [
                cycle.moved.turn_rad.abs() / self.task.turn_rate_rad_s,
                cycle.moved.drive_m.abs() / self.task.speed_m_s,
            ],
            distance_m: cycle.distance_m,
            goal_distance_m: real.distance_m(goal_m),
            contacts: cycle.contacts.anywhere,
            areas: cycle.view.areas.iter().map(|area| seen_area(area, real, &cycle.body)).collect(),
            rays: seen_rays(cycle.view),
        }
    }

    fn add_events(&mut self, cycle: &Cycle<'_>, goal_m: [f64; 2]) {
        let [x, y] = cycle.poses.real.position_m;
        if cycle.number == 0 {
            let (far_m, heading_deg) = (cycle.poses.real.distance_m(goal_m), cycle.poses.real.heading_rad.to_degrees());
            let text =
                format!("starts at ({x:.2}, {y:.2}) m, heading {heading_deg:.1} deg, {far_m:.2} m from the goal");
            self.event(cycle.time_s, RoverEventKind::Start, text);
        }
        self.add_contacts(cycle.time_s, cycle.contacts.anywhere, [x, y]);
        let now = [cycle.view.has_hazard(), cycle.moved.turn_rad != 0.0 && cycle.moved.drive_m == 0.0];
        if now[0] && !self.before[0] {
            let areas = cycle.view.areas.iter().filter(|area| area.hazard).count();
            let text = match cycle.view.tilted {
                true => format!("tilts by {:.1} deg, beyond its limit", cycle.body.tilt_rad().to_degrees()),
                false => format!("sees a hazard in {areas} of {} areas", cycle.view.areas.len()),
            };
            self.event(cycle.time_s, RoverEventKind::Hazard, text);
        }
        if now[1] && !self.before[1] {
            let side = if cycle.moved.turn_rad > 0.0 { "left" } else { "right" };
            self.event(cycle.time_s, RoverEventKind::Turn, format!("turns {side}: {}", cycle.state));
        }
        if cycle.moved.drive_m < 0.0 {
            self.event(cycle.time_s, RoverEventKind::Reversal, format!("drives back {:.3} m", -cycle.moved.drive_m));
        }
        self.before = now;
    }

    /// Adds the contacts that are not yet recorded.
    fn add_contacts(&mut self, time_s: f64, contacts: u32, [x, y]: [f64; 2]) {
        let known = self.recording.events.iter().filter(|event| event.kind == RoverEventKind::Contact).count();
        for number in known + 1..=contacts as usize {
            let limit_m = self.task.clearance_m;
            let text = format!("contact {number}: a rock above {limit_m} m under the rover at ({x:.2}, {y:.2}) m");
            self.event(time_s, RoverEventKind::Contact, text);
        }
    }

    fn event(&mut self, time_s: f64, kind: RoverEventKind, text: String) {
        self.recording.events.push(RoverEvent { time_s, kind, text });
    }

    /// The recording of a finished drive; `states` are its poses at [`RoverRecording::RATE_HZ`], `note` is the reason why it did not
    /// arrive.
    pub fn finish(mut self, drive: &Drive, states: Vec<StateSample>, note: Option<&str>) -> RoverRecording {
        self.add_contacts(drive.time_s, drive.contacts.anywhere, drive.last.position_m);
        let arrived =
            format!("reached the goal after {:.2} m, {:.2} m from its centre", drive.distance_m, drive.residual_m);
        self.event(drive.time_s, kind(&drive.ending), note.map_or(arrived, str::to_owned));
        self.recording.states = states;
        self.recording
    }
}

/// The waypoints beyond the position of the rover, by which two plans are compared.
fn ends(points_m: &[[f64; 3]]) -> Vec<[f64; 2]> {
    points_m.iter().skip(1).map(|[x, y, _]| [*x, *y]).collect()
}

fn kind(ending: &Ending) -> RoverEventKind {
    match ending {
        Ending::Reached => RoverEventKind::Reached,
        Ending::Lost => RoverEventKind::Lost,
        Ending::NoWay => RoverEventKind::NoWay,
        Ending::DistanceLimit => RoverEventKind::DistanceLimit,
        Ending::CycleLimit => RoverEventKind::CycleLimit,
        Ending::OffGround(_) => RoverEventKind::OffGround,
    }
}

/// An area on the plane of the body.
fn seen_area(area: &Area, pose: &Pose, body: &Body) -> SeenArea {
    let corner = |at: [f64; 2]| {
        let [x, y] = pose.to_ground(at);
        [x, y, body.height_at_m(at)]
    };
    SeenArea { corners_m: area.corners_m.map(corner), hazard: area.hazard }
}

/// Rays with the hazard flag of their column.
fn seen_rays(view: &View) -> Vec<SeenRay> {
    let rows = view.rays.len().checked_div(view.areas.len()).unwrap_or(0).max(1);
    let seen = |(k, ray): (usize, &Ray)| SeenRay {
        from_m: ray.from_m,
        to_m: ray.to_m,
        hit: ray.height_m.is_some(),
        hazard: view.areas.get(k / rows).is_some_and(|area| area.hazard),
    };
    view.rays.iter().enumerate().map(seen).collect()
}
