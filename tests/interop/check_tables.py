"""Reads every Parquet table with pyarrow and duckdb.

    python check_tables.py RELEASE    rows, columns, units, keys and content hashes agree with the manifest; the lists of table
                                      `samples` agree with the recordings and the vehicle's weight
    python check_tables.py FILE...    statistics of single files
"""

import math
import struct
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from common import ContentHash, expect, manifest, run

TYPES = {
    "string": "text",
    "double": "f64",
    "int64": "i64",
    "bool": "bool",
    "list<element: float>": "f32_list",
    "list<element: double>": "f64_list",
}
# Columns of table `samples`, and the fields of /wheels and /command that correspond to them.
SAME = {
    "chassis_force_n", "wheel_normal_force_n", "wheel_longitudinal_force_n", "wheel_lateral_force_n", "wheel_slip_ratio",
    "wheel_spin_rad_s", "wheel_torque_n_m", "cross_track_m", "distance_to_goal_m",
}
CONTACTS = ["wheel_contact_x_m", "wheel_contact_y_m", "wheel_contact_z_m"]
ANGLES = {"wheel_steering_deg": "steering_rad", "heading_error_deg": "heading_error_rad"}
# Half a step of 1/32 deg in the table and of 1/1024 rad in the recording.
ANGLE_TOLERANCE_DEG = 0.5 / 32 + math.degrees(0.5 / 1024) + 1e-6
# At every n-th sample, a row is compared with the recording.
ROW_STEP = 20
HUSKY_WEIGHT_N = 56.58 * 9.80665
# A vehicle that stands this upright is carried by the normal forces of its wheels.
UPRIGHT_DEG = 2.0


def encode(value):
    if value is None:
        return b"\0"
    if isinstance(value, bool):
        return bytes([4, value])
    if isinstance(value, str):
        data = value.encode()
        return b"\1" + struct.pack("<Q", len(data)) + data
    if isinstance(value, float):
        return b"\2" + struct.pack("<d", value)
    if isinstance(value, list):
        return b"\5" + struct.pack("<Q", len(value)) + b"".join(map(encode, value))
    return b"\3" + struct.pack("<q", value)


def rows_sha256(name, table):
    content = ContentHash("table")
    content.text(name)
    content.u64(table.num_columns)
    for column in table.column_names:
        content.text(column)
    columns = [column.to_pylist() for column in table.columns]
    for row in zip(*columns):
        content.raw(b"".join(map(encode, row)))
    return content.hex()


def check_keys(path, table, keys):
    rows = list(zip(*(table.column(key).to_pylist() for key in keys)))
    expect(all(a < b for a, b in zip(rows, rows[1:])), f"{path} is not sorted by its keys, or a key comes twice")


def flat(column):
    """The values of a column, those of lists one after the other, without nulls."""
    values = column.to_pylist()
    if pa.types.is_list(column.type):
        values = [element for value in values for element in value]
    return [value for value in values if value is not None]


def check_sums(path, table):
    """duckdb and pyarrow must find the same numbers of rows and values, and the same extremes."""
    connection = duckdb.connect()
    source = f"read_parquet('{path}')"
    count = connection.execute(f"select count(*) from {source}").fetchone()[0]
    expect(count == table.num_rows, f"{path}: duckdb sees {count} rows, pyarrow {table.num_rows}")
    for field in table.schema:
        column = f'unnest("{field.name}")' if pa.types.is_list(field.type) else f'"{field.name}"'
        found = connection.execute(f"select count(v), min(v), max(v) from (select {column} as v from {source})")
        values = flat(table.column(field.name))
        expected = (len(values), min(values, default=None), max(values, default=None))
        expect(found.fetchone() == expected, f"{path}: duckdb and pyarrow differ on column {field.name}")


def figures(path):
    path = Path(path)
    file = pq.ParquetFile(path)
    table = file.read()
    metadata = {k.decode(): v.decode() for k, v in (file.metadata.metadata or {}).items() if k.startswith(b"sastrugi.")}
    name = metadata.get("sastrugi.table")
    for key in ["table", "study_sha256", "seed", "version", "license"]:
        expect(f"sastrugi.{key}" in metadata, f"{path} lacks the metadata sastrugi.{key}")
    stated = {k.decode(): v.decode() for k, v in (file.schema_arrow.metadata or {}).items()}
    expect(metadata.items() <= stated.items(), f"{path}: its Arrow schema does not state {metadata}")
    expect(file.metadata.created_by.startswith("sastrugi/"), f"{path} was created by {file.metadata.created_by}")
    columns = {}
    for field in table.schema:
        expect(str(field.type) in TYPES, f"{path}: column {field.name} is {field.type}")
        expect(field.metadata and b"unit" in field.metadata, f"{path}: column {field.name} has no unit")
        expect(field.metadata.get(b"description"), f"{path}: column {field.name} has no description")
        columns[field.name] = {"type": TYPES[str(field.type)], "unit": field.metadata[b"unit"].decode()}
    nans = [f.name for f in table.schema if any(v != v for v in flat(table.column(f.name)))]
    expect(not nans, f"{path}: columns {nans} hold NaN instead of null")
    keys = [f.name for f in table.schema if not f.nullable]
    check_keys(path, table, keys)
    check_sums(path, table)
    return {"table": name, "rows": table.num_rows, "keys": keys, "columns": columns, "rows_sha256": rows_sha256(name, table)}


def check_release(release):
    report = {}
    for artifact in manifest(release)["artifacts"]:
        path = artifact["path"]
        if not path.endswith(".parquet"):
            continue
        found = report[path] = figures(release / path)
        expect(path.split("/")[1] == found["table"], f"{path} holds table {found['table']}")
        expect(found["rows"] == artifact["records"], f"{path} has {found['rows']} rows, {artifact['records']} in the manifest")
        expect(found["rows_sha256"] == artifact["content_sha256"], f"{path}: rows do not have the manifest's content hash")
    expect(report, f"{release} has no tables")
    for table in {figures["table"] for figures in report.values()}:
        check_parts(release, table, report)
    check_samples(release)
    return report


def check_parts(release, table, report):
    """All parts of a table read as one in duckdb."""
    parts = f"{release}/tables/{table}/*.parquet"
    rows = duckdb.connect().execute(f"select count(*) from read_parquet('{parts}')").fetchone()[0]
    expected = sum(figures["rows"] for figures in report.values() if figures["table"] == table)
    expect(rows == expected, f"table {table}: duckdb sees {rows} rows in all parts, not {expected}")


def check_samples(release):
    """Compares rows of the first mission of every terrain with its recording, and of all missions at rest with the weight."""
    files = sorted((release / "tables" / "missions").glob("*.parquet"))
    missions = {(m["terrain_id"], m["mission_id"]): m for file in files for m in pq.read_table(file).to_pylist()}
    compared = set()
    for file in sorted((release / "tables" / "samples").glob("*.parquet")):
        samples = {}
        for row in pq.read_table(file).to_pylist():
            samples.setdefault((row["terrain_id"], row["mission_id"]), []).append(row)
        for key, rows in samples.items():
            mission = missions[key]
            labels = {(row["outcome"], row["split"]) for row in rows}
            expect(labels == {(mission["outcome"], mission["split"])}, f"{file}: {key} has {labels}, table missions {mission}")
            check_weight(file, mission, rows[0])
            if mission["path"] and key[0] not in compared:
                compared.add(key[0])
                check_recording(release / mission["path"], rows)


def check_weight(file, mission, row):
    """At rest and upright, the normal forces carry the vehicle."""
    upright = max(abs(row["roll_deg"]), abs(row["pitch_deg"])) < UPRIGHT_DEG
    if mission["vehicle"] == "husky_a200" and upright and row["chassis_force_n"] == 0:
        force = sum(row["wheel_normal_force_n"])
        expect(
            abs(force / HUSKY_WEIGHT_N - 1) < 0.01,
            f"{file}: the normal forces of {row['mission_id']} at rest sum to {force} N, the weight is {HUSKY_WEIGHT_N} N",
        )


def check_recording(path, rows):
    """Every n-th row equals the messages at its time."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = {"/wheels": [], "/command": []}
        for _, channel, _, message in reader.iter_decoded_messages(topics=list(topics)):
            topics[channel.topic].append(message)
    for topic, messages in topics.items():
        expect(len(messages) == len(rows), f"{path}: {len(messages)} messages {topic}, table samples has {len(rows)} rows")
    for row, wheels, command in list(zip(rows, *topics.values()))[::ROW_STEP]:
        check_row(path, row, wheels, command)


def check_row(path, row, wheels, command):
    def recorded(name):
        name = name.removeprefix("wheel_")
        value = getattr(wheels, name) if hasattr(wheels, name) else getattr(command, name)
        return list(value) if hasattr(value, "append") else value

    def same(name, equal):
        expect(equal, f"{path}: sample {row['sample']} has {name} {row[name]}, the recording {recorded(name)}")

    for name in SAME:
        same(name, row[name] == recorded(name))
    for name in CONTACTS:
        points = [0 if force == 0 and value is None else value for value, force in zip(row[name], row["wheel_normal_force_n"])]
        same(name, points == recorded(name))
    for name, field in ANGLES.items():
        here, there = (v if isinstance(v, list) else [v] for v in (row[name], recorded(field)))
        close = [abs(a - math.degrees(b)) <= ANGLE_TOLERANCE_DEG for a, b in zip(here, there, strict=True)]
        expect(all(close), f"{path}: sample {row['sample']} has {name} {here}, the recording {field} {there}")


def check_files(paths):
    return {Path(path).name: figures(path) for path in paths}


if __name__ == "__main__":
    run(check_release, check_files)
