"""Reads the peer's input from a release: terrains, missions, parameters, and the poses that our model recorded."""

import json
import tomllib

import numpy as np
import pyarrow.parquet as pq
import rasterio
from mcap.reader import make_reader


def missions(release):
    """Rows of the table `missions` as dictionaries, in its order."""
    return pq.read_table(release / "tables/missions").to_pylist()


def parameters(release, row):
    """The complete checked parameters of a mission's traverse, as stated in its recording."""
    with open(release / row["path"], "rb") as file:
        records = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    return json.loads(records["vehicle"]["parameters"])


def vehicle(data_file):
    """The parameters of a vehicle's data file."""
    return tomllib.loads(data_file.read_text())["parameters"]


class Terrain:
    """Heights at cell centres, south row first, and where the first of them lies."""

    def __init__(self, heights, cell, x0, y0):
        self.heights, self.cell, self.x0, self.y0 = heights.astype(np.float64), cell, x0, y0

    @classmethod
    def of(cls, release, terrain_id):
        with rasterio.open(release / f"terrain/{terrain_id}.tif") as dataset:
            heights, cell, bounds = np.flipud(dataset.read(1)), dataset.transform.a, dataset.bounds
            assert dataset.transform.e == -cell, "cells are squares, north up"
            assert dataset.nodata is None or not (heights == dataset.nodata).any(), "the terrain has holes"
        return cls(heights, cell, bounds.left + 0.5 * cell, bounds.bottom + 0.5 * cell)

    def height(self, x, y):
        """Bilinear between cell centres."""
        u, v = (np.asarray(x) - self.x0) / self.cell, (np.asarray(y) - self.y0) / self.cell
        rows, cols = self.heights.shape
        i, j = np.clip(u.astype(int), 0, cols - 2), np.clip(v.astype(int), 0, rows - 2)
        fx, fy, h = u - i, v - j, self.heights
        south = h[j, i] + (h[j, i + 1] - h[j, i]) * fx
        north = h[j + 1, i] + (h[j + 1, i + 1] - h[j + 1, i]) * fx
        return south + (north - south) * fy

    def contains(self, x, y):
        rows, cols = self.heights.shape
        return 0 <= x - self.x0 <= (cols - 1) * self.cell and 0 <= y - self.y0 <= (rows - 1) * self.cell


def samples(release, terrain_id):
    """Recorded poses of our model by mission: time, position, quaternion (w, x, y, z), one row per sample."""
    names = ["mission_id", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"]
    table = pq.read_table(release / f"tables/samples/part-{terrain_id}.parquet", columns=names)
    ids = np.array(table["mission_id"].to_pylist())
    poses = np.column_stack([table[name].to_numpy() for name in names[1:]])
    return {mission_id: poses[ids == mission_id] for mission_id in np.unique(ids)}
