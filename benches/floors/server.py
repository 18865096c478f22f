"""titiler in its usual setup: the floor of the bench `server`.

server.py FILE PORT LEVELS serves the tiles of a COG without a reference system, whose side is 256 pixels times a power of two, on
the grid of the terrain server, with 2 workers.
"""

import os
import sys

import pyproj
import rasterio
import uvicorn
from fastapi import FastAPI
from morecantile import TileMatrixSet
from morecantile.defaults import TileMatrixSets
from rasterio.crs import CRS
from titiler.core.factory import TilerFactory

# Any plane in metres.
PLANE = "EPSG:32631"


def application(path, levels):
    with rasterio.open(path) as file:
        extent = list(file.bounds)
    grid = TileMatrixSet.custom(
        extent, pyproj.CRS(PLANE), tile_width=256, tile_height=256, minzoom=0, maxzoom=levels - 1, id="plane"
    )
    made = FastAPI()
    made.include_router(TilerFactory(supported_tms=TileMatrixSets({"plane": grid})).router)
    return made


if __name__ == "__main__":
    path, port, levels = sys.argv[1:]
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="YES") as file:
        file.crs = CRS.from_string(PLANE)
    os.environ["FLOOR_FILE"], os.environ["FLOOR_LEVELS"] = path, levels
    here = os.path.dirname(os.path.abspath(__file__))
    uvicorn.run("server:app", app_dir=here, host="127.0.0.1", port=int(port), workers=2, log_level="error")
elif __name__ == "server":
    app = application(os.environ["FLOOR_FILE"], int(os.environ["FLOOR_LEVELS"]))
