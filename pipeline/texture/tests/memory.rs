//! What FFT-MA and the methods that repeat a site allocate lies within what they state; of FFT-MA it is what its module header says.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::Streams;
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::synth::statistics;
use sastrugi_texture::{Measured, prepare, prepare_from};
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, PoisonError};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Held by a test, since all allocations are counted together.
static ALONE: Mutex<()> = Mutex::new(());

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
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
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

/// The methods that repeat a site, from a site of 512 x 512 cells, as it was measured and for a background; what a binding to the fit holds counts too.
/// Rounds of `wavelet_statistics` are alike, so one (and two finishing) is enough.
#[test]
fn val_textures_of_a_site_take_the_memory_that_they_state() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let parameters = [("sigma_m", 0.05), ("range_m", 0.4)].map(|(k, v)| (k.to_owned(), v)).into();
    let truth = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
    let size = json!({ "size_px": [512, 512], "cell_m": 0.1 });
    let texture = prepare("fft_ma", &size, &truth).expect("the parameters are valid");
    let residual = texture.generate(&Streams::for_seed(1, "site")).expect("a texture").grid;
    let statistics = statistics::measure(&residual, [48; 2]).expect("the site is large enough");
    let fit = FitFile { statistics: Some(Box::new(statistics)), window_m: Some([3.3; 2]), ..FitFile::default() };
    let measured = Arc::new(Measured { residual });
    for method in ["modulated", "wavelet_statistics", "quilting", "exemplar"] {
        for (covariance, periodic) in [("surface", true), ("residual", true), ("residual", false)] {
            let mut raw = size.clone();
            raw["covariance"] = json!(covariance);
            raw["periodic"] = json!(periodic);
            if method == "wavelet_statistics" {
                raw["rounds"] = json!(1);
            }
            if method == "exemplar" {
                raw["scan"] = json!(100);
            }
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool of threads");
            let [peak, stated] = pool.install(|| {
                let before = ALLOCATED.current_usage();
                ALLOCATED.reset_peak_usage();
                let texture = prepare_from(method, &raw, &fit, Some(&measured)).expect("the site suits the method");
                let made = texture.generate(&Streams::for_seed(1, "texture")).expect("a texture");
                let peak = ALLOCATED.peak_usage() - before;
                drop(made);
                [peak as f64, texture.cost().memory_bytes as f64]
            });
            println!("{method}, {raw}: {:.1} MB, stated {:.1} MB", 1e-6 * peak, 1e-6 * stated);
            assert!(peak <= stated + SMALL && stated <= SLACK * peak + SMALL, "{method}, {raw}: {peak} {stated}");
        }
    }
}
