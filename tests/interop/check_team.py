"""A team's recordings in both flavours and its route, compared with the original recording: check_team.py FOLDER.

FOLDER contains viewer/run.mcap, ros2/{run.mcap,metadata.yaml}, their content hashes, routes.geojson and recording.json.
"""

import importlib
import json
import math
import sys
from pathlib import Path

import numpy as np
import pyproj
import rasterio.features
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import check_rerun
import check_ros2
from check_mcap import check_finite, mesh_triangles, off_mesh
from check_ros2 import pose_values, values
from common import ContentHash, Mismatch, expect

VIEWER = {
    "/terrain/mesh", "/terrain/grid", "/team/shape", "/team/route", "/team/paths", "/team/graph", "/team/box", "/tf",
    "/team/state", "/events",
}
ROS2 = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/terrain": "grid_map_msgs/msg/GridMap",
    "/terrain/points": "sensor_msgs/msg/PointCloud2",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/team/route": "nav_msgs/msg/Path",
    "/team/markers": "visualization_msgs/msg/MarkerArray",
    "/team/box": "visualization_msgs/msg/MarkerArray",
    "/events": "rcl_interfaces/msg/Log",
}
LASTING = {"/tf_static", "/terrain", "/terrain/points", "/team/route", "/team/markers"}
# Steps of drawn points, and of heights of the mesh.
DRAWN_STEP_M = 1 / 1024
GROUND_TOLERANCE_M = 0.01
# Lines and vertices are drawn half a radius above the ground.
LIFT_M = 0.25
LEVELS = {"wait": 1, "dodge": 1, "lost": 3, "squeezed": 3, "stuck": 3, "timeout": 3}


def read_viewer(path):
    """Messages by topic, each with its time, and the content hash. Foxglove's own Python messages read and write the same bytes."""
    content, messages, last = ContentHash("messages"), {}, -1
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
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
    expect(set(messages) == VIEWER, f"{path}: topics {sorted(messages)}")
    return messages, content.hex()


def frames(recording, sample):
    """Name, position and orientation of every body at a sample."""
    for member in recording["members"]:
        state = member["states"][sample]
        half = state["heading_rad"] / 2
        yield member["name"], state["position_m"], [0, 0, math.sin(half), math.cos(half)]
    for number, disc in enumerate(recording["moving"], 1):
        yield f"moving_{number}", disc["states"][sample]["position_m"], [0, 0, 0, 1]


def check_frames(path, sample, found, recording):
    """Positions are the recorded numbers, orientations theirs to rounding."""
    for (name, at, turned), (frame, position, orientation) in zip(frames(recording, sample), found, strict=True):
        expect((frame, list(position)) == (name, at), f"{path}: {frame} is at {position}, not at {at}")
        expect(np.allclose(orientation, turned, rtol=0, atol=1e-15), f"{path}: {frame} is turned by {orientation}")


def lifted(points, origin):
    """Drawn points on the ground, in the map."""
    return np.array([(p.x, p.y, p.z) for p in points]) + [origin.x, origin.y, origin.z] - [0, 0, LIFT_M]


def changed(boxes):
    """Boxes that differ from the one before."""
    shape = lambda box: (box["corners_m"], box["squeezed"])
    return [box for k, box in enumerate(boxes) if k == 0 or shape(box) != shape(boxes[k - 1])]


def check_viewer(path, messages, recording):
    members, epoch = recording["members"], messages["/tf"][0][0]
    samples = len(members[0]["states"])
    for sample, (time, message) in enumerate(messages["/tf"]):
        expect(time - epoch == round(members[0]["states"][sample]["time_s"] * 1e9), f"{path}: /tf at {time}")
        found = [(t.child_frame_id, values(t.translation), values(t.rotation)) for t in message.transforms]
        check_frames(path, sample, found, recording)
    expect(len(messages["/tf"]) == len(messages["/team/state"]) == samples, f"{path}: {samples} samples")
    for sample, (_, message) in enumerate(messages["/team/state"]):
        states = [member["states"][sample] for member in members]
        expect(list(message.member) == [member["name"] for member in members], f"{path}: members of /team/state")
        for field, key in [("heading_rad",) * 2, ("target_distance_m",) * 2, ("slot",) * 2, ("depth_error_m",) * 2,
                           ("width_error_m",) * 2]:
            found, expected = list(getattr(message, field)), [state[key] or 0 for state in states]
            expect(found == expected, f"{path}: {field} at sample {sample} is {found}, not {expected}")
        found = list(zip(message.x_m, message.y_m, message.z_m))
        expect(found == [tuple(state["position_m"]) for state in states], f"{path}: positions of /team/state")
        expect(list(message.speed_m_s) == [math.hypot(*s["velocity_m_s"][:2]) for s in states], f"{path}: speeds")
    triangles = mesh_triangles(path, messages["/terrain/mesh"][0][1])
    contacts = [np.array(state["position_m"]) for member in members for state in member["states"][::10]]
    routes = [(time - epoch, [values(pose.position) for pose in message.poses]) for time, message in messages["/team/route"]]
    check_planned(path, routes, recording)
    worst, lost = off_mesh(triangles, contacts + [np.array(point) for _, route in routes for point in route])
    expect(lost == 0 and worst <= GROUND_TOLERANCE_M, f"{path}: {lost} points off the mesh, {worst} m from it")
    graph = {entity.id: entity for entity in messages["/team/graph"][0][1].entities}
    dashes = graph["vertices"].lines[0]
    ends = lifted(dashes.points, dashes.pose.position)
    off = np.abs((ends[0::2] + ends[1::2]) / 2 - np.array(recording["vertices_m"])).max()
    expect(off <= DRAWN_STEP_M, f"{path}: vertices are drawn {off} m off")
    paths = messages["/team/paths"][0][1].entities
    for entity, member in zip(paths, members, strict=True):
        drawn = lifted(entity.lines[0].points, entity.lines[0].pose.position)
        driven = np.array([state["position_m"] for state in member["states"][::5]])
        expect(np.abs(drawn - driven).max() <= DRAWN_STEP_M, f"{path}: the path of {member['name']} is drawn elsewhere")
    shape = {entity.id: entity for entity in messages["/team/shape"][0][1].entities}
    expect(all(shape[m["name"]].frame_locked and shape[m["name"]].frame_id == m["name"] for m in members), f"{path}: shapes")
    expect({"start", "goal", "obstacles", "moving_1"} <= set(shape), f"{path}: shapes {sorted(shape)}")
    boxes = [(time - epoch, message) for time, message in messages["/team/box"]]
    expected = [round(box["time_s"] * 1e9) for box in changed(recording["boxes"])]
    expect([time for time, _ in boxes] == expected, f"{path}: boxes at {[time for time, _ in boxes]}")
    events = [(m.name, m.level, m.message) for _, m in messages["/events"]]
    check_events(path, events, recording, 1)
    return len(triangles)


def check_planned(path, found, recording):
    """Every route is published at its time and passes its waypoints."""
    times = [round(route["time_s"] * 1e9) for route in recording["routes"]]
    expect([time for time, _ in found] == times, f"{path}: routes at {[time for time, _ in found]}, not at {times}")
    for (_, points), route in zip(found, recording["routes"]):
        expect(all(waypoint in points for waypoint in route["points_m"]), f"{path}: a route lacks a waypoint")


def check_events(path, found, recording, unit):
    names = {member["number"]: member["name"] for member in recording["members"]}
    expected = [
        (event["kind"], unit * LEVELS.get(event["kind"], 2), f"{names[event['member']]}: {event['text']}")
        for event in recording["events"]
    ]
    expect(found == expected, f"{path}: events {found}, not {expected}")


def check_bag(path, messages, recording):
    members, epoch = recording["members"], messages["/tf"][0][0]
    for sample, (_, message) in enumerate(messages["/tf"]):
        found = [(t.child_frame_id, values(t.transform.translation), values(t.transform.rotation)) for t in message.transforms]
        check_frames(path, sample, found, recording)
    for member in members:
        name, states = member["name"], member["states"]
        odometry = messages[f"/{name}/odom"]
        expect(len(odometry) == len(states), f"{path}: {len(odometry)} odometries of {name}")
        for (_, message), state in zip(odometry, states):
            expect(message.child_frame_id == name, f"{path}: /{name}/odom is of {message.child_frame_id}")
            expect(values(message.pose.pose.position) == state["position_m"], f"{path}: /{name}/odom is elsewhere")
            # The team drives straight ahead.
            forward = math.hypot(*state["velocity_m_s"][:2])
            expect(np.allclose(values(message.twist.twist.linear), [forward, 0, 0], rtol=0, atol=1e-12), f"{path}: twist of {name}")
            expect(values(message.twist.twist.angular) == [0, 0, 0], f"{path}: {name} turns")
        driven = messages[f"/{name}/path"][0][1].poses
        expect([values(p.pose.position) for p in driven] == [s["position_m"] for s in states[::5]], f"{path}: path of {name}")
        stamps = [check_ros2.stamp_ns(pose.header.stamp) - epoch for pose in driven]
        expect(stamps == [round(s["time_s"] * 1e9) for s in states[::5]], f"{path}: times on the path of {name}")
    routes = messages["/team/route"]
    check_planned(path, [(t - epoch, [pose_values(p.pose)[:3] for p in m.poses]) for t, m in routes], recording)
    markers = {marker.ns: marker for marker in messages["/team/markers"][0][1].markers}
    drawn = {m["name"] for m in members} | {"moving_1", "start", "goal", "obstacles", "search_path", "vertices"}
    # Waypoints of routes that are planned on the way come and go.
    drawn |= {"waypoints"} if len(recording["routes"]) == 1 else set()
    expect(set(markers) == drawn, f"{path}: markers {sorted(markers)}")
    expect(all(markers[m["name"]].frame_locked for m in members), f"{path}: markers of members stand still")
    origin = messages["/tf_static"][0][1].transforms[0].transform.translation
    off = np.abs(lifted(markers["vertices"].points, origin) - np.array(recording["vertices_m"])).max()
    expect(off <= DRAWN_STEP_M, f"{path}: vertices are drawn {off} m off")
    expect(len(messages["/team/box"]) == len(changed(recording["boxes"])), f"{path}: {len(messages['/team/box'])} boxes")
    check_events(path, [(m.name, m.level, m.msg) for _, m in messages["/events"]], recording, 10)


def check_routes(path, recording):
    """PROJ knows the collection's reference system, GDAL accepts its geometry, and its numbers are the recorded ones."""
    collection = json.loads(path.read_text())
    epsg = pyproj.CRS.from_user_input(collection["crs"]["properties"]["name"]).to_epsg()
    expect(epsg == 32633, f"{path}: the system is EPSG:{epsg}")
    expect("WGS 84" in collection["note"], f"{path}: the note is missing")
    (feature,) = collection["features"]
    expect(rasterio.features.is_valid_geom(feature["geometry"]), f"{path}: the geometry is not valid")
    route = recording["routes"][0]["points_m"]
    expect(feature["geometry"]["coordinates"] == route, f"{path}: other coordinates than recorded")
    expect(feature["properties"] == {"route_id": "a-0001", "cost": 31.25}, f"{path}: properties {feature['properties']}")
    x, y, _ = np.array(route).T
    bounds = rasterio.features.bounds(feature["geometry"])
    expect(bounds == (x.min(), y.min(), x.max(), y.max()), f"{path}: bounds {bounds}")


def check(folder):
    recording = json.loads((folder / "recording.json").read_text())
    viewer, bag = folder / "viewer/run.mcap", folder / "ros2/run.mcap"
    messages, content = read_viewer(viewer)
    expect(content == (folder / "viewer.sha256").read_text(), f"{viewer}: not the stated content hash")
    triangles = check_viewer(viewer, messages, recording)
    theirs, content, definitions = check_ros2.read_mcap(bag)
    expect(content == (folder / "ros2.sha256").read_text(), f"{bag}: not the stated content hash")
    check_ros2.check_definitions(bag, definitions)
    own = [member["name"] for member in recording["members"]]
    topics = ROS2 | {f"/{name}/odom": "nav_msgs/msg/Odometry" for name in own} | {f"/{name}/path": "nav_msgs/msg/Path" for name in own}
    ours = check_ros2.read_bag(bag.parent, definitions, topics, LASTING | {f"/{name}/path" for name in own})
    check_ros2.check_same(bag, ours, theirs)
    check_bag(bag, ours, recording)
    check_routes(folder / "routes.geojson", recording)
    return {"triangles": triangles, "topics": [check_rerun.check_file(path) for path in (viewer, bag)]}


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} FOLDER")
    try:
        figures = check(Path(sys.argv[1]))
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(figures, sys.stdout, indent=1, sort_keys=True)
    print()
