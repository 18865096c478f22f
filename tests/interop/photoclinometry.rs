//! Heights from slopes against scipy's sparse solver.

use crate::{check, python};
use sastrugi_imaging::photoclinometry::integration::{Constraint, HeightPoint, Stop, System};
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_tests::area;
use serde_json::json;

/// Slopes of a saddle with noise, information over two decades with covariances, holes, cells that are not square; free, and held by three points.
/// The script builds the equations from their definition and solves them directly; heights agree within 1e-6 m.
#[test]
fn val_heights_from_slopes_are_those_of_a_sparse_solver() {
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
