//! Windows of one elaborated DEM, as a server requests them.

use super::*;
use crate::windows::Windows;

fn surface(params: Value, inputs: &[Input]) -> Elaborated {
    let mut all = json!({"dem": "site", "cell_m": 0.16, "basic_spacing_m": 0.01, "origin_m": [105.0, 205.0], "size_px": [16, 16]});
    all.as_object_mut().unwrap().extend(params.as_object().unwrap().clone());
    let form = Elaborate::try_from(crate::registry::read::<RawElaborate>(&all).unwrap()).unwrap();
    form.elaborated(&streams(), inputs).unwrap()
}

fn request(zoom: u32, first: [i64; 2], [cols, rows]: [usize; 2], least_m: f64) -> Request<'static> {
    let window = Window { zoom, west: first[0], south: first[1], cols, rows, centred: false };
    Request { window, feature_min_m: least_m, cancel: None }
}

/// The window of the parameters has the bits of the generator; windows of other zooms, centred ones and single points have the samples of finer
/// ones.
#[test]
fn prop_windows_are_of_one_surface() {
    let dem = site(40, 40, [1.28, 1.28]);
    let points = json!([[118.3, 219.1, 9.0], [121.0, 222.2, 8.0, 0.5]]);
    let params = json!({"processes": processes(), "altimetry_points_m": points, "size_px": [70, 60], "origin_m": [112.0, 214.4]});
    let made = refined(params.clone(), &dem);
    let all = surface(params, &[dem.into()]);
    let [west, south] = [(112.0 / 0.16_f64).round() as i64, (214.4 / 0.16_f64).round() as i64];
    let own = all.patch_for(&request(4, [west, south], [70, 60], 0.0)).unwrap();
    for row in 0..60 {
        for col in 0..70 {
            assert_eq!(own.heights[row * 70 + col].to_bits(), made.heights.at(59 - row, col).to_bits(), "{row} {col}");
        }
    }
    let fine = all.patch_for(&request(3, [2 * west, 2 * south], [140, 120], 0.0)).unwrap();
    let centred = Window { zoom: 4, west, south, cols: 70, rows: 60, centred: true };
    let centred = all.patch_for(&Request { window: centred, feature_min_m: 0.0, cancel: None }).unwrap();
    let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
    for (row, col) in (0..60).flat_map(|row| (0..70).map(move |col| (row, col))) {
        let k = row * 70 + col;
        assert!(same(own.heights[k], fine.heights[2 * row * 140 + 2 * col]));
        assert!(same(centred.heights[k], fine.heights[(2 * row + 1) * 140 + 2 * col + 1]));
        assert_eq!(own.class[k], fine.class[2 * row * 140 + 2 * col]);
    }
    assert!(own.class.contains(&1));
    for k in (0..own.heights.len()).step_by(97) {
        let alone = request(4, [west + (k % 70) as i64, south + (k / 70) as i64], [1, 1], 0.0);
        assert!(same(all.patch_for(&alone).unwrap().heights[0], own.heights[k]));
    }
}

/// Posts are kept whatever features are left out.
#[test]
fn val_bounded_windows_keep_the_posts() {
    let dem = site(40, 40, [1.28, 1.28]);
    let all = surface(json!({"processes": processes(), "origin_m": [112.0, 208.0]}), &[dem.clone().into()]);
    // 100 m and 200 m are whole cells of 0.16 m: every eighth sample is a post.
    let [west, south] = [103.84, 203.84].map(|at: f64| (at / 0.16).round() as i64);
    let patch = all.patch_for(&request(4, [west, south], [160, 160], 1.28)).unwrap();
    for (j, i) in (0..20).flat_map(|j| (0..20).map(move |i| (j, i))) {
        let (height, ours) = (dem.at(36 - j, 3 + i), patch.heights[8 * j * 160 + 8 * i]);
        assert!((ours - height).abs() < 1e-6, "{i} {j}: {ours} {height}");
    }
}

/// There is no ground beyond the outer posts and near posts without data; where exactly depends on the sample alone. Elsewhere the ground is the same
/// as without the hole.
#[test]
fn val_holes_and_edges_have_no_ground() {
    let dem = site(60, 60, [1.28, 1.28]);
    let mut holed = dem.clone();
    for k in [30 * 60 + 30, 30 * 60 + 31, 12 * 60 + 50] {
        holed.values[k] = f64::NAN;
    }
    let points = json!([[118.3, 219.1, 9.0]]);
    let given = json!({"hurst": 0.7, "roughness_m": 0.05});
    let more = json!({"hurst": 0.7, "roughness_m": 0.05, "processes": processes(), "altimetry_points_m": points});
    // Posts that a sample depends on: two on either side; with processes and altimetry, 8 and one more.
    for (given, reach) in [(given, 2.0), (more, 2.0 + 8.0 + 1.5)] {
        let (whole, all) = (surface(given.clone(), &[dem.clone().into()]), surface(given, &[holed.clone().into()]));
        let asked = request(5, [300, 620], [300, 300], 1.0);
        let (patch, right) = (all.patch_for(&asked).unwrap(), whole.patch_for(&asked).unwrap());
        let g = &dem.geometry;
        let mut counts = [0; 3];
        for k in 0..patch.heights.len() {
            let place = all.place([asked.window.x(k % 300), asked.window.y(k / 300)]);
            let inside = place[0] >= g.x(0) && place[0] <= g.x(59) && place[1] >= g.y(59) && place[1] <= g.y(0);
            let from = |row: usize, col: usize| {
                [place[0] - g.x(col), place[1] - g.y(row)].iter().fold(0.0, |most: f64, d| most.max(d.abs() / 1.28))
            };
            let from_hole = from(30, 30).min(from(30, 31)).min(from(12, 50));
            let kind = match (patch.heights[k].is_nan(), inside) {
                (true, false) => 0,
                (true, true) => {
                    assert!(from_hole < reach + 0.01, "{place:?}");
                    1
                }
                (false, true) => {
                    assert!((patch.heights[k] - right.heights[k]).abs() < 1e-9, "{place:?}");
                    assert!(from_hole > reach - 1.01, "{place:?}");
                    2
                }
                (false, false) => panic!("ground beyond the posts at {place:?}"),
            };
            counts[kind] += 1;
        }
        assert!(counts.iter().all(|n| *n > 100), "{counts:?}");
        // Points and small windows along the edges of the holes.
        let ([west, south], side) = ([asked.window.west, asked.window.south], 300);
        for k in (0..side * side).step_by(61) {
            let (col, row) = (k % side, k / side);
            let size = [1 + k % 7, 1 + k % 5].map(|n| n.min(side - col.max(row)));
            let part = all.patch_for(&request(5, [west + col as i64, south + row as i64], size, 1.0)).unwrap();
            for (n, z) in part.heights.iter().enumerate() {
                let own = patch.heights[(row + n / size[0]) * side + col + n % size[0]];
                assert!(z.to_bits() == own.to_bits() || (z.is_nan() && own.is_nan()), "{row} {col} {n}: {z} {own}");
            }
        }
    }
}

/// A sample exactly on an outer post has ground, alone and in a window.
#[test]
fn val_the_outer_posts_have_ground() {
    let dem = site(40, 40, [1.28, 1.28]);
    let all = surface(json!({"hurst": 0.7, "roughness_m": 0.05}), &[dem.clone().into()]);
    let g = &dem.geometry;
    let (post, zero) = ([g.x(39), g.y(0)], all.place([0.0; 2]));
    let corner = [0, 1].map(|a| ((post[a] - zero[a]) / 0.01).round() as i64);
    let alone = all.patch_for(&request(0, corner, [1, 1], 0.0)).unwrap().heights[0];
    assert!((alone - dem.at(0, 39)).abs() < 0.01, "{alone}");
    let beside = all.patch_for(&request(0, [corner[0] - 40, corner[1] - 40], [41, 41], 0.0)).unwrap();
    assert_eq!(beside.heights[41 * 41 - 1].to_bits(), alone.to_bits());
}
