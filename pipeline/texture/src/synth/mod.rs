//! Synthetic texture: random fields with a given covariance. One folder per method.

pub mod fft_ma;

use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use serde_json::Value;

/// A method with checked parameters, ready to make fields.
pub trait Synthesis: Send + Sync {
    /// Shape and cells of the texture; its south-west corner is the origin.
    fn geometry(&self) -> Geometry;

    /// The checked parameters with every default written out.
    fn parameters(&self) -> Value;

    /// Working memory of [`Self::generate`], result included.
    fn memory_bytes(&self) -> u64;

    /// Sentences a user should read: rounded sizes, coarse cells, a torus too small for the range.
    fn notes(&self) -> Vec<String>;

    /// One field from the named streams.
    ///
    /// # Errors
    /// See [`SynthesisError`].
    fn generate(&self, streams: &Streams) -> Result<TextureOutcome, SynthesisError>;
}

/// A texture.
#[derive(Clone, Debug)]
pub struct TextureOutcome {
    /// Heights, m.
    pub grid: Grid,
    /// Largest absolute difference between the covariance that was made and the one that was asked for, over all lags
    /// of the torus, m2.
    pub covariance_error_max_m2: f64,
    /// Share of the spectrum that was negative and set to 0.
    pub clip_share: f64,
}

/// A texture that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SynthesisError {
    /// The covariance does not fit on the torus.
    #[error(
        "the covariance is not positive definite on a tile of {width_m} m x {height_m} m: {clip_share:.1e} of its spectrum \
         is negative, more than {limit:.0e}; make the tile at least {needed_m} m each way or set periodic = false"
    )]
    NegativeSpectrum {
        /// East-west size of the torus, m.
        width_m: f64,
        /// North-south size of the torus, m.
        height_m: f64,
        /// Negative share of the spectrum.
        clip_share: f64,
        /// Largest share that is set to 0 in silence.
        limit: f64,
        /// A size that is enough, m.
        needed_m: f64,
    },
}

/// Cells along a side of `size_m`: the nearest integer when within 1e-6 of one, else rounded down (`true`).
fn cells_along(key: &str, size_m: f64, cell_m: f64) -> Result<(usize, bool), ParameterError> {
    /// Cells along a side of more than this are a mistake.
    const CELLS_MAX: f64 = 1e6;
    let cells = ParameterError::positive(key, size_m)? / cell_m;
    let whole = (cells - cells.round()).abs() <= 1e-6;
    let count = if whole { cells.round() } else { cells.floor() };
    if !(1.0..=CELLS_MAX).contains(&count) {
        let message = format!("is {size_m} m, {cells} cells of {cell_m} m; it must hold 1 to {CELLS_MAX} cells");
        return Err(ParameterError::new(key, message));
    }
    Ok((count as usize, !whole))
}
