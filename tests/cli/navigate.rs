//! `navigate`: a route as GeoJSON, as a picture and as a release, and what is refused.

use sastrugi_tests::{Called, area, rows, sastrugi_in, write};
use serde_json::Value;
use std::path::Path;

/// A measured catchment of gullies: steep, with holes.
fn dem() -> String {
    sastrugi_fixtures::workspace_root().join("fixtures/dem/pozo_blanca.tif").to_string_lossy().into_owned()
}

fn navigate(folder: &Path, more: &[&str]) -> Called {
    let dem = dem();
    let ends = ["--start", "238990.5,3765350.4", "--goal", "239010.5,3765150.5"];
    let arguments: Vec<&str> = ["navigate", &dem].into_iter().chain(ends).chain(more.iter().copied()).collect();
    sastrugi_in(folder, &arguments)
}

#[test]
fn val_a_route_is_a_line_in_the_dems_own_coordinates() {
    let folder = area();
    let call = navigate(folder.path(), &["-o", "route.geojson", "--json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let told: Value = serde_json::from_str(&call.stdout).unwrap();
    let file: Value = serde_json::from_slice(&std::fs::read(folder.path().join("route.geojson")).unwrap()).unwrap();
    assert_eq!(file["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::26911");
    let points = file["features"][0]["geometry"]["coordinates"].as_array().unwrap();
    assert_eq!(points.len() as u64, told["route"]["points"].as_u64().unwrap());
    // The cells nearest to the ends.
    assert_eq!([&points[0][0], &points[0][1]], [238_990.5, 3_765_350.5]);
    assert_eq!(file["features"][0]["properties"], told["route"]);
    assert!(told["route"]["steepest_down_deg"].as_f64().unwrap() <= 30.0 + 1e-6);
}

#[test]
fn val_a_route_is_drawn_around_an_obstacle() {
    let folder = area();
    // Across the way that the plain route takes.
    let wall =
        r#"{"type":"Polygon","coordinates":[[[238940,3765250],[239060,3765250],[239060,3765256],[238940,3765250]]]}"#;
    write(folder.path(), "wall.geojson", wall);
    let plain = navigate(folder.path(), &["-o", "plain.svg", "--json"]);
    let around = navigate(folder.path(), &["--obstacles", "wall.geojson", "-o", "around.svg", "--json"]);
    assert_eq!((plain.code, around.code), (0, 0), "{}", around.stderr);
    let cost =
        |call: &Called| serde_json::from_str::<Value>(&call.stdout).unwrap()["route"]["cost_m"].as_f64().unwrap();
    assert!(cost(&around) > cost(&plain));
    let svg = std::fs::read_to_string(folder.path().join("around.svg")).unwrap();
    assert!(
        svg.contains("obstacle")
            && !std::fs::read_to_string(folder.path().join("plain.svg")).unwrap().contains("obstacle")
    );
}

#[test]
fn val_a_folder_is_a_release_with_the_route() {
    let folder = area();
    let call = navigate(folder.path(), &["--method", "theta_star", "-o", "release"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let routes = rows(&folder.path().join("release"), "routes");
    assert_eq!((routes.len(), &routes[0]["method"], &routes[0]["outcome"]), (1, &"theta_star".into(), &"found".into()));
    assert!(folder.path().join("release/route/dem/route.geojson").is_file());
    assert_eq!(sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all"]).code, 0);
}

/// Each wrong input: one sentence that says what would be right, its exit code, and no file.
#[test]
fn val_refusals() {
    let folder = area();
    for (more, code, words) in [
        (&["--set", "max_up_deg=95"][..], 2, "`max_up_deg` is 95; it must lie above 0 and below 90 degrees"),
        (&["--set", "neighbours=6"], 2, "`neighbours` is 6; a cell has 4 or 8 neighbours"),
        (&["--set", "cost=energy"], 2, "`cost` is \"energy\", which needs a vehicle"),
        (&["--set", "cost=raster"], 2, "`cost` is \"raster\", which needs the `cost_raster` of a [[route]]"),
        (&["--set", "threshold_m=0"], 2, "`threshold_m` is 0; it must be a finite number above 0"),
        (&["--set", "class_factors=[1.0, -2.0, 3.0]"], 2, "`class_factors.1` is -2"),
        (&["--set", "plan_cell_m=300"], 65, "leaves fewer than two planning cells"),
        (&["--set", "max_down_deg=3"], 65, "no route from start to goal"),
        (
            &["--method", "dijkstra"],
            2,
            "`method` has the unknown value `dijkstra`; known: `grid`, `roadmap`, `theta_star`, `anytime`",
        ),
        (&["--vehicle", "tank"], 2, "is `tank`; it must"),
        (&["--obstacles", "nothing.geojson"], 65, "nothing.geojson: no such file"),
    ] {
        let call = navigate(folder.path(), &[more, &["-o", "route.svg"]].concat());
        assert_eq!(call.code, code, "{more:?}: {}", call.stderr);
        assert!(call.stderr.contains(words) && call.stderr.trim().lines().count() == 1, "{more:?}: {}", call.stderr);
        assert!(!folder.path().join("route.svg").exists());
    }
    let dem = dem();
    for (start, goal, code, words) in [
        (
            "1,2",
            "239010,3765150",
            65,
            "the start (1, 2) lies outside the terrain, which covers x from 238933 to 239204",
        ),
        (
            "238990.5,3765350.5",
            "238990.2,3765350.3",
            65,
            "the start (238990.5, 3765350.5) and the goal (238990.2, 3765350.3) lie in the same cell of 1 x 1 m",
        ),
        (
            "238990.5,3765350.5",
            "238940.5,3765110.5",
            65,
            "the goal (238940.5, 3765110.5) cannot be entered: there is no height in its cell",
        ),
        ("238990", "239010,3765150", 2, "`--start 238990`: expected 2 numbers"),
    ] {
        let call = sastrugi_in(folder.path(), &["navigate", &dem, "--start", start, "--goal", goal, "-o", "r.geojson"]);
        assert_eq!(call.code, code, "{}", call.stderr);
        assert!(call.stderr.contains(words), "{}", call.stderr);
    }
}

#[test]
fn val_a_team_follows_the_route() {
    let folder = area();
    let team = ["--formation", "wedge", "--team", "members=3", "--team", "spacing_m=4"];
    let call = navigate(folder.path(), &[&team[..], &["-o", "release"]].concat());
    assert_eq!(call.code, 0, "{}", call.stderr);
    let runs = rows(&folder.path().join("release"), "formations");
    assert_eq!(runs.len(), 1);
    assert_eq!((runs[0]["members"].as_i64(), runs[0]["formation"].as_str()), (Some(3), Some("wedge")));
    // A route alone has no room for a team.
    let call = navigate(folder.path(), &[&team[..], &["-o", "route.svg"]].concat());
    assert_eq!(call.code, 2);
    assert!(call.stderr.contains("a team is written as a release"), "{}", call.stderr);
    let call = navigate(folder.path(), &["--team", "members=3", "-o", "release"]);
    assert_eq!(call.code, 2, "{}", call.stderr);
}
