"""Writes one measured DEM in every raster format that is read, by GDAL and numpy: make_dems.py DEM FOLDER.

GeoTIFFs: 16-bit integers in LZW tiles with predictor 2, single precision in deflated strips with the lowest number for no data, double
precision, and posts instead of cells (PixelIsPoint). ESRI ASCII grids of integers and of decimals. Arrays of single and double precision. An SRTM tile
with voids, whose heights repeat those of the DEM. Prints the names of the files.
"""

import json
import sys
from pathlib import Path

import numpy as np
import rasterio

NO_DATA = -9999
SRTM_SIDE, SRTM_VOID = 1201, -32768


def write_tif(path, like, heights, nodata, point=False, **layout):
    profile = {"driver": "GTiff", "dtype": heights.dtype, "count": 1, "height": heights.shape[0], "width": heights.shape[1]}
    with rasterio.open(path, "w", **profile, crs=like.crs, transform=like.transform, nodata=nodata, **layout) as raster:
        raster.write(heights, 1)
        if point:
            raster.update_tags(AREA_OR_POINT="Point")


def write_asc(path, heights, form):
    """North row first, cells of half a metre."""
    rows, cols = heights.shape
    head = f"ncols {cols}\nnrows {rows}\nxllcorner 664692.5\nyllcorner 4878903.25\ncellsize 0.5\nNODATA_value {NO_DATA}\n"
    lines = [" ".join(str(NO_DATA) if np.isnan(z) else format(z, form) for z in row) for row in heights]
    path.write_text(head + "\n".join(lines) + "\n")


def main(dem, folder):
    with rasterio.open(dem) as like:
        heights = like.read(1, masked=True).astype(float).filled(np.nan)
    there = np.isfinite(heights)

    def stored(kind, nodata):
        return np.where(there, heights, nodata).astype(kind)

    lowest = float(np.finfo("float32").min)
    write_tif(folder / "tiles.tif", like, stored("int16", NO_DATA), NO_DATA, tiled=True, blockxsize=64, blockysize=64, compress="lzw", predictor=2)
    write_tif(folder / "strips.tif", like, stored("float32", lowest), lowest, compress="deflate")
    write_tif(folder / "double.tif", like, stored("float64", NO_DATA), NO_DATA)
    write_tif(folder / "posts.tif", like, stored("float32", NO_DATA), NO_DATA, point=True)
    # A part without an empty first row, by whose words GDAL recognises the type.
    row = int(there.any(axis=1).argmax()) + 60
    part = heights[row : row + 80, 40:140]
    write_asc(folder / "integers.asc", np.round(part), ".0f")
    write_asc(folder / "decimals.asc", part, ".3f")
    np.save(folder / "single.npy", heights.astype("float32"))
    np.save(folder / "double.npy", heights)
    tile = np.resize(np.round(heights[there]), (SRTM_SIDE, SRTM_SIDE))
    tile[100:140, 900:] = SRTM_VOID
    tile.astype(">i2").tofile(folder / "N33W120.hgt")
    print(json.dumps(sorted(path.name for path in folder.iterdir() if path.suffix in (".tif", ".asc", ".npy", ".hgt"))))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} DEM FOLDER")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
