//! What every generator offers.

use sastrugi_numeric::{Geometry, Grid, Streams};
use serde_json::Value;

/// A generator with checked parameters.
pub trait Generator: Send + Sync {
    /// Name in `kind = "..."`.
    fn kind(&self) -> &'static str;

    /// Shape and place of the heightfield.
    fn geometry(&self) -> Geometry;

    /// The full checked parameters, defaults filled in and the size in cells. [`crate::prepare`] reads them back to the
    /// same generator.
    fn parameters(&self) -> Value;

    /// Peak working memory of [`Self::generate`], its result included, bytes.
    fn memory_bytes(&self) -> u64;

    /// Sentences that a reader of the result should know, such as a size that was rounded down.
    fn notes(&self) -> Vec<String>;

    /// The heightfield, m.
    ///
    /// # Errors
    /// A [`TerrainError`] where the parameters are possible one by one but give no usable surface together.
    fn generate(&self, streams: &Streams) -> Result<Grid, TerrainError>;

    /// The heights as 16-bit levels, for generators that define them.
    fn levels(&self, _heights: &Grid) -> Option<Levels> {
        None
    }
}

/// Heights as 16-bit levels, as in a greyscale PNG: `height_m = (level - zero_level) * metres_per_level`.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels {
    /// The levels.
    pub grid: Grid<u16>,
    /// Height of one level, m.
    pub metres_per_level: f64,
    /// Level of height 0.
    pub zero_level: u16,
}

/// Why a generator with valid parameters has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TerrainError {
    /// Waves so long, or so cancelled, that the surface drowns in rounding errors.
    #[error(
        "resolve the relief: {relief_m:e} m from waves of together {amplitude_m:e} m is within reach of rounding errors; \
         choose a shorter sampling length or a larger size"
    )]
    NoRelief {
        /// Highest less lowest height, m.
        relief_m: f64,
        /// Sum of all wave amplitudes, m.
        amplitude_m: f64,
    },
    /// A filtered layer or the product of layers is the same everywhere.
    #[error("find relief in {part}: it is flat after filtering; choose a smaller sigma or a larger size")]
    Flat {
        /// Name of the layer, or `the product of the layers`.
        part: &'static str,
    },
}
