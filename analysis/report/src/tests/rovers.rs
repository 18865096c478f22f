//! Pages on rovers.

use super::made_up::rovers::{LIMIT_M, RADIUS_M, ROVERS, factor};
use super::{assert_sound, made_up, report, rows};
use crate::data::Data;
use sastrugi_schemas::tables::RoverRow;
use serde_json::Value;

/// Rovers alone, on `per_group` terrains in each of three groups.
fn driven(per_group: usize) -> Data {
    let mut data = made_up::full(per_group, 24);
    data.missions.clear();
    data.replicates.clear();
    data.fits.clear();
    data.routes.clear();
    data.formations.clear();
    data.formation_events.clear();
    data.terrains.retain(|t| t.stage == "terrain");
    data
}

fn near(cell: &Value, expected: f64) -> bool {
    cell.as_f64().is_some_and(|v| (v - expected).abs() <= 1e-9 * expected.abs().max(1.0))
}

/// The synthetic distances of the first group, rover by rover.
fn distances(worlds: usize) -> Vec<f64> {
    let of = |w: usize| (0..ROVERS).map(move |r| RADIUS_M * factor(0.0, w as f64, r as f64));
    (0..worlds).flat_map(of).collect()
}

/// Both efficiencies by hand: all rovers of the first group arrive with 0.4 m left; every fifth of the last group is stopped.
#[test]
fn val_efficiencies() {
    let (files, summary) = report(&driven(4));
    assert_sound(&files);
    let found = rows(&files, "rover-efficiency");
    assert_eq!(found.len(), 3);
    let all = distances(4);
    let efficiency = all.iter().map(|d| RADIUS_M / (d + 0.4)).sum::<f64>() / all.len() as f64;
    let row = &found[0];
    assert_eq!((row[0].as_str(), row[1].as_u64(), row[2].as_u64()), (Some("2.30"), Some(4), Some(40)));
    assert!(near(&row[3], 100.0) && near(&row[6], efficiency) && near(&row[7], efficiency), "{row:?}");
    assert!(near(&row[10], RADIUS_M * 40.0 / all.iter().sum::<f64>()), "{row:?}");
    // Efficiency relative to that of the ground's shortest path, 1.05 times the straight line.
    assert!(near(&row[14], 1.05 * efficiency) && near(&row[15], 0.0), "{row:?}");
    // All arrive on four worlds: worlds count as single trials, 0.025^(1/4).
    assert!(near(&row[4], 100.0 * libm::pow(0.025, 0.25)) && near(&row[5], 100.0), "{row:?}");
    // Two of ten rovers of the last group are stopped, one of them without a path.
    assert!(near(&found[2][3], 80.0) && near(&found[2][15], 10.0), "{:?}", found[2]);
    for figure in [
        "rover-mean-efficiency",
        "rover-straight-over-mean-distance",
        "rover-reached",
        "rover-outcomes",
        "rover-arrival-circle",
        "rover-tracks-2.30",
    ] {
        assert!(summary.figures.iter().any(|f| f == figure), "{figure} of {:?}", summary.figures);
    }
    let page = &files["index.html"];
    assert!(page.contains("Every set has fewer than 20 worlds (the smallest number is 4)"));
    assert!(page.contains("For 4 of 120 rovers, the ground has no path"));
    assert!(page.contains("2.60: 80 %"));
}

/// Budgets are read off the sorted distances; if a fifth of the rovers is stopped, 90 % is not reached and the row states it.
#[test]
fn val_budgets() {
    let files = report(&driven(4)).0;
    let found = rows(&files, "rover-budgets");
    assert_eq!(found.len(), 3 * 4);
    let mut all = distances(4);
    all.sort_by(f64::total_cmp);
    assert_eq!(found.iter().filter(|r| r[0] == "2.30").count(), 4);
    for row in found.iter().filter(|r| r[0] == "2.30") {
        let n = (row[1].as_f64().unwrap() / 100.0 * 40.0).round() as usize;
        assert!(near(&row[2], all[n - 1]) && near(&row[5], all[n - 1] / RADIUS_M), "{row:?}");
        assert!(row[3].as_f64().unwrap() <= all[n - 1]);
    }
    let row = found.iter().find(|r| r[0] == "2.60" && near(&r[1], 90.0)).unwrap();
    assert!(row[2].is_null() && row[6] == format!("not reached within {LIMIT_M:.1} m"), "{row:?}");
    // The curve of the last group ends at 80 %, its last step at the last arrival.
    let curve = rows(&files, "rover-arrival-circle");
    let last = curve.iter().rfind(|r| r[0] == "2.60").unwrap();
    assert!(near(&last[2], 0.8) && near(&last[1], RADIUS_M * factor(2.0, 3.0, 8.0)), "{last:?}");
}

/// Sizes in rows, clearances in columns, a block for each group; the list has every combination.
#[test]
fn val_designs() {
    let files = report(&driven(3)).0;
    for block in 1..=3 {
        let text = &files[&format!("data/rover-design-1-{block}.json")];
        let json: Value = serde_json::from_str(text).unwrap();
        let heads: Vec<&str> =
            json["columns"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
        assert_eq!(heads, ["scale", "clearance_m = 0.1", "clearance_m = 0.2"]);
        let rows = json["rows"].as_array().unwrap();
        assert_eq!((rows.len(), &rows[0][0], &rows[1][0]), (2, &Value::from("0.8"), &Value::from("1.2")));
        assert!(rows.iter().all(|r| r[1].as_str().unwrap().contains("; ") && r[2].is_string()), "{rows:?}");
    }
    let all = rows(&files, "rover-designs");
    assert_eq!(all.len(), 3 * 4);
    let of = |variant: &str| all.iter().find(|r| r[1] == "2.45" && r[2] == variant).unwrap()[5].as_f64().unwrap();
    let ratio = of("clearance_m = 0.1, scale = 1.2") / of("clearance_m = 0.2, scale = 0.8");
    assert!((ratio - 0.8).abs() < 1e-12, "{ratio}");
}

/// A release whose groups repeat the paper's trials.
fn repeated(worlds: usize) -> Data {
    let mut data = driven(worlds);
    let rocks = |coverage: f64| {
        format!("{{\"processes\": [{{\"kind\": \"texture\"}}, {{\"kind\": \"rocks\", \"coverage\": {coverage}}}]}}")
    };
    for terrain in &mut data.terrains {
        terrain.params = rocks(if terrain.group.as_deref() == Some("2.60") { 0.176 } else { 0.069 });
    }
    data.rovers.retain(|r| r.variant.is_none());
    data.rovers.iter_mut().for_each(|r| r.straight_m = 25.0);
    data
}

/// The paper's circle matches only the last group; each verdict follows from its row; a warning names other numbers of rovers.
#[test]
fn val_published_trials_are_compared_with_their_group() {
    assert!(!report(&driven(3)).0.contains_key("data/rover-published.json"));
    let files = report(&repeated(4)).0;
    assert_sound(&files);
    let found = rows(&files, "rover-published");
    assert_eq!(found.len(), 5);
    for row in &found {
        let [paper, ours, low, high, from, to] = [3, 4, 5, 6, 7, 8].map(|k| row[k].as_f64().unwrap());
        // The least efficiency is that of the limit in every world: no scatter.
        let scatters = row[1] != "least efficiency of a world";
        assert!(low <= ours && ours <= high && (low < high) == scatters, "{row:?}");
        assert!(from <= low + 1e-12 && high <= to + 1e-12, "{row:?}");
        assert_eq!(row[9] == "inside", (from..=to).contains(&paper), "{row:?}");
    }
    assert_eq!(found[0][3].as_f64(), Some(0.0893));
    assert!(
        files["index.html"]
            .contains("2.60: the paper has 100 rovers on its world, but all 4 of our worlds have other numbers")
    );
    // A single set and a single world are spoken of as such.
    let mut data = driven(3);
    data.rovers.retain(|r| r.terrain_id.starts_with("d2.30") && r.variant.is_none());
    let page = &report(&data).0["index.html"];
    assert!(page.contains("The rovers drove on 3 worlds, fewer than 20.") && !page.contains("Every set"));
    assert!(
        report(&repeated(1)).0["index.html"]
            .contains("the paper has 100 rovers on its world, but our world has another number")
    );
    // A single world has no band and no verdict.
    let files = report(&repeated(1)).0;
    assert!(rows(&files, "rover-published").iter().all(|r| r[7].is_null() && r[9] == "–"));
}

/// The strongest parameter comes first; the colour of a bar follows the interval of its mean effect.
#[test]
fn val_effects() {
    let (files, summary) = report(&driven(2));
    let figures: Vec<&String> = summary.figures.iter().filter(|f| f.starts_with("rover-effects-")).collect();
    assert_eq!(figures.len(), 3, "{figures:?}");
    assert_eq!(rows(&files, "rover-effects").len(), 4 * 3);
    let page = &files["index.html"];
    assert!(page.contains(
        "circle, 2.30: the most influential parameter is hazard_step_m for efficiency, hazard_step_m for arrival, hazard_step_m for distance."
    ));
    let svg = &files["figures/rover-effects-circle-2.30--efficiency.svg"];
    let at = |word: &str| svg.find(word).unwrap_or_else(|| panic!("{word}"));
    assert!(at(">hazard step<") < at(">turn deg<") && at(">turn deg<") < at(">goal tolerance<"), "order");
    assert!(
        !svg.contains("cycle limit")
            && files["index.html"].contains("3 of 4 parameters (1 without any effect), 8 trajectories on 3 worlds")
    );
    assert!(["raises", "lowers", "sign unclear"].iter().all(|w| svg.contains(w)));
}

/// One contact on one of two worlds: an interval on the logarithm would span more than a factor of 100, so none is given, and the page says why.
#[test]
fn val_intervals_that_say_nothing_are_left_out() {
    let mut data = driven(2);
    data.rovers.iter_mut().for_each(|r| r.contacts = 5);
    let effort = |data: &Data| rows(&report(data).0, "rover-effort").swap_remove(0);
    assert!([8, 9, 10].iter().all(|k| near(&effort(&data)[*k], 5.0)), "{:?}", effort(&data));
    let first = data.rovers[0].terrain_id.clone();
    data.rovers.iter_mut().for_each(|r| r.contacts = if r.terrain_id == first { 100 } else { 1 });
    let row = effort(&data);
    assert!(row[8].as_f64() > Some(1.0) && row[9].is_null() && row[10].is_null(), "{row:?}");
    assert!(report(&data).0["index.html"].contains("Too few worlds for an interval of the contacts"));
}

/// Pages are sound whatever is missing or extreme.
#[test]
fn prop_odd_releases_have_sound_pages() {
    type Take = (&'static str, fn(&mut Data));
    let each = |data: &mut Data, change: fn(&mut RoverRow)| data.rovers.iter_mut().for_each(change);
    let takes: [Take; 11] = [
        ("nothing", |_| ()),
        ("one rover", |d| d.rovers.truncate(1)),
        ("one world", |d| d.rovers.retain(|r| r.terrain_id == "d2.30-0000" && r.variant.is_none())),
        ("plain trials", |d| d.rovers.retain(|r| r.variant.is_some())),
        ("variants", |d| d.rovers.retain(|r| r.variant.is_none())),
        ("arrivals", |d| {
            d.rovers.iter_mut().for_each(|r| (r.outcome, r.distance_m) = ("distance_limit".into(), LIMIT_M))
        }),
        ("failures", |d| d.rovers.iter_mut().for_each(|r| (r.outcome, r.distance_m) = ("reached".into(), 22.0))),
        ("ways", |d| d.rovers.iter_mut().for_each(|r| (r.oracle, r.oracle_m) = ("none".into(), f64::NAN))),
        ("oracle", |d| d.rovers.iter_mut().for_each(|r| (r.oracle, r.oracle_m) = (String::new(), f64::NAN))),
        ("groups", |d| {
            d.rovers.iter_mut().for_each(|r| r.group = None);
            d.terrains.clear();
        }),
        ("files", |d| d.files = Box::new(made_up::Shelf::default())),
    ];
    for (name, take) in takes {
        let mut data = driven(2);
        take(&mut data);
        let (files, _) = report(&data);
        assert_sound(&files);
        assert!(files["index.html"].contains("<section id=\"rovers\">"), "without {name}");
    }
    let mut data = driven(1);
    each(&mut data, |r| r.efficiency = f64::NAN);
    assert_sound(&report(&data).0);
    data.rovers.clear();
    // Effects alone still have their section.
    assert!(report(&data).0["index.html"].contains("<section id=\"rovers\">"));
    data.rover_effects.clear();
    assert!(!report(&data).0["index.html"].contains("<section id=\"rovers\">"));
}

/// A rover that leaves the ground at its start has an efficiency of 1 without having driven: in means it counts as 0, it does not arrive, and the page states
/// the number of such rovers. The efficiency of arrivals leaves out rovers that are stopped.
#[test]
fn val_rovers_off_the_ground_count_as_zero() {
    let mut data = driven(4);
    let (before, first) = (rows(&report(&data).0, "rover-efficiency"), data.rovers[0].clone());
    let off = RoverRow {
        rover_id: "zz".into(),
        outcome: "off_ground".into(),
        distance_m: 0.0,
        residual_m: first.straight_m,
        efficiency: 1.0,
        efficiency_half_limit: 1.0,
        ..first.clone()
    };
    data.rovers.push(off);
    data.rovers.sort_by(|a, b| (&a.terrain_id, &a.rover_id).cmp(&(&b.terrain_id, &b.rover_id)));
    let files = report(&data).0;
    assert_sound(&files);
    let found = rows(&files, "rover-efficiency");
    assert!(near(&found[0][2], 41.0) && near(&found[0][3], 100.0 * 40.0 / 41.0), "{:?}", found[0]);
    for column in [6, 7, 13, 14] {
        let share = if column == 6 { 1.0 } else { 40.0 / 41.0 };
        assert!(near(&found[0][column], share * before[0][column].as_f64().unwrap()), "{column}: {:?}", found[0]);
    }
    assert!(files["index.html"].contains("1 of 121 rovers ended off the known ground."));
    // A fifth of the last group is stopped, so arrivals are more efficient than all rovers.
    let arrived: Vec<f64> = data
        .rovers
        .iter()
        .filter(|r| r.group.as_deref() == Some("2.60") || r.terrain_id.starts_with("2.60"))
        .filter(|r| r.outcome == "reached" && r.variant.is_none())
        .map(|r| r.efficiency)
        .collect();
    assert_eq!(arrived.len(), 32);
    assert!(near(&found[2][6], arrived.iter().sum::<f64>() / 32.0), "{:?}", found[2]);
    assert!(found[2][6].as_f64() > found[2][7].as_f64());
}

/// Efficiencies scattered around 0.98 on three worlds: intervals and bands on the logarithm would exceed 1 and are clipped there. Straight over mean distance
/// ends at the straight distance over the shortest drive, which is 0.4 m shorter.
#[test]
fn val_bands_end_at_a_straight_drive() {
    let mut data = driven(3);
    let factor = |r: &RoverRow| if r.terrain_id.ends_with('1') { 1.0 } else { 1.09 };
    for rover in &mut data.rovers {
        rover.outcome = "reached".into();
        rover.residual_m = 0.4;
        rover.distance_m = (RADIUS_M - 0.4) * factor(rover);
        rover.straight_m = RADIUS_M;
        rover.efficiency = RADIUS_M / (rover.distance_m + 0.4);
    }
    let files = report(&data).0;
    let most = RADIUS_M / (RADIUS_M - 0.4);
    for row in rows(&files, "rover-efficiency") {
        assert!(near(&row[9], 1.0) && near(&row[12], most), "{row:?}");
    }
}
