//! Stereo points.

use super::accuracy::{level, quick, streams};
use super::scene::{Scene, height_rms};
use crate::direction::Vector;
use crate::photoclinometry::stereo::{Offset, correlate, points, triangulate};
use crate::photoclinometry::*;
use sastrugi_numeric::Grid;

fn oblique(scene: &Scene) -> Vec<Image> {
    let views = [[0.0, 90.0], [90.0, 60.0], [270.0, 60.0]];
    let suns = [[10.0, 45.0], [130.0, 45.0], [250.0, 45.0]];
    views.iter().zip(suns).map(|(v, s)| scene.image(scene.camera(*v), s)).collect()
}

/// A window read from an image at an offset correlates best there, to 0.05 pixels (a paraboloid only approximates the cosine).
#[test]
fn val_offsets_are_found_below_a_pixel() {
    let scene = Scene::hills(48, 1.0);
    let image = scene.image(scene.nadir(), [40.0, 40.0]);
    for [dx, dy] in [[0.0, 0.0], [1.3, -0.6], [-2.45, 1.75]] {
        let cells: Vec<([f64; 2], f64)> = (0..225)
            .map(|k| [18.5 + f64::from(k % 15), 17.5 + f64::from(k / 15)])
            .map(|[u, v]| ([u, v], image.at([u + dx, v + dy])))
            .collect();
        let offset = correlate(&image, &cells, 4).unwrap();
        let error = [offset.pixels[0] - dx, offset.pixels[1] - dy];
        println!("{error:.3?} pixels, sigma {:.3?}, correlation {:.4}", offset.covariance, offset.correlation);
        assert!(error.iter().all(|e| e.abs() < 0.05) && offset.correlation > 0.97);
    }
}

/// Exact offsets give the exact point; similar views or a single view give none, nor do offsets that do not fit a common point.
#[test]
fn val_triangulation_finds_the_point() {
    let scene = Scene::hills(48, 1.0);
    let images = oblique(&scene);
    let (centre, place): (Vector, Vector) = ([20.0, 25.0, 0.0], [20.7, 24.6, 3.2]);
    let offset = |image: &Image, place: Vector| {
        let (a, b) = (image.camera.project(centre).unwrap(), image.camera.project(place).unwrap());
        Offset { pixels: [b[0] - a[0], b[1] - a[1]], covariance: [0.01, 0.0, 0.01], correlation: 0.9 }
    };
    let seen: Vec<(&Image, Offset)> = images.iter().map(|i| (i, offset(i, place))).collect();
    let (found, sigma) = triangulate(&seen, centre, 1.0).unwrap();
    assert!((0..3).all(|k| (found[k] - place[k]).abs() < 1e-9), "{found:?}");
    // Columns of the two oblique images move by cos 60 deg per metre of height, those of all three by sin 60 deg or 1 per metre east:
    // sigma of height 0.1 / sqrt(2 cos^2 60).
    assert!((sigma - 0.1 / 0.5f64.sqrt()).abs() < 1e-9, "{sigma}");
    assert_eq!(triangulate(&seen[..1], centre, 1.0), None);
    assert_eq!(triangulate(&[seen[0], seen[0]], centre, 1.0), None);
    let mut wrong = seen.clone();
    wrong[1].1.pixels[1] += 6.0;
    assert_eq!(triangulate(&wrong, centre, 1.0), None);
}

/// A surface placed 1.5 m too high is located at its true height within 0.1 m (rms), a seventh of the relief.
#[test]
fn val_points_lie_on_the_surface() {
    let scene = Scene::hills(64, 1.0);
    let images = oblique(&scene);
    let truth = scene.truth();
    let start: Vec<f64> = truth.heights.values.iter().map(|z| z + 1.5).collect();
    let shade = |image: usize, k: usize| {
        let i = &images[image];
        Some(truth.albedo[k] * super::scene::brightness(truth.slopes[k], i.light, i.camera.view_from([0.0; 3])))
    };
    let relief = Relief { geometry: &scene.map, heights_m: &start };
    let found = points(&images, relief, &shade, &Stereo { spacing: 6, search: 5, ..Stereo::default() });
    let errors: Vec<f64> = found.iter().map(|p| p.height_m - (scene.height)(p.x_m, p.y_m)).collect();
    let (rms, sigma) =
        (super::scene::rms(errors.iter().copied()), found.iter().map(|p| p.sigma_m).sum::<f64>() / found.len() as f64);
    println!("{} points, rms error {rms:.3} m, mean sigma {sigma:.3} m", found.len());
    assert!(found.len() >= 30 && rms < 0.1);
}

/// Exposures wrong by 3 and -3 % tilt the surface; stereo points determine the tilt, and with it the exposures.
#[test]
fn val_stereo_points_control_long_wavelengths() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth();
    let mut images = oblique(&scene);
    for (image, factor) in images.iter_mut().zip([1.03, 0.97, 1.0]) {
        image.brightness.iter_mut().for_each(|v| *v *= factor);
    }
    let run = |stereo: Option<Stereo>| {
        let settings = Settings { stereo, free_exposure: stereo.is_some(), rounds: 20, ..quick() };
        recover(&images, &level(&scene), &Known::default(), &settings, &streams()).unwrap()
    };
    let inner = |g: &Grid| -> Vec<f64> {
        (0..4096).filter(|k| [k / 64, k % 64].iter().all(|v| (10..54).contains(v))).map(|k| g.values[k]).collect()
    };
    let error = |r: &Recovered| height_rms(&inner(&r.heights), &inner(&truth.heights));
    let (without, with) = (run(None), run(Some(Stereo { spacing: 6, ..Stereo::default() })));
    println!("heights: {:.3} m without, {:.3} m with {:?}", error(&without), error(&with), with.rounds.last());
    println!("{:?}", with.calibrations);
    assert!(error(&with) < 0.6 * error(&without));
    assert!(with.rounds.last().unwrap().stereo_points > 20);
}
