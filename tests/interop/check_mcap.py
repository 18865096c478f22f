"""Reads every MCAP with the Python reader: checksums validated, every message decoded from its own schema.

    python check_mcap.py RELEASE    also compares with tables `missions` and `samples`, the manifest, and the terrain: the mesh
                                    must be the ground under the wheels
    python check_mcap.py FILE...    statistics of single files
"""

import functools
import math
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from common import ContentHash, expect, manifest, read_raster, run, table

TOPICS = {
    "/terrain/mesh", "/terrain/grid", "/vehicle/shape", "/vehicle/path", "/tf", "/vehicle/pose", "/vehicle/state",
    "/imu", "/wheels", "/command", "/events",
}
# At every n-th sample, the ground under the wheels must lie on the mesh.
CONTACT_STEP = 20
GROUND_TOLERANCE_M = 0.01


def check_finite(path, topic, message):
    """No field of a message may be NaN or infinite."""
    for field, value in message.ListFields():
        if field.type == field.TYPE_MESSAGE:
            for part in value if hasattr(value, "append") or hasattr(value, "add") else [value]:
                check_finite(path, topic, part)
        elif field.cpp_type in (field.CPPTYPE_DOUBLE, field.CPPTYPE_FLOAT):
            values = value if hasattr(value, "append") else [value]
            expect(all(map(math.isfinite, values)), f"{path}: {topic} holds {field.name} = {value}")


def mesh_triangles(path, scene):
    """The terrain's triangles as an array (triangle, corner, axis) in the map frame."""
    triangles = []
    for patch in scene.entities[0].triangles:
        points = np.array([(p.x, p.y, p.z) for p in patch.points])
        expect(np.isfinite(points).all(), f"{path}: the mesh has a point at infinity")
        expect(max(patch.indices) < len(points), f"{path}: the mesh names a point that is not there")
        expect(len(patch.colors) in (0, len(points)), f"{path}: the mesh has another number of colours than points")
        origin = patch.pose.position
        triangles.append((points + [origin.x, origin.y, origin.z])[np.array(patch.indices).reshape(-1, 3)])
    expect(triangles, f"{path}: the mesh is empty")
    return np.concatenate(triangles)


def off_mesh(triangles, contacts):
    """Largest vertical distance of the points from the triangles, and the number of points off all triangles."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    worst, lost = 0.0, 0
    with np.errstate(divide="ignore", invalid="ignore"):
        for point in contacts:
            w = point - a
            s, t = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / area, (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / area
            inside = np.flatnonzero((s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9))
            if inside.size == 0:
                lost += 1
                continue
            k = inside[0]
            worst = max(worst, abs(w[k, 2] - s[k] * u[k, 2] - t[k] * v[k, 2]))
    return worst, lost


def contact_points(decoded):
    points = zip(decoded.contact_x_m, decoded.contact_y_m, decoded.contact_z_m, decoded.normal_force_n)
    return [np.array(point[:3]) for point in points if point[3] != 0]


def seconds(log_time, epoch):
    return (log_time - epoch) / 1e9


def figures(path):
    path = Path(path)
    content = ContentHash("messages")
    counts, states, events, contacts, epoch, last, mesh = {}, [], [], [], None, -1, None
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        expect(header.library.startswith("sastrugi/"), f"{path} was written by {header.library}")
        expect(header.profile == "", f"{path} has the profile {header.profile}")
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            topic, time = channel.topic, message.log_time
            expect(time >= last, f"{path}: {topic} at {time} comes after {last}")
            last, epoch = time, time if epoch is None else epoch
            content.text(topic)
            content.u64(time)
            content.bytes(message.data)
            counts[topic] = counts.get(topic, 0) + 1
            if topic == "/terrain/mesh":
                mesh = mesh_triangles(path, decoded)
                continue
            check_finite(path, topic, decoded)
            if topic == "/vehicle/state":
                states.append((seconds(time, epoch), decoded.x_m, decoded.y_m, decoded.z_m))
                stamp = decoded.timestamp
                expect(stamp.seconds * 10**9 + stamp.nanos == time, f"{path}: a timestamp differs from its log_time")
            if topic == "/wheels" and counts[topic] % CONTACT_STEP == 1:
                contacts += contact_points(decoded)
            if topic == "/events":
                events.append((decoded.name, seconds(time, epoch)))
        statistics = reader.get_summary().statistics
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
    total = sum(counts.values())
    expect(statistics.message_count == total, f"{path}: {total} messages, but {statistics.message_count} in the summary")
    expect(set(counts) <= TOPICS, f"{path}: unknown topics {set(counts) - TOPICS}")
    # The vehicle stands on its wheels at its start.
    expect(contacts, f"{path}: no wheel touches the ground")
    distance, lost = off_mesh(mesh, contacts)
    expect(lost == 0, f"{path}: {lost} of {len(contacts)} wheel contacts lie off the mesh")
    length = sum(math.hypot(b[1] - a[1], b[2] - a[2]) for a, b in zip(states, states[1:]))
    return {
        "messages": total,
        "counts": counts,
        "epoch_ns": epoch,
        "duration_s": states[-1][0] if states else None,
        "path_length_m": length,
        "states": states,
        "outcome": events[-1][0] if events else None,
        "triangles": len(mesh),
        "contact_off_mesh_m": distance,
        "mesh": mesh,
        "contacts": contacts,
        "metadata": metadata,
        "messages_sha256": content.hex(),
        "bytes": path.stat().st_size,
    }


def check_against_tables(path, found, mission, samples):
    states = found["states"]
    expect(len(states) == mission["samples"], f"{path}: {len(states)} states, {mission['samples']} in table missions")
    expect(found["outcome"] == mission["outcome"], f"{path}: {found['outcome']}, {mission['outcome']} in table missions")
    difference = abs(found["path_length_m"] - mission["path_length_m"])
    expect(difference <= 1e-9 * (1 + mission["path_length_m"]), f"{path}: the path is {difference} m longer in the table")
    rows = [(s["time_s"], s["x_m"], s["y_m"], s["z_m"]) for s in samples]
    expect(len(rows) == len(states), f"{path}: {len(states)} states, table samples has {len(rows)}")
    for state, row in zip(states, rows):
        expect(abs(state[0] - row[0]) <= 1e-9, f"{path}: a state at {state[0]} s, {row[0]} s in table samples")
        expect(state[1:] == row[1:], f"{path}: the position at {row[0]} s is {state[1:]}, {row[1:]} in table samples")


def ground(raster, contacts):
    """The contact points moved vertically to the bilinear surface between the raster's cell centres."""
    heights, t = raster
    moved = []
    for x, y, _ in contacts:
        u, v = (x - t.c) / t.a - 0.5, (y - t.f) / t.e - 0.5
        col, row = int(u), int(v)
        (nw, ne), (sw, se) = heights[row : row + 2, col : col + 2]
        fx, fy = u - col, v - row
        moved.append((x, y, (nw * (1 - fx) + ne * fx) * (1 - fy) + (sw * (1 - fx) + se * fx) * fy))
    return moved


def check_ground(path, found, raster):
    distance, _ = off_mesh(found["mesh"], ground(raster, found["contacts"]))
    expect(distance <= GROUND_TOLERANCE_M, f"{path}: the mesh is {distance} m off the terrain under a wheel")
    found["mesh_off_terrain_m"] = distance


def public(found):
    return {key: value for key, value in found.items() if key not in ("states", "mesh", "contacts")}


def check_release(release):
    missions = {row["path"]: row for row in table(release, "missions")}
    samples = {}
    for row in table(release, "samples"):
        samples.setdefault((row["terrain_id"], row["mission_id"]), []).append(row)
    terrains = {row["terrain_id"]: release / row["path"] for row in table(release, "terrains")}
    raster = functools.lru_cache(maxsize=4)(read_raster)
    report = {}
    for artifact in manifest(release)["artifacts"]:
        path = artifact["path"]
        if not path.endswith(".mcap"):
            continue
        found = figures(release / path)
        records, content = artifact.get("records"), artifact.get("content_sha256")
        expect(records in (None, found["messages"]), f"{path}: {found['messages']} messages, {records} in the manifest")
        expect(content in (None, found["messages_sha256"]), f"{path}: messages do not have the manifest's content hash")
        expect(path in missions, f"{path} is not in table missions")
        mission = missions.pop(path)
        check_against_tables(path, found, mission, samples[mission["terrain_id"], mission["mission_id"]])
        check_ground(path, found, raster(terrains[mission["terrain_id"]]))
        report[path] = public(found)
    missing = sorted(path for path in missions if path)
    expect(not missing, f"table missions names files that are not there: {missing[:3]}")
    expect(report, f"{release} has no MCAP")
    return report


def check_files(paths):
    return {Path(path).name: public(figures(path)) for path in paths}


if __name__ == "__main__":
    run(check_release, check_files)
