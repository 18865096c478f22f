//! Independent readers of our files: rasterio, pyarrow, duckdb, laspy, GSTools, MuJoCo, OpenUSD, trimesh and the Python mcap reader read
//! what we wrote. Independent data for our fits: fields from numpy, backgrounds from scipy.
//!
//! The readers are installed in `.cache/readers` by `./test`. Without them, these tests are skipped with a message; with CI set,
//! that is a failure.

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

mod lerobot;
mod page;
mod photoclinometry;
mod rover;
mod server;
mod team;

use sastrugi_tests::{Called, area, called, program, sastrugi_in, small_study, write};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The readers' Python; `None` (after a message) if it is missing.
fn python() -> Option<PathBuf> {
    sastrugi_tests::python("readers", "./test")
}

/// A DEM of the repository.
fn shipped(name: &str) -> PathBuf {
    sastrugi_fixtures::workspace_root().join("fixtures/dem").join(name)
}

fn check(python: &Path, script: &str, arguments: &[&Path]) -> Called {
    let script = sastrugi_fixtures::workspace_root().join("tests/interop").join(script);
    called(Command::new(python).arg(script).args(arguments))
}

#[test]
fn val_readers_agree_with_a_release() {
    let Some(python) = python() else { return };
    let folder = area();
    write(folder.path(), "study.toml", &described_study());
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    let exports = ["unreal", "unity", "gazebo", "mujoco", "isaac"].map(|name| release.join("export/smooth").join(name));
    let terrain = release.join("terrain/smooth.tif");
    let paths: Vec<&Path> = std::iter::once(&terrain).chain(&exports).map(PathBuf::as_path).collect();
    let call = check(&python, "check_exports.py", &paths);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    for script in ["check_dems.py", "check_tables.py", "check_mcap.py", "check_metadata.py", "check_rerun.py"] {
        let call = check(&python, script, &[&release]);
        assert_eq!(call.code, 0, "{script}: {}{}", call.stdout, call.stderr);
    }
    let call = check(&python, "check_report.py", &[&release, &release.join("report")]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Every shipped study, and every study that `init` writes, is valid under the schema that editors use; wrong keys, values and combinations are not.
#[test]
fn val_studies_are_valid_under_their_schema() {
    let Some(python) = sastrugi_tests::python("schema", "./test") else { return };
    let folder = area();
    let root = sastrugi_fixtures::workspace_root();
    let shipped = std::fs::read_dir(root.join("fixtures/studies")).unwrap().map(|entry| entry.unwrap().path());
    let mut studies: Vec<PathBuf> = shipped.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    for kind in ["terrain", "texture", "traverse", "navigate", "rover", "photoclinometry"] {
        let file = format!("{kind}.toml");
        let call = sastrugi_in(folder.path(), &["init", kind, "-o", &file]);
        assert_eq!(call.code, 0, "{kind}: {}", call.stderr);
        studies.push(folder.path().join(file));
    }
    let schema = folder.path().join("study.schema.json");
    let paths: Vec<&Path> = std::iter::once(&schema).chain(&studies).map(PathBuf::as_path).collect();
    let call = check(&python, "check_schema.py", &paths);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let counts: Value = serde_json::from_str(&call.stdout).unwrap();
    assert!(counts["studies"].as_u64() >= Some(17) && counts["broken"].as_u64() >= Some(190), "{counts}");
}

/// The page on rovers: efficiencies, intraclass correlations and distance budgets are recomputed from the rows, and every query runs.
#[test]
fn val_rover_pages_follow_from_their_rows() {
    let Some(python) = python() else { return };
    let folder = area();
    let world = |id: &str, group: &str, coverage: f64| {
        format!(
            "[[terrain]]\nid = \"{id}\"\nkind = \"planetary\"\ngroup = \"{group}\"\ncount = 3\nsize_m = [12.0, 12.0]\ncell_m = 0.16\n\
             basic_spacing_m = 0.01\norigin_m = [-6.08, -6.08]\n\
             processes = [{{ kind = \"rocks\", coverage = {coverage}, diameter_min_m = 0.04, diameter_max_m = 1.0 }}]\n"
        )
    };
    let study = "[study]\nname = \"rovers\"\ntitle = \"Rovers\"\nseed = 5\ndate = \"2026-11-24\"\nlicense = \"CC0-1.0\"\ncreators = [\"x\"]\n"
        .to_owned()
        + &world("thin", "5 %", 0.05)
        + &world("dense", "18 %", 0.18)
        + "[[rover]]\nid = \"circle\"\nkind = \"sojourner_like\"\nterrains = [\"thin\", \"dense\"]\nrovers = 6\nradius_m = 5.0\n\
           distance_limit_m = 60.0\nsweep.hazard_step_m = [0.05, 0.08]\n\
           [[rover]]\nid = \"plain\"\nkind = \"sojourner_like\"\nterrains = [\"thin\", \"dense\"]\nrovers = 6\nradius_m = 5.0\ndistance_limit_m = 40.0\n";
    write(folder.path(), "study.toml", &study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    let call = check(&python, "check_report.py", &[&release, &release.join("report")]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let counts: Value = serde_json::from_str(&call.stdout).unwrap();
    assert!(counts["sets of rovers"].as_u64() == Some(2) && counts["queries"].as_u64() >= Some(15), "{counts}");
}

/// ROS 2 bags, read by rosbags, mcap-ros2-support and `analyze`: the same missions as in the viewer flavour. Grid maps
/// with the terrain's own cells, and with larger ones.
#[test]
fn val_ros_reads_the_bags() {
    let Some(python) = python() else { return };
    let folder = area();
    let small = "size_px = [120, 100]\ncell_m = 0.2";
    let study =
        small_study().replace("seed = 7\n", "seed = 7\nmcap = \"ros2\"\n").replace("size_px = [280, 300]", small);
    write(folder.path(), "study.toml", &study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    let bags = check(&python, "check_ros2.py", &[&release]);
    assert_eq!(bags.code, 0, "{}{}", bags.stdout, bags.stderr);
    let bags: Value = serde_json::from_str(&bags.stdout).unwrap();
    let cells = |terrain: &str| bags[format!("mcap/{terrain}/husky-0001/husky-0001.mcap")]["grid_map_cell"].as_f64();
    assert_eq!((cells("smooth"), cells("rough-0001")), (Some(1.0), Some(3.0)));
    let call = check(&python, "check_rerun.py", &[&release]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// `--cog` and `geotiff = "cog"`: valid according to rio-cogeo, with the heights of the plain file; accompanying maps have their units and
/// are in separate file sets.
#[test]
fn val_cloud_optimised_files_are_valid() {
    let Some(python) = python() else { return };
    let folder = area();
    let path = folder.path();
    let fixture = sastrugi_fixtures::workspace_root().join("fixtures/dem/jacksboro.tif");
    let fixture = fixture.to_str().unwrap();
    for (name, more) in [("plain.tif", None), ("cog.tif", Some("--cog")), ("again.tif", Some("--cog"))] {
        let arguments = ["convert", fixture, name, "--quiet"].into_iter().chain(more).collect::<Vec<_>>();
        let call = sastrugi_in(path, &arguments);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    assert_eq!(std::fs::read(path.join("cog.tif")).unwrap(), std::fs::read(path.join("again.tif")).unwrap());
    for (name, how) in [("plain", "plain"), ("cog", "cog")] {
        let study = LARGE_TERRAIN.replace("HOW", how);
        write(path, "study.toml", &study);
        let call = sastrugi_in(path, &["run", "study.toml", "-o", name, "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    let released = ["t", "mars", "mars.class", "mars.albedo", "mars.rock-potential"];
    let released = released.map(|id| ["cog", "plain"].map(|how| path.join(how).join(format!("terrain/{id}.tif"))));
    let files = [["cog.tif", "plain.tif"].map(|name| path.join(name))].into_iter().chain(released);
    let files: Vec<PathBuf> = files.flatten().collect();
    let call = check(&python, "check_cog.py", &files.iter().map(PathBuf::as_path).collect::<Vec<_>>());
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    for script in ["check_dems.py", "check_metadata.py"] {
        let call = check(&python, script, &[&path.join("cog")]);
        assert_eq!(call.code, 0, "{script}: {}{}", call.stdout, call.stderr);
    }
    let call = sastrugi_in(path, &["compare", "plain", "cog", "--json", "--quiet"]);
    let compared: Value = serde_json::from_str(&call.stdout).unwrap();
    assert_eq!(compared["answer"], "same");
    assert!(compared["files"]["packaging"].as_array().unwrap().contains(&"terrain/t.tif".into()), "{compared}");
}

/// Heights, scale and orientation of everything that `convert` writes for simulators, by the simulators' rules and independent readers:
/// an oblong terrain that must be resampled; one of a suitable size; one cropped; a DEM far from its origin, with oblong cells; one with holes.
#[test]
fn val_simulators_see_the_terrain() {
    let Some(python) = python() else { return };
    let folder = area();
    let path = folder.path();
    let run = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
    };
    for (dem, size) in
        [("oblong.tif", "size_px=[90,70]"), ("fits.tif", "size_px=[129,129]"), ("large.tif", "size_px=[150,133]")]
    {
        run(&["terrain", "multifractal", "--set", size, "--seed", "3", "-o", dem]);
    }
    for (name, hole) in [("far", "2101.25"), ("holed", "-9999")] {
        let heights: Vec<String> = (0..24 * 30).map(|k| format!("{}", 2100 + (k * k) % 97 - k / 30)).collect();
        let rows: Vec<String> = heights.chunks(30).map(|row| row.join(" ")).collect();
        let head =
            "ncols 30\nnrows 24\nxllcorner 664692.5\nyllcorner 4878903.25\ndx 0.5\ndy 0.25\nnodata_value -9999\n";
        write(
            path,
            &format!("{name}.asc"),
            &format!("{head}{}\n", rows.join("\n").replace(" 2105 ", &format!(" {hole} "))),
        );
        run(&["convert", &format!("{name}.asc"), &format!("{name}.tif")]);
    }
    for (name, targets) in [
        ("oblong", &["unreal", "unity", "gazebo", "mujoco", "isaac"][..]),
        ("fits", &["unreal", "unity", "gazebo", "mujoco", "isaac"]),
        ("far", &["unreal", "unity", "gazebo", "mujoco", "isaac"]),
        ("large", &["unity"]),
        ("holed", &["isaac"]),
    ] {
        let dem = format!("{name}.tif");
        let mut made = vec![path.join(&dem)];
        for target in targets {
            let out = format!("{name}-{target}");
            run(&["convert", &dem, &out, "--for", target, "--quiet"]);
            made.push(path.join(out));
        }
        if name == "large" {
            for target in ["unreal", "unity", "gazebo"] {
                let out = format!("{name}-{target}-crop");
                run(&["convert", &dem, &out, "--for", target, "--crop", "--quiet"]);
                made.push(path.join(out));
            }
        }
        for ending in ["glb", "obj", "usda", "npy"] {
            let out = format!("{name}.{ending}");
            run(&["convert", &dem, &out, "--quiet"]);
            made.push(path.join(out));
        }
        let call = check(&python, "check_exports.py", &made.iter().map(PathBuf::as_path).collect::<Vec<_>>());
        assert_eq!(call.code, 0, "{name}: {}{}", call.stdout, call.stderr);
    }
}

/// Decimated meshes of a terrain, and of one with holes and oblong cells, in every format: the stated error holds at every cell
/// centre.
#[test]
fn val_readers_measure_the_error_of_decimated_meshes() {
    let Some(python) = python() else { return };
    let folder = area();
    let path = folder.path();
    let run = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
        call.stdout
    };
    run(&["terrain", "multifractal", "--set", "size_px=[90,70]", "--seed", "3", "-o", "whole.tif"]);
    let height = |k: i32| if k % 41 < 3 { -9999 } else { (k * k) % 7 - k / 30 };
    let heights: Vec<String> = (0..24 * 30).map(|k| height(k).to_string()).collect();
    let rows: Vec<String> = heights.chunks(30).map(|row| row.join(" ")).collect();
    let head = "ncols 30\nnrows 24\nxllcorner 664692.5\nyllcorner 4878903.25\ndx 0.5\ndy 0.25\nnodata_value -9999\n";
    write(path, "holed.asc", &format!("{head}{}\n", rows.join("\n")));
    run(&["convert", "holed.asc", "holed.tif"]);
    for (dem, limit) in
        [("whole", ["--max-error", "0.05"]), ("whole", ["--triangles", "500"]), ("holed", ["--max-error", "2.5"])]
    {
        let mut made = vec![path.join(format!("{dem}.tif")), path.join("stated.json")];
        for ending in ["obj", "glb", "usda"] {
            let (from, to) = (format!("{dem}.tif"), format!("{dem}.{ending}"));
            let told = run(&[&["convert", &from, &to, "--json", "--quiet"][..], &limit].concat());
            write(path, "stated.json", &told);
            made.push(path.join(to));
        }
        let call = check(&python, "check_decimated.py", &made.iter().map(PathBuf::as_path).collect::<Vec<_>>());
        assert_eq!(call.code, 0, "{dem} {limit:?}: {}{}", call.stdout, call.stderr);
    }
}

/// MJCF and URDF of every shipped vehicle, and of one from a file, in MuJoCo: mass, centre of mass, moments of inertia, wheels and joints as in their
/// parameters; height at rest as in our model, except for the sag of the tyres, to 1 mm; motors drive forward at their speed.
#[test]
fn val_mujoco_reads_the_vehicles() {
    let Some(python) = python() else { return };
    let folder = area();
    let path = folder.path();
    let run = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
        call.stdout
    };
    let row = "0 ".repeat(200);
    let head = "ncols 200\nnrows 200\nxllcorner 0\nyllcorner 0\ncellsize 0.1\nnodata_value -9999\n";
    write(path, "flat.asc", &format!("{head}{}", format!("{row}\n").repeat(200)));
    let shipped = ["husky_a200", "ugv_4x4", "rocker_bogie_rover"];
    for name in shipped {
        let told = run(&["kinds", name, "--json"]);
        write(path, &format!("{name}.json"), &told);
    }
    // A vehicle file in which every parameter is changed.
    let mut own: Value = serde_json::from_slice(&std::fs::read(path.join("ugv_4x4.json")).unwrap()).unwrap();
    own[0]["parameters"]["chassis"]["mass_kg"] = Value::from(900.0_f64);
    own[0]["parameters"]["wheels"]["radius_m"] = Value::from(0.45_f64);
    write(path, "own.json", &own.to_string());
    let vehicles = shipped.map(|name| (name, name)).into_iter().chain([("own", "own.json")]);
    let missions = ["--missions", "1", "--set-missions", "length_m=5", "--set-missions", "border_m=4"];
    for (name, vehicle) in vehicles {
        for ending in ["xml", "urdf"] {
            run(&["convert", vehicle, &format!("{name}.{ending}"), "--quiet"]);
        }
        let drive = ["traverse", "flat.asc", "--vehicle", vehicle, "--set", "timeout_s=4", "-o", name, "--quiet"];
        run(&[&drive[..], &missions].concat());
    }
    let names = shipped.into_iter().chain(["own"]).map(Path::new);
    let arguments: Vec<&Path> = std::iter::once(path).chain(names).collect();
    let call = check(&python, "check_vehicles.py", &arguments);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// A terrain of more than two tiles per side.
const LARGE_TERRAIN: &str = "[study]\nname = \"large\"\nseed = 7\ndate = \"2026-11-22\"\ngeotiff = \"HOW\"\n\n\
    [[terrain]]\nid = \"t\"\nkind = \"weierstrass_mandelbrot\"\nsize_px = [600, 531]\ncell_m = 0.2\nfrequencies = 64\n\n\
    [[terrain]]\nid = \"mars\"\nkind = \"planetary\"\nsize_px = [600, 531]\ncell_m = 0.05\n\
    processes = [{ kind = \"texture\" }, { kind = \"rocks\" }, { kind = \"albedo\" }]\n";

/// More terrains than the number of files of one table that Croissant lists: `samples` is a file set, and every record is still found.
#[test]
fn val_a_table_of_many_files_is_one_file_set() {
    let Some(python) = python() else { return };
    let folder = area();
    write(folder.path(), "study.toml", MANY_TERRAINS);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    assert_eq!(std::fs::read_dir(release.join("tables/samples")).unwrap().count(), 66);
    let croissant = std::fs::read_to_string(release.join("croissant.json")).unwrap();
    assert!(!croissant.contains("samples/part-") && croissant.contains("tables/samples/*.parquet"));
    let call = check(&python, "check_metadata.py", &[&release]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Whatever licence and title are, cffconvert finds the citation valid, and the licence if the format allows it.
#[test]
fn val_any_licence_gives_a_valid_citation() {
    let Some(python) = python() else { return };
    let folder = area();
    for (license, named, url) in [
        ("CC-BY-4.0", "\"CC-BY-4.0\"", "null"),
        ("MIT OR Apache-2.0", "[\"MIT\",\"Apache-2.0\"]", "null"),
        ("DL-DE-BY-2.0", "[]", "\"https://spdx.org/licenses/DL-DE-BY-2.0\""),
        ("https://example.org/terms", "[]", "\"https://example.org/terms\""),
        ("proprietary", "[]", "null"),
    ] {
        let head = format!(
            "title = \"A \\u007f\\u0085\\u2028\\ufffe title\"\nlicense = \"{license}\"\ncreators = [\"Doe, Jane\", \"J. Doe\", \"A group\"]\norganizations = [\"A group\"]\n"
        );
        let study = MANY_TERRAINS.split("[[missions]]").next().unwrap().replace("count = 66\n", "");
        write(folder.path(), "study.toml", &study.replace("license = \"CC-BY-4.0\"\n", &head));
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
        let listed = ["https://example.org/terms", "proprietary"].iter().all(|unlisted| *unlisted != license);
        assert_eq!(call.stderr.contains("is not in the SPDX list"), !listed, "{license}: {}", call.stderr);
        let call = check(&python, "check_metadata.py", &[&folder.path().join("release")]);
        assert_eq!(call.code, 0, "{license}: {}{}", call.stdout, call.stderr);
        let found: Value = serde_json::from_str(&call.stdout).unwrap();
        let citation = &found["citation"];
        assert_eq!(
            (citation["license"].to_string(), citation["license-url"].to_string()),
            (named.to_owned(), url.to_owned())
        );
    }
}

/// Smooth terrains of 13 m, driven for half a second each.
const MANY_TERRAINS: &str = "[study]\nname = \"many\"\nseed = 7\ndate = \"2026-11-22\"\nlicense = \"CC-BY-4.0\"\n\n\
    [[terrain]]\nid = \"t\"\nkind = \"weierstrass_mandelbrot\"\ncount = 66\nsize_px = [64, 64]\ncell_m = 0.2\n\
    fractal_dimension = 2.1\nsampling_length_m = 12.8\nelevation_scale_m = 1e-18\nfrequencies = 64\n\n\
    [[missions]]\nid = \"m\"\nterrains = [\"t\"]\ncount = 1\nlength_m = 4.0\nborder_m = 1.5\n\n\
    [[traverse]]\nid = \"h\"\nmissions = \"m\"\ntimeout_s = 0.5\n";

/// The small study with everything that can describe a release: version and DOI, licences of its data, a split, methods side by side,
/// exports.
fn described_study() -> String {
    let head = "seed = 7\ntitle = \"Small: \\\"rough\\\" & smooth\"\nversion = \"1.0.0\"\ndoi = \"10.5281/zenodo.1234567\"\n\
        creators = [{ name = \"Person, A.\", orcid = \"0000-0002-1825-0097\", affiliation = \"A group\" }, \"A group\"]\n\
        organizations = [\"A group\"]\nkeywords = [\"snow\", \"gravel\"]\n\
        funding = [\"10.13039/501100001711::200021_192342\", \"A fund\"]\nsplit = [0.4, 0.3, 0.3]\n";
    let dem =
        "id = \"site\"\nlicense = \"public domain\"\nattribution = \"NASA and USGS\"\ncitation = \"SRTM (2000)\"\n";
    let study = small_study().replace("seed = 7\n", head).replace("id = \"site\"\n", dem);
    let methods = "[[texture]]\nid = \"side\"\nfit = \"naive\"\nmethods = [\"fft_ma\", \"gaussians\"]\nrealisations = 2\n\
        size_m = [4500.0, 4500.0]\ncell_m = 90.0\n";
    let exports = "exports = [\"unreal\", \"unity\", \"gazebo\", \"mujoco\", \"isaac\"]\n";
    study.replace("count = 2\n", "count = 3\n").replace("group = \"b\"\n", exports) + methods
}

/// Routes over a measured DEM and two synthetic terrains: least costs agree with scipy and scikit-image, there is no route where scipy finds none,
/// and cost, lengths and slopes of smoothed routes agree with an independent integral.
#[test]
fn val_routes_cost_what_scipy_and_scikit_image_find() {
    let Some(python) = python() else { return };
    let folder = area();
    let dem = sastrugi_fixtures::workspace_root().join("fixtures/dem/pozo_blanca.tif");
    let call = check(&python, "check_routes.py", &[&program(), &dem, folder.path()]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let counts: Value = serde_json::from_str(&call.stdout).unwrap();
    let at_least = |kind: &str, count| assert!(counts[kind].as_u64().unwrap() >= count, "{kind}: {counts}");
    [("found", 50), ("no_path", 15), ("isotropic", 20)].into_iter().for_each(|(kind, count)| at_least(kind, count));
}

/// Influence of rover parameters: mu, mu* and sigma of a release agree with SALib on its designs.
#[test]
fn val_effects_of_rovers_agree_with_salib() {
    let Some(python) = python() else { return };
    let folder = area();
    write(folder.path(), "study.toml", PERTURBED);
    let call = sastrugi_in(folder.path(), &["rover", "study.toml", "--perturb", "20%", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = check(&python, "check_effects.py", &[&folder.path().join("release")]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Rovers on two worlds of rocks, perturbed.
const PERTURBED: &str = r#"
[study]
name = "perturbed"
seed = 5
date = "2026-01-01"

[[terrain]]
id = "dense"
kind = "planetary"
group = "dense"
count = 2
size_m = [16.0, 16.0]
cell_m = 0.16
basic_spacing_m = 0.02
origin_m = [-8.0, -8.0]
processes = [{ kind = "rocks", coverage = 0.176, diameter_min_m = 0.04, diameter_max_m = 4.0 }]

[[rover]]
id = "rays"
kind = "sojourner_like"
terrains = ["dense"]
rovers = 3
radius_m = 4.0
distance_limit_m = 30.0

[rover.perturb]
trajectories = 4
levels = 6
parameters = ["hazard_step_m", "turn_deg", "rows_m", "clearance_m"]
"#;

/// Shipped DEMs, and one of them in every format that is read, written by GDAL and numpy, are read as rasterio (or numpy) reads them.
#[test]
fn val_measured_dems_read_as_rasterio_reads_them() {
    let Some(python) = python() else { return };
    let folder = area();
    let made = check(&python, "make_dems.py", &[&shipped("pozo_blanca.tif"), folder.path()]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let names: Vec<String> = serde_json::from_str(&made.stdout).unwrap();
    assert_eq!(names.len(), 9, "{names:?}");
    let mut files = ["jacksboro.tif", "otira.tif", "pozo_blanca.tif"].map(shipped).to_vec();
    files.extend(names.iter().map(|name| folder.path().join(name)));
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let call = check(&python, "check_dems.py", &paths);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let theirs: Value = serde_json::from_str(&call.stdout).unwrap();
    for path in files {
        let name = path.file_name().unwrap().to_str().unwrap();
        let ours = sastrugi_in(Path::new("."), &["info", path.to_str().unwrap(), "--json"]);
        assert_eq!(ours.code, 0, "{}", ours.stderr);
        let ours: Value = serde_json::from_str(&ours.stdout).unwrap();
        let theirs = find(&theirs, name).unwrap_or_else(|| panic!("{name} is not in {theirs}"));
        for key in ["rows", "cols", "valid", "height_min_m", "height_max_m", "dtype", "heights_sha256"] {
            let single = theirs["dtype"] == "float32";
            assert_eq!(number(&ours[key], single), number(&theirs[key], single), "{name}: {key}");
        }
    }
}

/// Cell means of point clouds, which laspy writes from measured DEMs, agree with numpy on the points that laspy reads: half of the points of
/// one cloud lie on the borders of cells, and a tenth of the points of each are noise or withheld. The chunks of a LAZ have equal or unequal
/// numbers of points.
#[test]
fn val_clouds_are_gridded_as_numpy_grids_them() {
    let Some(python) = python() else { return };
    let folder = area();
    let clouds = [
        ("pozo_blanca", "laz", &["0.25"][..], &["0.5", "2"][..]),
        ("otira", "las", &["0.0001"], &["0.02"]),
        ("otira", "laz", &["0.0001", "unequal"], &["0.02"]),
    ];
    for (name, ending, how, cells) in clouds {
        let cloud = folder.path().join(format!("{name}.{ending}"));
        let dem = shipped(&format!("{name}.tif"));
        let how = how.iter().map(Path::new);
        let made = check(
            &python,
            "make_cloud.py",
            &[dem.as_path(), cloud.as_path()].into_iter().chain(how).collect::<Vec<_>>(),
        );
        assert_eq!(made.code, 0, "{}", made.stderr);
        for cell in cells {
            let heights = folder.path().join("heights.npy");
            let (from, to) = (cloud.to_str().unwrap(), heights.to_str().unwrap());
            let call = sastrugi_in(folder.path(), &["convert", from, to, "--cell", cell]);
            assert_eq!(call.code, 0, "{}", call.stderr);
            let call = check(&python, "check_points.py", &[&cloud, Path::new(cell), &heights]);
            assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
            let theirs: Value = serde_json::from_str(&call.stdout).unwrap();
            let count = |key: &str| theirs[key].as_u64().unwrap();
            assert!(count("points") > 50_000 && count("held") > 10_000, "{theirs}");
            assert!(count("held") < count("rows") * count("cols") && count("held") < count("points"), "{theirs}");
        }
    }
}

/// Cells inside polygons agree with those that GDAL burns: a lake with an island, another that extends beyond the DEM, sides of any slope.
#[test]
fn val_masks_keep_the_cells_that_rasterio_finds_inside() {
    let Some(python) = python() else { return };
    let folder = area();
    let dem = sastrugi_fixtures::jacksboro();
    let lake = "[[-84.3811, 36.5237], [-84.2173, 36.4911], [-84.1537, 36.6213], [-84.2991, 36.6677], [-84.3811, 36.5237]], \
                [[-84.3123, 36.5571], [-84.2517, 36.5433], [-84.2711, 36.6039], [-84.3123, 36.5571]]";
    let island = "[[-84.2831, 36.5621], [-84.2707, 36.5567], [-84.2743, 36.5809], [-84.2831, 36.5621]]";
    let beyond = "[[-84.9, 36.6917], [-84.3377, 36.7003], [-84.4019, 37.2], [-84.9, 36.6917]]";
    let text = format!(
        "{{\"type\": \"FeatureCollection\", \"features\": [\
         {{\"type\": \"Feature\", \"properties\": {{}}, \"geometry\": {{\"type\": \"Polygon\", \"coordinates\": [{lake}]}}}}, \
         {{\"type\": \"Feature\", \"properties\": {{}}, \"geometry\": \
         {{\"type\": \"MultiPolygon\", \"coordinates\": [[{island}], [{beyond}]]}}}}]}}"
    );
    let mask = write(folder.path(), "mask.geojson", &text);
    let masked = folder.path().join("masked.tif");
    let arguments = ["convert", dem.to_str().unwrap(), "masked.tif", "--mask", "mask.geojson"];
    let call = sastrugi_in(folder.path(), &arguments);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = check(&python, "check_masks.py", &[&dem, &mask, &masked]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let theirs: Value = serde_json::from_str(&call.stdout).unwrap();
    // Some of the 344 x 403 cells are inside, most are not.
    assert!((10_000..344 * 403 / 2).contains(&theirs["kept"].as_u64().unwrap()), "{theirs}");
}

/// The `gstools` blocks of fit files load in GSTools, and its covariances agree with ours to 1e-9 of the sill (5e-15 measured).
#[test]
fn val_gstools_blocks_are_the_fitted_models() {
    let Some(python) = python() else { return };
    let folder = area();
    write(folder.path(), "made.json", r#"{"model": "exponential", "parameters": {"sigma_m": 0.1, "range_m": 0.3}}"#);
    let made = ["texture", "made.json", "--size", "12x12", "--cell", "0.1", "--phase", "gaussian", "-o", "made.tif"];
    let call = sastrugi_in(folder.path(), &made);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let models = ["exponential", "matern", "anisotropic:exponential", "exponential+nugget"];
    let mut files = vec![sastrugi_fixtures::workspace_root().join("fixtures/golden/gstools.json")];
    for (k, model) in models.iter().enumerate() {
        let name = format!("fit-{k}.json");
        let call = sastrugi_in(folder.path(), &["fit", "made.tif", "--model", model, "--bootstrap", "0", "-o", &name]);
        assert_eq!(call.code, 0, "{model}: {}", call.stderr);
        files.push(folder.path().join(name));
    }
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let call = check(&python, "check_gstools.py", &paths);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// A random forest of scikit-learn, which shares no code with our statistics, tells normal textures of a fit from the measured ground (AUC above
/// 0.9, beyond what halves of the site give), and cannot tell two of them from each other.
///
/// Null of the second: both rasters are draws of one field. Some 200 patches of each give the mean of five AUCs a standard error below 0.04, so
/// that 0.2 from 0.5 is beyond 5 of them (1e-6). `compare --statistics` agrees in both; its wrong `different` has a probability of at most 0.05,
/// once for the seeds written here.
#[test]
fn stat_a_classifier_tells_normal_textures_from_measured_ground() {
    let Some(python) = python() else { return };
    let folder = area();
    let path = folder.path();
    let site = shipped("pozo_blanca.tif");
    let dem = site.to_str().unwrap();
    let run = |arguments: &[&str]| {
        let call = sastrugi_in(path, arguments);
        assert_eq!(call.code, 0, "{arguments:?}: {}", call.stderr);
        call.stdout
    };
    run(&["fit", dem, "--outer-scale", "25", "--bootstrap", "0", "-o", "fit.json"]);
    for (name, seed) in [("a.tif", "1"), ("b.tif", "2")] {
        let shape = ["texture", "fit.json", "--size", "271x281", "--cell", "1", "--set", "periodic=false"];
        run(&[&shape[..], &["--phase", "gaussian", "--seed", seed, "-o", name]].concat());
    }
    let [a, b] = ["a.tif", "b.tif"].map(|name| path.join(name));
    let judged = |site: &Path, texture: &Path| -> Value {
        let call = check(&python, "check_textures.py", &[Path::new("--deals=19"), Path::new("25"), site, texture]);
        assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
        println!("{}", call.stdout);
        serde_json::from_str(&call.stdout).unwrap()
    };
    let (told, blind) = (judged(&site, &a), judged(&a, &b));
    let auc = |judged: &Value| judged["textures"][0]["auc"].as_f64().unwrap();
    assert!(auc(&told) > 0.9 && told["textures"][0]["passes"] == false, "{told}");
    assert!(told["textures"][0]["auc_halved"].as_f64() > told["site"]["band"][1].as_f64(), "{told}");
    assert!(Some(auc(&told)) > told["site"]["halves"].as_f64(), "{told}");
    assert!((auc(&blind) - 0.5).abs() < 0.2, "{blind}");
    let answer = |one: &str, other: &str| -> Value {
        let text = run(&["compare", one, other, "--statistics", "--outer-scale", "25", "--json", "--quiet"]);
        serde_json::from_str::<Value>(&text).unwrap()["answer"].clone()
    };
    assert_eq!(answer(dem, "a.tif"), "different");
    assert_ne!(answer("a.tif", "b.tif"), "different");
}

/// Runs `check_fits.py` to the given extent and prints its table.
fn fits_of_numpy_fields(extent: &str) {
    let Some(python) = python() else { return };
    let folder = area();
    let call = check(&python, "check_fits.py", &[&program(), folder.path(), Path::new(extent)]);
    println!("{}", call.stdout);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Fits of fields on slopes, from a circulant embedding in numpy: 20 fields, each also without its slope. Null hypothesis,
/// limits and false alarms: the script's header.
#[test]
fn stat_fits_of_numpy_fields_on_slopes() {
    fits_of_numpy_fields("quick");
}

/// The same for 300 fields, 64 without their slope, 60 with intervals.
#[test]
#[ignore = "slow: ./test --full"]
fn stat_many_fits_of_numpy_fields_on_slopes() {
    fits_of_numpy_fields("full");
}

/// Fits of numpy fields with the noise of dense image matching, estimated in a smooth part: the script's header states what is expected.
#[test]
fn stat_matching_noise_is_found_and_removed() {
    let Some(python) = python() else { return };
    let folder = area();
    let call = check(&python, "check_noise.py", &[&program(), folder.path()]);
    println!("{}", call.stdout);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Backgrounds of a sloping DEM with holes and of a measured one are scipy's local planes; background and texture of the measured
/// covariance, detrended by scipy, have the residual's RMS.
#[test]
fn val_backgrounds_are_local_planes_and_textures_complete_them() {
    let Some(python) = python() else { return };
    let folder = area();
    let dem = sastrugi_fixtures::workspace_root().join("fixtures/dem/jacksboro.tif");
    let call = check(&python, "check_background.py", &[&program(), folder.path(), &dem]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// A value as text, numbers in the precision of the raster.
fn number(value: &Value, single: bool) -> String {
    match value.as_f64() {
        Some(v) if single => (v as f32).to_string(),
        Some(v) => v.to_string(),
        None => value.to_string(),
    }
}

/// The values of a file in the script's answer, by the end of its path.
fn find<'a>(answer: &'a Value, name: &str) -> Option<&'a Value> {
    let map = answer.as_object()?;
    map.iter().find(|(key, _)| key.ends_with(name)).map(|(_, v)| v).or_else(|| map.values().find_map(|v| find(v, name)))
}

/// Logs written by mcap-ros2-support, rosbags and mcap-protobuf-support have the metrics that numpy computes from the same
/// motion (same interpolation and differences; angles up to the rounding of the interpolated quaternions' lengths), whatever
/// messages they use; bags are named by their folder, with one file or several; bad logs are refused by name.
#[test]
fn val_logs_of_other_writers_are_judged_alike() {
    let Some(python) = python() else { return };
    let folder = area();
    let made = check(&python, "make_logs.py", &[folder.path()]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let expected: Value = serde_json::from_str(&made.stdout).unwrap();
    assert_eq!(expected.as_object().unwrap().len(), 7, "{expected}");
    for (name, figures) in expected.as_object().unwrap() {
        assert_eq!(figures.as_object().unwrap().len(), 8, "{name}: {figures}");
        let call = sastrugi_in(folder.path(), &["analyze", &format!("{name}.mcap"), "--json"]);
        assert_eq!(call.code, 0, "{name}: {}", call.stderr);
        let found: Value = serde_json::from_str(&call.stdout).unwrap();
        for (figure, value) in figures.as_object().unwrap() {
            let (ours, theirs) = (found[0]["log"][figure].as_f64().unwrap(), value.as_f64().unwrap());
            assert!((ours / theirs - 1.0).abs() < 1e-6, "{name}: {figure} is {ours}, not {theirs}");
        }
    }
    let call = sastrugi_in(folder.path(), &["analyze", "truncated.mcap", "--json"]);
    assert_eq!(call.code, 3, "{}", call.stderr);
    let found: Value = serde_json::from_str(&call.stdout).unwrap();
    let row = &found[0]["log"];
    assert!(row["broken"].as_str().unwrap().starts_with("the file is truncated after "), "{row}");
    assert!((10.0..20.0).contains(&row["time_s"].as_f64().unwrap()), "{row}");
    let refusals = [
        ("no_pose", "no pose stream: the log must contain Odometry"),
        ("backwards", "on /odom, time goes back by "),
        ("damaged", "the file is damaged after "),
        ("text", "not an MCAP file"),
        ("missing", "no such file"),
    ];
    for (name, why) in refusals {
        let call = sastrugi_in(folder.path(), &["analyze", &format!("{name}.mcap")]);
        assert_eq!(call.code, 65, "{name}: {}", call.stderr);
        assert!(call.stderr.contains(why) && call.stderr.contains(name), "{name}: {}", call.stderr);
    }
    // One good log among bad ones is analysed, and its table is read back.
    let several = ["analyze", "odometry.mcap", "tf.mcap", "text.mcap", "--group", "field", "-o", "logs.parquet"];
    let call = sastrugi_in(folder.path(), &several);
    assert_eq!(call.code, 3, "{}", call.stderr);
    let table = check(&python, "show_table.py", &[&folder.path().join("logs.parquet")]);
    assert_eq!(table.code, 0, "{}", table.stderr);
    let rows: Value = serde_json::from_str(&table.stdout).unwrap();
    assert_eq!(rows.as_array().unwrap().len(), 2);
    assert_eq!((rows[0]["log_id"].as_str(), rows[0]["group"].as_str()), (Some("odometry.mcap"), Some("field")));
}

/// Smaller images of the planet in the gallery: brightness, shadows and rays are recomputed by numpy, and the files are read by rasterio.
#[test]
fn val_numpy_renders_the_same_images() {
    let Some(python) = python() else { return };
    let folder = area();
    let study = "[study]\nname = \"images\"\nseed = 6\ndate = \"2026-01-01\"\n\n\
        [[terrain]]\nid = \"planetary\"\nkind = \"planetary\"\nsize_px = [160, 130]\n\n\
        [[image]]\nid = \"map\"\nsurface = \"planetary\"\nsamples = 1\nexposure = 1.3\nhaze = 0.01\n\
        sun = { azimuth_deg = 110.0, elevation_deg = 18.0 }\n\n\
        [[image]]\nid = \"orbit\"\nsurface = \"planetary\"\nsamples = 1\nsun = { azimuth_deg = 250.0, elevation_deg = 30.0 }\n\
        camera = { kind = \"parallel\", azimuth_deg = 20.0, elevation_deg = 45.0 }\n\n\
        [[image]]\nid = \"rover\"\nsurface = \"planetary\"\nsamples = 1\nsun = { azimuth_deg = 80.0, elevation_deg = 25.0 }\n\
        camera = { kind = \"pinhole\", position_m = [1.5, 0.2, 0.3], target_m = [1.7, 1.5, 0.0], size_px = [120, 80] }\n";
    write(folder.path(), "study.toml", study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let call = check(&python, "check_images.py", &[&folder.path().join("release")]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}
