"""The client of the terrain server, against the program's own server."""

import subprocess

import numpy as np
import pytest
from conftest import program

import sastrugi

WORLD = """
kind = "planetary"
seed = 11
size_px = [300, 200]
cell_m = 0.02
basic_spacing_m = 0.005
origin_m = [-1.0, 2.0]
processes = [
    { kind = "texture" },
    { kind = "rocks", coverage = 0.118 },
    { kind = "albedo" },
]
"""
PROCESSES = [{"kind": "texture"}, {"kind": "rocks", "coverage": 0.118}, {"kind": "albedo"}]


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("server")
    (folder / "world.toml").write_text(WORLD)
    command = [program(), "serve", "--listen", "127.0.0.1:0", "world.toml"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        address = process.stdout.readline().strip()
        assert address.startswith("http://")
        yield sastrugi.TerrainClient(address)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_patches_are_those_of_the_generator(client):
    (world,) = client.collections()
    assert world["id"] == "world" and "albedo" in world["fields"]
    patch = client.patch("world", origin=(-1.0, 2.0), size=(60, 40), resolution=0.02)
    made = sastrugi.terrain(
        "planetary", seed=11, size_px=[60, 40], cell_m=0.02, basic_spacing_m=0.005, origin_m=[-1.0, 2.0], processes=PROCESSES)
    assert patch.shape == (40, 60) and np.array_equal(patch.values, made.values.astype(np.float32))
    assert np.allclose(patch.origin, made.origin) and np.allclose(patch.cell, made.cell)
    albedo = client.patch("world", origin=(-1.0, 2.0), size=(60, 40), resolution=0.02, field="albedo")
    assert np.array_equal(albedo.values, made.maps["albedo"].astype(np.float32))
    bare = client.patch("world", origin=(-1.0, 2.0), size=(60, 40), resolution=0.02, phenomena=[])
    assert np.ptp(bare.values) < np.ptp(patch.values)


def test_points_and_profiles(client):
    patch = client.patch("world", origin=(0.0, 3.0), size=(4, 4), resolution=0.02)
    assert np.float32(client.point("world", 0.0, 3.0)["elevation_m"]) == patch.values[-1, 0]
    profile = client.profile("world", [(0.0, 3.0), (2.0, 3.0)], 5, resolution_m=0.02, feature_min_m=0)
    assert profile["x_m"] == [0.0, 0.5, 1.0, 1.5, 2.0] and set(profile["y_m"]) == {3.0}
    points = [client.point("world", x, 3.0)["elevation_m"] for x in profile["x_m"]]
    assert np.allclose(profile["elevation_m"], points, rtol=0.0, atol=1e-5) and np.ptp(points) > 0.01


def test_errors_carry_the_servers_sentence(client):
    with pytest.raises(sastrugi.SastrugiError, match="^404: ") as refused:
        client.patch("mars", origin=(0.0, 0.0), size=(4, 4))
    assert refused.value.code == 65
    with pytest.raises(sastrugi.SastrugiError, match="^400: ") as refused:
        client.patch("world", origin=(0.0, 0.0), size=(0, 4))
    assert refused.value.code == 2
    for wrong in ["nonsense", "", "http://", "http://a:b", "ftp://a"]:
        with pytest.raises(sastrugi.SastrugiError, match="is not the address of a server; expected http://HOST:PORT") as refused:
            sastrugi.TerrainClient(wrong)
        assert refused.value.code == 2
    with pytest.raises(sastrugi.SastrugiError, match="`resolution` must be a number, got 'fine'"):
        client.patch("world", origin=(0.0, 0.0), size=(4, 4), resolution="fine")
    nobody = sastrugi.TerrainClient("http://127.0.0.1:9")
    with pytest.raises(sastrugi.SastrugiError, match="http://127.0.0.1:9: no answer") as refused:
        nobody.collections()
    assert refused.value.code == 75
