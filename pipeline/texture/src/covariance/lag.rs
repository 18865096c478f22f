//! Lags in cells converted to metres.

/// A lag in cells as `[east, north]` in m: rows count southwards.
pub fn lag_m([row, col]: [isize; 2], cell_m: [f64; 2]) -> [f64; 2] {
    [col as f64 * cell_m[0], -(row as f64) * cell_m[1]]
}

/// Length in m of a lag in cells.
pub fn length_m(lag: [isize; 2], cell_m: [f64; 2]) -> f64 {
    let (y, x) = (lag[0] as f64 * cell_m[1], lag[1] as f64 * cell_m[0]);
    (x * x + y * y).sqrt()
}
