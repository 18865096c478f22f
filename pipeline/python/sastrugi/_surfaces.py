"""Generators and measures of surfaces."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from . import _native
from ._heightfield import Heightfield, heights_of
from ._values import numbers, seed_of, to_json, warn


def terrain(kind: str, seed: int = 0, *, inputs: Mapping[str, Any] | None = None, **parameters: Any) -> Heightfield:
    """Generates a terrain, as `sastrugi terrain` does.

    kind: name of a generator (`sastrugi kinds`): multifractal, weierstrass_mandelbrot, planetary, compose ...
    seed: of the random streams; the same kind, seed and parameters give the same heights.
    inputs: heightfields or files that the parameters name, by that name; other names are files.
    parameters: those of the generator; tables as dicts.

    Raises SastrugiError (2) for an unknown kind or parameter, with the nearest known one.

    >>> rough = terrain("multifractal", seed=7, size_px=[90, 70], high={"fractal_dimension": 2.5})
    >>> rough
    Heightfield(70 x 90 cells of 0.05 x 0.05 m, origin (0.0, 0.0))
    >>> terrain("multifractal", size_pxx=[90, 70])
    Traceback (most recent call last):
    sastrugi._errors.SastrugiError: `multifractal` has no parameter `size_pxx`; did you mean `size_px`?
    """
    given: dict[str, Heightfield] = {}
    # Not a comprehension: before Python 3.12 it is a call of its own, and warnings would name this line.
    for name, dem in (inputs or {}).items():
        given[name] = heights_of(dem)
    parts, maps, info = _native.terrain(kind, to_json(parameters), seed_of(seed), given)
    return Heightfield(*parts, maps=maps, notes=json.loads(info)["notes"])


def elaborate(dem: Any, seed: int = 0, **parameters: Any) -> Heightfield:
    """Refines a measured DEM: keeps its posts and adds detail between them, as the generator `elaborate` does.

    dem: a file or a Heightfield, in metres.
    parameters: those of the generator: size_px or size_m, cell_m, origin_m (the south-west sample in the DEM's coordinates) ...

    Notes on how a file was read are issued as warnings.

    Raises SastrugiError: 2 for an unknown parameter or one that is out of range, 65 for a file that cannot be read.

    >>> from sastrugi import Fit
    >>> hills = Fit({"model": "gaussian", "parameters": {"sigma_m": 2.0, "range_m": 12.0}}).texture(120.0, 2.0, seed=2)
    >>> fine = elaborate(
    ...     hills, size_px=[64, 48], cell_m=0.25, origin_m=[50.0, 50.0], basic_spacing_m=0.25, hurst=0.7, roughness_m=0.01)
    >>> fine.shape
    (48, 64)
    """
    # A file is read here rather than by the generator, which would not report how it was read.
    return terrain("elaborate", seed, inputs={"dem": heights_of(dem)}, dem="dem", **parameters)


def roughness(
    dem: Any,
    *,
    cell: float | Sequence[float] | None = None,
    vehicle: str | os.PathLike[str] | None = None,
    band: Sequence[float] | None = None,
    allow_coarse: bool = False,
    **settings: Any,
) -> dict[str, Any]:
    """Measures a surface and returns what `sastrugi roughness --json` prints: heights, slopes, classes, areal parameters, spectra.

    dem: a file, a Heightfield, or an array with `cell`.
    vehicle: name of a vehicle, "wb=WHEELBASE,r=TYRE_RADIUS" in m, or a vehicle file: adds the key `ride`, roughness in its band.
    band: shortest and longest wavelength, m; instead of a vehicle.
    allow_coarse: accept cells larger than half the shortest wavelength.
    settings: those of `[roughness]` in a study: low_max, semi_max, border_m, band_window_m.

    Undefined values are None. Notes on how a file was read are issued as warnings.

    Raises SastrugiError: 2 for an unknown setting or vehicle, 65 for a file that cannot be read, or a surface too small or coarse for the band.

    >>> rough = terrain("multifractal", seed=7, size_px=[90, 70])
    >>> measured = roughness(rough)
    >>> abs(measured["heights"]["relief_m"] - float(rough.values.max() - rough.values.min())) < 1e-12
    True
    """
    limits = numbers("band", band, 2)
    name = None if vehicle is None else os.fspath(vehicle)
    found = _native.roughness(heights_of(dem, cell), to_json(settings), name, limits, allow_coarse)
    described: dict[str, Any] = json.loads(found)
    return described


@dataclass(frozen=True)
class Coregistration:
    """How a DEM B was moved onto a DEM A.

    shift: east and north, m; None if the ground does not determine it.
    raised: m, at the centre of A.
    tilt: east and north, m/m.
    verdict: in one sentence.
    difference: A minus the moved B, on A's cells.
    details: everything that `sastrugi coregister --json` prints about it.
    """

    shift: tuple[float, float] | None
    raised: float
    tilt: tuple[float, float]
    verdict: str
    difference: Heightfield
    details: dict[str, Any]


def _as_it_is(dem: Any) -> Heightfield:
    """A heightfield, or a file in its own coordinates."""
    if isinstance(dem, (str, os.PathLike)):
        parts, notes = _native.read(os.fspath(dem), None, None, False)
        warn(notes, callers=2)
        return Heightfield(*parts)
    return heights_of(dem)


def coregister(a: Any, b: Any) -> Coregistration:
    """Finds the shift, raise and tilt that bring DEM B onto DEM A, and their difference, as `sastrugi coregister` does.

    a, b: files or heightfields, in metres and the same coordinate system. A file in degrees is refused, because conversion to metres loses the
    position of the DEMs relative to each other; heightfields that were read from such files have lost it already.

    Raises SastrugiError (65) for DEMs that cannot be read or co-registered.

    >>> from sastrugi import Fit
    >>> hills = Fit({"model": "gaussian", "parameters": {"sigma_m": 2.0, "range_m": 12.0}}).texture(96.0, 1.0, seed=2)
    >>> moved = Heightfield(hills.values + 5.0, hills.cell, origin=(0.25, 0.0))
    >>> found = coregister(hills, moved)
    >>> abs(found.shift[0] + 0.25) < 0.05 and abs(found.raised + 5.0) < 0.05
    True
    """
    text, parts = _native.coregister(_as_it_is(a), _as_it_is(b))
    found = json.loads(text)
    details = found["coregistration"]
    shift = details["shift_m"]
    return Coregistration(
        shift=None if shift is None else (shift[0], shift[1]),
        raised=details["raise_m"],
        tilt=(details["tilt"][0], details["tilt"][1]),
        verdict=found["verdict"],
        difference=Heightfield(*parts),
        details=details,
    )
