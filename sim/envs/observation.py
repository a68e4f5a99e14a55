"""Memory of an agent's past frames, as part of its observations."""

from __future__ import annotations

import numpy as np

# Margin between noiseless signals and the bounds of the observation space, in standard deviations of the noise. One in
# 1e23 draws exceeds it.
SIGMAS = 10.0
ROUNDING = 1e-4  # error of float32, relative to the brightest signal


class Memory:
    """The last `frames` frames of every world, newest last.

    In a world that starts a new episode, the first frame fills the whole memory, as if the agent had seen the same
    frame before. A memory that started with zeros would look as if the agent had come out of darkness.

    Raises:
        ValueError: `frames` is below 1.
    """

    def __init__(self, frames: int) -> None:
        if frames < 1:
            raise ValueError(f"memory = {frames!r}: must be at least 1 frame")
        self.frames = frames
        self._past: list[np.ndarray] = []

    def remember(self, frame: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """Add a frame (world, ...), and return the memory (world, frames, ...), which the caller may modify.

        The caller must not modify `frame` afterwards.

        fresh: indices of the worlds whose episode has just started
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
        """True if the memory contains a frame."""
        return bool(self._past)

    @property
    def frames_held(self) -> np.ndarray:
        """All stored frames, (world, frames, ...)."""
        return np.stack(self._past, axis=1)

    def restore(self, frames: np.ndarray) -> None:
        """Replace the stored frames by these, (world, frames, ...)."""
        self._past = [frames[:, k].copy() for k in range(self.frames)]

    @property
    def newest(self) -> np.ndarray:
        """The last frame of every world, (world, ...)."""
        return self._past[-1]

    def preview(self, frame: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """Return the memory of these worlds after a frame (len(worlds), ...), without storing the frame.

        The result is (len(worlds), frames, ...).
        """
        if self.frames == 1:
            return frame[:, None]
        return np.stack([*(past[worlds] for past in self._past[1:]), frame], axis=1)
