"""Trial renderings of a world, which determine the errors of sampling methods before the renderer is built.

A trial renders some of an eye's receptors and compares their signals with signals from many more rays. The errors due
to rays and areas are computed for random receptors and, if there are objects, also for receptors that see one
(`sim.render.populations`). Errors due to depth layers are computed only for random receptors. Seeds are fixed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

import optics
from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.eyes import BODY_RADIUS
from sim.eyes.sampling import BoxSampling, EyeSampling, Trial
from sim.render.populations import Population, everywhere, near_objects
from sim.render.random_views import RandomViews
from sim.render.ray_kernel import SECOND
from sim.render.world_scene import WorldScene
from sim.scene.device_arrays import floats
from sim.scene.variant import variant
from sim.tracing import lighting
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.areas.illumination import FrameState
from sim.tracing.areas.patch import Area
from sim.tracing.eye_ray import EyeRay

# Chosen: the cost of a trial, and how much finer than the trial its reference ("truth") is.
RAYS = 2**19  # largest number of rays in one trial, unless that leaves too few views
TRUE_RAYS = 2**21  # largest number of rays in a reference for areas
VIEWS = (12, 96)  # smallest and largest number of views in a trial
FINER = 8  # smallest ratio of the reference's rays to the trial's
TRUE = 4096  # smallest number of rays of a reference behind a pupil
TRUE_AREA = (1024, 8192)  # smallest and largest number of rays per receptor in a reference for areas
WEIGHTS = 2**23  # largest number of weights of a reference, unless it would then not be finer than the trial


class FidelityTrials:
    """Trials of sampling methods in one scene."""

    def __init__(self, scene: WorldScene) -> None:
        assert isinstance(scene.eye, optics.Eye)
        self._scene, self._eyes, self._eye = scene, scene.eyes, scene.eye
        self._everywhere = everywhere(scene, VIEWS[1])
        self._views, self._receptors = self._everywhere.views, self._everywhere.receptors
        self._known: dict[DepthLayers, list[Population]] = {}

    def _populations(self, sampling: EyeSampling) -> list[Population]:
        if not self._scene.world.objects:
            return [self._everywhere]
        if sampling.depth not in self._known:
            near = near_objects(self._scene, sampling, VIEWS[1], TRUE)
            self._known[sampling.depth] = [self._everywhere, near]
        return self._known[sampling.depth]

    def errors(self, sampling: EyeSampling, light: str = lighting.DIRECT) -> Callable[[float], float]:
        """Return a function that maps rays per receptor to the root mean square error of signals.

        In worlds with objects, the result is the larger of the errors for random receptors and for views of objects.

        Raises:
            NoRaysError: raised by the returned function if a receptor has no rays.
        """
        truths: dict[int, list[np.ndarray]] = {}
        populations = self._populations(sampling)
        receptors = np.prod(self._eyes.resolution)
        least = TRUE / receptors if self._eye.pupil else FINER
        planes = sampling.depth.count * self._eye.bands * len(self._receptors)
        most = WEIGHTS / planes / (receptors if self._eye.pupil else len(self._receptors))

        def error(rays_per_receptor: float) -> float:
            # A power of 4, so that one reference serves several trials.
            finer = max(2 * rays_per_receptor, min(max(FINER * rays_per_receptor, least), most))
            level = int(np.ceil(np.log(finer) / np.log(4) - 1e-9))
            if level not in truths:
                truths[level] = [
                    self._signals(sampling.trial(4.0**level, p.receptors), sampling.depth, light, p.views)
                    for p in populations
                ]
            errors = []
            for p, truth in zip(populations, truths[level], strict=True):
                trial = sampling.trial(rays_per_receptor, p.receptors)
                size = len(trial.directions) * len(truth)  # limits the trial to the views of its reference
                errors.append(p.rms(self._signals(trial, sampling.depth, light, p.views, size) - truth))
            return max(errors)

        return error

    def have_areas(self, *lights: str) -> bool:
        """Return whether this eye and this world permit area sampling with light of all these kinds.

        lights: "direct" (light after one reflection), "bounce" (one or two) or "all" (any number of reflections)
        """
        if self._eye.lattice is not None:
            return False
        try:
            for light in lights:
                self._scene.areas(light)
        except ValueError:
            return False
        return True

    def area_errors(self, sampling: EyeSampling, light: str) -> Callable[[float], float]:
        """Return a function that maps the number of areas per receptor to the root mean square error of signals.

        The reference has many random rays, whose noise adds to the error. With objects, the result is as in `errors`.
        """
        populations = self._populations(sampling)
        truths = [
            self._signals(self._truth(sampling, p.receptors), sampling.depth, light, p.views, TRUE_RAYS)
            for p in populations
        ]

        def error(areas: float) -> float:
            errors = []
            for p, truth in zip(populations, truths, strict=True):
                trial = self._scene.area_trial(sampling, areas, p.receptors)
                views = p.views.take(len(truth))
                errors.append(p.rms(self._signals(trial, sampling.depth, light, views, TRUE_RAYS) - truth))
            return max(errors)

        return error

    def may_share(self, sampling: EyeSampling, per_receptor: float) -> bool:
        """Return whether neighbouring receptors still differ if they share areas of the visual field."""
        return self._scene.may_share(sampling, per_receptor)

    def areas_of_field(self, sampling: EyeSampling, per_receptor: float) -> float:
        """Return the number of areas per receptor, including the areas beyond the rim of the retina."""
        n = len(self._scene.area_trial(sampling, per_receptor, self._receptors[:1]).directions)
        return n / float(np.prod(self._eyes.resolution)) if self._eye.pupil else float(n)

    def _truth(self, sampling: EyeSampling, receptors: np.ndarray) -> Trial:
        """Return a trial with many rays for these receptors, whose signals are the reference for area sampling."""
        of_a_view = TRUE_RAYS // (VIEWS[1] // 2)
        if isinstance(sampling, BoxSampling):
            return sampling.trial(int(np.clip(of_a_view // len(receptors), *TRUE_AREA)), receptors)
        planes = sampling.depth.count * self._eye.bands * len(receptors)
        rays = min(of_a_view, max(WEIGHTS // planes, TRUE))
        own = replace(sampling, fields=sampling.fields.drawn_for(receptors))
        return own.trial(rays / np.prod(self._eyes.resolution), receptors)

    def reflected_more_often(self, sampling: EyeSampling) -> float:
        """Return the root mean square, over receptors and views, of the signals due to more than two reflections."""
        trial = self._scene.area_trial(sampling, 1, self._receptors)
        twice, all_ = (self._signals(trial, sampling.depth, light) for light in lighting.LEVELS[1:])
        return _rms(all_ - twice)

    def reflected_twice(self, sampling: EyeSampling) -> tuple[float, float]:
        """Return root mean squares of the signals due to the second reflection and to direct light.

        Both are for the group with the larger first value: random receptors, or receptors that see an object.

        Raises:
            ValueError: light cannot be followed after the first reflection.
        """
        found = []
        for p in self._populations(sampling):
            trial = sampling.trial(TRUE / np.prod(self._eyes.resolution), p.receptors)
            direct, both = (self._signals(trial, sampling.depth, light, p.views) for light in lighting.LEVELS[:2])
            found.append((p.rms(both - direct), p.rms(direct)))
        return max(found)

    def errors_of_layers(self, finest: DepthLayers, counts: tuple[int, ...]) -> dict[int, float]:
        """Return, for each n in `counts`, the root mean square error of signals with n depth layers.

        The reference has the same rays and all layers in `finest`. The n layers are evenly spaced among these.

        Raises:
            optics.AccuracyError: see `optics.Eye.kernel`.
        """
        sampling = self._scene.camera_sampling(finest)
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
        """Return the depth of the surface that each ray hits, along the eye's axis [m], sorted; infinite for no hit."""
        _, z = self._trace(self._views, BoxSampling(self._eye).trial(4, self._receptors), lighting.DIRECT)
        return np.sort(np.array(z))

    def _signals(
        self, trial: Trial, depth: DepthLayers, light: str, views: RandomViews | None = None, most: int = RAYS
    ) -> np.ndarray:
        """Return signals (view, channel, receptor) in the first views, as many as `most` allows.

        trial: samples (rays or areas), with their weights in the signals
        depth: layers, among which a surface's light is divided by its distance; light: reflections, see `Fidelity`
        views: places and directions of the eyes; None: the random views of this object
        most: largest total number of samples, which limits the number of views to a value from 12 to 96
        """
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
        return _summed(weights, layers)

    def _factors(self, light: str, trial: Trial) -> np.ndarray:
        """Return the contribution of component k of the light in band b to channel c: mixing[c, b] basis[k, b].

        The shape is (channel, component, band). `mixing` is a band's weight times the aperture's throughput. Signals
        are sum_bklp mixing[c, b] basis[k, b] W_lb[r, p] light_lk[p] for the weight W of ray p, receptor r and layer l.
        """
        basis = (self._scene.areas if trial.extent else self._scene.tracers.tracer_for)(light).basis
        return self._eye.aperture_throughput * np.einsum("cb,kb->ckb", self._eye.spectral_bands.weights, basis)

    def _see_areas(self, views: RandomViews, trial: Trial, light: str, depth: DepthLayers) -> list[np.ndarray]:
        """Return the mean light in all areas of a trial: a flat array (view, area) per layer and light component."""
        tracer = self._scene.areas(light)
        origins, directions = views.in_agents(self._eyes, trial.directions)
        n = len(trial.directions)
        assert trial.extent is not None
        with variant(self._scene.variant):
            origin, agent = _points(origins, n), _points(views.agents, n)
            width, height = (dr.opaque(mi.Float, side) for side in trial.extent)
            ray = mi.Ray3f(origin, mi.Vector3f([floats(d) for d in np.moveaxis(directions, -1, 0)]))
            axis = mi.Vector2f((origin - agent).xy) * (1 / BODY_RADIUS)
            area = Area.from_extent(ray, axis, (width, height))
            world, bodies = dr.arange(mi.UInt32, n * len(views)) // n, [*np.moveaxis(views.objects, 1, 0), views.agents]
            now = FrameState([_points(b, n) for b in bodies], tracer.inputs, world, self._lit(tracer, bodies))
            components = tracer.radiance(area, tracer.border_faces(area, tracer.inputs), now, depth)
            dr.eval(components)
            return [np.array(c) for c in components]

    def _lit(self, tracer: AreaTracer, bodies: list[np.ndarray]) -> list[Array]:
        """Return the tracer's table of the light that falls on bodies with these centres, (view, 3) each."""
        if not tracer.places:
            return []
        place = dr.arange(mi.UInt32, tracer.places * len(bodies[0])) % tracer.places
        return tracer.body_light(place, [_points(b, tracer.places) for b in bodies], tracer.inputs)

    def _trace(self, views: RandomViews, trial: Trial, light: str) -> tuple[list[Array], Array]:
        """Return the components of light along a trial's rays, and the depth of the visible surface [m].

        All are Dr.Jit arrays, flat (view, ray). The depth is measured along the axis of each view's eye.
        """
        origins, world = views.in_agents(self._eyes, trial.directions)
        rays, tracer = len(trial.directions), self._scene.tracers.tracer_for(light)
        with variant(self._scene.variant):
            ray = mi.Ray3f(_points(origins, rays), mi.Vector3f([floats(d) for d in np.moveaxis(world, -1, 0)]))
            agent, cosine = _points(views.agents, rays), floats(np.tile(trial.directions[:, 2], len(views)))
            seen = EyeRay(ray, mi.Vector3f(0), cosine, agent)  # built-in worlds have no headlight
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


def _in_fours(trial: Trial) -> np.ndarray:
    """Return two numbers that determine the first bounce of each ray, and two for the second, (ray, 4)."""
    return np.concatenate([trial.bounce_samples, np.random.default_rng(SECOND).random(trial.bounce_samples.shape)], 1)


def _summed(weights: np.ndarray, layers: np.ndarray) -> np.ndarray:
    """Return signals (view, channel, receptor): weighted light, summed over depth layers, components and rays.

    The weights are (channel, layer, component, receptor, ray), and the light (`layers`) is (layer, component, view,
    ray). `np.einsum` takes up to twice as long.
    """
    (channels, receptors), views = (weights.shape[0], weights.shape[3]), layers.shape[2]
    of_receptors = np.moveaxis(weights, 3, 1).reshape(channels * receptors, -1)
    seen = np.moveaxis(layers, 2, 0).reshape(views, -1)
    return np.asarray((seen @ of_receptors.T).reshape(views, channels, receptors))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _points(points: np.ndarray, rays: int) -> Array:
    """Return the points (view, 3) on the device, repeated for all rays of each view (Point3f)."""
    return mi.Point3f([floats(np.repeat(column, rays)) for column in points.T])
