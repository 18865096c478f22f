//! Verification of a release against its own checksums, manifest and table descriptions.

use super::builder::write_sums;
use super::{MANIFEST, ReleaseError, STUDY, SUMS, check_path, parse_manifest, table_of};
use crate::digest;
use crate::parquet::check_table;
use rayon::prelude::*;
use sastrugi_schemas::manifest::{Artifact, Manifest};
use sastrugi_schemas::{counted, tables};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::io;
use std::path::Path;

/// Result of [`verify`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VerifyReport {
    /// Files checked.
    pub files: u64,
    /// Bytes checked.
    pub bytes: u64,
    /// Problems by path; empty for an intact release.
    pub problems: Vec<Problem>,
}

/// A problem with a file of a release.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Problem {
    /// Path in the release.
    pub path: String,
    /// Kind of problem.
    pub kind: ProblemKind,
    /// Sentence fragment with the offending values.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path, self.message)
    }
}

/// Kinds of problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ProblemKind {
    /// Listed, but missing.
    Missing,
    /// Present, but not listed.
    Extra,
    /// Size differs from the listed one.
    Size,
    /// Hash differs from the listed one.
    Checksum,
    /// A table with different columns, types, units or number of rows.
    Table,
    /// Manifest and checksums contradict each other, or cannot be read.
    Inconsistent,
}

/// Checks every file of a release: checksums, missing and extra files, sizes, columns and row counts of tables, that manifest and checksums
/// agree, and that the study and the tables are of the study that the manifest states.
///
/// # Errors
/// [`ReleaseError::NotARelease`] if the folder has neither manifest nor checksums; the file system failed.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_schemas::manifest::Origin;
/// use sastrugi_store::digest;
/// use sastrugi_store::release::{Head, ProblemKind, ReleaseBuilder, verify};
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
/// builder.write_text("README.md", "# Demo\n", Origin::default())?;
/// builder.write_text("study.toml", study, Origin::default())?;
/// builder.seal(&dest)?;
/// assert_eq!(verify(&dest)?.problems, []);
///
/// std::fs::write(dest.join("README.md"), "# Fake\n")?;
/// let problems = verify(&dest)?.problems;
/// assert_eq!((problems[0].path.as_str(), problems[0].kind), ("README.md", ProblemKind::Checksum));
/// # Ok(())
/// # }
/// ```
pub fn verify(folder: &Path) -> Result<VerifyReport, ReleaseError> {
    check_lists(folder)?;
    let manifest_text = read_if_there(&folder.join(MANIFEST))?;
    let sums_text = read_if_there(&folder.join(SUMS))?;
    let mut report = VerifyReport::default();
    let mut problem = |path: &str, kind, message: String| {
        report.problems.push(Problem { path: path.to_owned(), kind, message });
    };
    for (name, text) in [(MANIFEST, &manifest_text), (SUMS, &sums_text)] {
        if text.is_none() {
            problem(name, ProblemKind::Missing, "the file is missing".to_owned());
        }
    }
    let manifest = manifest_text.as_deref().and_then(|text| match parse_manifest(text) {
        Ok(manifest) => Some(manifest),
        Err(reason) => {
            problem(MANIFEST, ProblemKind::Inconsistent, reason);
            None
        }
    });
    let mut listed = sums_text.as_deref().map(parse_sums).unwrap_or_default();
    listed.retain(|path, _| match check_path(path) {
        Err(_) if path != MANIFEST => {
            problem(SUMS, ProblemKind::Inconsistent, format!("lists \"{path}\", which cannot be a file of a release"));
            false
        }
        _ => true,
    });
    if let (Some(manifest), Some(bytes), Some(text)) = (&manifest, &manifest_text, &sums_text)
        && sums_of(manifest, &digest::of_bytes(bytes)).ok().as_ref() != Some(text)
    {
        problem(SUMS, ProblemKind::Inconsistent, format!("does not match {MANIFEST} line by line"));
    }
    if let Some(message) = manifest.as_ref().and_then(other_study) {
        problem(STUDY, ProblemKind::Inconsistent, message);
    }

    let there = files_of(folder)?;
    let artifacts = expected(manifest.as_ref(), &listed);
    let names: BTreeSet<&str> = artifacts.keys().copied().chain([MANIFEST, SUMS]).collect();
    for path in there.iter().filter(|path| !names.contains(path.as_str())) {
        let what = if path.ends_with('/') { "the folder is empty" } else { "the file is not listed in the manifest" };
        problem(path, ProblemKind::Extra, what.to_owned());
    }
    let checks: Vec<(u64, Option<Problem>)> =
        artifacts.par_iter().map(|(path, expected)| check(folder, path, expected)).collect::<Result<_, _>>()?;
    report.files = checks.len() as u64;
    report.bytes = checks.iter().map(|(bytes, _)| bytes).sum();
    report.problems.extend(checks.into_iter().filter_map(|(_, problem)| problem));
    report.problems.sort();
    Ok(report)
}

/// What is wrong with the study of a release if it is not the one that the manifest states.
fn other_study(manifest: &Manifest) -> Option<String> {
    let listed = manifest.artifacts.iter().find(|artifact| artifact.path == STUDY);
    let stated = stated_study(&manifest.study_sha256);
    match listed {
        None => Some(format!("is not listed, but {stated}")),
        Some(study) if study.sha256 == manifest.study_sha256 => None,
        Some(study) => Some(format!("has SHA-256 {}, but {stated}", study.sha256)),
    }
}

fn stated_study(sha256: &str) -> String {
    format!("`study_sha256` in {MANIFEST} is {sha256}")
}

/// Refuses a folder with neither manifest nor checksums, where there is nothing to verify.
///
/// # Errors
/// [`ReleaseError::NotARelease`] for such a folder; the file system failed.
pub fn check_lists(folder: &Path) -> Result<(), ReleaseError> {
    let is_there = |name: &str| if_there(&folder.join(name), Path::metadata).map(|found| found.is_some());
    if is_there(MANIFEST)? || is_there(SUMS)? {
        return Ok(());
    }
    Err(ReleaseError::not_a_release(folder, format!("it has neither {MANIFEST} nor {SUMS}")))
}

fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>, ReleaseError> {
    if_there(path, crate::file::read)
}

/// What `read` finds at a path; `None` if nothing is there.
fn if_there<T>(path: &Path, read: impl FnOnce(&Path) -> io::Result<T>) -> Result<Option<T>, ReleaseError> {
    match read(path) {
        Ok(found) => Ok(Some(found)),
        Err(e) if matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => Ok(None),
        Err(e) => Err(ReleaseError::io(path)(e)),
    }
}

/// The bytes of `SHA256SUMS` for a manifest.
pub(super) fn sums_of(manifest: &Manifest, manifest_sha256: &str) -> io::Result<Vec<u8>> {
    let files = manifest.artifacts.iter().map(|artifact| (artifact.path.as_str(), artifact.sha256.as_str()));
    let mut text = Vec::new();
    write_sums(&mut text, files, manifest_sha256)?;
    Ok(text)
}

/// Hash by path; malformed lines are left to the comparison with the manifest.
fn parse_sums(text: &[u8]) -> BTreeMap<String, String> {
    let text = String::from_utf8_lossy(text);
    text.lines().filter_map(|line| line.split_once("  ")).map(|(sha, path)| (path.to_owned(), sha.to_owned())).collect()
}

/// What a file is compared with; the rest of its manifest entry, such as its parents, is much longer.
struct Expected<'a> {
    /// Size; unknown for a file that only the checksums list.
    bytes: Option<u64>,
    sha256: &'a str,
    /// Number of rows, if it is a table.
    records: Option<u64>,
    /// The study that the manifest states.
    study_sha256: Option<&'a str>,
}

/// Expected files by path: those of the manifest, or of the checksums if the manifest is missing. The manifest's own line, which only the
/// checksums have, is included.
fn expected<'a>(
    manifest: Option<&'a Manifest>,
    listed: &'a BTreeMap<String, String>,
) -> BTreeMap<&'a str, Expected<'a>> {
    let of_sums = |(path, sha256): (&'a String, &'a String)| {
        (path.as_str(), Expected { bytes: None, sha256: sha256.as_str(), records: None, study_sha256: None })
    };
    let study_sha256 = manifest.map(|manifest| manifest.study_sha256.as_str());
    let of_artifact = |a: &'a Artifact| {
        let (bytes, sha256, records) = (Some(a.bytes), a.sha256.as_str(), a.origin.records);
        (a.path.as_str(), Expected { bytes, sha256, records, study_sha256 })
    };
    match manifest {
        Some(manifest) => {
            let own = listed.get_key_value(MANIFEST).map(of_sums);
            manifest.artifacts.iter().map(of_artifact).chain(own).collect()
        }
        None => listed.iter().filter(|(path, _)| *path != MANIFEST).map(of_sums).collect(),
    }
}

/// Checks one file; returns its size and the first problem found.
fn check(folder: &Path, name: &str, expected: &Expected<'_>) -> Result<(u64, Option<Problem>), ReleaseError> {
    let path = folder.join(name);
    let problem = |kind, message| Some(Problem { path: name.to_owned(), kind, message });
    let size = match fs::symlink_metadata(&path) {
        Ok(found) if found.is_file() => found.len(),
        Ok(_) => return Ok((0, problem(ProblemKind::Missing, "is not a regular file".to_owned()))),
        Err(e) if matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
            return Ok((0, problem(ProblemKind::Missing, "the file is missing".to_owned())));
        }
        Err(e) => return Err(ReleaseError::io(&path)(e)),
    };
    if let Some(bytes) = expected.bytes.filter(|bytes| *bytes != size) {
        let message = format!("has {}, expected {bytes}", counted(size, "byte"));
        return Ok((size, problem(ProblemKind::Size, message)));
    }
    let (_, sha256) = digest::of_file(&path).map_err(ReleaseError::io(&path))?;
    if sha256 != expected.sha256 {
        let message = format!("has SHA-256 {sha256}, expected {}", expected.sha256);
        return Ok((size, problem(ProblemKind::Checksum, message)));
    }
    let table = check_rows(&path, name, expected).err();
    Ok((size, table.and_then(|(kind, message)| problem(kind, message))))
}

/// Checks a table's columns, its number of rows, and the study that it was made from.
fn check_rows(path: &Path, name: &str, expected: &Expected<'_>) -> Result<(), (ProblemKind, String)> {
    let Some(name) = table_of(name) else { return Ok(()) };
    let wrong = |message: String| (ProblemKind::Table, message);
    let table = tables::by_name(name).ok_or_else(|| wrong(format!("table {name} does not exist in this version")))?;
    let found = check_table(path, table).map_err(|e| wrong(e.to_string()))?;
    if let Some(rows) = expected.records.filter(|rows| *rows != found.rows) {
        return Err(wrong(format!("has {}, expected {rows}", counted(found.rows, "row"))));
    }
    match (expected.study_sha256, found.study_sha256) {
        (Some(stated), Some(own)) if own != stated => {
            let message = format!("was made from the study with SHA-256 {own}, but {}", stated_study(stated));
            Err((ProblemKind::Inconsistent, message))
        }
        (Some(stated), None) => {
            Err((ProblemKind::Inconsistent, format!("does not state its study, but {}", stated_study(stated))))
        }
        _ => Ok(()),
    }
}

/// Paths of all files below a folder, with `/` between folders, and of empty folders, with a trailing `/`.
fn files_of(folder: &Path) -> Result<BTreeSet<String>, ReleaseError> {
    let mut files = BTreeSet::new();
    let mut folders = vec![(folder.to_owned(), String::new())];
    while let Some((folder, prefix)) = folders.pop() {
        let mut is_empty = true;
        for entry in fs::read_dir(&folder).map_err(ReleaseError::io(&folder))? {
            is_empty = false;
            let entry = entry.map_err(ReleaseError::io(&folder))?;
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            let kind = entry.file_type().map_err(ReleaseError::io(&folder))?;
            if kind.is_dir() {
                folders.push((entry.path(), format!("{name}/")));
            } else {
                files.insert(name);
            }
        }
        if is_empty && !prefix.is_empty() {
            files.insert(prefix);
        }
    }
    Ok(files)
}
