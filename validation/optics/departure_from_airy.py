"""Difference between the exact PSF of an ideal lens and the Airy pattern, over the numerical aperture

The table shows the exact first Rayleigh-Sommerfeld integral, by quadrature, minus the Airy pattern. The Fresnel number
is 100 throughout, so only the angle changes. The difference must be O(NA²) = O((R/f)²), for both definitions of Airy's
variable at large angles (tan: v = kRr/f; sin: v = kr NA). `optics.psf` uses the same lenses and must agree with the
exact integral.

    python -m validation.optics.departure_from_airy [--out DIR]

The script prints the table, draws the figure, and exits with 1 if a bound does not hold.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import optics
from validation import reference

WAVELENGTH = 550e-9
FRESNEL_NUMBER = 100.0  # so large that its contribution to the difference, below 1/N², is negligible
APERTURES = (0.01, 0.02, 0.04, 0.08, 0.12, 0.17, 0.24, 0.35, 0.5, 0.6, 0.7)
RINGS = 5
TOLERANCE = 1e-5
# Up to here (f/2.1) the leading order should dominate; beyond, the next one may contribute.
LEADING_ORDER = 0.24


@dataclass(frozen=True)
class Row:
    """Results for one lens.

    Misfits and errors are relative L2 differences of the intensity over the first five rings, weighted by area.
    """

    aperture: float
    radius: float
    focal_length: float
    tangent_misfit: float  # Airy with v = kRr/f
    sine_misfit: float  # Airy with v = kr NA, same power
    peak_ratio: float  # exact peak over Airy's
    error: float  # error of optics.psf
    method: str


def measure(aperture: float) -> Row:
    """Return results for the ideal lens of this NA: R/f = tan θ and R²/(λf) determine both lengths."""
    tangent = aperture / np.sqrt(1 - aperture**2)
    focal_length = FRESNEL_NUMBER * WAVELENGTH / tangent**2
    radius = tangent * focal_length
    edge = reference.AIRY_ZEROS[RINGS - 1] * WAVELENGTH / (2 * np.pi * tangent)
    r = np.linspace(0, edge, 400)
    exact = np.abs(reference.ideal_lens_field(r, WAVELENGTH, radius, focal_length)) ** 2 / (np.pi * radius**2)
    tangent_airy = reference.airy_psf(r, WAVELENGTH, radius, focal_length)
    sine_airy = reference.airy_psf(r, WAVELENGTH, aperture, 1.0)
    pupil = optics.Pupil(radius, thin_lens_focal_length=focal_length)
    window = {"dx": edge / 40, "shape": (81, 81), "tolerance": TOLERANCE, "dtype": "float64"}
    result = optics.psf(pupil, [WAVELENGTH], focal_length, **window)
    distance = np.hypot(result.x[None, :], result.y[:, None])
    profile = reference.ideal_lens_profile(float(distance.max()), WAVELENGTH, radius, focal_length)
    return Row(
        aperture,
        radius,
        focal_length,
        reference.relative_l2(tangent_airy, exact, r),
        reference.relative_l2(sine_airy, exact, r),
        float(exact[0] / tangent_airy[0]),
        reference.relative_l2(result.psf[0], np.abs(profile(distance)) ** 2 / pupil.area),
        result.plan.method,
    )


def orders(rows: list[Row]) -> tuple[float, float, float]:
    """Return the powers of NA with which both misfits and the loss of the peak grow, for lenses of small aperture."""
    small = [row for row in rows if row.aperture <= LEADING_ORDER]
    apertures = [row.aperture for row in small]
    return (
        reference.order_of_convergence(apertures, [row.tangent_misfit for row in small]),
        reference.order_of_convergence(apertures, [row.sine_misfit for row in small]),
        reference.order_of_convergence(apertures, [1 - row.peak_ratio for row in small]),
    )


def broken_bounds(rows: list[Row]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    found = [
        f"NA {row.aperture:g}: optics.psf has an error of {row.error:.1g}, tolerance {TOLERANCE:g}"
        for row in rows
        if not row.error <= TOLERANCE
    ]
    for name, order in zip(("Airy (tan)", "Airy (sin)", "Airy's peak"), orders(rows), strict=True):
        if not abs(order - 2) < 0.1:
            found.append(f"{name} departs like NA^{order:.2f}, must be NA^2")
    for row in rows:
        # Peak of a converging wave, |1 - z/L - ikz ln(L/z)|², over Airy's (kR²/2z)².
        peak = abs(reference.converging_wave_at_focus(row.radius, row.focal_length, WAVELENGTH)) ** 2
        paraxial = (np.pi * row.radius**2 / (WAVELENGTH * row.focal_length)) ** 2
        if not abs(row.peak_ratio / (peak / paraxial) - 1) < 1e-9:
            found.append(
                f"NA {row.aperture:g}: quadrature's peak {row.peak_ratio:.9f}, closed form {peak / paraxial:.9f}"
            )
    return found


def table(rows: list[Row]) -> str:
    lines = ["NA     f/#    f [mm]    Airy (tan)  Airy (sin)  peak/Airy  optics.psf  method"]
    for row in rows:
        lines.append(
            f"{row.aperture:<6g} {row.focal_length / (2 * row.radius):<6.3g} {row.focal_length * 1e3:<9.3g} "
            f"{row.tangent_misfit:<11.2e} {row.sine_misfit:<11.2e} {row.peak_ratio:<10.5f} "
            f"{row.error:<11.1e} {row.method}"
        )
    return "\n".join(lines)


def draw(rows: list[Row], path: Path) -> None:
    """Draw misfits over NA, and cuts through the PSF at three apertures."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 5), layout="constrained")
    chart, cuts = figure.subplots(1, 2)
    aperture = np.array([row.aperture for row in rows])
    factor = rows[0].tangent_misfit / aperture[0] ** 2
    chart.loglog(aperture, [row.tangent_misfit for row in rows], "o-", color="#D55E00", label="Airy, v = kRr/f")
    chart.loglog(aperture, [row.sine_misfit for row in rows], "s-", color="#E69F00", label="Airy, v = kr NA")
    chart.loglog(aperture, [1 - row.peak_ratio for row in rows], "^-", color="#999999", label="Airy's peak")
    chart.loglog(aperture, factor * aperture**2, ":", color="black", lw=1, label=f"{factor:.2f} NA²")
    chart.loglog(aperture, [row.error for row in rows], "o-", color="#0072B2", label="optics.psf")
    chart.axhline(TOLERANCE, color="#009E73", lw=1, ls="--", label="tolerance")
    chart.set(xlabel="numerical aperture", ylabel="relative L2 to the exact integral, five rings")
    chart.set(title="The Airy pattern's error grows like NA²")
    chart.minorticks_off()
    ticks = aperture[[0, 1, 2, 3, 5, 7, 10]]
    chart.set_xticks(ticks, [f"{na:g}" for na in ticks])
    chart.legend(frameon=False, fontsize=8, loc="center left", ncols=2, bbox_to_anchor=(0.02, 0.27))
    v = np.linspace(0, reference.AIRY_ZEROS[2], 400)
    cuts.semilogy(v, reference.airy_psf(v, 2 * np.pi, 1.0, 1.0) * 4 * np.pi, color="black", lw=1, ls="--", label="Airy")
    for row, color in zip((rows[6], rows[8], rows[10]), ("#56B4E9", "#0072B2", "#CC79A7"), strict=True):
        scale = 2 * np.pi / WAVELENGTH * row.radius / row.focal_length
        exact = np.abs(reference.ideal_lens_field(v / scale, WAVELENGTH, row.radius, row.focal_length)) ** 2
        cuts.semilogy(v, exact / (scale * row.radius / 2) ** 2, color=color, label=f"NA {row.aperture:g}")
    cuts.set(xlabel="v = kRr/f", ylabel="intensity over Airy's peak", ylim=(1e-5, 1.5), title="Exact: lower and wider")
    cuts.legend(frameon=False, fontsize=8)
    figure.suptitle(f"Exact PSF of an ideal lens and Airy's pattern, Fresnel number {FRESNEL_NUMBER:g}, 550 nm")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("validation/figures"), help="directory for the figure")
    out = parser.parse_args(arguments).out
    rows = [measure(aperture) for aperture in APERTURES]
    print(table(rows))
    tangent, sine, peak = orders(rows)
    print(f"orders up to NA {LEADING_ORDER:g}: Airy (tan) {tangent:.3f}, Airy (sin) {sine:.3f}, peak {peak:.3f}")
    path = out / "departure_from_airy.png"
    draw(rows, path)
    print(f"figure: {path}")
    problems = broken_bounds(rows)
    print("\n".join(problems) if problems else "all bounds hold")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
