use super::route::Lattice;
use super::*;
use proptest::prelude::*;
use sastrugi_numeric::{Streams, sums};
use serde_json::{Value, json};
use std::f64::consts::TAU;

const SIZE_M: f64 = 40.0;

/// 40 m square at 10 cm, away from the origin of the coordinates.
fn geometry() -> Geometry {
    Geometry { origin: [100.0, -50.0], ..Geometry::square(400, 400, 0.1) }
}

fn grid(geometry: Geometry, height: impl Fn(f64, f64) -> f64) -> Grid {
    let at = |k: usize| {
        let (x, y) = (geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
        height(x - geometry.origin[0], y - geometry.origin[1])
    };
    Grid::new(geometry, (0..geometry.len()).map(at).collect())
}

/// Hills: 30 plane waves of 8 to 30 m, in random directions and phases.
fn hills(seed: u64) -> Grid {
    let mut stream = Streams::for_seed(seed, "test").stream("waves");
    let wave = |_: u32| {
        let length_m = stream.uniform_in(8.0, 30.0);
        let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
        (TAU * cos / length_m, TAU * sin / length_m, stream.uniform_in(0.0, TAU))
    };
    let waves: Vec<_> = (0..30).map(wave).collect();
    grid(geometry(), |x, y| waves.iter().map(|w| 0.3 * libm::cos(w.0 * x + w.1 * y + w.2)).sum())
}

fn trail(params: Value) -> Trail {
    Trail::new(&serde_json::from_value(params).unwrap(), &geometry()).unwrap()
}

fn laid(params: Value, before: &Grid) -> (Grid, Vec<[f64; 2]>) {
    let mut z = before.clone();
    let line = trail(params).lay(&mut z).unwrap();
    (z, line)
}

fn mean_height(z: &Grid, points_m: &[[f64; 2]]) -> f64 {
    sums::mean(&points_m.iter().map(|&[x, y]| z.height(x, y).unwrap()).collect::<Vec<_>>())
}

/// Distance from a point to a polyline, m.
fn distance_to(points_m: &[[f64; 2]], at: [f64; 2]) -> f64 {
    let to = |w: &[[f64; 2]]| {
        let [dx, dy] = [w[1][0] - w[0][0], w[1][1] - w[0][1]];
        let t = (((at[0] - w[0][0]) * dx + (at[1] - w[0][1]) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        let (x, y) = (at[0] - w[0][0] - t * dx, at[1] - w[0][1] - t * dy);
        (x * x + y * y).sqrt()
    };
    points_m.windows(2).map(to).fold(f64::INFINITY, f64::min)
}

/// A ridge `z = cos(2 pi d / 40)` about the arc `y = x + 8 sin(pi x / 40)` (d the offset in y): the ridge trail
/// keeps to the crest between its ends, and the valley trail, which must descend from one corner and climb to the other, is lower than the
/// diagonal.
#[test]
fn val_ridge_and_valley_of_one_wave() {
    let offset = |x: f64, y: f64| y - x - 8.0 * libm::sin(0.5 * TAU * x / SIZE_M);
    let wave = grid(geometry(), |x, y| libm::cos(TAU * offset(x, y) / 40.0));
    let [ridge, valley] = ["ridges", "valleys"].map(|follows| laid(json!({ "follows": follows }), &wave).1);
    let [diagonal, on_ridge, in_valley] = [&vec![ridge[0], ridge[ridge.len() - 1]], &ridge, &valley].map(|line| {
        let line: Vec<[f64; 2]> = if line.len() > 2 {
            line.clone()
        } else {
            (0..=100)
                .map(|k| [0, 1].map(|axis| line[0][axis] + f64::from(k) / 100.0 * (line[1][axis] - line[0][axis])))
                .collect()
        };
        mean_height(&wave, &line)
    });
    assert!(on_ridge > 0.97 && diagonal < 0.8 && in_valley < diagonal - 0.15, "{on_ridge} {diagonal} {in_valley}");
    let inner = ridge.iter().filter(|[x, _]| (110.0..130.0).contains(x));
    let off_crest = inner.map(|&[x, y]| offset(x - 100.0, y + 50.0).abs()).max_by(f64::total_cmp).unwrap();
    assert!(off_crest < 2.5, "{off_crest}");
}

/// Null: a trail is as high as the straight line between its corners. On 12 surfaces all ridge trails are higher than the
/// straight line and all valley trails lower; the probability by chance is 2^-24 = 6e-8.
#[test]
fn stat_ridge_trails_are_high_and_valley_trails_low() {
    for seed in 0..12 {
        let z = hills(seed);
        let straight = laid(json!({ "attraction": 0.0 }), &z).1;
        let [ridge, valley] =
            ["ridges", "valleys"].map(|follows| mean_height(&z, &laid(json!({ "follows": follows }), &z).1));
        let level = mean_height(&z, &straight);
        assert!(ridge > level && valley < level, "{seed}: {ridge} {level} {valley}");
    }
}

/// Without attraction, and on level ground, the trail is the diagonal; the loop is the ellipse.
#[test]
fn val_level_ground_gives_plain_courses() {
    let level = Grid::filled(geometry(), 2.0);
    for [x, y] in laid(json!({}), &level).1 {
        assert!((x - 100.0 - (y + 50.0)).abs() < 1e-9);
    }
    for [x, y] in laid(json!({"follows": "loop"}), &level).1 {
        let radius_m = ((x - 120.0) * (x - 120.0) + (y + 30.0) * (y + 30.0)).sqrt();
        assert!((radius_m - 16.0).abs() < 0.02, "{radius_m}");
    }
}

/// A loop closes, goes once around the centre within its bounds, and is gentler than the ellipse that it started from.
#[test]
fn val_loops_close_over_gentle_slopes() {
    for seed in 0..6 {
        let z = hills(seed);
        let line = laid(json!({"follows": "loop"}), &z).1;
        assert_eq!(line.first(), line.last());
        let polar = |p: &[f64; 2]| libm::atan2(p[1] + 30.0, p[0] - 120.0);
        let turns = line.windows(2).map(|w| polar(&w[1]) - polar(&w[0])).map(|t| if t < -3.0 { t + TAU } else { t });
        let turns: Vec<f64> = turns.collect();
        assert!(turns.iter().all(|t| *t > 0.0) && (sums::sum(&turns) - TAU).abs() < 1e-9);
        for [x, y] in &line {
            let share = ((x - 120.0) * (x - 120.0) + (y + 30.0) * (y + 30.0)).sqrt() / 16.0;
            assert!((0.9 - 1e-9..=1.0626).contains(&share), "{share}");
        }
        let ellipse = laid(json!({"follows": "loop", "loop_wander_share": 0.0}), &z).1;
        let [fitted, plain] = [&line, &ellipse].map(|line| {
            let heights: Vec<f64> = line.iter().map(|&[x, y]| z.height(x, y).unwrap()).collect();
            sums::sum(&heights.windows(2).map(|w| (w[1] - w[0]) * (w[1] - w[0])).collect::<Vec<_>>())
        });
        assert!(fitted < plain, "{seed}: {fitted} {plain}");
    }
}

/// No three successive points turn more tightly than requested; nor, to 2 %, do points four apart, the scale that a vehicle notices.
#[test]
fn val_centre_lines_keep_the_turning_radius() {
    let radius_m = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        let side = |p: [f64; 2], q: [f64; 2]| ((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1])).sqrt();
        let (p, q, r) = (side(a, b), side(b, c), side(c, a));
        let s = 0.5 * (p + q + r);
        p * q * r / (4.0 * (s * (s - p) * (s - q) * (s - r)).max(0.0).sqrt())
    };
    for (follows, turning_radius_m) in [("ridges", 4.0), ("valleys", 8.0), ("loop", 5.0)] {
        let line = laid(json!({"follows": follows, "turning_radius_m": turning_radius_m}), &hills(3)).1;
        for (apart, share) in [(1, 1.0), (4, 0.98)] {
            let triples = line.windows(2 * apart + 1).map(|w| radius_m(w[0], w[apart], w[2 * apart]));
            let tightest = triples.fold(f64::INFINITY, f64::min);
            assert!(tightest >= share * turning_radius_m - 1e-6, "{follows} {apart}: {tightest}");
        }
        if follows == "loop" {
            // Where the loop closes: its last point is its first.
            let seam = radius_m(line[line.len() - 2], line[0], line[1]);
            assert!(seam >= turning_radius_m - 1e-6, "{seam}");
        }
    }
}

/// On level ground the ruts lie half a track from the line, as deep as the power law states, and everything else is level or berm.
#[test]
fn val_ruts_have_their_depth_and_position() {
    let level = Grid::filled(geometry(), 1.0);
    for (passes, coefficient, depth_m) in [(1, 3.0, 0.08), (8, 3.0, 0.16), (0, 3.0, 0.0)] {
        let params = json!({"rut_depth_m": 0.08, "passes": passes, "multipass_coefficient": coefficient});
        let (z, line) = laid(params, &level);
        let deepest = z.values.iter().fold(f64::INFINITY, |low, z| low.min(*z));
        assert!((deepest - (1.0 - depth_m)).abs() < 1e-12, "{deepest}");
        // 1.25 times the tyre's 0.25 m, over a berm of 0.5 m.
        let highest = z.values.iter().fold(f64::NEG_INFINITY, |high, z| high.max(*z));
        assert!((highest - (1.0 + 0.625 * depth_m)).abs() < 0.02 * depth_m + 1e-12, "{highest}");
        for k in (0..z.values.len()).filter(|&k| z.values[k] < 1.0 - 0.999 * depth_m && passes > 0) {
            let at = [z.geometry.x(k % 400), z.geometry.y(k / 400)];
            assert!((distance_to(&line, at) - 0.8).abs() <= 0.125 + 1e-9);
        }
    }
}

/// Berms hold their share of the displaced volume, along curves too, to within 1 % (cells of 2.5 cm under tyres of 25 cm).
#[test]
fn val_berms_hold_the_volume_of_the_ruts() {
    let geometry = Geometry { origin: [100.0, -50.0], ..Geometry::square(1040, 1040, 0.025) };
    for follows in ["loop", "ridges"] {
        for share in [1.0, 0.4] {
            let mut z = Grid::filled(geometry, 0.0);
            let raw =
                serde_json::from_value(json!({"follows": follows, "berm_share": share, "border_m": 2.2})).unwrap();
            Trail::new(&raw, &geometry).unwrap().lay(&mut z).unwrap();
            let volume = |part: fn(f64) -> f64| sums::sum(&z.values.iter().map(|z| part(*z)).collect::<Vec<_>>());
            let (ruts, berms) = (volume(|z| -z.min(0.0)), volume(|z| z.max(0.0)));
            assert!((berms / ruts - share).abs() < 0.01, "{follows} {share}: {}", berms / ruts);
        }
    }
}

/// Beyond half the width no bit changes; between the shoulders, without ruts, the bed is level across.
#[test]
fn val_only_the_trail_changes() {
    let before = hills(5);
    for follows in ["ridges", "valleys", "loop"] {
        let (after, line) = laid(json!({"follows": follows, "passes": 0}), &before);
        let mut changed = 0;
        let mut levels: Vec<(f64, f64)> = Vec::new();
        let along = line[line.len() / 2];
        for k in 0..after.values.len() {
            let at = [after.geometry.x(k % 400), after.geometry.y(k / 400)];
            let same = after.values[k].to_bits() == before.values[k].to_bits();
            if !same {
                changed += 1;
                assert!(distance_to(&line, at) < 2.0);
            }
            let near = line[line.len() / 2 + 1];
            let (dx, dy) = (near[0] - along[0], near[1] - along[1]);
            let length = (dx * dx + dy * dy).sqrt();
            let (ahead, left) = (
                ((at[0] - along[0]) * dx + (at[1] - along[1]) * dy) / length,
                ((at[1] - along[1]) * dx - (at[0] - along[0]) * dy) / length,
            );
            if ahead.abs() < 0.08 && left.abs() < 1.2 {
                levels.push((left, after.values[k]));
            }
        }
        assert!(changed > 4000, "{changed}");
        let (low, high) = levels.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v.1), h.max(v.1)));
        assert!(levels.len() > 20 && high - low < 0.05, "{follows}: {low} {high} of {}", levels.len());
    }
}

/// Position along the diagonal from its lower end and offset from it of a cell, m: without attraction the trail runs from (3, 3) to (37, 37) m.
fn along_and_across(k: usize) -> (f64, f64) {
    let (x, y) = (0.1 * ((k % 400) as f64 + 0.5), 0.1 * (399.5 - (k / 400) as f64));
    ((x + y - 6.0) / 2f64.sqrt(), (y - x) / 2f64.sqrt())
}

/// A Gaussian of standard deviation s leaves `exp(-(k s)^2 / 2)` of waves `cos(k d)` along the trail. On the bed, away from the ends; linear
/// interpolation between points of the line that are 0.34 m apart misses up to 0.003.
#[test]
fn val_smoothing_along_the_trail_is_gaussian() {
    let wavenumber = TAU / 15.0;
    let waves = grid(geometry(), |x, y| libm::cos(wavenumber * (x + y) / 2f64.sqrt()));
    for (smoothing_m, kept) in [(0.0, 1.0), (1.5, 0.820_869), (3.0, 0.454_041)] {
        let params = json!({"passes": 0, "attraction": 0.0, "smoothing_m": smoothing_m});
        let after = laid(params, &waves).0;
        let mut checked = 0;
        for k in 0..after.values.len() {
            let (along, across) = along_and_across(k);
            if (14.0..34.0).contains(&along) && across.abs() < 1.0 {
                assert!((after.values[k] - kept * waves.values[k]).abs() < 0.006, "{smoothing_m}: {along} {across}");
                checked += 1;
            }
        }
        assert!(checked > 3000, "{checked}");
    }
}

/// On ground that tilts across the trail, the bed is level on the line and blends into the ground with `w = 3 t^2 - 2 t^3`,
/// `t = (2 m - u) / 0.75 m`.
#[test]
fn val_shoulders_blend_with_the_stated_weight() {
    let tilted = grid(geometry(), |x, y| 0.3 * (y - x) / 2f64.sqrt());
    let after = laid(json!({"passes": 0, "attraction": 0.0}), &tilted).0;
    let mut checked = 0;
    for k in (0..after.values.len()).filter(|&k| (1.0..47.0).contains(&along_and_across(k).0)) {
        let across = along_and_across(k).1;
        let t = ((2.0 - across.abs()) / 0.75).clamp(0.0, 1.0);
        let wanted = (1.0 - t * t * (3.0 - 2.0 * t)) * 0.3 * across;
        assert!((after.values[k] - wanted).abs() < 1e-9, "{across}: {} {wanted}", after.values[k]);
        checked += usize::from(t > 0.0 && t < 1.0);
    }
    assert!(checked > 1000, "{checked}");
}

/// At open ends ruts fade in over one trail width, 4 m, with `3 t^2 - 2 t^3`.
#[test]
fn val_ruts_fade_in_at_open_ends() {
    let after = laid(json!({"rut_depth_m": 0.08, "attraction": 0.0}), &Grid::filled(geometry(), 1.0)).0;
    let mut checked = 0;
    for k in 0..after.values.len() {
        let (along, across) = along_and_across(k);
        if (0.1..24.0).contains(&along) && (across.abs() - 0.8).abs() < 0.12 {
            let t = (along / 4.0).min(1.0);
            let wanted = 1.0 - 0.08 * t * t * (3.0 - 2.0 * t);
            assert!((after.values[k] - wanted).abs() < 1e-9, "{along} {across}: {}", after.values[k]);
            checked += usize::from(t < 1.0);
        }
    }
    assert!(checked > 100, "{checked}");
}

/// On a plane the smoothed bed is the plane along the line, ends included, and level across it.
#[test]
fn val_the_bed_of_a_plane_is_its_profile() {
    let plane = grid(geometry(), |x, y| 0.2 * x + 0.1 * y);
    let (after, line) = laid(json!({"passes": 0, "attraction": 0.0}), &plane);
    for &[x, y] in &line {
        let expected = 0.2 * (x - 100.0) + 0.1 * (y + 50.0);
        assert!((after.height(x, y).unwrap() - expected).abs() < 0.01);
    }
}

/// The path of least cost by relaxing every edge until nothing changes (Bellman and Ford).
fn least_by_relaxation(lattice: &Lattice) -> f64 {
    let mut best = vec![f64::INFINITY; lattice.costs.len()];
    best[0] = 0.0;
    for _ in 0..lattice.costs.len() {
        for node in 0..lattice.costs.len() {
            for (next, length_m) in lattice.neighbours(node) {
                let cost = best[node] + 0.5 * length_m * (lattice.costs[node] + lattice.costs[next]);
                best[next] = best[next].min(cost);
            }
        }
    }
    best[best.len() - 1]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn prop_paths_have_the_least_cost(
        (cols, rows) in (2usize..9, 2usize..9),
        costs in prop::collection::vec(1.0..20.0f64, 64),
        step_m in prop::array::uniform2(0.5..2.0f64),
    ) {
        let lattice = Lattice { cols, rows, step_m, costs: costs[..cols * rows].to_vec() };
        let path = lattice.path();
        prop_assert_eq!((path[0], path[path.len() - 1]), (0, cols * rows - 1));
        let mut cost = 0.0;
        for pair in path.windows(2) {
            let (_, length_m) = lattice.neighbours(pair[0]).find(|(next, _)| *next == pair[1]).unwrap();
            cost += 0.5 * length_m * (lattice.costs[pair[0]] + lattice.costs[pair[1]]);
        }
        prop_assert!((cost - least_by_relaxation(&lattice)).abs() < 1e-9);
    }

    /// Any numbers are refused with a reason, or give a trail with finite heights on any surface.
    #[test]
    fn prop_any_trail_is_laid_or_refused(
        follows in prop::sample::select(vec!["ridges", "valleys", "loop"]),
        key in prop::sample::select(vec![
            "width_m", "shoulder_m", "smoothing_m", "track_m", "tyre_width_m", "rut_depth_m", "multipass_coefficient",
            "berm_width_m", "berm_share", "wheelbase_m", "turning_radius_m", "border_m", "attraction", "loop_share",
            "loop_wander_share",
        ]),
        value in prop_oneof![
            4 => 0.0..8.0f64,
            1 => prop::sample::select(vec![-1.0, 0.0, 1e-9, 1e-300, 0.5, 19.0, 1e9, 1e300]),
        ],
        flat in any::<bool>(),
    ) {
        let geometry = Geometry::square(120, 90, 0.25);
        let mut params = json!({"follows": follows, "turning_radius_m": 3.0, "width_m": 3.2});
        params[key] = json!(value);
        let raw: RawTrail = serde_json::from_value(params).unwrap();
        if let Ok(trail) = Trail::new(&raw, &geometry) {
            prop_assert_eq!(Trail::new(&trail.parameters, &geometry).unwrap().parameters, trail.parameters.clone());
            let mut z = grid(geometry, |x, y| if flat { 0.0 } else { libm::sin(0.7 * x) * libm::cos(0.5 * y) });
            if let Ok(line) = trail.lay(&mut z) {
                prop_assert!(z.values.iter().all(|z| z.is_finite()) && line.len() > 2);
            }
        }
    }
}

#[test]
fn val_impossible_trails_are_refused() {
    let refused = |params: Value| {
        let error = Trail::new(&serde_json::from_value(params).unwrap(), &geometry()).err().unwrap();
        (error.key, error.message)
    };
    for (params, key, word) in [
        (json!({"width_m": 0.1}), "width_m", "two cells"),
        (json!({"width_m": 2.9}), "width_m", "berms"),
        (json!({"shoulder_m": 2.5}), "shoulder_m", "half the width"),
        (json!({"smoothing_m": -1.0}), "smoothing_m", "0 or above"),
        (json!({"track_m": 0.5}), "track_m", "berms"),
        (json!({"berm_share": 1.5}), "berm_share", "0 to 1"),
        (json!({"multipass_coefficient": 0.5}), "multipass_coefficient", "1 or above"),
        (json!({"turning_radius_m": 1.0}), "turning_radius_m", "at least 2 m"),
        (json!({"border_m": 1.0}), "border_m", "2.1 to 18 m"),
        (json!({"follows": "loop", "attraction": 3.0}), "attraction", "loop"),
        (json!({"loop_share": 0.3}), "loop_share", "loop"),
        (json!({"follows": "loop", "loop_share": 0.1}), "loop_share", "3.60 m"),
        (json!({"follows": "loop", "loop_share": 0.48}), "loop_share", "border"),
        (json!({"follows": "loop", "loop_wander_share": 1.0}), "loop_wander_share", "below 1"),
    ] {
        let (found, message) = refused(params.clone());
        assert!(found == key && message.contains(word), "{params}: {found} {message}");
    }
    let mut holed = hills(1);
    (0..20 * 20).for_each(|k| holed.values[(190 + k / 20) * 400 + 190 + k % 20] = f64::NAN);
    let error = trail(json!({"attraction": 0.0})).lay(&mut holed).unwrap_err();
    assert!(error.to_string().starts_with("lay the trail: the ground has no height at x = 1"), "{error}");
}

/// Frozen 64-bit hashes of heights and line (FNV-1a over their bits). A deliberate change of trails refreshes the constants from
/// the message, and its commit states by how much they change.
#[test]
fn gold_trails() {
    let found = ["ridges", "valleys", "loop"].map(|follows| {
        let (z, line) = laid(json!({ "follows": follows }), &hills(7));
        let words = z.values.iter().chain(line.iter().flatten()).map(|v| v.to_bits());
        words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
    });
    assert_eq!(found, GOLD, "found {found:#x?}");
}
const GOLD: [u64; 3] = [0x08b5_3dc3_42cc_d6f7, 0xdf55_6687_f9a4_a6e9, 0xf14e_cdd6_c879_1dc3];
