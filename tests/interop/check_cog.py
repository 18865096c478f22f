"""Cloud-optimised GeoTIFFs compared with plain ones.

    python check_cog.py (COG PLAIN)...    rio-cogeo finds no error and no warning; rasterio (GDAL) reads the same heights, place and
                                          coordinates, and overviews that are means of the cells with data, or codes of cells
"""

import sys
from pathlib import Path

import numpy as np
import rasterio
from rio_cogeo.cogeo import cog_validate

from common import expect


def halved(heights):
    rows, cols = heights.shape
    padded = np.full((rows + rows % 2, cols + cols % 2), np.nan)
    padded[:rows, :cols] = heights
    blocks = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    with np.errstate(invalid="ignore"):
        return (np.nansum(blocks, axis=(1, 3)) / count).astype("<f4").astype(float)


def check(cog, plain):
    valid, errors, warnings = cog_validate(cog, strict=True)
    expect(valid and not errors and not warnings, f"{cog}: {errors} {warnings}")
    with rasterio.open(cog) as ours, rasterio.open(plain) as other:
        expect(ours.read(1).tobytes() == other.read(1).tobytes(), f"{cog}: the heights are not those of {plain}")
        for what in ["transform", "crs", "nodata", "units", "descriptions", "shape"]:
            expect(getattr(ours, what) == getattr(other, what), f"{cog}: {what} is not that of {plain}")
        factors = ours.overviews(1)
        # Up to 512 cells a side, one level is enough (GDAL's rule, which rio-cogeo checks).
        expect(factors or max(ours.shape) <= 512, f"{cog}: no overviews")
        heights = ours.read(1, masked=True).astype(float).filled(np.nan)
        # Codes have neither a unit nor means.
        less = halved if ours.units[0] else lambda codes: codes[::2, ::2]
    for level, factor in enumerate(factors):
        heights = less(heights)
        with rasterio.open(cog, overview_level=level) as overview:
            read = overview.read(1, masked=True).astype(float).filled(np.nan)
        expect(np.array_equal(read, heights, equal_nan=True), f"{cog}: overview 1:{factor} does not follow from its cells")
    print(f"{cog.name}: overviews {factors}")


if __name__ == "__main__":
    files = [Path(argument) for argument in sys.argv[1:]]
    expect(files, "no files to compare")
    for cog, plain in zip(files[::2], files[1::2], strict=True):
        check(cog, plain)
