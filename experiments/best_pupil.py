"""The best pupil width: sharpness against light

python -m experiments.best_pupil [--compute] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
import time
from argparse import Namespace
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import optics
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.store import DATA, Origin, read_rows, write_rows
from optics.eye.summary import daylight_psf
from sim.worlds import materials

__all__ = ["Row", "best", "computed", "measures"]

Floats = NDArray[np.float64]
STRIPES = (1, 2, 4)  # width of a stripe in receptors
MEASURES = {
    "contrast": "contrast",
    **{f"stripes_{width}": f"stripes {width} receptor{'s' * (width > 1)} wide" for width in STRIPES},
    "bits": "bits",
    "image_quality": "image quality",
}
PUPILS = ("hole", "lens")
APERTURES = tuple(np.geomspace(0.04, 1.0, 29).tolist())
STORED = Path(__file__).parents[1] / DATA / "best_pupil.csv"
NOISES = (0.0003, 0.001, 0.003, 0.005, 0.01, 0.02, 0.05)
RESOLUTION, FOV_DEG = 15, 45.0
SCENE = (materials.WHITE - materials.BLACK) / 2  # standard deviation of the signal of black and white stripes
GREEN = 550e-9
ZERO = 0.25  # a minimum of the MTF below this counts as a zero; the mean over directions does not reach 0
STRENGTHS = (0.35, 0.65, 1.0)  # opacity of lines, by noise
COLORS = {"hole": "#D55E00", "lens": "#0072B2"}


@dataclass(frozen=True)
class Row:
    """Measures of an eye at one level of noise.

    pupil: "hole" (pinhole) or "lens" (ideal lens in focus)
    noise_sigma: standard deviation of a receptor's noise
    image_quality, contrast, bits: see `measures`
    stripes_1, stripes_2, stripes_4: amplitude of stripes 1, 2 and 4 receptors wide, see `stripes`
    """

    pupil: str
    relative_aperture: float
    noise_sigma: float
    image_quality: float
    contrast: float
    bits: float
    stripes_1: float
    stripes_2: float
    stripes_4: float


def eye(pupil: str, aperture: float) -> optics.Eye:
    """Return an eye of default size with a pinhole or an ideal lens in focus."""
    plain = optics.Eye(resolution=(RESOLUTION, RESOLUTION), fov_deg=FOV_DEG)
    focus = plain.sensor_distance if pupil == "lens" else None
    radius = aperture * plain.sensor_width / 2
    return optics.Eye(optics.Pupil(radius, thin_lens_focal_length=focus), resolution=plain.resolution, fov_deg=FOV_DEG)


def measures(contrasts: Floats, throughput: float, noise_sigma: float) -> tuple[float, float, float]:
    """Return image quality, contrast above the noise, and bits per receptor, from an MTF.

    contrasts: the MTF at equal steps from 0 to the Nyquist frequency

    With f in units of the Nyquist frequency, T the throughput and c the scene's contrast,

        Q = T ∫ max(MTF - σ/T, 0) df,    C = Q / T,    B = (π/2) ∫ ½ log2(1 + (c T MTF / σ)²) f df

    B is the information per receptor about a scene of equal contrast at all frequencies, with white noise of σ per
    receptor (Shannon; for eyes Snyder, Laughlin and Stavenga 1977). (π/2) f df is the ring 2π f df of frequencies in
    all directions, divided by the square [-1, 1]² of frequencies that the receptors' lattice resolves.
    """
    f = np.linspace(0, 1, contrasts.size)
    above = float(np.trapezoid(np.maximum(contrasts - noise_sigma / throughput, 0), f))
    ratio = SCENE * throughput * contrasts / noise_sigma
    bits = math.pi / 2 * float(np.trapezoid(0.5 * np.log2(1 + ratio**2) * f, f))
    return throughput * above, above, bits


def stripes(contrasts: Floats, throughput: float, width: int) -> float:
    """Return the throughput times the MTF for stripes that are `width` receptors wide.

    The frequency of these stripes is the Nyquist frequency divided by the width. The result is the amplitude of the
    stripes in the signals, independent of noise. It is 0 beyond the first zero of the MTF, where stripes are reversed
    or invisible.
    """
    falls, rises = np.diff(contrasts)[:-1] < 0, np.diff(contrasts)[1:] >= 0
    zeros = np.flatnonzero(falls & rises & (contrasts[1:-1] < ZERO)) + 1
    place = (contrasts.size - 1) // width
    return 0.0 if zeros.size and zeros[0] < place else throughput * float(contrasts[place])


def contrast_of(seen: optics.Eye) -> Floats:
    """Return the MTF in white daylight at 257 frequencies up to the retina's Nyquist frequency."""
    white = daylight_psf(seen, seen.psf())
    frequencies = np.linspace(0, 1 / (2 * seen.receptor_pitch), 257)
    return np.asarray(optics.mtf(white).profile(frequencies)[0], np.float64)


def computed(apertures: Sequence[float] = APERTURES, noises: Sequence[float] = NOISES) -> list[Row]:
    """Compute the measures of all pupils at all noises."""
    rows = []
    for pupil in PUPILS:
        for aperture in apertures:
            seen = eye(pupil, aperture)
            contrasts, light = contrast_of(seen), float(seen.throughput)
            of_stripes = [stripes(contrasts, light, width) for width in STRIPES]
            rows += [Row(pupil, aperture, s, *measures(contrasts, light, s), *of_stripes) for s in noises]
    return rows


def best(rows: Iterable[Row], pupil: str, noise_sigma: float, measure: str) -> float:
    """Return the relative aperture a at which a measure peaks.

    The peak is that of a parabola in log a through the best sample and its two neighbours. If the best sample is the
    first or the last one, its aperture is returned.
    """
    chosen = [row for row in rows if row.pupil == pupil and math.isclose(row.noise_sigma, noise_sigma)]
    place = np.log([row.relative_aperture for row in chosen])
    value = np.array([getattr(row, measure) for row in chosen])
    top = int(np.argmax(value))
    if top in (0, len(chosen) - 1):
        return chosen[top].relative_aperture
    low, middle, high = value[top - 1 : top + 2]
    shift = 0.5 * (low - high) / (low - 2 * middle + high)
    return float(np.exp(place[top] + shift * (place[1] - place[0])))


def predicted(noise_sigma: float, measures: Sequence[str]) -> list[str]:
    """Return as text, for each measure, the relative aperture of the pinhole that is best by it.

    The numbers come from the stored rows. The text is "-" if there are none for this noise.
    """
    rows = read_rows(Row, STORED)
    known = any(math.isclose(row.noise_sigma, noise_sigma) for row in rows)
    return [_shown(best(rows, "hole", noise_sigma, measure)) if known else "-" for measure in measures]


def rayleigh() -> float:
    """Return the relative aperture of the sharpest pinhole for a distant point, diameter 1.9 √(λf) (Rayleigh 1891)."""
    plain = optics.Eye(fov_deg=FOV_DEG)
    return 1.9 * math.sqrt(GREEN * float(plain.sensor_distance)) / plain.sensor_width


def page(rows: Sequence[Row], origin: Origin) -> Page:
    """Return the page of the stored numbers."""
    noises = sorted({row.noise_sigma for row in rows})
    cells = [
        [
            f"{s:g}",
            *(_shown(best(rows, "hole", s, m)) for m in MEASURES),
            _range([best(rows, "lens", s, m) for m in MEASURES]),
        ]
        for s in noises
    ]
    widths = [best(rows, "hole", noises[0], f"stripes_{width}") for width in STRIPES]
    header = ["noise σ", *(f"pinhole: {name}" for name in MEASURES.values()), "lens: every measure"]
    widths = [best(rows, "hole", noises[0], f"stripes_{width}") for width in STRIPES]
    return Page(
        name="best_pupil",
        command="python -m experiments.best_pupil --compute",
        values={
            "least_noise": f"{noises[0]:g}",
            "most_noise": f"{noises[-1]:g}",
            "best_in_least_noise": _shown(best(rows, "hole", noises[0], "contrast")),
            "best_in_default_noise": _shown(best(rows, "hole", 0.01, "contrast")),
            "best_in_most_noise": _shown(best(rows, "hole", noises[-1], "contrast")),
            "rayleigh": _shown(rayleigh()),
            "best_by_stripes": ", ".join(map(_shown, widths)),
            "stripes": ", ".join(map(str, STRIPES)),
            "drawn_noises": ", ".join(f"{s:g}" for s in shades(noises)),
            "optima": markdown_table(header, cells),
            "width_um": f"{1e6 * optics.Eye().sensor_width:g}",
            "fov_deg": f"{FOV_DEG:g}",
            "resolution": str(RESOLUTION),
            "black": f"{materials.BLACK:g}",
            "white": f"{materials.WHITE:g}",
            "apertures": str(len({row.relative_aperture for row in rows})),
        },
        figures=[Figure("best_pupil", lambda path: draw(rows, path))],
        origin=origin,
    )


def _shown(aperture: float) -> str:
    return f"{aperture:.2f}" if aperture > 0.1 else f"{aperture:.3f}"


def _range(apertures: Sequence[float]) -> str:
    return " to ".join(sorted({_shown(min(apertures)), _shown(max(apertures))}))


def shades(noises: Sequence[float]) -> tuple[float, float, float]:
    """Return the noises that the figure shows: the second smallest, the middle and the second largest one."""
    return noises[1], noises[len(noises) // 2], noises[-2]


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw contrast and bits over the pupil's width, and the best width over noise."""
    figure, axes = new_figure(11, 3.9, columns=3)
    noises = sorted({row.noise_sigma for row in rows})
    for place, measure in zip(axes[0], ("contrast", "bits"), strict=False):
        for sigma, strength in zip(shades(noises), STRENGTHS, strict=True):
            for pupil in PUPILS:
                chosen = [row for row in rows if row.pupil == pupil and math.isclose(row.noise_sigma, sigma)]
                x, y = np.array([(row.relative_aperture, getattr(row, measure)) for row in chosen]).T
                place.semilogx(x, y, color=COLORS[pupil], alpha=strength, lw=1.8)
                place.plot(x[y.argmax()], y.max(), "o", color=COLORS[pupil], alpha=strength, ms=6)
    left, middle, right = axes[0]
    left.set(xlabel="relative aperture a", ylabel="contrast above the noise, C", ylim=(0, 1.02))
    middle.set(xlabel="relative aperture a", ylabel="information, B [bits per receptor]", ylim=(0, None))
    middle.text(0.03, 0.93, "lens in focus", color=COLORS["lens"], transform=middle.transAxes)
    middle.text(0.03, 0.86, "pinhole", color=COLORS["hole"], transform=middle.transAxes)
    for pupil in PUPILS:
        found = [best(rows, pupil, sigma, "contrast") for sigma in noises]
        right.loglog(noises, found, color=COLORS[pupil], marker="o", ms=4)
    right.axhline(rayleigh(), color="#777777", ls=":", lw=1)
    right.text(noises[-1], rayleigh() * 0.93, "Rayleigh's pinhole", color="#777777", ha="right", va="top")
    right.set(xlabel="noise σ of a receptor", ylabel="a of highest contrast", ylim=(0.06, 1.2))
    for sigma, strength in zip(shades(noises), STRENGTHS, strict=True):
        left.plot([], [], color="#222222", alpha=strength, label=f"σ = {sigma:g}")
    left.legend(frameon=False, fontsize=8, loc="center right")
    figure.suptitle("Less light requires a wider pinhole; with a lens the widest pupil is best in any light")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute and store the numbers if requested; make the page from the stored numbers."""
    options = parser(__doc__ or "")
    options.add_argument("--compute", action="store_true", help="compute the stored numbers again")
    chosen = options.parse_args(arguments)
    return exit_code("best_pupil", lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    data, origin = (chosen.docs / "data" / f"best_pupil.{kind}" for kind in ("csv", "json"))
    if chosen.compute:
        began = time.process_time()
        write_rows(computed(), data)
        Origin.here((time.process_time() - began) / 3600).write(origin)
    page(_stored(data), Origin.read(origin)).publish(chosen.docs)


def _stored(data: Path) -> list[Row]:
    rows = read_rows(Row, data)
    if not rows:
        raise ValueError(f"{data} holds no numbers; compute them with --compute")
    return rows


if __name__ == "__main__":
    sys.exit(main())
