"""Lights that cast no shadow, as emitters for all of Mitsuba's integrators.

Mitsuba's integrators sample a point of an emitter, and test the path from the surface to this point. A light without
shadows places the point right above the surface, so that nothing can be in between.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.scene.variant import Description

INNER = "light"  # name of the light with shadows among the parameters
# Distance of the sampled point from a surface, relative to 1 m or the coordinates if they are larger: a tenth of the
# distance at which Mitsuba's shadow rays start, and 100 steps of float32.
_CLOSE = 1e-5


def shadowless(light: Description) -> Description:
    """Return an emitter that emits the same light as the emitter `light`, but casts no shadows.

    light: a directional, point or spot emitter
    """
    _register(str(mi.variant()))
    return {"type": "shadowless", INNER: light}


@cache
def _register(variant: str) -> None:
    """Register the emitter "shadowless" in Mitsuba's active variant.

    Mitsuba has no classes until a variant is set.

    variant: name of the active variant
    """

    class Shadowless(mi.Emitter):
        """An emitter that has the light of another emitter, but casts no shadow.

        When an integrator samples a point on the emitter, this class places the point directly above the illuminated
        surface, so that nothing can be in between.
        """

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.light = props[INNER]
            self.m_flags = self.light.flags()

        def sample_direction(self, it: Array, sample: Array, active: Any = True) -> tuple[Array, Array]:
            found, weight = self.light.sample_direction(it, sample, active)
            step = _CLOSE * (1 + dr.max(dr.abs(it.p)))
            found.p = mi.Point3f(it.spawn_ray(found.d).o + found.d * step)
            return found, weight

        def pdf_direction(self, it: Array, ds: Array, active: Any = True) -> Array:
            return self.light.pdf_direction(it, ds, active)

        def eval_direction(self, it: Array, ds: Array, active: Any = True) -> Array:
            return self.light.eval_direction(it, ds, active)

        def eval(self, si: Array, active: Any = True) -> Array:
            return self.light.eval(si, active)

        def traverse(self, callback: Any) -> None:
            callback.put(INNER, self.light, mi.ParamFlags.NonDifferentiable)

        def bbox(self) -> Any:
            return self.light.bbox()

    mi.register_emitter("shadowless", Shadowless)
