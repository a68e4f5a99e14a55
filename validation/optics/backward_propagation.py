"""Backward propagation: decayed waves cannot be recovered

How far back can a field be propagated? With the textbook's angular spectrum, float32 has lost all digits after one and
a half wavelengths and float64 after two. `optics.propagate` recovers a Gaussian spot of w = 2 λ with an error of
6.1e-11 after one wavelength and of 1.1e-07 after 40.

**Method.** Behind a plane, waves with a period below the wavelength (spatial frequency f > 1/λ) decay like exp(-2πz
√(f² - 1/λ²)). In backward propagation, the textbook's angular spectrum amplifies these waves by the same factor. It
also amplifies the rounding errors of the samples. A wave of f = 2.8/λ grows by 7 decades per wavelength of distance.
Samples with a pitch of λ/4 represent such a wave along their diagonal. At larger distances the numbers overflow.

With a negative distance, `optics.propagate` only reverses phases. It omits waves beyond f = 1/λ (evanescent waves), and
`result.evanescent_power` reports their fraction of the input's power. Waves that have decayed cannot be recovered. The
recovered field therefore lacks the evanescent part of the original, and its error equals the square root of the
evanescent fraction. Forward propagation also reports the evanescent fraction, so the error of the recovered field is
known in advance.

**Tables.** Both tables use Gaussian spots exp(-r²/w²). The exact field of such a spot at the distance z is summed from
its closed-form spectrum. In the first table w is 2 λ. This spot has almost no evanescent part, so the table shows only
the error of the method. In the second table z is λ/2 and w falls from 1 λ to 0.2 λ. The spot of w = 0.2 λ is 45 %
evanescent.

**Limits.** Two more kinds of light cannot be recovered: light that leaves the window, and light at angles so close to
90° that it would need a wider window. `propagate` includes the second kind in its predicted error, and raises an
`AccuracyError` if that error exceeds the tolerance.

    python -m validation.optics.backward_propagation [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import optics
from validation.optics.textbook_propagation import angular_spectrum
from validation.pages.page import Page, parser
from validation.reference import gaussian_evanescent_power, gaussian_field, relative_l2

WAVELENGTH = 550e-9
WAIST, PITCH, SIDE = 2.0, 0.25, 256  # left chart [wavelengths]
DISTANCES = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 40.0)
WAISTS = (0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0)
NEAR, WINDOW = 0.5, 32.0  # right chart: distance and width [wavelengths]
TOLERANCE, GRAZING_TOLERANCE = 1e-5, 0.3
HOPELESS = 1e3


@dataclass(frozen=True)
class Row:
    """Relative L2 errors of the field recovered from `distance` [wavelengths].

    float64, float32: by the textbook's method in these types.
    ours: by optics.propagate.
    """

    distance: float
    float64: float
    float32: float
    ours: float


@dataclass(frozen=True)
class Spot:
    """A Gaussian spot.

    waist: radius [wavelengths] at which the amplitude has fallen to 1/e.
    share: exact evanescent share.
    said: share reported by optics.propagate.
    error: error of the recovered field.
    """

    waist: float
    share: float
    said: float
    error: float
    predicted: float


def spot(waist: float, distance: float, dx: float, side: int) -> np.ndarray:
    """Return the exact field (side, side), carrier included; all lengths in wavelengths."""
    x = (np.arange(side) - side // 2) * dx
    r = np.hypot(x[None, :], x[:, None])
    if distance == 0:
        return np.exp(-((r / waist) ** 2)).astype(np.complex128)
    profile = np.linspace(0, r.max(), 3000)
    field = gaussian_field(profile * WAVELENGTH, WAVELENGTH, waist * WAVELENGTH, distance * WAVELENGTH)
    return CubicSpline(profile, field)(r) * np.exp(2j * np.pi * distance)


def bring_back(distance: float) -> Row:
    dx, z = PITCH * WAVELENGTH, distance * WAVELENGTH
    original, u = spot(WAIST, 0.0, PITCH, SIDE), spot(WAIST, distance, PITCH, SIDE)
    naive = []
    with np.errstate(over="ignore", invalid="ignore"):
        for dtype in (np.complex128, np.complex64):
            back = angular_spectrum(u.astype(dtype), dx, WAVELENGTH, -z, dtype).astype(np.complex128)
            error = relative_l2(back, original)
            naive.append(error if np.isfinite(error) else np.inf)
    ours = optics.propagate(u, dx=dx, wavelength=WAVELENGTH, distance=-z, tolerance=TOLERANCE, dtype="float64")
    return Row(distance, naive[0], naive[1], relative_l2(ours.u, original))


def recover(waist: float) -> Spot:
    pitch = min(waist / 3.2, 0.25)
    side, dx = round(WINDOW / pitch), pitch * WAVELENGTH
    original = spot(waist, 0.0, pitch, side)
    asked = {"dx": dx, "wavelength": WAVELENGTH, "tolerance": GRAZING_TOLERANCE, "dtype": "float64"}
    forward = optics.propagate(original, distance=NEAR * WAVELENGTH, **asked)
    back = optics.propagate(spot(waist, NEAR, pitch, side), distance=-NEAR * WAVELENGTH, **asked)
    share = gaussian_evanescent_power(WAVELENGTH, waist * WAVELENGTH)
    return Spot(waist, share, forward.evanescent_power, relative_l2(back.u, original), back.plan.predicted_error)


def broken_bounds(rows: list[Row], spots: list[Spot]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for row in rows:
        name = f"{row.distance:g} wavelengths"
        if not row.ours <= TOLERANCE:
            broken.append(f"{name}: optics.propagate recovers the field with an error of {row.ours:.1g}")
        if row.distance >= 3 and not min(row.float64, row.float32) > HOPELESS:
            broken.append(f"{name}: the textbook's error is only {row.float64:.1g}, but must be large")
    if not np.isinf(rows[-1].float64):
        broken.append(f"{rows[-1].distance:g} wavelengths: float64 should overflow")
    for found in spots:
        name = f"waist {found.waist:g} wavelengths"
        # The grid of frequencies approximates the circle f = 1/λ to 5 % of the share.
        if not abs(found.said / found.share - 1) < 0.05:
            broken.append(f"{name}: evanescent share {found.said:.3g}, must be {found.share:.3g}")
        if not abs(found.error / np.sqrt(found.share) - 1) < 0.05:
            broken.append(f"{name}: recovered with an error of {found.error:.3g}, must be {np.sqrt(found.share):.3g}")
    return broken


def table(rows: list[Row], spots: list[Spot]) -> str:
    lines = [
        "distance / λ   textbook, float64   textbook, float32   optics.propagate    (error of the recovered field)"
    ]
    for row in rows:
        lines.append(f"{row.distance:<14g} {_shown(row.float64):<19} {_shown(row.float32):<19} {row.ours:.1e}")
    lines.append("\nw / λ   evanescent share   reported share      √share    error of the recovered field")
    for found in spots:
        lines.append(
            f"{found.waist:<7g} {found.share:<18.3g} {found.said:<19.3g} {np.sqrt(found.share):<9.2e} {found.error:.2e}"
        )
    return "\n".join(lines)


def _shown(error: float) -> str:
    return "overflow" if np.isinf(error) else f"{error:.1e}"


def draw(rows: list[Row], spots: list[Spot], path: Path) -> None:
    """Draw the error over distance, and lost light over the evanescent share."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    z, ceiling = np.array([row.distance for row in rows]), 1e20
    for errors, color, name in (
        ([row.float64 for row in rows], "#555555", "textbook, float64"),
        ([row.float32 for row in rows], "#AAAAAA", "textbook, float32"),
        ([row.ours for row in rows], "#D55E00", "optics.propagate"),
    ):
        left.loglog(z, np.minimum(errors, ceiling * 10), "o-", color=color, label=name)
    left.axhline(1, color="#B00020", lw=0.8, ls="--")
    left.text(0.25, 3, "all digits lost", color="#B00020", fontsize=8.5, ha="center")
    left.set(
        ylim=(1e-14, ceiling), xlabel="distance back / wavelength", ylabel="relative L2 error of the recovered field"
    )
    left.set(title="The textbook's error explodes after a wavelength")
    left.legend(frameon=False, fontsize=8.5, loc="center right")
    share = np.array([found.share for found in spots])
    right.loglog(share, np.sqrt(share), color="black", lw=1, label="√share: the part that decayed")
    right.loglog(
        share, [found.error for found in spots], "o", color="#D55E00", label="optics.propagate, recovered field"
    )
    right.loglog(share, [found.said for found in spots], "s", color="#0072B2", ms=5, label="reported evanescent_power")
    right.loglog(share, share, ":", color="black", lw=1, label="exact share")
    for found in spots[6::2]:
        label = f"w = {found.waist:g} λ"
        right.annotate(label, (found.share, found.error), (4, -14), textcoords="offset points", fontsize=8)
    right.set(
        xlabel="evanescent share of the spot's power", ylabel="relative L2 error, share", title="Lost light is reported"
    )
    right.legend(frameon=False, fontsize=8.5, loc="lower right")
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    rows, spots = [bring_back(z) for z in DISTANCES], [recover(waist) for waist in WAISTS]
    page = Page("backward_propagation", __doc__, table(rows, spots), broken_bounds(rows, spots))
    return page.publish(options, lambda path: draw(rows, spots, path))


if __name__ == "__main__":
    sys.exit(main())
