//! Message definitions of ROS 2 "Humble" (`common_interfaces`, `geometry2`, `rcl_interfaces`, `grid_map`): fields and constants of
//! each .msg file, with packages written out. Later distributions read the same bytes.

/// Name and fields of every message used, including nested ones.
const DEFINITIONS: [(&str, &str); 34] = [
    (
        "builtin_interfaces/Time",
        "int32 sec\n\
         uint32 nanosec",
    ),
    (
        "std_msgs/Header",
        "builtin_interfaces/Time stamp\n\
         string frame_id",
    ),
    ("std_msgs/String", "string data"),
    (
        "std_msgs/MultiArrayDimension",
        "string label\n\
         uint32 size\n\
         uint32 stride",
    ),
    (
        "std_msgs/MultiArrayLayout",
        "std_msgs/MultiArrayDimension[] dim\n\
         uint32 data_offset",
    ),
    (
        "std_msgs/Float32MultiArray",
        "std_msgs/MultiArrayLayout layout\n\
         float32[] data",
    ),
    (
        "geometry_msgs/Point",
        "float64 x\n\
         float64 y\n\
         float64 z",
    ),
    (
        "geometry_msgs/Vector3",
        "float64 x\n\
         float64 y\n\
         float64 z",
    ),
    (
        "geometry_msgs/Quaternion",
        "float64 x 0\n\
         float64 y 0\n\
         float64 z 0\n\
         float64 w 1",
    ),
    (
        "geometry_msgs/Pose",
        "geometry_msgs/Point position\n\
         geometry_msgs/Quaternion orientation",
    ),
    (
        "geometry_msgs/PoseWithCovariance",
        "geometry_msgs/Pose pose\n\
         float64[36] covariance",
    ),
    (
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3 linear\n\
         geometry_msgs/Vector3 angular",
    ),
    (
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Twist twist\n\
         float64[36] covariance",
    ),
    (
        "geometry_msgs/TwistStamped",
        "std_msgs/Header header\n\
         geometry_msgs/Twist twist",
    ),
    (
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3 translation\n\
         geometry_msgs/Quaternion rotation",
    ),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\n\
         string child_frame_id\n\
         geometry_msgs/Transform transform",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\n\
         string child_frame_id\n\
         geometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist",
    ),
    (
        "sensor_msgs/Imu",
        "std_msgs/Header header\n\
         geometry_msgs/Quaternion orientation\n\
         float64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\n\
         float64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\n\
         float64[9] linear_acceleration_covariance",
    ),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\n\
         string[] name\n\
         float64[] position\n\
         float64[] velocity\n\
         float64[] effort",
    ),
    (
        "sensor_msgs/PointField",
        "uint8 INT8=1\n\
         uint8 UINT8=2\n\
         uint8 INT16=3\n\
         uint8 UINT16=4\n\
         uint8 INT32=5\n\
         uint8 UINT32=6\n\
         uint8 FLOAT32=7\n\
         uint8 FLOAT64=8\n\
         string name\n\
         uint32 offset\n\
         uint8 datatype\n\
         uint32 count",
    ),
    (
        "sensor_msgs/PointCloud2",
        "std_msgs/Header header\n\
         uint32 height\n\
         uint32 width\n\
         sensor_msgs/PointField[] fields\n\
         bool is_bigendian\n\
         uint32 point_step\n\
         uint32 row_step\n\
         uint8[] data\n\
         bool is_dense",
    ),
    (
        "rcl_interfaces/Log",
        "byte DEBUG=10\n\
         byte INFO=20\n\
         byte WARN=30\n\
         byte ERROR=40\n\
         byte FATAL=50\n\
         builtin_interfaces/Time stamp\n\
         uint8 level\n\
         string name\n\
         string msg\n\
         string file\n\
         string function\n\
         uint32 line",
    ),
    (
        "grid_map_msgs/GridMapInfo",
        "float64 resolution\n\
         float64 length_x\n\
         float64 length_y\n\
         geometry_msgs/Pose pose",
    ),
    (
        "grid_map_msgs/GridMap",
        "std_msgs/Header header\n\
         grid_map_msgs/GridMapInfo info\n\
         string[] layers\n\
         string[] basic_layers\n\
         std_msgs/Float32MultiArray[] data\n\
         uint16 outer_start_index\n\
         uint16 inner_start_index",
    ),
    (
        "builtin_interfaces/Duration",
        "int32 sec\n\
         uint32 nanosec",
    ),
    (
        "std_msgs/ColorRGBA",
        "float32 r\n\
         float32 g\n\
         float32 b\n\
         float32 a",
    ),
    (
        "geometry_msgs/PoseStamped",
        "std_msgs/Header header\n\
         geometry_msgs/Pose pose",
    ),
    (
        "nav_msgs/Path",
        "std_msgs/Header header\n\
         geometry_msgs/PoseStamped[] poses",
    ),
    (
        "sensor_msgs/CompressedImage",
        "std_msgs/Header header\n\
         string format\n\
         uint8[] data",
    ),
    (
        "visualization_msgs/UVCoordinate",
        "float32 u\n\
         float32 v",
    ),
    (
        "visualization_msgs/MeshFile",
        "string filename\n\
         uint8[] data",
    ),
    (
        "visualization_msgs/Marker",
        "int32 ARROW=0\n\
         int32 CUBE=1\n\
         int32 SPHERE=2\n\
         int32 CYLINDER=3\n\
         int32 LINE_STRIP=4\n\
         int32 LINE_LIST=5\n\
         int32 CUBE_LIST=6\n\
         int32 SPHERE_LIST=7\n\
         int32 POINTS=8\n\
         int32 TEXT_VIEW_FACING=9\n\
         int32 MESH_RESOURCE=10\n\
         int32 TRIANGLE_LIST=11\n\
         int32 ADD=0\n\
         int32 MODIFY=0\n\
         int32 DELETE=2\n\
         int32 DELETEALL=3\n\
         std_msgs/Header header\n\
         string ns\n\
         int32 id\n\
         int32 type\n\
         int32 action\n\
         geometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\n\
         std_msgs/ColorRGBA color\n\
         builtin_interfaces/Duration lifetime\n\
         bool frame_locked\n\
         geometry_msgs/Point[] points\n\
         std_msgs/ColorRGBA[] colors\n\
         string texture_resource\n\
         sensor_msgs/CompressedImage texture\n\
         visualization_msgs/UVCoordinate[] uv_coordinates\n\
         string text\n\
         string mesh_resource\n\
         visualization_msgs/MeshFile mesh_file\n\
         bool mesh_use_embedded_materials",
    ),
    ("visualization_msgs/MarkerArray", "visualization_msgs/Marker[] markers"),
];

/// Separator between two definitions.
const SEPARATOR: &str = "================================================================================";

/// The definition of a message with those of all nested messages, as embedded in MCAP files (`ros2msg`); `None` for a message that
/// is not listed. Schema names have the form `nav_msgs/msg/Odometry`.
pub(super) fn of_schema(schema: &str) -> Option<String> {
    let name = schema.replacen("/msg/", "/", 1);
    let mut parts = vec![find(&name)?];
    let mut next = 0;
    while let Some(&(_, text)) = parts.get(next) {
        for (name, text) in text.lines().filter_map(field_type).filter_map(find) {
            if !parts.iter().any(|&(known, _)| known == name) {
                parts.push((name, text));
            }
        }
        next += 1;
    }
    let (first, inside) = parts.split_first()?;
    let inside = inside.iter().map(|(name, text)| format!("{SEPARATOR}\nMSG: {name}\n{text}\n"));
    Some(std::iter::once(format!("{}\n", first.1)).chain(inside).collect())
}

fn find(name: &str) -> Option<(&'static str, &'static str)> {
    DEFINITIONS.into_iter().find(|&(known, _)| known == name)
}

/// The message type of a line `type name`, without the brackets of an array; `None` for a primitive.
fn field_type(line: &str) -> Option<&str> {
    let kind = line.split([' ', '[']).next()?;
    kind.contains('/').then_some(kind)
}
