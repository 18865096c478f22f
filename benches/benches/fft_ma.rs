//! FFT-MA texture of 2048^2 cells beside the transform it cannot do without.
//!
//! The specification's target, at 4096^2, is 0.35 times numpy's rfft2 FFT-MA; here the floor is one real transform of the
//! same size (`sastrugi_numeric`, same bits on every CPU). Run one-threaded:
//! `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench fft_ma`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_numeric::Streams;
use sastrugi_numeric::fft::RealFft2;
use sastrugi_schemas::fit::FitFile;
use serde_json::json;

const N: usize = 2048;

fn main() {
    divan::main();
}

/// The floor: one inverse real transform.
#[divan::bench(sample_count = 10)]
fn real_inverse_transform_2048(bencher: Bencher) {
    let fft = RealFft2::new(N, N);
    let spectrum = fft.forward(&(0..N * N).map(|k| (k % 7) as f64).collect::<Vec<_>>());
    bencher.counter(ItemsCount::new(N * N)).with_inputs(|| spectrum.clone()).bench_values(|s| fft.inverse(s));
}

#[divan::bench(sample_count = 10, args = ["unit", "gaussian"])]
fn fft_ma_2048(bencher: Bencher, phase: &str) {
    let parameters = [("sigma_m", 0.1), ("range_m", 0.28)].map(|(k, v)| (k.to_owned(), v)).into();
    let fit = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
    let size_m = N as f64 * 0.1;
    let texture = json!({ "size_m": [size_m, size_m], "cell_m": 0.1, "phase": phase });
    let texture = sastrugi_texture::prepare("fft_ma", &texture, &fit).expect("the bench's own parameters are valid");
    let streams = Streams::for_seed(1, "texture");
    bencher.counter(ItemsCount::new(N * N)).bench(|| texture.generate(&streams));
}
