//! ROS 2 flavour of rovers: the topics of `sastrugi_schemas::topics::ros2::ROVER_ROS2`, in CDR.

use super::super::frames::{BASE, GOAL, IDENTITY, MAP, START, rotated};
use super::super::ros2::message::{Log, Marker, MarkerKind, Odometry, Path, Pose, PoseStamped, TwistStamped, encode};
use super::super::ros2::{EXACT, TERRAIN, header, stamp, terrain_messages, transform};
use super::super::{McapError, Timeline, log_time};
use super::{
    BODY, CLEAR, END_M, HAZARD, MISSED, RoverMcap, WHEELS, area_triangles, body, corridor, level, on_ground,
    path_states, ray_lines, relative, wheels,
};
use sastrugi_schemas::topics::ros2::{
    ROVER_CMD_VEL, ROVER_EVENTS, ROVER_MARKERS, ROVER_ODOM, ROVER_PATH, ROVER_PLAN, ROVER_STATE, ROVER_TF, ROVER_VIEW,
};
use sastrugi_schemas::topics::{RoverCycle, RoverEvent, StateSample};

/// Width of rays, m.
const RAY_M: f64 = 0.005;
/// Opacity of areas.
const AREA: f32 = 0.35;

/// Adds all messages of a drive to the timeline.
pub(super) fn messages(rover: &RoverMcap, out: &mut Timeline) -> Result<(), McapError> {
    let recording = rover.recording;
    terrain_messages(rover.terrain, &corridor(rover), out)?;
    out.add(&ROVER_MARKERS, 0.0, |t| encode(&markers(rover, t)?))?;
    let epoch_ns = out.epoch_ns;
    out.add(&ROVER_PATH, 0.0, |t| {
        let of = |s: &StateSample| (log_time(epoch_ns, s.time_s), s.position_m, s.orientation);
        encode(&path(path_states(recording).into_iter().map(of), t)?)
    })?;
    for plan in &recording.plans {
        out.add(&ROVER_PLAN, plan.time_s, |t| encode(&path(plan.points_m.iter().map(|p| (t, *p, IDENTITY)), t)?))?;
    }
    for state in &recording.states {
        let (at, turned) = (state.position_m, state.orientation);
        out.add(&ROVER_TF, state.time_s, |t| encode(&vec![transform(MAP, BASE, at, turned, t)?]))?;
        out.add(&ROVER_ODOM, state.time_s, |t| encode(&odometry(state, t)?))?;
    }
    let mut before = None;
    for cycle in &recording.cycles {
        out.add(&ROVER_VIEW, cycle.time_s, |t| encode(&view(rover, cycle, t)?))?;
        if before != Some(&cycle.state) {
            out.add(&ROVER_STATE, cycle.time_s, |_| encode(&cycle.state))?;
            before = Some(&cycle.state);
        }
        commands(cycle, out)?;
    }
    recording.events.iter().try_for_each(|event| out.add(&ROVER_EVENTS, event.time_s, |t| encode(&log(event, t)?)))
}

/// Commands of a cycle: the turn, then the drive; or a stop if there is neither.
fn commands(cycle: &RoverCycle, out: &mut Timeline) -> Result<(), McapError> {
    let [turn_s, drive_s] = cycle.durations_s;
    let [turn_rad, drive_m] = cycle.moved;
    let mut command = |time_s: f64, speed_m_s: f64, rate_rad_s: f64| {
        out.add(&ROVER_CMD_VEL, time_s, |t| {
            encode(&TwistStamped {
                header: header(BASE, t)?,
                linear: [speed_m_s, 0.0, 0.0],
                angular: [0.0, 0.0, rate_rad_s],
            })
        })
    };
    if turn_s > 0.0 {
        command(cycle.time_s, 0.0, turn_rad / turn_s)?;
    }
    if drive_s > 0.0 {
        command(cycle.time_s + turn_s, drive_m / drive_s, 0.0)?;
    }
    if turn_s > 0.0 || drive_s > 0.0 { Ok(()) } else { command(cycle.time_s, 0.0, 0.0) }
}

fn odometry(state: &StateSample, log_time: u64) -> Result<Odometry, McapError> {
    let [x, y, z, w] = state.orientation;
    Ok(Odometry {
        header: header(MAP, log_time)?,
        child_frame_id: BASE.to_owned(),
        pose: Pose { position: state.position_m, orientation: state.orientation },
        pose_covariance: EXACT,
        linear: rotated([-x, -y, -z, w], state.velocity_m_s),
        angular: state.angular_velocity_rad_s,
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

/// Body, wheels, start and goal.
fn markers(rover: &RoverMcap, log_time: u64) -> Result<Vec<Marker>, McapError> {
    let [size_m, centre_m] = body(rover.recording);
    let (hubs_m, radius_m, width_m) = wheels(rover.recording);
    let in_body = |kind, of: &str, scale, rgb| -> Result<Marker, McapError> {
        Ok(Marker { frame_locked: true, ..Marker::new(header(BASE, log_time)?, kind, of, scale, rgb) })
    };
    let mut all = vec![Marker { position: centre_m, ..in_body(MarkerKind::Cube, "body", size_m, BODY)? }];
    for (hub_m, id) in hubs_m.into_iter().zip(0..) {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let size_m = [2.0 * radius_m, 2.0 * radius_m, width_m];
        let wheel = in_body(MarkerKind::Cylinder, "wheels", size_m, WHEELS)?;
        all.push(Marker { id, position: hub_m, orientation: [half, 0.0, 0.0, half], ..wheel });
    }
    for (of, point, rgb) in [("start", rover.start_m, START), ("goal", rover.goal_m, GOAL)] {
        let at = vec![relative(rover, on_ground(rover, point))];
        let sphere = Marker::new(header(TERRAIN, log_time)?, MarkerKind::Spheres, of, [END_M; 3], rgb);
        all.push(Marker { points: at, ..sphere });
    }
    Ok(all)
}

/// Areas and rays. A kind without points is deleted, because RViz warns about markers without points.
fn view(rover: &RoverMcap, cycle: &RoverCycle, log_time: u64) -> Result<Vec<Marker>, McapError> {
    const DELETE: i32 = 2;
    let areas = [("hazards", true, HAZARD), ("clear", false, CLEAR)];
    let areas =
        areas.map(|(of, hazard, rgb)| (MarkerKind::Triangles, of, [1.0; 3], rgb, area_triangles(rover, cycle, hazard)));
    let rays = [("rays of hazards", HAZARD), ("rays", CLEAR), ("rays without a hit", MISSED)];
    let rays = rays.map(|(of, rgb)| (MarkerKind::LineList, of, [RAY_M, 0.0, 0.0], rgb, ray_lines(rover, cycle, rgb)));
    let has_rays = !cycle.rays.is_empty();
    let marker = |(kind, of, scale, rgb, points): (MarkerKind, &str, [f64; 3], [u8; 3], Vec<[f64; 3]>)| {
        let mut marker = Marker::new(header(TERRAIN, log_time)?, kind, of, scale, rgb);
        marker.rgba[3] = if matches!(kind, MarkerKind::Triangles) { AREA } else { 1.0 };
        marker.action = if points.is_empty() { DELETE } else { 0 };
        Ok(Marker { points, ..marker })
    };
    areas.into_iter().chain(rays.into_iter().filter(|_| has_rays)).map(marker).collect()
}

fn log(event: &RoverEvent, log_time: u64) -> Result<Log, McapError> {
    let (sec, nanosec) = stamp(log_time)?;
    Ok(Log {
        sec,
        nanosec,
        level: 10 * level(event.kind),
        name: event.kind.name().to_owned(),
        msg: event.text.clone(),
        file: String::new(),
        function: String::new(),
        line: 0,
    })
}
