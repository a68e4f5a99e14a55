"""Published numberings of Zernike polynomials, which differ in order and normalisation.

Each function converts a number of one numbering to a mode (n, m) of OSA and ANSI. Cosine modes have m > 0, sine modes
m < 0, with the angle measured from x towards y.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from optics.numerics.arguments import finite, is_sized, plain_reals, shown, whole
from optics.numerics.autodiff import is_differentiable, of_torch

__all__ = ["FRINGE", "HIGHEST", "NOLL", "fringe_mode", "modes_of_vector", "noll_mode", "numbered", "osa_mode"]

HIGHEST = 30  # choice: highest radial order
NOLL = (HIGHEST + 1) * (HIGHEST + 2) // 2
FRINGE = 36  # at number 37, some programs have (12, 0) and others (6, 6)

Mode = tuple[int, int]


def osa_mode(j: int) -> Mode:
    """Return the mode with the index j = (n(n + 2) + m)/2 of OSA and ANSI Z80.28, from 0 on."""
    n = (math.isqrt(8 * j + 1) - 1) // 2
    return n, 2 * j - n * (n + 2)


def noll_mode(j: int) -> Mode:
    """Return the mode with the number j of Noll, from 1 on (J. Opt. Soc. Am. 66, 207, 1976, table I).

    Within an order n, |m| increases. For m ≠ 0, even numbers are cosine modes, and odd numbers are sine modes.

    Raises:
        ValueError: j is not a whole number from 1 to 496.
    """
    j = whole("Noll number", j, 1, NOLL)
    n = (math.isqrt(8 * j - 7) - 1) // 2
    place = j - n * (n + 1) // 2  # 1 to n + 1
    m = 2 * (place // 2) if n % 2 == 0 else 2 * ((place - 1) // 2) + 1
    return n, m if j % 2 == 0 else -m


def fringe_mode(j: int) -> Mode:
    """Return the Zernike mode (n, m) that has the number j, from 1 on, in the Fringe set of the University of Arizona.

    Modes with equal sums of the radial order n and the absolute azimuthal order |m| form a group, in which |m|
    decreases. Each cosine mode precedes its sine mode. Source: J. Loomis, FRINGE user's manual, University of Arizona
    (1976).

    Raises:
        ValueError: j is not a whole number from 1 to 36.
    """
    j = whole("Fringe number", j, 1, FRINGE)
    group = math.isqrt(j - 1)  # (n + |m|)/2
    place = j - group**2 - 1  # 0 to 2 group
    m = group - place // 2
    return 2 * group - m, m if place % 2 == 0 else -m


def numbered(given: Any, mode: Callable[[int], Mode]) -> dict[Mode, Any]:
    """Return Zernike coefficients by mode, {(n, m): coefficient}, from coefficients by number.

    The number of a polynomial is its place in a published order, such as Noll's.

    given: {number: coefficient}, or a sequence of coefficients, the first of which has the number 1.
    mode: function that converts a number to a mode (n, m), such as `noll_mode`.

    Raises:
        ValueError: `given` is of another kind, a number does not exist, or a coefficient is not finite.
    """
    if isinstance(given, Mapping):
        for j, value in given.items():
            finite(f"coefficients_um[{shown(j)}]", value, carried=True)
        return {mode(j): value for j, value in given.items()}
    if (is_differentiable(given) and not of_torch(given)) or isinstance(given, str) or not is_sized(given):
        raise ValueError(f"coefficients_um = {shown(given)}: must be {{number: µm}}, or a row [µm] from number 1 on")
    return numbered(dict(enumerate(given, start=1)), mode)


def modes_of_vector(given: Any) -> dict[Mode, float]:
    """Return coefficients by mode, {(n, m): coefficient}, from a vector in the order of the OSA index.

    Derivatives that the vector carries are dropped.

    Raises:
        ValueError: the argument is not a vector of 1 to 496 finite numbers.
    """
    vector = plain_reals("coefficients_um", given)
    if vector.ndim != 1 or not 0 < vector.size <= NOLL:
        raise ValueError(
            f"coefficients_um has shape {vector.shape}: must be {{(n, m): µm}}, or a vector of 1 to {NOLL} [µm]"
        )
    if not np.isfinite(vector).all():
        raise ValueError("coefficients_um holds NaN or infinity: must be finite [µm]")
    return {osa_mode(j): float(value) for j, value in enumerate(vector)}
