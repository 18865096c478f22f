//! Textures that repeat a site, 1024 x 1024 cells from 1024 x 1024 cells, from fit and residual to heights.
//!
//! Targets on one core: `modulated` within twice `fft_ma`, `quilting` within 2 s, `exemplar` within 30 s, `wavelet_statistics` within 60 s. After
//! the table: the fastest time of each, over that of `fft_ma` in the same run. The site is a Gaussian field with an exponential covariance
//! of 8 cells times the exponential of a smoother one: rough in patches; its statistics have lags to 96 cells, as with a window of 64 cells.
//!
//! Other programs. Portilla and Simoncelli's synthesis in plenoptic (MIT; PyTorch), if its Python is installed (`floors/wavelet_statistics.py`;
//! `floors/set_up plenoptic`): seconds an iteration on one thread, printed before the table. The package index has, for quick sampling (Gravey and
//! Mariethoz 2020), only the client of a server (G2S 0.99.3); for direct sampling, interfaces to MPSlib (scikit-mps 0.6.0, which can compile it) and to
//! DeeSse (geone 1.3.4), neither of which has been run here; for quilting, no package by that name.
//!
//! The patches of `quilting` are 6 correlation lengths wide, here some 48 cells. On ground with a shorter correlation they are narrower and more, and
//! the time grows: see its module header.
//!
//! Run one-threaded: `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench measured_textures`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_benches::floor_in;
use sastrugi_numeric::{Grid, Streams, ops};
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::synth::statistics;
use sastrugi_texture::{Measured, prepare, prepare_from};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Instant;

const SIDE: u32 = 1024;
const CELLS: usize = (SIDE * SIDE) as usize;
/// Largest lag of the statistics, cells.
const LAG_MAX: usize = 96;
const METHODS: [&str; 5] = ["fft_ma", "modulated", "wavelet_statistics", "quilting", "exemplar"];

/// The fit of a site, with statistics, and the site's residual.
static SITE: LazyLock<(FitFile, Arc<Measured>)> = LazyLock::new(|| {
    let (ground, amplitude) = (field(0.05, 0.8, 1), field(0.4, 2.0, 2));
    let residual = ops::combine(&ground, &amplitude, |height_m, log| height_m * libm::exp(log));
    let statistics = statistics::measure(&residual, [LAG_MAX; 2]).expect("the site is large enough");
    (FitFile { statistics: Some(Box::new(statistics)), ..fit(0.05, 0.8) }, Arc::new(Measured { residual }))
});

/// Fastest time of each method so far, s.
static FASTEST: Mutex<BTreeMap<String, f64>> = Mutex::new(BTreeMap::new());

fn main() {
    match floor_in("plenoptic", "wavelet_statistics.py", &[&SIDE.to_string()]).as_deref() {
        Some(&[seconds]) => {
            println!("plenoptic, Portilla and Simoncelli, {SIDE}: {seconds:.1} s an iteration, of some 100")
        }
        _ => println!("plenoptic: not installed (benches/floors/set_up plenoptic)"),
    }
    divan::main();
    let fastest = FASTEST.lock().expect("no bench has panicked");
    let Some(fft_ma_s) = fastest.get("fft_ma") else { return };
    for (method, seconds) in METHODS.iter().filter_map(|method| Some((method, fastest.get(*method)?))) {
        println!("{method}: {seconds:.2} s, {:.1} times fft_ma", seconds / fft_ma_s);
    }
}

fn fit(sigma_m: f64, range_m: f64) -> FitFile {
    let parameters = [("sigma_m", sigma_m), ("range_m", range_m)].map(|(name, value)| (name.to_owned(), value)).into();
    FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() }
}

fn parameters() -> Value {
    json!({ "size_px": [SIDE, SIDE], "cell_m": 0.1 })
}

fn field(sigma_m: f64, range_m: f64, seed: u64) -> Grid {
    let texture = prepare("fft_ma", &parameters(), &fit(sigma_m, range_m)).expect("the bench's parameters are valid");
    texture.generate(&Streams::for_seed(seed, "site")).expect("the covariance fits the torus").grid
}

#[divan::bench(args = METHODS, sample_count = 3, sample_size = 1)]
fn texture_1024(bencher: Bencher, method: &str) {
    let (fit, measured) = &*SITE;
    bencher.counter(ItemsCount::new(CELLS)).bench(|| {
        let start = Instant::now();
        let texture = prepare_from(method, &parameters(), fit, Some(measured)).expect("the site suits the method");
        let made = texture.generate(&Streams::for_seed(1, "texture")).expect("the site suits the method");
        let seconds = start.elapsed().as_secs_f64();
        let mut fastest = FASTEST.lock().expect("no bench has panicked");
        let so_far = fastest.entry(method.to_owned()).or_insert(seconds);
        *so_far = so_far.min(seconds);
        made
    });
}
