//! Accuracy of surfaces recovered from images of a known world.

use super::scene::{Scene, height_rms, noisy, rms, slope_rms};
use crate::camera::{Camera, PinholeCamera};
use crate::description::Noise;
use crate::direction::direction;
use crate::photoclinometry::uncertainty::coverage;
use crate::photoclinometry::*;
use crate::photometry::Photometry;
use sastrugi_numeric::{Grid, Streams};

pub const THREE: [f64; 3] = [0.0, 120.0, 240.0];

pub fn streams() -> Streams {
    Streams::for_seed(1, "photoclinometry-test")
}

pub fn level(scene: &Scene) -> Grid {
    Grid::filled(scene.map, 0.0)
}

pub fn quick() -> Settings {
    Settings { samples: 0, ..Settings::default() }
}

pub fn recovered(images: &[Image], scene: &Scene, settings: &Settings) -> Recovered {
    recover(images, &level(scene), &Known::default(), settings, &streams()).unwrap()
}

/// Acceptance: three suns at zenith distance 45 deg, no noise, 64 x 64 cells of 2 m, truth on facets four times finer. Bounds: slopes and albedo
/// 1e-3, heights 0.2 cells (rms).
#[test]
fn val_images_without_noise_recover_the_surface() {
    let scene = Scene::hills(64, 2.0);
    let truth = scene.truth();
    let found = recovered(&scene.nadir_images(&THREE, 45.0), &scene, &quick());
    let slopes = slope_rms(&found.slopes, &truth.slopes);
    let albedo = rms(found.albedo.values.iter().zip(&truth.albedo).map(|(a, b)| a - b));
    let heights = height_rms(&found.heights.values, &truth.heights.values);
    let relief = rms(truth.slopes.iter().flatten().copied());
    println!("slopes {slopes:.2e} of {relief:.3}, albedo {albedo:.2e}, heights {:.4} cells", heights / 2.0);
    assert!(slopes < 1e-3 && albedo < 1e-3 && heights < 0.2 * 2.0);
    // Far inside the bound for heights: the integration is of fourth order.
    assert!(heights < 0.01 * 2.0, "{heights}");
    assert!(found.converged && found.rounds.len() == 2, "{:?}", found.rounds);
    assert!(found.lit.values.iter().all(|&n| n == 3) && found.leaning.values.iter().all(|l| *l == 0.0));
}

/// Acceptance: 1 % noise, the same suns: slopes within 0.03 (rms), and the table of other suns (section 11 of the specification: 0.016, 0.060, 0.50,
/// 0.047). With 4096 cells, rms values have a relative scatter of 1 to 2 %, so the bands below (25 %; a factor of 2 for the third, where the equations
/// hardly determine the slopes and the photometric function is curved) are ten standard errors wide: false alarm below 1e-6.
#[test]
fn stat_noise_of_one_percent_by_sun() {
    let scene = Scene::hills(64, 2.0);
    let truth = scene.truth();
    let cases = [
        ("0/120/240 at zenith 45", THREE, 45.0, 0.016, 1.25),
        ("0/45/90 at zenith 45", [0.0, 45.0, 90.0], 45.0, 0.060, 1.25),
        ("0/15/30 at zenith 45", [0.0, 15.0, 30.0], 45.0, 0.50, 2.0),
        ("0/120/240 at zenith 20", THREE, 70.0, 0.047, 1.25),
    ];
    println!(
        "suns | slope rms | predicted | specified | albedo rms | condition | R(albedo, slope) | height rms, cells | warnings"
    );
    for (name, azimuths, elevation, specified, factor) in cases {
        let settings = Settings { noise: Some(Noise { absolute: 0.0, relative: 0.01 }), condition_max: 1e4, ..quick() };
        let found = recovered(&noisy(&scene.nadir_images(&azimuths, elevation), 0.01, 5), &scene, &settings);
        let slopes = slope_rms(&found.slopes, &truth.slopes);
        let expected = (found.covariances.iter().map(|c| c[0] + c[3]).sum::<f64>() / 4096.0).sqrt();
        let albedo = rms(found.albedo.values.iter().zip(&truth.albedo).map(|(a, b)| a - b));
        let middle = |g: &Grid| sastrugi_numeric::sums::median(&g.values);
        println!(
            "{name} | {slopes:.4} | {expected:.4} | {specified} | {albedo:.4} | {:.1} | {:.2} | {:.3} | {:?}",
            middle(&found.condition),
            middle(&found.albedo_slope_correlation),
            height_rms(&found.heights.values, &truth.heights.values) / 2.0,
            found.warnings
        );
        if azimuths == THREE && elevation == 45.0 {
            assert!(slopes < 0.03);
            assert!(found.warnings.is_empty());
        }
        assert!(slopes < specified * factor && slopes > specified / factor, "{name}: {slopes}");
    }
}

/// Null: errors of slopes, albedo and heights are normal with the standard deviations given. 48 x 48 cells, 1 % noise, three suns; slopes and
/// albedo of inner cells (40 x 40, independent: standard error of a share near 68 % is 1.2 points, of one near 95 % 0.5); heights over 40 worlds
/// of noise, whose errors are correlated within a world: about 20 independent values per world, standard error 1.7 and 0.8 points. Bands of 5 points:
/// false alarm below 0.3 % for heights even with 8 instead of 20; they would detect standard deviations wrong by 12 %.
fn covered(worlds: u64, samples: usize) {
    let scene = Scene::hills(48, 1.0);
    let truth = scene.truth();
    let images = scene.nadir_images(&THREE, 45.0);
    let settings = Settings { noise: Some(Noise { absolute: 0.0, relative: 0.01 }), samples, ..Settings::default() };
    let inner: Vec<usize> = (0..48 * 48).filter(|k| [k / 48, k % 48].iter().all(|v| (4..44).contains(v))).collect();
    let mut errors: [Vec<f64>; 4] = Default::default();
    let mut sigmas: [Vec<f64>; 4] = Default::default();
    for world in 0..worlds {
        let found = recovered(&noisy(&images, 0.01, 100 + world), &scene, &settings);
        let height_sigma = found.height_sigma.as_ref().unwrap();
        let shift = sastrugi_numeric::sums::mean(&truth.heights.values);
        for &k in &inner {
            let covariance = found.covariances[k];
            let of = [
                (found.slopes[k][0] - truth.slopes[k][0], covariance[0].sqrt()),
                (found.slopes[k][1] - truth.slopes[k][1], covariance[3].sqrt()),
                (found.albedo.values[k] - truth.albedo[k], covariance[5].sqrt()),
                (found.heights.values[k] - (truth.heights.values[k] - shift), height_sigma.values[k]),
            ];
            for (j, (error, sigma)) in of.into_iter().enumerate() {
                errors[j].push(error);
                sigmas[j].push(sigma);
            }
        }
    }
    for (j, name) in ["p", "q", "albedo", "heights"].into_iter().enumerate() {
        let shares = [1.0, 1.959_964].map(|factor| 100.0 * coverage(&errors[j], &sigmas[j], factor));
        println!("{name}: {:.1} % within one, {:.1} % within 1.96 standard deviations", shares[0], shares[1]);
        assert!((shares[0] - 68.27).abs() < 5.0 && (shares[1] - 95.0).abs() < 5.0, "{name}: {shares:?}");
    }
}

#[test]
fn stat_uncertainties_cover_the_errors() {
    covered(40, 32);
}

/// The same with 200 worlds and 64 samples (`--ignored`): standard errors of heights below 1 point.
#[test]
#[ignore = "200 inversions"]
fn stat_uncertainties_cover_the_errors_of_many_worlds() {
    covered(200, 64);
}

/// Four images with twice the assumed noise: 3 600 inner degrees of freedom determine the scale within 1.2 % (standard error); band
/// +-7 %, false alarm below 1e-6.
#[test]
fn stat_noise_is_estimated_from_residuals() {
    let scene = Scene::hills(64, 1.0);
    let images = noisy(&scene.nadir_images(&[0.0, 90.0, 180.0, 270.0], 45.0), 0.02, 8);
    let assumed = Noise { absolute: 0.0, relative: 0.01 };
    let settings = Settings { noise: Some(assumed), estimate_noise: true, ..quick() };
    let found = recovered(&images, &scene, &settings);
    assert!((found.noise_scale - 2.0).abs() < 0.14, "{}", found.noise_scale);
    let plain = recovered(&images, &scene, &Settings { noise: Some(assumed), ..quick() });
    let ratio = found.covariances[2000][0] / plain.covariances[2000][0];
    assert!((ratio - found.noise_scale * found.noise_scale).abs() < 1e-9);
}

/// Oblique cameras see a hill displaced: one round from level ground is wrong, and re-projection corrects it.
#[test]
fn val_reprojection_registers_oblique_images() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth();
    let views = [[0.0, 90.0], [90.0, 65.0], [200.0, 70.0], [310.0, 65.0]];
    let suns = [[10.0, 45.0], [100.0, 45.0], [190.0, 50.0], [280.0, 45.0]];
    let images: Vec<Image> = views.iter().zip(suns).map(|(v, s)| scene.image(scene.camera(*v), s)).collect();
    // The borders leave the images, so compare the inner 48 x 48 cells.
    let inner = |values: &[f64]| -> Vec<f64> {
        (0..64 * 64).filter(|k| [k / 64, k % 64].iter().all(|v| (8..56).contains(v))).map(|k| values[k]).collect()
    };
    let error = |rounds: usize| {
        let found = recovered(&images, &scene, &Settings { rounds, tolerance: 1e-4, ..quick() });
        let rms = height_rms(&inner(&found.heights.values), &inner(&truth.heights.values));
        println!("{rounds} rounds: heights {rms:.4} m, {:?}", found.rounds.last().unwrap());
        (rms, found)
    };
    let ((one, _), (all, found)) = (error(1), error(20));
    assert!(found.converged, "{:?}", found.rounds);
    assert!(all < 0.25 * one && all < 0.1, "{one} {all}");
    let rounds = &found.rounds;
    assert!(rounds[1].brightness_rms < 0.5 * rounds[0].brightness_rms, "{rounds:?}");
    assert!(rounds.windows(2).all(|w| w[1].change_m < 0.2 * w[0].change_m), "{rounds:?}");
}

/// Pinholes 150 m above the ground, each off its centre: views differ from cell to cell, and heights are recovered as from parallel cameras. (Pixels
/// of 0.75 m, interpolated between their centres, blur cells of 1 m: slopes to 0.01, heights to 0.05 cells.)
#[test]
fn val_pinhole_images_recover_the_surface() {
    let scene = Scene::hills(48, 1.0);
    let truth = scene.truth();
    let places = [[24.0, 24.0], [70.0, 30.0], [-10.0, 50.0], [20.0, -30.0]];
    let suns = [[10.0, 45.0], [100.0, 45.0], [190.0, 50.0], [280.0, 45.0]];
    let image = |([x, y], sun): ([f64; 2], [f64; 2])| {
        let camera = PinholeCamera::new([x, y, 150.0], [24.0, 24.0, 0.0], 34.0, [120, 120]);
        scene.image(Camera::Pinhole(camera), sun)
    };
    let images: Vec<Image> = places.into_iter().zip(suns).map(image).collect();
    let found = recovered(&images, &scene, &Settings { rounds: 20, ..quick() });
    let slopes = slope_rms(&found.slopes, &truth.slopes);
    let heights = height_rms(&found.heights.values, &truth.heights.values);
    println!("slopes {slopes:.4}, heights {heights:.4} m, {} rounds", found.rounds.len());
    assert!(found.converged && slopes < 0.01 && heights < 0.05);
}

/// With known albedo there are two unknowns and three images: the noise of slopes is lower than with free albedo.
#[test]
fn val_known_albedo_reduces_slope_noise() {
    let scene = Scene { albedo: Box::new(|_, _| 0.25), ..Scene::hills(48, 1.0) };
    let truth = scene.truth();
    let images = noisy(&scene.nadir_images(&[0.0, 45.0, 90.0], 45.0), 0.01, 3);
    let error = |albedo| slope_rms(&recovered(&images, &scene, &Settings { albedo, ..quick() }).slopes, &truth.slopes);
    let (free, known) = (error(None), error(Some(0.25)));
    println!("slopes: {free:.4} with free albedo, {known:.4} with albedo known");
    assert!(known < 0.5 * free);
    let found = recovered(&images, &scene, &Settings { albedo: Some(0.25), ..quick() });
    assert!(found.albedo.values.iter().all(|a| *a == 0.25));
}

/// Any number of threads gives the same bits.
#[test]
fn prop_threads_change_no_bit() {
    let scene = Scene::hills(40, 1.0);
    let images = noisy(&scene.nadir_images(&THREE, 45.0), 0.01, 2);
    let settings = Settings { samples: 3, ..Settings::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| recovered(&images, &scene, &settings));
        let bits = |g: &Grid| g.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        [bits(&found.heights), bits(&found.albedo), bits(found.height_sigma.as_ref().unwrap())]
    };
    assert!(run(1) == run(3));
}

/// A window of the map gives the slopes and albedo of the complete map bit for bit (a nadir camera needs no heights), and its heights within 0.02 cells
/// outside a margin of 8 cells, after removing the mean difference.
#[test]
fn prop_tiles_with_overlap_equal_the_whole() {
    let scene = Scene::hills(64, 1.0);
    let images = noisy(&scene.nadir_images(&THREE, 45.0), 0.002, 4);
    let whole = recovered(&images, &scene, &quick());
    let start = level(&scene).window(0, 24, 64, 40);
    let tile = recover(&images, &start, &Known::default(), &quick(), &streams()).unwrap();
    let cells: Vec<(usize, usize)> = (0..64 * 40).map(|k| (k, k / 40 * 64 + 24 + k % 40)).collect();
    assert!(cells.iter().all(|&(a, b)| tile.slopes[a] == whole.slopes[b]));
    assert!(cells.iter().all(|&(a, b)| tile.albedo.values[a].to_bits() == whole.albedo.values[b].to_bits()));
    let inner: Vec<_> = cells.iter().filter(|(a, _)| a % 40 >= 8).collect();
    let (a, b): (Vec<f64>, Vec<f64>) =
        inner.iter().map(|(a, b)| (tile.heights.values[*a], whole.heights.values[*b])).unzip();
    let difference = height_rms(&a, &b);
    println!("heights of the tile: {difference:.4} cells rms from the whole");
    assert!(difference < 0.02);
}

/// The evaluation of a surface against itself, and against a shifted one.
#[test]
fn val_evaluation_distinguishes_good_from_bad() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth().heights;
    let (light, view) = (direction(40.0, 35.0), [0.0, 0.0, 1.0]);
    let of = |recovered: &Grid| evaluation::evaluate(&truth, recovered, &Photometry::default(), light, view).unwrap();
    let same = of(&truth);
    assert!((same.shaded_correlation - 1.0).abs() < 1e-12 && same.slope_error_rms < 1e-12);
    assert!((same.shaded_correlation_ceiling - 1.0).abs() < 1e-12 && same.slope_error_rms_ceiling < 1e-12);
    assert!(same.cells == 4096 && same.height_error_rms_m < 1e-12);
    assert!((same.height_rms_m - sastrugi_numeric::sums::variance(&truth.values).sqrt()).abs() < 1e-12);
    // A tilt and a shift in height: heights are off by both, slopes only by the tilt.
    let tilted = Grid::new(truth.geometry, (0..4096).map(|k| truth.values[k] + 5.0 + 0.02 * (k % 64) as f64).collect());
    let tilted = of(&tilted);
    assert!((tilted.slope_error_rms - 0.02).abs() < 1e-9 && tilted.height_error_rms_detrended_m < 1e-9);
    assert!((tilted.height_error_rms_m - 0.02 * ((64.0f64 * 64.0 - 1.0) / 12.0).sqrt()).abs() < 1e-9);
    // Shifted sideways by four cells: the shading correlates less.
    let moved = Grid::new(truth.geometry, (0..4096).map(|k| truth.values[k / 64 * 64 + (k + 4) % 64]).collect());
    let moved = of(&moved);
    assert!(moved.shaded_correlation < 0.8, "{moved:?}");
    // A finer truth has a ceiling below 1.
    let fine = Scene::hills(256, 0.25);
    let rough = Grid::new(
        fine.map,
        (0..256 * 256)
            .map(|k| (scene.height)(fine.map.x(k % 256), fine.map.y(k / 256)) + 0.05 * f64::from((k % 3) as u8))
            .collect(),
    );
    let coarse = sastrugi_numeric::resample::block_means(&rough, 4);
    let ceiling = evaluation::evaluate(&rough, &coarse, &Photometry::default(), light, view).unwrap();
    assert!(ceiling.shaded_correlation == ceiling.shaded_correlation_ceiling && ceiling.shaded_correlation < 0.9999);
}

/// By wavelength: a copy is coherent in every band, noise of the same strength in none (rms over 40 or more modes: squared coherence below 0.5
/// except with a probability of 1e-6), half the truth has half the rms and coherence 1; variances of all bands add up to that of the windowed field.
#[test]
fn val_bands_split_the_variance() {
    let scene = Scene::hills(64, 1.0);
    let mut stream = streams().stream("bands");
    let noise =
        |stream: &mut sastrugi_numeric::Stream| Grid::new(scene.map, (0..4096).map(|_| stream.normal()).collect());
    let (a, b) = (noise(&mut stream), noise(&mut stream));
    // Five octaves, from two cells to the side of the map.
    let same = evaluation::bands(&a, &a);
    let limits: Vec<[f64; 2]> = same.iter().map(|b| [b.wavelength_min_m, b.wavelength_max_m]).collect();
    assert_eq!(limits, [[2.0, 4.0], [4.0, 8.0], [8.0, 16.0], [16.0, 32.0], [32.0, 64.0]]);
    for band in same {
        assert!((band.coherence - 1.0).abs() < 1e-12 && (band.truth_rms_m - band.recovered_rms_m).abs() < 1e-15);
    }
    let other = evaluation::bands(&a, &b);
    let many: Vec<_> = other.iter().filter(|b| b.modes >= 40).collect();
    assert_eq!(many.len(), 3, "{other:?}");
    for band in many {
        assert!(band.coherence < 0.5, "{band:?}");
    }
    let halved = evaluation::bands(&a, &a.map(|v| 0.5 * v));
    assert_eq!(halved.len(), 5);
    for band in halved {
        assert!((band.recovered_rms_m / band.truth_rms_m - 0.5).abs() < 1e-12 && (band.coherence - 1.0).abs() < 1e-12);
    }
    // White noise: the variance outside the band beyond two cells' wavelength (corner modes) is 1 - pi/4.
    let total: f64 = evaluation::bands(&a, &a).iter().map(|b| b.truth_rms_m * b.truth_rms_m).sum();
    assert!((total - std::f64::consts::PI / 4.0).abs() < 0.1, "{total}");
}

/// A sine of 18 by 14 waves on 64 x 48 cells, against half of it on a plane. Its modes under a Hann window have 2/3 of the variance on the wave number
/// itself and 1/6 one higher and one lower along each axis, so that the mean square of a wave number `k` is `k^2 + 1/3`: rms slope
/// `A / sqrt(2) * 2 pi sqrt((18^2 + 1/3) / 64^2 + (14^2 + 1/3) / 48^2)` per metre, all of it in the first octave. Since it is even about the middle,
/// the sine has no mean plane.
#[test]
fn val_the_slope_of_a_sine_is_in_its_band() {
    use std::f64::consts::PI;
    let g = sastrugi_numeric::Geometry { rows: 48, cols: 64, cell: [1.0; 2], origin: [0.0; 2] };
    let wave = |amplitude: f64, tilt: f64| {
        let at = |k: usize| {
            let (x, y) = (g.x(k % g.cols), g.y(k / g.cols));
            amplitude * libm::cos(2.0 * PI * (18.0 * x / 64.0 + 14.0 * y / 48.0)) + tilt * (x - 2.0 * y)
        };
        Grid::new(g, (0..g.len()).map(at).collect())
    };
    let found = evaluation::bands(&wave(0.3, 0.0), &wave(0.15, 0.02));
    let frequency = ((18.0 * 18.0 + 1.0 / 3.0) / (64.0 * 64.0) + (14.0 * 14.0 + 1.0 / 3.0) / (48.0 * 48.0f64)).sqrt();
    let slope = 0.3 / 2f64.sqrt() * 2.0 * PI * frequency;
    assert!((found[0].truth_rms_m - 0.3 / 2f64.sqrt()).abs() < 1e-12, "{:?}", found[0]);
    assert!((found[0].truth_slope_rms - slope).abs() < 1e-12, "{:?}, not {slope}", found[0]);
    assert!((found[0].recovered_slope_rms - 0.5 * slope).abs() < 1e-12, "{:?}", found[0]);
    assert!(found[1..].iter().all(|b| b.truth_slope_rms < 1e-12 && b.recovered_slope_rms < 1e-12), "{found:?}");
}
