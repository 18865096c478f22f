"""Conversions between Python's values and those that the program takes."""

from __future__ import annotations

import importlib
import json
import operator
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import SastrugiError

USAGE = 2
INPUT = 65
RETRY = 75


def to_json(parameters: Mapping[str, Any]) -> str:
    """Parameters as JSON; NumPy's numbers and arrays and paths count as Python's."""
    try:
        return json.dumps(parameters, allow_nan=False, default=_plain)
    except ValueError as error:
        raise SastrugiError(f"a parameter is not a finite number: {error}", USAGE) from None
    except TypeError as error:
        raise SastrugiError(f"a parameter cannot be passed to the program: {error}", USAGE) from None


def _plain(value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{value!r} has the type {type(value).__name__}")


def counted(number: int, noun: str) -> str:
    """A number of things for a message: `1 row`, `2 rows`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def heights(values: Any) -> npt.NDArray[np.float64]:
    """Heights as an array (rows, columns) of float64; masked cells are NaN."""
    try:
        given = values if isinstance(values, np.ndarray) else np.asarray(values)
        # NumPy would parse text, also in arrays of objects, and drop the imaginary part of complex numbers.
        real = given.dtype.kind in "biuf" or (given.dtype.kind == "O" and not any(isinstance(value, (str, bytes)) for value in given.flat))
        found = given.astype(np.float64, copy=False) if real else None
    except (TypeError, ValueError):
        found = None
    if found is None:
        raise SastrugiError(f"heights must be an array of real numbers, got {_shown(values)}", USAGE)
    if found.ndim != 2:
        raise SastrugiError(f"heights must be an array (rows, columns), got {counted(found.ndim, 'dimension')}", USAGE)
    # Masked arrays have it.
    filled = getattr(found, "filled", None)
    plain = np.asarray(found if filled is None else filled(np.nan))
    # The Rust side counts strides in whole elements. Those of a field of packed records are not: it would read other bytes.
    return plain if plain.flags.aligned else plain.copy()


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]} ..."


def numbers(name: str, value: Sequence[float] | None, count: int) -> tuple[float, ...] | None:
    """As many numbers as `count`; None stays None."""
    if value is None:
        return None
    found = _floats(value)
    if len(found) != count:
        raise SastrugiError(f"`{name}` must be {count} numbers, got {_shown(value)}", USAGE)
    return tuple(found)


def pair(name: str, value: float | Sequence[float]) -> tuple[float, float]:
    """Two numbers, or one number for both."""
    found = _floats(value)
    if len(found) not in (1, 2):
        raise SastrugiError(f"`{name}` must be one or two numbers, got {_shown(value)}", USAGE)
    return found[0], found[-1]


def number(name: str, value: float) -> float:
    """A number."""
    found = _floats(value)
    if len(found) != 1:
        raise SastrugiError(f"`{name}` must be a number, got {_shown(value)}", USAGE)
    return found[0]


def whole(name: str, value: int, limit: int | None = None) -> int:
    """A whole number, 0 or above, up to a limit."""
    try:
        found = operator.index(value)
    except TypeError:
        found = -1
    if found < 0 or (limit is not None and found > limit):
        range_ = ", 0 or above" if limit is None else f" from 0 to {limit}"
        raise SastrugiError(f"`{name}` must be a whole number{range_}, got {_shown(value)}", USAGE)
    return found


def seed_of(seed: int) -> int:
    """A seed of the random streams."""
    return whole("seed", seed, 2**64 - 1)


def _floats(value: Any) -> list[float]:
    """The numbers of a value; none if it holds anything else."""
    try:
        found = np.asarray(value)
    except ValueError:
        return []
    if found.dtype.kind not in "iuf":
        return []
    floats: list[float] = found.astype(np.float64).ravel().tolist()
    return floats


def refuse_stated(parameters: Mapping[str, Any], **stated: str) -> None:
    """Refuses parameters that an argument of another name states: `refuse_stated(parameters, outer_scale_m="outer_scale")`."""
    for name, argument in stated.items():
        if name in parameters:
            raise SastrugiError(f"`{argument}` already states `{name}`; leave out `{name}`", USAGE)


def warn(notes: Iterable[str], callers: int = 1) -> None:
    """Issues notes as warnings of the caller of the package's function, which is `callers` calls above this one."""
    for note in notes:
        warnings.warn(note, stacklevel=callers + 2)


def optional(module: str, package: str, purpose: str) -> ModuleType:
    """A package that only some functions need."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise SastrugiError(f"{purpose} needs {package}: pip install {package}", USAGE) from None
