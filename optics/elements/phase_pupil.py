"""Pupils whose phase is the same at every wavelength, such as metasurfaces and liquid-crystal elements.

A relief of height h and refractive index n delays light by the path (n - object_n) h, where object_n is the index of
the medium in front of the pupil and around the relief. Its phase therefore falls as the wavelength rises. A geometric
phase does not depend on the wavelength. Such a phase is represented as a relief of a material for which n - object_n is
proportional to the wavelength. All methods and derivatives for pupils with a relief therefore apply.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from optics.elements.pixel_relief import PixelRelief
from optics.elements.pupil import Pupil
from optics.elements.refractive_index import Dispersion
from optics.elements.relief import HeightMap
from optics.numerics.arguments import flag, reals
from optics.numerics.autodiff import Scalar, is_differentiable

__all__ = ["phase_pupil"]

METRES_PER_RADIAN = 1e-9  # choice: height that represents one radian; its value has no effect
NOT_BOTH = {"height": "a pupil has a phase or a relief", "n": "a phase has no refractive index"}


@dataclass(frozen=True)
class SamePhase(Dispersion):
    """A material in which a height causes the same phase at every wavelength and in every surrounding medium."""

    def step(self, wavelength: float, before: float) -> Scalar:
        return wavelength / (2 * math.pi * METRES_PER_RADIAN)

    def _n(self, wavelength: float) -> Scalar:
        raise TypeError("a phase that is the same at every wavelength has no refractive index")


def phase_pupil(aperture_radius: Scalar, phase: Any, *, pixels: bool = False, **more: Any) -> Pupil:
    """Return a pupil with the transmittance exp(iφ(x, y)), where φ is the same at every wavelength.

    A lens of such a phase has a focal length proportional to 1/λ. A positive phase delays the wave, as glass does.

    aperture_radius: R [m].
    phase: φ [rad], (y, x), samples at cell centres over the pupil's square [-R, R]². A tensor of Dr.Jit or PyTorch
        carries derivatives.
    pixels: True if each of n x n samples fills its square cell, so that phases may jump, for example by 2π. False if
        cubic splines join the samples, which must then be unwrapped.
    more: further arguments of `Pupil`, apart from height and n.

    Raises:
        ValueError: an argument is invalid; see `Pupil`.
    """
    for name, why in NOT_BOTH.items():
        if name in more:
            raise ValueError(f"{name}: must be left out, because {why}")
    radians = phase if is_differentiable(phase) else reals("phase", phase)
    kind = PixelRelief if flag("pixels", pixels) else HeightMap
    return Pupil(aperture_radius, kind(radians * METRES_PER_RADIAN), SamePhase(), **more)
