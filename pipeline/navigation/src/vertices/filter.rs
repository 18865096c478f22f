//! Filter that drops critical points which are easily stepped over (the thesis, section 3.1).
//!
//! A point is dropped if it has marked neighbours along its row or column and the nearest ones differ from it in height by no more than the step.
//! (The printed formula says "more than", the opposite of the surrounding text.) All points are examined before any is dropped, so their order does
//! not matter; a point without marked neighbours stays.

use crate::map::TravelMap;

/// Marked neighbours found along the row and column of a point.
#[derive(Clone, Copy, Default)]
struct Seen {
    any: bool,
    /// One of them keeps the point: it differs by more than the step or, with the formula as printed, by no more.
    apart: bool,
}

/// Drops marks; `literal` applies the printed formula.
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
