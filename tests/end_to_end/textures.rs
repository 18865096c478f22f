//! Textures that repeat a site, in studies.

use sastrugi_tests::{area, differing, rows, run_study, sastrugi_in, textured_study, write};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// All methods that repeat a site in one study, side by side, on a background and tiled; planned, and recomputed to the same bytes.
#[test]
fn val_a_study_of_textures_that_repeat_a_site() {
    let folder = area();
    write(folder.path(), "study.toml", &textured_study());
    let plan = sastrugi_in(folder.path(), &["plan", "study.toml", "--json"]);
    assert_eq!(plan.code, 0, "{}", plan.stderr);
    let sums = run_study(folder.path(), &textured_study(), &[]);
    let methods = ["fft-ma", "modulated", "wavelet-statistics", "quilting", "exemplar"];
    let textures = methods.map(|method| format!("texture/side-{method}.tif"));
    for path in textures.iter().map(String::as_str).chain(["texture/laid.tif", "texture/loose.tif"]) {
        assert!(sums.contains_key(path), "{path} is missing from {:?}", sums.keys());
    }
    let release = folder.path().join("release");
    let scoreboard = rows(&release, "scoreboard");
    for method in methods {
        assert!(
            scoreboard.iter().any(|row| row["method"] == method.replace('-', "_")),
            "{method} is not in {scoreboard:?}"
        );
    }
    for row in &scoreboard {
        let method = row["method"].as_str().unwrap_or_default();
        assert_eq!(row["refused"], "", "{method}");
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        // Methods that repeat a site do not know their mean covariance beforehand; what they make is measured.
        assert_eq!(number("covariance_error_max").is_finite(), method == "fft_ma", "{method}");
        assert!((0.4..1.6).contains(&number("variance_mean")), "{method}: {}", number("variance_mean"));
    }
    let page = fs::read_to_string(release.join("report/index.html")).unwrap();
    assert!(page.contains("mean covariance not known beforehand"));
    // On the background of the fit it holds what that lacks; alone, the residual as it was measured.
    let terrains = rows(&release, "terrains");
    for (id, covariance) in [("laid", "residual"), ("loose", "surface")] {
        let row = terrains.iter().find(|row| row["terrain_id"] == id).unwrap();
        let params = row["params"].as_str().unwrap_or_default();
        assert!(params.contains(&format!("\"covariance\":\"{covariance}\"")), "{id}: {params}");
    }
    let verify = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all", "--quiet"]);
    assert_eq!(verify.code, 0, "{}{}", verify.stdout, verify.stderr);
    // Without the statistics, the methods that need them are refused before anything runs.
    for (method, code) in [("modulated", 2), ("quilting", 0)] {
        let study = textured_study().replace("statistics = true\n", "");
        let study = format!(
            "{}[[texture]]\nid = \"one\"\nfit = \"fit\"\nmethod = \"{method}\"\n",
            &study[..study.find("[[texture]]").unwrap()]
        );
        write(folder.path(), "other.toml", &study);
        let call = sastrugi_in(folder.path(), &["plan", "other.toml"]);
        assert_eq!(call.code, code, "{method}: {}", call.stderr);
        assert_eq!(call.stderr.contains("statistics = true"), code == 2, "{method}: {}", call.stderr);
    }
    for (key, words) in
        [("ratio = 0.5", "keeps the directions of the site"), ("cell_m = 0.2", "on the cells of the site")]
    {
        let study = textured_study().replace("method = \"quilting\"\n", &format!("method = \"quilting\"\n{key}\n"));
        write(folder.path(), "other.toml", &study);
        let call = sastrugi_in(folder.path(), &["plan", "other.toml"]);
        // The sentence is wrapped to the width of the terminal.
        let said: String = call.stderr.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(call.code == 2 && said.contains(words), "{key}: {}", call.stderr);
    }
}

/// A site of 16 m x 16 m, `site.tif`, and a mask of it.
fn site(path: &Path) {
    write(path, "own.json", "{\"model\": \"exponential\", \"parameters\": {\"sigma_m\": 0.05, \"range_m\": 0.3}}");
    write(path, "plot.geojson", "{\"type\": \"Polygon\", \"coordinates\": [[[1,1],[15,1],[15,15],[1,15],[1,1]]]}");
    let call = sastrugi_in(
        path,
        &[
            "texture", "own.json", "--size", "16x16", "--cell", "0.1", "--phase", "gaussian", "--seed", "3", "-o",
            "site.tif",
        ],
    );
    assert_eq!(call.code, 0, "{}", call.stderr);
}

/// Holes are filled with textures that repeat a site: a study and the verb give the same heights, no cell stays empty, and what is not possible
/// is refused before anything runs.
#[test]
fn val_holes_are_filled_in_a_study() {
    let folder = area();
    let path = folder.path();
    site(path);
    write(path, "hole.geojson", "{\"type\": \"Polygon\", \"coordinates\": [[[6,6],[9,6],[9,8],[6,8],[6,6]]]}");
    let study = |method: &str| {
        format!(
            "[study]\nname = \"filled\"\nseed = 7\ndate = \"2026-01-01\"\n\n[[dem]]\nid = \"site\"\nfile = \"holed.tif\"\n\
             license = \"CC-BY-4.0\"\nattribution = \"The agency\"\n\n[[fit]]\nid = \"fit\"\ndem = \"site\"\nouter_scale_m = 2.0\n\
             bootstrap = 0\nstatistics = true\n\n[[texture]]\nid = \"whole\"\nfit = \"fit\"\nfill = \"site\"\nmethod = \"{method}\"\nseed = 4\n"
        )
    };
    let run = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
        call.stdout
    };
    run(&["convert", "site.tif", "holed.tif", "--exclude", "hole.geojson"]);
    run(&["fit", "holed.tif", "--outer-scale", "2", "--bootstrap", "0", "--statistics", "-o", "fit.json"]);
    for (method, exemplar) in [("modulated", &[][..]), ("quilting", &["--exemplar", "holed.tif"][..])] {
        fs::remove_dir_all(path.join("release")).ok();
        run_study(path, &study(method), &[]);
        let verb = ["texture", "fit.json", "--fill", "holed.tif", "--method", method, "--seed", "4", "-o", "verb.tif"];
        run(&[&verb[..], exemplar].concat());
        let whole = heights(path, "release/texture/whole.tif");
        assert!(whole == heights(path, "verb.tif") && whole != heights(path, "holed.tif"), "{method}");
        let info: Value = serde_json::from_str(&run(&["info", "verb.tif", "--json"])).unwrap();
        assert_eq!(info["valid"], 160 * 160, "{method}");
    }
    for (text, words) in [
        (study("cholesky"), "needs `fft_ma` or a method that repeats the site"),
        (study("modulated").replace("statistics = true\n", ""), "statistics = true"),
        (study("modulated").replace("seed = 4", "size_px = [9, 9]"), "takes its cells from the DEM"),
    ] {
        write(path, "other.toml", &text);
        let call = sastrugi_in(path, &["plan", "other.toml"]);
        let said: String = call.stderr.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(call.code == 2 && said.contains(words), "{words}: {}", call.stderr);
    }
}

fn heights(path: &Path, name: &str) -> String {
    let call = sastrugi_in(path, &["convert", name, "heights.asc"]);
    assert_eq!(call.code, 0, "{name}: {}", call.stderr);
    fs::read_to_string(path.join("heights.asc")).unwrap()
}

/// A texture copied from a measured DEM names it as its source, so that its terms follow; the verb makes the same heights from the same DEM
/// and mask.
#[test]
fn val_the_terms_of_the_exemplar_follow_the_texture() {
    let folder = area();
    let path = folder.path();
    site(path);
    let study = "[study]\nname = \"copied\"\nseed = 7\ndate = \"2026-01-01\"\nlicense = \"CC-BY-4.0\"\n\n[[dem]]\nid = \"site\"\n\
                 file = \"site.tif\"\nlicense = \"CC-BY-4.0\"\nattribution = \"The agency\"\n\n[[fit]]\nid = \"fit\"\ndem = \"site\"\n\
                 outer_scale_m = 2.0\nbootstrap = 0\nmask = \"plot.geojson\"\n\n[[texture]]\nid = \"copied\"\nfit = \"fit\"\n\
                 method = \"quilting\"\nseed = 4\nsize_m = [8.0, 8.0]\n";
    let sums = run_study(path, study, &[]);
    assert!(sums.contains_key("texture/copied.tif"));
    let text = fs::read_to_string(path.join("release/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(manifest["sources"][0]["attribution"], "The agency");
    let artifacts = manifest["artifacts"].as_array().unwrap();
    let texture = artifacts.iter().find(|a| a["path"] == "texture/copied.tif").unwrap();
    assert_eq!(texture["sources"], serde_json::json!(["site"]));
    let notes = manifest["notes"].to_string();
    assert!(notes.contains("licence and attribution of its DEM extend to the texture"), "{notes}");
    for arguments in [
        &["fit", "site.tif", "--outer-scale", "2", "--bootstrap", "0", "--mask", "plot.geojson", "-o", "fit.json"][..],
        &[
            "texture",
            "fit.json",
            "--method",
            "quilting",
            "--exemplar",
            "site.tif",
            "--mask",
            "plot.geojson",
            "--size",
            "8x8",
            "--seed",
            "4",
            "-o",
            "verb.tif",
        ],
    ] {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    assert_eq!(heights(path, "verb.tif"), heights(path, "release/texture/copied.tif"));
    // Another run gives the same release.
    let other = area();
    site(other.path());
    assert_eq!(differing(&sums, &run_study(other.path(), study, &["--threads", "1"])), Vec::<String>::new());
}
