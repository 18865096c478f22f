//! The report of a release: one self-contained HTML page that needs no network, every figure as an SVG file, and the
//! numbers behind every figure as JSON.
//!
//! [`render`](fn@render) and [`render_with`] write a report:
//!
//! 1. [`data::Data::open`] reads the tables of the release; rasters and samples follow when a figure needs them. Of the tables that grow with
//!    the missions and terrains it keeps what statistics need.
//! 2. Each question of [`questions::ALL`] answers with [`content::Block`]s: text, figures and tables with their
//!    [`content::Numbers`], and the query that returns these numbers. A question without data has no section. The summary repeats their results.
//! 3. [`render::html::page`](render::html::page()) lays out the page; every figure also goes to `figures/*.svg`, its
//!    numbers to `data/*.json`.
//! 4. The folder is completed under another name and put in place at the end, so that a report is complete or absent.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let [release, report] = ["release", "report"].map(|name| folder.path().join(name));
//! std::fs::create_dir(&release)?;
//! std::fs::write(release.join("study.toml"), "[study]\nname = \"snow\"\ntitle = \"Snow & ice\"\nseed = 7\n")?;
//!
//! let summary = sastrugi_report::render(&release, &report, &|step| println!("{step}"))?;
//! let page = std::fs::read_to_string(report.join("index.html"))?;
//! assert!(page.contains("<h1>Snow &amp; ice</h1>"));
//! // Nothing was measured, generated or driven: a head without sections, figures and numbers.
//! assert!(!page.contains("<section"));
//! assert_eq!((summary.files.len(), summary.bytes), (1, page.len() as u64));
//! # Ok(())
//! # }
//! ```
//!
//! Modules and other pictures:
//!
//! * [`questions`]: one folder per question that the page answers (query, figure, table), listed in one registry.
//! * [`papers`]: published values as data.
//! * [`releases`]: comparison of two releases, for the page and for the verb `compare`.
//! * [`fit_svg`] and [`fit_png`]: the picture of one fit file, for the verb `fit`.
//! * [`RoutePicture`]: the picture of one route, for the verb `navigate`.
//! * [`mod@render`]: drawing, independent of what is drawn.
//! * [`data`]: the only access to the release's rows and files.
//! * [`mod@sample`]: random samples of what is too much to draw or to list; the page says where it shows one.
//!
//! No kernel runs here: spectra, histograms, covariances, backgrounds, residuals, images and class maps are read as a stage
//! stored them. Shading and rendering a thinned relief, and differencing two stored rasters on the cells of one, count as
//! drawing. Medians and intervals come from `sastrugi-statistics`. The same release gives the same bytes: this crate reads no
//! clock, and its output does not depend on threads.

pub mod content;
pub mod data;
pub mod papers;
pub mod questions;
pub mod releases;
pub mod render;
pub mod sample;
#[cfg(test)]
mod tests;

mod fit_figure;
mod release;
mod route_figure;
mod write;

pub use fit_figure::{fit_png, fit_svg};
pub use route_figure::RoutePicture;
pub use write::{Summary, render, render_with};

use std::path::{Path, PathBuf};

/// Data with which the report compares a release.
#[derive(Clone, Debug, Default)]
pub struct Companions {
    /// Another release.
    pub against: Option<PathBuf>,
    /// Tables of analysed logs, as `sastrugi analyze -o` writes them.
    pub logs: Vec<PathBuf>,
}

/// Why a report could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder holds neither a study file nor tables.
    #[error("{path}: not a sastrugi release: {}", why_not_a_release(path))]
    NotARelease {
        /// The folder.
        path: PathBuf,
    },
    /// The folder is one shard of a release.
    #[error("{path} is one shard of a release; merge the shards first: `sastrugi merge SHARD... -o RELEASE`")]
    Shard {
        /// The folder.
        path: PathBuf,
    },
    /// The output path is a file, or a folder that contains other files; it is left alone.
    #[error("{}; choose another folder with -o", occupied(path, file.as_deref()))]
    Occupied {
        /// The folder, or the file in its place.
        path: PathBuf,
        /// What is in the way in the folder; `None` if `path` is a file.
        file: Option<PathBuf>,
    },
    /// The report could not be moved into place.
    #[error(transparent)]
    Place(#[from] sastrugi_store::release::ReleaseError),
    /// A file could not be written.
    #[error("write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file of the release exists but cannot be read.
    #[error("read {path} of the release: {reason}")]
    Read {
        /// Path in the release.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The release to compare with exists but cannot be used.
    #[error("compare with the release {path}: {reason}")]
    Other {
        /// Its folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file is not a table of analysed logs.
    #[error("{reason}; `--logs` takes tables written by `sastrugi analyze -o LOGS.parquet`")]
    Logs {
        /// The file, and what is wrong with it.
        reason: String,
    },
    /// A picture could not be encoded.
    #[error("encode a picture: {0}")]
    Picture(#[from] png::EncodingError),
    /// A figure could not be rasterised.
    #[error("draw a figure as PNG: {0}")]
    Raster(String),
}

impl ReportError {
    /// True when the cause is a missing or unusable input, not the output folder.
    pub fn unusable_input(&self) -> bool {
        matches!(
            self,
            Self::NotARelease { .. } | Self::Shard { .. } | Self::Read { .. } | Self::Other { .. } | Self::Logs { .. }
        )
    }

    /// The same error, about the release to compare with.
    fn of_other(self, path: &Path) -> Self {
        match self {
            Self::Read { path: file, reason } => {
                Self::Other { path: path.to_owned(), reason: format!("{file}: {reason}") }
            }
            other => other,
        }
    }
}

/// Why a path is not a release.
fn why_not_a_release(path: &Path) -> &'static str {
    match path.metadata() {
        Err(_) => "no such folder",
        Ok(found) if !found.is_dir() => "it is a file, not a folder",
        Ok(_) => "it has neither study.toml nor tables/",
    }
}

/// What is in the way of a report.
fn occupied(path: &Path, file: Option<&Path>) -> String {
    match file {
        Some(file) => format!("{} contains {}, which is not part of a report", path.display(), file.display()),
        None => format!("{} is a file, not a folder", path.display()),
    }
}
