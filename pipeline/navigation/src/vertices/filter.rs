//! Critical points that are easily stepped over are dropped (the thesis, section 3.1).
//!
//! A point is dropped if the nearest marked points along both axes, as far as there are any, differ from it by no more than the step in
//! height. (The printed formula says "more than", the opposite of the prose around it.) All points are looked at before any is dropped, so that
//! their order does not matter; a point that sees no other stays.

use crate::map::TravelMap;

/// What a point has seen along its row and column.
#[derive(Clone, Copy, Default)]
struct Seen {
    any: bool,
    /// One of them keeps it: it differs by more than the step, or by no more where the formula is taken as printed.
    apart: bool,
}

/// Drops marks; `literal`: those that the printed formula drops.
pub fn filter(map: &TravelMap, marks: &mut [bool], step_m: f64, literal: bool) {
    let [rows, cols] = map.shape();
    let heights = &map.heights().values;
    let mut seen = vec![Seen::default(); marks.len()];
    let mut along = |line: &mut dyn Iterator<Item = usize>| {
        let mut last: Option<usize> = None;
        for node in line.filter(|node| marks[*node]) {
            if let Some(other) = last {
                let apart = ((heights[node] - heights[other]).abs() > step_m) != literal;
                for one in [node, other] {
                    seen[one] = Seen { any: true, apart: seen[one].apart || apart };
                }
            }
            last = Some(node);
        }
    };
    (0..rows).for_each(|row| along(&mut (row * cols..(row + 1) * cols)));
    (0..cols).for_each(|col| along(&mut (col..rows * cols).step_by(cols)));
    marks.iter_mut().zip(&seen).for_each(|(mark, seen)| *mark &= !seen.any || seen.apart);
}
