"""Fits of numpy fields on slopes: bias, agreement with level ground, and coverage of the intervals.

    check_fits.py PROGRAM FOLDER quick|full

The table: slopes of 0 to 100 %, eight azimuths (two opposite ones for each slope and condition), an undulation of 0.3 m over
40 m; bare, with 15 % holes, with trees, with both. The DEMs are written to FOLDER. Null hypothesis: the fit is unbiased, slopes
have no effect, and 95 % intervals cover the truth in 95 % of fields.

* Bias, pooled over the table. One field scatters by 2.2 % (sigma) and 4.9 % (b), measured here, so that the mean of `full`
  (300 fields) errs by 0.13 % and 0.28 %: the limits, 0.65 % and 1.5 %, are five standard errors
  (false alarm 6e-7). `quick` (20 fields): limits of 2.4 % and 5.7 % are 4.9 and 5.2 (1e-6). `full` measured
  -0.02 % and -0.41 %; over 600 fields, b's bias of -0.57 % was 2.9 standard errors from 0.
** Paired: the fit on the slope compared with that of the same field, undulation, holes and trees without the slope. Each without
  trees, and the mean of each condition with them (the search for objects may decide otherwise on single cells), within
  0.1 % and 0.2 %. No chance is involved. A plain mean at partial windows is off by 6 % and 13 % at a slope of 10 %.
* Coverage (`full`): at least 48 of 60 intervals cover (false alarm 7e-6 per parameter at a true coverage of 95 %; 75 %
  is found in 3 of 4 runs).
"""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fields
from common import Mismatch, expect

PARAMETERS = ["sigma_m", "range_m"]
TRUTH = np.array([fields.SIGMA_M, fields.RANGE_M])
SLOPES = [0.0, 0.1, 0.2, 0.5, 1.0]
CONDITIONS = ["bare", "holes", "trees", "trees and holes"]
OUTER_SCALE_M = 2.0
PAIRED_LIMITS_PERCENT = np.array([0.1, 0.2])
REPLICATES = 99


@dataclass(frozen=True)
class Extent:
    """Extent of the table that is run."""

    fields: int  # per slope and condition
    paired: int  # of these, fitted on level ground as well
    covered: int  # of these, with intervals
    bias_limits_percent: tuple
    covering_share_min: float


EXTENTS = {
    "quick": Extent(1, 1, 0, (2.4, 5.7), 0.0),
    "full": Extent(15, 4, 3, (0.65, 1.5), 0.8),
}


@dataclass(frozen=True)
class Site:
    """One field of the table."""

    slope: float
    condition: str
    number: int
    seed: int

    def dems(self):
        """The field on its slope, and without the slope."""
        random = np.random.default_rng([2026, self.seed])
        texture = fields.exponential_fields(random)[0]
        if "trees" in self.condition:
            texture = texture + fields.trees_m(random)
        if "holes" in self.condition:
            texture[fields.holes(random)] = np.nan
        azimuth_deg = 45.0 * (self.seed % 8) + 11.0
        level = texture + fields.undulation_m(azimuth_deg)
        return level + fields.slope_m(self.slope, azimuth_deg), level


def sites(extent):
    cells = [(slope, condition) for condition in CONDITIONS for slope in SLOPES]
    numbered = [(slope, condition, number) for number in range(extent.fields) for slope, condition in cells]
    return [Site(*place, seed) for seed, place in enumerate(numbered)]


class Fitter:
    def __init__(self, program, folder):
        self.program, self.folder = program, Path(folder)

    def fit(self, name, heights, replicates):
        """The fit file of a DEM; the folder is left empty."""
        dem, file = self.folder / f"{name}.npy", self.folder / f"{name}.json"
        np.save(dem, heights)
        options = {"--cell": fields.CELL_M, "--outer-scale": OUTER_SCALE_M, "--bootstrap": replicates, "--threads": 1}
        words = [str(word) for option in options.items() for word in option]
        call = [self.program, "fit", str(dem), *words, "--quiet", "--output", str(file)]
        done = subprocess.run(call, capture_output=True, text=True)
        expect(done.returncode == 0, f"{name}: exit code {done.returncode}: {done.stderr}")
        fit = json.loads(file.read_text())
        dem.unlink()
        file.unlink()
        return fit

    def errors(self, site, extent):
        """Errors on the slope, and less those on level ground (NaN where not fitted), percent; whether intervals cover."""
        sloping, level = site.dems()
        has_intervals = site.number < extent.covered
        fit = self.fit(f"slope-{site.seed}", sloping, REPLICATES if has_intervals else 0)
        found = estimates(fit)
        moved, covers = np.full(2, np.nan), np.full(2, np.nan)
        if site.slope > 0.0 and site.number < extent.paired:
            moved = found / estimates(self.fit(f"level-{site.seed}", level, 0)) - 1.0
        if has_intervals:
            bounds = np.array([fit["intervals"][name] for name in PARAMETERS])
            covers = ((bounds[:, 0] <= TRUTH) & (TRUTH <= bounds[:, 1])).astype(float)
        return 100.0 * (found / TRUTH - 1.0), 100.0 * moved, covers


def estimates(fit):
    return np.array([fit["parameters"][name] for name in PARAMETERS])


def summary(errors, moved, covers):
    """Of fields (n, 2): mean and its standard error, mean and largest paired difference, covering share."""
    n = len(errors)
    pairs, intervals = (values[np.isfinite(values[:, 0])] for values in (moved, covers))
    none = np.full(2, np.nan)
    return {
        "fields": n,
        "bias_percent": errors.mean(axis=0),
        "standard_error_percent": errors.std(axis=0, ddof=1) / np.sqrt(n) if n > 1 else none,
        "paired_mean_percent": pairs.mean(axis=0) if len(pairs) else none,
        "paired_worst_percent": np.abs(pairs).max(axis=0) if len(pairs) else none,
        "intervals": len(intervals),
        "covering_share": intervals.mean(axis=0) if len(intervals) else none,
    }


def show(name, row):
    def both(key, form):
        return " / ".join(format(value, form) for value in row[key])

    print(
        f"| {name} | {row['fields']} | {both('bias_percent', '+.2f')} | {both('standard_error_percent', '.2f')} | "
        f"{both('paired_mean_percent', '+.4f')} | {both('paired_worst_percent', '.4f')} | "
        f"{row['intervals']} | {both('covering_share', '.2f')} |"
    )


def table(chosen, results):
    """Prints the table and returns its rows by name."""
    print("| sigma / b | fields | bias % | standard error % | less level % | largest % | intervals | covering share |")
    print("|---|---|---|---|---|---|---|---|")
    condition = np.array([site.condition for site in chosen])
    slope = np.array([site.slope for site in chosen])
    groups = {f"{c}, {100 * s:.0f} %": (condition == c) & (slope == s) for c in CONDITIONS for s in SLOPES}
    groups |= {c: condition == c for c in CONDITIONS}
    groups |= {f"{100 * s:.0f} %": slope == s for s in SLOPES}
    groups["all"] = np.full(len(chosen), True)
    rows = {name: summary(*(values[members] for values in results)) for name, members in groups.items()}
    for name, row in rows.items():
        show(name, row)
    return rows


def judge(rows, extent):
    overall = rows["all"]
    expect(
        np.all(np.abs(overall["bias_percent"]) <= extent.bias_limits_percent),
        f"bias of sigma and b {overall['bias_percent']} %, limits {extent.bias_limits_percent} %",
    )
    for condition in CONDITIONS:
        kind = "paired_mean_percent" if "trees" in condition else "paired_worst_percent"
        moved = np.abs(rows[condition][kind])
        expect(bool(np.isfinite(moved).all()), f"{condition}: no pairs")
        expect(
            np.all(moved <= PAIRED_LIMITS_PERCENT),
            f"{condition}: slopes move sigma and b by {moved} %, limits {PAIRED_LIMITS_PERCENT} %",
        )
    if extent.covered:
        covering = overall["covering_share"]
        expect(np.all(covering >= extent.covering_share_min), f"intervals of 95 % cover the truth in {covering} of fields")


def main(program, folder, extent):
    extent = EXTENTS[extent]
    fitter, chosen = Fitter(program, folder), sites(extent)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(lambda site: fitter.errors(site, extent), chosen))
    judge(table(chosen, [np.array(values) for values in zip(*results)]), extent)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} PROGRAM FOLDER quick|full")
    try:
        main(*sys.argv[1:])
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
