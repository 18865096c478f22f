//! Additional vertices where the height changes between marks (the thesis' height-difference threshold, HDT).
//!
//! Along each row and each column, between the first and the last mark: a node is marked when its height differs from that of the previous mark by
//! the threshold or more. Rows and columns start from the same marks.

use crate::map::TravelMap;

/// Marks nodes where the height has changed by `threshold_m` since the previous mark.
pub fn mark(map: &TravelMap, marks: &mut [bool], threshold_m: f64) {
    let [rows, cols] = map.shape();
    let heights = &map.heights().values;
    let before = marks.to_vec();
    let mut along = |line: &mut dyn Iterator<Item = usize>| {
        let mut last_m: Option<f64> = None;
        let line: Vec<usize> = line.collect();
        let end = line.iter().rposition(|node| before[*node]).unwrap_or(0);
        for &node in &line[..=end.min(line.len() - 1)] {
            let changed = last_m.is_some_and(|last_m| (heights[node] - last_m).abs() >= threshold_m);
            if before[node] || changed && !map.is_blocked(node as u32) {
                marks[node] = true;
                last_m = Some(heights[node]);
            }
        }
    };
    (0..rows).for_each(|row| along(&mut (row * cols..(row + 1) * cols)));
    (0..cols).for_each(|col| along(&mut (col..rows * cols).step_by(cols)));
}
