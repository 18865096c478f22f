//! Files that appear complete or not at all: written beside their place under a name no artifact has, brought to disk,
//! renamed, and the folder brought to disk.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Start of the name of every file under construction; no artifact's name starts with a dot.
const TEMPORARY_PREFIX: &str = ".sastrugi-partial-";

/// Where a file goes, and who brings its name to disk: the file itself, unless it goes into a [`Draft`].
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Path of the file.
    pub path: &'a Path,
    in_draft: bool,
}

impl<'a, P: AsRef<Path> + ?Sized> From<&'a P> for Target<'a> {
    fn from(path: &'a P) -> Self {
        Self { path: path.as_ref(), in_draft: false }
    }
}

impl<'a> From<&'a DraftFile> for Target<'a> {
    fn from(file: &'a DraftFile) -> Self {
        Self { path: &file.0, in_draft: true }
    }
}

/// A folder under construction. Who makes it brings its entries to disk ([`sync_folder`]), once, before it gets its name; so its
/// files are not brought there name by name.
#[derive(Clone, Copy, Debug)]
pub struct Draft<'a>(pub &'a Path);

impl Draft<'_> {
    /// A file of the folder.
    pub fn file(&self, name: &str) -> DraftFile {
        DraftFile(self.0.join(name))
    }
}

/// A file of a [`Draft`].
#[derive(Clone, Debug)]
pub struct DraftFile(PathBuf);

/// A file under construction. Dropped without [`AtomicFile::commit`], it leaves nothing behind.
#[derive(Debug)]
pub struct AtomicFile {
    writer: Option<BufWriter<File>>,
    temporary: PathBuf,
    path: PathBuf,
    in_draft: bool,
}

impl AtomicFile {
    /// Starts a file that will appear at `target`; missing folders are made.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn create<'a>(target: impl Into<Target<'a>>) -> io::Result<Self> {
        let Target { path, in_draft } = target.into();
        let folder = folder_of(path);
        fs::create_dir_all(folder)?;
        let (file, temporary) = temporary_file(folder)?;
        let writer = Some(BufWriter::with_capacity(1 << 16, file));
        Ok(Self { writer, temporary, path: path.to_owned(), in_draft })
    }

    /// Brings the file to disk and gives it its name.
    ///
    /// # Errors
    /// The file system refused.
    pub fn commit(mut self) -> io::Result<()> {
        let writer = self.writer.take().ok_or_else(closed)?;
        let file = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.sync_all()?;
        drop(file);
        fs::rename(&self.temporary, &self.path)?;
        if self.in_draft { Ok(()) } else { sync_folder(folder_of(&self.path)) }
    }

    fn writer(&mut self) -> io::Result<&mut BufWriter<File>> {
        self.writer.as_mut().ok_or_else(closed)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer()?.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.writer()?.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer()?.seek(to)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // After a commit the temporary name is gone and this does nothing; a leftover is harmless.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Writes a whole file.
///
/// # Errors
/// The file system refused.
pub fn write<'a>(target: impl Into<Target<'a>>, bytes: &[u8]) -> io::Result<()> {
    let mut file = AtomicFile::create(target)?;
    file.write_all(bytes)?;
    file.commit()
}

/// Brings the entries of a folder to disk.
///
/// # Errors
/// The file system refused.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A new file in the folder, locked as long as it is under construction (see [`clear_leftovers`]).
fn temporary_file(folder: &Path) -> io::Result<(File, PathBuf)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    loop {
        // Unique in this folder among living processes and their threads.
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{TEMPORARY_PREFIX}{}-{count}", std::process::id()));
        let file = File::options().read(true).write(true).create(true).truncate(true).open(&path)?;
        // A file system without locks has no clearing either, which needs the lock.
        let locked = file.try_lock().is_ok();
        if !locked || path.exists() {
            return Ok((file, path));
        }
        // Cleared between its making and its lock; another name then.
    }
}

/// Removes what killed processes left under construction in the folder of `path`. Files of living processes are locked and
/// stay.
pub fn clear_leftovers(path: &Path) {
    let entries = fs::read_dir(folder_of(path)).into_iter().flatten().flatten();
    let leftovers = entries.filter(|e| e.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX));
    for entry in leftovers {
        // What cannot be opened, locked or removed stays: it is harmless and bears no artifact's name.
        if File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn closed() -> io::Error {
    io::Error::other("the file is already committed")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_a_file_appears_only_when_committed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.txt");
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        assert!(!path.exists());
        drop(file);
        assert_eq!(fs::read_dir(folder.path().join("a")).unwrap().count(), 0);
        write(&path, b"whole").unwrap();
        write(&path, b"again").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"again");
        assert_eq!(fs::read_dir(folder.path().join("a")).unwrap().count(), 1);
    }

    /// Who brings a name to disk goes by the type, whatever the folder is called.
    #[test]
    fn val_only_drafts_leave_names_to_their_folder() {
        let folder = tempfile::tempdir().unwrap();
        let unfinished = folder.path().join("unfinished-1");
        let draft = Draft(&unfinished);
        let of = |target: Target<'_>| (target.path.to_owned(), target.in_draft);
        assert_eq!(of((&draft.file("a")).into()), (unfinished.join("a"), true));
        assert_eq!(of((&unfinished.join("a")).into()), (unfinished.join("a"), false));
        write(&draft.file("a"), b"whole").unwrap();
        assert_eq!(fs::read(unfinished.join("a")).unwrap(), b"whole");
    }

    #[test]
    fn val_only_dead_files_are_cleared() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("b.txt");
        fs::write(folder.path().join(format!("{TEMPORARY_PREFIX}1-0")), b"left").unwrap();
        fs::write(folder.path().join("other"), b"kept").unwrap();
        let alive = AtomicFile::create(&path).unwrap();
        clear_leftovers(&path);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        alive.commit().unwrap();
        assert!(path.exists());
    }
}
