"""Compares the missions of a release with the same missions driven by the peer (JSON of drive.py).

    compare.py RELEASE PEER.json

Prints a table and, as its last line, the numbers that the test compares with its bounds, as JSON.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
import release as release_files
from metrics import of_poses

OUTCOMES = ["success", "tipped", "stuck", "out_of_bounds", "timeout"]
METRICS = {
    "rms_vertical_acceleration_m_s2": "RMS vertical acceleration, m/s2",
    "rms_pitch_rate_deg_s": "RMS pitch rate, deg/s",
    "rms_roll_rate_deg_s": "RMS roll rate, deg/s",
}


def mcnemar_exact(only_ours, only_theirs):
    """Two-sided p of a split at least as uneven, among the missions on which only one engine succeeds."""
    n, k = only_ours + only_theirs, min(only_ours, only_theirs)
    return min(1.0, 2 * sum(math.comb(n, i) for i in range(k + 1)) / 2**n)


def agreement(ours, theirs):
    """Share of equal outcomes (success or not), Cohen's kappa, McNemar's exact p."""
    same = float(np.mean(ours == theirs))
    chance = ours.mean() * theirs.mean() + (1 - ours.mean()) * (1 - theirs.mean())
    kappa = (same - chance) / (1 - chance) if chance < 1 else float("nan")
    split = int((ours & ~theirs).sum()), int((theirs & ~ours).sum())
    return {"same": same, "kappa": kappa, "only_ours": split[0], "only_theirs": split[1], "mcnemar_p": mcnemar_exact(*split)}


def geometric(ours, theirs):
    """Ratio of the geometric means of paired values, and its standard error over the pairs."""
    logarithms = np.log(ours) - np.log(theirs)
    ratio = float(np.exp(np.mean(logarithms)))
    return ratio, ratio * float(np.std(logarithms, ddof=1)) / math.sqrt(len(logarithms))


def check_metrics(release, rows):
    """Largest relative difference of the release's metrics from those of its samples by the peer's formulas; NaN if any is."""
    differences = []
    for terrain in sorted({row["terrain_id"] for row in rows}):
        poses = release_files.samples(release, terrain)
        for row in (r for r in rows if r["terrain_id"] == terrain):
            found = of_poses(poses[row["mission_id"]], row["sample_rate_hz"])
            differences.extend(abs(found[key] / row[key] - 1) for key in METRICS)
    # The largest of Python leaves NaN out.
    return float(np.max(differences))


def main():
    release = Path(sys.argv[1])
    peer = json.loads(Path(sys.argv[2]).read_text())
    driven = {(row["terrain_id"], row["mission_id"]): row for row in peer["missions"]}
    rows = [row for row in release_files.missions(release) if (row["terrain_id"], row["mission_id"]) in driven]
    theirs = [driven[row["terrain_id"], row["mission_id"]] for row in rows]
    success = [np.array([row["outcome"] == "success" for row in side]) for side in (rows, theirs)]
    groups = np.array([row["group"] for row in rows])

    print("| D | missions | success: sastrugi | success: MuJoCo | same outcome |\n|---|---|---|---|---|")
    for group in [*sorted(set(groups)), "all"]:
        here = np.full(len(rows), True) if group == "all" else groups == group
        ours, peers = success[0][here], success[1][here]
        print(f"| {group} | {here.sum()} | {ours.sum()} | {peers.sum()} | {(ours == peers).sum()} ({np.mean(ours == peers):.1%}) |")
    agreed = agreement(*success)
    print(f"\nkappa {agreed['kappa']:.2f}; only sastrugi succeeds {agreed['only_ours']}, only MuJoCo {agreed['only_theirs']}", end="")
    print(f" (McNemar p {agreed['mcnemar_p']:.3f})\n")

    both = success[0] & success[1]
    head = "sastrugi | MuJoCo | ratio | ratio of geometric means | correlation"
    print(f"| medians where both succeed ({both.sum()}) | {head} |\n|---|---|---|---|---|---|")
    ratios, means = {}, {}
    for key, label in [*METRICS.items(), ("time_s", "time, s")]:
        a, b = (np.array([row[key] for row in side])[both] for side in (rows, theirs))
        ratios[key] = float(np.median(a) / np.median(b))
        means[key], error = geometric(a, b)
        medians = f"{np.median(a):.3f} | {np.median(b):.3f} | {ratios[key]:.3f}"
        print(f"| {label} | {medians} | {means[key]:.3f} +- {error:.3f} | {np.corrcoef(a, b)[0, 1]:.3f} |")
    print("\n| outcomes | " + " | ".join(OUTCOMES) + " |\n|---|" + "---|" * len(OUTCOMES))
    for name, side in (("sastrugi", rows), ("MuJoCo", theirs)):
        print(f"| {name} | " + " | ".join(str(sum(row["outcome"] == o for row in side)) for o in OUTCOMES) + " |")
    at_centres, between = peer["height_error_m"]
    speed = peer["simulated_s"] / peer["cpu_s"]
    print(f"\nMuJoCo {peer['mujoco']}: {speed:.1f} times real time; its ground {at_centres:.1e} m off the DEM at cell centres,", end="")
    print(f" {between:.1e} m between them (triangles for bilinear cells)")
    found = {
        "missions": len(rows),
        "height_error_m": at_centres,
        "metrics_error": check_metrics(release, rows),
        "real_time_factor": speed,
        "ratios": ratios,
        "geometric": means,
        **agreed,
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
