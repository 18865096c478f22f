//! Multifractal terrain at the published size, compared with the bare transform to which its targets refer.
//!
//! Targets: a layer (M = 64, 1009^2, either mode) within 2.5 times `complex_fft_2048`; a complete three-layer heightfield within
//! 0.4 s on one core. Run one-threaded: `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench multifractal`.

use divan::Bencher;
use divan::counter::ItemsCount;
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex64;
use sastrugi_numeric::filters::gaussian_low_pass;
use sastrugi_numeric::{Grid, Streams};
use sastrugi_roughness::{ClassThresholds, DescribeSettings, classify, close_disk, describe, moore_gradient};
use serde_json::{Value, json};

const CELLS: usize = 1009 * 1009;

fn main() {
    divan::main();
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

fn bench_generator(bencher: Bencher, kind: &str, params: Value) {
    let generator = sastrugi_terrain::prepare(kind, &params).expect("the bench's own parameters are valid");
    bencher.counter(ItemsCount::new(CELLS)).bench(|| generator.generate(&streams(), &[]));
}

/// The floor: scalar complex transform of 2048^2 points (rustfft, no SIMD), along rows, transposed, along rows again.
#[divan::bench(sample_count = 10)]
fn complex_fft_2048(bencher: Bencher) {
    const N: usize = 2048;
    let transform = FftPlannerScalar::new().plan_fft_forward(N);
    let mut scratch = vec![Complex64::default(); transform.get_inplace_scratch_len()];
    let mut field: Vec<Complex64> = (0..N * N).map(|k| Complex64::new((k % 7) as f64, 0.0)).collect();
    let mut turned = field.clone();
    bencher.counter(ItemsCount::new(N * N)).bench_local(|| {
        transform.process_with_scratch(&mut field, &mut scratch);
        transpose(&field, &mut turned, N);
        transform.process_with_scratch(&mut turned, &mut scratch);
        // A sample must not pass ever larger numbers to the next.
        field.copy_from_slice(&turned);
        field.iter_mut().for_each(|v| *v /= (N * N) as f64);
    });
}

fn transpose(from: &[Complex64], to: &mut [Complex64], n: usize) {
    const BLOCK: usize = 16;
    for (row, col) in (0..n * n / (BLOCK * BLOCK)).map(|k| (k / (n / BLOCK) * BLOCK, k % (n / BLOCK) * BLOCK)) {
        for r in row..row + BLOCK {
            for c in col..col + BLOCK {
                to[c * n + r] = from[r * n + c];
            }
        }
    }
}

#[divan::bench(sample_count = 20, args = ["band_limited", "paper"])]
fn layer_m64_1009(bencher: Bencher, mode: &str) {
    bench_generator(bencher, "weierstrass_mandelbrot", json!({"mode": mode, "fractal_dimension": 2.6}));
}

#[divan::bench(sample_count = 10, args = ["band_limited", "paper"])]
fn multifractal_1009(bencher: Bencher, mode: &str) {
    bench_generator(bencher, "multifractal", json!({"mode": mode, "high": {"fractal_dimension": 2.6}}));
}

#[divan::bench(sample_count = 10)]
fn gaussian_sigma8_1009(bencher: Bencher) {
    let grid = terrain();
    bencher.counter(ItemsCount::new(CELLS)).bench(|| gaussian_low_pass(&grid, 8.0));
}

#[divan::bench(sample_count = 10)]
fn gradient_and_classes_1009(bencher: Bencher) {
    let grid = terrain();
    bencher.counter(ItemsCount::new(CELLS)).bench(|| classify(&moore_gradient(&grid), &ClassThresholds::default()));
}

#[divan::bench(sample_count = 10)]
fn closing_half_metre_1009(bencher: Bencher) {
    let classes = classify(&moore_gradient(&terrain()), &ClassThresholds::default());
    bencher.counter(ItemsCount::new(CELLS)).bench(|| close_disk(&classes, 0.57));
}

#[divan::bench(sample_count = 10)]
fn describe_1009(bencher: Bencher) {
    let grid = terrain();
    bencher.counter(ItemsCount::new(CELLS)).bench(|| describe(&grid, &DescribeSettings::default()));
}

fn terrain() -> Grid {
    let generator = sastrugi_terrain::prepare("multifractal", &Value::Null).expect("defaults are valid");
    generator.generate(&streams(), &[]).expect("defaults give a surface").heights
}
