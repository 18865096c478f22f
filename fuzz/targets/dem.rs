//! Rasters: the first byte chooses the ending, by which some formats are told.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::dem::{self, ReadOptions};

const NAMES: [&str; 6] = ["a.tif", "a.asc", "a.npy", "a.hgt", "a.png", "a.txt"];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((choice, bytes)) = bytes.split_first() else { return };
    let path = file(NAMES[*choice as usize % NAMES.len()], bytes);
    let options = ReadOptions::default();
    dem::claimed(&path, &options);
    let _ = dem::read(&path);
    let _ = dem::read_classes(&path);
    let _ = dem::open(&path, &options);
});
