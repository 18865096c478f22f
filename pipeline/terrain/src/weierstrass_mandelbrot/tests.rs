use super::*;

use serde_json::json;

mod reference;

/// Checked parameters from JSON over the defaults.
fn surface(params: Value) -> WeierstrassMandelbrot {
    let mut all = serde_json::to_value(RawWeierstrassMandelbrot::default()).unwrap();
    all.as_object_mut().unwrap().extend(params.as_object().unwrap().clone());
    WeierstrassMandelbrot::try_from(serde_json::from_value::<RawWeierstrassMandelbrot>(all).unwrap()).unwrap()
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

/// Largest difference over the standard deviation of the second.
fn relative_error(a: &[f64], b: &[f64]) -> f64 {
    let worst = a.iter().zip(b).fold(0.0, |m, (x, y)| f64::max(m, (x - y).abs()));
    worst / sums::variance(b).sqrt()
}

/// The formula as printed (with plane waves) at one post.
fn direct_sum(s: &WeierstrassMandelbrot, phases: &[f64], row: usize, col: usize) -> f64 {
    let p = &s.raw;
    let (x, y) = (col as f64 * p.cell_m, (s.size.rows() - 1 - row) as f64 * p.cell_m);
    let mut z = 0.0;
    for (k, phase) in phases.iter().enumerate() {
        let (n, m) = (k as u32 / p.ridges + 1, k as u32 % p.ridges + 1);
        let (sin, cos) = libm::sincos(PI * f64::from(m) / f64::from(p.ridges));
        let wavenumber = libm::pow(p.frequency_ratio, f64::from(n)) / p.sampling_length_m;
        let wave = libm::cos(2.0 * PI * (wavenumber * (x * cos + y * sin)) + phase);
        z += s.amplitude_m(n) * (libm::cos(*phase) - wave);
    }
    z
}

/// `constant - U^T V` with `U = [a cos(alpha_i + phi); -a sin(alpha_i + phi)]` and `V = [cos beta_j; sin beta_j]`, in
/// blocks of posts that stay in the cache.
fn matrix_product(s: &WeierstrassMandelbrot, phases: &[f64]) -> Vec<f64> {
    use rayon::prelude::*;
    const BLOCK: usize = 32;
    let (rows, cols) = (s.size.rows(), s.size.cols());
    let (constant, waves) = s.constant_and_waves(phases);
    let turn = |cycles: f64| libm::sincos(2.0 * PI * (cycles - cycles.round()));
    let factors = |posts: usize, factor: &(dyn Fn(&PlaneWave, f64) -> [f64; 2] + Sync)| -> Vec<f64> {
        let all: Vec<Vec<f64>> = (0..posts)
            .into_par_iter()
            .map(|post| waves.iter().flat_map(|w| factor(w, post as f64)).collect())
            .collect();
        all.concat()
    };
    let u = factors(cols, &|w, i| {
        let (sin, cos) = turn(w.frequency()[0] * i);
        let c = w.coefficient() * Complex64::new(cos, sin);
        [c.re, -c.im]
    });
    let v = factors(rows, &|w, j| {
        let (sin, cos) = turn(w.frequency()[1] * j);
        [cos, sin]
    });
    let depth = 2 * waves.len();
    let dot = |a: &[f64], b: &[f64]| {
        let mut lanes = [0.0; 8];
        for (x, y) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
            for k in 0..8 {
                lanes[k] += x[k] * y[k];
            }
        }
        let rest = a.chunks_exact(8).remainder().iter().zip(b.chunks_exact(8).remainder());
        lanes.iter().sum::<f64>() + rest.map(|(x, y)| x * y).sum::<f64>()
    };
    let mut heights = vec![0.0; rows * cols];
    heights.par_chunks_mut(cols * BLOCK).enumerate().for_each(|(block, out)| {
        for first in (0..cols).step_by(BLOCK) {
            for (k, line) in out.chunks_exact_mut(cols).enumerate() {
                let j = rows - 1 - (block * BLOCK + k);
                let right = &v[j * depth..(j + 1) * depth];
                for (i, z) in line.iter_mut().enumerate().skip(first).take(BLOCK) {
                    *z = constant + dot(&u[i * depth..(i + 1) * depth], right);
                }
            }
        }
    });
    heights
}

/// Independent values at 60 digits: absolute tolerance 1e-11 of the summed amplitudes, which leaves 1e-6 of the heights'
/// scatter on these 0.25 m wide samples.
#[test]
fn val_independent_direct_sums() {
    let cases = [
        (4, 6, 2.3, 1e-8, &reference::FIRST_PHASES[..], &reference::FIRST_HEIGHTS),
        (16, 17, 2.6, 1e-6, &reference::SECOND_PHASES[..], &reference::SECOND_HEIGHTS),
    ];
    for (ridges, frequencies, dimension, scale, phases, expected) in cases {
        let s = surface(json!({"size_px": [6, 6], "ridges": ridges, "frequencies": frequencies,
            "fractal_dimension": dimension, "elevation_scale_m": scale}));
        assert_eq!(s.frequencies, frequencies);
        let heights = s.heights(phases);
        let tolerance = 1e-12 * s.amplitude_sum_m();
        for j in 0..6 {
            for i in 0..6 {
                let error = (heights.at(5 - j, i) - expected[j * 6 + i]).abs();
                assert!(error < tolerance, "D {dimension} at post {i}, {j}: {error:e} against {tolerance:e}");
            }
        }
    }
}

/// Every post in `band_limited` mode, every 37th in `paper` mode, whose phases the direct sum itself only knows to 1e-3
/// rad for the highest waves.
#[test]
fn val_fast_path_equals_the_direct_sum() {
    for ridges in [16, 64] {
        for dimension in [2.2, 2.6] {
            for (mode, tolerance, step) in [("band_limited", 1e-10, 1), ("paper", 1e-5, 37)] {
                let s = surface(json!({"size_px": [257, 129], "ridges": ridges, "fractal_dimension": dimension,
                    "mode": mode}));
                let phases = s.phases(&streams());
                let fast = s.heights(&phases).values;
                let posts = (0..fast.len()).step_by(step);
                let worst = posts
                    .fold(0.0, |worst, k| f64::max(worst, (fast[k] - direct_sum(&s, &phases, k / 257, k % 257)).abs()));
                let error = worst / sums::variance(&fast).sqrt();
                assert!(error < tolerance, "M {ridges} D {dimension} {mode}: {error:e}");
            }
        }
    }
}

#[test]
fn val_fast_path_equals_the_matrix_product() {
    for mode in ["band_limited", "paper"] {
        for dimension in [2.2, 2.6] {
            let s = surface(json!({"mode": mode, "fractal_dimension": dimension}));
            let phases = s.phases(&streams());
            let error = relative_error(&s.heights(&phases).values, &matrix_product(&s, &phases));
            assert!(error < 1e-10, "D {dimension} {mode}: {error:e}");
        }
    }
}
