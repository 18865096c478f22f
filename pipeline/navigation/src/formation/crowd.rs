//! Motion of the members from target to target without collisions (the thesis, Algorithm 7, OnlinePathFinder).
//!
//! In every step the members act in order of priority, and each sees the moves already made. A member moves towards its target ("up") if the ground
//! ahead is passable and no other member is in its way. It waits for a member in its way, and avoids impassable ground by going up-left, up-right,
//! left, right, or back towards the line between its last target and the next. Discs are swept: two members never come closer than the sum of their
//! radii at any time between two steps.
//!
//! Where the thesis is silent: members that wait for each other would wait forever, so after [`PATIENCE`] waits the member of lower priority passes
//! the other as if it were a rock, and after twice as many the one of higher priority does. Lost members and members at their last target are rocks
//! at once. Moving obstacles are known one step ahead: a member passes them, and leaves their way if it would be run over. Slopes on a straight line
//! to a target are taken over quarters of a cell, as for routes; in other directions each step is within the limits. A member that comes no closer to
//! its target takes a detour over the cells. A team that makes no progress for [`STUCK_AFTER_S`] seconds, or whose joint state repeats, is stuck, so
//! it never moves in circles forever.

use super::detour::detour;
use super::footing::Footing;
use super::obstacles::MovingObstacle;
use super::placement::Disc;
use super::plane::{Vector, add, closest_approach, direction, distance, dot, length, scale, sub, to_the_right, turned};

#[cfg(test)]
mod tests;

/// Steps that a member waits for one of higher priority before it passes it.
pub const PATIENCE: u32 = 10;
/// Time without progress of any member after which the team counts as stuck, s.
pub const STUCK_AFTER_S: f64 = 60.0;
/// Time without progress after which a member plans a detour, s.
const DETOUR_AFTER_S: f64 = 5.0;
/// Largest number of detours per target.
const DETOURS_MAX: u32 = 3;
/// Steps that a member pauses if no direction is open.
const PAUSE: u32 = 5;
/// Least progress that counts, as a share of the step length.
const PROGRESS: f64 = 1e-3;
/// Relative rounding of distances.
const ROUNDING: f64 = 1e-12;

/// Directions in step 2 of the algorithm, in eighths of a turn to the left of "up", in order.
const DIRECT: [i32; 5] = [0, 1, -1, 2, -2];
/// Directions in step 3, for members to the right of the line between their targets; mirrored to the left of it.
const TO_THE_LINE: [i32; 4] = [0, 1, 2, 3];
/// All directions, for a member that would be run over.
const ALL: [i32; 8] = [0, 1, -1, 2, -2, 3, -3, 4];

/// Settings of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrowdSettings {
    /// Length of a step, s.
    pub step_s: f64,
    /// Radius of a member, m.
    pub radius_m: f64,
    /// Distance at which a target counts as reached, m.
    pub arrive_m: f64,
    /// Number of steps checked ahead on the ground, at least 1.
    pub look_ahead: u32,
    /// Whether members take detours; without them they move as in the thesis.
    pub detours: bool,
}

/// What a member is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Moving.
    Moving,
    /// Standing still in this step.
    Waiting,
    /// At its last target.
    Arrived,
    /// Lost; counts as a rock.
    Lost,
}

impl Phase {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Moving => "moving",
            Self::Waiting => "waiting",
            Self::Arrived => "arrived",
            Self::Lost => "lost",
        }
    }

    fn is_mobile(self) -> bool {
        matches!(self, Self::Moving | Self::Waiting)
    }
}

/// State of a member in Algorithm 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// Step 2.
    Direct,
    /// Step 3.
    ToTheLine,
    /// A pause, with the number of remaining steps.
    Pausing(u32),
}

/// State of motion of a member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Position, m.
    pub position_m: Vector,
    /// Displacement in the last step, m.
    pub moved_m: Vector,
    /// Direction to its target; kept once the target is reached.
    pub heading: Vector,
    /// Speed while moving, m/s.
    pub speed_m_s: f64,
    /// Index of its next target.
    pub next: usize,
    /// What it is doing.
    pub phase: Phase,
    /// True if it moved in a direction other than towards its target.
    pub dodging: bool,
    mode: Mode,
    /// True while it moves on a straight line to its goal that was found passable.
    on_line: bool,
    /// Number of waits for other members since it last moved towards its target.
    waits: u32,
}

/// How close a member has come to its target.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Progress {
    best_m: f64,
    at_step: u64,
    detours: u32,
}

impl Progress {
    fn from(at_step: u64) -> Self {
        Self { best_m: f64::INFINITY, at_step, detours: 0 }
    }
}

/// The members, their targets, and moving obstacles.
#[derive(Clone, Debug)]
pub struct Crowd<'a> {
    footing: Footing<'a>,
    settings: CrowdSettings,
    obstacles: Vec<MovingObstacle>,
    motions: Vec<Motion>,
    /// Rank of each member in the order of priority.
    ranks: Vec<usize>,
    targets_m: Vec<Vec<Vector>>,
    /// Points to visit before the next target, the first of them last.
    detours: Vec<Vec<Vector>>,
    progress: Vec<Progress>,
    /// An earlier joint state, and its step.
    saved: (Vec<Motion>, u64),
    step: u64,
}

/// Next action of a member.
enum Action {
    Move { displacement_m: Vector, eighths: i32, mode: Mode },
    Wait(Mode),
    Pause(u32),
}

/// What lies in a direction.
enum Way {
    Open(Vector),
    Member,
    Blocked,
}

impl<'a> Crowd<'a> {
    /// Members at rest at these positions, each with its targets; a member without targets has arrived.
    pub fn new(
        footing: Footing<'a>,
        settings: CrowdSettings,
        starts_m: &[Vector],
        targets_m: Vec<Vec<Vector>>,
        speed_m_s: f64,
        obstacles: Vec<MovingObstacle>,
    ) -> Self {
        let motion = |(start_m, targets_m): (&Vector, &Vec<Vector>)| Motion {
            position_m: *start_m,
            moved_m: [0.0; 2],
            heading: targets_m.first().and_then(|target| direction(sub(*target, *start_m))).unwrap_or([1.0, 0.0]),
            speed_m_s,
            next: 0,
            phase: if targets_m.is_empty() { Phase::Arrived } else { Phase::Moving },
            dodging: false,
            mode: Mode::Direct,
            on_line: false,
            waits: 0,
        };
        let motions: Vec<Motion> = starts_m.iter().zip(&targets_m).map(motion).collect();
        Self {
            footing,
            settings,
            obstacles,
            detours: vec![Vec::new(); motions.len()],
            progress: vec![Progress::from(0); motions.len()],
            ranks: (0..motions.len()).collect(),
            saved: (Vec::new(), 0),
            motions,
            targets_m,
            step: 0,
        }
    }

    /// States of motion of the members.
    pub fn motions(&self) -> &[Motion] {
        &self.motions
    }

    /// Time since the start, s. If the step rate is an integer, it is computed as steps over rate, so that times are the closest floats to their
    /// decimals.
    pub fn time_s(&self) -> f64 {
        let (steps, rate_hz) = (self.step as f64, 1.0 / self.settings.step_s);
        if rate_hz == rate_hz.round() { steps / rate_hz } else { steps * self.settings.step_s }
    }

    /// The moving obstacles.
    pub fn obstacles(&self) -> &[MovingObstacle] {
        &self.obstacles
    }

    /// The member's present target, m; its position once it has arrived.
    pub fn target_m(&self, member: usize) -> Vector {
        let motion = &self.motions[member];
        self.targets_m[member].get(motion.next).copied().unwrap_or(motion.position_m)
    }

    /// Replaces the ground that the members stand on.
    pub fn stand_on(&mut self, footing: Footing<'a>) {
        self.footing = footing;
    }

    /// Whether the straight line between two points is passable.
    pub fn is_passable(&self, from_m: Vector, to_m: Vector) -> bool {
        self.footing.is_passable(from_m, to_m)
    }

    /// Sets the speed of a member, m/s.
    pub fn set_speed(&mut self, member: usize, speed_m_s: f64) {
        self.motions[member].speed_m_s = speed_m_s;
    }

    /// Marks a member as lost, so that it counts as a rock.
    pub fn lose(&mut self, member: usize) {
        let motion = &mut self.motions[member];
        (motion.phase, motion.moved_m, motion.dodging) = (Phase::Lost, [0.0; 2], false);
    }

    /// Gives a member other targets, with `next` the index of the present one; lost members keep theirs. A member whose present target is the same
    /// point continues unchanged.
    pub fn redirect(&mut self, member: usize, targets_m: Vec<Vector>, next: usize) {
        let motion = self.motions[member];
        if motion.phase == Phase::Lost {
            return;
        }
        let same = targets_m.get(next) == self.targets_m[member].get(motion.next);
        self.motions[member].next = next;
        self.targets_m[member] = targets_m;
        if !same {
            if next < self.targets_m[member].len() {
                (self.motions[member].phase, self.motions[member].mode) = (Phase::Moving, Mode::Direct);
            }
            self.begin_target(member);
        }
    }

    /// Moves all members by one step, in this order. Returns the member that is stuck once the team makes no progress.
    pub fn step(&mut self, order: &[usize]) -> Option<usize> {
        self.motions.iter_mut().for_each(|motion| motion.moved_m = [0.0; 2]);
        order.iter().enumerate().for_each(|(rank, &member)| self.ranks[member] = rank);
        order.iter().for_each(|&member| self.act(member));
        self.step += 1;
        self.stuck()
    }

    fn act(&mut self, member: usize) {
        self.arrive(member);
        if !self.motions[member].phase.is_mobile() {
            return;
        }
        if let Some(heading) = direction(sub(self.target_m(member), self.motions[member].position_m)) {
            self.motions[member].heading = heading;
        }
        self.look_at_line(member);
        let action = self.escape(member, self.decide(member));
        let waits_for_member = matches!(action, Action::Wait(_));
        self.take(member, action);
        self.note_progress(member);
        if !waits_for_member && self.settings.detours {
            self.look_for_detour(member);
        }
    }

    /// Advances to the next target once the present one is reached.
    fn arrive(&mut self, member: usize) {
        while self.motions[member].phase.is_mobile() {
            let motion = self.motions[member];
            let step_m = motion.speed_m_s * self.settings.step_s;
            let on_detour = !self.detours[member].is_empty();
            let near_m = if on_detour { step_m } else { step_m.max(self.settings.arrive_m) };
            if distance(motion.position_m, self.goal_m(member)) > near_m {
                return;
            }
            self.motions[member].on_line = false;
            if self.detours[member].pop().is_some() {
                continue;
            }
            let motion = &mut self.motions[member];
            motion.next += 1;
            if motion.next >= self.targets_m[member].len() {
                (motion.phase, motion.dodging) = (Phase::Arrived, false);
            }
            self.begin_target(member);
        }
    }

    fn begin_target(&mut self, member: usize) {
        self.motions[member].on_line = false;
        self.detours[member].clear();
        self.progress[member] = Progress::from(self.step);
    }

    /// The point that a member is heading for: its target, or a point of its detour.
    fn goal_m(&self, member: usize) -> Vector {
        self.detours[member].last().copied().unwrap_or_else(|| self.target_m(member))
    }

    /// Checks whether the straight line to the goal is passable, unless the member is already on such a line. Slopes are taken over quarters of a
    /// cell, so a part of a passable line may be too steep on its own.
    fn look_at_line(&mut self, member: usize) {
        let motion = &self.motions[member];
        let on_line = motion.on_line || self.footing.is_passable(motion.position_m, self.goal_m(member));
        self.motions[member].on_line = on_line;
    }

    fn decide(&self, member: usize) -> Action {
        let motion = &self.motions[member];
        if let Mode::Pausing(left @ 1..) = motion.mode {
            return Action::Pause(left - 1);
        }
        let up = direction(sub(self.goal_m(member), motion.position_m)).unwrap_or(motion.heading);
        if motion.mode != Mode::ToTheLine {
            let action = self.first_way(member, up, DIRECT, Mode::Direct);
            if let Some(action) = action {
                return action;
            }
        }
        let side = if self.is_right_of_line(member) { 1 } else { -1 };
        let action = self.first_way(member, up, TO_THE_LINE.map(|eighths| side * eighths), Mode::ToTheLine);
        action.unwrap_or(Action::Pause(PAUSE))
    }

    /// The first direction that the ground leaves open: taken, or waited for if another member is in the way.
    fn first_way<const N: usize>(&self, member: usize, up: Vector, directions: [i32; N], mode: Mode) -> Option<Action> {
        directions.into_iter().find_map(|eighths| match self.way(member, up, eighths) {
            Way::Open(displacement_m) => {
                let mode = if eighths.abs() <= 1 { Mode::Direct } else { mode };
                Some(Action::Move { displacement_m, eighths, mode })
            }
            Way::Member => Some(Action::Wait(mode)),
            Way::Blocked => None,
        })
    }

    /// Checks a direction: the ground for the steps ahead, moving members and obstacles for this step only.
    fn way(&self, member: usize, up: Vector, eighths: i32) -> Way {
        let motion = &self.motions[member];
        let step_m = motion.speed_m_s * self.settings.step_s;
        let limit_m = match eighths {
            0 => distance(motion.position_m, self.goal_m(member)),
            _ => f64::INFINITY,
        };
        let along = turned(up, eighths);
        let ahead_m = add(motion.position_m, scale(along, (step_m * f64::from(self.settings.look_ahead)).min(limit_m)));
        let displacement_m = scale(along, step_m.min(limit_m));
        let end_m = add(motion.position_m, displacement_m);
        let is_open = || {
            let passable = |to_m: Vector| self.footing.is_passable(motion.position_m, to_m);
            passable(ahead_m) && passable(end_m) && self.footing.holds(end_m)
        };
        if !(motion.on_line && eighths == 0 || is_open()) || self.meets_obstacle(member, displacement_m) {
            return Way::Blocked;
        }
        let others = 0..self.motions.len();
        let met = others.filter(|other| *other != member && self.meets(member, *other, displacement_m));
        met.fold(Way::Open(displacement_m), |way, other| match way {
            Way::Blocked => way,
            _ if self.is_rock(member, other) => Way::Blocked,
            _ => Way::Member,
        })
    }

    /// Whether a displacement brings a member into the disc of another, given how that one has moved in this step.
    fn meets(&self, member: usize, other: usize, displacement_m: Vector) -> bool {
        let (motion, other) = (&self.motions[member], &self.motions[other]);
        let offset_m = sub(motion.position_m, sub(other.position_m, other.moved_m));
        touches(offset_m, sub(displacement_m, other.moved_m), 2.0 * self.settings.radius_m)
    }

    /// Whether a displacement brings a member into a moving obstacle.
    fn meets_obstacle(&self, member: usize, displacement_m: Vector) -> bool {
        let (now_s, position_m) = (self.time_s(), self.motions[member].position_m);
        self.obstacles.iter().any(|obstacle| {
            let start_m = obstacle.position_m(now_s);
            let moved_m = sub(obstacle.position_m(now_s + self.settings.step_s), start_m);
            let least_m = self.settings.radius_m + obstacle.radius_m;
            touches(sub(position_m, start_m), sub(displacement_m, moved_m), least_m)
        })
    }

    /// Whether a member passes another instead of waiting for it.
    fn is_rock(&self, member: usize, other: usize) -> bool {
        let patience = if self.ranks[other] < self.ranks[member] { PATIENCE } else { 2 * PATIENCE };
        !self.motions[other].phase.is_mobile() || self.motions[member].waits >= patience
    }

    /// Whether a member is to the right of the line from its last target to the next.
    fn is_right_of_line(&self, member: usize) -> bool {
        let motion = &self.motions[member];
        let target_m = self.target_m(member);
        let last_m = motion.next.checked_sub(1).and_then(|last| self.targets_m[member].get(last));
        let Some(&last_m) = last_m else { return false };
        dot(sub(motion.position_m, last_m), to_the_right(sub(target_m, last_m))) > 0.0
    }

    /// Replaces the action of a member that an obstacle would run over.
    fn escape(&self, member: usize, action: Action) -> Action {
        if matches!(action, Action::Move { .. }) || !self.meets_obstacle(member, [0.0; 2]) {
            return action;
        }
        let motion = &self.motions[member];
        let up = direction(sub(self.goal_m(member), motion.position_m)).unwrap_or(motion.heading);
        let open = ALL.into_iter().find_map(|eighths| match self.way(member, up, eighths) {
            Way::Open(displacement_m) => Some(Action::Move { displacement_m, eighths, mode: Mode::Direct }),
            _ => None,
        });
        open.unwrap_or(action)
    }

    fn take(&mut self, member: usize, action: Action) {
        let motion = &mut self.motions[member];
        match action {
            Action::Move { displacement_m, eighths, mode } => {
                motion.position_m = add(motion.position_m, displacement_m);
                (motion.moved_m, motion.mode, motion.phase) = (displacement_m, mode, Phase::Moving);
                motion.dodging = eighths != 0;
                motion.on_line &= eighths == 0;
                if eighths == 0 {
                    motion.waits = 0;
                }
            }
            Action::Wait(mode) => {
                (motion.mode, motion.phase, motion.dodging) = (mode, Phase::Waiting, false);
                motion.waits = (motion.waits + 1).min(2 * PATIENCE);
            }
            Action::Pause(left) => {
                (motion.mode, motion.phase, motion.dodging) = (Mode::Pausing(left), Phase::Waiting, false);
            }
        }
    }

    fn note_progress(&mut self, member: usize) {
        let motion = &self.motions[member];
        let way_m = self.detours[member]
            .iter()
            .rev()
            .chain([&self.target_m(member)])
            .fold((motion.position_m, 0.0), |(last_m, sum_m), point_m| (*point_m, sum_m + distance(last_m, *point_m)));
        let progress = &mut self.progress[member];
        let least_m = PROGRESS * motion.speed_m_s * self.settings.step_s;
        if way_m.1 < progress.best_m - least_m {
            (progress.best_m, progress.at_step) = (way_m.1, self.step);
        }
    }

    /// Time since a member last came closer to its target, s.
    fn without_progress_s(&self, member: usize) -> f64 {
        (self.step - self.progress[member].at_step) as f64 * self.settings.step_s
    }

    fn look_for_detour(&mut self, member: usize) {
        if self.without_progress_s(member) < DETOUR_AFTER_S || self.progress[member].detours >= DETOURS_MAX {
            return;
        }
        let detours = self.progress[member].detours + 1;
        self.progress[member] = Progress { best_m: f64::INFINITY, at_step: self.step, detours };
        let (motion, discs) = (self.motions[member], self.rocks(member));
        let last = self.targets_m[member].len().saturating_sub(1);
        // Targets that cannot be reached are skipped.
        let candidates = (motion.next..=motion.next + 2).chain([last]).filter(|k| *k <= last);
        let found = candidates.into_iter().find_map(|k| {
            let target_m = self.targets_m[member][k];
            detour(&self.footing, motion.position_m, target_m, &discs).map(|points_m| (k, points_m))
        });
        if let Some((k, points_m)) = found {
            self.motions[member].next = k;
            (self.motions[member].mode, self.motions[member].on_line) = (Mode::Direct, false);
            // The last point is the target itself.
            self.detours[member] = points_m.into_iter().rev().skip(1).collect();
        }
    }

    /// Stationary discs around a member, with the sums of both radii.
    fn rocks(&self, member: usize) -> Vec<Disc> {
        let radius_m = self.settings.radius_m;
        let still = self.motions.iter().enumerate().filter(|(k, motion)| *k != member && motion.phase != Phase::Moving);
        let members = still.map(|(_, motion)| Disc { position_m: motion.position_m, radius_m: 2.0 * radius_m });
        let now_s = self.time_s();
        let ended = self.obstacles.iter().filter(|obstacle| obstacle.end_s() <= now_s);
        let obstacles = ended
            .map(|obstacle| Disc { position_m: obstacle.position_m(now_s), radius_m: radius_m + obstacle.radius_m });
        members.chain(obstacles).collect()
    }

    /// The member without progress for longest, once no member makes progress or the joint state repeats.
    fn stuck(&mut self) -> Option<usize> {
        let mobile = |member: &usize| self.motions[*member].phase.is_mobile();
        let members: Vec<usize> = (0..self.motions.len()).filter(mobile).collect();
        let oldest = members.iter().copied().min_by_key(|member| self.progress[*member].at_step)?;
        let out_of_time = members.iter().all(|member| self.without_progress_s(*member) >= STUCK_AFTER_S);
        (self.repeats(&members) || out_of_time).then_some(oldest)
    }

    /// Whether the members move as they did at an earlier step, and so would repeat forever (Brent, 1980: every state is compared with the one at the
    /// last power of two).
    fn repeats(&mut self, mobile: &[usize]) -> bool {
        let may_detour =
            self.settings.detours && mobile.iter().any(|member| self.progress[*member].detours < DETOURS_MAX);
        if may_detour || self.obstacles.iter().any(|obstacle| obstacle.end_s() > self.time_s()) {
            return false;
        }
        let repeats = self.saved.0 == self.motions;
        if !repeats && (self.step.is_power_of_two() || self.saved.0.is_empty()) {
            self.saved = (self.motions.clone(), self.step);
        }
        repeats
    }

    /// Least distance between the centres of two members during the last step, m; infinite for a single member.
    pub fn least_separation_m(&self) -> f64 {
        let mut least_m = f64::INFINITY;
        for (k, one) in self.motions.iter().enumerate() {
            for other in &self.motions[k + 1..] {
                let offset_m = sub(sub(one.position_m, one.moved_m), sub(other.position_m, other.moved_m));
                least_m = least_m.min(closest_approach(offset_m, sub(one.moved_m, other.moved_m)));
            }
        }
        least_m
    }

    /// Number of members that a moving obstacle touches now.
    pub fn touched(&self) -> usize {
        let now_s = self.time_s();
        let touched = |motion: &&Motion| {
            self.obstacles.iter().any(|obstacle| {
                let least_m = (self.settings.radius_m + obstacle.radius_m) * (1.0 - ROUNDING);
                distance(motion.position_m, obstacle.position_m(now_s)) < least_m
            })
        };
        self.motions.iter().filter(touched).count()
    }
}

/// Whether a point at `offset_m` comes closer to the origin than `least_m` as it moves or, if it is closer already, comes closer still.
fn touches(offset_m: Vector, motion_m: Vector, least_m: f64) -> bool {
    let (now_m, reach_m) = (length(offset_m), length(motion_m));
    now_m - reach_m < least_m && closest_approach(offset_m, motion_m) < least_m.min(now_m) * (1.0 - ROUNDING)
}
