"""Least costs of the program compared with r.walk of GRASS GIS, on the largest part of a DEM without holes.

    python walk.py PROGRAM DEM FOLDER

r.walk charges a step of plan length d that rises by h with `a d + b h` uphill, `a d + c h` downhill, and `a d + d h` downhill where the slope
is below its slope factor (Langmuir, 1984). With `a = 1`, `b = up_weight` and `c = d = -down_weight`, that is our cost except for the length,
which we measure on the ground. r.walk has no slope limits.

** flat: heights divided and weights multiplied by a thousand. Lengths in plan and on the ground agree, and so must the costs.
* true: unchanged heights and weights.
* langmuir: the default coefficients of r.walk, the cost of its walk along our route, and the gain of Knight's move.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import rasterio
from rasterio.transform import rowcol
from rasterio.windows import Window

# Row, column, rows and columns.
WINDOW = (22, 13, 184, 175)
FLATTER = 1000.0
UP_WEIGHT, DOWN_WEIGHT = 2.0, 0.5
LANGMUIR = (0.72, 6.0, 1.9998, -1.9998)
SLOPE_FACTOR = -0.2125
PAIRS = 12
SEED = 20261123


def crop(dem, folder):
    """The part without holes, unchanged and flattened."""
    row, col, rows, cols = WINDOW
    with rasterio.open(dem) as raster:
        window = Window(col, row, cols, rows)
        heights = raster.read(1, window=window, masked=True)
        assert not np.ma.is_masked(heights)
        transform = raster.window_transform(window)
        profile = {"driver": "GTiff", "dtype": "float32", "count": 1, "height": rows, "width": cols}
        for name, scale in (("true", 1.0), ("flat", 1 / FLATTER)):
            # From the lowest point, so that single precision keeps the thousandth.
            values = ((heights.data.astype(float) - float(heights.min())) * scale).astype("float32")
            with rasterio.open(folder / f"{name}.tif", "w", **profile, crs=raster.crs, transform=transform) as out:
                out.write(values, 1)


def walk_lines(name, start, goal, coefficients, output, flags=""):
    a, b, c, d = coefficients
    x, y = start
    return (
        f"r.walk {flags} elevation={name} friction=none output={output} outdir=d_{output} start_coordinates={x},{y} walk_coeff={a},{b},{c},{d} "
        f"lambda=0 slope_factor={SLOPE_FACTOR} --quiet\n"
        f"echo {output} $(r.what map={output} coordinates={goal[0]},{goal[1]} separator=space | cut -d' ' -f3-)\n"
    )


def walks(folder, pairs):
    """Costs by r.walk for each pair and kind."""
    linear = {"true": (1, UP_WEIGHT, -DOWN_WEIGHT, -DOWN_WEIGHT)}
    linear["flat"] = (1, FLATTER * UP_WEIGHT, -FLATTER * DOWN_WEIGHT, -FLATTER * DOWN_WEIGHT)
    script = "set -e\n" + "".join(f"r.in.gdal input={folder}/{name}.tif output={name} --quiet\n" for name in linear)
    script += 'g.region raster=true\nr.mapcalc "none = 0.0" --quiet\n'
    for k, (start, goal) in enumerate(pairs):
        for name, coefficients in linear.items():
            script += walk_lines(name, start, goal, coefficients, f"{name}_{k}")
        script += walk_lines("true", start, goal, LANGMUIR, f"langmuir_{k}")
        script += walk_lines("true", start, goal, LANGMUIR, f"knight_{k}", "-k")
    (folder / "walks.sh").write_text(script)
    call = ["grass", "--tmp-location", folder / "true.tif", "--exec", "bash", folder / "walks.sh"]
    text = subprocess.run(call, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    found = {}
    for line in text.splitlines():
        words = line.split()
        if len(words) >= 2 and words[0].rsplit("_", 1)[0] in (*linear, "langmuir", "knight"):
            found[words[0]] = float(words[-1].strip("|"))
    return found


def route(program, folder, name, ends, weights):
    """Costs and line of our route."""
    (x0, y0), (x1, y1) = ends
    sets = {"neighbours": 8, "max_up_deg": 89.0, "max_down_deg": 89.0, "up_weight": weights[0], "down_weight": weights[1]}
    output = folder / "release"
    call = [program, "navigate", folder / f"{name}.tif", f"--start={x0},{y0}", f"--goal={x1},{y1}", "--quiet", "--replace", "-o", output]
    subprocess.run(call + [w for key, value in sets.items() for w in ("--set", f"{key}={value}")], check=True, stdout=subprocess.DEVNULL)
    row = pq.read_table(output / "tables/routes").to_pylist()[0]
    points = [p for p in pq.read_table(output / "tables/route_points").to_pylist() if p["form"] == "searched"]
    points.sort(key=lambda p: p["point"])
    return row["search_cost_m"], [(p["x_m"], p["y_m"]) for p in points]


def langmuir_s(line, raster, heights):
    """Cost of a walk along steps with the default coefficients."""
    a, b, c, d = LANGMUIR
    places = [rowcol(raster.transform, *xy) for xy in line]
    total = 0.0
    for (r0, c0), (r1, c1) in zip(places, places[1:]):
        steps = int(max(abs(r1 - r0), abs(c1 - c0)))
        for k in range(steps):
            at = [(int(r0 + (r1 - r0) * j // steps), int(c0 + (c1 - c0) * j // steps)) for j in (k, k + 1)]
            run_m = math.hypot((c1 - c0) / steps * raster.transform.a, (r1 - r0) / steps * raster.transform.e)
            rise_m = heights[at[1]] - heights[at[0]]
            slope = rise_m / run_m
            total += a * run_m + rise_m * (b if rise_m >= 0 else c if slope >= SLOPE_FACTOR else d)
    return total


def main(program, dem, folder):
    crop(dem, folder)
    raster = rasterio.open(folder / "true.tif")
    heights = raster.read(1).astype(float)
    random = np.random.default_rng(SEED)
    place = lambda: raster.xy(int(random.integers(raster.height)), int(random.integers(raster.width)))
    pairs = []
    while len(pairs) < PAIRS:
        ends = place(), place()
        if math.dist(*ends) > 50:
            pairs.append(ends)
    theirs = walks(folder, pairs)
    ratios = {"flat": [], "true": [], "langmuir_on_our_route": [], "knight": []}
    for k, ends in enumerate(pairs):
        flat, _ = route(program, folder, "flat", ends, (FLATTER * UP_WEIGHT, FLATTER * DOWN_WEIGHT))
        true, _ = route(program, folder, "true", ends, (UP_WEIGHT, DOWN_WEIGHT))
        _, line = route(program, folder, "true", ends, (LANGMUIR[1] / LANGMUIR[0], 0.0))
        ratios["flat"].append(flat / theirs[f"flat_{k}"])
        ratios["true"].append(true / theirs[f"true_{k}"])
        ratios["langmuir_on_our_route"].append(langmuir_s(line, raster, heights) / theirs[f"langmuir_{k}"])
        ratios["knight"].append(theirs[f"knight_{k}"] / theirs[f"langmuir_{k}"])
    return {name: {"least": min(v), "median": float(np.median(v)), "most": max(v)} for name, v in ratios.items() if v}


if __name__ == "__main__":
    json.dump(main(*map(Path, sys.argv[1:])), sys.stdout, indent=1)
