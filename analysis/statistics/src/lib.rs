//! Arrays in, numbers out: summaries, the normal distribution, correlation, bootstrap intervals, cumulative incidence, nested
//! components of variance.
//!
//! Values that are not finite are not data: callers drop them first (`sastrugi_numeric::sums::finite`). Nothing here
//! draws a random number except from the stream it is given, and the bits do not depend on the CPU.

pub mod bootstrap;
pub mod components;
pub mod correlation;
pub mod incidence;
pub mod multiple;
pub mod normal;
pub mod summary;

pub use bootstrap::{Interval, cluster_interval};
pub use components::Components;
pub use incidence::{Ending, Incidence};
pub use multiple::holm;
pub use summary::BoxPlot;
