"""Fits of numpy fields with the noise of dense image matching, estimated in a smooth part of the same DEM.

    check_noise.py PROGRAM FOLDER

Sixteen fields: an exponential texture in the west, a plane road in the east, both on a slope of 10 %. Matching noise is simulated as
it arises in matching, as white noise averaged over a square patch of 5 cells (its correlation is triangular, not the Gaussian that the
fit assumes), plus white noise. With the road as noise reference, sigma and b must be those of the texture, up to the effect of the
different correlation. One field of 256 x 192 cells scatters by 2.6 % and 5.7 %, a mean of sixteen by 0.65 % and 1.4 %. Measured here:
-0.2 % and -5.3 %, so that the shape costs some 4 % of b; the limits are 4 % and 10 %. Without the reference (four fields) sigma is
too large by more than 5 % (measured: 9 %, and b is 16 % too small).
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter

import fields
from common import Mismatch, expect

FIELDS, WITHOUT_REFERENCE = 16, 4
PATCH_CELLS, ROAD_CELLS = 5, 64
WHITE_M, MATCHING_M = 0.01, 0.02
LIMITS_PERCENT = np.array([4.0, 10.0])
TRUTH = np.array([fields.SIGMA_M, fields.RANGE_M])


def matching_noise(random):
    """Noise of patches of PATCH_CELLS, MATCHING_M in each cell, and white noise."""
    pixels = random.standard_normal((fields.SIDE_CELLS, fields.SIDE_CELLS))
    patches = uniform_filter(pixels, PATCH_CELLS, mode="wrap") * PATCH_CELLS
    return MATCHING_M * patches + WHITE_M * random.standard_normal(pixels.shape)


def polygon(west_m, east_m):
    """GeoJSON of a strip of the field, in its own metres."""
    side_m = fields.SIDE_CELLS * fields.CELL_M
    ring = [[west_m, 0.0], [east_m, 0.0], [east_m, side_m], [west_m, side_m], [west_m, 0.0]]
    return json.dumps({"type": "Polygon", "coordinates": [ring]})


class Fitter:
    def __init__(self, program, folder):
        self.program, self.folder = program, Path(folder)
        middle_m = (fields.SIDE_CELLS - ROAD_CELLS) * fields.CELL_M
        (self.folder / "snow.geojson").write_text(polygon(0.0, middle_m))
        (self.folder / "road.geojson").write_text(polygon(middle_m, middle_m + ROAD_CELLS * fields.CELL_M))

    def fit(self, dem, *more):
        file = self.folder / "fit.json"
        options = ["--cell", str(fields.CELL_M), "--outer-scale", "2", "--bootstrap", "0", "--mask", "snow.geojson"]
        call = [self.program, "fit", dem, *options, *more, "--quiet", "--output", str(file)]
        done = subprocess.run(call, capture_output=True, text=True, cwd=self.folder)
        expect(done.returncode == 0, f"exit code {done.returncode}: {done.stderr}")
        fit = json.loads(file.read_text())
        file.unlink()
        return fit

    def errors(self, number):
        """Errors of sigma and b, percent, with and without the reference; and the estimated noise."""
        random = np.random.default_rng([1019, number])
        texture = fields.exponential_fields(random)[0]
        texture[:, -ROAD_CELLS:] = 0.0
        dem = texture + fields.slope_m(0.1, 45.0 * number) + matching_noise(random)
        np.save(self.folder / "dem.npy", dem)
        stated = self.fit("dem.npy", "--noise-reference", "road.geojson")
        noise = stated["source"]["noise_reference"]
        found = [noise["sigma_m"], noise["correlated_sigma_m"], noise["correlated_range_m"]]
        without = self.errors_of(self.fit("dem.npy")) if number < WITHOUT_REFERENCE else np.full(2, np.nan)
        return [*self.errors_of(stated), *without, *found]

    @staticmethod
    def errors_of(fit):
        parameters = fit["parameters"]
        return 100.0 * (np.array([parameters["sigma_m"], parameters["range_m"]]) / TRUTH - 1.0)


def main(program, folder):
    fitter = Fitter(program, folder)
    mean = np.nanmean([fitter.errors(number) for number in range(FIELDS)], axis=0)
    print(f"sigma and b with the reference {mean[:2].round(2)} %, without {mean[2:4].round(2)} %")
    print(f"white noise {mean[4]:.4f} m, correlated {mean[5]:.4f} m over {mean[6]:.3f} m")
    expect(np.all(np.abs(mean[:2]) <= LIMITS_PERCENT), f"sigma and b are off by {mean[:2]} %, limits {LIMITS_PERCENT} %")
    expect(mean[2] > 5.0, f"without a reference, noise changes sigma by only {mean[2]} %")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} PROGRAM FOLDER")
    try:
        main(*sys.argv[1:])
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
