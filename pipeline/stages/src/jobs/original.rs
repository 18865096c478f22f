//! Stage `original`: copies a measured file into the release unchanged.
//!
//! It is an item of its own, so that a release still holds its source files if their import failed. Masks (stage [`MASK_STAGE`]) and
//! the rasters and points that generators use (stage [`INPUT_STAGE`]) are copied in the same way.

use crate::builder::{BuildError, input_file};
use crate::job::{Estimate, ItemRef, Job, JobError, Outcome, Product, Work};
use crate::revision::Room;
use crate::runner::graph::{InputFile, Node};
use sastrugi_store::{atomic, dem, digest};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Name of the stage.
pub const STAGE: &str = "original";
/// Name of the stage of masks.
pub const MASK_STAGE: &str = "mask";
/// Name of the stage of the input files of generators.
pub const INPUT_STAGE: &str = "input";

/// True for stages that only copy files into the release.
pub fn only_copies(stage: &str) -> bool {
    [STAGE, MASK_STAGE, INPUT_STAGE].contains(&stage)
}

/// A measured file with its accompanying files.
pub struct Original {
    files: Vec<Copied>,
}

struct Copied {
    input: InputFile,
    bytes: u64,
    /// Path in the release.
    release_path: String,
}

impl Original {
    /// A file in `folder`; `place` is its path in the release without the extension.
    ///
    /// # Errors
    /// A file that is missing or cannot be read.
    pub fn of(place: &str, folder: &Path, file: &str) -> Result<Self, BuildError> {
        let path = folder.join(file);
        let mut files = vec![Copied::of(path.clone(), release_path(place, file, &extension(file)))?];
        if let Some(prj) = dem::sidecar(&path) {
            files.push(Copied::of(prj, format!("{place}.prj"))?);
        }
        Ok(Self { files })
    }

    /// Adds an accompanying file with its path in the release.
    ///
    /// # Errors
    /// A file that is missing or cannot be read.
    pub fn add(&mut self, path: PathBuf, release_path: String) -> Result<(), BuildError> {
        self.files.push(Copied::of(path, release_path)?);
        Ok(())
    }

    /// Size of the measured file, bytes.
    pub fn bytes(&self) -> u64 {
        self.files[0].bytes
    }

    /// Its path in the release.
    pub fn release_path(&self) -> &str {
        &self.files[0].release_path
    }

    /// SHA-256 of its bytes.
    pub fn sha256(&self) -> &str {
        &self.files[0].input.sha256
    }

    /// All files with their hashes.
    pub fn inputs(&self) -> Vec<InputFile> {
        self.files.iter().map(|f| f.input.clone()).collect()
    }

    /// The item that copies the files into the release.
    pub fn node(self, stage: &str, id: &str) -> Node {
        let inputs = self.inputs();
        Node { item: ItemRef::new(stage, id), parents: Vec::new(), inputs, stream: None, job: Box::new(self) }
    }
}

impl Copied {
    fn of(path: PathBuf, release_path: String) -> Result<Self, BuildError> {
        let (bytes, input) = input_file(path)?;
        Ok(Self { input, bytes, release_path })
    }

    /// Name in the item's folder.
    fn name(&self) -> &str {
        name(&self.release_path)
    }
}

/// Name in the item's folder of the file with this path in the release.
pub fn name(release_path: &str) -> &str {
    release_path.rsplit('/').next().unwrap_or_default()
}

/// The file extension in lower case; `dat` if it has none that is allowed in a release path.
///
/// ```
/// use sastrugi_stages::jobs::original::extension;
///
/// assert_eq!(extension("site/Snow.TIF"), "tif");
/// assert_eq!(extension("no-ending"), "dat");
/// ```
pub fn extension(file: &str) -> String {
    let ending = Path::new(file).extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let plain = !ending.is_empty() && ending.len() <= 8 && ending.bytes().all(|b| b.is_ascii_alphanumeric());
    if plain { ending } else { "dat".to_owned() }
}

/// Path of a file in the release. An .hgt tile keeps its name, which gives its position, but without additions such as those of a
/// repeated download.
fn release_path(place: &str, file: &str, extension: &str) -> String {
    let stem = Path::new(file).file_stem().and_then(|n| n.to_str()).unwrap_or_default();
    let tile = stem.split(|c: char| !c.is_ascii_alphanumeric()).find(|word| !word.is_empty());
    match tile {
        Some(tile) if extension == "hgt" => format!("{place}/{tile}.hgt"),
        _ => format!("{place}.{extension}"),
    }
}

impl Job for Original {
    fn recipe(&self) -> Value {
        json!({ "files": self.files.iter().map(|f| &f.release_path).collect::<Vec<_>>() })
    }

    fn rooms(&self) -> &'static [Room] {
        &[]
    }

    fn memory_bytes(&self) -> u64 {
        // The copy goes through a buffer.
        1 << 20
    }

    fn estimate(&self) -> Estimate {
        let bytes = self.files.iter().map(|f| f.bytes as f64).sum();
        Estimate { seconds: 0.01 + bytes / 500e6, bytes }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let mut products = Vec::new();
        for file in &self.files {
            copy(&file.input, work, file.name())?;
            products.push(Product::released(file.name(), file.release_path.clone(), None));
        }
        Ok(Outcome { products, ..Outcome::default() })
    }
}

fn copy(input: &InputFile, work: &Work<'_>, name: &str) -> Result<(), JobError> {
    let unwritable = |e| JobError::at(&work.folder.0.join(name), e);
    let unreadable = |e: std::io::Error| JobError::input(format!("{}: {e}", input.path.display()));
    let mut from = sastrugi_store::file::open(&input.path).map_err(unreadable)?;
    let mut to = atomic::AtomicFile::create(&work.output(name)).map_err(unwritable)?;
    let (_, sha256) = digest::copy(&mut from, &mut to).map_err(unwritable)?;
    if sha256 != input.sha256 {
        return Err(JobError::input(format!("{}: the file changed during the run", input.path.display())));
    }
    to.commit().map_err(unwritable)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: &[u8] = b"ncols 1\nnrows 1\ncellsize 1\n7.5\n";

    #[test]
    fn val_paths_in_the_release() {
        let place = |file: &str| release_path("dem/site", file, &extension(file));
        assert_eq!(place("a/Snow.TIF"), "dem/site.tif");
        assert_eq!(place("tiles/N44W072.hgt"), "dem/site/N44W072.hgt");
        assert_eq!(place("no-ending"), "dem/site.dat");
        assert_eq!(place("odd.e n d"), "dem/site.dat");
    }

    /// A repeated download has additions to its name, which are dropped.
    #[test]
    fn val_tiles_keep_only_their_position() {
        let place = |file: &str| release_path("dem/site", file, &extension(file));
        assert_eq!(place("N44W072 (1).hgt"), "dem/site/N44W072.hgt");
        assert_eq!(place("_.hgt"), "dem/site.hgt");
        assert_eq!(extension("a.toolongext"), "dat");
        assert!(only_copies(STAGE) && only_copies(MASK_STAGE) && only_copies(INPUT_STAGE) && !only_copies("dem"));
    }

    /// The copy has the bytes and the hash of the file; a file that changed after it was hashed is refused.
    #[test]
    fn val_a_file_is_copied_unless_it_changed() {
        let (folder, draft) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        // An ASCII grid is one whatever its ending, and so has its .prj file with it.
        std::fs::write(folder.path().join("c.txt"), GRID).unwrap();
        std::fs::write(folder.path().join("c.prj"), b"geographic").unwrap();
        let original = Original::of("dem/site", folder.path(), "c.txt").unwrap();
        let sha256 = "def20f00d80c499fcc9f5602e2d7c7b8832f1639c1e4b7eb05ee20f35a5eaffd";
        assert_eq!((original.bytes(), original.release_path(), original.sha256()), (31, "dem/site.txt", sha256));
        let parents = std::collections::BTreeMap::new();
        let work = Work { folder: atomic::Draft(draft.path()), parents: &parents };
        let products = original.run(&work).unwrap().products;
        let places: Vec<Option<&str>> = products.iter().map(|product| product.release_path.as_deref()).collect();
        assert_eq!(places, [Some("dem/site.txt"), Some("dem/site.prj")]);
        assert_eq!(std::fs::read(draft.path().join("site.txt")).unwrap(), GRID);
        assert_eq!(std::fs::read(draft.path().join("site.prj")).unwrap(), b"geographic");
        std::fs::write(folder.path().join("c.txt"), b"abd").unwrap();
        let error = original.run(&work).unwrap_err();
        assert!(error.message.ends_with("c.txt: the file changed during the run"), "{error}");
        assert_eq!(error.cause, crate::job::Cause::Input);
    }

    /// The name of a tile gives its position, so it is part of the key; the names of other files are not.
    #[test]
    fn prop_the_key_depends_only_on_what_determines_the_result() {
        let folder = tempfile::tempdir().unwrap();
        let recipe = |file: &str| {
            std::fs::write(folder.path().join(file), b"x").unwrap();
            Original::of("dem/site", folder.path(), file).unwrap().recipe()
        };
        assert_eq!(recipe("a.tif"), recipe("b.tif"));
        assert_ne!(recipe("N44W072.hgt"), recipe("N45W072.hgt"));
        let inputs = |file: &str| Original::of("dem/site", folder.path(), file).unwrap().inputs();
        std::fs::write(folder.path().join("c.asc"), GRID).unwrap();
        let bare = inputs("c.asc");
        std::fs::write(folder.path().join("c.prj"), b"geographic").unwrap();
        assert_eq!((bare.len(), inputs("c.asc").len()), (1, 2));
        // A file with that name beside another file is none of its own.
        std::fs::write(folder.path().join("c.txt"), b"x").unwrap();
        assert_eq!(inputs("c.txt").len(), 1);
        // What is not a file is refused, rather than left out.
        std::fs::write(folder.path().join("d.asc"), GRID).unwrap();
        std::fs::create_dir(folder.path().join("d.prj")).unwrap();
        let refused = Original::of("dem/site", folder.path(), "d.asc").err().unwrap().to_string();
        assert!(refused.ends_with("d.prj is a folder, not a file"), "{refused}");
    }
}
