"""Releases: tables, terrains, missions, recordings, and the ground around a vehicle."""

from __future__ import annotations

import json
import os
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from . import _native
from ._errors import SastrugiError
from ._heightfield import Heightfield
from ._kept import Kept
from ._values import INPUT, USAGE, counted, number, optional, pair

MANIFEST = "manifest.json"
# The last is for missions on terrains in none of the others; their column `split` is null.
OTHER = "other"
SPLITS = ("train", "validation", "test", OTHER)
# Bytes of the heightfields and tracks that stay in memory for patches.
GROUND_BYTES = 256 << 20
TRACK_BYTES = 128 << 20
# Tracks of one terrain are read in blocks of consecutive missions with about so many samples.
BLOCK_SAMPLES = 1 << 18
# Bytes of a track without its samples, and of a sample.
TRACK_OVERHEAD_BYTES = 1000
SAMPLE_BYTES = 40


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

    pandas does not ask for it in its constructor: `table.to_pandas()` is the `DataFrame`.

    `table[column]` is a NumPy array: float64 with NaN for null, int64, bool, or objects (text, lists, integers and booleans with nulls). `len(table)` is
    the number of rows; as in pandas, iteration gives the names of the columns, and `in` looks for one.
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

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        # Without this method, NumPy and pandas would take the table for a list of the names of its columns.
        raise TypeError("a table is not one array: use table[column], to_numpy() or to_pandas()")

    def to_numpy(self) -> dict[str, npt.NDArray[Any]]:
        """All columns by name."""
        return {name: self[name] for name in self}

    def to_pandas(self) -> Any:
        """A pandas DataFrame. Needs pandas."""
        return optional("pandas", "pandas", "to_pandas").DataFrame(self.to_numpy())

    def to_rows(self) -> list[dict[str, Any]]:
        """The rows as dicts of Python values, with lists as lists. A float that is null is NaN."""
        columns = {name: _python(values) for name, values in self.to_numpy().items()}
        return [dict(zip(columns, row)) for row in zip(*columns.values())]

    def selecting(self, column: str, text: str) -> Table:
        """The rows with this text in a column."""
        return Table(self._table.selecting(column, text))

    def __repr__(self) -> str:
        return f"Table({self.name}: {counted(len(self), 'row')}, {counted(len(self.columns), 'column')})"


def _objects(values: list[Any]) -> npt.NDArray[Any]:
    array = np.empty(len(values), dtype=object)
    # One by one: lists of equal lengths would become a second dimension.
    for place, value in enumerate(values):
        array[place] = value
    return array


def _python(values: npt.NDArray[Any]) -> list[Any]:
    """The values, including those of lists, as Python objects."""
    return [value.tolist() if isinstance(value, np.ndarray) else value for value in values.tolist()]


class _Columns:
    """The table `missions`, sorted by terrain and mission. A column is read on first access."""

    __slots__ = ("names", "_table", "_order", "_read")

    def __init__(self, table: Table) -> None:
        self.names = list(table)
        self._table = table
        terrains = table["terrain_id"]
        # With splits there are several files. Each is sorted, and has all missions of its terrains.
        is_sorted = bool(np.all(terrains[:-1] <= terrains[1:]))
        self._order = None if is_sorted else np.argsort(terrains, kind="stable")
        self._read = {"terrain_id": self._sorted(terrains)}

    def __len__(self) -> int:
        return len(self["terrain_id"])

    def __getitem__(self, column: str) -> npt.NDArray[Any]:
        if column not in self._read:
            self._read[column] = self._sorted(self._table[column])
        return self._read[column]

    def _sorted(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return values if self._order is None else values[self._order]


class _Row(Mapping[str, Any]):
    """A row of `_Columns`."""

    __slots__ = ("_columns", "_place")

    def __init__(self, columns: _Columns, place: int) -> None:
        self._columns = columns
        self._place = place

    def __getitem__(self, column: str) -> Any:
        if column not in self._columns.names:
            raise KeyError(column)
        return self._columns[column].item(self._place)

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns.names)

    def __len__(self) -> int:
        return len(self._columns.names)

    def __reduce__(self) -> tuple[type[dict[str, Any]], tuple[dict[str, Any]]]:
        # A pickled mission carries its own values, not the columns of all missions.
        return dict, (dict(self),)

    def __repr__(self) -> str:
        return repr(dict(self))


@dataclass(frozen=True)
class Mission:
    """A mission of a release: its key, and its row of the table `missions`, read on access."""

    terrain_id: str
    mission_id: str
    # Neither hashed nor compared: nulls are NaN, which equals nothing. Equal missions have equal keys.
    row: Mapping[str, Any] = field(compare=False)

    @property
    def id(self) -> str:
        """Terrain and mission, as `rough-0001/husky-0003`; accepted wherever a mission is expected."""
        return f"{self.terrain_id}/{self.mission_id}"

    def __getitem__(self, column: str) -> Any:
        return self.row[column]

    def __repr__(self) -> str:
        return f"Mission({self.id}: {self.row['outcome']})"


class Missions(Sequence[Mission]):
    """Missions of a release, sorted by terrain and mission. Each is created on access; `list(missions)` creates all."""

    __slots__ = ("_release", "_split", "_columns", "_places")

    def __init__(self, release: Release, split: str | None, columns: _Columns, places: range | npt.NDArray[np.int64]) -> None:
        self._release = release
        self._split = split
        self._columns = columns
        self._places = places

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, index: int) -> Mission: ...
    @overload
    def __getitem__(self, index: slice) -> list[Mission]: ...
    def __getitem__(self, index: int | slice) -> Mission | list[Mission]:
        if isinstance(index, slice):
            return [_mission(self._columns, int(place)) for place in self._places[index]]
        return _mission(self._columns, int(self._places[index]))

    def __reduce__(self) -> tuple[Callable[..., Missions], tuple[Release, str | None]]:
        # The worker processes of a data loader read the columns for themselves.
        return Release.missions, (self._release, self._split)

    def __repr__(self) -> str:
        split = "" if self._split is None else f" of split {self._split}"
        return f"Missions({self._release.path}: {len(self)}{split})"


def _mission(columns: _Columns, place: int) -> Mission:
    return Mission(columns["terrain_id"][place], columns["mission_id"][place], _Row(columns, place))


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


class _Block(NamedTuple):
    """Missions of a terrain, from the first to the last, whose tracks are read together."""

    terrain_id: str
    first: str
    last: str


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

    >>> import tempfile
    >>> from sastrugi import terrain, traverse
    >>> ground = terrain("multifractal", seed=3, size_px=[320, 300])
    >>> folder = Path(tempfile.mkdtemp()) / "drive"
    >>> release = traverse(ground, folder, missions=2, seed=9, rules={"length_m": 5.0, "border_m": 1.5})
    >>> mission = release.missions()[0]
    >>> release.height_patch(mission, time=0.0, size=4.0, cell=0.1).shape
    (40, 40)
    >>> len(release.samples(mission)) == mission["samples"]
    True
    """

    def __init__(self, path: str | os.PathLike[str], *, summary: dict[str, Any] | None = None) -> None:
        self.path = Path(path)
        self.summary = summary or {}
        if not (self.path / MANIFEST).is_file():
            raise SastrugiError(f"{self.path}: not a release: it has no {MANIFEST}", INPUT)
        self._grounds = Kept(self._read_ground, GROUND_BYTES)
        self._tracks = Kept(self._read_tracks, TRACK_BYTES)

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
        if id not in self._terrains:
            raise self._unknown("terrain", id, list(self._terrains))
        return Heightfield.read(self.path / self._terrains[id])

    def missions(self, split: str | None = None) -> Missions:
        """All missions, or those of a split: train, validation, test, or other (on terrains in none of these).

        Raises SastrugiError (2) for another name, and for a release of a study without `[study] split`.
        """
        columns = self._columns
        if split is None:
            return Missions(self, None, columns, range(len(columns)))
        if split not in SPLITS:
            raise SastrugiError(f"there is no split {split!r}; known: {', '.join(SPLITS)}", USAGE)
        splits = columns["split"].tolist()
        if splits and not any(splits):
            raise SastrugiError(f"{self.path}: its missions are not split; set `[study] split`, or leave out `split`", USAGE)
        wanted = None if split == OTHER else split
        places = [place for place, known in enumerate(splits) if known == wanted]
        return Missions(self, split, columns, np.array(places, dtype=np.int64))

    def samples(self, mission: Mission | str) -> Table:
        """The recorded instants of a mission, in order: the rows of the table `samples`."""
        found = self._mission(mission)
        return Table(_native.Table("samples", [self._samples_of(found.terrain_id)])).selecting("mission_id", found.mission_id)

    def recording(self, mission: Mission | str) -> Recording:
        """The MCAP recording of a mission."""
        return Recording(self.path / self._mission(mission).row["path"])

    def track(self, mission: Mission | str) -> Track:
        """The recorded poses of a mission. Those of other missions on its terrain are read too and kept in memory for later calls.

        Raises SastrugiError (65) for a mission without samples.
        """
        place = self._place(mission)
        block = self._block(place)
        track = self._tracks(block).get(self._columns["mission_id"][place])
        if track is None:
            raise SastrugiError(f"{self._samples_of(block.terrain_id)}: has no samples of {_mission(self._columns, place).id}", INPUT)
        return track

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
        track = self.track(found)
        if not track.time[0] <= time <= track.time[-1]:
            span = f"{track.time[0]:g} to {track.time[-1]:g} s"
            raise SastrugiError(f"`time` is {time!r}; mission {found.id} was recorded from {span}", USAGE)
        x, y, heading = (float(np.interp(time, track.time, values)) for values in (track.x, track.y, track.heading))
        return self._grounds(found.terrain_id).patch((x, y), heading, pair("size", size), cell, relative)

    @cached_property
    def _terrains(self) -> dict[str, str]:
        table = self.table("terrains")
        return dict(zip(table["terrain_id"].tolist(), table["path"].tolist()))

    @cached_property
    def _columns(self) -> _Columns:
        return _Columns(self.table("missions"))

    @cached_property
    def _starts(self) -> npt.NDArray[np.int64]:
        """For each mission, the number of samples of all missions before it."""
        samples = self._columns["samples"]
        starts = np.zeros(len(samples), dtype=np.int64)
        np.cumsum(samples[:-1], out=starts[1:])
        return starts

    def _place(self, mission: Mission | str) -> int:
        """Row of a mission in the table `missions`."""
        id = mission.id if isinstance(mission, Mission) else str(mission)
        terrain_id, _, mission_id = id.partition("/")
        terrains, missions = self._columns["terrain_id"], self._columns["mission_id"]
        wanted = (terrain_id, mission_id)
        place = bisect_left(range(len(missions)), wanted, key=lambda row: (terrains[row], missions[row]))
        if place == len(missions) or (terrains[place], missions[place]) != wanted:
            raise self._unknown("mission", id, [known.id for known in self.missions()[:6]])
        return place

    def _mission(self, mission: Mission | str) -> Mission:
        if isinstance(mission, Mission):
            return mission
        return _mission(self._columns, self._place(mission))

    def _unknown(self, what: str, id: str, known: list[str]) -> SastrugiError:
        some = ", ".join(known[:5]) + (" ..." if len(known) > 5 else "")
        return SastrugiError(f"{self.path}: there is no {what} {id!r}; it has {some or 'none'}", USAGE)

    def _samples_of(self, terrain_id: str) -> str:
        """File of the samples of a terrain."""
        return os.fspath(self.path / "tables" / "samples" / f"part-{terrain_id}.parquet")

    def _read_ground(self, terrain_id: str) -> tuple[_native.Ground, int]:
        heightfield = self.terrain(terrain_id)
        return _native.Ground(heightfield), heightfield.values.nbytes

    def _block(self, place: int) -> _Block:
        """The block of a mission, which starts at a multiple of `BLOCK_SAMPLES` within its terrain."""
        terrains, missions = self._columns["terrain_id"], self._columns["mission_id"]
        first = int(np.searchsorted(terrains, terrains[place], side="left"))
        end = int(np.searchsorted(terrains, terrains[place], side="right"))
        starts = self._starts[first:end]
        low = starts[0] + (self._starts[place] - starts[0]) // BLOCK_SAMPLES * BLOCK_SAMPLES
        begin, stop = (first + int(found) for found in np.searchsorted(starts, (low, low + BLOCK_SAMPLES)))
        return _Block(terrains[place], missions[begin], missions[stop - 1])

    def _read_tracks(self, block: _Block) -> tuple[dict[str, Track], int]:
        samples = _native.Table("samples", [self._samples_of(block.terrain_id)]).between("mission_id", block.first, block.last)
        tracks: dict[str, Track] = {}
        for mission_id, (time, x, y, z, yaw) in samples.runs("mission_id", ["time_s", "x_m", "y_m", "z_m", "yaw_deg"]):
            tracks[mission_id] = Track(time, x, y, z, np.unwrap(np.radians(yaw)))
        return tracks, sum(TRACK_OVERHEAD_BYTES + SAMPLE_BYTES * track.time.size for track in tracks.values())
