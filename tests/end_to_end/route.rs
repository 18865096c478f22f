//! Studies of routes: every search on the same pairs, obstacles, given ends, a measured DEM, and missions along routes.

use sastrugi_tests::{Row, area, differing, rows, sastrugi_in, sums, write};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

const HEAD: &str = r#"
[study]
name = "routes"
seed = 3
date = "2026-01-01"

[[terrain]]
id = "hills"
kind = "spheroids"
preset = "rough"
count = 2
size_px = [120, 100]
cell_m = 1.0
"#;

/// Four searches of the same pairs.
const SEARCHES: &str = r#"
[[route]]
id = "grid"
terrains = ["hills"]
pairs = 3
neighbours = 4

[[route]]
id = "roads"
terrains = ["hills"]
pairs = 3
neighbours = 4
method = "roadmap"
sweep.threshold_m = [0.5, 5.0]

[[route]]
id = "theta"
terrains = ["hills"]
pairs = 3
method = "theta_star"

[[route]]
id = "quick"
terrains = ["hills"]
pairs = 3
neighbours = 4
method = "anytime"
suboptimality = 3.0
"#;

fn run(folder: &Path, study: &str) -> BTreeMap<String, String> {
    write(folder, "study.toml", study);
    let call = sastrugi_in(folder, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    sums(&folder.join("release"))
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].as_f64().or(row[column].as_i64().map(|n| n as f64)).unwrap_or(f64::NAN)
}

fn text<'a>(row: &'a Row, column: &str) -> &'a str {
    row[column].as_str().unwrap_or_default()
}

/// All searches plan the same pairs; a smoothed path costs no more than the path, a bounded one no more than its bound, and none of
/// the same neighbourhood less than the grid's.
#[test]
fn prop_searches_plan_the_same_pairs_at_ordered_costs() {
    let folder = area();
    run(folder.path(), &format!("{HEAD}{SEARCHES}"));
    let routes = rows(&folder.path().join("release"), "routes");
    assert_eq!(routes.len(), 2 * 3 * 5);
    let mut grid: BTreeMap<&str, f64> = BTreeMap::new();
    for row in routes.iter().filter(|row| text(row, "stage_id") == "grid") {
        assert_eq!(text(row, "outcome"), "found");
        grid.insert(text(row, "pair_id"), number(row, "search_cost_m"));
    }
    assert_eq!(grid.len(), 6);
    for row in &routes {
        let (id, least) = (text(row, "route_id"), grid[text(row, "pair_id")]);
        assert!(number(row, "smoothed_cost_m") <= number(row, "path_cost_m") * (1.0 + 1e-9), "{id}");
        assert!(number(row, "length_m") >= number(row, "straight_m") - 1e-9, "{id}");
        assert!(
            number(row, "steepest_up_deg") <= 30.0 + 1e-6 && number(row, "steepest_down_deg") <= 30.0 + 1e-6,
            "{id}"
        );
        if number(row, "neighbours") == 4.0 {
            let bound = number(row, "cost_bound");
            assert!(number(row, "search_cost_m") >= least * (1.0 - 1e-9), "{id}");
            assert!(
                text(row, "method") == "roadmap" || number(row, "search_cost_m") <= bound * least * (1.0 + 1e-9),
                "{id}"
            );
        }
    }
    let of_stage = |stage: &str| routes.iter().filter(|row| text(row, "stage_id") == stage).collect::<Vec<_>>();
    let vertices = |stage: &str| of_stage(stage).iter().map(|row| number(row, "vertices")).sum::<f64>();
    assert!(vertices("roads-5") < vertices("roads-0.5") && vertices("roads-0.5") < vertices("grid"));
}

/// The points of a route lead from start to goal, and distances along it end at its length.
#[test]
fn val_points_of_a_route() {
    let folder = area();
    let study = format!(
        "{HEAD}\n[[route]]\nid = \"r\"\nterrains = [\"hills-0001\"]\nstart = [10.5, 20.5]\ngoal = [100.5, 80.5]\n"
    );
    run(folder.path(), &study);
    let release = folder.path().join("release");
    let routes = rows(&release, "routes");
    let points = rows(&release, "route_points");
    for form in ["searched", "smoothed"] {
        let of_form: Vec<&Row> = points.iter().filter(|row| text(row, "form") == form).collect();
        let (first, last) = (of_form[0], of_form[of_form.len() - 1]);
        assert_eq!([number(first, "x_m"), number(first, "y_m")], [10.5, 20.5]);
        assert_eq!([number(last, "x_m"), number(last, "y_m")], [100.5, 80.5]);
        assert_eq!(number(first, "distance_m"), 0.0);
    }
    let smoothed = points.iter().rfind(|row| text(row, "form") == "smoothed").unwrap();
    assert_eq!(number(smoothed, "distance_m"), number(&routes[0], "length_m"));
    let file: Value =
        serde_json::from_slice(&std::fs::read(release.join("route/hills-0001/r.geojson")).unwrap()).unwrap();
    let line = &file["features"][0]["geometry"];
    assert_eq!(line["coordinates"][0][0], 10.5);
    assert_eq!(line["coordinates"].as_array().unwrap().len() as f64, number(&routes[0], "smoothed_points"));
}

/// A route passes a wall through its gap; without the gap there is no route, which is a result, not a failure.
#[test]
fn val_routes_keep_clear_of_obstacles() {
    let polygon = |south: f64| {
        format!(r#"{{"type":"Polygon","coordinates":[[[50,{south}],[60,{south}],[60,100],[50,100],[50,{south}]]]}}"#)
    };
    let study = |file: &str| {
        format!(
            "{HEAD}\n[[route]]\nid = \"r\"\nterrains = [\"hills-0001\"]\nstart = [10.5, 80.5]\ngoal = [100.5, 80.5]\n\
             max_up_deg = 89.0\nmax_down_deg = 89.0\nobstacles = \"{file}\"\nobstacle_margin_m = 2.0\n"
        )
    };
    let folder = area();
    write(folder.path(), "wall.geojson", &polygon(20.0));
    run(folder.path(), &study("wall.geojson"));
    let release = folder.path().join("release");
    let points = rows(&release, "route_points");
    let inside = |row: &&Row| (48.0..62.0).contains(&number(row, "x_m"));
    assert!(points.iter().filter(inside).all(|row| number(row, "y_m") < 18.0));
    assert!(points.iter().filter(inside).count() > 0);
    assert!(sums(&release).keys().any(|path| path.starts_with("mask/r-1")));
    let blocked = sastrugi_store::dem::read_classes(&release.join("route/hills-0001/r.blocked.tif")).unwrap();
    let at = |x: f64, y: f64| blocked.geometry.cell_at(x, y).map(|(row, col)| blocked.at(row, col));
    assert_eq!([at(55.5, 50.5), at(48.5, 50.5), at(55.5, 18.5)], [Some(1); 3], "the wall and its margin");
    assert_eq!([at(45.5, 50.5), at(55.5, 10.5)], [Some(0); 2]);

    let folder = area();
    write(folder.path(), "wall.geojson", &polygon(-5.0));
    run(folder.path(), &study("wall.geojson"));
    let routes = rows(&folder.path().join("release"), "routes");
    assert_eq!(text(&routes[0], "outcome"), "no_path");
    assert!(number(&routes[0], "length_m").is_nan());
}

/// Routed missions have the same starts and goals as straight ones and are driven along the route.
#[test]
fn val_routed_missions_are_paired_with_straight_ones() {
    let study = r#"
[study]
name = "routed"
seed = 3
date = "2026-01-01"
pairing = "common"

[[terrain]]
id = "t"
kind = "multifractal"
count = 2
size_px = [200, 180]
high.fractal_dimension = 2.3

[[missions]]
id = "straight"
terrains = ["t"]
count = 2
length_m = 4.0
border_m = 1.5

[[missions]]
id = "routed"
kind = "routed"
of = "straight"
vehicle = "husky_a200"
route = { cost = "class", plan_cell_m = 0.25, class_factors = [1.0, 4.0, 16.0] }

[[traverse]]
id = "direct"
missions = "straight"
timeout_s = 20.0

[[traverse]]
id = "planned"
missions = "routed"
timeout_s = 20.0
"#;
    let folder = area();
    let first = run(folder.path(), study);
    let missions = rows(&folder.path().join("release"), "missions");
    let of = |id: &str| -> BTreeMap<&str, &Row> {
        missions.iter().filter(|row| text(row, "traverse_id") == id).map(|row| (text(row, "pair_id"), row)).collect()
    };
    let (direct, planned) = (of("direct"), of("planned"));
    // Two missions on each of two terrains.
    assert_eq!(direct.len(), 4);
    assert_eq!(direct.keys().collect::<Vec<_>>(), planned.keys().collect::<Vec<_>>());
    for (pair, row) in &direct {
        let [straight_m, along_m] = [number(row, "line_length_m"), number(planned[pair], "line_length_m")];
        assert!((straight_m - 4.0).abs() < 1e-6 && along_m >= straight_m - 1e-6, "{pair}: {straight_m} {along_m}");
        for column in ["start_x_m", "start_y_m", "goal_x_m", "goal_y_m"] {
            assert_eq!(number(row, column), number(planned[pair], column), "{pair} {column}");
        }
    }
    let other = area();
    write(other.path(), "study.toml", study);
    let call = sastrugi_in(other.path(), &["run", "study.toml", "-o", "release", "--quiet", "--threads", "1"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert_eq!(differing(&first, &sums(&other.path().join("release"))), Vec::<String>::new());
}

/// A trail of `compose` belongs to its terrain: missions follow it from end to end, in both directions.
#[test]
fn val_missions_follow_a_trail() {
    let study = r#"
[study]
name = "trail"
seed = 5
date = "2026-01-01"

[[terrain]]
id = "forest"
kind = "compose"
size_px = [150, 150]
cell_m = 0.2

[[terrain.processes]]
kind = "ornstein_uhlenbeck"
parameters = { mode = "isotropic", covariance = "gaussian", correlation_length_m = 6.0, rms_m = 0.3 }

[[terrain.processes]]
operation = "trail"
trail = { follows = "valleys", rut_depth_m = 0.04 }

[[missions]]
id = "along"
kind = "trail"
terrains = ["forest"]

[[missions]]
id = "back"
kind = "trail"
terrains = ["forest"]
backwards = true

[[traverse]]
id = "there"
missions = "along"
timeout_s = 120.0

[[traverse]]
id = "home"
missions = "back"
timeout_s = 120.0
"#;
    let folder = area();
    run(folder.path(), study);
    let release = folder.path().join("release");
    let missions = rows(&release, "missions");
    let of = |id: &str| missions.iter().find(|row| text(row, "traverse_id") == id).unwrap();
    let (there, home) = (of("there"), of("home"));
    assert_eq!(
        [number(there, "start_x_m"), number(there, "goal_y_m")],
        [number(home, "goal_x_m"), number(home, "start_y_m")]
    );
    for row in [there, home] {
        assert_eq!(text(row, "outcome"), "success");
        assert!(number(row, "line_length_m") > 30.0 && number(row, "max_cross_track_m") < 1.0);
    }
    let file: Value =
        serde_json::from_slice(&std::fs::read(release.join("terrain/forest.trails.geojson")).unwrap()).unwrap();
    assert_eq!(file["features"][0]["properties"]["name"], "trail");
    assert_eq!(file["features"][0]["geometry"]["coordinates"][0][0], number(there, "start_x_m"));

    let wrong = study.replace("backwards = true", "trail = \"trail-2\"");
    write(folder.path(), "study.toml", &wrong);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "wrong", "--quiet"]);
    let told: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    assert!(call.code == 2 && told.contains("on \"forest\": there is no \"trail-2\", only 1 trail"), "{told}");
}
