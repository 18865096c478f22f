//! `fit A --minus B`: the DEMs are laid onto each other, and the fit is that of what lies between.

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
    write(path, "moved.asc", &moved(&text, [0.07, -0.04], 3.0));
    done(path, &["fit", "snow.tif", "--minus", "moved.asc", "--bootstrap", "0", "-o", "depth.json"]);
    let fit: Value = serde_json::from_slice(&std::fs::read(path.join("depth.json")).unwrap()).unwrap();
    let minus = &fit["source"]["minus"];
    assert_eq!(minus["file"], "moved.asc");
    let c = &minus["coregistration"];
    let number = |v: &Value| v.as_f64().unwrap();
    let shift = [number(&c["shift_m"][0]), number(&c["shift_m"][1])];
    assert!((shift[0] + 0.07).abs() < 0.005 && (shift[1] - 0.04).abs() < 0.005, "{c}");
    assert!((number(&c["raise_m"]) + 3.0).abs() < 0.05 && c["converged"] == true, "{c}");
    assert!(number(&c["nmad_after_m"]) < number(&c["nmad_before_m"]), "{c}");
    let sigma = number(&fit["parameters"]["sigma_m"]);
    assert!((sigma - 0.1).abs() < 0.005, "{fit}");
}

/// An ESRI ASCII grid whose header lies elsewhere, and whose heights are higher.
fn moved(text: &str, by: [f64; 2], up: f64) -> String {
    let line = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[0].to_ascii_lowercase().as_str() {
            "xllcorner" => format!("xllcorner {}", words[1].parse::<f64>().unwrap() + by[0]),
            "yllcorner" => format!("yllcorner {}", words[1].parse::<f64>().unwrap() + by[1]),
            first if first.starts_with(char::is_alphabetic) => line.to_owned(),
            _ => {
                let higher = |w: &&str| (w.parse::<f64>().unwrap() + up).to_string();
                words.iter().map(higher).collect::<Vec<_>>().join(" ")
            }
        }
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n") + "\n"
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
    write(path, "far.asc", &moved(&text, [500.0, 0.0], 0.0));
    let jacksboro = sastrugi_fixtures::jacksboro();
    for (other, words) in [("far.asc", "do not overlap"), (jacksboro.to_str().unwrap(), "in degrees")] {
        let call = sastrugi_in(path, &["fit", "snow.tif", "--minus", other, "-o", "no.json"]);
        assert!(call.code == 65 && call.stderr.contains(words), "{}: {}", call.code, call.stderr);
        assert!(!path.join("no.json").exists());
    }
}

/// A measured site with snow on it, and the site in a file that says it lies elsewhere: shifts of part and of several cells come back to
/// 0.05 cells (0.001 measured without snow).
#[test]
#[ignore = "slow: ./test --full"]
fn val_a_measured_site_is_moved_back() {
    let Some(site) = sastrugi_fixtures::measured("akl_lidar.tif") else {
        eprintln!("SKIPPED: ../shared/data/akl_lidar.tif is absent");
        return;
    };
    let folder = area();
    let path = folder.path();
    write(path, "snow.json", r#"{"model": "exponential", "parameters": {"sigma_m": 0.1, "range_m": 4.0}}"#);
    let site = site.to_str().unwrap();
    let call = ["texture", "snow.json", "--size", "600x860", "--cell", "1", "--phase", "gaussian", "--onto", site];
    done(path, &[&call[..], &["-o", "snow.tif"]].concat());
    done(path, &["convert", site, "site.asc"]);
    let text = std::fs::read_to_string(path.join("site.asc")).unwrap();
    for by in [[0.3, -0.45], [1.7, 2.2]] {
        write(path, "moved.asc", &moved(&text, by, 0.0));
        done(
            path,
            &["fit", "snow.tif", "--minus", "moved.asc", "--outer-scale", "25", "--bootstrap", "0", "-o", "d.json"],
        );
        let fit: Value = serde_json::from_slice(&std::fs::read(path.join("d.json")).unwrap()).unwrap();
        let shift = &fit["source"]["minus"]["coregistration"]["shift_m"];
        let error = [0, 1].map(|k| shift[k].as_f64().unwrap() + by[k]);
        assert!(error.iter().all(|e| e.abs() < 0.05), "{by:?}: {shift}");
    }
}
