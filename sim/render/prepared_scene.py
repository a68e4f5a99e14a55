"""A MuJoCo model and its eyes, prepared once for rendering.

The same prepared scene serves to choose the accuracy of rendering (`sim.render.fidelity`) and to render.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import mujoco
import numpy as np

import optics
from optics.numerics.arguments import of_kind
from optics.numerics.number_types import all_finite
from optics.spectra.spectrum import Spectrum
from sim.eyes.compound_eye import CompoundEye, WorldEye
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.inside import depth_inside
from sim.eyes.mounts import Mount
from sim.eyes.sampling import EyeSampling, FieldSampling, Trial, WorldSampling, eye_sampling
from sim.eyes.sensor import Sensor
from sim.render.eye_rays import EyeRays, FreeEyes, UprightEyes
from sim.scene.appearances import Varied
from sim.scene.mirror import VISIBLE_GROUPS
from sim.scene.moved_bodies import MovedBodies
from sim.scene.poses import Poses
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.eye_places import EyePlaces, LevelStand
from sim.tracing.model_scene import ModelScene
from sim.tracing.tracer import Tracer, Tracers
from sim.tracing.upright_scene import UprightScene

Placed: TypeAlias = Poses | Sequence[mujoco.MjData] | mujoco.MjData | Any  # poses of all worlds


class PreparedScene:
    """A MuJoCo model and its eyes, prepared for rendering; light and materials are stored in the eyes' spectral bands.

    The scene can be rendered with any fidelity (number of samples, depth layers and light) that has these bands.

    model: the MuJoCo model
    eye: optics and retina, with the spectral bands
    mounts: places of the eyes on the model
    spectra: measured spectra of materials and lights, by name
    groups: visible geom groups
    varied: names of geoms whose size, colour or material may differ between worlds, see `sim.ModelRenderer`
    tracer: "mitsuba", "closed_form" or "auto", see `sim.BatchedRenderer`
    stand: the body that carries all eyes, and the eyes' places on this body, which moves only in a horizontal plane.
        None: it is derived from the mounts, if there is such a body
    medium: water or air that fills the world; under water, an `optics.Eye` is immersed, but the refractive index in
        front of the facets of a compound eye does not change. None: clear air

    Raises:
        ValueError: the model lacks the part on which an eye is mounted, an eye is inside a geom in the model's
            reference pose (checked if `stand` is None), or the renderer refuses the model or the tracer (see
            `sim.BatchedRenderer` and `sim.ModelRenderer`).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        eye: WorldEye,
        mounts: Sequence[Mount],
        *,
        spectra: Mapping[str, Spectrum | str] | None = None,
        groups: Sequence[int] = VISIBLE_GROUPS,
        varied: Varied = (),
        tracer: str = "auto",
        stand: LevelStand | None = None,
        medium: optics.TurbidMedium | None = None,
    ) -> None:
        if medium is not None:
            of_kind("medium", medium, optics.TurbidMedium, "optics.sea_water(1), or None for clear air")
        self.eye = eye if isinstance(eye, CompoundEye) else optics.immersed(eye, medium)
        self.model, self.places = model, EyePlaces(model, mounts)
        self.medium = medium
        self.scene = ModelScene(model, self.eye, groups, spectra, varied, medium)
        if stand is None:
            self._refuse_eyes_inside()
        self.tracers = Tracers(self.scene, self.places, tracer, stand)
        self._samplings: dict[DepthLayers, WorldSampling] = {}
        self._has_warned = False

    @property
    def mounts(self) -> tuple[Mount, ...]:
        """Places of the eyes on the model."""
        return self.places.mounts

    @property
    def bands(self) -> optics.SpectralBands:
        """Spectral bands of the eyes."""
        return self.eye.spectral_bands

    @property
    def variant(self) -> str:
        """Mitsuba's variant."""
        return self.scene.variant

    @property
    def white(self) -> np.ndarray:
        """Largest radiance of a white surface or, in a medium, of the veiling light, array (band,).

        The surface faces all directional lights. In each band, the larger of the two radiances is taken.
        """
        levels = [light.level for light in self.scene.lights.found if light.kind == "directional"]
        surface: np.ndarray = sum(levels, np.zeros(self.eye.bands)) / np.pi
        return surface if self.scene.medium is None else np.maximum(surface, self.scene.medium.veil)

    def warn_once(self, light: str) -> None:
        """Warn once of features of the model that are not rendered with this kind of light."""
        if not self._has_warned:
            self._has_warned = True
            self.scene.warn_of_missing(light)

    def eye_rays(self, tracer: Tracer | AreaTracer, n_envs: int) -> EyeRays:
        """Return an object that computes the rays of the eyes in `n_envs` worlds for this tracer."""
        if isinstance(tracer, ClosedForm | AreaTracer):
            return UprightEyes(self.upright.stand, n_envs)
        return FreeEyes(self.places, n_envs)

    @property
    def upright(self) -> UprightScene:
        """The scene as upright walls, a floor and spheres, for which light is computed by formulas (closed form).

        Raises:
            NoClosedForm: the scene has no closed form.
        """
        if isinstance(self.tracers.upright, UprightScene):
            return self.tracers.upright
        raise self.tracers.upright

    def areas(self, light: str) -> AreaTracer:
        """Return the tracer for area sampling, which computes the mean light in areas of the visual field.

        light: reflections that are followed: "direct" (one), "bounce" (up to two) or "all" (any number)

        Raises:
            ValueError: the mean light in an area of this world has no closed form, or the tracer is "mitsuba", which
                traces only rays.
        """
        return self.tracers.areas(light)

    def area_sensor(self, sampling: EyeSampling, per_receptor: float) -> Sensor:
        """Return a sensor whose samples are areas, rectangles of the visual field in which light is averaged.

        per_receptor: number of areas per receptor; below 1 if receptors share areas
        """
        return sampling.areas(per_receptor, in_rows=self._in_rows)

    def area_trial(self, sampling: EyeSampling, per_receptor: float, receptors: np.ndarray) -> Trial:
        """Return the areas that contribute to the signals of these receptors, with their weights.

        Areas are rectangles of the visual field in which the mean light is computed.

        per_receptor: number of areas per receptor in the whole eye
        receptors: indices of the receptors, which are numbered row by row
        """
        return sampling.area_trial(per_receptor, receptors, in_rows=self._in_rows)

    def may_share(self, sampling: EyeSampling, per_receptor: float) -> bool:
        """Return whether areas that several receptors share are small enough to distinguish neighbouring receptors.

        Areas are rectangles of the visual field in which the mean light is computed. If they are too large,
        neighbouring receptors may have equal signals. The result is False for a perfect lens, whose receptors share no
        areas.

        per_receptor: number of areas per receptor, below 1
        """
        return isinstance(sampling, FieldSampling) and sampling.may_share(per_receptor, in_rows=self._in_rows)

    @property
    def _in_rows(self) -> bool:
        """True if a receptor's field is divided into rows and columns of areas, false if into columns only.

        Areas are rectangles in which light is averaged. The mean light of walls and floor in a column has a closed
        form, however high the column is. The outlines of spheres need rows as well.
        """
        upright = self.tracers.upright
        return isinstance(upright, UprightScene) and len(upright.spheres) > 0

    def sampling(self, depth: DepthLayers, tolerance: float | None = None) -> WorldSampling:
        """Return an object that chooses samples (rays or areas) in the eye's visual field.

        It also computes the weights with which each receptor sums the light of the samples. The eye's PSFs for the
        distances in `depth` are computed at the first call, and kept.

        depth: distances for which the eye has a PSF

        tolerance: allowed error of a signal, see `sim.eyes.allowed_error`

        Raises:
            optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        """
        if depth not in self._samplings:
            self._samplings[depth] = eye_sampling(self.eye, depth)
        found = self._samplings[depth]
        return replace(found, tolerance=tolerance) if isinstance(found, FieldSampling) else found

    def placed(self, poses: Placed) -> Poses:
        """Return the poses as arrays."""
        return poses if isinstance(poses, Poses) else Poses.from_data(poses)

    def check_poses(self, poses: Poses, n_envs: int) -> None:
        """Refuse poses that cannot be rendered.

        Raises:
            ValueError: the number of worlds is wrong; the poses belong to another model, are not finite or have not
                been computed yet; or a world differs from the model in a way that the renderer cannot show, for example
                in the colour of a geom that was not named in the scene's argument `varied`.
        """
        self.check_count(poses, n_envs)
        if isinstance(poses, MovedBodies):  # all other quantities are as in the model
            self._check_finite(poses.positions)
            if poses.reference.n_bodies != self.model.nbody:
                raise ValueError("poses of another model")
            if poses.geom_size is not None:
                self.scene.as_built.refuse_differences(poses)
            return
        if poses.geom_xpos.shape[1] != self.model.ngeom or poses.xpos.shape[1] != self.model.nbody:
            raise ValueError("poses of another model")
        self._check_finite(poses.geom_xpos)
        placed = poses.geom_xmat.any(axis=(1, 2, 3))
        if not placed.all():
            raise ValueError(
                f"data of world {int(np.argmin(placed))} contains no poses yet; call mujoco.mj_forward(model, data) "
                "first"
            )
        self.scene.as_built.refuse_differences(poses)

    @staticmethod
    def check_count(poses: Poses, n_envs: int) -> None:
        """Raise a ValueError if the number of worlds is not `n_envs`."""
        if poses.n != n_envs:
            raise ValueError(f"poses of {poses.n} worlds, this renderer was built for n_envs = {n_envs}")

    @staticmethod
    def _check_finite(places: np.ndarray) -> None:
        if not all_finite(places):
            world = int(np.flatnonzero(~np.isfinite(places).all(axis=(1, 2)))[0])
            raise ValueError(f"poses of world {world} are not finite")

    def _refuse_eyes_inside(self) -> None:
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        pupils, _ = self.places.frames(Poses.from_data([data]))
        for number, (mount, pupil) in enumerate(zip(self.mounts, pupils[0], strict=True)):
            for geom in self.scene.geoms:
                if (depth := depth_inside(self.model, data, geom, pupil)) > 0:
                    raise ValueError(
                        f"mounts[{number}] on {mount.on!r}: in the reference pose of {_named(self.model)}, the eye at "
                        f"({', '.join(f'{part:.3g}' for part in pupil.tolist())}) m of the world is inside geom "
                        f"{self.model.geom(geom).name or geom!r} of body "
                        f"{self.model.body(self.model.geom_bodyid[geom]).name!r}, {depth:.2g} m below its surface: "
                        "offset must lead out of it"
                    )


def _named(model: mujoco.MjModel) -> str:
    """Return the words "the model", with the model's name if it has one."""
    name = model.names.partition(b"\0")[0].decode()
    return "the model" if name in ("", "MuJoCo Model") else f"the model {name!r}"
