//! Studies: read, checked, and planned.
#![no_main]

use sastrugi_fuzz::folder;
use sastrugi_stages::loaded::load_text;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = load_text(text, "study.toml", folder());
});
