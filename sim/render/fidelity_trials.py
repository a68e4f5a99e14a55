"""A few random views of a world, on which numbers of rays are tried before any kernel is recorded.

A trial looks through some of an eye's receptors, at random places and headings of a world, and compares what it sees
with what many times as many rays see. All is drawn with fixed seeds: the same world and eyes give the same answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.eyes import EYE_HEIGHT, Eyes, eye_positions, eye_rotations
from sim.eyes.sensor import BoxSampling, EyeSampling, Trial
from sim.render.frozen_kernels import aligned
from sim.render.prepared_scene import PreparedScene
from sim.scene.variant import variant
from sim.tasks.placement import CLEARANCE
from sim.tracing import lighting
from sim.worlds.world import World

# Choices: how much a trial may cost, and how much finer than what it tries its truth is.
RECEPTORS = 24  # looked through, at most
RAYS = 2**19  # of one trial, at most, unless that leaves too few views
VIEWS = (12, 96)  # of one trial, at least and at most
FINER = 8  # times as many rays, at least, for what is taken as the truth
TRUE = 4096  # rays of it, at least, behind a pupil
WEIGHTS = 2**23  # of it, at most, unless it would not be finer
# [m] from a cell's centre, along either axis: less than half a cell without the agent's body, 1 - 0.2.
STRAY = 0.75


@dataclass(frozen=True)
class RandomViews:
    """Views of single eyes; first axis: view.

    position: of the agent [m], (n, 2) · heading [rad], (n,) · objects: centres [m], (n, k, 3) · eye: which, (n,)
    """

    position: np.ndarray
    heading: np.ndarray
    objects: np.ndarray
    eye: np.ndarray

    def take(self, n: int) -> RandomViews:
        """The first n."""
        return RandomViews(self.position[:n], self.heading[:n], self.objects[:n], self.eye[:n])

    def __len__(self) -> int:
        return len(self.heading)


def random_views(world: World, eyes: Eyes, n: int) -> RandomViews:
    """Agents about the cells where agents or objects may start, looking anywhere; objects on theirs."""
    rng = np.random.default_rng(0)
    k = len(world.objects)
    heights = np.array([world.model.body(name).pos[2] for name in world.objects])
    everywhere = np.concatenate([world.agent_spawn, world.object_spawn.reshape(-1, 2)])
    position, objects = np.empty((n, 2)), np.empty((n, k, 3))
    for i in range(n):
        if k:
            places = world.object_spawn[rng.choice(len(world.object_spawn), k, replace=len(world.object_spawn) < k)]
            objects[i] = np.column_stack([places, heights])
        position[i] = _clear_of(objects[i, :, :2], everywhere, rng)
    return RandomViews(position, rng.uniform(-np.pi, np.pi, n), objects, rng.integers(eyes.n_eyes, size=n))


def _clear_of(objects: np.ndarray, cells: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    place = np.zeros(2)
    for _ in range(100):
        place = cells[rng.integers(len(cells))] + rng.uniform(-STRAY, STRAY, 2)
        if (np.linalg.norm(objects - place, axis=-1) > CLEARANCE).all():
            break
    return place


class FidelityTrials:
    """Tries ways of sampling in one scene."""

    def __init__(self, scene: PreparedScene) -> None:
        self._scene, self._eyes, self._eye = scene, scene.eyes, scene.eye
        self._views = random_views(scene.world, scene.eyes, VIEWS[1])
        receptors = np.random.default_rng(0).permutation(int(np.prod(scene.eyes.resolution)))
        self._receptors = np.sort(receptors[:RECEPTORS])

    def errors(self, sampling: EyeSampling, light: str = lighting.DIRECT) -> Callable[[float], float]:
        """Root mean square error of the signals with so many rays per receptor.

        Raises:
            NoRaysError: a receptor has none, when the function that is returned is called.
        """
        truths: dict[int, np.ndarray] = {}
        receptors = np.prod(self._eyes.resolution)
        least = TRUE / receptors if self._eye.pupil else FINER
        planes = sampling.depth.count * self._eye.bands * len(self._receptors)
        most = WEIGHTS / planes / (receptors if self._eye.pupil else len(self._receptors))

        def error(rays_per_receptor: float) -> float:
            # In powers of 4, so that a truth serves several.
            finer = max(2 * rays_per_receptor, min(max(FINER * rays_per_receptor, least), most))
            level = int(np.ceil(np.log(finer) / np.log(4) - 1e-9))
            if level not in truths:
                truths[level] = self._signals(sampling.trial(4.0**level, self._receptors), sampling.depth, light)
            truth = truths[level]
            found = self._signals(sampling.trial(rays_per_receptor, self._receptors), sampling.depth, light, len(truth))
            return _rms(found - truth)

        return error

    def reflected_twice(self, sampling: EyeSampling) -> tuple[float, float]:
        """Root mean square of what light that is reflected twice adds to the signals, and of direct light's signals.

        Raises:
            ValueError: it cannot be followed.
        """
        trial = sampling.trial(TRUE / np.prod(self._eyes.resolution), self._receptors)
        direct, both = (self._signals(trial, sampling.depth, light) for light in lighting.LEVELS)
        return _rms(both - direct), _rms(direct)

    def errors_of_layers(self, finest: DepthLayers, counts: tuple[int, ...]) -> dict[int, float]:
        """Root mean square difference to the signals with the finest layers, all with the same rays; the nodes of each
        count must be among those of the finest.

        Raises:
            optics.AccuracyError: see `optics.Eye.kernel`.
        """
        sampling = self._scene.sampling(finest)
        trial = sampling.trial(TRUE / np.prod(self._eyes.resolution), self._receptors)
        truth = self._signals(trial, finest, lighting.DIRECT)
        nodes = trial.weights.reshape(finest.count, -1, *trial.weights.shape[1:])
        found = {}
        for n in counts:
            chosen = np.linspace(0, finest.count - 1, n).astype(int) if n > 1 else [finest.count // 2]
            weights = nodes[chosen].reshape(-1, *trial.weights.shape[1:])
            fewer = replace(finest, count=n)
            signals = self._signals(replace(trial, weights=weights), fewer, lighting.DIRECT)
            found[n] = _rms(signals - truth)
        return found

    def distances(self) -> np.ndarray:
        """Of what the eyes see, along their axes [m], sorted; infinite where they see nothing."""
        _, z = self._trace(self._views, BoxSampling(self._eye).trial(4, self._receptors), lighting.DIRECT)
        return np.sort(np.array(z))

    def _signals(self, trial: Trial, depth: DepthLayers, light: str, n: int | None = None) -> np.ndarray:
        """(view, channel, receptor), of as many views as the rays allow."""
        rays = len(trial.directions)
        views = self._views.take(n or int(np.clip(RAYS // rays, *VIEWS)))
        components, z = self._trace(views, trial, light)
        with variant(self._scene.static.variant):
            shared = [np.array(share * c) for share in depth.shares(dr.rcp(z)) for c in components]
        layers = np.reshape(shared, (depth.count, len(components), len(views), rays))
        # signals_c = sum_b mixing[c, b] sum_l sum_k basis[k, b] sum_p W_lb[r, p] light_lk[p]
        basis = self._scene.tracers.of(light).basis
        factors = self._eye.throughput * np.einsum("cb,kb->ckb", self._eye.spectral_bands.weights, basis)
        planes = trial.weights.reshape(depth.count, -1, *trial.weights.shape[1:])
        weights = np.einsum("ckb,lbrp->clkrp", factors, planes, optimize=True).astype(np.float32)
        return np.einsum("clkrp,lkvp->vcr", weights, layers, optimize=True)

    def _trace(self, views: RandomViews, trial: Trial, light: str) -> tuple[list[Array], Array]:
        """Components of light along a trial's rays of each view's eye, and from how far along its axis [m]: Dr.Jit,
        flat (view, ray)."""
        directions, azimuths = trial.directions, self._eyes.azimuths()
        in_agent = np.einsum("eij,rj->eir", eye_rotations(azimuths), directions)[views.eye]
        origins = eye_positions(azimuths)[views.eye]
        cos, sin = np.cos(views.heading), np.sin(views.heading)
        zero, one = np.zeros_like(cos), np.ones_like(cos)
        turn = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]])
        world = np.einsum("ijv,vjr->ivr", turn, in_agent)
        agent = np.column_stack([views.position, np.full(len(views), EYE_HEIGHT)])
        start = agent + np.einsum("ijv,vj->vi", turn, origins)
        rays, tracer = len(directions), self._scene.tracers.of(light)

        def lanes(points: np.ndarray) -> Array:
            """The same for all rays of a view."""
            return mi.Point3f([_lanes(np.repeat(column, rays)) for column in points.T])

        with variant(self._scene.static.variant):
            ray = mi.Ray3f(lanes(start), mi.Vector3f([_lanes(d) for d in world]))
            centres = [lanes(views.objects[:, k]) for k in range(views.objects.shape[1])]
            bounce_sample = None
            if light == lighting.BOUNCE:
                bounce_sample = mi.Point2f([_lanes(np.tile(column, len(views))) for column in trial.bounce_samples.T])
            components, t = tracer.radiance(tracer.scene, ray, lanes(agent), centres, tracer.inputs, bounce_sample)
            z = t * _lanes(np.tile(directions[:, 2], len(views)))
            dr.eval(components, z)
            return components, z


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _lanes(values: np.ndarray) -> Array:
    """An array of the device's. Aligned, or Dr.Jit would compile the same kernel anew for every alignment."""
    lanes = aligned(values.size, np.float32)
    lanes[:] = values.ravel()
    return mi.Float(lanes)
