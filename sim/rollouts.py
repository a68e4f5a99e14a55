"""MuJoCo's batched step for small batches: nothing checked twice, and threads only where there is work for them."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

# So many worlds are worth waking a pool of threads: renderers' threads have not gone to sleep yet when physics begins,
# and on two cores 64 worlds took twice as long on two threads as on one.
POOLED = 128


class Rollouts:
    """Open-loop steps of many worlds whose models differ by numbers alone.

    like     a model of their sizes
    threads  that POOLED worlds or more are shared among; fewer are stepped on the calling thread
    """

    def __init__(self, like: mujoco.MjModel, threads: int) -> None:
        self._state_size = mujoco.mj_stateSize(like, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._sensors = like.nsensordata
        self._data = [mujoco.MjData(like) for _ in range(max(threads, 1))]
        self._alone = mujoco.rollout.Rollout(nthread=0)
        self._pool = mujoco.rollout.Rollout(nthread=threads) if threads > 1 else None

    def __call__(
        self, models: Sequence[mujoco.MjModel], initial: np.ndarray, control: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (n, step, ...) and sensors (n, step, ...) after each step from `initial` (n, ...) under `control`
        (n, step, nu); one model per world."""
        n, steps = control.shape[:2]
        pooled = self._pool is not None and n >= POOLED
        states, sensors = np.empty((n, steps, self._state_size)), np.empty((n, steps, self._sensors))
        rollout = self._pool if self._pool and pooled else self._alone
        data = self._data if pooled else self._data[:1]
        with _clock_stopped():
            # Checking what is known to be right would take a third of the time of a small batch.
            rollout.rollout(
                models, data, initial, control, skip_checks=True, nstep=steps, state=states, sensordata=sensors
            )
        return states, sensors

    def close(self) -> None:
        """Stop the pool's threads."""
        if self._pool:
            self._pool.close()
        self._pool = None


@contextlib.contextmanager
def _clock_stopped() -> Iterator[None]:
    """MuJoCo without the clock that it reads a score of times per step for MjData.timer: a fifth of so small a step."""
    clock = _clock()
    was = clock.value
    clock.value = None
    try:
        yield
    finally:
        clock.value = was


@cache
def _clock() -> ctypes.c_void_p:
    """MuJoCo's pointer to its clock, mjcb_time (mujoco.set_mjcb_time cannot clear it); one that nobody reads where its
    library is not found beside the package."""
    for library in Path(mujoco.__file__).parent.glob("*mujoco*.*"):
        with contextlib.suppress(OSError, ValueError):
            return ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time")
    return ctypes.c_void_p()
