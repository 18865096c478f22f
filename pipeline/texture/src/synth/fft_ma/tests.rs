use super::*;
use crate::covariance::{Form, model};
use crate::synth::{Synthesis, TextureOutcome};
use sastrugi_schemas::fit::FitFile;
use serde_json::{Value, json};

fn exponential(sigma_m: f64, range_m: f64) -> Covariance {
    Covariance::new(model("exponential").unwrap(), sigma_m, range_m).unwrap()
}

/// A covariance from parameters named as in fit files.
fn covariance(form: &str, values: &[(&str, f64)]) -> Covariance {
    let values = values.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
    Form::parse(form).unwrap().covariance(&values).unwrap()
}

fn prepared(parameters: &Value, covariance: &Covariance) -> Result<Texture<FftMa>, ParameterError> {
    let (of_tile, own) = tile::read::<FftMaParameters>(parameters)?;
    super::texture(of_tile, &own, covariance.clone())
}

fn texture(parameters: &Value, covariance: &Covariance) -> Texture<FftMa> {
    prepared(parameters, covariance).unwrap()
}

fn tile_of(size_m: [f64; 2], phase: &str, periodic: bool) -> Value {
    json!({ "size_m": size_m, "phase": phase, "periodic": periodic })
}

fn made(parameters: &Value, covariance: &Covariance, seed: u64) -> TextureOutcome {
    texture(parameters, covariance).generate(&streams(seed)).unwrap()
}

fn streams(seed: u64) -> Streams {
    Streams::for_seed(seed, "texture")
}

/// The target covariance on the torus, row-major: each lag taken the shorter way around, with the mean of both ways if they are
/// equally long.
fn wanted(covariance: &Covariance, g: &Geometry) -> Vec<f64> {
    let ways = |k: usize, n: usize| match (2 * k).cmp(&n) {
        std::cmp::Ordering::Less => vec![k as f64],
        std::cmp::Ordering::Equal => vec![k as f64, -(k as f64)],
        std::cmp::Ordering::Greater => vec![k as f64 - n as f64],
    };
    let at = |r: usize, c: usize| {
        let (south, east) = (ways(r, g.rows), ways(c, g.cols));
        let both = south.iter().flat_map(|s| east.iter().map(move |e| [e * g.cell[0], -s * g.cell[1]]));
        sums::mean(&both.map(|lag| covariance.at(lag)).collect::<Vec<_>>())
    };
    (0..g.rows).flat_map(|r| (0..g.cols).map(move |c| (r, c))).map(|(r, c)| at(r, c)).collect()
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).max_by(f64::total_cmp).unwrap()
}

/// `1 / M * sum of z(i) z(i + h)` by the definition, at one lag in cells south and east around the torus.
fn lag_product(field: &Grid, [south, east]: [usize; 2]) -> f64 {
    let (rows, cols) = (field.rows(), field.cols());
    let product = |k: usize| field.values[k] * field.at((k / cols + south) % rows, (k % cols + east) % cols);
    (0..rows * cols).map(product).sum::<f64>() / (rows * cols) as f64
}

/// The covariance of unit-phase fields by the definition, without any transform: every lag of two small tori, one of them with an oblique long
/// axis and oblong cells. A transposed axis, a mirrored azimuth or a lost factor would show. Tolerance 1e-12 of the variance, plus twice what
/// was clipped.
#[test]
fn val_unit_phases_have_the_covariance_by_the_definition() {
    let oblique = [("sigma_m", 0.7), ("range_m", 0.22), ("ratio", 0.5), ("azimuth_deg", 37.0)];
    for (covariance, size_px) in
        [(exponential(0.7, 0.06), [15, 12]), (covariance("anisotropic:exponential", &oblique), [42, 36])]
    {
        let made = made(&json!({ "size_px": size_px, "cell_m": [0.1, 0.15] }), &covariance, 3);
        let wanted = wanted(&covariance, &made.grid.geometry);
        let tolerance = 1e-12 * 0.49 + 2.0 * made.covariance_error_max_m2;
        let cols = made.grid.cols();
        for (lag, expected) in wanted.iter().enumerate() {
            let found = lag_product(&made.grid, [lag / cols, lag % cols]);
            assert!((found - expected).abs() <= tolerance, "{size_px:?} {lag}: {found} {expected}");
        }
        // The transforms of this crate agree with the definition.
        let fast = torus_covariance(&made.grid);
        assert!((0..fast.len()).all(|k| (fast[k] - lag_product(&made.grid, [k / cols, k % cols])).abs() < 1e-13));
    }
}

/// The forward transform of a row-major field by `rustfft`, unnormalised: rows, then columns.
fn rustfft_plane(values: &[f64], rows: usize, cols: usize) -> Vec<Complex64> {
    let mut planner = rustfft::FftPlannerScalar::new();
    let (along_row, along_col) = (planner.plan_fft_forward(cols), planner.plan_fft_forward(rows));
    let mut plane: Vec<Complex64> = values.iter().map(|v| Complex64::new(*v, 0.0)).collect();
    plane.chunks_exact_mut(cols).for_each(|row| along_row.process(row));
    for c in 0..cols {
        let mut column: Vec<Complex64> = (0..rows).map(|r| plane[r * cols + c]).collect();
        along_col.process(&mut column);
        column.into_iter().enumerate().for_each(|(r, v)| plane[r * cols + c] = v);
    }
    plane
}

/// `rustfft` as an independent reference: the power `|Z|^2 / M` of a unit-phase field is the transform of its covariance on the torus, mode by
/// mode, with the same lengths of mixed radices on both sides. Tolerance 1e-12 of the largest eigenvalue, plus what was clipped.
#[test]
fn val_powers_are_the_transform_by_rustfft() {
    let oblique = [("sigma_m", 1.0), ("range_m", 0.35), ("ratio", 0.6), ("azimuth_deg", 118.0)];
    let noisy = [("sigma_m", 0.6), ("range_m", 0.2), ("smoothness", 1.3), ("nugget_m2", 0.1)];
    for (covariance, size_px) in [
        (exponential(1.0, 0.3), [97, 60]),
        (covariance("anisotropic:exponential", &oblique), [90, 101]),
        (covariance("matern+nugget", &noisy), [128, 75]),
    ] {
        let made = made(&json!({ "size_px": size_px }), &covariance, 5);
        let (rows, cols) = (made.grid.rows(), made.grid.cols());
        let eigenvalues = rustfft_plane(&wanted(&covariance, &made.grid.geometry), rows, cols);
        let field = rustfft_plane(&made.grid.values, rows, cols);
        let largest = eigenvalues.iter().map(|v| v.norm()).fold(0.0, f64::max);
        let clipped = made.covariance_error_max_m2 * (rows * cols) as f64;
        for (k, (z, lambda)) in field.iter().zip(&eigenvalues).enumerate() {
            let power = z.norm_sqr() / (rows * cols) as f64;
            assert!(lambda.im.abs() < 1e-12 * largest, "{size_px:?} {k}: {lambda}");
            assert!((power - lambda.re).abs() <= 1e-11 * largest + clipped, "{size_px:?} {k}: {power} {lambda}");
        }
    }
}

/// Tolerance 1e-12 sigma^2, in every realisation, for even, odd and other lengths.
#[test]
fn val_unit_phases_have_the_exact_covariance() {
    let covariance = exponential(0.7, 0.28);
    for size_m in [[20.0, 20.0], [6.4, 3.2], [7.5, 8.1], [10.09, 5.0], [3.3, 20.0]] {
        for seed in 1..=3 {
            let made = made(&tile_of(size_m, "unit", true), &covariance, seed);
            let error = worst(&torus_covariance(&made.grid), &wanted(&covariance, &made.grid.geometry));
            assert!(error <= 1e-12 * 0.49, "{size_m:?}: {error:e}");
            assert!(made.covariance_error_max_m2 <= 1e-12 * 0.49);
        }
    }
}

/// The same for every model, sums, a nugget, any azimuth and oblong cells; variance 1 in each case.
#[test]
fn val_every_model_is_exact() {
    let aniso = |azimuth: f64| [("sigma_m", 1.0), ("range_m", 0.4), ("ratio", 0.5), ("azimuth_deg", azimuth)];
    let cases = [
        covariance("spherical+nugget", &[("sigma_m", 0.8), ("range_m", 1.1), ("nugget_m2", 0.36)]),
        covariance("matern", &[("sigma_m", 1.0), ("range_m", 0.3), ("smoothness", 0.8)]),
        covariance(
            "exponential+gaussian",
            &[("sigma_m", 0.6), ("range_m", 0.5), ("sigma_2_m", 0.8), ("range_2_m", 0.2)],
        ),
        covariance("anisotropic:exponential", &aniso(0.0)),
        covariance("anisotropic:exponential", &aniso(90.0)),
        covariance("anisotropic:exponential", &aniso(37.0)),
    ];
    for (k, covariance) in cases.iter().enumerate() {
        for cell_m in [json!(0.1), json!([0.1, 0.15])] {
            let made = made(&json!({ "size_px": [101, 90], "cell_m": cell_m }), covariance, 4);
            let error = worst(&torus_covariance(&made.grid), &wanted(covariance, &made.grid.geometry));
            assert!(error <= 1e-12 + 2.0 * made.covariance_error_max_m2, "case {k}, {cell_m}: {error:e}");
            assert!(made.clip_share <= CLIP_SHARE_MAX);
        }
    }
}

/// Ratio and azimuth recovered from a synthesised field within 2 % (of the ratio; of 180 degrees: 3.6). Effective distances of an
/// exponential are `-b ln(C / sigma^2)`; their squares are a quadratic form of the lag, fitted here by least squares.
#[test]
fn val_anisotropy_is_recovered() {
    for (ratio, azimuth_deg) in [(0.4, 30.0), (0.6, 118.0), (0.3, 90.0)] {
        let parameters = json!({ "size_m": [24.0, 16.0], "ratio": ratio, "azimuth_deg": azimuth_deg });
        let grid = made(&parameters, &exponential(1.0, 0.9), 3).grid;
        let covariance = torus_covariance(&grid);
        let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
        for (south, east) in (0..8isize).flat_map(|r| (-8..9isize).map(move |c| (r, c))).filter(|l| *l != (0, 0)) {
            let c = covariance[south as usize * grid.cols() + east.rem_euclid(grid.cols() as isize) as usize];
            let distance = -libm::log(c / covariance[0]);
            let (x, y) = (0.1 * east as f64, -0.1 * south as f64);
            let terms = [x * x, 2.0 * x * y, y * y];
            (0..3).for_each(|i| {
                right[i] += terms[i] * distance * distance;
                (0..3).for_each(|j| normal[i][j] += terms[i] * terms[j]);
            });
        }
        let [a, b, c] = solve3(normal, right);
        // The larger eigenvalue's direction is across the long axis, here counter-clockwise from east.
        let (mean, half) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
        let across = 0.5 * libm::atan2(2.0 * b, a - c).to_degrees();
        let azimuth = crate::covariance::form::half_turn(-across);
        let found = ((mean - half) / (mean + half)).sqrt();
        assert!((found / ratio - 1.0).abs() < 0.02, "{ratio}: {found}");
        assert!((azimuth - azimuth_deg).abs() < 3.6, "{azimuth_deg}: {azimuth}");
    }
}

/// Cramer's rule.
fn solve3(m: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let det = |m: [[f64; 3]; 3]| {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    [0, 1, 2].map(|k| {
        let mut replaced = m;
        (0..3).for_each(|row| replaced[row][k] = right[row]);
        det(replaced) / det(m)
    })
}

/// Shares of the variance that Eq. 10 retains on a grid of 512 x 512, from an independent program to three digits.
#[test]
fn val_eq10_loses_variance() {
    for (cell_m, range_m, share) in [(0.06, 0.28, 0.939), (0.06, 1.0, 0.983), (0.1, 0.28, 0.898), (0.1, 1.0, 0.971)] {
        let parameters = json!({ "size_px": [512, 512], "cell_m": cell_m, "spectrum": "eq10" });
        let covariance = exponential(0.2, range_m);
        let texture = texture(&parameters, &covariance);
        let achieved = texture.covariance()[0].achieved_m2 / 0.04;
        assert!((achieved - share).abs() < 5e-4, "{cell_m} {range_m}: {achieved}");
        let notes = texture.notes().join("; ");
        assert!(notes.contains(&format!("gives {:.1} % of the variance", 100.0 * share)), "{notes}");
        assert!(notes.contains("differs from the fit's"), "{notes}");
        let outcome = texture.generate(&streams(1)).unwrap();
        let variance = torus_covariance(&outcome.grid)[0] / 0.04;
        assert!((variance - achieved).abs() < 1e-9, "{variance}");
        assert!((outcome.covariance_error_max_m2 / 0.04 - (1.0 - achieved)).abs() < 1e-9);
    }
    let other =
        prepared(&json!({ "spectrum": "eq10" }), &covariance("gaussian", &[("sigma_m", 1.0), ("range_m", 1.0)]));
    assert_eq!(other.err().unwrap().key, "spectrum");
}

/// A self-affine fit: the variance of increments over a cell d is the fit's, `s^2 d^(2 H)`, except for a share of the order of
/// `(d / 2 b)^(2 - 2 H)`, 7 % here, and the note states this.
#[test]
fn val_self_affine_increments() {
    let fitted = covariance("self_affine", &[("increment_1m_m", 0.05), ("hurst", 0.7)]);
    let texture = texture(&json!({ "size_m": [40.0, 40.0], "outer_m": 4.0, "periodic": false }), &fitted);
    assert!(texture.notes().iter().any(|n| n.contains("no variance")), "{:?}", texture.notes());
    let lags = texture.covariance();
    let increment = 2.0 * (lags[0].achieved_m2 - lags[1].achieved_m2);
    let own = 0.0025 * libm::exp(1.4 * libm::log(0.1));
    assert!((0.92..1.0).contains(&(increment / own)), "{increment} {own}");
    let share = format!("are {:.0} % of the fit's over a cell", 100.0 * (increment / own).sqrt());
    assert!(texture.notes().iter().any(|n| n.contains(&share)), "{share}: {:?}", texture.notes());
}

/// Parameters of studies written for version 0.1 stay valid, and unknown ones are refused.
#[test]
fn val_keys() {
    let covariance = exponential(1.0, 0.5);
    let old = json!({ "size_m": [20.0, 10.0], "cell_m": 0.1, "phase": "gaussian", "periodic": false });
    let texture = texture(&old, &covariance);
    let all = texture.parameters();
    for (key, value) in old.as_object().unwrap() {
        assert_eq!(&all[key], value);
    }
    assert_eq!(all["tile"], json!([1, 1]));
    let refused = |parameters: Value| prepared(&parameters, &covariance).err().unwrap().to_string();
    assert!(refused(json!({ "phases": "unit" })).contains("which has"));
    assert!(refused(json!({ "tile": [2, 2], "periodic": false })).contains("seams"));
    assert!(refused(json!({ "size_m": [1.0, 1.0], "size_px": [10, 10] })).contains("size_px"));
    assert!(refused(json!({ "ratio": 1.5 })).contains("ratio"));
}

/// Tiles are repeated as stated, and each equals the single tile.
#[test]
fn val_tiles_repeat() {
    let covariance = exponential(1.0, 0.3);
    let one = made(&json!({ "size_px": [50, 40] }), &covariance, 2).grid;
    let many = made(&json!({ "size_px": [50, 40], "tile": [2, 3] }), &covariance, 2).grid;
    assert_eq!((many.rows(), many.cols()), (80, 150));
    for (r, c) in (0..80).flat_map(|r| (0..150).map(move |c| (r, c))) {
        assert_eq!(many.at(r, c).to_bits(), one.at(r % 40, c % 50).to_bits());
    }
}

/// Normal scores: the heights of the texture follow the given distribution (a maximum distance of the distribution
/// functions of 0.01 on 160 000 cells, 28 cells to a range cubed; a unit-phase tile's variance is exact), and the
/// measured covariance matches the predicted one to 3 % of the variance at lags of up to three cells.
#[test]
fn stat_given_heights() {
    let covariance = exponential(1.0, 0.28);
    // Exponentially distributed heights, mean 0.
    let quantiles: Vec<f64> = (0..=200).map(|k| -0.1 * libm::log(1.0 - f64::from(k) / 201.0) - 0.1).collect();
    let texture = texture(&json!({ "size_m": [40.0, 40.0], "marginal_m": quantiles }), &covariance);
    let grid = texture.generate(&streams(8)).unwrap().grid;
    let mut heights = grid.values.clone();
    heights.sort_by(f64::total_cmp);
    for k in (5..200).step_by(5) {
        let below = heights.partition_point(|h| *h <= quantiles[k]) as f64 / heights.len() as f64;
        assert!((below - k as f64 / 200.0).abs() < 0.01, "{k}: {below}");
    }
    let mean = sums::mean(&grid.values);
    let found = torus_covariance(&grid.map(|z| z - mean));
    let predicted = texture.covariance();
    for k in 0..4 {
        let error = (found[k] - predicted[k].achieved_m2) / predicted[0].achieved_m2;
        assert!(error.abs() < 0.03, "{k}: {error}");
    }
    assert!(texture.notes().iter().any(|n| n.contains("changes the covariance")));
}

/// Increments across the seam match those of the interior: the expected mean square increment over one cell is the same at every
/// column pair, and exactly 2 (C(0) - C(1)) over the torus. Null: the 200 squared seam increments of 30
/// tiles are distributed like the interior ones; statistic: seam mean square over the exact value; about 200 * 30 / 6
/// independent values (range 2.8 cells) give a standard error of 4.5 %; threshold 25 % (5.5 sigma, below 1e-7).
#[test]
fn stat_no_seam() {
    let covariance = exponential(1.0, 0.28);
    let texture = texture(&tile_of([20.0; 2], "unit", true), &covariance);
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
/// degree of freedom. Statistic: chi-squared over ten classes of equal probability, 19 800 modes of one 200 x 200 field,
/// 9 degrees of freedom; threshold 50 (false alarm 1e-7). Unit magnitudes fall into one class.
#[test]
fn stat_gaussian_phase_powers() {
    let covariance = exponential(1.0, 0.28);
    let made = made(&tile_of([20.0; 2], "gaussian", true), &covariance, 5);
    let field = RealFft2::new(200, 200).forward(&made.grid.values);
    let spectrum = Spectrum::of(&covariance, [200, 200], [0.1; 2]);
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
    let texture = texture(&tile_of([8.0; 2], "gaussian", false), &covariance);
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

/// Clip shares of an exponential on a square torus, from an independent program: none for b / L <= 0.1, 3e-4 at 0.15, 1.9e-2 at
/// 0.5 (to one or two digits).
#[test]
fn val_clip_shares() {
    let share = |ratio: f64| Spectrum::of(&exponential(1.0, 20.0 * ratio), [200, 200], [0.1; 2]).negative_share();
    assert_eq!(share(0.05), 0.0);
    assert!(share(0.1) < 1e-7, "{}", share(0.1));
    assert!((share(0.15) / 3e-4 - 1.0).abs() < 0.2, "{}", share(0.15));
    assert!((share(0.5) / 1.9e-2 - 1.0).abs() < 0.05, "{}", share(0.5));
}

#[test]
fn val_a_torus_too_small_is_refused_and_enlarged_when_not_periodic() {
    let covariance = exponential(1.0, 5.0);
    let error = texture(&tile_of([20.0; 2], "unit", true), &covariance).generate(&streams(1)).err().unwrap();
    assert!(matches!(error, SynthesisError::NegativeSpectrum { needed_m: 80.0, .. }), "{error}");
    let computed = SynthesisError::NegativeSpectrum {
        width_m: 300.000_000_000_000_06,
        height_m: 300.0,
        clip_share: 0.01,
        limit: 1e-4,
        needed_m: 7_999.999_999_999_997,
    };
    let message = computed.to_string();
    assert!(message.contains("of 300 m x 300 m") && message.contains("at least 8000 m wide and high"), "{message}");
    let cropped = texture(&tile_of([20.0; 2], "unit", false), &covariance);
    let made = cropped.generate(&streams(1)).unwrap();
    assert_eq!((made.grid.rows(), made.grid.cols()), (200, 200));
    assert!(made.clip_share <= CLIP_SHARE_MAX);
}

/// Half way around a torus an oblique covariance jumps, which fine cells show. Of this one, on cells of 1/60 of its range, 7.4075e-6 is
/// negative on the first torus of 960 x 960 cells and nothing on 1440 x 1440 (numpy); the texture is made on the latter, and its cost is for it.
#[test]
fn val_an_oblique_covariance_gets_a_larger_torus() {
    let fitted = covariance("matern", &[("sigma_m", 0.35), ("range_m", 3.02), ("smoothness", 0.584)]);
    let oblique = Covariance { ratio: 0.84, azimuth_deg: 44.6, ..fitted.clone() };
    let share = |n: usize| Spectrum::of(&oblique, [n, n], [0.05; 2]).negative_share();
    let first = share(960);
    assert!((first / 7.4075e-6 - 1.0).abs() < 1e-3, "{first:e}");
    assert_eq!(share(1440), 0.0);
    let raw = |size_m: f64, periodic: bool| {
        let axes = json!({ "ratio": 0.84, "azimuth_deg": 44.6, "cell_m": 0.05 });
        let of_tile = tile_of([size_m; 2], "gaussian", periodic);
        Value::Object(
            [axes, of_tile]
                .iter()
                .filter_map(Value::as_object)
                .flatten()
                .map(|(k, v)| (k.clone(), v.clone()))
                .collect(),
        )
    };
    let cropped = texture(&raw(12.0, false), &fitted);
    assert_eq!((cropped.kernel.torus, cropped.kernel.expected_torus()), ([960; 2], [1440; 2]));
    assert_eq!(cropped.cost(), cost([1440; 2], 240 * 240, None));
    let made = cropped.generate(&streams(1)).unwrap();
    assert_eq!((made.grid.rows(), made.grid.cols(), made.clip_share), (240, 240, 0.0));
    // No more than 16 times the cells of the first torus, and no more than a texture may have.
    let sizes: Vec<usize> =
        std::iter::successors(Some([960; 2]), |torus| cropped.kernel.larger(*torus)).map(|t| t[0]).collect();
    assert_eq!(sizes, [960, 1440, 2160, 3240]);
    assert_eq!(cropped.kernel.larger([1 << 14; 2]), None);
    // A periodic tile that is as wide as the reach suggests is told a size that it has not yet.
    let error = texture(&raw(48.0, true), &fitted).generate(&streams(1)).err().unwrap();
    assert!(matches!(error, SynthesisError::NegativeSpectrum { needed_m, .. } if needed_m > 60.0), "{error}");
    let error = cropped.kernel.refusal([3240; 2], 2e-6).to_string();
    assert_eq!(
        error,
        "the covariance is not positive definite on a torus of 162 m x 162 m, the largest tried for this texture of 12 m x 12 m: 2.0e-6 of \
         its spectrum is negative, more than 1e-6; use larger cells, or turn the long axis to the grid's (`azimuth_deg` = 0 or 90)"
    );
}

#[test]
fn val_sizes_are_whole_cells() {
    let covariance = exponential(0.1, 0.3);
    let sized = |size_m: [f64; 2]| texture(&json!({ "size_m": size_m }), &covariance);
    assert_eq!(sized([2.0, 3.0]).geometry(), Geometry::square(30, 20, 0.1));
    assert!(sized([2.0, 3.0]).notes().is_empty());
    let cut = sized([2.06, 3.0]);
    assert_eq!(cut.geometry().cols, 20);
    assert!(cut.notes()[0].contains("2.06 m x 3 m is not a whole number"), "{:?}", cut.notes());
    for size_m in [[0.0, 1.0], [1.0, -1.0], [f64::NAN, 1.0], [0.01, 1.0], [1e9, 1.0]] {
        let parameters = TileParameters { size_m: Some(size_m), ..TileParameters::default() };
        assert!(Tile::check(parameters, true).is_err(), "{size_m:?}");
    }
    assert!(texture(&tile_of([1.0; 2], "unit", true), &covariance).notes()[0].contains("less than four ranges"));
}

/// Results are identical to the bit for any number of threads.
#[test]
fn prop_threads_change_no_bit() {
    let texture = texture(&tile_of([10.0, 7.0], "unit", true), &exponential(0.1, 0.3));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| texture.generate(&streams(9)).unwrap().grid.values)
    };
    assert!(run(1).iter().zip(&run(4)).all(|(a, b)| a.to_bits() == b.to_bits()));
}

/// A measured site: an exponential surface of sigma 0.05 m and b = 0.28 m on cells of 6 cm, and its empirical fit.
static SITE: std::sync::LazyLock<(Grid, crate::FitOutcome)> = std::sync::LazyLock::new(|| {
    let truth = FitFile {
        model: "exponential".into(),
        parameters: [("sigma_m".to_owned(), 0.05), ("range_m".to_owned(), 0.28)].into(),
        ..FitFile::default()
    };
    let raw = json!({ "size_px": [400, 400], "cell_m": 0.06, "phase": "gaussian", "periodic": false });
    let made = crate::prepare("fft_ma", &raw, &truth).unwrap().generate(&Streams::for_seed(11, "site")).unwrap();
    let fitted = json!({ "model": "empirical", "bootstrap": 0 });
    let parameters: crate::FitParameters = serde_json::from_value(fitted).unwrap();
    let outcome = crate::fit(&made.grid, &parameters.try_into().unwrap(), &Streams::for_seed(1, "fit")).unwrap();
    (made.grid, outcome)
});

fn of_site(raw: serde_json::Value) -> Box<dyn Synthesis> {
    crate::prepare("fft_ma", &raw, &SITE.1.fit).unwrap()
}

/// With unit phases the covariance on the torus is the clipped target, for the surface and for the residual, to 1e-12 of the variance;
/// the surface's variance is near the true one (scatter of one site: 10 %).
#[test]
fn val_empirical_textures_have_the_measured_covariance() {
    for (covariance, expected) in [("surface", 0.0025), ("residual", 0.0025 * 0.86)] {
        let synthesis = of_site(json!({ "size_px": [300, 240], "cell_m": 0.06, "covariance": covariance }));
        let made = synthesis.generate(&Streams::for_seed(3, "texture")).unwrap();
        let measured = torus_covariance(&made.grid);
        let lags = synthesis.covariance();
        let variance_m2 = lags[0].wanted_m2;
        for lag in &lags {
            let [col, row] = lag.lag_m.map(|l| (l / 0.06).round() as isize);
            let at = row.rem_euclid(240) as usize * 300 + col.rem_euclid(300) as usize;
            assert!((measured[at] - lag.wanted_m2).abs() < 1e-12 * variance_m2, "{covariance}: {lag:?}");
        }
        assert!((variance_m2 / expected - 1.0).abs() < 0.15, "{covariance}: {variance_m2}");
    }
}

/// Every second cell of a fine texture has the covariance of a texture on cells of twice the size, in both directions and along rows or
/// columns alone.
#[test]
fn val_coarser_cells_are_exact_decimation() {
    let lags = |size: [usize; 2], cell_m: [f64; 2]| of_site(json!({ "size_px": size, "cell_m": cell_m })).covariance();
    let fine = lags([320, 240], [0.06; 2]);
    for (size, cell_m) in [([160, 120], [0.12, 0.12]), ([160, 240], [0.12, 0.06]), ([320, 120], [0.06, 0.12])] {
        let coarse = lags(size, cell_m);
        let on_axis = coarse.iter().filter(|l| l.lag_m[0] == 0.0 || l.lag_m[1] == 0.0);
        let mut compared = 0;
        for lag in on_axis {
            let same = |f: &&crate::synth::LagCovariance| (0..2).all(|k| (f.lag_m[k] - lag.lag_m[k]).abs() < 1e-9);
            let there = fine.iter().find(same).unwrap();
            assert!((there.achieved_m2 - lag.achieved_m2).abs() < 1e-12, "{there:?} {lag:?}");
            compared += 1;
        }
        assert_eq!(compared, 1 + size[0] / 2 + size[1] / 2);
    }
}

/// On a site with known covariance: background plus a texture of the residual, detrended and trimmed like the site, has
/// the residual's RMS and increments. Mean of 20 textures. The RMS of one scatters by 1.1 %, their mean by 0.25 %: the limit of 2 % is six of
/// these, 1.5 %, plus 0.5 % for the site, to which the texture was fitted with its own scatter. Increments are differences of variances, which
/// scatter twice as much as their roots, 0.5 % in the mean: the limit of 5 % is six of these, 3 %, plus 2 % for the site, whose single lags
/// the exponential smooths.
#[test]
fn stat_background_plus_texture_matches_the_site() {
    let (dem, outcome) = &*SITE;
    let [background, _] = outcome.rasters(dem).unwrap();
    for model in ["empirical", "exponential"] {
        let fit = match model {
            "empirical" => outcome.fit.clone(),
            _ => FitFile { model: model.to_owned(), map: None, ..outcome.fit.clone() },
        };
        let raw = json!({
            "size_px": [400, 400], "cell_m": 0.06, "phase": "gaussian", "periodic": false, "covariance": "residual"
        });
        let synthesis = crate::prepare("fft_ma", &raw, &fit).unwrap();
        let settings: crate::FitSettings =
            crate::FitParameters { bootstrap: 0, ..crate::FitParameters::default() }.try_into().unwrap();
        let mut mean = vec![0.0; fit.lags_m.len()];
        for seed in 0..20 {
            let texture = synthesis.generate(&Streams::for_seed(seed, "texture")).unwrap().grid;
            let sum = background.values.iter().zip(&texture.values).map(|(b, t)| b + t).collect();
            let again = crate::fit(&Grid::new(dem.geometry, sum), &settings, &Streams::for_seed(0, "fit")).unwrap().fit;
            mean.iter_mut().zip(&again.covariance_m2).for_each(|(m, c)| *m += c / 20.0);
        }
        let measured = &fit.covariance_m2;
        let rms = (mean[0] / measured[0]).sqrt();
        assert!((rms - 1.0).abs() < 0.02, "{model}: {rms}");
        for k in 1..mean.len() {
            let increments = (mean[0] - mean[k]) / (measured[0] - measured[k]);
            assert!((increments - 1.0).abs() < 0.05, "{model}, lag {}: {increments}", fit.lags_m[k]);
        }
    }
}

/// Invalid requests for an empirical or residual covariance are refused with one sentence each.
#[test]
fn val_empirical_refusals() {
    let refused = |method: &str, raw: serde_json::Value, fit: &FitFile| {
        crate::prepare(method, &raw, fit).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let fit = &SITE.1.fit;
    let size = json!({ "size_px": [64, 64], "cell_m": 0.06 });
    let with = |key: &str, value: serde_json::Value| {
        let mut raw = size.clone();
        raw[key] = value;
        raw
    };
    assert!(refused("cholesky", size.clone(), fit).contains("only `fft_ma` can synthesise"));
    assert!(refused("fft_ma", with("cell_m", json!(0.05)), fit).contains("whole multiples"));
    assert!(refused("fft_ma", with("azimuth_deg", json!(10.0)), fit).contains("is empirical"));
    assert!(
        refused("fft_ma", with("spectrum", json!("eq10")), fit)
            .contains("only the exponential covariance of a surface")
    );
    assert!(
        refused("fft_ma", with("size_px", json!([40, 64])), fit).contains("periodic tile of this measured covariance")
    );
    let stated = FitFile { map: None, model: "exponential".into(), window_m: None, ..fit.clone() };
    assert!(refused("fft_ma", with("covariance", json!("residual")), &stated).contains("no `window_m`"));
    let mut broken = fit.clone();
    assert!(refused("fft_ma", size.clone(), &FitFile { map: None, ..fit.clone() }).contains("`map`"));
    if let Some(map) = &mut broken.map {
        map.covariance_m2.pop();
    }
    assert!(refused("fft_ma", size.clone(), &broken).contains("map.covariance_m2"));
}

/// What a plan states about a texture of a measured covariance, or of what a background lacks, is what is stated once it is bound to its fit: the same
/// torus, on the same cells. By hand, a crop of 10 x 12 cells needs a torus of 100 x 100 cells for lags of up to 49 cells (1.5 windows of 33 cells).
#[test]
fn val_a_plan_has_the_torus_of_the_synthesis() {
    let measured = &SITE.1.fit;
    let modelled = FitFile { model: "exponential".to_owned(), map: None, ..measured.clone() };
    let prospect = |model: &str, fit: &FitFile| {
        let parameters =
            crate::FitParameters { model: model.to_owned(), bootstrap: 0, ..crate::FitParameters::default() };
        crate::FitSettings::try_from(parameters).unwrap().prospect(fit.cell_m, 160_000)
    };
    let [of_measured, of_modelled] = [prospect("empirical", measured), prospect("exponential", &modelled)];
    assert_eq!((Some(of_measured.window_m), Some(of_modelled.window_m)), (measured.window_m, measured.window_m));
    assert_eq!(Some(of_measured.max_lag), measured.map.as_ref().map(|map| map.max_lag));
    let crop = json!({ "size_px": [10, 12], "cell_m": 0.06, "periodic": false });
    let planned = crate::method("fft_ma", &crop).unwrap().cost_of(&of_measured);
    assert_eq!(planned.memory_bytes, (18 + 40) * 100 * 100 + 8 * 120);
    let tiles = [
        (json!([300, 240]), json!(0.06), true),
        (json!([97, 113]), json!([0.12, 0.06]), true),
        (json!([10, 12]), json!(0.06), false),
        (json!([150, 40]), json!([0.06, 0.18]), false),
        (json!([83, 61]), json!(0.12), false),
    ];
    // A model is computed on cells of any size.
    let others = [(json!([30, 20]), json!([0.1, 0.07]), false), (json!([31, 20]), json!(0.5), true)];
    for (covariance, size_px, cell_m, periodic) in
        ["surface", "residual"].iter().flat_map(|covariance| tiles.iter().map(move |(s, c, p)| (covariance, s, c, p)))
    {
        let raw = json!({ "size_px": size_px, "cell_m": cell_m, "periodic": periodic, "covariance": covariance });
        let planned = crate::method("fft_ma", &raw).unwrap().cost_of(&of_measured);
        assert_eq!(planned, crate::prepare("fft_ma", &raw, measured).unwrap().cost(), "{raw}");
    }
    for (size_px, cell_m, periodic) in tiles.iter().chain(&others) {
        let raw = json!({ "size_px": size_px, "cell_m": cell_m, "periodic": periodic, "covariance": "residual" });
        let planned = crate::method("fft_ma", &raw).unwrap().cost_of(&of_modelled);
        assert_eq!(planned, crate::prepare("fft_ma", &raw, &modelled).unwrap().cost(), "{raw}");
    }
}

/// By hand: 1126 is twice a prime, so that a transform along it takes two of 2304 (2^8 3^2) points, whose operations take 0.35 of the time of others.
#[test]
fn val_sides_that_transform_slowly_cost_more() {
    assert_eq!(octaves([64, 32]), 11.0);
    let own = libm::log2(1126.0);
    let along = own + 0.35 * (2.0 * 2304.0 / 1126.0 * libm::log2(2304.0) - own);
    assert!((octaves([1126, 1126]) - 2.0 * along).abs() < 1e-9, "{}", octaves([1126, 1126]));
    assert!((octaves([1126, 64]) - along - 6.0).abs() < 1e-9, "{}", octaves([1126, 64]));
    let operations = |side: usize, times: Option<[usize; 2]>| cost([side; 2], side * side, times).operations;
    let ratio = operations(1126, None) / operations(1125, None);
    assert!((1.5..2.0).contains(&ratio), "{ratio}");
    // Four fine cells for each, whose covariance and model are transformed.
    assert!(operations(1125, Some([2, 2])) > 4.0 * operations(1125, None));
}

/// A spectrum is computed once: a texture has the bits of any other with the same parameters, however often it was asked for notes and covariances.
#[test]
fn prop_one_spectrum_serves_all() {
    let raw = json!({ "size_px": [150, 120], "cell_m": 0.12, "covariance": "residual", "marginal": "measured" });
    let asked = of_site(raw.clone());
    let (notes, lags) = (asked.notes(), asked.covariance());
    assert!(notes.iter().any(|note| note.starts_with("measured covariance: ")), "{notes:?}");
    let bits = |texture: &dyn Synthesis| {
        let made = texture.generate(&streams(4)).unwrap().grid;
        made.values.into_iter().map(f64::to_bits).collect::<Vec<u64>>()
    };
    let first = bits(asked.as_ref());
    assert_eq!(first, bits(asked.as_ref()));
    assert_eq!((asked.notes(), asked.covariance()), (notes, lags));
    assert_eq!(first, bits(of_site(raw).as_ref()));
}

/// On cells comparable to the window, or larger, the residual has the same variance as on the fit's cells.
#[test]
fn val_a_residual_on_coarse_cells_keeps_its_variance() {
    let fit = FitFile {
        model: "exponential".into(),
        parameters: [("sigma_m".to_owned(), 0.05), ("range_m".to_owned(), 0.28)].into(),
        window_m: Some([1.98; 2]),
        cell_m: Some([0.06; 2]),
        ..FitFile::default()
    };
    let variance = |cell_m: f64, cells: usize| {
        let raw = json!({ "size_px": [cells, cells], "cell_m": cell_m, "covariance": "residual", "phase": "unit" });
        let grid =
            crate::prepare("fft_ma", &raw, &fit).unwrap().generate(&Streams::for_seed(1, "coarse")).unwrap().grid;
        sums::mean(&grid.values.iter().map(|z| z * z).collect::<Vec<_>>())
    };
    let fine = variance(0.06, 500);
    for (cell_m, cells) in [(0.5, 60), (1.0, 30), (3.0, 10)] {
        let coarse = variance(cell_m, cells);
        assert!((coarse / fine - 1.0).abs() < 0.01, "{cell_m}: {coarse:e} {fine:e}");
    }
}
