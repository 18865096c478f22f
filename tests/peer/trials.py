"""Compares trials of our vehicle (trials.toml) with MuJoCo's vehicle on the same missions: one row for each [[traverse]].

    trials.py RELEASE PEER.json

PEER.json is that of `drive.py RELEASE VEHICLE.toml --traverse unchanged`. Ratios are of geometric means, ours over MuJoCo's, with standard
errors over missions. The first table has the missions on which the trial and MuJoCo both succeed, which differ from row to row. The second has those
on which all trials and MuJoCo succeed; it also gives ratios over the unchanged vehicle, mission by mission.
"""

import json
import sys
from pathlib import Path

import numpy as np
import release as release_files
from compare import METRICS, geometric

UNCHANGED = "unchanged"


def key(row):
    """The mission itself, whichever run drives it: its terrain and number."""
    return row["terrain_id"], row["mission_id"].rsplit("-", 1)[1]


def succeeded(rows):
    return {key(row): row for row in rows if row["outcome"] == "success"}


def cells(ours, theirs, missions):
    """Ratios of geometric means over the missions, one cell for each metric."""
    pairs = [[(ours[m][name], theirs[m][name]) for m in missions] for name in METRICS]
    ratios = [geometric(*np.array(values).T) for values in pairs]
    return " | ".join(f"{ratio:.2f} +- {error:.2f}" for ratio, error in ratios)


def main():
    release = Path(sys.argv[1])
    peer = succeeded(json.loads(Path(sys.argv[2]).read_text())["missions"])
    by_trial = {}
    for row in release_files.missions(release):
        by_trial.setdefault(row["traverse_id"], []).append(row)
    trials = {UNCHANGED: succeeded(by_trial.pop(UNCHANGED))} | {name: succeeded(rows) for name, rows in by_trial.items()}

    print("| our vehicle | successes | with MuJoCo's | acceleration | pitch rate | roll rate |\n|---|---|---|---|---|---|")
    for name, ours in trials.items():
        both = sorted(ours.keys() & peer.keys())
        print(f"| {name} | {len(ours)} | {len(both)} | {cells(ours, peer, both)} |")

    common = sorted(set.intersection(set(peer), *map(set, trials.values())))
    head = f"| on the {len(common)} missions that succeed in all | over MuJoCo's: acceleration | pitch rate | roll rate"
    print(f"\n{head} | over unchanged: acceleration | pitch rate | roll rate |\n|---|---|---|---|---|---|---|")
    for name, ours in trials.items():
        print(f"| {name} | {cells(ours, peer, common)} | {cells(ours, trials[UNCHANGED], common)} |")


if __name__ == "__main__":
    main()
