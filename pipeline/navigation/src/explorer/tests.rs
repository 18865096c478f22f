use super::*;
use crate::testing::Random;

const SETTINGS: ExplorerSettings = ExplorerSettings { cell_m: 0.1, margin_m: 0.2, arrive_m: 0.5, beyond_m: 2.0 };

fn explorer(goal_m: [f64; 2]) -> Explorer {
    Explorer::new(SETTINGS, [0.0; 2], goal_m).unwrap()
}

/// Corners of an upright rectangle.
fn rectangle([west, south]: [f64; 2], [east, north]: [f64; 2]) -> [[f64; 2]; 4] {
    [[west, south], [east, south], [east, north], [west, north]]
}

fn length_m(points_m: &[[f64; 2]]) -> f64 {
    points_m.windows(2).map(|pair| libm::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1])).sum()
}

/// A wall across x = 1 m from `south` to `north`.
fn wall(explorer: &mut Explorer, south: f64, north: f64, sight: Sight) {
    explorer.see(&rectangle([1.0, south], [1.2, north]), sight);
}

#[test]
fn val_free_ground_is_planned_straight_to_the_goal() {
    let mut explorer = explorer([3.0, 0.4]);
    assert_eq!(explorer.plan([0.02, 0.03]), Some(vec![[0.02, 0.03], [3.0, 0.4]]));
}

/// A wall is passed at its end, at no less than the margin: the shortest path around the end point (1.0 to 1.2, 0.6 + margin).
#[test]
fn val_a_wall_is_passed_at_the_margin() {
    let mut explorer = explorer([3.0, 0.0]);
    wall(&mut explorer, -3.0, 0.6, Sight::Hazard);
    let plan = explorer.plan([0.0; 2]).unwrap();
    for pair in plan.windows(2) {
        for k in 0..=100 {
            let [x, y] = [0, 1].map(|axis| pair[0][axis] + 0.01 * f64::from(k) * (pair[1][axis] - pair[0][axis]));
            assert!(!(0.85..=1.35).contains(&x) || y >= 0.75 - 1e-9, "{x} {y}");
        }
    }
    // Around the corners of the blocked cells, at any angle; waypoints are centres of cells.
    let least_m = libm::hypot(0.8, 0.8) + 0.6 + libm::hypot(1.6, 0.8);
    assert!(length_m(&plan) >= least_m && length_m(&plan) < 1.06 * least_m, "{plan:?}");
}

/// Knowledge only rises: a safe look frees a suspect cell; a safe cell no longer counts as a position of a hazard, unless no other cell is left for
/// the hazard, in which case the complete area is a hazard whatever later looks show.
#[test]
fn val_knowledge_only_rises() {
    let look = |explorer: &mut Explorer, south: f64, north: f64, sight| wall(explorer, south, north, sight);
    let blocked = |sights: &[(f64, f64, Sight)]| {
        let mut explorer = explorer([3.0, 0.0]);
        sights.iter().for_each(|(south, north, sight)| look(&mut explorer, *south, *north, *sight));
        explorer.is_blocked([1.1, 0.05])
    };
    use Sight::{Hazard, Safe};
    assert!(blocked(&[(-0.2, 0.2, Hazard)]) && !blocked(&[(-0.2, 0.2, Hazard), (-0.2, 0.2, Safe)]));
    // The hazard must be in the part not seen as safe, far from here.
    assert!(!blocked(&[(-0.2, 0.5, Safe), (-0.2, 1.2, Hazard)]));
    // There is no other position for it.
    assert!(blocked(&[(-0.2, 0.2, Safe), (-0.2, 0.2, Hazard)]));
    assert!(blocked(&[(-0.2, 0.2, Safe), (-0.2, 0.2, Hazard), (-0.2, 0.2, Safe)]));
}

/// A hazard at a position stays one, whatever areas around it were or will be seen as safe. It blocks exactly the cells nearer than the margin of 0.2
/// m, each anywhere in its cell. Outside the map it is ignored.
#[test]
fn val_a_hazard_at_a_place_stays() {
    let mut explorer = explorer([3.0, 0.0]);
    let around = rectangle([0.5, -0.5], [1.5, 0.5]);
    explorer.see(&around, Sight::Safe);
    explorer.see_hazard_at([1.03, 0.07]);
    explorer.see(&around, Sight::Safe);
    for (row, col) in (-6..=6).flat_map(|row| (-6..=6).map(move |col| (row, col))) {
        let at_m = [1.05 + 0.1 * f64::from(col), 0.05 + 0.1 * f64::from(row)];
        let gap = |cells: i32| f64::from((cells.abs() - 1).max(0));
        let near = gap(row) * gap(row) + gap(col) * gap(col) < 4.0;
        assert_eq!(explorer.is_blocked(at_m), near, "{at_m:?}");
    }
    let before = explorer.len();
    explorer.see_hazard_at([1e6, 0.0]);
    assert_eq!(explorer.len(), before);
}

/// Discarded knowledge is free ground again, planned over as if it had never been seen.
#[test]
fn val_discarded_knowledge_is_free_ground() {
    let mut explorer = explorer([3.0, 0.0]);
    let before = explorer.plan([0.02, 0.03]);
    wall(&mut explorer, -1.5, 1.2, Sight::Hazard);
    assert_ne!(explorer.plan([0.02, 0.03]), before);
    explorer.forget();
    assert!(!explorer.is_blocked([1.1, 0.05]));
    assert_eq!(explorer.plan([0.02, 0.03]), before);
}

/// The map is not the world: a wall as long as the map is passed over ground outside it, and a closed ring is not passed at all. The growth of the
/// map is bounded.
#[test]
fn val_the_map_grows_if_a_path_needs_it() {
    let mut explorer = explorer([3.0, 0.0]);
    let before = explorer.len();
    wall(&mut explorer, -2.0, 2.0, Sight::Hazard);
    let plan = explorer.plan([0.0; 2]).unwrap();
    assert!(explorer.len() > before && plan.iter().any(|point| point[1].abs() > 2.0), "{plan:?}");
    // Knowledge is kept when the map grows.
    assert!(explorer.is_blocked([1.1, 1.0]));

    let ring = |centre: [f64; 2], explorer: &mut Explorer| {
        for [dx, dy] in [[0.0, 0.9], [0.0, -0.9], [0.9, 0.0], [-0.9, 0.0]] {
            let (x, y, along, across) = (centre[0] + dx, centre[1] + dy, 1.0, 0.1);
            let [w, h] = if dx == 0.0 { [along, across] } else { [across, along] };
            explorer.see(&rectangle([x - w, y - h], [x + w, y + h]), Sight::Hazard);
        }
    };
    for centre in [[0.0, 0.0], [3.0, 0.0]] {
        let mut explorer = super::tests::explorer([3.0, 0.0]);
        ring(centre, &mut explorer);
        assert_eq!(explorer.plan([0.0; 2]), None);
        assert_eq!(explorer.len(), before, "a larger map would not help");
    }
    // A wall longer than any map: growth ends, and so does the plan.
    let mut explorer = super::tests::explorer([3.0, 0.0]);
    let mut grown = 0;
    while grown < 20 {
        wall(&mut explorer, -1e3, 1e3, Sight::Hazard);
        grown += 1;
        if explorer.plan([0.0; 2]).is_none() {
            break;
        }
    }
    assert!(grown < 20 && explorer.len() <= CELLS_MAX);
}

/// A goal among hazards is approached as long as a free cell lies within its tolerance.
#[test]
fn val_a_blocked_goal_is_reached_to_within_its_tolerance() {
    let mut explorer = explorer([3.0, 0.0]);
    explorer.see(&rectangle([2.75, -0.2], [3.2, 0.2]), Sight::Hazard);
    assert!(explorer.is_blocked([3.0, 0.0]));
    let plan = explorer.plan([0.0; 2]).unwrap();
    let last_free = plan[plan.len() - 2];
    assert!(plan.len() > 2 && !explorer.is_blocked(last_free), "{plan:?}");
    assert!(libm::hypot(3.0 - last_free[0], last_free[1]) <= 0.5, "{plan:?}");
    explorer.see(&rectangle([2.3, -0.7], [3.7, 0.7]), Sight::Hazard);
    assert_eq!(explorer.plan([0.0; 2]), None);
}

/// A start among blocked cells is left via the nearest free one.
#[test]
fn val_a_blocked_start_is_left() {
    let mut explorer = explorer([3.0, 0.0]);
    explorer.see(&rectangle([0.1, -1.0], [0.4, 1.0]), Sight::Hazard);
    let at_m = [0.06, 0.0];
    assert!(explorer.is_blocked(at_m));
    let plan = explorer.plan(at_m).unwrap();
    assert!(plan[1][0] < 0.0 && plan[1][0] > -0.3 && !explorer.is_blocked(plan[1]), "{plan:?}");
}

/// After any looks, the repaired plan has as many steps as that of an explorer that is given everything at once.
#[test]
fn prop_repaired_plans_cost_what_fresh_ones_do() {
    let mut random = Random(22);
    let (mut compared, mut costs) = (0, 0);
    for _ in 0..20 {
        let mut explorer = explorer([2.5, 1.0]);
        let mut looks = Vec::new();
        let mut at_m = [0.0; 2];
        for _ in 0..30 {
            let [x, y] = [0; 2].map(|_| 4.0 * random.unit() - 1.0);
            let sight = [Sight::Hazard, Sight::Hazard, Sight::Safe][random.below(3) as usize];
            let area = rectangle([x, y], [x + 0.4 * random.unit(), y + 0.4 * random.unit()]);
            explorer.see(&area, sight);
            looks.push((area, sight));
            let plan = explorer.plan(at_m);
            let mut fresh = super::tests::explorer([2.5, 1.0]);
            looks.iter().for_each(|(area, sight)| fresh.see(area, *sight));
            if explorer.len() == fresh.len() {
                let again = fresh.plan(at_m);
                assert_eq!(plan.is_some(), again.is_some());
                let cost = |of: &Explorer| of.search.value(of.map.nearest(of.map.point_at(at_m))).to_bits();
                compared += 1;
                // A start in a blocked cell is left via another cell, whose cost both searches know.
                if explorer.len() == fresh.len() && !explorer.is_blocked(at_m) {
                    assert_eq!(cost(&explorer), cost(&fresh));
                    costs += 1;
                }
            }
            let Some(plan) = plan else { break };
            at_m = [0, 1].map(|axis| at_m[axis] + 0.1 * (plan[1][axis] - at_m[axis]));
        }
    }
    assert!(compared > 200 && costs > 60, "{compared} {costs}");
}

#[test]
fn val_wrong_settings_are_refused() {
    for (settings, words) in [
        (ExplorerSettings { cell_m: 0.0, ..SETTINGS }, "`cell_m` is 0"),
        (ExplorerSettings { margin_m: -1.0, ..SETTINGS }, "`margin_m` is -1"),
        (ExplorerSettings { cell_m: 1e-3, ..SETTINGS }, "more than 1048576"),
    ] {
        let said = Explorer::new(settings, [0.0; 2], [3.0, 0.0]).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
    }
}

/// Cells lie at multiples of their side, here 0.5 m; the border is 1 m.
#[test]
fn val_the_map_has_a_border_around_both_ends() {
    let settings = ExplorerSettings { cell_m: 0.5, ..SETTINGS };
    let expected = Geometry { rows: 6, cols: 10, cell: [0.5; 2], origin: [-1.0; 2] };
    assert_eq!(settings.geometry([0.0, 0.0], [3.0, 1.0], 1.0), Ok(expected));
    assert_eq!(settings.geometry([3.0, 0.0], [0.0, 1.0], 1.0), Ok(expected));
}

/// Corners may go either way around an area.
#[test]
fn val_an_area_is_seen_whichever_way_its_corners_go() {
    let area = rectangle([1.0, -0.3], [1.4, 0.2]);
    let [a, b, c, d] = area;
    let seen = [area, [d, c, b, a], [b, c, d, a]].map(|corners| {
        let mut explorer = explorer([3.0, 0.0]);
        explorer.see(&corners, Sight::Hazard);
        explorer.cells
    });
    assert!(seen[0] == seen[1] && seen[0] == seen[2]);
    // 4 x 5 centres of cells lie inside.
    assert_eq!(seen[0].iter().filter(|cell| **cell == Cell::Suspect).count(), 20);
}
