"""Light on the visible part of a body.

Shadows and the effect of other bodies are computed once for the whole visible part. All other factors depend on the
surface's normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import DepthLayers
from sim.tracing.areas.illumination import FrameState, Illumination
from sim.tracing.areas.light_table import sum_of
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.sphere_areas import SphereView


@dataclass(frozen=True)
class BodyLight:
    """Light on the visible part of one body.

    illumination: direct light
    visibility: fraction of each light that reaches the visible part
    around: spherical harmonics of the reflected light around the body: for each component of the light's spectrum, a
        list of groups of four harmonics; empty if reflected light is neglected
    change: change of the reflected light due to other bodies, for each component of the light's spectrum
    """

    illumination: Illumination
    visibility: list[Array]
    around: list[list[Array]]
    change: list[Array]

    @classmethod
    def on_patch(cls, illumination: Illumination, body: int, patch: Patch, now: FrameState) -> BodyLight:
        """Return the light on the visible part of a body.

        body: index of the body
        patch: parallelogram in place of the visible part, for shadows and the effect of other bodies
        """
        lit = illumination.visibility(patch, now, body)
        if not now.body_light:
            return cls(illumination, lit, [], [])
        around = illumination.bodies.reflected_around(mi.UInt32(body), now.world, now.body_light)
        free = [sum_of(fours, patch.normal) for fours in around]
        left = illumination.past_bodies(patch, free, now, body)
        return cls(illumination, lit, around, [a - b for a, b in zip(left, free, strict=True)])

    def on(self, normal: Array) -> list[Array]:
        """Return the irradiance where the body's surface has this normal, one array per component of the light.

        All light in the world is a sum of the components. The components are either a few spectra that suffice to
        represent all light, or the spectral bands of the eye.
        """
        light = self.illumination.arriving(normal, self.visibility)
        if not self.around:
            return light
        parts = zip(light, self.around, self.change, strict=True)
        return [straight + sum_of(fours, normal) + change for straight, fours, change in parts]


@dataclass(frozen=True)
class LitSphere:
    """A sphere that is visible in an area, and the light on it.

    An area is a rectangle of an eye's visual field over which light is averaged.

    number: index of the sphere among the bodies
    view: visible part of the sphere
    light: light on the sphere
    now: inputs of the current frame
    depth: distances for which the eye has a point spread function; the sphere's light is divided among them
    """

    number: int
    view: SphereView
    light: BodyLight
    now: FrameState
    depth: DepthLayers
