use super::*;
use crate::cost::CostModel;
use crate::formation::parameters::Shape;
use crate::map::{Node, TravelMap};
use crate::route::{Method, RouteSettings};
use crate::testing::{ground, hills, limits, map_of, thesis_costs};
use crate::vertices::VertexSettings;

/// Hills per million cells and highest hill of the plain, rough and very rough maps.
const MAPS: [(&str, f64, u64); 3] = [("plain", 34.0, 3), ("rough", 42.0, 6), ("very rough", 145.0, 6)];
const SHAPES: [Shape; 3] = [Shape::Column, Shape::Line, Shape::Wedge];

/// A smoothed route over the roadmap without threshold, from corner to corner with a margin, m; `None` if no path exists.
fn route_over(map: &TravelMap, costs: &CostModel) -> Option<Vec<Vector>> {
    let [rows, cols] = map.shape();
    let vertices = VertexSettings { step_over_m: 1.0, ..VertexSettings::default() };
    let settings = RouteSettings { method: Method::Roadmap(vertices), ..RouteSettings::default() };
    let free = |row: usize, col: usize| {
        let near = (0..40).flat_map(|d| [(row + d, col), (row, col + d)]);
        near.into_iter().find(|(r, c)| !map.is_blocked(map.node(*r, *c)))
    };
    let (start, goal) = (free(40, 40)?, free(rows - 60, cols - 60)?);
    let route = crate::plan(&ground(map, costs), &settings, start.into(), goal.into()).ok()?;
    Some(route.smoothed.iter().map(|node| map.position_m(*node)).collect())
}

/// A run over hills, sampled at every step.
struct Run {
    outcome: Outcome,
    metrics: Metrics,
    time_s: f64,
    samples: Vec<Vec<Sample>>,
    motions: Vec<Vec<Motion>>,
    events: Vec<Event>,
}

fn run(map: &TravelMap, parameters: &TeamParameters, route_m: &[Vector]) -> Run {
    let costs = thesis_costs(map);
    let on = TeamGround::new(ground(map, &costs));
    let mut team = Team::new(&on, &TeamParameters { sample_rate_hz: 10.0, ..parameters.clone() }, route_m).unwrap();
    let (mut samples, mut motions) = (Vec::new(), Vec::new());
    let outcome = team.run(|team| {
        samples.push(team.samples());
        motions.push(team.motions().to_vec());
    });
    let outcome = outcome.unwrap();
    let (metrics, events) = (team.metrics().clone(), team.events().to_vec());
    Run { outcome, metrics, time_s: team.time_s(), samples, motions, events }
}

fn of(formation: Shape) -> TeamParameters {
    TeamParameters { formation, ..TeamParameters::default() }
}

/// Steepest slope of a step to the side, degrees. (Steps on straight lines to a target keep the limits over quarters of a cell.)
fn steepest_dodge_deg(map: &TravelMap, run: &Run) -> f64 {
    let steps = run.motions.iter().flatten().filter(|motion| motion.dodging);
    let slope_deg = |motion: &Motion| {
        let [from, to] = [sub(motion.position_m, motion.moved_m), motion.position_m];
        let [z0, z1] = [from, to].map(|at| map.height_at_m(map.point_at(at)).unwrap());
        libm::atan((z1 - z0).abs() / length(motion.moved_m)).to_degrees()
    };
    steps.map(slope_deg).fold(0.0, f64::max)
}

#[test]
fn val_a_team_on_level_ground_keeps_its_formation() {
    let map = map_of(120, 200, limits(30.0, 30.0), |_, _| 0.0);
    for shape in SHAPES {
        let run = run(&map, &of(shape), &[[50.0, 60.0], [150.0, 60.0]]);
        assert_eq!(run.outcome, Outcome::Arrived);
        assert!(run.metrics.mean_errors_m().iter().all(|error_m| *error_m < 0.01), "{:?}", run.metrics);
        assert_eq!(run.metrics.shares(), [1.0, 1.0]);
        assert!((run.time_s - 99.0).abs() < 1.0, "{}", run.time_s);
        let kinds: Vec<&EventKind> = run.events.iter().map(|event| &event.kind).collect();
        assert_eq!(kinds.first(), Some(&&EventKind::Start));
        assert_eq!(kinds.last(), Some(&&EventKind::End(Outcome::Arrived)));
        assert_eq!(kinds.iter().filter(|kind| ***kind == EventKind::Arrived).count(), 4);
    }
}

/// The thesis' table 5.5 has mean depth errors of 1.1 to 4.0 and width errors of 0.2 to 2.6 on its maps.
fn check_over_hills(name: &str, map: &TravelMap, shape: Shape) -> Option<[f64; 2]> {
    let route_m = route_over(map, &thesis_costs(map))?;
    let run = run(map, &of(shape), &route_m);
    assert_eq!(run.outcome, Outcome::Arrived, "{name} {}", shape.name());
    assert!(run.metrics.least_separation_m >= 1.0 - 1e-9, "{name}: {}", run.metrics.least_separation_m);
    let steepest_deg = steepest_dodge_deg(map, &run);
    assert!(steepest_deg <= 30.0 + 1e-6, "{name} {}: {steepest_deg}", shape.name());
    Some(run.metrics.mean_errors_m())
}

#[test]
fn val_teams_arrive_over_hills() {
    for (name, per_million, minor) in MAPS {
        for shape in SHAPES {
            let map = hills(400, per_million, minor, 1);
            let [depth_m, width_m] = check_over_hills(name, &map, shape).unwrap();
            assert!(depth_m <= 4.0 && width_m <= if name == "plain" { 2.0 } else { 4.0 });
        }
    }
}

#[test]
#[ignore = "slow: ./test --full"]
fn stat_teams_arrive_over_hills() {
    for (name, per_million, minor) in MAPS {
        for shape in SHAPES {
            let errors: Vec<[f64; 2]> = (1..=40)
                .filter_map(|seed| check_over_hills(name, &hills(500, per_million, minor, seed), shape))
                .collect();
            let mean = |axis: usize| errors.iter().map(|e| e[axis]).sum::<f64>() / errors.len() as f64;
            let largest = |axis: usize| errors.iter().map(|e| e[axis]).max_by(f64::total_cmp).unwrap();
            let [depth_m, width_m] = [mean(0), mean(1)];
            println!(
                "{name} {}: depth {depth_m:.2} (at most {:.2}), width {width_m:.2} (at most {:.2}) m, {} runs",
                shape.name(),
                largest(0),
                largest(1),
                errors.len()
            );
            assert!(depth_m <= 4.0 && width_m <= if name == "plain" { 2.0 } else { 4.0 });
        }
    }
}

/// Level ground with a wall that has a gap: the rows `gap` of column 100 and of the two columns next to it.
fn wall_with_gap(gap: std::ops::Range<usize>) -> TravelMap {
    let mut map = map_of(120, 260, limits(30.0, 30.0), |_, _| 0.0);
    let wall = (0..120).filter(|row| !gap.contains(row)).flat_map(|row| (99..102).map(move |col| (row, col)));
    wall.map(|(row, col)| map.node(row, col)).collect::<Vec<Node>>().into_iter().for_each(|node| map.block(node));
    map
}

#[test]
fn val_a_line_passes_a_gap_and_recovers() {
    // 12 m between the outer free rows: 0.4 of the line's 30 m.
    let map = wall_with_gap(54..67);
    let middle_m = map.position_m(map.node(60, 100));
    let route_m = [sub(middle_m, [60.0, 0.0]), add(middle_m, [120.0, 0.0])];
    let run = run(&map, &of(Shape::Line), &route_m);
    assert_eq!(run.outcome, Outcome::Arrived);
    assert!(run.metrics.least_separation_m >= 1.0 - 1e-9);
    // From 30 m behind the wall, every member is in its slot within the tolerance.
    let errors = run.samples.iter().flat_map(|members| {
        let all_behind = members.iter().all(|sample| sample.position_m[0] > middle_m[0] + 31.5);
        members.iter().filter(move |_| all_behind).filter_map(|sample| sample.errors_m)
    });
    let sizes_m: Vec<f64> = errors.flatten().map(f64::abs).collect();
    let worst_m = sizes_m.iter().copied().fold(0.0, f64::max);
    assert!(!sizes_m.is_empty() && worst_m <= 4.0, "{worst_m} of {}", sizes_m.len());
}

#[test]
fn val_a_loss_is_filled_and_recovered() {
    let map = map_of(120, 300, limits(30.0, 30.0), |_, _| 0.0);
    for (lost, holders) in [(2, [1, 3, 4]), (1, [2, 3, 4]), (4, [1, 2, 3])] {
        let losses = vec![Loss { time_s: 20.0, member: lost }];
        let run = run(&map, &TeamParameters { losses, ..of(Shape::Column) }, &[[50.0, 60.0], [280.0, 60.0]]);
        assert_eq!(run.outcome, Outcome::Arrived);
        assert!(run.metrics.least_separation_m >= 1.0 - 1e-9);
        let last = run.samples.last().unwrap();
        assert_eq!(last[lost as usize - 1].phase, Phase::Lost);
        assert_eq!(holders.map(|member: usize| last[member - 1].slot), [Some(1), Some(2), Some(3)]);
        let errors_m: Vec<f64> = last.iter().filter_map(|sample| sample.errors_m).flatten().collect();
        assert!(!errors_m.is_empty() && errors_m.iter().all(|error_m| error_m.abs() <= 4.0), "{last:?}");
        let lost_at = run.events.iter().position(|event| event.kind == EventKind::Lost).unwrap();
        assert!((run.events[lost_at].time_s - 20.0).abs() < 0.11);
        let rearranged = run.events.iter().filter(|event| matches!(event.kind, EventKind::Rearranged { .. })).count();
        assert_eq!(rearranged, 4 - lost as usize);
    }
}

#[test]
fn val_the_last_member_cannot_be_lost() {
    let map = map_of(60, 120, limits(30.0, 30.0), |_, _| 0.0);
    let parameters = TeamParameters { members: Some(1), ..of(Shape::Column) };
    assert_eq!(run(&map, &parameters, &[[20.0, 30.0], [100.0, 30.0]]).outcome, Outcome::Arrived);
    let lost = TeamParameters { losses: vec![Loss { time_s: 5.0, member: 1 }], ..parameters };
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let refused = Team::new(&on, &lost, &[[20.0, 30.0], [100.0, 30.0]]).unwrap_err();
    assert!(refused.to_string().contains("no member would be left"), "{refused}");
}

#[test]
fn val_a_team_without_room_or_route_is_refused() {
    let map = crate::testing::drawn(&["######", "#..###", "######"]);
    let costs = thesis_costs(&map);
    let on = TeamGround::new(ground(&map, &costs));
    let [a, b] = [1, 2].map(|col| map.position_m(map.node(1, col)));
    let error = Team::new(&on, &of(Shape::Column), &[a, b]).unwrap_err();
    assert!(matches!(error, TeamError::NoRoom { member: 3, .. }), "{error}");
    assert_eq!(Team::new(&on, &of(Shape::Column), &[a, a]).unwrap_err(), TeamError::Route);
}

#[test]
fn val_time_limits_hold() {
    let map = map_of(60, 120, limits(30.0, 30.0), |_, _| 0.0);
    let parameters = TeamParameters { time_max_s: Some(10.0), ..of(Shape::Column) };
    let run = run(&map, &parameters, &[[40.0, 30.0], [100.0, 30.0]]);
    assert_eq!(run.outcome, Outcome::Timeout);
    assert!((run.time_s - 10.0).abs() < 0.11);
}

#[test]
fn prop_a_run_repeats_bit_for_bit() {
    let map = hills(300, 145.0, 6, 3);
    let route_m = route_over(&map, &thesis_costs(&map)).unwrap();
    let parameters = TeamParameters { losses: vec![Loss { time_s: 60.0, member: 1 }], ..of(Shape::Wedge) };
    let bits = |run: &Run| {
        let values = run.samples.iter().flatten().flat_map(|s| [s.position_m, s.heading, s.velocity_m_s].concat());
        values.map(f64::to_bits).collect::<Vec<_>>()
    };
    let [one, two] = [0; 2].map(|_| run(&map, &parameters, &route_m));
    assert_eq!(bits(&one), bits(&two));
    assert_eq!(one.events, two.events);
}

#[test]
fn val_routes_are_divided_into_equal_legs() {
    let route_m = [[0.0, 0.0], [40.0, 0.0], [40.0, 0.0], [40.0, 5.0]];
    let expected = vec![[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [30.0, 0.0], [40.0, 0.0], [40.0, 5.0]];
    assert_eq!(divided(&route_m, 10.0), Ok(expected));
    assert_eq!(divided(&route_m, f64::INFINITY), Ok(vec![[0.0, 0.0], [40.0, 0.0], [40.0, 5.0]]));
    // Legs of at most 12 m, of equal length.
    assert_eq!(divided(&route_m[..2], 12.0).map(|points_m| points_m.len()), Ok(5));
    assert_eq!(divided(&[[1.0, 1.0]; 3], 10.0), Err(TeamError::Route));
}
