//! `coregister A B`: finds the shift, raise and tilt that were applied, and says what they gain.

use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::Value;
use std::path::Path;

pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// The result as JSON.
fn coregistered(folder: &Path, arguments: &[&str]) -> Value {
    let call = sastrugi_in(folder, &[&["coregister"], arguments, &["--json"]].concat());
    assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
    serde_json::from_str(&call.stdout).unwrap()
}

/// An ESRI ASCII grid whose header lies elsewhere, and whose heights are raised by `up` at the south-west corner and tilted eastwards and
/// northwards.
pub fn moved(text: &str, by: [f64; 2], up: f64, tilt: [f64; 2]) -> String {
    let [cell, rows] = ["cellsize", "nrows"].map(|key| header(text, key).unwrap());
    let raised = |row: usize, col: usize, z: f64| {
        z + up + cell * (tilt[0] * (col as f64 + 0.5) + tilt[1] * (rows - row as f64 - 0.5))
    };
    mapped(text, by, raised)
}

/// White noise on every height, roughly normal, of standard deviation `sigma`.
pub fn noisy(text: &str, sigma: f64, seed: u64) -> String {
    let mut state = seed;
    let mut uniform = || {
        // Knuth's MMIX generator; twelve uniform values have variance 1.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    mapped(text, [0.0; 2], |_, _, z| z + sigma * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0))
}

fn header(text: &str, key: &str) -> Option<f64> {
    let words = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    words.filter(|w| w[0].eq_ignore_ascii_case(key)).map(|w| w[1].parse().unwrap()).next()
}

/// With another corner, and heights by row from the north, column and height; no data stays as it is.
fn mapped(text: &str, by: [f64; 2], mut height: impl FnMut(usize, usize, f64) -> f64) -> String {
    let nodata = header(text, "nodata_value");
    let mut row = 0;
    let line = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[0].to_ascii_lowercase().as_str() {
            "xllcorner" => format!("xllcorner {}", words[1].parse::<f64>().unwrap() + by[0]),
            "yllcorner" => format!("yllcorner {}", words[1].parse::<f64>().unwrap() + by[1]),
            first if first.starts_with(char::is_alphabetic) => line.to_owned(),
            _ => {
                let each = |(col, word): (usize, &&str)| {
                    let z = word.parse().unwrap();
                    if Some(z) == nodata { z } else { height(row, col, z) }.to_string()
                };
                let heights: Vec<String> = words.iter().enumerate().map(each).collect();
                row += 1;
                heights.join(" ")
            }
        }
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n") + "\n"
}

/// A generated ground as text.
fn ground(folder: &Path, size: &str) -> String {
    let set = format!("size_px=[{size},{size}]");
    let call = ["terrain", "multifractal", "--set", &set, "--set", "cell_m=0.1", "-o", "ground.asc"];
    let call = sastrugi_in(folder, &call);
    assert_eq!(call.code, 0, "{}", call.stderr);
    std::fs::read_to_string(folder.join("ground.asc")).unwrap()
}

/// The ground in files that say that it lies part of a cell elsewhere, 2 m higher and tilted by 1 %, with noise of 1 cm on both: the shift is
/// undone to 0.05 cells and within 5 standard errors, the tilt to 1e-4.
#[test]
fn val_sub_cell_shifts_with_one_percent_of_tilt() {
    let folder = area();
    let path = folder.path();
    let text = ground(path, "200");
    write(path, "a.asc", &noisy(&text, 0.01, 1));
    let cases = [(0.1, [1.0, 0.0]), (0.25, [-0.6, 0.8]), (0.5, [0.0, -1.0]), (0.5, [0.8, 0.6]), (0.9, [-0.8, -0.6])];
    for (k, (cells, direction)) in (2..).zip(cases) {
        let by = direction.map(|d| 0.1 * cells * d);
        write(path, "b.asc", &noisy(&moved(&text, by, 2.0, [0.01, -0.01]), 0.01, k));
        let result = coregistered(path, &["a.asc", "b.asc", "-o", "difference.tif"]);
        let c = &result["coregistration"];
        for axis in 0..2 {
            let error = (number(&c["shift_m"][axis]) + by[axis]) / 0.1;
            let standard = number(&c["standard_errors"]["shift_m"][axis]) / 0.1;
            assert!(error.abs() < 0.05 && error.abs() < 5.0 * standard && standard < 0.05, "{by:?}: {error} {c}");
            assert!((number(&c["tilt"][axis]) - [-0.01, 0.01][axis]).abs() < 1e-4, "{c}");
            println!("{cells} cells along {direction:?}: off by {error:.4} +- {standard:.4} cells");
        }
        assert!(c["converged"] == true && number(&c["shift_p"]) < 1e-6, "{result}");
        // Where B lies a tenth of a cell beside A, reading it there averages its noise: NMAD rises at the right shift.
        assert!(c["gained"] == true, "{result}");
        assert_eq!(result["difference"]["file"], "difference.tif");
        assert_eq!(result["difference"]["rows"], 200);
    }
}

/// DEMs that differ by white noise alone: done, and it is said that nothing was gained.
#[test]
fn val_noise_alone_gains_nothing() {
    let folder = area();
    let path = folder.path();
    let text = ground(path, "150");
    write(path, "a.asc", &noisy(&text, 0.02, 1));
    write(path, "b.asc", &noisy(&text, 0.02, 2));
    let c = &coregistered(path, &["a.asc", "b.asc"])["coregistration"];
    assert!(c["gained"] == false && c["converged"] == true && number(&c["shift_p"]) > 0.05, "{c}");
    // Noise of both: 2 cm times the root of 2.
    assert!((number(&c["nmad_after_m"]) - 0.0283).abs() < 0.001, "{c}");
    let call = sastrugi_in(path, &["coregister", "a.asc", "b.asc"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert!(call.stdout.contains("co-registration gained nothing: horizontally, B lies on A"), "{}", call.stdout);
    assert!(
        ["standard error", "moved north", "tilted up eastwards", "median", "shifted as well"]
            .iter()
            .all(|w| call.stdout.contains(w))
    );
}

/// Flat ground: raise and tilt without a shift, and said so.
#[test]
fn val_flat_ground_has_no_shift() {
    let folder = area();
    let path = folder.path();
    let text = mapped(&ground(path, "40"), [0.0; 2], |_, _, _| 5.0);
    write(path, "a.asc", &text);
    write(path, "b.asc", &noisy(&moved(&text, [0.0; 2], 1.0, [0.0; 2]), 0.01, 1));
    let result = coregistered(path, &["a.asc", "b.asc"]);
    let c = &result["coregistration"];
    assert!(c["shift_m"].is_null() && c["gained"].is_null() && (number(&c["raise_m"]) + 1.0).abs() < 0.002, "{c}");
    assert!(result["verdict"].as_str().unwrap().starts_with("no horizontal shift"), "{result}");
    let call = sastrugi_in(path, &["coregister", "a.asc", "b.asc"]);
    assert!(call.code == 0 && !call.stdout.contains("shifted as well"), "{}", call.stdout);
}

/// B is fitted to stable terrain; the difference covers the rest as well, where snow lies.
#[test]
fn val_a_mask_is_stable_terrain() {
    let folder = area();
    let path = folder.path();
    let text = ground(path, "150");
    let snow = |_: usize, col: usize, z: f64| if col < 75 { z + 0.4 } else { z };
    write(path, "a.asc", &mapped(&text, [0.0; 2], snow));
    write(path, "b.asc", &moved(&text, [0.04, 0.02], -1.0, [0.0; 2]));
    let road = r#"{"type": "Polygon", "coordinates": [[[8, 0], [15, 0], [15, 15], [8, 15], [8, 0]]]}"#;
    write(path, "road.geojson", road);
    let result = coregistered(path, &["a.asc", "b.asc", "--mask", "road.geojson", "-o", "depth.asc"]);
    assert!((number(&result["coregistration"]["raise_m"]) - 1.0).abs() < 0.005, "{result}");
    assert!(number(&result["difference"]["valid"]) > 150.0 * 140.0, "{result}");
    let depth = std::fs::read_to_string(path.join("depth.asc")).unwrap();
    let mut snowy: Vec<f64> = Vec::new();
    mapped(&depth, [0.0; 2], |_, col, z| {
        if (5..70).contains(&col) && z > -100.0 {
            snowy.push(z);
        }
        z
    });
    snowy.sort_by(f64::total_cmp);
    assert!((snowy[snowy.len() / 2] - 0.4).abs() < 0.005, "{}", snowy[snowy.len() / 2]);
}

/// What cannot be co-registered is refused with the reason and its exit code, and no input is overwritten.
#[test]
fn val_bad_calls() {
    let folder = area();
    let path = folder.path();
    let text = ground(path, "40");
    write(path, "far.asc", &moved(&text, [500.0, 0.0], 0.0, [0.0; 2]));
    let jacksboro = sastrugi_fixtures::jacksboro();
    let jacksboro = jacksboro.to_str().unwrap();
    for (arguments, code, words) in [
        (&["ground.asc", "far.asc"][..], 65, "do not overlap"),
        (&["ground.asc", jacksboro], 65, "in degrees"),
        (&["ground.asc", "gone.asc"], 65, "no such file"),
        (&["ground.asc", "far.asc", "-o", "./ground.asc"], 2, "needs its own name"),
        (&["ground.asc", "far.asc", "-o", "far.asc"], 2, "needs its own name"),
        (&["ground.asc", "far.asc", "-o", "d.xyz"], 2, "unknown extension"),
        (&["ground.asc"], 2, "<B>"),
    ] {
        let call = sastrugi_in(path, &[&["coregister"], arguments].concat());
        assert!(call.code == code && call.stderr.contains(words), "{arguments:?}: {} {}", call.code, call.stderr);
    }
    assert_eq!(std::fs::read_to_string(path.join("ground.asc")).unwrap(), text);
}

/// The shipped measured sites in files that say that they lie part of a cell elsewhere, 10 m higher and tilted by 1 %: back to 0.05 cells. The raise
/// is that at the centre of the site, which the tilt has lifted by 1 % of half its width.
#[test]
fn val_measured_sites_with_one_percent_of_tilt() {
    for (name, cell, width_m) in [("pozo_blanca.tif", 1.0, 271.0), ("otira.tif", 0.02, 8.46)] {
        let site = sastrugi_fixtures::workspace_root().join("fixtures/dem").join(name);
        let folder = area();
        let path = folder.path();
        let call = sastrugi_in(path, &["convert", site.to_str().unwrap(), "site.asc"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        let text = std::fs::read_to_string(path.join("site.asc")).unwrap();
        for direction in [[0.5, -0.25], [-0.1, 0.5]] {
            let by = direction.map(|d| d * cell);
            write(path, "b.asc", &moved(&text, by, 10.0, [0.01, 0.0]));
            let c = &coregistered(path, &["site.asc", "b.asc"])["coregistration"];
            let error = [0, 1].map(|k| (number(&c["shift_m"][k]) + by[k]) / cell);
            println!("{name}: off by {error:.4?} cells, {}", c["standard_errors"]);
            assert!(error.iter().all(|e| e.abs() < 0.05), "{name} {by:?}: {c}");
            assert!(c["converged"] == true && c["gained"] == true, "{name} {by:?}: {c}");
            assert!((number(&c["tilt"][0]) + 0.01).abs() < 5e-4 && number(&c["tilt"][1]).abs() < 5e-4, "{name}: {c}");
            let raise = number(&c["raise_m"]) + 10.0 + 0.01 * 0.5 * width_m;
            assert!(raise.abs() < 0.05 * cell, "{name} {by:?}: {raise} {c}");
        }
    }
}
