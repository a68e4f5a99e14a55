"""Acceptance function of an ommatidium: its sensitivity at several wavelengths, tabulated on a grid of directions.

A renderer draws rays from such a table, and a table's integral is the solid angle from which an ommatidium collects
light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.numerics.arguments import in_range, of_kind, wavelength_row
from optics.numerics.grid import Grid
from optics.numerics.read_only import ReadOnlyArrays
from optics.ommatidia.coupling import ModesAtPupil
from optics.ommatidia.ommatidium import STEEPEST, Ommatidium, coupled_modes

__all__ = ["AcceptanceFunction", "acceptance_function"]

PER_CYCLE = 8  # choice: number of samples per λ/D, the width of the finest detail
WIDER = 1.5  # choice: ratio of the widths of successive windows
DIGITS = 4.0  # choice: digits of amplitudes


@dataclass(frozen=True)
class AcceptanceFunction(ReadOnlyArrays):
    """Sensitivity of an ommatidium to the direction of a distant point source, on a grid of directions.

    The sensitivity is the power that the rhabdom absorbs, as a fraction of the power incident on the facet.

    sines: sines of the source's direction along one axis of the grid, ascending, (n,). The axes x and y have the same
        sines.
    values: sensitivity for each wavelength, 0 outside the unit circle, (band, y, x).
    """

    sines: np.ndarray
    values: np.ndarray

    @property
    def solid_angles(self) -> np.ndarray:
        """Solid angle [sr] of each direction's cell, ds_x ds_y / cos θ, (y, x); 0 outside the unit circle."""
        square = self.sines**2 + self.sines[:, None] ** 2
        cosine = np.sqrt(np.maximum(1 - square, 0))
        cell = float(self.sines[1] - self.sines[0]) ** 2
        found: np.ndarray = np.divide(cell, cosine, out=np.zeros_like(cosine), where=cosine > 0)
        return found

    @property
    def integrals(self) -> np.ndarray:
        """Integral of each wavelength's values over all directions [sr], (band,)."""
        found: np.ndarray = (self.values * self.solid_angles).sum(axis=(1, 2))
        return found


def acceptance_function(ommatidium: Ommatidium, wavelengths: np.ndarray, loss: float = 5e-3) -> AcceptanceFunction:
    """Return the acceptance function of an ommatidium: its sensitivity on a grid of directions.

    Calls with the same ommatidium and with equal wavelengths and loss return the same object. The grid is widened
    until, at each wavelength, it contains all but the fraction `loss` of the light that the waveguide modes of the
    rhabdom accept from all directions. It extends at most to sines of ±0.5 along each axis. If the ommatidium accepts
    light from a wider field, the grid misses more light than `loss`.

    wavelengths: vacuum wavelengths [m], (band,).
    loss: fraction in [1e-5, 0.1].

    Raises:
        ValueError: an argument is outside its valid range, the rhabdom guides no mode, the pupil's relief is a
            `PixelRelief`, or one of the pupil's parameters carries a derivative. See also `Waveguide.modes`.
    """
    of_kind("ommatidium", ommatidium, Ommatidium, "Ommatidium(FacetLens(25e-6, 14e-6), Waveguide(2e-6))")
    at = tuple(float(one) for one in wavelength_row(wavelengths))
    return _tabulated(ommatidium, at, in_range("loss", loss, 1e-5, 0.1))


@lru_cache(maxsize=256)
def _tabulated(ommatidium: Ommatidium, wavelengths: tuple[float, ...], loss: float) -> AcceptanceFunction:
    pupil = ommatidium.pupil
    pitch = min(at / (2 * pupil.radius * pupil.index_before(at) * PER_CYCLE) for at in wavelengths)
    half = max(at / pupil.radius for at in wavelengths) + ommatidium.rhabdom.diameter / ommatidium.rhabdom_distance
    while True:
        half = min(half, STEEPEST[-1])
        side = math.ceil(half / pitch)
        grid = Grid((2 * side + 1,) * 2, pitch)
        found, contained = zip(*(_accepted(ommatidium, at, grid) for at in wavelengths), strict=True)
        if min(contained) >= 1 - loss or half == STEEPEST[-1]:
            break
        half *= WIDER
    sines = pitch * np.arange(-side, side + 1)
    inside = sines**2 + sines[:, None] ** 2 < 1
    # The light of a source travels in the opposite direction, so both axes are reversed.
    return AcceptanceFunction(sines, np.stack(found)[:, ::-1, ::-1] * inside)


def _accepted(ommatidium: Ommatidium, wavelength: float, grid: Grid) -> tuple[np.ndarray, float]:
    """Return the sensitivity on a grid of sines of the light's direction, (y, x), and the part that the grid contains.

    This part is the integral of the sensitivity over the grid, divided by its integral over all sines.
    """
    steepest = math.hypot(grid.dx * grid.shape[0] / 2, grid.dx * grid.shape[1] / 2)
    coupled: ModesAtPupil = coupled_modes(ommatidium, wavelength, next((s for s in STEEPEST if s >= steepest), 1.0))
    taken = np.array([ommatidium.rhabdom.absorbed(mode) for mode in ommatidium.modes(wavelength)])
    values = np.maximum(coupled.power_on(grid, taken, DIGITS), 0)
    return values, float(values.sum() * grid.dx**2 / coupled.total(taken))
