"""Heightfields: NumPy arrays with a place on the ground."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._errors import SastrugiError
from ._values import USAGE, heights, numbers, optional, pair, warn

if TYPE_CHECKING:
    import matplotlib.axes
    import xarray


class Heightfield:
    """Heights on a regular grid.

    Row 0 is north: `values[row, column]` is the height at (`x[column]`, `y[row]`), where `x` increases eastwards with the column and `y`
    decreases southwards with the row. A value belongs to the centre of its cell. Holes are NaN.

    values: array (rows, columns) of float64, m; masked cells (`numpy.ma`) become NaN.
    cell: size of a cell east-west and north-south, m.
    origin: south-west corner of the south-west cell (x, y), m.
    crs: coordinate system stated by a file, passed on when saving; None for a local plane.
    maps: further rasters that a generator made on the same cells, by name.
    notes: what was noted while reading or generating it.

    >>> import numpy as np
    >>> ramp = Heightfield(np.array([[2.0, 3.0], [0.0, 1.0]]), cell=0.5, origin=(10.0, 20.0))
    >>> ramp.x, ramp.y
    (array([10.25, 10.75]), array([20.75, 20.25]))
    >>> ramp.size
    (1.0, 1.0)
    >>> float(np.mean(ramp))
    1.5
    """

    __slots__ = ("_values", "cell", "origin", "crs", "maps", "notes")

    _values: npt.NDArray[np.float64]
    cell: tuple[float, float]
    origin: tuple[float, float]
    crs: _native.Crs | None
    maps: dict[str, npt.NDArray[np.float64]]
    notes: tuple[str, ...]

    def __init__(
        self,
        values: npt.ArrayLike,
        cell: float | Sequence[float],
        origin: Sequence[float] = (0.0, 0.0),
        crs: _native.Crs | None = None,
        *,
        maps: Mapping[str, npt.NDArray[np.float64]] | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        self._values = heights(values)
        self.cell = pair("cell", cell)
        self.origin = pair("origin", origin)
        self.crs = crs
        self.maps = dict(maps or {})
        self.notes = tuple(notes)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        cell: float | Sequence[float] | None = None,
        window: Sequence[float] | None = None,
    ) -> Heightfield:
        """Reads a DEM or point cloud as the program does: GeoTIFF, .asc, .hgt, .png, .npy, .las or .laz, degrees converted to metres.

        cell: size of a cell, m, for files that state none.
        window: (x0, y0, x1, y1) in the DEM's own coordinates.

        Raises SastrugiError (65) for a file that is missing or cannot be used.
        """
        sides = None if cell is None else pair("cell", cell)
        parts, notes = _native.read(os.fspath(path), sides, numbers("window", window, 4), True)
        return cls(*parts, notes=notes)

    def save(self, path: str | os.PathLike[str], *, compress: str = "deflate", cog: bool = False) -> tuple[str, ...]:
        """Writes the heights; the extension selects the format (.tif, .asc, .npy, .hgt, .png, .obj, .glb, .usda).

        GeoTIFF holds single precision. `compress` is none, deflate or zstd; `cog` writes a cloud-optimised GeoTIFF. Returns notes on what the
        format loses. Maps are not written.

        >>> import pathlib, tempfile
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "hill.tif"
        >>> Heightfield([[1.0, float("nan")], [3.0, 4.0]], cell=2.0).save(path)
        ()
        >>> Heightfield.read(path).values
        array([[ 1., nan],
               [ 3.,  4.]])
        """
        return tuple(_native.write(self, os.fspath(path), compress, cog))

    @property
    def values(self) -> npt.NDArray[np.float64]:
        """The heights, m. Another two-dimensional array may be assigned."""
        return self._values

    @values.setter
    def values(self, values: npt.NDArray[np.float64]) -> None:
        self._values = heights(values)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.values.shape
        return rows, columns

    @property
    def size(self) -> tuple[float, float]:
        """Extent east-west and north-south from edge to edge, m."""
        rows, columns = self.shape
        return columns * self.cell[0], rows * self.cell[1]

    @property
    def x(self) -> npt.NDArray[np.float64]:
        """Easting of the centre of each column, m."""
        columns = np.arange(self.shape[1], dtype=np.float64)
        return self.origin[0] + (columns + 0.5) * self.cell[0]

    @property
    def y(self) -> npt.NDArray[np.float64]:
        """Northing of the centre of each row, m; decreasing, as row 0 is north."""
        rows = np.arange(self.shape[0], dtype=np.float64)
        return self.origin[1] + (self.shape[0] - rows - 0.5) * self.cell[1]

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if copy:
            return np.array(self.values, dtype=dtype)
        if copy is False and dtype is not None and np.dtype(dtype) != self.values.dtype:
            raise ValueError(f"heights are {self.values.dtype}; {np.dtype(dtype)} requires a copy")
        return np.asarray(self.values, dtype=dtype)

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"Heightfield({rows} x {columns} cells of {self.cell[0]:g} x {self.cell[1]:g} m, origin {self.origin})"

    def to_xarray(self) -> xarray.DataArray:
        """A DataArray with dimensions (y, x), their coordinates in m, and the EPSG code, if there is one, as the attribute `epsg`. Needs xarray."""
        xarray = optional("xarray", "xarray", "to_xarray")
        attributes: dict[str, Any] = {"units": "m", "long_name": "height"}
        if self.crs is not None and self.crs.epsg is not None:
            attributes["epsg"] = self.crs.epsg
        coordinates = {"y": ("y", self.y, {"units": "m"}), "x": ("x", self.x, {"units": "m"})}
        return xarray.DataArray(self.values, dims=("y", "x"), coords=coordinates, name="height", attrs=attributes)

    def plot(self, ax: matplotlib.axes.Axes | None = None, **options: Any) -> matplotlib.axes.Axes:
        """Draws the heights in their coordinates, north up; `options` go to `imshow`. Needs matplotlib."""
        pyplot = optional("matplotlib.pyplot", "matplotlib", "plot")
        ax = pyplot.gca() if ax is None else ax
        (west, south), (width, depth) = self.origin, self.size
        drawn = ax.imshow(self.values, extent=(west, west + width, south, south + depth), **options)
        ax.figure.colorbar(drawn, ax=ax, label="height, m")
        ax.set_xlabel("x, m")
        ax.set_ylabel("y, m")
        return ax


def heights_of(dem: Any, cell: float | Sequence[float] | None = None) -> Heightfield:
    """Returns a heightfield unchanged, reads a file, or wraps an array with its cell. Notes on reading are warnings of the caller's caller."""
    if isinstance(dem, Heightfield):
        if cell is not None:
            raise SastrugiError("a heightfield has its own `cell`; omit it", USAGE)
        return dem
    if isinstance(dem, (str, os.PathLike)):
        read = Heightfield.read(dem, cell=cell)
        warn(read.notes, callers=2)
        return read
    if cell is None:
        heights(dem)
        raise SastrugiError("an array has no cell size; pass Heightfield(array, cell), with `cell` in m", USAGE)
    return Heightfield(dem, cell)
