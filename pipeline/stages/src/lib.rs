//! From a study to a release: one job per stage (glue between kernels and files), the study reader, the runner with its
//! cache and shards, and the verbs that work on single files.
//!
//! From a study to a release:
//!
//! 1. [`loaded::load`] reads the TOML file, checks it against the schemas of its sections ([`registry::SECTIONS`]), and adds the items of
//!    each table to a [graph](runner::graph). All errors are reported at once, with their places in the text ([`Error::Study`]).
//! 2. [`studies::plan_of`] compares the keys of the items with the work area: what would be computed, and why.
//! 3. [`studies::run`] computes the missing items, each in a folder of its own in the work area, and assembles their files, the tables, the
//!    report and the manifest into a release.
//! 4. [`studies::merge`] does the last step for shards; [`verification::verify`] checks a release, and [`packing::pack`] packs it into one
//!    file; [`remote`] keeps releases in an object store.
//!
//! [`verbs`] do the same work for single files, [`arrays`] for surfaces in memory. Nothing here prints: a run reports to a
//! [`runner::progress::Progress`].
//!
//! # Example
//!
//! Two terrains, from the text of a study to a release. Running it again computes nothing.
//!
//! ```
//! use sastrugi_stages::loaded::load_text;
//! use sastrugi_stages::runner::execute::Limits;
//! use sastrugi_stages::runner::progress::Silent;
//! use sastrugi_stages::studies::{RunRequest, plan_of, run};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"
//! [study]
//! name = "two-hills"
//! seed = 7
//! date = "2026-01-01"
//!
//! [[terrain]]
//! id = "hill"
//! kind = "multifractal"
//! count = 2
//! size_px = [90, 70]
//! "#;
//! let folder = tempfile::tempdir()?;
//! let release = folder.path().join("release");
//! let loaded = load_text(text, "study.toml", folder.path())?;
//!
//! // Every terrain is made, and described in the tables.
//! let plan = plan_of(&loaded, &release, None, None)?;
//! assert_eq!((plan.items, plan.ready), (4, 0));
//! assert!(plan.stale.iter().any(|stale| stale.item == "terrain/hill-0002" && stale.reason == "new"));
//!
//! let limits = Limits { workers: 2, memory_bytes: 1 << 30, beyond: true };
//! let request =
//!     RunRequest { output: &release, work: None, part: None, purpose: None, replace: false, limits };
//! let summary = run(&loaded, &request, &Silent)?;
//! assert_eq!((summary.computed, summary.failures.len()), (4, 0));
//! for file in ["manifest.json", "SHA256SUMS", "terrain/hill-0001.tif", "terrain/hill-0002.tif"] {
//!     assert!(release.join(file).is_file(), "{file}");
//! }
//!
//! let again = plan_of(&loaded, &release, None, None)?;
//! assert_eq!((again.ready, again.stale.len()), (4, 0));
//! # Ok(())
//! # }
//! ```

pub mod arrays;
mod builder;
mod documents;
mod error;
mod hypotheses;
pub mod job;
pub mod jobs;
pub mod loaded;
mod machine;
mod memory;
pub mod operations;
pub mod packing;
pub mod registry;
pub mod remote;
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
