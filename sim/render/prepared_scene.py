"""A model made ready for given eyes: what choosing a fidelity and rendering both begin with, built once for both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import mujoco
import numpy as np

import optics
from optics.spectra.spectrum import Spectrum
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.inside import depth_inside
from sim.eyes.mounts import Mount
from sim.eyes.sampling import EyeSampling, FieldSampling, Trial, eye_sampling
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

Placed: TypeAlias = Poses | Sequence[mujoco.MjData] | mujoco.MjData | Any  # where everything is in all worlds


class PreparedScene:
    """A model as the spectral bands of given eyes have it. Nothing in it depends on how finely it will be seen.

    model: what there is to see · eye: its optics and retina, with its own bands · mounts: where on the model eyes are
    spectra, groups: see `sim.mirror` · varied: see `sim.ModelRenderer`
    tracer: which way rays are traced, see `sim.BatchedRenderer`
    stand: the body on which the eyes are, if they stand upright on one; None: found from the mounts

    Raises:
        ValueError: a mount on what the model does not have, an eye that is inside of a geom in the model's reference
            pose, and a model or a tracer that `sim.BatchedRenderer` or `sim.ModelRenderer` refuse.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        eye: optics.Eye,
        mounts: Sequence[Mount],
        *,
        spectra: Mapping[str, Spectrum | str] | None = None,
        groups: Sequence[int] = VISIBLE_GROUPS,
        varied: Varied = (),
        tracer: str = "auto",
        stand: LevelStand | None = None,
    ) -> None:
        self.model, self.eye, self.places = model, eye, EyePlaces(model, mounts)
        self.scene = ModelScene(model, eye, groups, spectra, varied)
        if stand is None:
            self._refuse_eyes_inside()
        self.tracers = Tracers(self.scene, self.places, tracer, stand)
        self._samplings: dict[DepthLayers, EyeSampling] = {}
        self._is_told = False

    @property
    def mounts(self) -> tuple[Mount, ...]:
        """Where the eyes are."""
        return self.places.mounts

    @property
    def bands(self) -> optics.SpectralBands:
        """Of the eyes."""
        return self.eye.spectral_bands

    @property
    def variant(self) -> str:
        """Mitsuba's."""
        return self.scene.variant

    def tell(self, light: str) -> None:
        """Warn once of what is not seen, where so much of the light is followed."""
        if not self._is_told:
            self._is_told = True
            self.scene.tell_what_is_missing(light)

    def eye_rays(self, tracer: Tracer | AreaTracer, n_envs: int) -> EyeRays:
        """The eyes in so many worlds, as this tracer has them."""
        if isinstance(tracer, ClosedForm | AreaTracer):
            return UprightEyes(self.upright.stand, n_envs)
        return FreeEyes(self.places, n_envs)

    @property
    def upright(self) -> UprightScene:
        """The closed form.

        Raises:
            NoClosedForm: there is none.
        """
        if isinstance(self.tracers.upright, UprightScene):
            return self.tracers.upright
        raise self.tracers.upright

    def areas(self, light: str) -> AreaTracer:
        """What sees the world by areas.

        Raises:
            ValueError: a world that has no closed form.
        """
        return self.tracers.areas(light)

    def area_sensor(self, sampling: EyeSampling, per_receptor: float) -> Sensor:
        """What areas are seen along: so many for each receptor."""
        return sampling.areas(per_receptor, in_rows=self._in_rows)

    def area_trial(self, sampling: EyeSampling, per_receptor: float, receptors: np.ndarray) -> Trial:
        """What that sensor has for these receptors."""
        return sampling.area_trial(per_receptor, receptors, in_rows=self._in_rows)

    def may_share(self, sampling: EyeSampling, per_receptor: float) -> bool:
        """Whether areas may be larger than receptors' squares, so many for each."""
        return isinstance(sampling, FieldSampling) and sampling.may_share(per_receptor, in_rows=self._in_rows)

    @property
    def _in_rows(self) -> bool:
        """What is upright has closed forms along columns of any height; spheres' outlines want rows, too."""
        upright = self.tracers.upright
        return isinstance(upright, UprightScene) and len(upright.spheres) > 0

    def sampling(self, depth: DepthLayers, tolerance: float | None = None) -> EyeSampling:
        """How the eye is sampled with these depth layers; its PSFs are computed once, when first asked for.

        tolerance: error allowed to a signal, see `sim.eyes.allowed_error`

        Raises:
            optics.AccuracyError: a pupil whose light spreads too far to be computed.
        """
        if depth not in self._samplings:
            self._samplings[depth] = eye_sampling(self.eye, depth)
        found = self._samplings[depth]
        return replace(found, tolerance=tolerance) if isinstance(found, FieldSampling) else found

    def placed(self, poses: Placed) -> Poses:
        """Where everything is, as arrays."""
        return poses if isinstance(poses, Poses) else Poses.of(poses)

    def check_poses(self, poses: Poses, n_envs: int) -> None:
        """Refuse what cannot be rendered.

        Raises:
            ValueError: another number of worlds, another model's poses, poses that are not finite or not known yet, and
                what differs from the model and is not in `varied`.
        """
        if poses.n != n_envs:
            raise ValueError(f"poses of {poses.n} worlds, this renderer was built for n_envs = {n_envs}")
        if isinstance(poses, MovedBodies):  # all of the rest is as the model has it
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
                f"data of world {int(np.argmin(placed))} says nothing yet of where things are; call "
                "mujoco.mj_forward(model, data) first"
            )
        self.scene.as_built.refuse_differences(poses)

    @staticmethod
    def _check_finite(places: np.ndarray) -> None:
        if not np.isfinite(places).all():
            world = int(np.flatnonzero(~np.isfinite(places).all(axis=(1, 2)))[0])
            raise ValueError(f"poses of world {world} are not finite")

    def _refuse_eyes_inside(self) -> None:
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        pupils, _ = self.places.frames(Poses.of([data]))
        for mount, pupil in zip(self.mounts, pupils[0], strict=True):
            for geom in self.scene.geoms:
                if (depth := depth_inside(self.model, data, geom, pupil)) > 0:
                    name = self.model.geom(geom).name or f"{geom}"
                    raise ValueError(
                        f"Mount on {mount.on!r}: the eye is inside geom {name!r}, {depth:.2g} m below its surface: "
                        f"offset must lead out of it"
                    )
