"""Absorption and veiling light of water or air between a surface and an eye, inside kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics import BandMedium
from optics.numerics.autodiff import Array

FARTHEST = 1e9  # [m] replaces an infinite distance
LEAST = 1e-6  # [1/m] smallest coefficient; a path of length FARTHEST is then opaque


@dataclass(frozen=True)
class MediumOnRays:
    """A medium in the components of a tracer, each of which is one band.

    A surface of radiance L appears at the distance d with the radiance L exp(-c d) + V (1 - exp(-c d)).

    attenuation: coefficient c of each component [1/m]
    veil: veiling light V, the radiance of a path of infinite length, per component
    """

    attenuation: tuple[float, ...]
    veil: tuple[float, ...]

    @classmethod
    def from_bands(cls, medium: BandMedium, basis: np.ndarray) -> MediumOnRays:
        """Return the medium for a tracer whose `basis` (component, band) is diagonal: components are scaled bands."""
        veil = medium.veil / np.diag(basis)
        return cls(tuple(map(float, np.maximum(medium.attenuation, LEAST))), tuple(map(float, veil)))

    def through(self, radiance: Sequence[Array], distance: Array) -> list[Array]:
        """Return the radiance that arrives from surfaces of this radiance at these distances [m], per component.

        A ray that hits no surface has an infinite distance, and the result is V.
        """
        return [v + more for v, more in zip(self.veil, self.contrasts(radiance, [distance]), strict=True)]

    def contrasts(self, radiance: Sequence[Array], distances: Sequence[Array], share: Array | float = 1) -> list[Array]:
        """Return share · (L - V) exp(-c d), the contrast of surfaces with the veiling light, per component.

        radiance: share · L, where L is the radiance of the surface
        distances: distances d [m], over which exp(-c d) is averaged
        share: fraction of an area that the surface fills
        """
        near = [dr.minimum(d, FARTHEST) for d in distances]
        found = []
        for own, c, v in zip(radiance, self.attenuation, self.veil, strict=True):
            passed = sum(dr.exp(-c * d) for d in near) * (1 / len(near))
            found.append(passed * (own - share * v))
        return found

    def reflected_contrasts(
        self, reflectance: Sequence[Array], light: Sequence[Array], distances: Sequence[Array]
    ) -> tuple[list[Array], list[Array]]:
        """Return the contrasts of a surface that reflects this light, and factors of 1 in place of its reflectances."""
        sent = [r * e for r, e in zip(reflectance, light, strict=True)]
        return self.contrasts(sent, distances), [mi.Float(1)] * len(sent)
