//! `compare`: answers, exit codes, refusals.

use sastrugi_tests::{area, called, sastrugi_in, write};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn fit_file(folder: &Path, name: &str, sigma_m: f64) {
    let [low, high] = [0.98 * sigma_m, 1.02 * sigma_m];
    let text = format!(
        r#"{{"model": "exponential", "parameters": {{"sigma_m": {sigma_m}, "range_m": 0.3}},
        "intervals": {{"level": 0.95, "replicates": 99, "sigma_m": [{low}, {high}], "range_m": [0.29, 0.31]}}}}"#
    );
    write(folder, name, &text);
}

fn json(folder: &Path, arguments: &[&str], code: i32) -> Value {
    let mut all = arguments.to_vec();
    all.extend(["--json", "--quiet"]);
    let call = sastrugi_in(folder, &all);
    assert_eq!(call.code, code, "{arguments:?}: {}{}", call.stdout, call.stderr);
    serde_json::from_str(&call.stdout).unwrap()
}

fn answer(record: &Value, name: &str) -> String {
    let quantities = record["quantities"].as_array().unwrap();
    quantities.iter().find(|q| q["name"] == name).unwrap()["answer"].as_str().unwrap().to_owned()
}

#[test]
fn val_fits_are_compared_with_documented_exit_codes() {
    let folder = area();
    let path = folder.path();
    for (name, sigma) in [("a.json", 0.1), ("near.json", 0.101), ("far.json", 0.13)] {
        fit_file(path, name, sigma);
    }
    let near = json(path, &["compare", "a.json", "near.json", "--fail-on-difference"], 0);
    assert_eq!((answer(&near, "sigma_m").as_str(), answer(&near, "range_m").as_str()), ("same", "same"));
    assert_eq!(answer(&near, "height_distribution"), "cannot_tell");
    let far = json(path, &["compare", "a.json", "far.json", "--fail-on-difference"], 4);
    assert_eq!((answer(&far, "sigma_m").as_str(), far["answer"].as_str()), ("different", Some("different")));
    assert_eq!((far["seed"].as_u64(), far["parameters"]["equivalence_sigma"].as_f64()), (Some(0), Some(0.1)));
    assert_eq!(far["quantities"][0]["null"]["draws"], 1999);
    json(path, &["compare", "a.json", "far.json"], 0);
    // A wider bound, and the answer is another.
    let wide = json(path, &["compare", "a.json", "far.json", "--equivalence-sigma", "0.5", "--fail-on-difference"], 0);
    assert_eq!(answer(&wide, "sigma_m"), "same");
    let text = sastrugi_in(path, &["compare", "a.json", "far.json"]).stdout;
    for word in ["quantity", "sigma_m", "x1.300", "different: A and B differ in sigma_m", "cannot tell"] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
}

/// The same seed gives the same bytes on one thread and on two; a DEM is fitted as the fit was when compared with one.
#[test]
fn prop_dems_are_compared_whatever_the_threads() {
    let folder = area();
    let path = folder.path();
    fit_file(path, "fit.json", 0.1);
    for (name, seed) in [("a.tif", "1"), ("b.tif", "2")] {
        let made = ["texture", "fit.json", "--size", "6x6", "--cell", "0.1", "--phase", "gaussian", "--seed", seed];
        let call = sastrugi_in(path, &[&made[..], &["-o", name]].concat());
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    let compare = ["compare", "a.tif", "b.tif", "--outer-scale", "0.9", "--simulations", "119", "--seed", "7"];
    let one = json(path, &[&compare[..], &["--threads", "1"]].concat(), 0);
    assert_eq!(one, json(path, &[&compare[..], &["--threads", "2"]].concat(), 0));
    assert_eq!((one["what"].as_str(), one["simulations"].as_u64()), (Some("surfaces"), Some(119)));
    assert!(["same", "cannot_tell"].contains(&one["answer"].as_str().unwrap()), "{one}");
    let mixed = json(path, &["compare", "a.tif", "fit.json", "--outer-scale", "0.9", "--simulations", "119"], 0);
    assert_eq!((mixed["a"]["what"].as_str(), mixed["b"]["what"].as_str()), (Some("dem"), Some("fit")));
    let halves = json(path, &["compare", "a.tif", "--split-half", "--outer-scale", "0.9", "--simulations", "119"], 0);
    let names: Vec<&str> = halves["quantities"].as_array().unwrap().iter().filter_map(|q| q["name"].as_str()).collect();
    assert!(names.contains(&"third_order_structure") && !names.contains(&"sigma_m"), "{names:?}");
    assert_eq!((halves["what"].as_str(), halves["b"].is_null()), (Some("halves"), true));
    assert!(halves["quantities"][0]["site"]["halves"].as_f64() > Some(0.0), "{halves}");
    // 60 cells hold no two blocks of four windows.
    assert!(halves["interleaved"].is_null() && halves["notes"].to_string().contains("four blocks"), "{halves}");
    let judge = ["compare", "a.tif", "b.tif", "--statistics", "--outer-scale", "0.9", "--seed", "7"];
    let judged = json(path, &[&judge[..], &["--threads", "1"]].concat(), 0);
    assert_eq!(judged, json(path, &[&judge[..], &["--threads", "2"]].concat(), 0));
    assert_eq!((judged["what"].as_str(), judged["quantities"].as_array().unwrap().len()), (Some("statistics"), 11));
    assert_eq!(
        (&judged["blocks"]["shape_cells"], &judged["blocks"]["site"]),
        (&serde_json::json!([18, 18]), &9.into())
    );
    assert_eq!(judged["quantities"][6]["bound"].as_f64(), Some(0.05));
    assert_eq!(judged["blocks"]["copies"]["of_site"]["share"].as_f64(), Some(0.0));
    let own = json(path, &["compare", "a.tif", "a.tif", "--statistics", "--outer-scale", "0.9"], 0);
    assert_eq!(own["blocks"]["copies"]["of_site"]["share"].as_f64(), Some(1.0));
    let text = sastrugi_in(path, &judge).stdout;
    for word in ["site: halves", "interleaved", "euler_by_level", "spread_of_blocks", "verbatim copies of 7 x 7 cells"]
    {
        assert!(text.contains(word), "{word} is not in {text}");
    }
    let set = json(path, &[&judge[..], &["--set", "equivalence_covariance=0.2"]].concat(), 0);
    assert_eq!(set["quantities"][6]["bound"].as_f64(), Some(0.2));
    // A fit and its own DEM agree by construction.
    let call = sastrugi_in(path, &["fit", "a.tif", "--outer-scale", "0.9", "--bootstrap", "0", "-o", "own.json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = sastrugi_in(path, &["compare", "own.json", "a.tif"]);
    assert!(call.code == 2 && call.stderr.contains("agreement proves nothing"), "{}", call.stderr);
}

#[test]
fn val_what_cannot_be_compared_is_refused() {
    let folder = area();
    let path = folder.path();
    fit_file(path, "a.json", 0.1);
    std::fs::create_dir(path.join("release")).unwrap();
    let cases: [(&[&str], i32, &str); 16] = [
        (&["compare", "a.json"], 2, "<B>"),
        (&["compare", "a.json", "--split-half"], 2, "requires a DEM"),
        (&["compare", "a.json", "a.json", "--statistics"], 2, "compares two DEMs"),
        (&["compare", "a.json", "--statistics"], 2, "<B>"),
        (&["compare", "a.json", "--statistics", "--split-half"], 2, "cannot be used with"),
        (&["compare", "release", "release", "--statistics"], 2, "applies to DEMs"),
        (&["compare", "release", "a.json"], 2, "with another release"),
        (&["compare", "release", "release"], 65, "not a sastrugi release"),
        (&["compare", "release", "missing"], 65, "not a sastrugi release"),
        (&["compare", "release", "release", "--outer-scale", "2"], 2, "outer_scale_m"),
        (&["compare", "release", "release", "--margin", "-1"], 2, "margin"),
        (&["compare", "release", "release", "--window-a", "0,0,1,1"], 2, "compared in full"),
        (&["compare", "a.json", "missing.tif"], 65, "missing.tif"),
        (&["compare", "a.json", "a.json", "--window-a", "0,0,1,1"], 2, "a window applies to DEMs only"),
        (&["compare", "a.json", "a.json", "--model", "auto"], 2, "one model"),
        (&["compare", "a.json", "a.json", "--equivalence-sigma", "-1"], 2, "equivalence_sigma"),
    ];
    for (arguments, code, word) in cases {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, code, "{arguments:?}: {}{}", call.stdout, call.stderr);
        assert!(call.stderr.contains(word), "{arguments:?}: {}", call.stderr);
    }
}

/// Twelve smooth terrains of 13 m, driven for up to 8 s.
fn study(seed: u32, elevation_scale_m: &str) -> String {
    format!(
        "[study]\nname = \"smooth\"\nseed = {seed}\ndate = \"2026-11-22\"\nlicense = \"CC-BY-4.0\"\n\n[[terrain]]\nid = \"t\"\n\
         kind = \"weierstrass_mandelbrot\"\ngroup = \"smooth\"\ncount = 12\nsize_px = [64, 64]\ncell_m = 0.2\n\
         fractal_dimension = 2.1\nsampling_length_m = 12.8\nelevation_scale_m = {elevation_scale_m}\nfrequencies = 64\n\n\
         [[missions]]\nid = \"m\"\nterrains = [\"t\"]\ncount = 3\nlength_m = 4.0\nborder_m = 1.5\n\n\
         [[traverse]]\nid = \"h\"\nmissions = \"m\"\ntimeout_s = 8.0\n"
    )
}

/// A release of that study.
fn release(folder: &Path, name: &str, seed: u32, elevation_scale_m: &str) {
    let file = format!("{name}.toml");
    write(folder, &file, &study(seed, elevation_scale_m));
    let call = sastrugi_in(folder, &["run", &file, "-o", name, "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
}

fn answers(record: &Value) -> Vec<&str> {
    record["quantities"].as_array().unwrap().iter().map(|q| q["answer"].as_str().unwrap()).collect()
}

/// A release against itself, against the study with another seed, and against the study on rougher ground.
///
/// Null of the second comparison: labels of releases mean nothing, as terrains of both are drawn alike. The permutation tests
/// are exact and adjusted by Holm over all metrics, so that "different" comes up with probability 0.05 at most, once for the
/// seeds written here. Rougher ground: rms heights in the ratio of 3, which 12 terrains against 12 show for certain.
#[test]
fn stat_releases_are_compared_by_terrain() {
    let folder = area();
    let path = folder.path();
    release(path, "one", 1, "1e-18");
    release(path, "two", 2, "1e-18");
    release(path, "rough", 1, "1e-17");

    let own = json(path, &["compare", "one", "one", "--fail-on-difference"], 0);
    assert!(answers(&own).len() >= 3, "{own}");
    assert!(answers(&own).iter().all(|answer| *answer == "same"), "{own}");
    assert_eq!((&own["what"], &own["same_study_and_version"]), (&"releases".into(), &true.into()));
    assert_eq!(own["files"]["different"], serde_json::json!([]));

    let seeds = json(path, &["compare", "one", "two", "--fail-on-difference"], 0);
    assert!(answers(&seeds).iter().all(|answer| *answer != "different"), "{seeds}");
    assert_eq!(seeds["quantities"][0]["terrains"], serde_json::json!([12, 12]));
    assert_eq!((&seeds["quantities"][0]["paired"], &seeds["same_study_and_version"]), (&false.into(), &false.into()));
    // A margin of three times the mean is met by what is drawn alike.
    let wide = json(path, &["compare", "one", "two", "--margin", "3", "--fail-on-difference"], 0);
    assert!(answers(&wide).iter().all(|answer| *answer == "same"), "{wide}");

    let rough = json(path, &["compare", "one", "rough", "--fail-on-difference"], 4);
    let height = &rough["quantities"].as_array().unwrap().iter().find(|q| q["name"] == "rms_height_m").unwrap();
    // Same random draws, so that terrains are pairs.
    assert_eq!((&height["answer"], &height["paired"]), (&"different".into(), &true.into()));
    assert!(height["difference"].as_f64().unwrap() > 0.0 && height["p_adjusted"].as_f64().unwrap() <= 0.05);
    json(path, &["compare", "one", "rough"], 0);
    let threads = json(path, &["compare", "one", "rough", "--threads", "1"], 0);
    assert_eq!(threads["quantities"], rough["quantities"]);

    let text = sastrugi_in(path, &["compare", "one", "rough"]).stdout;
    for word in ["12 pairs", "rms_height_m", " different: classes/", "different studies", "different:"] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
}

/// Other bytes with the same heights are packaging; releases of other versions are compared by their metrics only.
#[test]
fn val_packaging_and_versions_of_releases() {
    let folder = area();
    let path = folder.path();
    release(path, "one", 1, "1e-18");
    release(path, "again", 1, "1e-18");
    json(path, &["compare", "one", "again", "--fail-on-difference"], 0);

    let file = "again/terrain/t-0001.tif";
    let call = sastrugi_in(path, &["convert", file, "plain.tif", "--compress", "none", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    std::fs::rename(path.join("plain.tif"), path.join(file)).unwrap();
    let sum = called(Command::new("sha256sum").arg(path.join(file))).stdout;
    let sha256 = sum.split(' ').next().unwrap();
    edit_manifest(&path.join("again"), |manifest| {
        let artifacts = manifest["artifacts"].as_array_mut().unwrap();
        let terrain = artifacts.iter_mut().find(|a| a["path"] == "terrain/t-0001.tif").unwrap();
        terrain["sha256"] = sha256.into();
    });
    let packed = json(path, &["compare", "one", "again", "--fail-on-difference"], 4);
    assert_eq!(packed["files"]["packaging"], serde_json::json!(["terrain/t-0001.tif"]));
    assert_eq!((&packed["files"]["different"], &packed["answer"]), (&serde_json::json!([]), &"same".into()));

    edit_manifest(&path.join("again"), |manifest| manifest["version"] = "0.0.9".into());
    let versions = json(path, &["compare", "one", "again", "--fail-on-difference"], 0);
    assert!(versions["files"].is_null() && versions["notes"][0].as_str().unwrap().contains("bytes cannot be compared"));

    edit_manifest(&path.join("again"), |manifest| {
        manifest["version"] = packed["releases"][0]["version"].clone();
        let artifacts = manifest["artifacts"].as_array_mut().unwrap();
        artifacts.retain(|a| a["path"] != "LICENSE" && a["path"] != "terrain/t-0001.tif");
    });
    let missing = json(path, &["compare", "one", "again", "--fail-on-difference"], 4);
    assert_eq!(missing["files"]["only_a"], serde_json::json!(["LICENSE", "terrain/t-0001.tif"]));
}

fn edit_manifest(release: &Path, edit: impl FnOnce(&mut Value)) {
    let path = release.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    edit(&mut manifest);
    std::fs::write(&path, manifest.to_string()).unwrap();
}
