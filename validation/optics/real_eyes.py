"""Real eyes: published values of animals' eyes and computed ones

Do the models reproduce what biologists measured and calculated for real eyes? The table compares published with
computed values. Each row states the range in which the ratio computed/published must lie. If a ratio is outside its
range, the command fails. Some ranges are wide, because the values differ for the reasons given below. A wide range does
not mean that the values agree. Its only purpose is to detect a change of the computed value. The inputs come from
`optics.animals`.

**Method.** Land's sensitivity S is `optics.optical_sensitivity` in white light with k = 0.0067 per µm. Acceptance
angles Δρ are full widths at half maximum of `optics.Ommatidium.sensitivity`, which is computed by wave optics with
waveguide modes. All rhabdoms have the refractive index 1.363 in a medium of 1.340. Both indices were measured in flies.
Acuity is computed for a hexagonal lattice of receptors.

**Sources.** The last column states which part of the source was read: the article, a table, an appendix, the caption of
a figure, the abstract, or a press release ("press"). "Quoted" means that the source was not accessible, and that the
value comes from a later article or from our notes. "Closed form" means that it comes from a formula.

- Honeybees: Somanathan et al., J. Exp. Biol. 212, 2448, 2009, table 1. The published Δρ is d/f, which ignores
  diffraction. The computed angles are therefore larger, by 20 to 65 %. Angles measured by electrophysiology agree
  better with the computed ones: 2.6° on average in dark-adapted eyes, and less than 1.9° in the acute zone of
  light-adapted eyes (Rigosi, Wiederman & O'Carroll, Sci. Rep. 7, 45972, 2017). A closed pupil removes the higher modes
  of the rhabdom (Stavenga 2004), so the light-adapted angle is computed from the first mode. The rhabdom of *Apis
  cerana* has a waveguide parameter of V = 2.55 at 540 nm, just above the cut-off of the second mode at 2.405. Its angle
  is therefore sensitive to the refractive indices. For *Apis dorsata*, the table's S differs by 9 % from the value that
  follows from its other columns (D, f, Δρ and l).
- *Drosophila*: Stavenga, J. Comp. Physiol. A 189, 1, 2003, appendix 1.
- Blowfly: Stavenga, J. Exp. Biol. 207, 1703, 2004, caption of fig. 4. Dark-adapted angles approach d/f, and
  light-adapted angles approach the half width of the facet's diffraction pattern. The values of the curves between
  these limits could not be read, so the column "published" contains the limits. The rhabdomeres taper to 1 µm over a
  length of 250 µm, as a parabola whose equation could not be read. Here the taper is linear. Behind the wider tip, the
  second mode reaches its cut-off before half of the length, so it absorbs less and the dark-adapted angle is narrower
  than that of a straight rhabdomere. The narrower tip guides a single mode at 500 nm, and the taper does not change
  its angle.
- *Megalopta*: Greiner, Ribi & Warrant, Cell Tissue Res. 316, 377, 2004, abstract. The dimensions of the eye are quoted.
- *Cirolana*: Nilsson & Nilsson, J. Comp. Physiol. A 143, 503, 1981, abstract. According to geometrical optics, the
  acceptance angle of the receptor is 45°. The row shows by how much the PSF of the lens increases this angle.
- Humans: Curcio et al., J. Comp. Neurol. 292, 497, 1990, abstract (199,000 cones per mm², 100,000 to 324,000 in
  individuals); Land, in Neurobiology of Arachnids, p. 53, 1985, abstract (0.42 minutes of arc between cones); Caves,
  Brandley & Johnsen, Trends Ecol. Evol. 33, 358, 2018, press release (60 cycles/degree).
- Eye parameter: Snyder, J. Comp. Physiol. 116, 161, 1977, abstract.
- Photons: Geisler, J. Opt. Soc. Am. A 1, 775, 1984, quoted: 347.8 photons per second, mm² of pupil, square minute and
  cd/m² at 555 nm.
- Fish: Fernald & Wright, Vision Research 25, 155, 1985, abstract: the chromatic aberration of the lens of *Haplochromis
  burtoni* is 1.9 % of f. The abstract does not state the wavelengths. The computed value is for a lens with f = 2.5 R
  and the dispersion of serum albumin, between 486 and 656 nm (the lines F and C). The two values therefore agree only
  roughly.
- Luneburg's and Maxwell's lenses: closed forms.

**Ideal observer.** The second table lists the contrast sensitivity of an ideal observer. The conditions follow Banks,
Geisler & Bennett (Vision Research 27, 1915, 1987): a pupil of 2 mm, gratings of 7.5 cycles in a cosine window that are
shown for 100 ms, and 70.7 % correct choices. Only the abstract was read. It states that the ideal observer is about 20
times better than humans, and that both curves have the same shape from 5 to 40 cycles/degree. The human data are in a
figure that was not accessible. The column "over 20" is the sensitivity divided by 20, which is a prediction of human
sensitivity, not a comparison. The sensitivity at 5 cycles/degree must lie between 1,000 and 10,000. The optics are
`optics.mean_human_mtf`; the article uses another MTF. Duration, window and criterion are quoted.

**Not computed.** The table omits these published values:

- The sensitivity and the angle of *Cyrba algerina*, 0.39 µm² and 12.4 minutes of arc. The article describes lens and
  receptors, but only its abstract was accessible.
- The owlfly's Δρ of 1.8°. Its eye is a superposition eye.
- The acuity of the wedge-tailed eagle (140 cycles/degree), and the angles between receptors of the goldfish (13 minutes
  of arc) and of dragonflies (0.24°). They are inputs of `optics.animals`, so a comparison would show nothing. We read
  them in abstracts.

The command computes the table:

    python -m validation.optics.real_eyes [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import optics
from optics.animals.camera_eyes import HUMAN_CONES, NODAL_DISTANCE, goldfish_lens
from optics.animals.compound_eyes import HONEYBEES, Facet
from optics.spectra.spectrum import daylight
from validation.pages.page import Page, parser

GREEN, MIDDLE = 540e-9, 500e-9
LUMINANCES = (3.4, 34.0, 340.0)  # [cd/m²], Banks et al. 1987
FREQUENCIES = np.array([5.0, 7.0, 10.0, 14.0, 20.0, 28.0, 40.0])  # [cycles/degree], Banks et al. 1987
CYCLES, SECONDS, PUPIL_AREA, D_PRIME = 7.5, 0.1, math.pi * 1e-6, 0.77  # 70.7 % correct
TRANSMISSION, EFFICIENCY, COVERED = 0.68, 0.5, 0.9  # Geisler 1984: of ocular media, of cones; fraction of the fovea
IDEAL_AT_5 = 1000.0, 10_000.0
MINUTE = math.radians(1 / 60)


@dataclass(frozen=True)
class Row:
    """A published and a computed value, and the range in which their ratio must lie."""

    name: str
    unit: str
    published: float
    computed: float
    low: float
    high: float
    read: str

    @property
    def ratio(self) -> float:
        return self.computed / self.published

    @property
    def line(self) -> str:
        values = f"{self.published:<11.4g}{self.computed:<11.4g}{self.ratio - 1:<+13.1%}"
        return f"{self.name:<45}{self.unit:<9}{values}{f'{self.low:g} to {self.high:g}':<18}{self.read}"


def land(facet: Facet) -> float:
    """Return Land's sensitivity [µm² sr] in white light."""
    return 1e12 * optics.optical_sensitivity(facet.diameter, facet.focal_length, facet.rhabdom, facet.length)


def first_mode_angle(eye: optics.Ommatidium, wavelength: float) -> float:
    """Return the full width at half maximum [degrees] of the light in the first mode."""
    at = np.linspace(0, 4, 801)
    power = eye.mode_power(np.radians(at), np.zeros(len(at)), wavelength)[0]
    return 2 * float(np.interp(-power[0] / 2, -power[: power.argmin()], at[: power.argmin()]))


def _angle(eye: optics.AppositionEye, wavelength: float) -> float:
    return math.degrees(eye.ommatidium.acceptance_angle(wavelength))


def bees() -> list[Row]:
    animals = optics.animals
    sensitivities = {"mellifera": 0.11, "cerana": 0.07, "florea": 0.03, "dorsata": 0.21}
    angles = {"mellifera": 1.75, "cerana": 1.2, "florea": 1.1, "dorsata": 1.8}
    rows = [
        Row(f"Apis {name}: sensitivity", "µm² sr", value, land(HONEYBEES[name]), 0.95, 1.1, "table")
        for name, value in sensitivities.items()
    ]
    rows += [
        Row(
            f"Apis {name}: Δρ at 540 nm, against d/f",
            "deg",
            value,
            _angle(animals.honeybee(name), GREEN),
            1,
            1.7,
            "table",
        )
        for name, value in angles.items()
    ]
    adapted = first_mode_angle(animals.honeybee().ommatidium, GREEN)
    nocturnal = land(Facet(36e-6, 97e-6, 8e-6, 350e-6)) / land(HONEYBEES["mellifera"])
    return [
        *rows,
        Row(
            "Apis mellifera: Δρ, dark-adapted cells", "deg", 2.6, _angle(animals.honeybee(), GREEN), 0.9, 1.1, "article"
        ),
        Row("Apis mellifera: Δρ, light-adapted cells", "deg", 1.9, adapted, 0.8, 1.0, "article"),
        Row("Megalopta: sensitivity over a honeybee's", "1", 27.0, nocturnal, 0.85, 1.15, "abstract"),
    ]


def flies() -> list[Row]:
    lens = optics.animals.fruit_fly().ommatidium.lens
    rows = [
        Row("Drosophila: focal length in air", "µm", 20.6, 1e6 * lens.object_focal_length(), 0.99, 1.01, "appendix"),
        Row("Drosophila: focal length in the cone", "µm", 27.5, 1e6 * lens.focal_length(), 0.99, 1.01, "appendix"),
    ]
    for diameter in (1.4e-6, 2e-6):
        eye, name = optics.animals.blowfly(rhabdomere=diameter), f"blowfly, tip of {1e6 * diameter:g} µm"
        geometric = math.degrees(diameter / 55e-6)
        rows.append(Row(f"{name}: Δρ at 500 nm, dark", "deg", geometric, _angle(eye, MIDDLE), 0.85, 1.1, "figure"))
        pattern = math.degrees(1.03 * MIDDLE / 25e-6)
        adapted = first_mode_angle(eye.ommatidium, MIDDLE)
        rows.append(Row(f"{name}: Δρ at 500 nm, light", "deg", pattern, adapted, 1.0, 1.2, "figure"))
    return rows


def lenses() -> list[Row]:
    fish, ball = goldfish_lens(), optics.BallLens.luneburg(1.0, 1.0)
    spread = fish.focal_length(656.3e-9) - fish.focal_length(486.1e-9)
    turning = float(optics.BallLens.maxwell(1.0).turning(0.4))
    shortest = [float(fish.focus(h * fish.radius)) / fish.radius for h in (0.1, 0.9)]
    return [
        Row("fish: chromatic aberration over f", "%", 1.9, 100 * spread / fish.focal_length(), 0.7, 1.6, "abstract"),
        Row("fish: focus of rays at 0.1 R (Matthiessen)", "R", 2.5, shortest[0], 1 - 1e-4, 1 + 1e-4, "closed form"),
        Row("fish: focus of rays at 0.9 R (Matthiessen)", "R", 2.5, shortest[1], 1 - 1e-4, 1 + 1e-4, "closed form"),
        Row(
            "Luneburg's lens: index at the centre",
            "1",
            math.sqrt(2),
            float(ball.index(0.0)),
            1 - 1e-8,
            1 + 1e-8,
            "closed form",
        ),
        Row("Maxwell's lens: turn of a ray", "rad", math.pi, turning, 1 - 1e-8, 1 + 1e-8, "closed form"),
    ]


def limits() -> list[Row]:
    spacing = math.sqrt(2 / math.sqrt(3) / HUMAN_CONES) / NODAL_DISTANCE / MINUTE
    isopod = optics.animals.cirolana().describe().acceptance_angle_deg
    acuity = optics.anatomical_acuity(HUMAN_CONES, NODAL_DISTANCE)
    snyder = optics.least_eye_parameter(MIDDLE) / MIDDLE
    return [
        Row("Cirolana: Δρ", "deg", 45.0, isopod, 0.95, 1.1, "abstract"),
        Row("human: acuity of the cones", "cyc/deg", 60.0, acuity, 1.0, 1.2, "press"),
        Row("human: angle between cones", "arcmin", 0.42, spacing, 1.0, 1.25, "abstract"),
        Row("least eye parameter over λ", "1", 0.58, snyder, 0.99, 1.01, "abstract"),
        Row("photons of 1 cd/m² at 555 nm, per s", "1", 347.8, geisler_photons(), 0.99, 1.01, "quoted"),
    ]


def geisler_photons() -> float:
    """Return the photons of 1 cd/m² at 555 nm by a PhotonBudget, per second, mm² of pupil and square minute of arc."""
    narrow = optics.Receptors((optics.Spectrum((554.0, 555.0, 556.0), (0.0, 1.0, 0.0)),), range_nm=(550.0, 560.0))
    budget = optics.PhotonBudget(math.pi, integration_time=1.0, quantum_efficiency=1.0)
    photons = budget.photons(optics.SpectralBands.uniform(1, narrow), 1e-6 * MINUTE**2)[0]
    lumens_per_watt = 683.0
    luminance = (
        budget.spectral_irradiance / math.pi * float(daylight(np.array(555e-9))) * lumens_per_watt * 1e-9
    )  # luminance of daylight in a band 1 nm wide, as wide as the band of the photons
    return float(photons / luminance)


def ideal_sensitivities() -> np.ndarray:
    """Return the contrast sensitivities of the ideal observer, (luminance, frequency)."""
    contrast = optics.mean_human_mtf(FREQUENCIES, 2 * math.sqrt(PUPIL_AREA / math.pi))
    area = (CYCLES / FREQUENCIES) ** 2 / 4  # the squared window has the mean 1/4
    bands = optics.SpectralBands.uniform(16, "lms")
    rows = []
    for luminance in LUMINANCES:
        budget = optics.PhotonBudget(math.pi * luminance, SECONDS, TRANSMISSION * EFFICIENCY)
        long, middle, _ = budget.photons(bands, PUPIL_AREA * math.radians(1) ** 2)
        photons = COVERED * (2 * long + middle) / 3  # two L cones for each M cone
        rows.append(optics.ideal_contrast_sensitivity(FREQUENCIES, contrast, photons, area, D_PRIME))
    return np.array(rows)


def broken_bounds(rows: list[Row], ideal: np.ndarray) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = [
        f"{row.name}: {row.ratio:.4g} times the published value, must be {row.low:g} to {row.high:g} times"
        for row in rows
        if not row.low <= row.ratio <= row.high
    ]
    if not IDEAL_AT_5[0] <= ideal[-1, 0] <= IDEAL_AT_5[1]:
        broken.append(
            f"ideal observer at 5 cycles/degree: {ideal[-1, 0]:.4g}, must be {IDEAL_AT_5[0]:g} to {IDEAL_AT_5[1]:g}"
        )
    return broken


def table(rows: list[Row], ideal: np.ndarray) -> str:
    header = f"{'value':<45}{'unit':<9}{'published':<11}{'computed':<11}{'difference':<13}{'ratio within':<18}read"
    lines = [header, *(row.line for row in rows), ""]
    lines.append("ideal observer at 340 cd/m²: cycles/degree, contrast sensitivity, over 20")
    lines += [f"{u:<8g}{value:<10.4g}{value / 20:.3g}" for u, value in zip(FREQUENCIES, ideal[-1], strict=True)]
    return "\n".join(lines)


def draw(rows: list[Row], ideal: np.ndarray, path: Path) -> None:
    """Draw the computed values over the published ones, and the ideal observer's contrast sensitivity."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 6.5), layout="constrained")
    bars, chart = figure.subplots(1, 2, width_ratios=[1.5, 1])
    names = [row.name for row in rows][::-1]
    at = np.arange(len(rows))
    for y, row in zip(at, rows[::-1], strict=True):
        bars.plot([row.low, row.high], [y, y], color="#CFE3F2", lw=7, solid_capstyle="butt")
    bars.plot([row.ratio for row in rows][::-1], at, "o", color="#0072B2", ms=5)
    bars.axvline(1, color="#666666", lw=0.8)
    bars.set_yticks(at, names, fontsize=8)
    bars.set(xlabel="computed / published", title="Real eyes: points in their ranges", xlim=(0.6, 1.8))
    for luminance, values in zip(LUMINANCES, ideal, strict=True):
        chart.loglog(FREQUENCIES, values, "o-", ms=4, label=f"{luminance:g} cd/m²")
    chart.set_xticks(FREQUENCIES, [f"{u:g}" for u in FREQUENCIES])
    chart.minorticks_off()
    chart.set(xlabel="cycles per degree", ylabel="contrast sensitivity", title="Ideal observer, pupil of 2 mm")
    chart.legend(frameon=False, fontsize=8.5)
    figure.savefig(path, dpi=110)


def all_rows() -> list[Row]:
    return [*bees(), *flies(), *lenses(), *limits()]


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__).parse_args(arguments)
    rows, ideal = all_rows(), ideal_sensitivities()
    page = Page("real_eyes", __doc__, table(rows, ideal), broken_bounds(rows, ideal))
    return page.publish(options, lambda path: draw(rows, ideal, path))


if __name__ == "__main__":
    sys.exit(main())
