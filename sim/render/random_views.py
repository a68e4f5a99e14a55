"""Random views of a world for trials of sampling methods; the same world always has the same views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.eyes.eyes import EYE_HEIGHT, Eyes, eye_positions, eye_rotations
from sim.worlds.layout import CLEARANCE
from sim.worlds.world import World

# Largest distance from a cell's centre along either axis [m]. It is less than half a cell minus the radius of the
# agent's body, 1 - 0.2.
STRAY = 0.75
NEAR = (0.8, 8.0)  # distances from an object's centre [m] at which its appearance decides the agents' actions
TRIES = 100


@dataclass(frozen=True)
class RandomViews:
    """Views of single eyes; the first axis is the view.

    position: position of the agent [m], (n, 2)
    heading: azimuth to which the agent looks [rad], (n,)
    objects: centres of the objects [m], (n, k, 3)
    eye: index of the eye to which the view belongs, (n,)
    """

    position: np.ndarray
    heading: np.ndarray
    objects: np.ndarray
    eye: np.ndarray

    def take(self, n: int) -> RandomViews:
        """Return the first n views."""
        return RandomViews(self.position[:n], self.heading[:n], self.objects[:n], self.eye[:n])

    def __len__(self) -> int:
        return len(self.heading)

    @property
    def agents(self) -> np.ndarray:
        """Centres of the agents' bodies [m], (n, 3)."""
        return np.column_stack([self.position, np.full(len(self), EYE_HEIGHT)])

    def in_agents(self, eyes: Eyes, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return each view's eye position [m], (view, 3), and `directions` in the world's frame, (view, direction, 3).

        directions: unit vectors in the frame of an eye, the same for all eyes, (direction, 3)
        """
        azimuths = eyes.azimuths()
        in_agent = np.einsum("eij,rj->eri", eye_rotations(azimuths), directions)[self.eye]
        return self.agents + self._turned(eye_positions(azimuths)[self.eye]), self._turned(in_agent)

    def _turned(self, vectors: np.ndarray) -> np.ndarray:
        """Rotate vectors (n, ..., 3) about z, from the agents' frames to the world's frame."""
        heading = self.heading.reshape(-1, *[1] * (vectors.ndim - 2))
        cos, sin, (x, y) = np.cos(heading), np.sin(heading), (vectors[..., 0], vectors[..., 1])
        turned: np.ndarray = vectors.copy()
        turned[..., 0], turned[..., 1] = cos * x - sin * y, sin * x + cos * y
        return turned


def random_views(world: World, eyes: Eyes, n: int) -> RandomViews:
    """Return `n` random views: a random eye of an agent that stands at a random place with a random heading.

    The place is in a cell in which agents or objects may start an episode. Objects are on random cells in which objects
    may start. The views are the same at every call, because the seed is fixed.
    """
    rng = np.random.default_rng(0)
    cells, objects = _cells(world), _objects(world, n, rng)
    position = np.empty((n, 2))
    for i in range(n):
        position[i] = _clear_of(objects[i, :, :2], lambda: cells[rng.integers(len(cells))] + _stray(rng))
    return RandomViews(position, rng.uniform(-np.pi, np.pi, n), objects, rng.integers(eyes.n_eyes, size=n))


def near_views(world: World, eyes: Eyes, n: int) -> RandomViews:
    """Return views in which an eye of an agent has an object in its field of view, at a distance of 0.8 to 8 m (NEAR).

    Places and directions are random, with a fixed seed.
    """
    rng = np.random.default_rng(1)
    objects, cells = _objects(world, n, rng), _cells(world)
    position, heading, eye = np.empty((n, 2)), np.empty(n), rng.integers(eyes.n_eyes, size=n)
    half = np.radians(eyes.fov_deg) / 2
    for i in range(n):

        def beside(target: np.ndarray = objects[i, 0, :2]) -> np.ndarray:
            for _ in range(TRIES):
                azimuth, distance = rng.uniform(-np.pi, np.pi), rng.uniform(*NEAR)
                place = target + distance * np.array([np.cos(azimuth), np.sin(azimuth)])
                if np.abs(cells - place).max(axis=1).min() <= STRAY:
                    break
            return place

        position[i] = _clear_of(objects[i, :, :2], beside, NEAR[0] - 1e-9)
        towards = objects[i, 0, :2] - position[i]
        heading[i] = np.arctan2(towards[1], towards[0]) - eyes.azimuths()[eye[i]] + rng.uniform(-half, half)
    return RandomViews(position, heading, objects, eye)


def on_objects(views: RandomViews, origins: np.ndarray, directions: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return a mask of the directions in which an eye sees an object, array (view, direction).

    Objects are spheres.

    views: views with the centres of the objects
    origins: positions of the eyes [m], array (view, 3)
    directions: unit vectors in the world, array (view, direction, 3)
    radii: radii of the objects [m], array (object,)
    """
    found = np.zeros(directions.shape[:2], bool)
    for k, radius in enumerate(radii):
        way = views.objects[:, k] - origins
        along = np.einsum("vri,vi->vr", directions, way)
        found |= (along > 0) & ((way**2).sum(axis=-1)[:, None] - along**2 < radius**2)
    return found


def _cells(world: World) -> np.ndarray:
    return np.concatenate([world.agent_spawn, world.object_spawn.reshape(-1, 2)])


def _objects(world: World, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return the objects' centres [m], (n, k, 3)."""
    k = len(world.objects)
    heights = np.array([world.model.body(name).pos[2] for name in world.objects])
    objects = np.empty((n, k, 3))
    for i in range(n if k else 0):
        places = world.object_spawn[rng.choice(len(world.object_spawn), k, replace=len(world.object_spawn) < k)]
        objects[i] = np.column_stack([places, heights])
    return objects


def _stray(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-STRAY, STRAY, 2)


def _clear_of(objects: np.ndarray, draw: Callable[[], np.ndarray], clearance: float = CLEARANCE) -> np.ndarray:
    """Return a random place [m], (2,), that is clear of objects.

    Up to 100 places are drawn. If none of them is clear, the last one is returned.

    objects: centres of the objects [m], array (object, 2)
    draw: function that returns a random place [m], (2,)
    clearance: a place is clear if its distance from every object's centre is larger than this [m]
    """
    place = np.zeros(2)
    for _ in range(TRIES):
        place = draw()
        if (np.linalg.norm(objects - place, axis=-1) > clearance).all():
            break
    return place
