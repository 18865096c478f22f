"""Rough-terrain datasets that reproduce bit for bit, and the statistics to compare them.

The same input gives the same bytes as the program `sastrugi`, which this package contains too. Lengths are in m, and row 0 of a heightfield is
north. Parameters have the names that they have in a study; `sastrugi kinds` lists them with units, defaults and sources.

>>> import sastrugi
>>> snow = sastrugi.Fit({"model": "exponential", "parameters": {"sigma_m": 0.05, "range_m": 0.2}})
>>> site = snow.texture(size=(16.0, 12.0), cell=0.1, seed=1, phase="gaussian", periodic=False)
>>> site
Heightfield(120 x 160 cells of 0.1 x 0.1 m, origin (0.0, 0.0))
>>> found = sastrugi.fit(site, outer_scale=1.0, bootstrap=0)
>>> found.model
'exponential'
"""

from ._client import TerrainClient
from ._errors import SastrugiError
from ._fit import Fit, fit
from ._heightfield import Heightfield
from ._native import __version__
from ._release import Column, Mission, Missions, PoseStream, Recording, Release, Table, Track
from ._runs import Route, analyze, navigate, run, traverse
from ._surfaces import Coregistration, coregister, elaborate, roughness, terrain

__all__ = [
    "Column",
    "Coregistration",
    "Fit",
    "Heightfield",
    "Mission",
    "Missions",
    "PoseStream",
    "Recording",
    "Release",
    "Route",
    "SastrugiError",
    "Table",
    "TerrainClient",
    "Track",
    "__version__",
    "analyze",
    "coregister",
    "elaborate",
    "fit",
    "navigate",
    "roughness",
    "run",
    "terrain",
    "traverse",
]
