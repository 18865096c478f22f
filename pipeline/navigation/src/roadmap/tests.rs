use super::*;
use crate::clearance::Clearance;
use crate::map::TravelMap;
use crate::testing::{drawn, ground, limits, map_of, thesis_costs};
use crate::vertices::Vertices;

fn marks(map: &TravelMap, nodes: &[Node]) -> Vec<bool> {
    (0..map.len() as Node).map(|node| nodes.contains(&node)).collect()
}

fn edges(roadmap: &Roadmap<'_>) -> Vec<(Node, Node)> {
    let nodes = roadmap.nodes();
    let mut edges = Vec::new();
    for (vertex, from) in (0..).zip(nodes) {
        roadmap.edges(vertex, |target, _| edges.push((*from, nodes[target as usize])));
    }
    edges.sort_unstable();
    edges
}

#[test]
fn val_edges_join_consecutive_marks_of_a_line_with_nothing_blocked_between() {
    let map = drawn(&[".....", ".....", "..#..", ".....", "....."]);
    let costs = thesis_costs(&map);
    let marks = marks(&map, &[0, 2, 4, 10, 14, 22, 24]);
    let roadmap = Roadmap::new(ground(&map, &costs), &marks, Neighbourhood::Four);
    let one_way = [(0, 2), (0, 10), (2, 4), (4, 14), (14, 24), (22, 24)];
    let mut both: Vec<_> = one_way.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
    both.sort_unstable();
    assert_eq!(edges(&roadmap), both);
}

#[test]
fn val_an_edge_over_a_cliff_goes_only_where_every_step_does() {
    // Level from end to end, with one step of 0.8 m up and two of 0.4 m down in between.
    let map = map_of(2, 5, limits(30.0, 60.0), |_, c| [0.0, 0.0, 0.8, 0.4, 0.0][c]);
    let costs = thesis_costs(&map);
    let roadmap = Roadmap::new(ground(&map, &costs), &marks(&map, &[0, 4]), Neighbourhood::Four);
    assert_eq!(edges(&roadmap), [(4, 0)], "0.8 m down is 38.7 degrees, up it is too steep");
}

#[test]
fn val_with_every_node_marked_the_roadmap_is_the_grid() {
    let map = map_of(8, 9, limits(30.0, 20.0), |r, c| 0.3 * ((r * 5 + c * 3) % 4) as f64);
    let costs = thesis_costs(&map);
    let clearance = Clearance::new(&map, 3.0, 1.0, 10.0).unwrap();
    let ground = Ground { clearance: Some(&clearance), ..ground(&map, &costs) };
    for neighbourhood in crate::testing::NEIGHBOURHOODS {
        let roadmap = Roadmap::new(ground, &Vertices::every(&map).marks, neighbourhood);
        let grid = crate::search::grid::GridNetwork { ground, neighbourhood };
        for node in 0..map.len() as u32 {
            let (mut ours, mut theirs) = (Vec::new(), Vec::new());
            roadmap.edges(node, |target, cost| ours.push((target, cost)));
            grid.edges(node, |target, cost| theirs.push((target, cost)));
            assert_eq!(ours, theirs);
        }
    }
}

#[test]
fn val_narrow_ends_make_an_edge_expensive() {
    let map = drawn(&["##.##", ".....", "##.##"]);
    let costs = thesis_costs(&map);
    let cost = |clearance: Option<&Clearance>| {
        let ground = Ground { clearance, ..ground(&map, &costs) };
        let roadmap = Roadmap::new(ground, &marks(&map, &[5, 7]), Neighbourhood::Four);
        let mut cost = 0.0;
        roadmap.edges(0, |_, c| cost = c);
        cost
    };
    let clearance = Clearance::new(&map, 4.0, 1.0, 10.0).unwrap();
    // A gap of 0 counts as one cell: factor 4; one of 2 m has factor 2.
    assert_eq!([cost(None), cost(Some(&clearance))], [2.0, 2.0 * 4.0 * 2.0]);
}

#[test]
fn val_links_lead_to_the_first_marks_on_the_rays() {
    let map = drawn(&[".....", ".....", "..#..", ".....", "....."]);
    let costs = thesis_costs(&map);
    let marks = marks(&map, &[0, 9, 22]);
    let roadmap = Roadmap::new(ground(&map, &costs), &marks, Neighbourhood::Four);
    assert_eq!(roadmap.links(7, Way::From, None), [(9, 2.0)]);
    assert_eq!(roadmap.links(7, Way::To, Some(5)), [(9, 2.0), (5, 2.0)]);
    let eight = Roadmap::new(ground(&map, &costs), &marks, Neighbourhood::Eight);
    assert_eq!(eight.links(6, Way::From, None), [(9, 3.0), (0, 2f64.sqrt())]);
}
