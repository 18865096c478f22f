//! What a fit is made from: masks, windows and point clouds, on the command line and in a study.

use sastrugi_tests::{area, sastrugi_in, sums, write};
use serde_json::{Value, json};
use std::path::Path;

/// West half of the fixture's window, and a lake in it.
const PLOT: &str = r#"{"type": "Polygon", "coordinates":
    [[[-84.6, 36.4], [-84.2683, 36.4], [-84.2911, 36.7], [-84.6, 36.7], [-84.6, 36.4]]]}"#;
const LAKE: &str = r#"{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates":
    [[[-84.37, 36.52], [-84.33, 36.51], [-84.31, 36.55], [-84.35, 36.57], [-84.37, 36.52]]]}}"#;
const WINDOW: &str = "-84.40,36.46,-84.20,36.66";
/// The quick kind of fit: what is fitted is the same.
const PLAIN: [&str; 6] = ["--outer-scale", "1000", "--mode", "paper", "-o", "fit.json"];

fn with_masks() -> tempfile::TempDir {
    let folder = area();
    write(folder.path(), "plot.geojson", PLOT);
    write(folder.path(), "lake.geojson", LAKE);
    std::fs::copy(sastrugi_fixtures::jacksboro(), folder.path().join("site.tif")).unwrap();
    folder
}

fn json_of(folder: &Path, arguments: &[&str]) -> Value {
    let call = sastrugi_in(folder, &[arguments, &["--json", "--quiet"]].concat());
    assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
    serde_json::from_str(&call.stdout).unwrap()
}

/// A fit without what it says of its source, and that.
fn fit(folder: &Path, dem: &str, arguments: &[&str]) -> (Value, Value) {
    parted(json_of(folder, &[&["fit", dem], arguments, &PLAIN[..]].concat()))
}

fn parted(mut fit: Value) -> (Value, Value) {
    let source = fit.as_object_mut().unwrap().remove("source").unwrap();
    (fit, source)
}

#[test]
fn val_a_masked_fit_is_the_fit_of_the_dem_without_those_cells() {
    let folder = with_masks();
    let path = folder.path();
    let masks = ["--mask", "plot.geojson", "--exclude", "lake.geojson"];
    let window = ["--window", WINDOW];
    let (whole, _) = fit(path, "site.tif", &window);
    let (masked, source) = fit(path, "site.tif", &[&window[..], &masks].concat());
    assert_ne!(masked["parameters"], whole["parameters"]);
    let converted = json_of(path, &[&["convert", "site.tif", "masked.tif"], &masks[..]].concat());
    let (expected, _) = fit(path, "masked.tif", &window);
    assert_eq!(masked, expected);
    // The window may as well be cut before.
    json_of(path, &[&["convert", "site.tif", "cut.tif"], &masks[..], &window].concat());
    assert_eq!(fit(path, "cut.tif", &[]).0["covariance_m2"], expected["covariance_m2"]);

    let names: Vec<(&str, bool)> = source["masks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| (m["file"].as_str().unwrap(), m["excludes"].as_bool().unwrap()))
        .collect();
    assert_eq!(names, [("plot.geojson", false), ("lake.geojson", true)]);
    assert_eq!(source["masks"][0]["sha256"].as_str().unwrap().len(), 64);
    // Of the window of 0.2 x 0.2 degrees, the plot keeps the 0.5977 west of its edge; the lake has 0.0021 square degrees. The window is rounded to
    // cells, 240 along a side.
    let share = source["masked_share"].as_f64().unwrap();
    assert!((share - (1.0 - 0.5977 + 0.0525)).abs() < 0.01, "{share}");
    assert!(converted["notes"].to_string().contains("masks dropped"), "{converted}");
}

/// A raster without a place marks the cells of the whole DEM, whatever the window.
#[test]
fn val_a_raster_mask_without_a_place_belongs_to_the_whole_dem() {
    let folder = with_masks();
    let path = folder.path();
    json_of(path, &["convert", "site.tif", "kept.npy", "--mask", "plot.geojson"]);
    let window = ["--window", WINDOW];
    let by_polygon = fit(path, "site.tif", &[&window[..], &["--mask", "plot.geojson"]].concat()).0;
    let by_raster = fit(path, "site.tif", &[&window[..], &["--mask", "kept.npy"]].concat()).0;
    assert_eq!(by_raster, by_polygon);
}

/// The masks of a study are part of the release, which recomputes from itself; the fit is that of the verb.
#[test]
fn val_masks_go_into_the_release() {
    let folder = with_masks();
    let path = folder.path();
    let study = format!(
        "[study]\nname = \"masked\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"site\"\nfile = \"site.tif\"\n\
         window = [{WINDOW}]\n\n[[fit]]\nid = \"fit\"\ndem = \"site\"\nouter_scale_m = 1000.0\nmode = \"paper\"\n\
         mask = 'plot.geojson' # the plot\nexclude = [\"lake.geojson\"]\n"
    );
    write(path, "study.toml", &study);
    json_of(path, &["run", "study.toml", "-o", "release"]);
    let release = path.join("release");
    let sums_before = sums(&release);
    for (copy, text) in [("mask/fit-1.geojson", PLOT), ("mask/fit-2.geojson", LAKE)] {
        assert!(sums_before.contains_key(copy), "{copy} is missing");
        assert_eq!(std::fs::read_to_string(release.join(copy)).unwrap(), text);
    }
    let released = std::fs::read_to_string(release.join("study.toml")).unwrap();
    let expected = study
        .replace("'plot.geojson'", "\"mask/fit-1.geojson\"")
        .replace("lake.geojson", "mask/fit-2.geojson")
        .replace("file = \"site.tif\"", "file = \"dem/site.tif\"");
    assert_eq!(released, expected);

    let text = std::fs::read_to_string(release.join("fit/fit.json")).unwrap();
    let (ours, source) = parted(serde_json::from_str(&text).unwrap());
    let (theirs, _) =
        fit(path, "site.tif", &["--window", WINDOW, "--mask", "plot.geojson", "--exclude", "lake.geojson"]);
    assert_eq!(ours, theirs);
    assert_eq!(source["masks"][1]["file"], json!("fit-2.geojson"));
    let verified = json_of(path, &["verify", "release", "--recompute", "all"]);
    assert_eq!(verified["differences"], json!([]));

    // A changed mask is a stale fit, and of the two items beside it only its copy.
    write(path, "lake.geojson", &LAKE.replace("-84.37", "-84.38"));
    let plan = json_of(path, &["plan", "study.toml", "-o", "release"]);
    let stale: Vec<&str> =
        plan["stale"].as_array().unwrap().iter().map(|s| s["item"].as_str().unwrap_or_default()).collect();
    assert_eq!(stale.len(), 2, "{plan}");
}

/// A texture of 4 cm, and beside it a road (x below 4 m); 8 mm of white noise on both.
fn with_road(folder: &Path) {
    write(folder, "truth.json", r#"{"model": "exponential", "parameters": {"sigma_m": 0.04, "range_m": 0.3}}"#);
    json_of(folder, &["texture", "truth.json", "--size", "20x16", "--cell", "0.1", "-o", "snow.asc"]);
    let text = std::fs::read_to_string(folder.join("snow.asc")).unwrap();
    let mut lines = text.lines();
    let mut noisy: Vec<String> = lines.by_ref().take_while(|l| !l.starts_with("NODATA")).map(str::to_owned).collect();
    noisy.push("NODATA_value -9999".to_owned());
    let mut state = 1u64;
    // The sum of twelve uniform draws, less six, is normal enough.
    let mut normal = || {
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| draw()).sum::<f64>() - 6.0
    };
    for (row, line) in lines.enumerate() {
        let heights = line.split_whitespace().enumerate().map(|(col, z)| {
            let ground: f64 = if col < 40 { 0.01 * row as f64 } else { z.parse().unwrap() };
            (ground + 0.008 * normal()).to_string()
        });
        noisy.push(heights.collect::<Vec<_>>().join(" "));
    }
    write(folder, "snow.asc", &(noisy.join("\n") + "\n"));
    json_of(folder, &["convert", "snow.asc", "snow.tif"]);
    let of = |west: f64, east: f64| {
        format!(
            r#"{{"type": "Polygon", "coordinates": [[[{west}, -1], [{east}, -1], [{east}, 99], [{west}, 99], [{west}, -1]]]}}"#
        )
    };
    write(folder, "road.geojson", &of(-1.0, 3.95));
    write(folder, "field.geojson", &of(4.05, 99.0));
}

/// The noise of the road (7700 runs of cells: good to 2 %) is that of the field, which the fit of the field takes off; the map of the
/// covariance lies about lag zero. As a verb and in a study.
#[test]
fn val_noise_of_a_reference() {
    let folder = area();
    let path = folder.path();
    with_road(path);
    let reference = ["--noise-reference", "road.geojson", "--mask", "field.geojson"];
    let plain = ["--outer-scale", "2", "--bootstrap", "0", "-o", "fit.json", "--map", "map.tif"];
    let (ours, source) = parted(json_of(path, &[&["fit", "snow.tif"], &reference[..], &plain].concat()));
    let found = source["noise_reference"]["sigma_m"].as_f64().unwrap();
    assert!((found / 0.008 - 1.0).abs() < 0.06, "{found}");
    assert_eq!(source["noise_reference"]["file"], "road.geojson");
    assert_eq!(ours["settings"]["noise_sigma_m"], json!(found));
    let sigma = ours["parameters"]["sigma_m"].as_f64().unwrap();
    assert!((sigma / 0.04 - 1.0).abs() < 0.15, "{sigma}");

    let info = json_of(path, &["info", "map.tif"]);
    assert_eq!((info["rows"].as_i64(), info["cols"].as_i64()), (Some(21), Some(21)), "{info}");

    let study = "[study]\nname = \"noisy\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"site\"\nfile = \"snow.tif\"\n\n\
         [[fit]]\nid = \"fit\"\ndem = \"site\"\nouter_scale_m = 2.0\nbootstrap = 0\nmask = \"field.geojson\"\n\
         noise_reference = \"road.geojson\"\n";
    write(path, "study.toml", study);
    json_of(path, &["run", "study.toml", "-o", "release"]);
    let release = path.join("release");
    let text = std::fs::read_to_string(release.join("fit/fit.json")).unwrap();
    let (released, source) = parted(serde_json::from_str(&text).unwrap());
    assert!(released == ours, "{:?} {:?}", released["parameters"], ours["parameters"]);
    assert_eq!(source["noise_reference"]["file"], "fit-noise.geojson");
    assert!(release.join("mask/fit-noise.geojson").exists());
    let read = |path: std::path::PathBuf| std::fs::read(path).unwrap();
    assert_eq!(read(release.join("fit/fit.covariance.tif")), read(path.join("map.tif")));
    assert_eq!(json_of(path, &["verify", "release", "--recompute", "all"])["differences"], json!([]));
}

/// One sentence each: a reference where the noise is stated, in a mode without noise, with a DEM to subtract, outside the DEM.
#[test]
fn val_bad_noise_references() {
    let folder = area();
    let path = folder.path();
    with_road(path);
    let study = |more: &str| {
        write(
            path,
            "study.toml",
            &format!(
                "[study]\nname = \"n\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"site\"\nfile = \"snow.tif\"\n\n\
                 [[fit]]\nid = \"fit\"\ndem = \"site\"\nouter_scale_m = 2.0\nnoise_reference = \"road.geojson\"\n{more}\n"
            ),
        );
        sastrugi_in(path, &["plan", "study.toml", "-o", "release"])
    };
    for (more, word) in [
        ("noise_sigma_m = 0.01", "one of the two"),
        ("mode = \"paper\"\nbootstrap = 0", "neither an inner scale nor noise"),
        ("minus = \"site\"", "`noise_reference` cannot be combined with `minus`"),
    ] {
        let call = study(more);
        assert_eq!(call.code, 2, "{more}: {}", call.stderr);
        assert!(call.stderr.contains(word), "{more}: {}", call.stderr);
    }
    let before = std::fs::read(path.join("snow.tif")).unwrap();
    for (map, word) in [("snow.tif", "needs its own name"), ("map.xyz", "unknown extension")] {
        let call = sastrugi_in(path, &["fit", "snow.tif", "--outer-scale", "2", "--map", map, "-o", "fit.json"]);
        assert!(call.code == 2 && call.stderr.contains(word), "{map}: {} {}", call.code, call.stderr);
    }
    assert_eq!(std::fs::read(path.join("snow.tif")).unwrap(), before);
    write(
        path,
        "tiny.geojson",
        r#"{"type": "Polygon", "coordinates": [[[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5], [0, 0]]]}"#,
    );
    let call = sastrugi_in(path, &["fit", "snow.tif", "--noise-reference", "tiny.geojson", "-o", "fit.json"]);
    assert!(call.code == 65 && call.stderr.contains("30 runs of three"), "{} {}", call.code, call.stderr);
    assert!(!path.join("fit.json").exists());
}

/// A generated terrain has its own place.
#[test]
fn val_a_terrain_is_masked_in_its_own_metres() {
    let folder = area();
    let path = folder.path();
    write(
        path,
        "west.geojson",
        r#"{"type": "Polygon", "coordinates": [[[-1, -1], [11.3, -1], [9.7, 99], [-1, 99], [-1, -1]]]}"#,
    );
    let study = "[study]\nname = \"t\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"rough\"\nkind = \"multifractal\"\n\
                 size_px = [256, 200]\ncell_m = 0.05\n\n[[fit]]\nid = \"fit\"\ndem = \"rough\"\nouter_scale_m = 2.0\nmode = \"paper\"\nmask = \"west.geojson\"\n";
    write(path, "study.toml", study);
    json_of(path, &["run", "study.toml", "-o", "release"]);
    let text = std::fs::read_to_string(path.join("release/fit/fit.json")).unwrap();
    let (ours, source) = parted(serde_json::from_str(&text).unwrap());
    let arguments = ["--mask", "west.geojson", "--outer-scale", "2", "--mode", "paper", "-o", "fit.json"];
    let (theirs, _) = parted(json_of(path, &[&["fit", "release/terrain/rough.tif"], &arguments[..]].concat()));
    assert_eq!(ours, theirs);
    // The edge of the mask, from (11.3, -1) to (9.7, 99), cell centre by cell centre.
    let centre = |k: i32| 0.05 * (f64::from(k) + 0.5);
    let kept = |row: i32| (0..256).filter(|col| centre(*col) < 11.3 - 0.016 * (centre(row) + 1.0)).count();
    let expected = 1.0 - (0..200).map(kept).sum::<usize>() as f64 / 51_200.0;
    let share = source["masked_share"].as_f64().unwrap();
    assert!((share - expected).abs() < 1e-4, "{share} against {expected}");
}

/// Rows from the north of an ESRI ASCII grid, heights in whole millimetres; none where there is no data.
fn millimetres(text: &str) -> Vec<Vec<Option<i32>>> {
    let height = |word: &str| Some(word.parse::<f64>().unwrap()).filter(|z| *z != -9999.0);
    let row =
        |line: &str| line.split_whitespace().map(|word| height(word).map(|z| (1000.0 * z).round() as i32)).collect();
    text.lines().filter(|line| line.split_whitespace().count() > 2).map(row).collect()
}

/// A point cloud: LAS 1.2, point format 0, from coordinates in millimetres and classes.
fn las(points: &[([i32; 3], u8)]) -> Vec<u8> {
    let mut bytes = vec![0_u8; 227];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, b"LASF");
    put(24, &[1, 2]);
    put(94, &227_u16.to_le_bytes());
    put(96, &227_u32.to_le_bytes());
    put(105, &20_u16.to_le_bytes());
    put(107, &(points.len() as u32).to_le_bytes());
    for axis in 0..3 {
        let metres = |stored: i32| (0.001 * f64::from(stored)).to_le_bytes();
        let stored = points.iter().map(|(place, _)| place[axis]);
        put(131 + 8 * axis, &0.001_f64.to_le_bytes());
        put(179 + 16 * axis, &metres(stored.clone().max().unwrap()));
        put(187 + 16 * axis, &metres(stored.min().unwrap()));
    }
    for (place, class) in points {
        place.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes.extend([0, 0, 0, *class, 0, 0, 0, 0]);
    }
    bytes
}

/// The shipped gravel bar as a cloud, `cloud.las`: three points in every cell of 2 cm with data, one on the ground (class 2) at the height of
/// the cell, one 5 mm below and one 8 mm above it. Beside it `raster.asc`, the heights of the cells.
fn with_cloud(folder: &Path) {
    let otira = sastrugi_fixtures::workspace_root().join("fixtures/dem/otira.tif");
    json_of(folder, &["convert", otira.to_str().unwrap(), "otira.asc"]);
    let rows = millimetres(&std::fs::read_to_string(folder.join("otira.asc")).unwrap());
    let mut points = Vec::new();
    let mut raster = format!(
        "ncols {}\nnrows {}\nxllcorner 0\nyllcorner 0\ncellsize 0.02\nNODATA_value -9999\n",
        rows[0].len(),
        rows.len()
    );
    for (row, heights) in rows.iter().enumerate() {
        for (col, z) in heights.iter().enumerate() {
            // The centre of the cell; a cell has 20 mm.
            let [x, y] = [20 * col as i32 + 10, 20 * (rows.len() - row) as i32 - 10];
            let around = z.iter().flat_map(|z| [(z - 5, 1), (*z, 2), (z + 8, 1)]);
            points.extend(around.map(|(z, class)| ([x, y, z], class)));
        }
        let metres = |z: &Option<i32>| z.map_or(-9999.0, |z| f64::from(z) * 0.001).to_string();
        raster += &(heights.iter().map(metres).collect::<Vec<_>>().join(" ") + "\n");
    }
    std::fs::write(folder.join("cloud.las"), las(&points)).unwrap();
    write(folder, "raster.asc", &raster);
}

/// Every statistic of three known points. The gravel bar has 331 x 423 cells, 70 732 of them with data, from -11.9355 to -10.6760 m (decoded
/// from the GeoTIFF by a script of a few lines, without sastrugi).
#[test]
fn val_statistics_of_clouds() {
    let folder = area();
    let path = folder.path();
    with_cloud(path);
    let info = |more: &[&str]| json_of(path, &[&["info", "cloud.las", "--cell", "0.02"], more].concat());
    for (more, above_mm) in [
        (&["--statistic", "median"][..], 0.0),
        (&["--statistic", "mean"], 1.0),
        (&["--statistic", "min"], -5.0),
        (&["--statistic", "max"], 8.0),
        // Halfway from the second of three points to the third.
        (&["--statistic", "p75"], 4.0),
        (&["--ground"], 0.0),
    ] {
        let info = info(more);
        assert_eq!([&info["rows"], &info["cols"], &info["valid"]], [331, 423, 70_732], "{more:?}");
        for (key, ground_m) in [("height_min_m", -11.936), ("height_max_m", -10.676)] {
            let found = info[key].as_f64().unwrap();
            assert!((found - ground_m - 0.001 * above_mm).abs() < 1e-9, "{more:?}: {key} {found}");
        }
    }
    // From 0.01 to 6.61 m northwards there are 133 cells of 5 cm.
    assert_eq!(json_of(path, &["info", "cloud.las", "--cell", "0.05"])["rows"], 133);
}

/// In a study, memory is planned for four cells per point. A strip across its box takes ten, so it needs a cell size; a verb plans nothing.
#[test]
fn val_a_strip_across_its_box_needs_a_cell_size_in_a_study() {
    let folder = area();
    let path = folder.path();
    let across = |i: i32| (i - 60).max(0)..=(i + 60).min(1199);
    let points: Vec<([i32; 3], u8)> =
        (0..1200).flat_map(|i| across(i).map(move |j| ([50 * i + 25, 50 * j + 25, i % 7], 2))).collect();
    std::fs::write(path.join("strip.las"), las(&points)).unwrap();
    assert_eq!(json_of(path, &["info", "strip.las"])["rows"], 1200);
    let study = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"strip.las\"\n";
    write(path, "study.toml", study);
    let run = || sastrugi_in(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    let call = run();
    let words = "1200 x 1200 cells of 0.05 m, more than the 566160 cells planned for them; convert it to a raster, or, if it is a \
                 [[dem]], set its `cell_m`";
    assert!(call.code == 65 && call.stderr.contains(words), "{} {}", call.code, call.stderr);
    write(path, "study.toml", &format!("{study}cell_m = [0.2, 0.2]\n"));
    let call = run();
    assert!(call.code != 65, "{}", call.stderr);
}

/// The fit of a cloud is that of its cells, read from a raster; so is that of a study. Gaps are filled as `convert` does.
#[test]
fn val_clouds_are_fitted_from_the_file() {
    let folder = area();
    let path = folder.path();
    with_cloud(path);
    let settings = ["--outer-scale", "1", "--mode", "paper", "--set", "min_valid_share=0.3", "-o", "fit.json"];
    let fit = |dem: &str, more: &[&str]| parted(json_of(path, &[&["fit", dem], more, &settings].concat()));
    let median = ["--cell", "0.02", "--statistic", "median"];
    let of_raster = fit("raster.asc", &[]);
    let direct = fit("cloud.las", &median);
    assert_eq!(direct.0["covariance_m2"], of_raster.0["covariance_m2"]);
    assert_eq!(direct.0["parameters"], of_raster.0["parameters"]);
    assert_eq!(direct.1["file"], "cloud.las");
    // 8.7 cm by a plain estimate at this window, in windows of which 90 % have data.
    let of = |fit: &Value, key: &str| fit["parameters"][key].as_f64().unwrap();
    assert!((0.06..0.12).contains(&of(&direct.0, "sigma_m")), "{}", direct.0["parameters"]);

    let filled = ["--cell", "0.02", "--statistic", "p75", "--fill", "2"];
    json_of(path, &[&["convert", "cloud.las", "grid.npy"], &filled[..]].concat());
    let from_points = fit("cloud.las", &filled);
    assert_eq!(from_points.0["covariance_m2"], fit("grid.npy", &["--cell", "0.02"]).0["covariance_m2"]);

    let study = "[study]\nname = \"cloud\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"bar\"\nfile = \"cloud.las\"\n\
         cell_m = [0.02, 0.02]\nstatistic = \"median\"\n\n[[fit]]\nid = \"fit\"\ndem = \"bar\"\n\
         outer_scale_m = 1.0\nmode = \"paper\"\nmin_valid_share = 0.3\n";
    write(path, "study.toml", study);
    json_of(path, &["run", "study.toml", "-o", "release"]);
    let text = std::fs::read_to_string(path.join("release/fit/fit.json")).unwrap();
    let released: Value = serde_json::from_str(&text).unwrap();
    // Heights of a release are single precision.
    for key in ["sigma_m", "range_m"] {
        let (a, b) = (of(&released, key), of(&direct.0, key));
        assert!((a - b).abs() <= 1e-4 * b, "{key}: {a} against {b}");
    }
    let texture = ["--size", "20x20", "--cell", "0.05", "--onto", "cloud.las", "-o", "onto.tif"];
    json_of(path, &[&["texture", "fit.json"], &texture[..]].concat());
    json_of(path, &["roughness", "cloud.las", "--cell", "0.05", "--statistic", "median"]);
}
