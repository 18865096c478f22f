//! Heights from three images of 1024 x 1024 pixels, compared with two floors: one solution of Poisson's equation by cosine transforms, and one pass of
//! shading (brightness and derivatives of every cell in three images). An inversion takes two rounds (from above the second only confirms the
//! first), each with about four least-squares steps per cell and about 20 iterations of conjugate gradients, each of which needs one such solution.
//! Uncertainties are excluded: they add `samples` solutions of about 10 iterations.
//!
//!     cargo bench -p sastrugi-benches --bench photoclinometry

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_imaging::photoclinometry::{CosinePoisson, Image, Known, Settings, recover};
use sastrugi_imaging::{Camera, ParallelCamera, Photometry, direction};
use sastrugi_numeric::{Geometry, Grid, Streams};

const SIDE: usize = 1024;
const CELLS: usize = SIDE * SIDE;

fn main() {
    divan::main();
}

/// Slopes of waves of 64 and 37 cells with an amplitude of 0.15.
fn slopes(k: usize) -> [f64; 2] {
    let (x, y) = ((k % SIDE) as f64, (k / SIDE) as f64);
    [0.15 * libm::sin(x / 10.0 + 0.3 * y / 10.0), 0.15 * libm::cos(y / 6.0)]
}

fn images() -> Vec<Image> {
    let photometry = Photometry::default();
    let middle = 0.5 * SIDE as f64;
    let camera = Camera::Parallel(ParallelCamera::new([0.0, 90.0], [middle, middle, 0.0], 1.0, [SIDE, SIDE]));
    let image = |azimuth: f64| {
        let light = direction(azimuth, 45.0);
        let brightness = (0..CELLS).map(|k| 0.25 * photometry.of_slopes(slopes(k), light, [0.0, 0.0, 1.0])).collect();
        Image { camera, light, exposure: 1.0, haze: 0.0, brightness }
    };
    [0.0, 120.0, 240.0].map(image).to_vec()
}

#[divan::bench(sample_count = 10)]
fn floor_one_poisson_solution_1024(bencher: Bencher) {
    let solver = CosinePoisson::new(SIDE, SIDE, [1.0, 1.0], 0.0);
    let right: Vec<f64> = (0..CELLS).map(|k| slopes(k)[0]).collect();
    bencher.counter(ItemsCount::new(CELLS)).bench(|| solver.solve(&right));
}

#[divan::bench(sample_count = 10)]
fn floor_one_pass_of_shading_1024(bencher: Bencher) {
    let photometry = Photometry::default();
    let lights = [0.0, 120.0, 240.0].map(|azimuth| direction(azimuth, 45.0));
    bencher.counter(ItemsCount::new(CELLS)).bench(|| {
        let of = |k: usize| lights.map(|light| photometry.shade(slopes(k), light, [0.0, 0.0, 1.0]).by_slope[0]);
        (0..CELLS).map(|k| of(k).iter().sum::<f64>()).sum::<f64>()
    });
}

#[divan::bench(sample_count = 3)]
fn inversion_1024(bencher: Bencher) {
    let images = images();
    let start = Grid::filled(Geometry::square(SIDE, SIDE, 1.0), 0.0);
    let settings = Settings { samples: 0, ..Settings::default() };
    let streams = Streams::for_seed(1, "photoclinometry");
    bencher
        .counter(ItemsCount::new(CELLS))
        .bench(|| recover(&images, &start, &Known::default(), &settings, &streams).expect("the images determine it"));
}
