//! Studies of traversal: pairing, sweeps, replicates; and missions on a measured DEM.

use sastrugi_tests::{Row, area, differing, rows, sastrugi_in, sums, write};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Two groups that share their draws, a changed terrain, a changed vehicle, three starts each.
const PAIRED: &str = r#"
[study]
name = "paired"
seed = 3
date = "2026-01-01"
pairing = "common"

[[terrain]]
id = "a"
kind = "multifractal"
group = "a"
count = 2
size_px = [200, 180]
high.fractal_dimension = 2.3

[[terrain]]
id = "b"
kind = "multifractal"
group = "b"
count = 2
size_px = [200, 180]
high.fractal_dimension = 2.6

[[terrain]]
id = "flat"
kind = "multifractal"
group = "b"
count = 2
size_px = [200, 180]
sweep.z_scale_percent = [0.1, 0.2]

[[missions]]
id = "m"
terrains = ["a", "b"]
count = 2
length_m = 3.0
border_m = 1.5

[[missions]]
id = "flat-m"
terrains = ["flat-0.1"]
count = 2
length_m = 3.0
border_m = 1.5

[[traverse]]
id = "husky"
missions = "m"
timeout_s = 12.0

[[traverse]]
id = "grip"
missions = "m"
replicates = 3
timeout_s = 12.0
sweep."surface.wheel_friction" = [0.5, 0.7]

[[traverse]]
id = "flat-husky"
missions = "flat-m"
timeout_s = 12.0
sweep."vehicle_changes.drive.torque_limit_n_m" = [30.0]
"#;

/// Runs a study to the folder's `release`; returns the checksums of the release.
pub fn run(folder: &Path, study: &str, threads: &str) -> BTreeMap<String, String> {
    write(folder, "study.toml", study);
    let call = sastrugi_in(folder, &["run", "study.toml", "-o", "release", "--quiet", "--threads", threads]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    sums(&folder.join("release"))
}

/// A column of text.
pub fn text<'a>(row: &'a Row, column: &str) -> &'a str {
    row[column].as_str().unwrap_or_default()
}

/// The values of some columns, to be compared.
fn of(row: &Row, columns: &[&str]) -> String {
    columns.iter().map(|column| row[*column].to_string()).collect::<Vec<_>>().join(" ")
}

const LINE: [&str; 4] = ["start_x_m", "start_y_m", "goal_x_m", "goal_y_m"];

#[test]
fn val_a_paired_study_has_its_rows() {
    let folder = area();
    run(folder.path(), PAIRED, "2");
    let release = folder.path().join("release");
    let terrains = rows(&release, "terrains");
    for row in &terrains {
        let number = text(row, "terrain_id").rsplit('-').next().unwrap();
        assert_eq!(text(row, "stream"), format!("item/3/terrain/common-{number}"));
    }
    let variants: BTreeSet<&str> = terrains.iter().map(|row| text(row, "variant")).collect();
    assert_eq!(variants, ["", "z_scale_percent = 0.1", "z_scale_percent = 0.2"].into());

    let missions = rows(&release, "missions");
    // Four terrains with the plain run and two variants, two with a changed terrain; two missions each.
    assert_eq!(missions.len(), 2 * (4 * 3 + 2));
    let mut lines: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for row in &missions {
        lines.entry(text(row, "pair_id")).or_default().insert(of(row, &LINE));
    }
    // `<missions>-<replicate>-<mission>.<draw>`: the same pair, the same line; groups share some of them.
    let blocks: BTreeSet<&str> = lines.keys().map(|pair| pair.split('.').next().unwrap()).collect();
    let expected =
        ["flat-m-0001-", "flat-m-0002-", "m-0001-", "m-0002-"].map(|p| [format!("{p}0001"), format!("{p}0002")]);
    assert_eq!(blocks, expected.as_flattened().iter().map(String::as_str).collect());
    assert!(lines.values().all(|lines| lines.len() == 1), "{lines:?}");
    let groups = |pair: &str| -> BTreeSet<&str> {
        missions.iter().filter(|r| text(r, "pair_id") == pair).map(|r| text(r, "group")).collect()
    };
    assert!(lines.keys().any(|pair| groups(pair) == BTreeSet::from(["a", "b"])), "{lines:?}");
    let variants: BTreeSet<(&str, &str)> =
        missions.iter().map(|row| (text(row, "traverse_id"), text(row, "variant"))).collect();
    let flat = "z_scale_percent = 0.1, vehicle_changes.drive.torque_limit_n_m = 30.0";
    let swept = |value: &str| format!("surface.wheel_friction = {value}");
    let (half, more) = (swept("0.5"), swept("0.7"));
    assert_eq!(variants, [("flat-husky-30.0", flat), ("grip-0.5", &half), ("grip-0.7", &more), ("husky", "")].into());
    replicates(&missions, &rows(&release, "replicates"));
}

/// Three starts of every mission with replicates: the first is the mission's, the others are shared between groups and
/// values, and lie within the tolerance.
fn replicates(missions: &[Row], starts: &[Row]) {
    let mut of_mission: BTreeMap<(&str, &str), Vec<&Row>> = BTreeMap::new();
    for row in starts {
        of_mission.entry((text(row, "terrain_id"), text(row, "mission_id"))).or_default().push(row);
    }
    let several: Vec<&Row> = missions.iter().filter(|row| text(row, "traverse_id").starts_with("grip")).collect();
    assert_eq!((of_mission.len(), starts.len()), (several.len(), 3 * several.len()));
    let mut places: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for mission in several {
        let starts = &of_mission[&(text(mission, "terrain_id"), text(mission, "mission_id"))];
        let numbers: Vec<i64> = starts.iter().map(|row| row["replicate"].as_i64().unwrap()).collect();
        assert_eq!((numbers, &mission["replicates"]), (vec![1, 2, 3], &Value::from(3)));
        let same = ["start_x_m", "start_y_m", "outcome", "time_s", "progress_m", "rms_roll_rate_deg_s"];
        assert_eq!(of(starts[0], &same), of(mission, &same));
        assert_eq!(starts[0]["start_heading_deg"], mission["heading_deg"]);
        let successes = starts.iter().filter(|row| row["outcome"] == "success").count() as f64;
        assert_eq!(mission["success_probability"].as_f64(), Some(successes / 3.0));
        for other in &starts[1..] {
            let off = |column: &str| other[column].as_f64().unwrap() - mission[column].as_f64().unwrap();
            let (dx, dy) = (off("start_x_m"), off("start_y_m"));
            let distance_m = (dx * dx + dy * dy).sqrt();
            assert!(distance_m > 0.0 && distance_m <= 0.05, "{distance_m}");
        }
        let columns = ["start_x_m", "start_y_m", "start_heading_deg"];
        let place: Vec<String> = starts.iter().map(|row| of(row, &columns)).collect();
        places.entry(text(mission, "pair_id")).or_default().insert(place.join("; "));
    }
    assert!(places.len() >= 4 && places.values().all(|places| places.len() == 1), "{places:?}");
    let plain = missions.iter().filter(|row| text(row, "traverse_id") == "husky");
    assert!(plain.into_iter().all(|row| row["replicates"] == 1));
}

/// The same bytes with one thread and two, and when a run resumes the work of another.
#[test]
fn gold_a_paired_study_has_the_same_bytes() {
    let (one, two) = (area(), area());
    let whole = run(one.path(), PAIRED, "1");
    assert_eq!(differing(&whole, &run(two.path(), PAIRED, "2")), Vec::<String>::new(), "threads");
    fs::remove_dir_all(two.path().join("release")).unwrap();
    fs::remove_dir_all(two.path().join("release.work/items/traverse/grip-0.5@b-0002")).unwrap();
    fs::remove_dir_all(two.path().join("release.work/items/missions/m@a-0001")).unwrap();
    assert_eq!(differing(&whole, &run(two.path(), PAIRED, "2")), Vec::<String>::new(), "resumed");
}

/// Independent groups differ in draws and lines; an explicit seed is shared with either pairing.
#[test]
fn val_pairing_decides_what_is_shared() {
    let folder = area();
    let independent = PAIRED.replace("pairing = \"common\"", "pairing = \"independent\"");
    run(folder.path(), &independent, "2");
    let release = folder.path().join("release");
    let streams: BTreeSet<String> = rows(&release, "terrains").iter().map(|r| text(r, "stream").to_owned()).collect();
    assert_eq!(streams.len(), 8);
    let missions = rows(&release, "missions");
    let lines: BTreeSet<String> = missions.iter().map(|row| of(row, &LINE)).collect();
    let pairs: BTreeSet<&str> = missions.iter().map(|row| text(row, "pair_id")).collect();
    assert_eq!((lines.len(), pairs.len()), (12, 12));
    assert!(pairs.contains("m@a-0001-0002"));

    let seeded = area();
    let study = PAIRED.replace("count = 2\nsize_px", "count = 2\nseed = 11\nsize_px");
    run(seeded.path(), &study, "2");
    let terrains = rows(&seeded.path().join("release"), "terrains");
    assert!(terrains.iter().all(|row| text(row, "stream").starts_with("seed/1")), "an explicit seed wins");
}

/// Textures on one base have its cells: their replicates share draws.
#[test]
fn val_textures_on_a_base_are_paired() {
    let texture = |id: &str| {
        format!(
            "[[texture]]\nid = \"{id}\"\nfit = {{ model = \"exponential\", sigma_m = 0.001, range_m = 0.3 }}\nonto = \"flat\"\n\
             group = \"{id}\"\ncount = 2\ncell_m = 0.1\n\n"
        )
    };
    let study = format!(
        "[study]\nname = \"paired\"\nseed = 3\ndate = \"2026-01-01\"\npairing = \"common\"\n\n[[terrain]]\nid = \"flat\"\n\
         kind = \"multifractal\"\nsize_px = [200, 180]\ncell_m = 0.1\nz_scale_percent = 0.1\n\n{}{}[[missions]]\nid = \"m\"\n\
         terrains = [\"one\", \"other\"]\ncount = 2\nlength_m = 3.0\nborder_m = 1.5\n\n[[traverse]]\nid = \"husky\"\nmissions = \"m\"\n\
         timeout_s = 12.0\n",
        texture("one"),
        texture("other")
    );
    let folder = area();
    run(folder.path(), &study, "2");
    let missions = rows(&folder.path().join("release"), "missions");
    let mut pairs: BTreeMap<&str, Vec<&Row>> = BTreeMap::new();
    missions.iter().for_each(|row| pairs.entry(text(row, "pair_id")).or_default().push(row));
    assert!(pairs.keys().all(|pair| pair.starts_with("m-0001-") || pair.starts_with("m-0002-")), "{pairs:?}");
    let lines = |rows: &[&Row]| rows.iter().map(|row| of(row, &LINE)).collect::<BTreeSet<String>>();
    assert!(pairs.values().all(|rows| lines(rows).len() == 1), "{pairs:?}");
    assert!(
        pairs.values().any(|rows| rows.len() == 2 && text(rows[0], "group") != text(rows[1], "group")),
        "{pairs:?}"
    );
}

/// Heightfields with different cells cannot share missions.
#[test]
fn val_terrains_with_different_cells_are_not_paired() {
    let folder = area();
    write(folder.path(), "study.toml", &PAIRED.replacen("size_px = [200, 180]", "size_px = [200, 190]", 1));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 2, "{}", call.stderr);
    for words in ["\"a-0001\" has", "\"b-0001\"", "separate [[missions]]"] {
        assert!(call.stderr.contains(words), "{}", call.stderr);
    }
}

/// Runs `traverse` on a DEM as a user would; returns the exit code and the output.
fn drive(folder: &Path, dem: &Path, more: &[&str]) -> (i32, String) {
    let arguments = [&["traverse", dem.to_str().unwrap(), "-o", "drive", "--quiet"], more].concat();
    let call = sastrugi_in(folder, &arguments);
    assert!(!call.stderr.contains("panicked"), "{}", call.stderr);
    (call.code, call.stderr)
}

/// Short missions of a large vehicle over a measured catchment; a gravel bar without room, and cells too large for a small vehicle, are
/// refused with the reason.
#[test]
fn val_measured_dems_are_driven_or_refused() {
    let [gaps, catchment] = ["otira", "pozo_blanca"]
        .map(|name| sastrugi_fixtures::workspace_root().join(format!("fixtures/dem/{name}.tif")));
    let folder = area();
    let open = ["--set-roughness", "closing_radius_m=0", "--missions", "6", "--replicates", "2"];
    let wide = ["--vehicle", "ugv_4x4", "--set-missions", "length_m=10.0", "--set", "timeout_s=40"];
    let (code, said) = drive(folder.path(), &catchment, &[&wide[..], &open[..]].concat());
    assert_eq!(code, 0, "{said}");
    let release = folder.path().join("drive");
    let missions = rows(&release, "missions");
    assert_eq!((missions.len(), rows(&release, "replicates").len()), (6, 12));
    let driven = missions.iter().filter(|row| row["progress_m"].as_f64() > Some(0.3)).count();
    assert!(driven >= 2, "{missions:?}");
    for row in &missions {
        let [x, y] = ["x", "y"].map(|axis| {
            let [start, goal] = ["start", "goal"].map(|end| row[&format!("{end}_{axis}_m")].as_f64().unwrap());
            goal - start
        });
        assert!(((x * x + y * y).sqrt() - 10.0).abs() < 1e-6, "{row:?}");
    }
    assert_eq!(sastrugi_in(folder.path(), &["verify", "drive", "--quiet"]).code, 0);

    let other = area();
    let short = ["--set-missions", "length_m=2.0", "--set-missions", "border_m=0.5", "--set", "timeout_s=40"];
    for (dem, more, expected, words) in [
        // 423 x 331 cells of 2 cm, which is known before the heights are read.
        (&gaps, &[][..], 2, "the terrain is 8.46 x 6.62 m, including a border of 5 m"),
        (&gaps, &short[..], 65, "there is no low roughness in the"),
        (&catchment, &[][..], 65, "cells of 1 m: they are larger than its wheelbase of 0.512 m"),
    ] {
        let (code, said) = drive(other.path(), dem, more);
        let said: String = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(code == expected && said.contains(words), "{code} {said}");
        assert!(!other.path().join("drive").exists(), "a release without a mission");
    }
    // If gaps are not filled, the release states how many missions were not driven, and why: three of five starts have a wheel over a gap.
    let (code, said) = drive(other.path(), &gaps, &[&short[..], &open[..]].concat());
    assert_eq!(code, 0, "{said}");
    let manifest = fs::read_to_string(other.path().join("drive/manifest.json")).unwrap();
    let missions = rows(&other.path().join("drive"), "missions");
    let nowhere = missions.iter().filter(|row| text(row, "outcome") == "out_of_bounds" && row["time_s"] == 0.0).count();
    assert!(
        nowhere > 0 && manifest.contains(&format!("{nowhere} of 6 missions started with the vehicle over")),
        "{missions:?}"
    );
}

/// An ESRI ASCII grid of 96 x 96 cells.
fn ascii(cell_m: f64, height: impl Fn(u32, u32) -> f64) -> String {
    let lines = (0..96).map(|row| (0..96).map(|col| height(row, col).to_string()).collect::<Vec<_>>().join(" "));
    let head = format!("ncols 96\nnrows 96\nxllcorner 0\nyllcorner 0\ncellsize {cell_m}\nNODATA_value -9999\n");
    format!("{head}{}\n", lines.collect::<Vec<_>>().join("\n"))
}

/// Surfaces that cannot be driven are refused, each with its reason.
#[test]
fn val_traverse_states_why_it_refuses() {
    let folder = area();
    let short = ["--set-missions", "length_m=3.0", "--set-missions", "border_m=1.5"];
    let refused = |text: &str, more: &[&str], words: &str| {
        let dem = write(folder.path(), "dem.asc", text);
        let (code, said) = drive(folder.path(), &dem, more);
        assert!(code == 65 && said.lines().last().unwrap().contains(words), "{code} {said}");
        assert!(!folder.path().join("drive").exists());
    };
    // Known before the heights are read.
    let dem = write(folder.path(), "dem.asc", &ascii(0.1, |_, _| 0.0));
    let (code, said) = drive(folder.path(), &dem, &[]);
    let said: String = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    assert!(code == 2 && said.contains("the terrain is 9.60 x 9.60 m, including a border of 5 m"), "{code} {said}");
    assert!(!folder.path().join("drive").exists());
    let steep = "from the edge; every cell is steeper than [roughness] low_max: use a smoother terrain (a texture of smaller `amplitude`), larger cells";
    refused(&ascii(0.1, |row, col| f64::from((row + col) % 2)), &short, steep);
    // Spikes 0.8 m apart, between which no disc of the closing fits.
    let spikes = |row: u32, col: u32| if row.is_multiple_of(8) && col.is_multiple_of(8) { 1.0 } else { 0.0 };
    let closed = "was low before closing with [roughness] closing_radius_m = 0.57 m: reduce the radius";
    refused(&ascii(0.1, spikes), &short, closed);
    refused(&ascii(0.1, |_, _| -9999.0), &short, "none of the 96 x 96 cells holds data");
    refused(&ascii(1.0, |_, _| 0.0), &[], "larger than its wheelbase");
    // Low roughness in one corner only, and no goal 9 m away inside the border.
    let far = ["--set-missions", "length_m=9.0", "--set-missions", "border_m=1.0", "--set-missions", "max_draws=50"];
    let corner = |row: u32, col: u32| if row < 30 && col < 30 { 0.0 } else { f64::from((row + col) % 2) };
    refused(&ascii(0.1, corner), &far, "50 draws");
    let dem = write(folder.path(), "dem.asc", &ascii(0.1, |_, _| 0.0));
    for (key, words) in [("replicates=0", "1 to 1000"), ("start_tolerance_m=3.0", "less than the mission")] {
        let (code, said) = drive(folder.path(), &dem, &[&short[..], &["--set", key]].concat());
        assert!(code == 2 && said.contains(words), "{code} {said}");
    }
}

/// A belt of ice across a slope of 8 deg, as a friction raster: no mission uphill into it arrives, and all do without it. A raster
/// elsewhere and a value below 0 are refused.
#[test]
fn val_a_raster_of_friction_stops_the_vehicle() {
    let folder = area();
    write(folder.path(), "slope.asc", &ascii(0.1, |_, col| 0.014 * f64::from(col)));
    let belt = |ice: f64| move |_: u32, col: u32| if (40..60).contains(&col) { ice } else { -9999.0 };
    write(folder.path(), "ice.asc", &ascii(0.1, belt(0.05)));
    write(folder.path(), "bad.asc", &ascii(0.1, belt(-0.05)));
    write(folder.path(), "far.asc", &ascii(0.1, belt(0.05)).replace("xllcorner 0", "xllcorner 1000"));
    let study = |raster: &str| {
        format!(
            "[study]\nname = \"ice\"\nseed = 1\ndate = \"2026-01-01\"\n\
             [[dem]]\nid = \"slope\"\nfile = \"slope.asc\"\n[[dem]]\nid = \"{raster}\"\nfile = \"{raster}.asc\"\n\
             [[missions]]\nid = \"m\"\nterrains = [\"slope\"]\ncount = 20\nlength_m = 5.0\nborder_m = 1.0\n\
             [[traverse]]\nid = \"dry\"\nmissions = \"m\"\ntimeout_s = 60\n\
             [[traverse]]\nid = \"icy\"\nmissions = \"m\"\ntimeout_s = 60\nwheel_friction_raster = \"{raster}\"\n"
        )
    };
    write(folder.path(), "study.toml", &study("ice"));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "icy", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let uphill = |row: &&Row| {
        let (from, to) = (row["start_x_m"].as_f64().unwrap(), row["goal_x_m"].as_f64().unwrap());
        from < 3.8 && to > 5.4
    };
    let missions = rows(&folder.path().join("icy"), "missions");
    let arrived = |run: &str| {
        let of_run: Vec<&Row> = missions.iter().filter(|row| text(row, "traverse_id") == run).filter(uphill).collect();
        (of_run.iter().filter(|row| text(row, "outcome") == "success").count(), of_run.len())
    };
    let ((dry, across), (icy, same)) = (arrived("dry"), arrived("icy"));
    assert!(across >= 2 && dry == across && same == across && icy == 0, "{dry} {icy} of {across}");
    for (raster, words) in [("far", "does not overlap the terrain"), ("bad", "must be finite and not negative")] {
        write(folder.path(), "study.toml", &study(raster));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", raster, "--quiet"]);
        assert!(call.code == 3 && call.stderr.contains(words), "{} {}", call.code, call.stderr);
    }
}

/// A user's vehicle file drives like the shipped vehicle whose parameters it has; one without its table is refused.
#[test]
fn val_a_user_defined_vehicle() {
    let folder = area();
    let dem = write(folder.path(), "dem.asc", &ascii(0.1, |row, col| 0.003 * f64::from(row % 5 + col % 7)));
    let shipped = sastrugi_fixtures::workspace_root().join("pipeline/mobility/src/vehicle/models/husky_a200.toml");
    write(folder.path(), "mine.toml", &fs::read_to_string(shipped).unwrap());
    let short = ["--set-missions", "length_m=3.0", "--set-missions", "border_m=1.5", "--missions", "2"];
    let outcomes = |vehicle: &str| -> Vec<String> {
        let (code, said) = drive(folder.path(), &dem, &[&short[..], &["--vehicle", vehicle]].concat());
        assert_eq!(code, 0, "{said}");
        let driven = rows(&folder.path().join("drive"), "missions");
        fs::remove_dir_all(folder.path().join("drive")).unwrap();
        assert_eq!(driven.len(), 2);
        driven.iter().map(|row| of(row, &["outcome", "time_s", "rms_roll_rate_deg_s"])).collect()
    };
    let mine = folder.path().join("mine.toml");
    assert_eq!(outcomes("husky_a200"), outcomes(mine.to_str().unwrap()));
    write(folder.path(), "mine.toml", "[chassis]\nmass_kg = 1\n");
    let (code, said) = drive(folder.path(), &dem, &["--vehicle", mine.to_str().unwrap()]);
    assert!(code == 2 && said.contains("belong in the table `parameters`"), "{code} {said}");
}

/// A mission across cells without data ends there; the others arrive.
#[test]
fn val_a_gap_ends_a_mission() {
    let folder = area();
    let dem =
        write(folder.path(), "dem.asc", &ascii(0.1, |_, col| if (46..50).contains(&col) { -9999.0 } else { 0.0 }));
    let more = ["--set-missions", "length_m=3.0", "--set-missions", "border_m=1.0", "--missions", "12"];
    let (code, said) = drive(folder.path(), &dem, &more);
    assert_eq!(code, 0, "{said}");
    let missions = rows(&folder.path().join("drive"), "missions");
    let crosses = |row: &Row| {
        let [start, goal] = ["start_x_m", "goal_x_m"].map(|column| row[column].as_f64().unwrap());
        (start < 4.6) != (goal < 4.6)
    };
    for row in &missions {
        let expected = if crosses(row) { "out_of_bounds" } else { "success" };
        let [start, goal] = ["start_x_m", "goal_x_m"].map(|column| row[column].as_f64().unwrap());
        // The vehicle is a metre long, so it touches the gap before its centre reaches it.
        let clear = |x: f64| !(3.6..=6.0).contains(&x);
        assert!(text(row, "outcome") == expected || !(clear(start) && clear(goal)), "{row:?}");
    }
    assert!(missions.iter().any(crosses) && !missions.iter().all(crosses));
}
