//! Paths made straight where that costs no more (the thesis, Algorithm 5 with its revised step 4:1).
//!
//! From a waypoint on, the end of a straight line is moved along the path as long as the line may be travelled and costs no more than the
//! line to the waypoint before and the one from there; then that waypoint is kept, and the next line begins there. Costs are those of
//! [`crate::line`], so that with a tolerance of 0 the smoothed path costs no more than the path itself; a tolerance adds at most
//! its own value for each waypoint removed.

use crate::line::{Ground, Travelled};
use crate::map::Node;

#[cfg(test)]
mod tests;

/// Rounding of sums, as a share: without it points on one straight line would stay.
const ROUNDING: f64 = 1e-12;

/// The waypoints that are left, and what the path over them costs; `None` where the path itself may not be travelled.
pub fn smoothed(ground: &Ground<'_>, path: &[Node], tolerance: f64) -> Option<(Vec<Node>, Travelled)> {
    let mut kept: Vec<Node> = path.first().copied().into_iter().collect();
    let mut total = Travelled::NONE;
    let mut start = 0;
    while start + 1 < path.len() {
        let mut end = start + 1;
        let mut line = ground.line(path[start], path[end])?;
        while let Some(&candidate) = path.get(end + 1) {
            let by_way_of = line.then(ground.line(path[end], candidate)?);
            let Some(direct) = ground.line(path[start], candidate) else { break };
            if direct.cost > by_way_of.cost * (1.0 + ROUNDING) + tolerance {
                break;
            }
            (line, end) = (direct, end + 1);
        }
        kept.push(path[end]);
        total = total.then(line);
        start = end;
    }
    Some((kept, total))
}
