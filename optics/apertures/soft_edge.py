"""Low-pass kernel that softens an aperture's edge.

The kernel is a jinc function multiplied by a Kaiser window along the radius. Convolution with the kernel leaves an
aperture's spectrum unchanged up to the frequency `passband` and makes it 0 beyond `stopband`, in both cases to within
`ripple`. The kernel is 0 beyond the radius `reach`. The transmittance therefore stays 1 or 0 at larger distances from
the edge. Lengths are in units of the pupil's radius R, frequencies in cycles per R.

If the pupil has a relief of square pixels, the light jumps at their borders. These jumps are softened by the product of
one kernel along x and one along y (`SoftEdge.line`), with the same Kaiser window and the same frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log10, pi

import numpy as np
from numpy.polynomial import Chebyshev

from optics.numerics.bessel import bessel_j

__all__ = ["SoftEdge", "kaiser_beta"]

MOST_STEPS = 60


@dataclass(frozen=True)
class SoftEdge:
    """Radially symmetric kernel whose spectrum falls from 1 at `passband` to 0 at `stopband`, to within `ripple`.

    Lengths are in pupil radii, and frequencies in cycles per pupil radius.
    """

    passband: float
    stopband: float
    ripple: float

    @classmethod
    def cheapest(
        cls, passband: float, ripple: float, widest_reach: float, half_widths: tuple[float, float] = (1.0, 1.0)
    ) -> SoftEdge:
        """Return the kernel that needs the fewest samples for an aperture with these half widths.

        Let t be the width of the transition from passband to stopband, h_x and h_y the half widths, and s their sum.
        The kernel is 0 beyond its reach b/t, where b = β/π with Kaiser's parameter β. The number of samples is
        proportional to (h_x + b/t) (h_y + b/t) (2 passband + t)². It is smallest at the only positive root of 2 h_x h_y
        t³ + b s t² - 2 b s passband t - 4 b² passband. If the reach would exceed `widest_reach` at this root, t is
        b/widest_reach instead.
        """
        b = _beta(ripple) / pi
        (h_x, h_y), s = half_widths, sum(half_widths)
        transition = max(
            _positive_root(2 * h_x * h_y, b * s, -2 * b * s * passband, -4 * b * b * passband), b / widest_reach
        )
        return cls(passband, passband + transition, ripple)

    @property
    def beta(self) -> float:
        return _beta(self.ripple)

    @property
    def reach(self) -> float:
        """Half width of the soft edge, β/(π t) with Kaiser's parameter β and the width t from passband to stopband."""
        return self.beta / (pi * (self.stopband - self.passband))

    @property
    def cycles(self) -> float:
        """Number of cycles of a wave of the frequency `stopband` over the kernel's radius `reach`.

        The kernel contains no frequencies above `stopband`, to within `ripple`.
        """
        return self.reach * self.stopband

    def ring(self, r: np.ndarray) -> np.ndarray:
        """Return 2π r g(r), the weight of the kernel g on the circle of radius r <= reach.

        r and `reach` are in units of the pupil's radius R, and the result is in units of 1/R. The integral from 0 to
        `reach` is 1.
        """
        return np.asarray(self._odd_series(np.minimum(r, self.reach)))

    def line(self, x: np.ndarray) -> np.ndarray:
        """Return the kernel along one axis [1/R] at positions x [R], where R is the pupil's radius.

        The kernel is 0 beyond `reach`. Its integral is 1.
        """
        found, inside = np.zeros(np.shape(x)), np.abs(x) < self.reach
        found[inside] = self._bare_line(x[inside]) / self._line_integral
        return found

    def line_response(self, frequencies: np.ndarray) -> np.ndarray:
        """Return the spectrum of `line` at frequencies from -`stopband` to `stopband`; 1 at frequency 0."""
        nodes, weights = self._line_nodes
        wave: np.ndarray = np.cos(2 * pi * np.multiply.outer(frequencies, nodes))
        found: np.ndarray = wave @ (weights * self._bare_line(nodes)) / self._line_integral
        return found

    @cached_property
    def _line_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        nodes, weights = np.polynomial.legendre.leggauss(int(24 + 8 * self.cycles + self.beta))
        return nodes * self.reach, weights * self.reach

    @cached_property
    def _line_integral(self) -> float:
        nodes, weights = self._line_nodes
        return float(weights @ self._bare_line(nodes))

    def _bare_line(self, x: np.ndarray) -> np.ndarray:
        """Return the kernel along one axis, as `line` does, but without scaling its integral to 1."""
        window = np.i0(self.beta * np.sqrt(np.maximum(1 - (x / self.reach) ** 2, 0)))
        found: np.ndarray = np.sinc((self.passband + self.stopband) * x) * window
        return found

    @cached_property
    def _odd_series(self) -> Chebyshev:
        """Chebyshev series of `ring`, which is continued as an odd function to radii from -reach to reach.

        `ring` is the kernel's weight on a circle, which contains a Bessel function. The series is used because tables
        evaluate `ring` at thousands of radii, and the Bessel function at each radius would take a hundred cosines. Only
        odd terms are retained, so the series is exactly 0 on the axis and has the correct slope.
        """
        degree, domain = 2 * int(24 + 4 * self.cycles + self.beta / 2) + 1, [-self.reach, self.reach]
        series = Chebyshev.interpolate(lambda r: np.sign(r) * self._bare(np.abs(r)), degree, domain)
        series.coef[::2] = 0
        whole = series.integ()
        return series / (whole(self.reach) - whole(0.0))

    def _bare(self, r: np.ndarray) -> np.ndarray:
        """Return the kernel's weight on circles of radius r, as `ring` does, but without scaling its integral to 1."""
        cutoff = (self.passband + self.stopband) / 2
        window = np.i0(self.beta * np.sqrt(np.maximum(1 - (r / self.reach) ** 2, 0)))
        return bessel_j(1, 2 * pi * cutoff * r) * window


def _positive_root(a: float, b: float, c: float, d: float) -> float:
    """Return the positive root of at³ + bt² + ct + d, where a and b are positive and c and d are negative or 0.

    If c and d are 0, the result is 0. Newton's iteration starts above the root and descends monotonically.
    """
    # At this t the positive terms outweigh the negative ones.
    t = max(-2 * c / b, (-4 * c / a) ** 0.5, (-4 * d / a) ** (1 / 3))
    if t == 0:
        return 0.0
    for _ in range(MOST_STEPS):
        step = (((a * t + b) * t + c) * t + d) / ((3 * a * t + 2 * b) * t + c)
        t -= step
        if step <= 1e-12 * t:
            break
    return t


def _beta(ripple: float) -> float:
    """Return Kaiser's parameter β for a radially symmetric kernel in the plane, from the ripple of its spectrum.

    Kaiser's rule applies to one dimension. In the plane, side lobes from all directions add up at frequency 0. For the
    worst width of the passband, their sum is up to 7 times a ripple of 0.5, 20 times a ripple of 1e-6, and 50 times a
    ripple of 1e-12. Kaiser's rule is therefore applied to a ripple divided by a factor. The factors chosen for these
    three ripples, 10, 27 and 82, leave a margin. tests/optics/apertures/test_aperture.py checks that the spectrum stays
    below the ripple.

    ripple: largest deviation of the kernel's spectrum from 1 in the passband and from 0 in the stopband.
    """
    return kaiser_beta(ripple**1.08 / 9)


def kaiser_beta(ripple: float) -> float:
    """Return the parameter β of a Kaiser window for a ripple in one dimension, by Kaiser's rule, but at least 1.

    Source: Oppenheim & Schafer, Discrete-Time Signal Processing, §7.5.
    """
    attenuation = -20 * log10(ripple)
    if attenuation > 50:
        return 0.1102 * (attenuation - 8.7)
    return max(1.0, 0.5842 * max(attenuation - 21, 0.0) ** 0.4 + 0.07886 * max(attenuation - 21, 0.0))
