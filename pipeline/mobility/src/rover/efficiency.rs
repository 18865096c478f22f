//! Efficiency of a drive.

/// Straight distance from start to goal divided by the distance travelled plus the residual: `d0 / (travelled + residual)`, in m.
/// The residual is the distance to the goal where the rover stopped. The result lies in 0 to 1, since no path is shorter than the
/// straight one; it is 1 if nothing was left to drive. The paper reports `d0 / travelled` for rovers that arrive, which differs
/// only by the goal tolerance. The residual (our choice) merely keeps the value within 1: a rover that gives up early scores
/// high, so read it together with the share of rovers that arrived.
///
/// ```
/// use sastrugi_mobility::rover::efficiency;
///
/// // 25 m away: twice as far driven as necessary, or given up halfway.
/// assert_eq!(efficiency(25.0, 50.0, 0.0), 0.5);
/// assert_eq!(efficiency(25.0, 12.5, 12.5), 1.0);
/// ```
pub fn efficiency(straight_m: f64, travelled_m: f64, residual_m: f64) -> f64 {
    let way_m = travelled_m + residual_m;
    if way_m > 0.0 { (straight_m / way_m).min(1.0) } else { 1.0 }
}
