"""Traces numbers of a report to the rows of the release and to a recording.

    python check_report.py RELEASE REPORT    every query of the report runs in duckdb and returns its numbers, or the rows from which they
                                             are computed: medians, quartiles, shifts and deltas are recomputed from these rows; files
                                             that the report names exist; a mission has the same outcome in its recording and its row.
                                             Rovers (one stage for each navigator): efficiencies, arrival, intraclass correlations and
                                             distance budgets of each group are recomputed from their rows in the obvious way
"""

import json
import math
import os
import sys
from pathlib import Path
from statistics import fmean as mean, median

import duckdb
from mcap.reader import make_reader

from common import expect, run

QUARTILES = """
    select "group", count(*), quantile_cont({column}, [0.25, 0.5, 0.75]) from ({query}) where outcome = 'success' group by "group"
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
    """Rows in any order."""
    expect(len(ours) == len(theirs), f"{name}: {len(ours)} rows in the report, {len(theirs)} in duckdb")
    order = lambda row: [(value is None, str(type(value)), 0 if value is None else value) for value in row]
    for a, b in zip(sorted(ours, key=order), sorted(theirs, key=order)):
        expect(alike(a, b), f"{name}: {a} in the report, {b} in duckdb")


def plain(value):
    """NaN and infinities are null in the report; numbers have one type."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def runs(path, document):
    """A query runs and returns the rows of the report, or the rows from which they are computed."""
    rows = [tuple(map(plain, row)) for row in duckdb.sql(document["query"]).fetchall()]
    ours = [tuple(map(plain, row)) for row in document["rows"]]
    expect(rows or not ours, f"{path.stem}: no rows from {document['query']}")
    if "random_sample_of" in document:
        return
    if document["query_gives"] == "rows":
        outcomes(document, rows) if path.stem in ["outcomes", "summary-outcomes"] else same_rows(path.stem, ours, rows)


def compared(document):
    """Shift and delta of two groups from the rows of the query, in the obvious way."""
    names = [column[0] for column in duckdb.sql(document["query"]).description]
    missions = [dict(zip(names, row)) for row in duckdb.sql(document["query"]).fetchall()]
    known = [row for row in document["rows"] if row[4] is not None]
    expect(known, "no pair of groups is compared")
    for row in known:
        figure, groups, of, shift, delta = row[0], row[2].split(" to "), row[3], row[4], row[7]
        first, second = (of_group(missions, figure, group, "block" in of) for group in groups)
        if "block" in of:
            first, second = in_both(first, second)
            d = [mean(b) - mean(a) for a, b in zip(first, second)]
            d = [0.0 if abs(v) < 1e-9 * max(map(abs, d)) else v for v in d]
            walsh = sorted((d[i] + d[j]) / 2 for i in range(len(d)) for j in range(i, len(d)))
            found = (median(walsh), mean(list(map(sign, d))))
            if k := signed_ranks_below(len(d)):
                expect(all(abs(a - b) < 1e-6 for a, b in zip(row[5:7], (walsh[k - 1], walsh[-k]))), f"interval, {row}")
        else:
            a, b = ([mean(list(missions.values())) for missions in of.values()] for of in (first, second))
            pairs = [y - x for x in a for y in b]
            scale = max(map(abs, a + b))
            found = (median(pairs), mean([sign(v) if abs(v) > 1e-9 * scale else 0 for v in pairs]))
        size = max(abs(shift), 1e-3)
        expect(abs(found[0] - shift) < 1e-6 * size and abs(found[1] - delta) < 1e-6, f"comparison, {row}: {found}")


def signed_ranks_below(n, tail=0.025):
    """The largest k with P(W < k) at most the tail, by counting the subsets of the ranks 1 to n with each sum."""
    ways = [1] + [0] * (n * (n + 1) // 2)
    for rank in range(1, n + 1):
        ways = [w + (ways[s - rank] if s >= rank else 0) for s, w in enumerate(ways)]
    total, k = 0, 0
    while total + ways[k] <= tail * 2**n:
        total, k = total + ways[k], k + 1
    return k


def of_group(missions, figure, group, blocks):
    """Values by pair in every terrain, or in every block of paired terrains."""
    column = COLUMNS.get(figure)
    clusters = {}
    for m in missions:
        if m["group"] != group or (column and m["outcome"] != "success"):
            continue
        value = m[column] if column else 100.0 * (m["outcome"] == "success")
        if value is not None:
            cluster = m["pair_id"].rpartition("-")[0] if blocks else m["terrain_id"]
            clusters.setdefault(cluster, {})[m["pair_id"]] = value
    return clusters


def in_both(first, second):
    """Missions of the pairs that both groups have, block by block."""
    pairs = [(block, sorted(first[block].keys() & second[block].keys())) for block in sorted(first.keys() & second.keys())]
    pairs = [(block, ids) for block, ids in pairs if ids]
    return ([[of[block][pair] for pair in ids] for block, ids in pairs] for of in (first, second))


def sign(value):
    return (value > 0) - (value < 0)


def outcomes(document, rows):
    """One row for each group and outcome that occurs."""
    kinds = [column["name"].replace(" ", "_") for column in document["columns"][2:]]
    ours = [(row[0], kind, n) for row in document["rows"] for kind, n in zip(kinds, row[2:]) if n]
    same_rows("outcomes", ours, rows)


def quartiles(document):
    for figure, column in COLUMNS.items():
        theirs = duckdb.sql(QUARTILES.format(column=column, query=document["query"])).fetchall()
        theirs = [(group, count, *[float(v) for v in values]) for group, count, values in theirs]
        ours = [(row[2], row[3], *[float(v) for v in row[5:8]]) for row in document["rows"] if row[0] == figure]
        same_rows(f"mission-medians, {figure}", ours, theirs)


def rovers(report):
    """Tables on rovers, from the rows that their queries return."""
    document = lambda name: json.loads((report / "data" / f"{name}.json").read_text())
    efficiency = document("rover-efficiency")
    names = [column[0] for column in duckdb.sql(efficiency["query"]).description]
    rows = [dict(zip(names, row)) for row in duckdb.sql(efficiency["query"]).fetchall()]
    plain = [row for row in rows if row["variant"] is None]
    several = len({row["stage_id"] for row in plain}) > 1
    word = lambda row: f", {row['navigator'].replace('_', '-').capitalize()}" if several else ""
    groups = {}
    for row in plain:
        groups.setdefault(row["group"] + word(row), []).append(row)
    expect(len(groups) == len(efficiency["rows"]), f"{len(efficiency['rows'])} sets of rovers, {len(groups)} groups")
    close = lambda a, b: a is None and b is None or abs(a - b) <= 1e-9 * max(1.0, abs(b))
    for row in efficiency["rows"]:
        own = groups[row[0]]
        worlds = {r["terrain_id"] for r in own}
        arrivals = [r["efficiency"] for r in own if r["outcome"] == "reached"]
        shown = lambda r, column: 0.0 if r["outcome"] == "off_ground" else r[column]
        ways = [r for r in own if r["oracle"] == "found"]
        over = mean(shown(r, "efficiency") * r["oracle_m"] / r["straight_m"] for r in ways) if ways else None
        found = [len(worlds), len(own), 100.0 * len(arrivals) / len(own), mean(arrivals) if arrivals else None]
        found += [mean(shown(r, "efficiency") for r in own), sum(r["straight_m"] for r in own) / sum(r["distance_m"] for r in own)]
        found += [mean(shown(r, "efficiency_half_limit") for r in own), over]
        ours = [row[k] for k in (1, 2, 3, 6, 7, 10, 13, 14)]
        expect(all(close(a, b) for a, b in zip(ours, found)), f"rover-efficiency, {row}: {found}")
        expect(row[4] is None or row[4] <= row[3] <= row[5] and row[8] <= row[7] <= row[9], f"intervals, {row}")
    for row in document("rover-intraclass")["rows"]:
        value = (lambda r: r["efficiency"]) if row[1] == "efficiency" else (lambda r: float(r["outcome"] == "reached"))
        expect(close(row[4], intraclass(groups[row[0]], value)), f"rover-intraclass, {row}: {intraclass(groups[row[0]], value)}")
    for row in document("rover-budgets")["rows"]:
        expect(close(row[2], budget(groups[row[0]], row[1] / 100.0)), f"rover-budgets, {row}: {budget(groups[row[0]], row[1] / 100.0)}")
    return len(groups)


def intraclass(rows, value):
    """One-way analysis of variance of worlds."""
    worlds = {}
    for row in rows:
        worlds.setdefault(row["terrain_id"], []).append(value(row))
    worlds, n, k = list(worlds.values()), len(rows), len(worlds)
    centre = mean(v for w in worlds for v in w)
    between = sum(len(w) * (mean(w) - centre) ** 2 for w in worlds) / (k - 1)
    within = sum((v - mean(w)) ** 2 for w in worlds for v in w) / (n - k)
    m = (n - sum(len(w) ** 2 for w in worlds) / n) / (k - 1)
    return (between - within) / (between + (m - 1) * within)


def budget(rows, share):
    """Distance at which the share that has arrived (Aalen and Johansen) reaches a share; None if it does not."""
    left, arrived, under_way = len(rows), 0.0, 1.0
    for at in sorted({row["distance_m"] for row in rows}):
        here = [row["outcome"] for row in rows if row["distance_m"] == at]
        arrivals, never = here.count("reached"), here.count("lost") + here.count("no_way")
        arrived += under_way * arrivals / left
        under_way *= 1 - (arrivals + never) / left
        left -= len(here)
        if arrivals and arrived >= share - 1e-12:
            return at
    return None


def recording():
    """A mission's row and its recording agree."""
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
    queries, files = 0, 0
    for path in sorted((report / "data").glob("*.json")):
        document = json.loads(path.read_text())
        if document["query_gives"] == "file":
            files += 1
            name = document["query"].split(",")[0]
            expect("LOGS.parquet" in name or os.path.exists(name), f"{path.stem}: there is no {name}")
        else:
            queries += 1
            runs(path, document)
        if path.stem == "comparison":
            compared(document)
    expect(queries >= 10, f"{queries} queries in the report")
    if (medians := report / "data" / "mission-medians.json").exists():
        quartiles(json.loads(medians.read_text()))
        recording()
    sets = rovers(report) if (report / "data" / "rover-efficiency.json").exists() else 0
    return {"queries": queries, "files": files, "sets of rovers": sets}


if __name__ == "__main__":
    run(check, lambda paths: sys.exit(f"{paths[0]} is not a release"))
