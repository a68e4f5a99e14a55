"""Values that are computed once and kept for later use, up to a number of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

__all__ = ["KeptValues"]


class KeptValues:
    """Values by key. If there are more than `most`, the one whose last use is longest ago is dropped.

    A key must determine its value, so it consists of all numbers from which the value is computed.
    """

    def __init__(self, most: int):
        self._most = most
        self._values: OrderedDict[Hashable, Any] = OrderedDict()

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: Hashable, compute: Callable[[], Any]) -> Any:
        """Return the value of a key. `compute` returns it if it is not kept."""
        try:
            found = self._values[key]
            self._values.move_to_end(key)
        except KeyError:  # also if another thread has dropped the value in the meantime
            found = self._values[key] = compute()
            if len(self._values) > self._most:
                self._values.popitem(last=False)
        return found
