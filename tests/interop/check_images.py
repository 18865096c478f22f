"""Renders the surfaces of a release with numpy and compares the result with its images.

    python check_images.py RELEASE

Slopes are central differences for nadir images (one ray per pixel, through the cell's centre), and those of the bilinear patch for
others; brightness, shadows and rays are computed here from the surface and the image's JSON alone. Rays and shadows march in steps of a twentieth
of a cell; only pixels whose shadow or first point depends on less than a step may differ.
"""

import json
import sys
from pathlib import Path

import numpy as np
import rasterio

from common import Mismatch, expect, table

# Heights and brightness are stored in single precision: slopes differ by 1e-7 m over 0.02 m.
TOLERANCE = 2e-5
# Share of pixels that may depend on less than a step.
DOUBTFUL_SHARE = 0.002
STEPS_PER_CELL = 20


class Ground:
    """Heights and albedo, row 0 in the south; bilinear between cell centres, NaN beyond."""

    def __init__(self, release, surface):
        with rasterio.open(release / f"terrain/{surface}.tif") as raster:
            self.z = np.flipud(raster.read(1).astype(float))
            self.cell = raster.res[0]
            self.origin = np.array([raster.bounds.left, raster.bounds.bottom])
        path = release / f"terrain/{surface}.albedo.tif"
        self.albedo = None
        if path.exists():
            with rasterio.open(path) as raster:
                self.albedo = np.flipud(raster.read(1).astype(float))

    def place(self, x, y):
        u, v = (x - self.origin[0]) / self.cell - 0.5, (y - self.origin[1]) / self.cell - 0.5
        rows, cols = self.z.shape
        inside = (u >= -1e-9) & (v >= -1e-9) & (u <= cols - 1 + 1e-9) & (v <= rows - 1 + 1e-9)
        i = np.clip(np.floor(np.where(inside, u, 0)).astype(int), 0, cols - 2)
        j = np.clip(np.floor(np.where(inside, v, 0)).astype(int), 0, rows - 2)
        return inside, i, j, u - i, v - j

    def bilinear(self, grid, x, y):
        inside, i, j, a, b = self.place(x, y)
        south = grid[j, i] * (1 - a) + grid[j, i + 1] * a
        north = grid[j + 1, i] * (1 - a) + grid[j + 1, i + 1] * a
        return np.where(inside, south * (1 - b) + north * b, np.nan)

    def patch_slopes(self, x, y):
        _, i, j, a, b = self.place(x, y)
        east = (self.z[j, i + 1] - self.z[j, i]) * (1 - b) + (self.z[j + 1, i + 1] - self.z[j + 1, i]) * b
        north = (self.z[j + 1, i] - self.z[j, i]) * (1 - a) + (self.z[j + 1, i + 1] - self.z[j, i + 1]) * a
        return east / self.cell, north / self.cell

    def clearance(self, points, direction, steps):
        """Least height of rays above the ground over a number of steps, from 1e-6 m above their start."""
        step = self.cell / STEPS_PER_CELL / max(np.hypot(direction[0], direction[1]), 1e-3)
        lowest = np.full(points.shape[1], np.inf)
        for k in range(1, steps):
            at = points + k * step * direction[:, None]
            above = at[2] + 1e-6 - self.bilinear(self.z, at[0], at[1])
            lowest = np.fmin(lowest, above)
            if np.nanmin(at[2]) > np.nanmax(self.z):
                break
        return lowest


def towards(azimuth_deg, elevation_deg):
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])


def shade(image, slopes, view, albedo):
    """Brightness without cast shadows, I/F."""
    sun = towards(image["sun"]["azimuth_deg"], image["sun"]["elevation_deg"])
    normal = np.array([-slopes[0], -slopes[1], np.ones_like(slopes[0])])
    normal /= np.linalg.norm(normal, axis=0)
    lit, seen = np.tensordot(sun, normal, 1), np.sum(normal * view, axis=0)
    weights = image["photometry"]
    total = weights["lambert"] * lit + weights["lommel_seeliger"] * 2 * lit / np.maximum(lit + seen, 1e-300)
    return image["exposure"] * np.where((lit > 0) & (seen > 0), albedo * total, 0.0) + image["haze"]


def rays(camera):
    """Origin and direction of the ray through the middle of every pixel."""
    cols, rows = np.meshgrid(np.arange(camera["cols"]) + 0.5, np.arange(camera["rows"]) + 0.5)
    right, top = cols.ravel() - camera["cols"] / 2, camera["rows"] / 2 - rows.ravel()
    if camera["kind"] == "pinhole":
        position, target = np.array(camera["position_m"]), np.array(camera["target_m"])
        ahead = (target - position) / np.linalg.norm(target - position)
        focal = camera["cols"] / 2 / np.tan(np.radians(camera["field_of_view_deg"] / 2))
    else:
        ahead = -towards(camera["azimuth_deg"], camera["elevation_deg"])
    up = np.array([0.0, 0.0, 1.0]) if camera["kind"] == "pinhole" else np.array([0.0, 1.0, 0.0])
    axis = np.cross(ahead, up)
    axis /= np.linalg.norm(axis)
    upwards = np.cross(axis, ahead)
    across = axis[:, None] * right + upwards[:, None] * top
    if camera["kind"] == "pinhole":
        direction = across + (ahead * focal)[:, None]
        return np.repeat(position[:, None], right.size, 1), direction / np.linalg.norm(direction, axis=0)
    origin = np.array(camera["centre_m"])[:, None] + across * camera["pixel_m"]
    return origin, np.repeat(ahead[:, None], right.size, 1)


def first_points(ground, origin, direction):
    """Where rays reach the ground, NaN where they do not; and how close they came to it before."""
    if np.all(direction[2] < -0.999999):
        z = ground.bilinear(ground.z, origin[0], origin[1])
        return np.array([origin[0], origin[1], z]), np.full(z.size, np.inf)
    top = np.nanmax(ground.z)
    start = np.where(direction[2] < 0, (top - origin[2]) / direction[2], 0.0)
    start = np.maximum(start, 0.0) if np.ptp(origin, axis=1).max() == 0 else start
    step = ground.cell / STEPS_PER_CELL
    found, nearest = np.full(start.size, np.nan), np.full(start.size, np.inf)
    before = np.full(start.size, np.nan)
    below = np.zeros(start.size, bool)
    reach = int(np.hypot(*(np.array(ground.z.shape) * ground.cell)) * 1.6 / step)
    for k in range(reach):
        at = origin + (start + k * step) * direction
        above = at[2] - ground.bilinear(ground.z, at[0], at[1])
        open_ = np.isnan(found) & ~below
        hit = open_ & (above <= 0) & (before > 0)
        below |= open_ & (above <= 0) & ~hit
        found = np.where(hit, start + (k - 1 + before / np.where(hit, before - above, 1.0)) * step, found)
        nearest = np.where(open_ & ~hit & ~below, np.fmin(nearest, above), nearest)
        before = above
    for _ in range(40):
        at = origin + found * direction
        found = found + 0.5 * (at[2] - ground.bilinear(ground.z, at[0], at[1]))
    return origin + found * direction, nearest


def check_nadir(ground, image, stored):
    rows, cols = ground.z.shape
    expect(stored.shape == (rows, cols), "a pixel is a cell")
    padded = np.pad(ground.z, 1, mode="reflect", reflect_type="odd")
    p = (padded[1:-1, 2:] - padded[1:-1, :-2]) / (2 * ground.cell)
    q = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / (2 * ground.cell)
    albedo = ground.albedo if ground.albedo is not None else image["rendered"]["albedo"]
    view = np.array([0.0, 0.0, 1.0])[:, None, None]
    own = shade(image, (p, q), view, albedo)
    y, x = np.meshgrid(
        ground.origin[1] + (np.arange(rows) + 0.5) * ground.cell,
        ground.origin[0] + (np.arange(cols) + 0.5) * ground.cell,
        indexing="ij",
    )
    points = np.array([x.ravel(), y.ravel(), ground.z.ravel()])
    return compare(ground, image, points, own.ravel(), np.flipud(stored).ravel(), np.full(x.size, np.inf))


def check_oblique(ground, image, stored):
    origin, direction = rays(image["camera"])
    points, nearest = first_points(ground, origin, direction)
    stored = stored.ravel()
    seen = np.isfinite(points[2])
    doubtful = nearest < 2 * ground.cell / STEPS_PER_CELL
    unsure = (seen != np.isfinite(stored)) & ~doubtful
    expect(unsure.mean() <= DOUBTFUL_SHARE, f"{unsure.sum()} of {seen.size} pixels see other ground than these rays")
    both = seen & np.isfinite(stored)
    points, view = points[:, both], -direction[:, both]
    albedo = image["rendered"]["albedo"]
    if ground.albedo is not None:
        albedo = ground.bilinear(ground.albedo, points[0], points[1])
    own = shade(image, ground.patch_slopes(points[0], points[1]), view, albedo)
    return compare(ground, image, points, own, stored[both], nearest[both])


def compare(ground, image, points, own, stored, nearest):
    sun = towards(image["sun"]["azimuth_deg"], image["sun"]["elevation_deg"])
    clearance = ground.clearance(points, sun, 20_000)
    dark = image["haze"]
    own = np.where(clearance < 0, dark, own)
    off = np.abs(own - stored) > TOLERANCE
    share = off.mean()
    expect(share <= DOUBTFUL_SHARE, f"{100 * share:.2f} % of the pixels differ by more than {TOLERANCE}")
    shadow = (clearance < 0).mean()
    expect(shadow > 0.01, "no shadows to compare")
    rms = np.sqrt(np.mean((own - stored)[~off] ** 2))
    return {"pixels": int(own.size), "off": float(share), "shadow": float(shadow), "rms": float(rms)}


def check(release, row):
    image = json.loads((release / f"image/{row['image_id']}.json").read_text())
    ground = Ground(release, row["surface_id"])
    expect(image["noise"] == {"relative": 0.0, "absolute": 0.0}, "noise cannot be compared")
    expect(image["rendered"]["samples"] == 1, "one ray a pixel is compared")
    with rasterio.open(release / row["path"]) as raster:
        expect(raster.dtypes == ("float32",) and raster.nodata == -9999, "float32, no data -9999")
        expect(raster.units == ("1",) and raster.descriptions[0].startswith("brightness"), "unit and description")
        stored = raster.read(1).astype(float)
        stored[stored == raster.nodata] = np.nan
        if row["camera"] == "nadir":
            with rasterio.open(release / f"terrain/{row['surface_id']}.tif") as surface:
                expect(np.allclose(raster.bounds, surface.bounds, atol=1e-9), "the image lies on its surface")
            return check_nadir(ground, image, stored)
    return check_oblique(ground, image, stored)


def main():
    release = Path(sys.argv[1])
    result = {row["image_id"]: check(release, row) for row in table(release, "images")}
    expect({"nadir", "parallel", "pinhole"} == {row["camera"] for row in table(release, "images")}, "all cameras")
    print(json.dumps(result))


if __name__ == "__main__":
    try:
        main()
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
