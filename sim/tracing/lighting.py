"""Light from the scene's directional emitters: direct, and reflected once more.

Direct light is the limit of Mitsuba's `direct` integrator without its noise, because each emitter has exactly one
direction. Light that was reflected once before is found by one more ray. It leaves the surface in a fixed direction
that is drawn from Lambert's cosine. Each camera ray has its own sample on the unit square for this direction, its
bounce sample (`sim.eyes.sensor`). The rays of a receptor together sample the hemisphere.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.variant import MitsubaObject

LANES = 4  # wavelengths in one mi.Spectrum
# Parts of the light: "bounce" adds light that is reflected twice, "all" light that is reflected more often.
DIRECT, BOUNCE, ALL = LEVELS = ("direct", "bounce", "all")


@dataclass(frozen=True)
class DirectionalLight:
    """direction: towards the light, unit (3,) · irradiance: on a surface facing it, per band (band,)."""

    direction: np.ndarray
    irradiance: np.ndarray


def spectra(wavelengths: np.ndarray) -> list[Array]:
    """Return the bands' wavelengths [m] as Mitsuba spectra [nm] of LANES each, the last one filled up by repetition."""
    padded = np.pad(wavelengths * 1e9, (0, -len(wavelengths) % LANES), mode="edge")
    return [mi.Spectrum(*map(float, chunk)) for chunk in padded.reshape(-1, LANES)]


def spawn_bounce_ray(point: Array, normal: Array, bounce_sample: Array) -> Array:
    """Return a ray that leaves a surface; a sample (2,) on the unit square is mapped to directions by Lambert's cosine.

    With L the radiance along this ray, the surface reflects ρ L, averaged over samples."""
    local = mi.warp.square_to_cosine_hemisphere(bounce_sample)
    # mi.Frame3f(normal) is not used: walls' normals are level up to rounding errors, which would decide its axes.
    # Any vector far enough from the normal serves. With 0.9, x is used for normals up to 26° from upright.
    beside = dr.select(dr.abs(normal.z) < 0.9, mi.Vector3f(0, 0, 1), mi.Vector3f(1, 0, 0))
    s = dr.normalize(dr.cross(beside, mi.Vector3f(normal)))
    direction = mi.Frame3f(s, dr.cross(mi.Vector3f(normal), s), normal).to_world(local)
    return mi.Ray3f(clear_of(point, normal), direction)


def clear_of(point: Array, normal: Array) -> Array:
    """Return a point off the surface, as far from it as the start of Mitsuba's own shadow rays."""
    offset = (1 + dr.max(dr.abs(point))) * mi.math.RayEpsilon
    return mi.Point3f(dr.fma(normal, offset, point))


def diffuse_reflectance(si: Array, bsdf: MitsubaObject, wavelengths: Array) -> Array:
    """Return the reflectance of a Lambertian surface at these wavelengths."""
    si.wavelengths = wavelengths
    return bsdf.eval_diffuse_reflectance(si, si.is_valid())
