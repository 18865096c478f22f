"""Releases: tables, terrains, missions, recordings, and the ground around a vehicle."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _native
from ._errors import SastrugiError
from ._heightfield import Heightfield
from ._values import INPUT, USAGE, number, pair

MANIFEST = "manifest.json"
SPLITS = ("train", "validation", "test")
# Terrains and tracks that stay in memory for patches.
GROUNDS_KEPT = 16
TRACKS_KEPT = 256


class Column(NamedTuple):
    """A column of a table."""

    name: str
    type: str
    unit: str
    description: str


class Table:
    """A table of a release, or some of its rows; the Arrow PyCapsule interface hands it to other libraries without a copy.

        pyarrow.table(table)
        polars.DataFrame(table)
        duckdb.sql("select outcome, count(*) from table group by outcome")

    `table[column]` is a NumPy array: float64 with NaN for null, int64, or objects (text, lists, columns with nulls). `len(table)` is the number of
    rows; as in pandas, iteration gives the names of the columns, and `in` looks for one.
    """

    __slots__ = ("_table",)

    def __init__(self, table: _native.Table) -> None:
        self._table = table

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)

    def __arrow_c_schema__(self) -> object:
        return self._table.__arrow_c_schema__()

    @property
    def name(self) -> str:
        """Name of the table."""
        return self._table.name

    @property
    def columns(self) -> list[Column]:
        """Columns, with type, unit and description."""
        return [Column(*column) for column in self._table.columns()]

    def __len__(self) -> int:
        return self._table.rows()

    def __getitem__(self, column: str) -> npt.NDArray[Any]:
        values = self._table.column(column)
        if isinstance(values, np.ndarray):
            return values
        return _objects(values)

    def __iter__(self) -> Iterator[str]:
        """The names of the columns."""
        return iter(column.name for column in self.columns)

    def __contains__(self, column: object) -> bool:
        return any(known.name == column for known in self.columns)

    def to_numpy(self) -> dict[str, npt.NDArray[Any]]:
        """All columns by name."""
        return {name: self[name] for name in self}

    def to_rows(self) -> list[dict[str, Any]]:
        """The rows as dicts of Python values."""
        columns = {name: values.tolist() for name, values in self.to_numpy().items()}
        return [dict(zip(columns, row)) for row in zip(*columns.values())]

    def selecting(self, column: str, text: str) -> Table:
        """The rows with this text in a column."""
        return Table(self._table.selecting(column, text))

    def __repr__(self) -> str:
        return f"Table({self.name}: {len(self)} rows, {len(self.columns)} columns)"


def _objects(values: list[Any]) -> npt.NDArray[Any]:
    array = np.empty(len(values), dtype=object)
    # One by one: lists of equal lengths would become a second dimension.
    for place, value in enumerate(values):
        array[place] = value
    return array


@dataclass(frozen=True)
class Mission:
    """A mission of a release: its key, and its row of the table `missions`."""

    terrain_id: str
    mission_id: str
    # Neither hashed nor compared: nulls are NaN, which equals nothing. Equal missions have equal keys.
    row: dict[str, Any] = field(compare=False)

    @property
    def id(self) -> str:
        """Terrain and mission, as `rough-0001/husky-0003`; accepted wherever a mission is expected."""
        return f"{self.terrain_id}/{self.mission_id}"

    def __getitem__(self, column: str) -> Any:
        return self.row[column]

    def __repr__(self) -> str:
        return f"Mission({self.id}: {self.row['outcome']})"


@dataclass(frozen=True)
class PoseStream:
    """Poses of one body in a recording.

    time_ns: array (n,) of int64, ns since 1970-01-01 UTC.
    position: array (n, 3), m.
    orientation: array (n, 4), quaternions (x, y, z, w), fixed frame from body.
    """

    topic: str
    frame: str
    body: str
    time_ns: npt.NDArray[np.int64]
    position: npt.NDArray[np.float64]
    orientation: npt.NDArray[np.float64]


class Recording:
    """An MCAP file, of a release or of any origin that `analyze` reads."""

    __slots__ = ("path",)

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def poses(self) -> list[PoseStream]:
        """Every stream of poses and transforms, in the order of the file."""
        return [PoseStream(**stream) for stream in _native.recording(os.fspath(self.path))]

    def __repr__(self) -> str:
        return f"Recording({self.path})"


class Track(NamedTuple):
    """The recorded poses of a mission: arrays (samples,), s, m and rad; the heading is continuous."""

    time: npt.NDArray[np.float64]
    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    z: npt.NDArray[np.float64]
    heading: npt.NDArray[np.float64]


class Release:
    """A sealed folder that `run`, `traverse` or the program wrote.

    path: the folder.
    summary: items, computed, failures and notes of the run that wrote it; empty for a release that was opened.

    Raises SastrugiError (65) for a folder that is not a release.
    """

    def __init__(self, path: str | os.PathLike[str], *, summary: dict[str, Any] | None = None) -> None:
        self.path = Path(path)
        self.summary = summary or {}
        if not (self.path / MANIFEST).is_file():
            raise SastrugiError(f"{self.path}: not a release: it has no {MANIFEST}", INPUT)
        self._ground = lru_cache(GROUNDS_KEPT)(self._read_ground)
        self._track = lru_cache(TRACKS_KEPT)(self._read_track)

    def __repr__(self) -> str:
        return f"Release({self.path})"

    def __reduce__(self) -> tuple[type[Release], tuple[Path]]:
        # The worker processes of a data loader open it for themselves.
        return Release, (self.path,)

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What each file was made from, and its checksum."""
        path = self.path / MANIFEST
        try:
            content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise SastrugiError(f"{path}: not a manifest: {error}", INPUT) from None
        return content

    @property
    def tables(self) -> list[str]:
        """Names of the tables that it has."""
        tables = self.path / "tables"
        if not tables.is_dir():
            raise SastrugiError(f"{tables}: no such folder; the release is incomplete", INPUT)
        return sorted(folder.name for folder in tables.iterdir() if folder.is_dir())

    def table(self, name: str) -> Table:
        """A table; empty if the release does not have it.

        Raises SastrugiError (2) for a name that no release has.
        """
        folder = self.path / "tables" / name
        return Table(_native.Table(name, [os.fspath(part) for part in sorted(folder.glob("*.parquet"))]))

    def terrain(self, id: str) -> Heightfield:
        """A heightfield of the release: a terrain, a measured DEM in metres, or a texture.

        Raises SastrugiError (2) for an id that it does not have.
        """
        return Heightfield.read(self.path / self._terrains[self._known("terrain", id, self._terrains)])

    def missions(self, split: str | None = None) -> list[Mission]:
        """All missions, or those of a split: train, validation or test.

        Raises SastrugiError (2) for another name, and for a release of a study without `[study] split`.
        """
        every = list(self._missions.values())
        if split is None:
            return every
        if split not in SPLITS:
            raise SastrugiError(f"there is no split {split!r}; known: {', '.join(SPLITS)}", USAGE)
        if every and not any(mission.row["split"] for mission in every):
            raise SastrugiError(f"{self.path}: its missions are not split; set `[study] split`, or leave out `split`", USAGE)
        return [mission for mission in every if mission.row["split"] == split]

    def samples(self, mission: Mission | str) -> Table:
        """The recorded instants of a mission, in order: the rows of the table `samples`."""
        found = self._mission(mission)
        part = self.path / "tables" / "samples" / f"part-{found.terrain_id}.parquet"
        return Table(_native.Table("samples", [os.fspath(part)])).selecting("mission_id", found.mission_id)

    def recording(self, mission: Mission | str) -> Recording:
        """The MCAP recording of a mission."""
        return Recording(self.path / self._mission(mission).row["path"])

    def track(self, mission: Mission | str) -> Track:
        """The recorded poses of a mission."""
        return self._track(self._mission(mission).id)

    def height_patch(
        self,
        mission: Mission | str,
        time: float,
        size: float | Sequence[float],
        cell: float,
        *,
        relative: bool = True,
    ) -> npt.NDArray[np.float64]:
        """The ground around the vehicle at an instant, turned with its heading: row 0 lies ahead, column 0 to the left.

        time: s since the mission's start; poses between samples are interpolated.
        size: along and across the heading, m; one number for a square.
        cell: distance between samples, m; each side is a whole number of them, centred on base_link.
        relative: heights above the ground under base_link; otherwise as in the terrain.

        Returns an array (rows, columns) of heights, m, bilinear between the cells of the terrain; NaN outside it and next to holes.

        Raises SastrugiError (2) for a time before or after the mission, or a size that is not a whole number of cells.
        """
        found, time = self._mission(mission), number("time", time)
        track = self._track(found.id)
        if not track.time[0] <= time <= track.time[-1]:
            span = f"{track.time[0]:g} to {track.time[-1]:g} s"
            raise SastrugiError(f"`time` is {time!r}; mission {found.id} was recorded from {span}", USAGE)
        x, y, heading = (float(np.interp(time, track.time, values)) for values in (track.x, track.y, track.heading))
        return self._ground(found.terrain_id).patch((x, y), heading, pair("size", size), cell, relative)

    @cached_property
    def _terrains(self) -> dict[str, str]:
        table = self.table("terrains")
        return dict(zip(table["terrain_id"].tolist(), table["path"].tolist()))

    @cached_property
    def _missions(self) -> dict[str, Mission]:
        rows = self.table("missions").to_rows()
        missions = (Mission(row["terrain_id"], row["mission_id"], row) for row in rows)
        return {mission.id: mission for mission in sorted(missions, key=lambda m: (m.terrain_id, m.mission_id))}

    def _mission(self, mission: Mission | str) -> Mission:
        if isinstance(mission, Mission):
            return mission
        return self._missions[self._known("mission", mission, self._missions)]

    def _known(self, what: str, id: str, known: dict[str, Any]) -> str:
        if id not in known:
            some = ", ".join(list(known)[:5]) + (" ..." if len(known) > 5 else "")
            raise SastrugiError(f"{self.path}: there is no {what} {id!r}; it has {some or 'none'}", USAGE)
        return id

    def _read_ground(self, terrain_id: str) -> _native.Ground:
        return _native.Ground(self.terrain(terrain_id))

    def _read_track(self, mission_id: str) -> Track:
        samples = self.samples(mission_id)
        heading = np.unwrap(np.radians(samples["yaw_deg"]))
        return Track(samples["time_s"], samples["x_m"], samples["y_m"], samples["z_m"], heading)
