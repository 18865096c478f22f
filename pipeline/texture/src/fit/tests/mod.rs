mod hostile;
pub(super) mod kept;
mod noise;
mod slopes;

use super::*;
use crate::covariance::Covariance;
use crate::covariance::partial::{PAIRS_FINE, PartialWindows};
use crate::noise::Noise;
use crate::synth::Synthesis;
use crate::synth::fft_ma::{self, FftMaParameters, Phase};
use crate::synth::tile::{Cell, TileParameters};
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, sums};

const CELL_M: f64 = 0.06;

/// A normal field with an exponential covariance of unit sigma, cut from a larger torus.
fn field(range_m: f64, cells: usize, cell_m: f64, seed: u64) -> Grid {
    let covariance = Covariance::new(crate::covariance::model("exponential").unwrap(), 1.0, range_m).unwrap();
    let tile =
        TileParameters { size_px: Some([cells as u32; 2]), cell_m: Cell::Square(cell_m), ..TileParameters::default() };
    let parameters = FftMaParameters { phase: Phase::Gaussian, periodic: false, ..FftMaParameters::default() };
    fft_ma::texture(tile, &parameters, covariance).unwrap().generate(&Streams::for_seed(seed, "fit-test")).unwrap().grid
}

fn streams() -> Streams {
    Streams::for_seed(0, "fit")
}

fn settings(mode: Mode, outer_scale_m: f64, trim: f64) -> FitSettings {
    FitParameters { mode, outer_scale_m, trim, bootstrap: 0, ..FitParameters::default() }.try_into().unwrap()
}

/// The estimator of the program, which keeps no partial windows of other fits.
fn alone<'a>(case: &'a Case<'a>) -> Estimator<'a> {
    let partial = PartialWindows::new(&case.survey.cells(), case.window, &case.bins, PAIRS_FINE);
    Estimator::with_partial(case, &case.bins, partial)
}

/// Sigma and b without intervals and verdicts.
fn found_by(estimator: &Estimator) -> [f64; 2] {
    let naive = ordinary(estimator.case, &Form::parse("exponential").unwrap());
    let covariance = best(&estimator.candidates(&naive)).unwrap().covariance.clone();
    [covariance.sigma_m(), covariance.range_m()]
}

/// The estimate alone, without intervals and verdicts.
fn estimate(dem: &Grid, settings: &FitSettings) -> [f64; 2] {
    let case = Case::new(dem, settings).unwrap();
    if settings.mode() == Mode::Corrected {
        return found_by(&Estimator::new(&case, &case.bins));
    }
    let naive = ordinary(&case, &Form::parse("exponential").unwrap()).covariance;
    [naive.sigma_m(), naive.range_m()]
}

/// The same windows, kept or computed: estimates are those of the program, with holes too, whether the windows are new, known from another
/// field, or known from the same one.
#[test]
fn val_kept_partial_windows_are_those_of_the_program() {
    let s = settings(Mode::Corrected, 2.0, 0.05);
    for (seed, spoil) in [(1, untouched as Spoil), (2, untouched), (2, scattered), (2, scattered), (1, blocky)] {
        let mut dem = field(0.28, 256, CELL_M, seed);
        spoil(&mut dem, seed);
        let ours = found_by(&alone(&Case::new(&dem, &s).unwrap()));
        assert_eq!(estimate(&dem, &s).map(f64::to_bits), ours.map(f64::to_bits), "{seed}");
    }
}

/// A change made to the field of a seed before it is fitted.
type Spoil = fn(&mut Grid, u64);

/// Relative bias and scatter of sigma and b over `count` fields.
fn study(range_m: f64, cells: usize, count: u64, settings: &FitSettings, spoil: Spoil) -> [[f64; 2]; 2] {
    let estimates: Vec<[f64; 2]> = (0..count)
        .into_par_iter()
        .map(|seed| {
            let mut dem = field(range_m, cells, CELL_M, seed);
            spoil(&mut dem, seed);
            estimate(&dem, settings)
        })
        .collect();
    bias_and_scatter(range_m, &estimates)
}

/// Relative bias and scatter of estimates of sigma and b, for a sigma of 1.
fn bias_and_scatter(range_m: f64, estimates: &[[f64; 2]]) -> [[f64; 2]; 2] {
    [(0, 1.0), (1, range_m)].map(|(k, truth)| {
        let values: Vec<f64> = estimates.iter().map(|e| e[k] / truth).collect();
        [sums::mean(&values) - 1.0, sums::variance(&values).sqrt()]
    })
}

fn untouched(_: &mut Grid, _: u64) {}

/// Asserts that the biases lie within `limits` (sigma, b) of `expected`.
fn assert_bias(name: &str, found: [[f64; 2]; 2], expected: [f64; 2], limits: [f64; 2]) {
    let text: Vec<String> =
        found.iter().map(|[bias, scatter]| format!("{:+.2} % +- {:.2} %", 100.0 * bias, 100.0 * scatter)).collect();
    println!("{name}: sigma {}, b {}", text[0], text[1]);
    for k in 0..2 {
        assert!(
            (found[k][0] - expected[k]).abs() <= limits[k],
            "{name}: {text:?}, expected {expected:?} +- {limits:?}"
        );
    }
}

/// Removes 20 % of the cells at random.
fn scattered(dem: &mut Grid, seed: u64) {
    let mut s = Streams::for_seed(seed, "fit-test").stream("holes");
    dem.values.iter_mut().filter(|_| s.uniform() < 0.2).for_each(|z| *z = f64::NAN);
}

/// Removes squares of 30 cells, a fifth of the raster if they do not overlap.
fn blocky(dem: &mut Grid, seed: u64) {
    let mut s = Streams::for_seed(seed, "fit-test").stream("blocks");
    let (rows, cols) = (dem.rows(), dem.cols());
    for _ in 0..rows * cols / 5 / 900 {
        let (r, c) = (s.below(rows as u64 - 30) as usize, s.below(cols as u64 - 30) as usize);
        (r..r + 30).for_each(|i| dem.values[i * cols + c..i * cols + c + 30].fill(f64::NAN));
    }
}

/// Adds 25 cones, 10 sigma high.
fn trees(dem: &mut Grid, seed: u64) {
    cones(dem, seed, 25, 10.0);
}

/// Adds cones of 0.6 m radius.
fn cones(dem: &mut Grid, seed: u64, count: usize, height_m: f64) {
    let mut s = Streams::for_seed(seed, "fit-test").stream("trees");
    let g = dem.geometry;
    for _ in 0..count {
        let (x, y) = (s.uniform_in(0.0, g.size()[0]), s.uniform_in(0.0, g.size()[1]));
        for (r, line) in dem.values.chunks_exact_mut(g.cols).enumerate() {
            let dy = g.y(r) - y;
            // Most rows are beyond the cone.
            if dy.abs() > 0.61 {
                continue;
            }
            for (c, z) in line.iter_mut().enumerate() {
                let dx = g.x(c) - x;
                *z += (height_m * (1.0 - (dx * dx + dy * dy).sqrt() / 0.6)).max(0.0);
            }
        }
    }
}

/// Null: no bias. Scatter of one field: 0.9 % (sigma) and 2.1 % (b) at b = 0.28 m. Mean of 8 fields, threshold six
/// standard errors: false alarm 2e-9 each. The published fit is off by 19 % and 42 %.
#[test]
fn stat_corrected_fit_has_no_large_bias() {
    let s = settings(Mode::Corrected, 2.0, 0.05);
    assert_bias("0.28 m", study(0.28, 512, 8, &s, untouched), [0.0; 2], [0.02, 0.045]);
}

/// The published biases, to 2 points. Scatter of one field at most 0.6 %: the mean of 6 fields has a standard error of 0.25 %, so
/// 1.5 points from the expected mean are six standard errors (false alarm 2e-9).
#[test]
fn val_paper_mode_has_the_published_bias() {
    let s = settings(Mode::Paper, 2.0, 0.05);
    assert_bias("paper 0.28 m", study(0.28, 512, 6, &s, untouched), [-0.19, -0.42], [0.02; 2]);
    assert_bias("paper 1 m", study(1.0, 512, 6, &s, untouched), [-0.43, -0.76], [0.02; 2]);
}

/// Asserts that the scatter of sigma and b is at most twice the Cramer-Rao bound of raw data, also in percent.
fn assert_efficient(found: [[f64; 2]; 2], bound: [f64; 2]) {
    for k in 0..2 {
        assert!(found[k][1] <= 0.02 * bound[k], "{found:?}, bound {bound:?} %");
    }
}

/// An exponential of b = 0.28 m. Null: no bias. 200 fields with the defaults: standard errors 0.07 % and 0.16 %; 100 fields each with other
/// settings and with holes: at most 0.11 % and 0.25 %. Limits of 0.5 % and 1 % are at least four of them (false alarm 6e-5).
/// Efficiency: 200 fields give a scatter to 5 %; ratios to the bound of 1.1 to 1.3 were measured.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_corrected_fit_is_unbiased_and_efficient() {
    // Name, window, trimming and what is removed.
    let studies: [(&str, f64, f64, Spoil); 7] = [
        ("b 0.28 m", 2.0, 0.05, untouched),
        ("b 0.28 m, window 1 m", 1.0, 0.05, untouched),
        ("b 0.28 m, window 4 m", 4.0, 0.05, untouched),
        ("b 0.28 m, trim 1 %", 2.0, 0.01, untouched),
        ("b 0.28 m, trim 10 %", 2.0, 0.1, untouched),
        ("b 0.28 m, 20 % scattered no-data", 2.0, 0.05, scattered),
        ("b 0.28 m, 20 % blocky no-data", 2.0, 0.05, blocky),
    ];
    // A field is made once for all studies; only the first has the second hundred.
    let of_seed = |seed: u64| -> Vec<[f64; 2]> {
        let whole = field(0.28, 512, CELL_M, seed);
        let estimate_of = |&(_, window, trim, spoil): &(&str, f64, f64, Spoil)| {
            let mut dem = whole.clone();
            spoil(&mut dem, seed);
            estimate(&dem, &settings(Mode::Corrected, window, trim))
        };
        let own = if seed < 100 { &studies[..] } else { &studies[..1] };
        own.iter().map(estimate_of).collect()
    };
    let estimates: Vec<Vec<[f64; 2]>> = (0..200u64).into_par_iter().map(of_seed).collect();
    for (k, (name, ..)) in studies.iter().enumerate() {
        let of_study: Vec<[f64; 2]> = estimates.iter().filter_map(|one| one.get(k).copied()).collect();
        let found = bias_and_scatter(0.28, &of_study);
        assert_bias(name, found, [0.0; 2], [0.005, 0.01]);
        if k == 0 {
            assert_efficient(found, [0.78, 1.62]);
        }
    }
}

/// An exponential of b = 1 m, window 2 m. Null: no bias. 400 fields: standard errors 0.22 % and 0.47 %, so limits of
/// 1 % and 2 % are above four of them (6e-5). Efficiency: 400 fields give a scatter to 4 %; a ratio of 1.7 was measured for both,
/// so that a false alarm needs more than four of these errors.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_corrected_fit_is_unbiased_and_efficient_near_the_window() {
    let found = study(1.0, 512, 400, &settings(Mode::Corrected, 2.0, 0.05), untouched);
    assert_bias("b 1 m", found, [0.0; 2], [0.01, 0.02]);
    assert_efficient(found, [2.75, 5.53]);
}

/// Null: trees are removed without any bias. 200 fields: standard errors 0.07 % and 0.16 %.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_trees_do_not_bias_the_fit() {
    let found = study(0.28, 512, 200, &settings(Mode::Corrected, 2.0, 0.05), trees);
    assert_bias("25 trees", found, [0.0; 2], [0.015, 0.03]);
}

/// Cells of 6 cm by 9 cm. Null: no bias; 8 fields of 512 x 512, thresholds as above.
#[test]
fn stat_cells_need_not_be_square() {
    let s = settings(Mode::Corrected, 2.0, 0.05);
    let estimates: Vec<[f64; 2]> = (0..8)
        .into_par_iter()
        .map(|seed| {
            // Every third row of a field of 3 cm cells, every second column.
            let fine = field(0.28, 1024, 0.03, seed);
            let (rows, cols) = (341, 512);
            let values = (0..rows).flat_map(|r| (0..cols).map(move |c| (r, c))).map(|(r, c)| fine.at(3 * r, 2 * c));
            let geometry = Geometry { rows, cols, cell: [0.06, 0.09], origin: [0.0; 2] };
            estimate(&Grid::new(geometry, values.collect()), &s)
        })
        .collect();
    for (k, truth, limit) in [(0, 1.0, 0.02), (1, 0.28, 0.045)] {
        let bias = sums::mean(&estimates.iter().map(|e| e[k] / truth).collect::<Vec<_>>()) - 1.0;
        assert!(bias.abs() < limit, "{bias}");
    }
}

fn refused(dem: &Grid, parameters: FitParameters) -> FitError {
    fit(dem, &parameters.try_into().unwrap(), &streams()).err().unwrap()
}

/// Too few cells, no relief, windows that are too small or too large: one error each.
#[test]
fn val_what_cannot_be_fitted_is_refused() {
    let flat = |rows, cols, z| Grid::filled(Geometry::square(rows, cols, 0.1), z);
    let scale = |outer_scale_m| FitParameters { outer_scale_m, ..FitParameters::default() };
    assert!(matches!(refused(&flat(30, 80, 0.0), scale(2.0)), FitError::DemTooSmall { needed_m: 4.0, .. }));
    assert!(matches!(refused(&flat(50, 80, 0.0), scale(2.0)), FitError::OuterScaleTooLarge { .. }));
    assert!(matches!(refused(&flat(80, 80, 0.0), scale(0.2)), FitError::OuterScaleTooSmall { .. }));
    assert_eq!(refused(&flat(80, 80, f64::NAN), scale(1.0)), FitError::NoData { cells: 6400 });
    assert_eq!(refused(&flat(80, 80, 1234.1), scale(1.0)), FitError::Constant { height_m: 1234.1, objects: 0 });
    let mut white = flat(100, 100, 0.0);
    let mut s = Streams::for_seed(1, "fit-test").stream("white");
    white.values.iter_mut().for_each(|z| *z = s.normal());
    assert!(matches!(refused(&white, scale(1.0)), FitError::White { cell_m: 0.1, .. }));
    assert!(matches!(refused(&white, FitParameters { mode: Mode::Paper, ..scale(1.0) }), FitError::White { .. }));
    white.values.iter_mut().filter(|_| s.uniform() < 0.7).for_each(|z| *z = f64::NAN);
    assert!(matches!(refused(&white, scale(1.0)), FitError::NoWindow { needed_share: 0.5, .. }));
    let few = |found| FitError::TooFewLags { found, needed: 3 }.to_string();
    assert_eq!(few(1), "pairs of cells exist at only 1 lag; a fit needs at least 3");
    assert_eq!(few(2), "pairs of cells exist at only 2 lags; a fit needs at least 3");
    for (key, parameters) in [
        ("trim", FitParameters { trim: 0.5, ..scale(1.0) }),
        ("trim", FitParameters { trim: 0.0, ..scale(1.0) }),
        ("outer_scale_m", scale(f64::NAN)),
        ("model", FitParameters { model: "cubic".into(), ..scale(1.0) }),
        ("max_lag_m", FitParameters { max_lag_m: Some(-1.0), ..scale(1.0) }),
        ("min_valid_share", FitParameters { min_valid_share: Some(1.0), ..scale(1.0) }),
    ] {
        assert_eq!(FitSettings::try_from(parameters).err().unwrap().key, key);
    }
}

#[test]
fn val_the_fit_file_is_complete() {
    let s = settings(Mode::Corrected, 2.0, 0.05);
    let dem = field(0.28, 256, CELL_M, 1);
    let outcome = fit(&dem, &s, &streams()).unwrap();
    let [background, residual] = outcome.rasters(&dem).unwrap();
    let fit = outcome.fit;
    assert_eq!((fit.mode.as_str(), fit.model.as_str(), fit.source.is_none()), ("corrected", "exponential", true));
    let bins = fit.lags_m.len();
    assert!(bins >= 17 && [&fit.covariance_m2, &fit.model_m2, &fit.surface_model_m2].iter().all(|v| v.len() == bins));
    assert_eq!(fit.window_m.unwrap().map(|w| (w * 100.0).round()), [198.0, 198.0]);
    let trim = fit.trim.unwrap();
    let used = residual.finite_count();
    assert!((trim.masked_share - (1.0 - used as f64 / 65_536.0)).abs() < 1e-12);
    assert_eq!(fit.pairs[0], used as u64);
    assert!(residual.values.iter().all(|r| r.is_nan() || r.abs() <= trim.threshold_m));
    let k = residual.values.iter().position(|r| !r.is_nan()).unwrap();
    assert_eq!(dem.values[k] - background.values[k], residual.values[k]);
    assert!(fit.warnings.is_empty(), "{:?}", fit.warnings);
    assert!(fit.verdict.starts_with("The exponential model describes the surface below 1.980 m"), "{}", fit.verdict);
    let carried = fit.carried.unwrap();
    assert!((carried.rms_share - 1.0).abs() < 0.03 && carried.increments.len() == 4, "{carried:?}");
    let found = fit.diagnostics;
    let numbers =
        [found.sigma2_over_range_m, found.naive_range_m, found.misfit_m2, found.lag_max_m, found.trimmed_share];
    assert!(numbers.iter().all(Option::is_some) && found.iterations.is_some(), "{found:?}");
}

/// A range of half the DEM: one window cannot identify it, and the fit warns.
#[test]
fn val_a_range_beyond_the_window_is_not_identified() {
    let s = settings(Mode::Corrected, 2.0, 0.05);
    let fit = fit(&field(6.0, 256, CELL_M, 1), &s, &streams()).unwrap().fit;
    assert!(fit.warnings.iter().any(|w| w.starts_with("b is not identified")), "{:?}", fit.warnings);
    let paper = super::fit(&field(0.28, 256, CELL_M, 1), &settings(Mode::Paper, 2.0, 0.05), &streams()).unwrap().fit;
    assert!(paper.warnings[0].starts_with("paper mode"));
}

/// A DEM read in two strips gives the same residual and pair sums as one processed at once (to 1e-9 of the variance; counts
/// exactly), and no more than a strip is read at a time.
#[test]
fn prop_strips_do_not_change_the_result() {
    /// Heights that must be read in strips.
    struct Tall(Grid);
    impl Heights for Tall {
        fn geometry(&self) -> Geometry {
            self.0.geometry
        }
        fn read(&self, rows: Range<usize>, cols: Range<usize>, part: &mut Vec<f64>) -> Result<(), String> {
            assert!(rows.len() * cols.len() < 3 << 20, "{rows:?}");
            self.0.read(rows, cols, part)
        }
    }
    let dem = field(0.28, 2048, CELL_M, 2);
    let s = settings(Mode::Corrected, 2.0, 0.05);
    let (rows, cols) = (dem.rows(), dem.cols());
    let tall = Tall(dem.clone());
    let case = Case::new(&tall, &s).unwrap();
    let mut trusted = dem.clone();
    let keep = case.survey.trusted(0..rows, 0..cols);
    trusted.values.iter_mut().zip(keep).filter(|(_, keep)| !keep).for_each(|(z, _)| *z = f64::NAN);
    let residual = masked_residual(&trusted, &s, case.survey.trim.threshold_m);
    let once = crate::covariance::masked_covariance(&residual, cols, case.max_lag);
    for (row, col) in once.lags() {
        let ((pairs, sum), (pairs_once, sum_once)) =
            (case.survey.covariance.at(row, col).unwrap(), once.at(row, col).unwrap());
        assert_eq!(pairs, pairs_once, "{row} {col}");
        assert!((sum - sum_once).abs() < 1e-9 * once.at(0, 0).unwrap().1, "{row} {col}");
    }
    assert_eq!(case.survey.kept, residual.iter().filter(|r| !r.is_nan()).count());
    let share = case.survey.kept as f64 / case.survey.detrended as f64;
    assert!((share - 0.95).abs() < 1e-5, "{share}");
}

/// The residual of a DEM without objects, with the background computed on all of it at once.
fn masked_residual(dem: &Grid, settings: &FitSettings, threshold_m: f64) -> Vec<f64> {
    let window = settings.window(&dem.geometry, false).unwrap();
    let found = sastrugi_roughness::background::background(&dem.values, dem.cols(), window, settings.at_partial());
    let one = |k: usize| {
        let residual = dem.values[k] - found.height_m[k];
        let used = residual.abs() <= threshold_m && 2 * found.count[k] as usize > window.area();
        if used { residual } else { f64::NAN }
    };
    (0..dem.values.len()).map(one).collect()
}

/// Independent transects of an exponential surface: 200 of 400 cells. Null: no bias; the scatter of the mean range over that much
/// data is about 1 %, thresholds 5 % and 10 %.
#[test]
fn stat_transects_are_fitted_in_one_dimension() {
    let covariance = covariance("exponential", &[("sigma_m", 0.1), ("range_m", 0.28)]);
    let shape = simulate::Shape { rows: 200, cols: 400, profiles: true };
    let simulator = simulate::Simulator::new(&covariance, Default::default(), shape, [CELL_M; 2], 16.0);
    let values = simulator.surface(&Streams::for_seed(1, "fit-test-profiles"));
    let mut transects: Vec<Vec<f64>> = values.chunks_exact(400).map(<[f64]>::to_vec).collect();
    transects[3].truncate(250);
    transects[5][100..120].fill(f64::NAN);
    let profiles = Profiles::new(CELL_M, &transects).unwrap();
    let fit = fit(&profiles, &with_bootstrap("exponential", 39), &streams()).unwrap().fit;
    let (sigma_m, range_m) = (fit.parameters["sigma_m"], fit.parameters["range_m"]);
    assert!((sigma_m / 0.1 - 1.0).abs() < 0.05 && (range_m / 0.28 - 1.0).abs() < 0.1, "{sigma_m} {range_m}");
    assert!(fit.directions.is_empty() && fit.intervals.is_some() && fit.block_intervals.is_some());
    let refused = super::fit(&profiles, &with_bootstrap("anisotropic:exponential", 0), &streams()).err().unwrap();
    assert!(refused.to_string().contains("a transect has only one direction"), "{refused}");
}

/// Results are identical to the bit for any number of threads. Nothing that one number of threads computed is kept for the other.
#[test]
fn prop_threads_change_no_bit() {
    let mut dem = field(0.28, 256, CELL_M, 1);
    blocky(&mut dem, 1);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found_by(&alone(&Case::new(&dem, &settings(Mode::Corrected, 2.0, 0.05)).unwrap())))
    };
    assert_eq!(run(1).map(f64::to_bits), run(3).map(f64::to_bits));
}

/// The same for a whole fit: several forms, other windows, the profile and isotropy.
#[test]
fn prop_threads_change_no_bit_of_a_fit() {
    let mut dem = field(0.28, 256, CELL_M, 1);
    blocky(&mut dem, 1);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let s = with_bootstrap("exponential,anisotropic:matern", 0);
        pool.install(|| serde_json::to_string(&fit(&dem, &s, &streams()).unwrap().fit).unwrap())
    };
    assert_eq!(run(1), run(3));
}

/// Settings of a fit with intervals and verdicts.
fn with_bootstrap(model: &str, bootstrap: u32) -> FitSettings {
    FitParameters { model: model.to_owned(), bootstrap, ..FitParameters::default() }.try_into().unwrap()
}

/// Fields of any covariance, as [`field`].
struct Fields {
    cells: usize,
    simulator: simulate::Simulator,
}

impl Fields {
    fn of(covariance: &Covariance, cells: usize) -> Self {
        let shape = simulate::Shape { rows: cells, cols: cells, profiles: false };
        Self { cells, simulator: simulate::Simulator::new(covariance, Default::default(), shape, [CELL_M; 2], 40.0) }
    }

    fn draw(&self, seed: u64) -> Grid {
        let values = self.simulator.surface(&Streams::for_seed(seed, "fit-test-any"));
        Grid::new(Geometry::square(self.cells, self.cells, CELL_M), values)
    }
}

fn field_of(covariance: &Covariance, cells: usize, seed: u64) -> Grid {
    Fields::of(covariance, cells).draw(seed)
}

fn covariance(model: &str, parameters: &[(&str, f64)]) -> Covariance {
    let values = parameters.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
    Form::parse(model).unwrap().covariance(&values).unwrap()
}

/// True if a value lies between two ends, either of which may be open.
fn holds(ends: [Option<f64>; 2], value: f64) -> bool {
    ends[0].is_none_or(|low| low <= value) && ends[1].is_none_or(|high| value <= high)
}

/// Default fits of 200 exponential fields with 99 replicates. A quarter of the fields each is level or on slopes of 20, 50 and 100 %; every
/// other one has 15 % holes. `SASTRUGI_FIELDS` sets another number of fields.
///
/// * Nominal 95 % intervals cover the truth in 95 +- 7 % (binomial standard deviation 1.5 points; 99 replicates add 1: false alarm
///   below 1e-3).
/// * At most 5 % of the fits warn. A true share of 2 % passes with probability 0.997, one of 5 % with 0.58.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_intervals_cover_and_exponentials_do_not_warn() {
    let s = with_bootstrap("exponential", 99);
    let fields: u64 = std::env::var("SASTRUGI_FIELDS").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    let fits: Vec<FitFile> = (0..fields)
        .into_par_iter()
        .map(|seed| fit(&slopes::of_table(seed), &s, &Streams::for_seed(seed, "fit")).unwrap().fit)
        .collect();
    let [sigma_m, range_m] = slopes::TRUTH;
    let truths = [("sigma_m", sigma_m), ("range_m", range_m), ("sigma2_over_range_m", sigma_m * sigma_m / range_m)];
    for (name, truth) in truths {
        let holding = fits.iter().filter(|fit| holds(fit.intervals.as_ref().unwrap().values[name], truth));
        let share = holding.count() as f64 / fields as f64;
        println!("coverage of {name}: {:.1} %", 100.0 * share);
        assert!((share - 0.95).abs() <= 0.07, "{name}: {share}");
    }
    let share = warning_share("exponential, 99 replicates", fits.into_iter().map(|fit| fit.warnings).collect());
    assert!(share <= 0.05, "{share}");
}

/// Share of fields whose fit as an exponential, without replicates, warns.
fn warned(name: &str, truth: &Covariance, count: u64) -> f64 {
    let s = with_bootstrap("exponential", 0);
    // A spectrum from the density, of a range beyond the torus, takes longer than the field.
    let fields = Fields::of(truth, 256);
    let all: Vec<Vec<String>> = (0..count)
        .into_par_iter()
        .map(|seed| match fit(&fields.draw(seed), &s, &Streams::for_seed(seed, "fit")) {
            Ok(outcome) => outcome.fit.warnings,
            Err(refused) => vec![refused.to_string()],
        })
        .collect();
    warning_share(name, all)
}

/// Share of fits with warnings; prints the first words of these.
fn warning_share(name: &str, warnings: Vec<Vec<String>>) -> f64 {
    let count = warnings.len();
    let share = warnings.iter().filter(|w| !w.is_empty()).count() as f64 / count as f64;
    let mut kinds: Vec<String> = warnings.into_iter().flatten().map(|w| w.chars().take(22).collect()).collect();
    kinds.sort();
    let tally: Vec<String> = kinds.chunk_by(|a, b| a == b).map(|c| format!("{} {}", c.len(), c[0])).collect();
    println!("{name}: {:.1} % of {count} fields warned: {}", 100.0 * share, tally.join("; "));
    share
}

/// Fits of an exponential warn in at least 95 % of 100 self-affine fields (20 for each H) and of 100 von Karman ones
/// (50 for each smoothness). Any warning counts, and their kinds are printed: a self-affine surface of H = 0.5 is the limit of
/// exponentials of infinite range, so its warning is that b is not identified rather than a misfit. Without replicates all tests except
/// that of normality run, with theoretical nulls. What exponentials do: [`stat_intervals_cover_and_exponentials_do_not_warn`].
#[test]
#[ignore = "slow: ./test --full"]
fn stat_misspecification_is_detected() {
    let self_affine = |hurst| covariance("self_affine", &[("increment_1m_m", 0.1), ("hurst", hurst)]);
    let karman = |range_m, smoothness| {
        covariance("matern", &[("sigma_m", 0.1), ("range_m", range_m), ("smoothness", smoothness)])
    };
    let truths = [
        ("self-affine H 0.5", self_affine(0.5)),
        ("self-affine H 0.6", self_affine(0.6)),
        ("self-affine H 0.7", self_affine(0.7)),
        ("self-affine H 0.8", self_affine(0.8)),
        ("self-affine H 0.9", self_affine(0.9)),
        ("von Karman 0.3", karman(0.4, 0.3)),
        ("von Karman 0.8", karman(0.28, 0.8)),
    ];
    for (name, truth) in &truths {
        let count = if name.starts_with("self") { 20 } else { 50 };
        assert!(warned(name, truth, count) >= 0.95, "{name}");
    }
}

/// The parameters of the model that generated a field are recovered: one field each, tolerances about three times the scatter of
/// one field.
#[test]
fn val_models_are_recovered() {
    let cases = [
        ("gaussian", vec![("sigma_m", 0.1), ("range_m", 0.28)], 0.05),
        ("spherical", vec![("sigma_m", 0.1), ("range_m", 0.6)], 0.06),
        ("matern", vec![("sigma_m", 0.1), ("range_m", 0.15), ("smoothness", 1.2)], 0.12),
        ("self_affine", vec![("increment_1m_m", 0.1), ("hurst", 0.7)], 0.05),
        ("exponential+nugget", vec![("sigma_m", 0.1), ("range_m", 0.28), ("nugget_m2", 0.002)], 0.1),
        (
            "anisotropic:exponential",
            vec![("sigma_m", 0.1), ("range_m", 0.4), ("ratio", 0.5), ("azimuth_deg", 30.0)],
            0.12,
        ),
    ];
    for (model, parameters, tolerance) in cases {
        let dem = field_of(&covariance(model, &parameters), 400, 3);
        let s = with_bootstrap(model, 0);
        let case = Case::new(&dem, &s).unwrap();
        let naive = ordinary(&case, &Form::parse("exponential").unwrap());
        let bins = case.bins_of(if model.starts_with("aniso") { Layout::DIRECTIONAL } else { Layout::ISOTROPIC });
        let found = Estimator::new(&case, &bins).candidates(&naive).remove(0);
        let values = found.covariance.parameters(&found.form);
        println!("{model}: {values:?}");
        for (name, truth) in parameters {
            assert!(
                (values[name] / truth - 1.0).abs() < tolerance,
                "{model}: {name} = {}, truth {truth}",
                values[name]
            );
        }
    }
}

/// A Gaussian does not fit an exponential surface, and its bins would hardly scatter: no weights lead to a fit. Its sum of squares is still that of
/// the bins under its own weights, as for any other model, so that the exponential is chosen. The weights of the exponential lead the Matern model
/// to the same fit.
#[test]
fn val_a_smooth_model_that_misses_the_data_is_not_chosen() {
    let truth = covariance("exponential", &[("sigma_m", 0.1), ("range_m", 0.28)]);
    let s = with_bootstrap("exponential,gaussian,matern", 0);
    for seed in [2, 3] {
        let dem = field_of(&truth, 200, seed);
        let case = Case::new(&dem, &s).unwrap();
        let estimator = Estimator::rough(&case, &case.bins);
        let found = estimator.candidates(&ordinary(&case, &Form::parse("exponential").unwrap()));
        for estimate in &found {
            let likelihood = estimate.likelihood.as_ref().unwrap();
            let misfit = estimator::difference(&estimator.mean(&estimate.covariance), &case.bins.covariance_m2);
            let chi2: f64 = likelihood.weights.whiten(&misfit).iter().map(|r| r * r).sum();
            assert!(
                (likelihood.chi2 / chi2 - 1.0).abs() < 1e-6,
                "{}: {} {chi2}",
                estimate.form.name(),
                likelihood.chi2
            );
        }
        let [exponential, gaussian, matern] = [0, 1, 2].map(|k| found[k].aicc().unwrap());
        assert!(gaussian > exponential + 100.0, "{seed}: {exponential} {gaussian}");
        assert!((matern - exponential).abs() < 10.0, "{seed}: {exponential} {matern}");
    }
}

/// The complete file with intervals, on a field of the fitted model.
#[test]
fn val_a_full_fit_has_intervals_and_verdicts() {
    let dem = field(0.15, 256, CELL_M, 4);
    let fit = fit(&dem, &with_bootstrap("auto", 99), &streams()).unwrap().fit;
    assert_eq!(fit.candidates.len(), 9);
    assert_eq!(fit.candidates[0].aicc_above_best, Some(0.0));
    let exponential = fit.candidates.iter().find(|c| c.model == "exponential").unwrap();
    assert!(exponential.aicc_above_best.unwrap() < 6.0, "{:?}", fit.candidates);
    let intervals = fit.intervals.unwrap();
    assert!(intervals.values.len() >= 2, "{:?}", intervals.values);
    for (name, [low, high]) in &intervals.values {
        assert!(low.unwrap() < high.unwrap(), "{name}: {low:?} {high:?}");
    }
    assert!(fit.block_intervals.is_some() && fit.profile.is_some() && !fit.directions.is_empty());
    let found = &fit.diagnostics;
    let tests = [found.misfit_p, found.normality_p, found.isotropy_p, found.stationarity_p];
    assert!(tests.iter().all(Option::is_some) && !found.other_windows.is_empty(), "{found:?}");
}

/// The map has lag zero in its middle, the variance of the rings there, and east to the east.
#[test]
fn val_covariance_map() {
    let truth = covariance(
        "anisotropic:exponential",
        &[("sigma_m", 0.1), ("range_m", 0.4), ("ratio", 0.4), ("azimuth_deg", 60.0)],
    );
    let outcome = fit(&field_of(&truth, 400, 2), &with_bootstrap("exponential", 0), &streams()).unwrap();
    let map = outcome.covariance_map();
    let g = map.geometry;
    let middle = [g.rows / 2, g.cols / 2];
    assert!(g.rows % 2 == 1 && g.x(middle[1]).abs() < 1e-12 && g.y(middle[0]).abs() < 1e-12);
    assert_eq!(map.at(middle[0], middle[1]), outcome.fit.covariance_m2[0]);
    let at = |east: isize, north: isize| map.at(middle[0].strict_add_signed(-north), middle[1].strict_add_signed(east));
    assert_eq!(at(3, 5), at(-3, -5));
    // Along azimuth 60 degrees (east-north-east) and across.
    assert!(at(5, 3) > 1.5 * at(-3, 5), "{} {}", at(5, 3), at(-3, 5));
    assert!(at(5, 3) > 1.2 * at(5, -3), "{} {}", at(5, 3), at(5, -3));
}

/// Stated noise is subtracted, and limits the resolution of the DEM: the texture's increments over the effective resolution
/// h equal those of the noise, `sigma^2 (1 - exp(-h / b)) = n^2`.
#[test]
fn val_effective_resolution() {
    let mut s = Streams::for_seed(1, "noise").stream("cells");
    let noise_m = 0.06;
    let dem = field_of(&covariance("exponential", &[("sigma_m", 0.1), ("range_m", 0.28)]), 400, 5);
    let mut noisy = dem.clone();
    noisy.values.iter_mut().for_each(|z| *z += noise_m * s.normal());
    let white = Noise { white_sigma_m: noise_m, ..Noise::default() };
    let settings = with_bootstrap("exponential", 0).with_noise(&white).unwrap();
    assert_eq!(settings.parameters().noise_sigma_m, noise_m);
    assert_eq!(settings.with_noise(&white).err().unwrap().key, "noise_sigma_m");
    let paper = FitParameters { mode: Mode::Paper, bootstrap: 0, ..FitParameters::default() };
    assert_eq!(FitSettings::try_from(paper).unwrap().with_noise(&white).err().unwrap().key, "mode");
    let found = fit(&noisy, &settings, &streams()).unwrap().fit;
    let (sigma, b) = (found.parameters["sigma_m"], found.parameters["range_m"]);
    assert!((sigma / 0.1 - 1.0).abs() < 0.04 && (b / 0.28 - 1.0).abs() < 0.09, "{sigma} {b}");
    let expected = -b * libm::log(1.0 - noise_m * noise_m / (sigma * sigma));
    assert!((found.diagnostics.effective_resolution_m.unwrap() / expected - 1.0).abs() < 1e-6);
    let sharp = fit(&dem, &with_bootstrap("exponential", 0), &streams()).unwrap().fit;
    assert_eq!(sharp.diagnostics.effective_resolution_m, Some(CELL_M));
}

/// A surface without a characteristic scale: the verdict leads with numbers that hold at a stated scale.
#[test]
fn val_no_scale_leads_with_scale_explicit_numbers() {
    let truth = covariance("self_affine", &[("increment_1m_m", 0.1), ("hurst", 0.8)]);
    let found = fit(&field_of(&truth, 400, 3), &with_bootstrap("exponential", 0), &streams()).unwrap().fit;
    assert!(found.verdict.starts_with("No single scale below 1.980 m: publish band RMS"), "{}", found.verdict);
    // Words for a study and for the verb, and what b is called in a fit file.
    let advice = ", with the outer scale, not sigma and b (range_m), which change with it.";
    assert!(found.verdict.contains(advice), "{}", found.verdict);
    assert!(found.warnings.iter().any(|w| w.starts_with("no scale separation")), "{:?}", found.warnings);
    let found = found.diagnostics;
    let [hurst, increment_m] = [found.hurst, found.increment_1m_m].map(Option::unwrap);
    assert!((hurst - 0.8).abs() < 0.04 && (increment_m / 0.1 - 1.0).abs() < 0.1, "{found:?}");
    // The band RMS below twice the window is 2^H times as large.
    let ratio = found.other_windows[1].band_rms_m.unwrap() / found.band_rms_m.unwrap();
    assert!((ratio / libm::exp2(0.8) - 1.0).abs() < 0.1);
}

/// A raster whose middle is refitted at other windows, with a rim that is half as rough: windows are compared on the same cells,
/// and an exponential has one scale.
#[test]
fn val_windows_are_compared_on_the_same_cells() {
    let n = 1152;
    let mut dem = field(0.15, n, CELL_M, 6);
    // The middle of a million cells.
    let rim = |k: usize| k < 64 || k >= n - 64;
    (0..n * n).filter(|k| rim(k / n) || rim(k % n)).for_each(|k| dem.values[k] *= 0.5);
    let found = fit(&dem, &with_bootstrap("exponential", 0), &streams()).unwrap().fit;
    assert!(found.diagnostics.window_disagreement_z.unwrap() < 2.58, "{:?}", found.warnings);
}

/// A surface of another model still has a scale: the verdict blames the model.
#[test]
fn val_a_wrong_model_is_not_a_surface_without_scale() {
    let dem = field_of(&covariance("gaussian", &[("sigma_m", 0.1), ("range_m", 0.28)]), 256, 8);
    let wrong = fit(&dem, &with_bootstrap("exponential", 0), &streams()).unwrap().fit;
    assert!(wrong.verdict.starts_with("The exponential model does not fit"), "{}", wrong.verdict);
    assert!(wrong.verdict.contains("--model matern"), "{}", wrong.verdict);
    assert!(wrong.warnings.iter().any(|w| w.starts_with("wrong model: ")), "{:?}", wrong.warnings);
    assert!(wrong.diagnostics.hurst.is_none());
    let smooth = covariance("matern", &[("sigma_m", 0.1), ("range_m", 0.2), ("smoothness", 1.5)]);
    let wrong = fit(&field_of(&smooth, 256, 9), &with_bootstrap("exponential", 0), &streams()).unwrap().fit;
    assert!(wrong.verdict.starts_with("The exponential model does not fit"), "{}", wrong.verdict);
    let right = fit(&dem, &with_bootstrap("gaussian", 0), &streams()).unwrap().fit;
    assert!(right.verdict.starts_with("The gaussian model describes"), "{}", right.verdict);
    // A Gaussian covariance has no slope at lag zero.
    assert!(right.diagnostics.sigma2_over_range_m.is_none());
}

/// A nanometre of noise does not change the fit of a smooth surface with holes, whose bins hardly scatter among themselves.
#[test]
fn prop_a_nanometre_does_not_move_a_fit() {
    let mut dem = field_of(&covariance("gaussian", &[("sigma_m", 0.1), ("range_m", 0.8)]), 256, 4);
    scattered(&mut dem, 4);
    let found = |dem: &Grid| fit(dem, &with_bootstrap("exponential", 0), &streams()).unwrap().fit.parameters;
    let before = found(&dem);
    assert_eq!(before.len(), 2, "{before:?}");
    let mut s = Streams::for_seed(2, "nanometre").stream("cells");
    dem.values.iter_mut().for_each(|z| *z += 1e-9 * s.normal());
    for (name, value) in found(&dem) {
        assert!((value / before[&name] - 1.0).abs() < 1e-4, "{name}: {value} {}", before[&name]);
    }
}

/// The approximation by Wilson and Hilferty against the exact distribution of `sastrugi_statistics`: below 0.003 from 5 degrees of freedom
/// on, and the upper tail is not the lower one.
#[test]
fn val_chi_squared_tails_are_near_the_exact_ones() {
    for freedom in [5usize, 8, 15, 30, 60] {
        for share in [0.2, 0.5, 0.8, 1.0, 1.3, 2.0, 3.0] {
            let chi2 = share * freedom as f64;
            let exact = sastrugi_statistics::chi_square::above(chi2, freedom);
            let found = verdicts::chi_squared_upper(chi2, freedom as f64);
            assert!((found - exact).abs() < 0.003, "{freedom}, {chi2}: {found} {exact}");
        }
    }
}
