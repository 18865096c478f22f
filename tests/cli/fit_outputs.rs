//! What `fit` writes beside its fit file.

use sastrugi_tests::{area, sastrugi_in, write};
use std::path::Path;
use tempfile::TempDir;

const FIT: &str = r#"{"model": "exponential", "parameters": {"sigma_m": 0.02, "range_m": 0.3}}"#;
const QUICK: [&str; 4] = ["--outer-scale", "1.5", "--bootstrap", "0"];

/// A folder with a snow-like DEM, `snow.tif`.
fn site() -> TempDir {
    let folder = area();
    snow(folder.path(), "snow.tif", "1");
    folder
}

fn snow(folder: &Path, name: &str, seed: &str) {
    write(folder, "truth.json", FIT);
    let call = ["texture", "truth.json", "--size", "12x12", "--cell", "0.1", "--phase", "gaussian", "--seed", seed];
    assert_eq!(sastrugi_in(folder, &[&call[..], &["-o", name]].concat()).code, 0);
}

fn fit(folder: &Path, arguments: &[&str]) -> sastrugi_tests::Called {
    sastrugi_in(folder, &[&["fit"], arguments, &QUICK].concat())
}

fn text(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

/// The call is refused as bad usage with the words, and writes no fit file.
fn refused(folder: &Path, arguments: &[&str], words: &str) {
    let call = fit(folder, arguments);
    assert_eq!(call.code, 2, "{arguments:?}: {}", call.stderr);
    assert!(call.stderr.contains(words), "{arguments:?}: {}", call.stderr);
    assert!(!folder.join("refused.json").exists(), "{arguments:?}");
}

#[test]
fn val_a_plot_shows_measured_and_model() {
    let folder = site();
    let path = folder.path();
    let call = fit(path, &["snow.tif", "--plot", "plot.svg", "-o", "fit.json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let svg = text(path, "plot.svg");
    for words in ["snow.tif", "covariance, m²", "structure function, m²", "model of the surface", "90°", "σ = 0.0"]
    {
        assert!(svg.contains(words), "{words}");
    }
    // The picture changes nothing of the fit, and the same call makes the same picture.
    assert_eq!(fit(path, &["snow.tif", "--plot", "again.svg", "-o", "other.json"]).code, 0);
    assert_eq!(svg, text(path, "again.svg"));
    assert_eq!(text(path, "fit.json"), text(path, "other.json"));

    refused(path, &["snow.tif", "--plot", "plot.png", "-o", "refused.json"], ".svg");
    refused(path, &["snow.tif", "--plot", "plot", "-o", "refused.json"], ".svg");
    write(path, "mask.svg", "");
    for same in ["refused.svg", "mask.svg"] {
        let arguments = ["snow.tif", "--exclude", "mask.svg", "--plot", same, "-o", "refused.svg"];
        refused(path, &arguments, "another file of this call");
    }
}
