//! Heights from slopes compared with scipy's sparse solver; recovered surfaces, shaded by numpy, compared with their images.

use crate::{check, python};
use sastrugi_imaging::direction;
use sastrugi_imaging::photoclinometry::integration::{Constraint, HeightPoint, Stop, System};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::json;

/// Slopes of a saddle with noise, weights over two decades with covariances, holes and non-square cells; unconstrained, and constrained by three
/// points. The script builds the equations from their definition and solves them directly; heights agree within 1e-6 m.
#[test]
fn val_heights_from_slopes_agree_with_a_sparse_solver() {
    let Some(python) = python() else { return };
    let folder = area();
    let g = Geometry { rows: 37, cols: 46, cell: [2.0, 1.5], origin: [100.0, -20.0] };
    let mut stream = Streams::for_seed(5, "photoclinometry-interop").stream("problem");
    let slopes: Vec<[f64; 2]> = (0..g.len())
        .map(|k| {
            let (x, y) = (g.x(k % g.cols), g.y(k / g.cols));
            [(x - 150.0) / 250.0 + 0.02 * stream.normal(), (y - 5.0) * (x - 120.0) / 5000.0 + 0.02 * stream.normal()]
        })
        .collect();
    let information: Vec<Option<[f64; 3]>> = (0..g.len())
        .map(|k| {
            let mut draw = || {
                let u = stream.uniform();
                1.0 / (1e-4 + 1e-2 * u * u)
            };
            let (a, c) = (draw(), draw());
            let b = 0.8 * (2.0 * stream.uniform() - 1.0) * (a * c).sqrt();
            let (r, c_) = (k / g.cols, k % g.cols);
            (!((10..16).contains(&r) && (20..29).contains(&c_)) && stream.uniform() > 0.05).then_some([a, b, c])
        })
        .collect();
    let at = |x_m: f64, y_m: f64, height_m: f64| HeightPoint { x_m, y_m, height_m, sigma_m: 0.05 };
    let points = [at(110.3, -10.0, 2.0), at(160.0, 20.7, -1.0), at(187.2, -3.3, 0.5)];
    for held in [false, true] {
        let constraints: Vec<Constraint> =
            points.iter().filter(|_| held).filter_map(|p| Constraint::point(&g, p)).collect();
        let system = System::new(g, &information, constraints.clone());
        let right = system.right_side(&slopes, &system.constraint_heights());
        let solved = system.solve(&right, None, Stop::FINE);
        let rows: Vec<_> = constraints
            .iter()
            .map(|c| json!({ "cells": c.cells, "height_m": c.height_m, "sigma_m": c.sigma_m }))
            .collect();
        let problem = json!({
            "shape": [g.rows, g.cols], "cell_m": g.cell, "slopes": slopes, "information": information, "constraints": rows,
            "heights_m": solved.heights_m,
        });
        let file = folder.path().join("problem.json");
        std::fs::write(&file, problem.to_string()).unwrap();
        let call = check(&python, "check_photoclinometry.py", &[&file]);
        println!("{} ({} iterations)", call.stdout, solved.iterations);
        assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    }
}

/// Smooth hills in cells of 0.25 m, rendered from above in pixels of 1 m under four suns, recovered from three. numpy shades the recovered heights by the
/// published law and finite differences: with the recovered albedo they reproduce all four images, including the fourth, which the inversion has not seen.
#[test]
fn val_a_recovered_surface_reproduces_its_images() {
    let Some(python) = python() else { return };
    let folder = area();
    // Length (m), azimuth and phase (deg), slope. East of a level direction is the sine of its azimuth.
    let waves = [(40.0, 17.0, 6.0, 0.13), (27.0, 109.0, 115.0, 0.12), (19.0, 149.0, 229.0, 0.09)];
    let height = |x: f64, y: f64| -> f64 {
        let wave = |(length, azimuth, phase, slope): (f64, f64, f64, f64)| {
            let [east, north, _] = direction(azimuth, 0.0);
            let turns = (x * east + y * north) / length;
            slope * length / std::f64::consts::TAU * direction(360.0 * turns + phase, 0.0)[0]
        };
        waves.into_iter().map(wave).sum()
    };
    let line = |row: usize| -> String {
        let y = 64.0 - 0.25 * (row as f64 + 0.5);
        (0..256).map(|col| format!("{:.9} ", height(0.25 * (f64::from(col) + 0.5), y))).collect::<String>() + "\n"
    };
    let head = "ncols 256\nnrows 256\nxllcorner 500000\nyllcorner 4000000\ncellsize 0.25\nNODATA_value -9999\n";
    write(folder.path(), "hills.asc", &(head.to_owned() + &(0..256).map(line).collect::<String>()));
    let study = r#"
[study]
name = "reproduced"
seed = 3
date = "2026-01-01"

[[dem]]
id = "hills"
file = "hills.asc"

[[image]]
id = "suns"
surface = "hills"
camera = { kind = "nadir", pixel_m = 1.0 }
samples = 4
sun = { elevation_deg = 45.0 }
sweep."sun.azimuth_deg" = [0.0, 120.0, 240.0]

[[image]]
id = "fourth"
surface = "hills"
camera = { kind = "nadir", pixel_m = 1.0 }
samples = 4
sun = { azimuth_deg = 70.0, elevation_deg = 35.0 }

[[photoclinometry]]
id = "recovered"
images = ["suns"]
samples = 0
"#;
    write(folder.path(), "study.toml", study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = check(&python, "check_reproduced.py", &[&folder.path().join("release")]);
    println!("{}", call.stdout);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}
