//! Surfaces through measured points.

use super::*;

/// Points between the posts of the site, off the lattice, a metre and more above and below the DEM: `[x, y, z]`.
fn points(dem: &Grid, count: usize) -> Vec<[f64; 3]> {
    let mut stream = Streams::for_seed(3, "test").stream("points");
    let background = Background::new(dem.clone());
    let mut points: Vec<[f64; 3]> = Vec::new();
    while points.len() < count {
        let [x, y] = [stream.uniform_in(104.0, 114.0), stream.uniform_in(204.0, 214.0)];
        let apart = |p: &[f64; 3]| (p[0] - x).abs().max((p[1] - y).abs()) > 0.4;
        // Away from posts: (100 + 1.28 i, 200 + 1.28 j).
        let from_post = [x - 100.0, y - 200.0].map(|d| (d / 1.28 - (d / 1.28).round()).abs());
        if points.iter().all(apart) && from_post[0].max(from_post[1]) > 0.25 {
            points.push([x, y, background.at([x, y]) + stream.uniform_in(-1.5, 1.5)]);
        }
    }
    points
}

fn with(points: &Value) -> Value {
    json!({
        "cell_m": 0.08, "basic_spacing_m": 0.08, "origin_m": [103.84, 203.84], "size_px": [140, 140],
        "altimetry_points_m": points
    })
}

/// A DEM on a slope of 30 %, with noise at every post.
fn steep_and_noisy() -> Grid {
    let dem = site(24, 24, [1.28, 1.28]);
    let mut noise = Streams::for_seed(8, "test").stream("noise");
    let g = dem.geometry;
    let values = (0..g.len()).map(|k| dem.values[k] + 0.3 * g.x(k % 24) + 0.02 * noise.normal()).collect();
    Grid::new(g, values)
}

/// The surface, bilinear between lattice points, passes through every point and every post, with slope, noise, craters and rocks.
#[test]
fn val_points_and_posts_are_exact() {
    for dem in [site(24, 24, [1.28, 1.28]), steep_and_noisy()] {
        let given = points(&dem, 24);
        let coarse = json!([
            {"kind": "rocks", "coverage": 0.118, "diameter_min_m": 0.1},
            {"kind": "primary_craters", "density": 0.05, "diameter_min_m": 0.4},
            {"kind": "albedo"}
        ]);
        for processes in [json!([]), coarse] {
            let mut params = with(&json!(given));
            params["processes"] = processes;
            let made = refined(params, &dem);
            for [x, y, z] in &given {
                let error = made.heights.height(*x, *y).unwrap() - z;
                assert!(error.abs() < 1e-6, "{error} m at {x}, {y}");
            }
            assert!(errors_at_posts(&made.heights, &dem, 60) < 1e-6);
            let note = made.notes.iter().find(|n| n.contains("altimetry")).unwrap();
            assert!(note.starts_with("altimetry points near the window: 24; they shift the surface by"), "{note}");
        }
    }
}

/// If samples are farther apart than lattice points, points on samples are exact.
#[test]
fn val_points_on_coarse_samples_are_exact() {
    let dem = site(24, 24, [1.28, 1.28]);
    let given = json!([[105.6, 206.4, 3.0], [107.68, 209.12, 1.0]]);
    let params = json!({"origin_m": [104.0, 204.0], "size_px": [60, 60], "altimetry_points_m": given});
    let made = refined(params, &dem).heights;
    let g = made.geometry;
    for [x, y, z] in [[105.6, 206.4, 3.0], [107.68, 209.12, 1.0]] {
        let (row, col) = g.cell_at(x, y).unwrap();
        assert!((made.at(row, col) - z).abs() < 1e-6 && (g.x(col) - x).abs() < 1e-9);
    }
}

/// The shift lies between 0 and the largest shift, ends one post spacing beyond the points, and has continuous value and slope outside their
/// cells.
#[test]
fn prop_the_shift_is_local_smooth_and_does_not_ring() {
    let dem = site(24, 24, [1.28, 1.28]);
    let plain = refined(with(&json!([])), &dem).heights;
    let moved = refined(with(&json!([[107.3, 208.1, 9.0]])), &dem).heights;
    let most = 9.0 - plain.height(107.3, 208.1).unwrap();
    let g = plain.geometry;
    let change: Vec<f64> = moved.values.iter().zip(&plain.values).map(|(a, b)| a - b).collect();
    let mut reached = 0;
    for (k, change) in change.iter().enumerate() {
        let [dx, dy] = [g.x(k % g.cols) - 107.3, g.y(k / g.cols) - 208.1];
        assert!((-1e-12..most + 1e-9).contains(change), "{change} of {most}");
        let apart = (dx * dx + dy * dy).sqrt();
        assert!(apart < 1.28 + 0.12 || *change == 0.0);
        reached += usize::from(apart < 1.0 && *change > 0.0);
    }
    assert!(reached > 300, "{reached}");
    // Halving the lattice spacing halves the steps and quarters their differences: value and slope are continuous.
    let steps = |cell: f64| {
        let n = (2.4 / cell).round() as u32;
        let params = |points: Value| {
            json!({
                "cell_m": cell, "basic_spacing_m": cell, "origin_m": [106.08, 207.36], "size_px": [n, n], "texture": false,
                "altimetry_points_m": points
            })
        };
        let [a, b] = [json!([[107.3, 208.1, 9.0]]), json!([])].map(|points| refined(params(points), &dem).heights);
        let line = |row: usize| -> Vec<f64> { a.row(row).iter().zip(b.row(row)).map(|(a, b)| a - b).collect() };
        let (mut first, mut second): (f64, f64) = (0.0, 0.0);
        for row in 0..n as usize {
            // Only rows outside the cell of the point.
            let y = a.geometry.y(row);
            if (y - 208.1).abs() < 0.1 {
                continue;
            }
            for w in line(row).windows(3) {
                first = first.max((w[1] - w[0]).abs());
                second = second.max((w[2] - 2.0 * w[1] + w[0]).abs());
            }
        }
        [first, second]
    };
    let ([first, second], [half, quarter]) = (steps(0.04), steps(0.02));
    let orders = [libm::log2(first / half), libm::log2(second / quarter)];
    assert!(orders[0] > 0.9 && orders[1] > 1.7, "{orders:?}");
}

/// The order of the points, points far away, and the choice of window change no bit.
#[test]
fn prop_order_and_far_points_change_nothing() {
    let dem = site(24, 24, [1.28, 1.28]);
    let given = points(&dem, 12);
    let made = refined(with(&json!(given)), &dem).heights;
    let mut turned = given.clone();
    turned.reverse();
    turned.push([125.0, 225.0, 40.0]);
    assert_eq!(made, refined(with(&json!(turned)), &dem).heights);
    let mut params = with(&json!(turned));
    params["origin_m"] = json!([103.84 + 0.08 * 40.0, 203.84 + 0.08 * 30.0]);
    params["size_px"] = json!([50, 60]);
    let part = refined(params, &dem).heights;
    for (j, i) in (0..60).flat_map(|j| (0..50).map(move |i| (j, i))) {
        assert_eq!(part.at(59 - j, i), made.at(139 - (j + 30), i + 40));
    }
}

/// Windows at every offset agree along a dense track that leaves each of them and crosses lines of posts.
#[test]
fn prop_windows_along_a_track_agree() {
    let dem = site(24, 24, [1.28, 1.28]);
    let track: Vec<[f64; 3]> = (0..90).map(|k| [101.0 + 0.26 * f64::from(k), 208.3, f64::from(k % 4)]).collect();
    let of = |west: u32, cols: u32| {
        let params = json!({
            "cell_m": 0.08, "basic_spacing_m": 0.08, "origin_m": [101.6 + 0.08 * f64::from(west), 207.04], "size_px": [cols, 30],
            "altimetry_points_m": track
        });
        refined(params, &dem).heights
    };
    let whole = of(0, 260);
    for west in 0..80 {
        let part = of(3 * west, 10);
        for (row, col) in (0..30).flat_map(|row| (0..10).map(move |col| (row, col))) {
            assert_eq!(part.at(row, col), whole.at(row, col + 3 * west as usize), "{west}");
        }
    }
}

/// The surface passes within sigma of a soft point, does not move if it already agrees to within sigma, and comes close if the shift is large.
#[test]
fn val_soft_points_are_matched_within_sigma() {
    let dem = site(24, 24, [1.28, 1.28]);
    let plain = refined(with(&json!([])), &dem).heights;
    let at = [107.3, 208.1];
    let height = plain.height(at[0], at[1]).unwrap();
    for (off, left) in [(0.5, 0.5), (-1.0, -1.0), (2.0, 0.5), (-10.0, -0.1)] {
        let made = refined(with(&json!([[at[0], at[1], height + off, 1.0]])), &dem).heights;
        let missed = height + off - made.height(at[0], at[1]).unwrap();
        assert!((missed - left).abs() < 1e-6, "{off}: {missed}");
    }
    let exact = refined(with(&json!([[at[0], at[1], height + 2.0, 0.0]])), &dem).heights;
    assert!((exact.height(at[0], at[1]).unwrap() - height - 2.0).abs() < 1e-6);
}

/// A point at a post that agrees with the post is left out, with a note.
#[test]
fn val_points_at_posts_are_left_out() {
    let dem = site(24, 24, [1.28, 1.28]);
    let post = [100.0 + 4.0 * 1.28, 200.0 + 5.0 * 1.28, dem.at(18, 4)];
    let beside = [post[0] + 0.1, post[1], post[2] + 0.09];
    let far = [107.3, 208.1, 3.0];
    let made = refined(with(&json!([far, post])), &dem);
    assert_eq!(made.heights, refined(with(&json!([far])), &dem).heights);
    assert!(made.notes.iter().any(|n| n.contains("lie at posts of the DEM: 1")), "{:?}", made.notes);
    assert_eq!(refined(with(&json!([far, beside])), &dem).heights, made.heights);
    let above = [beside[0], beside[1], post[2] + 0.5];
    assert!(refusal(with(&json!([above])), &dem).contains("0.500 m above it"));
    assert_eq!(refined(with(&json!([far, [above[0], above[1], above[2], 0.2]])), &dem).heights, made.heights);
}

#[test]
fn val_unusable_points_are_refused() {
    let dem = site(24, 24, [1.28, 1.28]);
    for (given, words) in [
        (json!([[99.9, 208.0, 1.0]]), "point 1 of the altimetry, x = 99.9, y = 208 m, does not lie between"),
        (json!([[107.3, 208.0, 1.0], [107.3, 208.0, 1.0]]), "points 1 and 2 of the altimetry are 0.0000 m apart"),
        (json!([[107.3, 208.0, 1.0], [110.0, 208.0, 1.0], [107.3, 208.2, 1.2]]), "points 1 and 3"),
        (json!([[107.3, 208.0, 1.0, -0.1]]), "sigma -0.1"),
    ] {
        let said = refusal(with(&given), &dem);
        assert!(said.contains(words), "{said}");
    }
    let of_file = |points: Vec<[f64; 4]>| {
        let mut params = with(&json!([]));
        params["altimetry"] = json!("laser.csv");
        let inputs = [dem.clone().into(), Input::Points(points)];
        elaborate(params).generate(&streams(), &inputs).map(|made| made.heights)
    };
    assert!(of_file(vec![[107.3, 208.0, f64::NAN, 0.0]]).unwrap_err().to_string().contains("point 1"));
    assert!(of_file(vec![[107.3, f64::INFINITY, 1.0, 0.0]]).unwrap_err().to_string().contains("must be finite"));
    let listed = refined(with(&json!([[107.3, 208.0, 1.0]])), &dem).heights;
    assert_eq!(of_file(vec![[107.3, 208.0, 1.0, 0.0]]).unwrap(), listed);
    // A hole in the DEM next to the window, under a point whose reach extends into the window.
    let mut holed = dem.clone();
    holed.values[23 * 24 + 10] = f64::NAN;
    let low = json!({"origin_m": [110.0, 203.2], "size_px": [20, 20], "texture": false});
    assert!(elaborate(low.clone()).generate(&streams(), &[holed.clone().into()]).is_ok());
    let mut near = low;
    near["altimetry_points_m"] = json!([[112.0, 202.5, 1.0]]);
    assert!(refusal(near, &holed).contains("no data at"));
}
