"""Worlds of any MuJoCo model, with their states as arrays, for tasks that treat all worlds at once."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from sim.physics.mujoco_worlds import MujocoWorlds
from sim.scene.variation import Drawn

__all__ = ["ArrayWorlds"]

_ALL = mujoco.mjtState.mjSTATE_INTEGRATION
# Arrays of a world's state that tasks may write, with the suffixes of their names in mujoco.mjtState (mjSTATE_QPOS
# ...). For mocap bodies, the number of values for each body follows.
_WRITABLE = {"time": "TIME", "qpos": "QPOS", "qvel": "QVEL", "act": "ACT", "ctrl": "CTRL", "userdata": "USERDATA"}
_MOCAP = {"mocap_pos": ("MOCAP_POS", 3), "mocap_quat": ("MOCAP_QUAT", 4)}


class ArrayWorlds(MujocoWorlds):
    """`n` worlds of one model, as arrays whose first axis is the world.

    The arguments are those of `sim.physics.mujoco_worlds.MujocoWorlds`, and `sim.Physics` describes the methods.

    qpos, qvel, act, ctrl, userdata: arrays that tasks may write in `reset` and `act`, (n, value)
    mocap_pos, mocap_quat: writable positions and rotations of mocap bodies, (n, mocap body, 3) and (n, mocap body, 4)
    time: writable simulation time [s], (n, 1)

    All other arrays of mjData (`xpos`, `geom_xpos`, `site_xpos`, `sensordata`, `cvel` ...) are read-only. They are
    stacked over worlds when they are first read after the worlds have changed. A name that mjData lacks raises an
    AttributeError.

    Raises:
        ValueError: an argument has the wrong type or is out of range, or `variation` names an object that the model
            lacks or that cannot vary.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    act: np.ndarray
    ctrl: np.ndarray
    userdata: np.ndarray
    time: np.ndarray
    mocap_pos: np.ndarray
    mocap_quat: np.ndarray

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._stacked: dict[str, np.ndarray] = {}
        self._rows = np.zeros((self.n, mujoco.mj_stateSize(self.model, _ALL)))
        start = 0
        # MuJoCo stores the parts of a state in this order.
        for part in (getattr(mujoco.mjtState, name) for name in _parts()):
            if not int(part) & int(_ALL):
                continue
            size = mujoco.mj_stateSize(self.model, part)
            for name, kind in _WRITABLE.items():
                if part == getattr(mujoco.mjtState, f"mjSTATE_{kind}"):
                    setattr(self, name, self._rows[:, start : start + size])
            for name, (kind, width) in _MOCAP.items():
                if part == getattr(mujoco.mjtState, f"mjSTATE_{kind}"):
                    setattr(self, name, self._rows[:, start : start + size].reshape(self.n, -1, width))
            start += size
        self._pull(range(self.n))

    @property
    def state(self) -> ArrayWorlds:  # type: ignore[override]
        return self

    def __getattr__(self, name: str) -> np.ndarray:
        """Return an array of mjData, stacked over worlds."""
        if name.startswith("_") or not isinstance(getattr(mujoco.MjData, name, None), property):
            raise AttributeError(f"ArrayWorlds and mjData have no attribute {name!r}")
        if name not in self._stacked:
            found = np.stack([np.asarray(getattr(data, name)) for data in self.datas])
            found.flags.writeable = False
            self._stacked[name] = found
        return self._stacked[name]

    def start_episode(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        super().start_episode(world, drawn)
        self._pull([world])

    def settle(self, worlds: np.ndarray) -> None:
        self._push(worlds)
        super().settle(worlds)

    def step(self, skipped: Collection[int]) -> dict[int, str]:
        moving = [world for world in range(self.n) if world not in skipped]
        self._push(moving)
        broken = super().step(skipped)
        for world in broken:
            self.require_places(world)
        self._pull(range(self.n))
        return broken

    def get_state(self) -> dict[str, np.ndarray]:
        self._push(range(self.n))
        return super().get_state()

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        super().set_state(state, worlds)
        self._pull(worlds)

    def _push(self, worlds: Collection[int] | np.ndarray) -> None:
        for world in worlds:
            mujoco.mj_setState(self.bodies.models[world], self.datas[world], self._rows[world], _ALL)
        self._stacked.clear()

    def _pull(self, worlds: Collection[int] | np.ndarray) -> None:
        for world in worlds:
            mujoco.mj_getState(self.bodies.models[world], self.datas[world], self._rows[world], _ALL)
        self._stacked.clear()


def _parts() -> list[str]:
    """Return the names of the parts of a MuJoCo state (such as "mjSTATE_QPOS"), in order, without combined parts."""
    kinds = {name: int(getattr(mujoco.mjtState, name)) for name in dir(mujoco.mjtState) if name.startswith("mjSTATE_")}
    return sorted((name for name, bits in kinds.items() if bits.bit_count() == 1), key=lambda name: kinds[name])
