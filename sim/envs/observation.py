"""What an agent knows: its eyes' noisy signals over the past frames, touch, and its last action."""

from __future__ import annotations

import numpy as np

# Standard deviations of noise within which signals are said to stay: 1 in 1e23 draws does not.
SIGMAS = 10.0
ROUNDING = 1e-4  # of float32, as a share of the brightest signal


class Memory:
    """The last `frames` frames of every world, newest last.

    A world that starts anew has its first frame in every place: it has always seen what it sees now, rather than
    having come out of darkness.
    """

    def __init__(self, frames: int) -> None:
        if frames < 1:
            raise ValueError(f"memory = {frames!r}: must be at least 1 frame")
        self.frames = frames
        self._past: list[np.ndarray] = []

    def remember(self, frame: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """Add a frame (env, ...); `fresh`: numbers of the worlds that have just started.

        Returns (env, memory, ...), the caller's own, which may be written to; `frame` no longer is.
        """
        if self.frames == 1:
            self._past = [frame.copy()]
            return frame[:, None]
        if not self._past:
            self._past = [frame.copy() for _ in range(self.frames)]
        self._past = [*self._past[1:], frame]
        if len(fresh):
            for past in self._past[:-1]:
                past[fresh] = frame[fresh]
        return np.stack(self._past, axis=1)

    @property
    def begun(self) -> bool:
        """Whether there is anything to remember."""
        return bool(self._past)

    @property
    def held(self) -> np.ndarray:
        """All that is remembered, (env, memory, ...)."""
        return np.stack(self._past, axis=1)

    def hold(self, frames: np.ndarray) -> None:
        """Remember these instead, (env, memory, ...)."""
        self._past = [frames[:, k].copy() for k in range(self.frames)]

    @property
    def newest(self) -> np.ndarray:
        """The last frame of every world, (env, ...)."""
        return self._past[-1]

    def preview(self, frame: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """What these worlds' memory would hold with this frame (len(worlds), ...) added; nothing is remembered."""
        if self.frames == 1:
            return frame[:, None]
        return np.stack([*(past[worlds] for past in self._past[1:]), frame], axis=1)
