//! A synthetic release in memory: three groups of terrains with missions, a measured DEM with two fits, a texture.

mod navigation;
pub mod rovers;

use crate::ReportError;
use crate::data::{Data, Files, Mission, Start, Stored, Study};
use sastrugi_numeric::{Geometry, Grid, Stream, Streams, sums};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::tables::{
    CandidateCurveRow, CandidateRow, CovarianceRow, FitRow, FormationSampleRow, HeightDistributionRow,
    LikelihoodProfileRow, LogRow, MissionRow, ProfilePsdRow, PsdRow, RoutePointRow, RoverSampleRow, SampleRow,
    StructureRow, SurfaceRow, TerrainRow,
};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

/// Rasters and samples held in memory.
#[derive(Default)]
pub struct Shelf {
    pub grids: BTreeMap<String, Grid>,
    pub classes: BTreeMap<String, Grid<u8>>,
    pub samples: BTreeMap<String, Vec<SampleRow>>,
    pub fits: BTreeMap<String, FitFile>,
    pub route_points: Vec<RoutePointRow>,
    pub formation_samples: BTreeMap<String, Vec<FormationSampleRow>>,
    pub rover_samples: BTreeMap<String, Vec<RoverSampleRow>>,
}

impl Files for Shelf {
    fn grid(&self, path: &str) -> Result<Option<Grid>, ReportError> {
        Ok(self.grids.get(path).cloned())
    }
    fn classes(&self, path: &str) -> Result<Option<Grid<u8>>, ReportError> {
        Ok(self.classes.get(path).cloned())
    }
    fn samples(&self, terrain_id: &str, missions: &BTreeSet<&str>) -> Result<Vec<SampleRow>, ReportError> {
        let all = self.samples.get(terrain_id).into_iter().flatten();
        Ok(all.filter(|sample| missions.contains(sample.mission_id.as_str())).cloned().collect())
    }
    fn route_points(&self) -> Result<Vec<RoutePointRow>, ReportError> {
        Ok(self.route_points.clone())
    }
    fn formation_samples(&self, terrain_id: &str) -> Result<Vec<FormationSampleRow>, ReportError> {
        Ok(self.formation_samples.get(terrain_id).cloned().unwrap_or_default())
    }
    fn rover_samples(&self, terrain_id: &str) -> Result<Vec<RoverSampleRow>, ReportError> {
        Ok(self.rover_samples.get(terrain_id).cloned().unwrap_or_default())
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
            title: "A synthetic release".into(),
            seed: 7,
            date: "2026-11-21".into(),
            license: "CC-BY-4.0".into(),
            ..Study::default()
        },
        study_sha256: "0".repeat(64),
        version: "sastrugi 0.1.0".into(),
        stored: Stored::default(),
        failed: Vec::new(),
        terrains: Vec::new(),
        without_curves: BTreeSet::new(),
        fits: Vec::new(),
        covariance: Vec::new(),
        candidates: Vec::new(),
        candidate_curves: Vec::new(),
        likelihood_profile: Vec::new(),
        surfaces: Vec::new(),
        structure: Vec::new(),
        profile_psd: Vec::new(),
        psd: Vec::new(),
        heights: Vec::new(),
        scoreboard: Vec::new(),
        scoreboard_covariance: Vec::new(),
        missions: Vec::new(),
        replicates: Vec::new(),
        routes: Vec::new(),
        images: Vec::new(),
        photoclinometry: Vec::new(),
        photoclinometry_bands: Vec::new(),
        formations: Vec::new(),
        formation_events: Vec::new(),
        rovers: Vec::new(),
        rover_effects: Vec::new(),
        parameters: Vec::new(),
        contents: BTreeMap::new(),
        against: None,
        logs: None,
        files: Box::new(Shelf::default()),
    }
}

/// A log without any known value.
pub fn log() -> LogRow {
    LogRow {
        log_id: String::new(),
        group: None,
        topic: String::new(),
        message: String::new(),
        frame: String::new(),
        outcome: None,
        time_s: f64::NAN,
        path_length_m: f64::NAN,
        efficiency: f64::NAN,
        rms_vertical_acceleration_m_s2: f64::NAN,
        vertical_acceleration_floor_m_s2: f64::NAN,
        vertical_acceleration_tells: true,
        rms_pitch_rate_deg_s: f64::NAN,
        pitch_rate_floor_deg_s: f64::NAN,
        pitch_rate_tells: true,
        rms_roll_rate_deg_s: f64::NAN,
        roll_rate_floor_deg_s: f64::NAN,
        roll_rate_tells: true,
        rms_body_pitch_rate_deg_s: f64::NAN,
        rms_body_roll_rate_deg_s: f64::NAN,
        max_pitch_deg: f64::NAN,
        max_roll_deg: f64::NAN,
        band_low_hz: f64::NAN,
        band_high_hz: f64::NAN,
        band_vertical_acceleration_m_s2: f64::NAN,
        band_source: None,
        band_vertical_acceleration_floor_m_s2: f64::NAN,
        band_vertical_acceleration_poses_m_s2: f64::NAN,
        samples: 0,
        sample_rate_hz: f64::NAN,
        pose_rate_hz: f64::NAN,
        resampled: true,
        gaps: 0,
        gap_time_s: f64::NAN,
        ground_share: f64::NAN,
        min_clearance_m: f64::NAN,
        median_clearance_m: f64::NAN,
        share_low: f64::NAN,
        share_semi: f64::NAN,
        share_high: f64::NAN,
        broken: None,
    }
}

/// A release with `per_group` terrains in each of three groups.
pub fn full(per_group: usize, side: usize) -> Data {
    let (mut data, shelf) = parts(per_group, side);
    data.terrains.iter().for_each(|t| data.stored.add(&t.path, 1_234_567));
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
    variants(&mut data);
    replicates(&mut data);
    measured(&mut data, &mut shelf);
    navigation::add(&mut data, &mut shelf);
    rovers::add(&mut data, &mut shelf);
    (data, shelf)
}

/// Variants of every mission: two of the vehicle on the same terrains, one of the terrain in the first group.
fn variants(data: &mut Data) {
    let plain = data.missions.clone();
    for (name, word, spoilt, rougher) in
        [("wheel_friction = 0.7", "friction", 5, 0.97), ("tyre_damping_n_s_m = 250.0", "soft", 900, 1.2)]
    {
        data.missions.extend(plain.iter().enumerate().map(|(i, m)| Mission {
            mission_id: m.mission_id.replace("straight", word).into(),
            variant: Some(name.into()),
            outcome: if i % spoilt == 0 { "stuck".into() } else { m.outcome.clone() },
            rms_vertical_acceleration_m_s2: rougher * m.rms_vertical_acceleration_m_s2,
            ..m.clone()
        }));
    }
    let steep = |t: &TerrainRow| t.group.as_deref() == Some("2.30");
    let variant = Some("z_scale_percent = 1.0".to_owned());
    for terrain in data.terrains.clone().into_iter().filter(steep) {
        let terrain_id = format!("{}.steep", terrain.terrain_id);
        let on = plain.iter().filter(|m| m.terrain_id.as_str() == terrain.terrain_id);
        data.missions.extend(on.map(|m| Mission {
            terrain_id: terrain_id.as_str().into(),
            pair_id: format!("steep-{}", m.pair_id).into(),
            variant: variant.as_deref().map(Into::into),
            outcome: "out_of_bounds".into(),
            ..m.clone()
        }));
        data.terrains.push(TerrainRow { terrain_id, variant: variant.clone(), ..terrain });
    }
    data.missions.sort_by(|a, b| (&a.terrain_id, &a.mission_id).cmp(&(&b.terrain_id, &b.mission_id)));
    data.terrains.sort_by(|a, b| a.terrain_id.cmp(&b.terrain_id));
}

/// Five starts of every plain mission.
fn replicates(data: &mut Data) {
    let mut s = stream("replicates");
    for m in data.missions.iter().filter(|m| m.variant.is_none()) {
        let certain = s.uniform() < 0.5;
        for replicate in 1..=5 {
            let flipped = !certain && s.uniform() < 0.3;
            let outcome = match (replicate > 1 && flipped, m.outcome == "success") {
                (false, _) => m.outcome.clone(),
                (true, true) => "tipped".into(),
                (true, false) => "success".into(),
            };
            let (terrain_id, mission_id) = (m.terrain_id.clone(), m.mission_id.clone());
            data.replicates.push(Start { terrain_id, mission_id, replicate, outcome });
        }
    }
}

fn stream(item: &str) -> Stream {
    Streams::for_item(7, "report-test", item).stream("shape")
}

/// Plane waves in random directions, with amplitudes that decrease with frequency.
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

/// The row of a heightfield, with only the values that follow from its heights.
pub fn row(id: &str, stage: &str, path: &str, grid: &Grid) -> TerrainRow {
    let (low, high) = grid.range().unwrap();
    TerrainRow {
        terrain_id: id.into(),
        group: None,
        variant: None,
        split: None,
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
    missions(data, shelf, &id, g, k);
}

fn curves(data: &mut Data, id: &str, slope: f64, width_m: f64) {
    let mut s = stream(&format!("{id}-curves"));
    for bin in 0..120 {
        let f = 0.02 * libm::pow(1.055, bin as f64);
        let psd_m4 = 0.01 * libm::pow(f, slope) * libm::exp(0.25 * s.normal());
        data.psd.push(PsdRow { surface_id: id.into(), bin, frequency_cycles_m: f, psd_m4, modes: 8 * (bin + 1) });
    }
    for bin in 0..60 {
        let low_m = width_m * (bin as f64 / 10.0 - 3.0);
        let z = (low_m + 0.05 * width_m) / width_m;
        let density_per_m = libm::exp(-0.5 * z * z) / (2.5066 * width_m) * (1.0 + 0.06 * s.normal());
        data.heights.push(HeightDistributionRow {
            surface_id: id.into(),
            bin,
            low_m,
            high_m: low_m + 0.1 * width_m,
            cells: (1e5 * density_per_m) as i64,
            density_per_m,
        });
    }
}

fn missions(data: &mut Data, shelf: &mut Shelf, terrain_id: &str, g: usize, terrain: usize) {
    let mut s = stream(&format!("{terrain_id}-missions"));
    let mut samples = Vec::new();
    for k in 0..8 {
        let mission_id = format!("straight-{:04}", k + 1);
        let words = ["success", "success", "stuck", "success", "tipped", "success", "timeout", "out_of_bounds"];
        let outcome = if g == 0 && k > 2 { "success" } else { words[(k + g) % 8] };
        let (x, y) = (s.uniform_in(8.0, 20.0), s.uniform_in(8.0, 42.0));
        let heading = s.uniform_in(-0.5, 0.5);
        let (sin, cos) = libm::sincos(heading);
        let reached = if outcome == "success" { 25.0 } else { s.uniform_in(4.0, 20.0) };
        let scale = 1.0 + 0.3 * g as f64;
        let mut draw = |median: f64| median * scale * libm::exp(0.2 * s.normal());
        let (acceleration, pitch, roll) = (draw(0.6), draw(13.0), draw(9.5));
        let time_s = if outcome == "success" { 36.0 + s.uniform_in(0.0, 2.0) } else { 60.0 };
        data.missions.push(Mission::from_row(&MissionRow {
            terrain_id: terrain_id.into(),
            mission_id: mission_id.clone(),
            group: None,
            variant: None,
            split: None,
            pair_id: format!("straight-{terrain:04}-{:04}", k + 1),
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
            progress_m: reached,
            efficiency: if outcome == "success" { 0.98 } else { f64::NAN },
            rms_vertical_acceleration_m_s2: acceleration,
            rms_pitch_rate_deg_s: pitch,
            rms_roll_rate_deg_s: roll,
            rms_body_pitch_rate_deg_s: pitch,
            rms_body_roll_rate_deg_s: roll,
            max_pitch_deg: 21.0,
            max_roll_deg: 17.0,
            line_length_m: f64::NAN,
            rms_cross_track_m: f64::NAN,
            max_cross_track_m: f64::NAN,
            line_share_low: 0.8,
            line_share_semi: 0.15,
            line_share_high: 0.05,
            line_max_slope: 0.9,
            line_band_rms_m: 0.02,
            replicates: 1,
            success_probability: f64::from(u8::from(outcome == "success")),
            samples: 400,
            sample_rate_hz: 20.0,
            path: format!("mcap/{terrain_id}/{mission_id}.mcap"),
        }));
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
                z_m: 0.02 * libm::sin(41.0 * t) + 0.1 * libm::sin(7.0 * t),
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
                cross_track_m: wiggle,
                heading_error_deg: 0.0,
                distance_to_goal_m: reached * (1.0 - t),
                chassis_force_n: 0.0,
                wheel_normal_force_n: vec![],
                wheel_longitudinal_force_n: vec![],
                wheel_lateral_force_n: vec![],
                wheel_slip_ratio: vec![],
                wheel_spin_rad_s: vec![],
                wheel_torque_n_m: vec![],
                wheel_steering_deg: vec![],
                wheel_contact_x_m: vec![],
                wheel_contact_y_m: vec![],
                wheel_contact_z_m: vec![],
                outcome: outcome.into(),
                split: None,
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
            ratio: 1.0,
            azimuth_deg: f64::NAN,
            interval_level: if mode == "paper" { f64::NAN } else { 0.95 },
            replicates: if mode == "paper" { 0 } else { 99 },
            sigma_low_m: if mode == "paper" { f64::NAN } else { 19.2 },
            sigma_high_m: if mode == "paper" { f64::NAN } else { 24.1 },
            range_low_m: if mode == "paper" { f64::NAN } else { 510.0 },
            range_high_m: if mode == "paper" { f64::NAN } else { 905.0 },
            sigma2_over_range_low_m: if mode == "paper" { f64::NAN } else { 0.61 },
            sigma2_over_range_high_m: if mode == "paper" { f64::NAN } else { 0.77 },
            block_replicates: 0,
            block_sigma_low_m: f64::NAN,
            block_sigma_high_m: f64::NAN,
            block_range_low_m: f64::NAN,
            block_range_high_m: f64::NAN,
            block_sigma2_over_range_low_m: f64::NAN,
            block_sigma2_over_range_high_m: f64::NAN,
            misfit_chi2_per_freedom: 3.1,
            misfit_p: if mode == "paper" { f64::NAN } else { 0.01 },
            isotropy_p: if mode == "paper" { f64::NAN } else { 3e-9 },
            isotropy_ratio: 0.71,
            isotropy_azimuth_deg: 48.0,
            stationarity_p: if mode == "paper" { f64::NAN } else { 0.002 },
            block_sigma_max_over_min: 1.6,
            normality_p: if mode == "paper" { f64::NAN } else { 0.4 },
            window_disagreement_z: if mode == "paper" { f64::NAN } else { 1.2 },
            naive_sigma_m: 14.0,
            naive_range_m: 320.0,
            band_rms_m: 15.0,
            increment_1m_m: f64::NAN,
            hurst: f64::NAN,
            noise_sigma_m: 0.0,
            correlated_noise_sigma_m: 0.0,
            correlated_noise_range_m: 0.0,
            effective_resolution_m: 90.0,
            warnings: String::new(),
        });
        if mode == "corrected" {
            candidates(data, &fit_id, sigma_m, range_m);
        }
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
                covariance_low_m2: if mode == "paper" { f64::NAN } else { seen - 20.0 },
                covariance_high_m2: if mode == "paper" { f64::NAN } else { seen + 25.0 },
            });
        }
        curves(data, &fit_id, -2.4, 8.0);
        surface(data, &fit_id, "fit", Some(&fit_id), 8.0);
        let mask = residual.map(|v| if v.is_nan() { 1 } else { 0 });
        shelf.classes.insert(format!("fit/{fit_id}.mask.tif"), mask);
    }
    surface(data, "jacksboro", "dem", None, 160.0);
    let texture = waves(Geometry::square(128, 128, 80.0), "texture", 9.0, 0.3);
    let params = r#"{"fit":"jacksboro-corrected","method":"fft_ma"}"#.into();
    data.terrains.push(TerrainRow {
        params,
        kind: "fft_ma".into(),
        ..row("texture", "texture", "texture/texture.tif", &texture)
    });
    shelf.grids.insert("texture/texture.tif".into(), texture);
    curves(data, "texture", -2.5, 8.3);
    surface(data, "texture", "texture", None, 9.0);
    curves(data, "texture.residual", -2.4, 8.1);
    surface(data, "texture.residual", "texture_residual", Some("jacksboro-corrected"), 8.2);
    data.covariance.sort_by(|a, b| (&a.fit_id, a.bin).cmp(&(&b.fit_id, b.bin)));
    data.surfaces.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
    data.structure.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
    data.profile_psd.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
    data.psd.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
    data.heights.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
}

/// Two more candidate models, a profile likelihood, and covariances by direction.
fn candidates(data: &mut Data, fit_id: &str, sigma_m: f64, range_m: f64) {
    for (rank, model, worse, factor) in
        [(1, "exponential", 0.0, 1.0), (2, "matern", 1.8, 1.1), (3, "gaussian", 96.4, 0.6)]
    {
        data.candidates.push(CandidateRow {
            fit_id: fit_id.into(),
            rank,
            model: model.into(),
            parameters: format!("{{\"range_m\":{},\"sigma_m\":{sigma_m}}}", factor * range_m),
            free: 2 + i64::from(rank == 2),
            chi2: Some(21.5 + worse),
            aicc_above_best: (rank < 3).then_some(worse),
        });
        for bin in 0..17 {
            let lag_m = 90.0 * bin as f64;
            let model_m2 = 0.8 * sigma_m * sigma_m * libm::exp(-lag_m / (factor * range_m)) - 45.0;
            data.candidate_curves.push(CandidateCurveRow { fit_id: fit_id.into(), rank, bin, lag_m, model_m2 });
        }
    }
    for (point, share) in [0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0].into_iter().enumerate() {
        let log = libm::log(share);
        data.likelihood_profile.push(LikelihoodProfileRow {
            fit_id: fit_id.into(),
            point: point as i64,
            range_m: share * range_m,
            chi2_rise: 18.0 * log * log,
        });
    }
    for k in 0..24 {
        let (azimuth_deg, lag_m) = (30.0 * f64::from(k % 6), 180.0 * f64::from(k / 6 + 1));
        let model_m2 = 0.8 * sigma_m * sigma_m * libm::exp(-lag_m / range_m) - 45.0;
        data.covariance.push(CovarianceRow {
            fit_id: fit_id.into(),
            bin: 17 + i64::from(k),
            lag_m,
            azimuth_deg: Some(azimuth_deg),
            covariance_m2: model_m2 + 20.0 * libm::cos(azimuth_deg.to_radians()),
            pairs: 4000,
            model_m2,
            surface_model_m2: f64::NAN,
            covariance_low_m2: f64::NAN,
            covariance_high_m2: f64::NAN,
        });
    }
}

/// Parameters, structure function and profile spectra of a surface.
fn surface(data: &mut Data, id: &str, stage: &str, fit_id: Option<&str>, sq_m: f64) {
    data.surfaces.push(SurfaceRow {
        surface_id: id.into(),
        stage: stage.into(),
        fit_id: fit_id.map(str::to_owned),
        cell_x_m: 74.0,
        cell_y_m: 92.0,
        cells: 20_000,
        valid_share: 0.71,
        sq_m,
        sa_m: 0.8 * sq_m,
        ssk: 0.04,
        sku: 2.7,
        sp_m: 3.1 * sq_m,
        sv_m: 2.9 * sq_m,
        sz_m: 6.0 * sq_m,
        sdq: 0.11,
        rms_slope_x: 0.08,
        rms_slope_y: 0.075,
        sal_m: 310.0,
        aspect_ratio: if stage == "dem" { f64::NAN } else { 0.72 },
        direction_deg: 48.0,
        hurst_exponent: 0.61,
        hurst_standard_error: 0.02,
        hurst_lag_min_m: 92.0,
        hurst_lag_max_m: 700.0,
        zeta_1: 0.60,
        zeta_1_standard_error: 0.02,
        zeta_2: 1.15,
        zeta_2_standard_error: 0.02,
        zeta_3: 1.65,
        zeta_3_standard_error: 0.02,
        zeta_4: 2.10,
        zeta_4_standard_error: 0.02,
    });
    for direction in ["all", "x", "y"] {
        for bin in 0..20 {
            let lag_m = 74.0 * libm::pow(1.19, bin as f64);
            let value_m2 = 2.0 * sq_m * sq_m * (1.0 - libm::exp(-lag_m / 400.0));
            let (surface_id, direction) = (id.to_owned(), direction.to_owned());
            data.structure.push(StructureRow { surface_id, direction, bin, lag_m, value_m2, pairs: 1000 });
        }
    }
    for direction in ["x", "y"] {
        for bin in 0..20 {
            let frequency_cycles_m = 1e-4 * libm::pow(1.25, bin as f64);
            let psd_m3 = sq_m * sq_m * 1e3 / (1.0 + libm::pow(2000.0 * frequency_cycles_m, 2.2));
            let (surface_id, direction) = (id.to_owned(), direction.to_owned());
            data.profile_psd.push(ProfilePsdRow { surface_id, direction, bin, frequency_cycles_m, psd_m3, modes: 9 });
        }
    }
}
