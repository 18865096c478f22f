//! Terrains from rasters and measured points: a refined real DEM, and worlds whose rocks follow a raster.

use sastrugi_numeric::{Geometry, Grid, Streams, Surface, resample};
use sastrugi_store::dem::{self, Crs, WriteOptions};
use sastrugi_terrain::elaborate::{self, TextureFit};
use sastrugi_terrain::{Input, Terrain};
use sastrugi_tests::{area, differing, rows, run_in_shards, sastrugi_in, sums, write};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

const STUDY: &str = r#"
[study]
name = "inputs"
seed = 3
date = "2026-01-01"

[[dem]]
id = "site"
file = "pozo.tif"

[[terrain]]
id = "fine"
kind = "elaborate"
seed = 5
count = 2
dem = "site"
origin_m = [231000.0, 3766000.0]
size_px = [96, 96]
cell_m = 0.125
basic_spacing_m = 0.125
image_resolution_m = 0.5
albedo = "bright.tif"
altimetry = "laser.csv"
processes = [
    { kind = "rocks", coverage = 0.0, potential = "shares.tif", diameter_min_m = 0.25 },
    { kind = "albedo" },
]

[[terrain]]
id = "world"
kind = "planetary"
size_m = [20.0, 20.0]
cell_m = 0.16
basic_spacing_m = 0.02
origin_m = [-9.92, -9.92]
processes = [
    { kind = "texture", roughness_m = 0.005 },
    { kind = "rocks", coverage = 0.0, potential = "halves.tif", diameter_min_m = 0.1 },
]

[[terrain]]
id = "copy"
kind = "planetary"
size_m = [8.0, 8.0]
cell_m = 0.16
basic_spacing_m = 0.02
processes = [{ kind = "rocks", potential = "world.rock-potential", diameter_min_m = 0.1 }, { kind = "texture" }]

[[rover]]
id = "rays"
kind = "sojourner_like"
terrains = ["world"]
rovers = 4
radius_m = 8.0
"#;

fn pozo_file() -> PathBuf {
    sastrugi_fixtures::workspace_root().join("fixtures/dem/pozo_blanca.tif")
}

/// Posts of the shipped lidar DEM that is refined.
fn pozo() -> dem::Dem {
    dem::read(&pozo_file()).unwrap()
}

/// South-west post of a window of `posts` x `posts` posts surrounded by data.
fn corner(grid: &Grid, posts: usize) -> [usize; 2] {
    let margin = 12;
    let whole = |[row, col]: [usize; 2]| {
        let part = grid.window(row, col, posts + 2 * margin, posts + 2 * margin);
        part.finite_count() == part.values.len()
    };
    let most = [grid.rows(), grid.cols()].map(|n| n - posts - 2 * margin);
    let mut all = (0..most[0]).flat_map(|row| (0..most[1]).map(move |col| [row, col]));
    let [row, col] = all.find(|place| whole(*place)).unwrap();
    [row + margin + posts - 1, col + margin]
}

/// Writes the inputs; returns the study with the window placed where there is data.
fn prepare(folder: &Path) -> (String, [f64; 2]) {
    fs::copy(pozo_file(), folder.join("pozo.tif")).unwrap();
    let site = pozo();
    let [row, col] = corner(&site.grid, 14);
    let g = site.grid.geometry;
    let origin = [g.x(col), g.y(row)];
    let raster = |name: &str, geometry: Geometry, crs: &Crs, f: &dyn Fn(usize) -> f64| {
        let grid = Grid::new(geometry, (0..geometry.len()).map(f).collect());
        dem::write(&folder.join(name), &grid, crs, &WriteOptions::default()).unwrap();
    };
    let about = Geometry { rows: 10, cols: 10, cell: [4.0; 2], origin: origin.map(|at| at - 14.0) };
    raster("bright.tif", about, &site.info.crs, &|k| 0.1 + 0.01 * (k % 13) as f64);
    raster("shares.tif", about, &site.info.crs, &|k| 0.05 * (k % 7) as f64);
    let halves = Geometry { rows: 16, cols: 16, cell: [2.0; 2], origin: [-16.0; 2] };
    raster("halves.tif", halves, &Crs::default(), &|k| if k % 16 < 8 { 0.02 } else { 0.3 });
    let point = |k: usize| {
        let [x, y] = [origin[0] + 1.37 + 2.11 * k as f64, origin[1] + 3.41 + 1.3 * k as f64];
        format!("{x},{y},{}\n", site.grid.height(x, y).unwrap() + if k.is_multiple_of(2) { 0.6 } else { -0.4 })
    };
    write(folder, "laser.csv", &format!("x,y,z\n{}", (0..5).map(point).collect::<String>()));
    let study = STUDY.replace("[231000.0, 3766000.0]", &format!("{origin:?}"));
    write(folder, "study.toml", &study);
    (study, origin)
}

/// Input files go into the release, once for all replicates; a released study reproduces the same bytes without other files; threads and
/// shards change none.
#[test]
fn val_inputs_go_with_the_release() {
    let folder = area();
    let (_, origin) = prepare(folder.path());
    let run = |study: &str, to: &str, more: &[&str]| {
        let call = sastrugi_in(folder.path(), &[&["run", study, "-o", to, "--quiet"], more].concat());
        assert_eq!(call.code, 0, "{}", call.stderr);
    };
    let sums_of = |to: &str| sums(&folder.path().join(to));
    run("study.toml", "release", &["--threads", "1"]);
    let made = sums_of("release");
    for path in [
        "input/fine-1.tif",
        "input/fine-2.tif",
        "input/fine-3.csv",
        "input/world-1.tif",
        "terrain/fine-0002.albedo.tif",
    ] {
        assert!(made.contains_key(path), "{path} is missing from {:?}", made.keys());
    }
    assert!(!made.contains_key("input/fine-4.tif"));
    let released = fs::read_to_string(folder.path().join("release/study.toml")).unwrap();
    for place in
        ["albedo = \"input/fine-1.tif\"", "potential = \"input/fine-2.tif\"", "altimetry = \"input/fine-3.csv\""]
    {
        assert!(released.contains(place), "{released}");
    }
    assert!(released.contains("potential = \"world.rock-potential\""));
    run("study.toml", "again", &["--threads", "2", "--work", "other"]);
    assert_eq!(differing(&made, &sums_of("again")), [""; 0]);
    run("release/study.toml", "rerun", &["--work", "third"]);
    assert_eq!(differing(&made, &sums_of("rerun")), [""; 0]);
    let call = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all", "--quiet"]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    assert_eq!(differing(&made, &run_in_shards(folder.path(), "study.toml")), [""; 0]);

    // The same from the verb, which takes files.
    let heights = |path: &str| dem::read(&folder.path().join(path)).unwrap().grid;
    let spec = STUDY.split("[[terrain]]").nth(1).unwrap().replace("[231000.0, 3766000.0]", &format!("{origin:?}"));
    let spec = spec.replace("id = \"fine\"\n", "").replace("count = 2\n", "").replace("\"site\"", "\"pozo.tif\"");
    write(folder.path(), "fine.toml", &spec);
    let call = sastrugi_in(folder.path(), &["terrain", "fine.toml", "-o", "fine.tif", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    for ending in ["", ".albedo", ".class", ".rock-potential"] {
        assert_eq!(
            heights(&format!("fine{ending}.tif")),
            heights(&format!("release/terrain/fine-0001{ending}.tif")),
            "{ending}"
        );
    }

    // Rovers cross the step in the raster; the sparse half has few hazards.
    let rovers = rows(&folder.path().join("release"), "rovers");
    assert_eq!(rovers.len(), 4);
    let class = heights("release/terrain/world.class.tif");
    let share = |east: bool| {
        let g = class.geometry;
        let cells = (0..g.len()).filter(|k| (g.x(k % g.cols) > 2.0) == east && g.x(k % g.cols).abs() > 2.0);
        let all: Vec<f64> = cells.map(|k| class.values[k]).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    assert!(share(true) > 0.1 && share(false) < 0.05, "{} {}", share(true), share(false));
}

/// Errors in an input are reported with their place in the study.
#[test]
fn val_wrong_inputs_are_refused() {
    let folder = area();
    let (study, _) = prepare(folder.path());
    let refused = |from: &str, to: &str| {
        assert!(study.contains(from));
        write(folder.path(), "wrong.toml", &study.replace(from, to));
        let call = sastrugi_in(folder.path(), &["run", "wrong.toml", "-o", "wrong", "--quiet"]);
        (call.code, call.stderr)
    };
    for (from, to, code, words) in [
        ("\"bright.tif\"", "\"brihgt\"", 2, "names \"brihgt\", which is not an id that it can refer to"),
        ("\"bright.tif\"", "\"dark.tif\"", 65, "dark.tif: no such file"),
        ("\"laser.csv\"", "\"laser.txt\"", 65, "laser.txt: no such file"),
        ("world.rock-potential", "site.rock-potential", 2, "names the map `rock-potential` of \"site\""),
        ("albedo = \"bright.tif\"", "sweep.albedo = [\"bright.tif\", \"shares.tif\"]", 2, "cannot sweep over files"),
        ("image_resolution_m = 0.5", "image_resolution_m = 0.1", 2, "wider than 0.2 m"),
    ] {
        let (found, said) = refused(from, to);
        assert!(found == code && said.contains(words), "{to}: {found} {said}");
    }
    let of_verb = |set: &[&str]| {
        let base = ["terrain", "planetary", "-o", "p.tif", "--set", "size_px=[16,16]", "--set"];
        let call = sastrugi_in(folder.path(), &[&base, set].concat());
        (call.code, call.stderr)
    };
    fs::copy(sastrugi_fixtures::jacksboro(), folder.path().join("degrees.tif")).unwrap();
    for (file, words) in
        [("degrees.tif", "is in degrees"), ("pozo.tif", "holds a share of"), ("nothing.tif", "nothing.tif")]
    {
        let (code, said) = of_verb(&[&format!("processes=[{{kind=\"rocks\",potential=\"{file}\"}}]")]);
        assert!(code == 65 && said.contains(words), "{file}: {code} {said}");
    }
}

fn made(params: &Value, inputs: &[Input]) -> Terrain {
    let generator = sastrugi_terrain::prepare(elaborate::KIND, params).unwrap();
    generator.generate(&Streams::for_seed(1, "terrain"), inputs).unwrap()
}

/// On the shipped DEMs, the refined surface keeps every post and passes through points a metre away from them: lidar with posts 1 m apart on
/// slopes of 26 degrees with holes next to the window, and radar with posts 70 to 90 m apart, which are off the lattice.
#[test]
fn val_posts_of_real_dems_are_kept() {
    let pozo = pozo().grid;
    let [row, col] = corner(&pozo, 14);
    let origin = [pozo.geometry.x(col), pozo.geometry.y(row)];
    let points: Vec<[f64; 4]> = (0..5)
        .map(|k| {
            let [x, y] = [origin[0] + 1.53 + 2.0 * f64::from(k), origin[1] + 2.42 + 2.0 * f64::from(k)];
            [x, y, pozo.height(x, y).unwrap() + 1.0 - f64::from(k % 3), 0.0]
        })
        .collect();
    let params = json!({
        "dem": "site", "origin_m": origin, "size_px": [105, 105], "cell_m": 0.125, "basic_spacing_m": 0.125, "altimetry": "laser",
        "processes": [
            {"kind": "rocks", "coverage": 0.1, "diameter_min_m": 0.25},
            {"kind": "primary_craters", "diameter_min_m": 0.5, "density": 0.02}
        ]
    });
    let fine = made(&params, &[pozo.clone().into(), Input::Points(points.clone())]);
    let g = pozo.geometry;
    let mut posts = 0;
    for k in 0..g.len() {
        if let Some(z) = fine.heights.height(g.x(k % g.cols), g.y(k / g.cols)) {
            // Posts of this file lie on samples up to the last digits of its coordinates.
            assert!((z - pozo.values[k]).abs() < 1e-6, "{z} {}", pozo.values[k]);
            posts += 1;
        }
    }
    assert!(posts >= 13 * 13, "{posts}");
    for [x, y, z, _] in points {
        let error = fine.heights.height(x, y).unwrap() - z;
        assert!(error.abs() < 1e-6, "{error}");
    }

    let jacksboro = resample::geographic_to_metres(&dem::read(&sastrugi_fixtures::jacksboro()).unwrap().grid);
    let g = jacksboro.geometry;
    let params = json!({
        "dem": "site", "origin_m": [20_000.0, 20_000.0], "size_px": [500, 500], "cell_m": 1.0, "basic_spacing_m": 0.0078125,
        "altimetry_points_m": [[20_100.0, 20_250.0, jacksboro.height(20_100.0, 20_250.0).unwrap() + 3.0]]
    });
    let fine = made(&params, &[jacksboro.clone().into()]).heights;
    let (row, col) = fine.geometry.cell_at(20_100.0, 20_250.0).unwrap();
    assert!((fine.at(row, col) - jacksboro.height(20_100.0, 20_250.0).unwrap() - 3.0).abs() < 1e-6);
    let near =
        (0..g.len()).filter_map(|k| Some((fine.height(g.x(k % g.cols), g.y(k / g.cols))? - jacksboro.values[k]).abs()));
    let errors: Vec<f64> = near.collect();
    // Samples 1 m from a post differ from it by the texture in between.
    assert!(errors.len() >= 25 && errors.iter().all(|e| *e < 1.0), "{errors:?}");
}

/// A synthetic site on a slope of 1 %, with noise of 3 cm (neighbours differ by 0.3 to 0.7 m) and a tenth of its posts missing: H of its fit is
/// within 0.1 of the true one. Eight sites for each H scatter by 0.01 to 0.03 (printed), so the bound is far beyond chance.
#[test]
fn stat_hurst_survives_slope_noise_and_holes() {
    for hurst in [0.5, 0.7, 0.8] {
        let fits: Vec<TextureFit> = (0..8)
            .map(|seed| {
                let params = json!({
                    "cell_m": 10.24, "basic_spacing_m": 0.01, "size_px": [200, 200],
                    "processes": [
                        {"kind": "base_slope", "gradient": [0.008, -0.006]},
                        {"kind": "texture", "roughness_m": 0.05, "hurst": hurst}
                    ]
                });
                let site = sastrugi_terrain::prepare("planetary", &params).unwrap();
                let mut dem = site.generate(&Streams::for_seed(seed, "terrain"), &[]).unwrap().heights;
                let mut draws = Streams::for_seed(seed, "test").stream("noise and holes");
                for z in &mut dem.values {
                    *z = if draws.uniform() < 0.1 { f64::NAN } else { *z + 0.03 * draws.normal() };
                }
                elaborate::fit(&dem, None).unwrap()
            })
            .collect();
        let off: Vec<String> = fits.iter().map(|f| format!("{:+.3}", f.hurst - hurst)).collect();
        eprintln!("H = {hurst}: off by {}", off.join(", "));
        assert!(fits.iter().all(|f| (f.hurst - hurst).abs() < 0.1), "{off:?}");
    }
}
