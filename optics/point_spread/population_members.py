"""Members of a population, with the parameters that the common plan uses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.relief import BSplineRelief
from optics.elements.transmittance import GaussianMask, MaskMap
from optics.elements.wavefront import UM, Zernike
from optics.numerics.autodiff import Scalar, is_differentiable

__all__ = ["HIGHEST_ORDER", "Member", "powers"]

HIGHEST_ORDER = 12  # choice: highest order of Zernike polynomials; higher orders lose digits as sums of powers
MASK_LEVEL = 1e-3  # choice: neglected amplitude in a mask's spectrum


@dataclass(frozen=True, eq=False)
class Member:
    """One PSF of a population. Lengths are in m, and the wavelength is that in vacuum."""

    pupil: Pupil
    wavelength: float
    distance: Scalar
    source: Scalar

    @property
    def plain(self) -> bool:
        """True if the common plan supports the member.

        The plan supports a relief of at most 4 x 4 points, a Zernike wavefront up to HIGHEST_ORDER and known kinds of
        masks. It supports no derivatives.
        """
        pupil = self.pupil
        numbers = (pupil.aperture_radius, self.distance, self.source, pupil.thin_lens_focal_length)
        if pupil.n.is_differentiable or any(is_differentiable(value) for value in numbers):
            return False
        return self._plain_relief and self._plain_wavefront and self._plain_mask

    @property
    def _plain_relief(self) -> bool:
        relief = self.pupil.height
        return relief is None or (isinstance(relief, BSplineRelief) and not is_differentiable(relief.control_points))

    @property
    def _plain_wavefront(self) -> bool:
        known = self._wavefront
        return self.pupil.wavefront is known and (not known.asks and known.order <= HIGHEST_ORDER if known else True)

    @property
    def _wavefront(self) -> Zernike | None:
        return self.pupil.wavefront if isinstance(self.pupil.wavefront, Zernike) else None

    @property
    def _plain_mask(self) -> bool:
        mask = self.pupil.mask
        if isinstance(mask, GaussianMask):
            return not is_differentiable(mask.waist)
        return mask is None or (isinstance(mask, MaskMap) and not is_differentiable(mask.samples))

    @property
    def numbers(self) -> tuple[float, ...]:
        """Parameters as plain numbers, in this order:

        radius, wavelength in the medium behind the pupil, distances of sensor and source, and focal length [m]; index
        in front of the pupil divided by the index behind it; waist of a mask [m].
        """
        pupil, vacuum = self.pupil, self.wavelength
        focal = math.inf if pupil.thin_lens_focal_length is None else pupil.thin_lens_focal_length
        waist = pupil.mask.waist if isinstance(pupil.mask, GaussianMask) else math.inf
        behind = pupil.index_behind(vacuum)
        before = pupil.index_before(vacuum) / behind
        return pupil.radius, vacuum / behind, self.distance, self.source, focal, before, waist

    @property
    def relief(self) -> np.ndarray:
        """Control points of the relief in waves, without their mean.

        The mean does not affect the light, but it would reduce the precision of float32.
        """
        if self.pupil.height is None:
            return np.zeros((4, 4))
        heights = self.pupil.height.control_points - np.mean(self.pupil.height.control_points)
        waves: np.ndarray = heights * (self.pupil.index_step(self.wavelength) / self.wavelength)
        return waves

    @property
    def powers(self) -> np.ndarray:
        """Coefficients of `powers` in the wavefront, in waves, (term,)."""
        wavefront, known = self._wavefront, _indices(HIGHEST_ORDER)
        found = np.zeros(len(known))
        if wavefront is None:
            return found
        scale = 1.0 if wavefront.radius is None else self.pupil.radius / wavefront.radius
        for (n, m), value in wavefront.modes.items():
            if value == 0:
                continue
            for power, share in _radial(n, m):
                found[known[power, m]] -= value * UM / self.wavelength * share * scale**power
        found[known[0, 0]] = 0.0  # as for a relief, the constant term does not affect the light
        return found

    @property
    def order(self) -> int:
        """Highest order of the wavefront."""
        return 0 if self._wavefront is None else self._wavefront.order

    @property
    def detail(self) -> float:
        """Highest frequency [cycles per radius] of wavefront and mask, which adds to the frequencies due to slopes."""
        pupil, found = self.pupil, 0.0
        if pupil.wavefront is not None:
            found = pupil.wavefront.bandwidth(0.0)
            found *= 1.0 if pupil.wavefront.radius is None else pupil.radius / pupil.wavefront.radius
        return found if pupil.mask is None else found + pupil.mask.bandwidth(MASK_LEVEL, pupil.radius) * pupil.radius

    def mask(self, at: np.ndarray) -> np.ndarray | None:
        """Return the amplitudes (y, x) of a mask map at positions in radii along either axis; None for other masks."""
        mask = self.pupil.mask
        if not isinstance(mask, MaskMap):
            return None
        return mask.on_grid(at.astype(np.float64), self.pupil.radius)


def powers(x: np.ndarray, y: np.ndarray, order: int) -> np.ndarray:
    """Return ρ^k cos mθ and, for m < 0, ρ^k sin |m|θ for all |m| <= k <= order with k - m even, (term, *x.shape)."""
    turned, square = [np.ones(x.shape, complex)], x * x + y * y
    for _ in range(order):
        turned.append(turned[-1] * (x + 1j * y))
    found = [
        square ** ((k - abs(m)) // 2) * (turned[m].real if m >= 0 else turned[-m].imag) for k, m in _indices(order)
    ]
    return np.stack(found)


@lru_cache(maxsize=HIGHEST_ORDER + 1)
def _indices(order: int) -> dict[tuple[int, int], int]:
    """Return the index of every term (k, m) of `powers`, in ascending order of k."""
    pairs = [(k, m) for k in range(order + 1) for m in range(-k, k + 1, 2)]
    return {pair: place for place, pair in enumerate(pairs)}


@lru_cache(maxsize=(HIGHEST_ORDER + 1) * (HIGHEST_ORDER + 2))
def _radial(n: int, m: int) -> list[tuple[int, float]]:
    """Return the powers of ρ in Z_n^m and their coefficients (Thibos et al. 2002, eq. 3)."""
    m, norm = abs(m), math.sqrt((2 - (m == 0)) * (n + 1))
    return [
        (
            n - 2 * s,
            norm
            * (-1) ** s
            * math.factorial(n - s)
            / (math.factorial(s) * math.factorial((n + m) // 2 - s) * math.factorial((n - m) // 2 - s)),
        )
        for s in range((n - m) // 2 + 1)
    ]
