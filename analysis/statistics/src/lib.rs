//! Arrays in, numbers out: summaries, distributions, correlation, bootstrap intervals, cumulative incidence, nested components of
//! variance, and tests of groups whose missions are nested in terrains.
//!
//! What such tests look at is one number per terrain, because missions on one terrain resemble each other:
//! [`permutation`] (do two groups differ?), [`trend`] (do ordered groups rise or fall?), [`effect`] (by how much?),
//! [`difference`] (all of these at once), [`equivalence`] (by less than a margin?), [`conformal`] (is one more drive like these?),
//! [`mixed_logistic`] (success, with an intercept of the terrain), [`power`] (how many terrains would be needed?), [`multiple`] (several
//! tests at once). Clusters of many values have [`ratio`] (means and ratios), [`proportion`] and [`incidence`] (shares, and shares by
//! distance), [`intraclass`] (how alike are they?) and [`prediction`] (where does one more cluster fall?).
//! [`morris`] ranks the parameters of a model by their elementary effects.
//!
//! Values that are not finite are not data: callers drop them first (`sastrugi_numeric::sums::finite`). Nothing here
//! draws a random number except from the stream it is given, and the bits do not depend on the CPU.

pub mod bootstrap;
pub mod chi_square;
pub mod components;
pub mod conformal;
pub mod correlation;
pub mod difference;
pub mod effect;
pub mod equivalence;
pub mod incidence;
pub mod intraclass;
pub mod mixed_logistic;
pub mod morris;
pub mod multiple;
pub mod normal;
pub mod permutation;
pub mod power;
pub mod prediction;
pub mod proportion;
mod rank_distribution;
pub mod ratio;
pub mod student;
pub mod summary;
pub mod trend;

pub use bootstrap::{Interval, cluster_interval};
pub use components::Components;
pub use conformal::Place;
pub use difference::Difference;
pub use effect::Effect;
pub use equivalence::MeanDifference;
pub use incidence::{Ending, Incidence};
pub use intraclass::Intraclass;
pub use multiple::holm;
pub use permutation::{Arrangements, Permutation, least_p_apart, least_p_in_blocks};
pub use summary::BoxPlot;
