//! The manifest and the checksums of a release, separated by a zero byte. Reading at once and piece by piece gives the
//! same result.
#![no_main]

use sastrugi_fuzz::{file, folder};
use sastrugi_schemas::manifest::Manifest;
use sastrugi_store::release::{MANIFEST, Release, SUMS, for_each_artifact, verify};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (manifest, sums) = bytes.iter().position(|b| *b == 0).map_or((bytes, &[][..]), |at| bytes.split_at(at));
    file(MANIFEST, manifest);
    file(SUMS, sums.strip_prefix(&[0]).unwrap_or(sums));
    let mut artifacts = Vec::new();
    let pieces = for_each_artifact(folder(), |artifact| artifacts.push(artifact));
    if let Ok(whole) = Release::open(folder()) {
        let rest = pieces.expect("what is read at once is read piece by piece");
        assert_eq!(&Manifest { artifacts, ..rest }, whole.manifest());
    }
    let _ = verify(folder());
});
