"""ROS 2 bags of a release, read by rosbags and mcap-ros2-support: check_ros2.py RELEASE.

Every bag opens as a folder, its definitions are the official ones, and its values are those of the tables and the terrain.
"""

import functools
import math

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from common import ContentHash, expect, manifest, read_raster, run, table

TOPICS = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/terrain": "grid_map_msgs/msg/GridMap",
    "/terrain/points": "sensor_msgs/msg/PointCloud2",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/imu": "sensor_msgs/msg/Imu",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/events": "rcl_interfaces/msg/Log",
}
# Messages published once at the start and latched for late subscribers.
LASTING = {"/tf_static", "/terrain", "/terrain/points"}
# grid_map_msgs is not part of the ROS 2 distribution; these are its fields in the branch "humble".
GRID_MAP = {
    "grid_map_msgs/msg/GridMapInfo": [
        ("resolution", "float64"), ("length_x", "float64"), ("length_y", "float64"), ("pose", "geometry_msgs/msg/Pose"),
    ],
    "grid_map_msgs/msg/GridMap": [
        ("header", "std_msgs/msg/Header"), ("info", "grid_map_msgs/msg/GridMapInfo"), ("layers", "string[]"),
        ("basic_layers", "string[]"), ("data", "std_msgs/msg/Float32MultiArray[]"), ("outer_start_index", "uint16"),
        ("inner_start_index", "uint16"),
    ],
}
CELL_HEIGHT_TOLERANCE_M = 1e-3
# Largest number of cells along a side of the grid map.
GRID_CELLS = 128
NO_CLASS = 255
WHEELS = ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]
# Steps of the table, as the topics of the other flavour state them: rad/s, N m. Commands are in none.
COMMAND_STEP, SPIN_STEP, TORQUE_STEP = 1e-12, 1 / 1024, 1 / 64
# Steps of simulated poses and motions, as the recording states them.
POSE_STEP, RATE_STEP = 2**-20, 2**-16


@functools.cache
def official():
    """Definitions of ROS 2 Humble, and those of grid_map_msgs."""
    return get_typestore(Stores.ROS2_HUMBLE)


def type_text(field):
    """A field's type as a .msg file spells it."""
    kind, detail = field
    if kind == Nodetype.NAME:
        return detail
    if kind == Nodetype.BASE:
        return detail[0]
    inner = type_text(detail[0])
    return f"{inner}[{detail[1] or ''}]"


def embedded_types(reader):
    """The definitions in an MCAP file, by name of the schema."""
    return {schema.name: schema.data.decode() for schema in reader.get_summary().schemas.values()}


def check_definitions(path, definitions):
    """Every definition has the hash (RIHS01, over names and types of all fields) of the official one."""
    for name, text in definitions.items():
        types = get_types_from_msg(text, name)
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        for part in types:
            if part in GRID_MAP:
                fields = [(field, type_text(kind)) for field, kind in types[part][1]]
                expect(fields == GRID_MAP[part], f"{path}: {part} is {fields}")
                continue
            expect(types[part] == official().fielddefs[part], f"{path}: {part} differs from the official definition")
            if "grid_map" not in name:
                expect(store.hash_rihs01(part) == official().hash_rihs01(part), f"{path}: the hash of {part} differs")


def typestore(definitions):
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register({k: v for k, v in get_types_from_msg(definitions["grid_map_msgs/msg/GridMap"],
                                                       "grid_map_msgs/msg/GridMap").items() if k.startswith("grid_map")})
    return store


def read_bag(folder, definitions, topics, lasting):
    """Messages by topic as rosbags reads them, each with its time."""
    messages = {}
    store = typestore(definitions)
    with Reader(folder) as bag:
        total = bag.message_count
        expect({c.topic: c.msgtype for c in bag.connections} == topics, f"{folder}: other topics than stated")
        for connection in bag.connections:
            durability = connection.ext.offered_qos_profiles[0].durability.name
            expected = "TRANSIENT_LOCAL" if connection.topic in lasting else "VOLATILE"
            expect(durability == expected, f"{folder}: {connection.topic} is offered as {durability}")
        for connection, time, data in bag.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            messages.setdefault(connection.topic, []).append((time, message))
        counts = {c.topic: c.msgcount for c in bag.connections}
        start, end = bag.start_time, bag.end_time
    read = sum(map(len, messages.values()))
    expect(read == total, f"{folder}: {read} messages, {total} in metadata.yaml")
    for topic, count in counts.items():
        expect(len(messages.get(topic, [])) == count, f"{folder}: metadata.yaml miscounts {topic}")
    times = sorted(time for topic in messages.values() for time, _ in topic)
    # The end of a bag is one past its last message.
    expect((times[0], times[-1] + 1) == (start, end), f"{folder}: metadata.yaml states other times")
    return messages


def values(part):
    """A vector or quaternion as numbers."""
    return [getattr(part, axis) for axis in ("x", "y", "z", "w") if hasattr(part, axis)]


def pose_values(pose):
    return values(pose.position) + values(pose.orientation)


def read_mcap(path):
    """The same messages as mcap-ros2-support reads them, and the content hash."""
    content, messages = ContentHash("messages"), {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        expect(header.profile == "ros2", f"{path} has the profile {header.profile}")
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            expect(schema.encoding == "ros2msg", f"{path}: {channel.topic} has the schema encoding {schema.encoding}")
            expect(channel.metadata.get("description"), f"{path}: {channel.topic} is not described")
            expect(channel.message_encoding == "cdr", f"{path}: {channel.topic} is {channel.message_encoding}")
            content.text(channel.topic)
            content.u64(message.log_time)
            content.bytes(message.data)
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
        return messages, content.hex(), embedded_types(reader)


def stamp_ns(stamp):
    return stamp.sec * 10**9 + stamp.nanosec if hasattr(stamp, "nanosec") else stamp


def check_same(path, ours, theirs):
    """Both readers return the same values on every topic."""
    for topic in ours:
        for (t, a), (u, b) in zip(ours[topic], theirs[topic], strict=True):
            expect(t == u and flat(a) == flat(b), f"{path}: the readers differ on {topic} at {t}")


def flat(message):
    """Every number and text of a message, in order; NaN as None, which equals itself."""
    if isinstance(message, (int, float, str, bool)):
        return [message if message == message else None]
    if isinstance(message, (bytes, np.ndarray)):
        numbers = np.frombuffer(message, np.uint8) if isinstance(message, bytes) else message
        return [None if x != x else x for x in numbers.tolist()]
    if isinstance(message, (list, tuple)):
        return [x for part in message for x in flat(part)]
    # One of the readers lists a definition's constants, whose names are upper case, with its fields.
    names = [n for n in getattr(message, "__slots__", None) or vars(message) if not n.startswith("__") and not n.isupper()]
    return [x for name in names for x in flat(getattr(message, name))]


def check_motion(path, messages, samples, mission):
    odometry = messages["/odom"]
    expect(len(odometry) == len(samples), f"{path}: {len(odometry)} odometries, table samples has {len(samples)}")
    start = odometry[0][0]
    for (time, message), row in zip(odometry, samples):
        header, pose = message.header, pose_values(message.pose.pose)
        expect(abs((time - start) * 1e-9 - row["time_s"]) <= 1e-9, f"{path}: an odometry at {time}")
        expect(stamp_ns(header.stamp) == time, f"{path}: a stamp differs from the time of its message")
        expect((header.frame_id, message.child_frame_id) == ("map", "base_link"), f"{path}: other frames")
        expect(pose == [row[k] for k in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")], f"{path}: a pose at {time}")
        speed = math.dist(values(message.twist.twist.linear), [0, 0, 0])
        expected = math.dist([row[k] for k in ("vx_m_s", "vy_m_s", "vz_m_s")], [0, 0, 0])
        expect(abs(speed - expected) <= 1e-9 * (1 + expected), f"{path}: {speed} m/s, {expected} in table samples")
    # Forward in the body frame: the twist is not in the map frame.
    forward = np.mean([message.twist.twist.linear.x for _, message in odometry])
    expect(forward > 0 or mission["time_s"] < 2, f"{path}: on the mean it drives backwards ({forward} m/s)")
    for (_, message), (_, tf) in zip(odometry, messages["/tf"], strict=True):
        first = tf.transforms[0]
        found = values(first.transform.translation) + values(first.transform.rotation)
        expect(found == pose_values(message.pose.pose), f"{path}: /tf differs from /odom")
    expect(messages["/events"][-1][1].name == mission["outcome"], f"{path}: another outcome than in table missions")


def check_others(path, messages, samples):
    """Commands and wheels are those of the table, as in the other flavour: there in the steps that its topics state. The IMU, which
    no table has, turns with the odometry. Without an equivalent: angles turned by the wheels (in neither table nor odometry) and
    specific forces; `analyze` judges them alike in both flavours.
    """
    start, odometry = messages["/odom"][0][0], dict(messages["/odom"])
    rows = {round(row["time_s"] * 1e9) + start: row for row in samples}

    def compare(topic, what, time, found, expected, step):
        # Half a step is rounding; a billionth of it is the conversion of degrees.
        off = np.abs(np.asarray(found) - np.asarray(expected)).max()
        expect(off <= step / 2 * (1 + 1e-9), f"{path}: {what} of {topic} at {time} is {off} off")

    for time, message in messages["/cmd_vel"]:
        row, twist = rows[time], message.twist
        compare("/cmd_vel", "speed", time, twist.linear.x, row["command_speed_m_s"], COMMAND_STEP)
        yaw_rate = math.radians(row["command_yaw_rate_deg_s"])
        compare("/cmd_vel", "yaw rate", time, twist.angular.z, yaw_rate, COMMAND_STEP)
    for time, message in messages["/joint_states"]:
        row = rows[time]
        expect(list(message.name) == WHEELS, f"{path}: wheels {message.name}")
        compare("/joint_states", "spin", time, message.velocity, row["wheel_spin_rad_s"], SPIN_STEP)
        compare("/joint_states", "torque", time, message.effort, row["wheel_torque_n_m"], TORQUE_STEP)
    shared = [(time, message, odometry[time]) for time, message in messages["/imu"] if time in odometry]
    expect(len(shared) >= len(odometry) - 1, f"{path}: {len(shared)} of {len(odometry)} odometries have an IMU's message")
    for time, message, odom in shared:
        compare("/imu", "orientation", time, values(message.orientation), values(odom.pose.pose.orientation), POSE_STEP)
        compare("/imu", "rate", time, values(message.angular_velocity), values(odom.twist.twist.angular), RATE_STEP)


def bilinear(heights, col, row):
    """Heights between the cell centres; beyond the outer ones, and next to cells without data, the height of the cell."""
    rows, cols = heights.shape
    i, j = (np.clip(np.floor(at).astype(int), 0, n - 2) for at, n in ((col, cols), (row, rows)))
    u, v = col - i, row - j
    north, south = (heights[j + k, i] + (heights[j + k, i + 1] - heights[j + k, i]) * u for k in (0, 1))
    between = north + (south - north) * v
    outside = (col < 0) | (row < 0) | (col > cols - 1) | (row > rows - 1)
    cell = heights[cells_at(row, rows), cells_at(col, cols)]
    return np.where(outside | np.isnan(between), cell, between)


def cells_at(position, count):
    return np.clip(np.floor(position + 0.5).astype(int), 0, count - 1)


def check_grid_map(path, message, raster, classes):
    """Every cell of the grid map has the terrain's height at the place that the map states, and the class of the cell there.
    Returns the size of its cells in cells of the terrain."""
    heights, to_map = raster
    rows, cols = heights.shape
    info, pose = message.info, message.info.pose
    expect(message.layers == ["elevation", "class"], f"{path}: layers {message.layers}")
    dim = [(d.label, d.size, d.stride) for d in message.data[0].layout.dim]
    ny, nx = dim[0][1], dim[1][1]
    expect(dim == [("column_index", ny, nx * ny), ("row_index", nx, nx)], f"{path}: layout {dim}")
    expect(max(nx, ny) <= GRID_CELLS, f"{path}: the grid map has {nx} x {ny} cells")
    expect((message.outer_start_index, message.inner_start_index) == (0, 0), f"{path}: the grid map is rolled")
    expect(values(pose.orientation) == [0, 0, 0, 1], f"{path}: the grid map is turned")
    expect(np.allclose((info.length_x, info.length_y), (nx * info.resolution, ny * info.resolution), rtol=1e-12, atol=0),
           f"{path}: {nx} x {ny} cells of {info.resolution} m are {info.length_x} x {info.length_y} m")
    corner = (pose.position.x - info.length_x / 2, pose.position.y + info.length_y / 2)
    expect(np.allclose(corner, (to_map.c, to_map.f), rtol=0, atol=1e-6), f"{path}: the grid map begins at {corner}")
    bare = (cols * to_map.a - info.length_x, rows * -to_map.e - info.length_y)
    expect(all(-0.01 * info.resolution < b < info.resolution for b in bare), f"{path}: the grid map leaves {bare} m out")
    # Rows of a grid map run from the largest x, columns from the largest y.
    x = pose.position.x + info.length_x / 2 - (np.arange(nx) + 0.5) * info.resolution
    y = pose.position.y + info.length_y / 2 - (np.arange(ny) + 0.5) * info.resolution
    col, row = np.meshgrid((x - to_map.c) / to_map.a - 0.5, (y - to_map.f) / to_map.e - 0.5)
    elevation, code = (np.asarray(layer.data, np.float32).reshape(ny, nx) for layer in message.data)
    expected = bilinear(heights, col, row)
    expect((np.isnan(elevation) == np.isnan(expected)).all(), f"{path}: the grid map has gaps in other places")
    off = np.abs(elevation - expected)
    # One unit in the last place of single precision; the places are good to far less than 1e-9 m.
    fits = np.isnan(expected) | (off <= np.spacing(np.abs(expected).astype(np.float32)) + 1e-9)
    expect(fits.all(), f"{path}: the grid map is {np.nanmax(off)} m off")
    # A centre between two cells may have the class of either.
    near = [classes[cells_at(row + v, rows), cells_at(col + u, cols)] for u in (-1e-6, 1e-6) for v in (-1e-6, 1e-6)]
    found = np.where(np.isnan(code), NO_CLASS, code)
    expect(np.any([found == one for one in near], axis=0).all(), f"{path}: the grid map has other classes")
    return round(info.resolution / to_map.a, 6)


def check_cloud(path, messages, raster):
    """The cloud has the heights of the terrain, at their places."""
    heights, to_map = raster
    origin = values(messages["/tf_static"][0][1].transforms[0].transform.translation)
    cloud = messages["/terrain/points"][0][1]
    expect(cloud.header.frame_id == messages["/tf_static"][0][1].transforms[0].child_frame_id, f"{path}: cloud's frame")
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
    expect([(f.name, f.offset, f.datatype) for f in cloud.fields] == [(n, 4 * k, 7) for k, n in enumerate(kind.names)],
           f"{path}: fields of the cloud")
    points = np.frombuffer(bytes(cloud.data), kind)
    expect(len(points) == cloud.width and cloud.height == 1, f"{path}: {len(points)} points, {cloud.width} stated")
    x, y = (points[axis].astype(float) + origin[k] for k, axis in enumerate("xy"))
    col, row = (x - to_map.c) / to_map.a - 0.5, (y - to_map.f) / to_map.e - 0.5
    expect(max(np.abs(col - np.rint(col)).max(), np.abs(row - np.rint(row)).max()) < 1e-3, f"{path}: points off the cells")
    off = np.abs(points["z"] + origin[2] - heights[np.rint(row).astype(int), np.rint(col).astype(int)]).max()
    expect(off <= CELL_HEIGHT_TOLERANCE_M, f"{path}: a point of the cloud is {off} m off the terrain")
    return len(points)


def check_release(release):
    terrains = {row["terrain_id"]: release / row["path"] for row in table(release, "terrains")}
    raster = functools.lru_cache(maxsize=4)(read_raster)
    samples = {}
    for row in table(release, "samples"):
        samples.setdefault((row["terrain_id"], row["mission_id"]), []).append(row)
    artifacts = {artifact["path"]: artifact for artifact in manifest(release)["artifacts"]}
    report = {}
    for mission in table(release, "missions"):
        path = release / mission["path"]
        expect((path.parent / "metadata.yaml").exists(), f"{path.parent} is not a bag")
        theirs, content, definitions = read_mcap(path)
        expect(artifacts[mission["path"]]["content_sha256"] == content, f"{path}: not the manifest's content hash")
        check_definitions(path, definitions)
        messages = read_bag(path.parent, definitions, TOPICS, LASTING)
        check_same(path, messages, theirs)
        check_motion(path, messages, samples[mission["terrain_id"], mission["mission_id"]], mission)
        check_others(path, messages, samples[mission["terrain_id"], mission["mission_id"]])
        ground = raster(terrains[mission["terrain_id"]])
        classes, _ = raster(release / "classes" / f"{mission['terrain_id']}.raw.tif")
        cells = check_grid_map(path, messages["/terrain"][0][1], ground, classes)
        points = check_cloud(path, messages, ground)
        report[mission["path"]] = {"messages": sum(map(len, messages.values())), "points": points,
                                   "grid_map_cell": cells, "bytes": path.stat().st_size}
    expect(report, f"{release} has no missions")
    return report


if __name__ == "__main__":
    run(check_release, lambda paths: {})
