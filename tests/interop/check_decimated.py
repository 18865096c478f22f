"""Decimated meshes of a DEM: the stated error holds at every cell centre, and the triangles cover the right area.

    check_decimated.py DEM.tif STATED.json FILE...

STATED.json is the output of `convert --json` for one of the files, which are all decimated in the same way: .obj and .glb are read by
trimesh, .usda by OpenUSD. The error is measured triangle by triangle, in barycentric coordinates.
"""

import json
import sys
from pathlib import Path

import numpy as np
import trimesh
from check_exports import SINGLE, Dem
from common import Mismatch, expect
from pxr import Usd, UsdGeom


def load(path, dem):
    """Vertices from the south-west corner, x east, y north, z up, and triangles."""
    if path.suffix == ".usda":
        stage = Usd.Stage.Open(str(path))
        (prim,) = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
        mesh = UsdGeom.Mesh(prim)
        return np.array(mesh.GetPointsAttr().Get(), dtype=float), np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    mesh = trimesh.load(path, process=False, maintain_order=True)
    mesh = mesh.to_mesh() if hasattr(mesh, "to_mesh") else mesh
    vertices = np.asarray(mesh.vertices, dtype=float)
    if path.suffix == ".glb":
        return np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]]), np.asarray(mesh.faces)
    return vertices - [*dem.corner, 0], np.asarray(mesh.faces)


def errors(dem, vertices, triangles):
    """Vertical distance of every post from the mesh; NaN where there is no triangle."""
    found = np.full(dem.heights.shape, np.nan)
    for a, b, c in vertices[triangles]:
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        cols = np.flatnonzero((dem.x > low[0] - 1e-4) & (dem.x < high[0] + 1e-4))
        rows = np.flatnonzero((dem.y > low[1] - 1e-4) & (dem.y < high[1] + 1e-4))
        x, y = np.meshgrid(dem.x[cols], dem.y[rows])
        twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        expect(twice > 0, "a triangle looks down")
        v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / twice
        w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / twice
        inside = (v > -1e-4) & (w > -1e-4) & (v + w < 1 + 1e-4)
        error = np.abs(dem.heights[np.ix_(rows, cols)] - (a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2])))
        part = found[np.ix_(rows, cols)]
        found[np.ix_(rows, cols)] = np.where(inside, np.fmax(part, error), part)
    return found


def covered(dem):
    """Posts that are corners of a triangle between neighbours, and the area of these triangles, m2."""
    there = np.isfinite(dem.heights)
    diagonal = there[1:, :-1] & there[:-1, 1:]
    corners = np.zeros_like(there)
    halves = 0
    # Rows run from south to north: the common side from north-west to south-east.
    for half in (diagonal & there[:-1, :-1], diagonal & there[1:, 1:]):
        halves += half.sum()
        corners[1:, :-1] |= half
        corners[:-1, 1:] |= half
    corners[:-1, :-1] |= diagonal & there[:-1, :-1]
    corners[1:, 1:] |= diagonal & there[1:, 1:]
    return corners, halves * (dem.x[1] - dem.x[0]) * (dem.y[1] - dem.y[0]) / 2


def check(path, dem, stated):
    vertices, triangles = load(path, dem)
    expect((len(vertices), len(triangles)) == (stated["vertices"], stated["triangles"]), f"{path}: {len(vertices)}, {len(triangles)}")
    found = errors(dem, vertices, triangles)
    corners, area = covered(dem)
    expect(np.isfinite(found[corners]).all(), f"{path}: posts without a triangle")
    largest, rms = found[corners].max(), np.sqrt((found[corners] ** 2).mean())
    single = SINGLE + 2 * float(np.spacing(np.float32(np.nanmax(np.abs(dem.heights)))))
    expect(abs(largest - stated["error_max_m"]) < single, f"{path}: {largest} m off, not {stated['error_max_m']}")
    expect(abs(rms - stated["error_rms_m"]) < single, f"{path}: {rms} m RMS, not {stated['error_rms_m']}")
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    meshed = np.cross(b - a, c - a)[:, 2].sum() / 2
    expect(abs(meshed / area - 1) < 1e-4, f"{path}: covers {meshed} m2 instead of {area}")
    return {"triangles": len(triangles), "error_max_m": largest, "error_rms_m": rms}


def main():
    dem, stated = Dem(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text())["mesh"]
    try:
        answers = {path: check(Path(path), dem, stated) for path in sys.argv[3:]}
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(answers, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
