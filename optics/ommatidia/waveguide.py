"""A rhabdom as a waveguide: guided modes of a thin cylinder whose refractive index exceeds that of the surroundings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from optics.elements.refractive_index import Dispersion, index_of
from optics.numerics.arguments import positive, reals, vacuum_wavelength

__all__ = ["Mode", "Waveguide"]

MOST_V = 60.0  # choice: about a thousand modes, where ray optics is accurate enough
EDGE = 1e-9  # margin for rounding next to the poles of the equation


@dataclass(frozen=True)
class Mode:
    """A linearly polarised mode LP_lm of a step-index cylinder.

    It has l dark planes through the axis and m - 1 dark rings. Sources: Gloge, Appl. Opt. 10, 2252, 1971; Snyder &
    Love, Optical Waveguide Theory, ch. 14.

    u, w: U and W, solutions of the mode equation with U² + W² = V².
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
        """Return the amplitude ψ [1/m] at (x, y) [m], with ∫ψ² = 1: J_l(Ur/b) in the core and K_l(Wr/b) outside."""
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

        The fraction is (W² + U²κ)/V² with κ = K_l²/(K_{l-1} K_{l+1}) (Gloge 1971, eq. 17).
        """
        square = self.u**2 + self.w**2
        return 1 - self.u**2 / square * (1 - self._kappa())

    def _kappa(self) -> float:
        from scipy.special import kve

        below, here, above = (float(kve(abs(order), self.w)) for order in (self.l - 1, self.l, self.l + 1))
        return here * here / (below * above)

    def _square(self) -> float:
        """Return the integral of the squared field, scaled to 1 at the core's edge, in closed form."""
        azimuth = math.pi * (2 if self.l == 0 else 1)
        outside = self.radius**2 / 2 * (1 / self._kappa() - 1)
        return azimuth * outside / (1 - self.core_share)


@dataclass(frozen=True)
class Waveguide:
    """A waveguide with the shape of a straight cylinder: a rhabdom or a rhabdomere.

    diameter: diameter [m] of the core.
    n_core, n_clad: refractive indices of core and surroundings, constant or dispersive. The index of the core should be
        only slightly larger, because modes are computed for weak guiding.
    length: length [m] over which light is absorbed (None: all guided light is absorbed).
    absorption: absorption coefficient of the core [1/m] at the pigment's peak. A mode loses the fraction 1 -
        exp(-absorption · core_share · length) of its light.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    diameter: float
    n_core: float | Dispersion = 1.363
    n_clad: float | Dispersion = 1.340
    length: float | None = None
    absorption: float = 6e3

    def __post_init__(self) -> None:
        positive("diameter", self.diameter)
        index_of("n_core", self.n_core)
        index_of("n_clad", self.n_clad)
        if self.length is not None:
            positive("length", self.length)
        positive("absorption", self.absorption, "1/m")

    def v_number(self, wavelength: float) -> float:
        """Return V = πd/λ √(n_core² - n_clad²) at a vacuum wavelength [m]. Below 2.405 there is a single mode.

        Raises:
            ValueError: the index of the core is not above that of the surroundings, or V is above 60.
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
        """Return the guided modes at a vacuum wavelength [m], the best confined first. Modes with l >= 1 come in pairs.

        Raises:
            ValueError: see `v_number`.
        """
        v, found = self.v_number(wavelength), []
        for l in range(math.ceil(v) + 1):
            for m, u in enumerate(_roots(l, v), start=1):
                mode = Mode(l, m, u, math.sqrt(v * v - u * u), self.diameter / 2)
                found += [mode] if l == 0 else [mode, Mode(l, m, u, mode.w, mode.radius, True)]
        return tuple(sorted(found, key=lambda mode: mode.u))

    def absorbed(self, mode: Mode) -> float:
        """Return the fraction of a mode's light that is absorbed along the whole length."""
        return 1.0 if self.length is None else 1 - math.exp(-self.absorption * mode.core_share * self.length)


@lru_cache(maxsize=4096)
def _roots(l: int, v: float) -> tuple[float, ...]:
    """Return U of all guided modes of azimuthal order l: the roots of U J_{l+1}(U)/J_l(U) = W K_{l+1}(W)/K_l(W).

    Here W² = v² - U².

    Each mode above its cut-off has one root, between a zero of J_{l-1} and the next zero of J_l.
    """
    from scipy.optimize import brentq
    from scipy.special import jn_zeros, jv, kve

    def difference(u: float) -> float:
        w = math.sqrt(max(v * v - u * u, 0.0))
        return float(u * jv(l + 1, u) * kve(l, w) - w * kve(l + 1, w) * jv(l, u))

    count = int(v / math.pi) + 2
    poles = [at for at in jn_zeros(l, count) if at > 0]
    cutoffs = [0.0, *jn_zeros(1, count)] if l == 0 else list(jn_zeros(l - 1, count))
    found = []
    for low, high in zip(cutoffs, poles, strict=False):
        if low >= v:
            break
        ends = low + EDGE * max(low, 1), min(high, v) - EDGE * v
        if ends[0] < ends[1] and difference(ends[0]) * difference(ends[1]) < 0:
            found.append(float(brentq(difference, *ends, xtol=1e-13)))
    return tuple(found)
