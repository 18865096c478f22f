//! Heights as 16-bit levels.

use super::posts::Posts;
use sastrugi_numeric::Grid;
use serde_json::{Value, json};

/// Height of a level: `offset_m + step_m * level`.
pub(super) struct Levels {
    /// Height of level 0, m.
    pub offset_m: f64,
    /// Height difference between levels, m.
    pub step_m: f64,
}

impl Levels {
    /// The nearest level of every post, row 0 north.
    pub fn of(&self, posts: &Posts) -> Grid<u16> {
        posts.heights.map(|z| ((z - self.offset_m) / self.step_m).round().clamp(0.0, 65535.0) as u16)
    }

    pub fn describe(&self) -> Value {
        json!({ "offset_m": self.offset_m, "step_m": self.step_m })
    }
}

/// A number with few digits, easy to type, that is not below `value` (above 0) and exceeds it by less than a share of 3e-5.
pub(super) fn rounded_up(value: f64) -> f64 {
    // Rounding to six digits is off by at most half of 1e-5.
    format!("{:.5e}", value * (1.0 + 1e-5)).parse().unwrap_or(value)
}

/// Rounded to whole millimetres, without negative zero.
pub(super) fn to_millimetres(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0 + 0.0
}
