"""A recovered surface must reproduce its images, and one that the inversion did not use.

    check_reproduced.py RELEASE

Independent of the program: the published law (35 % Lambert, 65 % Lommel-Seeliger with McEwen's factor of 2) shades the recovered heights with
fourth-order finite differences, the recovered albedo multiplies it, and the result is compared with the image of every sun in the release. The RMS
difference must stay below 0.2 % of the mean brightness; level ground of the same albedo must differ 20 times as much, otherwise the images prove nothing.
"""

import json
import sys
from pathlib import Path

import numpy as np
import rasterio

from common import expect

LIMIT, MARGIN = 0.002, 4


def raster(path):
    with rasterio.open(path) as file:
        return file.read(1).astype(float), file.res[0]


def slopes(heights, cell):
    """East and north; rows run south."""
    def along(axis):
        near = np.roll(heights, -1, axis) - np.roll(heights, 1, axis)
        far = np.roll(heights, -2, axis) - np.roll(heights, 2, axis)
        return (8 * near - far) / (12 * cell)

    return along(1), -along(0)


def brightness(p, q, azimuth_deg, elevation_deg):
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    sun = np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)
    length = np.sqrt(1 + p * p + q * q)
    to_sun = (sun[2] - p * sun[0] - q * sun[1]) / length
    to_camera = 1 / length
    return 0.35 * to_sun + 0.65 * 2 * to_sun / (to_sun + to_camera)


def main():
    release = Path(sys.argv[1])
    heights, cell = raster(release / "photoclinometry/recovered.tif")
    albedo, _ = raster(release / "photoclinometry/recovered.albedo.tif")
    inner = (slice(MARGIN, -MARGIN),) * 2
    p, q = slopes(heights, cell)
    images = sorted((release / "image").glob("*.json"))
    expect(len(images) == 4, f"{len(images)} images, not 4")
    for described in images:
        description = json.loads(described.read_text())
        image, pixel = raster(release / "image" / description["image"])
        expect(pixel == cell and image.shape == heights.shape, f"{described.name}: {pixel} m, {image.shape}")
        sun = description["sun"]["azimuth_deg"], description["sun"]["elevation_deg"]

        def error(p, q):
            difference = (albedo * brightness(p, q, *sun) - image)[inner]
            return np.sqrt(np.mean(difference**2)) / image[inner].mean()

        off, level = error(p, q), error(np.zeros_like(p), np.zeros_like(q))
        print(f"{described.stem}: sun {sun}: {100 * off:.3f} % off, level ground {100 * level:.1f} %")
        expect(off < LIMIT, f"{described.stem}: brightness is off by {100 * off:.3f} % (rms)")
        expect(level > 20 * LIMIT, f"{described.stem}: level ground is off by only {100 * level:.3f} %")


main()
