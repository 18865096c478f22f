//! `compare`: answers, exit codes, refusals.

use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::Value;
use std::path::Path;

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
    assert_ne!(one["answer"], "different", "{one}");
    let mixed = json(path, &["compare", "a.tif", "fit.json", "--outer-scale", "0.9", "--simulations", "119"], 0);
    assert_eq!((mixed["a"]["what"].as_str(), mixed["b"]["what"].as_str()), (Some("dem"), Some("fit")));
    let halves = json(path, &["compare", "a.tif", "--split-half", "--outer-scale", "0.9", "--simulations", "119"], 0);
    let names: Vec<&str> = halves["quantities"].as_array().unwrap().iter().filter_map(|q| q["name"].as_str()).collect();
    assert!(names.contains(&"third_order_structure") && !names.contains(&"sigma_m"), "{names:?}");
    assert_eq!((halves["what"].as_str(), halves["b"].is_null()), (Some("halves"), true));
    // A fit and its own DEM agree by construction.
    let call = sastrugi_in(path, &["fit", "a.tif", "--outer-scale", "0.9", "--bootstrap", "0", "-o", "own.json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = sastrugi_in(path, &["compare", "own.json", "a.tif"]);
    assert!(call.code == 2 && call.stderr.contains("says nothing"), "{}", call.stderr);
}

#[test]
fn val_what_cannot_be_compared_is_refused() {
    let folder = area();
    let path = folder.path();
    fit_file(path, "a.json", 0.1);
    std::fs::create_dir(path.join("release")).unwrap();
    let cases: [(&[&str], i32, &str); 7] = [
        (&["compare", "a.json"], 2, "<B>"),
        (&["compare", "a.json", "--split-half"], 2, "takes a DEM"),
        (&["compare", "release", "a.json"], 2, "not releases"),
        (&["compare", "a.json", "missing.tif"], 65, "missing.tif"),
        (&["compare", "a.json", "a.json", "--window-a", "0,0,1,1"], 2, "no window"),
        (&["compare", "a.json", "a.json", "--model", "auto"], 2, "one model"),
        (&["compare", "a.json", "a.json", "--equivalence-sigma", "-1"], 2, "equivalence_sigma"),
    ];
    for (arguments, code, word) in cases {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, code, "{arguments:?}: {}{}", call.stdout, call.stderr);
        assert!(call.stderr.contains(word), "{arguments:?}: {}", call.stderr);
    }
}
