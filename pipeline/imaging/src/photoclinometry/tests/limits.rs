//! Refused input, ignored pixels, marked cells, and estimated calibrations.

use super::accuracy::{THREE, level, quick, recovered, streams};
use super::scene::{Scene, height_rms, noisy, slope_rms};
use crate::description::Noise;
use crate::photoclinometry::*;
use sastrugi_numeric::Grid;

fn refusal(images: &[Image], start: &Grid, known: &Known, settings: &Settings) -> String {
    recover(images, start, known, settings, &streams()).unwrap_err().to_string()
}

/// Section 8 of the specification: fewer than three images, coplanar lights, sizes that differ, numbers that are not finite.
#[test]
fn val_refusals_say_what_is_wrong() {
    let scene = Scene::hills(16, 1.0);
    let images = scene.nadir_images(&THREE, 45.0);
    let (start, known, settings) = (level(&scene), Known::default(), quick());
    let of = |images: &[Image]| refusal(images, &start, &known, &settings);
    assert!(of(&images[..2]).starts_with("2 images cannot determine"));
    assert!(of(&images[..1]).starts_with("1 image cannot determine"));
    // North, south and straight above: one plane.
    let suns = [[0.0, 45.0], [180.0, 45.0], [0.0, 90.0]];
    let coplanar: Vec<Image> = suns.iter().map(|s| scene.image(scene.nadir(), *s)).collect();
    assert!(of(&coplanar).starts_with("the suns lie in one plane"));
    let mut short = images.clone();
    short[1].brightness.pop();
    assert_eq!(of(&short), "image 2 has 255 pixels, its camera 256; they must be equal");
    let mut infinite = images.clone();
    infinite[2].brightness[7] = f64::INFINITY;
    assert_eq!(of(&infinite), "brightness of image 3 is not finite");
    let mut unlit = images.clone();
    unlit[0].exposure = f64::NAN;
    assert_eq!(of(&unlit), "light, exposure or haze of image 1 is not finite");
    let mut black = images.clone();
    black[0].brightness.fill(0.0);
    assert!(of(&black).starts_with("no cell is lit in three images; look for images that are dark"));
    let hole = Grid::new(scene.map, vec![f64::NAN; 256]);
    assert_eq!(refusal(&images, &hole, &known, &settings), "a height of the start is not finite");
    let small = level(&scene).window(0, 0, 3, 16);
    assert!(refusal(&images, &small, &known, &settings).contains("3 x 16 cells is too small"));
    let point = HeightPoint { x_m: 1.0, y_m: 1.0, height_m: f64::NAN, sigma_m: 1.0 };
    let points = Known { points: vec![point], coarse: None };
    assert!(refusal(&images, &start, &points, &settings).starts_with("a known height"));
    for (settings, key) in [
        (Settings { rounds: 21, ..quick() }, "`rounds`"),
        (Settings { paths: 451, ..quick() }, "`paths`"),
        (Settings { noise: Some(Noise { absolute: 0.0, relative: 0.0 }), ..quick() }, "`noise`"),
        (Settings { albedo: Some(-0.1), ..quick() }, "`albedo`"),
        (Settings { leaning_max: 1.1, ..quick() }, "`leaning_max`"),
        (Settings { stereo: Some(Stereo { quality: 1.5, ..Stereo::default() }), ..quick() }, "`stereo.quality`"),
    ] {
        assert!(refusal(&images, &start, &known, &settings).starts_with(key), "{key}");
    }
}

/// Pixels in shadow (set by hand here) leave two images: the cells are marked, have the albedo of their neighbours within its spread, larger
/// uncertainty, and slopes determined by two images; all other cells are unchanged, bit for bit.
#[test]
fn val_shadows_leave_a_marked_cell_with_a_stated_prior() {
    let scene = Scene::hills(48, 1.0);
    let truth = scene.truth();
    let mut images = scene.nadir_images(&THREE, 45.0);
    let plain = recovered(&images, &scene, &quick());
    let dark = |k: usize| (10..14).contains(&(k / 48)) && (20..26).contains(&(k % 48));
    (0..48 * 48).filter(|&k| dark(k)).for_each(|k| images[1].brightness[k] = 0.0);
    let found = recovered(&images, &scene, &quick());
    let cells: Vec<usize> = (0..48 * 48).filter(|&k| dark(k)).collect();
    let slopes = |of: &[[f64; 2]]| -> Vec<[f64; 2]> { cells.iter().map(|&k| of[k]).collect() };
    let error = slope_rms(&slopes(&found.slopes), &slopes(&truth.slopes));
    println!(
        "slopes of shadowed cells: {error:.4}; heights {:.4} m",
        height_rms(&found.heights.values, &truth.heights.values)
    );
    assert!(error < 0.08);
    for k in 0..48 * 48 {
        assert_eq!(found.lit.values[k], if dark(k) { 2 } else { 3 });
        assert_eq!(found.leaning.values[k], f64::from(u8::from(dark(k))));
        if dark(k) {
            assert!(found.covariances[k][0] > 2.0 * plain.covariances[k][0]);
            assert!((found.albedo.values[k] - truth.albedo[k]).abs() < 0.03);
        } else {
            assert!(found.slopes[k] == plain.slopes[k]);
        }
    }
    let marked = "1.0 % of the cells take their albedo from their neighbours";
    assert!(found.warnings.iter().any(|w| w == marked), "{:?}", found.warnings);
    assert!(height_rms(&found.heights.values, &truth.heights.values) < 0.1);
}

/// Missing pixels are no data, an image that does not see a cell is ignored there, and a cell that no image shows has no height.
#[test]
fn val_cells_that_no_image_shows_have_no_height() {
    let scene = Scene::hills(32, 1.0);
    let mut images = scene.nadir_images(&THREE, 45.0);
    images.iter_mut().for_each(|i| i.brightness[5 * 32 + 7] = f64::NAN);
    images[0].brightness[20 * 32 + 9] = f64::NAN;
    let found = recovered(&images, &scene, &quick());
    let bare: Vec<usize> = (0..1024).filter(|&k| found.heights.values[k].is_nan()).collect();
    assert_eq!(bare, [5 * 32 + 7]);
    assert!(
        found.albedo.values[bare[0]].is_nan()
            && found.lit.values[bare[0]] == 0
            && found.leaning.values[bare[0]].is_nan()
    );
    assert_eq!(found.lit.values[20 * 32 + 9], 2);
}

/// Six images with exposures wrong by up to 6 %, of ground that is level on average: the exposures are estimated within 0.5 %, and slopes are
/// better than with exposures held.
#[test]
fn val_exposures_are_found() {
    let scene = Scene { map: sastrugi_numeric::Geometry::square(64, 64, 1.0), ..Scene::hills(64, 1.0) };
    let truth = scene.truth();
    let plane = calibration::plane(&scene.map, &truth.heights.values);
    // The start has the true mean plane, which the images cannot separate from the exposures.
    let start = Grid::new(
        scene.map,
        (0..4096).map(|k| plane[0] * scene.map.x(k % 64) + plane[1] * scene.map.y(k / 64)).collect(),
    );
    let azimuths = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
    let mut images = noisy(&scene.nadir_images(&azimuths, 45.0), 0.005, 6);
    let factors = [1.06, 0.97, 1.02, 0.95, 1.01, 0.992];
    for (image, factor) in images.iter_mut().zip(factors) {
        image.brightness.iter_mut().for_each(|v| *v *= factor);
    }
    let run = |free_exposure| {
        let settings = Settings { free_exposure, rounds: 20, ..quick() };
        recover(&images, &start, &Known::default(), &settings, &streams()).unwrap()
    };
    let (held, free) = (run(false), run(true));
    let mean = libm::exp(factors.iter().map(|f| libm::log(*f)).sum::<f64>() / 6.0);
    let worst = free
        .calibrations
        .iter()
        .zip(factors)
        .map(|(c, f)| (c.exposure * mean / f - 1.0).abs())
        .max_by(f64::total_cmp)
        .unwrap();
    let [with, without] = [&free, &held].map(|r| slope_rms(&r.slopes, &truth.slopes));
    println!(
        "exposures within {:.2} % after {} rounds; slopes {without:.4} held, {with:.4} free",
        100.0 * worst,
        free.rounds.len()
    );
    assert!(worst < 5e-3 && with < 0.7 * without);
}

/// Haze of 2, 6 and 10 % of the brightness in three of six images is estimated with the help of a coarse DEM, which separates relief from haze.
#[test]
fn val_haze_is_found_where_heights_are_known_coarsely() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth();
    let azimuths = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
    let mut images = noisy(&scene.nadir_images(&azimuths, 45.0), 0.002, 6);
    let hazes = [0.0, 0.016, 0.0, 0.010, 0.0, 0.003];
    for (image, haze) in images.iter_mut().zip(hazes) {
        image.brightness.iter_mut().for_each(|v| *v += haze);
    }
    let coarse = Coarse { dem: sastrugi_numeric::resample::block_means(&truth.heights, 4), sigma_m: 0.02 };
    let known = Known { points: vec![], coarse: Some(coarse) };
    let run = |free_haze| {
        let settings = Settings { free_haze, rounds: 20, ..quick() };
        recover(&images, &level(&scene), &known, &settings, &streams()).unwrap()
    };
    let (held, free) = (run(false), run(true));
    let worst = free.calibrations.iter().zip(hazes).map(|(c, h)| (c.haze - h).abs()).max_by(f64::total_cmp).unwrap();
    let [with, without] = [&free, &held].map(|r| slope_rms(&r.slopes, &truth.slopes));
    println!("hazes within {worst:.4} after {} rounds; slopes {without:.4} held, {with:.4} free", free.rounds.len());
    assert!(worst < 0.005 && with < 0.7 * without);
}

/// Pixels of half and twice the size of a cell: fine pixels are averaged, with less noise, and the surface is recovered.
#[test]
fn val_cells_take_the_mean_of_their_pixels() {
    let fine = Scene::hills(64, 1.0);
    let images = fine.nadir_images(&THREE, 45.0);
    let coarse = Scene { map: sastrugi_numeric::Geometry::square(32, 32, 2.0), ..Scene::hills(64, 1.0) };
    let found = recovered(&images, &coarse, &quick());
    let truth = coarse.truth();
    let error = slope_rms(&found.slopes, &truth.slopes);
    println!("slopes {error:.5}");
    assert!(error < 3e-3);
    let same = recovered(&coarse.nadir_images(&THREE, 45.0), &coarse, &quick());
    let ratio = same.covariances[500][0] / found.covariances[500][0];
    assert!((ratio - 4.0).abs() < 0.1, "four pixels have a quarter of the variance: {ratio}");
}

/// Suns at azimuths 0, 60 and 61 are not coplanar, yet hardly separate slopes from albedo: no cell is conditioned well enough, or, with the limit at
/// the condition number of the best tenth, nine tenths of the cells would take their albedo from it. Refused, unless that is allowed or the albedo
/// is known.
#[test]
fn val_a_surface_that_rests_on_a_few_albedos_is_refused() {
    let scene = Scene { albedo: Box::new(|_, _| 0.2), ..Scene::hills(32, 1.0) };
    let images = scene.nadir_images(&[0.0, 60.0, 61.0], 45.0);
    let run = |settings: Settings| recover(&images, &level(&scene), &Known::default(), &settings, &streams());
    let none = run(quick()).unwrap_err().to_string();
    assert!(none.starts_with("no cell has a condition number below 300 (the smallest is "), "{none}");
    let mut conditions = run(Settings { condition_max: 1e9, rounds: 1, ..quick() }).unwrap().condition.values;
    conditions.sort_by(f64::total_cmp);
    let few = Settings { condition_max: conditions[102], ..quick() };
    let words = run(few.clone()).unwrap_err().to_string();
    let said = "90.0 % of the cells would take their albedo from their neighbours (0.0 % are lit in fewer than three images, 90.0 % have";
    assert!(words.starts_with(said), "{words}");
    let allowed = run(Settings { leaning_max: 1.0, rounds: 1, ..few }).unwrap();
    assert!((allowed.share_leaning - (1024.0 - 102.0) / 1024.0).abs() < 1e-12);
    let known = run(Settings { albedo: Some(0.2), ..quick() }).unwrap();
    let truth = scene.truth();
    assert!(slope_rms(&known.slopes, &truth.slopes) < 0.01, "{}", slope_rms(&known.slopes, &truth.slopes));
    // Two of three images in shadow over six of ten columns: too dark, not poorly conditioned.
    let mut dark = scene.nadir_images(&THREE, 45.0);
    let shaded = |k: &usize| k % 32 % 10 < 6;
    dark[1..].iter_mut().for_each(|image| (0..1024).filter(shaded).for_each(|k| image.brightness[k] = 0.0));
    let words = recover(&dark, &level(&scene), &Known::default(), &quick(), &streams()).unwrap_err().to_string();
    let share = 100.0 * (0..1024).filter(shaded).count() as f64 / 1024.0;
    let said = format!("({share:.1} % are lit in fewer than three images, 0.0 % have");
    assert!(words.contains(&said), "{share}: {words}");
}

/// Outward paths do not reach the cells behind a hole 13 cells wide: these have no height in any round, and a warning gives their number; the other
/// heights are right. Least squares recovers the heights of all cells that some image shows.
#[test]
fn val_paths_leave_what_they_do_not_reach_unknown() {
    let scene = Scene::hills(33, 1.0);
    let hole = |k: usize| (20..24).contains(&(k / 33)) && (10..23).contains(&(k % 33));
    let mut images = scene.nadir_images(&THREE, 45.0);
    images.iter_mut().for_each(|image| (0..33 * 33).filter(|&k| hole(k)).for_each(|k| image.brightness[k] = f64::NAN));
    let along = recovered(&images, &scene, &Settings { integration: Integration::Paths, ..quick() });
    let unknown: Vec<usize> = (0..33 * 33).filter(|&k| !hole(k) && along.heights.values[k].is_nan()).collect();
    // Paths start in the middle cell, row and column 16, and go straight or to one side.
    let behind = |k: usize| k / 33 >= 24 && (10..23).contains(&(k % 33));
    assert!(unknown.iter().all(|&k| behind(k)) && unknown.len() == (0..33 * 33).filter(|&k| behind(k)).count());
    let note = format!("no path from the centre reaches {} cells behind holes", unknown.len());
    assert!(along.warnings.iter().any(|w| w.starts_with(&note)), "{:?}", along.warnings);
    assert!(along.converged && along.rounds.len() >= 2);
    let truth = scene.truth().heights.values;
    let error = height_rms(&along.heights.values, &truth);
    println!("{} cells unknown, {error:.4} m", unknown.len());
    assert!(error < 0.1);
    let squares = recovered(&images, &scene, &quick());
    assert!((0..33 * 33).all(|k| squares.heights.values[k].is_nan() == hole(k)));
}

/// The exposure of one image 4 % too high tilts the surface. Three altimeter points (1 cm) alone only dimple the surface at their positions; with free
/// exposures they determine the tilt. Collinear points do not.
#[test]
fn val_three_points_settle_a_wrong_exposure() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth().heights;
    let mut images = scene.nadir_images(&THREE, 45.0);
    images[0].brightness.iter_mut().for_each(|v| *v *= 1.04);
    let at = |[x_m, y_m]: [f64; 2]| {
        let height_m = sastrugi_numeric::Surface::height(&truth, x_m, y_m).unwrap();
        HeightPoint { x_m, y_m, height_m, sigma_m: 0.01 }
    };
    let error = |points: &[[f64; 2]], free_exposure: bool| {
        let known = Known { points: points.iter().copied().map(at).collect(), coarse: None };
        let settings = Settings { free_exposure, rounds: 20, ..quick() };
        let found = recover(&images, &level(&scene), &known, &settings, &streams()).unwrap();
        println!(
            "{} points, free {free_exposure}: {} rounds, {:?}",
            points.len(),
            found.rounds.len(),
            found.calibrations
        );
        height_rms(&found.heights.values, &truth.values)
    };
    let three = [[10.0, 12.0], [52.0, 20.0], [30.0, 55.0]];
    let (none, held, free) = (error(&[], false), error(&three, false), error(&three, true));
    println!("heights: {none:.3} m without, {held:.3} m with three points, {free:.4} m with exposures free as well");
    assert!(none > 0.5 && held > 0.25 && free < 0.02);
    let plane = |x: f64, y: f64| [x, y, 0.3 * x - 0.2 * y + 4.0, 2.0];
    let [p, q] = calibration::plane_through(&[plane(0.0, 0.0), plane(3.0, 1.0), plane(1.0, 2.0)]).unwrap();
    assert!((p - 0.3).abs() < 1e-12 && (q + 0.2).abs() < 1e-12);
    assert_eq!(calibration::plane_through(&[plane(0.0, 0.0), plane(1.0, 2.0), plane(2.0, 4.0)]), None);
    assert_eq!(calibration::plane_through(&[plane(0.0, 0.0), plane(1.0, 2.0)]), None);
}
