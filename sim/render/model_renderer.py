"""Eyes mounted on any MuJoCo model, seen through in many worlds at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import mujoco
import numpy as np

import optics
from optics.numerics.arguments import whole
from optics.spectra.spectrum import Spectrum
from sim.eyes.allowed_error import allowed_error
from sim.eyes.inside import depth_inside
from sim.eyes.mounts import Mount, mounts_of
from sim.eyes.sampling import BoxSampling, directions_of, eye_sampling
from sim.render.edge_rays import FIRST, EdgeRays
from sim.render.fidelity import EDGES, Fidelity
from sim.render.memory_budget import Demand, check_memory
from sim.render.model_wavefront import ModelWavefront
from sim.render.optic_flow import flow_between, receptor_centres
from sim.render.pending_frame import FrameSlot, PendingFrame
from sim.render.renderable import renderable
from sim.scene import source
from sim.scene.appearances import Varied
from sim.scene.mirror import VISIBLE_GROUPS
from sim.scene.poses import Poses
from sim.scene.variant import variant as in_variant
from sim.tracing.model_scene import ModelScene
from sim.tracing.model_tracer import ModelTracer

MOST_ENVS = 2**31 - 1
Worlds: TypeAlias = Poses | Sequence[mujoco.MjData] | mujoco.MjData  # where everything is in all of them


class ModelRenderer:
    """Sees many worlds of one model with eyes of one kind, wherever they are mounted on it.

    model: an MjModel, or what compiles to one (`sim.mirror`)
    eye: its optics and retina; its bands are the fidelity's
    mounts: where on the model the eyes are
    n_envs: number of worlds
    fidelity: rays per receptor and bands; None: 16 rays in the direct light of lamps and the eye's own bands, 4 by
        default. light="bounce" adds light that is reflected twice, and what the sky and what glows send;
        samples="edges" for that many rays only where a few of them differ, in direct light
    groups, spectra: see `sim.mirror`
    varied: names of geoms whose size or colour may differ from world to world: as `poses` say, by the worlds' mjModels;
        {"floor": ("sand", "grass")}: and names of the materials that one may have, in the place of other colours
    brightest: signal of a white surface that faced all directional lights at once

    Warns (`sim.MirrorWarning`) once of what eyes do not see of the model, and of lamps with lines in too few bands.

    Raises:
        ValueError: a bad argument, a mount on what the model does not have, an eye that looks aside of it, or is inside
            of a sphere, a capsule, another primitive or a closed mesh in the model's reference pose, or a fidelity that
            wants areas or light that is reflected more often, or more rays than there is memory for.
        optics.AccuracyError: a pupil whose light spreads too far.
    """

    def __init__(
        self,
        model: mujoco.MjModel | mujoco.MjSpec | str,
        eye: optics.Eye,
        mounts: Sequence[Mount],
        n_envs: int = 1,
        fidelity: Fidelity | None = None,
        *,
        groups: Sequence[int] = VISIBLE_GROUPS,
        spectra: Mapping[str, Spectrum | str] | None = None,
        varied: Varied = (),
    ) -> None:
        self.n_envs = whole("n_envs", n_envs, 1, MOST_ENVS)
        self.fidelity = fidelity = renderable(fidelity, eye)
        self.model, self.mounts = source.load(model), mounts_of("mounts", mounts)
        self.eye = replace(eye, bands=fidelity.bands)
        self._places = [_Place(mount, self.model) for mount in self.mounts]
        if not self._places:
            raise ValueError("mounts = []: must be one sim.Mount at least")
        wavelengths = self.eye.spectral_bands.wavelengths
        self._check_memory()
        self._scene = ModelScene(self.model, self.eye, groups, spectra, varied, light=fidelity.light)
        self._refuse_eyes_inside()
        sampling = eye_sampling(self.eye, fidelity.depth)
        at_edges = fidelity.samples == EDGES
        self.sensor = sampling.sensor(FIRST if at_edges else fidelity.rays_per_receptor)
        mixing = self.eye.aperture_throughput * self.eye.spectral_bands.weights
        with in_variant(self._scene.variant):
            self._tracer = ModelTracer(self._scene, wavelengths, fidelity.light)
            suns = [light.level for light in self._scene.lights.found if light.kind == "directional"]
            arriving = np.sum([np.zeros(len(wavelengths)), *suns], axis=0) / np.pi
            self._sunlight = self.eye.throughput * self.eye.spectral_bands.weights * arriving
            self.brightest = self.brightest_in(np.ones(len(wavelengths)))
            basis = self._tracer.basis
            self._sums = self.sensor.receptor_sums(mixing, basis)
            self._radiance_sums = self.sensor.receptor_sums(np.eye(len(wavelengths)), basis)
            self._wavefront = ModelWavefront(self._scene, self._tracer, self.sensor, self.n_envs, len(self.mounts))
            centres = directions_of(self.eye, receptor_centres(self.eye))
            along = {"light": self.sensor.directions, "depth": centres, "which": centres}
            bounces = self.sensor.bounce_samples
            self._looks = {
                what: self._wavefront.look(directions, bounces if what == "light" else None)
                for what, directions in along.items()
            }
            self._edges: EdgeRays | None = None
            if at_edges:
                assert isinstance(sampling, BoxSampling)
                rays, noticed = fidelity.rays_per_receptor, allowed_error(self.eye, fidelity.tolerance)
                self._edges = EdgeRays(self._wavefront, sampling, rays, mixing @ basis.T, noticed)
        self._slot = FrameSlot()

    def signals(self, poses: Worlds, light: np.ndarray | None = None) -> np.ndarray:
        """Noise-free photoreceptor signals, (env, eye, channel, height, width) float32.

        poses: of every world, after mj_forward or mj_step: its data, or arrays stacked over worlds; the data of an only
            world need not be in a list
        light: what all lights of each world are multiplied by, (env, band); None: nothing

        Raises:
            ValueError: another number of worlds, another model's data, poses that are not finite or not known yet, what
                differs from the model and is not in `varied`, or light of another shape.
        """
        return self.begin(poses, light).wait()

    def begin(self, poses: Worlds, light: np.ndarray | None = None) -> PendingFrame:
        """Begin to see; it runs beside whatever comes next, until the signals are waited for."""
        if light is None:
            return self._begin(poses, "light").then(self._signals)
        shape = self.n_envs, len(self._tracer.basis)
        if np.shape(light) != shape:
            raise ValueError(f"light has shape {np.shape(light)}: must be (env, band), {shape}")
        per_view = np.repeat(np.asarray(light, np.float32).T, len(self.mounts), axis=1)[..., None]  # (band, view, 1)

        def lit(found: np.ndarray) -> np.ndarray:
            layers = found.reshape(-1, *per_view.shape[:2], found.size // (self.sensor.depth.count * per_view.size))
            return self._signals(layers * per_view)

        return self._begin(poses, "light").then(lit)

    def brightest_in(self, light: np.ndarray) -> float:
        """`brightest` where all lights are multiplied by this, (band,)."""
        return float((self._sunlight @ light).max())

    def receptor_radiance(self, poses: Worlds) -> np.ndarray:
        """Spectral radiance averaged over every receptor's field, (band, env, eye, height, width) float32."""
        light = self._planes(self._begin(poses, "light").wait())
        found = self._radiance_sums(light).reshape(self.n_envs, len(self.mounts), -1, *self.eye.resolution)
        return np.moveaxis(found, 2, 0)

    def depth(self, poses: Worlds) -> np.ndarray:
        """How far what each receptor's centre looks at is, along the eye's axis [m], (env, eye, height, width) float32;
        infinite where there is nothing."""
        found = self._begin(poses, "depth").wait()
        return found.reshape(self.n_envs, len(self.mounts), *self.eye.resolution)

    def ids(self, poses: Worlds) -> np.ndarray:
        """Which geom each receptor's centre looks at, (env, eye, height, width) int32; -1 where there is nothing."""
        found = self._begin(poses, "which").wait().astype(int)
        geoms = np.concatenate([self._scene.movers.geoms, self._scene.told_apart[1]])
        return geoms[found].astype(np.int32).reshape(self.n_envs, len(self.mounts), *self.eye.resolution)

    def flow(self, poses: Worlds, later: Worlds) -> np.ndarray:
        """Optic flow from one moment to another: by how much what each receptor's centre looks at has moved on the
        retina, to the right and down [receptors], (env, eye, 2, height, width) float32; NaN where there is nothing, or
        where it is no longer before the eye."""
        moments = _placed(poses), _placed(later)
        self._check_poses(moments[1])
        frames = self.eye_frames(moments[0]), self.eye_frames(moments[1])
        return flow_between(self.eye, self.depth(moments[0]), self.ids(moments[0]), moments, frames)

    def eye_frames(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        """Pupils [m] (world, eye, 3) and eyes' frames (world, eye, 3, 3), columns (right, up, ahead)."""
        frames = [place.frames(poses) for place in self._places]
        origins, rotations = zip(*frames, strict=True)
        return np.stack(origins, axis=1), np.stack(rotations, axis=1)

    @property
    def moving(self) -> int:
        """How many geoms move."""
        return len(self._scene.movers)

    @property
    def only_directional(self) -> bool:
        """Whether there are no points, which light what is near more brightly, no sky, and nothing that glows."""
        scene = self._scene
        return all(light.kind == "directional" for light in scene.lights.found) and not (scene.has_sky or scene.glows)

    @property
    def spectra(self) -> Mapping[str, Spectrum]:
        """Measured ones of materials and lights, by name."""
        return self._scene.spectra

    @property
    def recordings(self) -> int:
        """How often the kernels were recorded: once per kernel in use, up to three times where meshes move."""
        edges = 0 if self._edges is None else self._edges.recordings
        kernels = self._wavefront.light, self._wavefront.depth, self._wavefront.which
        return sum(int(kernel.n_recordings) for kernel in kernels) + edges

    def _begin(self, poses: Worlds, what: str) -> PendingFrame:
        placed = _placed(poses)
        self._check_poses(placed)
        pupils, rotations = self.eye_frames(placed)
        eyes = np.concatenate([pupils[:, :, None], np.swapaxes(rotations, -1, -2)], axis=2)
        look, edges = self._looks[what], self._edges
        if edges is not None and what == "light":
            return self._slot.begin(lambda: edges.launch(placed, eyes))
        kernel = getattr(self._wavefront, what)
        return self._slot.begin(lambda: self._wavefront.launch(kernel, look, placed, eyes))

    def _signals(self, light: np.ndarray) -> np.ndarray:
        signals = self._sums(self._planes(light))
        bands = self.eye.spectral_bands
        signals = signals.reshape(self.n_envs, len(self.mounts), len(bands.weights), *self.eye.resolution)
        mosaic = self.eye.mosaic
        return signals if mosaic is None else np.take_along_axis(signals, mosaic[None, None, None], axis=2)

    def _planes(self, light: np.ndarray) -> np.ndarray:
        """(plane, view, ray)"""
        return light.reshape(self.sensor.depth.count * len(self._tracer.basis), self.n_envs * len(self.mounts), -1)

    def _check_memory(self) -> None:
        fidelity, planes = self.fidelity, self.fidelity.depth.count * self.fidelity.bands
        weights = 0 if self.eye.pupil is None else planes
        eyes, size = len(self.mounts), self.eye.resolution
        check_memory(Demand(fidelity.rays_per_receptor, self.n_envs, eyes, size, planes, weights))

    def _check_poses(self, poses: Poses) -> None:
        if poses.n != self.n_envs:
            raise ValueError(f"poses of {poses.n} worlds, this renderer was built for n_envs = {self.n_envs}")
        if poses.geom_xpos.shape[1] != self.model.ngeom or poses.xpos.shape[1] != self.model.nbody:
            raise ValueError("poses of another model")
        if not np.isfinite(poses.geom_xpos).all():
            world = int(np.flatnonzero(~np.isfinite(poses.geom_xpos).all(axis=(1, 2)))[0])
            raise ValueError(f"poses of world {world} are not finite")
        placed = poses.geom_xmat.any(axis=(1, 2, 3))
        if not placed.all():
            raise ValueError(
                f"data of world {int(np.argmin(placed))} says nothing yet of where things are; call "
                "mujoco.mj_forward(model, data) first"
            )
        self._scene.as_built.refuse_differences(poses)

    def _refuse_eyes_inside(self) -> None:
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        pupils, _ = self.eye_frames(Poses.of([data]))
        for mount, pupil in zip(self.mounts, pupils[0], strict=True):
            for geom in self._scene.geoms:
                if (depth := depth_inside(self.model, data, geom, pupil)) > 0:
                    name = self.model.geom(geom).name or f"{geom}"
                    raise ValueError(
                        f"Mount on {mount.on!r}: the eye is inside geom {name!r}, {depth:.2g} m below its surface: "
                        f"offset must lead out of it"
                    )


class _Place:
    """Where an eye is on a model."""

    def __init__(self, mount: Mount, model: mujoco.MjModel) -> None:
        self._kind, self._index = mount.found_in(model)
        self._origin, self._rotation = mount.local(self._kind)

    def frames(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        origins, rotations = poses.frames(self._kind, self._index)
        return origins + rotations @ self._origin, rotations @ self._rotation


def _placed(poses: Worlds) -> Poses:
    return poses if isinstance(poses, Poses) else Poses.of(poses)
