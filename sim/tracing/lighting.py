"""Light from the scene's directional emitters, after one or two reflections.

Direct light is light after one reflection, at the visible surface. It is computed exactly, because each emitter has
exactly one direction. Mitsuba's `direct` integrator estimates the same value with noise. Light that another surface
reflects to the visible surface is sampled by one bounce ray per camera ray. The bounce ray leaves the visible surface
in a direction that is distributed as Lambert's cosine. The camera ray's bounce sample, a fixed point on the unit square
(`sim.eyes.sensor`), determines this direction. Together, the bounce rays of all camera rays of a receptor sample the
hemisphere.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.variant import MitsubaObject

LANES = 4  # wavelengths in one mi.Spectrum
# Levels of light: "direct" includes one reflection, "bounce" up to two, "all" any number.
DIRECT, BOUNCE, ALL = LEVELS = ("direct", "bounce", "all")


@dataclass(frozen=True)
class DirectionalLight:
    """A light at infinity.

    direction: unit vector towards the light, (3,)
    irradiance: irradiance on a surface that faces the light, (band,)
    """

    direction: np.ndarray
    irradiance: np.ndarray


def spectra(wavelengths: np.ndarray) -> list[Array]:
    """Return the wavelengths [m] of the bands in groups of 4. Each group is a Mitsuba spectrum of wavelengths in nm.

    If the last group is not full, the last wavelength is repeated.
    """
    padded = np.pad(wavelengths * 1e9, (0, -len(wavelengths) % LANES), mode="edge")
    return [mi.Spectrum(*map(float, chunk)) for chunk in padded.reshape(-1, LANES)]


def spawn_bounce_ray(point: Array, normal: Array, bounce_sample: Array, clearance: float = 1) -> Array:
    """Return a ray that leaves a surface in a direction that depends on a sample, a point on the unit square, (2,).

    If samples are uniform on the square, the density of directions is proportional to the cosine of the angle with the
    normal (Lambert's law). If light of radiance L arrives along the ray, the radiance that the surface reflects is the
    mean of ρ L over the samples, with the surface's reflectance ρ.

    clearance: see `clear_of`
    """
    local = mi.warp.square_to_cosine_hemisphere(bounce_sample)
    # mi.Frame3f(normal) is not used: the normals of walls are horizontal up to rounding errors, and these errors would
    # decide the directions of the frame's axes. Instead, the axes are computed from a vector that is not close to the
    # normal: x for normals up to 26° from upright (cosine 0.9), otherwise z.
    beside = dr.select(dr.abs(normal.z) < 0.9, mi.Vector3f(0, 0, 1), mi.Vector3f(1, 0, 0))
    s = dr.normalize(dr.cross(beside, mi.Vector3f(normal)))
    direction = mi.Frame3f(s, dr.cross(mi.Vector3f(normal), s), normal).to_world(local)
    return mi.Ray3f(clear_of(point, normal, clearance), direction)


def clear_of(point: Array, normal: Array, clearance: float = 1) -> Array:
    """Return a point in front of the surface.

    clearance: distance of this point from the surface, relative to the distance at which Mitsuba's own shadow rays
        start. Mitsuba's distance is 9e-5 times the sum of 1 m and the largest absolute coordinate of the point
    """
    offset = (1 + dr.max(dr.abs(point))) * (mi.math.RayEpsilon * clearance)
    return mi.Point3f(dr.fma(normal, offset, point))


def diffuse_reflectance(si: Array, bsdf: MitsubaObject, wavelengths: Array) -> Array:
    """Return the reflectance of a Lambertian surface at these wavelengths (a Mitsuba spectrum) [nm]."""
    si.wavelengths = wavelengths
    return bsdf.eval_diffuse_reflectance(si, si.is_valid())
