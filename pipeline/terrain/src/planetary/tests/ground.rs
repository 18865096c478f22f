//! Ground generated on demand.

use super::*;
use crate::planetary::{Clearing, Planetary, RawPlanetary, WorldGround};
use sastrugi_numeric::{Ground, GroundClass};

fn planetary() -> Planetary {
    let raw = RawPlanetary {
        size_px: Some([64, 64]),
        basic_spacing_m: Some(0.01),
        processes: serde_json::from_value(everything()).unwrap(),
        ..RawPlanetary::default()
    };
    Planetary::try_from(raw).unwrap()
}

fn ground(clearings: &[Clearing], tiles: usize) -> WorldGround {
    planetary().ground(&Streams::for_seed(5, "terrain"), 0.02, clearings, tiles).unwrap()
}

/// At samples the ground has the bits of a patch of the complete surface, in single precision as in files.
#[test]
fn prop_ground_equals_the_complete_surface() {
    let ground = ground(&[], 64);
    let view = ground.view();
    let world = planetary().world(&Streams::for_seed(5, "terrain"));
    let window = window(1, -300, -280, 90, 80);
    let whole = world.patch(&window);
    for k in 0..window.len() {
        let (col, row) = (k % 90, k / 90);
        let point = view.at((col as f64 - 300.0) * 0.02, (row as f64 - 280.0) * 0.02).unwrap();
        // A position in metres is that of a sample only to the last digit of double precision.
        assert_eq!(point.height_m as f32, whole.heights[k] as f32);
        assert_eq!(point.class == GroundClass::Rock, whole.class[k] == 1);
        assert_eq!(point.albedo, f64::from(whole.albedo[k] as f32));
    }
    assert_eq!(ground.tiles_made(), 2 * 2);
}

/// With room for only one tile, tiles are generated repeatedly, with the same bits.
#[test]
fn prop_evictions_change_nothing() {
    let (small, large) = (ground(&[], 1), ground(&[], 64));
    let mut stream = Streams::for_seed(1, "ground").stream("places");
    for _ in 0..60 {
        // A view caches tiles: a new view each time forces the eviction.
        let [x, y] = [(); 2].map(|()| stream.uniform_in(-9.0, 9.0));
        assert_eq!(small.view().at(x, y).unwrap(), large.view().at(x, y).unwrap());
    }
    assert!(small.tiles_made() > 2 * large.tiles_made(), "{} {}", small.tiles_made(), large.tiles_made());
}

/// Between samples heights are bilinear, also if the samples lie in different tiles, which meet at columns and rows 0 and 256.
#[test]
fn val_heights_between_samples_are_bilinear() {
    let ground = ground(&[], 64);
    let view = ground.view();
    for (col, row) in [(0, 0), (17, 40), (255, 12), (255, 255), (-1, -1)] {
        let at = |east: f64, north: f64| {
            let [x, y] = [f64::from(col) + east, f64::from(row) + north].map(|cells| 0.02 * cells);
            view.at(x, y).unwrap().height_m
        };
        let [sw, se, nw, ne] = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
        assert!((at(0.5, 0.5) - 0.25 * (sw + se + nw + ne)).abs() < 1e-9, "{col} {row}");
        assert!((at(0.25, 0.0) - (0.75 * sw + 0.25 * se)).abs() < 1e-9, "{col} {row}");
        assert!((at(0.0, 0.25) - (0.75 * sw + 0.25 * nw)).abs() < 1e-9, "{col} {row}");
    }
}

/// Heights are continuous, also across the edges of tiles.
#[test]
fn prop_ground_is_continuous_between_tiles() {
    let ground = ground(&[], 64);
    let view = ground.view();
    for edge in [0.0, 256.0 * 0.02, -256.0 * 0.02] {
        for along in [-0.013, 0.377, 2.011] {
            let heights = [edge - 1e-9, edge, edge + 1e-9].map(|at| view.at(at, along).unwrap().height_m);
            assert!((heights[0] - heights[1]).abs() < 1e-6 && (heights[2] - heights[1]).abs() < 1e-6);
        }
    }
}

/// No rock reaches into a clearing, and nothing changes farther from it than the widest rock reaches.
#[test]
fn val_clearings_have_no_rocks() {
    let plain = ground(&[], 64);
    let plain = plain.view();
    let is_rock = |x: &f64| plain.at(*x, -2.1).unwrap().class == GroundClass::Rock;
    let x = (0..400).map(|k| f64::from(k) * 0.02).find(is_rock).unwrap();
    let cleared = ground(&[Clearing { centre_m: [x, -2.1], radius_m: 0.6 }], 64);
    let cleared = cleared.view();
    let (mut taken, mut kept) = (0, 0);
    for k in 0..200 * 200 {
        let [dx, dy] = [k % 200, k / 200].map(|n| f64::from(n) * 0.02 - 2.0);
        let [a, b] = [&cleared, &plain].map(|view| view.at(x + dx, -2.1 + dy).unwrap());
        let inside = (dx * dx + dy * dy).sqrt() < 0.6;
        assert!(!inside || a.class == GroundClass::Sand);
        taken += usize::from(inside && b.class == GroundClass::Rock);
        kept += usize::from(a.class == GroundClass::Rock);
        assert!(a == b || b.class == GroundClass::Rock || a.height_m <= b.height_m);
    }
    assert!(taken > 20 && kept > 500, "{taken} {kept}");
    assert_eq!(cleared.at(x + 9.0, 9.0), plain.at(x + 9.0, 9.0));
}

/// There is no ground beyond the end of the world, or at NaN or infinity.
#[test]
fn val_the_world_ends() {
    let ground = ground(&[], 4);
    let view = ground.view();
    for x in [5e13, -5e13, f64::NAN, f64::INFINITY] {
        assert!(view.at(x, 0.0).is_err() && view.at(0.0, x).is_err(), "{x}");
    }
    assert!(view.at(1e9, -1e9).is_ok());
}

#[test]
fn val_wrong_cells_are_refused() {
    let refused = planetary().ground(&Streams::for_seed(5, "terrain"), 0.03, &[], 4);
    assert!(refused.err().unwrap().to_string().contains("3 times the basic spacing"));
}
