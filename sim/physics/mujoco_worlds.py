"""Worlds of any MuJoCo model, each with its own mjData, stepped on several threads."""

from __future__ import annotations

import copy
import math
from collections.abc import Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import mujoco
import numpy as np

from optics.numerics.arguments import of_kind, whole
from sim.physics.physics import MOST_THREADS, MOST_WORLDS
from sim.scene.poses import Poses
from sim.scene.variation import Drawn, Variation
from sim.scene.world_models import WorldModels

__all__ = ["MujocoWorlds"]

MODELS = "models"  # entry of a stored state that contains the worlds' models, if each world has its own model
MOST_SUBSTEPS = 10**9  # chosen
_ALL = mujoco.mjtState.mjSTATE_INTEGRATION
_UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class MujocoWorlds:
    """`n` worlds of one model; `sim.Physics` describes the methods.

    given: the source from which the model was compiled
    model: the compiled model
    n: number of worlds, 1 to 1,000,000
    threads: number of threads on which worlds are stepped, 1 to 65,536
    substeps: physics steps per action, 1 to 10⁹
    variation: ranges of quantities that differ between episodes; None: there are none
    datas: attribute, mjData of every world
    bodies: attribute, object that holds one model (mjModel) for all worlds together, or one for each world

    Raises:
        ValueError: an argument has the wrong type or is out of range, or `variation` names an object that the model
            lacks or that cannot vary.
    """

    def __init__(
        self,
        given: Any,
        model: mujoco.MjModel,
        n: int,
        threads: int = 1,
        substeps: int = 1,
        variation: Variation | None = None,
    ) -> None:
        of_kind("model", model, mujoco.MjModel, "mujoco.MjModel.from_xml_path('robot.xml')")
        n, threads = whole("n", n, 1, MOST_WORLDS), whole("threads", threads, 1, MOST_THREADS)
        substeps = whole("substeps", substeps, 1, MOST_SUBSTEPS)
        if variation is not None:
            of_kind("variation", variation, Variation, "Variation({'light': (0.5, 2)}), or None")
        self.model, self.n, self.substeps = model, n, substeps
        self.seconds = substeps * float(model.opt.timestep)
        self.bodies = WorldModels(given, model, n, variation)
        self.varied: Mapping[str, tuple[str, ...]] = self.bodies.varied
        self.datas = [mujoco.MjData(model) for model in self.bodies.models]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self.frames, self.passed = 1, list[Poses]()
        self._watched = b""
        self.chance: Any = None

    @property
    def state(self) -> list[mujoco.MjData]:
        """mjData of all worlds; not a copy."""
        return self.datas

    def start_episode(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        data, model = self.datas[world], self.bodies.models[world]
        self.bodies.start_episode(world, drawn)
        mujoco.mj_resetData(model, data)
        self.bodies.place(data, drawn)

    def settle(self, worlds: np.ndarray) -> None:
        for world in worlds:
            mujoco.mj_forward(self.bodies.models[world], self.datas[world])

    def adopt_changed_model(self) -> bool:
        if self.bodies.differs():
            self.bodies.separate()
            self.datas = [mujoco.MjData(model) for model in self.bodies.models]
            return True
        # Renderers are built for the model after the first `reset`, in which a task may change colours or lights of
        # static objects. If worlds share one model, `self.model` is that model, so that later changes apply to all
        # worlds.
        if not self.bodies.varied:
            self.model = copy.copy(self.bodies.models[0]) if self.bodies.own else self.bodies.models[0]
        return False

    def watch(self) -> None:
        self._watched = self.bodies.noted()

    def check(self, whose: str) -> None:
        self.bodies.require_unchanged(self._watched, whose)

    def step(self, skipped: Collection[int]) -> dict[int, str]:
        moving = [world for world in range(self.n) if world not in skipped]
        self.passed, advance = [], self._pool.map if self._pool else map
        for _ in range(self.frames - 1):
            for _ in advance(self._pass_frame, moving):
                pass
            self.passed.append(self.poses())
        for _ in advance(self._move, moving):
            pass
        broken = {world: words for world in moving if (words := _broken(self.datas[world])) is not None}
        if broken and self.passed:
            self._replace_passed(list(broken))
        return broken

    def _replace_passed(self, broken: list[int]) -> None:
        """Replace the poses during the last action by the poses after it, in the worlds whose physics broke down."""
        for world in broken:
            self.require_places(world)
        fine = [world for world in range(self.n) if world not in broken]
        order, final = np.argsort([*fine, *broken]), self.poses().take(np.array(broken))
        self.passed = [Poses.joined(earlier.take(np.array(fine, int)), final).take(order) for earlier in self.passed]

    def require_places(self, world: int) -> None:
        """Reset a world if its poses are not finite, because rendering would then fail for all worlds."""
        data = self.datas[world]
        if not _has_place(data):
            mujoco.mj_resetData(data.model, data)
            mujoco.mj_forward(data.model, data)

    def poses(self) -> Poses:
        return Poses.from_data(self.datas)

    def get_state(self) -> dict[str, np.ndarray]:
        if self.model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
            raise RuntimeError("get_state: the model enables <flag sleep>, which no state contains: must be disabled")
        physics = np.empty((self.n, mujoco.mj_stateSize(self.model, _ALL)))
        for row, data in zip(physics, self.datas, strict=True):
            mujoco.mj_getState(self.model, data, row, _ALL)
        held = [np.frombuffer(self.bodies.get_state(i), np.uint8) for i in range(self.n) if self.bodies.own]
        return {"physics": physics, **({MODELS: np.stack(held)} if held else {})}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        for i in worlds:
            if MODELS in state:
                self.bodies.own = True
                self.bodies.set_state(i, np.asarray(state[MODELS][i], np.uint8).tobytes())
            data, model, row = self.datas[i], self.bodies.models[i], np.ascontiguousarray(state["physics"][i])
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, row, _ALL)
            mujoco.mj_forward(model, data)
            mujoco.mj_setState(model, data, row, _ALL)  # restores the solver's warm start, which mj_forward has changed

    def close(self) -> None:
        if self._pool:
            self._pool.shutdown()

    def _move(self, world: int) -> None:
        data = self.datas[world]
        mujoco.mj_step(data.model, data, self.substeps // self.frames)
        mujoco.mj_forward(data.model, data)

    def _pass_frame(self, world: int) -> None:
        """Advance a world to the next moment within an action; its poses are recorded at this moment.

        Receptors with dynamics see the world at these moments. After MuJoCo's steps, this method computes the poses
        that follow from the new state. It leaves the state itself unchanged and so does not affect the physics.
        """
        data = self.datas[world]
        mujoco.mj_step(data.model, data, self.substeps // self.frames)
        mujoco.mj_kinematics(data.model, data)
        mujoco.mj_comPos(data.model, data)
        mujoco.mj_camlight(data.model, data)


def _broken(data: mujoco.MjData) -> str | None:
    """Return the reason why a world's physics broke down, or None.

    MuJoCo has already reset a world with unstable positions, speeds or accelerations, unless the model disables
    automatic resets.
    """
    warned = data.warning.number
    if warned.any() and any(warned[int(kind)] for kind in _UNSTABLE):
        return (
            "physics is unstable: positions, speeds or accelerations are huge or not finite; a shorter timestep or "
            "the integrator implicitfast may help"
        )
    if warned[int(mujoco.mjtWarning.mjWARN_BADCTRL)]:  # MuJoCo has set all controls of the world to 0
        return "controls are huge or not finite: `act` must write numbers of at most 1e10"
    if not _has_place(data):
        return "physics is unstable: positions of bodies are not finite; `act` must write finite numbers"
    return None


def _has_place(data: mujoco.MjData) -> bool:
    """Return whether the positions and rotations of all bodies, and the positions of all geoms, are finite."""
    # NaN and infinity propagate through sums, and testing one sum is cheaper than testing every term.
    total = np.add.reduce
    return math.isfinite(total(data.xpos, None) + total(data.xmat, None) + total(data.geom_xpos, None))
