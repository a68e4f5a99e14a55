"""Values that are computed once and kept for later use, within a limit on their number or on their memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from threading import Lock
from typing import Any

__all__ = ["KeptValues", "cached_arrays"]


class KeptValues:
    """Values by key. If the sum of their sizes exceeds a limit, the least recently used values are dropped.

    A value whose own size exceeds the limit is not kept. A key must determine its value, so it consists of all numbers
    from which the value is computed.

    most: largest sum of the sizes.
    size: function that returns the size of a value. None: each value has the size 1, so that `most` is the largest
        number of values.
    """

    def __init__(self, most: float, size: Callable[[Any], float] | None = None):
        self._most, self._size = most, size
        self._values: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: Hashable, compute: Callable[[], Any]) -> Any:
        """Return the value that is kept for a key. If there is none, call `compute` and keep its result.

        A result whose size alone exceeds the limit is returned, but not kept.
        """
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        found = compute()
        if self._size is not None and self._size(found) > self._most:
            return found
        with self._lock:
            self._values[key] = found
            while self._total() > self._most:
                self._values.popitem(last=False)
        return found

    def _total(self) -> float:
        return len(self._values) if self._size is None else sum(map(self._size, self._values.values()))


def cached_arrays(most_bytes: float, size: Callable[[Any], int]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that keeps the latest results of a function of hashable arguments.

    most_bytes: memory of all kept results together. Larger results are not kept.
    size: function that returns the memory of a result in bytes.
    """

    def decorate(compute: Callable[..., Any]) -> Callable[..., Any]:
        kept = KeptValues(most_bytes, size)

        @wraps(compute)
        def cached(*arguments: Any) -> Any:
            return kept.get(arguments, lambda: compute(*arguments))

        return cached

    return decorate
