//! The report of a release: one self-contained HTML page that needs no network, every figure as an SVG file, and the
//! numbers behind every figure as JSON.
//!
//! * [`questions`]: one folder per question that the page answers (query, figure, table), listed in one registry.
//! * [`papers`]: published figures as data.
//! * [`releases`]: two releases beside each other, for the page and for the verb `compare`.
//! * [`fit_svg`] and [`fit_png`]: the picture of one fit file, for the verb `fit`.
//! * [`RoutePicture`]: that of one route, for the verb `navigate`.
//! * [`mod@render`]: drawing, which knows nothing of what it draws.
//! * [`data`]: the only way to the release's rows and files.
//!
//! No kernel runs here: spectra, histograms, covariances, backgrounds, residuals, images and class maps are read as a stage
//! stored them; shading and rendering a thinned relief, and the difference of two stored rasters on the cells of one, count as drawing. Medians and intervals come from `sastrugi-statistics`. The same release gives the same bytes:
//! there is no clock in this room, and threads change no byte.

pub mod content;
pub mod data;
pub mod papers;
pub mod questions;
pub mod releases;
pub mod render;
#[cfg(test)]
mod tests;

mod fit_figure;
mod release;
mod route_figure;
mod write;

pub use fit_figure::{fit_png, fit_svg};
pub use route_figure::RoutePicture;
pub use write::{Summary, render, render_with};

use std::path::PathBuf;

/// What a release is compared with in its report.
#[derive(Clone, Debug, Default)]
pub struct Companions {
    /// Another release.
    pub against: Option<PathBuf>,
    /// Tables of analysed logs, as `sastrugi analyze -o` writes them.
    pub logs: Vec<PathBuf>,
}

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder holds neither a study file nor tables.
    #[error("{path}: no release: there is neither study.toml nor tables/ in it")]
    NotARelease {
        /// The folder.
        path: PathBuf,
    },
    /// The folder is a part of a release.
    #[error("{path}: one shard of a release; join the shards first: `sastrugi merge SHARD... -o RELEASE`")]
    Shard {
        /// The folder.
        path: PathBuf,
    },
    /// The folder to write holds other files, and is left alone.
    #[error("{}: it holds {}, which is not of a report; choose another folder with -o", path.display(), file.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// What is in the way.
        file: PathBuf,
    },
    /// The report could not be given its name.
    #[error(transparent)]
    Place(#[from] sastrugi_store::release::ReleaseError),
    /// A file could not be written.
    #[error("write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file of the release is there but cannot be read.
    #[error("read {path} of the release: {reason}")]
    Read {
        /// Path in the release.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The release to compare with is there but cannot be used.
    #[error("{path}, which the release is compared with: {reason}")]
    Other {
        /// Its folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file is no table of analysed logs.
    #[error("{reason}; `--logs` takes the table `logs` that `sastrugi analyze -o LOGS.parquet` writes")]
    Logs {
        /// The file, and what is wrong with it.
        reason: String,
    },
    /// A picture could not be encoded.
    #[error("encode a picture: {0}")]
    Picture(#[from] png::EncodingError),
    /// A figure could not be drawn as pixels.
    #[error("draw a figure as PNG: {0}")]
    Raster(String),
}

impl ReportError {
    /// True when the release is the cause (missing or unusable), not the place of the report.
    pub fn unusable_input(&self) -> bool {
        matches!(
            self,
            Self::NotARelease { .. } | Self::Shard { .. } | Self::Read { .. } | Self::Other { .. } | Self::Logs { .. }
        )
    }

    /// The same about the release to compare with.
    fn of_other(self, path: &std::path::Path) -> Self {
        match self {
            Self::Read { path: file, reason } => {
                Self::Other { path: path.to_owned(), reason: format!("{file}: {reason}") }
            }
            other => other,
        }
    }
}
