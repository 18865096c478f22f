//! Atomic writes: a file appears complete or not at all. It is written in the same folder under a temporary name, synced and
//! renamed; then the folder is synced.

use std::ffi::OsStr;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// Start of the name of every file under construction; no artifact's name starts with a dot.
const TEMPORARY_PREFIX: &str = ".sastrugi-partial-";

/// Destination of a file. Committing the file syncs its folder, unless it goes into a [`Draft`].
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

/// A folder under construction. Its creator syncs it once ([`sync_folder`]) before giving it its final name, so that each file need
/// not sync the folder.
#[derive(Clone, Copy, Debug)]
pub struct Draft<'a>(pub &'a Path);

impl Draft<'_> {
    /// A file in the folder.
    pub fn file(&self, name: &str) -> DraftFile {
        DraftFile(self.0.join(name))
    }
}

/// A file of a [`Draft`].
#[derive(Clone, Debug)]
pub struct DraftFile(PathBuf);

impl DraftFile {
    /// The file at a path in a folder under construction.
    pub(crate) fn at(path: &Path) -> Self {
        Self(path.to_owned())
    }
}

/// A file under construction. Dropped without [`AtomicFile::commit`], it leaves nothing behind.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_store::atomic::AtomicFile;
/// use std::io::Write;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.txt");
/// let mut file = AtomicFile::create(&path)?;
/// file.write_all(b"half")?;
/// assert!(!path.exists());
/// drop(file);
/// assert_eq!(std::fs::read_dir(folder.path())?.count(), 0);
///
/// let mut file = AtomicFile::create(&path)?;
/// file.write_all(b"complete")?;
/// file.commit()?;
/// assert_eq!(std::fs::read(&path)?, b"complete");
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct AtomicFile {
    writer: Option<BufWriter<File>>,
    temporary: PathBuf,
    path: PathBuf,
    in_draft: bool,
    refused: Refused,
}

/// First file-system error on writing to a file. Kept because encoders reduce such errors to text.
#[derive(Clone, Debug, Default)]
pub struct Refused(Arc<OnceLock<i32>>);

impl Refused {
    /// The error, if there was one.
    pub fn error(&self) -> Option<io::Error> {
        self.0.get().map(|code| io::Error::from_raw_os_error(*code))
    }

    fn note<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.inspect_err(|e| {
            if let Some(code) = e.raw_os_error() {
                // Only the first is kept.
                let _ = self.0.set(code);
            }
        })
    }
}

impl AtomicFile {
    /// Starts a file that will appear at `target`; missing folders are created.
    ///
    /// # Errors
    /// An address of another machine; the folder cannot be created or written to.
    pub fn create<'a>(target: impl Into<Target<'a>>) -> io::Result<Self> {
        let Target { path, in_draft } = target.into();
        if crate::file::is_address(path) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "is an address; give a path on this machine"));
        }
        let folder = folder_of(path);
        fs::create_dir_all(folder)?;
        let (file, temporary) = temporary_file(folder)?;
        let writer = Some(BufWriter::with_capacity(1 << 16, file));
        Ok(Self { writer, temporary, path: path.to_owned(), in_draft, refused: Refused::default() })
    }

    /// Syncs the file to disk and gives it its name.
    ///
    /// # Errors
    /// The file system failed.
    pub fn commit(self) -> io::Result<()> {
        self.finish()?.put_in_place()
    }

    /// Syncs the file to disk without giving it its name yet, so that several files can be completed before any of them appears.
    ///
    /// # Errors
    /// The file system failed.
    pub fn finish(mut self) -> io::Result<FinishedFile> {
        let writer = self.writer.take().ok_or_else(closed)?;
        let locked = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        locked.sync_all()?;
        Ok(FinishedFile { file: self, locked })
    }

    /// Handle to the file system's own error, for use after an encoder has failed.
    pub fn refused(&self) -> Refused {
        self.refused.clone()
    }

    fn writer(&mut self) -> io::Result<&mut BufWriter<File>> {
        self.writer.as_mut().ok_or_else(closed)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer()?.write(bytes);
        self.refused.note(written)
    }
    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.writer()?.flush();
        self.refused.note(flushed)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer()?.seek(to)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // After a commit the temporary name no longer exists and this does nothing; a leftover is harmless.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Refuses an output whose name a link, a pipe or a device has: [`AtomicFile`] would put a file in its place, even in that of `/dev/stdout`.
///
/// # Errors
/// One of kind `InvalidInput`.
pub fn check_replaced(path: &Path) -> io::Result<()> {
    // Without a final `/`, behind which the system looks for what a link leads to, which may be nothing.
    let path: PathBuf = path.components().collect();
    let Ok(found) = fs::symlink_metadata(path) else { return Ok(()) };
    if found.is_file() || found.is_dir() {
        return Ok(());
    }
    let kind = if found.is_symlink() { "symbolic link" } else { "pipe or device" };
    let message = format!("is a {kind}, which the output would replace; remove it or choose another name");
    Err(io::Error::new(io::ErrorKind::InvalidInput, message))
}

/// A complete file on disk that has no name yet. Dropped without [`FinishedFile::put_in_place`], it leaves nothing behind.
#[derive(Debug)]
pub struct FinishedFile {
    file: AtomicFile,
    /// The lock protects the file from being cleared until it is renamed.
    locked: File,
}

impl FinishedFile {
    /// Path at which the file will appear.
    pub fn path(&self) -> &Path {
        &self.file.path
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// The file system failed.
    pub fn put_in_place(self) -> io::Result<()> {
        let Self { file, locked } = self;
        fs::rename(&file.temporary, &file.path)?;
        drop(locked);
        if file.in_draft { Ok(()) } else { sync_folder(folder_of(&file.path)) }
    }
}

/// Writes a complete file.
///
/// # Errors
/// The file system failed.
pub fn write<'a>(target: impl Into<Target<'a>>, bytes: &[u8]) -> io::Result<()> {
    let mut file = AtomicFile::create(target)?;
    file.write_all(bytes)?;
    file.commit()
}

/// Makes a hard link to a complete file that is on disk, or, where the file system allows none (another file system, too many links), copies
/// it and syncs the copy. Links share their content, so neither file may be changed in place. The folder is not synced.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_store::atomic::link_or_copy;
///
/// let folder = tempfile::tempdir()?;
/// let [first, second] = ["a", "b"].map(|name| folder.path().join(name));
/// std::fs::write(&first, "snow")?;
/// link_or_copy(&first, &second)?;
/// std::fs::remove_file(&first)?;
/// assert_eq!(std::fs::read_to_string(&second)?, "snow");
/// // A name that is taken is left alone.
/// std::fs::write(&first, "ice")?;
/// assert!(link_or_copy(&first, &second).is_err());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A source that is not a regular file, a target that exists; the file system failed.
pub fn link_or_copy(from: &Path, to: &Path) -> io::Result<()> {
    // A link to a symbolic link would be another symbolic link.
    if fs::symlink_metadata(from)?.is_file() && fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    copy(from, to)
}

/// Copies a file to a name that is free, and syncs the copy.
fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let mut source = crate::file::open(from)?;
    let mut copied = File::create_new(to)?;
    io::copy(&mut source, &mut copied)?;
    copied.sync_all()
}

/// Syncs the entries of a folder to disk.
///
/// # Errors
/// The file system failed.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A new file in the folder, locked while it is under construction (see [`clear_leftovers`]).
fn temporary_file(folder: &Path) -> io::Result<(File, PathBuf)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    loop {
        // Unique in this folder among the running processes of this machine and their threads.
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{TEMPORARY_PREFIX}{}-{count}", std::process::id()));
        let file = match File::options().read(true).write(true).create_new(true).open(&path) {
            // Left by a killed process with the same id, or in use by one in another container or on another machine.
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
            opened => opened?,
        };
        match file.try_lock() {
            Ok(()) if is_at(&file, &path) => return Ok((file, path)),
            // Cleared, or about to be, between creation and lock: try another name.
            Ok(()) | Err(TryLockError::WouldBlock) => {}
            // Without file locks nothing is cleared either, because clearing needs the lock.
            Err(TryLockError::Error(_)) => return Ok((file, path)),
        }
    }
}

/// True while the path refers to this open file.
#[cfg(unix)]
pub fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |data: fs::Metadata| (data.dev(), data.ino());
    file.metadata().is_ok_and(|open| fs::symlink_metadata(path).is_ok_and(|there| identity(open) == identity(there)))
}

/// True while the path refers to this open file, assuming that its name is unique.
#[cfg(not(unix))]
pub fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// True for the name of a file under construction, or of one left by a killed process.
pub fn is_temporary(name: &OsStr) -> bool {
    name.to_string_lossy().starts_with(TEMPORARY_PREFIX)
}

/// Removes files that killed processes left under construction in the folder of `path`. Files of running processes are locked
/// and stay; if one is removed before it is locked, its process creates another under a new name.
pub fn clear_leftovers(path: &Path) {
    let entries = fs::read_dir(folder_of(path)).into_iter().flatten().flatten();
    entries.filter(|entry| is_temporary(&entry.file_name())).for_each(|entry| clear(&entry.path()));
}

/// Removes a file that no process has locked. A file that cannot be opened, locked or removed stays: it is harmless, because no
/// artifact has such a name.
fn clear(path: &Path) {
    let Ok(file) = File::open(path) else { return };
    // The lock is held until the file is removed: its creator, who locks it next, then finds it gone.
    if file.try_lock().is_ok() && is_at(&file, path) {
        let _ = fs::remove_file(path);
    }
}

fn closed() -> io::Error {
    io::Error::other("the file has already been committed")
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
        write(&path, b"first").unwrap();
        write(&path, b"again").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"again");
        assert_eq!(fs::read_dir(folder.path().join("a")).unwrap().count(), 1);
    }

    /// Links, pipes and devices are not to be replaced.
    #[cfg(unix)]
    #[test]
    fn val_only_files_may_be_replaced() {
        use std::os::unix::{fs::symlink, net::UnixListener};
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("file"), b"first").unwrap();
        symlink(path("file"), path("link")).unwrap();
        symlink(path("nothing"), path("dangling")).unwrap();
        let _listens = UnixListener::bind(path("socket")).unwrap();
        for (name, kind) in [
            ("link", "symbolic link"),
            ("dangling", "symbolic link"),
            ("dangling/", "symbolic link"),
            ("socket", "pipe or device"),
        ] {
            let refused = check_replaced(&path(name)).unwrap_err();
            assert_eq!(
                refused.to_string(),
                format!("is a {kind}, which the output would replace; remove it or choose another name")
            );
        }
        for name in ["file", "nothing", "."] {
            check_replaced(&path(name)).unwrap();
        }
    }

    /// A file that is finished but not put in place leaves the one of that name alone, and nothing behind.
    #[test]
    fn val_a_finished_file_appears_when_it_is_put_in_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write(&path, b"first").unwrap();
        let finished = || {
            let mut file = AtomicFile::create(&path).unwrap();
            file.write_all(b"again").unwrap();
            file.finish().unwrap()
        };
        let dropped = finished();
        clear_leftovers(&path);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "it is locked");
        drop(dropped);
        assert_eq!((fs::read_dir(folder.path()).unwrap().count(), fs::read(&path).unwrap()), (1, b"first".to_vec()));
        let file = finished();
        assert_eq!(file.path(), path);
        file.put_in_place().unwrap();
        assert_eq!((fs::read_dir(folder.path()).unwrap().count(), fs::read(&path).unwrap()), (1, b"again".to_vec()));
    }

    /// On one file system a hard link is made; a copy has the same bytes, and neither overwrites a file.
    #[test]
    fn val_files_are_linked_or_copied() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("a"), b"whole").unwrap();
        link_or_copy(&path("a"), &path("linked")).unwrap();
        copy(&path("a"), &path("copied")).unwrap();
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            let inode = |name: &str| fs::metadata(path(name)).unwrap().ino();
            assert!(inode("a") == inode("linked") && inode("a") != inode("copied"));
            std::os::unix::fs::symlink(path("a"), path("symbolic")).unwrap();
            link_or_copy(&path("symbolic"), &path("of-symbolic")).unwrap();
            assert!(fs::symlink_metadata(path("of-symbolic")).unwrap().is_file());
        }
        for name in ["linked", "copied"] {
            assert_eq!(fs::read(path(name)).unwrap(), b"whole");
            assert_eq!(copy(&path("a"), &path(name)).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        }
        assert_eq!(link_or_copy(&path("none"), &path("b")).unwrap_err().kind(), io::ErrorKind::NotFound);
        assert!(!path("b").exists());
    }

    /// Whether a file syncs its folder depends on the type of target, not on the folder's name.
    #[test]
    fn val_only_drafts_leave_the_sync_to_their_folder() {
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
    fn val_only_unlocked_files_are_cleared() {
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

    /// Every file appears complete, even while other threads clear the folder.
    #[test]
    fn val_files_appear_while_others_clear() {
        let folder = tempfile::tempdir().unwrap();
        let make = |thread: usize| {
            for k in 0..100 {
                let path = folder.path().join(format!("{thread}-{k}"));
                write(&Draft(folder.path()).file(&format!("{thread}-{k}")), b"whole").unwrap();
                assert_eq!(fs::read(path).unwrap(), b"whole");
            }
        };
        std::thread::scope(|scope| {
            let makers: Vec<_> = (0..3).map(|thread| scope.spawn(move || make(thread))).collect();
            std::thread::scope(|inner| {
                for _ in 0..2 {
                    inner.spawn(|| {
                        while !makers.iter().all(|maker| maker.is_finished()) {
                            clear_leftovers(&folder.path().join("x"));
                        }
                    });
                }
            });
        });
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 300);
    }

    /// An existing name is never written to: its owner may run on another machine.
    #[test]
    fn val_existing_names_are_skipped() {
        let folder = tempfile::tempdir().unwrap();
        let (first, name) = temporary_file(folder.path()).unwrap();
        let word = name.file_name().unwrap().to_string_lossy().into_owned();
        let count: u64 = word.rsplit('-').next().unwrap().parse().unwrap();
        for next in count + 1..count + 100 {
            let taken = format!("{TEMPORARY_PREFIX}{}-{next}", std::process::id());
            let _ = File::options().write(true).create_new(true).open(folder.path().join(taken)).unwrap();
        }
        let (_, other) = temporary_file(folder.path()).unwrap();
        let word = other.file_name().unwrap().to_string_lossy().into_owned();
        assert!(word.rsplit('-').next().unwrap().parse::<u64>().unwrap() >= count + 100, "{word}");
        assert!(is_at(&first, &name) && !is_at(&first, &other));
    }
}
