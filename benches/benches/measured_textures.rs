//! Textures copied from a measured residual, 1024 x 1024 cells from 1024 x 1024 cells.
//!
//! Targets on one core: `quilting` within 2 s, `exemplar` within 30 s. The site is a Gaussian field with an exponential covariance of 8
//! cells times the exponential of a smoother one: rough in patches. Floor: an FFT-MA texture of the same size (`fft_ma_1024`).
//! Run one-threaded: `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench measured_textures`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_numeric::{Grid, Streams, ops};
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::Synthesis;
use sastrugi_texture::synth::exemplar::{self, ExemplarParameters};
use sastrugi_texture::synth::measured::Measured;
use sastrugi_texture::synth::quilting::{self, QuiltingParameters};
use sastrugi_texture::synth::tile::{Cell, Tile, TileParameters};
use serde_json::json;

const SIDE: u32 = 1024;
const CELLS: usize = (SIDE * SIDE) as usize;
const CELL_M: f64 = 0.1;

fn main() {
    divan::main();
}

fn streams() -> Streams {
    Streams::for_seed(1, "texture")
}

fn gaussian(sigma_m: f64, range_m: f64) -> Box<dyn Synthesis> {
    let parameters = [("sigma_m", sigma_m), ("range_m", range_m)].map(|(name, value)| (name.to_owned(), value)).into();
    let fit = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
    let texture = json!({ "size_px": [SIDE, SIDE], "cell_m": CELL_M });
    sastrugi_texture::prepare("fft_ma", &texture, &fit).expect("the bench's own parameters are valid")
}

fn field(sigma_m: f64, range_m: f64, seed: u64) -> Grid {
    gaussian(sigma_m, range_m).generate(&Streams::for_seed(seed, "site")).expect("the covariance fits the torus").grid
}

fn site() -> Measured {
    let (ground, amplitude) = (field(0.05, 0.8, 1), field(0.4, 2.0, 2));
    Measured { residual: ops::combine(&ground, &amplitude, |height_m, log| height_m * libm::exp(log)) }
}

fn tile() -> Tile {
    let size = TileParameters { size_px: Some([SIDE; 2]), cell_m: Cell::Square(CELL_M), ..TileParameters::default() };
    Tile::check(size, true).expect("the bench's own parameters are valid")
}

#[divan::bench(sample_count = 20)]
fn fft_ma_1024(bencher: Bencher) {
    let texture = gaussian(0.05, 0.8);
    bencher.counter(ItemsCount::new(CELLS)).bench(|| texture.generate(&streams()));
}

#[divan::bench(sample_count = 3)]
fn quilting_1024(bencher: Bencher) {
    let (site, tile, parameters) = (site(), tile(), QuiltingParameters::default());
    bencher.counter(ItemsCount::new(CELLS)).bench(|| quilting::synthesise(&site, &tile, &parameters, &streams()));
}

#[divan::bench(sample_count = 3)]
fn exemplar_1024(bencher: Bencher) {
    let (site, tile, parameters) = (site(), tile(), ExemplarParameters::default());
    bencher.counter(ItemsCount::new(CELLS)).bench(|| exemplar::synthesise(&site, &tile, &parameters, &streams()));
}
