use super::*;
use proptest::prelude::*;

fn slot(id: u32, predecessor: u32, depth_m: f64, width_m: f64) -> SlotParameters {
    SlotParameters { id, predecessor: (predecessor > 0).then_some(predecessor), depth_m, width_m, team: Vec::new() }
}

fn of(pattern: Pattern, members: u32) -> Formation {
    Formation::new(&pattern.slots(members, 10.0), 0.5).unwrap()
}

fn from_leader(formation: &Formation) -> Vec<[f64; 2]> {
    formation.slots().iter().map(|slot| slot.from_leader_m).collect()
}

/// Slots by id with their members.
fn holders(formation: &Formation) -> Vec<(u32, u32)> {
    formation.slots().iter().map(|slot| (slot.id, slot.member)).collect()
}

#[test]
fn val_patterns_of_four_are_those_of_the_thesis() {
    assert_eq!(from_leader(&of(Pattern::Column, 4)), [[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [30.0, 0.0]]);
    assert_eq!(from_leader(&of(Pattern::Line, 4)), [[0.0, 0.0], [0.0, -10.0], [0.0, 10.0], [0.0, -20.0]]);
    assert_eq!(from_leader(&of(Pattern::Wedge, 4)), [[0.0, 0.0], [10.0, -10.0], [10.0, 10.0], [20.0, -20.0]]);
    assert_eq!(of(Pattern::Line, 4).extent_m(), [-20.0, 10.0, 0.0]);
}

#[test]
fn val_rearrangements_are_those_of_the_thesis() {
    // Column: figure 4.8, then the first and the last member.
    for (lost, expected) in
        [(2, [(1, 1), (2, 3), (3, 4)]), (1, [(1, 2), (2, 3), (3, 4)]), (4, [(1, 1), (2, 2), (3, 3)])]
    {
        let mut column = of(Pattern::Column, 4);
        column.lose(lost).unwrap();
        assert_eq!(holders(&column), expected);
    }
    let mut wedge = of(Pattern::Wedge, 4);
    assert_eq!(wedge.lose(1).unwrap(), [(2, 1), (4, 2)]);
    assert_eq!(holders(&wedge), [(1, 2), (2, 4), (3, 3)]);
    let mut wedge = of(Pattern::Wedge, 4);
    assert_eq!(wedge.lose(3).unwrap(), []);
    assert_eq!(holders(&wedge), [(1, 1), (2, 2), (4, 4)]);
    assert_eq!(wedge.slots()[2].predecessor, Some(1));
}

#[test]
fn val_impossible_losses_are_refused() {
    let mut pair = of(Pattern::Column, 2);
    assert_eq!(pair.lose(3), Err(FormationError::NotThere(3)));
    pair.lose(1).unwrap();
    assert_eq!(pair.lose(1), Err(FormationError::NotThere(1)));
    assert_eq!(pair.lose(2), Err(FormationError::TeamLost));
}

#[test]
fn val_nested_teams_are_flattened() {
    // A column of two whose second slot holds a column of three; the first member of that column occupies the slot.
    let inner = vec![slot(1, 0, 0.0, 0.0), slot(2, 1, 2.0, 0.0), slot(3, 2, 2.0, 1.0)];
    let outer = [slot(1, 0, 0.0, 0.0), SlotParameters { team: inner, ..slot(2, 1, 10.0, 5.0) }, slot(3, 1, 20.0, 0.0)];
    let formation = Formation::new(&outer, 0.5).unwrap();
    let slots: Vec<_> = formation.slots().iter().map(|s| (s.id, s.predecessor, s.from_leader_m)).collect();
    assert_eq!(
        slots,
        [
            (1, None, [0.0, 0.0]),
            (2, Some(0), [10.0, 5.0]),
            (3, Some(0), [20.0, 0.0]),
            (4, Some(1), [12.0, 5.0]),
            (5, Some(3), [14.0, 6.0])
        ]
    );
    // The loss of the inner leader moves its own team up.
    let mut formation = formation;
    assert_eq!(formation.lose(2).unwrap(), [(4, 2), (5, 4)]);
}

#[test]
fn val_wrong_formations_are_refused() {
    let refused = |slots: &[SlotParameters]| Formation::new(slots, 0.5).unwrap_err();
    assert_eq!(refused(&[]), FormationError::Leaderless);
    assert_eq!(refused(&[slot(2, 1, 10.0, 0.0)]), FormationError::Predecessor { slot: 2, predecessor: 1 });
    assert_eq!(refused(&[slot(0, 0, 0.0, 0.0)]), FormationError::Leaderless);
    assert_eq!(refused(&[slot(1, 2, 0.0, 0.0)]), FormationError::Led(2));
    let leader = slot(1, 0, 0.0, 0.0);
    let with = |more: SlotParameters| refused(&[leader.clone(), more]);
    assert_eq!(with(slot(1, 0, 0.0, 0.0)), FormationError::Duplicate(1));
    assert_eq!(with(slot(2, 0, 10.0, 0.0)), FormationError::Unled(2));
    assert_eq!(with(slot(2, 3, 10.0, 0.0)), FormationError::Predecessor { slot: 2, predecessor: 3 });
    assert_eq!(with(slot(2, 2, 10.0, 0.0)), FormationError::Predecessor { slot: 2, predecessor: 2 });
    assert_eq!(with(slot(2, 1, f64::NAN, 0.0)), FormationError::Offset(2));
    let ahead = FormationError::Order { slot: 2, depth_m: -1.0, ahead: 1, ahead_m: 0.0 };
    assert_eq!(with(slot(2, 1, -1.0, 5.0)), ahead);
    let crowded = FormationError::Crowded { first: 1, second: 2, distance_m: 0.5, radius_m: 0.5 };
    assert_eq!(with(slot(2, 1, 0.5, 0.0)), crowded);
    assert!(crowded.to_string().contains("need at least 1 m"), "{crowded}");
    assert_eq!(refused(&Pattern::Column.slots(1001, 10.0)), FormationError::Size(1001));
}

proptest! {
    /// Whoever is lost: only the lost member leaves, no slot is occupied twice, and the first slot remains.
    #[test]
    fn prop_a_loss_loses_one(members in 2u32..20, pattern in 0usize..3, lost in 1u32..20) {
        let mut formation = of(Pattern::ALL[pattern], members);
        let lost = (lost - 1) % members + 1;
        formation.lose(lost).unwrap();
        let mut left: Vec<u32> = formation.slots().iter().map(|slot| slot.member).collect();
        left.sort_unstable();
        prop_assert_eq!(left, (1..=members).filter(|member| *member != lost).collect::<Vec<_>>());
        prop_assert_eq!(formation.slots()[0].id, 1);
        for (k, slot) in formation.slots().iter().enumerate().skip(1) {
            prop_assert!(slot.predecessor.is_some_and(|p| p < k));
        }
    }
}
