//! Ground at the scale of vehicles, 1000 x 1000 cells, with each generator compared with a floor of the same run.
//!
//! Targets on one core: seven octaves of Perlin noise within 150 ms, a separable field within 30 ms, an isotropic one within
//! 300 ms. Floors: seven passes over the heights that add a cubic of the column (`seven_cubics`: what the octaves cost without
//! their lattice), one normal number per cell (`normals`), and the inverse transform of the isotropic field's torus
//! (`inverse_transform`). Run one-threaded: `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench mavs`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use sastrugi_numeric::fft::{Complex64, RealFft2};
use sastrugi_numeric::{Grid, Streams};
use sastrugi_roughness::{Detrended, Detrender, WaveBand, iri};
use serde_json::{Value, json};

const SIDE: usize = 1000;
const CELLS: usize = SIDE * SIDE;

fn main() {
    divan::main();
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

/// A size of 1000 x 1000 cells with seven octaves, and a correlation length of 2 m.
fn bench_generator(bencher: Bencher, kind: &str, more: &Value) {
    let mut params = json!({"size_px": [SIDE, SIDE], "cell_m": 0.1});
    more.as_object().into_iter().flatten().for_each(|(key, value)| params[key] = value.clone());
    let generator = sastrugi_terrain::prepare(kind, &params).expect("the bench's own parameters are valid");
    bencher.counter(ItemsCount::new(CELLS)).bench(|| generator.generate(&streams(), &[]));
}

#[divan::bench(sample_count = 20)]
fn seven_cubics(bencher: Bencher) {
    let columns: Vec<f64> = (0..SIDE).map(|k| k as f64 / SIDE as f64).collect();
    let mut heights = vec![0.0; CELLS];
    bencher.counter(ItemsCount::new(CELLS)).bench_local(|| {
        heights.fill(0.0);
        for row in heights.chunks_exact_mut(SIDE) {
            for octave in 0..7 {
                let slope = black_box(f64::from(octave));
                row.iter_mut().zip(&columns).for_each(|(z, x)| *z += slope + x * (slope + x * (slope + x)));
            }
        }
    });
}

#[divan::bench(sample_count = 20)]
fn van_deusen_7_octaves(bencher: Bencher) {
    bench_generator(bencher, "van_deusen", &json!({"wavelength_max_m": 13.0, "modulation": false}));
}

#[divan::bench(sample_count = 20)]
fn van_deusen_7_octaves_and_scale(bencher: Bencher) {
    bench_generator(bencher, "van_deusen", &json!({"wavelength_max_m": 13.0}));
}

#[divan::bench(sample_count = 10)]
fn van_deusen_scaled_with_maps(bencher: Bencher) {
    let roughness = json!({"wheelbase_m": 2.7, "tyre_radius_m": 0.33, "rms_m": 0.03});
    bench_generator(bencher, "van_deusen", &json!({"wavelength_max_m": 13.0, "roughness": roughness}));
}

#[divan::bench(sample_count = 20)]
fn normals(bencher: Bencher) {
    let mut heights = vec![0.0; CELLS];
    bencher.counter(ItemsCount::new(CELLS)).bench_local(|| {
        let mut stream = streams().stream("field");
        heights.iter_mut().for_each(|z| *z = stream.normal());
    });
}

#[divan::bench(sample_count = 20)]
fn separable_field(bencher: Bencher) {
    bench_generator(bencher, "ornstein_uhlenbeck", &json!({}));
}

#[divan::bench(sample_count = 10)]
fn inverse_transform(bencher: Bencher) {
    let torus = RealFft2::new(2 * SIDE, 2 * SIDE);
    bencher
        .counter(ItemsCount::new(CELLS))
        .bench(|| torus.inverse_of(|_, column| column.fill(Complex64::new(1.0, 0.0))));
}

#[divan::bench(sample_count = 10)]
fn isotropic_field(bencher: Bencher) {
    bench_generator(bencher, "ornstein_uhlenbeck", &json!({"mode": "isotropic"}));
}

fn surface() -> Grid {
    let params = json!({"size_px": [SIDE, SIDE], "cell_m": 0.1});
    let generator = sastrugi_terrain::prepare("van_deusen", &params).expect("the bench's own parameters are valid");
    generator.generate(&streams(), &[]).expect("they give a surface").heights
}

#[divan::bench(sample_count = 10, args = [Detrender::Band, Detrender::MovingAverage, Detrender::Exponential])]
fn detrended(bencher: Bencher, detrender: Detrender) {
    let (dem, band) = (surface(), WaveBand::of_vehicle(2.7, 0.33).expect("a vehicle"));
    bencher.counter(ItemsCount::new(CELLS)).bench(|| Detrended::of(&dem, &band, detrender).rms_m());
}

#[divan::bench(sample_count = 10)]
fn roughness_index(bencher: Bencher) {
    let dem = surface();
    bencher.counter(ItemsCount::new(CELLS)).bench(|| iri(&dem));
}
