use super::*;
use proptest::prelude::*;
use sastrugi_numeric::fft::RealFft2;
use serde_json::json;

mod reference;

/// Checked parameters from the defaults, overridden by JSON.
fn surface(params: Value) -> WeierstrassMandelbrot {
    let mut all = serde_json::to_value(RawWeierstrassMandelbrot::default()).unwrap();
    all.as_object_mut().unwrap().extend(params.as_object().unwrap().clone());
    WeierstrassMandelbrot::try_from(serde_json::from_value::<RawWeierstrassMandelbrot>(all).unwrap()).unwrap()
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).max_by(f64::total_cmp).unwrap()
}

/// One term of the printed formula (with plane waves): amplitude, wave vector in turns/m, phase.
type Term = (f64, [f64; 2], f64);

fn terms(s: &WeierstrassMandelbrot, phases: &[f64]) -> Vec<Term> {
    let p = &s.raw;
    let term = |(k, &phase): (usize, &f64)| {
        let (n, m) = (k as u32 / p.ridges + 1, k as u32 % p.ridges + 1);
        let (sin, cos) = libm::sincos(PI * f64::from(m) / f64::from(p.ridges));
        let wavenumber = libm::pow(p.frequency_ratio, f64::from(n)) / p.sampling_length_m;
        (s.amplitude_m(n), [wavenumber * cos, wavenumber * sin], phase)
    };
    phases.iter().enumerate().map(term).collect()
}

fn direct_sum(terms: &[Term], x: f64, y: f64) -> f64 {
    let term = |(a, [u, v], phase): &Term| a * (libm::cos(*phase) - libm::cos(2.0 * PI * (u * x + v * y) + phase));
    terms.iter().map(term).sum()
}

/// `U^T V` with `U = [a cos(alpha_i + phi); -a sin(alpha_i + phi)]` and `V = [cos beta_j; sin beta_j]`, in
/// blocks of posts that fit in the cache.
fn matrix_product(s: &WeierstrassMandelbrot, phases: &[f64]) -> Vec<f64> {
    use rayon::prelude::*;
    const BLOCK: usize = 32;
    let (rows, cols) = (s.size.rows(), s.size.cols());
    let waves = s.waves(phases);
    let turn = |cycles: f64| libm::sincos(2.0 * PI * (cycles - cycles.round()));
    let factors = |posts: usize, factor: &(dyn Fn(&PlaneWave, f64) -> [f64; 2] + Sync)| -> Vec<f64> {
        let all: Vec<Vec<f64>> = (0..posts)
            .into_par_iter()
            .map(|post| waves.iter().flat_map(|w| factor(w, post as f64)).collect())
            .collect();
        all.concat()
    };
    let u = factors(cols, &|w, i| {
        let (sin, cos) = turn(w.frequency[0] * i);
        let c = w.coefficient * Complex64::new(cos, sin);
        [c.re, -c.im]
    });
    let v = factors(rows, &|w, j| {
        let (sin, cos) = turn(w.frequency[1] * j);
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
                    *z = dot(&u[i * depth..(i + 1) * depth], right);
                }
            }
        }
    });
    heights
}

/// Independent values to 60 digits. Absolute tolerance: 1e-11 of the summed amplitudes, a millionth of these heights
/// (0.25 m wide samples of waves up to 67 m long).
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
        let tolerance = 1e-11 * s.amplitude_sum_m();
        for j in 0..6 {
            for i in 0..6 {
                let error = (heights.at(5 - j, i) - expected[j * 6 + i]).abs();
                assert!(error < tolerance, "D {dimension} at post {i}, {j}: {error:e} against {tolerance:e}");
            }
        }
    }
}

/// Every post in `band_limited` mode, every 37th in `paper` mode, where the phases of the highest waves are accurate to only
/// 1e-3 rad in the direct sum too.
#[test]
fn val_fast_path_equals_the_direct_sum() {
    for ridges in [16, 64] {
        for dimension in [2.2, 2.6] {
            for (mode, tolerance, step) in [("band_limited", 1e-10, 1), ("paper", 1e-5, 37)] {
                let s = surface(json!({"size_px": [257, 129], "ridges": ridges, "fractal_dimension": dimension,
                    "mode": mode}));
                let phases = s.phases(&streams());
                let fast = s.heights(&phases).values;
                let terms = terms(&s, &phases);
                let error_at = |k: usize| {
                    let (x, y) = ((k % 257) as f64 * 0.05, (128 - k / 257) as f64 * 0.05);
                    (fast[k] - direct_sum(&terms, x, y)).abs()
                };
                let worst = (0..fast.len()).step_by(step).map(error_at).max_by(f64::total_cmp).unwrap();
                let error = worst / sums::variance(&fast).sqrt();
                eprintln!("M {ridges} D {dimension} {mode}: {error:.1e} of the standard deviation");
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
            let exact = matrix_product(&s, &phases);
            let worst = largest_difference(&s.heights(&phases).values, &exact);
            let error = worst / sums::variance(&exact).sqrt();
            eprintln!("D {dimension} {mode}: {error:.1e} of the standard deviation");
            assert!(error < 1e-10, "D {dimension} {mode}: {error:e}");
            assert!(worst < 1e-12 * s.amplitude_sum_m(), "D {dimension} {mode}: {worst:e}");
        }
    }
}

/// With a frequency ratio of 2 and the sampling length equal to the size, every wave is one Fourier mode:
/// amplitudes must follow `A gamma^((D - 3) n)` to rounding.
#[test]
fn val_amplitudes_follow_the_power_law() {
    const SIDE: usize = 256;
    for dimension in [2.1, 2.5, 2.9] {
        let s = surface(json!({"size_px": [SIDE, SIDE], "cell_m": 0.1, "sampling_length_m": 25.6, "ridges": 2,
            "frequencies": 6, "frequency_ratio": 2.0, "fractal_dimension": dimension, "elevation_scale_m": 1e-3}));
        let spectrum = RealFft2::new(SIDE, SIDE).forward(&s.surface(&streams()).unwrap().values);
        let modes = (SIDE * SIDE) as f64;
        let scale = 25.6 * libm::pow(1e-3 / 25.6, dimension - 2.0) * (libm::log(2.0) / 2.0).sqrt();
        for n in 1..=6 {
            let expected = scale * libm::pow(2.0, (dimension - 3.0) * f64::from(n));
            // Ridge 1 runs north (theta = 90 degrees), ridge 2 along the rows (180 degrees).
            for mode in [spectrum.values[1 << n], spectrum.values[(1 << n) * SIDE]] {
                let amplitude = 2.0 * mode.norm() / modes;
                assert!((amplitude / expected - 1.0).abs() < 1e-9, "D {dimension} n {n}: {amplitude} {expected}");
            }
        }
    }
}

#[test]
fn prop_the_south_west_post_is_at_height_zero() {
    for mode in ["band_limited", "paper"] {
        let s = surface(json!({"size_px": [65, 33], "mode": mode}));
        let heights = s.surface(&streams()).unwrap();
        assert!(heights.at(32, 0).abs() < 1e-11 * s.amplitude_sum_m());
    }
}

#[test]
fn prop_ending_the_sum_earlier_keeps_the_other_phases() {
    let [few, many] = [5, 9].map(|n| surface(json!({"frequencies": n})).phases(&streams()));
    assert_eq!(few[..], many[..few.len()]);
}

#[test]
fn val_frequencies_in_the_sum() {
    let kept = |params| surface(params).frequencies;
    assert_eq!(kept(json!({})), 17);
    assert_eq!(kept(json!({"cell_m": 0.1})), 15);
    assert_eq!(kept(json!({"mode": "paper"})), 67);
    assert_eq!(kept(json!({"mode": "paper", "frequencies": 40})), 40);
    // A wave of exactly two cells is included.
    assert_eq!(kept(json!({"cell_m": 0.5, "sampling_length_m": 8.0, "frequency_ratio": 2.0})), 3);
    assert_eq!(surface(json!({})).notes().len(), 0);
    assert!(surface(json!({"mode": "paper"})).notes()[0].contains("n = 67"));
}

#[test]
fn prop_same_bits_on_any_number_of_threads() {
    let s = surface(json!({"size_px": [150, 70]}));
    let [one, two, eight] = [1, 2, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| s.surface(&streams()).unwrap())
    });
    assert!(one == two && one == eight);
}

/// Freezes the streams, the order of the phases and the arithmetic. To refresh, print the bits, and explain in the commit
/// message why released terrains change.
#[test]
fn gold_heights_are_frozen() {
    let heights = surface(json!({"size_px": [40, 30]})).surface(&streams()).unwrap();
    let bits = [0, 617, 1199].map(|k: usize| heights.values[k].to_bits());
    assert_eq!(bits, GOLD);
}
const GOLD: [u64; 3] = [4559589561004886955, 4558953161401661361, 4558164479805882570];

#[test]
fn val_impossible_parameters_are_refused() {
    let key = |params: Value| crate::prepare(KIND, &params).err().map(|e| e.key);
    let cases = [
        ("fractal_dimension", vec![json!(2.0), json!(3.0), json!(1.5), json!(-7.0)]),
        ("frequency_ratio", vec![json!(1.0), json!(0.5), json!(0.0)]),
        ("elevation_scale_m", vec![json!(0.0), json!(-1.0)]),
        ("sampling_length_m", vec![json!(0.0), json!(-1.0), json!(0.11)]),
        ("phase_max_rad", vec![json!(0.0), json!(-1.0)]),
        ("ridges", vec![json!(0), json!(4_000_000_000u32)]),
        ("frequencies", vec![json!(0)]),
        ("size_px", vec![json!([2, 9]), json!([9, 2])]),
        ("cell_m", vec![json!(0.0), json!(-0.1)]),
    ];
    for (name, values) in cases {
        for value in values {
            assert_eq!(key(json!({name: value})).as_deref(), Some(name), "{name} = {value}");
        }
    }
    // JSON cannot hold other numbers; null (where TOML had nan or inf) is not a number either.
    assert_eq!(key(json!({"cell_m": null})).as_deref(), Some("cell_m"));
    assert_eq!(
        key(json!({"elevation_scale_m": 1e308, "sampling_length_m": 1e308})).as_deref(),
        Some("elevation_scale_m")
    );
}

/// A parameter to set.
type Field = fn(&mut RawWeierstrassMandelbrot) -> &mut f64;

#[test]
fn val_non_finite_parameters_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let edits: [(&str, Field); 6] = [
            ("cell_m", |r| &mut r.cell_m),
            ("frequency_ratio", |r| &mut r.frequency_ratio),
            ("fractal_dimension", |r| &mut r.fractal_dimension),
            ("sampling_length_m", |r| &mut r.sampling_length_m),
            ("elevation_scale_m", |r| &mut r.elevation_scale_m),
            ("phase_max_rad", |r| &mut r.phase_max_rad),
        ];
        for (name, field) in edits {
            let mut raw = RawWeierstrassMandelbrot::default();
            *field(&mut raw) = bad;
            assert_eq!(WeierstrassMandelbrot::try_from(raw).unwrap_err().key, name, "{bad}");
        }
    }
}

#[test]
fn val_relief_below_rounding_is_an_error() {
    let s = surface(json!({"size_px": [20, 20], "sampling_length_m": 1e12, "frequencies": 3}));
    assert!(matches!(s.surface(&streams()), Err(TerrainError::NoRelief { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    /// Any parameters are refused, give an error, or give finite heights of the stated shape.
    #[test]
    fn prop_any_parameters_are_refused_or_give_finite_heights(
        px in prop::array::uniform2(0u32..40), cell in any::<f64>(), ridges in 0u32..20, frequencies in 0u32..2000,
        ratio in 0.9f64..4.0, dimension in 1.9f64..3.1, length_log in -30i32..30, scale_log in -30i32..30, paper: bool,
    ) {
        let mode = if paper { Mode::Paper } else { Mode::BandLimited };
        let power = |log: i32| libm::pow(10.0, f64::from(log));
        for cell_m in [cell, 0.05] {
            let raw = RawWeierstrassMandelbrot {
                size_m: None, size_px: Some(px), cell_m, ridges, frequencies, frequency_ratio: ratio,
                fractal_dimension: dimension, sampling_length_m: power(length_log), elevation_scale_m: power(scale_log),
                phase_max_rad: 6.0, mode,
            };
            let made = WeierstrassMandelbrot::try_from(raw).ok().and_then(|s| s.surface(&streams()).ok());
            if let Some(heights) = made {
                prop_assert_eq!([heights.cols() as u32, heights.rows() as u32], px);
                prop_assert_eq!(heights.finite_count(), heights.values.len());
            }
        }
    }
}
