//! What `fit` writes beside its fit file.

use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::Value;
use std::collections::BTreeMap;
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

    let png = ["first.PNG", "second.png"].map(|name| {
        assert_eq!(fit(path, &["snow.tif", "--plot", name, "-o", "other.json"]).code, 0);
        std::fs::read(path.join(name)).unwrap()
    });
    assert!(png[0].starts_with(b"\x89PNG\r\n\x1a\n") && png[0] == png[1]);

    refused(path, &["snow.tif", "--plot", "plot.pdf", "-o", "refused.json"], ".svg or .png");
    refused(path, &["snow.tif", "--plot", "plot", "-o", "refused.json"], ".svg or .png");
    write(path, "mask.svg", "");
    for same in ["refused.svg", "mask.svg"] {
        let arguments = ["snow.tif", "--exclude", "mask.svg", "--plot", same, "-o", "refused.svg"];
        refused(path, &arguments, "is also an input or another output");
    }
}

#[test]
fn val_bins_are_flat_and_those_of_the_fit_file() {
    let folder = site();
    let path = folder.path();
    assert_eq!(fit(path, &["snow.tif", "--csv", "bins.csv", "-o", "fit.json"]).code, 0);
    let fit_file: Value = serde_json::from_str(&text(path, "fit.json")).unwrap();
    let bins = text(path, "bins.csv");
    let mut lines = bins.lines();
    let header = "kind,lag_m,azimuth_deg,covariance_m2,pairs,model_m2,surface_model_m2";
    assert_eq!(lines.next(), Some(header));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 7));
    let number = |text: &str| text.parse::<f64>().unwrap();
    let (rings, directions): (Vec<_>, Vec<_>) = rows.iter().partition(|row| row[0] == "ring");
    assert!(rings.len() > 3 && directions.len() > 3, "{bins}");
    for (name, column) in [("lags_m", 1), ("covariance_m2", 3), ("pairs", 4), ("model_m2", 5), ("surface_model_m2", 6)]
    {
        let stated: Vec<f64> = fit_file[name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        assert_eq!(rings.iter().map(|row| number(row[column])).collect::<Vec<_>>(), stated, "{name}");
    }
    let stated = fit_file["directions"].as_array().unwrap();
    assert_eq!(directions.len(), stated.len());
    for (row, bin) in directions.iter().zip(stated) {
        assert_eq!([number(row[1]), number(row[2])], ["lag_m", "azimuth_deg"].map(|k| bin[k].as_f64().unwrap()));
        assert!(row[0] == "direction" && row[6].is_empty());
    }
    refused(path, &["snow.tif", "--csv", "bins.txt", "-o", "refused.json"], ".csv");
    refused(path, &["snow.tif", "--csv", "refused.csv", "-o", "refused.csv"], "is also an input or another output");
}

/// Rows of a table as CSV, by the names of the columns. Commas within quotes stay.
pub fn table(folder: &Path, name: &str) -> Vec<BTreeMap<String, String>> {
    let text = text(folder, name);
    let cells = |line: &str| {
        let mut quoted = false;
        let comma = |c: char| {
            quoted ^= c == '"';
            c == ',' && !quoted
        };
        line.split(comma).map(str::to_owned).collect::<Vec<_>>()
    };
    let mut lines = text.lines().map(cells);
    let header = lines.next().unwrap();
    lines.map(|row| header.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn val_several_dems_make_one_table() {
    let folder = site();
    let path = folder.path();
    snow(path, "april.tif", "2");
    let arguments = ["snow.tif", "april.tif", "--table", "season.csv", "-o", "fits"];
    let call = fit(path, &arguments);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let rows = table(path, "season.csv");
    assert_eq!(rows.iter().map(|row| row["file"].as_str()).collect::<Vec<_>>(), ["april.tif", "snow.tif"]);
    for (row, name) in rows.iter().zip(["april", "snow"]) {
        let fit_file: Value = serde_json::from_str(&text(path, &format!("fits/{name}.json"))).unwrap();
        assert_eq!(row["fit_id"], name);
        assert_eq!(row["sigma_m"].parse::<f64>().ok(), fit_file["parameters"]["sigma_m"].as_f64());
        assert!(row["error"].is_empty() && row.contains_key("sigma2_over_range_high_m"));
    }
    // The fit of each is the one it has alone.
    assert_eq!(fit(path, &["snow.tif", "-o", "alone.json"]).code, 0);
    assert_eq!(text(path, "alone.json"), text(path, "fits/snow.json"));

    // The same as Parquet, read by another path of the program; without -o there are no fit files.
    assert_eq!(fit(path, &["snow.tif", "april.tif", "--table", "season.parquet"]).code, 0);
    let info = sastrugi_in(path, &["info", "season.parquet"]);
    assert!(info.code == 0 && info.stdout.contains("dem_fits"), "{}{}", info.stdout, info.stderr);
    assert!(!path.join("snow.json").exists());
}

/// A range at the bound of the search is not an estimate: printed alone and in a table it is a lower limit of the profile, or, where the model
/// misfits and blocks know no end, not identified; sigma^2 / b has its interval.
#[test]
fn val_a_range_at_the_bound_is_no_estimate() {
    let folder = area();
    let path = folder.path();
    write(path, "long.json", &FIT.replace("0.3", "50"));
    let call = ["texture", "long.json", "--size", "30x30", "--cell", "0.1", "--phase", "gaussian", "--seed", "4"];
    assert_eq!(sastrugi_in(path, &[&call[..], &["--set", "periodic=false", "-o", "long.tif"]].concat()).code, 0);
    let call = ["terrain", "multifractal", "--set", "size_px=[300,300]", "--set", "cell_m=0.1", "-o", "rough.tif"];
    assert_eq!(sastrugi_in(path, &call).code, 0);
    let options = ["--outer-scale", "1.5", "--bootstrap", "39", "--quiet"];
    let fit = |more: &[&str]| sastrugi_in(path, &[&["fit"], more, &options].concat()).stdout;
    let table = fit(&["long.tif", "rough.tif", "--table", "t.csv"]);
    let line = |name: &str| table.lines().find(|line| line.starts_with(name)).unwrap().to_owned();
    let (long, rough) = (line("long.tif"), line("rough.tif"));
    assert!(long.matches("at least").count() == 2 && long.ends_with("95 %, profile likelihood"), "{long}");
    assert!(rough.matches("not identified").count() == 2 && rough.contains("block bootstrap"), "{rough}");
    let alone = fit(&["rough.tif", "-o", "rough.json"]);
    assert!(alone.contains("range_m not identified (") && alone.contains("sigma^2/b_m = 0.00"), "{alone}");
    assert!(!alone.contains("profile likelihood"), "{alone}");
    let alone = fit(&["long.tif", "-o", "long.fit.json"]);
    assert!(alone.contains("range_m at least ") && alone.contains("(95 %, profile likelihood)"), "{alone}");
}

#[test]
fn val_one_failing_dem_does_not_lose_the_others() {
    let folder = site();
    let path = folder.path();
    write(path, "broken.tif", "no raster");
    let call = fit(path, &["broken.tif", "snow.tif", "--table", "some.csv"]);
    assert_eq!(call.code, 3, "{}", call.stderr);
    assert!(call.stderr.contains("broken.tif"), "{}", call.stderr);
    let rows = table(path, "some.csv");
    assert!(rows[0]["error"].contains("broken.tif") && rows[0]["sigma_m"].is_empty() && rows[0]["ratio"].is_empty());
    assert!(rows[1]["error"].is_empty() && rows[1]["sigma_m"].parse::<f64>().is_ok());

    let call = fit(path, &["broken.tif", "absent.tif", "--table", "none.csv"]);
    assert_eq!(call.code, 1, "{}", call.stderr);
    let rows = table(path, "none.csv");
    assert!(
        rows.len() == 2 && rows.iter().all(|row| !row["error"].is_empty() && row["sigma_m"].is_empty()),
        "{rows:?}"
    );
}

#[test]
fn val_tables_that_would_replace_a_file_are_refused() {
    let folder = site();
    let path = folder.path();
    let dem = std::fs::read(path.join("snow.tif")).unwrap();
    snow(path, "april.tif", "2");
    std::fs::create_dir(path.join("other")).unwrap();
    std::fs::write(path.join("other/snow.tif"), &dem).unwrap();
    for (arguments, words) in [
        (&["snow.tif", "april.tif", "--table", "t.txt"][..], ".parquet or .csv"),
        (&["snow.tif", "april.tif", "--table", "t.csv", "--map", "m.tif"], "`--map` works with one DEM only"),
        (&["snow.tif", "april.tif", "--table", "t.csv", "--plot", "p.svg"], "`--plot` works with one DEM only"),
        (&["snow.tif", "snow.tif", "--table", "t.csv"], "given twice"),
        (&["snow.tif", "other/snow.tif", "--table", "t.csv", "-o", "fits"], "would both be written to"),
        (&["snow.tif", "april.tif", "--table", "t.csv", "--outer-scale", "-1"], "outer_scale_m"),
        (&["snow.tif", "april.tif"], "--output"),
    ] {
        let call = match arguments.contains(&"-1") {
            true => sastrugi_in(path, &[&["fit"], arguments].concat()),
            false => fit(path, arguments),
        };
        assert!(call.code == 2 && call.stderr.contains(words), "{arguments:?}: {} {}", call.code, call.stderr);
        assert!(!path.join("t.csv").exists() && !path.join("fits").exists());
    }
    // Fit files of several DEMs go into a folder: a file of that name is refused before any fit.
    write(path, "taken", "kept");
    let call = fit(path, &["snow.tif", "april.tif", "--table", "t.csv", "-o", "taken"]);
    assert!(
        call.code == 2 && call.stderr.contains("taken is a file; for several DEMs, `-o` must be a folder"),
        "{}",
        call.stderr
    );
    assert!(text(path, "taken") == "kept" && !path.join("t.csv").exists());
    // A mask's name is an input as well.
    write(path, "plot.csv", "");
    let call = fit(path, &["snow.tif", "april.tif", "--exclude", "plot.csv", "--table", "plot.csv"]);
    assert!(call.code != 0 && text(path, "plot.csv").is_empty(), "{}", call.stderr);
}

/// Maps that a fit cannot have are refused before it is made: a plane, which has no fit, is not looked at.
#[test]
fn val_maps_are_checked_before_the_fit() {
    let folder = site();
    let path = folder.path();
    let row = |r: usize| (0..120).map(|c| (c + 2 * r).to_string()).collect::<Vec<_>>().join(" ");
    let rows: Vec<String> = (0..120).map(row).collect();
    let head = "ncols 120\nnrows 120\nxllcorner 0\nyllcorner 0\ncellsize 0.1\nnodata_value -9999\n";
    write(path, "plane.asc", &format!("{head}{}\n", rows.join("\n")));
    let call = fit(path, &["plane.asc", "--local", "m", "--local-block", "3", "-o", "refused.json"]);
    let plane = "the DEM is flat or a plane: its residual is below rounding error";
    assert!(call.code == 65 && call.stderr.contains(plane), "{}", call.stderr);
    for (more, words) in [
        (&["--local-block", "2.9"][..], "`--local-block` is 2.9 m; blocks must be at least two windows (3 m)"),
        (&["--local-block", "nan"], "`--local-block`"),
        (&["--mode", "paper"], "`--local` requires mode `corrected`"),
    ] {
        refused(path, &[&["plane.asc", "--local", "m", "-o", "refused.json"], more].concat(), words);
    }
    let lines: String = (0..99).map(|k| format!("{k},{}\n", k % 2)).collect();
    write(path, "lines.csv", &format!("x,a\n{lines}"));
    refused(path, &["lines.csv", "--local", "m", "-o", "refused.json"], "`--local` requires a raster, not transects");
}

/// A site whose eastern half is twice as rough: the maps lie where the DEM lies and show it. Sigma of a block has a standard error of about
/// 1.5 % here, which leaves the bounds to the halves themselves.
#[test]
fn val_local_maps_show_where_a_site_is_rougher() {
    let folder = site();
    let path = folder.path();
    assert_eq!(sastrugi_in(path, &["convert", "snow.tif", "snow.asc"]).code, 0);
    let doubled = |line: &str| -> String {
        let cells: Vec<&str> = line.split_whitespace().collect();
        let height = |(k, z): (usize, &&str)| match k < cells.len() / 2 {
            true => (*z).to_owned(),
            false => (2.0 * z.parse::<f64>().unwrap()).to_string(),
        };
        cells.iter().enumerate().map(height).collect::<Vec<_>>().join(" ")
    };
    let heights = text(path, "snow.asc");
    let lines =
        heights.lines().map(|line| if line.split_whitespace().count() > 2 { doubled(line) } else { line.to_owned() });
    write(path, "site.asc", &lines.collect::<Vec<_>>().join("\n"));
    let call = fit(path, &["site.asc", "--local", "maps/site", "--local-block", "4", "-o", "fit.json"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    assert!(call.stdout.contains("3 x 3 blocks of 4 x 4 m, 9 with data"), "{}", call.stdout);
    for (name, factor) in [("band-rms", 2.0), ("sigma", 2.0), ("sigma2-over-b", 4.0)] {
        let file = format!("maps/site.{name}.tif");
        assert_eq!(sastrugi_in(path, &["convert", &file, "map.asc"]).code, 0, "{name}");
        let map = text(path, "map.asc");
        let rows: Vec<Vec<f64>> = map
            .lines()
            .filter(|line| line.split_whitespace().count() == 3)
            .map(|line| line.split_whitespace().map(|v| v.parse().unwrap()).collect())
            .collect();
        assert_eq!(rows.len(), 3, "{map}");
        let mean = |column: usize| rows.iter().map(|row| row[column]).sum::<f64>() / 3.0;
        let ratio = mean(2) / mean(0);
        assert!((ratio / factor - 1.0).abs() < 0.1 * factor, "{name}: {ratio}");
    }
    for (arguments, words) in [
        (&["site.asc", "--local", "refused", "--local-block", "1", "-o", "refused.json"][..], "`--local-block` is 1 m"),
        (&["site.asc", "--local", "refused", "--local-block", "20", "-o", "refused.json"], "at most the DEM (12 m)"),
        (&["site.asc", "--local-block", "4", "-o", "refused.json"], "--local"),
        (&["site.asc", "--local", "refused", "--mode", "paper", "-o", "refused.json"], "corrected"),
        (
            &["site.asc", "--local", "x", "--map", "x.sigma.tif", "-o", "refused.json"],
            "is also an input or another output",
        ),
        (&["site.asc", "snow.tif", "--local", "x", "--table", "t.csv"], "`--local` works with one DEM only"),
    ] {
        refused(path, arguments, words);
    }
}
