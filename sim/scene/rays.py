"""Rays of a sensor through a scene: radiance at given wavelengths, and first hits at the pixels' centres.

Faces that MuJoCo does not draw are skipped. The functions use the types of Mitsuba's active variant: arrays of many
rays or, in a scalar variant, one ray at a time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.arguments import reals, shown, whole
from optics.numerics.autodiff import Array
from optics.spectra.spectrum import LIMITS_NM
from sim.scene.variant import Description, MitsubaObject

MOST_PIXELS = 2**16  # chosen limit for the pixels along one side of an image
MOST_SAMPLES = 2**31 - 1  # chosen limit for the samples per pixel
MOST_SEED = 2**128  # largest allowed seed; the seeds that NumPy draws have 128 bits
LANES = 4  # wavelengths in one mi.Spectrum
WAVEFRONT = 1 << 21  # rays traced at once
ROUNDING = 1e-12  # [m] tolerance for wavelengths
NESTED = 64  # limit for the number of nested bodies that contain a camera


def checked_size(width: Any, height: Any) -> tuple[int, int]:
    """Return the width and height of an image as ints; ValueError unless they are whole numbers in [1, 65,536]."""
    return whole("width", width, 1, MOST_PIXELS), whole("height", height, 1, MOST_PIXELS)


def checked_wavelengths(wavelengths: Any) -> np.ndarray:
    """Return wavelengths [m], (band,).

    Raises:
        ValueError: there is no wavelength, or one is outside the range of the spectra, for example because it is in
            nanometres.
    """
    found = reals("wavelengths", wavelengths)
    low, high = (1e-9 * limit for limit in LIMITS_NM)
    if found.ndim != 1 or not len(found) or not ((found > low - ROUNDING) & (found < high + ROUNDING)).all():
        raise ValueError(f"wavelengths = {shown(wavelengths)}: must be in metres, from {low:.3g} to {high:.3g}")
    return found


@dataclass(frozen=True)
class Camera:
    """A sensor in a scene.

    scene, sensor: Mitsuba's objects
    names: names of the scene's shapes, by their ids
    one_sided: names of the shapes whose inner side is invisible
    """

    scene: MitsubaObject
    sensor: MitsubaObject
    names: Mapping[int, str]
    one_sided: frozenset[str]

    @property
    def size(self) -> tuple[int, int]:
        """Size (width, height) in pixels."""
        width, height = (int(n) for n in self.sensor.film().size())
        return width, height

    def radiance(
        self,
        integrator: str | Mapping[str, Any],
        spp: int,
        wavelengths: np.ndarray,
        seed: int,
        sampler: str = "independent",
    ) -> np.ndarray:
        """Return the radiance (band, y, x) at `wavelengths` [m], in float32.

        It is the mean over `spp` random positions in each pixel.

        sampler: Mitsuba's "independent", or "multijitter", which stratifies the samples of a pixel, so that images have
            less noise. "multijitter" is refused in scalar variants, and also if it would round the number of samples
            that a pass takes in a pixel (large images need several passes).

        Raises:
            ValueError: the integrator or the sampler is unknown, Mitsuba would apply one of them incorrectly, or `spp`
                or `seed` is not a whole number in its range.
        """
        spp, seed = whole("spp", spp, 1, MOST_SAMPLES), whole("seed", seed, 0, MOST_SEED)
        width, height = self.size
        method = _integrator(integrator)
        samples_at_once = max(1, WAVEFRONT // (width * height))
        bands = []
        for start in range(0, len(wavelengths), LANES):
            nm = 1e9 * wavelengths[start : start + LANES]
            spectrum = [float(x) for x in np.pad(nm, (0, LANES - len(nm)), mode="edge")]
            total = np.zeros((LANES, height * width))
            for done in range(0, spp, samples_at_once):
                n = min(samples_at_once, spp - done)
                # The same seed for every group of wavelengths, so that their rays are the same.
                sampler_seed = (seed * 0x9E3779B1 + done) & 0xFFFFFFFF
                total += self._sum_of_samples(method, spectrum, _sampler(sampler, n), sampler_seed)
            bands.append(total[: len(nm)] / spp)
        return np.concatenate(bands).reshape(-1, height, width).astype(np.float32)

    def first_hits(self) -> tuple[list[str], np.ndarray]:
        """Return the name of the shape visible at each pixel's centre, and the hit points [m], (n, 3), row by row.

        Where no shape is visible, the name is "" and the point is not finite.
        """
        width, height = self.size
        y, x = (a.ravel() for a in np.indices((height, width)))
        positions = np.stack([(x + 0.5) / width, (y + 0.5) / height]).astype(np.float32)
        if _is_scalar():
            hits = [self._scalar_hit(position) for position in positions.T]
            return [name for name, _ in hits], np.array([point for _, point in hits])
        ray, _ = self.sensor.sample_ray(0.0, 0.5, mi.Point2f(positions), mi.Point2f(0.5))
        ray.maxt = dr.inf  # no far limit
        si = self._first_visible(ray)
        shape: Array = dr.reinterpret_array(mi.UInt32, si.shape)
        found = dr.select(si.is_valid(), shape, 0).numpy()
        # The distance of a hit is exact, but its point is inaccurate on shapes as large as a world.
        return [self.names[i] if i else "" for i in found], np.array(ray(si.t).numpy(), dtype=float).T

    def _scalar_hit(self, position: np.ndarray) -> tuple[str, np.ndarray]:
        ray, _ = self.sensor.sample_ray(0.0, 0.5, [float(p) for p in position], [0.5, 0.5])
        ray.maxt = dr.inf
        si = self._first_visible(ray)
        if not si.is_valid():
            return "", np.full(3, np.nan)
        return si.shape.id(), np.array(ray(si.t), dtype=float)

    def _first_visible(self, ray: Array) -> Array:
        """Return the first visible hit, and move the ray's origin past invisible inner sides of one-sided shapes."""
        si = self.scene.ray_intersect(ray)
        for _ in range(NESTED):
            inner = self._is_inner(si, ray)
            if not dr.any(inner):
                break
            # The offset is along the ray only. Mitsuba's own offset is sideways, by 0.1 mm per metre, and visible near
            # close objects.
            beyond = ray(si.t * (1 + 1e-5) + 4e-6 * (1 + dr.max(dr.abs(ray.o))))
            ray.o = dr.select(inner, beyond, ray.o)
            si = self.scene.ray_intersect(ray)
        return si

    def _is_inner(self, si: Array, ray: Array) -> Array:
        leaving = si.is_valid() & (dr.dot(si.n, ray.d) > 0)
        if _is_scalar():
            return bool(leaving) and si.shape.id() in self.one_sided
        table = mi.Bool([self.names.get(i, "") in self.one_sided for i in range(max(self.names) + 1)])
        shape: Array = dr.reinterpret_array(mi.UInt32, si.shape)
        return leaving & dr.gather(mi.Bool, table, shape, leaving)

    def _sum_of_samples(
        self, method: MitsubaObject, spectrum: list[float], sampler: MitsubaObject, seed: int
    ) -> np.ndarray:
        """Return, for each pixel, the sum of the radiance of all samples, (4 wavelengths, pixels)."""
        width, height = self.size
        n = sampler.sample_count()
        if _is_scalar():
            sampler.seed(seed)
            corners = [(x / width, y / height) for y in range(height) for x in range(width)]
            return np.array(
                [sum(self._sample(method, spectrum, sampler, *corner) for _ in range(n)) for corner in corners]
            ).T
        pixels = width * height
        sampler.set_samples_per_wavefront(n)
        sampler.seed(seed, pixels * n)
        pixel = dr.arange(mi.UInt32, pixels * n) // n
        values = self._sample(
            method, spectrum, sampler, mi.Float(pixel % width) / width, mi.Float(pixel // width) / height
        )
        return values.reshape(LANES, pixels, n).sum(axis=2, dtype=float)

    def _sample(
        self, method: MitsubaObject, spectrum: list[float], sampler: MitsubaObject, x: Array, y: Array
    ) -> np.ndarray:
        width, height = self.size
        jitter = sampler.next_2d()
        position = mi.Point2f(x + jitter.x / width, y + jitter.y / height)
        ray, _ = self.sensor.sample_ray_differential(0.0, 0.5, position, mi.Point2f(0.5))
        ray.maxt = dr.inf
        # Wavelengths are opaque to the compiler, so that other wavelengths use the same kernel.
        ray.wavelengths = mi.Spectrum(*(x if _is_scalar() else dr.opaque(mi.Float, x) for x in spectrum))
        self._first_visible(ray)
        value = method.sample(self.scene, sampler, ray)[0]
        return np.array(value) if _is_scalar() else np.array(value.numpy(), dtype=float)


def names_of(scene: MitsubaObject) -> dict[int, str]:
    """Return the names of a scene's shapes by their Dr.Jit ids; empty in a scalar variant, which has no ids."""
    return {} if _is_scalar() else {_registry_id(shape): shape.id() for shape in scene.shapes()}


def described(integrator: str | Mapping[str, Any]) -> Description:
    """Return the description of an integrator.

    Raises:
        ValueError: the argument is neither a name nor a description.
    """
    if not isinstance(integrator, str) and not (isinstance(integrator, Mapping) and "type" in integrator):
        raise ValueError(
            f"integrator = {shown(integrator)}: must be a name, or a description such as {{'type': 'path'}}"
        )
    return {"type": integrator} if isinstance(integrator, str) else dict(integrator)


def _integrator(integrator: str | Mapping[str, Any]) -> MitsubaObject:
    description = described(integrator)
    if description["type"] == "direct" and {"emitter_samples", "shading_samples"} & description.keys():
        # For point and directional lights, Mitsuba 3.9.1 adds several light samples instead of averaging them.
        raise ValueError('integrator "direct": its light samples cannot be set; take more spp')
    return _loaded("integrator", integrator, description, mi.Integrator, "'path'")


def _loaded(name: str, asked: Any, description: Description, kind: type, example: str) -> MitsubaObject:
    """Return the object of Mitsuba with this description; ValueError if Mitsuba refuses it or it is not of this kind.

    name, asked, example: name and value of the user's argument, and a valid value
    """
    try:
        found = mi.load_dict(description)
        why = "" if isinstance(found, kind) else f"that is no {name}"
    except (RuntimeError, TypeError) as error:
        why = " ".join(str(error).split())
    if why:
        raise ValueError(f"{name} = {shown(asked)}: must be one of Mitsuba's, such as {example}; its message: {why}")
    return found


def _sampler(kind: str, n: int) -> MitsubaObject:
    one = {"type": kind, "sample_count": n}
    sampler: MitsubaObject = _loaded("sampler", kind, one, mi.Sampler, "'independent'")
    if kind != "independent" and (_is_scalar() or sampler.sample_count() != n):
        raise ValueError(f"sampler = {kind!r}: cannot take {n} samples here; take 'independent'")
    return sampler


def _registry_id(shape: MitsubaObject) -> int:
    pointer: Array = dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))
    return int(pointer[0])


def _is_scalar() -> bool:
    return str(mi.variant()).startswith("scalar")
