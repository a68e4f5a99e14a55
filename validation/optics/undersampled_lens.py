"""Undersampled lens: a speckle pattern that resembles a PSF

What does the PSF of a lens look like if the pupil is sampled too coarsely? It is a regular pattern of bright spots with
a bright centre. At f/2 with 51 samples, the first dark ring of the Airy pattern encloses 6.2e-06 of the light instead
of 0.8278. This fraction becomes correct only when the pitch (the distance between samples) is below λ / (2 NA).

**Method.** The simulation of eyes in [Tiwary, Young et al. (2025)](../results/paper.md) samples a pupil of a few mm
with 51 or 101 points per side. Here the lenses are f/2, f/8 and f/13.5, with a focal length of 4 mm. The wavelength is
550 nm, and the grid is 2 mm wide. At a pitch of λ / (2 NA), the phase at the rim of a lens changes by half a wave
between neighbouring samples. With 51 samples, the pitch exceeds λ / (2 NA) by factors of 35, 9 and 5, respectively.
Because of aliasing, such samples represent an array of many small lenses instead of one, and most of the light misses
the Airy disk. The image does not show the mistake: it is finite and positive, and its power is conserved.

In `optics.psf`, the user does not choose the sampling of the pupil: the function derives it from the slope of the
phase, or uses a method that needs no grid. Its PSFs of the same pupils are accurate to the requested tolerance.

**Table.** The table shows the energy inside the first dark ring of the Airy pattern, as a fraction of the light through
the pupil. "pitch / needed" is the pitch divided by λ / (2 NA). "textbook" is the angular spectrum method on the grid of
the pupil samples, with band-limited interpolation of the field. "exact" is the Rayleigh-Sommerfeld integral. In the
rows with f = 0.4 mm, the f/2 lens and its grid are both ten times smaller, and the grid has 16 to 512 samples.

    python -m validation.optics.undersampled_lens [--out DIR] [--docs DIR]
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
from validation.reference import AIRY_ZEROS, ideal_lens_profile

WAVELENGTH = 550e-9
GRID, FOCAL_LENGTH = 2e-3, 4e-3
F_NUMBERS = (2.0, 8.0, 13.5)
PUBLISHED = (51, 101)
# The same f/2 ten times smaller, so that enough samples fit into memory.
SMALL = 0.1
SWEEP = (16, 24, 32, 48, 64, 90, 110, 128, 150, 176, 200, 256, 352, 512)
TOLERANCE = 1e-4
RINGS_SHOWN = 5.0  # [µm] half the width of the image of the true PSF


@dataclass(frozen=True)
class Lens:
    f_number: float
    focal_length: float
    grid: float

    @property
    def radius(self) -> float:
        return self.focal_length / (2 * self.f_number)

    @property
    def needed_pitch(self) -> float:
        """Largest pitch that resolves the lens, λ / (2 NA)."""
        return WAVELENGTH * np.hypot(self.radius, self.focal_length) / (2 * self.radius)

    @property
    def dark_ring(self) -> float:
        return AIRY_ZEROS[0] * WAVELENGTH * self.focal_length / (2 * np.pi * self.radius)

    def undersampling(self, n: int) -> float:
        return self.grid / n / self.needed_pitch


@dataclass(frozen=True)
class Row:
    """Energy inside Airy's first dark ring: exact, by optics.psf, and by the textbook on `samples`."""

    lens: Lens
    exact: float
    ours: float
    plan: optics.Plan
    samples: tuple[int, ...]
    textbook: tuple[float, ...]


def focus(lens: Lens, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return fields in the pupil and in the focal plane by the textbook's method."""
    u = sampled_lens(n, lens.grid / n, WAVELENGTH, lens.radius, lens.focal_length)
    return u, angular_spectrum(u, lens.grid / n, WAVELENGTH, lens.focal_length)


def measure(lens: Lens, samples: tuple[int, ...]) -> Row:
    found = []
    for n in samples:
        u, image = focus(lens, n)
        dx = lens.grid / n
        found.append(energy_inside(image, dx, lens.dark_ring) / (float(np.sum(np.abs(u) ** 2)) * dx**2))
    result = true_psf(lens, lens.dark_ring / 24)
    ours = float(optics.encircled_energy(result, lens.dark_ring)[0, 0])
    return Row(lens, _exact(lens), ours, result.plan, samples, tuple(found))


def true_psf(lens: Lens, dx: float, side: int = 65) -> optics.PSFResult:
    pupil = optics.Pupil(lens.radius, thin_lens_focal_length=lens.focal_length)
    return optics.psf(pupil, [WAVELENGTH], lens.focal_length, dx=dx, shape=(side, side), tolerance=TOLERANCE)


def energy_inside(u: np.ndarray, dx: float, radius: float) -> float:
    """Return ∫ |u|² over a disk about the centre, of the band-limited function through the samples.

    The quadrature is Gauss-Legendre's in radius and the trapezoid rule in angle. The points lie between the samples, so
    the Fourier sum is evaluated directly.
    """
    n = len(u)
    frequency = np.fft.fftshift(np.fft.fftfreq(n, dx))
    spectrum = np.fft.fftshift(np.fft.fft2(np.fft.ifftshift(u))) / n**2
    nodes, weights = np.polynomial.legendre.leggauss(12)
    r, angle = radius * (nodes + 1) / 2, np.arange(24) * 2 * np.pi / 24
    x, y = (np.multiply.outer(r, wave(angle)).ravel() for wave in (np.cos, np.sin))
    weight = np.repeat(weights * radius / 2 * r, 24) * 2 * np.pi / 24
    along_y = np.exp(2j * np.pi * np.outer(y, frequency)) @ spectrum
    values = np.sum(np.exp(2j * np.pi * np.outer(x, frequency)) * along_y, axis=1)
    return float(np.sum(weight * np.abs(values) ** 2))


def _exact(lens: Lens) -> float:
    profile = ideal_lens_profile(lens.dark_ring, WAVELENGTH, lens.radius, lens.focal_length)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    r = lens.dark_ring * (nodes + 1) / 2
    return float(np.sum(weights * lens.dark_ring * np.pi * r * np.abs(profile(r)) ** 2) / (np.pi * lens.radius**2))


def broken_bounds(published: list[Row], sweep: Row) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for row in [*published, sweep]:
        name = f"f/{row.lens.f_number:g}, f = {row.lens.focal_length:g} m"
        # The error of the sum over the window's samples is (dx / ring width)², 2e-4 here.
        if not abs(row.ours - row.exact) < 2e-4:
            broken.append(f"{name}: optics.psf has {row.ours:.5f} inside, exact is {row.exact:.5f}")
        for n, share in zip(row.samples, row.textbook, strict=True):
            under = row.lens.undersampling(n)
            if under > 2.5 and not share < 0.15 * row.exact:
                broken.append(f"{name}: on {n} samples, {under:.1f} times too coarse, the textbook has {share:.3f}")
            # The error of a hard edge on a Cartesian grid is half a percent of the energy.
            if under <= 1 and not abs(share - row.exact) < 5e-3:
                broken.append(f"{name}: on {n} samples, fine enough, the textbook has {share:.3f}")
    return broken


def table(published: list[Row], sweep: Row) -> str:
    lines = ["energy inside Airy's first dark ring / light through the pupil"]
    lines.append("f/#    f [mm]  samples  pitch / needed  textbook  exact   optics.psf  method")
    for row in [*published, sweep]:
        for n, share in zip(row.samples, row.textbook, strict=True):
            lines.append(
                f"{row.lens.f_number:<6g} {row.lens.focal_length * 1e3:<7g} {n:<8d} {row.lens.undersampling(n):<15.2f} "
                f"{share:<9.1e} {row.exact:<7.4f} {row.ours:<11.4f} {row.plan.method}"
            )
    return "\n".join(lines)


def draw(published: list[Row], sweep: Row, path: Path) -> None:
    """Draw the undersampled image, true PSF, and energy over the pitch."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.5, 3.6), layout="constrained")
    coarse, fine, true, chart = figure.subplots(1, 4, width_ratios=[1, 1, 1, 1.35])
    lens = published[0].lens
    for axes, shown, n in ((coarse, lens, PUBLISHED[0]), (fine, published[1].lens, PUBLISHED[1])):
        _picture(axes, np.abs(focus(shown, n)[1]) ** 2, GRID * 1e3 / 2, "mm")
        times = f"{shown.undersampling(n):.2g} times too coarse"
        axes.set_title(f"textbook, f/{shown.f_number:g} on {n} x {n} samples\n{times}", fontsize=10)
    dx = 2e-6 * RINGS_SHOWN / 128
    picture = _picture(true, true_psf(lens, dx, 129).psf[0], RINGS_SHOWN, "µm")
    true.set_title("optics.psf, the same f/2 lens\n200 times enlarged", fontsize=10)
    figure.colorbar(picture, ax=true, label="log₁₀ intensity / peak", shrink=0.72)
    _shares(chart, published, sweep)
    figure.savefig(path, dpi=110)


def _picture(axes: Any, image: np.ndarray, half: float, unit: str) -> Any:
    shown = np.log10(np.maximum(image / image.max(), 1e-6))
    axes.set_xlabel(f"x [{unit}]")
    return axes.imshow(shown, cmap="magma", vmin=-4, vmax=0, extent=(-half, half, -half, half), origin="lower")


def _shares(axes: Any, published: list[Row], sweep: Row) -> None:
    under = [sweep.lens.undersampling(n) for n in sweep.samples]
    axes.loglog(under, sweep.textbook, "o-", color="#999999", ms=4, label="textbook, f/2, f = 0.4 mm")
    for row, marker in zip(published, "sD^", strict=True):
        at = [row.lens.undersampling(n) for n in row.samples]
        label = f"textbook, f/{row.lens.f_number:g}, f = 4 mm"
        axes.loglog(at, row.textbook, marker, color="#0072B2", ms=6, label=label)
    axes.axhline(sweep.exact, color="black", lw=1, ls="--", label="exact")
    axes.loglog([row.lens.undersampling(51) for row in published], [row.ours for row in published], "o", ms=7,
                color="#D55E00", label="optics.psf, the same lenses")  # fmt: skip
    axes.axvline(1, color="#009E73", lw=1)
    axes.text(0.93, 2e-5, "pitch λ / (2 NA)", rotation=90, ha="right", color="#009E73", fontsize=8.5)
    axes.set(
        xlabel="pitch / (λ / 2 NA)", ylabel="energy inside Airy's first dark ring", title="Correct below 1, wrong above"
    )
    axes.legend(frameon=False, fontsize=7, loc="lower left", bbox_to_anchor=(0.24, -0.02))


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    published = [measure(Lens(f_number, FOCAL_LENGTH, GRID), PUBLISHED) for f_number in F_NUMBERS]
    sweep = measure(Lens(2.0, SMALL * FOCAL_LENGTH, SMALL * GRID), SWEEP)
    page = Page("undersampled_lens", __doc__, table(published, sweep), broken_bounds(published, sweep))
    return page.publish(options, lambda path: draw(published, sweep, path))


if __name__ == "__main__":
    sys.exit(main())
