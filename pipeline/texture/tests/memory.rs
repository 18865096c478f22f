//! What FFT-MA and the methods that repeat a site allocate lies within what they state; of FFT-MA it is what its module header says.

use peak_alloc::PeakAlloc;
use sastrugi_numeric::Streams;
use sastrugi_schemas::fit::{CovarianceMap, FitFile};
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

/// The same for measured covariances and for what a background lacks, with what a binding to the fit takes and holds; cells as wide as the fit's, and twice as
/// wide. With a range of 0.4 m the model's covariance is transformed, with one of 40 m its density is summed.
#[test]
fn val_textures_for_a_background_take_the_memory_that_they_state() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let at = |(r, c): (i32, i32)| 0.0025 / (1.0 + f64::from(r * r + c * c) / 16.0);
    let lags = (0..=37).flat_map(|r| (-37..=37).map(move |c| (r, c)));
    let map = CovarianceMap {
        base: "residual".to_owned(),
        model: "exponential".to_owned(),
        max_lag: [37; 2],
        covariance_m2: lags.map(at).collect(),
    };
    for (range_m, is_measured, cell_m, size_px) in [
        (0.4, true, 0.1, [1000, 1000]),
        (40.0, true, 0.1, [1000, 1000]),
        (40.0, true, 0.2, [500, 563]),
        (0.4, false, 0.1, [1000, 1000]),
        (0.4, false, 0.2, [500, 500]),
    ] {
        let parameters = [("sigma_m", 0.05), ("range_m", range_m)].map(|(k, v)| (k.to_owned(), v)).into();
        let model = if is_measured { "empirical" } else { "exponential" };
        let fit = FitFile {
            model: model.to_owned(),
            parameters,
            map: is_measured.then(|| map.clone()),
            window_m: Some([2.5; 2]),
            cell_m: Some([0.1; 2]),
            ..FitFile::default()
        };
        for periodic in [true, false] {
            let size_px = if periodic { size_px } else { size_px.map(|n| n / 2) };
            let raw = json!({ "size_px": size_px, "cell_m": cell_m, "periodic": periodic, "covariance": "residual" });
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool of threads");
            let [peak, stated] = pool.install(|| {
                let before = ALLOCATED.current_usage();
                ALLOCATED.reset_peak_usage();
                let texture = prepare("fft_ma", &raw, &fit).expect("the fit suits the method");
                let made = texture.generate(&Streams::for_seed(1, "texture")).expect("a texture");
                let peak = ALLOCATED.peak_usage() - before;
                drop(made);
                [peak as f64, texture.cost().memory_bytes as f64]
            });
            println!("{raw}, {range_m} m: {:.1} MB, stated {:.1} MB", 1e-6 * peak, 1e-6 * stated);
            assert!(peak <= stated + SMALL && stated <= SLACK * peak + SMALL, "{raw}, {range_m} m: {peak} {stated}");
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
