"""Frames that are launched early and read late, so that other work runs in the meantime.

A kernel reads its inputs from a buffer that the next launch overwrites. Each launcher therefore has a FrameSlot, which
reads the pending frame before the next one is launched. Frames then keep their own values, and may be waited for in any
order.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


class PendingFrame:
    """Values that are being computed.

    read: function that waits for the device and returns the values
    """

    def __init__(self, read: Callable[[], np.ndarray]) -> None:
        self._read: Callable[[], np.ndarray] | None = read
        self._values: np.ndarray | None = None
        self._taken = False

    def settle(self) -> None:
        """Wait until the device has finished this frame, and keep its values for the method `wait`."""
        if self._read is not None:
            read, self._read = self._read, None
            self._values = read()

    def wait(self) -> np.ndarray:
        """Return the values and hand them over to the caller, who may write into them.

        Raises:
            RuntimeError: the values were handed over before.
        """
        if self._taken:
            raise RuntimeError("this frame was waited for before, and its values may have been changed: launch another")
        self.settle()
        values, self._values, self._taken = self._values, None, True
        assert values is not None
        return values

    def then(self, what: Callable[[np.ndarray], np.ndarray]) -> PendingFrame:
        """Return a frame whose `wait` applies the function `what` to the values of this frame."""
        return PendingFrame(lambda: what(self.wait()))


def settled(values: np.ndarray) -> PendingFrame:
    """Return a frame whose values are available already."""
    return PendingFrame(lambda: values)


class FrameSlot:
    """A kernel's pending frame, of which there is at most one, because every frame uses the same buffers."""

    def __init__(self) -> None:
        self._under_way: PendingFrame | None = None

    def clear(self) -> None:
        """Wait for the pending frame and read its values, so that the next frame may overwrite the kernel's buffers."""
        if self._under_way is not None:
            self._under_way.settle()
            self._under_way = None

    def launch(self, launch: Callable[[], Callable[[], np.ndarray]]) -> PendingFrame:
        """Launch the next frame as soon as the pending frame no longer needs the kernel's buffers.

        launch: starts the kernel, and returns a function that reads its output
        """
        self.clear()
        self._under_way = PendingFrame(launch())
        return self._under_way
