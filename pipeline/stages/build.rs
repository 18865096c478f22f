//! Hashes the sources of every room without its tests, so that a stage's cache key changes if and only if code that it uses changes.

use std::fs;
use std::path::{Path, PathBuf};

const ROOMS: [(&str, &str); 14] = [
    ("SCHEMAS", "../../schemas/src"),
    ("NUMERIC", "../numeric/src"),
    ("ROUGHNESS", "../roughness/src"),
    ("TERRAIN", "../terrain/src"),
    ("TEXTURE", "../texture/src"),
    ("MOBILITY", "../mobility/src"),
    ("NAVIGATION", "../navigation/src"),
    ("IMAGING", "../imaging/src"),
    ("STORE", "../store/src"),
    ("STATISTICS", "../../analysis/statistics/src"),
    ("JOB", "src/job.rs"),
    ("JOBS", "src/jobs"),
    ("OPERATIONS", "src/operations"),
    ("DEPENDENCIES", "../../Cargo.lock"),
];

fn main() {
    for (name, path) in ROOMS {
        let mut files = Vec::new();
        collect(Path::new(path), &mut files);
        files.sort();
        let mut hasher = blake3::Hasher::new();
        for file in files {
            // Not the folder, in which tests change: a new file comes with a change of the one that names it.
            println!("cargo:rerun-if-changed={}", file.display());
            hasher.update(file.to_string_lossy().as_bytes());
            hasher.update(&fs::read(&file).unwrap_or_default());
        }
        println!("cargo:rustc-env=SASTRUGI_REVISION_{name}={}", hasher.finalize().to_hex());
    }
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    match fs::read_dir(path) {
        Ok(entries) => entries
            .flatten()
            .map(|entry| entry.path())
            .filter(|path| !is_test(path))
            .for_each(|path| collect(&path, files)),
        Err(_) => files.push(path.to_owned()),
    }
}

fn is_test(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "tests" || name == "tests.rs")
}
