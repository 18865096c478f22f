//! How well a rover did.

/// Distance from start to goal over the way that was needed for it: `d0 / (travelled + residual)`, m, with the residual the
/// distance to the goal where the rover stopped. In 0 to 1, since no way is shorter than the straight one; 1 where there was no way
/// to go. The paper reports `d0 / travelled` of rovers that arrive, to which this comes within the tolerance of the goal. The
/// residual (our choice) only keeps it within 1: a rover that gives up early scores high, so it stands beside the share that arrived.
pub fn efficiency(straight_m: f64, travelled_m: f64, residual_m: f64) -> f64 {
    let way_m = travelled_m + residual_m;
    if way_m > 0.0 { (straight_m / way_m).min(1.0) } else { 1.0 }
}
