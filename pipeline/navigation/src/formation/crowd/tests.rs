use super::*;
use crate::formation::footing::TeamGround;
use crate::map::TravelMap;
use crate::testing::{drawn, ground, limits, map_of, thesis_costs};

const SETTINGS: CrowdSettings =
    CrowdSettings { step_s: 0.1, radius_m: 0.5, arrive_m: 1.0, look_ahead: 3, detours: true };

fn level(side: usize) -> TravelMap {
    map_of(side, side, limits(30.0, 30.0), |_, _| 0.0)
}

/// Result of a run with one target per member.
struct End {
    stuck: Option<usize>,
    arrived: usize,
    steps: u64,
    least_m: f64,
    contacts: usize,
    motions: Vec<Motion>,
}

fn run_with(map: &TravelMap, settings: CrowdSettings, ends: &[[Vector; 2]], obstacles: Vec<MovingObstacle>) -> End {
    let costs = thesis_costs(map);
    let on = TeamGround::new(ground(map, &costs));
    let points: Vec<Vector> = ends.iter().flatten().copied().collect();
    let starts_m: Vec<Vector> = ends.iter().map(|[start, _]| *start).collect();
    let targets_m = ends.iter().map(|[_, goal]| vec![*goal]).collect();
    let mut crowd = Crowd::new(Footing::new(&on, &points), settings, &starts_m, targets_m, 1.0, obstacles);
    let order: Vec<usize> = (0..ends.len()).collect();
    let (mut least_m, mut contacts) = (f64::INFINITY, 0);
    for _ in 0..100_000 {
        let stuck = crowd.step(&order);
        least_m = least_m.min(crowd.least_separation_m());
        contacts += crowd.touched();
        let arrived = crowd.motions().iter().filter(|motion| motion.phase == Phase::Arrived).count();
        if stuck.is_some() || arrived == ends.len() {
            return End { stuck, arrived, steps: crowd.step, least_m, contacts, motions: crowd.motions().to_vec() };
        }
    }
    panic!("neither arrived nor stuck");
}

fn run(map: &TravelMap, ends: &[[Vector; 2]]) -> End {
    run_with(map, SETTINGS, ends, Vec::new())
}

#[test]
fn val_a_member_alone_goes_straight() {
    let end = run(&level(60), &[[[10.5, 30.5], [40.5, 30.5]]]);
    // 30 m less the metre within which it has arrived, at 0.1 m per step.
    assert!((290..=291).contains(&end.steps), "{}", end.steps);
    assert!((end.motions[0].position_m[1] - 30.5).abs() < 1e-9);
}

#[test]
fn val_members_head_on_pass_each_other() {
    let map = level(60);
    for aside_m in [0.0, 0.3, 0.7] {
        let end = run(&map, &[[[10.5, 30.5], [40.5, 30.5]], [[40.5, 30.5 + aside_m], [10.5, 30.5 + aside_m]]]);
        assert_eq!((end.stuck, end.arrived), (None, 2), "{aside_m} m aside");
        assert!(end.least_m >= 1.0 - 1e-9);
    }
}

/// Two lines of members that exchange positions, each the mirror image of the other.
#[test]
fn val_mirrored_teams_exchange_positions() {
    let line = |k: usize| 20.5 + 3.0 * k as f64;
    for members in 1..=5 {
        let east = (0..members).map(|k| [[10.5, line(k)], [45.5, line(k)]]);
        let west = (0..members).map(|k| [[45.5, line(k)], [10.5, line(k)]]);
        let end = run(&level(60), &east.chain(west).collect::<Vec<_>>());
        assert_eq!((end.stuck, end.arrived), (None, 2 * members), "{members} a side");
        assert!(end.least_m >= 1.0 - 1e-9, "{}", end.least_m);
    }
}

/// Members on a ring, each with its target on the opposite side, so that they all meet in the middle.
#[test]
fn val_rings_of_members_arrive() {
    let map = level(80);
    for members in 2..=16 {
        let at = |k: usize| {
            let turn = std::f64::consts::TAU * k as f64 / members as f64;
            [40.0 + 15.0 * libm::cos(turn), 40.0 + 15.0 * libm::sin(turn)]
        };
        let ends: Vec<_> = (0..members).map(|k| [at(k), sub([80.0, 80.0], at(k))]).collect();
        let end = run(&map, &ends);
        assert!(end.least_m >= 1.0 - 1e-9, "{members}: {}", end.least_m);
        assert_eq!((end.stuck, end.arrived), (None, members));
    }
}

#[test]
fn val_two_members_cannot_pass_in_a_passage_of_one_cell() {
    // Head-on in a passage without a place to pass: stuck, and reported as such.
    let map = drawn(&["##########", "..........", "##########"]);
    let [a, b] = [0, 9].map(|col| map.position_m(map.node(1, col)));
    let end = run(&map, &[[a, b], [b, a]]);
    assert!(end.stuck.is_some());
    assert!(end.least_m >= 1.0 - 1e-9);
    assert!(end.steps < 2000);
}

#[test]
fn val_without_detours_a_dead_end_is_a_repeated_state() {
    // A pocket that opens away from the goal: the directions of Algorithm 7 make no progress, a detour does.
    let map = drawn(&[
        "............",
        "..#######...",
        "........#...",
        "........#...",
        "........#...",
        "..#######...",
        "............",
    ]);
    let ends = [[map.position_m(map.node(3, 4)), map.position_m(map.node(3, 11))]];
    let literal = run_with(&map, CrowdSettings { detours: false, ..SETTINGS }, &ends, Vec::new());
    assert_eq!(literal.stuck, Some(0));
    assert!(literal.steps as f64 * SETTINGS.step_s < STUCK_AFTER_S + 20.0, "{}", literal.steps);
    assert_eq!(run(&map, &ends).arrived, 1);
}

#[test]
fn val_a_closed_room_is_stuck() {
    let map = drawn(&["#####...", "#...#...", "#...#...", "#####..."]);
    let end = run(&map, &[[map.position_m(map.node(1, 1)), map.position_m(map.node(2, 7))]]);
    assert_eq!(end.stuck, Some(0));
}

#[test]
fn val_moving_obstacles_are_dodged() {
    let map = level(60);
    let obstacle = |points_m: [Vector; 2], speed_m_s: f64| MovingObstacle {
        points_m: points_m.into(),
        speed_m_s,
        radius_m: 1.0,
        start_s: 0.0,
    };
    let ends = [[[10.5, 30.5], [40.5, 30.5]]];
    // Head-on, from behind, and across.
    for points_m in [[[40.5, 30.5], [5.5, 30.5]], [[7.5, 30.5], [50.5, 30.5]], [[25.5, 15.5], [25.5, 45.5]]] {
        for speed_m_s in [0.3, 0.9] {
            let end = run_with(&map, SETTINGS, &ends, vec![obstacle(points_m, speed_m_s)]);
            assert_eq!((end.arrived, end.contacts), (1, 0), "{points_m:?} at {speed_m_s} m/s");
        }
    }
    // A stationary obstacle is passed.
    let end = run_with(&map, SETTINGS, &ends, vec![obstacle([[25.5, 30.5]; 2], 1.0)]);
    assert_eq!((end.arrived, end.contacts), (1, 0));
}

#[test]
fn val_lost_members_are_passed() {
    let map = level(60);
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let starts_m = [[25.5, 30.5], [10.5, 30.5]];
    let targets_m = vec![vec![[26.5, 30.5]], vec![[40.5, 30.5]]];
    let mut crowd = Crowd::new(Footing::new(&on, &starts_m), SETTINGS, &starts_m, targets_m, 1.0, Vec::new());
    crowd.lose(0);
    let stuck = (0..1000).find_map(|_| crowd.step(&[0, 1]));
    assert_eq!((stuck, crowd.motions()[1].phase), (None, Phase::Arrived));
    assert_eq!(crowd.motions()[0].position_m, starts_m[0]);
}

/// The closest approach of two straight moves against many intermediate points.
#[test]
fn prop_closest_approach_is_the_least_distance() {
    let mut random = crate::testing::Random(3);
    for _ in 0..1000 {
        let mut draw = || [4.0 * random.unit() - 2.0, 4.0 * random.unit() - 2.0];
        let (offset, motion) = (draw(), draw());
        let sampled = (0..=1000).map(|k| length(add(offset, scale(motion, f64::from(k) / 1000.0))));
        let least = sampled.fold(f64::INFINITY, f64::min);
        let exact = closest_approach(offset, motion);
        assert!(exact <= least + 1e-12 && least - exact < 5e-3, "{exact} {least}");
    }
}

#[test]
fn val_discs_touch_if_they_approach_closer_than_their_radii() {
    for (offset_m, motion_m, expected) in [
        ([2.0, 0.0], [-1.5, 0.0], true),
        ([2.0, 0.0], [-0.5, 0.0], false),
        // Passing exactly at the least distance, and a little closer.
        ([2.0, 1.0], [-4.0, 0.0], false),
        ([2.0, 0.99], [-4.0, 0.0], true),
        // Closer already: leaving is allowed, coming closer still is not.
        ([0.5, 0.0], [1.0, 0.0], false),
        ([0.5, 0.0], [-0.2, 0.0], true),
    ] {
        assert_eq!(touches(offset_m, motion_m, 1.0), expected, "{offset_m:?} by {motion_m:?}");
    }
}
