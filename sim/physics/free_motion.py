"""Motion of agents that touch nothing: a linear response, whose coefficients are measured in MuJoCo.

Far from walls, an agent on slide joints with velocity servos responds linearly to its initial speed and to the command.
Its motion during one action is a weighted sum of the two, with constant coefficients. The coefficients are measured in
the model with contacts disabled, so they include the effects of the model's integrator, damping and servos. A model
that responds nonlinearly has no such coefficients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

# Largest deviation [m] from superposition at which a model is considered linear. It allows for rounding errors over ten
# substeps at positions of several metres.
ROUNDING = 1e-11

# Function that simulates runs with all contacts disabled. Arguments: initial speeds (run, 2) [m/s], commands (run, 2),
# and displacements from the agent's position in the model (run, 2) [m]. Results: path relative to its start, (run,
# substep, 2) [m], and velocity after each substep.
FreeSteps = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class FreeMotion:
    """Motion of an agent that touches nothing, during one action.

    response: path [m] and velocity [m/s] after each substep, for each axis: (path | velocity, substep, speed | command,
        2). One response is to an initial speed of 1 m/s with command 0, the other to a command of 1 m/s from rest.
    obstacles: ids of the geoms that could be touched (n,)
    lower, upper: axis-aligned bounding boxes of the obstacles in the horizontal plane (n, 2) [m]
    reach: largest distance between the agent's centre and an obstacle's box at which the agent may touch the obstacle
        [m]
    strongest: magnitude of a command's components [m/s]; tests showed that the response is linear up to this magnitude
    """

    response: np.ndarray
    obstacles: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    reach: float
    strongest: float

    def __call__(self, velocity: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the path of each agent, and the velocity at its end (n, 2) [m/s].

        The path (n, substep, 2) [m] is relative to the agents' positions.

        velocity, command: velocities before the action, and commanded velocities [m/s], (n, 2)
        """
        # The terms are summed explicitly, since the rounding of a matrix product depends on the number of worlds.
        paths, speeds = self.response
        # Copies for all substeps make NumPy's inner loop longer than over x and y.
        start, commanded = (np.repeat(of[:, None], len(paths), axis=1) for of in (velocity, command))
        path = paths[:, 0] * start + paths[:, 1] * commanded
        speed = speeds[-1, 0] * velocity + speeds[-1, 1] * command
        return path, speed

    @cached_property
    def _within(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Limits of the obstacles' boxes, enlarged by `reach` on every side [m].

        An agent whose centre is outside an enlarged box cannot touch the obstacle. The arrays are the lower x, lower y,
        upper x and upper y, (box,) each.
        """
        return (*(self.lower - self.reach).T.copy(), *(self.upper + self.reach).T.copy())

    def obstacles_in_reach(self, position: np.ndarray, path: np.ndarray) -> np.ndarray:
        """Return the mask of the obstacles that may be within reach of agents during their motion, (n, obstacle) bool.

        Bounding boxes of the path and of the obstacles are compared.

        position: positions at the beginning (n, 2) [m]
        path: positions after each substep, relative to `position` (n, substep, 2) [m]
        """
        steps = path.swapaxes(0, 1).copy()  # NumPy's inner loop is then over the agents and not over x and y
        low = position + np.minimum.reduce(steps, axis=0, initial=0.0)
        high = position + np.maximum.reduce(steps, axis=0, initial=0.0)
        x_from, y_from, x_to, y_to = self._within
        # The axes are compared one at a time, so that NumPy's inner loop is over the boxes.
        in_reach: np.ndarray = low[:, :1] < x_to
        in_reach &= high[:, :1] > x_from
        in_reach &= low[:, 1:] < y_to
        in_reach &= high[:, 1:] > y_from
        return in_reach

    def obeys(self, command: np.ndarray) -> np.ndarray:
        """Return True for each command if both of its components are at most `strongest` in magnitude, (n,) bool.

        command: commanded velocities [m/s], (n, 2)
        """
        obeys: np.ndarray = (np.abs(command) <= self.strongest).all(axis=-1)
        return obeys


def free_motion_of(model: mujoco.MjModel, agent: int, run: FreeSteps, strongest: float) -> FreeMotion | None:
    """Return the free motion of the body `agent` in `model`.

    The result is None if the motion is not linear, if an obstacle moves or is infinite, or if the model has contact
    pairs or flexes.

    run: simulation of the model with contacts disabled
    strongest: largest command [m/s]
    """
    obstacles = _obstacles(model, agent)
    if obstacles is None:
        return None
    unit, none = np.ones((1, 2)), np.zeros((1, 2))
    trial = np.random.default_rng(0).uniform(-1, 1, (3, 4, 2)) * strongest
    responses = [run(unit, none, none), run(none, unit, none)]
    response = np.stack([np.stack([r[kind][0] for r in responses], axis=1) for kind in (0, 1)])
    geoms = np.flatnonzero(model.geom_bodyid == agent)
    reach = float((np.linalg.norm(model.geom_pos[geoms], axis=1) + model.geom_rbound[geoms]).max())
    ids, lower, upper, their_margin = obstacles
    margin = model.geom_margin[geoms].max() + model.geom_gap[geoms].max() + their_margin
    motion = FreeMotion(response, ids, lower, upper, reach + float(margin), strongest)
    actual = run(*trial)
    path, velocity = motion(*trial[:2])
    linear = np.abs(path - actual[0]).max() < ROUNDING and np.abs(velocity - actual[1][:, -1]).max() < ROUNDING
    return motion if linear else None


def _obstacles(model: mujoco.MjModel, agent: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float] | None:
    """Return all geoms that the agent can touch.

    The result contains their ids, the lower and the upper corners (n, 2) [m] of axis-aligned boxes around them, and
    their largest margin [m]. It is None if one of them moves or is infinite, or if the model has contact pairs or
    flexes.
    """
    mine = model.geom_bodyid == agent
    meets = np.zeros(model.ngeom, bool)
    for geom in np.flatnonzero(mine):
        meets |= (model.geom_contype[geom] & model.geom_conaffinity) != 0
        meets |= (model.geom_conaffinity[geom] & model.geom_contype) != 0
    others = np.flatnonzero(meets & ~mine)
    if (model.body_weldid[model.geom_bodyid[others]] != 0).any() or model.npair or model.nflex:
        return None
    if (model.geom_rbound[others] <= 0).any():  # planes
        return None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frames = data.geom_xmat[others].reshape(-1, 3, 3)
    center = data.geom_xpos[others] + np.einsum("nij,nj->ni", frames, model.geom_aabb[others, :3])
    half = np.einsum("nij,nj->ni", np.abs(frames), model.geom_aabb[others, 3:])
    margin = float((model.geom_margin[others] + model.geom_gap[others]).max(initial=0.0))
    return others, (center - half)[:, :2], (center + half)[:, :2], margin
