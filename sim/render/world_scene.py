"""A built-in world and the eyes of its agents, prepared for rendering."""

from __future__ import annotations

from typing import Any

import numpy as np

from optics.numerics.arguments import of_kind
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT, Eyes, eye_positions, eye_rotations
from sim.eyes.mounts import ring
from sim.eyes.ommatidial_sampling import OmmatidialSampling
from sim.eyes.sampling import EyeSampling
from sim.render.prepared_scene import Placed, PreparedScene
from sim.scene.moved_bodies import MovedBodies, ReferencePose
from sim.scene.poses import Poses
from sim.tracing import lighting
from sim.tracing.eye_places import LevelStand
from sim.worlds.state import WorldState
from sim.worlds.world import World

OUTSIDE = 1e-6  # height of free eyes above the skin [radii], so that rounding does not move them below it


def require_eyes_in_world(world: Any, eyes: Any) -> Eyes:
    """Return the eyes; ValueError unless the arguments are a `sim.World` and `sim.Eyes`."""
    of_kind("world", world, World, "sim.build_world('detection')")
    found: Eyes = of_kind("eyes", eyes, Eyes, "sim.Eyes(n_eyes=2)")
    return found


class WorldScene(PreparedScene):
    """A world and the eyes of every agent in it.

    world: geometry, materials and lights
    eyes: the eyes of every agent; the scene uses their spectral bands
    tracer: method of tracing rays, see `sim.BatchedRenderer`

    Raises:
        ValueError: `sim.BatchedRenderer` refuses the world or the tracer.
    """

    def __init__(self, world: World, eyes: Eyes, tracer: str = "auto") -> None:
        self.world, self.eyes = world, require_eyes_in_world(world, eyes)
        mounts = ring("agent", eyes.n_eyes, eyes.placement_range_deg, BODY_RADIUS * (1 + OUTSIDE))
        azimuths, body = eyes.azimuths(), int(world.model.body("agent").id)
        stand = LevelStand(body, EYE_HEIGHT, eye_positions(azimuths), eye_rotations(azimuths))
        super().__init__(
            world.model, eyes.eye(), mounts, spectra=world.spectra, tracer=tracer, stand=stand, medium=world.medium
        )
        self.warn_once(lighting.DIRECT)
        bodies = [body, *(int(world.model.body(name).id) for name in world.objects)]
        self._reference = ReferencePose(world.model, bodies, turning=1)
        self._turns = self._reference.poses.xmat[:, bodies[:1]]

    def camera_sampling(self, depth: DepthLayers, tolerance: float | None = None) -> EyeSampling:
        """Return the result of `sampling`; the eyes must not be compound eyes."""
        found = self.sampling(depth, tolerance)
        assert not isinstance(found, OmmatidialSampling)
        return found

    def placed(self, poses: Placed | WorldState) -> Poses:
        """Return the poses as arrays; a state is also accepted."""
        return self.poses(poses) if isinstance(poses, WorldState) else super().placed(poses)

    def poses(self, state: WorldState) -> MovedBodies:
        """Return the poses of all worlds of a state."""
        return self.poses_at(state.position, state.heading, state.objects)

    def poses_at(self, position: np.ndarray, heading: np.ndarray, objects: np.ndarray) -> MovedBodies:
        """Return the poses of worlds with agents and objects at these places.

        Agents have positions (world, 2) [m] and headings (world,) [rad], and objects have centres (world, object, 3)
        [m].
        """
        positions = np.empty((len(position), 1 + len(self.world.objects), 3))
        positions[:, 0, :2], positions[:, 0, 2], positions[:, 1:] = position, EYE_HEIGHT, objects
        rotations = np.repeat(self._turns, len(position), axis=0)
        cos, sin = np.cos(heading), np.sin(heading)
        rotations[:, 0, 0, 0] = rotations[:, 0, 1, 1] = cos
        rotations[:, 0, 1, 0], rotations[:, 0, 0, 1] = sin, -sin
        return MovedBodies(self._reference, positions, rotations)
