//! The recording and the table rows of a team's run.

use super::{PlannedRoute, Site};
use crate::operations::routes::distances_m;
use sastrugi_navigation::TravelMap;
use sastrugi_navigation::formation::obstacles::MovingObstacle;
use sastrugi_navigation::formation::team::{Event, EventKind, Sample};
use sastrugi_navigation::formation::{Outcome, Team, TeamParameters};
use sastrugi_schemas::counted;
use sastrugi_schemas::tables::{FormationEventRow, FormationSampleRow};
use sastrugi_schemas::topics::{
    DiscState, FormationBox, Member, MemberState, MovingDisc, PlannedRoute as TimedRoute, TeamEvent, TeamEventKind,
    TeamRecording,
};

/// Collects the samples of a run.
pub struct Recorder<'a> {
    map: &'a TravelMap,
    parameters: TeamParameters,
    /// Time and members of each sample.
    samples: Vec<(f64, Vec<Sample>)>,
}

impl<'a> Recorder<'a> {
    pub fn new(map: &'a TravelMap, parameters: &TeamParameters) -> Self {
        Self { map, parameters: parameters.clone(), samples: Vec::new() }
    }

    pub fn sample(&mut self, team: &Team<'_>) {
        self.samples.push((team.time_s(), team.samples()));
    }

    /// A point on the ground, m. Members stay on the map; obstacles that leave it continue at its lowest height.
    fn on_ground(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let lowest_m = || self.map.heights().range().map_or(0.0, |(low, _)| low);
        [x, y, self.map.height_at_m(self.map.point_at([x, y])).unwrap_or_else(lowest_m)]
    }

    fn state(&self, time_s: f64, sample: &Sample) -> MemberState {
        let position_m = self.on_ground(sample.position_m);
        let [vx, vy] = sample.velocity_m_s;
        let step_s = self.parameters.step_s;
        let before_m = self.on_ground([position_m[0] - vx * step_s, position_m[1] - vy * step_s]);
        let [dx, dy] = [0, 1].map(|axis| sample.target_m[axis] - sample.position_m[axis]);
        MemberState {
            time_s,
            position_m,
            heading_rad: libm::atan2(sample.heading[1], sample.heading[0]),
            velocity_m_s: [vx, vy, (position_m[2] - before_m[2]) / step_s],
            slot: sample.slot.map(i64::from),
            depth_error_m: sample.errors_m.map(|[depth_m, _]| depth_m),
            width_error_m: sample.errors_m.map(|[_, width_m]| width_m),
            target_distance_m: (dx * dx + dy * dy).sqrt(),
        }
    }
}

/// The recording of a finished run.
pub fn recording(team: &Team<'_>, recorder: &Recorder<'_>, site: &Site<'_>, route: &PlannedRoute) -> TeamRecording {
    let TeamParameters { radius_m, sample_rate_hz, obstacles, .. } = &recorder.parameters;
    let member = |k: usize| Member {
        number: k as i64 + 1,
        name: format!("member_{}", k + 1),
        radius_m: *radius_m,
        states: recorder.samples.iter().map(|(time_s, members)| recorder.state(*time_s, &members[k])).collect(),
    };
    let disc = |obstacle: &MovingObstacle| MovingDisc {
        radius_m: obstacle.radius_m,
        states: recorder
            .samples
            .iter()
            .map(|(time_s, _)| DiscState {
                time_s: *time_s,
                position_m: recorder.on_ground(obstacle.position_m(*time_s)),
            })
            .collect(),
    };
    let boxes = team.boxes().iter().map(|one| FormationBox {
        time_s: one.time_s,
        corners_m: one.corners_m.map(|corner| recorder.on_ground(corner)),
        squeezed: one.squeezed,
    });
    let members = recorder.samples.first().map_or(0, |(_, members)| members.len());
    TeamRecording {
        sample_rate_hz: *sample_rate_hz,
        members: (0..members).map(member).collect(),
        routes: planned(team, recorder, route),
        search_path_m: route.searched_m.clone(),
        vertices_m: site.vertices_m.to_vec(),
        boxes: boxes.collect(),
        obstacles: site.planned.obstacles.clone(),
        moving: obstacles.iter().map(disc).collect(),
        events: team.events().iter().flat_map(|event| described(event, members, &departure(recorder, route))).collect(),
    }
}

/// The given route with the heights of its search, or those that the team planned.
fn planned(team: &Team<'_>, recorder: &Recorder<'_>, route: &PlannedRoute) -> Vec<TimedRoute> {
    if recorder.parameters.sensing_radius_m.is_none() {
        return vec![TimedRoute { time_s: 0.0, points_m: route.points_m.clone() }];
    }
    let own = team.routes().iter().map(|one| TimedRoute {
        time_s: one.time_s,
        points_m: one.points_m.iter().map(|point_m| recorder.on_ground(*point_m)).collect(),
    });
    own.collect()
}

/// How a team starts; continues the sentence "4 members set out ".
fn departure(recorder: &Recorder<'_>, route: &PlannedRoute) -> String {
    let length_m = distances_m(&route.points_m).last().copied().unwrap_or(0.0);
    match recorder.parameters.sensing_radius_m {
        None => format!("along {length_m:.1} m"),
        Some(radius_m) => {
            format!(
                "without a route, with a sensing radius of {radius_m} m; the route unknown to them is {length_m:.1} m long"
            )
        }
    }
}

/// An event with its text; a run that ends without arriving has two.
fn described(event: &Event, members: usize, departure: &str) -> Vec<TeamEvent> {
    let one = |kind: TeamEventKind, member: Option<u32>, text: String| TeamEvent {
        time_s: event.time_s,
        kind,
        member: member.map(i64::from),
        text,
    };
    let own = |kind: TeamEventKind, text: &str| vec![one(kind, event.member, text.to_owned())];
    let end = |text: String| one(TeamEventKind::End, None, text);
    match &event.kind {
        EventKind::Start => own(TeamEventKind::Start, &format!("{} set out {departure}", counted(members, "member"))),
        EventKind::Wait => own(TeamEventKind::Wait, "waits"),
        EventKind::Dodge => own(TeamEventKind::Dodge, "leaves the straight line to its target"),
        EventKind::Lost => own(TeamEventKind::Lost, "is lost and stays as an obstacle"),
        EventKind::Rearranged { slot } => own(TeamEventKind::Rearranged, &format!("takes slot {slot}")),
        EventKind::Squeezed { waypoint } => {
            own(TeamEventKind::Squeezed, &format!("waypoint {} leaves too little room for the formation", waypoint + 1))
        }
        EventKind::Replanned => own(TeamEventKind::Replanned, "replans its route to the goal"),
        EventKind::Arrived => own(TeamEventKind::Arrived, "reaches its last target"),
        EventKind::End(outcome) => {
            let time_s = event.time_s;
            match outcome {
                Outcome::Arrived => vec![end(format!("arrived after {time_s:.1} s"))],
                Outcome::Stuck { member } => vec![
                    one(TeamEventKind::Stuck, Some(*member), "makes no progress towards its target".to_owned()),
                    end(format!("stuck after {time_s:.1} s")),
                ],
                Outcome::Timeout => vec![
                    one(TeamEventKind::Timeout, None, "ran out of time".to_owned()),
                    end(format!("ended after {time_s:.1} s")),
                ],
            }
        }
    }
}

/// Rows of the samples, member by member.
pub fn sample_rows(
    terrain: &str,
    run: &str,
    recorder: &Recorder<'_>,
    recording: &TeamRecording,
) -> Vec<FormationSampleRow> {
    let of_member = |(k, member): (usize, &Member)| {
        let states = member.states.iter().zip(&recorder.samples).enumerate();
        let row = |(number, (state, (_, members))): (usize, (&MemberState, &(f64, Vec<Sample>)))| {
            let ([x_m, y_m, z_m], [vx, vy, _]) = (state.position_m, state.velocity_m_s);
            let sample = &members[k];
            FormationSampleRow {
                terrain_id: terrain.to_owned(),
                run_id: run.to_owned(),
                member: member.number,
                sample: number as i64,
                time_s: state.time_s,
                x_m,
                y_m,
                z_m,
                heading_deg: state.heading_rad.to_degrees(),
                speed_m_s: (vx * vx + vy * vy).sqrt(),
                slot: state.slot,
                target_x_m: sample.target_m[0],
                target_y_m: sample.target_m[1],
                depth_error_m: state.depth_error_m.unwrap_or(f64::NAN),
                width_error_m: state.width_error_m.unwrap_or(f64::NAN),
                state: sample.phase.name().to_owned(),
                split: None,
            }
        };
        states.map(row).collect::<Vec<_>>()
    };
    recording.members.iter().enumerate().flat_map(of_member).collect()
}

/// Rows of the events, in order of time.
pub fn event_rows(terrain: &str, run: &str, recording: &TeamRecording) -> Vec<FormationEventRow> {
    let row = |(number, event): (usize, &TeamEvent)| FormationEventRow {
        terrain_id: terrain.to_owned(),
        run_id: run.to_owned(),
        event: number as i64,
        time_s: event.time_s,
        kind: event.kind.name().to_owned(),
        member: event.member,
        text: event.text.clone(),
    };
    recording.events.iter().enumerate().map(row).collect()
}
