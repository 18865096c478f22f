//! Viewer flavour of teams: the topics of `sastrugi_schemas::topics::TEAM_VIEWER`, in protobuf.

use super::super::frames::{GOAL, IDENTITY, MAP, START};
use super::super::protobuf::{self, Value};
use super::super::viewer::{colour, entity, pose, quaternion, terrain_from_above, terrain_mesh, timestamp, vector};
use super::super::{McapError, Timeline};
use super::drawing::{
    Body, Drawing, ROUTE, SEARCH, VERTEX, WALL, bodies, box_rgb, changes, looking_ahead, path_states, poses, samples,
};
use super::{TeamMcap, level, text};
use foxglove::messages as fox;
use foxglove::messages::{Point3, Timestamp};
use prost::Message;
use sastrugi_schemas::topics::{
    FormationBox, MemberState, TeamEvent, TeamRecording, team_box, team_events, team_graph, team_paths, team_route,
    team_shape, team_state, team_tf, terrain_grid, terrain_mesh as mesh_topic,
};

/// Width of lines, pixels.
const LINE_PX: f64 = 2.0;
/// Width and length of the dash that represents a vertex: pixels, m.
const VERTEX_PX: f64 = 3.0;
const VERTEX_M: f64 = 0.0625;
/// Text height of member numbers, pixels.
const TEXT_PX: f64 = 14.0;

/// Adds all messages of a run to the timeline.
pub(super) fn messages(team: &TeamMcap, out: &mut Timeline) -> Result<(), McapError> {
    let (recording, drawing) = (team.recording, Drawing::new(team));
    let near = drawing.corridor(recording);
    out.add(&mesh_topic::TOPIC, 0.0, |t| Ok(terrain_mesh(team.terrain, &near, timestamp(t)?).encode_to_vec()))?;
    out.add(&terrain_grid::TOPIC, 0.0, |t| Ok(terrain_from_above(team.terrain, timestamp(t)?).encode_to_vec()))?;
    out.add(&team_shape::TOPIC, 0.0, |t| Ok(shape(team, &drawing, timestamp(t)?).encode_to_vec()))?;
    for (time_s, points_m) in &drawing.routes {
        out.add(&team_route::TOPIC, *time_s, |t| Ok(route(points_m, timestamp(t)?).encode_to_vec()))?;
    }
    out.add(&team_paths::TOPIC, 0.0, |t| Ok(paths(recording, &drawing, timestamp(t)?).encode_to_vec()))?;
    out.add(&team_graph::TOPIC, 0.0, |t| Ok(graph(recording, &drawing, timestamp(t)?).encode_to_vec()))?;
    let names: Vec<String> = recording.members.iter().map(|member| member.name.clone()).collect();
    let bodies = bodies(recording);
    for (sample, time_s) in samples(recording) {
        out.add(
            &team_tf::TOPIC,
            time_s,
            |t| Ok(transforms(recording, &bodies, sample, timestamp(t)?).encode_to_vec()),
        )?;
        out.add(&team_state::TOPIC, time_s, |t| {
            Ok(protobuf::encode(&timestamp(t)?, &state_values(recording, &names, sample)))
        })?;
    }
    for one in changes(&recording.boxes) {
        out.add(&team_box::TOPIC, one.time_s, |t| Ok(formation_box(&drawing, one, timestamp(t)?).encode_to_vec()))?;
    }
    for event in &recording.events {
        out.add(&team_events::TOPIC, event.time_s, |t| Ok(log(recording, event, timestamp(t)?).encode_to_vec()))?;
    }
    Ok(())
}

fn shape(team: &TeamMcap, drawing: &Drawing, time: Timestamp) -> fox::SceneUpdate {
    let bodies = bodies(team.recording);
    let diameter_m = 2.0 * bodies.first().map_or(0.0, |body| body.radius_m);
    let marker = |id: &str, point: [f64; 2], rgb| fox::SceneEntity {
        spheres: vec![sphere(drawing, drawing.on_ground(point), diameter_m, rgb)],
        ..entity(time, MAP, id, false)
    };
    let ends = [marker("start", team.start_m, START), marker("goal", team.goal_m, GOAL)];
    let walls = team.recording.obstacles.iter().map(|ring| fox::TriangleListPrimitive {
        pose: Some(pose(drawing.origin, IDENTITY)),
        points: points(drawing.wall(ring)),
        color: Some(colour(WALL, 0.8)),
        ..fox::TriangleListPrimitive::default()
    });
    let walls = fox::SceneEntity { triangles: walls.collect(), ..entity(time, MAP, "obstacles", false) };
    let walls = (!walls.triangles.is_empty()).then_some(walls);
    let bodies = bodies.iter().map(|body| cylinder(body, time));
    fox::SceneUpdate { deletions: vec![], entities: bodies.chain(ends).chain(walls).collect() }
}

/// A body in its own frame; members carry their number and an arrow that points forward.
fn cylinder(body: &Body, time: Timestamp) -> fox::SceneEntity {
    let radius_m = body.radius_m;
    let standing = fox::CylinderPrimitive {
        pose: Some(pose([0.0, 0.0, radius_m], IDENTITY)),
        size: Some(vector([2.0 * radius_m; 3])),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(colour(body.rgb, 0.9)),
    };
    let ahead = body.number.map(|_| fox::ArrowPrimitive {
        pose: Some(pose([0.0, 0.0, 2.0 * radius_m], IDENTITY)),
        shaft_length: radius_m,
        shaft_diameter: 0.25 * radius_m,
        head_length: 0.75 * radius_m,
        head_diameter: 0.75 * radius_m,
        color: Some(colour(body.rgb, 1.0)),
    });
    let number = body.number.map(|number| fox::TextPrimitive {
        pose: Some(pose([0.0, 0.0, 3.0 * radius_m], IDENTITY)),
        billboard: true,
        font_size: TEXT_PX,
        scale_invariant: true,
        color: Some(colour([0xff; 3], 1.0)),
        text: number.to_string(),
    });
    fox::SceneEntity {
        cylinders: vec![standing],
        arrows: ahead.into_iter().collect(),
        texts: number.into_iter().collect(),
        ..entity(time, &body.name, &body.name, true)
    }
}

fn sphere(drawing: &Drawing, [x, y, z]: [f64; 3], diameter_m: f64, rgb: [u8; 3]) -> fox::SpherePrimitive {
    let [x0, y0, z0] = drawing.origin;
    fox::SpherePrimitive {
        pose: Some(pose([x0 + x, y0 + y, z0 + z], IDENTITY)),
        size: Some(vector([diameter_m; 3])),
        color: Some(colour(rgb, 0.8)),
    }
}

fn route(points_m: &[[f64; 3]], time: Timestamp) -> fox::PosesInFrame {
    let poses = looking_ahead(points_m).into_iter().map(|(at, turned)| pose(at, turned));
    fox::PosesInFrame { timestamp: Some(time), frame_id: MAP.to_owned(), poses: poses.collect() }
}

fn line(drawing: &Drawing, points_m: Vec<[f64; 3]>, rgb: [u8; 3]) -> fox::LinePrimitive {
    fox::LinePrimitive {
        r#type: fox::line_primitive::Type::LineStrip as i32,
        pose: Some(pose(drawing.origin, IDENTITY)),
        thickness: LINE_PX,
        scale_invariant: true,
        points: points(points_m),
        color: Some(colour(rgb, 1.0)),
        ..fox::LinePrimitive::default()
    }
}

fn points(points_m: Vec<[f64; 3]>) -> Vec<Point3> {
    points_m.into_iter().map(|[x, y, z]| Point3 { x, y, z }).collect()
}

fn paths(recording: &TeamRecording, drawing: &Drawing, time: Timestamp) -> fox::SceneUpdate {
    let entities = recording.members.iter().zip(bodies(recording)).map(|(member, body)| {
        let states = path_states(&member.states, recording.sample_rate_hz);
        let driven: Vec<[f64; 3]> = states.into_iter().map(|state| state.position_m).collect();
        let lines = vec![line(drawing, drawing.lifted(&driven), body.rgb)];
        fox::SceneEntity { lines, ..entity(time, MAP, &format!("path of {}", member.name), false) }
    });
    fox::SceneUpdate { deletions: vec![], entities: entities.collect() }
}

fn graph(recording: &TeamRecording, drawing: &Drawing, time: Timestamp) -> fox::SceneUpdate {
    let diameter_m = recording.members.first().map_or(0.0, |member| member.radius_m);
    let waypoints = drawing.lifted(drawing.waypoints);
    let spheres = waypoints.into_iter().map(|at| sphere(drawing, at, diameter_m, ROUTE)).collect();
    let waypoints = fox::SceneEntity { spheres, ..entity(time, MAP, "waypoints", false) };
    let search = line(drawing, drawing.lifted(&drawing.search_path), SEARCH);
    let search = fox::SceneEntity { lines: vec![search], ..entity(time, MAP, "search path", false) };
    fox::SceneUpdate { deletions: vec![], entities: vec![waypoints, search, vertices(recording, drawing, time)] }
}

/// Vertices as dashes with a width in pixels: they look like points from a distance, and take half the data of triangles.
fn vertices(recording: &TeamRecording, drawing: &Drawing, time: Timestamp) -> fox::SceneEntity {
    let drawn = drawing.vertices(recording);
    let count = |key: &str, value: usize| fox::KeyValuePair { key: key.to_owned(), value: value.to_string() };
    let dashes = drawn.iter().flat_map(|&[x, y, z]| [[x - VERTEX_M, y, z], [x + VERTEX_M, y, z]]);
    let dashes = fox::LinePrimitive {
        r#type: fox::line_primitive::Type::LineList as i32,
        thickness: VERTEX_PX,
        ..line(drawing, dashes.collect(), VERTEX)
    };
    fox::SceneEntity {
        metadata: vec![count("vertices", recording.vertices_m.len()), count("drawn", drawn.len())],
        lines: vec![dashes],
        ..entity(time, MAP, "vertices", false)
    }
}

fn formation_box(drawing: &Drawing, one: &FormationBox, time: Timestamp) -> fox::SceneUpdate {
    let mut corners = drawing.box_line(one);
    // The loop closes itself.
    corners.pop();
    let closed = fox::LinePrimitive {
        r#type: fox::line_primitive::Type::LineLoop as i32,
        ..line(drawing, corners, box_rgb(one.squeezed))
    };
    let entity = fox::SceneEntity { lines: vec![closed], ..entity(time, MAP, "box", false) };
    fox::SceneUpdate { deletions: vec![], entities: vec![entity] }
}

fn transforms(recording: &TeamRecording, bodies: &[Body], sample: usize, time: Timestamp) -> fox::FrameTransforms {
    let transforms = bodies.iter().zip(poses(recording, sample)).map(|(body, (at, turned))| fox::FrameTransform {
        timestamp: Some(time),
        parent_frame_id: MAP.to_owned(),
        child_frame_id: body.name.clone(),
        translation: Some(vector(at)),
        rotation: Some(quaternion(turned)),
    });
    fox::FrameTransforms { transforms: transforms.collect() }
}

/// Values in the order of the topic's fields.
pub(super) fn state_values(recording: &TeamRecording, names: &[String], sample: usize) -> Vec<Value> {
    let all = |value: fn(&MemberState) -> f64| {
        Value::Doubles(recording.members.iter().filter_map(|m| m.states.get(sample)).map(value).collect())
    };
    vec![
        Value::Texts(names.to_vec()),
        all(|s| s.position_m[0]),
        all(|s| s.position_m[1]),
        all(|s| s.position_m[2]),
        all(|s| s.heading_rad),
        all(|s| libm::hypot(s.velocity_m_s[0], s.velocity_m_s[1])),
        all(|s| s.slot.unwrap_or(0) as f64),
        all(|s| s.depth_error_m.unwrap_or(0.0)),
        all(|s| s.width_error_m.unwrap_or(0.0)),
        all(|s| s.target_distance_m),
    ]
}

fn log(recording: &TeamRecording, event: &TeamEvent, time: Timestamp) -> fox::Log {
    fox::Log {
        timestamp: Some(time),
        level: i32::from(level(event.kind)),
        message: text(recording, event),
        name: event.kind.name().to_owned(),
        ..fox::Log::default()
    }
}
