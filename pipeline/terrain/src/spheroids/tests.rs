use super::*;
use proptest::prelude::*;
use serde_json::json;

fn made(params: Value, seed: u64) -> Grid {
    let generator = crate::prepare(KIND, &params).unwrap();
    generator.generate(&Streams::for_seed(seed, "terrain"), &[]).unwrap().heights
}

fn spheroids(params: Value) -> Spheroids {
    let raw: RawSpheroids = serde_json::from_value(params).unwrap();
    Spheroids::try_from(raw).unwrap()
}

/// The generator against the definition, node by node over all hills.
#[test]
fn val_bands_equal_the_definition() {
    for full_axis in [false, true] {
        let params = json!({"size_px": [71, 90], "cell_m": 0.5, "spheroids": 40, "major_max_px": 30, "minor_max_px": 9,
                            "full_axis": full_axis});
        let hills = spheroids(params.clone()).hills(&Streams::for_seed(3, "terrain"));
        let heights = made(params, 3);
        let slow =
            |row: usize, col: usize| hills.iter().filter_map(|h| h.at(col, row)).fold(0.0, |sum, z| sum + z * 0.5);
        assert!((0..90 * 71).all(|k| heights.values[k].to_bits() == f64::to_bits(slow(k / 71, k % 71))));
        assert!(heights.range().unwrap().1 > 1.0);
    }
}

#[test]
fn val_one_hill_is_half_a_spheroid() {
    let hill = Hill { centre: [50.0, 40.0], radius: 20.0, height: 5.0 };
    assert_eq!(hill.at(50, 40), Some(5.0));
    assert_eq!(hill.at(62, 40).map(|z| (z - 4.0).abs() < 1e-12), Some(true));
    assert_eq!((hill.at(70, 40), hill.at(50, 60)), (None, None));
    assert_eq!((hill.reach(0, 60), hill.reach(1, 100)), (30..60, 20..61));
}

/// Every hill has its centre on a node, 1 <= h <= r, and h and r within their bounds.
#[test]
fn prop_hills_stay_within_their_bounds() {
    let all = spheroids(json!({"size_px": [40, 50], "spheroids": 4000, "major_max_px": 7, "minor_max_px": 4}));
    let hills = all.hills(&Streams::for_seed(1, "terrain"));
    assert_eq!(hills.len(), 4000);
    assert!(hills.iter().all(|h| h.centre[0] < 40.0 && h.centre[1] < 50.0));
    assert!(hills.iter().all(|h| (1.0..=7.0).contains(&h.radius) && h.height >= 1.0 && h.height <= h.radius.min(4.0)));
    let has = |r: f64, h: f64| hills.iter().any(|hill| hill.radius == r && hill.height == h);
    assert!(has(1.0, 1.0) && has(7.0, 4.0) && has(2.0, 2.0));
}

/// Null: centres are uniform over the nodes, r over 1 to 7 and h over 1 to `min(4, r)`, so that the means are 19.5, 24.5, 4 and 2.0714 and the
/// deviations 11.54, 14.43, 2 and 1.078. Means of 4000 hills, threshold at 6 standard errors (2e-9 each).
#[test]
fn stat_hills_are_uniform() {
    let all = spheroids(json!({"size_px": [40, 50], "spheroids": 4000, "major_max_px": 7, "minor_max_px": 4}));
    let hills = all.hills(&Streams::for_seed(2, "terrain"));
    let check = |of: fn(&Hill) -> f64, mean: f64, deviation: f64| {
        let found = sastrugi_numeric::sums::mean(&hills.iter().map(of).collect::<Vec<_>>());
        assert!((found - mean).abs() < 6.0 * deviation / 4000f64.sqrt(), "{found} {mean}");
    };
    check(|hill| hill.centre[0], 19.5, 11.54);
    check(|hill| hill.centre[1], 24.5, 14.43);
    check(|hill| hill.radius, 4.0, 2.0);
    check(|hill| hill.height, 2.0714, 1.078);
}

#[test]
fn prop_thread_count_changes_no_bit() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| made(json!({"size_px": [200, 150], "preset": "very_rough"}), 5))
    };
    assert_eq!(on(1), on(3));
    assert_ne!(on(1), made(json!({"size_px": [200, 150], "preset": "very_rough"}), 6));
}

#[test]
fn val_impossible_parameters_are_refused() {
    for (key, value) in [("spheroids", json!(0)), ("major_max_px", json!(0)), ("minor_max_px", json!(0))] {
        let error = crate::prepare(KIND, &json!({key: value})).err().unwrap();
        assert_eq!(error.key, key);
    }
    let many = json!({"size_px": [1000, 1000], "spheroids": 1_000_000, "major_max_px": 1000});
    assert!(crate::prepare(KIND, &many).err().unwrap().message.contains("1e11"));
    let hilly = crate::prepare(KIND, &json!({"preset": "hilly"})).err().unwrap();
    assert!(hilly.message.contains("`hilly`") && hilly.message.contains("`very_rough`"), "{hilly}");
}

proptest! {
    /// For any parameters, heights are finite and there is a hill.
    #[test]
    fn prop_no_flat_surface(cols in 3u32..60, rows in 3u32..60, n in 1u32..9, major in 1u32..200, minor in 1u32..200, seed: u64) {
        let heights = made(json!({"size_px": [cols, rows], "spheroids": n, "major_max_px": major, "minor_max_px": minor}), seed);
        let (low, high) = heights.range().unwrap();
        prop_assert!(heights.finite_count() == heights.values.len() && low >= 0.0 && high >= 1.0);
    }
}

/// Share of nodes, in per cent, marked by the thesis's extraction without height-difference threshold (Bayrak, 2008, Algorithms 1 to 3 and
/// the filter of section 3.1, as read in docs/papers/bayrak.md): extrema and saddles that stand out, cells next to steps of more than 30
/// degrees, and the points that connect isolated ones.
fn vertex_percent(z: &Grid) -> f64 {
    let (rows, cols) = (z.rows(), z.cols());
    let inner = |r: usize, c: usize| r > 0 && c > 0 && r + 1 < rows && c + 1 < cols;
    let critical = |r: usize, c: usize| {
        let here = z.at(r, c);
        let signs = [z.at(r - 1, c), z.at(r + 1, c), z.at(r, c - 1), z.at(r, c + 1)].map(|n| here.total_cmp(&n) as i8);
        signs == [1; 4] || signs == [-1; 4] || signs == [1, 1, -1, -1] || signs == [-1, -1, 1, 1]
    };
    let first: Vec<bool> =
        (0..rows * cols).map(|k| inner(k / cols, k % cols) && critical(k / cols, k % cols)).collect();
    let stands_out = |k: usize| {
        let (r, c) = (k / cols, k % cols);
        let nearest: Vec<usize> = [
            (0..r).rev().map(|i| i * cols + c).find(|&n| first[n]),
            (r + 1..rows).map(|i| i * cols + c).find(|&n| first[n]),
            (0..c).rev().map(|j| r * cols + j).find(|&n| first[n]),
            (c + 1..cols).map(|j| r * cols + j).find(|&n| first[n]),
        ]
        .into_iter()
        .flatten()
        .collect();
        nearest.is_empty() || nearest.iter().any(|&n| (z.values[n] - z.values[k]).abs() > 1.0)
    };
    let steep_step = libm::tan(30f64.to_radians()) * z.geometry.cell[0];
    let steep = |a: usize, b: usize| (z.values[a] - z.values[b]).abs() > steep_step;
    let mut marked: Vec<bool> = (0..rows * cols).map(|k| first[k] && stands_out(k)).collect();
    for k in 0..rows * cols {
        for next in [(k % cols + 1 < cols).then_some(k + 1), (k / cols + 1 < rows).then_some(k + cols)] {
            if let Some(next) = next.filter(|&n| steep(k, n)) {
                marked[k] = true;
                marked[next] = true;
            }
        }
    }
    connect_isolated(&mut marked, rows, |line, at| line * cols + at, cols);
    connect_isolated(&mut marked, cols, |line, at| at * cols + line, rows);
    100.0 * marked.iter().filter(|m| **m).count() as f64 / marked.len() as f64
}

fn connect_isolated(marked: &mut [bool], lines: usize, index: impl Fn(usize, usize) -> usize, along: usize) {
    let mut last = None;
    for line in 0..lines {
        let on_it: Vec<usize> = (0..along).filter(|&at| marked[index(line, at)]).collect();
        if let [at] = on_it[..] {
            if let Some(last) = last {
                marked[index(last, at)] = true;
            }
            last = Some(line);
        }
    }
}

/// Published shares on 1000 x 1000 nodes (Bayrak, 2008, Table 5.1): 0.119, 0.71 and 3.16 %; over the three sizes 0.07 to 0.15, 0.7 to
/// 1.1 and 2.4 to 4.0 %. The mean over 12 of our maps must lie in that band. Single maps of an independent prototype scatter by 0.04, 0.14
/// and 0.4 %, means of 12 by a third of that.
#[test]
#[ignore = "slow: 36 maps of a million nodes"]
fn val_presets_lie_in_the_published_bands() {
    for (preset, low, high) in [("plain", 0.07, 0.15), ("rough", 0.7, 1.1), ("very_rough", 2.4, 4.0)] {
        let shares: Vec<f64> = (0..12).map(|seed| vertex_percent(&made(json!({"preset": preset}), seed))).collect();
        let mean = sastrugi_numeric::sums::mean(&shares);
        println!("{preset}: {mean:.3} % of nodes, {shares:.3?}");
        assert!((low..=high).contains(&mean), "{preset}: {mean} {shares:?}");
    }
}
