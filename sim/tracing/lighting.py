"""Light from the scene's directional emitters, by hand.

Direct light is what Mitsuba's `direct` integrator converges to, without its noise, since each emitter has exactly one
direction. Light that was reflected once more before is found at the end of one more ray, which leaves the surface in a
fixed direction drawn from Lambert's cosine: each camera ray has a sample of its own on the unit square for it, its
bounce sample (`sim.eyes.sensor`), so that the rays of a receptor together see the hemisphere.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.variant import MitsubaObject

LANES = 4  # wavelengths in one mi.Spectrum
# What of the light is followed: "bounce" adds what is reflected twice, "all" what is reflected more often.
DIRECT, BOUNCE, ALL = LEVELS = ("direct", "bounce", "all")


@dataclass(frozen=True)
class DirectionalLight:
    """direction: towards the light, unit (3,) · irradiance: on a surface facing it, per band (band,)."""

    direction: np.ndarray
    irradiance: np.ndarray


def spectra(wavelengths: np.ndarray) -> list[Array]:
    """The bands' wavelengths [m] as Mitsuba spectra [nm], LANES at a time; the last one is filled up by repetition."""
    padded = np.pad(wavelengths * 1e9, (0, -len(wavelengths) % LANES), mode="edge")
    return [mi.Spectrum(*map(float, chunk)) for chunk in padded.reshape(-1, LANES)]


def onwards(point: Array, normal: Array, bounce_sample: Array) -> Array:
    """The ray that leaves a surface as a sample (2,) of the unit square says, on which Lambert's cosine is laid out.

    With the radiance L that it brings, ρ L is what the surface sends on, averaged over samples."""
    local = mi.warp.square_to_cosine_hemisphere(bounce_sample)
    # Not mi.Frame3f(normal): on walls, whose normals are level to rounding, its axes are the rounding's.
    # Any vector well away from the normal does; 0.9: up to 26° from upright, the other one is taken.
    beside = dr.select(dr.abs(normal.z) < 0.9, mi.Vector3f(0, 0, 1), mi.Vector3f(1, 0, 0))
    s = dr.normalize(dr.cross(beside, mi.Vector3f(normal)))
    direction = mi.Frame3f(s, dr.cross(mi.Vector3f(normal), s), normal).to_world(local)
    return mi.Ray3f(clear_of(point, normal), direction)


def clear_of(point: Array, normal: Array) -> Array:
    """A point as far from the surface as Mitsuba's own shadow rays start."""
    offset = (1 + dr.max(dr.abs(point))) * mi.math.RayEpsilon
    return mi.Point3f(dr.fma(normal, offset, point))


def diffuse_reflectance(si: Array, bsdf: MitsubaObject, wavelengths: Array) -> Array:
    """Of a Lambertian surface."""
    si.wavelengths = wavelengths
    return bsdf.eval_diffuse_reflectance(si, si.is_valid())
