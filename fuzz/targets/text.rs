//! Transects and altimetry, columns of text.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::transect::TransectOptions;
use sastrugi_store::{altimetry, transect};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = file("a.csv", bytes);
    transect::looks_like(&path);
    let _ = transect::read(&path, &TransectOptions::default());
    let _ = altimetry::read(&path);
});
