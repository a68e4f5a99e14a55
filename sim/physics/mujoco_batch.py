"""MuJoCo's batched step, which is faster for small batches: it omits threads, timers, and repeated checks of models."""

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

# Chosen: smallest number of worlds for which a pool of threads is used. On two cores, 64 worlds were not faster on two
# threads than on one.
POOLED = 128


class BatchedStep:
    """Open-loop steps of many worlds whose models differ only in values, not in the sizes of arrays.

    like: a model with the same sizes of arrays as all models that will be stepped
    threads: number of threads for batches of at least 128 worlds; smaller batches are stepped on the calling thread
    """

    def __init__(self, like: mujoco.MjModel, threads: int) -> None:
        self._state_size = mujoco.mj_stateSize(like, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._sensors = like.nsensordata
        self._like, self._threads = like, threads
        self._data = [mujoco.MjData(like)]
        self._alone = mujoco.rollout.Rollout(nthread=0)
        self._pool: mujoco.rollout.Rollout | None = None  # created on demand

    def __call__(
        self, models: Sequence[mujoco.MjModel], initial: np.ndarray, control: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the states (n, step, ...) and sensor values (n, step, ...) after each step.

        models: the model of each world
        initial: states before the first step (n, ...)
        control: controls in each step (n, step, nu)
        """
        n, steps = control.shape[:2]
        rollout = self._pooled() if self._threads > 1 and n >= POOLED else self._alone
        data = self._data[: max(rollout.nthread, 1)]
        states, sensors = np.empty((n, steps, self._state_size)), np.empty((n, steps, self._sensors))
        with _clock_stopped:
            # Shapes and types are known to be correct. Checking every model again is expensive for small batches.
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
    """Context manager that disables the clock with which MuJoCo measures the times in MjData.timer.

    MuJoCo reads this clock about twenty times per step, which takes a fifth of the time of a small model's step. All
    threads of a process share the clock. It is disabled while at least one thread is inside the context, and restored
    when the last one leaves it.
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
    """Return mjcb_time, MuJoCo's pointer to the function that reads its clock.

    The pointer is accessed directly, because mujoco.set_mjcb_time cannot clear it. If MuJoCo's library is not in the
    folder of its package, an unused pointer is returned.
    """
    for library in Path(mujoco.__file__).parent.glob("*mujoco*.*"):
        with contextlib.suppress(OSError, ValueError):
            return ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time")
    return ctypes.c_void_p()


_clock_stopped = _ClockStopped()
