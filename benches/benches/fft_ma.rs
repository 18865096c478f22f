//! FFT-MA texture of 2048^2 and 4096^2 cells, compared with the transform that it needs at least, and with numpy.
//!
//! The target, at 4096^2, is 0.35 times numpy's rfft2 FFT-MA. If `python3` with numpy is available, its time is
//! measured in the same run (`floors/fft_ma.py`, fastest of five) and printed before the table; another floor, in the
//! same process, is one real transform (`sastrugi_numeric`, same bits on every CPU). Run one-threaded:
//! `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench fft_ma`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_benches::floor;
use sastrugi_numeric::Streams;
use sastrugi_numeric::fft::RealFft2;
use sastrugi_schemas::fit::FitFile;
use serde_json::{Value, json};

const SIZES: [usize; 2] = [2048, 4096];

fn main() {
    for n in SIZES {
        match floor("fft_ma.py", &[&n.to_string()]).as_deref() {
            Some(&[whole, alone]) => println!(
                "numpy rfft2 FFT-MA {n}: {:.0} ms, the field alone from precomputed amplitudes {:.0} ms",
                1e3 * whole,
                1e3 * alone
            ),
            _ => println!("numpy rfft2 FFT-MA {n}: no Python with numpy"),
        }
    }
    divan::main();
}

/// The floor: one inverse real transform.
#[divan::bench(sample_count = 10, args = SIZES)]
fn real_inverse_transform(bencher: Bencher, n: usize) {
    let fft = RealFft2::new(n, n);
    let spectrum = fft.forward(&(0..n * n).map(|k| (k % 7) as f64).collect::<Vec<_>>());
    bencher.counter(ItemsCount::new(n * n)).with_inputs(|| spectrum.clone()).bench_values(|s| fft.inverse(s));
}

#[divan::bench(sample_count = 5, args = SIZES)]
fn unit_phases(bencher: Bencher, n: usize) {
    texture(bencher, n, 0.28, &json!({ "phase": "unit" }));
}

/// A covariance that reaches from edge to edge, so that none of its values is treated as zero.
#[divan::bench(sample_count = 5, args = SIZES)]
fn unit_phases_wide(bencher: Bencher, n: usize) {
    texture(bencher, n, 0.005 * n as f64, &json!({ "phase": "unit" }));
}

#[divan::bench(sample_count = 5, args = SIZES)]
fn gaussian_phases(bencher: Bencher, n: usize) {
    texture(bencher, n, 0.28, &json!({ "phase": "gaussian" }));
}

/// Axes of anisotropy oblique to the grid: no quadrant of the spectrum mirrors another.
#[divan::bench(sample_count = 5, args = [2048])]
fn oblique_axis(bencher: Bencher, n: usize) {
    texture(bencher, n, 0.28, &json!({ "ratio": 0.5, "azimuth_deg": 30.0 }));
}

fn texture(bencher: Bencher, n: usize, range_m: f64, more: &Value) {
    let parameters = [("sigma_m", 0.1), ("range_m", range_m)].map(|(k, v)| (k.to_owned(), v)).into();
    let fit = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
    let mut texture = more.clone();
    texture["size_px"] = json!([n, n]);
    texture["cell_m"] = json!(0.1);
    let texture = sastrugi_texture::prepare("fft_ma", &texture, &fit).expect("the bench's own parameters are valid");
    let streams = Streams::for_seed(1, "texture");
    bencher.counter(ItemsCount::new(n * n)).bench(|| texture.generate(&streams));
}
