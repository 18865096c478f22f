//! Masked moving average and masked covariance of 2048^2 and 4096^2 cells, and the complete fit, each compared with its floor.
//!
//! Floors in the same process: copying the raster (moving average), and four real transforms of it, two of the data and two
//! of the mask (covariance to 33 lags). Floors in the same run, printed before the table: numpy's summed-area tables and
//! scipy's FFT (`floors/masked_covariance.py`, fastest of three). The targets, at 4096^2, are 0.35 times the
//! former and 0.5 times the latter, and 1.5 s for the complete fit from a file. Run one-threaded:
//! `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench masked_covariance`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_benches::floor;
use sastrugi_numeric::fft::RealFft2;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_roughness::background::{AtPartial, BoxWindow, background};
use sastrugi_texture::covariance::masked_covariance;
use sastrugi_texture::{FitParameters, FitSettings};

const SIZES: [usize; 2] = [2048, 4096];

fn main() {
    for n in SIZES {
        match floor("masked_covariance.py", &[&n.to_string()]).as_deref() {
            Some(&[average, covariance]) => println!(
                "{n}: numpy summed-area tables, window of 33 cells {:.0} ms; scipy FFT, 33 lags {:.0} ms",
                1e3 * average,
                1e3 * covariance
            ),
            _ => println!("{n}: no Python with numpy and scipy"),
        }
    }
    divan::main();
}

/// A rough surface with a twentieth of its cells without data.
fn raster(n: usize) -> Vec<f64> {
    let mut stream = Streams::for_seed(1, "bench").stream("raster");
    let mut walk = 0.0;
    let cell = |_| {
        walk = 0.9 * walk + stream.normal();
        if stream.uniform() < 0.05 { f64::NAN } else { walk }
    };
    (0..n * n).map(cell).collect()
}

/// The floor of the moving average.
#[divan::bench(sample_count = 20, args = SIZES)]
fn copy(bencher: Bencher, n: usize) {
    let values = raster(n);
    let mut copy = vec![0.0; values.len()];
    bencher.counter(ItemsCount::new(n * n)).bench_local(|| {
        copy.copy_from_slice(divan::black_box(&values));
        divan::black_box(&copy);
    });
}

/// The background of a raster without holes: windows are partial only at its border.
#[divan::bench(sample_count = 10, args = SIZES)]
fn background_33_cells(bencher: Bencher, n: usize) {
    let values: Vec<f64> = raster(n).into_iter().map(|z| if z.is_nan() { 0.0 } else { z }).collect();
    background_of(bencher, &values, n, 33, AtPartial::Plane);
}

/// The mean of the same raster's windows.
#[divan::bench(sample_count = 10, args = SIZES)]
fn moving_average_33_cells(bencher: Bencher, n: usize) {
    let values: Vec<f64> = raster(n).into_iter().map(|z| if z.is_nan() { 0.0 } else { z }).collect();
    background_of(bencher, &values, n, 33, AtPartial::Mean);
}

/// Scattered holes: every window is partial.
#[divan::bench(sample_count = 10, args = SIZES)]
fn background_33_cells_with_holes(bencher: Bencher, n: usize) {
    background_of(bencher, &raster(n), n, 33, AtPartial::Plane);
}

#[divan::bench(sample_count = 10, args = SIZES)]
fn background_201_cells_with_holes(bencher: Bencher, n: usize) {
    background_of(bencher, &raster(n), n, 201, AtPartial::Plane);
}

fn background_of(bencher: Bencher, values: &[f64], n: usize, width: usize, at_partial: AtPartial) {
    let window = BoxWindow { half: [width / 2; 2] };
    bencher.counter(ItemsCount::new(n * n)).bench(|| background(values, n, window, at_partial));
}

/// The floor of the covariance.
#[divan::bench(sample_count = 5, args = SIZES)]
fn four_real_transforms(bencher: Bencher, n: usize) {
    let fft = RealFft2::new(n, n);
    let field: Vec<f64> = (0..n * n).map(|k| (k % 7) as f64).collect();
    bencher.counter(ItemsCount::new(n * n)).bench(|| {
        let [data, mask] = [fft.forward(&field), fft.forward(&field)];
        [fft.inverse(data), fft.inverse(mask)]
    });
}

#[divan::bench(sample_count = 5, args = SIZES)]
fn masked_covariance_33_lags(bencher: Bencher, n: usize) {
    let values = raster(n);
    bencher.counter(ItemsCount::new(n * n)).bench(|| masked_covariance(&values, n, [32; 2]));
}

/// Outliers, moving average, trimming, covariance and the corrected fit, from a DEM in memory.
#[divan::bench(sample_count = 3, args = SIZES)]
fn whole_fit(bencher: Bencher, n: usize) {
    let texture = serde_json::json!({ "size_px": [n, n], "cell_m": 0.06 });
    let parameters = [("sigma_m", 0.1), ("range_m", 0.28)].map(|(k, v)| (k.to_owned(), v)).into();
    let truth = sastrugi_schemas::fit::FitFile { model: "exponential".to_owned(), parameters, ..Default::default() };
    let made = sastrugi_texture::prepare("fft_ma", &texture, &truth).expect("the bench's own parameters are valid");
    let made = made.generate(&Streams::for_seed(1, "texture")).expect("the tile is wide enough");
    let dem = Grid::new(Geometry::square(n, n, 0.06), made.grid.values);
    let parameters = FitParameters { bootstrap: 0, ..FitParameters::default() };
    let settings = FitSettings::try_from(parameters).expect("the defaults are valid");
    let streams = Streams::for_seed(1, "fit");
    bencher.counter(ItemsCount::new(n * n)).bench(|| sastrugi_texture::fit(&dem, &settings, &streams));
}
