//! Rovers on the terrains of the synthetic release.

use super::Shelf;
use crate::data::Data;
use sastrugi_numeric::Grid;
use sastrugi_schemas::tables::{RoverEffectRow, RoverRow, RoverSampleRow, TerrainRow};
use std::f64::consts::TAU;

/// Rovers on a circle.
pub const ROVERS: usize = 10;
/// Its radius, m.
pub const RADIUS_M: f64 = 20.0;
/// Distance limit, m.
pub const LIMIT_M: f64 = 300.0;

/// A circle of ten on every generated terrain, four designs of four rovers each, samples of the circle, and a map of rocks.
pub fn add(data: &mut Data, shelf: &mut Shelf) {
    let plain = |t: &&TerrainRow| t.stage == "terrain" && t.variant.is_none();
    let terrains: Vec<TerrainRow> = data.terrains.iter().filter(plain).cloned().collect();
    for terrain in &terrains {
        for number in 0..ROVERS {
            let rover = rover(terrain, "circle", ROVERS, number);
            samples(shelf, &rover);
            data.rovers.push(rover);
        }
        for (stage, variant, better) in [
            ("design-0.1-0.8", "clearance_m = 0.1, scale = 0.8", 0.9),
            ("design-0.1-1.2", "clearance_m = 0.1, scale = 1.2", 0.8),
            ("design-0.2-0.8", "clearance_m = 0.2, scale = 0.8", 1.0),
            ("design-0.2-1.2", "clearance_m = 0.2, scale = 1.2", 0.95),
        ] {
            data.rovers.extend((0..4).map(|number| {
                let plain = rover(terrain, stage, 4, number);
                RoverRow {
                    variant: Some(variant.into()),
                    navigator: "schoppers_like".into(),
                    efficiency: better * plain.efficiency,
                    ..plain
                }
            }));
        }
        if let Some(heights) = shelf.grids.get(&terrain.path) {
            let codes = (0..heights.values.len()).map(|k| f64::from(u8::from(k % 17 < 3))).collect();
            let codes = Grid { geometry: heights.geometry, values: codes };
            shelf.grids.insert(terrain.path.replace(".tif", ".class.tif"), codes);
        }
    }
    data.rovers.sort_by(|a, b| (&a.terrain_id, &a.rover_id).cmp(&(&b.terrain_id, &b.rover_id)));
    for (rank, (parameter, mu)) in
        [("hazard_step_m", 0.9), ("turn_deg", -0.2), ("goal_tolerance_m", 0.02), ("cycle_limit", 0.0)]
            .into_iter()
            .enumerate()
    {
        for measure in ["efficiency", "arrival", "distance_m"] {
            data.rover_effects.push(effect(rank as i64 + 1, parameter, measure, mu));
        }
    }
}

/// An effect of a given size on efficiency, and of the opposite sign on distance.
pub fn effect(rank: i64, parameter: &str, measure: &str, mu: f64) -> RoverEffectRow {
    let (unit, factor) = if measure == "distance_m" { ("m", -200.0) } else { ("1", 1.0) };
    RoverEffectRow {
        stage_id: "circle".into(),
        group: "2.30".into(),
        variant: String::new(),
        measure: measure.into(),
        parameter: parameter.into(),
        rank,
        base: 0.065,
        unit: "m".into(),
        measure_unit: unit.into(),
        measure_mean: 0.5,
        mu: factor * mu,
        mu_low: factor * mu - 0.1,
        mu_high: factor * mu + 0.1,
        mu_star: (factor * mu).abs(),
        mu_star_low: (factor * mu).abs() * 0.8,
        mu_star_high: (factor * mu).abs() * 1.3,
        sigma: 0.3 * (factor * mu).abs(),
        mu_star_noise: 0.05 * factor.abs(),
        share: 0.1,
        levels: 4,
        trajectories: 8,
        worlds: 3,
        rovers: 10,
    }
}

/// Number of a group and of the terrain in it, from `d2.45-0003`.
fn place(terrain: &TerrainRow) -> (f64, f64) {
    let group = match terrain.group.as_deref() {
        Some("2.30") => 0.0,
        Some("2.45") => 1.0,
        _ => 2.0,
    };
    let number = terrain.terrain_id.rsplit_once('-').and_then(|(_, n)| n.parse().ok()).unwrap_or(0.0);
    (group, number)
}

/// Distance driven over the straight distance.
pub fn factor(group: f64, world: f64, rover: f64) -> f64 {
    1.1 + 0.4 * group + 0.1 * world + 0.05 * rover
}

/// A rover on a circle of `of`: every fifth of the last group drives to its limit, and the first of these has no path.
fn rover(terrain: &TerrainRow, stage: &str, of: usize, number: usize) -> RoverRow {
    let (group, world) = place(terrain);
    let stopped = group == 2.0 && number % 5 == 4;
    let (sin, cos) = libm::sincos(TAU * number as f64 / of as f64);
    let centre = 0.5 * terrain.cols as f64 * terrain.cell_x_m;
    let distance_m = if stopped { LIMIT_M } else { RADIUS_M * factor(group, world, number as f64) };
    let residual_m = if stopped { 12.0 } else { 0.4 };
    let no_way = stopped && number == 4;
    RoverRow {
        terrain_id: terrain.terrain_id.clone(),
        rover_id: format!("{stage}-{:04}", number + 1),
        group: terrain.group.clone(),
        variant: None,
        split: None,
        stage_id: stage.into(),
        navigator: "sojourner_like".into(),
        start_x_m: centre + RADIUS_M * cos,
        start_y_m: centre + RADIUS_M * sin,
        start_heading_deg: 10.0,
        goal_x_m: centre,
        goal_y_m: centre,
        straight_m: RADIUS_M,
        outcome: if stopped { "distance_limit" } else { "reached" }.into(),
        distance_m,
        residual_m,
        efficiency: RADIUS_M / (distance_m + residual_m),
        efficiency_half_limit: RADIUS_M / (distance_m.min(0.5 * LIMIT_M) + residual_m),
        distance_limit_m: LIMIT_M,
        oracle_m: if no_way { f64::NAN } else { 1.05 * RADIUS_M },
        oracle: if no_way { "none" } else { "found" }.into(),
        time_s: 100.0 * distance_m,
        cycles: 20 * number as i64 + 300,
        turns: 50,
        turned_deg: 700.0,
        reversals: number as i64 / 4,
        hazards: 60,
        contacts: i64::from(number == 3),
        centre_contacts: 0,
        clearance_m: 0.13,
        max_tilt_deg: 11.0,
        max_pitch_deg: 9.0,
        max_roll_deg: 8.0,
        rms_pitch_rate_deg_s: 1.5,
        rms_roll_rate_deg_s: 1.2,
        note: stopped.then(|| "drove as far as it may".into()),
        path: None,
    }
}

/// A curved path to where the rover ended.
fn samples(shelf: &mut Shelf, rover: &RoverRow) {
    let reach = 1.0 - rover.residual_m / rover.straight_m;
    let (dx, dy) = (rover.goal_x_m - rover.start_x_m, rover.goal_y_m - rover.start_y_m);
    let own = (0..40).map(|sample| {
        let along = reach * sample as f64 / 39.0;
        let across = 0.15 * libm::sin(3.0 * TAU * along);
        RoverSampleRow {
            terrain_id: rover.terrain_id.clone(),
            rover_id: rover.rover_id.clone(),
            sample,
            cycle: 8 * sample,
            time_s: 60.0 * sample as f64,
            distance_m: rover.distance_m * sample as f64 / 39.0,
            x_m: rover.start_x_m + along * dx - across * dy,
            y_m: rover.start_y_m + along * dy + across * dx,
            z_m: 0.0,
            heading_deg: 0.0,
            roll_deg: 0.0,
            pitch_deg: 0.0,
            state: "drive".into(),
            hazards: "0000".into(),
            believed_x_m: 0.0,
            believed_y_m: 0.0,
            split: None,
        }
    });
    shelf.rover_samples.entry(rover.terrain_id.clone()).or_default().extend(own);
}
