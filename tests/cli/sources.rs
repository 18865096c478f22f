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
    let share = source["masked_share"].as_f64().unwrap();
    assert!(share > 0.4 && share < 0.7, "{share}");
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
                 size_px = [256, 200]\n\n[[fit]]\nid = \"fit\"\ndem = \"rough\"\nouter_scale_m = 2.0\nmode = \"paper\"\nmask = \"west.geojson\"\n";
    write(path, "study.toml", study);
    json_of(path, &["run", "study.toml", "-o", "release"]);
    let text = std::fs::read_to_string(path.join("release/fit/fit.json")).unwrap();
    let (ours, source) = parted(serde_json::from_str(&text).unwrap());
    let arguments = ["--mask", "west.geojson", "--outer-scale", "2", "--mode", "paper", "-o", "fit.json"];
    let (theirs, _) = parted(json_of(path, &[&["fit", "release/terrain/rough.tif"], &arguments[..]].concat()));
    assert_eq!(ours, theirs);
    let share = source["masked_share"].as_f64().unwrap();
    assert!(share > 0.1 && share < 0.9, "{share}");
}

#[test]
fn val_clouds_are_fitted_from_the_file() {
    let Some(cloud) = sastrugi_fixtures::measured("Otira_1cm_grains_G3POINT.laz") else {
        eprintln!("SKIPPED: ../shared/data/Otira_1cm_grains_G3POINT.laz is absent");
        return;
    };
    let folder = area();
    let (path, cloud) = (folder.path(), cloud.to_str().unwrap());
    let gridding = ["--cell", "0.02", "--statistic", "p75", "--fill", "2"];
    json_of(path, &[&["convert", cloud, "grid.npy"], &gridding[..]].concat());
    let settings = ["--outer-scale", "1", "--mode", "paper", "--set", "min_valid_share=0.3", "-o", "fit.json"];
    let direct = parted(json_of(path, &[&["fit", cloud], &gridding[..], &settings].concat()));
    let gridded = parted(json_of(path, &[&["fit", "grid.npy", "--cell", "0.02"], &settings[..]].concat()));
    assert_eq!(direct.0["covariance_m2"], gridded.0["covariance_m2"]);
    assert!(direct.1["file"].as_str().unwrap().ends_with(".laz"));
    let study = format!(
        "[study]\nname = \"cloud\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"bar\"\nfile = \"{cloud}\"\n\
         cell_m = [0.02, 0.02]\nstatistic = \"p75\"\nfill_cells = 2\n\n[[fit]]\nid = \"fit\"\ndem = \"bar\"\n\
         outer_scale_m = 1.0\nmode = \"paper\"\nmin_valid_share = 0.3\n"
    );
    write(path, "study.toml", &study);
    json_of(path, &["run", "study.toml", "-o", "release"]);
    let text = std::fs::read_to_string(path.join("release/fit/fit.json")).unwrap();
    let released: Value = serde_json::from_str(&text).unwrap();
    // Heights of a release are single precision.
    let of = |fit: &Value, key: &str| fit["parameters"][key].as_f64().unwrap();
    for key in ["sigma_m", "range_m"] {
        let (a, b) = (of(&released, key), of(&direct.0, key));
        assert!((a - b).abs() <= 1e-4 * b, "{key}: {a} against {b}");
    }
    let texture = ["--size", "20x20", "--cell", "0.05", "--onto", cloud, "-o", "onto.tif"];
    json_of(path, &[&["texture", "fit.json"], &texture[..]].concat());
    assert!(json_of(path, &["info", cloud, "--cell", "0.05"])["rows"].as_u64().unwrap() > 100);
    json_of(path, &["roughness", cloud, "--cell", "0.05", "--statistic", "median"]);
}
