"""A cache of values, limited in bytes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from threading import Lock
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Kept(Generic[Key, Value]):
    """Values by key, each read on first access.

    read: returns the value of a key and its size in bytes.
    limit: bytes beyond which the least recently used values are dropped. The latest value stays, whatever its size.

    >>> kept = Kept(lambda word: (word.upper(), len(word)), limit=8)
    >>> [kept(word) for word in ("snow", "ice", "snow", "sand")]
    ['SNOW', 'ICE', 'SNOW', 'SAND']
    >>> list(kept)
    ['snow', 'sand']
    """

    __slots__ = ("_read", "_limit", "_values", "_bytes", "_lock")

    def __init__(self, read: Callable[[Key], tuple[Value, int]], limit: int) -> None:
        self._read = read
        self._limit = limit
        self._values: OrderedDict[Key, tuple[Value, int]] = OrderedDict()
        self._bytes = 0
        self._lock = Lock()

    def __call__(self, key: Key) -> Value:
        with self._lock:
            known = self._values.get(key)
            if known is not None:
                self._values.move_to_end(key)
                return known[0]
        # The lock is not held: threads that ask for one value at the same time each read it.
        value, size = self._read(key)
        with self._lock:
            _, replaced = self._values.pop(key, (value, 0))
            self._values[key] = (value, size)
            self._bytes += size - replaced
            while self._bytes > self._limit and len(self._values) > 1:
                _, (_, dropped) = self._values.popitem(last=False)
                self._bytes -= dropped
        return value

    def __iter__(self) -> Iterator[Key]:
        """The keys of the cached values, least recently used first."""
        with self._lock:
            return iter(list(self._values))
