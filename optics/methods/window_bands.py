"""Bands of spatial frequencies of the light in pupils, which determine soft edges and numbers of samples.

The light of a ray has a frequency in the pupil's plane: the number of cycles of its phase per radius of the pupil. The
edge of the pupil diffracts the light of a ray to a band of frequencies around the frequency of the ray. From these
bands, `window_edges` chooses how gradually the transmittance falls at the edge, and how many samples a pupil needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["EDGES", "Bands", "in_steps", "medians"]

EDGES = 4  # choice: number of sharpnesses of the edge per octave; equal ones share tables


@dataclass(frozen=True, eq=False)
class Bands:
    """Spatial frequencies of light [cycles per radius], which determine the samples and the soft edge of each pupil.

    The shape of all arrays is (beam,).

    density: numbers of samples per radius of the pupil. The sampled light has a periodic spectrum, whose period is this
        number of cycles per radius.
    passband: highest frequency at which the spectrum of the aperture is the same with a soft edge as with a sharp edge.
    around: largest changes of frequency by diffraction at the edge. The edge diffracts a ray of one frequency to a band
        of frequencies around it. Only diffracted light that arrives in the window counts.
    """

    density: np.ndarray
    passband: np.ndarray
    around: np.ndarray

    def where(self, chosen: np.ndarray, other: Bands) -> Bands:
        """Return these bands for the chosen beams, and those of `other` for the rest."""
        pairs = (self.density, other.density), (self.passband, other.passband), (self.around, other.around)
        return Bands(*(np.where(chosen, own, their) for own, their in pairs))

    def stepped(self, chosen: np.ndarray) -> Bands:
        """Return these bands, with the attribute `density` of the chosen beams rounded up to a number 2^(k/EDGES).

        k is an integer. There are only a few such numbers, so pupils with similar light get equal numbers of samples
        per radius, and can share the arrays for their samples. The passband grows by the same factor as the density.
        """
        density = in_steps(self.density)
        return Bands(density, self.passband * (density / self.density), self.around).where(chosen, self)


def in_steps(values: np.ndarray, count: int = EDGES) -> np.ndarray:
    """Return values rounded up to the next of the numbers 2^(k/count), where k is an integer.

    count: number of steps k per octave, that is, from a number to its double.
    """
    return np.asarray(2.0 ** (np.ceil(count * np.log2(values) - 1e-9) / count))


def medians(values: np.ndarray) -> np.ndarray:
    """Return the median of each row of a matrix. The function `np.median` takes several times as long."""
    last = values.shape[1] // 2
    first = (values.shape[1] - 1) // 2
    ordered = np.partition(values, sorted({first, last}), axis=1)
    return np.asarray((ordered[:, first] + ordered[:, last]) / 2)
