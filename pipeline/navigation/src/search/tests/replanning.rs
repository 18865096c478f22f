//! D* Lite against fresh searches.

use crate::map::{Neighbourhood, Node, TravelMap};
use crate::search::cost_along;
use crate::search::dijkstra;
use crate::search::dstar_lite::DStarLite;
use crate::search::grid::GridNetwork;
use crate::testing::{NEIGHBOURHOODS, Random, drawn, ground, rough, thesis_costs};

/// Follows edits of a map with a search from a moving start, and compares each with a fresh search; `edit` returns the nodes that it changed.
fn follow(
    mut map: TravelMap,
    neighbourhood: Neighbourhood,
    edits: usize,
    random: &mut Random,
    edit: impl Fn(&mut TravelMap, &mut Random) -> Vec<Node>,
) -> [u64; 2] {
    let costs = thesis_costs(&map);
    let goal = map.node(0, 0);
    let mut start = map.len() as Node - 1;
    map.unblock(goal);
    map.unblock(start);
    let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood };
    let mut search = DStarLite::new(&grid, start, goal);
    let (mut followed, mut afresh) = (0, 0);
    for _ in 0..edits {
        let edited = edit(&mut map, random);
        map.unblock(goal);
        map.unblock(start);
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood };
        let around = edited.iter().chain([&start, &goal]).flat_map(|node| map.around(*node));
        search.changed(&grid, around);
        let found = search.search(&grid);
        followed += found.as_ref().map_or(0, |found| found.expansions);
        let mut fresh_search = DStarLite::new(&grid, start, goal);
        let fresh = fresh_search.search(&grid);
        afresh += fresh.as_ref().map_or(0, |found| found.expansions);
        let truth = dijkstra::costs_to(&grid, goal);
        match (&found, &fresh) {
            (None, None) => assert!(truth[start as usize].is_infinite()),
            (Some(found), Some(fresh)) => {
                assert_eq!(found.cost.to_bits(), truth[start as usize].to_bits());
                assert_eq!(fresh.cost.to_bits(), truth[start as usize].to_bits());
                assert_eq!(found.path, fresh.path, "one canonical path");
                assert!((cost_along(&grid, &found.path) / found.cost - 1.0).abs() < 1e-12);
                for vertex in &found.path {
                    assert_eq!(search.value(*vertex).to_bits(), truth[*vertex as usize].to_bits());
                }
                let ahead = found.path[(random.below(4) as usize).min(found.path.len() - 2)];
                search.move_to(&grid, ahead);
                start = ahead;
            }
            other => panic!("{other:?}"),
        }
        if found.is_none() || map.place(start).iter().all(|k| *k < 3) {
            start = map.len() as Node - 1 - random.below(5) as Node;
            map.unblock(start);
            let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood };
            search.move_to(&grid, start);
            search.changed(&grid, map.around(start));
        }
    }
    [followed, afresh]
}

/// Blocks or frees some cells, or changes the height of one.
fn edit(map: &mut TravelMap, random: &mut Random) -> Vec<Node> {
    let mut edited = Vec::new();
    for _ in 0..1 + random.below(4) {
        let node = random.below(map.len() as u64) as Node;
        match random.below(3) {
            0 => map.block(node),
            1 => map.unblock(node),
            _ => map.set_height_m(node, 0.7 * random.unit()).unwrap(),
        }
        edited.push(node);
    }
    edited
}

#[test]
fn val_edited_searches_have_the_bits_of_fresh_ones() {
    let mut random = Random(30);
    let mut sums = [0, 0];
    for k in 0..12 {
        let map = rough(24, 24, 0.2, [0.0, 0.6][k % 2], &mut random);
        let expansions = follow(map, NEIGHBOURHOODS[k / 2 % 2], 60, &mut random, edit);
        (0..2).for_each(|k| sums[k] += expansions[k]);
    }
    assert!(3 * sums[0] < sums[1], "expansions after edits {}, afresh {}", sums[0], sums[1]);
}

#[test]
fn val_a_thin_wall_that_opens_and_closes_is_never_taken_for_closed() {
    let mut random = Random(31);
    let lines: Vec<String> = (0..21).map(|r| if r == 10 { "#".repeat(21) } else { ".".repeat(21) }).collect();
    let map = drawn(&lines.iter().map(String::as_str).collect::<Vec<_>>());
    let gate = |map: &mut TravelMap, random: &mut Random| {
        let node = map.node(10, random.below(21) as usize);
        if map.is_blocked(node) {
            map.unblock(node)
        } else {
            map.block(node)
        }
        vec![node]
    };
    for neighbourhood in NEIGHBOURHOODS {
        follow(map.clone(), neighbourhood, 300, &mut random, gate);
    }
}
