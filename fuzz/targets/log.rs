//! MCAP recordings: the complete file, and its summary alone.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::mcap::{describe_file, read_log};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = file("a.mcap", bytes);
    let _ = read_log(&path);
    let _ = describe_file(&path);
});
