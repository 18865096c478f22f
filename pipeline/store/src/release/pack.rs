//! A release as one tar archive whose bytes depend only on the release's files and date: files in order of their paths, below a
//! folder with the study's name, mode 644, owner and group 0, one date. Uses GNU headers, which have no relevant size limit; a
//! name of more than 100 bytes is stored in an entry of its own before the file.

use super::{MANIFEST, Release, ReleaseError, SUMS};
use crate::atomic::AtomicFile;
use crate::digest::Hashed;
use std::io::{Read, Write};
use std::path::Path;

/// Summary of a written archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packed {
    /// Number of files.
    pub files: u64,
    /// Length, bytes.
    pub bytes: u64,
    /// SHA-256 of the archive.
    pub sha256: String,
}

/// Writes a verified release ([`super::verify`]) to the archive `target`; `time_s` is the date of every file, s since 1970-01-01
/// UTC. Calls `added` with the path and length of every file.
///
/// # Errors
/// [`ReleaseError::Changed`] for a file that has changed since it was sealed; the file system failed. No archive is written
/// in either case.
pub fn pack(release: &Release, target: &Path, time_s: u64, added: &dyn Fn(&str, u64)) -> Result<Packed, ReleaseError> {
    let artifacts = release.manifest.artifacts.iter().map(|a| (a.path.as_str(), Some(a.sha256.as_str())));
    let mut files: Vec<(&str, Option<&str>)> = artifacts.chain([(MANIFEST, None), (SUMS, None)]).collect();
    files.sort_unstable();
    let file = AtomicFile::create(target).map_err(ReleaseError::io(target))?;
    let mut archive = tar::Builder::new(Hashed::new(file));
    for &(path, sealed) in &files {
        let place = format!("{}/{path}", release.manifest.name);
        let (bytes, sha256) = append(&mut archive, &release.path(path), &place, time_s, target)?;
        if sealed.is_some_and(|sealed| sealed != sha256) {
            return Err(ReleaseError::Changed { path: release.path(path) });
        }
        added(path, bytes);
    }
    let (file, bytes, sha256) = archive.into_inner().map_err(ReleaseError::io(target))?.finish();
    file.commit().map_err(ReleaseError::io(target))?;
    Ok(Packed { files: files.len() as u64, bytes, sha256 })
}

/// Adds one file; returns its length and hash.
fn append(
    archive: &mut tar::Builder<impl Write>,
    source: &Path,
    place: &str,
    time_s: u64,
    target: &Path,
) -> Result<(u64, String), ReleaseError> {
    let file = crate::file::open(source).map_err(ReleaseError::io(source))?;
    let length = file.metadata().map_err(ReleaseError::io(source))?.len();
    let mut header = tar::Header::new_gnu();
    header.set_entry_type(tar::EntryType::Regular);
    header.set_mode(0o644);
    header.set_uid(0);
    header.set_gid(0);
    header.set_mtime(time_s);
    header.set_size(length);
    let mut content = Hashed::new(file.take(length));
    archive.append_data(&mut header, place, &mut content).map_err(ReleaseError::io(target))?;
    let (_, bytes, sha256) = content.finish();
    if bytes == length { Ok((bytes, sha256)) } else { Err(ReleaseError::Changed { path: source.to_owned() }) }
}
