"""Limiting cases: a known value or an error of one line

Does every input at the edge of the domain give the right value or a clear error? Yes: all 12 inputs with a known result
give this result within their tolerance, and all 26 invalid inputs are refused with an error of one line.

**Method.** Each row of the table passes an input at the edge of the domain to `optics`, and has an expected outcome.
For an accepted input, the correct result is known, mostly in closed form. The computed result must agree with it within
a bound that the script sets for this row. A refused input must raise an error that names the problem, in most cases as
argument, value and valid range. No other outcome is allowed: no NaN, no mere warning, and no image of noise.

**Accepted inputs.** The table states the relative error of the result. For a dark field, it states the brightest sample
instead. The inputs are:

- pupils far below the wavelength, compared with the cos²θ lobe of Rayleigh-Sommerfeld's integral;
- a relief with the refractive index of the medium, and a relief of a single pixel (a plate), compared with a pupil
  without glass;
- a source in the focal plane of a lens. Its light is parallel behind the lens, and the result is compared with the
  light behind an aperture without a lens;
- a window of one sample, compared with the closed form; a window far off the axis, compared with quadrature; and a
  source at grazing incidence, compared with a result in float64;
- `optics.propagate` over a distance of 0 and of 1e6 m, for an evanescent wave, and for a field of zeros.

**Refused inputs.** These inputs raise an error:

- lengths of 0, NaN, below 1e-15 m or above 1e15 m, and a relief higher than 100 radii;
- arrays that are empty, not finite, or of the wrong shape;
- refractive indices below 1, including dispersion curves that fall below 1 at some wavelength;
- wavelengths outside the colour tables (300 to 780 nm), and pigments outside their range of peaks;
- a source behind the pupil;
- a tolerance of 0, or below what the dtype allows;
- windows so close that light reaches them only at grazing angles;
- cases that need more than 4 GB of memory, or more than 60 s.

The last two kinds of input, and a tolerance below what the dtype allows, raise an `AccuracyError`, which is a
`ValueError`. A tolerance of 0 raises a plain `ValueError`.

    python -m validation.optics.limiting_cases [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import optics
from optics import Pupil, RefractiveIndex
from optics.spectra.bands import daylight, pigment_absorptance
from validation.pages.page import Page, parser
from validation.reference import circular_aperture_on_axis, ideal_lens_field, plane_wave, relative_l2

LAMBDA, RADIUS, DISTANCE, FOCUS = 550e-9, 30e-6, 200e-6, 300e-6
WINDOW: dict[str, Any] = {"dx": 2e-6, "shape": (17, 17), "tolerance": 1e-3}


@dataclass(frozen=True)
class Edge:
    """A case at the edge of the domain.

    happened: actual outcome.
    expected: expected outcome.
    holds: True if they agree.
    """

    name: str
    happened: str
    expected: str
    holds: bool


def psf(pupil: Pupil, distance: float = DISTANCE, wavelength: float = LAMBDA, **more: Any) -> np.ndarray:
    return optics.psf(pupil, [wavelength], distance, **{**WINDOW, **more}).psf[0]


def propagated(u: Any, **more: Any) -> optics.PropagationResult:
    return optics.propagate(np.asarray(u), **{"dx": 1e-6, "wavelength": LAMBDA, "distance": 1e-5, **more})


def lobe(radius: float) -> float:
    """Return the error relative to the closed form of a tiny pinhole's PSF, πa² z² / (λρ²)² for ka << 1.

    Here a is the radius of the pinhole, and ρ is the distance from it. The closed form follows from the kernel
    ik z / (2πρ²) e^{ikρ}.
    """
    distance, side = 1e-3, 17
    got = psf(Pupil(radius), distance, dx=2e-4, shape=(side, side))
    x = (np.arange(side) - side // 2) * 2e-4
    rho2 = x[None, :] ** 2 + x[:, None] ** 2 + distance**2
    return relative_l2(got, math.pi * radius**2 * distance**2 / (LAMBDA * rho2) ** 2)


def same(pupil: Pupil, other: Pupil, **more: Any) -> float:
    return relative_l2(psf(pupil, **more), psf(other))


def on_axis() -> float:
    """Return the error of one sample on the axis, relative to the closed form of a bare aperture.

    The closed form is |1 - (z/L) e^{ik(L - z)}|², where L is the distance from the rim.
    """
    exact = circular_aperture_on_axis(RADIUS, DISTANCE, LAMBDA) / (math.pi * RADIUS**2)
    return abs(float(psf(Pupil(RADIUS), shape=(1, 1))[0, 0]) / exact - 1)


def far_window() -> float:
    """Return the error in a window 5 mm off the axis at a distance of 0.2 mm, relative to quadrature in float64.

    The brightness there is 1e-9.
    """
    result = optics.psf(BARE, [LAMBDA], DISTANCE, centre=(5e-3, 0.0), dx=2e-6, shape=(5, 5), tolerance=1e-2)
    r = np.hypot(result.x[None, :], result.y[:, None])
    return relative_l2(result.psf[0], np.abs(ideal_lens_field(r, LAMBDA, RADIUS, distance=DISTANCE)) ** 2 / BARE.area)


def slanted() -> float:
    """Return the error at 86° of incidence, where the lens' axis is dark, relative to float64."""
    pupil, asked = Pupil(RADIUS, thin_lens_focal_length=FOCUS), {"source_angle": (1.5, 0.0)}
    exact = psf(pupil, **asked, tolerance=1e-6, method="rayleigh_sommerfeld", dtype="float64")
    return relative_l2(psf(pupil, **asked), exact)


def evanescent_wave() -> float:
    """Return the error of the decay of an evanescent wave in the middle of a wide Gaussian.

    The wave is exp(2πifx) with f = 1.25/λ, and decays like e^{-2πz√(f² - 1/λ²)}.
    """
    f, z, dx = 1.25 / LAMBDA, 0.1 * LAMBDA, LAMBDA / 20
    x = (np.arange(641) - 320) * dx
    u = np.tile(np.exp(-((x / (100 * dx)) ** 2)) * np.exp(2j * np.pi * f * x), (641, 1))
    u = u * np.exp(-((x / (100 * dx)) ** 2))[:, None]
    out = propagated(u, dx=dx, distance=z, tolerance=1e-2).u
    decay = abs(plane_wave(np.zeros(1), z, LAMBDA, f)[0])
    return abs(abs(out[320, 320]) / decay - 1)


def far_away() -> float:
    """Return the error over a window far inside the first dark ring: there |U| is the integral of u, divided by λz."""
    distance, side = 1e6, 5
    found = np.abs(propagated(np.ones((side, side)), distance=distance).u)
    return relative_l2(found, np.full((side, side), (side * 1e-6) ** 2 / (LAMBDA * distance)))


def identity() -> float:
    u = np.random.default_rng(0).normal(size=(7, 9))
    return relative_l2(propagated(u, distance=0.0).u, u)


BARE, PLATE = Pupil(RADIUS), Pupil(RADIUS, np.array([[7e-6]]))
LENS = Pupil(RADIUS, thin_lens_focal_length=FOCUS)
ROUGH = np.random.default_rng(0).random((8, 8)) * 10e-6
# Errors that must be small, with their bounds.
VALUES: tuple[tuple[str, Callable[[], float], float], ...] = (
    ("pupil of 1 pm: against the cos²θ lobe", lambda: lobe(1e-12), 1e-3),
    ("pupil of 1 nm: against the cos²θ lobe", lambda: lobe(1e-9), 1e-3),
    ("pupil of λ/50: against the cos²θ lobe", lambda: lobe(LAMBDA / 50), 2e-2),
    ("relief at medium's index: against bare pupil", lambda: same(Pupil(RADIUS, ROUGH, n=1.0), BARE), 1e-9),
    ("DOE of one pixel: against bare pupil", lambda: same(PLATE, BARE), 1e-3),
    ("source in the focal plane: against no lens", lambda: same(LENS, BARE, source_distance=FOCUS), 1e-6),
    ("window of one sample: against the closed form", on_axis, 1e-3),
    ("window 88° off the axis: against quadrature", far_window, 1e-2),
    ("source 86° off the axis: against float64", slanted, 1e-3),
    ("propagate over 0 m: against the field itself", identity, 1e-6),
    ("propagate an evanescent wave: its decay", evanescent_wave, 2e-2),
    ("propagate over 1e6 m: against Fraunhofer's integral", far_away, 1e-3),
    ("propagate darkness: brightest sample", lambda: float(np.abs(propagated(np.zeros((5, 5))).u).max()), 0.0),
)
# Requests that must be refused, with the error message.
REFUSALS: tuple[tuple[str, Callable[[], Any], str], ...] = (
    ("pupil of 0 m", lambda: Pupil(0.0), r"aperture_radius = 0\.0: must be greater than 0"),
    ("pupil of NaN", lambda: Pupil(math.nan), r"aperture_radius = nan: must be greater than 0"),
    ("pupil of 1e-20 m", lambda: Pupil(1e-20), r"aperture_radius = 1e-20: .*at least 1e-15"),
    ("index below 1", lambda: Pupil(RADIUS, n=0.9), r"n = 0\.9: must lie in \[1, 10\]"),
    (
        "DOE of no pixel",
        lambda: Pupil(RADIUS, np.zeros((0, 0))),
        r"height has shape \(0, 0\): must be \(rows",
    ),
    ("pixels not square", lambda: optics.PixelRelief(np.zeros((2, 3))), r"height has shape \(2, 3\): must be square"),
    ("DOE with NaN", lambda: Pupil(RADIUS, np.full((4, 4), math.nan)), "height holds NaN"),
    (
        "lens of f = 0",
        lambda: Pupil(RADIUS, thin_lens_focal_length=0.0),
        "focal_length.* = 0.*: must be greater than 0",
    ),
    ("sensor in the pupil", lambda: psf(BARE, 0.0), r"sensor_distance = 0\.0: must be greater than 0"),
    ("source in the pupil", lambda: psf(BARE, source_distance=0.0), r"source_distance = 0\.0: must be greater than 0"),
    ("wavelength 0", lambda: psf(BARE, wavelength=0.0), r"wavelength = .*0\.0.*: must be greater than 0"),
    ("no wavelength", lambda: optics.psf(BARE, [], DISTANCE), "wavelengths is empty"),
    ("window of no sample", lambda: psf(BARE, shape=(0, 0)), r"shape = \(0, 0\): must be two whole numbers"),
    ("source behind the pupil", lambda: psf(BARE, source_angle=(1.6, 0.0)), r"source_angle = 1\.6: must lie in"),
    ("tolerance 0", lambda: psf(BARE, tolerance=0.0), r"tolerance = 0\.0: must lie in \[1e-12, 0\.5\]"),
    ("daylight at 290 nm", lambda: daylight(np.array([290e-9])), r"wavelengths hold 2\.9e-07 m: must lie in \[300e-9"),
    ("pigment of 800 nm", lambda: pigment_absorptance(np.array([5e-7]), 8e-7), "lambda_max = 8e-07: must lie in"),
    ("dispersion below 1", lambda: RefractiveIndex(1.5, -1e-13).at(3e-7), "n = 0.388889 at wavelength 3e-07 m"),
    (
        "tolerance of 1e-6 in float32",
        lambda: psf(BARE, tolerance=1e-6),
        "float32 allows at least 1e-05; dtype='float64' allows",
    ),
    ("relief of 1 m", lambda: Pupil(RADIUS, ROUGH * 1e5), "height spans .* must be in metres, at most 100 radii"),
    ("relief of 0.9 mm", lambda: psf(Pupil(RADIUS, ROUGH * 90)), "needs .* samples across, .*the limits are 4 GB"),
    (
        "X-rays (1 pm)",
        lambda: psf(BARE, wavelength=1e-12),
        "needs integrals over .* radii and .* angles, .*the limits are 4 GB",
    ),
    ("grazing: ±16 µm wide at 10 nm", lambda: psf(BARE, 1e-8, method="angular_spectrum"), "too close to grazing"),
    ("propagate NaN", lambda: propagated(np.full((5, 5), math.nan)), "u: must be finite everywhere"),
    ("propagate nothing", lambda: propagated(np.ones((0, 3))), r"u has shape \(0, 3\)"),
)


def measure() -> list[Edge]:
    return [_value(*row) for row in VALUES] + [_refusal(*row) for row in REFUSALS]


def _value(name: str, call: Callable[[], float], most: float) -> Edge:
    try:
        error = call()
    except Exception as failure:  # any other error is the outcome
        return Edge(name, f"{type(failure).__name__}: {failure}", f"at most {most:g}", False)
    return Edge(name, f"error {error:.1e}", f"at most {most:g}", bool(error <= most))


def _refusal(name: str, call: Callable[[], Any], line: str) -> Edge:
    try:
        call()
    except ValueError as error:
        words = str(error)
        known = re.search(line, words) is not None and "\n" not in words
        return Edge(name, f"{type(error).__name__}: {words}", f"a line like {line}", known)
    except Exception as failure:  # any other error is the outcome
        return Edge(name, f"{type(failure).__name__}: {failure}", f"a line like {line}", False)
    return Edge(name, "a result", f"a line like {line}", False)


def broken_bounds(edges: list[Edge]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    return [f"{edge.name}: {edge.happened}; expected {edge.expected}" for edge in edges if not edge.holds]


def table(edges: list[Edge]) -> str:
    return "\n".join(f"{edge.name:<47} {edge.happened}" for edge in edges)


def draw(path: Path) -> None:
    """Draw four PSFs at the edge of the domain, from a pinhole of 1 nm to a window far off the axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 3.6), layout="constrained")
    hole, collimated, slope, darkness = figure.subplots(1, 4)
    theta = np.linspace(-75, 75, 61)
    x = 1e-3 * np.tan(np.deg2rad(theta))
    cut = [psf(Pupil(1e-9), 1e-3, shape=(1, 1), centre=(float(at), 0.0))[0, 0] * (1 + (at / 1e-3) ** 2) for at in x]
    hole.plot(theta, np.cos(np.deg2rad(theta)) ** 2, color="black", lw=1, label="cos²θ")
    hole.plot(theta, np.array(cut) / max(cut), ".", color="#D55E00", label="optics.psf")
    hole.set(xlabel="θ [deg]", ylabel="intensity at equal distance", title="A pinhole of 1 nm")
    hole.legend(frameon=False, fontsize=8.5)
    fine: dict[str, Any] = {"dx": 0.5e-6, "shape": (1, 161)}
    at = (np.arange(161) - 80) * 0.5
    bare, lens = psf(BARE, **fine)[0], psf(LENS, **fine, source_distance=FOCUS)[0]
    collimated.plot(at, bare / bare.max(), color="black", lw=1, label="no lens, source at infinity")
    collimated.plot(at, lens / bare.max(), ".", ms=3, color="#D55E00", label="lens, source at its focus")
    collimated.set(xlabel="x [µm]", title="Source in the focal plane", ylim=(0, 1.45))
    collimated.legend(frameon=False, fontsize=8, loc="upper center")
    indices = np.linspace(1.33, 1.6, 10)
    difference = [relative_l2(psf(Pupil(RADIUS, ROUGH * 0.01, n=n, medium_n=1.33)), _wet()) for n in indices]
    slope.plot(indices, difference, "o-", color="#D55E00")
    slope.set(
        xlabel="index of a rough relief (100 nm) in water", ylabel="change of the PSF", title="n = medium: no effect"
    )
    places = np.geomspace(50e-6, 5e-3, 30)
    dark = [psf(BARE, shape=(1, 15), centre=(float(p), 0.0), tolerance=1e-2).mean() for p in places]
    darkness.loglog(places * 1e3, np.array(dark) / bare.max(), "o-", ms=3, color="#D55E00")
    darkness.set(
        xlabel="distance from the axis [mm] (means of 30 µm)", ylabel="PSF / peak", title="Far off: dark, not noise"
    )
    figure.savefig(path, dpi=110)


def _wet() -> np.ndarray:
    return psf(Pupil(RADIUS, medium_n=1.33))


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    edges = measure()
    return Page("limiting_cases", __doc__, table(edges), broken_bounds(edges)).publish(options, draw)


if __name__ == "__main__":
    sys.exit(main())
