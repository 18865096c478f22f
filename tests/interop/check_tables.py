"""Reads every Parquet table with pyarrow and duckdb.

    python check_tables.py RELEASE    rows, columns, units, keys and content hashes against the manifest
    python check_tables.py FILE...    figures of single files
"""

import struct
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq

from common import ContentHash, expect, manifest, run

TYPES = {"string": "text", "double": "f64", "int64": "i64", "bool": "bool"}


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


def check_sums(path, table):
    """duckdb and pyarrow must see the same numbers of rows and values, and the same sums of integers and extremes."""
    connection = duckdb.connect()
    source = f"read_parquet('{path}')"
    count = connection.execute(f"select count(*) from {source}").fetchone()[0]
    expect(count == table.num_rows, f"{path}: duckdb sees {count} rows, pyarrow {table.num_rows}")
    for field in table.schema:
        found = connection.execute(f'select count("{field.name}"), min("{field.name}"), max("{field.name}") from {source}')
        column = table.column(field.name)
        values = [v for v in column.to_pylist() if v is not None]
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
    expect(file.metadata.created_by.startswith("sastrugi/"), f"{path} was created by {file.metadata.created_by}")
    columns = {}
    for field in table.schema:
        expect(str(field.type) in TYPES, f"{path}: column {field.name} is {field.type}")
        expect(field.metadata and b"unit" in field.metadata, f"{path}: column {field.name} has no unit")
        expect(field.metadata.get(b"description"), f"{path}: column {field.name} has no description")
        columns[field.name] = {"type": TYPES[str(field.type)], "unit": field.metadata[b"unit"].decode()}
    floats = [f.name for f in table.schema if pa.types.is_floating(f.type)]
    nans = [f for f in floats if any(v != v for v in table.column(f).to_pylist() if v is not None)]
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
        expect(found["rows"] == artifact["records"], f"{path} has {found['rows']} rows, the manifest says {artifact['records']}")
        expect(found["rows_sha256"] == artifact["content_sha256"], f"{path}: rows do not have the manifest's content hash")
    expect(report, f"{release} holds no table")
    for table in {figures["table"] for figures in report.values()}:
        check_parts(release, table, report)
    return report


def check_parts(release, table, report):
    """All parts of a table read as one in duckdb."""
    parts = f"{release}/tables/{table}/*.parquet"
    rows = duckdb.connect().execute(f"select count(*) from read_parquet('{parts}')").fetchone()[0]
    expected = sum(figures["rows"] for figures in report.values() if figures["table"] == table)
    expect(rows == expected, f"table {table}: duckdb sees {rows} rows in all parts, not {expected}")


def check_files(paths):
    return {Path(path).name: figures(path) for path in paths}


if __name__ == "__main__":
    run(check_release, check_files)
