use super::*;
use crate::search::dijkstra;
use crate::testing::{NEIGHBOURHOODS, Random, drawn, ends, limits, map_of, oblong_map_of, rough, thesis_costs};

fn settings(sensing_radius_m: f64, neighbourhood: Neighbourhood) -> WalkSettings {
    WalkSettings { sensing_radius_m, slope: SlopeCost::THESIS, neighbourhood }
}

#[test]
fn prop_walks_arrive_if_a_path_exists_and_cost_no_less_than_with_full_knowledge() {
    let mut random = Random(70);
    let (mut arrived, mut detours) = (0, 0);
    for k in 0..80 {
        // Slopes that are allowed in both directions, so that no step is a trap.
        let heights: Vec<f64> = (0..20 * 20).map(|_| 0.5 * random.unit()).collect();
        let mut map = map_of(20, 20, limits(30.0, 30.0), |r, c| heights[20 * r + c]);
        (0..400).filter(|_| random.unit() < 0.25).for_each(|node| map.block(node));
        let Some(nodes) = ends(&map, &mut random) else { continue };
        let [start, goal] = nodes.map(|node| map.place(node));
        let [near, far] = [2.0 + (k % 3) as f64, 100.0]
            .map(|radius_m| walk(&map, &settings(radius_m, NEIGHBOURHOODS[k % 2]), start, goal));
        assert_eq!(near.is_ok(), far.is_ok());
        let (Ok(near), Ok(far)) = (near, far) else { continue };
        arrived += 1;
        detours += usize::from(near.cost > near.informed_cost * (1.0 + 1e-9));
        assert_eq!((near.path.first(), near.path.last()), (Some(&nodes[0]), Some(&nodes[1])));
        assert!(near.cost >= near.informed_cost * (1.0 - 1e-12));
        assert!((far.cost / far.informed_cost - 1.0).abs() < 1e-12 && far.replans == 0, "all is seen at once");
        for pair in near.path.windows(2) {
            assert!(Direction::ALL.iter().any(|d| map.accessible(pair[0], *d) == Some(pair[1])));
        }
    }
    assert!(arrived > 40 && detours > 10, "{arrived} {detours}");
}

#[test]
fn val_a_dead_end_is_walked_into_and_left_again() {
    let map =
        drawn(&["..........", ".######...", ".......#..", "S......#.G", ".......#..", ".######...", ".........."]);
    let blind = walk(&map, &settings(1.5, Neighbourhood::Four), [3, 0], [3, 9]).unwrap();
    assert_eq!(blind.informed_cost, 15.0);
    assert_eq!(blind.cost, blind.travelled.cost);
    assert!(blind.cost >= 15.0 + 2.0 * 5.0, "into the pocket and back: {}", blind.cost);
    assert!(blind.replans > 3);
    let sees_all = walk(&map, &settings(20.0, Neighbourhood::Four), [3, 0], [3, 9]).unwrap();
    assert_eq!((sees_all.cost, sees_all.replans), (15.0, 0));
}

#[test]
fn prop_every_plan_costs_as_much_as_a_fresh_search_over_the_known_cells() {
    let mut random = Random(71);
    let mut plans = 0;
    for k in 0..10 {
        let map = rough(18, 18, 0.2, 0.5, &mut random);
        let Some(ends) = ends(&map, &mut random) else { continue };
        let costs = CostModel::new(SlopeCost::THESIS, None, &map).unwrap();
        let ground = Ground { map: &map, costs: &costs, clearance: None };
        let grid = GridNetwork { ground, neighbourhood: NEIGHBOURHOODS[k % 2] };
        let mut walker = Walker::new(grid, 2.5, ends);
        while walker.at != walker.goal {
            let found = walker.search.search(&walker.known);
            let fresh = dijkstra::costs_to(&walker.known, walker.goal)[walker.at as usize];
            let Some(found) = found else {
                assert!(fresh.is_infinite());
                break;
            };
            assert_eq!(found.cost.to_bits(), fresh.to_bits());
            plans += 1;
            walker.at = found.path[1];
            let changed = walker.known.sense(walker.at);
            walker.search.move_to(&walker.known, walker.at);
            walker.search.changed(&walker.known, changed);
        }
    }
    assert!(plans > 20, "{plans}");
}

#[test]
fn val_impossible_walks_are_refused() {
    let map = drawn(&[".#.", ".#.", ".#."]);
    let message =
        |radius_m, goal| walk(&map, &settings(radius_m, Neighbourhood::Four), [0, 0], goal).unwrap_err().to_string();
    assert!(message(1.0, [2, 0]).contains("`sensing_radius_m` is 1 m; it must be at least the diagonal of a cell"));
    assert!(message(f64::NAN, [2, 0]).contains("NaN"));
    assert!(message(2.0, [2, 2]).contains("none exists with four neighbours"));
    assert!(message(2.0, [2, 1]).contains("blocked"));
}

#[test]
fn prop_exactly_the_cells_within_the_radius_are_seen() {
    let mut random = Random(72);
    for radius_m in [1.5, 2.0, 4.7, 11.0, 1e9] {
        let map = rough(19, 23, 0.2, 0.5, &mut random);
        let costs = CostModel::new(SlopeCost::THESIS, None, &map).unwrap();
        let ground = Ground { map: &map, costs: &costs, clearance: None };
        let mut places = vec![random.below(19 * 23) as Node];
        let mut known = Known::new(GridNetwork { ground, neighbourhood: Neighbourhood::Eight }, radius_m, places[0]);
        for _ in 0..12 {
            let before = known.seen.clone();
            places.push(random.below(19 * 23) as Node);
            let changed = known.sense(places[places.len() - 1]);
            let within = |node: &Node, place: &Node| {
                let ([r, c], [row, col]) = (map.place(*node), map.place(*place));
                let [down, across] = [r.abs_diff(row) as f64, c.abs_diff(col) as f64];
                down * down + across * across <= radius_m * radius_m
            };
            for node in 0..map.len() as Node {
                assert_eq!(known.seen[node as usize], places.iter().any(|place| within(&node, place)));
                let newly = known.seen[node as usize] && !before[node as usize];
                assert!(!newly || map.around(node).all(|near| changed.binary_search(&near).is_ok()));
            }
        }
    }
}

/// Within 6 m over cells of 3 m x 4 m: two columns to each side in the same row, one in the adjacent rows.
#[test]
fn val_the_radius_over_oblong_cells_is_in_metres() {
    let map = oblong_map_of(7, 7, limits(30.0, 30.0), |_, _| 0.0);
    let costs = thesis_costs(&map);
    let ground = Ground { map: &map, costs: &costs, clearance: None };
    let known = Known::new(GridNetwork { ground, neighbourhood: Neighbourhood::Eight }, 6.0, map.node(3, 3));
    let seen: Vec<[usize; 2]> =
        (0..map.len() as Node).filter(|node| known.seen[*node as usize]).map(|node| map.place(node)).collect();
    let expected = [[2, 2], [2, 3], [2, 4], [3, 1], [3, 2], [3, 3], [3, 4], [3, 5], [4, 2], [4, 3], [4, 4]];
    assert_eq!(seen, expected);
}

/// The least radius that is allowed is the diagonal of a cell, here 5 m.
#[test]
fn val_the_least_radius_is_the_diagonal_of_a_cell() {
    let map = oblong_map_of(3, 5, limits(30.0, 30.0), |_, _| 0.0);
    let walked = |radius_m| walk(&map, &settings(radius_m, Neighbourhood::Four), [0, 0], [0, 4]);
    assert_eq!(walked(5.0).unwrap().cost, 12.0);
    assert!(walked(4.999).unwrap_err().to_string().contains("the diagonal of a cell, 5 m"));
}

/// Steps to four neighbours unless the settings say otherwise; unknown keys are refused.
#[test]
fn val_settings_of_a_walk_keep_their_names_and_default() {
    let read = |text: &str| serde_json::from_str::<WalkSettings>(text);
    let text = r#"{"sensing_radius_m":5.0,"slope":{"kind":"linear","up":1.0,"down":1.0}}"#;
    assert_eq!(read(text).unwrap(), settings(5.0, Neighbourhood::Four));
    let text = r#"{"sensing_radius_m":5.0,"slope":{"kind":"linear","up":1.0,"down":1.0},"neighbourhood":"eight"}"#;
    assert_eq!(read(text).unwrap(), settings(5.0, Neighbourhood::Eight));
    assert!(read(r#"{"sensing_radius_m":5.0,"slope":{"kind":"linear","up":1.0,"down":1.0},"radius":1}"#).is_err());
}
