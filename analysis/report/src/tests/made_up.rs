//! A release that was never made: three groups of terrains with missions, a measured DEM with two fits, a texture.

use crate::ReportError;
use crate::data::{Artifact, Data, Files, Study};
use sastrugi_numeric::{Geometry, Grid, Stream, Streams, sums};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::tables::{
    CovarianceRow, FitRow, HeightDistributionRow, MissionRow, PsdRow, SampleRow, TerrainRow,
};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Rasters and samples held in memory.
#[derive(Default)]
pub struct Shelf {
    pub grids: BTreeMap<String, Grid>,
    pub classes: BTreeMap<String, Grid<u8>>,
    pub samples: BTreeMap<String, Vec<SampleRow>>,
    pub fits: BTreeMap<String, FitFile>,
}

impl Files for Shelf {
    fn grid(&self, path: &str) -> Result<Option<Grid>, ReportError> {
        Ok(self.grids.get(path).cloned())
    }
    fn classes(&self, path: &str) -> Result<Option<Grid<u8>>, ReportError> {
        Ok(self.classes.get(path).cloned())
    }
    fn samples(&self, terrain_id: &str) -> Result<Vec<SampleRow>, ReportError> {
        Ok(self.samples.get(terrain_id).cloned().unwrap_or_default())
    }
    fn fit(&self, path: &str) -> Result<Option<FitFile>, ReportError> {
        Ok(self.fits.get(path).cloned())
    }
}

/// A release without rows and files.
pub fn empty() -> Data {
    Data {
        study: Study {
            name: "made-up".into(),
            title: "A release that was never made".into(),
            seed: 7,
            date: "2026-11-21".into(),
            license: "CC-BY-4.0".into(),
            ..Study::default()
        },
        study_sha256: "0".repeat(64),
        version: "sastrugi 0.1.0".into(),
        artifacts: Vec::new(),
        failed: Vec::new(),
        terrains: Vec::new(),
        fits: Vec::new(),
        covariance: Vec::new(),
        psd: Vec::new(),
        heights: Vec::new(),
        missions: Vec::new(),
        files: Box::new(Shelf::default()),
    }
}

/// A release with `per_group` terrains in each of three groups.
pub fn full(per_group: usize, side: usize) -> Data {
    let (mut data, shelf) = parts(per_group, side);
    data.artifacts = data.terrains.iter().map(|t| Artifact { path: t.path.clone(), bytes: 1_234_567 }).collect();
    data.files = Box::new(shelf);
    data
}

/// Its rows, and its files.
pub fn parts(per_group: usize, side: usize) -> (Data, Shelf) {
    let mut data = empty();
    let mut shelf = Shelf::default();
    for (g, name) in ["2.30", "2.45", "2.60"].into_iter().enumerate() {
        for k in 0..per_group {
            terrain(&mut data, &mut shelf, name, g, k, side);
        }
    }
    measured(&mut data, &mut shelf);
    (data, shelf)
}

fn stream(item: &str) -> Stream {
    Streams::for_item(7, "report-test", item).stream("shape")
}

/// Plane waves in random directions, amplitudes falling with frequency.
fn waves(geometry: Geometry, item: &str, amplitude_m: f64, hurst: f64) -> Grid {
    let mut s = stream(item);
    let extent = geometry.size()[0];
    let parts: Vec<[f64; 4]> = (0..70)
        .map(|i| {
            let k = libm::pow(1.09, f64::from(i)) * TAU / extent;
            let (sin, cos) = libm::sincos(s.uniform_in(0.0, TAU));
            [k * cos, k * sin, s.uniform_in(0.0, TAU), amplitude_m * libm::pow(1.09, -hurst * f64::from(i))]
        })
        .collect();
    let height = |x: f64, y: f64| parts.iter().map(|p| p[3] * libm::sin(p[0] * x + p[1] * y + p[2])).sum();
    let values = (0..geometry.rows).flat_map(|r| (0..geometry.cols).map(move |c| (geometry.x(c), geometry.y(r))));
    Grid::new(geometry, values.map(|(x, y)| height(x, y)).collect())
}

fn row(id: &str, stage: &str, path: &str, grid: &Grid) -> TerrainRow {
    let (low, high) = grid.range().unwrap();
    TerrainRow {
        terrain_id: id.into(),
        group: None,
        stage: stage.into(),
        kind: "multifractal".into(),
        params: "{}".into(),
        rows: grid.rows() as i64,
        cols: grid.cols() as i64,
        cell_x_m: grid.geometry.cell[0],
        cell_y_m: grid.geometry.cell[1],
        valid_share: 1.0,
        height_min_m: low,
        height_max_m: high,
        relief_m: high - low,
        rms_height_m: sums::variance(&sums::finite(&grid.values)).sqrt(),
        skewness: 0.1,
        kurtosis: 3.2,
        rms_slope: 0.3,
        band_rms_m: 0.05,
        band_window_m: 2.0,
        share_low: f64::NAN,
        share_semi: f64::NAN,
        share_high: f64::NAN,
        share_border_m: 5.0,
        psd_slope: f64::NAN,
        stream: None,
        path: path.into(),
    }
}

fn terrain(data: &mut Data, shelf: &mut Shelf, group: &str, g: usize, k: usize, side: usize) {
    let id = format!("d{group}-{k:04}");
    let path = format!("terrain/{id}.tif");
    let geometry = Geometry::square(side, side, 50.4 / side as f64);
    let rough = 1.0 + 0.45 * g as f64 + 0.07 * k as f64;
    let [base, fine] = [0.9, 0.2].map(|h| waves(geometry, &format!("{id}{h}"), 0.12 * rough * h, h));
    let shape = |(b, f): (&f64, &f64)| b + f * (0.3 + 2.0 * b.abs());
    let grid = Grid::new(geometry, base.values.iter().zip(&fine.values).map(shape).collect());
    let low = 0.88 - 0.06 * g as f64 - 0.008 * k as f64;
    data.terrains.push(TerrainRow {
        group: Some(group.into()),
        rms_slope: 0.2 * rough,
        share_low: low,
        share_semi: 0.8 * (1.0 - low),
        share_high: 0.2 * (1.0 - low),
        psd_slope: -3.6 + 0.15 * g as f64,
        ..row(&id, "terrain", &path, &grid)
    });
    curves(data, &id, -3.6 + 0.15 * g as f64, 0.4 * rough);
    let step = sums::variance(&fine.values).sqrt();
    let code = |v: &f64| u8::from(v.abs() > 1.1 * step) + u8::from(v.abs() > 2.0 * step);
    shelf.classes.insert(format!("classes/{id}.tif"), Grid::new(geometry, fine.values.iter().map(code).collect()));
    shelf.grids.insert(path, grid);
    missions(data, shelf, &id, g);
}

fn curves(data: &mut Data, id: &str, slope: f64, width_m: f64) {
    let mut s = stream(&format!("{id}-curves"));
    for bin in 0..120 {
        let f = 0.02 * libm::pow(1.055, bin as f64);
        let psd_m4 = 0.01 * libm::pow(f, slope) * libm::exp(0.25 * s.normal());
        data.psd.push(PsdRow { terrain_id: id.into(), bin, frequency_cycles_m: f, psd_m4, modes: 8 * (bin + 1) });
    }
    for bin in 0..60 {
        let low_m = width_m * (bin as f64 / 10.0 - 3.0);
        let z = (low_m + 0.05 * width_m) / width_m;
        let density_per_m = libm::exp(-0.5 * z * z) / (2.5066 * width_m) * (1.0 + 0.06 * s.normal());
        data.heights.push(HeightDistributionRow {
            terrain_id: id.into(),
            bin,
            low_m,
            high_m: low_m + 0.1 * width_m,
            cells: (1e5 * density_per_m) as i64,
            density_per_m,
        });
    }
}

fn missions(data: &mut Data, shelf: &mut Shelf, terrain_id: &str, g: usize) {
    let mut s = stream(&format!("{terrain_id}-missions"));
    let mut samples = Vec::new();
    for k in 0..8 {
        let mission_id = format!("straight-{:04}", k + 1);
        let words = ["success", "success", "stuck", "success", "tipped", "success", "timeout", "success"];
        let outcome = if g == 0 && k > 2 { "success" } else { words[(k + g) % 8] };
        let (x, y) = (s.uniform_in(8.0, 20.0), s.uniform_in(8.0, 42.0));
        let heading = s.uniform_in(-0.5, 0.5);
        let (sin, cos) = libm::sincos(heading);
        let reached = if outcome == "success" { 25.0 } else { s.uniform_in(4.0, 20.0) };
        let scale = 1.0 + 0.3 * g as f64;
        let mut draw = |median: f64| median * scale * libm::exp(0.2 * s.normal());
        let (acceleration, pitch, roll) = (draw(0.6), draw(13.0), draw(9.5));
        let time_s = if outcome == "success" { 36.0 + s.uniform_in(0.0, 2.0) } else { 60.0 };
        data.missions.push(MissionRow {
            terrain_id: terrain_id.into(),
            mission_id: mission_id.clone(),
            group: None,
            traverse_id: "drive".into(),
            vehicle: "husky_a200".into(),
            start_x_m: x,
            start_y_m: y,
            goal_x_m: x + 25.0 * cos,
            goal_y_m: y + 25.0 * sin,
            heading_deg: heading.to_degrees(),
            draws: 3,
            outcome: outcome.into(),
            time_s,
            path_length_m: reached,
            efficiency: if outcome == "success" { 0.98 } else { f64::NAN },
            rms_vertical_acceleration_m_s2: acceleration,
            rms_pitch_rate_deg_s: pitch,
            rms_roll_rate_deg_s: roll,
            rms_body_pitch_rate_deg_s: pitch,
            rms_body_roll_rate_deg_s: roll,
            max_pitch_deg: 21.0,
            max_roll_deg: 17.0,
            samples: 400,
            sample_rate_hz: 20.0,
            path: format!("mcap/{terrain_id}/{mission_id}.mcap"),
        });
        for i in 0..400 {
            let t = f64::from(i) / 400.0;
            let wiggle = 0.4 * libm::sin(9.0 * t + x);
            let angle = |a: f64| 9.0 * libm::sin(a * t) + 4.0 * libm::sin(2.7 * a * t + 1.0) + s_noise(i);
            samples.push(SampleRow {
                terrain_id: terrain_id.into(),
                mission_id: mission_id.clone(),
                sample: i64::from(i),
                time_s: t * time_s,
                x_m: x + reached * t * cos - wiggle * sin,
                y_m: y + reached * t * sin + wiggle * cos,
                z_m: 0.0,
                qx: 0.0,
                qy: 0.0,
                qz: 0.0,
                qw: 1.0,
                vx_m_s: 1.0,
                vy_m_s: 0.0,
                vz_m_s: 0.0,
                roll_deg: angle(31.0),
                pitch_deg: angle(47.0),
                yaw_deg: 0.0,
                roll_rate_deg_s: 0.0,
                pitch_rate_deg_s: 0.0,
                yaw_rate_deg_s: 0.0,
                command_speed_m_s: 1.0,
                command_yaw_rate_deg_s: 0.0,
                class: Some(i64::from((libm::sin(21.0 * t) > 0.4) as i32 + (libm::sin(21.0 * t) > 0.93) as i32)),
            });
        }
    }
    shelf.samples.insert(terrain_id.into(), samples);
}

fn s_noise(i: i32) -> f64 {
    f64::from(i * 7919 % 101) / 60.0
}

fn measured(data: &mut Data, shelf: &mut Shelf) {
    let geometry = Geometry { rows: 180, cols: 150, cell: [74.0, 92.0], origin: [0.0; 2] };
    let dem = waves(geometry, "jacksboro", 160.0, 1.0);
    let mut residual = waves(geometry, "residual", 9.0, 0.3);
    residual.values.iter_mut().for_each(|v| *v = if v.abs() > 45.0 { f64::NAN } else { *v });
    data.terrains.push(TerrainRow {
        rms_slope: 0.1,
        kind: "GeoTIFF".into(),
        ..row("jacksboro", "dem", "dem/jacksboro.metric.tif", &dem)
    });
    shelf.grids.insert("dem/jacksboro.metric.tif".into(), dem.clone());
    for (mode, sigma_m, range_m) in [("corrected", 21.0, 640.0), ("paper", 14.0, 320.0)] {
        let fit_id = format!("jacksboro-{mode}");
        shelf.grids.insert(format!("fit/{fit_id}.background.tif"), dem.clone());
        shelf.grids.insert(format!("fit/{fit_id}.residual.tif"), residual.clone());
        let warnings = vec!["the raster is geographic; it was scaled to metres at its centre latitude".to_owned()];
        shelf.fits.insert(format!("fit/{fit_id}.json"), FitFile { warnings, ..FitFile::default() });
        data.fits.push(FitRow {
            fit_id: fit_id.clone(),
            dem_id: "jacksboro".into(),
            mode: mode.into(),
            model: "exponential".into(),
            sigma_m,
            range_m,
            nugget_m2: f64::NAN,
            sigma2_over_range_m: sigma_m * sigma_m / range_m,
            window_x_m: 3034.0,
            window_y_m: 2852.0,
            trim_level: 0.05,
            trim_threshold_m: 45.0,
            used_share: 0.71,
            misfit_m2: 3.0,
            warnings: String::new(),
        });
        for bin in 0..17 {
            let lag_m = 90.0 * bin as f64;
            let surface = sigma_m * sigma_m * libm::exp(-lag_m / range_m);
            let seen = if mode == "paper" { surface } else { 0.8 * surface - 45.0 };
            data.covariance.push(CovarianceRow {
                fit_id: fit_id.clone(),
                bin,
                lag_m,
                azimuth_deg: None,
                covariance_m2: seen * (1.0 + 0.02 * s_noise(bin as i32)),
                pairs: 20_000 * (bin + 1),
                model_m2: seen,
                surface_model_m2: surface,
            });
        }
        curves(data, &fit_id, -2.4, 8.0);
    }
    let texture = waves(Geometry::square(128, 128, 80.0), "texture", 9.0, 0.3);
    let params = r#"{"fit":"jacksboro-corrected","method":"fft_ma"}"#.into();
    data.terrains.push(TerrainRow {
        params,
        kind: "fft_ma".into(),
        ..row("texture", "texture", "texture/texture.tif", &texture)
    });
    shelf.grids.insert("texture/texture.tif".into(), texture);
    curves(data, "texture", -2.5, 8.3);
}
