"""Reads every MCAP with the Python reader: checksums validated, every message decoded from its own schema.

    python check_mcap.py RELEASE    also against tables `missions` and `samples` and the manifest
    python check_mcap.py FILE...    figures of single files
"""

import math
from pathlib import Path

import pyarrow.parquet as pq
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from common import ContentHash, expect, manifest, run

TOPICS = {
    "/terrain/mesh", "/terrain/grid", "/vehicle/shape", "/vehicle/path", "/tf", "/vehicle/pose", "/vehicle/state",
    "/imu", "/wheels", "/command", "/events",
}


def check_finite(path, topic, message):
    """No field of a message may be NaN or infinite."""
    for field, value in message.ListFields():
        if field.type == field.TYPE_MESSAGE:
            for part in value if hasattr(value, "append") or hasattr(value, "add") else [value]:
                check_finite(path, topic, part)
        elif field.cpp_type in (field.CPPTYPE_DOUBLE, field.CPPTYPE_FLOAT):
            values = value if hasattr(value, "append") else [value]
            expect(all(map(math.isfinite, values)), f"{path}: {topic} holds {field.name} = {value}")


def check_mesh(path, scene):
    """Every index of the terrain's triangles must name a point, and colours must match points."""
    triangles = 0
    for patch in scene.entities[0].triangles:
        expect(max(patch.indices) < len(patch.points), f"{path}: the mesh names a point that is not there")
        expect(len(patch.colors) in (0, len(patch.points)), f"{path}: the mesh has another number of colours than points")
        triangles += len(patch.indices) // 3
    expect(triangles > 0, f"{path}: the mesh is empty")
    return triangles


def seconds(log_time, epoch):
    return (log_time - epoch) / 1e9


def figures(path):
    path = Path(path)
    content = ContentHash("messages")
    counts, states, events, epoch, last, triangles = {}, [], [], None, -1, 0
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
            check_finite(path, topic, decoded)
            if topic == "/vehicle/state":
                states.append((seconds(time, epoch), decoded.x_m, decoded.y_m, decoded.z_m))
                stamp = decoded.timestamp
                expect(stamp.seconds * 10**9 + stamp.nanos == time, f"{path}: a timestamp differs from its log_time")
            if topic == "/terrain/mesh":
                triangles = check_mesh(path, decoded)
            if topic == "/events":
                events.append((decoded.name, seconds(time, epoch)))
        statistics = reader.get_summary().statistics
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
    total = sum(counts.values())
    expect(statistics.message_count == total, f"{path}: {total} messages, but the summary says {statistics.message_count}")
    expect(set(counts) <= TOPICS, f"{path}: unknown topics {set(counts) - TOPICS}")
    length = sum(math.hypot(b[1] - a[1], b[2] - a[2]) for a, b in zip(states, states[1:]))
    return {
        "messages": total,
        "counts": counts,
        "epoch_ns": epoch,
        "duration_s": states[-1][0] if states else None,
        "path_length_m": length,
        "states": states,
        "outcome": events[-1][0] if events else None,
        "triangles": triangles,
        "metadata": metadata,
        "messages_sha256": content.hex(),
        "bytes": path.stat().st_size,
    }


def check_against_tables(path, found, mission, samples):
    states = found["states"]
    expect(len(states) == mission["samples"], f"{path}: {len(states)} states, table missions says {mission['samples']}")
    expect(found["outcome"] == mission["outcome"], f"{path}: {found['outcome']}, table missions says {mission['outcome']}")
    difference = abs(found["path_length_m"] - mission["path_length_m"])
    expect(difference <= 1e-9 * (1 + mission["path_length_m"]), f"{path}: the path is {difference} m longer in the table")
    rows = [(s["time_s"], s["x_m"], s["y_m"], s["z_m"]) for s in samples]
    expect(len(rows) == len(states), f"{path}: {len(states)} states, table samples has {len(rows)}")
    for state, row in zip(states, rows):
        expect(abs(state[0] - row[0]) <= 1e-9, f"{path}: a state at {state[0]} s, table samples says {row[0]} s")
        expect(state[1:] == row[1:], f"{path}: the position at {row[0]} s is {state[1:]}, table samples says {row[1:]}")


def table(release, name):
    files = sorted((release / "tables" / name).glob("*.parquet"))
    return [row for file in files for row in pq.read_table(file).to_pylist()]


def check_release(release):
    missions = {row["path"]: row for row in table(release, "missions")}
    samples = {}
    for row in table(release, "samples"):
        samples.setdefault((row["terrain_id"], row["mission_id"]), []).append(row)
    report = {}
    for artifact in manifest(release)["artifacts"]:
        path = artifact["path"]
        if not path.endswith(".mcap"):
            continue
        found = figures(release / path)
        expect(found["messages"] == artifact["records"], f"{path}: the manifest says {artifact['records']} messages")
        expect(found["messages_sha256"] == artifact["content_sha256"], f"{path}: not the manifest's content hash")
        expect(path in missions, f"{path} is not in table missions")
        mission = missions.pop(path)
        check_against_tables(path, found, mission, samples[mission["terrain_id"], mission["mission_id"]])
        report[path] = {key: value for key, value in found.items() if key != "states"}
    missing = sorted(path for path in missions if path)
    expect(not missing, f"table missions names files that are not there: {missing[:3]}")
    expect(report, f"{release} holds no MCAP")
    return report


def check_files(paths):
    return {Path(path).name: {k: v for k, v in figures(path).items() if k != "states"} for path in paths}


if __name__ == "__main__":
    run(check_release, check_files)
