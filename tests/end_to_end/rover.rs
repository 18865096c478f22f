//! Studies of rovers: tables, refusals, and the same bytes however the study is run.

use sastrugi_tests::{Row, area, differing, rows, run_in_shards, run_study, run_with_kills, sastrugi_in, write};
use std::collections::BTreeSet;

const STUDY: &str = r#"
[study]
name = "rovers"
seed = 3
date = "2026-01-01"
pairing = "common"

[[terrain]]
id = "sparse"
kind = "planetary"
group = "sparse"
count = 2
size_m = [20.0, 20.0]
cell_m = 0.16
basic_spacing_m = 0.02
origin_m = [-9.92, -9.92]
processes = [{ kind = "texture", roughness_m = 0.005 }, { kind = "rocks", coverage = 0.069, diameter_min_m = 0.1 }]

[[terrain]]
id = "dense"
kind = "planetary"
group = "dense"
count = 2
size_m = [20.0, 20.0]
cell_m = 0.16
basic_spacing_m = 0.02
origin_m = [-9.92, -9.92]
processes = [{ kind = "texture", roughness_m = 0.005 }, { kind = "rocks", coverage = 0.15, diameter_min_m = 0.1 }]

[[terrain]]
id = "plate"
kind = "multifractal"
size_px = [128, 128]
cell_m = 0.1

[[rover]]
id = "rays"
kind = "sojourner_like"
terrains = ["sparse", "dense"]
rovers = 6
radius_m = 8.0
sample_m = 1.0

[[rover]]
id = "boxes"
kind = "schoppers_like"
terrains = ["dense"]
rovers = 3
starts = "drawn"
radius_m = 4.0
distance_m = 9.0
sweep.clearance_m = [0.13, 0.2]

[[rover]]
id = "plans"
kind = "planner"
sensor = "rectangles"
terrains = ["dense"]
rovers = 3
radius_m = 6.0
record = 0

[[rover]]
id = "plates"
kind = "sojourner_like"
terrains = ["plate"]
rovers = 4
centre_m = [6.0, 6.0]
radius_m = 5.0
hazard_step_m = 1.0
hazard_span_m = 2.0
tilt_max_deg = 80.0
"#;

fn number(row: &Row, column: &str) -> f64 {
    row[column].as_f64().or(row[column].as_i64().map(|n| n as f64)).unwrap_or(f64::NAN)
}

fn text<'a>(row: &'a Row, column: &str) -> &'a str {
    row[column].as_str().unwrap_or_default()
}

#[test]
fn val_rovers_have_rows_and_samples() {
    let folder = area();
    run_study(folder.path(), STUDY, &[]);
    let release = folder.path().join("release");
    let (rovers, samples) = (rows(&release, "rovers"), rows(&release, "rover_samples"));
    assert_eq!(rovers.len(), 2 * 2 * 6 + 2 * 2 * 3 + 2 * 3 + 4);
    for rover in &rovers {
        let of = |row: &&Row| ["terrain_id", "rover_id"].iter().all(|key| text(row, key) == text(rover, key));
        let own: Vec<&Row> = samples.iter().filter(of).collect();
        let [straight_m, distance_m, residual_m, e] =
            ["straight_m", "distance_m", "residual_m", "efficiency"].map(|column| number(rover, column));
        assert!((e - straight_m / (distance_m + residual_m)).abs() < 1e-12 && e <= 1.0 && e > 0.0);
        let reached = text(rover, "outcome") == "reached";
        assert_eq!(reached, rover["note"].is_null());
        assert!(!reached || residual_m <= 0.5);
        assert!(own.len() as f64 >= distance_m / 1.2, "{} samples over {distance_m} m", own.len());
        assert_eq!(number(own[0], "x_m"), number(rover, "start_x_m"));
        let areas = text(own[0], "hazards").len();
        assert_eq!(areas, if text(rover, "navigator") == "sojourner_like" { 5 } else { 4 });
        // The path of a rover that knows the complete map is the shortest, up to the cells of that map.
        let oracle_m = number(rover, "oracle_m");
        assert_eq!(oracle_m.is_nan(), text(rover, "oracle") == "none");
        assert!(oracle_m.is_nan() || oracle_m >= straight_m - 0.2);
        assert!(!(number(rover, "contacts") == 0.0 && distance_m + residual_m < oracle_m - 0.2), "{rover:?}");
        assert!(number(rover, "max_tilt_deg") >= 0.0 && number(rover, "rms_pitch_rate_deg_s") >= 0.0);
    }
    let mean = |group: &str| {
        let of_group = rovers.iter().filter(|row| text(row, "group") == group && text(row, "stage_id") == "rays");
        of_group.map(|row| number(row, "efficiency")).sum::<f64>() / 12.0
    };
    assert!(mean("sparse") > mean("dense"), "{} {}", mean("sparse"), mean("dense"));
    // Starts, headings and noise are shared between densities and between the values of a sweep.
    let starts = |stage: &str, group: &str| -> BTreeSet<String> {
        let of = rovers.iter().filter(|row| text(row, "stage_id") == stage && text(row, "group") == group);
        of.map(|row| ["start_x_m", "start_heading_deg", "goal_y_m"].map(|c| row[c].to_string()).join(" ")).collect()
    };
    assert_eq!(starts("rays", "sparse"), starts("rays", "dense"));
    assert_eq!(starts("boxes-0.13", "dense"), starts("boxes-0.2", "dense"));
    assert_eq!(starts("boxes-0.13", "dense").len(), 6);
}

/// The window of a planetary terrain is only its picture: rovers drive beyond it. Other ground ends at its edge, and a note states it.
#[test]
fn val_worlds_are_unbounded_and_grids_end() {
    let folder = area();
    let study = STUDY.replace("radius_m = 8.0", "radius_m = 14.0").replace("radius_m = 5.0", "radius_m = 5.7");
    write(folder.path(), "study.toml", &study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let rovers = rows(&folder.path().join("release"), "rovers");
    let of = |stage: &str| rovers.iter().filter(|row| text(row, "stage_id") == stage).collect::<Vec<_>>();
    assert_eq!((of("rays").len(), of("plates").len()), (2 * 2 * 6, 4));
    assert!(of("rays").iter().all(|row| text(row, "outcome") != "off_ground"));
    let off: Vec<&str> =
        of("plates").iter().filter(|row| text(row, "outcome") == "off_ground").map(|row| text(row, "note")).collect();
    assert!(!off.is_empty() && off.iter().all(|note| note.starts_with("there is no ground at x = ")), "{off:?}");
}

/// Rovers with a start or goal off the terrain are refused (section 8) before the run, with the place.
#[test]
fn val_places_off_the_terrain_are_refused() {
    let folder = area();
    for (from, to) in [("centre_m = [6.0, 6.0]", "centre_m = [60.0, 6.0]"), ("radius_m = 5.0", "radius_m = 50.0")] {
        write(folder.path(), "study.toml", &STUDY.replace(from, to));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
        let told: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert_eq!(call.code, 2, "{to}: {told}");
        assert!(told.contains("lies off the terrain: there is no ground at x = "), "{to}: {told}");
    }
}

#[test]
fn prop_a_release_of_rovers_has_the_same_bytes() {
    let (one, two) = (area(), area());
    let [first, second] =
        [(&one, "1"), (&two, "2")].map(|(folder, threads)| run_study(folder.path(), STUDY, &["--threads", threads]));
    assert_eq!(differing(&first, &second), Vec::<String>::new());
    let shards = area();
    write(shards.path(), "study.toml", STUDY);
    assert_eq!(differing(&first, &run_in_shards(shards.path(), "study.toml")), Vec::<String>::new());
    assert!(first.keys().filter(|path| path.ends_with(".mcap")).count() == 4 + 4 + 1, "recordings are among them");
    // Killed while running, and restarted.
    let killed = run_with_kills(area().path(), STUDY, &first, &[50, 400, 1200, 2500]);
    assert_eq!(differing(&first, &killed), Vec::<String>::new());
}

/// The first rovers of each terrain are recorded, and `analyze` finds in a recording the metrics of the table: the same code judges the same poses.
#[test]
fn val_recordings_have_the_metrics_of_the_table() {
    let folder = area();
    run_study(folder.path(), &STUDY.replace("sample_m = 1.0", "record = 2"), &[]);
    let release = folder.path().join("release");
    let rovers = rows(&release, "rovers");
    let recorded: Vec<&Row> = rovers.iter().filter(|row| !row["path"].is_null()).collect();
    let of = |stage: &str| recorded.iter().filter(|row| text(row, "stage_id").starts_with(stage)).count();
    assert_eq!(["rays", "boxes", "plans", "plates"].map(of), [2 * 2 * 2, 2 * 2, 0, 1]);
    for row in recorded.into_iter().filter(|row| text(row, "stage_id") == "rays") {
        let path = text(row, "path");
        assert_eq!(path, format!("mcap/{}/{}.mcap", text(row, "terrain_id"), text(row, "rover_id")));
        let call = sastrugi_in(folder.path(), &["analyze", &format!("release/{path}"), "--json"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        let told: serde_json::Value = serde_json::from_str(&call.stdout).unwrap();
        let log = &told[0]["log"];
        let same = |column: &str, tolerance: f64| {
            let (found, expected) = (log[column].as_f64().unwrap_or(f64::NAN), number(row, column));
            assert!((found - expected).abs() <= tolerance * expected.abs(), "{path}: {column} {found} {expected}");
        };
        for column in ["max_pitch_deg", "max_roll_deg", "rms_pitch_rate_deg_s", "rms_roll_rate_deg_s"] {
            same(column, 1e-9);
        }
        // Up to a second of poses at the end is not recorded.
        assert!((log["time_s"].as_f64().unwrap() - number(row, "time_s")).abs() <= 1.0);
        assert_eq!(log["outcome"], row["outcome"], "{path}");
    }
}

/// A rover whose goal is unreachable still has its row, marked as such, and the others of its draw stay where they were (section 11).
#[test]
fn val_pairs_without_a_path_are_marked() {
    let of = |clearance_m: &str| {
        let folder = area();
        let study = STUDY.replace(
            "sweep.clearance_m = [0.13, 0.2]",
            &format!("clearance_m = {clearance_m}\nscale = 1.5\ncycle_limit = 300"),
        );
        run_study(folder.path(), &study, &[]);
        let rovers = rows(&folder.path().join("release"), "rovers");
        rovers.into_iter().filter(|row| text(row, "stage_id") == "boxes").collect::<Vec<Row>>()
    };
    let (low, usual) = (of("0.02"), of("0.13"));
    let without = low.iter().filter(|row| text(row, "oracle") == "none").count();
    assert!(without > 0 && low.len() == usual.len(), "{without} of {}", low.len());
    for (a, b) in low.iter().zip(&usual) {
        assert_eq!(number(a, "oracle_m").is_nan(), text(a, "oracle") == "none");
        assert!(["start_x_m", "start_y_m", "goal_x_m", "goal_y_m"].iter().all(|column| a[*column] == b[*column]));
    }
}

/// Quantised heights are refused for rovers, because a step would look like a rock (section 11). The message states the step.
#[test]
fn val_heights_in_steps_are_refused() {
    let folder = area();
    // 64 x 64 cells, 600 m of relief in steps of 61 mm.
    let heights = (0..64 * 64).map(|k: u32| format!("{:.3}", 0.061 * f64::from(k * 7919 % 9973)));
    let heights = heights.collect::<Vec<_>>().join(" ");
    let header = "ncols 64\nnrows 64\nxllcorner 0\nyllcorner 0\ncellsize 0.5\nNODATA_value -9999\n";
    write(folder.path(), "steps.asc", &format!("{header}{heights}\n"));
    let study = "[study]\nname = \"steps\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"steps\"\nfile = \"steps.asc\"\n\n\
                 [[rover]]\nid = \"rays\"\nkind = \"sojourner_like\"\nterrains = [\"steps\"]\nrovers = 1\nradius_m = 5.0\ncentre_m = [16.0, 16.0]\n";
    write(folder.path(), "study.toml", study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    let told: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    assert!(call.code != 0 && told.contains("heights come in steps of 61.0 mm"), "{}: {told}", call.code);
}

/// Refusals of section 8, with one sentence each.
#[test]
fn val_wrong_studies_are_refused() {
    let folder = area();
    for (from, to, words) in [
        ("rovers = 6", "rovers = 0", "rover \"rays\": `rovers` is 0; it must be 1 to 9999"),
        (
            "kind = \"sojourner_like\"\nterrains = [\"sparse\"",
            "kind = \"flier\"\nterrains = [\"sparse\"",
            "`flier` is not a navigator",
        ),
        ("radius_m = 8.0", "radius_m = 0.0", "`radius_m` is 0"),
        ("sample_m = 1.0", "sample_m = -1.0", "`sample_m` is -1"),
        ("sample_m = 1.0", "cell_m = 0.03", "1.5 times the basic spacing"),
        ("sample_m = 1.0", "clearence_m = 0.1", "did you mean"),
        ("terrains = [\"plate\"]", "terrains = []", "`terrains` is empty"),
        ("terrains = [\"plate\"]", "terrains = [\"plait\"]", "names \"plait\""),
        ("hazard_step_m = 1.0", "hazard_step_m = -1.0", "`hazard_step_m` is -1"),
        ("hazard_step_m = 1.0", "noise = { slip = 2.0 }", "`noise.slip` is 2"),
        ("radius_m = 8.0", "radius_m = 0.3", "`radius_m` is 0.3 m; it must exceed `goal_tolerance_m`, 0.5 m"),
        ("sensor = \"rectangles\"", "sensor = \"sonar\"", "sonar"),
        ("sensor = \"rectangles\"", "pass_m = 1.0", "`pass_m` is a rule of the reactive navigators"),
        ("sensor = \"rectangles\"", "rectangles = 4", "`rectangles` is a parameter of `schoppers_like`"),
        ("sensor = \"rectangles\"", "map_cell_m = 0.001", "more than 1048576"),
        ("sensor = \"rectangles\"", "map_beyond_m = 0.0", "`map_beyond_m` is 0"),
    ] {
        assert!(STUDY.contains(from), "{from}");
        write(folder.path(), "study.toml", &STUDY.replace(from, to));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
        let told: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert_eq!(call.code, 2, "{to}: {told}");
        assert!(told.contains(words), "{to}: {told}");
    }
}
