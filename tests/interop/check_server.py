"""check_server.py HOST:PORT: GDAL's own drivers read what the terrain server serves.

/vsicurl reads a COG by ranges, the TMS mini-driver of WMS and the driver OGCAPI read map tiles, numpy reads .npy and raw samples, Pillow
decodes PNG; all of them read the same ground. The links of OGC API - Tiles lead to what they describe, and morecantile places tiles as the server does.
"""

import ctypes
import io
import json
import sys
import urllib.error
import urllib.request

import numpy as np
import pyogrio
import rasterio
from morecantile import Tile, TileMatrixSet
from PIL import Image
from pyproj import CRS
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


def service(layer):
    template = f"{own}/styles/{layer}/map/tiles/{collection['id']}/${{z}}/${{y}}/${{x}}"
    return f"""<GDAL_WMS><Service name="TMS"><ServerUrl>{template}</ServerUrl></Service>
<DataWindow><UpperLeftX>{west}</UpperLeftX><UpperLeftY>{north}</UpperLeftY>
<LowerRightX>{west + 256 * grid['matrix_sizes'][level][0] * grid['resolutions_m'][level]}</LowerRightX>
<LowerRightY>{north - 256 * grid['matrix_sizes'][level][1] * grid['resolutions_m'][level]}</LowerRightY>
<TileLevel>{level}</TileLevel><TileCountX>1</TileCountX><TileCountY>1</TileCountY><YOrigin>top</YOrigin></DataWindow>
<BlockSizeX>256</BlockSizeX><BlockSizeY>256</BlockSizeY><BandsCount>4</BandsCount><Projection></Projection></GDAL_WMS>"""


col, row = int((0 - west) // side), int((north - 2) // side)
window = Window(256 * col - 100, 256 * row + 30, 300, 200)
with rasterio.open(service("terrarium")) as tms:
    assert tms.width == size, (tms.width, size)
    red, green, blue, opaque = tms.read(window=window).astype(float)
assert (opaque == 255).all()
seen = red * 256 + green + blue / 256 - 32768
step = grid["resolutions_m"][level]
for r, c in [(0, 0), (199, 299), (77, 100), (150, 250)]:
    x, y = west + (256 * col - 100 + c + 0.5) * step, north - (256 * row + 30 + r + 0.5) * step
    point = json.loads(get(f"point?x={x}&y={y}&feature_min_m={2 * step}")[0])
    assert abs(seen[r, c] - point["elevation_m"]) <= 0.5 / 256 + 1e-4, (seen[r, c], point)

# --- map tiles by the driver OGCAPI ------------------------------------------------------------------------------------------------------
def ogcapi(window):
    """What GDAL reads of the first layer, given only the address of the collection: it finds the tiles by itself.

    rasterio's GDAL lacks the driver. pyogrio's has it, but pyogrio does not open rasters: hence the C interface.
    """
    gdal = ctypes.CDLL(pyogrio._io.__file__)
    gdal.GDALOpenEx.restype = ctypes.c_void_p
    options = (ctypes.c_char_p * 4)(b"API=TILES", b"IMAGE_FORMAT=PNG", b"CACHE=NO", None)
    raster, read, byte = 0x02, 0, 1
    dataset = ctypes.c_void_p(gdal.GDALOpenEx(f"OGCAPI:{own}".encode(), raster, None, options, None))
    assert dataset, "GDAL does not open the collection"
    seen = np.zeros((4, window.height, window.width), "u1")
    place = window.flatten()
    nothing = ctypes.c_void_p()
    assert gdal.GDALDatasetRasterIO(dataset, read, *place, seen.ctypes.data_as(ctypes.c_void_p), *place[2:], byte, 4, nothing, 0, 0, 0) == 0
    gdal.GDALClose(dataset)
    return seen


with rasterio.open(service(collection["layers"][0])) as tms:
    shown = tms.read(window=window)
assert shown.std() > 1 and np.array_equal(ogcapi(window), shown)

# --- the links of OGC API - Tiles --------------------------------------------------------------------------------------------------------
OGC = "http://www.opengis.net/def/rel/ogc/1.0/"
met = {}


def fetch(href, media):
    """The body behind a link, which has the stated type; empty if a tile has no data."""
    if (href, media) not in met:
        with urllib.request.urlopen(href) as answer:
            body = answer.read()
            assert (answer.status, answer.headers["content-type"]) in [(200, media), (204, None)], (href, media, answer.status, answer.headers)
        met[href, media] = body
    return met[href, media]


def resources(document):
    """Everything in a document that has links."""
    if isinstance(document, dict):
        if "links" in document:
            yield document
        document = list(document.values())
    for part in document if isinstance(document, list) else []:
        yield from resources(part)


def target(resource, relation):
    """The only link with a relation."""
    (link,) = [link for link in resource["links"] if link["rel"] == relation]
    return link


def follow(link):
    return json.loads(fetch(link["href"], link["type"]))


def refusal_of(link, matrix, row, col):
    """The sentence with which a tile is refused with 404; `None` if it is served, or empty."""
    try:
        fetch(link["href"].format(tileMatrix=matrix["id"], tileRow=row, tileCol=col), link["type"])
    except urllib.error.HTTPError as refusal:
        assert refusal.code == 404, link
        return json.load(refusal)["detail"]


def fill(link, tile_set):
    """Fetches the tiles in the middle of the coarsest and the finest level, and requests those beyond the last row and column."""
    matrices = follow(target(tile_set, OGC + "tiling-scheme"))["tileMatrices"]
    for matrix in [matrices[0], matrices[-1]]:
        rows, cols = matrix["matrixHeight"], matrix["matrixWidth"]
        # docs/server.md: one encoding has a range that is narrower than the relief of a planet.
        refusal = refusal_of(link, matrix, rows // 2, cols // 2)
        assert refusal is None or (matrix is matrices[0] and "outside the range of `elevation`" in refusal), refusal
        for row, col in [(rows, 0), (0, cols)]:
            assert "no such tile" in refusal_of(link, matrix, row, col)


def walk(link):
    """Follows all links reachable from one."""
    body = fetch(link["href"], link["type"])
    for resource in resources(json.loads(body)):
        for further in resource["links"]:
            if further.get("templated"):
                fill(further, resource)
            elif (further["href"], further["type"]) not in met:
                walk(further)


def relations(resource):
    return {link["rel"] for link in resource["links"]}


walk({"href": base, "type": "application/json"})
landing = json.loads(met[base, "application/json"])
assert {"self", "service-desc", OGC + "conformance", "data", OGC + "tiling-schemes"} <= relations(landing), landing
conforms = set(follow(target(landing, OGC + "conformance"))["conformsTo"])
tiles_1 = "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/"
assert {tiles_1 + name for name in ["core", "tileset", "tilesets-list", "png"]} <= conforms, conforms
(listed,) = follow(target(landing, "data"))["collections"]
assert listed == follow(target(listed, "self"))
lists = [link for link in listed["links"] if link["rel"] == OGC + "tilesets-map"]
assert len(lists) == len(listed["layers"]), listed["links"]
for tile_sets in map(follow, lists):
    for tile_set in tile_sets["tilesets"]:
        assert {"self", "item", OGC + "tiling-scheme"} <= relations(tile_set), tile_set
        assert tile_set == follow(target(tile_set, "self")) and tile_set["dataType"] == "map" and tile_set["crs"]
for listed_set in follow(target(landing, OGC + "tiling-schemes"))["tileMatrixSets"]:
    assert listed_set["id"] == follow(target(listed_set, "self"))["id"]
assert sum(media == "image/png" for _, media in met) >= 2 * (len(lists) - 1), sorted(met)

# --- the tile matrix set, by morecantile -------------------------------------------------------------------------------------------------
matrix_set = follow(target(tile_set, OGC + "tiling-scheme"))
scheme = TileMatrixSet.model_validate(matrix_set)
plane = CRS(scheme.crs.to_wkt())
assert plane.is_engineering and [(axis.direction, axis.unit_name) for axis in plane.axis_info] == [("east", "metre"), ("north", "metre")], plane
assert (scheme.minzoom, scheme.maxzoom) == (0, level)
for zoom, col, row in [(0, 0, 0), (5, 20, 11), (11, 1030, 1017), (level, 32768, 32767)]:
    left, bottom, right, top = scheme.xy_bounds(Tile(col, row, zoom))
    pixels = np.asarray(Image.open(io.BytesIO(get(f"styles/terrarium/map/tiles/{collection['id']}/{zoom}/{row}/{col}")[0]))).astype(float)
    for r, c in [(0, 0), (3, 250), (255, 255)]:
        x, y = left + (c + 0.5) / 256 * (right - left), top - (r + 0.5) / 256 * (top - bottom)
        point = json.loads(get(f"point?x={x}&y={y}&feature_min_m={(right - left) / 128}")[0])
        height = pixels[r, c, :3] @ [256, 1, 1 / 256] - 32768
        assert abs(height - point["elevation_m"]) <= 0.5 / 256 + 1e-4, (zoom, r, c, height, point)

# --- the description ------------------------------------------------------------------------------------------------------------------------
api = json.load(urllib.request.urlopen(f"{base}/openapi.json"))
assert api["openapi"].startswith("3.1") and "/v1/collections/{id}/patch" in api["paths"]
matrix = matrix_set["tileMatrices"][level]
assert np.isclose(matrix["cellSize"], step) and matrix["cornerOfOrigin"] == "topLeft"
print("the server: COG by ranges, TMS, OGCAPI, npy, raw and PNG agree; its links and tile matrix set hold")
