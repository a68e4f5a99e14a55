"""Model of an agent without the walls and objects of its world.

`sim.physics.local_contacts` uses it to simulate contacts with the few walls near the agent.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from optics.numerics.kept_values import KeptValues
from sim.scene.model_hash import MOST_MODELS, model_hash

ROOM = 4  # number of walls that may be near an agent: two that form a corner, and one or two others within reach
_KEPT = KeptValues(MOST_MODELS)


@dataclass(frozen=True)
class AgentModel:
    """Model of an agent without the walls and objects of its world.

    model: the agent, and 4 boxes (ROOM) that do not collide, which are placeholders for walls; there are no objects,
        walls, lights, cameras or textures
    whole: hash of the world's complete model; the agent was extracted from this model
    """

    model: mujoco.MjModel
    whole: bytes

    @classmethod
    def from_spec(cls, spec: mujoco.MjSpec, whole: mujoco.MjModel) -> AgentModel:
        """Return the model of an agent: a spec's body "agent" without the rest of the world.

        whole: the model that has been compiled from this spec

        The agent's model is cached, and calls return the same model if the hashes of their `whole` are equal, so do not
        change it. It is cached because extraction is slow: removing hundreds of walls from a copy of the spec takes
        half a second.
        """
        whole_hash = model_hash(whole)
        return cls(_KEPT.get(whole_hash, lambda: _alone(spec.copy())), whole_hash)

    def stands_for(self, model: mujoco.MjModel) -> bool:
        """Return whether the agent was extracted from this model, and the model has not been changed since then."""
        return self.whole == model_hash(model)


def _alone(spec: mujoco.MjSpec) -> mujoco.MjModel:
    for body in spec.worldbody.bodies:
        if body.name != "agent":
            spec.delete(body)
    for element in [*spec.worldbody.geoms, *spec.worldbody.sites, *spec.lights, *spec.cameras]:
        spec.delete(element)
    seen = [*spec.materials, *spec.textures]
    plain = spec.add_material(name="plain").name  # in MuJoCo 3.14, an empty name does not remove a material
    for element in [*spec.geoms, *spec.sites]:
        element.material = plain
    for element in seen:
        spec.delete(element)
    for _ in range(ROOM):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 1], contype=0, conaffinity=0)
    return spec.compile()
