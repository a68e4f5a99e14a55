"""Which way a world is ray traced: in closed form where it has one, by Mitsuba otherwise."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from sim import lighting
from sim.closed_form import ClosedForm
from sim.stage import Stage
from sim.traced import Traced
from sim.walls import Unsuited
from sim.world import World

TRACERS = ("auto", ClosedForm.name, Traced.name)


class Tracer(Protocol):
    """name   of the way of tracing, one of TRACERS · why it was taken
    scene  what the kernel wants as an argument of its own; inputs: arrays that it reads
    basis  (component, band): radiance_b = sum_k basis[k, b] component_k
    """

    name: str
    why: str
    basis: np.ndarray

    @property
    def scene(self) -> Any:
        """A Mitsuba scene or None."""

    @property
    def inputs(self) -> dict[str, Any]:
        """Arrays, by name."""

    def radiance(
        self, scene: Any, ray: Any, agent: Any, centres: list[Any], inputs: dict[str, Any]
    ) -> tuple[list[Any], Any]:
        """What comes along each ray, one array per component, and from how far [m]; agent and centres: of the
        spheres that move."""


def tracer_of(world: World, stage: Stage, wavelengths: np.ndarray, name: str) -> Tracer:
    """The tracer of a world, "auto" being the fastest that can.

    Raises ValueError for an unknown name, for "closed_form" where the world has none, for lights other than
    directional ones and for surfaces that are not Lambertian.
    """
    if name not in TRACERS:
        raise ValueError(f"tracer = {name!r}, must be one of {', '.join(map(repr, TRACERS))}")
    lighting.check_lambertian([*stage.spheres.bsdfs, *(shape.bsdf() for shape in stage.scene.shapes())])
    if name == Traced.name:
        return Traced(stage, wavelengths, "asked for")
    try:
        return ClosedForm(world, stage, wavelengths)
    except Unsuited as reason:
        if name == ClosedForm.name:
            raise ValueError(f"tracer = 'closed_form': this world has no closed form: {reason}") from reason
        return Traced(stage, wavelengths, f"no closed form: {reason}")
