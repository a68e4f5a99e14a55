"""How agents move where nothing is near enough to touch: linearly, with coefficients that MuJoCo itself is asked for.

Far from walls, an agent on slide joints with velocity servos answers linearly to its speed and to the command, so one
action is a product with a few numbers. They are what the model does with its contacts switched off, so that whatever
integrator, damping or servo it has is in them; a model that answers otherwise than linearly has none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

# A model counts as linear where superposition holds to this many metres: rounding, over ten substeps of metres.
ROUNDING = 1e-11

# Path (run, substep, 2) [m] from where it begins, and velocity after each substep, of runs that start at speeds
# (run, 2) [m/s] under commands (run, 2), (run, 2) [m] from where the model has its agent, with all contacts off.
Run = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Glide:
    """One action of an agent that touches nothing.

    response       of path [m] and velocity [m/s] after each substep to a speed of 1 m/s and a command of 1, per
                   axis: (path | velocity, substep, speed | command, 2)
    lower, upper   what could be touched, as upright boxes (n, 2) [m]
    reach          how near the agent's centre may come to them and still touch nothing [m]
    strongest      command beyond which the servo saturates
    """

    response: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    reach: float
    strongest: float

    def __call__(self, velocity: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Path from where the agents are (n, substep, 2) [m], and their velocity at its end (n, 2) [m/s]."""
        forces = np.stack([velocity, command], axis=1)
        # Summed by hand: a product of matrices rounds differently with the number of worlds.
        path, speed = (
            response[:, 0] * forces[:, None, 0] + response[:, 1] * forces[:, None, 1]
            for response in (self.response[0], self.response[1, -1:])
        )
        return path, speed[:, 0]

    def touches_nothing(self, position: np.ndarray, path: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Whether the agents, on `path` from `position` (n, 2) [m], surely stay out of reach of everything, (n,)."""
        places = position[:, None] + path
        low = np.minimum(places.min(axis=1), position)[:, None] - self.reach
        high = np.maximum(places.max(axis=1), position)[:, None] + self.reach
        met = ((low < self.upper) & (high > self.lower)).all(axis=-1).any(axis=1)
        free: np.ndarray = ~met & (np.abs(command) <= self.strongest).all(axis=-1)
        return free


def glide_of(model: mujoco.MjModel, agent: int, run: Run, strongest: float) -> Glide | None:
    """What `model` does to the body `agent` away from everything; None where that is not linear, or where something
    it can touch moves or has no end."""
    obstacles = _obstacles(model, agent)
    if obstacles is None:
        return None
    unit, none = np.ones((1, 2)), np.zeros((1, 2))
    trial = np.random.default_rng(0).uniform(-1, 1, (3, 4, 2)) * strongest
    responses = [run(unit, none, none), run(none, unit, none)]
    response = np.stack([np.stack([r[kind][0] for r in responses], axis=1) for kind in (0, 1)])
    geoms = np.flatnonzero(model.geom_bodyid == agent)
    reach = float((np.linalg.norm(model.geom_pos[geoms], axis=1) + model.geom_rbound[geoms]).max())
    margin = model.geom_margin[geoms].max() + model.geom_gap[geoms].max() + obstacles[2]
    glide = Glide(response, obstacles[0], obstacles[1], reach + float(margin), strongest)
    actual = run(*trial)
    path, velocity = glide(*trial[:2])
    linear = np.abs(path - actual[0]).max() < ROUNDING and np.abs(velocity - actual[1][:, -1]).max() < ROUNDING
    return glide if linear else None


def _obstacles(model: mujoco.MjModel, agent: int) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Upright boxes around all that the agent can touch, lower and upper corners (n, 2) [m], and their largest margin
    [m]; None where one of them moves or has no end."""
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
    return (center - half)[:, :2], (center + half)[:, :2], margin
