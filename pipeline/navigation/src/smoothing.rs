//! Path smoothing (the thesis, Algorithm 5 with its revised step 4:1).
//!
//! From a waypoint, the end of a straight line is moved along the path as long as the line is passable and costs no more than the line to the
//! previous waypoint plus the one from there. Then that waypoint is kept, and the next line starts there. Costs are those of [`crate::line`], so with
//! a tolerance of 0 the smoothed path costs no more than the original; a tolerance adds at most its own value for each waypoint removed.

use crate::line::{Ground, Travelled};
use crate::map::Node;

#[cfg(test)]
mod tests;

/// Relative rounding of sums; without it, collinear points would not be removed.
const ROUNDING: f64 = 1e-12;

/// The remaining waypoints and the score of the path through them; `None` if the original path is not passable.
///
/// # Examples
/// ```
/// use sastrugi_navigation::smoothing::smoothed;
/// use sastrugi_navigation::{CostModel, Ground, SlopeCost, SlopeLimits, TravelMap};
/// use sastrugi_numeric::{Geometry, Grid};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let heights = Grid::filled(Geometry::square(4, 4, 1.0), 0.0);
/// let map = TravelMap::new(heights, SlopeLimits::new(30.0, 30.0)?)?;
/// let costs = CostModel::new(SlopeCost::THESIS, None, &map)?;
/// let ground = Ground { map: &map, costs: &costs, clearance: None };
/// // Stairs from corner to corner, 6 m, become the diagonal.
/// let (kept, score) = smoothed(&ground, &[0, 1, 5, 6, 10, 11, 15], 0.0).ok_or("the path is not passable")?;
/// assert_eq!(kept, [0, 15]);
/// assert!((score.cost - 18f64.sqrt()).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
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
