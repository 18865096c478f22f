//! Hashes the sources of every room, so that a stage's cache key changes if and only if code that it uses changes.

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
        println!("cargo:rerun-if-changed={path}");
        let mut files = Vec::new();
        collect(Path::new(path), &mut files);
        files.sort();
        let mut hasher = blake3::Hasher::new();
        for file in files {
            hasher.update(file.to_string_lossy().as_bytes());
            hasher.update(&fs::read(&file).unwrap_or_default());
        }
        println!("cargo:rustc-env=SASTRUGI_REVISION_{name}={}", hasher.finalize().to_hex());
    }
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    match fs::read_dir(path) {
        Ok(entries) => entries.flatten().for_each(|entry| collect(&entry.path(), files)),
        Err(_) => files.push(path.to_owned()),
    }
}
