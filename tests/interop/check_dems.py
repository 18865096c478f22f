"""Reads rasters with rasterio (GeoTIFF, ESRI ASCII, SRTM) and numpy (.npy) and prints statistics of them.

    python check_dems.py RELEASE    every GeoTIFF of a release; heights must have the manifest's content hash, and
                                    statistics must equal table `terrains`
    python check_dems.py FILE...    statistics only, for comparison with `sastrugi info --json`
"""

import warnings
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import rasterio

from common import ContentHash, expect, manifest, run


# Units of the maps that go with heights, and words in their descriptions.
MAPS = {
    "albedo": ("1", "light"),
    "class": (None, "0 sand, 1 rock"),
    "flux": ("1", "mean 1"),
    "rms-measured": ("m", "RMS"),
    "rms-predicted": ("m", "RMS"),
    "rock-potential": ("1", "fraction of the ground"),
}
# Unit and description of rendered images.
IMAGE = ("1", "brightness")


def read(path):
    """Heights as float64 with NaN for no data, and their statistics and metadata."""
    if path.suffix == ".npy":
        stored = np.load(path)
        return stored.astype(float), {"dtype": stored.dtype.name, "cell": [1.0, 1.0]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path) as raster:
            expect(raster.count == 1, f"{path} has {raster.count} bands")
            stored = raster.read(1)
            heights = stored.astype(float)
            if raster.nodata is not None:
                heights[stored == np.array(raster.nodata).astype(stored.dtype)] = np.nan
            t = raster.transform
            info = {
                "dtype": raster.dtypes[0],
                "cell": [t.a, -t.e],
                "origin": [t.c, t.f + t.e * raster.height],
                "nodata": raster.nodata if raster.nodata == raster.nodata else "nan",
                "epsg": raster.crs.to_epsg() if raster.crs else None,
                "block": list(raster.block_shapes[0]),
                "compression": raster.profile.get("compress"),
                "unit": raster.units[0],
                "description": raster.descriptions[0],
                "point": raster.tags().get("AREA_OR_POINT") == "Point",
            }
    return heights, info


def heights_sha256(heights, cell):
    content = ContentHash("heights")
    content.u64(heights.shape[0])
    content.u64(heights.shape[1])
    for side in cell:
        content.f64(side)
    with np.errstate(over="ignore"):
        single = heights.astype("<f4")
    bits = single.view("<u4").copy()
    bits[np.isnan(single)] = 0x7FC00000
    content.raw(bits.tobytes())
    return content.hex()


def figures(path):
    heights, info = read(path)
    valid = heights[np.isfinite(heights)]
    expect(valid.size > 0, f"{path} holds no data")
    return info | {
        "rows": heights.shape[0],
        "cols": heights.shape[1],
        "valid": int(valid.size),
        "height_min_m": float(valid.min()),
        "height_max_m": float(valid.max()),
        "rms_height_m": float(valid.std()),
        "heights_sha256": heights_sha256(heights, info["cell"]),
    }


def close(a, b):
    return abs(a - b) <= 1e-9 * max(abs(a), abs(b), 1e-3)


def check_against_row(path, found, row):
    """Table `terrains` describes the heights in metres; a geographic raster's cells differ from the file's."""
    for key in ["rows", "cols"]:
        expect(found[key] == row[key], f"{path}: {key} is {found[key]}, but {row[key]} in table terrains")
    for key in ["height_min_m", "height_max_m", "rms_height_m"]:
        expect(close(found[key], row[key]), f"{path}: {key} is {found[key]}, but {row[key]} in table terrains")
    share = found["valid"] / (found["rows"] * found["cols"])
    expect(close(share, row["valid_share"]), f"{path}: valid share {share}, but {row['valid_share']} in table terrains")


def check_release(release):
    files = sorted((release / "tables" / "terrains").glob("*.parquet"))
    rows = {row["path"]: row for file in files for row in pq.read_table(file).to_pylist()}
    report, compared = {}, set()
    for artifact in manifest(release)["artifacts"]:
        path = artifact["path"]
        if not path.endswith(".tif") or path.startswith("dem/"):
            continue
        found = report[path] = figures(release / path)
        if found["dtype"] != "float32":
            continue
        expect(found["block"] == [256, 256], f"{path} has blocks of {found['block']}")
        plain = IMAGE if path.startswith("image/") else ("m", None)
        unit, words = next((MAPS[word] for word in MAPS if path.endswith(f".{word}.tif")), plain)
        expect(found["unit"] == unit, f"{path} has the unit {found['unit']}")
        said = found["description"]
        expect(said is None if words is None else words in (said or ""), f"{path} has the description {said}")
        expect(not found["point"], f"{path} is PixelIsPoint")
        recorded = artifact.get("content_sha256")
        expect(recorded in (None, found["heights_sha256"]), f"{path}: heights do not have the manifest's content hash")
        if path in rows:
            check_against_row(path, found, rows[path])
            compared.add(path)
    expect(report, f"{release} has no GeoTIFF")
    left = sorted(path for path in rows if not path.startswith("dem/") and path not in compared)
    expect(compared and not left, f"table terrains names heights that were not compared: {left}")
    return report


def check_files(paths):
    return {Path(path).name: figures(path) for path in paths}


if __name__ == "__main__":
    run(check_release, check_files)
