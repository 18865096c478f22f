//! Opening and reading files named by the user. Only regular files are read, because a pipe may block forever and a device may never
//! end.

use std::fs::{self, File, FileType};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// True for an address such as `s3://bucket/a` or `gs:/a`: a path that starts with a scheme. A single letter is not a scheme.
///
/// ```
/// use sastrugi_store::file::is_address;
/// use std::path::Path;
///
/// assert!(["s3://b/c", "S3://b/c", "gs:/b", "file:///tmp/a"].iter().all(|text| is_address(Path::new(text))));
/// assert!(!["a/s3://b", "a.tif", "C:/a", "a:b", ":/a"].iter().any(|text| is_address(Path::new(text))));
/// ```
pub fn is_address(path: &Path) -> bool {
    let text = path.to_string_lossy();
    let Some((scheme, _)) = text.split_once(":/") else { return false };
    let is_letter = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    scheme.len() > 1 && scheme.starts_with(|c: char| c.is_ascii_alphabetic()) && scheme.chars().all(is_letter)
}

/// Opens a regular file.
///
/// # Errors
/// Errors of the file system, with `NotFound` also for a path that leads through a file; `IsADirectory` for a folder; `InvalidInput` for a
/// pipe, a socket or a device.
pub fn open(path: &Path) -> io::Result<File> {
    // Checked before opening, because opening a pipe blocks until something writes to it.
    let kind = fs::metadata(path).map_err(missing)?.file_type();
    if kind.is_file() {
        return File::open(path);
    }
    if kind.is_dir() {
        return Err(io::Error::new(ErrorKind::IsADirectory, "is a folder, not a file"));
    }
    Err(io::Error::new(ErrorKind::InvalidInput, format!("is a {}; give a regular file", name_of(kind))))
}

/// The bytes of a regular file.
///
/// # Errors
/// As [`open`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open(path)?;
    let mut bytes = Vec::new();
    // Allocate fallibly: a file too large for memory is an error, not an abort.
    let size = file.metadata().ok().filter(fs::Metadata::is_file).map_or(0, |m| m.len());
    bytes
        .try_reserve_exact(usize::try_from(size).unwrap_or(usize::MAX))
        .map_err(|_| io::Error::from(ErrorKind::OutOfMemory))?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// At most the first `bytes` bytes of a regular file.
///
/// # Errors
/// As [`open`].
pub fn head(path: &Path, bytes: u64) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    open(path)?.take(bytes).read_to_end(&mut head)?;
    Ok(head)
}

/// The text of a regular file.
///
/// # Errors
/// As [`open`], and `InvalidData` for text that is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|_| io::Error::new(ErrorKind::InvalidData, "is not UTF-8 text"))
}

/// A path such as `a.tif/x` gives the error of a path whose folder does not exist.
fn missing(error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::NotADirectory => io::Error::new(ErrorKind::NotFound, "no such file"),
        _ => error,
    }
}

#[cfg(unix)]
fn name_of(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if kind.is_fifo() {
        "pipe"
    } else if kind.is_socket() {
        "socket"
    } else {
        "device"
    }
}

#[cfg(not(unix))]
fn name_of(_: FileType) -> &'static str {
    "device"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_files_are_read_completely() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, b"all of it").unwrap();
        assert_eq!(read(&path).unwrap(), b"all of it");
        assert_eq!(read(&folder.path().join("b")).unwrap_err().kind(), ErrorKind::NotFound);
        let error = read(folder.path()).unwrap_err();
        assert_eq!((error.kind(), &*error.to_string()), (ErrorKind::IsADirectory, "is a folder, not a file"));
    }

    /// A path through a file is missing, not a failure of the machine.
    #[test]
    fn val_paths_through_a_file_are_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        fs::write(&path, b"heights").unwrap();
        let error = read(&path.join("x")).unwrap_err();
        assert_eq!((error.kind(), error.to_string()), (ErrorKind::NotFound, "no such file".to_owned()));
    }

    /// Refused without blocking on a writer and without exhausting memory.
    #[cfg(unix)]
    #[test]
    fn val_pipes_sockets_and_devices_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [pipe, socket] = ["pipe", "socket"].map(|name| folder.path().join(name));
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for (path, name) in [(pipe.as_path(), "pipe"), (&socket, "socket"), (Path::new("/dev/zero"), "device")] {
            let error = read(path).unwrap_err();
            assert_eq!(
                (error.kind(), error.to_string()),
                (ErrorKind::InvalidInput, format!("is a {name}; give a regular file"))
            );
        }
    }
}
