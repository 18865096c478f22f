//! Statistics on plain arrays: summaries, distributions, correlation, bootstrap intervals, cumulative incidence, nested variance
//! components, and tests of groups whose missions are nested in terrains. The report, the comparison of releases and the fit of
//! textures use it; it reads no file and sees only the numbers of terrains and missions.
//!
//! # Flow
//! 1. One number per terrain: the mean over its missions ([`components`] says how much of the scatter lies between terrains).
//! 2. [`BoxPlot::of`] describes a group, [`cluster_interval`] and [`proportion::of_shares`] give intervals.
//! 3. [`Difference::apart`] or [`Difference::of_pairs`] compares two groups: test, effect and difference of means;
//!    [`trend::of_groups`] compares more than two in their order.
//! 4. [`holm`] adjusts the p-values of several comparisons together.
//! 5. [`MeanDifference::equivalence_p`] asks whether groups are the same within a margin, [`power::Target`] how many terrains the next
//!    study needs.
//!
//! ```
//! use sastrugi_numeric::Streams;
//! use sastrugi_statistics::{BoxPlot, Difference, holm};
//!
//! // Mean speed on five terrains of each of three groups.
//! let plain = [1.20, 1.25, 1.22, 1.30, 1.28];
//! let rough = [0.80, 0.95, 0.90, 0.85, 0.70];
//! let other = [1.21, 1.24, 1.23, 1.29, 1.27];
//!
//! let mut stream = Streams::for_seed(1, "example").stream("arrangements");
//! let differences = [rough, other].map(|group| Difference::apart(&plain, &group, 0.95, 9999, &mut stream));
//! let p = differences.map(|d| d.test.map_or(f64::NAN, |t| t.p));
//! // Every rough terrain is slower than every plain one: 2 of 252 arrangements. Adjusted for two tests, 4 of 252.
//! assert_eq!(p[0], 2.0 / 252.0);
//! assert_eq!(holm(&p)[0], 2.0 * p[0]);
//! // The other group cannot be told from the plain one.
//! assert!(p[1] > 0.5);
//! let slower = differences[0].effect.unwrap();
//! assert_eq!(slower.delta.estimate, -1.0);
//! assert!(slower.shift.high < 0.0 && BoxPlot::of(&rough).unwrap().median == 0.85);
//! ```
//!
//! # Modules
//! The tests use one number per terrain, because missions on one terrain resemble each other:
//! [`permutation`] (do two groups differ?), [`trend`] (do ordered groups rise or fall?), [`effect`] (by how much?),
//! [`difference`] (all of these at once), [`equivalence`] (by less than a margin?), [`conformal`] (is one more drive like these?),
//! [`mixed_logistic`] (success, with a random intercept per terrain), [`power`] (how many terrains would be needed?), [`multiple`] (several
//! tests at once). For clusters of many values there are [`ratio`] (means and ratios), [`proportion`] and [`incidence`] (shares, and shares
//! by distance), [`intraclass`] (how alike are they?) and [`prediction`] (where does one more cluster fall?).
//! [`morris`] ranks the parameters of a model by their elementary effects.
//!
//! Values that are not finite are not data: callers remove them first (`sastrugi_numeric::sums::finite`). Random numbers are
//! drawn only from the stream passed in, and results do not depend on the CPU.

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
