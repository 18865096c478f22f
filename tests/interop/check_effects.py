"""Elementary effects of perturbed rovers compared with SALib's, from the same designs.

    check_effects.py RELEASE

For every rover stage and group of terrains, the table `rover_designs`, averaged over the worlds, is passed to SALib's Morris
analysis; its mu, mu_star and sigma are per range of a parameter, which is twice the share of its value, and must agree with the
table `rover_effects` within 1e-9 of the largest.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from SALib.analyze import morris

from common import Mismatch, expect, table

MEASURES = {
    "arrival": lambda row: row["arrived"] / row["rovers"],
    "distance_m": lambda row: row["distance_m"],
    "efficiency": lambda row: row["efficiency"],
}


def designs_of(rows, measure):
    """Factors of every design, trajectory after trajectory, and the measure averaged over the worlds."""
    values, factors = defaultdict(list), {}
    for row in rows:
        key = (row["trajectory"], row["step"])
        values[key].append(MEASURES[measure](row))
        factors[key] = json.loads(row["factors"])
    names = sorted(next(iter(factors.values())))
    points = np.array([[factors[key][name] for name in names] for key in sorted(factors)])
    return names, points, np.array([np.mean(values[key]) for key in sorted(values)])


def check(effects, rows):
    """Compares the effects on one measure; returns the number of parameters."""
    first = effects[0]
    names, points, values = designs_of(rows, first["measure"])
    expect(names == sorted(e["parameter"] for e in effects), f"parameters {names}")
    share = first["share"]
    problem = {"num_vars": len(names), "names": names, "bounds": [[1 - share, 1 + share]] * len(names)}
    found = morris.analyze(problem, points, values, num_levels=first["levels"], num_resamples=10)
    ours = {e["parameter"]: e for e in effects}
    for column in ["mu", "mu_star", "sigma"]:
        theirs = np.asarray(found[column], dtype=float) / (2 * share)
        mine = np.array([ours[name][column] for name in names])
        limit = 1e-9 * max(1.0, np.abs(theirs).max())
        expect(np.all(np.abs(mine - theirs) <= limit), f"{first['measure']} {column}: {mine} of ours, {theirs} of SALib")
    return len(names)


def main(release):
    groups = {row["terrain_id"]: row["group"] for row in table(release, "terrains")}
    effects = defaultdict(list)
    for row in table(release, "rover_effects"):
        effects[row["stage_id"], row["group"], row["measure"]].append(row)
    designs = table(release, "rover_designs")
    count = 0
    for (stage, group, _), of in sorted(effects.items()):
        rows = [r for r in designs if r["stage_id"] == stage and groups[r["terrain_id"]] == group]
        count += check(of, rows)
    expect(count > 0, "no effects in the release")
    print(f"{count} effects are those of SALib")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} RELEASE")
    try:
        main(Path(sys.argv[1]))
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
