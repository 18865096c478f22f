//! Pages on routes, formations and losses.

use super::{assert_sound, made_up, report, rows};
use crate::data::Data;
use sastrugi_numeric::Grid;

/// Routes and teams alone, on `per_group` terrains in each of three groups.
fn navigated(per_group: usize) -> Data {
    let mut data = made_up::full(per_group, 24);
    data.missions.clear();
    data.replicates.clear();
    data.fits.clear();
    data.terrains.retain(|t| t.stage == "terrain");
    data
}

/// Costs of the synthetic roadmap without threshold are 1.2 times those of the grid, within 5 %.
#[test]
fn val_ratios_are_paired_with_the_grid() {
    let (files, summary) = report(&navigated(6));
    let found = rows(&files, "route-ratios");
    assert_eq!(found.len(), 3 * 2);
    assert_eq!(["nohdt", "hdt2"].map(|method| found.iter().filter(|r| r[1] == method).count()), [3, 3]);
    for row in found.iter().filter(|r| r[1] == "nohdt") {
        assert_eq!((row[2].as_str(), row[3].as_u64(), row[4].as_u64()), (Some("grid"), Some(12), Some(6)));
        let [mean, low, high, smallest, largest] = [5, 6, 7, 8, 9].map(|k| row[k].as_f64().unwrap());
        assert!((1.2 / 1.05..=1.2 * 1.05).contains(&mean) && low < mean && mean < high, "{row:?}");
        assert!(smallest <= low && high <= largest, "{row:?}");
    }
    // One of three pairs has no path, on 18 terrains with three methods.
    let page = &files["index.html"];
    assert!(page.contains("54 of 162 searches found no route"), "a warning");
    for figure in ["route-cost-ratios", "route-expansion-ratios", "vertex-shares", "routes-2.30"] {
        assert!(summary.figures.iter().any(|f| f == figure), "{figure}");
    }
    assert!(page.contains("3 maps, one for each group"));
}

/// Cells blocked by a route's obstacles are grey on the maps of routes and of tracks, and the legend explains it.
#[test]
fn val_obstacles_are_shown_on_maps() {
    let (mut data, mut shelf) = made_up::parts(1, 24);
    let legends = |data: &Data| report(data).0["index.html"].matches("cannot be entered").count();
    assert_eq!(legends(&data), 0);
    let paths =
        data.routes.iter().map(|r| (format!("route/{}/{}.blocked.tif", r.terrain_id, r.stage_id), &r.terrain_id));
    for (path, terrain) in paths {
        let heights = &shelf.grids[&data.terrain(terrain).unwrap().path];
        let codes = (0..heights.values.len()).map(|k| u8::from(k % heights.cols() == heights.cols() / 2)).collect();
        let blocked = Grid { geometry: heights.geometry, values: codes };
        shelf.classes.insert(path, blocked);
    }
    data.files = Box::new(shelf);
    assert!(legends(&data) >= 3, "{}", legends(&data));
}

/// Three terrains are too few for an interval: only the extremes are given.
#[test]
fn val_few_terrains_have_no_interval() {
    let found = rows(&report(&navigated(3)).0, "route-ratios");
    // Without any interval, there are no columns of them, and the page says why.
    assert!(found.len() == 6 && found.iter().all(|r| r.len() == 9), "{found:?}");
    assert!(found.iter().all(|r| r[6].as_f64() > Some(0.9) && r[6].as_f64() < r[7].as_f64()), "{found:?}");
    assert!(
        report(&navigated(3)).0["index.html"].contains("There are no intervals: pairs on one terrain are correlated")
    );
}

/// Without a grid, the first method on the same terms is the reference; searches on other terms are not compared.
#[test]
fn val_references_share_their_terms() {
    let mut data = navigated(1);
    data.routes.retain(|r| r.method != "grid");
    let found = rows(&report(&data).0, "route-ratios");
    assert!(found.len() == 3 && found.iter().all(|r| r[1] == "nohdt" && r[2] == "hdt2"));
    data.routes.iter_mut().filter(|r| r.stage_id == "hdt2").for_each(|r| r.cost = "energy".into());
    let files = report(&data).0;
    assert!(!files.contains_key("data/route-ratios.json") && files.contains_key("data/vertex-shares.json"));
    assert_sound(&files);
}

/// A release whose groups have the labels of maps in the thesis.
fn labelled() -> Data {
    let mut data = navigated(6);
    let label = |group: &mut Option<String>| {
        let name = match group.as_deref() {
            Some("2.30") => "plain 500",
            Some("2.45") => "rough 500",
            _ => "very rough 500",
        };
        *group = Some(name.into());
    };
    data.routes.iter_mut().for_each(|r| label(&mut r.group));
    data.formations.iter_mut().for_each(|f| label(&mut f.group));
    data
}

/// Published ratios are compared with ours, with a verdict that agrees with their row; other groups have no such section.
#[test]
fn val_the_thesis_is_compared_with_its_groups() {
    assert!(!report(&navigated(2)).0["index.html"].contains("<section id=\"thesis\">"));
    let (files, summary) = report(&labelled());
    assert_sound(&files);
    let routes = rows(&files, "bayrak-routes");
    // For the grid, the gain of smoothing; for HDT 2 and NoHDT, also the share and two costs.
    assert_eq!(routes.len(), 3 * (1 + 2 * 4));
    // HDT 2 and NoHDT have the colours that they have among the routes, where the grid comes first.
    let svg = &files["figures/bayrak-smoothed.svg"];
    assert_eq!(["l-s0", "l-s1", "l-s2"].map(|colour| svg.contains(colour)), [false, true, true]);
    // 703.412 / 632.04 of Table 5.3.
    let row =
        routes.iter().find(|r| r[0] == "smoothed cost relative to the grid" && r[2] == "rough 500" && r[3] == "NoHDT");
    assert!((row.unwrap()[4].as_f64().unwrap() - 1.112_923).abs() < 1e-5, "{row:?}");
    // Teams that arrived without losses: columns everywhere, wedges where none was stuck. Table 5.5 prints 1.78, 3.04 and 3.04.
    let teams = rows(&files, "bayrak-formations");
    assert_eq!(teams.len(), 2 * (2 + 2 + 1));
    let column = teams
        .iter()
        .find(|r| r[0] == "depth error relative to spacing" && r[2] == "plain 500" && r[3] == "column")
        .unwrap();
    assert!((column[4].as_f64().unwrap() - 26.2).abs() < 1e-9 && (column[5].as_f64().unwrap() - 20.0).abs() < 1e-9);
    for row in routes.iter().chain(&teams) {
        let [paper, low, high] = [4, 6, 7].map(|k| row[k].as_f64().unwrap());
        assert_eq!(row[10] == "inside", (low..=high).contains(&paper), "{row:?}");
    }
    for figure in ["bayrak-share", "bayrak-smoothed", "bayrak-depth", "bayrak-width"] {
        assert!(summary.figures.iter().any(|f| f == figure), "{figure}");
    }
}

/// Table 5.5's layout, errors over time, tracks; the verdict precedes the warning about stuck runs; a team of one has a row without
/// errors and no figure.
#[test]
fn val_formations_have_rows_curves_and_tracks() {
    let (files, summary) = report(&navigated(2));
    let found = rows(&files, "formation-errors");
    assert_eq!(found.len(), 4 * 3);
    let single = found.iter().find(|r| r[0].as_str().unwrap().starts_with("custom")).unwrap();
    assert!(single[4].is_null() && single[10].is_null() && single[3] == 2);
    let page = &files["index.html"];
    let at = |words: &str| page.find(words).unwrap_or_else(|| panic!("{words}"));
    assert!(at("Teams stay in tolerance 95 % of the time") < at("2 of 24 runs did not arrive: 2 stuck"));
    for formation in ["column", "line", "wedge"] {
        for figure in ["formation-errors", "formation-tracks"] {
            assert!(
                summary.figures.contains(&format!("{figure}-{formation}")),
                "{figure} {formation} {:?}",
                summary.figures
            );
        }
    }
    assert!(!summary.figures.iter().any(|f| f.contains("custom")));
}

/// The fourth member swings out by 3 m at the loss, returns to 0.8 m (40 % of the spacing) within eight seconds, and stays there.
#[test]
fn val_recovery_is_a_lasting_return_to_tolerance() {
    let (files, summary) = report(&navigated(6));
    let found = rows(&files, "losses");
    assert_eq!(found.len(), 18);
    for row in &found {
        assert_eq!((row[3].as_f64(), row[4].as_i64(), row[5].as_str()), (Some(30.0), Some(3), Some("yes")));
        // 3 (1 - t / 8) + 0.2 sin(0.3 (t + 30) + 3) is 0.94 m at 6 s, 0.57 m at 7 s; samples are 1 s apart.
        assert_eq!(row[6].as_f64(), Some(7.0));
        assert_eq!(row[8], "member 4 takes slot 3");
    }
    let page = &files["index.html"];
    assert!(
        page.contains("18 members were lost in 18 runs. After 18 of 18 losses, the team returned to tolerance")
            && page.contains("resampling terrains")
    );
    assert!(summary.figures.iter().any(|f| f == "loss-errors-line"));
    assert_eq!(summary.figures.iter().filter(|f| f.starts_with("loss-tracks-")).count(), 3);
    // Errors that never decrease: no return.
    let (mut data, mut shelf) = made_up::parts(1, 24);
    shelf.formation_samples.values_mut().flatten().filter(|s| s.member == 2).for_each(|s| s.width_error_m = 9.0);
    data.files = Box::new(shelf);
    let (files, _) = report(&data);
    assert!(rows(&files, "losses").iter().all(|r| r[6].is_null() && r[5] == "no"));
    assert!(files["index.html"].contains("No team returned to tolerance."));
    // No losses: no section.
    data.formations.iter_mut().for_each(|f| f.lost = 0);
    assert!(!report(&data).0["index.html"].contains("<section id=\"losses\">"));
}
