"""Claims of textbooks on aberrations."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

import numpy as np

import optics
from validation import reference
from validation.peers.claims.claim import UNIT, WAVE, Case, lens, strehl_at_centre

__all__ = ["of_strehl_ratios", "of_wavefronts"]

# Peak terms ρ², ρ⁴, ρ³ cos θ, ρ² cos² θ, ρ cos θ in modes of root mean square 1, without piston.
PEAK = {
    "defocus": {(2, 0): 1 / (2 * sqrt(3))},
    "spherical": {(4, 0): 1 / (6 * sqrt(5)), (2, 0): 1 / (2 * sqrt(3))},
    "coma": {(3, 1): 1 / (3 * sqrt(8)), (1, 1): 1 / 3},
    "astigmatism": {(2, 0): 1 / (4 * sqrt(3)), (2, 2): 1 / (2 * sqrt(6))},
    "tilt": {(1, 1): 1 / 2},
}


def wave(**peaks: float) -> optics.Zernike:
    """Return the Zernike wavefront with these peak terms in waves."""
    modes: dict[tuple[int, int], float] = {}
    for name, waves in peaks.items():
        for key, share in PEAK[name].items():
            modes[key] = modes.get(key, 0.0) + share * waves * WAVE * 1e6
    return optics.Zernike(modes)


def of_strehl_ratios() -> Iterator[Case]:
    mahajan = "Mahajan, JOSA 73, 860 (1983)"
    rows = [
        ("defocus of λ/4", {"defocus": 0.25}, reference.strehl_defocus(0.25)),
        ("defocus of λ", {"defocus": 1.0}, reference.strehl_defocus(1.0)),
        ("spherical aberration of λ/4", {"spherical": 0.25}, reference.strehl_spherical(0.25)),
        (
            "spherical of λ, balanced by defocus",
            {"spherical": 1.0, "defocus": -1.0},
            reference.strehl_spherical(1.0, -1.0),
        ),
        ("coma of λ/4", {"coma": 0.25}, reference.strehl_coma(0.25)),
        ("coma of λ/2, balanced by tilt", {"coma": 0.5, "tilt": -1 / 3}, reference.strehl_coma(0.5, -1 / 3)),
        ("astigmatism of λ/4", {"astigmatism": 0.25}, reference.strehl_astigmatism(0.25)),
        (
            "astigmatism of λ/2, balanced",
            {"astigmatism": 0.5, "defocus": -0.25},
            reference.strehl_astigmatism(0.5, -0.25),
        ),
    ]
    for name, peaks, exact in rows:
        pupil = lens(wavefront=wave(**peaks))
        yield Case(
            f"{mahajan}, closed form", f"Strehl ratio, {name}", exact, lambda pupil=pupil: strehl_at_centre(pupil), 2e-4
        )
    for name, peaks in (
        ("defocus", {"defocus": 1.0}),
        ("balanced spherical", {"spherical": 1.0, "defocus": -1.0}),
        ("balanced coma", {"coma": 1.0, "tilt": -2 / 3}),
        ("balanced astigmatism", {"astigmatism": 1.0, "defocus": -0.5}),
    ):
        peak = 1 / 14 / reference.RMS_PER_WAVE[name]
        pupil = lens(wavefront=wave(**{key: value * peak for key, value in peaks.items()}))
        yield Case(
            "Born & Wolf, §9.3 (Maréchal)",
            f"Strehl ratio of λ/14 root mean square, {name}",
            (1 - 2 * np.pi**2 / 14**2) ** 2,
            lambda pupil=pupil: strehl_at_centre(pupil),
            1e-2,
        )
    for inner in (0.25, 0.5):
        pupil = lens(aperture=optics.Annulus(inner), wavefront=wave(defocus=0.5))
        exact = float(np.sinc(0.5 * (1 - inner**2)) ** 2)
        yield Case(
            f"{mahajan}, of rings",
            f"Strehl ratio of a ring from {inner:g} R, defocus of λ/2",
            exact,
            lambda pupil=pupil: strehl_at_centre(pupil),
            2e-4,
        )


def of_wavefronts() -> Iterator[Case]:
    for u in (np.pi, 2 * np.pi, 3 * np.pi):
        exact = float((np.sin(u / 4) / (u / 4)) ** 2)
        pupil = lens(wavefront=wave(defocus=u / (4 * np.pi)))
        yield Case(
            "Born & Wolf, §8.8.2 (Lommel)",
            f"light on the axis at u = {u / np.pi:.0f}π",
            exact,
            lambda pupil=pupil: strehl_at_centre(pupil),
            2e-4,
        )

    def lommel() -> float:
        picture = optics.psf(
            lens(wavefront=wave(defocus=0.75)), [WAVE], dx=UNIT / 8, shape=(1, 65), tolerance=1e-6, dtype="float64"
        )
        pupil = lens()
        line = picture.psf[0, 0] / (pupil.area / (UNIT * 2 * pupil.radius) ** 2)
        exact = reference.lommel_intensity(np.full(65, 3 * np.pi), np.pi * np.abs(picture.x) / UNIT)
        return float(np.abs(line - exact).max())

    yield Case("Born & Wolf, §8.8.1 (Lommel)", "PSF at u = 3π less the closed form", 0.0, lommel, 1e-3)
