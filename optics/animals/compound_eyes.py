"""Compound eyes of insects and of a crustacean.

The function `optics.receptors_of` returns the receptors of an insect's eye, for example for the name "honeybee". The
docstring of each insect's eye states the name to use.

All rhabdoms and rhabdomeres have the refractive index 1.363 in a medium of index 1.340. These are values for flies
(Stavenga, J. Comp. Physiol. A 190, 115, 2004). Measured indices of the other animals are not used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from optics.elements.pupil import Pupil
from optics.eye.eye import Eye
from optics.numerics.arguments import one_of, positive
from optics.ommatidia.facet import FacetLens
from optics.ommatidia.mosaic import AppositionEye
from optics.ommatidia.ommatidium import Ommatidium
from optics.ommatidia.waveguide import Waveguide
from optics.spectra.optical_sensitivity import INVERTEBRATE_ABSORPTION

__all__ = ["COMPOUND", "HONEYBEES", "Facet", "blowfly", "cirolana", "dragonfly", "fruit_fly", "honeybee", "megalopta"]

# Names of compound eyes with many ommatidia, and their receptors for `optics.receptors_of`.
COMPOUND = {
    "honeybee": "honeybee",
    "fruit_fly": "fruit_fly",
    "blowfly": "blowfly",
    "dragonfly": "dragonfly",
    "megalopta": "honeybee",
}
LENS_N = 1.45  # Stavenga 2003: index of the facet lens of a fly
CRUSTACEAN_N = 1.34  # index of the crystalline cone


@dataclass(frozen=True)
class Facet:
    """Measurements of an ommatidium.

    diameter: diameter D [m] of the facet.
    focal_length: object-side focal length f [m], in air.
    rhabdom: diameter d [m] of the rhabdom's tip.
    length: length l [m] of the rhabdom.
    proximal: diameter [m] of the rhabdom's far end, if it tapers.
    """

    diameter: float
    focal_length: float
    rhabdom: float
    length: float
    proximal: float | None = None

    def ommatidium(self) -> Ommatidium:
        """Return a plano-convex facet lens of this focal length, and the rhabdom in its focus."""
        lens = FacetLens(self.diameter, self.focal_length * (LENS_N - 1), n=LENS_N)
        return Ommatidium(lens, _guide(self.rhabdom, self.length, self.proximal))


def _guide(diameter: float, length: float, proximal: float | None = None) -> Waveguide:
    return Waveguide(diameter, length=length, absorption=INVERTEBRATE_ABSORPTION, proximal_diameter=proximal)


def _by_angle(diameter: float, focal_length: float, angle_deg: float, length: float) -> Facet:
    """Return a facet whose rhabdom subtends `angle_deg` in the visual field.

    The diameter of the rhabdom is focal length · angle. The argument `diameter` is that of the facet.
    """
    return Facet(diameter, focal_length, focal_length * math.radians(angle_deg), length)


# Somanathan, Warrant, Borges, Wallén & Kelber, J. Exp. Biol. 212, 2448, 2009, table 1: D, f, Δρ = d/f, l.
HONEYBEES = {
    "mellifera": _by_angle(20e-6, 66e-6, 1.75, 320e-6),
    "cerana": _by_angle(24.5e-6, 84e-6, 1.2, 270e-6),
    "florea": _by_angle(19.5e-6, 79e-6, 1.1, 190e-6),
    "dorsata": _by_angle(29.5e-6, 104e-6, 1.8, 260e-6),
}


def honeybee(species: str = "mellifera", rings: int = 10) -> AppositionEye:
    """Return an eye of a worker honeybee.

    The result does not contain receptors; `optics.receptors_of("honeybee")` returns those of this animal.

    Source: Somanathan, Warrant, Borges, Wallén & Kelber, J. Exp. Biol. 212, 2448, 2009, table 1. The article
    computes acceptance angles as the rhabdom's diameter divided by the focal length. The diameters are derived from
    these angles. The mean interommatidial angle of 2.1° is an estimate for all four species. It assumes that the 5432
    facets of *Apis mellifera* cover a hemisphere.

    species: "mellifera", "cerana", "florea" or "dorsata".
    rings: rings of ommatidia around the central one.

    Raises:
        ValueError: the species is unknown, or the number of rings is outside 0 to 60.
    """
    return AppositionEye(HONEYBEES[one_of("species", species, HONEYBEES)].ommatidium(), rings, 2.1)


def fruit_fly(rings: int = 15) -> AppositionEye:
    """Return an eye of *Drosophila melanogaster* with the rhabdomeres R1-6.

    The result does not contain receptors; `optics.receptors_of("fruit_fly")` returns those of this animal.

    Source of the lens: Stavenga, J. Comp. Physiol. A 189, 1, 2003, appendix 1. The facet's diameter of 16 µm, the
    rhabdomere's diameter of 1.9 µm and length of 80 µm, and the interommatidial angle of 5° are typical values. No
    source was consulted for them.

    rings: rings of ommatidia around the central one. 15 rings have 721 ommatidia.

    Raises:
        ValueError: the number of rings is outside 0 to 60.
    """
    return AppositionEye(Ommatidium(FacetLens(16e-6, 11e-6, -11e-6, 8e-6), _guide(1.9e-6, 80e-6)), rings, 5.0)


def blowfly(rings: int = 20, rhabdomere: float = 2e-6) -> AppositionEye:
    """Return the frontal eye of a blowfly, *Calliphora*, with the rhabdomeres R1-6.

    The result does not contain receptors; `optics.receptors_of("blowfly")` returns those of this animal.

    Source: Stavenga, J. Exp. Biol. 207, 1703, 2004, fig. 4: facets of 25 µm, an F-number of 2.2, and rhabdomeres with
    tips of 1.4 to 2 µm and a length of 250 µm, which taper to 1 µm at their ends. In the article, the taper is a
    parabola. Here it is linear, because the equation of the parabola was not available. The interommatidial angle of
    1.3° is a typical value, for which no source was consulted.

    rings: rings of ommatidia around the central one.
    rhabdomere: diameter [m] of the rhabdomere's tip. Rhabdomeres of at most 1 µm do not taper.

    Raises:
        ValueError: the number of rings is outside 0 to 60, or the diameter is not positive.
    """
    tip = positive("rhabdomere", rhabdomere)
    facet = Facet(25e-6, 2.2 * 25e-6, tip, 250e-6, min(1e-6, tip))
    return AppositionEye(facet.ommatidium(), rings, 1.3)


def dragonfly(rings: int = 20) -> AppositionEye:
    """Return the acute zone of a dragonfly's eye, the region with the smallest angles between ommatidia.

    The result does not contain receptors; `optics.receptors_of("dragonfly")` returns those of this animal.

    Source of the interommatidial angle of 0.24°: Land, Annu. Rev. Entomol. 42, 147, 1997. The facet's diameter of 62 µm
    is that of Sherk 1978, which was not consulted itself. No source was consulted for the focal length of three facet
    diameters, or for the rhabdom's diameter of 2 µm and length of 500 µm.

    rings: rings of ommatidia around the central one.

    Raises:
        ValueError: the number of rings is outside 0 to 60.
    """
    return AppositionEye(Facet(62e-6, 3 * 62e-6, 2e-6, 500e-6).ommatidium(), rings, 0.24)


def megalopta(rings: int = 10) -> AppositionEye:
    """Return an eye of the nocturnal bee *Megalopta genalis*.

    The result does not contain receptors; `optics.receptors_of("honeybee")` returns receptors that suit this animal.

    Source: Greiner, Ribi & Warrant, Cell Tissue Res. 316, 377, 2004. Only the abstract of this article has been read.
    It states that the facets are nearly twice as wide and the rhabdoms four to five times as wide as those of bees that
    are active by day. The facet's diameter of 36 µm, the focal length of 97 µm, the rhabdom's diameter of 8 µm and
    length of 350 µm, and the interommatidial angle of 1.4° are quoted from later articles.

    rings: rings of ommatidia around the central one.

    Raises:
        ValueError: the number of rings is outside 0 to 60.
    """
    return AppositionEye(Facet(36e-6, 97e-6, 8e-6, 350e-6).ommatidium(), rings, 1.4)


def cirolana() -> Eye:
    """Return one ommatidium of the marine isopod *Cirolana borealis*, with an acceptance angle of 45°.

    Source of the facet's diameter of 150 µm and of this angle: Nilsson & Nilsson, J. Comp. Physiol. A 143, 503, 1981.
    The rhabdom has too many modes to be modelled as a waveguide, and the focus of the lens lies below the rhabdom's
    tip. The eye is therefore modelled as a lens in front of a single square receptor of 45°. No source was
    consulted for the focal length of 100 µm, which does not affect the acceptance angle.
    """
    focal = 100e-6
    pupil = Pupil(75e-6, thin_lens_focal_length=focal, medium_n=CRUSTACEAN_N)
    width = 2 * focal * math.tan(math.radians(45 / 2))
    return Eye(pupil, (1, 1), 45.0, width, bands=1, receptors=(500.0,), full_aperture=150e-6)
