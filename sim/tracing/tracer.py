"""What a kernel asks of a way of tracing rays, and which of them a scene gets."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np

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
    """Where kernels read what differs between worlds."""

    def fill(self, poses: Poses) -> None:
        """With these worlds'."""

    def arrays(self) -> Any:
        """On the device."""


class Tracer(Protocol):
    """name: of the way of tracing, one of TRACERS · why it was taken
    light: what of it is followed, one of `lighting.LEVELS`
    basis: (component, band): radiance_b = sum_k basis[k, b] component_k
    """

    name: str
    why: str
    light: str
    basis: np.ndarray

    @property
    def scene(self) -> Any:
        """Mitsuba's scenes, which the kernel wants as an argument of its own; None: there are none."""

    @property
    def inputs(self) -> Any:
        """Arrays that the kernel reads."""

    def buffers(self, n_envs: int) -> Buffers:
        """For so many worlds."""

    def around(self, scenes: Any, rows: Any, inputs: Any, world: Array) -> Any:
        """What a lane in this world reads of the three."""

    def radiance(self, seen: EyeRay, there: Any, samples: Array) -> tuple[list[Array], Array]:
        """What comes along each ray, one array per component, and from how far [m]; samples: each ray's own, four on
        the unit interval, wanted for light that bounces (`lighting.onwards`)."""


class Tracers:
    """The tracers of a scene, one for every level of light.

    name: one of TRACERS; "auto": in closed form, where there is one
    stand: the body on which the eyes are; None: whichever that is

    Raises:
        ValueError: an unknown name, and "closed_form" where the scene has none.
    """

    def __init__(
        self, scene: ModelScene, places: EyePlaces, name: str = "auto", stand: LevelStand | None = None
    ) -> None:
        if name not in TRACERS:
            raise ValueError(f"tracer = {name!r}: must be one of {', '.join(map(repr, TRACERS))}")
        self._scene, self._name, self._places, self._stand = scene, name, places, stand
        self._known: dict[str, Tracer] = {}
        self._areas: dict[str, AreaTracer] = {}
        self.of(lighting.DIRECT)

    @cached_property
    def upright(self) -> UprightScene | NoClosedForm:
        """The closed form of the scene, or why there is none."""
        try:
            return upright_scene(self._scene, self._places.stand() if self._stand is None else self._stand)
        except NoClosedForm as reason:
            return reason
        except NotLevelError as reason:
            return NoClosedForm(str(reason))

    @property
    def is_upright(self) -> bool:
        """Whether rays are traced in closed form."""
        return self.of(lighting.DIRECT).name == ClosedForm.name

    def of(self, light: str) -> Tracer:
        """The one that follows this much of the light.

        Raises:
            ValueError: there is none.
        """
        if light not in self._known:
            with variant(self._scene.variant):
                self._known[light] = self._made(light)
        return self._known[light]

    def _made(self, light: str) -> Tracer:
        if light == lighting.ALL:
            raise ValueError("light = 'all': rays follow light that is reflected twice at most, see samples = 'areas'")
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
        """The one that sees by areas.

        Raises:
            ValueError: a world that cannot be seen so, and a tracer that was asked for and has no areas.
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
