//! Rasters, read whole and row by row. The first byte selects the file name, by which some formats are recognised.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_store::dem::{self, ReadOptions};

const NAMES: [&str; 8] = ["a.tif", "a.asc", "a.npy", "N44W072.hgt", "a.png", "a.txt", "S01E180.hgt", "a.hgt"];
/// Bytes of the smaller tile of an .hgt file: more than the fuzzer makes, so they are the input over and over. It takes long, so one choice alone is this.
const TILE: usize = 2 * 1201 * 1201;
/// Blocks of rows that are read.
const BLOCKS: usize = 8;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((choice, bytes)) = bytes.split_first() else { return };
    let path = match *choice {
        u8::MAX => file("N44W072.hgt", &bytes.iter().copied().cycle().take(TILE).collect::<Vec<u8>>()),
        choice => file(NAMES[usize::from(choice) % NAMES.len()], bytes),
    };
    let options = ReadOptions::default();
    dem::claimed(&path, &options);
    let _ = dem::read(&path);
    let _ = dem::read_classes(&path);
    let Ok(mut reader) = dem::open(&path, &options) else { return };
    let (rows, block) = (reader.geometry().rows, reader.block_rows());
    for first in (0..rows).step_by(block).take(BLOCKS) {
        let _ = reader.read_rows(first..rows.min(first + block));
    }
});
