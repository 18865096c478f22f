//! Viewer flavour of rovers: the topics of `sastrugi_schemas::topics::ROVER_VIEWER`, in protobuf.

use super::super::frames::{BASE, GOAL, IDENTITY, MAP, START};
use super::super::protobuf::{self, Value};
use super::super::viewer::{
    colour, entity, in_steps, pose, quaternion, terrain_from_above, terrain_mesh, timestamp, vector,
};
use super::super::{McapError, Timeline};
use super::{
    BODY, CLEAR, END_M, HAZARD, MISSED, RoverMcap, WHEELS, area_triangles, body, corridor, level, on_ground,
    path_states, ray_lines, wheels,
};
use foxglove::messages as fox;
use foxglove::messages::{Point3, Timestamp};
use prost::Message;
use sastrugi_schemas::topics::{
    RoverCycle, RoverEvent, RoverPlan, RoverRecording, StateSample, rover_events, rover_path, rover_plan, rover_shape,
    rover_state, rover_tf, rover_view, terrain_grid, terrain_mesh as mesh_topic, vehicle_pose,
};

/// Width of rays, pixels.
const LINE_PX: f64 = 1.5;
/// Quantisation of lengths and angles other than poses, steps per unit.
const FINE: f64 = 1024.0;
/// Opacity of areas.
const AREA: f64 = 0.35;

/// Adds all messages of a drive to the timeline.
pub(super) fn messages(rover: &RoverMcap, out: &mut Timeline) -> Result<(), McapError> {
    let recording = rover.recording;
    out.add(&mesh_topic::TOPIC, 0.0, |t| {
        Ok(terrain_mesh(rover.terrain, &corridor(rover), timestamp(t)?).encode_to_vec())
    })?;
    out.add(&terrain_grid::TOPIC, 0.0, |t| Ok(terrain_from_above(rover.terrain, timestamp(t)?).encode_to_vec()))?;
    out.add(&rover_shape::TOPIC, 0.0, |t| Ok(shape(rover, timestamp(t)?).encode_to_vec()))?;
    out.add(&rover_path::TOPIC, 0.0, |t| Ok(path(recording, timestamp(t)?).encode_to_vec()))?;
    for plan in &recording.plans {
        out.add(&rover_plan::TOPIC, plan.time_s, |t| Ok(planned(plan, timestamp(t)?).encode_to_vec()))?;
    }
    for state in &recording.states {
        out.add(&rover_tf::TOPIC, state.time_s, |t| Ok(transforms(state, timestamp(t)?).encode_to_vec()))?;
        out.add(&vehicle_pose::TOPIC, state.time_s, |t| Ok(pose_in_map(state, timestamp(t)?).encode_to_vec()))?;
    }
    for cycle in &recording.cycles {
        out.add(&rover_view::TOPIC, cycle.time_s, |t| Ok(view(rover, cycle, timestamp(t)?).encode_to_vec()))?;
        out.add(&rover_state::TOPIC, cycle.time_s, |t| Ok(protobuf::encode(&timestamp(t)?, &state_values(cycle))))?;
    }
    for event in &recording.events {
        out.add(&rover_events::TOPIC, event.time_s, |t| Ok(log(event, timestamp(t)?).encode_to_vec()))?;
    }
    Ok(())
}

fn shape(rover: &RoverMcap, time: Timestamp) -> fox::SceneUpdate {
    let [size_m, centre_m] = body(rover.recording);
    let (hubs_m, radius_m, width_m) = wheels(rover.recording);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let wheel = |hub_m: [f64; 3]| fox::CylinderPrimitive {
        // A cylinder's axis is z; rotated by a right angle about x it lies along the axle.
        pose: Some(pose(hub_m, [half, 0.0, 0.0, half])),
        size: Some(vector([2.0 * radius_m, 2.0 * radius_m, width_m])),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(colour(WHEELS, 1.0)),
    };
    let body = fox::SceneEntity {
        cubes: vec![fox::CubePrimitive {
            pose: Some(pose(centre_m, IDENTITY)),
            size: Some(vector(size_m)),
            color: Some(colour(BODY, 0.9)),
        }],
        cylinders: hubs_m.map(wheel).into(),
        ..entity(time, BASE, "rover", true)
    };
    let marker = |id: &str, point: [f64; 2], rgb| fox::SceneEntity {
        spheres: vec![fox::SpherePrimitive {
            pose: Some(pose(on_ground(rover, point), IDENTITY)),
            size: Some(vector([END_M; 3])),
            color: Some(colour(rgb, 0.8)),
        }],
        ..entity(time, MAP, id, false)
    };
    let ends = [marker("start", rover.start_m, START), marker("goal", rover.goal_m, GOAL)];
    fox::SceneUpdate { deletions: vec![], entities: std::iter::once(body).chain(ends).collect() }
}

fn path(recording: &RoverRecording, time: Timestamp) -> fox::PosesInFrame {
    let poses = path_states(recording).into_iter().map(|s| pose(s.position_m, s.orientation)).collect();
    fox::PosesInFrame { timestamp: Some(time), frame_id: MAP.to_owned(), poses }
}

fn planned(plan: &RoverPlan, time: Timestamp) -> fox::PosesInFrame {
    let poses = plan.points_m.iter().map(|point| pose(*point, IDENTITY)).collect();
    fox::PosesInFrame { timestamp: Some(time), frame_id: MAP.to_owned(), poses }
}

fn transforms(state: &StateSample, time: Timestamp) -> fox::FrameTransforms {
    let transform = fox::FrameTransform {
        timestamp: Some(time),
        parent_frame_id: MAP.to_owned(),
        child_frame_id: BASE.to_owned(),
        translation: Some(vector(state.position_m)),
        rotation: Some(quaternion(state.orientation)),
    };
    fox::FrameTransforms { transforms: vec![transform] }
}

fn pose_in_map(state: &StateSample, time: Timestamp) -> fox::PoseInFrame {
    let at = pose(state.position_m, state.orientation);
    fox::PoseInFrame { timestamp: Some(time), frame_id: MAP.to_owned(), pose: Some(at) }
}

/// Areas and rays; the entity replaces that of the previous cycle.
fn view(rover: &RoverMcap, cycle: &RoverCycle, time: Timestamp) -> fox::SceneUpdate {
    let from_origin = || Some(pose(rover.terrain.origin_m(), IDENTITY));
    let triangles = [(true, HAZARD), (false, CLEAR)].map(|(hazard, rgb)| fox::TriangleListPrimitive {
        pose: from_origin(),
        points: points(area_triangles(rover, cycle, hazard)),
        color: Some(colour(rgb, AREA)),
        ..fox::TriangleListPrimitive::default()
    });
    let lines = [HAZARD, CLEAR, MISSED].map(|rgb| fox::LinePrimitive {
        r#type: fox::line_primitive::Type::LineList as i32,
        pose: from_origin(),
        thickness: LINE_PX,
        scale_invariant: true,
        points: points(ray_lines(rover, cycle, rgb)),
        color: Some(colour(rgb, 1.0)),
        ..fox::LinePrimitive::default()
    });
    let entity = fox::SceneEntity {
        triangles: triangles.into_iter().filter(|list| !list.points.is_empty()).collect(),
        lines: lines.into_iter().filter(|list| !list.points.is_empty()).collect(),
        ..entity(time, MAP, "view", false)
    };
    fox::SceneUpdate { deletions: vec![], entities: vec![entity] }
}

fn points(points_m: Vec<[f64; 3]>) -> Vec<Point3> {
    points_m.into_iter().map(|[x, y, z]| Point3 { x, y, z }).collect()
}

/// Values in the order of the topic's fields.
pub(super) fn state_values(c: &RoverCycle) -> Vec<Value> {
    let fine = |value: f64| Value::Float(in_steps(value, FINE));
    let hazards = c.areas.iter().map(|area| if area.hazard { '1' } else { '0' }).collect();
    let [roll, pitch] = c.roll_pitch_rad.map(f64::to_degrees);
    let [turn_rad, drive_m] = c.moved;
    let poses = [
        f64::from(c.number),
        c.position_m[0],
        c.position_m[1],
        c.position_m[2],
        c.heading_rad,
        c.believed_m[0],
        c.believed_m[1],
        c.believed_heading_rad,
    ];
    let words = [Value::Text(c.state.clone()), Value::Text(hazards)];
    let rest = [turn_rad, drive_m, roll, pitch, c.distance_m, c.goal_distance_m, f64::from(c.contacts)];
    poses.into_iter().map(Value::Double).chain(words).chain(rest.map(fine)).collect()
}

fn log(event: &RoverEvent, time: Timestamp) -> fox::Log {
    fox::Log {
        timestamp: Some(time),
        level: i32::from(level(event.kind)),
        message: event.text.clone(),
        name: event.kind.name().to_owned(),
        ..fox::Log::default()
    }
}
