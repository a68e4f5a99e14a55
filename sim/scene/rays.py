"""Rays of a sensor through a scene: what Mitsuba's own film does, but at given wavelengths and pixel centres.

Works on the types of the variant in force: whole wavefronts, or, in a scalar variant, one ray at a time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

LANES = 4  # wavelengths in one mi.Spectrum
WAVEFRONT = 1 << 21  # rays traced at once


def check_size(width: int, height: int, spp: int) -> None:
    for name, value in (("width", width), ("height", height), ("spp", spp)):
        if value < 1:
            raise ValueError(f"{name} = {value}, must be at least 1")


def radiance(
    scene: Any,
    sensor: Any,
    integrator: str | Mapping[str, Any],
    spp: int,
    wavelengths: np.ndarray,
    seed: int,
    sampler: str = "independent",
) -> np.ndarray:
    """Radiance (band, y, x) float32 at `wavelengths` [m]: the mean over `spp` random positions in each pixel.

    sampler  of Mitsuba's: "independent", or "multijitter", whose samples of a pixel keep apart: less noise, of another
             kind than a standard error tells; not in scalar variants, nor for spp that it would round
    """
    width, height = (int(n) for n in sensor.film().size())
    method = mi.load_dict(_description(integrator))
    samples_at_once = max(1, WAVEFRONT // (width * height))
    bands = []
    for start in range(0, len(wavelengths), LANES):
        nm = 1e9 * wavelengths[start : start + LANES]
        spectrum = [float(x) for x in np.pad(nm, (0, LANES - len(nm)), mode="edge")]
        total = np.zeros((LANES, height * width))
        for done in range(0, spp, samples_at_once):
            n = min(samples_at_once, spp - done)
            # The same seed for every group of wavelengths: their rays are the same.
            sampler_seed = (seed * 0x9E3779B1 + done) & 0xFFFFFFFF
            total += _sum_of_samples(scene, sensor, method, spectrum, _sampler(sampler, n), sampler_seed)
        bands.append(total[: len(nm)] / spp)
    return np.concatenate(bands).reshape(-1, height, width).astype(np.float32)


def _description(integrator: str | Mapping[str, Any]) -> dict[str, Any]:
    description = {"type": integrator} if isinstance(integrator, str) else dict(integrator)
    if description["type"] == "direct" and {"emitter_samples", "shading_samples"} & description.keys():
        # Mitsuba 3.9.1 adds these samples up instead of averaging them where the light is a point or a direction.
        raise ValueError('integrator "direct": its light samples cannot be set; take more spp')
    return description


def first_hits(scene: Any, sensor: Any) -> tuple[list[str], np.ndarray]:
    """Name of the shape seen through each pixel's centre ("" for none), row by row, and the point hit (n, 3)."""
    width, height = (int(n) for n in sensor.film().size())
    y, x = (a.ravel() for a in np.indices((height, width)))
    positions = np.stack([(x + 0.5) / width, (y + 0.5) / height]).astype(np.float32)
    if _is_scalar():
        hits = [_scalar_hit(scene, sensor, position) for position in positions.T]
        return [name for name, _ in hits], np.array([point for _, point in hits])
    ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(positions), mi.Point2f(0.5))
    ray.maxt = dr.inf  # nothing is too far away to be seen
    si = scene.ray_intersect(ray)
    names = {_registry_id(shape): shape.id() for shape in scene.shapes()}
    shape: Any = dr.reinterpret_array(mi.UInt32, si.shape)
    found = dr.select(si.is_valid(), shape, 0).numpy()
    # Of the hit, its distance is exact; its point suffers on shapes as large as a world.
    return [names[i] if i else "" for i in found], np.array(ray(si.t).numpy(), dtype=float).T


def _registry_id(shape: Any) -> int:
    pointer: Any = dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))
    return int(pointer[0])


def _scalar_hit(scene: Any, sensor: Any, position: np.ndarray) -> tuple[str, np.ndarray]:
    ray, _ = sensor.sample_ray(0.0, 0.5, [float(p) for p in position], [0.5, 0.5])
    ray.maxt = dr.inf
    si = scene.ray_intersect(ray)
    if not si.is_valid():
        return "", np.full(3, np.nan)
    return si.shape.id(), np.array(ray(si.t), dtype=float)


def _sampler(kind: str, n: int) -> Any:
    sampler: Any = mi.load_dict({"type": kind, "sample_count": n})
    if kind != "independent" and (_is_scalar() or sampler.sample_count() != n):
        raise ValueError(f"sampler = {kind!r}: cannot take {n} samples here; take 'independent'")
    return sampler


def _sum_of_samples(scene: Any, sensor: Any, method: Any, spectrum: list[float], sampler: Any, seed: int) -> np.ndarray:
    """Sum of the sampler's samples per pixel, (LANES, pixels)."""
    width, height = (int(k) for k in sensor.film().size())
    n = sampler.sample_count()
    if _is_scalar():
        sampler.seed(seed)
        sums = [
            sum(
                _sample(scene, sensor, method, spectrum, sampler, x / width, y / height, width, height)
                for _ in range(n)
            )
            for y in range(height)
            for x in range(width)
        ]
        return np.array(sums).T
    pixels = width * height
    sampler.set_samples_per_wavefront(n)
    sampler.seed(seed, pixels * n)
    pixel = dr.arange(mi.UInt32, pixels * n) // n
    x, y = mi.Float(pixel % width) / width, mi.Float(pixel // width) / height
    values = _sample(scene, sensor, method, spectrum, sampler, x, y, width, height)
    return values.reshape(LANES, pixels, n).sum(axis=2, dtype=float)


def _sample(
    scene: Any,
    sensor: Any,
    method: Any,
    spectrum: list[float],
    sampler: Any,
    x: Any,
    y: Any,
    width: int,
    height: int,
) -> np.ndarray:
    jitter = sampler.next_2d()
    position = mi.Point2f(x + jitter.x / width, y + jitter.y / height)
    ray, _ = sensor.sample_ray_differential(0.0, 0.5, position, mi.Point2f(0.5))
    ray.maxt = dr.inf
    # Opaque to the compiler: other wavelengths are the same kernel.
    ray.wavelengths = mi.Spectrum(*(x if _is_scalar() else dr.opaque(mi.Float, x) for x in spectrum))
    value = method.sample(scene, sampler, ray)[0]
    return np.array(value) if _is_scalar() else np.array(value.numpy(), dtype=float)


def _is_scalar() -> bool:
    return str(mi.variant()).startswith("scalar")
