"""MuJoCo's batched step for small batches: nothing checked twice, and threads only where there is work for them."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

# So many worlds are taken to be worth waking a pool of threads: on two cores 64 took no less time on two than on one.
POOLED = 128


class BatchedStep:
    """Open-loop steps of many worlds whose models differ by numbers alone.

    like: a model of their sizes
    threads: that POOLED worlds or more are shared among; fewer are stepped on the calling thread
    """

    def __init__(self, like: mujoco.MjModel, threads: int) -> None:
        self._state_size = mujoco.mj_stateSize(like, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._sensors = like.nsensordata
        self._like, self._threads = like, threads
        self._data = [mujoco.MjData(like)]
        self._alone = mujoco.rollout.Rollout(nthread=0)
        self._pool: mujoco.rollout.Rollout | None = None  # not before it is needed

    def __call__(
        self, models: Sequence[mujoco.MjModel], initial: np.ndarray, control: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (n, step, ...) and sensors (n, step, ...) after each step from `initial` (n, ...) under `control`
        (n, step, nu); one model per world."""
        n, steps = control.shape[:2]
        rollout = self._pooled() if self._threads > 1 and n >= POOLED else self._alone
        data = self._data[: max(rollout.nthread, 1)]
        states, sensors = np.empty((n, steps, self._state_size)), np.empty((n, steps, self._sensors))
        with _clock_stopped:
            # Shapes and types are known to be right: for small batches looking at every model again is dear.
            rollout.rollout(
                models, data, initial, control, skip_checks=True, nstep=steps, state=states, sensordata=sensors
            )
        return states, sensors

    def _pooled(self) -> mujoco.rollout.Rollout:
        if self._pool is None:
            self._pool = mujoco.rollout.Rollout(nthread=self._threads)
            self._data += [mujoco.MjData(self._like) for _ in range(self._threads - len(self._data))]
        return self._pool

    def close(self) -> None:
        """Stop the pool's threads."""
        if self._pool:
            self._pool.close()
        self._pool = None


class _ClockStopped:
    """MuJoCo without the clock that it reads a score of times per step for MjData.timer: a fifth of so small a step.

    The clock is the process's: it stands still while any rollout is at work, and goes on when the last one is done.
    """

    def __init__(self) -> None:
        self._lock, self._at_work = threading.Lock(), 0
        self._was: int | None = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._at_work:
                self._was, _clock().value = _clock().value, None
            self._at_work += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._at_work -= 1
            if not self._at_work:
                _clock().value = self._was


@cache
def _clock() -> ctypes.c_void_p:
    """MuJoCo's pointer to its clock, mjcb_time (mujoco.set_mjcb_time cannot clear it); one that nobody reads where its
    library is not found beside the package."""
    for library in Path(mujoco.__file__).parent.glob("*mujoco*.*"):
        with contextlib.suppress(OSError, ValueError):
            return ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time")
    return ctypes.c_void_p()


_clock_stopped = _ClockStopped()
