"""`mirror(model)`: any MuJoCo model as a spectral Mitsuba scene that follows mjData.

Mirrored: all geoms, with their materials and textures, lights, the skybox, and cameras. Faces are seen as MuJoCo draws
them: a camera inside a body looks out of it. What cannot be mirrored is named in one MirrorWarning.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi
import mujoco
import numpy as np

from optics.spectra.spectrum import Spectrum
from sim.scene import bsdfs, cameras, inventory, lights, rays, shapes, source, surfaces
from sim.scene.cameras import Viewpoint
from sim.scene.spectra import of_geom, resolve
from sim.scene.variant import DEFAULT_VARIANT, Description, MitsubaObject, default_variant
from sim.scene.variant import variant as in_variant
from sim.scene.whereabouts import Whereabouts

VISIBLE_GROUPS = (0, 1, 2)  # MuJoCo draws these unless told otherwise


class MirrorWarning(UserWarning):
    """Names what of a model is missing from its mirror."""


def mirror(
    model: mujoco.MjModel | mujoco.MjSpec | str | Path,
    data: mujoco.MjData | None = None,
    *,
    bodies: Sequence[str] | None = None,
    groups: Sequence[int] = VISIBLE_GROUPS,
    variant: str | None = None,
    spectra: Mapping[str, Spectrum | str] | None = None,
) -> Mirror:
    """Mirror a MuJoCo model.

    model: an MjModel, or what compiles to one: an MjSpec, the path of an MJCF, URDF or MJB file, MJCF text
    data: poses to start from; None: the model's reference pose
    bodies: names of the bodies whose geoms are wanted ("world" is the static one); None: all
    groups: geom groups that are visible; a geom of alpha 0 never is
    variant: a spectral Mitsuba variant, the device's if None; scalar_spectral runs without LLVM, slowly
    spectra: reflectances of materials and emission of lights, by name, in the place of their colours:
        `optics.Spectrum`, or what `optics.reflectance` and `optics.illuminant` know by name; {"headlight": "A"} is the
        camera's

    Raises:
        ValueError: a model that does not compile, an unknown body, a variant without spectra, a model without visible
            geoms, or spectra of what the model does not have; warns once, by MirrorWarning, of what has no counterpart.
    """
    return Mirror(
        source.load(model), data, bodies=bodies, groups=groups, variant=variant or default_variant(), spectra=spectra
    )


class Mirror:
    """A Mitsuba scene that mirrors a MuJoCo model.

    model, variant: as given
    scene: mi.Scene; shape ids are "geom_<geom id>_<part>"
    geoms: ids of the geoms in the scene, (n,)
    spectra: of materials and lights, by name
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
        if not variant.endswith("spectral"):
            raise ValueError(f"mirror: variant = {variant!r}: must be a spectral one such as {DEFAULT_VARIANT!r}")
        self.model, self.variant = model, variant
        self.spectra = resolve(model, spectra)
        visible = _visible(model, bodies, groups)
        self.geoms = np.array([g for g in visible if shapes.has_shape(model, g)], dtype=int)
        if not len(self.geoms):
            raise ValueError("mirror: the model has no visible geom of a kind that can be mirrored")
        data = _reference_pose(model) if data is None else _checked(model, data)
        self._places = Whereabouts.of(data)
        self._parts = {int(g): shapes.parts(model, g) for g in self.geoms}
        self._poses = {g: shapes.pose(data, g) for g in self._parts}
        self._bsdfs: dict[Any, MitsubaObject] = {}
        with in_variant(variant):
            self._emitters, left_out = lights.emitters(model, data, self.spectra)
            self.scene = self._build()
            self._params = mi.traverse(self.scene)
            self._names = rays.names_of(self.scene)
        self._told_of_glass = False
        left_out = inventory.left_out(model, visible, groups) + left_out
        if left_out:
            warnings.warn(f"not mirrored: {'; '.join(left_out)}", MirrorWarning, stacklevel=3)

    def sync(self, data: mujoco.MjData) -> None:
        """Move everything, cameras too, to where `data` has it now (after mj_forward or mj_step). Only what moved is
        touched: a scene in which nothing moved is not rebuilt.

        Raises:
            ValueError: the data of another model, and for positions that are not finite.
        """
        self._places = Whereabouts.of(_checked(self.model, data))
        with in_variant(self.variant):
            for geom, parts in self._parts.items():
                pose = shapes.pose(data, geom)
                if not np.array_equal(pose, self._poses[geom]):
                    self._poses[geom] = pose
                    self._move(geom, parts, pose)
            for emitter in self._emitters:
                if emitter.light >= 0:
                    self._move_light(emitter.name, lights.pose(data, emitter.light))
            self._params.update()

    def bsdf(self, geom: str | int) -> MitsubaObject:
        """The BSDF of a geom, also of one that is not in the scene."""
        index = self.model.geom(geom).id
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
        """Spectral radiance at `wavelengths` [m], (band, y, x) float32, averaged over each pixel's square.

        camera: name or id of a camera of the model, or a Viewpoint
        integrator: a Mitsuba integrator: "direct", "path", ..., or its description, {"type": "path", "max_depth": 3}
        spp: samples per pixel
        sampler: "independent", or "multijitter" for pictures: less noise
        Units: a white Lambertian that faces a light of diffuse 1 has radiance D65(λ), 1 at 560 nm.

        Warns once, by MirrorWarning, where "direct" would look through a transparent geom.

        Raises:
            ValueError: an unknown camera, less than one pixel or sample, wavelengths beyond 300 to 780 nm, and what
                Mitsuba would take wrongly.
        """
        view = self.viewpoint(camera)
        rays.check_size(width, height, spp)
        asked = rays.checked_wavelengths(wavelengths)
        if rays.described(integrator)["type"] == "direct":
            self._tell_of_glass()
        with in_variant(self.variant):
            if any(e.name == lights.HEADLIGHT for e in self._emitters):
                self._move_light(lights.HEADLIGHT, lights.aimed(view.position, -view.rotation[:, 2]))
                self._params.update()
            taken = self._camera(view, width, height)
            return taken.radiance(integrator, spp, asked, seed, sampler)

    def _tell_of_glass(self) -> None:
        """Mitsuba's `direct` takes a mask's share of light for its colour, and looks through it at emitters alone."""
        glass = [int(g) for g in self.geoms if surfaces.rgba(self.model, int(g))[3] < 1]
        if glass and not self._told_of_glass:
            listed = inventory.listed_geoms(self.model, glass)
            words = f"'direct' does not show what is behind the transparent {listed}: integrator='path' does"
            warnings.warn(words, MirrorWarning, stacklevel=3)
        self._told_of_glass = True

    def viewpoint(self, camera: str | int | Viewpoint) -> Viewpoint:
        """Where a camera of the model was at the last `sync`, and how it looks."""
        return cameras.viewpoint(self.model, self._places, camera)

    def render_ids(self, camera: str | int | Viewpoint, width: int, height: int) -> np.ndarray:
        """Geom id seen through the centre of each pixel, (y, x) int32, -1 for none."""
        return self._first_hits(camera, width, height)[0]

    def render_depth(self, camera: str | int | Viewpoint, width: int, height: int) -> np.ndarray:
        """Depth along the camera's axis [m] at the centre of each pixel, (y, x) float32, inf for none."""
        return self._first_hits(camera, width, height)[1]

    def _first_hits(self, camera: str | int | Viewpoint, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        view = self.viewpoint(camera)
        rays.check_size(width, height, 1)
        with in_variant(self.variant):
            names, points = self._camera(view, width, height).first_hits()
        ids = np.array([int(name.split("_")[1]) if name else -1 for name in names], dtype=np.int32)
        depth = np.full(len(ids), np.inf, dtype=np.float32)
        depth[ids >= 0] = (points[ids >= 0] - view.position) @ -view.rotation[:, 2]
        return ids.reshape(height, width), depth.reshape(height, width)

    def _camera(self, view: Viewpoint, width: int, height: int) -> rays.Camera:
        """MuJoCo draws planes from both sides, and only the outer side of everything else."""
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
            description[emitter.name] = emitter.description
        return mi.load_dict(description)

    def _glow(self, geom: int) -> Description | None:
        """What a geom of an emissive material sends out."""
        to_uv = shapes.uv_transform(self.model, geom)
        return lights.glow(self.model, geom, to_uv, of_geom(self.model, geom, self.spectra))

    def _bsdf(self, geom: int, mirrors: bool = True) -> MitsubaObject:
        """Geoms that look alike share one BSDF object."""
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

    def _move_light(self, name: str, to_world: MitsubaObject) -> None:
        matrix = np.array(to_world.matrix)
        if (key := f"{name}.position") in self._params:  # a light at a point, which looks the same from all sides
            place = matrix[:3, 3].astype(np.float32)
            if not np.array_equal(place, np.array(self._params[key]).ravel()):
                self._params[key] = mi.Point3f(*place.tolist())
        elif not np.array_equal(matrix, np.array(self._params[key := f"{name}.to_world"].matrix).reshape(4, 4)):
            self._params[key] = mi.Transform4f(matrix)


def _visible(model: mujoco.MjModel, bodies: Sequence[str] | None, groups: Sequence[int]) -> list[int]:
    wanted = list(range(model.nbody))
    if bodies is not None:
        names = [model.body(i).name for i in range(model.nbody)]
        unknown = sorted(set(bodies) - set(names))
        if unknown:
            raise ValueError(f"mirror: no body {unknown[0]!r}; the model has {', '.join(map(repr, names))}")
        wanted = [names.index(name) for name in bodies]
    return [g for g in surfaces.visible(model, groups) if model.geom_bodyid[g] in wanted]


def _reference_pose(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def _checked(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """The data, if it is of this model and everything in it is somewhere."""
    if data.geom_xpos.shape != (model.ngeom, 3) or data.xpos.shape != (model.nbody, 3):
        raise ValueError(
            f"mirror: data of {len(data.geom_xpos)} geoms and {len(data.xpos)} bodies is not the model's, which has "
            f"{model.ngeom} and {model.nbody}"
        )
    if not data.geom_xmat.any():
        raise ValueError("mirror: data says nothing yet of where things are; call mujoco.mj_forward(model, data) first")
    lost = ~(np.isfinite(data.geom_xpos).all(axis=1) & np.isfinite(data.geom_xmat).all(axis=1))
    if lost.any():
        name = model.geom(int(np.argmax(lost))).name or str(int(np.argmax(lost)))
        raise ValueError(f"mirror: geom {name!r} is at no finite place; the simulation became unstable, reset its data")
    return data
