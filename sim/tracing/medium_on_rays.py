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
    """A medium, such as water or hazy air, that attenuates light and adds veiling light on the way to an eye.

    A surface of radiance L appears at the distance d with the radiance L exp(-c d) + V (1 - exp(-c d)). The tracer's
    components of light are spectral bands, and each band has its own c and V.

    attenuation: coefficient c of each component [1/m]
    veil: veiling light V of each component, the radiance of a path of infinite length
    """

    attenuation: tuple[float, ...]
    veil: tuple[float, ...]

    @classmethod
    def from_bands(cls, medium: BandMedium, basis: np.ndarray) -> MediumOnRays:
        """Return the medium for a tracer whose `basis` (component, band) is diagonal: components are scaled bands."""
        veil = medium.veil / np.diag(basis)
        return cls(tuple(map(float, np.maximum(medium.attenuation, LEAST))), tuple(map(float, veil)))

    def through(self, radiance: Sequence[Array], distance: Array) -> list[Array]:
        """Return the radiance that arrives at the eye from surfaces of a given radiance, per component.

        For a ray that hits no surface, the result is the veiling light.

        distance: distances of the surfaces [m]; infinite for rays that hit no surface
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
        """Return a surface's contrast with the veiling light per component, and the factor 1 for each component.

        The contrast is the surface's radiance (reflectance times light) minus the veiling light, times the transmission
        of the medium. Without a medium, a caller multiplies the light on the surface by the reflectances. With a
        medium, it uses the contrasts in place of the light, and the factors 1 in place of the reflectances.

        light: light on the surface, per component
        distances: distances from the eye [m], over which the transmission is averaged
        """
        sent = [r * e for r, e in zip(reflectance, light, strict=True)]
        return self.contrasts(sent, distances), [mi.Float(1)] * len(sent)
