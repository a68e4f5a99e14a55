"""Sets of views and receptors (populations) for which errors of rendering are computed.

To test a way of rendering, the signals of a few receptors in some views are computed and compared with a reference.
There are two populations. The first contains random receptors in views from random places. The second, in worlds with
objects, contains receptors that see an object, in views with an object nearby. It is separate because objects decide
how an episode ends. Most receptors see floor and walls, and would hide errors at objects. Views and receptors are drawn
at random with fixed seeds, so the same world and eyes give the same populations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.eyes.sampling import BoxSampling, EyeSampling, Trial
from sim.render.random_views import RandomViews, near_views, on_objects, random_views
from sim.render.world_scene import WorldScene

RECEPTORS = 24  # chosen: largest number of receptors of a population
LEAST_WEIGHT = 1e-3  # weight of a receptor that sees no object, relative to one that sees an object in a single view
ON_OBJECT = 0.02  # a receptor sees an object that fills more than this fraction of its field


@dataclass(frozen=True)
class Population:
    """Views of a world, each through one eye, and the receptors for which errors of rendering are computed.

    receptors: indices of the receptors, row by row
    counted: True if the receptor's error in this view is included in the mean error, (view, receptor)
    """

    views: RandomViews
    receptors: np.ndarray
    counted: np.ndarray

    def rms(self, error: np.ndarray) -> float:
        """Return the root mean square of errors of signals, over the pairs of view and receptor that `counted` marks.

        In views near objects, for example, only the receptors that see an object are marked. The result is 0 if nothing
        is marked.

        error: error of each signal, array (view, channel, receptor)
        """
        counted = np.broadcast_to(self.counted[: len(error), None], error.shape)
        return float(np.sqrt(np.mean(error[counted] ** 2))) if counted.any() else 0.0


def everywhere(scene: WorldScene, views: int) -> Population:
    """Return a given number of views from random places, and random receptors.

    All these receptors are included in the mean error of rendering, in every view.

    views: number of views
    """
    receptors = _drawn(np.ones(int(np.prod(scene.eyes.resolution))))
    counted = np.ones((views, len(receptors)), bool)
    return Population(random_views(scene.world, scene.eyes, views), receptors, counted)


def near_objects(scene: WorldScene, sampling: EyeSampling, views: int, rays: int) -> Population:
    """Return views in which an object is near, and random receptors that see an object in some of these views.

    A receptor is included in the mean error only in the views in which it sees an object. In an eye with a wide field,
    an object fills few receptors. Receptors that often see an object are therefore drawn with a higher probability.

    views: number of views
    rays: number of rays, through all receptors together, that test which receptors see an object
    """
    near, n = near_views(scene.world, scene.eyes, views), int(np.prod(scene.eyes.resolution))
    middles = BoxSampling(scene.eye).trial(1, np.arange(n))
    receptors = _drawn(_on_objects(scene, near, middles).sum(axis=0) + LEAST_WEIGHT)
    trial = sampling.trial(rays / n, receptors)
    weights = trial.weights.sum(axis=0)
    shares = np.einsum("rp,vp->vr", weights, _on_objects(scene, near, trial)) / weights.sum(axis=-1)
    return Population(near, receptors, shares > ON_OBJECT)


def _drawn(weights: np.ndarray) -> np.ndarray:
    """Draw up to 24 receptors, with a fixed seed and with probabilities proportional to their weights.

    The result contains their indices in increasing order.
    """
    chance = weights / weights.sum()
    return np.sort(np.random.default_rng(0).choice(len(weights), min(RECEPTORS, len(weights)), replace=False, p=chance))


def _on_objects(scene: WorldScene, views: RandomViews, trial: Trial) -> np.ndarray:
    """Return which of a trial's rays hit an object, (view, ray)."""
    radii = np.array([scene.model.geom_size[geom, 0] for geom in _objects(scene)])
    return on_objects(views, *views.in_agents(scene.eyes, trial.directions), radii)


def _objects(scene: WorldScene) -> list[int]:
    """Return the ids of the objects' geoms."""
    bodies = [scene.model.body(name).id for name in scene.world.objects]
    return [int(np.flatnonzero(scene.model.geom_bodyid == body)[0]) for body in bodies]
