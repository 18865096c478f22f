"""Recordings of rovers in both flavours compared with the tables, message by message: check_rover.py VIEWER_RELEASE ROS2_RELEASE.

Both releases are of one study with `sample_m = 0`, so that `rover_samples` has a row for every cycle.
"""

import importlib
import math
import sys
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import check_ros2
from check_mcap import check_finite, mesh_triangles, off_mesh
from check_ros2 import values
from common import ContentHash, Mismatch, expect, manifest, table

VIEWER = {
    "/terrain/mesh", "/terrain/grid", "/vehicle/shape", "/vehicle/path", "/vehicle/plan", "/tf", "/vehicle/pose",
    "/sensor/view", "/vehicle/state", "/events",
}
ROS2 = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/terrain": "grid_map_msgs/msg/GridMap",
    "/terrain/points": "sensor_msgs/msg/PointCloud2",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/path": "nav_msgs/msg/Path",
    "/plan": "nav_msgs/msg/Path",
    "/markers": "visualization_msgs/msg/MarkerArray",
    "/sensor/view": "visualization_msgs/msg/MarkerArray",
    "/state": "std_msgs/msg/String",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/events": "rcl_interfaces/msg/Log",
}
LASTING = {"/tf_static", "/terrain", "/terrain/points", "/path", "/markers"}
AREAS = {"sojourner_like": 5, "schoppers_like": 4, "planner": 4}
RAYS = {"sojourner_like": 20, "schoppers_like": 0, "planner": 0}
# Steps of drawn points, and of numbers other than poses.
STEP = 1 / 1024
# The plane of four wheels lies off the ground that it spans, by up to a rock lower than a hazard.
BODY_OFF_GROUND_M = 0.2


def read_viewer(path):
    """Messages by topic, each with its time, and the content hash; Foxglove's own Python messages read the same bytes."""
    content, messages, last = ContentHash("messages"), {}, -1
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            expect(message.log_time >= last, f"{path}: {channel.topic} at {message.log_time} comes after {last}")
            last = message.log_time
            content.text(channel.topic)
            content.u64(message.log_time)
            content.bytes(message.data)
            check_finite(path, channel.topic, decoded)
            if schema.name.startswith("foxglove."):
                name = schema.name.split(".")[1]
                official = getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)
                parsed = official.FromString(message.data)
                expect(parsed.SerializeToString() == decoded.SerializeToString(), f"{path}: {schema.name} reads otherwise")
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
    return messages, records, content.hex()


def near(found, expected, step=STEP):
    return np.allclose(found, expected, rtol=0, atol=0.51 * step)


def check_state(path, message, row, rover):
    """A state message has the values of the row of its cycle."""
    exact = {"cycle": "cycle", "x_m": "x_m", "y_m": "y_m", "z_m": "z_m", "believed_x_m": "believed_x_m",
             "believed_y_m": "believed_y_m", "state": "state", "hazards": "hazards"}
    for field, column in exact.items():
        expect(getattr(message, field) == row[column], f"{path}: {field} of cycle {row['cycle']} is {getattr(message, field)}")
    for field, column in {"roll_deg": "roll_deg", "pitch_deg": "pitch_deg", "distance_m": "distance_m"}.items():
        expect(near(getattr(message, field), row[column]), f"{path}: {field} of cycle {row['cycle']}")
    expect(near(math.degrees(message.heading_rad), row["heading_deg"], 1e-9), f"{path}: heading of cycle {row['cycle']}")
    far_m = math.hypot(rover["goal_x_m"] - row["x_m"], rover["goal_y_m"] - row["y_m"])
    expect(near(message.goal_distance_m, far_m), f"{path}: distance to the goal in cycle {row['cycle']}")


def check_view(path, entity, row, navigator):
    """Areas are drawn as triangles and rays as lines, red where there is a hazard."""
    of = lambda lists: {("red" if part.color.r > part.color.g else "green" if part.color.g > 1.3 * part.color.b else "grey"):
                        part.points for part in lists}
    areas, rays = of(entity.triangles), of(entity.lines)
    hazards, clear = row["hazards"].count("1"), row["hazards"].count("0")
    expect(hazards + clear == AREAS[navigator], f"{path}: {row['hazards']}")
    found = (len(areas.get("red", [])), len(areas.get("green", [])))
    expect(found == (6 * hazards, 6 * clear), f"{path}: areas of cycle {row['cycle']}: {found}")
    expect(sum(map(len, rays.values())) == 2 * RAYS[navigator], f"{path}: rays of cycle {row['cycle']}")
    origin = entity.triangles[0].pose.position
    for points in areas.values():
        ahead = [math.hypot(p.x + origin.x - row["x_m"], p.y + origin.y - row["y_m"]) for p in points]
        expect(0.2 < min(ahead) and max(ahead) < 1.8, f"{path}: areas of cycle {row['cycle']} lie {ahead} m away")


def check_events(path, events, rows, rover):
    """The first is the start, the last the outcome; reversals, hazards and contacts as often as the table counts them."""
    names = [name for name, _, _ in events]
    expect(names[0] == "start" and names[-1] == rover["outcome"], f"{path}: events {names}")
    expect(names.count("contact") == rover["contacts"], f"{path}: {names.count('contact')} contacts")
    expect(names.count("reversal") == rover["reversals"], f"{path}: {names.count('reversal')} reversals")
    seen = ["1" in row["hazards"] for row in rows]
    first = sum(now and not before for before, now in zip([False, *seen], seen))
    expect(names.count("hazard") == first, f"{path}: {names.count('hazard')} hazards, not {first}")
    expect(all(text for _, _, text in events), f"{path}: an event without words")
    if rover["note"] is not None:
        expect(events[-1][2] == rover["note"], f"{path}: ends with {events[-1][2]!r}")


def check_viewer(release, rover, rows):
    path = release / rover["path"]
    messages, records, content = read_viewer(path)
    planned = rover["navigator"] == "planner"
    expect(set(messages) == VIEWER - (set() if planned else {"/vehicle/plan"}), f"{path}: topics {sorted(messages)}")
    artifact = next(a for a in manifest(release)["artifacts"] if a["path"] == rover["path"])
    expect(artifact["content_sha256"] == content, f"{path}: another content hash than the manifest's")
    expect(set(records) == {"study", "terrain", "rover", "navigator", "outcome", "hashes"}, f"{path}: {sorted(records)}")
    expect(records["outcome"]["outcome"] == rover["outcome"], f"{path}: outcome {records['outcome']}")
    epoch = messages["/tf"][0][0]
    expect(len(messages["/vehicle/state"]) == len(messages["/sensor/view"]) == len(rows), f"{path}: {len(rows)} cycles")
    for (time, message), (_, view), row in zip(messages["/vehicle/state"], messages["/sensor/view"], rows):
        expect(time - epoch == round(row["time_s"] * 1e9), f"{path}: cycle {row['cycle']} is at {time - epoch} ns")
        check_state(path, message, row, rover)
        check_view(path, view.entities[0], row, rover["navigator"])
    poses = messages["/vehicle/pose"]
    expect([time - epoch for time, _ in poses] == [k * 10**9 for k in range(len(poses))], f"{path}: poses are not at 1 Hz")
    expect(len(poses) == len(messages["/tf"]) and rover["time_s"] - 1 <= len(poses) - 1 <= rover["time_s"], f"{path}: {len(poses)} poses")
    for (_, pose), (_, tf) in zip(poses, messages["/tf"]):
        expect(values(pose.pose.position) == values(tf.transforms[0].translation), f"{path}: /tf is elsewhere")
        expect(abs(np.linalg.norm(values(pose.pose.orientation)) - 1) < 1e-12, f"{path}: an orientation is not a rotation")
    driven = np.array([values(pose.position) for pose in messages["/vehicle/path"][0][1].poses])
    expected = [values(pose.pose.position) for _, pose in poses]
    expect(np.array_equal(driven, np.array(expected[::10] + ([expected[-1]] if (len(expected) - 1) % 10 else []))), f"{path}: path")
    worst, lost = off_mesh(mesh_triangles(path, messages["/terrain/mesh"][0][1]), [np.array(p) for p in expected[::25]])
    expect(lost == 0 and worst <= BODY_OFF_GROUND_M, f"{path}: {lost} poses off the mesh, {worst} m from it")
    shape = {entity.id: entity for entity in messages["/vehicle/shape"][0][1].entities}
    goal = shape["goal"].spheres[0].pose.position
    expect((goal.x, goal.y) == (rover["goal_x_m"], rover["goal_y_m"]), f"{path}: the goal is at {goal}")
    check_events(path, [(m.name, m.level, m.message) for _, m in messages["/events"]], rows, rover)
    if planned:
        for time, plan in messages["/vehicle/plan"]:
            first, last = plan.poses[0].position, plan.poses[-1].position
            row = min(rows, key=lambda row: abs(row["time_s"] * 1e9 - (time - epoch)))
            expect((first.x, first.y) == (row["believed_x_m"], row["believed_y_m"]), f"{path}: a plan begins elsewhere")
            expect((last.x, last.y) == (rover["goal_x_m"], rover["goal_y_m"]), f"{path}: a plan ends elsewhere")
    return sum(map(len, messages.values()))


def check_bag(release, rover, rows):
    path = release / rover["path"]
    folder = path.parent
    with open(path, "rb") as file:
        definitions = check_ros2.embedded_types(make_reader(file))
    check_ros2.check_definitions(path, definitions)
    messages = check_ros2.read_bag(folder, definitions, ROS2, LASTING)
    epoch = messages["/tf"][0][0]
    expect(len(messages["/sensor/view"]) == len(rows), f"{path}: {len(messages['/sensor/view'])} views of {len(rows)} cycles")
    for (time, view), row in zip(messages["/sensor/view"], rows):
        expect(time - epoch == round(row["time_s"] * 1e9), f"{path}: cycle {row['cycle']} is at {time - epoch} ns")
        markers = {marker.ns: marker for marker in view.markers}
        for name, flag in [("hazards", "1"), ("clear", "0")]:
            count = 6 * row["hazards"].count(flag)
            expect(len(markers[name].points) == count, f"{path}: {name} of cycle {row['cycle']}")
            expect(markers[name].action == (0 if count else 2), f"{path}: {name} of cycle {row['cycle']} is not taken away")
    states = [row["state"] for k, row in enumerate(rows) if k == 0 or row["state"] != rows[k - 1]["state"]]
    expect([m.data for _, m in messages["/state"]] == states, f"{path}: states")
    for (_, tf), (_, odometry) in zip(messages["/tf"], messages["/odom"], strict=True):
        at = values(odometry.pose.pose.position)
        expect(values(tf.transforms[0].transform.translation) == at, f"{path}: /tf is elsewhere than /odom")
        speed = values(odometry.twist.twist.linear)
        expect(abs(speed[1]) < 1e-9 and abs(abs(speed[0]) - 0.01) < 0.003 or speed == [0, 0, 0], f"{path}: it drives at {speed}")
    turned = [m for _, m in messages["/cmd_vel"] if m.twist.angular.z != 0]
    expect(len(turned) == rover["turns"], f"{path}: {len(turned)} turns are commanded, not {rover['turns']}")
    origin = np.array(values(messages["/tf_static"][0][1].transforms[0].transform.translation))
    goal = next(m for m in messages["/markers"][0][1].markers if m.ns == "goal").points[0]
    expect(near((np.array(values(goal)) + origin)[:2], [rover["goal_x_m"], rover["goal_y_m"]]), f"{path}: the goal is elsewhere")
    check_events(path, [(m.name, m.level, m.msg) for _, m in messages["/events"]], rows, rover)
    return sum(map(len, messages.values()))


def main():
    releases = [Path(argument) for argument in sys.argv[1:3]]
    outcomes = []
    for release, check in zip(releases, [check_viewer, check_bag]):
        samples = table(release, "rover_samples")
        rovers = [rover for rover in table(release, "rovers") if rover["path"] is not None]
        for rover in rovers:
            own = [row for row in samples if row["terrain_id"] == rover["terrain_id"] and row["rover_id"] == rover["rover_id"]]
            own.sort(key=lambda row: row["sample"])
            count = check(release, rover, own)
            print(f"{rover['path']}: {count} messages, {rover['outcome']}")
            outcomes.append(rover["outcome"])
    expect("reached" in outcomes and len(set(outcomes)) > 1, f"outcomes {outcomes}: at least one must arrive and one must not")


if __name__ == "__main__":
    try:
        main()
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
