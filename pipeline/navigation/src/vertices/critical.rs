//! Critical points (the thesis, Algorithm 1): nodes above or below all four neighbours, and saddles.
//!
//! A saddle lies above two opposite neighbours and below the other two. All comparisons are strict, so a plateau has no critical points. Nodes at the
//! border, or next to a node without height, lack neighbours and are never critical.

use crate::map::{Direction, Node, TravelMap};

/// Marks the critical points of a map.
pub fn marks(map: &TravelMap) -> Vec<bool> {
    (0..map.len() as Node).map(|node| is_critical(map, node).unwrap_or(false)).collect()
}

fn is_critical(map: &TravelMap, node: Node) -> Option<bool> {
    if map.is_blocked(node) {
        return None;
    }
    let z = map.height_m(node);
    let mut rises = [0.0; 4];
    for (rise, &direction) in rises.iter_mut().zip(&Direction::ALL[..4]) {
        *rise = map.height_m(map.neighbour(node, direction)?) - z;
    }
    let [east, north, west, south] = rises;
    let all = |test: fn(f64) -> bool| rises.into_iter().all(test);
    let (above, below) = (|rise: f64| rise < 0.0, |rise: f64| rise > 0.0);
    let across = above(east) && above(west) && below(north) && below(south);
    let along = above(north) && above(south) && below(east) && below(west);
    Some(all(above) || all(below) || across || along)
}
