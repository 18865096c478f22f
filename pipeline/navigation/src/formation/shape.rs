//! Formations: slots at fixed offsets from one another, and the members that occupy them (the thesis, section 4.1 and Algorithm 9).
//!
//! A slot lies behind its predecessor by its depth, and to the right of it by its width, m; slot 1 has no predecessor and leads. Lower ids are nearer
//! the front and have priority. A slot may hold a team with a formation of its own, whose leader occupies the slot.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// Largest number of members of a team.
pub(super) const MEMBERS_MAX: usize = 1000;

/// A slot as stated in a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SlotParameters {
    /// Id, from 1; unique in the formation.
    pub id: u32,
    /// Id of the slot that it follows, smaller than its own; absent only for slot 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predecessor: Option<u32>,
    /// Distance behind the predecessor, m.
    #[serde(default)]
    pub depth_m: f64,
    /// Distance to the right of the predecessor, m.
    #[serde(default)]
    pub width_m: f64,
    /// Slots of a team that occupies this slot, with ids from 1; its leader stands here.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub team: Vec<SlotParameters>,
}

/// A formation by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pattern {
    /// One behind another.
    #[default]
    Column,
    /// Side by side, alternately to the left and to the right of the leader.
    Line,
    /// Behind the leader on both sides, in a V.
    Wedge,
}

impl Pattern {
    /// All patterns.
    pub const ALL: [Self; 3] = [Self::Column, Self::Line, Self::Wedge];

    /// Name in studies and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Column => "column",
            Self::Line => "line",
            Self::Wedge => "wedge",
        }
    }

    /// Slots of a team of this size. With four members they are those of the thesis.
    ///
    /// ```
    /// use sastrugi_navigation::formation::shape::Pattern;
    ///
    /// let wedge = Pattern::Wedge.slots(4, 2.0);
    /// let place = |k: usize| (wedge[k].id, wedge[k].predecessor, wedge[k].depth_m, wedge[k].width_m);
    /// assert_eq!(place(0), (1, None, 0.0, 0.0));
    /// // To the left of the leader, to its right, and behind the one on the left.
    /// assert_eq!(place(1), (2, Some(1), 2.0, -2.0));
    /// assert_eq!(place(2), (3, Some(1), 2.0, 2.0));
    /// assert_eq!(place(3), (4, Some(2), 2.0, -2.0));
    /// ```
    pub fn slots(self, members: u32, spacing_m: f64) -> Vec<SlotParameters> {
        let leader = SlotParameters { id: 1, predecessor: None, depth_m: 0.0, width_m: 0.0, team: Vec::new() };
        let follower = |id: u32| {
            // Slot 2 is to the left and 3 to the right; each later one follows the one two before.
            let (predecessor, side) = match self {
                Self::Column => (id - 1, 0.0),
                Self::Line | Self::Wedge if id == 2 => (1, -1.0),
                Self::Line | Self::Wedge if id == 3 => (1, 1.0),
                Self::Line | Self::Wedge => (id - 2, if id.is_multiple_of(2) { -1.0 } else { 1.0 }),
            };
            let depth_m = if self == Self::Line { 0.0 } else { spacing_m };
            SlotParameters { id, predecessor: Some(predecessor), depth_m, width_m: side * spacing_m, team: Vec::new() }
        };
        std::iter::once(leader).chain((2..=members).map(follower)).collect()
    }
}

/// Why a formation was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormationError {
    /// No slot has id 1.
    #[error("no slot has id 1, which is the leader's")]
    Leaderless,
    /// Two slots with the same id.
    #[error("two slots have id {0}; ids must be unique")]
    Duplicate(u32),
    /// A slot other than the first has no predecessor.
    #[error("slot {0} has no predecessor; every slot except 1 must follow one with a smaller id")]
    Unled(u32),
    /// The predecessor does not have a smaller id, or does not exist.
    #[error("slot {slot} follows slot {predecessor}; it must follow an existing slot with a smaller id")]
    Predecessor {
        /// Slot.
        slot: u32,
        /// Its predecessor.
        predecessor: u32,
    },
    /// Too many slots.
    #[error("the formation has {0} slots; a team has at most {MEMBERS_MAX} members")]
    Size(usize),
    /// The leader follows another slot.
    #[error("slot 1 follows slot {0}; as the leader it must have no predecessor")]
    Led(u32),
    /// An offset is not finite.
    #[error("the offset of slot {0} is not finite")]
    Offset(u32),
    /// A slot is nearer the front than one with a smaller id.
    #[error(
        "slot {slot} lies {depth_m} m behind the leader, nearer the front than slot {ahead} at {ahead_m} m; lower ids must be nearer the front"
    )]
    Order {
        /// Slot.
        slot: u32,
        /// Its distance behind the leader, m.
        depth_m: f64,
        /// A slot with a smaller id.
        ahead: u32,
        /// Its distance behind the leader, m.
        ahead_m: f64,
    },
    /// Two slots are too close to each other.
    #[error("slots {first} and {second} lie {distance_m:.3} m apart; members of radius {radius_m} m need at least {} m", 2.0 * radius_m)]
    Crowded {
        /// Slot.
        first: u32,
        /// Another slot.
        second: u32,
        /// Distance between them, m.
        distance_m: f64,
        /// Radius of a member, m.
        radius_m: f64,
    },
    /// A member does not occupy a slot.
    #[error("member {0} is not in the team or has already been lost")]
    NotThere(u32),
    /// No member would be left.
    #[error("no member would be left")]
    TeamLost,
}

/// A validated slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Id.
    pub id: u32,
    /// Index of the predecessor among the slots; `None` for the leader.
    pub predecessor: Option<usize>,
    /// Distance behind the predecessor, and to the right of it, m.
    pub offset_m: [f64; 2],
    /// Distance behind the leader, and to the right of it, m.
    pub from_leader_m: [f64; 2],
    /// Member that occupies it, from 1.
    pub member: u32,
}

/// Slots in order of priority, each occupied by a member.
#[derive(Clone, Debug, PartialEq)]
pub struct Formation {
    slots: Vec<Slot>,
}

impl Formation {
    /// A formation of these slots for members of this radius; member k occupies the k-th slot by id. Teams within it are flattened: their members get
    /// the ids after those of the formation, and so a lower priority.
    ///
    /// # Errors
    /// See [`FormationError`].
    pub fn new(slots: &[SlotParameters], radius_m: f64) -> Result<Self, FormationError> {
        let mut slots = flattened(slots)?;
        if slots.len() > MEMBERS_MAX {
            return Err(FormationError::Size(slots.len()));
        }
        slots.iter_mut().zip(1..).for_each(|(slot, member)| slot.member = member);
        check_room(&slots, radius_m)?;
        Ok(Self { slots })
    }

    /// Slots in order of priority.
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// Index of the slot that a member occupies.
    pub fn slot_of(&self, member: u32) -> Option<usize> {
        self.slots.iter().position(|slot| slot.member == member)
    }

    /// Largest distance between two slots, m.
    pub fn diameter_m(&self) -> f64 {
        let apart_m = |a: &Slot, b: &Slot| {
            let [behind_m, aside_m] = [0, 1].map(|axis| a.from_leader_m[axis] - b.from_leader_m[axis]);
            (behind_m * behind_m + aside_m * aside_m).sqrt()
        };
        let pairs = self.slots.iter().enumerate().flat_map(|(k, a)| self.slots[..k].iter().map(move |b| apart_m(a, b)));
        pairs.fold(0.0, f64::max)
    }

    /// Extent to the sides and to the rear, m: `[leftmost, rightmost, rearmost]` from the leader.
    pub fn extent_m(&self) -> [f64; 3] {
        let fold = |axis: usize, from: f64, end: fn(f64, f64) -> f64| {
            self.slots.iter().map(|slot| slot.from_leader_m[axis]).fold(from, end)
        };
        [fold(1, 0.0, f64::min), fold(1, 0.0, f64::max), fold(0, 0.0, f64::max)]
    }

    /// Fills the slot of a lost member (the thesis, Algorithm 9): its lowest-numbered follower moves up, then that one's lowest-numbered follower,
    /// until one has no follower; its slot is removed. Other followers keep their slots. Returns the members that moved, with their new slots.
    ///
    /// # Errors
    /// A member without a slot, or the last member.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_navigation::formation::Formation;
    /// use sastrugi_navigation::formation::shape::Pattern;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// // A wedge of four: slots 2 and 3 follow the leader, slot 4 follows slot 2.
    /// let mut wedge = Formation::new(&Pattern::Wedge.slots(4, 10.0), 0.5)?;
    /// // Without the leader, member 2 leads and member 4 follows in its place.
    /// assert_eq!(wedge.lose(1)?, [(2, 1), (4, 2)]);
    /// let holders: Vec<(u32, u32)> = wedge.slots().iter().map(|slot| (slot.id, slot.member)).collect();
    /// assert_eq!(holders, [(1, 2), (2, 4), (3, 3)]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn lose(&mut self, member: u32) -> Result<Vec<(u32, u32)>, FormationError> {
        let mut empty = self.slot_of(member).ok_or(FormationError::NotThere(member))?;
        if self.slots.len() == 1 {
            return Err(FormationError::TeamLost);
        }
        let mut moved = Vec::new();
        while let Some(next) = self.slots.iter().position(|slot| slot.predecessor == Some(empty)) {
            self.slots[empty].member = self.slots[next].member;
            moved.push((self.slots[empty].member, self.slots[empty].id));
            empty = next;
        }
        self.slots.remove(empty);
        for slot in &mut self.slots {
            slot.predecessor = slot.predecessor.map(|at| if at > empty { at - 1 } else { at });
        }
        Ok(moved)
    }
}

/// The slots, including those of teams within them. The leader of such a team occupies its slot.
fn flattened(slots: &[SlotParameters]) -> Result<Vec<Slot>, FormationError> {
    let mut slots: Vec<&SlotParameters> = slots.iter().collect();
    slots.sort_by_key(|slot| slot.id);
    let mut all = of_one_level(&slots)?;
    for (at, slot) in slots.iter().enumerate().filter(|(_, slot)| !slot.team.is_empty()) {
        let (team, base) = (flattened(&slot.team)?, all.len() - 1);
        let (last_id, leader_m) = (all.iter().map(|slot| slot.id).max().unwrap_or(0), all[at].from_leader_m);
        all.extend(team.iter().skip(1).map(|member| Slot {
            id: last_id.saturating_add(member.id - 1),
            predecessor: member.predecessor.map(|k| if k == 0 { at } else { base + k }),
            from_leader_m: [0, 1].map(|axis| leader_m[axis] + member.from_leader_m[axis]),
            ..*member
        }));
    }
    Ok(all)
}

/// Slots in order of their ids, without the teams within them.
fn of_one_level(slots: &[&SlotParameters]) -> Result<Vec<Slot>, FormationError> {
    let mut checked: Vec<Slot> = Vec::with_capacity(slots.len());
    for slot in slots {
        checked.push(placed(slot, &checked)?);
    }
    if checked.first().is_none_or(|slot| slot.id != 1) {
        return Err(FormationError::Leaderless);
    }
    check_order(&checked)?;
    Ok(checked)
}

/// Positions a slot behind the slots before it.
fn placed(slot: &SlotParameters, before: &[Slot]) -> Result<Slot, FormationError> {
    let id = slot.id;
    if before.iter().any(|other| other.id == id) {
        return Err(FormationError::Duplicate(id));
    }
    if !(slot.depth_m.is_finite() && slot.width_m.is_finite()) {
        return Err(FormationError::Offset(id));
    }
    let offset_m = [slot.depth_m, slot.width_m];
    let (predecessor, from_leader_m) = match (id, slot.predecessor) {
        (0, _) => return Err(FormationError::Leaderless),
        (1, None) => (None, [0.0; 2]),
        (1, Some(other)) => return Err(FormationError::Led(other)),
        (_, None) => return Err(FormationError::Unled(id)),
        (_, Some(predecessor)) => {
            let at = before.iter().position(|other| other.id == predecessor);
            let at = at.ok_or(FormationError::Predecessor { slot: id, predecessor })?;
            (Some(at), [0, 1].map(|axis| before[at].from_leader_m[axis] + offset_m[axis]))
        }
    };
    Ok(Slot { id, predecessor, offset_m, from_leader_m, member: 0 })
}

/// Lower ids must be nearer the front.
fn check_order(slots: &[Slot]) -> Result<(), FormationError> {
    let behind = |pair: &[Slot]| pair[1].from_leader_m[0] < pair[0].from_leader_m[0];
    match slots.windows(2).find(|pair| behind(pair)) {
        None => Ok(()),
        Some(pair) => Err(FormationError::Order {
            slot: pair[1].id,
            depth_m: pair[1].from_leader_m[0],
            ahead: pair[0].id,
            ahead_m: pair[0].from_leader_m[0],
        }),
    }
}

fn check_room(slots: &[Slot], radius_m: f64) -> Result<(), FormationError> {
    for (k, first) in slots.iter().enumerate() {
        for second in &slots[k + 1..] {
            let [dx, dy] = [0, 1].map(|axis| first.from_leader_m[axis] - second.from_leader_m[axis]);
            let distance_m = (dx * dx + dy * dy).sqrt();
            if distance_m < 2.0 * radius_m {
                return Err(FormationError::Crowded { first: first.id, second: second.id, distance_m, radius_m });
            }
        }
    }
    Ok(())
}
