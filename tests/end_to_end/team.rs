//! Studies of teams: runs along routes, their tables and recordings, losses and obstacles, and the same bytes however the study is run.

use sastrugi_tests::{Row, area, differing, rows, run_study, sastrugi_in, write};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const STUDY: &str = r#"
[study]
name = "teams"
seed = 3
date = "2026-01-01"

[[terrain]]
id = "hills"
kind = "spheroids"
preset = "rough"
count = 2
size_px = [160, 140]
cell_m = 1.0

[[route]]
id = "ways"
terrains = ["hills"]
pairs = 2
border_m = 20.0
method = "roadmap"

[[navigate]]
id = "lossy"
route = "ways"
formation = "wedge"
spacing_m = 5.0
count = 2
drawn_losses = 1
drawn_obstacles = 2

[[navigate]]
id = "plain"
route = "ways"
spacing_m = 5.0
sweep.formation = ["column", "line"]

[[navigate]]
id = "nested"
route = "ways"
formation = "custom"
slots = [
  { id = 1 },
  { id = 2, predecessor = 1, depth_m = 8.0, width_m = 4.0, team = [{ id = 1 }, { id = 2, predecessor = 1, depth_m = 3.0 }] },
]
losses = [{ time_s = 20.0, member = 2 }]
"#;

fn number(row: &Row, column: &str) -> f64 {
    row[column].as_f64().or(row[column].as_i64().map(|n| n as f64)).unwrap_or(f64::NAN)
}

fn text<'a>(row: &'a Row, column: &str) -> &'a str {
    row[column].as_str().unwrap_or_default()
}

#[test]
fn val_runs_have_rows_samples_events_and_recordings() {
    let folder = area();
    let release = folder.path().join("release");
    let sums = run_study(folder.path(), STUDY, &[]);
    let runs = rows(&release, "formations");
    // Two terrains with two routes: two runs with losses, two formations, one nested team.
    assert_eq!(runs.len(), 2 * 2 * (2 + 2 + 1));
    let samples = rows(&release, "formation_samples");
    let events = rows(&release, "formation_events");
    let routes: BTreeSet<String> =
        rows(&release, "routes").iter().map(|row| text(row, "route_id").to_owned()).collect();
    for run in &runs {
        let id = (text(run, "terrain_id"), text(run, "run_id"));
        let of = |rows: &[Row]| {
            rows.iter().filter(|row| (text(row, "terrain_id"), text(row, "run_id")) == id).cloned().collect::<Vec<_>>()
        };
        assert_eq!(text(run, "outcome"), "arrived", "{id:?}");
        assert!(routes.contains(text(run, "route_id")));
        assert!(sums.contains_key(text(run, "path")), "{}", text(run, "path"));
        assert!(number(run, "least_separation_m") >= 1.0 - 1e-9);
        assert_eq!(number(run, "obstacle_contacts"), 0.0);
        let (own, told) = (of(&samples), of(&events));
        assert_eq!(own.len() as f64, number(run, "samples") * number(run, "members"));
        let kinds: Vec<&str> = told.iter().map(|row| text(row, "kind")).collect();
        assert_eq!((kinds.first(), kinds.last()), (Some(&"start"), Some(&"end")));
        let lost = kinds.iter().filter(|kind| **kind == "lost").count() as f64;
        assert_eq!(lost, number(run, "lost"));
        assert_eq!(lost, if text(run, "stage_id").starts_with("plain") { 0.0 } else { 1.0 });
        // A lost member stays in the table, without a slot.
        let of_lost: Vec<&Row> = own.iter().filter(|row| text(row, "state") == "lost").collect();
        assert_eq!(of_lost.is_empty(), lost == 0.0, "{id:?}");
        assert!(of_lost.iter().all(|row| row["slot"].is_null()), "{id:?}");
        let members: BTreeSet<String> = of_lost.iter().map(|row| row["member"].to_string()).collect();
        assert_eq!(members.len() as f64, lost, "{id:?}: {members:?}");
    }
    let formations: BTreeSet<&str> = runs.iter().map(|row| text(row, "formation")).collect();
    assert_eq!(formations, ["column", "custom", "line", "wedge"].into());
    // A custom formation has no single spacing.
    assert!(runs.iter().all(|row| number(row, "spacing_m").is_nan() == (text(row, "formation") == "custom")));
}

/// A team that knows the route, and teams that plan with limited sensing: all arrive, those that see little replan, and their recordings contain
/// every route.
#[test]
fn val_teams_plan_with_limited_sensing() {
    let folder = area();
    let (head, _) = STUDY.split_once("[[navigate]]").unwrap();
    let team = "[[navigate]]\nid = \"team\"\nroute = \"ways\"\nformation = \"wedge\"\nspacing_m = 4.0\n";
    let seeing = team.replace("\"team\"", "\"seeing\"") + "sweep.sensing_radius_m = [8.0, 500.0]\n";
    let sums = run_study(folder.path(), &[head, team, &seeing].concat(), &[]);
    let release = folder.path().join("release");
    let (runs, events) = (rows(&release, "formations"), rows(&release, "formation_events"));
    assert_eq!(runs.len(), 2 * 2 * 3);
    let mut replans = BTreeMap::new();
    for run in &runs {
        assert_eq!(text(run, "outcome"), "arrived", "{run:?}");
        let of = |row: &&Row| ["terrain_id", "run_id"].iter().all(|key| text(row, key) == text(run, key));
        let told = events.iter().filter(of).filter(|row| text(row, "kind") == "replanned").count();
        assert_eq!(told as f64, number(run, "replans"));
        *replans.entry(text(run, "stage_id").to_owned()).or_insert(0.0) += number(run, "replans");
        let info = sastrugi_in(&release, &["info", text(run, "path"), "--json"]);
        let info: serde_json::Value = serde_json::from_str(&info.stdout).unwrap();
        let routes = info["topics"]["/team/route"].as_u64().unwrap();
        let sees_little = text(run, "stage_id").contains("8");
        assert!(if sees_little { routes > 5 } else { routes == 1 }, "{}: {routes}", text(run, "run_id"));
        assert!(sums.contains_key(text(run, "path")));
    }
    let counts: Vec<bool> = replans.values().map(|count| *count > 0.0).collect();
    assert_eq!(counts.iter().filter(|planned| **planned).count(), 1, "{replans:?}");
}

#[test]
fn val_draws_differ_from_run_to_run_and_stay() {
    let folder = area();
    run_study(folder.path(), STUDY, &[]);
    let lost = |folder: &Path| -> BTreeMap<String, (String, f64)> {
        let events = rows(&folder.join("release"), "formation_events");
        let lost = events.iter().filter(|row| text(row, "kind") == "lost" && text(row, "run_id").starts_with("lossy"));
        lost.map(|row| {
            (
                format!("{} {}", text(row, "terrain_id"), text(row, "run_id")),
                (row["member"].to_string(), number(row, "time_s")),
            )
        })
        .collect()
    };
    let first = lost(folder.path());
    assert_eq!(first.len(), 8);
    let times: BTreeSet<String> = first.values().map(|(_, time_s)| time_s.to_string()).collect();
    assert!(times.len() > 4, "{times:?}");
    // Additional runs do not change the existing ones.
    let more = area();
    run_study(more.path(), &STUDY.replace("count = 2\ndrawn", "count = 3\ndrawn"), &[]);
    let more = lost(more.path());
    assert_eq!(more.len(), 12);
    assert!(first.iter().all(|(id, one)| more.get(id) == Some(one)));
}

#[test]
fn prop_a_release_of_teams_has_the_same_bytes() {
    let (one, two) = (area(), area());
    let [first, second] =
        [(&one, "1"), (&two, "2")].map(|(folder, threads)| run_study(folder.path(), STUDY, &["--threads", threads]));
    assert_eq!(differing(&first, &second), Vec::<String>::new());
}

#[test]
fn val_bags_open_as_folders() {
    let folder = area();
    let sums = run_study(folder.path(), &STUDY.replace("date =", "mcap = \"ros2\"\ndate ="), &[]);
    for file in ["plain-column-0001-01.mcap", "metadata.yaml"] {
        let path = format!("mcap/hills-0001/plain-column-0001-01/{file}");
        assert!(sums.contains_key(&path), "{path}");
    }
}

#[test]
fn val_a_team_without_room_has_a_row() {
    let folder = area();
    // Twenty discs of 50 m do not fit on the map.
    let losses = "spacing_m = 5.0\ncount = 2\ndrawn_losses = 1\ndrawn_obstacles = 2";
    let study = STUDY.replace(losses, "spacing_m = 60.0\nradius_m = 25.0\nmembers = 20");
    run_study(folder.path(), &study, &[]);
    let runs = rows(&folder.path().join("release"), "formations");
    let crowded: Vec<&Row> = runs.iter().filter(|row| text(row, "stage_id") == "lossy").collect();
    assert!(!crowded.is_empty());
    for row in crowded {
        assert_eq!(text(row, "outcome"), "no_room");
        assert!(row["path"].is_null() && number(row, "time_s").is_nan());
    }
}

#[test]
fn val_wrong_teams_are_refused_with_their_line() {
    let cases = [
        ("route = \"ways\"\nformation = \"wedge\"", "route = \"way\"\nformation = \"wedge\"", "did you mean \"ways\"?"),
        ("formation = \"wedge\"", "formation = \"vee\"", "vee"),
        ("formation = \"wedge\"", "formation = \"wedge\"\nradius_m = 4.0", "slots 1 and 2 lie 7.071 m apart"),
        ("count = 2\ndrawn", "count = 0\ndrawn", "`count` is 0; it must be 1 to 9999"),
        ("count = 2\ndrawn", "count = 10000\ndrawn", "`count` is 10000; it must be 1 to 9999"),
        ("pairs = 2", "pairs = 0", "`pairs` is 0; it must be 1 to 9999"),
        ("pairs = 2", "pairs = 10000", "`pairs` is 10000; it must be 1 to 9999"),
        ("drawn_losses = 1", "drawn_losses = 4", "must be kept"),
        ("member = 2 }", "member = 4 }", "member 4 is not in the team"),
        ("predecessor = 1, depth_m = 8.0", "predecessor = 3, depth_m = 8.0", "follows slot 3"),
        ("drawn_obstacles = 2", "drawn_obstacle = 2", "drawn_obstacles"),
        ("method = \"roadmap\"", "sweep.method = [\"roadmap\", \"grid\"]", "name one of its searches"),
    ];
    for (right, wrong, told) in cases {
        let folder = area();
        write(folder.path(), "study.toml", &STUDY.replacen(right, wrong, 1));
        let call = sastrugi_in(folder.path(), &["plan", "study.toml"]);
        assert_eq!(call.code, 2, "{wrong}: {}", call.stderr);
        assert!(call.stderr.contains(told), "{wrong}: {}", call.stderr);
    }
}
