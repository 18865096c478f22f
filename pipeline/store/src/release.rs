//! The release folder: assembled aside, sealed with a manifest and checksums, given its name by one rename, and checked.

mod builder;
mod pack;
mod verify;

#[cfg(test)]
mod tests;

pub use builder::{Head, Incoming, PartWriter, ReleaseBuilder, Staging, TablePart, beside};
pub use pack::{Packed, pack};
pub use verify::{Problem, ProblemKind, VerifyReport, verify};

use crate::digest;
use crate::parquet::{self, TableError};
use sastrugi_schemas::Record;
use sastrugi_schemas::manifest::{Artifact, FORMAT, Manifest, PROGRAM};
use sastrugi_schemas::tables::in_order;
use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the manifest in a release.
pub const MANIFEST: &str = "manifest.json";
/// Name of the list of checksums in a release, in the form of `sha256sum`.
pub const SUMS: &str = "SHA256SUMS";
/// What a folder has that is one shard of a release.
pub const SHARD: &str = "shard.json";
/// Folder of the tables in a release.
pub const TABLES: &str = "tables";

/// The one hidden file of a release: what an archive asks for on deposit.
pub const ZENODO: &str = ".zenodo.json";

/// Why a release was not made, opened or checked.
#[derive(Debug, thiserror::Error)]
pub enum ReleaseError {
    /// The folder is missing or holds neither manifest nor checksums.
    #[error("{}: no release: {reason}", path.display())]
    NotARelease {
        /// The folder.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// The folder to write holds files that are not of a release, and is left alone.
    #[error("{}: not a sastrugi release, and not empty; choose another folder with -o", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// A path in the release is not usable.
    #[error("\"{path}\" cannot be a file of a release: {reason}")]
    Path {
        /// The path.
        path: String,
        /// Why.
        reason: &'static str,
    },
    /// A file of the release is not the one that was sealed.
    #[error("{}: the file is not the one that was sealed; `verify` lists what changed", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// A table could not be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The manifest could not be written as JSON.
    #[error("the manifest could not be written: {0}")]
    Json(#[from] serde_json::Error),
    /// The file system failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What failed.
        source: io::Error,
    },
}

impl ReleaseError {
    /// True when the data that was given is the cause (missing or unusable), not the file system.
    pub fn unusable_input(&self) -> bool {
        match self {
            Self::NotARelease { .. } | Self::Changed { .. } => true,
            Self::Table(error) => error.unusable_input(),
            Self::Io { source, .. } => source.kind() == io::ErrorKind::NotFound,
            Self::Occupied { .. } | Self::Path { .. } | Self::Json(_) => false,
        }
    }

    fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    fn not_a_release(path: &Path, reason: impl Into<String>) -> Self {
        let reason = match path.join(SHARD).is_file() {
            true => {
                "it is one shard of a release; join the shards first: `sastrugi merge SHARD... -o RELEASE`".to_owned()
            }
            false => reason.into(),
        };
        Self::NotARelease { path: path.to_owned(), reason }
    }
}

/// A sealed release.
#[derive(Clone, Debug)]
pub struct Release {
    folder: PathBuf,
    manifest: Manifest,
}

impl Release {
    /// Opens a release without checking its files (see [`verify`]).
    ///
    /// # Errors
    /// [`ReleaseError::NotARelease`] when the folder has no manifest of ours.
    pub fn open(folder: &Path) -> Result<Self, ReleaseError> {
        let path = folder.join(MANIFEST);
        let text = crate::file::read(&path).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                ReleaseError::not_a_release(folder, format!("there is no {MANIFEST} in it"))
            }
            _ => ReleaseError::io(&path)(e),
        })?;
        let manifest = parse_manifest(&text).map_err(|reason| ReleaseError::not_a_release(folder, reason))?;
        Ok(Self { folder: folder.to_owned(), manifest })
    }

    /// Its manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Where a file of the manifest lies.
    pub fn path(&self, artifact: &str) -> PathBuf {
        self.folder.join(artifact)
    }

    /// The files of a table, sorted; none when the table has no rows.
    pub fn table_files(&self, table: &str) -> Vec<PathBuf> {
        self.parts(table).map(|artifact| self.path(&artifact.path)).collect()
    }

    fn parts(&self, table: &str) -> impl Iterator<Item = &Artifact> {
        self.manifest.artifacts.iter().filter(move |artifact| table_of(&artifact.path) == Some(table))
    }

    /// All rows of a table, sorted by key.
    ///
    /// # Errors
    /// A file cannot be read, is not the one that was sealed, or has other columns.
    pub fn rows<R: Record>(&self) -> Result<Vec<R>, ReleaseError> {
        let mut rows = vec![];
        self.for_each_row(|row| rows.push(row))?;
        let several = self.parts(R::TABLE.name).nth(1).is_some();
        Ok(if several { in_order(rows) } else { rows })
    }

    /// Calls `f` with every row of a table, file by file.
    ///
    /// # Errors
    /// As [`Release::rows`].
    pub fn for_each_row<R: Record>(&self, mut f: impl FnMut(R)) -> Result<(), ReleaseError> {
        self.sealed_parts(R::TABLE.name).try_for_each(|file| Ok(parquet::for_each_row(&file?, &mut f)?))
    }

    /// The files of a table, sorted, each checked when it is its turn.
    ///
    /// # Errors
    /// A file cannot be read, or is not the one that was sealed.
    pub fn sealed_parts(&self, table: &str) -> impl Iterator<Item = Result<PathBuf, ReleaseError>> {
        self.parts(table).map(|part| {
            let file = self.path(&part.path);
            let (_, sha256) = digest::of_file(&file).map_err(ReleaseError::io(&file))?;
            if sha256 == part.sha256 { Ok(file) } else { Err(ReleaseError::Changed { path: file }) }
        })
    }
}

fn parse_manifest(bytes: &[u8]) -> Result<Manifest, String> {
    let manifest: Manifest = serde_json::from_slice(bytes).map_err(|e| format!("its {MANIFEST} is not ours: {e}"))?;
    if manifest.program != PROGRAM || manifest.format != FORMAT {
        return Err(format!("its {MANIFEST} is of {} format {}", manifest.program, manifest.format));
    }
    let mut paths = BTreeSet::new();
    for Artifact { path, .. } in &manifest.artifacts {
        check_path(path).map_err(|e| format!("its {MANIFEST} lists a file that cannot be one: {e}"))?;
        if !paths.insert(path) {
            return Err(format!("its {MANIFEST} lists \"{path}\" twice"));
        }
    }
    check_path(&manifest.name).map_err(|e| format!("its {MANIFEST} has a name that cannot be one: {e}"))?;
    Ok(manifest)
}

/// Name of the table that a path belongs to.
fn table_of(path: &str) -> Option<&str> {
    let rest = path.strip_prefix(TABLES)?.strip_prefix('/')?;
    let (table, file) = rest.split_once('/')?;
    file.ends_with(".parquet").then_some(table)
}

/// Refuses a path that would leave the release, or that `sha256sum` cannot list plainly.
///
/// # Errors
/// Why it cannot be a file of a release.
pub fn check_path(path: &str) -> Result<(), ReleaseError> {
    let refuse = |reason| Err(ReleaseError::Path { path: path.to_owned(), reason });
    if path == MANIFEST || path == SUMS {
        return refuse("the name is taken");
    }
    if path.chars().any(|c| c.is_control() || c == '\\') {
        return refuse("it has a control character or backslash");
    }
    if path != ZENODO && path.split('/').any(|part| part.is_empty() || part.starts_with('.')) {
        return refuse("it has an empty or hidden part");
    }
    Ok(())
}
