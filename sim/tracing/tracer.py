"""The interface of tracers, through which kernels use them, and the choice of a tracer for a scene."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np

from optics.numerics.arguments import one_of
from optics.numerics.autodiff import Array
from sim.scene.poses import Poses
from sim.scene.variant import variant
from sim.tracing import lighting
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.eye_places import EyePlaces, LevelStand, NotLevelError
from sim.tracing.eye_ray import EyeRay
from sim.tracing.model_scene import ModelScene
from sim.tracing.model_tracer import ModelTracer
from sim.tracing.upright_scene import UprightScene, upright_scene
from sim.tracing.walls import NoClosedForm

TRACERS = ("auto", ClosedForm.name, ModelTracer.name)


class Buffers(Protocol):
    """Buffers that kernels read, for all values that differ between worlds."""

    def fill(self, poses: Poses) -> None:
        """Write the values of all worlds into the buffers, for these poses of geoms and lights."""

    def arrays(self) -> Any:
        """Return the buffers as arrays on the device."""


class Tracer(Protocol):
    """A method of tracing rays.

    name: "closed_form" or "mitsuba"
    why: reason for its choice
    light: limit to the number of reflections of light: "direct" (one reflection), "bounce" (two) or "all" (no limit)
    basis: contribution of each component to each spectral band, (component, band). The tracer computes light as a list
        of components, which are bands or fixed spectra. The radiance in band b is sum_k basis[k, b] component_k
    """

    name: str
    why: str
    light: str
    basis: np.ndarray

    @property
    def scene(self) -> Any:
        """Mitsuba's scenes, a separate argument of the kernel that traces rays; None if the tracer uses no scenes."""

    @property
    def inputs(self) -> Any:
        """Arrays, the same for all worlds, that the kernel (the program that traces rays) reads."""

    def buffers(self, n_envs: int) -> Buffers:
        """Return buffers for all values that differ between `n_envs` worlds, such as places of moving geoms."""

    def around(self, scenes: Any, rows: Any, inputs: Any, world: Array) -> Any:
        """Return the surroundings of each ray: the surfaces that it can hit in its world, and the lights there.

        scenes, inputs: `scene` and `inputs` of this tracer, which the kernel receives as arguments
        rows: the result of `Buffers.arrays`, which contains the values of all worlds
        world: index of each ray's world
        """

    def radiance(self, seen: EyeRay, there: Any, samples: Array) -> tuple[list[Array], Array]:
        """Return the light along each ray, and the distance to the visible surface [m].

        The light is a list with one array for each spectral component, see `basis`.

        samples: four numbers on the unit interval for each ray, for light that bounces (`lighting.spawn_bounce_ray`)
        """


class Tracers:
    """The tracers of a scene.

    Some tracers compute the light along single rays. Others compute the average of the light over areas, which are
    rectangles of the visual field. Each tracer is for one level of light (`lighting.LEVELS`). The level limits how
    often light is reflected.

    scene, places: the scene, and the positions of the eyes in it
    name: "closed_form" (formulas for upright walls, a floor and spheres), "mitsuba" (any scene), or "auto": the closed
        form if the scene has one, otherwise Mitsuba
    stand: the body that the eyes are fixed to; None: derived from their mounts

    Raises:
        ValueError: the name is unknown, or it is "closed_form" and the scene has no closed form.
    """

    def __init__(
        self, scene: ModelScene, places: EyePlaces, name: str = "auto", stand: LevelStand | None = None
    ) -> None:
        one_of("tracer", name, TRACERS)
        self._scene, self._name, self._places, self._stand = scene, name, places, stand
        self._known: dict[str, Tracer] = {}
        self._areas: dict[str, AreaTracer] = {}
        self.tracer_for(lighting.DIRECT)

    @cached_property
    def upright(self) -> UprightScene | NoClosedForm:
        """The scene as upright walls, a floor and spheres, or the reason why there is no such form for its eyes."""
        try:
            return upright_scene(self._scene, self._places.stand() if self._stand is None else self._stand)
        except NoClosedForm as reason:
            return reason
        except NotLevelError as reason:
            return NoClosedForm(str(reason))

    @property
    def is_upright(self) -> bool:
        """True if direct light is traced in closed form, as is possible for upright walls, a floor and spheres."""
        return self.tracer_for(lighting.DIRECT).name == ClosedForm.name

    def tracer_for(self, light: str) -> Tracer:
        """Return the tracer that computes light along rays, for a given limit to the number of reflections.

        light: the limit, one of `lighting.LEVELS`: "direct" (one reflection) or "bounce" (two); "all" is not possible

        Raises:
            ValueError: `light` is "all", or the tracer is "closed_form" and the scene has no closed form for this
                limit.
        """
        if light not in self._known:
            with variant(self._scene.variant):
                self._known[light] = self._made(light)
        return self._known[light]

    def _made(self, light: str) -> Tracer:
        if light == lighting.ALL:
            raise ValueError("light = 'all': rays follow at most two reflections, see samples = 'areas'")
        if self._name == ModelTracer.name:
            return ModelTracer(self._scene, light)
        try:
            return self._in_closed_form(light)
        except NoClosedForm as reason:
            if self._name == ClosedForm.name:
                raise ValueError(f"tracer = 'closed_form': this world has no closed form: {reason}") from reason
            return ModelTracer(self._scene, light, f"no closed form: {reason}")

    def _in_closed_form(self, light: str) -> ClosedForm:
        if isinstance(self.upright, NoClosedForm):
            raise self.upright
        return ClosedForm(self.upright, self._scene.wavelengths, light)

    def areas(self, light: str) -> AreaTracer:
        """Return the tracer that uses area sampling.

        Raises:
            ValueError: closed-form formulas cannot represent the world, or the tracer is "mitsuba", which traces only
                rays.
        """
        if self._name == ModelTracer.name:
            raise ValueError(f"samples = 'areas': tracer = {self._name!r} traces rays only")
        if light not in self._areas:
            try:
                with variant(self._scene.variant):
                    self._areas[light] = AreaTracer(self._in_closed_form(light))
            except NoClosedForm as reason:
                raise ValueError(f"samples = 'areas': this world has no closed form: {reason}") from reason
        return self._areas[light]
