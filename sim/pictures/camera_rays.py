"""The rays of an image as one frozen Dr.Jit kernel, and the direct light along them.

A ray is specified by a whole number: 8 times the index of its pixel, plus the index of its sample within the pixel.
Every light is sampled once per ray, whereas Mitsuba's `direct` draws one of them at random. Point lights and
directional lights therefore cause no noise. Skies and glowing geoms cause noise, but the samples of a pixel are fixed,
so the noise is the same in every frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.precision import aligned
from sim.pictures.merged_mirror import MergedMirror
from sim.scene.cameras import Viewpoint
from sim.scene.device_arrays import floats, whole_numbers
from sim.scene.frozen_kernels import GarbageKept
from sim.scene.lights import Emitter
from sim.scene.variant import MitsubaObject, variant

# Four wavelengths fill one mi.Spectrum. All sets on a grid of 5 nm with distances of at least 25 nm were compared.
# For colours and white in daylight, the results of this set are closest to those of `sim.scene.color.preview` at the
# eight wavelengths of the slow image (`sim.envs.follow_camera`).
WAVELENGTHS_NM = (450.0, 525.0, 590.0, 630.0)
SRGB = np.array(  # linear sRGB per radiance at these wavelengths, (3, wavelength); fitted so that daylight is white
    [
        [0.01277, -0.38566, 0.82772, 0.79327],
        [-0.05517, 0.81225, 0.31464, -0.09293],
        [0.85403, 0.08263, -0.13935, 0.04385],
    ]
)

# A pixel's samples, relative to its middle [pixels], which is the first sample. If a pixel is divided into five rows
# and five columns, no two samples are in the same row or column.
SAMPLES = np.array([[0, 0], [0.2, 0.4], [0.4, -0.2], [-0.2, -0.4], [-0.4, 0.2]])
CODES = 8  # numbers of rays that are reserved for each pixel
NESTED = 64  # largest number of nested bodies that may enclose a camera
# Rays of a packet go through neighbouring pixels, and then towards one sun, so Embree traverses its tree once for all.
COHERENT = True
WANTED = int(mi.RayFlags.UV) | int(mi.RayFlags.ShadingFrame)  # properties of hits; textures need no derivatives
_VIEW = 5  # rows of four floats: position, columns of the rotation, (tan(fovy / 2), near, width, height)


@dataclass(frozen=True)
class RayLight:
    """Light along rays, and the tangent planes of the surfaces that the rays hit.

    linear: linear sRGB, not clipped, (3, ray)
    plane: coefficients of the surface's tangent plane at each ray's hit point, (3, ray); 0 without a hit. A line of
        sight with the slopes `across` (to the right) and `above` (up) per unit of depth, see `plane_coordinates`, meets
        this tangent plane at 1 / depth = plane @ (across, above, 1) [1/m].
    """

    linear: np.ndarray
    plane: np.ndarray


@dataclass(frozen=True)
class CameraInputs:
    """Kernel inputs that are the same for every image of a scene.

    samples: positions of the samples relative to a pixel's middle [pixels], two floats each
    weights: irradiance from each directional light, four floats each (one per wavelength)
    closed: for each shape, True if a camera inside it sees through it
    bsdfs: BSDFs of all shapes. The kernel does not use this input. However, Dr.Jit records the kernel, and the
        recording includes a texture only if the BSDF with this texture is among the inputs.
    """

    samples: Array
    weights: Array
    closed: Array
    bsdfs: Array


class CameraRays:
    """A tracer of camera rays through the scene of one `MergedMirror`, in its current pose."""

    def __init__(self, mirror: MergedMirror) -> None:
        self.mirror = mirror
        with variant(mirror.variant):
            scene = mirror.scene
            self._lights = list(scene.emitters())
            lamps = [mirror.lamps.get(light.id()) for light in self._lights]
            self._suns = {k: lamp.name for k, lamp in enumerate(lamps) if lamp is not None and _is_sun(lamp)}
            self._shadowless = {k for k, lamp in enumerate(lamps) if lamp is not None and not lamp.casts_shadow}
            self._glows = any(not _is_delta(light) for light in self._lights)
            self._matt = all(_is_matt(shape.bsdf()) for shape in scene.shapes())
            weights = np.array(
                [_sun_weight(light) if k in self._suns else [0.0] * 4 for k, light in enumerate(self._lights)]
            )
            samples = np.pad(SAMPLES, ((0, CODES - len(SAMPLES)), (0, 0)))
            self._inputs = CameraInputs(
                floats(samples),
                floats(np.append(weights, np.zeros(4))),
                whole_numbers(_closed(mirror)),
                mi.BSDFPtr([shape.bsdf() for shape in scene.shapes()]),
            )
            # Mitsuba 3.9 does not expose the tables that sample a glowing texture to a recording.
            may_record = not any(_is_textured_glow(light) for light in self._lights)
            self._outside: Any = dr.freeze(lambda *args: self._trace(False, *args), enabled=may_record)
            self._inside: Any = dr.freeze(lambda *args: self._trace(True, *args), enabled=may_record)

    def trace(self, view: Viewpoint, size: tuple[int, int], codes: np.ndarray) -> RayLight:
        """Return the light along rays of an image of size (height, width).

        codes: a whole number for each ray: 8 times the index of its pixel, plus the index of its sample, (ray,)
        """
        traced = self._inside if self.mirror.surrounds(view.position) else self._outside
        suns = {k: self.mirror.towards(name, view) for k, name in self._suns.items()}
        with variant(self.mirror.variant), GarbageKept():
            pose = mi.Float(_pose(view, size, self.mirror.near, suns, len(self._lights)))
            lanes = aligned(len(codes), np.uint32)
            lanes[:] = codes
            found = traced(self.mirror.scene, mi.UInt32(lanes), pose, self._inputs)
            rows = np.stack([component.numpy() for component in found])
        return RayLight(rows[:3], rows[3:])

    @property
    def recordings(self) -> int:
        """Number of times that Dr.Jit recorded the kernels, instead of reusing an earlier recording."""
        return int(self._outside.n_recordings + self._inside.n_recordings)

    def _trace(
        self, inside: bool, scene: MitsubaObject, codes: Array, pose: Array, inputs: CameraInputs
    ) -> tuple[Array, ...]:
        ray, axes = _ray(codes, pose, inputs.samples)
        si = scene.ray_intersect(ray, WANTED, COHERENT)
        if inside:
            si = _through_inner_sides(scene, si, ray, inputs.closed)
        si.wavelengths = mi.Spectrum(*WAVELENGTHS_NM)
        light = self._direct_light(scene, si, codes, pose, inputs)
        rgb = [sum(float(w) * light[b] for b, w in enumerate(row)) for row in SRGB]
        away = dr.dot(si.n, si.p - axes.position)
        plane = [dr.select(si.is_valid() & (away != 0), dr.dot(si.n, axis) / away, 0) for axis in axes.directions]
        return *rgb, *plane

    def _direct_light(self, scene: MitsubaObject, si: Array, codes: Array, pose: Array, inputs: CameraInputs) -> Array:
        bsdf, valid = si.bsdf(), si.is_valid()
        reflected = bsdf.eval_diffuse_reflectance(si, valid) * dr.inv_pi if self._matt else None
        seen_from = dr.dot(si.n, si.to_world(si.wi))
        total = si.emitter(scene).eval(si) if self._glows else mi.Spectrum(0)
        for k, light in enumerate(self._lights):
            if k in self._suns:
                towards = mi.Vector3f(*list(dr.gather(mi.Vector4f, pose, mi.UInt32(_VIEW + k)))[:3])
                weight = mi.Spectrum(dr.gather(mi.Vector4f, inputs.weights, mi.UInt32(k)))
                reaches, shadow = valid, si.spawn_ray(towards)
            else:
                drawn = mi.Point2f(mi.sample_tea_float32(codes, 2 * k), mi.sample_tea_float32(codes, 2 * k + 1))
                sample, weight = light.sample_direction(si, drawn, valid)
                towards, reaches, shadow = sample.d, valid & (sample.pdf != 0), si.spawn_ray_to(sample.p)
            # `reaches & ...` creates a new array. Dr.Jit's `&=` would also change `valid`, which may be the same array.
            if reflected is not None:
                value = reflected * dr.abs(dr.dot(si.sh_frame.n, towards))
                reaches = reaches & (dr.dot(si.n, towards) * seen_from > 0)
            else:
                value = bsdf.eval(mi.BSDFContext(), si, si.to_local(towards), reaches)
                reaches = reaches & (dr.max(value) > 0)
            if k not in self._shadowless:
                reaches = reaches & ~scene.ray_test(shadow, COHERENT, reaches)
            total += dr.select(reaches, value * weight, 0)
        return total


def _through_inner_sides(scene: MitsubaObject, si: Array, ray: Array, closed: Array) -> Array:
    """Return each ray's first hit after passing through all inner sides of closed shapes in front of it.

    si: first hits of the rays, including hits on inner sides
    closed: see `CameraInputs`
    """

    def leaving(si: Array, ray: Array, turn: Array) -> Array:
        out = si.is_valid() & (dr.dot(si.n, ray.d) > 0) & (turn < NESTED)
        shape: Array = dr.reinterpret_array(mi.UInt32, si.shape)
        return out & (dr.gather(mi.UInt32, closed, shape, out) == 1)

    def further(si: Array, ray: Array, turn: Array) -> tuple[Array, ...]:
        # As in `sim.scene.rays`, the origin moves along the ray only, not sideways like Mitsuba's `spawn_ray`.
        step = si.t * (1 + 1e-5) + 4e-6 * (1 + dr.max(dr.abs(ray.o)))
        next_ray = mi.Ray3f(ray(step), ray.d)
        return scene.ray_intersect(next_ray, WANTED, COHERENT), next_ray, turn + 1

    return dr.while_loop((si, ray, mi.UInt32(0)), leaving, further, label="inner sides")[0]


@dataclass(frozen=True)
class _Axes:
    """Frame of a camera: its position, and unit vectors to the right, up and ahead."""

    position: Array
    directions: tuple[Array, Array, Array]


def _ray(codes: Array, pose: Array, samples: Array) -> tuple[Array, _Axes]:
    position, right, up, back, more = (dr.gather(mi.Vector4f, pose, mi.UInt32(k)) for k in range(_VIEW))
    half, near, width, height = more
    pixel = codes // CODES
    offset = dr.gather(mi.Point2f, samples, codes - pixel * CODES)
    # In floats, because a division of whole numbers by 0 in a packet's idle lanes would end the process.
    row = dr.floor((mi.Float(pixel) + 0.5) / width)
    x, y = mi.Float(pixel) - row * width + 0.5 + offset.x, row + 0.5 + offset.y
    rightwards, upwards, ahead = (mi.Vector3f(*list(axis)[:3]) for axis in (right, up, -back))
    axes = _Axes(mi.Point3f(*list(position)[:3]), (rightwards, upwards, ahead))
    across, above = (2 * x - width) / height * half, (1 - 2 * y / height) * half
    along = across * axes.directions[0] + above * axes.directions[1] + axes.directions[2]
    return mi.Ray3f(axes.position + near * along, dr.normalize(along)), axes


def plane_coordinates(fovy_deg: float, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes of the rays through the pixels' centres, per unit of depth: to the right (x,) and up (y,)."""
    height, width = size
    half = np.tan(np.radians(fovy_deg) / 2)
    across = (2 * (np.arange(width) + 0.5) - width) / height * half
    return across, (1 - 2 * (np.arange(height) + 0.5) / height) * half


def _pose(
    view: Viewpoint, size: tuple[int, int], near: float, suns: Mapping[int, np.ndarray], n_lights: int
) -> np.ndarray:
    """Return the kernel inputs that change between frames: the view, and the directions to the directional lights.

    The inputs are rows of four floats, joined to a one-dimensional array. The view comes first, followed by a row for
    each light, which is used only if the light is directional.
    """
    rows = aligned(4 * (_VIEW + n_lights), np.float32).reshape(-1, 4)
    rows[0, :3], rows[1:4, :3] = view.position, view.rotation.T
    rows[4] = np.tan(np.radians(view.fovy_deg) / 2), near, size[1], size[0]
    for k, towards in suns.items():
        rows[_VIEW + k, :3] = towards
    return rows.ravel()


def _closed(mirror: MergedMirror) -> np.ndarray:
    """Return, for each shape id, 1 if a camera inside the shape sees through it, and otherwise 0, (id,) uint32."""
    names = mirror.shape_names
    return np.array([names.get(i, "") in mirror.closed for i in range(max(names) + 1)], np.uint32)


def _is_delta(light: MitsubaObject) -> bool:
    """Return whether a light shines from a point or in one direction."""
    return bool(int(light.flags()) & (int(mi.EmitterFlags.DeltaPosition) | int(mi.EmitterFlags.DeltaDirection)))


def _is_sun(lamp: Emitter) -> bool:
    return bool(lamp.description["type"] == "directional")


def _is_textured_glow(light: MitsubaObject) -> bool:
    """Return whether a light is a surface that glows with a texture.

    Dr.Jit records a kernel so that it can run again for later images. A kernel that samples such a light cannot be
    recorded, because Mitsuba does not expose the tables from which it samples the texture. A sky is not a surface, and
    its tables are available.
    """
    kinds = int(mi.EmitterFlags.Surface) | int(mi.EmitterFlags.SpatiallyVarying)
    return int(light.flags()) & kinds == kinds


def _sun_weight(light: MitsubaObject) -> np.ndarray:
    """Return the irradiance on a surface that faces a directional light, (wavelength,)."""
    si: Array = dr.zeros(mi.SurfaceInteraction3f)
    si.wavelengths = mi.Spectrum(*WAVELENGTHS_NM)
    _, weight = light.sample_direction(si, mi.Point2f(0.5))
    return np.array(weight, dtype=float).ravel()


def _is_matt(bsdf: MitsubaObject) -> bool:
    """Return whether a BSDF is a Lambertian reflector, on one side or both."""
    sides = int(mi.BSDFFlags.FrontSide) | int(mi.BSDFFlags.BackSide) | int(mi.BSDFFlags.SpatiallyVarying)
    return int(bsdf.flags()) & ~sides == int(mi.BSDFFlags.DiffuseReflection)
