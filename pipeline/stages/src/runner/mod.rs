//! The runner: graph of items, cache by key, execution, shards, assembly.
//!
//! 1. A [`graph::Graph`] holds the items of a study ([`crate::loaded::load`]), parents before children, each with its key.
//! 2. [`plan::plan`] compares them with a work area, a [`cache::Cache`], and says what a run would compute, and why.
//! 3. [`execute::execute`] runs what is missing, in parallel as far as workers and memory allow. What a [shared cache](shared) has is copied.
//! 4. [`shard::write`] keeps the part of one machine, and [`shard::join`] merges the parts; [`division::divide`] says what each part costs.
//! 5. [`assemble::assemble`] seals the results in a release, with the merged tables ([`tables::Fragments`]).
//!
//! ```
//! use sastrugi_stages::job::ItemRef;
//! use sastrugi_stages::loaded::load_text;
//! use sastrugi_stages::runner::cache::Cache;
//! use sastrugi_stages::runner::execute::{Limits, execute};
//! use sastrugi_stages::runner::plan::plan;
//! use sastrugi_stages::runner::progress::Silent;
//! use std::path::Path;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let study = r#"
//!     [study]
//!     name = "example"
//!     seed = 1
//!     date = "2026-01-01"
//!
//!     [[terrain]]
//!     id = "waves"
//!     kind = "weierstrass_mandelbrot"
//!     size_px = [32, 32]
//!     cell_m = 0.05
//! "#;
//! let graph = load_text(study, "study.toml", Path::new(""))?.graph;
//! let terrain = graph.find(&ItemRef::new("terrain", "waves")).ok_or("the terrain is missing")?;
//! let needed = graph.closure([terrain]);
//!
//! let folder = tempfile::tempdir()?;
//! let cache = Cache::open(folder.path())?;
//! assert_eq!(plan(&graph, &needed, &cache).stale[0].reason, "new");
//!
//! let limits = Limits { workers: 2, memory_bytes: 1 << 30, beyond: true };
//! let execution = execute(&graph, &cache, &needed, limits, &Silent).map_err(|stopped| stopped.error)?;
//! assert!(execution.done == needed && execution.failures.is_empty());
//! // The result is kept under its key, so a second run has nothing to do.
//! assert_eq!(plan(&graph, &needed, &cache).ready, 1);
//! # Ok(())
//! # }
//! ```

pub mod assemble;
pub mod cache;
pub mod damage;
pub mod division;
pub mod execute;
pub mod graph;
mod lock;
pub mod plan;
pub mod progress;
pub mod shard;
pub mod shared;
pub mod tables;

#[cfg(test)]
mod tests;
