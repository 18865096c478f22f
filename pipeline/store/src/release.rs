//! The release folder: assembled in a temporary folder, sealed with a manifest and checksums, published by one rename, and verified.

mod builder;
mod listed;
mod manifest;
mod pack;
mod verify;

#[cfg(test)]
mod tests;

pub(crate) use builder::sync_tree;
pub use builder::{Head, Incoming, PartWriter, ReleaseBuilder, Staging, TablePart, behind_link, beside, may_be_one};
pub use listed::Listed;
pub use manifest::for_each_artifact;
pub use pack::{Packed, pack};
pub use verify::{Problem, ProblemKind, VerifyReport, check_lists, verify};

use crate::digest;
use crate::parquet::{self, TableError};
use sastrugi_schemas::Record;
use sastrugi_schemas::manifest::{Artifact, FORMAT, Manifest, PROGRAM};
use sastrugi_schemas::tables::in_order;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the manifest in a release.
pub const MANIFEST: &str = "manifest.json";
/// Name of the list of checksums in a release, in the format of `sha256sum`.
pub const SUMS: &str = "SHA256SUMS";
/// File that marks a folder as one shard of a release.
pub const SHARD: &str = "shard.json";
/// Folder of the tables in a release.
pub const TABLES: &str = "tables";

/// File of the study in a release.
pub const STUDY: &str = "study.toml";

/// The only hidden file of a release: the metadata that an archive requires on deposit.
pub const ZENODO: &str = ".zenodo.json";

/// Failure to create, open or verify a release.
#[derive(Debug, thiserror::Error)]
pub enum ReleaseError {
    /// The folder is missing or has neither manifest nor checksums.
    #[error("{}: not a sastrugi release: {reason}", path.display())]
    NotARelease {
        /// The folder.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// The destination holds files that do not belong to a release, and is left untouched.
    #[error("{}: the folder is not empty and not a sastrugi release; choose another folder with -o", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// A path is not allowed in a release.
    #[error("\"{path}\" cannot be a file of a release: {reason}")]
    Path {
        /// The path.
        path: String,
        /// Why.
        reason: &'static str,
    },
    /// A file of the release has changed since it was sealed.
    #[error("{}: the file has changed since the release was sealed; `verify` lists all changes", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// A table could not be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The manifest could not be written as JSON.
    #[error("could not write the manifest: {0}")]
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
    /// True if the cause is the given data (missing or unusable), not the file system.
    pub fn unusable_input(&self) -> bool {
        match self {
            Self::NotARelease { .. } | Self::Changed { .. } => true,
            Self::Table(error) => error.unusable_input(),
            // A file that is missing, or a folder, pipe or device in its place.
            Self::Io { source, .. } => matches!(
                source.kind(),
                io::ErrorKind::NotFound | io::ErrorKind::IsADirectory | io::ErrorKind::InvalidInput
            ),
            Self::Occupied { .. } | Self::Path { .. } | Self::Json(_) => false,
        }
    }

    pub(crate) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    fn not_a_release(path: &Path, reason: impl Into<String>) -> Self {
        let reason = match path.metadata() {
            Err(_) => "no such folder".to_owned(),
            Ok(found) if !found.is_dir() => "it is a file, not a folder".to_owned(),
            Ok(_) if path.join(SHARD).is_file() => {
                "it is one shard of a release; merge the shards first: `sastrugi merge SHARD... -o RELEASE`".to_owned()
            }
            Ok(_) => reason.into(),
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
    /// [`ReleaseError::NotARelease`] if the folder has no sastrugi manifest, or if that lists an invalid path, a path twice, or paths out of
    /// order.
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// use sastrugi_schemas::manifest::Origin;
    /// use sastrugi_schemas::tables::MissionRow;
    /// use sastrugi_store::digest;
    /// use sastrugi_store::release::{Head, Release, ReleaseBuilder};
    ///
    /// let folder = tempfile::tempdir()?;
    /// let dest = folder.path().join("demo");
    /// let study = "[study]\n";
    /// let head = Head {
    ///     name: "demo".to_owned(),
    ///     study_sha256: digest::of_bytes(study.as_bytes()),
    ///     seed: 7,
    ///     version: "0.1.0".to_owned(),
    ///     license: "CC-BY-4.0".to_owned(),
    /// };
    /// let mut builder = ReleaseBuilder::beside(&dest, head)?;
    /// builder.write_text("study.toml", study, Origin::default())?;
    /// builder.seal(&dest)?;
    ///
    /// let release = Release::open(&dest)?;
    /// assert_eq!((release.manifest().name.as_str(), release.manifest().seed), ("demo", 7));
    /// assert_eq!(std::fs::read_to_string(release.sealed("study.toml")?)?, study);
    /// // Nothing was driven.
    /// assert!(release.rows::<MissionRow>()?.is_empty());
    /// # Ok(())
    /// # }
    /// ```
    pub fn open(folder: &Path) -> Result<Self, ReleaseError> {
        let path = folder.join(MANIFEST);
        let text = crate::file::read(&path).map_err(unread(folder, &path))?;
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

    /// Path of a file listed in the manifest.
    pub fn path(&self, artifact: &str) -> PathBuf {
        self.folder.join(artifact)
    }

    /// The files of a table, sorted; none if the table has no rows.
    pub fn table_files(&self, table: &str) -> Vec<PathBuf> {
        self.parts(table).map(|artifact| self.path(&artifact.path)).collect()
    }

    fn parts(&self, table: &str) -> impl Iterator<Item = &Artifact> {
        self.manifest.artifacts.iter().filter(move |artifact| table_of(&artifact.path) == Some(table))
    }

    /// All rows of a table, sorted by key.
    ///
    /// # Errors
    /// A file cannot be read, has changed since it was sealed, or has different columns.
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

    /// The files of a table, sorted; each is checked as the iterator reaches it.
    ///
    /// # Errors
    /// A file cannot be read, or has changed since it was sealed.
    pub fn sealed_parts(&self, table: &str) -> impl Iterator<Item = Result<PathBuf, ReleaseError>> {
        self.parts(table).map(|part| self.unchanged(part))
    }

    /// A file listed in the manifest, checked.
    ///
    /// # Errors
    /// The manifest does not list it, it cannot be read, or it has changed since it was sealed.
    pub fn sealed(&self, path: &str) -> Result<PathBuf, ReleaseError> {
        match self.manifest.artifacts.iter().find(|artifact| artifact.path == path) {
            Some(artifact) => self.unchanged(artifact),
            None => Err(ReleaseError::not_a_release(&self.folder, format!("{MANIFEST} does not list \"{path}\""))),
        }
    }

    fn unchanged(&self, artifact: &Artifact) -> Result<PathBuf, ReleaseError> {
        let file = self.path(&artifact.path);
        let (_, sha256) = digest::of_file(&file).map_err(ReleaseError::io(&file))?;
        if sha256 == artifact.sha256 { Ok(file) } else { Err(ReleaseError::Changed { path: file }) }
    }
}

/// The error for a manifest that cannot be read.
fn unread(folder: &Path, path: &Path) -> impl FnOnce(io::Error) -> ReleaseError {
    move |e| match e.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            ReleaseError::not_a_release(folder, format!("it has no {MANIFEST}"))
        }
        _ => ReleaseError::io(path)(e),
    }
}

fn parse_manifest(bytes: &[u8]) -> Result<Manifest, String> {
    let manifest: Manifest = serde_json::from_slice(bytes).map_err(|e| format!("{MANIFEST} cannot be parsed: {e}"))?;
    check_head(&manifest)?;
    let mut before = "";
    for Artifact { path, .. } in &manifest.artifacts {
        check_listed(path, before).map_err(|reason| format!("{MANIFEST} {reason}"))?;
        before = path;
    }
    Ok(manifest)
}

/// Checks a path of a manifest's list of files, given the one before it. Files are sorted by path, so one that is listed twice shows without
/// a set of all.
fn check_listed(path: &str, before: &str) -> Result<(), String> {
    check_path(path).map_err(|e| format!("lists an invalid path: {e}"))?;
    if path <= before { Err(format!("lists \"{path}\" twice or out of order")) } else { Ok(()) }
}

/// Checks a manifest except for its list of files.
fn check_head(manifest: &Manifest) -> Result<(), String> {
    let Manifest { program, format, name, .. } = manifest;
    if program != PROGRAM || *format != FORMAT {
        return Err(format!("{MANIFEST} is of {program} format {format}, expected {PROGRAM} format {FORMAT}"));
    }
    check_path(name).map_err(|e| format!("{MANIFEST} has an invalid study name: {e}"))
}

/// Name of the table that a path belongs to.
fn table_of(path: &str) -> Option<&str> {
    let rest = path.strip_prefix(TABLES)?.strip_prefix('/')?;
    let (table, file) = rest.split_once('/')?;
    file.ends_with(".parquet").then_some(table)
}

/// Refuses a path that would leave the release, or that `sha256sum` would have to escape.
///
/// # Errors
/// [`ReleaseError::Path`] with the reason.
pub fn check_path(path: &str) -> Result<(), ReleaseError> {
    let refuse = |reason| Err(ReleaseError::Path { path: path.to_owned(), reason });
    if path == MANIFEST || path == SUMS {
        return refuse("the name is reserved");
    }
    if path.chars().any(|c| c.is_control() || c == '\\') {
        return refuse("it contains a control character or backslash");
    }
    if path != ZENODO && path.split('/').any(|part| part.is_empty() || part.starts_with('.')) {
        return refuse("it contains an empty or hidden component");
    }
    Ok(())
}
