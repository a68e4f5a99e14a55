"""A rhabdom as a waveguide: guided modes of a thin cylinder whose refractive index exceeds that of the surroundings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from optics.elements.refractive_index import Dispersion, index_of
from optics.numerics.arguments import positive, reals, vacuum_wavelength
from optics.numerics.quadrature import gauss_legendre

__all__ = ["Mode", "Waveguide"]

MOST_V = 60.0  # choice: about a thousand modes, where ray optics is accurate enough
EDGE = 1e-9  # margin for rounding next to the poles of the equation
NODES = 32  # choice: nodes along a taper; the error of the mean share in the core is below 2e-6
GRADING = 2  # choice: power by which the nodes gather at a cut-off, where the share in the core has a kink


@dataclass(frozen=True)
class Mode:
    """A linearly polarised mode LP_lm of a step-index cylinder.

    It has l dark planes through the axis and m - 1 dark rings. Sources: Gloge, Appl. Opt. 10, 2252, 1971; Snyder &
    Love, Optical Waveguide Theory, ch. 14.

    u, w: U and W, solutions of the mode equation with U² + W² = V² for the waveguide parameter V (`v_number`).
    radius: radius b of the core [m].
    sine: True for a mode with sin lφ, False with cos lφ. Modes with l >= 1 come in such pairs.
    """

    l: int
    m: int
    u: float
    w: float
    radius: float
    sine: bool = False

    def field(self, x: Any, y: Any) -> np.ndarray:
        """Return the amplitude ψ [1/m] at (x, y) [m], with ∫ψ² = 1.

        The amplitude is proportional to J_l(Ur/b) cos lφ in the core and to K_l(Wr/b) cos lφ outside. If `sine` is
        True, sin lφ replaces cos lφ in both. Here r is the distance from the axis, φ the azimuth, and b the radius of
        the core. J and K are Bessel's functions, and U and W are the solutions `u` and `w` of the mode equation.

        x, y: positions relative to the waveguide's axis, in arrays whose shapes broadcast.

        Raises:
            ValueError: a position is not a real number, or shapes do not broadcast.
        """
        from scipy.special import jv, kve

        x, y = np.broadcast_arrays(reals("x", x), reals("y", y))
        r, phi = np.hypot(x, y) / self.radius, np.arctan2(y, x)
        inside = r <= 1
        core = jv(self.l, self.u * np.where(inside, r, 1)) / jv(self.l, self.u)
        out = np.where(inside, 1, r)
        clad = kve(self.l, self.w * out) / kve(self.l, self.w) * np.exp(-self.w * (out - 1))
        around = np.sin(self.l * phi) if self.sine else np.cos(self.l * phi)
        return np.asarray(np.where(inside, core, clad) * around / math.sqrt(self._square()))

    @property
    def core_share(self) -> float:
        """Fraction of the mode's light that travels within the core and can be absorbed.

        The fraction is (W² + U²κ)/V² with κ = K_l²/(K_{l-1} K_{l+1}) at W (Gloge 1971, eq. 17).
        """
        square = self.u**2 + self.w**2
        return 1 - self.u**2 / square * (1 - self._kappa())

    @property
    def cut_off(self) -> float:
        """Waveguide parameter V below which the mode is not guided: a zero of J_{l-1}, and 0 for LP01."""
        return _brackets(self.l, self.m)[self.m - 1][0]

    def _kappa(self) -> float:
        from scipy.special import kve

        below, here, above = (float(kve(abs(order), self.w)) for order in (self.l - 1, self.l, self.l + 1))
        return here * here / (below * above)

    def _square(self) -> float:
        """Return the integral of the square of the mode's field, in closed form.

        The field is scaled so that its maximum along the edge of the waveguide's core is 1.
        """
        azimuth = math.pi * (2 if self.l == 0 else 1)
        outside = self.radius**2 / 2 * (1 / self._kappa() - 1)
        return azimuth * outside / (1 - self.core_share)


@dataclass(frozen=True)
class Waveguide:
    """A straight, round waveguide: a rhabdom or a rhabdomere. It is a cylinder, or tapers from its tip to its far end.

    In a taper, light enters the modes of the tip, and each mode keeps its light while it becomes the local mode of the
    thinner guide (Snyder & Love, ch. 19). A mode that reaches its cut-off loses its remaining light. This model holds
    for slow tapers: the slope of the radius b along the guide is at most b divided by the beat length 2π/(β₁ - β₂). β₁
    is the propagation constant of the mode LP01, and β₂ that of LP02 or, if LP02 is not guided, of light in the
    surroundings (Love et al., IEE Proc. J 138, 343, 1991). Tapers that exceed this slope at the tip are refused.

    diameter: diameter [m] of the core at the tip, where light enters.
    n_core, n_clad: refractive indices of core and surroundings, constant or dispersive. The index of the core should be
        only slightly larger, because modes are computed for weak guiding.
    length: length [m] over which light is absorbed (None: all guided light is absorbed).
    absorption: absorption coefficient of the core [1/m] at the pigment's peak. A mode loses the fraction 1 -
        exp(-absorption · core_share · length) of its light, where `Mode.core_share` is the fraction that travels in the
        core.
    proximal_diameter: diameter [m] of the core at its far, proximal end, at most `diameter` (None: equal to it). The
        diameter falls linearly between the ends, and core_share is averaged over the length on which the mode is
        guided.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    diameter: float
    n_core: float | Dispersion = 1.363
    n_clad: float | Dispersion = 1.340
    length: float | None = None
    absorption: float = 6e3
    proximal_diameter: float | None = None

    def __post_init__(self) -> None:
        positive("diameter", self.diameter)
        index_of("n_core", self.n_core)
        index_of("n_clad", self.n_clad)
        if self.length is not None:
            positive("length", self.length)
        positive("absorption", self.absorption, "1/m")
        if self.proximal_diameter is not None:
            end = positive("proximal_diameter", self.proximal_diameter)
            if end > self.diameter:
                raise ValueError(f"proximal_diameter = {end:g} m: must be at most diameter = {self.diameter:g} m")
            if self.length is None:
                raise ValueError(f"length = None: must be a length in m, because proximal_diameter = {end:g} m")

    def v_number(self, wavelength: float) -> float:
        """Return V = πd/λ √(n_core² - n_clad²) of the tip, of diameter d, at a vacuum wavelength λ [m].

        Below 2.405, only the mode LP01 exists.

        Raises:
            ValueError: the index of the core is not above that of the surroundings, V is above 60, or the wavelength is
                invalid.
        """
        at = vacuum_wavelength(wavelength)
        core, clad = (index_of(name, getattr(self, name)).at(at) for name in ("n_core", "n_clad"))
        if core <= clad:
            raise ValueError(f"n_core = {core:g} at {at:g} m: must be greater than n_clad = {clad:g}")
        v = math.pi * self.diameter / at * math.sqrt(core**2 - clad**2)
        if v > MOST_V:
            raise ValueError(f"V = {v:.3g} at {at:g} m: must be at most {MOST_V:g}, for a diameter in m")
        return v

    def modes(self, wavelength: float) -> tuple[Mode, ...]:
        """Return the modes guided at the tip, where light enters, at a vacuum wavelength [m], the best confined first.

        Modes with l >= 1 come in pairs. The result is empty if V is very small, such as 0.3: light then travels almost
        only outside the core.

        Raises:
            ValueError: see `v_number`, or the guide tapers too fast for light to stay in its mode.
        """
        v, found = self.v_number(wavelength), []
        for l in range(math.ceil(v) + 1):
            for m, u in enumerate(_roots(l, v), start=1):
                mode = Mode(l, m, u, math.sqrt(v * v - u * u), self.diameter / 2)
                found += [mode] if l == 0 else [mode, Mode(l, m, u, mode.w, mode.radius, True)]
        self._check_taper(vacuum_wavelength(wavelength), [mode.u for mode in found if mode.l == 0], v)
        return tuple(sorted(found, key=lambda mode: mode.u))

    def _check_taper(self, wavelength: float, axial: list[float], v: float) -> None:
        """Refuse a taper that, at the tip, narrows too fast for light to stay in the mode LP01.

        axial: the solutions U of the mode equation for the modes with l = 0.
        """
        if self.length is None or self.proximal_diameter is None or not axial:
            return
        first, second = [*axial, v][:2]
        # β₁ - β₂ = (U₂² - U₁²)/(2 k n b²), and the radius b may change by b (β₁ - β₂)/2π per length.
        n = index_of("n_core", self.n_core).at(wavelength)
        steepest = (second**2 - first**2) * wavelength / (4 * math.pi**2 * n * self.diameter)
        least = (self.diameter - self.proximal_diameter) / (2 * steepest)
        if self.length < least:
            raise ValueError(
                f"length = {self.length:g} m: must be at least {least:.3g} m at a wavelength of {wavelength:g} m, "
                f"for a taper to proximal_diameter = {self.proximal_diameter:g} m in which light stays in its mode"
            )

    def guided_length(self, mode: Mode) -> float:
        """Return the length [m] from the tip over which the guide is wide enough for a mode; inf if length is None."""
        if self.length is None:
            return math.inf
        v, end = self._v_range(mode)
        return self.length if end > mode.cut_off or end == v else self.length * (v - mode.cut_off) / (v - end)

    def absorbed(self, mode: Mode) -> float:
        """Return the fraction of a mode's light that the waveguide absorbs; 1 if `length` is None.

        The light of a mode is absorbed along the whole length or, in a taper that becomes too narrow to guide the mode,
        only up to the place where it does so. The absorption per length is proportional to `Mode.core_share`, the
        fraction of the light that travels in the core. In a taper, this fraction changes along the guide. Its mean is
        computed by quadrature, with an error below 2e-6.
        """
        if self.length is None:
            return 1.0
        share = mode.core_share if self.proximal_diameter is None else self._mean_core_share(mode)
        return 1 - math.exp(-self.absorption * share * self.guided_length(mode))

    def _v_range(self, mode: Mode) -> tuple[float, float]:
        """Return V at the tip and at the far end, at the wavelength of a mode."""
        v = math.hypot(mode.u, mode.w)
        return v, v if self.proximal_diameter is None else v * self.proximal_diameter / self.diameter

    def _mean_core_share(self, mode: Mode) -> float:
        """Return the mean of the local mode's `Mode.core_share`, over the length on which the mode is guided."""
        v, end = self._v_range(mode)
        low = max(end, mode.cut_off)
        node, weight = gauss_legendre(NODES)
        shares = [_core_share(mode.l, mode.m, float(at)) for at in low + (v - low) * node**GRADING]
        return float(GRADING * node ** (GRADING - 1) * weight @ shares)


@lru_cache(maxsize=65536)
def _core_share(l: int, m: int, v: float) -> float:
    """Return `Mode.core_share` of the mode LP_lm at V.

    If V is too near the cut-off for a computation, the result is the limit at the cut-off: 1 - 1/l, and 0 for l = 0.
    """
    u = _root(l, *_brackets(l, m)[m - 1], v)
    share = math.nan if u is None else Mode(l, m, u, math.sqrt(v * v - u * u), 1.0).core_share
    return share if math.isfinite(share) else 1 - 1 / max(l, 1)


@lru_cache(maxsize=4096)
def _brackets(l: int, count: int) -> list[tuple[float, float]]:
    """Return the least and the largest U of each of the first `count` modes of azimuthal order l.

    U is the mode parameter for the core, which increases with the waveguide parameter V. At the mode's cut-off, the
    least V at which the mode is guided, U equals V. The largest U, the limit for large V, is a zero of J_l.
    """
    from scipy.special import jn_zeros

    cutoffs = [0.0, *jn_zeros(1, count)] if l == 0 else list(jn_zeros(l - 1, count))
    return [(float(low), float(high)) for low, high in zip(cutoffs, jn_zeros(l, count), strict=False)]


@lru_cache(maxsize=4096)
def _roots(l: int, v: float) -> tuple[float, ...]:
    """Return the mode parameters U of all guided modes of azimuthal order l at the waveguide parameter V = v."""
    found = (_root(l, low, high, v) for low, high in _brackets(l, int(v / math.pi) + 2) if low < v)
    return tuple(u for u in found if u is not None)


def _root(l: int, low: float, high: float, v: float) -> float | None:
    """Return the root of U J_{l+1}(U)/J_l(U) = W K_{l+1}(W)/K_l(W) between low and high; None without a root.

    Here W² = v² - U². The roots are the mode parameters U of a waveguide with the waveguide parameter V = v. Each
    guided mode of azimuthal order l has one root, between a zero of J_{l-1} and the next zero of J_l.
    """
    from scipy.optimize import brentq
    from scipy.special import jv, kve

    def difference(u: float) -> float:
        w = math.sqrt(max(v * v - u * u, 0.0))
        return float(u * jv(l + 1, u) * kve(l, w) - w * kve(l + 1, w) * jv(l, u))

    ends = low + EDGE * max(low, 1), min(high, v) - EDGE * v
    if ends[0] < ends[1] and difference(ends[0]) * difference(ends[1]) < 0:
        return float(brentq(difference, *ends, xtol=1e-13))
    return None
