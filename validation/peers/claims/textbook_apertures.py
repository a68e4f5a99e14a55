"""Claims of textbooks on circles, rings and slits in focus, and on the light behind them on the axis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import j1

import optics
from validation import reference
from validation.peers.claims.claim import RADIUS, UNIT, WAVE, Case, across, lens

__all__ = ["of_circles", "of_openings", "on_the_axis"]

FINE = 0.001  # λ f/D


def dark(pupil: optics.Pupil, near: float) -> float:
    """Return the position [λ f/D] of the minimum of the light near a position."""
    at = np.arange(near - 0.05, near + 0.05, FINE)
    return float(at[across(pupil, np.round(at / FINE) * FINE).argmin()])


def ring(near: float) -> tuple[float, float]:
    """Return the position [λ f/D] and the height of the maximum of the light near a position."""
    at = np.round(np.arange(near - 0.05, near + 0.05, FINE) / FINE) * FINE
    found = across(lens(), at)
    return float(at[found.argmax()]), float(found.max())


def of_circles() -> Iterator[Case]:
    table = "Goodman, Fourier Optics, table 4.1"
    for order, place in enumerate((1.220, 2.233, 3.238), 1):
        yield Case(table, f"dark ring {order} [λf/D]", place, lambda near=place: dark(lens(), near), 1e-3)
    for order, (place, light) in enumerate(((1.635, 0.0175), (2.679, 0.0042), (3.699, 0.0016)), 1):
        yield Case(table, f"bright ring {order} [λf/D]", place, lambda near=place: ring(near)[0], 2e-3)
        yield Case(table, "its light, of the peak's", light, lambda near=place: ring(near)[1], 6e-5)
    for order, (radius, share) in enumerate(((1.220, 0.838), (2.233, 0.910), (3.238, 0.938)), 1):

        def held(radius: float = radius) -> float:
            seen = optics.psf(lens(), [WAVE], dx=UNIT / 4, shape=(65, 65), tolerance=1e-4)
            return float(optics.encircled_energy(seen, radius * UNIT)[0, 0])

        yield Case("Born & Wolf, Principles of Optics, §8.5.2", f"light within dark ring {order}", share, held, 1e-3)
    for share, contrast in ((0.25, 0.6850), (0.5, 0.3910), (0.75, 0.1443)):

        def seen(share: float = share) -> float:
            picture = optics.psf(lens(), [WAVE], dx=UNIT / 4, shape=(257, 257), tolerance=1e-4)
            return float(optics.mtf(picture).profile(np.array([share / UNIT]))[0, 0])

        yield Case("Goodman, eq. 6-32", f"MTF of a circle at {share:g} of the cutoff", contrast, seen, 5e-3)

    def dip() -> float:
        at = np.array([0.0, 0.61, 1.22])
        one = across(lens(), at)
        return float(2 * one[1] / (one[0] + one[2]))

    yield Case("Born & Wolf, §8.6.2", "light midway between two points at Rayleigh's distance", 0.735, dip, 2e-3)


def of_openings() -> Iterator[Case]:
    half = lens(aperture=optics.Annulus(0.5))
    yield Case("Born & Wolf, §8.6.2", "first dark ring, inner radius 0.5 R [λf/D]", 1.00, lambda: dark(half, 1.0), 6e-3)
    for inner in (0.25, 0.5):
        pupil = lens(aperture=optics.Annulus(inner))

        def rest(pupil: optics.Pupil = pupil, inner: float = inner) -> float:
            at = np.arange(0.05, 5, 0.05)
            v = np.pi * at
            exact = ((2 * j1(v) / v - inner * 2 * j1(inner * v) / v) / (1 - inner**2)) ** 2
            return float(np.abs(across(pupil, np.arange(0, 5, 0.05))[1:] - exact).max())

        yield Case("Born & Wolf, §8.6.2", f"ring's PSF less the closed form, inner radius {inner:g} R", 0.0, rest, 1e-4)
    for order, (place, light) in enumerate(((1.430, 0.0472), (2.459, 0.0165)), 1):

        def bright(near: float = place, width: float = np.sqrt(2)) -> tuple[float, float]:
            slit = lens(aperture=optics.Slit(width, width))
            at = np.round(np.arange(near - 0.05, near + 0.05, FINE) / FINE) * FINE * 2 / width
            found = across(slit, at)
            return float(at[found.argmax()] * width / 2), float(found.max())

        yield Case(
            "Born & Wolf, §8.5.1", f"bright fringe {order} of a square [λf/width]", place, lambda f=bright: f()[0], 3e-3
        )
        yield Case("Born & Wolf, §8.5.1", "its light, of the peak's", light, lambda f=bright: f()[1], 2e-4)
    for share in (0.3, 0.6):

        def contrast(share: float = share) -> float:
            picture = optics.psf(
                lens(aperture=optics.Slit(1.2, 1.2)), [WAVE], dx=UNIT / 4, shape=(513, 513), tolerance=1e-3
            )
            found = optics.mtf(picture)
            line = found.mtf[0, len(found.fy) // 2]
            return float(np.interp(share * 0.6 / UNIT, found.fx, line))

        yield Case("Goodman, eq. 6-30", f"MTF of a square at {share:g} of its cutoff", 1 - share, contrast, 5e-3)


def on_the_axis() -> Iterator[Case]:
    """Yield claims on the light on the axis behind apertures, which has exact closed forms."""
    for z in (15e-6, 40e-6, 100e-6):

        def light(z: float = z) -> float:
            return _middle(optics.Pupil(20e-6), z)

        exact = reference.circular_aperture_on_axis(20e-6, z, WAVE)
        yield Case(
            "Osterberg & Smith, JOSA 51, 1050 (1961)", f"aperture of 20 µm, at {z * 1e6:g} µm", exact, light, 1e-4
        )
    inner, outer = (np.hypot(100e-6, r) for r in (10e-6, 20e-6))
    exact = (
        abs(100e-6 / inner * np.exp(2j * np.pi * inner / WAVE) - 100e-6 / outer * np.exp(2j * np.pi * outer / WAVE))
        ** 2
    )
    pupil = optics.Pupil(20e-6, aperture=optics.Annulus(0.5))
    yield Case(
        "Osterberg & Smith, of two disks",
        "behind a ring of 10 to 20 µm",
        float(exact),
        lambda: _middle(pupil, 100e-6),
        1e-4,
    )
    for zones, light in ((1, 4.0), (2, 0.0), (3, 4.0)):

        def behind(zones: int = zones) -> float:
            return _middle(optics.Pupil(RADIUS), RADIUS**2 / (zones * WAVE))

        yield Case(
            "Born & Wolf, §8.2",
            f"light behind an opening of {zones} Fresnel zone{'s' * (zones > 1)}",
            light,
            behind,
            1e-2,
        )


def _middle(pupil: optics.Pupil, z: float) -> float:
    seen = optics.psf(pupil, [WAVE], z, dx=1e-7, shape=(3, 3), tolerance=1e-5, dtype="float64")
    return float(seen.psf[0, 1, 1]) * pupil.area
