use super::super::tests::rough;
use super::super::{VIEWER_LAYOUT, bag_metadata, protobuf, read_log};
use super::drawing::{changes, laid, looking_ahead, thinned, yaw_rate};
use super::*;
use crate::digest::ContentHash;
use ::mcap::{Message, MessageStream};
use foxglove::messages as fox;
use proptest::prelude::*;
use prost::Message as _;
use sastrugi_numeric::{Grid, Surface};
use sastrugi_schemas::topics::{DiscState, FormationBox, Member, MemberState, MovingDisc, PlannedRoute};
use std::collections::BTreeMap as Map;

const EPOCH_NS: u64 = 1_700_000_000_000_000_000;
const CORNER: [f64; 2] = [500_000.0, 4_000_000.0];

fn ground() -> Grid {
    rough(120, 120, 0.5, CORNER, 16)
}

/// A column of three that drives eastwards for some seconds at 20 Hz; the leader has number 2.
fn drive(dem: &Grid, seconds: usize) -> TeamRecording {
    let on_ground = |x: f64, y: f64| [x, y, dem.height(x, y).unwrap()];
    let time = |n: usize| n as f64 / 20.0;
    let state = |slot: i64, t: f64| {
        let depth_m = 4.0 * (slot - 1) as f64;
        let wave = 0.5 * libm::sin(t);
        MemberState {
            time_s: t,
            position_m: on_ground(CORNER[0] + 15.0 + t - depth_m, CORNER[1] + 30.0 + wave),
            heading_rad: libm::atan2(0.5 * libm::cos(t), 1.0),
            velocity_m_s: [1.0, 0.5 * libm::cos(t), 0.01],
            slot: Some(slot),
            depth_error_m: (slot > 1).then_some(0.01 * t),
            width_error_m: (slot > 1).then_some(-0.02 * t),
            target_distance_m: 30.0 - t,
        }
    };
    let members = [(1, 2), (2, 1), (3, 3)].map(|(number, slot)| Member {
        number,
        name: format!("member_{number}"),
        radius_m: 0.5,
        states: (0..=20 * seconds).map(|n| state(slot, time(n))).collect(),
    });
    let disc =
        |n: usize| DiscState { time_s: time(n), position_m: on_ground(CORNER[0] + 30.0, CORNER[1] + 20.0 + time(n)) };
    let corners = |x: f64, y: f64| [[x, y, 0.0], [x, y + 2.0, 0.0], [x - 8.0, y + 2.0, 0.0], [x - 8.0, y, 0.0]];
    let bounds =
        |t: f64, squeezed| FormationBox { time_s: t, corners_m: corners(CORNER[0] + 15.0, CORNER[1] + 29.0), squeezed };
    let event = |time_s: f64, kind, member| TeamEvent { time_s, kind, member, text: format!("it is {time_s} s") };
    let ends = [[15.0, 30.0], [30.0, 32.0], [45.0, 30.0]].map(|[x, y]| on_ground(CORNER[0] + x, CORNER[1] + y));
    TeamRecording {
        sample_rate_hz: 20.0,
        members: members.into(),
        routes: vec![PlannedRoute { time_s: 0.0, points_m: ends.into() }],
        search_path_m: (0..12).map(|k| on_ground(CORNER[0] + 15.0 + 2.5 * f64::from(k), CORNER[1] + 33.0)).collect(),
        vertices_m: (0..400)
            .map(|k| on_ground(CORNER[0] + 1.25 + 2.5 * f64::from(k % 20), CORNER[1] + 2.0 + 2.5 * f64::from(k / 20)))
            .collect(),
        boxes: vec![bounds(0.0, false), bounds(0.5, false), bounds(1.0, true)],
        obstacles: vec![[[20.0, 40.0], [26.0, 40.0], [23.0, 45.0]].map(|[x, y]| [CORNER[0] + x, CORNER[1] + y]).into()],
        moving: vec![MovingDisc { radius_m: 0.75, states: (0..=20 * seconds).map(disc).collect() }],
        events: vec![
            event(0.0, TeamEventKind::Start, None),
            event(1.0, TeamEventKind::Squeezed, Some(3)),
            event(seconds as f64, TeamEventKind::End, None),
        ],
    }
}

struct Scene {
    dem: Grid,
    recording: TeamRecording,
    metadata: Map<String, Map<String, String>>,
}

impl Scene {
    fn new(seconds: usize) -> Self {
        let dem = ground();
        let record = Map::from([("run_id".to_owned(), "team-0001".to_owned())]);
        Self { recording: drive(&dem, seconds), dem, metadata: Map::from([("run".to_owned(), record)]) }
    }

    fn encode(&self, flavour: McapFlavour) -> Result<(Vec<u8>, McapSummary), McapError> {
        let terrain = TerrainView::new(&self.dem, None)?;
        encode_team(&TeamMcap {
            flavour,
            recording: &self.recording,
            terrain: &terrain,
            start_m: [CORNER[0] + 15.0, CORNER[1] + 30.0],
            goal_m: [CORNER[0] + 45.0, CORNER[1] + 30.0],
            epoch_ns: EPOCH_NS,
            metadata: &self.metadata,
        })
    }

    fn refusal(&self) -> String {
        self.encode(McapFlavour::Viewer).map(|_| ()).unwrap_err().to_string()
    }
}

fn read(bytes: &[u8]) -> Vec<Message<'_>> {
    MessageStream::new(bytes).unwrap().collect::<Result<_, _>>().unwrap()
}

fn on<'a>(messages: &'a [Message<'_>], topic: &'a str) -> impl Iterator<Item = &'a Message<'a>> {
    messages.iter().filter(move |message| message.channel.topic == topic)
}

fn counts(summary: &McapSummary) -> Vec<(&str, u64)> {
    summary.channels.iter().map(|channel| (channel.name.as_str(), channel.messages)).collect()
}

/// Messages are ordered by time, with the stated number and hash; encoding again gives the same bytes.
#[test]
fn val_messages_are_read_back_in_order_with_their_hash() {
    let scene = Scene::new(3);
    for flavour in [McapFlavour::Viewer, McapFlavour::Ros2] {
        let (bytes, summary) = scene.encode(flavour).unwrap();
        let messages = read(&bytes);
        assert_eq!(messages.len() as u64, summary.messages);
        assert!(messages.windows(2).all(|pair| pair[0].log_time <= pair[1].log_time));
        let mut content = ContentHash::new("messages");
        for message in &messages {
            content.text(&message.channel.topic);
            content.u64(message.log_time);
            content.bytes(&message.data);
        }
        assert_eq!(content.finish(), summary.content_sha256);
        for (name, count) in counts(&summary) {
            assert_eq!(on(&messages, name).count() as u64, count, "{name}");
        }
        assert_eq!((summary.start_ns, summary.end_ns), (EPOCH_NS, EPOCH_NS + 3_000_000_000));
        assert_eq!(::mcap::Summary::read(&bytes).unwrap().unwrap().metadata_indexes.len(), 1);
        assert_eq!(scene.encode(flavour).unwrap().0, bytes);
    }
}

#[test]
fn val_every_topic_is_written() {
    let scene = Scene::new(3);
    let (_, viewer) = scene.encode(McapFlavour::Viewer).unwrap();
    let expected = [
        ("/terrain/mesh", 1),
        ("/terrain/grid", 1),
        ("/team/shape", 1),
        ("/team/route", 1),
        ("/team/paths", 1),
        ("/team/graph", 1),
        ("/team/box", 2),
        ("/tf", 61),
        ("/team/state", 61),
        ("/events", 3),
    ];
    assert_eq!(counts(&viewer), expected);
    let (_, ros2) = scene.encode(McapFlavour::Ros2).unwrap();
    let expected = [
        ("/tf_static", 1),
        ("/terrain", 1),
        ("/terrain/points", 1),
        ("/tf", 61),
        ("/team/route", 1),
        ("/team/markers", 1),
        ("/team/box", 2),
        ("/member_1/odom", 61),
        ("/member_1/path", 1),
        ("/member_2/odom", 61),
        ("/member_2/path", 1),
        ("/member_3/odom", 61),
        ("/member_3/path", 1),
        ("/events", 3),
    ];
    assert_eq!(counts(&ros2), expected);
    let bag = bag_metadata("run.mcap", &ros2);
    assert!(bag.contains("name: /member_3/odom\n        type: nav_msgs/msg/Odometry"), "{bag}");
    assert_eq!(bag.matches("durability: 1").count(), 3 + 2 + 3, "{bag}");
}

/// Positions, speeds and errors are the exact numbers of the recording.
#[test]
fn val_the_viewer_has_the_recorded_numbers() {
    let scene = Scene::new(1);
    let (bytes, _) = scene.encode(McapFlavour::Viewer).unwrap();
    let messages = read(&bytes);
    for (sample, message) in on(&messages, "/tf").enumerate() {
        let found = fox::FrameTransforms::decode(message.data.as_ref()).unwrap().transforms;
        let names: Vec<&str> = found.iter().map(|one| one.child_frame_id.as_str()).collect();
        assert_eq!(names, ["member_1", "member_2", "member_3", "moving_1"]);
        for (one, member) in found.iter().zip(&scene.recording.members) {
            let at = one.translation.unwrap();
            assert_eq!([at.x, at.y, at.z], member.states[sample].position_m);
        }
    }
    let names = scene.recording.members.iter().map(|member| member.name.clone()).collect::<Vec<_>>();
    let values = viewer::state_values(&scene.recording, &names, 20);
    let kinds: Vec<_> = topics::team_state::TOPIC.fields.iter().map(|field| field.kind).collect();
    assert_eq!(values.iter().map(protobuf::Value::kind).collect::<Vec<_>>(), kinds);
    let numbers: Vec<&Vec<f64>> =
        values.iter().filter_map(|v| if let protobuf::Value::Doubles(v) = v { Some(v) } else { None }).collect();
    assert_eq!(numbers[5], &[2.0, 1.0, 3.0]);
    assert_eq!((numbers[6], numbers[7]), (&vec![0.01, 0.0, 0.01], &vec![-0.02, 0.0, -0.02]));
    let speed = libm::hypot(1.0, 0.5 * libm::cos(1.0));
    assert_eq!(numbers[4], &[speed; 3]);
    for topic in TEAM_VIEWER {
        assert_ne!(topic.fields.is_empty(), super::super::viewer::public_schema(topic).is_none(), "{}", topic.name);
    }
}

/// The reader of foreign logs finds an odometry for every member.
#[test]
fn val_ros2_has_the_recorded_numbers() {
    let scene = Scene::new(1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, scene.encode(McapFlavour::Ros2).unwrap().0).unwrap();
    let log = read_log(&path).unwrap();
    assert!(log.broken.is_none());
    let odometry: Vec<_> = log.poses.iter().filter(|series| series.schema == "nav_msgs/msg/Odometry").collect();
    assert_eq!(odometry.len(), 3);
    for (found, member) in odometry.iter().zip(&scene.recording.members) {
        assert_eq!(found.poses.len(), member.states.len());
        for (pose, state) in found.poses.iter().zip(&member.states) {
            assert_eq!(pose.position_m, state.position_m);
            let turned = super::super::frames::rotated(pose.orientation, [1.0, 0.0, 0.0]);
            assert!((turned[0] - libm::cos(state.heading_rad)).abs() < 1e-12 && turned[2] == 0.0);
        }
    }
    assert_eq!(log.events.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>(), ["start", "squeezed", "end"]);
}

/// A heading that wraps around does not turn the long way round.
#[test]
fn val_yaw_rates_take_the_shorter_turn() {
    let at = |time_s, heading_rad| MemberState { time_s, heading_rad, ..drive(&ground(), 0).members[0].states[0] };
    for (before, after, rate) in [(3.1, -3.1, 0.8318530717958623), (-3.1, 3.1, -0.8318530717958623), (0.1, 0.3, 2.0)] {
        assert!((yaw_rate(&at(0.0, before), &at(0.1, after)) - rate).abs() < 1e-12, "{before} to {after}");
    }
    assert_eq!(yaw_rate(&at(1.0, 0.0), &at(1.0, 1.0)), 0.0);
}

/// Every kind of event is a message with its name; members are named; waits are at debug level, losses are warnings.
#[test]
fn val_every_kind_of_event() {
    let mut scene = Scene::new(1);
    let event = |(kind, k): (TeamEventKind, i64)| TeamEvent {
        time_s: 0.01 * k as f64,
        kind,
        member: (k > 0).then_some(1 + k % 3),
        text: "that is it".to_owned(),
    };
    scene.recording.events = TeamEventKind::ALL.into_iter().zip(0..).map(event).collect();
    let (bytes, _) = scene.encode(McapFlavour::Viewer).unwrap();
    let messages = read(&bytes);
    let logs: Vec<fox::Log> =
        on(&messages, "/events").map(|message| fox::Log::decode(message.data.as_ref()).unwrap()).collect();
    assert_eq!(logs.len(), TeamEventKind::ALL.len());
    for (log, kind) in logs.iter().zip(TeamEventKind::ALL) {
        assert_eq!((log.name.as_str(), log.level), (kind.name(), i32::from(level(kind))));
        assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
    }
    assert_eq!((logs[0].message.as_str(), logs[1].message.as_str()), ("that is it", "member_2: that is it"));
    assert_eq!((level(TeamEventKind::Wait), level(TeamEventKind::End), level(TeamEventKind::Lost)), (1, 2, 3));
    scene.encode(McapFlavour::Ros2).unwrap();
}

#[test]
fn val_impossible_recordings_are_refused() {
    type Spoil = fn(&mut TeamRecording);
    let spoils: [(Spoil, &str); 20] = [
        (|r| r.members.clear(), "the team has no members"),
        (|r| r.members[0].states.clear(), "member_1 has no states"),
        (
            |r| r.members[1].states.truncate(20),
            "member_2 must have the same number of states as the first member, 21, got 20",
        ),
        (
            |r| r.members[2].states[4].time_s = 0.21,
            "member_3 has a state at 0.21 s, but the first member has one at 0.2 s",
        ),
        (|r| r.moving[0].states.truncate(20), "moving_1 must have the same number of states"),
        (|r| r.members[1].name = "member_1".to_owned(), "\"member_1\" is already used"),
        (|r| r.members[1].name = "moving_1".to_owned(), "\"moving_1\" is already used"),
        (|r| r.members[1].name = "map".to_owned(), "\"map\" is already used"),
        (|r| r.members[1].name = "a/b".to_owned(), "\"a/b\" must start with a letter"),
        (|r| r.members[1].name = String::new(), "\"\" must start with a letter"),
        (|r| r.members[1].number = 1, "the number of member_2 must be at least 1 and unique, got 1"),
        (|r| r.members[1].number = 0, "the number of member_2 must be at least 1 and unique, got 0"),
        (|r| r.members[1].radius_m = 0.0, "the radius of member_2 must be positive and finite, got 0 m"),
        (|r| r.moving[0].radius_m = f64::NAN, "the radius of moving_1 must be positive and finite, got NaN m"),
        (|r| r.members[1].states[2].position_m[2] = f64::NAN, "member_2 at 0.1 s contains NaN"),
        (|r| r.members[1].states[2].depth_error_m = Some(f64::INFINITY), "member_2 at 0.1 s contains inf"),
        (|r| r.routes[0].points_m[1][0] = f64::NAN, "the route at 0 s contains NaN"),
        (|r| r.boxes[1].corners_m[3][2] = f64::NAN, "the box at 0.5 s contains NaN"),
        (|r| r.obstacles[0].truncate(2), "obstacle 1 must have at least 3 corners, got 2"),
        (|r| r.events[1].member = Some(9), "squeezed at 1 s names an unknown member 9"),
    ];
    for (spoil, words) in spoils {
        let mut scene = Scene::new(1);
        spoil(&mut scene.recording);
        let refusal = scene.refusal();
        assert!(refusal.contains(words), "{refusal}");
    }
}

/// A team of one that stands still, without route, roadmap, obstacles or boxes.
#[test]
fn val_a_minimal_recording_is_written() {
    let mut scene = Scene::new(0);
    let recording = &mut scene.recording;
    recording.members.truncate(1);
    recording.routes.clear();
    recording.search_path_m.clear();
    recording.vertices_m.clear();
    recording.boxes.clear();
    recording.obstacles.clear();
    recording.moving.clear();
    recording.events.clear();
    for flavour in [McapFlavour::Viewer, McapFlavour::Ros2] {
        let (bytes, summary) = scene.encode(flavour).unwrap();
        assert!(summary.messages > 0);
        assert_eq!(read(&bytes).len() as u64, summary.messages);
    }
}

/// A team that replans on the way: each route appears at its time, and waypoints are not marked.
#[test]
fn val_routes_planned_on_the_way_come_one_after_the_other() {
    let mut scene = Scene::new(2);
    let first = scene.recording.routes[0].clone();
    let [a, b, c] = [0, 1, 2].map(|k| first.points_m[k]);
    scene.recording.routes = [(0.0, vec![a, b]), (0.7, vec![b, c]), (1.3, vec![c, a])]
        .map(|(time_s, points_m)| PlannedRoute { time_s, points_m })
        .into();
    let (bytes, _) = scene.encode(McapFlavour::Viewer).unwrap();
    let messages = read(&bytes);
    let routes: Vec<(u64, [f64; 3])> = on(&messages, "/team/route")
        .map(|message| {
            let route = fox::PosesInFrame::decode(message.data.as_ref()).unwrap();
            let at = route.poses[0].position.unwrap();
            (message.log_time - EPOCH_NS, [at.x, at.y, at.z])
        })
        .collect();
    assert_eq!(routes, [(0, a), (700_000_000, b), (1_300_000_000, c)]);
    let graph = fox::SceneUpdate::decode(on(&messages, "/team/graph").next().unwrap().data.as_ref()).unwrap();
    assert!(graph.entities.iter().find(|entity| entity.id == "waypoints").unwrap().spheres.is_empty());
    let (bytes, _) = scene.encode(McapFlavour::Ros2).unwrap();
    assert_eq!(on(&read(&bytes), "/team/route").count(), 3);
}

/// With holes in the terrain, and a team, obstacles and lines beyond it, all numbers stay finite.
#[test]
fn val_no_ground_under_a_line() {
    let mut scene = Scene::new(1);
    scene.dem.values[50 * 120..70 * 120].fill(f64::NAN);
    scene.recording.routes[0].points_m.push([CORNER[0] + 400.0, CORNER[1] - 10.0, 3.0]);
    scene.recording.obstacles.push(vec![[0.0; 2], [1.0, 0.0], [0.0, 1.0]]);
    let (bytes, _) = scene.encode(McapFlavour::Viewer).unwrap();
    let messages = read(&bytes);
    let route = fox::PosesInFrame::decode(on(&messages, "/team/route").next().unwrap().data.as_ref()).unwrap();
    assert!(route.poses.iter().filter_map(|pose| pose.position).all(|p| (p.x + p.y + p.z).is_finite()));
    scene.encode(McapFlavour::Ros2).unwrap();
}

/// Of a roadmap of 100000 vertices, 16384 are drawn, as stated in the file; drawn points are relative to a nearby origin.
#[test]
fn val_large_roadmaps_are_thinned() {
    let mut scene = Scene::new(1);
    let vertex = |k: i32| [CORNER[0] + 0.2 * f64::from(k % 300), CORNER[1] + 0.15 * f64::from(k / 300), 0.0];
    scene.recording.vertices_m = (0..100_000).map(vertex).collect();
    let (bytes, _) = scene.encode(McapFlavour::Viewer).unwrap();
    let messages = read(&bytes);
    let graph = fox::SceneUpdate::decode(on(&messages, "/team/graph").next().unwrap().data.as_ref()).unwrap();
    let vertices = graph.entities.iter().find(|entity| entity.id == "vertices").unwrap();
    let stated: Vec<(&str, &str)> = vertices.metadata.iter().map(|m| (m.key.as_str(), m.value.as_str())).collect();
    assert_eq!(stated, [("vertices", "100000"), ("drawn", "16384")]);
    assert_eq!(vertices.lines[0].points.len(), 2 * 16384);
    assert!(vertices.lines[0].points.iter().all(|p| p.x.abs() < 100.0 && p.y.abs() < 100.0 && p.z.abs() < 100.0));
    let origin = vertices.lines[0].pose.unwrap().position.unwrap();
    assert_eq!([origin.x, origin.y], CORNER);
}

/// Thinning keeps the first element and evenly spaced others, or all if there is room.
#[test]
fn val_thinning_is_even() {
    let all: Vec<usize> = (0..1000).collect();
    assert_eq!(thinned(&all, 1000), all);
    assert_eq!(thinned(&all, 5000), all);
    assert_eq!(thinned(&all, 4), [0, 250, 500, 750]);
    let kept = thinned(&all, 300);
    assert!(kept.len() == 300 && kept.windows(2).all(|pair| matches!(pair[1] - pair[0], 3 | 4)));
    assert!(thinned::<u8>(&[], 10).is_empty());
}

/// A line on the ground keeps its points, follows the ground between them at one point per cell, and respects the stated maximum.
#[test]
fn val_lines_lie_on_the_ground() {
    let dem = ground();
    let line = [[5.0, 5.0], [40.0, 21.0], [40.0, 50.0]].map(|[x, y]| [CORNER[0] + x, CORNER[1] + y, 7.0]);
    let points = laid(&dem, &line);
    assert!(line.iter().all(|own| points.contains(own)));
    for [x, y, z] in points.iter().filter(|point| !line.contains(point)) {
        assert_eq!(*z, dem.height(*x, *y).unwrap());
    }
    let apart = |pair: &[[f64; 3]]| libm::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
    assert!(points.windows(2).all(|pair| apart(pair) <= 0.5 + 1e-9));
    let long = [[0.0; 3], [1e6, 0.0, 0.0], [1e6, 1e6, 0.0]];
    assert!((8000..=8192 + 3).contains(&laid(&dem, &long).len()));
    assert_eq!((laid(&dem, &long[..1]).len(), laid(&dem, &[]).len()), (1, 0));
}

#[test]
fn val_poses_face_the_next_point() {
    let found = looking_ahead(&[[0.0; 3], [0.0, 2.0, 1.0], [-2.0, 2.0, 1.0]]);
    let ahead = |turned| super::super::frames::rotated(turned, [1.0, 0.0, 0.0]).map(|v| (v * 1e9).round() / 1e9);
    let turns: Vec<[f64; 3]> = found.iter().map(|&(_, turned)| ahead(turned)).collect();
    assert_eq!(turns, [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
    assert_eq!(looking_ahead(&[[1.0; 3]]), [([1.0; 3], [0.0, 0.0, 0.0, 1.0])]);
}

#[test]
fn val_boxes_are_written_when_they_change() {
    let boxes = drive(&ground(), 1).boxes;
    assert_eq!(changes(&boxes).map(|one| one.time_s).collect::<Vec<_>>(), [0.0, 1.0]);
    assert_eq!(changes(&[]).count(), 0);
}

/// Topics and fields named in the team panels of the layout are recorded.
#[test]
fn val_the_layout_matches_a_team() {
    let layout: serde_json::Value = serde_json::from_str(VIEWER_LAYOUT).unwrap();
    let panels = &layout["configById"];
    assert_eq!(panels["3D!team"]["followTf"], "member_1");
    let topic = |name: &str| TEAM_VIEWER.into_iter().find(|t| t.name == name).unwrap_or_else(|| panic!("{name}"));
    let shown = panels["3D!team"]["topics"].as_object().unwrap();
    assert!(!shown.is_empty());
    shown.keys().for_each(|name| assert_eq!(topic(name).name, name));
    for plot in ["Plot!depth", "Plot!width", "Plot!team-speed"] {
        let paths = panels[plot]["paths"].as_array().unwrap();
        assert!(!paths.is_empty(), "{plot}");
        for path in paths {
            let (name, field) = path["value"].as_str().unwrap().split_once('.').unwrap();
            let field = field.split('[').next();
            assert!(topic(name).fields.iter().any(|f| Some(f.name) == field), "{path}");
        }
    }
}

/// Decoded messages of a small run in both flavours.
#[test]
fn gold_messages_of_a_team() {
    let scene = Scene::new(3);
    let hash = |flavour| scene.encode(flavour).unwrap().1.content_sha256;
    assert_eq!([hash(McapFlavour::Viewer), hash(McapFlavour::Ros2)], GOLD_TEAM);
}
const GOLD_TEAM: [&str; 2] = [
    "ad2bf7db7ebf84137debe6cbe4f211835e585feb9edde3d25f700e593564d099",
    "01fa094addc5e118be4aa2290070f1c75a286160b45b8ab9eb741c8ba1faa702",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// A recording with any numbers is written, and then every message is read back, or refused.
    #[test]
    fn prop_any_numbers_are_written_or_refused(
        at in prop::array::uniform3(mostly_plain()),
        heading in mostly_plain(),
        times in prop::collection::vec(mostly_plain(), 1..4),
        radius in mostly_plain().prop_map(f64::abs),
        rate in mostly_plain(),
    ) {
        let mut scene = Scene::new(1);
        let recording = &mut scene.recording;
        recording.sample_rate_hz = rate;
        recording.moving.clear();
        for member in &mut recording.members {
            member.radius_m = radius;
            let state = MemberState { position_m: at, heading_rad: heading, ..member.states[0] };
            member.states = times.iter().map(|&time_s| MemberState { time_s, ..state }).collect();
        }
        recording.routes[0].points_m = vec![at, [0.0; 3], at];
        recording.vertices_m = vec![at];
        recording.boxes.iter_mut().for_each(|one| one.corners_m[0] = at);
        for flavour in [McapFlavour::Viewer, McapFlavour::Ros2] {
            if let Ok((bytes, summary)) = scene.encode(flavour) {
                prop_assert_eq!(read(&bytes).len() as u64, summary.messages);
            }
        }
    }
}

/// Numbers of everyday size, a few of any size, infinite or NaN.
fn mostly_plain() -> impl Strategy<Value = f64> {
    prop_oneof![20 => 0.1..1e4f64, 1 => prop::num::f64::ANY]
}
