//! Locks of the operating system, held through a file: a killed process never blocks the next one.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

/// Takes the lock; `None` while another process holds it. The file is made where there is none, and its content stays.
///
/// # Errors
/// The path leads to anything but a plain file, a symbolic link included; the file system refuses.
pub fn take(path: &Path) -> io::Result<Option<File>> {
    match fs::symlink_metadata(path) {
        Ok(there) if !there.is_file() => {
            return Err(io::Error::other("not a regular file, so it cannot be used as a lock"));
        }
        _ => {}
    }
    let file = File::options().write(true).create(true).truncate(false).open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(e)) => Err(e),
    }
}
