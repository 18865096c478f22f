//! The run of a small team with its route, written in both flavours, and the script that reads it.

use super::{check, python};
use sastrugi_numeric::{Geometry, Grid, Surface};
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::topics::{
    DiscState, FormationBox, Member, MemberState, MovingDisc, PlannedRoute, TeamEvent, TeamEventKind, TeamRecording,
};
use sastrugi_store::dem::Crs;
use sastrugi_store::geojson::{Route, write_routes};
use sastrugi_store::mcap::{TeamMcap, TerrainView, bag_metadata, write_team};
use sastrugi_tests::{area, write};
use std::collections::BTreeMap;
use std::path::Path;

const CORNER: [f64; 2] = [400_000.0, 5_000_000.0];
const SAMPLES: usize = 201;

/// A saddle of 60 m with cells of 0.5 m.
fn saddle() -> Grid {
    let geometry = Geometry { rows: 120, cols: 120, cell: [0.5; 2], origin: CORNER };
    let height = |row: usize, col: usize| 1e-3 * (col as f64 - 50.0) * (row as f64 - 70.0);
    Grid::new(geometry, (0..120 * 120).map(|cell| height(cell / 120, cell % 120)).collect())
}

fn place(dem: &Grid, x: f64, y: f64) -> [f64; 3] {
    let [x, y] = [CORNER[0] + x, CORNER[1] + y];
    [x, y, dem.height(x, y).unwrap()]
}

/// A wedge of three that drives north-eastwards at a constant speed while a disc crosses behind it.
fn run(dem: &Grid) -> TeamRecording {
    let time = |sample: usize| sample as f64 / 10.0;
    let member = |number: i64, depth_m: f64, width_m: f64| Member {
        number,
        name: format!("member_{number}"),
        radius_m: 0.5,
        states: (0..SAMPLES)
            .map(|sample| MemberState {
                time_s: time(sample),
                position_m: place(dem, 15.0 + time(sample) - depth_m, 15.0 + time(sample) - width_m),
                heading_rad: std::f64::consts::FRAC_PI_4,
                velocity_m_s: [1.0, 1.0, 0.0],
                slot: (number < 3 || sample < 150).then_some(number),
                depth_error_m: (number > 1).then_some(0.25),
                width_error_m: (number > 1).then_some(-0.125),
                target_distance_m: 40.0 - time(sample),
            })
            .collect(),
    };
    let disc = |sample| DiscState { time_s: time(sample), position_m: place(dem, 50.0 - time(sample), 10.0) };
    let route = |time_s: f64, points: &[[f64; 2]]| PlannedRoute {
        time_s,
        points_m: points.iter().map(|&[x, y]| place(dem, x, y)).collect(),
    };
    let event = |time_s: f64, kind, member| TeamEvent { time_s, kind, member, text: "as it was planned".to_owned() };
    let bounds = |time_s: f64, squeezed| FormationBox {
        time_s,
        corners_m: [[10.0, 10.0], [16.0, 10.0], [16.0, 16.0], [10.0, 16.0]].map(|[x, y]| place(dem, x, y)),
        squeezed,
    };
    TeamRecording {
        sample_rate_hz: 10.0,
        members: vec![member(1, 0.0, 0.0), member(2, 3.0, -1.0), member(3, 3.0, 5.0)],
        routes: vec![
            route(0.0, &[[15.0, 15.0], [25.0, 25.5], [35.0, 35.0]]),
            route(8.0, &[[23.0, 23.0], [30.0, 26.5], [35.0, 35.0]]),
        ],
        search_path_m: [[15.0, 15.0], [15.0, 25.0], [35.0, 25.0], [35.0, 35.0]].map(|[x, y]| place(dem, x, y)).into(),
        vertices_m: (0..300).map(|k| place(dem, 2.0 + f64::from(k % 20), 2.0 + f64::from(k / 20))).collect(),
        boxes: vec![bounds(0.0, false), bounds(4.0, false), bounds(8.0, true)],
        obstacles: vec![[[40.0, 20.0], [45.0, 20.0], [42.0, 24.0]].map(|[x, y]| [CORNER[0] + x, CORNER[1] + y]).into()],
        moving: vec![MovingDisc { radius_m: 0.75, states: (0..SAMPLES).map(disc).collect() }],
        events: TeamEventKind::ALL.into_iter().zip(0..).map(|(kind, k)| event(f64::from(k), kind, Some(2))).collect(),
    }
}

/// Recordings of a team, read by mcap-protobuf-support, rosbags, mcap-ros2-support and Rerun, and routes, read by GDAL and PROJ: the
/// recorded numbers, for a route that was planned in advance and for routes that are planned on the way.
#[test]
fn val_readers_agree_with_a_team() {
    let Some(python) = python() else { return };
    let dem = saddle();
    for routes in [1, 2] {
        let folder = area();
        let mut recording = run(&dem);
        recording.routes.truncate(routes);
        write_files(folder.path(), &dem, &recording);
        let call = check(&python, "check_team.py", &[folder.path()]);
        assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    }
}

/// Writes the files that check_team.py reads.
fn write_files(folder: &Path, dem: &Grid, recording: &TeamRecording) {
    let terrain = TerrainView::new(dem, None).unwrap();
    let record = BTreeMap::from([("run_id".to_owned(), "team-0001".to_owned())]);
    let metadata = BTreeMap::from([("run".to_owned(), record)]);
    for (flavour, name) in [(McapFlavour::Viewer, "viewer"), (McapFlavour::Ros2, "ros2")] {
        let team = TeamMcap {
            flavour,
            recording,
            terrain: &terrain,
            start_m: [CORNER[0] + 15.0, CORNER[1] + 15.0],
            goal_m: [CORNER[0] + 35.0, CORNER[1] + 35.0],
            epoch_ns: 1_700_000_000_000_000_000,
            metadata: &metadata,
        };
        let summary = write_team(&folder.join(name).join("run.mcap"), &team).unwrap();
        write(folder, &format!("{name}.sha256"), &summary.content_sha256);
        if flavour == McapFlavour::Ros2 {
            write(&folder.join(name), "metadata.yaml", &bag_metadata("run.mcap", &summary));
        }
    }
    let properties = serde_json::json!({ "route_id": "a-0001", "cost": 31.25 });
    let routes = [Route {
        positions: recording.routes[0].points_m.clone(),
        properties: properties.as_object().unwrap().clone(),
    }];
    let crs = Crs { epsg: Some(32633), ..Crs::default() };
    write_routes(&folder.join("routes.geojson"), Some(&crs), &routes).unwrap();
    write(folder, "recording.json", &serde_json::to_string(recording).unwrap());
}
