//! Recordings, MCAP.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::mcap::read_log;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = read_log(&file("a.mcap", bytes));
});
