use super::filtered::Measurement;
use super::masked::masked_covariance;
use super::trimmed::TrimmedNormal;
use super::*;
use crate::fit::expectation::Expectation;
use crate::fit::least_squares::Cholesky;
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, RealFft2};
use sastrugi_roughness::background::{AtPartial, BoxWindow, background};

const N: f64 = f64::NAN;
/// A grid with holes.
#[rustfmt::skip]
const GRID: [f64; 99] = [
    2.041, -2.556, N, -0.568, N, -0.216, -2.02, -0.232, -0.865, 3.323, 0.226,
    -0.353, -0.281, N, -1.055, -0.391, 0.482, -0.239, 0.958, -0.2, 0.024, 1.546,
    0.545, -0.505, -0.183, 0.541, 1.935, -0.27, -0.244, 1.002, -0.886, N, 0.883,
    0.58, 0.092, N, N, 1.021, -0.96, -1.669, 0.276, N, -0.445, N,
    N, -0.053, 1.406, N, 0.194, 1.112, N, -0.926, 0.584, 0.583, -0.215,
    N, 0.229, -2.494, N, 0.491, N, 0.061, -0.964, 0.757, N, N,
    0.71, 1.156, N, -0.498, 0.328, -0.609, 1.591, -1.191, 0.355, -1.048, 1.406,
    -0.022, -0.372, N, 1.682, 0.753, 0.754, 1.138, N, -0.639, -0.8, -0.8,
    1.37, -1.46, -0.596, -0.321, 0.225, 0.575, -1.249, -1.73, -0.004, 1.214, 0.757,
];
/// `[drow, dcol, pairs, sum of products]` of the grid minus the mean of its data, from an independent double loop (numpy).
#[rustfmt::skip]
const PAIR_SUMS: [(isize, isize, u64, f64); 45] = [
    (0, -4, 42, 1.0396861090624996), (0, -3, 49, -8.55016841234375), (0, -2, 52, -3.673277226875001),
    (0, -1, 58, -7.814783968437498), (0, 0, 80, 85.66889638749998), (0, 1, 58, -7.814783968437498),
    (0, 2, 52, -3.673277226875001), (0, 3, 49, -8.55016841234375), (0, 4, 42, 1.0396861090624996),
    (1, -4, 37, -2.54522272921875), (1, -3, 44, 5.039675136875), (1, -2, 45, 2.534780557031251),
    (1, -1, 51, -12.31396802203125), (1, 0, 57, 0.6820078239062504), (1, 1, 50, -0.8137972171874991),
    (1, 2, 44, 0.12368596187499886), (1, 3, 42, -5.106040065937502), (1, 4, 37, -10.039300691718749),
    (2, -4, 32, -3.0965139424999997), (2, -3, 39, -2.904167888906249), (2, -2, 38, 3.2984526909375),
    (2, -1, 44, -0.05961926312500254), (2, 0, 47, -0.2170652276562498), (2, 1, 44, -5.419582163125),
    (2, 2, 41, 0.263040176406251), (2, 3, 34, -8.309265477187498), (2, 4, 30, 2.5776769046875003),
    (3, -4, 26, -5.5625735884375), (3, -3, 26, -4.520525450937499), (3, -2, 30, -5.2519965328125),
    (3, -1, 36, 3.292303325625), (3, 0, 38, 4.3166459784375), (3, 1, 37, 7.32054584578125),
    (3, 2, 30, -0.7233804578125014), (3, 3, 27, -3.937607230781251), (3, 4, 27, 9.33244216921875),
    (4, -4, 23, 2.63461267609375), (4, -3, 25, -6.036227346093752), (4, -2, 28, -6.642242935624999),
    (4, -1, 33, 1.2249255401562507), (4, 0, 34, -0.07853152718749953), (4, 1, 33, -2.40467048484375),
    (4, 2, 28, 2.052749851875), (4, 3, 26, 1.302430949062499), (4, 4, 24, 0.7129664337499995),
];
/// `(t, [(rho, T)])`, computed with mpmath.
#[rustfmt::skip]
const TRIMMED: [(f64, [(f64, f64); 13]); 3] = [
    (2.575829303548901, [
        (-0.5, -0.43263605193407656), (0.0, 0.0), (0.05, 0.042763564384482526),
        (0.1, 0.08555649470988298), (0.2, 0.17134864842126857), (0.3, 0.2576169834218374),
        (0.5, 0.43263605193407656), (0.7, 0.613323617956951), (0.9, 0.8059138495473765),
        (0.95, 0.8586573064715946), (0.99, 0.9061949495876308), (0.999, 0.9208572009536895),
        (1.0, 0.9247558993726854),
    ]),
    (1.9599639845400538, [
        (-0.5, -0.30387514622472844), (0.0, 0.0), (0.05, 0.028807817966554898),
        (0.1, 0.057710400741570564), (0.2, 0.11618002299944998), (0.3, 0.17617400593784652),
        (0.5, 0.30387514622472844), (0.7, 0.4477372754344528), (0.9, 0.6209976325249841),
        (0.95, 0.6748282927129677), (0.99, 0.7299283552668521), (0.999, 0.751307885698061),
        (1.0, 0.7588416170698973),
    ]),
    (1.644853626951473, [
        (-0.5, -0.21339203703612197), (0.0, 0.0), (0.05, 0.01942565076290113),
        (0.1, 0.038960981132834194), (0.2, 0.07880728826414433), (0.3, 0.12046627085505088),
        (0.5, 0.21339203703612197), (0.7, 0.32768787495893836), (0.9, 0.4811730721145223),
        (0.95, 0.5330714371828562), (0.99, 0.5897855234556301), (0.999, 0.6138507716133568),
        (1.0, 0.6230154841346842),
    ]),
];
/// `(b in m, cell in m, window in cells, covariance along an axis at 0, 1, ... cells)` of a unit exponential minus its box mean.
#[rustfmt::skip]
const BOX_FILTERED: [(f64, f64, usize, [f64; 17]); 4] = [
    (0.28, 0.06, 33, [
        0.8587008467074513, 0.6658206385293235, 0.5101822143949848, 0.3846754954111608,
        0.28359419908572187, 0.20236421923189768, 0.13732656332135565, 0.08556318388497698,
        0.04475677207095555, 0.013077323522834805, -0.010910537236458906, -0.028324777838713906,
        -0.040032828927134986, -0.04671375325762431, -0.04892334075189245, -0.04717539368762665,
        -0.04207100330092017,
    ]),
    (1.0, 0.06, 33, [
        0.4230474812198178, 0.3654481986943061, 0.3125234161212493, 0.2640971628847843,
        0.22001116522222253, 0.18012126431559528, 0.14429441981933855, 0.11240584412381172,
        0.08433601783175843, 0.05996738605984947, 0.039180523149703106, 0.02184949340182102,
        0.007836007563214203, -0.0030182856830426597, -0.010902607383156016, -0.01605365796510322,
        -0.018785571021655234,
    ]),
    (0.28, 0.1, 21, [
        0.872381520676356, 0.5719928293652815, 0.36185833314961724, 0.21520808169605476,
        0.11349415683254763, 0.04394095904809121, -0.0021582572656833193, -0.030638462559096268,
        -0.04533265600989657, -0.0487740357996201, -0.04294541766128346, -0.030531248621169207,
        -0.01857199778092854, -0.008960712688366939, -0.0019951718060740057, 0.0025878098176395853,
        0.005224325073792813,
    ]),
    (1.0, 0.1, 21, [
        0.44301350351412766, 0.3494028803126055, 0.26801313398117277, 0.19809607598436446,
        0.13900697774350096, 0.0901731825601153, 0.05106229652033767, 0.02114436869886263,
        -0.0001585465490591409, -0.013547694503263569, -0.019979891732055777, -0.02094961942214027,
        -0.0193700462154964, -0.01665456527930012, -0.013596950130757984, -0.010651695825087307,
        -0.008063613466590833,
    ]),
];

/// The definition: a double loop over cells.
fn brute_force(values: &[f64], cols: usize, drow: isize, dcol: isize) -> (u64, f64) {
    let rows = (values.len() / cols) as isize;
    let (mut pairs, mut sum) = (0, 0.0);
    for r in 0..rows {
        for c in 0..cols as isize {
            let (r2, c2) = (r + drow, c + dcol);
            if r2 < 0 || c2 < 0 || r2 >= rows || c2 >= cols as isize {
                continue;
            }
            let product = values[r as usize * cols + c as usize] * values[r2 as usize * cols + c2 as usize];
            if !product.is_nan() {
                pairs += 1;
                sum += product;
            }
        }
    }
    (pairs, sum)
}

fn noise(count: usize, missing: f64) -> Vec<f64> {
    let mut s = sastrugi_numeric::Streams::for_seed(1, "covariance-test").stream("field");
    (0..count).map(|_| if s.uniform() < missing { f64::NAN } else { s.normal() }).collect()
}

/// Absolute tolerance 1e-10; pair counts exact.
#[test]
fn val_masked_covariance_of_the_reference_grid() {
    let data: Vec<f64> = GRID.into_iter().filter(|v| !v.is_nan()).collect();
    let mean = data.iter().sum::<f64>() / data.len() as f64;
    let centred = GRID.map(|v| v - mean);
    let estimate = masked_covariance(&centred, 11, [4, 4]);
    for (drow, dcol, pairs, sum) in PAIR_SUMS {
        let (p, s) = estimate.at(drow, dcol).unwrap();
        assert!(p == pairs && (s - sum).abs() < 1e-10, "{drow} {dcol}: {p} {s}");
        assert_eq!(estimate.at(-drow, -dcol), Some((p, s)));
    }
    assert_eq!(estimate.at(5, 0), None);
    assert_eq!(estimate.at(0, -5), None);
}

/// Several strips, whose overlaps must not be counted twice; lags beyond the raster are dropped.
#[test]
fn val_masked_covariance_equals_the_definition() {
    for (rows, cols, lag, missing) in
        [(700, 13, [20, 9], 0.3), (300, 7, [70, 3], 0.05), (5, 4, [9, 9], 0.0), (1, 1, [2, 2], 1.0)]
    {
        let values = noise(rows * cols, missing);
        let estimate = masked_covariance(&values, cols, lag);
        for (drow, dcol) in estimate.lags() {
            let (p, s) = estimate.at(drow, dcol).unwrap();
            let (pairs, sum) = brute_force(&values, cols, drow, dcol);
            assert!(p == pairs && (s - sum).abs() < 1e-10, "{rows}x{cols} {drow} {dcol}: {p} {s}, {pairs} {sum}");
        }
    }
}

/// Absolute tolerance 1e-10 (reference to 15 digits).
#[test]
fn val_trimmed_normal() {
    for (t, rows) in TRIMMED {
        let trimmed = TrimmedNormal::new(t);
        for (rho, covariance) in rows {
            let error = trimmed.covariance(rho) - covariance;
            assert!(error.abs() < 1e-10, "t {t}, rho {rho}: {error:e}");
        }
    }
}

/// Far beyond its values, trimming changes nothing: the products of pairs have the mean rho, and no pair is lost.
#[test]
fn val_a_distant_threshold_trims_nothing() {
    for t in [20.0, 50.0, 1e3, 1e6, 1e12, f64::INFINITY] {
        let trimmed = TrimmedNormal::new(t);
        assert!((trimmed.linear_share() - 1.0).abs() < 1e-12, "{t}");
        for rho in [-1.0, -0.9, 0.0, 0.3, 0.95, 0.96, 1.0 - 1e-9, 1.0] {
            let (product, pairs) = trimmed.moments(rho);
            assert!(
                (product - rho).abs() < 1e-12 && (pairs - 1.0).abs() < 1e-12,
                "t {t}, rho {rho}: {product} {pairs}"
            );
        }
    }
    assert!(TrimmedNormal::new(f64::NAN).covariance(0.5).is_nan());
}

/// Mehler's series (long enough for rho up to 0.95) and the integral agree to 1e-10.
#[test]
fn prop_series_equals_integral() {
    for t in [0.6, 0.8, 1.2, 1.96, 3.0, 6.0] {
        let trimmed = TrimmedNormal::new(t);
        for k in 34..=38 {
            let rho = f64::from(k) / 40.0;
            let ((n, p), (n2, p2)) = (trimmed.series(rho), trimmed.integral(rho));
            assert!((n - n2).abs() < 1e-10 && (p - p2).abs() < 1e-10, "t {t}, rho {rho}: {:e} {:e}", n - n2, p - p2);
        }
        assert!((trimmed.integral(1.0).0 - trimmed.integral(1.0 - 1e-12).0).abs() < 1e-5);
    }
}

/// Slopes at rho = 0 in closed form: T'(0) = 0.576 and T(1) = 0.759 at 5 %.
#[test]
fn val_trimming_changes_the_shape() {
    let trimmed = TrimmedNormal::new(1.959_963_984_540_054);
    assert!((trimmed.covariance(1e-6) / 1e-6 - 0.576).abs() < 5e-4);
    assert!((trimmed.covariance(1.0) - 0.759).abs() < 5e-4);
}

/// Relative tolerance 1e-12.
#[test]
fn val_box_filtered_exponential() {
    for (range_m, cell_m, width, expected) in BOX_FILTERED {
        let window = BoxWindow { half: [width / 2; 2] };
        let filter = filtered::DetrendFilter::new(window, [cell_m; 2], [16; 2], Measurement::default());
        let model = Covariance::new(model("exponential").unwrap(), 1.0, range_m).unwrap();
        let residual = filter.residual_covariance(&filter.measured_covariance(&model));
        for (lag, e) in expected.into_iter().enumerate() {
            for at in [[0, lag as isize], [-(lag as isize), 0]] {
                assert!((residual.at(at) - e).abs() < 1e-12, "b {range_m}, lag {lag}: {}", residual.at(at));
            }
        }
    }
}

#[test]
fn val_a_fit_file_needs_a_known_model_and_its_parameters() {
    let mut fit = FitFile { model: "exponential".into(), ..FitFile::default() };
    let message = |fit: &FitFile| Covariance::of_fit(fit).err().unwrap().to_string();
    assert_eq!(message(&fit), "`parameters.sigma_m` is missing from the fit file");
    fit.parameters = [("sigma_m".to_owned(), 0.1), ("range_m".to_owned(), -1.0)].into();
    assert_eq!(message(&fit), "`parameters.range_m` is -1; it must be a finite number above 0");
    fit.parameters.insert("nugget_m2".into(), 0.0);
    assert!(message(&fit).contains("is not a parameter of model `exponential`"));
    fit.model = "gauss".into();
    assert!(message(&fit).starts_with("`model` is `gauss`; it must be one of exponential, gaussian"));
}

/// The expected covariance of the residual of a raster of 40 x 40 cells with some cells missing, in windows of 9 x 9 cells, in every lag
/// bin: by the fast method, and by the definition as a sum over all cells of both windows of every pair.
fn partial_windows_case(missing: impl Fn(usize, usize) -> bool, range_m: f64) -> (Vec<f64>, Vec<f64>) {
    const SIDE: usize = 40;
    let window = BoxWindow { half: [4; 2] };
    let values: Vec<f64> = (0..SIDE * SIDE).map(|k| if missing(k / SIDE, k % SIDE) { f64::NAN } else { 0.0 }).collect();
    let count = background(&values, SIDE, window, AtPartial::Plane).count;
    let used = |k: usize| !values[k].is_nan() && count[k] > 40;
    let residual: Vec<f64> = (0..values.len()).map(|k| if used(k) { 0.0 } else { f64::NAN }).collect();
    let model = Covariance::new(model("exponential").unwrap(), 1.0, range_m).unwrap();
    let bins = LagBins::of(&masked_covariance(&residual, SIDE, [4; 2]), [1.0; 2], 4.0, bins::Layout::ISOTROPIC);
    let bits = |values: &[f64]| {
        let mut bits = crate::bitmap::Bitmap::with_capacity(values.len());
        values.iter().for_each(|v| bits.push(!v.is_nan()));
        bits
    };
    let (trusted, used_cells) = (bits(&values), bits(&residual));
    let cells = partial::DetrendedCells {
        rows: SIDE,
        cols: SIDE,
        trusted: &trusted,
        used: &used_cells,
        detrended: used_cells.count(),
        partial: (0..values.len()).filter(|&k| used(k) && (count[k] as usize) < window.area()).count(),
    };
    let filter = filtered::DetrendFilter::new(window, [1.0; 2], [4; 2], Measurement::default());
    let measured = filter.measured_covariance(&model);
    let complete = bins.average(|lag| filter.residual_covariance(&measured).at(lag));
    let windows = partial::PartialWindows::new(&cells, window, &bins, partial::PAIRS_FINE);
    let added = windows.correction(&measured);
    let by_distance = windows.by_distance([1.0; 2]).correction(|d| model.at_distance(d));
    added.iter().zip(&by_distance).for_each(|(a, b)| assert!((a - b).abs() < 1e-4, "{a} {b}"));
    let fast = complete.iter().zip(&added).map(|(a, b)| a + b).collect();

    let squares: Vec<f64> = (0..=800).map(|s| model.at_distance(f64::from(s).sqrt())).collect();
    let c = |dr: isize, dc: isize| squares[(dr * dr + dc * dc) as usize];
    let windows: Vec<Vec<([isize; 2], f64)>> = (0..values.len() as isize)
        .map(|k| {
            let near = |x: isize| (x - 4).max(0)..(x + 5).min(SIDE as isize);
            let all = near(k / SIDE as isize).flat_map(|r| near(k % SIDE as isize).map(move |c| [r, c]));
            let data = all.filter(|[r, c]| !values[(r * SIDE as isize + c) as usize].is_nan());
            plane_weights([k / SIDE as isize, k % SIDE as isize], data.collect())
        })
        .collect();
    let exact_at = |lag: [isize; 2]| {
        let (mut total, mut pairs) = (0.0, 0.0);
        for i in (0..values.len()).filter(|&i| used(i)) {
            let at = [(i / SIDE) as isize, (i % SIDE) as isize];
            let to = [at[0] + lag[0], at[1] + lag[1]];
            if to.iter().any(|&x| x < 0 || x >= SIDE as isize) || !used((to[0] * SIDE as isize + to[1]) as usize) {
                continue;
            }
            let (near, far) = (&windows[i], &windows[(to[0] * SIDE as isize + to[1]) as usize]);
            let mean = |w: &Vec<([isize; 2], f64)>, p: [isize; 2]| {
                w.iter().map(|(q, weight)| weight * c(q[0] - p[0], q[1] - p[1])).sum::<f64>()
            };
            let both = near.iter().map(|(p, weight)| weight * mean(far, *p)).sum::<f64>();
            total += c(lag[0], lag[1]) - mean(near, to) - mean(far, at) + both;
            pairs += 1.0;
        }
        total / pairs
    };
    (fast, bins.average(exact_at))
}

/// Cells and their weights in the least-squares plane at `at`, by Cramer's rule.
fn plane_weights(at: [isize; 2], cells: Vec<[isize; 2]>) -> Vec<([isize; 2], f64)> {
    let row = |cell: &[isize; 2]| [1.0, (cell[1] - at[1]) as f64, (cell[0] - at[0]) as f64];
    let m = |i: usize, j: usize| cells.iter().map(|cell| row(cell)[i] * row(cell)[j]).sum::<f64>();
    let first = [
        m(1, 1) * m(2, 2) - m(1, 2) * m(1, 2),
        m(0, 2) * m(1, 2) - m(0, 1) * m(2, 2),
        m(0, 1) * m(1, 2) - m(0, 2) * m(1, 1),
    ];
    let determinant = m(0, 0) * first[0] + m(0, 1) * first[1] + m(0, 2) * first[2];
    let weight = |cell: &[isize; 2]| row(cell).iter().zip(first).map(|(x, f)| x * f).sum::<f64>() / determinant;
    cells.iter().map(|cell| (*cell, weight(cell))).collect()
}

/// Tolerance 5e-4 of the surface's variance, 1.5e-3 with scattered holes: a window of 9 cells has blocks of one or two
/// cells, which represent the statistics of scattered holes only roughly. The corrections are up to 100 times larger.
#[test]
fn val_partial_windows_equal_the_definition() {
    let scattered = noise(1600, 0.2);
    let border = |_: usize, _: usize| false;
    let scattered = |r: usize, c: usize| scattered[r * 40 + c].is_nan();
    let block = |r: usize, c: usize| (12..22).contains(&r) && (15..24).contains(&c);
    let slanted = |r: usize, c: usize| 2 * r + 3 * c < 60;
    type Missing<'a> = &'a dyn Fn(usize, usize) -> bool;
    let holes: [(&str, f64, Missing); 4] = [
        ("border", 5e-4, &border),
        ("scattered", 1.5e-3, &scattered),
        ("block", 5e-4, &block),
        ("slanted", 5e-4, &slanted),
    ];
    for (name, tolerance, missing) in holes {
        for range_m in [1.5, 6.0] {
            let (fast, exact) = partial_windows_case(missing, range_m);
            let worst = fast.iter().zip(&exact).map(|(a, b)| (a - b).abs()).max_by(f64::total_cmp).unwrap();
            assert!(worst < tolerance, "{name}, b {range_m}: {worst:e}, {fast:?} {exact:?}");
        }
    }
}

/// A raster with windows of a realistic size: the mask, the bins of its residual, and the correction for partial windows.
struct LargeWindows {
    side: usize,
    window: BoxWindow,
    /// 0 where there is data, else NaN.
    heights: Vec<f64>,
    used: Vec<bool>,
    partial: usize,
    bins: LagBins,
}

impl LargeWindows {
    fn new(side: usize, half: usize, missing: impl Fn(usize) -> bool) -> Self {
        let window = BoxWindow { half: [half; 2] };
        let heights: Vec<f64> = (0..side * side).map(|k| if missing(k) { f64::NAN } else { 0.0 }).collect();
        let count = background(&heights, side, window, AtPartial::Plane).count;
        let used: Vec<bool> =
            (0..heights.len()).map(|k| !heights[k].is_nan() && 2 * count[k] as usize > window.area()).collect();
        let residual: Vec<f64> = used.iter().map(|&used| if used { 0.0 } else { f64::NAN }).collect();
        let sums = masked_covariance(&residual, side, [half; 2]);
        let bins = LagBins::of(&sums, [1.0; 2], half as f64, bins::Layout::ISOTROPIC);
        let partial = (0..used.len()).filter(|&k| used[k] && (count[k] as usize) < window.area()).count();
        Self { side, window, heights, used, partial, bins }
    }

    fn expectation(&self) -> Expectation<'_> {
        let bits = |is_set: &dyn Fn(usize) -> bool| {
            let mut bits = crate::bitmap::Bitmap::with_capacity(self.used.len());
            (0..self.used.len()).for_each(|k| bits.push(is_set(k)));
            bits
        };
        let (trusted, used) = (bits(&|k| !self.heights[k].is_nan()), bits(&|k| self.used[k]));
        let (rows, cols, detrended) = (self.side, self.side, used.count());
        let cells =
            partial::DetrendedCells { rows, cols, trusted: &trusted, used: &used, detrended, partial: self.partial };
        let windows = partial::PartialWindows::new(&cells, self.window, &self.bins, partial::PAIRS_FINE);
        Expectation {
            filter: filtered::DetrendFilter::new(self.window, [1.0; 2], self.window.half, Measurement::default()),
            wide: filtered::DetrendFilter::wide(self.window, [1.0; 2], self.window.half, Measurement::default()),
            partial_by_distance: windows.by_distance([1.0; 2]),
            partial: windows,
            bins: &self.bins,
            cells: detrended,
        }
    }

    /// The expected covariance of the residual in every bin by the definition: `(1 - D) C (1 - D)'`, row by row.
    fn exact(&self, model: &Covariance) -> Vec<f64> {
        let torus = 2 * self.side;
        let fft = RealFft2::new(torus, torus);
        let spectrum = fft.forward(&filtered::torus_covariance([torus; 2], [1.0; 2], model));
        let row = |k: usize| {
            let mut own = fft.forward(&self.kernel(k, torus));
            own.values.iter_mut().zip(&spectrum.values).for_each(|(a, b)| *a *= Complex64::new(b.re, 0.0));
            let with_heights = fft.inverse(own);
            let at = |k: usize| with_heights[k / self.side * torus + k % self.side] + self.heights[k];
            let values: Vec<f64> = (0..self.used.len()).map(at).collect();
            let mean = background(&values, self.side, self.window, AtPartial::Plane).height_m;
            values.iter().zip(mean).map(|(z, mean)| z - mean).collect::<Vec<f64>>()
        };
        let pairs = |k: usize| {
            let row = row(k);
            let side = self.side as isize;
            let to = |lag: [isize; 2]| [k as isize / side + lag[0], k as isize % side + lag[1]];
            let product = |m: &bins::Member| {
                let [r, c] = to(m.lag);
                let inside = (0..side).contains(&r) && (0..side).contains(&c);
                let partner = (r * side + c) as usize;
                if inside && self.used[partner] { [row[partner], 1.0] } else { [0.0; 2] }
            };
            self.bins.members.iter().map(product).collect::<Vec<_>>()
        };
        let mut sums = vec![[0.0; 2]; self.bins.members.len()];
        let all: Vec<Vec<[f64; 2]>> =
            (0..self.used.len()).into_par_iter().filter(|&k| self.used[k]).map(pairs).collect();
        for products in &all {
            sums.iter_mut().zip(products).for_each(|(sum, p)| (0..2).for_each(|k| sum[k] += p[k]));
        }
        let mut binned = vec![0.0; self.bins.len()];
        self.bins.members.iter().zip(&sums).for_each(|(m, [sum, pairs])| binned[m.bin] += m.weight * sum / pairs);
        binned
    }

    /// `1 - D` of a cell on a torus.
    fn kernel(&self, k: usize, torus: usize) -> Vec<f64> {
        let (side, half) = (self.side as isize, self.window.half[0] as isize);
        let at = [k as isize / side, k as isize % side];
        let near = |x: isize| (x - half).max(0)..(x + half + 1).min(side);
        let all = near(at[0]).flat_map(|r| near(at[1]).map(move |c| [r, c]));
        let data: Vec<[isize; 2]> = all.filter(|[r, c]| !self.heights[(r * side + c) as usize].is_nan()).collect();
        let mut kernel = vec![0.0; torus * torus];
        for ([r, c], weight) in plane_weights(at, data) {
            kernel[r as usize * torus + c as usize] -= weight;
        }
        kernel[at[0] as usize * torus + at[1] as usize] += 1.0;
        kernel
    }

    /// Relative bias of sigma and b from generalised least squares caused by the error of the model's mean.
    fn bias(&self, model: &Covariance) -> [f64; 2] {
        let expectation = self.expectation();
        let scaled = |by: f64| {
            let mut other = model.clone();
            other.structures[0].range_m *= by;
            other
        };
        // The threshold is so large that trimming removes almost nothing.
        let mean = |model: &Covariance| expectation.mean(model, THRESHOLD);
        let step = 1e-3;
        let at = mean(model);
        let along_b: Vec<f64> = mean(&scaled(1.0 + step)).iter().zip(&at).map(|(a, b)| (a - b) / step).collect();
        let along_sigma: Vec<f64> = at.iter().map(|c| 2.0 * c).collect();
        let error: Vec<f64> = self.exact(model).iter().zip(&at).map(|(exact, own)| exact - own).collect();
        let weights = Cholesky::new(&expectation.covariance(model, THRESHOLD), at.len()).unwrap();
        let [sigma, b, error] = [along_sigma, along_b, error].map(|v| weights.whiten(&v));
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let (aa, ab, bb) = (dot(&sigma, &sigma), dot(&sigma, &b), dot(&b, &b));
        let (ae, be) = (dot(&sigma, &error), dot(&b, &error));
        let determinant = aa * bb - ab * ab;
        [(bb * ae - ab * be) / determinant, (aa * be - ab * ae) / determinant]
    }
}

/// Standard deviations of a unit surface beyond which [`LargeWindows::bias`] trims.
const THRESHOLD: f64 = 8.0;

/// Against the definition with windows of 17 cells, borders and 15 % scattered holes: the error of the mean biases the fit of a rough
/// surface (exponential) by less than 1 % in b, and that of a smooth one (Gaussian), whose bins hardly scatter among themselves, by
/// less than 3 %; with errors of the same size but independent from bin to bin it was a quarter.
#[test]
fn val_the_mean_of_large_windows_does_not_bias_fits() {
    let holes = noise(64 * 64, 0.15);
    let border = LargeWindows::new(64, 8, |_| false);
    let scattered = LargeWindows::new(64, 8, |k| holes[k].is_nan());
    for (name, case) in [("border", &border), ("scattered", &scattered)] {
        for (kind, range_m, limits) in [("exponential", 3.0, [0.005, 0.01]), ("gaussian", 4.0, [0.03, 0.02])] {
            let [sigma, b] = case.bias(&Covariance::new(model(kind).unwrap(), 1.0, range_m).unwrap());
            println!("{name} {kind}: sigma {:+.2} %, b {:+.2} %", 100.0 * sigma, 100.0 * b);
            assert!(sigma.abs() < limits[0] && b.abs() < limits[1], "{name} {kind}: {sigma} {b}");
        }
    }
}

/// Rows count southwards: a lag of one row south and two columns east.
#[test]
fn val_lags_in_metres() {
    assert_eq!(lag::lag_m([1, 2], [0.5, 0.25]), [1.0, -0.25]);
    assert_eq!(lag::length_m([3, -4], [0.5, 0.5]), 2.5);
    assert_eq!(lag::length_m([2, 3], [1.0, 2.0]), 5.0);
}

/// Every model at hand-computed ratios of distance and range, and the increments of a self-affine surface: s^2 d^(2 H) over d.
#[test]
fn val_models_by_hand() {
    let at = |name: &str, ratio: f64, shape: f64| model(name).unwrap().correlation(ratio, shape);
    let e = libm::exp(-1.0);
    for (name, expected) in [("exponential", [1.0, e, e * e]), ("gaussian", [1.0, e, e * e * e * e])] {
        for (ratio, correlation) in [0.0, 1.0, 2.0].into_iter().zip(expected) {
            assert!((at(name, ratio, 0.0) - correlation).abs() < 1e-15, "{name} {ratio}");
        }
    }
    assert_eq!([0.0, 0.5, 1.0, 1.5].map(|r| at("spherical", r, 0.0)), [1.0, 0.3125, 0.0, 0.0]);
    // (1 + x) exp(-x) for a smoothness of 3/2.
    assert!((at("matern", 1.0, 1.5) - 2.0 * e).abs() < 1e-13);
    let affine = Form::parse("self_affine").unwrap();
    let affine = affine.covariance(&[("increment_1m_m".to_owned(), 0.1), ("hurst".to_owned(), 0.75)].into()).unwrap();
    let increment = |d: f64| 2.0 * (affine.at_distance(0.0) - affine.at_distance(d));
    assert!((increment(1.0) - 0.01).abs() < 1e-15 && (increment(4.0) - 0.08).abs() < 1e-14);
    assert!(!affine.is_stationary());
}

/// The stationary counterpart of a self-affine surface has its increments at lags far below the range: the error is of the order of
/// `(d / 2 b)^(2 - 2 H)`, 2 % here, and falls by 2^(2 - 2 H) where the lag is halved.
#[test]
fn conv_the_stationary_counterpart_has_the_same_increments() {
    let affine = Form::parse("self_affine").unwrap();
    let affine = affine.covariance(&[("increment_1m_m".to_owned(), 0.1), ("hurst".to_owned(), 0.5)].into()).unwrap();
    let twin = affine.stationary(10.0);
    assert!(twin.is_stationary() && twin.range_m() == 10.0);
    // With H = 1/2 it is an exponential: sigma^2 = s^2 2 b Gamma(3/2) / (2 Gamma(1/2)) = s^2 b / 2.
    assert!((twin.variance_m2() / (0.01 * 10.0 / 2.0) - 1.0).abs() < 1e-12, "{}", twin.variance_m2());
    let error = |d: f64| {
        let increment = |c: &Covariance| c.at_distance(0.0) - c.at_distance(d);
        1.0 - increment(&twin) / increment(&affine)
    };
    // Of an exponential, (1 - exp(-x)) / x = 1 - x / 2 + ...
    assert!((error(0.4) / 0.02 - 1.0).abs() < 0.02, "{}", error(0.4));
    assert!((error(0.4) / error(0.2) - 2.0).abs() < 0.02);
}

/// Rings and sectors of a raster of 3 x 3 ones, by hand. Lags up to 2 cells: lag 0 (9 pairs); east and south (6 each) and both diagonals (4
/// each) in ring 1; two cells east or south (3 each) in ring 2.
#[test]
fn val_bins_by_hand() {
    let ones = masked_covariance(&[1.0; 9], 3, [2, 2]);
    let bins = LagBins::of(&ones, [1.0; 2], 2.0, bins::Layout::ISOTROPIC);
    assert_eq!((bins.pairs.as_slice(), bins.covariance_m2.len()), ([9, 20, 6].as_slice(), 3));
    assert!(bins.covariance_m2.iter().all(|c| (c - 1.0).abs() < 1e-12));
    let mean = (12.0 + 8.0 * 2f64.sqrt()) / 20.0;
    assert!((bins.lag_m[1] - mean).abs() < 1e-12 && bins.lag_m[0] == 0.0 && (bins.lag_m[2] - 2.0).abs() < 1e-12);
    // The mean of any function is weighted by pairs: of the number of rows in ring 1, (6 + 4 + 4) / 20.
    let rows = bins.average(|lag| lag[0].abs() as f64);
    assert!((rows[1] - 0.7).abs() < 1e-12 && (rows[2] - 1.0).abs() < 1e-12, "{rows:?}");
    // Another estimate in the same bins.
    let twos = masked_covariance(&[2.0; 9], 3, [2, 2]);
    assert!(bins.means(&twos).iter().all(|c| (c - 4.0).abs() < 1e-12));

    // Directions, clockwise from north: one row south and two columns east is 116.6 degrees, two south and one east 153.4, two south and one west
    // 26.6; on cells twice as wide as high the first is 104.0 degrees.
    let ones = masked_covariance(&[1.0; 100], 10, [4, 4]);
    let azimuth = |cell_m: [f64; 2], lag: [isize; 2]| {
        let bins = LagBins::of(&ones, cell_m, 5.0, bins::Layout::DIRECTIONAL);
        let member = bins.members.iter().find(|m| m.lag == lag).unwrap();
        bins.azimuth_deg[member.bin]
    };
    let square = [1.0; 2];
    let found = [[0, 1], [1, 0], [1, 2], [2, 1], [2, -1]].map(|lag| azimuth(square, lag).unwrap());
    assert_eq!(found, [90.0, 0.0, 120.0, 150.0, 30.0]);
    assert_eq!((azimuth(square, [0, 0]), azimuth([2.0, 1.0], [1, 2])), (None, Some(90.0)));
}

/// A Gaussian surface `exp(-(h / b)^2)` seen through a Gaussian point spread function of standard deviation s has the covariance
/// `b^2 / b'^2 exp(-(h / b')^2)`, `b'^2 = b^2 + 4 s^2`. Tolerance 1e-12.
#[test]
fn val_blur_widens_a_gaussian() {
    let (range_m, spread_m) = (0.5, 0.2);
    let measurement = Measurement { inner_scale_m: spread_m, ..Measurement::default() };
    let filter = filtered::DetrendFilter::new(BoxWindow { half: [20; 2] }, [0.1; 2], [20; 2], measurement);
    let model = Covariance::new(model("gaussian").unwrap(), 1.0, range_m).unwrap();
    let found = filter.measured_covariance(&model);
    let wide2 = range_m * range_m + 4.0 * spread_m * spread_m;
    for lag in [[0, 0], [0, 3], [5, 0], [-4, 4], [0, 11]] {
        let square = 0.01 * (lag[0] * lag[0] + lag[1] * lag[1]) as f64;
        let expected = range_m * range_m / wide2 * libm::exp(-square / wide2);
        assert!((found.at(lag) - expected).abs() < 1e-12, "{lag:?}: {} {expected}", found.at(lag));
    }
}

/// White noise minus its mean over a window of 5 rows by 7 columns: `w^2 (delta(h) - 2 D(h) + o(h) / 35^2)`, D 1/35 within the window, o the
/// number of cells common to two windows. Tolerance 1e-15.
#[test]
fn val_white_noise_of_a_residual() {
    let noise = crate::noise::Noise { white_sigma_m: 0.1, ..Default::default() };
    let measurement = Measurement { noise, ..Measurement::default() };
    let filter = filtered::DetrendFilter::new(BoxWindow { half: [2, 3] }, [0.1; 2], [8; 2], measurement);
    let found = filter.residual_noise();
    for (lag, expected) in [
        ([0, 0], 1.0 - 1.0 / 35.0),
        ([0, 1], -2.0 / 35.0 + 30.0 / 1225.0),
        ([2, 0], -2.0 / 35.0 + 21.0 / 1225.0),
        // Beyond the window to the south, not to the east.
        ([3, 0], 14.0 / 1225.0),
        ([0, 3], -2.0 / 35.0 + 20.0 / 1225.0),
        ([0, 4], 15.0 / 1225.0),
        ([5, 0], 0.0),
        ([4, 6], 1.0 / 1225.0),
    ] {
        assert!((found.at(lag) - 0.01 * expected).abs() < 1e-15, "{lag:?}: {:e}", found.at(lag));
    }
}
