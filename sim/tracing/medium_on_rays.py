"""Absorption and veiling light of water or air between a surface and an eye, for code in Dr.Jit kernels."""

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
        """Return the medium for a tracer whose components of light are the spectral bands, each divided by a factor.

        basis: matrix with these factors on its diagonal and 0 elsewhere, (component, band)
        """
        veil = medium.veil / np.diag(basis)
        return cls(tuple(map(float, np.maximum(medium.attenuation, LEAST))), tuple(map(float, veil)))

    def through(self, radiance: Sequence[Array], distance: Array) -> list[Array]:
        """Return the radiance that arrives at the eye from surfaces of a given radiance, one array per spectral band.

        For a ray that hits no surface, the result is the veiling light.

        distance: distances of the surfaces [m]; infinite for rays that hit no surface
        """
        return [v + more for v, more in zip(self.veil, self.contrasts(radiance, [distance]), strict=True)]

    def contrasts(self, radiance: Sequence[Array], distances: Sequence[Array], share: Array | float = 1) -> list[Array]:
        """Return a surface's contrast with the veiling light, reduced by the way to the eye, one array per band.

        The contrast is share · (L - V) exp(-c d), with the surface's radiance L and distance d, the veiling light V and
        the medium's attenuation coefficient c.

        radiance: share · L
        distances: values of d [m]; the mean of exp(-c d) over them is used
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
        """Return a surface's contrast with the veiling light for each spectral band, and a list of as many ones.

        The contrast is (reflectance · light - veiling light) · transmission of the medium. Without a medium, a caller
        multiplies the light on the surface by the reflectance. With a medium, the same code multiplies the two returned
        lists: the contrasts in place of the light, and the ones in place of the reflectance.

        light: light on the surface, one array per spectral band
        distances: distances from the eye [m], over which the transmission is averaged
        """
        sent = [r * e for r, e in zip(reflectance, light, strict=True)]
        return self.contrasts(sent, distances), [mi.Float(1)] * len(sent)
