//! The manifest and the sums of a release, parted by a zero byte.
#![no_main]

use sastrugi_fuzz::{file, folder};
use sastrugi_store::release::{MANIFEST, Release, SUMS, verify};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (manifest, sums) = bytes.iter().position(|b| *b == 0).map_or((bytes, &[][..]), |at| bytes.split_at(at));
    file(MANIFEST, manifest);
    file(SUMS, sums.strip_prefix(&[0]).unwrap_or(sums));
    let _ = Release::open(folder());
    let _ = verify(folder());
});
