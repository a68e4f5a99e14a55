"""The best facet of a compound eye: acuity against light on a head of given size

python -m experiments.best_facet [--compute] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
import time
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

import optics
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.store import Origin, read_rows, write_rows
from optics.spectra.spectrum import daylight
from sim.eyes.compound_eye import CompoundEye

__all__ = ["CRITERIA", "Row", "Seen", "computed", "information", "least_parameter", "seen"]

Floats = NDArray[np.float64]
NAME = "best_facet"
WAVELENGTH = 500e-9  # peak of the pigment, and unit of eye parameters
F_NUMBERS = (2.0, 3.0, 4.5)
RHABDOMS = (1e-6, 1.4e-6, 2e-6, 2.8e-6, 4e-6, 5.6e-6)
FIXED = (2e-6, 2.0)  # rhabdom and F-number of a typical eye
DIAMETER = 25e-6  # of the computed facet; contrast as a function of D f and photons are the same for all facets
RADIUS = 1e-3  # of the eye's surface
LIGHTS = tuple(np.geomspace(0.1, 1e5, 19).tolist())  # [lx]
REFLECTANCE = 0.2  # mean reflectance of the scene
GRATING = 0.3  # contrast of the grating that an ommatidium has to detect
OCTAVE = 0.15  # standard deviation of the scene's contrast in each octave of spatial frequency
COARSEST = 1.0  # smallest spatial frequency of the scene [cycles/rad]
PARAMETERS = (0.3, 30.0)  # smallest and largest eye parameter considered [wavelengths]
LAW = 1 / math.sqrt(3)
CRITERIA = {"acuity": "finest grating", "information": "information"}
COLORS = {"acuity": "#D55E00", "information": "#0072B2"}
DRAWN = (1.0, 10.0, 100.0, 1e4)  # light levels of the right panel [lx]


@dataclass(frozen=True)
class Seen:
    """Contrast transfer and photons of one ommatidium.

    cycles: spatial frequencies [cycles per angle λ/D, with λ = WAVELENGTH], ascending from 0
    contrast: contrast transferred at these frequencies, 1 at 0
    photons: photons of the mean scene absorbed per integration time, for an illuminance of 1 lx
    """

    cycles: Floats
    contrast: Floats
    photons: float


@dataclass(frozen=True)
class Row:
    """The best eye at one light level.

    illuminance: light level [lx]
    criterion: one of CRITERIA
    eye: "best": the rhabdom and the F-number were chosen, too; "fixed": they have the values of FIXED
    parameter: eye parameter D Δφ [wavelengths]; NaN if no eye meets the criterion
    rhabdom, f_number: diameter of the rhabdom [m], and F-number
    value: resolved frequency [cycles/rad], or information [bits/sr], for an eye with the radius RADIUS
    """

    illuminance: float
    criterion: str
    eye: str
    parameter: float
    rhabdom: float
    f_number: float
    value: float


def seen(rhabdom: float, f_number: float, diameter: float = DIAMETER) -> Seen:
    """Return contrast transfer and photons of an ommatidium in daylight, by wave optics.

    The contrast is the mean of the transfer along two axes of symmetry of the hexagon.

    rhabdom: diameter of the rhabdom [m]
    f_number: focal length in air divided by the diameter of the facet
    diameter: diameter of the facet across flats [m]
    """
    n = 1.45
    lens = optics.FacetLens(diameter, radius_front=(n - 1) * f_number * diameter, n=n)
    one = optics.Ommatidium(lens, optics.Waveguide(rhabdom))
    peak = (1e9 * WAVELENGTH,)
    eye = CompoundEye([[0.0, 0.0]], one, receptors=peak, photon_budget=optics.PhotonBudget(1.0))
    bands, accepted = eye.spectral_bands, eye.acceptance(0)
    white = bands.weights[0] * daylight(bands.wavelengths)
    power = np.tensordot(white, accepted.values, axes=1) * accepted.solid_angles
    cycles = np.linspace(0, WAVELENGTH / bands.wavelengths.min(), 129)
    waves = np.exp(-2j * math.pi * diameter / WAVELENGTH * cycles[:, None] * accepted.sines)
    contrast = sum(np.abs(waves @ power.sum(axis=axis)) for axis in (0, 1)) / (2 * power.sum())
    assert eye.photons is not None
    return Seen(cycles, contrast, REFLECTANCE * float(eye.photons[0, 0]))


def least_parameter(one: Seen, illuminance: float) -> float:
    """Return the smallest eye parameter [wavelengths] with which an ommatidium detects the lattice's finest grating.

    The finest grating has the frequency 1/(√3 Δφ). An ommatidium detects it if the amplitude of its signal, in photons,
    is at least the standard deviation of the number of photons (Snyder 1977). The result is NaN if no parameter within
    PARAMETERS is large enough.
    """
    parameters = np.geomspace(*PARAMETERS, 4000)
    contrast = np.interp(LAW / parameters, one.cycles, one.contrast, right=0.0)
    enough = GRATING * contrast * math.sqrt(one.photons * illuminance) >= 1
    return float(parameters[enough.argmax()]) if enough.any() else math.nan


def information(one: Seen, parameter: float, illuminance: float) -> float:
    """Return the information [bits/sr] about a scene in the photons of a hexagonal lattice of ommatidia.

    See docs/results/best_facet.md for the formula. The frequencies that the lattice resolves form a hexagon. The
    integral over them is computed in polar coordinates over a twelfth of the hexagon, by Gauss's rule.

    parameter: eye parameter [wavelengths]
    """
    diameter = math.sqrt(parameter * WAVELENGTH * RADIUS)
    spacing, scale = diameter / RADIUS, diameter / WAVELENGTH
    first = 2 / (math.sqrt(3) * spacing)  # length of the shortest vectors of the lattice of frequencies
    (x, weight), (y, other) = (np.polynomial.legendre.leggauss(n) for n in (20, 3))
    angle = (y + 1) / 2 * math.pi / 6
    octaves = np.log(first / 2 / np.cos(angle) / COARSEST)
    radius = COARSEST * np.exp((x[:, None] + 1) / 2 * octaves)
    areas = 12 * math.pi / 6 * radius**2 * octaves * weight[:, None] / 2 * other / 2
    cell = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    reach = math.ceil(one.cycles[-1] * scale / first) + 1
    steps = np.arange(-reach, reach + 1)
    basis = first * np.array([[1.0, 0.0], [0.5, math.sqrt(3) / 2]])
    shifts = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) @ basis
    shifts = shifts[np.linalg.norm(shifts, axis=1) < one.cycles[-1] * scale + first]
    frequencies = np.linalg.norm(cell[:, None] + shifts, axis=-1)
    scene = OCTAVE**2 / (2 * math.pi * math.log(2) * frequencies**2)
    power = scene * np.interp(frequencies / scale, one.cycles, one.contrast, right=0.0) ** 2
    noise = math.sqrt(3) / 2 * spacing**2 / (one.photons * illuminance)
    return float(areas.ravel() @ (0.5 * np.log2(1 + power.sum(axis=1) / noise)))


def resolved(parameter: float) -> float:
    """Return the finest resolved grating [cycles/rad] of an eye with the radius RADIUS.

    parameter: eye parameter [wavelengths]
    """
    return LAW / math.sqrt(parameter * WAVELENGTH / RADIUS)


def most_informative(one: Seen, illuminance: float) -> tuple[float, float]:
    """Return the eye parameter [wavelengths] with the most information, and this information [bits/sr]."""
    found = minimize_scalar(
        lambda x: -information(one, math.exp(x), illuminance), bounds=np.log(PARAMETERS), options={"xatol": 1e-3}
    )
    return math.exp(found.x), -float(found.fun)


def computed(eyes: Sequence[tuple[float, float]], lights: Sequence[float] = LIGHTS) -> list[Row]:
    """Return, by each criterion and at each light level, the best of these eyes, and the best eye with FIXED values.

    eyes: (rhabdom [m], F-number) of each eye
    lights: light levels [lx]
    """
    known = {one: seen(*one) for one in {*eyes, FIXED}}
    rows = []
    for light, (eye, tried) in product(lights, (("fixed", (FIXED,)), ("best", eyes))):
        least = [(least_parameter(known[one], light), one) for one in tried]
        fine = min((found for found in least if math.isfinite(found[0])), default=least[0])
        most = max((*most_informative(known[one], light)[::-1], one) for one in tried)
        rows.append(Row(light, "acuity", eye, fine[0], *fine[1], resolved(fine[0])))
        rows.append(Row(light, "information", eye, most[1], *most[2], most[0]))
    return rows


def page(rows: Sequence[Row], origin: Origin) -> Page:
    """Return the page of the stored numbers."""
    lights = sorted({row.illuminance for row in rows})
    header = ["light [lx]", *(f"{CRITERIA[c]}: {what}" for c in CRITERIA for what in ("p/λ", "D [µm]", "rhabdom"))]
    cells = [[f"{light:.3g}", *(cell for c in CRITERIA for cell in _cells(_row(rows, light, c)))] for light in lights]
    brightest, information_rows = lights[-1], [r for r in rows if r.eye == "best" and r.criterion == "information"]
    widest = max(information_rows, key=lambda row: row.parameter)
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "law": f"{LAW:.2f}",
            "bright_acuity": _shown(_row(rows, brightest, "acuity")),
            "bright_information": _shown(_row(rows, brightest, "information")),
            "brightest": f"{brightest:g}",
            "dim_acuity": _shown(_row(rows, _dimmest(rows), "acuity")),
            "dimmest": f"{_dimmest(rows):.2g}",
            "widest": _shown(widest),
            "widest_light": f"{widest.illuminance:.2g}",
            "least_information": _shown(_row(rows, lights[0], "information")),
            "least_light": f"{lights[0]:g}",
            "table": markdown_table(header, cells),
            "radius": f"{1e3 * RADIUS:g}",
            "rhabdoms": ", ".join(f"{1e6 * d:g}" for d in RHABDOMS),
            "f_numbers": ", ".join(f"{f:g}" for f in F_NUMBERS),
            "fixed": f"{1e6 * FIXED[0]:g} µm and F/{FIXED[1]:g}",
            "grating": f"{GRATING:g}",
            "octave": f"{OCTAVE:g}",
            "reflectance": f"{REFLECTANCE:g}",
            "lowest": f"{PARAMETERS[0]:g}",
            "drawn": ", ".join(f"{light:g}" for light in DRAWN[:-1]) + f" and {DRAWN[-1]:g}",
        },
        figures=[Figure(NAME, lambda path: draw(rows, path))],
        origin=origin,
    )


def _dimmest(rows: Sequence[Row]) -> float:
    """Return the lowest light level at which an eye resolves a grating."""
    return min(row.illuminance for row in rows if row.criterion == "acuity" and math.isfinite(row.parameter))


def _row(rows: Sequence[Row], light: float, criterion: str) -> Row:
    return next(r for r in rows if (r.illuminance, r.criterion, r.eye) == (light, criterion, "best"))


def _shown(row: Row) -> str:
    return f"{row.parameter:.2f}" if math.isfinite(row.parameter) else "-"


def _cells(row: Row) -> list[str]:
    if not math.isfinite(row.parameter):
        return ["-"] * 3
    diameter = 1e6 * math.sqrt(row.parameter * WAVELENGTH * RADIUS)
    return [_shown(row), f"{diameter:.0f}", f"{1e6 * row.rhabdom:g} µm, F/{row.f_number:g}"]


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the best eye parameter over light, and the information over the eye parameter."""
    figure, axes = new_figure(10.5, 4.2, columns=2)
    left, right = axes[0]
    for criterion, (eye, line) in product(CRITERIA, (("best", "-"), ("fixed", ":"))):
        mine = [row for row in rows if row.criterion == criterion and row.eye == eye]
        label = f"{CRITERIA[criterion]}, {eye} rhabdom and F-number"
        style = {"color": COLORS[criterion], "ls": line, "lw": 1.8, "label": label}
        left.loglog([row.illuminance for row in mine], [row.parameter for row in mine], **style)
    left.axhline(LAW, color="#777777", lw=1)
    left.text(1e5, LAW * 0.97, "λ/√3", color="#777777", ha="right", va="top")
    left.set(xlabel="illuminance [lx]", ylabel="best eye parameter DΔφ / λ", ylim=(0.3, 20))
    left.legend(frameon=False, fontsize=8)
    one, parameters = seen(*FIXED), np.geomspace(0.4, 12, 60)
    for light, strength in zip(DRAWN, np.linspace(0.3, 1, len(DRAWN)), strict=True):
        bits = np.array([information(one, parameter, light) for parameter in parameters])
        right.semilogx(
            parameters, bits / bits.max(), color=COLORS["information"], alpha=strength, label=f"{light:g} lx"
        )
    right.axvline(LAW, color="#777777", lw=1)
    right.set(xlabel="eye parameter DΔφ / λ", ylabel="information / largest information", ylim=(0, 1.05))
    right.legend(frameon=False, fontsize=8)
    figure.suptitle("The best facets are wider in dim light; in very dim light, this depends on the criterion")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute and store the numbers if requested; make the page from the stored numbers."""
    options = parser(__doc__ or "")
    options.add_argument("--compute", action="store_true", help="compute the stored numbers again")
    chosen = options.parse_args(arguments)
    return exit_code(NAME, lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    data, origin = (chosen.docs / "data" / f"{NAME}.{kind}" for kind in ("csv", "json"))
    if chosen.compute:
        began = time.process_time()
        write_rows(computed(tuple(product(RHABDOMS, F_NUMBERS))), data)
        Origin.here((time.process_time() - began) / 3600).write(origin)
    page(read_rows(Row, data), Origin.read(origin)).publish(chosen.docs)


if __name__ == "__main__":
    sys.exit(main())
