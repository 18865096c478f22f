"""Client of the terrain server (`sastrugi serve`)."""

from __future__ import annotations

import http.client
import json
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Sequence
from email.message import Message
from typing import Any

import numpy as np

from ._errors import SastrugiError
from ._heightfield import Heightfield
from ._values import INPUT, RETRY, USAGE, number, numbers, pair, whole

TRIES = 10
WAIT_MAX_S = 30.0
BUSY = (429, 503)
MISSING = (404, 422)


class TerrainClient:
    """Connection to a terrain server.

        client = TerrainClient("http://127.0.0.1:8080")
        heights = client.patch("planet", center=(0.0, 0.0), size=(512, 512), resolution=0.02)

    Requests to a busy server are retried after the time that it states. Raises SastrugiError with the server's message: 2 for an invalid
    request, 65 for ground that it does not have, 75 if it stays busy or does not answer.
    """

    def __init__(self, address: str, *, token: str | None = None, timeout: float = 600.0) -> None:
        if not _is_address(address):
            raise SastrugiError(f"{address!r} is not the address of a server; expected http://HOST:PORT", USAGE)
        self.address = address.rstrip("/")
        self._token = token
        self._timeout = timeout

    def collections(self) -> list[dict[str, Any]]:
        """The collections that it serves: id, title, bounds_m, cell_m, spacing_m, fields ..."""
        collections = self._json("/v1/collections", {}).get("collections")
        if not isinstance(collections, list):
            raise self._foreign("a list of collections")
        return collections

    def patch(
        self,
        collection: str,
        *,
        origin: Sequence[float] | None = None,
        center: Sequence[float] | None = None,
        size: Sequence[int] | None = None,
        size_m: Sequence[float] | None = None,
        resolution: float | None = None,
        field: str = "elevation",
        phenomena: Sequence[int] | None = None,
        feature_min: float | None = None,
    ) -> Heightfield:
        """Samples of ground, single precision.

        origin or center: the south-west sample, or the middle (x, y), m.
        size or size_m: columns and rows, or extent east-west and north-south, m.
        resolution: distance between samples, m; the collection's own by default.
        field: elevation, albedo, class, rock_potential or image.
        phenomena: numbers of the processes to apply; all by default.
        feature_min: leaves out craters and rocks up to this width, m.
        """
        query: dict[str, str] = {"field": field, "format": "raw"}
        for name, place in {"origin": origin, "center": center, "size_m": size_m}.items():
            if place is not None:
                query[name] = ",".join(repr(v) for v in pair(name, place))
        if size is not None:
            query["size"] = ",".join(f"{count:.17g}" for count in pair("size", size))
        if resolution is not None:
            query["resolution_m"] = repr(number("resolution", resolution))
        if phenomena is not None:
            query["phenomena"] = ",".join(str(whole("phenomena", process)) for process in phenomena)
        if feature_min is not None:
            query["feature_min_m"] = repr(number("feature_min", feature_min))
        headers, body = self._get(f"/v1/collections/{urllib.parse.quote(collection)}/patch", query)
        try:
            rows, columns = int(headers["grid-rows"]), int(headers["grid-columns"])
            cell = float(headers["grid-resolution-m"])
            west, south = (float(text) for text in headers["grid-origin-m"].split(","))
            values = np.frombuffer(body, dtype="<f4").reshape(rows, columns)
        except (TypeError, AttributeError, ValueError):
            raise self._foreign("a patch") from None
        return Heightfield(values, cell, (west - 0.5 * cell, south - 0.5 * cell))

    def point(self, collection: str, x: float, y: float, **query: Any) -> dict[str, Any]:
        """The ground at a point."""
        query = {"x": repr(number("x", x)), "y": repr(number("y", y)), **query}
        return self._json(f"/v1/collections/{urllib.parse.quote(collection)}/point", query)

    def profile(self, collection: str, line: Sequence[Sequence[float]], samples: int, **query: Any) -> dict[str, Any]:
        """Heights along a line of points (x, y)."""
        points = ";".join(",".join(map(repr, numbers("line", point, 2) or ())) for point in line)
        query = {"line": points, "samples": str(whole("samples", samples)), **query}
        return self._json(f"/v1/collections/{urllib.parse.quote(collection)}/profile", query)

    def _json(self, path: str, query: dict[str, Any]) -> dict[str, Any]:
        _, body = self._get(path, query)
        try:
            content = json.loads(body)
        except ValueError:
            content = None
        if not isinstance(content, dict):
            raise self._foreign("a JSON object")
        return content

    def _foreign(self, expected: str) -> SastrugiError:
        return SastrugiError(f"{self.address}: the response is not {expected}; is this a terrain server?", INPUT)

    def _get(self, path: str, query: dict[str, Any]) -> tuple[Message, bytes]:
        address = self.address + path + ("?" + urllib.parse.urlencode(query, safe=",;") if query else "")
        headers = {"Authorization": f"Bearer {self._token}"} if self._token else {}
        for attempt in range(TRIES):
            try:
                with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=self._timeout) as answer:
                    return answer.headers, answer.read()
            except urllib.error.HTTPError as error:
                with error:
                    if error.code in BUSY and attempt + 1 < TRIES:
                        time.sleep(_wait_s(error.headers.get("Retry-After")))
                        continue
                    raise SastrugiError(f"{error.code}: {_detail(error.read())}", _code(error.code)) from None
            except (urllib.error.URLError, http.client.HTTPException, OSError) as error:
                reason = getattr(error, "reason", error)
                raise SastrugiError(f"{self.address}: no answer: {reason}", RETRY) from None
        raise AssertionError("the last attempt returns or raises")


def _is_address(text: str) -> bool:
    try:
        parts = urllib.parse.urlsplit(text)
        # A port that is not a number is an error.
        return parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except (ValueError, AttributeError):
        return False


def _wait_s(stated: str | None) -> float:
    try:
        return min(float(stated or 1.0), WAIT_MAX_S)
    except ValueError:
        return 1.0


def _detail(body: bytes) -> str:
    try:
        return str(json.loads(body)["detail"])
    except (ValueError, KeyError, TypeError):
        return "no reason given"


def _code(status: int) -> int:
    if status in BUSY:
        return RETRY
    if status in MISSING:
        return INPUT
    return USAGE if status < 500 else 1
