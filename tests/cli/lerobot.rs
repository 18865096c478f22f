//! `convert --for lerobot`: a release as a LeRobot dataset.

use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Smooth terrains, one in each split, driven at two sampling rates.
const STUDY: &str = r#"
[study]
name = "small"
seed = 7
date = "2026-01-01"
license = "CC0-1.0"
creators = ["Doe, Jane"]
split = [0.4, 0.3, 0.3]

[[terrain]]
id = "a"
kind = "weierstrass_mandelbrot"
size_px = [64, 64]
cell_m = 0.2
elevation_scale_m = 1e-9
count = 3

[[missions]]
id = "m"
terrains = ["a"]
count = 2
length_m = 4.0
border_m = 1.5

[[traverse]]
id = "t"
missions = "m"
vehicle = "husky_a200"

[[traverse]]
id = "slow"
missions = "m"
vehicle = "husky_a200"
sample_rate_hz = 10
"#;

fn release(folder: &Path) {
    write(folder, "study.toml", STUDY);
    let call = sastrugi_in(folder, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
}

/// The result of a conversion of the release.
fn converted(folder: &Path, output: &str, more: &[&str]) -> Value {
    let call = ["convert", "release", output, "--for", "lerobot", "--json", "--quiet"];
    let call = sastrugi_in(folder, &[&call[..], more].concat());
    assert_eq!(call.code, 0, "{}", call.stderr);
    serde_json::from_str(&call.stdout).unwrap()
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = [
        "LICENSE",
        "README.md",
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
    ];
    names.map(|name| (name.to_owned(), fs::read(folder.join(name)).unwrap())).into()
}

#[test]
fn val_a_release_becomes_a_dataset() {
    let folder = area();
    let path = folder.path();
    release(path);
    let found = converted(path, "dataset", &["--traverse", "t"]);
    assert_eq!((&found["episodes"], &found["fps"]), (&6.into(), &20.into()), "{found}");
    assert_eq!(found["splits"], serde_json::json!({"train": "0:2", "validation": "2:4", "test": "4:6"}));
    assert_eq!(found["tasks"], serde_json::json!(["drive husky_a200 to the goal"]));
    let dataset = path.join("dataset");
    let info: Value = serde_json::from_slice(&fs::read(dataset.join("meta/info.json")).unwrap()).unwrap();
    assert_eq!(info["features"]["observation.height_patch"]["shape"], serde_json::json!([32, 32]));
    assert_eq!(info["features"]["observation.state"]["shape"], serde_json::json!([48]));
    assert_eq!((&info["robot_type"], &info["sastrugi"]["license"]), (&"husky_a200".into(), &"CC0-1.0".into()));
    assert_eq!(info["total_frames"], found["frames"]);
    let readme = fs::read_to_string(dataset.join("README.md")).unwrap();
    assert!(readme.starts_with("---\npretty_name: \"small\"\nlicense: cc0-1.0\n"), "{readme}");

    // Other missions, a smaller patch; the same bytes again, on one thread and in place of the first.
    let slow = converted(path, "slow", &["--traverse", "slow", "--patch", "1", "--patch-cell", "0.25"]);
    assert_eq!(slow["fps"], 10);
    let first = files(&dataset);
    converted(path, "again", &["--traverse", "t", "--threads", "1"]);
    assert!(first == files(&path.join("again")), "the bytes differ");
    converted(path, "slow", &["--traverse", "t"]);
    assert!(first == files(&path.join("slow")), "the bytes differ");
    assert_eq!(sastrugi_in(path, &["verify", "release", "--quiet"]).code, 0);
}

/// Two conversions into one folder would mix: the second is told to wait, and leaves nothing behind.
#[test]
fn val_one_conversion_writes_a_folder() {
    let folder = area();
    let path = folder.path();
    release(path);
    let lock = fs::File::create(path.join(".sastrugi-lock-dataset")).unwrap();
    lock.lock().unwrap();
    let call = ["convert", "release", "dataset", "--for", "lerobot", "--traverse", "t", "--quiet"];
    let refused = sastrugi_in(path, &call);
    assert!(refused.code == 75 && refused.stderr.contains("another run is writing dataset"), "{}", refused.stderr);
    assert!(!path.join("dataset").exists());
    drop(lock);
    assert_eq!(sastrugi_in(path, &call).code, 0);
    assert!(path.join("dataset/meta/info.json").is_file() && !path.join(".sastrugi-lock-dataset").exists());
}

#[test]
fn val_what_is_not_a_dataset_is_refused() {
    let folder = area();
    let path = folder.path();
    release(path);
    let refused = |arguments: &[&str], code: i32, words: &[&str]| {
        let call = sastrugi_in(path, &[&["convert"][..], arguments, &["--for", "lerobot", "--quiet"]].concat());
        assert_eq!(call.code, code, "{arguments:?}: {}", call.stderr);
        words.iter().for_each(|word| assert!(call.stderr.contains(word), "{arguments:?}: {word}: {}", call.stderr));
    };
    refused(&["release", "out"], 2, &["husky_a200 at 10 Hz, husky_a200 at 20 Hz", "--traverse", "slow, t"]);
    refused(&["release", "out", "--traverse", "none"], 2, &["`--traverse none`", "slow, t"]);
    refused(&["release", "release/out", "--traverse", "t"], 2, &["sealed"]);
    refused(&["release", "out", "--patch", "1", "--patch-cell", "0.3"], 2, &["whole number of cells"]);
    refused(&["release", "out", "--patch", "-1"], 2, &["whole number of cells"]);
    for option in [&["--crop"][..], &["--cog"], &["--window", "0,0,1,1"], &["--max-error", "1"], &["--fill", "2"]] {
        refused(&[&["release", "out"], option].concat(), 2, &["the only options for lerobot are --patch"]);
    }
    refused(&["nowhere", "out"], 65, &["nowhere", "not a sastrugi release"]);
    refused(&["study.toml", "out"], 65, &["not a sastrugi release"]);
    fs::create_dir(path.join("notes")).unwrap();
    write(&path.join("notes"), "a.txt", "kept");
    refused(&["release", "notes", "--traverse", "t"], 2, &["notes", "choose a new folder"]);
    refused(&["release", "study.toml", "--traverse", "t"], 2, &["study.toml", "choose a new folder"]);
    let call = sastrugi_in(path, &["convert", "study.toml", "a.tif", "--patch", "1"]);
    assert!(call.code == 2 && call.stderr.contains("apply to --for lerobot only"), "{}", call.stderr);

    write(path, "bare.toml", &STUDY[..STUDY.find("[[missions]]").unwrap()]);
    assert_eq!(sastrugi_in(path, &["run", "bare.toml", "-o", "bare", "--quiet"]).code, 0);
    refused(&["bare", "out"], 65, &["bare", "has no missions", "[[traverse]]"]);

    let samples = fs::read_dir(path.join("release/tables/samples")).unwrap().next().unwrap().unwrap().path();
    fs::write(samples, "changed").unwrap();
    refused(&["release", "out", "--traverse", "t"], 65, &["changed since the release was sealed"]);
    assert!(!path.join("out").exists());
    let left =
        fs::read_dir(path).unwrap().filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0);
}
