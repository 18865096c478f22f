//! What writing a raster allocates lies within what is said of it.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_store::dem::{self, Compression, Crs, WriteOptions};
use std::path::Path;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Directories, buffers of the threads, and rows and columns that fill up tiles, bytes.
const SMALL: u64 = 8 << 20;

/// Noise, which no compressor makes smaller, and a slope, which all do.
#[test]
fn val_writing_takes_the_memory_that_is_stated() {
    let side = 2000;
    let noise = |k: usize| f64::from_bits(0x3ff0_0000_0000_0000 | (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 12);
    for (name, height) in [("noise", &noise as &dyn Fn(usize) -> f64), ("slope", &|k| k as f64 * 1e-3)] {
        let grid = Grid::new(Geometry::square(side, side, 0.05), (0..side * side).map(height).collect());
        for compression in [Compression::None, Compression::Deflate, Compression::Zstd] {
            let options = WriteOptions { compression, cloud_optimised: true, ..WriteOptions::default() };
            let before = ALLOCATED.current_usage();
            ALLOCATED.reset_peak_usage();
            let (bytes, _) = dem::encode(Path::new("a.tif"), &grid, &Crs::default(), &options).unwrap();
            let peak = (ALLOCATED.peak_usage() - before) as u64;
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
