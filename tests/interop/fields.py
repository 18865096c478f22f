"""Snow-like fields on slopes and their local planes, with numpy and scipy only, independent of the program.

Heights are arrays (rows, cols) in m, row 0 in the north, NaN where there is no data; slopes are rise over run, azimuths
clockwise from north.
"""

import numpy as np
from scipy.ndimage import correlate1d

SIGMA_M, RANGE_M = 0.05, 0.28
CELL_M, SIDE_CELLS = 0.06, 256
UNDULATION_M, UNDULATION_LENGTH_M = 0.3, 40.0
HOLE_SHARE = 0.15
TREES, TREE_HEIGHT_M, TREE_RADIUS_M = 6, 0.5, 0.6


def exponential_fields(random):
    """Two independent Gaussian fields of covariance SIGMA_M^2 exp(-lag / RANGE_M), by circulant embedding.

    The torus is twice as wide as the fields; its covariance uses the shortest lag, and its modes are complex and normal, so
    that real and imaginary part are independent.
    """
    torus = 2 * SIDE_CELLS
    lag_m = CELL_M * np.minimum(np.arange(torus), torus - np.arange(torus))
    covariance = SIGMA_M**2 * np.exp(-np.hypot(lag_m[:, None], lag_m) / RANGE_M)
    eigenvalues = np.fft.fft2(covariance).real
    assert eigenvalues.min() > 0.0, "the torus is too small for this covariance"
    modes = random.standard_normal((torus, torus)) + 1j * random.standard_normal((torus, torus))
    field = np.fft.fft2(np.sqrt(eigenvalues) / torus * modes)[:SIDE_CELLS, :SIDE_CELLS]
    return field.real, field.imag


def places_m():
    """East and north of every cell from the middle of the field, m."""
    along = CELL_M * (np.arange(SIDE_CELLS) - 0.5 * (SIDE_CELLS - 1))
    return np.meshgrid(along, -along)


def along_m(azimuth_deg):
    """Distance of every cell along an azimuth, m."""
    east, north = places_m()
    azimuth = np.radians(azimuth_deg)
    return east * np.sin(azimuth) + north * np.cos(azimuth)


def slope_m(slope, azimuth_deg):
    """A plane that rises towards an azimuth."""
    return slope * along_m(azimuth_deg)


def undulation_m(azimuth_deg):
    """A gentle wave along an azimuth."""
    return UNDULATION_M * np.sin(2.0 * np.pi * along_m(azimuth_deg) / UNDULATION_LENGTH_M)


def trees_m(random):
    """Cones at random places."""
    east, north = places_m()
    half = 0.5 * CELL_M * SIDE_CELLS
    cones = np.zeros_like(east)
    for x, y in random.uniform(-half, half, (TREES, 2)):
        cones += TREE_HEIGHT_M * np.maximum(0.0, 1.0 - np.hypot(east - x, north - y) / TREE_RADIUS_M)
    return cones


def holes(random):
    """True at cells without data, at random."""
    return random.uniform(size=(SIDE_CELLS, SIDE_CELLS)) < HOLE_SHARE


def half_windows(window_m, cells_m):
    """Cells on each side of the centre of the odd window nearest to a width, east and south."""
    return [round(0.5 * (window_m / cell_m - 1.0)) for cell_m in cells_m]


def local_planes(heights, half):
    """Least-squares plane through the data of the window around each cell, at its centre, m; the number of these data; and
    the variance of the plane there over that of their mean. NaN where the plane is not unique.

    Windows reach `half` = [east, south] cells. By normal equations whose sums are separable correlations.
    """
    data = np.isfinite(heights)
    middle = heights[data].mean()
    offsets = [np.arange(-h, h + 1.0) for h in half]

    def moment(values, east, south):
        rows = correlate1d(values, offsets[0] ** east, axis=1, mode="constant")
        return correlate1d(rows, offsets[1] ** south, axis=0, mode="constant")

    powers = [(0, 0), (1, 0), (0, 1)]
    ones, above = data.astype(float), np.where(data, heights - middle, 0.0)
    normal = [[moment(ones, a + c, b + d) for c, d in powers] for a, b in powers]
    normal = np.moveaxis(np.array(normal), (0, 1), (-2, -1))
    right = np.stack([moment(above, *power) for power in powers], axis=-1)
    solvable = np.linalg.det(normal) > 0.5
    first = np.full(right.shape, np.nan)
    first[solvable] = np.linalg.inv(normal[solvable])[:, 0]
    count = normal[..., 0, 0]
    return middle + (first * right).sum(axis=-1), count, first[..., 0] * count
