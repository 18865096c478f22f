//! Singular points (the thesis, Algorithm 2): nodes next to a step that is not allowed in at least one direction.
//!
//! The rims of obstacles are marked too: free nodes next to blocked ones, including diagonally. (The thesis marks the obstacles' own edges, so
//! vertices would lie inside them.)

use crate::map::{Neighbourhood, Node, TravelMap};

/// Marks free nodes next to a step that is too steep in either direction.
pub fn mark(map: &TravelMap, marks: &mut [bool], neighbourhood: Neighbourhood) {
    let [rows, cols] = map.shape();
    for (k, &direction) in neighbourhood.directions().iter().enumerate() {
        for (row, col) in (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col))) {
            let node = map.node(row, col);
            if map.is_blocked(node) || map.may_step(node, k) {
                continue;
            }
            if let Some(beside) = map.neighbour(node, direction).filter(|beside| !map.is_blocked(*beside)) {
                marks[node as usize] = true;
                marks[beside as usize] = true;
            }
        }
    }
}

/// Marks the free nodes next to blocked ones.
pub fn mark_rims(map: &TravelMap, marks: &mut [bool]) {
    blocked(map).flat_map(|node| map.around(node)).for_each(|node| marks[node as usize] |= !map.is_blocked(node));
}

/// Marks the blocked nodes next to free ones.
pub fn mark_obstacles(map: &TravelMap, marks: &mut [bool]) {
    let on_edge = |node: &Node| map.around(*node).any(|beside| !map.is_blocked(beside));
    blocked(map).filter(on_edge).for_each(|node| marks[node as usize] = true);
}

fn blocked(map: &TravelMap) -> impl Iterator<Item = Node> {
    (0..map.len() as Node).filter(|node| map.is_blocked(*node))
}
