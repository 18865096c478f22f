use super::mesh::{Patch, Square, base, terrain};
use super::*;
use ::mcap::MessageStream;
use sastrugi_numeric::{Geometry, Streams, Surface};
use sastrugi_schemas::topics::{
    self, CommandSample, Event, EventKind, ImuSample, StateSample, VIEWER, VehicleOutline, WheelOutline, WheelSample,
    WheelState,
};
use std::collections::BTreeMap as Map;
use std::f64::consts::TAU;

/// Rough ground: `waves` waves of random direction and phase, amplitude proportional to wavelength.
pub(super) fn rough(rows: usize, cols: usize, cell: f64, origin: [f64; 2], waves: usize) -> Grid {
    let mut stream = Streams::for_seed(11, "test").stream("waves");
    let waves: Vec<[f64; 4]> = (0..waves)
        .map(|k| {
            let wavelength = 8.0 / (1.0 + k as f64);
            let (sin, cos) = libm::sincos(stream.uniform_in(0.0, TAU));
            let wavenumber = TAU / wavelength;
            [wavenumber * cos, wavenumber * sin, stream.uniform_in(0.0, TAU), 0.03 * wavelength]
        })
        .collect();
    let geometry = Geometry { rows, cols, cell: [cell; 2], origin };
    let height = |x: f64, y: f64| waves.iter().map(|[a, b, p, s]| s * libm::sin(a * x + b * y + p)).sum::<f64>();
    let values = (0..rows).flat_map(|r| {
        let height = &height;
        (0..cols).map(move |c| height(c as f64 * cell, (rows - r) as f64 * cell))
    });
    Grid::new(geometry, values.collect())
}

fn outline() -> VehicleOutline {
    let wheel = |name: &str, x: f64, y: f64| WheelOutline {
        name: format!("{name}_wheel"),
        hub_m: [x, y, 0.0328],
        radius_m: 0.1651,
        width_m: 0.1143,
    };
    VehicleOutline {
        name: "husky_a200".to_owned(),
        chassis_size_m: [0.9874, 0.5709, 0.2475],
        chassis_centre_m: [0.0, 0.0, 0.12],
        wheels: vec![
            wheel("front_left", 0.256, 0.2854),
            wheel("front_right", 0.256, -0.2854),
            wheel("rear_left", -0.256, 0.2854),
            wheel("rear_right", -0.256, -0.2854),
        ],
    }
}

/// A straight, level drive eastwards over the ground, with contact points on the bilinear surface under the wheels.
fn drive(dem: &Grid, start: [f64; 2], seconds: usize) -> Recording {
    let vehicle = outline();
    let mut stream = Streams::for_seed(12, "test").stream("imu");
    let time = |n: usize, rate: f64| n as f64 / rate;
    let at = |t: f64| {
        let (x, y) = (start[0] + t, start[1] + 0.1 * libm::sin(t));
        [x, y, dem.height(x, y).unwrap() + 0.13]
    };
    let states: Vec<StateSample> = (0..=20 * seconds)
        .map(|n| StateSample {
            time_s: time(n, 20.0),
            position_m: at(time(n, 20.0)),
            orientation: {
                let (s, c) = libm::sincos(0.05 * libm::sin(time(n, 20.0)));
                [0.0, s, 0.0, c]
            },
            velocity_m_s: [1.0, 0.1 * libm::cos(time(n, 20.0)), stream.normal() * 0.1],
            angular_velocity_rad_s: [stream.normal() * 0.1, stream.normal() * 0.1, stream.normal() * 0.02],
        })
        .collect();
    let wheel = |state: &StateSample, outline: &WheelOutline, stream: &mut sastrugi_numeric::Stream| {
        let [x, y] = [0, 1].map(|axis| state.position_m[axis] + outline.hub_m[axis]);
        WheelState {
            angle_rad: state.time_s / 0.1651,
            spin_rad_s: 6.0 + stream.normal() * 0.1,
            torque_n_m: stream.normal(),
            normal_force_n: 140.0 + 20.0 * stream.normal(),
            longitudinal_force_n: 10.0 * stream.normal(),
            lateral_force_n: 10.0 * stream.normal(),
            slip_ratio: 0.01 * stream.normal(),
            contact_m: [x, y, dem.height(x, y).unwrap()],
            steering_rad: 0.0,
            hub_m: outline.hub_m,
        }
    };
    let wheels = states
        .iter()
        .map(|s| WheelSample {
            time_s: s.time_s,
            wheels: vehicle.wheels.iter().map(|w| wheel(s, w, &mut stream)).collect(),
            chassis_force_n: 0.0,
        })
        .collect();
    let imu = (0..=100 * seconds)
        .map(|n| ImuSample {
            time_s: time(n, 100.0),
            orientation: [0.0, 0.0, 0.0, 1.0],
            angular_velocity_rad_s: [0.1, 0.1, 0.02].map(|s| s * stream.normal()),
            specific_force_m_s2: [0.3 * stream.normal(), 0.3 * stream.normal(), 9.81 + stream.normal()],
        })
        .collect();
    let commands = states
        .iter()
        .map(|s| CommandSample {
            time_s: s.time_s,
            speed_m_s: 1.0,
            yaw_rate_rad_s: 0.1 * stream.normal(),
            cross_track_m: s.position_m[1] - start[1],
            heading_error_rad: 0.05 * stream.normal(),
            distance_to_goal_m: seconds as f64 - s.time_s,
        })
        .collect();
    let event = |time_s, kind, text: &str| Event { time_s, kind, text: text.to_owned() };
    Recording {
        vehicle,
        sample_rate_hz: 20.0,
        imu_rate_hz: 100.0,
        states,
        imu,
        wheels,
        commands,
        events: vec![
            event(0.0, EventKind::Start, "start"),
            event(seconds as f64, EventKind::Success, "reached the goal after 36 s"),
        ],
    }
}

fn metadata() -> Map<String, Map<String, String>> {
    let record = |key: &str, value: &str| Map::from([(key.to_owned(), value.to_owned())]);
    Map::from([
        ("mission".to_owned(), record("mission_id", "drive-0001")),
        ("hashes".to_owned(), record("terrain_sha256", "00")),
    ])
}

fn classes(dem: &Grid) -> Grid<u8> {
    dem.map(|z| if z < -0.1 { 0 } else { u8::from(z > 0.1) + 1 })
}

struct Scene {
    dem: Grid,
    classes: Grid<u8>,
    recording: Recording,
    metadata: Map<String, Map<String, String>>,
}

impl Scene {
    fn new(cells: usize, seconds: usize) -> Self {
        let dem = rough(cells, cells, 0.05, [500_000.0, 4_000_000.0], 24);
        let start = [500_002.0, 4_000_000.0 + 0.025 * cells as f64];
        let recording = drive(&dem, start, seconds);
        Self { classes: classes(&dem), dem, recording, metadata: metadata() }
    }

    fn terrain(&self) -> TerrainView<'_> {
        TerrainView::new(&self.dem, Some(&self.classes)).unwrap()
    }

    fn ros2<'a>(&'a self, terrain: &'a TerrainView<'a>) -> MissionMcap<'a> {
        MissionMcap { flavour: McapFlavour::Ros2, ..self.mission(terrain) }
    }

    fn mission<'a>(&'a self, terrain: &'a TerrainView<'a>) -> MissionMcap<'a> {
        MissionMcap {
            flavour: McapFlavour::Viewer,
            recording: &self.recording,
            terrain,
            start_m: [500_002.0, 4_000_000.0 + 2.0],
            goal_m: [500_004.0, 4_000_000.0 + 2.0],
            epoch_ns: 1_700_000_000_000_000_000,
            metadata: &self.metadata,
        }
    }
}

#[test]
fn val_messages_are_read_back_in_order_with_every_checksum() {
    let scene = Scene::new(160, 3);
    let (bytes, summary) = encode_mission(&scene.mission(&scene.terrain())).unwrap();
    let messages: Vec<_> = MessageStream::new(&bytes).unwrap().collect::<Result<_, _>>().unwrap();
    assert_eq!(messages.len() as u64, summary.messages);
    assert!(messages.windows(2).all(|pair| pair[0].log_time <= pair[1].log_time));
    let count = |topic: &str| messages.iter().filter(|m| m.channel.topic == topic).count();
    let counts = VIEWER.map(|topic| count(topic.name));
    assert_eq!(counts, [1, 1, 1, 1, 61, 61, 61, 301, 61, 61, 2]);
    assert_eq!(messages.last().unwrap().log_time, 1_700_000_003_000_000_000);
    let found = ::mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(found.metadata_indexes.len(), 2);
    assert_eq!(encode_mission(&scene.mission(&scene.terrain())).unwrap().0, bytes);
}

/// Bytes of a mission in both flavours, to detect changes of the encoder or of the shared writer.
#[test]
fn gold_bytes_of_a_mission() {
    let scene = Scene::new(160, 3);
    let view = scene.terrain();
    let found =
        [scene.mission(&view), scene.ros2(&view)].map(|m| crate::digest::of_bytes(&encode_mission(&m).unwrap().0));
    assert_eq!(found, GOLD_MISSIONS);
}
const GOLD_MISSIONS: [&str; 2] = [
    "d3bdd4135caa9aeaf50095c13116a991e130072783c8d0e42a9e78d5a04aa1c1",
    "dfdaadb6ecb37ce96b0ee3ed069c2caeadd09b8ee569e167c123e67fe3dc350b",
];

#[test]
fn val_own_messages_match_their_descriptions() {
    let scene = Scene::new(120, 1);
    let r = &scene.recording;
    let names = vec![String::new(); 4];
    for (topic, values) in [
        (&topics::state::TOPIC, viewer::state_values(&r.states[0])),
        (&topics::imu::TOPIC, viewer::imu_values(&r.imu[0])),
        (&topics::wheels::TOPIC, viewer::wheel_values(&names, &r.wheels[0])),
        (&topics::command::TOPIC, viewer::command_values(&r.commands[0])),
    ] {
        let described: Vec<_> = topic.fields.iter().map(|f| f.kind).collect();
        assert_eq!(values.iter().map(protobuf::Value::kind).collect::<Vec<_>>(), described, "{}", topic.name);
    }
    for topic in VIEWER {
        assert_ne!(topic.fields.is_empty(), viewer::public_schema(topic).is_none(), "{}", topic.name);
    }
}

/// Every topic and field named in the mission panels of the layout is recorded, and every panel that it arranges is defined.
#[test]
fn val_the_layout_matches_the_recorded_topics() {
    let layout: serde_json::Value = serde_json::from_str(VIEWER_LAYOUT).unwrap();
    let topic = |name: &str| VIEWER.into_iter().find(|t| t.name == name).unwrap_or_else(|| panic!("{name}"));
    let panels = layout["configById"].as_object().unwrap();
    let shown = panels["3D!terrain"]["topics"].as_object().unwrap();
    assert!(!shown.is_empty());
    shown.keys().for_each(|name| assert_eq!(topic(name).name, name));
    topic(panels["RosOut!events"]["topicToRender"].as_str().unwrap());
    for panel in ["Plot!attitude", "Plot!acceleration", "Plot!speed"] {
        let paths = panels[panel]["paths"].as_array().unwrap();
        assert!(!paths.is_empty(), "{panel}");
        for path in paths {
            let (name, field) = path["value"].as_str().unwrap().split_once('.').unwrap();
            assert!(topic(name).fields.iter().any(|f| f.name == field), "{name} has no {field}");
        }
    }
    let tabs = panels["Tab!recording"]["tabs"].to_string();
    assert_eq!(layout["layout"], "Tab!recording");
    assert!(panels.keys().all(|panel| panel == "Tab!recording" || tabs.contains(panel.as_str())), "{tabs}");
}

/// The angles of a state have the same signs as in the tables: nose down is positive pitch, left side up is positive roll.
#[test]
fn val_states_have_roll_and_pitch() {
    let scene = Scene::new(120, 1);
    let half = |degrees: f64| libm::sincos(0.5 * degrees.to_radians());
    for (orientation, roll_deg, pitch_deg) in [
        ([half(12.0).0, 0.0, 0.0, half(12.0).1], 12.0, 0.0),
        ([0.0, half(20.0).0, 0.0, half(20.0).1], 0.0, 20.0),
        ([0.0, half(-30.0).0, 0.0, half(-30.0).1], 0.0, -30.0),
        ([0.0, 0.0, half(70.0).0, half(70.0).1], 0.0, 0.0),
    ] {
        let values = viewer::state_values(&StateSample { orientation, ..scene.recording.states[0] });
        let angles: Vec<f64> =
            values[13..].iter().map(|v| if let protobuf::Value::Float(v) = v { *v } else { 99.0 }).collect();
        assert_eq!(angles, [roll_deg, pitch_deg], "{orientation:?}");
    }
}

/// Triangles of all patches by their corners in the map frame.
fn triangles(patches: &[Patch]) -> Vec<[[f64; 3]; 3]> {
    let corner = |p: &Patch, i: u32| [0, 1, 2].map(|axis| p.origin[axis] + p.points[i as usize][axis]);
    patches.iter().flat_map(|p| p.triangles.iter().map(move |t| t.map(|i| corner(p, i)))).collect()
}

fn plan_area([a, b, c]: &[[f64; 3]; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]))
}

#[test]
fn prop_the_mesh_covers_the_terrain_once_and_has_no_gaps() {
    for (rows, cols) in [(160, 160), (97, 130), (58, 34), (9, 300), (2, 2), (10, 18)] {
        let dem = rough(rows, cols, 0.5, [0.0; 2], 8);
        let near: Vec<Square> =
            (0..cols).map(|c| Square { centre: [c as f64 * 0.5, 0.1 * c as f64], half_side: 1.0 }).collect();
        let triangles = triangles(&terrain(&dem, None, 0.0, &near));
        assert!(triangles.iter().all(|t| plan_area(t) > -1e-12));
        let area: f64 = triangles.iter().map(plan_area).sum();
        let expected = (rows - 1) as f64 * (cols - 1) as f64 * 0.25;
        assert!((area - expected).abs() < 1e-9 * expected, "{rows} x {cols}: {area} of {expected}");
        // An interior edge has two triangles, a border edge has one.
        let key = |p: &[f64; 3]| [0, 1, 2].map(|axis| (p[axis] * 1024.0).round() as i64);
        let mut edges: Map<_, u32> = Map::new();
        for t in &triangles {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (key(&t[a]), key(&t[b]));
                *edges.entry(if a < b { (a, b) } else { (b, a) }).or_default() += 1;
            }
        }
        let border = |p: &[i64; 3]| {
            let [col, row] = [p[0] as f64 / 512.0 - 0.5, p[1] as f64 / 512.0 - 0.5];
            col == 0.0 || row == 0.0 || col == (cols - 1) as f64 || row == (rows - 1) as f64
        };
        let open = edges.iter().filter(|(_, n)| **n == 1).all(|((a, b), _)| border(a) && border(b));
        assert!(open && edges.values().all(|&n| n <= 2), "{rows} x {cols} has a gap");
    }
}

/// Heights above their base share their floating-point exponent, whatever the relief; the search also ends for absurd heights.
#[test]
fn prop_heights_lie_within_one_power_of_two() {
    let exponent = |v: f64| v.to_bits() >> 52;
    for (low, high) in [(0.0, 0.0), (-0.3, 0.4), (-1.0, 15.0), (3.2, 19.9), (1234.5, 2600.0), (-8000.0, 8848.0)] {
        let base = base(low, high);
        assert_eq!(exponent(low - base), exponent(high - base), "{low} to {high} m from {base} m");
    }
    assert!(!base(f64::MIN, f64::MAX).is_finite());
}

/// Largest vertical distance between contact points and the mesh: at most 1 cm.
#[test]
fn val_wheels_stand_on_the_mesh() {
    let scene = Scene::new(400, 12);
    let view = scene.terrain();
    let mission = scene.mission(&view);
    let triangles = triangles(&terrain(&scene.dem, None, 0.0, &frames::corridor(&mission)));
    let contacts = scene.recording.wheels.iter().flat_map(|s| &s.wheels).map(|w| w.contact_m);
    let worst = contacts.step_by(7).map(|p| off_mesh(&triangles, p)).max_by(f64::total_cmp).unwrap();
    eprintln!("largest distance of a contact from the mesh: {:.2} mm", 1e3 * worst);
    assert!(worst < 0.01, "{worst} m");
}

fn off_mesh(triangles: &[[[f64; 3]; 3]], p: [f64; 3]) -> f64 {
    let height = |t: &[[f64; 3]; 3]| {
        let area = plan_area(t);
        let share = |k: usize| {
            let mut part = *t;
            part[k] = p;
            plan_area(&part) / area
        };
        let shares = [share(0), share(1), share(2)];
        let inside = area > 0.0 && shares.iter().all(|&s| s >= -1e-9);
        inside.then(|| (0..3).map(|k| shares[k] * t[k][2]).sum::<f64>())
    };
    triangles.iter().find_map(height).map_or(f64::INFINITY, |z| (z - p[2]).abs())
}

/// The axle of a wheel steered to the left points left and back, however far the wheel has rolled; a quarter turn forward moves the
/// top of a straight wheel to the front.
#[test]
fn val_wheels_are_steered_and_rolled() {
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12);
    let quarter = std::f64::consts::FRAC_PI_2;
    assert!(near(frames::rotated(frames::wheel_rotation(0.0, quarter), [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]));
    let (sin, cos) = libm::sincos(0.3);
    for angle in [0.0, 1.0, 100.0] {
        assert!(near(frames::rotated(frames::wheel_rotation(0.3, angle), [0.0, 1.0, 0.0]), [-sin, cos, 0.0]));
    }
}

/// A mission of 37 s on a terrain of 1009 x 1009 cells stays within the documented file size.
#[test]
fn val_a_mission_is_small() {
    let scene = Scene::new(1009, 37);
    let (bytes, summary) = encode_mission(&scene.mission(&scene.terrain())).unwrap();
    eprintln!("{} bytes, {} messages", bytes.len(), summary.messages);
    if let Ok(path) = std::env::var("SASTRUGI_KEEP_MCAP") {
        std::fs::write(path, &bytes).unwrap();
    }
    assert!(bytes.len() < 585_000, "{} bytes", bytes.len());
}

#[test]
fn val_holes_are_not_drawn() {
    let mut scene = Scene::new(160, 3);
    scene.dem.values[80 * 160 + 70] = f64::NAN;
    scene.dem.values[3] = f64::NAN;
    let patches = terrain(&scene.dem, None, 0.0, &frames::corridor(&scene.mission(&scene.terrain())));
    assert!(patches.iter().flat_map(|p| &p.points).flatten().all(|v| v.is_finite()));
    encode_mission(&scene.mission(&scene.terrain())).unwrap();
}

#[test]
fn val_impossible_recordings_are_refused() {
    let mut scene = Scene::new(120, 1);
    let view = scene.terrain();
    let mut late = scene.mission(&view);
    late.epoch_ns = u64::MAX;
    assert!(matches!(encode_mission(&late), Err(McapError::Unfit { .. })));
    scene.recording.wheels[3].wheels.pop();
    assert!(matches!(encode_mission(&scene.mission(&scene.terrain())), Err(McapError::Unfit { .. })));
    scene.recording.states.clear();
    assert!(matches!(encode_mission(&scene.mission(&scene.terrain())), Err(McapError::Unfit { .. })));
}

/// A recording is read back bit for bit (values of the inertial unit in the steps of their topic), also from a truncated file; any
/// truncation and any flipped byte is reported or harmless, never a panic.
#[test]
fn prop_logs_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let scene = Scene::new(160, 3);
    let (bytes, _) = encode_mission(&scene.mission(&scene.terrain())).unwrap();
    let recording = &scene.recording;
    std::fs::write(&path, &bytes).unwrap();
    let log = read_log(&path).unwrap();
    let states = log.poses.iter().find(|s| s.schema == "sastrugi.VehicleState").unwrap();
    assert_eq!(states.poses.len(), recording.states.len());
    for (read, wrote) in states.poses.iter().zip(&recording.states) {
        assert_eq!((read.position_m, read.orientation), (wrote.position_m, wrote.orientation));
        assert_eq!(read.angular_velocity_rad_s, Some(wrote.angular_velocity_rad_s));
    }
    assert!(log.poses.iter().any(|s| s.schema == "foxglove.PoseInFrame"));
    assert!(log.transforms.iter().any(|t| (t.parent.as_str(), t.child.as_str()) == ("map", "base_link")));
    assert_eq!(log.imus[0].samples.len(), recording.imu.len());
    assert_eq!(log.events.len(), recording.events.len());
    assert!(log.broken.is_none() && log.unread.is_empty());
    for cut in (0..bytes.len()).step_by(bytes.len() / 97 + 1) {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        match read_log(&path) {
            Ok(part) => assert!(part.broken.unwrap().contains("is truncated after"), "{cut}"),
            Err(error) => assert!(error.to_string().contains("not an MCAP file"), "{cut}: {error}"),
        }
        let mut flipped = bytes.clone();
        flipped[cut] ^= 0x55;
        std::fs::write(&path, &flipped).unwrap();
        let _ = read_log(&path);
    }
}

/// An attachment that ends within its own header, on which the parser of records panics: found by the fuzz target `log`.
#[test]
fn val_a_short_attachment_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    std::fs::write(&path, include_bytes!("../../../../fuzz/seeds/log/short_attachment.mcap")).unwrap();
    let error = read_log(&path).unwrap_err().to_string();
    assert!(error.contains("the file is damaged after 0 messages: malformed record"), "{error}");
    // The same record as the summary of a file.
    let record = &std::fs::read(&path).unwrap()[8..8 + 9 + 41];
    let mut bytes = ::mcap::MAGIC.to_vec();
    bytes.extend_from_slice(record);
    bytes.extend([&[2][..], &20_u64.to_le_bytes(), &8_u64.to_le_bytes(), &[0; 12], ::mcap::MAGIC].concat());
    std::fs::write(&path, bytes).unwrap();
    let error = describe_file(&path).unwrap_err().to_string();
    assert!(error.contains("not a complete MCAP file"), "{error}");
}

/// A ROS 2 recording has the exact numbers of the recording, and its file nothing of the other flavour.
#[test]
fn prop_ros2_recordings_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    let scene = Scene::new(160, 3);
    let (bytes, summary) = encode_mission(&scene.ros2(&scene.terrain())).unwrap();
    let counts: Vec<u64> = summary.channels.iter().map(|channel| channel.messages).collect();
    assert_eq!(counts, [1, 1, 1, 61, 61, 301, 61, 61, 2]);
    assert_eq!(summary.end_ns - summary.start_ns, 3_000_000_000);
    let found = ::mcap::Summary::read(&bytes).unwrap().unwrap();
    assert!(found.channels.values().all(|c| c.message_encoding == "cdr"));
    assert!(found.schemas.values().all(|s| s.encoding == "ros2msg"));
    std::fs::write(&path, &bytes).unwrap();
    let (log, recording) = (read_log(&path).unwrap(), &scene.recording);
    assert_eq!(log.poses[0].poses.len(), recording.states.len());
    for (read, wrote) in log.poses[0].poses.iter().zip(&recording.states) {
        assert_eq!((read.position_m, read.orientation), (wrote.position_m, wrote.orientation));
        assert_eq!(read.angular_velocity_rad_s, Some(wrote.angular_velocity_rad_s));
    }
    assert_eq!(log.imus[0].samples.len(), recording.imu.len());
    for (read, wrote) in log.imus[0].samples.iter().zip(&recording.imu) {
        assert_eq!(read.specific_force_m_s2, wrote.specific_force_m_s2);
    }
    assert!(log.transforms.iter().any(|t| (t.parent.as_str(), t.child.as_str()) == ("base_link", "rear_right_wheel")));
    assert_eq!(log.events.last().map(|(_, name)| name.as_str()), Some("success"));
    assert_eq!(encode_mission(&scene.ros2(&scene.terrain())).unwrap().0, bytes);
}

/// The grid map has the terrain's own heights if its cells coincide with the terrain's, from the north-east corner westward, and
/// interpolated heights otherwise; cells without data are NaN.
#[test]
fn val_a_grid_map_has_the_heights() {
    let mut dem = rough(90, 70, 0.5, [500_000.3, 4_000_000.7], 6);
    dem.values[5] = f64::NAN;
    let classes = classes(&dem);
    let map = ros2::grid_map(&dem, Some(&classes));
    assert_eq!((map.resolution, map.length_x, map.length_y), (0.5, 35.0, 45.0));
    assert_eq!(map.layers, ["elevation", "class"]);
    for (j, i) in (0..90).flat_map(|j| (0..70).map(move |i| (j, i))) {
        let z = dem.at(j, 69 - i) as f32;
        let found = map.data[0].data[j * 70 + i];
        assert!(found == z || found.is_nan() && (!z.is_finite() || near_hole(j, 69 - i)), "{j} {i}: {found} of {z}");
    }
    let large = rough(400, 401, 0.05, [0.0; 2], 6);
    let map = ros2::grid_map(&large, None);
    assert!(map.resolution > 0.15 && map.data[0].data.len() <= 128 * 128);
    let [nx, ny] = [map.length_x, map.length_y].map(|length| (length / map.resolution).round() as usize);
    for (j, i) in [(0, 0), (3, 7), (ny - 1, nx - 1)] {
        let x = map.position[0] + 0.5 * map.length_x - (i as f64 + 0.5) * map.resolution;
        let y = map.position[1] + 0.5 * map.length_y - (j as f64 + 0.5) * map.resolution;
        assert!((f64::from(map.data[0].data[j * nx + i]) - large.height(x, y).unwrap()).abs() < 1e-6, "{j} {i}");
    }
}

/// A cell next to the hole of [`val_a_grid_map_has_the_heights`].
fn near_hole(row: usize, col: usize) -> bool {
    row <= 1 && col.abs_diff(5) <= 1
}

/// The points of the cloud are the vertices of the mesh.
#[test]
fn prop_points_are_the_vertices_of_the_mesh() {
    let scene = Scene::new(160, 3);
    let near = frames::corridor(&scene.mission(&scene.terrain()));
    let key = |x: f64, y: f64| ((x * 1000.0).round() as i64, (y * 1000.0).round() as i64);
    let g = &scene.dem.geometry;
    let nodes: std::collections::BTreeSet<_> =
        super::mesh::nodes(g, &near).into_iter().map(|(row, col)| key(g.x(col), g.y(row))).collect();
    let corners = triangles(&terrain(&scene.dem, None, 0.0, &near)).into_iter().flatten();
    let corners: std::collections::BTreeSet<_> = corners.map(|[x, y, _]| key(x, y)).collect();
    assert_eq!(nodes, corners);
}
