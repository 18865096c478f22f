//! Studies that recover heights from images: a measured DEM under three suns, its recovered surface, comparison and fit.

use sastrugi_stages::verbs::{self, Reading};
use sastrugi_tests::{Row, area, differing, rows, run_in_shards, run_study, run_with_kills, sastrugi_in, sums, write};
use serde_json::Value;

/// Jacksboro, with cells four times finer than the pixels; the sun is steeper than its slopes.
fn study() -> String {
    format!(
        r#"
[study]
name = "heights-from-images"
seed = 5
date = "2026-01-01"

[[dem]]
id = "site"
file = "{}"

[[image]]
id = "suns"
surface = "site"
camera = {{ kind = "nadir", pixel_m = 360.0 }}
samples = 4
noise = {{ relative = 0.002 }}
sun = {{ elevation_deg = 45.0 }}
sweep."sun.azimuth_deg" = [0.0, 120.0, 240.0]

[[photoclinometry]]
id = "recovered"
images = ["suns"]
samples = 16
sweep."first_image_errors.exposure" = [0.0, 0.05]

[[photoclinometry]]
id = "held"
images = ["suns"]
samples = 0
coarse = "site"
coarse_sigma_m = 20.0

[[photoclinometry]]
id = "misled"
images = ["suns"]
samples = 0
altimetry = "laser.csv"
photometry = {{ lambert = 1.0, lommel_seeliger = 0.0 }}
first_image_errors = {{ sun_azimuth_deg = 20.0, sun_elevation_deg = 5.0 }}

[[photoclinometry]]
id = "misplaced"
images = ["suns"]
samples = 0
sweep."first_image_errors.shift_east_m" = [90.0, 360.0]

[[fit]]
id = "of-recovered"
dem = "held"
outer_scale_m = 4000.0
bootstrap = 0

[[fit]]
id = "of-truth"
dem = "site"
outer_scale_m = 4000.0
bootstrap = 0
"#,
        sastrugi_fixtures::jacksboro().display()
    )
}

/// Four heights in the middle of the site, by bilinear interpolation; sigma 1 m.
fn laser() -> String {
    let heights = verbs::read(&sastrugi_fixtures::jacksboro(), &Reading::default()).unwrap().dem.grid;
    let g = heights.geometry;
    let line = |(u, v): (f64, f64)| {
        let (x, y) = (g.origin[0] + u * g.size()[0], g.origin[1] + v * g.size()[1]);
        let z = sastrugi_numeric::Surface::height(&heights, x, y).unwrap();
        format!("{x},{y},{z},1.0\n")
    };
    let lines: String = [(0.3, 0.3), (0.7, 0.35), (0.4, 0.7), (0.6, 0.6)].into_iter().map(line).collect();
    format!("x,y,z,sigma\n{lines}")
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].as_f64().or(row[column].as_i64().map(|n| n as f64)).unwrap_or(f64::NAN)
}

/// A folder with the points of the study.
fn area_with_points() -> tempfile::TempDir {
    let folder = area();
    write(folder.path(), "laser.csv", &laser());
    folder
}

/// Files, rows and errors. Without image errors, the shading of the recovered surface correlates as well as that of the averaged truth, within 0.02, and its
/// slope errors are those of the averaged truth, within 15 %. Long waves are recovered coherently. An exposure error of 5 % tilts the surface, and the coarse
/// DEM prevents it. The same study fits the recovered surface.
#[test]
fn val_a_study_recovers_a_measured_surface() {
    let folder = area_with_points();
    let files = run_study(folder.path(), &study(), &[]);
    let release = folder.path().join("release");
    let table = rows(&release, "photoclinometry");
    let of = |id: &str| table.iter().find(|row| row["photoclinometry_id"] == id).unwrap();
    let ids: Vec<String> = table.iter().map(|row| row["photoclinometry_id"].as_str().unwrap().to_owned()).collect();
    println!("{ids:?}");
    let plain =
        table.iter().find(|r| r["item_id"] == "recovered" && r["variant"].as_str().unwrap().ends_with("0")).unwrap();
    let wrong =
        table.iter().find(|r| r["item_id"] == "recovered" && r["variant"].as_str().unwrap().ends_with("0.05")).unwrap();
    for row in &table {
        println!("{row:?}");
        let id = row["photoclinometry_id"].as_str().unwrap();
        for ending in
            ["tif", "albedo.tif", "lit.tif", "slope-sigma.tif", "albedo-sigma.tif", "condition.tif", "leaning.tif"]
        {
            assert!(files.contains_key(&format!("photoclinometry/{id}.{ending}")), "{id}.{ending}");
        }
        let sampled = row["item_id"] == "recovered";
        assert_eq!(files.contains_key(&format!("photoclinometry/{id}.uncertainty.tif")), sampled);
        assert_eq!(number(row, "height_sigma_m").is_finite(), sampled);
        assert_eq!(number(row, "images"), 3.0);
    }
    let gap = number(plain, "shaded_correlation_ceiling") - number(plain, "shaded_correlation");
    assert!(gap.abs() < 0.02, "{gap}");
    assert!(number(plain, "slope_error_rms") < 1.15 * number(plain, "slope_error_rms_ceiling"));
    assert!(number(plain, "height_error_rms_detrended_m") < 0.2 * number(plain, "height_rms_m"));
    assert!(number(wrong, "height_error_rms_m") > 3.0 * number(plain, "height_error_rms_m"));
    // The ceiling depends only on the truth, whatever sun and photometric law the inversion assumes.
    for column in ["shaded_correlation_ceiling", "slope_error_rms_ceiling"] {
        assert_eq!(number(of("misled"), column), number(plain, column), "{column}");
    }
    assert!(number(of("misled"), "slope_error_rms") > 1.05 * number(plain, "slope_error_rms"));
    // A misplaced image degrades the shading, not the heights: a quarter of a pixel little, one pixel much.
    let shaded = [plain, of("misplaced-90.0"), of("misplaced-360.0")].map(|row| number(row, "shaded_correlation"));
    assert!(shaded[0] > shaded[1] && shaded[1] > shaded[2] + 0.01, "{shaded:?}");
    assert!(files.contains_key("input/misled-altimetry.csv"));
    assert!(number(of("held"), "height_error_rms_m") < number(plain, "height_error_rms_m"));
    let bands = rows(&release, "photoclinometry_bands");
    let own: Vec<&Row> = bands.iter().filter(|r| r["photoclinometry_id"] == "held").collect();
    own.iter().for_each(|row| println!("{row:?}"));
    let longest = own.iter().max_by(|a, b| number(a, "octave").total_cmp(&number(b, "octave"))).unwrap();
    assert!(own.len() >= 4 && number(longest, "coherence") > 0.95);
    assert_eq!(rows(&release, "fits").len(), 2);
    assert!(rows(&release, "terrains").iter().any(|row| row["terrain_id"] == "held"));
    let call = sastrugi_in(folder.path(), &["verify", "release", "--recompute", "all"]);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// The report names the wavelengths at which the recovered surface has the truth's texture: without image errors, all but the shortest octave, 720 to 1440 m,
/// where relief within the pixels is lost. Both fits are compared: over lags the recovered covariance is within 15 % of the truth's, and the band RMS below the
/// window is that of the table of fits, 85 to 100 % of the truth's. Maps show the surfaces with the smallest and the largest slope error.
#[test]
fn val_the_report_compares_recovered_and_truth() {
    let folder = area_with_points();
    let files = run_study(folder.path(), &study(), &[]);
    let release = folder.path().join("release");
    let page = std::fs::read_to_string(release.join("report/index.html")).unwrap();
    let section = page.split("<section id=\"photoclinometry\">").nth(1).unwrap().split("</section>").next().unwrap();
    let verdict = section.split("recovered-0.0: ").nth(1).unwrap().split("recovered-0.05: ").next().unwrap();
    println!("{verdict}");
    assert!(verdict.contains("not at 720 to 1440 m (RMS height 8"), "{verdict}");
    let data = |name: &str| -> Vec<Vec<Value>> {
        let text = std::fs::read_to_string(release.join(format!("report/data/{name}.json"))).unwrap();
        let json: Value = serde_json::from_str(&text).unwrap();
        serde_json::from_value(json["rows"].clone()).unwrap()
    };
    let compared = data("photoclinometry-covariance");
    println!("{compared:?}");
    let fits = rows(&release, "fits");
    let band = |id: &str| number(fits.iter().find(|r| r["fit_id"] == id).unwrap(), "band_rms_m");
    let (ratio, difference) = (compared[0][10].as_f64().unwrap(), compared[0][12].as_f64().unwrap());
    assert!(
        (ratio - band("of-recovered") / band("of-truth")).abs() < 1e-12 && (0.85..=1.0).contains(&ratio),
        "{ratio}"
    );
    assert!(difference > 0.0 && difference < 15.0, "{difference}");
    assert!(compared[0][11].as_f64().unwrap() >= 4.0, "{compared:?}");
    for id in ["held", "recovered-0.0", "recovered-0.05"] {
        let maps = ["truth", "heights", "error", "albedo", "lit"];
        maps.iter().for_each(|map| {
            assert!(files.contains_key(&format!("report/figures/photoclinometry-{map}-{id}.svg")), "{map} {id}")
        });
        assert_eq!(files.contains_key(&format!("report/figures/photoclinometry-uncertainty-{id}.svg")), id != "held");
    }
    // The wrong exposure tilts the surface, and the page states it.
    let wrong = section.split("recovered-0.05: ").nth(1).unwrap();
    assert!(wrong.contains("most of it is a tilt"), "{wrong}");
    let sweep = data("photoclinometry-sweep-heights-recovered-site");
    let table = rows(&release, "photoclinometry");
    let errors: Vec<f64> =
        table.iter().filter(|r| r["item_id"] == "recovered").map(|r| number(r, "height_error_rms_m")).collect();
    let drawn: Vec<f64> = sweep.iter().map(|row| row[2].as_f64().unwrap()).collect();
    assert_eq!(drawn, errors);
}

/// The same bytes with one thread and with three, in two shards and after kills.
#[test]
fn prop_a_recovered_surface_has_the_same_bytes() {
    let [one, three] =
        ["1", "3"].map(|threads| run_study(area_with_points().path(), &study(), &["--threads", threads]));
    assert_eq!(differing(&one, &three), Vec::<String>::new());
    let shards = area_with_points();
    write(shards.path(), "study.toml", &study());
    assert_eq!(differing(&one, &run_in_shards(shards.path(), "study.toml")), Vec::<String>::new());
    let killed = run_with_kills(area_with_points().path(), &study(), &one, &[100, 400, 900, 1500]);
    assert_eq!(differing(&one, &killed), Vec::<String>::new());
}

/// The verb reads the images of a release, prints every round, and writes heights with their maps; invalid files are refused with the reason.
#[test]
fn val_the_verb_recovers_from_files() {
    let folder = area_with_points();
    run_study(folder.path(), &study(), &[]);
    let mut images: Vec<String> = sums(&folder.path().join("release"))
        .into_keys()
        .filter(|path| path.starts_with("image/") && path.ends_with(".json"))
        .map(|path| format!("\"release/{path}\""))
        .collect();
    images.sort();
    let list = |images: &[String]| format!("images = [{}]\n", images.join(", "));
    write(
        folder.path(),
        "images.toml",
        &format!("{}truth = \"release/dem/site.metric.tif\"\n[settings]\nsamples = 8\n", list(&images)),
    );
    let arguments = ["photoclinometry", "images.toml", "-o", "dem.tif"];
    let call = sastrugi_in(folder.path(), &arguments);
    assert_eq!(call.code, 0, "{}", call.stderr);
    println!("{}", call.stdout);
    assert!(call.stdout.contains("brightness RMS") && call.stdout.contains("against the truth"), "{}", call.stdout);
    for file in ["dem.tif", "dem.albedo.tif", "dem.uncertainty.tif", "dem.lit.tif"] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
    write(folder.path(), "two.toml", &list(&images[..2]));
    let refused = |arguments: &[&str]| {
        let call = sastrugi_in(folder.path(), &[&["photoclinometry"], arguments, &["-o", "no.tif"]].concat());
        assert!(!folder.path().join("no.tif").exists());
        (call.code, call.stderr)
    };
    let (code, words) = refused(&["two.toml"]);
    assert!(code == 2 && words.contains("at least 3"), "{code} {words}");
    let (code, words) = refused(&["images.toml", "--set", "rounds=99"]);
    assert!(code == 2 && words.contains("rounds"), "{code} {words}");
    let (code, words) = refused(&["images.toml", "--set", "roundz=9"]);
    assert!(code == 2 && words.contains("rounds"), "{code} {words}");
    let with = |line: &str| format!("{line}\n{}", list(&images));
    write(folder.path(), "exact.csv", "x,y,z\n1,2,3\n");
    write(folder.path(), "exact.toml", &with("altimetry = \"exact.csv\""));
    let (code, words) = refused(&["exact.toml"]);
    assert!(code == 65 && words.contains("exact.csv") && words.contains("`sigma` above 0"), "{code} {words}");
    let (code, words) = refused(&["images.toml", "--set", "condition_max=1.5"]);
    assert!(code == 65 && words.contains("condition number below 1.5"), "{code} {words}");
    write(folder.path(), "missing.toml", "images = [\"a.json\", \"b.json\", \"c.json\"]\n");
    let (code, words) = refused(&["missing.toml"]);
    assert!(code == 65 && words.contains("a.json"), "{code} {words}");
}

/// Invalid items are refused before anything runs, with their line.
#[test]
fn val_wrong_items_are_refused() {
    let folder = area_with_points();
    for (before, after, words) in [
        ("[0.0, 120.0, 240.0]", "[0.0, 120.0]", "at least 3 are needed"),
        ("images = [\"suns\"]\nsamples = 16", "images = [\"sun\"]\nsamples = 16", "did you mean"),
        ("coarse_sigma_m = 20.0", "coarse_sigma_m = 0.0", "above 0"),
        ("[0.0, 120.0, 240.0]", "[0.0, 0.01, 180.0]", "the suns lie in one plane"),
        ("sun_azimuth_deg = 20.0, sun_elevation_deg = 5.0", "sun_azimuth_deg = 120.0", "the suns lie in one plane"),
        ("altimetry = \"laser.csv\"", "altimetry = \"lazer.csv\"", "lazer.csv"),
        ("coarse_sigma_m = 20.0", "", "needs `coarse_sigma_m`"),
        ("samples = 0", "sample = 0", "samples"),
        ("dem = \"held\"", "dem = \"hold\"", "did you mean"),
    ] {
        let changed = study().replacen(before, after, 1);
        assert_ne!(changed, study());
        write(folder.path(), "study.toml", &changed);
        let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
        let told: String = call.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        let code = if words == "lazer.csv" { 65 } else { 2 };
        assert!(call.code == code && told.contains(words), "{after}: {} {}", call.code, call.stderr);
        let call = sastrugi_in(folder.path(), &["plan", "study.toml", "-o", "release"]);
        assert_eq!(call.code, code, "{after}: {}", call.stderr);
    }
}
