"""check_server.py HOST:PORT: GDAL's own drivers read what the terrain server serves.

/vsicurl reads a COG by ranges, the TMS mini-driver of WMS reads map tiles, numpy reads .npy and raw samples, Pillow decodes PNG; all of them
see the same ground.
"""

import io
import json
import sys
import urllib.request

import numpy as np
import rasterio
from PIL import Image
from rasterio.windows import Window

base = f"http://{sys.argv[1]}/v1"
collection = json.load(urllib.request.urlopen(f"{base}/collections"))["collections"][0]
own = f"{base}/collections/{collection['id']}"


def get(path):
    with urllib.request.urlopen(f"{own}/{path}") as answer:
        return answer.read(), answer.headers


# --- formats of one patch ---------------------------------------------------------------------------------------------------------------
patch = "patch?origin=-3,1&size=600,500&resolution_m=0.02"
raw, headers = get(f"{patch}&format=raw")
rows, cols = int(headers["grid-rows"]), int(headers["grid-columns"])
heights = np.frombuffer(raw, "<f4").reshape(rows, cols)
assert (rows, cols) == (500, 600)
npy = np.load(io.BytesIO(get(f"{patch}&format=npy")[0]))
assert np.array_equal(npy.astype("f4"), heights)
png, headers = get(f"{patch}&format=png")
levels = np.asarray(Image.open(io.BytesIO(png))).astype(float)
# "heights are A m + B m x level; level 0 is no data"
words = headers["grid-note"].split()
offset, step = float(words[2]), float(words[5])
assert np.abs(offset + step * levels - heights).max() <= 0.51 * step + 1e-7 * np.abs(heights).max()

# --- the COG, by ranges ------------------------------------------------------------------------------------------------------------------
with rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"):
    with rasterio.open(f"/vsicurl/{own}/{patch}&format=tif") as cog:
        assert cog.profile["tiled"] and cog.overviews(1), cog.profile
        assert np.array_equal(cog.read(1), heights)
        assert np.array_equal(cog.read(1, window=Window(300, 200, 50, 40)), heights[200:240, 300:350])
        west, south = [float(v) for v in get(f"{patch}&format=raw")[1]["grid-origin-m"].split(",")]
        assert np.allclose((cog.bounds.left + 0.01, cog.bounds.bottom + 0.01), (west, south), atol=1e-9), cog.bounds
        assert np.allclose(cog.res, 0.02)

# --- map tiles by the TMS mini-driver -------------------------------------------------------------------------------------------------------
grid = collection["tile_grid"]
(west, north), level = grid["origin_m"], grid["levels"] - 1
side = 256 * grid["resolutions_m"][level]
size = int(grid["matrix_sizes"][level][0]) * 256
template = f"{own}/styles/terrarium/map/tiles/{collection['id']}/${{z}}/${{y}}/${{x}}"
service = f"""<GDAL_WMS><Service name="TMS"><ServerUrl>{template}</ServerUrl></Service>
<DataWindow><UpperLeftX>{west}</UpperLeftX><UpperLeftY>{north}</UpperLeftY>
<LowerRightX>{west + 256 * grid['matrix_sizes'][level][0] * grid['resolutions_m'][level]}</LowerRightX>
<LowerRightY>{north - 256 * grid['matrix_sizes'][level][1] * grid['resolutions_m'][level]}</LowerRightY>
<TileLevel>{level}</TileLevel><TileCountX>1</TileCountX><TileCountY>1</TileCountY><YOrigin>top</YOrigin></DataWindow>
<BlockSizeX>256</BlockSizeX><BlockSizeY>256</BlockSizeY><BandsCount>4</BandsCount><Projection></Projection></GDAL_WMS>"""
col, row = int((0 - west) // side), int((north - 2) // side)
with rasterio.open(service) as tms:
    assert tms.width == size, (tms.width, size)
    red, green, blue, opaque = tms.read(window=Window(256 * col - 100, 256 * row + 30, 300, 200)).astype(float)
assert (opaque == 255).all()
seen = red * 256 + green + blue / 256 - 32768
step = grid["resolutions_m"][level]
for r, c in [(0, 0), (199, 299), (77, 100), (150, 250)]:
    x, y = west + (256 * col - 100 + c + 0.5) * step, north - (256 * row + 30 + r + 0.5) * step
    point = json.loads(get(f"point?x={x}&y={y}&feature_min_m={2 * step}")[0])
    assert abs(seen[r, c] - point["elevation_m"]) <= 0.5 / 256 + 1e-4, (seen[r, c], point)

# --- the description ------------------------------------------------------------------------------------------------------------------------
api = json.load(urllib.request.urlopen(f"{base}/openapi.json"))
assert api["openapi"].startswith("3.1") and "/v1/collections/{id}/patch" in api["paths"]
for path, media in [("", "application/json"), ("/conformance", "application/json"), ("/tileMatrixSets", "application/json")]:
    with urllib.request.urlopen(base + path) as answer:
        assert answer.headers["content-type"] == media
        for link in json.load(answer).get("links", []):
            assert link["type"] and urllib.request.urlopen(link["href"]).status == 200, link
matrix = json.load(urllib.request.urlopen(f"{base}/tileMatrixSets/{collection['id']}"))["tileMatrices"][level]
assert np.isclose(matrix["cellSize"], step) and matrix["cornerOfOrigin"] == "topLeft"
print("the server: COG by ranges, TMS, npy, raw and PNG agree")
