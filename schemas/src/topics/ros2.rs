//! Topics of the ROS 2 flavour: public messages in CDR, with their definitions embedded in the file.

use super::Topic;

const fn topic(name: &'static str, schema: &'static str, description: &'static str) -> Topic {
    Topic { name, schema, description, fields: &[] }
}

/// Topic `/tf_static`.
pub const TF_STATIC: Topic = topic(
    "/tf_static",
    "tf2_msgs/msg/TFMessage",
    "map -> terrain, the origin of /terrain/points; one message at the mission's start",
);
/// Topic `/terrain`.
pub const TERRAIN: Topic = topic(
    "/terrain",
    "grid_map_msgs/msg/GridMap",
    "the terrain with at most 128 square cells per side: layers elevation (m) and class; one message at the mission's start",
);
/// Topic `/terrain/points`.
pub const TERRAIN_POINTS: Topic = topic(
    "/terrain/points",
    "sensor_msgs/msg/PointCloud2",
    "cell centres of the terrain, coloured by roughness class: all along the path, fewer elsewhere; one message at the \
     mission's start",
);
/// Topic `/tf`.
pub const TF: Topic =
    topic("/tf", "tf2_msgs/msg/TFMessage", "map -> base_link and base_link -> each wheel, at the sampling rate");
/// Topic `/odom`.
pub const ODOM: Topic = topic(
    "/odom",
    "nav_msgs/msg/Odometry",
    "true pose of base_link in map and its motion in base_link, at the sampling rate; covariances are 0",
);
/// Topic `/imu`.
pub const IMU: Topic = topic(
    "/imu",
    "sensor_msgs/msg/Imu",
    "an ideal inertial measurement unit at base_link, at its own rate: orientation, angular velocity, mean specific force since \
     the previous sample",
);
/// Topic `/joint_states`.
pub const JOINT_STATES: Topic = topic(
    "/joint_states",
    "sensor_msgs/msg/JointState",
    "wheels: angle turned (rad), spin (rad/s) and drive torque (N m), at the sampling rate",
);
/// Topic `/cmd_vel`.
pub const CMD_VEL: Topic = topic(
    "/cmd_vel",
    "geometry_msgs/msg/TwistStamped",
    "commanded forward speed and yaw rate in base_link, at the sampling rate",
);
/// Topic `/events`.
pub const EVENTS: Topic = topic(
    "/events",
    "rcl_interfaces/msg/Log",
    "start and outcome of the mission; the logger name is the kind of event",
);

/// Topic `/tf` of a team.
pub const TEAM_TF: Topic =
    topic("/tf", "tf2_msgs/msg/TFMessage", "map -> each member and each moving obstacle, at the sampling rate");
/// Topic `/team/route`.
pub const TEAM_ROUTE: Topic = topic(
    "/team/route",
    "nav_msgs/msg/Path",
    "the planned route: its waypoints and, between them, one pose per cell on the ground, at most 8192; one \
     message at the run's start, and one whenever a team replans",
);
/// Topic `/team/markers`.
pub const TEAM_MARKERS: Topic = topic(
    "/team/markers",
    "visualization_msgs/msg/MarkerArray",
    "members and moving obstacles in their frames; start, goal, obstacles, waypoints of the route, path of the search before \
     smoothing, and vertices of the roadmap (evenly spaced in their order if there are more than 16384) in the frame terrain; \
     one message at the run's start",
);
/// Topic `/team/box`.
pub const TEAM_BOX: Topic = topic(
    "/team/box",
    "visualization_msgs/msg/MarkerArray",
    "bounding box of the formation in the frame terrain, in another colour where it is squeezed; whenever it changes",
);
/// Topics `/member_1/odom` etc.
pub const MEMBER_ODOM: Topic = topic(
    "/{member}/odom",
    "nav_msgs/msg/Odometry",
    "true pose of the member in map and its motion in its own frame (mean yaw rate since the previous sample), at the sampling rate; \
     covariances are 0",
);
/// Topics `/member_1/path` etc.
pub const MEMBER_PATH: Topic = topic(
    "/{member}/path",
    "nav_msgs/msg/Path",
    "the complete path of the member, two poses per second, in one message at the run's start",
);
/// Topic `/events` of a team.
pub const TEAM_EVENTS: Topic = topic(
    "/events",
    "rcl_interfaces/msg/Log",
    "events of the team or of a member, whose name then begins the message; the logger name is the kind of event",
);

/// Topic `/tf` of a rover.
pub const ROVER_TF: Topic = topic("/tf", "tf2_msgs/msg/TFMessage", "map -> base_link, once a second");
/// Topic `/odom` of a rover.
pub const ROVER_ODOM: Topic = topic(
    "/odom",
    "nav_msgs/msg/Odometry",
    "true pose of base_link in map and its motion in base_link, once a second; covariances are 0",
);
/// Topic `/path` of a rover.
pub const ROVER_PATH: Topic = topic(
    "/path",
    "nav_msgs/msg/Path",
    "the complete path of the rover, one pose every 10 s and the last one, in one message at the start",
);
/// Topic `/plan` of a rover.
pub const ROVER_PLAN: Topic = topic(
    "/plan",
    "nav_msgs/msg/Path",
    "the path planned by a rover with a planner, from its estimated position; whenever it changes",
);
/// Topic `/markers` of a rover.
pub const ROVER_MARKERS: Topic = topic(
    "/markers",
    "visualization_msgs/msg/MarkerArray",
    "body of the rover in base_link; start and goal in the frame terrain; one message at the start",
);
/// Topic `/sensor/view` of a rover.
pub const ROVER_VIEW: Topic = topic(
    "/sensor/view",
    "visualization_msgs/msg/MarkerArray",
    "the rover's view, in the frame terrain: areas and rays coloured by hazard (red: a hazard, green: none, grey: a ray that met nothing); once per cycle",
);
/// Topic `/state` of a rover.
pub const ROVER_STATE: Topic = topic("/state", "std_msgs/msg/String", "state of the navigator; whenever it changes");
/// Topic `/cmd_vel` of a rover.
pub const ROVER_CMD_VEL: Topic = topic(
    "/cmd_vel",
    "geometry_msgs/msg/TwistStamped",
    "executed speed and yaw rate in base_link, at the beginning of every turn and drive, and 0 at the end",
);
/// Topic `/events` of a rover.
pub const ROVER_EVENTS: Topic = topic(
    "/events",
    "rcl_interfaces/msg/Log",
    "start, hazards coming into view, first turns, reverse drives, contacts and the end; the logger name is the kind of event",
);

/// All topics of a mission in the ROS 2 flavour, in the order of their channels.
pub const ROS2: [&Topic; 9] =
    [&TF_STATIC, &TERRAIN, &TERRAIN_POINTS, &TF, &ODOM, &IMU, &JOINT_STATES, &CMD_VEL, &EVENTS];

/// All topics of a team in the ROS 2 flavour, in the order of their channels; the member topics are repeated for each member.
pub const TEAM_ROS2: [&Topic; 10] = [
    &TF_STATIC,
    &TERRAIN,
    &TERRAIN_POINTS,
    &TEAM_TF,
    &TEAM_ROUTE,
    &TEAM_MARKERS,
    &TEAM_BOX,
    &MEMBER_ODOM,
    &MEMBER_PATH,
    &TEAM_EVENTS,
];

/// All topics of a rover in the ROS 2 flavour, in the order of their channels.
pub const ROVER_ROS2: [&Topic; 12] = [
    &TF_STATIC,
    &TERRAIN,
    &TERRAIN_POINTS,
    &ROVER_TF,
    &ROVER_ODOM,
    &ROVER_PATH,
    &ROVER_PLAN,
    &ROVER_MARKERS,
    &ROVER_VIEW,
    &ROVER_STATE,
    &ROVER_CMD_VEL,
    &ROVER_EVENTS,
];
