"""Follows figures of a report to the rows of the release and to a recording.

    python check_report.py RELEASE REPORT    the queries that the report states run in duckdb and give its numbers; so do its
                                             medians and quartiles; a mission of the last figure ends in its recording as in its row
"""

import json
import os
import sys
from pathlib import Path

import duckdb
from mcap.reader import make_reader

from common import expect, run

QUARTILES = """
    select "group", count(*), quantile_cont({column}, [0.25, 0.5, 0.75])
    from 'tables/missions/*.parquet' where variant is null and outcome = 'success' group by "group"
"""
COLUMNS = {
    "RMS vertical acceleration": "rms_vertical_acceleration_m_s2",
    "RMS pitch rate": "rms_pitch_rate_deg_s",
    "RMS roll rate": "rms_roll_rate_deg_s",
    "time to the goal": "time_s",
}


def near(a, b):
    return abs(a - b) <= 1e-12 * max(abs(a), abs(b))


def alike(ours, theirs):
    return len(ours) == len(theirs) and all(
        near(a, b) if isinstance(a, float) and isinstance(b, float) else a == b for a, b in zip(ours, theirs)
    )


def same_rows(name, ours, theirs):
    """Rows whose first column is the group; the report names missions without a group by the kind of their terrain."""
    unnamed = {row[0] for row in ours} - {row[0] for row in theirs}
    theirs = [(next(iter(unnamed), None) if row[0] is None else row[0], *row[1:]) for row in theirs]
    expect(len(ours) == len(theirs), f"{name}: {len(ours)} rows in the report, {len(theirs)} in duckdb")
    for a, b in zip(sorted(ours), sorted(theirs)):
        expect(alike(a, b), f"{name}: {a} in the report, {b} in duckdb")


def outcomes(document, rows):
    """One row for each group and outcome that occurs."""
    kinds = [column["name"].replace(" ", "_") for column in document["columns"][2:]]
    ours = [(row[0], kind, n) for row in document["rows"] for kind, n in zip(kinds, row[2:]) if n]
    same_rows("outcomes", ours, rows)


def quartiles(document):
    for figure, column in COLUMNS.items():
        theirs = duckdb.sql(QUARTILES.format(column=column)).fetchall()
        theirs = [(group, count, *[float(v) for v in values]) for group, count, values in theirs]
        ours = [(row[2], row[3], *[float(v) for v in row[5:8]]) for row in document["rows"] if row[0] == figure]
        same_rows(f"mission-medians, {figure}", ours, theirs)


def recording():
    """A mission's row and its recording say the same."""
    [(path, outcome, time_s)] = duckdb.sql(
        "select path, outcome, time_s from 'tables/missions/*.parquet' where outcome = 'success' order by path limit 1"
    ).fetchall()
    with open(path, "rb") as stream:
        records = {record.name: record.metadata for record in make_reader(stream, validate_crcs=True).iter_metadata()}
    found = records["outcome"]
    expect(found["outcome"] == outcome and float(found["time_s"]) == time_s, f"{path}: {found}, the row {outcome}, {time_s}")


def check(release):
    report = Path(sys.argv[2]).resolve()
    os.chdir(release)
    queries = 0
    for path in sorted((report / "data").glob("*.json")):
        document = json.loads(path.read_text())
        if not document["query"].startswith("select "):
            continue
        queries += 1
        rows = duckdb.sql(document["query"]).fetchall()
        if path.stem == "outcomes":
            outcomes(document, rows)
        else:
            same_rows(path.stem, [tuple(row) for row in document["rows"]], rows)
    expect(queries >= 5, f"{queries} queries in the report")
    quartiles(json.loads((report / "data" / "mission-medians.json").read_text()))
    recording()
    return {"queries": queries}


if __name__ == "__main__":
    run(check, lambda paths: sys.exit(f"{paths[0]} is no release"))
