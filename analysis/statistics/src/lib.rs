//! Arrays in, numbers out: summaries, the normal distribution, correlation, bootstrap intervals.
//!
//! Values that are not finite are not data: callers drop them first (`sastrugi_numeric::sums::finite`). Nothing here
//! draws a random number except from the stream it is given, and the bits do not depend on the CPU.

pub mod bootstrap;
pub mod correlation;
pub mod multiple;
pub mod normal;
pub mod summary;

pub use bootstrap::{Interval, cluster_median};
pub use multiple::holm;
pub use summary::BoxPlot;
