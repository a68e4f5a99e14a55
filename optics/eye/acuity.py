"""Acuity of eyes: limits by the spacing of receptors, by diffraction, and by the number of photons."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optics.numerics.arguments import in_range, one_of, positive, reals, vacuum_wavelength

__all__ = [
    "anatomical_acuity",
    "eye_parameter",
    "ideal_contrast_sensitivity",
    "least_eye_parameter",
    "sampling_acuity",
]

# Period of the finest grating that a lattice resolves, in units of the distance between neighbours: √3 for a hexagonal
# lattice, 2 for a square one.
PERIODS = {"hexagon": math.sqrt(3), "square": 2.0}
DETECTED = 0.954  # d' for 75 % correct choices between two intervals


def eye_parameter(diameter: float, interommatidial_deg: float) -> float:
    """Return the eye parameter p = D Δφ [m] of a compound eye (Snyder, J. Comp. Physiol. 116, 161, 1977).

    Eyes that are limited by diffraction, in bright light, have values near `least_eye_parameter`. Eyes that are limited
    by photon noise have larger values.

    diameter: diameter D [m] of a facet.
    interommatidial_deg: interommatidial angle Δφ [degrees].

    Raises:
        ValueError: an argument is not positive, or the angle is above 180°.
    """
    angle = positive("interommatidial_deg", interommatidial_deg, "degrees")
    return positive("diameter", diameter) * math.radians(in_range("interommatidial_deg", angle, 0.0, 180.0))


def least_eye_parameter(wavelength: float, lattice: str = "hexagon") -> float:
    """Return the smallest useful eye parameter [m]: λ/√3 for a hexagonal lattice, λ/2 for a square one.

    With this value, the finest grating that the lattice of facets resolves has the period λ/D, where D is the diameter
    of a facet. Facets do not transmit finer gratings.

    wavelength: vacuum wavelength λ [m], for an eye in air. Under water, divide it by the index of water.
    lattice: "hexagon" or "square".

    Raises:
        ValueError: the wavelength is invalid, or the lattice is unknown.
    """
    one_of("lattice", lattice, PERIODS)
    return vacuum_wavelength(wavelength) / PERIODS[lattice]


def sampling_acuity(spacing_deg: float, lattice: str = "hexagon") -> float:
    """Return the frequency [cycles/degree] of the finest grating that a lattice of receptors resolves.

    It is 1/(√3 Δφ) for a hexagonal lattice and 1/(2 Δφ) for a square one.

    spacing_deg: angle Δφ [degrees] between neighbouring receptors or ommatidia.
    lattice: "hexagon" or "square".

    Raises:
        ValueError: the angle is not positive, or the lattice is unknown.
    """
    one_of("lattice", lattice, PERIODS)
    return 1 / (PERIODS[lattice] * positive("spacing_deg", spacing_deg, "degrees"))


def anatomical_acuity(density: float, nodal_distance: float, lattice: str = "hexagon") -> float:
    """Return the frequency [cycles/degree] of the finest grating that a retina resolves, from its receptor density.

    If several receptors share a ganglion cell, use the density of ganglion cells instead.

    density: receptors per area [1/m²]. 1 per mm² is 1e6 per m².
    nodal_distance: posterior nodal distance [m]. A length x on the retina corresponds to the angle x/nodal_distance.
    lattice: "hexagon" or "square".

    Raises:
        ValueError: an argument is not positive, or the lattice is unknown.
    """
    cell = 1 / positive("density", density, "1/m²")
    one_of("lattice", lattice, PERIODS)
    spacing = math.sqrt(cell * 2 / math.sqrt(3)) if lattice == "hexagon" else math.sqrt(cell)
    return sampling_acuity(math.degrees(spacing / positive("nodal_distance", nodal_distance)), lattice)


def ideal_contrast_sensitivity(
    cycles_per_degree: Any, contrast: Any, photons: float, area: Any, d_prime: float = DETECTED
) -> np.ndarray:
    """Return the contrast sensitivity of an ideal observer for sine gratings, limited by photon noise alone.

    The observer knows the grating and weights the photons of all receptors by it. The threshold contrast c follows from

        d' = c T √(N A / 2),

    where T is the contrast that optics and receptors transfer, N the number of photons per area, and A the area of the
    grating, which has many periods. The sensitivity is 1/c. Source: Geisler (J. Opt. Soc. Am. A 1, 775, 1984), used by
    Banks, Geisler & Bennett (Vision Research 27, 1915, 1987).

    cycles_per_degree: frequencies of the gratings, an array of any shape. The result has the same shape.
    contrast: contrast T that optics and receptors transfer at these frequencies, in [0, 1], of the same shape. For
        example `mean_human_mtf(cycles_per_degree, 2e-3)`.
    photons: number N of photons that the receptors absorb from one square degree during the presentation.
        `PhotonBudget.photons` returns it, if the etendue is the pupil's area times (π/180)² times the fraction of the
        retina that receptors cover.
    area: area A of the grating [square degrees], a number or one for each frequency. For a square that is n periods
        wide and high, at the frequency u, it is (n/u)². For a grating with a smooth window, it is the integral of the
        squared window.
    d_prime: detectability d' at the threshold. 0.954 corresponds to 75 % correct choices between two intervals.

    Raises:
        ValueError: a number is outside its range, or arrays have different shapes.
    """
    u, transferred = reals("cycles_per_degree", cycles_per_degree), reals("contrast", contrast)
    sizes = reals("area", area)
    if u.shape != transferred.shape or sizes.shape not in ((), u.shape):
        raise ValueError(
            f"contrast has shape {transferred.shape} and area {sizes.shape}: must be {u.shape}, as frequencies"
        )
    for name, values in (("cycles_per_degree", u), ("contrast", transferred), ("area", sizes)):
        in_range(name, float(values.min(initial=0.0)), 0.0, math.inf)
    in_range("contrast", float(transferred.max(initial=0.0)), 0.0, 1.0)
    positive("photons", photons, "1")
    return np.asarray(transferred * np.sqrt(photons * sizes / 2) / positive("d_prime", d_prime, "1"))
