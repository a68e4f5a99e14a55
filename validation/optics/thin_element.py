"""Thin element: effects that a phase mask omits from a real relief

Which effects of a real relief does a phase mask omit, and when do they matter? `optics` models every relief as a phase
mask. The mask is accurate for slopes below 10°, and for lenses below NA = 1.16 (λ/f)^¼, which is 0.25 for f = 240 µm.

**Method.** A relief of height h is modelled as the phase k(n - 1)h in one plane. The `predicted_error` of a PSF
includes errors of the propagation behind the mask, but not the error of this model. Rays through the real surface show
the effects that the mask omits. The rays follow Snell's law and come from inside the glass of n = 1.5
(`validation/optics/refraction.py`):

- **Refraction at a slope.** Light that leaves a prism of angle α through its slope ("glass first" in the table) is
  deviated by arcsin(n sin α) - α. A mask with the same slope deviates it by arcsin((n - 1) tan α). The deviation by the
  mask is 1 % too small at α = 11° and 10 % too small at 30°. If light enters the prism through its slope ("relief
  first"), the deviation of the prism is different, but that of the mask is the same.
- **Total reflection.** Beyond a slope of 41.8° no light leaves the glass, but the mask transmits light up to 63°. A
  relief whose mask is an ideal lens therefore transmits light up to its rim only if its NA is at most 0.45. The mask
  has no such limit.
- **Fresnel reflection.** A surface reflects 4 % of the light at normal incidence, 10 % at 36° and 25 % at 40°. PSFs of
  `optics` do not include this loss.
- **Thickness.** Real rays bend at the surface of the glass and not in the plane of the mask. A relief whose mask is an
  ideal lens is therefore not an ideal lens itself. Its Strehl ratio falls below 0.8 at NA = 1.16 (λ/f)^¼. Its focus
  spreads along the axis by several depths of field at this NA, and by more at a higher NA.
- **Neighbouring ridges.** In a sinusoidal corrugation, total reflection begins if the depth is 0.28 of the period. If
  the depth is 0.30 of the period or more, some rays that have left the surface hit the next ridge.

The command computes the table:

    python -m validation.optics.thin_element [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

import optics
from validation.optics.refraction import (
    Corrugation,
    RealLens,
    corrugation,
    deviation_glass_first,
    deviation_relief_first,
    real_lens,
    refract,
    thin_deviation,
    transmission,
)
from validation.pages.page import Page, parser
from validation.reference import order_of_convergence

N, WAVELENGTH, FOCAL_LENGTH = 1.5, 550e-9, 240e-6
ANGLES_DEG = (1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 55.0)
APERTURES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.44)
FOCAL_LENGTHS = (60e-6, 240e-6, 960e-6)
DEPTHS = (0.05, 0.1, 0.2, 0.25, 0.3, 0.4, 0.6, 1.0)  # depth of a corrugation over its period
PRISM_RADIUS, PRISM_DISTANCE = 20e-6, 1e-3


@dataclass(frozen=True)
class Prism:
    """Deviations [rad] of a prism with one angle.

    real, reversed: of the real prism, if light leaves it or enters it through the slope.
    thin: of its mask.
    transmitted: transmitted fraction of the power.
    psf: position of the peak of optics.psf; NaN if it was not computed.
    """

    angle_deg: float
    real: float
    reversed: float
    thin: float
    transmitted: float
    psf: float


def prism(angle_deg: float, with_psf: bool = True) -> Prism:
    angle = float(np.deg2rad(angle_deg))
    thin = thin_deviation(angle, N)
    deviations = deviation_glass_first(angle, N), deviation_relief_first(angle, N), thin
    seen = psf_deviation(angle) if with_psf and thin < 0.7 else np.nan
    return Prism(angle_deg, *deviations, transmission(angle, N), seen)


def psf_deviation(angle: float) -> float:
    """Return the direction [rad] of the brightest point behind a prism.

    It is the vertex of a parabola through a cut of the PSF by optics.psf.
    """
    heights = np.tan(angle) * PRISM_RADIUS * (2 * np.arange(4) - 3)
    pupil = optics.Pupil(PRISM_RADIUS, optics.BSplineRelief(np.tile(heights, (4, 1))), n=N)
    place = PRISM_DISTANCE * float(np.tan(thin_deviation(angle, N)))
    window = {"dx": 1e-6, "shape": (1, 61), "centre": (place, 0.0)}
    result = optics.psf(pupil, [WAVELENGTH], PRISM_DISTANCE, **window, tolerance=1e-3)
    cut = result.psf[0, 0]
    top = slice(max(cut.argmax() - 5, 0), cut.argmax() + 6)
    a, b, _ = np.polyfit(result.x[top] - place, cut[top], 2)
    return float(np.arctan((place - b / (2 * a)) / PRISM_DISTANCE))


def _lens(aperture: float, focal_length: float = FOCAL_LENGTH) -> RealLens:
    return real_lens(aperture, focal_length, N, WAVELENGTH)


def limits() -> dict[str, float]:
    """Return limits of the mask: slopes with given errors of its deviation, and depths from which it omits effects."""

    def off(angle: float, by: float) -> float:
        return 1 - thin_deviation(angle, N) / deviation_glass_first(angle, N) - by

    return {
        "angle off by 1 % [deg]": float(np.rad2deg(brentq(off, 0.01, 0.7, args=(0.01,)))),
        "angle off by 10 % [deg]": float(np.rad2deg(brentq(off, 0.01, 0.7, args=(0.1,)))),
        "total reflection [deg]": float(np.rad2deg(np.arcsin(1 / N))),
        "mask evanescent [deg]": float(np.rad2deg(np.arctan(1 / (N - 1)))),
        "NA of total reflection": (N - 1) * float(np.tan(np.arcsin(1 / N))),
        **{f"NA of Strehl 0.8, f = {f * 1e6:g} µm": _aperture_of_strehl(f) for f in FOCAL_LENGTHS},
        "corrugation reflects, depth / period": float(np.tan(np.arcsin(1 / N)) / np.pi),
        "ray hits the next ridge, depth / period": _depth_that_catches(),
    }


def _aperture_of_strehl(focal_length: float) -> float:
    return float(brentq(lambda aperture: _lens(aperture, focal_length).strehl - 0.8, 0.05, 0.4, xtol=1e-3))


def _depth_that_catches() -> float:
    low, high = DEPTHS[0], DEPTHS[-1]
    while high - low > 2e-3:
        middle = (low + high) / 2
        low, high = (low, middle) if corrugation(middle, N).caught else (middle, high)
    return high


# Numbers in the page's text, with tolerances.
SAID = {
    "angle off by 1 % [deg]": (11.0, 0.5),
    "angle off by 10 % [deg]": (30.0, 0.5),
    "total reflection [deg]": (41.8, 0.1),
    "mask evanescent [deg]": (63.0, 0.5),
    "NA of total reflection": (0.45, 0.005),
    "NA of Strehl 0.8, f = 60 µm": (1.16 * (WAVELENGTH / 60e-6) ** 0.25, 0.02),
    "NA of Strehl 0.8, f = 240 µm": (0.25, 0.005),
    "NA of Strehl 0.8, f = 960 µm": (1.16 * (WAVELENGTH / 960e-6) ** 0.25, 0.02),
    "corrugation reflects, depth / period": (0.28, 0.006),
    "ray hits the next ridge, depth / period": (0.30, 0.006),
}


def broken_bounds(prisms: list[Prism], lenses: list[RealLens], found: dict[str, float]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = [
        f"{name}: {found[name]:.4g}, the page says {said:.4g}"
        for name, (said, within) in SAID.items()
        if not abs(found[name] - said) <= within
    ]
    for row in prisms:
        # Half a step of a cut 1 µm wide at 1 mm; the obliquity of the peak has the same size.
        if not np.isnan(row.psf) and not abs(row.psf - row.thin) < 5e-4:
            broken.append(
                f"{row.angle_deg:g} deg: optics.psf deviates by {row.psf:.5f} rad, its model by {row.thin:.5f}"
            )
    gentle = [row for row in prisms if row.angle_deg <= 10]
    order = order_of_convergence([row.angle_deg for row in gentle], [row.real - row.thin for row in gentle])
    if not abs(order - 3) < 0.1:
        broken.append(f"the mask's deviation has errors like angle^{order:.2f}, must be 3: it is right to first order")
    slow = [row for row in lenses if row.aperture <= 0.2]
    order = order_of_convergence([row.aperture for row in slow], [row.spread for row in slow])
    if not abs(order - 4) < 0.1:
        broken.append(f"the focus spreads like NA^{order:.2f} depths of field, must be 4: spherical aberration")
    return broken


def table(prisms: list[Prism], lenses: list[RealLens], ridges: list[Corrugation], found: dict[str, float]) -> str:
    lines = ["prism    deviation [deg]: glass first  relief first  mask      optics.psf   transmitted"]
    for row in prisms:
        angles = [np.rad2deg(value) for value in (row.real, row.reversed, row.thin, row.psf)]
        cells = ["reflected" if np.isnan(angles[0]) else f"{angles[0]:.3f}", *(f"{angle:.3f}" for angle in angles[1:])]
        cells[3] = cells[3].replace("nan", "-")
        name = f"{row.angle_deg:g} deg"
        lines.append(f"{name:<26}{cells[0]:<13}{cells[1]:<14}{cells[2]:<10}{cells[3]:<13}{row.transmitted:.3f}")
    lines.append(f"\nlens of f = {FOCAL_LENGTH * 1e6:g} µm whose mask is ideal (Strehl 1 at every NA)")
    lines.append("NA      height [µm]   Strehl of the real surface   spread of its focus / depth of field")
    for lens in lenses:
        lines.append(f"{lens.aperture:<8g}{lens.height * 1e6:<14.3g}{lens.strehl:<29.3f}{lens.spread:.3g}")
    lines.append("\ncorrugation, depth / period   totally reflected   hits the next ridge")
    lines += [f"{row.depth:<30g}{row.reflected:<20.1%}{row.caught:.1%}" for row in ridges]
    lines.append("\nlimits")
    lines += [f"{name:<40}{value:.3g}" for name, value in found.items()]
    return "\n".join(lines)


def draw(lenses: list[RealLens], path: Path) -> None:
    """Draw the deviation over slope, Strehl ratio over NA, and rays through a real lens."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 4.4), layout="constrained")
    bend, rays, chart = figure.subplots(1, 3, width_ratios=[1, 1.15, 1])
    angles = np.linspace(0.1, 62, 400)
    for deviation, color, name in (
        (thin_deviation, "#D55E00", "phase mask (rhabdom)"),
        (deviation_glass_first, "#0072B2", "real prism, glass first"),
        (deviation_relief_first, "#56B4E9", "real prism, relief first"),
    ):
        bend.plot(angles, [np.rad2deg(deviation(np.deg2rad(a), N)) for a in angles], color=color, label=name)
    bend.axvline(np.rad2deg(np.arcsin(1 / N)), color="#B00020", lw=0.8, ls="--")
    bend.text(42.5, 3, "total\nreflection", color="#B00020", fontsize=8.5)
    bend.set(
        xlabel="slope of the relief [deg]", ylabel="deviation [deg]", title="Slopes: right to first order", ylim=(0, 60)
    )
    bend.legend(frameon=False, fontsize=8.5, loc="upper left")
    _rays(rays)
    apertures = [lens.aperture for lens in lenses]
    chart.plot(apertures, [1.0] * len(lenses), "-", color="#D55E00", label="phase mask (rhabdom)")
    chart.plot(apertures, [lens.strehl for lens in lenses], "o-", color="#0072B2", label="real surface, best focus")
    chart.axhline(0.8, color="#009E73", lw=0.8, ls="--")
    chart.axvline((N - 1) * np.tan(np.arcsin(1 / N)), color="#B00020", lw=0.8, ls="--")
    chart.text(0.44, 0.5, "rim reflects totally", rotation=90, color="#B00020", fontsize=8.5, ha="right", va="center")
    chart.set(xlabel="numerical aperture", ylabel="Strehl ratio", title="Lenses: f = 240 µm, n = 1.5", ylim=(0, 1.08))
    chart.legend(frameon=False, fontsize=8.5, loc="lower left")
    figure.savefig(path, dpi=110)


def _rays(axes: Any) -> None:
    """Draw rays through the relief whose mask is an ideal lens of NA 0.4."""
    f, aperture = FOCAL_LENGTH * 1e6, 0.4
    radius = f * aperture / np.sqrt(1 - aperture**2)
    x = np.linspace(-radius, radius, 201)
    h = (np.hypot(radius, f) - np.hypot(x, f)) / (N - 1)
    axes.fill_between(x, 0, h, color="#CFE3F2", lw=0)
    for start in np.linspace(-0.98, 0.98, 15) * radius:
        height = np.interp(start, x, h)
        tx, tz = refract(np.array(-start / np.hypot(start, f) / (N - 1)), N)
        length = (1.35 * f - height) / tz
        axes.plot([start, start, start + length * tx], [-25, height, height + length * tz], color="#0072B2", lw=0.7)
        axes.plot([start, -0.35 * start], [0, 1.35 * f], color="#D55E00", lw=0.5, alpha=0.7)
    axes.plot(0, f, "o", color="#D55E00", ms=5)
    axes.set(xlim=(-1.1 * radius, 1.1 * radius), ylim=(-25, 1.35 * f), xlabel="x [µm]", ylabel="z [µm]")
    axes.set_title("NA 0.4: the mask's rays (orange) meet,\nthose of its relief (blue) do not", fontsize=10)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    prisms, lenses = [prism(angle) for angle in ANGLES_DEG], [_lens(aperture) for aperture in APERTURES]
    ridges, found = [corrugation(depth, N) for depth in DEPTHS], limits()
    page = Page("thin_element", __doc__, table(prisms, lenses, ridges, found), broken_bounds(prisms, lenses, found))
    return page.publish(options, lambda path: draw(lenses, path))


if __name__ == "__main__":
    sys.exit(main())
