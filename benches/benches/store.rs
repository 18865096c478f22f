//! Writing of artifacts, each compared with its floor: MCAP and Parquet with a plain write of the bytes that they put on disk,
//! GeoTIFF with bare deflate of the same samples on one thread. Throughput counts bytes before compression.

use divan::Bencher;
use divan::counter::BytesCount;
use sastrugi_numeric::{Geometry, Grid, Stream, Streams, Surface};
use sastrugi_schemas::Record;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::tables::SampleRow;
use sastrugi_schemas::topics::{
    CommandSample, ImuSample, Member, MemberState, PlannedRoute, Recording, StateSample, TeamRecording, VehicleOutline,
    WheelOutline, WheelSample, WheelState,
};
use sastrugi_store::dem::{self, Crs, WriteOptions};
use sastrugi_store::mcap::{self, MissionMcap, TeamMcap, TerrainView};
use sastrugi_store::parquet::{TableMetadata, TableWriter};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

const CELLS: usize = 1009;
const SECONDS: usize = 37;
const ROWS: i64 = 100_000;

fn main() {
    divan::main();
}

fn noise() -> Stream {
    Streams::for_seed(1, "bench").stream("noise")
}

/// A rough terrain: a random walk along each row, smoothed by the row above.
fn terrain() -> Grid {
    let mut stream = noise();
    let mut values = vec![0.0; CELLS * CELLS];
    for at in CELLS + 1..values.len() {
        values[at] = 0.5 * (values[at - 1] + values[at - CELLS]) + 0.01 * stream.normal();
    }
    Grid::new(Geometry::square(CELLS, CELLS, 0.05), values).as_stored()
}

fn recording(dem: &Grid) -> Recording {
    let mut stream = noise();
    let mut three = |scale: f64| [0, 1, 2].map(|_| scale * stream.normal());
    let position = |t: f64| [5.0 + t, 25.0, dem.height(5.0 + t, 25.0).unwrap_or(0.0)];
    let times = |rate: usize| (0..=rate * SECONDS).map(move |n| n as f64 / rate as f64);
    let state = |time_s| StateSample {
        time_s,
        position_m: position(time_s),
        orientation: [0.0, 0.0, 0.0, 1.0],
        velocity_m_s: three(0.1),
        angular_velocity_rad_s: three(0.1),
    };
    let states: Vec<StateSample> = times(20).map(state).collect();
    let imu = |time_s| ImuSample {
        time_s,
        orientation: [0.0, 0.0, 0.0, 1.0],
        angular_velocity_rad_s: three(0.1),
        specific_force_m_s2: three(1.0),
    };
    let imu = times(100).map(imu).collect();
    let mut wheel = |contact_m: [f64; 3]| {
        let ([torque_n_m, normal_force_n, slip_ratio], [longitudinal_force_n, lateral_force_n, spin_rad_s]) =
            (three(10.0), three(100.0));
        WheelState {
            angle_rad: contact_m[0] / 0.165,
            spin_rad_s,
            torque_n_m,
            normal_force_n,
            longitudinal_force_n,
            lateral_force_n,
            slip_ratio,
            contact_m,
            steering_rad: 0.0,
            hub_m: [0.25, 0.28, 0.03],
        }
    };
    let wheels = times(20)
        .map(|time_s| WheelSample {
            time_s,
            wheels: (0..4).map(|_| wheel(position(time_s))).collect(),
            chassis_force_n: 0.0,
        })
        .collect();
    let command = |time_s| CommandSample {
        time_s,
        speed_m_s: 1.0,
        yaw_rate_rad_s: 0.1,
        cross_track_m: 0.01,
        heading_error_rad: 0.02,
        distance_to_goal_m: 35.0 - time_s,
    };
    let hub =
        |name: &str, x, y| WheelOutline { name: name.to_owned(), hub_m: [x, y, 0.03], radius_m: 0.165, width_m: 0.114 };
    Recording {
        vehicle: VehicleOutline {
            name: "husky_a200".to_owned(),
            chassis_size_m: [0.99, 0.57, 0.25],
            chassis_centre_m: [0.0; 3],
            wheels: vec![hub("a", 0.26, 0.29), hub("b", 0.26, -0.29), hub("c", -0.26, 0.29), hub("d", -0.26, -0.29)],
        },
        sample_rate_hz: 20.0,
        imu_rate_hz: 100.0,
        states,
        imu,
        wheels,
        commands: times(20).map(command).collect(),
        events: vec![],
    }
}

fn with_mission<T>(f: impl FnOnce(&MissionMcap) -> T) -> T {
    let dem = terrain();
    let classes = dem.map(|z| if z < 0.0 { 0 } else { 1 });
    let recording = recording(&dem);
    let metadata = BTreeMap::new();
    let terrain = TerrainView::new(&dem, Some(&classes)).expect("classes on the same cells");
    f(&MissionMcap {
        flavour: McapFlavour::Viewer,
        recording: &recording,
        terrain: &terrain,
        start_m: [5.0, 25.0],
        goal_m: [40.0, 25.0],
        epoch_ns: 1_700_000_000_000_000_000,
        metadata: &metadata,
    })
}

/// A line of four abreast, as long as the mission, with a roadmap of 100000 vertices.
fn team(dem: &Grid) -> TeamRecording {
    let place = |x: f64, y: f64| [x, y, dem.height(x, y).unwrap_or(0.0)];
    let state = |y: f64, time_s: f64| MemberState {
        time_s,
        position_m: place(5.0 + time_s, y),
        heading_rad: 0.001 * time_s,
        velocity_m_s: [1.0, 0.001 * time_s, 0.01],
        slot: Some(1),
        depth_error_m: Some(0.01 * y),
        width_error_m: Some(0.02 * time_s),
        target_distance_m: 40.0 - time_s,
    };
    let member = |number: i64| Member {
        number,
        name: format!("member_{number}"),
        radius_m: 0.5,
        states: (0..=20 * SECONDS).map(|n| state(22.0 + 2.0 * number as f64, n as f64 / 20.0)).collect(),
    };
    TeamRecording {
        sample_rate_hz: 20.0,
        members: (1..=4).map(member).collect(),
        routes: vec![PlannedRoute { time_s: 0.0, points_m: vec![place(5.0, 25.0), place(42.0, 25.0)] }],
        search_path_m: vec![],
        vertices_m: (0..100_000).map(|k| place(0.15 * f64::from(k % 330), 0.15 * f64::from(k / 330))).collect(),
        boxes: vec![],
        obstacles: vec![],
        moving: vec![],
        events: vec![],
    }
}

fn team_37s(bencher: Bencher, flavour: McapFlavour) {
    let (folder, dem, metadata) = (folder(), terrain(), BTreeMap::new());
    let path = folder.path().join("a.mcap");
    let terrain = TerrainView::new(&dem, None).expect("a terrain");
    let recording = team(&dem);
    let (start_m, goal_m, epoch_ns) = ([5.0, 25.0], [42.0, 25.0], 1_700_000_000_000_000_000);
    let team =
        TeamMcap { flavour, recording: &recording, terrain: &terrain, start_m, goal_m, epoch_ns, metadata: &metadata };
    let (bytes, summary) = mcap::encode_team(&team).expect("a recording");
    eprintln!("{} bytes", bytes.len());
    bencher
        .counter(BytesCount::new(summary.data_bytes))
        .bench_local(|| mcap::write_team(&path, &team).expect("a file"));
}

#[divan::bench]
fn mcap_team_of_4_37s(bencher: Bencher) {
    team_37s(bencher, McapFlavour::Viewer);
}

#[divan::bench]
fn mcap_team_of_4_37s_ros2(bencher: Bencher) {
    team_37s(bencher, McapFlavour::Ros2);
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn plain_write(path: &Path, bytes: &[u8]) {
    sastrugi_store::atomic::write(path, bytes).expect("a written file");
}

#[divan::bench]
fn mcap_mission_37s(bencher: Bencher) {
    let folder = folder();
    let path = folder.path().join("a.mcap");
    with_mission(|mission| {
        let size = mcap::encode_mission(mission).expect("a recording").1.data_bytes;
        bencher.counter(BytesCount::new(size)).bench_local(|| mcap::write_mission(&path, mission).expect("a file"));
    });
}

#[divan::bench]
fn mcap_mission_37s_floor_plain_write(bencher: Bencher) {
    let folder = folder();
    let path = folder.path().join("a.mcap");
    let (bytes, summary) = with_mission(|mission| mcap::encode_mission(mission).expect("a recording"));
    bencher.counter(BytesCount::new(summary.data_bytes)).bench_local(|| plain_write(&path, &bytes));
}

fn rows() -> Vec<SampleRow> {
    let mut stream = noise();
    let mut value = || stream.normal();
    (0..ROWS)
        .map(|sample| SampleRow {
            terrain_id: "rough-0001".to_owned(),
            mission_id: format!("husky-{:04}", sample / 800),
            sample,
            time_s: (sample % 800) as f64 / 20.0,
            x_m: value(),
            y_m: value(),
            z_m: value(),
            qx: value(),
            qy: value(),
            qz: value(),
            qw: value(),
            vx_m_s: value(),
            vy_m_s: value(),
            vz_m_s: value(),
            roll_deg: value(),
            pitch_deg: value(),
            yaw_deg: value(),
            roll_rate_deg_s: value(),
            pitch_rate_deg_s: value(),
            yaw_rate_deg_s: value(),
            command_speed_m_s: 1.0,
            command_yaw_rate_deg_s: value(),
            class: Some(sample % 3),
            cross_track_m: in_steps(value(), 4096.0),
            heading_error_deg: in_steps(value(), 128.0),
            distance_to_goal_m: in_steps(value(), 4096.0),
            chassis_force_n: 0.0,
            wheel_normal_force_n: wheels(&mut || in_steps(140.0 + 20.0 * value(), 32.0) as f32),
            wheel_longitudinal_force_n: wheels(&mut || in_steps(10.0 * value(), 32.0) as f32),
            wheel_lateral_force_n: wheels(&mut || in_steps(10.0 * value(), 32.0) as f32),
            wheel_slip_ratio: wheels(&mut || in_steps(0.05 * value(), 4096.0) as f32),
            wheel_spin_rad_s: wheels(&mut || in_steps(6.0 + 0.1 * value(), 4096.0) as f32),
            wheel_torque_n_m: wheels(&mut || in_steps(2.0 * value(), 512.0) as f32),
            wheel_steering_deg: wheels(&mut || 0.0),
            wheel_contact_x_m: wheels(&mut || in_steps(value(), 16384.0)),
            wheel_contact_y_m: wheels(&mut || in_steps(value(), 16384.0)),
            wheel_contact_z_m: wheels(&mut || in_steps(value(), 16384.0)),
            outcome: "success".to_owned(),
            split: None,
        })
        .collect()
}

fn wheels<T>(value: &mut dyn FnMut() -> T) -> Vec<T> {
    (0..4).map(|_| value()).collect()
}

fn in_steps(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}

fn write_rows(path: &Path, rows: &[SampleRow]) {
    let metadata = TableMetadata {
        study_sha256: String::new(),
        seed: 1,
        version: "0".to_owned(),
        license: "CC-BY-4.0".to_owned(),
    };
    let mut writer = TableWriter::create(path, &SampleRow::TABLE, Some(&metadata)).expect("a table");
    rows.iter().for_each(|row| writer.push(row.cells()).expect("a row"));
    writer.finish().expect("a file");
}

/// Numbers of a row, bytes.
const ROW_BYTES: u64 = 26 * 8 + 4 * (7 * 4 + 3 * 8);

#[divan::bench(sample_count = 10)]
fn parquet_samples_100k(bencher: Bencher) {
    let (folder, rows) = (folder(), rows());
    let path = folder.path().join("a.parquet");
    bencher.counter(BytesCount::new(ROWS as u64 * ROW_BYTES)).bench_local(|| write_rows(&path, &rows));
}

#[divan::bench(sample_count = 10)]
fn parquet_samples_100k_floor_plain_write(bencher: Bencher) {
    let folder = folder();
    let path = folder.path().join("a.parquet");
    write_rows(&path, &rows());
    let bytes = std::fs::read(&path).expect("the file");
    bencher.counter(BytesCount::new(ROWS as u64 * ROW_BYTES)).bench_local(|| plain_write(&path, &bytes));
}

#[divan::bench(sample_count = 20)]
fn geotiff_1009(bencher: Bencher) {
    let (folder, grid) = (folder(), terrain());
    let path = folder.path().join("a.tif");
    bencher.counter(BytesCount::new(CELLS * CELLS * 4)).bench_local(|| {
        dem::write(&path, &grid, &Crs::default(), &WriteOptions::default()).expect("a file");
    });
}

#[divan::bench(sample_count = 20)]
fn geotiff_1009_floor_deflate_one_thread(bencher: Bencher) {
    let samples: Vec<u8> = terrain().values.iter().flat_map(|&v| (v as f32).to_be_bytes()).collect();
    bencher.counter(BytesCount::new(samples.len())).bench_local(|| {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(6));
        encoder.write_all(&samples).and_then(|()| encoder.finish()).expect("deflate")
    });
}
