//! Pages on heights from images.

use super::made_up::{self, Shelf};
use super::{assert_sound, report, rows};
use crate::data::Data;
use sastrugi_numeric::resample::block_means;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::tables::{FitRow, PhotoclinometryBandRow, PhotoclinometryRow};
use serde_json::Value;

/// Tilt of the recovered surface, m per metre east.
const TILT: f64 = 0.25;

fn near(cell: &Value, expected: f64) -> bool {
    cell.as_f64().is_some_and(|v| (v - expected).abs() <= 1e-9 * expected.abs().max(1.0))
}

/// A truth of 64 x 64 cells of 1 m; the truth on cells of 2 m, tilted; its albedo, uncertainty and lit images.
fn shelf(ids: &[&str]) -> Shelf {
    let truth = Geometry::square(64, 64, 1.0);
    let height = |k: usize| libm::sin(truth.x(k % 64) / 3.0) + libm::cos(truth.y(k / 64) / 5.0);
    let truth = Grid::new(truth, (0..64 * 64).map(height).collect());
    let coarse = block_means(&truth, 2);
    let g = coarse.geometry;
    let tilted = Grid::new(g, (0..g.len()).map(|k| coarse.values[k] + TILT * g.x(k % g.cols)).collect());
    let mut shelf = Shelf::default();
    for id in ids {
        let maps = [
            ("tif", tilted.clone()),
            ("albedo.tif", coarse.map(|z| 0.2 + 0.01 * z)),
            ("uncertainty.tif", coarse.map(|z| 0.02 + 0.001 * z * z)),
        ];
        maps.into_iter()
            .for_each(|(ending, grid)| drop(shelf.grids.insert(format!("photoclinometry/{id}.{ending}"), grid)));
        let lit = Grid::new(g, (0..g.len()).map(|k| if k % g.cols < 8 { 2.0 } else { 3.0 }).collect());
        shelf.grids.insert(format!("photoclinometry/{id}.lit.tif"), lit);
    }
    shelf.grids.insert("terrain/hills.albedo.tif".into(), truth.map(|z| 0.2 + 0.01 * z));
    shelf.grids.insert("terrain/hills.tif".into(), truth);
    shelf
}

fn row(id: &str, variant: Option<&str>, slope_error_rms: f64) -> PhotoclinometryRow {
    PhotoclinometryRow {
        photoclinometry_id: id.into(),
        item_id: "recovered".into(),
        variant: variant.map(str::to_owned),
        group: None,
        surface_id: "hills".into(),
        images: 3,
        rows: 32,
        cols: 32,
        cell_m: 2.0,
        rounds: 2,
        converged: true,
        brightness_rms: 0.01,
        change_m: 0.0,
        stereo_points: 0,
        lit_mean: 2.75,
        share_leaning: 0.02,
        condition: 2.2,
        albedo_slope_correlation: 0.2,
        noise_scale: 1.0,
        height_sigma_m: 0.015,
        albedo_mean: 0.2,
        cells: Some(1024),
        shaded_correlation: 0.91,
        shaded_correlation_ceiling: 0.93,
        slope_error_rms,
        slope_error_rms_ceiling: 0.02,
        slope_rms: 0.3,
        height_error_rms_m: 4.0,
        height_error_rms_detrended_m: 0.05,
        height_rms_m: 1.0,
        path: format!("photoclinometry/{id}.tif"),
    }
}

/// Octaves from 4 m upwards: truth, recovered and coherence of each; slopes fall by half with each octave.
fn bands(id: &str, octaves: &[(f64, f64, f64)]) -> Vec<PhotoclinometryBandRow> {
    let band = |(k, &(truth, recovered, coherence)): (usize, &(f64, f64, f64))| {
        let octave = (1u64 << k) as f64;
        PhotoclinometryBandRow {
            photoclinometry_id: id.into(),
            octave: k as i64,
            wavelength_min_m: 4.0 * octave,
            wavelength_max_m: 8.0 * octave,
            modes: 100 >> k,
            truth_rms_m: truth,
            recovered_rms_m: recovered,
            truth_slope_rms: truth / octave,
            recovered_slope_rms: recovered / octave,
            covariance_m2: truth * recovered * coherence.sqrt(),
            coherence,
        }
    };
    octaves.iter().enumerate().map(band).collect()
}

/// A release with these surfaces recovered from images of hills.
fn release(surfaces: Vec<(PhotoclinometryRow, Vec<PhotoclinometryBandRow>)>) -> Data {
    let ids: Vec<&str> = surfaces.iter().map(|s| s.0.photoclinometry_id.as_str()).collect();
    let shelf = shelf(&ids);
    let mut data = made_up::empty();
    data.terrains.push(made_up::row("hills", "terrain", "terrain/hills.tif", &shelf.grids["terrain/hills.tif"]));
    for (row, bands) in surfaces {
        data.photoclinometry.push(row);
        data.photoclinometry_bands.extend(bands);
    }
    data.files = Box::new(shelf);
    data
}

const OCTAVES: [(f64, f64, f64); 3] = [(1.0, 0.7, 0.8), (1.0, 1.05, 0.95), (2.0, 2.0, 0.99)];

/// The verdict names the wavelengths at which the texture matches the truth: the first octave has 30 % too little height, the others are within 5 %. Over all
/// of them, heights have sqrt((0.49 + 1.1025 + 4) / 6) = 96.5 % of the truth's RMS, slopes sqrt((0.49 + 0.275625 + 0.25) / 1.5) = 82.3 %. An error of 4 m that
/// falls to 0.05 m after subtracting the plane is called a tilt, and exceeds three times the uncertainty.
#[test]
fn val_the_verdict_names_wavelengths() {
    let (files, summary) = report(&release(vec![(row("recovered", None, 0.05), bands("recovered", &OCTAVES))]));
    assert_sound(&files);
    let page = &files["index.html"];
    for words in [
        "<section id=\"photoclinometry\">",
        "coherent with it, at 8 to 32 m, but not at 4 to 8 m (RMS height 70 %, RMS slope 70 % of the truth&#39;s, squared coherence 0.80)",
        "the RMS height is 97 % of the truth&#39;s, the RMS slope 82 %",
        "The RMS height error is 4.00 m, for a true RMS height of 1.00 m; most of it is a tilt: 0.0500 m remain after subtracting the plane.",
        "recovered: height errors exceed three times the uncertainty",
        "1 surface was recovered from images. recovered: RMS height and slope within",
    ] {
        let plain = words.replace("&#39;", "'");
        assert!(page.contains(words) || page.contains(&plain), "{words}");
    }
    assert!(!page.contains("did not converge") && !page.contains("barely separate"));
    for figure in [
        "photoclinometry-heights-by-wavelength-1",
        "photoclinometry-slopes-by-wavelength-1",
        "photoclinometry-coherence-1",
        "photoclinometry-truth-recovered",
        "photoclinometry-heights-recovered",
        "photoclinometry-error-recovered",
        "photoclinometry-true-albedo-recovered",
        "photoclinometry-albedo-recovered",
        "photoclinometry-uncertainty-recovered",
        "photoclinometry-lit-recovered",
        "summary-photoclinometry-truth-recovered",
        "summary-photoclinometry-heights-recovered",
    ] {
        assert!(summary.figures.iter().any(|f| f == figure), "{figure} of {:?}", summary.figures);
    }
    let slopes = rows(&files, "photoclinometry-slopes-by-wavelength-1");
    assert!(near(&slopes[1][3], 0.5) && near(&slopes[1][4], 0.525), "{slopes:?}");
}

/// The error map is recovered minus true heights on the cells of the map, minus the mean: the tilt from edge to edge, 31 cells of 2 m. Both reliefs have the
/// colours of the truth.
#[test]
fn val_errors_are_mapped_on_the_cells() {
    let files = report(&release(vec![(row("recovered", None, 0.05), bands("recovered", &OCTAVES))])).0;
    let error = &rows(&files, "photoclinometry-error-recovered")[0];
    let half = 0.5 * 31.0 * 2.0 * TILT;
    assert_eq!((error[1].as_u64(), error[2].as_u64()), (Some(32), Some(32)));
    assert!(
        (error[5].as_f64().unwrap() + half).abs() < 1e-6 && (error[6].as_f64().unwrap() - half).abs() < 1e-6,
        "{error:?}"
    );
    let truth = &rows(&files, "photoclinometry-truth-recovered")[0];
    assert_eq!((truth[1].as_u64(), truth[3].as_f64()), (Some(32), Some(2.0)));
    let ends = |name: &str| {
        let svg = &files[&format!("figures/photoclinometry-{name}-recovered.svg")];
        let texts: Vec<&str> = svg.split("</text>").filter_map(|t| t.rsplit('>').next()).collect();
        let title = texts.iter().position(|t| *t == "height, m").unwrap();
        [texts[title - 2].to_owned(), texts[title - 1].to_owned()]
    };
    assert_eq!(ends("truth"), ends("heights"));
    // A quarter of the columns is lit by two of three images.
    assert!(files["index.html"].contains("25.0 % of the cells that are lit at all are lit in fewer than three"));
}

/// A sweep is drawn against its swept value, in order; of many surfaces, the best and the worst of the item are mapped.
#[test]
fn val_sweeps_are_drawn_and_mapped_at_their_ends() {
    let value = |k: usize| [0.0, 0.02, 0.04, 0.1][k];
    let one = |k: usize| {
        let id = format!("recovered-{}", value(k));
        let mut row = row(&id, Some(&format!("first_image_errors.exposure = {}", value(k))), 0.03 + value(k));
        row.converged = k < 3;
        row.change_m = if k < 3 { 0.0 } else { 0.3 };
        (row, bands(&id, &OCTAVES))
    };
    let (files, summary) = report(&release((0..4).map(one).collect()));
    assert_sound(&files);
    let slopes = rows(&files, "photoclinometry-sweep-slopes-recovered-hills");
    for (k, row) in slopes.iter().enumerate() {
        assert!(near(&row[1], value(k)) && near(&row[2], 0.03 + value(k)) && near(&row[3], 0.02), "{row:?}");
    }
    assert_eq!(slopes.len(), 4);
    let mapped: Vec<&String> = summary.figures.iter().filter(|f| f.starts_with("photoclinometry-error-")).collect();
    assert_eq!(mapped, ["photoclinometry-error-recovered-0", "photoclinometry-error-recovered-0.1"]);
    let page = &files["index.html"];
    assert!(page.contains("The figures show 2 of 4 recovered surfaces"));
    assert!(
        page.contains("recovered-0.1: heights did not converge; they still changed by up to 0.30 m in the last round.")
    );
    assert_eq!(rows(&files, "photoclinometry-errors").len(), 4);
}

/// Covariances of both fits are compared: with 0.9 of the truth's covariance at every lag they differ by 10 %, and so do the band RMS below the window.
/// Fits with windows of other sizes are not compared, and the page states what is missing.
#[test]
fn val_covariances_are_compared() {
    let mut data = release(vec![(row("recovered", None, 0.05), bands("recovered", &OCTAVES))]);
    let full = made_up::full(1, 24);
    let like = full.fits.iter().find(|f| f.mode == "corrected").unwrap();
    let fit = |id: &str, dem: &str, factor: f64| FitRow {
        fit_id: id.into(),
        dem_id: dem.into(),
        window_x_m: 10.0,
        window_y_m: 10.0,
        band_rms_m: factor * 1.5,
        ..like.clone()
    };
    data.fits = vec![fit("of-recovered", "recovered", 0.9), fit("of-truth", "hills", 1.0)];
    let bin = full.covariance.iter().find(|b| b.azimuth_deg.is_none()).unwrap();
    for (id, cell_m, factor) in [("of-recovered", 2.0, 0.9), ("of-truth", 1.0, 1.0)] {
        data.covariance.extend((0..10).map(|k| {
            let lag_m = cell_m * k as f64;
            let covariance_m2 = factor * (4.0 - 0.25 * lag_m);
            sastrugi_schemas::tables::CovarianceRow { fit_id: id.into(), bin: k, lag_m, covariance_m2, ..bin.clone() }
        }));
    }
    let files = report(&data).0;
    assert_sound(&files);
    let found = rows(&files, "photoclinometry-covariance");
    // Both have lags of 2, 4, 6 and 8 m: 0.1 (3.5, 3, 2.5, 2) over 3.5.
    let squares: f64 = [3.5, 3.0, 2.5, 2.0].iter().map(|v: &f64| (0.1 * v) * (0.1 * v)).sum();
    let difference = 100.0 * (squares / 4.0).sqrt() / 3.5;
    assert!(near(&found[0][10], 0.9) && near(&found[0][11], 4.0) && near(&found[0][12], difference), "{:?}", found[0]);
    assert_eq!(found.len(), 4);
    assert!(files["index.html"].contains("by 8 % (RMS over lags); its band RMS below a window of 10.0 m is 90 %"));
    data.fits[1].window_x_m = 20.0;
    let files = report(&data).0;
    assert!(!files.contains_key("data/photoclinometry-covariance.json"));
    assert!(files["index.html"].contains("no true surface has one with a window of nearly the same size"));
}

/// Without a true surface there is no verdict, no error map and no curve, and the page states it.
#[test]
fn val_without_a_truth_nothing_is_compared() {
    let unknown = PhotoclinometryRow {
        slope_error_rms: f64::NAN,
        slope_rms: f64::NAN,
        height_error_rms_m: f64::NAN,
        height_error_rms_detrended_m: f64::NAN,
        shaded_correlation: f64::NAN,
        ..row("recovered", None, 0.0)
    };
    let mut data = release(vec![(unknown, Vec::new())]);
    data.terrains.clear();
    let (files, summary) = report(&data);
    assert_sound(&files);
    assert!(files["index.html"].contains("recovered: no true surface to compare with."));
    assert!(summary.figures.iter().any(|f| f == "photoclinometry-heights-recovered"));
    assert!(!summary.figures.iter().any(|f| f.contains("error") || f.contains("wavelength") || f.contains("truth")));
}
