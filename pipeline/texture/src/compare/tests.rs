use super::*;
use crate::covariance::Covariance;
use crate::covariance::filtered::Measurement;
use crate::fit::simulate::{Shape, Simulator};
use crate::noise::Noise;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::fit::{FitFile, Intervals};

const CELL_M: f64 = 0.06;

fn exponential(sigma_m: f64, range_m: f64) -> Covariance {
    Covariance::new(crate::covariance::model("exponential").unwrap(), sigma_m, range_m).unwrap()
}

/// A normal surface cut from a torus twice as wide.
fn surface(covariance: &Covariance, cells: usize, name: &str) -> Grid {
    let quiet = Measurement { inner_scale_m: 0.0, noise: Noise::default() };
    let simulator =
        Simulator::new(covariance, quiet, Shape { rows: cells, cols: cells, profiles: false }, [CELL_M; 2], 16.0);
    let values = simulator.surface(&Streams::for_seed(1, "compare-test").child(name));
    Grid::new(Geometry::square(cells, cells, CELL_M), values)
}

/// A window of 17 cells.
const WINDOW_M: f64 = 1.0;

fn settings(simulations: u32) -> CompareSettings {
    CompareParameters { simulations, outer_scale_m: WINDOW_M, ..CompareParameters::default() }.try_into().unwrap()
}

fn compared(a: &Grid, b: &Grid, simulations: u32, name: &str) -> Comparison {
    surfaces(a, b, &settings(simulations), &Streams::for_seed(2, "compare-test").child(name)).unwrap()
}

fn answer(comparison: &Comparison, name: &str) -> Answer {
    comparison.quantities.iter().find(|q| q.name == name).unwrap().answer
}

/// Two surfaces of one covariance, one with 1.3 times the heights: sigma is different.
#[test]
fn val_a_taller_surface_is_different() {
    let covariance = exponential(0.1, 0.12);
    let (a, b) = (surface(&covariance, 160, "a"), surface(&covariance, 160, "b"));
    let taller = b.map(|z| 1.3 * z);
    let comparison = compared(&a, &taller, 119, "taller");
    assert_eq!(answer(&comparison, "sigma_m"), Answer::Different, "{comparison:#?}");
    assert!(comparison.differs() && comparison.sentence.contains("sigma_m"));
}

/// A surface compared with itself has the same sigma, differs in nothing, and has no difference in any quantity.
#[test]
#[ignore = "slow: ./test --full"]
fn val_a_surface_equals_itself() {
    let a = surface(&exponential(0.1, 0.12), 200, "self");
    let comparison = compared(&a, &a, 119, "self");
    assert_eq!(answer(&comparison, "sigma_m"), Answer::Same, "{comparison:#?}");
    assert!(!comparison.differs());
    assert!(comparison.quantities.iter().all(|q| q.difference == Some(0.0)));
}

/// Different cells, shapes and masks on the two sides do not make the surfaces different.
#[test]
#[ignore = "slow: ./test --full"]
fn val_grids_may_differ() {
    let covariance = exponential(0.1, 0.12);
    let quiet = Measurement { inner_scale_m: 0.0, noise: Noise::default() };
    let simulator =
        Simulator::new(&covariance, quiet, Shape { rows: 120, cols: 90, profiles: false }, [0.1, 0.08], 16.0);
    let values = simulator.surface(&Streams::for_seed(1, "compare-test").child("oblong"));
    let geometry = Geometry { rows: 120, cols: 90, cell: [0.1, 0.08], origin: [5.0, 7.0] };
    let mut b = Grid::new(geometry, values);
    b.values[2000..2600].fill(f64::NAN);
    let comparison = compared(&surface(&covariance, 160, "square"), &b, 119, "grids");
    assert!(!comparison.differs(), "{comparison:#?}");
}

/// For each answer, the number of `count` comparisons for which it holds. Side by side: parts of a comparison take one thread.
fn counts<const N: usize>(count: usize, holds: impl Fn(usize) -> [bool; N] + Send + Sync) -> [usize; N] {
    let all: Vec<[bool; N]> = (0..count).into_par_iter().map(holds).collect();
    std::array::from_fn(|answer| all.iter().filter(|one| one[answer]).count())
}

/// Null: both sides have the same exponential covariance. 60 pairs of 128 x 128 cells, 119 simulations each; a pair has any wrong
/// `different` with probability at most 0.05, so that more than 11 of 60 has a false-alarm probability of 3e-5 (binomial). A null that
/// treated cells as independent would call nearly all pairs different. Power: 1.3 times the sigma is detected in at least 40 of 60,
/// and the interval of sigma covers 1.3 in all but 12 of 60 (90 % nominal; false alarm 4e-3 if it were exact, and
/// blocks only widen it). Measured with 99 simulations: 2 of 60, 60 of 60, 54 of 60.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_false_alarms_and_power() {
    let covariance = exponential(0.1, 0.12);
    let of_pair = |k: usize| {
        let (a, b) = (surface(&covariance, 128, &format!("a{k}")), surface(&covariance, 128, &format!("b{k}")));
        let wrong = compared(&a, &b, 119, &format!("null{k}")).differs();
        let taller = compared(&a, &b.map(|z| 1.3 * z), 119, &format!("power{k}"));
        let found = answer(&taller, "sigma_m") == Answer::Different;
        let [low, high] = taller.quantities[0].interval.unwrap();
        [wrong, found, low <= libm::log(1.3) && libm::log(1.3) <= high]
    };
    let [wrong, found, covered] = counts(60, of_pair);
    println!("wrong {wrong} of 60, found {found} of 60, covered {covered} of 60");
    assert!(wrong <= 11 && found >= 40 && covered >= 48, "{wrong} {found} {covered}");
}

fn fit_file(model: &str, values: &[(&str, f64, [f64; 2])]) -> FitFile {
    let intervals = values.iter().map(|(name, _, interval)| ((*name).to_owned(), interval.map(Some))).collect();
    FitFile {
        model: model.to_owned(),
        parameters: values.iter().map(|(name, value, _)| ((*name).to_owned(), *value)).collect(),
        intervals: Some(Intervals { level: 0.95, replicates: 99, from_profile: false, values: intervals }),
        ..FitFile::default()
    }
}

fn compared_fits(a: &FitFile, b: &FitFile) -> Comparison {
    fits(a, b, &settings(119), &Streams::for_seed(3, "compare-test")).unwrap()
}

/// By hand: 95 % intervals with factors of 1.0198 (2 % each way) mean standard errors of 0.01. The difference of two has
/// 0.01414, so that a ratio of 1.04 (0.0392) is 2.77 standard errors (p = 0.0056), and its 90 % interval is exp(0.0392 +- 0.02326).
#[test]
fn val_fits_by_hand() {
    let e = libm::exp(1.959_964 * 0.01);
    let sigma = |v: f64| ("sigma_m", v, [v / e, v * e]);
    let range = ("range_m", 0.3, [0.15, 0.6]);
    let a = fit_file("exponential", &[sigma(0.1), range]);
    let comparison = compared_fits(&a, &fit_file("exponential", &[sigma(0.104), range]));
    let q = &comparison.quantities[0];
    let [low, high] = q.interval.unwrap().map(libm::exp);
    assert!((low - 1.0161).abs() < 5e-4 && (high - 1.0645).abs() < 5e-4, "{q:?}");
    assert!((q.p.unwrap() - 0.0056).abs() < 2e-3, "{q:?}");
    assert_eq!(q.answer, Answer::Same, "{q:?}");
    assert!(q.why.contains("though not equal"));
    assert_eq!(comparison.quantities[1].answer, Answer::CannotTell);
    assert_eq!(compared_fits(&a, &fit_file("exponential", &[sigma(0.13), range])).answer, Answer::Different);
}

/// Quantities that two files lack are `cannot tell`, with the reason.
#[test]
fn val_fits_say_what_they_lack() {
    let a = fit_file("exponential", &[("sigma_m", 0.1, [0.09, 0.11]), ("range_m", 0.3, [0.2, 0.4])]);
    let bare = FitFile { intervals: None, ..a.clone() };
    let why = |c: &Comparison, k: usize| c.quantities[k].why.clone();
    let comparison = compared_fits(&a, &bare);
    assert_eq!(comparison.answer, Answer::CannotTell);
    assert!(why(&comparison, 0).contains("B has no interval of sigma_m"), "{comparison:?}");
    assert!(why(&comparison, 2).contains("anisotropic:exponential"));
    assert!(why(&comparison, 3).contains("no heights"));
    let mut open = a.clone();
    open.intervals.as_mut().unwrap().values.insert("range_m".to_owned(), [Some(0.2), None]);
    assert!(why(&compared_fits(&a, &open), 1).contains("is open"));
    let gaussian = FitFile { model: "gaussian".to_owned(), ..a.clone() };
    assert!(why(&compared_fits(&a, &gaussian), 0).contains("one model"));
}

#[test]
fn val_settings_are_checked() {
    let refused = |p: CompareParameters| CompareSettings::try_from(p).err().unwrap().to_string();
    let base = CompareParameters::default;
    assert!(refused(CompareParameters { model: "auto".to_owned(), ..base() }).contains("one model"));
    assert!(refused(CompareParameters { model: "exponential+gaussian".to_owned(), ..base() }).contains("one term"));
    assert!(refused(CompareParameters { equivalence_sigma: 0.0, ..base() }).contains("equivalence_sigma"));
    // Only comparisons that simulate need simulations.
    let site = oblong(&exponential(0.1, 0.2), "settings");
    let error = surfaces(&site, &site, &settings(10), &Streams::for_seed(4, "compare-test")).unwrap_err().to_string();
    assert!(error.contains("[119,"), "{error}");
    assert!(blocks(&site, &site, &settings(10), &Streams::for_seed(4, "compare-test")).is_ok());
}

fn oblong(covariance: &Covariance, name: &str) -> Grid {
    let quiet = Measurement { inner_scale_m: 0.0, noise: Noise::default() };
    let values = Simulator::new(covariance, quiet, Shape { rows: 100, cols: 200, profiles: false }, [CELL_M; 2], 16.0)
        .surface(&Streams::for_seed(1, "compare-test").child(name));
    Grid::new(Geometry::square(100, 200, CELL_M), values)
}

fn compared_halves(site: &Grid, name: &str) -> Comparison {
    halves(site, &settings(119), &Streams::for_seed(2, "compare-test").child(name)).unwrap()
}

/// A site that is not a normal surface: adding a squared term to the heights keeps a covariance of the same kind but breaks the symmetry.
/// The statistics that were not fitted detect it; sigma and b are not among them.
#[test]
fn val_a_texture_differs_from_a_site_that_is_not_normal() {
    let site = oblong(&exponential(0.1, 0.2), "squared").map(|z| z + 4.0 * z * z);
    let comparison = compared_halves(&site, "squared");
    assert!(comparison.differs(), "{comparison:#?}");
    assert!(comparison.quantities.iter().all(|q| q.name != "sigma_m" && q.name != "range_m"));
}

/// Null: sites are normal surfaces of the fitted kind. 40 sites, 119 simulations; any wrong `different` has a probability of at most
/// 0.05 per site: more than 9 of 40 has a false-alarm probability of 5e-5 (binomial).
#[test]
#[ignore = "slow: ./test --full"]
fn stat_split_halves_of_a_normal_site_agree() {
    let covariance = exponential(0.1, 0.12);
    let of_site = |name: &str| compared_halves(&oblong(&covariance, name), name).differs();
    let [wrong] = counts(40, |k| [of_site(&format!("h{k}"))]);
    println!("wrong {wrong} of 40");
    assert!(wrong <= 9, "{wrong}");
}

/// The interleaved split stands beside the halves and has the same quantities; every distance has that of the halves beside it.
#[test]
fn val_halves_stand_beside_interleaved_blocks() {
    let quiet = Measurement { inner_scale_m: 0.0, noise: Noise::default() };
    let shape = Shape { rows: 140, cols: 160, profiles: false };
    let simulator = Simulator::new(&exponential(0.1, 0.12), quiet, shape, [CELL_M; 2], 16.0);
    let values = simulator.surface(&Streams::for_seed(1, "compare-test").child("interleaved"));
    let comparison = compared_halves(&Grid::new(Geometry::square(140, 160, CELL_M), values), "interleaved");
    let names = |all: &[Quantity]| all.iter().map(|q| q.name.clone()).collect::<Vec<_>>();
    let interleaved = comparison.interleaved.as_ref().unwrap();
    assert_eq!(names(interleaved), names(&comparison.quantities));
    for q in &comparison.quantities {
        let site = q.site.unwrap();
        assert!(site.halves.unwrap() > 0.0 && site.interleaved.unwrap() > 0.0, "{q:#?}");
    }
    // 100 rows are one block of four windows: there is no chessboard.
    let narrow = compared_halves(&oblong(&exponential(0.1, 0.12), "narrow"), "narrow");
    assert!(narrow.interleaved.is_none() && narrow.quantities[0].site.unwrap().interleaved.is_none());
    assert!(narrow.notes.iter().any(|note| note.contains("four blocks")), "{:?}", narrow.notes);
}

fn judged(site: &Grid, texture: &Grid, name: &str) -> Comparison {
    blocks(site, texture, &settings(119), &Streams::for_seed(4, "compare-test").child(name)).unwrap()
}

/// A site against itself: no distance, no `different`, and everything is a copy. Its holes are holes of the texture.
#[test]
fn val_a_site_is_a_copy_of_itself() {
    let mut site = oblong(&exponential(0.1, 0.2), "itself");
    site.values[5000..5400].fill(f64::NAN);
    let comparison = judged(&site, &site, "itself");
    assert_eq!(comparison.quantities.len(), 11);
    assert!(comparison.quantities.iter().all(|q| q.difference == Some(0.0) && q.p == Some(1.0)), "{comparison:#?}");
    assert!(!comparison.differs());
    let evidence = comparison.blocks.unwrap();
    assert_eq!((evidence.shape_cells, evidence.site, evidence.texture), ([34, 34], 10, 10));
    assert_eq!((evidence.copies.of_site.share, evidence.copies.of_itself.share), (1.0, 0.0));
    let complete = oblong(&exponential(0.1, 0.2), "itself");
    let masked = judged(&site, &complete, "itself");
    assert!(masked.quantities.iter().all(|q| q.difference == Some(0.0)), "{masked:#?}");
}

/// A site that is not normal is told from a normal surface of the same covariance, by its heights; a texture that repeats one block of its site
/// is told by the spread of its blocks, and both places are found as copies.
#[test]
fn val_normal_and_repeated_textures_are_told() {
    let squared = |name: &str| oblong(&exponential(0.1, 0.2), name).map(|z| z + 4.0 * z * z);
    let site = squared("told");
    let normal = judged(&site, &oblong(&exponential(0.1, 0.2), "normal"), "normal");
    assert_eq!(answer(&normal, "height_distribution"), Answer::Different, "{normal:#?}");
    assert!(normal.blocks.unwrap().copies.of_site.share < 0.01);
    // Six by six times the first block.
    let values = (0..204 * 204).map(|k| site.at(k / 204 % 34, k % 204 % 34)).collect();
    let repeated = judged(&site, &Grid::new(Geometry::square(204, 204, CELL_M), values), "repeated");
    assert_eq!(answer(&repeated, "spread_of_blocks"), Answer::Different, "{repeated:#?}");
    let copies = repeated.blocks.unwrap().copies;
    assert!(copies.of_site.share > 0.5 && copies.of_itself.share > 0.5, "{copies:?}");
    assert!(copies.of_site.longest_run_cells >= 30 && copies.between_halves.share < 0.01, "{copies:?}");
}

/// A site with a boulder in each of its ten blocks, and a texture without boulders. Left out as objects, they are not judged; kept, they show in the
/// heights. A boulder of 7 % of a block and eight standard deviations high moves the standardised quantiles by more than twice what two normal
/// surfaces differ by, 0.05 to 0.1; the rarest arrangement of 10 + 10 blocks has p = 1/2000.
#[test]
fn val_objects_are_judged_where_they_are_kept() {
    let bare = oblong(&exponential(0.1, 0.2), "bare");
    let boulder = |k: usize| {
        let from = |at: usize| (at % 34) as f64 - 17.0;
        let (y, x) = (from(k / 200), from(k % 200));
        0.8 * (1.0 - (x * x + y * y) / 25.0).max(0.0).sqrt()
    };
    let values = bare.values.iter().enumerate().map(|(k, z)| z + boulder(k)).collect();
    let (site, texture) = (Grid::new(bare.geometry, values), oblong(&exponential(0.1, 0.2), "without"));
    let [left_out, kept] = [true, false].map(|find_objects| {
        let parameters = CompareParameters { find_objects, outer_scale_m: WINDOW_M, ..CompareParameters::default() };
        blocks(&site, &texture, &parameters.try_into().unwrap(), &Streams::for_seed(4, "compare-test")).unwrap()
    });
    let distance = |comparison: &Comparison| {
        let heights = comparison.quantities.iter().find(|q| q.name == "height_distribution").unwrap();
        heights.difference.unwrap()
    };
    assert_eq!(answer(&kept, "height_distribution"), Answer::Different, "{kept:#?}");
    assert!(distance(&kept) > 2.0 * distance(&left_out), "{} {}", distance(&kept), distance(&left_out));
}

/// Cells of another size, and rasters with too few blocks of two windows, are refused.
#[test]
fn val_textures_that_cannot_be_judged_are_refused() {
    let site = oblong(&exponential(0.1, 0.2), "refused");
    let coarse = Grid::new(Geometry::square(100, 200, 2.0 * CELL_M), site.values.clone());
    let refused = |texture: &Grid| {
        blocks(&site, texture, &settings(119), &Streams::for_seed(4, "compare-test")).unwrap_err().to_string()
    };
    assert!(refused(&coarse).contains("0.06 x 0.06 m, the texture of 0.12 x 0.12 m"), "{}", refused(&coarse));
    let small = site.window(0, 0, 100, 100);
    assert!(refused(&small).contains("the texture 4: at least 6"), "{}", refused(&small));
    let few = |site| CompareError::TooFewBlocks { shape: [34, 34], site, texture: 0, needed: 6 }.to_string();
    assert!(few(1).starts_with("the site has 1 block of 34 x 34 cells"), "{}", few(1));
    assert!(few(5).starts_with("the site has 5 blocks of 34 x 34 cells"), "{}", few(5));
}

/// Null: site and texture are normal surfaces of one covariance. 40 pairs; any wrong `different` has a probability of at most 0.05 for each: more
/// than 9 of 40 has a false-alarm probability of 5e-5 (binomial). Power: a texture with twice the correlation length is told in all but 4 of 40.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_textures_of_the_covariance_of_the_site_agree() {
    let [wrong, told] = counts(40, |k| {
        let name = format!("statistics-{k}");
        let of = |range_m: f64, side: &str| surface(&exponential(0.1, range_m), 200, &format!("{name}-{side}"));
        let (site, texture, longer) = (of(0.12, "site"), of(0.12, "texture"), of(0.24, "longer"));
        [judged(&site, &texture, &name).differs(), judged(&site, &longer, &name).differs()]
    });
    println!("wrong {wrong} of 40, told {told} of 40");
    assert!(wrong <= 9 && told >= 36, "{wrong} {told}");
}
