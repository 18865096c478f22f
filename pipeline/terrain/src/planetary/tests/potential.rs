//! Rocks that follow a raster of their potential.

use super::rocks::{count_above, found, rocks_of};
use super::*;
use crate::generator::{Generator, Input};
use crate::planetary::rocks::Rock;
use crate::planetary::rocks::law::Law;
use crate::planetary::rocks::potential::Potential;
use crate::planetary::{Planetary, RawPlanetary};
use sastrugi_numeric::{Ground, GroundClass};

/// Shares that vary from cell to cell, with a hole, on ground from (-9, -9) to (9, 9) m.
fn raster() -> Grid {
    let g = Geometry { rows: 18, cols: 18, cell: [1.0, 1.0], origin: [-9.0, -9.0] };
    let share = |k: usize| if k == 130 { f64::NAN } else { 0.05 + 0.02 * ((k * 7) % 25) as f64 };
    Grid::new(g, (0..g.len()).map(share).collect())
}

/// Every process, with so few craters after the rocks that most rocks remain.
fn processes_on_raster() -> Value {
    let mut list = everything();
    list[3]["potential"] = json!("shares");
    list[4]["density"] = json!(0.002);
    list[5]["density"] = json!(0.0002);
    list
}

/// A window of a world whose rocks follow a raster.
fn planetary(origin_m: [f64; 2], cell_m: f64, px: [u32; 2]) -> Planetary {
    let raw = RawPlanetary {
        size_px: Some(px),
        cell_m,
        basic_spacing_m: Some(0.01),
        origin_m,
        processes: serde_json::from_value(processes_on_raster()).unwrap(),
        ..RawPlanetary::default()
    };
    Planetary::try_from(raw).unwrap()
}

fn streams() -> Streams {
    Streams::for_seed(5, "terrain")
}

/// Heights and maps of a window.
fn fields(made: &Planetary) -> Vec<Grid> {
    let made = made.generate(&streams(), &[raster().into()]).unwrap();
    std::iter::once(made.heights).chain(made.maps.into_iter().map(|m| m.values)).collect()
}

/// Zooms and windows of one world agree bit by bit, across the raster's cells, its hole and its edge; so do 1 and 8 threads.
#[test]
fn prop_zooms_and_windows_agree() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let made = pool.install(|| fields(&planetary([-10.24, -10.24], 0.04, [513, 513])));
        // NaN differs from itself, so compare bits.
        (made.iter().flat_map(|grid| &grid.values).map(|v| v.to_bits()).collect::<Vec<_>>(), made)
    };
    let ((bits, whole), (others, _)) = (on(1), on(8));
    assert!(bits == others);
    let coarse = fields(&planetary([-10.24, -10.24], 0.08, [257, 257]));
    let part = fields(&planetary([-2.24, -7.04], 0.04, [120, 130]));
    for ((whole, coarse), part) in whole.iter().zip(&coarse).zip(&part) {
        for (j, i) in (0..257).flat_map(|j| (0..257).map(move |i| (j, i))) {
            assert_eq!(coarse.at(256 - j, i).to_bits(), whole.at(512 - 2 * j, 2 * i).to_bits());
        }
        for (j, i) in (0..130).flat_map(|j| (0..120).map(move |i| (j, i))) {
            assert_eq!(part.at(129 - j, i).to_bits(), whole.at(512 - (j + 80), i + 200).to_bits());
        }
    }
    let (class, potential) = (&whole[1], &whole[2]);
    assert!(class.values.contains(&1.0) && class.values.contains(&0.0));
    let (low, high) = potential.range().unwrap();
    assert!(low < 0.06 && high > 0.5, "{low} {high}");
}

/// A raster with the same share everywhere equals that coverage, bit by bit, including the effect of craters.
#[test]
fn val_a_uniform_raster_equals_the_coverage() {
    let of = |coverage: f64, raster: Option<Potential>| {
        let mut list = processes_on_raster();
        list[3]["coverage"] = json!(coverage);
        let list: Vec<RawProcess> = serde_json::from_value(list).unwrap();
        assemble::world(&list, 0.01, 20, &Streams::for_seed(6, "terrain"), raster)
    };
    let g = Geometry { origin: [-9.0, -9.0], ..Geometry::square(9, 9, 2.0) };
    let raster = Potential::new(&Grid::filled(g, 0.118), 0.01, [0.0; 2]).unwrap();
    let (followed, thin, dense) = (of(0.4, Some(raster)), of(0.118, None), of(0.4, None));
    let (inside, beyond) = (window(2, -150, -100, 200, 180), window(2, 900, 900, 90, 90));
    assert!(followed.patch(&inside) == thin.patch(&inside) && followed.patch(&inside) != dense.patch(&inside));
    // Beyond the raster, the coverage is used.
    assert!(followed.patch(&beyond) == dense.patch(&beyond) && followed.patch(&beyond) != thin.patch(&beyond));
}

/// Counts east and west of a step in the raster, each against the law for its share. Poisson counts, bound of 4.9 standard deviations:
/// false-alarm probability 1e-6 each. Detects a share wrong by 2 %.
#[test]
fn stat_counts_follow_the_raster() {
    let g = Geometry { rows: 4, cols: 4, cell: [50.0, 50.0], origin: [0.0; 2] };
    let raster = Grid::new(g, (0..16).map(|k| if k % 4 < 2 { 0.069 } else { 0.176 }).collect());
    let list = json!([{"kind": "rocks", "coverage": 0.0, "potential": "shares", "diameter_min_m": 0.09}]);
    let list: Vec<RawProcess> = serde_json::from_value(list).unwrap();
    let potential = Potential::new(&raster, 0.01, [0.0; 2]).unwrap();
    let made = assemble::world(&list, 0.01, 20, &Streams::for_seed(21, "terrain"), Some(potential));
    let rocks = found(&made, 20_000, |at| rocks_of(&made).coverage(at));
    // Between the outer centres, and away from the step, where the share is bilinear.
    let halves = [(0.069, 25.0..75.0), (0.176, 125.0..175.0)];
    for (coverage, across) in halves {
        let inside = |r: &&Rock| {
            let [x, y] = r.centre.map(|at| 0.01 * at);
            across.contains(&x) && (25.0..175.0).contains(&y) && r.diameter_m > 0.1
        };
        let count = rocks.iter().filter(inside).count() as f64;
        let expected = 50.0 * 150.0 * count_above(&Law { coverage, exact_union: true }, 0.1);
        eprintln!("share {coverage}: {count} rocks against {expected:.0}");
        assert!((count - expected).abs() < 4.9 * expected.sqrt(), "{coverage}: {count} {expected}");
    }
    // Where the raster has no data the coverage is used, which is 0 here.
    assert!(rocks.iter().all(|r| r.centre.iter().all(|at| (2500.0..=17_500.0).contains(at))));
}

/// Ground generated on demand for a rover has the bits of the window: it follows the raster too.
#[test]
fn prop_ground_on_demand_follows_the_raster() {
    let made = planetary([-3.2, -2.56], 0.02, [200, 160]).with_inputs(&[raster().into()]).unwrap();
    let ground = made.ground(&streams(), 0.02, &[], 64).unwrap();
    let view = ground.view();
    let fields = fields(&made);
    let g = fields[0].geometry;
    let rocks = (0..g.len()).filter(|&k| {
        let point = view.at(g.x(k % g.cols), g.y(k / g.cols)).unwrap();
        assert_eq!(point.height_m as f32, fields[0].values[k] as f32);
        assert_eq!(point.class == GroundClass::Rock, fields[1].values[k] == 1.0);
        point.class == GroundClass::Rock
    });
    assert!(rocks.count() > 500);
    let unread = planetary([0.0; 2], 0.02, [9, 9]).ground(&streams(), 0.02, &[], 4);
    assert_eq!(unread.err().unwrap().key, "processes.3.potential");
}

/// Missing data are stated in a note, and values that cannot be shares are refused.
#[test]
fn val_unusable_rasters_are_refused() {
    let made = planetary([0.0; 2], 0.16, [64, 64]);
    let note = &made.generate(&streams(), &[raster().into()]).unwrap().notes[0];
    assert!(note.contains("no data at") && note.contains("`coverage`, 0.118"), "{note}");
    let inside = planetary([1.0 - 0.04, 1.04], 0.08, [16, 16]);
    assert!(inside.generate(&streams(), &[raster().into()]).unwrap().notes.is_empty());
    let refusal = |inputs: &[Input]| made.generate(&streams(), inputs).unwrap_err().to_string();
    let with = |value: f64| {
        let mut raster = raster();
        raster.values[40] = value;
        refusal(&[raster.into()])
    };
    for bad in [0.61, 17.6, -0.1, f64::INFINITY] {
        assert!(
            with(bad).contains(&format!("\"shares\": it holds a share of {bad} at x = -4.5, y = 6.5")),
            "{}",
            with(bad)
        );
    }
    // 0.6 in single precision is above it.
    let mut rounded = raster();
    rounded.values[40] = f64::from(0.6f32);
    assert!(made.generate(&streams(), &[rounded.into()]).is_ok());
    let empty = Grid::filled(Geometry::square(4, 4, 1.0), f64::NAN);
    assert!(refusal(&[empty.into()]).contains("no cell with data"));
    assert!(refusal(&[Grid::filled(Geometry::square(1, 4, 1.0), 0.1).into()]).contains("1 x 4 cells"));
    assert!(refusal(&[]).contains("is missing"));
    let list: Vec<RawProcess> = serde_json::from_value(json!([{"kind": "rocks", "potential": ""}])).unwrap();
    assert_eq!(processes::check(&list, 0.01).unwrap_err().key, "processes.0.potential");
}
