use super::*;
use crate::formation::metrics::Metrics;
use crate::formation::parameters::Shape;
use crate::formation::team::{EventKind, Team};
use crate::formation::{Outcome, TeamParameters};
use crate::testing::{ground, hills, limits, map_of, thesis_costs};
use crate::{Method, RouteSettings};

/// Sees all of every map here.
const ALL_M: f64 = 1e4;

fn seeing(sensing_radius_m: Option<f64>) -> TeamParameters {
    TeamParameters { formation: Shape::Wedge, spacing_m: 4.0, sensing_radius_m, ..TeamParameters::default() }
}

struct Run {
    outcome: Outcome,
    metrics: Metrics,
    events: Vec<EventKind>,
    /// Positions of the leader, with the route that it followed from there.
    ways: Vec<Vec<Vector>>,
    /// Distance driven by the leader, m.
    driven_m: f64,
}

fn run(map: &TravelMap, parameters: &TeamParameters, route_m: &[Vector]) -> Run {
    let costs = thesis_costs(map);
    let on = TeamGround::new(ground(map, &costs));
    let mut team = Team::new(&on, parameters, route_m).unwrap();
    let outcome = team.run(|_| ()).unwrap();
    Run {
        outcome,
        metrics: team.metrics().clone(),
        events: team.events().iter().map(|event| event.kind.clone()).collect(),
        ways: team.routes().iter().map(|route| route.points_m.clone()).collect(),
        driven_m: team.metrics().driven_m[0],
    }
}

/// Level ground with a pocket that opens to the west, between start and goal.
fn pocket() -> (TravelMap, [Vector; 2]) {
    let mut map = map_of(120, 160, limits(30.0, 30.0), |_, _| 0.0);
    let sides = (60..100).flat_map(|col| [(30, col), (90, col)]);
    let end = (30..=90).map(|row| (row, 100));
    let walls: Vec<Node> = sides.chain(end).map(|(row, col)| map.node(row, col)).collect();
    walls.into_iter().for_each(|node| map.block(node));
    let ends = [[60, 20], [60, 140]].map(|[row, col]| map.position_m(map.node(row, col)));
    (map, ends)
}

#[test]
fn val_a_team_enters_a_dead_end_that_it_does_not_see() {
    let (map, ends_m) = pocket();
    let sees_all = run(&map, &seeing(Some(ALL_M)), &ends_m);
    assert_eq!((sees_all.outcome, sees_all.metrics.replans, sees_all.ways.len()), (Outcome::Arrived, 0, 1));
    for radius_m in [7.0, 15.0, 30.0] {
        let blind = run(&map, &seeing(Some(radius_m)), &ends_m);
        assert_eq!(blind.outcome, Outcome::Arrived, "{radius_m}");
        assert!(
            blind.metrics.replans > 0 && blind.driven_m > 1.2 * sees_all.driven_m,
            "{radius_m}: {}",
            blind.driven_m
        );
        let told = blind.events.iter().filter(|kind| **kind == EventKind::Replanned).count();
        assert_eq!(told as u64, blind.metrics.replans);
        assert_eq!(blind.events.iter().filter(|kind| **kind == EventKind::Arrived).count(), 4);
    }
}

#[test]
fn prop_a_team_is_led_over_seen_ground() {
    let (map, ends_m) = pocket();
    for radius_m in [7.0, 15.0, 30.0] {
        let blind = run(&map, &seeing(Some(radius_m)), &ends_m);
        for way_m in &blind.ways {
            // The leader is less than a diagonal away from the node that it looks from.
            assert!(way_m.iter().all(|point_m| distance(way_m[0], *point_m) < radius_m));
            assert!(way_m.windows(2).all(|pair| map.is_free_along(map.point_at(pair[0]), map.point_at(pair[1]))));
        }
        assert!(distance(*blind.ways.last().unwrap().last().unwrap(), ends_m[1]) < 1e-9);
    }
}

#[test]
fn val_a_team_without_a_path_is_stuck() {
    let (mut map, ends_m) = pocket();
    let wall: Vec<Node> = (0..120).map(|row| map.node(row, 110)).collect();
    wall.into_iter().for_each(|node| map.block(node));
    assert_eq!(run(&map, &seeing(Some(15.0)), &ends_m).outcome, Outcome::Stuck { member: 1 });
    assert_eq!(run(&map, &seeing(Some(ALL_M)), &ends_m).outcome, Outcome::Stuck { member: 1 });
}

#[test]
fn val_a_team_continues_when_its_leader_is_lost() {
    let (map, ends_m) = pocket();
    let losses = vec![crate::formation::parameters::Loss { time_s: 40.0, member: 1 }];
    let run = run(&map, &TeamParameters { losses, ..seeing(Some(15.0)) }, &ends_m);
    assert_eq!(run.outcome, Outcome::Arrived);
}

#[test]
fn val_a_radius_too_small_for_the_cells_is_refused() {
    let (map, ends_m) = pocket();
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let refused = |radius_m| Team::new(&on, &seeing(Some(radius_m)), &ends_m).unwrap_err().to_string();
    assert!(
        refused(6.5).contains("`sensing_radius_m` is 6.5 m; on this terrain it must be at least 6.657 m"),
        "{}",
        refused(6.5)
    );
    assert!(refused(-1.0).contains("sensing_radius_m"));
}

/// Runs between the corners of maps of hills: radius, numbers of arrivals and runs, cost of the path driven relative to the grid's smoothed route.
fn over_hills(size: usize, seeds: std::ops::RangeInclusive<u64>, radii_m: &[f64]) -> Vec<(f64, usize, usize, f64)> {
    let mut sums: Vec<(f64, usize, usize, f64)> = radii_m.iter().map(|radius_m| (*radius_m, 0, 0, 0.0)).collect();
    for (seed, per_million) in seeds.flat_map(|seed| [(seed, 42.0), (seed, 145.0)]) {
        let map = hills(size, per_million, 6, seed);
        let costs = thesis_costs(&map);
        let last = size - 60;
        let settings = RouteSettings {
            method: Method::GridAstar,
            neighbourhood: Neighbourhood::Eight,
            ..RouteSettings::default()
        };
        let ground = ground(&map, &costs);
        let Ok(route) = crate::plan(&ground, &settings, [40, 40], [last, last]) else { continue };
        let ends_m = [[40, 40], [last, last]].map(|[row, col]| map.position_m(map.node(row, col)));
        let on = TeamGround::new(ground);
        for sum in &mut sums {
            let Ok(mut team) = Team::new(&on, &seeing(Some(sum.0)), &ends_m) else { continue };
            let mut places_m = Vec::new();
            let outcome = team.run(|team| places_m.push(team.motions()[0].position_m)).unwrap();
            sum.1 += 1;
            if outcome == Outcome::Arrived {
                sum.2 += 1;
                sum.3 += driven(&ground, &places_m) / route.smoothed_score.cost;
            } else {
                println!("seed {seed}, {per_million} hills, {} m: {outcome:?}", sum.0);
            }
        }
    }
    sums
}

/// Cost of a path from position to position.
fn driven(ground: &crate::Ground<'_>, places_m: &[Vector]) -> f64 {
    let cost = |pair: &[Vector]| {
        let [a, b] = [pair[0], pair[1]].map(|place_m| ground.map.point_at(place_m));
        let [z0, z1] = [a, b].map(|point| ground.map.height_at_m(point).unwrap());
        ground.costs.piece(distance(pair[0], pair[1]), z1 - z0)
    };
    places_m.windows(2).filter(|pair| pair[0] != pair[1]).map(cost).sum()
}

#[test]
fn val_teams_that_see_little_arrive_over_hills() {
    for (radius_m, runs, arrived, cost) in over_hills(250, 1..=3, &[10.0, 40.0, ALL_M]) {
        let ratio = cost / arrived as f64;
        println!("{radius_m} m: {arrived} of {runs} arrive, cost {ratio:.3}");
        assert!(runs >= 4 && arrived == runs && (0.9..1.3).contains(&ratio), "{radius_m}: {arrived}/{runs}, {ratio}");
    }
}

#[test]
#[ignore = "slow: ./test --full"]
fn stat_teams_that_see_little_arrive_over_many_hills() {
    for (radius_m, runs, arrived, cost) in over_hills(400, 1..=60, &[7.0, 20.0, 80.0, ALL_M]) {
        let ratio = cost / arrived as f64;
        println!("{radius_m} m: {arrived} of {runs} arrive, cost {ratio:.3}");
        assert!(arrived * 100 >= runs * 95 && (0.9..1.3).contains(&ratio), "{radius_m}: {arrived}/{runs}, {ratio}");
    }
}
