"""`mirror(model)`: any MuJoCo model as a spectral Mitsuba scene that follows mjData.

The scene contains the visible geoms with their materials and textures, lights, the skybox, and cameras. Faces are
visible from the same side as in MuJoCo, so a camera inside a body sees through its surface. A MirrorWarning lists
omitted features.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.arguments import items, shown
from optics.spectra.spectrum import Spectrum
from sim.scene import bsdfs, cameras, coincident, inventory, lights, rays, shapes, source, surfaces
from sim.scene.cameras import Viewpoint
from sim.scene.pose_snapshot import PoseSnapshot, checked_data
from sim.scene.spectra import of_geom, resolve
from sim.scene.variant import DEFAULT_VARIANT, Description, MitsubaObject, default_variant
from sim.scene.variant import variant as in_variant

VISIBLE_GROUPS = (0, 1, 2)  # groups that MuJoCo draws by default


class MirrorWarning(UserWarning):
    """Warning that names features of a MuJoCo model that are missing or inaccurate in the model's Mitsuba scene."""


def mirror(
    model: mujoco.MjModel | mujoco.MjSpec | str | Path,
    data: mujoco.MjData | None = None,
    *,
    bodies: Sequence[str] | None = None,
    groups: Sequence[int] = VISIBLE_GROUPS,
    variant: str | None = None,
    spectra: Mapping[str, Spectrum | str] | None = None,
) -> Mirror:
    """Return the mirror of a MuJoCo model: a Mitsuba scene that follows the model's data.

    model: an MjModel, or a source that compiles to one: an MjSpec, the path of an MJCF, URDF or MJB file, or MJCF text.
        In an MjModel, a custom tuple must list the textures whose values are proportional to light (linear light), see
        `sim.scene.linear_textures`
    data: initial poses; None: the model's reference pose
    bodies: names of the bodies whose geoms are included ("world" is the static body); None: all bodies
    groups: visible geom groups; a geom with alpha 0 is never visible
    variant: a spectral Mitsuba variant; None: the default for this machine. "scalar_spectral" is slow but needs no LLVM
    spectra: reflectances of materials and emission of lights by name, instead of their colours. Each is an
        `optics.Spectrum` or a name of `optics.reflectance` or `optics.illuminant`. The name of the camera's light is
        "headlight".

    A MirrorWarning lists features that have no counterpart.

    Raises:
        ValueError: the model does not compile or has no visible geoms, a body is unknown, `sync` would refuse the data,
            the variant has no spectra, or `spectra` names an unknown material or light, or a material with a coloured
            texture.
        ImportError: Mitsuba lacks the variant, or cannot run it.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    return Mirror(
        source.load(model),
        data,
        bodies=bodies,
        groups=groups,
        variant=default_variant() if variant is None else variant,
        spectra=spectra,
    )


class Mirror:
    """A Mitsuba scene that mirrors a MuJoCo model, built by `mirror`.

    model, variant: see `mirror`
    scene: mi.Scene; shape ids are "geom_<geom id>_<part>"
    geoms: ids of the geoms in the scene, (n,)
    spectra: spectra of materials and lights, by name
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData | None,
        *,
        bodies: Sequence[str] | None,
        groups: Sequence[int],
        variant: str,
        spectra: Mapping[str, Spectrum | str] | None,
    ) -> None:
        if not (isinstance(variant, str) and variant.endswith("spectral")):
            raise ValueError(f"mirror: variant = {shown(variant)}: must be a spectral one such as {DEFAULT_VARIANT!r}")
        self.model, self.variant = model, variant
        self.spectra = resolve(model, spectra)
        visible = _visible(model, bodies, groups)
        self.geoms = np.array([g for g in visible if shapes.has_shape(model, g)], dtype=int)
        surfaces.require_geoms(model, self.geoms.tolist(), "mirror: ")
        data = _reference_pose(model) if data is None else checked_data(model, data)
        self._places = PoseSnapshot.from_data(data)
        together = coincident.coincidences(data, self.geoms.tolist())
        self._parts = {int(g): shapes.parts(model, g, together.lift(g)) for g in self.geoms}
        self._poses = {g: shapes.pose(data, g) for g in self._parts}
        self._bsdfs: dict[Any, MitsubaObject] = {}
        with in_variant(variant):
            self._emitters, left_out = lights.emitters(model, data, self.spectra)
            self.scene = self._build()
            self._params = mi.traverse(self.scene)
            self._names = rays.names_of(self.scene)
        self._has_warned_of_glass = False
        left_out = inventory.left_out(model, visible, groups) + left_out
        if left_out:
            warnings.warn(f"not mirrored: {'; '.join(left_out)}", MirrorWarning, stacklevel=3)
        if message := together.message(model):
            warnings.warn(message, MirrorWarning, stacklevel=3)

    def sync(self, data: mujoco.MjData) -> None:
        """Move shapes, lights and cameras whose poses in `data` (after mj_forward or mj_step) have changed.

        Raises:
            ValueError: the data belong to another model, contain no poses yet, or a pose is not finite.
        """
        self._places = PoseSnapshot.from_data(checked_data(self.model, data))
        with in_variant(self.variant):
            for geom, parts in self._parts.items():
                pose = shapes.pose(data, geom)
                if not np.array_equal(pose, self._poses[geom]):
                    self._poses[geom] = pose
                    self._move(geom, parts, pose)
            for emitter in self._emitters:
                if emitter.light >= 0:
                    self._move_light(emitter, lights.pose(data, emitter.light))
            self._params.update()

    def bsdf(self, geom: str | int) -> MitsubaObject:
        """Return the BSDF of a geom, which need not be in the scene; ValueError for an unknown name or id."""
        try:
            index = self.model.geom(geom).id
        except (KeyError, IndexError, TypeError):
            raise ValueError(f"geom = {shown(geom)}: must be the name or the id of a geom of the model") from None
        with in_variant(self.variant):
            return self._bsdf(index)

    def render(
        self,
        camera: str | int | Viewpoint,
        width: int,
        height: int,
        integrator: str | Mapping[str, Any] = "direct",
        spp: int = 16,
        wavelengths: np.ndarray | Sequence[float] = (450e-9, 550e-9, 650e-9),
        seed: int = 0,
        sampler: str = "independent",
    ) -> np.ndarray:
        """Return the spectral radiance at `wavelengths` [m], (band, y, x) float32, averaged over each pixel's square.

        Units: a white Lambertian surface that faces a light of `diffuse` 1 has radiance D65(λ), scaled to 1 at 560 nm.

        camera: name or id of a camera of the model, or a Viewpoint
        width, height: size of the image [pixels], whole numbers from 1 to 65,536
        integrator: a Mitsuba integrator: "direct", "path", ..., or its description, {"type": "path", "max_depth": 3}.
            Behind a transparent geom, "direct" shows only emitters; a MirrorWarning names such geoms once.
        spp: number of samples per pixel, 1 to 2³¹ - 1
        seed: seed of the samples, 0 to 2¹²⁸
        sampler: "independent", or "multijitter", whose images have less noise

        Raises:
            ValueError: the camera is unknown, or is not a perspective camera defined by `fovy`; the integrator or the
                sampler is unknown, a number is not whole or out of range, a wavelength is outside 300 to 780 nm, the
                description of "direct" sets its light samples, or the sampler cannot take `spp` samples.
        """
        view = self.viewpoint(camera)
        width, height = rays.checked_size(width, height)
        asked = rays.checked_wavelengths(wavelengths)
        if rays.described(integrator)["type"] == "direct":
            self._warn_of_glass()
        with in_variant(self.variant):
            self._aim_headlight(view)
            taken = self._camera(view, width, height)
            return taken.radiance(integrator, spp, asked, seed, sampler)

    def _warn_of_glass(self) -> None:
        """Warn once that Mitsuba's integrator "direct" shows only emitters behind the model's transparent geoms."""
        glass = [int(g) for g in self.geoms if surfaces.rgba(self.model, int(g))[3] < 1]
        if glass and not self._has_warned_of_glass:
            listed = inventory.listed_geoms(self.model, glass)
            words = f"'direct' does not show what is behind the transparent {listed}: integrator='path' does"
            warnings.warn(words, MirrorWarning, stacklevel=3)
        self._has_warned_of_glass = True

    def viewpoint(self, camera: str | int | Viewpoint) -> Viewpoint:
        """Return the viewpoint of a camera of the model at the last `sync`. Errors: see `render`."""
        return cameras.viewpoint(self.model, self._places, camera)

    def render_ids(self, camera: str | int | Viewpoint, width: int, height: int) -> np.ndarray:
        """Return the id of the geom visible at each pixel's centre, (y, x) int32, -1 for none. Errors: see `render`."""
        return self._first_hits(camera, width, height)[0]

    def render_depth(self, camera: str | int | Viewpoint, width: int, height: int) -> np.ndarray:
        """Return the depth along the camera's axis [m] at pixels' centres, (y, x) float32; infinite without a hit.

        Errors: see `render`.
        """
        return self._first_hits(camera, width, height)[1]

    def _first_hits(self, camera: str | int | Viewpoint, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        view = self.viewpoint(camera)
        width, height = rays.checked_size(width, height)
        with in_variant(self.variant):
            names, points = self._camera(view, width, height).first_hits()
        ids = np.array([int(name.split("_")[1]) if name else -1 for name in names], dtype=np.int32)
        depth = np.full(len(ids), np.inf, dtype=np.float32)
        depth[ids >= 0] = (points[ids >= 0] - view.position) @ -view.rotation[:, 2]
        return ids.reshape(height, width), depth.reshape(height, width)

    def _camera(self, view: Viewpoint, width: int, height: int) -> rays.Camera:
        """Return the camera for a view. As in MuJoCo, only planes are visible from both sides."""
        planes = {g for g in self._parts if surfaces.geom_type(self.model, g) == mujoco.mjtGeom.mjGEOM_PLANE}
        closed = {f"geom_{g}_{k}" for g, parts in self._parts.items() if g not in planes for k in range(len(parts))}
        sensor = cameras.sensor(view, width, height, self._near())
        return rays.Camera(self.scene, sensor, self._names, frozenset(closed))

    def _near(self) -> float:
        return max(float(self.model.vis.map.znear * self.model.stat.extent), 1e-6)

    def _build(self) -> MitsubaObject:
        description: Description = {"type": "scene"}
        for geom, parts in self._parts.items():
            for k, part in enumerate(parts):
                name = f"geom_{geom}_{k}"
                bsdf = self._bsdf(geom, part.mirrors)
                description[name] = shapes.build(part, self._poses[geom], name, bsdf, self._glow(geom))
        for emitter in self._emitters:
            description[emitter.name] = emitter.described
        return mi.load_dict(description)

    def _glow(self, geom: int) -> Description | None:
        """Return the radiance of a geom with an emissive material; None if the geom does not glow."""
        to_uv = shapes.uv_transform(self.model, geom)
        return lights.glow(self.model, geom, to_uv, of_geom(self.model, geom, self.spectra))

    def _bsdf(self, geom: int, mirrors: bool = True) -> MitsubaObject:
        """Return the BSDF of a geom; geoms of the same appearance share one object."""
        to_uv = shapes.uv_transform(self.model, geom)
        key = (
            self.model.geom_matid[geom],
            tuple(surfaces.rgba(self.model, geom)),
            None if to_uv is None else tuple(to_uv.ravel()),
            bsdfs.is_open(self.model, geom),
            mirrors and bsdfs.mirror_share(self.model, geom) > 0,
            shapes.is_textured(self.model, geom),
        )
        if key not in self._bsdfs:
            measured = of_geom(self.model, geom, self.spectra)
            self._bsdfs[key] = bsdfs.bsdf(self.model, geom, to_uv, measured, mirrors)
        return self._bsdfs[key]

    def _move(self, geom: int, parts: list[shapes.Part], pose: np.ndarray) -> None:
        for k, part in enumerate(parts):
            for key, value in part.placement(pose).items():
                self._params[f"geom_{geom}_{k}.{key}"] = value

    def _aim_headlight(self, view: Viewpoint) -> None:
        """Turn the headlight, if there is one, into the camera's direction."""
        for emitter in self._emitters:
            if emitter.name == lights.HEADLIGHT:
                self._move_light(emitter, lights.aimed(view.position, -view.rotation[:, 2]))
                self._params.update()

    def _move_light(self, emitter: lights.Emitter, to_world: MitsubaObject) -> None:
        matrix, name = np.array(to_world.matrix), emitter.parameters
        if (key := f"{name}.position") in self._params:  # a point light, which has no direction
            place = matrix[:3, 3].astype(np.float32)
            if not np.array_equal(place, np.array(self._params[key]).ravel()):
                self._params[key] = mi.Point3f(*place.tolist())
        elif not np.array_equal(matrix, np.array(self._params[key := f"{name}.to_world"].matrix).reshape(4, 4)):
            self._params[key] = mi.Transform4f(matrix)


def _visible(model: mujoco.MjModel, bodies: Sequence[str] | None, groups: Sequence[int]) -> list[int]:
    wanted = list(range(model.nbody))
    if bodies is not None:
        names = [model.body(i).name for i in range(model.nbody)]
        unknown = sorted(set(items("mirror: bodies", bodies, str, "'world'")) - set(names))
        if unknown:
            raise ValueError(f"mirror: no body {unknown[0]!r}; the model has {', '.join(map(repr, names))}")
        wanted = [names.index(name) for name in bodies]
    return [g for g in surfaces.visible(model, groups) if model.geom_bodyid[g] in wanted]


def _reference_pose(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data
