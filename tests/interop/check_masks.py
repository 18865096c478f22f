"""Burns polygons with rasterio (GDAL) and compares the result with the cells that we keep.

    python check_masks.py DEM MASK.geojson MASKED.tif

A cell is kept if GDAL finds its centre inside a polygon and the DEM has data. Prints the number of cells kept.
"""

import json
import sys

import numpy as np
import rasterio
import rasterio.features

from common import Mismatch, expect


def geometries(value):
    """Polygons of a GeoJSON object."""
    kind = value["type"]
    if kind == "FeatureCollection":
        return [g for feature in value["features"] for g in geometries(feature)]
    if kind == "Feature":
        return geometries(value["geometry"]) if value["geometry"] else []
    return [value]


def heights(raster):
    stored = raster.read(1).astype(float)
    return np.where(raster.read_masks(1) > 0, stored, np.nan)


def check(dem, mask, masked):
    with open(mask, encoding="utf-8") as file:
        polygons = geometries(json.load(file))
    with rasterio.open(dem) as raster:
        before = heights(raster)
        inside = rasterio.features.geometry_mask(polygons, before.shape, raster.transform, invert=True)
    with rasterio.open(masked) as raster:
        after = heights(raster)
    expected = np.where(inside, before, np.nan)
    differing = int((np.isfinite(expected) != np.isfinite(after)).sum())
    expect(differing == 0, f"{mask} on {dem}: {differing} cells are kept or dropped contrary to GDAL")
    expect(np.array_equal(expected, after, equal_nan=True), f"{mask} on {dem}: heights changed")
    return {"kept": int(np.isfinite(after).sum()), "inside": int(inside.sum())}


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} DEM MASK.geojson MASKED.tif")
    try:
        figures = check(*sys.argv[1:])
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(figures, sys.stdout, indent=1, sort_keys=True)
    print()
