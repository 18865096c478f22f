//! What FFT-MA allocates lies within what it states, and is what its module header says.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::Streams;
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::prepare;
use serde_json::{Value, json};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Buffers of the threads and tables, bytes.
const SMALL: f64 = 4e6;
/// A statement may be so many times too large.
const SLACK: f64 = 4.0;

/// Bytes at the peak of making a texture, and as stated.
fn measured(raw: &Value, threads: usize) -> [f64; 2] {
    let parameters = [("sigma_m", 0.05), ("range_m", 0.4)].map(|(k, v)| (k.to_owned(), v)).into();
    let fit = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
    pool.install(|| {
        let texture = prepare("fft_ma", raw, &fit).expect("the parameters are valid");
        let before = ALLOCATED.current_usage();
        ALLOCATED.reset_peak_usage();
        let made = texture.generate(&Streams::for_seed(1, "texture")).expect("a texture");
        let peak = ALLOCATED.peak_usage() - before;
        drop(made);
        [peak as f64, texture.cost().memory_bytes as f64]
    })
}

/// Bytes per torus cell at the peak, as the module header says: 10 where the axes of anisotropy are the grid's, otherwise 16. A crop of 700
/// cells has a torus of at least 1400.
#[test]
fn val_textures_take_the_memory_that_they_state() {
    let torus = 1500.0 * 1500.0;
    for (raw, per_cell) in [
        (json!({ "size_px": [1500, 1500] }), Some(10.0)),
        (json!({ "size_px": [1500, 1500], "phase": "gaussian", "ratio": 0.5, "azimuth_deg": 90.0 }), Some(10.0)),
        (json!({ "size_px": [1500, 1500], "ratio": 0.5, "azimuth_deg": 30.0 }), Some(16.0)),
        (json!({ "size_px": [700, 700], "periodic": false }), None),
    ] {
        for threads in [1, 4] {
            let [peak, stated] = measured(&raw, threads);
            println!("{raw}, {threads} threads: {:.1} MB, stated {:.1} MB", 1e-6 * peak, 1e-6 * stated);
            assert!(peak <= stated + SMALL && stated <= SLACK * peak + SMALL, "{raw}: {peak} {stated}");
            if let Some(bytes) = per_cell {
                assert!(
                    peak > bytes * torus - SMALL && peak < bytes * torus + SMALL,
                    "{raw}: {peak}, {bytes} per cell"
                );
            }
        }
    }
}
