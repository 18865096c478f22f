//! Masked moving average and masked covariance of 2048^2 cells, and the whole fit, each beside its floor.
//!
//! Floors: copying the raster (moving average), and four real transforms of it, two of the data and two of the mask
//! (covariance to 33 lags). The specification's targets, at 4096^2, are 0.35 times numpy's summed-area table and 0.5 times
//! scipy's FFT. Run one-threaded: `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench masked_covariance`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_numeric::fft::RealFft2;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_texture::covariance::masked_covariance;
use sastrugi_texture::detrend::{BoxWindow, box_mean};
use sastrugi_texture::{FitParameters, FitSettings};

const N: usize = 2048;

fn main() {
    divan::main();
}

/// A rough surface, a twentieth of it without data.
fn raster() -> Vec<f64> {
    let mut stream = Streams::for_seed(1, "bench").stream("raster");
    let mut walk = 0.0;
    let cell = |_| {
        walk = 0.9 * walk + stream.normal();
        if stream.uniform() < 0.05 { f64::NAN } else { walk }
    };
    (0..N * N).map(cell).collect()
}

/// The floor of the moving average.
#[divan::bench(sample_count = 20)]
fn copy_2048(bencher: Bencher) {
    let values = raster();
    let mut copy = vec![0.0; values.len()];
    bencher.counter(ItemsCount::new(N * N)).bench_local(|| {
        copy.copy_from_slice(divan::black_box(&values));
        divan::black_box(&copy);
    });
}

#[divan::bench(sample_count = 10, args = [33, 201])]
fn moving_average_2048(bencher: Bencher, width: usize) {
    let values = raster();
    let window = BoxWindow { half: [width / 2; 2] };
    bencher.counter(ItemsCount::new(N * N)).bench(|| box_mean(&values, N, window));
}

/// The floor of the covariance.
#[divan::bench(sample_count = 10)]
fn four_real_transforms_2048(bencher: Bencher) {
    let fft = RealFft2::new(N, N);
    let field: Vec<f64> = (0..N * N).map(|k| (k % 7) as f64).collect();
    bencher.counter(ItemsCount::new(N * N)).bench(|| {
        let [data, mask] = [fft.forward(&field), fft.forward(&field)];
        [fft.inverse(data), fft.inverse(mask)]
    });
}

#[divan::bench(sample_count = 10)]
fn masked_covariance_2048_33_lags(bencher: Bencher) {
    let values = raster();
    bencher.counter(ItemsCount::new(N * N)).bench(|| masked_covariance(&values, N, [32; 2]));
}

/// Outliers, moving average, trimming, covariance and the corrected fit, from a DEM in memory.
#[divan::bench(sample_count = 5)]
fn fit_2048(bencher: Bencher) {
    let texture = serde_json::json!({ "size_m": [122.88, 122.88], "cell_m": 0.06 });
    let parameters = [("sigma_m", 0.1), ("range_m", 0.28)].map(|(k, v)| (k.to_owned(), v)).into();
    let truth = sastrugi_schemas::fit::FitFile { model: "exponential".to_owned(), parameters, ..Default::default() };
    let made = sastrugi_texture::prepare("fft_ma", &texture, &truth).expect("the bench's own parameters are valid");
    let made = made.generate(&Streams::for_seed(1, "texture")).expect("the tile is wide enough");
    let dem = Grid::new(Geometry::square(N, N, 0.06), made.grid.values);
    let parameters = FitParameters { bootstrap: 0, ..FitParameters::default() };
    let settings = FitSettings::try_from(parameters).expect("the defaults are valid");
    let streams = Streams::for_seed(1, "fit");
    bencher.counter(ItemsCount::new(N * N)).bench(|| sastrugi_texture::fit(&dem, &settings, &streams));
}
