//! Bad input gives one clear message and the documented exit code, writes no file, and never panics.

use sastrugi_tests::{Called, area, sastrugi_in, small_study, write};
use std::path::Path;

const USAGE: i32 = 2;
const INPUT: i32 = 65;

/// The call is refused with the code and the words, nothing is written, nothing panics.
fn refused(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let before = listing(folder);
    let Called { code: found, stdout, stderr } = sastrugi_in(folder, arguments);
    assert_eq!(found, code, "{arguments:?}: {stdout}{stderr}");
    assert!(!stderr.contains("panicked") && !stderr.contains("RUST_BACKTRACE"), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?}: \"{word}\" is not in: {stderr}");
    }
    assert_eq!(listing(folder), before, "{arguments:?} left files behind");
}

fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A study with one change is refused before anything is written.
fn study_refused(from: &str, to: &str, words: &[&str]) {
    let folder = area();
    let text = small_study();
    assert!(text.contains(from), "{from}");
    write(folder.path(), "study.toml", &text.replacen(from, to, 1));
    refused(folder.path(), &["run", "study.toml"], USAGE, words);
}

#[test]
fn val_studies_are_refused_with_the_line() {
    study_refused("seed = 7", "seed = ", &["not valid TOML", "study.toml"]);
    study_refused("seed = 7", "sead = 7", &["unknown key `sead`", "did you mean `seed`?"]);
    study_refused("outer_scale_m = 4000.0", "outer_scale = 4000.0", &["unknown key `outer_scale`", "outer_scale_m"]);
    study_refused("kind = \"multifractal\"", "kind = \"multifactal\"", &["multifactal", "weierstrass_mandelbrot"]);
    study_refused("size_px = [320, 300]", "size_px = [-320, 300]", &["size_px"]);
    study_refused("size_px = [320, 300]", "size_px = [2, 300]", &["size_px"]);
    study_refused("size_px = [320, 300]", "cell_m = nan", &["not finite"]);
    study_refused("size_px = [320, 300]", "cell_m = 0.0", &["cell_m", "above 0"]);
    study_refused("fit = \"naive\"", "fit = \"naif\"", &["naif", "did you mean \"naive\"?"]);
    study_refused("terrains = [\"rough\", \"smooth\"]", "terrains = [\"ruff\"]", &["ruff"]);
    study_refused("id = \"tile\"", "id = \"site\"", &["is taken"]);
    study_refused("count = 2", "count = 0", &["1 or more"]);
    study_refused("missions = \"short\"", "missions = \"short\"\nvehicle = \"tank\"", &["tank", "husky_a200"]);
    study_refused("missions = \"short\"", "missions = \"short\"\nimu_rate_hz = 7", &["imu_rate_hz", "divide"]);
    study_refused("missions = \"short\"", "missions = \"short\"\nstep_rate_hz = 100", &["step_rate_hz", "unstable"]);
    study_refused("[[fit]]", "[[fitt]]", &["unknown section `fitt`"]);
    study_refused("date = \"2026-01-01\"", "date = \"yesterday\"", &["YYYY-MM-DD"]);
}

#[test]
fn val_missing_files_are_input_errors() {
    let folder = area();
    refused(folder.path(), &["run", "nothing.toml"], INPUT, &["nothing.toml", "no such file"]);
    refused(folder.path(), &["info", "nothing.tif"], INPUT, &["nothing.tif", "no such file"]);
    refused(folder.path(), &["verify", "nothing"], INPUT, &["nothing"]);
    refused(folder.path(), &["merge", "nothing", "-o", "x"], INPUT, &["nothing"]);
    refused(folder.path(), &["fit", "nothing.tif", "-o", "fit.json"], INPUT, &["no such file"]);
    refused(folder.path(), &["texture", "nothing.json", "-o", "t.tif"], INPUT, &["nothing.json"]);
    refused(folder.path(), &["traverse", "nothing.tif"], INPUT, &["no such file"]);
    refused(folder.path(), &["report", "nothing"], INPUT, &["nothing"]);
    let study = small_study().replace("jacksboro.tif", "gone.tif");
    write(folder.path(), "study.toml", &study);
    refused(folder.path(), &["run", "study.toml"], INPUT, &["gone.tif", "no such file"]);
}

#[test]
fn val_bad_calls_are_usage_errors() {
    let folder = area();
    let run = |arguments: &[&str], words: &[&str]| refused(folder.path(), arguments, USAGE, words);
    run(&["terrain", "nothing", "-o", "t.tif"], &["nothing", "multifractal"]);
    run(&["terrain", "multifractal", "--set", "hight=1", "-o", "t.tif"], &["hight", "high"]);
    run(
        &["terrain", "multifractal", "--set", "high.fractal_dimension=3.5", "-o", "t.tif"],
        &["fractal_dimension", "3.5"],
    );
    run(&["terrain", "multifractal", "--set", "size_m=[-1.0,1.0]", "-o", "t.tif"], &["size_m"]);
    run(&["terrain", "multifractal", "-o", "t.xyz"], &["t.xyz", ".tif"]);
    run(&["terrain", "multifractal", "--set", "size_px=[64,64]", "-o", "t.hgt"], &["t.hgt"]);
    run(&["frobnicate"], &["frobnicate"]);
    run(&["run"], &["STUDY"]);
    run(&["kinds", "multifractl"], &["did you mean `multifractal`?"]);
    run(&["schema", "nothing"], &["missions"]);
    run(&["terrain", "multifractal", "--threads", "0", "-o", "t.tif"], &["--threads"]);
    write(folder.path(), "study.toml", &small_study());
    run(&["run", "study.toml", "--shard", "4/3"], &["1 <= I <= N"]);
    run(&["run", "study.toml", "--memory", "-1"], &["--memory"]);
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    write(&folder.path().join("mine"), "thesis.txt", "precious");
    run(&["run", "study.toml", "-o", "mine"], &["not empty"]);
    run(&["run", "study.toml", "-o", "study.toml"], &["is a file"]);
}

#[test]
fn val_bad_rasters_are_input_errors() {
    let folder = area();
    let path = folder.path();
    let grid =
        |text: &str| format!("ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n{text}");
    write(path, "empty.tif", "");
    std::fs::write(
        path.join("random.tif"),
        (0..4096u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect::<Vec<u8>>(),
    )
    .unwrap();
    let jacksboro = std::fs::read(sastrugi_fixtures::jacksboro()).unwrap();
    std::fs::write(path.join("truncated.tif"), &jacksboro[..jacksboro.len() / 2]).unwrap();
    std::fs::write(path.join("stub.tif"), &jacksboro[..40]).unwrap();
    write(path, "short.asc", &grid("1 2 3\n4 5\n"));
    write(path, "long.asc", &grid("1 2 3\n4 5 6 7\n"));
    write(path, "words.asc", &grid("1 2 3\n4 five 6\n"));
    write(path, "void.asc", &grid("-9999 -9999 -9999\n-9999 -9999 -9999\n"));
    write(path, "huge.asc", "ncols 99999999999\nnrows 99999999999\nxllcorner 0\nyllcorner 0\ncellsize 1\n1\n");
    write(path, "negative.asc", "ncols -3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1\n");
    write(path, "odd.hgt", "12345");
    write(path, "bad.npy", "\u{93}NUMPY nonsense");
    for name in [
        "empty.tif",
        "random.tif",
        "truncated.tif",
        "stub.tif",
        "short.asc",
        "long.asc",
        "words.asc",
        "void.asc",
        "huge.asc",
        "negative.asc",
        "odd.hgt",
        "bad.npy",
    ] {
        refused(path, &["info", name], INPUT, &[name]);
        refused(path, &["convert", name, "out.tif"], INPUT, &[name]);
        refused(path, &["fit", name, "-o", "fit.json"], INPUT, &[name]);
        refused(path, &["roughness", name], INPUT, &[name]);
    }
}

#[test]
fn val_rasters_that_cannot_be_fitted_say_why() {
    let folder = area();
    let path = folder.path();
    let flat = "1 ".repeat(64 * 64);
    write(path, "flat.asc", &format!("ncols 64\nnrows 64\nxllcorner 0\nyllcorner 0\ncellsize 0.1\n{flat}\n"));
    refused(path, &["fit", "flat.asc", "--outer-scale", "1", "-o", "fit.json"], INPUT, &["constant"]);
    refused(path, &["fit", "flat.asc", "--outer-scale", "5", "-o", "fit.json"], INPUT, &["window"]);
    refused(path, &["fit", "flat.asc", "--outer-scale", "-1", "-o", "fit.json"], USAGE, &["outer_scale_m"]);
    refused(path, &["fit", "flat.asc", "--trim", "0.7", "-o", "fit.json"], USAGE, &["trim"]);
    refused(path, &["fit", "flat.asc", "--window", "9,9,10,10", "-o", "fit.json"], INPUT, &["window"]);
    refused(path, &["fit", "flat.asc", "--mode", "magic", "-o", "fit.json"], USAGE, &["magic"]);
    write(path, "fit.json", "{\"model\": \"exponential\", \"parameters\": {\"sigma_m\": -1.0, \"range_m\": 0.3}}");
    refused(path, &["texture", "fit.json", "-o", "t.tif"], USAGE, &["sigma_m"]);
    write(path, "not.json", "{\"a\": 1}");
    refused(path, &["texture", "not.json", "-o", "t.tif"], INPUT, &["no fit file"]);
}

#[test]
fn val_bad_masks_are_input_errors() {
    let folder = area();
    let path = folder.path();
    std::fs::copy(sastrugi_fixtures::jacksboro(), path.join("site.tif")).unwrap();
    write(path, "point.geojson", "{\"type\": \"Point\", \"coordinates\": [1, 2]}");
    write(path, "broken.geojson", "{\"type\": \"Polygon\", \"coord");
    let square = |low: i32, high: i32| {
        let ring = format!("[{low}, {low}], [{high}, {low}], [{high}, {high}], [{low}, {high}], [{low}, {low}]");
        format!("{{\"type\": \"Polygon\", \"coordinates\": [[{ring}]]}}")
    };
    write(path, "metres.geojson", &square(1000, 2000));
    write(path, "all.geojson", &square(-100, 100));
    write(path, "words.txt", "all but the trees");
    let fit = |option: &str, mask: &str, words: &[&str]| {
        let arguments = ["fit", "site.tif", "--outer-scale", "4000", option, mask, "-o", "fit.json"];
        refused(path, &arguments, INPUT, words);
        let stderr = sastrugi_in(path, &arguments).stderr;
        assert_eq!(stderr.lines().count(), 1, "one sentence: {stderr}");
    };
    fit("--mask", "nothing.geojson", &["nothing.geojson", "no such file"]);
    fit("--mask", "point.geojson", &["point.geojson", "holds a Point"]);
    fit("--mask", "broken.geojson", &["broken.geojson", "no GeoJSON"]);
    fit("--mask", "metres.geojson", &["metres.geojson", "none of the DEM's cells", "coordinates"]);
    fit("--exclude", "all.geojson", &["all.geojson", "none of the DEM's cells"]);
    fit("--mask", "words.txt", &["words.txt", "no raster"]);
    // What the mask keeps lies outside of the window.
    let ring = "[-84.6, 36.4], [-84.3, 36.4], [-84.3, 36.7], [-84.6, 36.7], [-84.6, 36.4]";
    write(path, "west.geojson", &format!("{{\"type\": \"Polygon\", \"coordinates\": [[{ring}]]}}"));
    let arguments = ["fit", "site.tif", "--window", "-84.25,36.46,-84.20,36.66", "--mask", "west.geojson"];
    refused(path, &[&arguments[..], &["-o", "fit.json"]].concat(), INPUT, &["masks leave no cell"]);
    let study = |mask: &str| {
        format!(
            "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"site.tif\"\n\
             [[fit]]\nid = \"f\"\ndem = \"a\"\nouter_scale_m = 4000.0\nbootstrap = 0\nmask = {mask}\n"
        )
    };
    write(path, "study.toml", &study("\"nothing.geojson\""));
    refused(path, &["run", "study.toml"], INPUT, &["nothing.geojson", "no such file"]);
    write(path, "study.toml", &study("7"));
    refused(path, &["run", "study.toml"], USAGE, &["mask", "a file name or a list of file names"]);
    write(path, "study.toml", &study("\"metres.geojson\""));
    let call = sastrugi_in(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert!(call.code == 3 && call.stderr.contains("mask/f-1.geojson: keeps none"), "{}", call.stderr);
}

#[test]
fn val_bad_transects_are_input_errors() {
    let folder = area();
    let path = folder.path();
    write(path, "words.csv", "x,a\n0,1\n1,two\n2,3\n");
    write(path, "uneven.csv", "x,a\n0,1\n1,2\n3,4\n4,5\n");
    write(path, "heights.csv", "1\n2\n4\n");
    for verb in [&["info"][..], &["fit", "-o", "fit.json"]] {
        let call = |name| [verb, &[name]].concat();
        refused(path, &call("words.csv"), INPUT, &["words.csv: line 3, column 2", "\"two\" is no number"]);
        refused(path, &call("uneven.csv"), INPUT, &["uneven.csv: line 3, column 1", "even place"]);
        refused(path, &call("heights.csv"), USAGE, &["heights.csv", "cell size", "must be given"]);
    }
    refused(path, &["fit", "heights.csv", "--window", "0,0,1,1", "-o", "f.json"], USAGE, &["transects", "window"]);
}

#[test]
fn val_settings_of_point_clouds_are_refused_elsewhere() {
    let folder = area();
    let path = folder.path();
    std::fs::copy(sastrugi_fixtures::jacksboro(), path.join("site.tif")).unwrap();
    let words = ["site.tif", "is no point cloud"];
    for more in [&["--statistic", "median"][..], &["--fill", "2"], &["--ground"]] {
        refused(path, &[&["fit", "site.tif", "-o", "fit.json"], more].concat(), USAGE, &words);
        refused(path, &[&["convert", "site.tif", "b.tif"], more].concat(), USAGE, &words);
    }
    refused(path, &["convert", "site.tif", "b.tif", "--statistic", "p101"], USAGE, &["p101", "p0 to p100"]);
    let study = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"site.tif\"\n";
    write(path, "study.toml", &format!("{study}statistic = \"mode\"\n"));
    refused(path, &["run", "study.toml"], USAGE, &["statistic", "mode", "median"]);
    let mut cloud = b"LASF".to_vec();
    cloud.resize(400, 0);
    std::fs::write(path.join("cloud.laz"), cloud).unwrap();
    for verb in ["fit", "roughness", "info"] {
        let output = if verb == "fit" { &["-o", "fit.json"][..] } else { &[] };
        refused(path, &[&[verb, "cloud.laz"], output].concat(), INPUT, &["cloud.laz"]);
    }
}

/// Items that cannot succeed are reported with their parameters; the others go on, and the release is sealed.
#[test]
fn val_a_failed_item_costs_itself_only() {
    let folder = area();
    write(folder.path(), "study.toml", &small_study().replace("length_m = 5.0", "length_m = 50.0"));
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 3, "{}", call.stderr);
    assert!(
        call.stderr.contains("missions/short@rough-0001 failed") && call.stderr.contains("50 m"),
        "{}",
        call.stderr
    );
    let manifest = std::fs::read_to_string(folder.path().join("release/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let failed = manifest["failed"].as_array().unwrap();
    assert_eq!(failed.len(), 6);
    assert!(failed.iter().any(|f| f["parameters"]["missions"]["length_m"] == 50.0));
    let verify = sastrugi_in(folder.path(), &["verify", "release", "--quiet"]);
    assert_eq!(verify.code, 0, "{}{}", verify.stdout, verify.stderr);
}

#[test]
fn val_a_study_whose_every_item_fails_fails() {
    let folder = area();
    write(folder.path(), "broken.tif", "II*\0nonsense");
    let study = "[study]\nname = \"x\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"a\"\nfile = \"broken.tif\"\n";
    write(folder.path(), "study.toml", study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, INPUT, "{}", call.stderr);
    assert!(call.stderr.contains("dem/a.tif"), "the file as the release calls it: {}", call.stderr);
    assert!(!folder.path().join("release").exists());
}
