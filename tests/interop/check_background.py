"""Backgrounds of fits compared with local planes in scipy, and textures with the measured covariance added to them.

    check_background.py PROGRAM FOLDER DEM

* `fit --background` of a field on a slope of 60 %, with random holes, a block of them and a jagged border: the same cells
  have a background, and heights agree to 1e-4 of the texture's sigma or the rounding of 32-bit heights.
* The same for DEM, a measured raster without holes, over windows of 1.5 km.
** A fit of DEM with model `empirical`, and textures of it on that background: detrended here, and trimmed like the residual,
  the sum has the measured residual's RMS within 5 %, trimmed and not (mean of 20; one scatters by 0.5 %, so that the mean
  errs by 0.1 %; +1.9 % and -1.3 % measured).
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import rasterio

import fields
from common import Mismatch, expect

# Share of the window that must have data (exclusive), and largest variance of a background over that of a mean.
FILLED_SHARE_MIN, LEVERAGE_MAX = 0.5, 8.0
TOLERANCE_SIGMAS = 1e-4
DEM_OUTER_SCALE_M = 1500.0
REALISATIONS = 20
RMS_TOLERANCE = 0.05


def read(path):
    """Heights as stored, in double precision, NaN where there is no data."""
    with rasterio.open(path) as raster:
        heights = raster.read(1, masked=True)
    return np.where(np.ma.getmaskarray(heights), np.nan, heights.data).astype(float)


class Program:
    def __init__(self, program, folder):
        self.program, self.folder = program, Path(folder)

    def run(self, *words):
        call = [self.program, *map(str, words), "--quiet"]
        done = subprocess.run(call, cwd=self.folder, capture_output=True, text=True)
        expect(done.returncode == 0, f"{' '.join(map(str, call))}: exit code {done.returncode}: {done.stderr}")

    def fit(self, dem, outer_scale_m, *options):
        """Fit and background of a DEM, from which no objects are removed."""
        words = ["--outer-scale", outer_scale_m, "--bootstrap", 0, "--set", "find_objects=false", *options]
        self.run("fit", dem, *words, "--background", "background.tif", "--output", "fit.json")
        return json.loads((self.folder / "fit.json").read_text()), read(self.folder / "background.tif")

    def textured(self, shape, cell_m, seed):
        """A texture of the fit on the background."""
        east_m, north_m = shape[1] * cell_m[0], shape[0] * cell_m[1]
        words = ["--set", f"cell_m=[{cell_m[0]},{cell_m[1]}]", "--size", f"{east_m}x{north_m}", "--seed", seed]
        self.run("texture", "fit.json", "--onto", "background.tif", *words, "--output", "sum.tif")
        return read(self.folder / "sum.tif")


def usable(half, count, leverage, slack=0.0):
    """Where a window has enough data, and the plane through it is not extrapolated too far."""
    area = np.prod([2 * h + 1 for h in half])
    return (count > FILLED_SHARE_MIN * area) & (leverage <= LEVERAGE_MAX + slack)


def sloping_field():
    """A field on a slope of 60 %, with random holes, a hole of 3 m and a border that cuts across."""
    random = np.random.default_rng([2026, 0])
    heights = fields.exponential_fields(random)[0] + fields.slope_m(0.6, 33.0)
    heights[fields.holes(random)] = np.nan
    heights[100:150, 120:170] = np.nan
    row, col = np.indices(heights.shape)
    heights[row + 2 * col < 150] = np.nan
    return heights


def check_background(name, heights, half, background, sigma_m):
    """Largest difference of a background from the local planes, m."""
    expected, count, leverage = fields.local_planes(heights, half)
    clear = usable(half, count, leverage, slack=-1e-6)
    expect(bool(np.isfinite(background[clear]).all()), f"{name}: some complete enough windows have no background")
    extrapolated = ~(leverage <= LEVERAGE_MAX + 1e-6)
    expect(bool(np.isnan(background[extrapolated]).all()), f"{name}: planes beyond the limit are used")
    partial = clear & (count < np.prod([2 * h + 1 for h in half]))
    expect(int(partial.sum()) > 10_000, f"{name}: only {partial.sum()} partial windows")
    worst_m = float(np.abs(background - expected)[clear].max())
    rounding_m = float(np.spacing(np.float32(np.nanmax(np.abs(heights)))))
    limit_m = max(TOLERANCE_SIGMAS * sigma_m, rounding_m)
    expect(worst_m <= limit_m, f"{name}: backgrounds differ by up to {worst_m} m, limit {limit_m} m")
    return worst_m


def residual(heights, half):
    background, count, leverage = fields.local_planes(heights, half)
    return np.where(usable(half, count, leverage), heights - background, np.nan)


def rms(left, threshold_m):
    """RMS of a residual, trimmed and not."""
    left = left[np.isfinite(left)]
    return np.array([np.sqrt(np.mean(values**2)) for values in (left[np.abs(left) <= threshold_m], left)])


def check_textures(program, fit, heights, half):
    """RMS of background and texture, detrended and trimmed, over that of the measured residual: mean and scatter."""
    threshold_m, cell_m = fit["trim"]["threshold_m"], fit["cell_m"]
    measured = rms(residual(heights, half), threshold_m)
    sums = (program.textured(heights.shape, cell_m, seed) for seed in range(REALISATIONS))
    ratios = np.array([rms(residual(heights, half), threshold_m) / measured for heights in sums])
    mean = ratios.mean(axis=0)
    expect(bool(np.all(np.abs(mean - 1.0) <= RMS_TOLERANCE)), f"textures restore {mean} of the RMS (trimmed, not trimmed)")
    return {"mean": list(mean), "scatter": list(ratios.std(axis=0, ddof=1))}


def main(program, folder, dem):
    program = Program(program, folder)
    heights = sloping_field()
    np.save(program.folder / "slope.npy", heights)
    _, background = program.fit("slope.npy", 2.0, "--cell", fields.CELL_M)
    half = fields.half_windows(2.0, [fields.CELL_M] * 2)
    figures = {"slope_worst_m": check_background("slope", heights, half, background, fields.SIGMA_M)}

    heights = read(dem)
    fit, background = program.fit(dem, DEM_OUTER_SCALE_M, "--model", "empirical")
    half = fields.half_windows(DEM_OUTER_SCALE_M, fit["cell_m"])
    sigma_m = np.sqrt(fit["covariance_m2"][0])
    figures["dem_worst_m"] = check_background("measured DEM", heights, half, background, sigma_m)
    figures["restored_rms"] = check_textures(program, fit, heights, half)
    print(json.dumps(figures))


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} PROGRAM FOLDER DEM")
    try:
        main(*sys.argv[1:])
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
