"""A cache of large results that is limited by memory instead of the number of results."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from threading import Lock
from typing import Any

__all__ = ["cached_arrays"]


def cached_arrays(most_bytes: float, size: Callable[[Any], int]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that caches the latest results of a function of hashable arguments.

    most_bytes: memory of all cached results together. The results that were not used for longest are removed first, and
        larger results are not cached.
    size: function that returns the memory of a result in bytes.
    """

    def decorate(compute: Callable[..., Any]) -> Callable[..., Any]:
        known: OrderedDict[Any, Any] = OrderedDict()
        lock = Lock()

        @wraps(compute)
        def cached(*arguments: Any) -> Any:
            with lock:
                if arguments in known:
                    known.move_to_end(arguments)
                    return known[arguments]
            found = compute(*arguments)
            with lock:
                known[arguments] = found
                while known and sum(map(size, known.values())) > most_bytes:
                    known.popitem(last=False)
            return found

        return cached

    return decorate
