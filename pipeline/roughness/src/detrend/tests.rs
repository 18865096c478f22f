use super::*;
use sastrugi_numeric::{Geometry, Stream, Streams};
use std::f64::consts::{PI, TAU};

const SIDE: usize = 668;
const CELL_M: f64 = 0.15;

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "detrend-test").stream(purpose)
}

/// The band of a vehicle with a wheelbase of 2.7 m and tyres of 0.33 m.
fn band() -> WaveBand {
    WaveBand::of_vehicle(2.7, 0.33).unwrap()
}

fn surface(height: impl Fn(f64, f64) -> f64) -> Grid {
    let g = Geometry::square(SIDE, SIDE, CELL_M);
    Grid::new(g, (0..g.len()).map(|k| height(g.x(k % SIDE), g.y(k / SIDE))).collect())
}

/// Sum of waves with densities `f^-2` along x and along y, RMS about 0.03 m in the band.
fn rough() -> Grid {
    let mut s = stream("waves");
    let mut waves = || -> Vec<[f64; 3]> {
        (1..300)
            .map(|k| f64::from(k) / 100.0)
            .map(|f| [f, 0.0012 / f * (2.0f64).sqrt() * s.normal().abs(), TAU * s.uniform()])
            .collect()
    };
    let (east, north) = (waves(), waves());
    let along =
        |waves: &[[f64; 3]], x: f64| -> f64 { waves.iter().map(|[f, a, p]| a * libm::sin(TAU * f * x + p)).sum() };
    let centres = |g: Geometry| -> Vec<f64> { (0..SIDE).map(|c| g.x(c)).collect() };
    let g = Geometry::square(SIDE, SIDE, CELL_M);
    let of = |waves: &[[f64; 3]]| -> Vec<f64> { centres(g).into_iter().map(|x| along(waves, x)).collect() };
    let (x, y) = (of(&east), of(&north));
    Grid::new(g, (0..g.len()).map(|k| x[k % SIDE] + y[k / SIDE]).collect())
}

fn rms(dem: &Grid) -> f64 {
    Detrended::of(dem, &band(), Detrender::Band).rms_m()
}

/// A plane, or a sine of 1 m amplitude and four times the longest wavelength of the band, at any phase, changes the RMS of a
/// rough surface by less than 1 %.
#[test]
fn val_long_waves_are_rejected() {
    let rough = rough();
    let own = rms(&rough);
    assert!((0.01..0.1).contains(&own), "{own}");
    let with = |extra: &dyn Fn(f64, f64) -> f64| rms(&sastrugi_numeric::ops::add(&rough, &surface(extra)));
    assert!((with(&|x, y| 12.0 + 0.3 * x - 0.2 * y) / own - 1.0).abs() < 0.01);
    for phase in [0.0, 0.7, 1.5, 2.9, 4.0] {
        let sine = |x: f64, y: f64| libm::sin(TAU * x / 21.6 + phase) + libm::sin(TAU * y / 21.6 - phase);
        let changed = with(&sine);
        assert!((changed / own - 1.0).abs() < 0.01, "{phase}: {changed} {own}");
    }
}

/// A sine within the band has an RMS of its amplitude over sqrt 2; one shorter than the tyre radius has almost none.
#[test]
fn val_sines_within_and_below_the_band() {
    for length in [0.45, 1.0, 2.7, 4.5] {
        let found = rms(&surface(|x, y| 0.02 * (libm::sin(TAU * x / length) + libm::sin(TAU * y / length))));
        assert!((found / (0.02 / 2f64.sqrt()) - 1.0).abs() < 0.02, "{length}: {found}");
    }
    let fine = Grid::new(
        Geometry::square(20, 1000, 0.05),
        (0..20_000).map(|k| 0.02 * libm::sin(TAU * 0.05 * f64::from(k % 1000) / 0.25)).collect(),
    );
    let along_x = Detrended::of(&fine, &band(), Detrender::Band).rms_along_m();
    assert!(along_x[0] < 0.02 * 0.02 / 2f64.sqrt() && along_x[1].is_nan(), "{along_x:?}");
}

/// Transfer functions for sines: `1 - sinc` of the window for the moving average, and
/// `(2 pi L / lambda)^2 / (1 + (2 pi L / lambda)^2)` for the exponential mean.
#[test]
fn val_transfer_functions() {
    for length in [2.0, 5.0, 12.0] {
        let wave = surface(|x, _| 0.02 * libm::sin(TAU * x / length));
        let amplitude = |detrender| Detrended::of(&wave, &band(), detrender).rms_along_m()[0] * 2f64.sqrt() / 0.02;
        let window = odd_cells(5.4, CELL_M) as f64 * CELL_M;
        let u = PI * window / length;
        assert!((amplitude(Detrender::MovingAverage) - (1.0 - libm::sin(u) / u)).abs() < 0.05, "{length}");
        let square = (TAU * 5.4 / length) * (TAU * 5.4 / length);
        assert!((amplitude(Detrender::Exponential) - square / (1.0 + square)).abs() < 0.05, "{length}");
    }
}

/// The exponential mean by its definition, at the ends as well.
#[test]
fn val_the_exponential_mean_equals_its_definition() {
    let mut s = stream("exponential");
    let profile: Vec<f64> = (0..40).map(|_| s.normal()).collect();
    let ratio = 0.8;
    for (k, found) in above_exponential_mean(&profile, ratio).iter().enumerate() {
        let weights: Vec<f64> = (0..40usize).map(|j| libm::pow(ratio, j.abs_diff(k) as f64)).collect();
        let weighted: f64 = weights.iter().zip(&profile).map(|(w, z)| w * z).sum();
        let expected = profile[k] - weighted / weights.iter().sum::<f64>();
        assert!((found - expected).abs() < 1e-12, "{k}: {found} {expected}");
    }
}

/// For a random walk (density `f^-2`), the residual of a moving average has `pi^2 / 6` times the variance of the wavelengths
/// below its window. n = 400 profiles of 1000 cells, about 27 windows each: the standard error of the ratio is 1 %, so a
/// threshold of 6 % has a false-alarm rate below 1e-6. It catches a window that is 4 % off, and swapped detrenders.
#[test]
fn stat_a_moving_average_leaves_more_than_the_band() {
    let (n, cell) = (1000, 0.1);
    let mut s = stream("walk");
    let (mut of_average, mut of_band) = (Vec::new(), Vec::new());
    for _ in 0..400 {
        let mut z = 0.0;
        let mut step = || {
            z += s.normal();
            z
        };
        let profile = Grid::new(Geometry::square(1, n, cell), (0..n).map(|_| step()).collect());
        // A single row has no neighbours to average with: the window is one cell high.
        let window = BoxWindow { half: [0, odd_cells(3.7, cell) / 2] };
        let average = background_of(&profile, window, AtPartial::Mean, 0.9);
        let left = sastrugi_numeric::ops::combine(&profile, &average, |z, m| (z - m) * (z - m));
        of_average.push(sums::mean(&sums::finite(&left.values)));
        let band = Detrended::of(&profile, &WaveBand::new(0.2, 3.7).unwrap(), Detrender::Band).rms_m();
        of_band.push(band * band);
    }
    let ratio = sums::mean(&of_average) / sums::mean(&of_band);
    assert!((ratio / (PI * PI / 6.0) - 1.0).abs() < 0.06, "{ratio}");
}

/// Gaps split profiles: the two halves of a profile with a gap have the RMS of the complete profile.
#[test]
fn val_gaps_split_profiles() {
    let wave = |k: usize| 0.02 * libm::sin(TAU * 0.1 * k as f64 / 1.5);
    let mut dem = Grid::new(Geometry::square(1, 1000, 0.1), (0..1000).map(wave).collect());
    let band = WaveBand::new(0.3, 3.0).unwrap();
    let whole = Detrended::of(&dem, &band, Detrender::Band);
    dem.values[480] = f64::NAN;
    let split = Detrended::of(&dem, &band, Detrender::Band);
    assert!((split.rms_m() / whole.rms_m() - 1.0).abs() < 0.01);
    assert_eq!(sums::finite(&whole.squares[0].values).len() - sums::finite(&split.squares[0].values).len(), 61);
}

/// On a surface whose roughness doubles half-way, the RMS map doubles too; the trimmed border has no value.
#[test]
fn val_maps_follow_the_roughness() {
    let dem = surface(|x, y| if x < 50.0 { 0.01 } else { 0.02 } * libm::sin(TAU * (x + y) / 2.0));
    let map = Detrended::of(&dem, &band(), Detrender::Band).rms_map();
    let at = |x: f64| {
        let (row, col) = dem.geometry.cell_at(x, 50.0).unwrap();
        map.at(row, col)
    };
    assert!((at(25.0) / (0.01 / 2f64.sqrt()) - 1.0).abs() < 0.03, "{}", at(25.0));
    assert!((at(75.0) / (0.02 / 2f64.sqrt()) - 1.0).abs() < 0.03, "{}", at(75.0));
    assert!(at(6.0).is_finite() && map.at(0, 0).is_nan() && map.at(40, 40).is_finite());
}

#[test]
fn val_invalid_bands_are_refused() {
    let order = |a, b| matches!(WaveBand::new(a, b), Err(BandError::Order { .. }));
    for (a, b) in [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (1.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        assert!(order(a, b), "{a} {b}");
    }
    for bad in [0.0, -2.7, f64::NAN, f64::INFINITY] {
        assert!(matches!(WaveBand::of_vehicle(bad, 0.33), Err(BandError::Vehicle { name: "wheelbase", .. })));
        assert!(matches!(WaveBand::of_vehicle(2.7, bad), Err(BandError::Vehicle { name: "tyre radius", .. })));
    }
    assert!(matches!(WaveBand::of_vehicle(0.1, 0.33), Err(BandError::Order { .. })));
    assert!(band().fits_cells(0.165).is_ok() && band().fits_length(21.6).is_ok());
    assert!(matches!(band().fits_cells(0.17), Err(BandError::Coarse { .. })));
    assert!(matches!(band().fits_length(21.0), Err(BandError::Short { .. })));
}

/// Small, empty or flat surfaces do not panic, and have an RMS of NaN or zero.
#[test]
fn prop_degenerate_surfaces_have_no_roughness() {
    for (rows, cols) in [(1, 1), (1, 7), (3, 3), (40, 2)] {
        for value in [f64::NAN, 0.0, 1.0] {
            let dem = Grid::filled(Geometry::square(rows, cols, 1.0), value);
            for detrender in [Detrender::Band, Detrender::MovingAverage, Detrender::Exponential] {
                let found = Detrended::of(&dem, &band(), detrender);
                assert!(found.rms_m().is_nan() || found.rms_m() < 1e-12);
                assert_eq!(found.rms_map().values.len(), rows * cols);
            }
        }
    }
}
