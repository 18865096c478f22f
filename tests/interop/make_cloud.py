"""Writes the point cloud of a DEM with laspy: make_cloud.py DEM CLOUD STEP_M.

Every cell with data has up to three points at random multiples of STEP_M, in random order, with heights about that of the cell; some cells have none.
One point in ten is noise (classes 7 and 18) or withheld, far above the ground, and must not be gridded. Where STEP_M is a power of two, many points lie
on the borders of cells to the last bit.
"""

import sys

import laspy
import numpy as np
import rasterio

PER_CELL, STRAY_SHARE, STRAY_M = 3, 0.1, 500.0
GROUND, NOISE = 2, [7, 18]


def main(dem, cloud, step_m):
    random = np.random.default_rng([2026, 11])
    with rasterio.open(dem) as raster:
        heights = raster.read(1, masked=True).astype(float).filled(np.nan)
        place = raster.transform
    rows, cols = np.nonzero(np.isfinite(heights))
    count = random.integers(0, PER_CELL + 1, rows.size)
    rows, cols = np.repeat(rows, count), np.repeat(cols, count)
    order = random.permutation(rows.size)
    rows, cols = rows[order], cols[order]
    n = rows.size
    x, y = (np.round(at / step_m) * step_m for at in place @ (cols + random.random(n), rows + random.random(n)))
    stray = random.random(n) < STRAY_SHARE
    z = heights[rows, cols] + random.normal(0.0, 0.01, n) + STRAY_M * stray
    withheld = stray & (random.random(n) < 0.3)
    classes = np.where(stray & ~withheld, random.choice(NOISE, n), GROUND)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [step_m, step_m, 1e-4], [0.0, 0.0, 0.0]
    las = laspy.LasData(header)
    las.x, las.y, las.z = x, y, z
    las.classification = classes.astype("u1")
    las.withheld = withheld.astype("u1")
    las.write(cloud)
    print(n, int(stray.sum()))


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} DEM CLOUD STEP_M")
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
