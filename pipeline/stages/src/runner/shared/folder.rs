//! A shared cache in a folder, which may lie on a network file system.
//!
//! ```text
//! CACHEDIR.TAG                  marks the folder
//! entries/ab/ab12.../           an entry: the files of an item and record.json
//! drafts/<process>-<random>/    entries under construction, and removed ones
//! ```
//!
//! Creating a folder is exclusive and renaming one is atomic, also over NFS: a draft belongs to the process that created it, and an entry
//! appears and disappears in one step. Only [`super::prune`] touches the drafts of others, and only old ones.

use super::{ENTRIES, Entry, Shared, is_entry};
use crate::error::Error;
use crate::runner::cache::{RECORD, Record, copy_result};
use crate::runner::damage::Changed;
use sastrugi_store::{atomic, file};
use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// File that marks a shared cache (Cache Directory Tagging Specification).
const MARK: &str = "CACHEDIR.TAG";
/// Its text. Caches are recognised by it, so it must not change.
const MARK_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Shared cache of sastrugi: finished items of studies. It can be removed; \
    runs then make them again.\n";
/// Folder of the drafts.
const DRAFTS: &str = "drafts";

/// A shared cache in a folder.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    is_read_only: bool,
}

impl Folder {
    /// Opens a cache; creates it unless it is to be only read. A folder that cannot be written to is only read.
    ///
    /// # Errors
    /// A folder with other files, a missing one that is to be only read, or an I/O error.
    pub fn open(root: &Path, read_only: bool) -> Result<Self, Error> {
        let mut cache = Self { root: root.to_owned(), is_read_only: read_only };
        match (marked(root)?, read_only) {
            (true, _) => {}
            (false, true) => {
                return Err(Error::Input(format!(
                    "{}: not a shared cache; the folder is missing or empty",
                    root.display()
                )));
            }
            (false, false) => mark(root)?,
        }
        if !read_only {
            match cache.draft() {
                Ok(draft) => drop(fs::remove_dir(draft)),
                Err(e) if is_refused(&e) => cache.is_read_only = true,
                Err(e) => return Err(unusable(root, e)),
            }
        }
        Ok(cache)
    }

    /// A new empty folder that belongs to this process.
    fn draft(&self) -> io::Result<PathBuf> {
        fs::create_dir_all(self.root.join(DRAFTS))?;
        loop {
            let path = self.unused();
            match fs::create_dir(&path) {
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                created => return created.map(|()| path),
            }
        }
    }

    /// A path for a draft that nobody else chooses, except by a chance of 2^-64.
    fn unused(&self) -> PathBuf {
        let random = RandomState::new().hash_one(SystemTime::now());
        self.root.join(DRAFTS).join(format!("{}-{random:016x}", std::process::id()))
    }

    /// Gives a complete draft the name of its entry; false if that exists already.
    fn put_in_place(&self, draft: &Path, name: &str) -> Result<bool, Error> {
        let target = self.root.join(name);
        let parent = target.parent().unwrap_or(&self.root);
        fs::create_dir_all(parent).map_err(|e| Error::at(parent, e))?;
        let renamed = fs::rename(draft, &target).or_else(|e| {
            if !is_taken(&e) || target.join(RECORD).is_file() {
                return Err(e);
            }
            // A folder without a record is not an entry: somebody removed it by hand.
            self.take_away(name)?;
            fs::rename(draft, &target)
        });
        match renamed {
            Ok(()) => atomic::sync_folder(parent).map_err(|e| Error::at(parent, e)).map(|()| true),
            Err(_) if target.join(RECORD).is_file() => Ok(false),
            Err(e) => Err(Error::at(&target, e)),
        }
    }

    /// Renames an entry or a draft to a fresh draft, and removes that.
    fn take_away(&self, name: &str) -> io::Result<()> {
        fs::create_dir_all(self.root.join(DRAFTS))?;
        let aside = self.unused();
        match fs::rename(self.root.join(name), &aside) {
            Ok(()) => {
                // What stays, such as a file that is open on another machine, is an old draft one day.
                let _ = fs::remove_dir_all(&aside);
                Ok(())
            }
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
            Err(e) => Err(e),
        }
    }

    /// Describes a folder of the cache; `None` if it disappears meanwhile.
    fn entry(&self, name: String) -> Option<Entry> {
        let folder = self.root.join(&name);
        let files: Vec<(OsString, fs::Metadata)> = fs::read_dir(&folder)
            .ok()?
            .flatten()
            .filter_map(|file| Some((file.file_name(), file.metadata().ok()?)))
            .collect();
        let record = files.iter().find(|(file, _)| file == RECORD).map(|(_, data)| data);
        let is_complete = is_entry(&name) && record.is_some();
        let own = fs::metadata(&folder).ok()?;
        let used = match record.filter(|_| is_complete) {
            Some(record) => record.modified().ok()?,
            None => files.iter().map(|(_, data)| data).chain([&own]).filter_map(|data| data.modified().ok()).max()?,
        };
        Some(Entry { name, bytes: files.iter().map(|(_, data)| data.len()).sum(), used, is_complete })
    }
}

impl Shared for Folder {
    fn read(&self, name: &str, file: &str, to: &mut dyn Write) -> Result<bool, Error> {
        let path = self.root.join(name).join(file);
        let copied = file::open(&path).and_then(|mut from| io::copy(&mut from, to));
        match copied {
            Ok(_) => Ok(true),
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::StaleNetworkFileHandle) => Ok(false),
            Err(e) => Err(Error::at(&path, e)),
        }
    }

    fn publish(&self, name: &str, record: &Record, folder: &Path) -> Result<bool, Error> {
        if self.root.join(name).join(RECORD).is_file() {
            return Ok(false);
        }
        let draft = self.draft().map_err(|e| Error::at(&self.root, e))?;
        let changed = Changed::default();
        let published = copy_result(record, folder, &draft, &changed)
            .and_then(|()| changed.remove())
            .and_then(|()| atomic::sync_folder(&draft).map_err(|e| Error::at(&draft, e)))
            .and_then(|()| self.put_in_place(&draft, name));
        if !matches!(published, Ok(true)) {
            // If this fails, it is an old draft one day.
            let _ = fs::remove_dir_all(&draft);
        }
        published
    }

    fn mark_used(&self, name: &str) {
        if self.is_read_only {
            return;
        }
        // Refused for the files of other users: they age from their publication.
        let _ = File::open(self.root.join(name).join(RECORD)).and_then(|file| file.set_modified(SystemTime::now()));
    }

    fn remove(&self, name: &str) -> Result<(), Error> {
        self.take_away(name).map_err(|e| Error::at(&self.root.join(name), e))
    }

    fn list(&self) -> Result<Vec<Entry>, Error> {
        let drafts = names(&self.root, DRAFTS)?;
        let mut all: Vec<String> = Vec::new();
        for digits in names(&self.root, ENTRIES)? {
            all.extend(names(&self.root, &digits)?.into_iter().filter(|name| is_entry(name)));
        }
        all.extend(drafts);
        Ok(all.into_iter().filter_map(|name| self.entry(name)).collect())
    }

    fn is_read_only(&self) -> bool {
        self.is_read_only
    }
}

/// Names of the folders in a folder of the cache, relative to its root; none if it does not exist.
fn names(root: &Path, folder: &str) -> Result<Vec<String>, Error> {
    let path = root.join(folder);
    let entries = match fs::read_dir(&path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        listed => listed.map_err(|e| Error::at(&path, e))?,
    };
    let folders = entries.flatten().filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    Ok(folders.map(|entry| format!("{folder}/{}", entry.file_name().to_string_lossy())).collect())
}

/// True for a shared cache; false for an empty or missing folder.
fn marked(root: &Path) -> Result<bool, Error> {
    let refused = || {
        let advice = "is neither empty nor a shared cache of sastrugi; choose another folder";
        Error::Usage(format!("{} {advice}", root.display()))
    };
    // Listed once: another run may be creating the cache, and it writes the mark first.
    let found: BTreeSet<OsString> = match fs::read_dir(root) {
        Ok(entries) => entries.flatten().map(|entry| entry.file_name()).collect(),
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(false),
        Err(e) if e.kind() == ErrorKind::NotADirectory => {
            return Err(Error::Usage(format!("{}: this is a file; a shared cache must be a folder", root.display())));
        }
        Err(e) => return Err(unusable(root, e)),
    };
    if found.contains(OsStr::new(MARK)) {
        let path = root.join(MARK);
        let text = file::read(&path).map_err(|e| unusable(root, e))?;
        return if text == MARK_TEXT.as_bytes() { Ok(true) } else { Err(refused()) };
    }
    if found.iter().all(|name| atomic::is_temporary(name)) { Ok(false) } else { Err(refused()) }
}

fn mark(root: &Path) -> Result<(), Error> {
    atomic::write(&root.join(MARK), MARK_TEXT.as_bytes()).map_err(|e| unusable(root, e))
}

/// A failure of the file system that says what the folder is for. Its number decides whether a retry can help, so the error itself is judged.
fn unusable(root: &Path, error: io::Error) -> Error {
    let why = format!("{}: cannot be used as a shared cache: {}", root.display(), words(&error));
    match Error::at(root, error) {
        Error::Retry(_) => Error::Retry(why),
        Error::Input(_) => Error::Input(why),
        _ => Error::Failed(why),
    }
}

fn words(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::PermissionDenied => "permission denied".to_owned(),
        _ => error.to_string(),
    }
}

/// True if the file system refuses to be written to.
fn is_refused(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

/// True if a folder cannot be renamed because its new name belongs to a folder with files.
fn is_taken(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::DirectoryNotEmpty | ErrorKind::AlreadyExists)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Too many open files are transient; a missing permission is not.
    #[test]
    fn val_what_makes_a_cache_unusable_decides() {
        let of = |number| unusable(Path::new("cache"), io::Error::from_raw_os_error(number));
        let (open_files, permission) = (of(24), of(13));
        let said = "cache: cannot be used as a shared cache: ";
        assert!(matches!(&open_files, Error::Retry(why) if why.starts_with(said)), "{open_files}");
        assert!(
            matches!(&permission, Error::Failed(why) if *why == format!("{said}permission denied")),
            "{permission}"
        );
    }
}
