"""Views of a world on which ways of sampling it are tried before any kernel is recorded.

A trial looks through some of an eye's receptors and compares what it sees with what many times as many rays see. It is
judged where that matters: over all receptors in views of any place, and over those that see an object in views in
which there is one near, lest what decides over an agent's life vanish among receptors that see floor and wall. All is
drawn with fixed seeds: the same world and eyes give the same answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.eyes import BODY_RADIUS
from sim.eyes.sampling import BoxSampling, EyeSampling, Trial
from sim.render.random_views import RandomViews, near_views, on_objects, random_views
from sim.render.ray_kernel import SECOND
from sim.render.world_scene import WorldScene
from sim.scene.device_arrays import floats
from sim.scene.variant import variant
from sim.tracing import lighting
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.areas.illumination import Moment
from sim.tracing.areas.patch import Area
from sim.tracing.eye_ray import EyeRay

# Choices: how much a trial may cost, and how much finer than what it tries its truth is.
RECEPTORS = 24  # looked through, at most
RAYS = 2**19  # of one trial, at most, unless that leaves too few views
TRUE_RAYS = 2**21  # the same of a truth for areas
VIEWS = (12, 96)  # of one trial, at least and at most
FINER = 8  # times as many rays, at least, for what is taken as the truth
TRUE = 4096  # rays of it, at least, behind a pupil
TRUE_AREA = (1024, 8192)  # rays of it for each receptor, at least and at most, where areas are tried
WEIGHTS = 2**23  # of it, at most, unless it would not be finer
ON_OBJECT = 0.02  # share of what a receptor sees, at least, where it sees an object


@dataclass(frozen=True)
class Population:
    """Views, and which receptors of them count, (view, receptor)."""

    views: RandomViews
    counted: np.ndarray

    def rms(self, error: np.ndarray) -> float:
        """Of an error (view, channel, receptor) in the first so many views; 0 where nothing counts."""
        counted = np.broadcast_to(self.counted[: len(error), None], error.shape)
        return float(np.sqrt(np.mean(error[counted] ** 2))) if counted.any() else 0.0


class FidelityTrials:
    """Tries ways of sampling in one scene."""

    def __init__(self, scene: WorldScene) -> None:
        self._scene, self._eyes, self._eye = scene, scene.eyes, scene.eye
        self._views = random_views(scene.world, scene.eyes, VIEWS[1])
        receptors = np.random.default_rng(0).permutation(int(np.prod(scene.eyes.resolution)))
        self._receptors = np.sort(receptors[:RECEPTORS])
        self._known: dict[DepthLayers, list[Population]] = {}

    @cached_property
    def _everywhere(self) -> Population:
        return Population(self._views, np.ones((len(self._views), len(self._receptors)), bool))

    def _populations(self, sampling: EyeSampling) -> list[Population]:
        if sampling.depth not in self._known:
            self._known[sampling.depth] = self._drawn(sampling)
        return self._known[sampling.depth]

    def _drawn(self, sampling: EyeSampling) -> list[Population]:
        if not self._scene.world.objects:
            return [self._everywhere]
        near = near_views(self._scene.world, self._eyes, VIEWS[1])
        trial = sampling.trial(TRUE / np.prod(self._eyes.resolution), self._receptors)
        hits = on_objects(
            near,
            *near.in_agents(self._eyes, trial.directions),
            np.array([self._scene.model.geom_size[geom, 0] for geom in _objects(self._scene)]),
        )
        weights = trial.weights.sum(axis=0)
        shares = np.einsum("rp,vp->vr", weights, hits) / weights.sum(axis=-1)
        return [self._everywhere, Population(near, shares > ON_OBJECT)]

    def errors(self, sampling: EyeSampling, light: str = lighting.DIRECT) -> Callable[[float], float]:
        """Root mean square error of the signals with so many rays per receptor, of the population that has more.

        Raises:
            NoRaysError: a receptor has none, when the function that is returned is called.
        """
        truths: dict[int, list[np.ndarray]] = {}
        populations = self._populations(sampling)
        receptors = np.prod(self._eyes.resolution)
        least = TRUE / receptors if self._eye.pupil else FINER
        planes = sampling.depth.count * self._eye.bands * len(self._receptors)
        most = WEIGHTS / planes / (receptors if self._eye.pupil else len(self._receptors))

        def error(rays_per_receptor: float) -> float:
            # In powers of 4, so that a truth serves several.
            finer = max(2 * rays_per_receptor, min(max(FINER * rays_per_receptor, least), most))
            level = int(np.ceil(np.log(finer) / np.log(4) - 1e-9))
            if level not in truths:
                true = sampling.trial(4.0**level, self._receptors)
                truths[level] = [self._signals(true, sampling.depth, light, p.views) for p in populations]
            trial = sampling.trial(rays_per_receptor, self._receptors)
            size = len(trial.directions) * len(truths[level][0])  # no views beyond the truth's
            return max(
                population.rms(self._signals(trial, sampling.depth, light, population.views, size) - truth)
                for population, truth in zip(populations, truths[level], strict=True)
            )

        return error

    def have_areas(self, *lights: str) -> bool:
        """Whether they see this world in all of these."""
        try:
            for light in lights:
                self._scene.areas(light)
        except ValueError:
            return False
        return True

    def area_errors(self, sampling: EyeSampling, light: str) -> Callable[[float], float]:
        """The same with so many areas per receptor; the truth's own noise is part of it."""
        true = self._truth(sampling)
        populations = self._populations(sampling)
        truths = [self._signals(true, sampling.depth, light, p.views, TRUE_RAYS) for p in populations]

        def error(areas: float) -> float:
            trial = self._scene.area_trial(sampling, areas, self._receptors)
            found = (
                (p, self._signals(trial, sampling.depth, light, p.views.take(len(t)), TRUE_RAYS) - t)
                for p, t in zip(populations, truths, strict=True)
            )
            return max(population.rms(error) for population, error in found)

        return error

    def may_share(self, sampling: EyeSampling, per_receptor: float) -> bool:
        """Whether receptors may share areas, so many for each: not where they would become copies of each other."""
        return self._scene.may_share(sampling, per_receptor)

    def areas_seen(self, sampling: EyeSampling, per_receptor: float) -> float:
        """How many are seen per receptor where each one has so many: behind a pupil, some around."""
        n = len(self._scene.area_trial(sampling, per_receptor, self._receptors[:1]).directions)
        return n / float(np.prod(self._eyes.resolution)) if self._eye.pupil else float(n)

    def _truth(self, sampling: EyeSampling) -> Trial:
        """Rays that areas are held against; behind a pupil those that these receptors see."""
        of_a_view = TRUE_RAYS // (VIEWS[1] // 2)
        if isinstance(sampling, BoxSampling):
            return sampling.trial(int(np.clip(of_a_view // len(self._receptors), *TRUE_AREA)), self._receptors)
        planes = sampling.depth.count * self._eye.bands * len(self._receptors)
        rays = min(of_a_view, max(WEIGHTS // planes, TRUE))
        own = replace(sampling, fields=sampling.fields.drawn_for(self._receptors))
        return own.trial(rays / np.prod(self._eyes.resolution), self._receptors)

    def reflected_more_often(self, sampling: EyeSampling) -> float:
        """Root mean square of what light that is reflected more than twice adds to the signals, as areas see it."""
        trial = self._scene.area_trial(sampling, 1, self._receptors)
        twice, all_ = (self._signals(trial, sampling.depth, light) for light in lighting.LEVELS[1:])
        return _rms(all_ - twice)

    def reflected_twice(self, sampling: EyeSampling) -> tuple[float, float]:
        """Root mean square of what light that is reflected twice adds to the signals, and of direct light's signals, of
        the population that it adds more to.

        Raises:
            ValueError: it cannot be followed.
        """
        trial = sampling.trial(TRUE / np.prod(self._eyes.resolution), self._receptors)
        found = []
        for p in self._populations(sampling):
            direct, both = (self._signals(trial, sampling.depth, light, p.views) for light in lighting.LEVELS[:2])
            found.append((p.rms(both - direct), p.rms(direct)))
        return max(found)

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

    def _signals(
        self, trial: Trial, depth: DepthLayers, light: str, views: RandomViews | None = None, most: int = RAYS
    ) -> np.ndarray:
        """(view, channel, receptor), of as many views as that many rays allow."""
        rays = len(trial.directions)
        views = (views or self._views).take(int(np.clip(most // rays, *VIEWS)))
        if trial.extent:
            shared = self._see_areas(views, trial, light, depth)
        else:
            components, z = self._trace(views, trial, light)
            with variant(self._scene.variant):
                shared = [np.array(share * c) for share in depth.shares(dr.rcp(z)) for c in components]
        layers = np.reshape(shared, (depth.count, -1, len(views), rays))
        planes = trial.weights.reshape(depth.count, -1, *trial.weights.shape[1:])
        weights = np.einsum("ckb,lbrp->clkrp", self._factors(light, trial), planes, optimize=True).astype(np.float32)
        return np.einsum("clkrp,lkvp->vcr", weights, layers, optimize=True)

    def _factors(self, light: str, trial: Trial) -> np.ndarray:
        """(channel, component, band): signals_c = sum_b mixing[c, b] sum_l sum_k basis[k, b] sum_p W_lb[r, p]
        light_lk[p]."""
        basis = (self._scene.areas if trial.extent else self._scene.tracers.of)(light).basis
        return self._eye.aperture_throughput * np.einsum("cb,kb->ckb", self._eye.spectral_bands.weights, basis)

    def _see_areas(self, views: RandomViews, trial: Trial, light: str, depth: DepthLayers) -> list[np.ndarray]:
        """Components of the mean light in a trial's areas, for each depth layer, flat (view, area)."""
        tracer = self._scene.areas(light)
        origins, directions = views.in_agents(self._eyes, trial.directions)
        n = len(trial.directions)
        assert trial.extent is not None
        with variant(self._scene.variant):
            origin, agent = _points(origins, n), _points(views.agents, n)
            width, height = (dr.opaque(mi.Float, side) for side in trial.extent)
            ray = mi.Ray3f(origin, mi.Vector3f([floats(d) for d in np.moveaxis(directions, -1, 0)]))
            axis = mi.Vector2f((origin - agent).xy) * (1 / BODY_RADIUS)
            area = Area.of(ray, axis, (width, height))
            world, bodies = dr.arange(mi.UInt32, n * len(views)) // n, [*np.moveaxis(views.objects, 1, 0), views.agents]
            now = Moment([_points(b, n) for b in bodies], tracer.inputs, world, self._lit(tracer, bodies))
            components = tracer.radiance(area, tracer.met_by(area, tracer.inputs), now, depth)
            dr.eval(components)
            return [np.array(c) for c in components]

    def _lit(self, tracer: AreaTracer, bodies: list[np.ndarray]) -> list[Array]:
        """The tracer's table of lit bodies, for their centres (view, 3)."""
        if not tracer.places:
            return []
        place = dr.arange(mi.UInt32, tracer.places * len(bodies[0])) % tracer.places
        return tracer.lit(place, [_points(b, tracer.places) for b in bodies], tracer.inputs)

    def _trace(self, views: RandomViews, trial: Trial, light: str) -> tuple[list[Array], Array]:
        """Components of light along a trial's rays of each view's eye, and from how far along its axis [m]: Dr.Jit,
        flat (view, ray)."""
        origins, world = views.in_agents(self._eyes, trial.directions)
        rays, tracer = len(trial.directions), self._scene.tracers.of(light)
        with variant(self._scene.variant):
            ray = mi.Ray3f(_points(origins, rays), mi.Vector3f([floats(d) for d in np.moveaxis(world, -1, 0)]))
            agent, cosine = _points(views.agents, rays), floats(np.tile(trial.directions[:, 2], len(views)))
            seen = EyeRay(ray, mi.Vector3f(0), cosine, agent)  # no headlight shines along an axis here
            samples = mi.Vector4f(0)
            if light == lighting.BOUNCE:
                samples = mi.Vector4f([floats(np.tile(column, len(views))) for column in _in_fours(trial).T])
            buffers = tracer.buffers(len(views))
            buffers.fill(self._scene.poses_at(views.position, views.heading, views.objects))
            lanes = dr.arange(mi.UInt32, rays * len(views)) // rays
            there = tracer.around(tracer.scene, buffers.arrays(), tracer.inputs, lanes)
            components, t = tracer.radiance(seen, there, samples)
            z = t * cosine
            dr.eval(components, z)
            return components, z


def _objects(scene: WorldScene) -> list[int]:
    """Ids of the objects' geoms."""
    bodies = [scene.model.body(name).id for name in scene.world.objects]
    return [int(np.flatnonzero(scene.model.geom_bodyid == body)[0]) for body in bodies]


def _in_fours(trial: Trial) -> np.ndarray:
    """Bounce samples, and as many for a second reflection."""
    return np.concatenate([trial.bounce_samples, np.random.default_rng(SECOND).random(trial.bounce_samples.shape)], 1)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _points(points: np.ndarray, rays: int) -> Array:
    """The same for all rays of a view."""
    return mi.Point3f([floats(np.repeat(column, rays)) for column in points.T])
