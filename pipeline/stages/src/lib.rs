//! From a study to a release: one job per stage (glue between kernels and files), the study reader, the runner with its
//! cache and shards, and the verbs that work on single files.

mod builder;
mod documents;
mod error;
mod hypotheses;
pub mod job;
pub mod jobs;
pub mod loaded;
mod machine;
pub mod operations;
pub mod packing;
pub mod registry;
mod revision;
pub mod runner;
pub mod schema;
pub mod splits;
pub mod starting;
pub mod studies;
pub mod study;
pub mod verbs;
pub mod verification;

pub use error::Error;
