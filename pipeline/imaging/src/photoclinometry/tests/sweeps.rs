//! Propagation of errors of suns, photometric function, registration, exposure and haze to the surface.

use super::accuracy::{THREE, quick, recovered};
use super::scene::{Scene, Truth, height_rms, slope_rms};
use crate::direction::direction;
use crate::photoclinometry::evaluation::evaluate;
use crate::photoclinometry::*;
use crate::photometry::Photometry;

struct Errors {
    slopes: f64,
    heights_m: f64,
    correlation: f64,
}

fn errors(images: &[Image], scene: &Scene, truth: &Truth, settings: &Settings) -> Errors {
    let found = recovered(images, scene, settings);
    let (light, view) = (direction(45.0, 30.0), [0.0, 0.0, 1.0]);
    let evaluation = evaluate(&truth.heights, &found.heights, &Photometry::default(), light, view).unwrap();
    Errors {
        slopes: slope_rms(&found.slopes, &truth.slopes),
        heights_m: height_rms(&found.heights.values, &truth.heights.values),
        correlation: evaluation.shaded_correlation,
    }
}

/// Each error separately, without noise, at one, two and four times a small value. The slope error grows in proportion (the photometric function is
/// smooth), within 25 % where it exceeds the error without any disturbance (3e-4). This test prints the table of `docs/imaging.md`.
#[test]
fn conv_errors_grow_in_proportion() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth();
    let exact = scene.nadir_images(&THREE, 45.0);
    let clean = errors(&exact, &scene, &truth, &quick());
    println!("wrong | by | slope rms | height rms, cells | correlation of shading");
    println!("nothing | 0 | {:.4} | {:.3} | {:.4}", clean.slopes, clean.heights_m, clean.correlation);
    let with = |change: &dyn Fn(&mut [Image])| {
        let mut images = exact.clone();
        change(&mut images);
        errors(&images, &scene, &truth, &quick())
    };
    let sun_azimuth = |by: f64| with(&|images| images[0].light = direction(by, 45.0));
    let sun_elevation = |by: f64| with(&|images| images[0].light = direction(0.0, 45.0 + by));
    let exposure = |by: f64| with(&|images| images[0].brightness.iter_mut().for_each(|v| *v *= 1.0 + by / 100.0));
    let haze = |by: f64| {
        with(&|images| {
            let mean = images[0].median();
            images.iter_mut().for_each(|i| i.brightness.iter_mut().for_each(|v| *v += mean * by / 100.0));
        })
    };
    let law = |by: f64| {
        let photometry = Photometry { lambert: 0.35 + by, lommel_seeliger: 0.65 - by };
        errors(&exact, &scene, &truth, &Settings { photometry: Some(photometry), ..quick() })
    };
    let registration = |by: f64| {
        // One image taken by a camera displaced from its stated position.
        let shifted = move |x: f64, y: f64| (x + by, y);
        let moved = Scene {
            map: scene.map,
            height: Box::new(move |x, y| {
                let (x, y) = shifted(x, y);
                (Scene::hills(64, 1.0).height)(x, y)
            }),
            albedo: Box::new(move |x, y| {
                let (x, y) = shifted(x, y);
                (Scene::hills(64, 1.0).albedo)(x, y)
            }),
        };
        with(&|images| images[0] = moved.image(moved.nadir(), [0.0, 45.0]))
    };
    type Sweep<'a> = (&'a str, &'a dyn Fn(f64) -> Errors, [f64; 3]);
    let sweeps: [Sweep<'_>; 6] = [
        ("azimuth of one sun, deg", &sun_azimuth, [1.0, 2.0, 4.0]),
        ("elevation of one sun, deg", &sun_elevation, [0.5, 1.0, 2.0]),
        ("exposure of one image, %", &exposure, [1.0, 2.0, 4.0]),
        ("haze of all images, %", &haze, [2.5, 5.0, 10.0]),
        ("weight of Lambert's law (0.35)", &law, [0.1, 0.2, 0.4]),
        ("place of one image, pixels", &registration, [0.25, 0.5, 1.0]),
    ];
    for (name, sweep, steps) in sweeps {
        let found = steps.map(|by| (by, sweep(by)));
        for (by, e) in &found {
            println!("{name} | {by} | {:.4} | {:.3} | {:.4}", e.slopes, e.heights_m, e.correlation);
        }
        let own = |e: &Errors| (e.slopes * e.slopes - clean.slopes * clean.slopes).sqrt();
        for pair in found.windows(2) {
            let growth = own(&pair[1].1) / own(&pair[0].1);
            assert!((growth - 2.0).abs() < 0.5, "{name}: {growth}");
        }
    }
}
