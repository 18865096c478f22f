"""Plans routes with the program and recomputes their costs with scikit-image and scipy.

    python check_routes.py PROGRAM DEM FOLDER    a small study over the DEM and synthetic terrains, in FOLDER

* Isotropic cost on level ground: scikit-image's MCP_Geometric. A step costs its length times the mean of both cells there, as here; it
  cuts corners of blocked cells, so no cell is blocked.
** Directional slope cost with limits: scipy's Dijkstra on the explicit digraph of steps. A route exists if its distance is finite.
** Smoothed routes: cost, lengths and slopes, integrated independently in quarter cells over bilinear heights.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import rowcol
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from skimage.graph import MCP_Geometric

from common import Mismatch, expect, table

TOLERANCE = 1e-9
QUARTERS = [0.0, 0.25, 0.5, 0.75, 1.0]
# East, north-east and so on: rows and columns.
STEPS = {4: [(0, 1), (-1, 0), (0, -1), (1, 0)]}
STEPS[8] = STEPS[4] + [(-1, 1), (-1, -1), (1, -1), (1, 1)]
LIMITS_DEG = [(30.0, 30.0), (14.0, 11.0), (7.0, 9.0)]
UP_WEIGHT, DOWN_WEIGHT = 2.0, 0.5
TERRAINS = ["pozo", "hills", "rough"]
STUDY = """[study]
name = "routes"
seed = 20261123
date = "2026-11-23"

[[dem]]
id = "pozo"
file = "{dem}"

[[dem]]
id = "level"
file = "level.tif"

[[dem]]
id = "factors"
file = "factors.tif"

[[terrain]]
id = "hills"
kind = "spheroids"
preset = "very_rough"
size_px = [150, 120]
cell_m = 1.0

[[terrain]]
id = "rough"
kind = "multifractal"
size_px = [120, 100]
cell_m = 0.2
"""
ROUTE = """
[[route]]
id = "{id}"
terrains = {terrains}
pairs = {pairs}
method = "{method}"
neighbours = {neighbours}
max_up_deg = {up}
max_down_deg = {down}
up_weight = {up_weight}
down_weight = {down_weight}
"""


def write_raster(path, like, values):
    """A raster of float32 with the coordinates of another one."""
    profile = {"driver": "GTiff", "dtype": "float32", "count": 1, "height": values.shape[0], "width": values.shape[1]}
    with rasterio.open(path, "w", **profile, crs=like.crs, transform=like.transform) as raster:
        raster.write(values.astype("float32"), 1)


def study(dem):
    """The text of the study: slope costs on all terrains, factors on level ground."""
    text = STUDY.format(dem=dem)
    weights = {"up_weight": UP_WEIGHT, "down_weight": DOWN_WEIGHT}
    for k, (up, down) in enumerate(LIMITS_DEG):
        for method, neighbours in (("grid", 4), ("grid", 8), ("anytime", 8)):
            text += ROUTE.format(
                id=f"{method}-{neighbours}-{k}", terrains=json.dumps(TERRAINS), pairs=4,
                method=method, neighbours=neighbours, up=up, down=down, **weights,
            )
    level = {"up": 30.0, "down": 30.0, "up_weight": 0.0, "down_weight": 0.0}
    for neighbours in (4, 8):
        text += ROUTE.format(
            id=f"factors-{neighbours}", terrains='["level"]', pairs=10, method="grid", neighbours=neighbours, **level
        )
        text += 'cost = "raster"\ncost_raster = "factors"\n'
    return text


class Ground:
    """Heights of a raster as in the planner: single precision, NaN where there are none."""

    def __init__(self, path):
        with rasterio.open(path) as raster:
            heights = raster.read(1, masked=True).astype(float).filled(math.nan)
            self.transform, self.cell = raster.transform, (raster.transform.a, -raster.transform.e)
        self.heights = heights.astype("float32").astype(float)
        self.free = np.isfinite(self.heights)

    def place(self, x, y):
        """Row and column of the cell whose centre is nearest."""
        row, col = rowcol(self.transform, x, y)
        return int(row), int(col)

    def node(self, x, y):
        row, col = self.place(x, y)
        return row * self.heights.shape[1] + col

    def run_m(self, down, across):
        return math.hypot(across * self.cell[0], down * self.cell[1])

    def shifted(self, values, down, across, fill):
        """The value at the cell that a step leads to."""
        rows, cols = values.shape
        moved = np.full_like(values, fill)
        target = (slice(max(down, 0), rows + min(down, 0)), slice(max(across, 0), cols + min(across, 0)))
        source = (slice(max(-down, 0), rows + min(-down, 0)), slice(max(-across, 0), cols + min(-across, 0)))
        moved[source] = values[target]
        return moved

    def steps(self, down, across, limits_deg):
        """Where a step may be taken, and what it costs."""
        z, run_m = self.heights, self.run_m(down, across)
        around = [self.shifted(z, *offset, math.nan) for offset in ((0, across), (down, 0), (down, across))]
        there = around[2]
        # Bilinear heights along the step; for a step along an axis, the adjacent cells are its ends.
        along = [
            z * (1 - t) ** 2 + (around[0] + around[1]) * t * (1 - t) + there * t**2 if down and across else z + (there - z) * t
            for t in QUARTERS
        ]
        slopes = [(b - a) / (0.25 * run_m) for a, b in zip(along, along[1:])]
        if not (down and across):
            slopes = [(there - z) / run_m]
        up, down_slope = (math.tan(math.radians(deg)) for deg in limits_deg)
        allowed = np.all([(s <= up) & (s >= -down_slope) for s in slopes], axis=0)
        slope = (there - z) / run_m
        per_m = 1 + UP_WEIGHT * np.maximum(slope, 0) + DOWN_WEIGHT * np.maximum(-slope, 0)
        return allowed, np.hypot(run_m, there - z) * per_m

    def digraph(self, neighbours, limits_deg):
        rows, cols = self.heights.shape
        nodes = np.arange(rows * cols).reshape(rows, cols)
        sources, targets, costs = [], [], []
        for down, across in STEPS[neighbours]:
            allowed, cost = self.steps(down, across, limits_deg)
            sources.append(nodes[allowed])
            targets.append(nodes[allowed] + down * cols + across)
            costs.append(cost[allowed])
        edges = (np.concatenate(costs), (np.concatenate(sources), np.concatenate(targets)))
        return csr_matrix(edges, shape=(rows * cols, rows * cols))

    def bilinear(self, rows, cols):
        """Heights at points, whose neighbours may lack a height where they have no weight."""
        filled = np.nan_to_num(np.pad(self.heights, ((0, 1), (0, 1)), mode="edge"))
        r, c = np.floor(rows).astype(int), np.floor(cols).astype(int)
        v, u = rows - r, cols - c
        north = filled[r, c] * (1 - u) + filled[r, c + 1] * u
        south = filled[r + 1, c] * (1 - u) + filled[r + 1, c + 1] * u
        return north * (1 - v) + south * v

    def integrate(self, places):
        """Cost, length in plan and on the ground, and steepest slopes of straight lines from place to place."""
        cost = plan = slant = 0.0
        steepest = [0.0, 0.0]
        for (r0, c0), (r1, c1) in zip(places, places[1:]):
            count = math.ceil(4 * max(abs(r1 - r0), abs(c1 - c0)))
            share = np.linspace(0.0, 1.0, count + 1)
            rise_m = np.diff(self.bilinear(r0 + (r1 - r0) * share, c0 + (c1 - c0) * share))
            run_m = self.run_m(r1 - r0, c1 - c0) / count
            slope, lengths = rise_m / run_m, np.hypot(run_m, rise_m)
            cost += np.sum(lengths * (1 + UP_WEIGHT * np.maximum(slope, 0) + DOWN_WEIGHT * np.maximum(-slope, 0)))
            plan, slant = plan + count * run_m, slant + lengths.sum()
            steepest = [max(steepest[0], slope.max()), max(steepest[1], -slope.min())]
        return [cost, plan, slant, *(math.degrees(math.atan(s)) for s in steepest)]


def close(ours, theirs, what):
    expect(abs(ours - theirs) <= TOLERANCE * max(abs(theirs), 1.0), f"{what}: {ours}, recomputed {theirs}")


def check_slopes(ground, routes, points, found):
    """Costs and outcomes against scipy's, smoothed lines against our integral in numpy."""
    graphs = {}
    for route in routes:
        what = f"{route['terrain_id']}/{route['route_id']}"
        key = (route["neighbours"], (route["max_up_deg"], route["max_down_deg"]))
        if key not in graphs:
            graphs[key] = ground.digraph(*key)
        start, goal = (ground.node(route[f"{end}_x_m"], route[f"{end}_y_m"]) for end in ("start", "goal"))
        least = dijkstra(graphs[key], indices=start)[goal]
        expect(
            (route["outcome"] == "found") == bool(np.isfinite(least)) and route["outcome"] in ("found", "no_path"),
            f"{what}: outcome {route['outcome']}, scipy finds a cost of {least}",
        )
        found[route["outcome"]] += 1
        if route["outcome"] == "found":
            close(route["search_cost_m"], least, f"{what}, search_cost_m")
            check_lines(ground, route, points[route["terrain_id"], route["route_id"]], what)


def check_lines(ground, route, forms, what):
    names = {"searched": ["path_cost_m"]}
    names["smoothed"] = ["smoothed_cost_m", "length_m", "ground_length_m", "steepest_up_deg", "steepest_down_deg"]
    for form, columns in names.items():
        for column, again in zip(columns, ground.integrate([ground.place(*xy) for xy in forms[form]])):
            close(route[column], again, f"{what}, {column}")
    limits = route["max_up_deg"], route["max_down_deg"]
    steepest = route["steepest_up_deg"], route["steepest_down_deg"]
    expect(all(s <= limit + 1e-6 for s, limit in zip(steepest, limits)), f"{what}: steeper than its limits")
    expect(route["smoothed_cost_m"] <= route["path_cost_m"] * (1 + TOLERANCE), f"{what}: smoothing increased the cost")


def check_factors(ground, factors, routes, found):
    """Isotropic costs against scikit-image's, diagonal steps or not."""
    for route in routes:
        start, goal = (ground.place(route[f"{end}_x_m"], route[f"{end}_y_m"]) for end in ("start", "goal"))
        costs, _ = MCP_Geometric(factors, fully_connected=route["neighbours"] == 8, sampling=ground.cell).find_costs([start], [goal])
        close(route["search_cost_m"], costs[goal], f"{route['route_id']}, search_cost_m")
        found["isotropic"] += 1


def check_alone(program, dem, ground, folder, route, points):
    """`navigate` finds for one pair what the study found, as GeoJSON."""
    ends = [f"--{end}={route[f'{end}_x_m']},{route[f'{end}_y_m']}" for end in ("start", "goal")]
    names = {"neighbours": "neighbours", "max_up_deg": "max_up_deg", "max_down_deg": "max_down_deg"}
    sets = [f"{name}={route[column]}" for name, column in names.items()] + [f"up_weight={UP_WEIGHT}", f"down_weight={DOWN_WEIGHT}"]
    call = [program, "navigate", dem, *ends, *(word for one in sets for word in ("--set", one)), "-o", folder / "alone.geojson"]
    subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
    line = json.loads((folder / "alone.geojson").read_text())["features"][0]["geometry"]["coordinates"]
    expect([tuple(point[:2]) for point in line] == points["smoothed"], f"{route['route_id']}: navigate finds another route")


def points_of(release):
    """Easting and northing of the points by route and form."""
    points = {}
    for row in sorted(table(release, "route_points"), key=lambda row: row["point"]):
        forms = points.setdefault((row["terrain_id"], row["route_id"]), {})
        forms.setdefault(row["form"], []).append((row["x_m"], row["y_m"]))
    return points


def main(program, dem, folder):
    with rasterio.open(dem) as like:
        shape = like.shape
        factors = np.exp(np.random.default_rng(7).normal(0.0, 0.8, shape)).astype("float32").astype(float)
        write_raster(folder / "factors.tif", like, factors)
        write_raster(folder / "level.tif", like, np.zeros(shape))
    (folder / "study.toml").write_text(study(dem))
    subprocess.run([program, "run", "study.toml", "-o", "release", "--quiet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    release = folder / "release"
    routes, points = table(release, "routes"), points_of(release)
    found = {"found": 0, "no_path": 0, "isotropic": 0}
    grounds = {"pozo": Ground(dem)} | {name: Ground(release / f"terrain/{name}.tif") for name in TERRAINS[1:]}
    for name, ground in grounds.items():
        check_slopes(ground, [route for route in routes if route["terrain_id"] == name], points, found)
    check_factors(Ground(folder / "level.tif"), factors, [route for route in routes if route["terrain_id"] == "level"], found)
    first = next(r for r in routes if r["terrain_id"] == "pozo" and r["method"] == "grid" and r["outcome"] == "found")
    check_alone(program, dem, grounds["pozo"], folder, first, points["pozo", first["route_id"]])
    return found


if __name__ == "__main__":
    try:
        json.dump(main(*map(Path, sys.argv[1:])), sys.stdout)
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
