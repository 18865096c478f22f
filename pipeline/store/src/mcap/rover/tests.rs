//! Recordings read back with the crate `mcap` and Foxglove's own messages.

use super::viewer::state_values;
use super::*;
use crate::mcap::{ROCK, SAND};
use ::mcap::MessageStream;
use foxglove::messages as fox;
use prost::Message;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::topics::{RoverEvent, RoverPlan, SeenArea, rover_state};

const EPOCH_NS: u64 = 1_700_000_000_000_000_000;

fn ground() -> (Grid, Grid<u8>) {
    let geometry = Geometry { rows: 60, cols: 80, cell: [0.1; 2], origin: [-2.0, -3.0] };
    let heights = Grid::new(geometry, (0..60 * 80).map(|k| 0.01 * f64::from(k % 80)).collect());
    let codes = (0..60 * 80).map(|k| if k % 7 == 0 { ROCK } else { SAND }).collect();
    (heights, Grid { geometry, values: codes })
}

/// Two cycles, the second with a hazard and a ray without a hit.
fn recording() -> RoverRecording {
    let area = |left: f64, hazard: bool| SeenArea {
        corners_m: [[0.5, left, 0.0], [0.5, left + 0.2, 0.0], [1.0, left + 0.2, 0.1], [1.0, left, 0.1]],
        hazard,
    };
    let ray = |hit: bool, hazard: bool| SeenRay { from_m: [0.3, 0.0, 0.25], to_m: [0.6, 0.1, 0.0], hit, hazard };
    let cycle = |number: u32, hazard: bool| RoverCycle {
        time_s: 6.5 * f64::from(number),
        number,
        position_m: [0.065 * f64::from(number), 0.0, 0.0],
        heading_rad: 0.0,
        believed_m: [0.0; 2],
        believed_heading_rad: 0.5,
        roll_pitch_rad: [0.0, -0.1],
        state: if hazard { "avoid" } else { "drive" }.to_owned(),
        moved: if hazard { [0.25, 0.0] } else { [0.0, 0.065] },
        durations_s: if hazard { [2.0, 0.0] } else { [0.0, 6.5] },
        distance_m: 0.065 * f64::from(number),
        goal_distance_m: 3.0,
        contacts: number,
        areas: vec![area(0.1, hazard), area(-0.1, false)],
        rays: vec![ray(true, hazard), ray(!hazard, hazard)],
    };
    let state = |k: u32| StateSample {
        time_s: f64::from(k),
        position_m: [0.01 * f64::from(k), 0.0, 0.0],
        orientation: [0.0, 0.0, 0.0, 1.0],
        velocity_m_s: [0.01, 0.0, 0.0],
        angular_velocity_rad_s: [0.0; 3],
    };
    let event = |time_s: f64, kind| RoverEvent { time_s, kind, text: "as planned".to_owned() };
    RoverRecording {
        axle_m: 0.25,
        track_m: 0.2,
        states: (0..9).map(state).collect(),
        cycles: vec![cycle(0, false), cycle(1, true)],
        plans: vec![RoverPlan { time_s: 0.0, points_m: vec![[0.0; 3], [3.0, 0.0, 0.0]] }],
        events: vec![
            event(0.0, RoverEventKind::Start),
            event(6.5, RoverEventKind::Hazard),
            event(8.5, RoverEventKind::NoWay),
        ],
    }
}

fn encoded(flavour: McapFlavour, recording: &RoverRecording) -> Result<(Vec<u8>, McapSummary), McapError> {
    let (heights, codes) = ground();
    let terrain = TerrainView::new(&heights, Some(&codes))?;
    let metadata = BTreeMap::from([("rover".to_owned(), BTreeMap::from([("id".to_owned(), "a-0001".to_owned())]))]);
    let (start_m, goal_m) = ([0.0; 2], [3.0, 0.0]);
    encode_rover(&RoverMcap {
        flavour,
        recording,
        terrain: &terrain,
        start_m,
        goal_m,
        epoch_ns: EPOCH_NS,
        metadata: &metadata,
    })
}

/// Topic, time since the epoch in ns and data of every message, in the order of the file.
fn read(bytes: &[u8]) -> Vec<(String, u64, Vec<u8>)> {
    let messages = MessageStream::new(bytes).unwrap().map(Result::unwrap);
    messages.map(|m| (m.channel.topic.clone(), m.log_time - EPOCH_NS, m.data.into_owned())).collect()
}

fn of<'a>(messages: &'a [(String, u64, Vec<u8>)], topic: &str) -> Vec<(u64, &'a [u8])> {
    messages.iter().filter(|m| m.0 == topic).map(|m| (m.1, m.2.as_slice())).collect()
}

#[test]
fn val_every_topic_of_the_viewer_flavour_is_read_back() {
    let recording = recording();
    let (bytes, summary) = encoded(McapFlavour::Viewer, &recording).unwrap();
    let messages = read(&bytes);
    assert_eq!(messages.len() as u64, summary.messages);
    assert!(messages.is_sorted_by_key(|m| m.1));
    for topic in ROVER_VIEWER {
        assert!(!of(&messages, topic.name).is_empty(), "{}", topic.name);
    }
    let poses = of(&messages, "/vehicle/pose");
    assert_eq!(poses.len(), 9);
    for (state, (time_ns, data)) in recording.states.iter().zip(poses) {
        let at = fox::PoseInFrame::decode(data).unwrap().pose.unwrap().position.unwrap();
        assert_eq!(([at.x, at.y, at.z], time_ns), (state.position_m, (state.time_s * 1e9) as u64));
    }
    let views: Vec<fox::SceneEntity> = of(&messages, "/sensor/view")
        .into_iter()
        .map(|(_, data)| fox::SceneUpdate::decode(data).unwrap().entities.remove(0))
        .collect();
    // First a clear view: two areas in one list, two rays in one; then one area and one ray of each kind.
    assert_eq!(views.iter().map(|v| (v.triangles.len(), v.lines.len())).collect::<Vec<_>>(), [(1, 1), (2, 2)]);
    assert!(views[1].triangles.iter().all(|list| list.points.len() == 6));
    assert_eq!(views[0].triangles[0].points.len(), 12);
    let corner = &views[1].triangles[0].points[0];
    let origin = views[1].triangles[0].pose.as_ref().unwrap().position.unwrap();
    assert!((corner.x + origin.x - 0.5).abs() < 1e-3 && (corner.z + origin.z - LIFT_M).abs() < 1e-3);
    let names: Vec<String> =
        of(&messages, "/events").into_iter().map(|(_, data)| fox::Log::decode(data).unwrap().name).collect();
    assert_eq!(names, ["start", "hazard", "no_way"]);
    let ground = fox::SceneUpdate::decode(of(&messages, "/terrain/mesh")[0].1).unwrap();
    assert!(ground.entities[0].triangles.iter().any(|list| list.colors.iter().any(|c| c.r < 0.5)), "rocks are dark");
}

#[test]
fn val_state_values_are_those_of_the_topic() {
    let values = state_values(&recording().cycles[1]);
    let kinds: Vec<_> = values.iter().map(super::super::protobuf::Value::kind).collect();
    assert_eq!(kinds, rover_state::TOPIC.fields.iter().map(|field| field.kind).collect::<Vec<_>>());
}

#[test]
fn val_every_topic_of_the_ros_flavour_is_read_back() {
    use super::super::ros2::message::{Log, Odometry, TransformStamped, decode};
    let recording = recording();
    let (bytes, summary) = encoded(McapFlavour::Ros2, &recording).unwrap();
    let messages = read(&bytes);
    assert_eq!(messages.len() as u64, summary.messages);
    for topic in ROVER_ROS2 {
        assert!(!of(&messages, topic.name).is_empty(), "{}", topic.name);
    }
    for ((_, tf), (_, odom)) in of(&messages, "/tf").into_iter().zip(of(&messages, "/odom")) {
        let frames: Vec<TransformStamped> = decode(tf).unwrap();
        let odometry: Odometry = decode(odom).unwrap();
        assert_eq!(frames[0].transform.position, odometry.pose.position);
        assert_eq!((odometry.linear, odometry.child_frame_id.as_str()), ([0.01, 0.0, 0.0], "base_link"));
    }
    let states: Vec<String> = of(&messages, "/state").into_iter().map(|(_, data)| decode(data).unwrap()).collect();
    assert_eq!(states, ["drive", "avoid"]);
    let times: Vec<u64> = of(&messages, "/cmd_vel").into_iter().map(|(time_ns, _)| time_ns).collect();
    assert_eq!(times, [0, 6_500_000_000]);
    let last: Log = decode(of(&messages, "/events")[2].1).unwrap();
    assert_eq!((last.level, last.name.as_str()), (30, "no_way"));
}

#[test]
fn val_unfit_recordings_are_refused() {
    let message = |recording: &RoverRecording| encoded(McapFlavour::Viewer, recording).unwrap_err().to_string();
    assert!(message(&RoverRecording { states: vec![], ..recording() }).contains("it has no states"));
    let mut wrong = recording();
    wrong.cycles[1].rays[0].to_m[2] = f64::NAN;
    assert!(message(&wrong).contains("a cycle at 6.5 s contains NaN"), "{}", message(&wrong));
}

#[test]
fn prop_bytes_depend_on_the_recording_alone() {
    for flavour in [McapFlavour::Viewer, McapFlavour::Ros2] {
        let [a, b] = [0; 2].map(|_| encoded(flavour, &recording()).unwrap());
        assert_eq!(a, b);
    }
}

/// Topics and fields named in the rover panels of the layout are recorded.
#[test]
fn val_the_layout_matches_a_rover() {
    let layout: serde_json::Value = serde_json::from_str(crate::mcap::VIEWER_LAYOUT).unwrap();
    let panels = &layout["configById"];
    let topic = |name: &str| ROVER_VIEWER.into_iter().find(|t| t.name == name).unwrap_or_else(|| panic!("{name}"));
    let shown = panels["3D!rover"]["topics"].as_object().unwrap();
    shown.keys().for_each(|name| assert_eq!(topic(name).name, name));
    assert_eq!(shown.len(), 7);
    for plot in ["Plot!rover-goal", "Plot!rover-attitude", "Plot!rover-command"] {
        let paths = panels[plot]["paths"].as_array().unwrap();
        assert!(!paths.is_empty(), "{plot}");
        for path in paths {
            let (name, field) = path["value"].as_str().unwrap().split_once('.').unwrap();
            assert!(topic(name).fields.iter().any(|f| f.name == field), "{path}");
        }
    }
}

/// Decoded messages of a small drive in both flavours.
#[test]
fn gold_messages_of_a_rover() {
    let hash = |flavour| encoded(flavour, &recording()).unwrap().1.content_sha256;
    assert_eq!([hash(McapFlavour::Viewer), hash(McapFlavour::Ros2)], GOLD_ROVER);
}
const GOLD_ROVER: [&str; 2] = [
    "deec8bf509d0490bdfbece3cc67c34d8a483cd036713a0a273cac77ceba3b150",
    "26190aa3924a97f65969a929b3b6aea6e64605e653a0fbf21b5ab9d19064b84e",
];
