"""State of a batch of worlds as plain arrays.

Physics computes the next state, renderers compute the eyes' signals for a state, and recorders store it.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from optics.numerics.number_types import all_finite
from optics.numerics.read_only import ReadOnlyArrays
from sim.worlds.world import World


@dataclass(frozen=True)
class WorldState(ReadOnlyArrays):
    """All worlds of a batch at one instant; the first axis is the world.

    position: position of the agent [m], (n, 2)
    heading: heading of the agent [rad], in [-π, π), (n,)
    velocity: velocity of the agent [m/s], (n, 2)
    objects: centres of the objects, in the order of World.objects [m], (n, k, 3)
    object_heading: direction in which each object moves [rad], (n, k)
    start: the agent's starting position in this episode [m], (n, 2)
    steps: number of actions taken in this episode, (n,) int
    goals_reached: number of goals reached in this episode, (n,) int
    adversaries_reached: number of adversaries reached in this episode, (n,) int
    """

    position: np.ndarray
    heading: np.ndarray
    velocity: np.ndarray
    objects: np.ndarray
    object_heading: np.ndarray
    start: np.ndarray
    steps: np.ndarray
    goals_reached: np.ndarray
    adversaries_reached: np.ndarray

    @property
    def n(self) -> int:
        """Number of worlds."""
        return len(self.position)

    @property
    def all_finite(self) -> bool:
        """True if all positions, headings and velocities, of agents and objects in all worlds, are finite."""
        return all(map(all_finite, (self.heading, self.position, self.velocity, self.objects, self.object_heading)))

    @property
    def finite(self) -> np.ndarray:
        """True for worlds in which all positions, headings and velocities are finite, (n,) bool."""
        total = self.heading + self.position.sum(axis=1) + self.velocity.sum(axis=1)
        total += self.objects.sum(axis=(1, 2)) + self.object_heading.sum(axis=1)
        finite: np.ndarray = np.isfinite(total)
        return finite

    def repaired(self) -> WorldState:
        """Return a copy in which 0 replaces all numbers that are not finite."""
        return WorldState(**{name: np.nan_to_num(array, posinf=0.0, neginf=0.0) for name, array in vars(self).items()})

    def take(self, worlds: np.ndarray) -> WorldState:
        """Return a batch with copies of the worlds with these indices only."""
        return WorldState(**{name: array[worlds] for name, array in vars(self).items()})

    def put(self, worlds: np.ndarray, other: WorldState) -> WorldState:
        """Return a new batch in which the worlds of `other` replace the worlds with these indices."""
        arrays = {name: array.copy() for name, array in vars(self).items()}
        # Usually only one world is replaced, and assigning to a slice is then faster.
        places = slice(worlds[0], worlds[0] + 1) if len(worlds) == 1 else worlds
        for name, array in arrays.items():
            array[places] = getattr(other, name)
        return WorldState(**arrays)


def concatenate(states: list[WorldState]) -> WorldState:
    """Return one batch that contains the worlds of several batches."""
    return WorldState(**{name: np.concatenate([getattr(s, name) for s in states]) for name in vars(states[0])})


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Return the equivalent angles in [-π, π) [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def pose(data: mujoco.MjData, world: World, state: WorldState, index: int = 0) -> None:
    """Copy the agent's position and heading, and the objects' positions, from one world's state to MuJoCo's data.

    index: index of this world in `state`
    """
    data.joint("agent_x").qpos[0], data.joint("agent_y").qpos[0] = state.position[index]
    data.joint("agent_heading").qpos[0] = state.heading[index]
    for name, centre in zip(world.objects, state.objects[index], strict=True):
        data.mocap_pos[world.model.body(name).mocapid[0]] = centre
    mujoco.mj_forward(world.model, data)
