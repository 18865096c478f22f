//! Integration of slopes to heights.

use super::accuracy::streams;
use super::scene::{Scene, height_rms};
use crate::photoclinometry::integration::{Constraint, HeightPoint, Stop, System};
use crate::photoclinometry::paths::integrate_along_paths;
use sastrugi_numeric::{Geometry, Grid, sums};

/// Heights from the dense normal equations: the sum in the module header, term by term, solved by elimination with one height held.
fn dense(g: &Geometry, information: &[[f64; 3]], slopes: &[[f64; 2]], constraints: &[Constraint]) -> Vec<f64> {
    let n = g.len();
    let mut matrix = vec![vec![0.0; n + 1]; n];
    let mut term = |row: &[(usize, f64)], other: &[(usize, f64)], target: f64, weight: f64| {
        for (i, a) in row {
            other.iter().for_each(|(j, b)| matrix[*i][*j] += weight * a * b);
            matrix[*i][n] += weight * a * target;
        }
    };
    for k in 0..n {
        let (r, c) = (k / g.cols, k % g.cols);
        let [a, b, d] = information[k];
        let [hx, hy] = g.cell.map(|h| 1.0 / h);
        let west = (c > 0).then(|| vec![(k, hx), (k.wrapping_sub(1), -hx)]);
        let east = (c + 1 < g.cols).then(|| vec![(k + 1, hx), (k, -hx)]);
        let south = (r + 1 < g.rows).then(|| vec![(k, hy), (k + g.cols, -hy)]);
        let north = (r > 0).then(|| vec![(k.wrapping_sub(g.cols), hy), (k, -hy)]);
        let [p, q] = slopes[k];
        for x in [&west, &east] {
            for y in [&south, &north] {
                match (x, y) {
                    (Some(x), Some(y)) => {
                        term(x, x, p, 0.25 * a);
                        term(y, y, q, 0.25 * d);
                        term(x, y, q, 0.25 * b);
                        term(y, x, p, 0.25 * b);
                    }
                    (Some(x), None) => term(x, x, p, 0.25 * (a - b * b / d)),
                    (None, Some(y)) => term(y, y, q, 0.25 * (d - b * b / a)),
                    (None, None) => {}
                }
            }
        }
    }
    for c in constraints {
        term(&c.cells, &c.cells, c.height_m, 1.0 / (c.sigma_m * c.sigma_m));
    }
    if constraints.is_empty() {
        term(&[(0, 1.0)], &[(0, 1.0)], 0.0, 1.0);
    }
    for i in 0..n {
        let pivot = (i..n).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs())).unwrap();
        matrix.swap(i, pivot);
        let line = matrix[i].clone();
        for below in matrix.iter_mut().skip(i + 1) {
            let factor = below[i] / line[i];
            below.iter_mut().zip(&line).for_each(|(v, l)| *v -= factor * l);
        }
    }
    let mut z = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| matrix[i][j] * z[j]).sum();
        z[i] = (matrix[i][n] - known) / matrix[i][i];
    }
    if constraints.is_empty() {
        let mean = sums::mean(&z);
        z.iter_mut().for_each(|v| *v -= mean);
    }
    z
}

/// Weights over two decades with covariances, unequal cells, holes, with and without constraints: conjugate gradients against elimination.
#[test]
fn val_heights_are_those_of_the_dense_equations() {
    let g = Geometry { rows: 7, cols: 9, cell: [0.5, 0.8], origin: [3.0, -1.0] };
    let mut stream = streams().stream("dense");
    let slopes: Vec<[f64; 2]> = (0..63).map(|_| [stream.normal(), stream.normal()]).collect();
    let information: Vec<Option<[f64; 3]>> = (0..63)
        .map(|k| {
            let (a, c) = (libm::exp(2.0 * stream.normal()), libm::exp(2.0 * stream.normal()));
            (k % 11 != 4).then_some([a, 0.6 * (a * c).sqrt(), c])
        })
        .collect();
    let points = [
        HeightPoint { x_m: 4.1, y_m: 1.3, height_m: 2.0, sigma_m: 0.3 },
        HeightPoint { x_m: 6.6, y_m: 3.9, height_m: -1.0, sigma_m: 0.1 },
    ];
    for constraints in [vec![], points.iter().map(|p| Constraint::point(&g, p).unwrap()).collect()] {
        let system = System::new(g, &information, constraints.clone());
        // The dense equations have no slope correction: compare without it, with a hole every 11 cells.
        let plain = system.uncorrected(&slopes, &system.constraint_heights());
        let solved = system.solve(&plain, None, Stop::FINE);
        let expected = dense(&g, system.weights(), &slopes, &constraints);
        let worst = solved.heights_m.iter().zip(&expected).map(|(a, b)| (a - b).abs()).max_by(f64::total_cmp).unwrap();
        println!("{} iterations, {worst:.1e} m", solved.iterations);
        assert!(worst < 1e-8, "{worst}");
    }
}

fn exact(scene: &Scene) -> (System, Vec<[f64; 2]>, Vec<f64>) {
    let truth = scene.truth();
    let information = vec![Some([1.0, 0.0, 1.0]); scene.map.len()];
    (System::new(scene.map, &information, vec![]), truth.slopes, truth.heights.values)
}

/// Mean heights and slopes of the cells of a landscape, by 16 midpoints along each side (error of heights 2^-9 of the second order).
fn means(scene: &Scene) -> (Vec<[f64; 2]>, Vec<f64>) {
    let g = &scene.map;
    let offsets: Vec<f64> = (0..16).map(|k| (f64::from(k) + 0.5) / 16.0 - 0.5).collect();
    let mean = |f: &dyn Fn(f64) -> f64| offsets.iter().map(|u| f(u * g.cell[0])).sum::<f64>() / 16.0;
    let half = 0.5 * g.cell[0];
    let cell = |k: usize| {
        let (x, y, z) = (g.x(k % g.cols), g.y(k / g.cols), &scene.height);
        let p = mean(&|v| z(x + half, y + v) - z(x - half, y + v)) / g.cell[0];
        let q = mean(&|u| z(x + u, y + half) - z(x + u, y - half)) / g.cell[0];
        ([p, q], mean(&|u| mean(&|v| z(x + u, y + v))))
    };
    (0..g.len()).map(cell).unzip()
}

/// Halving the cells of one landscape reduces the error of heights by 2^3 or more if slopes are interpolated to edges (fourth order, third at borders),
/// and by 2^2 if they are not.
#[test]
fn conv_heights_are_of_high_order() {
    let error = |side: usize, corrected: bool| {
        let scene = Scene { map: Geometry::square(side, side, 64.0 / side as f64), ..Scene::hills(64, 1.0) };
        let system = System::new(scene.map, &vec![Some([1.0, 0.0, 1.0]); scene.map.len()], vec![]);
        let (slopes, truth) = means(&scene);
        let right = if corrected { system.right_side(&slopes, &[]) } else { system.uncorrected(&slopes, &[]) };
        height_rms(&system.solve(&right, None, Stop::FINE).heights_m, &truth)
    };
    let [plain, corrected] = [false, true].map(|c| [error(64, c), error(128, c)]);
    println!("uncorrected {plain:?} m, corrected {corrected:?} m");
    let order = |e: [f64; 2]| libm::log2(e[0] / e[1]);
    assert!((order(plain) - 2.0).abs() < 0.2, "{plain:?}");
    assert!(order(corrected) > 2.7 && corrected[0] < 0.1 * plain[0], "{corrected:?}");
}

/// A checkerboard of heights has zero central differences, but its sum here is far from 0: the solver neither preserves nor creates it.
#[test]
fn val_checkerboards_are_penalised() {
    let scene = Scene::hills(32, 1.0);
    let (system, slopes, truth) = exact(&scene);
    let board: Vec<f64> = (0..32 * 32).map(|k| if (k / 32 + k % 32) % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let energy: f64 = system.apply(&board).iter().zip(&board).map(|(a, b)| a * b).sum();
    // Every one of 2 x 31 x 32 edges has a difference of 2.
    let edges = 2.0 * 31.0 * 32.0;
    assert!(energy > 0.9 * 4.0 * edges, "{energy}");
    let start: Vec<f64> = truth.iter().zip(&board).map(|(z, b)| z + b).collect();
    let solved = system.solve(&system.right_side(&slopes, &[]), Some(&start), Stop::FINE).heights_m;
    let left: f64 = solved.iter().zip(&truth).zip(&board).map(|((a, z), b)| (a - z) * b).sum::<f64>() / 1024.0;
    assert!(left.abs() < 1e-3, "{left}");
}

/// Slope noise of 0.02: least squares propagates less of it to heights than 450 published paths, and these less than 8.
#[test]
fn val_least_squares_beats_paths_and_many_paths_few() {
    let scene = Scene::hills(64, 1.0);
    let (system, mut slopes, truth) = exact(&scene);
    let good = vec![true; 4096];
    let along = |slopes: &[[f64; 2]], paths: usize| {
        height_rms(&integrate_along_paths(&scene.map, slopes, &good, paths, &streams()), &truth)
    };
    let clean = along(&slopes, 8);
    let mut stream = streams().stream("slope-noise");
    slopes.iter_mut().flatten().for_each(|s| *s += 0.02 * stream.normal());
    let poisson = height_rms(&system.solve(&system.right_side(&slopes, &[]), None, Stop::FINE).heights_m, &truth);
    let paths = [1, 8, 64, 450].map(|n| along(&slopes, n));
    println!("clean, 8 paths: {clean:.4} m; noise: least squares {poisson:.4} m, 1, 8, 64, 450 paths {paths:.4?} m");
    assert!(clean < 0.05);
    assert!(poisson < paths[3] && paths[3] < 0.9 * paths[1] && paths[1] < paths[0]);
}

/// Paths go around a hole where they can; cells that they cannot reach have no height.
#[test]
fn val_paths_go_around_holes() {
    let scene = Scene::hills(33, 1.0);
    let (_, slopes, truth) = exact(&scene);
    let good: Vec<bool> =
        (0..33 * 33).map(|k| !((20..24).contains(&(k / 33)) && (10..23).contains(&(k % 33)))).collect();
    let heights = integrate_along_paths(&scene.map, &slopes, &good, 64, &streams());
    assert!((0..33 * 33).all(|k| good[k] || heights[k].is_nan()));
    let reached = heights.iter().filter(|z| z.is_finite()).count();
    assert!(reached > 33 * 33 * 3 / 4, "{reached}");
    assert!(height_rms(&heights, &truth) < 0.1);
}

/// A hole is bridged: the heights on both sides of a band without slopes are right, and so are the cells around it.
#[test]
fn val_holes_and_masks_leave_the_rest_right() {
    let scene = Scene::hills(48, 1.0);
    let truth = scene.truth();
    let hole = |k: usize| {
        let (r, c) = ((k / 48) as f64 - 20.0, (k % 48) as f64 - 28.0);
        r * r + c * c < 25.0 || k % 48 < (k / 48) / 6
    };
    let information: Vec<Option<[f64; 3]>> = (0..48 * 48).map(|k| (!hole(k)).then_some([1.0, 0.0, 1.0])).collect();
    let slopes: Vec<[f64; 2]> = (0..48 * 48).map(|k| if hole(k) { [0.0; 2] } else { truth.slopes[k] }).collect();
    let system = System::new(scene.map, &information, vec![]);
    let solved = system.solve(&system.right_side(&slopes, &[]), None, Stop::FINE);
    let known: Vec<usize> = (0..48 * 48).filter(|&k| !hole(k)).collect();
    let of = |values: &[f64]| -> Vec<f64> { known.iter().map(|&k| values[k]).collect() };
    let error = height_rms(&of(&solved.heights_m), &of(&truth.heights.values));
    println!("{} iterations, {error:.4} m", solved.iterations);
    assert!(error < 0.05 && solved.residual <= 1e-10);
}

/// A coarse DEM corrects a tilt that is wrong in the slopes, and preserves the detail.
#[test]
fn val_a_coarse_dem_controls_long_wavelengths() {
    let scene = Scene::hills(64, 1.0);
    let truth = scene.truth();
    let coarse: Grid = sastrugi_numeric::resample::block_means(&truth.heights, 16);
    let slopes: Vec<[f64; 2]> = truth.slopes.iter().map(|s| [s[0] + 0.03, s[1] - 0.02]).collect();
    let information = vec![Some([1e2, 0.0, 1e2]); 4096];
    let error = |constraints: Vec<Constraint>| {
        let system = System::new(scene.map, &information, constraints);
        let right = system.right_side(&slopes, &system.constraint_heights());
        height_rms(&system.solve(&right, None, Stop::FINE).heights_m, &truth.heights.values)
    };
    let (free, held) = (error(vec![]), error(Constraint::coarse(&scene.map, &coarse, 0.01)));
    println!("heights: {free:.3} m free, {held:.3} m held by cells of 16 m");
    assert!(held < 0.25 * free);
}
