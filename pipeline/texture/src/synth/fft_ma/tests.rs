use super::*;
use crate::covariance::model;

fn exponential(sigma_m: f64, range_m: f64) -> Covariance {
    Covariance::new(model("exponential").unwrap(), sigma_m, range_m).unwrap()
}

fn texture(parameters: FftMaParameters, covariance: &Covariance) -> FftMa {
    FftMa::new(parameters, covariance.clone()).unwrap()
}

fn tile(size_m: [f64; 2], phase: Phase, periodic: bool) -> FftMaParameters {
    FftMaParameters { size_m, phase, periodic, ..FftMaParameters::default() }
}

fn streams(seed: u64) -> Streams {
    Streams::for_seed(seed, "texture")
}

/// The covariance that was asked for, on the torus, row-major.
fn wanted(covariance: &Covariance, g: &Geometry) -> Vec<f64> {
    let short = |k: usize, n: usize| k.min(n - k) as f64;
    let at = |r: usize, c: usize| {
        let (y, x) = (short(r, g.rows) * g.cell[1], short(c, g.cols) * g.cell[0]);
        covariance.at_distance((x * x + y * y).sqrt())
    };
    (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| (r, c))).map(|(r, c)| at(r, c)).collect()
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (x, y)| f64::max(m, (x - y).abs()))
}

/// Tolerance 1e-12 sigma^2, in every realisation, for even, odd and other lengths.
#[test]
fn val_unit_phases_have_the_exact_covariance() {
    let covariance = exponential(0.7, 0.28);
    for size_m in [[20.0, 20.0], [6.4, 3.2], [7.5, 8.1], [10.09, 5.0], [3.3, 20.0]] {
        let texture = texture(tile(size_m, Phase::Unit, true), &covariance);
        for seed in 1..=3 {
            let made = texture.generate(&streams(seed)).unwrap();
            let error = worst(&torus_covariance(&made.grid), &wanted(&covariance, &made.grid.geometry));
            assert!(error <= 1e-12 * 0.49, "{size_m:?}: {error:e}");
            assert!(made.covariance_error_max_m2 <= 1e-12 * 0.49);
        }
    }
}

/// Increments across the seam are those of the interior: the mean square increment at one cell is the same at every
/// column pair in expectation, and exactly 2 (C(0) - C(1)) over the torus. Null: the 200 squared seam increments of 30
/// tiles are drawn as the interior ones; statistic: seam mean square over the exact value; about 200 * 30 / 6
/// independent values (range 2.8 cells) give a standard error of 4.5 %; threshold 25 % (5.5 sigma, below 1e-7).
#[test]
fn stat_no_seam() {
    let covariance = exponential(1.0, 0.28);
    let texture = texture(tile([20.0; 2], Phase::Unit, true), &covariance);
    let (n, mut squares) = (200, Vec::new());
    for seed in 0..30 {
        let grid = texture.generate(&streams(seed)).unwrap().grid;
        for k in 0..n {
            squares.push((grid.at(k, 0) - grid.at(k, n - 1)) * (grid.at(k, 0) - grid.at(k, n - 1)));
            squares.push((grid.at(0, k) - grid.at(n - 1, k)) * (grid.at(0, k) - grid.at(n - 1, k)));
        }
    }
    let exact = 2.0 * (covariance.at_distance(0.0) - covariance.at_distance(0.1));
    let ratio = sums::mean(&squares) / exact;
    assert!((ratio - 1.0).abs() < 0.25, "{ratio}");
}

/// Null: |Q|^2 of a mode with a partner is exponential with mean 1, of a self-conjugate mode chi-squared with one
/// degree of freedom. Statistic: chi-squared over ten classes of equal probability, 19 900 modes of one 200 x 200 field,
/// 9 degrees of freedom; threshold 50 (false alarm 1e-7). Unit magnitudes fall into one class.
#[test]
fn stat_gaussian_phase_powers() {
    let covariance = exponential(1.0, 0.28);
    let made = texture(tile([20.0; 2], Phase::Gaussian, true), &covariance).generate(&streams(5)).unwrap();
    let field = RealFft2::new(200, 200).forward(&made.grid.values);
    let spectrum = spectrum::EvenSpectrum::of(&covariance, [200, 200], 0.1);
    let mut classes = [0.0; 10];
    for (kx, column) in field.values.chunks_exact(200).enumerate().take(100).skip(1) {
        for (ky, v) in column.iter().enumerate() {
            let power = v.norm_sqr() / (spectrum.at(kx, ky) * 40_000.0);
            classes[((1.0 - libm::exp(-power)) * 10.0) as usize] += 1.0;
        }
    }
    let expected = 19_800.0 / 10.0;
    let chi2: f64 = classes.iter().map(|c| (c - expected) * (c - expected) / expected).sum();
    assert!(chi2 < 50.0, "{chi2}");
}

/// A crop of a Gaussian-phase torus has the covariance on average. Null: mean of 60 crops of 8 m (28 ranges wide);
/// relative standard error of a variance sqrt(2 pi / 2) * 0.28 / 8 * sqrt(2) ~ 8 % each, 1 % of the mean; threshold 6 %.
#[test]
fn stat_crops_have_the_covariance_on_average() {
    let covariance = exponential(1.0, 0.28);
    let texture = texture(tile([8.0; 2], Phase::Gaussian, false), &covariance);
    assert_eq!(texture.geometry().len(), 6400);
    for lag in [0, 1, 3] {
        let products: Vec<f64> = (0..60)
            .map(|seed| {
                let grid = texture.generate(&streams(seed)).unwrap().grid;
                let pairs = (0..80).flat_map(|r| (0..80 - lag).map(move |c| (r, c)));
                sums::mean(&pairs.map(|(r, c)| grid.at(r, c) * grid.at(r, c + lag)).collect::<Vec<_>>())
            })
            .collect();
        let error = sums::mean(&products) - covariance.at_distance(0.1 * lag as f64);
        assert!(error.abs() < 0.06, "lag {lag}: {error}");
    }
}

/// The specification's clip shares of an exponential on a square torus: none for b / L <= 0.1, 3e-4 at 0.15, 1.9e-2 at
/// 0.5 (given to one or two digits).
#[test]
fn val_clip_shares() {
    let share = |ratio: f64| {
        let spectrum = spectrum::EvenSpectrum::of(&exponential(1.0, 20.0 * ratio), [200, 200], 0.1);
        spectrum.negative() / (spectrum.total() + 2.0 * spectrum.negative())
    };
    assert_eq!(share(0.05), 0.0);
    assert!(share(0.1) < 1e-7, "{}", share(0.1));
    assert!((share(0.15) / 3e-4 - 1.0).abs() < 0.2, "{}", share(0.15));
    assert!((share(0.5) / 1.9e-2 - 1.0).abs() < 0.05, "{}", share(0.5));
}

#[test]
fn val_a_torus_too_small_is_refused_and_enlarged_when_not_periodic() {
    let covariance = exponential(1.0, 5.0);
    let error = texture(tile([20.0; 2], Phase::Unit, true), &covariance).generate(&streams(1)).err().unwrap();
    assert!(matches!(error, SynthesisError::NegativeSpectrum { needed_m: 80.0, .. }), "{error}");
    let cropped = texture(tile([20.0; 2], Phase::Unit, false), &covariance);
    let made = cropped.generate(&streams(1)).unwrap();
    assert_eq!((made.grid.rows(), made.grid.cols()), (200, 200));
    assert!(made.clip_share <= CLIP_SHARE_MAX);
}

#[test]
fn val_sizes_are_whole_cells() {
    let covariance = exponential(0.1, 0.3);
    let sized = |size_m| texture(FftMaParameters { size_m, ..FftMaParameters::default() }, &covariance);
    assert_eq!(sized([2.0, 3.0]).geometry(), Geometry::square(30, 20, 0.1));
    assert!(sized([2.0, 3.0]).notes().is_empty());
    let cut = sized([2.06, 3.0]);
    assert_eq!(cut.geometry().cols, 20);
    assert!(cut.notes()[0].contains("2.06 m x 3 m is no whole number"), "{:?}", cut.notes());
    for size_m in [[0.0, 1.0], [1.0, -1.0], [f64::NAN, 1.0], [0.01, 1.0], [1e9, 1.0]] {
        assert!(FftMa::new(FftMaParameters { size_m, ..FftMaParameters::default() }, covariance.clone()).is_err());
    }
    assert!(texture(tile([1.0; 2], Phase::Unit, true), &covariance).notes()[0].contains("less than four ranges"));
}

/// One thread or many: the same bits.
#[test]
fn prop_threads_change_no_bit() {
    let texture = texture(tile([10.0, 7.0], Phase::Unit, true), &exponential(0.1, 0.3));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| texture.generate(&streams(9)).unwrap().grid.values)
    };
    assert!(run(1).iter().zip(&run(4)).all(|(a, b)| a.to_bits() == b.to_bits()));
}
