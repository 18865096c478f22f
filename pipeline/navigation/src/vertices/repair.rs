//! Repair: vertices that make the roadmap connect everything that the ground connects.
//!
//! Nodes that can all reach one another by steps form a component of the ground; the vertices of one component must form one component of the
//! roadmap. If they do not, trees of shortest walks are grown over the ground's component from one of its vertices, forwards and backwards, and the
//! corners of the walks to and from one vertex of each other part are marked. Between two corners a walk is straight and every step of it is allowed,
//! so the roadmap gets these edges.

use crate::map::{Direction, Neighbourhood, Node, TravelMap};
use crate::roadmap::Lines;
use crate::search::NONE;
use crate::search::components::components;
use std::collections::{BTreeMap, VecDeque};

/// Marks the missing vertices; returns their number.
pub fn mark(map: &TravelMap, marks: &mut [bool], neighbourhood: Neighbourhood) -> usize {
    let before = marks.iter().filter(|mark| **mark).count();
    let ground = of_ground(map, neighbourhood);
    let roads = Lines::new(map, marks, neighbourhood);
    let parts = roads.components();
    // The first vertex of each part of the roadmap, per component of the ground.
    let mut firsts: BTreeMap<u32, BTreeMap<u32, Node>> = BTreeMap::new();
    for (vertex, &node) in roads.nodes().iter().enumerate() {
        firsts.entry(ground[node as usize]).or_default().entry(parts[vertex]).or_insert(node);
    }
    let mut trees = [vec![NONE; map.len()], vec![NONE; map.len()]];
    for (component, firsts) in firsts.iter().filter(|(_, firsts)| firsts.len() > 1) {
        let mut firsts: Vec<Node> = firsts.values().copied().collect();
        firsts.sort_unstable();
        for (tree, forwards) in trees.iter_mut().zip([true, false]) {
            grow(map, neighbourhood, tree, firsts[0], forwards, |node| ground[node as usize] == *component);
            let mut walked = vec![false; map.len()];
            firsts[1..].iter().for_each(|&node| mark_corners(map, tree, node, marks, &mut walked));
        }
    }
    marks.iter().filter(|mark| **mark).count() - before
}

fn of_ground(map: &TravelMap, neighbourhood: Neighbourhood) -> Vec<u32> {
    let directions = neighbourhood.directions();
    components(map.len() as u32, |_| directions.len() as u32, |node, k| map.accessible(node, directions[k as usize]))
}

/// For each node, its predecessor on a shortest walk from the root (`forwards`), or its successor on a walk to the root.
fn grow(
    map: &TravelMap,
    neighbourhood: Neighbourhood,
    tree: &mut [Node],
    root: Node,
    forwards: bool,
    belongs: impl Fn(Node) -> bool,
) {
    let mut queue = VecDeque::from([root]);
    tree[root as usize] = root;
    while let Some(node) = queue.pop_front() {
        for &direction in neighbourhood.directions() {
            let Some(beside) = map.neighbour(node, direction).filter(|n| tree[*n as usize] == NONE && belongs(*n))
            else {
                continue;
            };
            let taken =
                if forwards { map.accessible(node, direction) } else { map.accessible(beside, direction.back()) };
            if taken.is_some() {
                tree[beside as usize] = node;
                queue.push_back(beside);
            }
        }
    }
}

/// Marks the corners of the walk from a node to the root of a tree, up to the first node of an earlier walk.
fn mark_corners(map: &TravelMap, tree: &[Node], node: Node, marks: &mut [bool], walked: &mut [bool]) {
    let mut at = node;
    let mut heading: Option<Direction> = None;
    while tree[at as usize] != at && !std::mem::replace(&mut walked[at as usize], true) {
        let next = tree[at as usize];
        let direction = direction_between(map, at, next);
        marks[at as usize] |= heading.is_some_and(|heading| heading != direction);
        (heading, at) = (Some(direction), next);
    }
    marks[at as usize] = true;
}

fn direction_between(map: &TravelMap, from: Node, to: Node) -> Direction {
    let ([r0, c0], [r1, c1]) = (map.place(from), map.place(to));
    let sign = |a: usize, b: usize| (b > a) as i8 - (b < a) as i8;
    Direction { rows: sign(r0, r1), cols: sign(c0, c1) }
}
