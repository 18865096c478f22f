//! Bit-identical samples in every zoom, window and tile.

use super::*;

/// A sample's bits: height, albedo, class, rock potential.
type Bits = [u64; 4];

fn bits(patch: &Patch, col: usize, row: usize) -> Bits {
    let k = row * patch.window.cols + col;
    let [z, albedo, potential] = [&patch.heights, &patch.albedo, &patch.rock_potential].map(|v| v[k].to_bits());
    [z, albedo, u64::from(patch.class[k]), potential]
}

/// Every second sample of a patch gives the patch of twice the spacing.
#[test]
fn prop_zooms_agree() {
    let world = world(everything(), 1);
    for (zoom, west, south) in [(0, -40, 20), (1, 1001, -3), (2, 0, 0), (3, -77, 31), (5, 12, 5), (8, -9, 3)] {
        let coarse = world.patch(&window(zoom + 1, west, south, 40, 33));
        let fine = world.patch(&window(zoom, 2 * west, 2 * south, 79, 65));
        for (row, col) in (0..33).flat_map(|row| (0..40).map(move |col| (row, col))) {
            assert_eq!(bits(&coarse, col, row), bits(&fine, 2 * col, 2 * row), "zoom {zoom} ({col}, {row})");
        }
        // The patches do contain rocks and sand.
        assert!(fine.class.contains(&1) && fine.class.contains(&0));
    }
}

/// Overlapping patches, single samples and tiles agree; so do 1 and 8 threads.
#[test]
fn prop_patches_agree() {
    let made = world(everything(), 2);
    for zoom in [0, 1, 4] {
        let whole = made.patch(&window(zoom, -30, -40, 60, 64));
        let parts = [
            (-30, -40, 30, 32),
            (0, -40, 30, 32),
            (-30, -8, 30, 32),
            (0, -8, 30, 32),
            (-7, -21, 33, 40),
            (11, 2, 1, 1),
        ];
        for (west, south, cols, rows) in parts {
            let part = made.patch(&window(zoom, west, south, cols, rows));
            for (row, col) in (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col))) {
                let (across, up) = (col + (west + 30) as usize, row + (south + 40) as usize);
                assert_eq!(bits(&part, col, row), bits(&whole, across, up), "zoom {zoom}: {west} {south} {col} {row}");
            }
        }
    }
    // If one crater's plane were confused with another's, the result would depend on the window.
    let crowded = world(families(), 9);
    let whole = crowded.patch(&window(6, -20, -20, 60, 60));
    for (west, south) in [(-20, -20), (0, -20), (-20, 0), (10, 10), (20, 20)] {
        let part = crowded.patch(&window(6, west, south, 20, 20));
        for (row, col) in (0..20).flat_map(|row| (0..20).map(move |col| (row, col))) {
            let (across, up) = (col + (west + 20) as usize, row + (south + 20) as usize);
            assert_eq!(bits(&part, col, row), bits(&whole, across, up), "{west} {south} {col} {row}");
        }
    }
    let large = window(1, 3, -5, 300, 270);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| made.tiled_patch(&large))
    };
    let one = on(1);
    assert_eq!(one, on(8));
    assert_eq!(one, made.patch(&large));
}

/// Features have the same position at any spacing: samples 1.28 m apart hit a rock of 2 m.
#[test]
fn val_a_rock_of_two_metres_exists_at_every_zoom() {
    let processes =
        json!([{"kind": "texture"}, {"kind": "rocks", "coverage": 0.3, "diameter_min_m": 1.8, "diameter_max_m": 2.2}]);
    let world = world(processes, 3);
    let coarse = world.patch(&window(7, 0, 0, 250, 250));
    let hits: Vec<usize> = (0..coarse.class.len()).filter(|k| coarse.class[*k] == 1).collect();
    assert!(hits.len() > 20);
    for k in hits.into_iter().take(8) {
        let (i, j) = ((k as i64 % 250) * 128, (k as i64 / 250) * 128);
        let fine = world.patch(&window(0, i - 290, j - 290, 581, 581));
        assert_eq!(bits(&fine, 290, 290), bits(&coarse, k % 250, k / 250));
        let cover = fine.class.iter().filter(|c| **c == 1).count() as f64 * 1e-4;
        assert!(cover > 0.25 * std::f64::consts::PI * 1.8 * 1.8 * 0.99, "{cover} m2");
    }
}

/// Far from the origin, where lattice points need 45 bits.
#[test]
fn prop_far_patches_agree() {
    let world = world(everything(), 4);
    let far = 1 << 44;
    let whole = world.patch(&window(0, far, -far, 48, 40));
    let part = world.patch(&window(0, far + 10, -far + 9, 20, 20));
    (0..400).for_each(|k| assert_eq!(bits(&part, k % 20, k / 20), bits(&whole, k % 20 + 10, k / 20 + 9)));
}

/// Samples lie on the lattice: the cells of the next zoom are centred on every second sample.
#[test]
fn val_grids_put_samples_at_lattice_points() {
    let grid = |cell_m: f64, px: u32| {
        let params = json!({"cell_m": cell_m, "basic_spacing_m": 0.01, "size_px": [px, px], "origin_m": [1.6, -3.2]});
        let generator = crate::prepare(KIND, &params).unwrap();
        generator.generate(&Streams::for_seed(5, "terrain"), &[]).unwrap()
    };
    let (fine, coarse) = (grid(0.04, 41), grid(0.08, 21));
    let g = &fine.heights.geometry;
    assert_eq!((g.x(0), g.y(40)), (1.6, -3.2));
    for (fine, coarse) in [(&fine.heights, &coarse.heights)]
        .into_iter()
        .chain(fine.maps.iter().zip(&coarse.maps).map(|(f, c)| (&f.values, &c.values)))
    {
        for (row, col) in (0..21).flat_map(|row| (0..21).map(move |col| (row, col))) {
            assert!((coarse.geometry.x(col) - fine.geometry.x(2 * col)).abs() < 1e-12);
            assert_eq!(coarse.at(row, col), fine.at(2 * row, 2 * col));
        }
    }
    assert_eq!(fine.maps.iter().map(|m| m.name).collect::<Vec<_>>(), ["class", "rock-potential", "albedo"]);
}

/// The grid spacing nearest in ratio: the border between 1 and 2 is the square root of 2.
#[test]
fn val_the_nearest_zoom_is_nearest_in_ratio() {
    let zooms = [0.3, 1.0, 1.41, 1.42, 2.8, 2.9, 90.0, 91.0, 128.0].map(crate::planetary::nearest_zoom);
    assert_eq!(zooms, [0, 0, 0, 1, 1, 2, 6, 7, 7]);
}

/// The cell is exactly the basic spacing times a power of 2, and the origin exactly whole cells, whatever the digits of the input.
#[test]
fn val_the_lattice_wins_over_its_decimals() {
    let params =
        json!({"cell_m": 0.0800000001, "basic_spacing_m": 0.01, "size_px": [9, 9], "origin_m": [8000.00000001, 0.0]});
    let g = crate::prepare(KIND, &params).unwrap().geometry();
    assert_eq!((g.cell, g.origin[1]), ([0.08, 0.08], -0.04));
    assert!((g.origin[0] - 7999.96).abs() < 1e-9);
}

/// A frozen patch: changes of any draw or formula show here.
#[test]
fn gold_a_patch() {
    let patch = world(everything(), 42).patch(&window(1, 5, -9, 64, 48));
    let mut digest = 0u64;
    for k in 0..patch.window.len() {
        for bits in bits(&patch, k % 64, k / 64) {
            digest = (digest.rotate_left(5) ^ bits).wrapping_mul(0x517c_c1b7_2722_0a95);
        }
    }
    assert_eq!(digest, GOLD, "{digest:#x}");
}
const GOLD: u64 = 0xb756_2d5f_334a_5c4d;
