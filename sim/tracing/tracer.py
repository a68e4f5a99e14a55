"""Which way a world is ray traced: in closed form where it has one, by Mitsuba otherwise."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.eyes import EYE_HEIGHT
from sim.scene import shapes
from sim.scene.variant import MitsubaObject, variant
from sim.tracing import lighting
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.mitsuba_tracer import Traced
from sim.tracing.static_scene import StaticScene
from sim.tracing.walls import NoClosedForm
from sim.worlds.world import World

TRACERS = ("auto", ClosedForm.name, Traced.name)


class Tracer(Protocol):
    """name: of the way of tracing, one of TRACERS · why it was taken
    light: what of it is followed, one of `lighting.LEVELS`
    scene: what the kernel wants as an argument of its own; inputs: arrays that it reads
    basis: (component, band): radiance_b = sum_k basis[k, b] component_k
    """

    name: str
    why: str
    light: str
    basis: np.ndarray

    @property
    def scene(self) -> MitsubaObject:
        """A Mitsuba scene or None."""

    @property
    def inputs(self) -> dict[str, Array]:
        """Arrays, by name."""

    def radiance(
        self,
        scene: MitsubaObject,
        ray: Array,
        agent: Array,
        centres: list[Array],
        inputs: dict[str, Array],
        bounce_sample: Array | None = None,
    ) -> tuple[list[Array], Array]:
        """What comes along each ray, one array per component, and from how far [m]; agent and centres: of the
        spheres that move; bounce_sample: each ray's own on the unit square, wanted
        for light that bounces (`lighting.onwards`)."""


class Tracers:
    """The tracers of a world, one for every level of light. Raises what `tracer_of` does for direct light."""

    def __init__(self, world: World, static: StaticScene, wavelengths: np.ndarray, name: str = "auto") -> None:
        self._world, self._static, self._wavelengths, self._name = world, static, wavelengths, name
        self._known: dict[str, Tracer] = {}
        self._areas: dict[str, AreaTracer] = {}
        self.of(lighting.DIRECT)

    def of(self, light: str) -> Tracer:
        """The one that follows this much of the light.

        Raises:
            ValueError: see `tracer_of`.
        """
        if light not in self._known:
            with variant(self._static.variant):
                self._known[light] = tracer_of(self._world, self._static, self._wavelengths, self._name, light)
        return self._known[light]

    def areas(self, light: str) -> AreaTracer:
        """The one that sees by areas.

        Raises:
            ValueError: a world that cannot be seen so, and a tracer that was asked for and has no areas.
        """
        if self._name == Traced.name:
            raise ValueError(f"samples = 'areas': tracer = {self._name!r} traces rays only")
        if light not in self._areas:
            try:
                self._areas[light] = self._by_areas(light)
            except NoClosedForm as reason:
                raise ValueError(f"samples = 'areas': this world has no closed form: {reason}") from reason
        return self._areas[light]

    def _by_areas(self, light: str) -> AreaTracer:
        static, world = self._static, self._world
        above = [world.model.body(name).pos[2] for name in world.objects]
        heights = np.add([*above, EYE_HEIGHT], static.bodies.offsets[:, 2])
        with variant(static.variant):
            rays = ClosedForm(world, static, self._wavelengths, light)
            return AreaTracer(rays, static.bodies, heights, len(static.spheres))


def tracer_of(
    world: World, static: StaticScene, wavelengths: np.ndarray, name: str, light: str = lighting.DIRECT
) -> Tracer:
    """The tracer of a world, "auto" being the fastest that can.

    Raises:
        ValueError: an unknown name, for "closed_form" where the world has none, for lights other than directional ones,
            for surfaces that are not Lambertian, and for light that bounces off an agent with a texture.
    """
    if light == lighting.ALL:
        raise ValueError("light = 'all': rays follow light that is reflected twice at most, see samples = 'areas'")
    if light == lighting.BOUNCE and shapes.is_textured(world.model, static.bodies.geoms[-1]):
        raise ValueError("light = 'bounce': the agent's body has a texture, which would have to turn with it")
    if name not in TRACERS:
        raise ValueError(f"tracer = {name!r}: must be one of {', '.join(map(repr, TRACERS))}")
    lighting.check_lambertian([*static.spheres.bsdfs, *(shape.bsdf() for shape in static.scene.shapes())])
    if name == Traced.name:
        return Traced(static, wavelengths, "asked for", light)
    try:
        return ClosedForm(world, static, wavelengths, light)
    except NoClosedForm as reason:
        if name == ClosedForm.name:
            raise ValueError(f"tracer = 'closed_form': this world has no closed form: {reason}") from reason
        return Traced(static, wavelengths, f"no closed form: {reason}", light)
