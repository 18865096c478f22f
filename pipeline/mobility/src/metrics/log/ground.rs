//! The measured terrain under a log's path.

use super::Analysis;
use crate::missions::class_at;
use sastrugi_numeric::{Grid, Surface, sums};
use sastrugi_schemas::RoughnessClass;

/// Terrain statistics under a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnGround {
    /// Share of the samples over cells with data.
    pub known_share: f64,
    /// Height of the body's frame above the ground below it, m: smallest, median, largest; NaN without data.
    pub clearance_m: [f64; 3],
    /// Shares of the classes low, semi and high among the samples over a class.
    pub shares: [f64; 3],
}

/// Terrain under the samples of a log. DEM and classes are in the log's frame after `offset_m` is added to its positions.
pub fn on_ground(analysis: &Analysis, offset_m: [f64; 3], dem: &Grid, classes: &Grid<u8>) -> OnGround {
    let positions = analysis
        .pieces
        .iter()
        .flatten()
        .map(|s| -> [f64; 3] { std::array::from_fn(|i| s.position_m[i] + offset_m[i]) });
    let positions: Vec<[f64; 3]> = positions.collect();
    let above = positions.iter().filter_map(|[x, y, z]| Some(z - dem.height(*x, *y)?));
    let above: Vec<f64> = above.collect();
    let met: Vec<RoughnessClass> = positions.iter().filter_map(|[x, y, _]| class_at(classes, *x, *y)).collect();
    let share = |class: RoughnessClass| met.iter().filter(|m| **m == class).count() as f64 / met.len() as f64;
    OnGround {
        known_share: above.len() as f64 / positions.len() as f64,
        clearance_m: [
            above.iter().copied().fold(f64::NAN, f64::min),
            sums::median(&above),
            above.iter().copied().fold(f64::NAN, f64::max),
        ],
        shares: [RoughnessClass::Low, RoughnessClass::Semi, RoughnessClass::High].map(share),
    }
}
