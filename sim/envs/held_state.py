"""Checks of stored states of environments, before they are restored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from optics.numerics.number_types import readable
from sim.physics.mujoco_worlds import MODELS
from sim.scene.poses import world_indices


def checked(state: Any, like: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """Return a stored state, after checking that it has the same entries and shapes as the current state `like`.

    If there is only one world, the entry with the worlds' models is optional, because this entry exists only after a
    task has changed the model of the world.

    Raises:
        ValueError: the state has other entries, or an entry of another shape.
    """
    optional = {MODELS} if len(like["steps"]) == 1 else set()
    if not isinstance(state, Mapping) or (state.keys() ^ like.keys()) - optional:
        raise ValueError(f"state: must be the return value of get_state, with the entries {', '.join(like)}")
    for name, array in like.items():
        if name not in state:
            continue
        if np.shape(readable(f"state: {name}", state[name])) != array.shape:
            raise ValueError(f"state: {name} has shape {np.shape(state[name])}: must be {array.shape}")
    return state


def chosen_worlds(worlds: Any, n: int) -> np.ndarray:
    """Return these indices of worlds as an array, (k,) int; None: the indices of all n worlds.

    Raises:
        ValueError: `worlds` contains other values than indices of worlds.
    """
    return np.arange(n) if worlds is None else world_indices("worlds", worlds, n)
