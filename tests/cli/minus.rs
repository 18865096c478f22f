//! `fit A --minus B`: B is co-registered to A, and the fit is that of the difference.

use crate::coregister::{moved, noisy, number};
use crate::fit_outputs::table;
use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::Value;
use std::path::Path;

const FIT: &str = r#"{"model": "exponential", "parameters": {"sigma_m": 0.1, "range_m": 0.5}}"#;

fn done(folder: &Path, arguments: &[&str]) {
    let call = sastrugi_in(folder, arguments);
    assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
}

/// Ground, snow of a known texture on it, and the ground again in a file that says it lies 7 cm east and 4 cm south and is
/// 3 m higher: the shift is undone to 0.05 cells without resampling the truth, and sigma of the snow is found within 5 % (its
/// standard error here is about 1.5 %, its shares of the bilinear reading of the ground below 1 %).
#[test]
fn val_snow_is_found_between_two_dems() {
    let folder = area();
    let path = folder.path();
    write(path, "snow.json", FIT);
    done(path, &["terrain", "multifractal", "--set", "size_px=[300,300]", "--set", "cell_m=0.1", "-o", "ground.asc"]);
    let call = ["texture", "snow.json", "--size", "30x30", "--cell", "0.1", "--phase", "gaussian", "--seed", "3"];
    done(path, &[&call[..], &["--onto", "ground.asc", "-o", "snow.tif"]].concat());
    let text = std::fs::read_to_string(path.join("ground.asc")).unwrap();
    write(path, "moved.asc", &moved(&text, [0.07, -0.04], 3.0, [0.0; 2]));
    done(path, &["fit", "snow.tif", "--minus", "moved.asc", "--bootstrap", "0", "-o", "depth.json"]);
    let fit: Value = serde_json::from_slice(&std::fs::read(path.join("depth.json")).unwrap()).unwrap();
    let minus = &fit["source"]["minus"];
    assert_eq!(minus["file"], "moved.asc");
    let c = &minus["coregistration"];
    let shift = [number(&c["shift_m"][0]), number(&c["shift_m"][1])];
    assert!((shift[0] + 0.07).abs() < 0.005 && (shift[1] - 0.04).abs() < 0.005, "{c}");
    assert!((number(&c["raise_m"]) + 3.0).abs() < 0.05 && c["converged"] == true, "{c}");
    assert!(number(&c["nmad_after_m"]) < number(&c["nmad_before_m"]), "{c}");
    let sigma = number(&fit["parameters"]["sigma_m"]);
    assert!((sigma - 0.1).abs() < 0.005, "{fit}");
}

/// A study's `minus` gives the figures of the verb; what cannot be subtracted is refused with the reason.
#[test]
fn val_a_study_subtracts_as_the_verb_does() {
    let folder = area();
    let path = folder.path();
    write(path, "snow.json", FIT);
    let terrain = ["terrain", "multifractal", "--set", "size_px=[150,150]", "--set", "cell_m=0.1", "-o", "ground.tif"];
    done(path, &terrain);
    let call = ["texture", "snow.json", "--size", "15x15", "--cell", "0.1", "--phase", "gaussian", "--seed", "3"];
    done(path, &[&call[..], &["--onto", "ground.tif", "-o", "snow.tif"]].concat());
    let study = |minus: &str| {
        format!(
            "[study]\nname = \"depth\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"on\"\nfile = \"snow.tif\"\n[[dem]]\n\
             id = \"off\"\nfile = \"ground.tif\"\n[[fit]]\nid = \"depth\"\ndem = \"on\"\nminus = \"{minus}\"\nseed = 0\n\
             bootstrap = 0\n"
        )
    };
    write(path, "study.toml", &study("off"));
    done(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    done(path, &["fit", "snow.tif", "--minus", "ground.tif", "--bootstrap", "0", "-o", "verb.json"]);
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(path.join(name)).unwrap()).unwrap() };
    let (item, verb) = (read("release/fit/depth.json"), read("verb.json"));
    assert_eq!(item["parameters"], verb["parameters"]);
    assert_eq!(item["source"]["minus"]["coregistration"], verb["source"]["minus"]["coregistration"]);
    write(path, "study.toml", &study("of"));
    let call = sastrugi_in(path, &["run", "study.toml", "-o", "other", "--quiet"]);
    assert!(call.code == 2 && call.stderr.contains("did you mean \"off\"?"), "{}", call.stderr);

    let ground = ["terrain", "multifractal", "--set", "size_px=[150,150]", "--set", "cell_m=0.1", "-o", "ground.asc"];
    done(path, &ground);
    let text = std::fs::read_to_string(path.join("ground.asc")).unwrap();
    write(path, "far.asc", &moved(&text, [500.0, 0.0], 0.0, [0.0; 2]));
    let jacksboro = sastrugi_fixtures::jacksboro();
    for (other, words) in [("far.asc", "do not overlap"), (jacksboro.to_str().unwrap(), "in degrees")] {
        let call = sastrugi_in(path, &["fit", "snow.tif", "--minus", other, "-o", "no.json"]);
        assert!(call.code == 65 && call.stderr.contains(words), "{}: {}", call.code, call.stderr);
        assert!(!path.join("no.json").exists());
    }
}

/// A measured catchment with 10 cm of snow on it, and the catchment in a file that says it lies elsewhere: shifts of part and of several cells come
/// back to 0.05 cells. On its slopes (0.4 m/m along either axis) some 900 independent patches of snow leave a standard error of 0.01 cells; the
/// snow has mean 0 and sigma 0.1 m, to which reading the ground between its cells adds a few centimetres in square.
#[test]
fn val_a_measured_site_is_moved_back() {
    let site = sastrugi_fixtures::workspace_root().join("fixtures/dem/pozo_blanca.tif");
    let folder = area();
    let path = folder.path();
    write(path, "snow.json", r#"{"model": "exponential", "parameters": {"sigma_m": 0.1, "range_m": 3.0}}"#);
    let site = site.to_str().unwrap();
    let call = ["texture", "snow.json", "--size", "271x281", "--cell", "1", "--phase", "gaussian", "--onto", site];
    done(path, &[&call[..], &["-o", "snow.tif"]].concat());
    done(path, &["convert", site, "site.asc"]);
    let text = std::fs::read_to_string(path.join("site.asc")).unwrap();
    for by in [[0.3, -0.45], [1.7, 2.2]] {
        write(path, "moved.asc", &moved(&text, by, 0.0, [0.0; 2]));
        done(
            path,
            &["fit", "snow.tif", "--minus", "moved.asc", "--outer-scale", "25", "--bootstrap", "0", "-o", "d.json"],
        );
        let fit: Value = serde_json::from_slice(&std::fs::read(path.join("d.json")).unwrap()).unwrap();
        let c = &fit["source"]["minus"]["coregistration"];
        let error = [0, 1].map(|k| number(&c["shift_m"][k]) + by[k]);
        assert!(error.iter().all(|e| e.abs() < 0.05), "{by:?}: {c}");
        assert!(number(&c["raise_m"]).abs() < 0.03 && c["converged"] == true, "{by:?}: {c}");
        let sigma = number(&fit["parameters"]["sigma_m"]);
        assert!((sigma / 0.1 - 1.0).abs() < 0.25, "{by:?}: {}", fit["parameters"]);
    }
}

/// DEMs that differ by noise alone have no covariance to fit: exit code 65 with the fit's sentence, and the co-registration is kept, printed and
/// as JSON where a fit file has it, with the difference; in a study the failed item says it.
#[test]
fn val_a_failed_fit_keeps_the_coregistration() {
    let folder = area();
    let path = folder.path();
    let ground = ["terrain", "multifractal", "--set", "size_px=[150,150]", "--set", "cell_m=0.1", "-o", "ground.asc"];
    done(path, &ground);
    let text = std::fs::read_to_string(path.join("ground.asc")).unwrap();
    write(path, "snow.json", FIT);
    write(path, "one.asc", &noisy(&text, 0.02, 1));
    write(path, "two.asc", &noisy(&moved(&text, [0.03, 0.02], 1.0, [0.0; 2]), 0.02, 2));
    let fit = ["fit", "one.asc", "--minus", "two.asc", "--bootstrap", "0", "-o", "fit.json"];
    let call = sastrugi_in(path, &[&fit[..], &["--difference", "depth.tif"]].concat());
    assert!(call.code == 65 && call.stderr.contains("the residual is white"), "{} {}", call.code, call.stderr);
    assert!(call.stdout.contains("moved east") && call.stdout.contains("NMAD"), "{}", call.stdout);
    assert!(!path.join("fit.json").exists());
    let depth = sastrugi_in(path, &["info", "depth.tif", "--json"]);
    let depth: Value = serde_json::from_str(&depth.stdout).unwrap();
    assert_eq!((&depth["rows"], &depth["unit"]), (&150.into(), &"m".into()));

    let call = sastrugi_in(path, &[&fit[..], &["--json"]].concat());
    let kept: Value = serde_json::from_str(&call.stdout).unwrap();
    let c = &kept["source"]["minus"]["coregistration"];
    assert!(call.code == 65 && kept["error"].as_str().unwrap().contains("white"), "{kept}");
    assert!((number(&c["shift_m"][0]) + 0.03).abs() < 0.005 && (number(&c["raise_m"]) + 1.0).abs() < 0.005, "{c}");

    // In a table the co-registration stands without a fit, and with one.
    done(
        path,
        &[
            "texture",
            "snow.json",
            "--size",
            "15x15",
            "--cell",
            "0.1",
            "--phase",
            "gaussian",
            "--onto",
            "one.asc",
            "-o",
            "snow.asc",
        ],
    );
    let call = ["fit", "one.asc", "snow.asc", "--minus", "two.asc", "--bootstrap", "0", "--table", "t.csv"];
    assert_eq!(sastrugi_in(path, &call).code, 3);
    let rows = table(path, "t.csv");
    for row in &rows {
        let column = |name: &str| row[name].parse::<f64>().unwrap();
        // Snow of 10 cm hides some of the shift.
        let off = [column("shift_east_m") + 0.03, column("shift_north_m") + 0.02];
        assert!(off.iter().all(|off| off.abs() < 0.03), "{row:?}");
        assert!(column("nmad_before_m") > 0.02 && column("nmad_after_m") > 0.02, "{row:?}");
        assert!((column("raise_m") + 1.0).abs() < 0.05, "{row:?}");
    }
    assert_eq!([&rows[0]["gained"], &rows[1]["gained"]], ["true", "false"]);
    assert!(rows[0]["error"].contains("white") && rows[0]["verdict"].is_empty(), "{rows:?}");
    assert!(rows[1]["error"].is_empty() && rows[1]["carried_rms_share"].parse::<f64>().unwrap() > 0.5, "{rows:?}");

    let study = "[study]\nname = \"depth\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"one\"\nfile = \"one.asc\"\n[[dem]]\n\
                 id = \"two\"\nfile = \"two.asc\"\n[[fit]]\nid = \"depth\"\ndem = \"one\"\nminus = \"two\"\nbootstrap = 0\n";
    write(path, "study.toml", study);
    let call = sastrugi_in(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    let said = format!("{}{}", call.stdout, call.stderr);
    assert!(
        call.code == 3 && said.contains("white") && said.contains("two.asc was shifted -0.03"),
        "{} {said}",
        call.code
    );

    let own = "needs its own name";
    for (more, words) in [
        (&["--difference", "one.asc"][..], own),
        (&["--difference", "./two.asc"], own),
        (&["--difference", "d.tif", "--map", "d.tif"], own),
        (&["--difference", "d.xyz"], "unknown extension"),
    ] {
        let call = sastrugi_in(path, &[&fit[..], more].concat());
        assert!(call.code == 2 && call.stderr.contains(words), "{more:?}: {} {}", call.code, call.stderr);
    }
    let call = sastrugi_in(path, &["fit", "one.asc", "--difference", "d.tif", "-o", "fit.json"]);
    assert!(call.code == 2 && call.stderr.contains("--minus"), "{} {}", call.code, call.stderr);
}

/// Without slopes in two directions the DEMs are subtracted where they lie, and the fit file warns of it.
#[test]
fn val_flat_ground_is_subtracted_as_it_lies() {
    let folder = area();
    let path = folder.path();
    write(path, "snow.json", FIT);
    let flat = format!(
        "ncols 300\nnrows 300\nxllcorner 0\nyllcorner 0\ncellsize 0.1\n{}",
        "2 ".repeat(300).trim_end().to_owned() + "\n"
    );
    let line = "2 ".repeat(300);
    write(path, "flat.asc", &(flat + &format!("{}\n", line.trim_end()).repeat(299)));
    let call = ["texture", "snow.json", "--size", "30x30", "--cell", "0.1", "--phase", "gaussian", "--seed", "3"];
    done(path, &[&call[..], &["-o", "snow.tif"]].concat());
    // The slopes are A's: of the flat one there are none.
    done(path, &["fit", "flat.asc", "--minus", "snow.tif", "--bootstrap", "0", "-o", "depth.json"]);
    let fit: Value = serde_json::from_slice(&std::fs::read(path.join("depth.json")).unwrap()).unwrap();
    assert_eq!(fit["source"]["minus"]["coregistration"]["shift_m"], Value::Null);
    assert!(fit["warnings"][0].as_str().unwrap().starts_with("no horizontal shift"), "{}", fit["warnings"]);
    assert!((number(&fit["parameters"]["sigma_m"]) - 0.1).abs() < 0.01, "{}", fit["parameters"]);
}
