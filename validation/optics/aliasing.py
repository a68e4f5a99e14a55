"""Aliasing and wrap-around: where the plain angular spectrum stops converging

At which distance does the textbook's angular spectrum stop converging with the number of samples N? Its error falls
with N only while the distance is below the critical distance z = N dx²/λ. On a grid of fixed width, more samples have a
smaller pitch dx, so the critical distance becomes shorter as N grows. At Fresnel number 0.1, far beyond the critical
distance, the error is 1.1e+00 both with N = 256 and with N = 1024. `optics.propagate` has errors of 2.2e-03 and 2.6e-04
with the same samples.

**Method.** A circular aperture of R = 50 µm at 550 nm is sampled on N x N points over a period of 4R. The intensity
within |x|, |y| <= R is compared with the direct Rayleigh-Sommerfeld sum. The textbook's angular spectrum
(`validation/optics/textbook_propagation.py`) multiplies the spectrum of the samples by the transfer function. The
computed field is periodic, and its period is the width of the grid of samples. Beyond the critical distance, light at
the largest angle that the samples represent leaves the grid at one edge and re-enters it at the opposite edge. More
samples then do not reduce the error, and at larger distances it reaches 100 %. In terms of frequencies, the phase of
the transfer function changes by more than half a wave between neighbouring samples.

`optics.propagate` receives the same samples of the aperture, which have a hard edge. It chooses its own period, and
removes light that would land far outside the window. Its error falls with N at any distance. The remaining error comes
from the pixelated edge of the aperture. In `optics.psf` the user does not choose N: the function low-pass filters the
edge and plans its own sampling.

**First table.** Each row is one Fresnel number R²/λz. N* is the number of samples for which this distance is the
critical one. The last columns show the error of `optics.psf`, its predicted error and the method that it chose.

**Second table.** A Gaussian beam spreads to the radius w (1/e² of intensity) and is propagated with shorter and shorter
periods P. In the textbook's method the beam overlaps its own repetition. The amplitude of the beam at the edge of the
period is about exp(-(P/2w)²). The errors of `optics.propagate` with the same samples do not depend on P: they come only
from rounding and from the tolerance.

**Limits.** The first table covers one aperture at one wavelength, at Fresnel numbers from 0.1 to 100.

    python -m validation.optics.aliasing [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

import optics
from validation.optics.textbook_propagation import angular_spectrum, sampled_lens
from validation.pages.page import Page, parser
from validation.reference import gaussian_beam, gaussian_field, order_of_convergence, relative_l2

RADIUS, WAVELENGTH = 50e-6, 550e-9
PERIOD = 4 * RADIUS
FRESNEL_NUMBERS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
SAMPLES = (64, 128, 192, 256, 384, 512, 768, 1024)  # all contain the points of the window
WINDOW: dict[str, Any] = {"dx": RADIUS / 16, "shape": (33, 33)}
TOLERANCE, SAMPLED_TOLERANCE = 1e-3, 1e-2
WAIST, SPREAD = 2e-6, 8.0  # of the beam [m], and w(z) / w0
PERIODS = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0)  # in beam radii w(z)


@dataclass(frozen=True)
class Row:
    """Results at one Fresnel number.

    textbook, propagate: errors over SAMPLES, NaN if refused.
    plan, error: plan and error of optics.psf.
    """

    fresnel_number: float
    textbook: np.ndarray
    propagate: np.ndarray
    plan: optics.Plan
    error: float

    @property
    def critical_samples(self) -> float:
        """N for which this distance is critical: N dx² / λ = P² / (N λ)."""
        return self.fresnel_number * (PERIOD / RADIUS) ** 2


def measure(fresnel_number: float, samples: tuple[int, ...] = SAMPLES) -> Row:
    distance = RADIUS**2 / WAVELENGTH / fresnel_number
    pupil = optics.Pupil(RADIUS)
    reference = {"tolerance": 1e-7, "method": "rayleigh_sommerfeld", "dtype": "float64"}
    exact = optics.psf(pupil, [WAVELENGTH], distance, **WINDOW, **reference).psf[0] * pupil.area
    ours = optics.psf(pupil, [WAVELENGTH], distance, **WINDOW, tolerance=TOLERANCE)
    errors = np.array([_sampled(n, distance, exact) for n in samples])
    return Row(fresnel_number, errors[:, 0], errors[:, 1], ours.plan, relative_l2(ours.psf[0] * pupil.area, exact))


def _sampled(n: int, distance: float, exact: np.ndarray) -> tuple[float, float]:
    """Return the errors of the textbook's method and of optics.propagate."""
    dx, middle, stride = PERIOD / n, n // 2, n // SAMPLES[0]
    u = sampled_lens(n, dx, WAVELENGTH, RADIUS, np.inf)
    points = slice(middle - 16 * stride, middle + 16 * stride + 1, stride)
    textbook = np.abs(angular_spectrum(u, dx, WAVELENGTH, distance)[points, points]) ** 2
    held = slice(middle - n // 4 - 1, middle + n // 4 + 2)  # the aperture
    asked = {"out_dx": WINDOW["dx"], "out_shape": WINDOW["shape"], "tolerance": SAMPLED_TOLERANCE}
    try:
        out = optics.propagate(u[held, held], dx=dx, wavelength=WAVELENGTH, distance=distance, **asked)
        propagated = relative_l2(np.abs(out.u) ** 2, exact)
    except optics.AccuracyError:
        propagated = np.nan
    return relative_l2(textbook, exact), propagated


def wrap_around(period: float) -> tuple[float, float]:
    """Return the errors of the intensity of a beam after it has spread, by the textbook's method and optics.propagate.

    period: period of the samples, in radii of the beam.
    """
    rayleigh = np.pi * WAIST**2 / WAVELENGTH
    distance, width = rayleigh * np.sqrt(SPREAD**2 - 1), SPREAD * WAIST
    n, dx = round(period * width / (WAIST / 4)), WAIST / 4
    x = (np.arange(n) - n // 2) * dx
    r = np.hypot(x[None, :], x[:, None])
    u = gaussian_beam(r, WAVELENGTH, WAIST, 0.0)
    profile = np.linspace(0, r.max(), 600)
    exact = CubicSpline(profile, np.abs(gaussian_field(profile, WAVELENGTH, WAIST, distance)) ** 2)(r)
    ours = optics.propagate(u, dx=dx, wavelength=WAVELENGTH, distance=distance, tolerance=TOLERANCE).u
    naive = angular_spectrum(u, dx, WAVELENGTH, distance)
    return relative_l2(np.abs(naive) ** 2, exact), relative_l2(np.abs(ours) ** 2, exact)


def broken_bounds(rows: list[Row], wrapped: list[tuple[float, float]]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    n, broken = np.array(SAMPLES), []
    for row in rows:
        name = f"Fresnel number {row.fresnel_number:g}"
        if not row.error <= row.plan.predicted_error <= TOLERANCE:
            broken.append(f"{name}: optics.psf has the error {row.error:.1g}, predicted {row.plan.predicted_error:.1g}")
        beyond, known = n > 4 * row.critical_samples, np.isfinite(row.propagate)
        if beyond.sum() >= 3:
            # Half an order is far from N^-1; the error of wrapped light does not fall at all.
            order = -order_of_convergence(n[beyond], row.textbook[beyond])
            if not order < 0.25:
                broken.append(f"{name}: the textbook converges like N^-{order:.2f} beyond the critical distance")
        within = known & (n < row.critical_samples / 2)
        if not np.allclose(row.textbook[within], row.propagate[within], rtol=0.1):
            broken.append(f"{name}: within the critical distance both errors should be that of the pixelated edge")
        order = -order_of_convergence(n[known], row.propagate[known])
        if not order > 0.5:
            broken.append(f"{name}: optics.propagate converges like N^-{order:.2f}, must be above 0.5")
    for period, (naive, ours) in zip(PERIODS, wrapped, strict=True):
        if not ours <= TOLERANCE:
            broken.append(f"period {period:g} w: optics.propagate has an error of {ours:.1g}")
        if period <= 3 and not naive > 0.01:
            broken.append(f"period {period:g} w: the textbook has an error of {naive:.1g}, which cannot be right")
    return broken


def table(rows: list[Row], wrapped: list[tuple[float, float]]) -> str:
    lines = ["error of intensity at N = 256 and 1024 (N*: samples for which this distance is critical)"]
    lines.append("Fresnel number     N*  textbook           optics.propagate   optics.psf  predicted  method")
    coarse, fine = SAMPLES.index(256), SAMPLES.index(1024)
    for row in rows:
        ours = " ".join(
            f"{row.propagate[i]:<8.1e}" if np.isfinite(row.propagate[i]) else "refused " for i in (coarse, fine)
        )
        theirs = f"{row.textbook[coarse]:<8.1e} {row.textbook[fine]:<8.1e}"
        lines.append(
            f"{row.fresnel_number:<14g}{row.critical_samples:>7.4g}  {theirs}"
            f"  {ours}  {row.error:<11.1e} {row.plan.predicted_error:<10.1e} {row.plan.method}"
        )
    lines.append("\nperiod / beam radius   textbook   optics.propagate")
    lines += [f"{p:<22g} {naive:<10.1e} {ours:.1e}" for p, (naive, ours) in zip(PERIODS, wrapped, strict=True)]
    return "\n".join(lines)


def draw(rows: list[Row], wrapped: list[tuple[float, float]], path: Path) -> None:
    """Draw two maps with the critical distance, the planner's choice below, and the wrap-around."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.2), layout="constrained")
    layout = [["textbook", "propagate", "chart"], ["bar", "choice", "chart"]]
    axes = figure.subplot_mosaic(layout, width_ratios=[1, 1, 0.8], height_ratios=[1, 0.36])
    titles = {"textbook": "the textbook's angular spectrum", "propagate": "optics.propagate, same samples"}
    for name, title in titles.items():
        image = _map(axes[name], np.array([getattr(row, name) for row in rows]).T, [row.fresnel_number for row in rows])
        axes[name].set_title(title, fontsize=11)
        axes[name].set_xlabel("Fresnel number R²/λz (far to the left)")
    axes["textbook"].set_ylabel("samples N across the period 4R")
    axes["bar"].axis("off")
    words = "log₁₀ relative L2 error of intensity"
    figure.colorbar(image, ax=axes["bar"], label=words, location="bottom", fraction=0.5, aspect=30)
    _choices(axes["choice"], rows)
    chart = axes["chart"]
    chart.semilogy(PERIODS, [naive for naive, _ in wrapped], "o-", color="#999999", label="textbook")
    chart.semilogy(PERIODS, [ours for _, ours in wrapped], "o-", color="#D55E00", label="optics.propagate")
    chart.axhline(TOLERANCE, color="#009E73", ls="--", lw=1, label="its requested tolerance")
    chart.set(xlabel="period / beam radius", ylabel="relative L2 error of intensity", title="Period too small")
    chart.legend(frameon=False, fontsize=8.5)
    figure.savefig(path, dpi=110)


def _choices(axes: Any, rows: list[Row]) -> None:
    """Draw method and error of optics.psf below the map, one column per Fresnel number."""
    for column, row in enumerate(rows):
        words = f"{row.plan.method.replace('rayleigh_sommerfeld', 'rayleigh_s.')}\n{row.error:.0e}"
        axes.text(column, 0.5, words, rotation=90, fontsize=8.5, ha="center", va="center", color="#B04A00")
    axes.set(xlim=(-0.5, len(rows) - 0.5), ylim=(0, 1), xticks=[], yticks=[])
    axes.set_xlabel("method chosen by optics.psf, and its error", color="#B04A00")


def _map(axes: Any, errors: np.ndarray, fresnel_numbers: list[float]) -> Any:
    axes.set_facecolor("#DDDDDD")
    image = axes.imshow(np.log10(errors), origin="lower", aspect="auto", cmap="magma", vmin=-4, vmax=0)
    axes.set_xticks(range(len(fresnel_numbers)), [f"{f:g}" for f in fresnel_numbers])
    axes.set_yticks(range(len(SAMPLES)), SAMPLES)
    f = np.geomspace(fresnel_numbers[0], fresnel_numbers[-1], 400)
    column = np.interp(np.log(f), np.log(fresnel_numbers), range(len(fresnel_numbers)))
    critical = f * (PERIOD / RADIUS) ** 2
    row = np.interp(np.log(critical), np.log(SAMPLES), range(len(SAMPLES)), left=np.nan, right=np.nan)
    axes.plot(column, row, color="white", lw=2)
    axes.text(2.6, 5.2, "beyond the\ncritical\ndistance", color="white", fontsize=9.5, ha="center")
    for y, x in np.argwhere(np.isnan(errors)):
        axes.text(x, y, "re-\nfused", ha="center", va="center", fontsize=7, color="#444444")
    return image


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    rows = [measure(fresnel_number) for fresnel_number in FRESNEL_NUMBERS]
    wrapped = [wrap_around(period) for period in PERIODS]
    page = Page("aliasing", __doc__, table(rows, wrapped), broken_bounds(rows, wrapped))
    return page.publish(options, lambda path: draw(rows, wrapped, path))


if __name__ == "__main__":
    sys.exit(main())
