//! The description of a shard and its study, separated by a zero byte.
#![no_main]

use sastrugi_fuzz::{file, folder};
use sastrugi_stages::runner::progress::Silent;
use sastrugi_stages::studies::merge;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (description, study) = bytes.iter().position(|b| *b == 0).map_or((bytes, &[][..]), |at| bytes.split_at(at));
    file("shard.json", description);
    file("study.toml", study.strip_prefix(&[0]).unwrap_or(study));
    let output = folder().with_extension("merged");
    let _ = merge(&[folder().to_owned()], &output, true, &Silent);
});
