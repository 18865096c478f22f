"""Grids point clouds with laspy and numpy and compares the result with our heights.

    python check_points.py CLOUD CELL_M HEIGHTS.npy

Cells with points must be the same, and their mean heights equal to 1e-9 m. Prints shape, points, cells with points, and the
SHA-256 of the points per cell (32-bit, little-endian, from the north-west), with which the tests of the room `store` check measured
clouds.
"""

import hashlib
import json
import sys

import laspy
import numpy as np

from common import Mismatch, expect

TOLERANCE_M = 1e-9
# Noise and high noise, which are never gridded.
NOISE = [7, 18]


def read(path):
    """Coordinates of the points that are gridded."""
    cloud = laspy.read(path)
    wanted = ~np.isin(np.asarray(cloud.classification), NOISE) & (np.asarray(cloud.withheld) == 0)
    return [np.asarray(axis)[wanted] for axis in (cloud.x, cloud.y, cloud.z)]


def cells(x, y, cell):
    """Shape of the grid, and the cell of every point: borders belong to the east and the south."""
    west, south = np.floor(x.min() / cell), np.floor(y.min() / cell)
    cols = int(np.floor(x.max() / cell) - west) + 1
    rows = int(max(np.ceil(y.max() / cell), south + 1) - south)
    col = (np.floor(x / cell) - west).astype(int)
    row = np.minimum((south + rows - np.ceil(y / cell)).astype(int), rows - 1)
    return (rows, cols), row * cols + col


def check(cloud, cell, heights):
    x, y, z = read(cloud)
    shape, at = cells(x, y, cell)
    size = shape[0] * shape[1]
    counts = np.bincount(at, minlength=size)
    with np.errstate(invalid="ignore"):
        means = np.bincount(at, weights=z, minlength=size) / counts
    expect(heights.shape == shape, f"{cloud}: {heights.shape} cells, but laspy's points fill {shape}")
    ours = heights.ravel()
    held = counts > 0
    expect(np.array_equal(np.isfinite(ours), held), f"{cloud}: different cells have points")
    worst = float(np.abs(ours - means)[held].max())
    expect(worst <= TOLERANCE_M, f"{cloud}: means differ by up to {worst} m")
    return {
        "rows": shape[0],
        "cols": shape[1],
        "points": int(counts.sum()),
        "held": int(held.sum()),
        "worst_m": worst,
        "counts_sha256": hashlib.sha256(counts.astype("<u4").tobytes()).hexdigest(),
    }


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} CLOUD CELL_M HEIGHTS.npy")
    try:
        figures = check(sys.argv[1], float(sys.argv[2]), np.load(sys.argv[3]))
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(figures, sys.stdout, indent=1, sort_keys=True)
    print()
