//! Memory limits: writing a raster stays within its documented memory, and reading a raster or a log within what its file can hold.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_store::dem::{self, Compression, Crs, ReadOptions, WriteOptions};
use sastrugi_store::mcap::{describe_file, read_log};
use std::path::Path;
use std::sync::Mutex;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Allowance for directories, thread buffers and padding of tiles, bytes.
const SMALL: u64 = 8 << 20;

/// Allocations are counted for the whole process, so one test runs at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Peak allocation of a call, bytes.
fn peak_of<T>(call: impl FnOnce() -> T) -> (u64, T) {
    let before = ALLOCATED.current_usage();
    ALLOCATED.reset_peak_usage();
    let result = call();
    ((ALLOCATED.peak_usage() - before) as u64, result)
}

/// Noise, which no compressor reduces, and a slope, which all reduce.
#[test]
fn val_writing_stays_within_the_documented_memory() {
    let _alone = ALONE.lock().unwrap();
    let side = 2000;
    let noise = |k: usize| f64::from_bits(0x3ff0_0000_0000_0000 | (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 12);
    for (name, height) in [("noise", &noise as &dyn Fn(usize) -> f64), ("slope", &|k| k as f64 * 1e-3)] {
        let grid = Grid::new(Geometry::square(side, side, 0.05), (0..side * side).map(height).collect());
        for compression in [Compression::None, Compression::Deflate, Compression::Zstd] {
            let options = WriteOptions { compression, cloud_optimised: true, ..WriteOptions::default() };
            let (peak, encoded) = peak_of(|| dem::encode(Path::new("a.tif"), &grid, &Crs::default(), &options));
            let (bytes, _) = encoded.unwrap();
            let stated = dem::writing_bytes((side * side) as u64);
            println!(
                "{name} {compression:?}: {} bytes, peak {:.1} MB, stated {:.1} MB",
                bytes.len(),
                1e-6 * peak as f64,
                1e-6 * stated as f64
            );
            assert!(peak <= stated + SMALL, "{name} {compression:?}: {peak} bytes, stated {stated}");
        }
    }
}

/// Memory is not allocated for lengths that a damaged file merely claims.
#[test]
fn val_logs_allocate_no_memory_for_claimed_lengths() {
    let _alone = ALONE.lock().unwrap();
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let record = |opcode: u8, length: u64, content: &[u8]| [&[opcode], &length.to_le_bytes()[..], content].concat();
    let chunk = |compression: &str, content: &[u8]| {
        let times = [0; 16];
        let (size, crc) = ((1u64 << 40).to_le_bytes(), [0; 4]);
        let (name, stored) = ((compression.len() as u32).to_le_bytes(), (content.len() as u64).to_le_bytes());
        let body = [&times, &size[..], &crc, &name, compression.as_bytes(), &stored, content].concat();
        record(6, body.len() as u64, &body)
    };
    let header = record(1, 8, &[0; 8]);
    let claim = record(5, (1 << 30) - 1, b"message");
    let compressed = zstd::encode_all(&claim[..], 3).unwrap();
    let claims = [claim.clone(), chunk("", &claim), chunk("zstd", &compressed), record(5, u64::MAX, b"")];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    for (k, claim) in claims.iter().enumerate() {
        std::fs::write(&path, [MAGIC, &header, claim].concat()).unwrap();
        let (peak, log) = peak_of(|| read_log(&path));
        println!("claim {k}: peak {:.1} MB", 1e-6 * peak as f64);
        assert!(peak < SMALL, "claim {k}: {peak} bytes");
        assert!(log.map_or(true, |log| log.broken.is_some()), "claim {k}");
    }
}

/// Nor for texts that are longer than the record that holds them, in the data of a recording or in its summary.
#[test]
fn val_logs_allocate_no_memory_for_claimed_texts() {
    let _alone = ALONE.lock().unwrap();
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    // Opcode, and bytes before the first text: header, schema, channel, attachment, metadata, and their indexes.
    for (opcode, before) in [(1_u8, 0), (3, 2), (4, 4), (9, 16), (10, 40), (12, 0), (13, 16)] {
        let body = [&vec![0; before][..], &1_919_251_503_u32.to_le_bytes(), b"text"].concat();
        let record = [&[opcode], &(body.len() as u64).to_le_bytes()[..], &body].concat();
        let footer = [&[2][..], &20_u64.to_le_bytes(), &8_u64.to_le_bytes(), &[0; 12]].concat();
        std::fs::write(&path, [MAGIC, &record, &footer, MAGIC].concat()).unwrap();
        let (peak, (log, summary)) = peak_of(|| (read_log(&path), describe_file(&path)));
        assert!(peak < SMALL, "opcode {opcode}: {peak} bytes");
        for refused in [log.unwrap_err(), summary.unwrap_err()].map(|error| error.to_string()) {
            let words = "a record claims a string of 1919251503 bytes, but has only 4 bytes left";
            assert!(refused.ends_with(words), "opcode {opcode}: {refused}");
        }
    }
}

/// A TIFF of int16 cells, in one strip or in tiles with this side; the file has 32 of them, whatever it claims. `texts` are tags of texts that the
/// file does not have, with their length.
fn tiff(side: u32, tile: Option<u32>, is_placed: bool, texts: &[[u32; 2]]) -> Vec<u8> {
    const STRIP: [u8; 64] = [1; 64];
    let places = if is_placed { [[33550, 12, 3, 0], [33922, 12, 6, 24]].to_vec() } else { Vec::new() };
    let blocks = if tile.is_some() { 4 } else { 3 };
    let after_tags = 8 + 2 + 12 * (7 + blocks + (places.len() + texts.len()) as u32) + 4;
    let strip_at = after_tags + 72 * u32::from(is_placed);
    // Tag, type (3 short, 4 long, 12 double), count, value or its place.
    let mut tags: Vec<[u32; 4]> = vec![
        [256, 4, 1, side],
        [257, 4, 1, side],
        [258, 3, 1, 16],
        [259, 3, 1, 1],
        [262, 3, 1, 1],
        [277, 3, 1, 1],
        [339, 3, 1, 2],
    ];
    let stored = STRIP.len() as u32;
    match tile {
        None => tags.extend([[273, 4, 1, strip_at], [278, 4, 1, side], [279, 4, 1, stored]]),
        Some(tile) => tags.extend([[322, 4, 1, tile], [323, 4, 1, tile], [324, 4, 1, strip_at], [325, 4, 1, stored]]),
    }
    tags.extend(texts.iter().map(|[tag, length]| [*tag, 2, *length, strip_at]));
    tags.extend(places.iter().map(|[tag, kind, count, at]| [*tag, *kind, *count, after_tags + at]));
    tags.sort_unstable();
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((tags.len() as u16).to_le_bytes());
    for [tag, kind, count, value] in tags {
        [tag, kind].iter().for_each(|number| bytes.extend((*number as u16).to_le_bytes()));
        [count, value].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    }
    bytes.extend([0; 4]);
    if is_placed {
        // Cells of 1 m; the corner of the first one is at (0, 0).
        [1.0, 1.0, 0.0].iter().chain(&[0.0; 6]).for_each(|number: &f64| bytes.extend(number.to_le_bytes()));
    }
    [bytes, STRIP.to_vec()].concat()
}

/// Nor for cells that the header of a raster claims: a file of 300 bytes cannot hold them.
#[test]
fn val_rasters_allocate_no_memory_for_claimed_cells() {
    let _alone = ALONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let options = ReadOptions::default();
    for is_placed in [false, true] {
        std::fs::write(&path, tiff(5, None, is_placed, &[])).unwrap();
        assert_eq!(dem::read(&path).unwrap().grid.values, [257.0; 25], "placed: {is_placed}");
        // Beyond the memory that any file may take, beyond the most cells of a raster, and as many as can be stated.
        for side in [10_000, 60_000, u32::MAX] {
            let bytes = tiff(side, None, is_placed, &[]);
            std::fs::write(&path, &bytes).unwrap();
            let (peak, errors) = peak_of(|| {
                assert_eq!(dem::claimed(&path, &options), None);
                [dem::read(&path).err(), dem::open(&path, &options).err()]
            });
            println!("{side}, placed: {is_placed}: peak {:.1} MB", 1e-6 * peak as f64);
            assert!(peak < SMALL, "{side}, placed: {is_placed}: {peak} bytes");
            let cells = u64::from(side) * u64::from(side);
            let words = format!("a.tif claims {cells} cells in a file of {} bytes", bytes.len());
            for error in errors {
                let error = error.unwrap();
                assert!(error.unusable_input() && error.to_string().ends_with(&words), "{side}, {is_placed}: {error}");
            }
        }
    }
}

/// Nor for tiles larger than their raster, nor for the texts of its header. What is legal is read.
#[test]
fn val_rasters_allocate_no_memory_for_claimed_tiles_and_texts() {
    let _alone = ALONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let (nodata, metadata) = (42_113, 42_112);
    for is_placed in [false, true] {
        // A strip with more rows than the raster is legal, and so is metadata that cannot be read.
        let mut legal = tiff(5, None, is_placed, &[[metadata, 8]]);
        let rows_per_strip = [278_u16.to_le_bytes(), 4_u16.to_le_bytes()].concat();
        let at = legal.windows(4).position(|bytes| bytes == rows_per_strip).unwrap();
        legal[at + 8..at + 12].fill(0xff);
        std::fs::write(&path, legal).unwrap();
        assert_eq!(dem::read(&path).unwrap().grid.values, [257.0; 25], "placed: {is_placed}");
        for (tile, texts) in [(Some(16_000), &[][..]), (None, &[[metadata, 1 << 30], [nodata, 0x7e00_0000]])] {
            std::fs::write(&path, tiff(5, tile, is_placed, texts)).unwrap();
            let (peak, read) = peak_of(|| dem::read(&path));
            println!("{tile:?}, placed: {is_placed}: peak {:.1} MB, {:?}", 1e-6 * peak as f64, read.as_ref().err());
            assert!(peak < SMALL, "{tile:?}, placed: {is_placed}: {peak} bytes");
            let error = read.unwrap_err().to_string();
            let words = match (tile, is_placed) {
                (Some(_), _) => "a.tif claims 256000000 cells in a file of ",
                (None, false) => "a.tif claims 1073741824 values of a tag in a file of ",
                (None, true) => "a.tif: not a readable TIFF: ",
            };
            assert!(error.contains(words), "{error}");
        }
    }
}
