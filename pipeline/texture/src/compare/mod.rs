//! Tests whether two textures are statistically the same.
//!
//! # Answers
//! Every quantity gets one of three answers:
//! * `same`: the interval of the difference lies within stated bounds (equivalence; Schuirmann, 1987);
//! * `different`: equality is ruled out, and equivalence is not shown;
//! * `cannot tell`: neither, with the reason.
//!
//! Quantities of two DEMs: sigma, b (and a model's shape) as the logarithm of their ratio; anisotropy as the distance between
//! the two elongations `ln(1 / ratio) (cos 2 a, sin 2 a)`, a the azimuth of the long axis, which are continuous in a and 0 for an
//! isotropic surface; the distribution of heights as the root mean square distance between the quantiles of standardised
//! residuals (a Wasserstein distance of order 2). Of two fits: those that the fit files contain.
//!
//! # Null distributions
//! Cells of one surface are correlated, so standard tests for independent values (Kolmogorov-Smirnov, F, chi-squared) do not
//! apply. The null is simulated: surfaces with the pooled fitted covariance and Gaussian phases, on each side's own
//! grid and mask, go through the same moving average, trimming, correlation and fit (Davison and Hinkley, 1997, section 4.2).
//! The null for the heights also uses the pooled quantiles as its marginal (normal score), so that heavy tails common to both
//! sides are included in its scatter. If the blocks of a site scatter more than surfaces of the model do, the null of sigma, b and
//! anisotropy is widened by that factor, since a heterogeneous site carries less information. For two fit files, without heights,
//! the null is normal, with the standard errors implied by their bootstrapped intervals.
//!
//! Intervals come from the same simulations, as differences minus quantiles of the null; they hold near
//! equality, which is where equivalence is decided, and are approximate for surfaces far apart.
//!
//! # Split halves, and any texture
//! A texture has its site's sigma and b by construction: comparing those would be circular, and is not done here. A texture is
//! instead judged by statistics that were not fitted, on ground that was not fitted ([`halves`]). A texture of any origin, whose generator is
//! not known, is judged by how far blocks of its site differ from each other ([`blocks`]).
//!
//! # Error rates
//! Equality: Holm's (1979) adjustment, so that the probability of any wrong `different` is at most alpha (0.05) over all
//! quantities. Equivalence: two one-sided tests, so that each wrong `same` has a probability of at most alpha. The joint answer
//! `same` has the same error rate (intersection-union test; Berger, 1982) and needs no adjustment.
//!
//! # Cost
//! One fit of each side, and per simulation a surface of at most a million cells and two searches for each side.

mod blocks;
mod fits;
mod halves;
mod heights;
mod params;
mod surfaces;
mod verdict;

pub use blocks::{BlockEvidence, FoundCopies, blocks};
pub use fits::fits;
pub use halves::halves;
pub use params::{CompareParameters, CompareSettings};
pub use surfaces::surfaces;

use crate::fit::FitError;
pub use sastrugi_schemas::Answer;
use sastrugi_schemas::{ParameterError, counted};
use serde::Serialize;

/// How a difference is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// `ln(B / A)`.
    LogRatio,
    /// A distance, never negative.
    Distance,
}

/// One quantity of A and B.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// Name and unit, as `sigma_m`.
    pub name: String,
    /// Value of A.
    pub a: Option<f64>,
    /// Value of B.
    pub b: Option<f64>,
    /// How the difference is measured.
    pub measure: Measure,
    /// Difference.
    pub difference: Option<f64>,
    /// Interval of the difference at level `1 - 2 alpha`.
    pub interval: Option<[f64; 2]>,
    /// Largest absolute difference that counts as the same.
    pub bound: f64,
    /// p-value of equality.
    pub p: Option<f64>,
    /// The same, adjusted for the number of quantities (Holm).
    pub p_adjusted: Option<f64>,
    /// Null distribution.
    pub null: Option<NullSummary>,
    /// For a texture against its site: the same distance between parts of the site.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub site: Option<SiteDistances>,
    /// Answer.
    pub answer: Answer,
    /// Reason for the answer, in a sentence.
    pub why: String,
}

impl Quantity {
    /// A difference as text; log ratios are shown as ratios.
    pub fn shown(&self, difference: f64) -> String {
        match self.measure {
            Measure::LogRatio => format!("x{:.3}", libm::exp(difference)),
            Measure::Distance => format!("{difference:.3}"),
        }
    }

    /// The equivalence bounds as text.
    pub fn bounds_shown(&self) -> String {
        match self.measure {
            Measure::LogRatio => format!("{} to {}", self.shown(-self.bound), self.shown(self.bound)),
            Measure::Distance => self.shown(self.bound),
        }
    }
}

/// Distance between two parts of a site.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SiteDistances {
    /// Between its halves: those across its longer side if these are split, else the larger of west to east and north to south.
    pub halves: Option<f64>,
    /// Between its black and white blocks, interleaved like a chessboard.
    pub interleaved: Option<f64>,
}

/// Summary of a null distribution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullSummary {
    /// `simulated surfaces`, `intervals of the fits`, or `arrangements of blocks`.
    pub kind: &'static str,
    /// Number of draws.
    pub draws: usize,
    /// Mean of the difference under equality.
    pub mean: f64,
    /// Its standard deviation.
    pub standard_deviation: f64,
    /// Factor by which it was widened because blocks of the sites scatter more than surfaces of the model do, or halves of a site differ
    /// more than its blocks in any order.
    pub widened: f64,
}

/// A comparison of two textures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// What was compared: `surfaces`, `fits`, `halves` or `statistics`.
    pub what: &'static str,
    /// Every quantity.
    pub quantities: Vec<Quantity>,
    /// For halves: the same quantities with interleaved blocks in place of the halves. They are not part of the answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interleaved: Option<Vec<Quantity>>,
    /// For statistics: the blocks that were compared, and copies found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blocks: Option<BlockEvidence>,
    /// `different` if any quantity is, `same` if all are.
    pub answer: Answer,
    /// The answer in a sentence.
    pub sentence: String,
    /// Largest probability of any wrong `different`, and of each wrong `same`.
    pub alpha: f64,
    /// Covariance model; empty where none was fitted.
    pub model: String,
    /// Simulated surfaces of each side; 0 where none were needed.
    pub simulations: usize,
    /// Name of the random streams.
    pub streams: String,
    /// Caveats for the reader.
    pub notes: Vec<String>,
}

/// Why two textures cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// One side cannot be fitted.
    #[error("{side}: {error}")]
    Side {
        /// `A` or `B`.
        side: &'static str,
        /// Why.
        error: FitError,
    },
    /// The covariance of one side's lags is singular.
    #[error(
        "{side}: the covariance of the lags is singular, so the fit has no weights; mask what is not texture, or use a larger outer scale"
    )]
    NoLikelihood {
        /// `A` or `B`.
        side: &'static str,
    },
    /// One side has too few blocks.
    #[error(
        "the site has {} of {} x {} cells (two windows or more) with data, the texture {texture}: at least {needed} of each are needed; \
         use a smaller outer scale or larger rasters",
        counted(.site, "block"), .shape[0], .shape[1]
    )]
    TooFewBlocks {
        /// Rows and columns of a block.
        shape: [usize; 2],
        /// Blocks of the site.
        site: usize,
        /// Blocks of the texture.
        texture: usize,
        /// Fewest of each.
        needed: usize,
    },
    /// Too few blocks for a significant difference.
    #[error(
        "with {site} blocks of the site and {texture} of the texture, no p-value can be below {least:.4}: a difference in one of {quantities} quantities \
         cannot be significant at alpha = {alpha}; use a smaller outer scale, larger rasters or a larger alpha"
    )]
    TooFewArrangements {
        /// Blocks of the site.
        site: usize,
        /// Blocks of the texture.
        texture: usize,
        /// Smallest p-value.
        least: f64,
        /// Number of quantities.
        quantities: usize,
        /// Largest probability of any wrong `different`.
        alpha: f64,
    },
    /// The cells differ in size.
    #[error(
        "the site has cells of {} x {} m, the texture of {} x {} m: slopes, increments and spectra depend on the cell; make the texture with \
         the site's cells",
        .site_m[0], .site_m[1], .texture_m[0], .texture_m[1]
    )]
    Cells {
        /// Cell size of the site, east-west and north-south, m.
        site_m: [f64; 2],
        /// Cell size of the texture.
        texture_m: [f64; 2],
    },
}

#[cfg(test)]
mod tests;
