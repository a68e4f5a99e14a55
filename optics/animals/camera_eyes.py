"""Camera eyes of vertebrates and a spider. Each eye has only a patch of retina; `goldfish_lens` returns a lens alone.

The receptors of an `optics.Eye` form a square lattice. The distance between receptors is chosen so that the finest
grating that the lattice resolves is the finest that the animal or its retina resolves according to the cited article.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from optics.elements.ball_lens import BallLens
from optics.elements.human_eye import HumanEye
from optics.elements.pupil import Pupil
from optics.elements.refractive_index import RefractiveIndex, medium
from optics.eye.acuity import anatomical_acuity
from optics.eye.eye import Eye
from optics.numerics.arguments import one_of, whole

__all__ = ["eagle", "goldfish", "goldfish_lens", "human", "jumping_spider", "mouse"]

HUMAN_CONES = 199e9  # Curcio et al. 1990: mean peak density [1/m²]
NODAL_DISTANCE = 16.67e-3  # Gullstrand's reduced eye [m]
VITREOUS = 1.336
MOST = 1000  # receptors along a side of a patch
MATTHIESSEN = 2.5  # focal length of a fish lens in radii
# Perlmann & Longsworth 1948: refractive increment of serum albumin, proportional to 0.940 + 2e4 nm²/λ². [1], [m²]
ALBUMIN = 0.940, 2e-14


def _patch(pupil: Pupil, acuity: float, nodal_distance: float, side: int, receptors: Any) -> Eye:
    """Return an eye with `side` x `side` receptors, whose square lattice resolves `acuity` cycles per degree."""
    whole("receptors_across", side, 1, MOST)
    width = side * nodal_distance * math.radians(1 / (2 * acuity))
    fov = 2 * math.degrees(math.atan(width / (2 * nodal_distance)))
    return Eye(pupil, (side, side), fov, width, receptors=receptors, full_aperture=2 * pupil.radius)


def _lens(diameter: float, nodal_distance: float, index: float = VITREOUS) -> Pupil:
    """Return an ideal lens between air and the eye's medium."""
    return Pupil(diameter / 2, thin_lens_focal_length=nodal_distance * index, medium_n=index, object_n=1.0)


def human(receptors_across: int = 60, pupil_diameter: float = 3e-3) -> Eye:
    """Return the human foveola behind `HumanEye` with its default wavefront, that of a standard observer.

    Source of the density of cones, 199,000 per mm²: Curcio, Sloan, Kalina & Hendrickson, J. Comp. Neurol. 292, 497,
    1990. Individuals have 100,000 to 324,000 per mm².

    receptors_across: receptors along each side of the patch, 1 to 1000.
    pupil_diameter: diameter [m] of the pupil, at most 6 mm.

    Raises:
        ValueError: an argument is outside its range.
    """
    eye = HumanEye(pupil_diameter / 2)
    nodal = eye.focal_length / float(medium("chromatic_eye").at(570e-9))
    return _patch(eye.pupil, anatomical_acuity(HUMAN_CONES, NODAL_DISTANCE), nodal, receptors_across, "lms")


def mouse(receptors_across: int = 40, pupil_diameter: float = 1e-3) -> Eye:
    """Return a patch of a mouse's retina with the acuity found in behavioural tests, 0.5 cycles/degree.

    The receptors are most sensitive at 360 and 508 nm (Abballe & Asari, PLoS ONE 17, e0262763, 2022). The acuity
    (Prusky et al. 2000) and 31 µm of retina per degree (Remtulla & Hallett 1985) are quoted from later articles; the
    original articles have not been read. Mice pool many receptors, so the patch has one receptor for each pool.

    receptors_across: pools along each side of the patch, 1 to 1000.
    pupil_diameter: diameter [m] of the pupil.

    Raises:
        ValueError: an argument is outside its range.
    """
    nodal = 31e-6 * 180 / math.pi
    return _patch(_lens(pupil_diameter, nodal), 0.5, nodal, receptors_across, "mouse")


def eagle(receptors_across: int = 60) -> Eye:
    """Return an eye with a square patch of the deep fovea of a wedge-tailed eagle, *Aquila audax*.

    Source: Reymond, Vision Research 25, 1477, 1985 (abstract): the retina resolves 140 cycles/degree, and the optics
    resolve 157 at the smallest pupil. A pupil with this cutoff at 550 nm is 4.9 mm wide. No source was consulted for
    the nodal distance of 22 mm, which does not affect any angle. The pigment at 567 nm is that of long-wavelength cones
    of birds, because no pigment of an eagle was found.

    receptors_across: receptors along each side of the patch, 1 to 1000.

    Raises:
        ValueError: receptors_across is outside its range.
    """
    diameter = 157 * math.degrees(1) * 550e-9
    return _patch(_lens(diameter, 22e-3), 140.0, 22e-3, receptors_across, (567.0,))


def goldfish_lens(radius: float = 1.4e-3) -> BallLens:
    """Return a ball lens of a fish in water, with Matthiessen's ratio f = 2.5 R at 550 nm.

    The profile is that of the generalised Luneburg lens. The surface has the index of water. The proteins at the core
    add n_core - n_water to the index at 550 nm. At other wavelengths, this contribution is proportional to 0.940 +
    20,000 nm²/λ², the dispersion of serum albumin (Perlmann & Longsworth, J. Am. Chem. Soc. 70, 2719, 1948). The radius
    of 1.4 mm is a typical value.

    radius: radius [m] of the lens.

    Raises:
        ValueError: the radius is not positive.
    """
    at, water = 550e-9, medium("water")
    around = float(water.at(at))
    plain = BallLens.luneburg(radius, around, MATTHIESSEN)
    middle = float(plain.index(0.0))
    # Cauchy's equation with one term reproduces the index of water to 3e-4 between 400 and 700 nm.
    of_water = (float(water.at(450e-9)) - float(water.at(650e-9))) / (450e-9**-2 - 650e-9**-2)
    bend = of_water + (middle - around) * ALBUMIN[1] / (ALBUMIN[0] + ALBUMIN[1] / at**2)
    return replace(plain, core_n=RefractiveIndex(middle - bend / at**2, bend), surface_n=water, medium_n=water)


def goldfish(receptors_across: int = 40, radius: float = 1.4e-3) -> Eye:
    """Return a patch of a goldfish's retina behind a ball lens, with an acuity of 60/26 = 2.3 cycles/degree.

    Source: Northmore & Dvorak, Vision Research 19, 255, 1979: 13 minutes of arc per half period, in agreement with the
    separation of cones. The retina is concentric with the lens, so a patch in any direction of view would have the
    same image quality. The pupil has 0.9 times the diameter of the lens. See `goldfish_lens`.

    receptors_across: receptors along each side of the patch, 1 to 1000.
    radius: radius [m] of the lens.

    Raises:
        ValueError: an argument is outside its range.
    """
    lens = goldfish_lens(radius)
    return _patch(lens.pupil(0.9 * radius), 60 / 26, lens.focal_length(), receptors_across, "goldfish")


# Angle between receptors [minutes of arc], diameter of the lens [m], and focal length [m].
SPIDER_EYES = {"principal": (2.4, 780e-6, 1980e-6), "secondary": (42.0, 380e-6, 254e-6)}


def jumping_spider(receptors_across: int = 30, eye: str = "principal") -> Eye:
    """Return an eye of the jumping spider *Portia* with a square patch of retina and the receptors "jumping_spider".

    Source for the principal eyes, with 2.4 minutes of arc between receptors: Land, in Neurobiology of Arachnids, p. 53,
    1985, after Williams & McIntyre, Nature 288, 578, 1980. No source was consulted for the widths and focal lengths of
    the lenses, or for the 0.7° between receptors of the secondary (anterior lateral) eyes.

    receptors_across: receptors along each side of the patch, 1 to 1000.
    eye: "principal" or "secondary".

    Raises:
        ValueError: the eye is unknown, or receptors_across is outside its range.
    """
    minutes, diameter, focal = SPIDER_EYES[one_of("eye", eye, SPIDER_EYES)]
    return _patch(_lens(diameter, focal), 30 / minutes, focal, receptors_across, "jumping_spider")
