use super::*;
use proptest::prelude::*;
use sastrugi_roughness::trace_moments::{BoxMoments, moment_exponents, trace_moments};
use serde_json::json;

fn made(params: Value, seed: u64) -> Terrain {
    let generator = crate::prepare(KIND, &params).unwrap();
    generator.generate(&Streams::for_seed(seed, "terrain"), &[]).unwrap()
}

fn cascade(params: Value) -> Cascade {
    Cascade::try_from(crate::registry::read::<RawCascade>(&params).unwrap()).unwrap()
}

/// The flux and its integral equal their definitions, mode by mode, on a small surface.
#[test]
fn val_flux_and_heights_equal_the_definition() {
    let c = cascade(json!({"size_px": [6, 5], "cell_m": 0.5, "outer_scale_m": 2.0, "codimension": 0.3}));
    let [rows, cols] = c.shape;
    let n = (rows * cols) as f64;
    let mut stream = Streams::for_seed(2, "terrain").stream("cascade");
    let noise: Vec<f64> = (0..rows * cols).map(|_| stream.normal()).collect();
    let turn =
        |k: usize, l: usize| libm::sincos(std::f64::consts::TAU * (k as f64 / rows as f64 + l as f64 / cols as f64));
    let signed = |k: usize, n: usize| if 2 * k > n { k as f64 - n as f64 } else { k as f64 };
    // Multiplies the modes of a real field by a function of frequency.
    let filtered = |field: &[f64], factor: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let mut out = vec![0.0; rows * cols];
        for (ky, kx) in (0..rows).flat_map(|ky| (0..cols).map(move |kx| (ky, kx))) {
            let fy = signed(ky, rows) / (rows as f64 * 0.5);
            let fx = signed(kx, cols) / (cols as f64 * 0.5);
            let gain = factor((fx * fx + fy * fy).sqrt());
            let (mut re, mut im) = (0.0, 0.0);
            for (p, v) in field.iter().enumerate() {
                let (sin, cos) = turn(ky * (p / cols) % rows, kx * (p % cols) % cols);
                re += v * cos;
                im -= v * sin;
            }
            for (p, o) in out.iter_mut().enumerate() {
                let (sin, cos) = turn(ky * (p / cols) % rows, kx * (p % cols) % cols);
                *o += gain * (re * cos - im * sin) / n;
            }
        }
        out
    };
    let area = n * 0.25;
    let variance = |f: f64| if (0.5..=1.0).contains(&f) { 0.3 / (PI * f * f) / area } else { 0.0 };
    let gamma = filtered(&noise, &|f| (variance(f) * n).sqrt());
    let ones: f64 = (0..rows * cols)
        .map(|k| {
            let fy = signed(k / cols, rows) / (rows as f64 * 0.5);
            let fx = signed(k % cols, cols) / (cols as f64 * 0.5);
            variance((fx * fx + fy * fy).sqrt())
        })
        .sum();
    let flux: Vec<f64> = gamma.iter().map(|g| libm::exp(g - 0.5 * ones)).collect();
    let transform = RealFft2::new(rows, cols);
    let fast = c.flux(&transform, &Streams::for_seed(2, "terrain"));
    assert!(fast.iter().zip(&flux).all(|(a, b)| (a - b).abs() < 1e-12), "{fast:?} {flux:?}");
    let slow = filtered(&flux, &|f| libm::pow(f.max(0.5), -0.66));
    let fast = c.integrated(&transform, &fast);
    assert!(fast.iter().zip(&slow).all(|(a, b)| (a - b).abs() < 1e-11));
}

/// The periodic surface is wider than the terrain by the outer scale, which is the shorter side unless it is given.
#[test]
fn val_the_periodic_surface_is_wider_by_the_outer_scale() {
    let plain = cascade(json!({"size_px": [200, 150]}));
    assert!((plain.outer_scale_m - 7.5).abs() < 1e-12);
    // 150 + 150 rows and 200 + 150 columns, up to the next length of the transform.
    assert!((300..=324).contains(&plain.shape[0]) && (350..=375).contains(&plain.shape[1]), "{:?}", plain.shape);
    let short = cascade(json!({"size_px": [200, 150], "outer_scale_m": 2.0}));
    assert!((190..=200).contains(&short.shape[0]) && (240..=250).contains(&short.shape[1]), "{:?}", short.shape);
}

/// Heights are the integral in one corner of the periodic surface, less its mean there and scaled with its own sign; the map is the flux there.
#[test]
fn val_the_terrain_is_a_corner_of_the_periodic_surface() {
    let params = json!({"size_px": [20, 14], "rms_height_m": 0.3});
    let (c, terrain) = (cascade(params.clone()), made(params, 4));
    let transform = RealFft2::new(c.shape[0], c.shape[1]);
    let flux = c.flux(&transform, &Streams::for_seed(4, "terrain"));
    let integral = c.integrated(&transform, &flux);
    let corner = |values: &[f64]| -> Vec<f64> { (0..280).map(|k| values[k / 20 * c.shape[1] + k % 20]).collect() };
    assert_eq!(terrain.maps[0].values.values, corner(&flux));
    let wanted = corner(&integral);
    let (mean, rms) = (sums::mean(&wanted), sums::variance(&wanted).sqrt());
    for (z, w) in terrain.heights.values.iter().zip(&wanted) {
        assert!((z - 0.3 * (w - mean) / rms).abs() < 1e-12, "{z}");
    }
}

#[test]
fn val_heights_have_the_rms_and_come_with_the_flux() {
    let terrain = made(json!({"size_px": [200, 150], "rms_height_m": 0.7}), 1);
    assert!((sums::variance(&terrain.heights.values).sqrt() - 0.7).abs() < 1e-12);
    assert!(sums::mean(&terrain.heights.values).abs() < 1e-12);
    assert!((terrain.maps[0].name, terrain.maps[0].values.geometry) == ("flux", terrain.heights.geometry));
    assert!(terrain.maps[0].values.values.iter().all(|v| *v > 0.0));
    assert!(terrain.notes[0].contains("zeta(2)") && terrain.notes[0].contains("expected 1.080"), "{:?}", terrain.notes);
}

/// Null: K(q) = C1 (q^2 - q) and zeta(q) = q H - K(q). 48 surfaces of 256 x 256; threshold 5 standard errors over the surfaces
/// (t with 47 degrees of freedom: 8e-6 for each of 10 statistics). zeta is allowed 0.04 more: the structure functions bend at the cell,
/// where waves end, and at the outer scale; zeta(1) is 0.026 too low and zeta(2) 0.029 too high here, and at 1024 cells zeta(1) is 0.021
/// too low. Detects an error in C1 of a tenth by K, of a third by zeta.
#[test]
#[ignore = "slow: 96 cascades"]
fn stat_moments_and_increments_scale_as_stated() {
    let orders = [0.5, 1.5, 2.0];
    for codimension in [0.05, 0.12] {
        let params = json!({"size_px": [256, 256], "codimension": codimension});
        let surfaces: Vec<Terrain> = (0..48).map(|seed| made(params.clone(), seed)).collect();
        let moments: Vec<Vec<BoxMoments>> =
            surfaces.iter().map(|s| trace_moments(&s.maps[0].values, &orders)).collect();
        for e in moment_exponents(&moments, &orders).unwrap() {
            let expected = codimension * (e.order * e.order - e.order);
            println!(
                "C1 = {codimension}: K({}) = {:.4} +- {:.4}, expected {expected:.4}",
                e.order, e.exponent, e.standard_error
            );
            assert!((e.exponent - expected).abs() < 5.0 * e.standard_error, "{e:?} {expected}");
        }
        let generator = cascade(params);
        for q in 1..=2 {
            let zetas: Vec<f64> = surfaces.iter().map(|s| scaling_exponents(&s.heights).unwrap()[q - 1].zeta).collect();
            let (mean, expected) = (sums::mean(&zetas), generator.expected_zeta(q as u32));
            let standard_error = (sums::variance(&zetas) / 47.0).sqrt();
            println!("C1 = {codimension}: zeta({q}) = {mean:.4} +- {standard_error:.4}, expected {expected:.4}");
            assert!((mean - expected).abs() < 5.0 * standard_error + 0.04, "zeta({q}) {mean} {expected}");
        }
    }
}

#[test]
fn prop_thread_count_changes_no_bit() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| made(json!({"size_px": [90, 70]}), 5))
    };
    assert_eq!(on(1), on(3));
    assert_ne!(on(1).heights, made(json!({"size_px": [90, 70]}), 6).heights);
}

/// `3 * 0.7 / 0.7` is below 3 in double precision.
#[test]
fn val_three_cells_of_any_size_are_enough() {
    for cell_m in [0.05, 0.35, 0.37, 0.39, 0.7] {
        let terrain = made(json!({"size_px": [3, 5], "cell_m": cell_m}), 1);
        assert_eq!(terrain.heights.values.len(), 15, "{cell_m}");
    }
    let error =
        crate::prepare(KIND, &json!({"size_px": [3, 5], "outer_scale_m": 0.149, "cell_m": 0.05})).err().unwrap();
    assert_eq!(error.key, "outer_scale_m");
}

#[test]
fn val_impossible_parameters_are_refused() {
    let refused = |params: Value| crate::prepare(KIND, &params).err().unwrap().key;
    for (key, bad) in [
        ("codimension", 0.0),
        ("codimension", 1.0),
        ("hurst_exponent", 0.0),
        ("hurst_exponent", 1.0),
        ("outer_scale_m", 0.1),
        ("outer_scale_m", 1e9),
        ("rms_height_m", -1.0),
    ] {
        assert_eq!(refused(json!({key: bad})), key);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// For any parameters, heights are finite and not flat, or an error gives the reason.
    #[test]
    fn prop_no_flat_surface(cols in 3u32..40, rows in 3u32..40, c1 in 0.001f64..0.99, h in 0.01f64..0.99, seed: u64) {
        let generator = crate::prepare(KIND, &json!({"size_px": [cols, rows], "codimension": c1, "hurst_exponent": h})).unwrap();
        match generator.generate(&Streams::for_seed(seed, "terrain"), &[]) {
            Ok(made) => {
                let (low, high) = made.heights.range().unwrap();
                prop_assert!(made.heights.finite_count() == made.heights.values.len() && high > low);
            }
            Err(error) => prop_assert!(matches!(error, TerrainError::Unrepresentable { .. }), "{error}"),
        }
    }
}
