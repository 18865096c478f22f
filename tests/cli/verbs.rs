//! Every verb on files, as a user calls it.

use sastrugi_tests::{area, sastrugi_in, small_study, sums, write};
use serde_json::Value;
use std::path::Path;

fn ok(folder: &Path, arguments: &[&str]) -> String {
    let call = sastrugi_in(folder, arguments);
    assert_eq!(call.code, 0, "{arguments:?}: {}{}", call.stdout, call.stderr);
    call.stdout
}

fn ok_json(folder: &Path, arguments: &[&str]) -> Value {
    let mut all = arguments.to_vec();
    all.extend(["--json", "--quiet"]);
    serde_json::from_str(&ok(folder, &all)).unwrap()
}

/// A release of another study is replaced only on request.
#[test]
fn val_a_release_of_another_study_is_kept() {
    let folder = area();
    write(folder.path(), "one.toml", &small_study());
    write(folder.path(), "other.toml", &small_study().replacen("name = \"", "name = \"other-", 1));
    let run = |arguments: &[&str]| sastrugi_in(folder.path(), &[arguments, &["-o", "release", "--quiet"]].concat());
    assert_eq!(run(&["run", "one.toml"]).code, 0);
    let before = sums(&folder.path().join("release"));
    let refused = run(&["run", "other.toml"]);
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    assert!(refused.stderr.contains("release is a release of the study `"), "{}", refused.stderr);
    assert_eq!(sums(&folder.path().join("release")), before);
    assert_eq!(run(&["run", "one.toml"]).code, 0);
    assert_eq!(run(&["run", "other.toml", "--replace"]).code, 0);
    assert_ne!(sums(&folder.path().join("release")), before);
}

#[test]
fn val_kinds_and_schemas_are_complete() {
    let folder = area();
    let kinds = ok_json(folder.path(), &["kinds"]);
    let names: Vec<&str> = kinds.as_array().unwrap().iter().filter_map(|k| k["kind"].as_str()).collect();
    for kind in ["multifractal", "weierstrass_mandelbrot", "fft_ma", "exponential", "husky_a200", "straight"] {
        assert!(names.contains(&kind), "{kind} is not in {names:?}");
    }
    let mut count = 0;
    for kind in kinds.as_array().unwrap() {
        let text = |key: &str| kind[key].as_str().unwrap_or_default().len();
        assert!(text("summary") > 10 && text("source") > 3, "{kind}");
        for (name, parameter) in kind["parameters"]["properties"].as_object().into_iter().flatten() {
            let described = parameter.get("description").is_some() || parameter.get("$ref").is_some();
            assert!(described, "{}: {name} has no description", kind["kind"]);
            count += 1;
        }
    }
    assert!(count > 100, "{count} parameters");
    let schema = ok_json(folder.path(), &["schema"]);
    for section in ["study", "roughness", "dem", "terrain", "fit", "texture", "missions", "traverse"] {
        assert!(schema["properties"].get(section).is_some(), "{section}");
    }
    let table = ok_json(folder.path(), &["schema", "missions"]);
    let column = table["columns"].as_array().unwrap().iter().find(|c| c["name"] == "rms_vertical_acceleration_m_s2");
    assert_eq!(column.unwrap()["unit"], "m/s2");
    let completions = ok(folder.path(), &["completions", "bash"]);
    for word in ["complete -F", "photoclinometry", "--outer-scale", "--set-missions"] {
        assert!(completions.contains(word), "{word} is not completed");
    }
    let notices = std::fs::read_to_string(sastrugi_fixtures::workspace_root().join("THIRD-PARTY.md")).unwrap();
    assert_eq!(ok(folder.path(), &["licences"]).trim_end(), notices.trim_end());
    assert_eq!(ok_json(folder.path(), &["licences"])["notices"], notices);
}

/// A verb with `--seed` gives the bytes of a study's item with that explicit seed.
#[test]
fn gold_a_verb_equals_an_item_with_the_same_seed() {
    let folder = area();
    let path = folder.path();
    let study = small_study()
        .replace("kind = \"weierstrass_mandelbrot\"\n", "kind = \"weierstrass_mandelbrot\"\nseed = 99\n")
        .replace("id = \"tile\"\n", "id = \"tile\"\nseed = 5\n");
    write(path, "study.toml", &study);
    ok(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    ok(path, &["terrain", "weierstrass_mandelbrot", "--seed", "99", "--set", "size_px=[280,300]", "-o", "verb.tif"]);
    assert_eq!(
        std::fs::read(path.join("verb.tif")).unwrap(),
        std::fs::read(path.join("release/terrain/smooth.tif")).unwrap()
    );
    write(path, "spec.toml", "kind = \"weierstrass_mandelbrot\"\nseed = 99\nsize_px = [280, 300]\n");
    ok(path, &["terrain", "spec.toml", "-o", "spec.tif"]);
    assert_eq!(std::fs::read(path.join("verb.tif")).unwrap(), std::fs::read(path.join("spec.tif")).unwrap());
    let arguments = [
        "texture",
        "release/fit/naive.json",
        "--size",
        "4500x4500",
        "--cell",
        "90",
        "--seed",
        "5",
        "--phase",
        "gaussian",
        "--set",
        "periodic=false",
        "-o",
        "tile.tif",
    ];
    ok(path, &arguments);
    assert_eq!(
        std::fs::read(path.join("tile.tif")).unwrap(),
        std::fs::read(path.join("release/texture/tile.tif")).unwrap()
    );
}

#[test]
fn val_fit_texture_roughness_and_info_work_on_files() {
    let folder = area();
    let path = folder.path();
    let dem = sastrugi_fixtures::jacksboro();
    let dem = dem.to_str().unwrap();
    let fit = ok_json(path, &["fit", dem, "--outer-scale", "5000", "--mode", "paper", "-o", "fit.json"]);
    let sigma = fit["parameters"]["sigma_m"].as_f64().unwrap();
    // The residual of a plain moving average of 67 x 53 cells has 88 m, 68 m without its extreme tenth.
    assert!((55.0..110.0).contains(&sigma), "{sigma}");
    assert_eq!(ok_json(path, &["info", "fit.json"])["what"], "covariance fit");
    let made = ok_json(path, &["texture", "fit.json", "--size", "9000x9000", "--cell", "90", "-o", "t.tif"]);
    assert_eq!(made["grid"]["rows"], 100);
    let info = ok_json(path, &["info", "t.tif"]);
    assert_eq!((info["format"].as_str(), info["cols"].as_u64()), (Some("geotiff"), Some(100)));
    let roughness = ok_json(path, &["roughness", dem]);
    assert!(roughness["heights"]["relief_m"].as_f64().unwrap() == 840.0);
    ok(path, &["terrain", "multifractal", "--set", "size_px=[128,128]", "-o", "base.tif"]);
    write(path, "own.json", "{\"model\": \"exponential\", \"parameters\": {\"sigma_m\": 0.01, \"range_m\": 0.2}}");
    ok(path, &["texture", "own.json", "--size", "6.4x6.4", "--cell", "0.05", "--onto", "base.tif", "-o", "sum.tif"]);
    assert_eq!(ok_json(path, &["info", "sum.tif"])["rows"], 128);
}

/// A study with a snow-like site, its fit, and textures of it.
fn textured(textures: &str) -> String {
    format!(
        "[study]\nname = \"textured\"\nseed = 1\ndate = \"2026-01-01\"\n[[dem]]\nid = \"site\"\nfile = \"site.tif\"\n[[fit]]\nid = \"f\"\n\
         dem = \"site\"\nouter_scale_m = 1.5\nbootstrap = 0\n{textures}"
    )
}

const SNOW: &str = r#"{"model": "exponential", "parameters": {"sigma_m": 0.02, "range_m": 0.3}}"#;

fn site(path: &Path) {
    write(path, "truth.json", SNOW);
    let call = ["texture", "truth.json", "--size", "12x12", "--cell", "0.1", "--phase", "gaussian", "-o", "site.tif"];
    ok(path, &call);
}

fn heights(path: &Path, name: &str) -> Vec<f64> {
    ok(path, &["convert", name, "heights.asc"]);
    let text = std::fs::read_to_string(path.join("heights.asc")).unwrap();
    let rows = text.lines().filter(|line| line.split_whitespace().count() > 2);
    rows.flat_map(|line| line.split_whitespace().map(|z| z.parse().unwrap()).collect::<Vec<f64>>()).collect()
}

/// In a study a texture on the background of a fit is that background plus what it lacks; the release is recomputed to the same bytes.
#[test]
fn val_a_texture_is_added_to_the_background_of_a_fit() {
    let folder = area();
    let path = folder.path();
    site(path);
    let texture = |id: &str, more: &str| {
        format!("[[texture]]\nid = \"{id}\"\nfit = \"f\"\nseed = 5\nsize_m = [12.0, 12.0]\ncell_m = 0.1\n{more}\n")
    };
    let on = texture("on", "onto = { background = \"f\" }");
    let alone = texture("alone", "covariance = \"residual\"");
    let over = texture("over", "onto = \"site\"");
    write(path, "study.toml", &textured(&format!("{on}{alone}{over}")));
    ok(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    let of = |name: &str| heights(path, &format!("release/{name}.tif"));
    let (sum, background, residual) = (of("texture/on"), of("fit/f.background"), of("texture/alone"));
    assert_eq!(sum.len(), 120 * 120);
    for ((sum, background), residual) in sum.iter().zip(&background).zip(&residual) {
        assert!((sum - background - residual).abs() < 1e-6, "{sum} {background} {residual}");
    }
    // The DEM that was fitted still has its texture, and only there a note says so.
    let manifest: Value = serde_json::from_slice(&std::fs::read(path.join("release/manifest.json")).unwrap()).unwrap();
    let own = |n: &&Value| n["note"].as_str().is_some_and(|n| n.contains("still has its own texture"));
    let noted: Vec<&Value> = manifest["notes"].as_array().unwrap().iter().filter(own).collect();
    assert!(noted.len() == 1 && noted[0]["item"] == "over", "{noted:?}");
    ok(path, &["verify", "release", "--recompute", "all", "--quiet"]);

    for (onto, words) in
        [("{ background = \"g\" }", "`onto.background` names \"g\""), ("{ fit = \"f\" }", "`onto` must be the id")]
    {
        write(path, "study.toml", &textured(&texture("on", &format!("onto = {onto}"))));
        let call = sastrugi_in(path, &["run", "study.toml", "-o", "other", "--quiet"]);
        assert!(call.code == 2 && call.stderr.contains(words), "{} {}", call.code, call.stderr);
    }
}

/// The verb says when it takes `residual` by itself, when the base is the DEM that was fitted, and that `--fill` takes the model.
#[test]
fn val_notes_of_a_texture_on_a_base() {
    let folder = area();
    let path = folder.path();
    site(path);
    let fit = ["fit", "site.tif", "--outer-scale", "1.5", "--bootstrap", "0", "--model", "empirical"];
    ok(path, &[&fit[..], &["--background", "background.tif", "-o", "f.json"]].concat());
    let notes = |more: &[&str]| {
        let call = ["texture", "f.json", "-o", "t.tif"];
        ok_json(path, &[&call[..], more].concat())["notes"].to_string()
    };
    let size = ["--size", "12x12", "--cell", "0.1"];
    let chosen = "covariance = residual: the base is assumed to be a measured background";
    let own = "still has its own texture";
    let onto = |base: &str, more: &[&str]| notes(&[&size[..], &["--onto", base], more].concat());
    let said = onto("background.tif", &[]);
    assert!(said.contains(chosen) && !said.contains(own), "{said}");
    let said = onto("site.tif", &["--covariance", "residual"]);
    assert!(!said.contains(chosen) && said.contains(own) && said.contains("fit --background"), "{said}");
    assert!(!notes(&size).contains(chosen));
    let said = notes(&["--fill", "site.tif"]);
    assert!(said.contains("the fit is empirical; holes are filled with the fitted model (exponential)"), "{said}");
}

/// On ground without a scale, a texture of the surface is the model's at most wavelengths: a warning before the result says so.
#[test]
fn val_an_extrapolated_texture_is_warned_of() {
    let folder = area();
    let path = folder.path();
    let size = ["--set", "size_px=[160, 140]", "--set", "cell_m=0.05"];
    ok(path, &[&["terrain", "multifractal", "--seed", "3", "-o", "site.tif"], &size[..]].concat());
    ok(
        path,
        &["fit", "site.tif", "--outer-scale", "0.5", "--bootstrap", "0", "--model", "empirical", "-o", "fit.json"],
    );
    let texture = ["texture", "fit.json", "--size", "8x6", "--cell", "0.05", "-o", "t.tif"];
    let call = sastrugi_in(path, &texture);
    let warning = "sastrugi: warning: most of the variance comes from the model";
    assert!(call.code == 0 && call.stderr.starts_with(warning), "{} {}", call.code, call.stderr);
    assert!(!call.stdout.contains("most of the variance"), "{}", call.stdout);
    let quiet = sastrugi_in(path, &[&texture[..], &["--quiet"]].concat());
    assert!(quiet.code == 0 && quiet.stderr.starts_with(warning), "{} {}", quiet.code, quiet.stderr);
    let residual = sastrugi_in(path, &[&texture[..], &["--covariance", "residual"]].concat());
    assert!(residual.code == 0 && !residual.stderr.contains("warning"), "{} {}", residual.code, residual.stderr);
}

/// A surface that was scaled to 3 cm in a vehicle's band has that RMS there, by lengths, by name and by band; the map as text
/// has a prediction beside each measured value.
#[test]
fn val_roughness_for_a_vehicle() {
    let folder = area();
    let path = folder.path();
    let set = |pair: &'static str| ["--set", pair];
    let scaled = set("roughness={wheelbase_m = 2.7, tyre_radius_m = 0.4, rms_m = 0.03}");
    let mut terrain = vec!["terrain", "van_deusen", "--seed", "7", "-o", "dem.tif"];
    terrain.extend(scaled);
    let made = ok_json(path, &terrain);
    assert_eq!(made["maps"]["rms-predicted"]["file"], "dem.rms-predicted.tif");
    let ride = |more: &[&str]| {
        let mut call = vec!["roughness", "dem.tif"];
        call.extend(more);
        ok_json(path, &call)["ride"].clone()
    };
    let number = |value: &Value| value.as_f64().unwrap();
    for vehicle in [["--vehicle", "wb=2.7,r=0.4"], ["--vehicle", "ugv_4x4"], ["--band", "0.4:5.4"]] {
        let ride = ride(&vehicle);
        assert!((number(&ride["rms_m"]) / 0.03 - 1.0).abs() < 1e-4, "{ride}");
        assert_eq!((&ride["band_m"], &ride["detrender"]), (&serde_json::json!([0.4, 5.4]), &"band".into()));
        assert!(
            (number(&ride["power_law"]["n"]) - 2.0).abs() < 0.3 && number(&ride["power_law"]["r2"]) > 0.9,
            "{ride}"
        );
        assert!(number(&ride["iri"]["along_x_m_km"]) > 1.0 && ride["iso_8608_class"].is_string(), "{ride}");
    }
    for detrender in ["ma", "exp"] {
        assert!(number(&ride(&["--band", "0.4:5.4", "--detrend", detrender])["rms_m"]) > 0.035, "{detrender}");
    }
    let map = ["--rms-map", "rms.txt", "--rms-predicted", "dem.rms-predicted.tif"];
    ride(&[&["--vehicle", "ugv_4x4"][..], &map].concat());
    let text = std::fs::read_to_string(path.join("rms.txt")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "# x_m y_m rms_pred_m rms_meas_m; RMS in wavelengths of 0.4 to 5.4 m, detrender band, windows of 16.200 m"
    );
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(' ').map(|w| w.parse().unwrap()).collect()).collect();
    assert!(rows.len() > 200 && rows.iter().all(|r| r.len() == 4 && r[2] > 0.0 && r[3] > 0.0), "{}", rows.len());
    ride(&["--vehicle", "ugv_4x4", "--rms-map", "measured.txt"]);
    let text = std::fs::read_to_string(path.join("measured.txt")).unwrap();
    assert!(text.starts_with("# x_m y_m rms_meas_m;") && text.lines().nth(1).unwrap().split(' ').count() == 3);
    assert!(ok(path, &["roughness", "dem.tif", "--vehicle", "ugv_4x4"]).contains("IRI"));
    assert!(ok_json(path, &["roughness", "dem.tif"]).get("ride").is_none());
}

/// Ridges from north to south, 1 cm high and 1 m apart, on a slope: roughness only for wind across them, in JSON and in text.
#[test]
fn val_roughness_by_wind_direction() {
    let folder = area();
    let path = folder.path();
    let height = |row: usize, col: usize| 0.01 * f64::from(col % 20 < 10) + 0.02 * row as f64 + 0.01 * col as f64;
    let rows: Vec<String> =
        (0..100).map(|r| (0..100).map(|c| format!("{:.6}", height(r, c))).collect::<Vec<_>>().join(" ")).collect();
    let head = "ncols 100\nnrows 100\nxllcorner 0\nyllcorner 0\ncellsize 0.05\n";
    write(path, "ridges.asc", &format!("{head}{}\n", rows.join("\n")));
    let wind = |more: &[&str]| ok_json(path, &[&["roughness", "ridges.asc"], more].concat())["aerodynamic"].clone();
    let number = |value: &Value| value.as_f64().unwrap();
    let explicit = wind(&["--wind-from", "0,90"]);
    let [along, across] = [0, 1].map(|k| explicit["directions"][k].clone());
    assert!(number(&along["z0_lettau_m"]) < 0.1 * number(&across["z0_lettau_m"]), "{explicit}");
    // Five ridges of 1 cm in 4.95 m; the least-squares plane leans on the outermost ridge.
    assert!((number(&across["frontal_area_index"]) / 0.01 - 1.0).abs() < 0.15, "{explicit}");
    assert!(number(&across["standard_errors"]["z0_munro_m"]) > 0.0, "{explicit}");
    assert!(explicit["notes"][0].as_str().unwrap().contains("least-squares plane"), "{explicit}");
    assert_eq!(wind(&["--wind"])["directions"].as_array().unwrap().len(), 16);
    assert_eq!(wind(&["--wind=36"])["directions"].as_array().unwrap().len(), 36);
    let scaled = wind(&["--wind=8", "--outer-scale", "1.5", "--obstacle-height", "mean-above"]);
    assert_eq!((&scaled["obstacle_height"], scaled["blocks"].as_u64()), (&"mean_above".into(), Some(16)));
    assert!((number(&scaled["outer_scale_m"][0]) - 1.45).abs() < 0.11, "{scaled}");
    let text = ok(path, &["roughness", "ridges.asc", "--wind=8"]);
    for word in ["z0 Macdonald mm", "\n315.0000", "\nmean", "note: z0 holds for cells of 0.0500"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(ok_json(path, &["roughness", "ridges.asc"]).get("aerodynamic").is_none());
}

/// A patch of a world with its maps; a measured DEM refined from the file; lists of tables in `kinds`.
#[test]
fn val_worlds_are_cut_out_and_dems_refined() {
    let folder = area();
    let path = folder.path();
    let made = ok_json(path, &["terrain", "planetary", "--set", "size_px=[64,48]", "-o", "p.tif"]);
    for map in ["class", "rock-potential", "albedo"] {
        assert_eq!(made["maps"][map]["file"], format!("p.{map}.tif"));
        assert_eq!(ok_json(path, &["info", &format!("p.{map}.tif")])["cols"], 64);
    }
    // What the values are goes through a conversion.
    ok(path, &["convert", "p.class.tif", "c.tif", "--cog"]);
    ok(path, &["convert", "p.albedo.tif", "a.tif"]);
    let [class, albedo, heights] = ["c.tif", "a.tif", "p.tif"].map(|file| ok_json(path, &["info", file]));
    assert!(class["unit"].is_null() && class["values"].as_str().unwrap().contains("0 sand, 1 rock"), "{class}");
    assert!(albedo["unit"] == "1" && albedo["what"] == "raster", "{albedo}");
    assert!(albedo["value_max"].as_f64().unwrap() < 1.0, "{albedo}");
    assert!(heights["unit"] == "m" && heights["height_max_m"].is_number(), "{heights}");
    let dem = format!("dem=\"{}\"", sastrugi_fixtures::jacksboro().display());
    let window = ["--set", "size_px=[120,100]", "--set", "cell_m=0.5"];
    let refine = |origin: &str| {
        let own = ["terrain", "elaborate", "--set", &dem, "--set", origin, "-o", "fine.tif"];
        sastrugi_in(path, &[&own[..], &window].concat())
    };
    let call = refine("origin_m=[9000,9000]");
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert_eq!(ok_json(path, &["info", "fine.tif"])["rows"], 100);
    let call = refine("origin_m=[-9000,9000]");
    assert!(call.code == 65 && call.stderr.contains("do not lie between"), "{} {}", call.code, call.stderr);
    let kinds = ok(path, &["kinds", "planetary"]);
    assert!(kinds.contains("processes[texture].hurst") && kinds.contains("processes[rocks].coverage"), "{kinds}");
    let kinds = ok(path, &["kinds", "compose"]);
    for word in ["processes[].operation = \"mask\"", "processes[].region.from", "processes[].high_m"] {
        assert!(kinds.contains(word), "{word} {kinds}");
    }
    assert!(ok(path, &["kinds", "spheroids"]).contains("preset = \"plain\""));
}

#[test]
fn val_textures_are_tiled_shaped_and_fill_holes() {
    let folder = area();
    let path = folder.path();
    write(path, "own.json", "{\"model\": \"exponential\", \"parameters\": {\"sigma_m\": 0.01, \"range_m\": 0.2}}");
    let size = ["--size", "3x2", "--cell", "0.05"];
    let tiled = ok_json(path, &[&["texture", "own.json", "--tile", "2x3", "-o", "tiled.tif"], &size[..]].concat());
    assert_eq!((tiled["grid"]["rows"].as_u64(), tiled["grid"]["cols"].as_u64()), (Some(80), Some(180)));
    // Two tiles one above the other, three side by side.
    let all = heights(path, "tiled.tif");
    let tile = |row: usize, col: usize| all[180 * (row % 40) + col % 60];
    assert!((0..80 * 180).all(|k| all[k] == tile(k / 180, k % 180)) && all[0] != all[1]);
    for method in ["gaussians", "quasi_wavelets", "cholesky"] {
        let made = ok_json(path, &[&["texture", "own.json", "--method", method, "-o", "m.tif"], &size[..]].concat());
        assert_eq!([&made["grid"]["rows"], &made["grid"]["cols"]], [40, 60], "{method}");
        // Sigma is 0.01 m; some 24 independent patches leave it a standard error of 15 %.
        let all = heights(path, "m.tif");
        let rms = (all.iter().map(|z| z * z).sum::<f64>() / all.len() as f64).sqrt();
        assert!((0.004..0.02).contains(&rms), "{method}: {rms}");
    }
    // 24 values around a hole.
    let rows = ["1 1.01 1 1 1.02"; 2].join("\n");
    let head = "ncols 5\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 0.05\nnodata_value -9999";
    write(path, "holed.asc", &format!("{head}\n{rows}\n1 1.02 -9999 1 0.99\n{rows}\n"));
    let sized = sastrugi_in(path, &["texture", "own.json", "--fill", "holed.asc", "--size", "5x5", "-o", "sized.asc"]);
    assert!(sized.code == 2 && sized.stderr.contains("cannot be used with"), "{} {}", sized.code, sized.stderr);
    let filled = ok_json(path, &["texture", "own.json", "--fill", "holed.asc", "-o", "filled.asc"]);
    assert_eq!((filled["filled_cells"].as_u64(), filled["grid"]["valid"].as_u64()), (Some(1), Some(25)));
    ok(path, &["convert", "holed.asc", "holed.npy"]);
    let stated = ok_json(path, &["texture", "own.json", "--fill", "holed.npy", "--cell", "0.05", "-o", "stated.tif"]);
    assert_eq!(stated["filled_cells"], 1);
}

/// A site of 16 m x 16 m with cells of 10 cm, as `site.tif`, its fit with statistics, `fit.json`, and its background.
fn site_with_statistics(path: &Path) -> Value {
    write(path, "own.json", "{\"model\": \"exponential\", \"parameters\": {\"sigma_m\": 0.05, \"range_m\": 0.3}}");
    let size = ["--size", "16x16", "--cell", "0.1", "--phase", "gaussian", "--set", "periodic=false", "--seed", "3"];
    ok(path, &[&["texture", "own.json", "-o", "site.tif"], &size[..]].concat());
    let fit = ["fit", "site.tif", "--outer-scale", "2", "--bootstrap", "0"];
    ok(path, &[&fit[..], &["--statistics", "--background", "background.tif", "-o", "fit.json"]].concat());
    ok(path, &[&fit[..], &["-o", "plain.json"]].concat());
    serde_json::from_str(&std::fs::read_to_string(path.join("fit.json")).unwrap()).unwrap()
}

/// What each method that repeats a site needs beside the fit with statistics.
const REPEATING: [(&str, &[&str]); 4] = [
    ("modulated", &[]),
    ("wavelet_statistics", &[]),
    ("quilting", &["--exemplar", "site.tif"]),
    ("exemplar", &["--exemplar", "site.tif"]),
];

/// Textures from statistics, and from the DEM: cells of the site by default, its roughness, the same bytes on one and two threads; and on the
/// background of the fit. The residual of the site has some 500 independent pieces, so the spread of its RMS is a few percent; limit 30 %.
#[test]
fn val_textures_repeat_a_site() {
    let folder = area();
    let path = folder.path();
    let fit = site_with_statistics(path);
    let plain: Value = serde_json::from_str(&std::fs::read_to_string(path.join("plain.json")).unwrap()).unwrap();
    assert_eq!((fit["statistics"]["version"].as_u64(), fit["settings"]["statistics"].as_bool()), (Some(1), Some(true)));
    assert!(plain.get("statistics").is_none() && plain["settings"].get("statistics").is_none());
    assert_eq!((&plain["parameters"], &plain["height_quantiles_m"]), (&fit["parameters"], &fit["height_quantiles_m"]));
    let wanted_m = fit["diagnostics"]["band_rms_m"].as_f64().unwrap();
    for (method, needs) in REPEATING {
        let verb = ["texture", "fit.json", "--method", method, "--size", "12.8x9.6", "--seed", "5"];
        let more = |threads: &'static str, output: &'static str| {
            [&verb[..], needs, &["--set", "periodic=false", "--threads", threads, "-o", output]].concat()
        };
        let made = ok_json(path, &more("1", "one.tif"));
        assert_eq!([&made["grid"]["rows"], &made["grid"]["cols"]], [96, 128], "{method}");
        assert!(made["covariance_error_max_m2"].is_null() && made["parameters"].get("ratio").is_none(), "{made}");
        let notes = made["notes"].to_string();
        assert_eq!(notes.contains("licence and attribution"), !needs.is_empty(), "{notes}");
        assert_eq!(notes.contains("copied runs"), !needs.is_empty(), "{notes}");
        let all = heights(path, "one.tif");
        let rms = (all.iter().map(|z| z * z).sum::<f64>() / all.len() as f64).sqrt();
        assert!((rms / wanted_m - 1.0).abs() < 0.3, "{method}: {rms} {wanted_m}");
        ok(path, &more("2", "two.tif"));
        let bytes = |name: &str| std::fs::read(path.join(name)).unwrap();
        assert_eq!(bytes("one.tif"), bytes("two.tif"), "{method}");
    }
    let laid = ["texture", "fit.json", "--method", "quilting", "--exemplar", "site.tif", "--size", "8x8"];
    let made = ok_json(path, &[&laid[..], &["--onto", "background.tif", "-o", "laid.tif"]].concat());
    assert_eq!(made["parameters"]["covariance"], "residual");
    let notes = made["notes"].to_string();
    assert!(notes.contains("are amplified") && notes.contains("assumed to be a measured background"), "{notes}");
    let (base, sum) = (heights(path, "background.tif"), heights(path, "laid.tif"));
    assert!(base.len() == sum.len() && base.iter().zip(&sum).any(|(a, b)| a != b));
}

/// A hole is filled with the texture of every method that repeats the site: measured cells keep their heights, the others get theirs without a step
/// at the rim beyond those of the site, and the same seed gives the same bytes on any number of threads.
#[test]
fn val_holes_are_filled_with_textures_that_repeat_a_site() {
    let folder = area();
    let path = folder.path();
    site_with_statistics(path);
    write(path, "hole.geojson", "{\"type\": \"Polygon\", \"coordinates\": [[[6,6],[10,6],[10,9],[6,9],[6,6]]]}");
    ok(path, &["convert", "site.tif", "holed.tif", "--exclude", "hole.geojson"]);
    let whole = heights(path, "site.tif");
    let is_hole = |k: usize| (60..100).contains(&(k % 160)) && (70..100).contains(&(k / 160));
    // Steps along a row from column `c` to the next.
    let step = |all: &[f64], r: usize, c: usize| all[160 * r + c + 1] - all[160 * r + c];
    let rms = |steps: Vec<f64>| (steps.iter().map(|s| s * s).sum::<f64>() / steps.len() as f64).sqrt();
    let own = rms((0..160).flat_map(|r| (0..159).map(move |c| (r, c))).map(|(r, c)| step(&whole, r, c)).collect());
    for method in ["modulated", "wavelet_statistics", "quilting", "exemplar"] {
        let mut arguments = vec!["texture", "fit.json", "--fill", "holed.tif", "--method", method, "--seed", "5"];
        if ["quilting", "exemplar"].contains(&method) {
            arguments.extend(["--exemplar", "site.tif"]);
        }
        let made = ok_json(path, &[&arguments[..], &["-o", "filled.tif"]].concat());
        assert_eq!((made["filled_cells"].as_u64(), made["method"].as_str()), (Some(1200), Some(method)));
        assert!(!made["notes"].to_string().contains("no waves longer"), "{method}: {}", made["notes"]);
        let filled = heights(path, "filled.tif");
        for (k, (a, b)) in filled.iter().zip(&whole).enumerate() {
            assert!(if is_hole(k) { a.is_finite() && a != b } else { a == b }, "{method}: cell {k}: {a} {b}");
        }
        // 60 steps, some 25 of them independent: a standard error of 14 %. Laid side by side without conditioning, steps would be 1.9 times the
        // site's, sqrt(2) sigma instead of sigma sqrt(2 (1 - exp(-1/3))).
        let rim = rms((70..100).flat_map(|r| [step(&filled, r, 59), step(&filled, r, 99)]).collect());
        assert!(rim < 1.5 * own, "{method}: {rim} {own}");
        ok(path, &[&arguments[..], &["--threads", "1", "-o", "again.tif"]].concat());
        assert_eq!(
            std::fs::read(path.join("again.tif")).unwrap(),
            std::fs::read(path.join("filled.tif")).unwrap(),
            "{method}"
        );
    }
}

/// What the methods cannot do is refused in one sentence, before anything is written.
#[test]
fn val_textures_that_repeat_a_site_refuse() {
    let folder = area();
    let path = folder.path();
    site_with_statistics(path);
    ok(path, &["texture", "own.json", "--size", "16x16", "--cell", "0.1", "--seed", "4", "-o", "other.tif"]);
    write(path, "plot.geojson", "{\"type\": \"Polygon\", \"coordinates\": [[[1,1],[9,1],[9,9],[1,9],[1,1]]]}");
    let exemplar = ["--exemplar", "site.tif"];
    let none: &[&str] = &[];
    let cases: [(&str, &str, &[&str], i32, &str); 15] = [
        ("plain.json", "modulated", none, 2, "fit the DEM with --statistics"),
        ("plain.json", "wavelet_statistics", none, 2, "fit the DEM with --statistics"),
        ("fit.json", "quilting", none, 2, "give the DEM of the fit with --exemplar"),
        ("fit.json", "exemplar", none, 2, "give the DEM of the fit with --exemplar"),
        ("fit.json", "fft_ma", &exemplar, 2, "`fft_ma` does not copy from a DEM"),
        ("fit.json", "quilting", &["--exemplar", "other.tif"], 65, "is not the DEM of the fit"),
        ("own.json", "quilting", &exemplar, 2, "`settings` are missing"),
        (
            "fit.json",
            "quilting",
            &["--exemplar", "site.tif", "--mask", "plot.geojson"],
            2,
            "not those of the fit: none",
        ),
        ("fit.json", "modulated", &["--mask", "plot.geojson"], 2, "--exemplar"),
        ("fit.json", "modulated", &["--cell", "0.2"], 2, "only on the cells of the site, 0.1 m x 0.1 m"),
        ("fit.json", "modulated", &["--set", "ratio=0.5"], 2, "`modulated` keeps the directions of the site"),
        ("fit.json", "wavelet_statistics", &["--set", "azimuth_deg=30"], 2, "keeps the directions of the site"),
        ("fit.json", "wavelet_statistics", &["--set", "marginal=measured"], 2, "keeps the heights of the site"),
        ("fit.json", "wavelet_statistics", &["--set", "outer_m=3"], 2, "keeps the waves of the site"),
        ("fit.json", "modulated", &["--phase", "unit"], 2, "phase"),
    ];
    for (fit, method, more, code, words) in cases {
        let arguments = [&["texture", fit, "--method", method, "--size", "8x8", "-o", "refused.tif"], more].concat();
        let call = sastrugi_in(path, &arguments);
        assert_eq!(call.code, code, "{arguments:?}: {}", call.stderr);
        assert!(call.stderr.contains(words), "{arguments:?}: {}", call.stderr);
    }
    let fills: [(&[&str], &str); 5] = [
        (&["--exemplar", "site.tif"], "`fft_ma` does not copy from a DEM"),
        (&["--method", "cholesky"], "`--fill` takes `fft_ma`, or a method that repeats the site; `cholesky` does not"),
        (&["--method", "quilting"], "give the DEM of the fit with --exemplar"),
        (&["--method", "kriging"], "known texture methods"),
        (&["--method", "modulated", "--size", "8x8"], "cannot be used with"),
    ];
    for (more, words) in fills {
        let filled = sastrugi_in(path, &[&["texture", "fit.json", "--fill", "site.tif", "-o", "f.tif"], more].concat());
        assert!(filled.code == 2 && filled.stderr.contains(words), "{more:?}: {}", filled.stderr);
    }
    let paper = ["fit", "site.tif", "--outer-scale", "2", "--mode", "paper", "--statistics", "-o", "paper.json"];
    let call = sastrugi_in(path, &paper);
    assert!(call.code == 2 && call.stderr.contains("use `corrected` for statistics"), "{}", call.stderr);
    // Transects have one direction.
    let line: Vec<String> =
        (0..400).map(|k| format!("{} {}", f64::from(k) * 0.1, f64::from(k * 7919 % 97) * 0.001)).collect();
    write(path, "line.csv", &format!("x z\n{}\n", line.join("\n")));
    let call = sastrugi_in(path, &["fit", "line.csv", "--outer-scale", "2", "--statistics", "-o", "line.json"]);
    assert!(call.code != 0, "{}", call.stderr);
    for name in ["refused.tif", "f.tif", "paper.json", "line.json"] {
        assert!(!path.join(name).exists(), "{name}");
    }
}

#[test]
fn val_conversions_keep_the_heights() {
    let folder = area();
    let path = folder.path();
    ok(path, &["terrain", "multifractal", "--set", "size_px=[90,70]", "--seed", "3", "-o", "a.tif"]);
    for (to, back) in [("b.asc", "b.tif"), ("c.npy", "c.tif"), ("d.tif", "d2.tif")] {
        ok(path, &["convert", "a.tif", to]);
        ok(path, &["convert", to, back, "--cell", "0.05"]);
        let (a, b) = (ok_json(path, &["info", "a.tif"]), ok_json(path, &["info", back]));
        for key in ["rows", "cols", "height_min_m", "height_max_m"] {
            assert_eq!(a[key], b[key], "{to}: {key}");
        }
    }
    ok(path, &["convert", "a.tif", "e.obj"]);
    let mesh = std::fs::read_to_string(path.join("e.obj")).unwrap();
    let count = |start: &str| mesh.lines().filter(|line| line.starts_with(start)).count();
    assert_eq!((count("v "), count("f ")), (90 * 70, 2 * 89 * 69));
    ok(path, &["convert", "a.tif", "f.png"]);
    // Signature, and in the first chunk width and height, 16 bits, grey.
    let picture = std::fs::read(path.join("f.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG\r\n\x1a\n"));
    assert_eq!(picture[16..26], [0, 0, 0, 90, 0, 0, 0, 70, 16, 0]);
}

/// A DEM of 90 x 70 cells as a picture of 30 x 24 pixels; what cannot be drawn is refused.
#[test]
fn val_hillshade_draws_a_dem() {
    let folder = area();
    let path = folder.path();
    ok(path, &["terrain", "multifractal", "--set", "size_px=[90,70]", "-o", "a.tif"]);
    let drawn = ok_json(path, &["hillshade", "a.tif", "--pixels", "30", "-o", "a.png"]);
    assert_eq!((drawn["pixels"][0].as_u64(), drawn["pixels"][1].as_u64()), (Some(30), Some(24)));
    let bytes = std::fs::read(path.join("a.png")).unwrap();
    assert!(bytes.starts_with(b"\x89PNG") && bytes[16..24] == [0, 0, 0, 30, 0, 0, 0, 24]);
    for (arguments, code) in [
        (["a.tif", "-o", "a.jpg", "--quiet"], 2),
        (["a.tif", "-o", "b.png", "--pixels=0"], 2),
        (["a.tif", "-o", "b.png", "--exaggeration=-1"], 2),
        (["none.tif", "-o", "b.png", "--quiet"], 65),
    ] {
        let called = sastrugi_in(path, &[&["hillshade"][..], &arguments].concat());
        assert!(called.code == code && !called.stderr.contains("panicked"), "{arguments:?} {}", called.stderr);
        assert!(!path.join("b.png").exists());
    }
}

/// Same bytes on any number of threads and from the terrain of a study, whose release verifies, is computed again and comes from shards.
#[test]
fn val_exports_are_reproducible() {
    let folder = area();
    let path = folder.path();
    let study = "[study]\nname = \"out\"\nseed = 5\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
        count = 2\nsize_px = [90, 70]\nexports = [\"unreal\", \"unity\", \"gazebo\", \"mujoco\", \"isaac\"]\n";
    write(path, "study.toml", study);
    ok(path, &["run", "study.toml", "-o", "release"]);
    ok(path, &["verify", "release", "--recompute", "all"]);
    for part in ["1", "2"] {
        ok(
            path,
            &["run", "study.toml", "-o", &format!("part{part}"), "--shard", &format!("{part}/2"), "--threads", part],
        );
    }
    ok(path, &["merge", "part1", "part2", "-o", "merged"]);
    let sums_of = |name: &str| sums(&path.join(name));
    assert_eq!(sums_of("merged"), sums_of("release"));
    let of_first = |p: &&String| p.starts_with("export/t-0001/");
    assert_eq!(sums_of("release").keys().filter(of_first).count(), 20);
    let mut compared = 0;
    for target in ["unreal", "unity", "gazebo", "mujoco", "isaac"] {
        ok(path, &["convert", "release/terrain/t-0001.tif", target, "--for", target, "--threads", "1"]);
        for entry in std::fs::read_dir(path.join(target)).unwrap() {
            let name = entry.unwrap().file_name();
            let released = path.join("release/export/t-0001").join(target).join(&name);
            let (a, b) = (std::fs::read(path.join(target).join(&name)).unwrap(), std::fs::read(released).unwrap());
            assert!(a == b, "{target}: {} differs", name.display());
            compared += 1;
        }
    }
    assert_eq!(compared, 20);
    // Exports change no other file.
    write(path, "plain.toml", &study.replace("exports = ", "# exports = "));
    ok(path, &["run", "plain.toml", "-o", "plain"]);
    assert_eq!(sums_of("plain").get("terrain/t-0002.tif"), sums_of("release").get("terrain/t-0002.tif"));
}

/// The vehicle of a run on exported terrains lies beside them, with the bytes of `convert`; without exports there is none.
#[test]
fn val_vehicles_of_exported_terrains_are_released() {
    let folder = area();
    let path = folder.path();
    let plain = small_study();
    write(path, "study.toml", &plain.replace("size_px = [320, 300]", "size_px = [320, 300]\nexports = [\"mujoco\"]"));
    ok(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    ok(path, &["verify", "release", "--quiet"]);
    let released: Vec<String> =
        sums(&path.join("release")).into_keys().filter(|p| p.starts_with("export/vehicle/")).collect();
    assert_eq!(released, ["export/vehicle/husky.urdf", "export/vehicle/husky.xml"]);
    for ending in ["xml", "urdf"] {
        let name = format!("husky_a200.{ending}");
        ok(path, &["convert", "husky_a200", &name]);
        let of_release = std::fs::read(path.join(format!("release/export/vehicle/husky.{ending}"))).unwrap();
        assert_eq!(std::fs::read(path.join(&name)).unwrap(), of_release, "{ending}");
    }
    write(path, "plain.toml", &plain);
    ok(path, &["run", "plain.toml", "-o", "plain", "--quiet"]);
    assert!(sums(&path.join("plain")).keys().all(|p| !p.starts_with("export/")));
}

/// Known vehicles and vehicle files become MJCF and URDF; the friction is that of the surface.
#[test]
fn val_vehicles_are_converted() {
    let folder = area();
    let path = folder.path();
    let told = ok_json(path, &["convert", "rocker_bogie_rover", "rover.urdf", "--surface", "sand"]);
    assert_eq!((told["joints"].as_u64(), told["mass_kg"].as_f64().map(f64::round)), (Some(14), Some(118.0)));
    let text = std::fs::read_to_string(path.join("rover.urdf")).unwrap();
    assert!(
        text.contains("surface sand: wheels 0.53") && text.contains("<mimic joint=\"left_rocker_pivot\""),
        "{text}"
    );
    let sprung = ok_json(path, &["convert", "ugv_4x4", "ugv.urdf"]);
    assert!(sprung["notes"][0].as_str().unwrap().contains("no springs"), "{sprung}");
    write(path, "mine.toml", "base = \"husky_a200\"\n[parameters.wheels]\nradius_m = 0.2\n");
    let mine = ok_json(path, &["convert", "mine.toml", "mine.xml"]);
    assert!((mine["standing_height_m"].as_f64().unwrap() - 0.16718).abs() < 1e-9, "{mine}");
    assert!(std::fs::read_to_string(path.join("mine.xml")).unwrap().contains("size=\"0.2 0.05715\""));
}

/// Fewer triangles within the limit; the numbers are those of the file, and the same every time.
#[test]
fn val_meshes_are_decimated_on_request() {
    let folder = area();
    let path = folder.path();
    ok(path, &["terrain", "multifractal", "--set", "size_px=[90,70]", "--seed", "3", "-o", "t.tif"]);
    let mesh = |arguments: &[&str]| ok_json(path, &[&["convert", "t.tif"], arguments].concat())["mesh"].clone();
    let coarse = mesh(&["a.obj", "--max-error", "0.1"]);
    let fine = mesh(&["b.obj", "--max-error", "0.02"]);
    let count = |mesh: &Value| mesh["triangles"].as_u64().unwrap();
    assert!(count(&coarse) < count(&fine) && count(&fine) < 2 * 89 * 69, "{coarse} {fine}");
    assert!(fine["error_max_m"].as_f64().unwrap() <= 0.02 && fine["triangles_of_dem"] == 2 * 89 * 69, "{fine}");
    let text = std::fs::read_to_string(path.join("b.obj")).unwrap();
    assert_eq!(text.lines().filter(|l| l.starts_with("f ")).count() as u64, count(&fine));
    assert!(text.contains("# decimated to "), "{text}");
    assert_eq!(mesh(&["again.obj", "--max-error", "0.02", "--threads", "1"]), fine);
    assert_eq!(std::fs::read(path.join("again.obj")).unwrap(), text.into_bytes());
    let few = mesh(&["c.glb", "--triangles", "100"]);
    assert!((99..=100).contains(&count(&few)), "{few}");
    assert_eq!(mesh(&["whole.obj"]), Value::Null);
    ok(path, &["convert", "t.tif", "isaac", "--for", "isaac", "--max-error", "0.1"]);
    let import = std::fs::read_to_string(path.join("isaac/import.json")).unwrap();
    let import: Value = serde_json::from_str(&import).unwrap();
    assert_eq!(import["settings"]["decimation"], coarse);
    // In a study, of the same heights.
    let study = "[study]\nname = \"out\"\nseed = 5\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
        seed = 3\nsize_px = [90, 70]\nexports = [\"isaac\", \"mujoco\"]\nexport_max_error_m = 0.1\n";
    write(path, "study.toml", study);
    ok(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    for name in ["import.json", "terrain.usda"] {
        let [verb, item] =
            ["isaac", "release/export/t/isaac"].map(|folder| std::fs::read(path.join(folder).join(name)).unwrap());
        assert!(verb == item, "{name}");
    }
}

#[test]
fn val_traverse_makes_a_release_of_its_own() {
    let folder = area();
    let path = folder.path();
    ok(path, &["terrain", "weierstrass_mandelbrot", "--set", "size_px=[300,300]", "-o", "t.tif"]);
    let arguments = [
        "traverse",
        "t.tif",
        "--missions",
        "2",
        "--set-missions",
        "length_m=5.0",
        "--set-missions",
        "border_m=1.5",
        "-o",
        "drive",
    ];
    ok_json(path, &arguments);
    ok(path, &["verify", "drive"]);
    assert_eq!(sums(&path.join("drive")).keys().filter(|p| p.ends_with(".mcap")).count(), 2);
    // Another DEM is another study.
    ok(path, &["terrain", "weierstrass_mandelbrot", "--seed", "9", "--set", "size_px=[300,300]", "-o", "u.tif"]);
    let before = sums(&path.join("drive"));
    let refused = sastrugi_in(path, &[&["traverse", "u.tif"][..], &arguments[2..]].concat());
    assert!(refused.code == 2 && refused.stderr.contains("is a release over another DEM"), "{}", refused.stderr);
    assert_eq!(sums(&path.join("drive")), before);
    let coarse = sastrugi_fixtures::jacksboro();
    let refused = sastrugi_in(path, &["traverse", coarse.to_str().unwrap(), "-o", "no", "--quiet"]);
    assert_ne!(refused.code, 0);
    assert!(refused.stderr.contains("elaborate") && refused.stderr.contains("cells of"), "{}", refused.stderr);
}

#[test]
fn val_plan_says_what_is_stale_and_why() {
    let folder = area();
    let path = folder.path();
    write(path, "study.toml", &small_study());
    let plan = ok_json(path, &["plan", "study.toml", "-o", "release"]);
    // A DEM as it is and in metres, two fits, a texture, three terrains; a description of each of these five surfaces; missions and traverse on
    // the terrains.
    let found = (plan["ready"].as_u64(), plan["items"].as_u64(), plan["stale"].as_array().map(Vec::len));
    assert_eq!(found, (Some(0), Some(19), Some(19)));
    assert!(plan["stale"].as_array().unwrap().iter().all(|s| s["reason"] == "new"));
    ok(path, &["run", "study.toml", "-o", "release", "--quiet"]);
    assert!(ok(path, &["plan", "study.toml", "-o", "release"]).contains("0 to compute"));
    write(path, "study.toml", &small_study().replace("length_m = 5.0", "length_m = 4.5"));
    let plan = ok_json(path, &["plan", "study.toml", "-o", "release"]);
    let reason = |item: &str| {
        let stale = plan["stale"].as_array().unwrap().iter().find(|s| s["item"] == item).unwrap().clone();
        stale["reason"].as_str().unwrap().to_owned()
    };
    assert!(reason("missions/short@smooth").contains("length_m 5.0 -> 4.5"));
    assert!(reason("traverse/husky@smooth").contains("missions/short@smooth, which changed"));
    assert_eq!(plan["stale"].as_array().unwrap().len(), 6);
}

/// Every topic of both flavours, of missions and of teams, with its message, and own messages with their fields; one topic by its name.
#[test]
fn val_schema_tells_of_topics() {
    let folder = area();
    let all = ok_json(folder.path(), &["schema", "topics"]);
    let count = |of: &str| all[of].as_array().unwrap().len();
    assert_eq!(["viewer", "ros2", "team_viewer", "team_ros2"].map(count), [11, 9, 10, 10]);
    let wheels = ok(folder.path(), &["schema", "/wheels"]);
    assert!(
        wheels.contains("sastrugi.Wheels") && wheels.contains("torque_n_m") && wheels.contains("in steps of"),
        "{wheels}"
    );
    let both = ok_json(folder.path(), &["schema", "/imu"]);
    assert_eq!((&both[0]["schema"], &both[1]["schema"]), (&"sastrugi.Imu".into(), &"sensor_msgs/msg/Imu".into()));
    let call = sastrugi_in(folder.path(), &["schema", "/odometry"]);
    assert!(call.code == 2 && call.stderr.contains("`sastrugi schema topics`"), "{} {}", call.code, call.stderr);
}

/// `schemas/published` holds what users rely on: the study's JSON Schema, the tables' columns, the topics; `docs/study.md` the same of the study to read. To refresh after a change of
/// the contract: `SASTRUGI_REFRESH=1 cargo test --release -p sastrugi-tests --test cli published`.
#[test]
fn gold_published_schemas_are_current() {
    let folder = area();
    let root = sastrugi_fixtures::workspace_root();
    for (file, arguments) in [
        ("schemas/published/study.schema.json", ["schema", "study", "--json"]),
        ("schemas/published/tables.json", ["schema", "tables", "--json"]),
        ("schemas/published/topics.json", ["schema", "topics", "--json"]),
        ("docs/study.md", ["schema", "study", "--markdown"]),
    ] {
        let now = ok(folder.path(), &arguments);
        if std::env::var_os("SASTRUGI_REFRESH").is_some() {
            write(&root, file, &now);
        }
        let kept = std::fs::read_to_string(root.join(file)).unwrap();
        assert!(now == kept, "{file} is stale; refresh it and say why in the commit message");
    }
}

/// Of every key, the page on studies says what it holds, what it means, and what it may be.
#[test]
fn val_the_page_on_studies_is_complete() {
    let page = std::fs::read_to_string(sastrugi_fixtures::workspace_root().join("docs/study.md")).unwrap();
    let keys = page.lines().filter(|line| line.starts_with("| `") && line.matches(" |").count() >= 5);
    let mut count = 0;
    for line in keys {
        let cells: Vec<&str> = line.split(" | ").map(|cell| cell.trim_matches(['|', ' '])).collect();
        let [key, holds, _, example, meaning] = cells[..] else { panic!("{line}") };
        assert!(meaning.ends_with('.') || meaning.ends_with(')'), "{line}");
        if !key.contains(" = ") && !key.ends_with("]`") {
            assert!(!holds.is_empty(), "{line}");
            assert!(holds == "table" || holds == "list of tables" || !example.is_empty(), "no example: {line}");
            count += 1;
        }
    }
    assert!(count > 700, "{count} keys");
    for section in ["study", "dem", "terrain", "fit", "texture", "image", "missions", "traverse", "route", "rover"] {
        assert!(page.contains(&format!("\n## {section}\n")), "{section}");
    }
}

/// Tables within themselves too: a team's slot may hold a team.
#[test]
fn val_every_kind_is_described() {
    let folder = area();
    let all = sastrugi_in(folder.path(), &["kinds", "--json"]);
    let kinds: Value = serde_json::from_str(&all.stdout).unwrap();
    assert!(kinds.as_array().unwrap().len() > 30, "{kinds}");
    for kind in kinds.as_array().unwrap() {
        let name = kind["kind"].as_str().unwrap();
        let told = ok(folder.path(), &["kinds", name]);
        let head =
            format!("{} {name}: {}\nsource: ", kind["family"].as_str().unwrap(), kind["summary"].as_str().unwrap());
        assert!(told.contains(&head), "{told}");
    }
    let wedge = sastrugi_in(folder.path(), &["kinds", "wedge"]).stdout;
    assert!(wedge.contains("slots[].team") && !wedge.contains("slots[].team[].team[]"), "{wedge}");
}
