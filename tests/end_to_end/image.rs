//! Studies of images: files, tables, refusals, and the same bytes however the study is run.

use sastrugi_tests::{Row, area, differing, rows, run_in_shards, run_study, run_with_kills, sastrugi_in, write};
use serde_json::Value;
use std::fs;
use std::path::Path;

const STUDY: &str = r#"
[study]
name = "images"
seed = 4
date = "2026-01-01"

[[terrain]]
id = "mars"
kind = "planetary"
group = "rocks"
count = 2
size_m = [6.4, 4.8]
cell_m = 0.05
basic_spacing_m = 0.0125
processes = [{ kind = "texture" }, { kind = "rocks", coverage = 0.15, diameter_min_m = 0.1 }, { kind = "albedo" }]

[[terrain]]
id = "plate"
kind = "multifractal"
size_px = [60, 50]

[[image]]
id = "map"
surface = "mars"
sun = { azimuth_deg = 100.0, elevation_deg = 20.0 }

[[image]]
id = "suns"
surface = "plate"
samples = 1
noise = { relative = 0.01, absolute = 1e-4 }
exposure = 1.5
haze = 0.02
sun = { elevation_deg = 45.0 }
sweep."sun.azimuth_deg" = [0, 120, 240]

[[image]]
id = "rover"
surface = "mars-0001"
camera = { kind = "pinhole", position_m = [3.2, 0.5, 0.3], target_m = [3.2, 3.0, 0.0], size_px = [80, 60] }

[[image]]
id = "orbit"
surface = "plate"
camera = { kind = "parallel", azimuth_deg = 200.0, elevation_deg = 50.0, pixel_m = 0.1 }
"#;

fn number(row: &Row, column: &str) -> f64 {
    row[column].as_f64().or(row[column].as_i64().map(|n| n as f64)).unwrap_or(f64::NAN)
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Every image has its three files and its row, and its description states the settings of the study.
#[test]
fn val_images_have_files_and_rows() {
    let folder = area();
    let sums = run_study(folder.path(), STUDY, &[]);
    let release = folder.path().join("release");
    let images = rows(&release, "images");
    let ids: Vec<&str> = images.iter().filter_map(|row| row["image_id"].as_str()).collect();
    assert_eq!(ids, ["map-mars-0001", "map-mars-0002", "orbit", "rover", "suns-0", "suns-120", "suns-240"]);
    for row in &images {
        let id = row["image_id"].as_str().unwrap();
        for ending in ["tif", "json", "png"] {
            assert!(sums.contains_key(&format!("image/{id}.{ending}")), "{id}.{ending}");
        }
        let description = json(&release.join(format!("image/{id}.json")));
        assert_eq!(description["image"], format!("{id}.tif"));
        assert_eq!(description["rendered"]["surface"].as_str(), row["surface_id"].as_str());
        assert_eq!(description["camera"]["rows"].as_i64(), row["rows"].as_i64());
        assert_eq!(description["sun"]["azimuth_deg"].as_f64().unwrap(), number(row, "sun_azimuth_deg"));
        let shares = ["share_in_shadow", "share_without_ground"].map(|column| number(row, column));
        assert!(shares.iter().all(|share| (0.0..1.0).contains(share)), "{id} {shares:?}");
        assert!(number(row, "mean_brightness") > 0.0);
        assert_eq!(row["has_albedo_map"], Value::from(row["surface_id"].as_str().unwrap().starts_with("mars")));
    }
    let of = |id: &str| images.iter().find(|row| row["image_id"] == id).unwrap();
    // Haze is the lowest brightness of a pixel, and no noise reaches that far below it.
    assert!(number(of("suns-0"), "mean_brightness") > 0.1 && number(of("suns-0"), "png_white") > 0.2);
    assert!(of("rover")["pixel_m"].is_null() && number(of("rover"), "share_without_ground") > 0.05);
    assert_eq!(number(of("map-mars-0001"), "share_without_ground"), 1.0 - covered(128, 96));
    let suns = ["suns-0", "suns-120"].map(|id| json(&release.join(format!("image/{id}.json"))));
    assert_ne!(suns[0]["rendered"]["noise_stream"], suns[1]["rendered"]["noise_stream"]);
    let page = fs::read_to_string(release.join("report/index.html")).unwrap();
    assert!(
        page.contains("What do the cameras see?")
            && page.contains("sun from 315 degrees (north-west), 25 degrees above the horizon")
    );
}

/// Share of the 2 x 2 rays per pixel that fall between the outer cell centres; pixels are cells.
fn covered(cols: u32, rows: u32) -> f64 {
    f64::from((2 * cols - 2) * (2 * rows - 2)) / f64::from(4 * cols * rows)
}

/// One thread, two, two shards, after kills: the same bytes, and `verify` reproduces them.
#[test]
fn prop_a_release_of_images_has_the_same_bytes() {
    let (one, two) = (area(), area());
    let [first, second] =
        [(&one, "1"), (&two, "2")].map(|(folder, threads)| run_study(folder.path(), STUDY, &["--threads", threads]));
    assert_eq!(differing(&first, &second), Vec::<String>::new());
    let shards = area();
    write(shards.path(), "study.toml", STUDY);
    assert_eq!(differing(&first, &run_in_shards(shards.path(), "study.toml")), Vec::<String>::new());
    let killed = run_with_kills(area().path(), STUDY, &first, &[30, 100, 200, 400]);
    assert_eq!(differing(&first, &killed), Vec::<String>::new());
    let call = sastrugi_in(one.path(), &["verify", "release", "--recompute", "all", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
}

/// The verb, with the surface and the seed of a study's item, gives its bytes.
#[test]
fn val_the_verb_has_the_bytes_of_the_study() {
    let folder = area();
    let study = STUDY.replace("id = \"suns\"", "id = \"suns\"\nseed = 9");
    run_study(folder.path(), &study, &[]);
    let set = ["samples=1", "noise.relative=0.01", "noise.absolute=1e-4", "exposure=1.5", "haze=0.02"];
    let set: Vec<&str> = set.iter().flat_map(|pair| ["--set", pair]).collect();
    let call = ["render", "release/terrain/plate.tif", "--sun", "0,45", "--seed", "9", "-o", "sun.tif", "--quiet"];
    let call = sastrugi_in(folder.path(), &[&call[..], &set].concat());
    assert_eq!(call.code, 0, "{}", call.stderr);
    let read = |path: &str| fs::read(folder.path().join(path)).unwrap();
    assert_eq!(read("sun.tif"), read("release/image/suns-0.tif"));
    assert_eq!(json(&folder.path().join("sun.json"))["sun"]["elevation_deg"], 45.0);
    // The albedo map next to a DEM is used.
    let call =
        sastrugi_in(folder.path(), &["render", "release/terrain/mars-0001.tif", "--sun", "100,20", "-o", "map.tif"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert_eq!(read("map.tif"), read("release/image/map-mars-0001.tif"));
}

/// Invalid studies are refused with one sentence each.
#[test]
fn val_wrong_images_are_refused() {
    let folder = area();
    for (from, to, words) in [
        (
            "elevation_deg = 20.0",
            "elevation_deg = -2.0",
            "image \"map\": `sun.elevation_deg` is -2; it must be above 0",
        ),
        ("samples = 1\n", "samples = 0\n", "`samples` is 0; it must lie between 1 and 64"),
        ("samples = 1\n", "sample = 1\n", "did you mean `samples`"),
        ("exposure = 1.5", "exposure = 0.0", "`exposure` is 0"),
        ("relative = 0.01", "relative = -1.0", "`noise.relative` is -1"),
        ("surface = \"mars\"", "surface = \"venus\"", "names \"venus\""),
        ("pixel_m = 0.1", "pixel_m = -0.1", "`camera.pixel_m` is -0.1"),
        ("target_m = [3.2, 3.0, 0.0]", "target_m = [3.2, 0.5, 0.3]", "`camera.target_m` is the position"),
        ("kind = \"parallel\"", "kind = \"fisheye\"", "unknown value `fisheye`; known:"),
        ("id = \"orbit\"", "id = \"suns-120\"", "is taken"),
    ] {
        assert!(STUDY.contains(from), "{from}");
        write(folder.path(), "study.toml", &STUDY.replace(from, to));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
        let told: String = call.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(call.code, 2, "{to}: {told}");
        assert!(told.contains(words), "{to}: {told}");
    }
}

/// A camera that does not fit its surface fails only its own item, and the release states it.
#[test]
fn val_a_camera_below_the_ground_fails_alone() {
    let folder = area();
    let buried = "position_m = [3.2, 0.5, -50.0], above_ground = false";
    write(folder.path(), "study.toml", &STUDY.replace("position_m = [3.2, 0.5, 0.3]", buried));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 3, "{}", call.stderr);
    assert!(
        call.stderr.contains("`camera.position_m` is at z = -50 m; it must be above the ground"),
        "{}",
        call.stderr
    );
    assert_eq!(rows(&folder.path().join("release"), "images").len(), 6);
}

/// The verb: refusals in one sentence with their exit codes, and pictures of generated surfaces.
#[test]
fn val_the_verb_refuses_and_draws() {
    let folder = area();
    let path = folder.path();
    let render = |arguments: &[&str]| sastrugi_in(path, &[&["render"][..], arguments].concat());
    let planet = ["planetary", "--set-surface", "size_px=[60,40]", "--seed", "3"];
    let drawn = render(&[&planet[..], &["--sun", "90,15", "--json", "-o", "mars.png"]].concat());
    assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    let result: Value = serde_json::from_str(&drawn.stdout).unwrap();
    assert_eq!(
        (result["pixels"][0].as_u64(), result["description"]["rendered"]["albedo_map"].as_str()),
        (Some(60), Some("albedo"))
    );
    let bytes = fs::read(path.join("mars.png")).unwrap();
    assert!(
        bytes.starts_with(b"\x89PNG")
            && bytes[16..24] == [0, 0, 0, 60, 0, 0, 0, 40]
            && !path.join("mars.json").exists()
    );
    for (arguments, code, words) in [
        (&["planetary", "-o", "x.jpg"][..], 2, "images are written as .tif or .png"),
        (&["planetary", "--sun", "0,-1", "-o", "x.tif"], 2, "`sun.elevation_deg` is -1"),
        (&["planetary", "--sun", "0", "-o", "x.tif"], 2, "azimuth and elevation in degrees, such as `--sun 120,20`"),
        (&["planetary", "--camera", "nadir:900", "-o", "x.tif"], 2, "does not fill a pixel"),
        (
            &["planetary", "--set", "photometry={lambert=0,lommel_seeliger=0}", "-o", "x.tif"],
            2,
            "would reflect nothing",
        ),
        (&["planetary", "--camera", "fisheye", "-o", "x.tif"], 2, "expected nadir[:PIXEL_M]"),
        (&["planetary", "--size", "9x9", "-o", "x.tif"], 2, "nadir covers the surface"),
        (&["planetary", "--set", "samples=99", "-o", "x.tif"], 2, "`samples` is 99"),
        (&["planetary", "--set", "smaples=2", "-o", "x.tif"], 2, "did you mean `samples`"),
        (&["planetary", "--set-surface", "siz_px=[9,9]", "-o", "x.tif"], 2, "did you mean `size_px`"),
        (&["none.tif", "-o", "x.tif"], 65, "no such file"),
        (&["planetary", "--albedo", "none.tif", "-o", "x.tif"], 65, "no such file"),
        (&["planetary", "--albedo", "1.5", "-o", "x.tif"], 2, "`albedo` is 1.5"),
        (&["planetary", "--camera", "pinhole:1,1,9,1,1,99", "--size", "4x4", "-o", "x.tif"], 2, "sees no ground"),
        (&["planetary", "--camera", "pinhole:-1,1,9,1,1,0", "-o", "x.tif"], 2, "where the surface has no data"),
    ] {
        let called = render(&[arguments, &["--quiet"]].concat());
        let told: String = called.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(called.code == code && told.contains(words), "{arguments:?}: {} {told}", called.code);
        assert!(!path.join("x.tif").exists() && !path.join("x.json").exists());
    }
}
