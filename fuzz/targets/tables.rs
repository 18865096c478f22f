//! Parquet tables of a release.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_schemas::tables::{MissionRow, SampleRow};
use sastrugi_store::parquet::{describe_file, read_table};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = file("a.parquet", bytes);
    let _ = describe_file(&path);
    let _ = read_table::<MissionRow>(&path);
    let _ = read_table::<SampleRow>(&path);
});
