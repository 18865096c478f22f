//! Fit files.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_stages::verbs::texture::read_fit;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = read_fit(&file("fit.json", bytes));
});
