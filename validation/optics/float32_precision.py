"""Float32 precision: rounded phases and dark windows

Phases are proportional to the distance, and float32 has only seven digits. Up to which distance are phases in float32
accurate, and when does `optics.psf` need float64? With float32 phases, the error of the textbook angular spectrum
method exceeds 1e-5 beyond a distance of 2 mm, 1e-3 beyond 0.1 m and 1 beyond 3 m. `optics.psf` in float32 stays below
1e-5 at every distance. It needs float64 only for windows far from the focus that receive very little light.

**First table.** A phase kz in float32 has a rounding error of up to kz 2^-24. For light of 550 nm, this is 7e-4 rad at
a distance of 1 mm and 0.7 rad at 1 m. The lenses have Fresnel number 20 and focus at 0.1 mm to 10 m. The textbook's
angular spectrum is computed entirely in float32, phases included. It is compared with the same method in float64, so
the two differ only by rounding.

In `optics`, phases are stored as optical paths in float64. Whole waves are removed in float64, and only the remainder,
below one wave, is converted to float32. Long distances alone therefore do not require float64.

**Second table.** In `optics`, float32 is not accurate enough for dark windows. The rounding error is a fixed fraction
of the pupil's light, and a window far from the focus receives so little of that light that the error is large in
comparison. Here the source in front of an ideal lens (R = 50 µm, f = 0.5 mm) moves off the axis while the window stays
on the axis. "window / focus" is the brightness in the window relative to that in the focus (root mean squares). Every
PSF is compared with the direct sum at a few of its points. If the error at these points exceeds the tolerance, the PSF
is computed again with a smaller tolerance or by an exact method. If the error is still too large, an `AccuracyError` is
raised, whose message recommends another dtype ("refused" in the table). With float64, the tolerance is still reached in
these windows.

    python -m validation.optics.float32_precision [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import optics
from validation.optics.textbook_propagation import angular_spectrum, sampled_lens
from validation.pages.page import Page, parser
from validation.reference import AIRY_ZEROS, relative_l2

WAVELENGTH = 550e-9
FRESNEL_NUMBER = 20.0
DISTANCES = tuple(float(z) for z in np.geomspace(1e-4, 10, 11))
SAMPLES = 256  # over 4R: the pitch is 0.6 times the largest that resolves the lens
TOLERANCE = 1.1e-5  # just above the smallest that float32 accepts
BREAKS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
RADIUS, FOCAL_LENGTH = 50e-6, 500e-6
ANGLES = (0.0, 0.03, 0.1, 0.2, 0.3, 0.6, 0.9, 1.2)  # [rad]
DARK_TOLERANCES = (1e-3, 1e-4, TOLERANCE)
REFERENCE = {"tolerance": 1e-9, "method": "rayleigh_sommerfeld", "dtype": "float64"}


@dataclass(frozen=True)
class Distant:
    """Results at one distance.

    naive: error of float32 phases.
    ours, plan: error and plan of optics.psf in float32.
    """

    distance: float
    naive: float
    ours: float
    plan: optics.Plan

    @property
    def rounding(self) -> float:
        """Rounding error of the phase, kz 2^-24 [rad]."""
        return 2 * np.pi / WAVELENGTH * self.distance * 2.0**-24


@dataclass(frozen=True)
class Dark:
    """Results for one window.

    brightness: root mean square of the window over that of the focus.
    errors, predicted: actual and predicted errors, one for each of DARK_TOLERANCES in float32, then one in float64. NaN
        if the PSF is refused.
    """

    angle: float
    brightness: float
    errors: tuple[float, ...]
    predicted: tuple[float, ...]
    refusals: tuple[str, ...]


def far(distance: float) -> Distant:
    radius = float(np.sqrt(FRESNEL_NUMBER * WAVELENGTH * distance))
    dx, middle = 4 * radius / SAMPLES, slice(SAMPLES // 2 - 8, SAMPLES // 2 + 9)
    u = sampled_lens(SAMPLES, dx, WAVELENGTH, radius, distance)
    double = angular_spectrum(u, dx, WAVELENGTH, distance)[middle, middle]
    single = angular_spectrum(u, dx, WAVELENGTH, distance, np.complex64)[middle, middle]
    third_ring = AIRY_ZEROS[2] * WAVELENGTH * distance / (2 * np.pi * radius)
    pupil = optics.Pupil(radius, thin_lens_focal_length=distance)
    window: dict[str, Any] = {"dx": third_ring / 16, "shape": (33, 33)}
    exact = optics.psf(pupil, [WAVELENGTH], distance, **window, **REFERENCE)
    ours = optics.psf(pupil, [WAVELENGTH], distance, **window, tolerance=TOLERANCE)
    naive = relative_l2(np.abs(single.astype(np.complex128)) ** 2, np.abs(double) ** 2)
    return Distant(distance, naive, relative_l2(ours.psf, exact.psf), ours.plan)


def dark(angle: float) -> Dark:
    pupil = optics.Pupil(RADIUS, thin_lens_focal_length=FOCAL_LENGTH)
    window: dict[str, Any] = {"dx": 0.6e-6, "shape": (33, 33), "source_angle": (angle, 0.0)}
    exact = optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, **window, **REFERENCE).psf
    peak = pupil.area / (WAVELENGTH * FOCAL_LENGTH) ** 2
    errors, predicted, refusals = [], [], []
    for tolerance, dtype in [*((t, "float32") for t in DARK_TOLERANCES), (TOLERANCE, "float64")]:
        try:
            found = optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, **window, tolerance=tolerance, dtype=dtype)
            errors.append(relative_l2(found.psf, exact))
            predicted.append(found.plan.predicted_error)
        except optics.AccuracyError as error:
            refusals.append(str(error))
            errors.append(np.nan)
            predicted.append(np.nan)
    brightness = float(np.sqrt(np.mean(exact**2))) / peak
    return Dark(angle, brightness, tuple(errors), tuple(predicted), tuple(refusals))


def breaking_distances(rows: list[Distant]) -> list[float]:
    """Return distances at which errors of float32 phases exceed each of BREAKS, interpolated by power laws."""
    errors = np.maximum.accumulate([row.naive for row in rows])
    return [float(np.exp(np.interp(np.log(b), np.log(errors), np.log(DISTANCES)))) for b in BREAKS]


def broken_bounds(rows: list[Distant], windows: list[Dark]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for row in rows:
        if not row.naive <= max(row.rounding, 1e-6):
            broken.append(f"{row.distance:.1e} m: float32 phases have an error of {row.naive:.1g}, above kz 2^-24")
        if row.distance >= 0.3 and not row.naive > 1e-3:
            broken.append(f"{row.distance:.1e} m: float32 phases have the error {row.naive:.1g}, too small to be true")
        if not (row.ours <= TOLERANCE and row.ours <= 3 * row.plan.predicted_error):
            broken.append(f"{row.distance:.1e} m: optics.psf has an error of {row.ours:.1g}")
    for window in windows:
        name = f"window at brightness {window.brightness:.1g}"
        for error, predicted, tolerance in zip(
            window.errors, window.predicted, (*DARK_TOLERANCES, TOLERANCE), strict=True
        ):
            if not np.isnan(error) and not (error <= 3 * predicted and error <= tolerance):
                broken.append(f"{name}: error {error:.1g}, predicted {predicted:.1g}, tolerance {tolerance:.1g}")
        if np.isnan(window.errors[-1]):
            broken.append(f"{name}: refused in float64")
        broken += [f"{name}: refused without a remedy: {words}" for words in window.refusals if "dtype" not in words]
    if not np.isnan(windows[-1].errors[2]):
        broken.append("the darkest window should be refused in float32 at 1.1e-5")
    return broken


def table(rows: list[Distant], windows: list[Dark]) -> str:
    lines = ["distance [m]  kz 2^-24 [rad]  float32 phases  optics.psf  predicted  method"]
    for row in rows:
        lines.append(
            f"{row.distance:<13.1e} {row.rounding:<15.1e} {row.naive:<15.1e} {row.ours:<11.1e} "
            f"{row.plan.predicted_error:<10.1e} {row.plan.method}"
        )
    pairs = zip(BREAKS, breaking_distances(rows), strict=True)
    lines.append("float32 phases break " + ", ".join(f"{b:g} at {z * 1e3:.2g} mm" for b, z in pairs))
    lines.append("\noff axis   window /  actual error by optics.psf, float32 at tolerance       float64 at")
    lines.append("[rad]      focus     " + "".join(f"{t:<18g}" for t in (*DARK_TOLERANCES, TOLERANCE)))
    for window in windows:
        cells = ("refused" if np.isnan(e) else f"{e:.1e}" for e in window.errors)
        lines.append(f"{window.angle:<10g} {window.brightness:<9.1e} " + "".join(f"{cell:<18}" for cell in cells))
    return "\n".join(lines)


def draw(rows: list[Distant], windows: list[Dark], path: Path) -> None:
    """Draw the error over distance, and over the darkness of the window."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    z = [row.distance for row in rows]
    left.loglog(z, [row.naive for row in rows], "o-", color="#999999", label="textbook, phases in float32")
    left.loglog(z, [row.rounding for row in rows], ":", color="black", lw=1, label="kz 2⁻²⁴, the rounding of the phase")
    left.loglog(z, [row.ours for row in rows], "o-", color="#D55E00", label="optics.psf in float32")
    left.axhline(TOLERANCE, color="#009E73", ls="--", lw=1, label="its requested tolerance")
    left.set(xlabel="distance = focal length [m], Fresnel number 20", ylabel="relative L2 error of intensity")
    left.set(title="float32 phases lose their digits", ylim=(1e-8, 20))
    left.legend(frameon=False, fontsize=8.5, loc="upper left")
    darkness = [window.brightness for window in windows]
    colors = "#56B4E9", "#0072B2", "#D55E00", "#009E73"
    names = [f"float32, tolerance {t:g}" for t in DARK_TOLERANCES] + [f"float64, tolerance {TOLERANCE:g}"]
    for i, (color, name) in enumerate(zip(colors, names, strict=True)):
        errors = np.array([window.errors[i] for window in windows])
        right.loglog(darkness, errors, "o-", color=color, label=name)
        refused = [b for b, e in zip(darkness, errors, strict=True) if np.isnan(e)]
        right.loglog(refused, [TOLERANCE] * len(refused), "x", color=color, ms=8, mew=2)
    right.annotate("refused: AccuracyError", (darkness[5], TOLERANCE * 1.2), (darkness[5] * 30, 1e-3), fontsize=8.5,
                   arrowprops={"arrowstyle": "->", "lw": 0.7})  # fmt: skip
    right.invert_xaxis()
    right.set(xlabel="brightness of the window / focus (dark to the right)", title="A dark window needs float64")
    right.set(ylabel="relative L2 error of intensity", ylim=(1e-9, 1e-2))
    right.legend(frameon=False, fontsize=8.5, loc="upper left")
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    rows, windows = [far(z) for z in DISTANCES], [dark(angle) for angle in ANGLES]
    page = Page("float32_precision", __doc__, table(rows, windows), broken_bounds(rows, windows))
    return page.publish(options, lambda path: draw(rows, windows, path))


if __name__ == "__main__":
    sys.exit(main())
