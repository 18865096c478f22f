//! Routes and teams on the terrains of the synthetic release.

use super::{Shelf, stream};
use crate::data::Data;
use sastrugi_schemas::tables::{
    FormationEventRow, FormationRow, FormationSampleRow, RoutePointRow, RouteRow, TerrainRow,
};

/// Time between samples, s.
const STEP_S: f64 = 1.0;
/// Samples of each member.
const SAMPLES: i64 = 80;
/// Distance between slots, m.
const SPACING_M: f64 = 2.0;

/// Two pairs and three methods on every generated terrain, a pair without a path, and three teams, one of which loses a member.
pub fn add(data: &mut Data, shelf: &mut Shelf) {
    let plain = |t: &&TerrainRow| t.stage == "terrain" && t.variant.is_none();
    let terrains: Vec<TerrainRow> = data.terrains.iter().filter(plain).cloned().collect();
    for terrain in &terrains {
        for (method, threshold_m, factor) in [("grid", f64::NAN, 1.0), ("hdt2", 2.0, 1.05), ("nohdt", f64::NAN, 1.2)] {
            for pair in 1..=3 {
                route(data, shelf, terrain, (method, threshold_m, factor), pair);
            }
        }
        for (k, formation) in ["column", "line", "wedge"].into_iter().enumerate() {
            team(data, shelf, terrain, formation, k as i64 + 1);
        }
        alone(data, terrain);
    }
    data.formations.sort_by(|a, b| (&a.terrain_id, &a.run_id).cmp(&(&b.terrain_id, &b.run_id)));
    data.formation_events.sort_by(|a, b| (&a.terrain_id, &a.run_id, a.event).cmp(&(&b.terrain_id, &b.run_id, b.event)));
}

fn route(
    data: &mut Data,
    shelf: &mut Shelf,
    terrain: &TerrainRow,
    (id, threshold_m, factor): (&str, f64, f64),
    pair: i64,
) {
    let mut s = stream(&format!("{}-{id}-{pair}", terrain.terrain_id));
    let found = pair < 3;
    let known = |v: f64| if found { v } else { f64::NAN };
    let cost = factor * (40.0 + 2.0 * pair as f64) * (1.0 + 0.05 * s.uniform());
    let grid = id == "grid";
    let cells = terrain.rows * terrain.cols;
    let vertices = if grid { cells } else { 3 + cells / 50 };
    let route_id = format!("{id}-{pair:04}");
    let y = 10.0 * pair as f64;
    data.routes.push(RouteRow {
        terrain_id: terrain.terrain_id.clone(),
        route_id: route_id.clone(),
        group: terrain.group.clone(),
        variant: None,
        pair_id: format!("{}-{pair:04}", terrain.terrain_id),
        stage_id: id.into(),
        method: if grid { "grid" } else { "roadmap" }.into(),
        neighbours: 4,
        threshold_m,
        cost: "slope".into(),
        vehicle: None,
        max_up_deg: 30.0,
        max_down_deg: 30.0,
        width_m: f64::NAN,
        start_x_m: 4.0,
        start_y_m: y,
        goal_x_m: 44.0,
        goal_y_m: y + 4.0,
        straight_m: 40.2,
        outcome: if found { "found" } else { "no_path" }.into(),
        free_cells: cells,
        vertices: if found { vertices } else { 0 },
        edges: if found { 4 * vertices } else { 0 },
        repaired: 0,
        expansions: if found { 1 + vertices / 3 } else { 0 },
        search_cost_m: known(1.2 * cost),
        cost_bound: known(1.0),
        path_cost_m: known(1.2 * cost),
        smoothed_cost_m: known(cost),
        path_points: 41,
        smoothed_points: 5,
        length_m: known(41.0),
        ground_length_m: known(42.0),
        steepest_up_deg: known(12.0),
        steepest_down_deg: known(9.0),
        path: found.then(|| format!("route/{}/{route_id}.geojson", terrain.terrain_id)),
    });
    let bend = 6.0 * (factor - 1.0) * pair as f64;
    for point in (0..5).filter(|_| found) {
        let along = point as f64 / 4.0;
        shelf.route_points.push(RoutePointRow {
            terrain_id: terrain.terrain_id.clone(),
            route_id: route_id.clone(),
            form: "smoothed".into(),
            point,
            x_m: 4.0 + 40.0 * along,
            y_m: y + 4.0 * along + bend * along * (1.0 - along) * 4.0,
            z_m: 0.0,
            distance_m: 41.0 * along,
        });
    }
}

/// Four members; the line of run 2 loses its third member at 30 s, and the fourth swings back within eight seconds.
fn team(data: &mut Data, shelf: &mut Shelf, terrain: &TerrainRow, formation: &str, run: i64) {
    let run_id = format!("team-0001-{run:02}");
    let loses = formation == "line";
    let stuck = formation == "wedge" && terrain.group.as_deref() == Some("2.60");
    let lost_at = 30.0;
    data.formations.push(FormationRow {
        lost: i64::from(loses),
        outcome: if stuck { "stuck" } else { "arrived" }.into(),
        stuck_member: stuck.then_some(4),
        depth_error_m: 0.4,
        width_error_m: 0.1,
        in_range: 0.8,
        tolerable: 0.95,
        ..row(terrain, &run_id, formation, 4)
    });
    let (depth, width) = match formation {
        "column" => (1.0, 0.0),
        "line" => (0.0, 1.0),
        _ => (1.0, 1.0),
    };
    for member in 1..=4_i64 {
        let k = (member - 1) as f64;
        for sample in 0..SAMPLES {
            let time_s = STEP_S * sample as f64;
            let lost = loses && member == 3 && time_s >= lost_at;
            let since = (time_s - lost_at) / 8.0;
            let swing =
                if loses && member == 4 && (0.0..1.0).contains(&since) { 1.5 * SPACING_M * (1.0 - since) } else { 0.0 };
            let error = 0.2 * libm::sin(0.3 * time_s + k) + swing;
            let travelled = 0.5 * if lost { lost_at } else { time_s };
            let follower = member > 1 && !lost;
            shelf.formation_samples.entry(terrain.terrain_id.clone()).or_default().push(FormationSampleRow {
                terrain_id: terrain.terrain_id.clone(),
                run_id: run_id.clone(),
                member,
                sample,
                time_s,
                x_m: 6.0 + travelled - SPACING_M * depth * k,
                y_m: 25.0 - SPACING_M * width * (k - 1.5) + error,
                z_m: 0.0,
                heading_deg: 0.0,
                speed_m_s: 0.5,
                slot: (!lost).then_some(member),
                target_x_m: 44.0,
                target_y_m: 25.0,
                depth_error_m: if follower { 0.5 * error } else { f64::NAN },
                width_error_m: if follower { error } else { f64::NAN },
                state: if lost { "lost" } else { "moving" }.into(),
                split: None,
            });
        }
    }
    if loses {
        event(data, terrain, &run_id, (0, lost_at), "lost", "member 3 lost its mobility");
        event(data, terrain, &run_id, (1, lost_at), "rearranged", "member 4 takes slot 3");
    }
}

/// A team of one: no followers, no errors, no recording.
fn alone(data: &mut Data, terrain: &TerrainRow) {
    data.formations.push(FormationRow { spacing_m: f64::NAN, ..row(terrain, "single-0001-01", "custom", 1) });
}

fn row(terrain: &TerrainRow, run_id: &str, formation: &str, members: i64) -> FormationRow {
    FormationRow {
        terrain_id: terrain.terrain_id.clone(),
        run_id: run_id.into(),
        group: terrain.group.clone(),
        variant: None,
        split: None,
        route_id: "nohdt-0001".into(),
        stage_id: run_id.split('-').next().unwrap_or_default().into(),
        formation: formation.into(),
        members,
        lost: 0,
        spacing_m: SPACING_M,
        outcome: "arrived".into(),
        stuck_member: None,
        time_s: 80.0,
        route_length_m: 40.0,
        path_length_m: 41.0,
        depth_error_m: f64::NAN,
        width_error_m: f64::NAN,
        worst_depth_error_m: f64::NAN,
        worst_width_error_m: f64::NAN,
        in_range: f64::NAN,
        tolerable: f64::NAN,
        least_separation_m: if members > 1 { 1.4 } else { f64::NAN },
        waits: 12,
        dodges: 3,
        squeezed: 0,
        obstacle_contacts: 0,
        replans: 0,
        samples: SAMPLES,
        sample_rate_hz: 1.0,
        path: Some(format!("mcap/{}/{run_id}.mcap", terrain.terrain_id)),
    }
}

fn event(data: &mut Data, terrain: &TerrainRow, run_id: &str, (event, time_s): (i64, f64), kind: &str, text: &str) {
    data.formation_events.push(FormationEventRow {
        terrain_id: terrain.terrain_id.clone(),
        run_id: run_id.into(),
        event,
        time_s,
        kind: kind.into(),
        member: Some(3),
        text: text.into(),
    });
}
