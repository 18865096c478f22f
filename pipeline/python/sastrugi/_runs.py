"""Studies, missions, routes and logs."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._errors import SastrugiError
from ._heightfield import Heightfield, heights_of
from ._release import Release
from ._values import USAGE, numbers, refuse_stated, seed_of, to_json, warn

Progress = Callable[[int, int, str], object]
"""`progress(done, total, what)`: number of items done and in total, and what just happened."""


def run(
    study: str | os.PathLike[str],
    output: str | os.PathLike[str] = "release",
    *,
    work: str | os.PathLike[str] | None = None,
    replace: bool = False,
    progress: Progress | None = None,
) -> Release:
    """Runs a study file and returns its release, as `sastrugi run` does; items that an earlier run finished are not recomputed.

    output: folder of the release.
    work: work area; by default the output's name with `.work`.
    replace: also replace a release of another study, or one with fewer failed items.
    progress: called as `progress(done, total, what)` on this thread; an exception in it ends the run.

    Items that failed are listed in `release.summary["failures"]`. Settings that are allowed but implausible give warnings. On Ctrl-C no
    further item starts; the work area stays busy until the items in progress have ended. Another call resumes from there.

    Raises SastrugiError: 2 for an invalid study (each error with its place), 65 for input data that cannot be used, 75 for a busy work area.

    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "study.toml").write_text('''
    ... [study]
    ... name = "two-hills"
    ... seed = 7
    ... date = "2026-01-01"
    ... [[terrain]]
    ... id = "hill"
    ... kind = "multifractal"
    ... count = 2
    ... size_px = [90, 70]
    ... ''')
    >>> release = run(folder / "study.toml", folder / "release")
    >>> release.summary["computed"], [str(id) for id in release.table("terrains")["terrain_id"]]
    (4, ['hill-0001', 'hill-0002'])
    >>> release.terrain("hill-0001").shape
    (70, 90)
    """
    done = _native.run(os.fspath(study), os.fspath(output), _path(work), replace, progress)
    return _released(done)


def traverse(
    dem: str | os.PathLike[str] | Heightfield,
    output: str | os.PathLike[str] = "release",
    *,
    vehicle: str | os.PathLike[str] = "husky_a200",
    missions: int = 20,
    seed: int = 0,
    replicates: int | None = None,
    rules: Mapping[str, Any] | None = None,
    roughness: Mapping[str, Any] | None = None,
    date: str = "1970-01-01",
    work: str | os.PathLike[str] | None = None,
    replace: bool = False,
    progress: Progress | None = None,
    **parameters: Any,
) -> Release:
    """Drives missions over a DEM and returns their release, as `sastrugi traverse` does.

    dem: a file in metres, or a Heightfield, with cells small enough for the vehicle's wheels.
    vehicle: name of a vehicle (`sastrugi kinds`), or a vehicle file.
    replicates: starts per mission, to estimate the probability of success.
    rules: keys of `[[missions]]`, such as length_m.
    roughness: keys of `[roughness]`, which decide where missions may start and end.
    parameters: keys of `[[traverse]]`.

    Raises SastrugiError: 2 for an unknown key, 65 for a DEM that cannot be used, 75 for a busy work area.

    >>> from sastrugi import terrain
    >>> ground = terrain("multifractal", seed=3, size_px=[320, 300])
    >>> driven = traverse(ground, Path(tempfile.mkdtemp()) / "drive", missions=2, seed=9, rules={"length_m": 5.0, "border_m": 1.5})
    >>> len(driven.missions()), driven.summary["failures"]
    (2, [])
    """
    refuse_stated(rules or {}, count="missions")
    more = {} if replicates is None else {"replicates": replicates}
    request = to_json({
        "seed": seed_of(seed),
        "vehicle": os.fspath(vehicle),
        "missions": {"count": missions, **(rules or {})},
        "parameters": {**more, **parameters},
        "roughness": dict(roughness or {}),
        "date": date,
    })
    with _as_file(dem) as path:
        return _released(_native.traverse(path, request, os.fspath(output), _path(work), replace, progress))


@dataclass(frozen=True)
class Route:
    """A planned route.

    points: array (points, 3): x, y in the DEM's coordinates and height, m.
    metrics: lengths, cost, steepest slopes.
    notes: how the DEM was read.
    """

    points: npt.NDArray[np.float64]
    metrics: dict[str, float]
    notes: tuple[str, ...]


def navigate(
    dem: str | os.PathLike[str] | Heightfield,
    start: Sequence[float],
    goal: Sequence[float],
    output: str | os.PathLike[str] | None = None,
    *,
    method: str = "grid",
    vehicle: str | os.PathLike[str] | None = None,
    obstacles: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    formation: str | None = None,
    team: Mapping[str, Any] | None = None,
    date: str = "1970-01-01",
    work: str | os.PathLike[str] | None = None,
    replace: bool = False,
    progress: Progress | None = None,
    **parameters: Any,
) -> Route | Release:
    """Plans a route over a DEM, as `sastrugi navigate` does. A folder as output becomes a release, optionally with a team on the route.

    start, goal: (x, y) in the DEM's own coordinates.
    output: None or a name that ends in .geojson returns a `Route`; another name is the folder of a `Release`.
    method: grid, roadmap, theta_star or anytime; its parameters as keywords.
    vehicle: whose slope limits apply; otherwise slopes up to 30 degrees.
    obstacles: one or several GeoJSON files of polygons, or rasters.
    formation, team: formation of a team that follows the route, and its parameters; they need a folder as output.

    Raises SastrugiError (65) if there is no route.

    >>> from sastrugi import Fit
    >>> hills = Fit({"model": "gaussian", "parameters": {"sigma_m": 0.5, "range_m": 12.0}}).texture(96.0, 1.0, seed=2)
    >>> route = navigate(hills, (10.0, 10.0), (70.0, 60.0))
    >>> route.points.shape[1], route.metrics["length_m"] > 76.0
    (3, True)
    """
    if team is not None and formation is None:
        raise SastrugiError("`team` needs a `formation`", USAGE)
    refuse_stated(team or {}, formation="formation")
    request = to_json({
        "start": numbers("start", start, 2),
        "goal": numbers("goal", goal, 2),
        "vehicle": _path(vehicle),
        "obstacles": _paths(obstacles),
        "route": {"method": method, **parameters},
        "team": None if formation is None else {"formation": formation, **(team or {})},
        "date": date,
    })
    with _as_file(dem) as path, tempfile.TemporaryDirectory() as folder:
        place = os.path.join(folder, "route.geojson") if output is None else os.fspath(output)
        done = _native.navigate(path, request, place, _path(work), replace, progress)
        if not place.lower().endswith((".geojson", ".svg")):
            return _released(done)
        found = json.loads(done)
        points = [] if place.lower().endswith(".svg") else _line(Path(place))
        return Route(np.array(points, dtype=np.float64).reshape(-1, 3), found["route"], tuple(found["notes"]))


def analyze(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    dem: str | os.PathLike[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    *,
    topic: str | None = None,
    body_frame: str | None = None,
    fixed_frame: str | None = None,
    rate_hz: float | None = None,
    band_hz: Sequence[float] | None = None,
    differentiator: str | None = None,
    offset_m: Sequence[float] | None = None,
    group: str | None = None,
) -> list[dict[str, Any]]:
    """Computes traversal metrics from MCAP logs of any origin, as `sastrugi analyze --json` prints them: one row per log, with `notes`.

    paths: one or several MCAP files, or folders of ROS 2 bags.
    dem: ground under the logs, for clearance and classes.
    output: Parquet file to write the rows to.
    topic: of the poses; otherwise chosen by message type.
    body_frame, fixed_frame: for poses given as transforms; by default base_link and the root of the transforms.
    rate_hz, band_hz, differentiator: how accelerations are computed: rate of the samples and band, Hz; second_difference or gradient.
    offset_m: (x, y, z), added to the poses to place them on the DEM.
    group: label of the rows.

    Raises SastrugiError (65) for the first log that cannot be used.

    >>> from sastrugi import terrain
    >>> ground = terrain("multifractal", seed=3, size_px=[320, 300])
    >>> driven = traverse(ground, Path(tempfile.mkdtemp()) / "drive", missions=2, seed=9, rules={"length_m": 5.0, "border_m": 1.5})
    >>> rows = analyze([driven.recording(mission) for mission in driven.missions()])
    >>> len(rows), "max_pitch_deg" in rows[0]
    (2, True)
    """
    settings = to_json({
        "topic": topic,
        "body_frame": body_frame,
        "fixed_frame": fixed_frame,
        "rate_hz": rate_hz,
        "band_hz": numbers("band_hz", band_hz, 2),
        "differentiator": differentiator,
        "offset_m": numbers("offset_m", offset_m, 3),
        "group": group,
    })
    found = _native.analyze(_paths(paths), _path(dem), settings, _path(output))
    return [{**one["log"], "notes": one["notes"]} for one in json.loads(found)]


def _path(path: str | os.PathLike[str] | None) -> str | None:
    return None if path is None else os.fspath(path)


def _paths(paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[str]:
    """One path, or several."""
    every = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    return [os.fspath(path) for path in every]


def _released(done: str) -> Release:
    summary = json.loads(done)
    warn(summary.pop("warnings"), callers=2)
    return Release(summary["output"], summary=summary)


@contextmanager
def _as_file(dem: str | os.PathLike[str] | Heightfield) -> Iterator[str]:
    """The file of a DEM; a heightfield is written to a temporary one."""
    if isinstance(dem, (str, os.PathLike)):
        yield os.fspath(dem)
        return
    heights = heights_of(dem)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "heightfield.tif")
        heights.save(path)
        yield path


def _line(path: Path) -> list[list[float]]:
    features = json.loads(path.read_text(encoding="utf-8"))["features"]
    line: list[list[float]] = features[0]["geometry"]["coordinates"]
    return line
