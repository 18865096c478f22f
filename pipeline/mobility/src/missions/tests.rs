use super::*;
use crate::missions::params::{DEFAULT_BORDER_M, DEFAULT_LENGTH_M};
use std::f64::consts::PI;

const LOW: u8 = RoughnessClass::Low as u8;
const SEMI: u8 = RoughnessClass::Semi as u8;
const HIGH: u8 = RoughnessClass::High as u8;

fn settings(change: impl FnOnce(&mut MissionParameters)) -> MissionSettings {
    let mut raw = MissionParameters::default();
    change(&mut raw);
    raw.try_into().unwrap()
}

/// 50.45 m square at 5 cm; a checkerboard of 2 m squares, two in four low, one semi, one high.
fn checkerboard() -> Grid<u8> {
    let geometry = Geometry::square(1009, 1009, 0.05);
    let class = |k: usize| [LOW, SEMI, HIGH, LOW][(k / 1009 / 40 % 2) * 2 + k % 1009 / 40 % 2];
    Grid::new(geometry, (0..geometry.len()).map(class).collect())
}

fn streams() -> Streams {
    Streams::for_seed(1, "missions")
}

#[test]
fn val_every_mission_follows_the_rules_of_the_paper() {
    let classes = checkerboard();
    let missions = draw_missions(&classes, &settings(|p| p.count = 200), StartCells::Low, &streams()).unwrap();
    assert_eq!(missions.len(), 200);
    let class_at = |p: [f64; 2]| {
        let (row, col) = classes.geometry.cell_at(p[0], p[1]).unwrap();
        classes.at(row, col)
    };
    for m in &missions {
        assert_eq!(class_at(m.start_m), LOW);
        assert!(class_at(m.goal_m) <= SEMI);
        assert!((m.length_m() - DEFAULT_LENGTH_M).abs() < 1e-9);
        for c in m.start_m.into_iter().chain(m.goal_m) {
            assert!(c > DEFAULT_BORDER_M && c < 50.45 - DEFAULT_BORDER_M);
        }
        assert!((Mission::between(m.index, m.start_m, m.goal_m).heading_rad - m.heading_rad).abs() < 1e-12);
    }
    assert!(missions.iter().any(|m| m.draws > 1));
    assert_eq!(missions[6].id(), "mission-0007");
}

#[test]
fn prop_more_missions_leave_earlier_ones_unchanged() {
    let classes = checkerboard();
    for cells in [StartCells::Low, StartCells::All] {
        let few = draw_missions(&classes, &settings(|p| p.count = 5), cells, &streams()).unwrap();
        let many = draw_missions(&classes, &settings(|p| p.count = 50), cells, &streams()).unwrap();
        assert_eq!(few[..], many[..5]);
    }
}

/// Null: on an all-low map much larger than the mission, starts are uniform over the eligible cells and headings over the
/// circle. n = 9000; thresholds at 5 standard errors of each mean (false alarm 6e-7 each); would detect a mean start that
/// is off by 1.6 % of the extent, or a heading preference of 4 % in cos or sin.
#[test]
fn stat_starts_and_headings_are_uniform() {
    let classes = Grid::filled(Geometry::square(1000, 1000, 1.0), LOW);
    let settings = settings(|p| (p.count, p.length_m, p.border_m) = (9000, 1e-3, 10.0));
    let missions = draw_missions(&classes, &settings, StartCells::Low, &streams()).unwrap();
    let mean = |f: &dyn Fn(&Mission) -> f64| missions.iter().map(f).sum::<f64>() / 9000.0;
    let five_se = |variance: f64| 5.0 * (variance / 9000.0).sqrt();
    assert!((mean(&|m| m.start_m[0]) - 500.0).abs() < five_se(980.0 * 980.0 / 12.0));
    assert!((mean(&|m| m.start_m[1]) - 500.0).abs() < five_se(980.0 * 980.0 / 12.0));
    assert!(mean(&|m| libm::cos(m.heading_rad)).abs() < five_se(0.5));
    assert!(mean(&|m| libm::sin(m.heading_rad)).abs() < five_se(0.5));
    assert!((mean(&|m| m.heading_rad) - PI).abs() < five_se(PI * PI / 3.0));
}

/// Maps that share their draws: the rules hold on each map, the same draw gives the same mission, and maps that differ in a
/// quarter of the rows inside the border share missions.
#[test]
fn val_shared_draws_are_shared_missions() {
    let (a, mut b) = (checkerboard(), checkerboard());
    b.values[..1009 * 300].fill(HIGH);
    let [of_a, of_b] =
        [&a, &b].map(|map| draw_missions(map, &settings(|p| p.count = 100), StartCells::All, &streams()).unwrap());
    for (map, missions) in [(&a, &of_a), (&b, &of_b)] {
        for m in missions {
            assert_eq!(class_at(map, m.start_m[0], m.start_m[1]), Some(RoughnessClass::Low));
            assert!(class_at(map, m.goal_m[0], m.goal_m[1]).unwrap() <= RoughnessClass::Semi);
        }
    }
    let same_draw = of_a.iter().zip(&of_b).filter(|(a, b)| a.draws == b.draws);
    assert!(same_draw.clone().all(|(a, b)| a == b));
    let shared = same_draw.count();
    assert!((20..100).contains(&shared), "{shared}");
}

/// Null: starts drawn from all cells are as uniform over the low cells as starts drawn from the low cells. Left half low, right
/// half low in every other column: two thirds of the starts lie in the left half. n = 9000; five standard errors (false alarm
/// 6e-7); would detect a preference of 3 %.
#[test]
fn stat_starts_from_all_cells_are_uniform_over_the_low_ones() {
    let geometry = Geometry::square(1000, 1000, 1.0);
    let class = |k: usize| if k % 1000 < 500 || k.is_multiple_of(2) { LOW } else { SEMI };
    let map = Grid::new(geometry, (0..geometry.len()).map(class).collect());
    let settings = settings(|p| (p.count, p.length_m, p.border_m) = (9000, 1e-3, 10.0));
    let missions = draw_missions(&map, &settings, StartCells::All, &streams()).unwrap();
    let left = missions.iter().filter(|m| m.start_m[0] < 500.0).count() as f64 / 9000.0;
    assert!((left - 2.0 / 3.0).abs() < 5.0 * (2.0f64 / 9.0 / 9000.0).sqrt(), "{left}");
}

#[test]
fn val_impossible_terrains_are_refused_with_the_reason() {
    let draw =
        |classes: &Grid<u8>, s: &MissionSettings| draw_missions(classes, s, StartCells::Low, &streams()).unwrap_err();
    let small = Grid::filled(Geometry::square(100, 100, 0.2), LOW);
    assert!(matches!(draw(&small, &settings(|_| ())), MissionError::LongerThanTerrain { .. }));
    let border = settings(|p| p.border_m = 15.0);
    assert!(matches!(draw(&small, &border), MissionError::LongerThanTerrain { .. }));
    let rough = Grid::filled(Geometry::square(1009, 1009, 0.05), SEMI);
    assert!(matches!(draw(&rough, &settings(|_| ())), MissionError::NoEligibleStart { .. }));
    let none = |cells| MissionError::NoEligibleStart { cells, border_m: 5.0 }.to_string();
    assert_eq!(none(1), "find a start: there is no low roughness in the 1 cell farther than 5 m from the edge");
    assert_eq!(none(9), "find a start: there is no low roughness in the 9 cells farther than 5 m from the edge");
    // Low roughness only in the middle: every goal lies outside the border.
    let mut pit = Grid::filled(Geometry::square(1009, 1009, 0.05), HIGH);
    pit.values[504 * 1009 + 504] = LOW;
    let error = draw(&pit, &settings(|p| p.max_draws = 77));
    assert!(matches!(error, MissionError::DrawsExhausted { draws: 77, starts: 1, .. }), "{error}");
    assert!(error.to_string().contains("77 draws from 1 low-roughness cell gave no goal"), "{error}");
}

#[test]
fn val_bad_parameters_are_refused() {
    let refused = |change: &dyn Fn(&mut MissionParameters)| {
        let mut raw = MissionParameters::default();
        change(&mut raw);
        MissionSettings::try_from(raw).unwrap_err().key
    };
    assert_eq!(refused(&|p| p.count = 0), "count");
    assert_eq!(refused(&|p| p.max_draws = 0), "max_draws");
    assert_eq!(refused(&|p| p.length_m = f64::NAN), "length_m");
    assert_eq!(refused(&|p| p.border_m = -1.0), "border_m");
}
