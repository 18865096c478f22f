//! Memory limits: writing a raster stays within its documented memory, and reading a log within what its file can hold.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_store::dem::{self, Compression, Crs, WriteOptions};
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
