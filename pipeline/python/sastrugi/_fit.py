"""Fits of measured surfaces, and textures from them."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from ._errors import SastrugiError
from ._heightfield import Heightfield, heights_of
from ._values import USAGE, numbers, optional, pair, refuse_stated, seed_of, to_json, warn

if TYPE_CHECKING:
    import matplotlib.axes


def _object(text: str) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise SastrugiError("not a fit: expected a dict, or the text of a fit file; `Fit.load` reads a file", USAGE)
    return content


class Fit:
    """The covariance of a surface: a model with its parameters, from a DEM or stated.

    Units end the names: `sigma_m` is the standard deviation, `range_m` the correlation length b. Covariances are in m², never semivariances.

    A stated model needs nothing else:

    >>> snow = Fit({"model": "exponential", "parameters": {"sigma_m": 0.03, "range_m": 0.28}})
    >>> snow.parameters
    {'sigma_m': 0.03, 'range_m': 0.28}
    >>> snow.texture(size=(4.0, 2.0), cell=0.05, seed=1).shape
    (40, 80)
    """

    __slots__ = ("_text", "_content", "_quoted")

    def __init__(self, content: Mapping[str, Any] | str) -> None:
        self._text = content if isinstance(content, str) else to_json(content) + "\n"
        self._content: dict[str, Any] = _object(self._text)
        self._quoted: dict[str, Any] = json.loads(_native.quoted(self._text))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Fit:
        """Reads a fit file. Raises SastrugiError (65) for a missing file, or one that is not a fit file."""
        return cls(_native.load_fit(os.fspath(path)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the fit file, which `sastrugi texture` and `Fit.load` read."""
        _native.save_fit(os.fspath(path), self._text)

    def to_dict(self) -> dict[str, Any]:
        """Everything in the fit file."""
        content: dict[str, Any] = json.loads(self._text)
        return content

    @property
    def model(self) -> str:
        """Name of the covariance model."""
        return str(self._content["model"])

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the model by name."""
        return dict(self._content["parameters"])

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Interval of each parameter that has one, and of `sigma2_over_range_m`; an open end is infinite.

        A parameter whose search ended at its bound has only a lower limit, and is not estimated; see `is_estimated`.
        """
        found = {}
        for name, quoted in self._quoted["parameters"].items():
            if "at_least" in quoted:
                found[name] = (quoted["at_least"], math.inf)
            elif quoted.get("interval") is not None:
                low, high = quoted["interval"]
                found[name] = (-math.inf if low is None else low, math.inf if high is None else high)
        return found

    @property
    def interval_level(self) -> float | None:
        """Confidence level of the intervals, or None without intervals."""
        level: float | None = self._quoted["level"]
        return level

    @property
    def interval_kind(self) -> str | None:
        """How the intervals were computed, or None without intervals."""
        kind: str | None = self._quoted["kind"]
        return kind

    def is_estimated(self, name: str) -> bool:
        """Whether the value of a parameter is an estimate. It is not if the search for the range ended at its bound."""
        quoted = self._quoted["parameters"].get(name)
        if quoted is None:
            known = ", ".join(self._quoted["parameters"])
            raise SastrugiError(f"the fit has no parameter `{name}`; it has {known}", USAGE)
        return "value" in quoted

    @property
    def verdict(self) -> str:
        """What describes the surface at this scale, and what the fit may be used for; empty for a stated model."""
        return str(self._content.get("verdict", ""))

    @property
    def warnings(self) -> list[str]:
        """Warnings about the fit, the most important first."""
        return list(self._content.get("warnings", []))

    def texture(
        self,
        size: float | Sequence[float],
        cell: float | None = None,
        seed: int = 0,
        *,
        method: str = "fft_ma",
        exemplar: Any = None,
        **parameters: Any,
    ) -> Heightfield:
        """Synthesises a heightfield with this covariance, as `sastrugi texture` does.

        size: extent east-west and north-south, m; one number for a square.
        cell: size of its cells, m; by default 0.1, or that of the site for methods that repeat it.
        seed: of the random streams; the same seed gives the same heights.
        method: fft_ma, cholesky, gaussians or quasi_wavelets; modulated or wavelet_statistics, for a `fit(..., statistics=True)`; quilting or
            exemplar, with `exemplar`. Its parameters (`sastrugi kinds`) as keywords.
        exemplar: the fitted heights (a Heightfield, or a file), from which quilting and exemplar copy. Their licence extends to the texture.

        >>> snow = Fit({"model": "exponential", "parameters": {"sigma_m": 0.03, "range_m": 0.28}})
        >>> tile = snow.texture(20.0, 0.1, seed=3)
        >>> abs(float(np.sqrt(np.mean(np.square(tile)))) - 0.03) < 1e-9
        True
        """
        refuse_stated(parameters, size_m="size", size_px="size", cell_m="cell")
        parameters = {"size_m": pair("size", size), **({} if cell is None else {"cell_m": cell}), **parameters}
        site = None if exemplar is None else self._site(exemplar)
        parts, info = _native.texture(self._text, method, to_json(parameters), seed_of(seed), site)
        return Heightfield(*parts, notes=json.loads(info)["notes"])

    def _site(self, exemplar: Any) -> Heightfield:
        """The fitted heights: as they are, or read as the fit read them."""
        if isinstance(exemplar, Heightfield):
            return exemplar
        if not isinstance(exemplar, (str, os.PathLike)):
            return heights_of(exemplar, self._content.get("cell_m"))
        source = self._content.get("source") or {}
        if source.get("minus") or source.get("masks"):
            raise SastrugiError("the fit has masks or is of a difference; give the heights that it used as `exemplar`", USAGE)
        return Heightfield.read(exemplar, cell=self._content.get("cell_m"), window=source.get("window"))

    def plot(self, ax: matplotlib.axes.Axes | None = None) -> matplotlib.axes.Axes:
        """Plots the measured covariance by lag and that of the model, both after detrending and trimming. Needs matplotlib."""
        lags = np.asarray(self._content.get("lags_m", []), dtype=float)
        if lags.size == 0:
            raise SastrugiError("a stated model has no measured covariance to draw", USAGE)
        pyplot = optional("matplotlib.pyplot", "matplotlib", "plot")
        ax = pyplot.gca() if ax is None else ax
        ax.plot(lags, np.asarray(self._content["covariance_m2"], dtype=float), "o", label="measured")
        ax.plot(lags, np.asarray(self._content["model_m2"], dtype=float), "-", label=self.model)
        ax.set_xlabel("lag, m")
        ax.set_ylabel("covariance, m²")
        ax.legend()
        return ax

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:.4g}" for name, value in self.parameters.items())
        return f"Fit({self.model}: {numbers})"


def fit(
    dem: Any,
    *,
    outer_scale: float,
    cell: float | Sequence[float] | None = None,
    window: Sequence[float] | None = None,
    minus: str | os.PathLike[str] | None = None,
    seed: int = 0,
    **parameters: Any,
) -> Fit:
    """Fits the covariance of a measured surface, as `sastrugi fit` does.

    dem: a file, a Heightfield, or an array (rows, columns) of heights in m with `cell`.
    outer_scale: window of the moving average, m; wider features are background.
    cell: size of the cells, m, for arrays and for files that state none.
    window: part of a file, (x0, y0, x1, y1) in its own coordinates.
    minus: another file, which is co-registered to `dem` (which must then be a file too) and subtracted.
    seed: of the replicates.
    parameters: as in a study (`sastrugi kinds covariance`): mode, trim, model, bootstrap, statistics, inner_scale_m, noise_sigma_m ...

    Notes on how a file was read, such as a cell size that was assumed, are issued as warnings. For the same file and parameters, `save`
    writes the same file as the program. Ctrl-C returns within two seconds; the fit then ends in the background without effect.

    Raises SastrugiError: 2 for an unknown parameter or one that is out of range, 65 for a file that cannot be read or heights that cannot be
    fitted, 75 for an array that needs more memory than is available.

    >>> site = Fit({"model": "exponential", "parameters": {"sigma_m": 0.05, "range_m": 0.2}}).texture(
    ...     16.0, 0.1, seed=1, phase="gaussian", periodic=False)
    >>> found = fit(site, outer_scale=1.0, model="exponential", bootstrap=0)
    >>> found.model, abs(found.parameters["sigma_m"] / 0.05 - 1) < 0.2
    ('exponential', True)
    """
    refuse_stated(parameters, outer_scale_m="outer_scale")
    text = to_json({"outer_scale_m": outer_scale, **parameters})
    seed = seed_of(seed)
    if isinstance(dem, (str, os.PathLike)):
        sides = None if cell is None else pair("cell", cell)
        part = numbers("window", window, 4)
        other = None if minus is None else os.fspath(minus)
        fitted, notes = _native.fit_file(os.fspath(dem), text, seed, sides, part, other)
        warn(notes)
        return Fit(fitted)
    if window is not None or minus is not None:
        raise SastrugiError("`window` and `minus` apply to a file; cut an array, or use `coregister`", USAGE)
    return Fit(_native.fit_array(heights_of(dem, cell), text, seed))
