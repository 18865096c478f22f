//! ROS 2 flavour of teams: the topics of `sastrugi_schemas::topics::ros2::TEAM_ROS2`, in CDR.

use super::super::frames::{GOAL, MAP, START, rotated};
use super::super::ros2::message::{Log, Marker, MarkerKind, Odometry, Path, Pose, PoseStamped, encode};
use super::super::ros2::{EXACT, TERRAIN, header, stamp, terrain_messages, transform};
use super::super::{McapError, Timeline, log_time};
use super::drawing::{
    Body, Drawing, ROUTE, SEARCH, VERTEX, WALL, about_z, bodies, box_rgb, changes, looking_ahead, path_states, poses,
    samples, yaw_rate,
};
use super::{TeamMcap, level, text};
use sastrugi_schemas::topics::ros2::{
    MEMBER_ODOM, MEMBER_PATH, TEAM_BOX, TEAM_EVENTS, TEAM_MARKERS, TEAM_ROUTE, TEAM_TF,
};
use sastrugi_schemas::topics::{FormationBox, Member, MemberState, TeamEvent, TeamRecording};

/// Adds all messages of a run to the timeline.
pub(super) fn messages(team: &TeamMcap, out: &mut Timeline) -> Result<(), McapError> {
    let (recording, drawing) = (team.recording, Drawing::new(team));
    terrain_messages(team.terrain, &drawing.corridor(recording), out)?;
    for (time_s, points_m) in &drawing.routes {
        let poses = looking_ahead(points_m);
        out.add(&TEAM_ROUTE, *time_s, |t| encode(&path(poses.into_iter().map(|(at, turned)| (t, at, turned)), t)?))?;
    }
    out.add(&TEAM_MARKERS, 0.0, |t| encode(&markers(team, &drawing, t)?))?;
    let bodies = bodies(recording);
    for (sample, time_s) in samples(recording) {
        out.add(&TEAM_TF, time_s, |t| {
            let frames = bodies.iter().zip(poses(recording, sample));
            let frames = frames.map(|(body, (at, turned))| transform(MAP, &body.name, at, turned, t));
            encode(&frames.collect::<Result<Vec<_>, _>>()?)
        })?;
    }
    recording.members.iter().try_for_each(|member| member_messages(recording, member, out))?;
    for one in changes(&recording.boxes) {
        out.add(&TEAM_BOX, one.time_s, |t| encode(&vec![formation_box(&drawing, one, t)?]))?;
    }
    recording
        .events
        .iter()
        .try_for_each(|event| out.add(&TEAM_EVENTS, event.time_s, |t| encode(&log(recording, event, t)?)))
}

/// Odometry and driven path of a member.
fn member_messages(recording: &TeamRecording, member: &Member, out: &mut Timeline) -> Result<(), McapError> {
    let (odom, driven) = (MEMBER_ODOM.of_member(&member.name), MEMBER_PATH.of_member(&member.name));
    let befores = member.states.iter().take(1).chain(&member.states);
    for (state, before) in member.states.iter().zip(befores) {
        out.add_to(&odom, state.time_s, |t| encode(&odometry(&member.name, before, state, t)?))?;
    }
    let states = path_states(&member.states, recording.sample_rate_hz);
    let epoch_ns = out.epoch_ns;
    let stamped = states
        .into_iter()
        .map(|state| (log_time(epoch_ns, state.time_s), state.position_m, about_z(state.heading_rad)));
    out.add_to(&driven, 0.0, |t| encode(&path(stamped, t)?))
}

fn odometry(name: &str, before: &MemberState, state: &MemberState, log_time: u64) -> Result<Odometry, McapError> {
    Ok(Odometry {
        header: header(MAP, log_time)?,
        child_frame_id: name.to_owned(),
        pose: Pose { position: state.position_m, orientation: about_z(state.heading_rad) },
        pose_covariance: EXACT,
        linear: rotated(about_z(-state.heading_rad), state.velocity_m_s),
        angular: [0.0, 0.0, yaw_rate(before, state)],
        twist_covariance: EXACT,
    })
}

/// A path of poses, each with its time.
fn path(poses: impl Iterator<Item = (u64, [f64; 3], [f64; 4])>, log_time: u64) -> Result<Path, McapError> {
    let stamped = poses.map(|(time, position, orientation)| {
        Ok(PoseStamped { header: header(MAP, time)?, pose: Pose { position, orientation } })
    });
    Ok(Path { header: header(MAP, log_time)?, poses: stamped.collect::<Result<_, McapError>>()? })
}

/// Markers that are drawn once.
fn markers(team: &TeamMcap, drawing: &Drawing, log_time: u64) -> Result<Vec<Marker>, McapError> {
    let recording = team.recording;
    let bodies = bodies(recording);
    let radius_m = bodies.first().map_or(0.0, |body| body.radius_m);
    let marker = |kind, of: &str, scale, rgb, points| terrain_marker(kind, of, scale, rgb, points, log_time);
    let mut all = bodies.iter().map(|body| cylinder(body, log_time)).collect::<Result<Vec<_>, _>>()?;
    for (of, point, rgb) in [("start", team.start_m, START), ("goal", team.goal_m, GOAL)] {
        all.push(marker(MarkerKind::Spheres, of, [2.0 * radius_m; 3], rgb, vec![drawing.on_ground(point)])?);
    }
    let walls: Vec<[f64; 3]> = recording.obstacles.iter().flat_map(|ring| drawing.wall(ring)).collect();
    let waypoints = drawing.lifted(drawing.waypoints);
    let search = drawing.lifted(&drawing.search_path);
    let (size, width) = ([radius_m; 3], [0.25 * radius_m, 0.25 * radius_m, 0.0]);
    for (kind, of, scale, rgb, points) in [
        (MarkerKind::Triangles, "obstacles", [1.0; 3], WALL, walls),
        (MarkerKind::Spheres, "waypoints", size, ROUTE, waypoints),
        (MarkerKind::LineStrip, "search_path", width, SEARCH, search),
        (MarkerKind::Points, "vertices", width, VERTEX, drawing.vertices(recording)),
    ] {
        // RViz warns about markers without points.
        if !points.is_empty() {
            all.push(marker(kind, of, scale, rgb, points)?);
        }
    }
    Ok(all)
}

/// A body in its own frame, locked to it.
fn cylinder(body: &Body, log_time: u64) -> Result<Marker, McapError> {
    Ok(Marker {
        position: [0.0, 0.0, body.radius_m],
        frame_locked: true,
        ..Marker::new(
            header(&body.name, log_time)?,
            MarkerKind::Cylinder,
            &body.name,
            [2.0 * body.radius_m; 3],
            body.rgb,
        )
    })
}

fn terrain_marker(
    kind: MarkerKind,
    of: &str,
    scale: [f64; 3],
    rgb: [u8; 3],
    points: Vec<[f64; 3]>,
    log_time: u64,
) -> Result<Marker, McapError> {
    Ok(Marker { points, ..Marker::new(header(TERRAIN, log_time)?, kind, of, scale, rgb) })
}

fn formation_box(drawing: &Drawing, one: &FormationBox, log_time: u64) -> Result<Marker, McapError> {
    let width_m = 0.5 * drawing.lift_m;
    let line = drawing.box_line(one);
    terrain_marker(MarkerKind::LineStrip, "box", [width_m, 0.0, 0.0], box_rgb(one.squeezed), line, log_time)
}

fn log(recording: &TeamRecording, event: &TeamEvent, log_time: u64) -> Result<Log, McapError> {
    let (sec, nanosec) = stamp(log_time)?;
    Ok(Log {
        sec,
        nanosec,
        level: 10 * level(event.kind),
        name: event.kind.name().to_owned(),
        msg: text(recording, event),
        file: String::new(),
        function: String::new(),
        line: 0,
    })
}
