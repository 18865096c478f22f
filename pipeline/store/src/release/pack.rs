//! A release as one tar archive whose bytes follow from the release's files and date alone: files in order of their paths,
//! below a folder with the study's name, mode 644, owner and group 0, one date. Written with GNU headers, whose sizes know no
//! bound that matters; a name of more than 100 bytes has an entry of its own before it.

use super::{MANIFEST, Release, ReleaseError, SUMS};
use crate::atomic::AtomicFile;
use crate::digest::Hashed;
use std::io::{Read, Write};
use std::path::Path;

/// An archive that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packed {
    /// Files in it.
    pub files: u64,
    /// Its length, bytes.
    pub bytes: u64,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Writes a release that was found whole ([`super::verify`]) to the archive `target`; `time_s` is the date of every file, s
/// since 1970-01-01 UTC. Calls `added` with the path and the bytes of every file.
///
/// # Errors
/// [`ReleaseError::Changed`] for a file that is no longer the one that was sealed; the file system failed. There is no new
/// archive then.
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
