//! Releases in an object store, `s3://bucket/prefix`.
//!
//! A release is assembled in the work area and then uploaded: its checksums first, which no other release has, then its content, the manifest
//! last. Checksums and manifest are created only if they do not exist, so two releases never mix: whoever created the checksums owns the
//! address. Without a manifest there is no release, so an interrupted upload never looks like one; the next upload resumes it. Nothing that
//! exists is overwritten: objects with the same bytes are kept, others are refused.

use crate::error::Error;
use crate::runner::cache::Cache;
use crate::runner::progress::Progress;
use crate::studies::{RunSummary, default_work};
use crate::verification::Scratch;
use rayon::prelude::*;
use sastrugi_store::atomic::{AtomicFile, Draft};
use sastrugi_store::digest;
use sastrugi_store::file;
use sastrugi_store::objects::{Bucket, Object};
use sastrugi_store::release::{MANIFEST, Release, SUMS};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// The address of a release in an object store; `None` for a folder.
pub fn address(release: &Path) -> Option<&str> {
    release.to_str().filter(|text| Bucket::is_address(text))
}

/// Refuses a place that is neither a path on this machine nor in a store that is supported.
///
/// # Errors
/// Such a place.
pub fn check_place(place: &Path) -> Result<(), Error> {
    match address(place) {
        Some(_) => Ok(()),
        None if file::is_address(place) => Err(Error::Usage(format!(
            "{}: stores of this kind are not supported; give a folder, or s3://bucket/prefix",
            place.display()
        ))),
        None => check_local(place),
    }
}

/// Refuses an output that is not a path on this machine, or that is a pipe, a device or a link to something other than a folder. A link to a
/// folder is followed, so that it suits only outputs that are folders; see [`check_file`].
///
/// # Errors
/// An address, an empty path, or the name of something other than a file or a folder.
pub fn check_local(output: &Path) -> Result<(), Error> {
    check_path(output)?;
    if output.is_dir() { Ok(()) } else { check_replaced(output) }
}

/// Refuses an output file that is not a path on this machine, or whose name belongs to a folder, a link, a pipe or a device.
///
/// # Errors
/// An address, an empty path, or the name of something other than a file.
pub fn check_file(output: &Path) -> Result<(), Error> {
    check_path(output)?;
    check_replaced(output)?;
    match output.is_dir() {
        true => Err(Error::Usage(format!("{} is a folder; name a file", output.display()))),
        false => Ok(()),
    }
}

fn check_replaced(output: &Path) -> Result<(), Error> {
    sastrugi_store::atomic::check_replaced(output).map_err(|e| Error::Usage(format!("{}: {e}", output.display())))
}

fn check_path(output: &Path) -> Result<(), Error> {
    if output.as_os_str().is_empty() {
        return Err(Error::Usage("the path is empty; name a file or folder".to_owned()));
    }
    if file::is_address(output) {
        let advice = "this output must be a path on this machine (only the program's `run` and `merge` write to an object store, s3://bucket/prefix)";
        return Err(Error::Usage(format!("{}: {advice}", output.display())));
    }
    Ok(())
}

/// Makes a release: in its folder, or in the work area and then in an object store. `make` gets the folder, the work area, and whether to
/// replace what is in the folder.
///
/// # Errors
/// Those of `make`; a store that fails; another release at the address.
pub fn releasing(
    output: &Path,
    work: Option<&Path>,
    replace: bool,
    progress: &dyn Progress,
    make: impl FnOnce(&Path, Option<&Path>, bool) -> Result<RunSummary, Error>,
) -> Result<RunSummary, Error> {
    check_place(output)?;
    work.map_or(Ok(()), check_local)?;
    let Some(address) = address(output) else { return make(output, work, replace) };
    // Opened first: what is wrong with it should not come to light after the run.
    let bucket = Bucket::open(address)?;
    let summary = releasing_to(&bucket, &work_area(output, work), progress, make)?;
    Ok(RunSummary { output: output.to_owned(), ..summary })
}

/// The work area of a release; by default beside its folder, and of one in an object store in the current folder.
pub fn work_area(output: &Path, work: Option<&Path>) -> PathBuf {
    let default = || address(output).map_or_else(|| default_work(output), |at| default_work(&local_name(at)));
    work.map_or_else(default, Path::to_owned)
}

/// Makes a release in the work area and uploads it.
fn releasing_to(
    bucket: &Bucket,
    work: &Path,
    progress: &dyn Progress,
    make: impl FnOnce(&Path, Option<&Path>, bool) -> Result<RunSummary, Error>,
) -> Result<RunSummary, Error> {
    // Marks the folder as a work area, and refuses any other.
    drop(Cache::open(work)?);
    let folder = work.join("release");
    // What an earlier run left in the work area is a copy: what is at the address decides, and is never replaced.
    let summary = make(&folder, Some(work), true)?;
    upload(&Release::open(&folder)?, bucket, progress)?;
    Ok(summary)
}

/// Name of the local release that an address stands for: its last name and a part of the address's hash, so that neither a folder of that
/// name nor another address with it has the same work area.
fn local_name(address: &str) -> PathBuf {
    let address = address.trim_end_matches('/');
    let name = address.rsplit('/').next().unwrap_or("release");
    PathBuf::from(format!("{name}.s3-{}", &digest::of_text(address)[..8]))
}

/// Calls `check` with the folder of a release; one in an object store is downloaded to a temporary folder.
///
/// # Errors
/// Those of `check`; a store that fails; an address without a release.
pub fn with_folder<T>(
    release: &Path,
    progress: &dyn Progress,
    check: impl FnOnce(&Path) -> Result<T, Error>,
) -> Result<T, Error> {
    let Some(address) = address(release) else { return check(release) };
    let bucket = Bucket::open(address)?;
    if !bucket.contains(MANIFEST)? && !bucket.contains(SUMS)? {
        return Err(Error::Input(format!("{address}: not a sastrugi release: it has neither {MANIFEST} nor {SUMS}")));
    }
    let scratch = Scratch::new("download")?;
    download(&bucket, scratch.path(), progress)?;
    check(scratch.path())
}

/// Uploads a sealed release.
///
/// # Errors
/// Another release, or other objects under the names of its files ([`Error::Usage`]); a store or a file that fails.
pub fn upload(release: &Release, bucket: &Bucket, progress: &dyn Progress) -> Result<(), Error> {
    let manifest = release.path(MANIFEST);
    let sha256 = |path: &Path| digest::of_file(path).map(|(_, sha256)| sha256).map_err(|e| Error::at(path, e));
    let manifest_sha256 = sha256(&manifest)?;
    match bucket.sha256(MANIFEST)? {
        Some(there) if there == manifest_sha256 => return Ok(()),
        Some(_) => return Err(occupied(bucket, MANIFEST)),
        None => {}
    }
    let artifacts = &release.manifest().artifacts;
    progress.phase(&format!("uploading {} files to {}", artifacts.len() + 2, bucket.address()));
    let total = artifacts.iter().map(|artifact| artifact.bytes).sum();
    let done = AtomicU64::new(0);
    progress.copied(0, total);
    let sums = release.path(SUMS);
    claim(bucket, SUMS, &sums, &sha256(&sums)?)?;
    artifacts.par_iter().try_for_each(|artifact| {
        create(bucket, &artifact.path, &release.path(&artifact.path), &artifact.sha256)?;
        let before = done.fetch_add(artifact.bytes, Ordering::Relaxed);
        progress.copied(before + artifact.bytes, total);
        Ok::<(), Error>(())
    })?;
    claim(bucket, MANIFEST, &manifest, &manifest_sha256)
}

/// Creates an object, or finds it with the same bytes.
fn create(bucket: &Bucket, name: &str, path: &Path, sha256: &str) -> Result<(), Error> {
    let is_created = bucket.create_from(name, path)?;
    created_or_same(bucket, name, is_created, sha256)
}

/// The same in one request, also for a large file: of two that create it at the same time, the second is refused.
fn claim(bucket: &Bucket, name: &str, path: &Path, sha256: &str) -> Result<(), Error> {
    let bytes = file::read(path).map_err(|e| Error::at(path, e))?;
    let is_created = bucket.create(name, &bytes)?;
    created_or_same(bucket, name, is_created, sha256)
}

fn created_or_same(bucket: &Bucket, name: &str, is_created: bool, sha256: &str) -> Result<(), Error> {
    if is_created || bucket.sha256(name)?.is_some_and(|there| there == sha256) {
        return Ok(());
    }
    Err(occupied(bucket, name))
}

fn occupied(bucket: &Bucket, name: &str) -> Error {
    let what = if name == MANIFEST {
        "another release"
    } else {
        "an object with other bytes, such as one of an unfinished upload"
    };
    let address = bucket.address();
    Error::Usage(format!("{address} already contains {what} ({name}); remove it, or choose another address with -o"))
}

/// Copies all objects into an empty folder.
fn download(bucket: &Bucket, folder: &Path, progress: &dyn Progress) -> Result<(), Error> {
    let objects = bucket.list("")?;
    progress.phase(&format!("downloading {} files from {}", objects.len(), bucket.address()));
    let total = objects.iter().map(|object| object.bytes).sum();
    let done = AtomicU64::new(0);
    progress.copied(0, total);
    objects.par_iter().try_for_each(|Object { name, bytes, .. }| {
        let path = folder.join(name);
        let at = |e| Error::at(&path, e);
        fs::create_dir_all(path.parent().unwrap_or(folder)).map_err(at)?;
        let mut file = AtomicFile::create(&Draft(folder).file(name)).map_err(at)?;
        bucket.read(name, &mut file)?;
        file.commit().map_err(at)?;
        progress.copied(done.fetch_add(*bytes, Ordering::Relaxed) + bytes, total);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runner::progress::Silent;
    use sastrugi_schemas::manifest::Origin;
    use sastrugi_store::release::{Head, ReleaseBuilder, STUDY, verify};
    use std::collections::BTreeMap;

    fn release(folder: &Path, text: &str) -> Release {
        let dest = folder.join("release");
        let study = "[study]\n";
        let head = Head {
            name: "demo".to_owned(),
            study_sha256: sastrugi_store::digest::of_bytes(study.as_bytes()),
            seed: 7,
            version: "0.1.0".to_owned(),
            license: "CC-BY-4.0".to_owned(),
        };
        let mut builder = ReleaseBuilder::beside(&dest, head).unwrap();
        builder.write_text("README.md", text, Origin::default()).unwrap();
        builder.write_text("dem/a.asc", "ncols 1", Origin::default()).unwrap();
        builder.write_text(STUDY, study, Origin::default()).unwrap();
        builder.seal(&dest).unwrap();
        Release::open(&dest).unwrap()
    }

    /// Addresses are no folders: the work area of a release there has a name of its own in the current folder, unless another is given.
    #[test]
    fn val_the_work_area_of_a_release() {
        assert_eq!(work_area(Path::new("out/snow"), None), Path::new("out/snow.work"));
        let [snow, other] = ["s3://terrains/snow", "s3://other/snow"].map(|at| work_area(Path::new(at), None));
        let name = snow.to_str().unwrap();
        assert!(name.starts_with("snow.s3-") && name.ends_with(".work") && !name.contains('/'), "{name}");
        assert_ne!(snow, other);
        for output in ["out/snow", "s3://terrains/snow"] {
            assert_eq!(work_area(Path::new(output), Some(Path::new("scratch"))), Path::new("scratch"));
        }
    }

    /// What is uploaded is downloaded and verifies; uploading it again changes nothing; another release is refused.
    #[test]
    fn val_a_release_is_uploaded_once() {
        let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let bucket = Bucket::in_memory("s3://bucket/demo").unwrap();
        let first = release(one.path(), "# Demo");
        upload(&first, &bucket, &Silent).unwrap();
        let before = bucket.list("").unwrap();
        assert_eq!(
            before.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(),
            ["README.md", SUMS, "dem/a.asc", MANIFEST, STUDY]
        );
        upload(&first, &bucket, &Silent).unwrap();
        assert_eq!(bucket.list("").unwrap(), before);
        let refused = upload(&release(two.path(), "# Other"), &bucket, &Silent).unwrap_err();
        assert!(matches!(&refused, Error::Usage(why) if why.contains("already contains another release")), "{refused}");
        assert_eq!(bucket.list("").unwrap(), before);
        let back = tempfile::tempdir().unwrap();
        download(&bucket, back.path(), &Silent).unwrap();
        let report = verify(back.path()).unwrap();
        assert_eq!((report.problems, report.files), (Vec::new(), 4));
    }

    /// An upload that was interrupted has no manifest. The same release resumes it; another release does not overwrite it.
    #[test]
    fn val_an_interrupted_upload_is_continued() {
        let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let bucket = Bucket::in_memory("s3://bucket/demo").unwrap();
        let first = release(one.path(), "# Demo");
        upload(&first, &bucket, &Silent).unwrap();
        bucket.remove(MANIFEST).unwrap();
        bucket.remove("dem/a.asc").unwrap();
        let refused = upload(&release(two.path(), "# Other"), &bucket, &Silent).unwrap_err();
        assert!(
            matches!(&refused, Error::Usage(why) if why.contains("one of an unfinished upload (SHA256SUMS)")),
            "{refused}"
        );
        assert!(!bucket.contains(MANIFEST).unwrap());
        upload(&first, &bucket, &Silent).unwrap();
        assert_eq!(bucket.list("").unwrap().len(), 5);
    }

    /// An upload that has just begun has the address: nothing of another release is uploaded, not even large files, which have no condition.
    #[test]
    fn val_the_checksums_claim_the_address() {
        let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let bucket = Bucket::in_memory("s3://bucket/demo").unwrap();
        let first = release(one.path(), "# Demo");
        assert!(bucket.create_from(SUMS, &first.path(SUMS)).unwrap());
        let before = bucket.list("").unwrap();
        assert!(upload(&release(two.path(), "# Other"), &bucket, &Silent).is_err());
        assert_eq!(bucket.list("").unwrap(), before);
        upload(&first, &bucket, &Silent).unwrap();
        assert_eq!(bucket.list("").unwrap().len(), 5);
    }

    /// The copy that an earlier run left in the work area does not stand in the way; the release at the address does.
    #[test]
    fn val_only_what_is_at_the_address_is_kept() {
        let work = tempfile::tempdir().unwrap();
        let bucket = Bucket::in_memory("s3://bucket/demo").unwrap();
        let run = |text: &str| {
            releasing_to(&bucket, work.path(), &Silent, |folder, _, replace| {
                assert!(replace && folder == work.path().join("release"));
                release(work.path(), text);
                Ok(RunSummary {
                    output: folder.to_owned(),
                    items: 1,
                    computed: 1,
                    failures: Vec::new(),
                    notes: Vec::new(),
                    failed_in: BTreeMap::new(),
                    cache: None,
                })
            })
        };
        run("# Demo").unwrap();
        let before = bucket.list("").unwrap();
        let refused = run("# Other").unwrap_err();
        assert!(matches!(&refused, Error::Usage(why) if why.contains("already contains another release")), "{refused}");
        assert_eq!(bucket.list("").unwrap(), before);
    }

    #[test]
    fn val_addresses_of_releases() {
        assert_eq!(address(Path::new("s3://bucket/a")), Some("s3://bucket/a"));
        assert_eq!(address(Path::new("a/s3")), None);
        let name = |address: &str| local_name(address).to_string_lossy().into_owned();
        assert!(name("s3://bucket/a/b/").starts_with("b.s3-") && name("s3://bucket").starts_with("bucket.s3-"));
        assert_eq!(name("s3://bucket/a/b/"), name("s3://bucket/a/b"));
        assert_ne!(name("s3://bucket/a/b"), name("s3://bucket/c/b"));
    }

    /// Nothing becomes a folder called `gs:`.
    #[test]
    fn val_places_that_are_not_supported() {
        let said = |checked: Result<(), Error>| match checked {
            Err(Error::Usage(why)) => why,
            other => format!("{other:?}"),
        };
        for other in ["gs://b/c", "S3://b/c", "s3:/b", "file:///tmp/a"] {
            assert!(said(check_place(Path::new(other))).contains("give a folder, or s3://bucket/prefix"), "{other}");
            assert!(said(check_local(Path::new(other))).contains("must be a path on this machine"), "{other}");
        }
        let made =
            releasing(Path::new("s3://b/c"), Some(Path::new("gs://b")), false, &Silent, |_, _, _| panic!("made"));
        assert!(said(made.map(drop)).contains("gs://b: this output must be a path"));
        assert!(check_place(Path::new("s3://b/c")).is_ok() && check_local(Path::new("s3://b/c")).is_err());
        for check in [check_place, check_local] {
            assert!(check(Path::new("release")).is_ok());
            assert!(said(check(Path::new(""))).contains("is empty"));
        }
    }
}
