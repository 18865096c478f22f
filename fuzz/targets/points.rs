//! Point clouds, LAS and LAZ.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::dem;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = dem::read(&file("a.las", bytes));
});
