//! Requests of a server: samples at cell centres, without narrow features, of selected processes, and cancelled.

use super::*;
use crate::planetary::craters::population::{Families, Near};
use crate::planetary::world::{Request, Step};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

fn request(window: Window, feature_min_m: f64) -> Request<'static> {
    Request { window, feature_min_m, cancel: None }
}

fn world_of(processes: Value, seed: u64, acts: impl Fn(usize) -> bool) -> World {
    let processes: Vec<RawProcess> = serde_json::from_value(processes).unwrap();
    assemble::Assembly::new(0.01, 20).with(&processes, &Streams::for_seed(seed, "terrain"), None, acts)
}

/// Samples at cell centres are those of the grid of half the spacing with both coordinates odd.
#[test]
fn prop_centred_samples_are_samples() {
    let world = world(everything(), 1);
    for (zoom, west, south) in [(1, -20, 30), (2, 501, -3), (3, 0, 0), (4, -77, 31), (7, 12, -5), (10, -9, 3)] {
        let (cols, rows) = (37, 30);
        let centred = world.patch(&Window { centred: true, ..window(zoom, west, south, cols, rows) });
        let fine = world.patch(&window(zoom - 1, 2 * west, 2 * south, 2 * cols, 2 * rows));
        let mut rocks = 0;
        for (row, col) in (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col))) {
            let (k, of) = (row * cols + col, (2 * row + 1) * 2 * cols + 2 * col + 1);
            assert_eq!(centred.window.place(col, row), fine.window.place(2 * col + 1, 2 * row + 1));
            assert_eq!(centred.heights[k].to_bits(), fine.heights[of].to_bits(), "zoom {zoom} ({col}, {row})");
            assert_eq!(centred.albedo[k].to_bits(), fine.albedo[of].to_bits());
            assert_eq!(centred.rock_potential[k].to_bits(), fine.rock_potential[of].to_bits());
            assert_eq!(centred.class[k], fine.class[of]);
            rocks += usize::from(centred.class[k]);
        }
        assert!(rocks > 0);
    }
}

/// Without a bound nothing is left out. With a bound the ground is that of a world without the narrow craters: wider ones, here above 3.2 m, are
/// identical to the bit, because no bin contains diameters on both sides of the bound.
#[test]
fn prop_narrow_features_are_left_out_and_wide_ones_stay() {
    let craters = |least: f64| json!([{"kind": "texture"}, {"kind": "primary_craters", "density": 0.05, "diameter_min_m": least, "diameter_max_m": 400.0}]);
    let whole = world(craters(0.4), 3);
    // Bins start at a quarter of the basic spacing times a power of 2: 0.0025 m 2^k.
    let bound_m = 0.0025 * 1024.0;
    let area = window(3, -120, 40, 200, 150);
    assert_eq!(whole.patch_for(&request(area, 0.0)).unwrap(), whole.patch(&area));
    let bounded = whole.patch_for(&request(area, bound_m)).unwrap();
    assert_eq!(bounded, world(craters(bound_m), 3).patch(&area));
    assert_ne!(bounded, whole.patch(&area));
}

/// Rocks wider than the bound stay where they are.
#[test]
fn prop_wide_rocks_stay() {
    let whole = world(json!([{"kind": "texture"}, {"kind": "rocks", "coverage": 0.176}]), 5);
    let area = window(1, 0, 0, 300, 300);
    let (all, wide) = (whole.patch(&area), whole.patch_for(&request(area, 0.3)).unwrap());
    let count = |patch: &Patch| patch.class.iter().filter(|c| **c == 1).count();
    assert!(count(&wide) > 0 && count(&wide) < count(&all));
    for k in 0..area.len() {
        assert!(wide.class[k] <= all.class[k] && wide.heights[k] <= all.heights[k]);
    }
    // The coverage is consistent with the law: narrow rocks cover what the bound removes.
    let parameters = whole.rocks.as_ref().unwrap().0.parameters();
    let narrow = parameters.cover_below(0.176, 0.3);
    let measured = (count(&all) - count(&wide)) as f64 / (area.len() - count(&wide)) as f64;
    assert!((measured / narrow - 1.0).abs() < 0.25, "{measured} {narrow}");
    assert_eq!(parameters.cover_below(0.176, 0.03), 0.0);
}

/// What a server asks of a world before it generates anything.
#[test]
fn val_worlds_know_their_rocks_and_albedo() {
    use crate::windows::Windows;
    let bare = world(json!([{"kind": "texture"}]), 1);
    assert!(!bare.has_rocks() && !bare.has_albedo());
    assert_eq!(bare.rock_cover_below(0.118, 9.0), 0.0);
    let full = world(json!([{"kind": "rocks"}, {"kind": "albedo"}]), 1);
    assert!(full.has_rocks() && full.has_albedo());
    let all = 0.118 * (libm::exp(-0.03 * (1.79 + 0.152 / 0.118)) - libm::exp(-5.0 * (1.79 + 0.152 / 0.118)));
    assert!((full.rock_cover_below(0.118, 9.0) - all).abs() < 1e-12);
}

/// Leaving out a process does not change the others.
#[test]
fn prop_leaving_out_a_process_changes_no_other() {
    let area = window(2, -60, 10, 90, 80);
    let whole = world(everything(), 4).patch(&area);
    assert_eq!(world_of(everything(), 4, |_| true).patch(&area), whole);
    // Without rocks, number 3: except under them, the ground is the same.
    let bare = world_of(everything(), 4, |n| n != 3).patch(&area);
    assert!(bare.class.iter().all(|c| *c == 0) && whole.class.contains(&1));
    for k in (0..area.len()).filter(|k| whole.class[*k] == 0) {
        assert_eq!(bare.heights[k].to_bits(), whole.heights[k].to_bits());
        assert_eq!(bare.albedo[k].to_bits(), whole.albedo[k].to_bits());
    }
    // The second crater process alone: the plane of each crater sees craters of that process only.
    let alone = world_of(everything(), 4, |n| n == 4).patch(&area);
    assert!(alone.heights.iter().any(|z| *z != 0.0) && alone != whole);
    // Secondaries keep their positions even if their primaries do not act.
    let secondaries = world_of(everything(), 4, |n| n == 5).patch(&window(6, -60, 10, 90, 80));
    assert!(secondaries.heights.iter().any(|z| *z < -0.05));
    // If nothing acts, the ground is level.
    assert!(world_of(everything(), 4, |_| false).patch(&area).heights.iter().all(|z| *z == 0.0));
}

/// A patch that takes many seconds stops soon after cancellation: within 2 s even if other programs occupy the processor; 1 to 29 ms were
/// observed.
#[test]
fn val_a_patch_can_be_cancelled() {
    let world = world(everything(), 6);
    let cancel = AtomicBool::new(false);
    let ended = std::thread::scope(|scope| {
        let making = scope.spawn(|| {
            let made = world.patch_for(&Request { cancel: Some(&cancel), ..request(window(10, 0, 0, 256, 256), 0.0) });
            (made.is_none(), Instant::now())
        });
        std::thread::sleep(Duration::from_millis(150));
        let stopped = Instant::now();
        cancel.store(true, Ordering::Relaxed);
        let (none, end) = making.join().unwrap();
        assert!(none);
        end.saturating_duration_since(stopped)
    });
    println!("stopped after {:.1} ms", 1e3 * ended.as_secs_f64());
    assert!(ended < Duration::from_secs(2));
}

/// The expected number of visits is at least the number of craters and rocks found, and falls as the bound on their width rises.
#[test]
fn val_expected_visits_follow_the_bound() {
    let whole = world(everything(), 7);
    let area = window(4, 0, 0, 200, 200);
    let mut last = f64::INFINITY;
    for bound_m in [0.0, 0.3, 1.0, 5.0, 40.0, 1e5] {
        let visits = whole.expected_visits(&area, bound_m);
        let near = Near { window: &area, margin: 0.0, cancel: None };
        let mut found = Vec::new();
        for step in &whole.steps {
            let Step::Bombardment(b) = step else { continue };
            b.populations.iter().for_each(|p| p.find(&near, bound_m, &Families::default(), &mut found));
        }
        let rocks = whole.rocks.as_ref().unwrap().0.find(&area, bound_m, None, |_| 0.6).len();
        println!("wider than {bound_m} m: {} found, {visits:.0} visits expected", found.len() + rocks);
        assert!(visits >= (found.len() + rocks) as f64 && visits < last);
        last = visits;
    }
    assert_eq!(last, 0.0);
}

/// Samples of a tile, whose crater planes use the craters in the tile's index, agree with samples generated one by one, where every plane
/// searches for its craters itself.
#[test]
fn prop_tiles_agree_with_single_samples() {
    let world = world(everything(), 9);
    for zoom in [0, 1, 3, 5, 7, 9, 11] {
        for bound in [0.0, 0.5, 2.0] {
            let bound_m = bound * 0.01 * f64::from(1u32 << zoom);
            if bound == 0.0 && zoom > 5 {
                continue;
            }
            let area = window(zoom, -40, 17, 96, 80);
            let tile = world.patch_for(&request(area, bound_m)).unwrap();
            for k in (0..area.len()).step_by(479) {
                let [row, col] = [k / area.cols, k % area.cols];
                let alone = window(zoom, area.west + col as i64, area.south + row as i64, 1, 1);
                let alone = world.patch_for(&request(alone, bound_m)).unwrap();
                assert_eq!(alone.heights[0].to_bits(), tile.heights[k].to_bits(), "zoom {zoom}, {bound_m} m, {k}");
                assert_eq!(alone.rock_potential[0].to_bits(), tile.rock_potential[k].to_bits());
                assert_eq!((alone.class[0], alone.albedo[0]), (tile.class[k], tile.albedo[k]));
            }
        }
    }
}
