//! A run of a team: formation, placement, motion, speeds and losses combined.

use super::crowd::{Crowd, Motion, Phase};
use super::footing::{Footing, TeamGround};
use super::metrics::{Metrics, errors_m};
use super::parameters::{Loss, TeamParameters};
use super::placement::{Disc, Placement, Placer, heading};
use super::plane::{Vector, add, distance, length, scale, sub};
use super::scout::{Advice, Scout};
use super::shape::Formation;
use sastrugi_schemas::ParameterError;

#[cfg(test)]
mod tests;

/// An event of the same kind and member within this time of the previous one is not recorded, s.
const EVENT_GAP_S: f64 = 1.0;
/// Largest distance in cells within which a free start is searched for a member.
const SEARCH_CELLS: f64 = 100.0;

/// Why a team could not start. Messages read after "failed to".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TeamError {
    /// A parameter out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The route has no length.
    #[error("lead a team along a route of no length: it needs two distinct waypoints")]
    Route,
    /// There is no free position for a member at the start.
    #[error(
        "place member {member} near ({:.2}, {:.2}) at the start of the route: no free ground nearby has room for a disc of radius {radius_m} m",
        position_m[0], position_m[1]
    )]
    NoRoom {
        /// Member, from 1.
        member: u32,
        /// Its position, m.
        position_m: Vector,
        /// Radius of a member, m.
        radius_m: f64,
    },
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All remaining members are at their last targets.
    Arrived,
    /// No member makes progress; this one has made none for longest.
    Stuck {
        /// Member, from 1.
        member: u32,
    },
    /// The time limit was reached.
    Timeout,
}

impl Outcome {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Arrived => "arrived",
            Self::Stuck { .. } => "stuck",
            Self::Timeout => "timeout",
        }
    }
}

/// An event of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Time, s.
    pub time_s: f64,
    /// Member, from 1; `None` for an event of the team.
    pub member: Option<u32>,
    /// What happened.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Clone, Debug, PartialEq)]
pub enum EventKind {
    /// The run starts.
    Start,
    /// A member starts to wait.
    Wait,
    /// A member starts to move in a direction other than towards its target.
    Dodge,
    /// A member is lost.
    Lost,
    /// A member moves to another slot.
    Rearranged {
        /// Id of the slot.
        slot: u32,
    },
    /// The leader heads for a waypoint with too little room for the formation.
    Squeezed {
        /// Index of the waypoint, from 0.
        waypoint: usize,
    },
    /// The team heads for its goal by another route.
    Replanned,
    /// A member has reached its last target.
    Arrived,
    /// The run has ended.
    End(Outcome),
}

/// State of a member, and how well it keeps its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position, m.
    pub position_m: Vector,
    /// Direction to its target.
    pub heading: Vector,
    /// Velocity over the last step, m/s.
    pub velocity_m_s: Vector,
    /// Id of its slot; `None` once it is lost.
    pub slot: Option<u32>,
    /// Its present target, m.
    pub target_m: Vector,
    /// Depth and width error, m; `None` for the leader and for lost members.
    pub errors_m: Option<[f64; 2]>,
    /// What it is doing.
    pub phase: Phase,
}

/// The formation's box, valid from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedBox {
    /// Time, s.
    pub time_s: f64,
    /// Corners: front left, front right, rear right, rear left, m.
    pub corners_m: [Vector; 4],
    /// Whether there is too little room for the formation.
    pub squeezed: bool,
}

/// The route of a team, valid from a time on.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedRoute {
    /// Time, s.
    pub time_s: f64,
    /// Waypoints, m.
    pub points_m: Vec<Vector>,
}

/// A team that follows a route.
#[derive(Clone, Debug)]
pub struct Team<'a> {
    ground: &'a TeamGround<'a>,
    parameters: TeamParameters,
    formation: Formation,
    /// What the team has seen, if it plans its own route.
    scout: Option<Scout<'a>>,
    /// Waypoints that are still needed.
    route_m: Vec<Vector>,
    /// Index of the first of them.
    first: usize,
    routes: Vec<TimedRoute>,
    placements: Vec<Placement>,
    crowd: Crowd<'a>,
    /// Remaining losses, the next one last.
    losses: Vec<Loss>,
    metrics: Metrics,
    events: Vec<Event>,
    boxes: Vec<TimedBox>,
    /// Time at which each member was last seen waiting, and dodging, s.
    seen_s: Vec<[f64; 2]>,
    time_max_s: f64,
    outcome: Option<Outcome>,
}

impl<'a> Team<'a> {
    /// A team at the start of a route, in m; members are placed as at any waypoint. A team with a sensing radius uses only the ends and the time
    /// limit of the route, and plans its own route by the costs of the ground, which must depend on slope alone. For other teams, costs matter only
    /// for detours.
    ///
    /// # Errors
    /// Parameters out of range, a route of no length, or no room at its start.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::formation::{Outcome, Team, TeamGround, TeamParameters};
    /// use sastrugi_navigation::{CostModel, Ground, SlopeCost, SlopeLimits, TravelMap};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let heights = Grid::filled(Geometry::square(40, 80, 1.0), 0.0);
    /// let map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
    /// let costs = CostModel::new(SlopeCost::THESIS, None, &map)?;
    /// let ground = TeamGround::new(Ground { map: &map, costs: &costs, clearance: None });
    /// // Two members in a column, 10 m apart, drive 40 m east at 1 m/s.
    /// let parameters = TeamParameters { members: Some(2), ..TeamParameters::default() };
    /// let mut team = Team::new(&ground, &parameters, &[[20.0, 20.0], [60.0, 20.0]])?;
    /// assert_eq!(team.run(|_| ())?, Outcome::Arrived);
    /// assert!((38.0..42.0).contains(&team.time_s()) && team.metrics().least_separation_m > 8.0);
    /// # Ok(())
    /// # }
    /// ```
    pub fn new(ground: &'a TeamGround<'a>, parameters: &TeamParameters, route_m: &[Vector]) -> Result<Self, TeamError> {
        parameters.check()?;
        let formation = parameters.formation()?;
        let route_length_m: f64 = route_m.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let mut scout = scout(ground, parameters, route_m)?;
        let own_m = scout.as_mut().and_then(Scout::first_plan);
        let points_m = own_m.unwrap_or_else(|| route_m.to_vec());
        let route_m = divided(&points_m, parameters.leg_max_m())?;
        let footing = Footing::new(ground, &route_m);
        let placements = placer(&footing, &formation, &route_m, parameters, &[]).all();
        let starts_m = starts(&footing, &formation, placements.first().ok_or(TeamError::Route)?, parameters.radius_m)?;
        let members = formation.slots().len();
        let targets_m = (0..members).map(|slot| targets(&placements, slot)).collect();
        let mut losses = parameters.losses.clone();
        losses.sort_by(|a, b| b.time_s.total_cmp(&a.time_s));
        let (speed_m_s, obstacles) = (parameters.speed_m_s, parameters.obstacles.clone());
        let mut team = Self {
            crowd: Crowd::new(footing, parameters.crowd(), &starts_m, targets_m, speed_m_s, obstacles),
            ground,
            formation,
            scout,
            route_m,
            first: 0,
            routes: vec![TimedRoute { time_s: 0.0, points_m }],
            placements,
            losses,
            metrics: Metrics::of(members),
            events: Vec::new(),
            boxes: Vec::new(),
            seen_s: vec![[f64::NEG_INFINITY; 2]; members],
            time_max_s: parameters.time_limit_s(route_length_m),
            parameters: parameters.clone(),
            outcome: None,
        };
        team.record(None, EventKind::Start);
        team.enter_waypoint(0);
        Ok(team)
    }

    /// Runs to the end; calls `sample` at the start and at every sampling instant, which may include the end.
    ///
    /// # Errors
    /// A sampling rate that does not match the steps.
    pub fn run(&mut self, mut sample: impl FnMut(&Self)) -> Result<Outcome, TeamError> {
        let every = self.parameters.sample_every()?;
        sample(self);
        for step in 1u64.. {
            let outcome = self.step();
            if step.is_multiple_of(every) {
                sample(self);
            }
            if let Some(outcome) = outcome {
                return Ok(outcome);
            }
        }
        Ok(Outcome::Timeout)
    }

    /// Runs one step; returns the outcome once the run has ended.
    pub fn step(&mut self) -> Option<Outcome> {
        if self.outcome.is_some() {
            return self.outcome;
        }
        self.apply_due_losses();
        self.outcome =
            if self.look() { self.advance() } else { Some(Outcome::Stuck { member: self.leader() as u32 + 1 }) };
        if let Some(outcome) = self.outcome {
            self.record(None, EventKind::End(outcome));
        }
        self.outcome
    }

    /// Adjusts the speeds and moves all members by one step.
    fn advance(&mut self) -> Option<Outcome> {
        self.tune_speeds();
        let before: Vec<Motion> = self.crowd.motions().to_vec();
        let stuck = self.crowd.step(&self.order());
        self.record_step(&before);
        self.ended(stuck)
    }

    /// Looks around if the team plans its own route; false if there is no path.
    fn look(&mut self) -> bool {
        let leader_m = self.motion_in(0).position_m;
        let Some(scout) = &mut self.scout else { return true };
        match scout.look(leader_m) {
            Advice::Continue => true,
            Advice::NoPath => false,
            Advice::Lead { ahead_m, turns } => {
                if turns {
                    self.metrics.replans += 1;
                    self.record(None, EventKind::Replanned);
                }
                self.lead_on(&ahead_m);
                true
            }
        }
    }

    /// Leads the team on from its leader's position. Waypoints that other members have still to pass are kept, but thinned, so that headings are
    /// those of complete legs rather than of every look around.
    fn lead_on(&mut self, ahead_m: &[Vector]) {
        let leader_m = self.motion_in(0).position_m;
        // Goes straight to the second point if that is passable: the first is the node next to the leader.
        let straight = ahead_m.get(1).is_some_and(|second_m| self.crowd.is_passable(leader_m, *second_m));
        let points_m = [&[leader_m], &ahead_m[usize::from(straight)..]].concat();
        let Ok(ahead_m) = divided(&points_m, self.parameters.leg_max_m()) else { return };
        let passed = self.motion_in(0).next.min(self.route_m.len() - 1);
        let next = self.order().into_iter().map(|member| self.crowd.motions()[member].next);
        let first = next.fold(passed, usize::min).saturating_sub(1);
        let apart_m = self.parameters.leg_max_m().min(self.parameters.spacing_m);
        let is_near = |point_m: &Vector| distance(*point_m, leader_m) < apart_m;
        let near = self.route_m[first..passed].iter().rev().take_while(|point_m| is_near(point_m)).count();
        let kept = passed - near;
        self.route_m = [&self.route_m[first..kept], &ahead_m].concat();
        self.first += first;
        self.routes.push(TimedRoute { time_s: self.time_s(), points_m });
        // The leader's position is now waypoint `kept`; members next to and ahead of the leader head for the one after it.
        self.replace_targets(|_, motion| match motion.next {
            next if next < kept => next - first,
            next if next < passed => kept - first,
            next => next - passed + kept + 1 - first,
        });
        self.enter_waypoint(kept + 1 - first);
    }

    /// Time since the start, s.
    pub fn time_s(&self) -> f64 {
        self.crowd.time_s()
    }

    /// States of motion of the members, first member first.
    pub fn motions(&self) -> &[Motion] {
        self.crowd.motions()
    }

    /// The present formation.
    pub fn formation(&self) -> &Formation {
        &self.formation
    }

    /// Waypoints that are still needed, m, and the placement at each.
    pub fn placements(&self) -> (&[Vector], &[Placement]) {
        (&self.route_m, &self.placements)
    }

    /// Routes of the team so far, in order of time.
    pub fn routes(&self) -> &[TimedRoute] {
        &self.routes
    }

    /// Metrics so far.
    pub fn metrics(&self) -> &Metrics {
        &self.metrics
    }

    /// Events so far, in order of time.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Boxes of the formation so far, in order of time.
    pub fn boxes(&self) -> &[TimedBox] {
        &self.boxes
    }

    /// Present state of the members, first member first.
    pub fn samples(&self) -> Vec<Sample> {
        let sample = |(k, motion): (usize, &Motion)| {
            let slot = self.formation.slot_of(k as u32 + 1);
            Sample {
                position_m: motion.position_m,
                heading: motion.heading,
                velocity_m_s: scale(motion.moved_m, 1.0 / self.parameters.step_s),
                slot: slot.map(|at| self.formation.slots()[at].id),
                target_m: self.crowd.target_m(k),
                errors_m: slot.and_then(|at| self.errors_m(at)),
                phase: motion.phase,
            }
        };
        self.crowd.motions().iter().enumerate().map(sample).collect()
    }

    /// Members in order of priority.
    fn order(&self) -> Vec<usize> {
        self.formation.slots().iter().map(|slot| slot.member as usize - 1).collect()
    }

    /// The member in the first slot, as an index.
    fn leader(&self) -> usize {
        self.formation.slots()[0].member as usize - 1
    }

    fn motion_in(&self, slot: usize) -> &Motion {
        &self.crowd.motions()[self.formation.slots()[slot].member as usize - 1]
    }

    /// Direction of the route's leg that the member in a slot is on.
    fn forward(&self, slot: usize) -> Vector {
        heading(&self.route_m, self.motion_in(slot).next.min(self.route_m.len() - 1).saturating_sub(1))
    }

    /// Depth and width error of the member in a slot, m; `None` for the leader.
    fn errors_m(&self, slot: usize) -> Option<[f64; 2]> {
        let predecessor = self.formation.slots()[slot].predecessor?;
        let [ahead_m, own_m] = [predecessor, slot].map(|at| self.motion_in(at).position_m);
        Some(errors_m(ahead_m, self.forward(predecessor), own_m, self.formation.slots()[slot].offset_m))
    }

    fn tune_speeds(&mut self) {
        let position = |slot: usize| self.motion_in(slot).position_m;
        let requests = self.parameters.bands().requests(&self.formation, position, |slot| self.forward(slot));
        let (limits, order) = (self.parameters.speeds(), self.order());
        for (request, member) in requests.into_iter().zip(order) {
            let speed_m_s = self.crowd.motions()[member].speed_m_s;
            self.crowd.set_speed(member, limits.tuned(speed_m_s, request, self.parameters.step_s));
        }
    }

    /// Applies the losses that are due.
    fn apply_due_losses(&mut self) {
        while let Some(loss) = self.losses.pop_if(|loss| loss.time_s <= self.crowd.time_s()) {
            self.crowd.lose(loss.member as usize - 1);
            self.record(Some(loss.member), EventKind::Lost);
            // Cannot fail: the losses were checked, so each member is lost once and one remains.
            let moved = self.formation.lose(loss.member).unwrap_or_default();
            self.replace_targets(|_, motion| motion.next);
            moved.iter().for_each(|&(member, slot)| self.record(Some(member), EventKind::Rearranged { slot }));
        }
    }

    /// Recomputes the targets of the present formation; `next` gives the waypoint that the member in a slot heads for.
    fn replace_targets(&mut self, next: impl Fn(usize, &Motion) -> usize) {
        let lost = self.crowd.motions().iter().filter(|motion| motion.phase == Phase::Lost);
        let discs: Vec<Disc> =
            lost.map(|motion| Disc { position_m: motion.position_m, radius_m: self.parameters.radius_m }).collect();
        let footing = Footing::new(self.ground, &self.route_m);
        self.placements = placer(&footing, &self.formation, &self.route_m, &self.parameters, &discs).all();
        let last = self.route_m.len() - 1;
        for (slot, member) in self.order().into_iter().enumerate() {
            let motion = self.crowd.motions()[member];
            let targets_m = targets(&self.placements, slot);
            // A member that has arrived checks its last target again.
            let moved_m = distance(motion.position_m, targets_m[last]);
            let at = next(slot, &motion);
            let next = if at > last && moved_m > self.parameters.arrive_m { last } else { at };
            self.crowd.redirect(member, targets_m, next);
        }
        self.crowd.stand_on(footing);
    }

    /// Records the events and metrics of a step.
    fn record_step(&mut self, before: &[Motion]) {
        let leader = self.leader();
        let after: Vec<Motion> = self.crowd.motions().to_vec();
        for (k, (before, after)) in before.iter().zip(&after).enumerate() {
            self.metrics.driven_m[k] += length(after.moved_m);
            if after.phase == Phase::Waiting {
                self.metrics.waits += 1;
                self.record_unless_recent(k, 0, before.phase != Phase::Waiting, EventKind::Wait);
            }
            if after.dodging {
                self.metrics.dodges += 1;
                self.record_unless_recent(k, 1, !before.dodging, EventKind::Dodge);
            }
            if self.leads_to_goal() && after.phase == Phase::Arrived && before.phase != Phase::Arrived {
                self.record(Some(k as u32 + 1), EventKind::Arrived);
            }
            if k == leader && after.next != before.next && after.next < self.placements.len() {
                self.enter_waypoint(after.next);
            }
        }
        for slot in 0..self.formation.slots().len() {
            let member = self.formation.slots()[slot].member as usize - 1;
            if let (true, Some(errors_m)) = (before[member].phase != Phase::Arrived, self.errors_m(slot)) {
                self.metrics.followers[member].add(errors_m, self.parameters.spacing_m);
            }
        }
        self.metrics.least_separation_m = self.metrics.least_separation_m.min(self.crowd.least_separation_m());
        self.metrics.contacts += self.crowd.touched() as u64;
    }

    /// Records that the leader heads for a waypoint.
    fn enter_waypoint(&mut self, waypoint: usize) {
        let Placement { corners_m, squeezed, .. } = self.placements[waypoint];
        self.boxes.push(TimedBox { time_s: self.time_s(), corners_m, squeezed });
        if squeezed {
            self.metrics.squeezed += 1;
            self.record(None, EventKind::Squeezed { waypoint: self.first + waypoint });
        }
    }

    fn ended(&self, stuck: Option<usize>) -> Option<Outcome> {
        let mut phases = self.crowd.motions().iter().map(|motion| motion.phase);
        if self.leads_to_goal() && phases.all(|phase| matches!(phase, Phase::Arrived | Phase::Lost)) {
            return Some(Outcome::Arrived);
        }
        let out_of_time = (self.time_s() >= self.time_max_s).then_some(Outcome::Timeout);
        stuck.map(|member| Outcome::Stuck { member: member as u32 + 1 }).or(out_of_time)
    }

    /// False while the present route ends where the known ground ends.
    fn leads_to_goal(&self) -> bool {
        self.scout.as_ref().is_none_or(Scout::leads_to_goal)
    }

    fn record(&mut self, member: Option<u32>, kind: EventKind) {
        self.events.push(Event { time_s: self.time_s(), member, kind });
    }

    /// Records that a member starts to wait (0) or to dodge (1), unless it did so a moment ago.
    fn record_unless_recent(&mut self, member: usize, which: usize, begins: bool, kind: EventKind) {
        let (now_s, last_s) = (self.time_s(), self.seen_s[member][which]);
        self.seen_s[member][which] = now_s;
        if begins && now_s - last_s > EVENT_GAP_S {
            self.record(Some(member as u32 + 1), kind);
        }
    }
}

fn scout<'a>(
    ground: &'a TeamGround<'a>,
    parameters: &TeamParameters,
    route_m: &[Vector],
) -> Result<Option<Scout<'a>>, TeamError> {
    let [Some(&start_m), Some(&goal_m)] = [route_m.first(), route_m.last()] else { return Err(TeamError::Route) };
    let scout = parameters
        .sensing_radius_m
        .map(|radius_m| Scout::new(ground, radius_m, parameters.arrive_m, [start_m, goal_m]));
    Ok(scout.transpose()?)
}

fn placer<'a>(
    footing: &'a Footing<'a>,
    formation: &'a Formation,
    route_m: &'a [Vector],
    parameters: &TeamParameters,
    discs: &'a [Disc],
) -> Placer<'a> {
    let TeamParameters { radius_m, margin_m, .. } = *parameters;
    Placer { footing, formation, route_m, radius_m, margin_m, discs }
}

/// Targets of a slot at all waypoints, m.
fn targets(placements: &[Placement], slot: usize) -> Vec<Vector> {
    placements.iter().map(|placement| placement.targets_m[slot]).collect()
}

/// Positions at the first waypoint, m; without room there, the nearest free nodes.
fn starts(
    footing: &Footing<'_>,
    formation: &Formation,
    first: &Placement,
    radius_m: f64,
) -> Result<Vec<Vector>, TeamError> {
    let [left_m, right_m, depth_m] = formation.extent_m();
    let [dx, dy] = footing.ground().map.cell_m();
    let cells = libm::ceil((right_m - left_m + depth_m + 4.0 * radius_m) / dx.min(dy)).min(SEARCH_CELLS) as i32;
    let mut starts_m: Vec<Vector> = Vec::new();
    for (&place_m, member) in first.targets_m.iter().zip(1..) {
        let apart = |point_m: Vector| starts_m.iter().all(|other| distance(point_m, *other) >= 2.0 * radius_m);
        let in_place = Some(place_m).filter(|place_m| footing.holds(*place_m) && apart(*place_m));
        let near = || footing.node_near(place_m, cells, apart).map(|node| footing.ground().map.position_m(node));
        let start_m = in_place.or_else(near);
        starts_m.push(start_m.ok_or(TeamError::NoRoom { member, position_m: place_m, radius_m })?);
    }
    Ok(starts_m)
}

/// A route with waypoints at most `leg_max_m` apart, without successive duplicates.
fn divided(route_m: &[Vector], leg_max_m: f64) -> Result<Vec<Vector>, TeamError> {
    let mut all: Vec<Vector> = Vec::new();
    for &point_m in route_m {
        let Some(&last_m) = all.last() else {
            all.push(point_m);
            continue;
        };
        let leg_m = distance(last_m, point_m);
        if leg_m > 0.0 {
            let count = libm::ceil(leg_m / leg_max_m).max(1.0) as usize;
            all.extend((1..count).map(|k| add(last_m, scale(sub(point_m, last_m), k as f64 / count as f64))));
            all.push(point_m);
        }
    }
    match all.len() {
        0 | 1 => Err(TeamError::Route),
        _ => Ok(all),
    }
}
