//! File locks of the operating system, which are released when a process is killed.

use sastrugi_store::atomic;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

/// Takes the lock; `None` while another process holds it. The file is created if it does not exist; its content is kept. Whoever holds the
/// lock may remove the file.
///
/// # Errors
/// The path is not a regular file (symbolic links are refused too), or an I/O error.
pub fn take(path: &Path) -> io::Result<Option<File>> {
    loop {
        match fs::symlink_metadata(path) {
            Ok(there) if !there.is_file() => {
                return Err(io::Error::other("not a regular file, so it cannot be used as a lock"));
            }
            _ => {}
        }
        let file = File::options().write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Ok(()) if atomic::is_at(&file, path) => return Ok(Some(file)),
            // The holder removed the file after it was opened here; the next process would lock a new file.
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(e)) => return Err(e),
        }
    }
}
