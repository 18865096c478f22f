"""Logs by other writers, and the metrics that numpy computes from the same motion: make_logs.py FOLDER.

A vehicle drives along a circle of 20 m at 1 m/s over a wave; 50 Hz poses with jittered stamps, an IMU at 200 Hz. Prints as JSON,
for each log, the metrics expected from `analyze`.
"""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

EPOCH_NS = 1_700_000_000_000_000_000
STORE = get_typestore(Stores.ROS2_HUMBLE)
RATE_HZ = 20.0


def quaternion(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = (f(0.5 * a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.array([
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ])


def motion(t):
    yaw = t / 20.0
    position = np.array([20.0 * np.sin(yaw), 20.0 * (1.0 - np.cos(yaw)), 0.02 * np.sin(2 * np.pi * 1.5 * t)])
    return position, quaternion(0.05 * np.sin(2 * np.pi * 0.9 * t), 0.04 * np.sin(2 * np.pi * 1.1 * t), yaw)


def angles(q):
    x, y, z, w = q.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return roll, np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))


def expected(stamps_ns, positions, quaternions):
    """Linear interpolation at 20 Hz from the first stamp on, then differences."""
    t = (stamps_ns - stamps_ns[0]) * 1e-9
    at = np.arange(0.0, t[-1] + 1e-12, 1.0 / RATE_HZ)
    even = lambda values: np.column_stack([np.interp(at, t, column) for column in values.T])
    p, q = even(positions), even(quaternions)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    rms = lambda values: float(np.sqrt(np.mean(values**2)))
    roll, pitch = angles(q)
    return {
        "samples": len(at),
        "time_s": float(t[-1]),
        "path_length_m": float(np.sum(np.linalg.norm(np.diff(p[:, :2], axis=0), axis=1))),
        "rms_vertical_acceleration_m_s2": rms(np.diff(p[:, 2], 2) * RATE_HZ**2),
        "rms_pitch_rate_deg_s": rms(np.degrees(np.diff(pitch)) * RATE_HZ),
        "rms_roll_rate_deg_s": rms(np.degrees(np.diff(roll)) * RATE_HZ),
        "max_pitch_deg": float(np.degrees(np.abs(pitch).max())),
        "max_roll_deg": float(np.degrees(np.abs(roll).max())),
    }


def stamp_dict(ns):
    return {"sec": int(ns // 1_000_000_000), "nanosec": int(ns % 1_000_000_000)}


def header(ns, frame):
    return {"stamp": stamp_dict(ns), "frame_id": frame}


def pose_dict(p, q):
    position = dict(zip("xyz", map(float, p)))
    return {"position": position, "orientation": dict(zip("xyzw", map(float, q)))}


def transform_dict(ns, parent, child, p, q):
    translation = dict(zip("xyz", map(float, p)))
    rotation = dict(zip("xyzw", map(float, q)))
    return {
        "header": header(ns, parent),
        "child_frame_id": child,
        "transform": {"translation": translation, "rotation": rotation},
    }


def definition(name):
    text, _ = STORE.generate_msgdef(name, ros_version=2)
    return text


def write_ros2(path, topic, name, messages):
    with open(path, "wb") as stream:
        writer = Ros2Writer(stream)
        schema = writer.register_msgdef(name, definition(name))
        for ns, message in messages:
            writer.write_message(topic=topic, schema=schema, message=message, log_time=ns, publish_time=ns)
        writer.finish()


def odometry(ns, p, q):
    zero = {"linear": dict(x=1.0, y=0.0, z=0.0), "angular": dict(x=0.0, y=0.0, z=0.05)}
    return {
        "header": header(ns, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": pose_dict(p, q), "covariance": [0.0] * 36},
        "twist": {"twist": zero, "covariance": [0.0] * 36},
    }


def write_bag(folder, stamps, positions, quaternions):
    """The same motion by another writer: rosbags, PoseStamped, uncompressed."""
    types = STORE.types
    stamped, pose = types["geometry_msgs/msg/PoseStamped"], types["geometry_msgs/msg/Pose"]
    point, turn = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
    head, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    with BagWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/pose", stamped.__msgtype__, typestore=STORE)
        for ns, p, q in zip(stamps, positions, quaternions):
            when = head(stamp=time(**stamp_dict(ns)), frame_id="map")
            message = stamped(header=when, pose=pose(position=point(*map(float, p)), orientation=turn(*map(float, q))))
            writer.write(connection, int(ns), STORE.serialize_cdr(message, stamped.__msgtype__))
    return next(Path(folder).glob("*.mcap"))


def write_split_bag(folder, messages, parts=11):
    """A bag of several files, whose order is not alphabetical."""
    folder.mkdir()
    names = [f"split_{k}.mcap" for k in range(parts)]
    size = -(-len(messages) // parts)
    for k, name in enumerate(names):
        write_ros2(folder / name, "/odom", "nav_msgs/msg/Odometry", messages[k * size : (k + 1) * size])
    listed = "".join(f"    - {name}\n" for name in names)
    text = f"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths:\n{listed}"
    (folder / "metadata.yaml").write_text(text)


def write_foxglove(path, stamps, positions, quaternions):
    with open(path, "wb") as stream, ProtobufWriter(stream) as writer:
        for ns, p, q in zip(stamps, positions, quaternions):
            message = PoseInFrame(frame_id="map")
            message.timestamp.FromNanoseconds(int(ns))
            for name, value in zip("xyz", p):
                setattr(message.pose.position, name, value)
            for name, value in zip("xyzw", q):
                setattr(message.pose.orientation, name, value)
            writer.write_message(topic="/pose", message=message, log_time=int(ns), publish_time=int(ns))


def write_foxglove_tf(path, stamps, positions, quaternions):
    """map -> odom is static, 3 m up; odom -> base_link moves."""
    with open(path, "wb") as stream, ProtobufWriter(stream) as writer:
        for k, (ns, p, q) in enumerate(zip(stamps, positions, quaternions)):
            message = FrameTransforms()
            links = [("odom", "base_link", p, q)]
            if k == 0:
                links.append(("map", "odom", (0.0, 0.0, 3.0), (0.0, 0.0, 0.0, 1.0)))
            for parent, child, translation, rotation in links:
                link = message.transforms.add(parent_frame_id=parent, child_frame_id=child)
                link.timestamp.FromNanoseconds(int(ns))
                for name, value in zip("xyz", translation):
                    setattr(link.translation, name, value)
                for name, value in zip("xyzw", rotation):
                    setattr(link.rotation, name, value)
            writer.write_message(topic="/tf", message=message, log_time=int(ns), publish_time=int(ns))


def main(folder):
    random = np.random.default_rng(1)
    stamps = EPOCH_NS + (np.arange(1500) * 20e6 + random.uniform(0, 6e6, 1500)).astype(np.int64)
    seconds = (stamps - EPOCH_NS) * 1e-9
    positions, quaternions = map(np.array, zip(*(motion(t) for t in seconds)))
    rows = list(zip(map(int, stamps), positions, quaternions))
    figures = expected(stamps, positions, quaternions)

    write_ros2(folder / "odometry.mcap", "/odom", "nav_msgs/msg/Odometry", [(ns, odometry(ns, p, q)) for ns, p, q in rows])
    tf = [(ns, {"transforms": [transform_dict(ns, "odom", "base_link", p, q)]}) for ns, p, q in rows]
    tf[0][1]["transforms"].append(transform_dict(rows[0][0], "map", "odom", (0.0, 0.0, 3.0), (0.0, 0.0, 0.0, 1.0)))
    write_ros2(folder / "tf.mcap", "/tf", "tf2_msgs/msg/TFMessage", tf)
    bag = write_bag(folder / "bag.mcap", stamps, positions, quaternions)
    shutil.copy(bag, folder / "pose_stamped.mcap")
    write_split_bag(folder / "split.mcap", [(ns, odometry(ns, p, q)) for ns, p, q in rows])
    write_foxglove(folder / "pose_in_frame.mcap", stamps, positions, quaternions)
    write_foxglove_tf(folder / "frame_transforms.mcap", stamps, positions, quaternions)

    string = [(ns, {"data": "hello"}) for ns, _, _ in rows[:10]]
    write_ros2(folder / "no_pose.mcap", "/chatter", "std_msgs/msg/String", string)
    back = [(ns, odometry(ns - (10**9 if k == 700 else 0), p, q)) for k, (ns, p, q) in enumerate(rows)]
    write_ros2(folder / "backwards.mcap", "/odom", "nav_msgs/msg/Odometry", back)
    whole = (folder / "pose_stamped.mcap").read_bytes()
    (folder / "truncated.mcap").write_bytes(whole[: len(whole) // 2])
    damaged = bytearray((folder / "odometry.mcap").read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    (folder / "damaged.mcap").write_bytes(bytes(damaged))
    (folder / "text.mcap").write_text("not an MCAP file at all\n")
    print(json.dumps({name: figures for name in ("odometry", "tf", "pose_stamped", "pose_in_frame", "frame_transforms", "bag", "split")}))


main(Path(sys.argv[1]))
