"""Opens exports for simulators with independent readers and compares heights, scale and orientation with the DEM as read by rasterio.

    python check_exports.py DEM.tif FOLDER...    folders that `convert DEM.tif FOLDER --for ...` wrote, and files .glb, .obj, .usda,
                                                 .npy, each of that DEM

Unreal and Unity: the picture or raw file by Pillow and numpy, converted to the program's coordinates with only the numbers that the
import dialogue requires. Gazebo: world.sdf and model.sdf by an XML parser, the picture by Pillow, scaled as gz-rendering scales it,
the collision mesh by trimesh. MuJoCo: its compiler and its rays. Isaac Sim: the OpenUSD library. Meshes: trimesh.
"""

import copy
import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import rasterio
import trimesh
from PIL import Image
from pxr import Usd, UsdGeom, UsdPhysics

from common import Mismatch, expect

# Single precision of coordinates of some hundred metres.
SINGLE = 2e-5


class Dem:
    """Heights at cell centres, x and y counted from the south-west corner."""

    def __init__(self, path):
        with rasterio.open(path) as raster:
            heights = raster.read(1).astype(float)
            heights[raster.read(1) == raster.nodata] = np.nan
            t = raster.transform
        self.corner = (t.c, t.f + t.e * heights.shape[0])
        rows, cols = heights.shape
        self.heights = heights[::-1]
        self.x = (np.arange(cols) + 0.5) * t.a
        self.y = (np.arange(rows) + 0.5) * -t.e

    def points(self):
        """x, y, z of every cell with data."""
        x, y = np.meshgrid(self.x, self.y)
        there = np.isfinite(self.heights)
        return np.column_stack([x[there], y[there], self.heights[there]])

    def window(self, south_west, posts):
        """The part with a number of posts (east, north), starting at a cell centre."""
        (col, row), (cols, rows) = [int(np.argmin(np.abs(a - b))) for a, b in zip((self.x, self.y), south_west)], posts
        part = copy.copy(self)
        part.x, part.y = self.x[col : col + cols], self.y[row : row + rows]
        part.heights = self.heights[row : row + rows, col : col + cols]
        return part

    def ground(self):
        return self.x[-1] - self.x[0], self.y[-1] - self.y[0]


def bilinear(x, y, heights, at_x, at_y):
    """Heights on posts x, y (ascending) at every pair of at_x and at_y."""
    def places(posts, at):
        k = np.clip(np.searchsorted(posts, at, side="right") - 1, 0, len(posts) - 2)
        return k, np.clip((at - posts[k]) / (posts[k + 1] - posts[k]), 0, 1)

    (c, u), (r, v) = places(x, at_x), places(y, at_y)
    rows = heights[r] * (1 - v)[:, None] + heights[r + 1] * v[:, None]
    return rows[:, c] * (1 - u) + rows[:, c + 1] * u


def near(what, found, wanted, tolerance):
    largest = float(np.max(np.abs(np.asarray(found) - np.asarray(wanted))))
    expect(largest <= tolerance, f"{what}: off by {largest}, more than {tolerance}")
    return largest


def check_posts(what, dem, x, y, heights, step, stated):
    """Posts of a height map, ascending, in scene coordinates: within the DEM's extent; on its bilinear surface, to half a step; and at
    the distance from its cell centres that the folder states."""
    for name, found, wanted in [("x", x, dem.x), ("y", y, dem.y)]:
        near(f"{what}: outer posts in {name}", [found[0], found[-1]], [wanted[0], wanted[-1]], 1e-6)
    surface = bilinear(dem.x, dem.y, dem.heights, x, y)
    largest = near(f"{what}: heights", heights, surface, 0.5001 * step + SINGLE)
    off = float(np.max(np.abs(bilinear(x, y, surface, dem.x, dem.y) - dem.heights)))
    expect(abs(off - stated) <= 1e-9 + 1e-6 * off, f"{what}: says {stated} m at the cell centres, is {off}")
    return {"posts": list(heights.shape), "step_m": step, "largest_m": largest, "resampled_m": off}


def check_unreal(folder, dem, numbers):
    """Landscape vertex (i, j) of the picture: location + (i, j) scale in x and y; 1/128 of the z scale a level about 32768."""
    settings = numbers["settings"]
    with Image.open(folder / settings["heightmap"]) as picture:
        expect(picture.mode == "I;16", f"{folder}: the picture is {picture.mode}")
        levels = np.asarray(picture).astype(float)
    size = levels.shape[0]
    expect(levels.shape == (size, size) and size in [127, 253, 505, 1009, 2017, 4033, 8129], f"{folder}: {levels.shape} posts")
    quads = settings["section_quads"] * settings["sections_per_component"][0] * settings["components"][0]
    expect(quads == size - 1, f"{folder}: {quads} quads for {size} posts")
    (sx, sy, sz), (x0, y0, z0) = settings["scale"], settings["location_cm"]
    along = np.arange(size)
    unreal_x, unreal_y, unreal_z = x0 + along * sx, y0 + along * sy, z0 + (levels - 32768) / 128 * sz
    # East is X, north is -Y: rows from the north become rows from the south.
    return check_posts(folder, dem, unreal_x / 100, -unreal_y[::-1] / 100, unreal_z[::-1] / 100, sz / 12800, resampled(numbers))


def check_unity(folder, dem, numbers):
    """Class ImportRawHeightmap: row of the file is z, level / 65536 of the terrain's height."""
    settings = numbers["settings"]
    size = settings["resolution"]
    expect((size - 1) & (size - 2) == 0, f"{folder}: {size} posts a side")
    levels = np.fromfile(folder / settings["raw"], dtype={"Windows": "<u2", "Mac": ">u2"}[settings["byte_order"]])
    levels = levels.reshape(size, size).astype(float)
    levels = levels[::-1] if settings["flip_vertically"] else levels
    (width, height, length), (x, y, z) = settings["terrain_size_m"], settings["position_m"]
    along = np.arange(size) / (size - 1)
    # x is east, z is north, y is up.
    return check_posts(folder, dem, x + along * width, z + along * length, y + levels / 65536 * height, height / 65536, resampled(numbers))


def check_gazebo(folder, dem, numbers):
    """Visual by the renderer's rule: size over 2^n spacings, levels by the brightest. Collision: the mesh at its pose."""
    model = ElementTree.parse(folder / "model.sdf").getroot().find("model")
    world = ElementTree.parse(folder / "world.sdf").getroot().find("world")
    expect(ElementTree.tostring(world.find("model")) == ElementTree.tostring(model), f"{folder}: world and model differ")
    config = ElementTree.parse(folder / "model.config").getroot()
    expect(config.find("sdf").text == "model.sdf", f"{folder}: model.config names {config.find('sdf').text}")

    def pose(element):
        values = [float(word) for word in element.find("pose").text.split()]
        expect(values[3:] == [0, 0, 0], f"{folder}: {element.tag} turns")
        return np.array(values[:3])

    expect(model.find("static").text == "true", f"{folder}: the model moves")
    place = pose(model)
    heightmap = model.find("link/visual/geometry/heightmap")
    expect(heightmap.find("sampling").text == "1" and heightmap.find("pos").text == "0 0 0", f"{folder}: heightmap")
    with Image.open(folder / heightmap.find("uri").text) as picture:
        expect(picture.mode == "I;16", f"{folder}: the picture is {picture.mode}")
        levels = np.asarray(picture).astype(float)
    size = levels.shape[0]
    expect(levels.shape == (size, size) and (size - 1) & (size - 2) == 0, f"{folder}: {levels.shape} posts")
    expect(levels.max() == 65535 and levels.min() == 0, f"{folder}: levels from {levels.min()} to {levels.max()}")
    east, north, up = [float(word) for word in heightmap.find("size").text.split()]
    along = np.arange(size) / (size - 1) - 0.5
    x, y, z = place[0] + along * east, place[1] + along * north, place[2] + levels[::-1] / 65535 * up
    answer = check_posts(folder, dem, x, y, z, up / 65535, resampled(numbers))
    collision = model.find("link/collision")
    mesh = trimesh.load(folder / collision.find("geometry/mesh/uri").text, process=False, maintain_order=True)
    posts = copy.copy(dem)
    posts.x, posts.y = x, y
    posts.heights = bilinear(dem.x, dem.y, dem.heights, x, y)
    check_mesh(f"{folder} collision", posts, np.asarray(mesh.vertices) + place + pose(collision), np.asarray(mesh.faces))
    return answer


def check_mujoco(folder, dem, numbers):
    """Rays from above hit the ground at every post, and on the edge that two triangles share, from south-west to north-east."""
    expect(numbers["fit"]["method"] == "none", f"{folder}: resampled")
    model = mujoco.MjModel.from_xml_path(str(folder / "terrain.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    expect((model.hfield_nrow[0], model.hfield_ncol[0]) == dem.heights.shape, f"{folder}: rows and columns")
    hit = np.zeros(1, np.int32)

    def height(x, y):
        top = dem.heights.max() + 10
        distance = mujoco.mj_ray(model, data, np.array([x, y, top]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
        expect(distance > 0, f"{folder}: no ground at {x}, {y}")
        return top - distance

    # Slightly off each post, within the ground and a triangle, because a ray along an edge may pass between two triangles. The error in
    # height is proportional to the slope.
    hair = 1e-7
    x, y, z = dem.points().T
    x_in, y_in = x + np.where(x < x.max(), hair, -hair), y + np.where(y < y.max(), hair, -hair) / 2
    north, east = np.gradient(dem.heights, dem.y, dem.x)
    steep = max(np.abs(north).max(), np.abs(east).max())
    largest = near(f"{folder}: posts", [height(*point) for point in zip(x_in, y_in)], z, SINGLE + 4 * hair * steep)
    # The middle of four posts lies on the edge that both triangles share.
    middles = [(r, c) for r in range(0, len(dem.y) - 1, 7) for c in range(0, len(dem.x) - 1, 7)]
    found = [height((dem.x[c] + dem.x[c + 1]) / 2 + hair, (dem.y[r] + dem.y[r + 1]) / 2) for r, c in middles]
    rising = [(dem.heights[r, c] + dem.heights[r + 1, c + 1]) / 2 for r, c in middles]
    near(f"{folder}: middles from south-west to north-east", found, rising, SINGLE + 4 * hair * steep)
    beyond = [(x.min() - 0.01, y[0]), (x.max() + 0.01, y[0]), (x[0], y.max() + 0.01)]
    for point in beyond:
        expect(mujoco.mj_ray(model, data, np.array([*point, 1e4]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit) < 0, f"{folder}: {point}")
    return {"posts": list(dem.heights.shape), "largest_m": largest}


def check_mesh(what, dem, vertices, triangles):
    """Vertices are the cells with data; triangles face up and cover the area between three of them."""
    points = dem.points()
    order = lambda p: p[np.lexsort((np.round(p[:, 0], 4), np.round(p[:, 1], 4)))]
    expect(len(vertices) == len(points), f"{what}: {len(vertices)} vertices, {len(points)} cells with data")
    single = float(np.spacing(np.float32(np.abs(points).max())))
    largest = near(f"{what}: vertices", order(vertices), order(points), SINGLE + single)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    up = np.cross(b - a, c - a)[:, 2] / 2
    expect((up > 0).all(), f"{what}: triangles look down")
    there = np.isfinite(dem.heights)
    diagonal = there[1:, :-1] & there[:-1, 1:]
    halves = (diagonal & there[:-1, :-1]).sum() + (diagonal & there[1:, 1:]).sum()
    area = halves * (dem.x[1] - dem.x[0]) * (dem.y[1] - dem.y[0]) / 2
    expect(len(triangles) == halves and abs(up.sum() / area - 1) < 1e-4, f"{what}: covers {up.sum()} m2 instead of {area}")
    return {"vertices": len(vertices), "triangles": len(triangles), "largest_m": largest}


def check_usda(path, dem):
    stage = Usd.Stage.Open(str(path))
    expect(UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdGeom.GetStageUpAxis(stage) == "Z", f"{path}: unit or axis")
    expect(UsdPhysics.GetStageKilogramsPerUnit(stage) == 1, f"{path}: unit of mass")
    expect(stage.GetDefaultPrim().GetPath() == "/Terrain", f"{path}: default prim {stage.GetDefaultPrim()}")
    (prim,) = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    mesh = UsdGeom.Mesh(prim)
    expect(prim.HasAPI(UsdPhysics.CollisionAPI) and prim.HasAPI(UsdPhysics.MeshCollisionAPI), f"{path}: no collision")
    expect(UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get(), f"{path}: collision is off")
    expect(UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "none", f"{path}: collision of another shape")
    expect(mesh.GetSubdivisionSchemeAttr().Get() == "none" and mesh.GetOrientationAttr().Get() == "rightHanded", f"{path}: mesh")
    expect(set(mesh.GetFaceVertexCountsAttr().Get()) == {3}, f"{path}: faces are not triangles")
    problems = []
    ok = UsdGeom.Mesh.ValidateTopology(mesh.GetFaceVertexIndicesAttr().Get(), mesh.GetFaceVertexCountsAttr().Get(), len(mesh.GetPointsAttr().Get()))
    expect(ok if isinstance(ok, bool) else ok[0], f"{path}: topology {ok} {problems}")
    to_world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    points = np.array(mesh.GetPointsAttr().Get(), dtype=float)
    world = np.column_stack([points, np.ones(len(points))]) @ to_world
    low, high = np.array(mesh.GetExtentAttr().Get())
    expect((points.min(axis=0) == low).all() and (points.max(axis=0) == high).all(), f"{path}: extent")
    return check_mesh(path, dem, world[:, :3], np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3))


def check_glb(path, dem):
    """y up: east is x, north is -z."""
    scene = trimesh.load(path, process=False)
    mesh = scene.to_mesh() if hasattr(scene, "to_mesh") else scene
    vertices = np.asarray(mesh.vertices, dtype=float)
    return check_mesh(path, dem, np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]]), np.asarray(mesh.faces))


def check_obj(path, dem):
    """In the DEM's own coordinates."""
    mesh = trimesh.load(path, process=False, maintain_order=True)
    vertices = np.asarray(mesh.vertices, dtype=float) - [*dem.corner, 0]
    return check_mesh(path, dem, vertices, np.asarray(mesh.faces))


def check_npy(path, dem):
    heights = np.load(path)[::-1]
    expect(np.array_equal(heights, dem.heights, equal_nan=True), f"{path}: other heights")
    return {"posts": list(heights.shape)}


def resampled(numbers):
    return numbers["fit"].get("largest_difference_m", 0.0)


def check_numbers(folder, dem, numbers):
    """Statements common to all targets, and the matrix compared with the target's own numbers."""
    scene = numbers["scene"]
    near(f"{folder}: shift", scene["dem_minus_scene_m"], dem.corner, 1e-6)
    near(f"{folder}: south-west post", scene["south_west_post_m"], [dem.x[0], dem.y[0]], 1e-6)
    near(f"{folder}: ground", scene["ground_m"], dem.ground(), 1e-6)
    if numbers["fit"]["method"] == "bilinear":
        lowest, highest = scene["height_min_m"], scene["height_max_m"]
        expect(np.nanmin(dem.heights) - 1e-6 <= lowest < highest <= np.nanmax(dem.heights) + 1e-6, f"{folder}: {lowest}, {highest}")
    else:
        lowest, highest = np.nanmin(dem.heights), np.nanmax(dem.heights)
        near(f"{folder}: heights", [scene["height_min_m"], scene["height_max_m"]], [lowest, highest], 1e-6)
    expect((folder / "README.md").read_text().startswith("# Terrain for "), f"{folder}: README.md")
    matrices = {
        "unreal": [[100, 0, 0, 0], [0, -100, 0, 0], [0, 0, 100, 0]],
        "unity": [[1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]],
    }
    same = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    expect(numbers["scene_to_target"] == matrices.get(numbers["target"], same), f"{folder}: matrix")


FOLDERS = {"unreal": check_unreal, "unity": check_unity, "gazebo": check_gazebo, "mujoco": check_mujoco}
FILES = {".usda": check_usda, ".glb": check_glb, ".obj": check_obj, ".npy": check_npy}


def check(path, dem):
    if not path.is_dir():
        return FILES[path.suffix](path, dem)
    numbers = json.loads((path / "import.json").read_text())
    if numbers["fit"]["method"] == "crop":
        whole, dem = dem, dem.window(numbers["scene"]["south_west_post_m"], numbers["posts"])
        margins = [(whole.x, dem.x), (whole.y, dem.y)]
        off = [abs((part[0] - all_[0]) - (all_[-1] - part[-1])) / (all_[1] - all_[0]) for all_, part in margins]
        expect(max(off) < 1.001, f"{path}: the crop is not in the middle, by {off} cells")
    check_numbers(path, dem, numbers)
    if numbers["target"] == "isaac":
        return check_usda(path / numbers["settings"]["stage"], dem)
    return FOLDERS[numbers["target"]](path, dem, numbers)


def main():
    dem = Dem(sys.argv[1])
    try:
        answers = {path: check(Path(path), dem) for path in sys.argv[2:]}
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(answers, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
