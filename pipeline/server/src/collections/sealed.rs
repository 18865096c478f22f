//! Files of a release, checked against the checksums of its manifest.

use sastrugi_stages::verbs::served::SealedFile;
use sastrugi_store::digest;
use std::fs::Metadata;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// A file that is hashed again only after somebody has touched it.
pub struct Sealed {
    file: SealedFile,
    /// Stamp of the file when its content was last found to be that of the manifest.
    unchanged: Mutex<Option<Stamp>>,
}

impl Sealed {
    /// A file that has not been checked yet.
    pub fn new(file: SealedFile) -> Self {
        Self { file, unchanged: Mutex::new(None) }
    }

    /// Its checksum in the manifest.
    pub fn sha256(&self) -> &str {
        &self.file.sha256
    }

    /// Whether it has this name.
    pub fn is_named(&self, name: &str) -> bool {
        self.file.path.file_name().is_some_and(|own| own == name)
    }

    /// Its path, once its content is that of the manifest.
    ///
    /// # Errors
    /// As [`check`].
    pub fn path(&self) -> Result<&Path, String> {
        let path = self.file.path.as_path();
        let mut unchanged = self.unchanged.lock().unwrap_or_else(PoisonError::into_inner);
        // Taken before the file is hashed: a change in the meantime changes the stamp again.
        let now = path.metadata().map(|data| stamp(&data)).map_err(|e| unreadable(path, &e))?;
        if unchanged.as_ref() != Some(&now) {
            *unchanged = None;
            check(&self.file)?;
            *unchanged = Some(now);
        }
        Ok(path)
    }
}

/// Checks that a file has not changed since its release was sealed.
///
/// # Errors
/// A file that cannot be read or has changed, in words for clients.
pub fn check(file: &SealedFile) -> Result<(), String> {
    let (_, sha256) = digest::of_file(&file.path).map_err(|e| unreadable(&file.path, &e))?;
    if sha256 == file.sha256 {
        return Ok(());
    }
    tracing::warn!(path = %file.path.display(), "a file has changed since its release was sealed");
    Err(format!("{}: the file has changed since its release was sealed; run `sastrugi verify`", name(&file.path)))
}

/// Logs why a file cannot be read, and says so in words for clients.
pub fn unreadable(path: &Path, error: &dyn std::fmt::Display) -> String {
    tracing::warn!(path = %path.display(), %error, "cannot read a file of a release");
    format!("{}: the file cannot be read", name(path))
}

/// Name of a file with that of its folder, such as `terrain/hills.tif`: clients do not see where a release lies.
pub fn name(path: &Path) -> String {
    let last: Vec<_> = path.iter().rev().take(2).map(|part| part.to_string_lossy()).collect();
    last.into_iter().rev().collect::<Vec<_>>().join("/")
}

/// Differs after a file was written to or replaced: device, inode, size, and times of its last change in seconds and nanoseconds.
#[cfg(unix)]
type Stamp = (u64, u64, u64, [i64; 4]);

#[cfg(unix)]
fn stamp(data: &Metadata) -> Stamp {
    use std::os::unix::fs::MetadataExt;
    (data.dev(), data.ino(), data.size(), [data.mtime(), data.mtime_nsec(), data.ctime(), data.ctime_nsec()])
}

/// Differs after a file was written to: size and time of its last change.
#[cfg(not(unix))]
type Stamp = (u64, Option<std::time::SystemTime>);

#[cfg(not(unix))]
fn stamp(data: &Metadata) -> Stamp {
    (data.len(), data.modified().ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::time::{Duration, SystemTime};

    /// A changed file is refused, also one that keeps its size and the time of its last modification; what clients read names no folder of the server.
    #[test]
    fn val_changed_files_are_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tables/part.parquet");
        fs::create_dir(folder.path().join("tables")).unwrap();
        fs::write(&path, "sealed").unwrap();
        let sha256 = digest::of_bytes(b"sealed");
        let sealed = Sealed::new(SealedFile { path: path.clone(), sha256 });
        assert_eq!(sealed.path(), Ok(path.as_path()));
        let modified = fs::metadata(&path).unwrap().modified().unwrap();
        // Longer than a tick of the clock of the file system.
        std::thread::sleep(Duration::from_millis(50));
        fs::write(&path, "forged").unwrap();
        fs::File::options().write(true).open(&path).unwrap().set_modified(modified).unwrap();
        let refused = sealed.path().unwrap_err();
        assert!(refused.starts_with("tables/part.parquet: the file has changed"), "{refused}");
        fs::write(&path, "sealed").unwrap();
        assert_eq!(sealed.path(), Ok(path.as_path()));
        fs::remove_file(&path).unwrap();
        assert_eq!(sealed.path(), Err("tables/part.parquet: the file cannot be read".to_owned()));
    }

    /// A file that nobody touches is hashed once: what the first check found is kept.
    #[test]
    fn val_untouched_files_are_not_hashed_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, "sealed").unwrap();
        let sealed = Sealed::new(SealedFile { path: path.clone(), sha256: digest::of_bytes(b"other") });
        assert!(sealed.path().is_err());
        // As if the first check had found it unchanged.
        *sealed.unchanged.lock().unwrap() = Some(stamp(&fs::metadata(&path).unwrap()));
        assert_eq!(sealed.path(), Ok(path.as_path()));
        let later = SystemTime::now() + Duration::from_secs(9);
        fs::File::options().write(true).open(&path).unwrap().set_modified(later).unwrap();
        assert!(sealed.path().is_err());
    }
}
