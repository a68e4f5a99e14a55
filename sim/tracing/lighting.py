"""Light from the scene's directional emitters, by hand.

Direct light is what Mitsuba's `direct` integrator converges to, without its noise, since each emitter has exactly one
direction. Light that was reflected once more before is found at the end of one more ray, which leaves the surface in a
fixed direction drawn from Lambert's cosine: each camera ray has a sample of its own on the unit square for it, its
bounce sample (`sim.eyes.sensor`), so that the rays of a receptor together see the hemisphere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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


def directional_lights(scene: MitsubaObject, wavelengths: np.ndarray) -> tuple[DirectionalLight, ...]:
    """The scene's lights at the bands' wavelengths [m].

    Raises:
        ValueError: any other kind of emitter.
    """
    lights = []
    for emitter in scene.emitters():
        if emitter.class_name() != "DirectionalEmitter":
            raise ValueError(f"the batched renderer knows directional lights only, not {emitter.class_name()}")
        irradiance = []
        for spectrum in spectra(wavelengths):
            si = dr.zeros(mi.SurfaceInteraction3f)
            si.wavelengths = spectrum
            sample, weight = emitter.sample_direction(si, mi.Point2f(0.5))
            irradiance.append(np.array(weight).ravel())
        direction = np.array(sample.d, dtype=np.float64).ravel()
        lights.append(DirectionalLight(direction, np.concatenate(irradiance)[: len(wavelengths)]))
    return tuple(lights)


def white_radiance(scene: MitsubaObject, wavelengths: np.ndarray) -> np.ndarray:
    """Of a white surface that faced all of the scene's lights at once, per band (band,): no surface sends out more of
    their direct light."""
    lights = directional_lights(scene, wavelengths)
    return sum((light.irradiance for light in lights), np.zeros(len(wavelengths))) / np.pi


def check_lambertian(bsdfs: Sequence[MitsubaObject]) -> None:
    """Refuse what the renderer cannot light.

    Raises:
        ValueError: a BSDF that is not a Lambertian reflector, on one side or both.
    """
    sides = int(mi.BSDFFlags.FrontSide) | int(mi.BSDFFlags.BackSide)
    for bsdf in bsdfs:
        kinds = int(bsdf.flags()) & ~(sides | int(mi.BSDFFlags.SpatiallyVarying))
        if kinds != int(mi.BSDFFlags.DiffuseReflection):
            raise ValueError(f"the batched renderer knows Lambertian surfaces only, not {bsdf.class_name()}")


def direct_light(
    si: Array,
    bsdf: MitsubaObject,
    lights: tuple[DirectionalLight, ...],
    bands: list[Array],
    occluded: Callable[[Array, Array], Array],
) -> list[Array]:
    """Radiance [mi.Spectrum per chunk of bands] that leaves a Lambertian surface at si: ρ/π Σ_l E_l cos θ_l.

    occluded(ray, active) tells which rays towards a light are blocked. The inside of a closed one-sided surface
    needs no case of its own: no light gets there.
    """
    irradiance = [mi.Spectrum(0) for _ in bands]
    seen_from = dr.dot(si.n, si.to_world(si.wi))
    for light in lights:
        towards = mi.Vector3f(*map(float, light.direction))
        lit = si.is_valid() & (dr.dot(si.n, towards) * seen_from > 0)
        lit &= ~occluded(si.spawn_ray(towards), lit)
        cosine = dr.select(lit, dr.abs(dr.dot(si.sh_frame.n, towards)), 0)
        chunks = np.pad(light.irradiance, (0, -len(light.irradiance) % LANES)).reshape(-1, LANES)
        for i, chunk in enumerate(chunks):
            irradiance[i] += cosine * mi.Spectrum(*map(float, chunk))
    return [e * diffuse_reflectance(si, bsdf, b) * dr.inv_pi for e, b in zip(irradiance, bands, strict=True)]


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
