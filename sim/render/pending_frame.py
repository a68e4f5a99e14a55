"""Frames that are begun early and waited for late, so that other work runs beside them.

A kernel reads its inputs from a buffer that the next launch overwrites. Whoever launches keeps a FrameSlot, which reads
out the frame under way before the next one is begun: in whatever order frames are waited for, each has its own values.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


class PendingFrame:
    """Values that are being computed.

    read: waits for the device and returns them
    """

    def __init__(self, read: Callable[[], np.ndarray]) -> None:
        self._read: Callable[[], np.ndarray] | None = read
        self._values: np.ndarray | None = None
        self._taken = False

    def settle(self) -> None:
        """Wait until the device is done with this frame; the values are kept for `wait`."""
        if self._read is not None:
            read, self._read = self._read, None
            self._values = read()

    def wait(self) -> np.ndarray:
        """The values, handed over: from now on they are the caller's own, who may write into them.

        Raises:
            RuntimeError: they were handed over before.
        """
        if self._taken:
            raise RuntimeError("this frame was waited for before, and its values may have been changed: begin another")
        self.settle()
        values, self._values, self._taken = self._values, None, True
        assert values is not None
        return values

    def then(self, what: Callable[[np.ndarray], np.ndarray]) -> PendingFrame:
        """The frame that is made of this one's values when it is waited for."""
        return PendingFrame(lambda: what(self.wait()))


def settled(values: np.ndarray) -> PendingFrame:
    """A frame that is there already."""
    return PendingFrame(lambda: values)


class FrameSlot:
    """The one frame that may be under way in a kernel's buffers."""

    def __init__(self) -> None:
        self._under_way: PendingFrame | None = None

    def clear(self) -> None:
        """Read out the frame under way: afterwards the buffers may be written."""
        if self._under_way is not None:
            self._under_way.settle()
            self._under_way = None

    def begin(self, launch: Callable[[], Callable[[], np.ndarray]]) -> PendingFrame:
        """Launch the next frame once the buffers are free; launch: starts the kernel, returns what reads its output."""
        self.clear()
        self._under_way = PendingFrame(launch())
        return self._under_way
