//! Points that join isolated ones (the thesis, Algorithm 3).
//!
//! Rows are scanned from north to south. A row with a single mark has no edge along it; the node above that mark in the previous such row is marked,
//! so that a column joins the two rows. Then columns are scanned in the same way from west to east, including the new marks. (The listing remembers
//! an isolated row only if it already remembers one, so it never marks anything.)

use crate::map::{Node, TravelMap};

/// Marks points that join isolated ones; blocked nodes stay unmarked.
pub fn mark(map: &TravelMap, marks: &mut [bool]) {
    let [rows, cols] = map.shape();
    join(map, marks, rows, cols, |line, at| line * cols + at);
    join(map, marks, cols, rows, |line, at| at * cols + line);
}

fn join(map: &TravelMap, marks: &mut [bool], lines: usize, length: usize, node: impl Fn(usize, usize) -> usize) {
    let mut last: Option<usize> = None;
    for line in 0..lines {
        let mut marked = (0..length).filter(|at| marks[node(line, *at)]);
        let (Some(at), None) = (marked.next(), marked.next()) else { continue };
        if let Some(target) = last.map(|before| node(before, at)).filter(|target| !map.is_blocked(*target as Node)) {
            marks[target] = true;
        }
        last = Some(line);
    }
}
