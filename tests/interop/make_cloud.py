"""Writes the point cloud of a DEM with laspy: make_cloud.py DEM CLOUD STEP_M [unequal].

Every cell with data has up to three points at random multiples of STEP_M, in random order, with heights about that of the cell; some cells have none.
One point in ten is noise (classes 7 and 18) or withheld, far above the ground, and must not be gridded. Where STEP_M is a power of two, many points lie
on the borders of cells to the last bit. With `unequal`, the chunks of a LAZ have unequal numbers of points, which laspy itself does not write.
"""

import sys

import laspy
import lazrs
import numpy as np
import rasterio
from laspy._compression.lazrsbackend import LazrsPointWriter

PER_CELL, STRAY_SHARE, STRAY_M = 3, 0.1, 500.0
GROUND, NOISE = 2, [7, 18]
CHUNKS = 30


class UnequalChunks(LazrsPointWriter):
    """Ends a chunk after each call."""

    @staticmethod
    def is_available():
        return True

    @classmethod
    def create_writer(cls, dest, header, **_):
        form = header.point_format
        writer = cls(dest, form, parallel=False)
        writer.vlr = lazrs.LazVlr.new_for_compression(form.id, form.num_extra_bytes, True)
        return writer

    def write_points(self, points):
        super().write_points(points)
        self.compressor.finish_current_chunk()


def write_unequal(las, cloud, random):
    ends = np.sort(random.choice(len(las.points), CHUNKS - 1, replace=False))
    with open(cloud, "wb") as file, laspy.LasWriter(file, las.header, do_compress=True, laz_backend=[UnequalChunks]) as writer:
        for part in np.split(np.arange(len(las.points)), ends):
            writer.write_points(las.points[part])


def main(dem, cloud, step_m, chunks=None):
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
    write_unequal(las, cloud, random) if chunks == "unequal" else las.write(cloud)
    print(n, int(stray.sum()))


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(f"usage: {sys.argv[0]} DEM CLOUD STEP_M [unequal]")
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]), *sys.argv[4:])
