"""The vector focus of symmetric light: Richards and Wolf's three integrals.

B. Richards and E. Wolf, Proc. R. Soc. A 253, 358 (1959), eqs. 2.30 to 2.32. Each direction θ contributes a plane wave,
whose field is rotated with the ray. If the amplitude on the sphere about the focus is a(θ), the field of light
polarised along x near the focus is

    E = (I₀ + I₂ cos 2φ, I₂ sin 2φ, -2i I₁ cos φ),   Iₘ = kz/2 ∫ a cₘ sin θ Jₘ(kρ sin θ) e^{ikW} dθ,

    c₀ = 1 + cos θ,  c₁ = sin θ,  c₂ = 1 - cos θ,

where ρ and φ are polar coordinates in the focal plane, z is the radius of the sphere, and W(θ) [m] is the wavefront
error on it.

An evenly illuminated flat pupil (r = z tan θ) has a = 1/cos θ: with c₀ = 2 and the others 0 this is the
Rayleigh-Sommerfeld integral for large kz. An aplanatic lens (r = z sin θ) has a = √cos θ.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = ["Light", "focal_integrals"]

SPARE = 60  # choice: nodes beyond π per cycle, above which Gauss-Legendre quadrature converges


@dataclass(frozen=True)
class Light:
    """Light on the pupil.

    at: function that returns a(θ) e^{ikW(θ)} for angles θ.
    cycles: upper bound on the cycles of e^{ikW} between the rims.
    """

    at: Callable[[np.ndarray], np.ndarray]
    cycles: float = 0.0


def focal_integrals(
    rho: np.ndarray, wavenumber: float, distance: float, ends: tuple[float, float], light: Light
) -> np.ndarray:
    """Return I₀, I₁ and I₂ at the radii `rho` [m], and the integral of scalar theory, (4, radius), complex.

    wavenumber: k [1/m] in the medium.
    distance: z [m].
    ends: θ of the pupil's inner and outer rim.
    light: amplitude from each direction.
    """
    from scipy.special import jv, roots_legendre

    low, high = ends
    outermost = float(np.max(rho, initial=0.0))
    cycles = wavenumber * outermost * (math.sin(high) - math.sin(low)) / (2 * math.pi) * 2 + light.cycles
    nodes, weights = roots_legendre(math.ceil(1.2 * math.pi * cycles) + SPARE)
    theta = low + (high - low) * (nodes + 1) / 2
    sine, cosine = np.sin(theta), np.cos(theta)
    amplitude = light.at(theta) * sine * weights * (high - low) * wavenumber * distance / 4
    places = wavenumber * np.outer(rho, sine)
    found = [jv(0, places) @ (amplitude * (1 + cosine)), jv(1, places) @ (amplitude * sine)]
    found += [jv(2, places) @ (amplitude * (1 - cosine)), jv(0, places) @ (2 * amplitude)]
    return np.array(found)
