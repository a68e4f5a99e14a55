"""Foci of many Fresnel zones with Zernike modes up to order six: `python -m validation.benchmarks.many_zones`.

The script prints CPU seconds of one thread for 513 x 513 samples about the focus with compiled kernels. It also prints
the difference between the PSF and the direct sum at 16 points about the middle of the PSF, relative to the root mean
square of the PSF at these points.
"""

from __future__ import annotations

import time

import drjit as dr
import numpy as np

import optics
from optics.point_spread.planner import choose

WAVELENGTH, SIDE, ORDER = 550e-9, 513, 6
FRESNEL_NUMBERS, APERTURES, TOLERANCES = (1_000, 10_000), (0.1, 0.3), (1e-2, 1e-3)
WAVES = 0.08  # [µm] of a mode of second order; higher ones have smaller coefficients


def lens(fresnel_number: float, aperture: float, rng: np.random.Generator) -> optics.Pupil:
    """Return a lens with a random wavefront."""
    tangent = aperture / np.sqrt(1 - aperture**2)
    radius = fresnel_number * WAVELENGTH / tangent
    modes = {(n, m): WAVES * rng.normal() / (n - 1) for n in range(2, ORDER + 1) for m in range(-n, n + 1, 2)}
    return optics.Pupil(radius, thin_lens_focal_length=radius / tangent, wavefront=optics.Zernike(modes))


def seconds(pupil: optics.Pupil, dx: float, tolerance: float) -> tuple[optics.PSFResult, float]:
    """Return the PSF, including planning, and its CPU time."""
    for _ in range(2):
        choose.cache_clear()
        start = time.process_time()
        result = optics.psf(pupil, [WAVELENGTH], dx=dx, shape=(SIDE, SIDE), tolerance=tolerance)
        spent = time.process_time() - start if result.psf.size else 0.0
    return result, spent


def off(result: optics.PSFResult, rng: np.random.Generator) -> float:
    """Return the relative difference from the direct sum."""
    places = SIDE // 2 + np.round(rng.normal(size=(16, 2)) * 8).astype(int)
    ask = {"shape": (1, 1), "method": "rayleigh_sommerfeld", "tolerance": 1e-6, "dtype": "float64"}
    exact = [
        optics.psf(result.pupil, [WAVELENGTH], dx=result.dx, centre=(result.x[i], result.y[j]), **ask).psf[0, 0, 0]
        for j, i in places
    ]
    seen = result.psf[0, places[:, 0], places[:, 1]]
    return float(np.linalg.norm(seen - exact) / np.linalg.norm(exact))


def main() -> None:
    """Print a row for each lens and tolerance."""
    dr.set_thread_count(1)
    rng = np.random.default_rng(3)
    print("| Fresnel number | NA | tolerance | seconds | error |\n|---|---|---|---|---|")
    for fresnel_number in FRESNEL_NUMBERS:
        for aperture in APERTURES:
            pupil = lens(fresnel_number, aperture, rng)
            for tolerance in TOLERANCES:
                result, spent = seconds(pupil, WAVELENGTH / aperture / 8, tolerance)
                print(f"| {fresnel_number} | {aperture} | {tolerance:g} | {spent:.2f} | {off(result, rng):.0e} |")


if __name__ == "__main__":
    main()
