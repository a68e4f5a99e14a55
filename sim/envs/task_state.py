"""Where worlds of a task stand: all that their future follows from, as plain arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from sim.envs.task_worlds import TaskWorlds
from sim.tasks.encounter import name_of

MODELS = "models"  # of worlds with models of their own
_ALL = mujoco.mjtState.mjSTATE_INTEGRATION


def of_worlds(worlds: TaskWorlds) -> dict[str, np.ndarray]:
    """Physics, chance and steps of every world, and its model, if it has one of its own; each array's first axis is the
    world.

    Raises:
        RuntimeError: bodies may sleep, which MuJoCo's state says nothing of.
    """
    if worlds.model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        raise RuntimeError("get_state: the model has <flag sleep>, and who sleeps is in no state: must be disabled")
    size = mujoco.mj_stateSize(worlds.model, _ALL)
    physics = np.empty((len(worlds.datas), size))
    for row, data in zip(physics, worlds.datas, strict=True):
        mujoco.mj_getState(worlds.model, data, row, _ALL)
    chance = np.array([json.dumps(rng.bit_generator.state) for rng in worlds.rngs])
    felt = {_felt(worlds, k): array.copy() for k, array in enumerate(worlds.felt)}
    varied = {_varied(name): array.copy() for name, array in worlds.varied.items()}
    held = [np.frombuffer(worlds.bodies.held(i), np.uint8) for i in range(len(worlds.datas)) if worlds.bodies.own]
    models = {MODELS: np.stack(held)} if held else {}
    return {"physics": physics, "chance": chance, "steps": worlds.steps.copy(), **models, **felt, **varied}


def bring_back(worlds: TaskWorlds, state: Mapping[str, np.ndarray], chosen: np.ndarray) -> None:
    """Worlds `chosen` as they were."""
    for i in chosen:
        for name, values in worlds.varied.items():
            values[i] = state[_varied(name)][i]
        worlds.bodies.begin(i, {name: values[i] for name, values in worlds.varied.items()})
        if MODELS in state:
            worlds.bodies.own = True
            worlds.bodies.hold(i, np.asarray(state[MODELS][i], np.uint8).tobytes())
        data, model, row = worlds.datas[i], worlds.bodies.models[i], np.ascontiguousarray(state["physics"][i])
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, row, _ALL)
        mujoco.mj_forward(model, data)
        mujoco.mj_setState(model, data, row, _ALL)  # the solver's warm start, which mj_forward has moved
        worlds.rngs[i].bit_generator.state = json.loads(str(state["chance"][i]))
        worlds.steps[i] = state["steps"][i]
        for k, felt in enumerate(worlds.felt):
            felt[i] = state[_felt(worlds, k)][i]


def _felt(worlds: TaskWorlds, number: int) -> str:
    """What an animal's part is called."""
    return "felt" if number == 0 else f"{name_of(worlds.animals[number])}.felt"


def _varied(name: str) -> str:
    return f"varied.{name}"


def checked(state: Any, like: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """A state as `like`, of the same shapes. An only world's model may be its own in one of them: it was changed on the
    way.

    Raises:
        ValueError: it has other entries, or an entry of another shape.
    """
    optional = {MODELS} if len(like["steps"]) == 1 else set()
    if not isinstance(state, Mapping) or (state.keys() ^ like.keys()) - optional:
        raise ValueError(f"state: must be what get_state returns, with the entries {', '.join(like)}")
    for name, array in like.items():
        if name not in state:
            continue
        if np.shape(state[name]) != array.shape:
            raise ValueError(f"state: {name} has shape {np.shape(state[name])}: must be {array.shape}")
    return state


def chosen_worlds(worlds: Any, n: int) -> np.ndarray:
    """Numbers of worlds; None: all.

    Raises:
        ValueError: they are no numbers of worlds.
    """
    if worlds is None:
        return np.arange(n)
    chosen = np.atleast_1d(np.asarray(worlds))
    if chosen.ndim != 1 or chosen.dtype.kind not in "iu" or ((chosen < 0) | (chosen >= n)).any():
        raise ValueError(f"worlds = {worlds!r:.80}: must be numbers of worlds, from 0 to {n - 1}")
    return chosen
