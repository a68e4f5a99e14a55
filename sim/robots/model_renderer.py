"""Eyes mounted on any MuJoCo model, seen through in many worlds at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

import optics
from optics.numerics.arguments import of_kind, whole
from optics.numerics.autodiff import Array
from optics.spectra.spectrum import Spectrum
from sim.eyes.sensor import eye_sampling
from sim.render.fidelity import Fidelity
from sim.render.frozen_kernels import garbage_kept
from sim.render.pending_frame import FrameSlot, PendingFrame
from sim.robots.inside import depth_inside
from sim.robots.model_scene import ModelScene
from sim.robots.model_tracer import ModelTracer, World
from sim.robots.mounts import Mount
from sim.robots.poses import Poses
from sim.scene import source
from sim.scene.device_arrays import aligned, floats, whole_numbers
from sim.scene.mirror import VISIBLE_GROUPS
from sim.scene.variant import MitsubaObject
from sim.scene.variant import variant as in_variant
from sim.tracing import lighting

MOST_ENVS = 2**31 - 1


class ModelRenderer:
    """Sees many worlds of one model with eyes of one kind, wherever they are mounted on it.

    model: an MjModel, or what compiles to one (`sim.mirror`)
    eye: its optics and retina; with the fidelity's bands
    mounts: where on the model the eyes are
    n_envs: number of worlds
    fidelity: rays per receptor and bands: `Fidelity(16, bands=4)`; light is direct
    groups, spectra: see `sim.mirror`
    brightest: signal of a white surface that faced all directional lights at once

    Warns (`sim.MirrorWarning`) once of what eyes do not see of the model.

    Raises:
        ValueError: a bad argument, a mount on what the model does not have, an eye inside a geom, or a fidelity that
            wants areas or light that was reflected twice.
        optics.AccuracyError: a pupil whose light spreads too far.
    """

    def __init__(
        self,
        model: mujoco.MjModel | mujoco.MjSpec | str,
        eye: optics.Eye,
        mounts: Sequence[Mount],
        n_envs: int = 1,
        fidelity: Fidelity = Fidelity(16, bands=4),
        *,
        groups: Sequence[int] = VISIBLE_GROUPS,
        spectra: Mapping[str, Spectrum | str] | None = None,
    ) -> None:
        self.n_envs = whole("n_envs", n_envs, 1, MOST_ENVS)
        of_kind("eye", eye, optics.Eye, "optics.Eye(resolution=(15, 15))")
        _check(fidelity)
        self.model, self.mounts, self.fidelity = source.load(model), tuple(mounts), fidelity
        self.eye = replace(eye, bands=fidelity.bands)
        self._places = [_Place(mount, self.model) for mount in self.mounts]
        if not self._places:
            raise ValueError("mounts = []: must be one sim.Mount at least")
        wavelengths = self.eye.spectral_bands.wavelengths
        self._scene = ModelScene(self.model, wavelengths, groups, spectra)
        self._refuse_eyes_inside()
        sampling = eye_sampling(self.eye, fidelity.depth)
        self.sensor = sampling.sensor(fidelity.rays_per_receptor)
        mixing = self.eye.throughput * self.eye.spectral_bands.weights
        with in_variant(self._scene.variant):
            self._tracer = ModelTracer(self._scene, wavelengths)
            suns = [light.level for light in self._scene.lights.found if light.kind == "directional"]
            self.brightest = float((mixing @ np.sum(suns, axis=0)).max() / np.pi) if suns else 0.0
            self._sums = self.sensor.receptor_sums(mixing, self._tracer.basis)
            self._prepare()

    def signals(self, poses: Poses | Sequence[mujoco.MjData]) -> np.ndarray:
        """Noise-free photoreceptor signals, (env, eye, channel, height, width) float32.

        poses: of every world, after mj_forward or mj_step: its data, or arrays stacked over worlds

        Raises:
            ValueError: another number of worlds, another model's data, or poses that are not finite.
        """
        return self.begin(poses).wait()

    def begin(self, poses: Poses | Sequence[mujoco.MjData]) -> PendingFrame:
        """Begin to see; it runs beside whatever comes next, until the signals are waited for."""
        placed = poses if isinstance(poses, Poses) else Poses.of(poses)
        self._check_poses(placed)
        return self._slot.begin(lambda: self._launch(placed)).then(self._signals)

    def eye_frames(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        """Pupils [m] (world, eye, 3) and eyes' frames (world, eye, 3, 3), columns (right, up, ahead)."""
        frames = [place.frames(poses) for place in self._places]
        origins, rotations = zip(*frames, strict=True)
        return np.stack(origins, axis=1), np.stack(rotations, axis=1)

    @property
    def recordings(self) -> int:
        """How often the kernel was recorded."""
        return int(self._frozen.n_recordings)

    def _prepare(self) -> None:
        self._slot = FrameSlot()
        n_eyes, n_rays = len(self.mounts), len(self.sensor.directions)
        self._lanes = self.n_envs * n_eyes * n_rays
        directions = np.zeros((n_rays, 4), np.float32)
        directions[:, :3] = self.sensor.directions
        self._inputs = {
            "directions": floats(directions),
            "sizes": whole_numbers([n_rays, n_eyes, self._scene.movers.n_rows, len(self._scene.lights)]),
            "lanes": dr.arange(mi.UInt32, self._lanes),
            **self._tracer.inputs,
        }
        dr.eval(self._inputs["lanes"])
        lights = max(len(self._scene.lights), 1)
        shapes = {"eyes": (n_eyes, 16), "movers": (4 * self._scene.movers.n_rows,), "lights": (lights, 8)}
        self._buffers = {
            name: aligned(self.n_envs * int(np.prod(shape)), np.float32).reshape(self.n_envs, *shape)
            for name, shape in shapes.items()
        }
        self._frozen: Any = dr.freeze(self._kernel)

    def _launch(self, poses: Poses) -> Any:
        origins, rotations = self.eye_frames(poses)
        eyes = self._buffers["eyes"].reshape(self.n_envs, -1, 4, 4)
        eyes[..., 0, :3], eyes[..., 1:, :3] = origins, np.swapaxes(rotations, -1, -2)
        self._buffers["movers"][:] = self._scene.movers.rows(poses)
        self._buffers["lights"][:, : len(self._scene.lights)] = self._scene.lights.rows(poses)
        with in_variant(self._scene.variant), garbage_kept():
            poses_ = {name: mi.Float(buffer.reshape(-1)) for name, buffer in self._buffers.items()}
            light = self._frozen(self._scene.scene, self._scene.movers.meshes, poses_, self._inputs)
        return lambda: _read(light)

    def _kernel(
        self, still: MitsubaObject, meshes: list[MitsubaObject], poses: dict[str, Array], inputs: dict[str, Array]
    ) -> Array:
        lane = inputs["lanes"]
        # Lanes that only fill up a packet read 0, and to divide by that ends the process.
        n_rays, n_eyes, n_rows, n_lights = (dr.maximum(dr.gather(mi.UInt32, inputs["sizes"], i), 1) for i in range(4))
        view = lane // n_rays
        env = view // n_eyes
        place = [mi.Vector3f(dr.gather(mi.Vector4f, poses["eyes"], view * 4 + i).xyz) for i in range(4)]
        local = dr.gather(mi.Vector4f, inputs["directions"], lane - view * n_rays)
        direction = place[1] * local.x + place[2] * local.y + place[3] * local.z
        world = World(poses["movers"], env * n_rows, poses["lights"], env * n_lights * 2)
        ray = mi.Ray3f(mi.Point3f(place[0]), direction)
        components, distance = self._tracer.radiance(still, ray, place[3], world, inputs)
        shares = self.sensor.depth.shares(dr.rcp(distance * local.z))
        layers = [component * share for share in shares for component in components]
        out = dr.zeros(mi.Float, self._lanes * len(layers))
        for k, value in enumerate(layers):
            dr.scatter(out, value, lane + k * self._lanes, mode=dr.ReduceMode.Permute)
        return dr.block_reduce(dr.ReduceOp.Add, out, self.sensor.rays_per_receptor)

    def _signals(self, light: np.ndarray) -> np.ndarray:
        planes, n_eyes = self.sensor.depth.count * len(self._tracer.basis), len(self.mounts)
        signals = self._sums(light.reshape(planes, self.n_envs * n_eyes, -1))
        bands = self.eye.spectral_bands
        signals = signals.reshape(self.n_envs, n_eyes, len(bands.weights), *self.eye.resolution)
        mosaic = self.eye.mosaic
        return signals if mosaic is None else np.take_along_axis(signals, mosaic[None, None, None], axis=2)

    def _check_poses(self, poses: Poses) -> None:
        if poses.n != self.n_envs:
            raise ValueError(f"poses of {poses.n} worlds, this renderer was built for n_envs = {self.n_envs}")
        if poses.geom_xpos.shape[1] != self.model.ngeom or poses.xpos.shape[1] != self.model.nbody:
            raise ValueError("poses of another model")
        if not np.isfinite(poses.geom_xpos).all():
            world = int(np.flatnonzero(~np.isfinite(poses.geom_xpos).all(axis=(1, 2)))[0])
            raise ValueError(f"poses of world {world} are not finite")

    def _refuse_eyes_inside(self) -> None:
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        origins, rotations = self.eye_frames(Poses.of([data]))
        for mount, origin, rotation in zip(self.mounts, origins[0], rotations[0], strict=True):
            for geom in self._scene.geoms:
                if (depth := depth_inside(self.model, data, geom, origin)) > 0:
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


def _read(light: Array) -> np.ndarray:
    """Waits for the kernel."""
    with garbage_kept():
        return np.array(light.numpy())


def _check(fidelity: Fidelity) -> None:
    of_kind("fidelity", fidelity, Fidelity, "Fidelity(16, bands=4)")
    if fidelity.light != lighting.DIRECT or fidelity.samples != "rays":
        raise ValueError(
            f"fidelity: light = {fidelity.light!r}, samples = {fidelity.samples!r}: models of one's own are seen by "
            "rays in direct light"
        )
